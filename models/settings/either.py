"""Elementary functions of numbers, of CasADi symbols or of expressions.

Numbers go to `math` and Python's operators, so the bits are those of plain Python and CasADi is not
imported. The type decides, because `math.sqrt` of a symbol is NaN instead of an error. Expressions
(`sblcosim.models.settings.expression`) stand for the same operations as with numbers, one by one:
what is computed from numbers here has the same bits in Python and in C (`exact`).

A root has no derivative at 0. Here a symbol's derivative is 0 there instead of NaN, so that the
derivative of its square, a variance, is right.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import lru_cache
from typing import Any

from . import exact
from .expression import Expression, computed


def symbolic(*values: Any) -> bool:
    """Whether any of the values is a CasADi symbol or an expression."""
    for value in values:
        kind = type(value)
        if kind is not float and kind is not int and (
            kind is Expression or kind.__module__.startswith("casadi.")
        ):
            return True
    return False


def _expression(*values: Any) -> bool:
    return Expression in map(type, values)


def sqrt(value: Any) -> Any:
    """Square root of a nonnegative value."""
    if not symbolic(value):
        return math.sqrt(value)
    if _expression(value):
        return computed("sqrt", value)
    import casadi as ca

    positive = value > 0
    return ca.if_else(positive, ca.sqrt(ca.if_else(positive, value, 1.0)), 0.0)


def square(value: Any) -> Any:
    """A value times itself: a power may differ from it in the last bit."""
    return value * value


def total(values: Iterable[Any]) -> Any:
    """Sum from first to last: `sum` compensates rounding errors in some versions of Python."""
    found: Any = 0.0
    for value in values:
        found = found + value
    return found


def exp(value: Any) -> Any:
    """Exponential of a value."""
    return _elementary("exp", value)


def log(value: Any) -> Any:
    """Natural logarithm of a value of at least 1."""
    return _elementary("log", value)


def sin(value: Any) -> Any:
    """Sine of an angle [rad]."""
    return _elementary("sin", value)


def _elementary(name: str, value: Any) -> Any:
    if not symbolic(value):
        return _of_number(name, value)
    if _expression(value):
        return getattr(exact, name)(value)
    import casadi as ca

    return getattr(ca, name)(value)


@lru_cache(4096)
def _of_number(name: str, value: float) -> float:
    found: float = getattr(exact, name)(value)
    return found


def hypot(*values: Any) -> Any:
    """Root of the sum of squares, of at least one value."""
    if not symbolic(*values):
        some = [value for value in values if value]
        return exact.hypot(*some) if len(some) > 1 else abs(some[0]) if some else 0.0
    if _expression(*values):
        return exact.hypot(*values)
    return sqrt(total(map(square, values)))


def rounded(value: Any) -> Any:
    """The nearest whole number. A symbol stays as it is: its derivative is the mean one."""
    if not symbolic(value):
        return math.floor(value + 0.5)
    return computed("floor", value + 0.5) if _expression(value) else value


def degrees(value: Any) -> Any:
    """Radians to degrees."""
    return value * (180.0 / math.pi) if symbolic(value) else math.degrees(value)


def radians(value: Any) -> Any:
    """Degrees to radians."""
    return value * (math.pi / 180.0) if symbolic(value) else math.radians(value)


def greatest(first: Any, second: Any) -> Any:
    """The larger of two values; the first if they are equal."""
    if not symbolic(first, second):
        return max(first, second)
    if _expression(first, second):
        return computed("least", first, second)
    import casadi as ca

    return ca.fmax(first, second)


def clipped(value: Any, low: float, high: float) -> Any:
    """The value, clipped to the interval from ``low`` to ``high``."""
    if not symbolic(value):
        return value if low <= value <= high else min(max(value, low), high)
    if _expression(value):
        value = computed("least", value, low) if low > -math.inf else value
        return computed("most", value, high) if high < math.inf else value
    import casadi as ca

    return ca.fmin(ca.fmax(value, low), high)


def both(first: Any, second: Any) -> Any:
    """Whether two conditions hold."""
    if not symbolic(first, second):
        return first and second
    if _expression(first, second):
        return computed("both", first, second)
    import casadi as ca

    return ca.logic_and(first, second)


def where(condition: Any, value: Any, otherwise: Any) -> Any:
    """The first value where the condition holds, else the second.

    Both are evaluated, so neither may be NaN or infinite: the derivative of a symbol would be NaN.
    """
    if not symbolic(condition):
        return value if condition else otherwise
    if _expression(condition):
        return computed("where", condition, value, otherwise)
    import casadi as ca

    return ca.if_else(condition, value, otherwise)


def ratio(value: Any, positive: Any) -> Any:
    """The ratio of two values; 1 where the second is not positive."""
    known = positive > 0
    return where(known, value, 1.0) / where(known, positive, 1.0)
