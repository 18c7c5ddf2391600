"""Output of the commands for logs with ``--json``."""

from __future__ import annotations

from typing import Any, Literal

from ...processing.columns import AGREEMENT, RECEIVERS, RESIDUALS
from .document import Document, by_index

ProcessedReceivers: Any = by_index(RECEIVERS)
Residuals: Any = by_index(RESIDUALS)
Agreement: Any = by_index(AGREEMENT)


class Processed(Document):
    """A log, and what receivers made of it."""

    log: str
    """Name of the log."""
    dimension: Literal[2, 3]
    """2: positions in a plane, without depth."""
    beacons: list[str]
    """Names of the beacons."""
    ranges: int
    """Number of ranges that were used."""
    duration_s: float
    has_truth: bool
    """Whether errors could be computed."""
    remarks: list[str]
    receivers: ProcessedReceivers
    """By receiver."""
    residuals: Residuals
    """By receiver and beacon, or depth."""
    agreement: Agreement
    """By pair of receivers."""
    doubts: list[str]
    """What speaks against the track of the smoother."""
    folder: str
