from __future__ import annotations

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pandas as pd
import pytest
from quick import one_in
from sblcosim import study, style
from sblcosim.analysis.advice import figures
from sblcosim.analysis.advice import of_study as study_advice
from sblcosim.analysis.advice.advice import advise
from sblcosim.analysis.advice.figures import plot_front
from sblcosim.analysis.common import bounds
from sblcosim.errors import ConfigurationError
from sblcosim.results.figures.drawing import free_places
from scipy import stats
from seams import Seam

MEAN = {"percentile": None, "contamination": 0.2}
"""A statement about means that 4 points of 20 runs are enough for."""
COSTS = {"gps": {0.1: 900.0, 3.5: 100.0}, "arm": {0.4: 20.0, 3.0: 60.0}}


def experiment(replicates: int = 40, seed: int = 1) -> pd.DataFrame:
    """Means 1 (both good), 3, 5 and 9; standard deviation 0.5."""
    means = {(0.1, 3.0): 1.0, (0.1, 0.4): 5.0, (3.5, 3.0): 3.0, (3.5, 0.4): 9.0}
    rng = np.random.default_rng(seed)
    return pd.DataFrame(
        [
            (gps, arm, mean + 0.5 * rng.normal())
            for (gps, arm), mean in means.items()
            for _ in range(replicates)
        ],
        columns=["gps", "arm", "error_m"],
    )


def test_cost_is_the_sum_over_the_factors_and_the_cheapest_comes_first():
    found = advise(experiment(), ["gps", "arm"], "error_m", COSTS).points
    assert found["cost"].tolist() == [120, 160, 920, 960]
    assert found[["gps", "arm"]].iloc[0].tolist() == [3.5, 0.4]


def test_factors_without_costs_are_free():
    found = advise(experiment(), ["gps", "arm"], "error_m", {"arm": COSTS["arm"]}).points
    assert found["cost"].tolist() == [20, 20, 60, 60]


def test_front_has_the_points_that_no_other_one_beats():
    found = advise(experiment(), ["gps", "arm"], "error_m", COSTS, **MEAN)
    # a good GPS on a short baseline is dearer and worse than a bad one on a long baseline
    assert found.points["front"].tolist() == [True, True, False, True]
    assert found.chosen is None


def test_cheapest_point_within_the_limit_is_chosen():
    for limit, cost in ((9.5, 120), (3.5, 160), (1.5, 960)):
        found = advise(experiment(), ["gps", "arm"], "error_m", COSTS, **MEAN, limit=limit)
        assert found.chosen is not None
        assert found.points.loc[found.chosen, "cost"] == cost


def test_an_estimate_within_the_limit_is_not_enough():
    table = experiment()
    mean = table[(table["gps"] == 3.5) & (table["arm"] == 3.0)]["error_m"].mean()
    found = advise(table, ["gps", "arm"], "error_m", COSTS, limit=mean + 0.01, **MEAN)
    assert found.points.loc[found.chosen, "cost"] == 960
    only = table[table["gps"] == 3.5]
    nothing = advise(only, ["gps", "arm"], "error_m", COSTS, limit=mean + 0.01, **MEAN)
    assert nothing.chosen is None
    assert "More replicates may decide it" in nothing.answer


def test_bound_of_a_mean_of_two_values_is_clopper_and_pearson_s(seam):
    seam.tuned(reach=1.0)  # no run can be worse than the worst
    for threes in (1, 3, 10, 25):
        y = np.r_[np.ones(30 - threes), np.full(threes, 3.0)]
        found = advise(pd.DataFrame({"a": 1.0, "y": y}), ["a"], "y", {}, **MEAN).points
        exact = stats.binomtest(threes, 30, alternative="less").proportion_ci(0.95).high
        assert found.loc[0, "upper"] == pytest.approx(1 + 2 * exact, rel=2e-3)


def test_bound_of_the_mean_is_the_quantile_of_means_with_random_weights():
    rng = np.random.default_rng(2)
    y = rng.lognormal(size=25)
    found = advise(pd.DataFrame({"a": 1.0, "y": y}), ["a"], "y", {}, **MEAN).points
    possible = np.append(y, 2 * y.max() - np.median(y))
    means = rng.dirichlet(np.ones(26), 200_000) @ possible
    assert found.loc[0, "upper"] == pytest.approx(np.quantile(means, 0.95), rel=0.01)
    assert found.loc[0, "estimate"] == pytest.approx(y.mean())


def test_bound_of_the_mean_does_not_depend_on_the_unit():
    y = np.random.default_rng(3).lognormal(size=25)
    table = pd.DataFrame({"a": 1.0, "y": y, "z": 1e9 * y - 5e9})
    one, other = (advise(table, ["a"], name, {}, **MEAN).points.loc[0, "upper"] for name in "yz")
    assert other == pytest.approx(1e9 * one - 5e9, rel=1e-9)


@pytest.mark.parametrize("y", [[2.0] * 20, [1.0] * 5 + [2.0] * 15])
def test_runs_that_are_equal_have_a_bound(y: list[float]):
    found = advise(pd.DataFrame({"a": 1.0, "y": y}), ["a"], "y", {}, **MEAN).points
    assert np.mean(y) <= found.loc[0, "upper"] <= 2


def test_a_mean_takes_the_runs_that_would_have_shown_the_stated_contamination():
    # eight points, 5 %: 0.95ⁿ ≤ 0.05/8 from n = 99 on
    points = pd.DataFrame(list(product((0.0, 1.0), repeat=3)), columns=list("abc"))
    rng = np.random.default_rng(1)
    for n in (50, 98, 99):
        table = pd.concat([points] * n).assign(y=lambda t: rng.normal(1, 0.1, len(t)))
        found = advise(table, "abc", "y", {}, limit=2, percentile=None)
        assert (found.runs_needed, found.missing) == (99, 99 - n)
        assert (found.chosen is None) == (n < 99)
        assert np.isfinite(found.points["upper"]).all() == (n == 99)
    few = advise(table[: 8 * 50], "abc", "y", {}, limit=2, percentile=None)
    assert (
        "Nothing sure can be said about the mean of y: if 5 % of the runs are bad, some point may "
        "have shown none. Each of the 8 points needs 99 runs. There are 50, so 49 are missing."
    ) in few.answer
    assert advise(table, "abc", "y", {}, percentile=None, contamination=0.1).runs_needed == 49
    assert advise(table, "abc", "y", {}, percentile=None, confidence=0.99).runs_needed == 131


def test_a_percentile_is_offered_first_and_the_mean_beside_it():
    table = experiment(100)
    found = advise(table, ["gps", "arm"], "error_m", COSTS, limit=3.5)
    mean = advise(table, ["gps", "arm"], "error_m", COSTS, limit=3.5, percentile=None)
    assert found.percentile == 90
    assert found.beside is not None
    assert mean.beside is not None
    assert (found.chosen, found.beside.chosen) == (mean.beside.chosen, mean.chosen)
    assert found.answer == mean.answer
    first, second = str(found).splitlines()[:2]
    start = "The cheapest point with a {} of error_m of at most 3.5: "
    assert first.startswith(start.format("90th percentile"))
    assert second.startswith(start.format("mean"))
    counts = "Each run counts with one number, its error_m. Means and percentiles"
    assert counts in found.text(verbose=True)
    assert counts not in str(found)


def test_lost_runs_are_left_out_of_the_mean_and_have_a_bound_of_their_own():
    table = experiment(200).assign(lost=0.0)
    point = (table["gps"] == 3.5) & (table["arm"] == 3.0)
    table.loc[table.index[point][:1], "error_m"] = np.nan
    table.loc[table.index[point][1:2], ["error_m", "lost"]] = (80.0, 1.0)
    options = {"limit": 3.5, "percentile": None, "lost": "lost"}
    found = advise(table, ["gps", "arm"], "error_m", COSTS, **options)
    row = found.points[(found.points["gps"] == 3.5) & (found.points["arm"] == 3.0)].iloc[0]
    assert (row["runs"], row["lost"]) == (200, 2)
    exact = stats.binomtest(2, 200, alternative="less").proportion_ci(1 - 0.05 / 4).high
    assert row["lost_upper"] == pytest.approx(exact)
    assert row["estimate"] == pytest.approx(table[point]["error_m"].iloc[2:].mean())
    assert row["meets"]
    assert f"2 of 200 are lost, surely at most {100 * exact:.2g} %" in found.answer
    # more of them than the statement is for
    table.loc[table.index[point][:12], "lost"] = 1.0
    found = advise(table, ["gps", "arm"], "error_m", COSTS, **options)
    assert found.points.loc[found.chosen, "cost"] == 960
    # so many that the point is worth nothing, however good the rest
    table.loc[table.index[point][:50], "lost"] = 1.0
    found = advise(table, ["gps", "arm"], "error_m", COSTS, **options)
    assert not found.points.set_index("cost").loc[160, "front"]


def test_a_lost_run_is_beyond_any_percentile_s_limit():
    table = experiment(100).assign(lost=False)
    table.loc[table["gps"] == 3.5, "lost"] = True
    found = advise(table, ["gps", "arm"], "error_m", COSTS, limit=50, lost="lost")
    assert found.points.loc[found.chosen, "cost"] == 920


def draw(kind: str, rng: np.random.Generator, size: tuple[int, ...]) -> np.ndarray:
    """Runs with mean 1."""
    if kind == "normal":
        return rng.normal(1, 0.3, size)
    if kind == "lognormal":
        return rng.lognormal(-0.5, 1, size)
    # every twentieth is twenty times worse
    return rng.normal(1, 0.2, size) * np.where(rng.random(size) < 0.05, 20, 1) / 1.95


def wrong(kind: str, n: int, studies: int, seed: int) -> float:
    """How often a study of eight points, all exactly at the limit, makes a sure statement."""
    rng = np.random.default_rng(seed)
    points = pd.DataFrame({"a": np.repeat(np.arange(8.0), n)})
    found = 0
    for _ in range(studies):
        y = draw(kind, rng, (8 * n,))
        table = points.assign(y=y)
        made = advise(table, ["a"], "y", {}, limit=1, percentile=None)
        found += made.chosen is not None
    return found / studies


KINDS = ["normal", "lognormal", "contaminated"]


@pytest.mark.parametrize("kind", KINDS)
def test_a_sure_statement_about_a_mean_is_rarely_wrong(kind: str):
    assert wrong(kind, 50, 10, seed=1) == 0  # it is not made
    # four standard deviations of the simulation
    assert wrong(kind, 100, 60, seed=2) < 0.05 + 4 * np.sqrt(0.05 * 0.95 / 60)


@pytest.mark.slow
@pytest.mark.parametrize("n", [10, 20, 50, 100, 200])
@pytest.mark.parametrize("kind", KINDS)
def test_sure_statements_about_means_are_wrong_at_most_as_often_as_they_say(kind: str, n: int):
    studies = 1000 if n >= 99 else 50
    share = wrong(kind, n, studies, seed=n)
    print(f"{kind}, {n} runs: wrong in {share:.2%} of {studies} studies")
    assert share <= 0.05 + 3 * np.sqrt(0.05 * 0.95 / studies)
    if n < 99:
        assert share == 0


@pytest.mark.slow
@pytest.mark.parametrize("n", [10, 20, 50, 100, 200])
@pytest.mark.parametrize("kind", KINDS)
def test_bounds_of_means_hold_where_bad_runs_were_seen(kind: str, n: int):
    """The interval itself, one point at 95 %, without the rule about the runs that it takes."""
    rng = np.random.default_rng(n)
    y = np.sort(draw(kind, rng, (2000, n)), axis=1)
    seen = y[:, -1] > 5 if kind == "contaminated" else np.full(len(y), True)
    missed = np.array([bounds.mean_bound(row, 0.05)[1] < 1 for row in y])
    print(f"{kind}, {n} runs: misses {missed.mean():.2%}, {missed[seen].mean():.2%} if seen")
    if not (kind == "lognormal" and n < 20):
        assert missed[seen].mean() <= 0.05 + 3 * np.sqrt(0.05 * 0.95 / seen.sum())


def test_bound_of_a_percentile_is_the_published_order_statistic():
    # n = 59: the largest of 59 runs is a 95 % bound of the 95th percentile, of 58 it is not
    for n, bound in ((59, 59.0), (58, np.inf), (93, 92.0)):
        table = pd.DataFrame({"a": 1.0, "y": np.arange(1.0, n + 1)})
        found = advise(table, ["a"], "y", {}, percentile=95)
        assert found.points["upper"].tolist() == [bound]
        assert found.runs_needed == 59


def test_percentile_without_enough_runs_says_how_many_it_needs():
    found = advise(experiment(50), ["gps", "arm"], "error_m", COSTS, limit=20, percentile=95)
    assert found.chosen is None
    assert found.runs_needed == 86
    assert (
        "Nothing sure can be said about the 95th percentile of error_m: there are too few runs. "
        "Each of the 4 points needs 86 runs. There are 50, so 36 are missing."
    ) in str(found)


@pytest.mark.parametrize("percentile", [None, 80.0])
@one_in(2)
def test_a_point_that_misses_the_requirement_is_rarely_chosen(percentile: float | None):
    # 16 points, all of them just beyond the limit
    levels = list(product((0.0, 1.0), repeat=4))
    rng = np.random.default_rng(11)
    points = pd.DataFrame(np.repeat(levels, 40, axis=0), columns=list("abcd"))
    limit = 0.0 if percentile is None else stats.norm.ppf(percentile / 100)
    chosen = [
        advise(
            points.assign(y=rng.normal(1e-6, 1, len(points))), "abcd", "y", {},
            limit=limit, percentile=percentile, confidence=0.8, contamination=0.2,
        ).chosen is not None
        for _ in range(100)
    ]
    assert np.mean(chosen) < 0.27


def test_a_failed_run_is_worse_than_any_limit():
    table = experiment(100)
    cheapest = table.index[(table["gps"] == 3.5) & (table["arm"] == 0.4)]
    table.loc[cheapest[:30], "error_m"] = np.nan
    found = advise(table, ["gps", "arm"], "error_m", COSTS, limit=50)
    assert found.points.loc[0, "lost"] == 30
    assert found.points.loc[0, "estimate"] == np.inf
    assert found.chosen == 1
    assert not advise(table, ["gps", "arm"], "error_m", COSTS).points.loc[0, "front"]
    median = advise(table, ["gps", "arm"], "error_m", COSTS, limit=50, percentile=50)
    assert median.chosen == 0


def test_advice_is_told_in_words():
    found = advise(experiment(), ["gps", "arm"], "error_m", COSTS, limit=3.5, unit="m", **MEAN)
    text = found.answer
    assert (
        "The cheapest point with a mean of error_m of at most 3.5 m: gps 3.5, arm 3, at a cost of "
        "160. It has "
    ) in text
    assert text in str(found).replace("\n", " ")
    assert "<table" in found._repr_html_()
    none = advise(experiment(), ["gps", "arm"], "error_m", COSTS, limit=0.1, **MEAN)
    text = none.answer
    assert "No point surely has a mean of error_m of at most 0.1. The best point has" in text
    table = experiment().assign(error_m=np.nan)
    lost = advise(table, ["gps", "arm"], "error_m", COSTS, limit=0.1, **MEAN)
    assert "At every point, more than 20 % of the runs are lost." in str(lost)


@pytest.mark.parametrize("limit", [None, 3.5, 0.1])
def test_front_is_drawn_with_limit_and_choice(limit: float | None):
    ax = plot_front(advise(experiment(), ["gps", "arm"], "error_m", COSTS, limit=limit, **MEAN))
    labels = ax.get_legend_handles_labels()[1]
    assert (f"limit {limit}" in labels) == (limit is not None)
    assert ("cheapest that meets the limit" in labels) == (limit == 3.5)


def test_front_has_its_points_bounds_limit_and_choice_where_they_are():
    found = advise(experiment(), ["gps", "arm"], "error_m", COSTS, limit=3.5, unit="m", **MEAN)
    points = found.points.assign(estimate=[9.0, 3.0, 5.0, 1.0], upper=[np.inf, 3.25, 5.5, 1.5])
    ax = plot_front(replace(found, points=points))
    look = style.THEMES["light"]
    lines = {line.get_label(): line for line in ax.lines}
    dots = lines["design points"]
    assert dots.get_xydata().tolist() == [[120, 9], [160, 3], [920, 5], [960, 1]]
    front = lines["no other point is cheaper and better"]
    assert front.get_xydata().tolist() == [[120, 9], [160, 3], [960, 1]]
    assert front.get_drawstyle() == "steps-post"
    assert [*lines["limit 3.5"].get_ydata()] == [3.5, 3.5]
    mark = lines["cheapest that meets the limit"]
    assert mark.get_xydata().tolist() == [[160, 3]]
    assert (mark.get_marker(), mark.get_markersize(), mark.get_color()) == (
        "s", 8, look.receivers[0]
    )
    bars = [
        (it.get_linewidth()[0], *np.ravel(segment)) for it in ax.collections
        for segment in it.get_segments()
    ]  # fmt: skip
    assert bars == [(1, 160, 3, 160, 3.25), (1, 960, 1, 960, 1.5), (2, 160, 3, 160, 3.25)]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Cost", "Mean of error_m [m]")
    assert ax.get_ylim()[0] == 0
    assert ax.get_xlim() == pytest.approx((120 - 0.12 * 840, 960 + 0.12 * 840))
    assert [text.get_text() for text in ax.texts] == ["gps 3.5\narm 0.4", "arm 3", "gps 0.1"]
    assert [text.get_position() for text in ax.texts] == [(120, 9), (160, 3), (960, 1)]
    unknown = points.assign(estimate=[np.nan, 3.0, -5.0, 1.0])
    below = plot_front(replace(found, points=unknown))
    assert len(below.lines[0].get_xdata()) == 3
    assert below.get_ylim()[0] < -5


def test_labels_of_the_front_keep_off_its_steps_bounds_points_and_limit(seam: Seam):
    given: list[np.ndarray] = []

    def places(ax, points, words, drawn):
        given.append(drawn)
        return free_places(ax, points, words, drawn)

    seam.instead(figures.free_places, places)
    found = advise(experiment(), ["gps", "arm"], "error_m", COSTS, limit=3.5, **MEAN)
    points = found.points.assign(estimate=[9.0, 3.0, 5.0, 1.0], upper=[np.inf, 3.25, 5.5, 1.5])
    ax = plot_front(replace(found, points=points))
    (drawn,) = given
    corners = [(120, 9), (160, 9), (160, 3), (960, 3), (960, 1)]
    for one, other in pairwise(corners):
        for share in np.linspace(0, 1, 30):
            at = np.array(one) + share * (np.array(other) - one)
            assert np.isclose(drawn, at).all(axis=1).any()
    for at in ((920, 5), (160, 3.25), (960, 1.5)):
        assert np.isclose(drawn, at).all(axis=1).any()
    on_limit = np.sort(drawn[drawn[:, 1] == 3.5][:, 0])
    np.testing.assert_allclose(on_limit, np.linspace(*ax.get_xlim(), 200))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"costs": {"gsp": {1.0: 1.0}}}, "costs: must be for the factors, got 'gsp'; did you mean"),
        ({"costs": {"gps": {0.1: 1.0}}},
         "costs.gps: must have a cost for every level .* none for 3.5"),
        ({"costs": {"gps": {0.1: 1.0, 3.5: np.nan}}}, "costs.gps: must be finite"),
        ({"percentile": 100}, "percentile: must be at least 1 and less than 100, got 100"),
        ({"percentile": 0.9}, r"percentile: must be at least 1 and less than 100, got 0\.9"),
        ({"confidence": 0}, "confidence: must be between 0 and 1"),
        ({"contamination": 1}, "contamination: must be between 0 and 1, got 1"),
        ({"lost": "gsp"}, "lost: must be a column of the table, got 'gsp'; did you mean 'gps'"),
        ({"limit": np.inf}, "limit: must be finite"),
        ({"factors": ["gps", "x"]}, "factors: must be columns of the table, got 'x'"),
        ({"table": experiment()[:0]}, "table: must have at least one run"),
    ],
)
def test_what_cannot_be_advised_on_is_refused_in_one_line(options, message):
    given = {
        "table": experiment(), "factors": ["gps", "arm"], "response": "error_m", "costs": COSTS,
        **options,
    }
    with pytest.raises(ConfigurationError, match=message) as caught:
        advise(**given)
    assert "\n" not in str(caught.value)


def test_advice_on_a_grid_of_names_in_conditions(tmp_path):
    """Text levels, and conditions put together as the study says."""
    made = study.load({
        "name": "grid", "scenario": "paper-scenario-1", "replicates": 12,
        "fixed": {"time": {"duration_s": 8.0}}, "design": {"kind": "grid"},
        "factors": {
            "gps": {"keys": ["platform.gps_grade"], "levels": ["standalone", "rtk_fixed"]},
            "arm": {"keys": ["platform.arm_length_m"], "levels": [0.4, 1.0, 3.0]},
        },
        "conditions": {
            "noise": {"keys": ["acoustics.range_std_m"], "levels": [0.05, 0.2], "combine": "all"},
        },
    })  # fmt: skip
    runs = made.run(tmp_path)
    costs = {"gps": {"rtk_fixed": 500, "standalone": 30}, "arm": [1, 2, 3]}
    found = study_advice.advice_on_study(tmp_path, costs, limit=50.0, percentile=50.0)
    assert found.points["cost"].tolist() == [31, 32, 33, 501, 502, 503]
    assert (found.points["runs"] == 12).all()
    first = found.points.iloc[0]
    value = "ekf.absolute_total_rms_m"
    mine = runs[(runs["gps"] == "standalone") & (runs["arm"] == 0.4)]
    worst = mine.groupby("replicate").agg({value: "max", "ekf.lost": "mean"})
    worst = worst[value].where(worst["ekf.lost"] == 0, np.inf)
    assert first["estimate"] == np.sort(worst)[5]
    assert "gps standalone, arm 0.4, at a cost of 31" in found.answer
    assert plot_front(found.readable).get_xlabel() == "Cost"
    with pytest.raises(ConfigurationError, match="got none for rtk_fixed"):
        study_advice.advice_on_study(tmp_path, {"gps": {"standalone": 30}})


def test_advice_where_the_receivers_are_a_choice(tmp_path):
    made = study.load({
        "name": "who", "scenario": "paper-scenario-1", "replicates": 10, "seeding": "common",
        "fixed": {"time": {"duration_s": 8.0}}, "design": {"kind": "grid"},
        "factors": {
            "receiver": {"keys": ["receivers"], "levels": ["ekf", "sequential"]},
            "arm": {"keys": ["platform.arm_length_m"], "levels": [0.4, 3.0]},
        },
    })  # fmt: skip
    made.run(tmp_path)
    found = study_advice.advice_on_study(tmp_path, {"receiver": [10, 0]}, limit=100.0)
    assert found.points["cost"].tolist() == [0, 0, 10, 10]
    assert set(found.points["receiver"]) == {"ekf", "sequential"}
    assert "RMS total error" in found.text()
