from __future__ import annotations

from itertools import product

import numpy as np
import pandas as pd
import pytest
from sblcosim.advice import advise
from sblcosim.errors import ConfigurationError
from sblcosim.factorial_plots import plot_front
from scipy import stats

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
    found = advise(experiment(), ["gps", "arm"], "error_m", COSTS)
    # a good GPS on a short baseline is dearer and worse than a bad one on a long baseline
    assert found.points["front"].tolist() == [True, True, False, True]
    assert found.chosen is None


def test_cheapest_point_within_the_limit_is_chosen():
    for limit, cost in ((9.5, 120), (3.5, 160), (1.5, 960)):
        found = advise(experiment(), ["gps", "arm"], "error_m", COSTS, limit=limit)
        assert found.chosen is not None
        assert found.points.loc[found.chosen, "cost"] == cost


def test_an_estimate_within_the_limit_is_not_enough():
    table = experiment()
    mean = table[(table["gps"] == 3.5) & (table["arm"] == 3.0)]["error_m"].mean()
    found = advise(table, ["gps", "arm"], "error_m", COSTS, limit=mean + 0.01)
    assert found.points.loc[found.chosen, "cost"] == 960
    only = table[table["gps"] == 3.5]
    nothing = advise(only, ["gps", "arm"], "error_m", COSTS, limit=mean + 0.01)
    assert nothing.chosen is None
    assert "more replicates may decide it" in nothing.answer()


def test_bound_of_the_mean_is_student_s_for_all_points_at_once():
    y = np.array([1.0, 2.0, 4.0, 6.0, 7.0])  # not skewed
    table = pd.DataFrame({"a": np.repeat([0.0, 1.0, 2.0, 3.0], 5), "y": np.tile(y, 4)})
    found = advise(table, ["a"], "y", {}, confidence=0.9).points["upper"]
    t = stats.t.ppf(1 - 0.1 / 4, 4)
    np.testing.assert_allclose(found, 4 + t * y.std(ddof=1) / np.sqrt(5))


def test_bound_of_the_mean_of_skewed_runs_solves_hall_s_equation():
    y = np.array([1.0, 1.1, 1.2, 1.3, 1.5, 2.0, 3.0, 5.0])
    upper = advise(pd.DataFrame({"a": 1.0, "y": y}), ["a"], "y", {}).points.loc[0, "upper"]
    n, g, t = 8, stats.skew(y, bias=False), (y.mean() - upper) / y.std(ddof=1)
    left = t + g * t**2 / 3 + g**2 * t**3 / 27 + g / (6 * n)
    assert left == pytest.approx(-stats.t.ppf(0.95, 7) / np.sqrt(n))
    assert upper > y.mean() + stats.t.ppf(0.95, 7) * y.std(ddof=1) / np.sqrt(n)


def test_bounds_of_skewed_runs_miss_about_as_often_as_they_say():
    rng = np.random.default_rng(4)
    missed = []
    for _ in range(120):
        table = pd.DataFrame({"a": np.repeat(np.arange(50.0), 50)})
        table["y"] = np.exp(0.5 * rng.normal(size=len(table)))
        upper = advise(table, ["a"], "y", {}, confidence=0.5).points["upper"]
        missed.append((upper < np.exp(0.125)).mean())
    # 1 % for each point; Student's would miss 2.6 %
    assert np.mean(missed) == pytest.approx(0.013, abs=0.007)


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
    assert "needs 86 runs at a point" in str(found)


@pytest.mark.parametrize("percentile", [None, 80.0])
def test_a_point_that_misses_the_requirement_is_rarely_chosen(percentile: float | None):
    # 16 points, all of them just beyond the limit
    levels = list(product((0.0, 1.0), repeat=4))
    rng = np.random.default_rng(11)
    points = pd.DataFrame(np.repeat(levels, 40, axis=0), columns=list("abcd"))
    limit = 0.0 if percentile is None else stats.norm.ppf(percentile / 100)
    wrong = [
        advise(
            points.assign(y=rng.normal(1e-6, 1, len(points))), "abcd", "y", {},
            limit=limit, percentile=percentile, confidence=0.8,
        ).chosen is not None
        for _ in range(200)
    ]
    assert np.mean(wrong) < 0.27
    if percentile is None:  # the other is conservative
        assert np.mean(wrong) > 0.1


def test_a_failed_run_is_worse_than_any_limit():
    table = experiment(100)
    cheapest = table.index[(table["gps"] == 3.5) & (table["arm"] == 0.4)]
    table.loc[cheapest[0], "error_m"] = np.nan
    mean = advise(table, ["gps", "arm"], "error_m", COSTS, limit=50)
    assert mean.points.loc[0, "failed"] == 1
    assert mean.chosen == 1
    assert not advise(table, ["gps", "arm"], "error_m", COSTS).points.loc[0, "front"]
    median = advise(table, ["gps", "arm"], "error_m", COSTS, limit=50, percentile=50)
    assert median.chosen == 0


def test_advice_is_told_in_words():
    found = advise(experiment(), ["gps", "arm"], "error_m", COSTS, limit=3.5, unit="m")
    text = found.answer()
    assert text.startswith(
        "The cheapest point with a mean of error_m of at most 3.5 m: gps 3.5, arm 3, at a cost of "
        "160; "
    )
    assert text in str(found)
    assert "<table" in found._repr_html_()
    none = advise(experiment(), ["gps", "arm"], "error_m", COSTS, limit=0.1)
    assert none.answer().startswith("No point is sure to have a mean of error_m of at most 0.1.")


@pytest.mark.parametrize("limit", [None, 3.5, 0.1])
def test_front_is_drawn_with_limit_and_choice(limit: float | None):
    ax = plot_front(advise(experiment(), ["gps", "arm"], "error_m", COSTS, limit=limit))
    labels = ax.get_legend_handles_labels()[1]
    assert (f"limit {limit}" in labels) == (limit is not None)
    assert ("cheapest that meets the limit" in labels) == (limit == 3.5)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"costs": {"gsp": {1.0: 1.0}}}, "costs: must be of the factors, got 'gsp'; did you mean"),
        ({"costs": {"gps": {0.1: 1.0}}}, "costs.gps: must have every level .* none for 3.5"),
        ({"costs": {"gps": {0.1: 1.0, 3.5: np.nan}}}, "costs.gps: must be finite"),
        ({"percentile": 100}, "percentile: must be between 0 and 100, got 100"),
        ({"confidence": 0}, "confidence: must be between 0 and 1"),
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
