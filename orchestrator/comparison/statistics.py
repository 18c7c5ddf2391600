"""Statistics of paired runs: intervals of means, differences, and how many runs a bound takes.

A seed is one observation. Runs of one seed have the same noise, so their differences are paired,
and the errors inside of a run follow each other, so they are never pooled: an interval is always
from one number per seed.

**Means.** An interval of a mean has on each side the bound of `sblcosim.analysis.bounds`, which
holds for skewed runs and for outliers. No bound of a mean holds against bad runs that were never
seen. So it is a statement for a stated share c of contamination: bad runs that are at least this
share have been seen, for which n = ln(risk)/ln(1 − c) runs are needed, as (1 − c)ⁿ ≤ risk; with
fewer there is no interval. A run in which a receiver has failed is worse than any other.

**Simultaneous.** All differences of a comparison hold at once (Bonferroni: each at α/m), whatever
their dependence; so who is picked out after a look at all of them is judged fairly.

**Shares and percentiles** over the runs have exact bounds: Clopper and Pearson's, and order
statistics.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from math import ceil, floor, inf, isfinite, log, log10, nan, sqrt
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..analysis.bounds import LEAST_RUNS, TOLERANCE, mean_bound, percentile_bound, share_bound
from ..results.definitions import CONFIDENCE

Floats = NDArray[np.float64]
Word = Literal["better", "worse", "equal", "cannot tell"]

ALPHA = 1 - CONFIDENCE
"""Risk of all that is said at once."""
CONTAMINATION = 0.05
"""Default share of bad runs that a mean is to hold against."""
SHARE = 0.95
"""Share of the runs for which there is a bound."""
TAIL_RUNS = 0.05
"""Share of the runs, the worst ones, that make a tail."""
TAIL_SPREAD = 2 / 3
"""If those make more than this share of the squares about the median, the tail is heavy: of a
normal distribution it is 0.22, of an exponential one 0.54."""
MOST_RUNS = 10**9
"""More are never recommended."""


def least_runs(share: float, risk: float) -> int:
    """Number of runs that are needed for bad ones of such a share to be seen but for the risk."""
    return max(LEAST_RUNS, ceil(log(risk) / log(1 - share) - TOLERANCE))


def mean_interval(values: Floats, risk: float) -> tuple[float, float, float]:
    """Mean of the finite values, and a lower and an upper bound of the mean, each at the risk.

    Parameters
    ----------
    values
        One per seed; infinite where a receiver has failed, NaN where nothing can be said.
    """
    values = values[~np.isnan(values)]
    finite = values[np.isfinite(values)]
    if len(finite) < LEAST_RUNS:
        return (float(finite.mean()) if len(finite) else nan), -inf, inf
    y = np.sort(values)
    # What is infinite on the other side is put where it makes the bound no better.
    low = -inf if y[0] == -inf else 0.0 - mean_bound(-np.minimum(y, finite.max())[::-1], risk)[1]
    high = inf if y[-1] == inf else mean_bound(np.maximum(y, finite.min()), risk)[1]
    return float(finite.mean()), low, high


@dataclass(frozen=True)
class Level:
    """A response of one receiver over some runs.

    Attributes
    ----------
    runs, failed
        Number of runs, and of those without a response.
    mean, std, median, least, most
        Of the others; NaN without any.
    low, high
        95 % interval of the mean; NaN with fewer runs than `least_runs`.
    within, within_upper
        The 95th percentile over the runs, a failed one being worse than any, and its 95 % upper
        bound (one-sided), infinite with fewer than 59 runs.
    tail, tail_runs
        Share of the squares about the median that the worst runs make, 1 in 20 (NaN with fewer
        than 20 runs), and how many these are.
    """

    runs: int
    failed: int
    mean: float
    std: float
    median: float
    least: float
    most: float
    low: float
    high: float
    within: float
    within_upper: float
    tail: float
    tail_runs: int

    @property
    def heavy(self) -> bool:
        """Whether few runs make the mean."""
        return self.tail > TAIL_SPREAD

    def to_json(self) -> dict[str, Any]:
        """As plain data."""
        return {**asdict(self), "heavy_tailed": self.heavy}


def level(values: Floats, contamination: float = CONTAMINATION) -> Level:
    """Describe the values of some runs; NaN: the receiver has failed."""
    n = len(values)
    y = np.sort(values[np.isfinite(values)])
    failed = n - len(y)
    ranked = np.append(y, np.full(failed, inf))
    within, upper = percentile_bound(ranked, SHARE, ALPHA) if n else (nan, inf)
    if not len(y):
        return Level(n, failed, nan, nan, nan, nan, nan, nan, nan, within, upper, nan, 0)
    mean, low, high = mean_interval(np.where(np.isfinite(values), values, inf), ALPHA / 2)
    if n < least_runs(contamination, ALPHA / 2):
        low = high = nan
    std = float(y.std(ddof=1)) if len(y) > 1 else nan
    median = float(np.median(y))
    return Level(
        n, failed, mean, std, median, float(y[0]), float(y[-1]), low, high, within, upper, *_tail(y)
    )


def _tail(y: Floats) -> tuple[float, int]:
    """Share of the squares about the median that the worst runs make, and their number.

    The runs are in ascending order.
    """
    worst = ceil(TAIL_RUNS * len(y) - TOLERANCE)
    squares = (y - np.median(y)) ** 2
    total = float(squares.sum())
    known = len(y) >= 1 / TAIL_RUNS and 0 < total < inf
    return (float(squares[-worst:].sum()) / total if known else nan), worst


def share_interval(count: int, runs: int) -> tuple[float, float]:
    """Clopper and Pearson's 95 % interval of a share."""
    return 1 - share_bound(runs - count, runs, ALPHA / 2), share_bound(count, runs, ALPHA / 2)


@dataclass(frozen=True)
class Difference:
    """A paired difference, one receiver minus another; less is better.

    Attributes
    ----------
    runs
        Number of seeds.
    mean
        Of the runs that have both; NaN without any.
    low, high
        Interval that holds at once with all others of the comparison; infinite where there is no
        bound, NaN with fewer runs than `least`.
    wins
        Number of runs in which the first one is better.
    verdict
        Of the first one: ``better`` or ``worse`` if the interval leaves out 0, ``equal`` if it
        lies within ± the practical difference, else ``cannot tell``.
    least
        Number of runs that any interval takes.
    runs_needed
        Estimated number of runs that would tell; None if that cannot be said.
    """

    runs: int
    mean: float
    low: float
    high: float
    wins: int
    verdict: Word
    least: int
    runs_needed: int | None

    def to_json(self) -> dict[str, Any]:
        """As plain data."""
        return asdict(self)


def difference(
    one: Floats,
    other: Floats,
    comparisons: int = 1,
    practical: float | None = None,
    contamination: float = CONTAMINATION,
) -> Difference:
    """Compare two receivers by the responses of their runs, seed by seed.

    Parameters
    ----------
    one, other
        Shape (runs,); NaN where the receiver has failed, which is worse than any number.
    comparisons
        Number of comparisons that are to hold at once.
    practical
        Differences below it do not matter; None: nothing is called equal.
    contamination
        Share of bad runs that an interval is to hold against.
    """
    failed, other_failed = ~np.isfinite(one), ~np.isfinite(other)
    with np.errstate(invalid="ignore"):
        d = np.where(failed, inf, one) - np.where(other_failed, inf, other)  # NaN: both failed
    risk = ALPHA / (2 * comparisons)
    least = least_runs(contamination, risk)
    mean, low, high = mean_interval(d, risk)
    told = int((~np.isnan(d)).sum()) >= least
    verdict = _verdict(low, high, practical) if told else "cannot tell"
    needed = None if verdict != "cannot tell" else _needed(d, mean, low, high, practical, least)
    if not told:
        low = high = nan
    return Difference(len(d), mean, low, high, int((d < 0).sum()), verdict, least, needed)


def _verdict(low: float, high: float, practical: float | None) -> Word:
    if practical is not None and -practical <= low and high <= practical:
        return "equal"
    if high < 0:
        return "better"
    return "worse" if low > 0 else "cannot tell"


def _needed(
    d: Floats, mean: float, low: float, high: float, practical: float | None, least: int
) -> int | None:
    """Estimated runs until the interval, which shrinks with √n, tells in five of six comparisons.

    For this its reach is taken with one standard error of the mean.
    """
    finite = d[np.isfinite(d)]
    n = len(finite)
    if n < LEAST_RUNS or not (isfinite(low) and isfinite(high)):
        return None
    chance = float(finite.std(ddof=1)) / sqrt(n)
    above, below = high - mean + chance, mean - low + chance
    factors = []
    if mean != 0:
        factors.append((above if mean < 0 else below) / abs(mean))
    if practical is not None and abs(mean) < practical:
        factors.append(max(above / (practical - mean), below / (practical + mean)))
    if not factors or n * min(factors) ** 2 > MOST_RUNS:
        return None
    return max(least, rounded_up(n * min(factors) ** 2))


def rounded_up(number: float) -> int:
    """A number of runs with two digits that mean something, rounded up."""
    if number < 1:
        return 1
    unit: int = 10 ** max(floor(log10(number)) - 1, 0)
    return ceil(number / unit - TOLERANCE) * unit
