"""A recorded track: through its points at their times."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...declaration import Dimension, Variable, parameter
from ...symbols import Symbols, Values, ca
from .. import track
from ..course import TOLERANCE, clip, states, under_way
from ..trajectory import Trajectory

if TYPE_CHECKING:
    from ...equations import Equations, Row

TRACK_POINTS = Dimension(16, "track_points", 2, 4096)
"""Largest number of points of a recorded track."""

LEAST_DURATION = 1e-9
"""Shortest time between two points of a track [s]; only keeps numbers finite."""


def _equations() -> Equations:
    from ...equations import Loop, Row
    from ..motion import equations

    def point(name: str, ahead: int) -> tuple[Row, Row]:
        """Time and position of the point that many after the diver's current one."""

        def index(p: Symbols, x: Symbols) -> Any:
            return x.cursor + ahead

        return Row(f"{name}time", "track_time", index), Row(f"{name}point", "track", index)

    return equations(
        _initial, _along,
        leg=Loop(
            "leg", _due, _leg, rows=(*point("", 0), *point("next_", 1), *point("after_", 2)),
        ),
        rows=(
            Row("first", "track", lambda p, x: 0),
            Row("first_time", "track_time", lambda p, x: 0),
            Row("last_time", "track_time", lambda p, x: p.track_count - 1),
        ),
    )


def _initial(p: Symbols, w: Symbols, t: Any) -> Values:
    duration = ca.if_else(w.last_time > 0, p.departure_time + w.last_time, 0)
    return states(
        p, t, 0, duration=duration, leg_begin=w.first_time, leg_end=w.first_time,
        node_position=w.first, next_position=w.first,
    )


def _along(p: Symbols, x: Symbols, t: Any) -> tuple[Any, Any]:
    """Motion from point to point; node and next are the ends of the current section."""
    duration = ca.fmax(x.leg_end - x.leg_begin, LEAST_DURATION)
    tau = clip((under_way(p, x, t) - x.leg_begin) / duration, 1)
    step = x.next_position - x.node_position
    return track.motion(tau, duration, x.node_position, step, x.node_velocity, x.next_velocity)


def _due(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Any:
    """Whether the diver is at point ``cursor`` (0-based)."""
    arrived = under_way(p, x, t) + TOLERANCE >= x.leg_end
    return ca.logic_and(arrived, x.cursor < p.track_count)


def _leg(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """Motion from point ``cursor`` to the next one; rest after the last one."""
    passing = track.velocity(
        ca, w.next_point - w.point, w.after_point - w.next_point,
        ca.fmax(w.next_time - w.time, LEAST_DURATION),
        ca.fmax(w.after_time - w.next_time, LEAST_DURATION),
    )
    more = x.cursor < p.track_count - 1
    return {
        "cursor": x.cursor + 1,
        "leg_begin": w.time,
        "leg_end": ca.if_else(more, w.next_time, w.time),
        "node_position": w.point,
        "node_velocity": x.next_velocity,
        "next_position": ca.if_else(more, w.next_point, w.point),
        "next_velocity": ca.if_else(x.cursor < p.track_count - 2, passing, 0),
    }


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
