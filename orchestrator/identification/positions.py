"""White and slow parts of the error of reported positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats
from scipy.optimize import minimize

from ..data.estimates import Floats, Integers
from .swings import CarrierSwing, sines

MOST = 400
"""Number of positions of a series that are used; of more, groups at regular intervals."""
FEW = 30
_GROUP = 3
_FAR = 30.0
"""Uncertainty of the mean before any position, over the spread of the positions."""
_SLOW = 2.0
"""Shortest correlation time over the usual step: what is faster counts as white."""
_STEP, _WIDE_STEP = 1e-4, 2e-2
_WIDTH = 4.0
"""Width of the weak priors of the logarithms."""
_GRID = (-6.0, -4.0, -2.0, 0.0), (-1.0, 0.0, 1.0), (-4.0, -2.5, -1.0, 0.5, 2.0)
"""Logarithms about their guesses at which the search begins: white, slow, time."""
_REACH = 10.0
"""Most by which a logarithm differs from its guess."""
_GONE = -9.0
"""Logarithm of a part over its guess with which it is absent."""
DRAWS, _FREEDOM, _SPREAD = 512, 5, 1.2
"""Draws of the parameters, from Student's distribution about the most probable ones."""
GAIN = 9.0
"""Twice the gain of the log-likelihood above which a part is there."""
_ENDS = (0.025, 0.975)


@dataclass(frozen=True, eq=False)
class PositionParts:
    """Logarithms of the white and the slow standard deviation [m] and of the slow one's time [s].

    Attributes
    ----------
    at, ends
        The most probable ones, (3,), and the ends of their 95 % intervals, (2, 3).
    there
        Whether the white and the slow part explain the positions better than if there were none.
    span_s
        Length of the series, all of them and both axes together [s].
    """

    at: Floats
    ends: Floats
    there: tuple[bool, bool]
    span_s: float


def parts(
    series: Sequence[tuple[Floats, Floats]], swings: Sequence[CarrierSwing] = ()
) -> PositionParts | None:
    """The parts of the error, from the posterior of a constant, a white and a Gauss-Markov error.

    Parameters
    ----------
    series
        Epochs [s], (n,), and horizontal positions [m], (n, axes): of each carrier one. All have
        the same parts.
    swings
        Of the carriers, about their mean.

    Returns
    -------
    PositionParts or None
        None if the positions are few, or do not change.
    """
    chosen = [_thinned(*one) for one in series]
    chosen = [one for one in chosen if len(one[0]) >= FEW and float(one[1].std()) > 0]
    spread = [float(np.mean(np.std(position, axis=0))) for _, position in chosen]
    if not chosen or max(spread) < 1e-9:
        return None
    problem = _Problem.of(chosen, swings)
    at, most = problem.best(problem.begin(), np.arange(3))
    ends = problem.ends(at)
    gone = [problem.without(0, at), problem.without(1, at)]
    there = (2 * (most - gone[0]) > GAIN, 2 * (most - gone[1]) > GAIN)
    total = sum(float(np.ptp(time)) * position.shape[1] for time, position in chosen)
    return PositionParts(at, ends, there, total)


def _thinned(time: Floats, position: Floats) -> tuple[Floats, Floats]:
    """A series with each epoch once, and of a long one groups at regular intervals."""
    time, first = np.unique(time, return_index=True)
    every = -(-len(time) // MOST)
    rows: Integers = np.flatnonzero(np.arange(len(time)) // _GROUP % every == 0)
    return time[rows], position[first][rows]


@dataclass(frozen=True, eq=False)
class _Problem:
    """Series side by side, the shorter ones filled up with steps that say nothing.

    Attributes
    ----------
    dt, position, used
        Steps [s] and whether they hold a position, (n, series); positions, (n, series, axes).
    shape
        Of the mean, the slow error and the swings in a position, (n, series, states).
    prior
        Standard deviations of the states but the slow error, (states,).
    guess, least
        Of the logarithms, (3,); the least one of the time.
    """

    dt: Floats
    position: Floats
    used: Floats
    shape: Floats
    prior: Floats
    guess: Floats
    least: float

    @staticmethod
    def of(series: Sequence[tuple[Floats, Floats]], swings: Sequence[CarrierSwing]) -> _Problem:
        n, axes = max(len(time) for time, _ in series), series[0][1].shape[1]
        steps, used = np.zeros((n, len(series))), np.zeros((n, len(series)))
        position = np.zeros((n, len(series), axes))
        shape = np.zeros((n, len(series), 2 + 2 * len(swings)))
        for i, (time, place) in enumerate(series):
            rows = slice(len(time))
            steps[rows, i], used[rows, i] = np.diff(time, prepend=time[0]), 1.0
            position[rows, i] = place - place.mean(axis=0)
            shape[rows, i, :2] = 1.0
            shape[rows, i, 2:] = sines(time, swings)
        jump = [np.std(np.diff(place, axis=0), axis=0).mean() / np.sqrt(2) for _, place in series]
        spread = float(np.mean([np.std(place, axis=0).mean() for _, place in series]))
        prior = np.array([_FAR * spread, 0.0, *np.repeat([s.amplitude for s in swings], 2)])
        span = max(float(np.ptp(time)) for time, _ in series)
        least = np.log(_SLOW * min(float(np.median(np.diff(time))) for time, _ in series))
        guess = np.log([max(float(np.mean(jump)), 1e-3 * spread), spread, span / 10])
        return _Problem(steps, position, used, shape, prior, guess, float(least))

    def posterior(self, at: Floats) -> Floats:
        """Logarithm of likelihood and priors at each row of logarithms."""
        own: Floats = -0.5 * np.sum(((at - self.guess) / _WIDTH) ** 2, axis=-1)
        return own + self.at(at)

    def at(self, at: Floats) -> Floats:
        """Logarithm of the likelihood at each row of logarithms."""
        least = [*(self.guess[:2] - _REACH), self.least]
        return self.likelihoods(np.exp(np.clip(at, least, self.guess + _REACH)))

    def begin(self) -> Floats:
        """The best of a grid of logarithms."""
        grid = np.stack(np.meshgrid(*_GRID, indexing="ij"), -1).reshape(-1, 3) + self.guess
        best: Floats = grid[int(np.argmax(self.posterior(grid)))]
        return best

    def best(self, begin: Floats, free: Integers) -> tuple[Floats, float]:
        """The most probable logarithms, of which some are free; and their likelihood."""
        unit = _STEP * np.eye(3)[free]
        shifts = np.concatenate([np.zeros((1, 3)), unit, -unit])

        def value_and_slope(x: Floats) -> tuple[float, Floats]:
            at = begin.copy()
            at[free] = x
            values = -self.posterior(at + shifts)
            p = len(free)
            return float(values[0]), (values[1 : p + 1] - values[p + 1 :]) / (2 * _STEP)

        found = minimize(
            value_and_slope, begin[free], jac=True, method="BFGS",
            options={"gtol": 2e-2, "maxiter": 15},
        )
        at = begin.copy()
        at[free] = found.x
        return at, float(self.at(at[None])[0])

    def without(self, part: int, at: Floats) -> float:
        """Logarithm of the likelihood without the white or the slow part."""
        begin = at.copy()
        begin[part] = self.guess[part] + _GONE
        if part == 0:
            return self.best(begin, np.array([1, 2]))[1]
        spread = max(self.guess[1], at[0])
        begin[0] = spread
        return self.best(begin, np.array([0]))[1]

    def ends(self, at: Floats) -> Floats:
        """Ends of the 95 % intervals, (2, 3), by draws that weigh as much as they are probable."""
        unit = _WIDE_STEP * np.eye(3)
        pairs = np.array([[a + b, a - b, b - a, -a - b] for a in unit for b in unit])
        H = -(self.posterior(at + pairs.reshape(-1, 3)).reshape(3, 3, 4) @ [1, -1, -1, 1])
        values, vectors = np.linalg.eigh((H + H.T) / (8 * _WIDE_STEP**2))
        root = _SPREAD * vectors / np.sqrt(np.maximum(values, _WIDTH**-2))
        uniform = stats.qmc.Sobol(4, seed=np.random.default_rng(0)).random(DRAWS)
        normal = stats.norm.ppf(np.clip(uniform[:, :3], 1e-9, 1 - 1e-9))
        scale = np.sqrt(_FREEDOM / stats.chi2.ppf(np.clip(uniform[:, 3], 1e-9, 1), _FREEDOM))
        draw = normal * scale[:, None]
        density = -0.5 * (_FREEDOM + 3) * np.log1p(np.sum(draw**2, axis=1) / _FREEDOM)
        sets = at + draw @ root.T
        log_weight = self.posterior(sets) - density
        weight = np.exp(log_weight - log_weight.max())
        ends = np.empty((2, 3))
        for i in range(3):
            order = np.argsort(sets[:, i])
            share = np.cumsum(weight[order]) - 0.5 * weight[order]
            ends[:, i] = np.interp(_ENDS, share / weight.sum(), sets[order, i])
        return ends

    def likelihoods(self, sets: Floats) -> Floats:
        """Logarithm of the likelihood of each row (white, slow, time)."""
        white, slow, tau = (sets[:, i, None] for i in range(3))
        count, (n, series, axes) = len(sets), self.position.shape
        states = self.shape.shape[2]
        P = np.zeros((count, series, states, states))
        P[...] = np.diag(self.prior**2)
        P[..., 1, 1] = slow**2
        mean = np.zeros((count, series, axes, states))
        sum_ = np.zeros(count)
        for i in range(n):
            decay = np.exp(-self.dt[i] / tau)
            P[..., 1, :] *= decay[..., None]
            P[..., :, 1] *= decay[..., None]
            P[..., 1, 1] += slow**2 * (1 - decay**2)
            mean[..., 1] *= decay[..., None]
            h, used = self.shape[i], self.used[i]
            Ph = np.einsum("ksij,sj->ksi", P, h)
            S = np.einsum("ksi,si->ks", Ph, h)
            S = np.maximum(S, 0.0) + white**2 + 1e-12
            nu = self.position[i] - np.einsum("ksai,si->ksa", mean, h)
            terms = np.sum(nu**2, axis=2) / S + axes * np.log(2 * np.pi * S)
            sum_ -= 0.5 * terms @ used
            gain = Ph / S[..., None]  # of a filled-up step zero, as its shape is
            mean += gain[:, :, None, :] * nu[..., None]
            P -= gain[..., :, None] * Ph[..., None, :]
        return sum_
