"""Ranges that may be late: their probability, and a score of ranges that do not fit."""

from __future__ import annotations

from math import log, pi, sqrt
from typing import Any

import casadi as ca

from ..equations import Symbols

_WRONG, _REACH = 1e-4, 50.0
"""Share of ranges for which the filter itself is wrong, by up to this many m either way."""
LIMIT = 12.0
"""Score at which a filter restarts."""
_ACCEPTED = 1.1
"""Amount that a fitting range subtracts from the score."""
_TOO_SHORT = 8.0
"""Amount that a range which is too short adds to the score: that of its density, `_WRONG`/`_REACH`,
against one of 1/`_REACH` either way. A range may be late, but never early."""
_ERFC = (
    -1.26551223, 1.00002368, 0.37409196, 0.09678418, -0.18628806, 0.27886807, -1.13520398,
    1.48851587, -0.82215223, 0.17087277,
)
"""erfc(a) = t exp(-a² + poly(t)), t = 1/(1 + a/2), with a relative error of 1.2e-7 (W. H. Press et
al., Numerical Recipes in C, 2nd ed., 1992, section 6.2)."""


def score(p: Symbols, before: Any, share: Any, short: Any, ranged: Any) -> Any:
    """The score of ranges that do not fit (CUSUM).

    Parameters
    ----------
    share, short
        Probabilities that the range is punctual, and that it is too short.
    """
    evidence = log(0.9) - ca.log(ca.fmax(p.outlier_probability, 0.01))
    more = (1 - share) * evidence - _ACCEPTED * share + _TOO_SHORT * short
    return ca.if_else(ranged, ca.fmax(before + more, 0), before)


def wrong(innovation: Any, share: Any, density: Any) -> Any:
    """Probability that a range is neither punctual nor late, so that the filter is wrong.

    Parameters
    ----------
    share, density
        Probability that the range is punctual, and density of its innovation [1/m].
    """
    return ca.if_else(innovation < 0, 1 - share, _WRONG / _REACH / density)


def densities(p: Symbols, innovation: Any, S: Any) -> tuple[Any, Any]:
    """Densities of an innovation with variance S [1/m]: of punctual ranges, and of all others.

    The excess of a late range is exponentially distributed with mean m. All three densities have a
    common factor exp(-ν²/2S), unless that factor would be the smaller one.
    """
    chance, m = p.outlier_probability, p.outlier_mean
    root = ca.sqrt(S)
    a = (root / m - innovation / root) / sqrt(2)
    t = 1 / (1 + 0.5 * ca.fabs(a))
    poly = ca.SX(_ERFC[-1])
    for coefficient in reversed(_ERFC[:-1]):
        poly = poly * t + coefficient
    normal = -0.5 * innovation**2 / S
    exponential = ca.fmin(0.5 * S / m**2 - innovation / m, 0)
    early = t * ca.exp(poly + normal)  # a >= 0: a² cancels
    late = ca.exp(exponential) * 2 - t * ca.exp(poly + normal)
    density = chance / (2 * m) * ca.if_else(a >= 0, early, late) + _WRONG / _REACH
    return (1 - chance) / (sqrt(2 * pi) * root) * ca.exp(normal), density
