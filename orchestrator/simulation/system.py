"""System: the components and their connections, as plain data.

`sblcosim.simulation.resolve.resolve` turns a system into a plan, and
`sblcosim.simulation.masters.python.execute` runs it::

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

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from numpy.typing import NDArray
from sblcosim.models.declaration import Number, Variable

Value = Number | Sequence[Any]
"""A parameter's value: a number, or the elements of an array row by row (flat or nested)."""


class PythonComponent(Protocol):
    """A component written in Python, instead of an FMU.

    It follows the same rules for time: inputs hold during a step, and the outputs that `do_step`
    returns refer to the end of the step. Each run makes a new object, so there is no reset.

    Examples
    --------
    A counter that adds its input to a number at every step::

        class Counter:
            variables = (
                Variable("first", "Initial value", "parameter", type="Int32", start=0),
                Variable("tick", "Increment", "input", type="Int32", start=0),
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
        """Receive all parameters, in their shapes; return all outputs at the start time."""

    def do_step(
        self, time_ns: int, step_ns: int, inputs: Mapping[str, NDArray[Any]]
    ) -> Mapping[str, Any]:
        """Advance from ``time_ns`` by ``step_ns``; return all outputs at the end of the step.

        ``inputs`` holds all inputs, in their shapes; read-only, and valid only during the call.
        """


@dataclass(frozen=True)
class ComponentSpec:
    """One component of a system.

    Attributes
    ----------
    fmu
        The FMU file, or a class or function that makes a Python component.
    interval_ns
        Communication interval [ns].
    parameters
        Values by variable name, in SI units; arrays row by row. Other parameters keep their start
        values.
    inputs
        Values at the start, in the same way; inputs without a connection keep them.
    starts
        Values at the start of other variables of an FMU, in the same form. The FMU must allow
        setting them (``initial`` exact or approx).
    texts
        Values at the start of text variables of an FMU.
    like
        The component that `varied` made it from, if `varied` alone did. Between two components that
        are alike in this way, only the differences must be checked and hashed.
    """

    fmu: Path | Callable[[], PythonComponent]
    interval_ns: int
    parameters: Mapping[str, Value] = field(default_factory=dict)
    inputs: Mapping[str, Value] = field(default_factory=dict)
    starts: Mapping[str, Value] = field(default_factory=dict)
    texts: Mapping[str, str] = field(default_factory=dict)
    like: Likeness | None = field(default=None, init=False, compare=False, repr=False)

    def varied(
        self, changes: Mapping[str, Value], interval_ns: int | None = None
    ) -> ComponentSpec:
        """A copy with other values of some parameters, and perhaps another interval."""
        spec = ComponentSpec(
            self.fmu, interval_ns or self.interval_ns, {**self.parameters, **changes},
            self.inputs, self.starts, self.texts,
        )
        if changes.keys() <= self.parameters.keys():
            like = self.like or Likeness(self)
            object.__setattr__(spec, "like", Likeness(like.to, like.but.union(changes)))
        return spec


@dataclass(frozen=True, eq=False)
class Likeness:
    """States that a component is like another one, which itself was not derived from a third.

    Attributes
    ----------
    but
        Names of the parameters whose values may differ. Both have the same parameters, in the same
        order.
    """

    to: ComponentSpec
    but: frozenset[str] = frozenset()


def differences(specs: Collection[ComponentSpec]) -> Collection[str]:
    """The parameters in which components with the same parameters may differ."""
    likes = [spec.like or Likeness(spec) for spec in specs]
    if len({id(like.to) for like in likes}) == 1:
        return frozenset().union(*(like.but for like in likes))
    return {name for spec in specs for name in spec.parameters}


@dataclass(frozen=True)
class Conversion:
    """Conversion of a value on its way: ``factor * value + offset``.

    Attributes
    ----------
    factor, offset
        In units of the target per unit of the source, and in units of the target.
    then
        Conversion of the result; None: none.
    """

    factor: float = 1.0
    offset: float = 0.0
    then: Conversion | None = None

    @property
    def steps(self) -> tuple[Conversion, ...]:
        """The effective conversions in sequence, each without `then`."""
        own = () if (self.factor, self.offset) == (1.0, 0.0) else (
            Conversion(self.factor, self.offset),
        )
        return own if self.then is None else (*own, *self.then.steps)


@dataclass(frozen=True)
class Connection:
    """A connection from an output to an input.

    A local variable or a calculated parameter of an FMU can be connected like an output.

    Attributes
    ----------
    source, target
        ``"component.variable"``. An array is connected as a whole or, if the FMU has it as scalars,
        by element, ``"component.variable[1,2]"``.
    conversion
        Conversion of the values; with one, the units of the two ends are not compared.
    """

    source: str
    target: str
    conversion: Conversion | None = None


@dataclass(frozen=True)
class System:
    """Components and connections.

    Attributes
    ----------
    components
        Components by name; names have no dots.
    stop_ns, start_ns
        The run goes from ``start_ns`` to the last common multiple of all communication intervals
        (counted from ``start_ns``) that is not after ``stop_ns`` [ns].
    """

    components: Mapping[str, ComponentSpec]
    connections: tuple[Connection, ...] = ()
    stop_ns: int = 0
    start_ns: int = 0
