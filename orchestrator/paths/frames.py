"""East, north, up: the axes of trajectories (ROS REP 103), from north, east, down."""

from __future__ import annotations

import numpy as np

from ..data.estimates import Floats

_ORDER = [1, 0, 2]
_SIGNS = np.outer([1.0, 1.0, -1.0], [1.0, 1.0, -1.0])


def enu(ned: Floats) -> Floats:
    """Rows of east, north, up, from rows of north, east, down; shape (n, 3)."""
    turned: Floats = np.column_stack([ned[:, 1], ned[:, 0], 0.0 - ned[:, 2]])
    return turned


def enu_covariance(ned: Floats) -> Floats:
    """Covariances of east, north, up, from those of north, east, down; shape (n, 3, 3)."""
    turned: Floats = ned[:, _ORDER][:, :, _ORDER] * _SIGNS
    return turned
