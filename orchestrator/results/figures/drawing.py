"""What the figures of a run share: lines of receivers, limits, titles, legends and margins.

Our own figures have margins in inches. Everything outside the axes is known beforehand, and a
layout that measures every label twice takes as long as drawing. All figures have one width, so
that type has one size when they are shown at one width.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from math import ceil
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import allow_rasterization
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.legend_handler import HandlerBase, HandlerLine2D
from matplotlib.lines import Line2D
from matplotlib.path import Path
from matplotlib.patheffects import AbstractPathEffect, withStroke
from matplotlib.textpath import text_to_path
from matplotlib.ticker import ScalarFormatter
from matplotlib.transforms import IdentityTransform, ScaledTranslation

from ...data.estimates import Floats
from ...layout import with_units
from ...scenario.labels import FIXES
from ...style import LINES, MARKERS, SIZE, SMALL, Theme, new_figure
from ...words.numbers import minus

Tracks = Mapping[str, pd.DataFrame]

LEFT, RIGHT, BOTTOM = 0.72, 0.12, 0.5
"""Margins for the labels of axes [inch]."""
GAP = 0.12
"""Gap between panels, and below a legend [inch]."""
WIDTH = 7.2
"""Width of a figure without unusually long numbers [inch]."""
NUMBERS = 0.37
"""Space for the numbers of a vertical axis [inch]; longer numbers widen the figure."""
LINE = 1.25 * SIZE / 72
"""Height of a line of text [inch]."""
SIDES = ((1, 0.6), (1, -0.6), (-1, 0.6), (-1, -0.6), (0, 1), (0, -1), (1, 0), (-1, 0))
"""Positions of a label beside its point, right and up, the best one first."""
AWAY = (6, 9, 13)
"""Distances of a label from its point [point]."""
DOT = 0.05
"""Cost of hiding a dot under a label; hiding a point of a curve costs 1."""
DOTS_ALPHA = 0.9
NOTHING = "\u200b"
"""A zero-width space."""
LONGEST_NAME = 32
"""Longest name in a legend [characters]; all our own labels fit."""
MOST_DIGITS = 8
"""Length of a number at a tick above which it is rounded, if it is also large or small."""
_POWER = re.compile(r"e\+?(-?)0*")
_HANDLE = 0.6
"""Space in a legend beside a name and around it [inch]."""
OUTLIER = 4.0
"""A raw fix is an outlier if its error exceeds this multiple of the 95th percentile."""


def is_filter(label: str) -> bool:
    """Whether the receiver is drawn as a line."""
    return label not in FIXES


def lines_of(tracks: Tracks, look: Theme) -> Iterator[tuple[str, pd.DataFrame, dict[str, Any]]]:
    """Each receiver with its table and line style; raw fixes are small dots in the background."""
    filters = [label for label in tracks if is_filter(label)]
    for label, table in tracks.items():
        if label in FIXES:
            how: dict[str, Any] = {
                "color": look.soft, "ls": "", "marker": ".", "ms": 3, "alpha": DOTS_ALPHA,
                "mew": 0, "zorder": 2,
            }
        else:
            index = filters.index(label)
            turn, colour = divmod(index, len(look.receivers))
            often = ceil(len(table) / 12) or 1
            marker = MARKERS[turn % len(MARKERS)]
            if len(table) == 1:  # a point alone makes no line
                marker = MARKERS[1 + index % (len(MARKERS) - 1)]
            how = {
                "color": look.receivers[colour], "ls": LINES[index % len(LINES)], "lw": 1.4,
                "marker": marker, "ms": 5,
                "markevery": (index * often // len(filters), often), "zorder": 4,
            }
        # Matplotlib omits labels that start with an underscore from a legend.
        yield (f"{NOTHING}{label}" if label.startswith("_") else label), table, how


class _Dots(Line2D):
    """A line's markers as one path of round caps: in an SVG a tenth of the size of separate
    marks."""

    @allow_rasterization  # type: ignore[untyped-decorator]
    def draw(self, renderer: Any) -> None:
        points = self.get_transform().transform(np.asarray(self.get_xydata(), dtype=np.float64))
        points = points[np.isfinite(points).all(axis=1)]
        if self.clipbox is not None:
            low, high = np.array(self.clipbox.get_points())
            points = points[((points > low - 9) & (points < high + 9)).all(axis=1)]
        if not self.get_visible() or not len(points):
            return
        ends = np.repeat(points, 2, axis=0)
        ends[1::2, 0] += 1e-3  # Agg omits what has no length at all
        path = Path(ends, np.tile([Path.MOVETO, Path.LINETO], len(points)).astype(np.uint8))
        path.should_simplify = False
        gc = renderer.new_gc()
        self._set_gc_clip(gc)  # type: ignore[attr-defined]
        gc.set_foreground(to_rgba(self.get_color(), self.get_alpha()), isRGBA=True)
        gc.set_linewidth(self.get_markersize() / 2)
        gc.set_capstyle("round")
        gc.set_snap(False)
        renderer.draw_path(gc, path, IdentityTransform())
        gc.restore()
        self.stale = False


SEVERAL: HandlerBase = HandlerLine2D(numpoints=3)
_MANY: Mapping[Any, HandlerBase] = {_Dots: SEVERAL}
"""In a legend too, several dots stand for many: a single one is a mark on a map."""


def add_line(ax: Axes, x: Any, y: Any, how: Mapping[str, Any]) -> None:
    """Draw a line in the style of `lines_of`; many dots at once."""
    if how["ls"]:
        ax.plot(x, y, **how)
    else:
        ax.add_line(_Dots(np.asarray(x), np.asarray(y), **how))


_MOST_BANDS = 2
"""Largest number of filled bands; more add up to one grey."""


def draw_claim(
    ax: Axes, t: Any, reach: Any, label: str, how: Mapping[str, Any], tracks: Tracks
) -> str:
    """What a filter claims about zero: a band with edges, or of many filters the edges alone.

    Returns
    -------
    str
        What it is called in the title.
    """
    filled = sum(map(is_filter, tracks)) <= _MOST_BANDS
    if filled:
        ax.fill_between(t, -reach, reach, color=how["color"], alpha=0.12, lw=0, label=label,
                        zorder=1)
    edges = np.concatenate([reach, [np.nan], -reach])
    ax.plot(np.concatenate([t, [np.nan], t]), edges, color=how["color"], ls=how["ls"], lw=0.8,
            zorder=1.5)
    return f"{'bands' if filled else 'thin lines'}: claimed ±2σ"


def halo(look: Theme) -> list[AbstractPathEffect]:
    """What keeps a text readable on curves: a rim of paper."""
    return [withStroke(linewidth=2.4, foreground=look.paper)]


class WholeTicks(ScalarFormatter):
    """Numbers at the ticks that are whole in themselves: no power of ten stands beside the axis."""

    def format_ticks(self, values: Any) -> list[str]:
        """The numbers as they are, or rounded if they are long and stay different."""
        size = max(map(abs, values), default=0.0)
        if size == 0 or 1e-4 <= size < 1e6:
            return super().format_ticks(values)
        plain = [f"{value:.10g}" for value in values]
        short = [f"{value:.3g}" for value in values]
        rounded = max(map(len, plain)) > MOST_DIGITS and len({*short}) == len(short)
        return [minus(_POWER.sub(r"e\1", text)) for text in (short if rounded else plain)]

    def get_offset(self) -> str:
        """Nothing."""
        return ""


def truth_of(look: Theme) -> dict[str, Any]:
    """Style of the truth: on top of the estimates, but thinner."""
    return {"color": look.ink, "lw": 0.8, "zorder": 5}


# --- Words ---------------------------------------------------------------------------------------


def outside(tracks: Tracks, limits: Mapping[str, tuple[float, float]]) -> str:
    """Note on the estimates beyond the limits of their columns."""
    counts = {
        label: int((~np.all([table[c].between(*limits[c]) for c in limits], axis=0)).sum())
        for label, table in tracks.items()
    }
    words = ", ".join(
        f"{short(label)} ({n}\u00a0of\u00a0{len(tracks[label])})"
        for label, n in counts.items() if n
    )  # fmt: skip
    return f"outside the figure: {words}" if words else ""


def no_fix(tracks: Tracks) -> str:
    """Note on the receivers without any estimate."""
    silent = ", ".join(short(label) for label, table in tracks.items() if table.empty)
    return f"no fix: {silent}" if silent else ""


def short(name: str, longest: int = LONGEST_NAME) -> str:
    """Shorten a long name to its beginning and end."""
    if len(name) <= longest:
        return name
    tail = longest // 2 - 1
    return f"{name[:longest - tail - 1]}…{name[-tail:]}"


def inches(words: str, size: float = SIZE) -> float:
    """Width of a line of text [inch]."""
    width: float = text_to_path.get_text_width_height_descent(
        words, FontProperties(size=size), ismath=False
    )[0]
    return width / 72


def short_for(name: str, room: float) -> str:
    """A name shortened to fit a width in inches."""
    return next(
        (some for n in range(LONGEST_NAME, 6, -2) if inches(some := short(name, n)) <= room),
        short(name, 6),
    )


def wrapped(words: str, room: float, size: float = SIZE) -> str:
    """A text in lines of limited width [inch], broken between words, not before units."""
    lines: list[str] = []
    for word in with_units(words).split(" "):
        if lines and inches(longer := f"{lines[-1]} {word}", size) <= room:
            lines[-1] = longer
        else:
            lines.append(word)
    return "\n".join(lines).replace("\N{NO-BREAK SPACE}", " ")


# --- Panels, legend and margins ------------------------------------------------------------------


def panels(
    count: int, axes: Sequence[Axes] | None, heights: Sequence[float] | None = None
) -> Sequence[Axes]:
    """Panels above each other with a common horizontal axis; heights in inches.

    Raises
    ------
    ValueError
        The number of `axes` is wrong.
    """
    if axes is not None:
        if len(axes) != count:
            raise ValueError(f"axes: must be {count} axes, got {len(axes)}")
        return axes
    heights = heights or (1.45,) * count
    figure = new_figure(WIDTH, sum(heights) + GAP * (count - 1) + BOTTOM, laid_out=True)
    grid = figure.subplots(
        count, sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights}
    )[:, 0]
    for ax in grid:
        ax.margins(x=0.01)
        ax.yaxis.set_major_formatter(WholeTicks())
        if ax is not grid[-1]:
            ax.tick_params(axis="x", bottom=False)  # the grid is enough, and is drawn anyway
    return list(grid)


def finish(axes: Sequence[Any], own: bool, *title: str, beside: bool = False) -> None:
    """A title from those of its parts that are not empty, and one legend for all axes.

    In our own figure both stand above the axes. The figure grows by them and gets its margins. In
    given axes they stand inside the first one. A line and a band with the same label share an
    entry.

    Parameters
    ----------
    beside
        Whether the legend of our own figure is on the right, where room has been left for it.
    """
    words = "; ".join(part for part in title if part)
    words = words[:1].upper() + words[1:]
    entries: dict[str, dict[type, Any]] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, {}).setdefault(type(handle), handle)
    handles: list[Any] = [
        tuple(same.values()) if len(same) > 1 else next(iter(same.values()))
        for same in entries.values()
    ]
    names = [short(label) for label in entries]
    figure = axes[0].figure
    if own and isinstance(figure, Figure):
        legend = None
        if names:
            legend = _legend_beside(figure, handles, names) if beside else _legend_above(
                figure, handles, names
            )
        words = wrapped(words, figure.get_figwidth() - LEFT - RIGHT)
        _set_margins(figure, axes, legend, words, beside)
    else:
        legend = axes[0].legend(handles, names, handler_map=_MANY) if names else None
        if words:
            axes[0].set_title(wrapped(words, 70 * SIZE / 130), loc="left")
    for handle in legend.legend_handles if legend is not None else ():
        if isinstance(handle, Line2D) and handle.get_marker() == ".":
            many = handle.get_markevery() is None  # a line of `_MANY`
            handle.set(markersize=4 if many else 8)


def longer_numbers(axes: Sequence[Axes]) -> float:
    """By how much the numbers of the vertical axes are wider than usual [inch]."""
    numbers = [
        word for ax in axes
        for word in ax.yaxis.get_major_formatter().format_ticks(ax.get_yticks().tolist())
    ]  # fmt: skip
    return 0.0 if _is_in_space(axes) else max(0.0, *(inches(word) - NUMBERS for word in numbers))


def legend_width(names: Sequence[str]) -> float:
    """Width of a legend in one column, with a gap on its left [inch]."""
    return max(inches(short(name)) for name in names) + _HANDLE


def _legend_beside(figure: Figure, handles: Sequence[Any], names: Sequence[str]) -> Any:
    """A legend in the upper right corner of a figure."""
    return figure.legend(
        handles, names, loc="upper right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.3,
        handler_map=_MANY,
    )


def _legend_above(figure: Figure, handles: Sequence[Any], names: Sequence[str]) -> Any:
    """A legend at the top of a figure, in as few rows as fit."""
    for rows in range(1, len(names) + 1):
        legend = figure.legend(
            handles, names, loc="upper center", ncols=ceil(len(names) / rows),
            bbox_to_anchor=(0.5, 1.0), borderaxespad=0.3, handler_map=_MANY,
        )
        if _extent(figure, legend).width < 0.95 * figure.bbox.width or rows == len(names):
            return legend
        legend.remove()
    return None


def _extent(figure: Figure, artist: Any) -> Any:
    return artist.get_window_extent(figure.canvas.get_renderer())  # type: ignore[attr-defined]


def _set_margins(
    figure: Figure, axes: Sequence[Axes], legend: Any, title: str, beside: bool
) -> None:
    body = figure.get_figheight()
    above, right = GAP / 2, RIGHT
    if legend is not None and beside:
        right += _extent(figure, legend).width / figure.dpi + GAP
    elif legend is not None:
        above = _extent(figure, legend).height / figure.dpi + GAP
    own = max(title_height(ax.get_title("left")) for ax in axes)
    height = body + above + title_height(title) + own
    figure.set_figheight(height)
    if legend is not None and beside:
        legend.set_bbox_to_anchor((1.0, body / height))
    grid = axes[0].get_gridspec()
    rows, columns = (1, 1) if grid is None else grid.get_geometry()
    gap = GAP + own
    figure.subplots_adjust(
        bottom=BOTTOM / height, top=body / height,
        hspace=gap * rows / (body - BOTTOM - gap * (rows - 1)),
    )  # fmt: skip
    longer = longer_numbers(axes)  # they depend on the height
    width, left = figure.get_figwidth() + longer, LEFT + longer
    figure.set_figwidth(width)
    panel = (width - left - right - GAP * (columns - 1)) / columns
    figure.subplots_adjust(left=left / width, right=1 - right / width, wspace=GAP / panel)
    if title:
        figure.suptitle(title, x=left / width, y=1 - above / height, ha="left", va="top",
                        fontsize="medium")
    for ax in axes if not _is_in_space(axes) else ():
        # A fixed place: otherwise each label looks at all ticks of all panels.
        ax.yaxis.set_label_coords(-(0.5 + longer) / panel, 0.5)


def _is_in_space(axes: Sequence[Axes]) -> bool:
    return axes[0].name == "3d"


def title_height(words: str) -> float:
    """Height of a title [inch]."""
    return LINE * (words.count("\n") + 1) + 0.06 if words else 0.0


# --- Labels of points ---------------------------------------------------------------------------


def free_places(
    ax: Axes,
    points: Floats,
    words: Sequence[str],
    drawn: Floats,
    dots: Floats | None = None,
) -> Iterator[dict[str, Any]]:
    """Positions of point labels that hide as few drawn points as possible, and no other label.

    Parameters
    ----------
    points, drawn
        Coordinates in the plane of the axes, shapes (n, 2) and (m, 2).
    dots
        Like `drawn`, but they may be hidden if that keeps a label near its point.

    Yields
    ------
    dict
        Transform and alignment of a text at the point.
    """
    inch = ax.figure.dpi
    taken = ax.transData.transform(drawn[np.isfinite(drawn).all(axis=1)]) / inch
    soft = np.empty((0, 2)) if dots is None else ax.transData.transform(
        dots[np.isfinite(dots).all(axis=1)]
    ) / inch
    inside = ax.bbox.frozen().transformed(ax.figure.dpi_scale_trans.inverted())
    for point, word in zip(ax.transData.transform(points) / inch, words, strict=True):
        lines = word.splitlines()
        size = np.array([0.6 * max(map(len, lines)), 1.25 * len(lines)]) * SMALL / 72
        best: tuple[float, Floats, Floats] | None = None
        for away, (right, up) in product(AWAY, SIDES):
            offset = np.array([right, up]) * away / 72
            corner = point + offset + size * (np.sign([right, up]) - 1) / 2
            low, high = corner - 0.03, corner + size + 0.03
            hidden = ((taken > low) & (taken < high)).all(axis=1).sum()
            hidden += DOT * ((soft > low) & (soft < high)).all(axis=1).sum()
            beyond = not (inside.contains(*corner) and inside.contains(*(corner + size)))
            bad = float(hidden) + 1000.0 * beyond + 0.5 * (away - AWAY[0]) / AWAY[0]
            if best is None or bad < best[0]:
                best = bad, offset, corner
        assert best is not None
        _, (right, up), corner = best
        grid = np.array(list(product((0, 0.25, 0.5, 0.75, 1), (0, 0.5, 1))))
        taken = np.vstack([taken, np.tile(corner + size * grid, (20, 1))])  # worse than a curve
        ha, va = int(np.sign(right)), int(np.sign(up))
        yield {
            "transform": ax.transData + ScaledTranslation(right, up, ax.figure.dpi_scale_trans),
            "ha": ("center", "left", "right")[ha], "va": ("center", "bottom", "top")[va],
        }  # fmt: skip


# --- Limits --------------------------------------------------------------------------------------


def columns(tracks: Tracks, column: str) -> list[Floats]:
    """A column of each filter, or of each raw fix if there is no filter."""
    filters = [label for label in tracks if is_filter(label)]
    return [tracks[label][column].to_numpy() for label in filters or tracks if len(tracks[label])]


def limits(
    seen: Floats, tracks: Tracks, axis: str, reach: float = 0.0, least: float = 1.0,
    whole: str = "",
) -> tuple[float, float]:
    """Limits of a coordinate that contain the given points and the estimates near them [m].

    Diverging estimates and outliers of the raw fix leave the figure, so that they do not compress
    everything else.

    Parameters
    ----------
    seen
        Coordinates that the figure must contain.
    axis
        ``x``, ``y`` or ``z``.
    reach
        How far estimates may extend the figure on both sides, if that is more than half the extent
        of `seen`, and more than 3 m. For raw fixes beside filters it is half as much, but at least
        3 m.
    least
        Smallest distance between the limits.
    whole
        Receiver whose estimates must all be in the figure, however far away.
    """
    column, error = f"{axis}_m", f"error_{axis}_m"
    must = [seen, tracks[whole][column].to_numpy()] if whole else [seen]
    known = np.concatenate([values[np.isfinite(values)] for values in must])
    low, high = float(known.min()), float(known.max())
    reach = max(reach, (high - low) / 2, 3.0)
    bottom, top = low, high
    filters = any(map(is_filter, tracks))
    for label, table in tracks.items():
        values, far = table[column].to_numpy(), reach
        if not is_filter(label):
            errors = np.abs(table[error].to_numpy())
            if len(errors):
                values = values[errors <= OUTLIER * np.nanpercentile(errors, 95)]
            far = max(reach / 2, 3.0) if filters else reach
        values = values[np.isfinite(values)]
        if len(values):
            bottom = min(bottom, max(float(values.min()), low - far))
            top = max(top, min(float(values.max()), high + far))
    margin = max(0.06 * (top - bottom), (least - (top - bottom)) / 2)
    return bottom - margin, top + margin


def error_limit(tracks: Tracks, error: str, std: str) -> float:
    """Upper limit that contains the filters' errors, except outliers, and most of the bands."""
    errors = [np.abs(e) for e in columns(tracks, error)]
    tops = [min(np.nanmax(e), 4 * np.nanpercentile(e, 95)) for e in errors]
    filters = {k: v for k, v in tracks.items() if is_filter(k) and std in v}
    tops += [2 * np.nanpercentile(s, 90) for s in columns(filters, std)]
    return max(1.1 * max(tops, default=1.0), 1e-3)
