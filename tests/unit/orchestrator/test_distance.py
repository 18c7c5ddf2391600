"""Error against distance from the platform, and the sentences for data sheets."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from math import hypot
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
import sblcosim
import sblcosim.cli
from quick import one_in
from sblcosim.areas import distance, motion, runs
from sblcosim.areas.distance_result import DistanceCurve, row_step
from sblcosim.areas.rings import Rings, rings_of
from sblcosim.comparison.many import data_sheet as of_many
from sblcosim.errors import ConfigurationError
from sblcosim.fmus.build.factory import build
from sblcosim.judge.pooling import PERCENTAGES, effective, neighbours
from sblcosim.limits import places, unknown
from sblcosim.models.settings.presets import preset
from sblcosim.results import data_sheet
from sblcosim.scenario.arrangement import has_own_errors
from sblcosim.scenario.conditions import conditions
from sblcosim.scenario.likes import LIKES
from sblcosim.scenario.scenario import shipped
from sblcosim.study.kept import Kept
from sblcosim.words.lists import listed
from sblcosim.words.numbers import meters_at_most
from seams import Seam
from typer.testing import CliRunner

SHORT: dict[str, Any] = {"duration_s": 12.0, "settling_s": 6.0}
SILENT = '''
from sblcosim import Receiver


class Silent(Receiver):
    """Has no estimate."""

    def update(self, samples):
        return None
'''
SAID = re.compile(
    r"(?P<receiver>\w+): 95 % of the estimates are within (?P<bound>[\d.,]+) m "
    r"(?:up to|from [\d.]+ to) (?P<reach>[\d.]+) m from (?P<origin>the platform|the middle of the "
    r"beacons), at (?P<depth>[\d.]+) m depth, (?P<conditions>.+), (?P<runs>\d+) runs at each of "
    r"(?P<distances>\d+) distances"
)


SHALLOW = {"harbour-wakes": (1.5, 3.0)}
"""Depths [m] where the water is too shallow for 4 m and 12 m."""


@cache
def curve(name: str, seed: int = 1) -> DistanceCurve:
    speed = None if "speed_m_s" in sblcosim.load(name).target.model_fields_set else 0.3
    return sblcosim.map_distance(
        name, 40, SHALLOW.get(name, (4.0, 12.0)), cells=3, runs=100, overrides={"seed": seed},
        speed_m_s=speed, duration_s=30.0, settling_s=20.0,
    )  # fmt: skip


# --- Distances and directions --------------------------------------------------------------------


@pytest.mark.parametrize(("distance", "bounds"), [
    (60, (0, 60)), ("60", (0, 60)), ("5,60", (5, 60)), ((5.0, 60.0), (5, 60)),
])  # fmt: skip
def test_distances_and_depths_are_given_in_any_form(distance: Any, bounds: Any) -> None:
    found = rings_of(distance, [20.0, 5.0], 12, (2.0, 1.0))
    np.testing.assert_allclose(found.distances, np.linspace(*bounds, 12))
    assert found.depths == (5.0, 20.0)
    assert rings_of(distance, 7, 12, (2.0, 1.0)).depths == (7.0,)
    assert found.shape == (2, 12)


@pytest.mark.parametrize(("change", "words"), [
    ({"distance": "far"}, "map distance: must be how far from the platform in m, e.g. 60"),
    ({"distance": (1, 2, 3)}, "map distance: must be how far"),
    ({"distance": 0}, "map distance: must be from 0 m or more to a larger distance"),
    ({"distance": "9,9"}, "map distance: must be from 0 m or more to a larger distance"),
    ({"distance": 20_000}, "map distance: must be from 0 m or more to a larger distance of at most "
                           "10 km"),
    ({"depth": -1.0}, "map depth: must be a depth below the surface"),
    ({"depth": []}, "map depth: must be from 1 to 20 depths, got 0"),
    ({"depth": "deep"}, "map depth: must be a depth below the surface"),
    ({"overrides": {"acoustics.water_depth_m": 12.0}, "depth": [5.0, 20.0]},
     "map depth: must be at most the depth of the water, 12 m (override acoustics.water_depth_m), "
     "got 20 m"),
    ({"cells": 1}, "map cells: must be a whole number of distances from 2 to 1,000, got 1"),
    ({"cells": "3x4"}, "map cells: must be a whole number of distances"),
    ({"runs": 0}, "map runs: must be a whole number of at least 1"),
    ({"limit_m": 0.0}, "map limit: must be more than 0 m"),
    ({"error": "total"}, "map error: must be absolute_horizontal"),
])  # fmt: skip
def test_what_cannot_be_asked_is_refused_in_one_line(change: dict[str, Any], words: str) -> None:
    options = {"distance": 30, "depth": 5.0, "cells": 2, "runs": 2, **SHORT} | change
    where = options.pop("distance"), options.pop("depth")
    with pytest.raises(ConfigurationError) as caught:
        sblcosim.map_distance("realistic-dive", *where, **options)
    assert str(caught.value).startswith(words)
    assert "\n" not in str(caught.value)


def test_a_distance_has_its_runs_in_all_directions() -> None:
    rings = Rings((3.0, -2.0), (5.0, 50.0), (4.0, 9.0))
    cell, replicate = np.tile(np.arange(4), 90), np.repeat(np.arange(90), 4)
    placed = rings.placed(cell, replicate, 7)
    offset = placed["target.center"] - [3.0, -2.0]
    np.testing.assert_allclose(np.hypot(*offset.T), np.array([5.0, 50.0, 5.0, 50.0])[cell])
    for name in ("target.depth_start", "target.depth_end"):
        np.testing.assert_array_equal(placed[name], np.array([4.0, 4.0, 9.0, 9.0])[cell])
    for one in range(4):
        angles = np.sort(np.arctan2(*offset[cell == one].T[::-1]) % (2 * np.pi))
        gaps = np.diff(angles, append=angles[0] + 2 * np.pi)
        assert gaps.max() < 2.7 * 2 * np.pi / 90
    first = np.arctan2(*offset[:4].T[::-1])
    assert len(np.unique(first.round(6))) == 4  # not all distances alike


def test_what_is_possible_is_asked_for_in_all_directions() -> None:
    rings = Rings((3.0, -2.0), (5.0, 50.0), (4.0,))
    found = rings.centres.reshape(-1, 2, 3)
    np.testing.assert_allclose(found.mean(axis=0), [[3.0, -2.0, 4.0]] * 2, atol=1e-9)
    np.testing.assert_allclose(
        np.hypot(*(found[..., :2] - [3.0, -2.0]).T), np.repeat([[5.0], [50.0]], len(found), axis=1)
    )


def test_what_possible_leaves_out_is_the_mean_square_over_directions() -> None:
    """Errors of mounting: different ahead and abeam of a long arrangement."""
    given = sblcosim.load("realistic-dive", {
        "platform.beacon_m": [[9.0, 0, 0.5], [-9.0, 0, 0.5], [0, 1.0, 0.5], [0, -1.0, 0.5]],
        "platform.mounting_std_m": 0.5,
    })  # fmt: skip
    found = sblcosim.map_distance(given, "20,40", 5.0, cells=2, runs=2, **SHORT)
    north, east = places.still_beacons(given).mean(0)[:2]
    squares: dict[str, list[float]] = {}
    for angle in 2 * np.pi * np.arange(16) / 16:
        place = np.array([[north + 20 * np.cos(angle), east + 20 * np.sin(angle), 5.0]])
        span = (SHORT["settling_s"], SHORT["duration_s"])
        for words, it in unknown.squares_in_places(found.scenario, place, span).items():
            squares.setdefault(words, []).append(float(it[0]))
    assert found.left_out
    for words, it in found.left_out.items():
        assert it[0] == pytest.approx(np.sqrt(np.mean(squares[words])), rel=1e-9)
        assert np.ptp(squares[words]) > 0.01 * np.mean(squares[words])  # directions are not alike


# --- The numbers, a second way -------------------------------------------------------------------


def raw_errors(rings: Rings, cell: int, replicate: int, error: str) -> np.ndarray:
    """Lengths of the errors of one run of `map_distance`, from its estimates and the truth."""
    given = sblcosim.load("realistic-dive")
    circle = motion.circle_of(given, 3.0, None, 12.0)
    moving = motion.circling(given, circle, rings.depths[0], 12.0)
    one = runs.Simulator(moving, None, rings, error, 6.0)
    index, number = np.array([cell]), np.array([replicate])
    values = rings.placed(index, number, 1) | {"target.heading": one.bearings(index, number)}
    result = sblcosim.run(moving, overrides={
        "seed": int(one.seeds(index, number)[0]),
        "target.center_m": values["target.center"][0].tolist(),
        "target.depth_start_m": float(values["target.depth_start"][0]),
        "target.depth_end_m": float(values["target.depth_end"][0]),
        "target.heading_deg": float(np.rad2deg(values["target.heading"][0])),
    })  # fmt: skip
    table = result.tracks["coupled"]
    table = table[table["epoch_s"] >= 6.0]
    frame, _, what = error.rpartition("_")
    prefix = {"absolute": "error", "relative": "relative_error"}[frame]
    axes = ("x", "y") if what == "horizontal" else ("x", "y", "z")
    lengths = np.sqrt((table[[f"{prefix}_{a}_m" for a in axes]] ** 2).sum(axis=1))
    return lengths.to_numpy()


@pytest.mark.parametrize("error", ["absolute_total", "relative_horizontal"])
def test_the_numbers_are_those_of_the_raw_estimates(error: str) -> None:
    found = sblcosim.map_distance(
        "realistic-dive", "10,50", (4.0, 9.0), cells=2, runs=6, error=error, **SHORT
    )
    middle = places.still_beacons(sblcosim.load("realistic-dive")).mean(0)[:2].tolist()
    rings = rings_of("10,50", (4.0, 9.0), 2, middle)
    for cell, row in enumerate(found.distances.to_dict("records")):
        lengths = [raw_errors(rings, cell, k, error) for k in range(6)]
        squares = [float((it**2).mean()) for it in lengths]
        assert row["rms_m"] == pytest.approx(np.sqrt(np.mean(squares)), rel=1e-6)
        ten = [np.sort(it)[np.ceil(np.arange(5, 100, 10) / 100 * len(it)).astype(int) - 1]
               for it in lengths]  # fmt: skip
        every = np.sort(np.concatenate(ten))
        assert every[56 - 1] * 0.98 <= row["p95_m"] <= every[58 - 1] * 1.02
        assert row["bound_m"] == row["p95_m"] + 2 * row["std_error_m"]


def test_what_is_possible_is_the_mean_over_directions() -> None:
    """At one direction at a time it lies about that of all; by hand for a Gaussian mixture."""
    given = sblcosim.load("realistic-dive", {
        "platform.beacon_m": [[4.0, 0, 0.5], [-1.0, 0, 0.5], [0, 1.0, 0.5], [0, -0.2, 0.5]],
    })  # fmt: skip
    found = sblcosim.map_distance(given, "20,40", 5.0, cells=2, runs=2, **SHORT)
    north, east = places.still_beacons(given).mean(0)[:2]
    there = []
    for angle in 2 * np.pi * np.arange(8) / 8:
        n, e = north + 20 * np.cos(angle), east + 20 * np.sin(angle)
        area = [n - 1, n + 1, e - 1, e + 1]
        map_ = sblcosim.map_area(given, area, 5.0, cells="2x2", runs=1, **SHORT)
        there.append(map_.cells["possible_p95_m"].mean())
    assert np.ptp(there) > 0.05  # the directions are not alike
    assert min(there) < found.distances["possible_p95_m"][0] < max(there)
    assert found.distances["possible_p95_m"][0] == pytest.approx(np.mean(there), rel=0.05)
    rms = found.distances["possible_rms_m"]
    assert (rms < found.distances["possible_p95_m"]).all()


def test_without_reach_no_cell_has_a_neighbour() -> None:
    values = np.arange(12.0).reshape(3, 4)
    np.testing.assert_array_equal(neighbours(values, 0), values)
    for shape in ((1, 1), (2, 7), (20, 20)):
        every = np.ones(shape)
        weights = np.zeros(shape)
        weights[0, 0] = 1.0
        corner = neighbours(weights)  # by symmetry the weights of the corner's neighbours
        counted = corner.sum() ** 2 / (corner**2).sum()
        assert effective(shape) == pytest.approx(counted)
        assert effective(shape) <= every.sum()


def test_finished_runs_are_not_done_again(tmp_path: Path, seam: Seam) -> None:
    options: dict[str, Any] = {"cells": 3, "runs": 4, **SHORT}
    whole = sblcosim.map_distance("realistic-dive", 30, 5.0, **options)
    keep = Kept(tmp_path / "it")
    sblcosim.map_distance("realistic-dive", 30, 5.0, keep=keep, **options)
    seam.instead(runs.reduced, lambda *_: pytest.fail("a run was done again"))
    again = sblcosim.map_distance("realistic-dive", 30, 5.0, keep=keep, **options)
    assert again.distances.equals(whole.distances)
    with pytest.raises(pytest.fail.Exception):
        sblcosim.map_distance("realistic-dive", 31, 5.0, keep=keep, **options)


# --- The sentence of a data sheet ----------------------------------------------------------------


@one_in(2)
@pytest.mark.parametrize("name", shipped())
def test_a_sentence_holds_for_other_runs(name: str) -> None:
    """For each depth, what it says is what other noise gives, at each distance."""
    found, other = curve(name), curve(name, seed=10_000_000)
    own = has_own_errors(sblcosim.load(name).platform)
    for depth, said in zip(found.depths, found.data_sheet, strict=True):
        parts = SAID.match(said)
        assert parts is not None, said
        assert float(parts["depth"]) == depth
        assert parts["origin"] == ("the middle of the beacons" if own else "the platform")
        assert parts["conditions"] == ", ".join(conditions(sblcosim.load(name)))
        assert int(parts["runs"]) == 100
        reached = found.at(depth)["distance_m"] <= float(parts["reach"])
        assert int(parts["distances"]) == reached.sum()
        bound = float(parts["bound"])
        assert bound >= found.at(depth)["bound_m"][reached].max()
        errors = other.at(depth)
        # Two standard errors: what is over them is rare, and little over.
        over = errors["p95_m"][reached.to_numpy()] - 1.5 * errors["std_error_m"]
        assert (over <= bound).all()


def test_from_too_few_runs_there_is_no_sentence_and_it_says_how_many_it_takes() -> None:
    few = sblcosim.map_distance("realistic-dive", 20, 5.0, cells=2, runs=58, **SHORT)
    assert few.data_sheet == [
        "no data-sheet sentence from 58 runs at each distance: 59 are needed, 1 more"
    ]
    assert data_sheet.NOTE not in few.remarks
    assert data_sheet.NOTE not in few.text(verbose=True)
    enough = sblcosim.map_distance("realistic-dive", 20, 5.0, cells=2, runs=59, **SHORT)
    assert data_sheet.NOTE in enough.remarks
    assert data_sheet.NOTE in enough.text(verbose=True)
    assert data_sheet.NOTE not in enough.text()
    area = sblcosim.map_area("realistic-dive", "9x9", 5.0, cells=2, runs=2, **SHORT)
    least = int(np.ceil(59 / effective((2, 2))))
    assert area.data_sheet.endswith(f"in each cell: {least} are needed, {least - 2} more")
    many = sblcosim.run_many("paper-scenario-1", "ekf", {"time.duration_s": 5.0}, runs=4)
    assert many.data_sheet == ["no data-sheet sentence from 4 runs: 59 are needed, 55 more"]
    assert many.data_sheet[0] in many.remarks
    assert many.data_sheet[0] in str(many)


SCREEN = 24
"""Lines of a terminal, two of them to say where the result is."""


@pytest.mark.parametrize("name", ["realistic-dive", "gps-buoys", "water-linked"])
def test_the_first_screen_is_the_sentence_and_one_small_table(name: str) -> None:
    source = LIKES[name].source if name in LIKES else name
    found = sblcosim.map_distance(
        source, 60, 5.0, runs=60, duration_s=12.0, settling_s=6.0, limit_m=5.0
    )
    certain = replace(found, distances=found.distances.assign(lost_share=0.0))
    lines = certain.text(width=60).splitlines()
    assert len(lines) <= SCREEN - 2
    assert max(map(len, lines)) <= 60
    rows = [line.split()[0] for line in lines if line.endswith("0 %")]
    assert (rows[0], rows[-1]) == ("0", "60")
    assert rows == ["0", "30", "60"]
    whole = certain.text(verbose=True)
    assert "errors count from 6 s to 12 s" in whole
    assert "lost runs: 0 % of 1,260" in whole


@pytest.mark.parametrize("most", [3, 7])
def test_the_rows_of_a_short_table_are_few_and_have_the_last_distance(most: int) -> None:
    for count in range(1, 60):
        step = row_step(count, most)
        rows = [*range(count)][::-step][::-1]
        assert rows[-1] == count - 1
        assert len(rows) <= most
        if count > 2:
            assert len(rows) >= 2
        if any((count - 1) % it == 0 for it in range(-(-count // most), count - 1)):
            assert rows[0] == 0


def test_without_estimates_there_is_no_sentence(tmp_path: Path) -> None:
    (tmp_path / "silent.py").write_text(SILENT)
    source = f"{tmp_path / 'silent.py'}:Silent"
    found = sblcosim.map_distance(
        "realistic-dive", 20, 5.0, source, cells=2, runs=59, duration_s=3.0, settling_s=1.0
    )
    assert found.data_sheet == [
        "no data-sheet sentence at 5 m depth: about 5 % of the runs or more have no estimate 0 m "
        "from the platform"
    ]
    assert found.reach(5.0) == (None, None)
    str(found)
    many = sblcosim.run_many("realistic-dive", source, {"time.duration_s": 3.0}, runs=59)
    assert many.data_sheet == [
        "no data-sheet sentence for Silent: about 5 % of the runs or more have no estimate"
    ]


def of_bounds(found: DistanceCurve, bounds: Any, lost: Any, limit: float) -> DistanceCurve:
    table = found.at(4.0).assign(bound_m=bounds, p95_m=bounds, lost_share=lost)
    settings = {**found.settings, "depth_m": [4.0], "limit_m": limit}
    return replace(found, distances=table, settings=settings)


def test_the_sentence_ends_where_estimates_do_and_names_lost_runs() -> None:
    found = curve("realistic-dive")
    half = of_bounds(found, [1.0, 1.31, np.inf], [0.0, 0.12, 0.5], 1.2)
    (said,) = half.data_sheet
    assert "within 1.4 m up to 20 m from the platform" in said  # rounded up
    assert said.endswith(
        "100 runs at each of 2 distances; up to 12 % of the runs are lost; no figure farther out: "
        "about 5 % of the runs or more have no estimate at 40 m"
    )
    assert half.reach(4.0)[0] == 0.0
    back = of_bounds(found, [1.0, 1.3, 1.1], 0.0, 1.2)  # nearer it is not kept
    assert back.reach(4.0)[0] == 0.0
    assert "lost" not in back.data_sheet[0]
    assert of_bounds(found, [1.3, 1.3, 1.1], 0.0, 1.2).reach(4.0)[0] is None
    for it in (half, back):
        it.plot()
        it.plot("dark", ax=plt.figure().add_subplot())
        plt.close("all")


@pytest.mark.parametrize("length", [0.0312, 0.31, 1.3, 1.31, 9.99, 13.2, 1302.0])
def test_bounds_are_rounded_up(length: float) -> None:
    said = float(meters_at_most(length).removesuffix(" m").replace(",", ""))
    assert length <= said * (1 + 1e-9)
    assert said <= length * 1.1


@pytest.mark.parametrize("name", ["realistic-dive", "harbour-random", "gps-buoys", "harbour-lbl"])
def test_the_sentence_of_many_runs_is_that_of_all_their_estimates(name: str) -> None:
    many = sblcosim.run_many(name, "coupled" if name == "realistic-dive" else (),
                             {"time.duration_s": 30.0}, runs=60)  # fmt: skip
    (said,) = many.data_sheet
    assert said in str(many)
    assert data_sheet.NOTE in many.text(verbose=True)
    assert ", ".join(conditions(sblcosim.load(name))) in said
    bound = float(re.findall(r"within ([\d.]+) m", said)[0])
    lengths = []
    for seed in range(2_000, 2_025):
        result = sblcosim.run(name, many.receivers[0], {"time.duration_s": 30.0, "seed": seed})
        table = result.tracks[many.receivers[0]]
        square = (table[[f"error_{a}_m" for a in "xyz"]] ** 2).sum(axis=1)
        lengths.append((np.sqrt(square) <= bound).mean())
    assert np.mean(lengths) > 0.88  # of 25 runs whose errors are one draw each
    where = re.findall(r"at (\d+)–(\d+) m from", said)
    assert bool(where) == (name != "harbour-random")
    if where:
        low, high = map(float, where[0])
        place = table[["true_x_m", "true_y_m"]].to_numpy()
        place = place - places.still_beacons(sblcosim.load(name)).mean(0)[:2]
        assert low <= np.hypot(*place.T).min() <= np.hypot(*place.T).max() <= high


def test_the_bound_of_many_runs_holds_for_few_and_wild_ones() -> None:
    rng = np.random.default_rng(4)
    held = []
    for seed in range(25):
        scale = rng.lognormal(0.0, 0.6, 100)
        lengths = scale[:, None] * np.abs(rng.normal(size=(100, 200)))
        kept = np.percentile(lengths, PERCENTAGES, axis=1).T
        other = rng.lognormal(0.0, 0.6, 20_000) * np.abs(rng.normal(size=20_000))
        held.append((other <= of_many.bound_of(kept, seed)).mean() >= 0.95)
    assert np.mean(held) >= 0.84


@pytest.mark.parametrize("rare", [0.02, 0.1, 0.3])
@pytest.mark.parametrize("spread", [0.0, 0.4, 0.8, 1.2])
def test_the_radius_of_many_runs_holds_its_share_however_they_differ(
    spread: float, rare: float
) -> None:
    """Runs of different size, with wild stretches or without."""
    rng = np.random.default_rng(int(100 * (spread + rare)))
    scale = rng.lognormal(0.0, spread, 2_000)
    wild = rng.random((2_000, 400)) < rare * rng.random((2_000, 1)) ** 3  # few in most runs
    lengths = scale[:, None] * np.abs(rng.normal(size=(2_000, 400))) * np.where(wild, 8.0, 1.0)
    kept = np.percentile(lengths, PERCENTAGES, axis=1, method="inverted_cdf").T
    radius, std_error = of_many.radius_of(kept, 0)
    assert (lengths <= radius).mean() == pytest.approx(0.95, abs=0.0025)
    assert 0 < std_error < 0.2 * radius


# --- Conditions ----------------------------------------------------------------------------------

NOISE = "range noise 0.1 m (1σ)"
ALL_EXACT = "exact clock, speed of sound and mounting"
ARMS = "4 beacons on arms of 3 m"
WORDS: dict[str, list[str]] = {
    "realistic-dive": ["Beaufort 2", "surge and sway of ±2.1 m",
                       "GPS error 1.2 m horizontal (1σ per axis)", "heading error 3° RMS", ARMS,
                       "a ping every 1 s", NOISE, "25 % packet loss", "5 % outliers",
                       "speed of sound off by 2 %",
                       "clock just set with a drift of 0.5 ppm (1σ)", "clock offset 0.9 ms (1σ)",
                       "exact mounting"],
    "realistic-sea": ["Beaufort 3 as a spectrum", "drift in a circle of 3 m", "SBAS GPS",
                      "heading error 2.06° RMS", ARMS, "a ping every 1 s", NOISE,
                      "25 % packet loss in bursts of 4 packets", "echoes from surface and bottom",
                      "1 % outliers", "speed of sound off by 2 %", "TCXO clock set 30 min before",
                      "exact mounting"],
    "harbour-wakes": ["waves of 0.2 m (significant height, peak at 1.3 s)",
                      "drift in a circle of 1 m", "yaw of ±3°",
                      "GPS error 1.05 m horizontal (1σ per axis)", "heading error 1° RMS", ARMS,
                      "a ping every 0.151 s", NOISE, "50 % packet loss in bursts of 3 packets",
                      "echoes from surface and bottom", ALL_EXACT],
    "gps-buoys": ["beacons at rest", "SBAS GPS on each buoy", "4 beacons", "a ping every 1 s",
                  NOISE, "25 % packet loss", "5 % outliers", "speed of sound off by 2 %",
                  "clock just set with a drift of 0.5 ppm (1σ)", "clock offset 0.1 ms (1σ)"],
    "harbour-lbl": ["beacons at rest", "4 beacons", "beacons surveyed to 0.3 m (1σ per axis)",
                    "a ping every 1 s", NOISE, "10 % packet loss", "5 % outliers",
                    "speed of sound off by 0.66 %", "clock just set with a drift of 0.05 ppm (1σ)",
                    "clock offset 0.1 ms (1σ)"],
    "paper-scenario-1": ["roll, pitch and yaw of ±5°", "GPS error 0.1 m horizontal (1σ per axis)",
                         "heading error 1° RMS", ARMS, "a ping every 0.1 s", NOISE, ALL_EXACT],
    "harbour-square": ["roll, pitch and yaw of ±3°", "heave of ±0.0707 m",
                       "GPS error 1.05 m horizontal (1σ per axis)", "heading error 1° RMS", ARMS,
                       "a ping every 0.1 s", NOISE, "50 % packet loss", ALL_EXACT],
}  # fmt: skip


@pytest.mark.parametrize(("keys", "words"), [
    ({"acoustics.clock_grade": "tcxo", "acoustics.clock_sync_age_s": 1800},
     ["TCXO clock set 30 min before"]),
    ({"acoustics.clock_grade": "crystal"}, ["crystal clock just set"]),
    ({"acoustics.clock_drift_s_s": 3e-6, "acoustics.clock_drift_std_s_s": 4e-6},
     ["clock just set with a drift of 5 ppm (1σ)"]),
    ({"acoustics.clock_offset_std_s": 2e-3}, ["clock offset 2 ms (1σ)"]),
    ({"acoustics.schedule": "simultaneous", "platform.beacons": 6, "platform.arm_length_m": 1.5},
     ["6 beacons on arms of 1.5 m", "pings of all every 0.1 s"]),
    ({"platform.beacon_scale": 2.0}, ["4 beacons on arms of 6 m"]),
    ({"platform.mounting_std_m": 0.05}, ["beacons surveyed to 0.05 m (1σ per axis)"]),
    ({"platform.mounting_error_m": [[0.1, 0, 0]] + [[0, 0, 0]] * 3}, []),
    ({"acoustics.ranging": "two_way"}, ["two-way ranging"]),
    ({"acoustics.ranging": "inverted"}, ["inverted ranging", "a ping of the diver every 0.1 s"]),
    ({"platform.misalignment_tilt_std_deg": 0.5, "platform.misalignment_heading_std_deg": 1.0},
     ["beacons' frame misaligned by 0.5° in tilt and 1° in heading (1σ)"]),
])  # fmt: skip
def test_what_decides_is_named_and_else_called_exact(
    keys: dict[str, Any], words: list[str]
) -> None:
    said = conditions(sblcosim.load("paper-scenario-1", keys))
    assert set(words) <= set(said)
    two_way = keys.get("acoustics.ranging") == "two_way"
    clock = two_way or any("clock" in key for key in keys)
    mounting = any(word in key for key in keys for word in ("mounting", "misalignment"))
    exact = [name for name, has_errors in (
        ("clock", clock), ("speed of sound", False), ("mounting", mounting)) if not has_errors]
    assert said[-1] == f"exact {listed(exact)}"


@pytest.mark.parametrize("name", WORDS)
def test_conditions_of_shipped_scenarios(name: str) -> None:
    assert conditions(sblcosim.load(name)) == WORDS[name]


@pytest.mark.parametrize("name", shipped())
def test_every_shipped_scenario_and_every_system_has_conditions(name: str) -> None:
    for source in (name, *(like.source for like in LIKES.values())):
        assert all(conditions(sblcosim.load(source)))


@pytest.mark.parametrize(("name", "value", "words"), [
    ("beaufort", 3, "Beaufort 3"), ("beaufort", 0, "Beaufort 0"), ("beaufort", 6, "Beaufort 6"),
    ("gps_grade", "sbas", "SBAS GPS"), ("gps_grade", "rtk_fixed", "RTK fixed GPS"),
    ("gps_grade", "standalone", "standalone GPS"), ("imu_grade", "tactical", "tactical IMU"),
])  # fmt: skip
def test_a_grade_is_named_only_if_all_its_keys_have_its_values(
    name: str, value: Any, words: str
) -> None:
    base = {name: value}
    given = preset(name, value)
    some = dict([*given.items()][:-1])
    for keys in (base, base | some):
        assert words in conditions(sblcosim.load({"platform": keys}))
    for key, it in given.items():
        motion = {"motion": "spectrum"} if key.startswith("wave_") else {}
        for keys, named in ((base, True), (base | {key: 2 * it + 0.01}, False)):
            said = conditions(sblcosim.load({"platform": keys | motion}))
            assert any(part.startswith(words) for part in said) == named, key


@pytest.mark.parametrize(("keys", "words"), [
    ({"beaufort": 3}, "Beaufort 3 as a spectrum"),
    ({"beaufort": 3, "watch_circle_m": 3.0}, "Beaufort 3 as a spectrum; drift in a circle of 3 m"),
    ({"beaufort": 3, "roll_amplitude_deg": 20.0}, "Beaufort 3 as a spectrum"),
    ({"wave_height_m": 0.7, "sway_amplitude_m": 2.0},
     "waves of 0.7 m (significant height, fully developed)"),
    ({"wave_height_m": 0.7, "wave_period_s": 4.0, "yaw_amplitude_deg": 3.0},
     "waves of 0.7 m (significant height, peak at 4 s); yaw of ±3°"),
    ({"wave_height_m": 0.0, "roll_amplitude_deg": 3.0}, "platform at rest"),
])  # fmt: skip
def test_a_spectrum_is_named_with_its_size(keys: dict[str, float], words: str) -> None:
    said = conditions(sblcosim.load({"platform": {"motion": "spectrum", **keys}}))
    assert "; ".join(said).startswith(f"{words}; GPS")


@pytest.mark.parametrize("seed", range(8))
def test_sizes_of_random_scenarios_are_theirs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    names = ("gps_horizontal_std_m", "gps_horizontal_bias_std_m", "gps_horizontal_markov_std_m",
             "gps_vertical_std_m", "imu_heading_std_deg", "imu_heading_bias_deg",
             "roll_amplitude_deg", "sway_amplitude_m", "mounting_std_m")  # fmt: skip
    keys = {key: float(np.round(rng.uniform(0.1, 3), 2)) * rng.integers(2) for key in names}
    noise, loss, late = (float(np.round(rng.uniform(0.1, 0.9), 2)) * rng.integers(2)
                         for _ in range(3))  # fmt: skip
    sound = float(rng.choice([1500.0, 1510.0, 1480.0]))
    base = {
        "target": {"speed_m_s": 0.3}, "platform": keys,
        "acoustics": {"range_std_m": noise, "loss_probability": loss, "outlier_probability": late,
                      "sound_speed_m_s": sound, "assumed_sound_speed_m_s": 1500.0},
    }  # fmt: skip
    said = "; ".join(conditions(sblcosim.load(base)))
    assert (f"range noise {noise:.3g} m (1σ)" in said) == bool(noise)
    assert ("ranges without noise" in said) == (not noise)
    assert (f"{100 * loss:.0f} % packet loss" in said) == bool(loss)
    assert (f"{100 * late:.0f} % outliers" in said) == bool(late)
    assert ("speed of sound off by" in said) == (sound != 1500.0)
    gps = hypot(*(keys[it] for it in names[:3]))
    if has_own_errors(sblcosim.load(base).platform):
        assert "GPS" not in said
    else:
        assert ("without error" in said) == (not gps and not keys["gps_vertical_std_m"])
        assert (f"{gps:.3g} m horizontal" in said) == bool(gps)
        assert (f"{keys['gps_vertical_std_m']:.3g} m vertical" in said) == bool(
            keys["gps_vertical_std_m"]
        )
    heading = hypot(keys["imu_heading_std_deg"], keys["imu_heading_bias_deg"])
    assert (f"heading error {heading:.3g}° RMS" in said) == bool(heading)
    assert ("at rest" in said) == (not keys["roll_amplitude_deg"] and not keys["sway_amplitude_m"])
    survey = keys["mounting_std_m"]
    assert (f"surveyed to {survey:.3g} m" in said) == bool(survey)


@pytest.mark.parametrize("name", ["platform", "acoustics"])
def test_of_another_fmu_only_the_name_is_known(name: str) -> None:
    other = Path(build(name, 2))
    scenario = sblcosim.load("realistic-dive", {f"{name}.fmu": str(other)})
    said = conditions(scenario)
    assert f"{name} of {other.name}" in said
    assert (NOISE in said) == (name == "platform")
    assert ("Beaufort 2" in said) == (name == "acoustics")


def test_a_platform_of_ones_own_has_depths_and_no_distances() -> None:
    """The path is the same in all runs; where the beacons are in them, nobody knows."""
    other = str(build("platform", 2))
    changes = {"platform.fmu": other, "time.duration_s": 5.0}
    many = sblcosim.run_many("paper-scenario-1", None, changes, runs=59)
    assert "m at 5 m depth, platform of platform.fmu, " in many.data_sheet[0]
    assert "drawn anew" not in many.data_sheet[0]
    changed = {**changes, "target.trajectory": "random_path"}
    many = sblcosim.run_many("paper-scenario-1", None, changed, runs=59)
    assert "on paths drawn anew in each run, platform of" in many.data_sheet[0]


def test_the_conditions_are_printed_once_for_all_depths() -> None:
    found = curve("realistic-dive")
    one, *others = found.data_sheet
    assert others
    shared = ", ".join(conditions(sblcosim.load("realistic-dive")))
    assert all(said.count(shared) == 1 for said in found.data_sheet)
    text = found.text()
    assert text.startswith(one)
    assert text.count(shared) == 1
    assert text.count("in the same conditions") == len(others)
    assert found.text(verbose=True).count(shared) == len(found.depths)


# --- Command -------------------------------------------------------------------------------------


def test_the_command_prints_saves_and_refuses(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["map", "realistic-dive", "--depth", "5"]
    short = ["--cells", "2", "--runs", "3", "--duration", "9", "--settling", "4"]
    runner = CliRunner()

    def called(*more: str) -> Any:
        return runner.invoke(sblcosim.cli.app, [*words, *more])

    done = called("--distance", "5,20", "--depth", "15", *short)
    assert done.exit_code == 0, done.output
    assert "no data-sheet sentence from 3 runs at each distance" in done.output
    assert re.search(r"^ *5 m +5 m .*\n(.*\n)*\s*15 m +5 m ", done.output, re.M)
    folder = tmp_path / "runs" / "realistic-dive-distance"
    assert {it.name for it in folder.iterdir()} == {
        "distances.csv", "distances.parquet", "distance.svg", "distance.png", "manifest.json"
    }
    for more, said in (
        ([], "--area: must be given, or --distance, got neither"),
        (["--distance", "9", "--area", "9x9"], "--distance: must be left out with --area, got 9"),
        (["--area", "9x9", "--depth", "8"], "--depth: must be given once with --area, got 2"),
        (["--distance", "far"], "--distance: must be how far from the platform in m"),
    ):
        refused = called(*more)
        assert refused.exit_code == 2
        assert said in re.sub(r"\s+", " ", refused.output)


# --- Where the circle is hard --------------------------------------------------------------------


def test_a_distance_that_stands_out_of_the_possible_is_named() -> None:
    """Arms of 1.5 m, pings each second: beside the platform, a turn in 38 s is taken for noise."""
    source = LIKES["platform"].source
    keys = {
        "platform.arm_length_m": 1.5, "platform.gps_grade": "standalone",
        "platform.imu_heading_turn_on_std_deg": 3.0, "platform.beaufort": 3,
        "time.sampling_time_s": 1.0, "target.speed_m_s": 0.5,
    }  # fmt: skip
    options: dict[str, Any] = {"cells": 11, "runs": 200, "overrides": keys}
    found = sblcosim.map_distance(source, 60, 15.0, **options)
    assert found.doubt.startswith("at 6 m distance and 15 m depth the 95 % error is ")
    ratio = found.distances["p95_m"] / found.distances["possible_p95_m"]
    said = [float(it) for it in re.findall(r"(\d\.\d+) times", found.doubt)]
    assert said == pytest.approx([ratio.max(), ratio.median()], abs=0.06)
    assert found.doubt in str(found)
    wider = float(re.findall(r"a radius of (\d+) m", found.doubt)[0])
    assert not sblcosim.map_distance(source, 60, 15.0, radius_m=wider, **options).doubt


@pytest.mark.parametrize(("p95", "std_error", "named"), [
    ((1.0, 1.6, 1.1), 0.05, True), ((1.0, 1.6, 1.1), 0.2, False),  # not told apart from chance
    ((1.0, 1.2, 1.1), 0.01, False), ((2.0, 2.1, 2.2), 0.01, False),  # no better anywhere else
    ((1.0, np.nan, 1.1), 0.05, False),
])  # fmt: skip
def test_a_distance_stands_out_only_where_chance_does_not_explain_it(
    p95: tuple[float, ...], std_error: float, named: bool
) -> None:
    rows = pd.DataFrame({
        "distance_m": [0.0, 6.0, 12.0], "depth_m": 5.0, "p95_m": p95, "possible_p95_m": 1.0,
        "std_error_m": std_error,
    })  # fmt: skip
    said = distance.hump(rows, motion.Circle(3.0, 0.5))
    assert said.startswith("at 6 m distance and 5 m depth ") if named else not said
