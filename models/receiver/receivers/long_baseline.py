"""A filter of the diver, the clock, and the individual error of each beacon."""

from __future__ import annotations

from ...declaration import not_zero, parameter
from ...ports import SYSTEM, terminal
from ..receiver import ReceiverDeclaration
from ..variables import CHANNEL, MOTION, START, receiver

_FIELD = (
    parameter("beacon_error_std", "Standard deviation of each beacon's own lasting error, north "
              "and east: of its survey, or of the coloured error of its GPS", "m", start=0.1,
              min=0.0),
    parameter("beacon_vertical_error_std", "The same for the down component", "m", start=0.1,
              min=0.0),
    parameter("beacon_error_time", "Correlation time of that error", "s", start=1e6, min=0.01,
              needs=(not_zero("beacon_error_std", "beacon_vertical_error_std"),)),
    parameter("beacon_noise_std", "Standard deviation of the white error of a beacon's reported "
              "position, north and east", "m", start=0.0, min=0.0),
    parameter("beacon_vertical_noise_std", "The same for the down component", "m", start=0.0,
              min=0.0),
)
_OF_FIELD = tuple(
    v for v in SYSTEM if v.name in ("clock_offset", "sound_speed", "restart_count", "motion_psd")
)

COMPONENT = receiver(
    "LongBaseline", 10,
    "A Kalman filter of the diver, the clock, and the error of each of several distant beacons",
    (*START, MOTION, *CHANNEL, *_FIELD),
    outputs=_OF_FIELD,
    terminals=(terminal("system", "system", "Newest estimate of the clock", _OF_FIELD),),
)
RECEIVER = ReceiverDeclaration(
    COMPONENT,
    purpose="beacons with errors of their own: below buoys, or surveyed on the bottom",
    unfit={"platform": "all beacons share the errors of one platform: try coupled"},
)
