"""A Kalman filter that takes each measurement at its own epoch."""

from __future__ import annotations

from ...declaration import Variable, not_zero, parameter
from ..receiver import ReceiverDeclaration
from ..variables import BEACON_SOURCE, MODEL, NOISE, receiver

COMPONENT = receiver(
    "Sequential", 5,
    "A Kalman filter that processes each reception and depth reading at its own epoch, once",
    (
        BEACON_SOURCE,
        *MODEL,
        NOISE,
        parameter("gate", "Innovations beyond this many standard deviations are rejected; 0 "
                  "switches the gate off", start=4.0, min=0.0),
        Variable("gate_limit", "Score of rejections at which the filter restarts from the latest "
                 "receptions: a rejected range adds 1, any other subtracts 1/2",
                 "parameter", start=5, min=1, max=1000, type="Int32", needs=(not_zero("gate"),)),
    ),
)
RECEIVER = ReceiverDeclaration(
    COMPONENT,
    purpose="beacons anywhere whose reported positions are good: it does not estimate their errors",
)
