"""From courses to equations: motion at constant speed, its states, and the depth sensor.

The paper's section 5 defines its paths "in the discrete domain, each point sampled with T". Here a
path is a function of time, so it does not depend on a sampling time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca

from ..equations import Draw, Equations, Loop, Row, Symbols, Values
from .course import TOLERANCE, clip, states, under_way
from .trajectories import FOUND
from .trajectory import Course

DRAWS = (
    Draw("first_position", "uniform", "initial", 2),
    Draw("first_motion", "normal", "initial", 6),
    Draw("attempt", "uniform", "leg", 2),
    Draw("kick", "normal", "node", 6),
    Draw("depth", "normal", "tick", 1, ("depth_std",)),
    Draw("depth_bias", "normal", "initial", 1, ("depth_bias_std",)),
    *(draw for it in FOUND.values() for draw in it.draws),
)


def _distance(p: Symbols, x: Symbols, t: Any) -> Any:
    """Distance covered s(t) [m]; horizontal, except on waypoints."""
    return clip(x.rate * under_way(p, x, t), x.length)


def at_constant_speed(course: Course) -> Callable[[Symbols, Symbols, Any], tuple[Any, Any]]:
    """Motion at constant speed along a course, at rest before and after: position and velocity."""

    def motion(p: Symbols, x: Symbols, t: Any) -> tuple[Any, Any]:
        point, tangent = course(p, x, _distance(p, x, t))
        since = under_way(p, x, t) + TOLERANCE
        moving = ca.logic_and(since >= 0, x.rate * since < x.length)
        return point, ca.if_else(moving, x.rate, 0) * tangent

    return motion


def _descending(horizontal: Course) -> Course:
    """Add a depth that is linear in the distance covered to a horizontal course."""

    def course(p: Symbols, x: Symbols, s: Any) -> tuple[Any, Any]:
        point, tangent = horizontal(p, x, s)
        return (
            ca.vertcat(point, p.depth_start + x.slope * s),
            ca.vertcat(tangent, x.slope),
        )

    return course


def _never(name: str) -> Loop:
    return Loop(name, lambda p, x, u, t: 0, lambda p, x, u, w, t: {})


def equations(
    initial: Callable[[Symbols, Symbols, Any], Values],
    motion: Callable[[Symbols, Symbols, Any], tuple[Any, Any]],
    leg: Loop = _never("leg"),  # noqa: B008
    node: Loop = _never("node"),  # noqa: B008
    rows: Sequence[Row] = (),
) -> Equations:
    """Equations of a motion: ``motion(p, x, t)`` gives its position [m] and velocity [m/s]."""

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


def horizontal(course: Course, length: Callable[[Symbols], Any]) -> Equations:
    """Equations of a course at constant speed, with a depth that changes linearly."""

    def initial(p: Symbols, w: Symbols, t: Any) -> Values:
        return states(p, t, length(p), p.depth_end - p.depth_start)

    return equations(initial, at_constant_speed(_descending(course)))
