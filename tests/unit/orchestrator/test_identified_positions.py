"""White and slow parts of positions: prior, search and intervals against a dense calculation."""

from __future__ import annotations

from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from sblcosim.identification import positions
from sblcosim.identification.positions import DRAWS, FEW, MOST, parts
from sblcosim.identification.swings import CarrierSwing
from scipy import stats
from scipy.optimize import brentq, minimize
from seams import Seam


def wandering(rng: Any, time: Any, white: float, slow: float, tau: float, axes: int = 2) -> Any:
    """Positions with both parts, about a place of their own."""
    lag = np.abs(np.subtract.outer(time, time))
    root = np.linalg.cholesky(slow**2 * np.exp(-lag / tau) + (white**2 + 1e-14) * np.eye(len(lag)))
    return root @ rng.normal(size=(len(time), axes)) + rng.uniform(-30, 30, axes)


def uneven(rng: Any, n: int, step: float) -> Any:
    return 100.0 + step * np.cumsum(rng.uniform(0.3, 1.7, n))


class Dense:
    """The posterior of series, with the covariance of all their positions."""

    def __init__(self, series: Any, swings: Any = ()) -> None:
        self.lags = [np.abs(np.subtract.outer(t, t)) for t, _ in series]
        self.off = [place - place.mean(axis=0) for _, place in series]
        spread = np.mean([place.std(axis=0).mean() for place in self.off])
        jump = np.mean([np.diff(place, axis=0).std(axis=0).mean() for place in self.off])
        self.known = [
            900 * spread**2
            + sum((s.amplitude**2 * np.cos(2 * np.pi * s.frequency * lag) for s in swings), 0 * lag)
            for lag in self.lags
        ]
        span = max(np.ptp(t) for t, _ in series)
        self.guess = np.log([max(jump / np.sqrt(2), spread / 1000), spread, span / 10])
        self.least = np.log(2 * min(np.median(np.diff(t)) for t, _ in series))

    def likelihood(self, at: Any) -> float:
        low = [*(self.guess[:2] - 10), self.least]
        white, slow, tau = np.exp(np.clip(at, low, self.guess + 10))
        total = 0.0
        for lag, known, off in zip(self.lags, self.known, self.off, strict=True):
            C = known + slow**2 * np.exp(-lag / tau) + (white**2 + 1e-12) * np.eye(len(lag))
            root = np.linalg.cholesky(C)
            within = np.linalg.solve(root, off)
            total -= 0.5 * np.sum(within**2) + off.shape[1] * (
                np.log(np.diag(root)).sum() + len(lag) * np.log(2 * np.pi) / 2)
        return total

    def posterior(self, at: Any) -> float:
        return self.likelihood(at) - np.sum((at - self.guess) ** 2) / 32


class Search:
    """Stands in for the minimiser: it keeps what it is given, and goes a step on."""

    def __init__(self, *steps: Any) -> None:
        self.steps, self.calls = list(steps), []  # type: ignore[var-annotated]

    def __call__(self, of: Any, begin: Any, **_: Any) -> Any:
        self.calls.append((of, np.array(begin)))
        step = self.steps[len(self.calls) - 1] if len(self.calls) <= len(self.steps) else 0.0
        return SimpleNamespace(x=begin + step)


WHITE, SLOW, TIME = (-6.0, -4.0, -2.0, 0.0), (-1.0, 0.0, 1.0), (-4.0, -2.5, -1.0, 0.5, 2.0)


def test_the_search_begins_at_the_best_of_a_grid(seam: Seam) -> None:
    """Series that do not change, or are short, tell nothing."""
    rng = np.random.default_rng(3)
    begun = []
    search = Search()
    seam.instead(minimize, search, only=positions)
    for together, white, slow, tau in (
        (1, 0.3, 1.0, 8.0), (1, 0.3, 0.0, 8.0), (1, 0.0, 1.0, 40.0), (1, 0.05, 1.0, 20.0),
        (1, 0.6, 0.5, 3.0), (1, 0.1, 0.9, 2.5), (1, 0.25, 1.0, 3.0), (1, 0.4, 0.6, 4.0),
        (3, 0.003, 1.0, 0.4), (3, 0.003, 1.0, 0.05), (3, 0.03, 1.0, 0.05), (3, 0.01, 1.0, 1.0),
        (3, 0.003, 1.0, 2.0), (3, 0.02, 1.0, 0.1),
    ):
        series = []
        for n in (FEW, 41):
            time = uneven(rng, n, 1.0)
            for i in range(1, together):  # in pairs and the like they tell a small noise
                time[i::3] = time[: n - i : 3] + 1e-4 * i
            series.append((time, wandering(rng, time, white, slow, tau)))
        series.append((time, np.ones((41, 2))))
        series.append((time[: FEW - 1], wandering(rng, time[: FEW - 1], 5.0, 5.0, 9.0)))
        dense = Dense(series[:2])
        grid = [dense.guess + np.array(each) for each in product(WHITE, SLOW, TIME)]
        best = grid[int(np.argmax([dense.posterior(at) for at in grid]))]
        begun.append(best - dense.guess)
        search.calls.clear()
        step = rng.normal(0, 0.3, 3)
        search.steps = [step]
        found = parts(series)
        (_, begin), (_, no_white), (_, no_slow) = search.calls
        assert found is not None
        assert begin == pytest.approx(best)
        assert found.at == pytest.approx(best + step)
        assert found.span_s == pytest.approx(2 * sum(np.ptp(time) for time, _ in series[:2]))
        assert no_white == pytest.approx(found.at[1:])
        assert no_slow == pytest.approx([max(dense.guess[1], found.at[0])])
    for i, shifts in enumerate((WHITE, SLOW, TIME)):
        assert {round(each[i], 6) for each in begun} == set(shifts)


@pytest.mark.parametrize(("part", "white", "slow"), [(0, 0.05, 1.0), (1, 0.4, 0.0)])
def test_a_part_is_there_that_raises_the_logarithm_of_the_likelihood_by_four_and_a_half(
    part: int, white: float, slow: float, seam: Seam
) -> None:
    rng = np.random.default_rng(5)
    search = Search()
    seam.instead(minimize, search, only=positions)
    time = uneven(rng, FEW, 1.0)
    series = [(time, wandering(rng, time, white, slow, 20.0))]
    dense = Dense(series)
    parts(series)
    at = search.calls[0][1]
    begin = [search.calls[1][1], search.calls[2][1]]

    def gain(step: float) -> float:
        less = ([dense.guess[0] - 9, *(begin[0] + step)],
                [*(begin[1] + step), dense.guess[1] - 9, at[2]])[part]
        return dense.likelihood(at) - dense.likelihood(np.array(less))

    for raised in (2.5, 4.4, 4.6, 8.0):
        search.calls.clear()
        search.steps = [0.0, 0.0, 0.0]
        search.steps[1 + part] = brentq(lambda step, r=raised: gain(step) - r, 0.0, 6.0)
        found = parts(series)
        assert found is not None
        assert found.there[part] == (raised > 4.5)


@pytest.mark.parametrize("scale", [1.0, 1e-6])
def test_the_cost_of_the_search_is_that_of_all_positions_together(
    scale: float, seam: Seam
) -> None:
    """With swings, of series of several lengths, also far from what is usual; and its slope."""
    rng = np.random.default_rng(6)
    swings = [CarrierSwing(0.02, 0.7 * scale), CarrierSwing(0.13, 0.2 * scale)]
    search = Search([0.1, -0.2, 0.3], [-0.3, 0.2], [0.4])
    seam.instead(minimize, search, only=positions)
    series = []
    for n, step in ((37, 1.0), (52, 0.6), (31, 2.2)):
        time = uneven(rng, n, step)
        series.append((time, wandering(rng, time, 0.2, 1.0, 6.0, axes=3) * scale))
    found = parts(series, swings)
    assert found is not None
    dense = Dense(series, swings)
    whole = search.calls[0][1] + [0.1, -0.2, 0.3]
    for (of, begin), free, rest in zip(search.calls, ([0, 1, 2], [1, 2], [0]), (
        whole, [dense.guess[0] - 9, *whole[1:]], [0.0, dense.guess[1] - 9, whole[2]],
    ), strict=True):
        for shift in (*rng.normal(0, 1.0, (3, 3)), [-11, 0, 0], [0, -11.5, 0], [0, 0, 11],
                      [0, 0, -4.0], [9.0, 9.0, 0], [1, 11, 0]):
            x = begin + np.array(shift)[free]

            def full(x: Any, rest: Any = rest, free: Any = free) -> Any:
                at = np.array(rest)
                at[free] = x
                return at

            value, slope = of(x)
            few = abs(value) > 1e5  # digits of the dense problem
            expected = -dense.posterior(full(x))
            assert value == pytest.approx(expected, rel=1e-2 if few else 1e-5, abs=1e-5)
            if few:
                continue
            for i, unit in enumerate(1e-3 * np.eye(len(x))):
                rise = dense.posterior(full(x - unit)) - dense.posterior(full(x + unit))
                assert slope[i] == pytest.approx(rise / 2e-3, rel=1e-3, abs=2e-3)


@pytest.mark.parametrize("slow", [1.0, 0.0])
def test_intervals_are_those_of_draws_that_weigh_as_they_are_probable(
    slow: float
) -> None:
    """From Student's distribution with five degrees of freedom, a fifth wider than the curvature
    tells; nowhere wider than the prior is."""
    rng = np.random.default_rng(8)
    time = uneven(rng, FEW, 1.0)
    series = [(time, wandering(rng, time, 0.3, slow, 5.0))]
    found = parts(series)
    assert found is not None
    dense, h = Dense(series), 0.02
    H = np.empty((3, 3))
    for i, a in enumerate(h * np.eye(3)):
        for j, b in enumerate(h * np.eye(3)):
            up, down = (dense.posterior(found.at + d) for d in (a + b, -a - b))
            H[i, j] = up + down - sum(dense.posterior(found.at + d) for d in (a - b, b - a))
    values, vectors = np.linalg.eigh(-H / (2 * h) ** 2)
    assert (values.min() < 1 / 8) == (slow == 0)
    root = 1.2 * vectors / np.sqrt(np.maximum(values, 1 / 16))
    uniform = stats.qmc.Sobol(4, seed=np.random.default_rng(0)).random(DRAWS)
    far = np.sqrt(stats.chi2.ppf(uniform[:, 3], 5) / 5)
    draws = found.at + (stats.norm.ppf(uniform[:, :3]) / far[:, None]) @ root.T
    thin = stats.multivariate_t(found.at, root @ root.T, df=5).logpdf(draws)
    weight = np.array([dense.posterior(each) for each in draws]) - thin
    weight = np.exp(weight - weight.max())
    for i in range(3):
        order = np.argsort(draws[:, i])
        below = np.concatenate([[0.0], np.cumsum(weight[order])]) / weight.sum()
        ends = np.interp([0.025, 0.975], (below[1:] + below[:-1]) / 2, draws[order, i])
        assert found.ends[:, i] == pytest.approx(ends, abs=1e-4)


def test_of_a_long_series_groups_of_three_epochs_count(seam: Seam) -> None:
    """Each epoch once, whatever their order."""
    rng, n = np.random.default_rng(9), 2 * MOST + 1
    search = Search()
    seam.instead(minimize, search, only=positions)
    time = uneven(rng, n, 1.0)
    line = np.outer(time - time[0], [0.1, -0.2]) + rng.normal(size=(n, 2))
    parts([(time, line)])
    groups = np.arange(n) // 3 % 3 == 0
    dense = Dense([(time[groups], line[groups])])
    of, begin = search.calls[0]
    assert of(begin)[0] == pytest.approx(-dense.posterior(begin))
    order = rng.permutation(n)
    parts([(np.append(time[order], time[:9]), np.concatenate([line[order], 9 + line[:9]]))])
    again = begin
    of, begin = search.calls[3]
    assert begin.tolist() == again.tolist()
    assert of(begin)[0] == search.calls[0][0](begin)[0]


def test_of_a_straight_line_the_first_guess_of_the_noise_is_a_thousandth(seam: Seam) -> None:
    search = Search()
    seam.instead(minimize, search, only=positions)
    time = np.arange(2.0 * FEW)
    line = np.outer(time, [1.0, -2.0]) + 0.01 * np.sin(3 * time)[:, None]
    assert parts([(time, line)]) is not None
    of, begin = search.calls[0]
    dense = Dense([(time, line)])
    assert dense.guess[0] == pytest.approx(dense.guess[1] - np.log(1000))
    assert of(begin)[0] == pytest.approx(-dense.posterior(begin))


def test_positions_that_change_by_a_nanometre_have_parts() -> None:
    rng = np.random.default_rng(2)
    time, moved = np.arange(40.0), rng.normal(size=(40, 2))
    moved = (moved - moved.mean(axis=0)) / moved.std(axis=0)
    assert parts([(time, 0.9e-9 * moved)]) is None
    assert parts([(time, 1.1e-9 * moved)]) is not None
