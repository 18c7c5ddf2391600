"""What a receiver may assume about the system: parameters of `coupled` from a scenario's values.

``models/receiver/README.md`` has a table of their sources.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from ..acoustics.contents import PLACED
from ..acoustics.ranging import INVERTED, legs
from ..acoustics.schedules import schedule_of
from ..receiver.variables import SLOWEST_TILT
from ..symbols import absolute
from . import boat
from .beacons import beacons_of
from .echoes import late, mean_excess, share
from .either import (
    both,
    clipped,
    degrees,
    greatest,
    hypot,
    ratio,
    sqrt,
    square,
    symbolic,
    total,
    where,
)
from .keys import OF_RECEIVERS, start_of, within
from .motion import is_sine, of_mooring, of_sines, of_waves
from .names import branching
from .packets import pose_source

_ROOT_2, _ROOT_12 = math.sqrt(2), math.sqrt(12)
_DRIFT_MEMORY = 100.0
"""In this time [s], a clock with drift δ₁ strays as far as the random walk of `clock_walk_psd`."""
_LEAST_OUTLIER_PROBABILITY = 0.01
_STILL = 1e6
"""Correlation time [s] of what does not move."""
_MOUNTING_MEMORY = 10.0
"""An error of a beacon's position counts as noise that would be as large after averaging over twice
this time [s]. Measured: see ``models/receiver/README.md``."""
_PACKET = ("acoustics.packet_content", "acoustics.packet_resolution_m")
_ANGLES = (*_PACKET, "acoustics.packet_angle_resolution_deg")
_WAVES = (
    "platform.motion", "platform.wave_height_m", "platform.wave_period_s",
    "platform.wave_peak_enhancement", "platform.raft_size_m", "platform.raft_draught_m",
)
_DELAY = (
    "acoustics.turnaround_beacon_std_s", "acoustics.ranging", "acoustics.assumed_sound_speed_m_s",
)
_TRACK = ("platform.track_count", "platform.track_time_s")
_MOORING = ("platform.watch_circle_m", "platform.mooring_time_s")

SOURCES: Mapping[str, Sequence[str]] = {
    "beacon_offset_m": (
        "platform.beacon_m", "platform.arm_length_m", "platform.beacon_depth_m",
        "platform.beacon_scale",
    ),
    "pose_source": ("acoustics.packet_content",),
    "gps_std_m": ("platform.gps_horizontal_std_m", *_PACKET),
    "gps_markov_std_m": ("platform.gps_horizontal_markov_std_m",),
    "gps_correlation_time_s": ("platform.gps_correlation_time_s",),
    "gps_bias_std_m": ("platform.gps_horizontal_bias_std_m", "platform.gps_antenna_offset_m"),
    "gps_vertical_std_m": ("platform.gps_vertical_std_m", *_PACKET),
    "gps_vertical_error_std_m": (
        "platform.gps_vertical_markov_std_m", "platform.gps_vertical_bias_std_m",
        "platform.gps_antenna_offset_m",
    ),
    "gps_vertical_error_time_s": (
        "platform.gps_vertical_markov_std_m", "platform.gps_vertical_bias_std_m",
        "platform.gps_antenna_offset_m", "platform.gps_correlation_time_s",
    ),
    "platform_velocity_std_m_s": (
        "platform.surge_amplitude_m", "platform.surge_frequency_Hz", "platform.sway_amplitude_m",
        "platform.sway_frequency_Hz",
        *_WAVES, *_MOORING, "platform.boat_speed_m_s", *_TRACK, "platform.track_m",
    ),
    "platform_velocity_time_s": (
        "platform.surge_amplitude_m", "platform.surge_frequency_Hz", "platform.sway_amplitude_m",
        "platform.sway_frequency_Hz",
        *_WAVES, *_MOORING, "platform.boat_speed_m_s", *_TRACK, "platform.track_m",
    ),
    "heading_rate_std_deg_s": (
        "platform.yaw_amplitude_deg", "platform.yaw_frequency_Hz", *_TRACK,
        "platform.track_heading_deg",
    ),
    "heading_rate_time_s": (
        "platform.yaw_amplitude_deg", "platform.yaw_frequency_Hz", *_TRACK,
        "platform.track_heading_deg",
    ),
    "heave_std_m": (
        "platform.heave_amplitude_m", "platform.mean_position_m", *_WAVES,
    ),
    "heave_time_s": (
        "platform.heave_amplitude_m", "platform.heave_frequency_Hz", "platform.mean_position_m",
        *_WAVES,
    ),
    "tilt_std_deg": ("platform.roll_amplitude_deg", "platform.pitch_amplitude_deg", *_WAVES),
    "tilt_time_s": (
        "platform.roll_amplitude_deg", "platform.roll_frequency_Hz",
        "platform.pitch_amplitude_deg", "platform.pitch_frequency_Hz", *_WAVES,
    ),
    "imu_heading_std_deg": ("platform.imu_heading_std_deg", *_ANGLES),
    "imu_heading_error_std_deg": (
        "platform.imu_heading_bias_deg", "platform.imu_heading_turn_on_std_deg",
        "platform.imu_heading_step_deg", "platform.imu_heading_markov_std_deg",
        "platform.misalignment_heading_std_deg",
    ),
    "imu_heading_error_time_s": (
        "platform.imu_heading_bias_deg", "platform.imu_heading_turn_on_std_deg",
        "platform.imu_heading_step_deg", "platform.imu_heading_markov_std_deg",
        "platform.misalignment_heading_std_deg", "platform.imu_correlation_time_s",
    ),
    "imu_tilt_std_deg": (
        "platform.imu_tilt_std_deg", "platform.imu_tilt_bias_deg",
        "platform.imu_tilt_turn_on_std_deg", "platform.imu_tilt_markov_std_deg",
        "platform.misalignment_tilt_std_deg", *_ANGLES,
    ),
    "imu_tilt_noise_std_deg": ("platform.imu_tilt_std_deg", *_ANGLES),
    "imu_tilt_error_std_deg": (
        "platform.imu_tilt_bias_deg", "platform.imu_tilt_turn_on_std_deg",
        "platform.imu_tilt_markov_std_deg", "platform.misalignment_tilt_std_deg",
        "platform.imu_tilt_std_deg", "platform.roll_amplitude_deg",
        "platform.pitch_amplitude_deg", *_WAVES, *_ANGLES,
    ),
    "range_common_std_m": (
        "acoustics.range_common_std_m", "acoustics.ranging", "acoustics.common_clock",
    ),
    "arrivals_shared": ("acoustics.arrivals_shared",),
    "common_clock": ("acoustics.common_clock", "acoustics.ranging"),
    "outlier_probability": (
        "acoustics.outlier_probability", "acoustics.outlier_mean_m", "acoustics.loss_probability",
        "acoustics.surface_echo_probability", "acoustics.bottom_echo_probability",
        "acoustics.water_depth_m", "acoustics.ranging", "acoustics.shadow_loss_probability",
        "acoustics.shadow_half_width_deg",
    ),
    "outlier_mean_m": (
        "acoustics.outlier_mean_m", "acoustics.outlier_probability", "acoustics.loss_probability",
        "acoustics.surface_echo_probability", "acoustics.bottom_echo_probability",
        "acoustics.water_depth_m", "acoustics.ranging", "platform.beacon_m",
        "platform.arm_length_m", "platform.beacon_depth_m", "platform.beacon_scale",
        "platform.mean_position_m", "platform.mean_heading_deg", "target.trajectory",
        "acoustics.shadow_loss_probability", "acoustics.shadow_half_width_deg",
    ),
    "assumed_sound_speed_m_s": ("acoustics.assumed_sound_speed_m_s",),
    "clock_std_m": (
        "acoustics.clock_offset_s", "acoustics.clock_offset_std_s", "acoustics.clock_drift_s_s",
        "acoustics.clock_drift_std_s_s", "acoustics.clock_sync_age_s",
        "acoustics.processing_delay_s", "acoustics.processing_delay_correction_s",
        "acoustics.assumed_sound_speed_m_s", "acoustics.ranging", "acoustics.common_clock",
        "acoustics.turnaround_bias_std_s",
    ),
    "clock_walk_psd_m2_s": (
        "acoustics.clock_drift_s_s", "acoustics.clock_drift_std_s_s",
        "acoustics.assumed_sound_speed_m_s", "acoustics.ranging", "acoustics.common_clock",
    ),
    "sound_speed_std": ("acoustics.sound_speed_m_s", "acoustics.assumed_sound_speed_m_s"),
    "depth_bias_std_m": ("target.depth_bias_m", "target.depth_bias_std_m"),
    "beacon_error_std_m": (
        "platform.gps_horizontal_bias_std_m", "platform.gps_horizontal_markov_std_m",
        "platform.mounting_std_m", "platform.gps_shared", *_DELAY,
    ),
    "beacon_vertical_error_std_m": (
        "platform.gps_vertical_bias_std_m", "platform.gps_vertical_markov_std_m",
        "platform.mounting_std_m", "platform.gps_shared", *_DELAY,
    ),
    "beacon_error_time_s": (
        "platform.gps_correlation_time_s", "platform.gps_horizontal_markov_std_m",
    ),
    "beacon_noise_std_m": (
        "platform.gps_horizontal_std_m", "acoustics.packet_resolution_m",
    ),
    "beacon_vertical_noise_std_m": (
        "platform.gps_vertical_std_m", "acoustics.packet_resolution_m",
    ),
}
"""Keys of ``[receiver]``, and the keys that determine each of them.

The first of these keys' tables decides whether the value is known for a component of others.
``target.trajectory`` stands for all keys of the path.
"""
PARAMETERS = frozenset(OF_RECEIVERS[key].name for key in SOURCES)
"""Names of the parameters of these keys."""


def assumed(
    target: Any, platform: Any, acoustics: Any, source: str | None = None, *,
    place_known: bool = True,
) -> dict[str, Any]:
    """Keys of ``[receiver]`` and their values, in the units of a scenario file.

    A key about which nothing is known is left out; the receiver then uses its own start value. If
    that depends on a symbol, the key is present and takes the start value where nothing is known.

    Parameters
    ----------
    target, platform, acoustics
        Tables of the scenario, complete.
    source
        The receiver's ``pose_source``, if the scenario sets it.
    place_known
        Whether the tables say where diver and beacons are. If not, nothing is known about echoes
        except how many there are.
    """
    speed = acoustics.assumed_sound_speed_m_s
    some = both(acoustics.outlier_probability > 0, acoustics.outlier_mean_m > 0)
    outliers = where(some, acoustics.outlier_probability, 0.0)
    echoes = share(acoustics) if place_known else 0.0
    n, e, _ = platform.gps_antenna_offset_m
    place, turn, tilt = rounding(
        platform, acoustics, source or pose_source(acoustics.packet_content)
    )
    return {
        "beacon_offset_m": beacons_of(platform),
        "pose_source": pose_source(acoustics.packet_content),
        "gps_std_m": _with(place, platform.gps_horizontal_std_m),
        "gps_markov_std_m": platform.gps_horizontal_markov_std_m,
        "gps_correlation_time_s": platform.gps_correlation_time_s,
        "gps_bias_std_m": hypot(platform.gps_horizontal_bias_std_m, n / _ROOT_2, e / _ROOT_2),
        "gps_vertical_std_m": _with(place, platform.gps_vertical_std_m),
        **_vertical_error(platform),
        **_velocity(platform),
        **_heading_rate(platform),
        **_heave(platform),
        **_tilt(platform),
        "imu_heading_std_deg": _with(turn, platform.imu_heading_std_deg),
        **_heading_error(platform),
        **_tilt_error(platform, tilt),
        **_of_pings(acoustics),
        "outlier_probability": greatest(
            late(outliers, acoustics), _LEAST_OUTLIER_PROBABILITY
        ),
        **_known(
            "outlier_mean_m", outliers + echoes > 0,
            mean_excess(outliers, target if place_known else None, platform, acoustics),
        ),
        "assumed_sound_speed_m_s": speed,
        **clock(acoustics),
        "sound_speed_std": absolute(speed / acoustics.sound_speed_m_s - 1),
        "depth_bias_std_m": hypot(target.depth_bias_m, target.depth_bias_std_m),
        **_of_each_beacon(platform, acoustics),
    }


def knowledge(parameters: Collection[str]) -> dict[str, bool]:
    """What a receiver with these parameters knows, as arguments of `levels`."""
    return {
        "estimates_clock": "clock_std" in parameters,
        "knows_arrangement": "beacon_offset" in parameters,
        "knows_pings": "range_common_std" in parameters,
    }


def levels(
    system: Mapping[str, Any], target: Any, platform: Any, acoustics: Any, *,
    estimates_clock: bool, knows_arrangement: bool, knows_pings: bool,
) -> dict[str, Any]:
    """Noise levels and assumptions given to a receiver, limited to what the receiver accepts.

    Parameters
    ----------
    system
        The known part of what `assumed` returns.
    target, platform, acoustics
        As for `assumed`.
    estimates_clock
        Whether the receiver estimates its clock. If not, the clock's error counts as range noise.
    knows_arrangement
        Whether the receiver is given the arrangement. If so, misplaced beacons count as range
        noise.
    knows_pings
        Whether the receiver knows what the arrivals of a ping share. If not, that counts as range
        noise.
    """
    noise = range_noise(acoustics)
    if not knows_pings:
        noise = with_common(noise, acoustics)
    if not estimates_clock:
        noise = hypot(noise, system.get("clock_std_m", 0.0))
    if knows_arrangement:
        noise = hypot(noise, mounting_noise(platform, acoustics))
    told = {"range_std_m": noise, "depth_std_m": target.depth_std_m, **system}
    return {key: within(OF_RECEIVERS[key], value) for key, value in told.items()}


@branching
def range_noise(acoustics: Any) -> Any:
    """Standard deviation of a range's white noise [m], with that of answers or of rounding."""
    if acoustics.ranging in INVERTED:
        return _with(acoustics.range_resolution_m / _ROOT_12, acoustics.range_std_m)
    if legs(acoustics.ranging) == 1:
        return acoustics.range_std_m
    late = acoustics.assumed_sound_speed_m_s / 2 * acoustics.turnaround_std_s
    return hypot(acoustics.range_std_m, late)


def has_clock(acoustics: Any) -> bool:
    """Whether the time of a ping is known where it is heard, or does not matter."""
    return acoustics.common_clock or acoustics.ranging not in INVERTED


@branching
def _of_pings(acoustics: Any) -> dict[str, Any]:
    """What the arrivals of a ping share."""
    return {
        "range_common_std_m": common_noise(acoustics),
        "arrivals_shared": acoustics.arrivals_shared,
        "common_clock": has_clock(acoustics),
    }


@branching
def common_noise(acoustics: Any) -> Any:
    """Standard deviation of what all arrivals of a ping share [m]."""
    shares = acoustics.ranging in INVERTED and acoustics.common_clock
    return acoustics.range_common_std_m if shares else 0.0


def with_common(noise: Any, acoustics: Any) -> Any:
    """Standard deviation of a range's noise, with what it shares with others of its ping [m]."""
    return _with(common_noise(acoustics), noise)


@branching
def lasting_delay(acoustics: Any) -> Any:
    """Standard deviation of what the turn-around of each beacon adds to all its ranges [m]."""
    if legs(acoustics.ranging) == 1:
        return 0.0
    return acoustics.assumed_sound_speed_m_s / 2 * acoustics.turnaround_beacon_std_s


@branching
def mounting_noise(platform: Any, acoustics: Any) -> Any:
    """Standard deviation of white range noise equivalent to what lasts for each beacon [m].

    All ranges of a beacon share its mounting error, and all its answers a part of the error of the
    turn-around. A filter that ignores them overestimates its information, the more so the more
    often beacons ping.
    """
    found = square(lasting_delay(acoustics))
    if platform.gps_shared:
        fixed = platform.mounting_error_m or (0.0,)
        own = total(map(square, fixed)) / len(fixed)
        found += square(platform.mounting_std_m) + own
    beacons = len(beacons_of(platform)) // 3
    slots = beacons / schedule_of(acoustics).together(beacons)
    pings = 2 * _MOUNTING_MEMORY / (slots * acoustics.sampling_time_s)
    return sqrt(found * greatest(pings, 1.0))


@branching
def rounding(platform: Any, acoustics: Any, source: str) -> tuple[Any, Any, Any]:
    """Noise that rounding adds to a pose: in positions [m], heading and tilt [degrees]."""
    step = acoustics.packet_resolution_m / _ROOT_12
    if acoustics.packet_content in PLACED or source != "beacon_positions":
        angle = acoustics.packet_angle_resolution_deg / _ROOT_12
        return step, angle, angle
    # The pose is fitted to the beacons, each of which is rounded separately.
    rows = beacons_of(platform)
    x, y = rows[0::3], rows[1::3]
    n = len(x)
    xx, yy = (total(map(square, axis)) - square(total(axis)) / n for axis in (x, y))
    xy = total(a * b for a, b in zip(x, y, strict=True)) - total(x) * total(y) / n
    least = greatest(xx * yy - xy * xy, 1e-12)
    forward, starboard = (degrees(step * sqrt(v / least)) for v in (yy, xx))
    return step / math.sqrt(n), forward, hypot(forward, starboard) / _ROOT_2


def _with(rounded: Any, *stds: Any) -> Any:
    """Root of the sum of squares; without rounding, the exact value unchanged."""
    exact = stds[0] if len(stds) == 1 else hypot(*stds)
    return where(rounded > 0, hypot(*stds, rounded), exact)


def _known(key: str, condition: Any, value: Any) -> dict[str, Any]:
    """A key whose value is known only if a condition holds."""
    if symbolic(condition):
        return {key: where(condition, value, start_of(key))}
    return {key: value} if condition else {}


def _heading_error(platform: Any) -> dict[str, Any]:
    """The long-lasting error of the IMU's heading."""
    slow = hypot(platform.imu_heading_bias_deg, platform.imu_heading_turn_on_std_deg,
                 platform.imu_heading_step_deg, platform.misalignment_heading_std_deg)
    markov = platform.imu_heading_markov_std_deg
    return {
        "imu_heading_error_std_deg": hypot(slow, markov),
        # A constant part outlasts one that changes.
        **_known("imu_heading_error_time_s", markov > slow, platform.imu_correlation_time_s),
    }


def _tilt_error(platform: Any, rounded: Any) -> dict[str, Any]:
    """All errors of the IMU's roll and pitch; the white one; and the lasting one of the beacons.

    Of a lasting error of the IMU, the share arrives at the beacons that the receiver trusts it; see
    `sblcosim.models.receiver.surroundings.tilt`.
    """
    noise = _with(rounded, platform.imu_tilt_std_deg)
    lasting = hypot(platform.imu_tilt_bias_deg, platform.imu_tilt_turn_on_std_deg,
                    platform.imu_tilt_markov_std_deg)
    own, white = square(_tilt(platform)["tilt_std_deg"]), square(noise)
    moves = own > 0
    trust = where(moves, own, 0.0) / where(moves, own + white, 1.0)
    return {
        "imu_tilt_std_deg": _with(
            rounded, platform.imu_tilt_std_deg, platform.imu_tilt_bias_deg,
            platform.imu_tilt_turn_on_std_deg, platform.imu_tilt_markov_std_deg,
            platform.misalignment_tilt_std_deg,
        ),
        "imu_tilt_noise_std_deg": noise,
        "imu_tilt_error_std_deg": hypot(trust * lasting, platform.misalignment_tilt_std_deg),
    }


@branching
def _heave(platform: Any) -> dict[str, Any]:
    """RMS depth of the platform's reference point, and the matching correlation time."""
    heaves = is_sine(platform, "heave")
    place, rate = of_sines(platform, ("heave",)) if heaves else of_waves(platform)[0]
    place += square(platform.mean_position_m[2])
    return {"heave_std_m": sqrt(place), "heave_time_s": _memory(place, rate)}


def _vertical_error(platform: Any) -> dict[str, Any]:
    """The long-lasting vertical error of the GPS."""
    markov = platform.gps_vertical_markov_std_m
    error = hypot(markov, platform.gps_vertical_bias_std_m, platform.gps_antenna_offset_m[2])
    # One process for a constant and a wandering part: it wanders as fast as the two together.
    time = platform.gps_correlation_time_s * square(ratio(error, markov))
    return {
        "gps_vertical_error_std_m": error, **_known("gps_vertical_error_time_s", markov > 0, time)
    }


@branching
def _of_each_beacon(platform: Any, acoustics: Any) -> dict[str, Any]:
    """Errors of the reported beacon positions if each beacon has its own."""
    survey = platform.mounting_std_m if platform.gps_shared else 0.0
    # A lasting delay is as if the beacon were farther away.
    delay = lasting_delay(acoustics)
    horizontal, vertical = (
        hypot(
            getattr(platform, f"gps_{axis}_bias_std_m"),
            getattr(platform, f"gps_{axis}_markov_std_m"), survey, delay,
        )
        for axis in ("horizontal", "vertical")
    )
    rounded = acoustics.packet_resolution_m / _ROOT_12
    wanders = platform.gps_horizontal_markov_std_m > 0
    return {
        "beacon_error_std_m": horizontal,
        "beacon_vertical_error_std_m": vertical,
        **_known("beacon_error_time_s", wanders, platform.gps_correlation_time_s),
        "beacon_noise_std_m": _with(rounded, platform.gps_horizontal_std_m),
        "beacon_vertical_noise_std_m": _with(rounded, platform.gps_vertical_std_m),
    }


@branching
def clock(acoustics: Any) -> dict[str, Any]:
    """Clock error at the start, and how it grows from there.

    Two-way ranges are without it, but all answers are late by the same error, which looks like it.
    """
    delay = acoustics.processing_delay_s - acoustics.processing_delay_correction_s
    if legs(acoustics.ranging) > 1:
        half = acoustics.assumed_sound_speed_m_s / 2
        return {
            "clock_std_m": half * hypot(delay, acoustics.turnaround_bias_std_s),
            "clock_walk_psd_m2_s": 0.0,
        }
    if not has_clock(acoustics):
        return {"clock_std_m": 0.0, "clock_walk_psd_m2_s": 0.0}
    drift, drift_std = acoustics.clock_drift_s_s, acoustics.clock_drift_std_s_s
    age, speed = acoustics.clock_sync_age_s, acoustics.assumed_sound_speed_m_s
    fixed = acoustics.clock_offset_s + drift * age + delay
    return {
        "clock_std_m": speed * hypot(fixed, acoustics.clock_offset_std_s, drift_std * age),
        "clock_walk_psd_m2_s": _DRIFT_MEMORY * square(hypot(drift, drift_std) * speed),
    }


def _motion(platform: Any, axes: Sequence[str], std: str, time: str) -> dict[str, Any]:
    """RMS rate per axis of sinusoids, and the matching correlation time [s]."""
    place, rate = of_sines(platform, axes)
    return {std: sqrt(rate / len(axes)), **_known(time, rate > 0, sqrt(ratio(place, rate)))}


def _heading_rate(platform: Any) -> dict[str, Any]:
    """RMS rate of the platform's heading, and its correlation time."""
    keys = "heading_rate_std_deg_s", "heading_rate_time_s"
    told = _motion(platform, ("yaw",), *keys)
    return boat.turning(platform, told, *keys, told, yaw=True)


_VELOCITY = "platform_velocity_std_m_s", "platform_velocity_time_s"


@branching
def _velocity(platform: Any) -> dict[str, Any]:
    """RMS velocity of the platform per axis, and its correlation time.

    The velocity of a boat on a straight course is constant. It adds to the mean square, and the
    time grows as much, so that the noise that changes the velocity, 2 σ²/τ, stays that of waves and
    drift.
    """
    told = _wavering(platform)
    std: Any = told["platform_velocity_std_m_s"]
    time = told.get("platform_velocity_time_s")
    way = platform.boat_speed_m_s
    both = hypot(std, way / _ROOT_2)
    moves = std > 0
    grown = square(ratio(both, where(moves, std, 1.0)))
    longer = (_STILL if time is None else time) * grown
    slow = where(moves, longer, _STILL)
    return boat.turning(platform, told, *_VELOCITY, {
        "platform_velocity_std_m_s": where(way > 0, both, std),
        **_known("platform_velocity_time_s", (std + way) > 0,
                 where(way > 0, slow, _STILL if time is None else time)),
    })


def _wavering(platform: Any) -> dict[str, Any]:
    """The same of waves and drift alone."""
    if is_sine(platform, "surge"):
        return _motion(platform, ("surge", "sway"), "platform_velocity_std_m_s",
                       "platform_velocity_time_s")
    parts = of_waves(platform)[0], of_mooring(platform)
    rate = total(it[1] for it in parts)
    # One process for waves and drift: the noises that change their velocities, 2 σ²/τ, add.
    changes = total(it[1] * ratio(1.0, sqrt(ratio(*it))) for it in parts)
    return {
        "platform_velocity_std_m_s": sqrt(rate / 2),
        **_known("platform_velocity_time_s", rate > 0, ratio(rate, changes)),
    }


@branching
def _tilt(platform: Any) -> dict[str, Any]:
    """RMS of roll and of pitch, and their correlation time."""
    if is_sine(platform, "roll"):
        roll, pitch = (platform.roll_amplitude_deg, platform.pitch_amplitude_deg)
        std, squares = hypot(roll, pitch) / 2, of_sines(platform, ("roll", "pitch"))
    else:
        squares = of_waves(platform)[1]
        std = sqrt(squares[0] / 2)
    return {"tilt_std_deg": std, "tilt_time_s": clipped(_memory(*squares), 0.01, SLOWEST_TILT)}


def _memory(place: Any, rate: Any) -> Any:
    """Correlation time [s] of a process with these mean squares of value and rate."""
    return where(rate > 0, sqrt(ratio(place, rate)), _STILL)
