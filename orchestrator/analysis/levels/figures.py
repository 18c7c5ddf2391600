"""Figures of an analysis of factors with many levels, narrow enough for a telephone.

Levels are rows, which leaves room for many of them and for long names. Each function draws a panel
for each factor or pair of factors, in a new figure or in the place of given axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from ...style import LINES, MARKERS, PLAIN, SMALL, Theme, ThemeName, use
from ...words.shares import percent
from ..common.figures import add_legend, panels_in, quantity_of, with_unit, wrapped
from .analysis import GeneralFactorial
from .sentences import level_text, pair_texts

WIDTH = 4.0
"""Width of a figure [inch]: 384 pixels of a browser."""
LINE = 0.17
"""Height of a line of text [inch]."""
NAME = 20
"""Longest part of a level's name on one line [characters]."""
TITLE = 32
"""Longest part of a panel's title on one line [characters]."""
MOST_PAIRS = 15
"""Most drawn differences of a factor."""
MOST_PANELS = 6
"""Most drawn pairs of factors."""
MOST_BARS = 4
"""Most levels of a factor whose lines have intervals."""


def plot_means(
    analysis: GeneralFactorial, ax: Axes | None = None, theme: ThemeName = "light"
) -> Sequence[Axes]:
    """Marginal mean at each level of each factor. Each bar is the interval of one mean alone.

    Where means cannot be trusted (`GeneralFactorial.by_medians`), medians replace them.
    """
    with use(theme) as look:
        rows = [[_name(analysis, factor, level) for level in levels]
                for factor, levels in analysis.levels.items()]
        panels = _stacked(rows, ax)
        what = "median" if analysis.by_medians else "mean"
        table = analysis.medians if analysis.by_medians else analysis.own_means
        for panel, factor, names in zip(panels, analysis.levels, rows, strict=True):
            own = table[table["factor"] == factor]
            mean = own[what].to_numpy(np.float64)
            middle = np.exp(np.log(mean).mean()) if analysis.transform == "log" else mean.mean()
            panel.axvline(middle, color=look.ink, ls=LINES[2], lw=1.0)
            at = _rows(panel, names)
            panel.errorbar(mean, at, xerr=[mean - own["low"], own["high"] - mean], fmt="o", ms=5,
                           capsize=3, lw=1.3, color=look.receivers[0])
            _title(panel, with_unit(factor, analysis.units))
        _shared(panels, analysis.shown_of)
        line = Line2D([], [], color=look.ink, ls=LINES[2], lw=1.0, label="mean of the levels")
        dot = Line2D([], [], color=look.receivers[0], marker="o", ms=5, lw=1.3,
                     label=f"{what}, {percent(analysis.confidence, '.4g')} interval")
        add_legend(panels[-1], ax is None, [dot, line])
    return panels


def plot_pairs(
    analysis: GeneralFactorial, ax: Axes | None = None, theme: ThemeName = "light"
) -> Sequence[Axes]:
    """The largest differences of each factor's levels, with intervals that hold all at once.

    Where means cannot be trusted, they are differences of medians.
    """
    with use(theme) as look:
        tables = [
            own.sort_values("difference", key=np.abs, ascending=False, kind="stable")
            for _, own in analysis.judged_pairs.groupby("factor", sort=False)
        ]
        shown = [own.head(MOST_PAIRS) for own in tables]
        rows = [[_pair(*pair_texts(row, analysis)) for row in own.itertuples()]
                for own in shown]
        panels = _stacked(rows, ax)
        styles = ((True, look.receivers[0], "o", "differ"),
                  (False, look.soft, "s", "cannot be told apart"))
        for panel, own, whole, names in zip(panels, shown, tables, rows, strict=True):
            at = _rows(panel, names)
            panel.axvline(0, color=look.ink, lw=1.0)
            for differs, colour, marker, _ in styles:
                side = own["differs"].to_numpy(np.bool_) == differs
                part = own[side]
                low, gap, high = part[["low", "difference", "high"]].to_numpy(np.float64).T
                panel.errorbar(gap, at[side], xerr=[gap - low, high - gap], fmt=marker, ms=5,
                               capsize=3, lw=1.3, color=colour,
                               mfc=colour if differs else look.paper)
            some = f", {len(own)} of {len(whole)} pairs" if len(own) < len(whole) else ""
            _title(panel, f"{own['factor'].iloc[0]}{some}")
        what = "median" if analysis.by_medians else "mean"
        _shared(panels, f"Median difference of {quantity_of(analysis)} within a replicate"
                if analysis.within_replicates else
                f"Difference of {what} {quantity_of(analysis)}")
        add_legend(panels[-1], ax is None, [
            Line2D([], [], color=colour, marker=marker, ms=5, lw=1.3, label=word,
                   mfc=colour if differs else look.paper)
            for differs, colour, marker, word in styles
            if any((own["differs"] == differs).any() for own in shown)
        ])
    return panels


def plot_interactions(
    analysis: GeneralFactorial, ax: Axes | None = None, theme: ThemeName = "light"
) -> Sequence[Axes]:
    """Means at the levels of each two factors. Lines that are not parallel show an interaction.

    The factor with more levels has a row for each, the other one a line for each. If there are many
    pairs of factors, those with the surest interactions are drawn. Up to 4 lines have intervals.

    Raises
    ------
    ValueError
        There is only one factor.
    """
    if len(analysis.factors) < 2:
        raise ValueError("analysis: must have two factors or more, got one")
    with use(theme) as look:
        both = _surest(analysis)
        rows = [[_name(analysis, down, level) for level in analysis.levels[down]]
                for down, _ in both]
        keys = [[_name(analysis, lines, level) for level in analysis.levels[lines]]
                for _, lines in both]
        panels = _stacked(rows, ax, keys)
        for i, (down, lines) in enumerate(both):
            panel, key = panels[2 * i], panels[2 * i + 1]
            _draw_lines(panel, analysis, (down, lines), _rows(panel, rows[i]), look)
            _title(panel, f"{down}; lines: {with_unit(lines, analysis.units)}")
            panel.xaxis.set_major_locator(MaxNLocator(5))
            _label(panel, f"Mean {quantity_of(analysis)}")
            key.set_axis_off()
            key.legend(panel.get_legend_handles_labels()[0], keys[i], loc="upper center",
                       ncols=_columns(keys[i]), fontsize=SMALL, handlelength=2.4, borderaxespad=0)
        if ax is None:
            count = len(analysis.factors) * (len(analysis.factors) - 1) // 2
            some = f", {len(both)} of {count} pairs of factors" if len(both) < count else ""
            panels[0].figure.suptitle(f"Interactions{some}", fontsize="medium")
    return panels


def _draw_lines(
    panel: Axes,
    analysis: GeneralFactorial,
    factors: tuple[str, str],
    at: Any,
    look: Theme,
) -> None:
    """A line for each level of the second factor over the rows of the first."""
    lines = factors[1]
    order = [name for name in analysis.factors if name in factors]
    own = analysis.cells[
        (analysis.cells["first"] == order[0]) & (analysis.cells["second"] == order[1])
    ]
    column = "second_level" if order[1] == lines else "first_level"
    levels = analysis.levels[lines]
    bars = len(levels) <= MOST_BARS
    for i, level in enumerate(levels):
        part = own[[x == level for x in own[column]]]
        mean = part["mean"].to_numpy(np.float64)
        how: dict[str, Any] = {
            "color": look.receivers[i % len(look.receivers)], "ls": LINES[i % len(LINES)],
            "marker": MARKERS[1 + i % (len(MARKERS) - 1)], "ms": 4.5, "label": str(i),
        }
        if bars:
            shift = 0.12 * (i - (len(levels) - 1) / 2)
            reach = [mean - part["low"], part["high"] - mean]
            panel.errorbar(mean, at + shift, xerr=reach, capsize=2, lw=1.3, elinewidth=0.8, **how)
        else:
            panel.plot(mean, at, lw=1.2, **how)


def _columns(names: Sequence[str]) -> int:
    """Number of columns of a legend as wide as a panel."""
    longest = max(len(line) for name in names for line in name.split("\n"))
    return min(len(names), 1 if longest > 9 else 2 if longest > 4 else 3)


def _surest(analysis: GeneralFactorial) -> list[tuple[str, str]]:
    """Pairs of factors, the one with more levels first; of many, those with the smallest p."""
    names = analysis.factors
    p = {frozenset(names[i] for i in term): analysis.anova["p"].iloc[row]
         for row, term in enumerate(analysis.terms) if len(term) == 2}
    both = sorted(combinations(names, 2), key=lambda pair: p.get(frozenset(pair), 1.0))
    chosen = both[:MOST_PANELS]
    return [(a, b) if len(analysis.levels[a]) >= len(analysis.levels[b]) else (b, a)
            for a, b in combinations(names, 2) if (a, b) in chosen]


def _stacked(
    rows: Sequence[Sequence[str]], ax: Axes | None, keys: Sequence[Sequence[str]] = ()
) -> list[Axes]:
    """Panels one above the other, as high as their rows, each with its legend if it has one."""
    heights = [0.55 + 0.09 * len(names) + LINE * _height(names) for names in rows]
    if keys:
        below = [0.1 + (0.04 + LINE) * -(-_height(key) // _columns(key)) for key in keys]
        heights = [height for both in zip(heights, below, strict=True) for height in both]
    return panels_in(len(heights), 1, WIDTH, sum(heights) + 0.3 * len(rows) + 0.6, ax, heights)


def _height(names: Sequence[str]) -> int:
    """Number of lines of a text."""
    return sum(1 + name.count("\n") for name in names)


def _name(analysis: GeneralFactorial, factor: str, level: Any) -> str:
    return wrapped(level_text(level, analysis.units.get(factor, "")), NAME)


def _pair(one: str, other: str, sign: str = "−") -> str:
    """Two levels, on separate lines if they are long."""
    if len(one) + len(other) < NAME:
        return f"{one} {sign} {other}"
    return f"{wrapped(one, NAME)}\n{sign} {wrapped(other, NAME)}"


def _rows(panel: Axes, names: Sequence[str]) -> Any:
    """Positions of the rows, from the top; names with several lines have more room."""
    lines = np.array([1 + 0.65 * name.count("\n") for name in names])
    at = np.cumsum(lines) - lines / 2
    panel.set_yticks(at, list(names), fontsize=SMALL, **PLAIN)
    panel.set_ylim(lines.sum() + 0.1, -0.1)
    panel.tick_params(axis="y", length=0)
    panel.grid(axis="y", visible=False)
    return at


def _title(panel: Axes, text: str) -> None:
    panel.set_title(wrapped(text, TITLE), loc="left").set(**PLAIN)


def _shared(panels: Sequence[Axes], label: str) -> None:
    """Give all panels one scale, with its label below the last one."""
    low = min(panel.get_xlim()[0] for panel in panels)
    high = max(panel.get_xlim()[1] for panel in panels)
    for panel in panels:
        panel.set_xlim(low, high)
        panel.xaxis.set_major_locator(MaxNLocator(5))
    _label(panels[-1], label)


def _label(panel: Axes, text: str) -> None:
    panel.set_xlabel(wrapped(text, TITLE)).set(**PLAIN)
