"""Runs of a campaign, simulated in this process: side by side in lanes, or one by one."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..errors import BuildError, ConfigurationError, FmuError, one_line
from ..results.definitions import TRUTH
from ..results.sums import PORTS, responses, sums_of
from ..simulation import execution
from ..simulation.isolation import Children
from ..simulation.masters import lanes, native
from ..simulation.masters.lanes_driver import SUMS
from ..simulation.plan import Plan
from ..simulation.process import patience, strangers
from ..simulation.record import Record
from ..simulation.system import System
from .campaign import Campaign, Group, Point, Run

Floats = NDArray[np.float64]
_NEEDED = ("update_count", "epoch", "position")


def simulate(
    campaign: Campaign,
    runs: Sequence[Run],
    workers: int | None,
    master: str | None,
    progress: Callable[[float], None],
    children: Children | None = None,
) -> pd.DataFrame:
    """The table of some runs, see `sblcosim.study.runner.run`; on so many threads.

    FMUs of strangers run in ``children``; None: in some that are made for it.
    """
    if children is None:
        with Children(patience_s=campaign.step_timeout) as children:
            return simulate(campaign, runs, workers, master, progress, children)
    sums = np.zeros((len(runs), len(campaign.receivers), len(SUMS)))
    errors: list[str | None] = [None] * len(runs)
    durations = np.zeros(len(runs), np.int64)
    work = sum(steps_of(campaign, runs))
    passed = 0
    for group in campaign.groups:
        rows = [i for i, run in enumerate(runs) if run.place in group.places]
        if not rows:
            continue
        mine = [runs[i] for i in rows]
        share = group.steps * len(rows)

        def report(part: float, passed: int = passed, share: int = share) -> None:
            progress((passed + part * share) / work)

        made = (
            _side_by_side(campaign, group, mine, workers, report, children)
            if group.in_lanes
            else _one_by_one(campaign, group, mine, workers, master, report, children)
        )
        sums[rows] = made[0]
        durations[rows] = group.plan.stop_ns - group.plan.start_ns
        for i, error in zip(rows, made[1], strict=True):
            errors[i] = error
        passed += share
    return _table(campaign, runs, sums, durations, errors)


def steps_of(campaign: Campaign, runs: Iterable[Run]) -> Iterable[int]:
    """Communication steps of each run."""
    count = {p: g.steps for g in campaign.groups for p in g.places}
    return (count[r.place] for r in runs)


def _side_by_side(
    campaign: Campaign,
    group: Group,
    runs: Sequence[Run],
    workers: int | None,
    progress: Callable[[float], None] | None,
    children: Children,
) -> tuple[Floats, list[str | None]]:
    """Sums, (runs, receivers, sums), and errors."""
    at = [group.places[r.place] for r in runs]
    seeds = np.array([r.seed for r in runs])
    variations: dict[str, Any] = {f"{name}.seed": seeds for name in campaign.seeded}
    variations |= {name: values[at] for name, values in group.values.items()}
    try:
        outcome = lanes.execute(
            group.plan,
            variations,
            handovers=campaign.handovers,
            settling_ns=campaign.study.settling_ns,
            threads=workers,
            progress=progress,
        )
    except BuildError:
        raise
    except FmuError as error:
        if len(runs) == 1:
            return np.zeros((1, len(campaign.receivers), len(SUMS))), [one_line(error)]
        # One run must not end the others.
        alone = [_side_by_side(campaign, group, [r], 1, None, children) for r in runs]
        return np.concatenate([a for a, _ in alone]), [e for _, es in alone for e in es]
    sums = np.stack([outcome.sums[label] for label in campaign.receivers], axis=1)
    errors: list[str | None] = [None] * len(runs)
    # The other masters know where a run went wrong, and end it there; and a record knows all truth.
    doubtful = sums[:, :, [SUMS.index("broken"), SUMS.index("unjudged")]] > 0
    bad = doubtful.any(axis=(1, 2)) | ~np.isfinite(sums).all(axis=(1, 2))
    if bad.any():
        rows: list[int] = np.flatnonzero(bad).tolist()
        mine = [runs[i] for i in rows]
        again = _one_by_one(campaign, group, mine, workers, None, silent, children)
        sums[rows] = again[0]
        for i, problem in zip(rows, again[1], strict=True):
            errors[i] = problem
    return sums, errors


def silent(share: float) -> None:
    """Progress that nobody wants to see."""


def _one_by_one(
    campaign: Campaign,
    group: Group,
    runs: Sequence[Run],
    workers: int | None,
    master: str | None,
    progress: Callable[[float], None],
    children: Children,
) -> tuple[Floats, list[str | None]]:
    """As `_side_by_side`, through records."""
    known = {c.name for c in group.plan.columns}
    ports = [f"{label}.{port}" for label in campaign.receivers for port in PORTS]
    record = [name for name in (*TRUTH, *ports) if name in known]
    for name in (*TRUTH, *(f"{r}.{p}" for r in campaign.receivers for p in _NEEDED)):
        if name not in known:
            raise ConfigurationError(f"{name}: must be an output, to judge the runs by, got none")

    stopped = threading.Event()

    def executed(plan: Plan) -> Record:
        if stopped.is_set():
            raise FmuError("the study was stopped")
        names = {c.name for c in plan.columns}
        wanted = [name for name in record if name in names]
        return execution.execute(plan, record=wanted, master=master, children=children)

    def one(run: Run) -> tuple[Floats, str | None]:
        rows = np.zeros((len(campaign.receivers), len(SUMS)))
        try:
            with patience(campaign.step_timeout):
                outcome = execution.survive(
                    _system(campaign, campaign.points[run.place], run.seed, children),
                    campaign.receivers,
                    executed,
                )
        except BuildError:
            raise
        except FmuError as error:
            return rows, one_line(error)
        left = {c.name for c in outcome.plan.components}
        for i, receiver in enumerate(campaign.receivers):
            if receiver in left:
                rows[i] = sums_of(outcome.record, receiver, campaign.study.settling_ns)
        return rows, "; ".join(map(_line, outcome.failures.values())) or None

    made = []
    # Python components hold the interpreter's lock, and need not be made for threads.
    here = not strangers(group.plan)
    alone = here and (master == "python" or native.unsupported(group.plan) is not None)
    with ThreadPoolExecutor(1 if alone else workers or os.cpu_count() or 1) as pool:
        try:
            for i, result in enumerate(pool.map(one, runs), 1):
                made.append(result)
                progress(i / len(runs))
        except BaseException:
            stopped.set()
            pool.shutdown(wait=False, cancel_futures=True)
            children.kill()
            raise
    return np.array([sums for sums, _ in made]), [error for _, error in made]


def _line(message: str) -> str:
    return " ".join(message.split())


def _system(campaign: Campaign, point: Point, seed: int, children: Children) -> System:
    """The system of a run, with its seed and its true start."""
    specs = dict(point.system.components)
    for name in campaign.seeded:
        specs[name] = replace(specs[name], parameters={**specs[name].parameters, "seed": seed})
    if campaign.handovers:
        found = execution.initial_outputs(specs["target"], ("position",), children=children)
        prior = tuple(float(x) for x in found["position"])
        for connection in campaign.handovers:
            label, _, name = connection.target.partition(".")
            specs[label] = replace(
                specs[label], parameters={**specs[label].parameters, name: prior}
            )
    return replace(point.system, components=specs)


def _table(
    campaign: Campaign,
    runs: Sequence[Run],
    sums: Floats,
    durations: NDArray[np.int64],
    errors: list[str | None],
) -> pd.DataFrame:
    study = campaign.study
    order = {
        replicate: study.plan.run_order(replicate, study.seed)
        for replicate in {r.replicate for r in runs}
    }
    columns: dict[str, Any] = {
        "point": np.array([r.place + 1 for r in runs]),
        "replicate": np.array([r.replicate for r in runs]),
        "run_order": np.array([order[r.replicate][r.place] for r in runs]),
    }
    physical = np.array([campaign.points[r.place].values for r in runs])
    columns |= {name: physical[:, i] for i, name in enumerate(study.factors)}
    columns["seed"] = np.array([r.seed for r in runs])
    for number, label in enumerate(campaign.receivers):
        found = responses(sums[:, number], durations)
        columns |= {f"{label}.{name}": found[name].array for name in found}
        problems = np.flatnonzero(found["broken"] | (found["estimates"] == 0))
        for i in problems:
            if found["broken"][i]:
                count = int(sums[i, number, SUMS.index("broken")])
                problem = (
                    f"{label}: estimates must be finite and of an epoch within the run, got "
                    f"{count} others"
                )
            else:
                problem = f"{label}: must give estimates after the settling time, got none"
            errors[i] = errors[i] or problem
    columns["error"] = np.array(errors, dtype=object)
    columns["run_id"] = np.array([r.run_id for r in runs], dtype=object)
    return pd.DataFrame(columns)
