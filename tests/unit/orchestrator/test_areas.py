"""Maps of the error of a receiver over an area."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, get_args

import geojson
import numpy as np
import pandas as pd
import pymap3d
import pytest
import sblcosim
import sblcosim.cli
from drawn_texts import spoiled_texts
from matplotlib.patches import Patch
from matplotlib.text import Text
from quick import few
from sblcosim import style
from sblcosim.areas import contours, figures, motion, result, runs, survey
from sblcosim.areas.grid import Grid, grid_of
from sblcosim.areas.possible import possible
from sblcosim.cli.documents.areas import MapSettings
from sblcosim.errors import ConfigurationError
from sblcosim.judge import pooling
from sblcosim.limits import lengths, places
from sblcosim.limits.parameters import own_beacon
from sblcosim.limits.path import circle_psd, path_psd
from sblcosim.limits.run import reference
from sblcosim.models import RECEIVERS
from sblcosim.results.responses import Percentile, Run, value_of
from sblcosim.scenario.conditions import conditions
from sblcosim.scenario.likes import LIKES
from sblcosim.scenario.scenario import Scenario, load
from sblcosim.simulation.how import How
from sblcosim.simulation.masters.lanes_driver import LENGTHS
from scipy import special
from scipy.interpolate import RegularGridInterpolator
from seams import Seam
from typer.main import get_command
from typer.testing import CliRunner

SHORT: dict[str, Any] = {"duration_s": 12.0, "settling_s": 6.0}
RECEIVER = '''
from sblcosim import Estimate, Receiver


class Mine(Receiver):
    """Says the same place always."""

    def update(self, samples):
        return Estimate(epoch=samples[-1].epoch, position=(0.0, 0.0, 5.0)) if samples else None
'''


def surveyed(**options: Any) -> result.AreaMap:
    return sblcosim.map_area(
        "realistic-dive", "40x60", 5.0, **{"cells": "4x6", "runs": 3, **SHORT, **options}
    )


@pytest.fixture(scope="module")
def found() -> result.AreaMap:
    """A map with a requirement, whose scenario is somewhere on Earth."""
    place = {"place.latitude_deg": 43.1, "place.longitude_deg": 10.2, "place.height_m": 40.0}
    return surveyed(runs=8, limit_m=4.0, overrides=place)


# --- Cells ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("area", ["40x60", "-18,22,-29,31", (40, 60), [-18.0, 22.0, -29, 31]])
@pytest.mark.parametrize("cells", ["4x6", (4, 6), 6])
def test_cells_of_an_area(area: Any, cells: Any) -> None:
    grid = grid_of(area, 5.0, cells, (2.0, 1.0))
    assert (grid.north, grid.east, grid.shape) == ((-18.0, 22.0), (-29.0, 31.0), (4, 6))
    assert grid.size == (10.0, 10.0)
    np.testing.assert_allclose(grid.centres[[0, 1, 6, 23]], [
        [-13, -24, 5], [-13, -14, 5], [-3, -24, 5], [17, 26, 5],
    ])  # fmt: skip


def test_an_area_may_reach_each_of_its_limits_and_not_beyond() -> None:
    at = {"area": "20000x20000", "depth": 11_000.0, "cells": (200, 200), "middle": (0.0, 0.0)}
    grid = grid_of(**at)
    assert (grid.north, grid.shape, grid.centres[0, 2]) == ((-1e4, 1e4), (200, 200), 11e3)
    for change, words in (
        ({"area": "20002x20000"}, "within 10 km of the platform, got 10.001 km"),
        ({"depth": 11_001.0}, "0 to 11000 m, got 11001"), ({"cells": (200, 201)}, "40,000 in all"),
    ):
        with pytest.raises(ConfigurationError, match=words):
            grid_of(**{**at, **change})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"area": "0x60"}, "map area: must have a size of more than 0 m both ways, got 0 m north"),
        ({"area": "5,-5,0,9"}, "map area: must have a size of more than 0 m both ways"),
        ({"area": "60"}, "map area: must be NORTHxEAST in m, e.g. 60x60, or its bounds"),
        ({"area": "1,2,3,x"}, "map area: must be NORTHxEAST in m"),
        ({"area": "40000x5"}, "map area: must be within 10 km of the platform, got 20 km"),
        ({"depth": -1.0}, "map depth: must be a depth below the surface from 0 to 11000 m, got -1"),
        ({"depth": 12e3}, "map depth: must be a depth below the surface"),
        ({"cells": 1.5}, "map cells: must be a whole number along the longer side"),
        ({"cells": 0}, "map cells: must be at least 2 along the longer side, got 0"),
        ({"cells": "-3"}, "map cells: must be at least 2 along the longer side, got -3"),
        ({"cells": "1x9"}, "map cells: must be at least 2 each way and 40,000 in all, got 1 north"),
        ({"cells": 300}, "map cells: must be at least 2 each way and 40,000 in all"),
        ({"limit_m": 0.0}, "map limit: must be more than 0 m, got 0.0"),
        ({"limit_m": -3}, "map limit: must be more than 0 m, got -3"),
        ({"settling_s": 12.0}, "map settling: must be from 0 s to less than the duration (12 s)"),
        ({"settling_s": -1.0}, "map settling: must be a time from 0 s on, got -1.0"),
        ({"duration_s": "long"}, "map duration: must be a time from 0 s on, got 'long'"),
        ({"duration_s": 0.0}, "map duration: must be more than 0 s"),
        ({"runs": 0}, "map runs: must be a whole number of at least 1, got 0"),
        ({"workers": 0}, "map workers: must be a whole number of at least 1, got 0"),
        ({"error": "absolut_total"}, "map error: must be absolute_horizontal or absolute_total"),
        ({"radius_m": 0.0}, "map radius: must be from 0.01 to 100000 m, got 0.0"),
        ({"speed_m_s": 30.0}, "map speed: must be from 0 to 20 m/s, got 30.0"),
        ({"radius_m": 0.01, "speed_m_s": 20.0}, "map radius: must be large enough for at most"),
        ({"receiver": "cupled"}, "receiver: must be ekf, "),
        (
            {"overrides": {"acoustics.water_depth_m": 12.0}, "depth": 12.5},
            "map depth: must be at most the depth of the water, 12 m (override "
            "acoustics.water_depth_m), got 12.5 m",
        ),
        (
            {"overrides": {"target.trajectory": "white_noise_acceleration"}},
            "map speed: must be given, as the diver of realistic-dive has none that is constant",
        ),
        (
            {"overrides": {"platform.seed": 4}},
            "override platform.seed: must be left out for a map, whose cells do not share",
        ),
        (
            {"overrides": {
                "receiver.initialisation": "prior", "receiver.prior_position_m": [1, 2, 3],
            }},
            "override receiver.prior_position_m: must be left out for a map",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_mapped_is_refused_in_one_line(change: dict[str, Any], words: str) -> None:
    options = {"area": "40x40", "depth": 5.0, "cells": 2, "runs": 2, **SHORT} | change
    area, depth = options.pop("area"), options.pop("depth")
    with pytest.raises(ConfigurationError) as caught:
        sblcosim.map_area("realistic-dive", area, depth, **options)
    assert str(caught.value).startswith(words)
    assert "\n" not in str(caught.value)


def test_a_recorded_track_has_no_speed_and_one_can_be_given(tmp_path: Path) -> None:
    rows = "\n".join(f"{t},{t},{t / 2},5" for t in range(0, 60, 5))
    (tmp_path / "dive.csv").write_text(f"time_s,north_m,east_m,down_m\n{rows}\n")
    (tmp_path / "dive.toml").write_text(
        '[target]\ntrajectory = "file"\ntrack_file = "dive.csv"\n'
    )
    options: dict[str, Any] = {"cells": 2, "runs": 1, **SHORT}
    with pytest.raises(ConfigurationError, match=r"map speed: must be given.*'file'"):
        sblcosim.map_area(tmp_path / "dive.toml", "20x20", 5.0, **options)
    found = sblcosim.map_area(tmp_path / "dive.toml", "20x20", 5.0, speed_m_s=0.4, **options)
    assert found.settings["speed_m_s"] == 0.4


# --- Runs ----------------------------------------------------------------------------------------


def simulator(grid: Grid, seed: int = 1, receiver: Any = None) -> runs.Simulator:
    given = sblcosim.load("realistic-dive", {"seed": seed})
    circle = motion.Circle(3.0, 0.3)
    return runs.Simulator(
        motion.circling(given, circle, 5.0, 12.0), receiver, grid, "absolute_total", 6.0
    )


GRID = Grid((-20.0, 20.0), (-30.0, 30.0), 4, 6, 5.0)


def test_the_map_depends_neither_on_workers_nor_on_when_it_is_made(found: result.AreaMap) -> None:
    again = surveyed(runs=8, limit_m=4.0, workers=1)
    pd.testing.assert_frame_equal(again.cells, found.cells, check_exact=True)
    other = surveyed(runs=8, limit_m=4.0, overrides={"seed": 500})
    assert (other.cells["p95_m"] != found.cells["p95_m"]).all()


def test_no_two_runs_share_their_noise() -> None:
    one = simulator(GRID)
    cell, replicate = np.tile(np.arange(GRID.count), 4), np.repeat(np.arange(4), GRID.count)
    assert len(set(one.seeds(cell, replicate).tolist())) == len(cell)
    assert len(set(one.bearings(cell, replicate).tolist())) == len(cell)
    # Divers at one and the same place, in cells of no size: only noise can tell their runs apart.
    dot = Grid((9.0, 9.0), (2.0, 2.0), 4, 6, 5.0)
    still = simulator(dot)
    still.bearings = lambda cell, replicate: np.zeros(len(cell))  # type: ignore[method-assign]
    sample = still.run(cell, replicate, How(workers=2))
    assert len(np.unique(sample.lengths, axis=0)) == len(cell)
    rows = np.log(sample.lengths[:, 5].reshape(4, -1))
    correlation = np.corrcoef(rows[:, np.isfinite(rows).all(axis=0)])
    assert np.abs(correlation - np.eye(4)).max() < 0.75  # 24 cells: 0.2 is one standard deviation


def test_a_run_is_the_same_whatever_others_there_are() -> None:
    cell, replicate = np.array([3, 17, 3, 20]), np.array([0, 1, 5, 2])
    every = simulator(GRID).run(cell, replicate, How(workers=2))
    alone = simulator(GRID).run(cell[2:3], replicate[2:3], How(workers=1))
    np.testing.assert_array_equal(alone.lengths[0], every.lengths[2])


def test_a_run_of_a_cell_is_that_of_its_scenario() -> None:
    one = simulator(GRID)
    cell, replicate = np.array([13]), np.array([2])
    sample = one.run(cell, replicate, How(workers=1))
    bearing = float(one.bearings(cell, replicate)[0])
    record = sblcosim.run(
        one.base, overrides={
            "seed": int(one.seeds(cell, replicate)[0]), "target.heading_deg": np.rad2deg(bearing),
            "target.center_m": GRID.centres[13, :2].tolist(),
        },
    ).record  # fmt: skip
    path = record.values["target.position"]
    away = path[:, :2] - GRID.centres[13, :2]
    np.testing.assert_allclose(np.hypot(*away.T), 3.0)
    assert (path[:, 2] == 5.0).all()
    np.testing.assert_allclose(np.arctan2(*away[0, ::-1]), bearing, rtol=1e-9)
    steps = np.hypot(*np.diff(path[:, :2], axis=0).T) / np.diff(record.time_ns) * 1e9
    np.testing.assert_allclose(steps, 0.3, rtol=1e-2)
    seen = Run(record, "coupled", 6_000_000_000)
    expected = [value_of(Percentile("absolute_total", p), seen) for p in runs.PERCENTAGES]
    np.testing.assert_array_equal(sample.lengths[0], expected)


def test_the_circle_of_the_bound_is_that_of_the_runs() -> None:
    one = simulator(GRID)
    record = sblcosim.run(one.base).record
    for row in (0, 5, len(record) - 1):
        where = motion.Circle(3.0, 0.3).position(np.array([[0.0, 0, 5]]), record.time_ns[row] / 1e9)
        np.testing.assert_allclose(record.values["target.position"][row], where[0], atol=1e-9)


def test_a_receiver_of_the_user_runs_too_if_there_are_few_runs(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(RECEIVER)
    mine = f"{tmp_path / 'mine.py'}:Mine"
    found = surveyed(receiver=mine, cells=2, runs=2)
    away = np.hypot(found.cells["north_m"], found.cells["east_m"])
    assert found.receiver == "Mine"
    np.testing.assert_allclose(found.cells["p95_m"], away, atol=5.0)  # pooled, and a circle of 3 m
    with pytest.raises(ConfigurationError, match=r"map cells: .* at most 2,000 runs .*Python"):
        surveyed(receiver=mine, cells=40, runs=20)


def test_a_receiver_that_fails_is_told(tmp_path: Path) -> None:
    (tmp_path / "bad.py").write_text(RECEIVER.replace("return", "raise RuntimeError('no') #"))
    with pytest.raises(ConfigurationError, match=r"map: a run must not fail, got in all of them: "):
        surveyed(receiver=f"{tmp_path / 'bad.py'}:Mine", cells=2, runs=1)


def test_failed_runs_are_counted_by_what_is_said_of_them(seam: Seam) -> None:
    original = runs.reduced
    said = ["no", None, "no", "never", None]
    seam.instead(runs.reduced, lambda *given: (*original(*given)[:2], said))
    one = simulator(GRID)
    one.run(np.arange(5), np.zeros(5, int), How(workers=1))
    assert one.failures == {"no": 2, "never": 1}


# --- Pooling -------------------------------------------------------------------------------------

SIZE = len(pooling.PERCENTAGES)


def sample_of(lengths_: Any, cells: int, each: int) -> runs.CellRuns:
    cell = np.repeat(np.arange(cells), each)
    n = len(cell)
    wide = np.broadcast_to(np.asarray(lengths_, float), (n, len(runs.PERCENTAGES)))
    return runs.CellRuns(cell, wide, np.zeros(n, bool), np.ones(n), np.ones(n))


def test_the_percentile_is_that_of_the_weighted_errors_of_the_neighbours() -> None:
    draw = np.random.default_rng(5)
    lengths_ = np.sort(draw.rayleigh(2.0, (35 * 30, SIZE)), axis=1)
    scale = draw.uniform(1.0, 3.0, 35)
    sample = sample_of(lengths_ * np.repeat(scale, 30)[:, None], 35, 30)
    found = pooling.pooled(sample, scale, (5, 7), 1).percentile
    for row, column in ((0, 0), (2, 3), (4, 1)):
        rows, columns = np.divmod(sample.cell, 7)
        i, j = rows - row, columns - column
        weight = np.where((abs(i) <= 2) & (abs(j) <= 2), np.exp(-(i**2 + j**2) / 2), 0.0)
        order = np.argsort(lengths_.ravel())
        below = np.cumsum((weight[:, None] * pooling.WEIGHTS).ravel()[order])
        exact = lengths_.ravel()[order][np.searchsorted(below, 0.95 * below[-1])]
        assert found[row * 7 + column] == pytest.approx(exact * scale[row * 7 + column], rel=0.01)


@pytest.mark.parametrize("least", [-7.0, 0.0, 7.0])
def test_a_percentile_is_finer_than_the_bins_it_is_counted_in(least: float) -> None:
    """Of lengths whose logarithms are even over 70 bins of 0.01, 66 and a half bins from below."""
    lengths_ = np.exp(least + np.linspace(0, 0.7, 20_000)[:, None])
    found = pooling.pooled(sample_of(lengths_, 1, 20_000), np.ones(1), (1, 1), 1, reach=0)
    assert np.log(found.percentile[0]) == pytest.approx(least + 0.95 * 0.7, abs=1e-4)


def test_the_standard_error_is_that_of_new_runs_and_counts_a_run_once() -> None:
    """Twenty experiments with new draws, and runs whose errors are one and the same."""
    draw = np.random.default_rng(6)
    shape, each = (6, 6), 20
    found, said = [], []
    for seed in range(40):
        one = draw.rayleigh(1.0, (36 * each, 1))
        result_ = pooling.pooled(sample_of(one, 36, each), np.ones(36), shape, seed)
        found.append(result_.percentile)
        said.append(result_.std_error)
    true = np.std(found, axis=0, ddof=1).mean()
    assert np.mean(said) == pytest.approx(true, rel=0.12)
    assert np.mean(found) == pytest.approx(np.sqrt(-2 * np.log(0.05)), rel=0.02)
    # Independent errors in a run instead, of different weight: as twelve of them.
    free = draw.rayleigh(1.0, (36 * each, SIZE))
    number = pooling.WEIGHTS.sum() ** 2 / (pooling.WEIGHTS**2).sum()
    less = pooling.pooled(sample_of(free, 36, each), np.ones(36), shape, 1).std_error
    assert less.mean() == pytest.approx(true / np.sqrt(number), rel=0.3)


def test_runs_without_an_estimate_are_no_small_errors() -> None:
    lengths_ = np.ones((40, SIZE))
    lengths_[:2] = np.inf  # half of cell 0: 29, 13 and 3 % of the weight in the first three cells
    found = pooling.pooled(sample_of(lengths_, 10, 4), np.ones(10), (10, 1), 1)
    assert np.isinf(found.percentile[:2]).all()
    np.testing.assert_allclose(found.percentile[2:], 1.0, rtol=0.01)
    assert np.isinf(found.std_error[:2]).all()


def test_where_nothing_is_heard_all_runs_are_lost_and_there_is_no_error() -> None:
    found = surveyed(overrides={"acoustics.loss_probability": 1.0}, limit_m=3.0)
    assert (found.cells["lost_share"] == 1).all()
    assert np.isinf(found.cells["p95_m"]).all()
    assert found.summary()["within_share"] == 0
    assert "lost runs: 100 % of 72; more than 5 % in 24 cells" in str(found)
    assert "more than 5 % without an estimate in 24 cells" in str(found)
    assert len(found.plot().axes) == 3


def test_more_runs_go_to_cells_near_the_requirement_and_nowhere_else(
    found: result.AreaMap,
) -> None:
    cells = found.cells
    more = cells["runs"] > 8
    assert 0 < more.sum() < len(cells)
    assert cells["runs"].min() == 8
    assert 0 < cells["runs"].sum() - 8 * len(cells) <= 8 * len(cells) // 4
    before = surveyed(runs=8).cells
    near = abs(before["p95_m"] - 4.0) <= survey.NEAR * before["std_error_m"]
    assert (near | ~more).all()
    assert found.summary()["extra_runs"] == cells["runs"].sum() - 8 * len(cells)


def test_extra_runs_go_to_the_nearest_first_and_are_bounded() -> None:
    found = pooling.Pooled(np.array([1.0, 3.12, 2.9, 9.0, np.inf, 3.0]), np.full(6, 0.1))
    cell, replicate = survey.second_round(found, 3.0, 20, 2)
    assert (sorted(cell.tolist()), replicate.tolist()) == ([2, 5], [20, 20])
    cell, replicate = survey.second_round(found, 3.0, 2, 100)
    assert np.bincount(cell).tolist() == [0, 6, 6, 0, 0, 6]
    assert set(replicate.tolist()) == {2, 3, 4, 5, 6, 7}


@pytest.mark.slow
@pytest.mark.parametrize("cells", [20, 60])
def test_pooled_percentiles_are_those_of_cells_with_2000_runs(cells: int) -> None:
    """The standard error is right: with 20 runs a cell alone would be off by 14 %."""
    found = sblcosim.map_area("realistic-dive", "60x60", 5.0, cells=cells)
    given = sblcosim.load("realistic-dive", {"seed": 1_000_000})
    moving = motion.circling(given, motion.Circle(3.0, 0.3), 5.0, 60.0)
    one = runs.Simulator(moving, None, found.grid, "absolute_total", 20.0)
    rows = np.linspace(0, found.grid.rows - 1, 4).astype(int)
    some = (rows[:, None] * found.grid.columns + rows).ravel()
    sample = one.run(
        np.repeat(some, 2000), np.tile(np.arange(2000), len(some)), How()
    )
    true = np.array([np.quantile(sample.lengths[sample.cell == k], 0.95) for k in some])
    mapped, std = found.cells.loc[some, ["p95_m", "std_error_m"]].to_numpy().T
    assert np.sqrt(np.mean((mapped / true - 1) ** 2)) < 0.06
    assert np.sqrt(np.mean(((mapped - true) / std) ** 2)) < 1.6


# --- What is possible ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("variances", "expected"),
    [
        ((1, 0, 0), 1.959964), ((1, 1, 0), 2.447747), ((1, 1, 1), 2.795483), ((0, 0, 0), 0.0),
        ((4, 4), 2 * 2.447747), ((9,), 3 * 1.959964),
    ],
)  # fmt: skip
def test_lengths_of_gaussian_errors_whose_percentile_is_known(
    variances: tuple[float, ...], expected: float
) -> None:
    found = lengths.percentile(np.diag(np.array(variances, float))[None, None])
    assert found[0] == pytest.approx(expected, rel=1e-3, abs=1e-12)


def test_lengths_of_errors_along_a_line_are_those_of_the_exact_mixture() -> None:
    """Of deviations that differ by many powers of ten."""
    draw = np.random.default_rng(11)
    for share in (0.9, 0.95, 0.999):
        for epochs in (2, 3, 7):
            stds = draw.lognormal(0.0, 3.0, (epochs, 40))
            found = lengths.percentile(stds[:, :, None, None] ** 2, share)
            for own, length in zip(stds.T, found, strict=True):
                reached = special.erf(length * np.array([[0.998], [1.002]]) / own / np.sqrt(2))
                low, high = reached.mean(axis=1)
                assert low < share < high


def test_lengths_of_any_gaussian_errors_in_any_direction() -> None:
    draw = np.random.default_rng(7)
    sizes = np.array([[1.0, 0.1, 5.0], [3.0, 0.1, 2.0]])
    factors = draw.normal(size=(2, 3, 3, 3)) * sizes[:, :, None, None]
    found = lengths.percentile(factors @ np.swapaxes(factors, 2, 3))
    for i in range(3):
        e = np.concatenate([draw.normal(size=(200_000, 3)) @ factors[k, i].T for k in (0, 1)])
        assert found[i] == pytest.approx(np.quantile(np.linalg.norm(e, axis=1), 0.95), rel=0.01)
    assert np.isnan(lengths.percentile(np.full((1, 1, 2, 2), np.nan))).all()


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("realistic-dive", {}),
        ("realistic-dive", {"acoustics.schedule": "simultaneous"}),
        ("realistic-dive", {"acoustics.packet_content": "own_beacon"}),
        ("paper-scenario-1", {"time.sampling_time_s": 1.0}),
        ("gps-buoys", {}), ("harbour-lbl", {}),
    ],
)  # fmt: skip
def test_the_recursion_side_by_side_is_that_of_a_run(name: str, changes: dict[str, Any]) -> None:
    """Without loss and waves, for divers at rest: then a run's reference needs no chance at all."""
    still = {
        f"platform.{axis}_amplitude_{unit}": 0.0
        for axis, unit in (
            ("surge", "m"), ("sway", "m"), ("heave", "m"), ("roll", "deg"), ("pitch", "deg"),
            ("yaw", "deg"),
        )
    }  # fmt: skip
    keys = {"acoustics.loss_probability": 0.0, "acoustics.motion_during_travel": False}
    moves = name == "realistic-dive"
    given = sblcosim.load(name, changes | keys | (still if moves else {}))
    given = given.override({"platform.beaufort": None}.items()) if moves else given
    moving = motion.circling(given, motion.Circle(3.0, 0.3), 5.0, 30.0)
    q = 0.004
    record = sblcosim.run(moving, overrides={"target.center_m": [12.0, -4.0]}).record
    expected = reference(record, moving, acceleration_psd=q, own_beacon=own_beacon(moving))
    path = partial(motion.Circle(3.0, 0.3).position, np.array([[12.0, -4.0, 5.0]] * 2))
    found = places.covariances(moving, path, np.full(2, q), (20.0, 30.0), 2)
    late = expected.epoch_ns >= 20 * 10**9
    tolerance = 0.03 if name == "paper-scenario-1" else 0.005  # a run's platform has waves there
    for mine, theirs in ((found.absolute, expected.absolute), (found.relative, expected.relative)):
        np.testing.assert_allclose(
            np.trace(mine, axis1=2, axis2=3).mean(0),
            np.trace(theirs[late], axis1=1, axis2=2).mean(), rtol=tolerance,
        )


SEVERAL = np.array([[5.0, 0.0, 4.0], [12.0, 9.0, 4.0], [30.0, 20.0, 6.0], [60.0, -80.0, 8.0]])


def horizontal(found: places.Covariances) -> np.ndarray:
    """RMS of the absolute and of the relative error of each place [m]."""
    both = np.stack([found.absolute, found.relative])[..., :2, :2]
    return np.sqrt(np.trace(both, axis1=3, axis2=4).mean(1))


def in_circles(given: Any, at: np.ndarray, duration_s: float) -> places.Covariances:
    circle = motion.Circle(3.0, 0.3)
    q = circle_psd(0.3, 3.0, places.noise_densities(given, at), duration_s)
    return places.covariances(given, partial(circle.position, at), q, (20.0, duration_s), 1)


@pytest.mark.parametrize(("name", "changes", "duration_s"), [
    ("realistic-dive", {"time.sampling_time_s": 0.05}, 30.0),
    ("paper-scenario-1", {}, 60.0), ("paper-scenario-1", {}, 600.0), ("harbour-lbl", {}, 1200.0),
    ("realistic-dive", {"acoustics.schedule": "simultaneous"}, 1200.0),
    ("realistic-dive", {"acoustics.ranging": "two_way", "time.sampling_time_s": 0.5}, 600.0),
    ("realistic-dive", {"acoustics.ranging": "inverted", "acoustics.range_common_std_m": 0.3,
                        "platform.imu_tilt_std_deg": 2.0}, 1200.0),
    ("realistic-dive", {"acoustics.ranging": "inverted", "acoustics.common_clock": False}, 1200.0),
    ("usbl-boat", {}, 1200.0), ("usbl-boat", {"acoustics.loss_burst_length": 4.0}, 1200.0),
])  # fmt: skip
def test_many_slots_that_count_together_tell_as_much_as_each_alone(
    seam: Seam, name: str, changes: dict[str, Any], duration_s: float
) -> None:
    given = sblcosim.load(name, changes)
    coarse = in_circles(given, SEVERAL, duration_s)
    seam.tuned(most_steps=10**6)
    fine = in_circles(given, SEVERAL, duration_s)
    np.testing.assert_allclose(horizontal(coarse), horizontal(fine), rtol=0.025)


def test_what_is_possible_at_a_place_does_not_depend_on_the_others() -> None:
    """With echoes, whose excess is another one at each place."""
    given = sblcosim.load("harbour-wakes")
    together = in_circles(given, SEVERAL, 60.0)
    for i in range(len(SEVERAL)):
        alone = in_circles(given, SEVERAL[i : i + 1], 60.0)
        np.testing.assert_array_equal(alone.relative[:, 0], together.relative[:, i])


STILL = {
    "platform.beaufort": 0, "platform.watch_circle_m": 0.0, "acoustics.outlier_probability": 0.0,
    "acoustics.loss_probability": 0.5, "platform.surge_amplitude_m": 0.0,
    "platform.sway_amplitude_m": 0.0,
}


@pytest.mark.filterwarnings("ignore::sblcosim.errors.NoEffectWarning")
@pytest.mark.parametrize(("name", "changes", "seeds", "within"), [
    ("usbl-boat", {}, 8, 0.03),
    ("usbl-boat", {"acoustics.loss_burst_length": 5.0}, 30, 0.12),  # a standard error is 5 %
    ("usbl-boat", {"acoustics.arrivals_shared": False}, 8, 0.03),
    ("realistic-dive", {"acoustics.ranging": "inverted", "acoustics.common_clock": False,
                        "receiver.type": "array", "time.sampling_time_s": 0.5}, 8, 0.06),
])  # fmt: skip
def test_pings_that_are_lost_to_some_or_all_hydrophones_cost_what_they_cost_in_runs(
    name: str, changes: dict[str, Any], seeds: int, within: float
) -> None:
    """Half of all arrivals are lost: of an array that shares them, all of a ping."""
    given = sblcosim.load(name, STILL | changes)
    moving = motion.circling(given, motion.Circle(3.0, 0.3), 5.0, 60.0)
    place, q, squares = [12.0, -4.0], 0.004, []
    for seed in range(1, seeds + 1):
        changed = {"target.center_m": place, "seed": seed}
        record = sblcosim.run(moving, "multilateration", changed, master="lanes").record
        of_run = reference(record, moving, acceleration_psd=q)
        late = of_run.epoch_ns >= 20 * 10**9
        squares.append(np.trace(of_run.relative[late], axis1=1, axis2=2))
    path = partial(motion.Circle(3.0, 0.3).position, np.array([[*place, 5.0]]))
    found = places.covariances(moving, path, np.full(1, q), (20.0, 60.0), 1)
    mapped = np.sqrt(np.trace(found.relative, axis1=2, axis2=3).mean())
    assert mapped == pytest.approx(np.sqrt(np.mean(squares)), rel=within)


def test_the_density_of_a_circle_is_that_of_its_path() -> None:
    t = np.arange(0.0, 60.0, 0.01)
    angle = 0.3 * t / 3.0
    velocity = 0.3 * np.column_stack([-np.sin(angle), np.cos(angle), np.zeros(len(t))])
    density = np.array([0.01, 0.3, 5.0])
    expected = [path_psd(t, velocity, d) for d in density.tolist()]
    np.testing.assert_allclose(circle_psd(0.3, 3.0, density, 60.0), expected, rtol=2e-3)
    assert circle_psd(0.0, 3.0, density, 60.0).tolist() == [0.0] * 3
    assert circle_psd(0.3, 3.0, np.array([0.0, np.inf]), 60.0).tolist() == [0.0, 0.0]


def test_dilution_of_precision_is_that_of_numerical_derivatives(found: result.AreaMap) -> None:
    for _, cell in found.cells.iloc[[0, 9, 23]].iterrows():
        at = cell[["north_m", "east_m", "depth_m"]].to_numpy(float)

        def ranges(north: float, east: float, at: Any = at) -> Any:
            return np.linalg.norm([north, east, at[2]] - found.beacons, axis=1)

        h = 1e-4
        H = np.column_stack([
            (ranges(at[0] + h, at[1]) - ranges(at[0] - h, at[1])) / (2 * h),
            (ranges(at[0], at[1] + h) - ranges(at[0], at[1] - h)) / (2 * h),
        ])
        assert cell["hdop"] == pytest.approx(np.sqrt(np.trace(np.linalg.inv(H.T @ H))), rel=1e-6)


@pytest.mark.parametrize("error", LENGTHS)
def test_what_is_possible_is_of_the_error_that_is_asked_for(error: str) -> None:
    moving = motion.circling(
        sblcosim.load("realistic-dive"), motion.Circle(3.0, 0.3), 5.0, 30.0
    )
    best = possible(moving, GRID, motion.Circle(3.0, 0.3), error, (10.0, 30.0))
    path = partial(motion.Circle(3.0, 0.3).position, GRID.centres)
    q = circle_psd(0.3, 3.0, places.noise_densities(moving, GRID.centres), 30.0)
    found = places.covariances(moving, path, q, (10.0, 30.0))
    P = found.absolute if "absolute" in error else found.relative
    draw = np.random.default_rng(8)
    errors = np.concatenate([
        draw.multivariate_normal(np.zeros(3), P[k, 7], 40_000, method="cholesky")
        for k in range(len(P))
    ])
    axes = 2 if "horizontal" in error else 3
    expected = np.quantile(np.linalg.norm(errors[:, :axes], axis=1), 0.95)
    assert best.percentile[7] == pytest.approx(expected, rel=0.01)


def test_where_the_posterior_is_a_ring_there_is_no_accuracy_and_it_is_said() -> None:
    changes = {
        "platform.arm_length_m": 0.4, "acoustics.range_std_m": 1.0, "time.sampling_time_s": 1.0,
    }
    found = sblcosim.map_area(
        "paper-scenario-1", "50x80", 5.0, "coupled", changes, cells="4x4", runs=2, duration_s=40.0
    )
    assert not found.cells["accuracy"].any()
    assert found.cells["possible_p95_m"].isna().all()
    assert "no accuracy is possible in 16 cells" in str(found)
    assert found.to_json()["summary"]["possible_p95_m"] == [None] * 3
    words = [text.get_text() for text in found.plot().figure.legends[0].get_texts()]
    assert "no accuracy is possible" in [" ".join(word.split()) for word in words]


# --- Contours ------------------------------------------------------------------------------------


def area_of(ring: Any) -> float:
    """Of a ring on a map, east to the right and north up; positive if it is anticlockwise."""
    north, east = np.asarray(ring).T
    return float((east[:-1] * north[1:] - east[1:] * north[:-1]).sum() / 2)


def test_water_within_a_limit_has_the_area_and_the_hole_that_it_must() -> None:
    grid = Grid((-50.0, 50.0), (-40.0, 60.0), 200, 200, 5.0)
    away = np.hypot(*grid.centres[:, :2].T)
    # An annulus from 10 m to 30 m about the origin.
    ((outer, hole),) = contours.within(grid, np.abs(away - 20.0), 10.0)
    assert area_of(outer) == pytest.approx(np.pi * 900, rel=1e-3)
    assert area_of(hole) == pytest.approx(-np.pi * 100, rel=1e-3)
    lines = contours.lines(grid, away, 25.0)
    np.testing.assert_allclose(np.hypot(*np.vstack(lines).T), 25.0, rtol=1e-3)
    assert contours.levels(np.array([0.3, 7.0, np.inf, np.nan])) == [0.5, 1.0, 2.0, 5.0]
    assert contours.levels(np.array([np.inf])) == []


def test_contours_on_earth_are_valid_and_where_the_cells_say(
    found: result.AreaMap, tmp_path: Path
) -> None:
    folder = found.save(tmp_path / "map", figures=False)
    text = (folder / "contours.geojson").read_text()
    assert geojson.loads(text).is_valid
    features = json.loads(text)["features"]
    kinds = {(f["properties"]["name"], f["properties"]["kind"]) for f in features}
    assert kinds == {
        (name, kind) for name in ("coupled", "possible") for kind in ("contour", "within")
    }
    (within,) = (
        f for f in features
        if f["properties"] == {"name": "coupled", "kind": "within", "limit_m": 4.0}
    )
    origin = (43.1, 10.2, 40.0)
    north, east = found.grid.axes
    for polygon in within["geometry"]["coordinates"]:
        for number, ring in enumerate(polygon):
            assert ring[0] == ring[-1]
            longitude, latitude, height = np.array(ring).T
            ned = np.stack(pymap3d.geodetic2ned(latitude, longitude, height, *origin), axis=1)
            assert (area_of(ned[:, :2]) > 0) == (number == 0)  # RFC 7946, 3.1.6
            np.testing.assert_allclose(ned[:, 2], 5.0, atol=1e-3)
            # Linear between middles of cells, a ring is at the limit or at the edge of the area.
            ends = np.array([[north[0], east[0]], [north[-1], east[-1]]])
            at_edge = (np.abs(ned[:, None, :2] - ends) < 1e-3).any(axis=(1, 2))
            values = RegularGridInterpolator((north, east), found.of("p95_m"), bounds_error=False,
                                             fill_value=None)(ned[~at_edge, :2])
            np.testing.assert_allclose(values, 4.0, rtol=1e-4)


def test_without_a_place_on_earth_there_are_no_contours_on_it(tmp_path: Path) -> None:
    found = surveyed(runs=1)
    assert found.geojson() is None
    files = {file.name for file in found.save(tmp_path / "map", figures=False).iterdir()}
    assert files == {"cells.csv", "cells.parquet", "manifest.json"}


# --- What people see -----------------------------------------------------------------------------


@pytest.mark.parametrize(("entries", "columns"), [(1, 1), (3, 3), (4, 3), (7, 3), (9, 2)])
def test_a_figure_grows_by_the_height_of_its_legend(entries: int, columns: int) -> None:
    with style.use("light", None):
        figure = style.new_figure(6.4, 4.0)
        figure.add_subplot()
        handles = [Patch(label=f"name {i}") for i in range(entries)]
        figures.legend_above(figure, handles, columns)
        figure.draw_without_rendering()
    tall = figure.legends[0].get_window_extent().height / figure.dpi
    assert figure.get_figheight() - 4.0 == pytest.approx(tall, abs=0.1)


def test_signs_in_the_legend_are_seen_on_dark_paper(found: result.AreaMap) -> None:
    def seen(theme: Any) -> list[int]:
        figure = found.plot(theme).figure
        figure.canvas.draw()
        picture = np.asarray(figure.canvas.buffer_rgba())[::-1, :, :3].astype(int)
        counts = []
        for sign in figure.legends[0].legend_handles:
            box = sign.get_window_extent().padded(4)
            part = picture[int(box.y0) : int(box.y1), int(box.x0) : int(box.x1)]
            counts.append(int((np.abs(part - part[0, 0]).max(axis=2) > 60).sum()))
        return counts

    light, dark = seen("light"), seen("dark")
    assert len(light) > 2
    assert min(light) > 10
    assert all(here >= 0.5 * there for here, there in zip(dark, light, strict=True))


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("narrow", [False, True])
def test_the_figure_has_three_maps_of_one_scale(
    found: result.AreaMap, theme: Any, narrow: bool
) -> None:
    picture = found.plot(theme, narrow=narrow)
    picture.figure.canvas.draw()
    receiver, best, hdop = picture.axes
    assert [ax.get_title("left").splitlines()[0] for ax in picture.axes] == [
        "coupled", "possible", "HDOP",
    ]  # fmt: skip
    told = found.summary()
    shares = [f"{100 * told[name]:.0f} %" for name in ("within_share", "possible_within_share")]
    assert [ax.get_title("left").splitlines()[1:] for ax in picture.axes] == [
        *([f"{share} within 4.0 m"] for share in shares), [],
    ]  # fmt: skip
    legend = picture.figure.legends[0].get_window_extent()
    assert all(not legend.overlaps(ax.get_tightbbox()) for ax in picture.axes)
    meshes = [ax.collections[0] for ax in (receiver, best, hdop)]
    assert meshes[0].norm is meshes[1].norm is not meshes[2].norm
    np.testing.assert_array_equal(np.asarray(meshes[0].get_array()), found.of("p95_m"))
    assert {ax.get_aspect() for ax in picture.axes} == {1.0}
    width, height = picture.figure.get_size_inches()
    assert (width < 6 and height > width) if narrow else width > height
    labels = [" ".join(text.get_text().split()) for text in picture.figure.legends[0].get_texts()]
    expected = ["beacons, to scale", "95 % within 4.0 m", "4.0 m ± 2 standard errors"]
    if (found.cells["lost_share"] > result.MANY_LOST).any():
        expected.append("more than 5 % of the runs lost")
    assert labels == expected
    words = [t for t in picture.figure.findobj(Text) if t.get_text() and t.get_visible()]
    assert min(t.get_fontsize() for t in words) >= 8
    assert any("[m]" in t.get_text() for t in words)


def of_values(
    found: result.AreaMap, p95: Any, possible: Any, std_error: Any, limit: float | None = 4.0
) -> result.AreaMap:
    """A map with other numbers in its cells."""
    cells = found.cells.assign(
        p95_m=p95, possible_p95_m=possible, std_error_m=std_error, lost_share=0.0
    )
    return replace(found, cells=cells, settings={**found.settings, "limit_m": limit})


@pytest.mark.parametrize("narrow", [False, True])
def test_the_figure_says_what_was_mapped_and_has_the_beacons_to_scale(
    found: result.AreaMap, narrow: bool
) -> None:
    picture = found.plot(narrow=narrow)
    assert spoiled_texts(picture.figure) == []
    said = " ".join(picture.figure.get_supxlabel().split())
    runs = f"{int(found.cells['runs'].sum()):,} runs in 24 cells"
    assert said == (
        f"realistic-dive, 5 m deep; 4 beacons; {'; '.join(conditions(found.scenario))}; {runs}."
    )
    ax = picture.axes[0]
    (marks,) = [line for line in ax.lines if line.get_marker() == "^"]
    np.testing.assert_allclose(marks.get_xydata(), found.beacons[:, [1, 0]])
    arms = [np.array(line.get_xydata()) for line in ax.lines if line is not marks]
    np.testing.assert_allclose([arm[1] for arm in arms], found.beacons[:, [1, 0]])
    far = replace(found, grid=Grid((-900.0, 900.0), (-900.0, 900.0), 4, 6, 5.0)).plot().axes[0]
    (mark,) = far.lines
    assert " ".join(mark.get_label().split()) == "4 beacons within 3.0 m"


@pytest.mark.parametrize(
    ("name", "words"), [("paper-scenario-1", "roll, pitch and yaw of ±5°"),
                        ("gps-buoys", "on each buoy"), ("harbour-lbl", "surveyed to 0.3 m")]
)
def test_a_caption_names_the_sensors_and_the_sea_as_a_data_sheet_does(
    found: result.AreaMap, name: str, words: str
) -> None:
    said = figures.caption(replace(found, scenario=load(name)))
    assert words in said
    assert "; ".join(conditions(load(name))) in said
    assert "compass" not in said


def test_the_requirement_is_in_the_key_before_the_band_about_it(found: result.AreaMap) -> None:
    """Also where the receiver's own map has the band alone."""
    count = found.grid.count
    worse = of_values(found, np.linspace(4.2, 8.0, count), np.linspace(3.0, 8.0, count), 0.5)
    legend = worse.plot().figure.legends[0]
    labels = [" ".join(text.get_text().split()) for text in legend.get_texts()]
    assert labels[1:] == ["95 % within 4.0 m", "4.0 m ± 2 standard errors"]


@pytest.mark.parametrize("seed", range(5))
def test_where_the_data_sheet_has_more_than_the_cells_it_is_said_why(
    found: result.AreaMap, seed: int
) -> None:
    """In every output: one line joins the length in the sentence and that of the cells."""
    draw = np.random.default_rng(seed)
    p95, std_error = draw.uniform(2, 90, 24), draw.uniform(0.01, 9, 24)
    enough = replace(found, settings={**found.settings, "runs": 59})
    area = of_values(enough, p95, 3.0, std_error)
    said = re.findall(r"data-sheet sentence has ([\d.]+) m where .* cell is ([\d.]+) m:", str(area))
    sheet = re.findall(r"estimates are within ([\d.]+) m", area.data_sheet)
    cells = re.findall(r"errors within [\d.]+ m to ([\d.]+) m", area.answer)
    assert said == [(*sheet, *cells)]
    assert float(sheet[0]) >= (p95 + 2 * std_error).max() > float(sheet[0]) / 1.1
    assert "adds two standard errors in each cell" in str(area)
    few = replace(area, settings={**found.settings, "runs": 2})
    assert "the data-sheet sentence has" not in few.text(verbose=True)


def test_noise_does_not_look_like_a_structure(found: result.AreaMap) -> None:
    """A field that is flat but for its noise has a small part of the colours; others have all."""
    noise = np.random.default_rng(3).normal(3.0, 0.06, found.grid.count)
    flat = of_values(found, noise, 3.0, 0.06)
    low, high = flat.plot().axes[0].collections[0].get_clim()
    assert (low, high) == flat.colours
    assert low < noise.min() < noise.max() < high
    assert high - low == pytest.approx(20 * 0.06)
    assert noise.std() < 0.06 * (high - low)
    told = "the colours span 2.4 m to 3.6 m, further than the errors do, so that noise"
    assert told in flat.text(verbose=True)
    assert told not in flat.text()
    sure = of_values(found, noise, 3.0, 0.001)  # the same differences, if they are no noise
    assert sure.colours[1] - sure.colours[0] == pytest.approx(0.2 * np.mean(sure.colours), rel=1e-9)
    steep = of_values(found, np.linspace(2.0, 6.0, found.grid.count), 3.0, 0.06)
    assert steep.colours == (2.0, 6.0)
    assert "colours" not in steep.text(verbose=True)
    nothing = of_values(found, np.inf, np.nan, np.inf)
    low, high = nothing.colours
    assert 0 <= low < high < np.inf
    nothing.plot()
    unsure = of_values(found, noise, 3.0, 0.5)
    assert unsure.colours == (0.0, 10.0)
    assert "the colours span 0 m to 10 m, further" in unsure.text(verbose=True)


@pytest.mark.parametrize("case", few(
    product([(100.0, 100.0), (40.0, 240.0), (240.0, 40.0)], [None, 4.0], [0.0, 0.3]),
    quick=[((100.0, 100.0), None, 0.0), ((40.0, 240.0), 4.0, 0.3), ((240.0, 40.0), 4.0, 0.0)],
))  # fmt: skip
def test_no_text_of_the_figures_is_cut_off(
    found: result.AreaMap, case: tuple[tuple[float, float], float | None, float]
) -> None:
    """Maps of equal scale are narrower than their panels, so their labels move."""
    size, limit, lost = case
    north, east = (side / 2 for side in size)
    wide = replace(
        found, grid=Grid((-north, north), (-east, east), 4, 6, 5.0),
        cells=found.cells.assign(lost_share=lost),
        settings={**found.settings, "limit_m": limit},
    )
    for plot in (figures.plot_map, figures.plot_narrow, figures.plot_certainty):
        assert spoiled_texts(plot(wide)[0].figure) == [], plot


def test_lost_runs_and_standard_errors_are_mapped_in_per_cent(found: result.AreaMap) -> None:
    lost = np.arange(found.grid.count) % 5 / 4
    flat = of_values(found, 3.0, 3.0, 0.06)
    errors, losses = figures.plot_certainty(
        replace(flat, cells=flat.cells.assign(lost_share=lost))
    )
    bars = [ax.get_xlabel() for ax in losses.figure.axes if ax.get_label() == "<colorbar>"]
    assert ["[%]" in label for label in bars] == [True, True]
    np.testing.assert_allclose(errors.collections[0].get_array(), 2.0)
    cells = np.ravel(losses.collections[0].get_array())
    assert cells[:6].tolist() == [0, 25, 50, 75, 100, 0]


@pytest.mark.parametrize(("limit", "words"), [(1.0, "no part"), (9.0, "all")])
def test_only_contours_that_are_there_are_in_legend_and_on_earth(
    found: result.AreaMap, limit: float, words: str
) -> None:
    flat = of_values(found, np.linspace(2.0, 6.0, found.grid.count), 3.0, 0.06, limit)
    picture = flat.plot()
    assert [text.get_text() for text in picture.figure.legends[0].get_texts()] == [
        "beacons, to scale"
    ]
    assert picture.axes[0].get_title("left") == f"coupled\n{words} within {limit:.1f} m"
    assert f"within {limit:.1f} m: {words} of the area, possible in {words}" in str(flat)
    features = (flat.geojson() or {})["features"]
    assert all(feature["geometry"] is not None for feature in features)
    kinds = [feature["properties"]["kind"] for feature in features]
    assert kinds.count("within") == (2 if words == "all" else 0)
    half = of_values(found, np.linspace(2.0, 6.0, found.grid.count), 9.0, 0.0, 3.5)
    names = {f["properties"]["name"] for f in (half.geojson() or {})["features"]
             if f["properties"]["kind"] == "within"}  # fmt: skip
    assert names == {"coupled"}


def test_shares_of_an_area_say_whether_there_is_any_and_whether_it_is_all() -> None:
    assert [result.part(share) for share in (0.0, 0.0003, 0.01, 0.5, 0.99, 0.9997, 1.0)] == [
        "no part", "less than 1 %", "1 %", "50 %", "99 %", "more than 99 %", "all",
    ]  # fmt: skip


@pytest.mark.parametrize("shape", [(30.0, 300.0), (300.0, 30.0), (60.0, 60.0)])
@pytest.mark.parametrize("narrow", [False, True])
def test_no_text_of_the_figure_is_cut_off_or_hidden(
    found: result.AreaMap, shape: tuple[float, float], narrow: bool
) -> None:
    north, east = shape
    grid = Grid((0.0, north), (0.0, east), 4, 6, 5.0)
    changed = replace(found, grid=grid, settings={**found.settings, "limit_m": 4.0,
                                                  "error": "absolute_horizontal"})  # fmt: skip
    figure: Any = changed.plot(narrow=narrow).figure
    figure.canvas.draw()
    page = figure.bbox.padded(1.0)
    titles = [ax.title if ax.get_title() else ax._left_title for ax in figure.axes[:3]]
    bars = [ax for ax in figure.axes if ax.get_label() == "<colorbar>"]
    labels = [bar.yaxis.label if narrow else bar.xaxis.label for bar in bars]
    assert [label.get_text().replace("\n", " ") for label in labels] == [
        "95 % of the absolute horizontal errors within [m]", "HDOP [m per m of range error]",
    ]  # fmt: skip
    for text in (*titles, *labels):
        box = text.get_window_extent()
        assert page.x0 <= box.x0 < box.x1 <= page.x1, text
        assert page.y0 <= box.y0 < box.y1 <= page.y1, text
    others = [*(bar.get_window_extent() for bar in bars), figure.legends[0].get_window_extent()]
    for title in titles:
        assert not any(title.get_window_extent().overlaps(other) for other in others), title


def test_the_folder_has_figures_and_cells_and_says_what_was_done(
    found: result.AreaMap, tmp_path: Path
) -> None:
    folder = found.save(tmp_path / "map")
    names = {file.name for file in folder.iterdir()}
    drawn = {f"{name}.{end}" for name in result.FIGURES for end in ("svg", "png")}
    assert names == drawn | {"cells.csv", "cells.parquet", "contours.geojson", "manifest.json"}
    table = pd.read_csv(folder / "cells.csv")
    assert list(table) == [
        "north_m", "east_m", "depth_m", "runs", "p95_m", "std_error_m", "lost_share",
        "availability", "possible_p95_m", "accuracy", "hdop",
    ]
    assert len(table) == 24
    text = str(found)
    assert "circles clockwise about the middle of the cell, radius 3 m, at 0.3 m/s" in text
    assert "errors count from 6 s to 12 s" in text
    assert re.search(r"standard error \d+\.\d % \(median\), \d+\.\d % at most", text)
    assert re.search(r"within 4\.0 m: \d+ % of the area, possible in \d+ %", text)
    assert len(figures.plot_certainty(found)) == 2
    certain = replace(found, cells=found.cells.assign(lost_share=0.0))
    (only,) = figures.plot_certainty(certain)
    assert "standard error" in only.figure.axes[-1].get_xlabel()
    assert "No run was lost." in only.figure.get_supxlabel()
    unknown = replace(certain, cells=certain.cells.assign(std_error_m=np.nan))
    assert [job.name for job in unknown.figures] == ["map", "map_narrow"]


def test_the_command_maps_and_refuses_in_its_own_words(tmp_path: Path) -> None:
    base = ["map", "realistic-dive", "--area", "40x40", "--cells", "2", "--runs", "1",
            "--duration", "8", "--settling", "4", "--out", str(tmp_path / "map")]  # fmt: skip
    done = CliRunner().invoke(sblcosim.cli.app, [*base, "--depth", "5", "--no-figures"])
    assert done.exit_code == 0, done.output
    assert f"written to {tmp_path / 'map'}" in done.stdout
    refused = CliRunner().invoke(sblcosim.cli.app, [*base, "--depth", "-5"])
    assert refused.exit_code == 2
    assert refused.stderr.startswith("error: --depth: must be a depth below the surface")


def test_errors_are_named_as_the_lanes_name_them() -> None:
    options = get_command(sblcosim.cli.app).commands["map"].params  # type: ignore[attr-defined]
    (error,) = (option for option in options if option.name == "error")
    assert sorted(error.metavar.split("|")) == sorted(LENGTHS)
    assert sorted(get_args(MapSettings.model_fields["error"].annotation)) == sorted(LENGTHS)


@pytest.mark.parametrize(
    ("low", "high", "least"), [(2.04, 2.56, 4), (3.0, 5.7, 4), (0.3, 30.0, 4), (0.99, 1.01, 3)]
)
def test_levels_of_contours_are_few_round_and_always_there(
    low: float, high: float, least: int
) -> None:
    found = contours.levels(np.linspace(low, high, 50))
    assert least <= len(found) <= 10
    assert all(low < level < high for level in found)
    assert all(len(f"{level:g}") <= 6 for level in found)
    assert contours.levels(np.full(3, 2.5)) == []


# --- What would not be noticed -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "receiver", "depth"),
    [("harbour-lbl", "long_baseline", 9.0), ("realistic-dive", "coupled", 5.0)],
)
@pytest.mark.parametrize("error", LENGTHS)
def test_errors_of_a_cell_are_those_that_were_asked_for(
    name: str, receiver: str, depth: float, error: str
) -> None:
    grid = Grid((-20.0, 20.0), (-30.0, 30.0), 2, 3, depth)
    base = motion.circling(sblcosim.load(name), motion.Circle(3.0, 0.3), depth, 20.0)
    one = runs.Simulator(base, None, grid, error, 8.0)
    assert one.receiver == receiver
    cell, replicate = np.array([4]), np.array([1])
    sample = one.run(cell, replicate, How(workers=1))
    record = sblcosim.run(base, overrides={
        "seed": int(one.seeds(cell, replicate)[0]),
        "target.heading_deg": float(np.rad2deg(one.bearings(cell, replicate)[0])),
        "target.center_m": grid.centres[4, :2].tolist(),
    }).record  # fmt: skip
    seen = Run(record, receiver, 8_000_000_000)
    expected = [value_of(Percentile(error, p), seen) for p in runs.PERCENTAGES]
    np.testing.assert_array_equal(sample.lengths[0], expected)


@pytest.mark.parametrize("error", ["absolute_total", "absolute_horizontal", "relative_horizontal"])
def test_a_map_of_beacons_on_the_bottom_is_of_their_model(error: str) -> None:
    """Errors over many runs are near what is possible, cell by cell, as far as q allows."""
    options: dict[str, Any] = {"cells": 2, "runs": 60, "radius_m": 10.0, "speed_m_s": 0.3}
    found = sblcosim.map_area("harbour-lbl", "40x40", 9.0, error=error, **options).cells
    other = sblcosim.map_area("harbour-lbl", "40x40", 9.0, **options | {"runs": 1}).cells
    assert found["accuracy"].all()
    ratio = found["p95_m"] / found["possible_p95_m"]
    assert ratio.between(0.8, 1.5).all(), ratio
    larger = other["possible_p95_m"].to_numpy() - found["possible_p95_m"].to_numpy()
    assert (larger > 0).all() if error != "absolute_total" else (larger == 0).all()


def test_the_standard_error_is_in_the_unit_of_its_cell() -> None:
    """Errors that are multiples of what is possible: percentile and standard error are, too."""
    draw = np.random.default_rng(8)
    multiples = np.sort(draw.rayleigh(1.0, (24 * 20, SIZE)), axis=1)
    scale = draw.uniform(0.2, 5.0, 24)
    one = pooling.pooled(sample_of(multiples, 24, 20), np.ones(24), (4, 6), 3)
    scaled = sample_of(multiples * np.repeat(scale, 20)[:, None], 24, 20)
    found = pooling.pooled(scaled, scale, (4, 6), 3)
    np.testing.assert_allclose(found.percentile, one.percentile * scale, rtol=0.005)
    np.testing.assert_allclose(found.std_error, one.std_error * scale, rtol=0.02)
    # Where nothing is possible, errors are pooled as they are.
    unknown = np.where(np.arange(24) == 7, np.nan, 1.0)
    same = pooling.pooled(sample_of(multiples, 24, 20), unknown, (4, 6), 3)
    np.testing.assert_array_equal(same.std_error, one.std_error)


def test_the_standard_error_is_that_of_the_same_draws_counted_one_by_one() -> None:
    """Also where a draw's percentile lies far out: such draws count as `_AROUND` away."""
    draw = np.random.default_rng(9)
    lengths_ = np.sort(draw.rayleigh(1.0, (2, 60, SIZE)), axis=2)
    lengths_[0, :2] = 40.0  # 3 % of the errors, and more than 5 % in some of the draws
    lengths_[1, :1] = 1e-9
    sample = sample_of(lengths_.reshape(120, SIZE), 2, 60)
    found = pooling.pooled(sample, np.ones(2), (1, 2), 4, reach=0)

    def percentile(cell: int, times: Any) -> float:
        order = np.argsort(lengths_[cell], axis=None)
        below = np.cumsum((np.asarray(times)[:, None] * pooling.WEIGHTS).ravel()[order])
        return float(lengths_[cell].ravel()[order][np.searchsorted(below, 0.95 * below[-1])])

    middle = [percentile(cell, np.ones(60)) for cell in range(2)]
    np.testing.assert_allclose(found.percentile, middle, rtol=0.01)
    farthest = np.e * max(middle)
    drawn = []
    for number in range(pooling.DRAWS):
        draws = np.random.Generator(np.random.Philox(key=[4, number])).poisson(1.0, 120)
        each = [percentile(cell, draws.reshape(2, 60)[cell]) for cell in range(2)]
        drawn.append(np.minimum(each, farthest))
    assert 3 < sum(it[0] == farthest for it in drawn) < 30
    np.testing.assert_allclose(found.std_error, np.std(drawn, axis=0, ddof=1), rtol=0.04)


def test_cells_with_more_runs_than_others_count_each_run_once() -> None:
    cell = np.array([0, 1, 2, 3, 1, 1, 1, 3])
    lost = np.array([0, 1, 0, 1, 0, 0, 1, 0], bool)
    available = np.array([1.0, 0.2, 0.9, 0.6, 0.4, 0.6, 0.8, 0.0])
    sample = runs.CellRuns(cell, np.ones((8, SIZE)), lost, available, np.ones(8))
    with Seam() as seam:
        seam.instead(runs.Simulator.run, lambda *_: sample)
        given = surveyed(cells=2, runs=1)
    cells = given.cells
    assert cells["runs"].tolist() == [1, 4, 1, 2]
    assert cells["lost_share"].tolist() == [0.0, 0.5, 0.0, 0.5]
    np.testing.assert_allclose(cells["availability"], [1.0, 0.5, 0.9, 0.3])
    # Over the area, each run counts once, not each cell.
    summary = given.summary()
    assert (summary["runs"], summary["extra_runs"]) == (8, 4)
    assert summary["lost_share"] == 3 / 8
    # A cell with more runs weighs more among its neighbours, run by run.
    large = np.where((cell == 1)[:, None], 3.0, 1.0) * np.ones((8, SIZE))
    many = runs.CellRuns(cell, large, lost, available, available)
    found = pooling.pooled(many, np.ones(4), (2, 2), 1)
    weights = {0: np.exp(-0.5), 1: 1.0, 2: np.exp(-1.0), 3: np.exp(-0.5)}
    share = 4 * weights[1] / sum(weights[c] for c in cell.tolist())
    assert share > 0.05
    np.testing.assert_allclose(found.percentile[1], 3.0, rtol=0.01)
    one = runs.CellRuns(np.arange(4), large[[0, 2, 3, 5]][[0, 1, 2, 2]], *[available[:4]] * 3)
    few = pooling.pooled(one, np.ones(4), (2, 2), 1)
    np.testing.assert_allclose(few.percentile, 1.0, rtol=0.01)


def test_the_requirement_has_a_contour_of_its_own_on_earth(found: result.AreaMap) -> None:
    """Also where it is none of the round levels, and of what is possible as well."""
    middle = {name: float(np.median(found.of(f"{column}p95_m")))
              for name, column in (("coupled", ""), ("possible", "possible_"))}  # fmt: skip
    for name, column in (("coupled", "p95_m"), ("possible", "possible_p95_m")):
        limit = middle[name] + 0.0123
        asked = replace(found, settings=found.settings | {"limit_m": limit})
        document = asked.geojson()
        assert document is not None
        mine = [f for f in document["features"] if f["properties"]["name"] == name]
        levels = [f["properties"]["p95_m"] for f in mine if f["properties"]["kind"] == "contour"]
        assert limit not in contours.levels(found.of(column))
        assert limit in levels
        assert levels == sorted(set(levels))
        (own,) = (f for f in mine if f["properties"].get("p95_m") == limit)
        at = RegularGridInterpolator(found.grid.axes, found.of(column), bounds_error=False,
                                     fill_value=None)  # fmt: skip
        for line in own["geometry"]["coordinates"]:
            longitude, latitude, height = np.array(line).T
            ned = np.stack(pymap3d.geodetic2ned(latitude, longitude, height, 43.1, 10.2, 40.0), 1)
            np.testing.assert_allclose(at(ned[:, :2]), limit, rtol=1e-4)
        without = replace(found, settings=found.settings | {"limit_m": None}).geojson()
        assert without is not None
        assert all(f["properties"].get("p95_m") != limit for f in without["features"])
        assert {f["properties"]["kind"] for f in without["features"]} == {"contour"}


# --- A circle that a receiver does not allow for --------------------------------------------------


@pytest.mark.parametrize("like", ["lbl", "buoys"])
def test_a_circle_that_is_too_fast_for_the_receiver_is_said_to_be_so(like: str) -> None:
    source = LIKES[like].source
    steady = {"receiver.acceleration_psd_m2_s3": 0.003}
    options: dict[str, Any] = {"cells": 2, "runs": 1, "overrides": steady, **SHORT}
    found = sblcosim.map_area(source, "40x40", 8.0, **options)
    assert found.doubt.startswith("the circle turns faster than long_baseline allows for, ")
    assert found.doubt in str(found)
    assert found.to_json()["doubt"] == found.doubt
    change, time_s, q, expected, radius = (
        float(n) for n in re.findall(r"(?<!_)\b\d[\d.]*(?= (?:m/s|s,|m²/s³|m is))", found.doubt)
    )
    # By the motion itself, and by the definition of white acceleration.
    speed = found.settings["speed_m_s"]
    circle = motion.Circle(3.0, speed)
    ends = [circle.position(np.zeros(3), t + d) for t in (0.0, time_s) for d in (-1e-4, 1e-4)]
    velocity = [(ends[i + 1] - ends[i]) / 2e-4 for i in (0, 2)]
    assert np.linalg.norm(velocity[1] - velocity[0]) == pytest.approx(change, rel=0.04)
    assert expected == pytest.approx(np.sqrt(2 * q * time_s), rel=0.03)
    assert q == 0.003
    wider = sblcosim.map_area(source, "40x40", 8.0, radius_m=radius, **options)
    assert not wider.doubt
    assert sblcosim.map_area(source, "40x40", 8.0, radius_m=0.9 * radius, **options).doubt
    assert "turns faster" not in str(wider)
    learning = {"cells": 2, "runs": 1, **SHORT}
    assert not sblcosim.map_area(source, "40x40", 8.0, **learning).doubt


def test_a_receiver_that_learns_allows_for_every_circle() -> None:
    fast = motion.Circle(0.5, 1.0)
    cannot = {"ekf", "sequential"}
    for q, told in (("learned", cannot), (0.001, {*WITH_Q})):
        scenario = sblcosim.load("realistic-dive", {"receiver.acceleration_psd_m2_s3": q})
        found = {name: survey.doubt_of(fast, scenario, name, name) for name in RECEIVERS}
        assert {name for name, doubt in found.items() if doubt} == told
        ways = {name for name, doubt in found.items() if "learned" in doubt}
        assert ways == told - cannot
    assert "q = 0.01 m²/s³" in survey.doubt_of(fast, learned(), "ekf", "ekf")
    assert not survey.doubt_of(fast, learned(), "coupled", None)
    own = sblcosim.load({"receiver": {"fmu": "mine.fmu"}})
    assert "q = 0.01 m²/s³" in survey.doubt_of(fast, own, "ekf", "ekf")


WITH_Q = [name for name, it in RECEIVERS.items() if "acceleration_psd" in {v.name for v in it}]


def learned() -> Scenario:
    return sblcosim.load("realistic-dive", {"receiver.acceleration_psd_m2_s3": "learned"})


def test_a_circle_is_judged_by_what_the_receiver_assumes() -> None:
    slow, fast = motion.Circle(3.0, 0.2), motion.Circle(3.0, 1.0)
    assert not slow.doubt("a", 0.003)
    assert fast.doubt("a", 0.003)
    assert not fast.doubt("a", 1.0)
    assert "radius" not in slow.doubt("a", 0.0)
    assert not motion.Circle(3.0, 0.0).doubt("a", 0.0)
    # No other time asks more of it: the ratio of the velocity's changes is the largest.
    change, time_s = (
        float(n) for n in re.findall(r"by (\S+) m/s in (\S+) s", fast.doubt("a", 0.003))[0]
    )
    times = np.linspace(0.1, 19.0, 2000)
    ratios = 2.0 * np.abs(np.sin(times / 6)) / np.sqrt(2 * 0.003 * times)
    assert times[ratios.argmax()] == pytest.approx(time_s, rel=0.05)
    assert change / np.sqrt(2 * 0.003 * time_s) == pytest.approx(ratios.max(), rel=0.05)
    options: dict[str, Any] = {"cells": 2, "runs": 1, **SHORT}
    foreign = sblcosim.map_area("gps-buoys", "40x40", 8.0, "multilateration", **options)
    assert not foreign.doubt


# --- The caption ----------------------------------------------------------------------------------


@pytest.mark.parametrize("changes", [
    {"platform.imu_heading_turn_on_std_deg": 2.0},
    {"platform.imu_heading_bias_deg": 0.0, "platform.imu_heading_std_deg": 0.0},
    {"platform.beaufort": None, "platform.roll_amplitude_deg": 9.0},
    {"platform.beaufort": 4, "platform.gps_grade": "rtk_fixed"},
    {"platform.mounting_std_m": 0.01},
], ids=str)  # fmt: skip
def test_the_caption_has_the_conditions_of_the_data_sheet(
    found: result.AreaMap, changes: dict[str, Any]
) -> None:
    it = replace(found, scenario=found.scenario.override(changes.items()))
    words = figures.caption(it)
    assert all(part in words for part in conditions(it.scenario))
    for wrong in ("exact compass", "still water"):
        assert wrong not in words
