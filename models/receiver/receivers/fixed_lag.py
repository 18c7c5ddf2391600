"""The filter of `coupled` with delayed estimates."""

from __future__ import annotations

from ...declaration import parameter
from ...ports import PING_POSE, SYSTEM
from ..receiver import ReceiverDeclaration
from ..variables import FILTER, SYSTEM_TERMINALS, WITH_BUOYS, receiver

COMPONENT = receiver(
    "FixedLag", 9,
    "The same filter, with delayed estimates that use everything received since their epoch",
    (
        parameter("lag", "Age of the estimates: each also uses what is received in this time after "
                  "its epoch", "s", start=20.0, min=0.01, max=3600.0),
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
