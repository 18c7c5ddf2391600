"""The front of cost and accuracy, with all designs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..results.drawing import free_places
from ..style import LINES, SMALL, ThemeName, new_figure, use
from .answer import Answer

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]
_LOOKS = {"suffices": ("o", 2), "open": ("D", 3), "fails": ("X", 0)}
"""Marker of each verdict, and its colour among those of receivers."""
_WIDEST = 5.0
"""Ratio of the largest to the smallest value from which the axis is logarithmic."""


def plot_front(answer: Answer, ax: Axes | None = None, theme: ThemeName = "light") -> Axes:
    """Cost against the value that the required share of the runs is within.

    Bars are the bounds, as far as they exist; designs without a finite value are at the top.
    Without costs, the designs stand beside each other in the order of their accuracy.
    """
    with use(theme, ax) as look:
        q = answer.question
        own = ax is None
        if ax is None:
            lines = -(-len(answer.letters) // _COLUMNS)
            ax = new_figure(6.4, 4.6 + _LINE * lines).add_subplot()
        at = _places(answer)
        values = at["estimate"].to_numpy(np.float64)
        finite = values[np.isfinite(values)]
        if len(finite) and finite.max() > _WIDEST * finite.min() > 0:
            _logarithmic(ax)
        for verdict, (marker, colour) in _LOOKS.items():
            mine = at[(at["verdict"] == verdict) & np.isfinite(at["estimate"])]
            bars = [
                np.where(np.isfinite(mine[name]), mine[name], mine["estimate"])
                for name in ("lower", "upper")
            ]
            ax.vlines(mine["x"], *bars, color=look.receivers[colour], lw=1)
            if len(mine):
                ax.plot(mine["x"], mine["estimate"], marker, color=look.receivers[colour], ms=6,
                        mew=0, label=f"{verdict} ({len(mine)})")
        if q.costs:
            front = at[at["front"] & np.isfinite(at["estimate"])]
            ax.step(front["x"], front["estimate"], where="post", color=look.soft, lw=1, zorder=1,
                    label="no other is cheaper and better")
        ax.axhline(q.terms.limit, color=look.ink, ls=LINES[1], lw=1.2,
                   label=f"limit: {q.terms.limit:g}{q.unit and f' {q.unit}'}")
        row: Any = at.loc[answer.named]
        if np.isfinite(row["estimate"]):
            ax.plot([row["x"]], [row["estimate"]], "o", mfc="none", mec=look.ink, ms=12, mew=1.4,
                    label="the nearest" if answer.chosen is None else "the answer")
        unit = f" [{q.unit}]" if q.unit else ""
        words = q.words[0].upper() + q.words[1:]
        currency = f" [{q.terms.currency}]" if q.terms.currency else ""
        ax.set(xlabel=f"Cost{currency}" if q.costs else "Designs by accuracy",
               ylabel=f"{words}:\n{100 * q.terms.share:g} % of the runs are within{unit}")
        if q.costs:
            ax.xaxis.set_major_formatter("{x:,.10g}")
        else:
            ax.set_xticks([])
        if ax.get_yscale() == "linear":
            ax.set_ylim(bottom=0.0)
        _letter(ax, answer, at)
        if own:
            _key(ax, answer)
        else:
            ax.legend(loc="best")
    return ax


def _places(answer: Answer) -> pd.DataFrame:
    """The designs with their place on the horizontal axis."""
    if answer.question.costs:
        return answer.designs.assign(x=answer.designs["cost"])
    order = answer.designs["estimate"].rank(method="first", na_option="bottom")
    return answer.designs.assign(x=order)


def _logarithmic(ax: Axes) -> None:
    """A logarithmic axis with numbers as they are."""
    from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

    ax.set_yscale("log")
    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.yaxis.set_minor_locator(NullLocator())
    ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))


def _letter(ax: Axes, answer: Answer, at: pd.DataFrame) -> None:
    """The letters of the designs that are named."""
    finite = at[np.isfinite(at["estimate"])]
    letters = {row: letter for row, letter in answer.letters.items() if row in finite.index}
    ax.margins(x=0.06, y=0.08)
    ax.figure.draw_without_rendering()  # type: ignore[union-attr]  # places the axes
    points = finite.loc[[*letters], ["x", "estimate"]].to_numpy(np.float64)
    others = finite[["x", "estimate"]].to_numpy(np.float64)
    bars = np.vstack([
        np.column_stack([finite["x"], share * finite[name] + (1 - share) * finite["estimate"]])
        for name in ("lower", "upper") for share in (0.25, 0.5, 0.75, 1.0)
    ])  # fmt: skip
    x = np.linspace(*ax.get_xlim(), 200)
    limit = np.column_stack([x, np.full_like(x, answer.question.terms.limit)])
    drawn = np.vstack([others, bars, limit])
    places: Any = free_places(ax, points, [*letters.values()], drawn)
    for (left, up), letter, place in zip(points, letters.values(), places, strict=True):
        ax.text(left, up, letter, fontsize=SMALL, fontweight="bold", **place)


def _key(ax: Axes, answer: Answer) -> None:
    """The legend, and what the letters stand for, below the axes."""
    study = answer.question.study
    title = " · ".join(study.labels[name] for name in study.factors)
    names = [f"{letter}  {answer.short(row)}" for row, letter in answer.letters.items()]
    rows = -(-len(names) // _COLUMNS)
    columns = ["\n".join(names[i : i + rows]) for i in range(0, len(names), rows)]
    figure: Any = ax.figure
    height = figure.get_size_inches()[1]
    room = (rows + 1) * _LINE / height
    for number, text in enumerate(columns):
        figure.text(0.02 + number / _COLUMNS, room - _LINE / height, text, va="top",
                    fontsize=SMALL, linespacing=1.2)
    figure.text(0.02, room, title, va="top", fontsize=SMALL, fontweight="bold")
    figure.get_layout_engine().set(rect=(0, room, 1, 1 - room))
    figure.legend(loc="outside upper center", ncols=3, columnspacing=1.4, handletextpad=0.5)


_COLUMNS = 2
"""Of the key to the letters."""
_LINE = 0.165
"""Height of a line of it [inch]."""
