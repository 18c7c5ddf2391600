"""Figures of a run, as in the paper's Figures 6, 9 and 11 to 14.

Each function draws into the given axes or a new figure, and returns the axes. ``tracks`` holds the
tables of `metrics.track`, by receiver. The maps are in `sblcosim.results.figures.maps`.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import floor, log10
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, MultipleLocator

from ...data.estimates import Floats
from ...data.truth import recorded
from ...judge import possible
from ...judge.definitions import AXES, FRAME_WORDS
from ...judge.metrics import REPORTED, error_column, with_errors
from ...style import LINES, ThemeName, use
from ...words.numbers import minus
from . import drawing
from .drawing import Tracks
from .maps import plot_path as plot_path
from .maps import plot_path_3d as plot_path_3d

if TYPE_CHECKING:
    from ...data.record import Record
    from ...limits.verdict import Limits

NAMES = {"x": "North x", "y": "East y", "z": "Depth z"}
INCLINATION_WINDOW_S = 60.0
TIMES = (("h", 3600.0, 3 * 3600.0), ("min", 60.0, 20 * 60.0), ("s", 1.0, 0.0))
"""Units of the time axis: name, seconds, and the duration of a run from which they are used [s]."""
MOST_TICKS = 9
LEAST_SAMPLES = 30
"""Samples of the platform's angles that are drawn at least, if the run has them."""
COARSE_S = 0.25
"""Sampling interval [s] above which a line through wave samples (periods from 1 s) misleads."""


def plot_axes(
    record: Record, tracks: Tracks, axes: Sequence[Axes] | None = None, theme: ThemeName = "light"
) -> Sequence[Axes]:
    """True and estimated coordinates over time (the paper's Figure 13); three axes.

    They show all estimates of the first receiver, and those of the others nearby.
    """
    with use(theme, axes) as look:
        own = axes is None
        axes = drawing.panels(3, axes)
        time_s, truth = record.time_ns / 1e9, recorded(record, "target.position")
        limits, main = {}, next(filter(drawing.is_filter, tracks), next(iter(tracks), ""))
        for i, (ax, axis) in enumerate(zip(axes, AXES, strict=True)):
            ax.plot(time_s, truth[:, i], label="truth", **drawing.truth_of(look))
            for label, table, how in drawing.lines_of(tracks, look):
                drawing.add_line(
                    ax, table["epoch_s"], table[f"{axis}_m"], how | {"label": label}
                )
            column = f"{axis}_m"
            limits[column] = drawing.limits(truth[:, i], tracks, axis, least=0.5, whole=main)
            ax.set(ylim=limits[column], ylabel=f"{NAMES[axis]} [m]")
        axes[2].invert_yaxis()
        time_axis(axes, record)
        drawing.finish(
            axes, own, "coordinates over time", drawing.outside(tracks, limits),
            drawing.no_fix(tracks),
        )  # fmt: skip
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

    Four axes over the whole run. `frame` is one of `definitions.FRAMES`. Receivers without errors
    in it are omitted. `reference` is what was possible: ±2σ, and the RMS of the total; the title
    names what it leaves out, if that matters.

    Raises
    ------
    ConfigurationError
        There is no such frame, or no receiver has errors in it.
    """
    tracks = with_errors(tracks, frame)
    claim = "own_relative_std" if frame == "own_relative" else "std"
    with use(theme, axes) as look:
        own = axes is None
        axes = drawing.panels(4, axes)
        limits, bands = {}, ""
        for ax, axis in zip(axes, (*AXES, "total"), strict=True):
            column = error_column(frame, axis)
            for label, table, how in drawing.lines_of(tracks, look):
                t, e = table["epoch_s"], table[column]
                drawing.add_line(ax, t, e, how | {"label": label})
                if len(t) > 1 and f"{claim}_{axis}_m" in table and drawing.is_filter(label):
                    bands = drawing.draw_claim(
                        ax, t, 2 * table[f"{claim}_{axis}_m"], label, how, tracks
                    )
            top = drawing.error_limit(tracks, column, f"{claim}_{axis}_m")
            ax.set_ylim((0 if axis == "total" else -top), top)
            if axis == "total":
                ax.set_ylabel("Total error [m]")
            else:
                ax.axhline(0, color=look.ink, lw=0.8, zorder=2)
                ax.set_ylabel(f"Error in {axis} [m]")
            limits[column] = (-top, top)
        since_s = min((t["epoch_s"].min() for t in tracks.values() if len(t)), default=np.inf)
        possible.draw(axes, reference, frame, since_s, look)
        time_axis(axes, record)
        drawing.finish(
            axes,
            own,
            "estimate minus truth" + ("" if frame == "absolute" else f", {FRAME_WORDS[frame]}"),
            bands,
            possible.caption(reference, frame),
            drawing.outside(tracks, limits),
            drawing.no_fix(tracks),
        )
    return axes


def plot_inclination(
    record: Record,
    axes: Sequence[Axes] | None = None,
    window_s: float = INCLINATION_WINDOW_S,
    theme: ThemeName = "light",
) -> Sequence[Axes]:
    """True roll, pitch and yaw of the platform in the first `window_s` (the paper's Figure 9).

    The window is longer if it has fewer than `LEAST_SAMPLES` samples.
    A fourth panel shows the reported angles minus the true ones. A new figure has it if the report
    differs; given axes have it if there are four of them.
    """
    with use(theme, axes) as look:
        own = axes is None
        true = recorded(record, "platform.attitude")
        reported = recorded(record, REPORTED) if REPORTED in record.values else true
        wrong = len(axes) == 4 if axes is not None else not np.array_equal(reported, true)
        axes = drawing.panels(4 if wrong else 3, axes)
        time_s = (record.time_ns - record.time_ns[0]) / 1e9
        step_s = float(np.median(np.diff(record.time_ns))) / 1e9
        coarse = step_s > COARSE_S
        window_s = max(window_s, LEAST_SAMPLES * step_s)
        shown = time_s <= window_s
        angles = np.rad2deg(true[shown])
        errors = (np.rad2deg(reported[shown]) - angles + 180) % 360 - 180
        middle = (angles.max(axis=0) + angles.min(axis=0)) / 2
        marker = "." if coarse else ".-" if len(angles) < 200 else "-"
        reach = max(1.15 * np.ptp(angles, axis=0).max() / 2, 0.5)
        for i, name in enumerate(("Roll", "Pitch", "Yaw")):
            t, colour = record.time_ns[shown] / 1e9, look.receivers[i]
            axes[i].plot(t, angles[:, i], marker, color=colour)
            axes[i].set(ylim=(middle[i] - reach, middle[i] + reach), ylabel=f"{name} [°]")
            if wrong:
                axes[3].plot(t, errors[:, i], color=colour, ls=LINES[i], lw=1,
                             label=name.lower())
        if wrong:
            axes[3].axhline(0, color=look.ink, lw=0.8, zorder=2)
            axes[3].set_ylabel("Reported − true [°]")
        axes[-1].set_xlabel("Time [s]")
        part = f", first {window_s:g} s" if not shown.all() else ""
        sampled = f", sampled every {step_s:g} s" if coarse else ""
        drawing.finish(axes, own, f"inclination of the platform{part}{sampled}")
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
        axes = drawing.panels(2, axes, (2.5, 1.3))
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
        drawing.finish(axes, own, "ranges at known distances")
    return axes


def time_axis(axes: Sequence[Axes], record: Record) -> None:
    """Make the time axis cover the whole run, in the unit that suits its duration."""
    scale_time(axes, *(record.time_ns[[0, -1]] / 1e9))


def scale_time(axes: Sequence[Axes], start: float, stop: float) -> None:
    """Make the time axis go from start to stop [s], in the unit that suits it."""
    margin = 0.01 * (stop - start)
    for ax in axes:
        ax.set_xlim(start - margin, stop + margin)
    name, seconds = next(unit for unit in TIMES if stop - start >= unit[2])[:2]
    axes[-1].set_xlabel(f"Time [{name}]")
    axes[-1].xaxis.set_major_locator(MultipleLocator(_tick(stop - start, seconds)))
    axes[-1].xaxis.set_major_formatter(FuncFormatter(lambda t, _: minus(f"{t / seconds:.10g}")))


def unit_of(record: Record) -> tuple[str, float]:
    """The unit of time that suits a run's duration, and its seconds."""
    start, stop = record.time_ns[[0, -1]] / 1e9
    return next(unit for unit in TIMES if stop - start >= unit[2])[:2]


def _tick(span_s: float, unit_s: float) -> float:
    """Time between ticks [s]: at most `MOST_TICKS` of them, at round numbers of the unit."""
    least = span_s / unit_s / MOST_TICKS
    power = 10.0 ** floor(log10(least))
    return unit_s * power * next(step for step in (1, 2, 5, 10) if step * power >= 0.999 * least)
