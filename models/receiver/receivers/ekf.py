"""The paper's Extended Kalman Filter."""

from __future__ import annotations

from ..receiver import ReceiverDeclaration
from ..variables import BEACON_SOURCE, MODEL, NOISE, receiver

COMPONENT = receiver(
    "EKF", 4,
    "The paper's Extended Kalman Filter on the latest ranges, stale ones included, and depth",
    (BEACON_SOURCE, *MODEL, NOISE),
)
RECEIVER = ReceiverDeclaration(
    COMPONENT,
    purpose="comparisons with the paper",
)
