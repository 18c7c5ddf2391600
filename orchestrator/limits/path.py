"""How lively a path is: the density of the white acceleration that a filter should assume."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_PASSES = 30
_FIRST_PSD = 0.01
"""q with which the fixed point begins [m²/s³]; it has no influence."""


def path_psd(time_s: Floats, velocity: Floats, noise_density: float) -> float:
    """q of a path over the memory of the filter that it is for.

    q = E|Δv_h(τ)|²/2τ, half for each axis, with τ = (R T_eff/q)^¼: how long the Kalman filter of
    that q remembers. It is what the acceleration of the path looks like to this filter, whatever
    its law.

    Parameters
    ----------
    time_s
        Increasing [s]; shape (n,).
    velocity
        True velocity of the diver, NED [m/s]; shape (n, 3).
    noise_density
        R T_eff [m² s]: variance of the bearing's fix, across the line to the platform, times the
        time between fixes.

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
    q = _FIRST_PSD
    for _ in range(_PASSES):
        tau = (noise_density / q) ** 0.25 if q > 0 else longest
        tau = min(max(tau, step), longest)
        starts = t[t <= t[-1] - tau]
        change = sum(
            (np.interp(starts + tau, t, v) - np.interp(starts, t, v)) ** 2 for v in velocity.T[:2]
        )
        q = float(np.mean(change) / (2 * tau))
    return q
