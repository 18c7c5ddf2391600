"""The picture of a log: what was received when, the ranges, the depth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..data.estimates import Flags, Floats, Integers
from ..layout import shorter
from ..style import MARKERS, PLAIN, SMALL, ThemeName, new_figure, use
from .log import GAP, Log, usual_pause

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ROW = 0.2
"""Height of a row of the timeline [inch]."""
_LONGEST_NAME = 26
_MARK = 6.0
"""Size of a mark [point]."""
_PARTS = 12
"""Number of marks of a beacon."""


def gaps(times_ns: Integers) -> Flags:
    """Which pauses between times (n,) are gaps; (n - 1,)."""
    return np.diff(times_ns) > GAP * usual_pause(times_ns)


def series_of(log: Log) -> dict[str, Integers]:
    """Times of everything in a log [ns], by beacon, device or kind."""
    heard = log.receptions
    rows = {
        name: np.sort(heard.arrival_ns[heard.beacon == i]) for i, name in enumerate(log.beacons)
    }
    if len(log.depth):
        rows["depth"] = log.depth_ns
    if log.truth is not None and not log.own_clock:
        rows["truth"] = log.truth.time_ns
    return rows | {f"fixes {name}": it.epoch_ns for name, it in log.fixes.items()}


def plot_log(
    log: Log, axes: Sequence[Axes] | None = None, theme: ThemeName = "light"
) -> Sequence[Axes]:
    """What was received when; the ranges, or the positions of devices; the depth.

    Parameters
    ----------
    axes
        As many axes as there are panels: two, and one for the depth if the log has depths.
    """
    rows = series_of(log)
    heights = [0.3 + _ROW * max(len(rows), 2), 2.6, *((1.4,) if len(log.depth) else ())]
    with use(theme, axes) as look:
        if axes is None:
            figure = new_figure(7.2, 0.6 + sum(heights))
            axes = figure.subplots(len(heights), sharex=True, height_ratios=heights)
        name, unit = _unit(log)
        colours = _colours(rows, look.receivers, look.ink)
        _timeline(axes[0], log, rows, colours, unit)
        if len(log.receptions):
            _ranges(axes[1], log, colours, unit, look.paper)
        else:
            _positions(axes[1], log, colours, unit)
        if len(log.depth):
            axes[2].plot((log.depth_ns - log.start_ns) / unit, log.depth, ".", ms=2,
                         color=look.ink, rasterized=True)
            axes[2].invert_yaxis()
            axes[2].set_ylabel("Depth [m]")
        axes[-1].set_xlabel(f"Time [{name}]")
        end = (log.stop_ns - log.start_ns) / unit or 1.0
        for ax in axes:
            ax.set_xlim(-0.01 * end, 1.01 * end)
    return axes


def _unit(log: Log) -> tuple[str, float]:
    span = (log.stop_ns - log.start_ns) / 1e9
    return ("s", 1e9) if span < 300 else ("min", 6e10) if span < 10_800 else ("h", 3.6e12)


def _colours(
    rows: dict[str, Integers], palette: Sequence[str], ink: str
) -> dict[str, tuple[str, str]]:
    """Colour and marker of each row; depth and truth have that of the text.

    Colours repeat sooner than markers, so that no two of many rows have both in common.
    """
    names = [name for name in rows if name not in ("depth", "truth")]
    markers = MARKERS[1:]
    styles = {
        name: (palette[i % len(palette)], markers[i % len(markers)]) for i, name in enumerate(names)
    }
    return {name: styles.get(name, (ink, "o")) for name in rows}


def _timeline(
    ax: Axes, log: Log, rows: dict[str, Integers], colours: dict[str, tuple[str, str]],
    unit: float,
) -> None:
    for row, (name, times) in enumerate(rows.items()):
        colour, marker = colours[name]
        if not len(times):
            continue
        if name in log.beacons and len(log.receptions):  # the key to the marks among the ranges
            ax.plot(1.015, row, marker, ms=_MARK, color=colour, clip_on=False,
                    transform=ax.get_yaxis_transform())
        ends = np.flatnonzero(gaps(times))
        at = (times - log.start_ns) / unit
        first, last = at[np.r_[0, ends + 1]], at[np.r_[ends, len(at) - 1]]
        ax.hlines(np.full(len(first), row), first, last, color=colour, lw=5, alpha=0.45)
        ax.plot(at, np.full(len(at), row), "|", ms=7, mew=0.6, color=colour, rasterized=True)
    ax.set_yticks(range(len(rows)), [shorter(name, _LONGEST_NAME) for name in rows], **PLAIN)
    for label, name in zip(ax.get_yticklabels(), rows, strict=True):
        label.set(color=colours[name][0], fontsize=SMALL)
    ax.set_ylim(len(rows) - 0.4, -0.6)
    ax.grid(visible=False, axis="y")


def _ranges(
    ax: Axes, log: Log, colours: dict[str, tuple[str, str]], unit: float, paper: str
) -> None:
    """All ranges as points, and a mark at some of those of each beacon."""
    heard = log.receptions
    for i, name in enumerate(log.beacons):
        own = heard.beacon == i
        at, length = (heard.arrival_ns[own] - log.start_ns) / unit, heard.range[own]
        colour, marker = colours[name]
        ax.plot(at, length, ".", ms=3, mew=0, color=colour, rasterized=True)
        some = marked(at, (i + 0.5) / len(log.beacons), (log.stop_ns - log.start_ns) / unit)
        ax.plot(at[some], length[some], marker, ms=_MARK, mew=0.4, mec=paper, ls="", color=colour,
                zorder=3)
    ax.set_ylabel("Range [m]")


def marked(at: Floats, phase: float, span: float) -> Integers:
    """Numbers of the ranges that get a mark: one in each part of the log, where there is one.

    Parameters
    ----------
    at
        Times of the ranges (n,), from 0.
    phase
        Where in its part a mark is, from 0 to 1: that of each beacon is another.
    span
        Length of the log, in the unit of the times.
    """
    order = np.argsort(at, kind="stable")
    part = span / _PARTS or 1.0
    wanted = (np.arange(_PARTS) + phase) * part
    next_ = np.minimum(np.searchsorted(at[order], wanted), max(len(at) - 1, 0))
    near = np.abs(at[order][next_] - wanted) <= part if len(at) else np.zeros(_PARTS, bool)
    chosen: Integers = np.unique(order[next_[near]])
    return chosen


def _positions(
    ax: Axes, log: Log, colours: dict[str, tuple[str, str]], unit: float
) -> None:
    """North and east of the positions that devices have computed."""
    for name, fixes in log.fixes.items():
        colour, _ = colours[f"fixes {name}"]
        at: Floats = (fixes.epoch_ns - log.start_ns) / unit
        names = ("forward", "starboard") if log.in_own_axes(name) else ("north", "east")
        for axis, marker, words in zip((0, 1), "^>", names, strict=True):
            ax.plot(at, fixes.position[:, axis], marker, ms=2.5, ls="", mew=0, color=colour,
                    alpha=1.0 if axis == 0 else 0.5, rasterized=True,
                    label=f"{shorter(name, _LONGEST_NAME)}, {words}")
    ax.set_ylabel("Position [m]")
    legend = ax.legend(fontsize=SMALL, markerscale=2.5, ncols=2, loc="lower center",
                       bbox_to_anchor=(0.5, 1.0), borderaxespad=0.1)
    for text in legend.get_texts():
        text.set(**PLAIN)
