"""A Kalman filter that uses each sample at its own epoch, once, and recovers from rejections."""

from __future__ import annotations

from typing import Any

import casadi as ca

from ..equations import Equations, Loop, Symbols, Values
from . import kalman, least_squares
from .estimate import POSITION, STATES, pack, unpack
from .measurements import DEPTH, distance, noise, samples

_FORGIVEN = 0.5
"""Amount that a range inside the gate subtracts from the score of rejections. Below 1, because a
filter far off may still accept every second range by chance. Above 0.11, where 10 % outliers add
up."""


def _initial(p: Symbols, w: Symbols, t: Any) -> Values:
    return {**kalman.initial(p, t), "score": 0}


def _tick(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any, k: Any) -> Values:
    s = samples(p, x, u)
    update, start, changes = kalman.begin(x, s)
    return {
        **changes,
        "seen": ca.if_else(x.ready, x.seen, s.mark),
        "epoch": ca.if_else(start, s.newest, x.epoch),
        "nis": ca.if_else(update, 0, x.nis),
        "nis_degrees": ca.if_else(update, 0, x.nis_degrees),
    }


def _unprocessed(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Any:
    return x.ready * samples(p, x, u).any_new


def _process(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    s = samples(p, x, u)
    # The oldest; of equal epochs the depth, so that ranges are linearised at a better state.
    pending = [ca.if_else(s.new[i], s.epoch[i], s.newest + 1) for i in range(s.count + 1)]
    which, epoch = ca.SX(s.count), pending[DEPTH]
    z, beacon = s.z[DEPTH], ca.SX.zeros(1, 3)
    for i in range(s.count):
        older = pending[i] < epoch
        which = ca.if_else(older, i, which)
        epoch = ca.fmin(pending[i], epoch)
        z = ca.if_else(older, s.z[i], z)
        beacon = ca.if_else(older, s.beacons[i, :], beacon)
    is_depth = which == s.count
    epoch = ca.fmax(epoch, x.epoch)

    mean, P = kalman.predict(p, x.mean, unpack(x.covariance, STATES), epoch - x.epoch)
    position = mean[list(POSITION)]
    length, gradient = distance(position, beacon)
    h = kalman.sensitivity(ca.if_else(is_depth, ca.SX([0, 0, 1]), gradient))
    innovation = z - ca.if_else(is_depth, position[2], length)
    R = ca.if_else(is_depth, noise(p)[DEPTH], noise(p)[0])

    b = P @ h
    S = ca.dot(h, b) + R
    outside = (p.gate > 0) * (innovation**2 > p.gate**2 * S) * (is_depth == 0)
    restart = outside * (x.score >= p.gate_limit) * s.enough
    accepted = outside == 0
    weight = accepted / S
    K = b * weight
    return {
        "seen": ca.vertcat(*(
            ca.if_else(ca.fmax(restart, which == i), s.mark[i], x.seen[i])
            for i in range(s.count + 1)
        )),
        "epoch": ca.if_else(restart, s.newest, epoch),
        "mean": mean + K * innovation,
        "covariance": pack(kalman.joseph(P, h, b, K, R)),
        "nis": x.nis + weight * innovation**2,
        "nis_degrees": x.nis_degrees + accepted,
        "score": (restart == 0) * ca.fmax(
            x.score + ca.if_else(is_depth, 0, ca.if_else(outside, 1, -_FORGIVEN)), 0
        ),
        "passes": least_squares.PASSES * restart,
        "damping": least_squares.FIRST_DAMPING,
    }


EQUATIONS = Equations(
    initial=_initial,
    tick=_tick,
    output=kalman.output,
    iterate=(
        Loop("process", _unprocessed, _process),
        kalman.initialise(),
    ),
)
