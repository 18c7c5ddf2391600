"""What is printed with ``--json`` of many runs: of a comparison, and by ``run --runs``."""

from __future__ import annotations

from typing import Any, Literal

from ...comparison.common.tables import DIFFERENCES, LEVELS
from .document import Document, DocumentPart, Number, part_of

Level: Any = part_of(LEVELS)
PairedDifference: Any = part_of(DIFFERENCES)


class Comparison(Document):
    """Receivers on the same noise."""

    answer: str
    scenarios: list[str]
    receivers: list[str]
    """The one with the least median first."""
    runs: int
    seed: int
    """Of the first run."""
    settling_s: float
    response: str
    unit: str
    practical: Number
    contamination: float
    same_start: bool
    """Whether no receiver is told where the diver starts."""
    knowing_start: dict[str, list[str]]
    """Receivers that are told, by scenario."""
    levels: list[Level]
    differences: list[PairedDifference]
    update_s: dict[str, dict[str, Number]]
    """Time of an update by scenario and receiver; only roughly the same the next time."""
    folder: str


class DrawnRun(DocumentPart):
    """A run that is in a folder of its own."""

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
    """Of the first run."""
    receivers: list[str]
    data_sheet: list[str]
    """A sentence for a data sheet for each receiver, or why there is none."""
    levels: list[Level]
    drawn: dict[Literal["typical", "worst"], DrawnRun]
    """Empty if the first receiver has failed in all runs."""
    folder: str
