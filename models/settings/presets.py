"""Keys that set other keys of their table: grades of sensors, the sea.

Their numbers and the sources of these are next to the equations that use them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from importlib import import_module
from typing import Any

from .. import COMPONENTS
from ..preset import Preset
from .keys import in_file_units

MODULES = ("platform.beaufort", "platform.imu", "platform.gps", "acoustics.clock")
"""Modules of the models that declare a preset, in the order of the keys."""
_FOUND: Sequence[Preset] = [import_module(f"sblcosim.models.{it}").PRESET for it in MODULES]
DECLARED: Mapping[str, Preset] = {it.name: it for it in _FOUND}
"""Presets by the name of their key."""
PRESET_TABLES: Mapping[str, str] = {name: it.table for name, it in DECLARED.items()}
"""Keys that set other keys of the same table, and the name of that table."""
PRESET_VALUES: Mapping[str, Collection[Any]] = {name: it.values for name, it in DECLARED.items()}
"""Keys that set other keys, and all values they accept."""


def preset(name: str, value: Any) -> dict[str, Any]:
    """Keys and values that a preset sets in its table.

    Raises
    ------
    KeyError
        There is no such preset, or it does not accept the value.
    """
    it = DECLARED[name]
    known = COMPONENTS[it.table]
    return {known[k].key: in_file_units(known[k], v) for k, v in it.parameters(value).items()}


PRESETS: Mapping[str, frozenset[str]] = {
    name: frozenset(key for value in values for key in preset(name, value))
    for name, values in PRESET_VALUES.items()
}
"""Keys that set other keys of their table, and all keys they may set."""
