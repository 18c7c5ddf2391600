"""Equations of the Target: paths in closed form, and the depth sensor.

The paper's section 5 defines its paths "in the discrete domain, each point sampled with T". Here a
path is a function of time, so it does not depend on a sampling time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import pi, sqrt
from typing import Any

import casadi as ca

from ..equations import Draw, Equations, Loop, Row, Symbols, Values
from . import track
from .variables import TRAJECTORIES, WAYPOINTS

TOLERANCE = 2e-9
"""Time by which a change of leg may come early [s], so that rounding of t has no effect."""

TINY = 1e-300
"""Avoids a zero denominator where the numerator is zero too."""

LEAST_DURATION = 1e-9
"""Between two points of a track [s]; it only keeps numbers finite."""

HALLEY_STEPS = 3

Course = Callable[[Symbols, Symbols, Any], tuple[Any, Any]]
"""``course(p, x, s)``: point at the distance `s` [m], and its derivative with respect to `s`."""

DRAWS = (
    Draw("first_position", "uniform", "initial", 2),
    Draw("first_motion", "normal", "initial", 6),
    Draw("attempt", "uniform", "leg", 2),
    Draw("kick", "normal", "node", 6),
    Draw("depth", "normal", "tick", 1, ("depth_std",)),
    Draw("depth_bias", "normal", "initial", 1, ("depth_bias_std",)),
)


# Distance covered --------------------------------------------------------------------------------


def _under_way(p: Symbols, x: Symbols, t: Any) -> Any:
    """Time since departure [s]; negative before it."""
    return t - x.start - p.departure_time


def _distance(p: Symbols, x: Symbols, t: Any) -> Any:
    """Distance covered s(t) [m]; horizontal, except on waypoints."""
    return _clip(x.rate * _under_way(p, x, t), x.length)


def _clip(value: Any, upper: Any) -> Any:
    return ca.fmin(ca.fmax(value, 0), upper)


def _motion(course: Course) -> Callable[[Symbols, Symbols, Any], tuple[Any, Any]]:
    """Motion at constant speed along a course, at rest before and after: position and velocity."""

    def motion(p: Symbols, x: Symbols, t: Any) -> tuple[Any, Any]:
        point, tangent = course(p, x, _distance(p, x, t))
        since = _under_way(p, x, t) + TOLERANCE
        moving = ca.logic_and(since >= 0, x.rate * since < x.length)
        return point, ca.if_else(moving, x.rate, 0) * tangent

    return motion


# Horizontal courses ------------------------------------------------------------------------------


def _bearing(angle: Any) -> Any:
    return ca.vertcat(ca.cos(angle), ca.sin(angle))


def _descending(horizontal: Course) -> Course:
    """Add to a horizontal course a depth that is linear in the distance covered."""

    def course(p: Symbols, x: Symbols, s: Any) -> tuple[Any, Any]:
        point, tangent = horizontal(p, x, s)
        return (
            ca.vertcat(point, p.depth_start + x.slope * s),
            ca.vertcat(tangent, x.slope),
        )

    return course


def _straight_line(p: Symbols, x: Symbols, s: Any) -> tuple[Any, Any]:
    direction = _bearing(p.heading)
    return p.center + s * direction, direction


def _circle(p: Symbols, x: Symbols, s: Any) -> tuple[Any, Any]:
    radial = _bearing(p.heading + s / p.radius)
    return p.center + p.radius * radial, ca.vertcat(-radial[1], radial[0])


def _square(p: Symbols, x: Symbols, s: Any) -> tuple[Any, Any]:
    def gone(side: int) -> Any:
        return _clip(s - side * p.side, p.side)

    side = ca.fmin(ca.floor((s + x.rate * TOLERANCE) / p.side), 3)
    ahead, right = _bearing(p.heading), _bearing(p.heading + pi / 2)
    point = (
        p.center
        + (gone(0) - gone(2) - p.side / 2) * ahead
        + (gone(1) - gone(3) - p.side / 2) * right
    )
    return point, ((side == 0) - (side == 2)) * ahead + ((side == 1) - (side == 3)) * right


def _spiral_rate(p: Symbols) -> Any:
    """b in r = a + b θ [m/rad]."""
    return (p.spiral_radius[1] - p.spiral_radius[0]) / (2 * pi * p.turns)


def _spiral_arc(p: Symbols, angle: Any) -> Any:
    """Arc length of the Archimedean spiral from 0 to `angle` [m].

    The integral of √(r² + b²) dθ is (F(r) − F(a)) / b with F(r) = ½ (r q + b² ln(r + q)) and
    q = √(r² + b²). Written without that division, it also holds for b = 0 (a circle).
    """
    a, b = p.spiral_radius[0], _spiral_rate(p)
    r = a + b * angle
    q_a, q_r = ca.sqrt(a**2 + b**2), ca.sqrt(r**2 + b**2)
    chord = angle * (r + a) * (r**2 + a**2 + b**2) / ca.fmax(r * q_r + a * q_a, TINY)
    return (chord + b * ca.log((r + q_r + TINY) / (a + q_a + TINY))) / 2


def _spiral_angle(p: Symbols, s: Any) -> Any:
    """Angle at which the arc length is `s` [rad]."""
    a, b = p.spiral_radius[0], _spiral_rate(p)

    def derivative(r: Any) -> Any:
        return ca.sqrt(r**2 + b**2)

    # s ≈ (r² − a²) / 2b gives r. Simpson's mean of √(r² + b²) from a to r then gives the angle
    # to within 16 %. Each Halley step triples the number of correct digits.
    r = ca.sqrt(ca.fmax(a**2 + 2 * b * s, 0))
    angle = 6 * s / ca.fmax(derivative(a) + 4 * derivative((a + r) / 2) + derivative(r), TINY)
    for _ in range(HALLEY_STEPS):
        excess = _spiral_arc(p, angle) - s
        r = a + b * angle
        q = ca.fmax(derivative(r), TINY)
        angle -= 2 * excess * q / ca.fmax(2 * q**2 - excess * r * b / q, TINY)
    return angle


def _spiral(p: Symbols, x: Symbols, s: Any) -> tuple[Any, Any]:
    b = _spiral_rate(p)
    angle = _spiral_angle(p, s)
    r = p.spiral_radius[0] + b * angle
    radial = _bearing(p.heading + angle)
    across = ca.vertcat(-radial[1], radial[0])
    q = ca.fmax(ca.sqrt(r**2 + b**2), TINY)
    return p.center + r * radial, (b * radial + r * across) / q


# Courses of straight legs ------------------------------------------------------------------------


def _legs(p: Symbols, x: Symbols, s: Any) -> tuple[Any, Any]:
    return x.leg_point + ca.fmax(s - x.leg_begin, 0) * x.leg_direction, x.leg_direction


def _leg_ended(p: Symbols, x: Symbols, t: Any) -> Any:
    return _clip(x.rate * (_under_way(p, x, t) + TOLERANCE), x.length) >= x.leg_end


def _random_leg_due(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Any:
    return ca.logic_and(_leg_ended(p, x, t), x.leg_end < x.length)


def _random_leg(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """One attempt at the next leg; it is accepted only if the leg ends inside the box."""
    span = -p.leg_length * ca.log((w.attempt[0] + 1) * 2.0**-53)
    direction = _bearing(2 * pi * 2.0**-53 * w.attempt[1])
    begin = x.leg_point + (x.leg_end - x.leg_begin) * x.leg_direction
    end = begin[:2] + span * direction
    inside = ca.logic_and(*ca.vertsplit(ca.fabs(end - p.center) <= p.box))
    return _if(inside, x, {
        "leg_begin": x.leg_end,
        "leg_end": x.leg_end + span,
        "leg_point": ca.vertcat(begin[:2], p.depth_start + x.slope * x.leg_end),
        "leg_direction": ca.vertcat(direction, x.slope),
    })


def _waypoint_due(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Any:
    return ca.logic_and(_leg_ended(p, x, t), x.cursor < p.waypoint_count - 1)


def _waypoint_leg(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
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


def _waypoints_length(p: Symbols) -> Any:
    length: Any = 0
    for i in range(1, WAYPOINTS):
        span = ca.norm_2((p.waypoint[i, :] - p.waypoint[i - 1, :]).T)
        length = length + ca.if_else(i < p.waypoint_count, span, 0)
    return length


# Motion driven by white noise acceleration -------------------------------------------------------


def _node_due(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Any:
    """Whether `t` has reached the end of the current interval, node ``cursor + 1``."""
    return t - x.start + TOLERANCE >= (x.cursor + 1) * p.sampling_time


def _node(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """Draw the node after the next, with Φ and Q of white acceleration of power spectral density q.

    Q = q [[T³/3, T²/2], [T²/2, T]] = L Lᵀ with L = √(q T) [[T/√3, 0], [√3/2, 1/2]].
    """
    T = p.sampling_time
    scale = ca.sqrt(p.acceleration_psd * T)
    along, rest = w.kick[:3], w.kick[3:]
    return {
        "cursor": x.cursor + 1,
        "node_position": x.next_position,
        "node_velocity": x.next_velocity,
        "next_position": x.next_position + T * x.next_velocity + scale * T / sqrt(3) * along,
        "next_velocity": x.next_velocity + scale * (sqrt(3) / 2 * along + rest / 2),
    }


def _between_nodes(p: Symbols, x: Symbols, t: Any) -> tuple[Any, Any]:
    """Cubic Hermite interpolation: the mean of the process given its nodes."""
    T = p.sampling_time
    tau = _clip((t - x.start - x.cursor * T) / T, 1)
    step = x.next_position - x.node_position
    first, second = T * x.node_velocity, T * x.next_velocity
    quadratic = 3 * step - 2 * first - second
    cubic = first + second - 2 * step
    position = x.node_position + tau * (first + tau * (quadratic + tau * cubic))
    return position, (first + tau * (2 * quadratic + 3 * tau * cubic)) / T


# A recorded track --------------------------------------------------------------------------------


def _along_track(p: Symbols, x: Symbols, t: Any) -> tuple[Any, Any]:
    """Motion from point to point; node and next are the ends of what is being travelled."""
    duration = ca.fmax(x.leg_end - x.leg_begin, LEAST_DURATION)
    tau = _clip((_under_way(p, x, t) - x.leg_begin) / duration, 1)
    step = x.next_position - x.node_position
    return track.motion(tau, duration, x.node_position, step, x.node_velocity, x.next_velocity)


def _track_due(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Any:
    """Whether the diver is at point ``cursor`` (0-based)."""
    arrived = _under_way(p, x, t) + TOLERANCE >= x.leg_end
    return ca.logic_and(arrived, x.cursor < p.track_count)


def _track_leg(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """From point ``cursor`` to the next one; after the last one there is rest."""
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


def _point(name: str, ahead: int) -> tuple[Row, Row]:
    """Time and place of a point, so many after the one where the diver is."""

    def index(p: Symbols, x: Symbols) -> Any:
        return x.cursor + ahead

    return Row(f"{name}time", "track_time", index), Row(f"{name}point", "track", index)


# States, outputs and variants --------------------------------------------------------------------


def _states(p: Symbols, t: Any, length: Any, drop: Any = 0, **rest: Any) -> Values:
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


def _if(condition: Any, x: Symbols, changes: Values) -> Values:
    return {name: ca.if_else(condition, value, getattr(x, name)) for name, value in changes.items()}


def _never(name: str) -> Loop:
    return Loop(name, lambda p, x, u, t: 0, lambda p, x, u, w, t: {})


def _equations(
    initial: Callable[[Symbols, Symbols, Any], Values],
    motion: Callable[[Symbols, Symbols, Any], tuple[Any, Any]],
    leg: Loop = _never("leg"),  # noqa: B008
    node: Loop = _never("node"),  # noqa: B008
    rows: Sequence[Row] = (),
) -> Equations:
    def start(p: Symbols, w: Symbols, t: Any) -> Values:
        bias = p.depth_bias + p.depth_bias_std * w.depth_bias
        return {**initial(p, w, t), "depth_bias": bias}

    def output(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Values:
        position, velocity = motion(p, x, t)
        return {
            "position": position,
            "velocity": velocity,
            "depth": x.depth,
            "depth_epoch": x.depth_epoch,
            "true_depth": x.true_depth,
            "path_duration": x.duration,
        }

    def tick(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any, k: Any) -> Values:
        true_depth = motion(p, x, t)[0][2]
        return {
            "true_depth": true_depth,
            "depth": true_depth + x.depth_bias + p.depth_std * w.depth,
            "depth_epoch": t,
        }

    return Equations(output, start, tick, advance=(leg, node), draws=DRAWS, rows=rows)


def _horizontal(course: Course, length: Callable[[Symbols], Any]) -> Equations:
    def initial(p: Symbols, w: Symbols, t: Any) -> Values:
        return _states(p, t, length(p), p.depth_end - p.depth_start)

    return _equations(initial, _motion(_descending(course)))


def _random_path_initial(p: Symbols, w: Symbols, t: Any) -> Values:
    first = p.center + p.box * (2.0**-52 * w.first_position - 1)
    return _states(p, t, p.path_length, p.depth_end - p.depth_start,
                   leg_point=ca.vertcat(first, p.depth_start))


def _waypoints_initial(p: Symbols, w: Symbols, t: Any) -> Values:
    return _states(p, t, _waypoints_length(p), leg_point=p.waypoint[0, :].T)


def _white_noise_initial(p: Symbols, w: Symbols, t: Any) -> Values:
    # Begin one interval early, so that the loop draws the first two nodes like all others.
    return _states(
        p, t, 0, cursor=-1,
        next_position=p.initial_position + p.initial_position_std * w.first_motion[:3],
        next_velocity=p.initial_velocity + p.initial_velocity_std * w.first_motion[3:],
    )


def _track_initial(p: Symbols, w: Symbols, t: Any) -> Values:
    duration = ca.if_else(w.last_time > 0, p.departure_time + w.last_time, 0)
    return _states(
        p, t, 0, duration=duration, leg_begin=w.first_time, leg_end=w.first_time,
        node_position=w.first, next_position=w.first,
    )


_BY_NAME = {
    "straight_line": _horizontal(_straight_line, lambda p: p.path_length),
    "semicircle": _horizontal(_circle, lambda p: pi * p.radius),
    "circle": _horizontal(_circle, lambda p: 2 * pi * p.turns * p.radius),
    "square": _horizontal(_square, lambda p: 4 * p.side),
    "spiral": _horizontal(_spiral, lambda p: _spiral_arc(p, 2 * pi * p.turns)),
    "random_path": _equations(
        _random_path_initial, _motion(_legs), leg=Loop("leg", _random_leg_due, _random_leg)
    ),
    "waypoints": _equations(
        _waypoints_initial, _motion(_legs), leg=Loop("leg", _waypoint_due, _waypoint_leg)
    ),
    "white_noise_acceleration": _equations(
        _white_noise_initial, _between_nodes, node=Loop("node", _node_due, _node)
    ),
    "file": _equations(
        _track_initial, _along_track,
        leg=Loop(
            "leg", _track_due, _track_leg,
            rows=(*_point("", 0), *_point("next_", 1), *_point("after_", 2)),
        ),
        rows=(
            Row("first", "track", lambda p, x: 0),
            Row("first_time", "track_time", lambda p, x: 0),
            Row("last_time", "track_time", lambda p, x: p.track_count - 1),
        ),
    ),
}

EQUATIONS: Mapping[int, Equations] = {
    value: _BY_NAME[name] for value, name in TRAJECTORIES.items()
}
