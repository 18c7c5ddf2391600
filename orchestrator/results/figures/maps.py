"""The path of a run as a map and in space (the paper's Figures 11 and 12).

``tracks`` holds the tables of `metrics.track`, by receiver. On maps, east is to the right and
north is up.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from math import ceil
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import proj3d  # type: ignore[import-untyped]

from ...data.arms import are_far
from ...data.estimates import Floats
from ...data.truth import recorded
from ...judge.definitions import AXES
from ...style import SMALL, Theme, ThemeName, new_figure, use
from . import drawing
from .drawing import BOTTOM, GAP, LEFT, RIGHT, Tracks

if TYPE_CHECKING:
    from mpl_toolkits.mplot3d import Axes3D

    from ...data.record import Record

MOST_TOGETHER = 3
"""Largest number of filters on one map; more of them get a map each."""
MOST_MARKS = 6
MARK, TURNS = 0.4, 2.5
"""Length of path per mark [inch]; it counts as at most this many times the path's extent."""
TALLEST, TALLEST_OF_MANY = 6.2, 3.6
"""Largest height of a map, alone and among several [inch]."""
FLATTEST, FLATTEST_OF_MANY = 3.2, 2.0
"""Largest ratio of width to height of a map, alone and among several."""
NARROWEST_3D = 0.35
"""Smallest ratio of width to length of the box in space, and of its height to its length."""
STEPS_S = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 21600)
"""Times between two marks on a path [s]."""
ENDS = ((0, "start", "o"), (-1, "end", "s"))
"""Row of the path, label and marker."""
REPORTED, CENTRE = "beacons as reported (mean)", "platform as reported"
MOST_REPORTS = 500
"""Reports of the platform's position that a map shows."""
NARROW_3D = 0.6
"""Ratio of a horizontal side of the box in space to its longest below which ticks are few."""
TICK_3D, OWN_TICK_3D, OWN_NAME_3D = 3.5, 8.0, 21.0
"""Usual pad of a tick's number, and what Matplotlib adds to it and to that of a name [point]."""
PAD_3D = -2.0
"""Gap between the numbers of an axis in space and its name [point]."""
MARGINS_3D = (0.5, 1.0, 0.8, 0.1)
"""Margins left, right, below and above the box in space [inch]."""
TALLEST_3D = 6.0
"""Largest height of the box in space with its labels [inch]."""


def plot_path(
    record: Record, tracks: Tracks, ax: Axes | None = None, theme: ThemeName = "light"
) -> Axes:
    """Map of the path, the estimates and the platform, true and as reported.

    A new figure has a map for each receiver, on common axes, if there are more than
    `MOST_TOGETHER` filters; the first of them is returned.
    """
    with use(theme, ax) as look:
        own = ax is None
        truth = recorded(record, "target.position")
        platform = Platform(record, truth)
        limits = limits_of(np.vstack([truth, platform.true, platform.reported]), tracks, "xy")
        apart = own and sum(map(drawing.is_filter, tracks)) > MOST_TOGETHER
        names = [*platform.names, "true path", *([] if apart else tracks)]
        sheet = Sheet(limits, len(tracks) if apart else 1, drawing.legend_width(names))
        maps = [ax] if ax is not None else sheet.axes()
        styled = list(drawing.lines_of(tracks, look))
        for i, panel in enumerate(maps):
            platform.draw(panel, 4 if apart else 6, look)
            panel.plot(truth[:, 1], truth[:, 0], label="true path", **drawing.truth_of(look))
            for label, table, how in styled[i : i + 1] if apart else styled:
                drawing.add_line(
                    panel, table["y_m"], table["x_m"], how | ({} if apart else {"label": label})
                )
            if own:
                limits = sheet.limits
            panel.set(xlim=limits["y_m"], ylim=limits["x_m"], aspect="equal")
            if apart:
                name = drawing.short_for(styled[i][0], sheet.wide)
                panel.set_title(name, loc="left")
        scale = sheet.scale if own else _scale(maps[0])
        every = _time_between_marks(*_in_motion(record), _marks(truth, scale))
        name_axes(maps)
        drawing.finish(
            maps, own, "map" + (f", with a mark every {_in_words(every, every)}" if every else ""),
            drawing.outside(tracks, limits), drawing.no_fix(tracks), beside=sheet.beside,
        )  # fmt: skip
        for panel in maps:
            _mark_times(panel, record, tracks if not apart else {}, every, look)
    return maps[0]


def plot_path_3d(
    record: Record, tracks: Tracks, ax: Axes3D | None = None, theme: ThemeName = "light"
) -> Axes3D:
    """Path and estimates in space, depth downwards (the paper's Figure 12b)."""
    with use(theme, ax) as look:
        own = ax is None
        ax = ax or new_figure(drawing.WIDTH, drawing.WIDTH, laid_out=True).add_subplot(
            projection="3d"
        )
        truth = recorded(record, "target.position")
        platform = Platform(record, truth)
        limits = limits_of(np.vstack([truth, platform.true]), tracks, AXES)
        longest = NARROWEST_3D * max(float(np.ptp(limit)) for limit in limits.values())
        limits |= {column: widened(limits[column], longest) for column in ("x_m", "y_m")}
        for number, arm in enumerate(_arms(platform.true)):
            ax.plot(*arm[:, [1, 0, 2]].T, color=look.soft, marker="^", ms=5, markevery=[-1],
                    ls="" if are_far(platform.true) else "-",
                    label=platform.name if number == 0 else None)
            _drop(ax, arm[-1], limits["z_m"][1], look)
        ax.plot(*truth[:, [1, 0, 2]].T, label="true path", **drawing.truth_of(look))
        curves = [truth]
        for label, table, how in drawing.lines_of(tracks, look):
            # 3-D axes do not clip: points beyond the limits would be drawn outside the box.
            shown = table[["x_m", "y_m", "z_m"]].copy()
            for column, limit in limits.items():
                shown[~table[column].between(*limit)] = np.nan
            ax.plot(*shown.to_numpy()[:, [1, 0, 2]].T, label=label, **how)
            curves.append(shown.to_numpy())
        ax.set(xlim=limits["y_m"], ylim=limits["x_m"], zlim=limits["z_m"][::-1])
        ax.set(xlabel="East y [m]", ylabel="North x [m]", zlabel="Depth z [m]")
        north, east, depth = (np.ptp(limit) for limit in limits.values())
        height = max(depth, NARROWEST_3D * max(north, east))
        ax.set_box_aspect((east, north, height), zoom=1.0 if own else 1.3)
        stretch = f"{height / depth:.2g}"
        stretched = f"depth ×{stretch}" if stretch != "1" else ""
        for line in ax.lines:
            # The box may exceed the clip area of the axes; the layout ignores 3-D positions.
            line.set(clip_on=False, in_layout=False)
        _axes_in_space(ax, (east, north, height), look)
        drawing.finish(
            [ax], own, "path in space", stretched, drawing.outside(tracks, limits),
            drawing.no_fix(tracks),
        )  # fmt: skip
        if own:
            _fit_to_box(ax)
        _mark_ends_3d(ax, truth, np.vstack(curves), look)
    return ax


class Platform:
    """The platform on a map: mean positions of its beacons [m], true and as reported, (N, 3)."""

    def __init__(self, record: Record, truth: Floats) -> None:
        beacons = recorded(record, "platform.beacon_position")
        reports = recorded(record, "platform.reported_beacon_position")
        self.true: Floats = beacons.mean(axis=0)
        self.reported: Floats = reports.mean(axis=0)
        self.centres: Floats = reports.mean(axis=1)[:: ceil(len(reports) / MOST_REPORTS)]
        self.is_exact = np.array_equal(beacons, reports)
        extent = np.ptp(np.vstack([truth, self.true])[:, :2], axis=0).max()
        moving = np.abs(beacons - self.true).max() > 0.02 * extent  # more than the size of a marker
        self.name = "beacons (mean)" if moving else "beacons"
        self.is_far = are_far(self.true)
        self.dotted = not self.is_exact and not are_far(self.true)
        self.names = [self.name, *(() if self.is_exact else (REPORTED,)),
                      *((CENTRE,) if self.dotted else ())]  # fmt: skip

    def draw(self, ax: Axes, size: float, look: Theme) -> None:
        """Arms of the beacons. Reported arms are dashed, and dots mark their centre at many
        instants."""
        how = {"color": look.ink, "ms": size}
        self._beacons(ax, self.true, self.name, **how, marker="^", mfc=look.soft)
        if not self.is_exact:
            self._beacons(ax, self.reported, REPORTED, **how,
                          ls=(0, (2.5, 1.5)), marker="v", mfc=look.paper)
        if self.dotted:
            drawing.add_line(ax, self.centres[:, 1], self.centres[:, 0], {
                "color": look.ink, "ls": "", "marker": ".", "ms": 2.2 * (size / 6) ** 2,
                "alpha": 0.9, "zorder": 2.5, "label": CENTRE,
            })  # fmt: skip

    @staticmethod
    def _beacons(ax: Axes, beacons: Floats, name: str, **how: Any) -> None:
        how |= {"ls": ""} if are_far(beacons) else {}
        for number, arm in enumerate(_arms(beacons)):
            ax.plot(*arm[:, [1, 0]].T, lw=1, zorder=3, markevery=[-1],
                    label=name if number == 0 else None, **how)


def _arms(beacons: Floats) -> list[Floats]:
    """From the middle of the beacons to each beacon; zero length if there can be no arm."""
    middle, far = beacons.mean(axis=0), are_far(beacons)
    return [beacon[None] if far else np.array([middle, beacon]) for beacon in beacons]


def limits_of(seen: Floats, tracks: Tracks, axes: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Limits of each coordinate, by column; estimates extend equally in all directions.

    `seen` has north, east and depth: errors above a deep dive are as large as far beside it.
    """
    reach = float(np.ptp(seen, axis=0).max()) / 2
    return {
        f"{axis}_m": drawing.limits(seen[:, i], tracks, axis, reach) for i, axis in enumerate(axes)
    }


def widened(limits: tuple[float, float], span: float) -> tuple[float, float]:
    """Limits with the given distance and the same middle."""
    more = max(span - (limits[1] - limits[0]), 0.0) / 2
    return limits[0] - more, limits[1] + more


class Sheet:
    """A new figure of the usual width, filled by maps, whatever the shape of the data.

    Attributes
    ----------
    wide, high
        Size of a map [inch].
    limits
        Limits of the coordinates. The narrower one is widened to the shape of the map.
    beside
        Whether the legend is on the right, as for one tall, narrow map.
    scale
        Inches per metre.
    """

    def __init__(
        self, limits: dict[str, tuple[float, float]], count: int, legend: float
    ) -> None:
        self._count = count
        self._rows = ceil(count / 3) if count > 4 else ceil(count / 2)
        self._columns = ceil(count / self._rows)
        north, east = (float(np.ptp(limit)) for limit in limits.values())
        gaps = LEFT + RIGHT + GAP * (self._columns - 1)
        self.wide = (drawing.WIDTH - gaps) / self._columns
        tallest = TALLEST if count == 1 else TALLEST_OF_MANY
        self.beside = count == 1 and tallest * east / north < self.wide - legend - GAP
        if self.beside:
            self.wide -= legend + GAP
        flattest = FLATTEST if count == 1 else FLATTEST_OF_MANY
        self.high = min(max(self.wide * north / east, self.wide / flattest), tallest)
        self.scale = min(self.wide / east, self.high / north)
        self.limits = {
            "x_m": widened(limits["x_m"], self.high / self.scale),
            "y_m": widened(limits["y_m"], self.wide / self.scale),
        }

    def axes(self) -> list[Axes]:
        """The axes of the figure."""
        rows, columns, count = self._rows, self._columns, self._count
        figure = new_figure(
            drawing.WIDTH,
            BOTTOM + rows * self.high + (rows - 1) * (GAP + drawing.title_height("one line")),
            laid_out=True,
        )
        grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        for empty in grid.flat[count:]:
            empty.set_axis_off()
        for above in grid[-2, count - columns * rows :] if count < columns * rows else ():
            above.tick_params(labelbottom=True)
        for panel in grid.flat[:count]:
            longest = max(drawing.inches(f"{end:.0f}") for end in self.limits["y_m"])
            panel.xaxis.set_major_formatter(drawing.WholeTicks())
            panel.yaxis.set_major_formatter(drawing.WholeTicks())
            panel.xaxis.set_major_locator(_locator(self.wide, longest + 0.35))
            panel.yaxis.set_major_locator(_locator(self.high, 0.4))
        return list(grid.flat[:count])


def _locator(room: float, each: float) -> MaxNLocator:
    """Ticks at a given distance in inches."""
    return MaxNLocator(min(max(int(room / each), 2), 9), steps=[1, 2, 2.5, 5, 10])


def name_axes(
    maps: Sequence[Axes], up: str = "North x [m]", right: str = "East y [m]"
) -> None:
    """Name the axes at the edges of a figure of maps."""
    for ax in maps:
        place = ax.get_subplotspec()
        if place is None or place.is_last_row():
            ax.set_xlabel(right)
        if place is None or place.is_first_col():
            ax.set_ylabel(up)


# --- Time along the path -------------------------------------------------------------------------


def _scale(ax: Axes) -> float:
    """Inches per metre on a map."""
    ax.apply_aspect()
    return float(ax.bbox.width / ax.figure.dpi / np.ptp(ax.get_xlim()))


def _marks(path: Floats, scale: float) -> int:
    """Number of marks that the path has room for, when drawn at the given inches per metre."""
    steps = np.hypot(*np.diff(path[:, :2], axis=0).T).sum()
    reach = np.hypot(*np.ptp(path[:, :2], axis=0))
    return min(int(min(steps, TURNS * reach) * scale / MARK), MOST_MARKS)


def _in_motion(record: Record) -> tuple[float, float]:
    """When the diver begins to move, seen from above, and when they rest for good [s]."""
    path = recorded(record, "target.position")[:, :2]
    moves = np.flatnonzero(np.abs(np.diff(path, axis=0)).max(axis=1) > 1e-9)
    first, last = (moves[0], moves[-1] + 1) if len(moves) else (0, 0)
    return float(record.time_ns[first]) / 1e9, float(record.time_ns[last]) / 1e9


def _time_between_marks(first_s: float, last_s: float, most: int) -> float:
    """Time between marks [s]; 0 if there is no room for any."""
    span = last_s - first_s
    every = next((step for step in STEPS_S if step * most >= span), span)
    return every if every <= 0.75 * span else 0.0


def _in_words(time_s: float, every_s: float) -> str:
    """A time in the unit of the time between marks."""
    unit, seconds = next(u for u in (("h", 3600), ("min", 60), ("s", 0)) if every_s >= u[1])
    return f"{time_s / (seconds or 1):g} {unit}"


def _mark_times(
    ax: Axes, record: Record, tracks: Tracks, every: float, look: Theme
) -> None:
    """Marks and arrowheads along the true path, with labels where they hide least."""
    time_s, path = record.time_ns / 1e9, recorded(record, "target.position")[:, [1, 0]]
    first, last = _in_motion(record)
    marks = np.empty(0)
    if every:
        marks = np.arange(ceil((first + 0.5 * every) / every) * every, last - 0.25 * every, every)
        _point_ahead(ax, time_s, path, every, look)
    at = np.column_stack([np.interp(marks, time_s, c) for c in path.T])
    ax.plot(*at.T, ls="", marker="o", ms=3.5, color=look.ink, zorder=5.5)
    words = _ends(ax, path[[0, -1]])
    labels = _rests_together(at, [_in_words(float(t), every) for t in marks])
    for row, word, marker in ENDS:
        ax.plot(*path[row], marker, color=look.ink, mfc=look.paper, ms=7, zorder=6)
        if word in words:
            labels.insert(0, (path[row], words[word]))
    lines = [np.asarray(line.get_xydata()) for line in ax.lines if line.get_marker() != "."]
    dots = [np.asarray(line.get_xydata()) for line in ax.lines if line.get_marker() == "."]
    places = drawing.free_places(
        ax, np.array([point for point, _ in labels]), [w for _, w in labels],
        np.vstack([path, *lines]), np.vstack(dots) if dots else None,
    )  # fmt: skip
    for (point, word), place in zip(labels, places, strict=True):
        ax.text(point[0], point[1], word, fontsize=SMALL, zorder=7,
                path_effects=drawing.halo(look), **place)


def _rests_together(at: Floats, words: Sequence[str]) -> list[tuple[Floats, str]]:
    """The marks with their labels; those of a rest share one, from its first to its last."""
    labels: list[tuple[Floats, str]] = []
    for row, word in enumerate(words):
        if row and np.array_equal(at[row], at[row - 1]):
            point, before = labels.pop()
            labels.append((point, f"{before.partition('–')[0].split()[0]}–{word}"))
        else:
            labels.append((at[row], word))
    return labels


def _point_ahead(ax: Axes, time_s: Floats, path: Floats, every: float, look: Theme) -> None:
    """Arrowheads in the direction of motion, half way between marks; none where the target
    rests."""
    middle = np.arange(time_s[0] + every / 2, time_s[-1], every)
    step = max(0.02 * every, float(np.median(np.diff(time_s))))
    at, before, after = (
        np.column_stack([np.interp(t, time_s, c) for c in path.T])
        for t in (middle, middle - step, middle + step)
    )
    ahead = after - before
    length = np.hypot(*ahead.T)
    moves = length > 1e-3 * np.ptp(path, axis=0).max()
    if moves.any():
        unit = ahead[moves] / length[moves, None]
        ax.quiver(
            *at[moves].T, *unit.T, angles="xy", units="inches", scale_units="inches", scale=8,
            width=0.012, headwidth=8, headlength=10, headaxislength=10, minlength=0, pivot="mid",
            color=look.ink, zorder=5.5,
        )  # fmt: skip


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


# --- In space ------------------------------------------------------------------------------------


def _axes_in_space(ax: Axes3D, box: tuple[float, float, float], look: Theme) -> None:
    """Ticks as dense as there is room, and their numbers and the names clear of the axes.

    Matplotlib's distances from an axis in space are shares of the other sides of the box.
    """
    sides = np.array(box) / max(box)
    for axis, side in zip((ax.xaxis, ax.yaxis, ax.zaxis), sides, strict=True):
        few = axis is not ax.zaxis and side < NARROW_3D  # numbers of different depths are apart
        axis.set_major_locator(MaxNLocator(3 if few else 5))
        axis.set_pane_color(look.paper)
        axis._axinfo["grid"].update(color=look.grid, linewidth=0.6)
        numbers = axis.get_major_formatter().format_ticks(axis.get_majorticklocs())
        pad = (30 if axis is ax.zaxis else 50) * max(map(drawing.inches, numbers))
        axis.labelpad = PAD_3D + pad
    tall = 1.0 / min(1.0, float(sides[:2].mean()) / NARROW_3D)
    ax.tick_params(axis="z", pad=(TICK_3D + OWN_TICK_3D) * tall - OWN_TICK_3D)
    ax.zaxis.labelpad = (ax.zaxis.labelpad + OWN_NAME_3D) * tall - OWN_NAME_3D


def _drop(ax: Axes3D, beacon: Floats, floor: float, look: Theme) -> None:
    """A vertical line from a beacon to the floor of the box, with its foot, to show where it is."""
    below = np.array([beacon, [*beacon[:2], floor]])
    ax.plot(*below[:, [1, 0, 2]].T, color=look.soft, lw=0.8, ls=(0, (2, 1.5)), marker=".", ms=4,
            markevery=[-1], zorder=1)


def _flat(ax: Axes3D, points: Floats) -> Floats:
    """Points north, east, down (n, 3) in the plane of the axes (n, 2)."""
    across, up, _ = proj3d.proj_transform(*points[:, [1, 0, 2]].T, ax.get_proj())
    return np.column_stack([across, up])


def _fit_to_box(ax: Axes3D) -> None:
    """Let the box fill the figure except for the margins of its labels, and set the height."""
    figure = ax.figure
    width, height = figure.get_size_inches()
    above = (1 - figure.subplotpars.top) * height
    ax.set_position((0, 0, 1, width / height))  # a square
    ax.apply_aspect()
    corners = np.array(list(product(ax.get_ylim(), ax.get_xlim(), ax.get_zlim())))
    inches = ax.transData.transform(_flat(ax, corners)) / figure.dpi
    low, size = inches.min(axis=0), np.ptp(inches, axis=0)
    left, right, bottom, top = MARGINS_3D
    scale = min((width - left - right) / size[0], (TALLEST_3D - bottom - top) / size[1])
    side, height = scale * width, scale * size[1] + bottom + top + above
    slack = (width - left - right - scale * size[0]) / 2
    title = figure._suptitle
    if title is not None:
        title.set_y(1 - (1 - title.get_position()[1]) * figure.get_figheight() / height)
    figure.set_figheight(height)
    x, y = left + slack - scale * low[0], bottom - scale * low[1]
    ax.set_position((x / width, y / height, side / width, side / height))


def _mark_ends_3d(ax: Axes3D, path: Floats, drawn: Floats, look: Theme) -> None:
    """Start and end of the path, with labels where they hide least."""
    ends = _flat(ax, path[[0, -1]])
    words = _ends(ax, ends)
    rows = [row for row, word, _ in ENDS if word in words]
    places = drawing.free_places(ax, ends[rows], list(words.values()), _flat(ax, drawn))
    for row, _, marker in ENDS:
        ax.plot(*path[row, [1, 0, 2]][:, None], marker, color=look.ink, mfc=look.paper, ms=6,
                zorder=6, clip_on=False, in_layout=False)
    for row, word, place in zip(rows, words.values(), places, strict=True):
        ax.text(*path[row, [1, 0, 2]], word, fontsize=SMALL, zorder=7,
                path_effects=drawing.halo(look), **place)
