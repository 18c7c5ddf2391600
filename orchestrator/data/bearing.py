"""Whether a receiver knows the diver's bearing from the platform.

If it does not, the ranges fit on a whole ring about the platform, or in several places of it. No
mean and no ellipse describes that.
"""

from __future__ import annotations

import numpy as np
from sblcosim.models.receiver.surroundings import WIDEST

from .estimates import Estimates, Flags

LEAST_M = 2.0
"""Radius of a ring that matters, horizontal [m]."""


def is_unknown(estimates: Estimates) -> Flags | None:
    """Whether the variance of the bearing is above `WIDEST`, shape (m,).

    It is that of the position across the direction from the platform, over the squared horizontal
    distance, at least `LEAST_M`. None: the receiver has no position relative to the platform, or no
    covariance.
    """
    y, P = estimates.relative_position, estimates.covariance
    if y is None or P is None:
        return None
    away = np.linalg.norm(y[:, :2], axis=1)
    across = np.column_stack([-y[:, 1], y[:, 0]]) / np.maximum(away, 1e-9)[:, None]
    variance = np.einsum("ni,nij,nj->n", across, P[:, ::2, ::2][:, :2, :2], across)
    unknown: Flags = variance > WIDEST * np.maximum(away, LEAST_M) ** 2
    return unknown
