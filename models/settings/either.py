"""Elementary functions of numbers or CasADi symbols.

Numbers go to `math` and Python's operators, so the bits are those of plain Python and CasADi is not
imported. The type decides, because `math.sqrt` of a symbol is NaN instead of an error.

A root has no derivative at 0. Here a symbol's derivative is 0 there instead of NaN, so that the
derivative of its square, a variance, is right.
"""

from __future__ import annotations

import math
from typing import Any


def symbolic(*values: Any) -> bool:
    """Whether any of the values is a CasADi expression."""
    for value in values:
        kind = type(value)
        if kind is not float and kind is not int and kind.__module__.startswith("casadi."):
            return True
    return False


def sqrt(value: Any) -> Any:
    """Square root of a nonnegative value."""
    if not symbolic(value):
        return math.sqrt(value)
    import casadi as ca

    positive = value > 0
    return ca.if_else(positive, ca.sqrt(ca.if_else(positive, value, 1.0)), 0.0)


def exp(value: Any) -> Any:
    """Exponential of a value."""
    return _elementary("exp", value)


def log(value: Any) -> Any:
    """Natural logarithm of a positive value."""
    return _elementary("log", value)


def sin(value: Any) -> Any:
    """Sine of an angle [rad]."""
    return _elementary("sin", value)


def _elementary(name: str, value: Any) -> Any:
    if not symbolic(value):
        return getattr(math, name)(value)
    import casadi as ca

    return getattr(ca, name)(value)


def hypot(*values: Any) -> Any:
    """Root of the sum of squares."""
    if not symbolic(*values):
        return math.hypot(*values)
    return sqrt(sum(value * value for value in values))


def degrees(value: Any) -> Any:
    """Radians to degrees."""
    return value * (180.0 / math.pi) if symbolic(value) else math.degrees(value)


def radians(value: Any) -> Any:
    """Degrees to radians."""
    return value * (math.pi / 180.0) if symbolic(value) else math.radians(value)


def greatest(first: Any, second: Any) -> Any:
    """The larger of two values."""
    if not symbolic(first, second):
        return max(first, second)
    import casadi as ca

    return ca.fmax(first, second)


def clipped(value: Any, low: float, high: float) -> Any:
    """The value, clipped to the interval from ``low`` to ``high``."""
    if not symbolic(value):
        return value if low <= value <= high else min(max(value, low), high)
    import casadi as ca

    return ca.fmin(ca.fmax(value, low), high)


def both(first: Any, second: Any) -> Any:
    """Whether two conditions hold."""
    if not symbolic(first, second):
        return first and second
    import casadi as ca

    return ca.logic_and(first, second)


def where(condition: Any, value: Any, otherwise: Any) -> Any:
    """The first value where the condition holds, else the second.

    Both are evaluated, so neither may be NaN or infinite: the derivative of a symbol would be NaN.
    """
    if not symbolic(condition):
        return value if condition else otherwise
    import casadi as ca

    return ca.if_else(condition, value, otherwise)


def ratio(value: Any, positive: Any) -> Any:
    """The ratio of two values; 1 where the second is not positive."""
    known = positive > 0
    return where(known, value, 1.0) / where(known, positive, 1.0)
