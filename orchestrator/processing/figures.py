"""Figures of a processed log: map, errors over time, residuals of ranges."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from sblcosim.fmus.host.nanoseconds import SECOND

from ..data.estimates import Estimates, Floats
from ..data.truth import Truth
from ..logs.log import Log
from ..results.figures import drawing
from ..results.figures.drawing import Tracks
from ..results.figures.maps import MOST_TOGETHER, Sheet, limits_of, name_axes
from ..results.figures.run import scale_time
from ..style import LINES, ThemeName, use
from .quality import residuals_of

_WHOLE = 99.0
"""Percentage of the errors and residuals that a panel shows at least."""
_MOST_BEACONS = 8
_MARKS = ("o", "s", "^", "D", "v", "P", "X", "*")


def plot_map(
    log: Log, tracks: Tracks, truth: Truth | None, ax: Axes | None = None,
    theme: ThemeName = "light",
) -> Axes:
    """Map of the beacons, the estimates, and the truth if there is one.

    A new figure has a map for each receiver, on common axes, if there are more than
    `MOST_TOGETHER` filters; the first of them is returned. All tracks must be along the same axes.
    """
    with use(theme, ax) as look:
        own = ax is None
        own_axes = any(map(log.in_own_axes, tracks))
        beacons = _beacons(log) if own_axes == log.in_own_axes("") else np.zeros((0, 3))
        seen = [beacons] if truth is None else [beacons, truth.position]
        some = {label: table for label, table in tracks.items() if len(table)}
        if truth is None:
            seen += [_middle(table) for table in some.values() if len(table)]
        limits = (
            limits_of(np.vstack(seen), some, "xy") if truth is not None
            else _limits(np.vstack(seen))
        )
        apart = own and sum(map(drawing.is_filter, some)) > MOST_TOGETHER
        names = ["beacons", *([] if truth is None else ["truth"]), *([] if apart else some)]
        sheet = Sheet(limits, len(some) if apart else 1, drawing.legend_width(names))
        maps = [ax] if ax is not None else sheet.axes()
        styled = list(drawing.lines_of(some, look))
        for i, panel in enumerate(maps):
            if len(beacons):
                panel.plot(beacons[:, 1], beacons[:, 0], "^", ms=7, color=look.ink, mfc="none",
                           label="beacons", zorder=6)
            if truth is not None:
                panel.plot(truth.position[:, 1], truth.position[:, 0], label="truth",
                           **drawing.truth_of(look))
            for label, table, how in styled[i : i + 1] if apart else styled:
                drawing.add_line(
                    panel, table["y_m"], table["x_m"], how | ({} if apart else {"label": label})
                )
            shown = sheet.limits if own else limits
            panel.set(xlim=shown["y_m"], ylim=shown["x_m"], aspect="equal")
            if apart:
                panel.set_title(drawing.short_for(styled[i][0], sheet.wide), loc="left")
        name_axes(maps, *(("Forward x [m]", "Starboard y [m]") if own_axes else ()))
        drawing.finish(
            maps, own, "map", drawing.outside(some, limits), drawing.no_fix(tracks),
            beside=sheet.beside,
        )
    return maps[0]


def _beacons(log: Log) -> Floats:
    """Where the beacons were, NED [m]: the median of each; (beacons, 3)."""
    heard = log.receptions
    each = [heard.beacon_position[heard.beacon == i] for i in range(len(log.beacons))]
    rows = [np.median(own, axis=0) for own in each if len(own)]
    return np.array(rows).reshape(-1, 3)


def _limits(seen: Floats) -> dict[str, tuple[float, float]]:
    """Limits of north and east that contain points, with a margin [m]."""
    low, high = seen[:, :2].min(axis=0), seen[:, :2].max(axis=0)
    margin = max(0.06 * float((high - low).max()), 0.5)
    low, high = low - margin, high + margin
    return {f"{axis}_m": (float(low[i]), float(high[i])) for i, axis in enumerate("xy")}


def _middle(table: Any) -> Floats:
    """Corners that contain most estimates, NED [m]."""
    position = table[["x_m", "y_m", "z_m"]].to_numpy(float)
    corners: Floats = np.percentile(position, [1, 99], axis=0)
    return corners


def plot_errors(
    log: Log, tracks: Tracks, axes: Sequence[Axes] | None = None, theme: ThemeName = "light"
) -> Sequence[Axes]:
    """Errors over time with each filter's ±2σ band, north, east, down and horizontal.

    Three axes for a log in a plane, four for others.
    """
    deep = log.meta.dimension == 3
    kinds = [("x", "north"), ("y", "east"), *([("z", "down")] if deep else [])]
    with use(theme, axes) as look:
        own = axes is None
        axes = drawing.panels(len(kinds) + 1, axes)
        some = {label: table for label, table in tracks.items() if len(table)}
        bands = ""
        for ax, (axis, words) in zip(axes, kinds, strict=False):
            reach = []
            for label, table, how in drawing.lines_of(some, look):
                error = (table[f"{axis}_m"] - table[f"true_{axis}_m"]).to_numpy(float)
                drawing.add_line(ax, table["epoch_s"], error, how | {"label": label})
                reach.append(_most(error, label))
                if f"std_{axis}_m" in table and drawing.is_filter(label):
                    band = 2 * table[f"std_{axis}_m"].to_numpy(float)
                    bands = drawing.draw_claim(ax, table["epoch_s"], band, label, how, some)
            ax.axhline(0, color=look.ink, lw=0.8, zorder=2)
            top = max([r for r in reach if np.isfinite(r)], default=1.0)
            ax.set(ylim=(-1.1 * top, 1.1 * top), ylabel=f"Error {words} [m]")
        reach, level = [], {}
        for label, table, how in drawing.lines_of(some, look):
            level[label] = error = table["error_horizontal_m"].to_numpy(float)
            drawing.add_line(axes[-1], table["epoch_s"], error, how | {"label": label})
            reach.append(_most(error, label))
        top = 1.1 * max([r for r in reach if np.isfinite(r)], default=1.0)
        axes[-1].set(ylim=(0, top), ylabel="Horizontal [m]")
        beyond = {label: int((error > top).sum()) for label, error in level.items()}
        scale_time(axes, 0.0, (log.stop_ns - log.start_ns) / SECOND)
        outside = ", ".join(
            f"{drawing.short(label)} ({n:,} of {len(level[label]):,})"
            for label, n in beyond.items() if n
        )
        drawing.finish(axes, own, "estimate minus truth", bands,
                       f"outside, horizontally: {outside}" if outside else "",
                       drawing.no_fix(tracks))
    return axes


def _ends(off: Floats) -> tuple[float, float]:
    """Limits of an axis that holds zero and nearly all residuals [m]."""
    rest = (100 - _WHOLE) / 2
    low, high = np.percentile(off, [rest, 100 - rest]) if len(off) else (-1.0, 1.0)
    low, high = min(float(low), 0.0), max(float(high), 0.0)
    margin = max(0.15 * (high - low), 1e-3)
    return low - margin, high + margin


def _most(error: Floats, label: str) -> float:
    """Size of nearly all errors of a filter [m]; a raw fix does not stretch a panel."""
    known = np.abs(error[np.isfinite(error)])
    if not len(known):
        return np.nan
    return float(np.percentile(known, _WHOLE if drawing.is_filter(label) else 50))


def plot_residuals(
    log: Log, label: str, estimates: Estimates, by: str = "time",
    axes: Sequence[Axes] | None = None, theme: ThemeName = "light",
) -> Sequence[Axes]:
    """Residuals of the ranges by beacon, over time or over the range; one axis.

    Parameters
    ----------
    by
        ``"time"`` or ``"range"``.
    """
    with use(theme, axes) as look:
        own = axes is None
        axes = drawing.panels(1, axes, (3.2,))
        (ax,) = axes
        which, off = residuals_of(log, estimates)
        heard = log.receptions
        beacon = heard.beacon[which]
        time = (heard.epoch_ns[which] - log.start_ns) / SECOND
        over = time if by == "time" else heard.range[which]
        low, high = _ends(off)
        for number, name in enumerate(log.beacons[:_MOST_BEACONS]):
            some = beacon == number
            ax.plot(
                over[some], off[some], label=name, ls="", ms=3.5, mew=0.9, alpha=0.8, mfc="none",
                marker=_MARKS[number], color=look.receivers[number % len(look.receivers)],
            )
        ax.axhline(0, color=look.ink, lw=0.8, ls=LINES[0], zorder=2)
        ax.set(ylim=(low, high), ylabel="Residual [m]")
        if by == "time":
            scale_time(axes, 0.0, (log.stop_ns - log.start_ns) / SECOND)
        else:
            ax.set_xlabel("Range [m]")
            ax.margins(x=0.02)
        beyond = int(((off < low) | (off > high)).sum())
        left_out = len(log.beacons) - _MOST_BEACONS
        drawing.finish(
            axes, own, f"ranges minus those of {label}, by beacon",
            f"{beyond} of {len(off):,} lie outside" if beyond else "",
            f"{left_out} beacons are not shown" if left_out > 0 else "",
        )
    return axes
