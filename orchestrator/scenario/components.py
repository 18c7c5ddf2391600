"""The components of a scenario: the FMU or class of each, and the values of its parameters."""

from __future__ import annotations

import marshal
import math
import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import compress
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast

from sblcosim.fmus.host.nanoseconds import nanoseconds
from sblcosim.fmus.read.ports import Port, ports_of, read
from sblcosim.fmus.standard import Fmi
from sblcosim.models import RECEIVERS, declared
from sblcosim.models.declaration import Variable
from sblcosim.models.ports import BEACON_POSITIONS, PING_POSE, RECEPTION
from sblcosim.models.settings.keys import to_si

from ..errors import ConfigurationError, nearest
from ..simulation.plans.alike import alike
from ..simulation.receiver import for_beacons
from ..simulation.system import ComponentSpec, Value
from ..simulation.user.files import variables_of
from ..simulation.user.receivers import of_fmu, of_folder
from . import tracks
from .own_keys import values_of
from .scenario import Scenario, Source
from .schema import SHARED_PARAMETERS, TRUE, Receiver, Table, given_of
from .sources import known_source, named


@dataclass(frozen=True, slots=True)
class UnconnectedComponent:
    """A future component: its variables, and its inputs if it is a third-party component."""

    spec: ComponentSpec
    names: frozenset[str]
    foreign_inputs: frozenset[str] | None = None


_NOTHING: Mapping[str, Any] = MappingProxyType({})


def ours_of(
    name: str, scenario: Scenario, where: str, fmi: int,
    assumptions: Mapping[str, Any] = _NOTHING,
) -> UnconnectedComponent:
    """One of our components, with the parameters of a table of the scenario."""
    table = getattr(scenario, where)
    assumed = marshal.dumps([*assumptions.items()], 2)  # version 2: without references
    key = (name, id(table), fmi, assumed)
    return alike("parts", key, lambda: _made(name, scenario, where, fmi, assumptions), table)


def _made(
    name: str, scenario: Scenario, where: str, fmi: int, assumptions: Mapping[str, Any]
) -> UnconnectedComponent:
    table = getattr(scenario, where)
    follower = tracks.FOLLOWERS.get(name)
    without = () if follower is None or tracks.follows(name, table) else follower.parameters
    names, rows = described(name, tuple(_constants(name, scenario).items()), without)
    (fmu,) = built(scenario, [(name, fmi)])
    content = _content(table, assumptions)
    # Points of a study differ from the first in only a few parameters.
    first = alike("first", (id(rows), fmu), lambda: _First(fmu, rows, content), rows)
    return UnconnectedComponent(first.varied(content, nanoseconds(table.interval_s)), names)


def built(scenario: Scenario, ours: Sequence[tuple[str, int]]) -> list[Path]:
    """FMUs of our components, by name and FMI version, for a scenario; missing ones are built."""
    from sblcosim.fmus.build.factory import Wanted, build_all

    return build_all([  # refuses other versions
        Wanted(name, cast(Fmi, fmi), constants=_constants(name, scenario)) for name, fmi in ours
    ])


def _constants(name: str, scenario: Scenario) -> dict[str, int]:
    """The constants of the build of one of our components."""
    return {"beacons": scenario.beacons, **tracks.capacity(name, getattr(scenario, name, None))}


class _First:
    """The first component made for an FMU."""

    def __init__(self, fmu: Path, rows: _Rows, content: Mapping[str, Any]) -> None:
        self._rows, self._content = rows, content
        self._before = [content[key] for key in rows]
        self._spec = ComponentSpec(fmu, 1, _values(rows, content))

    def varied(self, content: Mapping[str, Any], interval_ns: int) -> ComponentSpec:
        """The component with other values in its table."""
        spec, before = self._spec, self._content
        others = map(operator.is_not, map(content.__getitem__, self._rows), self._before)
        rows = {
            key: self._rows[key] for key in compress(self._rows, others)
            if not _same(content[key], before[key])
        }
        changes = _values(rows, content)
        if len(changes) < len(rows) or not changes.keys() <= spec.parameters.keys():
            return ComponentSpec(spec.fmu, interval_ns, _values(self._rows, content))
        return spec.varied(changes, interval_ns)


def _same(one: Any, other: Any) -> bool:
    """Whether arrays have the same elements; other values may differ."""
    arrays = type(one) is type(other) is tuple and len(one) == len(other)
    return arrays and all(map(operator.is_, one, other))


_Rows = Mapping[str, tuple[str, Callable[[Any], Any] | None]]
"""Names of parameters by key, and how values in a file become SI values."""


@lru_cache(256)
def described(
    name: str, constants: tuple[tuple[str, int], ...], left_out: tuple[str, ...] = ()
) -> tuple[frozenset[str], _Rows]:
    """Names of all variables of one of our components, and its parameters except some."""
    component = declared(name, **dict(constants))
    parameters = (v for v in component.of("parameter") if v.name not in left_out)
    return frozenset(v.name for v in component), _rows(parameters)


def _rows(variables: Iterable[Variable]) -> _Rows:
    return {v.key: (v.name, to_si(v)) for v in variables}


def receiver_of(scenario: Scenario, label: str, source: Source, fmi: int) -> UnconnectedComponent:
    table = scenario.receiver
    if isinstance(source, str):
        names, rows = described(source, ())
        assumed = scenario.assumptions(names)
        assumed = {key: assumed[key] for key in rows if key in assumed}
        return ours_of(source, scenario, "receiver", fmi, assumed)
    own = table.fmu is not None and source == known_source(table.fmu)
    built = of_fmu(source)
    if built is not None and (built.beacons, built.fmi) != (scenario.beacons, fmi):
        source = of_folder(str(built.folder), scenario.beacons, cast(Fmi, fmi)).fmu
    _check_contract(label, source)
    return foreign("receiver", scenario, source, own)


def foreign(table_name: str, scenario: Scenario, source: Source, own: bool) -> UnconnectedComponent:
    """A third-party component: it receives those keys of the table that are its parameters.

    If the scenario itself names the file (``own``), every given key must be a parameter.
    """
    table = getattr(scenario, table_name)
    fmu = Path(source) if isinstance(source, str | Path) else for_beacons(source, scenario.beacons)
    ports = ports_of_source(table_name, fmu)
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
    built = of_fmu(fmu)
    wanted = {*SHARED_PARAMETERS, *given}
    if getattr(table, "prior", None) == TRUE:
        wanted.add("initialisation")
    assumed = scenario.assumptions(has) if table_name == "receiver" else {}
    content = _content(table, assumed)
    values = {"seed": scenario.seed, **_values(_rows(table.variables.values()), content)}
    if built is not None:  # reported as for our receivers
        wanted |= {table.variables[key].name for key in assumed}
    if table_name == "receiver":
        wanted -= {
            _NAMED[key].name for key, value in by_name(scenario).items()
            if not takes(fmu, key, value)
        }
    parameters = {k: v for k, v in values.items() if k in has and k in wanted}
    further = table.parameters or {}
    if built is not None:
        keys = {v.key for v in built.parameters}
        mine = {k: v for k, v in further.items() if own or k in keys}
        parameters |= values_of(scenario, built, mine)
    elif table.fmu is None:
        parameters |= {k: _flat(v) for k, v in further.items() if k in has}
    elif own:
        parameters |= {k: _flat(v) for k, v in further.items()}
    _check_beacons(scenario, fmu, ports)
    inputs = frozenset(port.name for port in ports.values() if port.causality == "input")
    spec = ComponentSpec(fmu, nanoseconds(table.interval_s), parameters)
    return UnconnectedComponent(spec, frozenset(ports), inputs)


_NAMED: Mapping[str, Variable] = {k: v for k, v in Receiver.variables.items() if v.named}
"""Keys of ``[receiver]`` that may hold the name of a value."""


def by_name(scenario: Scenario) -> dict[str, float]:
    """Keys of ``[receiver]`` that hold the name of a value, and the values."""
    given = {key: getattr(scenario.receiver, key) for key in _NAMED}
    return {
        key: named[given[key]] for key, v in _NAMED.items()
        if given[key] in (named := v.named or {})
    }


def takes(source: Source, key: str, value: float) -> bool | None:
    """Whether a receiver takes a named value; None if it has no such parameter.

    It does if the bounds of its parameter include the value. One that does not keeps its start
    value.
    """
    ours = isinstance(source, str) and source in RECEIVERS
    ports = _ports_of_ours(str(source)) if ours else ports_of_source("receiver", source)
    port = ports.get(_NAMED[key].name)
    if port is None or port.causality != "parameter":
        return None
    low, high = port.min[0], port.max[0]
    least, _ = _NAMED[key].bounds
    below = least is not None and value < least
    return low <= value <= high and math.isfinite(low if below else high)


@cache
def _ports_of_ours(name: str) -> Mapping[str, Port]:
    return ports_of(RECEIVERS[name])


def _check_beacons(scenario: Scenario, source: Source, ports: Mapping[str, Port]) -> None:
    """Refuse a component made for a different number of beacons."""
    for variable in (*BEACON_POSITIONS, *RECEPTION, *PING_POSE):
        port = ports.get(variable.name)
        if variable.rows and port and port.shape and port.shape[0] != scenario.beacons:
            raise ConfigurationError(
                f"{named(source)}: must be made for the {scenario.beacons} beacons of the "
                f"scenario, got {port.name} of {port.shape[0]}; platform.beacons sets the number"
            )


def ports_of_source(where: str, source: Source) -> Mapping[str, Port]:
    if isinstance(source, str | Path):
        return read(Path(source)).ports
    return ports_of(variables_of(where, source))


def names_of(where: str, source: Source) -> frozenset[str]:
    """Names of a component's ports, and the keys of its parameters if a folder declares them."""
    built = of_fmu(source)
    keys = () if built is None else (v.key for v in built.parameters)
    return frozenset((*ports_of_source(where, source), *keys))


def _check_contract(label: str, source: Source) -> None:
    """Refuse a source that does not fulfil the contract of a receiver."""
    from sblcosim.fmus.conformance.receiver_contract import check_receiver, check_variables

    hint = ""
    if isinstance(source, str | Path):
        findings: Iterable[Any] = check_receiver(source).findings
        label, hint = named(source), f"; see 'sblcosim check {source}'"
    else:
        findings = check_variables(variables_of(label, source))
    problems = [f"{f.variable}: {f.message}" for f in findings if f.severity == "error"]
    if problems:
        more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
        raise ConfigurationError(
            f"{label}: must honour the plug contract of a receiver, got {problems[0]}{more}{hint}"
        )


def _content(table: Table, assumptions: Mapping[str, Any]) -> Mapping[str, Any]:
    """The keys of a table with their values: given, assumed or default."""
    return {**vars(table), **assumptions, **given_of(table)} if assumptions else vars(table)


def _values(rows: _Rows, content: Mapping[str, Any]) -> dict[str, Value]:
    """FMI names and SI values of those parameters that have a value."""
    return {
        name: content[key] if convert is None else convert(content[key])
        for key, (name, convert) in rows.items() if content[key] is not None
    }


def _flat(value: Any) -> Value:
    if not isinstance(value, list | tuple):
        return value  # type: ignore[no-any-return]
    return tuple(x for row in value for x in (row if isinstance(row, list | tuple) else [row]))
