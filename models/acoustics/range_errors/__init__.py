"""The range errors: each module of this folder declares one, named after its file."""

from __future__ import annotations

from collections.abc import Mapping

from ...found import declared
from ..range_error import RangeError, numbered

FOUND: Mapping[str, RangeError] = numbered(declared(__name__, "RANGE_ERROR", RangeError))
"""Range errors by name, in the order of their numbers."""
