"""Runs checks in processes of their own, so that a crash is a finding and nothing worse."""

from __future__ import annotations

import json
import os
import pickle
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from fmpy.model_description import ModelDescription

from ..files import scratch
from ..read.archive import Archive
from ..read.description import library_of
from .bench import ACCEPTED, STANDARDS
from .checks import Check
from .facts import subject_of
from .subject import Subject
from .trace import read_trace

State = Literal["passed", "failed", "warning", "blocked", "does not apply", "not run"]

PATIENCE = 30.0
"""Seconds that a call may take."""
_CRASHES = 5
"""Number of crashes after which a check is abandoned."""


@dataclass(frozen=True, slots=True)
class CheckOutcome:
    """Result of a check.

    Attributes
    ----------
    reason
        What was seen if the check passed; otherwise why it did not, in one line.
    clause
        Edition and section of the standard that is violated; empty if none.
    """

    state: State
    reason: str
    clause: str = ""


@contextmanager
def unpacked(archive: Archive, description: ModelDescription) -> Iterator[Path]:
    """A folder with an FMU for Co-Simulation, ready for `run`.

    Raises
    ------
    FmuError
        The FMU cannot be unpacked, or has no binary for this machine.
    """
    library = library_of(archive, description)
    with tempfile.TemporaryDirectory(dir=scratch(), ignore_cleanup_errors=True) as name:
        folder = Path(name)
        archive.unpack(folder / "fmu")
        subject = subject_of(description, folder / "fmu", library)
        (folder / "subject").write_bytes(pickle.dumps(subject))
        yield folder


def run(folder: Path, check: Check, patience: float) -> CheckOutcome:
    """Run a check on an unpacked FMU.

    Parameters
    ----------
    patience
        Seconds after which a call that has not returned counts as hanging.
    """
    subject: Subject = pickle.loads((folder / "subject").read_bytes())
    outcome = CheckOutcome("passed", "")
    for step in range(len(check.steps)):
        outcome = _step(folder, subject, check, step, patience)
        if outcome.state != "passed":
            break
    return outcome


@dataclass(frozen=True, slots=True)
class _Finding:
    """A call with a bad end, described by ``how``. The clause, if any, forbids that."""

    how: str
    call: str
    clause: str | None


def _step(folder: Path, subject: Subject, check: Check, step: int, patience: float) -> CheckOutcome:
    standard = STANDARDS[subject.fmi]
    findings: list[_Finding] = []
    first = 0
    (folder / ACCEPTED).unlink(missing_ok=True)
    while len(findings) < _CRASHES:
        (folder / "result").unlink(missing_ok=True)
        ending = _process(folder, check, step, first, patience)
        if ending is None:
            result = json.loads((folder / "result").read_text())
            if result["resume"] is not None and result["state"] == "passed":
                first = result["resume"]
                continue
            if findings or (result["state"] == "passed" and (folder / ACCEPTED).exists()):
                break
            clause = f"{standard}, {result['clause']}" if result["clause"] else ""
            return CheckOutcome(result["state"], _without(folder, result["reason"]), clause)
        position = read_trace(folder / "trace")
        violated = check.clauses[subject.fmi - 2] if position.probe is None else position.clause
        said = f" ({position.said})" if position.said else ""
        findings.append(_Finding(ending, position.call + said, violated))
        if position.probe is None:
            break
        first = position.probe + 1  # the others may get an answer
    untried = len(findings) == _CRASHES
    findings += _accepted(folder)
    blamed = [finding for finding in findings if finding.clause]
    lawful = len({finding.call for finding in findings} - {finding.call for finding in blamed})
    also = [f"and {lawful} more, lawfully"] if blamed and lawful else []
    also += ["other calls were not tried"] if untried else []
    reason = _without(folder, "; ".join([_told(blamed or findings), *also]))
    if not blamed:
        return CheckOutcome("warning", reason)
    cited = ", ".join(dict.fromkeys(finding.clause or "" for finding in blamed))
    return CheckOutcome("failed", reason, f"{standard}, {cited}")


def _accepted(folder: Path) -> list[_Finding]:
    """The calls that should have been refused and were not."""
    path = folder / ACCEPTED
    lines = path.read_text("utf-8").splitlines() if path.is_file() else []
    return [_Finding("accepts", *json.loads(line)) for line in lines]


def _without(folder: Path, text: str) -> str:
    """A text without the name of a temporary folder."""
    return text.replace(f"{folder / 'fmu'}/", "")


def _told(findings: Sequence[_Finding]) -> str:
    calls: dict[str, dict[str, None]] = {}
    for finding in findings:
        calls.setdefault(finding.how, {})[finding.call] = None
    return "; ".join(f"{how} {_some([*names])}" for how, names in calls.items())


def _some(names: Sequence[str]) -> str:
    more = f" and {len(names) - _CRASHES} more" if len(names) > _CRASHES else ""
    return ", ".join(names[:_CRASHES]) + more


def _process(folder: Path, check: Check, step: int, first: int, patience: float) -> str | None:
    """Run one step; None if it has left a result, otherwise how it ended instead."""
    arguments = [str(folder), check.name, str(step), str(first)]
    (folder / "trace").unlink(missing_ok=True)
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", f"{__package__}.child", *arguments],
        # Output of the FMU, or of a process that it starts, must not block us.
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        start_new_session=True,
    )  # fmt: skip
    with process:
        try:
            ended = _wait(process, folder, patience)
        finally:
            _end(process)
    if not ended:
        return f"has not returned after {patience:g} s from"
    code = process.returncode
    if (folder / "result").is_file() and code == 0:
        return None
    if (folder / "broken").is_file():
        raise RuntimeError(f"the check {check.name} is broken:\n{(folder / 'broken').read_text()}")
    if code < 0:
        names = {s.value: s.name for s in signal.Signals}
        return f"crashes ({names.get(-code, f'signal {-code}')}) in"
    return f"ends the process (exit code {code & 0xFFFFFFFF:#x}) in"


def _wait(process: subprocess.Popen[bytes], folder: Path, patience: float) -> bool:
    """Whether the process has ended; False if it hangs."""
    seen = ""
    while True:
        try:
            process.wait(patience)
            return True
        except subprocess.TimeoutExpired:
            count = read_trace(folder / "trace").count
            if count == seen:
                return False
            seen = count


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a process that hangs or was interrupted, and everything it has started."""
    if sys.platform == "win32":
        process.kill()
        return
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
