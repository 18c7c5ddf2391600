"""What commands for studies print with ``--json``."""

from __future__ import annotations

from typing import Literal

from .document import Claimed, Document, DocumentPart, Entry, Number


class Studies(Document):
    """The studies that come with the project."""

    studies: list[Entry]


class Questions(Document):
    """The questions that come with the project."""

    questions: list[Entry]


class CovarianceOverPoints(DocumentPart):
    """Of how many points of a study a covariance is right; each point over its replicates."""

    points: int
    in_band: int
    optimistic: int
    pessimistic: int
    untold: int
    """Points whose runs cannot tell."""
    optimistic_from: Number
    """Smallest factor on the standard deviation, of the optimistic points."""
    optimistic_to: Number
    pessimistic_from: Number
    pessimistic_to: Number
    runs: int
    """At the point with the fewest."""
    runs_needed: int | None
    """To tell a factor of 1.1, at the point that takes most."""
    words: str


class StudyReceiver(DocumentPart):
    """A receiver over all runs of a study."""

    rms_m: Number
    """RMS of the absolute total error over all runs: root of the mean of their mean squares."""
    inconsistent: Number
    """Share of the runs whose mean NEES lies above its band; null if none has a covariance."""
    lost: Number
    """Share of the runs."""
    covariances: dict[Claimed, CovarianceOverPoints]
    """By frame."""


class Estimate(DocumentPart):
    """What a study would take."""

    steps: int
    """Of the whole system, over all runs."""
    seconds_from: Number
    """On this machine; null if nothing is missing."""
    seconds_to: Number


class Study(Document):
    """A study after all its runs, or before, with ``--dry-run``."""

    folder: str
    points: int
    replicates: int
    runs: int
    finished: int
    """Runs that are in the folder, failed ones included."""
    failed: int
    failure: str | None
    """The first message."""
    receivers: dict[str, StudyReceiver]
    """Empty with --dry-run."""
    estimate: Estimate | None
    """Only with --dry-run."""


class Effect(DocumentPart):
    """Change of the mean response from the low to the high level."""

    term: str
    """A factor, or several with × between them."""
    order: int
    effect: Number
    std_error: Number
    low: Number
    """Of the confidence interval."""
    high: Number
    t: Number
    p: Number
    share: Number
    """Of the total sum of squares."""
    significant: bool
    ratio: Number = None
    """High over low, for logarithms; null otherwise, as its interval."""
    ratio_low: Number = None
    ratio_high: Number = None
    verdict: Literal["matters", "too small", "undecided"] | None = None
    """With --practical."""


class Mean(DocumentPart):
    """Mean response at a level of a factor, the others at their base."""

    factor: str
    """Empty for a study without factors."""
    value: Number
    runs: int
    mean: Number
    std: Number
    low: Number
    """Of the 95 % interval of the mean."""
    high: Number


class LevelMean(DocumentPart):
    """Marginal mean at a level of a factor of a grid."""

    factor: str
    level: str | float
    runs: int
    lost: Number
    """Share of the runs."""
    mean: Number
    low: Number
    """Of the interval of this mean alone."""
    high: Number


class LevelMedian(DocumentPart):
    """Median of all runs at a level of a factor of a grid."""

    factor: str
    level: str | float
    median: Number
    low: Number
    """Of the interval by order statistics; null if the runs are too few for one."""
    high: Number


class LevelPair(DocumentPart):
    """Difference of two levels of a factor of a grid."""

    factor: str
    one: str | float
    other: str | float
    difference: Number
    """Mean of one less that of other."""
    low: Number
    """Of the interval that holds for all pairs of the factor at once."""
    high: Number
    p: Number
    """Adjusted."""
    median_difference: Number
    """Of the levels; with common seeds the median of the differences within a replicate."""
    median_low: Number
    """As `low`; null if the runs are too few for one."""
    median_high: Number
    differs: bool
    """Judged by medians where these stand first in the answer, as is the verdict."""
    verdict: Literal["equal", "differs", "undecided"] | None = None
    """With --practical."""


class SobolIndex(DocumentPart):
    """Share of the variance of a response that a factor of a space explains."""

    response: str
    factor: str
    """``seed``: chance."""
    first: Number
    """Alone."""
    first_low: Number
    first_high: Number
    total: Number
    """With all interactions."""
    total_low: Number
    total_high: Number


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
    """That were analysed."""
    dropped: int
    """Runs without a finite response."""
    left_out: Number
    """Share of the base rows of a space that a run without a response leaves out, else null."""
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


class DesignPoint(DocumentPart):
    """A point of the design, with the runs at it."""

    levels: dict[str, float | str]
    """By factor."""
    cost: float
    runs: int
    lost: int
    lost_upper: Number
    """Bound of the share of lost runs."""
    estimate: Number
    """Of the percentile, or of the mean."""
    upper: Number
    """Its bound; null where there is none."""
    front: bool
    """No other point is cheaper and better."""
    meets: bool


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
    """Runs that are missing at the point with the fewest."""
    free: list[str]
    """Factors without a cost."""
    points: list[DesignPoint]


class Advice(Document, Answer):
    """The cheapest design that is good enough."""

    folder: str
    beside: Answer | None
    """The other question, answered from the same runs; null without a limit."""


class DesignDecided(DocumentPart):
    """A design of a question, in the condition that is worst for it."""

    levels: dict[str, float | str]
    """By choice."""
    cost: float
    verdict: Literal["suffices", "fails", "undecided"]
    """It surely suffices, it surely does not, or neither is sure."""
    condition: str
    """Empty if there is one only."""
    runs: int
    """That count: until it was decided."""
    passed: int
    estimate: Number
    """What the required share of the runs is within; null if too many are lost."""
    lower: Number
    """Bound of the percentile; null where none is claimed, as of a design that suffices."""
    upper: Number
    """The same; null of a design that fails."""
    front: bool
    """No other design is cheaper and better."""


class Limiting(DocumentPart):
    """A source of error of the design that is named."""

    name: str
    without: Number
    """What the required share of the runs would be within without it."""


class Requirement(Document):
    """The answer to a question; the designs by cost, the cheapest first."""

    folder: str
    report: str
    scenario: str | None
    """File of the design that was chosen."""
    answer: str
    response: str
    unit: str
    limit: float
    share: float
    confidence: float
    most_runs: int
    runs: int
    """That were done, of all designs."""
    chosen: int | None
    """Index of the cheapest design that surely suffices."""
    cheaper: int | None
    """Index of the next cheaper one that is worth its cost."""
    nearest: int
    """Index of the design that is nearest to the requirement."""
    limits: list[Limiting]
    """The largest first."""
    enough: list[str]
    """Sources without which a design that fails would suffice; empty if not even that is enough."""
    designs: list[DesignDecided]
