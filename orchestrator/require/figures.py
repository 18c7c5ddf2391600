"""The front of cost and accuracy, with all designs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..results.drawing import free_places
from ..style import LINES, SMALL, ThemeName, new_figure, use
from .answer import VERDICTS, Answer

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]
_LOOKS = {"good": ("o", 2), "open": ("D", 3), "not": ("X", 0)}
"""Marker of each verdict, and its colour among those of receivers."""
_WIDEST = 30.0
"""Ratio of the largest to the smallest value from which the axis is logarithmic."""


def plot_front(answer: Answer, ax: Axes | None = None, theme: ThemeName = "light") -> Axes:
    """Cost against the value that the required share of the runs is within.

    Bars are the bounds, as far as they exist; designs without a finite value are at the top.
    Without costs, the designs stand beside each other in the order of their accuracy.
    """
    q = answer.question
    with use(theme, ax) as look:
        own = ax is None
        if ax is None:
            ax = new_figure(6.4, 5.0).add_subplot()
        at = _places(answer)
        values = at["estimate"].to_numpy(np.float64)
        finite = values[np.isfinite(values)]
        if len(finite) and finite.max() > _WIDEST * finite.min() > 0:
            ax.set_yscale("log")
        for verdict, (marker, colour) in _LOOKS.items():
            mine = at[(at["verdict"] == verdict) & np.isfinite(at["estimate"])]
            bars = [
                np.where(np.isfinite(mine[name]), mine[name], mine["estimate"])
                for name in ("lower", "upper")
            ]
            ax.vlines(mine["x"], *bars, color=look.receivers[colour], lw=1)
            if len(mine):
                ax.plot(mine["x"], mine["estimate"], marker, color=look.receivers[colour], ms=6,
                        mew=0, label=f"{VERDICTS[verdict]} ({len(mine)})")
        if q.costs:
            front = at[at["front"] & np.isfinite(at["estimate"])]
            ax.step(front["x"], front["estimate"], where="post", color=look.soft, lw=1, zorder=1,
                    label="no other is cheaper and better")
        ax.axhline(q.terms.limit, color=look.ink, ls=LINES[1], lw=1.2,
                   label=f"limit: {q.terms.limit:g}{q.unit and f' {q.unit}'}")
        if answer.chosen is not None:
            row = at.loc[answer.chosen]
            ax.plot([row["x"]], [row["estimate"]], "o", mfc="none", mec=look.ink, ms=12, mew=1.4,
                    label="the answer")
        unit = f" [{q.unit}]" if q.unit else ""
        words = q.words[0].upper() + q.words[1:]
        currency = f" [{q.terms.currency}]" if q.terms.currency else ""
        ax.set(xlabel=f"Cost{currency}" if q.costs else "Designs by accuracy",
               ylabel=f"{words}:\n{100 * q.terms.share:g} % of the runs are within{unit}")
        if not q.costs:
            ax.set_xticks([])
        if ax.get_yscale() == "linear":
            ax.set_ylim(bottom=0.0)
        if own:
            ax.figure.legend(loc="outside lower center", ncols=2)
        else:
            ax.legend(loc="best")
        _name(ax, answer, at)
    return ax


def _places(answer: Answer) -> pd.DataFrame:
    """The designs with their place on the horizontal axis."""
    if answer.question.costs:
        return answer.designs.assign(x=answer.designs["cost"])
    order = answer.designs["estimate"].rank(method="first", na_option="bottom")
    return answer.designs.assign(x=order)


def _name(ax: Axes, answer: Answer, at: pd.DataFrame) -> None:
    """The levels of the designs on the front, or of the one that is named."""
    finite = at[np.isfinite(at["estimate"])]
    shown = finite[finite["front"]] if answer.question.costs else finite[:0]
    more = [n for n in (answer.named, answer.cheaper) if n in finite.index]
    shown = finite.loc[sorted({*shown.index, *more})]
    ax.margins(x=0.14)
    ax.figure.draw_without_rendering()  # type: ignore[union-attr]  # places the axes
    words = ["\n".join(answer.question.named({n: v}) for n, v in answer.row(i).items())
             for i in shown.index]  # fmt: skip
    points = shown[["x", "estimate"]].to_numpy(np.float64)
    others = finite[["x", "estimate"]].to_numpy(np.float64)
    x = np.linspace(*ax.get_xlim(), 200)
    limit = np.column_stack([x, np.full_like(x, answer.question.terms.limit)])
    places: Any = free_places(ax, points, words, np.vstack([others, limit]))
    for (left, up), word, place in zip(points, words, places, strict=True):
        ax.text(left, up, word, fontsize=SMALL, **place)
