"""The information in a range that remains despite outliers."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from ..lazy import Module

Floats = NDArray[np.float64]
special = Module("scipy.special")

_CORE, _STEP = 10.0, 0.005
"""Half the width of the grid about 0, and its step, in standard deviations of the noise."""
_TAIL = 40.0
"""Length of the tail, in mean excesses."""
_SMALLEST = 1e-3
"""Mean excess, in standard deviations, that has no effect: I is 1 to O(1e-6)."""


def fisher_factor(
    std: float, probability: float, mean: float, distribution: str = "exponential"
) -> float:
    """Information about the location of a contaminated range, relative to one with noise alone.

    I = σ² ∫ f′²/f with f = (1 − π) N(0, σ²) + π (N(0, σ²) ⊕ excess): a range with such noise is
    worth as much as one with Gaussian noise of variance σ²/I. In units of σ, with mean excess μ,
    the late part is g(z) = exp(1/2μ² − z/μ) Φ(z − 1/μ)/μ, g′ = (φ − g)/μ for an exponential excess,
    and g(z) = 2/ω φ(z/ω) Φ(s z/ω), s = μ √(π/2), ω² = 1 + s² for a half-normal one.

    Parameters
    ----------
    std
        σ, standard deviation of the white noise [m].
    probability, mean
        π, probability of an outlier, and its mean excess [m].
    distribution
        ``exponential`` or ``half_normal``.

    Returns
    -------
    float
        0 < I ≤ 1; 0.915 for 5 %, 1 m and σ = 0.1 m, 0.869 for 10 %, 3 m.
    """
    if probability <= 0 or mean <= _SMALLEST * std:
        return 1.0
    if std <= 0 or mean >= 1e6 * std:
        return 1.0 - probability  # a late range is recognised and holds no information
    mu = mean / std
    core = np.linspace(-_CORE, _CORE, round(2 * _CORE / _STEP) + 1)
    tail = np.geomspace(_CORE, _CORE + _TAIL * max(mu, 1.0), 4001)
    information = 0.0
    for z in (core, tail):
        y = _integrand(z, probability, mu, distribution)
        information += float(((y[1:] + y[:-1]) * np.diff(z)).sum() / 2)
    return min(information, 1.0)


def _integrand(z: Floats, probability: float, mu: float, distribution: str) -> Floats:
    """f′²/f in units of the noise."""
    phi = _normal(z)
    if distribution == "half_normal":
        s = mu * sqrt(pi / 2)
        w = sqrt(1 + s * s)
        g = 2 / w * np.exp(special.log_ndtr(s * z / w)) * _normal(z / w)
        slope = -z / w**2 * g + 2 * s / w**2 * _normal(z / w) * _normal(s * z / w)
    else:
        g = np.exp(0.5 / mu**2 - z / mu + special.log_ndtr(z - 1 / mu)) / mu
        slope = (phi - g) / mu
    f = (1 - probability) * phi + probability * g
    df = -(1 - probability) * z * phi + probability * slope
    result: Floats = df**2 / np.fmax(f, 1e-300)
    return result


def _normal(z: Floats) -> Floats:
    density: Floats = np.exp(-0.5 * z**2) / sqrt(2 * pi)
    return density
