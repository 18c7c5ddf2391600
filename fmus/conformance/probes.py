"""Calls tried on instances of their own, and the required answer to each."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from ..host.signatures import OK, WARNING
from .bench import Bench, Clauses, ConcernError, advance, begin
from .library import RefusedError, TracedInstance

Act = Callable[[TracedInstance], object]
"""Returns the status if that is judged."""

NONE, NEW, INITIALISING, STEPPING, STEPPED, TERMINATED = range(6)
"""Modes of an instance; ``NONE``: there is no instance yet."""


@dataclass(frozen=True, slots=True)
class Probe:
    """A call that must be answered in some way.

    Attributes
    ----------
    label
        Words for it.
    mode
        Mode of the instance that receives it.
    clauses
        Sections of the standard that make it lawful, or require the FMU to tolerate it.
    refusal
        Sections that require its refusal; None: any answer will do.
    """

    label: str
    mode: int
    act: Act
    clauses: Clauses = (None, None)
    refusal: Clauses | None = None


ProbeRow = (
    tuple[str, int, Act] | tuple[str, int, Act, Clauses] | tuple[str, int, Act, Clauses, Clauses]
)
"""The attributes of a `Probe`."""

NOWHERE: Clauses = (None, None)


def probed(bench: Bench, probes: Sequence[ProbeRow], what: str = "answered") -> str:
    """Make each call on an instance of its own. It must return, and some calls must be refused.

    Calls that must be tolerated come first: damage by unlawful calls does not count.
    """
    level, fmi = bench.facts["level"], bench.subject.fmi
    ordered = [Probe(*row) for row in probes]
    ordered.sort(key=lambda probe: probe.clauses[fmi - 2] is None)
    for number, probe in enumerate(ordered):
        if number < bench.first:
            continue
        bench.trace.probe(number, probe.label, probe.clauses[fmi - 2])
        try:
            instance = _ready(bench, probe.mode, level)
        except RefusedError as refusal:
            before = f"after {ordered[number - 1].label}, " if number else ""
            raise ConcernError(f"{before}{refusal}") from None
        status = probe.act(instance)
        if probe.refusal is not None and status in (OK, WARNING):
            bench.accept(probe.label, probe.refusal[fmi - 2])
        instance.free()
        # After a fatal status nothing may be called in this process.
        if (bench.subject.once or bench.library.fatal) and number + 1 < len(ordered):
            bench.resume = number + 1
            return ""
    return f"{len(probes)} calls {what}" if probes else ""


def _ready(bench: Bench, mode: int, level: str) -> TracedInstance:
    """An instance in a mode."""
    instance = TracedInstance(bench.library, born=mode != NONE)
    if mode == INITIALISING:
        instance.enter()
    elif mode > INITIALISING:
        begin(instance, level)
    if mode > STEPPING:
        advance(instance, level, 0)
    if mode == TERMINATED:
        instance.do("Terminate")
    return instance


def call(name: str, *arguments: Any) -> Act:
    return lambda instance: instance.try_(name, *arguments)


def bare(name: str, *arguments: Any) -> Act:
    """A call whose arguments include the instance."""
    return lambda instance: instance.library.call(name, *arguments)


def step(time: float, size: float) -> Act:
    return lambda instance: instance.try_("DoStep", *instance.step_arguments(time, size))


def room() -> Any:
    """Memory that an FMU may read or write."""
    return ctypes.create_string_buffer(4096)
