"""The smallest effect that an experiment can detect."""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy import optimize, stats

from ...errors import ConfigurationError
from .analysis import Factorial


def detectable(analysis: Factorial, power: float = 0.8) -> pd.Series[float]:
    """Smallest true effect of each term that the experiment detects with the given probability.

    The noncentral t distribution gives it, two-sided at the level of the analysis, with its
    standard errors and in units of the effects.
    """
    if not 0.5 <= power < 1:
        raise ConfigurationError(f"power: must be from 0.5 to below 1, got {power}")
    line, df = analysis.reference, analysis.df
    # The noncentral t distribution as a mean over quantiles of s/σ; SciPy's fails for large df.
    s = np.sqrt(stats.chi2.ppf((np.arange(4000) + 0.5) / 4000, df) / df)

    def missing(shift: float) -> float:
        detected = stats.norm.sf(line * s - shift) + stats.norm.cdf(-line * s - shift)
        return float(detected.mean()) - power

    shift = float(optimize.brentq(missing, 0.0, 10 * line + 10))
    return (shift * analysis.effects["std_error"]).rename("detectable")
