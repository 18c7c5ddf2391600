"""The figure of advice: cost against accuracy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from ...results.figures.drawing import free_places
from ...study.design import shown
from ...style import LINES, SMALL, ThemeName, new_figure, use
from ..common.figures import add_legend
from .advice import Advice


def plot_front(advice: Advice, ax: Axes | None = None, theme: ThemeName = "light") -> Axes:
    """Cost against accuracy: all points, those that no other point beats, and the chosen one.

    Bars reach up to the points' upper confidence bounds, where these exist.
    """
    with use(theme, ax) as look:
        own = ax is None
        if ax is None:
            ax = new_figure(6.4, 4.4).add_subplot()
        points = advice.points[np.isfinite(advice.points["estimate"])]
        front = points[points["front"]]
        ax.plot(points["cost"], points["estimate"], ".", color=look.soft, ms=7, mew=0,
                label="design points")
        ax.step(front["cost"], front["estimate"], "-o", where="post", color=look.receivers[1],
                ms=5, label="no other point is cheaper and better")
        bound = front[np.isfinite(front["upper"])]
        ax.vlines(bound["cost"], bound["estimate"], bound["upper"], color=look.receivers[1], lw=1)
        if advice.limit is not None:
            ax.axhline(advice.limit, color=look.ink, ls=LINES[1], lw=1.2,
                       label=f"limit {advice.limit:g}")
        if advice.chosen is not None:
            row = advice.points.loc[advice.chosen]
            ax.vlines([row["cost"]], [row["estimate"]], [row["upper"]], color=look.receivers[0],
                      lw=2)
            ax.plot([row["cost"]], [row["estimate"]], "s", color=look.receivers[0], ms=8,
                    label="cheapest that meets the limit")
        unit = f" [{advice.unit}]" if advice.unit else ""
        statistic = advice.statistic[0].upper() + advice.statistic[1:]
        ax.set(xlabel="Cost", ylabel=f"{statistic}{unit}")
        ax.set_ylim(bottom=min(0.0, ax.get_ylim()[0]))
        ax.set_title("Cost and accuracy; labels: changes from the next cheaper point", loc="left")
        add_legend(ax, own)
        _label_front(ax, advice, points, front)
    return ax


def _label_front(ax: Axes, advice: Advice, points: pd.DataFrame, front: pd.DataFrame) -> None:
    """Label each point of the front with its changes from the next cheaper one."""
    ax.margins(x=0.12)
    ax.figure.draw_without_rendering()  # type: ignore[union-attr]  # places the axes
    words: list[str] = []
    before: dict[Any, Any] = {}
    for levels in front[list(advice.factors)].to_dict(orient="records"):
        new = [f"{name} {shown(v)}" for name, v in levels.items() if before.get(name) != v]
        words.append("\n".join(new))
        before = levels
    at = front[["cost", "estimate"]].to_numpy(np.float64)
    turns = np.column_stack([np.repeat(at[:, 0], 2)[1:], np.repeat(at[:, 1], 2)[:-1]])
    share = np.linspace(0, 1, 30)[:, None, None]
    drawn = (turns[:-1] + share * np.diff(turns, axis=0)).reshape(-1, 2)
    bounds = front[np.isfinite(front["upper"])][["cost", "upper"]].to_numpy(np.float64)
    limit = [] if advice.limit is None else [
        np.column_stack([np.linspace(*ax.get_xlim(), 200), np.full(200, advice.limit)])
    ]
    others = points[["cost", "estimate"]].to_numpy(np.float64)
    places = free_places(ax, at, words, np.vstack([drawn, others, bounds, *limit]))
    for (x, y), word, place in zip(at, words, places, strict=True):
        ax.text(x, y, word, fontsize=SMALL, **place)
