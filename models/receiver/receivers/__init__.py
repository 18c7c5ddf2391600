"""The receivers: each module of this folder declares one, named after its file."""

from __future__ import annotations

from collections.abc import Mapping

from ...found import modules_of
from ..receiver import ReceiverDeclaration, in_order

FOUND: Mapping[str, ReceiverDeclaration] = in_order(
    {name: module.RECEIVER for name, module in modules_of(__name__).items()}
)
"""By name, in the order of lists."""
