"""Tracks in tables of text (CSV): a line of names, then a line for each point."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator, Sequence
from datetime import datetime, timedelta
from decimal import Decimal, InvalidOperation
from difflib import get_close_matches
from typing import NoReturn

import numpy as np

from ..errors import ConfigurationError, quoted, shortened
from .place import Floats
from .track import FARTHEST, LEAST, Recorded, Where

LOCAL = ("north_m", "east_m", "down_m")
GEOGRAPHIC = ("latitude_deg", "longitude_deg", "depth_m")
SECONDS, CLOCK = "time_s", "time"
HEADING = "heading_deg"
_NAMES = (SECONDS, CLOCK, *LOCAL, *GEOGRAPHIC)
_BOUNDS = {
    **dict.fromkeys(LOCAL, FARTHEST),
    "latitude_deg": 90.0, "longitude_deg": 180.0, "depth_m": FARTHEST, HEADING: 360.0,
}
_BRIEF = {
    "t": SECONDS, "n": "north_m", "x": "north_m", "e": "east_m", "y": "east_m", "d": "down_m",
    "z": "down_m", "lat": "latitude_deg", "lon": "longitude_deg", "lng": "longitude_deg",
    "long": "longitude_deg", "depth": "down_m",
}
"""Other common names of the columns."""

_POINT = "; numbers must have a decimal point, no comma"

_Row = tuple[int, list[str]]
"""Number of a line, and its cells."""


def read(name: str, text: str, *, depths: bool = True) -> Recorded:
    """Read a track from a table.

    Parameters
    ----------
    name
        Name of the file, for messages.
    depths
        Whether there must be a column of depths, as for a diver. Without one, the points are at the
        surface. A boat may have a column of headings.

    Raises
    ------
    ConfigurationError
        A name or a number is wrong; the message names line and column.
    """
    lines = _rows(name, text)
    header = next(lines, None)
    if header is None:
        raise ConfigurationError(
            f"{name}, line 1, column 1: must be the names of the columns ({SECONDS}, "
            f"{', '.join(LOCAL)}), got nothing"
        )
    columns = _columns(name, *header, depths)
    known = [(line, [cells[column] for column in columns.values()])
             for line, cells in _full(name, lines, header[1])]
    places = [(line, list(columns.values())) for line, _ in known]

    def where(point: int, coordinate: int) -> str:
        line, at = places[point]
        return f"{name}, line {line}, column {at[coordinate] + 1} ({list(columns)[coordinate]})"

    if len(known) < 2:
        line = known[0][0] if known else header[0]
        time = next(iter(columns.values()))
        raise ConfigurationError(
            f"{name}, line {line}, column {time + 1} ({next(iter(columns))}): must be followed by "
            f"{'a second point' if known else 'at least 2 points'}, got the end of the file"
        )
    clock = SECONDS if SECONDS in columns else CLOCK
    times = _times(clock, [cells[0] for _, cells in known], where)
    numbers = np.array([
        [_number(cell, _BOUNDS[column], i, j, where)
         for j, (column, cell) in enumerate(zip(columns, cells, strict=True)) if j]
        for i, (_, cells) in enumerate(known)
    ])
    headings = numbers[:, -1] if HEADING in columns else None
    coordinates = [i for i, column in enumerate([*columns][1:]) if column != HEADING]
    points = np.zeros((len(known), 3))
    points[:, coordinates] = numbers[:, coordinates]
    return Recorded(name, times, points, GEOGRAPHIC[0] in columns, where, headings=headings)


def _rows(name: str, text: str) -> Iterator[_Row]:
    """The lines that are neither empty nor begin with #."""
    first = next((line for line in text.splitlines() if line.strip() and line[0] != "#"), "")
    delimiter = max(",;\t", key=first.count)
    reader = csv.reader(text.splitlines(keepends=True), delimiter=delimiter, strict=True)
    while True:
        try:
            cells = next(reader, None)
        except csv.Error as error:
            raise ConfigurationError(
                f"{name}, line {reader.line_num}, column 1: must be a line of a table, got {error}"
            ) from None
        if cells is None:
            return
        cells = [cell.strip() for cell in cells]
        if any(cells) and not cells[0].startswith("#"):
            yield reader.line_num, cells


def _columns(name: str, line: int, cells: Sequence[str], depths: bool) -> dict[str, int]:
    """Columns of the time and of the three coordinates.

    Without depths, the last may be missing, and one of headings follows if there is one.
    """

    def refuse(column: int, must: str, got: str) -> NoReturn:
        raise ConfigurationError(f"{name}, line {line}, column {column + 1}: must be {must}, {got}")

    found: dict[str, int] = {}
    for i, cell in enumerate(cells):
        if cell in found:
            refuse(i, "a name of its own", f"got {quoted(cell)} a second time")
        if cell in _NAMES or (cell == HEADING and not depths):
            found[cell] = i
    kinds = [kind for kind in (LOCAL, GEOGRAPHIC) if any(key in found for key in kind)]
    if len(kinds) > 1:
        begun = min(kinds, key=lambda kind: min(found[k] for k in kind if k in found))
        other = next(kind for kind in kinds if kind is not begun)
        stray = min((k for k in other if k in found), key=found.__getitem__)
        meant = begun[other.index(stray)]
        refuse(found[stray], f"one of {', '.join(begun)}, as the first of them says",
               f"got {quoted(stray)}; did you mean {meant!r}?")
    if SECONDS in found and CLOCK in found:
        refuse(max(found[SECONDS], found[CLOCK]), f"either {SECONDS} or {CLOCK}", "got both")
    clock = CLOCK if CLOCK in found else SECONDS
    kind = kinds[0] if kinds else _kind(cells)
    wanted = (clock, *kind)
    if not depths and kind[-1] not in found:
        wanted = wanted[:-1]
    missing = [key for key in wanted if key not in found]
    if all(map(_is_number, cells)):
        refuse(0, f"the names of the columns ({', '.join(wanted)})", f"got {quoted(cells[0])}")
    others = [(i, cell) for i, cell in enumerate(cells) if cell not in found]
    near = {key: (i, cell) for i, cell in reversed(others) if (key := _meant(cell, missing))}
    if near:
        names = [key for key in missing if key in near]
        what = "the name of a column" if len(names) == 1 else "names of columns"
        lack = f"{', '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing"
        refuse(
            near[names[0]][0], f"{what} of a track, as {lack}",
            f"got {', '.join(quoted(near[key][1]) for key in names)}; did you mean "
            f"{', '.join(map(repr, names))}?",
        )  # fmt: skip
    for key in missing:
        choice = f"{SECONDS} or {CLOCK}" if key == SECONDS else key
        if not kinds and key != SECONDS:
            choice = f"{', '.join(LOCAL)}, or {', '.join(GEOGRAPHIC)}"
        refuse(len(cells), choice, f"got no such column in {shortened(', '.join(cells))}")
    turned = [(i, cell) for i, cell in others if cell.lower().startswith("heading")]
    if turned and not depths and HEADING not in found:
        column, said = turned[0]
        refuse(column, f"{HEADING} for headings, from true north", f"got {quoted(said)}")
    return {key: found[key] for key in (*wanted, HEADING) if key in found}


def _kind(cells: Sequence[str]) -> Sequence[str]:
    """The coordinates that may be meant where none has its name."""
    return GEOGRAPHIC if any(_meant(cell, GEOGRAPHIC[:2]) for cell in cells) else LOCAL


def _meant(cell: str, names: Sequence[str]) -> str:
    """The name that may be meant; empty if none is close."""
    stem = re.sub(r"[\[(].*", "", cell).strip().lower()
    brief = _BRIEF.get(stem.partition("_")[0]) or _BRIEF.get(stem)
    if brief is not None and brief in names:
        return brief
    begins = [known for known in names if stem and known.partition("_")[0] == stem]
    return next(iter(begins or get_close_matches(stem, names, n=1)), "")


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _full(name: str, lines: Iterator[_Row], header: Sequence[str]) -> Iterator[_Row]:
    for line, cells in lines:
        if len(cells) != len(header):
            raise ConfigurationError(
                f"{name}, line {line}, column {min(len(cells), len(header)) + 1}: must have as "
                f"many columns as the names, {len(header)}, got {len(cells)}"
                f"{_commas(cells, header)}"
            )
        yield line, cells


def _commas(cells: Sequence[str], header: Sequence[str]) -> str:
    """The end of a message, if a line may have decimal commas."""
    numbers = all(map(_is_number, cells))
    return _POINT if numbers and len(header) < len(cells) <= 2 * len(header) else ""


def _hint(cell: str) -> str:
    return _POINT if "," in cell and _is_number(cell) else ""


def _number(cell: str, most: float, point: int, coordinate: int, where: Where) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not -most <= value <= most:
        raise ConfigurationError(
            f"{where(point, coordinate)}: must be a number from {-most:g} to {most:g}, got "
            f"{quoted(cell)}{_hint(cell)}"
        )
    return value


def _times(clock: str, cells: Sequence[str], where: Where) -> Floats:
    """Times since the first one [s], exactly rounded."""
    if clock == SECONDS:
        seconds = [_seconds(cell, i, where) for i, cell in enumerate(cells)]
        times = [float(time - seconds[0]) for time in seconds]
    else:
        instants = [_instant(cell, i, where) for i, cell in enumerate(cells)]
        zoned = instants[0].tzinfo is not None
        for i, time in enumerate(instants):
            if (time.tzinfo is not None) != zoned:
                raise ConfigurationError(
                    f"{where(i, 0)}: must {'have' if zoned else 'be without'} an offset from UTC, "
                    f"as the first time, got {quoted(cells[i])}"
                )
        times = [(time - instants[0]) / timedelta(seconds=1) for time in instants]
    for i in range(1, len(times)):
        if not times[i] - times[i - 1] >= LEAST:
            raise ConfigurationError(
                f"{where(i, 0)}: must be later than the point before ({cells[i - 1]}), got "
                f"{quoted(cells[i])}"
            )
    return np.array(times)


def _seconds(cell: str, point: int, where: Where) -> Decimal:
    try:
        value = Decimal(cell)
    except InvalidOperation:
        value = Decimal("nan")
    if not value.is_finite() or abs(value) > 10**12:
        hint = f"; times of a clock are in a column {CLOCK!r}" if _is_instant(cell) else _hint(cell)
        raise ConfigurationError(
            f"{where(point, 0)}: must be a number of seconds, got {quoted(cell)}{hint}"
        )
    return value


def _instant(cell: str, point: int, where: Where) -> datetime:
    if not _is_instant(cell):
        raise ConfigurationError(
            f"{where(point, 0)}: must be a time like 2024-05-01T10:00:00Z, got {quoted(cell)}; "
            f"seconds are in a column {SECONDS!r}"
        )
    return datetime.fromisoformat(cell)


def _is_instant(cell: str) -> bool:
    try:
        datetime.fromisoformat(cell)
    except ValueError:
        return False
    return "-" in cell
