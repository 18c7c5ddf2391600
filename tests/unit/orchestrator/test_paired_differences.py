"""All that is said of a paired difference, against a second calculation."""

from __future__ import annotations

from dataclasses import fields
from decimal import ROUND_CEILING, Context, Decimal
from math import inf, nan, sqrt

import numpy as np
import pytest
from numpy.typing import NDArray
from sblcosim.analysis.common.bounds import LEAST_RUNS
from sblcosim.comparison.common.statistics import (
    MOST_RUNS,
    Difference,
    difference,
    level,
    mean_interval,
)
from scipy import stats

Floats = NDArray[np.float64]


def has_tail(d: Floats) -> bool:
    """Whether the twentieth of the runs on one side makes two thirds of the squares."""
    squares = (d - np.median(d)) ** 2
    if len(d) < 20 or not squares.sum():
        return False
    worst = -(-len(d) // 20)
    order = np.argsort(d, kind="stable")
    return bool(max(squares[order[-worst:]].sum(), squares[order[:worst]].sum())
                > 2 / 3 * squares.sum())  # fmt: skip


def said_again(
    one: Floats, other: Floats, comparisons: int, practical: float | None, contamination: float
) -> Difference:
    """The same, run by run and number by number."""
    pairs = [(a if np.isfinite(a) else inf, b if np.isfinite(b) else inf)
             for a, b in zip(one, other, strict=True)]  # fmt: skip
    known = sorted(0.0 if a == b else a - b for a, b in pairs if a < inf or b < inf)
    n, both = len(pairs), [a - b for a, b in pairs if a < inf and b < inf]
    wins, losses = sum(a < b for a, b in pairs), sum(a > b for a, b in pairs)
    risk = 0.05 / 2 / comparisons
    own = risk / 4
    whole = len(both) == n
    alike = whole and not has_tail(np.array(both))

    place = 0
    while place < len(known) // 2 and stats.binom.cdf(place, len(known), 0.5) <= own:
        place += 1
    low, high = (known[place - 1], known[-place]) if place else (nan, nan)
    middle = nan
    if known:
        a, b = known[(len(known) - 1) // 2], known[len(known) // 2]
        middle = a if a == b else (a + b) / 2

    told = stats.binomtest(min(wins, losses), wins + losses).pvalue / 2 <= risk if (
        wins != losses) else False  # fmt: skip
    verdict = "undecided"
    if practical is not None and abs(low) <= practical and abs(high) <= practical and alike:
        verdict = "equal"
    elif told:
        verdict = "better" if wins > losses else "worse"

    least = next(m for m in range(1, 999) if 0.5**m <= risk)
    mean_least = next(m for m in range(LEAST_RUNS, 9999) if (1 - contamination) ** m <= own)
    mean, mean_low, mean_high = nan, nan, nan
    if both:
        mean = sum(both) / len(both)
    if verdict != "undecided" and n >= mean_least and alike:
        _, mean_low, mean_high = mean_interval(np.array(both), own)

    needed: list[float] = []
    likely = stats.norm.ppf(5 / 6)
    if verdict == "undecided" and n >= LEAST_RUNS:
        if wins != losses:
            share = max(wins, losses) / (wins + losses)
            spread = stats.norm.isf(risk) * 0.5 + likely * sqrt(share - share**2)
            differing = max(least, spread**2 / (share - 0.5) ** 2)
            needed.append(differing / (wins + losses) * n)
        if practical is not None and np.isfinite([low, high]).all() and -practical < middle < (
            practical
        ):
            margin = likely * (high - low) / (2 * stats.norm.isf(own))
            factor = max((high - middle + margin) / (practical - middle),
                         (middle - low + margin) / (practical + middle))  # fmt: skip
            needed.append(n * factor**2)
    runs = None
    if needed and min(needed) <= MOST_RUNS:
        two_digits = Context(prec=2, rounding=ROUND_CEILING)
        few = Decimal(min(needed))
        rounded = few.to_integral_value(ROUND_CEILING) if few < 10 else two_digits.plus(few)
        runs = max(least, int(rounded))
    winners = max(wins, losses)
    return Difference(
        n, wins, losses, verdict,
        float(stats.beta.ppf(risk, winners, n - winners + 1)) if told else nan,
        middle, low, high, mean, mean_low, mean_high, least, mean_least, runs,
    )  # fmt: skip


def drawn(random: np.random.Generator) -> tuple[Floats, Floats]:
    """Responses of two receivers: smooth, in steps, with a tail, or with failed runs."""
    n = int(random.choice([1, 2, 3, 5, 6, 8, 11, 19, 20, 21, 40, 73, 99, 100, 180, 420]))
    kind = random.integers(5)
    one, other = random.gamma(4.0, 0.25, n), random.gamma(4.0, 0.25, n)
    one += random.choice([-0.6, -0.2, -0.05, 0.0, 0.04, 0.3])
    if kind == 1:
        one, other = np.round(one * 4) / 4, np.round(other * 4) / 4
    elif kind == 2:
        one = other + random.choice([-0.125, 0.0, 0.125], n, p=random.dirichlet([2, 3, 2]))
        one = np.round(one * 64) / 64
        other = np.round(other * 64) / 64
    elif kind == 3:
        one[random.random(n) < random.choice([0.02, 0.1])] += random.choice([-40.0, 40.0])
    elif kind == 4:
        one[random.random(n) < 0.1] = nan
        other[random.random(n) < 0.2] = nan
    return one, other


def test_all_that_is_said_of_a_difference_is_what_a_second_calculation_says() -> None:
    random = np.random.default_rng(61)
    verdicts, kinds = [], set()
    for _ in range(250):
        one, other = drawn(random)
        comparisons = int(random.choice([1, 3, 10]))
        practical = (None, 0.125, 0.25, 0.4)[random.integers(4)]
        contamination = float(random.choice([0.05, 0.1]))
        found = difference(one, other, comparisons, practical, contamination)
        again = said_again(one, other, comparisons, practical, contamination)
        for it in fields(Difference):
            mine, second = getattr(found, it.name), getattr(again, it.name)
            told = mine == second if isinstance(mine, str) or mine is None else (
                mine == pytest.approx(second, rel=1e-9, abs=1e-12, nan_ok=True))
            assert told, (it.name, mine, second)
        verdicts.append(found.verdict)
        kinds.add((found.verdict, found.runs_needed is None, np.isnan(found.mean_low)))
    assert min(verdicts.count(word) for word in ("better", "worse", "equal", "undecided")) > 5
    assert len(kinds) == 8


def test_the_interval_of_a_mean_starts_at_the_least_number_of_runs() -> None:
    random = np.random.default_rng(62)
    for comparisons in (1, 5):
        least = difference(np.ones(2), np.zeros(2), comparisons).mean_least
        for n, known in ((least - 1, False), (least, True)):
            d = random.normal(-3.0, 1.0, n)
            assert np.isfinite(difference(d, np.zeros(n), comparisons).mean_low) == known


def test_no_number_of_runs_is_told_that_nobody_could_make() -> None:
    for n, known in ((2001, True), (40_001, False)):
        d = np.where(np.arange(n) % 2, 1.0, -1.0)
        assert (difference(d, np.zeros(n)).runs_needed is not None) == known


def test_a_level_of_infinite_and_missing_runs_keeps_the_bound_on_the_other_side() -> None:
    """A run without a response may be as bad as can be, but never better than the best one."""
    y = np.random.default_rng(63).gamma(3.0, 1.0, 120)
    _, low, high = mean_interval(np.r_[y, inf], 0.01)
    assert high == inf
    assert low == mean_interval(np.r_[y, y.max()], 0.01)[1]
    _, low, high = mean_interval(np.r_[-inf, y, nan], 0.01)
    assert low == -inf
    assert high == mean_interval(np.r_[y, y.min()], 0.01)[2]
    bound = mean_interval(np.r_[y, y.max()], 0.025)[1]
    assert level(np.r_[y, nan]).low == pytest.approx(bound, rel=1e-9)


def test_a_mean_has_an_interval_from_three_values_on() -> None:
    y = np.array([1.0, 2.5, 4.0])
    for few in (y[:1], y[:2], np.r_[y[:2], nan], np.r_[y[:2], inf, -inf]):
        mean, *ends = mean_interval(few, 0.1)
        assert (mean, ends) == (few[np.isfinite(few)].mean(), [-inf, inf])
    mean, low, high = mean_interval(y, 0.1)
    assert -inf < low < mean == 2.5 < high < inf
    assert low + high == pytest.approx(2 * mean)
