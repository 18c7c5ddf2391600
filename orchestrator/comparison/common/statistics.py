"""Statistics of paired runs: intervals of means, differences, and the runs that a bound takes.

A seed is one observation. Runs with one seed have the same noise, so their differences are paired.
The errors within a run are correlated and are never pooled: every interval uses one number per
seed.

**Shares.** The share of all dives in which a receiver is better needs no assumption. Its lower
bound is Clopper and Pearson's, from the number of runs in which the receiver was better. The
receiver is called better if the sign test of the runs in which the two differ says so (Conover,
Practical Nonparametric Statistics, 3rd edition, 1999, section 3.4).

**Medians.** The interval of the median difference uses order statistics. It needs no assumption.

**Means.** Each side of a mean's interval is the bound of `sblcosim.analysis.common.bounds`, which
is valid for skewed runs and for outliers. No bound of a mean covers bad runs that were never seen.
The interval therefore holds for a stated share c of contamination: if bad runs are at least this
share, one has been seen. That takes n = ln(risk)/ln(1 − c) runs, as (1 − c)ⁿ ≤ risk. There is no
interval with fewer runs, with heavy tails, or where a receiver has failed.

**Simultaneous.** All statements about the pairs of a response hold at once, whatever their
dependence, so a pair that is picked after a look at all of them is judged fairly. Of m pairs each
has the risk α/m (Bonferroni). Half of it is for the share of dives, and a quarter each for the
intervals of the median and of the mean. If neither receiver is better, the sign test may err on
either side, and takes all of the risk: the interval of the median then errs only where the test
does, and there is no statement about share and mean unless the test errs.

**Percentiles** over the runs have exact bounds from order statistics. Shares of lost runs have
Clopper and Pearson's.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from math import ceil, floor, inf, isfinite, log, log10, nan, sqrt
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from ...analysis.common.bounds import (
    LEAST_RUNS,
    TOLERANCE,
    mean_bound,
    percentile_bound,
    share_bound,
)
from ...analysis.common.centred import centred
from ...analysis.levels.medians import median_interval
from ...judge.definitions import CONFIDENCE

Floats = NDArray[np.float64]
Word = Literal["better", "worse", "equal", "undecided"]

ALPHA = 1 - CONFIDENCE
"""Risk of all simultaneous statements together."""
CONTAMINATION = 0.05
"""Default share of bad runs against which a mean must hold."""
SHARE = 0.95
"""Share of the runs that the bound of a percentile covers."""
TAIL_RUNS = 0.05
"""Share of the runs, the worst ones, that form the tail."""
TAIL_SPREAD = 2 / 3
"""The tail is heavy if it makes up more than this share of the squares about the median. The share
is 0.22 for a normal distribution and 0.54 for an exponential one."""
MOST_RUNS = 10**9
"""Largest number of runs that is recommended."""


def least_runs(share: float, risk: float) -> int:
    """Number of runs that show a bad one, given the share of bad runs, except for the risk."""
    return max(LEAST_RUNS, ceil(log(risk) / log(1 - share) - TOLERANCE))


def mean_interval(values: Floats, risk: float) -> tuple[float, float, float]:
    """Mean of the finite values, and its lower and upper bound, each at the risk.

    Parameters
    ----------
    values
        One per seed; infinite where a receiver failed, NaN where nothing is known.
    """
    values = values[~np.isnan(values)]
    finite = values[np.isfinite(values)]
    if len(finite) < LEAST_RUNS:
        return (float(finite.mean()) if len(finite) else nan), -inf, inf
    y = np.sort(values)
    # A value that is infinite on the other side is placed where it does not improve the bound.
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
        Statistics of the others; NaN if there are none.
    low, high
        95 % interval of the mean; NaN with fewer runs than `least_runs`.
    within, within_upper
        The 95th percentile over the runs, where a failed run is worse than any other, and its 95 %
        upper bound (one-sided), infinite with fewer than 59 runs.
    tail, tail_runs
        Share of the squares about the median that comes from the worst runs, 1 in 20 (NaN with
        fewer than 20 runs, or if all are 0 or 1), and the number of these runs.
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
        """Whether few runs dominate the mean."""
        return self.tail > TAIL_SPREAD

    def to_json(self) -> dict[str, Any]:
        """As plain data."""
        return {**asdict(self), "heavy_tailed": self.heavy}


def level(values: Floats, contamination: float = CONTAMINATION) -> Level:
    """Describe the values of some runs; NaN: the receiver failed."""
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
    std = float(centred(y).off.std(ddof=1)) if len(y) > 1 else nan
    median = float(np.median(y))
    tail, worst = _tail(y)
    return Level(
        n, failed, mean, std, median, float(y[0]), float(y[-1]), low, high, within, upper,
        nan if np.isin(y, (0.0, 1.0)).all() else tail, worst,
    )  # fmt: skip


def _tail(y: Floats) -> tuple[float, int]:
    """Share of the squares about the median that comes from the worst runs, and their number.

    The runs are in ascending order.
    """
    worst = ceil(TAIL_RUNS * len(y) - TOLERANCE)
    squares = (y - np.median(y)) ** 2
    total = float(squares.sum())
    known = len(y) >= 1 / TAIL_RUNS and 0 < total < inf
    return (float(squares[-worst:].sum()) / total if known else nan), worst


@dataclass(frozen=True)
class Difference:
    """A paired difference, one receiver minus another; less is better.

    Attributes
    ----------
    runs
        Number of seeds.
    wins, losses
        Number of runs in which the first receiver is better, and worse. In the others the two are
        equal, or both failed.
    verdict
        Verdict on the first receiver. ``equal``: the interval of the median lies within ± the
        practical difference, no run failed and there are no outliers. Otherwise ``better`` or
        ``worse`` if the sign test says so, else ``undecided``.
    share_low
        Lower bound of the share of all dives in which the better receiver is better; NaN if neither
        surely is.
    median, low, high
        Median difference and its interval; infinite where failed runs count, NaN with too few runs.
    mean
        Mean over the runs that both have; NaN if there are none.
    mean_low, mean_high
        Interval of the mean; NaN where its assumptions do not hold, or the verdict is undecided.
    least, mean_least
        Smallest number of runs for a verdict, and for an interval of the mean.
    runs_needed
        Estimated number of runs for a decision; None if there is no estimate.
    """

    runs: int
    wins: int
    losses: int
    verdict: Word
    share_low: float
    median: float
    low: float
    high: float
    mean: float
    mean_low: float
    mean_high: float
    least: int
    mean_least: int
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
        Shape (runs,); NaN where the receiver failed, which is worse than any number.
    comparisons
        Number of comparisons that must hold simultaneously.
    practical
        Median differences below this do not matter; None: nothing is called equal.
    contamination
        Share of bad runs against which an interval of the mean must hold.
    """
    failed, other_failed = ~np.isfinite(one), ~np.isfinite(other)
    with np.errstate(invalid="ignore"):
        d = np.where(failed, inf, one) - np.where(other_failed, inf, other)  # NaN: both failed
    wins, losses = int((d < 0).sum()), int((d > 0).sum())
    risk = ALPHA / (2 * comparisons)
    own = risk / 4  # for an interval, on each side
    y = np.sort(d[~np.isnan(d)])
    low, high = median_interval(y, len(y), 1 - 2 * own) if len(y) else (nan, nan)
    verdict = _verdict(d, low, high, practical, risk)
    sure = max(wins, losses) if _told(wins, losses, risk) else 0
    mean, mean_low, mean_high = mean_interval(d, own)
    mean_least = least_runs(contamination, own)
    if verdict == "undecided" or len(d) < mean_least or not _alike(d):
        mean_low = mean_high = nan
    return Difference(
        len(d), wins, losses, verdict,
        1 - share_bound(len(d) - sure, len(d), risk) if sure else nan,
        _middle(y), low, high, mean, mean_low, mean_high, least_verdict(risk), mean_least,
        _needed(d, low, high, practical, risk) if verdict == "undecided" else None,
    )  # fmt: skip


def least_verdict(risk: float) -> int:
    """Number of runs, all better, from which a sign test decides: ½ⁿ ≤ risk."""
    return ceil(log(risk) / log(0.5) - TOLERANCE)


def _told(wins: int, losses: int, risk: float) -> bool:
    """Whether the sign test decides, at the risk on each side."""
    return bool(stats.binom.cdf(min(wins, losses), wins + losses, 0.5) <= risk)


def _verdict(d: Floats, low: float, high: float, practical: float | None, risk: float) -> Word:
    near = practical is not None and -practical <= low and high <= practical
    if near and _alike(d):  # a receiver that is lost in some runs is not equal to one that is not
        return "equal"
    wins, losses = int((d < 0).sum()), int((d > 0).sum())
    if not _told(wins, losses, risk):
        return "undecided"
    return "better" if wins > losses else "worse"


def _middle(y: Floats) -> float:
    """Median of differences in ascending order, which may be infinite."""
    if not len(y):
        return nan
    pair = y[(len(y) - 1) // 2], y[len(y) // 2]
    return float(pair[0] if pair[0] == pair[1] else sum(pair) / 2)


def _alike(d: Floats) -> bool:
    """Whether no run has failed and the differences have no outliers."""
    whole = bool(np.isfinite(d).all())
    return whole and not any(_tail(np.sort(sign * d))[0] > TAIL_SPREAD for sign in (1, -1))


def _needed(
    d: Floats, low: float, high: float, practical: float | None, risk: float
) -> int | None:
    """Estimated runs until the verdict is reached in five of six comparisons like this one.

    The sign test uses the share of wins among the runs that differ, and its standard error. The
    interval of the median shrinks with √n; the estimate uses its reach with one standard error.
    """
    n, wins, losses = len(d), int((d < 0).sum()), int((d > 0).sum())
    if n < LEAST_RUNS:
        return None
    likely = float(stats.norm.ppf(5 / 6))
    found = []
    if wins != losses:
        told = wins + losses
        share = max(wins, losses) / told
        reach = float(stats.norm.isf(risk)) / 2 + likely * sqrt(share * (1 - share))
        found.append(max((reach / (share - 0.5)) ** 2, least_verdict(risk)) * n / told)
    if practical is not None and isfinite(low) and isfinite(high):
        middle = _middle(np.sort(d[~np.isnan(d)]))
        if abs(middle) < practical:
            chance = likely * (high - low) / 2 / float(stats.norm.isf(risk / 4))
            above, below = high - middle + chance, middle - low + chance
            found.append(
                n * max(above / (practical - middle), below / (practical + middle)) ** 2
            )
    if not found or min(found) > MOST_RUNS:
        return None
    return max(least_verdict(risk), rounded_up(min(found)))


def rounded_up(number: float) -> int:
    """A number of runs, rounded up to two significant digits."""
    if number < 1:
        return 1
    unit: int = 10 ** max(floor(log10(number)) - 1, 0)
    return ceil(number / unit - TOLERANCE) * unit
