"""Positions of the beacons on a platform: the paper's cross, for any number of beacons."""

from __future__ import annotations

from functools import cache
from math import cos, pi, sin
from typing import Any

ARM, DEPTH = 3.0, 0.5
"""Default length of the arms and depth of the beacons [m]."""
_QUARTERS = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))


@cache
def arms(count: int) -> tuple[tuple[float, float], ...]:
    """Directions of the arms in the body frame, forward and starboard; the first points forward.

    They divide the circle equally. Those at multiples of 90° have exact zeros and ones.
    """
    return tuple(_direction(i, count) for i in range(count))


def _direction(i: int, count: int) -> tuple[float, float]:
    if 4 * i % count == 0:
        return _QUARTERS[4 * i // count]
    angle = 2 * pi * i / count
    return cos(angle), sin(angle)


def usual(shape: tuple[int, ...]) -> tuple[float, ...]:
    """Default beacon positions, row by row [m]."""
    return tuple(v for beacon in cross(shape[0], ARM, DEPTH) for v in beacon)


def cross(count: int, arm: Any, depth: Any) -> tuple[tuple[Any, Any, Any], ...]:
    """Nominal position of each beacon, at the end of its arm, in the body frame.

    Parameters
    ----------
    arm, depth
        Length of the arms and depth of the beacons below the reference point [m]; numbers or CasADi
        expressions.
    """
    return tuple((arm * x, arm * y, depth) for x, y in arms(count))
