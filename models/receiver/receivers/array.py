"""A filter of all arrivals of a ping, for hydrophones that share its errors."""

from __future__ import annotations

from math import pi, radians

from ...declaration import parameter, switch
from ...ports import PING_POSE, SYSTEM
from ..receiver import ReceiverDeclaration
from ..variables import FILTER, SYSTEM_TERMINALS, WATCH, WITH_BUOYS, receiver

_PING = (
    parameter("range_common_std", "Assumed standard deviation of the error that all ranges of a "
              "ping share", "m", start=0.1, min=0.0),
    switch("common_clock", "Whether the time of a ping is known; if not, only the differences of "
           "its arrivals count", True),
    switch("arrivals_shared", "Whether the arrivals of a ping are late together", False),
    parameter("imu_tilt_noise_std", "IMU: standard deviation of the white error of roll and pitch",
              "rad", start=radians(0.1), min=0.0, max=pi / 2),
    parameter("imu_tilt_error_std", "Prior: standard deviation of the lasting error of roll and "
              "pitch, of the IMU or of the frame of the beacons", "rad", start=radians(0.5),
              min=0.0, max=pi / 2),
)

COMPONENT = receiver(
    "Array", 12,
    "A Kalman filter as coupled, for an array that hears one ping: its arrivals share errors",
    (*(v for v in FILTER if v.name != "imu_tilt_std"), *_PING, WATCH),
    inputs=PING_POSE,
    outputs=SYSTEM,
    terminals=SYSTEM_TERMINALS,
)
RECEIVER = ReceiverDeclaration(
    COMPONENT,
    place=10,
    purpose="inverted ranging: an array that hears the diver's ping, of any size (USBL)",
    unfit={
        "buoys": WITH_BUOYS,
        "survey": "each beacon has an error of its own: try long_baseline",
    },
)
