"""Tables with other columns than a log's, by a mapping."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ..data.estimates import Floats
from ..errors import ConfigurationError, nearest, quoted
from ..scenario.reading import shown
from ..tracks.place import Origin
from ..words.lists import counted, first_of
from ..words.shares import rough_percent
from . import folder, meta
from .axes import to_ned
from .checks import DECIMAL_COMMA, numbers
from .mapping import Mapped, MappedTable, keys_of, mapping_of, missing
from .raw import Raw

EXAMPLE = (
    "; for example, in meta.toml: [mapping.receptions] time_s = 'Time', beacon = 'Beacon', range_m "
    "= 'Dist' (docs/reference/logs.md)"
)
_NEAR_DEG = 1.0
"""The first position within this of the median is the origin [°]."""


def raw_of(place: Path, about: Mapping[str, Any], where: str) -> Raw:
    """The tables that a mapping names, unchecked.

    Parameters
    ----------
    place
        The file, or the folder with the files.
    about
        What the log says about itself, with the table ``[mapping]``.
    where
        Name of the file that says it, for messages.

    Raises
    ------
    ConfigurationError
        The mapping is wrong, or does not fit the files.
    """
    own = dict(about)
    mapping = mapping_of(own.pop("mapping", {}), where)
    name = place.resolve().stem if place.is_file() else place.resolve().name
    raw = Raw(name if Path(where).name == meta.FILE else Path(where).stem, own, where)
    sources = mapping.tables or (_guessed(place, raw),)
    base = place if place.is_dir() else place.parent
    _refuse_another(place, base, [source.file for source in sources], where)
    parts: dict[str, list[pd.DataFrame]] = {}
    for source in sources:
        if not source.file and not place.is_file():
            raise ConfigurationError(f"{source.where}.file: must be the name of a file, got none")
        path = base / source.file if source.file else place
        if not os.path.lexists(path):
            raise ConfigurationError(
                f"{source.where}.file: must be a file in the folder {quoted(str(base))}, got "
                f"{quoted(source.file)}"
                f"{nearest(source.file, sorted(os.listdir(base)))}"
            )
        known = replace(source, file=path.name)
        raw.files.setdefault(source.table, path.name)
        given = folder.table(path, source.table, raw, source.delimiter)
        if source.decimal == ",":
            given = given.map(_with_point)
        parts.setdefault(source.table, []).append(_converted(given, known, mapping, raw))
    raw.tables = {
        name: tables[0] if len(tables) == 1 else pd.concat(tables, ignore_index=True)
        for name, tables in parts.items()
    }
    located(raw)
    if mapping.beacons:
        places = to_ned(
            np.array(list(mapping.beacons.values()), float), *_axes(mapping)
        )
        stated = dict(zip(mapping.beacons, places.tolist(), strict=True))
        raw.meta["beacons"] = {**stated, **raw.meta.get("beacons", {})}
    return raw


def _refuse_another(place: Path, base: Path, names: Sequence[str], where: str) -> None:
    """Refuse a file that is read in vain, as the mapping names others."""
    own = os.path.realpath(place)
    if place.is_file() and not any(
        not name or os.path.realpath(base / name) == own for name in names
    ):
        raise ConfigurationError(
            f"{where}: mapping: must name the file that is read, {quoted(place.name)}, or none, "
            f"got {first_of([quoted(name) for name in names], 4)}; to read those, give their folder"
        )


def _axes(mapping: Mapped) -> tuple[str, float, Floats | None]:
    shift = None if mapping.shift is None else np.array(mapping.shift)
    return mapping.axes or "ned", mapping.turn_deg, shift


def _guessed(place: Path, raw: Raw) -> MappedTable:
    """The table of a file with a log's own columns."""
    if not place.is_file():
        raise ConfigurationError(
            f"{raw.where}: mapping: must name the files of {shown(place)}, got none"
        )
    columns = {*folder.table(place, "", Raw("")).columns}
    heard = "beacon" in columns and columns & {"range_m", "time_of_flight_s"}
    if heard:
        return MappedTable("receptions", raw.where)
    if {"n_m", "e_m", "d_m"} <= columns or {"latitude_deg", "longitude_deg"} <= columns:
        return MappedTable("fixes", raw.where)
    names = first_of([quoted(it) for it in sorted(columns - {"line"})], 12)
    raise ConfigurationError(
        f"{shown(place)}: must have a log's columns (beacon and range_m, or n_m, e_m and d_m, or "
        "latitude_deg and longitude_deg), or a mapping that says which of its columns they are, "
        f"got {names}{EXAMPLE}"
    )


def _converted(
    given: pd.DataFrame, source: MappedTable, mapping: Mapped, raw: Raw
) -> pd.DataFrame:
    """A table with the columns of a log."""
    wrong = list(missing(source, [c for c in given.columns if c != "line"]))
    if wrong:
        raise ConfigurationError(wrong[0])
    known = keys_of(source.table)
    chosen = {known[key][0] for key in source.columns}
    columns = {
        **{
            key: key for key in known
            if key in given and known[key][0] not in chosen and key not in source.columns
        },
        **source.columns,
    }
    table = pd.DataFrame({"line": given["line"], "file": source.file})
    for key, column in columns.items():
        name, factor = known[key]
        table[name] = given[column] if factor == 1 else numbers(given[column]) * factor
    for name, value in source.constants.items():
        table[name] = value
    if source.table == "fixes" and "device" not in table:
        table["device"] = Path(source.file).stem
    axes = _axes(mapping)
    for names, into in ((source.position, "{}_m"), (source.reported, "reported_{}_m")):
        if names:
            ned = to_ned(np.column_stack([numbers(given[name]) for name in names]), *axes)
            table = table.assign(**{into.format(axis): ned[:, i] for i, axis in enumerate("ned")})
    values = _values(given, source, columns)
    if source.wide:
        key, by_beacon = source.wide
        name, factor = known[key]
        parts = [
            table.assign(**{
                "beacon": beacon,
                name: given[column] if factor == 1 else numbers(given[column]) * factor,
            })[given[column].map(_filled).to_numpy(bool)]
            for beacon, column in by_beacon.items()
        ]
        table = pd.concat(parts).sort_index(kind="stable").reset_index(drop=True)
        values = [table[name]]
    return _noted(table, source, values, raw)


def _with_point(value: Any) -> Any:
    """A number with a decimal comma with a point instead; all else as it is."""
    if isinstance(value, str) and DECIMAL_COMMA.fullmatch(value):
        return value.replace(",", ".")
    return value


def _filled(value: Any) -> bool:
    return value is not None and value == value and str(value).strip() != ""


def _values(given: pd.DataFrame, source: MappedTable, columns: Mapping[str, str]) -> list[Any]:
    """The columns of what is measured."""
    names = [*source.position]
    ends = {"receptions": ("range", "time_of_flight"), "depth": ("depth",)}.get(
        source.table, ("n_", "e_", "d_", "latitude", "longitude")
    )
    names += [column for key, column in columns.items() if key.startswith(ends)]
    return [given[name] for name in dict.fromkeys(names)]


def _noted(
    table: pd.DataFrame, source: MappedTable, values: list[Any], raw: Raw
) -> pd.DataFrame:
    """The table without values that were read again, or that stand for nothing."""
    n = len(table)
    if not values or not n or not (source.repeats or source.no_data):
        return table
    found = np.column_stack([numbers(column) for column in values])
    nothing = np.zeros(n, bool)
    for number in source.no_data:
        nothing |= np.all(found == number, axis=1)
    again = np.zeros(n, bool)
    if source.repeats:
        of = table["beacon"] if "beacon" in table else pd.Series("", table.index)
        for rows in table.groupby(of, sort=False).indices.values():
            same = np.all(found[rows[1:]] == found[rows[:-1]], axis=1)
            again[rows[1:][same]] = True
        table["repeated"] = again
        raw.remarks.append(
            f"{source.file}: {again.sum():,} of {n:,} values ({rough_percent(again.mean())}) only "
            "repeat the one before"
        )
    if nothing.any():
        first = int(np.argmin(nothing)) if not nothing.all() else n
        words = " or ".join(f"{number:g}" for number in source.no_data)
        begin = f", {first:,} of them at the beginning" if first else ""
        raw.remarks.append(
            f"{source.file}: {words} stands for no data, {counted(int(nothing.sum()), 'time')}"
            f"{begin}"
        )
        raw.note(source.table, table[nothing & ~again], f"no data ({words})")
        table = table[~nothing | again].reset_index(drop=True)
    return table


def located(raw: Raw) -> None:
    """North, east, down from latitude and longitude; without an origin, the first one is it."""
    for name in ("truth", "fixes"):
        table = raw.tables.get(name)
        if table is None or not {"latitude_deg", "longitude_deg"} <= {*table.columns}:
            continue
        latitude, longitude = numbers(table["latitude_deg"]), numbers(table["longitude_deg"])
        given = np.isfinite(latitude) & np.isfinite(longitude)
        there = given & (np.abs(latitude) <= 90) & (np.abs(longitude) <= 180)
        there &= (latitude != 0) | (longitude != 0)
        stated = table["latitude_deg"].map(_filled) | table["longitude_deg"].map(_filled)
        bad = ~there & stated.to_numpy(bool)
        if bad.any():
            raw.note(name, table[bad], "no latitude and longitude")
        origin = _origin(raw, table, latitude, longitude, there)
        if origin is not None:
            down = _down(table, origin)
            rows = np.column_stack([latitude, longitude, down])[there]
            ned = np.full((len(table), 3), np.nan)
            ned[there] = origin.local(rows)
            for i, axis in enumerate("ned"):
                old = numbers(table[f"{axis}_m"]) if f"{axis}_m" in table else np.nan
                table[f"{axis}_m"] = np.where(there, ned[:, i], old)
        named = ["latitude_deg", "longitude_deg", "height_m", "depth_m"]
        table = table[~bad].drop(columns=[it for it in named if it in table])
        raw.tables[name] = table.reset_index(drop=True)


def _down(table: pd.DataFrame, origin: Origin) -> Floats:
    """Depth below the origin's height [m]; 0 where it is not given."""
    down = np.zeros(len(table))
    if "height_m" in table:
        down = np.nan_to_num(origin.height_m - numbers(table["height_m"]))
    if "depth_m" in table:
        depth = numbers(table["depth_m"])
        down = np.where(np.isfinite(depth), depth, down)
    return down


def _origin(
    raw: Raw, table: pd.DataFrame, latitude: Floats, longitude: Floats, there: Any
) -> Origin | None:
    """The origin that is given or, said in a remark, the first position."""
    given = raw.meta.get("origin")
    if given is None and there.any():
        off = np.maximum(
            np.abs(latitude - np.median(latitude[there])),
            np.abs(longitude - np.median(longitude[there])),
        )
        near = np.flatnonzero(there & (off < _NEAR_DEG))
        first = int(near[0]) if len(near) else int(np.flatnonzero(there)[0])
        given = {"latitude_deg": float(latitude[first]), "longitude_deg": float(longitude[first])}
        raw.meta["origin"] = given
        raw.remarks.append(
            f"the log has no origin: it is the first position, {latitude[first]:.6f}°, "
            f"{longitude[first]:.6f}° ({table['file'].iloc[first]}, line "
            f"{table['line'].iloc[first]})"
        )
    if not isinstance(given, Mapping):
        return None
    values = [given.get(key, 0.0) for key in ("latitude_deg", "longitude_deg", "height_m")]
    if not all(isinstance(value, int | float) and np.isfinite(value) for value in values):
        return None  # the check of what the log says about itself refuses it
    return Origin(*map(float, values))
