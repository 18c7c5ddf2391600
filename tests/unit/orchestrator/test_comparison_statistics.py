"""Intervals of paired differences: how often they are right, and when there is none."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from math import inf, isnan, nan

import numpy as np
import pytest
from numpy.typing import NDArray
from sblcosim.comparison.statistics import (
    CONTAMINATION,
    difference,
    least_runs,
    level,
    mean_interval,
    rounded_up,
    share_interval,
)
from statsmodels.stats.proportion import proportion_confint

Floats = NDArray[np.float64]
PRACTICAL = 0.1
MEANS = (0.0, 0.0, PRACTICAL)
"""Of three receivers: two are the same, the third is just not equal to them."""


def normal(random: np.random.Generator, shape: tuple[int, ...]) -> Floats:
    return random.normal(size=shape)


def skewed(random: np.random.Generator, shape: tuple[int, ...]) -> Floats:
    return random.lognormal(0.0, 1.0, shape) - np.exp(0.5)


def contaminated(random: np.random.Generator, shape: tuple[int, ...]) -> Floats:
    bad = random.random(shape) < CONTAMINATION
    return random.normal(size=shape) + 10.0 * bad - 10.0 * CONTAMINATION


KINDS = [normal, skewed, contaminated]


def rates(
    kind: Callable[[np.random.Generator, tuple[int, ...]], Floats], runs: int, times: int
) -> tuple[float, float]:
    """How often all three intervals hold at once, and how often no verdict is wrong."""
    random = np.random.default_rng(20)
    covered = right = 0
    for _ in range(times):
        common = random.normal(size=(runs, 1))
        y = common + kind(random, (runs, 3)) + MEANS
        found = {
            (i, j): difference(y[:, i], y[:, j], 3, PRACTICAL) for i, j in combinations(range(3), 2)
        }
        covered += all(d.low <= MEANS[i] - MEANS[j] <= d.high for (i, j), d in found.items())
        wrong = [d.verdict in ("better", "worse") for d in (found[0, 1],)]
        wrong += [found[pair].verdict in ("worse", "equal") for pair in ((0, 2), (1, 2))]
        right += not any(wrong)
    return covered / times, right / times


@pytest.mark.parametrize("kind", KINDS)
def test_all_intervals_of_differences_hold_at_once(kind: Callable[..., Floats]) -> None:
    assert min(rates(kind, 120, 500)) >= 0.95


@pytest.mark.slow
@pytest.mark.parametrize("runs", [96, 200, 400])
@pytest.mark.parametrize("kind", KINDS)
def test_all_intervals_of_differences_hold_at_once_in_many_trials(
    kind: Callable[..., Floats], runs: int
) -> None:
    found = rates(kind, runs, 2000)
    print(f"{kind.__name__}, {runs} runs: {found[0]:.1%} cover, {found[1]:.1%} say nothing wrong")
    assert min(found) >= 0.95


@pytest.mark.parametrize("kind", KINDS)
def test_with_few_runs_nothing_is_said_but_how_many_are_missing(
    kind: Callable[..., Floats],
) -> None:
    random = np.random.default_rng(1)
    for runs in (1, 2, 3, 10):
        y = kind(random, (runs, 2))
        found = difference(y[:, 0] - 100.0, y[:, 1], 3, PRACTICAL)
        assert (found.verdict, found.wins) == ("cannot tell", runs)
        assert isnan(found.low)
        assert isnan(found.high)
        assert found.least == 94 == least_runs(CONTAMINATION, 0.05 / 6)
        assert found.runs_needed == (94 if runs > 2 else None)
    assert 0.95**94 <= 0.05 / 6 < 0.95**93


def test_it_takes_59_runs_for_a_bound_of_95_percent_of_the_runs() -> None:
    y = np.random.default_rng(1).normal(size=59)
    assert level(y[:58]).within_upper == inf
    assert level(y).within_upper == y.max()
    assert level(np.append(y, nan)).within_upper == inf  # one that has failed is worse than any


def test_equal_is_said_only_where_the_interval_is_within_the_practical_difference() -> None:
    y = np.random.default_rng(2).normal(5.0, 1.0, 200)
    other = y + np.random.default_rng(3).normal(0.03, 0.02, 200)
    found = difference(y, other)
    assert found.verdict == "better"
    assert -0.05 < found.low < found.mean < found.high < 0
    for practical, verdict in ((0.05, "equal"), (-found.low, "equal"), (0.02, "better")):
        assert difference(y, other, practical=practical).verdict == verdict
        assert difference(other, y, practical=practical).verdict == verdict.replace(
            "better", "worse"
        )
    noisy = y + np.random.default_rng(4).normal(0.0, 1.0, 200)
    assert difference(y, noisy, practical=0.05).verdict == "cannot tell"
    same = difference(y, y.copy())
    assert (same.verdict, same.runs_needed, same.low, same.high) == ("cannot tell", None, 0.0, 0.0)
    assert difference(y, y.copy(), practical=1e-9).verdict == "equal"


def test_who_has_failed_in_a_run_is_never_better() -> None:
    y = np.random.default_rng(5).normal(5.0, 0.1, 200)
    failed = np.where(np.arange(200) == 7, nan, y - 3.0)
    found = difference(failed, y, practical=100.0)
    assert (found.verdict, found.high, found.runs_needed) == ("cannot tell", inf, None)
    assert found.mean == pytest.approx(-3.0)
    assert difference(y, failed, practical=100.0).low == -inf
    assert difference(failed + 6.0, y).verdict == "worse"
    both = difference(failed, failed + 1.0)  # none is better for what no one has survived
    assert (both.verdict, both.wins) == ("better", 199)


def test_the_number_of_runs_that_would_tell_does() -> None:
    random = np.random.default_rng(6)
    told = 0
    for _ in range(20):
        d = random.normal(-0.2, 1.0, 3000)
        pilot = difference(d[:120], np.zeros(120))
        if pilot.runs_needed is None:
            told += pilot.verdict == "better"
        elif pilot.runs_needed <= len(d):
            told += difference(d[: pilot.runs_needed], np.zeros(pilot.runs_needed)).verdict in (
                "better",
            )
    assert told >= 12
    assert [rounded_up(n) for n in (0.2, 7.0, 99.1, 101.0, 3412.0)] == [1, 7, 100, 110, 3500]


def test_a_heavy_tail_is_recognised_and_a_light_one_is_not() -> None:
    random = np.random.default_rng(7)
    heavy = {
        "lost in few runs": np.where(np.arange(200) % 20 == 0, 300.0, random.normal(1, 0.1, 200)),
        "Cauchy": np.abs(random.standard_cauchy(200)),
    }
    light = {
        "normal": random.normal(1.0, 0.2, 200), "uniform": random.uniform(0, 1, 200),
        "constant": np.ones(200), "too few": np.array([1.0, 1.0, 50.0]),
    }  # fmt: skip
    assert {name: level(y).heavy for name, y in heavy.items()} == dict.fromkeys(heavy, True)
    assert {name: level(y).heavy for name, y in light.items()} == dict.fromkeys(light, False)
    assert level(heavy["Cauchy"]).tail_runs == 10


def test_intervals_do_not_depend_on_sign_or_scale() -> None:
    y = np.random.default_rng(8).lognormal(size=150)
    mean, low, high = mean_interval(y, 0.01)
    assert mean_interval(-8 * y, 0.01) == pytest.approx((-8 * mean, -8 * high, -8 * low))
    assert mean == y.mean()


def test_shares_have_the_interval_of_clopper_and_pearson() -> None:
    for count, runs in ((0, 200), (3, 200), (200, 200), (1, 2)):
        expected = proportion_confint(count, runs, method="beta")
        assert share_interval(count, runs) == pytest.approx(expected, abs=1e-12)


def test_a_level_counts_what_has_failed() -> None:
    found = level(np.array([1.0, nan, 3.0, nan]))
    assert (found.runs, found.failed, found.mean, found.least, found.most) == (4, 2, 2.0, 1.0, 3.0)
    assert isnan(found.low)
    assert level(np.full(3, nan)).failed == 3
