"""Kalman filters with a constant-velocity model (the paper's section 3), and how they start."""

from __future__ import annotations

from typing import Any

import casadi as ca

from ..declaration import number_of
from ..equations import Loop, Symbols, Values
from . import estimate, least_squares, measurements
from .estimate import POSITION, STATES, expand, expand_covariance, pack, unpack
from .least_squares import symmetric
from .measurements import Samples, samples
from .variables import INITIALISATION, PROCESS_NOISE

_PRIOR = number_of(INITIALISATION, "prior")
_WHITE = number_of(PROCESS_NOISE, "white_noise_acceleration")


def initial(p: Symbols, t: Any) -> Values:
    """States of a filter at the start. The prior is used only if the configuration asks for it."""
    return {
        **measurements.initial(p, t),
        **estimate.initial(t),
        "ready": p.initialisation == _PRIOR,
        "mean": expand(p.prior_position, p.prior_velocity),
        "covariance": pack(expand_covariance(
            p.prior_position_std**2 * ca.SX.eye(3), p.prior_velocity_std**2
        )),
        "passes": 0,
        "damping": 0,
    }


def output(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Values:
    """Outputs of a filter."""
    return estimate.outputs(x, x.mean, unpack(x.covariance, STATES))


def begin(x: Symbols, s: Samples) -> tuple[Any, Any, Values]:
    """What a tick does first.

    Returns
    -------
    update, start
        Whether the filter processes something new, or starts with it: 0 or 1.
    changes
        The states that record this.
    """
    update = s.any_new * x.ready
    start = s.any_new * s.enough * (x.ready == 0)
    return update, start, {
        "ready": x.ready + start,
        "update_count": x.update_count + update + start,
        "passes": least_squares.PASSES * start,
        "damping": least_squares.FIRST_DAMPING,
    }


def initialise() -> Loop:
    """The loop that computes an estimate from the latest receptions alone.

    A sample that is older than the newest by ``a`` counts with a variance larger by
    ``(prior_velocity_std a)^2``, because the diver has moved since. If the samples disagree more
    than their variances allow, the covariance is multiplied by their weighted sum of squared
    residuals per degree of freedom.
    """

    def guard(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Any:
        return x.passes

    def body(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
        s = samples(p, x, u)
        motion = p.prior_velocity_std * (s.newest - s.epoch)
        position = ca.if_else(
            x.passes == least_squares.PASSES, least_squares.closed_form(s), x.mean[list(POSITION)]
        )
        weight = least_squares.weights(s, measurements.noise(p) + motion**2)
        result = least_squares.improve(
            position, x.damping, lambda place: least_squares.separate(place, s, weight)
        )
        cost = ca.fmin(result.here.cost, result.there.cost)
        disagreement = ca.fmax(cost / ca.fmax(least_squares.degrees(s), 1), 1)
        own = disagreement * least_squares.inverse(result.here.information)
        return {
            "mean": expand(result.taken.position),
            "covariance": pack(expand_covariance(own, p.prior_velocity_std**2)),
            "damping": result.damping,
            "passes": ca.if_else(result.done, 0, x.passes - 1),
            "nis": 0,
            "nis_degrees": 0,
        }

    return Loop("initialise", guard, body)


def predict(p: Symbols, mean: Any, P: Any, dt: Any) -> tuple[Any, Any]:
    """Time update (the paper's predictor): the state ``dt`` s later.

    Phi is the paper's. Q per axis is ``q [[dt^3/3, dt^2/2], [dt^2/2, dt]]`` for white noise
    acceleration. For an acceleration of variance ``q/dt`` that is constant over the interval,
    dt^3/4 replaces dt^3/3.
    """
    dt2 = dt * dt
    third = ca.if_else(p.process_noise == _WHITE, 1 / 3, 1 / 4)
    axis = ca.SX.eye(2)
    axis[0, 1] = dt
    Phi = ca.diagcat(axis, axis, axis)
    q = p.acceleration_psd
    cross = q * dt2 / 2
    block = ca.vertcat(
        ca.horzcat(q * third * dt2 * dt, cross), ca.horzcat(cross, q * dt)
    )
    Q = ca.diagcat(block, block, block)
    return Phi @ mean, symmetric(Phi @ P @ Phi.T + Q)


def sensitivity(gradient: Any) -> Any:
    """A row of H as a column, (6, 1), from the gradient with respect to the position."""
    h = ca.SX(STATES, 1)
    for place, i in enumerate(POSITION):
        h[i] = gradient[place]
    return ca.sparsify(h)


def reduce(P: Any, b: Any, K: Any) -> Any:
    """Covariance after a scalar measurement, ``P - K h P`` (the paper's corrector); b = P h'."""
    return symmetric(P - b @ K.T)


def joseph(P: Any, h: Any, b: Any, K: Any, R: Any) -> Any:
    """The same as ``(I - K h) P (I - K h)' + K R K'``, which stays positive despite rounding."""
    A = reduce(P, b, K)
    return symmetric(A + (R * K - A @ h) @ K.T)

