"""Sure decisions about shares: how often they are wrong, and how many runs they take."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import takewhile

import numpy as np
import pytest
from numpy.typing import NDArray
from quick import one_in
from sblcosim.require.sequential import (
    FIRST,
    LANES,
    NEAR,
    WEIGHT,
    Decision,
    Elimination,
    Rule,
    enough,
    evidence,
    looks,
    percentile,
    share_bounds,
    too_few,
)
from sblcosim.require.tables import claimed_share, surely
from scipy import integrate, optimize, stats

Floats = NDArray[np.float64]
Draw = Callable[[np.random.Generator, int, float], Floats]
LIMIT = 1.0


def normal(rng: np.random.Generator, n: int, share: float) -> Floats:
    """Normal responses, so many of which are within the limit."""
    return LIMIT + 0.2 * (rng.standard_normal(n) - stats.norm.ppf(share))


def skewed(rng: np.random.Generator, n: int, share: float) -> Floats:
    """Log-normal responses with a long tail."""
    return LIMIT * np.exp(rng.standard_normal(n) - stats.norm.ppf(share))


def contaminated(rng: np.random.Generator, n: int, share: float) -> Floats:
    """Good runs that are all within the limit, and bad ones fifty times as large."""
    return np.where(rng.random(n) < share, rng.uniform(0.5, 0.6, n), 50.0)


RESPONSES: dict[str, Draw] = {
    "normal": normal, "skewed": skewed, "contaminated": contaminated,
}  # fmt: skip


def played(
    shares: Sequence[float], draw: Draw, rng: np.random.Generator, most_runs: int = 40_000
) -> tuple[list[Decision], int]:
    """The verdicts on designs of given shares, and the runs that they have taken."""
    elimination = Elimination(
        Rule(0.95, 0.05, len(shares)), range(len(shares)), most_runs
    )
    while batches := elimination.batches():
        for batch in batches:
            made = draw(rng, batch.stop - batch.start, shares[batch.group])
            elimination.add(batch, {batch.group: int((made <= LIMIT).sum())})
    return [elimination.verdict(n) for n in range(len(shares))], elimination.spent


def is_wrong(verdict: Decision, share: float) -> bool:
    return verdict == ("fails" if share >= 0.95 else "suffices")


TWO_AT_THE_LIMIT = (0.95, 0.95, 0.80, 0.90, 0.93, 0.97, 0.98, 0.99)
NONE_WITHIN_TWO_POINTS = (0.70, 0.85, 0.90, 0.93, 0.93, 0.97, 0.97, 0.99)


@one_in(2)
@pytest.mark.parametrize("name", RESPONSES)
def test_wrong_claims_are_rare(name: str) -> None:
    """Eight designs, two exactly at the limit: at most 10 of 200 repetitions, by requirement."""
    rng = np.random.default_rng(1)
    wrong = 0
    for _ in range(200):
        verdicts, _ = played(TWO_AT_THE_LIMIT, RESPONSES[name], rng)
        wrong += any(map(is_wrong, verdicts, TWO_AT_THE_LIMIT))
        assert verdicts[2] == "fails"
        assert verdicts[-1] == "suffices"
    print(f"{name}: {wrong} of 200 wrong")
    assert wrong <= 10


@pytest.mark.slow
@pytest.mark.parametrize("name", RESPONSES)
def test_wrong_claims_are_rare_in_the_long_run(name: str) -> None:
    rng = np.random.default_rng(2)
    repetitions, all_at_limit = 2000, (0.95,) * 8
    wrong = sum(
        any(map(is_wrong, played(all_at_limit, RESPONSES[name], rng)[0], all_at_limit))
        for _ in range(repetitions)
    )
    print(f"{name}: {100 * wrong / repetitions:.2f} % wrong")
    assert stats.binomtest(wrong, repetitions, 0.05, alternative="greater").pvalue > 0.01


@pytest.mark.parametrize("shares", [NONE_WITHIN_TWO_POINTS, (0.93,) * 8, (0.97,) * 8])
def test_a_third_of_the_runs_of_equal_allocation_is_enough(shares: Sequence[float]) -> None:
    rng = np.random.default_rng(3)
    spent = []
    for _ in range(25):
        verdicts, runs = played(shares, contaminated, rng)
        assert "undecided" not in verdicts
        spent.append(runs / len(shares))
    print(f"{np.mean(spent):.0f} runs a design for shares of {shares}")
    assert np.mean(spent) <= 5000 / 3


def test_the_evidence_is_the_mixture() -> None:
    """The same by numerical integration."""
    q = 0.95
    prior = stats.beta(WEIGHT * q, WEIGHT * (1 - q))
    for passed, runs, above in ((97, 100, True), (100, 100, True), (80, 100, False)):
        ends = (q, 1.0) if above else (0.0, q)

        def ratio(p: float, s: int = passed, n: int = runs) -> float:
            return float((p / q) ** s * ((1 - p) / (1 - q)) ** (n - s))

        mass = prior.cdf(ends[1]) - prior.cdf(ends[0])
        mixed = integrate.quad(lambda p: ratio(p) * prior.pdf(p) / mass, *ends, limit=200)[0]  # noqa: B023
        near = q + NEAR * (1 - q) * (1 if above else -1)
        assert np.exp(evidence(passed, runs, q, above)) == pytest.approx(
            (ratio(near) + mixed) / 2, rel=1e-6
        )


@pytest.mark.parametrize("share", [0.05, 0.5, 0.8, 0.95, 0.99])
@pytest.mark.parametrize("above", [True, False])
def test_the_evidence_against_the_limit_has_a_mean_of_one(share: float, above: bool) -> None:
    """So Ville's inequality holds: the mean over all outcomes, exactly."""
    for runs in (1, 10, 200):
        s = np.arange(runs + 1)
        m = np.array([evidence(int(k), runs, share, above) for k in s])

        def mean(true: float, n: int = runs, s: Floats = s, m: Floats = m) -> float:
            return float(np.exp(m + stats.binom.logpmf(s, n, true)).sum())

        assert mean(share) == pytest.approx(1.0, abs=1e-9)
        for farther in (0.1, 0.5):
            assert mean(share - farther * (share if above else share - 1)) < 1.0


def test_counts_are_the_first_that_suffice() -> None:
    for runs in (200, 500, 5000):
        k, b = enough(runs, 0.95, 0.01), too_few(runs, 0.95, 0.01)
        assert evidence(k, runs, 0.95, True) >= np.log(100) > evidence(k - 1, runs, 0.95, True)
        assert evidence(b, runs, 0.95, False) >= np.log(100) > evidence(b + 1, runs, 0.95, False)
        assert b < 0.95 * runs < k <= runs
    assert enough(58, 0.95, 0.05) > 58  # no bound can be: 0.95 ** 58 is more than 5 %
    assert enough(98, 0.95, 0.05 / 8) > 98
    assert too_few(1, 0.95, 0.001) == -1


@pytest.mark.parametrize("name", RESPONSES)
def test_bounds_of_the_percentile_hold_at_all_looks_at_once(name: str) -> None:
    """Coverage: upper bounds of eight designs together, at every look; so the lower ones."""
    rng = np.random.default_rng(4)
    rule = Rule(0.95, 0.05, 8)
    ends = [*takewhile(lambda n: n < 4000, looks())]
    missed = np.zeros(2, int)
    repetitions = 100
    truth = 0.6 if name == "contaminated" else LIMIT  # of the 95th percentile
    for _ in range(repetitions):
        out = np.zeros(2, bool)
        for _ in range(8):
            values = RESPONSES[name](rng, ends[-1], 0.95)
            for n in ends:
                _, lower, upper = percentile(values[:n], rule)
                out |= [lower > truth, upper < truth]
        missed += out
    print(f"{name}: missed {missed} of {repetitions}")
    assert all(stats.binomtest(int(m), repetitions, 0.05, alternative="greater").pvalue > 0.01
               for m in missed)  # fmt: skip


def test_a_claim_is_that_of_the_bound() -> None:
    rng = np.random.default_rng(5)
    rule = Rule(0.9, 0.05, 4)
    seen = set()
    for share in (0.8, 0.9, 0.97):
        for n in (96, 400):
            values = skewed(rng, n, share)
            estimate, lower, upper = percentile(values, rule)
            verdict = rule.verdict(int((values <= LIMIT).sum()), n)
            assert (verdict == "suffices") == (upper <= LIMIT)
            assert (verdict == "fails") == (lower > LIMIT)
            assert lower <= estimate <= upper
            seen.add(verdict)
    assert seen == {"suffices", "fails", "undecided"}


def test_all_passing_runs_that_a_claim_takes() -> None:
    for rule in (Rule(0.95, 0.05, 1), Rule(0.95, 0.05, 8), Rule(0.99, 0.01, 20)):
        ends = [*takewhile(lambda n: n <= rule.least, looks())]  # noqa: B023
        assert [rule.verdict(n, n) for n in ends] == ["undecided"] * (len(ends) - 1) + ["suffices"]
    assert Rule(0.95, 0.05, 8).least >= 99  # what any bound takes


def test_how_many_runs_would_decide() -> None:
    rule, earlier = Rule(0.95, 0.05, 8), 0
    for passed, runs in ((932, 1000), (968, 1000), (96, 96), (940, 1000)):
        n = rule.runs_to_decide(passed, runs)
        assert n is not None
        assert rule.verdict(passed * n // runs, n) != "undecided"
        before = [m for m in takewhile(lambda m: m < n, looks()) if m > runs]  # noqa: B023
        assert all(rule.verdict(passed * m // runs, m) == "undecided" for m in before)
        earlier += len(before)
    assert earlier > 4
    assert rule.runs_to_decide(95, 100) is None


def test_looks_are_whole_lanes_and_grow_by_a_tenth() -> None:
    ends = [*takewhile(lambda n: n < 100_000, looks())]
    assert ends[0] == FIRST
    assert all(n % LANES == 0 for n in ends)
    ratios = np.diff(ends) / ends[:-1]
    assert (ratios > 0).all()
    assert ratios[20:] == pytest.approx(0.1, abs=0.02)


def test_conditions_share_the_risk_of_not_and_need_all_for_good() -> None:
    one, three = Rule(0.95, 0.05, 4), Rule(0.95, 0.05, 4, 3)
    assert three.enough(1000) == one.enough(1000)
    assert three.too_few(1000) < one.too_few(1000)
    e = Elimination(three, range(4), 10_000)
    for batch in e.batches():
        passing = batch.stop if batch.group == 0 or batch.condition < 2 else 0
        e.add(batch, {batch.group: passing})
    assert e.verdict(1) == "fails"  # in a single condition
    assert e.verdict(0) == "undecided"
    assert {b.group for b in e.batches()} == {0}
    while batches := e.batches():
        for batch in batches:
            e.add(batch, {0: batch.stop - batch.start})
    assert e.verdict(0) == "suffices"


def test_wrong_claims_in_conditions_are_rare() -> None:
    """A design that is at the limit in all of three conditions, and one that is not in one."""
    rng = np.random.default_rng(6)
    truth = np.array([[0.95, 0.95, 0.95], [0.99, 0.99, 0.94]])
    wrong = 0
    for _ in range(100):
        e = Elimination(Rule(0.95, 0.05, 2, 3), range(2), 30_000)
        while batches := e.batches():
            for b in batches:
                share = truth[b.group, b.condition]
                e.add(b, {b.group: int(rng.binomial(b.stop - b.start, share))})
        wrong += e.verdict(0) == "fails" or e.verdict(1) == "suffices"
    assert wrong <= 9  # 5 % of 100, and chance


def test_designs_that_share_runs_count_them_until_each_is_decided() -> None:
    e = Elimination(Rule(0.95, 0.05, 2), (0, 0), 100_000)
    rng = np.random.default_rng(7)
    while batches := e.batches():
        for b in batches:
            assert b.group == 0
            n = b.stop - b.start
            e.add(b, {0: int(rng.binomial(n, 0.5)), 1: int(rng.binomial(n, 0.965))})
    assert e.verdict(0) == "fails"
    assert e.verdict(1) == "suffices"
    assert e.seen[0, 0] == FIRST < e.seen[1, 0] == e.spent


def test_the_budget_is_kept_and_goes_to_the_cheaper_designs_first() -> None:
    e = Elimination(Rule(0.95, 0.05, 8), range(8), 290)
    assert [(b.group, b.stop) for b in e.batches()] == [(0, 96), (1, 96), (2, 96)]
    for batch in e.batches():
        e.add(batch, {batch.group: 96})
    assert e.spent == 288
    assert e.batches() == []
    assert e.verdict(0) == e.verdict(7) == "undecided"


def test_five_percent_of_bad_runs_goes_unseen_in_twenty() -> None:
    """Why a claim takes so many: a third of all samples of 20 do not have one."""
    assert pytest.approx(0.36, abs=0.005) == 0.95**20
    n = optimize.brentq(lambda n: 0.95**n - 0.05, 1, 100)
    assert int(np.ceil(n)) == 59
    assert Rule(0.95, 0.05, 1).verdict(20, 20) == "undecided"


@pytest.mark.parametrize("share", [0.5, 0.95, 0.99])
def test_a_claim_is_made_where_the_bound_of_the_share_passes_the_required_one(share: float) -> None:
    rule = Rule(share, 0.05, designs=6, conditions=2)
    for n in (96, 400, 3000):
        least, most = rule.enough(n), rule.too_few(n)
        assert least > n or share_bounds(least, n, rule)[0] > share - 2e-4
        assert share_bounds(least - 1, n, rule)[0] < share
        assert share_bounds(most, n, rule)[1] < share + 2e-4
        assert share_bounds(most + 1, n, rule)[1] > share
        for passed in range(0, n + 1, n // 8):
            low, high = share_bounds(passed, n, rule)
            wide = share_bounds(passed, n, rule, decided=False)
            assert wide[0] <= low <= passed / n <= high <= wide[1]


@pytest.mark.parametrize("share", [0.02, 0.4, 0.97])
def test_bounds_of_a_share_hold_at_all_looks_at_once(share: float) -> None:
    rule, wrong, many = Rule(0.9, 0.2, designs=1), 0, 150
    for seed in range(many):
        passed = np.cumsum(np.random.default_rng(seed).random(2000) < share)
        at = (96, 192, 480, 1000, 2000)
        bounds = [share_bounds(int(passed[n - 1]), n, rule, decided=False) for n in at]
        wrong += any(not low <= share <= high for low, high in bounds)
    assert stats.binom.sf(wrong - 1, many, 0.2) > 1e-3


def test_without_runs_or_with_all_alike_a_bound_is_at_the_end() -> None:
    rule = Rule(0.9, 0.05, designs=3)
    assert share_bounds(0, 0, rule) == (0.0, 1.0)
    for n in (96, 1000):
        assert share_bounds(0, n, rule)[0] == 0 < share_bounds(0, n, rule)[1] < 0.1
        assert share_bounds(n, n, rule)[1] == 1 > share_bounds(n, n, rule)[0] > 0.9


def test_a_decided_design_has_the_bound_of_its_claim_and_another_one_both() -> None:
    rule = Rule(0.9, 0.05, designs=3)

    def said(verdict: Decision, passed: int = 32, runs: int = 96) -> str:
        low, high = claimed_share(passed, runs, rule, verdict)
        return surely({"share_lower": low, "share_upper": high}, "lost")

    low, high = share_bounds(32, 96, rule)
    one, two = f"≥ {np.floor(100 * low):.0f} %", f"≤ {np.ceil(100 * high):.0f} %"
    assert said("suffices") == one
    assert said("fails") == two
    low, high = share_bounds(32, 96, rule, decided=False)
    both = f"≥ {np.floor(100 * low):.0f} %, ≤ {np.ceil(100 * high):.0f} %"
    assert said("undecided") == both
    assert said("undecided", 0, 0) == "–"
    assert surely({"lower": 0.0, "upper": 1.0}, "") == "≥ 0, ≤ 1"
