"""A bootstrap particle filter with the model of `coupled`: a yardstick for Gaussian filters.

It carries the posterior itself, however it is bent: where it is no better than `coupled`, the data
are to blame. Particles are what ranges are not linear in: the diver as seen from the platform,
y = x − p, with depth, velocity, and the platform's velocity. The rest is linear given these and is
carried along by Kalman filters, one per particle, whose covariances are equal for all where they do
not depend on y (M. Montemerlo et al., FastSLAM; A. Doucet et al., Rao-Blackwellised particle
filtering for dynamic Bayesian networks, 2000):

- p and the error g of the GPS, from reported positions and the prior of x = y + p;
- β and κ of clock and sound speed, from the ranges;
- the bias of the depth sensor;
- the heading as reported, from reported headings alone. Its white error counts as noise of the
  ranges. Its slow error turns the whole track about the platform, which nothing observes: it is
  only in the covariance.

A range has the density of `sblcosim.estimation.late`: punctual, late, or wrong.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from sblcosim.models.receiver import surroundings
from sblcosim.models.receiver.surroundings import (
    CLOCK,
    GPS_ERROR,
    HEADING,
    HEADING_ERROR,
    HEADING_RATE,
    LEAST_GPS_STD,
    PLATFORM,
    PLATFORM_VELOCITY,
    POSITION,
    SPEED,
    STATES,
    VELOCITY,
    Pose,
)

from ..errors import ConfigurationError, shortened
from ..results.result import Result
from ..scenario.overrides import Overrides
from . import late, model, outcome
from .after import prepared
from .linear import Floats
from .outcome import Estimates
from .samples import Samples

LABEL = "particle_filter"
_REACH = 4.0
"""Standard deviations to both sides of the first range between which particles begin."""


@dataclass(frozen=True, eq=False)
class Cloud:
    """Particles, and what belongs to each; covariances without a particle's axis are common.

    Attributes
    ----------
    log_weight
        Shape (n,).
    y, z, v
        x − p, north and east, (n, 2) [m]; depth, (n,) [m]; velocity of the diver, (n, 3) [m/s].
    w
        Velocity of the platform, (n, 2) [m/s].
    p, g, P_pg
        Means of the platform's position and of its GPS error, (n, 2) [m], and the covariance of
        both, the same for north and east, (2, 2) [m²].
    depth_bias, depth_variance
        Mean, (n,) [m], and variance [m²].
    clock, P_clock
        Means of β [m] and κ, (n, 2), and their covariances, (n, 2, 2).
    heading, P_heading
        Of the heading as reported and its rate, (2,), (2, 2) [rad].
    """

    log_weight: Floats
    y: Floats
    z: Floats
    v: Floats
    w: Floats
    p: Floats
    g: Floats
    P_pg: Floats
    depth_bias: Floats
    depth_variance: float
    clock: Floats
    P_clock: Floats
    heading: Floats
    P_heading: Floats

    @property
    def weight(self) -> Floats:
        """Weights, with the sum 1; shape (n,)."""
        weight = np.exp(self.log_weight - self.log_weight.max())
        return np.asarray(weight / weight.sum())


_EACH = ("y", "z", "v", "w", "p", "g", "depth_bias", "clock", "P_clock")


def particle_filter(
    run: Result | str | Path,
    overrides: Overrides = (),
    *,
    particles: int = 50_000,
    seed: int = 1,
) -> Result:
    """Filter a finished run with particles, from what was received in it.

    Parameters
    ----------
    run
        A result, or the folder of one.
    overrides
        Keys of ``[receiver]`` of `coupled` to change; see `sblcosim.smooth`.
    particles
        How many. Too few die out: with many more, the error must stay.
    seed
        Of its random numbers; equal ones give equal bits.

    Returns
    -------
    Result
        The run, with ``particle_filter`` beside its receivers.

    Raises
    ------
    ConfigurationError
        There is no such run, packets have no pose of the platform, or an argument is wrong.

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
    estimates = filtered(p, samples, particles, seed)
    origin = outcome.origin_of(p, LABEL, particles=particles, seed=seed)
    return outcome.beside(result, LABEL, estimates, origin)


def filtered(p: Any, samples: Samples, particles: int, seed: int) -> Estimates:
    """The estimates at all epochs from the first fix on: mean and covariance of the posterior.

    Raises
    ------
    ConfigurationError
        There is no first fix, or packets have no pose of the platform.
    """
    if not samples.has_pose.all():
        raise ConfigurationError(
            "record: must have the platform's pose in all packets, for a particle filter, got own "
            "positions of beacons"
        )
    rng = np.random.default_rng(seed)
    depths, pose = dict(zip(samples.depth_ns.tolist(), samples.depth, strict=True)), _poses(
        p, samples
    )
    cloud: Cloud | None = None
    then, depth = samples.start_ns, None
    first = outcome.first_ns(p, samples)
    rows: list[tuple[Any, ...]] = []
    for epoch in samples.epochs_ns.tolist():
        heard = np.flatnonzero(samples.range_ns == epoch)
        depth = depths.get(epoch, depth)
        if cloud is not None:
            cloud = predicted(p, cloud, (epoch - then) / 1e9, rng)
            if epoch in depths:
                cloud = sounded(p, cloud, depths[epoch])
        for i in heard:
            if cloud is None:
                if depth is None:
                    break
                cloud = begun(p, samples, i, depth, (particles, rng))
            else:
                cloud = placed(p, cloud, samples.position[i], samples.attitude[i, 2])
            cloud = ranged(p, cloud, pose[i], p.beacon_offset[samples.beacon[i]], samples.range[i])
        then = epoch
        if cloud is None:
            continue
        if len(heard):
            down = samples.position[heard[-1], 2]
        if epoch >= first:
            rows.append((epoch, *moments(p, cloud, down)))
        cloud = resampled(cloud, rng)
    if not rows:
        raise ConfigurationError("record: must have a range and a depth, for a first fix, got none")
    return Estimates(np.array([r[0] for r in rows]), *map(np.array, list(zip(*rows))[1:]))


def _poses(p: Any, samples: Samples) -> list[Pose]:
    """The pose of each packet."""
    said = model.pose_of(p, samples)
    columns = (said.down, said.roll, said.pitch, said.tilt_variance)
    return [Pose(*row) for row in zip(*columns, strict=True)]


def begun(
    p: Any, samples: Samples, i: int, depth: float, chance: tuple[int, np.random.Generator]
) -> Cloud:
    """Particles at the first packet, before its range is used.

    With a prior x is drawn from it, and then tells of p, as y = x − p is drawn; else the bearing
    may be any, and the distance any that fits the range.
    """
    n, rng = chance
    dt = float(samples.range_ns[i] - samples.start_ns) / 1e9
    P_pg = _gaussian_update(
        np.diag([model.FAR_STD**2, p.gps_markov_std**2]), np.array([1.0, 1.0]), _gps_variance(p)
    )[1]
    place = samples.position[i]
    mean_p, mean_g = np.tile(place[:2], (n, 1)), np.zeros((n, 2))
    bias, bias_variance = np.zeros(n), p.depth_bias_std**2
    if p.initialisation == model.PRIOR:
        x, v, mean, variance = _from_prior(p, dt, n, rng)
        y = x[:, :2] - mean_p - np.sqrt(P_pg[0, 0]) * rng.standard_normal((n, 2))
        gain, P_pg = _gaussian_update(P_pg, np.array([1.0, 0.0]), variance)
        off = mean[:, :2] - y - mean_p
        mean_p, mean_g, z = mean_p + gain[0] * off, mean_g + gain[1] * off, x[:, 2]
    else:
        own = p.depth_std**2 + bias_variance
        z = depth + np.sqrt(own) * rng.standard_normal(n)
        bias, bias_variance = bias_variance / own * (depth - z), bias_variance * p.depth_std**2 / own
        v = p.prior_velocity_std * rng.standard_normal((n, 3))
        y = _anywhere(p, samples, i, z, rng)
    cloud = Cloud(
        np.zeros(n), y, z, v, p.platform_velocity_std * rng.standard_normal((n, 2)),
        mean_p, mean_g, P_pg, bias, bias_variance, np.zeros((n, 2)),
        np.tile(np.diag([p.clock_std**2, p.sound_speed_std**2]), (n, 1, 1)),
        np.array([samples.attitude[i, 2], 0.0]),
        np.diag([_heading_variance(p), p.heading_rate_std**2]),
    )
    return sounded(p, cloud, depth) if p.initialisation == model.PRIOR else cloud


def _from_prior(
    p: Any, dt: float, n: int, rng: np.random.Generator
) -> tuple[Floats, Floats, Floats, float]:
    """x and v a time after the start, and mean and variance of x given v."""
    _, Q = surroundings.transition(np, p, dt)
    speed, place = p.prior_velocity_std**2, p.prior_position_std**2
    vv, xv = speed + Q[VELOCITY[0], VELOCITY[0]], speed * dt + Q[POSITION[0], VELOCITY[0]]
    xx = place + speed * dt**2 + Q[POSITION[0], POSITION[0]]
    dv = np.sqrt(vv) * rng.standard_normal((n, 3))
    slope = xv / vv if vv > 0 else 0.0
    mean = p.prior_position + p.prior_velocity * dt + slope * dv
    variance = xx - slope * xv
    x = mean + np.sqrt(variance) * rng.standard_normal((n, 3))
    return x, p.prior_velocity + dv, mean, variance


def _anywhere(p: Any, samples: Samples, i: int, z: Floats, rng: np.random.Generator) -> Floats:
    """y about the beacon at any bearing, at distances about the range; shape (n, 2)."""
    n, r = len(z), samples.range[i]
    std = np.sqrt(p.range_std**2 + p.clock_std**2 + (p.sound_speed_std * r) ** 2)
    slant = r + _REACH * std * rng.uniform(-1, 1, n)
    arm = surroundings.arm_of(
        np, _state(heading=samples.attitude[i, 2]), Pose(0.0, 0.0, 0.0, 0.0),
        p.beacon_offset[samples.beacon[i]],
    )
    flat = np.sqrt(np.maximum(slant**2 - (z - samples.position[i, 2] - arm[2]) ** 2, 0))
    bearing = rng.uniform(-np.pi, np.pi, n)
    return np.asarray(np.column_stack([
        arm[0] + flat * np.cos(bearing), arm[1] + flat * np.sin(bearing)
    ]))


def _state(**known: Any) -> list[Any]:
    """The states of `surroundings`, 0 but for those given."""
    x: list[Any] = [0.0] * STATES
    x[HEADING] = known["heading"]
    return x


def _gps_variance(p: Any) -> float:
    return float(max(p.gps_std, LEAST_GPS_STD) ** 2)


def _heading_variance(p: Any) -> float:
    return float(surroundings.heading(np, p, _state(heading=0.0)).variance)


def _gaussian_update(P: Floats, h: Floats, R: float) -> tuple[Floats, Floats]:
    """Gain and covariance of a scalar measurement."""
    c = P @ h
    S = float(h @ c) + R
    gain = c / S if S > 0 else np.zeros_like(c)
    return gain, P - np.outer(gain, c)


def predicted(p: Any, cloud: Cloud, dt: float, rng: np.random.Generator) -> Cloud:
    """The particles a time dt [s] later."""
    phi, Q = surroundings.transition(np, p, dt)
    n = len(cloud.z)

    def drawn(i: int, j: int, axes: int) -> tuple[Floats, Floats]:
        """Noise of a state and of its rate."""
        a, b = rng.standard_normal((2, n, axes))
        first = np.sqrt(Q[j, j])
        slope = Q[i, j] / first if first > 0 else 0.0
        rest = np.sqrt(max(Q[i, i] - slope**2, 0.0))
        return slope * a + rest * b, first * a

    moved, faster = drawn(POSITION[0], VELOCITY[0], 3)
    x, v = cloud.v * dt + moved, cloud.v + faster
    w, p_moved = cloud.w, np.zeros((n, 2))
    if p.platform_velocity_std > 0:
        i, j = PLATFORM[0], PLATFORM_VELOCITY[0]
        swayed, w_noise = drawn(i, j, 2)
        p_moved, w = phi[i, j] * w + swayed, phi[j, j] * w + w_noise
    decay = phi[GPS_ERROR[0], GPS_ERROR[0]]
    F = np.diag([1.0, decay])
    turn = np.array([[1.0, phi[HEADING, HEADING_RATE]], [0.0, phi[HEADING_RATE, HEADING_RATE]]])
    pair = [HEADING, HEADING_RATE]
    noise = np.array([[Q[min(a, b), max(a, b)] for b in pair] for a in pair])
    noise[0, 0] += Q[HEADING_ERROR, HEADING_ERROR]
    P_clock = cloud.P_clock.copy()
    P_clock[:, 0, 0] += Q[CLOCK, CLOCK]
    return replace(
        cloud, y=cloud.y + x[:, :2] - p_moved, z=cloud.z + x[:, 2], v=v, w=w, p=cloud.p + p_moved,
        g=decay * cloud.g,
        P_pg=F @ cloud.P_pg @ F + np.diag([0.0, Q[GPS_ERROR[0], GPS_ERROR[0]]]),
        P_clock=P_clock, heading=turn @ cloud.heading,
        P_heading=turn @ cloud.P_heading @ turn.T + noise,
    )


def sounded(p: Any, cloud: Cloud, depth: float) -> Cloud:
    """A reading of the depth sensor."""
    S = cloud.depth_variance + p.depth_std**2
    off = depth - cloud.z - cloud.depth_bias
    gain = cloud.depth_variance / S
    return replace(
        cloud, log_weight=cloud.log_weight - 0.5 * off**2 / S,
        depth_bias=cloud.depth_bias + gain * off, depth_variance=(1 - gain) * cloud.depth_variance,
    )


def placed(p: Any, cloud: Cloud, place: Floats, heading: float) -> Cloud:
    """Reported position and heading of the platform."""
    both, R = np.array([1.0, 1.0]), _gps_variance(p)
    S = float(cloud.P_pg.sum()) + R
    gain, P_pg = _gaussian_update(cloud.P_pg, both, R)
    off = place[:2] - cloud.p - cloud.g
    turn, P_heading = _gaussian_update(cloud.P_heading, np.array([1.0, 0.0]), _heading_variance(p))
    angle = heading - cloud.heading[0]
    angle -= 2 * np.pi * np.floor((angle + np.pi) / (2 * np.pi))
    return replace(
        cloud, log_weight=cloud.log_weight - 0.5 * (off**2).sum(axis=1) / S,
        p=cloud.p + gain[0] * off, g=cloud.g + gain[1] * off, P_pg=P_pg,
        heading=cloud.heading + turn * angle, P_heading=P_heading,
    )


def ranged(p: Any, cloud: Cloud, pose: Pose, body: Floats, z: float) -> Cloud:
    """A range."""
    x = _state(heading=cloud.heading[0])
    x[0], x[1], x[2] = cloud.y[:, 0], cloud.y[:, 1], cloud.z
    x[CLOCK], x[SPEED] = cloud.clock.T
    row = surroundings.range_(np, p, x, pose, body)
    R = row.variance + row.row[HEADING] ** 2 * cloud.P_heading[0, 0]
    off = z - row.value
    c = cloud.P_clock[:, :, 0] + cloud.P_clock[:, :, 1] * row.distance[:, None]
    S = c[:, 0] + c[:, 1] * row.distance + R
    punctual, other = late.log_densities(p, off, S)
    total = np.logaddexp(punctual, other)
    share = np.exp(punctual - total)
    gain = c / S[:, None]
    spread = share * (1 - share) * off**2 - share * S
    return replace(
        cloud, log_weight=cloud.log_weight + total,
        clock=cloud.clock + (share * off)[:, None] * gain,
        P_clock=cloud.P_clock + spread[:, None, None] * gain[:, :, None] * gain[:, None, :],
    )


def resampled(cloud: Cloud, rng: np.random.Generator) -> Cloud:
    """Equal weights by systematic resampling, if less than half of the particles count."""
    weight = cloud.weight
    n = len(weight)
    if 1 / (weight**2).sum() > n / 2:
        return replace(cloud, log_weight=cloud.log_weight - cloud.log_weight.max())
    edges = np.cumsum(weight)
    picks = (np.arange(n) + rng.uniform()) / n * edges[-1]
    kept = np.minimum(np.searchsorted(edges, picks, side="right"), n - 1)
    taken = {name: getattr(cloud, name)[kept] for name in _EACH}
    return replace(cloud, log_weight=np.zeros(n), **taken)


def moments(p: Any, cloud: Cloud, down: float) -> tuple[Any, ...]:
    """The fields of `Estimates` beside the epoch."""
    weight = cloud.weight
    relative = np.column_stack([cloud.y, cloud.z - down])
    x = np.column_stack([cloud.y + cloud.p, cloud.z])
    state = np.stack([x, cloud.v], axis=2).reshape(len(weight), 6)
    # The slow error of the heading turns y; nothing tells it from a turn of the diver.
    turned = p.imu_heading_error_std * (weight @ cloud.y)[::-1] * [-1, 1]
    more = np.zeros((6, 6))
    more[np.ix_([0, 2], [0, 2])] = np.outer(turned, turned)
    more[[0, 2], [0, 2]] += cloud.P_pg[0, 0] + p.gps_bias_std**2
    about = np.zeros((3, 3))
    about[:2, :2] = np.outer(turned, turned)
    about[2, 2] = p.gps_vertical_std**2
    beta, kappa = weight @ cloud.clock
    c = p.assumed_sound_speed
    return (
        weight @ x, weight @ cloud.v, _covariance(weight, state) + more, weight @ relative,
        _covariance(weight, relative) + about, np.append(weight @ cloud.p, down),
        beta / c, c / (1 + kappa),
    )


def _covariance(weight: Floats, values: Floats) -> Floats:
    off = values - weight @ values
    return np.asarray((weight[:, None] * off).T @ off)
