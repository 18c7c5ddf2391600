"""Shares of a mean square over paired runs, with intervals that are valid for skewed runs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

CONFIDENCE = 0.95
RESAMPLES = 1999
LEAST_RUNS = 30
"""With fewer runs, their skewness is too uncertain."""


def shares(
    parts: Floats, whole: Floats, seed: int, confidence: float = CONFIDENCE
) -> tuple[Floats, Floats, Floats]:
    """Ratios of means, mean(part)/mean(whole), and their intervals.

    The bootstrap-t interval of a ratio (B. Efron, R. J. Tibshirani, *An Introduction to the
    Bootstrap*, 1993, section 12.5). Whole runs are drawn with replacement, so everything that
    belongs to a seed stays together. Each ratio is studentised by the linearised standard error of
    its own draw. Where the parts are differences between runs of the same seed, the differences are
    resampled.

    Parameters
    ----------
    parts
        One row for each run; shape (n, m). They may be negative.
    whole
        One value for each run; shape (n,).
    seed
        Seed of the resampling.

    Returns
    -------
    ratio, low, high
        Shape (m,).
    """
    n = len(whole)
    weights = np.random.Generator(np.random.Philox(seed)).multinomial(
        n, np.full(n, 1 / n), RESAMPLES
    ) / n  # fmt: skip
    ratio, error = (v[0] for v in _ratios(np.full((1, n), 1 / n), parts, whole))
    drawn, own = _ratios(weights, parts, whole)
    t = np.divide(drawn - ratio, own, out=np.zeros_like(drawn), where=own > 0)
    tail = (1 - confidence) / 2
    low, high = np.quantile(t, [tail, 1 - tail], axis=0)
    return ratio, ratio - high * error, ratio - low * error


def _ratios(weights: Floats, parts: Floats, whole: Floats) -> tuple[Floats, Floats]:
    """Ratios of weighted means, and their standard errors; (b, m) each for weights (b, n)."""
    x = (weights @ whole)[:, None]
    ratio = (weights @ parts) / x
    cross, square = weights @ (parts * whole[:, None]), (weights @ whole**2)[:, None]
    scatter = weights @ parts**2 - 2 * ratio * cross + ratio**2 * square
    return ratio, np.sqrt(np.fmax(scatter, 0) / (len(whole) - 1)) / x
