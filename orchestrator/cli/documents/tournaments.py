"""Output of comparisons and of ``run --runs`` with ``--json``."""

from __future__ import annotations

from typing import Any, Literal

from ...comparison.common.tables import DIFFERENCES, LEVELS
from .document import Document, DocumentPart, Number, part_of

Level: Any = part_of(LEVELS)
PairedDifference: Any = part_of(DIFFERENCES)


class Comparison(Document):
    """Receivers compared on the same noise."""

    answer: str
    scenarios: list[str]
    receivers: list[str]
    """Receivers, beginning with the smallest median."""
    runs: int
    seed: int
    """Seed of the first run."""
    settling_s: float
    response: str
    unit: str
    practical: Number
    contamination: float
    same_start: bool
    """Whether no receiver is told where the diver starts."""
    knowing_start: dict[str, list[str]]
    """Receivers that know the start, by scenario."""
    levels: list[Level]
    differences: list[PairedDifference]
    update_s: dict[str, dict[str, Number]]
    """Time of an update by scenario and receiver; it varies from time to time."""
    folder: str


class DrawnRun(DocumentPart):
    """A run with a separate folder."""

    seed: int
    rms_m: float
    """RMS total error of the first receiver."""


class Runs(Document):
    """Many runs of a scenario."""

    scenario_name: str
    answer: str
    """A line for each receiver."""
    runs: int
    seed: int
    """Seed of the first run."""
    receivers: list[str]
    within_m: dict[str, Number]
    """Radius that holds 95 % of the estimates of all runs, by receiver."""
    data_sheet: list[str]
    """A sentence for a data sheet for each receiver, or why there is none."""
    levels: list[Level]
    drawn: dict[Literal["typical", "worst"], DrawnRun]
    """Empty if the first receiver has failed in all runs."""
    folder: str
