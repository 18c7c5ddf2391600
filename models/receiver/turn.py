"""Whether the diver has turned, which white acceleration hardly allows: a score of ranges.

After a turn, ranges with little noise do not fit. A filter without this test takes them for late
ones and continues as before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi
from typing import Any

import casadi as ca

from ..equations import Symbols, Values

_LIMIT = 9.0
"""Log-likelihood ratio at which a turn is declared."""
_SINCE = 3.0
"""Assumed age of the turn, in intervals between ranges: one range alone seldom shows a turn."""


@dataclass(frozen=True, slots=True)
class Turn:
    """What a sample says about a turn.

    Attributes
    ----------
    begins
        Whether a turn is declared now: 0 or 1.
    again
        Whether the sample is to be used again by a filter that knows of the turn: it is too short,
        and so not late.
    doubt
        The score; 0 after a turn.
    ranged
        Epoch of the last range that has been used [s].
    pause
        Time between the last two epochs of ranges [s].
    since
        Assumed time since the turn [s].
    """

    begins: Any
    again: Any
    doubt: Any
    ranged: Any
    pause: Any
    since: Any

    @property
    def states(self) -> Values:
        """The states that remember it."""
        return {name: getattr(self, name) for name in _STATES}


_STATES = ("begins", "again", "doubt", "ranged", "pause")


def initial(t: Any) -> Values:
    """The states of the score at the start time."""
    return {**dict.fromkeys(_STATES, 0), "ranged": t}


def told(
    p: Symbols, x: Symbols, innovation: Any, S: Any, density: Any, counts: Any, follows: Any
) -> Turn:
    """Add a range at ``x.epoch`` to the score (CUSUM: E. S. Page, Biometrika 41, 1954, 100-115).

    Parameters
    ----------
    innovation, S
        Innovation [m] and its variance [m²].
    density
        Density of the innovation without a turn [1/m].
    counts
        Whether the sample is a range that may declare a turn: 0 or 1.
    follows
        Whether the filter does what the states say of the sample already: 0 or 1.
    """
    pause = ca.if_else(x.epoch > x.ranged, x.epoch - x.ranged, x.pause)
    since = _SINCE * pause
    wider = S + (p.prior_velocity_std * since) ** 2
    scale = ca.sqrt(2 * pi * wider) / (1 - p.outlier_probability)
    ratio = -0.5 * innovation**2 / wider - ca.log(scale * density)
    doubt = ca.fmax(x.doubt + ratio, 0)
    begins = (doubt > _LIMIT) * counts
    again = begins * (innovation < 0)
    found = Turn(
        begins, again,
        doubt=ca.if_else(counts, ca.if_else(begins, 0, doubt), x.doubt),
        ranged=ca.if_else(counts * (again == 0), x.epoch, x.ranged),
        pause=ca.if_else(counts, pause, x.pause),
        since=since,
    )
    states = {
        name: ca.if_else(follows, getattr(x, name), value) for name, value in found.states.items()
    }
    return Turn(**states, since=ca.if_else(follows, _SINCE * x.pause, since))


def widened(
    p: Symbols, P: Any, turn: Turn, position: Sequence[int], velocity: Sequence[int]
) -> Any:
    """The covariance if a turn begins: the velocity since then is as uncertain as at the start.

    Only the upper triangle changes. The index of each position is below that of its velocity.
    """
    P = ca.SX(P)
    more = turn.begins * p.prior_velocity_std**2
    for i, j in zip(position, velocity, strict=True):
        P[i, i] += more * turn.since**2
        P[i, j] += more * turn.since
        P[j, j] += more
    return P
