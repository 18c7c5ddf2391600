"""Carrying out a study: batches of runs, a folder of results that can be resumed."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from ..simulation.isolation import Children
from ..simulation.process import strangers
from . import executors
from .batch import silent, simulate, steps_of
from .campaign import (
    Campaign,
    Run,
    batch,
    prepare,
)
from .definition import Definition
from .store import RUNS, at_work, check_folder, finished, open_folder, save, table, write

BATCH = 2048
"""Runs at a time, as a whole number of replicates: all points of a replicate, or none."""
BATCH_STEPS = 200_000_000
"""The same in communication steps, where runs are long: what a kill can cost."""
SAMPLE_SECONDS = 0.1
"""What a sample must take at least, to tell how long all will take."""
SAMPLES = 5
"""How often it is simulated."""
SIDE_BY_SIDE = 8
"""Runs of a sample for each worker, at least: so many go through a processor's lanes at once."""
MARGIN = 1.25
"""Factor that is left to chance, either way: samples are not all runs."""
_PART = 16  # runs at a time and worker where each runs alone: what a kill can cost


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
    """Do what is missing of a study's runs, and return its table.

    The table does not depend on where the runs are simulated, nor on the number of workers.

    Parameters
    ----------
    out
        Folder of the results; one with runs of the same study is completed.
    workers
        Threads or processes; default: all cores.
    executor
        ``"threads"``, ``"processes"``, or a `concurrent.futures.Executor` whose workers have this
        package; they get the FMUs.
    scheduler
        Address of a Dask scheduler, whose workers do it instead.
    master
        As in `sblcosim.run`; None: lanes where all components are ours.
    step_timeout
        Seconds after which a call of somebody else's FMU that does not return is given up, and its
        run fails; None: after a minute.
    progress
        Called with the share of what was missing that is done.

    Returns
    -------
    table
        One row per run, by replicate and point: ``point``, ``replicate``, ``run_order``, the
        factors' physical values, ``seed``, each receiver's `sblcosim.results.sums.responses` as
        ``RECEIVER.RESPONSE``, ``error`` (missing if the run went well), ``run_id``.

    Raises
    ------
    ConfigurationError
        The folder is of another study or cannot be written to, a point cannot be run, or there
        are no such workers.
    """
    folder = Path(out).resolve()
    campaign = prepare(study, master, step_timeout)
    weight = {p: g.steps for g in campaign.groups for p in g.places}
    check_folder(folder, campaign)
    with (
        executors.ready(
            campaign, executor=executor, scheduler=scheduler, workers=workers, master=master
        ) as simulated,
        at_work(folder),
    ):
        open_folder(folder, campaign)
        what = missing(campaign, folder)
        passed = 0

        def work(runs: Sequence[Run]) -> int:
            return sum(weight[r.place] for r in runs)

        def done(part: Sequence[Run], share: float) -> None:
            if progress is not None:
                progress((passed + share * work(part)) / what.steps)

        for part, made in simulated(_missing(campaign, what.done, workers), done):
            write(folder, part, made)
            passed += work(part)
        whole = table(folder)
        save(folder / RUNS, whole)
    if progress is not None:
        progress(1.0)
    return whole[whole["replicate"] <= study.replicates].reset_index(drop=True)


def _missing(
    campaign: Campaign, before: Collection[str], workers: int | None
) -> Iterator[list[Run]]:
    """All runs but those that were done before, in parts that are kept as one."""
    everything = campaign.study.replicates
    replicates = max(
        1, min(-(-BATCH // len(campaign.points)), BATCH_STEPS * everything // campaign.steps)
    )
    alone = not all(group.in_lanes for group in campaign.groups)
    for first in range(1, everything + 1, replicates):
        runs = [r for r in batch(campaign, first, replicates) if r.run_id not in before]
        size = _PART * (workers or os.cpu_count() or 1) if alone else len(runs)
        for i in range(0, len(runs), max(size, 1)):
            yield runs[i : i + size]


@dataclass(frozen=True)
class Missing:
    """What is missing of a campaign, counted and not listed.

    Attributes
    ----------
    done
        Ids of the runs that are there.
    runs, steps
        Number of those that are missing, and their communication steps.
    by_point
        The number at each point.
    """

    done: Collection[str]
    runs: int
    steps: int
    by_point: tuple[int, ...]


def missing(campaign: Campaign, out: str | Path, *, tell: bool = False) -> Missing:
    """What is not in a folder of results yet; nothing is written.

    Parameters
    ----------
    tell
        Warn of damaged parts, whose runs are missing.

    Raises
    ------
    ConfigurationError
        The folder is of another study.
    """
    folder = Path(out).resolve()
    check_folder(folder, campaign)
    done = finished(folder, ["point", "replicate"], tell=tell)
    counts = [campaign.study.replicates] * len(campaign.points)
    for point, replicate in done.values():
        counts[point - 1] -= replicate <= campaign.study.replicates
    steps = sum(g.steps * counts[p] for g in campaign.groups for p in g.places)
    return Missing(done.keys(), sum(counts), steps, tuple(counts))


def estimate(
    campaign: Campaign, what: Missing, workers: int | None = None, master: str | None = None
) -> tuple[float, float]:
    """Seconds that the missing runs will take; nothing is written.

    Samples of the runs are simulated several times. The first number is for a machine that does
    nothing else: the least processor time of the samples, shared by the workers. The second is for
    one that stays as busy as it is: the upper quartile of their durations. Both are widened by
    `MARGIN`.
    """
    if not what.runs:
        return 0.0, 0.0
    with Children(patience_s=campaign.step_timeout) as children:
        return _estimated(campaign, what, workers, master, children)


def _estimated(
    campaign: Campaign,
    what: Missing,
    workers: int | None,
    master: str | None,
    children: Children,
) -> tuple[float, float]:
    threads = min(workers or os.cpu_count() or 1, os.cpu_count() or 1)
    size = -(-SIDE_BY_SIDE * threads // len(campaign.groups))  # all lanes of all workers are in use
    simulate(campaign, _sample(campaign, what, 1), workers, master, silent, children)  # loads all
    while True:
        sample = _sample(campaign, what, size)
        first = _timed(campaign, sample, workers, master, children)
        if first[0] > SAMPLE_SECONDS or len(sample) >= what.runs:
            break
        size *= 4
    times = [first]
    times += [_timed(campaign, sample, workers, master, children) for _ in range(SAMPLES - 1)]
    if any(strangers(group.plan) for group in campaign.groups):  # their processes' time is not ours
        times = [(wall, wall * threads) for wall, _ in times]
    share = what.steps / sum(steps_of(campaign, sample))
    idle = min(min(wall, processor / threads) for wall, processor in times)
    busy = sorted(wall for wall, _ in times)[3 * len(times) // 4]
    return idle * share / MARGIN, busy * share * MARGIN


def _timed(
    campaign: Campaign,
    runs: Sequence[Run],
    workers: int | None,
    master: str | None,
    children: Children,
) -> tuple[float, float]:
    """Seconds that some runs take, and seconds of all processors."""
    wall, processor = time.perf_counter(), time.process_time()
    simulate(campaign, runs, workers, master, silent, children)
    return time.perf_counter() - wall, time.process_time() - processor


def _sample(campaign: Campaign, what: Missing, size: int) -> list[Run]:
    """The first so many missing runs of each group."""
    sample: list[Run] = []
    wanted = {n: min(size, sum(what.by_point[p] for p in group.places))
              for n, group in enumerate(campaign.groups)}
    group_of = {p: n for n, group in enumerate(campaign.groups) for p in group.places}
    for replicate in range(1, campaign.study.replicates + 1):
        if not any(wanted.values()):
            break
        for run in batch(campaign, replicate, 1):
            number = group_of[run.place]
            if wanted[number] and run.run_id not in what.done:
                wanted[number] -= 1
                sample.append(run)
    return sample
