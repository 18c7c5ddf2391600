"""Overrides of a scenario: paths of keys, and their values."""

from __future__ import annotations

import re
import tomllib
from collections.abc import ItemsView, Iterable, Iterator, Mapping, Sequence
from typing import Any, TypeGuard

from sblcosim.models.settings.presets import PRESET_TABLES, PRESETS

from ..errors import ConfigurationError, instance, quoted, shortened
from .keys import Overrides

Changes = Overrides | ItemsView[str, Any] | Sequence[str]
"""Keys with values, ``{"platform.arm_length_m": 0.4}``, which type checkers know; ``keys.items()``
of any dict; or texts, ``["platform.arm_length_m=0.4"]``, with values in TOML."""


def clear_for_presets(
    raw: Mapping[str, Any], batch: Iterable[tuple[tuple[str, ...], Any]]
) -> None:
    """Remove the keys that presets among the overrides replace: the later value wins."""
    said = dict(batch)
    for name, keys in PRESETS.items():
        table = raw.get(PRESET_TABLES[name])
        if said.get((PRESET_TABLES[name], name)) is not None and isinstance(table, dict):
            for key in keys:
                table.pop(key, None)


_PLAIN = {bool, int, float, str, tuple, list}


def is_mapping(value: Any) -> TypeGuard[Mapping[str, Any]]:
    """Whether a value is a table, not a key."""
    # Of most values the type tells at once that they are none.
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
    items: tuple[Any, ...] = tuple(overrides)
    in_pairs = all(isinstance(i, tuple) and len(i) == 2 and isinstance(i[0], str) for i in items)
    return dict(items) if in_pairs else items


def pairs(overrides: Changes | Mapping[str, Any]) -> Iterator[tuple[tuple[str, ...], Any]]:
    """The overrides as paths of keys and their values."""
    overrides = gathered(overrides)
    if isinstance(overrides, Mapping):
        for key, value in overrides.items():
            path = tuple(str(key).split("."))
            if is_mapping(value) and path[-1] != "parameters":
                for rest, inner in pairs(value):
                    yield path + rest, inner
            else:
                yield path, value
        return
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
        yield tuple(part.strip() for part in key.split(".")), _toml_or_word(key, text.strip())


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
