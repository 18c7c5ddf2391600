"""What ``sblcosim budget --json`` prints."""

from __future__ import annotations

from typing import Any, Literal

from ...comparison.budget.tables import ROWS
from .document import Claimed, Document, Number, part_of

BudgetRow: Any = part_of(ROWS)


class Budget(Document):
    """Where the error of a receiver comes from."""

    folder: str
    scenario: str
    receiver: str
    answers: dict[Claimed, str]
    """By frame."""
    runs: int
    """With each switch."""
    dropped: int
    """Seeds that are left out, because a run of theirs failed."""
    seed: int
    """Of the first run."""
    better: bool
    """Equipment is replaced by better one, instead of switched off."""
    untold: bool
    """The receiver assumes what it does without any switch."""
    lost: Number
    """Share of the runs without any switch in which the receiver is lost at the end."""
    bound_runs: int
    """Runs over which the bound is averaged; 0 if there is none."""
    bound_kind: Literal["bound", "reference"] | None
    acceleration_psd_m2_s3: Number
    """q of the bound."""
    fixed: list[str]
    """Sources with an error that is the same in every run."""
    unchanged: list[str]
    """Sources for which nothing better is known."""
    given: list[str]
    """Keys of the receiver that the scenario gives, so that no switch changes them."""
    rows: list[BudgetRow]
