"""The tables of an analysis of factors with any number of levels, their columns declared."""

from __future__ import annotations

from typing import Literal

from ...data.tables import Columns, TableColumn

_LEVEL = str | float
FACTOR = TableColumn("factor", "Label of the factor.", type=str)
ERROR = (
    TableColumn("std_error", "Standard error.", in_json=False),
    TableColumn("df", "Its degrees of freedom.", in_json=False),
)

ANOVA = Columns(
    "SourceOfSquares",
    "A source of the variance of a design of any levels.",
    (),
    (
        TableColumn("source", "A term, or what is left.", type=str),
        TableColumn("df", "Degrees of freedom."),
        TableColumn("sum_sq", "Sum of squares."),
        TableColumn("mean_sq", "Mean square."),
        TableColumn("F", "Of the test against the error."),
        TableColumn("p", "Of this test."),
        TableColumn("epsilon", "Greenhouse and Geisser's factor of the degrees of freedom, with "
                    "common random numbers.", sometimes=True),
        TableColumn("mean_sq_error", "That the mean square is compared with, likewise.",
                    sometimes=True),
    ),
)  # fmt: skip
MEANS = Columns(
    "LevelMean",
    "Marginal mean at a level of a factor of a grid.",
    (),
    (
        FACTOR,
        TableColumn("level", "The level.", type=_LEVEL),
        TableColumn("runs", "At the level.", type=int),
        TableColumn("lost", "Share of the runs."),
        TableColumn("mean", "Every combination of the other factors counts once."),
        *ERROR,
        TableColumn("low", "Of the interval of this mean alone."),
        TableColumn("high", "Of the interval of this mean alone."),
    ),
)
MEDIANS = Columns(
    "LevelMedian",
    "Median of all runs at a level of a factor of a grid.",
    (),
    (
        FACTOR,
        TableColumn("level", "The level.", type=_LEVEL),
        TableColumn("median", "Of the response itself."),
        TableColumn("low",
                    "Of the interval by order statistics; null if the runs are too few for one."),
        TableColumn("high", "As low."),
        TableColumn("all_low", "Of the interval that holds for all levels of the factor at once.",
                    in_json=False),
        TableColumn("all_high", "As all_low.", in_json=False),
    ),
)
PAIRS = Columns(
    "LevelPair",
    "Difference of two levels of a factor of a grid.",
    (),
    (
        FACTOR,
        TableColumn("one", "A level.", type=_LEVEL),
        TableColumn("other", "The level that it is compared with.", type=_LEVEL),
        TableColumn("difference", "Mean of one less that of other."),
        *ERROR,
        TableColumn("t", "Difference over its standard error.", in_json=False),
        TableColumn("low", "Of the interval that holds for all pairs of the factor at once."),
        TableColumn("high", "As low."),
        TableColumn("p", "Adjusted."),
        TableColumn("ratio", "Of one over other, for logarithms.", sometimes=True, in_json=False),
        TableColumn("ratio_low", "As `low`.", sometimes=True, in_json=False),
        TableColumn("ratio_high", "As `high`.", sometimes=True, in_json=False),
        TableColumn("median_difference",
                    "Of the levels; with common seeds the median of the differences within a "
                    "replicate."),
        TableColumn("median_low", "As `low`; null if the runs are too few for one."),
        TableColumn("median_high", "As `high`; null if the runs are too few for one."),
        TableColumn("differs",
                    "Judged by medians where these stand first in the answer, as is the verdict.",
                    type=bool),
        TableColumn("verdict", "With --practical.",
                    type=Literal["equal", "differs", "undecided"] | None, sometimes=True),
    ),
)
CELLS = Columns(
    "LevelCell",
    "Marginal mean at a pair of levels of two factors.",
    (),
    (
        TableColumn("first", "Label of a factor.", type=str),
        TableColumn("second", "Label of the other.", type=str),
        TableColumn("first_level", "Level of the first.", type=_LEVEL),
        TableColumn("second_level", "Level of the other.", type=_LEVEL),
        TableColumn("runs", "At the pair.", type=int),
        TableColumn("lost", "Share of the runs."),
        TableColumn("mean", "Every combination of the other factors counts once."),
        *ERROR,
        TableColumn("low", "Of the interval of this mean alone."),
        TableColumn("high", "As low."),
    ),
)
