"""A track as it was recorded."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from .place import Floats, Origin

Where = Callable[[int, int], str]
"""``where(point, coordinate)`` gives file, line and column of a number, for messages; coordinate 0
is the time."""
FARTHEST = 1e5
"""Largest coordinate of a point [m]."""
LEAST, LONGEST = 1e-6, 1e9
"""Smallest time between two points, and largest between the first and the last one [s]."""
MOST_POINTS = 200_000
"""Largest number of points of a file; choosing from more takes too long."""


@dataclass(frozen=True, slots=True)
class Recorded:
    """A track as it is in a file.

    Attributes
    ----------
    name
        Name of the file, for messages.
    times
        Times since the first point [s], ascending.
    points
        Rows of north, east, down [m], or of latitude [°], longitude [°], depth [m].
    geographic
        Whether the points are geographic, the second of these.
    where
        Function that gives the place of a number in the file.
    left_out
        Names of other tracks in the file, which are not part of this one.
    headings
        Headings of a boat at the points, from true north [°]; None: not recorded.
    """

    name: str
    times: Floats
    points: Floats
    geographic: bool
    where: Where
    left_out: tuple[str, ...] = ()
    headings: Floats | None = None

    def origin(self) -> Origin | None:
        """The origin of a geographic track: its first point, at the surface."""
        if not self.geographic:
            return None
        latitude, longitude, _ = self.points[0].tolist()
        return Origin(latitude, longitude)
