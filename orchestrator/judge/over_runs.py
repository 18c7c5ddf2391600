"""RMS error over several runs: one definition for the whole project.

It is the root of the mean over runs of their mean squares (pooled). Each run counts once, however
many estimates it has, because a seed is one observation. The mean of the runs' RMS errors is
smaller, the more so the more the runs differ. Where the response of a run is analysed (effects,
differences, percentiles over runs), it is the run's own RMS error, and its mean is called a mean of
the runs' RMS errors.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

Floats = NDArray[np.float64]
SUFFIX = "_rms_m"
"""Suffix of the columns of RMS errors."""


def rms_over_runs(squares: Floats) -> float:
    """RMS error over runs [m], from the mean square of each [m²]."""
    return float(np.sqrt(squares.mean()))


def pooled(rms: Floats) -> float:
    """RMS error over runs [m], from the RMS error of each [m]; failed runs (NaN) are left out."""
    known = rms[np.isfinite(rms)]
    return rms_over_runs(known**2) if len(known) else np.nan


def pooled_by(rms: pd.Series[float], groups: pd.Series[int]) -> pd.Series[float]:
    """`pooled` for each group of runs [m]."""
    roots: pd.Series[float] = (rms**2).groupby(groups).mean() ** 0.5
    return roots
