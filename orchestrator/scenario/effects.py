"""Find keys of a scenario without effect, and explain why.

A parameter of our own components has an effect if the conditions in its declaration hold
(`Variable.needs`). A key that only sets other keys has an effect unless all of these are given.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from functools import cache, lru_cache
from typing import Any, Protocol

from sblcosim.models import COMPONENTS, RECEIVERS
from sblcosim.models.declaration import Condition, Variable
from sblcosim.models.settings.keys import in_si
from sblcosim.models.settings.presets import PRESET_TABLES, PRESETS, preset

from ..words.lists import listed, plural
from .schema import CORE_COMPONENTS, Table, toml
from .timing import slot_of
from .tracks import FILE, FILE_KEYS

Key = tuple[str, ...]
"""A key's table and name, or its name alone."""
Ours = Mapping[str, Collection[str]]
"""Names of our components that use the keys of each table."""
_SHOWN = 3  # names listed in a reason
_OF_PRESETS = {"platform": "the platform is", "acoustics": "the acoustics are"}


_SELECTED_BY = {("platform", "beacon_m"): "arrangement"}
"""Keys that select themselves, and the key that states this if it is given."""


def is_choice(key: Key) -> bool:
    """Whether a given key changes something that no other key sets."""
    return key in _SELECTED_BY


class _Tables(Protocol):
    """The part of a scenario that is needed here."""

    time: Any
    platform: Any
    acoustics: Any
    receiver: Any


def components_of(scenario: _Tables) -> Ours:
    """Our components that the scenario itself selects, by table."""
    receiver = scenario.receiver
    return {
        **{n: (n,) if getattr(scenario, n).fmu is None else () for n in CORE_COMPONENTS},
        "receiver": (receiver.type,) if receiver.fmu is None else (),
    }


def idle(scenario: _Tables, ours: Ours, keys: Iterable[Key]) -> dict[Key, str]:
    """Those of the keys that have no effect in a scenario, each with the reason."""
    names = {table: tuple(own) for table, own in ours.items()}
    reasons = {key: _why(scenario, names, key) for key in keys}
    return {key: why for key, why in reasons.items() if why is not None}


def in_vain(scenario: _Tables, ours: Ours, keys: Collection[Key]) -> dict[Key, str]:
    """As `idle`, plus keys that only set other keys if all of these are given."""
    reasons = {key: _all_given(scenario, _governed(scenario, key), key) for key in keys}
    redundant = {key: why for key, why in reasons.items() if why is not None}
    return redundant | idle(scenario, ours, keys)


def given(scenario: _Tables) -> Iterator[Key]:
    """Keys of parameters and presets that were given explicitly."""
    for name in (*CORE_COMPONENTS, "receiver"):
        table = getattr(scenario, name)
        kind: type[Table] = type(table)
        yield from ((name, key) for key in _keys_of(kind) if key in table.model_fields_set)


@cache
def _keys_of(kind: type[Table]) -> tuple[str, ...]:
    """Keys of a table that are parameters, presets or files."""
    known = {*kind.variables, *PRESET_TABLES, *FILE_KEYS}
    return tuple(key for key in kind.model_fields if key in known)


def conditions(key: Key) -> Iterator[Key]:
    """Keys that decide whether a key has an effect."""
    table, name = key[0], key[-1]
    names = RECEIVERS if table == "receiver" else (table,)
    for groups in _takers(table, tuple(names), name):
        yield from ((table, variable.key) for group in groups for _, variable in group)


def _why(scenario: _Tables, ours: Mapping[str, tuple[str, ...]], key: Key) -> str | None:
    """Why a key has no effect in any of our components that use it; None if it has one."""
    name, table = key[-1], getattr(scenario, key[0])
    if name in PRESET_TABLES:
        if getattr(table, name) is not None and not ours[key[0]]:
            return f"{_OF_PRESETS[key[0]]} another component"
        set_ = [_why(scenario, ours, (key[0], governed)) for governed in sorted(PRESETS[name])]
        return set_[0] if None not in set_ else None
    if key in _SELECTED_BY and not {name, _SELECTED_BY[key]} & table.model_fields_set:
        return None  # giving it selects it
    if key == _DEPTH and _sets_slot(scenario):
        return None
    if name in FILE_KEYS:
        if key[0] == "target" and table.trajectory != FILE and ours[key[0]]:
            return f"trajectory is {toml(table.trajectory)}"
        return "there is no track_file" if table.track_file is None else None
    reasons = []
    for groups in _takers(key[0], ours.get(key[0], ()), name):
        unmet = next((g for g in groups if not any(_holds(it, table) for it in g)), None)
        if unmet is None:
            return None
        reasons.append(unmet)
    return _text(reasons[0], table) if reasons else None


_DEPTH = ("acoustics", "water_depth_m")
"""The key that also decides how late the echoes of a packet are, and so the slot."""


def _sets_slot(scenario: _Tables) -> bool:
    """Whether the time between pings follows from packets and echoes."""
    given = "sampling_time_s" in scenario.time.model_fields_set
    return not given and slot_of(scenario.acoustics) is not None


_Met = tuple[Condition, Variable]
"""A condition, and the variable that it refers to."""


@lru_cache(4096)
def _takers(
    table: str, names: tuple[str, ...], key: str
) -> tuple[tuple[tuple[_Met, ...], ...], ...]:
    """Groups of conditions for each component with this key: one condition of each must hold."""
    return tuple(
        tuple(tuple((c, COMPONENTS[name][c.parameter]) for c in group) for group in variable.needs)
        for name in (names if table in (*CORE_COMPONENTS, "receiver") else ())
        for variable in COMPONENTS[name].of("parameter")
        if variable.key == key
    )


def _holds(condition: _Met, table: Any) -> bool:
    return condition[0].holds(_value(condition[1], table))


def _value(variable: Variable, table: Any) -> Any:
    value = getattr(table, variable.key)
    if value is None:  # only another receiver of the run has this key
        return variable.starts if variable.shape else variable.starts[0]
    return in_si(variable, value)


def _text(group: Iterable[_Met], table: Any) -> str:
    """The unmet conditions, in words."""
    names: dict[str, list[str]] = {}
    for condition, variable in group:
        value = _value(variable, table)
        if variable.choices is not None:
            value = variable.choices[value]
        elif not condition.values:
            value = False if variable.type == "Boolean" else 0
        names.setdefault(toml(value), []).append(variable.key)
    return " and ".join(f"{_are(keys)} {value}" for value, keys in names.items())


def _are(keys: list[str]) -> str:
    """``a is``, ``a and b are``, ``a, b, c and 4 others are``."""
    names = listed(keys, most=_SHOWN, shown=_SHOWN - 1, rest="others")
    return f"{names} {plural(len(keys), 'is', 'are')}"


# --- Keys that only set other keys ---------------------------------------------------------------


_UPDATE = ("receiver", "update_interval_s")
_GOVERNED: Mapping[Key, Sequence[Key]] = {
    ("seed",): [(name, "seed") for name in CORE_COMPONENTS],
    ("time", "sampling_time_s"): [
        *((name, "sampling_time_s") for name in CORE_COMPONENTS), _UPDATE,
    ],
    ("time", "ekf_ratio"): [_UPDATE],
}
"""Keys that only set other keys, and those keys; a key that is given takes precedence."""


def _governed(scenario: _Tables, key: Key) -> Sequence[Key]:
    """Keys that are all that a key sets; empty if it sets more, or is not given."""
    table, name = key[0], key[-1]
    if len(key) == 2 and PRESET_TABLES.get(name) == table:
        value = getattr(getattr(scenario, table), name)
        return [] if value is None else [(table, governed) for governed in preset(name, value)]
    return _GOVERNED.get(key, ())


def _all_given(scenario: _Tables, governed: Sequence[Key], key: Key) -> str | None:
    left = [it for it in governed if it[1] not in getattr(scenario, it[0]).model_fields_set]
    if left or not governed:
        return None
    inside = key[0] if len(key) > 1 else ""
    return f"{_are([n if t == inside else f'{t}.{n}' for t, n in governed])} given"
