"""How many pings a log has missed, and how many in a row."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data.estimates import Floats, Integers

_TOLERANCE = 0.2
"""Share of a slot by which a gap may differ from whole slots."""
_REGULAR = 0.95
"""Share of the gaps that must be whole slots."""
_Z = 1.959964


@dataclass(frozen=True, slots=True)
class Losses:
    """Shares with their 95 % intervals: estimate, low, high.

    Attributes
    ----------
    share
        Of the pings that were lost.
    burst
        Mean number of pings lost in a row; None if none were lost.
    slot_s
        Time between two pings of a beacon [s].
    """

    share: tuple[float, float, float]
    burst: tuple[float, float, float] | None
    slot_s: float


def wilson(count: float, of: float) -> tuple[float, float, float]:
    """A share with its 95 % interval (E. B. Wilson, J. Am. Stat. Assoc. 22, 1927, 209-212)."""
    share = count / of
    middle = (share + _Z**2 / (2 * of)) / (1 + _Z**2 / of)
    half = _Z / (1 + _Z**2 / of) * np.sqrt(share * (1 - share) / of + _Z**2 / (4 * of**2))
    # Rounding must not make a bound of a share that is 0 or 1 another number.
    low = float(middle - half) if count > 0 else 0.0
    high = float(middle + half) if count < of else 1.0
    return share, max(0.0, low), min(1.0, high)


def losses(time_ns: Integers, beacon: Integers, slot_s: float | None = None) -> Losses | None:
    """Count the pings that are missing between the receptions of each beacon.

    Parameters
    ----------
    time_ns
        Times of the pings [ns].
    slot_s
        Time between two pings of a beacon [s]; None: the usual gap of the log.

    Returns
    -------
    Losses or None
        None if the pings have no regular schedule.
    """
    gaps = [np.diff(np.unique(time_ns[beacon == b])) / 1e9 for b in np.unique(beacon)]
    gap = np.concatenate([*gaps, np.empty(0)])
    if len(gap) < 10:
        return None
    slot = usual(gap) if slot_s is None else slot_s
    slots = np.rint(gap / slot)
    if np.mean((np.abs(gap / slot - slots) < _TOLERANCE) & (slots > 0)) < _REGULAR:
        return None
    missed = np.maximum(slots - 1, 0)
    lost, bursts = float(missed.sum()), int((missed > 0).sum())
    total = lost + len(gap)
    if not bursts:
        return Losses(wilson(0, total), None, slot)
    again = wilson(lost - bursts, lost)
    burst = tuple(1 / (1 - share) for share in again)
    # Losses in a row say less than as many that are independent of each other.
    linked = max(0.0, again[0] - bursts / len(gap))
    share = wilson(lost * (1 - linked) / (1 + linked), total * (1 - linked) / (1 + linked))
    return Losses(share, (burst[0], burst[1], burst[2]), slot)


def usual(gap: Floats) -> float:
    """The usual shortest gap."""
    near = gap[gap < 1.5 * np.quantile(gap, 0.05)]
    return float(np.median(near))
