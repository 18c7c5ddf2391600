"""Roots, exponentials, logarithms and sines of + - * / and square roots alone.

The libraries of C differ in the last bits of these functions. Here they are computed with about
twice the digits and rounded once, so that nearly all results are the nearest double, on every
machine and in generated C alike. Values are numbers or expressions. A pair stands for the
sum of its two doubles, the second of which is small.

T. J. Dekker, "A floating-point technique for extending the available precision", Numerische
Mathematik 18, 1971. D. E. Knuth, *The Art of Computer Programming*, volume 2, section 4.2.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import factorial
from typing import Any

from .expression import choice, outlined, root, whole

_Pair = tuple[Any, Any]
_HALVES = 2.0**27 + 1.0
"""Splits a double into two halves, whose products are exact."""
_LN_2 = (0.6931471803691238, 1.9082149292705877e-10, 1.1612227229362532e-26)
"""ln 2 as a sum; a product of the first term and a whole number below 2^20 is exact."""
_HALF_PI = (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21)
"""pi / 2 as a sum; so are products of the first two terms."""
_SQUARINGS = 4
_LOWEST = -700.0
"""Exponentials below this are 0."""


@outlined
def hypot(*values: Any) -> Any:
    """Root of the sum of squares."""
    found: Any = 0.0
    lost: Any = 0.0
    for value in values:
        own, beyond = _product(value, value)
        found, rest = _sum(found, own)
        lost = lost + (rest + beyond)
    nearest = root(found)
    own, beyond = _product(nearest, nearest)
    rest = (found - own) - beyond + lost
    return nearest + rest / (2.0 * choice(nearest > 0, nearest, 1.0))


@outlined
def exp(value: Any) -> Any:
    """Exponential of a value below 700."""
    x = choice(value < _LOWEST, _LOWEST, value)
    k = whole(x / (_LN_2[0] + _LN_2[1]) + 0.5)
    high, low = _product(k, _LN_2[1])
    reduced = _sum(x - k * _LN_2[0], -high)
    grown = _growth(_plus(reduced, (-low - k * _LN_2[2], 0.0)))
    one, rest = _sum(1.0, grown[0])
    return choice(value < _LOWEST, 0.0, (one + (rest + grown[1])) * _power_of_two(k))


@outlined
def log(value: Any) -> Any:
    """Natural logarithm of a value from 1 to 2^1023."""
    m, k = value, 0.0
    for j in range(9, -1, -1):
        many = m >= 2.0 ** 2**j
        m, k = choice(many, m * 2.0 ** -(2**j), m), choice(many, k + 2.0**j, k)
    large = m > 1.4
    m, k = choice(large, m * 0.5, m), choice(large, k + 1.0, k)
    s = (m - 1.0) / (m + 1.0)
    first = 2.0 * s * _series(s * s, [1.0 / (2 * i + 1) for i in range(12)])
    # What the first logarithm lacks: ln(m exp(-first)), which is almost m exp(-first) - 1.
    fallen = _growth((-first, 0.0))
    lacking = _plus(_times(fallen, (m, 0.0)), (m - 1.0, 0.0))
    high, low = _product(k, _LN_2[1])
    found = _plus(_sum(k * _LN_2[0], high), (first, low + k * _LN_2[2]))
    found = _plus(found, lacking)
    return found[0] + found[1]


@outlined
def sin(value: Any) -> Any:
    """Sine of an angle below a million [rad]."""
    k = whole(value / _HALF_PI[0] + 0.5)
    high, low = _product(k, _HALF_PI[2])
    near = _sum(value - k * _HALF_PI[0], -(k * _HALF_PI[1]))
    r = _plus(near, (-high, -low))
    z = _times(r, r)
    sine = _plus(r, _times(_times(r, z), _alternating(z, 3, 2)))
    cosine = _plus((1.0, 0.0), _times(z, _alternating(z, 2, 3)))
    quarter = k - 4.0 * whole(k * 0.25)
    odd = quarter - 2.0 * whole(quarter * 0.5) > 0.5
    found = choice(odd, cosine[0] + cosine[1], sine[0] + sine[1])
    return choice(quarter > 1.5, -found, found)


def _growth(x: _Pair) -> _Pair:
    """exp(x) - 1, for x from -0.4 to 0.4."""
    u = x[0] * 2.0**-_SQUARINGS, x[1] * 2.0**-_SQUARINGS
    square = _times(u, u)
    tail = u[0] * square[0] * _series(u[0], [1.0 / factorial(n) for n in range(3, 11)])
    found = _plus(_plus(u, (square[0] * 0.5, square[1] * 0.5)), (tail, 0.0))
    for _ in range(_SQUARINGS):  # exp(2u) - 1 = 2 (exp(u) - 1) + (exp(u) - 1)²
        found = _plus((found[0] * 2.0, found[1] * 2.0), _times(found, found))
    return found


def _alternating(z: _Pair, first: int, pairs: int) -> _Pair:
    """-1/n! + z/(n+2)! - z²/(n+4)! ..., the first terms as pairs."""
    terms = [(n, -1.0 if (n - first) % 4 == 0 else 1.0) for n in range(first, first + 20, 2)]
    found: _Pair = _series(z[0], [sign / factorial(n) for n, sign in terms[pairs:]]), 0.0
    for n, sign in reversed(terms[:pairs]):
        found = _plus(_times(found, z), _inverse(sign, factorial(n)))
    return found


def _inverse(sign: float, whole_number: int) -> _Pair:
    """A sign over a whole number below 2^53, as a pair."""
    first = sign / whole_number
    own, beyond = _product(first, float(whole_number))
    return first, ((sign - own) - beyond) / whole_number


def _series(x: Any, coefficients: Sequence[float]) -> Any:
    """Sum of coefficients times powers of x, by Horner's rule."""
    *others, found = coefficients
    for coefficient in reversed(others):
        found = found * x + coefficient
    return found


def _power_of_two(k: Any) -> Any:
    """2 to a whole number from -1022 to 1023."""
    found: Any = 2.0**-1022
    rest = k + 1022.0
    for j in range(11):
        half = whole(rest * 0.5)
        odd = rest - 2.0 * half > 0.5
        for power in (512, 512) if j == 10 else (2**j,):  # 2^1024 is not a double
            found = found * choice(odd, 2.0**power, 1.0)
        rest = half
    return found


def _sum(a: Any, b: Any) -> _Pair:
    found = a + b
    part = found - a
    return found, (a - (found - part)) + (b - part)


def _product(a: Any, b: Any) -> _Pair:
    own = a * b
    high_a, high_b = _high(a), _high(b)
    low_a, low_b = a - high_a, b - high_b
    beyond = ((high_a * high_b - own) + high_a * low_b + low_a * high_b) + low_a * low_b
    return own, beyond


def _high(a: Any) -> Any:
    large = a * _HALVES
    return large - (large - a)


def _plus(a: _Pair, b: _Pair) -> _Pair:
    high, low = _sum(a[0], b[0])
    return _sum(high, low + (a[1] + b[1]))


def _times(a: _Pair, b: _Pair) -> _Pair:
    high, low = _product(a[0], b[0])
    return _sum(high, low + (a[0] * b[1] + a[1] * b[0]))
