"""The filter of `coupled`, whose estimates are of some time ago."""

from __future__ import annotations

from ...declaration import parameter
from ...ports import PING_POSE, SYSTEM
from ..receiver import ReceiverDeclaration
from ..variables import FILTER, SYSTEM_TERMINALS, WITH_BUOYS, receiver

COMPONENT = receiver(
    "FixedLag", 9,
    "The same filter, whose estimates are of some time ago and know what was received since",
    (
        parameter("lag", "Age of the estimates: what is received in this time after an epoch is "
                  "used for it, too", "s", start=20.0, min=0.01, max=3600.0),
        *FILTER,
    ),
    inputs=PING_POSE,
    outputs=SYSTEM,
    terminals=SYSTEM_TERMINALS,
)
RECEIVER = ReceiverDeclaration(
    COMPONENT,
    purpose="beacons as for coupled, where estimates may come some time after their epochs",
    unfit={
        "buoys": WITH_BUOYS,
        "survey": "each beacon has an error of its own: compare it with long_baseline",
    },
)
