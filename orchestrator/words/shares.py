"""Shares in per cent. A share is from 0 to 1; that of a mean square may be below 0."""

from __future__ import annotations

from math import ceil, floor, isnan


def percent(share: float, form: str = "g") -> str:
    """``95 %``: a share in one of Python's formats."""
    return f"{100 * share:{form}} %"


def rough_percent(share: float) -> str:
    """``12 %``, ``3.4 %``, ``99.5 %``: whole per cents, or with a decimal near 0 and near 1.

    Only all of them are ``100 %``.
    """
    if 0.99 < share < 1:
        return percent(min(share, 0.999), ".1f")
    return percent(share, ".0f" if share >= 0.0995 or share == 0 else ".2g")


def whole_percent(share: float) -> str:
    """``12 %``, ``−3 %``: whole per cents with a true minus sign; empty if there is no share."""
    if isnan(share):
        return ""
    return f"{round(100 * share) + 0:.0f} %".replace("-", "−")


def column_percent(share: float) -> str:
    """``12.3 %``, ``< 0.1 %``: for a column of shares."""
    return "< 0.1 %" if 0 < share < 5e-4 else percent(share, ".1f")


def interval_percent(low: float, high: float) -> str:
    """``3–17``: an interval of a share, in whole per cents around it."""
    return f"{floor(100 * low)}–{ceil(100 * high)}"


def percent_at_least(share: float) -> str:
    """``98 %``, ``99.2 %``: a lower bound, rounded down."""
    digits = 0 if share < 0.99 else 1
    return f"{floor(100 * share * 10**digits) / 10**digits:.{digits}f} %"


def percent_at_most(share: float) -> str:
    """``3 %``: an upper bound, rounded up."""
    return f"{ceil(100 * share)} %"
