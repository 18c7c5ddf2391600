"""Points of a path: how many a scenario gives, and some along it."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from math import pi
from typing import Any

from .either import greatest, hypot, radians, sin, sqrt, square
from .expression import UNKNOWN, Expression

_POINTS = 8
"""Number of points on a path that is a formula."""
_MOST = 64
"""Largest number of points of a track that are used."""
_OF_POINTS = ("waypoints", "file")
_HELD = 1e-9
"""Weight of a part without length or duration, so that a diver at rest is somewhere."""
Weighted = tuple[Any, Any, Any, Any]
"""A weight, and a point, NED [m]."""


def counts(target: Any) -> dict[str, int]:
    """Keys of ``[target]`` that follow from the given points."""
    found = points(target)
    if target.waypoint_m:
        found["waypoint_count"] = len(target.waypoint_m) // 3
    return found


def points(table: Any) -> dict[str, int]:
    """The number of points of a track, of a diver or of a boat, if they are given."""
    return {"track_count": len(table.track_time_s)} if table.track_time_s else {}


def sketch(target: Any) -> list[Weighted]:
    """Points along the path of a diver, with weights; empty if the path is not known.

    They are as dense as the diver is there, by distance covered or by time. A path without an end
    counts with its start, a random one with its box.
    """
    trajectory = target.trajectory
    if trajectory in _OF_POINTS and isinstance(target.speed_m_s, Expression):
        return [(1.0, UNKNOWN, UNKNOWN, UNKNOWN)]  # as many as there may be are too many
    if trajectory == "waypoints":
        rows = _rows(target.waypoint_m, target.waypoint_count)
        return [*_legs(rows, [hypot(*(b - a for a, b in zip(one, two, strict=True)))
                              for one, two in pairwise(rows)])]
    if trajectory == "file":
        rows = _rows(target.track_m, min(target.track_count, len(target.track_time_s)))
        step = -(-len(rows) // _MOST) or 1
        rows, times = rows[::step], target.track_time_s[: len(rows) : step]
        return [*_legs(rows, [b - a for a, b in pairwise(times)])]
    if trajectory == "white_noise_acceleration":
        return [(1.0, *target.initial_position_m)]
    place = _PLACES.get(trajectory)
    if place is None:
        return []
    n, e = target.center_m
    shares = [(i + 0.5) / _POINTS for i in range(_POINTS)]
    deeper = target.depth_end_m - target.depth_start_m
    return [
        (1.0, n + north, e + east, target.depth_start_m + deeper * share)
        for share in shares for north, east in place(target, share)
    ]


def _rows(flat: Any, count: int) -> list[tuple[Any, Any, Any]]:
    # Whether there are as many is checked later.
    last = min(3 * count, len(flat) - 2)
    return [(flat[i], flat[i + 1], flat[i + 2]) for i in range(0, last, 3)]


def _legs(rows: Any, weights: Any) -> Iterator[Weighted]:
    """Two points on each straight leg."""
    for (one, two), weight in zip(pairwise(rows), weights, strict=True):
        for share in (0.25, 0.75):
            yield (
                greatest(weight, _HELD),
                *(a + share * (b - a) for a, b in zip(one, two, strict=True)),
            )


def _at(angle: Any, length: Any) -> tuple[Any, Any]:
    """North and east of a point at a bearing [rad]."""
    return length * sin(angle + pi / 2), length * sin(angle)


def _line(t: Any, share: float) -> Iterator[tuple[Any, Any]]:
    yield _at(radians(t.heading_deg), share * t.path_length_m)


def _semicircle(t: Any, share: float) -> Iterator[tuple[Any, Any]]:
    yield _at(radians(t.heading_deg) + pi * share, t.radius_m)


def _circle(t: Any, share: float) -> Iterator[tuple[Any, Any]]:
    yield _at(radians(t.heading_deg) + 2 * pi * t.turns * share, t.radius_m)


def _square(t: Any, share: float) -> Iterator[tuple[Any, Any]]:
    gone = [min(max(4 * share - side, 0.0), 1.0) for side in range(4)]
    ahead = _at(radians(t.heading_deg), t.side_m * (gone[0] - gone[2] - 0.5))
    right = _at(radians(t.heading_deg) + pi / 2, t.side_m * (gone[1] - gone[3] - 0.5))
    yield ahead[0] + right[0], ahead[1] + right[1]


def _spiral(t: Any, share: float) -> Iterator[tuple[Any, Any]]:
    # The distance covered grows with the square of the radius.
    first, last = t.spiral_radius_m
    radius = sqrt(square(first) + share * (square(last) - square(first)))
    yield _at(radians(t.heading_deg) + 2 * pi * t.turns * share, radius)


def _box(t: Any, share: float) -> Iterator[tuple[Any, Any]]:
    north, east = t.box_m
    for a, b in ((-0.75, -0.25), (-0.25, 0.75), (0.25, -0.75), (0.75, 0.25)):
        yield a * north, b * east


_PLACES = {
    "straight_line": _line, "semicircle": _semicircle, "circle": _circle, "square": _square,
    "spiral": _spiral, "random_path": _box,
}
"""North and east of points from the centre, after a share of the path."""
