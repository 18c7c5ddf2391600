"""The heading of a boat that points where it goes, along a recorded track."""

from __future__ import annotations

import numpy as np

from .place import Floats

TURN = 10.0
"""Time [s] in which a boat turns at a corner of its track."""
WITHIN = 0.1
"""How well the heading is kept where points of the track are left out [rad]."""
_CLOSE = 1e-3
"""Times nearer to each other than this [s] are one."""


def headed(times: Floats, points: Floats, tolerance: float) -> tuple[Floats, Floats]:
    """Headings along a track: from where the boat was `TURN` / 2 before to where it will be then.

    Where that is nearer than the tolerance, the boat rests and keeps its heading.

    Parameters
    ----------
    times, points
        Ascending times [s]; rows of north and east [m].
    tolerance
        How well the positions are known [m].

    Returns
    -------
    times, headings
        The times, and some beside them [s]; headings there, not wrapped [rad].
    """
    beside = (times[:, None] + TURN * np.array([-0.5, -0.25, 0.25, 0.5])).ravel()
    beside = np.unique(beside[(beside > times[0]) & (beside < times[-1])].round(3))
    after = np.searchsorted(times, beside)
    nearest = np.minimum(beside - times[after - 1], times[after] - beside)
    at = np.sort(np.concatenate([times, beside[nearest > _CLOSE]]))

    def there(when: Floats) -> Floats:
        return np.stack([np.interp(when, times, points[:, axis]) for axis in (0, 1)], axis=1)

    way = there(at + TURN / 2) - there(at - TURN / 2)
    moves = np.hypot(*way.T) > tolerance
    if not moves.any():
        return at, np.zeros(len(at))
    last = np.maximum.accumulate(np.where(moves, np.arange(len(at)), -1))
    last = np.where(last < 0, int(np.argmax(moves)), last)
    return at, np.unwrap(np.arctan2(way[last, 1], way[last, 0]))
