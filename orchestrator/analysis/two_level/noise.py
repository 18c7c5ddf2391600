"""The noise of a response: pure error, lack of fit, and Lenth's method."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from ...errors import ConfigurationError
from ..common.centred import group_means
from ..common.model import Floats


@dataclass(frozen=True, slots=True)
class FTest:
    """An F test.

    Attributes
    ----------
    estimate
        Estimate of the tested quantity if it is a single number; otherwise NaN.
    ss
        Sum of squares of the tested quantity.
    df, df_error
        Degrees of freedom; corrected ones are not whole numbers.
    f, p
        Statistic, and probability of a larger one under the null hypothesis.
    """

    estimate: float
    ss: float
    df: float
    df_error: float
    f: float
    p: float


@dataclass(frozen=True, slots=True)
class Lenth:
    """Lenth's pseudo standard error, margin of error and simultaneous margin of error.

    All have the unit of an effect; `df` belongs to the margins.
    """

    pse: float
    me: float
    sme: float
    df: float


def lenth(effects: Floats, confidence: float = 0.95) -> Lenth:
    """Lenth's pseudo standard error and margins, from effects that are mostly noise.

    s₀ = 1.5 median|c|, PSE = 1.5 median of those |c| below 2.5 s₀, ME = t(1−α/2, m/3) PSE and
    SME = t(γ, m/3) PSE with γ = (1 + (1−α)^(1/m))/2 for m effects c.

    Raises
    ------
    ConfigurationError
        There are fewer than three effects.
    """
    size = np.abs(effects)
    m = len(size)
    if m < 3:
        raise ConfigurationError(
            f"runs: must be more than the terms of the model, or the terms at least 3, got {m} "
            "terms and no run to spare"
        )
    s0 = 1.5 * np.median(size)
    # If several effects are exactly zero, s0 may be zero, too. Then only these count as small.
    small = size[size < 2.5 * s0] if s0 > 0 else size[size == 0]
    pse = 1.5 * float(np.median(small))
    df = m / 3
    at_once = (1 + confidence ** (1 / m)) / 2
    me, sme = (pse * float(stats.t.ppf(q, df)) for q in ((1 + confidence) / 2, at_once))
    return Lenth(pse, me, sme, df)


def cleared(values: Any, least: float) -> Floats:
    """The values, with zeros for rounding noise."""
    return np.where(np.abs(values) < least, 0.0, values)


def pure_error(y: Floats, point_of_run: NDArray[np.intp]) -> float:
    """Sum of squares of the runs about the means of their points."""
    return float(((y - group_means(point_of_run, y)[point_of_run]) ** 2).sum())


def lack_of_fit(pure: float, df_error: int, df: int, lack: float, least: float) -> FTest | None:
    """Test the scatter of the points' means about the model against that of the runs about them.

    Both are sums of squares; smaller values than `least` are rounding noise.
    """
    if df <= 0 or df_error <= 0:
        return None
    pure, ss = (float(cleared(value, least)) for value in (pure, lack))
    if not pure and not ss:
        return None
    f = (ss / df) / (pure / df_error) if pure else np.inf
    return FTest(np.nan, ss, df, df_error, f, float(stats.f.sf(f, df, df_error)))


def lack_over_replicates(by_replicate: Floats, x: Floats, least: float) -> FTest | None:
    """Lack of fit for correlated runs, from the contrasts that the model leaves out, by replicate.

    A repeated-measures F test with Greenhouse and Geisser's ε = tr(S)² / (m tr(S²)), where S is
    the covariance of the m contrasts over the replicates.
    """
    number, points = by_replicate.shape
    m = points - x.shape[1]
    if m <= 0:
        return None
    contrasts = by_replicate @ np.linalg.qr(x, mode="complete")[0][:, x.shape[1]:]
    mean = contrasts.mean(axis=0)
    around = contrasts - mean
    trace = float((around**2).sum()) / (number - 1)
    # tr(S²) from the smaller of the two products
    gram = around @ around.T if number < m else around.T @ around
    square = float((gram**2).sum()) / (number - 1) ** 2
    ss = number * float((mean**2).sum())
    if trace < m * least**2:
        return None
    df = trace**2 / square
    f = ss / trace
    return FTest(np.nan, ss, df, df * (number - 1), f, float(stats.f.sf(f, df, df * (number - 1))))
