"""Figures of a run, as in the paper's Figures 6, 9 and 12 to 14.

Each function draws into the given axes or a new figure, and returns the axes. ``tracks`` holds the
tables of `metrics.track`, by receiver. On maps, east is to the right and north is up.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import ceil
from textwrap import fill
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import proj3d  # type: ignore[import-untyped]

from ..scenario.sources import RAW
from ..style import LINES, MARKERS, Theme, ThemeName, new_figure, use
from . import possible
from .definitions import AXES, FRAME_WORDS, Floats, recorded
from .metrics import error_column, with_errors

if TYPE_CHECKING:
    from mpl_toolkits.mplot3d import Axes3D

    from ..limits.verdict import Limits
    from ..simulation.record import Record

Tracks = Mapping[str, pd.DataFrame]

FIXES = (RAW, "multilateration")
"""Receivers without dynamics: their estimates are drawn as separate dots."""
NAMES = {"x": "North x", "y": "East y", "z": "Depth z"}
ENDS = ((0, "start", "o"), (-1, "end", "s"))
"""Row of the path, label and marker."""
INCLINATION_WINDOW_S = 60.0
COARSE_S = 0.25
"""Sampling interval [s] above which a line through samples of waves (periods from 1 s) misleads."""
LEGEND_INCH = 0.5
"""Height of a legend with two rows [inch]."""
DOTS_ALPHA = 0.9
NOTHING = "\u200b"
"""A zero-width space."""
LONGEST_NAME = 32
"""Longest name in a legend [characters]; all our own labels fit."""


def plot_path(
    record: Record, tracks: Tracks, ax: Axes | None = None, theme: ThemeName = "light"
) -> Axes:
    """Map of the path, the estimates and the platform (the paper's Figures 11 and 12a)."""
    with use(theme, ax) as look:
        own = ax is None
        ax = ax or new_figure(6.4, 6.0).add_subplot()
        truth = recorded(record, "target.position")
        beacons, name = _beacons(record, truth)
        for pair in ((0, 2), (1, 3)):
            ax.plot(*beacons[pair, :][:, [1, 0]].T, color=look.ink, lw=1, zorder=3)
        ax.plot(*beacons[:, [1, 0]].T, "^", color=look.ink, mfc=look.soft, ms=6, label=name,
                zorder=3)
        ax.plot(truth[:, 1], truth[:, 0], label="true path", **_truth(look))
        for label, table, how in _tracks(tracks, look):
            ax.plot(table["y_m"], table["x_m"], label=label, **how)
        reference = np.vstack([truth, beacons])
        limits = {
            f"{axis}_m": _limits(reference[:, i], _columns(tracks, f"{axis}_m"))
            for i, axis in enumerate("xy")
        }
        ax.set(xlim=limits["y_m"], ylim=limits["x_m"], aspect="equal")
        words = _ends(ax, truth[[0, -1]][:, [1, 0]])
        for row, word, marker in ENDS:
            point = (truth[row, 1], truth[row, 0])
            ax.plot(*point, marker, color=look.ink, mfc=look.paper, ms=7, zorder=6)
            if word in words:
                ax.annotate(words[word], point, (7, 6), textcoords="offset points", zorder=7)
        ax.set(xlabel="East y [m]", ylabel="North x [m]")
        _title(ax, _outside(tracks, limits), _no_fix(tracks), loc="center")
        _legend(ax.figure, [ax], own)
    return ax


def plot_path_3d(
    record: Record, tracks: Tracks, ax: Axes3D | None = None, theme: ThemeName = "light"
) -> Axes3D:
    """Path and estimates in space, depth downwards (the paper's Figure 12b)."""
    with use(theme, ax) as look:
        own = ax is None
        ax = ax or new_figure(6.8, 4.6).add_subplot(projection="3d")
        truth = recorded(record, "target.position")
        beacons, name = _beacons(record, truth)
        reference = np.vstack([truth, beacons])
        limits = {
            f"{axis}_m": _limits(reference[:, i], _columns(tracks, f"{axis}_m"))
            for i, axis in enumerate(AXES)
        }
        for pair in ((0, 2), (1, 3)):
            ax.plot(*beacons[pair, :][:, [1, 0, 2]].T, color=look.soft, marker="^", ms=5,
                    label=name if pair[0] == 0 else None)
        ax.plot(*truth[:, [1, 0, 2]].T, label="true path", **_truth(look))
        for label, table, how in _tracks(tracks, look):
            # 3-D axes do not clip: points beyond the limits would be drawn outside the box.
            shown = table[["y_m", "x_m", "z_m"]].copy()
            for column, limit in limits.items():
                shown[~table[column].between(*limit)] = np.nan
            ax.plot(*shown.to_numpy().T, label=label, **how)
        ax.set(xlim=limits["y_m"], ylim=limits["x_m"], zlim=limits["z_m"][::-1])
        ax.set(xlabel="East y [m]", ylabel="North x [m]", zlabel="Depth z [m]")
        north, east, depth = (np.ptp(limit) for limit in limits.values())
        height = max(depth, 0.35 * max(north, east))
        ax.set_box_aspect((east, north, height), zoom=1.3)
        flat = proj3d.proj_transform(*truth[[0, -1]][:, [1, 0, 2]].T, ax.get_proj())
        words = _ends(ax, np.column_stack(flat[:2]))
        for row, word, marker in ENDS:
            point = truth[row, [1, 0, 2]]
            ax.plot(*point[:, None], marker, color=look.ink, mfc=look.paper, ms=6, zorder=6)
            if word in words:
                ax.text(*point, f"  {words[word]}", zorder=7)
        stretched = f"depth ×{height / depth:.2g}" if height > 1.005 * depth else ""
        _title(ax, stretched, _outside(tracks, limits), _no_fix(tracks), loc="center")
        for line in ax.lines:
            # The zoomed box exceeds the clip area of the axes; the layout ignores 3-D positions.
            line.set(clip_on=False, in_layout=False)
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
    with use(theme, axes) as look:
        own = axes is None
        axes = _panels(3, axes)
        time_s, truth = record.time_ns / 1e9, recorded(record, "target.position")
        limits = {}
        for i, (ax, axis) in enumerate(zip(axes, AXES, strict=True)):
            ax.plot(time_s, truth[:, i], label="truth", **_truth(look))
            for label, table, how in _tracks(tracks, look):
                ax.plot(table["epoch_s"], table[f"{axis}_m"], label=label, **how)
            column = f"{axis}_m"
            limits[column] = _limits(truth[:, i], _columns(tracks, column), least=0.5)
            ax.set(ylim=limits[column], ylabel=f"{NAMES[axis]} [m]")
        axes[2].invert_yaxis()
        _time_axis(axes, record)
        _title(axes[0], _outside(tracks, limits), _no_fix(tracks))
        _legend(axes[0].figure, axes, own)
    return axes


def plot_errors(
    record: Record,
    tracks: Tracks,
    axes: Sequence[Axes] | None = None,
    frame: str = "absolute",
    reference: Limits | None = None,
    theme: ThemeName = "light",
) -> Sequence[Axes]:
    """Errors over time with each filter's ±2σ band, and the total error (the paper's Figure 14).

    Four axes over the whole run. `frame` is one of `definitions.FRAMES`; receivers without errors
    in it are left out. `reference` is what was possible: ±2σ, and the RMS of the total.

    Raises
    ------
    ConfigurationError
        There is no such frame, or no receiver has errors in it.
    """
    tracks = with_errors(tracks, frame)
    claim = "own_relative_std" if frame == "own_relative" else "std"
    with use(theme, axes) as look:
        own = axes is None
        axes = _panels(4, axes)
        limits, bands = {}, False
        for ax, axis in zip(axes, (*AXES, "total"), strict=True):
            column = error_column(frame, axis)
            for label, table, how in _tracks(tracks, look):
                t, e = table["epoch_s"], table[column]
                ax.plot(t, e, label=label, **how)
                if f"{claim}_{axis}_m" in table and label not in FIXES:
                    band = 2 * table[f"{claim}_{axis}_m"]
                    ax.fill_between(t, -band, band, color=how["color"], alpha=0.15, lw=0,
                                    label=label, zorder=1)
                    bands = True
            top = _error_limit(tracks, column, f"{claim}_{axis}_m")
            ax.set_ylim((0 if axis == "total" else -top), top)
            if axis == "total":
                ax.set_ylabel("Total error [m]")
            else:
                ax.axhline(0, color=look.ink, lw=0.8, zorder=2)
                ax.set_ylabel(f"Error in {axis} [m]")
            limits[column] = (-top, top)
        since_s = min((t["epoch_s"].min() for t in tracks.values() if len(t)), default=np.inf)
        possible.draw(axes, reference, frame, since_s, look)
        _time_axis(axes, record)
        _title(
            axes[0],
            "Estimate minus truth" + ("" if frame == "absolute" else f", {FRAME_WORDS[frame]}"),
            "bands: claimed ±2σ" if bands else "",
            _outside(tracks, limits),
            _no_fix(tracks),
        )
        _legend(axes[0].figure, axes, own)
    return axes


def plot_inclination(
    record: Record,
    axes: Sequence[Axes] | None = None,
    window_s: float = INCLINATION_WINDOW_S,
    theme: ThemeName = "light",
) -> Sequence[Axes]:
    """True roll, pitch and yaw of the platform in the first `window_s` (the paper's Figure 9)."""
    with use(theme, axes) as look:
        own = axes is None
        axes = _panels(3, axes)
        time_s = (record.time_ns - record.time_ns[0]) / 1e9
        shown = time_s <= window_s
        angles = np.rad2deg(recorded(record, "platform.attitude")[shown])
        middle = (angles.max(axis=0) + angles.min(axis=0)) / 2
        step_s = float(np.median(np.diff(record.time_ns))) / 1e9
        coarse = step_s > COARSE_S
        marker = "." if coarse else ".-" if len(angles) < 200 else "-"
        reach = max(1.15 * np.ptp(angles, axis=0).max() / 2, 0.5)
        for i, (ax, name) in enumerate(zip(axes, ("Roll", "Pitch", "Yaw"), strict=True)):
            ax.plot(record.time_ns[shown] / 1e9, angles[:, i], marker, color=look.receivers[1])
            ax.set_ylim(middle[i] - reach, middle[i] + reach)
            ax.set_ylabel(f"{name} [°]")
        axes[-1].set_xlabel("Time [s]")
        part = f", first {window_s:g} s" if not shown.all() else ""
        sampled = f", sampled every {step_s:g} s" if coarse else ""
        _title(axes[0], f"Inclination of the platform{part}{sampled}")
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
    """Measured range over true distance, and the residuals (the paper's Figure 6).

    Parameters
    ----------
    distance, mean, std
        True distance, and mean and standard deviation of the ranges there [m]; shape (n,).
    line
        Intercept [m] and slope of the fitted line.
    axes
        Two axes.
    """
    with use(theme, axes) as look:
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
    """Each receiver with its table and line style; raw fixes are small dots in the background."""
    filters = [label for label in tracks if label not in FIXES]
    for label, table in tracks.items():
        if label in FIXES:
            how: dict[str, Any] = {
                "color": look.soft, "ls": "", "marker": ".", "ms": 3, "alpha": DOTS_ALPHA,
                "mew": 0, "zorder": 2, "rasterized": len(table) > 5000,
            }
        else:
            index = filters.index(label)
            turn, colour = divmod(index, len(look.receivers))
            often = ceil(len(table) / 12) or 1
            how = {
                "color": look.receivers[colour], "ls": LINES[index % len(LINES)], "lw": 1.4,
                "marker": MARKERS[turn % len(MARKERS)], "ms": 5,
                "markevery": (index * often // len(filters), often), "zorder": 4,
            }
        # Matplotlib omits labels that start with an underscore from a legend.
        yield (f"{NOTHING}{label}" if label.startswith("_") else label), table, how


def _truth(look: Theme) -> dict[str, Any]:
    """Style of the truth: on top of the estimates, but thinner."""
    return {"color": look.ink, "lw": 0.8, "zorder": 5}


def _beacons(record: Record, truth: Floats) -> tuple[Floats, str]:
    """Mean position of each beacon [m], shape (4, 3), and their label."""
    beacons = recorded(record, "platform.beacon_position")
    mean: Floats = beacons.mean(axis=0)
    extent = np.ptp(np.vstack([truth, mean])[:, :2], axis=0).max()
    moving = np.abs(beacons - mean).max() > 0.02 * extent  # more than a marker's size
    return mean, "beacons (mean)" if moving else "beacons"


def _ends(ax: Axes, points: Floats) -> dict[str, str]:
    """Labels for the start and end of a path; a single label if two would overlap.

    `points` are start and end in the plane of the figure, shape (2, 2).
    """
    ax.apply_aspect()
    across, up = np.abs(np.diff(ax.transData.transform(points), axis=0))[0]
    inch = ax.figure.dpi
    if across > 0.45 * inch or up > 0.18 * inch:
        return {"start": "start", "end": "end"}
    return {"start": "start, end"}


def _outside(tracks: Tracks, limits: Mapping[str, tuple[float, float]]) -> str:
    """Note on the estimates beyond the limits of their columns."""
    counts = {
        label: int((~np.all([table[c].between(*limits[c]) for c in limits], axis=0)).sum())
        for label, table in tracks.items()
    }
    words = ", ".join(
        f"{_short(label)} ({n} of {len(tracks[label])})" for label, n in counts.items() if n
    )
    return f"outside of the figure: {words}" if words else ""


def _no_fix(tracks: Tracks) -> str:
    silent = ", ".join(_short(label) for label, table in tracks.items() if table.empty)
    return f"no fix: {silent}" if silent else ""


def _title(ax: Axes, *parts: str, loc: Literal["left", "center"] = "left") -> None:
    words = "; ".join(part for part in parts if part)
    ax.set_title(fill(words[:1].upper() + words[1:], 90 if loc == "left" else 70), loc=loc)


def _time_axis(axes: Sequence[Axes], record: Record) -> None:
    """Make the time axis cover the whole run."""
    start, stop = record.time_ns[[0, -1]] / 1e9
    margin = 0.01 * (stop - start)
    for ax in axes:
        ax.set_xlim(start - margin, stop + margin)
    axes[-1].set_xlabel("Time [s]")


def _short(name: str) -> str:
    """Shorten a long name to its beginning and end."""
    if len(name) <= LONGEST_NAME:
        return name
    tail = LONGEST_NAME // 2 - 1
    return f"{name[:LONGEST_NAME - tail - 1]}…{name[-tail:]}"


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
    """One legend for all axes: above them in our own figure, else within the first axes.

    A line and a band with the same label share an entry. Our own figure grows if the legend needs
    more than two rows.
    """
    entries: dict[str, dict[type, Any]] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, {}).setdefault(type(handle), handle)
    if not entries:
        return
    handles: list[Any] = [
        tuple(same.values()) if len(same) > 1 else next(iter(same.values()))
        for same in entries.values()
    ]
    names = [_short(label) for label in entries]
    if own and isinstance(figure, Figure):
        renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
        for rows in range(1, len(names) + 1):
            legend = figure.legend(handles, names, loc="outside upper center",
                                   ncols=ceil(len(names) / rows))
            extent = legend.get_window_extent(renderer)
            if extent.width < 0.96 * figure.bbox.width or rows == len(names):
                break
            legend.remove()
        figure.set_figheight(
            figure.get_figheight() + max(0.0, extent.height / figure.dpi - LEGEND_INCH)
        )
    else:
        legend = axes[0].legend(handles, names)
    for handle in legend.legend_handles:
        if isinstance(handle, Line2D) and handle.get_marker() == ".":
            handle.set(markersize=8, alpha=1)


def _columns(tracks: Tracks, column: str) -> list[Floats]:
    """A column of each filter, or of each raw fix if there is no filter."""
    filters = [label for label in tracks if label not in FIXES]
    return [tracks[label][column].to_numpy() for label in filters or tracks if len(tracks[label])]


def _limits(truth: Floats, estimates: Sequence[Floats], least: float = 1.0) -> tuple[float, float]:
    """Limits that contain the truth and the estimates near it; at least `least` m apart.

    A diverging estimate leaves the figure, rather than compress everything else.
    """
    low, high = float(truth.min()), float(truth.max())
    reach = max((high - low) / 2, 3.0)
    bottom = max(min([low, *(np.nanmin(e) for e in estimates)]), low - reach)
    top = min(max([high, *(np.nanmax(e) for e in estimates)]), high + reach)
    margin = max(0.06 * (top - bottom), (least - (top - bottom)) / 2)
    return bottom - margin, top + margin


def _error_limit(tracks: Tracks, error: str, std: str) -> float:
    """Upper limit that contains the filters' errors, except outliers, and most of the bands."""
    errors = [np.abs(e) for e in _columns(tracks, error)]
    tops = [min(np.nanmax(e), 4 * np.nanpercentile(e, 95)) for e in errors]
    filters = {k: v for k, v in tracks.items() if k not in FIXES and std in v}
    tops += [2 * np.nanpercentile(s, 90) for s in _columns(filters, std)]
    return max(1.1 * max(tops, default=1.0), 1e-3)
