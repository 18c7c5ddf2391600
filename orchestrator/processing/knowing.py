"""Which estimates of a recorded log are left out: those that know next to nothing."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus.host.nanoseconds import SECOND

from ..data.estimates import Estimates, Flags, Floats, Integers
from ..logs.columns import SIGNED
from ..logs.log import Log
from ..words.lists import counted
from ..words.numbers import meters, rounded
from .quality import std_of

_SILENCE_S, _SILENCES = 10.0, 10.0
"""Time without any range [s], and over the usual one between ranges, that makes a silence."""
_ENOUGH = 3
"""Number of beacons that give a position again."""
USUAL = 5.0
"""Claimed deviation over its median up to which a receiver knows its position again."""


def that_know(
    log: Log, estimates: Mapping[str, Estimates]
) -> tuple[dict[str, Estimates], list[str]]:
    """Estimates without those that know next to nothing, and remarks.

    These are estimates in silences, from depths and one or two beacons alone, and after them, until
    the claim is a usual one; and those that claim to know less than the longest range says by
    itself, as after a restart with few ranges.
    """
    silent, limit_s = silences(log)
    longest = longest_of(log)
    kept, remarks = {}, []
    for label, own in estimates.items():
        after = np.searchsorted(silent[:, 0], own.epoch_ns)
        until = np.append(-(2**63), silent[:, 1])[after]
        alone = own.epoch_ns < until
        std = std_of(own)
        size = np.zeros(len(own)) if std is None else np.nan_to_num(np.hypot(*std[:, :2].T))
        alone |= _settling(own.epoch_ns, size, after, alone)
        vague = size > longest
        left = alone | vague
        kept[label] = own.chosen(~left) if left.any() else own
        if alone.any():
            remarks.append(
                f"{label}: {counted(int(alone.sum()), 'estimate')} left out, more than "
                f"{rounded(limit_s, 2)} s after the last range, and before {_ENOUGH} beacons were "
                f"heard again and claims were at most {USUAL:g} times as large as usual"
            )
        if (vague & ~alone).any():
            remarks.append(
                f"{label}: {counted(int((vague & ~alone).sum()), 'estimate')} left out, whose "
                f"claimed deviation is above {meters(longest)}, the longest range"
            )
    return kept, remarks


def _settling(
    epoch: Integers, size: Floats, after: NDArray[np.intp], alone: Flags
) -> Flags:
    """Which estimates come after a silence, but before the first with a usual claim.

    Parameters
    ----------
    size
        Claimed deviation [m].
    after
        Number of silences that began before each estimate.
    alone
        Whether an estimate is in a silence.
    """
    if alone.all():
        return alone
    sure = ~alone & (size <= USUAL * float(np.median(size[~alone])))
    first = np.full(int(after.max()) + 1, 2**62)
    np.minimum.at(first, after[sure], epoch[sure])
    settling: Flags = (after > 0) & (epoch < first[after])
    return settling


def longest_of(log: Log) -> float:
    """The longest range [m]; infinite for differences, which say nothing of the distance."""
    return np.inf if SIGNED in log.kinds else float(log.receptions.range.max())


def silences(log: Log) -> tuple[Integers, float]:
    """Begin and end of the silences [ns], (n, 2), and how long no range makes one [s].

    A silence begins when no range has come for so long, and ends when three beacons have been heard
    again. The last one may have no end.
    """
    heard = log.receptions
    order = np.argsort(heard.epoch_ns, kind="stable")
    time, beacon = heard.epoch_ns[order], heard.beacon[order]
    steps = np.diff(np.unique(time))
    usual = float(np.median(steps)) if len(steps) else 0.0
    limit = round(max(_SILENCE_S * SECOND, _SILENCES * usual))
    rows = []
    for last in np.flatnonzero(np.diff(time, append=2**62) > limit):
        different: set[int] = set()
        end = 2**62
        for at in range(int(last) + 1, len(time)):
            different.add(int(beacon[at]))
            if len(different) == _ENOUGH:
                end = int(time[at])
                break
        rows.append((int(time[last]) + limit, end))
    return np.array(rows, np.int64).reshape(-1, 2), limit / SECOND
