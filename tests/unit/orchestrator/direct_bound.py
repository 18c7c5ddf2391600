"""The bound in a second way: rows by automatic differentiation, all measurements of an epoch at
once, dense matrices, one diver after another. Slow, and as short as it can be."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
from sblcosim.limits.recursion import Epochs, ReceiverModel
from sblcosim.models.receiver import field, surroundings, waves

LEAST_VARIANCE = 1e-12
FAR, ANYWHERE = 30.0, 10.0


def covariances(
    model: ReceiverModel, epochs: Epochs, position: Any, acceleration_psd: Any, keep: Any = None
) -> tuple[Any, Any]:
    """As `sblcosim.limits.recursion.covariances`."""
    n, divers = position.shape[:2]
    count = epochs.heard.shape[1]
    kept = range(n) if keep is None else list(keep)
    platform, attitude = (np.broadcast_to(a, (n, 3)) for a in (epochs.platform, epochs.attitude))
    beacons = np.broadcast_to(epochs.beacons, (n, count, 3))
    absolute, relative = np.empty((2, len(kept), divers, 3, 3))
    for diver in range(divers):
        p = SimpleNamespace(**vars(model.parameters))
        p.acceleration_psd, p.beacons = acceleration_psd[diver], count
        P = prior(model, p)
        for k in range(n):
            if epochs.step_s[k] > 0:
                Phi, Q = transition(model, p, epochs.step_s[k])
                P = Phi @ P @ Phi.T + Q
            H, R, there = measured(
                model, p, position[k, diver], platform[k], attitude[k], beacons[k],
                (epochs.readings[k], epochs.packets[k], epochs.heard[k]),
            )
            P = _updated(P, H[there > 0], (R / np.where(there > 0, there, 1))[there > 0])
            if k in kept:
                at = list(kept).index(k)
                absolute[at, diver], relative[at, diver] = marginals(model, p, P)
    return absolute, relative


def prior(model: ReceiverModel, p: Any) -> Any:
    known = model.situation["known_start"]
    place = p.prior_position_std if known else FAR
    if model.own_errors:
        errors = (p.beacon_error_std, p.beacon_error_std, p.beacon_vertical_error_std)
        stds = [place, p.prior_velocity_std] * 3
        stds += [p.clock_std, p.sound_speed_std, p.depth_bias_std, *errors * p.beacons]
    else:
        stds = [place] * 3 + [p.prior_velocity_std] * 3 + [FAR] * 2
        stds += [p.platform_velocity_std] * 2 + [p.gps_markov_std] * 2
        stds += [ANYWHERE, p.heading_rate_std, p.imu_heading_error_std]
        stds += [p.clock_std, p.sound_speed_std, p.depth_bias_std, p.gps_vertical_error_std]
        stds += [p.heave_std, p.tilt_std, p.tilt_std]
    return np.diag(np.array(stds, float) ** 2)


def transition(model: ReceiverModel, p: Any, dt: float) -> tuple[Any, Any]:
    phi, noise = (field if model.own_errors else waves).transition(np, p, dt)
    size = field.states(p.beacons) if model.own_errors else waves.STATES
    Phi, Q = np.eye(size), np.zeros((size, size))
    for (i, j), value in phi.items():
        Phi[i, j] = value
    for (i, j), value in noise.items():
        Q[i, j] = Q[j, i] = value
    return Phi, Q


def measured(
    model: ReceiverModel,
    p: Any,
    position: Any,
    platform: Any,
    attitude: Any,
    beacons: Any,
    there: Any,
) -> tuple[Any, Any, Any]:
    """Rows, variances and how much there is of each measurement."""
    readings, packets, heard = there
    own = bool(model.situation["own_beacon"])
    names = tuple(k for k, v in vars(p).items() if np.ndim(v) == 0 and not isinstance(v, str))
    numbers = [float(getattr(p, k)) for k in names]
    H, R, weights = [], [], []
    kinds = ["depth"] if model.own_errors or own else ["depth", "pose"]
    amounts = {"depth": readings, "pose": packets}
    all_of_them = [(kind, -1, np.zeros(3), amounts[kind]) for kind in kinds]
    all_of_them += [("beacon", i, beacons[i], heard[i]) for i in range(len(beacons))]
    for kind, number, beacon, weight in all_of_them:
        which = number if model.own_errors else -1
        row, variance = _rows(model.own_errors, own, kind, which, names, int(p.beacons))(
            _state(model, p, position, platform, attitude), numbers, platform, attitude, beacon
        )
        H.append(np.array(row))
        R.append(np.array(variance).ravel())
        weights.append(np.full(len(R[-1]), weight))
    return np.vstack(H), np.maximum(np.concatenate(R), LEAST_VARIANCE), np.concatenate(weights)


def _state(model: ReceiverModel, p: Any, position: Any, platform: Any, attitude: Any) -> Any:
    if model.own_errors:
        x = np.zeros(field.states(p.beacons))
        x[[0, 2, 4]], x[field.SPEED] = position, model.situation["speed"]
        return x
    x = np.zeros(waves.STATES)
    x[:3], x[6:8], x[12], x[16] = position, platform[:2], attitude[2], model.situation["speed"]
    return x


@cache
def _rows(
    own_errors: bool, own: bool, kind: str, which: int, names: tuple[str, ...], count: int
) -> Any:
    """A CasADi function: derivatives of the measured values, and their variances."""
    size = field.states(count) if own_errors else waves.STATES
    x, v = ca.SX.sym("x", size), ca.SX.sym("v", len(names))
    platform, attitude, beacon = (ca.SX.sym(n, 3) for n in ("platform", "attitude", "beacon"))
    p = SimpleNamespace(**dict(zip(names, ca.vertsplit(v), strict=True)))
    p.beacons = count
    states, body = ca.vertsplit(x), ca.vertsplit(beacon)
    if own_errors:
        one_hot = [float(i == which) for i in range(count)]
        found = [field.depth(p, states)] if kind == "depth" else [
            field.range_(ca, p, states, body, one_hot)
        ]
    elif kind == "depth":
        found = [surroundings.depth(p, states)]
    elif kind == "pose":
        found = [waves.down(ca, p, states, 0.0, body), surroundings.heading(ca, p, states),
                 *waves.places(ca, p, states, (0.0, 0.0, 0.0))]
    else:
        variance = 0.0 if own else surroundings.tilt(p, 0.0)[1]
        roll, pitch = (0.0, 0.0) if own else (attitude[0], attitude[1])
        pose = surroundings.Pose(platform[2], roll, pitch, variance, float(own))
        said = waves.places(ca, p, states, body)
        found = [*((waves.down(ca, p, states, 1.0, body), *said) if own else ()),
                 waves.range_(ca, p, states, pose, body)]
    values, variances = (ca.vertcat(*(getattr(m, a) for m in found)) for a in ("value", "variance"))
    return ca.Function(
        "rows", [x, v, platform, attitude, beacon], [ca.jacobian(values, x), variances]
    )


def _updated(P: Any, H: Any, R: Any) -> Any:
    if len(R) == 0:
        return P
    K = np.linalg.solve(H @ P @ H.T + np.diag(R), H @ P).T
    rest = np.eye(len(P)) - K @ H
    return rest @ P @ rest.T + K @ np.diag(R) @ K.T


def marginals(model: ReceiverModel, p: Any, P: Any) -> tuple[Any, Any]:
    if model.own_errors:
        place = P[np.ix_([0, 2, 4], [0, 2, 4])]
        return place, place
    D = np.zeros((3, waves.STATES))
    D[0, [0, 6]], D[1, [1, 7]], D[2, [2, 19]] = (1, -1), (1, -1), (1, -1)
    bias = p.gps_bias_std**2
    return P[:3, :3] + np.diag([bias, bias, 0]), D @ P @ D.T
