"""The tables of a two-level analysis, their columns declared."""

from __future__ import annotations

from typing import Literal

from ...data.tables import Columns, TableColumn

TERM = TableColumn("term", "A factor, or several with × between them.", type=str)

EFFECTS = Columns(
    "Effect",
    "Change of the mean response from the low to the high level.",
    (),
    (
        TERM,
        TableColumn("order", "Number of its factors.", type=int),
        TableColumn("coefficient", "Half the effect.", in_json=False),
        TableColumn("effect", "The change.", heading="effect"),
        TableColumn("std_error", "Its standard error.", heading="std_error"),
        TableColumn("low", "Of the confidence interval.", heading="low"),
        TableColumn("high", "Of the confidence interval.", heading="high"),
        TableColumn("t", "Effect over its standard error.", heading="t"),
        TableColumn("p", "Of the test that there is no effect.", heading="p"),
        TableColumn("share", "Of the total sum of squares.", heading="share"),
        TableColumn("significant", "Whether it can be told from noise.", type=bool),
        TableColumn("ratio", "High over low, for logarithms; null otherwise, as its interval.",
                    heading="ratio", sometimes=True),
        TableColumn("ratio_low", "Of the confidence interval.", sometimes=True),
        TableColumn("ratio_high", "Of the confidence interval.", sometimes=True),
        TableColumn("verdict", "With --practical.", heading="verdict",
                    type=Literal["matters", "too small", "undecided"] | None, sometimes=True),
    ),
)  # fmt: skip
ANOVA = Columns(
    "SourceOfVariance",
    "A source of the variance of a two-level design.",
    (),
    (
        TableColumn("source", "A term, or what is left.", type=str),
        TableColumn("ss", "Sum of squares."),
        TableColumn("df", "Degrees of freedom."),
        TableColumn("ms", "Mean square."),
        TableColumn("f", "Of the test against the error."),
        TableColumn("p", "Of this test."),
    ),
)
_ROW = TableColumn("index", "Number of the row.", type=int, in_json=False)
MAIN_EFFECTS = Columns(
    "MainEffect",
    "Mean of the points' means at a level of a factor.",
    (),
    (
        _ROW,
        TableColumn("factor", "Its name.", type=str),
        TableColumn("level", "Which.", type=Literal["low", "high"]),
        TableColumn("value", "Of the level."),
        TableColumn("mean", "Of the response."),
    ),
)
INTERACTIONS = Columns(
    "Interaction",
    "Mean of the points' means at a pair of levels of two factors.",
    (),
    (
        _ROW,
        TableColumn("first", "Name of a factor.", type=str),
        TableColumn("second", "Name of the other.", type=str),
        TableColumn("first_value", "Level of the first."),
        TableColumn("second_value", "Level of the other."),
        TableColumn("mean", "Of the response."),
    ),
)
