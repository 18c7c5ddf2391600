"""Output of ``sblcosim budget --json``."""

from __future__ import annotations

from typing import Any, Literal

from ...comparison.budget.tables import ROWS
from .document import Claimed, Document, Number, part_of

BudgetRow: Any = part_of(ROWS)


class Budget(Document):
    """The sources of a receiver's error."""

    folder: str
    scenario: str
    receiver: str
    answers: dict[Claimed, str]
    """By frame."""
    runs: int
    """Runs with each switch."""
    dropped: int
    """Number of seeds left out because one of their runs failed."""
    seed: int
    """Seed of the first run."""
    better: bool
    """Whether equipment is replaced with better one, instead of switched off."""
    untold: bool
    """Whether the receiver keeps the assumptions that it has without any switch."""
    lost: Number
    """Share of the runs, without any switch, that end lost."""
    bound_runs: int
    """Runs over which the bound is averaged; 0 if there is none."""
    bound_kind: Literal["bound", "reference"] | None
    acceleration_psd_m2_s3: Number
    """q of the bound."""
    fixed: list[str]
    """Sources whose error is the same in every run."""
    equipment: dict[str, str]
    """Better equipment in a few words, by source; empty if sources are switched off."""
    unchanged: list[str]
    """Sources for which no better equipment is known."""
    given: list[str]
    """Keys of the receiver that the scenario sets, so that no switch changes them."""
    rows: list[BudgetRow]
