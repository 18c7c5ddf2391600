"""Declarations of the receivers: equal ports, and parameters for what differs."""

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
    tick_interval,
)
from ..ports import BEACONS, DEPTH, ESTIMATE, PING_POSE, RECEPTION, SYSTEM, ports, terminal

INITIALISATION = {1: "first_receptions", 2: "prior"}
BEACON_POSITION_SOURCE = {1: "own_packet", 2: "newest_packet"}
MEASUREMENT_NOISE = {1: "variance", 2: "literal"}
PROCESS_NOISE = {1: "white_noise_acceleration", 2: "piecewise_constant_acceleration"}

POSE_SOURCE = {1: "reported_pose", 2: "beacon_positions", 3: "own_beacon"}

_SENSORS = (
    tick_interval("update_interval", "Time between updates: the EKF ratio times the sampling time"),
    parameter("range_std", "Assumed standard deviation of a range", "m", start=0.1, min=1e-9),
    parameter("depth_std", "Assumed standard deviation of a depth reading", "m", start=0.1,
              min=1e-9),
)
_BEACONS = choice("beacon_position_source", "Beacon position that goes with a range",
                  BEACON_POSITION_SOURCE, 1)
_WITH_PRIOR = ((is_one_of("initialisation", INITIALISATION, "prior"),),)
_START = (
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
_PSD = parameter("acceleration_psd", "Power spectral density q of the white acceleration per axis; "
                 "the other form of Q takes the variance q / dt", "m2/s3", start=0.01, min=0.0)
_MOTION = (
    *_START,
    choice("process_noise", "Form of Q", PROCESS_NOISE, 1, needs=(not_zero("acceleration_psd"),)),
    _PSD,
)
_NOISE = choice("measurement_noise", "Diagonal of R: squares of the standard deviations, or "
                "literally the standard deviations", MEASUREMENT_NOISE, 1)


def _receiver(
    name: str, number: int, description: str, parameters: tuple[Variable, ...],
    inputs: Sequence[Variable] = (), outputs: Sequence[Variable] = (),
    terminals: Sequence[Terminal] = (),
) -> Component:
    return Component(
        name=name,
        number=number,
        description=description,
        interval="update_interval",
        variables=(
            *_SENSORS,
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


EKF = _receiver(
    "EKF", 4,
    "The paper's Extended Kalman Filter on the latest ranges, stale ones included, and depth",
    (_BEACONS, *_MOTION, _NOISE),
)
SEQUENTIAL = _receiver(
    "Sequential", 5,
    "A Kalman filter that processes each reception and depth reading at its own epoch, once",
    (
        _BEACONS,
        *_MOTION,
        _NOISE,
        parameter("gate", "Innovations beyond this many standard deviations are rejected; 0 "
                  "switches the gate off", start=4.0, min=0.0),
        Variable("gate_limit", "Score of rejections at which the filter starts anew from the "
                 "latest receptions: a rejected range adds 1, any other takes back 1/2",
                 "parameter", start=5, min=1, max=1000, type="Int32", needs=(not_zero("gate"),)),
    ),
)
MULTILATERATION = _receiver(
    "Multilateration", 6,
    "Damped Gauss-Newton on the latest ranges and depth, no dynamics: the raw fix",
    (_BEACONS, _NOISE),
)

_ARRANGEMENT = (
    choice("pose_source", "What is used of the best pose that a packet has: its own words, the "
           "positions of all beacons, or that of its own beacon only", POSE_SOURCE, 1),
    parameter("beacon_offset", "Nominal position of each beacon, body frame", "m",
              shape=(BEACONS, 3), start=usual, min=-1e4, max=1e4),
)
_CHANNEL = (
    parameter("outlier_probability", "Assumed probability that a range is too long", start=0.01,
              min=0.0, max=0.9),
    parameter("outlier_mean", "Assumed mean excess of such a range", "m", start=1.0, min=0.01),
    parameter("assumed_sound_speed", "Speed of sound with which ranges were formed", "m/s",
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
_PLATFORM = (
    parameter("gps_std", "GPS: standard deviation of the white error, north and east", "m",
              start=0.1, min=0.0),
    parameter("gps_markov_std", "GPS: standard deviation of the Gauss-Markov error", "m", start=1.2,
              min=0.0),
    parameter("gps_correlation_time", "GPS: correlation time of the Gauss-Markov error", "s",
              start=120.0, min=0.01, needs=(not_zero("gps_markov_std"),)),
    parameter("gps_bias_std", "GPS: standard deviation of the constant error; not estimated, added "
              "to the covariance", "m", start=0.0, min=0.0),
    parameter("gps_vertical_std", "GPS: standard deviation of the white error of down", "m",
              start=0.0, min=0.0),
    parameter("gps_vertical_error_std", "GPS: standard deviation of the slow error of down", "m",
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
    parameter("tilt_std", "Standard deviation of the platform's roll and pitch", "rad", start=0.07,
              min=0.0, max=pi / 2),
    parameter("imu_heading_std", "IMU: standard deviation of the heading's white error", "rad",
              min=0.0),
    parameter("imu_heading_error_std", "IMU: standard deviation of the heading's Gauss-Markov "
              "error", "rad", start=radians(3.0), min=0.0),
    parameter("imu_heading_error_time", "IMU: correlation time of that error", "s", start=1e6,
              min=0.01, needs=(not_zero("imu_heading_error_std"),)),
    parameter("imu_tilt_std", "IMU: standard deviation of the error of roll and pitch", "rad",
              start=radians(0.5), min=0.0),
)
_SYSTEM_TERMINALS = (
    terminal("pose", "pose", "The platform's pose in the packets of those receptions", PING_POSE),
    terminal("system", "system", "Newest estimate of the system around the receiver", SYSTEM),
)
_FILTER = (
    *_START,
    _PSD,
    parameter("speed_limit", "A diver estimated to be faster than this is not believed: the "
              "filter starts anew", "m/s", start=3.0, min=0.1),
    *_ARRANGEMENT,
    *_CHANNEL,
    *_PLATFORM,
)
COUPLED = _receiver(
    "Coupled", 8,
    "A Kalman filter of diver, platform and their sensors' errors, with late arrivals and arcs",
    _FILTER,
    inputs=PING_POSE,
    outputs=SYSTEM,
    terminals=_SYSTEM_TERMINALS,
)
FIXED_LAG = _receiver(
    "FixedLag", 9,
    "The same filter, whose estimates are of some time ago and know what was received since",
    (
        parameter("lag", "Age of the estimates: what is received in this time after an epoch is "
                  "used for it, too", "s", start=20.0, min=0.01, max=3600.0),
        *_FILTER,
    ),
    inputs=PING_POSE,
    outputs=SYSTEM,
    terminals=_SYSTEM_TERMINALS,
)
_FIELD = (
    parameter("beacon_error_std", "Standard deviation of each beacon's own lasting error, north "
              "and east: of its survey, or of the coloured error of its GPS", "m", start=0.1,
              min=0.0),
    parameter("beacon_vertical_error_std", "The same of down", "m", start=0.1, min=0.0),
    parameter("beacon_error_time", "Correlation time of that error", "s", start=1e6, min=0.01,
              needs=(not_zero("beacon_error_std", "beacon_vertical_error_std"),)),
    parameter("beacon_noise_std", "Standard deviation of the white error of a beacon's reported "
              "position, north and east", "m", start=0.0, min=0.0),
    parameter("beacon_vertical_noise_std", "The same of down", "m", start=0.0, min=0.0),
)
_OF_FIELD = tuple(
    v for v in SYSTEM if v.name in ("clock_offset", "sound_speed", "restart_count")
)
LONG_BASELINE = _receiver(
    "LongBaseline", 10,
    "A Kalman filter of the diver, the clock, and the own error of each of some beacons far apart",
    (*_START, _PSD, *_CHANNEL, *_FIELD),
    outputs=_OF_FIELD,
    terminals=(terminal("system", "system", "Newest estimate of the clock", _OF_FIELD),),
)
