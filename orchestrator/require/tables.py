"""The table of the designs of a question, its columns declared."""

from __future__ import annotations

from collections.abc import Mapping
from math import isnan
from typing import Any, Literal

import numpy as np

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
        TableColumn("lower", "Lower bound of the percentile, of the largest one over the "
                    "conditions; null where none is claimed, as for a design that suffices."),
        TableColumn("upper", "Upper bound of the same; null for a design that fails."),
        TableColumn("share_lower", "Lower bound of the share of all runs that pass, of the "
                    "smallest one over the conditions, of a response that a run is or is not; "
                    "null where none is claimed, and of other responses."),
        TableColumn("share_upper", "Upper bound of this share."),
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


def claimed_share(
    passed: int, runs: int, rule: Rule, verdict: str
) -> tuple[float, float]:
    """Bounds of the share of an arm's runs that pass, NaN where none is claimed."""
    low, high = share_bounds(passed, runs, rule, verdict != "undecided")
    return (
        low if low > 0 and verdict != "fails" else np.nan,
        high if high < 1 and verdict != "suffices" else np.nan,
    )


def surely(row: Mapping[Any, Any], flag: str) -> str:
    """Bounds of a design, in all conditions or in one: of the percentile of its response, or of the
    share of its runs that are not ``flag``."""
    if not flag:
        return bounds(row["lower"], row["upper"])
    low, high = row["share_lower"], row["share_upper"]
    said = [
        *([] if isnan(low) else [f"≥ {percent_at_least(low)}"]),
        *([] if isnan(high) else [f"≤ {percent_at_most(high)}"]),
    ]
    return ", ".join(said) or "–"
