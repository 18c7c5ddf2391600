"""The figure of a budget: the share of the mean square that goes with each error."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from ...layout import filled
from ...style import PLAIN, ThemeName, new_figure, use
from ...words.lists import listed
from ...words.numbers import short_length
from ...words.shares import percent
from .result import FRAMES, Budget, bars
from .shares import CONFIDENCE

_NARROW = 5.0
"""Width of a figure [inch] below which the names of the sources are wrapped sooner."""
_CHARACTERS = 12.0
"""Characters of a title or label per inch."""


def plot_budget(
    budget: Budget, frame: str = "absolute", ax: Axes | None = None, theme: ThemeName = "light"
) -> Axes:
    """Shares of the mean square that go with each source alone, of the receiver and of the bound.

    Whiskers are the 95 % intervals. Sources are sorted. Below them are the error that is left when
    all are switched, and what does not add up. Sources of 0 % are named in a line below, and so are
    those that the bound does not know. The key has what is drawn: bars, and the intervals across
    their ends.
    """
    names, none = bars(budget, frame)
    rows = budget.of(frame).loc[names]
    bound = not np.isnan(rows["bound_share"]).all()
    unseen = [budget.label(name) for name in budget.unseen(frame)] if bound else []
    lines = bool(none) + bool(unseen)
    with use(theme, ax) as look:
        own = ax is None
        if ax is None:
            ax = new_figure(6.4, 1.6 + 0.42 * len(names) + 0.16 * lines).add_subplot()
        inches = ax.figure.bbox.width / ax.figure.dpi
        labels = [filled(budget.label(name), 26 if inches > _NARROW else 16) for name in names]
        beside = max(len(line) for label in labels for line in label.split("\n"))
        across = max(round(_CHARACTERS * (inches - 0.3)) - beside, 12)
        y = np.arange(len(names))[::-1].astype(float)
        high = 0.38 if bound else 0.6
        share, low, top = (100 * rows[k].to_numpy() for k in ("share", "share_low", "share_high"))
        ax.barh(y + high / 2 * bound, share, high, color=look.receivers[0], label=budget.receiver)
        interval = f"{percent(CONFIDENCE, '.0f')} interval" if np.isfinite(low).any() else None
        ax.errorbar(
            share, y + high / 2 * bound, xerr=[np.fmax(share - low, 0), np.fmax(top - share, 0)],
            fmt="none", ecolor=look.ink, elinewidth=1.1, capsize=2.5, label=interval,
        )  # fmt: skip
        if bound:
            ax.barh(y - high / 2, 100 * rows["bound_share"].to_numpy(), high, hatch="///", lw=0,
                    color=look.receivers[1], edgecolor=look.paper, label=budget.bound_kind)
        ax.axvline(0, color=look.ink, lw=0.8)
        ax.axhline(1.5, color=look.soft, lw=0.8, ls=(0, (3, 2)))
        ax.set_yticks(y, labels, **PLAIN)
        ax.tick_params(axis="y", length=0)
        ax.grid(axis="y", visible=False)
        does = "is made better" if budget.better else "is switched off"
        label = filled(f"Share of the mean square that goes when this {does} [%]", across)
        if none:
            words = f"0 %: {listed([budget.label(name) for name in none])}"
            label += "\n" + filled(words, across)
        if unseen:
            words = f"not in the {budget.bound_kind}: {listed(unseen)}"
            label += "\n" + filled(words, across)
        ax.set_xlabel(label)
        whole = short_length(budget.of(frame)["rms_m"].iloc[0])
        title = f"{budget.receiver} in {budget.scenario}: {FRAMES[frame]}, {whole} RMS"
        ax.set_title(filled(title, across), loc="left")
        ax.margins(y=0.02)
        if own:
            ax.figure.legend(loc="outside lower center", ncols=3)
        else:
            ax.legend(loc="best", frameon=True, facecolor=look.paper, edgecolor="none")
    return ax
