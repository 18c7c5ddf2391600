"""The possible error at the points of a study, beside the error of its receivers.

Each point takes one run of the raw fix, which gives the path and the packets received, and the
reference along it (`sblcosim.limits`): some tenths of a second. For studies with many points, only
the two points with the smallest and the largest error are computed.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
import pandas as pd

from ..api import run
from ..errors import SblcosimError
from ..judge.over_runs import pooled_by
from ..limits.run import of_run
from ..limits.verdict import Possible
from ..scenario.scenario import Scenario
from ..scenario.wiring import connect
from ..simulation.resolve import resolve
from ..study.campaign import receivers_of
from ..study.study import Study
from ..words.numbers import number, quantity
from .page import Block, PageTable

MOST_POINTS = 8
"""Most points of a study for which all points are computed."""
RMS = "absolute_total_rms_m"
_RECEIVER = "multilateration"
_NOTE = (
    "RMS total error [m]. The reference is the posterior Cramér-Rao recursion along the path, with "
    "the packets received and the true noises of one run of each point, after the settling time. "
    "For a motion that is drawn from the model it is a bound: no receiver with the stated priors "
    "can beat it. On other paths it is a yardstick. Relative to the platform: the error of x − p, "
    "the diver's true position minus the platform's. “none”: the bearing is known too badly for "
    "any accuracy."
)


def of_scenario(scenario: Scenario, since_ns: int = 0) -> Possible | None:
    """The possible error in a run; None if it has foreign components or cannot be run.

    Parameters
    ----------
    since_ns
        Time after the start before which epochs do not count [ns].
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the study has already given the warnings
            result = run(scenario, _RECEIVER)
    except SblcosimError:
        return None
    record = result.record
    epochs = record.estimates(_RECEIVER).epoch_ns
    epochs = epochs[epochs >= record.time_ns[0] + since_ns]
    found = of_run(record, scenario, result.fmus, epochs)
    return None if found is None else found.verdict(epochs)


def tables(study: Study, runs: pd.DataFrame) -> list[Block]:
    """A table of the points; empty where nothing is known."""
    looking_back = _looking_back(study)
    columns = (c for c in runs.columns if c.endswith(f".{RMS}"))
    column = next((c for c in columns if c.partition(".")[0] not in looking_back), None)
    reached = None if column is None else pooled_by(runs[column], runs["point"])
    rows: list[Sequence[str]] = []
    without: dict[str, None] = {}
    for point in _chosen(len(study.points.values), reached):
        scenario = study.base.override(study.overrides(point).items())
        scenario = scenario.override({"seed": study.run_seed(point, 1)})
        verdict = of_scenario(scenario, study.settling_ns)
        if verdict is None:
            continue
        values = zip(study.varied, study.points.values[point - 1], strict=True)
        where = ", ".join(
            f"{study.labels[name]} {quantity(v, study.units[name])}" for name, v in values
        )
        rms = np.nan if reached is None else reached.get(point, np.nan)
        rows.append((where or "all runs", number(rms), *cells(verdict)))
        without |= dict.fromkeys(verdict.without)
    if not rows:
        return []
    receiver = "" if column is None else f", {column.partition('.')[0]}"
    head = ("Point", f"RMS{receiver}", "Reference", "Reference, relative to the platform")
    left = f" The reference leaves out these errors: {', '.join(without)}." if without else ""
    return [PageTable("What is possible", head, rows, (), _NOTE + left)]


def _looking_back(study: Study) -> set[str]:
    """The receivers that use samples from after their epochs."""
    try:
        plan = resolve(connect(study.base, receivers_of(study)))
    except SblcosimError:  # a file that is no longer there
        return set()
    return {component.name for component in plan.components if component.lag_s > 0}


def cells(verdict: Possible) -> tuple[str, str]:
    """The absolute and the relative possible error, as cells of a table."""
    if not verdict.accuracy:
        return "none", "none"
    return number(verdict.absolute_rms), number(verdict.relative_rms)


def _chosen(points: int, reached: pd.Series[float] | None) -> list[int]:
    """The points to compute, counted from 1."""
    if points <= MOST_POINTS:
        return list(range(1, points + 1))
    known = pd.Series(dtype=float) if reached is None else reached.dropna()
    if known.empty:
        return []
    numbers = known.index.to_numpy(dtype=int)
    return list(dict.fromkeys([int(numbers[known.argmin()]), int(numbers[known.argmax()])]))
