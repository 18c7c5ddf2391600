"""Where the diver was to begin with, and how deep."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solveh_banded
from scipy.optimize import least_squares

from ..data.estimates import Floats, Integers

_STARTS = 12
"""Directions from the beacons' centre in which a start is looked for."""
_A_BEACON = 3
"""Ranges to each beacon in the window of the start."""
_SPEED = 1.0
"""Usual speed of a diver [m/s]."""


def noise_of(time: Floats, values: Floats, which: Integers) -> float:
    """A first guess of the noise: scatter of each series about the line through its neighbours."""
    scatter = [np.empty(0)]
    for one in np.unique(which):
        t, v = time[which == one], values[which == one]
        if len(t) > 2:
            share = (t[1:-1] - t[:-2]) / np.maximum(t[2:] - t[:-2], 1e-9)
            off = v[1:-1] - v[:-2] - share * (v[2:] - v[:-2])
            scatter.append(off / np.sqrt(1 + share**2 + (1 - share) ** 2))
    found = np.concatenate(scatter)
    return float(1.4826 * np.median(np.abs(found))) if len(found) else 1.0


def start(
    time: Floats, beacon: Integers, range_: Floats, place: Floats, down: Floats, noise: float
) -> tuple[Floats, float]:
    """Position and velocity at the first range, horizontal, and the position's uncertainty.

    A robust fit of steady motion to the first ranges, some to each beacon; one of them may be late.

    Returns
    -------
    tuple
        North, east [m] and their rates [m/s]; and a standard deviation [m].
    """
    count = min(_A_BEACON * len(np.unique(beacon)), len(time))
    t, r = time[:count] - time[0], range_[:count]
    s, drop = place[:count], down[:count] - place[:count, 2]
    scale = max(3 * noise, 1e-3)

    def residuals(x: Floats) -> Floats:
        at = x[:2] + t[:, None] * x[2:] - s[:, :2]
        own = np.sqrt(np.sum(at**2, axis=1) + drop**2 + 1e-12) - r
        return np.concatenate([own / scale, x[2:] / _SPEED])

    centre, reach = s[:, :2].mean(axis=0), float(np.median(r))
    angles = 2 * np.pi * np.arange(_STARTS) / _STARTS
    around = centre + reach * np.column_stack([np.cos(angles), np.sin(angles)])
    fits = [
        least_squares(residuals, [*begin, 0.0, 0.0], loss="soft_l1")
        for begin in (centre + 1e-3, *around, *((around + centre) / 2))
    ]
    best = min(fits, key=lambda it: it.cost)
    jacobian = np.asarray(best.jac, float)
    information = jacobian.T @ jacobian + 1e-9 * np.eye(4)
    std = scale * float(np.sqrt(np.trace(np.linalg.inv(information)[:2, :2])))
    return best.x, std


def smoothed(time: Floats, values: Floats, std: float, psd: float) -> tuple[Floats, float]:
    """The smooth path through readings with this noise, and its variance.

    White acceleration of density ``psd``; the variance is that far from both ends.
    """
    n = len(time)
    if n < 3:
        return values.copy(), std**2
    # Unknowns (z, v) at each reading. A step's precision is the inverse of
    # psd [[dt³/3, dt²/2], [dt²/2, dt]], that is [[a, b], [b, c]].
    psd, dt = max(psd, 1e-6), np.maximum(np.diff(time), 1e-9)
    a, b, c = 12 / (psd * dt**3), -6 / (psd * dt**2), 4 / (psd * dt)
    band, z, v = np.zeros((4, 2 * n)), np.arange(0, 2 * n, 2), np.arange(1, 2 * n, 2)
    band[3, z] = 1 / std**2
    band[3, z[:-1]] += a
    band[3, z[1:]] += a
    band[3, v[:-1]] += c
    band[3, v[1:]] += c
    band[2, v[:-1]] -= b
    band[2, v[1:]] += b
    band[2, z[1:]] = b
    band[1, z[1:]] = -a
    band[1, v[1:]] = c / 2
    band[0, v[1:]] = -b
    right = np.zeros(2 * n)
    right[z] = values / std**2
    solution = solveh_banded(band, right)
    interval = float(np.median(dt))
    least = psd**0.25 * (std**2 * interval) ** 0.75 / (2 * np.sqrt(2))
    return solution[z], min(least, std**2)
