"""A commented scenario file to start from, generated from the declarations."""

from __future__ import annotations

import textwrap
import warnings
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

from sblcosim.models import COMPONENTS
from sblcosim.models.declaration import Variable
from sblcosim.models.settings.keys import default
from sblcosim.models.settings.presets import PRESET_VALUES, PRESETS

from ..errors import ConfigurationError
from . import effects
from .explained import explained
from .file_schema import DIRECTIVE, TITLES
from .likes import LIKES, USUAL
from .overrides import Changes
from .reading import relative
from .scenario import Scenario, load
from .schema import COMMON, FILES, TRUE, Table, rows, toml
from .tracks import FOLLOWERS, TOLERANCE

_EXAMPLES: Mapping[str, Any] = {
    "fmu": "other.fmu",
    "fmi": 2,
    "parameters": {"gain": 2.0},
    "prior": TRUE,
    "beaufort": 2,
    "packet_bits": 256,
    "temperature_C": 15.0,
    "salinity": 35.0,
    "sample_depth_m": 5.0,
    "profile_temperature_C": (),
    "profile_salinity": (),
    "packet_duration_s": 0.05,
    "guard_interval_s": 0.01,
    "reach_m": 100.0,
    "waypoint_m": ((0.0, 10.0, 5.0), (10.0, 10.0, 5.0)),
    "track_file": "dive.csv",
    "track_tolerance_m": TOLERANCE,
    "track_time_s": (0.0, 60.0),
    "track_m": ((0.0, 10.0, 5.0), (10.0, 10.0, 5.0)),
    "track_heading_deg": (0.0, 90.0),
    "latitude_deg": 42.5,
    "longitude_deg": 14.2,
}
"""Example values for keys without a default."""


Tables = dict[str, dict[str, Any]]
"""Keys by table."""


def starter(
    name: str,
    source: str | Path | Mapping[str, Any] | Scenario | None = None,
    changes: Changes = (),
    *,
    asked: Collection[str] = (),
    short: bool = False,
    folder: Path | None = None,
) -> str:
    """Text of a new scenario file: keys with descriptions and units.

    Parameters
    ----------
    name
        Name of the new scenario: that of its file, so that the file need not say it, and a copy has
        its own.
    source
        Scenario whose given keys are used, if they have an effect; None: a simple one.
    changes
        Keys to change in it.
    asked
        Keys that are in use even with their defaults.
    short
        Only the keys in use that are asked for or make a difference. Otherwise all keys, the unused
        ones commented out.
    folder
        Folder of the future file, to which paths become relative.

    Raises
    ------
    ConfigurationError
        `source` cannot be loaded.
    """
    scenario = _without_idle(
        load(LIKES[USUAL].source if source is None else source, changes), asked
    )
    tables = _in_use(scenario, asked)
    if short:
        tables = _needed(scenario, tables, asked)
    if folder is not None:
        tables = {table: _relative(keys, folder) for table, keys in tables.items()}
    lines = [
        DIRECTIVE,
        "# A scenario for sblcosim. Keys end with their unit; angles are in degrees.",
        f"# {_REST[short]}",
    ]
    parts = [[*_head(name, scenario, short)]]
    for table, title in TITLES.items():
        keys = [*_keys(scenario, table, tables[table], short)]
        parts.append([f"# {title}.", f"[{table}]", *keys] if keys else [])
    return "\n\n".join("\n".join(part) for part in (lines, *parts) if part) + "\n"


_REST = {
    True: "Keys that are left out have their defaults; 'sblcosim new --all' writes all of them.",
    False: "What is commented out shows what holds without it, or an example.",
}


def _without_idle(scenario: Scenario, asked: Collection[str]) -> Scenario:
    """The scenario without the given keys that have no effect, except those that are asked for."""
    given = {*effects.given(scenario)}
    idle = [".".join(key) for key in scenario.idle() if key in given]
    return scenario.override({key: None for key in idle if key not in asked}.items())


def _in_use(scenario: Scenario, asked: Collection[str]) -> Tables:
    """The keys that are given or asked for; a recorded track is its file if that says all."""
    given = scenario.given()
    tables: Tables = {table: dict(given.get(table, {})) for table in TITLES}
    for table, key in (it.split(".") for it in asked):
        tables[table].setdefault(key, getattr(getattr(scenario, table), key))
    if scenario.recorded:
        files = {
            name: {k: v for k, v in tables[name].items() if k not in FOLLOWERS[name].point_keys}
            | {**keys} for name, keys in scenario.recorded.items()
        }
        for place in ({}, tables["place"]):
            as_file = {**tables, **files, "place": place}
            if _is(scenario, as_file):
                return as_file
    return tables


def _needed(scenario: Scenario, tables: Tables, asked: Collection[str]) -> Tables:
    """Tables without the keys that make no difference; those that are asked for stay."""
    for table, keys in tables.items():
        for key in [key for key in keys if f"{table}.{key}" not in asked]:
            fewer = {**tables, table: {k: v for k, v in tables[table].items() if k != key}}
            if _is(scenario, fewer):
                tables = fewer
    return tables


def _is(scenario: Scenario, tables: Tables) -> bool:
    """Whether tables alone are those of a scenario."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            loaded = load({**_top(scenario), **tables})
    except ConfigurationError:
        return False
    return loaded.model_dump() == scenario.model_dump()


def _relative(keys: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The keys of a table, with paths relative to a folder."""
    return {
        key: relative(Path(value), folder) if key in FILES else value for key, value in keys.items()
    }


def _top(scenario: Scenario) -> dict[str, Any]:
    """The keys that are in no table."""
    return {key: getattr(scenario, key) for key in Scenario.model_fields if key not in TITLES}


def _head(name: str, scenario: Scenario, short: bool) -> Iterator[str]:
    """The lines of the keys that are in no table."""
    about = {
        "name": "that of the file; also of the folder of results",
        "title": "above tables and figures",
        "seed": "of all random numbers",
        "fmi": "version of the standard that the components follow: 2 or 3",
    }
    for key, value in (_top(scenario) | {"name": name}).items():
        unused = "# " if key == "name" else ""
        if not short or (not unused and value != Scenario.model_fields[key].default):
            yield f"{unused}{key} = {toml(value)}  # {about[key]}"


def _keys(scenario: Scenario, name: str, in_use: Mapping[str, Any], short: bool) -> Iterator[str]:
    """The lines of a table."""
    table = getattr(scenario, name)
    fields = type(table).model_fields
    for key in sorted(fields, key=lambda key: key in COMMON):
        if short and key not in in_use:
            continue
        variable = table.variables.get(key)
        value = getattr(table, key) if in_use.get(key) is None else in_use[key]
        if value is None or value == ():
            value = _example(key, fields[key].annotation, variable)
        text = f"{explained(name, key)}.{_governed(table, key, in_use)}"
        yield from textwrap.wrap(text, 98, initial_indent="# ", subsequent_indent="#   ")
        yield f"{'' if key in in_use else '# '}{key} = {toml(rows(variable, value))}"


def _governed(table: Table, key: str, given: Collection[str]) -> str:
    """The keys that a preset sets, in words; empty for any other key."""
    keys = [name for name in table.variables if name in PRESETS.get(key, ())]
    if not keys:
        return ""
    own = [name for name in keys if name in given]
    kept = f": {', '.join(own)}" if own else ""
    return f" It sets {', '.join(keys)}; of these, what is given wins{kept}."


def _example(key: str, annotation: Any, variable: Variable | None) -> Any:
    if key in _EXAMPLES:
        value = _EXAMPLES[key]
        if variable is None or len(variable.shape) != 2:
            return value
        return tuple(x for row in value for x in row[: variable.shape[1]])
    if variable is not None:
        component = next(c for c in COMPONENTS.values() if variable in c.variables)
        return default(component, variable)
    if key in PRESET_VALUES:
        return next(iter(PRESET_VALUES[key]))
    # For an optional choice, take its first name.
    return annotation.__args__[0].__args__[0]
