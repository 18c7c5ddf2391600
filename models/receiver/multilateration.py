"""The raw fix: least squares on the latest ranges and depth, the paper's j = 1 of Table 2.

Between passes, ``position`` is the best so far, with its ``information`` and cost (``nis``);
``step`` is what the next pass tries. ``certainty`` is the weight of a range and that of the depth,
divided once and not in each pass. Nearly all passes are Newton's. The others (``other``) have a
loop of their own: only they need derivatives along their step or at its start.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca

from ..equations import Equations, Loop, Symbols, Values
from . import estimate, least_squares, measurements, minimum
from .estimate import expand, expand_covariance, pack, unpack
from .measurements import DEPTH, Samples, noise, samples


def _initial(p: Symbols, w: Symbols, t: Any) -> Values:
    return {
        **measurements.initial(p, t),
        **estimate.initial(t),
        "position": ca.SX.zeros(3),
        "information": ca.SX.zeros(6),
        "step": ca.SX.zeros(3),
        "certainty": least_squares.reciprocal(noise(p))[[0, DEPTH]],
        "passes": 0,
        "damping": 0,
        "other": 0,
    }


def _tick(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any, k: Any) -> Values:
    s = samples(p, x, u)
    update = s.any_new * s.enough
    weight = _weights(x, s)
    first = minimum.point(least_squares.closed_form(s), s, weight)
    last = minimum.point(x.position, s, weight)
    best = minimum.choose((x.update_count > 0) * (last.cost < first.cost), last, first)
    tangent = minimum.tangent(best, s, weight)
    step = minimum.step(tangent, least_squares.FIRST_DAMPING, fresh=1)
    return {
        "seen": s.mark,
        "epoch": ca.if_else(update, s.newest, x.epoch),
        "update_count": x.update_count + update,
        "nis_degrees": ca.if_else(update, least_squares.degrees(s), x.nis_degrees),
        "position": ca.if_else(update, best.position, x.position),
        "information": ca.if_else(update, pack(tangent.information), x.information),
        "step": step.move,
        "nis": ca.if_else(update, best.cost, x.nis),
        "passes": least_squares.PASSES * update,
        "damping": least_squares.FIRST_DAMPING,
        "other": 0,
    }


def _improve(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """A Newton pass; where Newton's step is not allowed, it asks for a pass of the other kind."""
    tried, there = _at(p, x, u, x.position + x.step)
    better = tried.cost <= x.nis
    newton = better * minimum.is_near(x.step, tried) * minimum.is_safe(there)
    damping = x.damping * _LESS
    after = _after(x, tried, there, minimum.newton(there, damping), damping)
    return {
        **{name: ca.if_else(newton, value, getattr(x, name)) for name, value in after.items()},
        "other": newton == 0,
    }


def _improve_otherwise(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """A pass other than Newton's."""
    tried, there = _at(p, x, u, x.position + x.step)
    _, here = _at(p, x, u, x.position)
    better = tried.cost <= x.nis
    damping = x.damping * ca.if_else(better, _LESS, _MORE)
    best = replace(
        there,
        information=ca.if_else(better, there.information, unpack(x.information, 3)),
        slope=ca.if_else(better, there.slope, here.slope),
    )
    at = minimum.Point(
        ca.if_else(better, tried.position, x.position), tried.lengths,
        ca.if_else(better, tried.cost, x.nis),
    )
    return {**_after(x, at, best, minimum.step(best, damping, better), damping), "other": 0}


_LESS, _MORE = 0.01, 100
"""Factors on the damping after a pass that reduced the cost, and after one that did not."""


def _weights(x: Symbols, s: Samples) -> Any:
    """As `least_squares.weights`, of the same bits."""
    return s.heard * ca.vertcat(ca.repmat(x.certainty[0], s.count, 1), x.certainty[1])


def _at(
    p: Symbols, x: Symbols, u: Symbols, position: Any
) -> tuple[minimum.Point, minimum.Tangent]:
    """How the measurements fit a position."""
    s = samples(p, x, u)
    weight = _weights(x, s)
    point = minimum.point(position, s, weight)
    return point, minimum.tangent(point, s, weight)


def _after(
    x: Symbols, at: minimum.Point, tangent: minimum.Tangent, step: minimum.Step, damping: Any
) -> Values:
    """The states after a pass; the last step reduces the cost by slope' step."""
    gain = ca.if_else(step.last, ca.dot(tangent.slope, step.move), 0)
    return {
        "position": at.position + ca.if_else(step.last, step.move, 0),
        "information": pack(tangent.information),
        "step": step.move,
        "nis": ca.fmax(at.cost - gain, 0),
        "passes": ca.if_else(step.last, 0, x.passes - 1),
        "damping": damping,
    }


def _output(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Values:
    covariance = least_squares.inverse(unpack(x.information, 3))
    return estimate.outputs(
        x, expand(x.position), expand_covariance(ca.if_else(x.update_count > 0, covariance, 0))
    )


EQUATIONS = Equations(
    initial=_initial,
    tick=_tick,
    output=_output,
    iterate=(
        Loop("improve", lambda p, x, u, t: x.passes, _improve,
             (Loop("improve_otherwise", lambda p, x, u, t: x.other, _improve_otherwise),)),
    ),
)
