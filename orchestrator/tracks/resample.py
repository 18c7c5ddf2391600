"""Reduce a recorded track to as few points as a tolerance allows, for the motion through them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from sblcosim.models import track as formulas
from sblcosim.models.target.variables import TRACK_POINTS

from .place import Floats

MOST = TRACK_POINTS.most
"""Largest number of points of a component."""
_PARTS = 4  # per piece of the recorded track, to bound the distance between its points
_STEEPEST = 0.2
"""A cubic with limited velocities strays from its chord by less than this times the chord."""
_ROOM = 1.5  # times the allowed number of points, before needless ones are removed
_APART = 6
_SHARE = 1.05  # the suggested tolerance is this much larger than a sufficient one


class TooFewError(Exception):
    """The allowed points are too few; the message is about a key."""


@dataclass(frozen=True, slots=True)
class KeptPoints:
    """The points that are kept of a track.

    Attributes
    ----------
    times, points
        Times and positions of the points [s, m].
    recorded, added
        Number of the track's points, and number of kept points that are not its own but on the
        straight lines between them.
    deviation
        Upper bound of the distance between the motion and the straight lines, at any time [m].
    """

    times: Floats
    points: Floats
    recorded: int
    added: int
    deviation: float


def fitted(
    times: Floats, points: Floats, tolerance: float, table: str = "target", most: int = MOST
) -> KeptPoints:
    """Choose points of a track, so that the motion through them stays within a tolerance.

    At all times the motion is compared with the recorded track: straight lines between its points,
    each at constant velocity. Points are added where the distance is largest, as Ramer, Douglas and
    Peucker do, and needless ones are removed. The ends of stops are kept if there is room for them.

    Parameters
    ----------
    times, points
        Ascending times [s]; rows of coordinates [m].
    tolerance
        Largest distance in space [m].
    table
        Table of the track, for messages.
    most
        Largest number of points.

    Raises
    ------
    TooFewError
        The points are too few; the message says which tolerance they allow.
    """
    kept = _choose(times, points, tolerance, most)
    if kept is not None:
        return kept
    low = high = tolerance
    free = np.zeros(len(times), bool)
    while _grown(times, points, high, most, free) is None:
        low, high = high, 2 * high
    for _ in range(4):
        middle = math.sqrt(low * high)
        if _grown(times, points, middle, most, free) is not None:
            high = middle
        else:
            low = middle
    enough = float(f"{_SHARE * high:.2g}")
    while _choose(times, points, enough, most) is None:
        enough = float(f"{_SHARE * enough:.3g}")
    raise TooFewError(
        f"[{table}] track_tolerance_m: must be at least {enough:g}, as {most:,} points are to do "
        f"for the {len(times):,} of the track, got {tolerance:g}"
    )


def _choose(times: Floats, points: Floats, tolerance: float, most: int) -> KeptPoints | None:
    with_stops = _grown(times, points, tolerance, most, _stops(points))
    return with_stops or _grown(times, points, tolerance, most, np.zeros(len(times), bool))


def _stops(points: Floats) -> np.ndarray:
    """Whether a point begins or ends a stop."""
    rests = (np.diff(points, axis=0) == 0).all(axis=1)
    before, after = np.append(False, rests), np.append(rests, False)
    differ: np.ndarray = before != after
    return differ


def _grown(
    times: Floats, points: Floats, tolerance: float, most: int, chosen: np.ndarray
) -> KeptPoints | None:
    """Add points until the tolerance holds, and remove those that are not needed after all.

    None if there are too many. The chosen points stay, and so do the first and the last one.
    """
    chosen = chosen.copy()
    chosen[[0, -1]] = True
    own = np.flatnonzero(chosen)  # indices of recorded points
    extra_times, extra_points = np.empty(0), np.empty((0, points.shape[1]))
    while len(own) + len(extra_times) <= _ROOM * most:
        knots = np.concatenate([times[own], extra_times])
        order = np.argsort(knots)
        knots = knots[order]
        places = np.concatenate([points[own], extra_points])[order]
        begins, bounds, at = _deviations(times, points, knots, places)
        worst = np.maximum.reduceat(bounds, begins)
        if (worst <= tolerance).all():
            knots, places = _thinned(times, points, knots, places, times[chosen], tolerance)
            deviation = float(_deviations(times, points, knots, places)[1].max())
            added = int((~np.isin(knots, times)).sum())
            fits = len(knots) <= most
            return KeptPoints(knots, places, len(times), added, deviation) if fits else None
        more, new = [], []
        ends = [*begins[1:], len(bounds)]
        for i in np.flatnonzero(worst > tolerance):
            place = begins[i] + int(np.argmax(bounds[begins[i] : ends[i]]))
            first = int(np.searchsorted(times, knots[i], "right"))
            last = int(np.searchsorted(times, knots[i + 1], "left"))
            if first < last:
                more.append(first + int(np.argmin(np.abs(times[first:last] - at[place]))))
            else:
                new.append(_corner(knots[i : i + 2], places[i : i + 2], at[place], tolerance))
        own = np.union1d(own, np.array(more, int))
        extra_times = np.concatenate([extra_times, new])
        extra_points = _on_lines(times, points, extra_times)
    return None


def _thinned(
    times: Floats, points: Floats, knots: Floats, places: Floats, stay: Floats, tolerance: float
) -> tuple[Floats, Floats]:
    """Remove points without which the tolerance still holds.

    A point affects the motion up to the second one beside it, so every sixth is tried at once.
    """
    for first in (*range(_APART), *range(_APART)):
        tried = np.arange(1 + first, len(knots) - 1, _APART)
        tried = tried[~np.isin(knots[tried], stay)]
        if not len(tried):
            continue
        left, where = np.delete(knots, tried), np.delete(places, tried, axis=0)
        begins, bounds, _ = _deviations(times, points, left, where)
        worst = np.maximum.reduceat(bounds, begins)
        joined = np.searchsorted(left, knots[tried]) - 1
        around = np.clip(joined[:, None] + [-1, 0, 1], 0, len(worst) - 1)
        needless = tried[(worst[around] <= tolerance).all(axis=1)]
        knots, places = np.delete(knots, needless), np.delete(places, needless, axis=0)
    return knots, places


def _corner(knots: Floats, places: Floats, worst: float, tolerance: float) -> float:
    """Times for a point on a straight line, so that its end comes within the tolerance."""
    duration, length = knots[1] - knots[0], float(np.linalg.norm(places[1] - places[0]))
    share = min(0.5, tolerance / (_STEEPEST * length))
    early = worst - knots[0] < knots[1] - worst
    return float(knots[0] + share * duration if early else knots[1] - share * duration)


def _on_lines(times: Floats, points: Floats, at: Floats) -> Floats:
    """Positions on the recorded track at some times, with straight lines between its points."""
    return np.stack([np.interp(at, times, of) for of in points.T], axis=1)


def motion(knots: Floats, places: Floats, at: Floats) -> tuple[Floats, Floats]:
    """Position [m] and velocity [m/s] at some times of the motion through points."""
    duration, step = np.diff(knots), np.diff(places, axis=0)
    velocities = np.zeros_like(places)
    if len(knots) > 2:
        first, second = duration[:-1, None], duration[1:, None]
        velocities[1:-1] = formulas.velocity(np, step[:-1], step[1:], first, second)
    i = np.clip(np.searchsorted(knots, at, "right") - 1, 0, len(step) - 1)
    tau = np.clip((at - knots[i]) / duration[i], 0.0, 1.0)[:, None]
    found = formulas.motion(
        tau, duration[i][:, None], places[i], step[i], velocities[i], velocities[i + 1]
    )
    return found[0], found[1]


def _deviations(
    times: Floats, points: Floats, knots: Floats, places: Floats
) -> tuple[np.ndarray, Floats, Floats]:
    """Largest distance between the motion and the straight lines, on each piece of the time.

    On a piece the difference is a cubic, which stays within the hull of its Bézier points.

    Returns
    -------
    begins, bounds, at
        The first piece of each pair of knots; the largest distance on each piece [m]; its middle.
    """
    ends = np.union1d(times, knots)
    shares = np.arange(_PARTS) / _PARTS
    grid = np.append((ends[:-1, None] + np.diff(ends)[:, None] * shares).ravel(), ends[-1])
    position, velocity = motion(knots, places, grid)
    line = _on_lines(times, points, grid)
    off, size = position - line, np.diff(grid)[:, None]
    slope = np.diff(line, axis=0)
    first, last = size * velocity[:-1] - slope, size * velocity[1:] - slope
    hull = np.stack([off[:-1], off[:-1] + first / 3, off[1:] - last / 3, off[1:]])
    bounds = np.sqrt((hull**2).sum(axis=2)).max(axis=0)
    begins = np.searchsorted(grid, knots[:-1], "left")
    return begins, bounds, (grid[:-1] + grid[1:]) / 2
