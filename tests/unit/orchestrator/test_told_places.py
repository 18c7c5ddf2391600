"""Answers over places at the edge of what they tell: shares, distances and lost runs, in words."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest
import sblcosim
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D
from sblcosim.areas import distance_figures, result
from sblcosim.areas.distance_result import DistanceCurve, row_step
from sblcosim.areas.grid import Grid
from sblcosim.areas.result import AreaMap
from sblcosim.judge.definitions import MANY_LOST
from sblcosim.judge.pooling import effective
from sblcosim.results import data_sheet
from sblcosim.style import MARKERS, THEMES

BEYOND = float(np.nextafter(MANY_LOST, 1))
CROSS = np.array([[3.0, 0, 1], [-3, 0, 1], [0, 3, 1], [0, -3, 1]])


def a_map(runs: int, **columns: Any) -> AreaMap:
    """Of 2 x 3 cells."""
    p95 = np.array([2.0, 3.0, 4.0, np.nextafter(4.0, 5), 5.0, np.inf])
    cells = pd.DataFrame({
        "runs": [runs, runs, runs + 7, runs, runs, runs + 1], "p95_m": p95, "lost_share": 0.0,
        "std_error_m": [0.1, 0.3, 0.1, 0.5, 0.1, np.inf], "accuracy": True,
        "possible_p95_m": [np.inf, 3.0, 3.5, 4.0, 4.0, p95[3]],
    }).assign(**columns)
    settings = {
        "error": "absolute_total", "limit_m": 4.0, "runs": runs, "settling_s": 20.0,
        "duration_s": 80.0,
    }
    return AreaMap(
        scenario=sblcosim.load("realistic-dive"), receiver="coupled", motion="in circles",
        settings=settings, failures={}, grid=Grid((-10.0, 30.0), (5.0, 65.0), 2, 3, 5.0),
        cells=cells, beacons=CROSS, origin=None,
    )  # fmt: skip


def test_a_map_counts_cells_within_the_requirement_and_with_many_lost_runs() -> None:
    lost = np.array([0.0, MANY_LOST, BEYOND, 0.5, 0.0, 0.0])
    found = a_map(60, lost_share=lost, accuracy=lost < 0.4).summary()
    share = (60 * lost[1] + 67 * lost[2] + 60 * 0.5) / 368
    assert found["lost_share"] == pytest.approx(share, rel=1e-12)
    expected = {
        "runs": 368, "extra_runs": 8, "p95_m": [2.0, 4.0, 5.0], "cells_with_many_lost": 2,
        "cells_without_estimate": 1, "cells_without_accuracy": 1, "within_share": 3 / 6,
        "possible_within_share": 4 / 6, "possible_p95_m": [3.0, 4.0, np.inf],
    }
    assert {key: found[key] for key in expected} == expected
    shares = [0.05, 0.1, 0.025, 0.5 / np.nextafter(4.0, 5), 0.02]
    assert found["std_error_share"] == [min(shares), 0.05, max(shares)]


def test_the_sentence_of_a_map_tells_lost_runs_beyond_a_bound() -> None:
    known = {"p95_m": [2.0, 3.0, 4.0, 3.5, 3.0, 2.0],
             "std_error_m": [0.1, 0.3, 0.1, 0.5, 0.1, 0.1]}  # fmt: skip
    for lost, more in ((MANY_LOST, ""), (BEYOND, "; up to 5 % of a cell's runs are lost")):
        found = a_map(60, lost_share=[0, 0, lost, 0, 0, 0], **known)
        said = found.data_sheet
        assert "within 4.5 m everywhere in the area from -10 to 30 m north and from 5 to 65 m " \
               "east, at 5 m depth" in said.replace("−", "-")  # fmt: skip
        assert said.endswith(f"60 runs in each of 6 cells{more}")
    middle = replace(found, beacons=CROSS + np.array([10.0, 35.0, 0.0]))
    assert "40 m × 60 m about the platform" in middle.data_sheet
    aside = replace(found, beacons=CROSS + np.array([10.0, 35.1, 0.0]))
    assert "the area from" in aside.data_sheet
    least = math.ceil(data_sheet.LEAST_RUNS / effective((2, 3)))
    assert a_map(least, **known).data_sheet.startswith("coupled: ")
    assert a_map(least - 1, **known).data_sheet.startswith("no data-sheet sentence")
    assert a_map(60).data_sheet.startswith("no data-sheet sentence: in some cells")
    assert [result.part(share) for share in (0.0099, 0.01, 0.99, 0.9901)] == [
        "less than 1 %", "1 %", "99 %", "more than 99 %",
    ]  # fmt: skip


def a_curve(**columns: Any) -> DistanceCurve:
    """Of four distances at two depths."""
    reach = np.tile([5.0, 10.0, 20.0, 40.0], 2)
    rows = pd.DataFrame({
        "depth_m": np.repeat([4.0, 9.0], 4), "distance_m": reach, "runs": 100,
        "rms_m": 0.05 * reach, "p95_m": 0.1 * reach, "std_error_m": 0.01 * reach,
        "bound_m": 0.12 * reach, "possible_rms_m": 0.03 * reach, "possible_p95_m": 0.06 * reach,
        "lost_share": 0.0, "accuracy": True,
    }).assign(**columns)  # fmt: skip
    settings = {
        "error": "absolute_total", "limit_m": 1.2, "runs": 100, "depth_m": [4.0, 9.0], "cells": 4,
        "distance_m": [5.0, 40.0], "radius_m": 1.0, "speed_m_s": 0.3, "settling_s": 20.0,
        "duration_s": 30.0,
    }
    return DistanceCurve(
        scenario=sblcosim.load("realistic-dive"), receiver="coupled", motion="in circles",
        settings=settings, failures={}, distances=rows,
    )


def test_distances_are_told_as_far_as_they_are_known() -> None:
    lost = [0, MANY_LOST, 0.5, 0, 0, BEYOND, 0, 0]
    bound = [0.6, 1.2, np.inf, 2.0, 0.6, np.nextafter(1.2, 2), 1.0, 4.0]
    found = a_curve(lost_share=lost, bound_m=bound)
    first, second = found.data_sheet
    assert "from 5 to 10 m from the platform, at 4 m depth" in first
    assert first.endswith(
        "100 runs at each of 2 distances; no figure farther out: about 5 % of the runs or more "
        "have no estimate at 20 m"
    )
    assert "from 5 to 40 m from the platform, at 9 m depth" in second
    assert second.endswith("100 runs at each of 4 distances; up to 5 % of the runs are lost")
    assert [found.reach(depth) for depth in (4.0, 9.0)] == [(10.0, 20.0), (5.0, 20.0)]
    alone = a_curve(bound_m=[0.6, np.inf, 1.0, 1.0, np.nan, 1.0, 1.0, 1.0])
    one, none = alone.data_sheet
    assert "at 5 m from the platform, at 4 m depth" in one
    assert "100 runs at that distance; no figure farther out" in one
    assert none == (
        "no data-sheet sentence at 9 m depth: about 5 % of the runs or more have no estimate 5 m "
        "from the platform"
    )
    assert alone.reach(9.0)[0] is None
    few = a_curve()
    few = replace(few, settings={**few.settings, "runs": 58})
    assert len(few.data_sheet) == 1
    assert len(replace(few, settings={**few.settings, "runs": 59}).data_sheet) == 2
    for count in range(1, 40):
        for most in range(1, 15):
            step = row_step(count, most)
            least = max(-(-count // most), 1)
            fair = [it for it in range(least, count) if (count - 1) % it == 0]
            assert step == (fair[0] if fair else least if least < count else 1)


@pytest.mark.parametrize("many", [False, True])
def test_crosses_stand_where_more_runs_are_lost_than_a_bound(many: bool) -> None:
    lost = np.zeros(8)
    lost[[1, 2, 6]] = MANY_LOST, BEYOND if many else MANY_LOST, 0.5 if many else 0.0
    found = a_curve(lost_share=lost)
    ax = cast("Axes", distance_figures.plot_distance(found))
    crosses = [line for line in ax.lines if line.get_marker() == "x"]
    assert [np.asarray(line.get_xdata()).tolist() for line in crosses] == (
        [[20.0], [20.0]] if many else [[], []]
    )
    curves = [line for line in ax.lines if line.get_linewidth() == 1.8]
    assert [line.get_marker() for line in curves] == list(MARKERS[:2])
    assert [line.get_markevery() for line in curves] == [(0, 1), (1, 1)]
    colours = [to_hex(line.get_color()) for line in curves]
    assert colours == list(THEMES["light"].receivers[:2])
    (legend,) = ax.figure.legends  # type: ignore[union-attr]
    labels = [text.get_text() for text in legend.get_texts()]
    assert labels == [
        "4 m deep", "9 m deep", "95 % of the estimates", "± 2 standard errors", "RMS",
        "possible: 95 %", "required: 1.2 m", *["more than 5 % lost"] * many,
    ]  # fmt: skip
    looks = [
        (to_hex(it.get_color()), it.get_marker(), it.get_linewidth())
        for it in legend.legend_handles if isinstance(it, Line2D)
    ]
    assert looks[:2] == [(colours[i], MARKERS[i], 1.8) for i in (0, 1)]
    assert [width for *_, width in looks[2:6]] == [1.8, 1.0, 1.2, 1.2]
