"""A track as it was recorded."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from .place import Floats, Origin

Where = Callable[[int, int], str]
"""``where(point, coordinate)``: file, line and column of a number, for messages; coordinate 0 is
the time."""
FARTHEST = 1e5
"""Largest coordinate of a point [m]."""
LEAST, LONGEST = 1e-6, 1e9
"""Least time between two points, and most between the first and the last one [s]."""
MOST_POINTS = 200_000
"""Most points of a file: more take too long to choose from."""


@dataclass(frozen=True, slots=True)
class Recorded:
    """A track as it is in a file.

    Attributes
    ----------
    name
        Of the file, for messages.
    times
        From the first point [s], ascending.
    points
        Rows of north, east, down [m], or of latitude [°], longitude [°], depth [m].
    geographic
        Whether it is the latter.
    where
        Where in the file each number is.
    left_out
        Names of other tracks in the file, which are not part of this one.
    """

    name: str
    times: Floats
    points: Floats
    geographic: bool
    where: Where
    left_out: tuple[str, ...] = ()

    def origin(self) -> Origin | None:
        """The origin that the track brings: its first point, at the surface."""
        if not self.geographic:
            return None
        latitude, longitude, _ = self.points[0].tolist()
        return Origin(latitude, longitude)
