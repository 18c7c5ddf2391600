"""The raw fix: least squares on the latest ranges and depth, the paper's j = 1 of Table 2."""

from __future__ import annotations

from typing import Any

import casadi as ca

from ..equations import Equations, Loop, Symbols, Values
from . import estimate, fix, measurements
from .estimate import expand, expand_covariance, pack, unpack
from .measurements import noise, samples


def _initial(p: Symbols, w: Symbols, t: Any) -> Values:
    return {
        **measurements.initial(t),
        **estimate.initial(t),
        "position": ca.SX.zeros(3),
        "covariance": ca.SX.zeros(6),
        "passes": 0,
        "damping": 0,
    }


def _tick(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any, k: Any) -> Values:
    s = samples(p, x, u)
    update = s.any_new * s.enough
    weight = fix.weights(s, noise(p))
    first = fix.closed_form(s)
    last_is_better = (x.update_count > 0) * (
        fix.cost(x.position, s, weight) < fix.cost(first, s, weight)
    )
    return {
        "seen": s.mark,
        "epoch": ca.if_else(update, s.newest, x.epoch),
        "update_count": x.update_count + update,
        "position": ca.if_else(update * (last_is_better == 0), first, x.position),
        "nis_degrees": ca.if_else(update, fix.degrees(s), x.nis_degrees),
        "passes": fix.PASSES * update,
        "damping": fix.FIRST_DAMPING,
    }


def _improve(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    s = samples(p, x, u)
    result = fix.improve(x.position, x.damping, s, fix.weights(s, noise(p)))
    return {
        "position": result.position,
        "covariance": pack(fix.inverse(result.information)),
        "nis": result.cost,
        "passes": ca.if_else(result.done, 0, x.passes - 1),
        "damping": result.damping,
    }


def _output(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Values:
    return estimate.outputs(x, expand(x.position), expand_covariance(unpack(x.covariance, 3)))


EQUATIONS = Equations(
    initial=_initial,
    tick=_tick,
    output=_output,
    iterate=(Loop("improve", lambda p, x, u, t: x.passes, _improve),),
)
