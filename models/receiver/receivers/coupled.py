"""A filter of diver, platform and their sensors' errors.

RMS total error in 300 runs, and its covariance. Beacons on the bottom (harbour-lbl):
`long_baseline` 0.44 m, in band; `coupled` 0.57 m, pessimistic; `fixed_lag` 0.40 m, pessimistic.
Below buoys (gps-buoys): `long_baseline` 0.64 m, in band; `coupled` 0.48 m, pessimistic; `fixed_lag`
0.33 m, pessimistic.
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
