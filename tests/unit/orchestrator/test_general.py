from __future__ import annotations

import dataclasses
from collections.abc import Callable
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
import pytest
from sblcosim.analysis.common.bounds import runs_for_t, runs_to_see
from sblcosim.analysis.common.options import Options
from sblcosim.analysis.levels.analysis import GeneralFactorial, analyse
from sblcosim.analysis.levels.medians import median_interval, median_pairs, median_table
from sblcosim.errors import ConfigurationError
from scipy import stats
from seams import Seam
from statsmodels.formula.api import ols
from statsmodels.stats.anova import AnovaRM, anova_lm

AWKWARD = "C(type, Sum) ~ `x` + 1"
Draw = Callable[[np.random.Generator, int], np.ndarray]


def crossed(seed: int = 1, runs: int = 400) -> pd.DataFrame:
    """Unbalanced runs of three factors, numbers, words and truth."""
    rng = np.random.default_rng(seed)
    table = pd.DataFrame({
        "gps": rng.choice([5.0, 0.1, 1.0], runs, p=[0.4, 0.3, 0.3]),
        AWKWARD: rng.choice(["buoy", "raft", "ship", "quay"], runs),
        "gated": rng.choice([True, False], runs),
    })
    rough = table[AWKWARD] == "ship"
    return table.assign(y=10 + table["gps"] * (1 + 0.4 * rough) + rng.normal(0, 1, runs))


FACTORS = ["gps", AWKWARD, "gated"]


@pytest.fixture(scope="module")
def analysis() -> GeneralFactorial:
    return analyse(crossed(), FACTORS, "y", unit="m", units={"gps": "m"})


def replicates(count: int = 12) -> pd.DataFrame:
    """Runs of common random numbers: 3 × 4 design points, with a term of each replicate."""
    rng = np.random.default_rng(3)
    index = pd.MultiIndex.from_product(
        [range(count), list("abc"), range(4)], names=["replicate", "A", "B"]
    )
    table = index.to_frame(index=False)
    shared = rng.normal(0, 5, count)[table["replicate"]]
    own = table["B"] * rng.normal(1, 0.4, len(table)) + (table["A"] == "b")
    return table.assign(y=shared + own)


@pytest.mark.parametrize("typ", [2, 3])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_sums_of_squares_are_those_of_statsmodels_over_the_runs(typ: int, order: int) -> None:
    table = crossed()
    anova = analyse(table, FACTORS, "y", order=order, typ=typ).anova
    safe = table.set_axis(["a", "b", "c", "y"], axis=1)
    terms = [":".join(f"C({name}, Sum)" for name in term)
             for n in range(1, order + 1) for term in combinations("abc", n)]
    expected = anova_lm(ols("y ~ " + " + ".join(terms), safe).fit(), typ=typ).loc[terms]
    mine = anova.head(len(terms))
    for column, theirs in (("df", "df"), ("sum_sq", "sum_sq"), ("F", "F"), ("p", "PR(>F)")):
        np.testing.assert_allclose(mine[column], expected[theirs], rtol=1e-8)


def test_lack_of_fit_is_what_the_missing_interactions_explain() -> None:
    full = analyse(crossed(), FACTORS, "y", order=3).anova
    less = analyse(crossed(), FACTORS, "y", order=2).anova
    three = full.index[6]
    assert less.loc["lack of fit", "sum_sq"] == pytest.approx(full.loc[three, "sum_sq"])
    assert less.loc["lack of fit", "p"] == pytest.approx(full.loc[three, "p"])
    assert less.loc["pure error", "sum_sq"] == pytest.approx(full.loc["residual", "sum_sq"])


def test_means_are_the_model_over_all_combinations(analysis: GeneralFactorial) -> None:
    safe = crossed().set_axis(["a", "b", "c", "y"], axis=1)
    fit = ols("y ~ (C(a) + C(b) + C(c)) ** 2", safe).fit()
    grid = pd.MultiIndex.from_product([*analysis.levels.values()], names=["a", "b", "c"])
    grid = grid.to_frame(index=False)
    grid["y"] = fit.predict(grid)
    for name, letter in zip(FACTORS, "abc", strict=True):
        mine = analysis.means[analysis.means["factor"] == name].set_index("level")["mean"]
        expected = grid.groupby(letter)["y"].mean()
        np.testing.assert_allclose(mine, expected.reindex(mine.index), rtol=1e-9)
    cells = analysis.cells[analysis.cells["first"].eq("gps") & analysis.cells["second"].eq("gated")]
    expected = grid.groupby(["a", "c"])["y"].mean()
    for row in cells.itertuples():
        assert row.mean == pytest.approx(expected[row.first_level, row.second_level])
        assert row.low < row.mean < row.high


def test_intervals_of_one_factor_are_those_of_welch() -> None:
    table = crossed()
    found = analyse(table, ["gps"], "y")
    groups = {level: own["y"].to_numpy() for level, own in table.groupby("gps")}
    for row in found.pairs.itertuples():
        test = stats.ttest_ind(groups[row.one], groups[row.other], equal_var=False)
        interval = test.confidence_interval(1 - 0.05 / 3)
        assert (row.low, row.high) == pytest.approx((interval.low, interval.high))
        assert row.p == pytest.approx(min(1, 3 * test.pvalue))
    for row in found.means.itertuples():
        interval = stats.ttest_1samp(groups[row.level], 0).confidence_interval()
        assert (row.low, row.high) == pytest.approx((interval.low, interval.high))


def test_single_runs_take_the_scatter_about_the_model() -> None:
    rng = np.random.default_rng(5)
    grid = pd.MultiIndex.from_product([range(4), range(5)], names=["a", "b"]).to_frame(index=False)
    table = grid.assign(y=grid["a"] + rng.normal(0, 1, 20))
    found = analyse(table, ["a", "b"], "y", order=1)
    fit = ols("y ~ C(a) + C(b)", table).fit()
    row = found.pairs.iloc[0]
    expected = fit.t_test("C(a)[T.1] = 0")
    assert row["difference"] == pytest.approx(-expected.effect[0])
    assert row["std_error"] == pytest.approx(expected.sd.item())
    assert row["df"] == pytest.approx(fit.df_resid)
    assert "No combination of levels has two runs" in found.text(verbose=True)


def test_terms_of_common_random_numbers_are_those_of_repeated_measures() -> None:
    table = replicates()
    anova = analyse(table, ["A", "B"], "y", seeding="common").anova
    expected = AnovaRM(table, "y", "replicate", within=["A", "B"]).fit().anova_table
    np.testing.assert_allclose(anova["F"].head(3), expected["F Value"], rtol=1e-9)
    # Greenhouse and Geisser's ε of B, from the covariances of its levels' means (Box 1954)
    means = table.pivot_table(index="replicate", columns="B", values="y").to_numpy()
    s = np.cov(means, rowvar=False)
    centred = s - s.mean(0) - s.mean(1)[:, None] + s.mean()
    epsilon = np.trace(centred) ** 2 / (3 * (centred**2).sum())
    assert anova.loc["B", "epsilon"] == pytest.approx(epsilon)
    f = anova.loc["B", "F"]
    assert anova.loc["B", "p"] == pytest.approx(stats.f.sf(f, 3 * epsilon, 33 * epsilon))


def test_corrected_degrees_of_freedom_are_those_of_term_and_error() -> None:
    """Greenhouse and Geisser's ε is a factor of both; each one left out gives another p."""
    random = np.random.default_rng(12)
    spread = np.array([0.2, 0.2, 0.2, 3.0])  # a level with most of the scatter: ε is small
    runs = 9
    y = np.array([0.0, 0.3, 0.5, 2.6]) + random.normal(0, 1.0, (runs, 4)) * spread
    table = pd.DataFrame({
        "replicate": np.repeat(np.arange(runs), 4), "a": np.tile(np.arange(4), runs),
        "y": y.ravel(),
    })
    row = analyse(table, ["a"], "y", seeding="common").anova.loc["a"]
    s = np.cov(y, rowvar=False)
    centred = s - s.mean(0) - s.mean(1)[:, None] + s.mean()
    epsilon = np.trace(centred) ** 2 / (3 * (centred**2).sum())
    assert row["epsilon"] == pytest.approx(epsilon, rel=1e-9)
    assert 1 / 3 < epsilon < 0.4
    p = {(one, other): stats.f.sf(row["F"], 3 * one, 3 * (runs - 1) * other)
         for one in (1.0, epsilon) for other in (1.0, epsilon)}
    right = p.pop((epsilon, epsilon))
    assert row["p"] == pytest.approx(right, rel=1e-9)
    assert 0.005 < right < 0.2
    assert min(abs(other / right - 1) for other in p.values()) > 0.1


def test_pairs_of_common_random_numbers_are_paired() -> None:
    table = replicates()
    found = analyse(table, ["A", "B"], "y", seeding="common")
    means = table.pivot_table(index="replicate", columns="A", values="y")
    for row in found.pairs[found.pairs["factor"] == "A"].itertuples():
        test = stats.ttest_rel(means[row.one], means[row.other])
        interval = test.confidence_interval(1 - 0.05 / 3)
        assert (row.low, row.high) == pytest.approx((interval.low, interval.high))
    alone = analyse(table, ["A", "B"], "y")
    assert (found.pairs["std_error"] < alone.pairs["std_error"] / 3).all()


def test_an_incomplete_replicate_is_left_out_and_counted() -> None:
    table = replicates()
    table.loc[5, "y"] = np.nan
    found = analyse(table, ["A", "B"], "y", seeding="common")
    assert (found.runs, found.dropped) == (132, 12)
    text = found.text()
    assert "12 runs are left out: they have no finite response, or an incomplete replicate." in text


def test_levels_whose_pairs_differ_are_not_said_to_be_alike() -> None:
    """Few common runs give the medians of levels no interval, and those of pairs a narrow one."""
    rng = np.random.default_rng(3)
    rows = [
        (number, a, b, term + 2.0 * (a == "p") + rng.normal(0, 0.05) + 500.0 * (
            (number, a, b) == (6, "p", "u")
        ))
        for number, term in enumerate(rng.lognormal(0, 2.0, 6), 1) for a in "pq" for b in "uvw"
    ]  # fmt: skip
    table = pd.DataFrame(rows, columns=["replicate", "a", "b", "y"])
    found = analyse(table, ["a", "b"], "y", seeding="common")
    pair = found.judged_pairs.set_index("factor").loc["a"]
    assert found.medians["all_low"].isna().all()
    said = found.text()
    assert f"By the medians of the pairs, a: p to q, less by {pair.difference:.3g} (" in said
    assert "No two levels of b surely differ in the median." in said


def test_interactions_that_cannot_be_estimated_are_left_out_and_named() -> None:
    table = crossed()
    table = table[~((table["gps"] == 5) & (table[AWKWARD] == "raft"))]
    found = analyse(table, FACTORS, "y")
    assert found.left_out == (f"gps × {AWKWARD}",)
    assert max(map(len, found.terms)) == 1
    assert f"Main effects only: the combinations of levels with runs cannot estimate gps × " \
        f"{AWKWARD}." in found.text()
    own = found.cells[found.cells["first"].eq("gps") & found.cells["second"].eq(AWKWARD)]
    missing = own[own["runs"] == 0]
    assert missing[["first_level", "second_level"]].values.tolist() == [[5.0, "raft"]]
    assert missing["mean"].isna().all()
    assert own.loc[own["runs"] > 0, "mean"].notna().all()


def test_a_random_part_of_a_grid_still_has_main_effects() -> None:
    grid = pd.MultiIndex.from_product([range(4), range(3), range(5)], names=["a", "b", "c"])
    part = grid.to_frame(index=False).sample(30, random_state=1)
    rng = np.random.default_rng(2)
    table = pd.concat([part] * 4).assign(y=lambda t: 2.0 * t["b"] + rng.normal(0, 0.5, len(t)))
    found = analyse(table, ["a", "b", "c"], "y")
    assert found.left_out
    fit = ols("y ~ C(a, Sum) + C(b, Sum) + C(c, Sum)", table).fit()
    expected = anova_lm(fit, typ=2)["sum_sq"].head(3)
    np.testing.assert_allclose(found.anova["sum_sq"].head(3), expected, rtol=1e-9)
    assert found.pairs.loc[found.pairs["factor"] == "b", "differs"].all()


def test_levels_keep_the_order_of_the_table_or_the_one_given() -> None:
    table = crossed()
    assert analyse(table, FACTORS, "y").levels["gps"] == tuple(pd.unique(table["gps"]))
    given = {"gps": [0.1, 1.0, 5.0, 20.0]}
    found = analyse(table, FACTORS, "y", levels=given)
    assert found.levels["gps"] == (0.1, 1.0, 5.0)
    assert found.empty == ("gps 20.0",)
    assert "Levels without a run that counts: gps 20.0." in found.text(verbose=True)
    assert found.means["level"].head(3).tolist() == [0.1, 1.0, 5.0]


def test_the_order_of_runs_and_levels_changes_no_number(analysis: GeneralFactorial) -> None:
    shuffled = crossed().sample(frac=1, random_state=4)
    found = analyse(shuffled, FACTORS, "y")
    pd.testing.assert_frame_equal(found.anova, analysis.anova, rtol=1e-9)
    same = found.means.set_index(["factor", "level"])["mean"]
    for row in analysis.means.itertuples():
        assert same[row.factor, row.level] == pytest.approx(row.mean)


def test_the_share_of_lost_runs_stands_beside_every_mean() -> None:
    table = crossed()
    table["lost"] = (table["gps"] == 5) & (np.arange(len(table)) % 2 == 0)
    table.loc[table.index[table["gps"] == 1][:3], "y"] = np.nan
    found = analyse(table, FACTORS, "y")
    mine = found.means.set_index(["factor", "level"])["lost"]
    gone = table["lost"] | table["y"].isna()
    for name in FACTORS:
        for level, share in gone.groupby(table[name]).mean().items():
            assert mine[name, level] == pytest.approx(share)
    two = found.cells[found.cells["first"].eq("gps") & found.cells["second"].eq("gated")]
    expected = gone.groupby([table["gps"], table["gated"]]).mean()
    for row in two.itertuples():
        assert row.lost == pytest.approx(expected[row.first_level, row.second_level])
    assert found.dropped == 3
    renamed = analyse(table.rename(columns={"lost": "ekf.lost"}), FACTORS, "y", lost="ekf.lost")
    pd.testing.assert_frame_equal(renamed.means, found.means)


def test_logarithms_are_ratios() -> None:
    table = crossed()
    plain = analyse(table.assign(y=np.log(table["y"])), FACTORS, "y")
    found = analyse(table, FACTORS, "y", transform="log", unit="m")
    pd.testing.assert_frame_equal(found.anova, plain.anova)
    np.testing.assert_allclose(found.pairs["ratio_low"], np.exp(plain.pairs["low"]))
    assert "by a factor of 1." in found.text()
    assert "The geometric mean of the y falls most with gps from 5 to 0.1" in found.text()


def test_the_answer_names_the_factor_and_the_levels(analysis: GeneralFactorial) -> None:
    pairs = analysis.pairs
    row = pairs[(pairs["one"] == 0.1) & (pairs["other"] == 5.0)
                | (pairs["one"] == 5.0) & (pairs["other"] == 0.1)].iloc[0]
    low, size, high = sorted(abs(row[["low", "difference", "high"]]))
    text = analysis.text()
    assert text.startswith(f"The y falls most with gps from 5 m to 0.1 m, by {size:.2f} m (95 % "
                           f"simultaneous interval {low:.2f} to {high:.2f})")
    assert "No two levels of gated can be told apart." in text
    assert f"The largest interaction is gps × {AWKWARD} (" in text
    alike = analyse(crossed(), ["gated"], "y").text()
    assert alike.startswith("No two levels of a factor can be told apart by the y.")


def test_levels_as_good_as_the_best_are_named() -> None:
    rng = np.random.default_rng(6)
    table = pd.DataFrame({"a": np.repeat(list("pqr"), 50)})
    table["y"] = np.repeat([5.0, 1.0, 1.0], 50) + rng.normal(0, 1, 150)
    text = analyse(table, ["a"], "y").text()
    means = table.groupby("a")["y"].mean()
    best, other = ("q", "r") if means["q"] < means["r"] else ("r", "q")
    assert text.startswith(f"The y falls with a from p to {best}, by ")
    assert f", where {other} cannot be told apart from the better level" in text


def test_labels_are_for_people_only() -> None:
    found = analyse(crossed(), FACTORS, "y", labels={"gps": "GPS error"}, label="total error")
    assert set(found.means["factor"]) == set(FACTORS)
    assert "The total error falls most with GPS error" in found.text()
    assert "GPS error × gated" in found.readable.anova.index
    assert set(found.readable.cells["first"]) == {"GPS error", AWKWARD}
    assert "GPS error" in found._repr_html_()
    assert repr(found).startswith("<GeneralFactorial of 400 runs, y by gps (3)")


def test_text_fits_a_terminal(analysis: GeneralFactorial) -> None:
    for width in (60, 80, 120):
        lines = analysis.text(verbose=True, width=width).splitlines()
        assert max(map(len, lines)) <= width
    assert "differences" not in analysis.text().lower()
    assert "Differences of the means of y [m], 95 % intervals for all pairs" in \
        analysis.text(verbose=True)


def test_heavy_tails_are_recognised_and_said() -> None:
    rng = np.random.default_rng(7)
    cell = np.repeat(np.arange(4), 40)
    normal = rng.normal(10, 1, 160)
    bad = np.where(rng.random(160) < 0.05, 20.0, 0.0)
    tables = {"clean": normal, "bad": normal + bad, "skewed": np.exp(rng.normal(0, 1, 160))}
    found = {name: analyse(pd.DataFrame({"a": cell, "y": y}), ["a"], "y")
             for name, y in tables.items()}
    assert (found["clean"].heavy, found["bad"].heavy, found["skewed"].heavy) == (False, True, True)
    assert found["bad"].far == pytest.approx((bad > 0).mean())
    assert "Heavy tails" not in found["clean"].text()
    assert "Heavy tails: 5.6 % of the runs lie more than 5 robust standard deviations" in \
        found["bad"].text().replace(f"{100 * (bad > 0).mean():.1f} %", "5.6 %")
    assert "transform log compares typical runs" in found["skewed"].text()
    assert "replay" not in found["bad"].text()
    named = dataclasses.replace(found["bad"], worst_run="0123456789abcdef").text()
    assert "Run 0123456789abcdef is the largest: sblcosim replay RESULTS 0123456789abcdef." in named
    assert "transform log" not in found["bad"].text()
    assert "Skewed runs" not in found["clean"].text()
    needed = runs_for_t(found["skewed"].skewness)
    assert f"need about {needed} runs at each level" in found["skewed"].text()


def test_normal_runs_are_hardly_ever_called_heavy() -> None:
    rng = np.random.default_rng(8)
    heavy = 0
    for _ in range(150):
        table = pd.DataFrame({"a": np.repeat(np.arange(6), 10), "y": rng.normal(size=60)})
        heavy += analyse(table, ["a"], "y").heavy
    assert heavy <= 8


def test_text_says_how_many_runs_it_takes_to_see_a_bad_one() -> None:
    assert runs_to_see(0.05, 0.05) == 59
    assert 0.95**59 <= 0.05 < 0.95**58
    for each in (85, 86):
        table = pd.DataFrame({"a": np.repeat(np.arange(4), each)})
        table["y"] = np.random.default_rng(9).normal(size=len(table))
        found = analyse(table, ["a"], "y")
        assert found.runs_needed == 86  # ln(0.05/4)/ln(0.95) = 85.4
        words = "each level needs 86 runs. The level with the fewest has 85."
        assert (words in found.text()) == (each < 86)


def test_runs_for_t_are_cochran_s() -> None:
    assert (runs_for_t(1.0), runs_for_t(2.0), runs_for_t(0.0)) == (25, 100, 0)


def test_a_million_runs_need_no_design_matrix_of_runs() -> None:
    runs = 1_000_000
    rng = np.random.default_rng(10)
    table = pd.DataFrame({"a": rng.integers(0, 4, runs), "b": rng.integers(0, 5, runs),
                          "c": rng.integers(0, 12, runs)})
    table["y"] = table["a"] + rng.normal(size=runs)
    found = analyse(table, ["a", "b", "c"], "y")
    assert (found.runs, found.combinations) == (runs, 240)
    gaps = found.pairs[found.pairs["factor"] == "a"]
    assert (gaps["low"] < gaps["one"].astype(float) - gaps["other"].astype(float)).all()
    assert (gaps["high"] > gaps["one"].astype(float) - gaps["other"].astype(float)).all()


def bad_tables() -> dict[str, tuple[pd.DataFrame, dict[str, object], str]]:
    table = crossed()
    missing = table.assign(gps=table["gps"].where(table.index > 0))
    same = table.assign(copy=table["gps"])
    pair = pd.DataFrame({"a": [0, 0, 1, 1], "b": [0, 1, 0, 1], "y": [1.0, 2.0, 3.0, 5.0]})
    return {
        "no column": (table, {"factors": ["gpss"]}, "factors: must be columns of the table, got "
                      "'gpss'; did you mean 'gps'?"),
        "level": (table, {"levels": {"gps": [0.1, 1.0]}}, "gps: must be one of 0.1, 1.0, got"),
        "levels of": (table, {"levels": {"gp": [1]}}, "levels: must be for the factors, got 'gp'"),
        "twice": (table, {"levels": {"gps": [0.1, 0.1, 1, 5]}}, "must be different, got 0.1 twice"),
        "missing": (missing, {}, "gps: must have a level in every run, got a missing value"),
        "aliased": (same, {"factors": ["gps", "copy"]}, "factors: must be told apart by the 3"),
        "one level": (table[table["gps"] == 1], {}, "gps: must have two different levels"),
        "saturated": (pair, {"factors": ["a", "b"]}, "runs: must be more than the 4 coefficients"),
        "typ": (table, {"typ": 1}, "typ: must be 2 or 3, got 1"),
        "order": (table, {"order": 4}, "order: must be from 1 to the number of factors, 3, got 4"),
        "transform": (table, {"transform": "spread"}, "transform: must be none or log, got"),
        "negative": (table.assign(y=-table["y"]), {"transform": "log"}, "y: must be positive"),
        "lost": (table, {"lost": "ekf.lost"}, "lost: must be a column of the table"),
        "labels": (table, {"labels": {"gp": "x"}}, "labels: must be for the factors, got 'gp'"),
        "seeding": (table, {"seeding": "common"}, "replicate: must be a column of the table"),
        "words": (table.assign(y="far"), {}, "y: must be a column of numbers"),
        "huge": (table.assign(y=1e200 * table["y"]), {}, "y: must be from 1e-60 to 1e+60 in the"),
        "tiny": (table.assign(y=1e-200 * table["y"]), {}, "y: must be from 1e-60 to 1e+60 in the"),
        "many": (table.assign(gps=range(400)), {}, "gps: must have at most 100 levels, got 400"),
        "exact": (pd.concat([pair.assign(y=pair["a"] * 1.0)] * 3), {"factors": ["a", "b"]},
                  "response: must scatter about the model"),
    }


@pytest.mark.parametrize("case", bad_tables())
def test_mistakes_are_named_in_one_line(case: str) -> None:
    table, options, message = bad_tables()[case]
    arguments = {"factors": FACTORS, **options}
    with pytest.raises(ConfigurationError) as caught:
        analyse(table, response="y", **arguments)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_a_model_that_is_too_large_is_refused(order: int, seam: Seam) -> None:
    columns = {1: 1 + 2 + 3 + 1, 2: 7 + 6 + 2 + 3, 3: 24}[order]
    seam.tuned(design_numbers=columns * 24)
    analyse(crossed(), FACTORS, "y", order=order)
    seam.tuned(design_numbers=columns * 24 - 1)
    with pytest.raises(ConfigurationError) as caught:
        analyse(crossed(), FACTORS, "y", order=order)
    assert str(caught.value) == (
        f"order: must make a design matrix of at most {columns * 24 - 1:,} numbers, got {columns} "
        "columns for 24 combinations of levels; use a lower order"
    )


def normal(rng: np.random.Generator, runs: int) -> np.ndarray:
    return rng.normal(0, 1, runs)


def skewed(rng: np.random.Generator, runs: int) -> np.ndarray:
    return np.exp(rng.normal(0, 1, runs)) - np.exp(0.5)


def contaminated(rng: np.random.Generator, runs: int) -> np.ndarray:
    return rng.normal(0, np.where(rng.random(runs) < 0.05, 10, 1))


def coverage(draw: Draw, sizes: list[int], scale: list[float], times: int, common: bool) -> float:
    """Share of experiments in which all pairs' intervals hold the true difference, zero."""
    rng = np.random.default_rng(11)
    levels = np.repeat(np.arange(len(sizes)), sizes)
    held = 0
    for _ in range(times):
        y = draw(rng, len(levels)) * np.array(scale)[levels]
        table = pd.DataFrame({"a": levels, "y": y})
        if common:
            table["replicate"] = np.concatenate([np.arange(n) for n in sizes])
            table["y"] += 3 * rng.normal(size=sizes[0])[table["replicate"]]
        pairs = analyse(table, ["a"], "y", seeding="common" if common else "independent").pairs
        held += not pairs["differs"].any()
    return held / times


def test_simultaneous_intervals_hold_all_at_once() -> None:
    # of 100 experiments a share of 95 % has a standard error of 2.2 %; unadjusted it is 80 %
    assert coverage(normal, [20] * 4, [1] * 4, 100, False) >= 0.89
    assert coverage(normal, [10, 20, 20, 40], [4, 1, 1, 1], 100, False) >= 0.89
    assert coverage(skewed, [20] * 4, [1] * 4, 100, False) >= 0.89


EQUAL, UNEQUAL = [1.0] * 4, [4.0, 2.0, 1.0, 1.0]


@pytest.mark.slow
@pytest.mark.parametrize(("draw", "sizes", "scale", "common", "least", "most"), [
    (normal, [20] * 4, EQUAL, False, 0.94, 0.97),
    (normal, [20] * 4, EQUAL, True, 0.94, 0.97),
    (normal, [10, 20, 40, 80], UNEQUAL, False, 0.94, 0.975),
    (normal, [20] * 12, [1.0] * 12, False, 0.94, 0.975),
    (skewed, [20] * 4, EQUAL, False, 0.94, 1),
    (skewed, [20] * 4, EQUAL, True, 0.94, 1),
    # no t interval holds here; logarithms do, and the text says so
    (skewed, [20] * 4, [1.0, 2.0, 4.0, 8.0], False, 0.80, 0.92),
    (contaminated, [20] * 4, EQUAL, False, 0.94, 1),
    (contaminated, [20] * 4, UNEQUAL, False, 0.94, 1),
    (contaminated, [10, 20, 40, 80], UNEQUAL, False, 0.94, 1),
])
def test_coverage(
    draw: Draw, sizes: list[int], scale: list[float], common: bool, least: float, most: float
) -> None:
    share = coverage(draw, sizes, scale, 2000, common)
    print(f"{draw.__name__}, {sizes}, {scale}, common {common}: {share:.1%}")
    assert least <= share <= most


def test_a_single_run_that_has_run_away_is_told() -> None:
    """Too few runs at a level to speak of tails, and one of them is a thousand times too large."""
    rng = np.random.default_rng(3)
    table = pd.DataFrame({"a": np.repeat(["x", "y"], 8), "y": rng.uniform(1.0, 3.0, 16)})
    assert "times the median" not in analyse(table, ["a"], "y").text()
    table.loc[3, "y"] = 2436.0
    found = analyse(table, ["a"], "y", unit="m")
    assert "One run has 2,436 m, " in found.text()
    assert "Transform log" in found.text()
    assert "times the median" not in analyse(table, ["a"], "y", transform="log").text()


def test_medians_lead_where_a_run_ran_away_and_no_bound_is_negative() -> None:
    rng = np.random.default_rng(5)
    table = pd.DataFrame({"a": np.repeat(["x", "y"], 40), "y": rng.uniform(1.0, 3.0, 80)})
    table.loc[40:, "y"] += 5.0
    plain = analyse(table, ["a"], "y", unit="m")
    assert not plain.by_medians
    assert not plain.text().startswith("The means depend")
    table.loc[3, "y"] = 2436.0
    found = analyse(table, ["a"], "y", unit="m")
    first, *_ = found.text().splitlines()
    assert first.startswith("The means depend on few runs, so the medians come first. The median")
    assert "intervals of each level alone by order statistics:" in found.text()
    alone, together = (found.medians[[low, high]].to_numpy() for low, high in
                       (("low", "high"), ("all_low", "all_high")))
    assert (together[:, 0] < alone[:, 0]).all()
    assert (together[:, 1] > alone[:, 1]).all()
    assert "a from y, 7" in first
    assert "to x, " in first
    mean: Any = found.means.set_index("level").loc["x"]
    assert np.isnan(mean["low"])
    assert np.isnan(mean["high"])
    assert "A mean without an interval (–) is unknown" in found.text()
    assert "−" not in found.text().partition("intervals, and the share")[2]
    # what may be negative keeps its interval
    negative = analyse(table.assign(y=table["y"] - 2.0), ["a"], "y")
    assert (negative.means["low"] < 0).any()


@pytest.mark.parametrize("runs", [5, 6, 25, 60, 301])
def test_intervals_of_medians_are_those_of_a_quantile_test(runs: int) -> None:
    y = np.sort(np.random.default_rng(runs).lognormal(0.0, 2.0, runs))
    with np.errstate(invalid="ignore"):
        expected = stats.quantile_test(y, q=0.0, p=0.5).confidence_interval(0.95)
    assert median_interval(y, runs, 0.95) == pytest.approx(expected, nan_ok=True)
    assert np.isnan(median_interval(y, runs, 0.95)[0]) == (runs < 6)


@pytest.mark.parametrize("common", [False, True])
def test_intervals_of_medians_hold_as_often_as_said(common: bool) -> None:
    """Log-normal runs of two cells; with common noise each replicate has a term of its own."""
    rng = np.random.default_rng(11)
    count, held, truth = 40, 0, 1.0
    for _ in range(600):
        shared = rng.normal(0, 1.0, count)[:, None] if common else rng.normal(0, 1.0, (count, 2))
        y = np.exp(shared + rng.normal(0, 0.5, (count, 2)))
        low, high = median_interval(np.sort(y.ravel()), count if common else 2 * count, 0.95)
        held += low <= truth <= high
    assert 0.93 <= held / 600 <= 0.995


@pytest.mark.parametrize(
    ("practical", "verdict"), [(0.5, "differs"), (3.0, "equal"), (1.0, "undecided")]
)
def test_pairs_are_weighed_by_what_matters(practical: float, verdict: str) -> None:
    rng = np.random.default_rng(2)
    table = pd.DataFrame({"a": np.repeat(["x", "y"], 40), "y": rng.normal(5.0, 0.5, 80)})
    table.loc[40:, "y"] += 1.0
    found = analyse(table, ["a"], "y", unit="m", practical=practical)
    assert found.pairs["verdict"].tolist() == [verdict]
    words = {"differs": "1 differ by more", "equal": "1 are equal", "undecided": "1 are undecided"}
    assert words[verdict] in found.text()
    shown = f"equal within ±{practical:g} m" if verdict == "equal" else verdict
    assert shown in found.text(verbose=True)
    ratio = analyse(table, ["a"], "y", transform="log", practical=2.0)
    assert ratio.pairs["verdict"].tolist() == ["equal"]
    with pytest.raises(ConfigurationError, match="practical: must be a ratio above 1"):
        analyse(table, ["a"], "y", transform="log", practical=0.5)


def heavy_levels(seed: int, runs: int = 40) -> pd.DataFrame:
    """Three levels whose runs are heavy-tailed: x and y alike, z 3 m above them."""
    random = np.random.default_rng(seed)
    table = pd.DataFrame({"a": np.repeat(["x", "y", "z"], runs),
                          "replicate": np.tile(np.arange(runs), 3)})  # fmt: skip
    y = 5.0 + 0.2 * np.abs(random.standard_cauchy(3 * runs))
    y[:3] = 4e3, 6e3, 5e3
    return table.assign(y=y + 3.0 * (table["a"] == "z"))


@pytest.mark.parametrize("practical", [0.5, 1.0, 10.0])
def test_where_medians_stand_first_pairs_are_judged_by_them(practical: float) -> None:
    found = analyse(heavy_levels(1), ["a"], "y", unit="m", practical=practical)
    assert found.by_medians
    pairs = found.pairs.set_index(["one", "other"])
    medians = found.medians.set_index("level")
    for (one, other), row in pairs.iterrows():
        a, b = medians.loc[one], medians.loc[other]
        assert row["median_difference"] == pytest.approx(a["median"] - b["median"])
        assert row["median_low"] == pytest.approx(a["all_low"] - b["all_high"])
        assert row["median_high"] == pytest.approx(a["all_high"] - b["all_low"])
    assert pairs["differs"].tolist() == [False, True, True]
    assert not ((pairs["low"] > 0) | (pairs["high"] < 0)).loc[[("x", "z")]].any()  # the means
    expected = ["equal", "differs", "differs"] if practical < 3 else ["equal"] * 3
    assert pairs["verdict"].tolist() == expected
    counts = [expected.count(word) for word in ("differs", "equal", "undecided")]
    assert (f"Judged by medians, of the 3 pairs of levels {counts[0]} differ by more than "
            f"±{practical:g} m, {counts[1]} are equal within it, and {counts[2]} are undecided."
            ) in found.text()  # fmt: skip
    said = found.text(verbose=True)
    assert "Differences of the medians of y [m]" in said
    row = pairs.loc[("x", "z")]
    assert f"{row['median_low']:.4g}".replace("-", "−") in said
    axes = found.plot_pairs().axes
    assert "median y" in axes[-1].get_xlabel().replace("\n", " ")


def test_medians_of_paired_runs_are_of_the_replicates_differences() -> None:
    table = heavy_levels(2)
    shared = np.random.default_rng(3).normal(0, 50.0, 40)
    found = analyse(table.assign(y=table["y"] + shared[table["replicate"]] + 200.0), ["a"], "y",
                    seeding="common", practical=1.0)  # fmt: skip
    assert found.by_medians
    wide = (table["y"] + shared[table["replicate"]]).to_numpy().reshape(3, 40)
    for row, (i, j) in zip(found.pairs.itertuples(), ((0, 1), (0, 2), (1, 2)), strict=True):
        gaps = np.sort(wide[i] - wide[j])
        assert row.median_difference == pytest.approx(np.median(gaps))
        assert (row.median_low, row.median_high) == pytest.approx(
            median_interval(gaps, 40, 1 - 0.05 / 3)
        )
    assert found.pairs["differs"].tolist() == [False, True, True]
    assert found.pairs["verdict"].tolist() == ["equal", "differs", "differs"]


@pytest.mark.parametrize(("others", "missing"), [(2, False), (3, True), (10, False)])
def test_paired_medians_compare_runs_and_not_means_over_other_factors(
    others: int, missing: bool
) -> None:
    """p has the lesser median and the larger mean in each cell; a level of b may have no p."""
    random = np.random.default_rng(7)
    wide = np.stack([np.exp(3.0 * random.normal(size=(60, others))),
                     3.0 * np.exp(0.3 * random.normal(size=(60, others)))])  # fmt: skip
    rows = [(a, b, r, wide[i, r, b]) for i, a in enumerate("pq") for b in range(others)
            for r in range(60) if not (missing and (a, b) == ("p", 1))]  # fmt: skip
    table = pd.DataFrame(rows, columns=["a", "b", "replicate", "y"])
    found = analyse(table, ["a", "b"], "y", seeding="common", order=1, unit="m", practical=0.2)
    assert found.by_medians
    row = found.pairs[found.pairs["factor"] == "a"].iloc[0]
    there = [b for b in range(others) if not (missing and b == 1)]
    gaps = np.sort((wide[0] - wide[1])[:, there].ravel())
    assert row["median_difference"] == pytest.approx(np.median(gaps))
    assert (row["median_low"], row["median_high"]) == pytest.approx(median_interval(gaps, 60, 0.95))
    assert row["median_high"] < 0 < row["difference"]
    assert (row["differs"], row["verdict"]) == (True, "differs")
    assert "The median y falls with a from q" in found.text()
    said = found.text(verbose=True)
    assert "Medians of the differences of y within a replicate [m]" in said
    assert "It is not the difference of the levels' medians." in said
    label = found.plot_pairs().axes[-1].get_xlabel().replace("\n", " ")
    assert label == "Median difference of y [m] within a replicate"


def test_levels_that_share_no_cell_have_no_median_difference() -> None:
    random = np.random.default_rng(8)
    cells = [("x", "u"), ("y", "v"), ("z", "u"), ("z", "v")]
    rows = [(a, b, r, random.lognormal(0, 2.5)) for a, b in cells for r in range(40)]
    table = pd.DataFrame(rows, columns=["a", "b", "replicate", "y"])
    pairs = analyse(table, ["a", "b"], "y", seeding="common").pairs.set_index(["one", "other"])
    alone = pairs[["median_difference", "median_low", "median_high"]].isna().all(axis=1)
    assert alone.to_dict() == {("x", "y"): True, ("x", "z"): False, ("y", "z"): False,
                               ("u", "v"): False}  # fmt: skip
    assert not pairs["differs"][("x", "y")]


def test_where_means_stand_first_pairs_are_judged_by_them() -> None:
    random = np.random.default_rng(4)
    table = pd.DataFrame({"a": np.repeat(["x", "y"], 40), "y": random.normal(9.0, 1.0, 80)})
    table.loc[40:, "y"] += 1.0
    found = analyse(table, ["a"], "y", practical=0.2)
    row = found.pairs.iloc[0]
    assert not found.by_medians
    assert row["differs"] == (row["low"] > 0 or row["high"] < 0)
    assert "Differences of the means" in found.text(verbose=True)
    assert ". Of the 1 pairs of levels" in found.text()


@pytest.mark.parametrize("common", [False, True])
def test_intervals_of_medians_differences_hold_at_once(common: bool) -> None:
    random = np.random.default_rng(5)
    held = 0
    for _ in range(300):
        y = random.standard_t(1, (3, 25)) + random.normal(0, 5, 25) * common
        pairs = pd.DataFrame({"factor": "a", "one": [0, 0, 1], "other": [1, 2, 2]})
        data = pd.DataFrame({"a": np.repeat([0, 1, 2], 25), "y": y.ravel()})
        options = Options("independent", "none", "pure", None, 0.95, "", "replicate", "")
        medians = median_table(data, {"a": [0, 1, 2]}, "y", options)
        found = median_pairs(pairs, medians, {"a": y.T} if common else None, 0.95)
        held += bool(((found["low"] <= 0) & (found["high"] >= 0)).all())
    assert held / 300 >= 0.95 - 3 * (0.05 * 0.95 / 300) ** 0.5


@pytest.mark.parametrize("within", [0.0, 0.3, 10.0])
def test_intervals_of_differences_within_replicates_hold_at_once(within: float) -> None:
    """Whether the differences of a replicate over the other factors are alike or not."""
    random = np.random.default_rng(6)
    pairs = pd.DataFrame({"factor": "a", "one": [0, 0, 1], "other": [1, 2, 2]})
    medians = pd.DataFrame({"factor": "a", "level": [0, 1, 2], "median": 0.0, "all_low": 0.0,
                            "all_high": 0.0})  # fmt: skip
    held = 0
    for _ in range(300):
        y = random.standard_t(1, (25, 3, 1)) + within * random.standard_t(1, (25, 3, 4))
        y[:, 1, 2] = np.nan  # no cell
        found = median_pairs(pairs, medians, {"a": y}, 0.95)
        held += bool(((found["low"] <= 0) & (found["high"] >= 0)).all())
    assert held / 300 >= 0.95 - 3 * (0.05 * 0.95 / 300) ** 0.5
