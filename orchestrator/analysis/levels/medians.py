"""Medians of the levels of factors, with intervals for any distribution of the runs.

The intervals come from order statistics (`place_of_bound`). Runs of several cells scatter less than
these assume (Hoeffding, Annals of Mathematical Statistics 27, 1956, 713–721), which is on the safe
side. With common random numbers, replicates are independent and runs are not. Then n is the number
of replicates, and the bounds are at the same shares of all runs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from ...judge.consistency import place_of_bound
from ..common.model import Floats
from ..common.options import Options


def median_table(
    data: pd.DataFrame,
    levels: Mapping[str, Sequence[object]],
    response: str,
    options: Options,
) -> pd.DataFrame:
    """Median of all runs at each level: ``factor``, ``level``, ``median``, ``low``, ``high``, and
    the bounds that hold for all levels of the factor at once: ``all_low``, ``all_high``.

    Bounds are NaN where there are too few runs.

    Parameters
    ----------
    data
        Runs with the number of each factor's level, and the response.
    levels
        All levels of each factor, in the order of their numbers.
    """
    common = options.seeding == "common"
    rows = []
    for name, known in levels.items():
        for number, own in data.groupby(name, sort=True):
            y = np.sort(own[response].to_numpy(np.float64))
            n = own[options.replicate].nunique() if common else len(y)
            alone = median_interval(y, n, options.confidence)
            together = median_interval(y, n, 1 - (1 - options.confidence) / data[name].nunique())
            rows.append((name, known[int(str(number))], float(np.median(y)), *alone, *together))
    columns = ["factor", "level", "median", "low", "high", "all_low", "all_high"]
    return pd.DataFrame(rows, columns=columns).astype({"level": object})


def median_pairs(
    pairs: pd.DataFrame, medians: pd.DataFrame, each: Mapping[str, Floats] | None, confidence: float
) -> pd.DataFrame:
    """Differences of the medians of pairs of levels, with intervals that hold all at once.

    Independent runs: if the bounds of all levels of a factor hold, so do those of all differences:
    the lower bound of one level minus the upper bound of the other, and vice versa. Common random
    numbers: order statistics give the median of the differences between two runs of a replicate
    that share the levels of all other factors.

    Parameters
    ----------
    pairs
        ``factor``, ``one``, ``other``.
    each
        With common random numbers, the runs by factor; shape (replicates, levels) or (replicates,
        levels, combinations of the others' levels), NaN where there is no run.
    """
    rows: list[tuple[float, float, float]] = []
    for factor, own in medians.groupby("factor", sort=False):
        place = {level: i for i, level in enumerate(own["level"])}
        mine = pairs[pairs["factor"] == factor]
        middle, low, high = own[["median", "all_low", "all_high"]].to_numpy(np.float64).T
        for i, j in ((place[a], place[b]) for a, b in zip(mine["one"], mine["other"], strict=True)):
            if each is None:
                rows.append((middle[i] - middle[j], low[i] - high[j], high[i] - low[j]))
                continue
            runs = each[str(factor)]
            gaps = np.sort((runs[:, i] - runs[:, j]).ravel())
            gaps = gaps[~np.isnan(gaps)]
            risk = (1 - confidence) / len(mine)
            rows.append((float(np.median(gaps)), *median_interval(gaps, len(runs), 1 - risk))
                        if len(gaps) else (np.nan, np.nan, np.nan))
    return pd.DataFrame(rows, columns=["difference", "low", "high"], index=pairs.index)


def median_interval(y: Floats, n: int, confidence: float) -> tuple[float, float]:
    """Bounds of the median of runs in ascending order, n of which are independent.

    NaN if n is too small.
    """
    k = place_of_bound(n, confidence)
    if k == 0:
        return np.nan, np.nan
    place = k if n == len(y) else max(1, k * len(y) // n)
    return float(y[place - 1]), float(y[-place])
