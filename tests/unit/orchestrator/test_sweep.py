"""Means at each level of a sweep."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from sblcosim.analysis.means import analysis as sweep
from sblcosim.analysis.means.tables import MEANS
from sblcosim.style import THEMES


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


def table_of(means: dict[str, list[tuple[float, float, float, float]]]) -> pd.DataFrame:
    """The table of means, from value, mean and interval of each level."""
    rows = [(factor, value, 5, mean, 0.5, low, high)
            for factor, levels in means.items() for value, mean, low, high in levels]  # fmt: skip
    return pd.DataFrame(rows, columns=MEANS.names)


@pytest.mark.parametrize(("count", "grid", "size"), [
    (1, (1, 1), (5.6, 3.4)), (2, (1, 2), (7.2, 3.4)), (3, (1, 3), (10.3, 3.4)),
    (4, (2, 3), (10.3, 6.3)), (7, (3, 3), (10.3, 9.2)),
])  # fmt: skip
def test_panels_are_in_rows_of_three(
    count: int, grid: tuple[int, int], size: tuple[float, float]
) -> None:
    levels = [(1.0, 3.0, 2.5, 3.75), (2.0, -1.0, -1.25, 0.5), (4.0, 2.0, np.nan, np.nan)]
    panels = sweep.plot_means(table_of(dict.fromkeys("abcdefg"[:count], levels)), "it")
    assert panels[0].get_gridspec().get_geometry() == grid  # type: ignore[union-attr]
    assert panels[0].figure.get_size_inches() == pytest.approx(size)
    assert [panel.axison for panel in panels] == [True] * count + [False] * (
        grid[0] * grid[1] - count
    )
    for panel, name in zip(panels[:count], "abcdefg", strict=False):
        assert panel.get_xlabel() == name
        (container,) = panel.containers
        line, bars = container[0], container[2][0].get_segments()  # type: ignore[index]
        assert line.get_xydata().tolist() == [[1, 3], [2, -1], [4, 2]]
        assert (line.get_marker(), line.get_linestyle()) == ("o", "-")
        assert line.get_color() == THEMES["light"].receivers[1]
        assert [bar[:, 1].tolist() for bar in bars] == [[2.5, 3.75], [-1.25, 0.5], [2, 2]]
    assert [panel.get_ylabel() for panel in panels] == ["Mean it"] + [""] * (len(panels) - 1)
    assert panels[0].get_ylim()[0] < -1.25
    above = sweep.plot_means(table_of({"a": [(1.0, 3.0, 2.5, 3.75)]}))
    assert above[0].get_ylim()[0] == 0


def test_means_of_a_factor_are_at_the_base_of_all_others_and_of_one_run_without_interval() -> None:
    table = pd.DataFrame(
        [(1, 5, 7, 2.0), (1, 5, 7, 4.0), (2, 5, 7, 9.0), (1, 6, 7, 11.0), (1, 5, 8, 13.0),
         (2, 6, 8, 100.0)], columns=["a", "b", "c", "y"],
    )  # fmt: skip
    found = sweep.means(table, ["a", "b", "c"], "y", [1, 5, 7], confidence=0.9)
    assert found[["factor", "value", "runs", "mean"]].to_numpy().tolist() == [
        ["a", 1, 2, 3], ["a", 2, 1, 9], ["b", 5, 2, 3], ["b", 6, 1, 11], ["c", 7, 2, 3],
        ["c", 8, 1, 13],
    ]  # fmt: skip
    two, one = found.iloc[0], found.iloc[1]
    assert two["std"] == pytest.approx(2**0.5)
    # Student's t of 95 % for one degree of freedom is 6.3138.
    assert two["high"] == pytest.approx(3 + 6.313752)
    assert two["low"] == 0
    assert one[["std", "low", "high"]].isna().all()
