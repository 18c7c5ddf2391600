"""The range errors: each module of this folder declares one, named after its file."""

from __future__ import annotations

from collections.abc import Mapping

from ...found import modules_of
from ..range_error import RangeError, numbered

FOUND: Mapping[str, RangeError] = numbered(
    {name: module.RANGE_ERROR for name, module in modules_of(__name__).items()}
)
"""Range errors by name, in the order of their numbers."""
