"""Recorded tracks of a scenario: from their files to the points that diver and boat follow."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from sblcosim.models import COMPONENTS
from sblcosim.models.declaration import Dimension
from sblcosim.models.platform.variables import BOAT_POINTS
from sblcosim.models.target.variables import TRACK_POINTS

from ..errors import ConfigurationError, ConfigurationWarning, shortened
from ..simulation.plans.alike import alike
from ..tracks.place import Floats, Origin
from ..tracks.resample import KeptPoints, fitted
from .schema import given_of, valid

if TYPE_CHECKING:
    from ..tracks.track import Recorded

FILE = "file"
"""The diver's trajectory for a recorded track."""
FILE_KEYS = ("track_file", "track_tolerance_m")
"""Keys that define where the points come from."""
POINT_KEYS = ("track_time_s", "track_m", "track_count")
"""Keys for the points themselves."""
TOLERANCE = 0.1
"""Default of ``track_tolerance_m``."""
ABOVE = 2.0
"""Height above water due to waves and instruments [m]; anything above causes a warning."""
LONG = 86_400.0
"""Duration [s] above which a warning is given: times may not be in seconds."""


@dataclass(frozen=True)
class Follower:
    """A component that can follow a recorded track.

    Attributes
    ----------
    who
        The one who follows it, in words.
    capacities
        Numbers of points for which the component is built.
    constant
        Constant of the build for the number of points.
    point_keys
        Keys for the points.
    parameters
        Parameters that only a track needs.
    """

    who: str
    constant: Dimension
    capacities: tuple[int, ...]
    point_keys: tuple[str, ...]
    parameters: tuple[str, ...]


FOLLOWERS: Mapping[str, Follower] = {
    "target": Follower(
        "diver", TRACK_POINTS, (TRACK_POINTS, 256, TRACK_POINTS.most), POINT_KEYS,
        ("track_count", "track_time", "track"),
    ),
    "platform": Follower(
        "boat", BOAT_POINTS, (BOAT_POINTS, 256, BOAT_POINTS.most),
        (*POINT_KEYS, "track_heading_deg"),
        ("track_count", "track_time", "track", "track_heading", "departure_time"),
    ),
}
"""Components that can follow a track, by their tables, in the order in which tracks are read."""


def follows(name: str, table: Any) -> bool:
    """Whether a component follows a track: its points, or the file of one."""
    if name == "target":
        return bool(table.trajectory == FILE)
    return bool(table.track_count or table.track_time_s or table.track_file is not None)


def capacity(name: str, table: Any) -> dict[str, int]:
    """The constant of the build of a component for the track of a scenario; empty: it has none."""
    it = FOLLOWERS.get(name)
    if it is None:
        return {}
    count = len(table.track_time_s or ()) if follows(name, table) else 0
    return {it.constant.name: next(c for c in it.capacities if c >= count)}


def origin_of(place: Any) -> Origin | None:
    """Position of a scenario's origin, if given."""
    if place.latitude_deg is None or place.longitude_deg is None:
        return None
    return Origin(place.latitude_deg, place.longitude_deg, place.height_m)


@dataclass(frozen=True, eq=False)
class _Placed:
    """A recorded track and its place.

    Attributes
    ----------
    points
        North, east, down [m].
    place
        Table ``[place]`` for a track in degrees; None: it stays unchanged.
    doubts
        Possible mistakes.
    """

    recorded: Recorded
    points: Floats
    place: Mapping[str, float] | None
    doubts: tuple[str, ...]


def followed(name: str, table: Any, place: Any) -> tuple[Mapping[str, Any], str] | None:
    """Tables with the points of a track instead of its file, and what was left out.

    Nothing made from the scenario then needs the file. None: there is no file to read.

    Parameters
    ----------
    name
        A key of `FOLLOWERS`.
    table, place
        Tables of the scenario, complete.

    Raises
    ------
    ConfigurationError
        The file cannot be read.
    TooFewError
        Its track does not fit.
    """
    if table.track_file is None or not follows(name, table):
        return None
    of = id(table), id(place)
    placed = alike("recorded", of, lambda: _placed(name, table, place), table, place)
    for line in placed.doubts:
        warnings.warn(line, ConfigurationWarning, stacklevel=2)
    return alike("followed", of, lambda: _fitted(name, table, place, placed), table, place)


def _placed(name: str, table: Any, place: Any) -> _Placed:
    from ..tracks.read import read
    from ..tracks.track import FARTHEST

    afloat = name == "platform"
    recorded = read(Path(table.track_file), depths=not afloat)
    origin = origin_of(place) or recorded.origin()
    points, at = recorded.points, None
    if recorded.geographic:
        assert origin is not None  # the track has one
        points = origin.local(points)
        at = {
            "latitude_deg": origin.latitude_deg, "longitude_deg": origin.longitude_deg,
            "height_m": origin.height_m,
        }  # fmt: skip
    for i, far in enumerate(abs(points).max(axis=1).tolist()):
        if far > FARTHEST:
            raise ConfigurationError(
                f"{recorded.where(i, 1)}: must be within {FARTHEST / 1e3:g} km of the origin "
                f"([place]), got {far / 1e3:,.0f} km"
            )
    return _Placed(recorded, points, at, tuple(_doubts(recorded, points, name)))


def _fitted(
    name: str, table: Any, place: Any, placed: _Placed
) -> tuple[Mapping[str, Any], str]:
    recorded = placed.recorded
    tolerance = TOLERANCE if table.track_tolerance_m is None else table.track_tolerance_m
    own = {key: value for key, value in given_of(table).items() if key not in FILE_KEYS}
    if name == "platform":
        turns = "mean_heading_deg" not in own
        if recorded.headings is not None and not turns:
            raise ConfigurationError(
                f"[platform] mean_heading_deg: must be left out, as {recorded.name} has headings "
                f"(heading_deg), got {own['mean_heading_deg']:g}"
            )
        kept, headings = _afloat(recorded, placed.points[:, :2], tolerance, turns)
        if turns:
            own["track_heading_deg"] = headings.tolist()
    else:
        kept = fitted(recorded.times, placed.points, tolerance)
    own["track_time_s"] = kept.times.tolist()
    own["track_m"] = kept.points.tolist()
    tables = {name: valid(type(table), own)}
    if placed.place is not None:
        tables["place"] = valid(type(place), placed.place)
    about = _about(FOLLOWERS[name].who, shortened(Path(table.track_file).name, 80), recorded, kept)
    return tables, about


def _afloat(
    recorded: Recorded, points: Floats, tolerance: float, turns: bool
) -> tuple[KeptPoints, Floats]:
    """The points that are kept of a boat's track, and its headings there [deg]."""
    from ..tracks.course import WITHIN, headed

    times = recorded.times
    if not turns:
        kept = fitted(times, points, tolerance, "platform")
        return kept, np.zeros(len(kept.times))
    # The heading counts as a third coordinate, on an arm that gives it a tolerance of its own.
    if recorded.headings is None:
        at, heading = headed(times, points, tolerance)
    else:
        at, heading = times, np.unwrap(np.radians(recorded.headings))
    place = [np.interp(at, times, points[:, axis]) for axis in (0, 1)]
    arm = tolerance / WITHIN
    found = fitted(at, np.stack([*place, arm * heading], axis=1), tolerance, "platform")
    added = int((~np.isin(found.times, times)).sum())
    kept = replace(found, points=found.points[:, :2], recorded=len(times), added=added)
    return kept, np.degrees(found.points[:, 2] / arm)


def _about(who: str, name: str, recorded: Recorded, kept: KeptPoints) -> str:
    """What was left out, in a sentence."""
    added = f" and {kept.added:,} on the straight lines between them" if kept.added else ""
    others = ""
    if recorded.left_out:
        which = shortened(", ".join(recorded.left_out), 240)
        begins = "it begins" if len(recorded.left_out) == 1 else "they begin"
        others = f"; left out: {which}, as {begins} before the previous track has ended"
    return (
        f"{name}: the {who} follows {len(kept.times) - kept.added:,} of {kept.recorded:,} points"
        f"{added}, never farther than {kept.deviation:.2g} m from the recorded track{others}"
    )


def _doubts(recorded: Recorded, points: Floats, name: str) -> Iterator[str]:
    """Possible mistakes in a track with points north, east, down [m]."""
    dry = [i for i, depth in enumerate(points[:, 2].tolist()) if depth < -ABOVE]
    if dry and name == "target":
        yield (
            f"{recorded.where(dry[0], 3)}: should be under water (a depth, or an elevation below "
            f"0), got up to {-points[:, 2].min():,.4g} m above it at {len(dry):,} of "
            f"{len(points):,} points"
        )
    most = COMPONENTS["target"]["speed"].max  # of a boat, too
    speeds = np.linalg.norm(np.diff(points, axis=0), axis=1) / np.diff(recorded.times)
    fast = np.flatnonzero(speeds > most)
    if len(fast):
        more = "" if len(fast) == 1 else f", up to {speeds.max():,.4g} m/s at {len(fast):,} points"
        yield (
            f"{recorded.where(int(fast[0]) + 1, 1)}: should be reached at {most:g} m/s at most, "
            f"got {speeds[fast[0]]:,.4g} m/s from the previous point{more}"
        )
    if recorded.times[-1] > LONG:
        yield (
            f"{recorded.where(len(recorded.times) - 1, 0)}: should be within a day of the first "
            f"point, got a track that lasts {recorded.times[-1] / 3600:,.4g} h; times are in "
            "seconds"
        )


def problem(name: str, table: Any) -> str | None:
    """The problem with the points of a track; None: none."""
    followed, foreign = follows(name, table), table.fmu is not None
    if table.track_file is not None and followed:
        for key in FOLLOWERS[name].point_keys:
            if key in table.model_fields_set:
                return f"[{name}] {key}: must be left out when there is a track_file"
        if foreign:
            return f"[{name}] track_file: must be left out with another FMU, fmu"
        return None
    return None if foreign or not followed else _problem_of_points(name, table)


def _problem_of_points(name: str, table: Any) -> str | None:
    times, width = table.track_time_s, 3 if name == "target" else 2
    count = len(table.track_m) // width
    if len(times) < 2:
        when = "trajectory is 'file'" if name == "target" else "there is a track"
        return (
            f"[{name}] track_file: must be the file of a track (or track_time_s and track_m its "
            f"points) when {when}, got {'one point' if len(times) else 'none'}"
        )
    if count != len(times):
        return f"[{name}] track_m: must have a row for each of {len(times)} times, got {count}"
    headings = len(getattr(table, "track_heading_deg", None) or ())
    if headings not in (0, count):
        return (
            f"[{name}] track_heading_deg: must have one for each of {count} times, got {headings}"
        )
    if not 2 <= table.track_count <= count:
        return f"[{name}] track_count: must be from 2 to {count}, got {table.track_count}"
    for i in range(1, len(times)):
        if not times[i] > times[i - 1]:
            return (
                f"[{name}] track_time_s[{i + 1}]: must be later than the previous point "
                f"({times[i - 1]!r}), got {times[i]!r}"
            )
    return None
