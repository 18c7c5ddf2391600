"""A commented scenario file to start from, generated from the declarations."""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from sblcosim.models import COMPONENTS
from sblcosim.models.declaration import Variable
from sblcosim.models.settings.keys import default, in_file_units
from sblcosim.models.settings.presets import PRESET_VALUES, PRESETS

from .arrays import most
from .file_schema import DIRECTIVE, TITLES
from .overrides import Changes
from .scenario import load
from .schema import COMMON, PATH, TRUE, Table, rows, toml
from .tracks import TOLERANCE

_IN_USE: Mapping[str, Any] = {
    "time": {"sampling_time_s": 0.1, "ekf_ratio": 1, "duration_s": PATH},
    "target": {
        "trajectory": "semicircle",
        "speed_m_s": 0.5,
        "radius_m": 15.0,
        "depth_start_m": 5.0,
        "depth_end_m": 5.0,
        "depth_std_m": 0.05,
    },
    "platform": {
        "beaufort": 2,
        "arm_length_m": 3.0,
        "gps_horizontal_std_m": 0.1,
        "gps_horizontal_markov_std_m": 1.0,
        "imu_tilt_std_deg": 1.0,
        "imu_heading_std_deg": 1.0,
    },
    "acoustics": {"range_std_m": 0.1, "loss_probability": 0.1},
    "receiver": {"type": "coupled"},
}
_EXAMPLES: Mapping[str, Any] = {
    "fmu": "other.fmu",
    "fmi": 2,
    "parameters": {"gain": 2.0},
    "prior": TRUE,
    "beaufort": 2,
    "packet_bits": 256,
    "waypoint_m": ((0.0, 10.0, 5.0), (10.0, 10.0, 5.0)),
    "track_file": "dive.csv",
    "track_tolerance_m": TOLERANCE,
    "track_time_s": (0.0, 60.0),
    "track_m": ((0.0, 10.0, 5.0), (10.0, 10.0, 5.0)),
    "latitude_deg": 42.5,
    "longitude_deg": 14.2,
}
"""Example values for keys without a default."""


def starter(
    name: str, source: str | Path | Mapping[str, Any] | None = None, changes: Changes = ()
) -> str:
    """Text of a new scenario file: all keys with descriptions, the unused ones commented out.

    Parameters
    ----------
    name
        Name of the new scenario: that of its file, so that the file need not say it, and a copy has
        its own.
    source
        Scenario whose given keys are used; None: a simple one.
    changes
        Keys to change in it.

    Raises
    ------
    ConfigurationError
        `source` cannot be loaded.
    """
    scenario = load(_IN_USE if source is None else source, changes)
    given = scenario.given()
    lines = [
        DIRECTIVE,
        "# A scenario for sblcosim. Keys end with their unit; angles are in degrees.",
        "# What is commented out shows what holds without it, or an example.",
        "",
        f"# name = {toml(name)}  # that of the file; also of the folder of results",
        f"title = {toml(scenario.title)}",
        f"seed = {scenario.seed}  # of all random numbers",
        f"fmi = {scenario.fmi}  # version of the standard that the components follow: 2 or 3",
    ]
    for table_name, title in TITLES.items():
        table = getattr(scenario, table_name)
        fields = type(table).model_fields
        in_use = given.get(table_name, {})
        lines += ["", "", f"# {title}.", f"[{table_name}]"]
        for key in sorted(fields, key=lambda key: key in COMMON):
            variable = table.variables.get(key)
            value = getattr(table, key) if in_use.get(key) is None else in_use[key]
            if value is None or value == ():
                value = _example(key, fields[key].annotation, variable)
            text = f"{fields[key].description}{_range(variable)}.{_governed(table, key, in_use)}"
            lines += textwrap.wrap(text, 98, initial_indent="# ", subsequent_indent="#   ")
            lines.append(f"{'' if key in in_use else '# '}{key} = {toml(rows(variable, value))}")
    return "\n".join(lines) + "\n"


def _governed(table: Table, key: str, given: Collection[str]) -> str:
    """The keys that a preset sets, in words; empty for any other key."""
    keys = [name for name in table.variables if name in PRESETS.get(key, ())]
    if not keys:
        return ""
    own = [name for name in keys if name in given]
    kept = f": {', '.join(own)}" if own else ""
    return f" It sets {', '.join(keys)}; of these, what is given wins{kept}."


def _range(variable: Variable | None) -> str:
    """Choices or bounds, in words."""
    if variable is None:
        return ""
    if variable.choices is not None:
        return ": " + ", ".join(variable.choices.values())
    if variable.type == "Boolean":
        return ""
    low, high = (
        None if bound is None else f"{in_file_units(variable, bound):g}"
        for bound in (variable.min, most(variable.max))
    )
    if high is None:
        return "" if low is None else f"; at least {low}"
    return f"; at most {high}" if low is None else f"; {low} to {high}"


def _example(key: str, annotation: Any, variable: Variable | None) -> Any:
    if key in _EXAMPLES:
        value = _EXAMPLES[key]
        nested = variable is not None and len(variable.shape) == 2
        return tuple(x for row in value for x in row) if nested else value
    if variable is not None:
        component = next(c for c in COMPONENTS.values() if variable in c.variables)
        return default(component, variable)
    if key in PRESET_VALUES:
        return next(iter(PRESET_VALUES[key]))
    # For an optional choice, take its first name.
    return annotation.__args__[0].__args__[0]
