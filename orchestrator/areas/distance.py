"""Simulate divers at distances from the platform, in all directions, at one depth or several."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sblcosim.fmus.stopping import interruptible

from ..errors import check_choice
from ..judge.over_runs import pooled as rms_of
from ..judge.pooling import Pooled, pooled
from ..limits.places import still_beacons
from ..results.data_sheet import CERTAIN
from ..scenario.files import naming_files
from ..scenario.overrides import Changes
from ..scenario.scenario import Scenario, Source, load
from ..simulation.how import How
from ..simulation.masters.lanes_driver import LENGTHS
from ..study.kept import Kept
from ..words.numbers import figure, rounded
from .distance_result import DistanceCurve
from .motion import RADIUS, Circle, check_depth, circle_of, circling
from .over_places import asked
from .possible import PossibleInCells, left_out, possible
from .rings import Depths, Distance, Rings, rings_of
from .runs import CellRuns, Simulator, check_times
from .survey import DURATION, SETTLING, check, check_work, doubt_of, silent

Floats = NDArray[np.float64]

DISTANCES, RUNS = 21, 500
"""Number of distances, including the first and the last one, and runs at each."""
_HUMP = 1.3
"""Ratio to the possible error, over the usual ratio, from which a distance is said to stand out."""
_BEFORE = 0.1
"""Share of the progress when the runs begin."""


@interruptible
@naming_files
def map_distance(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    distance: Distance,
    depth: Depths,
    receiver: Source | None = None,
    overrides: Changes = (),
    *,
    limit_m: float | None = None,
    cells: int = DISTANCES,
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
) -> DistanceCurve:
    """The error of a receiver against the distance from the platform, with the possible error.

    In each run, a diver circles about a place in a different direction at that distance. The errors
    of all epochs and runs at a distance form one distribution. Distances are not pooled.

    Parameters
    ----------
    scenario, receiver, overrides, error, duration_s, settling_s, radius_m, speed_m_s
        As in `sblcosim.map_area`.
    distance
        The largest distance, or the smallest and the largest [m]: 60, (5, 60) or ``"5,60"``. It is
        horizontal, from the middle of the beacons to the middle of the diver's circle.
    depth
        Depth of the diver, one or several [m].
    limit_m
        The requirement [m]: the answer says up to which distance it is kept.
    cells
        Number of distances, evenly spaced.
    runs
        Number of runs at each distance and depth.
    workers, progress, keep, before
        As in `sblcosim.map_area`.

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
    rings = rings_of(distance, depth, cells, still_beacons(given).mean(0)[:2].tolist())
    check_depth(given, max(rings.depths))
    moving = circling(given, circle, rings.depths[0], duration_s)
    simulator = Simulator(moving, receiver, rings, error, settling_s)
    check_work(simulator, rings.count * runs)
    settings = {
        "distance_m": [rings.distances[0], rings.distances[-1]], "depth_m": [*rings.depths],
        "cells": len(rings.distances), "runs": runs, "error": error, "limit_m": limit_m,
        "duration_s": duration_s, "settling_s": settling_s, "radius_m": circle.radius,
        "speed_m_s": circle.speed, "seed": given.seed,
    }  # fmt: skip
    if before is not None:
        before(asked("distances", moving, simulator.receiver, settings, str(circle)))
    best = possible(moving, rings, circle, error, (settling_s, duration_s), workers)
    told(_BEFORE)
    every = np.arange(rings.count * runs)
    sample = simulator.run(
        every % rings.count, every // rings.count,
        How(workers=workers, progress=lambda share: told(_BEFORE + (1 - _BEFORE) * share)), keep,
    )
    found = pooled(sample, best.percentile, rings.shape, given.seed, workers, reach=0)
    told(1.0)
    table = _table(rings, sample, found, best)
    return DistanceCurve(
        scenario=moving, receiver=simulator.receiver, settings=settings, motion=str(circle),
        distances=table, failures=simulator.failures,
        doubt=doubt_of(circle, moving, simulator.receiver, receiver) or hump(table, circle),
        left_out=left_out(moving, rings, best, (settling_s, duration_s)),
    )  # fmt: skip


def hump(rows: pd.DataFrame, circle: Circle) -> str:
    """Where the error is far above what is possible, in words; empty if nowhere.

    Elsewhere it must be nearer to it, and two standard errors must not explain the difference.

    Parameters
    ----------
    rows
        The table of distances.
    circle
        How the diver moves.
    """
    possible = rows["possible_p95_m"]
    usual = float((rows["p95_m"] / possible).median())
    least = (rows["p95_m"] - CERTAIN * rows["std_error_m"]) / possible
    if not (least > _HUMP * max(usual, 1.0)).any():
        return ""
    worst: Any = rows.iloc[int(np.nanargmax(least))]
    return (
        f"at {figure(worst['distance_m'])} m distance and {figure(worst['depth_m'])} m depth the "
        f"95 % error is {rounded(worst['p95_m'] / worst['possible_p95_m'], 2)} times the possible "
        f"one, where {rounded(usual, 2)} times is usual: perhaps the diver turns too fast for the "
        f"receiver there; compare a wider circle, with a radius of {figure(3 * circle.radius)} m"
    )


def _table(
    rings: Rings, sample: CellRuns, found: Pooled, best: PossibleInCells
) -> pd.DataFrame:
    """A row per depth and distance."""
    depth, distance = rings.of_cells
    own = pd.DataFrame({
        "cell": sample.cell, "rms": sample.rms, "lost": sample.lost.astype(np.float64),
        "availability": sample.availability,
    }).groupby("cell")  # fmt: skip
    means = own[["lost", "availability"]].mean()
    with np.errstate(invalid="ignore"):
        bound = found.percentile + CERTAIN * found.std_error
    return pd.DataFrame({
        "depth_m": depth, "distance_m": distance, "runs": own.size().to_numpy(),
        "rms_m": [rms_of(rms.to_numpy()) for _, rms in own["rms"]],
        "p95_m": found.percentile, "std_error_m": found.std_error, "bound_m": bound,
        "lost_share": means["lost"].to_numpy(), "availability": means["availability"].to_numpy(),
        "possible_rms_m": np.where(best.accuracy, best.rms, np.nan),
        "possible_p95_m": np.where(best.accuracy, best.percentile, np.nan),
        "accuracy": best.accuracy,
    })  # fmt: skip
