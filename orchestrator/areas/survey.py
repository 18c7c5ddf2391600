"""Simulate the cells of an area, with more runs where the error is close to the requirement."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sblcosim.fmus.read.ports import Fmu
from sblcosim.fmus.stopping import interruptible
from sblcosim.models import RECEIVERS
from sblcosim.models.settings.keys import in_si

from ..errors import ConfigurationError, check_choice, instance, shortened
from ..judge.pooling import Pooled, pooled
from ..limits.places import still_beacons
from ..scenario.files import naming_files
from ..scenario.overrides import Changes
from ..scenario.scenario import Scenario, Source, load
from ..scenario.schema import CORE_COMPONENTS
from ..scenario.tracks import origin_of
from ..simulation.how import How
from ..simulation.masters.lanes_driver import LENGTHS
from ..study.kept import Kept
from .grid import Area, Cells, Grid, grid_of
from .motion import RADIUS, Circle, check_depth, circle_of, circling
from .over_places import asked
from .possible import PossibleInCells, left_out, possible
from .result import AreaMap
from .runs import CellRuns, Simulator, check_times

Integers = NDArray[np.int64]

CELLS, RUNS, DURATION, SETTLING = 60, 20, 60.0, 20.0
"""Number of cells along the longer side, and of runs in a cell; duration of a run, and time until
errors count [s]."""
MOST_ALONE = {"Python": 2_000, "FMU": 20_000}
"""Limit on runs of receivers that are executed one by one: in Python a run takes tenths of a
second."""
NEAR = 2.0
"""Standard errors within which a cell is near the requirement."""
_EXTRA, _MOST_EXTRA = 4, 3
"""At most a fourth of the first runs is added, and at most three times a cell's own."""
_FIRST_PART, _LAST_PART = 0.1, 0.9
"""Shares of the progress at which the first runs begin and the last have ended."""


@interruptible
@naming_files
def map_area(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    area: Area,
    depth: float,
    receiver: Source | None = None,
    overrides: Changes = (),
    *,
    limit_m: float | None = None,
    cells: Cells = CELLS,
    runs: int = RUNS,
    error: str = "absolute_total",
    duration_s: float = DURATION,
    settling_s: float = SETTLING,
    radius_m: float = RADIUS,
    speed_m_s: float | None = None,
    workers: int | None = None,
    progress: Callable[[float], None] | None = None,
    keep: Kept | None = None,
    before: Callable[[Mapping[str, Any]], None] | None = None,
) -> AreaMap:
    """The 95 % error of a receiver over an area, with the possible error there.

    In each cell a diver circles about its middle. Every run starts at a different bearing and has
    its own noise. The errors of all epochs and runs form one distribution, pooled with those of
    neighbouring cells (`sblcosim.judge.pooling`). Its 95th percentile is the number of the cell.
    With a limit, a second round of runs goes to the cells whose interval of two standard errors
    contains the limit: up to a fourth of the first round.

    Parameters
    ----------
    scenario, overrides
        As in `sblcosim.run`.
    area
        ``"60x60"``: north and east about the middle of the beacons [m]; ``"-10,50,0,60"``: from and
        to north, from and to east [m]; or these numbers.
    depth
        Depth of the diver [m].
    receiver
        A name, an FMU file, ``"file.py:Class"`` or a class; None: the scenario's own. Many runs of
        our own receivers are executed side by side. Those of others are executed one by one, so
        fewer are allowed (`MOST_ALONE`).
    limit_m
        The requirement [m], for its contour.
    cells
        Number of cells along the longer side, or ``"40x60"``: north and east.
    runs
        Number of runs in each cell, in the first round.
    error
        Kind of length: ``absolute_total``, ``absolute_horizontal``, ``relative_total`` or
        ``relative_horizontal``.
    duration_s, settling_s
        Length of a run, and the time until its errors count [s].
    radius_m, speed_m_s
        Radius of the circle [m], and the diver's speed [m/s]; None: that of the scenario.
    workers
        Number of threads; the result does not depend on it. None: all cores.
    progress
        Called with the completed share, 0 to 1.
    keep
        Folder of finished runs, which are not repeated; None: nothing is written.
    before
        Called with what is known of the manifest, before the first run.

    Raises
    ------
    ConfigurationError
        An argument is out of range, or the scenario cannot be simulated with such a diver.
    FmuError
        An FMU cannot be built or is broken.
    """
    told = progress or silent
    given = load(scenario, overrides)
    check_choice("map error", error, LENGTHS)
    check_times(duration_s, settling_s)
    check(given, limit_m, runs, workers)
    circle = circle_of(given, radius_m, speed_m_s, duration_s)
    grid = grid_of(area, depth, cells, still_beacons(given).mean(0)[:2].tolist())
    check_depth(given, grid.depth)
    moving = circling(given, circle, grid.depth, duration_s)
    simulator = Simulator(moving, receiver, grid, error, settling_s)
    check_work(simulator, grid.count * runs)
    span_s = (settling_s, duration_s)
    settings = {
        "area_m": [*grid.north, *grid.east], "depth_m": grid.depth, "cells": [*grid.shape],
        "runs": runs, "error": error, "limit_m": limit_m, "duration_s": duration_s,
        "settling_s": settling_s, "radius_m": circle.radius, "speed_m_s": circle.speed,
        "seed": given.seed,
    }  # fmt: skip
    if before is not None:
        before(asked("map", moving, simulator.receiver, settings, str(circle)))
    best = possible(moving, grid, circle, error, span_s, workers)
    told(_FIRST_PART)
    sample, found = _surveyed(simulator, best, runs, limit_m, workers, told, keep)
    told(1.0)
    return AreaMap(
        scenario=moving, receiver=simulator.receiver, settings=settings, motion=str(circle),
        grid=grid, cells=_table(grid, sample, found, best), failures=simulator.failures,
        beacons=still_beacons(given), origin=origin_of(moving.place),
        doubt=doubt_of(circle, moving, simulator.receiver, receiver),
        left_out=left_out(moving, grid, best, (settling_s, duration_s)),
    )  # fmt: skip


def doubt_of(circle: Circle, scenario: Scenario, label: str, receiver: Source | None) -> str:
    """Whether the circle is too fast for one of our receivers; nothing is known of others.

    A receiver that learns q allows for any circle.
    """
    own = receiver or scenario.receiver.fmu or scenario.receiver.type
    ours = RECEIVERS[own].of("parameter") if isinstance(own, str) and own in RECEIVERS else ()
    psd = next((variable for variable in ours if variable.name == "acceleration_psd"), None)
    if psd is None:
        return ""
    given = getattr(scenario.receiver, psd.key)
    q = float(psd.starts[0] if given is None else in_si(psd, given))
    text = "" if q < 0 else circle.doubt(label, q)
    return f'{text}; or use {psd.key} = "learned"' if text and psd.named else text


def _surveyed(
    simulator: Simulator,
    best: PossibleInCells,
    runs: int,
    limit_m: float | None,
    workers: int | None,
    told: Callable[[float], None],
    keep: Kept | None,
) -> tuple[CellRuns, Pooled]:
    """The runs of both rounds, and their numbers."""
    grid, seed = simulator.cells, simulator.base.seed
    first = grid.count * runs
    most = first + (0 if limit_m is None else first // _EXTRA)
    done = 0

    def part(share: float, count: int) -> None:
        told(_FIRST_PART + (_LAST_PART - _FIRST_PART) * (done + share * count) / most)

    every = np.arange(first)
    sample = simulator.run(
        every % grid.count, every // grid.count,
        How(workers=workers, progress=lambda share: part(share, first)), keep,
    )
    found = pooled(sample, best.percentile, grid.shape, seed, workers)
    if limit_m is not None:
        cell, replicate = second_round(found, limit_m, runs, first // _EXTRA)
        if len(cell):
            done = first
            more = simulator.run(
                cell, replicate,
                How(workers=workers, progress=lambda share: part(share, len(cell))), keep,
            )
            sample += more
            found = pooled(sample, best.percentile, grid.shape, seed, workers)
    return sample, found


def second_round(
    pooling: Pooled, limit_m: float, runs: int, most: int
) -> tuple[Integers, Integers]:
    """Cells and replicates of the second round, those closest to the limit first."""
    with np.errstate(divide="ignore", invalid="ignore"):
        away = np.abs(pooling.percentile - limit_m) / pooling.std_error
    near = np.flatnonzero(away <= NEAR)
    near = near[np.argsort(away[near], kind="stable")]
    if not len(near) or not most:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    each = min(max(most // len(near), 1), _MOST_EXTRA * runs)
    chosen = np.sort(near[: most // each])
    replicates = np.arange(runs, runs + each)
    return np.tile(chosen, each), np.repeat(replicates, len(chosen))


def _table(grid: Grid, sample: CellRuns, pooling: Pooled, best: PossibleInCells) -> pd.DataFrame:
    """One row per cell."""
    runs = np.bincount(sample.cell, minlength=grid.count)

    def mean(values: Any) -> Any:
        return np.bincount(sample.cell, values, grid.count) / runs

    north, east, depth = grid.centres.T
    return pd.DataFrame(
        {
            "north_m": north, "east_m": east, "depth_m": depth, "runs": runs,
            "p95_m": pooling.percentile, "std_error_m": pooling.std_error,
            "lost_share": mean(sample.lost.astype(np.float64)),
            "availability": mean(sample.availability),
            "possible_p95_m": np.where(best.accuracy, best.percentile, np.nan),
            "accuracy": best.accuracy, "hdop": best.hdop,
        }
    )  # fmt: skip


def check(scenario: Scenario, limit_m: float | None, runs: int, workers: int | None) -> None:
    """Refuse numbers out of range, and components from other tools."""
    if limit_m is not None and not (isinstance(limit_m, int | float) and 0 < limit_m < np.inf):
        raise ConfigurationError(
            f"map limit: must be more than 0 m, got {shortened(instance(limit_m))}"
        )
    for name, value in (("runs", runs), ("workers", workers)):
        if value is not None and (not isinstance(value, int) or value < 1):
            raise ConfigurationError(
                f"map {name}: must be a whole number of at least 1, got "
                f"{shortened(instance(value))}"
            )
    for name in CORE_COMPONENTS:
        if getattr(scenario, name).fmu is not None:
            raise ConfigurationError(
                f"{scenario.where(name, 'fmu')}: must be left out for a map, which knows what is "
                "possible for our own components only ('sblcosim run --runs 60' has the errors of "
                f"others and a data-sheet sentence), got {getattr(scenario, name).fmu}"
            )
        if "seed" in getattr(scenario, name).model_fields_set:
            raise ConfigurationError(
                f"{scenario.where(name, 'seed')}: must be left out for a map, whose cells do not "
                f"share their noise, got {getattr(scenario, name).seed}"
            )


def check_work(simulator: Simulator, runs: int) -> None:
    """Refuse more runs of another tool's receiver than end in reasonable time."""
    if simulator.in_lanes:
        return
    components = simulator.campaign.groups[0].plan.components
    kind = "FMU" if all(isinstance(c.source, Fmu) for c in components) else "Python"
    if runs > MOST_ALONE[kind]:
        raise ConfigurationError(
            f"map cells: must be few enough for at most {MOST_ALONE[kind]:,} runs of a "
            f"receiver whose runs go one by one ({kind}), got {runs:,}"
        )


def silent(share: float) -> None:
    """Ignore progress."""
