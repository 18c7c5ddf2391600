"""Figures of Sobol' indices: the indices themselves, and the response against each factor.

Each function draws into given axes or into a new figure.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, floor, log10
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullFormatter
from scipy import stats

from ...results.responses import unit_of
from ...study.distributions import is_number
from ...study.space import DrawnFactor
from ...style import PLAIN, Theme, ThemeName, new_figure, use
from ...words.numbers import minus
from ...words.shares import percent
from .analysis import Floats, Sensitivity

RASTER_FROM = 1000
"""Fewest points that an SVG holds as a raster image."""
MOST_BINS, LEAST_IN_BIN = 20, 16
"""Most bins of a conditional mean, and fewest independent runs in each."""
MOST_IN_COLUMN = 6
"""Most panels one above the other."""
_THICK = 0.36  # height of a bar


def plot_indices(
    sobol: Sensitivity, ax: Axes | None = None, theme: ThemeName = "light"
) -> Axes:
    """First-order and total indices with their intervals, the largest total on top, and chance."""
    with use(theme, ax) as look:
        table = sobol.ranked().iloc[::-1]
        own = ax is None
        if ax is None:
            ax = new_figure(4.8, 1.7 + 0.5 * len(table)).add_subplot()
        places = np.arange(len(table))
        for side, kind, words, hatch in (
            (1, "first", "first order: by itself", ""),
            (-1, "total", "total: with its interactions", "///"),
        ):
            size = table[kind].to_numpy()
            reach = np.abs(table[[f"{kind}_low", f"{kind}_high"]].to_numpy().T - size)
            ax.barh(places + side * _THICK / 2, size, _THICK, color=look.receivers[(1 - side) // 2],
                    hatch=hatch, edgecolor=look.paper, lw=0, label=words)
            ax.errorbar(size, places + side * _THICK / 2, xerr=reach, fmt="none", ecolor=look.ink,
                        elinewidth=1, capsize=2.5)
        ax.axvline(0, color=look.ink, lw=0.8)
        ax.set_yticks(places, [fill(sobol.name_of(str(name)), 18) for name in table.index], **PLAIN)
        ax.tick_params(axis="y", length=0)
        ax.grid(axis="y", visible=False)
        ax.set_xlim(right=max(1.0, ax.get_xlim()[1]))
        level = percent(sobol.confidence, ".4g")
        ax.set_xlabel(f"Share of the variance;\nlines: {level} intervals")
        ax.set_title(fill(f"Sobol' indices of {sobol.quantity}", 38), loc="left")
        if own:
            ax.figure.legend(loc="outside lower center", ncols=1)
        else:
            ax.legend(loc="best")
    return ax


def plot_scatter(
    sobol: Sensitivity, ax: Sequence[Axes] | None = None, theme: ThemeName = "light"
) -> Sequence[Axes]:
    """The independent runs against each factor, and the mean of runs with similar values.

    The factor's first-order index is the variance of that mean, as a share. Axes are logarithmic if
    the distribution or the analysed response is. For ``lost``, the means are shares of lost runs.
    """
    with use(theme, ax) as look:
        factors = sobol.sample.factors
        own = ax is None
        if ax is None:
            columns = _columns(factors)
            rows = ceil(len(factors) / columns)
            figure = new_figure(4.2 if columns == 1 else 5.4, 0.9 + 2.3 * rows)
            ax = list(figure.subplots(rows, columns, squeeze=False, sharey=True).flat)
        for panel in ax[len(factors):]:
            panel.set_axis_off()
        for panel, factor in zip(ax, factors, strict=False):
            _panel(panel, sobol, factor, look)
        per_row = _columns(factors) if own else 1
        for panel in ax[: len(factors) : per_row]:
            panel.set_ylabel(fill(_response(sobol), 34))
        if own:
            handles, labels = ax[0].get_legend_handles_labels()
            legend = ax[0].figure.legend(handles, labels, loc="outside lower center", ncols=1)
        else:
            legend = ax[0].legend(loc="best")
        dot: Any = legend.legend_handles[0]
        dot.set(markersize=8, alpha=1)
    return ax


def _columns(factors: Sequence[DrawnFactor]) -> int:
    """One column of panels, which fits a telephone; two if there are many panels."""
    return 1 if len(factors) <= MOST_IN_COLUMN else 2


def _panel(panel: Axes, sobol: Sensitivity, factor: DrawnFactor, look: Theme) -> None:
    """Draw the points and the conditional mean of one factor."""
    runs = sobol.independent_runs.ravel()
    x, y = sobol.sample.values[factor.name].to_numpy()[runs], sobol.values[runs]
    levels = factor.distribution.levels
    if levels is not None:
        places = {level: float(i) for i, level in enumerate(levels)}
        x = np.array([places[value] for value in x.tolist()])
    x = x.astype(np.float64)
    # spread sideways, as many runs share a place
    beside = 0.0 if levels is None else np.random.default_rng(1).uniform(-0.25, 0.25, len(x))
    many = len(x) > RASTER_FROM
    panel.plot(x + beside, y, ".", color=look.soft, ms=3 if many else 5, mew=0, rasterized=many,
               alpha=min(0.5, 4000 / len(x)), label="independent runs")
    centres, means, errors = conditional_mean(
        x, np.log(y) if sobol.transform == "log" else y, discrete=levels is not None
    )
    reach = float(stats.norm.ppf((1 + sobol.confidence) / 2)) * errors
    ends = np.array([means - reach, means + reach])
    if sobol.transform == "log":
        means, ends = np.exp(means), np.exp(ends)
        panel.set_yscale("log")
        _plain_ticks(panel.yaxis, y)
    panel.errorbar(centres, means, np.abs(ends - means), fmt="o" if levels else "-o", ms=4,
                   capsize=2, elinewidth=1, color=look.receivers[0], label=_mean(sobol))
    if levels is not None:
        names = [f"{level:g}" if is_number(level) else str(level) for level in levels]
        panel.set_xticks(range(len(levels)), [fill(name, 12) for name in names], **PLAIN)
    elif factor.distribution.logarithmic:
        panel.set_xscale("log")
        _plain_ticks(panel.xaxis, x)
    else:
        panel.xaxis.set_major_locator(MaxNLocator(5))
    name = factor.label or factor.name
    panel.set_xlabel(fill(f"{name} [{factor.unit}]" if factor.unit else name, 34))
    row: Any = sobol.indices.loc[factor.name]
    panel.set_title(f"first {_index(row['first'])}, total {_index(row['total'])}", loc="left")


def _plain_ticks(axis: Axis, values: Floats) -> None:
    """Show ticks of a logarithmic axis as plain numbers, as exponents are too small to read."""
    low, high = float(values.min()), float(values.max())
    decades = range(floor(log10(low)), ceil(log10(high)) + 1)
    digits = (1.0,) if high / low > 500 else (1.0, 3.0) if high / low > 20 else (1.0, 2.0, 5.0)
    ticks = [d * 10.0**e for e in decades for d in digits if low <= d * 10.0**e <= high]
    axis.set_major_locator(FixedLocator(ticks) if len(ticks) > 1 else MaxNLocator(4))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def conditional_mean(
    x: Floats, y: Floats, *, discrete: bool = False
) -> tuple[Floats, Floats, Floats]:
    """Mean of y at similar values of x.

    Parameters
    ----------
    discrete
        Compute a mean for each value of x, instead of for bins with equal numbers of values.

    Returns
    -------
    tuple
        Median of x in each bin, mean of y, and its standard error (NaN for a single value); the
        shape of each is (bins,).
    """
    order = np.argsort(x, kind="stable")
    x, y = x[order], y[order]
    if discrete:
        cuts = np.flatnonzero(np.diff(x)) + 1
    else:
        bins = int(np.clip(len(x) // LEAST_IN_BIN, 1, MOST_BINS))
        cuts = np.linspace(0, len(x), bins + 1).round().astype(np.int64)[1:-1]
        # runs with equal values, which rounding makes, share a bin
        cuts = np.unique(np.searchsorted(x, x[cuts]))
        cuts = cuts[cuts > 0]
    parts = [*zip(np.split(x, cuts), np.split(y, cuts), strict=True)]
    errors = [b.std(ddof=1) / np.sqrt(len(b)) if len(b) > 1 else np.nan for _, b in parts]
    medians, means = [np.median(a) for a, _ in parts], [b.mean() for _, b in parts]
    return np.array(medians), np.array(means), np.array(errors)


def _mean(sobol: Sensitivity) -> str:
    what = "geometric mean" if sobol.transform == "log" else "share" if sobol.is_flag else "mean"
    return f"{what} of similar runs, {percent(sobol.confidence, '.4g')} intervals"


def _response(sobol: Sensitivity) -> str:
    name, unit = sobol.label or sobol.response, unit_of(sobol.response)
    return f"{name} [{unit}]" if unit else name


def _index(value: float) -> str:
    return minus(f"{value:z.2f}")
