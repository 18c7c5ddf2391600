"""From a scenario to a system: which FMUs, their parameters, and the standard connections."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path
from typing import Any, Literal, cast

from sblcosim.models import COMPONENTS, RECEIVERS
from sblcosim.models.declaration import Variable
from sblcosim.models.ports import BEACON_POSITIONS, DEPTH, MOTION, RECEPTION

from .errors import ConfigurationError, nearest
from .fmu import ports_of, read
from .master import initial_outputs
from .scenario import Receivers, Scenario, Source
from .system import SECOND, ComponentSpec, Connection, System, Value
from .tables import PATH, TRUE, in_si, nanoseconds

FIXED = ("target", "platform", "acoustics")
"""Names of the components that every system has."""
RAW = "raw"
"""Name of the raw fix that runs beside the receivers for comparison."""
_RUN = ("sampling_time", "update_interval", "seed", "range_std", "depth_std")
"""Parameters that a foreign component gets without being asked, if it has them."""


@dataclass(frozen=True, slots=True)
class _Part:
    """A component of the system to be, and the names of its variables."""

    spec: ComponentSpec
    names: frozenset[str]


def connect(
    scenario: Scenario,
    receivers: Receivers = (),
    fmi: int | None = None,
    components: Mapping[str, Source] | None = None,
) -> System:
    """Choose and connect the components of a scenario; missing FMUs are built.

    Parameters
    ----------
    receivers
        Names, FMU files or makers of Python components, side by side on the same noise; a mapping
        gives them labels. None: the scenario's own. The raw fix is always there, as ``raw``,
        unless ``multilateration`` is asked for.
    fmi
        FMI version (2 or 3) of all our components, in place of the scenario's.
    components
        FMU files or makers of Python components to use as ``target``, ``platform``, ``acoustics``.

    Raises
    ------
    ConfigurationError
        A receiver, a file or a key is unknown, or the path has no end.
    FmuError
        An FMU could not be built or read.
    """
    replaced = dict(components or {})
    for name in replaced:
        if name not in FIXED:
            raise ConfigurationError(
                f"components: must be {', '.join(FIXED)}, got {name!r}{nearest(name, FIXED)}"
            )
    parts: dict[str, _Part] = {}
    for name in FIXED:
        table = getattr(scenario, name)
        source = replaced.get(name, table.fmu)
        if source is None:
            parts[name] = _ours(name, table, fmi or table.fmi or scenario.fmi)
        else:
            parts[name] = _foreign(name, table, source, own=name not in replaced)
    table = scenario.receiver
    chosen = _chosen(scenario, receivers)
    _refuse_idle_keys(scenario, chosen)
    for label, source in chosen.items():
        if isinstance(source, str):
            parts[label] = _ours(source, table, fmi or table.fmi or scenario.fmi)
        else:
            _check_contract(source)
            own = table.fmu is not None and source == Path(table.fmu)
            parts[label] = _foreign("receiver", table, source, own)
    if scenario.true_prior:
        _hand_over_start(parts, chosen)
    return System(
        components={name: part.spec for name, part in parts.items()},
        connections=tuple(_connections(parts, chosen)),
        stop_ns=_stop_ns(scenario, parts["target"]),
    )


def _ours(name: str, table: Any, fmi: int) -> _Part:
    from sblcosim.fmus.factory import build

    component = COMPONENTS[name]
    spec = ComponentSpec(
        build(name, cast(Literal[2, 3], fmi)),  # anything else is refused there
        nanoseconds(table.interval_s),
        _values(component.of("parameter"), table),
    )
    return _Part(spec, frozenset(v.name for v in component))


def _foreign(table_name: str, table: Any, source: Source, own: bool) -> _Part:
    """Somebody else's component: of the table, it gets what it has.

    If the scenario itself names the FMU (``own``), whatever the scenario gives must be there.
    """
    fmu = Path(source) if isinstance(source, str | Path) else source
    ports = read(fmu).ports if isinstance(fmu, Path) else ports_of(fmu().variables)
    has = {port.name for port in ports.values() if port.causality == "parameter"}
    given = {
        table.variables[key].name: key for key in table.variables if key in table.model_fields_set
    }
    if own:
        for name, key in given.items():
            if name not in has and name not in _RUN:
                raise ConfigurationError(
                    f"[{table_name}] {key}: must be a parameter of {fmu}, "
                    f"got {name!r}{nearest(name, has)}"
                )
    wanted = {*_RUN, *given}
    if getattr(table, "prior", None) == TRUE:
        wanted.add("initialisation")
    parameters = {
        name: value
        for name, value in _values(table.variables.values(), table).items()
        if name in has and name in wanted
    }
    if own:
        parameters |= {k: _flat(v) for k, v in (table.parameters or {}).items()}
    return _Part(ComponentSpec(fmu, nanoseconds(table.interval_s), parameters), frozenset(ports))


def _check_contract(source: Source) -> None:
    """Refuse an FMU that cannot be a receiver."""
    if not isinstance(source, Path):
        return
    from sblcosim.fmus.check import check_receiver

    report = check_receiver(source)
    problems = [f"{f.variable}: {f.message}" for f in report.of("error")]
    problems += [
        f"{port}: must be the variable's own name, got {name!r}"
        for port, name in report.names.items()
        if name != port
    ]
    if problems:
        more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
        raise ConfigurationError(
            f"{source}: must honour the plug contract of a receiver, got {problems[0]}{more}; "
            f"see 'sblcosim check {source}'"
        )


def _values(variables: Iterable[Variable], table: Any) -> dict[str, Value]:
    """What a table says about some parameters: FMI names and SI values."""
    values = {v.name: (v, getattr(table, v.key)) for v in variables}
    return {name: in_si(v, value) for name, (v, value) in values.items() if value is not None}


def _flat(value: Any) -> Value:
    if not isinstance(value, list | tuple):
        return value  # type: ignore[no-any-return]
    return tuple(x for row in value for x in (row if isinstance(row, list | tuple) else [row]))


def _chosen(scenario: Scenario, receivers: Receivers) -> dict[str, Source]:
    """Receivers by label, the raw fix included."""
    chosen: dict[str, Source] = {}
    if isinstance(receivers, Mapping):
        chosen = {label: _source(source) for label, source in receivers.items()}
    else:
        if isinstance(receivers, str | Path) or callable(receivers):
            receivers = (receivers,)
        table = scenario.receiver
        own = Path(table.fmu) if table.fmu else table.type
        for source in map(_source, receivers or (own,)):
            if source not in chosen.values():
                chosen[_label(source, {*chosen, *FIXED, RAW})] = source
    for label in chosen:
        if label in FIXED or not label or "." in label:
            raise ConfigurationError(
                f"receiver: label must be a name without a dot and not {', '.join(FIXED)}, "
                f"got {label!r}"
            )
    if "multilateration" not in chosen.values() and RAW not in chosen:
        chosen[RAW] = "multilateration"
    return chosen


def _source(source: Source) -> Source:
    """Tell names of receivers from files."""
    if not isinstance(source, str | Path) or source in RECEIVERS:
        return source
    path = Path(source)
    if path.is_file():
        return path
    if path.suffix == ".fmu":
        raise ConfigurationError(f"receiver: must be an existing file, got {str(source)!r}")
    raise ConfigurationError(
        f"receiver: must be {', '.join(RECEIVERS)} or an .fmu file, got {str(source)!r}"
        + nearest(str(source), RECEIVERS)
    )


def _label(source: Source, taken: Iterable[str]) -> str:
    if isinstance(source, str):
        return source
    name = source.stem if isinstance(source, Path) else getattr(source, "__name__", "receiver")
    label = stem = re.sub(r"\W", "_", name)
    number = 2
    while label in taken:
        label = f"{stem}_{number}"
        number += 1
    return label


def _refuse_idle_keys(scenario: Scenario, chosen: Mapping[str, Source]) -> None:
    """Refuse keys that no receiver of the run has: they would do nothing."""
    table = scenario.receiver
    if table.fmu is not None:
        return  # the FMU itself is asked
    names = sorted({table.type, *(s for s in chosen.values() if isinstance(s, str))})
    known = {v.key for name in names for v in RECEIVERS[name].of("parameter")}
    for key in table.variables:
        if key in table.model_fields_set and key not in known:
            have = [name for name, r in RECEIVERS.items() if key in {v.key for v in r}]
            raise ConfigurationError(
                f"{scenario.name}: [receiver] {key}: must be a key of a receiver of this run "
                f"({', '.join(names)}), got one of {', '.join(have)}"
            )


def _hand_over_start(parts: dict[str, _Part], labels: Iterable[str]) -> None:
    """Write the true start, at rest, into the receivers' priors."""
    position = initial_outputs(parts["target"].spec, ("position",))["position"]
    start: dict[str, Value] = {
        "prior_position": tuple(float(x) for x in position),
        "prior_velocity": (0.0, 0.0, 0.0),
    }
    for label in labels:
        spec, names = parts[label].spec, parts[label].names
        known = {name: value for name, value in start.items() if name in names}
        parts[label] = _Part(replace(spec, parameters={**spec.parameters, **known}), names)


def _stop_ns(scenario: Scenario, target: _Part) -> int:
    duration = scenario.time.duration_s
    if duration == PATH:
        duration = 0.0
        if "path_duration" in target.names:
            duration = float(initial_outputs(target.spec, ("path_duration",))["path_duration"])
        if not 0.0 < duration < math.inf:
            raise ConfigurationError(
                f"{scenario.name}: [time] duration_s: must be a number for a target that does not "
                f"tell when its path ends, got 'path'"
            )
    return int(Decimal(repr(duration)) * SECOND)


def _connections(parts: Mapping[str, _Part], receivers: Iterable[str]) -> Iterator[Connection]:
    """The standard wiring by name; a receiver is connected where it has the input."""
    for variable in MOTION:
        yield Connection(f"target.{variable.name}", f"acoustics.target_{variable.name}")
    for variable in BEACON_POSITIONS:
        yield Connection(f"platform.{variable.name}", f"acoustics.{variable.name}")
    for label in receivers:
        for source, variables in (("acoustics", RECEPTION), ("target", DEPTH)):
            for variable in variables:
                if variable.name in parts[label].names:
                    yield Connection(f"{source}.{variable.name}", f"{label}.{variable.name}")
