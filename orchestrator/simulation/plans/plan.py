"""Plan: a resolved and checked system, ready for any master.

`resolve` finds the errors in a system before anything starts. A plan is plain data;
``print(plan)`` shows its components, ``print(plan.text(verbose=True))`` all of it.

For each type there is one *vector* with the outputs of all components, one after another. A
component's outputs are a slice of it, read by one FMI call. Its inputs are gathered from it by
index and set by one FMI call.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus.host.instances import DTYPES
from sblcosim.fmus.host.nanoseconds import text_of
from sblcosim.fmus.read.archive import shown
from sblcosim.fmus.read.ports import Fmu, Port
from sblcosim.models import COMPONENTS
from sblcosim.models.declaration import Number

from ...layout import table
from ...words.lists import counted, listed
from ..code.user_code import PythonSource
from ..system import Connection, Conversion, PythonComponent

TICK_PARAMETERS = frozenset(c.interval for c in COMPONENTS.values() if c.interval is not None)
"""Names of the parameters that hold a component's tick interval [s]."""

PROGRESS_INTERVAL = 0.1
"""Minimum time between two progress reports of a run [s]."""


@dataclass(frozen=True)
class Setting:
    """A parameter and the values of its elements."""

    port: Port
    values: tuple[Number, ...]


@dataclass(frozen=True)
class Read:
    """All outputs of one type of a component, stored in ``vector[start:stop]``."""

    type: str
    ports: tuple[Port, ...]
    start: int
    stop: int

    @property
    def references(self) -> tuple[int, ...]:
        """Value references, in the order of the values."""
        return tuple(r for port in self.ports for r in port.references)


@dataclass(frozen=True)
class Write:
    """All connected inputs of one type of a component, taken from ``vector[sources]``.

    Attributes
    ----------
    columns
        Columns in which the connections begin.
    conversions
        For values that need one: their places in the write, and their conversions in sequence.
    """

    type: str
    ports: tuple[Port, ...]
    connections: tuple[Connection, ...]
    columns: tuple[Column, ...]
    sources: tuple[int, ...]
    conversions: tuple[tuple[int, Conversion], ...] = ()

    @property
    def references(self) -> tuple[int, ...]:
        """Value references, in the order of the values."""
        return tuple(r for port in self.ports for r in port.references)

    @property
    def rounds(self) -> list[list[tuple[int, float, float]]]:
        """The conversions: place, factor and offset; each round holds a value at most once."""
        rounds: list[list[tuple[int, float, float]]] = []
        turns: dict[int, int] = {}
        for place, conversion in self.conversions:
            turn = turns[place] = turns.get(place, -1) + 1
            if turn == len(rounds):
                rounds.append([])
            rounds[turn].append((place, conversion.factor, conversion.offset))
        return rounds


LAG = "lag"
"""Parameter of a receiver: maximum additional age of its estimates [s]."""


@dataclass(frozen=True)
class PlannedComponent:
    """A resolved component.

    Attributes
    ----------
    source
        The FMU, or the callable that makes a Python component.
    ports
        All variables, by name.
    tick_ns
        Tick interval [ns]; None if the component has no parameter for it.
    settings
        Parameters to set.
    reads, writes
        Outputs and connected inputs; one entry per type.
    texts
        Texts to set, with their variables.
    """

    name: str
    source: Fmu | Callable[[], PythonComponent]
    ports: Mapping[str, Port]
    interval_ns: int
    tick_ns: int | None
    settings: tuple[Setting, ...]
    reads: tuple[Read, ...]
    writes: tuple[Write, ...]
    texts: tuple[tuple[Port, str], ...] = ()

    @property
    def tick_parameter(self) -> str:
        """Name of the parameter that holds `tick_ns`."""
        return min(TICK_PARAMETERS & self.ports.keys())

    @property
    def lag_s(self) -> float:
        """Value of the parameter `LAG` [s]; 0 without one."""
        port = self.ports.get(LAG)
        if port is None or port.causality != "parameter" or port.size != 1:
            return 0.0
        given = [s.values for s in self.settings if s.port.name == LAG]
        return float(np.ravel(given[-1] if given else port.start or 0.0)[0])

    @property
    def origin(self) -> str:
        """Where the component comes from, for display."""
        if isinstance(self.source, Fmu):
            return self.source.path.name
        return getattr(self.source, "__qualname__", repr(self.source))

    @property
    def sha256(self) -> str:
        """SHA-256 that identifies the FMU in runs, or the user's Python file; otherwise empty."""
        return self.source.known_as if isinstance(self.source, Fmu) else self.file_sha256

    @property
    def file_sha256(self) -> str:
        """SHA-256 of the FMU's file, or of the user's Python file; otherwise empty."""
        return self.source.sha256 if isinstance(self.source, Fmu | PythonSource) else ""


@dataclass(frozen=True)
class Column:
    """A recorded variable: ``vector[start:stop]``, reshaped to ``shape``."""

    name: str
    type: str
    shape: tuple[int, ...]
    start: int

    @property
    def stop(self) -> int:
        """End of its values in the vector."""
        return self.start + math.prod(self.shape)


@dataclass(frozen=True)
class Plan:
    """A master's work, as plain data.

    Attributes
    ----------
    components
        In the order in which they step. The order has no effect: all inputs of an instant are set
        before any step.
    columns
        All recorded variables.
    sizes
        Length of the vector of each type.
    start_ns, stop_ns
        First and last communication instant [ns].
    """

    components: tuple[PlannedComponent, ...]
    columns: tuple[Column, ...]
    sizes: Mapping[str, int]
    start_ns: int
    stop_ns: int

    @property
    def instants(self) -> NDArray[np.int64]:
        """All communication instants [ns]: the multiples of all intervals, start included."""
        grids = [
            np.arange(self.start_ns, self.stop_ns + 1, interval, dtype=np.int64)
            for interval in {c.interval_ns for c in self.components}
        ]
        return grids[0] if len(grids) == 1 else np.unique(np.concatenate(grids))

    @property
    def intervals_ns(self) -> dict[str, int]:
        """Communication intervals [ns], by component."""
        return {c.name: c.interval_ns for c in self.components}

    @property
    def count(self) -> int:
        """Number of communication instants, computed without listing them."""
        duration = self.stop_ns - self.start_ns
        given = {c.interval_ns for c in self.components}
        # An interval that is a multiple of another adds no instants.
        intervals = [n for n in given if not any(n % m == 0 for m in given - {n})]
        return 1 + sum(
            (1 if size % 2 else -1) * (duration // math.lcm(*some))
            for size in range(1, len(intervals) + 1)
            for some in combinations(intervals, size)
        )

    @property
    def row_size(self) -> int:
        """Bytes per instant in the record of all outputs."""
        sizes = ((kind, n) for kind, n in self.sizes.items())
        return 8 + sum(n * np.dtype(DTYPES[kind]).itemsize for kind, n in sizes)

    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """The components and what feeds them.

        Parameters
        ----------
        verbose
            Whether to list every parameter, input and recorded variable, with FMI references.
        width
            Number of text columns to fit into; None: the full width of the tables.
        """
        parts = [_components(self, width), *(_variables(self, width) if verbose else ())]
        return "\n\n".join([self.span, *("\n".join(part) for part in parts)])

    @property
    def span(self) -> str:
        """Start, end and number of communication instants, in a line."""
        span = f"{text_of(self.start_ns)} to {text_of(self.stop_ns)}"
        return f"Run from {span}: {self.count} communication instants"

    @property
    def contents(self) -> str:
        """How many parameters, inputs and recorded variables it has, in words."""
        set_, inputs = (sum(len(_set(c) if one else _feeds(c)) for c in self.components)
                        for one in (True, False))  # fmt: skip
        return listed([
            counted(set_, "parameter"), counted(inputs, "input"),
            counted(len(self.columns), "recorded variable"),
        ])  # fmt: skip

    def __str__(self) -> str:
        return self.text()


def _set(component: PlannedComponent) -> list[tuple[Port, str]]:
    """The parameters that are set, with their values as text."""
    return [
        (s.port, _brief(s.values) + (f" {s.port.unit}" if s.port.unit else ""))
        for s in component.settings
    ] + [(port, shown(text)) for port, text in component.texts]


def _feeds(component: PlannedComponent) -> list[tuple[Port, Connection]]:
    """The inputs that are connected, with their connections."""
    return [pair for w in component.writes for pair in zip(w.ports, w.connections, strict=True)]


def _components(plan: Plan, width: int | None) -> Iterator[str]:
    rows = [
        (
            c.name,
            c.origin,
            str(c.source.fmi) if isinstance(c.source, Fmu) else "Python",
            text_of(c.interval_ns),
            ", ".join(dict.fromkeys(edge.source.partition(".")[0] for _, edge in _feeds(c))),
        )
        for c in plan.components
    ]
    yield from table(rows, width, ("component", "from", "FMI", "interval", "inputs from"))


def _variables(plan: Plan, width: int | None) -> Iterator[Iterator[str]]:
    """All tables that list variables, and what identifies the components."""
    components = [
        (c.name, c.file_sha256[:12], "" if c.tick_ns is None else text_of(c.tick_ns))
        for c in plan.components
    ]
    parameters = [
        (f"{c.name}.{port.name}", port.type, _ranges(port.references), value)
        for c in plan.components
        for port, value in _set(c)
    ]
    inputs = [
        (edge.target, port.type, _ranges(port.references), edge.source)
        for c in plan.components
        for port, edge in _feeds(c)
    ]
    read = (port for c in plan.components for r in c.reads for port in r.ports)
    recorded = [
        (
            column.name + (f"[{'×'.join(map(str, column.shape))}]" if column.shape else ""),
            column.type,
            _ranges(port.references),
            _ranges(range(column.start, column.stop)),
        )
        for column, port in zip(plan.columns, read, strict=True)
    ]
    for head, rows in (
        (("component", "sha256", "ticks"), components),
        (("parameter", "type", "references", "value"), parameters),
        (("input", "type", "references", "from"), inputs),
        (("recorded", "type", "references", "place"), recorded),
    ):
        yield table(rows, width, head)


def _ranges(numbers: Sequence[int]) -> str:
    """``3-5, 9`` for 3, 4, 5, 9."""
    parts: list[list[int]] = []
    for number in numbers:
        if parts and number == parts[-1][1] + 1:
            parts[-1][1] = number
        else:
            parts.append([number, number])
    return ", ".join(str(a) if a == b else f"{a}-{b}" for a, b in parts)


def _brief(values: Sequence[Number]) -> str:
    shown = [f"{v:.10g}" if isinstance(v, float) else str(v).lower() for v in values[:6]]
    return " ".join(shown) + (f" … ({len(values)})" if len(values) > 6 else "")
