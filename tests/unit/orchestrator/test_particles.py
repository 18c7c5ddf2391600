"""The particle filter: against Kalman filters where they are exact, and where they cannot be."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from model_dive import dive, parameters
from sblcosim.estimation import linear, model, particles
from sblcosim.estimation.linear import Problem
from sblcosim.estimation.samples import Samples
from sblcosim.estimation.smoother import linearised


def kalman(p: Any, samples: Samples, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A Kalman filter about the true states, which is exact if ranges are linear there.

    The last epoch of a smoother is the filter's; so of each epoch, the samples until then.
    """
    rows = model.rows(p, samples, truth)
    frame = model.problem(p, samples, truth[0])
    whole = linearised(frame, rows, truth, np.ones(len(samples.range)))
    means, covariances = [], []
    for k in range(len(truth)):
        m = whole.first[k + 1]
        part = Problem(
            whole.mean, whole.covariance, whole.phi, whole.noise, whole.which[: k + 1],
            whole.first[: k + 2], whole.H[:m], whole.z[:m], whole.R[:m],
        )
        moments = linear.smooth(part)
        means.append(moments.mean[-1])
        covariances.append(moments.covariance[-1])
    return np.array(means), np.array(covariances)


EASY = {
    "outlier_probability": 0.0, "imu_heading_error_std_deg": 0.0, "prior_position_std_m": 0.2,
    "sound_speed_std": 0.0, "heading_rate_std_deg_s": 0.0, "imu_heading_std_deg": 0.0,
    "acceleration_psd_m2_s3": 1e-4, "prior_velocity_std_m_s": 0.03, "clock_std_m": 0.2,
}
"""Almost linear: ranges bend little over 0.3 m, and the heading is known."""


def test_almost_linear_it_agrees_with_a_kalman_filter() -> None:
    p = parameters(**EASY)
    samples, truth = dive(p, 4, 20, late=0.0)
    mean, covariance = kalman(p, samples, truth)
    estimates = particles.filtered(p, samples, 20_000, 1)
    std = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    off = (estimates.position - mean[:, :3]) / std[:, :3]
    assert np.sqrt((off**2).mean()) < 0.1  # of a standard deviation
    assert np.abs(off).max() < 0.4
    ours = np.sqrt(np.diagonal(estimates.covariance, axis1=1, axis2=2))[:, [0, 2, 4, 1, 3, 5]]
    np.testing.assert_allclose(ours, std[:, :6], rtol=0.1)
    np.testing.assert_allclose(estimates.clock_offset * 1500, mean[:, 15], atol=0.3 * 0.2)


def test_equal_seeds_give_equal_bits_and_others_do_not() -> None:
    p = parameters()
    samples, _ = dive(p, 1, 12)
    one, two, other = (particles.filtered(p, samples, 500, seed) for seed in (7, 7, 8))
    assert np.array_equal(one.position, two.position)
    assert np.array_equal(one.covariance, two.covariance)
    assert not np.array_equal(one.position, other.position)


def test_a_posterior_that_is_a_ring() -> None:
    """A short baseline with noise beyond its arms tells the distance and not the bearing."""
    cross = [0.4, 0, 0.5, 0, 0.4, 0.5, -0.4, 0, 0.5, 0, -0.4, 0.5]
    p = parameters(
        initialisation="first_receptions", beacon_offset_m=cross, range_std_m=1.0,
        clock_std_m=0.0, sound_speed_std=0.0, gps_markov_std_m=0.0, outlier_probability=0.0,
        prior_velocity_std_m_s=0.1,
    )
    n, distance = 8, 15.0
    ns = 1_000_000_000 * np.arange(1, n + 1)
    zeros = np.zeros((n, 3))
    samples = Samples(
        0, ns, np.full(n, 0.5), ns, np.arange(n) % 4, np.full(n, distance), np.ones(n, bool),
        zeros, zeros,
    )
    last = particles.filtered(p, samples, 20_000, 3)
    radius = np.hypot(*last.relative_position[-1][:2])
    assert radius < 0.1 * distance  # the mean is in the middle
    spread = last.relative_covariance[-1][:2, :2] / (distance**2 / 2)
    np.testing.assert_allclose(spread, np.eye(2), atol=0.1)
    assert last.covariance[-1][4, 4] < 0.1**2  # the depth is known


def test_it_is_consistent_with_motion_from_its_model() -> None:
    p = parameters()
    values = []
    for seed in range(8):
        samples, truth = dive(p, 100 + seed, 40)
        estimates = particles.filtered(p, samples, 4000, seed)
        error = estimates.position - truth[:, :3]
        P = estimates.covariance[np.ix_(range(40), [0, 2, 4], [0, 2, 4])]
        values.append(np.einsum("ki,kij,kj->k", error, np.linalg.inv(P), error).mean())
    assert 1.5 < np.mean(values) < 5.5  # 3 expected


@pytest.mark.parametrize("known", [False, True])
def test_own_positions_tell_the_heading(known: bool) -> None:
    """Of beacons at rest; one packet with a pose changes nothing that they do not say."""
    p = parameters(
        gps_std_m=0.1, gps_markov_std_m=0.0, platform_velocity_std_m_s=0.0, tilt_std_deg=0.0,
        heading_rate_std_deg_s=0.0, imu_heading_error_std_deg=0.0, imu_heading_std_deg=1.0,
        sound_speed_std=0.0, clock_std_m=0.0, outlier_probability=0.0,
        initialisation="first_receptions",
    )
    rng = np.random.default_rng(4)
    n, yaw, at = 24, 2.0, np.array([12.0, -5.0, 8.0])
    beacon, ns = np.arange(n) % 4, 1_000_000_000 * np.arange(1, n + 1)
    c, s = np.cos(yaw), np.sin(yaw)
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    arms = p.beacon_offset[beacon] @ R.T
    place = arms + [100.0, 50.0, 0.0] + 0.1 * rng.normal(size=(n, 3)) * [1, 1, 0]
    heard = np.linalg.norm(at - arms, axis=1) + p.range_std * rng.normal(size=n)
    pose, attitude = np.zeros(n, bool), np.zeros((n, 3))
    if known:
        pose[5], place[5], attitude[5, 2] = True, [100.0, 50.0, 0.0], yaw
    samples = Samples(
        0, ns, np.full(n, at[2]), ns, beacon, heard, pose, place, attitude,
    )
    last = particles.filtered(p, samples, 20_000, 3)
    error = last.position[-1] - [112.0, 45.0, 8.0]
    P = last.covariance[-1][::2, ::2]
    assert np.linalg.norm(error[:2]) < 1.0
    assert error @ np.linalg.solve(P, error) < 11.3  # 99 %
    assert np.sqrt(P[0, 0] + P[1, 1]) < 1.0
