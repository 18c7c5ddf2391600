"""Whether a receiver's covariance is right: a verdict from the NEES of several runs.

If a receiver's covariance P is right, its mean NEES is the number of degrees of freedom, 3 for a
position. If the true covariance is f² P, it is f² times as much. Errors within a run are
correlated, so one run is one observation: its mean NEES m. Runs with different seeds are
independent.

**Interval.** For the mean M of n runs with standard deviation s, the 95 % interval is
M exp(± t s / (M √n)), with Student's t for n − 1 degrees of freedom. The t interval applies to the
logarithm, by the delta method, because means of squares are positive and skewed to the right. For
gamma-distributed run means (means of squares of normal errors are nearly so) it covers 91 to 95 %,
from 2 runs on, down to run means with one degree of freedom; with 3 it covers 94 %.

**Tails.** The mean says nothing if it is dominated by few runs, such as those in which a filter is
lost. Normal errors spread run means most if one error stays throughout each run: chi-square with
one degree of freedom. The largest of n run means may lie farther above their median than the
largest of n such values would in one study of 1000. Then the verdict uses the median, with its
interval from order statistics, and says how many runs lie so far above. For right covariances, the
median depends on the correlation time of the errors. It lies between the median of chi-square with
3 degrees of freedom, 2.37, and 3. Within this factor of 1.13 the median cannot decide.

**Number of runs.** Enough for the interval to exclude 3 in 9 studies of 10 if the standard
deviation is wrong by the factor `TELLING`.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..lazy import Module
from ..words.numbers import PRACTICAL_RUNS
from ..words.shares import rough_percent
from .definitions import CONFIDENCE, MANY_LOST

special = Module("scipy.special")

DEGREES = 3
"""Degrees of freedom of a position."""
TELLING = 1.1
"""Factor on the standard deviation that `Verdict.runs_needed` refers to."""
POWER = 0.9
"""Probability of detecting it."""
TAIL = 0.001
"""Probability that the largest of several run means of normal errors counts as far above."""
MOST_RUNS = 10**9
NEES_COLUMNS = {
    "absolute": "nees_position",
    "own_relative": "own_relative_nees_position",
}
"""Column of the NEES that judges a covariance, by frame."""
COVARIANCES = {
    "absolute": "covariance",
    "own_relative": "covariance relative to the platform",
}
"""Subject of the verdict, by frame."""


@dataclass(frozen=True)
class Verdict:
    """What several runs say about a receiver's covariance.

    Attributes
    ----------
    verdict
        ``in band``, ``optimistic`` (errors larger than claimed) or ``pessimistic``; ``one run``,
        which cannot decide; ``unknown``: there is no NEES, or a tail and too few runs.
    factor
        Estimated true standard deviation divided by the claimed one; above 1 is optimistic.
    runs
        Number of runs used: those with a NEES.
    mean_nees
        Mean over the runs.
    basis
        Statistic compared with 3: ``mean``, or ``median`` if few runs dominate the mean.
    centre, low, high
        That statistic and its 95 % interval; NaN without.
    runs_far_above
        Number of runs beyond what normal errors explain, given the median.
    runs_needed
        Number of runs to detect a factor of `TELLING`; None if their spread does not show it.
    lost_share
        Share of runs that end lost. If it exceeds `MANY_LOST`, a covariance that is not optimistic
        is ``unknown``: the covariances of the other runs say nothing about this receiver's.
    """

    verdict: str
    factor: float
    runs: int
    mean_nees: float
    basis: str
    centre: float
    low: float
    high: float
    runs_far_above: int = 0
    runs_needed: int | None = None
    lost_share: float = 0.0

    @property
    def by(self) -> float:
        """The factor by which it is wrong: at least 1."""
        if not self.factor > 0:
            return math.inf if self.factor == 0 else math.nan
        return max(self.factor, 1 / self.factor)

    @property
    def claim(self) -> str:
        """Claim from one run: the covariance is ``optimistic``, ``perhaps optimistic``,
        ``perhaps pessimistic``, or ``fits``.

        Only the first is certain: see `most_of_one_run`.
        """
        if self.mean_nees > most_of_one_run():
            return "optimistic"
        if self.by <= TELLING:
            return "fits"
        return f"perhaps {'optimistic' if self.factor > 1 else 'pessimistic'}"

    def to_json(self) -> dict[str, Any]:
        """The verdict as plain data, including the sentence."""
        return {**asdict(self), "words": str(self)}

    def __str__(self) -> str:
        if self.verdict == "one run":
            return f"{_looks(self)}; one run cannot tell, because its errors are correlated"
        if self.verdict == "unknown" and self.lost_share > MANY_LOST:
            if self.runs == 1:
                return "not judged: the run is lost"
            return f"not judged: {rough_percent(self.lost_share)} of the runs are lost"
        if self.verdict == "unknown":
            few = f": few of the {self.runs} runs dominate the mean"
            return "unknown" + (few if self.runs else "")
        wrong = "" if self.verdict == "in band" else f" by a factor of {_short(self.by)}"
        what = "mean NEES" if self.basis == "mean" else "median over runs of the mean NEES"
        text = (
            f"{self.verdict}{wrong} ({what} {_short(self.centre)}, 95 %: {_short(self.low)} to "
            f"{_short(self.high)}, {self.runs} runs)"
        )
        if self.basis == "median":
            runs = "1 run lies" if self.runs_far_above == 1 else f"{self.runs_far_above} runs lie"
            return f"{text}; {runs} far above and would dominate the mean, {_short(self.mean_nees)}"
        if self.verdict == "in band" and self.runs_needed and self.runs < self.runs_needed:
            text += f"; {_runs_that(self.runs_needed)} would detect a factor of {TELLING:g}"
        return text


def of_runs(mean_nees: ArrayLike, lost_share: float = 0.0) -> Verdict:
    """Judge a receiver's covariance from independent runs.

    Parameters
    ----------
    mean_nees
        Mean position NEES of each run; NaN for a run without NEES. Shape (runs,).
    lost_share
        Share of runs that end lost.
    """
    found = _of_runs(mean_nees)
    if lost_share > MANY_LOST and found.verdict != "optimistic":
        return replace(found, verdict="unknown", lost_share=lost_share)
    return replace(found, lost_share=lost_share)


def _of_runs(mean_nees: ArrayLike) -> Verdict:
    """The verdict if no run is lost."""
    values = np.asarray(mean_nees, np.float64).ravel()
    values = np.sort(values[~np.isnan(values)])
    n = len(values)
    mean = float(values.mean()) if n else math.nan
    if n < 2:
        word = "one run" if n else "unknown"
        return Verdict(word, _factor(mean, DEGREES), n, mean, "mean", mean, math.nan, math.nan)
    far = _far_above(values)
    if far:
        return _by_median(values, mean, far)
    spread = float(values.std(ddof=1)) / mean if mean > 0 else 0.0
    quantile = float(special.stdtrit(n - 1, (1 + CONFIDENCE) / 2))
    reach = math.exp(min(quantile * spread / math.sqrt(n), 700.0))  # where exp would overflow
    low, high = mean / reach, mean * reach
    word = _word(low, high, DEGREES, DEGREES)
    return Verdict(
        word, _factor(mean, DEGREES), n, mean, "mean", mean, low, high, runs_needed=_needed(spread)
    )


def most_of_one_run() -> float:
    """Mean NEES of one run that right covariances exceed in at most 1 run of 20.

    The errors of a run cannot be more correlated than one that stays constant.
    """
    return DEGREES * float(special.chdtri(1, 0.05))


def _far_above(values: NDArray[np.float64]) -> int:
    """Number of runs so far above the median that normal errors do not explain the farthest."""
    n = len(values)
    limit = np.median(values) * special.chdtri(1, TAIL / n) / special.chdtri(1, 0.5)
    return int((values > limit).sum())


def place_of_bound(n: int, confidence: float) -> int:
    """Rank k, from either end, of the order statistics that enclose the median of n runs.

    Among independent runs, the number below the median is binomial: k is the largest with
    P(Binomial(n, ½) < k) below half the risk (Thompson, Annals of Mathematical Statistics 7, 1936,
    122–128; Conover, Practical Nonparametric Statistics, 3rd edition, 1999, section 3.2). 0 if n is
    too small: 95 % needs 6.
    """
    return int((special.bdtr(np.arange(n), n, 0.5) < (1 - confidence) / 2).sum())


def _by_median(values: NDArray[np.float64], mean: float, far: int) -> Verdict:
    n, median = len(values), float(np.median(values))
    k = place_of_bound(n, CONFIDENCE)
    if k < 1:
        return Verdict(
            "unknown", math.nan, n, mean, "median", median, math.nan, math.nan, runs_far_above=far
        )
    low, high = float(values[k - 1]), float(values[n - k])
    # For a right covariance, the median of the run means is at least that of one sample's NEES.
    least = float(special.chdtri(DEGREES, 0.5))
    word = _word(low, high, least, DEGREES)
    right = min(max(median, least), DEGREES)
    return Verdict(
        word, _factor(median, right), n, mean, "median", median, low, high, runs_far_above=far
    )


def _word(low: float, high: float, least: float, most: float) -> str:
    if low > most:
        return "optimistic"
    return "pessimistic" if high < least else "in band"


def _factor(nees: float, expected: float) -> float:
    return math.sqrt(nees / expected)


def _needed(spread: float) -> int:
    """Smallest number of runs that detect a factor; `spread`: of run means, over their mean."""
    shift = 2 * math.log(TELLING)

    def tells(n: int) -> bool:
        quantiles = special.stdtrit(n - 1, (1 + CONFIDENCE) / 2) + special.stdtrit(n - 1, POWER)
        return bool(quantiles * spread <= shift * math.sqrt(n))

    low, high = 1, 2
    while not tells(high) and high < MOST_RUNS:
        low, high = high, 2 * high
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if tells(middle) else (middle, high)
    return high


def _runs_that(needed: int) -> str:
    if needed > PRACTICAL_RUNS:
        return f"no practical number of runs ({PRACTICAL_RUNS:,})"
    return f"{needed} runs"


def _looks(verdict: Verdict) -> str:
    if verdict.by <= TELLING:
        return "looks right"
    side = "optimistic" if verdict.factor > 1 else "pessimistic"
    return f"looks {side} by a factor of {_short(verdict.by)}"


def _short(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"
