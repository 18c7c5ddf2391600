"""A bootstrap particle filter with the model of `coupled`: a yardstick for Gaussian filters.

It carries the posterior itself, whatever its shape. Where it is no better than `coupled`, the data
are to blame. Particles represent the quantities in which ranges are not linear: the diver as seen
from the platform, y = x − p, and the depth. Given their path, everything else is linear and is
carried by a Kalman filter for each particle (A. Doucet, N. de Freitas, K. Murphy, S. Russell,
Rao-Blackwellised particle filtering for dynamic Bayesian networks, UAI 2000). Quantities that
hardly change therefore do not die out. All these filters share one covariance, except for that of
(β, κ, g_z):

- (y, v, w, p, g) of an axis, north or east: velocities of diver and platform, the platform's
  position and the error of its GPS. y is drawn when a range comes, and known from then on;
- (z, v, d): depth, its rate and the error of the sensor; z is drawn with y;
- (β, κ, g_z): clock, sound speed, and the slow error of the GPS, down;
- the platform's depth: `sblcosim.models.receiver.waves.Heave`, common to all;
- the reported heading and its rate. Its white error counts as range noise. If a packet holds only
its own beacon's position, the heading is drawn before that is used. Its slow error rotates the
whole track about the platform, which is unobservable: it appears only in the covariance.

A range has the density of `sblcosim.estimation.late`: punctual, late, or wrong.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from sblcosim.fmus import stopping
from sblcosim.fmus.stopping import interruptible
from sblcosim.models.receiver import surroundings, waves
from sblcosim.models.receiver.surroundings import (
    CLOCK,
    DEPTH_BIAS,
    GPS_ERROR,
    HEADING,
    HEADING_ERROR,
    HEADING_RATE,
    LEAST_GPS_STD,
    PLATFORM,
    PLATFORM_VELOCITY,
    POSITION,
    SPEED,
    VELOCITY,
    VERTICAL_ERROR,
    Pose,
)
from sblcosim.models.receiver.waves import STATES, Heave

from ..data.estimates import Estimates
from ..data.samples import Samples
from ..errors import ConfigurationError, shortened
from ..results.result import Result
from ..scenario.overrides import Changes
from . import late, model, outcome, start
from .after import prepared
from .linear import Floats

LABEL = "particle_filter"
_REACH = 4.0
"""Standard deviations to either side of the first range between which particles start."""
_NORTH = [POSITION[0], VELOCITY[0], PLATFORM_VELOCITY[0], PLATFORM[0], GPS_ERROR[0]]
"""Indices of x, v, w, p, g of the north axis among the states; east has the same covariance."""
_DOWN = [POSITION[2], VELOCITY[2], DEPTH_BIAS]
_TURN = [HEADING, HEADING_RATE]
_SLOW = [CLOCK, SPEED, VERTICAL_ERROR]
_SEEN = np.eye(5)
_SEEN[0, 3] = -1.0
"""From (x, v, w, p, g) to (y, v, w, p, g)."""
_PLACE = np.array([0.0, 0.0, 0.0, 1.0, 1.0])
_READING = np.array([1.0, 0.0, 1.0])
_MOMENTS = (
    "position", "velocity", "covariance", "relative_position", "relative_covariance",
    "platform_position", "clock_offset", "sound_speed",
)


@dataclass(frozen=True, eq=False)
class Cloud:
    """Particles, each with a Gaussian. Covariances other than `P_slow` are common to all.

    Attributes
    ----------
    log_weight
        Shape (n,).
    flat, P_flat
        Means of (y, v, w, p, g), north and east, (n, 2, 5), and the covariance, (5, 5).
    down, P_down
        Means of (z, v, d), (n, 3), and the covariance, (3, 3).
    slow, P_slow
        Means of β [m], κ and g_z [m], (n, 3), and their covariances, (n, 3, 3).
    turn, P_turn
        Reported heading and its rate, (n, 2), and the covariance, (2, 2).
    """

    log_weight: Floats
    flat: Floats
    P_flat: Floats
    down: Floats
    P_down: Floats
    slow: Floats
    P_slow: Floats
    turn: Floats
    P_turn: Floats

    @property
    def weight(self) -> Floats:
        """Weights that add up to 1; shape (n,)."""
        weight = np.exp(self.log_weight - self.log_weight.max())
        return np.asarray(weight / weight.sum())


@interruptible
def particle_filter(
    run: Result | str | Path,
    overrides: Changes = (),
    *,
    particles: int = 50_000,
    seed: int = 1,
) -> Result:
    """Filter a finished run with particles, from the data received in it.

    Parameters
    ----------
    run
        A result, or its folder.
    overrides
        Keys of ``[receiver]`` of `coupled` to change; see `sblcosim.smooth`.
    particles
        Number of particles. Too few die out: many more should give the same error.
    seed
        Seed of its random numbers; equal seeds give equal bits.

    Returns
    -------
    Result
        The run, with ``particle_filter`` next to its receivers.

    Raises
    ------
    ConfigurationError
        There is no such run, it has no first fix, or an argument is wrong.

    Examples
    --------
    >>> run = sblcosim.run("paper-scenario-1", receiver="coupled")           # doctest: +SKIP
    >>> beside = sblcosim.research.particle_filter(run, particles=10_000)    # doctest: +SKIP
    >>> beside.errors.xs("total", level="axis").rms_m                        # doctest: +SKIP
    """
    for name, value, least in (("particles", particles, 2), ("seed", seed, 0)):
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            raise ConfigurationError(
                f"{name}: must be a whole number of at least {least}, got {shortened(repr(value))}"
            )
    result, p, samples, _ = prepared(run, overrides)
    p = model.settled(p, start.ran(result.record), result.record)
    estimates = filtered(p, samples, particles, seed)
    origin = outcome.origin_of(p, LABEL, particles=particles, seed=seed)
    return outcome.beside(result, LABEL, estimates, origin)


def filtered(p: Any, samples: Samples, particles: int, seed: int) -> Estimates:
    """Estimates at all epochs from the first fix on: mean and covariance of the posterior.

    Raises
    ------
    ConfigurationError
        There is no first fix.
    """
    rng = np.random.default_rng(seed)
    depths = dict(zip(samples.depth_ns.tolist(), samples.depth.tolist(), strict=True))
    poses = _poses(p, samples)
    cloud = begun(p, particles)
    then, located, heave = samples.start_ns, p.initialisation == model.PRIOR, waves.no_heave(p)
    first, fresh = model.first_ns(p, samples), samples.has_own_pose
    rows: list[tuple[Any, ...]] = []
    for epoch in samples.epochs_ns.tolist():
        stopping.check()
        dt = (epoch - then) / 1e9
        cloud, heave = predicted(p, cloud, dt), _heave_later(p, heave, dt)
        if epoch in depths:
            cloud = sounded(p, cloud, depths[epoch])
        for i in np.flatnonzero(samples.range_ns == epoch):
            body = [*p.beacon_offset[samples.beacon[i]]]
            if fresh[i]:
                cloud, heave = floated(p, cloud, heave, poses[i], body)
            if not fresh[i]:
                pass  # the pose of this epoch has already been used
            elif samples.has_pose[i]:
                cloud = headed(p, cloud, samples.attitude[i, 2])
                cloud = placed(p, cloud, samples.position[i], [0.0, 0.0, 0.0])
            else:
                cloud = placed(p, turned(cloud, rng), samples.position[i], body)
            if located:
                cloud = drawn(cloud, rng)
            elif epoch >= samples.depth_ns[0]:
                cloud, located = anywhere(p, cloud, poses[i], body, samples.range[i], rng), True
            else:
                continue
            cloud = resampled(ranged(p, cloud, poses[i], body, samples.range[i]), rng)
        then = epoch
        if located and epoch >= first:
            rows.append((epoch, *moments(p, cloud, heave)))
    if not rows:
        raise ConfigurationError("record: must have ranges and depths, for a first fix, got none")
    columns = map(np.array, zip(*rows, strict=True))
    return Estimates(**dict(zip(("epoch_ns", *_MOMENTS), columns, strict=True)))


def _poses(p: Any, samples: Samples) -> list[Pose]:
    """The pose of each packet. Swing counts as noise."""
    said = model.pose_of(p, samples)
    noise = said.own * (p.beacon_offset[samples.beacon, 2] * p.tilt_std) ** 2
    columns = (said.down, said.roll, said.pitch, said.tilt_variance, said.own, noise)
    return [
        Pose(down, roll, pitch, variance, own, (0.0, 0.0), swing)
        for down, roll, pitch, variance, own, swing in zip(*columns, strict=True)
    ]


def begun(p: Any, n: int) -> Cloud:
    """Particles at the start, all still equal."""
    mean, std = model.prior(p, np.zeros(STATES))
    flat = np.stack([mean[[i + axis for i in _NORTH]] for axis in (0, 1)]) @ _SEEN.T
    return Cloud(
        np.zeros(n),
        np.tile(flat, (n, 1, 1)), _SEEN @ np.diag(std[_NORTH] ** 2) @ _SEEN.T,
        np.tile(mean[_DOWN], (n, 1)), np.diag(std[_DOWN] ** 2),
        np.zeros((n, 3)), np.tile(np.diag(std[_SLOW] ** 2), (n, 1, 1)),
        np.zeros((n, 2)), np.diag(std[_TURN] ** 2),
    )


def predicted(p: Any, cloud: Cloud, dt: float) -> Cloud:
    """Propagate the particles by a time dt [s]."""
    phi, Q = model.transition(p, dt)
    # The reported heading includes its error.
    Q[HEADING, HEADING] += Q[HEADING_ERROR, HEADING_ERROR]

    def block(states: list[int]) -> tuple[Floats, Floats]:
        return phi[np.ix_(states, states)], Q[np.ix_(states, states)]

    F, N = block(_NORTH)
    F, N = _SEEN @ F @ np.linalg.inv(_SEEN), _SEEN @ N @ _SEEN.T
    D, M = block(_DOWN)
    T, V = block(_TURN)
    S, U = block(_SLOW)
    return replace(
        cloud, flat=cloud.flat @ F.T, P_flat=F @ cloud.P_flat @ F.T + N,
        down=cloud.down @ D.T, P_down=D @ cloud.P_down @ D.T + M,
        slow=cloud.slow @ S.T, P_slow=S @ cloud.P_slow @ S.T + U,
        turn=cloud.turn @ T.T, P_turn=T @ cloud.P_turn @ T.T + V,
    )


def _heave_later(p: Any, heave: Heave, dt: float) -> Heave:
    phi, noise = surroundings.transition(np, p, dt)
    return waves.heave_later(np, p, heave, dt, 0.0, surroundings.drift(p, phi, noise)[2])


def _gain(P: Floats, h: Floats, R: float) -> tuple[Floats, float, Floats]:
    """Gain, variance of the innovation, and covariance after a scalar measurement."""
    c = P @ h
    S = float(h @ c) + R
    return c / S, S, P - np.outer(c, c) / S


def sounded(p: Any, cloud: Cloud, depth: float) -> Cloud:
    """A reading of the depth sensor."""
    K, S, P = _gain(cloud.P_down, _READING, p.depth_std**2)
    off = depth - cloud.down @ _READING
    return replace(
        cloud, log_weight=cloud.log_weight - 0.5 * off**2 / S,
        down=cloud.down + off[:, None] * K, P_down=P,
    )


def floated(
    p: Any, cloud: Cloud, heave: Heave, pose: Pose, body: list[float]
) -> tuple[Cloud, Heave]:
    """A reported depth of the platform."""
    row = waves.down_after(np, p, heave, pose.own, body)
    slope = row.row[VERTICAL_ERROR]
    c = slope * cloud.P_slow[:, 2]
    S = slope * c[:, 2] + row.variance
    K = c / S[:, None]
    off = pose.down - row.value - slope * cloud.slow[:, 2]
    return replace(
        cloud, log_weight=cloud.log_weight - 0.5 * (off**2 / S + np.log(S)),
        slow=cloud.slow + off[:, None] * K, P_slow=cloud.P_slow - K[:, :, None] * c[:, None, :],
    ), waves.heaved(heave, row, pose.down, 1)


def headed(p: Any, cloud: Cloud, heading: float) -> Cloud:
    """A reported heading."""
    R = surroundings.heading(np, p, [0.0] * STATES).variance
    K, S, P = _gain(cloud.P_turn, np.array([1.0, 0.0]), R)
    off = heading - cloud.turn[:, 0]
    off -= 2 * np.pi * np.floor((off + np.pi) / (2 * np.pi))
    return replace(
        cloud, log_weight=cloud.log_weight - 0.5 * off**2 / S,
        turn=cloud.turn + off[:, None] * K, P_turn=P,
    )


def turned(cloud: Cloud, rng: np.random.Generator) -> Cloud:
    """Draw the heading from each particle's Gaussian; if unknown, from all directions."""
    n, std = len(cloud.turn), np.sqrt(cloud.P_turn[0, 0])
    off = std * rng.standard_normal(n) if std < np.pi else rng.uniform(-np.pi, np.pi, n)
    slope, P = _known(cloud.P_turn)
    return replace(cloud, turn=cloud.turn + off[:, None] * slope, P_turn=P)


def placed(p: Any, cloud: Cloud, place: Floats, body: list[float]) -> Cloud:
    """Reported position of a point of the platform; ``body`` is its body-frame position."""
    R = max(p.gps_std, LEAST_GPS_STD) ** 2 + body[2] ** 2 * (p.tilt_std**2 + p.imu_tilt_std**2)
    K, S, P = _gain(cloud.P_flat, _PLACE, R)
    c, s = np.cos(cloud.turn[:, 0]), np.sin(cloud.turn[:, 0])
    arm = np.column_stack([c * body[0] - s * body[1], s * body[0] + c * body[1]])
    off = place[:2] - arm - cloud.flat @ _PLACE
    return replace(
        cloud, log_weight=cloud.log_weight - 0.5 * (off**2).sum(axis=1) / S,
        flat=cloud.flat + off[:, :, None] * K, P_flat=P,
    )


def drawn(cloud: Cloud, rng: np.random.Generator) -> Cloud:
    """Draw y and z from each particle's Gaussian."""
    n = len(cloud.down)
    return _at(
        cloud,
        cloud.flat[:, :, 0] + np.sqrt(cloud.P_flat[0, 0]) * rng.standard_normal((n, 2)),
        cloud.down[:, 0] + np.sqrt(cloud.P_down[0, 0]) * rng.standard_normal(n),
    )


def _at(cloud: Cloud, y: Floats, z: Floats) -> Cloud:
    """The particles after y and z are known."""
    K, P_flat = _known(cloud.P_flat)
    k, P_down = _known(cloud.P_down)
    return replace(
        cloud, flat=cloud.flat + (y - cloud.flat[:, :, 0])[:, :, None] * K, P_flat=P_flat,
        down=cloud.down + (z - cloud.down[:, 0])[:, None] * k, P_down=P_down,
    )


def _known(P: Floats) -> tuple[Floats, Floats]:
    """How all states follow the first, and their covariance once it is known."""
    if not P[0, 0] > 0:
        return np.eye(len(P))[0], P
    slope = P[:, 0] / P[0, 0]
    rest = P - np.outer(slope, P[0])
    rest[0], rest[:, 0] = 0.0, 0.0
    return slope, rest


def anywhere(
    p: Any, cloud: Cloud, pose: Pose, body: list[float], z: float, rng: np.random.Generator
) -> Cloud:
    """Particles about a beacon, at any bearing and at distances that may give its range."""
    n = len(cloud.down)
    depth = cloud.down[:, 0] + np.sqrt(cloud.P_down[0, 0]) * rng.standard_normal(n)
    std = np.sqrt(p.range_std**2 + p.clock_std**2 + (p.sound_speed_std * z) ** 2
                  + p.gps_vertical_error_std**2)
    slant = z + _REACH * std * rng.uniform(-1, 1, n)
    at: list[Any] = [0.0] * STATES
    at[HEADING] = cloud.turn[:, 0]
    arm = surroundings.arm_of(np, at, pose, body)
    far = np.sqrt(np.maximum(slant**2 - (depth - pose.down + cloud.slow[:, 2] - arm[2]) ** 2, 0))
    bearing = rng.uniform(-np.pi, np.pi, n)
    # Nothing is known about x, so y says nothing about the platform.
    P = cloud.P_flat.copy()
    P[0], P[:, 0] = 0.0, 0.0
    free = replace(cloud, P_flat=P)
    y = np.column_stack([arm[0] + far * np.cos(bearing), arm[1] + far * np.sin(bearing)])
    return _at(free, y, depth)


def ranged(p: Any, cloud: Cloud, pose: Pose, body: list[float], z: float) -> Cloud:
    """A range."""
    x: list[Any] = [0.0] * STATES
    x[HEADING] = cloud.turn[:, 0]
    x[0], x[1], x[2] = cloud.flat[:, 0, 0], cloud.flat[:, 1, 0], cloud.down[:, 0]
    x[CLOCK], x[SPEED], x[VERTICAL_ERROR] = cloud.slow.T
    row = surroundings.range_(np, p, x, pose, body)
    R = row.variance + row.row[HEADING] ** 2 * cloud.P_turn[0, 0]
    off = z - row.value
    h = np.column_stack([np.ones(len(R)), row.distance, row.u[2]])
    c = (cloud.P_slow @ h[:, :, None])[:, :, 0]
    S = (h * c).sum(axis=1) + R
    punctual, other = late.log_densities(p, off, S)
    total = np.logaddexp(punctual, other)
    share = np.exp(punctual - total)
    K = c / S[:, None]
    spread = share * (1 - share) * off**2 - share * S
    return replace(
        cloud, log_weight=cloud.log_weight + total,
        slow=cloud.slow + (share * off)[:, None] * K,
        P_slow=cloud.P_slow + spread[:, None, None] * K[:, :, None] * K[:, None, :],
    )


def resampled(cloud: Cloud, rng: np.random.Generator) -> Cloud:
    """Equal weights by systematic resampling, if few particles are effective (below half)."""
    weight = cloud.weight
    n = len(weight)
    if 1 / (weight**2).sum() > n / 2:
        return replace(cloud, log_weight=cloud.log_weight - cloud.log_weight.max())
    edges = np.cumsum(weight)
    picks = (np.arange(n) + rng.uniform()) / n * edges[-1]
    kept = np.minimum(np.searchsorted(edges, picks, side="right"), n - 1)
    each = ("flat", "down", "slow", "P_slow", "turn")
    taken = {name: getattr(cloud, name)[kept] for name in each}
    return replace(cloud, log_weight=np.zeros(n), **taken)


def moments(p: Any, cloud: Cloud, heave: Heave) -> tuple[Any, ...]:
    """The posterior as a Gaussian: the fields `_MOMENTS` of `Estimates`."""
    weight, n = cloud.weight, len(cloud.log_weight)
    y, v, place = cloud.flat[:, :, 0], cloud.flat[:, :, 1], cloud.flat[:, :, 3]
    z, rate = cloud.down[:, :1], cloud.down[:, 1:2]
    x, speed = np.hstack([y + place, z]), np.hstack([v, rate])
    seen = np.hstack([y, z - heave.down + heave.share * cloud.slow[:, 2:]])
    covariance = _covariance(weight, np.stack([x, speed], axis=2).reshape(n, 6))
    relative = _covariance(weight, seen)
    # Within each particle
    T = np.array([[1.0, 0, 0, 1, 0], [0, 1, 0, 0, 0]])
    for i in (0, 2):
        covariance[i : i + 2, i : i + 2] += T @ cloud.P_flat @ T.T
        covariance[i, i] += p.gps_bias_std**2
    covariance[4:, 4:] += cloud.P_down[:2, :2]
    sinking = heave.share**2 * (weight @ cloud.P_slow[:, 2, 2])
    deep = cloud.P_down[0, 0] + sinking + heave.variance
    relative += np.diag([cloud.P_flat[0, 0]] * 2 + [deep])
    # The slow error of the heading rotates y; nothing separates it from a rotation of the diver.
    turned = p.imu_heading_error_std * (weight @ y)[::-1] * [-1, 1]
    covariance[np.ix_([0, 2], [0, 2])] += np.outer(turned, turned)
    relative[:2, :2] += np.outer(turned, turned)
    beta, kappa, sunk = weight @ cloud.slow
    c = p.assumed_sound_speed
    return (
        weight @ x, weight @ speed, covariance, weight @ seen, relative,
        np.append(weight @ place, heave.down - heave.share * sunk), beta / c, c / (1 + kappa),
    )


def _covariance(weight: Floats, values: Floats) -> Floats:
    off = values - weight @ values
    return np.asarray((weight[:, None] * off).T @ off)
