"""Where the beacons of a platform are: the paper's cross, for any number of beacons."""

from __future__ import annotations

from functools import cache
from math import cos, pi, sin
from typing import Any

ARM, DEPTH = 3.0, 0.5
"""Length of the arms, and how deep the beacons are, where nothing is said of them [m]."""
_QUARTERS = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))


@cache
def arms(count: int) -> tuple[tuple[float, float], ...]:
    """Directions of the arms in the body frame, forward and starboard: the first one forward.

    They divide the circle equally; those at a quarter of it have exact zeros and ones.
    """
    return tuple(_direction(i, count) for i in range(count))


def _direction(i: int, count: int) -> tuple[float, float]:
    if 4 * i % count == 0:
        return _QUARTERS[4 * i // count]
    angle = 2 * pi * i / count
    return cos(angle), sin(angle)


def usual(shape: tuple[int, ...]) -> tuple[float, ...]:
    """The elements of an array of beacons that nothing is said of, row by row [m]."""
    return tuple(v for beacon in cross(shape[0], ARM, DEPTH) for v in beacon)


def cross(count: int, arm: Any, depth: Any) -> tuple[tuple[Any, Any, Any], ...]:
    """Nominal position of each beacon at the end of its arm, body frame.

    Parameters
    ----------
    arm, depth
        Length of the arms, and how deep the beacons are below the reference point [m]; numbers or
        CasADi expressions.
    """
    return tuple((arm * x, arm * y, depth) for x, y in arms(count))
