"""Turn a scenario into a system: FMUs, their parameters, and the standard connections."""

from __future__ import annotations

import math
import warnings
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path

from sblcosim.fmus.host.nanoseconds import SECOND, nanoseconds
from sblcosim.fmus.read.ports import read
from sblcosim.models import RECEIVERS
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
    nearest,
    shortened,
)
from ..simulation.execution import initial_outputs
from ..simulation.plans.alike import alike
from ..simulation.plans.settings import facts_of
from ..simulation.system import ComponentSpec, Connection, System, Value
from . import effects
from .components import (
    UnconnectedComponent,
    built,
    described,
    foreign,
    names_of,
    ours_of,
    ports_of_source,
    receiver_of,
)
from .doubts import doubts
from .labels import RAW
from .scenario import Receivers, Scenario, Source, load
from .schema import CORE_COMPONENTS, PATH, SHARED_PARAMETERS
from .sources import Choice, choice_of, file_of


def connect(
    scenario: Scenario,
    receivers: Receivers = (),
    fmi: int | None = None,
    components: Mapping[str, Source] | None = None,
    raw: bool = True,
    tell_idle: bool = True,
) -> System:
    """Choose and connect the components of a scenario; build missing FMUs.

    Parameters
    ----------
    receivers
        Names, FMU files or makers of Python components, side by side on the same noise; a mapping
        gives them labels. None: the scenario's own receiver. With ``raw`` the raw fix also runs, as
        ``raw``, unless ``multilateration`` is requested.
    fmi
        FMI version (2 or 3) of all our components, instead of the scenario's.
    components
        FMU files or makers of Python components to use as ``target``, ``platform``, ``acoustics``.
    tell_idle
        Whether to warn about given keys without effect.

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
    choice = choice_of(scenario, receivers, fmi, components)
    return connected(scenario, choice, raw=raw, tell_idle=tell_idle)


def connected(
    scenario: Scenario, choice: Choice, *, raw: bool = True, tell_idle: bool = True
) -> System:
    """As `connect`, for what has been chosen."""
    _refuse_idle_keys(scenario, choice.receivers)
    receivers = {k: v for k, v in choice.receivers.items() if raw or k != RAW}
    _build_missing(scenario, choice, receivers.values())
    parts = _core(scenario, choice)
    for label, source in receivers.items():
        parts[label] = receiver_of(scenario, label, source, _fmi(scenario, choice, "receiver"))
    if scenario.true_prior:
        _hand_over_start(parts, choice.receivers)
    connections = _connections(tuple((name, part.names) for name, part in parts.items()))
    _warn_of_idle_inputs(parts, {connection.target for connection in connections})
    if tell_idle:
        _warn_of_idle_keys(scenario, ours(scenario, choice.receivers, choice.components))
    _warn_of_doubts(scenario, choice.receivers)
    return System(
        components={name: part.spec for name, part in parts.items()},
        connections=connections,
        stop_ns=_stop_ns(scenario, parts),
    )


def _build_missing(scenario: Scenario, choice: Choice, receivers: Iterable[Source]) -> None:
    """Build those of our FMUs that the cache lacks, side by side."""
    ours = [
        (name, _fmi(scenario, choice, name)) for name in CORE_COMPONENTS
        if _core_source(scenario, choice, name) is None
    ]
    fmi = _fmi(scenario, choice, "receiver")
    ours += [(source, fmi) for source in receivers if isinstance(source, str)]
    target = scenario.target
    key = (scenario.beacons, id(target), *ours)
    alike("fmus", key, lambda: built(scenario, ours), target)


def _fmi(scenario: Scenario, choice: Choice, table: str) -> int:
    """FMI version of our component with the keys of a table."""
    return choice.fmi or getattr(scenario, table).fmi or scenario.fmi


def _core_source(scenario: Scenario, choice: Choice, name: str) -> Source | None:
    """What replaces a component that every system has; None: ours runs."""
    own: str | None = getattr(scenario, name).fmu
    return choice.components.get(name, own)


def _core(scenario: Scenario, choice: Choice) -> dict[str, UnconnectedComponent]:
    """The components that every system has."""
    parts: dict[str, UnconnectedComponent] = {}
    for name in CORE_COMPONENTS:
        source = _core_source(scenario, choice, name)
        if source is None:
            parts[name] = ours_of(name, scenario, name, _fmi(scenario, choice, name))
        else:
            parts[name] = foreign(name, scenario, source, name not in choice.components)
    return parts


def applied(scenario: Scenario, choice: Choice) -> Scenario:
    """The scenario with the choices merged into it, as far as a file can hold them.

    It gets the first of several receivers, without keys that this receiver does not have. A Python
    component that is not from a file leaves the scenario's own choice in place.
    """
    tables = scenario.given()
    if choice.fmi is not None:
        tables["fmi"] = choice.fmi
        for name in (*CORE_COMPONENTS, "receiver"):
            tables.get(name, {}).pop("fmi", None)
    sources = {**choice.components, "receiver": next(iter(choice.receivers.values()))}
    for name, source in sources.items():
        file = file_of(source)
        if file is None and not isinstance(source, str):
            continue
        table = getattr(scenario, name)
        given = tables.setdefault(name, {})
        if file is None:
            assert isinstance(source, str)
            known = {v.name for v in RECEIVERS[source].of("parameter")}
            own = {"type": source}
        else:
            known = {*names_of(name, source), *SHARED_PARAMETERS}
            own = {"fmu": file}
        for key in given.keys() & table.variables.keys():
            if table.variables[key].name not in known:
                del given[key]
        if own.items() <= table.model_dump().items():
            continue
        further = given.get("parameters") or {} if table.fmu is None else {}
        for key in ("type", "fmu", "parameters"):
            given.pop(key, None)
        given |= own
        further = {k: v for k, v in further.items() if file is not None and k in known}
        if further:
            given["parameters"] = further
    return load(tables)


def _warn_of_idle_keys(scenario: Scenario, known: effects.Ours) -> None:
    for line in no_effect(scenario, effects.idle(scenario, known, effects.given(scenario))):
        warnings.warn(line, NoEffectWarning, stacklevel=3)


def _warn_of_doubts(scenario: Scenario, chosen: Mapping[str, Source]) -> None:
    for line in doubts(scenario, chosen):
        warnings.warn(line, ConfigurationWarning, stacklevel=3)


def _warn_of_idle_inputs(parts: Mapping[str, UnconnectedComponent], fed: Iterable[str]) -> None:
    for label, part in parts.items():
        if not part.foreign_inputs:
            continue
        ports = {v.name for v in (*RECEPTION, *PING_POSE, *DEPTH)} - part.names
        for name in sorted(part.foreign_inputs):
            if f"{label}.{name}" not in fed:
                warnings.warn(
                    f"{label}.{name}: nothing feeds this input, so it keeps its start value"
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


def _refuse_idle_keys(scenario: Scenario, chosen: Mapping[str, Source]) -> None:
    """Refuse keys that no receiver of the run has: they would have no effect."""
    table = scenario.receiver
    if table.fmu is not None:
        return  # `foreign` checks against the FMU itself
    foreign = {label: s for label, s in chosen.items() if not isinstance(s, str)}
    further = {k for label, s in foreign.items() for k in names_of(label, s)}
    for key in table.parameters or {}:
        if key not in further:
            raise ConfigurationError(
                f"{scenario.where('receiver', 'parameters')}: must be parameters of a receiver "
                f"that is a file or a class, got {key!r}{nearest(key, further)}"
            )
    names = sorted({table.type, *(s for s in chosen.values() if isinstance(s, str))})
    known = {key for name in names for key in described(name, ())[1]}
    for label, source in chosen.items():
        if not isinstance(source, str):
            has = ports_of_source(label, source)
            known |= {key for key, v in table.variables.items() if v.name in has}
    unknown = (table.model_fields_set & table.variables.keys()) - known
    for key in table.variables if unknown else ():
        if key in unknown:
            have = [name for name, r in RECEIVERS.items() if key in {v.key for v in r}]
            raise ConfigurationError(
                f"{scenario.where('receiver', key)}: must be a key of a receiver of this run "
                f"({', '.join(names)}), got one of {', '.join(have)}"
            )


def _hand_over_start(parts: dict[str, UnconnectedComponent], labels: Iterable[str]) -> None:
    """Write the true start, at rest, into the receivers' priors."""
    position = _at_start(parts["target"], "position")
    start: dict[str, Value] = {
        "prior_position": position,
        "prior_velocity": (0.0, 0.0, 0.0),
    }
    for label in labels:
        if label not in parts:
            continue
        part = parts[label]
        parts[label] = alike("priors", (id(part), position), partial(_begun, part, start), part)


_STARTS = ("position", "path_duration")
_OF_SENSOR = {"sampling_time", "depth_std", "depth_bias", "depth_bias_std"}
"""Parameters of our target that none of `_STARTS` depends on: those of the depth sensor."""


def _begun(part: UnconnectedComponent, start: Mapping[str, Value]) -> UnconnectedComponent:
    known = {name: value for name, value in start.items() if name in part.names}
    return replace(part, spec=part.spec.varied(known))


def _at_start(part: UnconnectedComponent, name: str) -> tuple[float, ...]:
    """The elements of an output at the start, row by row."""
    if isinstance(part.spec.fmu, Path) and name in part.names:
        return alike("start", id(part), partial(_started, part), part)[name]
    return _start_of(part.spec, (name,))[name]


def _started(part: UnconnectedComponent) -> dict[str, tuple[float, ...]]:
    """Those of `_STARTS` that an FMU has, at the start."""
    spec, is_ours = part.spec, part.foreign_inputs is None
    assert isinstance(spec.fmu, Path)
    start_of = partial(_start_of, spec, [name for name in _STARTS if name in part.names])
    without = _OF_SENSOR if is_ours else ()
    known = [fact for name, fact in facts_of(spec).items() if name not in without]
    if None in known:
        return start_of()
    interval = None if is_ours else spec.interval_ns
    return alike("starts", (read(spec.fmu).sha256, interval, *known), start_of)


def _start_of(spec: ComponentSpec, names: Sequence[str]) -> dict[str, tuple[float, ...]]:
    outputs = initial_outputs(spec, names)
    return {name: tuple(map(float, outputs[name].flat)) for name in names}


def _stop_ns(scenario: Scenario, parts: Mapping[str, UnconnectedComponent]) -> int:
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
            (duration,) = _at_start(target, "path_duration")
        if not 0.0 < duration < math.inf:
            speed = ("target", "speed_m_s")
            if target.spec.parameters.get("speed") == 0.0 and speed not in scenario.idle():
                raise ConfigurationError(
                    f"{scenario.where(*speed)}: must be more than 0 for a run until the end of the "
                    "path ([time] duration_s is 'path'), got 0.0"
                )
            raise ConfigurationError(
                f"{scenario.where('time', 'duration_s')}: must be a number for a target that does "
                f"not state when its path ends, or whose path has no length, got 'path'"
            )
        if nanoseconds(duration) < common:
            raise ConfigurationError(
                f"{scenario.where('time', 'duration_s')}: must be at least {common / SECOND:g} s, "
                f"the least common multiple of all intervals, got 'path', which takes "
                f"{duration:.6g} s"
            )
    return nanoseconds(duration)


@lru_cache(64)
def _connections(parts: tuple[tuple[str, frozenset[str]], ...]) -> tuple[Connection, ...]:
    """The standard connections by name; a receiver gets those that it has an input for.

    Parameters
    ----------
    parts
        Labels and names of variables.
    """
    return tuple(standard_connections(dict(parts)))


def standard_connections(names: Mapping[str, frozenset[str]]) -> Iterator[Connection]:
    """The standard connections of components, from the names of their variables."""
    for variable in MOTION:
        yield Connection(f"target.{variable.name}", f"acoustics.target_{variable.name}")
    for variable in BEACON_POSITIONS:
        yield Connection(f"platform.{variable.name}", f"acoustics.{variable.name}")
    for variable in REPORTED_POSE:
        if {variable.name} <= names["platform"] & names["acoustics"]:
            yield Connection(f"platform.{variable.name}", f"acoustics.{variable.name}")
    sensors = (("acoustics", (*RECEPTION, *PING_POSE)), ("target", DEPTH))
    for label in (label for label in names if label not in CORE_COMPONENTS):
        for source, variables in sensors:
            for variable in variables:
                optional = variable in PING_POSE
                if variable.name in names[label] and (
                    not optional or variable.name in names[source]
                ):
                    yield Connection(f"{source}.{variable.name}", f"{label}.{variable.name}")
