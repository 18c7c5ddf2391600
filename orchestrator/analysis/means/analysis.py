"""One factor at a time: the mean response at each level, such as the error against the baseline."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from scipy import stats

from ...study.design import Number
from ...style import ThemeName, new_figure, use
from ..common.centred import centred
from .tables import MEANS


def means(
    table: pd.DataFrame,
    factors: Sequence[str],
    response: str,
    base: Sequence[Number] = (),
    confidence: float = 0.95,
) -> pd.DataFrame:
    """Mean of the runs at each level of each factor, with all others at the base.

    Parameters
    ----------
    table
        One row per run: factors and response. Runs without a finite response are left out.
    base
        Levels of the factors while another factor is swept; not needed for a single factor.

    Returns
    -------
    DataFrame
        ``factor``, ``value``, ``runs``, ``mean``, ``std``, and ``low`` and ``high``, the confidence
        interval of the mean (Student's; NaN for a single run). If no run is below 0, the interval
        ends there. One row for each level. Without factors, one row for all runs, with factor
        ``""``.
    """
    finite = table[np.isfinite(table[response])]
    floor = 0.0 if finite[response].min() >= 0 else -np.inf
    rows: list[tuple[object, ...]] = []
    if not factors:
        rows.append(("", np.nan, *_mean(finite[response], confidence, floor)))
    for i, factor in enumerate(factors):
        mine = finite
        for j, other in enumerate(factors):
            if j != i:
                mine = mine[mine[other] == base[j]]
        rows += [
            (factor, value, *_mean(group, confidence, floor))
            for value, group in mine.groupby(factor, sort=True)[response]
        ]
    return pd.DataFrame(rows, columns=MEANS.names)


def _mean(
    values: pd.Series[float], confidence: float, floor: float
) -> tuple[int, float, float, float, float]:
    n = len(values)
    if not n:
        return 0, np.nan, np.nan, np.nan, np.nan
    y = centred(np.asarray(values, np.float64))
    mean = y.centre + float(y.off.mean())
    std = float(y.off.std(ddof=1)) if n > 1 else np.nan
    reach = float(stats.t.ppf((1 + confidence) / 2, n - 1)) * std / n**0.5 if n > 1 else np.nan
    return n, mean, std, float(np.maximum(mean - reach, floor)), mean + reach


def plot_means(
    table: pd.DataFrame,
    quantity: str = "response",
    units: dict[str, str] | None = None,
    ax: Sequence[Axes] | None = None,
    theme: ThemeName = "light",
) -> Sequence[Axes]:
    """Plot the table of `means`, with a panel for each factor; bars are confidence intervals."""
    with use(theme, ax) as look:
        factors = list(dict.fromkeys(table["factor"]))
        if ax is None:
            columns = min(len(factors), 3)
            rows = ceil(len(factors) / columns)
            figure = new_figure(1.0 + 3.1 * columns if columns > 1 else 5.6, 0.5 + 2.9 * rows)
            ax = list(figure.subplots(rows, columns, squeeze=False, sharey=True).flat)
        for panel in ax[len(factors) :]:
            panel.set_axis_off()
        for panel, factor in zip(ax, factors, strict=False):
            mine = table[table["factor"] == factor]
            reach = [(mine["mean"] - mine["low"]).fillna(0.0),
                     (mine["high"] - mine["mean"]).fillna(0.0)]
            panel.errorbar(mine["value"], mine["mean"], reach, fmt="-o", ms=4.5, capsize=3,
                           color=look.receivers[1])
            unit = (units or {}).get(factor)
            panel.set_xlabel(f"{factor} [{unit}]" if unit else factor)
        ax[0].set_ylabel(f"Mean {quantity}")
        ax[0].set_ylim(bottom=min(0.0, ax[0].get_ylim()[0]))
    return ax
