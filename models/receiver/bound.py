"""How well a receiver can do according to its own model: the equations of a bound.

A bound needs the rows of the measurements at the true states, their variances, the transition and
the prior. They come from `surroundings` and `field`, as formulas on scalars: ``m`` is the module
``casadi`` for the C of `sblcosim.fmus.build.bound_source`. ``p`` has the parameters of a receiver
and `SITUATION` as attributes, ``s`` has `SURROUNDINGS`, each a sequence. States from ``states`` on
belong to one beacon, and each beacon has a copy of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, Literal

from . import field, ping, surroundings, waves
from .surroundings import Elements, Measurement, Pose

FAR_STD = 30.0
"""Standard deviation of a position before any measurement [m]. That of a diver who is more than
twice as far away is larger: it would count as a measurement there."""
ANYWHERE = 10.0
"""Standard deviation of a heading before any measurement [rad]."""
_LEAST_STD = 1e-6
"""No sensor is more accurate than this [m]: information must be finite."""

SURROUNDINGS: Mapping[str, int] = {"position": 3, "platform": 3, "attitude": 3, "beacon": 3}
"""True values at an epoch, and their lengths: positions of diver and platform, NED [m], roll,
pitch, yaw [rad], and the position of one beacon, in the body frame or, for `FIELD`, NED [m]."""
SITUATION = ("pings", "speed", "own_beacon", "known_start")
"""What is not a parameter of a receiver: the number of pings that an epoch stands for, for `ARRAY`,
which the recursion sets to its number of packets; κ; whether packets hold the position of their own
beacon and nothing else; whether the start is known with the receiver's prior."""


Matrix = list[list[Any]]


@dataclass(frozen=True, slots=True)
class Row:
    """A scalar measurement.

    Attributes
    ----------
    of
        ``of(m, p, s)``, at the true states.
    counts
        What its number of measurements follows: readings of the depth, packets of any beacon, or
        packets of each beacon. The last kind is measured for each beacon.
    own_beacon
        True: only if packets hold nothing but their own beacon's position; False: only if they hold
        more; None: always.
    """

    of: Callable[[Any, Any, Any], Measurement]
    counts: Literal["readings", "packets", "beacons"]
    own_beacon: bool | None = None


@dataclass(frozen=True, slots=True)
class Bound:
    """The equations of one model.

    Attributes
    ----------
    parameters
        Names of the receiver's parameters that it uses. The diver's own come first.
    states, each
        Number of states without beacons, and number of states per beacon.
    prior_stds
        ``prior_stds(m, p, s)``, by index of the state, with the true values at the first epoch. All
        other states are known at the start.
    transition
        ``transition(m, p, dt)``: Φ without its ones, and the upper triangle of Q.
    marginals
        ``marginals(p, P)``: covariances of the diver's position, absolute and relative, as rows.
    """

    parameters: Sequence[str]
    states: int
    each: int
    prior_stds: Callable[[Any, Any, Any], Mapping[int, Any]]
    transition: Callable[[Any, Any, Any], tuple[Elements, ...]]
    rows: Sequence[Row]
    marginals: Callable[[Any, Any], tuple[Matrix, Matrix]]


_DIVER = (
    "acceleration_psd", "range_std", "depth_std", "prior_position_std", "prior_velocity_std",
    "clock_std", "clock_walk_psd", "sound_speed_std", "depth_bias_std",
)  # fmt: skip


def least(m: Any, measurement: Measurement) -> Any:
    """Variance of a measurement, or of the most accurate sensor possible [m² or rad²]."""
    return m.fmax(measurement.variance, _LEAST_STD**2)


def _either(condition: Any, one: Any, other: Any) -> Any:
    """The first number where the condition is 1, the second where it is 0."""
    return condition * one + (1 - condition) * other


def _start(
    m: Any, p: Any, s: Any, position: Sequence[int], velocity: Sequence[int]
) -> dict[int, Any]:
    away = sum((a - b) ** 2 for a, b in zip(s.position, s.platform, strict=True))
    far = m.fmax(m.sqrt(away) - FAR_STD, FAR_STD)
    place = _either(p.known_start, p.prior_position_std, far)
    return dict.fromkeys(position, place) | dict.fromkeys(velocity, p.prior_velocity_std)


# --- The platform and its sensors: `surroundings` and `waves` ------------------------------------


def _of_platform(p: Any, s: Any) -> list[Any]:
    x: list[Any] = [0.0] * waves.STATES
    x[:3], x[6:8] = s.position, s.platform[:2]
    x[surroundings.HEADING], x[surroundings.SPEED] = s.attitude[2], p.speed
    return x


def _pose(p: Any, s: Any) -> Pose:
    """The tilt is unknown if packets hold only their own beacon's position."""
    own = p.own_beacon
    roll, pitch = (_either(own, 0.0, angle) for angle in s.attitude[:2])
    return Pose(
        s.platform[2], roll, pitch, _either(own, 0.0, surroundings.tilt(p, 0.0)[1]), own
    )


def _down(m: Any, p: Any, s: Any) -> Measurement:
    return waves.down(m, p, _of_platform(p, s), p.own_beacon, s.beacon)


def _place(axis: int, of_beacon: bool) -> Callable[[Any, Any, Any], Measurement]:
    def row(m: Any, p: Any, s: Any) -> Measurement:
        body = s.beacon if of_beacon else (0.0, 0.0, 0.0)
        return waves.places(m, p, _of_platform(p, s), body)[axis]

    return row


def _range(m: Any, p: Any, s: Any) -> Measurement:
    return waves.range_(m, p, _of_platform(p, s), _pose(p, s), s.beacon)


def _platform_marginals(p: Any, P: Any) -> tuple[Matrix, Matrix]:
    """Covariances of x and of x − p. The constant GPS error, which is no state, enters the absolute
    one.
    """
    north, east = surroundings.PLATFORM
    difference = [[(0, 1), (north, -1)], [(1, 1), (east, -1)], [(2, 1), (waves.HEAVE, -1)]]
    absolute = [[P[i, j] for j in range(3)] for i in range(3)]
    relative = [
        [sum(a * b * P[i, j] for i, a in one for j, b in other) for other in difference]
        for one in difference
    ]
    for i in (0, 1):
        absolute[i][i] += p.gps_bias_std**2
    return absolute, relative


PLATFORM = Bound(
    parameters=(
        *_DIVER, "gps_std", "gps_markov_std", "gps_correlation_time", "gps_bias_std",
        "gps_vertical_std", "gps_vertical_error_std", "gps_vertical_error_time",
        "platform_velocity_std", "platform_velocity_time", "heading_rate_std", "heading_rate_time",
        "heave_std", "heave_time", "tilt_std", "tilt_time", "imu_heading_std",
        "imu_heading_error_std", "imu_heading_error_time", "imu_tilt_std",
    ),
    states=waves.STATES,
    each=0,
    prior_stds=lambda m, p, s: {
        **waves.prior_stds(p), **_start(m, p, s, surroundings.POSITION, surroundings.VELOCITY),
        **dict.fromkeys(surroundings.PLATFORM, FAR_STD), surroundings.HEADING: ANYWHERE,
    },
    transition=waves.transition,
    rows=(
        Row(lambda m, p, s: surroundings.depth(p, _of_platform(p, s)), "readings"),
        Row(_place(0, False), "packets", False),
        Row(_place(1, False), "packets", False),
        Row(lambda m, p, s: surroundings.heading(m, p, _of_platform(p, s)), "packets", False),
        Row(_down, "packets", False),
        Row(_down, "beacons", True),
        Row(_place(0, True), "beacons", True),
        Row(_place(1, True), "beacons", True),
        Row(_range, "beacons"),
    ),
    marginals=_platform_marginals,
)  # fmt: skip


# --- An array that hears one ping: `ping` ---------------------------------------------------------

_PING = ping.Ping(waves.STATES)


def _of_array(p: Any) -> Any:
    return SimpleNamespace(**vars(p) | {"imu_tilt_std": p.imu_tilt_noise_std})


def _array_row(of: Callable[[Any, Any, Any], Measurement]) -> Callable[..., Measurement]:
    return lambda m, p, s: of(m, _of_array(p), s)


def _arrival(m: Any, p: Any, s: Any) -> Measurement:
    p = _of_array(p)
    x = [*_of_platform(p, s), *[0.0] * ping.STATES]
    # Where packets hold no pose, their tilt is that of the waves, as without a ping.
    pose, lever = _pose(p, s), p.own_beacon * s.beacon[2]
    row = _PING.range_(m, p, x, pose, s.beacon)
    swing = {i: -lever * row.u[n] for n, i in enumerate(waves.SWING)}
    return replace(row, row={**row.row, **swing})


def _array_prior(m: Any, p: Any, s: Any) -> Mapping[int, Any]:
    known = PLATFORM.prior_stds(m, p, s)
    untimed = _either(p.known_start, p.prior_position_std, ping.UNTIMED_STD)
    place = _either(p.common_clock, known[0], m.fmax(known[0], untimed))
    return {
        **known, **dict.fromkeys(surroundings.POSITION, place), **_PING.prior_stds(m, p),
    }


def _array_transition(m: Any, p: Any, dt: Any) -> tuple[Elements, ...]:
    p = _of_array(p)
    both = zip(waves.transition(m, p, dt), _PING.transition(m, p, dt, p.pings), strict=True)
    return tuple({**one, **other} for one, other in both)


ARRAY = Bound(
    parameters=(
        *(name for name in PLATFORM.parameters if name != "imu_tilt_std"),
        "assumed_sound_speed", "range_common_std", "common_clock", "imu_tilt_noise_std",
        "imu_tilt_error_std",
    ),
    states=waves.STATES + ping.STATES,
    each=0,
    prior_stds=lambda m, p, s: _array_prior(m, _of_array(p), s),
    transition=_array_transition,
    rows=tuple(
        replace(row, of=_arrival if row.of is _range else _array_row(row.of))
        for row in PLATFORM.rows
    ),
    marginals=_platform_marginals,
)


# --- Beacons with errors of their own: `field` ---------------------------------------------------


def _one_beacon(p: Any) -> Any:
    return SimpleNamespace(**vars(p) | {"beacons": 1})


def _of_field(p: Any, s: Any) -> list[Any]:
    x: list[Any] = [0.0] * field.states(1)
    for state, value in zip(field.POSITION, s.position, strict=True):
        x[state] = value
    x[field.SPEED] = p.speed
    return x


def _field_range(m: Any, p: Any, s: Any) -> Measurement:
    return field.range_(m, _one_beacon(p), _of_field(p, s), s.beacon, [1.0])


def _field_marginals(p: Any, P: Any) -> tuple[Matrix, Matrix]:
    """Without a platform, relative and absolute positions are the same."""
    place = [[P[i, j] for j in field.POSITION] for i in field.POSITION]
    return place, place


FIELD = Bound(
    parameters=(
        *_DIVER, "beacon_error_std", "beacon_vertical_error_std", "beacon_error_time",
        "beacon_noise_std", "beacon_vertical_noise_std",
    ),
    states=field.states(0),
    each=field.states(1) - field.states(0),
    prior_stds=lambda m, p, s: (
        field.prior_stds(_one_beacon(p)) | _start(m, p, s, field.POSITION, field.VELOCITY)
    ),
    transition=lambda m, p, dt: field.transition(m, _one_beacon(p), dt),
    rows=(
        Row(lambda m, p, s: field.depth(p, _of_field(p, s)), "readings"),
        Row(_field_range, "beacons"),
    ),
    marginals=_field_marginals,
)  # fmt: skip

BOUNDS: Mapping[str, Bound] = {"platform": PLATFORM, "field": FIELD, "array": ARRAY}
"""All models, in the order of their numbers."""
