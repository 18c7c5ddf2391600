"""Figures of an area: its cells coloured, the platform, and where the requirement is kept."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator

from ..data.arms import LONGEST_ARM
from ..data.estimates import Floats
from ..judge.definitions import MANY_LOST
from ..limits.unknown import brief
from ..results.figures.drawing import LINE, short, wrapped
from ..scenario.conditions import conditions
from ..style import SIZE, Theme, ThemeName, new_figure, use
from ..words.lists import counted
from ..words.numbers import meters
from ..words.shares import percent
from .result import AreaMap, part, widened
from .survey import NEAR

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ERROR, LOSSES = "standard error of the 95 % error [%]", "lost runs [%]"
"""Labels of the maps of `plot_certainty`."""
COLOURS = "viridis_r"
"""A perceptually uniform colour map, ordered for colour-blind readers too; dark is bad."""
_RATIO = 6.0
"""Ratio of largest to smallest value above which colours are logarithmic."""
_WIDE, _NARROW = 3.2, 3.6
"""Width of a panel [inch]."""
_SHORTEST = 1.0
"""Smallest width of a line of a title, even if its map is narrower [inch]."""
_BESIDE = 2.1
"""Width of the legend [inch]."""
SMALLEST = 0.01
"""Arms shorter than this fraction of the map are hidden by the marks of their beacons."""


def plot_map(area: AreaMap, *, narrow: bool = False, theme: ThemeName = "light") -> list[Axes]:
    """The receiver's 95 % error, the possible one, and HDOP; the first two share a colour scale.

    Parameters
    ----------
    narrow
        Draw the panels one above the other, for a narrow page.
    """
    with use(theme) as look:
        receiver, possible, hdop = (area.of(c) for c in ("p95_m", "possible_p95_m", "hdop"))
        norm = _norm(receiver, possible, bounds=area.colours)
        figure, axes = _panels(area, 3, narrow, 0.0 if area.limit_m is None else 2 * LINE)
        first, second, third = axes
        shown = _cells(first, area, receiver, norm)
        _cells(second, area, possible, norm)
        dilution = _cells(third, area, hdop, _norm(hdop))
        handles, *_ = [_beacons(ax, area) for ax in axes]
        lines = _requirement(second, area, possible, band=False)
        lines |= _requirement(first, area, receiver)
        handles += lines.values()
        lost = f"more than {percent(MANY_LOST)} of the runs lost"
        handles += _hatched(first, area, area.of("lost_share") > MANY_LOST, lost)
        handles += _hatched(second, area, area.of("accuracy") == 0, "no accuracy is possible",
                            look)
        first.set_title(_titled(area, short(area.receiver), "within_share"), loc="left")
        second.set_title(_titled(area, "possible", "possible_within_share"), loc="left")
        third.set_title("HDOP", loc="left")
        what = area.settings["error"].replace("_", " ")
        new = "\n" if narrow else " "  # the bar may be short
        _bar(figure, shown, [first, second], f"95 % of the {what}{new}errors within [m]", narrow)
        _bar(figure, dilution, [third], f"HDOP [m per m{new}of range error]", narrow)
        _explain(figure, area, handles, narrow)
    return axes


def plot_narrow(area: AreaMap, theme: ThemeName = "light") -> list[Axes]:
    """`plot_map` with panels one above the other."""
    return plot_map(area, narrow=True, theme=theme)


def plot_certainty(area: AreaMap, theme: ThemeName = "light") -> list[Axes]:
    """The relative standard error of the receiver's 95 % error, and the share of lost runs.

    Quantities that are zero everywhere, or known nowhere, have no map; see `uncertain`.
    """
    with use(theme):
        maps = uncertain(area)
        figure, axes = _panels(area, len(maps), narrow=False)
        for ax, (label, values) in zip(axes, maps.items(), strict=True):
            top = max(float(values[np.isfinite(values)].max()), 1.0)
            _bar(figure, _cells(ax, area, values, Normalize(0.0, top)), [ax], label, False)
        handles, *_ = [_beacons(ax, area) for ax in axes]
        if ERROR in maps:
            handles += _requirement(axes[0], area, area.of("p95_m")).values()
        axes[0].set_title(short(area.receiver), loc="left")
        _explain(figure, area, handles, False, "" if LOSSES in maps else "No run was lost. ")
    return axes


def uncertain(area: AreaMap) -> dict[str, Floats]:
    """The maps of `plot_certainty` [%], by their labels."""
    with np.errstate(invalid="ignore"):
        error = 100 * area.of("std_error_m") / area.of("p95_m")
    maps = {ERROR: error, LOSSES: 100 * area.of("lost_share")}
    return {name: m for name, m in maps.items() if (np.isfinite(m) & (m > 0)).any()}


def _panels(
    area: AreaMap, count: int, narrow: bool, titles: float = 0.0
) -> tuple[Figure, list[Axes]]:
    """Maps of equal size and scale, side by side or one above the other.

    Parameters
    ----------
    titles
        Height of the titles beyond one line [inch].
    """
    grid = area.grid
    height, width = (high - low for low, high in (grid.north, grid.east))
    side = _NARROW if narrow else _WIDE
    high = min(max(side * height / width, 1.2 if narrow else 0.8), 1.8 * side)
    size = (side + 1.5, count * (high + 0.45 + titles) + 0.5) if narrow else (
        count * side + 0.9, high + titles + 1.8
    )
    figure = new_figure(*size)
    rows, columns = (count, 1) if narrow else (1, count)
    axes = list(figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).flat)
    for ax in axes:
        ax.set(xlim=grid.east, ylim=grid.north, aspect="equal")
        ax.grid(visible=False)
        ax.xaxis.set_major_locator(MaxNLocator(_ticks(min(side, high * width / height) / 0.6)))
        ax.yaxis.set_major_locator(MaxNLocator(_ticks(min(high, side * height / width) / 0.3)))
    for ax in axes[-1:] if narrow else axes:
        ax.set_xlabel("East y [m]")
    for ax in axes if narrow else axes[:1]:
        ax.set_ylabel("North x [m]")
    return figure, axes


def _ticks(room: float) -> int:
    """Largest number of intervals between ticks if there is room for the given number of labels."""
    return int(min(max(room, 1.0), 5.0))


def _titled(area: AreaMap, name: str, share: str) -> str:
    """The name of a map, and the share of it that is within the requirement."""
    if area.limit_m is None:
        return name
    (height, width) = (high - low for low, high in (area.grid.north, area.grid.east))
    room = max(_WIDE * min(1.8 * width / height, 1.0), _SHORTEST)
    words = f"{part(area.summary()[share])} within {meters(area.limit_m)}"
    return f"{name}\n{wrapped(words, room)}"


def _norm(*maps: Floats, bounds: tuple[float, float] | None = None) -> Normalize:
    """A common colour scale for some maps that covers at least the given range."""
    values = np.concatenate([m[np.isfinite(m)] for m in maps])
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    if low > 0 and high > _RATIO * low:
        return LogNorm(low, high)
    return Normalize(*(bounds or widened(low, high, 0.0)))


def _cells(ax: Axes, area: AreaMap, values: Floats, norm: Normalize) -> Any:
    grid = area.grid
    east, north = (
        np.linspace(*bounds, count + 1)
        for bounds, count in ((grid.east, grid.columns), (grid.north, grid.rows))
    )
    return ax.pcolormesh(
        east, north, np.ma.masked_invalid(values), norm=norm, cmap=COLOURS, rasterized=True
    )


def _requirement(
    ax: Axes, area: AreaMap, values: Floats, *, band: bool = True
) -> dict[str, Any]:
    """The contour of the requirement and those of two standard errors about it, where they exist.

    Returns legend handles by label.
    """
    limit, (north, east) = area.limit_m, area.grid.axes
    if limit is None:
        return {}
    outline: list[patheffects.AbstractPathEffect] = [
        patheffects.withStroke(linewidth=2.6, foreground="#ffffff")
    ]
    how: dict[str, Any] = {"colors": "#000000", "levels": [limit]}
    lines: dict[str, Any] = {}

    def noted(label: str, **look: Any) -> None:
        lines[label] = Line2D([], [], color="#000000", path_effects=outline, label=label, **look)

    crosses = _crosses(values, limit)
    if crosses:
        noted(f"95 % within {meters(limit)}", lw=1.4)
    around = NEAR * area.of("std_error_m")
    with np.errstate(invalid="ignore"):
        sides: Sequence[Floats] = (values - around, values + around) if band else ()
    for side in sides:
        if _crosses(side, limit):
            ax.contour(east, north, np.ma.masked_invalid(side), linewidths=0.8,
                       linestyles="dashed", **how).set(
                path_effects=[patheffects.withStroke(linewidth=1.8, foreground="#ffffff")]
            )
            noted(f"{meters(limit)} ± {NEAR:g} standard errors", lw=0.8, ls="dashed")
    if crosses:
        line = ax.contour(east, north, np.ma.masked_invalid(values), linewidths=1.4, **how)
        line.set(path_effects=outline)
    return lines


def _crosses(values: Floats, limit: float) -> bool:
    known = values[np.isfinite(values)]
    return len(known) > 0 and bool(known.min() < limit < known.max())


def _hatched(
    ax: Axes, area: AreaMap, where: Any, label: str, look: Theme | None = None
) -> list[Any]:
    """Hatch cells that need a remark: in ink on paper, in black on colours."""
    if not np.any(where):
        return []
    hatch, colour, paper = ("....", "#000000", "#9a9a9a")
    if look is not None:
        hatch, colour, paper = ("////", look.ink, look.paper)
    # Four points in the corners of each cell, so that contours follow its edges.
    inside = np.array([-0.499, 0.499])
    east, north = (
        (middles[:, None] + inside * size).ravel()
        for middles, size in zip(area.grid.axes[::-1], area.grid.size[::-1], strict=True)
    )
    flags = np.repeat(np.repeat(np.asarray(where, float), 2, axis=0), 2, axis=1)
    ax.contourf(
        east, north, flags, levels=[0.5, 1.5], colors="none", hatches=[hatch]
    ).set(edgecolor=colour, linewidth=0.0)
    return [Patch(facecolor=paper, edgecolor=colour, hatch=hatch, label=label)]


def _beacons(ax: Axes, area: AreaMap) -> list[Any]:
    """The beacons, with arms to scale; a single mark if they would hide each other."""
    north, east, _ = area.beacons.T
    middle = area.beacons.mean(axis=0)
    arm = float(np.hypot(*(area.beacons - middle)[:, :2].T).max())
    sides = [np.ptp(ends) for ends in (area.grid.north, area.grid.east)]
    how: dict[str, Any] = {
        "color": "#000000", "mfc": "#ffffff", "zorder": 5, "marker": "^",
        "path_effects": [patheffects.withStroke(linewidth=2.4, foreground="#ffffff")],
    }  # fmt: skip
    if arm < SMALLEST * max(sides):
        name = f"{counted(len(north), 'beacon')} within {meters(arm)}"
        return ax.plot(middle[1], middle[0], ls="", ms=5, label=name, **how)
    if arm <= LONGEST_ARM:
        for beacon in area.beacons:
            ends = np.array([middle, beacon])
            ax.plot(ends[:, 1], ends[:, 0], color="#000000", lw=0.9, zorder=4.9)
    return ax.plot(east, north, ls="", ms=3.5, label="beacons, to scale", **how)


def _bar(figure: Figure, shown: Any, axes: list[Axes], label: str, narrow: bool) -> None:
    bar = figure.colorbar(
        shown, ax=axes, location="right" if narrow else "bottom", label=label, aspect=30,
        shrink=0.9,
    )
    if isinstance(shown.norm, LogNorm):
        bar.locator = LogLocator(subs=(1.0, 2.0, 3.0, 5.0))
        bar.minorlocator = NullLocator()
        bar.formatter = FuncFormatter(lambda value, _: f"{value:g}")
        bar.update_ticks()
        (bar.ax.yaxis if narrow else bar.ax.xaxis).set_minor_formatter(NullFormatter())
    bar.outline.set_linewidth(0.6)


def _explain(
    figure: Figure, area: AreaMap, handles: list[Any], narrow: bool, said: str = ""
) -> None:
    """A legend beside or, on a narrow page, above the panels, and a caption below; the figure
    grows."""
    if narrow:
        legend_above(figure, handles, 1)
    else:
        for handle in handles:
            handle.set_label(wrapped(handle.get_label(), _BESIDE - 0.6))
        figure.set_figwidth(figure.get_figwidth() + _BESIDE)
        figure.legend(handles=handles, loc="outside right upper", borderaxespad=0.3)
    words = wrapped(said + caption(area), figure.get_figwidth() - 0.3)
    figure.set_figheight(figure.get_figheight() + LINE * (words.count("\n") + 2))
    figure.supxlabel(words, x=0.1 / figure.get_figwidth(), ha="left", fontsize=SIZE)
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)  # drawing does so once more: maps of equal scale need it twice


def caption(area: AreaMap) -> str:
    """What was mapped: scenario, depth, beacons, conditions and runs; and what is left out."""
    runs, cells = int(area.cells["runs"].sum()), area.grid.count
    parts = [
        f"{area.scenario.name}, {area.grid.depth:g} m deep", counted(len(area.beacons), "beacon"),
        *conditions(area.scenario), f"{counted(runs, 'run')} in {counted(cells, 'cell')}",
        brief(area.left_out),
    ]  # fmt: skip
    return f"{'; '.join(part for part in parts if part)}."


def legend_above(figure: Figure, handles: list[Any], columns: int) -> None:
    """A legend above the panels; the figure grows by it."""
    rows = -(-len(handles) // columns)
    figure.set_figheight(figure.get_figheight() + LINE * 1.2 * rows)
    figure.legend(handles=handles, loc="outside upper left", ncols=columns, borderaxespad=0.3)
