"""Plan: a system with everything looked up and checked, ready to be run by any master.

`resolve` finds what is wrong with a system before anything starts. What it returns is data, and
``print(plan)`` shows it.

Outputs of one type, of all components, stand one after another in one *vector* of that type. A
component's outputs are a slice of it, filled by one FMI call; its inputs are gathered from it by
index and set by one FMI call.
"""

from __future__ import annotations

import inspect
import math
import os
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus.host.instances import DTYPES
from sblcosim.fmus.host.nanoseconds import MAX_SECONDS, SECOND, nanoseconds, text_of
from sblcosim.fmus.read import ports as fmi
from sblcosim.fmus.read.ports import Fmu, Port
from sblcosim.models import COMPONENTS
from sblcosim.models.declaration import Number, Variable
from sblcosim.models.ports import RECEPTION

from ..errors import ConfigurationError, ConfigurationWarning, instance, nearest, one_line
from .system import ComponentSpec, Connection, PythonComponent, System

TICK_PARAMETERS = frozenset(c.interval for c in COMPONENTS.values() if c.interval is not None)
"""Names of the parameters that hold the time between a component's ticks, in s."""

MEMORY_SHARE = 0.25
"""Largest share of the machine's memory for a record; a table made of it takes as much again, and
writing the table, too."""

_RECEPTION = frozenset(v.name for v in RECEPTION)


@dataclass(frozen=True)
class Setting:
    """A parameter and its values, element by element."""

    port: Port
    values: tuple[Number, ...]


@dataclass(frozen=True)
class Read:
    """All outputs of one type of a component; they become ``vector[start:stop]``."""

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
    """All connected inputs of one type of a component; their values are ``vector[sources]``."""

    type: str
    ports: tuple[Port, ...]
    connections: tuple[Connection, ...]
    sources: tuple[int, ...]

    @property
    def references(self) -> tuple[int, ...]:
        """Value references, in the order of the values."""
        return tuple(r for port in self.ports for r in port.references)


@dataclass(frozen=True)
class PlannedComponent:
    """A component with everything looked up.

    Attributes
    ----------
    source
        The FMU, or what makes a Python component.
    ports
        All its variables.
    tick_ns
        Time between its ticks, if it has the parameter for that.
    settings
        Parameters to set.
    reads, writes
        One per type.
    """

    name: str
    source: Fmu | Callable[[], PythonComponent]
    ports: Mapping[str, Port]
    interval_ns: int
    tick_ns: int | None
    settings: tuple[Setting, ...]
    reads: tuple[Read, ...]
    writes: tuple[Write, ...]

    @property
    def tick_parameter(self) -> str:
        """Name of the parameter that holds `tick_ns`."""
        return min(TICK_PARAMETERS & self.ports.keys())

    @property
    def origin(self) -> str:
        """Where the component comes from, for people."""
        if isinstance(self.source, Fmu):
            return self.source.path.name
        return getattr(self.source, "__qualname__", repr(self.source))


@dataclass(frozen=True)
class Column:
    """A recorded variable: ``vector[start:stop]`` in its shape."""

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
    """What a master does, in data.

    Attributes
    ----------
    components
        In the order of their steps, which does not matter: all inputs of an instant are set first.
    columns
        All recorded variables.
    sizes
        Length of the vector of each type.
    start_ns, stop_ns
        First and last communication instant.
    """

    components: tuple[PlannedComponent, ...]
    columns: tuple[Column, ...]
    sizes: Mapping[str, int]
    start_ns: int
    stop_ns: int

    @property
    def instants(self) -> NDArray[np.int64]:
        """All communication instants in ns: the multiples of all intervals, start included."""
        grids = [
            np.arange(self.start_ns, self.stop_ns + 1, interval, dtype=np.int64)
            for interval in {c.interval_ns for c in self.components}
        ]
        return grids[0] if len(grids) == 1 else np.unique(np.concatenate(grids))

    @property
    def intervals_ns(self) -> dict[str, int]:
        """Communication intervals by component."""
        return {c.name: c.interval_ns for c in self.components}

    @property
    def count(self) -> int:
        """Number of communication instants, without listing them."""
        duration = self.stop_ns - self.start_ns
        given = {c.interval_ns for c in self.components}
        # Multiples of a multiple are none of their own.
        intervals = [n for n in given if not any(n % m == 0 for m in given - {n})]
        return 1 + sum(
            (1 if size % 2 else -1) * (duration // math.lcm(*some))
            for size in range(1, len(intervals) + 1)
            for some in combinations(intervals, size)
        )

    @property
    def row_size(self) -> int:
        """Bytes of an instant in the record of all outputs."""
        sizes = ((kind, n) for kind, n in self.sizes.items())
        return 8 + sum(n * np.dtype(DTYPES[kind]).itemsize for kind, n in sizes)

    def __str__(self) -> str:
        return "\n".join(_lines(self))


def check_size(plan: Plan, memory: int | None = None) -> None:
    """Refuse a plan whose record of all outputs is too large for this machine.

    Parameters
    ----------
    memory
        Of the machine, in bytes; None: asked from it.

    Raises
    ------
    ConfigurationError
        The record would take more than `MEMORY_SHARE` of the memory.
    """
    most = MEMORY_SHARE * (_memory() if memory is None else memory)
    size = plan.count * plan.row_size
    if size > most:
        most_text, got = (f"{float(f'{n / 1e9:.3g}'):g} GB" for n in (most, size))
        raise ConfigurationError(
            f"record: must take at most {most_text} ({MEMORY_SHARE:.0%} of the memory), got {got} "
            f"for {plan.count} communication instants; make the run shorter or the sampling time "
            "longer"
        )


def _memory() -> int:
    """Memory of this machine in bytes."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):  # there is no such call, as on Windows
        return 8 * 1024**3


def resolve(system: System, *, again: bool = False) -> Plan:
    """Look everything up and check it.

    Parameters
    ----------
    again
        Whether a system like it was resolved before, so that nobody need be warned.

    Raises
    ------
    ConfigurationError
        Something in the system cannot be carried out; the message names what.
    FmuError
        An FMU file is missing, broken, or not for this machine.

    Warns
    -----
    ConfigurationWarning
        One end of a connection has a unit and the other has none.
    """
    if not system.components:
        raise ConfigurationError("system: must have at least one component, got none")
    sources = {name: _source(name, spec) for name, spec in system.components.items()}
    ports = {name: found for name, (_, found) in sources.items()}
    _check_instances({name: source for name, (source, _) in sources.items()})
    settings = {
        name: _settings(name, spec, ports[name]) for name, spec in system.components.items()
    }
    connections = _connections(system, ports, warn=not again)
    start_ns, stop_ns = _span(system)

    sizes = dict.fromkeys(DTYPES, 0)
    reads: dict[str, tuple[Read, ...]] = {}
    columns: dict[str, Column] = {}
    for name in system.components:
        blocks = []
        for kind, group in _by_type(p for p in ports[name].values() if p.causality == "output"):
            first = sizes[kind]
            for port in group:
                columns[f"{name}.{port.name}"] = Column(
                    f"{name}.{port.name}", kind, port.shape, sizes[kind]
                )
                sizes[kind] += port.size
            blocks.append(Read(kind, group, first, sizes[kind]))
        reads[name] = tuple(blocks)

    components = []
    for name, spec in system.components.items():
        feeds = {
            connections[key].target.split(".", 1)[1]: connections[key]
            for key in connections
            if key[0] == name
        }
        writes = []
        for kind, group in _by_type(p for p in ports[name].values() if p.name in feeds):
            feeding = tuple(feeds[port.name] for port in group)
            found = [columns[connection.source] for connection in feeding]
            index = tuple(i for column in found for i in range(column.start, column.stop))
            writes.append(Write(kind, group, feeding, index))
        components.append(
            PlannedComponent(
                name=name,
                source=sources[name][0],
                ports=ports[name],
                interval_ns=spec.interval_ns,
                tick_ns=_tick(name, ports[name], settings[name]),
                settings=settings[name],
                reads=reads[name],
                writes=tuple(writes),
            )
        )
    plan = Plan(
        components=tuple(components),
        columns=tuple(columns.values()),
        sizes={kind: size for kind, size in sizes.items() if size},
        start_ns=start_ns,
        stop_ns=stop_ns,
    )
    _check_ticks(plan)
    _check_freshness(plan)
    _check_updates_follow_pings(plan)
    return plan


def _source(
    name: str, spec: ComponentSpec
) -> tuple[Fmu | Callable[[], PythonComponent], Mapping[str, Port]]:
    if not name or "." in name:
        raise ConfigurationError(f"component {name!r}: the name must be without a dot")
    interval = spec.interval_ns
    if isinstance(interval, bool) or not isinstance(interval, int) or interval <= 0:
        raise ConfigurationError(
            f"{name}: the communication interval must be a positive whole number of ns, got "
            f"{interval!r}"
        )
    if isinstance(spec.fmu, Path):
        found = fmi.read(spec.fmu)
        return found, found.ports
    if callable(spec.fmu):
        return spec.fmu, fmi.ports_of(variables_of(name, spec.fmu))
    raise ConfigurationError(
        f"{name}: must be the path of an FMU or make a Python component, got {spec.fmu!r}"
    )


def variables_of(where: str, maker: Any) -> Iterable[Variable]:
    """The variables of a Python component; an object is made to ask it.

    Parameters
    ----------
    where
        Begins a message.

    Raises
    ------
    ConfigurationError
        It cannot be made, or is no component.
    """
    if not callable(maker):
        raise ConfigurationError(
            f"{where}: must be a class or function that makes the component, got {instance(maker)}"
        )
    name = getattr(maker, "__qualname__", instance(maker))
    try:
        inspect.signature(maker).bind()
    except TypeError as error:
        raise ConfigurationError(
            f"{where}: must make the component without arguments, got {name} ({error})"
        ) from None
    except ValueError:  # C code tells nothing about its arguments
        pass
    try:
        component = maker()
    except (Exception, SystemExit) as error:
        raise ConfigurationError(
            f"{where}: must make the component, got {type(error).__name__} from {name}: "
            f"{one_line(error)}"
        ) from error
    missing = [m for m in ("variables", "initialise", "do_step") if not hasattr(component, m)]
    if missing:
        raise ConfigurationError(
            f"{where}: must make a component, got {name}, whose object has no "
            f"{' and no '.join(missing)}"
        )
    declared: Any = component.variables
    must = f"{where}: variables must be a sequence of Variable, got"
    if not isinstance(declared, Iterable) or isinstance(declared, str):
        raise ConfigurationError(f"{must} {instance(declared)}")
    variables: tuple[Variable, ...] = tuple(declared)
    for variable in variables:
        if not isinstance(variable, Variable):
            raise ConfigurationError(f"{must} {instance(variable)} in it")
    return variables


def _check_instances(sources: Mapping[str, object]) -> None:
    first: dict[str, str] = {}
    for name, source in sources.items():
        if (
            isinstance(source, Fmu)
            and source.once
            and first.setdefault(source.sha256, name) != name
        ):
            raise ConfigurationError(
                f"{name}: {source.path.name} can be instantiated only once, and "
                f"{first[source.sha256]} uses it already"
            )


def _by_type(ports: Iterator[Port]) -> Iterator[tuple[str, tuple[Port, ...]]]:
    """Ports that can be transferred, type by type."""
    order = list(DTYPES)
    usable = sorted((p for p in ports if p.type in DTYPES), key=lambda p: order.index(p.type))
    for kind, group in groupby(usable, key=lambda p: p.type):
        yield kind, tuple(group)


def _settings(name: str, spec: ComponentSpec, ports: Mapping[str, Port]) -> tuple[Setting, ...]:
    settings = []
    for key, value in spec.parameters.items():
        where = f"{name}.{key}"
        port = ports.get(key)
        if port is None:
            known = [p.name for p in ports.values() if p.causality == "parameter"]
            raise ConfigurationError(
                f"{where}: must be a parameter of {name}, got an unknown name{nearest(key, known)}"
            )
        if port.causality != "parameter":
            raise ConfigurationError(f"{where}: must be a parameter, got {_a(port.causality)}")
        if port.type not in DTYPES:
            raise ConfigurationError(f"{where}: must be a number or a switch, got {_a(port.type)}")
        settings.append(Setting(port, _values(where, port, value)))
    return tuple(settings)


def _values(where: str, port: Port, value: Any) -> tuple[Number, ...]:
    """The elements of a value, checked against the variable's shape, type and bounds."""
    elements = list(_flat(value))
    if len(elements) != port.size or (not port.shape and isinstance(value, (list, tuple))):
        must = f"{port.size} numbers" if port.shape else "one number"
        raise ConfigurationError(f"{where}: must be {must}, got {len(elements)}")
    return tuple(_element(where, port, i, element) for i, element in enumerate(elements))


def _subscript(index: tuple[int, ...]) -> str:
    return f"[{','.join(str(i + 1) for i in index)}]" if index else ""


def _flat(value: Any) -> Iterator[Any]:
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        for element in value:
            yield from _flat(element)
    else:
        yield value


def _element(name: str, port: Port, number: int, value: Any) -> Number:
    problem = _problem(port, value, port.min[number], port.max[number])
    if problem is not None:
        index = tuple(int(i) for i in np.unravel_index(number, port.shape)) if port.shape else ()
        raise ConfigurationError(f"{name}{_subscript(index)}: must be {problem}")
    return float(value) if port.type.startswith("Float") else value


def _problem(port: Port, value: Any, low: float, high: float) -> str | None:
    """What a value must be and is not."""
    if port.type == "Boolean":
        if not isinstance(value, bool):
            return f"true or false, got {value!r}"
        return None
    real = port.type.startswith("Float")
    if isinstance(value, bool) or not isinstance(value, (int, float) if real else int):
        must = "a number" if real else "a whole number"
        return f"{must}, got {value!r}"
    if not math.isfinite(value):
        return f"finite, got {value!r}"
    if not real:
        limits = np.iinfo(DTYPES[port.type])  # type: ignore[type-var]
        low, high = max(low, limits.min), min(high, limits.max)
    unit = f" {port.unit}" if port.unit else ""
    if value < low:
        return f"at least {low:.10g}{unit}, got {value!r}{unit}"
    if value > high:
        return f"at most {high:.10g}{unit}, got {value!r}{unit}"
    return None


def _connections(
    system: System, ports: Mapping[str, Mapping[str, Port]], warn: bool
) -> dict[tuple[str, str], Connection]:
    """Connections by the component and variable they feed."""
    connections: dict[tuple[str, str], Connection] = {}
    for connection in system.connections:
        where = f"connection {connection.source} -> {connection.target}"
        _, _, source = _end(where, connection.source, "output", ports)
        component, variable, target = _end(where, connection.target, "input", ports)
        for what, a, b in (
            ("type", source.type, target.type),
            ("shape", _shape(source), _shape(target)),
        ):
            if a != b:
                raise ConfigurationError(
                    f"{where}: both ends must have the same {what}, got {a} and {b}"
                )
        if source.type not in DTYPES:
            raise ConfigurationError(f"{where}: {source.type} variables cannot be connected")
        if source.unit != target.unit:
            message = (
                f"{where}: both ends must have the same unit, got {source.unit or 'none'} and "
                f"{target.unit or 'none'}"
            )
            if source.unit and target.unit:
                raise ConfigurationError(message)
            if warn:
                warnings.warn(message, ConfigurationWarning, stacklevel=3)
        earlier = connections.get((component, variable))
        if earlier is not None:
            raise ConfigurationError(
                f"{where}: an input must have one source, got {earlier.source} as well"
            )
        connections[component, variable] = connection
    return connections


def _end(
    where: str, end: str, causality: str, ports: Mapping[str, Mapping[str, Port]]
) -> tuple[str, str, Port]:
    component, _, variable = end.partition(".")
    if component not in ports:
        raise ConfigurationError(
            f"{where}: {component!r} must be a component of the system{nearest(component, ports)}"
        )
    port = ports[component].get(variable)
    if port is None:
        known = [p.name for p in ports[component].values() if p.causality == causality]
        raise ConfigurationError(
            f"{where}: {variable!r} must be {_a(causality)} of {component}, got an unknown name"
            f"{nearest(variable, known)}"
        )
    if port.causality != causality:
        raise ConfigurationError(
            f"{where}: {end} must be {_a(causality)}, got {_a(port.causality)}"
        )
    return component, variable, port


def _a(noun: str) -> str:
    return f"{'an' if noun[0] in 'aeiouAEIOU' else 'a'} {noun}"


def _shape(port: Port) -> str:
    return "×".join(str(n) for n in port.shape) or "scalar"


def _span(system: System) -> tuple[int, int]:
    """Start, and the last common multiple of all intervals that is not beyond the stop."""
    for what, value in (("start", system.start_ns), ("stop", system.stop_ns)):
        if isinstance(value, bool) or not isinstance(value, int):
            raise ConfigurationError(f"system: {what} must be a whole number of ns, got {value!r}")
    if system.stop_ns <= system.start_ns:
        raise ConfigurationError(
            f"system: the stop must be after the start at {text_of(system.start_ns)}, got "
            f"{text_of(system.stop_ns)}"
        )
    if system.stop_ns >= MAX_SECONDS * SECOND:
        raise ConfigurationError(
            f"system: the stop must be before {MAX_SECONDS:g} s, got {system.stop_ns / SECOND:g} s"
        )
    common = math.lcm(*(spec.interval_ns for spec in system.components.values()))
    duration = system.stop_ns - system.start_ns
    if common > duration:
        raise ConfigurationError(
            f"system: the run must be at least as long as the least common multiple of all "
            f"communication intervals, {text_of(common)}, got {text_of(duration)}"
        )
    return system.start_ns, system.stop_ns - duration % common


def _tick(name: str, ports: Mapping[str, Port], settings: Sequence[Setting]) -> int | None:
    """Time between ticks in ns, None without ticks."""
    for parameter in sorted(TICK_PARAMETERS & ports.keys()):
        port = ports[parameter]
        if (port.causality, port.type, port.shape) != ("parameter", "Float64", ()):
            continue
        given = next((s.values for s in settings if s.port is port), port.start)
        if given is None:
            continue
        (value,) = given
        tick = nanoseconds(value)
        if tick <= 0 or not math.isclose(tick / SECOND, value, rel_tol=1e-12):
            raise ConfigurationError(
                f"{name}.{parameter}: must be a positive whole number of ns, got {value!r} s"
            )
        return tick
    return None


def _check_ticks(plan: Plan) -> None:
    """No tick of a component with inputs strictly inside its communication interval.

    Its inputs would be those of the interval's beginning, older than the tick.
    """
    for c in plan.components:
        takes_inputs = any(port.causality == "input" for port in c.ports.values())
        if c.tick_ns is not None and takes_inputs and c.tick_ns % c.interval_ns:
            raise ConfigurationError(
                f"{c.name}: the communication interval must divide {c.tick_parameter}, "
                f"{text_of(c.tick_ns)}, got {text_of(c.interval_ns)}"
            )


def _connected(plan: Plan) -> Iterator[tuple[PlannedComponent, PlannedComponent, Port]]:
    """Source, target and source variable of every connection."""
    by_name = {c.name: c for c in plan.components}
    for target in plan.components:
        for write in target.writes:
            for connection in write.connections:
                component, _, variable = connection.source.partition(".")
                source = by_name[component]
                yield source, target, source.ports[variable]


def _check_freshness(plan: Plan) -> None:
    """Whatever feeds a component has its outputs up to date at each of that component's ticks."""
    for source, target, port in _connected(plan):
        if target.tick_ns is not None and target.tick_ns % source.interval_ns:
            raise ConfigurationError(
                f"{source.name}: the communication interval must divide {target.name}."
                f"{target.tick_parameter}, {text_of(target.tick_ns)}, as {target.name} uses its "
                f"{port.name}, got {text_of(source.interval_ns)}"
            )


def _check_updates_follow_pings(plan: Plan) -> None:
    """The update interval of a receiver is a whole multiple of the acoustics' sampling time."""
    for source, target, port in _connected(plan):
        if port.name not in _RECEPTION or None in (source.tick_ns, target.tick_ns):
            continue
        assert source.tick_ns is not None
        assert target.tick_ns is not None
        if target.tick_ns % source.tick_ns:
            raise ConfigurationError(
                f"{target.name}.{target.tick_parameter}: must be a whole multiple of {source.name}."
                f"{source.tick_parameter}, {text_of(source.tick_ns)}, got {text_of(target.tick_ns)}"
            )


def _lines(plan: Plan) -> Iterator[str]:
    yield (
        f"Run from {text_of(plan.start_ns)} to {text_of(plan.stop_ns)}: "
        f"{plan.count} communication instants"
    )
    yield ""
    yield from _table(
        ("component", "from", "FMI", "sha256", "interval", "ticks"),
        [
            (
                c.name,
                c.origin,
                str(c.source.fmi) if isinstance(c.source, Fmu) else "Python",
                c.source.sha256[:12] if isinstance(c.source, Fmu) else "",
                text_of(c.interval_ns),
                "" if c.tick_ns is None else text_of(c.tick_ns),
            )
            for c in plan.components
        ],
    )
    yield ""
    yield from _table(
        ("parameter", "type", "references", "value"),
        [
            (
                f"{c.name}.{s.port.name}",
                s.port.type,
                _ranges(s.port.references),
                _brief(s.values) + (f" {s.port.unit}" if s.port.unit else ""),
            )
            for c in plan.components
            for s in c.settings
        ],
    )
    yield ""
    yield from _table(
        ("input", "type", "references", "from"),
        [
            (connection.target, w.type, _ranges(port.references), connection.source)
            for c in plan.components
            for w in c.writes
            for port, connection in zip(w.ports, w.connections, strict=True)
        ],
    )
    yield ""
    yield from _table(
        ("recorded", "type", "references", "place"),
        [
            (
                column.name + (f"[{'×'.join(map(str, column.shape))}]" if column.shape else ""),
                column.type,
                _ranges(port.references),
                _ranges(range(column.start, column.stop)),
            )
            for column, port in zip(
                plan.columns,
                (port for c in plan.components for r in c.reads for port in r.ports),
                strict=True,
            )
        ],
    )


def _table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> Iterator[str]:
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    for row in (head, tuple("-" * width for width in widths), *rows):
        yield "  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip()


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
