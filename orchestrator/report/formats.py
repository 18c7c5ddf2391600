"""Numbers for people to read in a report."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from ..analysis.sentences import minus as true_minus
from ..analysis.sentences import rounded


def number(value: Any, digits: int = 3) -> str:
    """A number for people, or a dash."""
    if value is None or pd.isna(value):
        return "–"
    if np.isinf(value):
        return "∞" if value > 0 else "−∞"
    if 10**digits <= abs(value) < 1e7:
        return minus(f"{value:,.0f}")
    return minus(f"{value:.{digits}g}")


def minus(text: str) -> str:
    """With true minus signs before numbers, and units kept beside them."""
    return re.sub(r"(?<=\d) (?=(m|s)\b)", "\u00a0", true_minus(text))


def signed(value: float, digits: int = 3) -> str:
    """A number with its sign."""
    return f"{'+' if value > 0 else ''}{rounded(value, digits)}"


def probability(p: float) -> str:
    """A p value."""
    if pd.isna(p):
        return "–"
    return "< 0.0001" if p < 1e-4 else f"{p:.4f}"


def span(low: float, high: float, show: Callable[[float], str] = signed) -> str:
    """An interval."""
    return "–" if pd.isna(low) else f"{show(low)} to {show(high)}"
