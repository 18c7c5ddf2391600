"""Answer a question: batches of runs where they decide, in a folder that can be resumed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sblcosim.fmus.stopping import interruptible

from .. import artifacts
from ..errors import ConfigurationError, resolved
from ..results.responses import RESPONSES
from ..scenario.files import naming_files
from ..simulation.how import HOW, How
from ..study import executors, parts, runner, store
from ..study.campaign import Campaign, CampaignRun, prepare
from .question import Question, load, passable
from .result import Requirement
from .sequential import Batch, Elimination
from .weighing import answered

Floats = NDArray[np.float64]
RUNS, ANSWER = "runs", "answer"
"""Subfolders of an answer: a study's folder with all runs, and the answer itself."""


@interruptible
@naming_files
def decide(
    question: str | Path | Mapping[str, Any] | Question,
    out: str | Path,
    *,
    most_runs: int | None = None,
    until_sure: bool = False,
    workers: int | None = None,
    executor: str | Executor = "threads",
    scheduler: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> Requirement:
    """Answer a question; runs in the folder are not repeated.

    The answer depends neither on the executor nor on the number of workers.

    Parameters
    ----------
    question
        As in `sblcosim.require.load`, or its result.
    out
        Folder. It gets ``runs``, the folder of a study with all runs, and ``answer`` with the
        report, the front, the table of designs and the scenario of the named design.
    most_runs
        Budget that replaces the question's. Existing runs in the folder also count beyond it.
    until_sure
        Make no new runs of designs that are dearer than one that surely suffices. It needs costs.
        Designs of the same cost continue. The answer names the same design as without this option,
        unless the budget ends one of the two: runs saved on dearer designs go to cheaper ones.
    workers, executor, scheduler
        As in `sblcosim.study.runner.run`.
    progress
        Called with the completed share, 0 to 1.

    Raises
    ------
    ConfigurationError
        The question is invalid, a design cannot be run, the folder belongs to something else, or
        the response is unknown in all runs.
    """
    asked = question if isinstance(question, Question) else load(question)
    if most_runs is not None:
        asked = asked.with_budget(most_runs)
    out = Path(out)
    artifacts.check(out / ANSWER)
    elimination, values = decided(
        asked, out / RUNS, How(None, None, workers, executor, scheduler, progress), until_sure
    )
    found = answered(asked, elimination, values, workers)
    found.save(out / ANSWER, other="replace")
    return found


def decided(
    question: Question, folder: Path, how: How = HOW, until_sure: bool = False
) -> tuple[Elimination, dict[tuple[int, int], Floats]]:
    """Run until everything is decided; returns the decisions, and the responses by design and
    condition."""
    folder = resolved(folder)
    campaign = prepare(question.study)
    try:
        store.check_folder(folder, campaign)
    except ConfigurationError as error:
        raise ConfigurationError(
            f"{error}; answer into another folder (--out), or delete {folder.parent}"
        ) from None
    with executors.ready(campaign, how) as simulated, store.at_work(folder):
        there = store.open_folder(folder, campaign)
        known: dict[str, Floats] = {}
        if there.paths:
            known = _responses(question, parts.table(there, _wanted(question)))

        def carried_out(runs: Sequence[CampaignRun]) -> None:
            missing = [run for run in runs if run.run_id not in known]
            for part, rows in simulated(in_parts(campaign, missing, how), _silent):
                parts.write(folder, campaign, part, rows)
                known.update(_responses(question, rows))

        prices = [design.cost for design in question.designs] if until_sure else None
        return _eliminated(question, campaign, known, carried_out, how.progress, prices)


def _eliminated(
    question: Question,
    campaign: Campaign,
    known: Mapping[str, Floats],
    carried_out: Callable[[Sequence[CampaignRun]], None],
    progress: Callable[[float], None] | None,
    prices: Sequence[float] | None,
) -> tuple[Elimination, dict[tuple[int, int], Floats]]:
    """Rounds of batches; ``carried_out`` makes the responses of runs known."""
    designs = question.designs
    receivers = list(campaign.receivers)
    elimination = Elimination(
        question.rule, [design.group for design in designs], question.terms.most_runs, prices
    )
    values: dict[tuple[int, int], list[Floats]] = {}

    def is_known(batch: Batch) -> bool:
        return all(run.run_id in known for run in _runs(question, campaign, batch))

    while batches := elimination.batches(is_known):
        rounds = [(batch, _runs(question, campaign, batch)) for batch in batches]
        carried_out([run for _, runs in rounds for run in runs])
        for batch, runs in rounds:
            made = np.array([known[run.run_id] for run in runs])
            passed = {}
            for number in elimination.counting(batch):
                mine = made[:, receivers.index(designs[number].receiver)]
                values.setdefault((number, batch.condition), []).append(mine)
                passed[number] = int((mine <= question.terms.limit).sum())
            elimination.add(batch, passed)
        if progress is not None:
            closed = sum(elimination.verdict(n) != "undecided" for n in range(len(designs)))
            spent = elimination.spent / question.terms.most_runs
            progress(min(max(closed / len(designs), spent), 0.99))
    return elimination, {arm: np.concatenate(parts) for arm, parts in values.items()}


def _runs(question: Question, campaign: Campaign, batch: Batch) -> list[CampaignRun]:
    places = question.places(batch.group, batch.condition, batch.start, batch.stop)
    runs = []
    for replicate, place in enumerate(places.tolist(), batch.start + 1):
        point = campaign.points[place]
        seed = campaign.study.run_seed(point.number, replicate)
        runs.append(CampaignRun(place, replicate, seed, point.run_id(seed)))
    return runs


def in_parts(
    campaign: Campaign, runs: Sequence[CampaignRun], how: How
) -> Iterator[Sequence[CampaignRun]]:
    """Runs per part of the storage: the most that a kill can lose."""
    longest = max(group.steps for group in campaign.groups)
    size = max(1, min(runner.BATCH, runner.BATCH_STEPS // longest))
    if not all(group.in_lanes for group in campaign.groups):
        size = runner.ALONE * how.threads
    for i in range(0, len(runs), size):
        yield runs[i : i + size]


def _wanted(question: Question) -> parts.Wanted:
    """Columns that an answer needs."""
    own = ("point", "replicate", "run_id", "error")
    last = (question.response, "lost")
    return lambda names: [n for n in names if n in own or n.partition(".")[2] in last]


def _responses(question: Question, table: pd.DataFrame) -> dict[str, Floats]:
    """The response of each receiver in each run; infinite where it is missing or lost."""
    receivers = list(dict.fromkeys(c.partition(".")[0] for c in table.columns if "." in c))
    columns = [passable(table, question.response, label) for label in receivers]
    if len(table) and all(np.isinf(column).all() for column in columns):
        _check_known(question, table, receivers)
    return dict(zip(table["run_id"], np.column_stack(columns), strict=True))


def _check_known(question: Question, table: pd.DataFrame, receivers: Sequence[str]) -> None:
    """Refuse a response that no receiver has."""
    needs = RESPONSES[question.response].needs if question.response in RESPONSES else ""
    went_well = table[table["error"].isna()]
    if needs and len(went_well) and went_well[
        [f"{label}.{question.response}" for label in receivers]
    ].isna().all(axis=None):
        raise ConfigurationError(
            f"{question.study.name}: response: must be known in some runs, got none; no estimate "
            f"of {', '.join(receivers)} has a {needs}"
        )


def _silent(runs: Sequence[CampaignRun], share: float) -> None:
    """Ignore progress within a part."""
