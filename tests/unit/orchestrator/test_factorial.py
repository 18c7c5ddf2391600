from __future__ import annotations

import re
from itertools import product

import numpy as np
import pandas as pd
import pytest
from sblcosim.analysis.two_level.analysis import analyse
from sblcosim.analysis.two_level.box_cox import box_cox
from sblcosim.analysis.two_level.noise import lenth
from sblcosim.analysis.two_level.power import detectable
from sblcosim.analysis.two_level.sentences import answer
from sblcosim.errors import ConfigurationError
from scipy import stats
from statsmodels.regression.linear_model import OLS


def design(factors: str, replicates: int = 1, low: float = -1.0, high: float = 1.0):
    points = pd.DataFrame(list(product((low, high), repeat=len(factors))), columns=list(factors))
    return pd.concat([points.assign(replicate=r) for r in range(replicates)], ignore_index=True)


def noisy(factors: str = "abc", replicates: int = 4, seed: int = 1, **levels: float):
    table = design(factors, replicates, **levels)
    noise = np.random.default_rng(seed).normal(size=len(table))
    return table.assign(y=10 + noise)


def coded(table: pd.DataFrame, *names: str):
    middle, half = (table.max() + table.min()) / 2, (table.max() - table.min()) / 2
    return ((table - middle) / half)[list(names)].prod(axis=1)


def test_known_effects_come_back_exactly_whatever_the_levels():
    table = design("abc", 2, low=0.1, high=3.5)
    table["y"] = 5 + 1.5 * coded(table, "a") - 0.25 * coded(table, "b", "c")
    table["y"] += 1e-9 * np.arange(len(table))
    found = analyse(table, "abc", "y").effects["effect"]
    expected = {"a": 3.0, "b": 0, "c": 0, "a × b": 0, "a × c": 0, "b × c": -0.5}
    assert found.to_dict() == pytest.approx(expected, abs=1e-7)


def test_order_says_which_interactions_are_in_the_model():
    table = noisy("abcd")
    assert analyse(table, "abcd", "y", order=1).effects.index.tolist() == list("abcd")
    assert len(analyse(table, "abcd", "y", order=3).effects) == 4 + 6 + 4


def covered(error: str, centre: int, runs: int = 70) -> tuple[float, float]:
    """Share of intervals that hold the truth, with a large interaction outside of the model, and
    their mean width in units of the least one possible."""
    rng = np.random.default_rng(8)
    table = design("abc", 4)
    table = pd.concat([table, table[:centre].assign(a=0.0, b=0.0, c=0.0)], ignore_index=True)
    table["y"] = 5 + 1.5 * table["a"] + 2 * table["a"] * table["b"] * table["c"]
    inside, width = [], []
    for _ in range(runs):
        noisy_runs = table.assign(y=table["y"] + rng.normal(size=len(table)))
        found = analyse(noisy_runs, "abc", "y", error=error, confidence=0.9)
        assert found.error == error
        effects = found.effects.assign(true=[3.0, 0, 0, 0, 0, 0])
        inside.append(effects.eval("low < true < high"))
        width.append(effects["std_error"].mean() / (2 / np.sqrt(32)))
    return float(np.mean(inside)), float(np.mean(width))


@pytest.mark.parametrize("centre", [0, 3])
def test_intervals_from_the_pure_error_know_nothing_of_what_the_model_leaves_out(centre: int):
    share, width = covered("pure", centre)
    assert share == pytest.approx(0.9, abs=0.04)
    assert width == pytest.approx(1.0, abs=0.05)
    share, width = covered("residual", centre)
    assert share > 0.98
    assert width > 1.9


def test_the_error_is_the_scatter_about_the_means_of_the_points_as_far_as_there_are_runs():
    table = noisy("abc", 3)
    table.loc[[0, 5], "y"] = np.nan
    found = analyse(table, "abc", "y", order=1)
    left = table.dropna()
    pure = (left["y"] - left.groupby(["a", "b", "c"])["y"].transform("mean")) ** 2
    assert (found.error, found.df) == ("pure", 22 - 8)
    assert found.sigma == pytest.approx(np.sqrt(pure.sum() / 14))
    x = np.column_stack([np.ones(22), left[["a", "b", "c"]]])
    errors = 2 * found.sigma * np.sqrt(np.diag(np.linalg.inv(x.T @ x)))
    np.testing.assert_allclose(found.effects["std_error"], errors[1:])
    assert "errors from the scatter between replicates (pure error), 14 degrees" in found.text(
        verbose=True
    )
    other = analyse(table, "abc", "y", order=1, error="residual")
    assert (other.error, other.df, other.sigma) == ("residual", 22 - 4, other.rmse)
    told = other.text(verbose=True)
    assert "errors from the scatter about the model (residual, with its lack of fit), 18" in told
    assert found.rmse == other.rmse
    assert found.lack_of_fit == other.lack_of_fit


def test_without_replicates_the_error_is_the_scatter_about_the_model():
    table = noisy("abc", 1)
    found = analyse(table, "abc", "y", order=1)
    assert (found.error, found.df, found.sigma) == ("residual", 4, found.rmse)
    assert analyse(table, "abc", "y", order=3).error is None  # Lenth's


def test_centre_points_alone_are_replicates():
    # the error of an unreplicated design with centre points (Montgomery's chemical process)
    corners = design("ab").assign(y=[39.3, 40.9, 40.0, 41.5])
    centre = pd.DataFrame({"a": 0.0, "b": 0.0, "y": [40.3, 40.5, 40.7, 40.2, 40.6]})
    found = analyse(pd.concat([corners, centre]), "ab", "y", order=1)
    assert (found.error, found.df) == ("pure", 4)
    assert found.sigma**2 == pytest.approx(0.043)
    assert found.curvature is not None
    assert found.curvature.df_error == 4
    assert found.curvature.f == pytest.approx(4 * 5 * 0.035**2 / 9 / 0.043)


def test_the_spread_of_each_point_has_no_replicates_of_its_own():
    assert analyse(noisy("abc", 6), "abc", "y", transform="spread").error == "residual"


def test_with_common_numbers_lack_of_fit_is_never_in_the_error():
    table = noisy("abc", 5)
    bent = table.assign(y=table["y"] + 9 * table["a"] * table["b"] * table["c"])
    one, other = (analyse(t, "abc", "y", seeding="common") for t in (table, bent))
    assert one.error == other.error == "pure"
    np.testing.assert_allclose(one.effects["std_error"], other.effects["std_error"])
    with pytest.raises(ConfigurationError, match="error: must be pure with common random numbers"):
        analyse(table, "abc", "y", seeding="common", error="residual")


def test_intervals_hold_the_true_effect_as_often_as_they_say():
    inside = [
        analyse(noisy(seed=seed), "abc", "y", confidence=0.8).effects.eval("low < 0 < high")
        for seed in range(100)
    ]
    assert np.mean(inside) == pytest.approx(0.8, abs=0.04)


def test_predicted_r2_leaves_out_one_run_after_the_other():
    table = noisy("ab", 3)
    table["y"] += 2 * table["a"]
    x = np.column_stack([np.ones(len(table)), table["a"], table["b"]])
    press = 0.0
    for i in range(len(table)):
        kept = np.arange(len(table)) != i
        fit = OLS(table["y"][kept], x[kept]).fit()
        press += float(table["y"][i] - x[i] @ fit.params) ** 2
    found = analyse(table, "ab", "y", order=1)
    total = ((table["y"] - table["y"].mean()) ** 2).sum()
    assert found.press == pytest.approx(press, rel=1e-10)
    assert found.r2_predicted == pytest.approx(1 - press / total, rel=1e-10)


def test_shares_and_residual_make_up_the_whole():
    for seeding in ("independent", "common"):
        found = analyse(noisy(), "abc", "y", seeding=seeding)
        parts = found.anova.drop(index=["total", "lack of fit", "pure error"])
        assert parts["ss"].sum() == pytest.approx(found.anova.loc["total", "ss"])
        assert parts["df"].sum() == found.anova.loc["total", "df"] == found.runs - 1
        inner = found.anova.loc[["lack of fit", "pure error"]].sum()
        assert inner["ss"] == pytest.approx(found.anova.loc["residual", "ss"])
        assert inner["df"] == found.anova.loc["residual", "df"]


def test_lack_of_fit_is_that_of_a_hand_calculation():
    # means 1, 3, 5, 15, the runs half a unit below and above
    table = design("ab", 2).assign(y=[0.5, 2.5, 4.5, 14.5, 1.5, 3.5, 5.5, 15.5])
    found = analyse(table, "ab", "y", order=1).lack_of_fit
    # the interaction's contrast: (1 − 3 − 5 + 15)/4 = 2, so SS = 8·2² = 32 on 1; error 8·¼ on 4
    assert found is not None
    assert (found.ss, found.df, found.df_error) == (pytest.approx(32), 1, 4)
    assert found.f == pytest.approx(64)
    assert analyse(table, "ab", "y", order=2).lack_of_fit is None


def test_curvature_is_that_of_a_hand_calculation():
    # a 2² with five centre points (Montgomery's yield of a chemical process)
    corners = design("ab").assign(y=[39.3, 40.9, 40.0, 41.5])[["b", "a", "y"]]
    corners.columns = ["a", "b", "y"]
    centre = pd.DataFrame({"a": 0.0, "b": 0.0, "y": [40.3, 40.5, 40.7, 40.2, 40.6]})
    found = analyse(pd.concat([corners, centre]), "ab", "y")
    assert found.effects["effect"].tolist() == pytest.approx([1.55, 0.65, -0.05])
    # nF nC (40.425 − 40.46)²/(nF + nC) = 0.0027, against 0.172/4 of the centre points
    assert found.curvature is not None
    assert found.curvature.ss == pytest.approx(4 * 5 * 0.035**2 / 9)
    assert found.curvature.estimate == pytest.approx(0.035)
    assert found.rmse**2 == pytest.approx(0.043)
    assert found.curvature.f == pytest.approx(4 * 5 * 0.035**2 / 9 / 0.043)
    assert found.overall_mean == pytest.approx(40.425)


def test_replicate_errors_are_right_where_runs_share_their_noise_and_ols_is_not():
    # each replicate shifts all runs, and the effect of a, by amounts of its own
    rng = np.random.default_rng(5)
    table = design("abc", 20)
    ols, own, estimates = [], [], []
    for _ in range(100):
        shift, slope = rng.normal(0, 1, 20), rng.normal(0, 1, 20)
        r = table["replicate"].to_numpy()
        y = shift[r] + slope[r] * table["a"] + rng.normal(0, 0.1, len(table))
        runs = table.assign(y=y)
        ols.append(analyse(runs, "abc", "y").effects["std_error"])
        common = analyse(runs, "abc", "y", seeding="common").effects
        own.append(common["std_error"])
        estimates.append(common["effect"])
    true = pd.DataFrame(estimates).std()
    claimed = {name: pd.DataFrame(e).mean() / true for name, e in (("ols", ols), ("own", own))}
    assert claimed["own"].to_numpy() == pytest.approx(np.ones(6), abs=0.15)
    assert claimed["ols"]["b"] > 10
    assert claimed["ols"]["a"] < 0.75


def test_with_common_numbers_effects_are_means_over_replicates():
    table = noisy("ab", 5)
    found = analyse(table, "ab", "y", seeding="common")
    by_hand = table.groupby("replicate").apply(
        lambda runs: 2 * (runs["y"] * runs["a"]).mean(), include_groups=False
    )
    assert found.replicate_effects is not None
    np.testing.assert_allclose(found.replicate_effects["a"], by_hand)
    assert found.effects.loc["a", "effect"] == pytest.approx(by_hand.mean())
    assert found.effects.loc["a", "std_error"] == pytest.approx(by_hand.std() / np.sqrt(5))
    assert found.df == 4


def test_with_common_numbers_each_replicate_is_predicted_from_the_others():
    table = noisy("ab", 4)
    found = analyse(table, "ab", "y", order=1, seeding="common")
    press = 0.0
    for r in range(4):
        rest, own = table[table["replicate"] != r], table[table["replicate"] == r]
        x = [np.column_stack([np.ones(len(t)), t["a"], t["b"]]) for t in (rest, own)]
        press += float(((own["y"] - x[1] @ OLS(rest["y"], x[0]).fit().params) ** 2).sum())
    assert found.press == pytest.approx(press, rel=1e-10)


def test_order_of_the_rows_does_not_matter_with_common_numbers():
    table = noisy("abc", 6)
    mixed = table.sample(frac=1, random_state=2)
    one, other = (analyse(t, "abc", "y", seeding="common") for t in (table, mixed))
    pd.testing.assert_frame_equal(one.effects, other.effects)
    assert one.press == pytest.approx(other.press)
    np.testing.assert_allclose(
        one.residuals["residual"].to_numpy()[mixed.index], other.residuals["residual"]
    )


def test_lack_of_fit_over_replicates_is_rarely_found_where_there_is_none():
    rng = np.random.default_rng(7)
    table = design("abcd", 8)
    p = []
    for _ in range(200):
        shared = rng.normal(size=(8, 2))[table["replicate"]]
        y = shared[:, 0] + 2 * table["a"] + shared[:, 1] * table["a"] * table["b"] * table["c"]
        runs = table.assign(y=y + rng.normal(0, 0.3, len(table)))
        found = analyse(runs, "abcd", "y", seeding="common").lack_of_fit
        assert found is not None
        p.append(found.p)
    assert 0.02 < np.mean(np.array(p) < 0.05) < 0.09


def test_lack_of_fit_over_replicates_is_that_of_a_hand_calculation():
    table = noisy("abc", 6, seed=3)
    table["y"] += table["replicate"] * (1 + table["a"] * table["b"] * table["c"])
    by_replicate = {
        name: table.groupby("replicate").apply(
            lambda runs, name=name: (runs["y"] * runs[list(name)].prod(axis=1)).sum() / 8**0.5,
            include_groups=False,
        )
        for name in ("ab", "ac", "bc", "abc")
    }
    # a single contrast: Student's test of its mean
    single = analyse(table, "abc", "y", order=2, seeding="common").lack_of_fit
    t = stats.ttest_1samp(by_replicate["abc"], 0)
    assert single is not None
    assert (single.df, single.df_error) == (pytest.approx(1), pytest.approx(5))
    assert (single.f, single.p) == (pytest.approx(t.statistic**2), pytest.approx(t.pvalue))
    # several: Greenhouse and Geisser's ε of their covariance
    several = analyse(table, "abc", "y", order=1, seeding="common").lack_of_fit
    contrasts = np.column_stack(list(by_replicate.values()))
    covariance = np.cov(contrasts.T)
    df = np.trace(covariance) ** 2 / np.trace(covariance @ covariance)
    f = 6 * (contrasts.mean(axis=0) ** 2).sum() / np.trace(covariance)
    assert several is not None
    assert (several.df, several.df_error) == (pytest.approx(df), pytest.approx(5 * df))
    assert (several.f, several.p) == (
        pytest.approx(f), pytest.approx(stats.f.sf(f, df, 5 * df))
    )


@pytest.mark.parametrize("seeding", ["independent", "common"])
def test_degrees_of_freedom_are_those_of_a_textbook(seeding: str):
    # 2³ points, 4 replicates, order 1: 8 − 4 for lack of fit; 32 − 8 pure, or 3 · 7 in blocks
    found = analyse(noisy("abc", 4), "abc", "y", order=1, seeding=seeding)
    df = found.anova["df"]
    blocks = 3 if seeding == "common" else 0
    assert (df["lack of fit"], df["pure error"]) == (4, 24 - blocks)
    assert (df["residual"], df["total"]) == (28 - blocks, 31)
    assert df.get("replicates", 0) == blocks


def test_an_incomplete_replicate_is_left_out_and_counted():
    table = noisy("ab", 4)
    table.loc[5, "y"] = np.nan
    found = analyse(table, "ab", "y", seeding="common")
    assert (found.runs, found.dropped, found.df) == (12, 4, 2)
    assert "4 runs are left out" in str(found)
    assert analyse(table, "ab", "y").dropped == 1


@pytest.mark.parametrize("complete", [0, 1])
def test_common_random_numbers_need_two_complete_replicates(complete: int):
    table = noisy("ab", 3)
    table = table.drop([5 * replicate for replicate in range(complete, 3)])  # another point each
    with pytest.raises(ConfigurationError, match=f"at least two complete .*, got {complete}$"):
        analyse(table, "ab", "y", seeding="common")


def test_effects_of_a_log_are_ratios():
    table = noisy("ab", 10)
    table["y"] = np.exp(0.01 * table["y"]) * np.where(table["a"] > 0, 6.0, 2.0)
    found = analyse(table, "ab", "y", transform="log", practical=1.5)
    row = found.effects.loc["a"]
    assert row.ratio == pytest.approx(3, rel=0.02)
    assert row.ratio_low < 3 < row.ratio_high
    assert found.effects["verdict"].to_dict() == {
        "a": "matters", "b": "too small", "a × b": "too small"
    }
    assert "undecided" not in found.text()
    near = analyse(table, "ab", "y", transform="log", practical=row.ratio)
    assert near.effects.loc["a", "verdict"] == "undecided"
    meaning = "undecided: the interval includes effects that matter and effects that do not"
    assert meaning in near.text()


@pytest.mark.parametrize("seeding", ["independent", "common"])
def test_spread_finds_the_factor_that_scatters(seeding: str):
    table = noisy("abc", 60)
    table["y"] += (table["y"] - 10) * np.where(table["b"] > 0, 1.0, 0.0)
    found = analyse(table, "abc", "y", transform="spread", seeding=seeding)
    assert found.effects["ratio"].idxmax() == "b"
    assert found.effects.loc["b", "ratio_low"] < 2 < found.effects.loc["b", "ratio_high"]
    # ln s of each point, whatever the way to its error
    direct = np.log(table.groupby(["a", "b", "c"])["y"].std())
    assert found.overall_mean == pytest.approx(direct.mean())


def test_jackknife_knows_the_scatter_of_ln_s_where_runs_share_their_noise():
    rng = np.random.default_rng(3)
    table = design("ab", 30)
    errors, estimates = [], []
    for _ in range(100):
        shared = rng.normal(size=30)[table["replicate"]]
        y = np.where(table["a"] > 0, 2.0, 1.0) * shared + rng.normal(0, 0.3, len(table))
        found = analyse(
            table.assign(y=y), "ab", "y", transform="spread", seeding="common"
        ).effects
        errors.append(found["std_error"])
        estimates.append(found["effect"])
    ratio = pd.DataFrame(errors).mean() / pd.DataFrame(estimates).std()
    assert ratio.to_numpy() == pytest.approx(np.ones(3), abs=0.25)


def test_jackknife_leaves_out_one_replicate_after_the_other():
    table = noisy("ab", 5)
    found = analyse(table, "ab", "y", transform="spread", seeding="common")
    for point, values in table.groupby(["a", "b"])["y"]:
        y = values.to_numpy()
        whole = np.log(y.std(ddof=1))
        left_out = np.array([np.log(np.delete(y, i).std(ddof=1)) for i in range(5)])
        pseudo = 5 * whole - 4 * left_out
        mine = found.table[(found.table["a"] == point[0]) & (found.table["b"] == point[1])]
        np.testing.assert_allclose(mine["y"], pseudo - pseudo.mean() + whole, rtol=1e-12)


def test_box_cox_finds_the_logarithm_of_a_product():
    table = noisy("abc", 6)
    for seeding in ("independent", "common"):
        runs = table.assign(y=np.exp(table["a"] + 0.5 * table["b"] + 0.2 * (table["y"] - 10)))
        found = analyse(runs, "abc", "y", order=1, seeding=seeding)
        profile = box_cox(found)
        best = profile.loc[profile["log_likelihood"].idxmax(), "lambda"]
        assert best == pytest.approx(0, abs=0.15)
        assert profile.loc[profile["inside"], "lambda"].between(-0.5, 0.5).all()
        assert not profile.loc[profile["lambda"] == 1, "inside"].any()


def test_a_box_cox_interval_ends_where_the_likelihood_says_and_not_on_a_grid():
    table = noisy("abc", 60)
    runs = table.assign(y=np.exp(table["a"] + 0.5 * table["b"] + 0.2 * (table["y"] - 10)))
    profile = box_cox(analyse(runs, "abc", "y", order=1))
    inside = profile.loc[profile["inside"], "lambda"]
    height = profile["log_likelihood"].max() - profile["log_likelihood"]
    ends = height[profile["lambda"].isin([inside.min(), inside.max()])]
    assert ends.to_numpy() == pytest.approx(np.full(2, stats.chi2.ppf(0.95, 1) / 2), rel=1e-4)
    assert inside.min() < profile.loc[height.idxmin(), "lambda"] < inside.max()


def test_a_detectable_effect_is_found_as_often_as_it_says():
    first = analyse(noisy(), "abc", "y")
    sigma = first.rmse
    effect = detectable(first, 0.8)["a"] / sigma
    found = []
    for seed in range(150):
        table = noisy(seed=seed)
        table["y"] += effect / 2 * table["a"]
        found.append(analyse(table, "abc", "y").effects.loc["a", "significant"])
    assert np.mean(found) == pytest.approx(0.8, abs=0.08)


def test_means_and_points_are_those_of_the_table():
    table = noisy("ab", 3, low=2.0, high=6.0)
    found = analyse(table, "ab", "y")
    by_level = table.groupby("a")["y"].mean()
    main = found.main_effects[found.main_effects["factor"] == "a"]
    assert dict(zip(main["value"], main["mean"], strict=True)) == pytest.approx(by_level.to_dict())
    cells = found.interactions.set_index(["first_value", "second_value"])["mean"]
    pd.testing.assert_series_equal(
        cells, table.groupby(["a", "b"])["y"].mean(), check_names=False
    )
    assert found.points["runs"].tolist() == [3] * 4
    assert found.overall_mean == pytest.approx(table["y"].mean())


def test_a_run_order_is_drawn_where_none_is_stored():
    order = [analyse(noisy(), "abc", "y").residuals["run_order"].tolist() for _ in range(2)]
    assert order[0] == order[1] != sorted(order[0])
    assert sorted(order[0]) == list(range(1, 33))


def test_the_answer_names_the_largest_and_those_it_cannot_tell_from_the_last():
    table = noisy("abcd", 30)
    table["y"] += 5 * table["d"] + 3 * table["b"] + table["a"] + 0.98 * table["c"]
    table["y"] += 0.4 * table["a"] * table["d"]
    text = answer(analyse(table, "abcd", "y", unit="m"))
    number = r"\d+\.\d+"
    shown = re.fullmatch(
        rf"The y falls most with d from 1 to −1, by {number} m on average \(95 % interval {number} "
        rf"to {number}\); then with b from 1 to −1, by {number} m \({number} to {number}\); then "
        rf"with a from 1 to −1, by {number} m \(.*\), tied with c from 1 to −1, by {number} m "
        rf"\(.*\)\. The largest interaction is a × d \(\+{number} m, {number} to {number}\)\.",
        text,
    )
    assert shown is not None, text
    assert text in str(analyse(table, "abcd", "y", unit="m"))
    assert "<table" in analyse(table, "abcd", "y")._repr_html_()


def test_without_effects_the_answer_says_so():
    table = noisy(seed=4)
    assert answer(analyse(table, "abc", "y", order=1)) == (
        "No effect on the y can be told apart from noise."
    )
    table["y"] += table["a"]
    found = analyse(table, "abc", "y", order=1, practical=5, unit="m")
    assert answer(found) == (
        "No effect on the y is large enough to matter: those that can be told apart from noise are "
        "smaller than 5 m."
    )


def test_all_that_tie_for_the_first_place_are_said_to():
    table = noisy("abc", 30, seed=2)
    table["y"] += 3 * table["a"] - 3 * table["b"]
    text = answer(analyse(table, "abc", "y", order=1))
    first, _, second = text.partition(", tied with ")
    assert sorted([first.split()[5], second.split()[0]]) == ["a", "b"]
    assert "b from −1 to 1, by " in text
    assert text.endswith("Interactions are not in the model.")


@pytest.mark.parametrize(("transform", "what"), [("log", "geometric mean"), ("spread", "spread")])
def test_the_answer_about_a_logarithm_is_a_factor(transform: str, what: str):
    table = noisy("abc", 50)
    table["y"] = np.exp((table["y"] - table["y"].mean()) * 0.1 + 2 * table["a"])
    text = answer(analyse(table, "abc", "y", order=1, transform=transform, unit="m"))
    assert text.startswith(f"The {what} of the y falls most with a from 1 to −1, by a factor of ")
    assert " m " not in text


def test_an_unreplicated_answer_says_where_its_interval_comes_from():
    table = design("abcd")
    table["y"] = 5 * table["a"] + np.random.default_rng(1).normal(0, 0.1, 16)
    text = answer(analyse(table, "abcd", "y", order=4))
    assert "(95 % interval by Lenth's method " in text


def half_fraction():
    table = design("abc")
    return table.assign(d=table["a"] * table["b"] * table["c"], y=np.arange(8.0) ** 2)


def test_aliased_terms_are_named():
    with pytest.raises(ConfigurationError, match="c × d aliased with a × b") as caught:
        analyse(half_fraction(), "abcd", "y", order=2)
    assert "b × d aliased with a × c" in str(caught.value)
    assert str(caught.value).endswith("main effects alone can be told apart: order 1 (--order 1)")
    assert "\n" not in str(caught.value)


def test_without_an_order_a_fraction_is_analysed_as_far_as_it_goes():
    found = analyse(half_fraction(), "abcd", "y", unit="m")
    assert found.reduced
    assert len(found.effects) == 4
    text = found.text(verbose=True)
    assert "This holds if interactions that are not in the model are negligible" in text
    assert "a from b × c × d" in text
    assert "the design points cannot tell the interactions of two factors apart" in text
    assert not analyse(noisy(), "abc", "y").reduced


def test_terms_outside_of_the_model_that_cannot_be_told_apart_are_listed():
    found = analyse(half_fraction(), "abcd", "y", order=1)
    assert found.aliases == {
        "a": ("b × c × d",), "b": ("a × c × d",), "c": ("a × b × d",), "d": ("a × b × c",)
    }
    assert analyse(noisy(), "abc", "y").aliases == {}


@pytest.mark.parametrize("first", [1, -1])
@pytest.mark.parametrize("second", [1, -1])
def test_an_alias_from_the_product_of_two_generators_has_its_sign(first: int, second: int):
    table = design("abcd")
    table["e"] = first * table["a"] * table["b"] * table["c"]
    table["f"] = second * table["b"] * table["c"] * table["d"]
    table["y"] = np.random.default_rng(1).normal(size=16)
    found = analyse(table, "abcdef", "y", terms=[*"abcdef", ("a", "d")])
    own = "−" if first * second < 0 else ""
    assert f"{own}e × f" in found.aliases["a × d"]
    assert f"{own}d × e × f" in found.aliases["a"]


def test_a_point_too_few_names_what_it_costs():
    table = design("ab").assign(y=[1.0, 2.0, 4.0, 8.0])[:3]
    with pytest.raises(ConfigurationError, match="a × b aliased with mean and a and b"):
        analyse(table, "ab", "y", order=2)


@pytest.mark.parametrize(
    ("change", "options", "message"),
    [
        ({}, {"factors": ["a", "bb"]}, "factors: must be columns of the table, got 'bb'; did you"),
        ({}, {"factors": ["a", "a"]}, "factors: must be different columns, got 'a' twice"),
        ({}, {"factors": []}, "factors: must name at least one column"),
        ({}, {"response": "z"}, "response: must be columns of the table, got 'z'"),
        ({}, {"response": "a"}, "response: must not be a factor"),
        ({}, {"order": 4}, "order: must be from 1 to the number of factors, 3, got 4"),
        ({}, {"terms": ["a", "x"]}, "terms: must consist of the factors, got 'x'"),
        ({}, {"terms": ["a", "a"]}, "terms: must be different terms, got 'a' twice"),
        ({}, {"levels": {"q": (0, 1)}}, "levels: must be for the factors, got 'q'"),
        ({}, {"seeding": "comon"}, "seeding: must be independent or common, got 'comon'; did you"),
        ({}, {"practical": -1.0}, "practical: must be above 0, got -1"),
        ({}, {"practical": 0.9, "transform": "log"}, "practical: must be a ratio above 1"),
        ({}, {"confidence": 1.0}, "confidence: must be between 0 and 1"),
        ({"b": 3.0}, {}, "b: must have two different levels, got 3 only"),
        ({"b": [1.0, -1.0, 0.3, 1.0] * 8}, {}, "b: must be -1, 1 or, with all factors in"),
        ({"b": "high"}, {}, "b: must be a column of numbers"),
        ({"b": np.inf}, {}, "b: must be finite in all runs"),
        ({"y": 2.0}, {}, "y: must vary over the runs, got 2 in all"),
        ({"y": np.nan}, {}, "y: must be finite in some runs, got none"),
        ({"y": [-1.0, 2.0] * 16}, {"transform": "log"}, "y: must be positive for its logarithm"),
        ({"y": [1e200, 2e200] * 16}, {}, r"y: must be from 1e-60 to 1e\+60 in the run farthest "
                                         r"from 0, got 2e\+200; use another unit, or the"),
        ({"y": [1e-300, 2e-300] * 16}, {"transform": "spread"}, "y: must be from 1e-60 to "),
        ({"replicate": 0}, {"seeding": "common"}, "replicate: must have each design point once"),
    ],
)  # fmt: skip
def test_what_cannot_be_analysed_is_refused_in_one_line(change, options, message):
    given = {"factors": ["a", "b", "c"], "response": "y", **options}
    with pytest.raises(ConfigurationError, match=message) as caught:
        analyse(noisy().assign(**change), **given)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("seeding", ["independent", "common"])
@pytest.mark.parametrize("unit", [1e-59, 1e59])
def test_the_unit_of_the_response_changes_no_verdict(unit: float, seeding: str):
    table = noisy()
    y = table["y"] / table["y"].abs().max()
    one, other = (
        analyse(table.assign(y=values), ["a", "b", "c"], "y", seeding=seeding).effects
        for values in (y, unit * y)
    )
    assert (one["significant"] == other["significant"]).all()
    assert other["p"].to_numpy() == pytest.approx(one["p"].to_numpy(), rel=1e-6)


@pytest.mark.parametrize("seeding", ["independent", "common"])
def test_rounding_is_not_taken_for_an_effect(seeding: str):
    # a response without noise, such as an availability
    table = design("abc", 5)
    table["y"] = 0.9 - 0.1 * table["b"] / 3
    found = analyse(table, "abc", "y", seeding=seeding)
    effects = found.effects
    assert effects.index[effects["significant"]].tolist() == ["b"]
    assert effects.loc["a", "effect"] == 0
    assert effects["std_error"].eq(0).all()
    assert found.lack_of_fit is None
    assert answer(found).startswith("The y falls most with b from −1 to 1, by 0.0667 on average")
    assert "a from" not in answer(found)


def test_lenth_needs_three_effects():
    with pytest.raises(ConfigurationError, match="at least 3, got 2"):
        lenth(np.array([1.0, 2.0]))
