"""The map of an area: its cells, in words, as a table, as figures, and on Earth."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import ceil
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from .. import style
from ..catalogue import Figure, Job, by_name, jobs
from ..judge.definitions import LOST, MANY_LOST
from ..judge.pooling import effective
from ..layout import fitted
from ..lazy import Module
from ..limits.verdict import why_none
from ..results import data_sheet
from ..shown import Picture
from ..tracks.place import Origin
from ..words.lists import counted
from ..words.numbers import meters, meters_at_most, number
from ..words.shares import percent, rough_percent, whole_percent
from . import contours
from .grid import Grid
from .over_places import OverPlaces
from .tables import CELLS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

TABLE, GEOJSON = "cells", "contours.geojson"
NOISE, FLAT = 20.0, 0.2
"""Smallest range of the colours: in standard errors, and relative to their middle."""
_figures = Module("sblcosim.areas.figures")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class AreaMap(OverPlaces):
    """The 95 % error of a receiver over an area, with the possible error.

    Attributes
    ----------
    grid
        The cells.
    cells
        A row per cell, in rows of the area from south to north, each from west to east:
        ``north_m``, ``east_m`` and ``depth_m`` of its middle; ``runs``; ``p95_m`` and its
        ``std_error_m``, infinite where more than 5 % of the runs have no estimate; ``lost_share``
        and ``availability`` of the cell's own runs; ``possible_p95_m``, the possible error, missing
        where ``accuracy`` is false; ``hdop``.
    beacons
        Positions in still water, NED [m]; (N, 3).
    origin
        Position on Earth, if the scenario has one.
    """

    document = "map"
    columns = MappingProxyType({TABLE: CELLS})

    grid: Grid
    cells: pd.DataFrame
    beacons: Floats
    origin: Origin | None

    def of(self, column: str) -> Floats:
        """A column of the cells as a map; (rows, columns), the first row in the south."""
        return self.cells[column].to_numpy(np.float64).reshape(self.grid.shape)

    @property
    def colours(self) -> tuple[float, float]:
        """Smallest and largest 95 % error on the figure's colour scale, for both maps [m].

        The scale spans at least `NOISE` standard errors and `FLAT` of its middle, so that noise
        does not look like a structure.
        """
        low, high = self._extremes
        noise = self.of("std_error_m")[np.isfinite(self.of("p95_m"))]
        noise = noise[np.isfinite(noise)]
        return widened(low, high, NOISE * float(np.median(noise)) if len(noise) else 0.0)

    @property
    def widened(self) -> bool:
        """Whether the colours span more than the errors do."""
        return self.colours != self._extremes

    @property
    def _extremes(self) -> tuple[float, float]:
        """Smallest and largest 95 % error of both maps [m]."""
        values = np.concatenate([self.of("p95_m"), self.of("possible_p95_m")])
        known = values[np.isfinite(values)]
        return (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)

    def plot(
        self, theme: style.ThemeName = "light", *, narrow: bool = False
    ) -> Picture:
        """The receiver, what is possible and the dilution of precision; see `figures.plot_map`."""
        axes: list[Axes] = _figures.plot_map(self, narrow=narrow, theme=theme)
        return Picture(axes)

    def geojson(self) -> dict[str, Any] | None:
        """The contours on Earth (RFC 7946), if the scenario has a place on Earth.

        Lines of equal error, and with a limit the polygons that keep it, if there are any.
        """
        if self.origin is None:
            return None
        maps = {
            self.receiver: self.cells["p95_m"].to_numpy(np.float64),
            "possible": self.cells["possible_p95_m"].to_numpy(np.float64),
        }
        return contours.geojson(self.grid, maps, self.limit_m, self.origin)

    def summary(self) -> dict[str, Any]:
        """Numbers over all cells; NaN if no cell has a value."""
        cells, limit = self.cells, self.limit_m
        known = cells[np.isfinite(cells["p95_m"])]
        lost = float((cells["lost_share"] * cells["runs"]).sum() / cells["runs"].sum())
        relative = known["std_error_m"] / known["p95_m"]
        found: dict[str, Any] = {
            "runs": int(cells["runs"].sum()),
            "extra_runs": int(cells["runs"].sum()) - self.grid.count * self.settings["runs"],
            "p95_m": _three(known["p95_m"]),
            "std_error_share": _three(relative[np.isfinite(relative)]),
            "possible_p95_m": _three(cells["possible_p95_m"].dropna()),
            "lost_share": lost,
            "cells_with_many_lost": int((cells["lost_share"] > MANY_LOST).sum()),
            "cells_without_estimate": int((~np.isfinite(cells["p95_m"])).sum()),
            "cells_without_accuracy": int((~cells["accuracy"]).sum()),
            "within_share": None, "possible_within_share": None,
        }  # fmt: skip
        if limit is not None:
            found["within_share"] = float((cells["p95_m"] <= limit).mean())
            found["possible_within_share"] = float((cells["possible_p95_m"] <= limit).mean())
        return found

    def to_json(self) -> dict[str, Any]:
        """Everything but the cells as plain data."""
        return self.plain({"summary": self.summary(), "data_sheet": self.data_sheet})

    def manifest(self) -> dict[str, Any]:
        """What was simulated, and the outcome."""
        words = ("doubt", "caveat", "data_sheet")
        made = {key: it for key, it in self.to_json().items() if key not in words}
        return {"map": made, "scenario": self.scenario.dump_toml()}

    def write(
        self, folder: Path, theme: style.ThemeName = "light", figures: bool = True
    ) -> None:
        """Like `Answer.save`, with the contours on Earth."""
        super().write(folder, theme, figures)
        on_earth = self.geojson()
        if on_earth is not None:
            text = json.dumps(on_earth, allow_nan=False)
            (folder / GEOJSON).write_text(f"{text}\n", "utf-8")

    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """The map in words.

        Parameters
        ----------
        verbose
            Add the cells, and how the percentiles, the sentence for a data sheet and the colours
            are made.
        width
            Columns to fit into; None: lines are not wrapped.
        """
        return fitted("\n".join((self.answer, *self._remarks(verbose))), width)

    @property
    def title(self) -> str:
        """Of a page."""
        return f"Map of {self.scenario.name}"

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The cells."""
        return {TABLE: self.cells}

    @property
    def figures(self) -> list[Job]:
        """The map, a narrow one, and maps of its certainty."""
        return jobs(FIGURES, self)

    @property
    def answer(self) -> str:
        """Errors, possible errors, where the requirement is kept, the data sheet; one line each."""
        return "\n".join([*self._answers(), self.data_sheet])

    @property
    def data_sheet(self) -> str:
        """A sentence for a data sheet, or why there is none."""
        s, cells = self.settings, self.cells
        least = ceil(data_sheet.LEAST_RUNS / effective(self.grid.shape))
        if s["runs"] < least:
            return data_sheet.too_few(s["runs"], " in each cell", least)
        bound = self._bound
        if not np.isfinite(bound):
            return (
                "no data-sheet sentence: in some cells about 5 % of the runs or more have no "
                "estimate"
            )
        said = data_sheet.sentence(
            self.receiver, bound, f"everywhere in {self._place()}, at {self.grid.depth:g} m depth",
            self.scenario, f"{s['runs']:,} runs in each of {self.grid.count:,} cells", s["error"],
        )  # fmt: skip
        lost = float(cells["lost_share"].max())
        return said if lost <= MANY_LOST else (
            f"{said}; up to {rough_percent(lost)} of a cell's runs are lost"
        )

    @property
    def _bound(self) -> float:
        """The length in the sentence for a data sheet, before it is rounded up [m]."""
        with np.errstate(invalid="ignore"):
            sums = self.cells["p95_m"] + data_sheet.CERTAIN * self.cells["std_error_m"]
        return float(sums.max())

    def _place(self) -> str:
        """The area in words: its size around the beacons, or its bounds."""
        grid = self.grid
        (south, north), (west, east) = grid.north, grid.east
        middle = self.beacons.mean(0)
        if np.allclose([south + north, west + east], 2 * middle[:2], atol=1e-6):
            return (
                f"{number(north - south)} m × {number(east - west)} m about {self.reference_point}"
            )
        return (
            f"the area from {number(south)} to {number(north)} m north and from {number(west)} to "
            f"{number(east)} m east"
        )

    @property
    def remarks(self) -> list[str]:
        """Remarks that are needed to read the answer, one line each."""
        return [*self._remarks(verbose=True)]

    def _answers(self) -> Iterator[str]:
        s, found = self.settings, self.summary()
        what = s["error"].replace("_", " ")
        yield (
            f"{self.receiver}: 95 % of the {what} errors within {_range(found['p95_m'])}; "
            f"{_errors(found['std_error_share'])}"
        )
        yield f"possible: within {_range(found['possible_p95_m'])}"
        if self.limit_m is not None:
            yield (
                f"within {meters(self.limit_m)}: {part(found['within_share'])} of the area, "
                f"possible in {part(found['possible_within_share'])}"
            )

    def _remarks(self, verbose: bool) -> Iterator[str]:
        s, found = self.settings, self.summary()
        if not self.data_sheet.startswith("no "):
            yield (
                f"the data-sheet sentence has {meters_at_most(self._bound)} where the largest 95 % "
                f"error of a cell is {meters(found['p95_m'][2])}: it adds two standard errors in "
                "each cell, takes the largest sum and rounds it up"
            )
        if verbose or found["lost_share"]:
            yield (
                f"lost runs: {rough_percent(found['lost_share'])} of {found['runs']:,}; more than "
                f"{percent(MANY_LOST)} in {_cells(found['cells_with_many_lost'])}"
            )
        if found["lost_share"]:
            yield LOST
        if verbose:
            yield from self._method()
        if found["cells_without_accuracy"]:
            yield (
                f"no accuracy is possible in {_cells(found['cells_without_accuracy'])}: "
                f"{why_none(self.scenario)}"
            )
        if found["cells_without_estimate"]:
            yield f"more than 5 % without an estimate in {_cells(found['cells_without_estimate'])}"
        yield from self.failed()
        rows, columns = self.grid.shape
        north, east = self.grid.size
        extra = f", and {found['extra_runs']:,} more near the limit" if found["extra_runs"] else ""
        if verbose:
            yield (
                f"{rows} × {columns} cells of {north:.4g} m × {east:.4g} m at a depth of "
                f"{self.grid.depth:g} m, {s['runs']} runs in each{extra}; neighbours are pooled"
            )
        yield f"the diver {self.motion}; errors count from {s['settling_s']:g} s to "\
              f"{s['duration_s']:g} s"
        yield from self.warned()

    def _method(self) -> Iterator[str]:
        yield (
            "95 %: of the errors of all runs of a cell and its neighbours; each run is represented "
            "by order statistics of its errors: the 5th, 15th … 75th, 81st, 83rd … 99th percentile"
        )
        if self.widened:
            yield (
                f"the colours span {_span(self.colours)}, further than the errors do, so that "
                "noise does not look like a structure"
            )

    def _gist(self) -> str:
        return f"of {self.receiver}, {self.grid.count:,} cells"


def _three(values: pd.Series[float]) -> list[float]:
    """Smallest, median and largest value."""
    if not len(values):
        return [np.nan] * 3
    return [float(values.min()), float(values.median()), float(values.max())]


def _range(three: list[float]) -> str:
    low, middle, high = map(meters, three)
    return f"{low} to {high} (median {middle})"


def _errors(three: list[float]) -> str:
    if not np.isfinite(three[1]):
        return "standard errors unknown"
    return (
        f"standard error {percent(three[1], '.1f')} (median), {percent(three[2], '.1f')} at most"
    )


def part(share: float) -> str:
    """A share of an area, worded so that neither none nor all is hidden by rounding."""
    if share in (0.0, 1.0):
        return "all" if share else "no part"
    if share < 0.01:
        return "less than 1 %"
    return "more than 99 %" if share > 0.99 else whole_percent(share)


def widened(low: float, high: float, least: float) -> tuple[float, float]:
    """Bounds of colours around some values, at least the given distance apart; not below 0."""
    middle = (low + high) / 2
    least = max(least, FLAT * abs(middle))
    if high - low >= least > 0:
        return low, high
    start = max(middle - (least or 1.0) / 2, 0.0)
    return start, start + (least or 1.0)


def _span(bounds: tuple[float, float]) -> str:
    return " to ".join(meters(bound) if bound else "0 m" for bound in bounds)


def _cells(count: int) -> str:
    return counted(count, "cell") if count else "no cell"


def _caption(area: AreaMap) -> str:
    return str(area)


def _data(area: AreaMap) -> tuple[Any, ...]:
    return (area,)


FIGURES: Mapping[str, Figure[AreaMap]] = by_name(
    Figure("map", _figures.later("plot_map"), _data, _caption),
    Figure("map_narrow", _figures.later("plot_narrow"), _data, _caption),
    Figure("certainty", _figures.later("plot_certainty"), _data, _caption,
           condition=lambda area: bool(_figures.uncertain(area))),
)
"""The figures in a map's folder."""
