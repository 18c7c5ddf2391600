"""A score that tells a turn of the diver from late ranges."""

from __future__ import annotations

from dataclasses import fields
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from sblcosim.models.receiver import lateness, turn
from scipy.stats import exponnorm, norm

P = SimpleNamespace(prior_velocity_std=0.8, outlier_probability=0.05, outlier_mean=2.0)


def told(
    innovation: float, S: float, *, doubt: float = 0.0, epoch: float = 7.5, counts: int = 1
) -> turn.Turn:
    """After ranges at 7 s and, before that, at 6.2 s."""
    x = SimpleNamespace(
        ranged=7.0, pause=0.8, doubt=doubt, epoch=ca.SX(epoch), begins=0, again=0
    )
    parts = lateness.densities(P, ca.SX(innovation), ca.SX(S))
    result = turn.told(P, x, ca.SX(innovation), ca.SX(S), sum(parts), ca.SX(counts), follows=0)
    return turn.Turn(*(float(ca.evalf(ca.SX(getattr(result, f.name)))) for f in fields(turn.Turn)))


def ratio(innovation: float, S: float, pause: float) -> float:
    """From scratch: ln of the density after a turn, to the density without one."""
    wider, sigma = np.sqrt(S + (P.prior_velocity_std * 3 * pause) ** 2), np.sqrt(S)
    before = 0.95 * norm.pdf(innovation, scale=sigma) + 1e-4 / 50
    before += 0.05 * exponnorm.pdf(innovation, P.outlier_mean / sigma, scale=sigma)
    return float(np.log(0.95 * norm.pdf(innovation, scale=wider) / before))


@pytest.mark.parametrize("seed", range(20))
def test_the_score_adds_up_likelihood_ratios(seed: int) -> None:
    rng = np.random.default_rng(seed)
    S, before = rng.uniform(0.01, 0.3) ** 2, rng.uniform(0, 4)
    innovation = rng.normal(0, 4) * np.sqrt(S)
    result = told(innovation, S, doubt=before)
    expected = max(before + ratio(innovation, S, 0.5), 0.0)
    assert result.begins == (expected > 9.0)
    assert result.doubt == pytest.approx(0.0 if result.begins else expected, abs=1e-5)
    assert (result.pause, result.since) == (0.5, 1.5)


def test_what_does_not_count_changes_no_state() -> None:
    result = told(-0.5, 0.05**2, doubt=8.0, counts=0)
    assert result.states == {"begins": 0, "again": 0, "doubt": 8.0, "ranged": 7.0, "pause": 0.8}


def test_a_range_that_is_to_be_read_again_has_not_been_used() -> None:
    short, long = told(-0.5, 0.05**2), told(0.5, 0.05**2, doubt=8.0)
    assert (short.again, short.ranged) == (1, 7.0)
    assert (long.again, long.ranged) == (0, 7.5)


def test_of_one_epoch_the_pause_before_it_counts() -> None:
    assert told(0.1, 0.01, epoch=7.0).pause == 0.8


def test_a_range_that_is_too_short_tells_at_once_and_a_long_one_does_not() -> None:
    S = 0.05**2
    assert told(-0.5, S).begins
    assert not told(0.5, S).begins
    assert told(0.5, S, doubt=8.0).begins


def test_what_fits_is_no_turn_nor_is_anything_where_velocities_are_known() -> None:
    S = 0.05**2
    assert told(0.02, S, doubt=2.0).doubt < 0.5
    known = SimpleNamespace(**{**vars(P), "prior_velocity_std": 0.0, "outlier_probability": 0.9})
    x = SimpleNamespace(
        ranged=7.0, pause=0.8, doubt=0.0, epoch=ca.SX(7.5), begins=0, again=0
    )
    for innovation in np.linspace(-1, 1, 41):
        value: Any = sum(lateness.densities(known, ca.SX(innovation), ca.SX(S)))
        result = turn.told(known, x, ca.SX(innovation), ca.SX(S), value, ca.SX(1), follows=0)
        assert float(ca.evalf(result.doubt)) == 0.0


def test_a_turn_makes_velocity_and_place_as_unknown_as_that() -> None:
    since = 1.5
    declared = turn.Turn(1, 0, 0.0, 7.5, 0.5, since)
    found = turn.widened(P, ca.SX.eye(4), declared, (0, 2), (1, 3))
    way = np.kron(np.eye(2), [[since], [1.0]])
    expected = np.eye(4) + P.prior_velocity_std**2 * way @ way.T
    np.testing.assert_allclose(np.array(ca.evalf(found)), np.triu(expected), atol=1e-15)
