"""The recorded track of a scenario: from its file to the points that the Target follows."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from sblcosim.models import COMPONENTS
from sblcosim.models.target.variables import TRACK_POINTS

from ..errors import ConfigurationError, ConfigurationWarning, shortened
from ..simulation.plans.alike import alike
from ..tracks.place import Floats, Origin
from .schema import given_of, valid

if TYPE_CHECKING:
    from ..tracks.resample import KeptPoints
    from ..tracks.track import Recorded

FILE = "file"
"""The trajectory for a recorded track."""
FILE_KEYS = ("track_file", "track_tolerance_m")
"""Keys of ``[target]`` that define where the points come from."""
POINT_KEYS = ("track_time_s", "track_m", "track_count")
"""Keys of ``[target]`` for the points themselves."""
PARAMETERS = ("track_count", "track_time", "track")
"""Parameters of the Target that only a track needs."""
TOLERANCE = 0.1
"""Default of ``track_tolerance_m``."""
ABOVE = 2.0
"""Height above water due to waves and instruments [m]; anything above causes a warning."""
LONG = 86_400.0
"""Duration [s] above which a warning is given: times may not be in seconds."""
CAPACITIES = (TRACK_POINTS, 256, TRACK_POINTS.most)
"""Numbers of points for which Targets are built."""


def capacity(target: Any) -> dict[str, int]:
    """The constant of the build of the Target for a scenario's track."""
    count = len(target.track_time_s or ()) if target.trajectory == FILE else 0
    return {TRACK_POINTS.name: next(c for c in CAPACITIES if c >= count)}


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


def followed(target: Any, place: Any) -> tuple[Mapping[str, Any], str] | None:
    """Tables with the points of the track instead of its file, and what was left out.

    Nothing made from the scenario then needs the file. None: there is no file to read.

    Parameters
    ----------
    target, place
        Tables of the scenario, complete.

    Raises
    ------
    ConfigurationError
        The file cannot be read.
    TooFewError
        Its track does not fit.
    """
    if target.track_file is None or target.trajectory != FILE:
        return None
    of = id(target), id(place)
    placed = alike("recorded", of, lambda: _placed(target, place), target, place)
    for line in placed.doubts:
        warnings.warn(line, ConfigurationWarning, stacklevel=2)
    return alike("followed", of, lambda: _fitted(target, place, placed), target, place)


def _placed(target: Any, place: Any) -> _Placed:
    from ..tracks.read import read
    from ..tracks.track import FARTHEST

    recorded = read(Path(target.track_file))
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
    return _Placed(recorded, points, at, tuple(_doubts(recorded, points)))


def _fitted(target: Any, place: Any, placed: _Placed) -> tuple[Mapping[str, Any], str]:
    from ..tracks.resample import fitted

    recorded = placed.recorded
    tolerance = TOLERANCE if target.track_tolerance_m is None else target.track_tolerance_m
    kept = fitted(recorded.times, placed.points, tolerance)
    own = {key: value for key, value in given_of(target).items() if key not in FILE_KEYS}
    own["track_time_s"] = kept.times.tolist()
    own["track_m"] = kept.points.tolist()
    tables = {"target": valid(type(target), own)}
    if placed.place is not None:
        tables["place"] = valid(type(place), placed.place)
    return tables, _about(shortened(Path(target.track_file).name, 80), recorded, kept)


def _about(name: str, recorded: Recorded, kept: KeptPoints) -> str:
    """What was left out, in a sentence."""
    added = f" and {kept.added:,} on the straight lines between them" if kept.added else ""
    others = ""
    if recorded.left_out:
        which = shortened(", ".join(recorded.left_out), 240)
        begins = "it begins" if len(recorded.left_out) == 1 else "they begin"
        others = f"; left out: {which}, as {begins} before the previous track has ended"
    return (
        f"{name}: the diver follows {len(kept.times) - kept.added:,} of {kept.recorded:,} points"
        f"{added}, never farther than {kept.deviation:.2g} m from the recorded track{others}"
    )


def _doubts(recorded: Recorded, points: Floats) -> Iterator[str]:
    """Possible mistakes in a track with points north, east, down [m]."""
    dry = [i for i, depth in enumerate(points[:, 2].tolist()) if depth < -ABOVE]
    if dry:
        yield (
            f"{recorded.where(dry[0], 3)}: should be under water (a depth, or an elevation below "
            f"0), got up to {-points[:, 2].min():,.4g} m above it at {len(dry):,} of "
            f"{len(points):,} points"
        )
    most = COMPONENTS["target"]["speed"].max
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


def problem(target: Any) -> str | None:
    """The problem with the points of a track; None: none."""
    if target.track_file is not None and target.trajectory == FILE:
        for key in POINT_KEYS:
            if key in target.model_fields_set:
                return f"[target] {key}: must be left out when there is a track_file"
        if target.fmu is not None:
            return "[target] track_file: must be left out with another FMU, fmu"
        return None
    if target.trajectory != FILE or target.fmu is not None:
        return None
    times, count = target.track_time_s, len(target.track_m) // 3
    if len(times) < 2:
        return (
            "[target] track_file: must be the file of a track (or track_time_s and track_m its "
            "points) when trajectory is 'file', got none"
        )
    if count != len(times):
        return f"[target] track_m: must have a row for each of {len(times)} times, got {count}"
    if not 2 <= target.track_count <= count:
        return f"[target] track_count: must be from 2 to {count}, got {target.track_count}"
    for i in range(1, len(times)):
        if not times[i] > times[i - 1]:
            return (
                f"[target] track_time_s[{i + 1}]: must be later than the previous point "
                f"({times[i - 1]!r}), got {times[i]!r}"
            )
    return None
