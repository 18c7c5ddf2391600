"""Tools for checks: a bench, and runs to compare.

All checks compare with the same run: from the start, in steps of the default experiment, with as
much activity as the FMU accepts (which the life cycle determines).
"""

from __future__ import annotations

import hashlib
import json
import math
import pickle
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .environment import of_loader
from .library import Library, TracedInstance, output_names
from .subject import Number, Subject, SubjectVariable
from .trace import Trace

Values = list[Any]

Clauses = tuple[str | None, str | None]
"""Sections of FMI 2 and of FMI 3 that require it; None where the standard does not."""

STANDARDS = {2: "FMI 2.0.5", 3: "FMI 3.0.2"}
"""The editions whose sections are cited."""

INSTANCES = 4

ACCEPTED = "accepted"
"""Name of the file with the notes of `Bench.accept`, for all processes."""

ALL, LIVELY, REALS, STILL = LEVELS = (
    "parameters changed, inputs moving", "inputs moving", "real inputs moving", "inputs at rest"
)  # fmt: skip
"""Levels of activity in a run, the highest first."""


class ConformanceError(Exception):
    """The FMU does not keep a promise.

    Attributes
    ----------
    clauses
        Sections of the standard that require it; None: those of the whole check.
    """

    def __init__(self, reason: str, clauses: Clauses | None = None) -> None:
        super().__init__(reason)
        self.clauses = clauses


class ConcernError(Exception):
    """The FMU's behaviour is lawful but will cause trouble to its users."""


class NotApplicableError(Exception):
    """The FMU does not promise this, or it cannot be checked."""


class BlockedError(Exception):
    """The machine lacks what the FMU needs."""


@dataclass
class Bench:
    """Tools of a check.

    Attributes
    ----------
    folder
        Folder in which checks leave data for later ones.
    first
        Number of the first probe to try; earlier ones have crashed or are done.
    resume
        Number of the probe with which another process must continue; None: all are done.
    talks
        Whether instances log. Then missing dependencies can be named, but runs are slow.
    """

    subject: Subject
    folder: Path
    trace: Trace
    first: int = 0
    resume: int | None = None
    talks: bool = False
    _library: Library | None = None

    @property
    def library(self) -> Library:
        """The FMU's library, loaded on first use."""
        if self._library is None:
            try:
                self._library = Library(self.subject, self.trace)
            except OSError as error:
                reason = str(error).removeprefix(f"{self.subject.library}: ")
                missing = of_loader(reason, Path(self.subject.resources).parent)
                if missing is not None:
                    raise BlockedError(f"the library does not load here: {missing}") from None
                raise ConformanceError(f"the library does not load: {reason}") from None
        return self._library

    @property
    def facts(self) -> Any:
        """Facts that the life cycle has determined."""
        return json.loads((self.folder / "facts.json").read_text())

    def write_facts(self, **facts: Any) -> None:
        """Store facts for later checks."""
        (self.folder / "facts.json").write_text(json.dumps(facts))

    def instance(self, name: str = "conformance") -> TracedInstance:
        """A new instance."""
        return TracedInstance(self.library, name, talks=self.talks)

    def accept(self, call: str, clause: str | None) -> None:
        """Note that a call succeeded which should have been refused.

        Parameters
        ----------
        clause
            Section of the standard that requires the refusal, if any.
        """
        with (self.folder / ACCEPTED).open("a", encoding="utf-8") as file:
            file.write(json.dumps([call, clause]) + "\n")

    def reference(self) -> list[Values]:
        """The run of a fresh instance, the first one of this process.

        If a process may have only one instance, the run of another process.
        """
        facts = self.facts
        if self.subject.once:
            alike = facts["repeats"]
            rows: list[Values] = pickle.loads((self.folder / "rows").read_bytes())
        else:
            instance = self.instance()
            rows = run(begin(instance, facts["level"]), facts["level"])
            instance.free()
            alike = digest(rows) == facts["digest"]
        if not alike:
            raise NotApplicableError("the same run gives other results in another process")
        return rows


# ---- runs ----


def stimulus(
    subject: Subject, level: str, step: int, number: int = 0
) -> Iterator[tuple[SubjectVariable, list[Number]]]:
    """Values set before a step: inputs near their start values, times that follow the time.

    Parameters
    ----------
    number
        Number of the instance; each has its own inputs.
    """
    if level == STILL:
        return
    element = 0
    for v in subject.of("input"):
        values: list[Number] = []
        for start in v.start or (0,) * v.size:
            element += 1
            if v.real and v.unit == "s":
                value: Number = subject.start + step * subject.step
            elif v.real:
                swing = 0.1 * abs(start) or 1.0
                value = start + swing * math.sin(0.7 * step + 1.3 * element + 0.9 * number)
            elif v.kind == "Boolean":
                value = bool(start) != ((step // 3 + number) % 2 == 1)
            else:
                value = start + step + number
            values.append(_within(v, value) if v.number else value)
        lively = v.real or (level in (ALL, LIVELY) and (v.number or v.kind == "Boolean"))
        if lively:
            yield v, values


def _within(variable: SubjectVariable, value: Number) -> Number:
    if variable.min is not None:
        value = max(value, variable.min if variable.real else int(variable.min))
    if variable.max is not None:
        value = min(value, variable.max if variable.real else int(variable.max))
    return value


def begin(instance: TracedInstance, level: str, number: int = 0) -> TracedInstance:
    """From instantiated to ready for steps, perhaps with real parameters changed a little."""
    if level == ALL:
        share = 0.1 * (number + 1) / INSTANCES
        parameters = (
            (v, [_within(v, x + share * (abs(x) or 1.0)) for x in v.start])
            for v in instance.subject.of("parameter")
            if v.real and v.start is not None
        )
        instance.set_all(instance.library.settings(parameters))
    return instance.begin()


def advance(
    instance: TracedInstance, level: str, step: int, number: int = 0, cut: int = 1
) -> Values:
    """Set the inputs, take a step, possibly in parts, and return the outputs."""
    subject = instance.subject
    instance.set_all(instance.library.settings(stimulus(subject, level, step, number)))
    for part in range(cut):
        time = subject.start + (step + part / cut) * subject.step
        instance.step(time, subject.step / cut)
    return instance.outputs()


def run(
    instance: TracedInstance, level: str, number: int = 0, cut: int = 1, first: int = 0
) -> list[Values]:
    """The outputs now and after each step to the end of the run."""
    steps = range(first, instance.subject.steps)
    return [
        instance.outputs(),
        *(advance(instance, level, step, number, cut) for step in steps),
    ]


def digest(rows: list[Values]) -> str:
    """A hash of all results of a run."""
    return hashlib.sha256(repr(rows).encode()).hexdigest()


def expect_same(
    bench: Bench, expected: list[Values], rows: list[Values], what: str, tolerance: float = 0.0
) -> None:
    """Fail unless two runs agree to their end, with a tolerance relative to the values."""
    names = output_names(bench.subject)
    first = bench.subject.steps + 1 - len(expected)
    for step, (wanted, got) in enumerate(zip(expected, rows, strict=True)):
        for i, (a, b) in enumerate(zip(wanted, got, strict=True)):
            if a == b or (a != a and b != b):
                continue
            if tolerance and isinstance(a, float):
                size = max(abs(row[i]) for row in expected)
                if abs(a - b) <= tolerance * size:
                    continue
            time = bench.subject.start + (first + step) * bench.subject.step
            raise ConformanceError(
                f"{what}: {names[i]} must be {_text(a)} at {time:g} s, got {_text(b)}"
            )


def _text(value: Any) -> str:
    return f"{value:.9g}" if isinstance(value, float) else repr(value)


def middle(bench: Bench) -> int:
    """Number of steps in half a run."""
    return bench.subject.steps // 2


def half_way(bench: Bench) -> TracedInstance:
    """An instance in the middle of a run."""
    level = bench.facts["level"]
    instance = begin(bench.instance(), level)
    for step in range(middle(bench)):
        advance(instance, level, step)
    return instance


def refuse_single(bench: Bench) -> None:
    """A check that needs several instances does not apply to an FMU that allows only one."""
    if bench.subject.once:
        raise NotApplicableError("the FMU allows one instance per process")
