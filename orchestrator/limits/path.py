"""Activity of a path: density of the white acceleration that a filter should assume."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_PASSES = 30
_FIRST_PSD = 0.01
"""Initial q of the fixed-point iteration [m²/s³]; it has no influence."""


def path_psd(time_s: Floats, velocity: Floats, noise_density: float) -> float:
    """q of a path over the memory of its filter.

    q = E|Δv_h(τ)|²/2τ, half for each axis, with τ = (R T_eff/q)^¼: the memory of the Kalman filter
    with that q. It is how the acceleration of the path appears to this filter, whatever its law.

    Parameters
    ----------
    time_s
        Times, increasing [s]; shape (n,).
    velocity
        True velocity of the diver, NED [m/s]; shape (n, 3).
    noise_density
        R T_eff [m² s]: variance of the fix across the line to the platform, times the time between
        fixes.

    Returns
    -------
    float
        Per axis [m²/s³]; 0 for a path without turns.
    """
    t = np.asarray(time_s, float) - time_s[0]
    longest = t[-1] / 2
    if len(t) < 3 or noise_density <= 0:
        return 0.0
    step = float(np.median(np.diff(t)))

    def change(tau: Any) -> Any:
        starts = t[t <= t[-1] - tau]
        return np.mean(sum(
            (np.interp(starts + tau, t, v) - np.interp(starts, t, v)) ** 2 for v in velocity.T[:2]
        ))

    return float(_fixed_point(change, noise_density, step, longest))


def circle_psd(speed: float, radius: float, noise_density: Floats, duration_s: float) -> Floats:
    """q of a circle at constant speed, as `path_psd`: E|Δv_h(τ)|² = 4v² sin²(vτ/2R).

    Parameters
    ----------
    speed, radius
        v [m/s] and R [m].
    noise_density
        See `path_psd` [m² s]; any shape.
    duration_s
        Duration of a run [s]; no filter has a memory longer than half of it.
    """

    def change(tau: Any) -> Any:
        return (2 * speed * np.sin(speed * tau / (2 * radius))) ** 2

    known = np.isfinite(noise_density) & (noise_density > 0)
    density = np.where(known, noise_density, 1.0)
    q: Floats = np.where(known, _fixed_point(change, density, 0.0, duration_s / 2), 0.0)
    return q


def _fixed_point(
    change: Callable[[Any], Any], noise_density: Any, shortest: float, longest: float
) -> Any:
    """q = change(τ)/2τ with τ = (noise density/q)^¼, for one path or several; 0 for v = 0."""
    q: Any = np.full(np.shape(noise_density), _FIRST_PSD)
    for _ in range(_PASSES):
        moving = q > 0
        tau = np.where(moving, (noise_density / np.where(moving, q, 1.0)) ** 0.25, longest)
        tau = np.clip(tau, shortest, longest)
        q = change(tau) / (2 * tau)
    return q
