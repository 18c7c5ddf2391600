"""System: which components there are and how they are connected. Pure data.

`sblcosim.plan.resolve` makes a plan of a system, `sblcosim.master.execute` runs the plan::

    system = System(
        components={
            "clock": ComponentSpec(Path("clock.fmu"), interval_ns=100_000_000),
            "counter": ComponentSpec(Counter, interval_ns=100_000_000, parameters={"first": 5}),
        },
        connections=(Connection("clock.tick", "counter.tick"),),
        stop_ns=10_000_000_000,
    )
    record = execute(resolve(system))
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from typing import Any, Protocol

from numpy.typing import NDArray
from sblcosim.models.declaration import Number, Variable

Value = Number | Sequence[Any]
"""A parameter's value: a number, or the elements of an array row by row (flat or nested)."""

SECOND = 1_000_000_000
"""Nanoseconds per second. Time is counted in whole nanoseconds everywhere in the orchestrator."""

ROUNDING = 4
"""Units in the last place by which arithmetic may make a time miss its nanosecond."""

MAX_SECONDS = 4e9
"""All times are before that [s]; the same limit is in the C engine of our FMUs (engine.h)."""


def nanoseconds(seconds: float) -> int:
    """The whole nanoseconds that are nearest to a time in s, as it is written in decimals."""
    return round(Decimal(repr(float(seconds))) * SECOND)


def is_whole_ns(seconds: float) -> bool:
    """Whether a time is a whole number of nanoseconds, but for what rounding may do to it."""
    nearest = nanoseconds(seconds) / SECOND
    return abs(seconds - nearest) <= ROUNDING * math.ulp(seconds)


def settled(seconds: float) -> float:
    """A time without its rounding errors: ``0.21 / 5`` is 0.042 s; others stay as they are."""
    return nanoseconds(seconds) / SECOND if is_whole_ns(seconds) else seconds


def text_of(time_ns: int) -> str:
    """A time for people, in s and without rounding: ``"0.1 s"``."""
    whole, rest = divmod(abs(time_ns), SECOND)
    digits = f"{whole}.{rest:09d}".rstrip("0").rstrip(".")
    return f"{'-' if time_ns < 0 else ''}{digits} s"


class PythonComponent(Protocol):
    """A component written in Python, in place of an FMU.

    It follows the same rules of time: inputs hold during a step, outputs returned by `do_step`
    belong to the end of the step. For each run a new object is made, so there is nothing to reset.

    Examples
    --------
    A counter that adds its input to a number at every step::

        class Counter:
            variables = (
                Variable("first", "Number to begin with", "parameter", type="Int32", start=0),
                Variable("tick", "What to add", "input", type="Int32", start=0),
                Variable("number", "Sum so far", "output", type="Int32", start=0),
            )

            def initialise(self, start_ns, parameters):
                self.number = int(parameters["first"])
                return {"number": self.number}

            def do_step(self, time_ns, step_ns, inputs):
                self.number += int(inputs["tick"])
                return {"number": self.number}
    """

    @property
    def variables(self) -> Sequence[Variable]:
        """Parameters, inputs and outputs (SI units)."""

    def initialise(
        self, start_ns: int, parameters: Mapping[str, NDArray[Any]]
    ) -> Mapping[str, Any]:
        """Take all parameters (in their shapes); return all outputs at the start time."""

    def do_step(
        self, time_ns: int, step_ns: int, inputs: Mapping[str, NDArray[Any]]
    ) -> Mapping[str, Any]:
        """Advance from ``time_ns`` by ``step_ns``; return all outputs at the end of the step.

        ``inputs`` holds all inputs in their shapes, read-only and valid during the call only.
        """


@dataclass(frozen=True)
class ComponentSpec:
    """One component of a system.

    Attributes
    ----------
    fmu
        The FMU file, or what makes a Python component (its class, or a function).
    interval_ns
        Communication interval in ns.
    parameters
        Values by name of the variable, in SI units; arrays row by row. The others keep their start
        values.
    """

    fmu: Path | Callable[[], PythonComponent]
    interval_ns: int
    parameters: Mapping[str, Value] = field(default_factory=dict)


@dataclass(frozen=True)
class Connection:
    """An output feeds an input, whole variables, arrays included.

    Attributes
    ----------
    source, target
        ``"component.variable"``.
    """

    source: str
    target: str


@dataclass(frozen=True)
class System:
    """Components and connections.

    Attributes
    ----------
    components
        By name; a name has no dot.
    stop_ns, start_ns
        The run goes from ``start_ns`` to the last common multiple of all communication intervals
        (counted from ``start_ns``) that is not beyond ``stop_ns``.
    """

    components: Mapping[str, ComponentSpec]
    connections: tuple[Connection, ...] = ()
    stop_ns: int = 0
    start_ns: int = 0
