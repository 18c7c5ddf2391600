"""The ports of a log: what a receiver would have seen at each of its ticks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus.host.nanoseconds import SECOND
from sblcosim.models.declaration import Variable
from sblcosim.models.ports import DEPTH, PING_POSE, RECEPTION

from ..data.estimates import Floats, Integers
from ..logs.log import Log

PORTS: tuple[Variable, ...] = (*RECEPTION, *PING_POSE, *DEPTH)
_NEVER = -1


@dataclass(frozen=True, eq=False)
class Played:
    """A log as the ports of `PORTS` at the ticks of a receiver.

    Only ticks at which a port changes are listed, so that a gap of hours takes no memory.

    Attributes
    ----------
    start_ns
        Time of the log at which the ticks begin [ns]: one tick before its first time, unless the
        log states its start.
    time_ns
        The start, which is 0, the first tick, those with something new, and the last [ns], in
        order; shape (n,).
    values
        By name of the port, from a tick to the next in `time_ns`; shape (n, …).
    tick, slot
        Of each reception: the place in `time_ns` of the tick at which it is new, and the place of
        its beacon; shape (m,).
    waited, replaced
        Number of receptions that had to wait for the next tick, as another of the same beacon came
        in the same; and of those that the next one replaced before any tick.
    """

    start_ns: int
    time_ns: Integers
    values: Mapping[str, NDArray[Any]]
    tick: Integers
    slot: NDArray[np.intp]
    waited: int
    replaced: int


def played(log: Log, interval_ns: int, slots: int, *, newest: bool = False) -> Played:
    """The ports of a log.

    A port holds one range of a beacon. A second one before the next tick waits for the tick after
    it or, with ``newest``, replaces the first, as in a simulation.

    Parameters
    ----------
    interval_ns
        Time between ticks [ns].
    slots
        Number of beacons that the receivers are made for. If there are more, a beacon takes the
        place of the one that has been silent for longest.
    """
    heard, start = log.receptions, start_of(log, interval_ns)
    due = -((start - heard.arrival_ns) // interval_ns)
    place = _places(heard.beacon, slots)
    tick, waited = (due, 0) if newest else _queued(due, place)
    stop = max(-((start - log.stop_ns) // interval_ns), int(tick.max(initial=0)))
    depth_ns, depth, deep = _depths(log, start, tick, interval_ns)
    read = np.flatnonzero(deep <= stop)
    ticks = np.unique(np.concatenate([[0, min(1, stop), stop], tick, deep[read]]))
    n, row = len(ticks), np.searchsorted(ticks, tick)
    last = np.full((n, slots), _NEVER)
    last[row, place] = np.arange(len(heard))  # of several, the last
    replaced = len(heard) - int((last != _NEVER).sum())
    last = np.maximum.accumulate(last, axis=0)
    newest_depth = _newest(np.searchsorted(ticks, deep[read]), read, n)
    count = np.zeros((n, slots), np.int64)
    np.add.at(count, (row, place), 1)
    values: dict[str, NDArray[Any]] = {
        "range": _latest(heard.range, last),
        "range_epoch": _latest((heard.epoch_ns - start) / SECOND, last),
        "reception_count": np.cumsum(count, axis=0).astype(np.int32),
        "ping_beacon_position": _latest(heard.beacon_position, last),
        "packet_beacon_position": _packets(log, row, n, slots),
        "ping_platform_position": _latest(heard.platform_position, last),
        "ping_platform_attitude": _latest(heard.platform_attitude, last),
        "arrival_epoch": _latest((heard.arrival_ns - start) / SECOND, last),
        "depth": _latest(depth, newest_depth),
        "depth_epoch": _latest(depth_ns / SECOND, newest_depth),
    }
    return Played(start, ticks * interval_ns, values, row, place, waited, replaced)


def start_of(log: Log, interval_ns: int) -> int:
    """Time of the log at which the ticks of a receiver begin [ns]."""
    return log.start_ns - (interval_ns if log.meta.start_ns is None else 0)


def _queued(due: Integers, place: NDArray[np.intp]) -> tuple[Integers, int]:
    """Ticks at which receptions are given, one of a beacon at each."""
    tick = due.copy()
    for one in np.unique(place):
        own = np.flatnonzero(place == one)
        steps = np.arange(len(own))
        tick[own] = np.maximum.accumulate(due[own] - steps) + steps
    return tick, int((tick > due).sum())


def _places(beacon: NDArray[np.intp], slots: int) -> NDArray[np.intp]:
    """Place of each reception's beacon among the ports."""
    if not len(beacon) or beacon.max() < slots:
        return beacon
    where: dict[int, int] = {}  # by beacon, the one silent for longest first
    places = []
    for one in beacon.tolist():
        at = where.pop(one, None)
        if at is None:
            at = len(where) if len(where) < slots else where.pop(next(iter(where)))
        where[one] = at
        places.append(at)
    return np.array(places, np.intp)


def _packets(log: Log, row: NDArray[np.intp], n: int, slots: int) -> Floats:
    """Positions of all beacons in the newest packet; (n, slots, 3)."""
    packet = log.receptions.packet
    shown = np.zeros((n, slots, 3))
    if packet.any() and packet.shape[1] <= slots:
        shown[:, : packet.shape[1]] = _latest(packet, _newest(row, np.arange(len(packet)), n))
    return shown


def _depths(
    log: Log, start: int, tick: Integers, interval_ns: int
) -> tuple[Integers, Floats, Integers]:
    """Readings of depth and the ticks at which they are new, by their times from the start [ns].

    Without depth, those of the plane of the beacons, with each range.
    """
    if log.meta.dimension == 2:
        return log.receptions.epoch_ns - start, np.full(len(tick), plane_of(log)), tick
    time = log.depth_ns - start
    return time, log.depth, time // interval_ns + 1  # it takes until the next tick, as simulated


def _newest(row: NDArray[np.intp], number: NDArray[np.intp], n: int) -> NDArray[np.intp]:
    """Number of the newest value at each of n rows; `_NEVER` before the first."""
    last = np.full(n, _NEVER)
    last[row] = number  # of several, the last
    newest: NDArray[np.intp] = np.maximum.accumulate(last)
    return newest


def _latest(values: NDArray[Any], newest: NDArray[np.intp]) -> NDArray[Any]:
    """The newest values, 0 before the first."""
    if not len(values):
        return np.zeros((*newest.shape, *values.shape[1:]))
    known = (newest != _NEVER).reshape(*newest.shape, *([1] * (values.ndim - 1)))
    return np.where(known, values[newest], 0.0)


def plane_of(log: Log) -> float:
    """Depth of the plane of a log in two dimensions [m]: the median of the beacons'."""
    depth = log.receptions.beacon_position[:, 2]
    return float(np.median(depth)) if len(depth) else 0.0
