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
        TableColumn("order", "Number of factors in the term.", type=int),
        TableColumn("coefficient", "Half the effect.", in_json=False),
        TableColumn("effect", "The change.", heading="effect"),
        TableColumn("std_error", "Standard error of the effect.", heading="std_error"),
        TableColumn("low", "Lower end of the confidence interval.", heading="low"),
        TableColumn("high", "Upper end of the confidence interval.", heading="high"),
        TableColumn("t", "Effect over its standard error.", heading="t"),
        TableColumn("p", "Probability of the test that there is no effect.", heading="p"),
        TableColumn("share", "Share of the total sum of squares.", heading="share"),
        TableColumn("significant", "Whether it can be told apart from noise.", type=bool),
        TableColumn("ratio", "Ratio of high to low, for logarithms; otherwise null, like its "
                    "interval.", heading="ratio", sometimes=True),
        TableColumn("ratio_low", "Lower end of the ratio's interval.", sometimes=True),
        TableColumn("ratio_high", "Upper end of the ratio's interval.", sometimes=True),
        TableColumn("verdict", "Verdict by the option --practical.", heading="verdict",
                    type=Literal["matters", "too small", "undecided"] | None, sometimes=True),
    ),
)  # fmt: skip
ANOVA = Columns(
    "SourceOfVariance",
    "A source of the variance of a two-level design.",
    (),
    (
        TableColumn("source", "A term of the model, a residual, or the total.", type=str),
        TableColumn("ss", "Sum of squares."),
        TableColumn("df", "Degrees of freedom."),
        TableColumn("ms", "Mean square."),
        TableColumn("f", "Statistic of the test against the error."),
        TableColumn("p", "Probability of this test."),
    ),
)
_ROW = TableColumn("index", "Number of the row.", type=int, in_json=False)
MAIN_EFFECTS = Columns(
    "MainEffect",
    "Mean of the points' means at a level of a factor.",
    (),
    (
        _ROW,
        TableColumn("factor", "Name of the factor.", type=str),
        TableColumn("level", "Side of the level.", type=Literal["low", "high"]),
        TableColumn("value", "Value of the level."),
        TableColumn("mean", "Mean of the response."),
    ),
)
INTERACTIONS = Columns(
    "Interaction",
    "Mean of the points' means at a pair of levels of two factors.",
    (),
    (
        _ROW,
        TableColumn("first", "Name of a factor.", type=str),
        TableColumn("second", "Name of the other factor.", type=str),
        TableColumn("first_value", "Level of the first factor."),
        TableColumn("second_value", "Level of the other factor."),
        TableColumn("mean", "Mean of the response."),
    ),
)
