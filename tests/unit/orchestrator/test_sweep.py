"""Means at each level of a sweep."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from sblcosim.analysis.means import analysis as sweep


def runs() -> pd.DataFrame:
    rng = np.random.default_rng(1)
    rows = [(arm, 0.1) for arm in (0.4, 1.0, 3.0)] + [(3.0, 3.5)]
    table = pd.DataFrame(rows * 5, columns=["arm", "gps"])
    return table.assign(y=table["gps"] / table["arm"] + rng.normal(0, 0.01, len(table)))


def test_the_means_of_a_level_are_those_of_its_runs_with_the_others_at_the_base() -> None:
    table = runs()
    found = sweep.means(table, ["arm", "gps"], "y", [3.0, 0.1])
    assert list(found["factor"]) == ["arm"] * 3 + ["gps"] * 2
    row = found[(found["factor"] == "arm") & (found["value"] == 3.0)].iloc[0]
    mine = table[(table["arm"] == 3.0) & (table["gps"] == 0.1)]["y"]
    assert (row["runs"], row["mean"]) == (5, pytest.approx(mine.mean()))
    # Student's t for 4 degrees of freedom
    assert row["high"] - row["mean"] == pytest.approx(2.776445 * mine.std() / 5**0.5, rel=1e-6)


def test_runs_without_a_finite_response_are_left_out() -> None:
    table = runs()
    table.loc[0, "y"] = np.nan
    found = sweep.means(table, ["arm", "gps"], "y", [3.0, 0.1])
    assert found["runs"].tolist() == [4, 5, 5, 5, 5]


def test_without_factors_there_is_one_mean() -> None:
    found = sweep.means(runs(), [], "y")
    assert len(found) == 1
    assert found["mean"].item() == pytest.approx(runs()["y"].mean())


def test_each_factor_has_a_panel_with_its_unit() -> None:
    found = sweep.means(runs(), ["arm", "gps"], "y", [3.0, 0.1])
    panels = sweep.plot_means(found, "error [m]", {"arm": "m", "gps": ""})
    assert [p.get_xlabel() for p in panels] == ["arm [m]", "gps"]
    assert panels[0].get_ylabel() == "Mean error [m]"
    assert panels[0].get_ylim()[0] <= 0


@pytest.mark.parametrize(("shift", "ends"), [(0.0, True), (-1.0, False)])
def test_an_interval_ends_at_zero_if_no_run_is_below(shift: float, ends: bool) -> None:
    table = pd.DataFrame({"arm": [1.0] * 4 + [2.0] * 4, "y": [0.0, 0.0, 0.1, 5.0, 1, 2, 3, 4]})
    low = sweep.means(table.assign(y=table["y"] + shift), ["arm"], "y")["low"]
    assert (low.iloc[0] == 0) == ends
    assert low.iloc[1] > 0 or shift
    bar = sweep.plot_means(sweep.means(table, ["arm"], "y"))[0].collections[0].get_segments()[0]
    assert bar[:, 1].min() == 0
