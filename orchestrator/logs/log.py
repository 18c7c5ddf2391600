"""Log: what was received and measured during a dive, from any source, checked."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..data import samples
from ..data.estimates import Estimates, Flags, Floats, Integers
from ..data.samples import Samples
from ..data.truth import Truth
from ..shown import Shown
from ..words.lists import counted, plural
from .columns import KINDS
from .meta import BEACONS, Meta
from .raw import Flaw

_DATED_NS = 946_684_800 * 10**9
"""Times from the year 2000 on count as dates [ns]."""
GAP = 5.0
"""A pause that is longer than the median by this factor is a gap."""
_SILENCE_S = 10.0
"""Ranges this long before the first depth or after the last one [s] have none, at least."""
_MOST_LINES = 5
"""Number of lines that a remark names."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Receptions:
    """Packets in the order of their arrival; shape (m, …).

    Attributes
    ----------
    arrival_ns, epoch_ns
        Time of the arrival, and the time to which the range belongs [ns].
    beacon
        Index of the beacon in `Log.beacons`.
    kind
        How the range was measured: index in `sblcosim.logs.columns.KINDS`.
    range
        [m].
    beacon_position
        As reported or, without a report, of the fixed beacon, NED [m]; (m, 3).
    has_pose
        Whether the packet holds the platform's pose.
    platform_position, platform_attitude
        That pose: NED [m], and roll, pitch, yaw [rad]; 0 without; (m, 3).
    packet
        Positions of all beacons in the packet, NED [m]; 0 without; (m, beacons, 3).
    line
        Line in the source; 0 if it has none.
    """

    arrival_ns: Integers
    epoch_ns: Integers
    beacon: NDArray[np.intp]
    kind: NDArray[np.intp]
    range: Floats
    beacon_position: Floats
    has_pose: Flags
    platform_position: Floats
    platform_attitude: Floats
    packet: Floats
    line: Integers

    def __len__(self) -> int:
        return len(self.range)

    def chosen(self, which: Flags | NDArray[np.intp]) -> Self:
        """The selected packets."""
        return type(self)(**{f.name: getattr(self, f.name)[which] for f in fields(self)})


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Log(Shown):
    """A checked log. Made by `sblcosim.logs.read.read_log`.

    Attributes
    ----------
    name
        Name of the log.
    meta
        What it says about itself.
    beacons
        Names of the beacons.
    receptions
        The packets.
    depth_ns, depth
        Readings of the depth sensor [ns], [m]; shape (d,).
    truth
        True positions on a clock and in a frame as `meta` says, or None.
    fixes
        Positions that devices have computed themselves, by the name of the device.
    findings
        Lines that were left out, or put right.
    remarks
        What else must be known, as sentences.
    scenario
        File of the scenario with the settings of this log, or None.
    entries
        Number of entries in the source, before any was left out, by the name of their table.
    source
        Path that the log was read from, as it was given; empty for other logs.
    turnaround_s
        Usual turn-around of two-way ranges [s]; 0: it is not in the log.
    """

    name: str
    meta: Meta
    beacons: tuple[str, ...]
    receptions: Receptions
    depth_ns: Integers
    depth: Floats
    truth: Truth | None = None
    fixes: Mapping[str, Estimates] = field(default_factory=dict)
    findings: tuple[Flaw, ...] = ()
    remarks: tuple[str, ...] = ()
    scenario: Path | None = None
    entries: Mapping[str, int] = field(default_factory=dict)
    source: str = ""
    turnaround_s: float = 0.0

    @property
    def start_ns(self) -> int:
        """Start of the log [ns]: as stated, or the first time in it."""
        first, stated = self._times()[0], self.meta.start_ns
        return first if stated is None else min(first, stated)

    @property
    def stop_ns(self) -> int:
        """End of the log [ns]: as stated, or the last time in it."""
        last, stated = self._times()[1], self.meta.stop_ns
        return last if stated is None else max(last, stated)

    def _times(self) -> tuple[int, int]:
        heard = self.receptions
        each = [heard.arrival_ns, heard.epoch_ns, self.depth_ns]
        each += [fixes.epoch_ns for fixes in self.fixes.values()]
        some = [times for times in each if len(times)]
        return (
            min(int(times.min()) for times in some), max(int(times.max()) for times in some)
        ) if some else (0, 0)

    @property
    def kinds(self) -> Mapping[str, float]:
        """The kinds of its ranges, and the share of each."""
        number, count = np.unique(self.receptions.kind, return_counts=True)
        shares = (count / max(count.sum(), 1)).tolist()
        return {KINDS[i]: share for i, share in zip(number.tolist(), shares, strict=True)}

    @property
    def dated(self) -> bool:
        """Whether its times are since 1970, rather than from a zero of the source."""
        return self.start_ns >= _DATED_NS

    @property
    def own_clock(self) -> bool:
        """Whether the truth has a clock of its own, with an unknown offset."""
        return self.meta.clock.truth.offset_s == "estimate"

    def in_own_axes(self, label: str) -> bool:
        """Whether estimates are along axes of their own, and not north and east.

        Parameters
        ----------
        label
            Name of a device in `fixes`, or of a receiver, whose axes are those of the beacons.
        """
        return (label if label in self.fixes else BEACONS) in self.meta.frame.own_axes

    @property
    def called(self) -> str:
        """The path that the log was read from, and its own name where that is another one."""
        if not self.source:
            return self.name
        same = self.name in (Path(self.source).name, Path(self.source).stem)
        return self.source if same else f"{self.source} ({self.name})"

    def sha256(self) -> str:
        """A hash of all data; equal for logs with equal data and statements.

        The name of the log and the lines of the source do not count.
        """
        said = [self.meta.model_dump_json(exclude={"name"}), *self.beacons, "", *self.fixes]
        digest = hashlib.sha256("\n".join(said).encode())
        tables: list[Receptions | Truth] = [self.receptions]
        if self.truth is not None:
            tables.append(self.truth)
        one_way = not self.receptions.kind.any()
        each = [getattr(table, f.name) for table in tables for f in fields(table)
                if f.name != "line" and not (f.name == "kind" and one_way)]
        each += [self.depth_ns, self.depth]
        each += [own for fixes in self.fixes.values() for own in fixes.columns().values()]
        for array in map(np.asarray, each):
            whole = array.dtype.kind in "biu"  # times in ns have more digits than a float
            kind = np.int64 if whole else np.float64
            digest.update(f"{array.shape} {whole}".encode() + array.astype(kind).tobytes())
        return digest.hexdigest()

    def samples(self, pose_source: int | None = None) -> Samples:
        """Ranges and depths for an estimator after the dive; times count from `start_ns`.

        Parameters
        ----------
        pose_source
            As for `sblcosim.data.samples.of_record`; None: the pose, if the packets hold it.
        """
        heard, start = self.receptions, self.start_ns
        posed = heard.has_pose & (pose_source != samples.OWN)
        order = np.lexsort((heard.beacon, heard.epoch_ns))
        place = np.where(posed[:, None], heard.platform_position, heard.beacon_position)
        turn = np.where(posed[:, None], heard.platform_attitude, 0.0)
        return Samples(
            0, self.depth_ns - start, self.depth, (heard.epoch_ns - start)[order],
            heard.beacon[order], heard.range[order], posed[order], place[order], turn[order],
        )

    def without_depth(self) -> list[str]:
        """Sentences on ranges before the first depth and after the last one."""
        heard = self.receptions.epoch_ns
        if not len(self.depth) or not len(heard) or self.meta.depth_is == "none":
            return []
        first, last = int(heard.min()), int(heard.max())
        if self.depth_ns[0] > last or self.depth_ns[-1] < first:
            return []  # all ranges are, which the check of the log says
        least = max(_SILENCE_S * 1e9, GAP * usual_pause(self.depth_ns))
        return [
            f"depth: no reading {where} {pause / 1e9:,.0f} s of the ranges: depths and claims "
            "there are to be doubted"
            for where, pause in (("in the first", int(self.depth_ns[0]) - first),
                                 ("in the last", last - int(self.depth_ns[-1])))
            if pause > least
        ]

    def counted(self) -> list[str]:
        """What was found in lines of the source: a sentence for each kind."""
        return told(self.findings)

    def _gist(self) -> str:
        span = (self.stop_ns - self.start_ns) / 1e9
        return (
            f"of {span:.0f} s: {counted(len(self.receptions), 'range')} of "
            f"{counted(len(self.beacons), 'beacon')}, {counted(len(self.depth), 'depth')}"
        )


def usual_pause(times_ns: Integers) -> float:
    """The median of the pauses between times in order [ns]; 0 without any."""
    pauses = np.diff(times_ns)
    return float(np.median(pauses[pauses > 0])) if (pauses > 0).any() else 0.0


def told(findings: tuple[Flaw, ...] | list[Flaw]) -> list[str]:
    """A sentence for each kind of finding, with the first lines."""
    kinds = Counter((f.file, f.what, f.used) for f in findings)
    sentences = []
    for (file, what, used), count in kinds.items():
        of_kind = (f.line for f in findings if (f.file, f.what, f.used) == (file, what, used))
        lines = list(dict.fromkeys(of_kind))
        shown = ", ".join(map(str, lines[:_MOST_LINES]))
        more = ", …" if len(lines) > _MOST_LINES else ""
        word = plural(len(lines), "line")
        end = "put right" if used else "left out"
        noun = "line" if len(lines) == count else "value"
        sentences.append(f"{file}: {counted(count, noun)} {end}: {what} ({word} {shown}{more})")
    return sentences
