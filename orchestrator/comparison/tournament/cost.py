"""Time of a receiver's update: the time of runs with the receiver minus that without.

Our own receivers are measured where a comparison is quickest: in their engine for one lane, in one
thread. Others are called by the masters that run them, with all the overhead. The smallest of
several measurements counts, because other work on the machine only adds time. Where everything
runs in this process, its own processor time is used, which other processes hardly change.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...errors import SblcosimError
from ...scenario.labels import RAW
from ...scenario.sources import choose
from ...simulation import execution
from ...simulation.children.process import foreign
from ...simulation.masters import lanes, lanes_driver
from ...simulation.plans.plan import Plan
from ...simulation.resolve import resolve
from ...simulation.system import System
from ...study.campaign import receivers_of, resolved_alone
from ...study.study import Study

ENOUGH_S = 0.03
"""Shortest measurement that clocks and interrupts do not spoil [s]."""
MOST_RUNS = 256
"""Runs per measurement if the clock is too coarse for a single one."""
TIMES = 5
"""Number of measurements, unless each takes longer than `PATIENCE_S`."""
PATIENCE_S = 1.0
Clock = Callable[[], float]


def update_seconds(study: Study) -> dict[str, float | None]:
    """Time of an update of each receiver of a study [s]; None if it cannot be measured."""
    labels = [label for label in choose(study.base, receivers_of(study)) if label != RAW]
    _, system, plan = resolved_alone(study, 1)
    without = resolve(_with(system, labels, ()))
    ours = lanes_driver.unsupported(plan) is None
    found: dict[str, float | None] = {}
    for label in labels:
        try:
            alone = plan if labels == [label] else resolve(_with(system, labels, (label,)))
            mine = ours or lanes_driver.unsupported(alone) is None
            found[label] = _in_lanes(alone, without, label) if mine else _called(alone, without)
        except SblcosimError:  # failures are reported with the runs
            found[label] = None
    return found


def _with(system: System, labels: Sequence[str], kept: Sequence[str]) -> System:
    """The system with only some of its receivers."""
    gone = set(labels) - set(kept)
    return replace(
        system,
        components={k: v for k, v in system.components.items() if k not in gone},
        connections=tuple(
            c for c in system.connections if c.target.partition(".")[0] not in gone
        ),
    )


def _in_lanes(plan: Plan, without: Plan, label: str) -> float | None:
    def run(which: Plan, runs: int) -> lanes.RunsOutcome:
        seeds: Mapping[str, object] = {"acoustics.seed": np.arange(1, runs + 1)}
        return lanes.execute(which, seeds, lanes=1, threads=1)

    updates = run(plan, 1).sums[label][:, lanes_driver.SUMS.index("updates")].sum()
    clock = time.process_time
    one = _seconds(lambda: run(plan, 1), clock)
    runs = max(1, round(ENOUGH_S / max(one, ENOUGH_S / MOST_RUNS)))
    return _less(
        lambda: run(plan, runs), lambda: run(without, runs), float(updates) * runs, clock
    )


def _called(plan: Plan, without: Plan) -> float | None:
    def run(which: Plan) -> float:
        counts = [c.name for c in which.columns if c.name.endswith(".update_count")]
        record = execution.execute(which, record=counts or None)
        return float(sum(record.values[name][-1] for name in counts))

    clock = time.perf_counter if foreign(plan) else time.process_time
    return _less(lambda: run(plan), lambda: run(without), run(plan), clock)


def _less(
    whole: Callable[[], object], rest: Callable[[], object], updates: float, clock: Clock
) -> float | None:
    """Difference of the smallest times of two sets of runs, per update."""
    times = []
    for _ in range(TIMES):
        times.append((_seconds(whole, clock), _seconds(rest, clock)))
        if times[-1][0] > PATIENCE_S:
            break
    own = min(one for one, _ in times) - min(other for _, other in times)
    return own / updates if own > 0 and updates > 0 else None


def _seconds(what: Callable[[], object], clock: Clock) -> float:
    started = clock()
    what()
    return clock() - started
