"""Resolve a system into a plan: look up all names, and refuse whatever does not fit."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

import numpy as np
from sblcosim.fmus.host.instances import DTYPES
from sblcosim.fmus.host.nanoseconds import MAX_SECONDS, SECOND, nanoseconds, text_of
from sblcosim.fmus.read import ports as fmi
from sblcosim.fmus.read.description import split
from sblcosim.fmus.read.ports import Fmu, Port

from ..errors import ConfigurationError, ConfigurationWarning, nearest
from .plans.alike import alike
from .plans.checks import check_freshness, check_instances, check_ticks, check_updates_follow_pings
from .plans.plan import TICK_PARAMETERS, Column, Plan, PlannedComponent, Read, Setting, Write
from .plans.settings import settings_of, texts_of, with_article
from .system import ComponentSpec, Connection, Conversion, PythonComponent, System
from .user.files import variables_of

_LIKE_OUTPUTS = ("local", "calculatedParameter")
"""Causalities and kinds of FMU variables that can be read like outputs."""

_Source = tuple[Fmu | Callable[[], PythonComponent], Mapping[str, Port]]


def resolve(system: System, *, again: bool = False, where: str = "") -> Plan:
    """Resolve and check a system.

    Parameters
    ----------
    again
        Whether a similar system was resolved earlier, so that warnings are not repeated.
    where
        File of the system, for warnings; empty: none.

    Raises
    ------
    ConfigurationError
        The system is invalid; the message names the cause.
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
    ports = {name: own for name, (_, own) in sources.items()}
    check_instances({name: source for name, (source, _) in sources.items()})
    settings = {
        name: settings_of(name, spec, ports[name]) for name, spec in system.components.items()
    }
    structure = _structure_of(system, sources)
    _warn(() if again else structure.messages, where)
    start_ns, stop_ns = _span(system)
    plan = Plan(
        components=tuple(
            _planned(name, spec, sources[name], settings[name], structure)
            for name, spec in system.components.items()
        ),
        columns=structure.columns,
        sizes=structure.sizes,
        start_ns=start_ns,
        stop_ns=stop_ns,
    )
    times = tuple((c.interval_ns, c.tick_ns) for c in plan.components)
    if times not in structure.fitting:
        check_ticks(plan)
        check_freshness(plan)
        check_updates_follow_pings(plan)
        structure.fitting.add(times)
    return plan


def _planned(
    name: str, spec: ComponentSpec, source: _Source, settings: tuple[Setting, ...],
    structure: _Structure,
) -> PlannedComponent:
    """A component; the points of a study share it."""
    return alike(
        "planned",
        (name, id(spec), id(structure)),
        lambda: PlannedComponent(
            name=name,
            source=source[0],
            ports=source[1],
            interval_ns=spec.interval_ns,
            tick_ns=_tick(name, source[1], settings),
            settings=settings,
            reads=structure.reads[name],
            writes=structure.writes[name],
            texts=texts_of(name, spec, source[1]),
        ),
        spec,
        structure,
    )


def _warn(messages: Sequence[str], where: str) -> None:
    for message in messages:
        text = f"{where}: {message}" if where else message
        warnings.warn(text, ConfigurationWarning, stacklevel=3)


@dataclass(frozen=True)
class _Structure:
    """What plans with the same components and connections share.

    Attributes
    ----------
    reads, writes
        By component.
    messages
        Warnings about the connections.
    fitting
        Intervals and ticks of all components, if they are compatible.
    """

    reads: Mapping[str, tuple[Read, ...]]
    writes: Mapping[str, tuple[Write, ...]]
    columns: tuple[Column, ...]
    sizes: Mapping[str, int]
    messages: tuple[str, ...]
    fitting: set[tuple[tuple[int, int | None], ...]]


def _structure_of(system: System, sources: Mapping[str, _Source]) -> _Structure:
    """Everything in a plan except values and times; the points of a study share it."""
    ports = {name: own for name, (_, own) in sources.items()}
    if all(isinstance(source, Fmu) for source, _ in sources.values()):
        known = tuple((name, id(own)) for name, own in ports.items())
        connections = system.connections
        return alike(
            "structures", (known, id(connections)), lambda: _made(system, ports), ports, connections
        )
    return _made(system, ports)  # a Python component is queried again each time


def _made(system: System, ports: Mapping[str, Mapping[str, Port]]) -> _Structure:
    connections, messages = _connections(system, ports)
    fed = {connection.source for connection in connections.values()}
    reads, columns, sizes = _outputs(ports, fed | {split(name)[0] for name in fed})
    return _Structure(
        reads,
        {name: _inputs(name, own, connections, columns) for name, own in ports.items()},
        tuple(columns.values()),
        {kind: size for kind, size in sizes.items() if size},
        tuple(messages),
        set(),
    )


def _outputs(
    ports: Mapping[str, Mapping[str, Port]], fed: Collection[str]
) -> tuple[dict[str, tuple[Read, ...]], dict[str, Column], dict[str, int]]:
    """Reads by component, columns of the record, and the number of elements by type.

    Outputs are read, and everything else in ``fed``, the sources of connections.
    """
    sizes = dict.fromkeys(DTYPES, 0)
    reads: dict[str, tuple[Read, ...]] = {}
    columns: dict[str, Column] = {}
    for component, own in ports.items():
        blocks = []
        read = [
            p for p in own.values() if p.causality == "output" or f"{component}.{p.name}" in fed
        ]
        for kind, group in _by_type(iter(read)):
            first = sizes[kind]
            for port in group:
                name = f"{component}.{port.name}"
                columns[name] = Column(name, kind, port.shape, sizes[kind])
                sizes[kind] += port.size
            blocks.append(Read(kind, group, first, sizes[kind]))
        reads[component] = tuple(blocks)
    return reads, columns, sizes


def _inputs(
    component: str,
    ports: Mapping[str, Port],
    connections: Mapping[tuple[str, str], Connection],
    columns: Mapping[str, Column],
) -> tuple[Write, ...]:
    """Writes to a component, with the elements they come from."""
    feeds = {name: c for (owner, name), c in connections.items() if owner == component}
    writes = []
    for kind, group in _by_type(_fed(ports, feeds)):
        feeding = tuple(feeds[port.name] for port in group)
        sources = [_place(connection.source, columns) for connection in feeding]
        index = tuple(i for _, own in sources for i in own)
        through = [c.conversion for c, (_, own) in zip(feeding, sources, strict=True) for _ in own]
        converted = tuple(
            (i, step)
            for i, conversion in enumerate(through)
            if conversion is not None
            for step in conversion.steps
        )
        writes.append(
            Write(kind, group, feeding, tuple(column for column, _ in sources), index, converted)
        )
    return tuple(writes)


def _fed(ports: Mapping[str, Port], feeds: Collection[str]) -> Iterator[Port]:
    """The connected ports in order; of an array perhaps only some elements."""
    for port in ports.values():
        if port.name in feeds:
            yield port
    for name in feeds:
        if name not in ports:
            element = _element_of(name, ports)
            assert element is not None
            yield element[0]


def _element_of(name: str, ports: Mapping[str, Port]) -> tuple[Port, int] | None:
    """An element of an array that an FMU has as scalars, and its index there."""
    base, indices = split(name)
    port = ports.get(base)
    if port is None or len(port.variables) != port.size or len(indices) != len(port.shape):
        return None
    if not all(1 <= i <= n for i, n in zip(indices, port.shape, strict=True)):
        return None
    number = int(np.ravel_multi_index([i - 1 for i in indices], port.shape))
    own = slice(number, number + 1)
    element = replace(
        port, name=name, shape=(), start=None if port.start is None else port.start[own],
        min=port.min[own], max=port.max[own], references=port.references[own],
        variables=port.variables[own],
    )  # fmt: skip
    return element, number


def _place(source: str, columns: Mapping[str, Column]) -> tuple[Column, range]:
    """The column that holds a source, and its elements."""
    if source in columns:
        column = columns[source]
        return column, range(column.start, column.stop)
    base, indices = split(source)
    column = columns[base]
    first = column.start + int(np.ravel_multi_index([i - 1 for i in indices], column.shape))
    return column, range(first, first + 1)


def _source(name: str, spec: ComponentSpec) -> _Source:
    if not name or "." in name:
        raise ConfigurationError(f"component {name!r}: the name must not contain a dot")
    interval = spec.interval_ns
    if isinstance(interval, bool) or not isinstance(interval, int) or interval <= 0:
        raise ConfigurationError(
            f"{name}: the communication interval must be a positive whole number of ns, got "
            f"{interval!r}"
        )
    if isinstance(spec.fmu, Path):
        fmu = fmi.read(spec.fmu)
        return fmu, fmu.ports
    if callable(spec.fmu):
        return spec.fmu, fmi.ports_of(variables_of(name, spec.fmu))
    raise ConfigurationError(
        f"{name}: must be the path of an FMU or make a Python component, got {spec.fmu!r}"
    )


def _by_type(ports: Iterator[Port]) -> Iterator[tuple[str, tuple[Port, ...]]]:
    """Ports of supported types, grouped by type."""
    order = list(DTYPES)
    usable = sorted((p for p in ports if p.type in DTYPES), key=lambda p: order.index(p.type))
    for kind, group in groupby(usable, key=lambda p: p.type):
        yield kind, tuple(group)


def _connections(
    system: System, ports: Mapping[str, Mapping[str, Port]]
) -> tuple[dict[tuple[str, str], Connection], list[str]]:
    """Connections by target component and variable, and warnings about them."""
    messages = []
    connections: dict[tuple[str, str], Connection] = {}
    taken: dict[tuple[str, str], Connection] = {}
    for connection in system.connections:
        where = f"connection {connection.source} -> {connection.target}"
        _, _, source = _end(where, connection.source, "output", ports, _LIKE_OUTPUTS)
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
        if (connection.conversion or Conversion()).steps and source.type != "Float64":
            raise ConfigurationError(
                f"{where}: must be Float64 to be converted, got {source.type}"
            )
        if source.unit != target.unit and connection.conversion is None:
            message = (
                f"{where}: both ends must have the same unit, got {source.unit or 'none'} and "
                f"{target.unit or 'none'}"
            )
            if source.unit and target.unit:
                raise ConfigurationError(message)
            messages.append(message)
        for name in target.variables or (variable,):
            earlier = taken.setdefault((component, name), connection)
            if earlier is not connection:
                raise ConfigurationError(
                    f"{where}: an input must have one source, got {earlier.source} as well"
                )
        connections[component, variable] = connection
    return connections, messages


def _end(
    where: str,
    end: str,
    causality: str,
    ports: Mapping[str, Mapping[str, Port]],
    also: Collection[str] = (),
) -> tuple[str, str, Port]:
    component, _, variable = end.partition(".")
    if component not in ports:
        raise ConfigurationError(
            f"{where}: {component!r} must be a component of the system{nearest(component, ports)}"
        )
    port = ports[component].get(variable)
    if port is None and (element := _element_of(variable, ports[component])) is not None:
        port = element[0]
    if port is None:
        known = [p.name for p in ports[component].values() if p.causality == causality]
        raise ConfigurationError(
            f"{where}: {variable!r} must be {with_article(causality)} of {component}, got an "
            f"unknown name{nearest(variable, known)}"
        )
    if port.causality != causality and not (port.references and port.causality in also):
        raise ConfigurationError(
            f"{where}: {end} must be {with_article(causality)}, got {with_article(port.causality)}"
        )
    return component, variable, port


def _shape(port: Port) -> str:
    return "×".join(str(n) for n in port.shape) or "scalar"


def _span(system: System) -> tuple[int, int]:
    """Start, and the last common multiple of all intervals up to the stop [ns]."""
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
    """Tick interval [ns]; None without ticks."""
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
