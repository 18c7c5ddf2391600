"""What ``sblcosim map --json`` prints, of an area and of distances."""

from __future__ import annotations

from typing import Any, Literal

from ...areas.tables import DISTANCES
from .document import Document, DocumentPart, Number, part_of

DistanceRow: Any = part_of(DISTANCES)


class MapSettings(DocumentPart):
    """What was asked for."""

    area_m: list[float]
    """North from and to, east from and to."""
    depth_m: float
    cells: list[int]
    """Rows and columns."""
    runs: int
    """In each cell, in the first round."""
    error: Literal[
        "absolute_total", "absolute_horizontal", "relative_total", "relative_horizontal"
    ]
    limit_m: Number
    """The requirement; null without one."""
    duration_s: float
    settling_s: float
    radius_m: float
    speed_m_s: float
    seed: int


class MapSummary(DocumentPart):
    """Numbers over all cells; three are the least, the median and the largest."""

    runs: int
    extra_runs: int
    """Of these, near the requirement."""
    p95_m: list[Number]
    std_error_share: list[Number]
    """Standard error of the 95 % error, as a share of it."""
    possible_p95_m: list[Number]
    lost_share: float
    cells_with_many_lost: int
    """With more than 5 % of their runs lost."""
    cells_without_estimate: int
    """Where more than 5 % have no estimate, so that there is no 95 % error."""
    cells_without_accuracy: int
    """Where no accuracy is possible."""
    within_share: Number
    """Share of the cells within the requirement; null without one."""
    possible_within_share: Number


class Map(Document):
    """The 95 % error of a receiver over an area; the cells are in the folder's cells.csv."""

    scenario_name: str
    receiver: str
    settings: MapSettings
    motion: str
    """How the diver moves."""
    summary: MapSummary
    failures: dict[str, int]
    """Messages of runs that have failed, with their number."""
    doubt: str | None
    """Whether the circle turns faster than the receiver allows for; null if not."""
    caveat: str | None
    """Errors that what is possible leaves out, if they matter; null if not."""
    data_sheet: str
    """A sentence for a data sheet, or why there is none."""
    folder: str


class DistanceSettings(DocumentPart):
    """What was asked for."""

    distance_m: list[float]
    """From and to."""
    depth_m: list[float]
    """Of the diver, increasing."""
    cells: int
    """Number of distances."""
    runs: int
    """At each distance and depth."""
    error: Literal[
        "absolute_total", "absolute_horizontal", "relative_total", "relative_horizontal"
    ]
    limit_m: Number
    """The requirement; null without one."""
    duration_s: float
    settling_s: float
    radius_m: float
    speed_m_s: float
    seed: int


class Distances(Document):
    """The error of a receiver against the distance from the platform."""

    scenario_name: str
    receiver: str
    settings: DistanceSettings
    motion: str
    """How the diver moves."""
    data_sheet: list[str]
    """A sentence for each depth, or why there is none."""
    reach_m: list[Number]
    """Up to which distance the requirement is kept, for each depth; null: nowhere, or no
    requirement."""
    possible_reach_m: list[Number]
    """Up to which distance that is possible."""
    distances: list[DistanceRow]
    failures: dict[str, int]
    """Messages of runs that have failed, with their number."""
    doubt: str | None
    """Whether the circle turns faster than the receiver allows for; null if not."""
    caveat: str | None
    """Errors that what is possible leaves out, if they matter; null if not."""
    folder: str
