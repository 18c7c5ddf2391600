"""Cells, distances and circles of maps by themselves: places, bounds, sentences, second rounds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sblcosim
from sblcosim.areas.grid import grid_of
from sblcosim.areas.motion import Circle, check_depth, circle_of, circling
from sblcosim.areas.possible import caveat
from sblcosim.areas.rings import Rings, rings_of
from sblcosim.areas.runs import CellRuns, check_times
from sblcosim.areas.survey import second_round
from sblcosim.errors import ConfigurationError
from sblcosim.judge.pooling import Pooled


def refused(call: Any, *given: Any) -> str:
    with pytest.raises(ConfigurationError) as caught:
        call(*given)
    return str(caught.value)


# --- Cells of an area ----------------------------------------------------------------------------


def test_cells_stand_in_rows_from_the_south_and_west() -> None:
    grid = grid_of("-10,50,20,60", 7.0, (3, 2), (100.0, 200.0))
    assert (grid.north, grid.east) == ((-10.0, 50.0), (20.0, 60.0))
    assert (grid.rows, grid.columns, grid.count, grid.shape) == (3, 2, 6, (3, 2))
    assert grid.size == (20.0, 20.0)
    assert [axis.tolist() for axis in grid.axes] == [[0, 20, 40], [30, 50]]
    assert grid.centres.tolist() == [
        [0, 30, 7], [0, 50, 7], [20, 30, 7], [20, 50, 7], [40, 30, 7], [40, 50, 7],
    ]
    cell = np.array([4, 1, 4])
    placed = grid.placed(cell, np.array([0, 0, 1]), 3)
    assert {name: it.tolist() for name, it in placed.items()} == {
        "target.center": [[40, 30], [0, 50], [40, 30]]
    }
    assert grid.identity == ((-10.0, 50.0), (20.0, 60.0), (3, 2), 7.0)


@pytest.mark.parametrize(("area", "cells", "counts", "size"), [
    ("60x20", 30, (30, 10), (2.0, 2.0)),
    ("20×60", "30", (10, 30), (2.0, 2.0)),
    ((60, 10), 12, (12, 2), (5.0, 5.0)),
    ((61.0, 1.0), 3, (3, 2), (61 / 3, 0.5)),  # two at least
    ("60x23", "4x5", (4, 5), (15.0, 4.6)),
    ((0, 30, -5, 25), (6, 3), (6, 3), (5.0, 10.0)),
])  # fmt: skip
def test_cells_are_as_square_as_whole_numbers_allow(
    area: Any, cells: Any, counts: tuple[int, int], size: tuple[float, float]
) -> None:
    grid = grid_of(area, 5, cells, (2.0, -3.0))
    assert grid.shape == counts
    assert grid.size == pytest.approx(size)
    if not isinstance(area, tuple) or len(area) == 2:
        assert np.mean(grid.north) == pytest.approx(2.0)
        assert np.mean(grid.east) == pytest.approx(-3.0)


def test_areas_depths_and_cells_have_bounds() -> None:
    middle = (500.0, -40.0)
    far = grid_of("20000x10", 11_000.0, (200, 200), middle)
    assert far.north == (-9500.0, 10500.0)
    assert (far.count, far.depth) == (40_000, 11_000.0)
    assert grid_of("10x20000", 0.0, (2, 2), middle).east == (-10_040.0, 9_960.0)
    assert refused(grid_of, "10x20010", 5.0, 4, middle) == (
        "map area: must be within 10 km of the platform, got 10.005 km"
    )
    assert refused(grid_of, (490.0, 510.0, -45.0, 9961.0), 5.0, 4, middle) == (
        "map area: must be within 10 km of the platform, got 10.001 km"
    )
    assert refused(grid_of, "10x10", 11_001.0, 4, middle) == (
        "map depth: must be a depth below the surface from 0 to 11000 m, got 11001.0"
    )
    assert refused(grid_of, "10x10", 5.0, (200, 201), middle) == (
        "map cells: must be at least 2 each way and 40,000 in all, got 200 north x 201 east"
    )
    for counts in ((1, 5), (5, 1)):
        assert refused(grid_of, "10x10", 5.0, counts, middle).endswith(
            f"got {counts[0]} north x {counts[1]} east"
        )
    assert grid_of("10x10", 5.0, 2, middle).shape == (2, 2)
    assert refused(grid_of, "10x10", 5.0, 1, middle) == (
        "map cells: must be at least 2 along the longer side, got 1"
    )
    for given in ("3xa", 2.5, (2, 3, 4), (2.5, 3), (True, 3), "nan"):
        assert refused(grid_of, "10x10", 5.0, given, middle).startswith(
            "map cells: must be a whole number along the longer side, or NORTHxEAST, e.g. 40x60, "
            "got "
        )
    assert refused(grid_of, (5.0, 5.0, 1.0, 3.0), 5.0, 4, middle) == (
        "map area: must have a size of more than 0 m both ways, got 0 m north x 2 m east"
    )
    assert refused(grid_of, (3.0, 5.0, 3.0, 1.0), 5.0, 4, middle).endswith("2 m north x -2 m east")


# --- Distances -----------------------------------------------------------------------------------


def test_distances_stand_in_rows_of_one_depth_and_turn_from_run_to_run() -> None:
    rings = rings_of("5,65", [9.0, 4.0, 9.0], 3, (3.0, -2.0))
    assert (rings.distances, rings.depths) == ((5.0, 35.0, 65.0), (4.0, 9.0))
    assert (rings.count, rings.shape, rings.middle) == (6, (2, 3), (3.0, -2.0))
    assert rings.identity == ((3.0, -2.0), (5.0, 35.0, 65.0), (4.0, 9.0))
    depth, distance = rings.of_cells
    assert depth.tolist() == [4, 4, 4, 9, 9, 9]
    assert distance.tolist() == [5, 35, 65, 5, 35, 65]
    centres = rings.centres.reshape(16, 6, 3)
    for turn, angle in enumerate(np.radians(22.5) * np.arange(16)):
        np.testing.assert_allclose(centres[turn, 5], [
            3 + 65 * np.cos(angle), -2 + 65 * np.sin(angle), 9,
        ], atol=1e-9)
    cell, replicate = np.array([1, 1, 1, 5]), np.array([0, 1, 7, 7])
    placed = rings.placed(cell, replicate, 11)
    offset = (placed["target.center"] - [3.0, -2.0]) @ [1, 1j]
    np.testing.assert_allclose(abs(offset), [35, 35, 35, 65])
    assert placed["target.depth_start"].tolist() == [4, 4, 4, 9]
    assert placed["target.depth_end"].tolist() == [4, 4, 4, 9]
    golden = np.pi * (np.sqrt(5) - 1)  # of a turn
    np.testing.assert_allclose(offset[1:3] / offset[0], np.exp(1j * golden * np.array([1, 7])))
    assert abs(offset[3] / 65 - offset[2] / 35) > 1e-3
    other = rings.placed(cell, replicate, 12)["target.center"]
    assert np.abs(other - placed["target.center"]).min() > 1e-6


def test_distances_and_depths_have_bounds() -> None:
    most = rings_of(10_000.0, list(np.linspace(0, 11_000, 20)), 1000, (0.0, 0.0))
    assert (most.distances[-1], len(most.distances), len(most.depths)) == (10_000.0, 1000, 20)
    assert most.distances[0] == 0.0
    assert rings_of((0.0, 5.0), 5.0, "2", (0.0, 0.0)).distances == (0.0, 5.0)
    for cells in (1, 1001, 2.5, "many"):
        assert refused(rings_of, 60, 5.0, cells, (0.0, 0.0)) == (
            f"map cells: must be a whole number of distances from 2 to 1,000, got {cells!r}"
        )
    assert refused(rings_of, 60, list(range(21)), 4, (0.0, 0.0)) == (
        "map depth: must be from 1 to 20 depths, got 21"
    )
    assert refused(rings_of, 60, [5.0, 11_001.0], 4, (0.0, 0.0)) == (
        "map depth: must be a depth below the surface from 0 to 11000 m, got 11001.0"
    )
    for given, words in (("5,5", "5 m to 5 m"), ("-1,5", "-1 m to 5 m"), ("9,4", "9 m to 4 m"),
                         (10_001, "0 m to 10001 m")):
        assert refused(rings_of, given, 5.0, 4, (0.0, 0.0)) == (
            "map distance: must be from 0 m or more to a larger distance of at most 10 km, got "
            + words
        )
    assert refused(rings_of, (1.0, "a"), 5.0, 4, (0.0, 0.0)).startswith(
        "map distance: must be how far from the platform in m, e.g. 60, or from and to, e.g. 5,60"
    )
    assert Rings((0.0, 0.0), (1.0, 2.0), (3.0,)).count == 2


# --- Circles -------------------------------------------------------------------------------------


def test_a_diver_circles_clockwise_from_the_north() -> None:
    circle = Circle(4.0, 0.5)
    found = circle.position(np.array([[10.0, 20.0, 6.0], [0.0, 1.0, 2.0]]), 6.0)
    north, east = 4 * np.cos(0.75), 4 * np.sin(0.75)
    np.testing.assert_allclose(found, [[10 + north, 20 + east, 6], [north, 1 + east, 2]])
    assert str(circle) == (
        "circles clockwise about the middle of the cell, radius 4 m, at 0.5 m/s, each time from "
        "another bearing"
    )


def test_a_circle_that_is_too_fast_is_told_with_one_that_is_slow_enough() -> None:
    """sin²(x)/x is largest at x = 1.1656, where tan x = 2 x: a change of 2 v sin x."""
    x = 1.1655611852
    assert np.tan(x) == pytest.approx(2 * x, rel=1e-8)
    assert Circle(0.5, 1.0).doubt("ekf", 0.003) == (
        "the circle turns faster than ekf allows for, which makes its errors larger: the velocity "
        "changes by 1.8 m/s in 1.2 s, where q = 0.003 m²/s³ expects 0.084 m/s; a radius of 61 m is "
        "slow enough"
    )
    for v, q in ((1.0, 0.003), (0.3, 0.02), (0.7, 0.01)):
        limit = v**3 * np.sin(x) ** 2 / (4 * q * x)
        assert Circle(1.001 * limit, v).doubt("ekf", q) == ""
        said = Circle(0.999 * limit, v).doubt("ekf", q)
        enough = float(said.partition("a radius of ")[2].partition(" m")[0])
        assert limit <= enough <= 1.1 * limit
        assert enough == float(f"{enough:.2g}")  # two digits
    assert Circle(0.5, 0.0).doubt("ekf", 0.0) == ""
    assert Circle(0.5, 0.2).doubt("ekf", 0.0) == (
        "the circle turns faster than ekf allows for, which makes its errors larger: the velocity "
        "changes by 0.37 m/s in 5.8 s, where q = 0 m²/s³ expects 0 m/s"
    )


def test_a_circle_has_the_speed_of_the_scenario_or_another_within_bounds() -> None:
    given = sblcosim.load("realistic-dive", {"target.speed_m_s": 0.45})
    assert circle_of(given, 4, None, 60.0) == Circle(4.0, 0.45)
    assert circle_of(given, 4, 0.7, 60.0) == Circle(4.0, 0.7)
    assert circle_of(given, 0.01, 0.0, 60.0) == Circle(0.01, 0.0)
    assert circle_of(given, 100_000.0, 20.0, 60.0) == Circle(100_000.0, 20.0)
    for radius in (0.009, 100_001, np.inf, "wide"):
        assert refused(circle_of, given, radius, None, 60.0) == (
            f"map radius: must be from 0.01 to 100000 m, got {radius!r}"
        )
    for speed in (-0.1, 20.5, np.nan):
        assert refused(circle_of, given, 3.0, speed, 60.0) == (
            f"map speed: must be from 0 to 20 m/s, got {speed!r}"
        )
    assert circle_of(given, 0.5, 1.0, 3141.5) == Circle(0.5, 1.0)  # a thousand turns
    assert refused(circle_of, given, 0.5, 1.0, 3141.7) == (
        "map radius: must be large enough for at most 1000 turns in 3141.7 s at 1 m/s, got 0.5 m"
    )
    drifting = sblcosim.load(
        given.given() | {"target": {"trajectory": "white_noise_acceleration"}}
    )
    assert circle_of(drifting, 3.0, 0.2, 60.0) == Circle(3.0, 0.2)
    assert refused(circle_of, drifting, 3.0, None, 60.0) == (
        "map speed: must be given, as the diver of realistic-dive has none that is constant "
        "(trajectory 'white_noise_acceleration'), and circles in each cell instead"
    )


def test_a_diver_of_a_map_is_above_the_bottom() -> None:
    given = sblcosim.load("realistic-dive", {"acoustics.water_depth_m": 12.0})
    check_depth(given, 12.0)
    check_depth(sblcosim.load("realistic-dive"), 900.0)  # no depth of the water
    assert refused(check_depth, given, 12.1) == (
        "map depth: must be at most the depth of the water, 12 m (override "
        "acoustics.water_depth_m), got 12.1 m"
    )


def test_a_circling_diver_keeps_its_sensor_and_nothing_of_its_path() -> None:
    given = sblcosim.load("realistic-dive", {"target.depth_std_m": 0.07})
    target = circling(given, Circle(4.0, 0.5), 6.0, 90.0).given()
    assert target["time"]["duration_s"] == 90.0
    turns = 0.5 * 90 / (2 * np.pi * 4)
    assert target["target"].pop("turns") == pytest.approx(1.01 * turns + 0.01, rel=1e-12)
    assert target["target"] == {
        "trajectory": "circle", "center_m": (0.0, 0.0), "radius_m": 4.0, "speed_m_s": 0.5,
        "depth_start_m": 6.0, "depth_end_m": 6.0, "depth_std_m": 0.07, "depth_bias_m": 0.05,
    }
    assert circling(given, Circle(0.5, 1.0), 6.0, 3141.0).target.turns == 1000.0
    assert refused(circling, sblcosim.load("realistic-dive", {"platform.boat_speed_m_s": 1.5}),
                   Circle(4.0, 0.5), 6.0, 90.0) == (
        "override platform.boat_speed_m_s: must be 0 for a map, as a boat under way leaves every "
        "cell, got 1.5 m/s"
    )
    track = {"platform.track_m": [0, 0, 5, 5], "platform.track_time_s": [0, 10]}
    assert refused(circling, sblcosim.load("realistic-dive", track), Circle(4.0, 0.5), 6.0,
                   90.0) == (
        "override platform.track_m: must be left out for a map, as a boat under way leaves every "
        "cell, got 2 points"
    )
    prior = {"receiver.prior_position_m": [1.0, 2.0, 3.0]}
    assert refused(circling, sblcosim.load("realistic-dive", prior), Circle(4.0, 0.5), 6.0,
                   90.0) == (
        "override receiver.prior_position_m: must be left out for a map, or be that of each cell "
        "(prior = 'true'), got one for all"
    )


# --- Runs ----------------------------------------------------------------------------------------


def test_a_second_round_is_for_cells_within_two_standard_errors_of_the_limit() -> None:
    """A cell has at most three times its own runs in it; the closest come first."""
    percentile = np.array([5.0, 3.0, 4.1, 1.9, 3.0, np.nan, 2.0])
    error = np.array([1.0, np.nan, 0.5, 0.5, 0.4, 0.1, 0.5])
    found = Pooled(percentile, error)
    cell, replicate = second_round(found, 3.0, 10, 9)
    # (5 − 3)/1 and (3 − 2)/0.5 are 2 standard errors, (4.1 − 3)/0.5 is 2.2
    assert cell.tolist() == [0, 4, 6] * 3
    assert replicate.tolist() == [10] * 3 + [11] * 3 + [12] * 3
    cell, replicate = second_round(found, 3.0, 10, 2)
    assert (cell.tolist(), replicate.tolist()) == ([0, 4], [10, 10])
    cell, replicate = second_round(found, 3.0, 10, 1)
    assert (cell.tolist(), replicate.tolist()) == ([4], [10])
    cell, replicate = second_round(found, 3.0, 2, 100)
    assert cell.tolist() == [0, 4, 6] * 6
    assert replicate.tolist() == np.repeat(np.arange(2, 8), 3).tolist()
    for limit, most in ((3.0, 0), (9.0, 100)):
        cell, replicate = second_round(found, limit, 10, most)
        assert (cell.tolist(), replicate.tolist()) == ([], [])
    # A cell whose error is known exactly is far from any limit but its own; nothing is said of it.
    sure = Pooled(np.array([5.0, 3.1]), np.array([0.0, 0.1]))
    with np.errstate(all="raise"):
        assert second_round(sure, 3.0, 10, 1)[0].tolist() == [1]


def test_runs_are_joined_in_their_order() -> None:
    def some(first: int, count: int) -> CellRuns:
        at = np.arange(first, first + count)
        return CellRuns(at, 0.5 * at[:, None] * [1, 2], at % 2 == 0, at / 10, at * 3.0)

    both, all_ = some(0, 2) + some(2, 3), some(0, 5)
    for name in ("cell", "lengths", "lost", "availability", "rms"):
        np.testing.assert_array_equal(getattr(both, name), getattr(all_, name))


def test_errors_count_before_a_run_ends() -> None:
    check_times(30.0, 0.0)
    check_times(30, 29.9)
    assert refused(check_times, 30.0, 30.0) == (
        "map settling: must be from 0 s to less than the duration (30 s), got 30.0"
    )
    assert refused(check_times, 30.0, 30.0 - 1e-12).startswith("map settling: must be from 0 s")
    assert refused(check_times, 0, 0.0) == "map duration: must be more than 0 s, got 0"
    assert refused(check_times, -1.0, 0.0) == (
        "map duration: must be a time from 0 s on, got -1.0"
    )
    assert refused(check_times, np.inf, 0.0) == (
        "map duration: must be a time from 0 s on, got inf"
    )
    assert refused(check_times, 30.0, -2) == "map settling: must be a time from 0 s on, got -2"


def test_what_is_left_out_is_told_with_its_smallest_and_largest_size() -> None:
    assert caveat({}) == ""
    names = {"mounting errors": [0.5, np.nan, 0.5], "clocks": [0.75, np.inf, 0.5, 1.25]}
    said = caveat({name: np.array(it) for name, it in names.items()})
    assert said == (
        "possible leaves out mounting errors, about 0.50 m RMS and clocks, about 0.50 m to 1.2 m "
        "RMS"
    )
    assert caveat({"clocks": np.array([np.nan, np.inf])}) == "possible leaves out clocks"
