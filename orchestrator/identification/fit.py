"""The most probable parameters of a log's ranges, and how certain they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, product

import numpy as np
from scipy.optimize import minimize

from ..data.estimates import Floats
from .innovations import PARAMETERS, Ranges, evaluate, likelihoods

HYPOTHESES = 6
"""Hypotheses of the time of the last turn."""
NEEDED = 12.0
"""Twice the gain of the log-likelihood above which the diver turns, or the offsets walk."""
_ALWAYS = ("range_std", "late_share", "late_mean", "acceleration_psd")
_TURNS = ("turn_rate", "turn_std")
_WALK = ("range_walk",)
_KNOWN = {"turn_rate": 1.0, "turn_std": 1.0, "range_walk": 0.0}
"""Values where a parameter is not fitted; without hypotheses, the first two have no effect."""
_CENTRE = dict(zip(PARAMETERS, (-1.5, -3.0, 0.0, -6.5, -3.5, -1.0, -4.0), strict=True))
_WIDTH = dict(zip(PARAMETERS, (4.0, 2.5, 2.0, 4.0, 2.0, 1.0, 3.0), strict=True))
"""Weak priors of the coordinates, which keep the search where something is known."""
_NEVER, _SURE = -18.0, 0.1
"""The same for the share of ranges that are never late."""
_STEP = 1e-3
_FLAT = 2e-4
"""Slope of the cost at which the search ends; with a larger one the last digits of processors show
in the fourth of the result."""
_LEAST_STEP, _MOST_STEP, _RISE = 2e-2, 0.64, 0.5
"""Steps of the curvature, and the rise of the cost that they need: from close by, the cost is not
smooth."""
_BLOCK = 20
"""Ranges whose slopes are added before they are compared."""


def parameters_of(at: Floats, names: Sequence[str] = PARAMETERS) -> Floats:
    """Parameters at coordinates of some of them, (…, p): logarithms, and for the share the log of
    π/(1 − π). In the order of `PARAMETERS`."""
    at = np.clip(at, -40.0, 20.0)
    values = np.empty((*at.shape[:-1], len(PARAMETERS)))
    for i, name in enumerate(PARAMETERS):
        if name not in names:
            values[..., i] = _KNOWN[name]
            continue
        own = at[..., names.index(name)]
        values[..., i] = 1 / (1 + np.exp(-own)) if name == "late_share" else np.exp(own)
    return values


@dataclass(frozen=True, eq=False)
class Fit:
    """Coordinates of the most probable parameters.

    Attributes
    ----------
    names
        The parameters that were fitted.
    at, covariance
        Their coordinates, (p,), and their covariance, (p, p): from the curvature of the likelihood,
        or, where that is more, from the scatter of its slope over the log.
    likelihood
        Its logarithm there, without the priors.
    hypotheses
        Of the time of the last turn; 1: a diver who never turns.
    """

    names: Sequence[str]
    at: Floats
    covariance: Floats
    likelihood: float
    hypotheses: int

    @property
    def parameters(self) -> Floats:
        """In the order of `PARAMETERS`."""
        return parameters_of(self.at, self.names)

    def coordinate(self, name: str) -> tuple[float, float]:
        """Coordinate of a fitted parameter, and its standard deviation."""
        i = self.names.index(name)
        return float(self.at[i]), float(np.sqrt(self.covariance[i, i]))

    @property
    def turns(self) -> bool:
        """Whether the diver turns."""
        return self.hypotheses > 1

    @property
    def walks(self) -> bool:
        """Whether the offsets walk."""
        return "range_walk" in self.names


def fit(ranges: Ranges, noise: float, late: bool = True, walk: bool = True) -> Fit:
    """The most probable parameters: turns and a walk only if they explain the ranges better.

    Parameters
    ----------
    noise
        A first guess of the noise of a range [m].
    late
        Whether ranges may be late.
    walk
        Whether offsets may walk.
    """
    steady = _fit(ranges, noise, _ALWAYS, late)
    best = steady
    if walk:
        best = _better(steady, _fit(ranges, noise, (*_ALWAYS, *_WALK), late, steady))
    names = (*_ALWAYS, *_TURNS, *best.names[len(_ALWAYS) :])
    turning = _fit(ranges, noise, names, late, best)
    best = _better(best, turning)
    if best is turning and best.walks:  # what looked like a walk may have been the turns
        best = _better(_fit(ranges, noise, (*_ALWAYS, *_TURNS), late, best), best)
    return best


def without_late(ranges: Ranges, noise: float, found: Fit) -> Fit:
    """The same, if no range is ever late."""
    return _fit(ranges, noise, found.names, False, found)


def _better(simple: Fit, other: Fit) -> Fit:
    return other if 2 * (other.likelihood - simple.likelihood) > NEEDED else simple


def _fit(
    ranges: Ranges, noise: float, names: Sequence[str], late: bool, near: Fit | None = None
) -> Fit:
    guess = float(np.log(max(noise, 1e-4)))
    usual = {
        "range_std": guess, "late_share": -3.0 if late else _NEVER, "late_mean": guess + 2.5,
        "acceleration_psd": -4.6, "turn_rate": -3.5, "turn_std": -0.9, "range_walk": guess - 3.0,
    }
    cost = _Cost(ranges, HYPOTHESES if _TURNS[0] in names else 1, names, late)
    return cost.described(cost.least(cost.begin(usual, near)))


@dataclass(frozen=True, eq=False)
class _Cost:
    """Minus the logarithm of likelihood and prior, of coordinates of some parameters."""

    ranges: Ranges
    hypotheses: int
    names: Sequence[str]
    late: bool

    @cached_property
    def prior(self) -> tuple[Floats, Floats]:
        """Centre and width."""
        centre, width = (dict(each) for each in (_CENTRE, _WIDTH))
        if not self.late:
            centre["late_share"], width["late_share"] = _NEVER, _SURE
        return (np.array([centre[n] for n in self.names]),
                np.array([width[n] for n in self.names]))

    def parameters(self, at: Floats) -> Floats:
        """Of each row of coordinates."""
        return parameters_of(at, self.names)

    def of(self, at: Floats) -> Floats:
        """Of each row of coordinates, (sets,)."""
        centre, width = self.prior
        own: Floats = 0.5 * np.sum(((at - centre) / width) ** 2, axis=-1)
        own = own - likelihoods(self.ranges, self.parameters(at), self.hypotheses)
        return np.where(np.isfinite(own), own, 1e10)

    def begin(self, usual: Mapping[str, float], near: Fit | None) -> Floats:
        """The best of a grid of coordinates about usual ones, and of those near another fit: the
        search needs a filter that follows the diver."""
        around = {
            "range_std": (-1.0, 0.0, 1.0, 2.0), "acceleration_psd": (-2.0, 0.0, 2.3, 4.6),
            "range_walk": (-1.5, 0.0, 1.5),
        }
        grid = np.array(list(product(*(
            [usual[name] + shift for shift in around.get(name, (0.0,))] for name in self.names
        ))))
        if near is not None:
            there = {**usual, **dict(zip(near.names, near.at.tolist(), strict=True))}
            there["late_share"] = there["late_share"] if self.late else usual["late_share"]
            psd = there["acceleration_psd"]
            grid = np.concatenate([grid, [
                [(there | {"acceleration_psd": psd + less})[name] for name in self.names]
                for less in (0.0, -2.3)
            ]])
        best: Floats = grid[int(np.argmin(self.of(grid)))]
        return best

    def least(self, begin: Floats) -> Floats:
        """Coordinates of the least cost."""
        p = len(begin)
        shifts = _STEP * np.concatenate([np.zeros((1, p)), np.eye(p), -np.eye(p)])

        def value_and_slope(at: Floats) -> tuple[float, Floats]:
            values = self.of(at + shifts)
            return float(values[0]), (values[1 : p + 1] - values[p + 1 :]) / (2 * _STEP)

        n = len(self.ranges.time)
        scale = dict(zip(PARAMETERS, (1 / n, 20 / n, 20 / n, 10 / n, 0.2, 0.05, 20 / n),
                         strict=True))
        found: Floats = minimize(
            value_and_slope, begin, jac=True, method="BFGS",
            options={"gtol": _FLAT, "maxiter": 60,
                     "hess_inv0": np.diag([scale[name] for name in self.names])},
        ).x
        return found

    def described(self, at: Floats) -> Fit:
        """The fit at the coordinates of the least cost."""
        parameters = self.parameters(at)[None]
        likelihood = float(likelihoods(self.ranges, parameters, self.hypotheses)[0])
        steps = self.steps(at)
        values, vectors = np.linalg.eigh(self.curvature(at, steps))
        # Where the log tells nothing, the prior does: the curvature is at least its own.
        least = float(np.min(self.prior[1] ** -2.0))
        told = values > least
        covariance = vectors @ np.diag(1 / np.maximum(values, least)) @ vectors.T
        own = vectors @ np.diag(np.where(told, 1 / np.maximum(values, least), 0.0)) @ vectors.T
        scatter = own @ self.scatter(at, steps) @ own
        more = np.sqrt(np.maximum(np.diag(scatter) / np.diag(covariance), 1.0))
        covariance = covariance * np.outer(more, more)
        return Fit(tuple(self.names), at, covariance, likelihood, self.hypotheses)

    def steps(self, at: Floats) -> Floats:
        """Distances at which the cost has risen by `_RISE` along each coordinate, (p,)."""
        p = len(at)
        steps = np.full(p, _LEAST_STEP)
        here = float(self.of(at[None])[0])
        open_ = np.arange(p)
        while len(open_):
            shifts = np.diag(steps)[open_]
            values = self.of(at + np.concatenate([shifts, -shifts]))
            rise = (values[: len(open_)] + values[len(open_) :]) / 2 - here
            open_ = open_[(rise < _RISE) & (steps[open_] < _MOST_STEP)]
            steps[open_] *= 2
        return steps

    def scatter(self, at: Floats, steps: Floats) -> Floats:
        """Sum of the squares of the likelihood's slope over blocks of ranges, (p, p)."""
        p = len(at)
        shifts = np.diag(steps)
        shifts = np.concatenate([shifts, -shifts])
        found = evaluate(self.ranges, self.parameters(at + shifts), self.hypotheses)
        density = found.by_range["density"]
        slope = (density[:p] - density[p:]) / (2 * steps[:, None])
        blocks = np.add.reduceat(slope, np.arange(0, slope.shape[1], _BLOCK), axis=1)
        blocks = blocks - blocks.mean(axis=1, keepdims=True)
        total: Floats = blocks @ blocks.T
        return total

    def curvature(self, at: Floats, steps: Floats) -> Floats:
        """Second derivatives of the paraboloid that fits the cost best around, (p, p)."""
        p = len(at)
        pairs = list(combinations(range(p), 2))
        unit = np.eye(p)
        star = [*unit, *-unit]
        star += [a * unit[i] + b * unit[j] for i, j in pairs for a in (1, -1) for b in (1, -1)]
        shifts = np.array([np.zeros(p), *star, *(2 * np.array(star))])
        columns = [np.ones(len(shifts)), *shifts.T, *(shifts**2).T / 2]
        columns += [shifts[:, i] * shifts[:, j] for i, j in pairs]
        found = np.linalg.lstsq(np.stack(columns, axis=1), self.of(at + shifts * steps))[0]
        H = np.diag(found[1 + p : 1 + 2 * p])
        for (i, j), value in zip(pairs, found[1 + 2 * p :], strict=True):
            H[i, j] = H[j, i] = value
        return H / np.outer(steps, steps)
