"""Keys that set other keys of their table: grades of sensors, the sea.

Their numbers, and where these are from, stand beside the equations that they are for.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any

from .. import COMPONENTS
from ..acoustics import clock
from ..platform import beaufort, gps, imu
from .keys import in_file_units

_PRESETS: Mapping[str, tuple[str, Callable[[Any], Mapping[str, float]], Collection[Any]]] = {
    "beaufort": ("platform", beaufort.sea_state, beaufort.LEVELS),
    "imu_grade": ("platform", imu.grade, imu.GRADES),
    "gps_grade": ("platform", gps.grade, gps.GRADES),
    "clock_grade": ("acoustics", clock.grade, clock.GRADES),
}
"""The table of each preset, its parameters in SI units for a value, and all values."""
PRESET_TABLES: Mapping[str, str] = {name: table for name, (table, _, _) in _PRESETS.items()}
"""Keys that set other keys of the same table, and that table."""
PRESET_VALUES: Mapping[str, Collection[Any]] = {name: all_ for name, (*_, all_) in _PRESETS.items()}
"""Keys that set other keys, and all values that they may have."""


def preset(name: str, value: Any) -> dict[str, Any]:
    """Keys that a preset sets in its table, and their values.

    Raises
    ------
    KeyError
        There is no such preset, or it has no such value.
    """
    table, values, _ = _PRESETS[name]
    known = COMPONENTS[table]
    return {known[k].key: in_file_units(known[k], v) for k, v in values(value).items()}


PRESETS: Mapping[str, frozenset[str]] = {
    name: frozenset(key for value in values for key in preset(name, value))
    for name, values in PRESET_VALUES.items()
}
"""Keys that set other keys of their table, and all keys they may set."""
