"""Intervals of the indices of a response with two values, such as ``lost``.

Take the run with one column from B, and pair it with the run at A, or with the run at B. Both runs
of a pair have the same distribution. A total index is one minus the correlation of the first pair.
A first-order index is the correlation of the second pair. A pair has both values rare, both
frequent, or one of each, with probabilities

p² + ρ p q,    q² + ρ p q,    2 p q (1 − ρ),        q = 1 − p.

The counts of the three over the base rows are multinomial. An interval consists of the correlations
0 ≤ ρ ≤ 1 that the ratio of likelihoods does not exclude, with the best p for each (the common
correlation model of A. Donner, M. Eliasziw, Stat. Med. 11, 1992, 1511–1519). It is the whole range
if no pair has the rare value.
"""

from __future__ import annotations

import numpy as np
from scipy import special

from .jackknife import Floats, IndexEstimates

_HALVINGS = 34  # of a range of 1: to 1e-10


def intervals(y: Floats, confidence: float) -> tuple[IndexEstimates, IndexEstimates]:
    """First-order and total indices with intervals, all from 0 to 1.

    Parameters
    ----------
    y
        Responses of 0 or 1; shape (…, rows, columns + 2), as in `jackknife.indices`.
    """
    swapped = y[..., 1:-1]
    first = correlation(swapped, y[..., -1:], confidence)
    same = correlation(y[..., :1], swapped, confidence)
    return first, IndexEstimates(1 - same.value, 1 - same.high, 1 - same.low)


def correlation(one: Floats, other: Floats, confidence: float) -> IndexEstimates:
    """The correlation of pairs of values, from 0 to 1, with its interval; pairs along axis −2."""
    counts = np.stack([
        (one * other).sum(axis=-2), (one != other).sum(axis=-2),
        ((1 - one) * (1 - other)).sum(axis=-2),
    ])  # fmt: skip
    n = one.shape[-2]
    p = (counts[0] + counts[1] / 2) / n
    with np.errstate(invalid="ignore"):
        value = np.clip(1 - counts[1] / n / (2 * p * (1 - p)), 0.0, 1.0)
    value = np.where(np.isfinite(value), value, 0.0)
    worst = _likelihood(value, counts) - special.stdtrit(n - 1, (1 + confidence) / 2) ** 2 / 2
    ends = []
    for end in (0.0, 1.0):
        outside, inside = np.full_like(value, end), value
        for _ in range(_HALVINGS):
            middle = (outside + inside) / 2
            good = _likelihood(middle, counts) >= worst
            inside, outside = np.where(good, middle, inside), np.where(good, outside, middle)
        ends.append(np.where(_likelihood(np.full_like(value, end), counts) >= worst, end, inside))
    return IndexEstimates(value, *ends)


def _likelihood(rho: Floats, counts: Floats) -> Floats:
    """Log likelihood of a correlation at the best p; it is concave in p."""
    both, either, none = counts
    low, high = np.zeros_like(rho), np.ones_like(rho)
    for _ in range(_HALVINGS):
        p = (low + high) / 2
        q = 1 - p
        slope = (
            (both + either) / p - (none + either) / q
            + both * (1 - rho) / (rho + (1 - rho) * p) - none * (1 - rho) / (rho + (1 - rho) * q)
        )  # fmt: skip
        low, high = np.where(slope > 0, p, low), np.where(slope > 0, high, p)
    p = (low + high) / 2
    q = 1 - p
    return (
        special.xlogy(both, p * (rho + (1 - rho) * p))
        + special.xlogy(either, 2 * p * q * (1 - rho))
        + special.xlogy(none, q * (rho + (1 - rho) * q))
    )
