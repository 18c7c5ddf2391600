"""Output of commands for studies with ``--json``."""

from __future__ import annotations

from typing import Any, Literal

from ...analysis.advice.tables import POINTS
from ...analysis.levels.tables import MEANS as LEVEL_MEANS
from ...analysis.levels.tables import MEDIANS as LEVEL_MEDIANS
from ...analysis.levels.tables import PAIRS as LEVEL_PAIRS
from ...analysis.means.tables import MEANS
from ...analysis.space.tables import INDICES
from ...analysis.two_level.tables import EFFECTS
from ...data.tables import TableColumn
from ...require.tables import DESIGNS
from .document import Claimed, Document, DocumentPart, Entry, Number, part_of


class Studies(Document):
    """The included studies."""

    studies: list[Entry]


class Questions(Document):
    """The included questions."""

    questions: list[Entry]


class CovarianceOverPoints(DocumentPart):
    """Number of points of a study with a right covariance; each point over its replicates."""

    points: int
    in_band: int
    optimistic: int
    pessimistic: int
    untold: int
    """Points with too few runs for a verdict."""
    optimistic_from: Number
    """Smallest factor on the standard deviation, of the optimistic points."""
    optimistic_to: Number
    pessimistic_from: Number
    pessimistic_to: Number
    runs: int
    """Runs at the point with the fewest."""
    runs_needed: int | None
    """Runs needed to detect a factor of 1.1, at the point that needs most."""
    words: str


class StudyReceiver(DocumentPart):
    """A receiver over all runs of a study."""

    rms_m: Number
    """RMS of the absolute total error over all runs: root of the mean of their mean squares."""
    inconsistent: Number
    """Share of the runs whose mean NEES lies above its band; null if none has a covariance."""
    lost: Number
    """Share of lost runs."""
    misleading: Number
    """Share of misleading runs among those with a NEES; null if none has one."""
    covariances: dict[Claimed, CovarianceOverPoints]
    """By frame."""


class Estimate(DocumentPart):
    """What a study would run, and how long it would take."""

    steps: int
    """Steps of the whole system, over all runs."""
    seconds_from: Number
    """Time on this machine; null if nothing is missing."""
    seconds_to: Number


class Study(Document):
    """A study after all its runs or, with ``--dry-run``, before them."""

    folder: str
    points: int
    replicates: int
    runs: int
    finished: int
    """Runs in the folder, including failed ones."""
    failed: int
    failure: str | None
    """Message of the first failure."""
    receivers: dict[str, StudyReceiver]
    """Empty with --dry-run."""
    estimate: Estimate | None
    """Only with --dry-run."""








Effect: Any = part_of(EFFECTS)
Mean: Any = part_of(MEANS)
LevelMean: Any = part_of(LEVEL_MEANS)
LevelMedian: Any = part_of(LEVEL_MEDIANS)
LevelPair: Any = part_of(LEVEL_PAIRS)
SobolIndex: Any = part_of(INDICES)


class Analysis(Document):
    """The effects of a two-level study, the largest first, or the means of a sweep, the levels of a
    grid, or the indices of a space."""

    folder: str
    report: str
    response: str
    """Column of the table of runs."""
    unit: str
    answer: str
    transform: Literal["none", "log", "spread"]
    method: Literal["ols", "replicates", "lenth"] | None
    """Null for means."""
    confidence: float
    runs: int
    """Number of runs that were analysed."""
    dropped: int
    """Runs without a finite response."""
    left_out: Number
    """Share of a space's base rows that are left out for a run without a response, else null."""
    r2: Number
    effects: list[Effect]
    """Of a two-level design."""
    means: list[Mean]
    """Of a sweep, or without factors."""
    levels: list[LevelMean]
    """Of a grid."""
    medians: list[LevelMedian]
    """Of a grid."""
    pairs: list[LevelPair]
    """Of a grid."""
    indices: list[SobolIndex]
    """Of a space."""
    notes: list[str]



DesignPoint: Any = part_of(
    POINTS, TableColumn("levels", "By factor.", type=dict[str, float | str])
)


class Answer(DocumentPart):
    """The design points by cost, the cheapest first, for one question."""

    answer: str
    response: str
    unit: str
    limit: Number
    percentile: Number
    """Null: the mean."""
    contamination: float
    confidence: float
    chosen: int | None
    """Index of the cheapest point that meets the requirement."""
    runs_needed: int
    missing: int
    """Number of missing runs at the point with the fewest."""
    free: list[str]
    """Factors without a cost."""
    points: list[DesignPoint]


class Advice(Document, Answer):
    """The cheapest design that suffices."""

    folder: str
    beside: Answer | None
    """The other question, answered from the same runs; null without a limit."""



DesignDecided: Any = part_of(
    DESIGNS, TableColumn("levels", "By choice.", type=dict[str, float | str])
)


class Limiting(DocumentPart):
    """A source of error of the named design."""

    name: str
    without: Number
    """Value that the required share of the runs would be within without it."""


class Requirement(Document):
    """The answer to a question; the designs by cost, the cheapest first."""

    folder: str
    report: str
    scenario: str | None
    """File of the chosen design's scenario."""
    answer: str
    response: str
    unit: str
    limit: float
    share: float
    confidence: float
    most_runs: int
    runs: int
    """Number of runs of all designs."""
    chosen: int | None
    """Index of the cheapest design that surely suffices."""
    cheaper: int | None
    """Index of the next cheaper one that is worth its cost."""
    nearest: int
    """Index of the design closest to the requirement."""
    limits: list[Limiting]
    """Sources of error, the largest first."""
    enough: list[str]
    """Sources without which a failing design would suffice; empty if not even all are enough."""
    designs: list[DesignDecided]
