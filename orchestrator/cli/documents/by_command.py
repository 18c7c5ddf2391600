"""What commands print with ``--json``, by command."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from ...answer import Answer
from ...judge.columns import ERRORS, PERCENTILES, SUMMARY
from ...results.range_test import RANGE_TEST
from ...scenario.json_schema import Plainly
from .areas import Distances, Map
from .budgets import Budget
from .document import Claimed, Document, DocumentPart, Entry, Number, by_index, part_of
from .studies import Advice, Analysis, Questions, Requirement, Studies, Study
from .tournaments import Comparison, Runs


class Scenarios(Document):
    """The scenarios that come with the project."""

    scenarios: list[Entry]


class ReceiverEntry(DocumentPart):
    """A receiver that can be chosen by name."""

    name: str
    description: str
    purpose: str
    """What it is for."""
    keys: list[str]
    """Keys of the table ``[receiver]`` that it has."""


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
    """With a NEES."""
    mean_nees: Number
    basis: Literal["mean", "median"]
    """What is compared with 3; the median if few runs make the mean."""
    centre: Number
    """That mean or median."""
    low: Number
    """Of its 95 % interval."""
    high: Number
    """Of its 95 % interval."""
    runs_far_above: int
    """Runs beyond what normal errors explain."""
    runs_needed: int | None
    """To tell a factor of 1.1."""
    lost_share: float
    """Of the runs; where many are lost, a covariance that is not optimistic is unknown."""
    words: str
    """All this as a sentence."""


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
    """Keys of ``[platform]`` whose errors are left out: with them less is possible."""
    left_out_m: dict[str, Number]
    """Estimated RMS of these errors, by what they are, if they matter; null: not known."""
    with_left_out_m: Number
    """Estimated RMS error that is possible with them."""


class Run(Document):
    """A run; everything that is by receiver has its labels as keys."""

    scenario_name: str
    seeds: dict[str, int]
    """By component."""
    remarks: list[str]
    failures: dict[str, str] = Field(default_factory=dict)
    """Messages of receivers that have failed."""
    errors: Errors
    """By receiver, frame and axis (north, east, down); estimate minus truth."""
    percentiles: Percentiles
    """By receiver, frame and length."""
    consistency: dict[str, dict[Claimed, Covariance]]
    """By receiver and frame."""
    summary: Summary
    limits: dict[str, Possible]
    """By receiver; empty where target, platform or acoustics are somebody else's."""
    folder: str


class Smoothed(Run):
    """A run with the smoother beside its receivers."""

    steps_m: list[float]
    """By how much each pass has moved the track at most."""
    converged: bool


class Component(DocumentPart):
    """A component of a plan."""

    name: str
    origin: str
    """File of the FMU, or name of the class."""
    fmi: int | None
    """Version; null for Python."""
    sha256: str
    """Empty for a class that is from no file."""
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
    """From the slope of the range test."""
    intercept_m: float
    intercept_std_m: float
    slope: float
    slope_std: float
    table: list[RangeTest]
    folder: str


class Finding(DocumentPart):
    """What there is to say about a variable, or about the whole (``FMU``)."""

    variable: str
    severity: Literal["ok", "absent", "warning", "error"]
    message: str


class Check(Document):
    """Whether an FMU can be a receiver."""

    fmu: str
    ok: bool
    findings: list[Finding]


class CheckResult(DocumentPart):
    """What came of one check."""

    name: str
    what: str
    """The promise that was checked."""
    state: Literal["passed", "failed", "warning", "blocked", "does not apply", "not run"]
    reason: str
    clause: str
    """Edition and section of the standard, where it says otherwise."""
    command: str
    """What repeats the check."""


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
    "map": Map,
    "distances": Distances,
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
"""By command."""
COMMANDS: Mapping[str, str] = {it: it for it in DOCUMENTS} | {
    "runs": "run --runs N", "distances": "map --distance M",
}  # fmt: skip
"""What prints a document."""


def document(answer: Answer, folder: Path) -> Document:
    """An answer that is in a folder, as its document."""
    return DOCUMENTS[answer.document].of(answer.to_json() | answer.located(folder))


def schema(command: str) -> dict[str, Any]:
    """JSON schema of what a command prints with ``--json``."""
    content = DOCUMENTS[command].model_json_schema(mode="serialization", schema_generator=Plainly)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **content,
        "title": f"sblcosim {COMMANDS[command]} --json",
    }
