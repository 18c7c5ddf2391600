"""First-order and total indices of base rows, and their intervals by the jackknife over rows.

The estimators are Saltelli's of 2010 and Jansen's (A. Saltelli et al., Comput. Phys. Commun. 181,
2010, 259–270, Table 2 (b) and (f)). First the mean of all responses is subtracted, because
Saltelli's estimator scatters more if the responses are far from zero.

An interval is the estimate ± t·s. The standard error s comes from the jackknife over base rows (B.
Efron, The Jackknife, the Bootstrap and Other Resampling Plans, 1982, chapter 3). Totals are
positive and skewed, so their interval is that of the logarithm. With few rows, or few that matter,
s is uncertain too. Student's t therefore has Satterthwaite's degrees of freedom (Biometrics Bull.
2, 1946, 110–114), 2 E(s²)²/Var(s²) = 2 n/(κ − 1 + 2/(n − 1)), and at most n − 1. Here κ is the
kurtosis of the n values without a row.

The jackknife does not know rows that a sample happens to lack. If few runs lie beyond a step, no
row may have two of them, and s is far too small. A ratio of likelihoods does not exclude that such
rows have the share w = 1 − exp(−t²/2n), as in `two_values` (empirical likelihood, A. B. Owen,
Biometrika 75, 1988, 237–249). Each interval therefore reaches at least to the estimate with such
rows. Let w d² be q times the variance, where d is the distance of their runs from the mean.

- The runs at A and with one column from B are both far and alike: a total index T becomes
  T/(1 + q).
- A column has had no effect so far, and moves one run: T becomes q/(2 + q).
- The runs at B and with one column from B are alike: a first-order index S becomes
  1 − (1 − S)/(1 + q), but at most the total index.

For totals, d is the distance of the farthest run. For first-order indices it is the root mean
square distance of the farthest share w of all runs. With the farthest run, their intervals would be
much wider where factors interact.

`tests/unit/orchestrator/test_coverage.py` measures how often such intervals hold the index.

The functions accept further leading axes, for many samples at once.
"""

from __future__ import annotations

from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

Floats = NDArray[np.float64]


class IndexEstimates(NamedTuple):
    """Indices of all columns, with their intervals; the shape of each is (…, columns)."""

    value: Floats
    low: Floats
    high: Floats

    def inside(self) -> IndexEstimates:
        """The same, limited to the range of an index, from 0 to 1."""
        return IndexEstimates(*(np.clip(ends, 0.0, 1.0) for ends in self))

    def within(self, low: Floats, high: Floats) -> IndexEstimates:
        """The values, moved into given intervals, with these."""
        return IndexEstimates(np.clip(self.value, low, high), low, high)


def indices(y: Floats, confidence: float) -> tuple[IndexEstimates, IndexEstimates]:
    """First-order and total indices with intervals, all from 0 to 1.

    Parameters
    ----------
    y
        Responses, which vary over the runs at A and B; shape (…, rows, columns + 2): at A, with
        each column alone from B, at B.
    """
    y = scaled(y)
    y = y - y.mean(axis=(-2, -1), keepdims=True)
    y /= y.std(axis=(-2, -1), keepdims=True)
    a, b = y[..., 0], y[..., -1]
    mean, mean_left = _means(y.mean(axis=-1))
    middle, middle_left = _means((a + b) / 2)
    square, square_left = _means((a * a + b * b) / 2)
    variance, variance_left = square - middle**2, square_left - middle_left**2
    first, total = [], []
    for i in range(1, y.shape[-1] - 1):
        change = y[..., i] - a
        product, product_left = _means(b * change)
        step, step_left = _means(change)
        half, half_left = _means(change * change / 2)
        with np.errstate(divide="ignore", invalid="ignore"):
            first.append(_interval(
                (product - mean * step) / variance,
                (product_left - mean_left * step_left) / variance_left, confidence,
            ))  # fmt: skip
            total.append(_of_logarithm(half / variance, half_left / variance_left, confidence))
    rest = ((y[..., 1:-1] - y[..., -1:]) ** 2).mean(axis=-2) / 2 / variance
    far = (y * y).reshape(*y.shape[:-2], -1) / variance
    found = _with_the_unseen(_columns(first), _columns(total), rest, far, y.shape[-2], confidence)
    return found[0].inside(), found[1].inside()


def scaled(y: Floats) -> Floats:
    """Scale the values by a power of 2 to at most 1, so that squares neither over- nor underflow.

    Shape (…, rows, runs). The result is exact, except for values 2¹⁰⁰⁰ times less than the largest.
    """
    largest = np.abs(y).max(axis=(-2, -1), keepdims=True)
    return np.asarray(np.ldexp(y, -np.frexp(largest)[1]))


def _with_the_unseen(
    first: IndexEstimates,
    total: IndexEstimates,
    rest: Floats,
    far: Floats,
    rows: int,
    confidence: float,
) -> tuple[IndexEstimates, IndexEstimates]:
    """Intervals that reach to the estimates with rows that the sample may lack; see above.

    Parameters
    ----------
    rest
        One minus the first-order indices, from the runs that share a column with B; shape
        (…, columns).
    far
        Squared deviations of all runs in units of the variance; shape (…, runs).
    """
    share = -np.expm1(-special.stdtrit(rows - 1, (1 + confidence) / 2) ** 2 / (2 * rows))
    number = ceil(share * far.shape[-1])
    farthest = np.partition(far, -number, axis=-1)[..., -number:]
    most = share * farthest.max(axis=-1, keepdims=True)
    many = share * farthest.mean(axis=-1, keepdims=True)
    still = total.value == 0
    high = np.where(still, most / (2 + most), np.minimum(total.high, 1.0))
    first_high = np.where(still, high, np.minimum(1 - rest / (1 + many), high))
    return (
        IndexEstimates(first.value, first.low, np.maximum(first.high, first_high)),
        IndexEstimates(total.value, np.minimum(total.low, total.value / (1 + most)), high),
    )


def _means(values: Floats) -> tuple[Floats, Floats]:
    """Mean over the rows, and the means without each row; the shapes are (…, 1) and (…, rows)."""
    n = values.shape[-1]
    total = values.sum(axis=-1, keepdims=True)
    return total / n, (total - values) / (n - 1)


def _columns(estimates: list[IndexEstimates]) -> IndexEstimates:
    """Combine estimates of shape (…, 1) into one array."""
    return IndexEstimates(*(np.concatenate(ends, axis=-1) for ends in zip(*estimates, strict=True)))


def _interval(value: Floats, left: Floats, confidence: float) -> IndexEstimates:
    """Student's interval from the values without each row; shape (…, rows).

    It is infinite if one of them is not finite, because then a single row has all the effect.
    """
    n = left.shape[-1]
    squares = (left - left.mean(axis=-1, keepdims=True)) ** 2
    total = squares.sum(axis=-1, keepdims=True)
    kurtosis = n * (squares**2).sum(axis=-1, keepdims=True) / total**2
    freedom = np.minimum(n - 1.0, 2 * n / (kurtosis - 1 + 2 / (n - 1)))
    error = np.sqrt(total * (n - 1) / n)
    reach = special.stdtrit(freedom, (1 + confidence) / 2) * error
    reach = np.where(total == 0, 0.0, np.where(np.isfinite(reach), reach, np.inf))
    return IndexEstimates(value, value - reach, value + reach)


def _of_logarithm(value: Floats, left: Floats, confidence: float) -> IndexEstimates:
    """Student's interval on the logarithmic scale; zero if no row shows a change."""
    log = _interval(np.log(value), np.log(left), confidence)
    ends = (np.where(value == 0, 0.0, np.exp(end)) for end in (log.low, log.high))
    return IndexEstimates(value, *ends)
