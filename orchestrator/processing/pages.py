"""A processed log as a page plays it back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from ..data.estimates import Estimates, Floats, Integers
from ..data.truth import Truth
from ..judge.definitions import standing
from ..logs.log import Log
from ..web.playback import Playback, PlayedReceiver, remarks, some_of
from .quality import true_at


class PlayedLog(Protocol):
    """What a page needs of a `sblcosim.Processed`."""

    @property
    def log(self) -> Log: ...
    @property
    def truth(self) -> Truth | None: ...
    @property
    def main(self) -> str: ...
    @property
    def truth_axes(self) -> bool: ...
    @property
    def title(self) -> str: ...
    @property
    def answer(self) -> str: ...
    @property
    def remarks(self) -> Sequence[str]: ...

    def along(self, own_axes: bool) -> Mapping[str, Estimates]: ...


def played(it: PlayedLog) -> Playback:
    """What is along the axes of the main receiver; the platform as it reports itself."""
    log, own_axes = it.log, it.log.in_own_axes(it.main)
    truth = it.truth if own_axes == it.truth_axes else None
    shown = it.along(own_axes)
    heard = own_axes == log.in_own_axes("")
    each = [log.receptions.epoch_ns] if heard else []
    each += [] if truth is None else [truth.time_ns]
    times = np.unique(np.concatenate([*each, [log.start_ns, log.stop_ns]]))
    kept = times[some_of(len(times))]
    receivers = [_receiver(label, own, truth, log) for label, own in shown.items()]
    words = ("Forward", "Starboard") if own_axes else ("North", "East")
    return Playback(
        title=it.title, run=f"log {log.name}", verdict=it.answer.splitlines(),
        start_ns=log.start_ns, stop_ns=log.stop_ns, zero_ns=log.start_ns, axes=words,
        time_ns=kept, diver=None if truth is None else true_at(truth, kept),
        reported=_reported(log, kept) if heard and len(log.receptions) else None,
        receivers=receivers, error="horizontal" if log.meta.dimension == 2 else "total",
        remarks=[*remarks(len(times), {label: len(own) for label, own in shown.items()}),
                 *it.remarks],
    )


def _receiver(label: str, own: Estimates, truth: Truth | None, log: Log) -> PlayedReceiver:
    """Estimates in the order in which they became available."""
    own = own.chosen(np.argsort(own.epoch_ns, kind="stable"))
    since_ns, until_ns = standing(own, log.stop_ns)
    order = np.argsort(since_ns, kind="stable")
    own = own.chosen(order)
    return PlayedReceiver.of(
        label, own, None if truth is None else true_at(truth, own.epoch_ns), since_ns[order],
        until_ns[order],
    )


def _reported(log: Log, time_ns: Integers) -> Floats:
    """Where each beacon last said that it was, NED [m]; (n, beacons, 3)."""
    heard = log.receptions
    each = []
    for i in range(len(log.beacons)):
        order = np.flatnonzero(heard.beacon == i)
        if not len(order):
            each.append(np.full((len(time_ns), 3), np.nan))
            continue
        order = order[np.argsort(heard.epoch_ns[order], kind="stable")]
        last = np.searchsorted(heard.epoch_ns[order], time_ns, side="right") - 1
        each.append(heard.beacon_position[order][np.maximum(last, 0)])
    return np.stack(each, axis=1)
