"""What ``sblcosim budget --json`` prints."""

from __future__ import annotations

from typing import Literal

from .document import Claimed, Document, DocumentPart, Number


class BudgetRow(DocumentPart):
    """A source of error, or what is left of the whole, in one frame."""

    frame: Claimed
    source: str
    kind: Literal["all", "source", "together", "rest", "remainder"]
    """Nothing switched, one source, several, all of them, or what does not add up."""
    rms_m: Number
    """Without the source, or with better equipment; of the kind all, as it is."""
    share: Number
    """Part of the mean square that goes with it; negative where the error grows."""
    share_low: Number
    """Of the 95 % interval."""
    share_high: Number
    alone_rms_m: Number
    """With all others switched."""
    alone_share: Number
    """What it adds to the rest, as a part of the whole mean square."""
    alone_low: Number
    alone_high: Number
    bound_rms_m: Number
    """The same of what is possible; null where there is no accuracy."""
    bound_share: Number
    bound_alone_rms_m: Number
    bound_alone_share: Number


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
