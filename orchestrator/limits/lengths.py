"""Percentiles of the length of a Gaussian error.

For e ~ N(0, diag λ), |e|² is Σ λ_i z_i². In polar coordinates z = r u, r² is χ² with three degrees
of freedom and independent of the direction u. P(|e|² ≤ x) is therefore the mean over the sphere of
F(x/Σ λ_i u_i²), F(y) = erf √(y/2) − √(2y/π) e^(−y/2): a smooth function on an octant, which a Gauss
rule integrates.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..lazy import Module

Floats = NDArray[np.float64]
special = Module("scipy.special")

_RULE = (16, 8)
"""Nodes over the cosine of the angle to the largest axis, and about it."""
_PASSES = 60
_ENOUGH = 1e-6
"""Relative size of the last step of Newton's iteration: its error is about the square of that."""


def percentile(covariances: Floats, share: float = 0.95) -> Floats:
    """Length that an error does not exceed with a given probability, for a mixture of covariances.

    Parameters
    ----------
    covariances
        Shape (epochs, n, d, d), d = 1 to 3; all epochs have the same weight.
    share
        The probability.

    Returns
    -------
    Floats
        Shape (n,), in the unit of a standard deviation; to 0.1 % for a share of 0.9 or more, and
        less well below, where deviations differ much. NaN where a covariance is not finite.
    """
    epochs, n, d, _ = covariances.shape
    whole = np.asarray(np.isfinite(covariances).all(axis=(0, 2, 3)))
    variances = np.zeros((epochs, n, 3))
    known = np.linalg.eigvalsh(np.where(whole[:, None, None], covariances, 0.0))
    variances[..., 3 - d :] = np.fmax(known, 0.0)  # increasing
    largest = variances.max(axis=(0, 2))
    scaled = variances / np.where(largest > 0, largest, 1.0)[:, None]
    along = np.fmax(scaled @ _directions()[0].T, 1e-12)  # (epochs, n, nodes)
    weights = _directions()[1] / epochs
    low, high = np.zeros(n), np.full(n, 2 * special.gammaincinv(1.5, share))
    x = high / 2
    for _ in range(_PASSES):
        y = x[:, None] / along
        wave = np.sqrt(2 * y / np.pi) * np.exp(-y / 2)
        reached = ((special.erf(np.sqrt(y / 2)) - wave) * weights).sum(axis=(0, 2))
        slope = (wave / 2 / along * weights).sum(axis=(0, 2))
        low, high = np.where(reached < share, x, low), np.where(reached < share, high, x)
        step = x + (share - reached) / np.fmax(slope, 1e-300)
        done = np.abs(step - x) <= _ENOUGH * x
        x = np.where(done | ((step > low) & (step < high)), step, (low + high) / 2)
        if done.all():
            break
    result: Floats = np.where(whole, np.sqrt(np.where(largest > 0, x * largest, 0.0)), np.nan)
    return result


def _directions() -> tuple[Floats, Floats]:
    """Squares of unit vectors in an octant, (nodes, 3), and their weights, whose sum is 1."""
    (z, wz), (t, wt) = (np.polynomial.legendre.leggauss(count) for count in _RULE)
    z, wz, angle, wt = (z + 1) / 2, wz / 2, np.pi / 4 * (t + 1), wt / 2
    across = 1 - z[:, None] ** 2
    squares = (across * np.sin(angle) ** 2, across * np.cos(angle) ** 2,
               np.repeat(z[:, None] ** 2, len(angle), 1))
    return np.stack([s.ravel() for s in squares], axis=1), np.outer(wz, wt).ravel()
