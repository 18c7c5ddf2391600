"""What a page plays back: the motion of diver and beacons, and estimates with what they claim."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np

from ..data.arms import are_far
from ..data.estimates import Floats, Integers
from ..data.truth import recorded
from ..errors import ConfigurationError
from ..judge.definitions import of_position
from ..scenario.labels import FIXES
from ..shown import Shown

if TYPE_CHECKING:
    from ..data.estimates import Estimates
    from ..data.record import Record
    from ..judge.definitions import Judged

MOST = 6000
"""Most instants, and most estimates of a receiver, that a page holds: ten minutes at 10 Hz."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class PlayedReceiver(Shown):
    """Estimates of a receiver, each from when it stands; shape (m, …).

    Attributes
    ----------
    epoch_ns, since_ns, until_ns
        Time to which an estimate refers, and when it stands [ns]; see `sblcosim.judge.definitions`.
    position
        NED [m]; (m, 3).
    truth
        True position at the epoch, NED [m]; (m, 3); None or NaN where unknown.
    factor
        Lower triangular L of the claimed covariance L Lᵀ of the position [m]; (m, 3, 3); None or
        NaN where nothing is claimed.
    """

    label: str
    epoch_ns: Integers
    since_ns: Integers
    until_ns: Integers
    position: Floats
    truth: Floats | None = None
    factor: Floats | None = None

    @property
    def is_fix(self) -> bool:
        """Whether the estimates are drawn as separate dots."""
        return self.label in FIXES

    def _gist(self) -> str:
        return f"of {self.label}: {len(self.epoch_ns)} estimates"

    @classmethod
    def of(
        cls, label: str, estimates: Estimates, truth: Floats | None,
        since_ns: Integers, until_ns: Integers,
    ) -> Self:
        """At most `MOST` of the estimates, every n-th of them and the last one.

        Parameters
        ----------
        truth
            True positions at the epochs, NED [m]; (m, 3).
        """
        kept = some_of(len(estimates))
        factor = factor_of(estimates)
        # What stood until the next of those that are kept, stands as one.
        ends = np.append(kept[1:] - 1, len(estimates) - 1) if len(kept) else kept
        return cls(
            label=label, epoch_ns=estimates.epoch_ns[kept], since_ns=since_ns[kept],
            until_ns=until_ns[ends], position=estimates.position[kept],
            truth=None if truth is None else truth[kept],
            factor=None if factor is None else factor[kept],
        )


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Playback(Shown):
    """A run, or a log, as a page plays it.

    Attributes
    ----------
    title
        What was run, in words.
    run
        Which run it is: scenario, seed, receivers.
    verdict
        What is said about it, one line each.
    start_ns, stop_ns
        First and last instant [ns].
    axes
        Names of the horizontal axes.
    time_ns
        Instants of the motion [ns]; shape (n,).
    diver
        True positions, NED [m]; (n, 3); None if unknown.
    beacons, reported
        True positions of the beacons, and as they report them, NED [m]; (n, N, 3); None if unknown.
    receivers
        Estimates, the main receiver first.
    remarks
        What a reader must know about the picture.
    scenario
        The scenario as run, the text of its file; empty if there is none.
    zero_ns
        The instant that is shown as 0 [ns].
    error
        Kind of error that is shown first: ``total`` or ``horizontal``.
    """

    title: str
    run: str
    verdict: Sequence[str]
    start_ns: int
    stop_ns: int
    axes: tuple[str, str] = ("North", "East")
    time_ns: Integers
    diver: Floats | None = None
    beacons: Floats | None = None
    reported: Floats | None = None
    receivers: Sequence[PlayedReceiver] = ()
    remarks: Sequence[str] = ()
    scenario: str = ""
    zero_ns: int = 0
    error: Literal["total", "horizontal"] = "total"

    @property
    def has_arms(self) -> bool:
        """Whether the beacons may be on arms of one platform."""
        known = self.beacons if self.beacons is not None else self.reported
        return known is not None and not are_far(known[0])

    def _gist(self) -> str:
        return f"of {self.run}"


def of_record(
    record: Record, judged: Mapping[str, Judged], **words: Any
) -> Playback:
    """A run, from its record and the estimates with the truth.

    Parameters
    ----------
    words
        What a `Playback` says: ``title``, ``run``, ``verdict``, ``scenario``.

    Raises
    ------
    ConfigurationError
        There are no receivers.
    """
    if not judged:
        raise ConfigurationError("replay: the run must have a receiver, got none")
    kept = some_of(len(record))
    beacons, reported = (
        recorded(record, f"platform.{which}beacon_position")[kept] for which in ("", "reported_")
    )
    receivers = [
        PlayedReceiver.of(label, it.estimates, it.true_position, it.since_ns, it.until_ns)
        for label, it in judged.items()
    ]
    return Playback(
        **words, time_ns=record.time_ns[kept],
        start_ns=int(record.time_ns[0]), stop_ns=int(record.time_ns[-1]),
        diver=recorded(record, "target.position")[kept], beacons=beacons,
        reported=None if np.array_equal(beacons, reported) else reported,
        receivers=receivers,
        remarks=remarks(
            len(record), {label: len(it.epoch_s) for label, it in judged.items()}
        ),
    )


def remarks(instants: int, estimates: Mapping[str, int]) -> list[str]:
    """What a page leaves out, as sentences.

    Parameters
    ----------
    instants, estimates
        Number of instants, and of the estimates of each receiver, before any were left out.
    """
    every = [(n, name) for name, n in (("instant", instants), *estimates.items()) if n > MOST]
    told = [
        f"1 of {ceil(n / MOST)} {'instants' if name == 'instant' else f'estimates of {name}'}"
        for n, name in every
    ]
    return [f"Drawn: {', '.join(told)}. The verdicts are on all of them."] if told else []


def some_of(n: int) -> Integers:
    """Indices of every k-th of n rows, and of the last one: at most `MOST`."""
    step = ceil(n / MOST) or 1
    return np.arange(n)[::-step][::-1]


def factor_of(estimates: Estimates) -> Floats | None:
    """Lower triangular L of the position's covariance L Lᵀ [m]; (m, 3, 3).

    NaN where it is not positive definite. Of a receiver that gives only standard deviations, their
    diagonal; None if it claims nothing.
    """
    if estimates.covariance is None:
        std = estimates.position_std
        return None if std is None else std[:, :, None] * np.eye(3)
    P = of_position(estimates.covariance)
    L = np.zeros(P.shape)
    with np.errstate(invalid="ignore", divide="ignore"):
        for i in range(3):
            for j in range(i + 1):
                rest = P[:, j, i] - (L[:, i, :j] * L[:, j, :j]).sum(axis=1)
                L[:, i, j] = np.sqrt(rest) if i == j else rest / L[:, j, j]
    L[~np.isfinite(L).all(axis=(1, 2))] = np.nan
    return L
