"""The tables of an analysis of factors with any number of levels, their columns declared."""

from __future__ import annotations

from typing import Literal

from ...data.tables import Columns, TableColumn

_LEVEL = str | float
FACTOR = TableColumn("factor", "Label of the factor.", type=str)
ERROR = (
    TableColumn("std_error", "Standard error.", in_json=False),
    TableColumn("df", "Degrees of freedom of the standard error.", in_json=False),
)

ANOVA = Columns(
    "SourceOfSquares",
    "A source of the variance of a design of any levels.",
    (),
    (
        TableColumn("source", "A term of the model, a residual, or the total.", type=str),
        TableColumn("df", "Degrees of freedom."),
        TableColumn("sum_sq", "Sum of squares."),
        TableColumn("mean_sq", "Mean square."),
        TableColumn("F", "Statistic of the test against the error."),
        TableColumn("p", "Probability of this test."),
        TableColumn("epsilon", "Greenhouse and Geisser's factor of the degrees of freedom, with "
                    "common random numbers.", sometimes=True),
        TableColumn("mean_sq_error", "Mean square of the error in the test, with common random "
                    "numbers.", sometimes=True),
    ),
)  # fmt: skip
MEANS = Columns(
    "LevelMean",
    "Marginal mean at a level of a factor of a grid.",
    (),
    (
        FACTOR,
        TableColumn("level", "The level.", type=_LEVEL),
        TableColumn("runs", "Number of runs at the level.", type=int),
        TableColumn("lost", "Share of lost runs."),
        TableColumn("mean", "Mean that counts every combination of the other factors once."),
        *ERROR,
        TableColumn("low", "Lower end of the interval of this mean alone."),
        TableColumn("high", "Upper end of the interval of this mean alone."),
    ),
)
MEDIANS = Columns(
    "LevelMedian",
    "Median of all runs at a level of a factor of a grid.",
    (),
    (
        FACTOR,
        TableColumn("level", "The level.", type=_LEVEL),
        TableColumn("median", "Median of the response itself."),
        TableColumn("low", "Lower end of the interval by order statistics; null if there are too "
                    "few runs."),
        TableColumn("high", "Upper end of the interval by order statistics; null if there are too "
                    "few runs."),
        TableColumn("all_low", "Lower end of the interval that holds for all levels of the factor "
                    "at once.", in_json=False),
        TableColumn("all_high", "Upper end of the interval that holds for all levels of the factor "
                    "at once.", in_json=False),
    ),
)  # fmt: skip
PAIRS = Columns(
    "LevelPair",
    "Difference of two levels of a factor of a grid.",
    (),
    (
        FACTOR,
        TableColumn("one", "A level.", type=_LEVEL),
        TableColumn("other", "The level that it is compared with.", type=_LEVEL),
        TableColumn("difference", "Mean of one minus that of other."),
        *ERROR,
        TableColumn("t", "Difference over its standard error.", in_json=False),
        TableColumn("low", "Lower end of the interval that holds for all pairs of the factor at "
                    "once."),
        TableColumn("high", "Upper end of the interval that holds for all pairs of the factor at "
                    "once."),
        TableColumn("p", "Adjusted probability."),
        TableColumn("ratio", "Ratio of one to other, for logarithms.", sometimes=True,
                    in_json=False),
        TableColumn("ratio_low", "Lower end of the ratio's interval.", sometimes=True,
                    in_json=False),
        TableColumn("ratio_high", "Upper end of the ratio's interval.", sometimes=True,
                    in_json=False),
        TableColumn("median_difference", "Difference of the levels' medians; with common seeds, "
                    "median of the differences within a replicate."),
        TableColumn("median_low", "Lower end of its interval; null if there are too few runs."),
        TableColumn("median_high", "Upper end of its interval; null if there are too few runs."),
        TableColumn("differs", "Whether the levels differ. Medians decide this and the verdict "
                    "where they come first in the answer.", type=bool),
        TableColumn("verdict", "Verdict by the option --practical.",
                    type=Literal["equal", "differs", "undecided"] | None, sometimes=True),
    ),
)  # fmt: skip
CELLS = Columns(
    "LevelCell",
    "Marginal mean at a pair of levels of two factors.",
    (),
    (
        TableColumn("first", "Label of a factor.", type=str),
        TableColumn("second", "Label of the other factor.", type=str),
        TableColumn("first_level", "Level of the first factor.", type=_LEVEL),
        TableColumn("second_level", "Level of the other factor.", type=_LEVEL),
        TableColumn("runs", "Number of runs at the pair.", type=int),
        TableColumn("lost", "Share of lost runs."),
        TableColumn("mean", "Mean that counts every combination of the other factors once."),
        *ERROR,
        TableColumn("low", "Lower end of the interval of this mean alone."),
        TableColumn("high", "Upper end of the interval of this mean alone."),
    ),
)
