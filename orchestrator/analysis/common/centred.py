"""Responses as deviations from their middle value, so that a large constant costs no digits.

Sums and squares of the runs themselves lose as many digits as the constant exceeds the scatter by:
of 10¹² + 0.3 nothing is left. Deviations from one of the values are exact for values within a
factor of two of it (Sterbenz, Floating-Point Computation, 1974, 4.3). Otherwise the constant is no
larger than the scatter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Groups = NDArray[np.intp]

ROUNDING = 1e-12
"""Values below this fraction of the largest deviation are rounding noise."""
DIGITS = 2 * np.finfo(np.float64).eps
"""Values below this fraction of the largest response are, too, as responses are rounded."""
NEAR = 0.5
"""Relative deviation up to which the logarithm of a ratio is computed from the deviation."""


@dataclass(frozen=True, eq=False)
class Centred:
    """A response as deviations from its centre.

    Attributes
    ----------
    centre
        The constant that is subtracted from all responses.
    off
        Response of each run minus the centre; shape (runs,).
    least
        Smaller values are rounding noise.
    """

    centre: float
    off: Floats
    least: float


def centred(y: Floats) -> Centred:
    """A response as deviations from the middle one of its ordered values."""
    middle = _middle(y)
    off = y - middle
    return Centred(middle, off, _least(off, float(np.abs(y).max())))


def centred_log(y: Floats) -> Centred:
    """The natural logarithm of a positive response, as deviations from that of its middle value."""
    middle = _middle(y)
    centre = float(np.log(middle))
    with np.errstate(over="ignore"):
        ratio = (y - middle) / middle
    near = np.abs(ratio) < NEAR
    off = np.where(near, np.log1p(np.where(near, ratio, 0.0)), np.log(y) - centre)
    return Centred(centre, off, _least(off, max(1.0, float(np.abs(off + centre).max()))))


def _middle(y: Floats) -> float:
    place = len(y) // 2
    return float(np.partition(y, place)[place])


def _least(off: Floats, largest: float) -> float:
    return float(max(ROUNDING * np.abs(off).max(), DIGITS * largest))


def group_means(group: Groups, y: Floats) -> Floats:
    """Mean of each group of runs, exact to the last digit but one for any number of runs."""
    runs = np.bincount(group)
    means: Floats = np.bincount(group, y) / runs
    means += np.bincount(group, y - means[group]) / runs
    return means
