"""What is printed with ``--json`` of many runs: of a comparison, and by ``run --runs``."""

from __future__ import annotations

from typing import Literal

from .document import Document, DocumentPart, Number


class Level(DocumentPart):
    """A response of a receiver over the runs of a scenario, or over all of them."""

    scenario: str
    """Or ``all scenarios``, where a seed's value is the mean over the scenarios."""
    receiver: str
    response: str
    runs: int
    """Seeds."""
    failed: int
    """Of those, without a response."""
    mean: Number
    """Of the others; of an RMS response the mean of the runs' RMS."""
    rms_over_runs: Number
    """Root of the mean over the runs of their mean squares, over all scenarios the mean of theirs;
    null if the response is no RMS."""
    std: Number
    median: Number
    least: Number
    most: Number
    low: Number
    """Of the 95 % interval of the mean; null if there are too few runs."""
    high: Number
    within: Number
    """95th percentile over the runs; null if more have failed."""
    within_upper: Number
    """Its 95 % upper bound; null with fewer than 59 runs."""
    tail: Number
    """Share of the squares about the median that the worst runs make, 1 in 20."""
    tail_runs: int
    heavy_tailed: bool
    lost: int
    """Runs, over all scenarios where it is of all."""
    lost_low: Number
    """Of the 95 % interval of the share of lost runs; null over all scenarios."""
    lost_high: Number
    covariance: Literal["in band", "optimistic", "pessimistic", "one run", "unknown"]
    covariance_factor: Number
    """True standard deviation over the claimed one; above 1 is optimistic."""
    covariance_words: str
    nees_runs: int
    """Seeds with a NEES."""


class PairedDifference(DocumentPart):
    """A response of a receiver minus that of another; less is better."""

    scenario: str
    response: str
    one: str
    other: str
    runs: int
    wins: int
    """Runs in which the first one is better."""
    losses: int
    """Runs in which it is worse."""
    verdict: Literal["better", "worse", "equal", "undecided"]
    """Of the first one."""
    share_low: Number
    """Of all dives, at least, in which the better one is better; null if neither surely is."""
    median: Number
    low: Number
    """Of the interval of the median, which holds at once with all others; null if there is none."""
    high: Number
    mean: Number
    mean_low: Number
    """Of the interval of the mean; null where its assumptions do not hold, or undecided."""
    mean_high: Number
    least: int
    """Runs that a verdict takes at least."""
    mean_least: int
    """Runs that an interval of the mean takes at least."""
    runs_needed: int | None
    """Estimated number of runs that would decide."""


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
    levels: list[Level]
    drawn: dict[Literal["typical", "worst"], DrawnRun]
    """Empty if the first receiver has failed in all runs."""
    folder: str
