"""Paths on Earth: latitudes and longitudes, in parts that do not cross the antimeridian."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from itertools import pairwise

import numpy as np
from sblcosim.fmus.host.nanoseconds import SECOND

from ..data.estimates import Floats, Integers
from ..tracks.place import Origin
from .diver_path import DiverPath, Kind

MOST_POINTS = 10_000
"""Most points of a path. Longer paths are written at every second instant, every third, etc."""
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
"""Time 0 in files that need clock times, if the start is not known."""


@dataclass(frozen=True, eq=False)
class EarthPath:
    """The known points of a path, at most `MOST_POINTS`.

    Attributes
    ----------
    time_ns
        [ns]; shape (n,).
    latitude, longitude
        On WGS 84 [°]; shape (n,).
    depth
        [m]; shape (n,).
    """

    name: str
    kind: Kind
    time_ns: Integers
    latitude: Floats
    longitude: Floats
    depth: Floats

    @property
    def time_s(self) -> Floats:
        """Times [s]; shape (n,)."""
        seconds: Floats = self.time_ns / SECOND
        return seconds

    def parts(self) -> list[slice]:
        """The points between crossings of the antimeridian; at least one part."""
        crossings = np.flatnonzero(np.abs(np.diff(self.longitude)) > 180.0) + 1
        ends = [0, *crossings.tolist(), len(self.longitude)]
        return [slice(start, stop) for start, stop in pairwise(ends)]


def on_earth(path: DiverPath, origin: Origin) -> EarthPath:
    """The known points of a path on Earth."""
    known = path.known()
    every = max(1, -(-len(known) // MOST_POINTS))
    latitude, longitude, depth = origin.geographic(known.position[::every]).T
    return EarthPath(path.name, path.kind, known.time_ns[::every], latitude, longitude, depth)


def beginning(start: datetime | None, dated: bool, zero: str = "Time 0 is") -> str:
    """What times mean, in words.

    Parameters
    ----------
    dated
        Whether times are since 1970, as in the log of a device.
    zero
        Words before the clock time of time 0.
    """
    if dated:
        return "Times are those of the log"
    return f"{zero} {(start or EPOCH).isoformat()}"


def instant(start: datetime | None, time_s: float) -> datetime:
    """Clock time of a point, to the microsecond."""
    return (start or EPOCH) + timedelta(seconds=time_s)
