"""Numbers for people: digits, units, signs and intervals."""

from __future__ import annotations

import re
from collections.abc import Callable
from math import ceil, isfinite, isinf, isnan
from typing import Any

PRACTICAL_RUNS = 10_000
"""Largest number of runs that a sentence asks for."""
MOST_WHOLE = 1e7
"""Numbers from here on have a power of ten instead of all their digits."""


def is_missing(value: float | None) -> bool:
    """Whether a number is missing: None or NaN."""
    return value is None or isnan(value)


def minus(text: str) -> str:
    """Replace hyphens before numbers by true minus signs."""
    return re.sub(r"(?<![\w.])-(?=\d)", "−", re.sub(r"(?<=\de)-(?=\d)", "−", text))


def unbroken(text: str) -> str:
    """Use true minus signs, and no line break between a number and its unit."""
    return re.sub(r"(?<=\d) (?=(m|s)\b)", "\u00a0", minus(text))


def rounded(value: float, digits: int = 3) -> str:
    """A number with that many significant digits, trailing zeros included, and a true minus."""
    if not isfinite(value):
        return "–" if isnan(value) else "∞" if value > 0 else "−∞"
    if value == 0:
        return "0"
    whole = 10**digits <= abs(value) < MOST_WHOLE
    text = f"{value:,.0f}" if whole else f"{value:#.{digits}g}"
    return minus(text.removesuffix("."))


def signed(value: float, digits: int = 3) -> str:
    """A rounded number with its sign."""
    return f"{'+' if value > 0 else ''}{rounded(value, digits)}"


def number(value: Any, digits: int = 3) -> str:
    """A number without trailing zeros in a table cell; a dash if it is missing."""
    if is_missing(value):
        return "–"
    if isinf(value):
        return "∞" if value > 0 else "−∞"
    if 10**digits <= abs(value) < MOST_WHOLE:
        return unbroken(f"{value:,.0f}")
    return unbroken(f"{value:.{digits}g}")


def figure(value: float, digits: int = 3, missing: str = "–") -> str:
    """A finite number, or the replacement for a missing one."""
    return f"{value:.{digits}g}" if isfinite(value) else missing


def quantity(value: float | str, unit: str) -> str:
    """A given number with its unit; a name stays unchanged."""
    if isinstance(value, str):
        return value
    return minus(with_unit(f"{value:g}", unit))


def with_unit(text: str, unit: str) -> str:
    """A text of a number with its unit; degrees of an angle follow without a space."""
    return f"{text}{unit}" if unit == "°" else f"{text} {unit}".rstrip()


def measured(value: float, unit: str, digits: int = 3) -> str:
    """A rounded number with its unit; a dash if it is missing."""
    return "–" if isnan(value) else with_unit(rounded(value, digits), unit)


def interval(
    low: float, high: float, show: Callable[[float], str] = rounded, unit: str = ""
) -> str:
    """``1.20 to 3.40 m``; a dash if there is no interval."""
    return "–" if is_missing(low) else f"{show(low)} to {show(high)} {unit}".rstrip()


def bounds(low: float, high: float) -> str:
    """``≥ 1.2, ≤ 3.4``: the finite bounds; a dash if there are none."""
    ends = [(low, "≥"), (high, "≤")]
    return ", ".join(f"{sign} {figure(end)}" for end, sign in ends if isfinite(end)) or "–"


def meters(length: float) -> str:
    """A length in m for a sentence, with two significant digits."""
    if not isfinite(length):
        return "– m"
    if length >= 1e6:  # from a filter that diverges
        return f"{length:.1e} m"
    return f"{length:,.{_digits(length)}f} m"


def meters_at_most(length: float) -> str:
    """An upper bound in m for a sentence, with two leading digits: rounded up."""
    if not isfinite(length) or length >= 1e6:
        return meters(length)
    digits = _digits(length)
    unit = 10.0**-digits
    return f"{ceil(length / unit - 1e-9) * unit:,.{digits}f} m"


def _digits(length: float) -> int:
    return 0 if length >= 9.95 else 1 if length >= 0.995 else 2 if length >= 0.0995 else 3


def short_length(length: float) -> str:
    """A length in m for a table or a title; empty if it is missing."""
    if isnan(length):
        return ""
    return f"{length:.1e} m" if length >= 1e4 else f"{length:.{2 if length >= 0.0995 else 3}f} m"


def ordinal(number: float) -> str:
    """``90th``, ``91st``, ``97.5th``."""
    last, tens = number % 10, number % 100 // 10
    endings: dict[float, str] = {1: "st", 2: "nd", 3: "rd"}
    ending = endings.get(last, "th") if tens != 1 else "th"
    return f"{number:g}{ending}"


def p_value(p: float) -> str:
    """A probability in a sentence."""
    return "<1e-300" if p < 1e-300 else f"{p:.2g}"


def probability(p: float) -> str:
    """A probability in a table cell; a dash if it is missing."""
    if is_missing(p):
        return "–"
    return "< 0.0001" if p < 1e-4 else f"{p:.4f}"
