"""Carrying out a study: batches of runs, a folder of results that can be resumed, and replay."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import Executor
from pathlib import Path

import pandas as pd

from . import executors
from .api import run as run_scenario
from .errors import ConfigurationError
from .isolation import Children
from .points import (
    Campaign,
    Point,
    Run,
    batch,
    digest_of,
    left_free,
    prepare,
    receivers_of,
    resolved,
)
from .result import Result
from .simulation import silent, simulate, steps_of
from .store import RUNS, check_folder, finished, open_folder, save, study_of, table, write
from .study import Study
from .wiring import FIXED

BATCH = 2048
"""Runs at a time, as a whole number of replicates: all points of a replicate, or none."""
BATCH_STEPS = 200_000_000
"""The same in communication steps, where runs are long: what a kill can cost."""
SAMPLE_SECONDS = 0.3
"""What a sample must take at least, to tell how long all will take."""
_PART = 16  # runs at a time and worker where each runs alone: what a kill can cost


def run(
    study: Study,
    out: str | Path,
    *,
    workers: int | None = None,
    executor: str | Executor = "threads",
    scheduler: str | None = None,
    master: str | None = None,
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
    progress
        Called with the share of what was missing that is done.

    Returns
    -------
    table
        One row per run, by replicate and point: ``point``, ``replicate``, ``run_order``, the
        factors' physical values, ``seed``, each receiver's `sblcosim.reduction.responses` as
        ``RECEIVER.RESPONSE``, ``error`` (missing if the run went well), ``run_id``.

    Raises
    ------
    ConfigurationError
        The folder is of another study or cannot be written to, a point cannot be run, or there
        are no such workers.
    """
    folder = Path(out).resolve()
    campaign = prepare(study, master)
    weight = {p: g.steps for g in campaign.groups for p in g.places}
    with executors.ready(
        campaign, executor=executor, scheduler=scheduler, workers=workers, master=master
    ) as simulated:
        open_folder(folder, campaign)
        before = finished(folder)
        total = passed = 0

        def work(runs: Sequence[Run]) -> int:
            return sum(weight[r.place] for r in runs)

        def done(part: Sequence[Run], share: float) -> None:
            if progress is not None:
                progress((passed + share * work(part)) / total)

        if progress is not None:
            total = sum(map(work, _missing(campaign, before, workers)))
        for part, made in simulated(_missing(campaign, before, workers), done):
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


def missing(campaign: Campaign, out: str | Path) -> list[Run]:
    """Runs that are not in a folder of results yet; nothing is written.

    Raises
    ------
    ConfigurationError
        The folder is of another study.
    """
    folder = Path(out).resolve()
    check_folder(folder, campaign)
    before = finished(folder)
    return [r for r in batch(campaign, 1, campaign.study.replicates) if r.run_id not in before]


def estimate(
    campaign: Campaign, runs: Sequence[Run], workers: int | None = None, master: str | None = None
) -> float:
    """Seconds that some runs will take, from a sample of them; nothing is written."""
    if not runs:
        return 0.0
    with Children() as children:
        return _estimated(campaign, runs, workers, master, children)


def _estimated(
    campaign: Campaign,
    runs: Sequence[Run],
    workers: int | None,
    master: str | None,
    children: Children,
) -> float:
    simulate(campaign, runs[:1], workers, master, silent, children)  # libraries are loaded
    groups = [[run for run in runs if run.place in g.places] for g in campaign.groups]
    size = 1
    while True:
        sample = [run for group in groups for run in group[:size]]
        started = time.perf_counter()
        simulate(campaign, sample, workers, master, silent, children)
        seconds = time.perf_counter() - started
        if seconds > SAMPLE_SECONDS or len(sample) >= len(runs):
            return seconds * sum(steps_of(campaign, runs)) / sum(steps_of(campaign, sample))
        size *= 4


def replay(
    results: str | Path,
    run_id: str,
    *,
    master: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> Result:
    """Do a run of a study again, and record everything.

    Parameters
    ----------
    results
        Folder of results.
    run_id
        As in the table, or the beginning of it.

    Raises
    ------
    ConfigurationError
        There is no such run, or it cannot be done again: the FMUs have changed.
    """
    study = study_of(results)
    runs = table(results)
    found = runs[runs["run_id"].str.startswith(run_id)] if run_id else runs[:0]
    if len(found) != 1:
        what = f"the beginning of {len(found)}" if len(found) else "none of them"
        raise ConfigurationError(
            f"run: must be the run_id of one run in {results}, got {run_id!r}, which is {what}"
        )
    number, seed, run_id = (found.iloc[0][name] for name in ("point", "seed", "run_id"))
    scenario, system, plan = resolved(study, int(number))
    labels = [name for name in system.components if name not in FIXED]
    seeded, handovers = left_free(study, system, labels)
    free = {f"{name}.seed" for name in seeded} | {c.target for c in handovers}
    digest = digest_of(system, plan, free, study.settling_ns)
    if Point(int(number), (), system, digest).run_id(int(seed)) != run_id:
        raise ConfigurationError(
            f"run {run_id}: must be done again with the FMUs of then, got others"
        )
    return run_scenario(
        scenario.override({"seed": int(seed)}),
        receivers_of(study),
        master=master,
        progress=progress,
    )


__all__ = [
    "Campaign", "estimate", "finished", "missing", "prepare", "replay", "run", "study_of", "table",
]
