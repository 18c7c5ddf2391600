"""Building blocks of courses."""

from __future__ import annotations

from typing import Any

from ..symbols import Symbols, Values, ca

TOLERANCE = 2e-9
"""How early a leg may end [s], so that rounding of t has no effect."""

TINY = 1e-300
"""Avoids a zero denominator where the numerator is zero too."""


def under_way(p: Symbols, x: Symbols, t: Any) -> Any:
    """Time since departure [s]; negative before it."""
    return t - x.start - p.departure_time


def clip(value: Any, upper: Any) -> Any:
    """The value, clipped to the interval from 0 to `upper`."""
    return ca.fmin(ca.fmax(value, 0), upper)


def bearing(angle: Any) -> Any:
    """Unit vector, north and east."""
    return ca.vertcat(ca.cos(angle), ca.sin(angle))


def circle(p: Symbols, x: Symbols, s: Any) -> tuple[Any, Any]:
    """A course about the centre that starts at the bearing `heading`; ``course(p, x, s)``."""
    radial = bearing(p.heading + s / p.radius)
    return p.center + p.radius * radial, ca.vertcat(-radial[1], radial[0])


def legs(p: Symbols, x: Symbols, s: Any) -> tuple[Any, Any]:
    """The course along the current leg; ``course(p, x, s)``."""
    return x.leg_point + ca.fmax(s - x.leg_begin, 0) * x.leg_direction, x.leg_direction


def leg_ended(p: Symbols, x: Symbols, t: Any) -> Any:
    """Whether the diver has reached the end of the leg."""
    return clip(x.rate * (under_way(p, x, t) + TOLERANCE), x.length) >= x.leg_end


def states(p: Symbols, t: Any, length: Any, drop: Any = 0, **rest: Any) -> Values:
    """All states at the start; `drop` is the change of depth over the whole `length` [m]."""
    slope = ca.if_else(length > 0, drop / ca.if_else(length > 0, length, 1), 0)
    rate = p.speed / ca.sqrt(1 + slope**2)
    moves = ca.logic_and(rate > 0, length > 0)
    duration = p.departure_time + length / ca.if_else(moves, rate, 1)
    return {
        "start": t,
        "length": length,
        "slope": slope,
        "rate": rate,
        "duration": ca.if_else(moves, duration, 0),
        "cursor": 0,
        "leg_begin": 0,
        "leg_end": 0,
        "leg_point": ca.DM.zeros(3),
        "leg_direction": ca.DM.zeros(3),
        "node_position": ca.DM.zeros(3),
        "node_velocity": ca.DM.zeros(3),
        "next_position": ca.DM.zeros(3),
        "next_velocity": ca.DM.zeros(3),
        "depth": 0,
        "depth_epoch": t,
        "true_depth": 0,
        **rest,
    }


def where(condition: Any, x: Symbols, changes: Values) -> Values:
    """Changes of states that apply if a condition holds."""
    return {name: ca.if_else(condition, value, getattr(x, name)) for name, value in changes.items()}
