"""Declarations of the receivers: equal ports, and parameters for what differs."""

from __future__ import annotations

from ..declaration import Component, Variable, choice, is_one_of, not_zero, parameter, tick_interval
from ..ports import DEPTH, ESTIMATE, RECEPTION, ports, terminal

INITIALISATION = {1: "first_receptions", 2: "prior"}
BEACON_POSITION_SOURCE = {1: "own_packet", 2: "newest_packet"}
MEASUREMENT_NOISE = {1: "variance", 2: "literal"}
PROCESS_NOISE = {1: "white_noise_acceleration", 2: "piecewise_constant_acceleration"}

_SENSORS = (
    tick_interval("update_interval", "Time between updates: the EKF ratio times the sampling time"),
    parameter("range_std", "Assumed standard deviation of a range", "m", start=0.1, min=1e-9),
    parameter("depth_std", "Assumed standard deviation of a depth reading", "m", start=0.1,
              min=1e-9),
    choice("beacon_position_source", "Beacon position that goes with a range",
           BEACON_POSITION_SOURCE, 1),
)
_WITH_PRIOR = ((is_one_of("initialisation", INITIALISATION, "prior"),),)
_MOTION = (
    choice("initialisation", "Where the first estimate comes from", INITIALISATION, 1),
    parameter("prior_position", "Prior: position at the start, NED", "m", shape=(3,),
              needs=_WITH_PRIOR),
    parameter("prior_velocity", "Prior: velocity at the start, NED", "m/s", shape=(3,),
              needs=_WITH_PRIOR),
    parameter("prior_position_std", "Prior: standard deviation of the position, per axis", "m",
              start=1.0, min=0.0, needs=_WITH_PRIOR),
    parameter("prior_velocity_std", "Prior, and after the first receptions: standard deviation of "
              "the velocity, per axis", "m/s", start=1.0, min=0.0),
    choice("process_noise", "Form of Q", PROCESS_NOISE, 1, needs=(not_zero("acceleration_psd"),)),
    parameter("acceleration_psd", "Power spectral density q of the white acceleration per axis; "
              "the other form of Q takes the variance q / dt", "m2/s3", start=0.01, min=0.0),
)
_NOISE = choice("measurement_noise", "Diagonal of R: squares of the standard deviations, or "
                "literally the standard deviations", MEASUREMENT_NOISE, 1)


def _receiver(name: str, number: int, description: str, parameters: tuple[Variable, ...]
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
            *ports(ESTIMATE, "output"),
        ),
        terminals=(
            terminal("reception", "reception", "Newest reception from each beacon", RECEPTION),
            terminal("depth_sensor", "depth", "Newest reading of the depth sensor", DEPTH),
            terminal("estimate", "estimate", "Newest estimate", ESTIMATE),
        ),
    )


EKF = _receiver(
    "EKF", 4,
    "The paper's Extended Kalman Filter on the latest ranges, stale ones included, and depth",
    (*_MOTION, _NOISE),
)
SEQUENTIAL = _receiver(
    "Sequential", 5,
    "A Kalman filter that processes each reception and depth reading at its own epoch, once",
    (
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
    (_NOISE,),
)
