"""Outputs that all receivers share."""

from __future__ import annotations

from typing import Any

import casadi as ca

from ..equations import Symbols, Values

STATES = 6
"""Size of the paper's state vector (x, vx, y, vy, z, vz)."""
POSITION = (0, 2, 4)
VELOCITY = (1, 3, 5)


def initial(t: Any) -> Values:
    """The states that `outputs` needs, at the start."""
    return {"epoch": t, "update_count": 0, "nis": 0, "nis_degrees": 0}


def outputs(x: Symbols, mean: Any, covariance: Any) -> Values:
    """All ports of an estimate, from its mean, (6, 1), and covariance, (6, 6)."""
    variances = ca.vertcat(*(covariance[i, i] for i in POSITION))
    return {
        "valid": x.update_count > 0,
        "update_count": x.update_count,
        "epoch": x.epoch,
        "position": mean[list(POSITION)],
        "velocity": mean[list(VELOCITY)],
        "position_std": ca.sqrt(ca.fmax(variances, 0)),
        "covariance": covariance,
        "nis": x.nis,
        "nis_degrees": x.nis_degrees,
    }


def of_clock(p: Symbols, x: Symbols, clock: Any, speed: Any) -> Values:
    """Outputs of filters that estimate a clock.

    Parameters
    ----------
    clock, speed
        β [m] and κ, see `surroundings`.
    """
    return {
        "clock_offset": clock / p.assumed_sound_speed,
        "sound_speed": p.assumed_sound_speed / (1 + speed),
        "restart_count": x.restarts,
    }


def expand(position: Any, velocity: Any = 0) -> Any:
    """A state vector, (6, 1), from position and velocity, (3, 1) each."""
    velocity = ca.repmat(ca.SX(velocity), 3, 1) if ca.SX(velocity).is_scalar() else velocity
    return ca.vec(ca.horzcat(position, velocity).T)


def expand_covariance(position: Any, velocity_variance: Any = 0) -> Any:
    """A covariance, (6, 6), from that of the position, (3, 3), and one variance per velocity."""
    covariance = ca.SX.zeros(STATES, STATES)
    covariance[list(POSITION), list(POSITION)] = position
    for i in VELOCITY:
        covariance[i, i] = velocity_variance
    return covariance


def pack(covariance: Any) -> Any:
    """The upper triangle of a symmetric matrix as a column, the form in which states keep it."""
    n = covariance.shape[0]
    return ca.vertcat(*(covariance[i, j] for i in range(n) for j in range(i, n)))


def unpack(column: Any, n: int) -> Any:
    """The symmetric (n, n) matrix of an upper triangle."""
    matrix = ca.SX.zeros(n, n)
    places = [(i, j) for i in range(n) for j in range(i, n)]
    for place, (i, j) in enumerate(places):
        matrix[i, j] = matrix[j, i] = column[place]
    return matrix
