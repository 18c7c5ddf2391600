"""Whether the diver has turned, which white acceleration hardly allows: a score of ranges.

After a turn the ranges of a narrow noise do not fit. Without a name for that, a filter takes them
for late ones and goes on as before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi
from typing import Any

import casadi as ca

from ..equations import Symbols

_LIMIT = 9.0
"""Logarithm of the likelihood ratio at which the diver has turned."""
_SINCE = 3.0
"""Pauses between ranges since the turn: one range alone seldom tells."""


@dataclass(frozen=True, slots=True)
class Turn:
    """What a range says of a turn.

    Attributes
    ----------
    begins
        Whether it is now taken for one: 0 or 1.
    doubt
        The score, 0 after a turn.
    pause
        Time between the last two epochs of ranges [s].
    since
        Time in which the diver may have gone elsewhere [s].
    """

    begins: Any
    doubt: Any
    pause: Any
    since: Any


def told(p: Symbols, x: Symbols, epoch: Any, innovation: Any, S: Any, density: Any) -> Turn:
    """Add a range to the score (CUSUM: E. S. Page, Biometrika 41, 1954, 100-115).

    Parameters
    ----------
    epoch
        Of the range [s].
    innovation, S
        Its innovation [m], and the variance of that [m²].
    density
        Of the innovation if there is no turn [1/m].
    """
    pause = ca.if_else(epoch > x.ranged, epoch - x.ranged, x.pause)
    since = _SINCE * pause
    wider = S + (p.prior_velocity_std * since) ** 2
    scale = ca.sqrt(2 * pi * wider) / (1 - p.outlier_probability)
    ratio = -0.5 * innovation**2 / wider - ca.log(scale * density)
    doubt = ca.fmax(x.doubt + ratio, 0)
    begins = doubt > _LIMIT
    return Turn(begins, ca.if_else(begins, 0, doubt), pause, since)


def widened(
    p: Symbols, P: Any, turn: Turn, begins: Any, position: Sequence[int], velocity: Sequence[int]
) -> Any:
    """The covariance if a turn begins: another velocity since then, as unknown as at the start.

    Only the upper triangle is changed; each index of a position is less than that of its velocity.
    """
    P = ca.SX(P)
    more = begins * p.prior_velocity_std**2
    for i, j in zip(position, velocity, strict=True):
        P[i, i] += more * turn.since**2
        P[i, j] += more * turn.since
        P[j, j] += more
    return P
