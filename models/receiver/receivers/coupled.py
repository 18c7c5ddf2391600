"""A filter of diver, platform and their sensors' errors.

RMS total error in 300 runs, and by how much its standard deviations are too large. Beacons on the
bottom (harbour-lbl): `long_baseline` 0.46 m, 6 %; `coupled` 0.58 m, 40 %; `fixed_lag` 0.41 m, 12 %.
Below buoys (gps-buoys): `long_baseline` 0.66 m, 10 %; `coupled` 0.52 m, 35 %; `fixed_lag` 0.35 m,
36 %.
"""

from __future__ import annotations

from ...ports import PING_POSE, SYSTEM
from ..receiver import ReceiverDeclaration
from ..variables import FILTER, SYSTEM_TERMINALS, WATCH, WITH_BUOYS, receiver

COMPONENT = receiver(
    "Coupled", 8,
    "A Kalman filter of diver, platform and their sensors' errors, with late arrivals and arcs",
    (*FILTER, WATCH),
    inputs=PING_POSE,
    outputs=SYSTEM,
    terminals=SYSTEM_TERMINALS,
)
RECEIVER = ReceiverDeclaration(
    COMPONENT,
    purpose="beacons on one platform, which share the errors of its GPS and IMU",
    unfit={
        "buoys": WITH_BUOYS,
        "survey": "each beacon has an error of its own: try long_baseline",
    },
)
