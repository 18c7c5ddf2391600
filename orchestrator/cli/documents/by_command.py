"""Output of commands with ``--json``, by command."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from ...answer import Answer
from ...identification.result import NUMBERS
from ...judge.columns import ERRORS, PERCENTILES, SUMMARY
from ...logs.tables import BEACONS, FLAWS, SERIES
from ...results.range_test import RANGE_TEST
from ...scenario.json_schema import Plainly
from .areas import Distances, Map
from .budgets import Budget
from .document import Claimed, Document, DocumentPart, Entry, Number, by_index, part_of
from .logs import Processed
from .studies import Advice, Analysis, Questions, Requirement, Studies, Study
from .tournaments import Comparison, Runs


class Scenarios(Document):
    """The included scenarios."""

    scenarios: list[Entry]


class ReceiverEntry(DocumentPart):
    """A receiver that can be chosen by name."""

    name: str
    description: str
    purpose: str
    """Purpose of the receiver."""
    keys: list[str]
    """Its keys in the table ``[receiver]``."""


class Receivers(Document):
    """The receivers that can be chosen by name."""

    receivers: list[ReceiverEntry]


Errors: Any = by_index(ERRORS)
Percentiles: Any = by_index(PERCENTILES)
Summary: Any = by_index(SUMMARY)


class Covariance(DocumentPart):
    """Whether a covariance is right, from the mean NEES of some runs."""

    verdict: Literal["in band", "optimistic", "pessimistic", "one run", "unknown"]
    factor: Number
    """True standard deviation over the claimed one; above 1 is optimistic."""
    runs: int
    """Number of runs with a NEES."""
    mean_nees: Number
    basis: Literal["mean", "median"]
    """Kind of value that is compared with 3; the median if few runs dominate the mean."""
    centre: Number
    """This mean or median."""
    low: Number
    """Lower end of its 95 % interval."""
    high: Number
    """Upper end of its 95 % interval."""
    runs_far_above: int
    """Runs beyond what normal errors explain."""
    runs_needed: int | None
    """Number of runs needed to detect a factor of 1.1."""
    lost_share: float
    """Share of lost runs; if it is high, a covariance that is not optimistic is unknown."""
    words: str
    """The verdict as a sentence."""


class Possible(DocumentPart):
    """What was possible at the epochs of a receiver's estimates."""

    kind: Literal["bound", "reference"]
    absolute_rms_m: Number
    relative_rms_m: Number
    accuracy: bool
    """False where no accuracy is possible; the numbers are then null."""
    bearing_std_deg: float
    acceleration_psd_m2_s3: float
    without: list[str]
    """Keys of ``[platform]`` whose errors are left out. With them, the possible error is larger."""
    left_out_m: dict[str, Number]
    """Estimated RMS of these errors by description, if they matter; null: not known."""
    with_left_out_m: Number
    """Estimated possible RMS error that includes them."""


class Motion(DocumentPart):
    """q of the diver's motion for a receiver: the density of the white acceleration."""

    assumed_m2_s3: Number
    """The number that it was given; null: it learned q from the ranges."""
    median_m2_s3: Number
    """Median of what it learned, over its updates; null: it does not say."""
    last_m2_s3: Number
    """What it had learned at its last update."""


class Run(Document):
    """A run; everything that is by receiver has its labels as keys."""

    scenario_name: str
    seeds: dict[str, int]
    """Seeds by component."""
    remarks: list[str]
    failures: dict[str, str] = Field(default_factory=dict)
    """Messages of receivers that failed."""
    errors: Errors
    """Errors by receiver, frame and axis (north, east, down); estimate minus truth."""
    percentiles: Percentiles
    """Percentiles by receiver, frame and length."""
    consistency: dict[str, dict[Claimed, Covariance]]
    """Verdicts by receiver and frame."""
    summary: Summary
    limits: dict[str, Possible]
    """Possible errors by receiver; empty if target, platform or acoustics are not ours."""
    motion: dict[str, Motion]
    """What receivers assumed or learned about the diver's motion; none without such a q."""
    folder: str


class Smoothed(Run):
    """A run with the smoother beside its receivers."""

    steps_m: list[float]
    """Largest change of the track in each pass."""
    converged: bool
    believable: bool
    """Whether nothing speaks against the track. If not, its estimates are those of the filter."""
    doubts: list[str]
    """What speaks against the track."""


class Component(DocumentPart):
    """A component of a plan."""

    name: str
    origin: str
    """File of the FMU, or name of the class."""
    fmi: int | None
    """FMI version; null for Python."""
    sha256: str
    """Hash; empty for a class that is not from a file."""
    interval_s: float
    tick_s: Number


class Parameter(DocumentPart):
    """A parameter that is set, and the values of its elements in SI units."""

    name: str
    type: str
    unit: str | None
    references: list[int]
    values: list[float | int | bool]


class Connection(DocumentPart):
    """An input and the output that it is taken from."""

    source: str
    target: str


class Recorded(DocumentPart):
    """A recorded output."""

    name: str
    type: str
    shape: list[int]


class Plan(Document):
    """What would run, and how it is connected."""

    start_s: float
    stop_s: float
    instants: int
    """Number of communication instants."""
    components: list[Component]
    parameters: list[Parameter]
    connections: list[Connection]
    recorded: list[Recorded]


class SoundSpeed(DocumentPart):
    """A speed of sound and its standard uncertainty, in m/s."""

    value: float
    std: float



RangeTest: Any = part_of(RANGE_TEST)


class Calibration(Document):
    """The speed of sound over a known distance, and the range test."""

    settings: dict[str, float | int | list[float]]
    """The options of the command, and the distances of the range test."""
    known_distance: SoundSpeed
    per_ping_m_s: float
    """Standard deviation of the speed of sound from a single ping."""
    line: SoundSpeed
    """The speed of sound from the slope of the range test."""
    intercept_m: float
    intercept_std_m: float
    slope: float
    slope_std: float
    table: list[RangeTest]
    folder: str


HeardBeacon: Any = part_of(BEACONS)
LoggedSeries: Any = part_of(SERIES)
LoggedFlaw: Any = part_of(FLAWS)


class Place(DocumentPart):
    """The origin of north, east and down, on WGS 84."""

    latitude_deg: float
    longitude_deg: float
    height_m: float


class LogSummary(Document):
    """What is in a log."""

    name: str
    start_ns: int
    """First time; nanoseconds since 1970 if the log has dates."""
    stop_ns: int
    span_s: float
    start_utc: str | None
    """Date and time of the first; null if the log has no dates."""
    dimension: Literal[2, 3]
    """3, or 2: positions in the plane of the beacons."""
    kinds: dict[str, float]
    """Share of the ranges of each kind, such as ``one-way`` or ``inverted``."""
    origin: Place | None
    """Null if the log has no place on Earth."""
    beacons: list[HeardBeacon]
    series: list[LoggedSeries]
    flaws: list[LoggedFlaw]
    remarks: list[str]
    folder: str


DeviceNumber: Any = part_of(NUMBERS)


class Identification(Document):
    """What a log tells about its device."""

    log: str
    numbers: list[DeviceNumber]
    correlation: dict[str, float]
    """Correlation of the scale with the offset of each beacon, by its number."""
    overrides: dict[str, float]
    """Keys of the scenario that the log decides."""
    remarks: list[str]
    folder: str


class Finding(DocumentPart):
    """Remarks on a variable, or on the whole (``FMU``)."""

    variable: str
    severity: Literal["ok", "absent", "warning", "error"]
    message: str


class Check(Document):
    """Whether an FMU can be a receiver."""

    fmu: str
    ok: bool
    findings: list[Finding]


class CheckResult(DocumentPart):
    """The outcome of one check."""

    name: str
    what: str
    """The promise that was checked."""
    state: Literal["passed", "failed", "warning", "blocked", "does not apply", "not run"]
    reason: str
    clause: str
    """Edition and section of the standard, where it says otherwise."""
    command: str
    """Command that repeats the check."""


class Conformance(Document):
    """Whether an FMU keeps the promises of the standard and its own."""

    fmu: str
    fmi: str
    ok: bool
    checks: list[CheckResult]


DOCUMENTS: Mapping[str, type[Document]] = {
    "run": Run,
    "runs": Runs,
    "compare": Comparison,
    "smooth": Smoothed,
    "replay": Run,
    "plan": Plan,
    "calibrate": Calibration,
    "identify": Identification,
    "map": Map,
    "distances": Distances,
    "log": LogSummary,
    "process": Processed,
    "scenarios": Scenarios,
    "receivers": Receivers,
    "study": Study,
    "analyse": Analysis,
    "advise": Advice,
    "budget": Budget,
    "studies": Studies,
    "require": Requirement,
    "questions": Questions,
    "check": Check,
    "conformance": Conformance,
}
"""Documents by command."""
COMMANDS: Mapping[str, str] = {it: it for it in DOCUMENTS} | {
    "runs": "run --runs N", "distances": "map --distance M",
}  # fmt: skip
"""Command that prints a document."""


def document(answer: Answer, folder: Path) -> Document:
    """The document of an answer that has been written to a folder."""
    return DOCUMENTS[answer.document].of(answer.to_json() | answer.located(folder))


def schema(command: str) -> dict[str, Any]:
    """JSON schema of the output of a command with ``--json``."""
    content = DOCUMENTS[command].model_json_schema(mode="serialization", schema_generator=Plainly)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **content,
        "title": f"sblcosim {COMMANDS[command]} --json",
    }
