"""How `coupled` starts, and starts anew: a fix from the latest receptions alone.

The platform is where the filter has it, the diver unknown. The clock's offset is estimated with
its prior, which is eliminated from the equations: with weights w, residuals e and its information
1/σ_B², it is Σwe / W with W = Σw + 1/σ_B².
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca

from ..equations import Loop, Symbols, Values
from ..ports import BEACONS
from . import least_squares
from .estimate import pack, unpack
from .least_squares import adjugate, reciprocal, symmetric
from .measurements import DEPTH, Samples, distance, with_beacons
from .surroundings import (
    CLOCK,
    DEPTH_BIAS,
    HEADING,
    PLATFORM,
    PLATFORM_VELOCITY,
    POSITION,
    SPEED,
    STATES,
    VELOCITY,
)

_FAR_STD = 30.0
"""Of the diver about the platform, north and east [m], where ranges say nothing."""


def anew() -> Loop:
    """The loop that makes a state of the diver from the latest receptions."""
    return Loop("anew", lambda p, x, u, t: x.passes, _pass)


def _placed(p: Symbols, x: Symbols, u: Symbols) -> Samples:
    """The samples, with the beacons where the filter has them at each epoch."""
    s = with_beacons(x, u, u.ping_beacon_position)
    c, sn = ca.cos(x.mean[HEADING]), ca.sin(x.mean[HEADING])
    rows = []
    for i in range(BEACONS):
        age = s.newest - s.epoch[i]
        arm = x.arm[i, :]
        rows.append(ca.horzcat(
            x.mean[PLATFORM[0]] - age * x.mean[PLATFORM_VELOCITY[0]] + c * arm[0] - sn * arm[1],
            x.mean[PLATFORM[1]] - age * x.mean[PLATFORM_VELOCITY[1]] + sn * arm[0] + c * arm[1],
            x.platform_down + arm[2],
        ))
    return replace(s, beacons=ca.vertcat(*rows))


def _fit(
    position: Any, platform: Any, s: Samples, weight: Any, prior: Any
) -> tuple[Any, Any, Any, Any, Any]:
    """Linearise the fix at a position.

    Parameters
    ----------
    platform
        Its position, (3, 1) [m].
    prior
        Information on the clock [1/m²].

    Returns
    -------
    information, slope, cost, clock, lean
        Normal equations of the position; weighted sum of squared residuals; the clock's offset [m]
        and its derivative with respect to the position, negative, (3, 1).
    """
    total = ca.sum1(weight[:BEACONS]) + prior
    information, slope = ca.SX.zeros(3, 3), ca.SX.zeros(3)
    cost, first, lean = ca.SX(0), ca.SX(0), ca.SX.zeros(3)
    for i in range(BEACONS):
        length, gradient = distance(position, s.beacons[i, :])
        residual = s.z[i] - length
        information += weight[i] * gradient @ gradient.T
        slope += weight[i] * residual * gradient
        cost += weight[i] * residual**2
        first += weight[i] * residual
        lean += weight[i] * gradient
    residual = s.z[DEPTH] - position[2]
    information[2, 2] += weight[DEPTH]
    slope[2] += weight[DEPTH] * residual
    cost += weight[DEPTH] * residual**2
    share = reciprocal(total)
    near = ca.SX([1, 1, 0]) / _FAR_STD**2
    off = position - platform
    return (
        symmetric(information - share * (lean @ lean.T) + ca.diag(near)),
        slope - share * first * lean - near * off,
        cost - share * first**2 + ca.dot(near, off**2), share * first, share * lean,
    )


def _pass(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    s = _placed(p, x, u)
    begins = x.passes == least_squares.PASSES
    position = ca.if_else(begins, least_squares.closed_form(s), x.mean[list(POSITION)])
    platform = ca.vertcat(x.mean[list(PLATFORM)], x.platform_down)
    length = distance(position, platform.T)[0]
    prior = reciprocal(p.clock_std**2 + (p.sound_speed_std * length) ** 2 + 1e-6)
    motion = p.prior_velocity_std * (s.newest - s.epoch)
    variances = ca.vertcat(
        ca.repmat(p.range_std**2, BEACONS, 1), p.depth_std**2 + p.depth_bias_std**2
    )
    weight = least_squares.weights(s, variances + motion**2)

    information, slope, here, _, _ = _fit(position, platform, s, weight, prior)
    damped = information + x.damping * ca.diag(ca.diag(information))
    step = least_squares.inverse(damped) @ slope
    tried = position + step
    information_there, _, there, clock, lean = _fit(tried, platform, s, weight, prior)
    better = there <= here
    done = ca.sumsqr(step) < least_squares.CLOSE**2
    last = ca.fmax(done, x.passes == 1)
    _, _, _, clock_here, lean_here = _fit(position, platform, s, weight, prior)
    position = ca.if_else(better, tried, position)
    clock, lean = ca.if_else(better, clock, clock_here), ca.if_else(better, lean, lean_here)
    mean, P = _joined(
        p, x, s, position, ca.if_else(better, information_there, information),
        clock, lean, prior, weight, ca.fmin(here, there),
    )
    moved = ca.SX(x.mean)
    moved[list(POSITION)] = position
    return {
        "mean": ca.if_else(last, mean, moved),
        "covariance": ca.if_else(last, P, x.covariance),
        "damping": x.damping * ca.if_else(better, 0.01, 100),
        "passes": ca.if_else(last, 0, x.passes - 1),
        "nis": 0,
        "nis_degrees": 0,
    }


def _joined(
    p: Symbols, x: Symbols, s: Samples, position: Any, information: Any, clock: Any, lean: Any,
    prior: Any, weight: Any, cost: Any,
) -> tuple[Any, Any]:
    """The diver of a fix, and the platform of the filter: mean and packed covariance.

    The diver goes where the platform goes and turns with its heading, beside the fix's own error.
    """
    y = position[:2] - x.mean[list(PLATFORM)]
    degrees = ca.fmax(ca.sum1(s.heard[:BEACONS]) - 2, 1)
    # Samples that disagree count less; that the diver is near does not.
    near = ca.diag(ca.SX([1, 1, 0])) / _FAR_STD**2
    cofactors, determinant = adjugate(
        (information - near) / ca.fmax(cost / degrees, 1) + near
    )
    own = cofactors / determinant
    mean = ca.SX(x.mean)
    mean[list(POSITION)] = position
    fresh = {**dict.fromkeys(VELOCITY, p.prior_velocity_std**2),
             SPEED: p.sound_speed_std**2, DEPTH_BIAS: p.depth_bias_std**2}
    for i in fresh:
        mean[i] = 0
    mean[CLOCK] = clock

    P = ca.SX(unpack(x.covariance, STATES))
    kept = [i for i in range(STATES) if i not in (*POSITION, *VELOCITY, CLOCK, SPEED, DEPTH_BIAS)]
    for i in (*POSITION, *VELOCITY, CLOCK, SPEED, DEPTH_BIAS):
        for j in range(STATES):
            P[i, j] = P[j, i] = fresh.get(i, 0) if i == j else 0
    along = ca.SX(2, len(kept))  # the diver's north and east by the kept states
    for n in range(2):
        along[n, kept.index(PLATFORM[n])] = 1
    along[0, kept.index(HEADING)], along[1, kept.index(HEADING)] = -y[1], y[0]
    crossing = along @ P[kept, kept]
    P[list(POSITION), list(POSITION)] = own
    P[list(POSITION[:2]), list(POSITION[:2])] += crossing @ along.T
    P[list(POSITION[:2]), kept] = crossing
    P[kept, list(POSITION[:2])] = crossing.T
    # Errors: of the clock -lean' of the position's and what its own residuals leave; of the
    # position by the sensor's bias, which is in the depth reading.
    column = -own @ lean
    P[list(POSITION), CLOCK], P[CLOCK, list(POSITION)] = column, column.T
    P[CLOCK, CLOCK] = reciprocal(ca.sum1(weight[:BEACONS]) + prior) + ca.dot(lean, own @ lean)
    by_bias = -own[:, 2] * weight[DEPTH] * p.depth_bias_std**2
    P[list(POSITION), DEPTH_BIAS], P[DEPTH_BIAS, list(POSITION)] = by_bias, by_bias.T
    by_clock = -ca.dot(lean, by_bias)
    P[CLOCK, DEPTH_BIAS] = P[DEPTH_BIAS, CLOCK] = by_clock
    return mean, pack(symmetric(P))


