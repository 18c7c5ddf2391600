"""Analytic limits and statistical consistency of the receivers."""

from __future__ import annotations

import numpy as np
import pytest
from harness import Path, at_rest, cross, dive, straight
from scipy.stats import chi2

LINE = straight((15.0, 2.0, 5.0), (-0.3, 0.4, 0.05))
REST = at_rest(12.0, -7.0, 5.0)
PRIOR = {"initialisation": 2, "prior_position": (12.4, -7.5, 4.8)}


def jump(bearing_deg: float, at: float) -> Path:
    """A diver who is moved by 20 m in no time."""
    by = 20.0 * np.array([np.cos(np.radians(bearing_deg)), np.sin(np.radians(bearing_deg)), 0.0])
    return lambda t: (np.array([12.0, -7.0, 5.0]) + (by if t > at else 0.0), np.zeros(3))


def random_motion(seed: int, q: float = 0.01, steps: int = 700, T: float = 0.1) -> Path:
    """White-noise acceleration of spectral density q, from 15 m north of the platform."""
    rng = np.random.default_rng(seed)
    half = np.linalg.cholesky(q * np.array([[T**3 / 3, T**2 / 2], [T**2 / 2, T]]))
    state = np.array([[15.0, 0.0, 5.0], 0.3 * rng.standard_normal(3)])
    states = [state]
    for _ in range(steps):
        state = np.array([[1.0, T], [0.0, 1.0]]) @ state + half @ rng.standard_normal((2, 3))
        states.append(state)
    return lambda t: tuple(states[round(t / T)])  # type: ignore[return-value]


@pytest.mark.parametrize("start", [{}, PRIOR])
@pytest.mark.parametrize("receiver", ["ekf", "sequential"])
def test_without_noise_the_filters_find_a_diver_at_rest(
    receiver: str, start: dict[str, object]
) -> None:
    result = dive(receiver, REST, acoustics={"range_std": 0.0}, parameters=start)
    assert result.distance[-1] < 1e-3


def test_without_noise_the_raw_fix_of_a_diver_at_rest_is_exact() -> None:
    assert dive("multilateration", REST, acoustics={"range_std": 0.0}).distance.max() < 1e-9


@pytest.mark.parametrize(
    "start", [{}, {"initialisation": 2, "prior_position": (14.5, 2.5, 5.2)}]
)
def test_without_noise_the_sequential_filter_converges_on_a_straight_line(
    start: dict[str, object]
) -> None:
    result = dive("sequential", LINE, acoustics={"range_std": 0.0}, parameters=start)
    assert result.distance[-1] < 1e-3
    assert np.linalg.norm(result.velocity[-1] - LINE(0.0)[1]) < 1e-3


@pytest.mark.parametrize("bearing", range(0, 360, 45))
def test_the_sequential_filter_recovers_from_a_jump(bearing: int) -> None:
    result = dive("sequential", jump(bearing, 10.0), steps=160, depth_std=0.1)
    assert result.distance[(result.epoch > 9.0) & (result.epoch < 10.0)].max() < 1.5
    assert result.distance[result.epoch > 11.5].max() < 1.5


def test_without_the_restart_that_jump_would_not_be_survived() -> None:
    result = dive("sequential", jump(90, 10.0), steps=160, depth_std=0.1,
                  parameters={"gate_limit": 1000})
    assert result.distance[result.epoch > 11.5].min() > 5.0


@pytest.mark.parametrize("seed", range(3))
def test_one_sided_outliers_do_not_make_the_sequential_filter_diverge(seed: int) -> None:
    def rms(gate: float) -> float:
        result = dive(
            "sequential", LINE, steps=400, depth_std=0.05, seed=seed,
            acoustics={"outlier_probability": 0.1, "outlier_mean": 3.0},
            parameters={"gate": gate, "depth_std": 0.05},
        )
        assert np.isfinite(result.position).all()
        return float(np.sqrt(np.mean(result.distance[50:] ** 2)))

    assert rms(4.0) < 0.5
    assert rms(0.0) > 2 * rms(4.0)


def test_the_sequential_filter_is_consistent_on_motion_of_its_own_model() -> None:
    nis = degrees = 0.0
    nees = []
    for seed in range(6):
        path = random_motion(seed)
        result = dive(
            "sequential", path, steps=500, depth_std=0.05, seed=100 + seed,
            parameters={"depth_std": 0.05, "prior_velocity_std": 0.3},
        )
        nis += result.nis[1:].sum()
        degrees += result.nis_degrees[1:].sum()
        late = result.epoch > 5.0
        P = result.covariance[late][:, ::2, ::2]
        e = result.error[late]
        nees.append(np.mean(np.einsum("ni,ni->n", e, np.linalg.solve(P, e[:, :, None])[:, :, 0])))
    low, high = chi2.interval(0.999, degrees)
    assert low < nis < high
    # Successive errors are correlated over some 2 s, so six runs hold about 130 independent ones.
    assert 2.2 < np.mean(nees) < 3.8


@pytest.mark.parametrize("receiver", ["sequential", "ekf", "multilateration"])
def test_a_short_baseline_is_less_accurate_across_than_along(receiver: str) -> None:
    def spread(arm: float) -> np.ndarray:
        result = dive(receiver, at_rest(15.0, 0.0, 1.0), steps=200, depth_std=0.05,
                      beacons=lambda t: cross(arm), parameters={"gate": 0.0} if receiver ==
                      "sequential" else {})
        return np.asarray(result.covariance[-1].diagonal()[::2])

    short, long = spread(0.4), spread(3.0)
    assert short[1] > 10 * short[0]
    assert short[1] > 10 * long[1]


@pytest.mark.parametrize("arm", [0.3, 0.6])
def test_the_raw_fix_has_the_dilution_of_precision_of_the_cross(arm: float) -> None:
    """Far away: across sigma rho / (sqrt 2 b), radial sigma rho / (2 R)."""
    result = dive(
        "multilateration", at_rest(12.0, 0.0, 9.5), steps=10, acoustics={"range_std": 0.0},
        parameters={"range_std": 0.1, "depth_std": 1e-6}, beacons=lambda t: cross(arm),
    )
    std = np.sqrt(result.covariance[-1].diagonal()[::2])
    assert std[1] == pytest.approx(0.1 * 15.0 / (np.sqrt(2) * arm), rel=0.01)
    assert std[0] == pytest.approx(0.1 * 15.0 / (2 * 12.0), rel=0.01)
