"""Process a log: from its file to tables and figures, in one call."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import hypot
from pathlib import Path
from typing import Any

import numpy as np
from sblcosim.fmus.host.nanoseconds import SECOND
from sblcosim.fmus.stopping import interruptible
from sblcosim.models import RECEIVERS

from ..data.estimates import Estimates, Integers
from ..logs.columns import SIGNED
from ..logs.log import Log
from ..logs.read import read_log
from ..scenario.files import naming_files
from ..scenario.labels import RAW
from ..scenario.overrides import Changes
from ..scenario.scenario import Receivers, Scenario
from ..scenario.sources import Choice, choice_of
from ..simulation.children.process import patient
from ..simulation.how import How
from ..words.lists import counted, listed
from ..words.numbers import meters, rounded
from .align import aligned
from .processed import Processed, manifest_of
from .quality import misfit, std_of
from .running import Ran, doubts_of, ran
from .settings import Settled, drift_of, settled

_CARRIERS = {
    "platform": "beacons on one platform, whose pose the packets report",
    "fixed": "fixed beacons",
    "buoys": "beacons that move on their own, as below buoys",
}
_ALIKE = 3.0
"""Resemblance of residuals from which claims are doubted. That of simulated dives is 2.8 at most:
their errors are independent, but offsets of beacons make residuals alike, too."""
_SPREAD = 2.0
"""Spread of a platform's reported positions over what its settings explain, from which it is
told."""
_SILENCE_S, _SILENCES = 10.0, 10.0
"""Time without any range [s], and over the usual one between ranges, that makes a silence."""
_ENOUGH = 3
"""Number of beacons that give a position again."""
_SAME = 100
"""Number of equal readings of depth that no sensor gives."""


@interruptible
@naming_files
@patient
def process(
    log: str | Path | Log,
    receiver: Receivers = (),
    overrides: Changes = (),
    *,
    scenario: str | Path | Mapping[str, Any] | Scenario | None = None,
    mapping: str | Path | None = None,
    smooth: bool = False,
    interval_s: float | None = None,
    fmi: int | None = None,
    step_timeout: float | None = None,
    progress: Callable[[float], None] | None = None,
    before: Callable[[Mapping[str, Any]], None] | None = None,
) -> Processed:
    """Run receivers on recorded receptions and depths, side by side.

    Ranges that are far too short are left out, and said: receivers weigh late ranges, but believe
    those that are too short. Receivers start where a straight line fits the first ranges. No truth
    is used for either.

    Parameters
    ----------
    log
        The folder or file of a log, or a log from `sblcosim.read_log`.
    receiver
        As in `sblcosim.run`. None: the one of the settings.
    overrides
        Keys of the settings to change, for example ``{"acoustics.range_std_m": 0.3}``.
    scenario
        A scenario with the settings, such as `sblcosim.identify` writes. None: that of the log, if
        it has one, otherwise usual values, with the scatter of the ranges from the log.
    mapping
        File that says which column of the log is what; see `sblcosim.read_log`.
    smooth
        Whether to estimate the most probable track of the whole log, too.
    interval_s
        Time between the updates of the receivers [s]; None: from the log.
    fmi
        FMI version (2 or 3) of our own receivers.
    step_timeout
        Time limit for a call of a third-party FMU [s].
    progress
        Called at intervals with the completed share, 0 to 1.
    before
        Called with what is known of the manifest, before a receiver runs.

    Returns
    -------
    processed
        Tables, figures and remarks. With a truth: errors. Without: residuals, and how far receivers
        agree.

    Raises
    ------
    ConfigurationError
        The log, the scenario or an argument is invalid.
    FmuError
        A receiver cannot be built or has failed, and none is left.

    Examples
    --------
    >>> processed = sblcosim.process("dive/", ["coupled", "mine.fmu"])    # doctest: +SKIP
    >>> processed.receivers.horizontal_rms_m                              # doctest: +SKIP
    """
    heard = log if isinstance(log, Log) else read_log(log, mapping)
    if not len(heard.receptions) and heard.fixes:
        return _of_devices(heard)
    ready = settled(heard, scenario, overrides, interval_s)
    choice = choice_of(ready.scenario, receiver, fmi)
    asked = {"receivers": [*choice.receivers], "smooth": smooth}
    if before is not None:
        before(manifest_of(ready.log, ready.scenario, ready.interval_ns, asked))
    made = ran(ready.log, ready, choice, How(None, step_timeout, progress=progress))
    main = next((label for label in choice.receivers if label in made.estimates), "")
    estimates = dict(made.estimates)
    said = [*_remarks(ready, choice, made)]
    doubts: Sequence[str] = ()
    if smooth:
        from .smoothing import SMOOTHER, smoothed

        own, doubts, remarks = smoothed(ready, made)
        estimates = {**_without_raw(estimates), SMOOTHER: own, **_only_raw(estimates)}
        said += remarks
    if not ready.newest:
        estimates, remarks = _that_know(ready.log, estimates)
        said += remarks
    estimates |= {label: own for label, own in heard.fixes.items() if label not in estimates}
    if main:
        said += misfit(ready.log, made.estimates[main])
    found = aligned(ready.log, estimates[main]) if main else None
    if found is not None and (words := found[1].told(main)):
        said.append(words)
    if found is None and heard.truth is not None:
        said.append("truth: not used, as too few estimates have a time in common with it")
    return Processed(
        log=ready.log, scenario=ready.scenario, made=estimates,
        truth=None if found is None else found[0],
        restarts=_restarts(made), failures=made.failures, origins=made.origins,
        interval_ns=ready.interval_ns, said=said, doubts=doubts, asked=asked,
    )


def _that_know(
    log: Log, estimates: Mapping[str, Estimates]
) -> tuple[dict[str, Estimates], list[str]]:
    """Estimates without those that know next to nothing, and remarks.

    These are estimates in silences, from depths and one or two beacons alone, and those that claim
    to know less than the longest range says by itself, as after a restart with few ranges.
    """
    silences, limit_s = _silences(log)
    whole = SIGNED not in log.kinds  # differences say nothing of the distance
    longest = float(log.receptions.range.max()) if whole else np.inf
    kept, remarks = {}, []
    for label, own in estimates.items():
        after = np.searchsorted(silences[:, 0], own.epoch_ns)
        until = np.append(-(2**63), silences[:, 1])[after]
        alone = own.epoch_ns < until
        std = std_of(own)
        vague = np.zeros(len(own), bool) if std is None else np.hypot(*std[:, :2].T) > longest
        left = alone | vague
        kept[label] = own.chosen(~left) if left.any() else own
        if alone.any():
            remarks.append(
                f"{label}: {counted(int(alone.sum()), 'estimate')} left out, more than "
                f"{rounded(limit_s, 2)} s after the last range, and before {_ENOUGH} beacons were "
                "heard again"
            )
        if (vague & ~alone).any():
            remarks.append(
                f"{label}: {counted(int((vague & ~alone).sum()), 'estimate')} left out, whose "
                f"claimed deviation is above {meters(longest)}, the longest range"
            )
    return kept, remarks


def _silences(log: Log) -> tuple[Integers, float]:
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


def _without_raw(estimates: Mapping[str, Estimates]) -> dict[str, Estimates]:
    return {label: own for label, own in estimates.items() if label != RAW}


def _only_raw(estimates: Mapping[str, Estimates]) -> dict[str, Estimates]:
    return {label: own for label, own in estimates.items() if label == RAW}


def _restarts(made: Ran) -> dict[str, int]:
    counts = {label: f"{label}.restart_count" for label in made.estimates}
    return {
        label: int(made.record.values[name][-1]) for label, name in counts.items()
        if name in made.record.values
    }


def _remarks(ready: Settled, choice: Choice, made: Ran) -> list[str]:
    """Where the settings are from, what carries the beacons, and what had to wait."""
    lines = [f"{ready.said}; {_CARRIERS[ready.arrangement]}"]
    if ready.platform is not None:
        with_platform = [
            label for label, source in choice.receivers.items()
            if isinstance(source, str) and "beacon_offset" in {v.name for v in RECEIVERS[source]}
        ]
        if with_platform:
            lines.append(
                f"{listed(with_platform)}: the fixed beacons count as those of a platform without "
                "motion and errors"
            )
    if made.played.waited:
        lines.append(
            f"{counted(made.played.waited, 'range')} waited for the next update, as receivers take "
            f"one of a beacon in {ready.interval_ns / 1e9:g} s"
        )
    if len(ready.log.beacons) > ready.slots:
        lines.append(
            f"{len(ready.log.beacons)} beacons share the {ready.slots} places of the receivers, by "
            "latest use"
        )
    return [*lines, *_claims(ready), *doubts_of(ready, choice)]


def _claims(ready: Settled) -> list[str]:
    """What speaks against claimed errors before a receiver has run."""
    if ready.newest:
        return []
    log, lines = ready.log, []
    platform = ready.scenario.platform
    if ready.arrangement == "platform" and not platform.watch_circle_m:
        spread = drift_of(log)
        errors = hypot(
            platform.gps_horizontal_std_m, platform.gps_horizontal_markov_std_m,
            platform.gps_horizontal_bias_std_m, platform.surge_amplitude_m,
            platform.sway_amplitude_m,
        )
        if spread > _SPREAD * max(errors, 1.0):
            lines.append(
                f"platform: 95 % of its reported positions spread over {meters(spread)}, but in "
                "the settings it stays at its place, so receivers take that for errors of its GPS: "
                "set platform.motion = \"spectrum\" and platform.watch_circle_m"
            )
    if ready.alike > _ALIKE:
        lines.append(
            "ranges: errors of a beacon are correlated in time, but receivers expect independent "
            f"ones: their claims may be too small, perhaps by a factor of {rounded(ready.alike, 2)}"
        )
    if log.meta.dimension == 2:
        return lines
    same = len(log.depth) >= _SAME and np.ptp(log.depth) == 0.0
    if log.meta.depth_is == "truth":
        lines.append("depth: made of the truth, so errors are those of a device with such a depth")
    elif log.meta.depth_is == "none" or same:
        why = "not measured" if log.meta.depth_is == "none" else (
            f"all {len(log.depth):,} readings are the same, as if not measured"
        )
        lines.append(
            f"depth: {why}: receivers take it as measured, so if it is wrong, their claims are too "
            "small"
        )
    return lines


def _of_devices(heard: Log) -> Processed:
    """A log that has positions of devices only."""
    from ..scenario.scenario import load

    said = ["there are no ranges: the positions are those that the device computed"]
    label = next((it for it in heard.fixes if not heard.in_own_axes(it)), "")
    found = aligned(heard, heard.fixes[label]) if label else None
    if found is not None and (words := found[1].told(label)):
        said.append(words)
    return Processed(
        log=heard, scenario=load({"name": heard.name or "log", "seed": 1}),
        made=dict(heard.fixes), truth=None if found is None else found[0],
        origins={name: {"type": "device"} for name in heard.fixes}, said=said,
    )


