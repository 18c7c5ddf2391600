"""Turn a scenario into a system: FMUs, their parameters, and the standard connections."""

from __future__ import annotations

import math
import warnings
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, cast

from sblcosim.fmus.host.nanoseconds import SECOND, nanoseconds
from sblcosim.fmus.read.ports import Port, ports_of, read
from sblcosim.models import RECEIVERS, declared
from sblcosim.models.declaration import Variable
from sblcosim.models.ports import (
    BEACON_POSITIONS,
    DEPTH,
    MOTION,
    PING_POSE,
    RECEPTION,
    REPORTED_POSE,
)

from ..errors import (
    ConfigurationError,
    ConfigurationWarning,
    NoEffectWarning,
    check_choice,
    instance,
    nearest,
    quoted,
    shortened,
)
from ..simulation.execution import initial_outputs
from ..simulation.receiver import for_beacons
from ..simulation.system import ComponentSpec, Connection, System, Value
from ..simulation.user_files import variables_of
from . import effects, tracks
from .doubts import doubts
from .scenario import Receivers, Scenario, Source, load
from .schema import CORE_COMPONENTS, PATH, SHARED_PARAMETERS, TRUE, in_si
from .sources import choose, file_of, known_source, named


@dataclass(frozen=True, slots=True)
class _Part:
    """A future component: its variables, and its inputs if it is a third-party component."""

    spec: ComponentSpec
    names: frozenset[str]
    foreign_inputs: frozenset[str] = frozenset()


def connect(
    scenario: Scenario,
    receivers: Receivers = (),
    fmi: int | None = None,
    components: Mapping[str, Source] | None = None,
) -> System:
    """Choose and connect the components of a scenario; build missing FMUs.

    Parameters
    ----------
    receivers
        Names, FMU files or makers of Python components, side by side on the same noise; a mapping
        gives them labels. None: the scenario's own receiver. The raw fix always runs too, as
        ``raw``, unless ``multilateration`` is requested.
    fmi
        FMI version (2 or 3) of all our components, instead of the scenario's.
    components
        FMU files or makers of Python components to use as ``target``, ``platform``, ``acoustics``.

    Raises
    ------
    ConfigurationError
        A receiver, a file or a key is unknown, or the target's path has no end.
    FmuError
        An FMU cannot be built or read.

    Warns
    -----
    ConfigurationWarning
        An input of a third-party component is not connected; a given key has no effect; `doubts`.
    """
    if fmi is not None:
        check_choice("fmi", fmi, (2, 3))
    replaced = _replaced(components)
    parts: dict[str, _Part] = {}
    for name in CORE_COMPONENTS:
        table = getattr(scenario, name)
        source = replaced.get(name, table.fmu)
        if source is None:
            parts[name] = _ours(name, scenario, table, fmi or table.fmi or scenario.fmi)
        else:
            parts[name] = _foreign(name, scenario, source, name not in replaced)
    table = scenario.receiver
    chosen = choose(scenario, receivers)
    _refuse_idle_keys(scenario, chosen)
    for label, source in chosen.items():
        parts[label] = _receiver(scenario, label, source, fmi or table.fmi or scenario.fmi)
    if scenario.true_prior:
        _hand_over_start(parts, chosen)
    connections = tuple(_connections(parts, chosen))
    _warn_of_idle_inputs(parts, {connection.target for connection in connections})
    idle = effects.idle(scenario, ours(scenario, chosen, replaced), effects.given(scenario))
    for line in no_effect(scenario, idle):
        warnings.warn(line, NoEffectWarning, stacklevel=2)
    _warn_of_doubts(scenario, chosen)
    return System(
        components={name: part.spec for name, part in parts.items()},
        connections=connections,
        stop_ns=_stop_ns(scenario, parts),
    )


def applied(
    scenario: Scenario,
    receivers: Receivers = (),
    fmi: int | None = None,
    components: Mapping[str, Source] | None = None,
) -> Scenario:
    """The scenario with the arguments of `connect` merged into it, as far as a file can hold them.

    It gets the first of several receivers, without keys that this receiver does not have. A Python
    component that is not from a file leaves the scenario's own choice in place.
    """
    tables = scenario.given()
    if fmi is not None:
        tables["fmi"] = fmi
        for name in (*CORE_COMPONENTS, "receiver"):
            tables.get(name, {}).pop("fmi", None)
    sources = _replaced(components)
    sources["receiver"] = next(iter(choose(scenario, receivers).values()))
    for name, source in sources.items():
        file = file_of(source)
        if file is None and not isinstance(source, str):
            continue
        table = getattr(scenario, name)
        given = tables.setdefault(name, {})
        if file is None:
            assert isinstance(source, str)
            known = {v.name for v in RECEIVERS[source].of("parameter")}
            choice = {"type": source}
        else:
            known = {*_ports(name, source), *SHARED_PARAMETERS}
            choice = {"fmu": file}
        for key in given.keys() & table.variables.keys():
            if table.variables[key].name not in known:
                del given[key]
        if choice.items() <= table.model_dump().items():
            continue
        further = given.get("parameters") or {} if table.fmu is None else {}
        for key in ("type", "fmu", "parameters"):
            given.pop(key, None)
        given |= choice
        further = {k: v for k, v in further.items() if file is not None and k in known}
        if further:
            given["parameters"] = further
    return load(tables)


def _replaced(components: Mapping[str, Source] | None) -> dict[str, Source]:
    if components is not None and not isinstance(components, Mapping):
        raise ConfigurationError(
            f"components: must be a mapping with {', '.join(CORE_COMPONENTS)}, "
            f"got {instance(components)}"
        )
    replaced = dict(components or {})
    for name in replaced:
        if name not in CORE_COMPONENTS:
            raise ConfigurationError(
                f"components: must be {', '.join(CORE_COMPONENTS)}, got {quoted(name)}"
                f"{nearest(str(name), CORE_COMPONENTS)}"
            )
    return replaced


def _ours(
    name: str, scenario: Scenario, table: Any, fmi: int,
    assumptions: Mapping[str, Any] = MappingProxyType({}),
) -> _Part:
    from sblcosim.fmus.build.factory import build

    constants = {"beacons": scenario.beacons}
    if name == "target":
        constants |= tracks.capacity(table)
    component = declared(name, **constants)
    values = _values(component.of("parameter"), table, assumptions)
    if name == "target" and table.trajectory != tracks.FILE:
        values = {k: v for k, v in values.items() if k not in tracks.PARAMETERS}
    spec = ComponentSpec(
        build(name, cast(Literal[2, 3], fmi), False, None, **constants),  # refuses other versions
        nanoseconds(table.interval_s),
        values,
    )
    return _Part(spec, frozenset(v.name for v in component))


def _receiver(scenario: Scenario, label: str, source: Source, fmi: int) -> _Part:
    table = scenario.receiver
    if isinstance(source, str):
        known = [v.name for v in RECEIVERS[source]]
        return _ours(source, scenario, table, fmi, scenario.assumptions(known))
    _check_contract(label, source)
    own = table.fmu is not None and source == known_source(table.fmu)
    return _foreign("receiver", scenario, source, own)


def _foreign(table_name: str, scenario: Scenario, source: Source, own: bool) -> _Part:
    """A third-party component: it gets those keys of the table that are its parameters.

    If the scenario itself names the file (``own``), every given key must be a parameter.
    """
    table = getattr(scenario, table_name)
    fmu = Path(source) if isinstance(source, str | Path) else for_beacons(source, scenario.beacons)
    ports = _ports(table_name, fmu)
    has = {port.name for port in ports.values() if port.causality == "parameter"}
    given = {
        table.variables[key].name: key for key in table.variables if key in table.model_fields_set
    }
    if own:
        for name, key in given.items():
            if name not in has and name not in SHARED_PARAMETERS:
                raise ConfigurationError(
                    f"{scenario.where(table_name, key)}: must be a parameter of {named(fmu)}, "
                    f"got {name!r}{nearest(name, has)}"
                )
    wanted = {*SHARED_PARAMETERS, *given}
    if getattr(table, "prior", None) == TRUE:
        wanted.add("initialisation")
    assumed = scenario.assumptions(has) if table_name == "receiver" else {}
    values = {"seed": scenario.seed, **_values(table.variables.values(), table, assumed)}
    parameters = {k: v for k, v in values.items() if k in has and k in wanted}
    further = table.parameters or {}
    if table.fmu is None:
        parameters |= {k: _flat(v) for k, v in further.items() if k in has}
    elif own:
        parameters |= {k: _flat(v) for k, v in further.items()}
    _check_beacons(scenario, fmu, ports)
    inputs = frozenset(port.name for port in ports.values() if port.causality == "input")
    spec = ComponentSpec(fmu, nanoseconds(table.interval_s), parameters)
    return _Part(spec, frozenset(ports), inputs)


def _check_beacons(scenario: Scenario, source: Source, ports: Mapping[str, Port]) -> None:
    """Refuse a component that was made for another number of beacons."""
    for variable in (*BEACON_POSITIONS, *RECEPTION, *PING_POSE):
        port = ports.get(variable.name)
        if variable.rows and port and port.shape and port.shape[0] != scenario.beacons:
            raise ConfigurationError(
                f"{named(source)}: must be made for the {scenario.beacons} beacons of the "
                f"scenario, got {port.name} of {port.shape[0]}; platform.beacons says how many"
            )


def _ports(where: str, source: Source) -> Mapping[str, Port]:
    if isinstance(source, str | Path):
        return read(Path(source)).ports
    return ports_of(variables_of(where, source))


def _check_contract(label: str, source: Source) -> None:
    """Refuse a source that does not fulfil the contract of a receiver."""
    from sblcosim.fmus.conformance.receiver_contract import check_receiver, check_variables

    hint = ""
    if isinstance(source, str | Path):
        findings: Iterable[Any] = check_receiver(source).findings
        label, hint = str(source), f"; see 'sblcosim check {source}'"
    else:
        findings = check_variables(variables_of(label, source))
    problems = [f"{f.variable}: {f.message}" for f in findings if f.severity == "error"]
    if problems:
        more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
        raise ConfigurationError(
            f"{label}: must honour the plug contract of a receiver, got {problems[0]}{more}{hint}"
        )


def _warn_of_doubts(scenario: Scenario, chosen: Mapping[str, Source]) -> None:
    for line in doubts(scenario, chosen):
        warnings.warn(line, ConfigurationWarning, stacklevel=3)


def _warn_of_idle_inputs(parts: Mapping[str, _Part], fed: Iterable[str]) -> None:
    for label, part in parts.items():
        ports = {v.name for v in (*RECEPTION, *PING_POSE, *DEPTH)} - part.names
        for name in sorted(part.foreign_inputs):
            if f"{label}.{name}" not in fed:
                warnings.warn(
                    f"{label}.{name}: nothing feeds this input, it keeps its start value"
                    f"{nearest(name, ports)}",
                    ConfigurationWarning,
                    stacklevel=3,
                )


def ours(
    scenario: Scenario, chosen: Mapping[str, Source], replaced: Collection[str] = ()
) -> effects.Ours:
    """Our components by table; none where a third-party component uses the table's keys too."""
    by_table = {
        name: () if name in replaced else names
        for name, names in effects.components_of(scenario).items()
    }
    strangers = any(not isinstance(source, str) for source in chosen.values())
    by_table["receiver"] = () if strangers else [s for s in chosen.values() if isinstance(s, str)]
    return by_table


def no_effect(scenario: Scenario, idle: Mapping[effects.Key, str]) -> Iterator[str]:
    """Messages about keys without effect, grouped by location and reason."""
    grouped: dict[tuple[str, str], list[str]] = {}
    for (table, key), why in idle.items():
        location = scenario.where(table, key)
        before, same, _ = location.rpartition(f"[{table}] {key}")
        grouped.setdefault((f"{before}[{table}]" if same else location, why), []).append(key)
    for (location, why), keys in grouped.items():
        override = location.startswith("override ")
        named = location if override else f"{location} {shortened(', '.join(keys))}"
        yield f"{named}: {'has' if len(keys) == 1 else 'have'} no effect, as {why}"


def _values(
    variables: Iterable[Variable], table: Any,
    assumptions: Mapping[str, Any] = MappingProxyType({}),
) -> dict[str, Value]:
    """Values of some parameters, given, assumed or of the table: FMI names and SI values."""
    values = {}
    for v in variables:
        value = getattr(table, v.key)
        if v.key not in table.model_fields_set:
            value = assumptions.get(v.key, value)
        values[v.name] = (v, value)
    return {name: in_si(v, value) for name, (v, value) in values.items() if value is not None}


def _flat(value: Any) -> Value:
    if not isinstance(value, list | tuple):
        return value  # type: ignore[no-any-return]
    return tuple(x for row in value for x in (row if isinstance(row, list | tuple) else [row]))


def _refuse_idle_keys(scenario: Scenario, chosen: Mapping[str, Source]) -> None:
    """Refuse keys that no receiver of the run has: they would have no effect."""
    table = scenario.receiver
    if table.fmu is not None:
        return  # `_foreign` checks against the FMU itself
    foreign = {label: s for label, s in chosen.items() if not isinstance(s, str)}
    further = {k for label, s in foreign.items() for k in _ports(label, s)}
    for key in table.parameters or {}:
        if key not in further:
            raise ConfigurationError(
                f"{scenario.where('receiver', 'parameters')}: must be parameters of a receiver "
                f"that is a file or a class, got {key!r}{nearest(key, further)}"
            )
    names = sorted({table.type, *(s for s in chosen.values() if isinstance(s, str))})
    known = {v.key for name in names for v in RECEIVERS[name].of("parameter")}
    for label, source in chosen.items():
        if not isinstance(source, str):
            has = _ports(label, source)
            known |= {key for key, v in table.variables.items() if v.name in has}
    for key in table.variables:
        if key in table.model_fields_set and key not in known:
            have = [name for name, r in RECEIVERS.items() if key in {v.key for v in r}]
            raise ConfigurationError(
                f"{scenario.where('receiver', key)}: must be a key of a receiver of this run "
                f"({', '.join(names)}), got one of {', '.join(have)}"
            )


def _hand_over_start(parts: dict[str, _Part], labels: Iterable[str]) -> None:
    """Write the true start, at rest, into the receivers' priors."""
    position = _at_start(parts["target"].spec, "position")
    start: dict[str, Value] = {
        "prior_position": position,
        "prior_velocity": (0.0, 0.0, 0.0),
    }
    for label in labels:
        part = parts[label]
        known = {name: value for name, value in start.items() if name in part.names}
        spec = replace(part.spec, parameters={**part.spec.parameters, **known})
        parts[label] = replace(part, spec=spec)


def _at_start(spec: ComponentSpec, name: str) -> tuple[float, ...]:
    """The elements of an output at the start, row by row."""
    if isinstance(spec.fmu, Path):
        known = tuple(sorted(spec.parameters.items()))
        return _fmu_at_start(spec.fmu, read(spec.fmu).sha256, spec.interval_ns, known, name)
    return tuple(map(float, initial_outputs(spec, (name,))[name].flat))


@lru_cache(64)
def _fmu_at_start(
    fmu: Path, sha256: str, interval_ns: int, parameters: tuple[tuple[str, Value], ...], name: str
) -> tuple[float, ...]:
    """`_at_start` of an FMU, cached because the points of a study share it."""
    outputs = initial_outputs(ComponentSpec(fmu, interval_ns, dict(parameters)), (name,))
    return tuple(map(float, outputs[name].flat))


def _stop_ns(scenario: Scenario, parts: Mapping[str, _Part]) -> int:
    target, duration = parts["target"], scenario.time.duration_s
    common = math.lcm(*(part.spec.interval_ns for part in parts.values()))
    if duration != PATH and nanoseconds(duration) < common:
        raise ConfigurationError(
            f"{scenario.where('time', 'duration_s')}: must be at least {common / SECOND:g} s, the "
            f"least common multiple of all intervals, got {duration!r}"
        )
    if duration == PATH:
        duration = 0.0
        if "path_duration" in target.names:
            (duration,) = _at_start(target.spec, "path_duration")
        if not 0.0 < duration < math.inf:
            speed = ("target", "speed_m_s")
            if target.spec.parameters.get("speed") == 0.0 and speed not in scenario.idle():
                raise ConfigurationError(
                    f"{scenario.where(*speed)}: must be more than 0 for a run until the end of the "
                    "path ([time] duration_s is 'path'), got 0.0"
                )
            raise ConfigurationError(
                f"{scenario.where('time', 'duration_s')}: must be a number for a target that does "
                f"not tell when its path ends, got 'path'"
            )
    return nanoseconds(duration)


def _connections(parts: Mapping[str, _Part], receivers: Iterable[str]) -> Iterator[Connection]:
    """The standard connections by name; a receiver gets those for which it has an input."""
    for variable in MOTION:
        yield Connection(f"target.{variable.name}", f"acoustics.target_{variable.name}")
    for variable in BEACON_POSITIONS:
        yield Connection(f"platform.{variable.name}", f"acoustics.{variable.name}")
    for variable in REPORTED_POSE:
        if {variable.name} <= parts["platform"].names & parts["acoustics"].names:
            yield Connection(f"platform.{variable.name}", f"acoustics.{variable.name}")
    sensors = (("acoustics", (*RECEPTION, *PING_POSE)), ("target", DEPTH))
    for label in receivers:
        for source, variables in sensors:
            for variable in variables:
                optional = variable in PING_POSE
                if variable.name in parts[label].names and (
                    not optional or variable.name in parts[source].names
                ):
                    yield Connection(f"{source}.{variable.name}", f"{label}.{variable.name}")
