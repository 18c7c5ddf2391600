"""Runs the checks on an FMU and collects their results.

The static checks are here. Every step of a dynamic check runs in a process of its own (`runner`),
so that a crash or a call that does not return is only a finding.
"""

from __future__ import annotations

import importlib.util
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Collection
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, get_args

from fmpy.model_description import ModelDescription
from sblcosim.models.ports import REQUIRED_ESTIMATE

from ..errors import FmuError, nearest
from ..read.archive import Archive, opened, shown
from ..read.description import DescriptionError, check_interface, describe, library_of
from . import receiver_contract as plug
from .bench import STANDARDS
from .checks import CHECKS
from .runner import PATIENCE, CheckOutcome, State, run, unpacked

_STATIC_PATIENCE = 120.0
"""Seconds that another tool may take to read the FMU."""
_ERROR_OF_FMUTOOL = re.compile(r"^ERROR\s*\|\s*(.*)$", re.MULTILINE)
_DESCRIPTION_CLAUSES = {2: "2.2", 3: "2.4"}
_TERMINAL_CLAUSES = {2: "2.3.2", 3: "2.4.9.2"}


_SEVERAL = {"warning": "warnings", "does not apply": "do not apply"}
"""States of several checks, where the words differ from those of one."""


@dataclass(frozen=True, slots=True)
class CheckResult:
    """Result of one check.

    Attributes
    ----------
    what
        The promise that was checked.
    state
        ``failed``: the standard requires otherwise. ``warning``: lawful, but will cause trouble to
        users of the FMU. ``blocked``: this machine lacks what the FMU needs, which says nothing
        about the FMU.
    reason
        What was seen if the check passed; otherwise why it did not, in one line.
    clause
        Edition and section of the standard that is violated; empty if none.
    command
        Command that repeats this check alone.
    """

    name: str
    what: str
    state: State
    reason: str
    clause: str
    command: str

    def __str__(self) -> str:
        cited = f" ({self.clause})" if self.clause else ""
        line = f"{self.name:{_WIDTH}}  {self.state:14}  {self.reason}{cited}".rstrip()
        if self.state in ("failed", "warning", "blocked"):
            line += f"\n{'':{_WIDTH}}  again: {self.command}"
        return line


@dataclass(frozen=True, slots=True)
class Report:
    """Results of all checks of an FMU.

    Attributes
    ----------
    fmi
        Version of the standard that the FMU follows.
    """

    path: Path
    fmi: str
    results: tuple[CheckResult, ...]

    @property
    def ok(self) -> bool:
        """Whether nothing failed; warnings are allowed."""
        return not self.count("failed")

    @property
    def blocked(self) -> str | None:
        """What this machine lacks for a check to be possible; None: nothing."""
        return next((r.reason for r in self.results if r.state == "blocked"), None)

    def __getitem__(self, name: str) -> CheckResult:
        return next(result for result in self.results if result.name == name)

    def count(self, state: State) -> int:
        """Number of checks with this state."""
        return sum(result.state == state for result in self.results)

    def to_json(self) -> dict[str, Any]:
        """The report as plain data."""
        return {
            "fmu": str(self.path),
            "fmi": self.fmi,
            "ok": self.ok,
            "checks": [asdict(result) for result in self.results],
        }

    @property
    def summary(self) -> str:
        """One line: number of checks with each state."""
        numbers = {state: self.count(state) for state in get_args(State)}
        counts = ", ".join(
            f"{n} {state if n == 1 else _SEVERAL.get(state, state)}"
            for state, n in numbers.items() if n
        )  # fmt: skip
        return f"{self.path.name}, FMI {self.fmi}: {counts}"

    def __str__(self) -> str:
        return "\n".join([*map(str, self.results), self.summary])


_Note = Callable[[str, str, CheckOutcome], None]
"""Takes the name of a check, its promise and its result."""


def examine(
    path: str | Path,
    *,
    only: Collection[str] = (),
    patience: float = PATIENCE,
    each: Callable[[CheckResult], object] = lambda result: None,
) -> Report:
    """Check an FMU for Co-Simulation.

    Parameters
    ----------
    only
        Names of checks, from `NAMES`; none: all. All dynamic ones include the life cycle.
    patience
        Seconds after which a call that has not returned counts as hanging.
    each
        Called with each result as soon as it is available.

    Raises
    ------
    FmuError
        There is no such file or no such check, or it is not an FMU of FMI 2.0 or 3.0 for
        Co-Simulation with a binary for this machine. (An invalid description is a failed check.)
    """
    path, chosen = Path(path), set(only or NAMES)
    for name in chosen.difference(NAMES):
        raise FmuError(
            f"check: must be one of {', '.join(NAMES)}; got {name!r}{nearest(name, NAMES)}"
        )
    results: list[CheckResult] = []

    def note(name: str, what: str, outcome: CheckOutcome) -> None:
        words = ["sblcosim", "conformance", str(path), "--check", name]
        words += ["--timeout", f"{patience:g}"] if patience != PATIENCE else []
        command = shlex.join(words)
        results.append(CheckResult(
            name, what, outcome.state, outcome.reason, outcome.clause, command)
        )
        each(results[-1])

    with opened(path) as archive:
        try:
            description = describe(archive)
        except DescriptionError as error:
            _give_up(error, archive, [*chosen], note)
            return Report(path, "unknown", tuple(results))
        check_interface(archive, description)
        library_of(archive, description)
        for name, what, static in _STATIC:
            if name in chosen:
                note(name, what, static(path, description))
        with unpacked(archive, description) as folder:
            _run_dynamic(folder, chosen, patience, note)
    return Report(path, description.fmiVersion, tuple(results))


def _run_dynamic(folder: Path, chosen: Collection[str], patience: float, note: _Note) -> None:
    """Run the dynamic checks on an unpacked FMU; all of them need the life cycle first."""
    checks = [c for c in CHECKS if c.name in chosen]
    if checks and "life cycle" not in chosen:
        checks.insert(checks[0].name == "functions", _LIFE_CYCLE)
    alive = True
    for check in checks:
        outcome = CheckOutcome("not run", "there is no life cycle")
        if alive:
            outcome = run(folder, check, patience)
        alive &= check.name != "life cycle" or outcome.state == "passed"
        note(check.name, check.what, outcome)


def _give_up(
    error: DescriptionError,
    archive: Archive,
    chosen: Collection[str],
    note: _Note,
) -> None:
    """The results of an FMU whose description cannot be read."""
    for name, what in _WHAT.items():
        if name == "description":
            reason = str(error).removeprefix(f"{archive.path}: ")
            editions = " or ".join(f"{STANDARDS[v]}, {c}" for v, c in _DESCRIPTION_CLAUSES.items())
            note(name, what, CheckOutcome("failed", reason, editions))
        elif name in chosen:
            note(name, what, CheckOutcome("not run", "the description cannot be read"))


# ---- static checks ----

_VALIDATE = """
import sys
from fmpy.validation import validate_fmu
for problem in validate_fmu(sys.argv[1]):
    print(*str(problem).split())
"""


def _description(path: Path, description: ModelDescription) -> CheckOutcome:
    try:  # in a process of its own: its parser of names may run forever
        done = subprocess.run(
            [sys.executable, "-P", "-c", _VALIDATE, os.path.abspath(path)],
            capture_output=True, text=True, errors="replace", check=True, timeout=_STATIC_PATIENCE,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return CheckOutcome("not run", f"FMPy has not validated it after {_STATIC_PATIENCE:g} s")
    except subprocess.CalledProcessError as error:
        last = "".join(error.stderr.strip().splitlines()[-1:])
        return CheckOutcome("not run", f"FMPy cannot validate it: {shown(last, 200)}")
    if done.stdout:
        fmi = description.fmiMajorVersion
        clause = f"{STANDARDS[fmi]}, {_DESCRIPTION_CLAUSES[fmi]}"
        return CheckOutcome("failed", _listed(done.stdout.splitlines()), clause)
    return CheckOutcome("passed", "FMPy finds nothing against it")


def _fmutool(path: Path, description: ModelDescription) -> CheckOutcome:
    """Result of another tool; much of it is that tool's own opinion."""
    if importlib.util.find_spec("fmu_manipulation_toolbox") is None:
        return CheckOutcome("not run", "it needs a package: pip install fmu-manipulation-toolbox")
    code = "from fmu_manipulation_toolbox.cli.fmutool import fmutool; fmutool()"
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-c", code, "-input", os.path.abspath(path), "-check"],
            capture_output=True, text=True, errors="replace", check=False, timeout=_STATIC_PATIENCE,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return CheckOutcome("not run", f"fmutool has not ended after {_STATIC_PATIENCE:g} s")
    errors = _ERROR_OF_FMUTOOL.findall(done.stdout + done.stderr)
    if errors:
        return CheckOutcome("warning", _listed([" ".join(error.split()) for error in errors]))
    if done.returncode != 0:
        last = "".join((done.stderr or done.stdout).strip().splitlines()[-1:])
        return CheckOutcome(
            "warning", f"fmutool ends with code {done.returncode}: {shown(last, 200)}"
        )
    return CheckOutcome("passed", "fmutool -check finds nothing against it")


def _plug_contract(path: Path, description: ModelDescription) -> CheckOutcome:
    """Our contract is not part of the standard, but terminals that name variables are."""
    report = plug.check_receiver(path)
    missing = [name for name in REQUIRED_ESTIMATE if name not in report.names]
    errors = [f"{f.variable} {f.message}" for f in report.of("error")]
    unlawful = [error for error in errors if error.startswith("terminal ")]
    if unlawful:
        fmi = description.fmiMajorVersion
        return CheckOutcome(
            "failed", _listed(errors), f"{STANDARDS[fmi]}, {_TERMINAL_CLAUSES[fmi]}"
        )
    if missing:
        return CheckOutcome(
            "does not apply", f"the FMU is no receiver: it has no {' and no '.join(missing)}"
        )
    if errors:
        return CheckOutcome("warning", _listed(errors))
    warnings = len(report.of("warning"))
    also = f", {warnings} with a catch: see 'sblcosim check'" if warnings else ""
    return CheckOutcome("passed", f"{len(report.of('ok')) - 1} ports agree with it{also}")


def _listed(problems: list[str], most: int = 3) -> str:
    more = f"; and {len(problems) - most} more" if len(problems) > most else ""
    return "; ".join(shown(problem, 200) for problem in problems[:most]) + more


_STATIC: tuple[tuple[str, str, Callable[[Path, ModelDescription], CheckOutcome]], ...] = (
    ("description", "modelDescription.xml is valid", _description),
    ("fmutool", "the FMU Manipulation Toolbox finds no error", _fmutool),
    ("plug contract", "a receiver's ports are those of 'sblcosim check'", _plug_contract),
)
_LIFE_CYCLE = next(check for check in CHECKS if check.name == "life cycle")
_WHAT = {
    **{name: what for name, what, _ in _STATIC},
    **{check.name: check.what for check in CHECKS},
}

NAMES = tuple(_WHAT)
"""Names of all checks, in their order."""
_WIDTH = max(map(len, NAMES))
