"""Upper bounds of a mean, a share and a percentile, each at a given risk.

The bound of the mean holds for skewed runs. For runs that are all at most B, it is the quantile
1 − risk of Σ wᵢ xᵢ, where the n runs and B have weights from the flat Dirichlet distribution
(N. Gaffke, Math. Methods Statist. 14, 2005, 451–467; Learned-Miller and Thomas, arXiv:1905.06208).
For runs with two values it is Clopper and Pearson's. B is unknown. It is assumed to be twice as far
from the median as the worst run seen. With wᵢ = Eᵢ/ΣE for exponential E, P(Σ wᵢ xᵢ > t) is
P(Σ Eᵢ (xᵢ − t) > 0), by Lugannani and Rice's saddlepoint formula (Adv. Appl. Prob. 12, 1980,
475–490).
"""

from __future__ import annotations

from math import ceil, inf, log

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special, stats

Floats = NDArray[np.float64]
TOLERANCE = 1e-9
"""Tolerance where a number of runs is rounded up."""
LEAST_RUNS = 3
"""Fewest runs for the bound of a mean, whatever the contamination."""
REACH = 2.0
"""Assumed largest distance of a run from the median, in units of the worst run's distance."""


def runs_to_see(share: float, risk: float) -> int:
    """Number of runs that include a bad one, given the share of bad runs, except for this risk.

    n = ln(risk)/ln(1 − share), as (1 − share)ⁿ ≤ risk: 59 for a share and a risk of 5 %.
    """
    return ceil(log(risk) / log(1 - share) - TOLERANCE)


def runs_for_t(skewness: float) -> int:
    """Approximate number of skewed runs above which t intervals of a mean hold.

    n = 25 g² (Cochran, Sampling Techniques, 3rd edition, 1977, section 2.15).
    """
    return ceil(25 * skewness**2 - TOLERANCE)


def mean_bound(y: Floats, risk: float) -> tuple[float, float]:
    """Mean of the runs, in ascending order, and its upper bound."""
    if len(y) == 0:
        return inf, inf
    mean, median = float(y.mean()), float(np.median(y))
    if len(y) < LEAST_RUNS:
        return mean, inf
    least, worst = float(y[0]), median + REACH * float(y[-1] - median)
    if least == worst:
        return mean, mean
    x = (np.append(y, worst) - least) / (worst - least)
    # θ = 0 is the mean of x, θ = 1 the worst run
    ends = (0.0, 1 - 1e-12) if risk < 0.5 else (-1e9, 0.0)
    theta = float(optimize.brentq(lambda theta: _weights(x, theta)[1] - risk, *ends, xtol=1e-15))
    return mean, least + (worst - least) * _weights(x, theta)[0]


def _weights(x: Floats, theta: float) -> tuple[float, float]:
    """A value t between the least and the largest x, and P(Σ Eᵢ (xᵢ − t) > 0).

    With dᵢ = xᵢ − t, K(s) = −Σ ln(1 − s dᵢ) has its saddlepoint K′(s) = 0 at s = θ/(1 − θ t) for
    t = Σ vᵢ xᵢ / Σ vᵢ, vᵢ = 1/(1 − θ xᵢ). So θ gives both without an equation to solve.
    """
    v = 1 / (1 - theta * x)
    t = float((v * x).sum() / v.sum())
    scale = 1 - theta * t
    w = float(np.sign(theta)) * float(np.sqrt(max(0.0, -2 * np.log(v * scale).sum())))
    u = theta * float(np.sqrt((((x - t) * v) ** 2).sum()))
    if abs(w) < 1e-4:
        return t, 0.5
    return t, float(special.ndtr(-w) + np.exp(-w * w / 2) / np.sqrt(2 * np.pi) * (1 / u - 1 / w))


def share_bound(count: int, runs: int, risk: float) -> float:
    """Clopper and Pearson's upper bound of a share."""
    return 1.0 if count == runs else float(stats.beta.isf(risk, count + 1, runs - count))


def share_interval(count: int, runs: int) -> tuple[float, float]:
    """Clopper and Pearson's 95 % interval of a share."""
    return 1 - share_bound(runs - count, runs, 0.025), share_bound(count, runs, 0.025)


def percentile_bound(y: Floats, share: float, risk: float) -> tuple[float, float]:
    """The run at a percentile, by rank, and an upper bound of the percentile.

    The runs are in ascending order.
    """
    n = len(y)
    estimate = float(y[ceil(share * n - TOLERANCE) - 1])
    # the smallest of k = 1 … n with P(Binomial(n, share) ≥ k) ≤ risk
    enough = stats.binom.sf(np.arange(n), n, share) <= risk
    return estimate, float(y[enough.argmax()]) if enough.any() else inf
