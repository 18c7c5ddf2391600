"""Outliers: ranges that are too long because a late arrival is mistaken for the direct one."""

from __future__ import annotations

from math import pi, sqrt
from typing import Any

from ...declaration import choice, not_zero, number_of, parameter
from ...draws import Draw
from ...symbols import Symbols, ca
from ..range_error import RangeError

OUTLIERS = {1: "exponential", 2: "half_normal"}
_EXPONENTIAL = number_of(OUTLIERS, "exponential")
_UNIFORMS = 2.0**53
"""Number of values that a uniform draw can take."""


def _excess(p: Symbols, w: Symbols) -> Any:
    """Excess of an outlier [m]: never negative, with mean ``outlier_mean``.

    The half-normal distribution is the absolute value of a Box-Muller normal.
    """
    u = (w.excess + 0.5) / _UNIFORMS
    exponential = -ca.log(u[0])
    half_normal = sqrt(pi / 2) * ca.sqrt(2 * exponential) * ca.fabs(ca.cos(2 * pi * u[1]))
    return p.outlier_mean * ca.if_else(
        p.outlier_distribution == _EXPONENTIAL, exponential, half_normal
    )


def _outlier(p: Symbols, w: Symbols) -> Any:
    """Excess of a range if it is an outlier, else 0 [m]."""
    return ca.if_else(w.outlier < p.outlier_probability * _UNIFORMS, _excess(p, w), 0)


RANGE_ERROR = RangeError(
    number=2,
    words="outliers",
    parameters=(
        parameter("outlier_probability", "Probability that a range is an outlier", start=0.0,
                  min=0.0, max=1.0, needs=(not_zero("outlier_mean"),)),
        choice("outlier_distribution", "Distribution of an outlier's excess", OUTLIERS, 1,
               needs=(not_zero("outlier_probability"), not_zero("outlier_mean"))),
        parameter("outlier_mean", "Mean excess of an outlier", "m", start=1.0, min=0.0,
                  needs=(not_zero("outlier_probability"),)),
    ),
    error=_outlier,
    draws=(
        Draw("outlier", "uniform", "tick", 1, ("outlier_probability",)),
        Draw("excess", "uniform", "tick", 2, ("outlier_probability",) * 2),
    ),
    random=(("outlier_probability",), ("outlier_mean",)),
    sizes=("outlier_probability",),
    modelled=True,
)
