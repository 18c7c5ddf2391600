"""The posterior Cramér-Rao (Riccati) recursion along a true path, for the model of `coupled`.

J₊ = (Q + Φ J⁻¹ Φᵀ)⁻¹ + Σ Hᵀ H/R, with the rows H at the true state (P. Tichavský, C. H. Muravchik,
A. Nehorai, Posterior Cramér-Rao bounds for discrete-time nonlinear filtering, IEEE Trans. Signal
Process. 46, 1998, 1386-1396, for additive Gaussian noise). P = J⁻¹ is what is carried here, since a
state that is known exactly has no J.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.models.receiver import surroundings
from sblcosim.models.receiver.surroundings import (
    HEADING,
    PLATFORM,
    POSITION,
    SPEED,
    STATES,
    VELOCITY,
    VERTICAL_ERROR,
    Pose,
)

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

Step = Callable[[float], tuple[Floats, Floats]]

FAR_STD = 30.0
"""What is known of a place before any measurement [m]; more makes no difference."""
ANYWHERE = 10.0
"""The same of a heading [rad]."""
_LEAST_STD = 1e-6
"""No sensor is better than this [m]: information must be finite."""


@dataclass(frozen=True, eq=False)
class Truth:
    """True states at the epochs of a run; shape (n, …).

    Attributes
    ----------
    position, platform
        Of the diver and of the platform's reference point, NED [m]; (n, 3).
    attitude
        Roll, pitch, yaw of the platform [rad]; (n, 3).
    speed
        κ = c₀/c − 1.
    """

    position: Floats
    platform: Floats
    attitude: Floats
    speed: float = 0.0


@dataclass(frozen=True, eq=False)
class Rows:
    """Scalar measurements of n epochs, in one array; those that are not there have no weight.

    Attributes
    ----------
    H
        Derivatives; (n, m, 19).
    R
        Variances; (n, m).
    there
        How much of each measurement there is, as a share of its information: 0 to 1; (n, m).
    """

    H: Floats
    R: Floats
    there: Floats


def rows_of(
    p: Any,
    truth: Truth,
    heard: Floats,
    depth: Floats,
    beacons: Floats,
    own_beacon: bool = False,
    poses: Floats | None = None,
) -> Rows:
    """The measurements of all epochs at the true states.

    Parameters
    ----------
    p
        Parameters of `coupled`.
    heard
        Packets received of each beacon, 0 to 1; (n, N).
    depth
        Whether there is a reading of the depth sensor, 0 to 1; (n,).
    beacons
        Nominal positions, body frame [m]; (N, 3).
    own_beacon
        A packet tells where its own beacon is, and nothing else of the platform.
    poses
        Packets with the platform's pose, if it is not one at most; (n,).
    """
    n = len(truth.position)
    x: list[Any] = [np.zeros(n)] * STATES
    for i, of in ((POSITION, truth.position), (PLATFORM, truth.platform)):
        for state, values in zip(i, of.T[: len(i)], strict=True):
            x[state] = values
    x[HEADING], x[SPEED] = truth.attitude[:, 2], np.full(n, truth.speed)
    roll, pitch = truth.attitude[:, 0], truth.attitude[:, 1]
    tilt_variance = surroundings.tilt(p, 0.0)[1]
    if own_beacon:
        roll, pitch, tilt_variance = np.zeros(n), np.zeros(n), p.tilt_std**2
    pose = Pose(truth.platform[:, 2], roll, pitch, tilt_variance)

    measured: list[tuple[Any, Floats]] = [(surroundings.depth(p, x), depth)]
    if not own_beacon:
        packet = heard.max(axis=1, initial=0) if poses is None else poses
        measured += [(m, packet) for m in surroundings.places(np, p, x, (0.0, 0.0))]
        measured.append((surroundings.heading(np, p, x), packet))
    for body, received in zip(beacons, heard.T, strict=True):
        if own_beacon:
            measured += [(m, received) for m in surroundings.places(np, p, x, body)]
        measured.append((surroundings.range_(np, p, x, pose, body), received))

    return stacked(measured, STATES)


def stacked(measured: Sequence[tuple[Any, Floats]], states: int) -> Rows:
    """Measurements and how much there is of each, (n,), as `Rows`."""
    n = len(measured[0][1])
    H = np.zeros((n, len(measured), states))
    R, there = np.empty((2, n, len(measured)))
    for k, (measurement, weight) in enumerate(measured):
        for i, value in measurement.row.items():
            H[:, k, i] = value
        R[:, k] = np.fmax(measurement.variance, _LEAST_STD**2)
        there[:, k] = weight
    return Rows(H, R, there)


def prior(p: Any, known_start: bool) -> Floats:
    """Covariance at the start of a run; (19, 19)."""
    stds = np.zeros(STATES)
    for i, std in surroundings.prior_stds(p).items():
        stds[i] = std
    stds[list(POSITION)] = p.prior_position_std if known_start else FAR_STD
    stds[list(VELOCITY)] = p.prior_velocity_std
    stds[list(PLATFORM)], stds[HEADING] = FAR_STD, ANYWHERE
    return np.diag(stds**2)


def transition(p: Any, dt: float) -> tuple[Floats, Floats]:
    """Φ and Q over dt [s]; (19, 19) each."""
    phi, noise = surroundings.transition(np, p, dt)
    return arrays_of(phi, noise, STATES)


def arrays_of(
    phi: Mapping[tuple[int, int], Any], noise: Mapping[tuple[int, int], Any], states: int
) -> tuple[Floats, Floats]:
    """Φ and Q of their elements, Φ without its ones and of Q the upper triangle."""
    Phi, Q = np.eye(states), np.zeros((states, states))
    for (i, j), value in phi.items():
        Phi[i, j] = value
    for (i, j), value in noise.items():
        Q[i, j] = Q[j, i] = value
    return Phi, Q


def covariances(
    step: Step, start: Floats, epoch_ns: Integers, begin_ns: int, rows: Rows
) -> Floats:
    """P after the measurements of each epoch; (n, m, m) for m states.

    Parameters
    ----------
    step
        Φ and Q over a time [s].
    start
        P at ``begin_ns``.
    epoch_ns
        Increasing [ns]; (n,).
    """
    known: dict[int, tuple[Floats, Floats]] = {}
    result = np.empty((len(epoch_ns), *start.shape))
    P, before = start, begin_ns
    for k, now in enumerate(epoch_ns.tolist()):
        dt = now - before
        if dt > 0:
            if dt not in known:
                known[dt] = step(dt * 1e-9)
            Phi, Q = known[dt]
            P = Phi @ P @ Phi.T + Q
            before = now
        some = np.flatnonzero(rows.there[k] > 0)
        if len(some):
            P = _updated(P, rows.H[k, some], rows.R[k, some] / rows.there[k, some])
        result[k] = P
    return result


def _updated(P: Floats, H: Floats, R: Floats) -> Floats:
    """P with measurements; in Joseph's form, so that it stays a covariance whatever R is."""
    c = P @ H.T
    S = H @ c
    S[np.diag_indices_from(S)] += R
    K = np.linalg.solve(S, c.T).T
    rest = np.eye(len(P)) - K @ H
    return rest @ P @ rest.T + (K * R) @ K.T


def marginals(P: Floats, p: Any) -> tuple[Floats, Floats]:
    """Covariance of the diver's position, absolute and relative to the platform; (n, 3, 3) [m²].

    A constant GPS error is in the absolute one, a white vertical one in the relative one: neither
    is a state.
    """
    absolute = P[:, :3, :3].copy()
    D = _difference()
    relative = D @ P @ D.T
    for i in (0, 1):
        absolute[:, i, i] += p.gps_bias_std**2
    relative[:, 2, 2] += p.gps_vertical_std**2
    return absolute, relative


def _difference() -> Floats:
    """The matrix that makes x − p of the state; (3, 19)."""
    D = np.zeros((3, STATES))
    D[POSITION, POSITION] = 1
    for i, j in enumerate(PLATFORM):
        D[i, j] = -1
    D[2, VERTICAL_ERROR] = 1
    return D
