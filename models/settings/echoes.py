"""Late ranges: how many come by an echo from surface or bottom, or are outliers; and how late.

``models/acoustics/README.md`` has the formulas.
"""

from __future__ import annotations

from collections.abc import Callable
from math import pi
from typing import Any

from ..acoustics import shadow
from ..acoustics.ranging import legs
from .beacons import beacons_of
from .either import greatest, radians, sin, sqrt, square, symbolic, where
from .expression import outlined
from .names import branching
from .paths import sketch


def chances(acoustics: Any) -> tuple[Any, Any]:
    """Probabilities that the echo from surface and bottom arrives where the direct path is lost."""
    bottom = where(acoustics.water_depth_m > 0, acoustics.bottom_echo_probability, 0.0)
    return acoustics.surface_echo_probability, bottom


def excesses(
    root: Callable[[Any], Any], apart: Any, diver: Any, beacon: Any, water_depth: Any
) -> tuple[Any, Any]:
    """Excess paths of the echoes from surface and bottom [m].

    Parameters
    ----------
    root
        The square root of such numbers.
    apart
        Square of the horizontal distance [m²].
    diver, beacon, water_depth
        Their depths [m].
    """
    direct = root(apart + square(diver - beacon))
    surface, bottom = (
        root(apart + square(down)) - direct
        for down in (diver + beacon, 2 * water_depth - (diver + beacon))
    )
    return surface, bottom


def share(acoustics: Any) -> Any:
    """Share of the packets received that came by an echo."""
    surface, bottom = chances(acoustics)
    shade = shadow.mean(
        acoustics.shadow_loss_probability, radians(acoustics.shadow_half_width_deg)
    )
    loss = acoustics.loss_probability + (1 - acoustics.loss_probability) * shade
    none = (1 - surface) * (1 - bottom)
    echoes, received = loss * (1 - none), 1 - loss * none
    return where(received > 0, echoes, 0.0) / where(received > 0, received, 1.0)


@branching
def late(outliers: Any, acoustics: Any) -> Any:
    """Share of ranges that are late: outliers, and echoes where the direct path is lost.

    Parameters
    ----------
    outliers
        Share of outliers.
    """
    echoes = share(acoustics)
    direct: Any = 1.0
    for _ in range(legs(acoustics.ranging)):
        direct = direct * (1 - echoes)
    return where(echoes > 0, 1 - (1 - outliers) * direct, outliers)


@branching
def mean_excess(outliers: Any, target: Any, platform: Any, acoustics: Any) -> Any:
    """Mean excess of late ranges [m]: of outliers, and of echoes along the diver's path.

    Parameters
    ----------
    outliers
        Share of outliers.
    target
        The table of the diver, or None if the path is not known. Echoes then do not count.
    """
    echoes = share(acoustics)
    of_outliers = acoustics.outlier_mean_m
    points = () if target is None else sketch(target)
    if not points or not (symbolic(echoes) or echoes > 0):
        return of_outliers
    # A two-way range is late by half the sum over its legs, and so by as much as each on average.
    amount = outliers * of_outliers + echoes * _along(points, platform, acoustics)
    number = late(outliers, acoustics)
    return where(echoes > 0, amount / where(number > 0, number, 1.0), of_outliers)


def _along(points: Any, platform: Any, acoustics: Any) -> Any:
    """Mean excess of the echoes between points of a path and beacons in still water [m]."""
    q1, q2 = chances(acoustics)
    some = 1 - (1 - q1) * (1 - q2)
    total: Any = 0.0
    weights: Any = 0.0
    beacons = _still(platform)
    for weight, n, e, z in points:
        for north, east, down in beacons:
            mean = _excess(n - north, e - east, z, down, acoustics.water_depth_m, q1, q2)
            total, weights = total + weight * mean, weights + weight
    return total / weights / where(some > 0, some, 1.0)


@outlined
def _excess(n: Any, e: Any, diver: Any, beacon: Any, water_depth: Any, q1: Any, q2: Any) -> Any:
    """Mean excess of the echoes between two points [m], times their probability.

    Parameters
    ----------
    n, e
        Horizontal distance, north and east [m].
    diver, beacon, water_depth
        Depths [m].
    q1, q2
        Probabilities of the echoes from surface and bottom.
    """
    first, second = (
        greatest(it, 0.0)
        for it in excesses(sqrt, square(n) + square(e), diver, beacon, water_depth)
    )
    # The receiver takes the echo that arrives first.
    return where(
        first <= second,
        q1 * first + (1 - q1) * q2 * second, q2 * second + (1 - q2) * q1 * first,
    )


def _still(platform: Any) -> list[tuple[Any, Any, Any]]:
    """Positions of the beacons in still water, NED [m]."""
    flat = beacons_of(platform)
    heading = radians(platform.mean_heading_deg)
    c, s = sin(heading + pi / 2), sin(heading)
    n, e, z = platform.mean_position_m
    return [
        (n + c * x - s * y, e + s * x + c * y, z + down)
        for x, y, down in zip(flat[::3], flat[1::3], flat[2::3], strict=True)
    ]
