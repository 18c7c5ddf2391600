"""The mapping of another format to the columns of a log: which column is what, and in which axes.

A mapping is the table ``[mapping]`` in the file that says what a log says about itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import isfinite, pi
from typing import Any

from ..errors import ConfigurationError, nearest, quoted, shortened
from ..words.lists import first_of
from .axes import AXES
from .columns import FARTHEST, KINDS, TABLES
from .times import NAMES as TIMES
from .times import UNITS as TIME_UNITS

UNITS: Mapping[str, Mapping[str, float]] = {
    "m": {"m": 1.0, "km": 1e3, "cm": 1e-2, "mm": 1e-3, "ft": 0.3048},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
    "rad": {"rad": 1.0, "deg": pi / 180},
}
"""Other units that a source may have, by the unit of the column: the end of a key names it."""
PSIMSSB = ("x-starboard", "x-forward")
"""What the first coordinate of a sentence PSIMSSB with ``C,H`` may be."""
_WIDE = ("range_m", "time_of_flight_s")
"""Columns that a source may have for each beacon."""
OPTIONS = ("file", "delimiter", "decimal", "no_data", "repeats")
"""Keys of a source that are no columns."""


@dataclass(frozen=True)
class MappedTable:
    """A file, and which of its columns are which of a log's.

    Attributes
    ----------
    table
        Name of the log's table.
    decimal
        Mark before the decimals of numbers: a point or a comma.
    columns
        The source's column by the log's; a key may end in another unit of `UNITS`.
    wide
        The source's column of ranges by beacon, if each beacon has one, and the key with its unit.
    position, reported
        Columns of a position in the axes of the source.
    constants
        Values of columns that the source lacks.
    no_data
        Numbers that stand for nothing.
    repeats
        Whether a value that equals the one before was only read again.
    """

    table: str
    where: str
    file: str = ""
    delimiter: str = ""
    decimal: str = "."
    columns: Mapping[str, str] = field(default_factory=dict)
    wide: tuple[str, Mapping[str, str]] | None = None
    position: tuple[str, ...] = ()
    reported: tuple[str, ...] = ()
    constants: Mapping[str, str] = field(default_factory=dict)
    no_data: tuple[float, ...] = ()
    repeats: bool = False


@dataclass(frozen=True)
class Mapped:
    """A whole mapping.

    Attributes
    ----------
    tables
        Those that are named; a file that is read alone may have a log's columns.
    axes, turn_deg, shift
        See `sblcosim.logs.axes.to_ned`.
    beacons
        Positions of fixed beacons in these axes.
    psimssb
        One of `PSIMSSB`.
    """

    tables: tuple[MappedTable, ...] = ()
    axes: str = ""
    turn_deg: float = 0.0
    shift: tuple[float, ...] | None = None
    beacons: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    psimssb: str = ""


def mapping_of(given: Any, where: str) -> Mapped:
    """Check the table ``[mapping]``.

    Raises
    ------
    ConfigurationError
        A key or value is wrong; the message names the file and the key.
    """
    tables = _table(given, where, "mapping")
    known = (*TABLES, "axes", "turn_deg", "shift_m", "beacons", "psimssb")
    for key in tables:
        if key not in known:
            raise ConfigurationError(
                f"{where}: there is no key mapping.{shortened(key)}{nearest(key, known)}"
            )
    sources = []
    for name in TABLES:
        found = tables.get(name, ())
        several = found if isinstance(found, list | tuple) else (found,)
        sources += [_source(one, name, where) for one in several]
    shift = tables.get("shift_m")
    beacons = _table(tables.get("beacons", {}), where, "mapping.beacons")
    return Mapped(
        tables=tuple(sources),
        axes=_choice(tables.get("axes", ""), AXES, f"{where}: mapping.axes"),
        turn_deg=_number(tables.get("turn_deg", 0.0), f"{where}: mapping.turn_deg", 360.0),
        shift=None if shift is None else _triple(shift, f"{where}: mapping.shift_m"),
        beacons={
            name: _triple(place, f"{where}: mapping.beacons.{shortened(name)}")
            for name, place in beacons.items()
        },
        psimssb=_choice(tables.get("psimssb", ""), PSIMSSB, f"{where}: mapping.psimssb"),
    )


def keys_of(table: str) -> dict[str, tuple[str, float]]:
    """Keys that name a column of a source, with the column of a log and the factor to its unit."""
    keys = {}
    for column in TABLES[table].names:
        if column == "line" or column in TIMES:
            continue
        stem, _, unit = column.rpartition("_")
        for other, factor in UNITS.get(unit, {}).items():
            keys[f"{stem}_{other}"] = column, factor
        keys[column] = column, 1.0
    for name in _times(table):
        keys[name] = name, 1.0
    if table in ("truth", "fixes"):
        for name in ("latitude_deg", "longitude_deg"):
            keys[name] = name, 1.0
        for stem in ("height", "depth"):
            for unit, factor in UNITS["m"].items():
                keys[f"{stem}_{unit}"] = f"{stem}_m", factor
    return keys


def _times(table: str) -> list[str]:
    return [it for it in TIMES if table == "receptions" or it.partition("_")[0] == "time"]


def _source(given: Any, table: str, where: str) -> MappedTable:
    at = f"mapping.{table}"
    content = dict(_table(given, where, at))
    lists = {"receptions": "reported", "truth": "position", "fixes": "position"}.get(table)
    name_key = {"receptions": "beacon_name", "fixes": "device_name"}.get(table)
    columns = keys_of(table)
    known = (*columns, *OPTIONS, *(it for it in (lists, name_key) if it))
    taken: dict[str, Any] = {"columns": {}, "constants": {}}
    for key, value in content.items():
        here = f"{where}: {at}.{shortened(key)}"
        if key not in known:
            raise ConfigurationError(
                f"{where}: there is no key {at}.{shortened(key)}"
                f"{_units(key, columns) or nearest(key, known)}"
            )
        if key == lists:
            taken[key] = _names(value, here)
        elif value and isinstance(value, dict) and columns.get(key, ("",))[0] in _WIDE:
            wide = {str(b): _name(c, f"{here}.{shortened(b)}") for b, c in value.items()}
            taken["wide"] = key, wide
        elif key == name_key:
            taken["constants"][key.partition("_")[0]] = _name(value, here)
        elif key == "kind" and value in KINDS:
            taken["constants"]["kind"] = value
        elif key == "no_data":
            several = value if isinstance(value, list) else [value]
            taken[key] = tuple(_number(it, here, FARTHEST) for it in several)
        elif key == "repeats":
            if not isinstance(value, bool):
                raise ConfigurationError(f"{here}: must be true or false, got {quoted(value)}")
            taken[key] = value
        elif key == "decimal":
            taken[key] = _choice(value, (".", ","), here) or "."
        elif key in OPTIONS:
            taken[key] = _name(value, here)
        else:
            taken["columns"][key] = _name(value, here)
    if len(taken.get("delimiter", ",")) != 1 or taken.get("delimiter") in ("\n", "\r", '"'):
        raise ConfigurationError(
            f"{where}: {at}.delimiter: must be one character, got {quoted(taken['delimiter'])}"
        )
    _refuse_doubles(taken["columns"], columns, f"{where}: {at}")
    return MappedTable(table=table, where=f"{where}: {at}", **taken)


def _units(key: str, columns: Mapping[str, tuple[str, float]]) -> str:
    """The units of a column, if a key has another one."""
    stem = key.rpartition("_")[0]
    units = [it.rpartition("_")[2] for it in columns if stem and it.rpartition("_")[0] == stem]
    known = {unit for several in (*UNITS.values(), TIME_UNITS) for unit in several}
    if not {*units} & known or key.rpartition("_")[2] in known:
        return ""
    return f"; {stem} must be in {' or '.join(dict.fromkeys(units))}, as in {stem}_{units[0]}"


def _refuse_doubles(
    given: Mapping[str, str], columns: Mapping[str, tuple[str, float]], here: str
) -> None:
    """Refuse two keys for the same, ``range_m`` and ``range_km``, or two times."""
    seen: dict[str, str] = {}
    for key in given:
        same = columns[key][0]
        same = same.partition("_")[0] if same in TIMES else same
        if same in seen:
            raise ConfigurationError(f"{here}: must have {seen[same]} or {key}, got both")
        seen[same] = key


def _table(value: Any, where: str, name: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ConfigurationError(
            f"{where}: {name}: must be a table, got {shortened(repr(value))}"
        )
    return value


def _name(value: Any, here: str) -> str:
    if not isinstance(value, str) or not value:
        raise ConfigurationError(f"{here}: must be a name, got {shortened(repr(value))}")
    return value


def _names(value: Any, here: str) -> tuple[str, ...]:
    if not isinstance(value, list | tuple) or len(value) not in (2, 3):
        raise ConfigurationError(
            f"{here}: must be the names of two or three columns, got {shortened(repr(value))}"
        )
    return tuple(_name(it, here) for it in value)


def _number(value: Any, here: str, most: float) -> float:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not isfinite(value) or abs(value) > most:
        raise ConfigurationError(
            f"{here}: must be a number from {-most:,.0f} to {most:,.0f}, got "
            f"{shortened(repr(value))}"
        )
    return float(value)


def _triple(value: Any, here: str) -> tuple[float, ...]:
    if not isinstance(value, list | tuple) or len(value) not in (2, 3):
        raise ConfigurationError(
            f"{here}: must be two or three numbers, got {shortened(repr(value))}"
        )
    numbers = tuple(_number(it, here, 100 * FARTHEST) for it in value)
    return (*numbers, 0.0) if len(numbers) == 2 else numbers


def _choice(value: Any, choices: Any, here: str) -> str:
    if value == "" or value in tuple(choices):
        return str(value)
    close = nearest(value, choices) if isinstance(value, str) else ""
    words = " or ".join(map(repr, choices))
    raise ConfigurationError(f"{here}: must be {words}, got {shortened(repr(value))}{close}")


def missing(source: MappedTable, columns: list[str]) -> Iterator[str]:
    """A line for each column that a mapping names and a file lacks."""
    named = [*source.columns.items(), *(("position", it) for it in source.position)]
    named += [("reported", it) for it in source.reported]
    if source.wide:
        named += [(f"{source.wide[0]}.{b}", column) for b, column in source.wide[1].items()]
    for key, column in named:
        if column not in columns:
            yield (
                f"{source.where}.{key}: must be a column of {source.file}, got {quoted(column)}; "
                f"it has {first_of([quoted(it) for it in columns], 12)}"
                f"{nearest(column, columns)}"
            )
