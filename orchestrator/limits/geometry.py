"""Dilution of precision: position error for ranges with a standard deviation of 1 m.

With the depth known, a range from beacon i at s_i observes the horizontal position x along its unit
vector u_i = (x − s_i)/|x − s_i|: G = Σ u_h u_hᵀ, and G⁻¹ is the covariance per unit of σ_r². An
error common to all ranges (an unknown clock) removes the part along the mean of the u: G = Σ u_h
u_hᵀ − (Σ u_h)(Σ u_h)ᵀ/N, the Schur complement.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sblcosim.models import arrangement

from ..shown import Shown

Floats = NDArray[np.float64]

_SINGULAR = 1e-12
"""det G, as a share of (trace G)², below which there is no fix."""


@dataclass(frozen=True, eq=False, repr=False)
class Dilution(Shown):
    """Standard deviations of a fix per metre of range error; infinite where there is no fix.

    Attributes
    ----------
    horizontal
        HDOP: root of the sum of both variances, shape (…).
    radial, cross
        Along the horizontal line from the beacons' centre to the diver, and across it.
    """

    horizontal: Floats
    radial: Floats
    cross: Floats


def cross(arm: float, depth: float = 0.5) -> Floats:
    """Four beacons at the ends of a cross in still water at a heading of 0, NED [m]; (4, 3)."""
    return np.array(arrangement.cross(4, arm, depth), float)


def hdop(position: ArrayLike, beacons: ArrayLike, *, unknown_clock: bool = False) -> Dilution:
    """Horizontal dilution of precision of simultaneous ranges with known depth.

    Parameters
    ----------
    position
        Position of the diver, NED [m]; any shape (…, 3), for example a grid.
    beacons
        Their positions, NED [m]; shape (N, 3), in any arrangement.
    unknown_clock
        Whether all ranges share one unknown error.
    """
    x, s = np.asarray(position, float), np.asarray(beacons, float)
    o = x[..., None, :] - s
    distance = np.sqrt((o**2).sum(-1, keepdims=True))
    u = o[..., :2] / np.where(distance > 0, distance, np.inf)
    G = np.einsum("...ni,...nj->...ij", u, u)
    if unknown_clock:
        total = u.sum(-2)
        G = G - total[..., :, None] * total[..., None, :] / max(len(s), 1)
    a, b, c = G[..., 0, 0], G[..., 0, 1], G[..., 1, 1]
    det, trace = a * c - b * b, a + c
    known = det > _SINGULAR * trace**2
    inverse = 1 / np.where(known, det, 1.0)
    away = x[..., :2] - s[:, :2].mean(0)
    length = np.sqrt((away**2).sum(-1))
    above = length == 0
    e = np.where(above[..., None], [1.0, 0.0], away / np.where(above, 1.0, length)[..., None])
    n, east = e[..., 0], e[..., 1]
    radial = (c * n**2 - 2 * b * n * east + a * east**2) * inverse
    across = (c * east**2 + 2 * b * n * east + a * n**2) * inverse

    def std(variance: Floats) -> Floats:
        result: Floats = np.sqrt(np.where(known, np.fmax(variance, 0), np.inf))
        return result

    return Dilution(std(trace * inverse), std(radial), std(across))
