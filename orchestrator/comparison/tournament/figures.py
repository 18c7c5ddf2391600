"""The figure of a tournament: errors of the receivers, and how certain the differences are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ...catalogue import Job
from ...layout import filled
from ...results.figures.drawing import short
from ...results.responses import unit_of
from ...style import SMALL, Theme, ThemeName, new_figure, use
from ..common.evaluation import ALL, by_place
from ..common.statistics import Floats
from .sentences import in_place, rows_of, words_of

if TYPE_CHECKING:
    from .result import Tournament

ROW, ABOVE = 0.27, 0.75
"""Height of a receiver, and of the space above and below the receivers of a place [inch]."""
REACH, FAR = 6.0, 1.5
"""Multiple of the differences' median, and of the best receiver's median, beyond which differences
are drawn at the edge."""
LEAST_BAND = 0.004
"""Smallest visible fraction of an axis for a band."""
_CHARACTERS, _TICKS, _LEGEND = 18.0, 2.0, 3.2
"""Characters per inch of a label and on an axis; inches of a column of the legend."""
_MARKS = {
    "worse": ("s", "worse than the best"), "undecided": ("o", "undecided"),
    "equal": ("D", "equal for practical purposes"), "better": ("^", "better here"),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Panel:
    """The contents of a row of panels.

    Attributes
    ----------
    receivers
        Receivers, beginning with the smallest median.
    spread
        5th, 25th, 75th and 95th percentile and median of each receiver's runs, shape (n, 5).
    difference
        Median, lower and upper end of each receiver minus the best one, shape (n − 1, 3).
    verdicts
        Verdict on each receiver except the best one.
    """

    place: str
    receivers: tuple[str, ...]
    spread: Floats
    difference: Floats
    verdicts: tuple[str, ...]


def job(it: Tournament, name: str = "comparison", differences: bool = True) -> Job:
    """The figure, ready to be drawn; without differences it shows only the runs."""
    return Job(name, plot_tournament, shown(it, differences))


def shown(
    it: Tournament, differences: bool = True
) -> tuple[list[Panel], str, str, float | None]:
    """Contents of the figure: panels, response and its unit, practical difference."""
    runs = {name: it.table[it.table["scenario"] == name] for name in it.places if name != ALL}
    values = by_place(runs, it.response)
    panels = []
    for place in sorted(it.places, key=lambda place: place != ALL):
        names = in_place(it, place)
        good = [values[place][name][np.isfinite(values[place][name])] for name in names]
        spread = [
            [*np.percentile(y, (5, 25, 75, 95, 50))] if len(y) else [np.nan] * 5 for y in good
        ]
        rows = [
            row for row in rows_of(it, place, it.response) if differences and row.one == names[0]
        ]
        flipped = {"better": "worse", "worse": "better"}
        panels.append(Panel(
            place, tuple(names), np.array(spread).reshape(-1, 5),
            np.array([[-row.median, -row.high, -row.low] for row in rows]).reshape(-1, 3),
            tuple(flipped.get(row.verdict, row.verdict) for row in rows),
        ))  # fmt: skip
    return panels, words_of(it.response), unit_of(it.response), it.settings["practical"]


def plot_tournament(
    panels: Sequence[Panel],
    response: str,
    unit: str,
    practical: float | None = None,
    axes: Sequence[Axes] | None = None,
    theme: ThemeName = "light",
) -> Sequence[Axes]:
    """Draw the runs of each receiver, and the differences from the best one.

    The left panel shows the middle half of the runs (thick), 5 to 95 % of them (thin) and their
    median. The right panel shows the median differences with simultaneous intervals, and the
    practical difference. Each place has a row of two panels, or a left panel for a single receiver.
    """
    both = any(len(panel.difference) for panel in panels)
    with use(theme, axes) as look:
        if axes is None:
            heights = [ABOVE + ROW * len(panel.receivers) for panel in panels]
            figure = new_figure(7.2, sum(heights) + 1.0)
            grid = figure.subplots(
                len(panels), 2 if both else 1, squeeze=False, height_ratios=heights, sharey="row"
            )
            axes = list(grid.flat)
        sides = 2 if both else 1
        if len(axes) != sides * len(panels):
            raise ValueError(f"axes: must be {sides * len(panels)} axes, got {len(axes)}")
        label = f"{response} [{unit}]" if unit else response
        for i, panel in enumerate(panels):
            _spread(axes[sides * i], panel, look, label)
            if both:
                _difference(axes[sides * i + 1], panel, look, unit, practical)
        handles = _key(panels, list(axes)[1::2] if both else (), look, unit, practical)
        whole = axes[0].figure
        if list(axes) == whole.axes and whole.get_layout_engine() is not None:
            columns = max(1, int(whole.bbox.width / whole.dpi / _LEGEND))
            whole.legend(handles=handles, loc="outside upper center", ncols=columns)
        else:
            axes[-1].legend(handles=handles)
    return axes


def _key(
    panels: Sequence[Panel], differences: Sequence[Axes], look: Theme, unit: str,
    practical: float | None,
) -> list[Any]:
    """Legend entries for the marks, bars and bands that are drawn."""
    spread = np.vstack([panel.spread for panel in panels])
    handles: list[Any] = [
        Line2D([], [], marker="o", ls="", label="circle: median of the runs", **_middle(look))
    ]
    if (spread[:, 2] > spread[:, 1]).any():
        handles.append(Line2D([], [], color=look.receivers[1], lw=5,
                              label="thick bar: middle half of the runs"))
    if (spread[:, 3] > spread[:, 0]).any():
        handles.append(Line2D([], [], color=look.ink, lw=0.9,
                              label="thin line: 5 to 95 % of the runs"))
    verdicts = {verdict for panel in panels for verdict in panel.verdicts}
    handles += [
        Line2D([], [], marker=mark, label=words, ls="", **_look(word, look))
        for word, (mark, words) in _MARKS.items() if word in verdicts
    ]  # fmt: skip
    if not differences:
        return handles
    if any(np.isfinite(panel.difference[:, 1:]).any() for panel in panels):
        handles.append(Line2D([], [], color=look.soft, lw=1.6,
                              label="bar: 95 % interval of the difference"))
    handles.append(Line2D([], [], marker="|", ls="", ms=11, color=look.ink,
                          label="like the best; right of it: worse"))
    spans = [float(np.ptp(ax.get_xlim())) for ax in differences]
    if practical is not None and any(2 * practical > LEAST_BAND * span for span in spans):
        band = f"±{practical:g} {unit}".rstrip()
        handles.append(Patch(color=look.grid, label=f"grey: within {band}, does not matter"))
    return handles


def _middle(look: Theme) -> dict[str, Any]:
    return {"ms": 5.0, "mew": 1.2, "mfc": look.paper, "mec": look.ink}


def _look(verdict: str, look: Theme) -> dict[str, Any]:
    colour = {
        "worse": look.receivers[0], "equal": look.receivers[1], "better": look.receivers[2],
    }.get(verdict, look.soft)  # fmt: skip
    filled = verdict in ("worse", "better")
    return {"color": colour, "mfc": colour if filled else look.paper, "ms": 5.5, "lw": 1.6}


def _rows(ax: Axes, panel: Panel) -> None:
    """A row for each receiver, the best one on top."""
    count = len(panel.receivers)
    ax.set_yticks(range(count), [short(name) for name in panel.receivers])
    ax.set_ylim(count - 0.5, -0.5)
    ax.tick_params(axis="y", length=0)
    ax.grid(visible=False, axis="y")


def _spread(ax: Axes, panel: Panel, look: Theme, label: str) -> None:
    _rows(ax, panel)
    for y, (low, first, third, high, median) in enumerate(panel.spread):
        ax.plot([low, high], [y, y], color=look.ink, lw=0.9, solid_capstyle="butt")
        ax.plot([first, third], [y, y], color=look.receivers[1], lw=5, solid_capstyle="butt")
        ax.plot(median, y, "o", zorder=4, **_middle(look))
    ends = panel.spread[np.isfinite(panel.spread) & (panel.spread > 0)]
    if len(ends) and ends.max() > 50 * ends.min():
        ax.set_xscale("log")
    else:
        ax.set_xlim(left=0.0)
    ax.set_title(panel.place, loc="left", fontweight="bold")
    _label(ax, f"{label}, 5 to 95 % of runs")


def _difference(
    ax: Axes, panel: Panel, look: Theme, unit: str, practical: float | None
) -> None:
    _rows(ax, panel)
    ax.tick_params(axis="y", labelleft=False)
    if practical is not None:
        ax.axvspan(-practical, practical, color=look.grid, lw=0, zorder=0)
    ax.axvline(0.0, color=look.ink, lw=1.0)
    middles = np.abs(panel.difference[:, 0])
    known = middles[np.isfinite(middles)]
    best = abs(float(panel.spread[0, -1]))
    edge = max(REACH * float(np.median(known)), FAR * best) if len(known) and best > 0 else np.inf
    for y, ((median, low, high), verdict) in enumerate(
        zip(panel.difference, panel.verdicts, strict=True), 1
    ):
        style = _look(verdict, look)
        if not np.isnan(low):
            ends = np.clip([low, high], -edge, edge)
            ax.plot(ends, [y, y], color=style["color"], lw=style["lw"])
        beyond = abs(median) > edge
        mark = _MARKS[verdict][0] if not beyond else ">" if median > 0 else "<"
        at = np.clip(median, -edge, edge)
        ax.plot(at, y, ls="", marker=mark, color=style["color"], mfc=style["mfc"], ms=style["ms"],
                zorder=4)
        if beyond:
            ax.annotate(f"{median:.3g}", (at, y), (0, 3), textcoords="offset points",
                        fontsize=SMALL, ha="right" if median > 0 else "left", va="bottom")
    ax.margins(x=0.06)
    of = f" [{unit}]" if unit else ""
    held = "" if np.isnan(panel.difference[:, 1:]).all() else ", 95 % all at once"
    _label(ax, f"median difference from {short(panel.receivers[0])}{of}{held}")


def _label(ax: Axes, text: str) -> None:
    """Label the horizontal axis, in several lines if it is too narrow for one."""
    inches = ax.get_position().width * ax.figure.bbox.width / ax.figure.dpi
    ax.set_xlabel(filled(text, max(int(_CHARACTERS * inches), 12)), fontsize=SMALL)
    if ax.get_xscale() == "linear":
        ax.locator_params(axis="x", nbins=max(3, round(_TICKS * inches)))
