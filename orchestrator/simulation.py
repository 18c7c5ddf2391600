"""Runs of a campaign, simulated in this process: side by side in lanes, or one by one."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from . import lanes, masters, native
from .definitions import TRUTH
from .errors import BuildError, ConfigurationError, FmuError, one_line
from .master import initial_outputs
from .plan import resolve
from .points import Campaign, Group, Point, Run
from .reduction import PORTS, SUMS, responses, sums_of
from .system import System

Floats = NDArray[np.float64]
_NEEDED = ("update_count", "epoch", "position")


def simulate(
    campaign: Campaign,
    runs: Sequence[Run],
    workers: int | None,
    master: str | None,
    progress: Callable[[float], None],
) -> pd.DataFrame:
    """The table of some runs, see `sblcosim.campaign.run`; on so many threads."""
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
            _side_by_side(campaign, group, mine, workers, report)
            if group.in_lanes
            else _one_by_one(campaign, group, mine, workers, master, report)
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
        alone = [_side_by_side(campaign, group, [r], 1, None) for r in runs]
        return np.concatenate([a for a, _ in alone]), [e for _, es in alone for e in es]
    sums = np.stack([outcome.sums[label] for label in campaign.receivers], axis=1)
    errors: list[str | None] = [None] * len(runs)
    # The other masters know where a run went wrong, and end it there; and a record knows all truth.
    doubtful = sums[:, :, [SUMS.index("broken"), SUMS.index("unjudged")]] > 0
    bad = doubtful.any(axis=(1, 2)) | ~np.isfinite(sums).all(axis=(1, 2))
    if bad.any():
        rows: list[int] = np.flatnonzero(bad).tolist()
        again = _one_by_one(campaign, group, [runs[i] for i in rows], workers, None, silent)
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
) -> tuple[Floats, list[str | None]]:
    """As `_side_by_side`, through records."""
    known = {c.name for c in group.plan.columns}
    ports = [f"{label}.{port}" for label in campaign.receivers for port in PORTS]
    record = [name for name in (*TRUTH, *ports) if name in known]
    for name in (*TRUTH, *(f"{r}.{p}" for r in campaign.receivers for p in _NEEDED)):
        if name not in known:
            raise ConfigurationError(f"{name}: must be an output, to judge the runs by, got none")

    def one(run: Run) -> tuple[Floats, str | None]:
        try:
            plan = resolve(_system(campaign, campaign.points[run.place], run.seed), again=True)
            made = masters.execute(plan, record=record, master=master)
            rows = [sums_of(made, r, campaign.study.settling_ns) for r in campaign.receivers]
        except BuildError:
            raise
        except FmuError as error:
            return np.zeros((len(campaign.receivers), len(SUMS))), one_line(error)
        return np.array(rows), None

    made = []
    # Python components hold the interpreter's lock, and need not be made for threads.
    alone = master == "python" or native.foreign(group.plan) is not None
    with ThreadPoolExecutor(1 if alone else workers or os.cpu_count() or 1) as pool:
        try:
            for i, result in enumerate(pool.map(one, runs), 1):
                made.append(result)
                progress(i / len(runs))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return np.array([sums for sums, _ in made]), [error for _, error in made]


def _system(campaign: Campaign, point: Point, seed: int) -> System:
    """The system of a run, with its seed and its true start."""
    specs = dict(point.system.components)
    for name in campaign.seeded:
        specs[name] = replace(specs[name], parameters={**specs[name].parameters, "seed": seed})
    if campaign.handovers:
        start = initial_outputs(specs["target"], ("position",))["position"]
        prior = tuple(float(x) for x in start)
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
    columns["error"] = pd.array(errors, dtype="str")
    columns["run_id"] = pd.array([r.run_id for r in runs], dtype="str")
    return pd.DataFrame(columns)
