"""Analyses of many runs: by way of their points, to the numbers of all runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from sblcosim.analysis import covariance
from sblcosim.analysis.common import model, runs
from sblcosim.analysis.common.centred import centred
from sblcosim.analysis.two_level import figures, fit
from sblcosim.analysis.two_level.analysis import Factorial, analyse
from sblcosim.analysis.two_level.box_cox import box_cox
from sblcosim.judge import consistency
from statsmodels.regression.linear_model import OLS

FACTORS = ("a", "b", "c")


def unbalanced(seed: int) -> pd.DataFrame:
    """Points with 3 to 9 runs each, a centre point among them, in any order; some y are missing."""
    rng = np.random.default_rng(seed)
    points = [*product((0.1, 3.5), (2.0, 1.0), (-1.0, 7.0)), (1.8, 1.5, 3.0)]
    rows = [point for point in points for _ in range(rng.integers(3, 10))]
    table = pd.DataFrame(rows, columns=list(FACTORS)).sample(frac=1, random_state=seed)
    y = np.exp(table.to_numpy() @ rng.normal(size=3) * 0.2 + rng.normal(size=len(table)) * 0.3)
    y[rng.integers(len(y))] = np.nan
    return table.assign(y=y, run_order=rng.permutation(len(y)) + 1).reset_index(drop=True)


def of_runs(found: Factorial) -> tuple[Any, np.ndarray]:
    """Least squares on all runs, and its design matrix."""
    table = found.table
    coded = np.column_stack([
        (table[name] - sum(found.levels[name]) / 2) * 2 / np.ptp(found.levels[name])
        for name in FACTORS
    ])
    columns = [coded[:, list(term)].prod(axis=1) for term in found.terms]
    centre = (np.abs(coded) < 0.5).all(axis=1).astype(float)
    x = np.column_stack([np.ones(len(table)), *columns, *([centre] if centre.any() else [])])
    return OLS(table["y"].to_numpy(), x).fit(), x


@pytest.mark.parametrize("seed", range(6))
def test_the_means_of_points_have_the_least_squares_of_their_runs(seed: int) -> None:
    found = analyse(unbalanced(seed), FACTORS, "y", error="residual")
    expected, x = of_runs(found)
    assert found.dropped == 1
    close: Callable[..., None] = np.testing.assert_allclose
    terms = slice(1, len(found.terms) + 1)
    close(found.effects["coefficient"], expected.params[terms], rtol=1e-11)
    close(found.effects["std_error"], 2 * expected.bse[terms], rtol=1e-12)
    close(found.effects["p"], expected.pvalues[terms], rtol=1e-10)
    close(found.rmse, np.sqrt(expected.mse_resid), rtol=1e-12)
    close([found.r2, found.r2_adjusted], [expected.rsquared, expected.rsquared_adj], rtol=1e-11)
    left_out = expected.get_influence().resid_press
    close(found.press, (left_out**2).sum(), rtol=1e-12)
    close(found.residuals["residual"], expected.resid, rtol=1e-9, atol=1e-13)
    own = expected.get_influence().resid_studentized_internal
    close(found.residuals["standardised"], own, rtol=1e-9, atol=1e-12)
    assert x.shape == (found.runs, 8)


def test_the_design_matrix_has_a_row_for_each_point() -> None:
    table = pd.concat([unbalanced(seed) for seed in range(100)], ignore_index=True).dropna()
    made = model.estimable(
        table, model.checked_levels(table, FACTORS, None), model.chosen_terms(FACTORS, 2, None),
        order=2, reducible=False,
    )  # fmt: skip
    solved = fit.least_squares(centred(table["y"].to_numpy()), made)
    assert len(table) > 4000
    assert made.x.shape == (9, 8)
    assert solved.fitted.shape == solved.leverage.shape == (9,)


def test_points_are_found_in_the_order_of_their_levels() -> None:
    rng = np.random.default_rng(3)
    for levels in (2, 3, 40):
        table = pd.DataFrame(rng.integers(levels, size=(500, 9)) / 8, columns=list("abcdefghi"))
        found = runs.points_of(table, tuple(table))
        expected, first, of_run = np.unique(
            table.to_numpy(), axis=0, return_index=True, return_inverse=True
        )
        assert (found.of_run == of_run.reshape(-1)).all()
        assert (found.first == first).all()
        assert (found.levels(table, tuple(table)).to_numpy() == expected).all()


@pytest.mark.parametrize("seeding", ["independent", "common"])
def test_a_box_cox_profile_is_that_of_a_model_of_all_runs(seeding: str) -> None:
    """Of the terms, and with common random numbers of an own mean for each replicate."""
    rng = np.random.default_rng(5)
    points = pd.DataFrame(list(product((-1.0, 1.0), repeat=3)), columns=list(FACTORS))
    table = pd.concat([points.assign(replicate=r) for r in range(6)], ignore_index=True)
    noise = rng.normal(size=48) * 0.2 + 0.5 * rng.normal(size=6)[table["replicate"]]
    table["y"] = np.exp(2 + 0.3 * table["a"] - 0.1 * table["b"] * table["c"] + noise)
    table = table.sample(frac=1, random_state=1).reset_index(drop=True)
    found = analyse(table, FACTORS, "y", seeding=seeding)  # type: ignore[arg-type]
    _, x = of_runs(found)
    if seeding == "common":
        x = np.hstack([x, pd.get_dummies(found.table["replicate"], dtype=float).iloc[:, 1:]])
    logs = np.log(found.table["y"].to_numpy())
    logs -= logs.mean()
    powers = [-1.5, -0.2, 0.0, 0.7, 2.0]
    expected = []
    for power in powers:
        z = np.expm1(power * logs) / power if power else logs
        left = z - x @ np.linalg.lstsq(x, z, rcond=None)[0]
        expected.append(-24 * np.log((left**2).mean()))
    profile = box_cox(found, powers)
    np.testing.assert_allclose(profile["log_likelihood"], expected, rtol=1e-11)


def test_a_run_that_its_own_term_follows_has_no_standardised_residual() -> None:
    table = pd.DataFrame({"a": [0.0, 0.0, 1.0, 1.0, 0.5], "y": [1.0, 2.0, 3.0, 5.0, 4.0]})
    residuals = analyse(table, ["a"], "y").residuals
    assert residuals["standardised"].isna().tolist() == [False] * 4 + [True]
    assert residuals["residual"].iloc[4] == pytest.approx(0, abs=1e-12)


def test_verdicts_by_point_are_those_of_its_runs() -> None:
    """A run that has failed counts for the receivers that have not."""
    rng = np.random.default_rng(9)
    table = pd.DataFrame({
        "point": rng.permutation(np.repeat([3, 1, 2], 40)),
        "one.nees_position": rng.chisquare(3, 120), "two.nees_position": np.nan,
        "error": [None] * 118 + ["two failed", "both failed"],
    })  # fmt: skip
    table.loc[119, "one.nees_position"] = np.nan
    table["arm"] = table["point"] / 10
    verdicts = covariance.by_point(table, ["arm"])
    assert verdicts["point"].tolist() == [1, 2, 3]
    assert verdicts["arm"].tolist() == [0.1, 0.2, 0.3]
    for row in verdicts.itertuples():
        mine = table.loc[table["point"] == row.point, "one.nees_position"]
        assert row.words == str(consistency.of_runs(mine))
        assert row.mean_nees == pytest.approx(mine.mean(), rel=1e-14)


def drawn(x: Any, y: Any) -> Any:
    """The dots of some residuals y against fits x."""
    table = pd.DataFrame({"fit": x, "residual": y, "run_order": 1.0})
    found = replace(analyse(unbalanced(1), FACTORS, "y"), residuals=table)
    _, _, fits, _ = figures.plot_residuals(found)
    (dots,) = (line for line in fits.lines if line.get_marker() == ".")
    plt.close(fits.figure)
    return dots.get_xydata()


def test_of_many_points_those_are_drawn_that_can_be_seen() -> None:
    rng = np.random.default_rng(1)
    few = rng.normal(size=(2, figures.MOST_DOTS))
    assert (drawn(*few) == few.T).all()
    x, y = rng.normal(size=(2, 500_000))
    seen = drawn(x, y)
    assert figures.MOST_DOTS < len(seen) < figures.CELLS**2
    whole = np.column_stack([x, y])
    size = np.ptp(whole, axis=0) / figures.CELLS
    cells = [set(map(tuple, ((v - whole.min(axis=0)) // size).astype(int))) for v in (seen, whole)]
    assert len(cells[0] ^ cells[1]) < 10  # but for those on an edge
    assert set(map(tuple, seen)) <= set(map(tuple, whole))


def test_points_on_a_line_are_drawn_and_unknown_ones_are_not() -> None:
    x = np.linspace(0, 1, figures.MOST_DOTS + 1)
    unknown = np.append(x, np.nan)
    for dots in (drawn(unknown, np.ones_like(unknown)), drawn(np.ones_like(x), x)):
        assert len(dots) == figures.CELLS + 1
