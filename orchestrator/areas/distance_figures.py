"""The figure for a data sheet: error against distance from the platform, at depths."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ..judge.definitions import MANY_LOST
from ..layout import filled
from ..limits.unknown import brief
from ..scenario.conditions import conditions
from ..style import LINES, MARKERS, SMALL, ThemeName, new_figure, use
from ..words.numbers import figure as short_number
from ..words.numbers import meters
from .distance_result import DistanceCurve
from .figures import legend_above

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WIDTH, _HEIGHT = 6.4, 3.8
"""[inch]"""
_CHARACTERS = 12.5
"""Characters of a caption per inch."""
_BAND = 0.2
"""Opacity of two standard errors about a line."""


def plot_distance(
    found: DistanceCurve, ax: Axes | None = None, theme: ThemeName = "light"
) -> Axes:
    """The radius that holds 95 % of the estimates, the RMS error, and what is possible.

    One colour and marker for each depth; bands are two standard errors. Crosses stand below where
    more than 5 % of the runs are lost.
    """
    with use(theme, ax) as look:
        own = ax is None
        if ax is None:
            ax = new_figure(_WIDTH, _HEIGHT).add_subplot()
        depths = found.depths
        for i, depth in enumerate(depths):
            rows = found.at(depth)
            at = rows["distance_m"].to_numpy()
            colour = look.receivers[i % len(look.receivers)]
            marker = MARKERS[i % len(MARKERS)] if len(depths) > 1 else ""
            every = (i, max(len(at) // 6, 1))
            p95, around = (rows[it].to_numpy() for it in ("p95_m", "std_error_m"))
            p95, around = (np.where(np.isfinite(p95 + around), it, np.nan) for it in (p95, around))
            ax.fill_between(at, p95 - 2 * around, p95 + 2 * around, color=colour, alpha=_BAND, lw=0)
            ax.plot(at, p95, color=colour, lw=1.8, marker=marker, ms=5, markevery=every)
            ax.plot(at, rows["rms_m"], color=colour, lw=1.0, ls=LINES[2])
            ax.plot(at, rows["possible_p95_m"], color=colour, lw=1.2, ls=LINES[1])
            lost = rows["lost_share"].to_numpy() > MANY_LOST
            ax.plot(at[lost], np.zeros(lost.sum()), color=colour, ls="", marker="x", ms=6,
                    clip_on=False, zorder=5)
        if found.limit_m is not None:
            ax.axhline(found.limit_m, color=look.ink, lw=1.2, ls=LINES[3])
        what = found.settings["error"].replace("_", " ")
        ax.set(xlabel=f"Horizontal distance from {found.reference_point} [m]",
               ylabel=f"{what[0].upper()}{what[1:]} error [m]",
               xlim=tuple(found.settings["distance_m"]))
        ax.set_ylim(bottom=0.0)
        handles = _handles(found, look.ink, look.receivers)
        if own:
            across = round(_CHARACTERS * _WIDTH)
            ax.set_title(filled(_caption(found), across), loc="left", fontsize=SMALL,
                         parse_math=False)
            legend_above(cast("Figure", ax.figure), handles, 3)
        else:
            ax.legend(handles=handles, loc="best")
    return ax


def _handles(found: DistanceCurve, ink: str, colours: tuple[str, ...]) -> list[Line2D | Patch]:
    """The legend's lines, colours and marks."""
    depths = found.depths
    main = colours[0] if len(depths) == 1 else ink
    handles: list[Line2D | Patch] = []
    if len(depths) > 1:
        handles += [
            Line2D([], [], color=colours[i % len(colours)], marker=MARKERS[i % len(MARKERS)], ms=5,
                   lw=1.8, label=f"{depth:g} m deep")
            for i, depth in enumerate(depths)
        ]  # fmt: skip
    handles += [
        Line2D([], [], color=main, lw=1.8, label="95 % of the estimates"),
        Patch(color=main, alpha=_BAND, lw=0, label="± 2 standard errors"),
        Line2D([], [], color=main, lw=1.0, ls=LINES[2], label="RMS"),
        Line2D([], [], color=main, lw=1.2, ls=LINES[1], label="possible: 95 %"),
    ]
    if found.limit_m is not None:
        handles.append(Line2D([], [], color=ink, lw=1.2, ls=LINES[3],
                              label=f"required: {meters(found.limit_m)}"))  # fmt: skip
    if (found.distances["lost_share"] > MANY_LOST).any():
        handles.append(Line2D([], [], color=main, ls="", marker="x", ms=6,
                              label="more than 5 % lost"))  # fmt: skip
    return handles


def _caption(found: DistanceCurve) -> str:
    """Receiver, scenario, depth, conditions and runs, and what the possible error leaves out."""
    s = found.settings
    depth = f"{short_number(found.depths[0])} m deep, " if len(found.depths) == 1 else ""
    parts = [
        f"{found.receiver} in {found.scenario.name}: {depth}"
        f"{', '.join(conditions(found.scenario))}",
        f"{s['runs']:,} runs at each distance", brief(found.left_out),
    ]  # fmt: skip
    return "; ".join(part for part in parts if part)
