"""Time in whole nanoseconds, and in seconds for people."""

from __future__ import annotations

import math
from decimal import Decimal
from functools import lru_cache

SECOND = 1_000_000_000
"""Nanoseconds per second. Time is counted in whole nanoseconds everywhere in the orchestrator."""

ROUNDING = 4
"""Units in the last place by which arithmetic may miss a nanosecond."""

MAX_SECONDS = 4e9
"""Upper limit of all times [s]; the C engine of our FMUs has the same limit (engine.h)."""


@lru_cache(1024)
def nanoseconds(seconds: float) -> int:
    """The whole nanoseconds nearest to a time in s, given as a decimal number."""
    return round(Decimal(repr(float(seconds))) * SECOND)


def is_whole_ns(seconds: float) -> bool:
    """Whether a time is a whole number of nanoseconds, apart from rounding errors."""
    nearest = nanoseconds(seconds) / SECOND
    return abs(seconds - nearest) <= ROUNDING * math.ulp(seconds)


def settled(seconds: float) -> float:
    """A time without its rounding errors: ``0.21 / 5`` is 0.042 s. Others stay unchanged."""
    return nanoseconds(seconds) / SECOND if is_whole_ns(seconds) else seconds


def text_of(time_ns: int) -> str:
    """A time for people, in s and without rounding: ``"0.1 s"``."""
    whole, rest = divmod(abs(time_ns), SECOND)
    digits = f"{whole}.{rest:09d}".rstrip("0").rstrip(".")
    return f"{'-' if time_ns < 0 else ''}{digits} s"
