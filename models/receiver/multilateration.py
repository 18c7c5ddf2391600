"""The raw fix: least squares on the latest ranges and depth, the paper's j = 1 of Table 2.

Between passes, ``position`` is the best so far, with its ``information``, ``slope`` and cost
(``nis``); ``step`` is what the next pass tries.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from ..equations import Equations, Loop, Symbols, Values
from . import estimate, least_squares, measurements, minimum
from .estimate import expand, expand_covariance, pack, unpack
from .measurements import noise, samples


def _initial(p: Symbols, w: Symbols, t: Any) -> Values:
    return {
        **measurements.initial(p, t),
        **estimate.initial(t),
        "position": ca.SX.zeros(3),
        "information": ca.SX.zeros(6),
        "slope": ca.SX.zeros(3),
        "step": ca.SX.zeros(3),
        "passes": 0,
        "damping": 0,
    }


def _tick(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any, k: Any) -> Values:
    s = samples(p, x, u)
    update = s.any_new * s.enough
    weight = least_squares.weights(s, noise(p))
    first = minimum.point(least_squares.closed_form(s), s, weight)
    last = minimum.point(x.position, s, weight)
    best = minimum.choose((x.update_count > 0) * (last.cost < first.cost), last, first)
    tangent = minimum.tangent(best, s, weight)
    step = minimum.step(
        tangent, tangent.information, tangent.slope, least_squares.FIRST_DAMPING, near=0, fresh=1
    )
    return {
        "seen": s.mark,
        "epoch": ca.if_else(update, s.newest, x.epoch),
        "update_count": x.update_count + update,
        "position": ca.if_else(update, best.position, x.position),
        "information": ca.if_else(update, pack(tangent.information), x.information),
        "slope": tangent.slope,
        "step": step.move,
        "nis": ca.if_else(update, best.cost, x.nis),
        "nis_degrees": ca.if_else(update, least_squares.degrees(s), x.nis_degrees),
        "passes": least_squares.PASSES * update,
        "damping": least_squares.FIRST_DAMPING,
    }


def _improve(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    s = samples(p, x, u)
    weight = least_squares.weights(s, noise(p))
    tried = minimum.point(x.position + x.step, s, weight)
    better = tried.cost <= x.nis
    tangent = minimum.tangent(tried, s, weight)
    information = ca.if_else(better, tangent.information, unpack(x.information, 3))
    slope = ca.if_else(better, tangent.slope, x.slope)
    damping = x.damping * ca.if_else(better, 0.01, 100)
    step = minimum.step(
        tangent, information, slope, damping, near=minimum.is_near(x.step, tried), fresh=better
    )
    position = ca.if_else(better, tried.position, x.position)
    cost = ca.if_else(better, tried.cost, x.nis)
    return {
        "position": position + ca.if_else(step.last, step.move, 0),
        "information": pack(information),
        "slope": slope,
        "step": step.move,
        # After the last step, the cost is what it was less slope' step.
        "nis": ca.fmax(cost - ca.if_else(step.last, ca.dot(slope, step.move), 0), 0),
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
    iterate=(Loop("improve", lambda p, x, u, t: x.passes, _improve),),
)
