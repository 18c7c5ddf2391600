"""The versions of the FMI standard, and their names of types."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

Fmi = Literal[2, 3]
"""Major version of the FMI standard."""

FMI2_TYPES: Mapping[str, str] = MappingProxyType(
    {"Float64": "Real", "Int32": "Integer", "Boolean": "Boolean"}
)
"""Names in FMI 2 of the types that both versions have, by their names in FMI 3."""
