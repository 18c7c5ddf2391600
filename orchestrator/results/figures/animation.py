"""A run as it happened, for talks: the map and the errors, in about ten seconds, as MP4 or GIF.

MP4 requires ffmpeg. GIF requires only Pillow, which Matplotlib depends on.
"""

from __future__ import annotations

from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import PlaceHolderLayoutEngine

from ...data.estimates import Floats
from ...data.truth import recorded
from ...errors import ConfigurationError
from ...style import SMALL, Theme, ThemeName, new_figure, use
from . import drawing, run
from .drawing import Tracks
from .maps import Platform, limits_of, widened

if TYPE_CHECKING:
    from ...data.record import Record

NAME = "animation"
FRAMES, PER_SECOND = 100, 10
"""Number of frames, and frames shown in a second."""
SIZE, DPI = (8.0, 4.4), 100
"""Size [inch] and dots per inch. MP4 requires even numbers of pixels."""
_BEYOND = 2.2
"""Room for the names of receivers with errors above the figure [inch]."""
MOST_POINTS = 1500
"""Most points of a curve."""
KINDS = (".mp4", ".gif")


def kind_of(file: Path | None = None) -> str:
    """Suffix of an animation: that of a file, or the best kind that can be written here.

    Raises
    ------
    ConfigurationError
        The suffix is neither, or MP4 cannot be written.
    """
    has_ffmpeg = FFMpegWriter.isAvailable()
    if file is None:
        return KINDS[0] if has_ffmpeg else KINDS[1]
    kind = file.suffix.lower()
    if kind not in KINDS:
        raise ConfigurationError(f"animate: must be a file .mp4 or .gif, got {file}")
    if kind == KINDS[0] and not has_ffmpeg:
        raise ConfigurationError(f"animate: must be a file .gif without ffmpeg, got {file}")
    return kind


def write(record: Record, tracks: Tracks, file: Path, theme: ThemeName = "light") -> None:
    """Write an animation of a run; equal runs give equal bytes.

    Parameters
    ----------
    tracks
        Tables of `metrics.track`, by receiver.
    file
        The file to write, ``.mp4`` or ``.gif``.

    Raises
    ------
    ConfigurationError
        The suffix is neither, MP4 cannot be written, writing fails, or the run has no receivers.
    """
    writer = _writer(kind_of(file))
    if not tracks:
        raise ConfigurationError("animate: the run must have a receiver, got none")
    with use(theme) as look:
        scene = Scene(record, tracks, look)
        try:
            with writer.saving(scene.figure, str(file), DPI):
                for time_s in scene.times_s:
                    scene.show(float(time_s))
                    writer.grab_frame()
        except OSError as error:
            why = error.strerror or error
            raise ConfigurationError(
                f"animate: must be a file that can be written, got {file} ({why})"
            ) from error


def _writer(kind: str) -> AbstractMovieWriter:
    if kind == KINDS[1]:
        return PillowWriter(fps=PER_SECOND)
    return FFMpegWriter(
        fps=PER_SECOND, codec="h264",
        extra_args=["-pix_fmt", "yuv420p", "-threads", "1", "-fflags", "+bitexact", "-flags:v",
                    "+bitexact", "-map_metadata", "-1"],
    )  # fmt: skip


class Scene:
    """The figure, whose curves grow.

    Attributes
    ----------
    times_s
        Times of the frames [s].
    """

    def __init__(self, record: Record, tracks: Tracks, look: Theme) -> None:
        self._time_s: Floats = record.time_ns / 1e9
        self._path: Floats = recorded(record, "target.position")
        self._beacons: Floats = recorded(record, "platform.beacon_position")
        start, stop = self._time_s[[0, -1]]
        self.times_s = np.linspace(start, stop, FRAMES)
        self.figure: Figure = new_figure(*SIZE, laid_out=True)
        self.figure.set_layout_engine(PlaceHolderLayoutEngine(True, True))  # `use` lays out frames
        ground, errors = self.figure.subplots(1, 2)
        self.figure.subplots_adjust(left=0.09, right=0.985, bottom=0.12, top=0.87, wspace=0.22)
        styled = list(drawing.lines_of(tracks, look))
        self._curves: list[tuple[Any, Floats, Floats]] = []
        self._map(ground, Platform(record, self._path), tracks, look)
        for label, table, how in styled:
            how = {**how, "markevery": None, "label": label}
            times = table["epoch_s"].to_numpy()
            for ax, x, y in ((ground, "y_m", "x_m"), (errors, "epoch_s", "error_total_m")):
                (line,) = ax.plot([], [], **how)
                self._curves.append((line, times, table[[x, y]].to_numpy()))
        (self._diver,) = ground.plot([], [], "o", color=look.ink, mfc=look.paper, ms=7, zorder=6)
        self._errors(errors, record, tracks, look)
        handles, names = ground.get_legend_handles_labels()
        self.figure.legend(
            handles, [drawing.short_for(name, 1.6) for name in names], loc="upper left",
            bbox_to_anchor=(0.06, 0.995), ncols=min(len(names), 5), borderaxespad=0,
            handler_map={h: drawing.SEVERAL for h in handles if h.get_marker() == "."},
        )  # fmt: skip
        self._title = errors.set_title("", loc="right")

    def _map(self, ax: Axes, platform: Platform, tracks: Tracks, look: Theme) -> None:
        limits = limits_of(np.vstack([self._path, self._beacons.mean(axis=0)]), tracks, "xy")
        for _ in range(2):  # the numbers depend on the limits, and these on the room beside them
            place = ax.get_position()
            wide, high = np.array(SIZE) * (place.width, place.height)
            scale = min(wide / np.ptp(limits["y_m"]), high / np.ptp(limits["x_m"]))
            ax.set(xlim=widened(limits["y_m"], wide / scale),
                   ylim=widened(limits["x_m"], high / scale))
            _fit(ax)
        ax.set(aspect="equal", xlabel="East y [m]", ylabel="North x [m]")
        ax.plot(*self._path[:, [1, 0]].T, color=look.grid, lw=1.2, zorder=1)
        (self._truth,) = ax.plot([], [], label="true path", **drawing.truth_of(look))
        self._arms = [
            ax.plot([], [], color=look.ink, mfc=look.soft, marker="^", ms=5, markevery=[-1], lw=1,
                    ls="" if platform.is_far else "-", zorder=3,
                    label="beacons" if number == 0 else None)[0]
            for number in range(self._beacons.shape[1])
        ]  # fmt: skip

    def _errors(self, ax: Axes, record: Record, tracks: Tracks, look: Theme) -> None:
        top = drawing.error_limit(tracks, "error_total_m", "")
        ax.set(ylim=(0, top), ylabel="Total error [m]")
        beyond = drawing.outside(tracks, {"error_total_m": (0.0, top)}).rpartition(": ")[2]
        if beyond:
            fits = drawing.inches(beyond, SMALL) < _BEYOND
            said = f"above: {beyond}" if fits else "some errors are above"
            ax.set_title(said, loc="left", fontsize=SMALL)
        _fit(ax)
        run.time_axis([ax], record)
        self._now = ax.axvline(self._time_s[0], color=look.soft, lw=0.8)
        self._unit = run.unit_of(record)

    def show(self, time_s: float) -> None:
        """Show the run up to a time [s]."""
        now = int(np.searchsorted(self._time_s, time_s, side="right")) - 1
        self._truth.set_data(*_thinned(self._path[: now + 1, [1, 0]]).T)
        self._diver.set_data(*self._path[now, [1, 0]][:, None])
        middle = self._beacons[now].mean(axis=0)
        for arm, beacon in zip(self._arms, self._beacons[now], strict=True):
            arm.set_data(*np.array([middle, beacon])[:, [1, 0]].T)
        for line, times, points in self._curves:
            line.set_data(*_thinned(points[: np.searchsorted(times, time_s, side="right")]).T)
        self._now.set_xdata([time_s, time_s])
        name, seconds = self._unit
        self._title.set_text(f"{time_s / seconds:.{2 if seconds > 1 else 1}f} {name}")


def _fit(ax: Axes) -> None:
    """Make room for the numbers of the vertical axis."""
    ax.yaxis.set_major_formatter(drawing.WholeTicks())
    usual: Any = ax.get_subplotspec()
    place = usual.get_position(ax.figure)
    left = place.x0 + drawing.longer_numbers([ax]) / SIZE[0]
    ax.set_position((left, place.y0, place.x1 - left, place.height))


def _thinned(points: Floats) -> Floats:
    """At most `MOST_POINTS` of some points, with the last one."""
    step = ceil(len(points) / MOST_POINTS) or 1
    return points[::-step][::-1]
