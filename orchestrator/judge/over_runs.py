"""What the RMS error over several runs is: one definition, for all that prints one.

It is the root of the mean over the runs of their mean squares. A run counts once, however many
estimates it has, as a seed is one observation. The mean of the runs' RMS is less, by the more, the
more the runs differ. Where the response of a run is analysed (effects, differences, percentiles
over runs), that is the run's own RMS, and its mean is called a mean of the runs' RMS.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

Floats = NDArray[np.float64]
SUFFIX = "_rms_m"
"""What the columns of RMS errors end with."""


def rms_over_runs(squares: Floats) -> float:
    """RMS error over runs [m], from the mean square of each [m²]."""
    return float(np.sqrt(squares.mean()))


def pooled(rms: Floats) -> float:
    """RMS error over runs [m], from that of each [m]; NaN: it has failed, and is left out."""
    known = rms[np.isfinite(rms)]
    return rms_over_runs(known**2) if len(known) else np.nan


def pooled_by(rms: pd.Series[float], groups: pd.Series[int]) -> pd.Series[float]:
    """`pooled` for each group of runs [m]."""
    roots: pd.Series[float] = (rms**2).groupby(groups).mean() ** 0.5
    return roots
