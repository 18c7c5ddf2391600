"""CasADi, imported on first use, so that declarations may stand next to their equations.

Declarations are also read without CasADi, and at the start of every command.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

Symbols = Any
"""A namespace of CasADi symbols."""
Values = Mapping[str, Any]
"""CasADi expressions (or numbers) by the name of a state or an output."""


class _Casadi:
    """The module ``casadi``, by its attributes."""

    def __getattr__(self, name: str) -> Any:
        return getattr(import_module("casadi"), name)


ca: Any = _Casadi()


def absolute(value: Any) -> Any:
    """The absolute value of a number, an array or a symbol; `abs` accepts symbols from 3.8 on."""
    return value.fabs() if hasattr(value, "fabs") else abs(value)
