"""A recorded track: through its points at their times."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ... import track
from ...declaration import Dimension, Variable, parameter
from ...symbols import Symbols, Values, ca
from ..course import TOLERANCE, states, under_way
from ..trajectory import Trajectory

if TYPE_CHECKING:
    from ...equations import Equations

TRACK_POINTS = Dimension(16, "track_points", 2, 4096)
"""Largest number of points of a recorded track."""


def _equations() -> Equations:
    from ...equations import Loop, Row
    from ..motion import equations

    return equations(
        _initial, lambda p, x, t: track.along(x, under_way(p, x, t)),
        leg=Loop("leg", _due, lambda p, x, u, w, t: track.leg(p, x, w),
                 rows=track.rows("track_time", point="track")),
        rows=(
            Row("first", "track", lambda p, x: 0),
            Row("first_time", "track_time", lambda p, x: 0),
            Row("last_time", "track_time", lambda p, x: p.track_count - 1),
        ),
    )


def _initial(p: Symbols, w: Symbols, t: Any) -> Values:
    duration = ca.if_else(w.last_time > 0, p.departure_time + w.last_time, 0)
    return states(p, t, 0, duration=duration, **track.states(w.first, w.first_time))


def _due(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Any:
    return track.due(p, x, under_way(p, x, t) + TOLERANCE)


TRAJECTORY = Trajectory(
    number=9,
    takes=("departure_time",),
    parameters=(
        Variable("track_count", "Number of points of the track in use", "parameter", start=2, min=2,
                 max=TRACK_POINTS, type="Int32"),
        parameter("track_time", "Times of the points of the track from the departure; strictly "
                  "increasing", "s", shape=(TRACK_POINTS,), min=0.0, max=1e9),
        parameter("track", "Points of the track, NED; the diver rests before the first one and "
                  "after the last one", "m", shape=(TRACK_POINTS, 3), min=-1e5, max=1e5),
    ),
    equations=_equations,
    place=8,
)
