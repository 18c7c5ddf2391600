"""The search for the parameters of ranges, of likelihoods whose most probable ones are known."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from sblcosim.identification import fit as fitted
from sblcosim.identification.fit import Fit, fit, without_late
from sblcosim.identification.innovations import (
    PARAMETERS,
    PRIOR,
    Filtered,
    Ranges,
    evaluate,
    likelihoods,
)
from scipy.optimize import minimize
from seams import Seam

CENTRE = {"range_std": -1.5, "late_share": -3.0, "late_mean": 0.0, "acceleration_psd": -6.5,
          "turn_rate": -3.5, "turn_std": -1.0, "range_walk": -4.0}  # fmt: skip
WIDTH = {"range_std": 4.0, "late_share": 2.5, "late_mean": 2.0, "acceleration_psd": 4.0,
         "turn_rate": 2.0, "turn_std": 1.0, "range_walk": 3.0}  # fmt: skip
"""What is known of the coordinates before any range: logarithms, and the odds of a share."""
PEAK = {**CENTRE, "range_std": -2.1, "late_share": -2.4, "late_mean": 0.7,
        "acceleration_psd": -4.9}  # fmt: skip
CURVED = np.array([
    [21.0, 3.0, -2.0, 1.5],
    [3.0, 9.0, 1.0, -0.5],
    [-2.0, 1.0, 3.0, 0.4],
    [1.5, -0.5, 0.4, 5.0],
])
"""Of the first four; the others have a curvature of their own and no correlation."""
OWN = {"turn_rate": 2.0, "turn_std": 7.0, "range_walk": 1.3}
N = 57
RANGES = Ranges(
    np.arange(float(N)), np.zeros(N, np.intp), np.zeros(N), np.zeros((N, 3)), np.zeros(N),
    np.zeros(N), dict.fromkeys(PRIOR, 0.0), 1,
)


@dataclass
class Known:
    """A likelihood with one peak, which is higher by the gains of a walk, of turns and of both."""

    walk: float = 0.0
    turns: float = 0.0
    both: float = 0.0
    curved: Any = field(default_factory=CURVED.copy)
    slopes: Any = field(default_factory=lambda: np.zeros((len(PARAMETERS), N)))
    rough: float = 0.0
    """Whether it is no paraboloid (1), and densities are no planes."""
    beyond: float = 99.0
    """Logarithm of the noise above which there is no likelihood."""

    def bumps(self, off: Any) -> Any:
        """What makes it no paraboloid."""
        first, second, third, fourth = off[..., :4].T
        return self.rough * (0.8 * np.sin(2 * first + second) + 0.3 * np.sin(3 * fourth)
                             - second**4 - 2 * first**2 * np.cos(second) + 0.05 * np.cos(2 * third))

    def coordinates(self, parameters: Any) -> Any:
        at = np.array(parameters, float)
        share = at[:, 1].copy()
        at[:, 6] = np.where(at[:, 6] > 0, at[:, 6], np.exp(CENTRE["range_walk"]))
        at = np.log(at)
        at[:, 1] = np.log(share / (1 - share))
        return at

    def likelihoods(self, ranges: Any, parameters: Any, hypotheses: int = 1) -> Any:
        assert ranges is RANGES
        assert hypotheses in (1, 6)
        z = self.coordinates(parameters)
        off = z - [PEAK[name] for name in PARAMETERS]
        curved = np.zeros((7, 7))
        curved[:4, :4] = self.curved
        turns, walks = hypotheses > 1, parameters[:, 6] > 0
        for i, name in enumerate(PARAMETERS[4:], 4):
            curved[i, i] = OWN[name]
            off[:, i] = off[:, i] * (walks if name == "range_walk" else turns)
        gain = np.where(walks, self.both if turns else self.walk, self.turns if turns else 0.0)
        found = gain - 0.5 * np.einsum("ki,ij,kj->k", off, curved, off) - 30.0
        found = found + self.bumps(off)
        return np.where(z[:, 0] > self.beyond, np.nan, found)

    def evaluate(self, ranges: Any, parameters: Any, hypotheses: int = 1) -> Filtered:
        at = self.coordinates(parameters)
        density = (np.exp(at) if self.rough else at) @ self.slopes
        return Filtered(np.zeros(0), {"density": density}, np.zeros((0, 0)), np.zeros((0, 0, 0)))


@pytest.fixture
def search(seam: Seam) -> Any:
    def searched(known: Known, noise: float = 0.1, **how: bool) -> Fit:
        seam.undo()
        seam.instead(likelihoods, known.likelihoods)
        seam.instead(evaluate, known.evaluate)
        return fit(RANGES, noise, **how)

    return searched


def posterior(names: Any, curved: Any = CURVED) -> tuple[Any, Any]:
    """The most probable coordinates, and the curvature there."""
    of = dict(zip(PARAMETERS, np.arange(7), strict=True))
    whole = np.diag([0.0] * 4 + [OWN[name] for name in PARAMETERS[4:]])
    whole[:4, :4] = curved
    at = [of[name] for name in names]
    A = whole[np.ix_(at, at)]
    W = np.diag([WIDTH[name] ** -2.0 for name in names])
    peak, centre = (np.array([x[name] for name in names]) for x in (PEAK, CENTRE))
    return np.linalg.solve(A + W, A @ peak + W @ centre), A + W


@pytest.mark.parametrize("noise", [0.1, 3.0, 0.0])
def test_the_most_probable_parameters_and_their_covariance(search: Any, noise: float) -> None:
    found = search(Known(), noise)
    assert found.names == PARAMETERS[:4]
    at, curved = posterior(found.names)
    assert found.at == pytest.approx(at, abs=3e-4)
    assert found.covariance == pytest.approx(np.linalg.inv(curved), rel=1e-4, abs=1e-6)
    off = at - [PEAK[name] for name in found.names]
    assert found.likelihood == pytest.approx(-30.0 - 0.5 * off @ CURVED @ off, abs=1e-5)
    assert found.hypotheses == 1


def test_turns_and_a_walk_have_priors_of_their_own(search: Any) -> None:
    found = search(Known(walk=7.0, turns=7.9, both=14.0))
    assert found.names == PARAMETERS
    at, curved = posterior(PARAMETERS)
    assert found.at == pytest.approx(at, abs=1e-3)
    assert found.covariance == pytest.approx(np.linalg.inv(curved), rel=1e-4, abs=1e-6)
    assert found.hypotheses == 6


@pytest.mark.parametrize(("walk", "turns", "both", "found"), [
    (5.99, 5.99, 5.99, ""),
    (6.01, 0.0, 12.0, "walks"),
    (5.99, 6.01, 0.0, "turns"),
    (7.0, 7.9, 14.0, "walks turns"),
    (7.0, 8.1, 14.0, "turns"),  # what looked like a walk may have been the turns
    (7.0, 0.5, 12.9, "walks"),
    (7.0, 2.0, 12.9, "walks"),
    (5.0, 0.0, 50.0, ""),  # each by itself first
])  # fmt: skip
def test_a_walk_and_turns_are_there_if_they_explain_six_more(
    search: Any, walk: float, turns: float, both: float, found: str
) -> None:
    it = search(Known(walk, turns, both))
    assert " ".join(["walks"] * it.walks + ["turns"] * it.turns) == found
    assert ("range_walk" in it.names, "turn_rate" in it.names) == (it.walks, it.turns)


def test_of_what_never_walks_only_turns_are_looked_for(search: Any) -> None:
    it = search(Known(walk=50.0, turns=6.01, both=90.0), walk=False)
    assert (it.walks, it.turns) == (False, True)


def test_ranges_that_are_never_late_have_a_share_that_is_nil(search: Any) -> None:
    apart = CURVED.copy()
    apart[1, :], apart[:, 1], apart[1, 1] = 0.0, 0.0, 0.0
    found = search(Known(curved=apart), late=False)
    at, curved = posterior(found.names, apart)
    at[1], curved[1, 1] = -18.0, 0.1**-2
    assert found.at == pytest.approx(at, abs=1e-3)
    assert found.covariance == pytest.approx(np.linalg.inv(curved), rel=1e-3, abs=1e-6)
    walking = search(Known(walk=7.0, curved=apart))
    again = without_late(RANGES, 0.1, walking)
    assert again.names == walking.names
    assert again.at[[1, 4]] == pytest.approx([-18.0, -4.0], abs=1e-3)


def test_the_scatter_of_the_slope_counts_where_it_is_more(search: Any) -> None:
    """Of blocks of 20 ranges, the last of 17."""
    rng = np.random.default_rng(2)
    known = Known()
    known.slopes[:4] = rng.normal(size=(4, N)) + 0.3
    known.slopes[0] *= 6.0
    known.slopes[2] *= 0.1
    found = search(known)
    inverse = np.linalg.inv(posterior(found.names)[1])
    blocks = np.stack([known.slopes[:4, a:b].sum(axis=1) for a, b in ((0, 20), (20, 40), (40, N))])
    blocks -= blocks.mean(axis=0)
    sandwich = inverse @ blocks.T @ blocks @ inverse
    more = np.sqrt(np.maximum(np.diag(sandwich) / np.diag(inverse), 1.0))
    assert more.max() > 1.3
    assert more.min() == 1.0
    assert found.covariance == pytest.approx(inverse * np.outer(more, more), rel=1e-3, abs=1e-6)


def test_a_log_does_not_tell_less_than_is_known_without_it(search: Any) -> None:
    """Where the likelihood is no peak, the curvature is that of the widest prior, and no slope
    counts there."""
    curved = np.diag([21.0, 9.0, -0.22, 5.0])
    known = Known(curved=curved)
    known.slopes[2] = 5.0 * np.sin(np.arange(N))
    found = search(known)
    at, total = posterior(found.names, curved)
    assert total[2, 2] < 1 / 16
    assert found.at == pytest.approx(at, abs=2e-2)
    total[2, 2] = 1 / 16
    assert found.covariance == pytest.approx(np.linalg.inv(total), rel=1e-3, abs=1e-6)


def test_parameters_without_a_likelihood_are_not_taken(search: Any) -> None:
    found = search(Known(beyond=-1.0), 0.5)
    assert found.at == pytest.approx(posterior(found.names)[0], abs=3e-4)


def test_the_curvature_is_that_of_the_best_paraboloid_as_far_as_the_cost_rises_by_a_half(
    search: Any,
) -> None:
    """It goes through points at one and at two steps along an axis, or along two of them."""
    curved = 3 * CURVED
    curved[2, :] = curved[:, 2] = [0.0, 0.0, 0.3, 0.0]  # which is flat: at most 0.64
    known = Known(rough=1.0, curved=curved)
    known.slopes[:4] = np.array([[900.0], [700.0], [5.0], [9e3]]) * np.sin(
        np.arange(N) / 9 + np.arange(4)[:, None])
    found = search(known)
    peak, centre, width = (
        np.array([x[name] for name in found.names]) for x in (PEAK, CENTRE, WIDTH)
    )

    def cost(at: Any) -> Any:
        off = at - peak
        return (0.5 * np.einsum("...i,ij,...j->...", off, curved, off) - known.bumps(off)
                + 0.5 * np.sum(((at - centre) / width) ** 2, axis=-1))

    at = minimize(cost, peak, options={"gtol": 1e-7}).x
    assert found.at == pytest.approx(at, abs=3e-4)
    steps = []
    for unit in np.eye(4):
        step = 0.02
        while np.mean(cost(at + step * np.stack([unit, -unit]))) - cost(at) < 0.5:
            step *= 2
        steps.append(min(step, 0.64))
    assert len(set(steps)) > 2
    star = np.array([x for x in product((-1, 0, 1), repeat=4) if 0 < np.count_nonzero(x) < 3])
    points = np.concatenate([np.zeros((1, 4)), star, 2 * star])
    i, j = np.triu_indices(4)
    terms = [np.ones(len(points)), *points.T, *(points[:, i] * points[:, j]).T]
    best = np.linalg.lstsq(np.stack(terms, axis=1), cost(at + points * steps), rcond=None)[0][5:]
    H = np.zeros((4, 4))
    H[i, j] = best
    H = (H + H.T) / np.outer(steps, steps)
    slope = (np.exp(at) * np.sinh(steps) / steps)[:, None] * known.slopes[:4]
    blocks = np.stack([slope[:, a:b].sum(axis=1) for a, b in ((0, 20), (20, 40), (40, N))])
    blocks -= blocks.mean(axis=0)
    inverse = np.linalg.inv(H)
    sandwich = inverse @ blocks.T @ blocks @ inverse
    more = np.sqrt(np.maximum(np.diag(sandwich) / np.diag(inverse), 1.0))
    assert more.max() > 1.3
    assert found.covariance == pytest.approx(inverse * np.outer(more, more), rel=2e-3, abs=1e-6)


# --- Where the search begins ----------------------------------------------------------------------


@pytest.mark.parametrize(("noise", "late"), [(0.3, True), (1e-5, False)])
@pytest.mark.parametrize(("off", "turns"), [
    ({"range_std": -1.0, "acceleration_psd": -1.9, "range_walk": -1.6}, False),
    ({"range_std": 0.3, "acceleration_psd": 0.2, "range_walk": 0.2}, True),
    ({"range_std": 1.1, "acceleration_psd": 2.4, "range_walk": 1.6}, True),
    ({"range_std": 2.2, "acceleration_psd": 4.9, "range_walk": 1.7}, False),
    ({"acceleration_psd": -4.2}, True),
])  # fmt: skip
def test_the_search_begins_at_the_best_of_what_is_usual_and_of_what_is_near(
    seam: Seam, off: dict[str, float], turns: bool, noise: float, late: bool
) -> None:
    """About the first guess of the noise; beside another fit also with a tenth of its motion. Its
    first step is that of a curvature that grows with the ranges."""
    guess = float(np.log(max(noise, 1e-4)))
    usual = {"range_std": guess, "late_share": -3.0 if late else -18.0, "late_mean": guess + 2.5,
             "acceleration_psd": -4.6, "turn_rate": -3.5, "turn_std": -0.9,
             "range_walk": guess - 3.0}  # fmt: skip
    around = {"range_std": (-1.0, 0.0, 1.0, 2.0), "acceleration_psd": (-2.0, 0.0, 2.3, 4.6),
              "range_walk": (-1.5, 0.0, 1.5)}  # fmt: skip
    first = {"range_std": 1 / N, "late_share": 20 / N, "late_mean": 20 / N,
             "acceleration_psd": 10 / N, "turn_rate": 0.2, "turn_std": 0.05, "range_walk": 20 / N}
    peak = {name: usual[name] + off.get(name, 0.0) for name in PARAMETERS}
    sharp = np.array([30.0, 0.3, 0.3, 30.0, 0.3, 0.3, 30.0])
    known = Known(walk=90.0, turns=90.0 * turns)

    def likelihood(_: Any, parameters: Any, hypotheses: int = 1) -> Any:
        z, walks = known.coordinates(parameters), parameters[:, 6] > 0
        apart = sharp * (z - [peak[name] for name in PARAMETERS]) ** 2
        apart[:, 4:6] *= hypotheses > 1
        apart[:, 6] *= walks
        gain = 900.0 * (walks + turns * (hypotheses > 1))
        return gain - apart.sum(axis=1) / 2

    calls: list[Any] = []

    def searched(of: Any, begin: Any, **how: Any) -> Any:
        names = [PARAMETERS[:4], (*PARAMETERS[:4], "range_walk"), PARAMETERS[:6],
                 PARAMETERS][len(begin) - 4]
        assert how["options"]["hess_inv0"] == pytest.approx(np.diag([first[n] for n in names]))
        end = begin + 0.05 * np.sin(np.arange(len(begin)) + len(calls))
        calls.append((names, begin, end))
        return SimpleNamespace(x=end)

    seam.instead(likelihoods, likelihood)
    seam.instead(evaluate, known.evaluate)
    seam.instead(minimize, searched, only=fitted)
    fit(RANGES, noise, late=late)
    near: dict[str, float] = {}
    assert len(calls) == 3 + turns
    for names, begin, end in calls:
        grid = [dict(zip(names, each, strict=True)) for each in product(*(
            [usual[name] + shift for shift in around.get(name, (0.0,))] for name in names))]
        if near:
            there = {name: near.get(name, usual[name]) for name in names}
            there["late_share"] = there["late_share"] if late else -18.0
            grid += [{**there, "acceleration_psd": there["acceleration_psd"] + less}
                     for less in (0.0, -2.3)]
        points = np.array([[each[name] for name in names] for each in grid])
        apart = dict(zip(PARAMETERS, sharp, strict=True))
        cost = [sum(apart[n] * (x[n] - peak[n]) ** 2 / 2 for n in names) + sum(
            ((x[n] - (-18.0 if n == "late_share" and not late else CENTRE[n]))
             / (0.1 if n == "late_share" and not late else WIDTH[n])) ** 2 / 2 for n in names)
            for x in grid]
        assert begin == pytest.approx(points[int(np.argmin(cost))])
        near = dict(zip(names, end, strict=True))
