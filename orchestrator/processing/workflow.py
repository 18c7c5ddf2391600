"""Process a log: from its file to tables and figures, in one call."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from sblcosim.fmus.stopping import interruptible

from ..data.estimates import Estimates
from ..logs.log import Log
from ..logs.read import read_log
from ..scenario.files import naming_files
from ..scenario.labels import RAW
from ..scenario.overrides import Changes
from ..scenario.scenario import Receivers, Scenario
from ..scenario.sources import choice_of
from ..simulation.children.process import patient
from ..simulation.how import How
from .align import aligned
from .knowing import that_know
from .processed import Processed, manifest_of
from .quality import misfit
from .remarks import remarks
from .running import Ran, ran
from .settings import settled


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

    Ranges that are far too short, or late by tens of metres, are left out, and said: receivers
    weigh ranges that are a little late, but lose the diver by the others. Receivers start where a
    straight line fits the first ranges. No truth is used for either.

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
    made = ran(ready, choice, How(None, step_timeout, progress=progress))
    main = next((label for label in choice.receivers if label in made.estimates), "")
    estimates = dict(made.estimates)
    said = [*remarks(ready, choice, made.played)]
    doubts: Sequence[str] = ()
    if smooth:
        from .smoothing import SMOOTHER, smoothed

        own, doubts, told = smoothed(ready, made)
        estimates = {**_without_raw(estimates), SMOOTHER: own, **_only_raw(estimates)}
        said += told
    if not ready.newest:
        estimates, told = that_know(ready.log, estimates)
        said += told
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


