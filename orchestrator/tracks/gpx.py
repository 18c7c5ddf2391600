"""Tracks in GPX: consecutive ones are joined; the elevation is the negative depth."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import timedelta
from typing import TYPE_CHECKING, NoReturn
from xml.parsers import expat

import numpy as np

from ..errors import ConfigurationError, escaped, one_line, shortened
from .track import FARTHEST, LEAST, Recorded, Where

if TYPE_CHECKING:
    from gpxpy.gpx import GPXTrack, GPXTrackPoint

_TIME, _LATITUDE, _LONGITUDE, _ELEVATION = "time", "lat", "lon", "ele"
_ENCODING = re.compile(r"\A(\s*<\?xml[^>]*?)(\sencoding\s*=\s*(?:\"[^\"]*\"|'[^']*'))")
"""Encoding declaration; the decoded text has none."""
_ATTRIBUTES = (_TIME, _LATITUDE, _LONGITUDE, _ELEVATION)


def read(name: str, text: str, *, depths: bool = True) -> Recorded:
    """Read a track from GPX.

    Tracks that begin before the previous one has ended are left out (`Recorded.left_out`), such as
    the estimates in the ``path.gpx`` of a run.

    Parameters
    ----------
    depths
        Whether points must have an elevation; if not, they are at the surface whatever it is.

    Raises
    ------
    ConfigurationError
        It is not GPX, or a point lacks something; the message names line and column.
    """
    text = _ENCODING.sub(lambda found: found[1] + " " * len(found[2]), text)
    places = _places(name, text)
    tracks = _tracks(name, text, places)
    _check_zones(name, tracks, places)
    numbered, left_out = _in_turn(tracks)
    points = [point for _, point in numbered]

    def where(point: int, coordinate: int) -> str:
        number = numbered[point][0]
        line, column = places[number]
        what = f"trkpt {number + 1}, {_ATTRIBUTES[coordinate]}"
        return f"{name}, line {line}, column {column} ({what})"

    if len(points) < 2:
        at = where(0, 0) if points else f"{name}, line 1, column 1"
        raise ConfigurationError(
            f"{at}: must be followed by a second point, got no other" if points else
            f"{at}: must have a track with at least 2 points (trkpt), got none"
        )
    rows, times = np.empty((len(points), 3)), np.empty(len(points))
    for i, point in enumerate(points):
        for j, value, what in (
            (0, point.time, "a time"), (3, point.elevation, "an elevation, minus the depth [m]")
        ):
            if value is None and (depths or not j):
                raise ConfigurationError(
                    f"{where(i, j)}: must have {what} (<{_ATTRIBUTES[j]}>), got none that can be "
                    "read"
                )
        times[i] = _since(points, i, where)
        depth = -(point.elevation or 0.0) if depths else 0.0
        rows[i] = point.latitude, point.longitude, depth
        for j, most in ((1, 90.0), (2, 180.0), (3, FARTHEST)):
            if not -most <= rows[i, j - 1] <= most:
                value = rows[i, j - 1] * (-1 if j == 3 else 1)
                raise ConfigurationError(
                    f"{where(i, j)}: must be a number from {-most:g} to {most:g}, got {value:g}"
                )
    return Recorded(name, times, rows, True, where, tuple(left_out))


def _check_zones(
    name: str, tracks: Sequence[GPXTrack], places: Sequence[tuple[int, int]]
) -> None:
    """Refuse a mix of times with and without a time zone: the distance between them is unknown."""
    points = [p for track in tracks for segment in track.segments for p in segment.points]
    first: bool | None = None
    for point, (line, column) in zip(points, places, strict=True):
        if point.time is None:
            continue
        zoned = point.time.tzinfo is not None
        first = zoned if first is None else first
        if zoned != first:
            raise ConfigurationError(
                f"{name}, line {line}, column {column} (trkpt, time): must have a time "
                f"{'with' if first else 'without'} a time zone, as the points before, got "
                f"{point.time.isoformat()}"
            )


def _in_turn(tracks: Sequence[GPXTrack]) -> tuple[list[tuple[int, GPXTrackPoint]], list[str]]:
    """Points of consecutive tracks, with their numbers, and names of the other tracks."""
    kept: list[tuple[int, GPXTrackPoint]] = []
    left_out = []
    number = 0
    for i, track in enumerate(tracks, 1):
        points = [point for segment in track.segments for point in segment.points]
        numbered = [*enumerate(points, number)]
        number += len(points)
        begin, end = points[0].time if points else None, kept[-1][1].time if kept else None
        if begin is not None and end is not None and begin < end:
            left_out.append(shortened(escaped(track.name or f"trk {i}"), 80))
        else:
            kept += numbered
    return kept, left_out


def _tracks(name: str, text: str, places: Sequence[tuple[int, int]]) -> list[GPXTrack]:
    """All tracks."""
    import gpxpy
    from gpxpy.gpx import GPXException

    try:
        tracks = gpxpy.parse(text).tracks
    except (GPXException, ValueError, TypeError) as error:
        line, column = _mentioned(text, str(error)) or (places or [(1, 1)])[0]
        raise ConfigurationError(
            f"{name}, line {line}, column {column}: must be GPX, got {shortened(one_line(error))}"
        ) from None
    count = sum(len(segment.points) for track in tracks for segment in track.segments)
    if count != len(places):
        line, column = places[0]
        raise ConfigurationError(
            f"{name}, line {line}, column {column}: must have its {len(places)} points (trkpt) in "
            f"segments (trkseg) of tracks (trk), got {count} there"
        )
    return tracks


def _since(points: Sequence[GPXTrackPoint], i: int, where: Where) -> float:
    """Time of a point since the first one [s]."""
    first, before, time = points[0].time, points[max(i - 1, 0)].time, points[i].time
    assert first is not None
    assert before is not None
    assert time is not None
    if i and (time - before) / timedelta(seconds=1) < LEAST:
        raise ConfigurationError(
            f"{where(i, 0)}: must be later than the point before ({before.isoformat()}), got "
            f"{time.isoformat()}"
        )
    return (time - first) / timedelta(seconds=1)


def _places(name: str, text: str) -> list[tuple[int, int]]:
    """Line and column of each track point."""
    found: list[tuple[int, int]] = []
    parser = expat.ParserCreate()

    def begin(tag: str, attributes: dict[str, str]) -> None:
        if tag.rpartition(":")[2] == "trkpt":
            found.append((parser.CurrentLineNumber, parser.CurrentColumnNumber + 1))

    def declared(*_: object) -> NoReturn:
        raise ConfigurationError(
            f"{name}, line {parser.CurrentLineNumber}, column {parser.CurrentColumnNumber + 1}: "
            "must be GPX without a document type, got <!DOCTYPE"
        )

    parser.StartElementHandler = begin
    parser.StartDoctypeDeclHandler = declared
    try:
        parser.Parse(text.encode("utf-8", "replace"), True)
    except expat.ExpatError as error:
        raise ConfigurationError(
            f"{name}, line {error.lineno}, column {error.offset + 1}: must be XML, got "
            f"{expat.ErrorString(error.code)}"
        ) from None
    return found


def _mentioned(text: str, message: str) -> tuple[int, int] | None:
    """Line and column of the value that a message of the reader is about."""
    for word in re.findall(r"[^\s'\"()]+", message)[::-1]:
        found = re.search(rf"[>\"']{re.escape(word)}[<\"']", text)
        if found:
            line = text.count("\n", 0, found.start()) + 1
            return line, found.start() - text.rfind("\n", 0, found.start()) + 1
    return None
