"""Runs the checks on an FMU and gathers what they say.

The static checks are made here; every step of a dynamic one in a process of its own (`child`), so
that a crash or a call that does not return is a finding and nothing worse.
"""

from __future__ import annotations

import importlib.util
import json
import math
import os
import pickle
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal
from xml.etree import ElementTree

from fmpy import extract
from fmpy.model_description import ModelDescription, ModelVariable
from fmpy.validation import validate_fmu
from sblcosim.models.ports import REQUIRED_ESTIMATE

from .. import check as plug
from ..archive import DESCRIPTION
from ..errors import FmuError, nearest
from ..files import scratch
from .checks import CHECKS, Check
from .host import read_trace
from .subject import Number, Subject, Variable

State = Literal["passed", "failed", "does not apply", "not run"]

PATIENCE = 30.0
"""Seconds that a call may take."""
_STEPS = 20
_STEP = 0.1
"""Communication interval in s where the FMU suggests none."""
_TOLERANCE = 1e-6
_CRASHES = 5
"""So many crashes are told of one check; then it is left."""

_ERROR_OF_FMUTOOL = re.compile(r"^ERROR\s*\|\s*(.*)$", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Result:
    """What came of one check.

    Attributes
    ----------
    what
        The promise that was checked.
    reason
        What was seen if it passed; else why it did not pass, in one line.
    """

    name: str
    what: str
    state: State
    reason: str


@dataclass(frozen=True, slots=True)
class Report:
    """What came of all checks of an FMU.

    Attributes
    ----------
    fmi
        Version of the standard that the FMU follows.
    """

    path: Path
    fmi: str
    results: tuple[Result, ...]

    @property
    def ok(self) -> bool:
        """Whether nothing failed."""
        return not self.count("failed")

    def __getitem__(self, name: str) -> Result:
        return next(result for result in self.results if result.name == name)

    def count(self, state: State) -> int:
        """How many checks came to this."""
        return sum(result.state == state for result in self.results)

    def to_json(self) -> dict[str, Any]:
        """The report as plain data."""
        return {
            "fmu": str(self.path),
            "fmi": self.fmi,
            "ok": self.ok,
            "checks": [asdict(result) for result in self.results],
        }

    def __str__(self) -> str:
        width = max(len(r.name) for r in self.results)
        lines = [f"{r.name:{width}}  {r.state:14}  {r.reason}".rstrip() for r in self.results]
        states: tuple[State, ...] = ("passed", "failed", "does not apply", "not run")
        counts = ", ".join(f"{n} {state}" for state in states if (n := self.count(state)))
        return "\n".join([*lines, f"{self.path.name}, FMI {self.fmi}: {counts}"])


def examine(
    path: str | Path, *, only: Collection[str] = (), patience: float = PATIENCE
) -> Report:
    """Check an FMU for Co-Simulation.

    Parameters
    ----------
    only
        Names of checks, of `NAMES`; none: all. The life cycle is part of all dynamic ones.
    patience
        Seconds after which a call that has not returned counts as hanging.

    Raises
    ------
    FmuError
        There is no such file or no such check, or it is not an FMU of FMI 2.0 or 3.0 for
        Co-Simulation with a binary for this machine.
    """
    path, chosen = Path(path), set(only or NAMES)
    for name in chosen.difference(NAMES):
        raise FmuError(
            f"a check must be one of {', '.join(NAMES)}; got {name!r}{nearest(name, NAMES)}"
        )
    description, files = _read(path)
    results = [
        Result(name, what, *static(path)) for name, what, static in _STATIC if name in chosen
    ]
    checks = [c for c in CHECKS if c.name in chosen]
    if checks and "life cycle" not in chosen:
        checks.insert(checks[0].name == "functions", _LIFE_CYCLE)
    with tempfile.TemporaryDirectory(dir=scratch(), ignore_cleanup_errors=True) as place:
        folder = Path(place)
        try:
            extract(path, folder / "fmu")
        except Exception as error:  # FMPy raises Exception itself
            raise FmuError(f"{path}: must be possible to unpack, got: {error}") from error
        subject = _subject(description, folder / "fmu", files)
        (folder / "subject").write_bytes(pickle.dumps(subject))
        alive = True
        for check in checks:
            state, reason = (
                _run(folder, check, patience) if alive else ("not run", "there is no life cycle")
            )
            alive &= check.name != "life cycle" or state == "passed"
            results.append(Result(check.name, check.what, state, reason))
    return Report(path, description.fmiVersion, tuple(results))


def _read(path: Path) -> tuple[ModelDescription, list[str]]:
    description, files, _ = plug.read_fmu(path)
    for finding in plug.check_kind(description, files):
        if finding.severity == "error":
            raise FmuError(f"{path}: {finding.message}")
    return description, list(files)


# ---- static checks ----


def _description(path: Path) -> tuple[State, str]:
    problems = validate_fmu(str(path))
    if problems:
        return "failed", _listed([" ".join(str(problem).split()) for problem in problems])
    return "passed", "FMPy finds nothing against it"


def _fmutool(path: Path) -> tuple[State, str]:
    if importlib.util.find_spec("fmu_manipulation_toolbox") is None:
        return "not run", "it needs a package: pip install fmu-manipulation-toolbox"
    code = "from fmu_manipulation_toolbox.cli.fmutool import fmutool; fmutool()"
    done = subprocess.run(
        [sys.executable, "-P", "-c", code, "-input", os.path.abspath(path), "-check"],
        capture_output=True, text=True, errors="replace", check=False,
    )  # fmt: skip
    errors = _ERROR_OF_FMUTOOL.findall(done.stdout + done.stderr)
    if errors:
        return "failed", _listed([" ".join(error.split()) for error in errors])
    if done.returncode != 0:
        last = (done.stderr or done.stdout).strip().splitlines()[-1:]
        return "failed", f"fmutool ends with code {done.returncode}: {''.join(last)}"
    return "passed", "fmutool -check finds nothing against it"


def _plug_contract(path: Path) -> tuple[State, str]:
    report = plug.check_receiver(path)
    missing = [name for name in REQUIRED_ESTIMATE if name not in report.names]
    errors = [f"{f.variable} {f.message}" for f in report.of("error")]
    claimed = any(error.startswith("terminal ") for error in errors)
    if missing and not claimed:
        return "does not apply", f"the FMU is no receiver: it has no {' and no '.join(missing)}"
    if errors:
        return "failed", _listed(errors)
    warnings = len(report.of("warning"))
    also = f", {warnings} with a catch: see 'sblcosim check'" if warnings else ""
    return "passed", f"{len(report.of('ok')) - 1} ports agree with it{also}"


def _listed(problems: list[str], most: int = 3) -> str:
    more = f"; and {len(problems) - most} more" if len(problems) > most else ""
    return "; ".join(problems[:most]) + more


_STATIC: tuple[tuple[str, str, Callable[[Path], tuple[State, str]]], ...] = (
    ("description", "modelDescription.xml is valid", _description),
    ("fmutool", "the FMU Manipulation Toolbox finds no error", _fmutool),
    ("plug contract", "a receiver's ports are those of 'sblcosim check'", _plug_contract),
)


NAMES = (*(name for name, _, _ in _STATIC), *(check.name for check in CHECKS))
"""Names of all checks, in their order."""

_LIFE_CYCLE = next(check for check in CHECKS if check.name == "life cycle")


# ---- dynamic checks ----


def _run(folder: Path, check: Check, patience: float) -> tuple[State, str]:
    state: State = "passed"
    reason = ""
    for step in range(len(check.steps)):
        crashes: list[tuple[str, str]] = []
        first = 0
        while len(crashes) < _CRASHES:
            (folder / "result").unlink(missing_ok=True)
            ending = _process(folder, check, step, first, patience)
            if ending is None:
                state, reason = json.loads((folder / "result").read_text())
                break
            _, probe, what = read_trace(folder / "trace")
            crashes.append((ending, what))
            if probe is None:
                break
            first = probe + 1  # the others may be answered
        if crashes:
            return "failed", _crashed(crashes)
        if state != "passed":
            break
    return state, reason


def _crashed(crashes: Sequence[tuple[str, str]]) -> str:
    calls: dict[str, dict[str, None]] = {}
    for ending, what in crashes:
        calls.setdefault(ending, {})[what] = None
    parts = [f"{ending} {', '.join(whats)}" for ending, whats in calls.items()]
    return "; ".join([*parts, *["other calls were not tried"] * (len(crashes) == _CRASHES)])


def _process(folder: Path, check: Check, step: int, first: int, patience: float) -> str | None:
    """Run one step; None if it has left a result, else how it has ended instead."""
    arguments = [str(folder), check.name, str(step), str(first)]
    (folder / "trace").unlink(missing_ok=True)
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", f"{__package__}.child", *arguments],
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    with process:
        try:
            said = _wait(process, folder, patience)
        finally:
            process.kill()  # if it is still there: it hangs, or somebody has interrupted us
    if said is None:
        return f"has not returned after {patience:g} s from"
    if (folder / "result").is_file() and process.returncode == 0:
        return None
    code = process.returncode
    text = said.decode(errors="replace")
    if "Traceback (most recent call last)" in text:
        raise RuntimeError(f"the check {check.name} is broken:\n{text}")
    if code < 0:
        return f"crashes ({signal.Signals(-code).name}) in"
    return f"ends the process (exit code {code & 0xFFFFFFFF:#x}) in"


def _wait(process: subprocess.Popen[bytes], folder: Path, patience: float) -> bytes | None:
    """What the process has printed before its end; None if it hangs."""
    seen = ""
    while True:
        try:
            return process.communicate(timeout=patience)[0]
        except subprocess.TimeoutExpired:
            count = read_trace(folder / "trace")[0]
            if count == seen:
                return None
            seen = count


# ---- facts ----


def _subject(description: ModelDescription, folder: Path, files: list[str]) -> Subject:
    kind = description.coSimulation
    binary = next(b for b in plug.binary_files(description).values() if b in files)
    variables = [_variable(v, description) for v in description.modelVariables]
    places = {id(v): i for i, v in enumerate(description.modelVariables)}
    experiment = description.defaultExperiment
    start = _number(experiment and experiment.startTime) or 0.0
    stop = _number(experiment and experiment.stopTime)
    internal = _number(kind.fixedInternalStepSize)
    step = _number(experiment and experiment.stepSize) or internal or _STEP
    whole = math.inf if stop is None else math.floor((stop - start) / step * (1 + 1e-9))
    serialises = kind.canGetAndSetFMUstate and kind.canSerializeFMUstate
    return Subject(
        fmi=description.fmiMajorVersion,
        version=description.fmiVersion,
        token=description.guid or "",
        library=str(folder / binary),
        resources=str(folder / "resources"),
        functions=plug.functions_of(description),
        once=kind.canBeInstantiatedOnlyOncePerProcess,
        saves=kind.canGetAndSetFMUstate,
        serialises=serialises,
        variable_steps=kind.canHandleVariableCommunicationStepSize,
        derivatives=_derivatives(folder, description.fmiMajorVersion),
        start=start,
        step=step,
        steps=int(max(4, min(_STEPS, whole))),
        tolerance=_number(experiment and experiment.tolerance) or _TOLERANCE,
        internal_step=internal,
        variables=tuple(variables),
        dependencies=tuple(_dependencies(description, places)),
    )


def _derivatives(folder: Path, fmi: int) -> bool:
    """Whether there are directional derivatives; FMPy does not read that in FMI 3."""
    kind = ElementTree.parse(folder / DESCRIPTION).getroot().find("CoSimulation")
    name = "providesDirectionalDerivative" + ("s" if fmi == 3 else "")
    return kind is not None and kind.get(name) in ("true", "1")


def _number(text: Any) -> float | None:
    return None if text is None else float(text)


def _dependencies(
    description: ModelDescription, places: dict[int, int]
) -> Iterator[tuple[int, tuple[int, ...]]]:
    inputs = [v for v in description.modelVariables if v.causality == "input"]
    for unknown in description.outputs:
        if unknown.variable is not None:
            known = inputs if unknown.dependencies is None else unknown.dependencies
            yield (
                places[id(unknown.variable)],
                tuple(places[id(v)] for v in known if v.causality == "input"),
            )


def _variable(variable: ModelVariable, description: ModelDescription) -> Variable:
    def attribute(name: str) -> Any:
        value = getattr(variable, name)
        return getattr(variable.declaredType, name, None) if value is None else value

    kind = variable.type
    if kind == "Enumeration":
        kind = "Integer" if description.fmiMajorVersion == 2 else "Int64"
    size = math.prod(variable.shape or ())
    return Variable(
        name=variable.name,
        reference=variable.valueReference,
        kind=kind,
        causality=variable.causality,
        variability=variable.variability,
        size=size,
        start=_start(variable.start, kind, size),
        min=_number(attribute("min")),
        max=_number(attribute("max")),
        unit=attribute("unit"),
        choice=variable.type == "Enumeration",
        clocked=bool(variable.clocks),
    )


def _start(text: str | None, kind: str, size: int) -> tuple[Number, ...] | None:
    if text is None or kind in ("String", "Binary", "Clock"):
        return None
    words = text.split()
    if kind == "Boolean":
        values: list[Number] = [word in ("true", "1") for word in words]
    elif kind in ("Real", "Float64", "Float32"):
        values = [float(word) for word in words]
    else:
        values = [int(word) for word in words]
    values = values * size if len(values) == 1 else values
    return tuple(values) if len(values) == size else None
