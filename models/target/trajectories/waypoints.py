"""Straight legs from waypoint to waypoint."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...declaration import Variable, not_zero, parameter
from ...symbols import Symbols, Values, ca
from ..course import TINY, leg_ended, legs, states
from ..trajectory import Trajectory

if TYPE_CHECKING:
    from ...equations import Equations

WAYPOINTS = 64


def _equations() -> Equations:
    from ...equations import Loop
    from ..motion import at_constant_speed, equations

    return equations(_initial, at_constant_speed(legs), leg=Loop("leg", _due, _leg))


def _initial(p: Symbols, w: Symbols, t: Any) -> Values:
    return states(p, t, _length(p), leg_point=p.waypoint[0, :].T)


def _due(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Any:
    return ca.logic_and(leg_ended(p, x, t), x.cursor < p.waypoint_count - 1)


def _leg(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """The leg from waypoint ``cursor`` (0-based) to the next one."""
    begin, end = (_waypoint(p, x.cursor + i) for i in (0, 1))
    span = ca.norm_2(end - begin)
    return {
        "cursor": x.cursor + 1,
        "leg_begin": x.leg_end,
        "leg_end": x.leg_end + span,
        "leg_point": begin,
        "leg_direction": (end - begin) / ca.fmax(span, TINY),
    }


def _waypoint(p: Symbols, index: Any) -> Any:
    chosen: Any = 0
    for i in range(WAYPOINTS):
        chosen = chosen + ca.if_else(index == i, p.waypoint[i, :].T, 0)
    return chosen


def _length(p: Symbols) -> Any:
    length: Any = 0
    for i in range(1, WAYPOINTS):
        span = ca.norm_2((p.waypoint[i, :] - p.waypoint[i - 1, :]).T)
        length = length + ca.if_else(i < p.waypoint_count, span, 0)
    return length


TRAJECTORY = Trajectory(
    number=7,
    takes=("speed", "departure_time"),
    parameters=(
        Variable("waypoint_count", "Number of waypoints in use", "parameter", start=2, min=2,
                 max=WAYPOINTS, type="Int32", needs=(not_zero("speed"),)),
        parameter("waypoint", "Waypoints, NED", "m", shape=(WAYPOINTS, 3), min=-1e5, max=1e5),
    ),
    equations=_equations,
)
