"""The front of cost and accuracy, with all designs."""

from __future__ import annotations

import re
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..results.figures.drawing import free_places
from ..style import LINES, SMALL, Theme, ThemeName, new_figure, use
from ..words.shares import percent
from .result import Requirement

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]
_LOOKS = {"suffices": ("o", 2), "undecided": ("D", 3), "fails": ("X", 0)}
"""Marker of each verdict, and its colour among those of receivers."""
_WIDEST = 5.0
"""Ratio of the largest to the smallest value above which the axis is logarithmic."""
_WIDE, _NARROW, _HEIGHT = 6.4, 3.7, 4.2
"""Widths of the figure, and its height without legend and key [inch]."""


def plot_front(
    answer: Requirement, ax: Axes | None = None, theme: ThemeName = "light", *, narrow: bool = False
) -> Axes:
    """Cost against the value that the required share of the runs is within.

    Bars are the claimed bounds. Designs without a finite value are arrows at the upper edge. The
    legend counts designs that were not tried. The designs that the answer names have letters. Those
    that do not suffice are small. Without costs, designs are ordered by their accuracy.

    Parameters
    ----------
    narrow
        Draw a new figure for a narrow page; has no effect on given axes.
    """
    with use(theme, ax) as look:
        q = answer.question
        key = _key(answer, narrow)
        own = ax is None
        if ax is None:
            figure = new_figure(_NARROW if narrow else _WIDE, _HEIGHT, laid_out=True)
            ax = figure.add_subplot()
        at = _places(answer)
        values = at["estimate"].to_numpy(np.float64)
        finite = values[np.isfinite(values)]
        if len(finite) and finite.max() > _WIDEST * finite.min() > 0:
            _logarithmic(ax)
        _designs(ax, answer, at, look)
        if q.costs:
            front = at[at["front"] & np.isfinite(at["estimate"])]
            ax.step(front["x"], front["estimate"], where="post", color=look.soft, lw=1, zorder=1,
                    label="no other is cheaper and better")
        ax.axhline(q.terms.limit, color=look.ink, ls=LINES[1], lw=1.2,
                   label=f"limit: {q.terms.limit:g}{q.unit and f' {q.unit}'}")
        unit = f" [{q.unit}]" if q.unit else ""
        words = q.words[0].upper() + q.words[1:]
        currency = f" [{q.terms.currency}]" if q.terms.currency else ""
        ax.set(xlabel=f"Cost{currency}" if q.costs else "Designs by accuracy",
               ylabel=f"{words}:\n{percent(q.terms.share)} of the runs are within{unit}")
        ax.margins(x=0.06, y=0.08)
        if q.costs:
            ax.locator_params(axis="x", nbins=4 if narrow else 8)
            ax.xaxis.set_major_formatter("{x:,.10g}")
        else:
            ax.set_xticks([])
        if ax.get_yscale() == "linear":
            ax.set_ylim(bottom=0.0)
        at = _beyond(ax, answer, at, look)
        if not answer.spent:
            ax.text(0.5, 0.5, "no design was tried", transform=ax.transAxes, ha="center")
        if own:
            _write(ax, key)
        else:
            ax.legend(loc="best")
        _letter(ax, answer, at, look)
    return ax


def plot_narrow(answer: Requirement, theme: ThemeName = "light") -> Axes:
    """`plot_front` for a narrow page."""
    return plot_front(answer, theme=theme, narrow=True)


def _places(answer: Requirement) -> pd.DataFrame:
    """The designs with their positions on the horizontal axis."""
    if answer.question.costs:
        return answer.designs.assign(x=answer.designs["cost"])
    order = answer.designs["estimate"].rank(method="first", na_option="bottom")
    return answer.designs.assign(x=order)


def _designs(ax: Axes, answer: Requirement, at: pd.DataFrame, look: Theme) -> None:
    """The designs with a finite value; those that are named or suffice are larger."""
    drawn = False
    for verdict, (marker, number) in _LOOKS.items():
        every = at[at["verdict"] == verdict]
        mine = every[np.isfinite(every["estimate"])]
        large = np.array([row in answer.roles or verdict == "suffices" for row in mine.index], bool)
        colour = look.receivers[number]
        for some, size, width in ((mine[~large], 3.5, 0.5), (mine[large], 6.0, 1.2)):
            bars = [
                np.where(np.isfinite(some[name]), some[name], some["estimate"])
                for name in ("lower", "upper")
            ]
            ax.vlines(some["x"], *bars, color=colour, lw=width)
            drawn = drawn or bool((bars[0] < bars[1]).any())
            ax.plot(some["x"], some["estimate"], marker, color=colour, ms=size, mew=0)
        tried = int((every["runs"] > 0).sum())
        if tried:
            ax.plot([], [], marker, color=colour, ms=6, mew=0, label=f"{verdict} ({tried})")
    if untried := int((at["runs"] == 0).sum()):
        ax.plot([], [], " ", label=f"not tried: not shown ({untried})")
    if drawn:
        ax.plot([], [], color=look.soft, ls="", marker="|", ms=9, label="bar: to the sure bounds")


def _beyond(ax: Axes, answer: Requirement, at: pd.DataFrame, look: Theme) -> pd.DataFrame:
    """Arrows for designs without a finite value; returns all designs, with these at the upper
    edge."""
    top = ax.get_ylim()[1]
    ax.set_ylim(top=top)
    far = at[(at["estimate"] == np.inf) & (at["runs"] > 0)]
    for verdict, (_, number) in _LOOKS.items():
        mine = far[far["verdict"] == verdict]
        if len(mine):
            ax.plot(mine["x"], [top] * len(mine), "^", color=look.receivers[number], ms=6, mew=0,
                    clip_on=False)
    if len(far):
        share = percent(answer.question.terms.share)
        ax.plot([], [], "^", color=look.soft, ms=6, mew=0,
                label=f"beyond ({len(far)}): less than {share} end well")
    return at.assign(estimate=at["estimate"].where(~at.index.isin(far.index), top))


def _logarithmic(ax: Axes) -> None:
    """A logarithmic axis with plain numbers."""
    from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

    ax.set_yscale("log")
    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.yaxis.set_minor_locator(NullLocator())
    ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))


def _letter(ax: Axes, answer: Requirement, at: pd.DataFrame, look: Theme) -> None:
    """A ring around the design that the answer is about, and letters beside all that it names."""
    known = at[np.isfinite(at["estimate"])]
    letters = {row: letter for row, letter in answer.letters.items() if row in known.index}
    ring: Any = known[known.index == answer.named]
    if len(ring):
        ax.plot(ring["x"], ring["estimate"], "o", mfc="none", mec=look.ink, ms=12, mew=1.4,
                clip_on=False)
    ax.figure.draw_without_rendering()  # type: ignore[union-attr]  # places the axes
    points = known.loc[[*letters], ["x", "estimate"]].to_numpy(np.float64)
    others = known[["x", "estimate"]].to_numpy(np.float64)
    bars = np.vstack([
        np.column_stack([known["x"], share * known[name] + (1 - share) * known["estimate"]])
        for name in ("lower", "upper") for share in (0.25, 0.5, 0.75, 1.0)
    ])  # fmt: skip
    x = np.linspace(*ax.get_xlim(), 200)
    limit = np.column_stack([x, np.full_like(x, answer.question.terms.limit)])
    drawn = np.vstack([others, bars, limit])
    places: Any = free_places(ax, points, [*letters.values()], drawn)
    for (left, up), letter, place in zip(points, letters.values(), places, strict=True):
        ax.text(left, up, letter, fontsize=SMALL, fontweight="bold", **place)


def _key(answer: Requirement, narrow: bool) -> list[str]:
    """The meaning of the letters, line by line."""
    lines = [
        re.sub(r"(?<=\d) ", "\u00a0", f"{letter}  {answer.roles[row]}: {answer.priced(row)}")
        for row, letter in answer.letters.items()
    ]
    width = _NARROW_LINE if narrow else _WIDE_LINE
    return [part for line in lines for part in wrap(line, width, subsequent_indent="     ")]


def _write(ax: Axes, key: list[str]) -> None:
    """The legend above the axes, and the key to the letters below them."""
    figure: Any = ax.figure
    figure.draw_without_rendering()  # makes all ticks known
    renderer, inch = figure.canvas.get_renderer(), figure.dpi
    for columns in (3, 2, 1):
        legend = figure.legend(loc="upper left", ncols=columns, columnspacing=1.4,
                               handletextpad=0.5, borderaxespad=0.2)  # fmt: skip
        extent = legend.get_window_extent(renderer)
        if columns == 1 or extent.x1 <= figure.bbox.width:
            break
        legend.remove()
    above = extent.height / inch + 0.2
    labels: Any = ax.get_tightbbox(renderer)
    left, under = ((ax.bbox.p0 - labels.p0) / inch + 0.08).tolist()
    right = max((labels.x1 - ax.bbox.x1) / inch + 0.04, 0.12)
    below = (len(key) + 0.6) * _LINE
    width, axes = figure.get_size_inches()
    height = axes + above + below
    figure.set_size_inches(width, height)
    for number, line in enumerate(key):
        up = below - (number + 0.3) * _LINE
        figure.text(0.08 / width, up / height, line, va="top", fontsize=SMALL)
    figure.subplots_adjust(
        left / width, (below + under) / height, 1 - right / width, 1 - above / height
    )


_WIDE_LINE, _NARROW_LINE = 88, 48
"""Characters in a line of the key."""
_LINE = 0.165
"""Height of a line of the key [inch]."""
