"""Sure decisions about shares, made while runs come in.

A run passes or fails. An *arm* is a design in one of the conditions in which it must suffice. The
question is whether the share of an arm's passing runs is at least q. With s of n runs passing, the
evidence against the share q is a mixture of likelihood ratios,

    M = ½ (p₁/q)ˢ ((1 − p₁)/(1 − q))ⁿ⁻ˢ + ½ ∫ (p/q)ˢ ((1 − p)/(1 − q))ⁿ⁻ˢ dF(p).

For *good* all p are above q, for *bad* all are below. Then M is a nonnegative supermartingale under
every share on the other side, and by Ville's inequality P(M ≥ 1/risk for any n) ≤ risk. The bound
holds at all times at once, whatever the distribution of the responses, and whenever one looks (H.
Robbins, Ann. Math. Statist. 41, 1970, 1397–1409; S. R. Howard, A. Ramdas, J. McAuliffe and
J. Sekhon, Ann. Statist. 49, 2021, 1055–1080). F is the Beta distribution with mean q and the weight
of `WEIGHT` runs, cut off at q; p₁ is `NEAR` of the way from q to the nearer of 0 and 1: two
points at q = 0.95. The same counts bound the percentile q of any response, because the share of the
runs below the true percentile is at most q (Howard and Ramdas, Bernoulli 28, 2022, 1704–1728).

Each claim has a share of the risk. With D designs and C conditions, a design is *good* if it is in
every condition. A wrong claim of this needs an error in a condition where the design is not good,
so each condition may use the whole risk/D (intersection-union test: R. L. Berger, Technometrics 24,
1982, 295–300). A design is *not* good if it fails in some condition, for which each condition has
risk/(D C). A design is either good or not, so both claims have the whole risk.

For an undecided design both bounds are stated at once, in whichever condition. Each of the 2 D C
bounds has risk/(2 D C), so all these intervals together have the whole risk, too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from math import log, log1p
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Decision = Literal["suffices", "fails", "undecided"]

WEIGHT = 50.0
"""Weight of the continuous part of the mixture [runs]."""
NEAR = 0.4
"""Distance of the other part from q, as a share of the way to the nearer of 0 and 1."""
FIRST, GROWTH, LANES = 96, 1.1, 8
"""Runs of an arm at its first look, factor from look to look, and common divisor of the looks: the
largest number of lanes of a processor."""

MOST_RUNS = 10_000_000
"""Largest budget."""


def looks() -> Iterator[int]:
    """Numbers of runs at which an arm is looked at, ascending without end."""
    runs = FIRST
    while True:
        yield runs
        runs = max(runs + LANES, LANES * round(GROWTH * runs / LANES))


def evidence(passed: int, runs: int, share: float, above: bool) -> float:
    """Logarithm of the mixture M for a share above, or below, the required one."""
    from scipy import special

    a, b = WEIGHT * share, WEIGHT * (1 - share)
    cut = special.betaincc if above else special.betainc
    failed = runs - passed
    null = passed * log(share) + failed * log1p(-share)
    near = share + NEAR * min(share, 1 - share) * (1 if above else -1)
    point = passed * log(near) + failed * log1p(-near) - null
    kept = cut(a + passed, b + failed, share) / cut(a, b, share)
    if kept <= 0:  # nearly all of the evidence is on the other side
        return float(point - log(2))
    whole = special.betaln(a + passed, b + failed) - special.betaln(a, b) + log(kept) - null
    return float(np.logaddexp(point, whole) - log(2))


@cache
def enough(runs: int, share: float, risk: float) -> int:
    """Fewest passing runs that surely meet the required share; `runs` + 1 if no number does."""
    low, high = 0, runs + 1  # the evidence grows with each run that passes
    while low < high:
        middle = (low + high) // 2
        if evidence(middle, runs, share, above=True) >= -log(risk):
            high = middle
        else:
            low = middle + 1
    return low


@cache
def too_few(runs: int, share: float, risk: float) -> int:
    """Most passing runs that surely miss the required share; −1 if no number does."""
    low, high = -1, runs
    while low < high:
        middle = (low + high + 1) // 2
        if evidence(middle, runs, share, above=False) >= -log(risk):
            low = middle
        else:
            high = middle - 1
    return low


@dataclass(frozen=True)
class Rule:
    """When a design is surely good, and when it surely is not.

    Attributes
    ----------
    share
        Share of the runs that must pass.
    risk
        Risk of any wrong claim about any design.
    designs, conditions
        Numbers of designs and conditions; a design must be good in all conditions.
    """

    share: float
    risk: float
    designs: int
    conditions: int = 1

    def enough(self, runs: int) -> int:
        """Fewest passing runs of an arm that is surely good; more than `runs` if no number is
        enough."""
        return enough(runs, self.share, self.risk / self.designs)

    def too_few(self, runs: int) -> int:
        """Most passing runs of an arm that is surely not good; −1 if there is no such number."""
        return too_few(runs, self.share, self.risk / (self.designs * self.conditions))

    def verdict(self, passed: int, runs: int) -> Decision:
        """The sure verdict on an arm."""
        if runs and passed >= self.enough(runs):
            return "suffices"
        return "fails" if runs and passed <= self.too_few(runs) else "undecided"

    def runs_to_decide(self, passed: float, runs: int, most: int = MOST_RUNS) -> int | None:
        """Number of runs at the look that would decide an arm if its share stayed the same.

        None means that not even `most` would.
        """
        for n in looks():
            if n > most:
                return None
            same = int(passed * n // max(runs, 1))
            if n > runs and self.verdict(same, n) != "undecided":
                return n
        return None

    @property
    def least(self) -> int:
        """Runs at the first look that can say *good*, if all of them pass."""
        return next(n for n in looks() if self.enough(n) <= n)


@dataclass(frozen=True)
class Batch:
    """Runs to make: those of a group of designs in a condition, after the first ``start``."""

    group: int
    condition: int
    start: int
    stop: int


@dataclass
class Elimination:
    """Which designs are decided, and which runs are next.

    All undecided arms go from look to look together, beginning with those of the cheaper designs if
    the budget does not cover all. A design gets no further runs once it is decided, and an arm once
    it is good.

    Attributes
    ----------
    groups
        For each design, the cheapest first: the group of designs with which it shares its runs.
    most_runs
        Budget of runs for everything.
    prices
        Price of each design. With prices, designs dearer than one that suffices get no new runs.
    runs
        Runs so far, by group and condition.
    seen, passed
        By design and condition: the runs that count, which are those until it was decided, and the
        number of these that passed.
    """

    rule: Rule
    groups: Sequence[int]
    most_runs: int
    prices: Sequence[float] | None = None
    runs: Ints = field(init=False)
    seen: Ints = field(init=False)
    passed: Ints = field(init=False)

    def __post_init__(self) -> None:
        self.runs = np.zeros((max(self.groups) + 1, self.rule.conditions), np.int64)
        self.seen = np.zeros((len(self.groups), self.rule.conditions), np.int64)
        self.passed = np.zeros_like(self.seen)
        self._members: dict[int, list[int]] = {}
        for design, group in enumerate(self.groups):
            self._members.setdefault(group, []).append(design)

    def arm(self, design: int, condition: int) -> Decision:
        """The sure verdict on a design in a condition."""
        return self.rule.verdict(
            int(self.passed[design, condition]), int(self.seen[design, condition])
        )

    def verdict(self, design: int) -> Decision:
        """The sure verdict on a design."""
        arms = {self.arm(design, c) for c in range(self.rule.conditions)}
        return next(v for v in ("fails", "undecided", "suffices") if v in arms)

    @property
    def spent(self) -> int:
        """Runs so far."""
        return int(self.runs.sum())

    def batches(self, known: Callable[[Batch], bool] = lambda batch: False) -> list[Batch]:
        """The next batches; none if everything is decided or the budget is used up.

        Parameters
        ----------
        known
            Whether all runs of a batch exist already: those count, whatever the budget is.
        """
        left, found = self.most_runs - self.spent, {}
        verdicts = [self.verdict(design) for design in range(len(self.groups))]
        for design, group in enumerate(self.groups):
            if verdicts[design] != "undecided":
                continue
            dear = self._too_dear(design, verdicts)
            for condition in range(self.rule.conditions):
                done = int(self.runs[group, condition])
                batch = Batch(group, condition, done, next(n for n in looks() if n > done))
                place, size = (group, condition), batch.stop - done
                if place in found or self.arm(design, condition) != "undecided":
                    continue
                if (size <= left and not dear) or known(batch):
                    found[place] = batch
                    left -= size
        return list(found.values())

    def _too_dear(self, design: int, verdicts: Sequence[Decision]) -> bool:
        """Whether a cheaper design surely suffices, if that ends the search."""
        if self.prices is None or "suffices" not in verdicts:
            return False
        return self.prices[verdicts.index("suffices")] < self.prices[design]

    def add(self, batch: Batch, passed: Mapping[int, int]) -> None:
        """Record how many runs of a batch have passed, by design; decided designs are skipped."""
        self.runs[batch.group, batch.condition] = batch.stop
        for design in self.counting(batch):
            self.seen[design, batch.condition] = batch.stop
            self.passed[design, batch.condition] += passed[design]

    def counting(self, batch: Batch) -> list[int]:
        """Designs for which the runs of a batch count."""
        return [
            design
            for design in self._members[batch.group]
            if self.seen[design, batch.condition] == batch.start
            and self.arm(design, batch.condition) == "undecided"
        ]


def percentile(
    values: NDArray[np.float64], rule: Rule, decided: bool = True
) -> tuple[float, float, float]:
    """The percentile of an arm's response that must be within the limit, and its two bounds.

    Parameters
    ----------
    values
        Responses of the runs in any order; infinite if a run failed.
    decided
        Whether only the bound of the claim is stated. Otherwise both are, and hold at once.

    Returns
    -------
    estimate, lower, upper
        The order statistic x₍⌈q n⌉₎ of n runs, which at least the share q of them does not exceed,
        and bounds of the percentile. The bounds of claims hold for all designs together, separately
        for each kind. Both bounds of undecided designs hold together. Infinite where there is no
        bound.
    """
    n = len(values)
    if n == 0:
        return float("nan"), -np.inf, np.inf
    ordered = np.sort(values)
    rank = max(int(np.ceil(rule.share * n - 1e-9)), 1)
    if decided:
        few, many = rule.too_few(n), rule.enough(n)
    else:
        half = rule.risk / (2 * rule.designs * rule.conditions)
        few, many = too_few(n, rule.share, half), enough(n, rule.share, half)
    return (
        float(ordered[rank - 1]),
        float(ordered[few]) if few >= 0 else -np.inf,
        float(ordered[many - 1]) if many <= n else np.inf,
    )


def share_bounds(passed: int, runs: int, rule: Rule, decided: bool = True) -> tuple[float, float]:
    """Bounds of the share of an arm's runs that pass: what `percentile` is for a response.

    Parameters
    ----------
    decided
        Whether only the bound of the claim is stated. Otherwise both are, and hold at once.

    Returns
    -------
    lower, upper
        To 1e-4; 0 and 1 where there is no bound. No share below the lower one, and none above the
        upper one, is compatible with the runs: for these the evidence against the share suffices.
    """
    each = rule.risk / (rule.designs * rule.conditions)
    risks = (rule.risk / rule.designs, each) if decided else (each / 2, each / 2)
    found = passed / runs if runs else 0.5
    ends = []
    for end, above, risk in ((0.0, True, risks[0]), (1.0, False, risks[1])):
        refuted, kept = end, found
        while abs(kept - refuted) > 1e-4:
            middle = (refuted + kept) / 2
            if evidence(passed, runs, middle, above) >= -log(risk):
                refuted = middle
            else:
                kept = middle
        ends.append(refuted)
    return ends[0], ends[1]
