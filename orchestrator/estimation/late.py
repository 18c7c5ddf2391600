"""Late arrivals: the density of a range's error as in `coupled`, in NumPy.

A range is punctual with probability 1 − π. Otherwise it has an exponentially distributed excess
with mean m besides its noise. Occasionally the estimate itself is wrong, by any amount.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.special import log_ndtr

_WRONG = 1e-4 / 50.0
"""Density of ranges for which the estimate is wrong [1/m]: one in 10⁴ over 50 m."""
_LEAST = 1e-12


def log_densities(p: Any, residual: Any, variance: Any) -> tuple[Any, Any]:
    """Logarithms of the densities of punctual ranges and of all others, with their probabilities.

    Parameters
    ----------
    p
        ``outlier_probability`` and ``outlier_mean`` [m].
    residual, variance
        ν [m] and S [m²]; numbers or arrays.
    """
    chance, m = p.outlier_probability, p.outlier_mean
    root = np.sqrt(variance)
    punctual = np.log1p(-chance) - 0.5 * (residual / root) ** 2 - np.log(root * np.sqrt(2 * np.pi))
    if chance == 0:
        return punctual, np.log(_WRONG) + 0 * punctual
    excess = variance / (2 * m**2) - residual / m + log_ndtr(residual / root - root / m)
    return punctual, np.logaddexp(np.log(chance / m) + excess, np.log(_WRONG))


def share(p: Any, residual: Any, variance: Any) -> Any:
    """λ: the probability that a range is punctual, at least 10⁻¹²; see `log_densities`."""
    punctual, other = log_densities(p, residual, variance)
    return np.maximum(1 / (1 + np.exp(np.minimum(other - punctual, 700.0))), _LEAST)
