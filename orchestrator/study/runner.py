"""Run a study in batches, into a result folder that can be resumed."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sblcosim.fmus.stopping import interruptible

from ..artifacts import check_place
from ..errors import resolved
from ..scenario.files import naming_files
from ..simulation.children.children import Children
from ..simulation.children.process import foreign, patient
from ..simulation.how import HOW, How
from . import executors, parts
from .batch import simulate, steps_of
from .campaign import (
    Campaign,
    CampaignRun,
    batch,
    prepare,
    run_of,
)
from .definition import Definition
from .kept import Kept, sound
from .parts import Finished, Parts
from .store import as_begun, at_work, check_folder, finished, open_folder, save

BATCH = 2048
"""Runs per batch, rounded to whole replicates."""
BATCH_STEPS = 200_000_000
"""Maximum size of a batch of long runs [communication steps]: what a kill can cost."""
SAMPLE_SECONDS = 0.1
"""Minimum duration of a sample that gives a usable estimate [s]."""
SAMPLES = 5
"""Number of times that a sample is simulated."""
SIDE_BY_SIDE = 8
"""Minimum number of sample runs per worker: the largest number of lanes of a processor."""
MARGIN = 1.25
"""Factor by which an estimate is widened on both sides, as samples do not represent all runs."""
ALONE = 16
"""Runs per worker and part if they run alone: what a kill can cost."""
KEPT_STEPS, KEPT_ALONE = 10_000_000, 4
"""As `BATCH_STEPS` and `ALONE`, for runs outside a study's folder: about a second."""


@interruptible
@patient
def run(
    study: Definition,
    out: str | Path,
    *,
    workers: int | None = None,
    executor: str | Executor = "threads",
    scheduler: str | None = None,
    master: str | None = None,
    step_timeout: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> pd.DataFrame:
    """Run the missing runs of a study, and return its table.

    The table depends neither on the executor nor on the number of workers.

    Parameters
    ----------
    out
        Folder of the results. If it holds runs of the same study, it is completed.
    workers
        Threads or processes; default: all cores.
    executor
        ``"threads"``, ``"processes"``, or a `concurrent.futures.Executor` whose workers have this
        package installed; they receive the FMUs.
    scheduler
        Address of a Dask scheduler, whose workers simulate instead.
    master
        See `sblcosim.run`; None: lanes if all components are our own.
    step_timeout
        Time limit for a call of a third-party FMU [s]; if it is exceeded, the run fails. None: one
        minute.
    progress
        Called with the completed share of the missing runs, 0 to 1.

    Returns
    -------
    table
        One row per run, by replicate and point: ``point``, ``replicate``, ``run_order``, the
        factors' physical values, ``seed``, each receiver's `sblcosim.results.sums.responses` as
        ``RECEIVER.RESPONSE``, ``error`` (missing if the run went well), ``run_id``.

    Raises
    ------
    ConfigurationError
        The folder belongs to another study or is not writable, a point cannot be run, or the
        workers do not exist.
    """
    there = carry_out(
        study, out, How(master, step_timeout, workers, executor, scheduler, progress)
    )
    whole = parts.table(there)
    return whole[whole["replicate"] <= study.replicates].reset_index(drop=True)


@interruptible
@naming_files
def carry_out(study: Definition, out: str | Path, how: How = HOW) -> Parts:
    """As `run`, for callers that do not need the whole table; returns its location."""
    folder = resolved(out)
    check_place(folder)
    campaign = prepare(as_begun(study, folder), how)
    check_folder(folder, campaign)
    with executors.ready(campaign, how) as simulated, at_work(folder):
        there = open_folder(folder, campaign)
        what = _missing_of(campaign, parts.finished(there))
        some = _missing(campaign, what, how)
        there = save(_completed(campaign, there, what, simulated, some, how))
    how.tell(1.0)
    return there


def _completed(
    campaign: Campaign,
    there: Parts,
    what: Missing,
    simulated: executors.Simulate,
    some: Iterable[list[CampaignRun]],
    how: How,
) -> Parts:
    """Do the missing runs, and write each part when it is finished."""
    passed = 0
    # The last part, whose progress is reported often.
    counted: tuple[Sequence[CampaignRun], int] = (), 0
    written: list[Path] = []

    def work(runs: Sequence[CampaignRun]) -> int:
        nonlocal counted
        if counted[0] is not runs:
            counted = runs, sum(steps_of(campaign, runs))
        return counted[1]

    def done(part: Sequence[CampaignRun], share: float) -> None:
        how.tell((passed + share * work(part)) / what.steps)

    for part, rows in simulated(some, done):
        written.append(parts.write(there.folder, campaign, part, rows))
        passed += work(part)
    return there.added(written)


@interruptible
def simulated(study: Definition, how: How = HOW, keep: Kept | None = None) -> pd.DataFrame:
    """Run all runs of a study and return its table, as `run` does.

    Parameters
    ----------
    keep
        Place for finished runs, which are not repeated; None: nothing is written.
    """
    campaign = prepare(study, how)
    folder = None if keep is None else keep.of(campaign.digest, how.master, how.step_timeout)
    if folder is not None:
        with executors.ready(campaign, how) as made, at_work(folder):
            there = sound(folder)
            what = _missing_of(campaign, parts.finished(there))
            some = _missing(campaign, what, how, kept_together(campaign, how))
            whole = parts.table(_completed(campaign, there, what, made, some, how))
        mine = whole[whole["replicate"] <= study.replicates].reset_index(drop=True)
        if mine["error"].isna().all():  # its type before it has been in a file
            mine["error"] = np.full(len(mine), None)
        return mine
    tables: list[pd.DataFrame] = []
    passed = 0

    def told(share: float) -> None:
        how.tell((passed + share * work) / campaign.steps)

    with Children(patience_s=how.step_timeout) as children:
        for part in _missing(campaign, None, how):
            work = sum(steps_of(campaign, part))
            tables.append(simulate(campaign, part, replace(how, progress=told), children))
            passed += work
    table = pd.concat(tables, ignore_index=True)
    return table.sort_values(["replicate", "point"], ignore_index=True)


def kept_together(campaign: Campaign, how: How = HOW) -> int:
    """Number of runs of a single point that are done and kept together: what a kill can cost."""
    if _alone(campaign):
        return KEPT_ALONE * how.threads
    return max(SIDE_BY_SIDE * how.threads, KEPT_STEPS // max(campaign.weights.values()))


def _alone(campaign: Campaign) -> bool:
    """Whether some runs go one by one."""
    return not all(group.in_lanes for group in campaign.groups)


def _missing(
    campaign: Campaign, what: Missing | None, how: How, most: int | None = None
) -> Iterator[list[CampaignRun]]:
    """All runs except finished ones, in parts that are stored together, ``most`` at a time.

    Without ``what``, these are all runs.
    """
    everything = campaign.study.replicates
    replicates = max(
        1, min(-(-BATCH // len(campaign.points)), BATCH_STEPS * everything // campaign.steps)
    )
    alone = _alone(campaign)
    for first in range(1, everything + 1, replicates):
        if what is not None and what.has_all(first, min(first + replicates, everything + 1)):
            continue
        runs = batch(campaign, first, replicates)
        if what is not None:
            runs = [r for r in runs if not what.has(r)]
        size = ALONE * how.threads if alone else max(BATCH, len(runs) // 8)
        size = size if most is None else min(most, size)
        for i in range(0, len(runs), max(size, 1)):
            yield runs[i : i + size]


@dataclass(frozen=True, eq=False)
class Missing:
    """The missing runs of a campaign, counted but not listed.

    Attributes
    ----------
    done
        Whether a run is finished; shape (replicates, points), up to the last replicate with any.
    runs, steps
        Number of missing runs, and of their communication steps.
    by_point
        Number of missing runs at each point.
    """

    done: NDArray[np.bool_]
    runs: int
    steps: int
    by_point: tuple[int, ...]

    def has(self, run: CampaignRun) -> bool:
        """Whether a run is finished."""
        return run.replicate <= len(self.done) and bool(self.done[run.replicate - 1, run.place])

    def has_all(self, first: int, end: int) -> bool:
        """Whether all runs of some replicates are finished."""
        return end - 1 <= len(self.done) and bool(self.done[first - 1 : end - 1].all())


def missing(campaign: Campaign, out: str | Path, *, tell: bool = False) -> Missing:
    """Count the missing runs of a result folder; nothing is written.

    Parameters
    ----------
    tell
        Whether to warn about damaged parts, whose runs count as missing.

    Raises
    ------
    ConfigurationError
        The folder belongs to another study.
    """
    folder = resolved(out)
    check_folder(folder, campaign)
    return _missing_of(campaign, finished(folder, tell=tell))


def _missing_of(campaign: Campaign, there: Finished) -> Missing:
    own = np.ones(len(there.point), bool)
    own[there.strangers(campaign)] = False
    own &= there.replicate <= campaign.study.replicates
    replicate, place = there.replicate[own] - 1, there.point[own] - 1
    done = np.zeros((int(replicate.max(initial=-1)) + 1, len(campaign.points)), bool)
    done[replicate, place] = True
    counts = (campaign.study.replicates - done.sum(axis=0)).tolist()
    steps = sum(weight * counts[place] for place, weight in campaign.weights.items())
    return Missing(done, sum(counts), steps, tuple(counts))


@interruptible
def estimate(campaign: Campaign, what: Missing, how: How = HOW) -> tuple[float, float]:
    """Estimate the time that the missing runs will take [s]; nothing is written.

    Samples of the runs are simulated several times. The first number assumes an otherwise idle
    machine: the smallest processor time of the samples, shared by the workers. The second assumes
    that the load on the machine stays the same: the upper quartile of the samples' durations. Both
    are widened by `MARGIN`.
    """
    if not what.runs:
        return 0.0, 0.0
    how = replace(how, progress=None)
    if not campaign.groups:  # a function: some of its calls are a sample of all
        runs = batch(campaign, 1, 1)[:SIDE_BY_SIDE]
        wall = time.perf_counter()
        simulate(campaign, runs, how)
        each = (time.perf_counter() - wall) / len(runs)
        return each * what.runs / MARGIN, each * what.runs * MARGIN
    with Children(patience_s=campaign.step_timeout) as children:
        return _estimated(campaign, what, how, children)


def _estimated(
    campaign: Campaign, what: Missing, how: How, children: Children
) -> tuple[float, float]:
    threads = min(how.threads, os.cpu_count() or 1)
    size = -(-SIDE_BY_SIDE * threads // len(campaign.groups))  # fills all lanes of all workers
    simulate(campaign, _sample(campaign, what, 1), how, children)  # warm up
    while True:
        sample = _sample(campaign, what, size)
        first = _timed(campaign, sample, how, children)
        if first[0] > SAMPLE_SECONDS or len(sample) >= what.runs:
            break
        size *= 4
    times = [first]
    times += [_timed(campaign, sample, how, children) for _ in range(SAMPLES - 1)]
    if any(foreign(group.plan) for group in campaign.groups):  # process_time omits children
        times = [(wall, wall * threads) for wall, _ in times]
    share = what.steps / sum(steps_of(campaign, sample))
    idle = min(min(wall, processor / threads) for wall, processor in times)
    busy = sorted(wall for wall, _ in times)[3 * len(times) // 4]
    return idle * share / MARGIN, busy * share * MARGIN


def _timed(
    campaign: Campaign, runs: Sequence[CampaignRun], how: How, children: Children
) -> tuple[float, float]:
    """Wall time and processor time of some runs [s]."""
    wall, processor = time.perf_counter(), time.process_time()
    simulate(campaign, runs, how, children)
    return time.perf_counter() - wall, time.process_time() - processor


def _sample(campaign: Campaign, what: Missing, size: int) -> list[CampaignRun]:
    """The first missing runs of each group, ``size`` at most."""
    replicates = campaign.study.replicates
    chosen: list[tuple[int, int]] = []
    for group in campaign.groups:
        places = np.array(sorted(group.places), np.intp)
        # In a folder that is almost complete, most runs are finished: none of them is examined.
        gaps = np.flatnonzero(~what.done[:replicates, places])[:size]
        own = [(int(gap) // len(places) + 1, int(places[gap % len(places)])) for gap in gaps]
        after = ((n, int(p)) for n in range(len(what.done) + 1, replicates + 1) for p in places)
        chosen += [*own, *islice(after, size - len(own))]
    return [run_of(campaign, place, replicate) for replicate, place in sorted(chosen)]
