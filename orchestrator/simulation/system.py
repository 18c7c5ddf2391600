"""System: which components there are and how they are connected. Pure data.

`sblcosim.simulation.resolve.resolve` makes a plan of a system,
`sblcosim.simulation.masters.python.execute` runs the plan::

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

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from numpy.typing import NDArray
from sblcosim.models.declaration import Number, Variable

Value = Number | Sequence[Any]
"""A parameter's value: a number, or the elements of an array row by row (flat or nested)."""


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
