"""Building blocks of the receivers' declarations: common ports, and parameters that several share.

Each declaration is a module of ``receivers``.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi, radians

from ..arrangement import usual
from ..declaration import (
    Component,
    Terminal,
    Variable,
    choice,
    is_one_of,
    not_zero,
    parameter,
    switch,
    tick_interval,
)
from ..parts import check_arguments
from ..ports import BEACONS, DEPTH, ESTIMATE, PING_POSE, RECEPTION, SYSTEM, ports, terminal

INITIALISATION = {1: "first_receptions", 2: "prior"}
BEACON_POSITION_SOURCE = {1: "own_packet", 2: "newest_packet"}
MEASUREMENT_NOISE = {1: "variance", 2: "literal"}
PROCESS_NOISE = {1: "white_noise_acceleration", 2: "piecewise_constant_acceleration"}

POSE_SOURCE = {1: "reported_pose", 2: "beacon_positions", 3: "own_beacon"}

SENSORS = (
    tick_interval("update_interval", "Time between updates: the EKF ratio times the sampling time"),
    parameter("range_std", "Assumed standard deviation of a range", "m", start=0.1, min=1e-9),
    parameter("depth_std", "Assumed standard deviation of a depth reading", "m", start=0.1,
              min=1e-9),
)
BEACON_SOURCE = choice("beacon_position_source", "Beacon position that goes with a range",
                  BEACON_POSITION_SOURCE, 1)
_WITH_PRIOR = ((is_one_of("initialisation", INITIALISATION, "prior"),),)
START = (
    choice("initialisation", "Where the first estimate comes from", INITIALISATION, 1),
    parameter("prior_position", "Prior: position at the start, NED", "m", shape=(3,),
              needs=_WITH_PRIOR),
    parameter("prior_velocity", "Prior: velocity at the start, NED", "m/s", shape=(3,),
              needs=_WITH_PRIOR),
    parameter("prior_position_std", "Prior: standard deviation of the position, per axis", "m",
              start=1.0, min=0.0, needs=_WITH_PRIOR),
    parameter("prior_velocity_std", "Prior, and after the first receptions: standard deviation of "
              "the velocity, per axis", "m/s", start=1.0, min=0.0),
)
_PSD = "Power spectral density q of the white acceleration per axis"
PSD = parameter("acceleration_psd", _PSD, "m2/s3", start=0.01, min=0.0)
MOTION = parameter("acceleration_psd", f"{_PSD}: a number, or learned from the ranges", "m2/s3",
                   start=0.01, min=0.0, named={"learned": -1.0})
MODEL = (
    *START,
    choice("process_noise", "Form of Q; the second one takes the variance q / dt", PROCESS_NOISE, 1,
           needs=(not_zero("acceleration_psd"),)),
    PSD,
)
NOISE = choice("measurement_noise", "Diagonal of R: squares of the standard deviations, or "
                "literally the standard deviations", MEASUREMENT_NOISE, 1)
ARRANGEMENT = (
    choice("pose_source", "What the receiver uses of the best pose in a packet: the pose itself, "
           "the positions of all beacons, or only that of its own beacon", POSE_SOURCE, 1),
    parameter("beacon_offset", "Nominal position of each beacon, body frame", "m",
              shape=(BEACONS, 3), start=usual, min=-1e4, max=1e4),
)
CHANNEL = (
    parameter("outlier_probability", "Assumed probability that a range is too long", start=0.01,
              min=0.0, max=0.9),
    parameter("outlier_mean", "Assumed mean excess of such a range", "m", start=1.0, min=0.01),
    parameter("assumed_sound_speed", "Speed of sound used to form the ranges", "m/s",
              start=1500.0, min=1.0, max=10000.0),
    parameter("clock_std", "Prior: standard deviation of the clock's offset times the speed of "
              "sound", "m", start=1.35, min=0.0),
    parameter("clock_walk_psd", "Power spectral density of the clock's random walk times the speed "
              "of sound", "m2/s", start=5.6e-5, min=0.0),
    parameter("sound_speed_std", "Prior: standard deviation of the speed of sound, as a share",
              start=0.02, min=0.0, max=0.5),
    parameter("depth_bias_std", "Prior: standard deviation of the depth sensor's constant error",
              "m", start=0.05, min=0.0),
)
SLOWEST_TILT = 4.0
"""Longest correlation time of tilt [s]: a slower one cannot be told from the platform's motion."""
PLATFORM = (
    parameter("gps_std", "GPS: standard deviation of the white error, north and east", "m",
              start=0.1, min=0.0),
    parameter("gps_markov_std", "GPS: standard deviation of the Gauss-Markov error", "m", start=1.2,
              min=0.0),
    parameter("gps_correlation_time", "GPS: correlation time of the Gauss-Markov error", "s",
              start=120.0, min=0.01, needs=(not_zero("gps_markov_std"),)),
    parameter("gps_bias_std", "GPS: standard deviation of the constant error; not estimated, but "
              "added to the covariance", "m", start=0.0, min=0.0),
    parameter("gps_vertical_std", "GPS: standard deviation of the white error, down", "m",
              start=0.0, min=0.0),
    parameter("gps_vertical_error_std", "GPS: standard deviation of the slow error, down", "m",
              start=0.0, min=0.0),
    parameter("gps_vertical_error_time", "GPS: correlation time of that error", "s", start=1e6,
              min=0.01, needs=(not_zero("gps_vertical_error_std"),)),
    parameter("platform_velocity_std", "Standard deviation of the platform's velocity, north and "
              "east", "m/s", start=0.05, min=0.0),
    parameter("platform_velocity_time", "Correlation time of that velocity", "s", start=40.0,
              min=0.01, needs=(not_zero("platform_velocity_std"),)),
    parameter("heading_rate_std", "Standard deviation of the rate of the platform's heading",
              "rad/s", start=0.02, min=0.0),
    parameter("heading_rate_time", "Correlation time of that rate", "s", start=3.0, min=0.01,
              needs=(not_zero("heading_rate_std"),)),
    parameter("heave_std", "Standard deviation of the depth of the platform's reference point, "
              "about the surface", "m", start=0.25, min=0.0),
    parameter("heave_time", "Correlation time of that depth", "s", start=0.8, min=0.01,
              needs=(not_zero("heave_std"),)),
    parameter("tilt_std", "Standard deviation of the platform's roll and pitch", "rad", start=0.07,
              min=0.0, max=pi / 2),
    parameter("tilt_time", "Correlation time of roll and pitch", "s", start=0.8, min=0.01,
              max=SLOWEST_TILT, needs=(not_zero("tilt_std"), (is_one_of(
                  "pose_source", POSE_SOURCE, "beacon_positions", "own_beacon"),))),
    parameter("imu_heading_std", "IMU: standard deviation of the heading's white error", "rad",
              min=0.0),
    parameter("imu_heading_error_std", "IMU: standard deviation of the heading's Gauss-Markov "
              "error", "rad", start=radians(3.0), min=0.0),
    parameter("imu_heading_error_time", "IMU: correlation time of that error", "s", start=1e6,
              min=0.01, needs=(not_zero("imu_heading_error_std"),)),
    parameter("imu_tilt_std", "IMU: standard deviation of the error of roll and pitch", "rad",
              start=radians(0.5), min=0.0),
)
SYSTEM_TERMINALS = (
    terminal("pose", "pose", "The platform's pose in the packets of those receptions", PING_POSE),
    terminal("system", "system", "Newest estimate of the system around the receiver", SYSTEM),
)
WATCH = switch("watch", "Watch for a wrong lock: begin a challenger every minute, which takes over "
               "if the ranges prefer it", start=False)
FILTER = (
    *START,
    MOTION,
    parameter("speed_limit", "Largest credible speed of the diver; a faster estimate makes the "
              "filter restart", "m/s", start=3.0, min=0.1),
    *ARRANGEMENT,
    *CHANNEL,
    *PLATFORM,
)

WITH_BUOYS = (
    "each buoy has its own GPS: the covariance does not fit, and the error is small only while "
    "the buoys keep their arrangement; compare it with long_baseline"
)
"""The problem of buoys for a receiver that assumes one platform."""


def receiver(
    name: str, number: int, description: str, parameters: tuple[Variable, ...],
    inputs: Sequence[Variable] = (), outputs: Sequence[Variable] = (),
    terminals: Sequence[Terminal] = (),
) -> Component:
    """A receiver with the ports that all have, plus its own `inputs` and `outputs`."""
    check_arguments(name, receiver, locals())
    return Component(
        name=name,
        number=number,
        description=description,
        interval="update_interval",
        variables=(
            *SENSORS,
            *parameters,
            *ports(RECEPTION, "input"),
            *ports(DEPTH, "input"),
            *ports(inputs, "input"),
            *ports(ESTIMATE, "output"),
            *ports(outputs, "output"),
        ),
        terminals=(
            terminal("reception", "reception", "Newest reception from each beacon", RECEPTION),
            terminal("depth_sensor", "depth", "Newest reading of the depth sensor", DEPTH),
            terminal("estimate", "estimate", "Newest estimate", ESTIMATE),
            *terminals,
        ),
    )
