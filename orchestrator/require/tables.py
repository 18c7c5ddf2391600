"""The table of the designs of a question, its columns declared."""

from __future__ import annotations

from typing import Literal

from ..data.tables import Columns, TableColumn

DESIGNS = Columns(
    "DesignDecided",
    "A design of a question, in the condition that is worst for it.",
    (),
    (
        TableColumn("cost", "Sum of the costs of its levels.", heading="cost", type=float),
        TableColumn("verdict", "It surely suffices, it surely does not, or neither is sure.",
                    heading="verdict", type=Literal["suffices", "fails", "undecided"]),
        TableColumn("condition", "Empty if there is one only.", type=str),
        TableColumn("runs", "That count: until it was decided.", heading="runs", type=int),
        TableColumn("passed", "Of these.", type=int),
        TableColumn("estimate", "What the required share of the runs is within; null if too many "
                    "are lost."),
        TableColumn("lower", "Bound of the percentile; null where none is claimed, as of a design "
                    "that suffices."),
        TableColumn("upper", "The same; null of a design that fails."),
        TableColumn("front", "No other design is cheaper and better.", type=bool),
    ),
    more="a column for the level of each choice",
)  # fmt: skip
CONDITIONS = Columns(
    "DesignInCondition",
    "A design of a question in one of its conditions.",
    (),
    tuple(
        column for column in DESIGNS.columns if column.name not in ("cost", "front")
    ),
    more="a column for the level of each choice",
)
