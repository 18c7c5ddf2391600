"""The paper's Extended Kalman Filter (section 3)."""

from __future__ import annotations

from typing import Any

import casadi as ca

from ..equations import Equations, Symbols, Values
from . import kalman
from .estimate import POSITION, STATES, pack, unpack
from .measurements import noise, predicted, samples


def _tick(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any, k: Any) -> Values:
    s = samples(p, x, u)
    update, start, changes = kalman.begin(x, s)
    newest = ca.fmax(s.newest, x.epoch)
    # With nothing to do, an interval of zero and zero gains leave the estimate unchanged.
    mean, P = kalman.predict(
        p, x.mean, unpack(x.covariance, STATES), update * (newest - x.epoch)
    )
    before = mean
    R = noise(p)
    nis = ca.SX(0)
    # R is diagonal: scalar updates one after another, all linearised at the same predicted state,
    # are equivalent to the paper's 5 x 5 form.
    for i, (value, gradient) in enumerate(predicted(before[list(POSITION)], s)):
        h = kalman.sensitivity(gradient)
        innovation = s.z[i] - value - ca.dot(h, mean - before)
        b = P @ h
        weight = update * s.heard[i] / (ca.dot(h, b) + R[i])
        K = b * weight
        nis += weight * innovation**2
        mean = mean + K * innovation
        P = kalman.reduce(P, b, K)
    return {
        **changes,
        "seen": s.mark,
        "epoch": ca.if_else(ca.fmax(update, start), newest, x.epoch),
        "mean": mean,
        "covariance": pack(P),
        "nis": ca.if_else(update, nis, x.nis),
        "nis_degrees": ca.if_else(update, ca.sum1(s.heard), x.nis_degrees),
    }


EQUATIONS = Equations(
    initial=lambda p, w, t: kalman.initial(p, t),
    tick=_tick,
    output=kalman.output,
    iterate=(kalman.initialise(),),
)
