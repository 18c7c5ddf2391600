"""The sea's spectrum, and how a floating body answers it: formulas for components and settings.

``m`` is a module with ``exp``, ``log``, ``sin`` and ``sqrt``: ``casadi`` for the component,
`sblcosim.models.settings.either` for what receivers assume. Formulas and sources are in the README
of this folder.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log, pi, sqrt
from typing import Any

GRAVITY = 9.81
"""Acceleration of gravity [m/s²]."""
DEVELOPED = 0.0
"""Value of the peak period that stands for the fully developed sea."""
LEAST_PERIOD = 0.5
"""Shortest peak period [s]."""
LOWEST, HIGHEST = 0.6, 5.0
"""Range of frequencies with waves, in peak frequencies. A small body answers higher ones too."""
WITHIN = sqrt(-2 * log(0.05))
"""Radius of the watch circle, in standard deviations of an axis: it holds 95 % of the places."""
_PARTS = 48
"""Parts of the range for averages over the spectrum; twice as many change them by below 1e-3."""


def greater(first: Any, second: Any) -> Any:
    """The larger of two numbers or symbols."""
    return first + (second - first) * (second > first)


def peak_rate(m: Any, height: Any, period: Any) -> Any:
    """Angular frequency of the peak [rad/s].

    Parameters
    ----------
    height
        Significant wave height [m].
    period
        Peak period [s], or `DEVELOPED`: T_p = 5.0 √H_s.
    """
    developed = 5.0 * m.sqrt(greater(height, 0.0))
    return 2 * pi / greater(period + (period == DEVELOPED) * developed, LEAST_PERIOD)


def width(m: Any, rate: Any, size: Any) -> Any:
    """Range of frequencies with waves, as the logarithm of highest over lowest.

    It reaches the wave that is as long as the body, at least.

    Parameters
    ----------
    rate
        Angular frequency of the peak [rad/s].
    size
        Length of the body [m].
    """
    as_long = m.sqrt(2 * pi * GRAVITY / size) / rate
    return m.log(greater(as_long, HIGHEST) / LOWEST)


def share(m: Any, x: Any, enhancement: Any) -> Any:
    """Share of the elevation's variance per unit of the logarithm of the frequency.

    Parameters
    ----------
    x
        Frequency in peak frequencies.
    enhancement
        Peak enhancement γ; 1: Pierson and Moskowitz.
    """
    q = 1 / (x * x)
    off = (x - 1) / (0.07 + 0.02 * (x > 1))
    grown = m.log(enhancement)
    peak = m.exp(grown * m.exp(-off * off / 2))
    return (1 - 0.287 * grown) * 5 * q * q * m.exp(-1.25 * q * q) * peak


def response(m: Any, number: Any, size: Any, draught: Any) -> Any:
    """Mean of a wave along a body, in amplitudes of the wave.

    Parameters
    ----------
    number
        Wave number [1/m].
    size, draught
        Length of the body, and its depth [m].
    """
    half = number * size / 2
    return m.sin(half) / half * m.exp(-number * draught)


@dataclass(frozen=True)
class MeanSquares:
    """Mean squares of a floating body's motion, all directions together.

    Attributes
    ----------
    place, place_rate
        Of heave, and of surge and sway together [m²], and of their rates [m²/s²].
    slope, slope_rate
        Of roll and pitch together [rad²], and of their rates [rad²/s²].
    """

    place: Any
    place_rate: Any
    slope: Any
    slope_rate: Any


def mean_squares(
    m: Any, height: Any, period: Any, enhancement: Any, size: Any, draught: Any
) -> MeanSquares:
    """Mean squares of the motion of a body in the sea; parameters as above."""
    rate = peak_rate(m, height, period)
    part = width(m, rate, size) / _PARTS
    sums: list[Any] = [0.0] * 4
    for i in range(_PARTS):
        x = LOWEST * m.exp((i + 0.5) * part)
        squared = (x * rate) * (x * rate)
        number = squared / GRAVITY
        moved = response(m, number, size, draught)
        place = height * height / 16 * share(m, x, enhancement) * part * moved * moved
        slope = number * number * place
        for n, term in enumerate((place, squared * place, slope, squared * slope)):
            sums[n] += term
    return MeanSquares(*sums)
