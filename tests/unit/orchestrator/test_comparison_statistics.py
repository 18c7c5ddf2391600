"""Intervals of paired differences: how often they are right, and when there is none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import floor, inf, isnan, nan, sqrt

import numpy as np
import pytest
from numpy.typing import NDArray
from quick import few
from sblcosim.analysis.common.bounds import share_interval
from sblcosim.comparison.common.statistics import (
    CONTAMINATION,
    Difference,
    difference,
    level,
    mean_interval,
    rounded_up,
)
from scipy import optimize, stats
from statsmodels.stats.proportion import proportion_confint

Floats = NDArray[np.float64]
PRACTICAL = 0.1


@dataclass(frozen=True)
class Shape:
    """Paired differences of a known distribution."""

    draw: Callable[[np.random.Generator, int], Floats]
    below: float
    """Share of all differences below 0."""
    above: float
    median: float
    mean: float


def normal(mean: float) -> Shape:
    return Shape(lambda random, n: random.normal(mean, 1.0, n), stats.norm.cdf(-mean),
                 stats.norm.sf(-mean), mean, mean)  # fmt: skip


def log_normal(shift: float) -> Shape:
    """Log-normal with σ = 1, less a shift."""
    return Shape(lambda random, n: random.lognormal(0.0, 1.0, n) - shift,
                 stats.lognorm.cdf(shift, 1), stats.lognorm.sf(shift, 1), 1 - shift,
                 np.exp(0.5) - shift)  # fmt: skip


def heavy(mean: float) -> Shape:
    """Student's t with 2 degrees of freedom: its variance is infinite."""
    return Shape(lambda random, n: random.standard_t(2, n) + mean, stats.t.cdf(-mean, 2),
                 stats.t.sf(-mean, 2), mean, mean)  # fmt: skip


def contaminated(mean: float) -> Shape:
    """5 % of the runs are off by 10 standard deviations."""
    def below(x: float) -> float:
        return float(0.95 * stats.norm.cdf(x, mean) + 0.05 * stats.norm.cdf(x, mean + 10))

    return Shape(
        lambda random, n: random.normal(mean, 1.0, n) + 10.0 * (random.random(n) < CONTAMINATION),
        below(0), 1 - below(0), float(optimize.brentq(lambda x: below(x) - 0.5, -9, 9)), mean + 0.5,
    )  # fmt: skip


def ties(worse: float, better: float) -> Shape:
    """Most runs are equal."""
    return Shape(lambda random, n: random.choice([-1.0, 0.0, 1.0], n,
                                                 p=[better, 1 - worse - better, worse]),
                 better, worse, -1.0 if better > 0.5 else 0.0, worse - better)  # fmt: skip


SHAPES = {
    "normal, equal": normal(0.0), "normal, hardly better": normal(-0.05),
    "normal, better": normal(-0.5), "normal, practical": normal(PRACTICAL),
    "log-normal, equal": log_normal(1.0), "log-normal, better": log_normal(1.3),
    "log-normal, equal means": log_normal(np.exp(0.5)), "heavy, equal": heavy(0.0),
    "heavy, better": heavy(-0.4), "contaminated, better": contaminated(-0.3),
    "contaminated, equal": contaminated(-stats.norm.ppf(0.5 / 0.95)),
    "ties, equal": ties(0.2, 0.2), "ties, better": ties(0.1, 0.25),
    "mostly better": ties(0.03, 0.9),
}
NUMBERS = (2, 6, 9, 17, 49, 100, 140, 200)


def wrong(found: Difference, shape: Shape) -> list[str]:
    """What is said of a pair and is not so."""
    said = {
        "better": found.verdict == "better" and shape.below <= shape.above,
        "worse": found.verdict == "worse" and shape.above <= shape.below,
        "equal": found.verdict == "equal" and abs(shape.median) > PRACTICAL + 1e-12,
        "share": found.share_low
        > (shape.below if found.wins > found.losses else shape.above) + 1e-12,
        "median": found.low > shape.median + 1e-9 or found.high < shape.median - 1e-9,
        "mean": found.mean_low > shape.mean or found.mean_high < shape.mean,
    }
    return [name for name, is_wrong in said.items() if is_wrong]


def family_rate(shape: Shape, runs: int, pairs: int, times: int) -> float:
    """How often anything that is said of some pairs, which share their noise, is wrong."""
    random = np.random.default_rng(20)
    count = 0
    for _ in range(times):
        found = [difference(shape.draw(random, runs), np.zeros(runs), pairs, PRACTICAL)
                 for _ in range(pairs)]
        count += any(wrong(it, shape) for it in found)
    return count / times


@pytest.mark.parametrize("name", few(SHAPES, quick=[*SHAPES][::3]))
def test_what_is_said_is_wrong_in_one_comparison_of_twenty_at_most(name: str) -> None:
    """Of all that is said of one pair together; three standard errors are for the simulation."""
    times = 200
    allowed = 0.05 + 3 * sqrt(0.05 * 0.95 / times)
    for runs in (6, 17, 120):
        assert family_rate(SHAPES[name], runs, 1, times) <= allowed, runs


@pytest.mark.slow
@pytest.mark.parametrize("pairs", [1, 3])
@pytest.mark.parametrize("name", SHAPES)
def test_what_is_said_is_wrong_in_one_comparison_of_twenty_at_most_in_many_trials(
    name: str, pairs: int
) -> None:
    times = 2000
    found = {runs: family_rate(SHAPES[name], runs, pairs, times) for runs in NUMBERS}
    print(name, pairs, *(f"{runs}: {rate:.2%}" for runs, rate in found.items()))
    assert max(found.values()) <= 0.05 + 3 * sqrt(0.05 * 0.95 / times)


@pytest.mark.parametrize(("comparisons", "share"), [(1, 0.96), (3, 0.95)])
def test_who_is_better_in_every_run_is_better_in_most_dives(
    comparisons: int, share: float
) -> None:
    """0.025^(1/100) = 0.9638, and with three pairs 0.00833^(1/100) = 0.9533."""
    random = np.random.default_rng(3)
    worse = 22.3 + random.lognormal(0.0, 3.0, 100)  # a heavy tail, which no mean withstands
    found = difference(np.full(100, 2.4), worse, comparisons)
    assert (found.verdict, found.wins, found.losses) == ("better", 100, 0)
    assert floor(100 * found.share_low) / 100 == share
    expected = proportion_confint(100, 100, alpha=0.05 / comparisons, method="beta")[0]
    assert found.share_low == pytest.approx(expected, rel=1e-12)
    assert isnan(found.mean_low)
    assert isnan(found.mean_high)
    assert found.low < found.median < found.high < 0


@pytest.mark.parametrize("comparisons", [1, 3, 12])
def test_nothing_is_undecided_beside_a_sign_test_that_decides(comparisons: int) -> None:
    random = np.random.default_rng(4)
    for runs in range(1, 60):
        for share in (0.5, 0.7, 0.9, 1.0):
            d = np.where(random.random(runs) < share, -1.0, 1.0) * random.lognormal(0, 2, runs)
            d *= random.random(runs) < 0.8
            found = difference(d, np.zeros(runs), comparisons)
            wins, losses = int((d < 0).sum()), int((d > 0).sum())
            told = wins + losses > 0 and stats.binomtest(
                wins, wins + losses).pvalue <= 0.05 / comparisons  # fmt: skip
            assert (found.verdict != "undecided") == told
            assert (found.wins, found.losses) == (wins, losses)
            if told:
                assert found.verdict == ("better" if wins > losses else "worse")
                low = proportion_confint(max(wins, losses), runs, 0.05 / comparisons, "beta")[0]
                assert found.share_low == pytest.approx(low, rel=1e-12)
            else:
                assert isnan(found.share_low)
                assert isnan(found.mean_low)


def test_with_too_few_runs_nothing_is_said_but_how_many_are_missing() -> None:
    for comparisons, least, mean_least in ((1, 6, 99), (3, 7, 121)):
        for runs in (1, 3, least - 1, least):
            y = np.random.default_rng(runs).normal(size=runs)
            found = difference(y - 100.0, np.zeros(runs), comparisons, PRACTICAL)
            assert found.verdict == ("better" if runs == least else "undecided")
            assert (found.wins, found.least, found.mean_least) == (runs, least, mean_least)
            assert isnan(found.low)
            assert isnan(found.mean_low)
            assert found.runs_needed == (least if 3 <= runs < least else None)
        assert 0.5**least <= 0.05 / (2 * comparisons) < 0.5 ** (least - 1)
        assert 0.95**mean_least <= 0.05 / (8 * comparisons) < 0.95 ** (mean_least - 1)


def test_the_interval_of_the_median_is_of_order_statistics() -> None:
    d = np.random.default_rng(5).lognormal(size=120) - 1.2
    found = difference(d, np.zeros(120), 3)
    expected = stats.quantile_test(d, q=0.0, p=0.5).confidence_interval(1 - 0.05 / 12)
    assert (found.low, found.high) == pytest.approx(expected)
    assert found.median == pytest.approx(np.median(d))


def test_a_mean_is_said_only_where_its_assumptions_hold() -> None:
    random = np.random.default_rng(6)
    d = random.normal(-1.0, 0.5, 99)
    zero = np.zeros(99)
    good = difference(d, zero)
    assert good.mean_low < good.mean < good.mean_high < 0
    assert (good.mean, good.mean_low, good.mean_high) == pytest.approx(
        mean_interval(d, 0.05 / 8), rel=1e-9
    )
    tail = d.copy()
    tail[:3] = 500.0
    failed = d.copy()
    failed[0] = nan
    open_ = np.where(np.arange(99) % 2, -1.0, 1.0) + 0.01 * d
    for case in (d[:98], tail, -tail, failed, open_):
        found = difference(case, zero[: len(case)])
        assert isnan(found.mean_low), case
        assert isnan(found.mean_high)
    assert difference(open_, zero).verdict == "undecided"


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
    assert -0.05 < found.low < found.median < found.high < 0
    for practical, verdict in ((0.05, "equal"), (-found.low, "equal"), (0.02, "better")):
        assert difference(y, other, practical=practical).verdict == verdict
        assert difference(other, y, practical=practical).verdict == verdict.replace(
            "better", "worse"
        )
    noisy = y + np.random.default_rng(4).normal(0.0, 1.0, 200)
    assert difference(y, noisy, practical=0.05).verdict == "undecided"
    same = difference(y, y.copy())
    assert (same.verdict, same.runs_needed, same.low, same.high) == ("undecided", None, 0.0, 0.0)
    assert difference(y, y.copy(), practical=1e-9).verdict == "equal"
    lost = np.where(np.arange(200) % 20 == 0, 300.0, y)
    assert difference(lost, y, practical=0.05).verdict == "worse"  # though the median is 0
    assert difference(y, lost, practical=0.05).verdict == "better"


def test_a_failed_run_is_worse_than_any_other() -> None:
    y = np.random.default_rng(5).normal(5.0, 0.1, 200)
    failed = np.where(np.arange(200) == 7, nan, y - 3.0)
    found = difference(failed, y, practical=100.0)
    assert (found.verdict, found.wins, found.losses) == ("better", 199, 1)  # but never equal
    assert found.median == pytest.approx(-3.0)
    assert isnan(found.mean_low)
    many = np.where(np.arange(200) % 2 == 0, nan, y - 3.0)
    assert difference(many, y).verdict == "undecided"
    assert difference(many, y).high == inf
    assert difference(y, many).low == -inf
    assert difference(failed + 6.0, y).verdict == "worse"
    both = difference(failed, failed + 1.0)  # none is better for what no one has survived
    assert (both.verdict, both.wins, both.losses, both.runs) == ("better", 199, 0, 200)
    silent = difference(np.full(9, nan), np.full(9, nan))
    assert (silent.verdict, silent.wins, silent.losses) == ("undecided", 0, 0)
    assert isnan(silent.median)
    assert isnan(silent.mean)


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


def test_a_level_has_the_statistics_of_the_runs_that_have_not_failed() -> None:
    """Of 41 runs, of which one has failed: the worst two are the tail, the 39th is the 95th %."""
    y = np.random.default_rng(12).permutation(np.r_[np.arange(38.0), 60.0, 90.0])
    found = level(np.r_[y[:7], nan, y[7:]])
    assert (found.runs, found.failed, found.least, found.most) == (41, 1, 0.0, 90.0)
    assert found.mean == pytest.approx((sum(range(38)) + 150) / 40)
    assert found.median == 19.5
    assert found.std == pytest.approx(np.sqrt(((y - y.mean()) ** 2).sum() / 39))
    assert (found.within, found.within_upper) == (60.0, inf)
    worst = (60 - 19.5) ** 2 + (90 - 19.5) ** 2
    assert found.tail == pytest.approx(worst / ((y - 19.5) ** 2).sum())
    assert (found.tail_runs, found.heavy) == (2, False)
    assert level(np.r_[y[:7], nan, nan, nan, y[7:]]).within == inf  # 41st of 43
    told = level(np.r_[y, y, y, y])
    assert told.within == 37.0  # the 152nd of 160
    assert told.low < told.mean < told.high


@pytest.mark.parametrize(("runs", "known"), [(19, False), (20, True), (21, True)])
def test_a_tail_takes_20_runs(runs: int, known: bool) -> None:
    y = np.r_[np.zeros(runs - 2), 3.0, 4.0]
    found = level(y)
    assert found.tail_runs == (2 if runs > 20 else 1)
    if known:
        assert found.tail == pytest.approx(1.0 if runs > 20 else 16 / 25)
        assert found.heavy == (runs > 20)
    else:
        assert isnan(found.tail)
    flags = level(np.r_[np.zeros(runs - 1), 1.0])
    assert isnan(flags.tail)  # of what is or is not, no few runs make the mean
    assert isnan(level(np.full(runs, 3.0)).tail)
    alone = level(np.array([3.0]))
    assert isnan(alone.std)
    assert (alone.mean, alone.median, alone.tail_runs) == (3.0, 3.0, 1)


@pytest.mark.parametrize(("runs", "is_known"), [(71, False), (72, True)])
def test_a_mean_has_an_interval_from_as_many_runs_as_show_a_bad_one(
    runs: int, is_known: bool
) -> None:
    """(1 - 0.05)^n is 0.025 at most from 72 runs on; of a quarter of bad runs, from 13 on."""
    assert (0.95**runs <= 0.025) == is_known
    y = np.random.default_rng(13).normal(5.0, 1.0, runs)
    found = level(y)
    assert (not isnan(found.low)) == is_known == (not isnan(found.high))
    for some, known in ((12, False), (13, True)):
        assert (0.75**some <= 0.025) == known
        assert (not isnan(level(y[:some], 0.25).low)) == known


@pytest.mark.parametrize("comparisons", [1, 6])
@pytest.mark.parametrize(("wins", "losses", "equal"), [(60, 40, 0), (33, 47, 40), (12, 9, 3)])
def test_with_the_runs_that_are_needed_five_of_six_comparisons_decide(
    wins: int, losses: int, equal: int, comparisons: int
) -> None:
    """By the exact power of the sign test at the share of the runs that differ."""
    d = np.r_[-np.ones(wins), np.ones(losses), np.zeros(equal)]
    found = difference(d, np.zeros(len(d)), comparisons)
    assert found.verdict == "undecided"
    assert found.runs_needed is not None
    told = round(found.runs_needed * (wins + losses) / len(d))
    numbers = np.arange(told + 1)
    decides = stats.binom.cdf(told - numbers, told, 0.5) <= 0.05 / (2 * comparisons)
    share = max(wins, losses) / (wins + losses)
    assert stats.binom.pmf(numbers, told, share)[decides].sum() == pytest.approx(5 / 6, abs=0.03)


@pytest.mark.parametrize("middle", [0.0, 0.03, -0.05])
@pytest.mark.parametrize("comparisons", [1, 4])
def test_with_the_runs_that_are_needed_the_median_is_within_what_is_practical(
    middle: float, comparisons: int
) -> None:
    """The median of n normal values has the standard deviation sqrt(pi / 2 n)."""
    d = stats.norm.ppf((np.arange(400) + 0.5) / 400)
    d += middle - np.median(d)
    practical = 0.12
    found = difference(d, np.zeros(400), comparisons, practical)
    assert found.verdict == "undecided"
    assert found.runs_needed is not None
    sides = stats.norm.isf(0.05 / (2 * comparisons) / 4) + stats.norm.ppf(5 / 6)
    expected = np.pi / 2 * (sides / (practical - abs(middle))) ** 2
    assert found.runs_needed == pytest.approx(expected, rel=0.15)


@pytest.mark.parametrize(("number", "said"), [
    (0.4, 1), (1.0, 1), (9.2, 10), (10.0, 10), (10.1, 11), (99.0, 99), (100.0, 100), (101.0, 110),
    (1000.0, 1000), (1001.0, 1100), (123_456.0, 130_000),
])  # fmt: skip
def test_a_number_of_runs_has_two_digits_and_is_not_too_small(number: float, said: int) -> None:
    assert rounded_up(number) == said
