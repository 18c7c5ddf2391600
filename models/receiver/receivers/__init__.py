"""The receivers: each module of this folder declares one, named after its file."""

from __future__ import annotations

from collections.abc import Mapping

from ...found import declared
from ..receiver import ReceiverDeclaration, in_order

FOUND: Mapping[str, ReceiverDeclaration] = in_order(
    declared(__name__, "RECEIVER", ReceiverDeclaration)
)
"""By name, in the order of lists."""
