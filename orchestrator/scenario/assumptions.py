"""What a receiver may assume of the system: parameters of `coupled` from a scenario's own values.

The table in ``models/receiver/README.md`` says which comes from which.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees, hypot, pi, sqrt
from typing import Any

from sblcosim.models.arrangement import cross

from .packets import pose_source

_DRIFT_MEMORY = 100.0
"""A clock that drifts by δ₁ strays in this time [s] as far as the random walk of `clock_walk_psd`
does."""
_LEAST_OUTLIER_PROBABILITY = 0.01
_MOUNTING_MEMORY = 10.0
"""An error of a beacon's place counts as the noise that, averaged over twice this time [s], leaves
as much. Measured: see ``models/receiver/README.md``."""
_PACKET = ("acoustics.packet_content", "acoustics.packet_resolution_m")
_ANGLES = (*_PACKET, "acoustics.packet_angle_resolution_deg")

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
    ),
    "platform_velocity_time_s": (
        "platform.surge_amplitude_m", "platform.surge_frequency_Hz", "platform.sway_amplitude_m",
        "platform.sway_frequency_Hz",
    ),
    "heading_rate_std_deg_s": ("platform.yaw_amplitude_deg", "platform.yaw_frequency_Hz"),
    "heading_rate_time_s": ("platform.yaw_amplitude_deg", "platform.yaw_frequency_Hz"),
    "tilt_std_deg": ("platform.roll_amplitude_deg", "platform.pitch_amplitude_deg"),
    "imu_heading_std_deg": ("platform.imu_heading_std_deg", *_ANGLES),
    "imu_heading_error_std_deg": (
        "platform.imu_heading_bias_deg", "platform.imu_heading_turn_on_std_deg",
        "platform.imu_heading_step_deg", "platform.imu_heading_markov_std_deg",
    ),
    "imu_heading_error_time_s": (
        "platform.imu_heading_bias_deg", "platform.imu_heading_turn_on_std_deg",
        "platform.imu_heading_step_deg", "platform.imu_heading_markov_std_deg",
        "platform.imu_correlation_time_s",
    ),
    "imu_tilt_std_deg": (
        "platform.imu_tilt_std_deg", "platform.imu_tilt_bias_deg",
        "platform.imu_tilt_turn_on_std_deg", "platform.imu_tilt_markov_std_deg", *_ANGLES,
    ),
    "outlier_probability": ("acoustics.outlier_probability", "acoustics.outlier_mean_m"),
    "outlier_mean_m": ("acoustics.outlier_mean_m", "acoustics.outlier_probability"),
    "assumed_sound_speed_m_s": ("acoustics.assumed_sound_speed_m_s",),
    "clock_std_m": (
        "acoustics.clock_offset_s", "acoustics.clock_offset_std_s", "acoustics.clock_drift_s_s",
        "acoustics.clock_drift_std_s_s", "acoustics.clock_sync_age_s",
        "acoustics.processing_delay_s", "acoustics.processing_delay_correction_s",
        "acoustics.assumed_sound_speed_m_s",
    ),
    "clock_walk_psd_m2_s": (
        "acoustics.clock_drift_s_s", "acoustics.clock_drift_std_s_s",
        "acoustics.assumed_sound_speed_m_s",
    ),
    "sound_speed_std": ("acoustics.sound_speed_m_s", "acoustics.assumed_sound_speed_m_s"),
    "depth_bias_std_m": ("target.depth_bias_m", "target.depth_bias_std_m"),
    "beacon_error_std_m": (
        "platform.gps_horizontal_bias_std_m", "platform.gps_horizontal_markov_std_m",
        "platform.mounting_std_m", "platform.gps_shared",
    ),
    "beacon_vertical_error_std_m": (
        "platform.gps_vertical_bias_std_m", "platform.gps_vertical_markov_std_m",
        "platform.mounting_std_m", "platform.gps_shared",
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
"""Keys of ``[receiver]``, and the keys that each follows from.

Those of the first table decide whether anything is known.
"""


def assumed(
    target: Any, platform: Any, acoustics: Any, source: str | None = None
) -> dict[str, Any]:
    """Keys of ``[receiver]`` and their values, in the units of a scenario file.

    Parameters
    ----------
    target, platform, acoustics
        Tables of the scenario, complete. Of a component of somebody else only what is given is
        known: nothing follows from the starts of ours.
    source
        What the receiver uses of a packet, if the scenario says so: its ``pose_source``.
    """
    swing, swing_time = _motion(platform, ("surge", "sway"))
    turning, turning_time = _motion(platform, ("yaw",))
    roll, pitch = (platform.roll_amplitude_deg, platform.pitch_amplitude_deg)
    speed = acoustics.assumed_sound_speed_m_s
    outliers = acoustics.outlier_probability > 0 and acoustics.outlier_mean_m > 0
    n, e, _ = platform.gps_antenna_offset_m
    place, turn, tilt = _rounding(
        platform, acoustics, source or pose_source(acoustics.packet_content)
    )
    values = {
        "beacon_offset_m": beacons_of(platform),
        "pose_source": pose_source(acoustics.packet_content),
        "gps_std_m": _with(place, platform.gps_horizontal_std_m),
        "gps_markov_std_m": platform.gps_horizontal_markov_std_m,
        "gps_correlation_time_s": platform.gps_correlation_time_s,
        "gps_bias_std_m": hypot(platform.gps_horizontal_bias_std_m, n / sqrt(2), e / sqrt(2)),
        "gps_vertical_std_m": _with(place, platform.gps_vertical_std_m),
        **_vertical_error(platform),
        "platform_velocity_std_m_s": swing,
        "platform_velocity_time_s": swing_time,
        "heading_rate_std_deg_s": turning,
        "heading_rate_time_s": turning_time,
        "tilt_std_deg": hypot(roll, pitch) / 2,
        "imu_heading_std_deg": _with(turn, platform.imu_heading_std_deg),
        **_heading_error(platform),
        "imu_tilt_std_deg": _with(
            tilt, platform.imu_tilt_std_deg, platform.imu_tilt_bias_deg,
            platform.imu_tilt_turn_on_std_deg, platform.imu_tilt_markov_std_deg,
        ),
        "outlier_probability": max(
            acoustics.outlier_probability if outliers else 0.0, _LEAST_OUTLIER_PROBABILITY
        ),
        "outlier_mean_m": acoustics.outlier_mean_m if outliers else None,
        "assumed_sound_speed_m_s": speed,
        **_clock(acoustics),
        "sound_speed_std": abs(speed / acoustics.sound_speed_m_s - 1),
        "depth_bias_std_m": hypot(target.depth_bias_m, target.depth_bias_std_m),
        **_of_each_beacon(platform, acoustics),
    }
    tables = {"target": target, "platform": platform, "acoustics": acoustics}
    foreign = {name: table for name, table in tables.items() if table.fmu is not None}
    return {
        key: value for key, value in values.items()
        if value is not None and not (foreign and _unknown(foreign, key))
    }


_DECISIVE = {
    key: (table := sources[0].partition(".")[0], [
        name for where, _, name in (source.partition(".") for source in sources) if where == table
    ])
    for key, sources in SOURCES.items()
}  # fmt: skip
"""The first table of `SOURCES`, and the keys in it."""


def _unknown(foreign: Mapping[str, Any], key: str) -> bool:
    """Whether a key follows from a component of somebody else of which the scenario says nothing.
    """
    name, keys = _DECISIVE[key]
    return name in foreign and foreign[name].model_fields_set.isdisjoint(keys)


def _with(rounding: float, *stds: float) -> float:
    """Root of the sum of squares; nothing is touched where nothing is rounded."""
    if rounding:
        return hypot(*stds, rounding)
    return stds[0] if len(stds) == 1 else hypot(*stds)


def _rounding(platform: Any, acoustics: Any, source: str) -> tuple[float, float, float]:
    """What rounding adds to a pose: of positions [m], heading and tilt [degrees]; as noise."""
    step = acoustics.packet_resolution_m / sqrt(12)
    if acoustics.packet_content == "pose" or source != "beacon_positions":
        angle = acoustics.packet_angle_resolution_deg / sqrt(12)
        return step, angle, angle
    # The pose is fitted to the beacons, each of them rounded by itself.
    rows = beacons_of(platform)
    x, y = rows[0::3], rows[1::3]
    n = len(x)
    xx, yy = (sum(v * v for v in axis) - sum(axis) ** 2 / n for axis in (x, y))
    xy = sum(a * b for a, b in zip(x, y, strict=True)) - sum(x) * sum(y) / n
    least = max(xx * yy - xy * xy, 1e-12)
    forward, starboard = (degrees(step * sqrt(v / least)) for v in (yy, xx))
    return step / sqrt(n), forward, hypot(forward, starboard) / sqrt(2)


def beacons_of(platform: Any) -> tuple[float, ...]:
    """Nominal positions of the beacons, body frame, row by row [m]."""
    rows = cross(platform.beacons, platform.arm_length_m, platform.beacon_depth_m)
    if platform.arrangement == "given":
        flat = platform.beacon_m
        rows = tuple((flat[i], flat[i + 1], flat[i + 2]) for i in range(0, len(flat), 3))
    scale = platform.beacon_scale
    return tuple(v for x, y, z in rows for v in (scale * x, scale * y, z))


def _heading_error(platform: Any) -> dict[str, float | None]:
    """What the IMU's heading is off by for long."""
    slow = hypot(platform.imu_heading_bias_deg, platform.imu_heading_turn_on_std_deg,
                 platform.imu_heading_step_deg)
    markov = platform.imu_heading_markov_std_deg
    return {
        "imu_heading_error_std_deg": hypot(slow, markov),
        # What never changes outlasts what does.
        "imu_heading_error_time_s": platform.imu_correlation_time_s if markov > slow else None,
    }


def mounting_noise(platform: Any, acoustics: Any) -> float:
    """Standard deviation of white noise of a range that is worth the errors of mounting [m].

    They are the same in all ranges of a beacon; a filter that takes them for none believes in more
    than it has, the more often the beacons ping.
    """
    fixed = platform.mounting_error_m or (0.0,)
    square = platform.mounting_std_m**2 + sum(v * v for v in fixed) / len(fixed)
    slots = len(beacons_of(platform)) // 3 if acoustics.schedule == "round_robin" else 1
    pings = 2 * _MOUNTING_MEMORY / (slots * acoustics.sampling_time_s)
    return sqrt(square * max(pings, 1.0)) if platform.gps_shared else 0.0


def _vertical_error(platform: Any) -> dict[str, float | None]:
    """What the GPS's down is off by for long."""
    markov = platform.gps_vertical_markov_std_m
    error = hypot(markov, platform.gps_vertical_bias_std_m, platform.gps_antenna_offset_m[2])
    # One process for a constant part and one that wanders: it wanders as fast.
    time = platform.gps_correlation_time_s * (error / markov) ** 2 if markov > 0 else None
    return {"gps_vertical_error_std_m": error, "gps_vertical_error_time_s": time}


def _of_each_beacon(platform: Any, acoustics: Any) -> dict[str, float | None]:
    """What is wrong with where each beacon is said to be, if all have errors of their own."""
    survey = platform.mounting_std_m if platform.gps_shared else 0.0
    horizontal, vertical = (
        hypot(
            getattr(platform, f"gps_{axis}_bias_std_m"),
            getattr(platform, f"gps_{axis}_markov_std_m"), survey,
        )
        for axis in ("horizontal", "vertical")
    )
    rounding = acoustics.packet_resolution_m / sqrt(12)
    wanders = platform.gps_horizontal_markov_std_m > 0
    return {
        "beacon_error_std_m": horizontal,
        "beacon_vertical_error_std_m": vertical,
        "beacon_error_time_s": platform.gps_correlation_time_s if wanders else None,
        "beacon_noise_std_m": _with(rounding, platform.gps_horizontal_std_m),
        "beacon_vertical_noise_std_m": _with(rounding, platform.gps_vertical_std_m),
    }


def _clock(acoustics: Any) -> dict[str, float]:
    """How far the clock is off at the start, and how it strays from there."""
    delay = acoustics.processing_delay_s - acoustics.processing_delay_correction_s
    drift, drift_std = acoustics.clock_drift_s_s, acoustics.clock_drift_std_s_s
    age, speed = acoustics.clock_sync_age_s, acoustics.assumed_sound_speed_m_s
    fixed = acoustics.clock_offset_s + drift * age + delay
    return {
        "clock_std_m": speed * hypot(fixed, acoustics.clock_offset_std_s, drift_std * age),
        "clock_walk_psd_m2_s": _DRIFT_MEMORY * (hypot(drift, drift_std) * speed) ** 2,
    }


def _motion(platform: Any, axes: Sequence[str]) -> tuple[float, float | None]:
    """RMS rate per axis of some sinusoids, and the correlation time that goes with it [s]."""
    place = rate = 0.0
    for axis in axes:
        unit = "deg" if axis in ("roll", "pitch", "yaw") else "m"
        amplitude = getattr(platform, f"{axis}_amplitude_{unit}")
        place += amplitude**2 / 2
        rate += (2 * pi * getattr(platform, f"{axis}_frequency_Hz") * amplitude) ** 2 / 2
    if rate == 0.0:
        return 0.0, None
    return sqrt(rate / len(axes)), sqrt(place / rate)
