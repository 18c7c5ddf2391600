"""The model of `coupled`: the diver, the platform, and the errors of their sensors.

Formulas on scalars, written once for two uses: ``m`` is the module ``casadi`` for the component and
``numpy`` for bounds and smoothers, where a scalar may also be an array. ``p`` has the parameters of
`sblcosim.models.receiver.receivers.coupled.COMPONENT` as attributes. ``x`` is a sequence of
`STATES` scalars. A row of H maps indices of states to derivatives.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..symbols import absolute

POSITION, VELOCITY = (0, 1, 2), (3, 4, 5)
"""x [m] and v [m/s] of the diver, NED."""
PLATFORM, PLATFORM_VELOCITY, GPS_ERROR = (6, 7), (8, 9), (10, 11)
"""p [m], w [m/s] and g [m]: the platform, north and east, and the coloured error of its GPS."""
HEADING, HEADING_RATE, HEADING_ERROR = 12, 13, 14
"""ψ [rad], its rate [rad/s], and e_ψ [rad]: the coloured error of the IMU's heading."""
CLOCK, SPEED, DEPTH_BIAS = 15, 16, 17
"""β [m]: the clock's offset times c₀; κ = c₀/c − 1; d [m]: error of the depth sensor."""
VERTICAL_ERROR = 18
"""g_z [m]: the slow error of the GPS, down."""
STATES = 19
LEAST_GPS_STD = 0.01
"""Smallest standard deviation of a GPS [m]: packets are rounded."""
LEAST_HEADING_STD = 1e-3
"""Smallest standard deviation of a heading [rad]."""
LEAST_SOUNDING_STD = 1e-3
"""Smallest standard deviation of a range or depth [m]; much less would be lost in rounding of P."""

Row = Mapping[int, Any]


@dataclass(frozen=True, slots=True)
class Measurement:
    """A scalar measurement at a state.

    Attributes
    ----------
    value
        h(x), in m or rad.
    row
        ∂h/∂x by the index of the state.
    variance
        Variance of its white noise.
    """

    value: Any
    row: Row
    variance: Any


@dataclass(frozen=True, slots=True)
class Pose:
    """What a packet says about the platform and the filter does not estimate.

    Attributes
    ----------
    down
        Reported position of the reference point, down [m]; the true one is less by g_z.
    roll, pitch
        Best estimates from the reported ones [rad]; see `tilt`.
    tilt_variance
        Variance of each [rad²].
    own
        Whether only the beacon's own position is reported: 0 or 1. Then roll, pitch and
        `tilt_variance` are 0: what tilt does to the beacon is in `down` and `swing`.
    swing, swing_variance
        How far tilt moves the beacon, north and east [m], if `own`, and the variance of each [m²].
    """

    down: Any
    roll: Any
    pitch: Any
    tilt_variance: Any
    own: Any = 0.0
    swing: Sequence[Any] = (0.0, 0.0)
    swing_variance: Any = 0.0


@dataclass(frozen=True, slots=True)
class Range(Measurement):
    """A range, with the terms of its second order.

    Attributes
    ----------
    u
        (1 + κ) o/ρ: derivative with respect to the diver's position.
    arm
        ℓ, from the platform's reference point to the beacon, NED [m].
    distance
        ρ [m].
    tilts
        Negative derivatives with respect to roll and pitch [m].
    """

    u: Sequence[Any]
    arm: Sequence[Any]
    distance: Any
    tilts: Sequence[Any]


def prior_stds(p: Any) -> dict[int, Any]:
    """Standard deviations before any measurement, of the states that have one."""
    return {
        **dict.fromkeys(PLATFORM_VELOCITY, p.platform_velocity_std),
        **dict.fromkeys(GPS_ERROR, p.gps_markov_std),
        HEADING_RATE: p.heading_rate_std,
        HEADING_ERROR: p.imu_heading_error_std,
        VERTICAL_ERROR: p.gps_vertical_error_std,
        CLOCK: p.clock_std,
        SPEED: p.sound_speed_std,
        DEPTH_BIAS: p.depth_bias_std,
    }


Elements = dict[tuple[int, int], Any]
"""Elements of a matrix by row and column."""


def white_acceleration(
    q: Any, dt: Any, position: Sequence[int], velocity: Sequence[int]
) -> tuple[Elements, Elements]:
    """Φ without its ones, and the upper triangle of Q, of a diver with white acceleration.

    Parameters
    ----------
    q
        Power spectral density per axis [m²/s³].
    position, velocity
        Indices of the states.
    """
    phi: Elements = {}
    Q: Elements = {}
    dt2 = dt * dt
    for i, j in zip(position, velocity, strict=True):
        phi[i, j] = dt
        Q[i, i], Q[i, j], Q[j, j] = q * dt2 * dt / 3, q * dt2 / 2, q * dt
    return phi, Q


def transition(m: Any, p: Any, dt: Any) -> tuple[dict[tuple[int, int], Any], ...]:
    """Φ without its ones, and the upper triangle of Q, over ``dt`` [s], by row and column."""
    diver = white_acceleration(p.acceleration_psd, dt, POSITION, VELOCITY)
    return tuple({**a, **b} for a, b in zip(diver, around(m, p, dt), strict=True))


def around(m: Any, p: Any, dt: Any) -> tuple[dict[tuple[int, int], Any], ...]:
    """The part of `transition` that is not the diver's."""
    phi: Elements = {}
    Q: Elements = {}
    for pairs, std, tau in (
        (zip(PLATFORM, PLATFORM_VELOCITY, strict=True), p.platform_velocity_std,
         p.platform_velocity_time),
        (((HEADING, HEADING_RATE),), p.heading_rate_std, p.heading_rate_time),
    ):
        # Ornstein-Uhlenbeck: the rate is a Gauss-Markov process, gone = 1 - exp(-dt/tau).
        gone = 1 - m.exp(-dt / tau)
        far = tau * gone
        noise = 2 * std**2 / tau
        for i, j in pairs:
            phi[i, j], phi[j, j] = far, 1 - gone
            Q[i, i] = noise * tau**2 * m.fmax(dt - far - far * gone / 2, 0)
            Q[i, j] = noise * far**2 / 2
            Q[j, j] = noise * far * (1 - gone / 2)
    for states, std, tau in (
        (GPS_ERROR, p.gps_markov_std, p.gps_correlation_time),
        ((HEADING_ERROR,), p.imu_heading_error_std, p.imu_heading_error_time),
        ((VERTICAL_ERROR,), p.gps_vertical_error_std, p.gps_vertical_error_time),
    ):
        decay = m.exp(-dt / tau)
        for i in states:
            phi[i, i], Q[i, i] = decay, std**2 * (1 - decay**2)
    Q[CLOCK, CLOCK] = p.clock_walk_psd * dt
    return phi, Q


def drift(
    p: Any, phi: Mapping[tuple[int, int], Any], noise: Mapping[tuple[int, int], Any]
) -> tuple[Any, Any, Any]:
    """Variances by which a transition moves p + g, each part [m²], ψ + e_ψ [rad²] and g_z [m²].

    The platform and the errors are assumed to be stationary.
    """
    def wandered(error: int, std: Any) -> Any:
        return noise[error, error] + ((1 - phi[error, error]) * std) ** 2

    def moved(i: int, rate: int, std: Any) -> Any:
        return noise[i, i] + (phi[i, rate] * std) ** 2

    return (
        moved(PLATFORM[0], PLATFORM_VELOCITY[0], p.platform_velocity_std)
        + wandered(GPS_ERROR[0], p.gps_markov_std),
        moved(HEADING, HEADING_RATE, p.heading_rate_std)
        + wandered(HEADING_ERROR, p.imu_heading_error_std),
        wandered(VERTICAL_ERROR, p.gps_vertical_error_std),
    )


NEAREST = 1.0
"""Nearer to the platform than this many m, there is no arc."""
WIDEST = 2.0
"""Largest variance of a bearing [rad²]: beyond it, the bearing is unknown."""


def crescent(m: Any, radius: Any, spread: Any, depth: Any) -> tuple[Any, Any, Any]:
    """Moments of a position with a known distance and a normal bearing: a banana.

    Parameters
    ----------
    radius
        Distance from the platform [m].
    spread, depth
        Variances of the bearing, at most `WIDEST` [rad²], and of the distance [m²].

    Returns
    -------
    kept, along, across
        The mean of y is ``kept`` y. Its covariance grows by these shares of ``radius``², towards
        the platform and at right angles to it.
    """
    # The part of the bearing's variance that the distance does not explain.
    s = spread * m.fmin(m.fmax(1 - depth / m.fmax(spread * radius**2, 1e-12), 0), 1)
    once, twice = m.exp(-s / 2), m.exp(-2 * s)
    return once, 0.5 * (1 + twice) - m.exp(-s), 0.5 * (1 - twice) - s


def sounding_variance(std: Any, least: float = LEAST_SOUNDING_STD) -> Any:
    """Variance of a range or depth for a standard deviation, not below the least one [m²]."""
    return (0.5 * (std + least + absolute(std - least))) ** 2


def depth(p: Any, x: Sequence[Any]) -> Measurement:
    """A reading of the depth sensor."""
    variance = sounding_variance(p.depth_std)
    return Measurement(x[2] + x[DEPTH_BIAS], {2: 1, DEPTH_BIAS: 1}, variance)


def heading(m: Any, p: Any, x: Sequence[Any]) -> Measurement:
    """A reported heading; innovations must be wrapped."""
    std = m.fmax(p.imu_heading_std, LEAST_HEADING_STD)
    return Measurement(x[HEADING] + x[HEADING_ERROR], {HEADING: 1, HEADING_ERROR: 1}, std**2)


def places(
    m: Any, p: Any, x: Sequence[Any], body: Sequence[Any], spread: Any = 0.0
) -> tuple[Measurement, ...]:
    """Reported north and east of a point on the platform.

    Parameters
    ----------
    body
        The point in the body frame [m]; (0, 0, 0) for the reference point.
    spread
        Variance of the heading that rotates it [rad²]. The rows are the best linear approximation
        over that spread. The variance includes the remainder.
    """
    angle = x[HEADING] + x[HEADING_ERROR]
    c, s = m.cos(angle), m.sin(angle)
    arm = (c * body[0] - s * body[1], s * body[0] + c * body[1])
    turns = (-arm[1], arm[0])
    once, twice = m.exp(-spread / 2), m.exp(-2 * spread)
    along = 0.5 * (1 + twice) - once * once
    across = 0.5 * (1 - twice) - spread * once * once
    variance = m.fmax(p.gps_std, LEAST_GPS_STD) ** 2 + (body[2] * p.imu_tilt_std) ** 2
    return tuple(
        Measurement(
            x[PLATFORM[i]] + x[GPS_ERROR[i]] + once * arm[i],
            {PLATFORM[i]: 1, GPS_ERROR[i]: 1, HEADING: once * turn, HEADING_ERROR: once * turn},
            variance + along * arm[i] ** 2 + across * turn**2,
        )
        for i, turn in enumerate(turns)
    )


def tilt(p: Any, reported: Any) -> tuple[Any, Any]:
    """Best estimate of a roll or pitch from the reported one, and its variance [rad²]."""
    own, white = p.tilt_std**2, p.imu_tilt_std**2
    trust = own / (own + white + 1e-12)
    return trust * reported, trust * white


def arm_of(m: Any, x: Sequence[Any], pose: Pose, body: Sequence[Any]) -> tuple[Any, Any, Any]:
    """ℓ = R_z(ψ) R_y(pitch) R_x(roll) b, NED [m]."""
    return _arms(m, x, pose, body)[0]


def _arms(
    m: Any, x: Sequence[Any], pose: Pose, body: Sequence[Any]
) -> tuple[tuple[Any, Any, Any], ...]:
    """ℓ and its derivatives with respect to roll and pitch."""
    (cr, sr), (cp, sp), (cy, sy) = (
        (m.cos(a), m.sin(a)) for a in (pose.roll, pose.pitch, x[HEADING])
    )
    lateral, lower = body[1] * cr - body[2] * sr, body[1] * sr + body[2] * cr
    tilted = (body[0] * cp + lower * sp, lateral, lower * cp - body[0] * sp)
    by_roll, by_pitch = (lateral * sp, -lower, lateral * cp), (tilted[2], 0, -tilted[0])
    return tuple(
        (cy * v[0] - sy * v[1], sy * v[0] + cy * v[1], v[2]) for v in (tilted, by_roll, by_pitch)
    )


def range_(
    m: Any, p: Any, x: Sequence[Any], pose: Pose, body: Sequence[Any],
    least: float = LEAST_SOUNDING_STD,
) -> Range:
    """A range to a beacon.

    Parameters
    ----------
    body
        Nominal position of the beacon in the body frame [m].
    least
        Smallest standard deviation of a range [m].
    """
    arm, by_roll, by_pitch = _arms(m, x, pose, body)
    o = (x[0] - x[PLATFORM[0]] - arm[0] - pose.swing[0],
         x[1] - x[PLATFORM[1]] - arm[1] - pose.swing[1],
         x[2] - pose.down + x[VERTICAL_ERROR] - arm[2])
    distance = m.sqrt(m.fmax(o[0] * o[0] + o[1] * o[1] + o[2] * o[2], 1e-12))
    stretch = 1 + x[SPEED]
    per_metre = stretch / distance
    u = tuple(per_metre * a for a in o)

    tilts = tuple(u[0] * v[0] + u[1] * v[1] + u[2] * v[2] for v in (by_roll, by_pitch))
    slope = sum(v**2 for v in tilts)
    lifted = pose.own * (body[0] ** 2 + body[1] ** 2) * p.imu_tilt_std**2
    return Range(
        value=stretch * distance + x[CLOCK],
        row={
            **dict(enumerate(u)),
            **{i: -u[n] for n, i in enumerate(PLATFORM)},
            HEADING: u[0] * arm[1] - u[1] * arm[0],
            CLOCK: 1,
            SPEED: distance,
            VERTICAL_ERROR: u[2],
        },
        variance=sounding_variance(p.range_std, least) + pose.tilt_variance * slope
        + (u[0] ** 2 + u[1] ** 2) * pose.swing_variance
        + u[2] ** 2 * (p.gps_vertical_std**2 + lifted),
        u=u,
        arm=arm,
        distance=distance,
        tilts=tilts,
    )
