"""Output of ``sblcosim map --json``, for an area and for distances."""

from __future__ import annotations

from typing import Any, Literal

from ...areas.tables import DISTANCES
from .document import Document, DocumentPart, Number, part_of

DistanceRow: Any = part_of(DISTANCES)


class _Settings(DocumentPart):
    """The arguments that both maps take."""

    error: Literal[
        "absolute_total", "absolute_horizontal", "relative_total", "relative_horizontal"
    ]
    limit_m: Number
    """The requirement; null if there is none."""
    duration_s: float
    settling_s: float
    radius_m: float
    speed_m_s: float
    seed: int


class MapSettings(_Settings):
    """The arguments."""

    area_m: list[float]
    """North from and to, east from and to."""
    depth_m: float
    cells: list[int]
    """Rows and columns."""
    runs: int
    """Runs in each cell, in the first round."""


class MapSummary(DocumentPart):
    """Numbers over all cells; three numbers are the smallest, the median and the largest."""

    runs: int
    extra_runs: int
    """Number of these that were added near the requirement."""
    p95_m: list[Number]
    std_error_share: list[Number]
    """Relative standard error of the 95 % error."""
    possible_p95_m: list[Number]
    lost_share: float
    cells_with_many_lost: int
    """Number of cells with more than 5 % of their runs lost."""
    cells_without_estimate: int
    """Number of cells without a 95 % error, as more than 5 % of the runs have no estimate."""
    cells_without_accuracy: int
    """Number of cells where no accuracy is possible."""
    within_share: Number
    """Share of the cells within the requirement; null if there is none."""
    possible_within_share: Number


class _OverPlaces(Document):
    """What both maps say."""

    scenario_name: str
    receiver: str
    motion: str
    """How the diver moves."""
    failures: dict[str, int]
    """Messages of failed runs, with their number."""
    doubt: str | None
    """Set if the circle turns faster than the receiver allows for, in words; else null."""
    caveat: str | None
    """Errors that the possible error leaves out, if they matter; else null."""
    folder: str


class Map(_OverPlaces):
    """The 95 % error of a receiver over an area; the cells are in the folder's cells.csv."""

    settings: MapSettings
    summary: MapSummary
    data_sheet: str
    """A sentence for a data sheet, or why there is none."""


class DistanceSettings(_Settings):
    """The arguments."""

    distance_m: list[float]
    """From and to."""
    depth_m: list[float]
    """Depths of the diver, increasing."""
    cells: int
    """Number of distances."""
    runs: int
    """Runs at each distance and depth."""


class Distances(_OverPlaces):
    """The error of a receiver against the distance from the platform."""

    settings: DistanceSettings
    data_sheet: list[str]
    """A sentence for each depth, or why there is none."""
    reach_m: list[Number]
    """Up to which distance the requirement is kept, for each depth; null: nowhere, or no
    requirement."""
    possible_reach_m: list[Number]
    """Up to which distance it can be kept."""
    distances: list[DistanceRow]
