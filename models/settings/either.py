"""Elementary functions of numbers, of CasADi symbols or of expressions.

Numbers go to `math` and Python's operators, so the bits are those of plain Python and CasADi is not
imported. The type decides, because `math.sqrt` of a symbol is NaN instead of an error. Expressions
(`sblcosim.models.settings.expression`) stand for the same operations as with numbers, one by one:
what is computed here from + - * / and roots has the same bits in Python and in C.

A root has no derivative at 0. Here a symbol's derivative is 0 there instead of NaN, so that the
derivative of its square, a variance, is right.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from .expression import UNKNOWN, Expression, computed


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
    """Natural logarithm of a positive value."""
    return _elementary("log", value)


def sin(value: Any) -> Any:
    """Sine of an angle [rad]."""
    return _elementary("sin", value)


def _elementary(name: str, value: Any) -> Any:
    if not symbolic(value):
        return getattr(math, name)(value)
    if _expression(value):
        return UNKNOWN
    import casadi as ca

    return getattr(ca, name)(value)


def hypot(*values: Any) -> Any:
    """Root of the sum of squares, of at least one value.

    Of numbers it is the nearest double in nearly all cases, like that of `math`, but it consists of
    + - * / and roots. A plain root of the sum differs from that in every fifth last bit.
    """
    if not symbolic(*values):
        some = [value for value in values if value]
        return nearest_root(some) if len(some) > 1 else abs(some[0]) if some else 0.0
    if _expression(*values):
        return computed("hypot", *values)
    return sqrt(total(map(square, values)))


def nearest_root(values: Iterable[Any]) -> Any:
    """Root of the sum of squares, corrected by what rounding took from squares and sum.

    T. J. Dekker, "A floating-point technique for extending the available precision", Numerische
    Mathematik 18, 1971.
    """
    found: Any = 0.0
    lost: Any = 0.0
    for value in values:
        own, beyond = _exact_square(value)
        new = found + own
        part = new - found
        lost = lost + ((found - (new - part)) + (own - part) + beyond)
        found = new
    root = sqrt(found)
    own, beyond = _exact_square(root)
    return root + ((found - own) - beyond + lost) / (2.0 * where(root > 0, root, 1.0))


_HALVES = 2.0**27 + 1.0
"""Splits a double into two halves, whose products are exact."""


def _exact_square(value: Any) -> tuple[Any, Any]:
    """The square of a value, and what it lacks of the exact one."""
    large = value * _HALVES
    high = large - (large - value)
    low, own = value - high, value * value
    return own, ((high * high - own) + 2.0 * high * low) + low * low


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
