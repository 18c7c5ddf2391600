"""Straight legs in random directions, inside a box."""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING, Any

from ...declaration import not_zero, parameter
from ...symbols import Symbols, Values, ca
from ..course import bearing, leg_ended, legs, states, where
from ..trajectory import HORIZONTAL, Trajectory

if TYPE_CHECKING:
    from ...equations import Equations


def _equations() -> Equations:
    from ...equations import Loop
    from ..motion import at_constant_speed, equations

    return equations(_initial, at_constant_speed(legs), leg=Loop("leg", _due, _leg))


def _initial(p: Symbols, w: Symbols, t: Any) -> Values:
    first = p.center + p.box * (2.0**-52 * w.first_position - 1)
    return states(p, t, p.path_length, p.depth_end - p.depth_start,
                   leg_point=ca.vertcat(first, p.depth_start))


def _due(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Any:
    return ca.logic_and(leg_ended(p, x, t), x.leg_end < x.length)


def _leg(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """One attempt at the next leg, accepted only if it ends inside the box."""
    span = -p.leg_length * ca.log((w.attempt[0] + 1) * 2.0**-53)
    direction = bearing(2 * pi * 2.0**-53 * w.attempt[1])
    begin = x.leg_point + (x.leg_end - x.leg_begin) * x.leg_direction
    end = begin[:2] + span * direction
    inside = ca.logic_and(*ca.vertsplit(ca.fabs(end - p.center) <= p.box))
    return where(inside, x, {
        "leg_begin": x.leg_end,
        "leg_end": x.leg_end + span,
        "leg_point": ca.vertcat(begin[:2], p.depth_start + x.slope * x.leg_end),
        "leg_direction": ca.vertcat(direction, x.slope),
    })


TRAJECTORY = Trajectory(
    number=6,
    takes=HORIZONTAL,
    parameters=(
        parameter("path_length", "Horizontal length of straight line and random path",
                  "m", start=150.0, min=0.0, max=1e6, needs=(not_zero("speed"),)),
        parameter("leg_length", "Mean length of a leg of the random path (exponential)", "m",
                  start=8.0, min=0.01, max=1e5, needs=(not_zero("speed"),)),
        parameter("box", "Half the width of the box that holds the random path, north and east",
                  "m", shape=(2,), start=25.0, min=0.1, max=1e5),
    ),
    equations=_equations,
    random="always",
)
