"""The raw fix."""

from __future__ import annotations

from ..receiver import ReceiverDeclaration
from ..variables import BEACON_SOURCE, NOISE, receiver

COMPONENT = receiver(
    "Multilateration", 6,
    "Damped Gauss-Newton on the latest ranges and depth, no dynamics: the raw fix",
    (BEACON_SOURCE, NOISE),
)
RECEIVER = ReceiverDeclaration(
    COMPONENT,
    purpose="comparisons: what the ranges say without a filter",
    place=11,  # the reference for comparisons comes last
)
