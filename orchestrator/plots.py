"""Figures of a run, as in the paper's Figures 6, 9 and 12 to 14.

Each function draws into the axes it is given, or into a new figure, and returns the axes. Tables
of estimates are those of `metrics.track`, by receiver. Maps have east to the right and north up.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import ceil
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from .metrics import AXES, Floats, error_column, recorded
from .style import LINES, Theme, ThemeName, new_figure, use
from .wiring import RAW

if TYPE_CHECKING:
    from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]

    from .record import Record

Tracks = Mapping[str, pd.DataFrame]

FIXES = (RAW, "multilateration")
"""Receivers without dynamics: their estimates are drawn as dots, not joined."""
NAMES = {"x": "North x", "y": "East y", "z": "Depth z"}
INCLINATION_WINDOW_S = 60.0


def plot_path(
    record: Record, tracks: Tracks, ax: Axes | None = None, theme: ThemeName = "light"
) -> Axes:
    """Path and estimates from above, with the platform (the paper's Figures 11 and 12a)."""
    with use(theme) as look:
        own = ax is None
        ax = ax or new_figure(6.4, 6.0).add_subplot()
        truth = recorded(record, "target.position")
        beacons = recorded(record, "platform.beacon_position").mean(axis=0)
        _platform(ax, beacons[:, [1, 0]], look)
        ax.plot(truth[:, 1], truth[:, 0], color=look.ink, label="true path", zorder=3)
        for label, table, how in _tracks(tracks, look):
            ax.plot(table["y_m"], table["x_m"], label=label, **how)
        for row, word, marker in ((0, "start", "o"), (-1, "end", "s")):
            ax.plot(*truth[row, [1, 0]], marker, color=look.ink, mfc=look.paper, ms=7, zorder=5)
            ax.annotate(word, (truth[row, 1], truth[row, 0]), (7, 6),
                        textcoords="offset points", zorder=6)
        reference = np.vstack([truth, beacons])
        ax.set_xlim(*_limits(reference[:, 1], _columns(tracks, "y_m")))
        ax.set_ylim(*_limits(reference[:, 0], _columns(tracks, "x_m")))
        ax.set_aspect("equal")
        ax.set(xlabel="East y [m]", ylabel="North x [m]")
        _legend(ax.figure, [ax], own)
    return ax


def plot_path_3d(
    record: Record, tracks: Tracks, ax: Axes3D | None = None, theme: ThemeName = "light"
) -> Axes3D:
    """Path and estimates in space, depth downwards (the paper's Figure 12b)."""
    with use(theme) as look:
        own = ax is None
        ax = ax or new_figure(6.8, 4.6).add_subplot(projection="3d")
        truth = recorded(record, "target.position")
        beacons = recorded(record, "platform.beacon_position").mean(axis=0)
        reference = np.vstack([truth, beacons])
        limits = {
            axis: _limits(reference[:, i], _columns(tracks, f"{axis}_m"))
            for i, axis in enumerate(AXES)
        }
        for pair in ((0, 2), (1, 3)):
            ax.plot(*beacons[pair, :][:, [1, 0, 2]].T, color=look.soft, marker="^", ms=5,
                    label="beacons" if pair[0] == 0 else None)
        ax.plot(*truth[:, [1, 0, 2]].T, color=look.ink, label="true path")
        ax.text(*truth[0, [1, 0, 2]], " start")
        ax.text(*truth[-1, [1, 0, 2]], " end")
        for label, table, how in _tracks(tracks, look):
            # points outside would be drawn outside of the box
            shown = table[["y_m", "x_m", "z_m"]].copy()
            for axis in AXES:
                shown[~table[f"{axis}_m"].between(*limits[axis])] = np.nan
            ax.plot(*shown.to_numpy().T, label=label, **how)
        ax.set(xlim=limits["y"], ylim=limits["x"], zlim=limits["z"][::-1])
        ax.set(xlabel="East y [m]", ylabel="North x [m]", zlabel="Depth z [m]")
        width, depth = np.ptp(limits["y"]), np.ptp(limits["x"])
        ax.set_box_aspect((width, depth, max(np.ptp(limits["z"]), 0.35 * max(width, depth))),
                          zoom=1.3)
        for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
            axis.set_major_locator(MaxNLocator(5))
            axis.set_pane_color(look.paper)
            axis._axinfo["grid"].update(color=look.grid, linewidth=0.6)
        _legend(ax.figure, [ax], own)
    return ax


def plot_axes(
    record: Record, tracks: Tracks, axes: Sequence[Axes] | None = None, theme: ThemeName = "light"
) -> Sequence[Axes]:
    """True and estimated coordinates over time (the paper's Figure 13); three axes."""
    with use(theme) as look:
        own = axes is None
        axes = _panels(3, axes)
        time_s, truth = record.time_ns / 1e9, recorded(record, "target.position")
        for i, (ax, axis) in enumerate(zip(axes, AXES, strict=True)):
            ax.plot(time_s, truth[:, i], color=look.ink, lw=1, label="truth", zorder=5)
            for label, table, how in _tracks(tracks, look):
                ax.plot(table["epoch_s"], table[f"{axis}_m"], label=label, **how)
            ax.set_ylim(*_limits(truth[:, i], _columns(tracks, f"{axis}_m"), least=0.5))
            ax.set_ylabel(f"{NAMES[axis]} [m]")
        axes[2].invert_yaxis()
        axes[-1].set_xlabel("Time [s]")
        _legend(axes[0].figure, axes, own)
    return axes


def plot_errors(
    tracks: Tracks,
    axes: Sequence[Axes] | None = None,
    frame: str = "absolute",
    theme: ThemeName = "light",
) -> Sequence[Axes]:
    """Errors over time with each filter's own ±2σ, and the total error (the paper's Figure 14).

    Four axes. `frame` is ``absolute`` or ``relative`` (to the platform).
    """
    with use(theme) as look:
        own = axes is None
        axes = _panels(4, axes)
        hidden = False
        for ax, axis in zip(axes, (*AXES, "total"), strict=True):
            column = error_column(frame, axis)
            for label, table, how in _tracks(tracks, look):
                t, e = table["epoch_s"], table[column]
                ax.plot(t, e, label=label, **how)
                if f"std_{axis}_m" in table and label not in FIXES:
                    band = 2 * table[f"std_{axis}_m"]
                    ax.fill_between(t, -band, band, color=how["color"], alpha=0.15, lw=0,
                                    label=f"{label} ±2σ", zorder=1)
            top = _error_limit(tracks, column, f"std_{axis}_m")
            ax.set_ylim((0 if axis == "total" else -top), top)
            if axis == "total":
                ax.set_ylabel("Total error [m]")
            else:
                ax.axhline(0, color=look.ink, lw=0.8, zorder=2)
                ax.set_ylabel(f"Error in {axis} [m]")
            hidden |= any((table[column].abs() > top).any() for table in tracks.values())
        axes[-1].set_xlabel("Time [s]")
        words = [
            "Estimate minus truth",
            ", relative to the platform" if frame == "relative" else "",
            "; larger errors lie outside of the figure" if hidden else "",
        ]
        axes[0].set_title("".join(words), loc="left")
        _legend(axes[0].figure, axes, own)
    return axes


def plot_inclination(
    record: Record,
    axes: Sequence[Axes] | None = None,
    window_s: float = INCLINATION_WINDOW_S,
    theme: ThemeName = "light",
) -> Sequence[Axes]:
    """True roll, pitch and yaw of the platform (the paper's Figure 9), in the first `window_s`."""
    with use(theme) as look:
        own = axes is None
        axes = _panels(3, axes)
        time_s = (record.time_ns - record.time_ns[0]) / 1e9
        shown = time_s <= window_s
        angles = np.rad2deg(recorded(record, "platform.attitude")[shown])
        middle = (angles.max(axis=0) + angles.min(axis=0)) / 2
        marker = ".-" if len(angles) < 200 else "-"  # few instants: show that the waves are sampled
        reach = max(1.15 * np.ptp(angles, axis=0).max() / 2, 0.5)
        for i, (ax, name) in enumerate(zip(axes, ("Roll", "Pitch", "Yaw"), strict=True)):
            ax.plot(record.time_ns[shown] / 1e9, angles[:, i], marker, color=look.receivers[1])
            ax.set_ylim(middle[i] - reach, middle[i] + reach)
            ax.set_ylabel(f"{name} [°]")
        axes[-1].set_xlabel("Time [s]")
        part = f", first {window_s:g} s" if not shown.all() else ""
        axes[0].set_title(f"Inclination of the platform{part}", loc="left")
        _legend(axes[0].figure, axes, own)
    return axes


def plot_range_test(
    distance: Floats,
    mean: Floats,
    std: Floats,
    line: tuple[float, float],
    axes: Sequence[Axes] | None = None,
    theme: ThemeName = "light",
) -> Sequence[Axes]:
    """Measured range against true distance, and what is left over (the paper's Figure 6).

    Parameters
    ----------
    distance, mean, std
        True distances, mean and standard deviation of the ranges there [m]; shape (n,).
    line
        Intercept [m] and slope of the fitted line.
    axes
        Two axes.
    """
    with use(theme) as look:
        own = axes is None
        axes = _panels(2, axes, (2, 1))
        above, below = axes
        ends = np.array([0.0, 1.04 * distance.max()])
        above.plot(ends, ends, color=look.ink, lw=1, label="range = distance")
        above.plot(distance, mean, "o", ms=4.5, color=look.receivers[0], mfc="none",
                   label="mean range, ± standard deviation")
        above.set_ylabel("Measured range [m]")
        below.axhline(0, color=look.ink, lw=1)
        below.errorbar(distance, mean - distance, std, fmt="o", ms=4.5, color=look.receivers[0],
                       mfc="none", capsize=2.5, lw=1)
        below.plot(ends, line[0] + (line[1] - 1) * ends, color=look.receivers[1], ls=LINES[1],
                   label="fitted line")
        below.set(ylabel="Range − distance [m]", xlabel="True distance [m]", xlim=ends)
        _legend(above.figure, axes, own)
    return axes


def _tracks(tracks: Tracks, look: Theme) -> Iterator[tuple[str, pd.DataFrame, dict[str, Any]]]:
    """Each receiver with its table and how it is drawn; raw fixes as small faint dots."""
    filters = [label for label in tracks if label not in FIXES]
    for label, table in tracks.items():
        if label in FIXES:
            how: dict[str, Any] = {
                "color": look.soft, "ls": "", "marker": ".", "ms": 2.5, "alpha": 0.55,
                "mew": 0, "zorder": 2, "rasterized": len(table) > 5000,
            }
        else:
            place = filters.index(label)
            how = {
                "color": look.receivers[place % len(look.receivers)],
                "ls": LINES[place % len(LINES)], "lw": 1.2, "zorder": 4,
            }
        yield label, table, how


def _platform(ax: Axes, beacons: Floats, look: Theme) -> None:
    """The cross with its beacons; `beacons` are the map's (horizontal, vertical), shape (4, 2)."""
    for pair in ((0, 2), (1, 3)):
        ax.plot(*beacons[pair, :].T, color=look.ink, lw=1, zorder=3)
    ax.plot(*beacons.T, "^", color=look.ink, mfc=look.soft, ms=6, label="beacons", zorder=3)


def _panels(count: int, axes: Sequence[Axes] | None, heights: Sequence[float] | None = None
            ) -> Sequence[Axes]:
    if axes is not None:
        if len(axes) != count:
            raise ValueError(f"axes: must be {count} axes, got {len(axes)}")
        return axes
    figure = new_figure(7.2, 1.6 + 1.45 * count if heights is None else 5.6)
    grid = figure.subplots(count, sharex=True, gridspec_kw={"height_ratios": heights})
    figure.align_ylabels(grid)
    for ax in grid:
        ax.margins(x=0.01)
    return list(grid)


def _legend(figure: Any, axes: Sequence[Any], own: bool) -> None:
    """One legend for all axes: above the axes in a figure of ours, else where there is room."""
    found = {
        label: handle
        for ax in axes
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)
    }
    if not found:
        return
    if own and isinstance(figure, Figure):
        rows = ceil(sum(len(label) + 8 for label in found) / 90)
        legend = figure.legend(found.values(), found.keys(), loc="outside upper center",
                               ncols=ceil(len(found) / rows))
    else:
        legend = axes[0].legend(found.values(), found.keys())
    for handle in legend.legend_handles:
        if isinstance(handle, Line2D) and handle.get_marker() == ".":
            handle.set(markersize=8, alpha=1)


def _columns(tracks: Tracks, column: str) -> list[Floats]:
    """A column of each filter, or of each raw fix if there are no filters."""
    filters = [label for label in tracks if label not in FIXES]
    return [tracks[label][column].to_numpy() for label in filters or tracks if len(tracks[label])]


def _limits(truth: Floats, estimates: Sequence[Floats], least: float = 1.0) -> tuple[float, float]:
    """Limits that hold the truth and the estimates near it; at least `least` m apart.

    An estimate that runs away leaves the figure instead of squeezing everything else.
    """
    low, high = float(truth.min()), float(truth.max())
    reach = max((high - low) / 2, 3.0)
    bottom = max(min([low, *(np.nanmin(e) for e in estimates)]), low - reach)
    top = min(max([high, *(np.nanmax(e) for e in estimates)]), high + reach)
    margin = max(0.06 * (top - bottom), (least - (top - bottom)) / 2)
    return bottom - margin, top + margin


def _error_limit(tracks: Tracks, error: str, std: str) -> float:
    """Upper limit that holds the filters' errors, but for wild ones, and most of the bands."""
    errors = [np.abs(e) for e in _columns(tracks, error)]
    tops = [min(np.nanmax(e), 4 * np.nanpercentile(e, 95)) for e in errors]
    filters = {k: v for k, v in tracks.items() if k not in FIXES and std in v}
    tops += [2 * np.nanpercentile(s, 90) for s in _columns(filters, std)]
    return max(1.1 * max(tops, default=1.0), 1e-3)
