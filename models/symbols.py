"""CasADi, imported when it is first used: a declaration may stand beside its equations.

Declarations are read where there is no CasADi, and at the start of every command.
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
    """The absolute value of a number, an array or a symbol; `abs` takes symbols from 3.8 on."""
    return value.fabs() if hasattr(value, "fabs") else abs(value)
