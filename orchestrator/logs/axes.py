"""Axes of other formats, and the way from them to north, east, down."""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, radians, sin

import numpy as np

from ..data.estimates import Floats

AXES: Mapping[str, tuple[str, str, str]] = {
    "ned": ("n", "e", "d"),
    "enu": ("e", "n", "u"),
    "nwu": ("n", "w", "u"),
    "end": ("e", "n", "d"),
    "forward-starboard-down": ("n", "e", "d"),
    "starboard-forward-down": ("e", "n", "d"),
}
"""Names of axes, and where x, y and z point; forward is north until it is turned."""
_DIRECTIONS = {
    "n": (1, 0, 0), "e": (0, 1, 0), "d": (0, 0, 1), "w": (0, -1, 0), "u": (0, 0, -1),
}


def to_ned(
    places: Floats, axes: str = "ned", turn_deg: float = 0.0, shift: Floats | None = None
) -> Floats:
    """North, east, down of places in other axes; shape (n, 2) or (n, 3), without z it is 0.

    Parameters
    ----------
    axes
        A name of `AXES`.
    turn_deg
        Direction of what is north in these axes, clockwise from north.
    shift
        Coordinates of the origin in these axes.
    """
    if places.shape[1] == 2:
        places = np.column_stack([places, np.zeros(len(places))])
    if shift is not None:
        places = places - shift
    straight = np.array([_DIRECTIONS[axis] for axis in AXES[axes]], float)
    ned: Floats = places @ straight + 0.0  # no negative zeros
    if turn_deg:
        c, s = cos(radians(turn_deg)), sin(radians(turn_deg))
        ned = ned @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return ned
