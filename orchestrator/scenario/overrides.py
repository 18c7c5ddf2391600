"""Overrides of a scenario: paths of keys, and their values."""

from __future__ import annotations

import re
import tomllib
from collections.abc import ItemsView, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, TypeGuard

from sblcosim.models.settings.presets import PRESET_TABLES, PRESETS

from ..errors import ConfigurationError, instance, quoted, resolved, shortened
from ..simulation.plans.alike import alike, bits_of
from . import water
from .keys import Overrides
from .reading import check_values
from .schema import FILES, TABLES, Table, empty, given_of, valid

Changes = Overrides | ItemsView[str, Any] | Sequence[str]
"""Keys with values, ``{"platform.arm_length_m": 0.4}``, which type checkers know; ``keys.items()``
of any dict; or texts, ``["platform.arm_length_m=0.4"]``, with values in TOML."""

_Batch = Sequence[tuple[tuple[str, ...], Any]]
"""Paths of keys, and their values."""


def override(raw: dict[str, Any], overrides: Changes) -> set[tuple[str, ...]]:
    """Change keys of a scenario's tables, which may be valid already; returns the changed keys.

    Raises
    ------
    ConfigurationError
        An override is not a key with a value, or its value is nested too deeply, or too large.
    """
    given = gathered(overrides)
    if isinstance(given, Mapping) and {*map(type, given.values())} != {float}:  # floats fit
        check_values("overrides", given)
    batch = [*_pairs(given)]
    by_table: dict[str, list[tuple[tuple[str, ...], Any]]] = {}
    for path, value in batch:
        if not (type(value) is float and len(path) == 2):  # these, the most frequent, fit
            check_values(f"override {shortened('.'.join(path))}", value, len(path))
        by_table.setdefault(path[0], []).append((path, value))
    for name, own in by_table.items():
        table = raw.get(name, empty(TABLES[name]) if name in TABLES else None)
        if isinstance(table, Table) and all(len(path) > 1 for path, _ in own):
            raw[name] = _varied(name, table, own)
        else:
            _change(raw, own)
    return {path for path, _ in batch}


def _varied(name: str, table: Table, batch: _Batch) -> Any:
    """A table with some keys changed. Points of a study share a table if they agree in it."""

    def made() -> Any:
        raw = {name: without_none(given_of(table))}
        _change(raw, batch)
        return valid(type(table), raw[name])

    values = bits_of([value for _, value in batch])
    if values is None:
        return made()
    paths = tuple(path for path, _ in batch)
    return alike("tables", (id(table), paths, values), made, table)


def _change(raw: dict[str, Any], batch: _Batch) -> None:
    _clear_for_presets(raw, batch)
    for path, value in batch:
        table = raw
        for part in path[:-1]:
            table = table.setdefault(part, {})
            if not isinstance(table, dict):
                raise ConfigurationError(
                    f"override {shortened('.'.join(path))}: {shortened(part)} must be a table"
                )
        if value is None:
            table.pop(path[-1], None)
        elif is_mapping(value):
            table[path[-1]] = without_none(value)
        else:
            is_file = path[-1] in FILES and isinstance(value, str)
            table[path[-1]] = str(resolved(value)) if is_file else value


def _clear_for_presets(
    raw: Mapping[str, Any], batch: Iterable[tuple[tuple[str, ...], Any]]
) -> None:
    """Remove the keys that presets among the overrides replace: the later value wins."""
    said = dict(batch)
    for name, keys in PRESETS.items():
        table = raw.get(PRESET_TABLES[name])
        if said.get((PRESET_TABLES[name], name)) is not None and isinstance(table, dict):
            for key in keys:
                table.pop(key, None)
    table = raw.get("acoustics")
    if not isinstance(table, dict):
        return
    if any(said.get(("acoustics", key)) is not None for key in water.SETTERS):
        table.pop("sound_speed_m_s", None)
    elif said.get(("acoustics", "sound_speed_m_s")) is not None:
        for key in water.KEYS:
            table.pop(key, None)


_PLAIN = {bool, int, float, str, tuple, list}


def is_mapping(value: Any) -> TypeGuard[Mapping[str, Any]]:
    """Whether a value is a table, not a key."""
    # For most values, the type tells at once that they are not.
    return type(value) not in _PLAIN and isinstance(value, Mapping)


def without_none(tables: Mapping[str, Any]) -> dict[str, Any]:
    """A copy of nested tables without the keys whose value is None."""
    return {
        key: without_none(value) if is_mapping(value) else value
        for key, value in tables.items() if value is not None
    }


def gathered(overrides: Changes | Mapping[str, Any]) -> Mapping[str, Any] | Sequence[Any]:
    """The overrides as keys with values, or as texts."""
    if isinstance(overrides, Mapping):
        return overrides
    if isinstance(overrides, str):
        return (overrides,)
    if not isinstance(overrides, Iterable):
        raise ConfigurationError(
            "overrides: must be keys with values, or texts like table.key=value, got "
            f"{instance(overrides)}"
        )
    if isinstance(overrides, ItemsView) and {type(key) for key, _ in overrides} == {str}:
        return dict(overrides)
    items: tuple[Any, ...] = tuple(overrides)
    in_pairs = all(isinstance(i, tuple) and len(i) == 2 and isinstance(i[0], str) for i in items)
    return dict(items) if in_pairs else items


def pairs(overrides: Changes | Mapping[str, Any]) -> Iterator[tuple[tuple[str, ...], Any]]:
    """The overrides as paths of keys and their values."""
    yield from _pairs(gathered(overrides))


def _pairs(overrides: Mapping[str, Any] | Sequence[Any]) -> Iterator[tuple[tuple[str, ...], Any]]:
    if isinstance(overrides, Mapping):
        for key, value in overrides.items():
            path = _path(str(key))
            if is_mapping(value) and path[-1] != "parameters":
                for rest, inner in pairs(value):
                    yield path + rest, inner
            else:
                yield path, value
        return
    given: dict[tuple[str, ...], str] = {}
    for item in overrides:
        if not isinstance(item, str):
            raise ConfigurationError(
                f"override: must be a text like table.key=value, got {instance(item)}"
            )
        key, equals, text = item.partition("=")
        if not equals or not key.strip():
            raise ConfigurationError(
                f"override: must be table.key=value, got {quoted(item)}"
            )
        path, text = tuple(part.strip() for part in key.split(".")), text.strip()
        if given.setdefault(path, text) != text:
            raise ConfigurationError(
                f"override {shortened(key.strip())}: must be given once, got {quoted(given[path])} "
                f"and {quoted(text)}"
            )
        yield path, _toml_or_word(key, text)


@lru_cache(1024)
def _path(key: str) -> tuple[str, ...]:
    return tuple(key.split("."))


def _toml_or_word(key: str, text: str) -> Any:
    try:
        (value,) = tomllib.loads(f"value = {text}").values()
    except (ValueError, RecursionError):
        if re.fullmatch(r"[A-Za-z_./~\\][\w./~\\:-]*", text):
            return text
        raise ConfigurationError(
            f"override {shortened(key.strip())}: must be a value in TOML, got "
            f"{quoted(text)}"
        ) from None
    return value
