"""Simulate runs of a campaign in this process: side by side in lanes, or one by one."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sblcosim.fmus import stopping, unchanged

from ..data.record import Record
from ..data.truth import TRUTH
from ..errors import BuildError, ConfigurationError, FmuError, SblcosimError, one_line
from ..results.responses import Percentile, Run
from ..results.sums import PORTS, responses, sums_of
from ..results.user_responses import values_of
from ..simulation import execution
from ..simulation.children.children import Children
from ..simulation.children.process import patience
from ..simulation.code.user_code import InFile
from ..simulation.how import How
from ..simulation.masters import lanes
from ..simulation.masters.lanes_driver import LENGTHS, SUMS
from ..simulation.plans.plan import Plan
from ..simulation.system import System
from . import stand_in
from .campaign import Campaign, CampaignRun
from .garbage import all_kept
from .groups import Group, PreparedPoint
from .stand_in import StandIn

Floats = NDArray[np.float64]
VALUE = "value"
"""Response of a function that replaces the simulation."""
_NEEDED = ("update_count", "epoch", "position")
_SHARES = 20
"""Parts of the calls of a function in this process after which its progress is told."""


def simulate(
    campaign: Campaign,
    runs: Sequence[CampaignRun],
    how: How,
    children: Children | None = None,
) -> pd.DataFrame:
    """Simulate some runs in threads; the table is that of `sblcosim.study.runner.run`.

    Third-party FMUs run in ``children``; None: start some for these runs.
    """
    if children is None:
        with Children(patience_s=campaign.step_timeout) as children:
            return simulate(campaign, runs, how, children)
    if campaign.study.model is not None:
        return _of_function(campaign, runs, campaign.study.model, how, children)
    sums, extra, errors = _nothing(campaign, len(runs))
    durations = np.zeros(len(runs), np.int64)
    work = sum(steps_of(campaign, runs))
    passed = 0
    numbers = {place: n for n, group in enumerate(campaign.groups) for place in group.places}
    rows_of: dict[int, list[int]] = {}
    for row, run in enumerate(runs):
        rows_of.setdefault(numbers[run.place], []).append(row)
    with unchanged.assumed(), all_kept():
        for number, rows in sorted(rows_of.items()):
            group = campaign.groups[number]
            mine = [runs[i] for i in rows]
            share = group.steps * len(rows)

            def report(part: float, passed: int = passed, share: int = share) -> None:
                how.tell((passed + part * share) / work)

            results = reduced(campaign, group, mine, replace(how, progress=report), children)
            sums[rows], extra[rows] = results[:2]
            durations[rows] = group.plan.stop_ns - group.plan.start_ns
            for i, error in zip(rows, results[2], strict=True):
                errors[i] = error
            passed += share
    return _table(campaign, runs, sums, extra, durations, errors)


def _of_function(
    campaign: Campaign, runs: Sequence[CampaignRun], model: StandIn, how: How,
    children: Children,
) -> pd.DataFrame:
    """The table of a function that replaces the simulation."""
    numbers = {name: factor.numbers for name, factor in campaign.study.varied.items()}
    given = [
        ({
            name: numbers[name].get(value, value)
            for name, value in zip(numbers, campaign.points[run.place].values, strict=True)
        }, run.seed)
        for run in runs
    ]  # fmt: skip
    values = np.empty(len(given))
    shares = 1 if isinstance(model.function, InFile) else _SHARES  # each takes a new process
    with patience(campaign.step_timeout):
        size = max(1, -(-len(given) // shares))
        for first in range(0, len(given), size):
            part = given[first : first + size]
            values[first : first + size] = stand_in.values_of(model, part, children)
            how.tell((first + len(part)) / len(given))
    columns = _about(campaign, runs) | {f"{model.name}.{VALUE}": values}
    return pd.DataFrame({**columns, **_ends(runs, [None] * len(runs))})


Reduced = tuple[Floats, Floats, list[str | None]]
"""Results of some runs: the sums (runs, receivers, sums), the extra responses that the study
requests (runs, receivers, responses), and an error message or None for each run."""


def reduced(
    campaign: Campaign,
    group: Group,
    runs: Sequence[CampaignRun],
    how: How,
    children: Children,
) -> Reduced:
    """Simulate some runs of one group."""
    if group.in_lanes:
        return _side_by_side(campaign, group, runs, how, children)
    return _one_by_one(campaign, group, runs, how, children)


def _nothing(campaign: Campaign, runs: int) -> Reduced:
    receivers, asked = len(campaign.receivers), len(campaign.study.asked)
    extra = np.full((runs, receivers, asked), np.nan)
    return np.zeros((runs, receivers, len(SUMS))), extra, [None] * runs


def steps_of(campaign: Campaign, runs: Iterable[CampaignRun]) -> Iterable[int]:
    """Communication steps of each run."""
    return (campaign.weights[r.place] for r in runs)


def _side_by_side(
    campaign: Campaign,
    group: Group,
    runs: Sequence[CampaignRun],
    how: How,
    children: Children,
) -> Reduced:
    places = np.array([group.places[r.place] for r in runs])
    seeds = np.array([r.seed for r in runs])
    variations: dict[str, Any] = {f"{name}.seed": seeds for name in campaign.seeded}
    variations |= {name: values[places] for name, values in group.values.items()}
    asked = [(r.length, r.percentage) for r in campaign.study.asked if isinstance(r, Percentile)]
    lengths = [n for n in LENGTHS if any(length == n for length, _ in asked)]
    percentages = sorted({percentage for _, percentage in asked})
    try:
        outcome = lanes.execute(
            group.plan,
            variations,
            handovers=campaign.handovers,
            settling_ns=campaign.study.settling_ns,
            percentages=percentages,
            lengths=lengths,
            threads=how.workers,
            progress=how.progress,
        )
    except BuildError:
        raise
    except FmuError as error:
        if len(runs) == 1:
            return *_nothing(campaign, 1)[:2], [one_line(error)]
        # One failing run must not end the others: find it by running each one alone.
        alone = [_side_by_side(campaign, group, [r], How(workers=1), children) for r in runs]
        sums, extra = (np.concatenate([a[i] for a in alone]) for i in (0, 1))
        return sums, extra, [e for a in alone for e in a[2]]
    _, extra, errors = _nothing(campaign, len(runs))
    sums = np.stack([outcome.sums[label] for label in campaign.receivers], axis=1)
    if lengths:
        order = np.stack([outcome.order[label] for label in campaign.receivers], axis=1)
        columns = [*product(lengths, percentages)]
        at = [columns.index(pair) for pair in asked]
        extra = order.reshape(*order.shape[:2], -1)[:, :, at]
    # The other masters name the error and stop at it, and a record contains the whole truth.
    doubtful = sums[:, :, [SUMS.index("broken"), SUMS.index("unjudged")]] > 0
    bad = doubtful.any(axis=(1, 2)) | ~np.isfinite(sums).all(axis=(1, 2))
    if bad.any():
        rows: list[int] = np.flatnonzero(bad).tolist()
        mine = [runs[i] for i in rows]
        again = _one_by_one(campaign, group, mine, How(workers=how.workers), children)
        sums[rows], extra[rows] = again[:2]
        for i, problem in zip(rows, again[2], strict=True):
            errors[i] = problem
    return sums, extra, errors


def _one_by_one(
    campaign: Campaign,
    group: Group,
    runs: Sequence[CampaignRun],
    how: How,
    children: Children,
) -> Reduced:
    """As `_side_by_side`, but computed from records."""
    record = _to_record(campaign, group)
    stopped = threading.Event()

    def executed(plan: Plan) -> Record:
        if stopped.is_set():
            raise FmuError("the study was stopped")
        names = {c.name for c in plan.columns}
        wanted = [name for name in record if name in names]
        return execution.execute(plan, record=wanted, master=how.master, children=children)

    def one(run: CampaignRun) -> tuple[Floats, Floats, str | None]:
        (sums,), (extra,), _ = _nothing(campaign, 1)
        try:
            with patience(campaign.step_timeout):
                outcome = execution.survive(
                    _system(campaign, campaign.points[run.place], run.seed, children),
                    campaign.receivers,
                    executed,
                )
        except BuildError:
            raise
        except SblcosimError as error:
            if not isinstance(error, FmuError) and error.component not in campaign.receivers:
                raise
            return sums, extra, one_line(error)
        left = {c.name for c in outcome.plan.components}
        there = [i for i, receiver in enumerate(campaign.receivers) if receiver in left]
        sums[there], extra[there] = _judged(campaign, outcome.record, there, children)
        return sums, extra, "; ".join(map(_line, outcome.failures.values())) or None

    results = []
    # Python in this process holds the interpreter's lock, and may not be thread-safe.
    alone = execution.is_here(group.plan, how.master)
    with ThreadPoolExecutor(1 if alone else how.threads) as pool:
        try:
            for i, result in enumerate(stopping.results([pool.submit(one, r) for r in runs]), 1):
                results.append(result)
                how.tell(i / len(runs))
        except BaseException:
            stopped.set()
            pool.shutdown(wait=False, cancel_futures=True)
            children.kill()
            raise
    sums, extra = (np.array([m[i] for m in results]) for i in (0, 1))
    return sums, extra, [m[2] for m in results]


def _judged(
    campaign: Campaign, record: Record, receivers: Sequence[int], children: Children
) -> tuple[Floats, Floats]:
    """Sums and extra responses of some receivers."""
    study = campaign.study
    seen = [Run(record, campaign.receivers[i], study.settling_ns) for i in receivers]
    sums = np.array([sums_of(run) for run in seen])
    with patience(campaign.step_timeout):
        extra = values_of(study.asked, seen, children)
    return sums, np.array(extra).reshape(len(seen), len(study.asked))


def _to_record(campaign: Campaign, group: Group) -> list[str]:
    """Outputs needed to judge the runs."""
    known = {c.name for c in group.plan.columns}
    ports = [f"{label}.{port}" for label in campaign.receivers for port in PORTS]
    for name in (*TRUTH, *(f"{r}.{p}" for r in campaign.receivers for p in _NEEDED)):
        if name not in known:
            raise ConfigurationError(f"{name}: must be an output, to judge the runs by, got none")
    return [name for name in (*TRUTH, *ports) if name in known]


def _line(message: str) -> str:
    return " ".join(message.split())


def _system(campaign: Campaign, point: PreparedPoint, seed: int, children: Children) -> System:
    """The system of a run, with its seed and the receivers' prior."""
    specs = dict(point.system.components)
    for name in campaign.seeded:
        specs[name] = replace(specs[name], parameters={**specs[name].parameters, "seed": seed})
    if campaign.handovers:
        start = execution.initial_outputs(specs["target"], ("position",), children=children)
        prior = tuple(float(x) for x in start["position"])
        for connection in campaign.handovers:
            label, _, name = connection.target.partition(".")
            specs[label] = replace(
                specs[label], parameters={**specs[label].parameters, name: prior}
            )
    return replace(point.system, components=specs)


def _table(
    campaign: Campaign,
    runs: Sequence[CampaignRun],
    sums: Floats,
    extra: Floats,
    durations: NDArray[np.int64],
    errors: list[str | None],
) -> pd.DataFrame:
    study = campaign.study
    columns = _about(campaign, runs)
    for number, label in enumerate(campaign.receivers):
        judged = responses(sums[:, number], durations, study.settling_ns)
        columns |= {f"{label}.{name}": judged[name].array for name in judged}
        for k, response in enumerate(study.asked):
            columns[f"{label}.{response.name}"] = extra[:, number, k]
        problems = np.flatnonzero(judged["broken"] | (judged["estimates"] == 0))
        for i in problems:
            if judged["broken"][i]:
                count = int(sums[i, number, SUMS.index("broken")])
                problem = (
                    f"{label}: estimates must be finite and have an epoch within the run, got "
                    f"{count} others"
                )
            else:
                problem = f"{label}: must give estimates after the settling time, got none"
            errors[i] = errors[i] or problem
    return pd.DataFrame({**columns, **_ends(runs, errors)})


def _about(campaign: Campaign, runs: Sequence[CampaignRun]) -> dict[str, Any]:
    """The first columns, which identify the runs."""
    study = campaign.study
    order = {
        replicate: study.points.run_order(replicate, study.seed)
        for replicate in {r.replicate for r in runs}
    }
    columns: dict[str, Any] = {
        "point": np.array([r.place + 1 for r in runs]),
        "replicate": np.array([r.replicate for r in runs]),
        "run_order": np.array([order[r.replicate][r.place] for r in runs]),
    }
    for number, name in enumerate(study.varied):
        values = [campaign.points[r.place].values[number] for r in runs]
        named = study.points.factors[number].is_categorical
        columns[name] = np.array(values, object if named else np.float64)
    return {**columns, "seed": np.array([r.seed for r in runs])}


def _ends(runs: Sequence[CampaignRun], errors: Sequence[str | None]) -> dict[str, Any]:
    """The last columns."""
    return {
        "error": np.array(errors, dtype=object),
        "run_id": np.array([r.run_id for r in runs], dtype=object),
    }
