"""Figures of a factorial analysis, like the paper's Figures 15 to 18, 22 to 24 and 28 to 30.

Each function draws into given axes or into a new figure. A function with several panels replaces
the axes by its panels and returns these.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from textwrap import fill
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from scipy import stats

from ...study.design import INTERACTION_SIGN
from ...style import LINES, PLAIN, SMALL, Theme, ThemeName, new_figure, use
from ...words.numbers import minus, rounded
from ...words.shares import percent
from ..common.figures import add_legend, panels_in, quantity_of, with_unit, wrapped
from ..common.model import Floats
from .analysis import MOST_BARS, Factorial
from .box_cox import box_cox

RASTER_FROM = 1000
"""Fewest points that an SVG holds as a raster image."""
MOST_DOTS = 20_000
"""Most points that are all drawn. Of more points, only the visible ones are drawn."""
CELLS = 500
"""Cells across a panel, each a sixth of a dot, so that only one point of a cell is visible."""
PERCENT = (0.01, 0.1, 1, 5, 20, 50, 80, 95, 99, 99.9, 99.99)
LONGEST_TERM = 36
"""Longest term on one line [characters]."""
MARGIN = 0.35
"""Margin beside the two levels of a factor, in units of their distance."""


def plot_pareto(
    analysis: Factorial, ax: Axes | None = None, theme: ThemeName = "light", most: int = MOST_BARS
) -> Axes:
    """The `most` largest standardised effects |t|, the largest on top (the paper's Figure 15).

    The line is t(1−α/2, df). Effects that cross it are significant. Without degrees of freedom, the
    bars are effects, and the lines are Lenth's margins of error for one effect and for all at once.
    """
    with use(theme, ax) as look:
        table = analysis.effects
        size = table["effect" if analysis.lenth else "t"].abs().sort_values(
            ascending=False, kind="stable"
        )
        # Without any scatter t is infinite, or undefined if the effect is also zero.
        finite = size[np.isfinite(size)].max() if np.isfinite(size).any() else 1.0
        endless = bool(np.isinf(size).any())
        shown = size.fillna(0.0).clip(upper=2 * finite).head(most).iloc[::-1]
        own = ax is None
        if ax is None:
            ax = new_figure(6.4, 1.8 + 0.25 * len(shown)).add_subplot()
        rises = (table.loc[shown.index, "effect"] > 0).to_numpy()
        positions = np.arange(len(shown))
        handles: list[Line2D | Patch] = []
        for side, word, colour, hatch in (
            (rises, "positive effect: larger at the high level", look.receivers[0], ""),
            (~rises, "negative effect: smaller", look.receivers[1], "///"),
        ):
            ax.barh(positions[side], shown.to_numpy()[side], height=0.7, color=colour, hatch=hatch,
                    edgecolor=look.paper, lw=0)
            handles.append(Patch(facecolor=colour, hatch=hatch, edgecolor=look.paper, lw=0,
                                 label=word))
        unit = f" {analysis.unit}" if analysis.unit else ""
        if analysis.lenth:
            lines = [(analysis.lenth.me, f"ME {analysis.lenth.me:.3g}{unit} (Lenth)", LINES[1]),
                     (analysis.lenth.sme, f"SME {analysis.lenth.sme:.3g}{unit}", LINES[2])]
            ax.set_xlabel(f"|effect| on {quantity_of(analysis)}")
        else:
            alpha = (1 + analysis.confidence) / 2
            lines = [(analysis.reference,
                      f"t({alpha:.4g}, {analysis.df:.4g}) = {analysis.reference:.3f}", LINES[1])]
            ax.set_xlabel("Standardised effect |t|")
        for value, word, style in lines:
            ax.axvline(value, color=look.ink, ls=style, lw=1.2)
            handles.append(Line2D([], [], color=look.ink, ls=style, lw=1.2, label=word))
        ax.set_yticks(positions, [_short(name) for name in shown.index], **PLAIN)
        ax.tick_params(axis="y", length=0)
        ax.grid(axis="y", visible=False)
        part = f", {len(shown)} of {len(size)}" if len(shown) < len(size) else ""
        ax.set_title(f"Effects on {analysis.quantity}{part}", loc="left")
        ax.margins(y=0.02)
        if endless:
            ax.set_xlim(0, 1.2 * max(finite, analysis.reference))
        add_legend(ax, own, handles)
    return ax


def plot_interactions(
    analysis: Factorial, ax: Axes | None = None, theme: ThemeName = "light"
) -> Sequence[Axes]:
    """Means at each pair of levels (the paper's Figure 16).

    A panel's horizontal axis has the levels of the factor on top of its column. Its lines are the
    levels of the factor at the end of its row. Lines that are not parallel show an interaction.
    """
    with use(theme) as look:
        factors = analysis.factors
        n = len(factors)
        own = ax is None
        side = 1.15 if n > 4 else 1.6 if n > 2 else 2.3  # width of a panel [inch]
        names = 0.4  # height of the names on top [inch]
        panels = panels_in(n, n, 1.2 + side * max(n, 2), 0.8 + names + side * (n - 1), ax,
                         heights=[names / side, *[1.0] * (n - 1)])
        means = analysis.interactions.set_index(
            ["first", "second", "first_value", "second_value"]
        )["mean"]
        low, high = means.min(), means.max()
        margin = 0.08 * (high - low)
        for row, column in product(range(n), range(n)):
            panel = panels[row * n + column]
            if column > row:
                panel.set_axis_off()
                continue
            if column == row:
                # no lines are drawn for the first factor
                lines_of = analysis.levels[factors[row]] if row else ()
                _key(panel, with_unit(factors[row], analysis.units), lines_of, look)
                continue
            across, lines = factors[column], factors[row]
            for side, value in enumerate(analysis.levels[lines]):
                y = [means[across, lines, v, value] for v in analysis.levels[across]]
                panel.plot([0, 1], y, ms=4, **_side(side, look))
            panel.set(xlim=(-MARGIN, 1 + MARGIN), ylim=(low - margin, high + margin))
            panel.yaxis.set_major_locator(MaxNLocator(4 if n > 4 else 5))
            panel.set_xticks([0, 1], [f"{v:g}" for v in analysis.levels[across]]
                             if row == n - 1 else [])
            if column:
                panel.tick_params(labelleft=False)
            elif row == n // 2:
                panel.set_ylabel(f"Mean {quantity_of(analysis)}")
        if own:
            title = f"Interactions: mean {quantity_of(analysis)} at each pair of levels"
            figure = panels[0].figure
            characters = round(12 * (1.2 + side * max(n, 2)))
            figure.suptitle(fill(title, characters), fontsize="medium")
    return panels


def plot_main_effects(
    analysis: Factorial, ax: Axes | None = None, theme: ThemeName = "light"
) -> Axes:
    """Mean at both levels of each factor, and the overall mean (the paper's Figure 17).

    Bars are intervals of the means. An effect is the difference of two equally uncertain means, so
    its interval is √2 times as long. Effects within replicates are more certain than their means
    and have no bars. Bars of a response that is never below 0 end there.
    """
    with use(theme, ax) as look:
        factors = analysis.factors
        reach = (analysis.effects["high"] - analysis.effects["low"]) / 2 / np.sqrt(2)
        if analysis.replicate_effects is not None:
            reach *= np.nan
        floor = _floor(analysis)
        own = ax is None
        if ax is None:
            ax = new_figure(max(4.0, 1.2 + 0.95 * len(factors)), 3.8).add_subplot()
        ax.axhline(analysis.overall_mean, color=look.ink, ls=LINES[2], lw=1.2,
                   label=f"overall mean {rounded(analysis.overall_mean)} {analysis.unit}".rstrip())
        ticks: list[float] = []
        names: list[str] = []
        for i, (name, table) in enumerate(analysis.main_effects.groupby("factor", sort=False)):
            x = 2.0 * i + np.array([0.0, 1.0])
            bar = np.full((2, 2), reach.get(name, np.nan))
            bar[0] = np.minimum(bar[0], table["mean"] - floor)
            ax.errorbar(x, table["mean"], bar, fmt="-o", ms=5,
                        lw=1.6, capsize=3, elinewidth=1, color=look.receivers[0])
            ticks += [*x]
            names += [f"{value:g}" for value in table["value"]]
        first = factors[0]
        centre = analysis.points[~analysis.points[first].isin(analysis.levels[first])]
        if len(centre):
            middle = 2.0 * np.arange(len(factors)) + 0.5
            ax.plot(middle, np.full(len(factors), centre["mean"].iloc[0]), "D", ms=4.5, mfc="none",
                    color=look.receivers[1], label="centre points")
        ax.set_xticks(ticks, names)
        room = 13 if own else 9  # axes of the caller may be narrow
        ax.set_xticks([2 * i + 0.5 for i in range(len(factors))],
                      [wrapped(with_unit(name, analysis.units), room) for name in factors],
                      minor=True, **PLAIN)
        ax.tick_params(axis="x", which="minor", length=0, pad=20)
        ax.grid(axis="x", visible=False)
        ax.set_ylabel(f"Mean {quantity_of(analysis)}")
        ax.set_title(f"Main effects on {analysis.quantity}", loc="left")
        add_legend(ax, own)
    return ax


def _floor(analysis: Factorial) -> float:
    """The value below which no mean can be: 0 if no run is below."""
    runs = analysis.table[analysis.response].to_numpy(np.float64, na_value=np.nan)
    return 0.0 if analysis.transform == "none" and np.nanmin(runs) >= 0 else -np.inf


def plot_residuals(
    analysis: Factorial, ax: Axes | None = None, theme: ThemeName = "light"
) -> Sequence[Axes]:
    """Four plots of the residuals (the paper's Figure 18).

    They are a normal probability plot, a histogram, and plots against the fitted values and against
    the random run order.
    """
    with use(theme) as look:
        panels = panels_in(2, 2, 7.6, 6.0, ax)
        normal, histogram, fits, order = panels
        table = analysis.residuals
        residual = table["residual"].to_numpy()
        unit = f" [{analysis.unit}]" if analysis.unit else ""
        dots: dict[str, Any] = {
            "marker": ".", "ls": "", "ms": 3 if len(residual) > RASTER_FROM else 6, "mew": 0,
            "color": look.receivers[1], "alpha": 0.5 if len(residual) > RASTER_FROM else 1.0,
            "rasterized": len(residual) > RASTER_FROM,
        }
        count = len(residual)
        quantile = stats.norm.ppf((np.arange(1, count + 1) - 0.375) / (count + 0.25))
        normal.plot(*_seen(np.sort(residual), quantile), **dots)
        scale = residual.std()
        ends = quantile[[0, -1]]
        normal.plot(ends * scale, ends, color=look.ink, lw=1, ls=LINES[1])
        ticks = [p for p in PERCENT if ends[0] - 0.5 < stats.norm.ppf(p / 100) < ends[1] + 0.5]
        normal.set_yticks(stats.norm.ppf(np.array(ticks) / 100), [f"{p:g}" for p in ticks])
        normal.set(xlabel=f"Residual{unit}", ylabel="Probability [%]")
        normal.set_title("Normal probability", loc="left")
        histogram.hist(residual, bins=min(40, 1 + round(2 * np.sqrt(count))),
                       color=look.receivers[1], edgecolor=look.paper, lw=0.4)
        histogram.set(xlabel=f"Residual{unit}", ylabel="Runs")
        histogram.set_title("Histogram", loc="left")
        for panel, column, label in (
            (fits, "fit", f"Fitted value{unit}"), (order, "run_order", "Run order (random)")
        ):
            panel.axhline(0, color=look.ink, lw=1, ls=LINES[1])
            panel.plot(*_seen(table[column].to_numpy(), residual), **dots)
            panel.set(xlabel=label, ylabel=f"Residual{unit}")
        fits.set_title("Against fitted values", loc="left")
        order.set_title("Against run order", loc="left")
        if ax is None:
            none = "; none are left with as many terms as points" if analysis.lenth else ""
            normal.figure.suptitle(f"Residuals of {analysis.quantity}{none}", fontsize="medium")
    return panels


def _seen(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """The visible points: if there are many, those that others do not hide."""
    if len(x) <= MOST_DOTS:
        return x, y
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known], y[known]
    cell = np.zeros(len(x), np.int64)
    for values in (x, y):
        place = (values - values.min()) / (np.ptp(values) or 1.0) * CELLS
        cell = cell * (CELLS + 1) + place.astype(np.int64)
    first = ~pd.Index(cell).duplicated()
    return x[first], y[first]


def plot_box_cox(
    analysis: Factorial,
    ax: Axes | None = None,
    theme: ThemeName = "light",
    profile: pd.DataFrame | None = None,
) -> Axes:
    """Profile of the Box–Cox transform, from `box_cox`."""
    profile = box_cox(analysis) if profile is None else profile
    with use(theme, ax) as look:
        own = ax is None
        if ax is None:
            ax = new_figure(5.6, 3.2).add_subplot()
        power, height = profile["lambda"], profile["log_likelihood"]
        best = float(power.to_numpy()[height.argmax()])
        inside = power[profile["inside"]]
        ax.axvspan(inside.min(), inside.max(), color=look.receivers[1], alpha=0.25, lw=0,
                   label=f"{percent(analysis.confidence, '.4g')} interval")
        ax.plot(power, height - height.max(), color=look.receivers[1])
        ax.axvline(best, color=look.receivers[0], ls=LINES[1],
                   label=f"best λ = {minus(f'{best:.2g}')}")
        for value, word in ((0, "logarithm"), (1, "response")):
            ax.axvline(value, color=look.ink, ls=LINES[2], lw=0.9)
            ax.annotate(word, (value, 0.02), xycoords=("data", "axes fraction"), rotation=90,
                        xytext=(-3, 0), textcoords="offset points", ha="right", va="bottom",
                        fontsize=SMALL)
        ax.set(xlabel="Power λ of the response", ylabel="log likelihood minus its maximum")
        ax.set_title("Box–Cox profile", loc="left")
        add_legend(ax, own)
    return ax


def _side(high: int, look: Theme) -> dict[str, Any]:
    """Style of the line of a low or a high level."""
    return {"color": look.receivers[high], "ls": LINES[high], "marker": "os"[high]}


def _key(panel: Axes, factor: str, levels: Sequence[float], look: Theme) -> None:
    """A factor's name and the styles of its two lines."""
    panel.set_axis_off()
    panel.set(xlim=(0, 1), ylim=(0, 1))
    panel.text(0.5, 0.56 if levels else 0.1, wrapped(factor, 14), ha="center", va="bottom",
               fontweight="bold", fontsize=SMALL)
    for high, value in enumerate(levels):
        y = 0.4 - 0.24 * high
        panel.plot([0.08, 0.4], [y, y], ms=4, markevery=[1], **_side(high, look))
        panel.text(0.48, y, f"{value:g}", va="center", fontsize=SMALL)


def _short(term: str) -> str:
    """A term, in two lines if it is long."""
    if len(term) <= LONGEST_TERM:
        return term
    return term.replace(INTERACTION_SIGN, f"{INTERACTION_SIGN.rstrip()}\n", 1)
