"""Paths of sound from a beacon to the diver: direct, or by one echo; at one speed or by a profile.

Surface and bottom are flat mirrors. The surface is at rest at depth 0, the bottom at
``water_depth``. Rays are straight.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from ..equations import Symbols

_THINNEST = 1e-6
"""Least difference in depth [m] over which the profile is averaged."""


def path_length(p: Symbols, u: Symbols, beacon: Any, speed: Any) -> Any:
    """Acoustic path length [m], from the ping of a beacon to its arrival.

    The travel time solves ``|x + v tau - s| = c tau`` exactly, with x and v at the ping (section
    2.3). It exists as long as the diver is slower than sound.

    Parameters
    ----------
    beacon
        Position of the beacon, or of its image, NED [m].
    speed
        Mean speed of sound c along the path [m/s].
    """
    return leg_length(p, u.target_position - beacon, u.target_velocity, speed)


def leg_length(p: Symbols, offset: Any, velocity: Any, speed: Any) -> Any:
    """Length of a path from a point at rest to a moving diver [m].

    The path of a request, which ends at the point, is that of a diver who moves backwards.

    Parameters
    ----------
    offset
        Diver minus the point, when the sound is there, NED [m].
    velocity
        That of the diver, NED [m/s].
    speed
        Mean speed of sound c along the path [m/s].
    """
    c = speed
    c2_v2 = ca.fmax(c**2 - ca.sumsqr(velocity), 1e-9 * c**2)
    along = ca.dot(offset, velocity)
    tau = (along + ca.sqrt(along**2 + c2_v2 * ca.sumsqr(offset))) / c2_v2
    return ca.if_else(p.motion_during_travel, c * tau, ca.sqrt(ca.sumsqr(offset)))


def images(p: Symbols, beacon: Any) -> tuple[Any, Any]:
    """Mirror images of a beacon at the surface and at the bottom, NED [m]."""
    n, e, z = beacon[0], beacon[1], beacon[2]
    return ca.vertcat(n, e, -z), ca.vertcat(n, e, 2 * p.water_depth - z)


def mean_speed(p: Symbols, *spans: tuple[Any, Any]) -> Any:
    """Harmonic mean of the speed of sound over spans of depth [m/s].

    A straight ray crosses equal depths in equal lengths, so this is the speed along it. Without a
    profile it is ``sound_speed``.

    Parameters
    ----------
    spans
        Depths between which a ray goes [m], each part of it from the first to the second.
    """
    total, thickness = 0.0, 0.0
    for begin, end in spans:
        span = ca.if_else(ca.fabs(end - begin) < _THINNEST, _THINNEST, end - begin)
        # A part that goes up counts like one that goes down.
        total = total + ca.fabs(_slowness(p, begin, begin + span))
        thickness = thickness + ca.fabs(span)
    return ca.if_else(p.profile_count > 0, thickness / total, p.sound_speed)


def _slowness(p: Symbols, begin: Any, end: Any) -> Any:
    """Integral of 1/c over the depth [s]: linear between points, constant beyond them."""
    rows = p.profile_depth.shape[0]
    depth = [p.profile_depth[i] for i in range(rows)]
    slow = [1 / p.profile_speed[i] for i in range(rows)]
    last = [p.profile_count == i + 1 for i in range(rows)]
    deepest, slow_there = (
        sum(ca.if_else(there, v, 0) for there, v in zip(last, values, strict=True))
        for values in (depth, slow)
    )
    total = (
        (ca.fmin(end, depth[0]) - ca.fmin(begin, depth[0])) * slow[0]
        + (ca.fmax(end, deepest) - ca.fmax(begin, deepest)) * slow_there
    )
    for i in range(rows - 1):
        a, b = (ca.fmin(ca.fmax(z, depth[i]), depth[i + 1]) for z in (begin, end))
        thick = ca.fmax(depth[i + 1] - depth[i], _THINNEST)
        share = ((a + b) / 2 - depth[i]) / thick
        layer = (b - a) * (slow[i] + (slow[i + 1] - slow[i]) * share)
        total = total + ca.if_else(i + 1 < p.profile_count, layer, 0)
    return total
