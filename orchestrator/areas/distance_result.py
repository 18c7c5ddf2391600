"""Error against distance from the platform: in words, as a table, as a figure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from .. import style
from ..catalogue import Figure, Job, by_name, jobs
from ..judge.definitions import LOST, MANY_LOST
from ..layout import fitted, table
from ..lazy import Module
from ..limits.verdict import why_none
from ..results import data_sheet
from ..shown import Picture
from ..words.lists import counted
from ..words.numbers import figure, meters, rounded
from ..words.shares import rough_percent
from .over_places import OverPlaces
from .tables import DISTANCES

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TABLE = "distances"
_ROWS = 4
"""Most distances in all printed tables without ``--verbose``."""
_figures = Module("sblcosim.areas.distance_figures")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class DistanceCurve(OverPlaces):
    """The error of a receiver against the distance from the platform, with the possible error.

    Attributes
    ----------
    distances
        A row per depth and distance, `sblcosim.areas.tables.DISTANCES`: ``rms_m``, ``p95_m`` with
        its ``std_error_m`` and the ``bound_m`` of the data sheet, ``possible_rms_m``,
        ``possible_p95_m``, ``lost_share``.
    """

    document = "distances"
    columns = MappingProxyType({TABLE: DISTANCES})

    distances: pd.DataFrame

    @property
    def depths(self) -> list[float]:
        """Depths of the diver [m]."""
        return list(self.settings["depth_m"])

    def at(self, depth: float) -> pd.DataFrame:
        """The rows of a depth, by distance."""
        rows: pd.DataFrame = self.distances[self.distances["depth_m"] == depth]
        return rows

    @property
    def title(self) -> str:
        """Of a page."""
        return f"Error against distance: {self.scenario.name}"

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The distances."""
        return {TABLE: self.distances}

    @property
    def figures(self) -> list[Job]:
        """The figure for a data sheet."""
        return jobs(FIGURES, self)

    def plot(self, theme: style.ThemeName = "light", *, ax: Axes | None = None) -> Picture:
        """Error against distance; see `distance_figures.plot_distance`."""
        axes: list[Axes] = [_figures.plot_distance(self, ax, theme)]
        return Picture(axes, ax)

    # --- Words -----------------------------------------------------------------------------------

    @property
    def answer(self) -> str:
        """The data-sheet sentence of each depth, and how far the requirement is kept."""
        return "\n".join([*self.data_sheet, *self._limits()])

    @property
    def data_sheet(self) -> list[str]:
        """A sentence for a data sheet for each depth, or why there is none."""
        runs = self.settings["runs"]
        if runs < data_sheet.LEAST_RUNS:
            return [data_sheet.too_few(runs, " at each distance")]
        return [self._sentence(depth) for depth in self.depths]

    def _sentence(self, depth: float) -> str:
        rows, s = self.at(depth), self.settings
        distances = rows["distance_m"].to_numpy()
        known = _leading(np.isfinite(rows["bound_m"].to_numpy()))
        without = "about 5 % of the runs or more have no estimate"
        if not known:
            return (
                f"no data-sheet sentence at {depth:g} m depth: {without} {distances[0]:g} m from "
                f"{self.reference_point}"
            )
        kept = rows[:known]
        each = f"each of {known} distances" if known > 1 else "that distance"
        said = data_sheet.sentence(
            self.receiver, float(kept["bound_m"].max()),
            f"{_reach(distances[0], distances[known - 1])} from {self.reference_point}, at "
            f"{depth:g} m depth",
            self.scenario, f"{s['runs']:,} runs at {each}", s["error"],
        )  # fmt: skip
        lost = float(kept["lost_share"].max())
        if lost > MANY_LOST:
            said += f"; up to {rough_percent(lost)} of the runs are lost"
        if known < len(rows):
            said += f"; no figure farther out: {without} at {figure(distances[known])} m"
        return said

    def reach(self, depth: float) -> tuple[float | None, float | None]:
        """Up to which distance the requirement is kept, and up to which that is possible [m].

        At this distance and all nearer ones, the data sheet's bound, or the possible error, is
        within the requirement. None: at no distance, or there is no requirement.
        """
        if self.limit_m is None:
            return None, None
        rows = self.at(depth)
        at = rows["distance_m"].to_numpy()
        kept = [_leading((rows[it] <= self.limit_m).to_numpy()) for it in (
            "bound_m", "possible_p95_m"
        )]  # fmt: skip
        first, second = (float(at[n - 1]) if n else None for n in kept)
        return first, second

    def _limits(self) -> Iterator[str]:
        if self.limit_m is None:
            return
        least = self.settings["distance_m"][0]
        for depth in self.depths:
            mine, best = (
                f"not even at {least:g} m" if it is None else f"up to {figure(it)} m"
                for it in self.reach(depth)
            )
            yield f"within {meters(self.limit_m)} at {depth:g} m depth: {mine}; possible: {best}"

    @property
    def remarks(self) -> list[str]:
        """Remarks that are needed to read the answer, one line each."""
        return [*self._remarks(verbose=True)]

    def _remarks(self, verbose: bool) -> Iterator[str]:
        s, rows = self.settings, self.distances
        if verbose and s["runs"] >= data_sheet.LEAST_RUNS:
            yield data_sheet.NOTE
        lost = rows["lost_share"]
        if verbose or lost.max():
            yield (
                f"lost runs: {rough_percent(lost.mean())} of {rows['runs'].sum():,}, at most "
                f"{rough_percent(lost.max())} at a distance"
            )
        if lost.max():
            yield LOST
        bent = int((~rows["accuracy"]).sum())
        if bent:
            yield (
                f"no accuracy is possible at {counted(bent, 'distance')}: "
                f"{why_none(self.scenario)}"
            )
        yield from self.failed()
        if verbose:
            yield (
                f"{s['runs']:,} runs at each of {s['cells']} distances, in all directions; "
                "distances are horizontal, from the middle of the beacons to the middle of the "
                "diver's circle"
            )
        counted_from = (
            f"; errors count from {s['settling_s']:g} s to {s['duration_s']:g} s" if verbose else ""
        )
        yield (
            f"the diver circles clockwise with a radius of {s['radius_m']:g} m at "
            f"{s['speed_m_s']:g} m/s{counted_from}"
        )
        yield from self.warned()

    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """The answer, a table for each depth, and the remarks.

        Parameters
        ----------
        verbose
            Show all distances, how they were simulated, and what the sentence for a data sheet
            includes.
        width
            Columns to fit into; None: lines are not wrapped.
        """
        what = f"{self.settings['error'].replace('_', ' ')} error [m]"
        if verbose:
            lines = [self.answer]
            for depth in self.depths:
                lines += ["", f"{what} at {depth:g} m depth", *_printed(self.at(depth), width)]
        else:
            rows = pd.concat([self._some(depth) for depth in self.depths])
            first, *others = self.depths
            at = "" if others else f" at {first:g} m depth"
            lines = [*self._shortly(), *self._limits(), "", f"{what}{at}",
                     *_printed(rows, width, several=bool(others))]  # fmt: skip
        return fitted("\n".join([*lines, "", *self._remarks(verbose)]), width)

    def _some(self, depth: float) -> pd.DataFrame:
        """Some of the distances at a depth, evenly spaced, with the farthest."""
        rows = self.at(depth)
        step = row_step(len(rows), max(_ROWS // len(self.depths), 3))
        return rows[::-step][::-1]

    def _shortly(self) -> Iterator[str]:
        """The data sheet, with the conditions only once for all depths."""
        first, *others = self.data_sheet
        yield first
        for said in others:
            radius, conditions, rest = said.partition(_conditions(first))
            yield f"{radius}, in the same conditions{rest}" if conditions else said

    # --- Data ------------------------------------------------------------------------------------

    def to_json(self) -> dict[str, Any]:
        """Everything as plain data; missing numbers are None."""
        reach = [self.reach(depth) for depth in self.depths]
        return self.plain({
            "data_sheet": self.data_sheet, "reach_m": [it[0] for it in reach],
            "possible_reach_m": [it[1] for it in reach],
            "distances": DISTANCES.rows(self.distances),
        })  # fmt: skip

    def manifest(self) -> dict[str, Any]:
        """What was simulated, as plain data."""
        made = {key: it for key, it in self.to_json().items() if key in (
            "scenario_name", "receiver", "settings", "motion", "data_sheet"
        )}  # fmt: skip
        return {"distances": made, "scenario": self.scenario.dump_toml()}

    def _gist(self) -> str:
        return f"of {self.receiver}, {len(self.distances)} distances"


def row_step(count: int, most: int) -> int:
    """Smallest step that picks at most some of a number of rows, if possible both ends."""
    steps = [*range(max(-(-count // most), 1), count)]
    return next((it for it in steps if (count - 1) % it == 0), *steps[:1] or (1,))


def _leading(flags: Any) -> int:
    """Number of true values before the first false one."""
    return int(np.cumprod(np.asarray(flags, bool)).sum())


def _reach(low: float, high: float) -> str:
    """``up to 60 m``, ``from 5 to 60 m``, ``at 5 m``."""
    if low == high:
        return f"at {figure(low)} m"
    return f"from {figure(low)} to {figure(high)} m" if low else f"up to {figure(high)} m"


_SHOWN = ("rms_m", "p95_m", "bound_m", "possible_rms_m", "possible_p95_m")


def _conditions(said: str) -> str:
    """The conditions in a sentence for a data sheet: all after the depth, with its comma."""
    _, depth, after = said.partition(" m depth,")
    return f", {after.partition(';')[0].strip()}" if depth else "\n"


def _printed(rows: pd.DataFrame, width: int | None, *, several: bool = False) -> Iterator[str]:
    """A table of distances; of several depths with a column of them."""
    heads = ["distance", *map(DISTANCES.head, (*_SHOWN, "lost_share"))]
    heads = ["depth", *heads] if several else heads
    cells = [
        [*([f"{figure(row['depth_m'])} m"] if several else []),
         f"{figure(row['distance_m'])} m",
         *(rounded(row[name]) for name in _SHOWN),
         rough_percent(row["lost_share"])]
        for row in rows.to_dict("records")
    ]  # fmt: skip
    return table(cells, width, heads, range(len(heads)))


def _data(found: DistanceCurve) -> tuple[Any, ...]:
    return (found,)


FIGURES: Mapping[str, Figure[DistanceCurve]] = by_name(
    Figure("distance", _figures.later("plot_distance"), _data, str)
)
"""The figure in its folder."""
