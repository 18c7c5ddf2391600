"""The table of the designs of a question, its columns declared."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from ..data.tables import Columns, TableColumn
from ..words.numbers import bounds
from ..words.shares import percent_at_least, percent_at_most
from .sequential import Rule, share_bounds

DESIGNS = Columns(
    "DesignDecided",
    "A design of a question, in its worst condition.",
    (),
    (
        TableColumn("cost", "Sum of the costs of its levels.", heading="cost", type=float),
        TableColumn("verdict", "The design surely suffices, surely does not, or neither is sure.",
                    heading="verdict", type=Literal["suffices", "fails", "undecided"]),
        TableColumn("condition", "Name of the condition; empty if there is only one.", type=str),
        TableColumn("runs", "Number of runs that count: those until the design was decided.",
                    heading="runs", type=int),
        TableColumn("passed", "Number of these runs that pass.", type=int),
        TableColumn("estimate", "Value that the required share of the runs is within; null if too "
                    "many are lost."),
        TableColumn("lower", "Lower bound of the percentile; null where none is claimed, as for a "
                    "design that suffices."),
        TableColumn("upper", "Upper bound of the percentile; null for a design that fails."),
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


def surely(row: Mapping[Any, Any], rule: Rule, flag: str) -> str:
    """Bounds of a design, in all conditions or in one: of the percentile of its response, or of the
    share of its runs that are not ``flag``."""
    if not flag:
        return bounds(row["lower"], row["upper"])
    verdict = row["verdict"]
    low, high = share_bounds(row["passed"], row["runs"], rule, verdict != "undecided")
    said = [
        *([f"≥ {percent_at_least(low)}"] if low > 0 and verdict != "fails" else []),
        *([f"≤ {percent_at_most(high)}"] if high < 1 and verdict != "suffices" else []),
    ]
    return ", ".join(said) or "–"
