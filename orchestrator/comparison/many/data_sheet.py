"""The sentence for a data sheet, from the runs of a scenario."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import ceil, floor
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from sblcosim.models.target.trajectories import FOUND

from ...data.truth import recorded
from ...judge.definitions import MANY_LOST
from ...judge.pooling import PERCENTAGES, pooled
from ...limits.places import still_beacons
from ...results import data_sheet
from ...results.responses import Percentile
from ...scenario.arrangement import has_own_errors
from ...scenario.scenario import Scenario, load
from ...words.numbers import figure

if TYPE_CHECKING:
    from ...results.result import Result
    from ..tournament.result import Tournament

Floats = NDArray[np.float64]

ERROR = "absolute_total"
RESPONSES = tuple(Percentile(ERROR, p) for p in PERCENTAGES)
"""Columns of a run that the sentence is made from."""


@dataclass(frozen=True, eq=False)
class _Runs:
    """All runs of a scenario as one cell without neighbours."""

    cell: NDArray[np.int64]
    lengths: Floats


def sentences(
    it: Tournament, receivers: Sequence[str], drawn: Sequence[Result]
) -> Iterator[str]:
    """A sentence for each receiver, or why there is none.

    Parameters
    ----------
    it
        Runs of one scenario.
    drawn
        Any one of them.
    """
    runs = it.settings["runs"]
    if runs < data_sheet.LEAST_RUNS:
        yield data_sheet.too_few(runs)
        return
    scenario = load(it.settings["scenarios"][0])
    where = _where(scenario, drawn)
    for receiver in receivers:
        yield _sentence(it, receiver, scenario, where)


def _sentence(it: Tournament, receiver: str, scenario: Scenario, where: str) -> str:
    s = it.settings
    bound = bound_of(percentiles_of(it, receiver), s["seed"])
    if not np.isfinite(bound):
        return (
            f"no data-sheet sentence for {receiver}: about 5 % of the runs or more have no estimate"
        )
    said = data_sheet.sentence(receiver, bound, where, scenario, f"{s['runs']:,} runs", ERROR)
    row = it.level(it.places[0], receiver)
    lost = f"; {row['lost']} of them are lost"
    return said + (lost if row["lost"] > MANY_LOST * row["runs"] else "")


def percentiles_of(it: Tournament, receiver: str) -> Floats:
    """Of each run's errors of a receiver, `PERCENTAGES` [m], (runs, len(PERCENTAGES)); NaN without
    an estimate.
    """
    columns = it.table[[f"{receiver}.{own.name}" for own in RESPONSES]]
    return columns.to_numpy(np.float64, na_value=np.nan)


def radius_of(percentiles: Floats, seed: int) -> tuple[float, float]:
    """Radius that holds 95 % of the errors of all runs, and its standard error [m].

    Both are infinite where more than 5 % of the runs have no estimate.

    Parameters
    ----------
    percentiles
        As from `percentiles_of`.
    seed
        Seed for drawing runs.
    """
    n = len(percentiles)
    lengths = np.where(np.isnan(percentiles), np.inf, percentiles)
    found = pooled(_Runs(np.zeros(n, np.int64), lengths), np.ones(1), (1, 1), seed, 1)
    return float(found.percentile[0]), float(found.std_error[0])


def bound_of(percentiles: Floats, seed: int) -> float:
    """That radius plus two standard errors [m]; arguments as in `radius_of`."""
    radius, std_error = radius_of(percentiles, seed)
    return radius + data_sheet.CERTAIN * std_error


def _where(scenario: Scenario, drawn: Sequence[Result]) -> str:
    """Distance from the platform and depth, if they are the same in all runs.

    Another FMU's beacons may be elsewhere in each run, so there is no distance from them.
    """
    if not drawn or _varies(scenario):
        return "on paths drawn anew in each run" if drawn else "on its path"
    position = recorded(drawn[0].record, "target.position")
    shallow, deep = (figure(float(it)) for it in (position[:, 2].min(), position[:, 2].max()))
    depth = f"at {shallow if shallow == deep else f'{shallow}–{deep}'} m depth"
    if scenario.platform.fmu is not None:
        return depth
    reach = np.hypot(*(position[:, :2] - still_beacons(scenario).mean(0)[:2]).T)
    own = has_own_errors(scenario.platform)
    origin = "the middle of the beacons" if own else "the platform"
    return f"at {floor(reach.min())}–{ceil(reach.max())} m from {origin}, {depth}"


def _varies(scenario: Scenario) -> bool:
    """Whether the path differs from run to run, or may differ."""
    target = scenario.target
    if target.fmu is not None:
        return True
    drawn = FOUND[target.trajectory].random
    if drawn == "always":
        return "seed" not in target.model_fields_set
    keys = {v.name: v.key for v in target.variables.values()}
    return any(np.any(getattr(target, keys[name])) for name in drawn)
