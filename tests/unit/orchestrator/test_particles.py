"""The particle filter: against Kalman filters where they are exact, and where they cannot be."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from model_dive import START, dive, parameters
from sblcosim.data.samples import Samples
from sblcosim.estimation import late, linear, model, particles
from sblcosim.estimation.linear import Problem
from sblcosim.estimation.smoother import linearised
from sblcosim.models.receiver import surroundings
from sblcosim.models.receiver.waves import Heave
from scipy import stats


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
    samples, truth = dive(p, 1, 20, late=0.0)
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


def some_cloud(p: Any, n: int = 40) -> particles.Cloud:
    """Particles about `START`, each with its own means, and with covariances of all kinds."""
    rng = np.random.default_rng(11)

    def covariance(size: int, count: int = 1) -> np.ndarray:
        root = 0.3 * rng.standard_normal((count, size, size))
        return root @ root.transpose(0, 2, 1)

    about = np.zeros((n, 2, 5))
    about[:, :, 0] = START[:2]
    down = np.tile([START[2], 0.0, 0.0], (n, 1))
    return particles.Cloud(
        0.5 * rng.standard_normal(n), about + rng.standard_normal(about.shape), covariance(5)[0],
        down + 0.3 * rng.standard_normal((n, 3)), covariance(3)[0],
        [0.3, 1e-3, 0.3] * rng.standard_normal((n, 3)),
        covariance(3, n) * np.outer([1, 1e-3, 1], [1, 1e-3, 1]),
        0.2 * rng.standard_normal((n, 2)), 0.01 * covariance(2)[0],
    )


def test_a_range_leaves_the_moments_of_punctual_and_not_together() -> None:
    """Law of total variance: corrected where it is punctual, else as before."""
    p = parameters(outlier_probability=0.3, outlier_mean_m=1.0)
    cloud = some_cloud(p)
    pose, body = surroundings.Pose(0.0, 0.0, 0.0, 0.0), [0.5, 0.2, 0.4]
    z = 13.0
    after = particles.ranged(p, cloud, pose, body, z)
    shares = []
    for i, (before, P) in enumerate(zip(cloud.slow, cloud.P_slow, strict=True)):
        x = np.zeros(surroundings.STATES)
        x[surroundings.HEADING], x[2] = cloud.turn[i, 0], cloud.down[i, 0]
        x[[0, 1]] = cloud.flat[i, :, 0]
        x[[surroundings.CLOCK, surroundings.SPEED, surroundings.VERTICAL_ERROR]] = before
        row = surroundings.range_(np, p, x, pose, body)
        h = np.array([1.0, row.distance, row.u[2]])
        S = h @ P @ h + row.variance + row.row[surroundings.HEADING] ** 2 * cloud.P_turn[0, 0]
        share = late.share(p, z - row.value, S)
        corrected = before + P @ h / S * (z - row.value)
        left = P - np.outer(P @ h, P @ h) / S
        mean = share * corrected + (1 - share) * before
        covariance = share * left + (1 - share) * P
        for part, at in ((share, corrected), (1 - share, before)):
            covariance += part * np.outer(at - mean, at - mean)
        np.testing.assert_allclose(after.slow[i], mean, rtol=1e-9)
        np.testing.assert_allclose(after.P_slow[i], covariance, rtol=1e-9, atol=1e-12)
        density = np.logaddexp(*late.log_densities(p, z - row.value, S))
        assert after.log_weight[i] - cloud.log_weight[i] == pytest.approx(density)
        shares.append(share)
    assert np.std(shares) > 0.1  # of all kinds


def test_the_moments_are_those_of_draws_from_the_particles() -> None:
    """Of position, velocity, what is seen from the platform, its place, clock and sound speed."""
    p = parameters(imu_heading_error_std_deg=3.0, gps_bias_std_m=0.4, gps_vertical_std_m=0.3)
    cloud, heave = some_cloud(p, 30), Heave(1.5, 0.6, 0.3**2)
    rng, n = np.random.default_rng(5), 400_000
    which = rng.choice(len(cloud.weight), n, p=cloud.weight)

    def of(mean: np.ndarray, P: np.ndarray) -> np.ndarray:
        return mean + rng.standard_normal(mean.shape) @ np.linalg.cholesky(P).T

    flat, depth = of(cloud.flat[which], cloud.P_flat), of(cloud.down[which], cloud.P_down)
    roots = np.linalg.cholesky(cloud.P_slow)[which]
    noise = (roots @ rng.standard_normal((n, 3, 1)))[:, :, 0]
    slow = cloud.slow[which] + noise
    y, v, place = flat[:, :, 0], flat[:, :, 1], flat[:, :, 3]
    x = np.column_stack([y + place, depth[:, 0]])
    seen = np.column_stack([y, depth[:, 0] - heave.down + heave.share * slow[:, 2]])
    speed = np.column_stack([v, depth[:, 1]])
    # The heading's slow error turns all about the platform, by as much as the mean is away.
    turn = p.imu_heading_error_std * rng.standard_normal((n, 1))
    north, east = cloud.weight @ cloud.flat[:, :, 0]
    turned = turn * [-east, north]
    x[:, :2] += turned + p.gps_bias_std * rng.standard_normal((n, 2))
    seen[:, :2] += turned
    seen[:, 2] += 0.3 * rng.standard_normal(n)
    position, velocity, P, relative, R, platform, clock, sound = particles.moments(p, cloud, heave)
    states = np.stack([x, speed], axis=2).reshape(n, 6)
    for found, drawn in ((position, x), (velocity, speed), (relative, seen)):
        np.testing.assert_allclose(found, drawn.mean(axis=0), atol=0.02)
    for known, drawn in ((P, states), (R, seen)):
        std = drawn.std(axis=0)
        np.testing.assert_allclose(
            known / np.outer(std, std), np.cov(drawn.T) / np.outer(std, std), atol=0.02
        )
    deep = heave.down - heave.share * slow[:, 2].mean()
    north_east_down = [*place.mean(axis=0), deep]
    np.testing.assert_allclose(platform, north_east_down, atol=0.02)
    beta, kappa = cloud.weight @ cloud.slow[:, :2]
    assert clock == pytest.approx(beta / p.assumed_sound_speed)
    assert sound == pytest.approx(p.assumed_sound_speed / (1 + kappa))


def test_particles_begin_at_every_bearing_and_distance_that_the_first_range_allows() -> None:
    """Uniformly between four standard deviations of it to both sides, about the beacon."""
    p = parameters(range_std_m=0.3, clock_std_m=0.4, sound_speed_std=0.01)
    cloud = some_cloud(p, 20_000)
    pose, body, z = surroundings.Pose(0.5, 0.0, 0.0, 0.0), [3.0, 1.0, 0.4], 40.0
    begun = particles.anywhere(p, cloud, pose, body, z, np.random.default_rng(6))
    c, s = np.cos(cloud.turn[:, 0]), np.sin(cloud.turn[:, 0])
    away = begun.flat[:, :, 0] - np.column_stack([c * 3.0 - s * 1.0, s * 3.0 + c * 1.0])
    below = begun.down[:, 0] - 0.5 - 0.4
    variance = p.range_std**2 + p.clock_std**2 + (p.sound_speed_std * z) ** 2
    reach = 4 * np.sqrt(variance + p.gps_vertical_error_std**2)
    slant = np.sqrt((away**2).sum(axis=1) + below**2)
    assert stats.kstest((slant - z) / reach, stats.uniform(-1, 2).cdf).pvalue > 1e-3
    bearing = np.arctan2(away[:, 1], away[:, 0])
    assert stats.kstest(bearing / np.pi, stats.uniform(-1, 2).cdf).pvalue > 1e-3
    assert np.corrcoef(slant, bearing)[0, 1] == pytest.approx(0, abs=0.03)
    depth = (begun.down[:, 0] - cloud.down[:, 0]) / np.sqrt(cloud.P_down[0, 0])
    assert stats.kstest(depth, "norm").pvalue > 1e-3
    assert not begun.P_flat[0].any()
    assert not begun.P_down[0].any()


def bayes(mean: np.ndarray, P: np.ndarray, h: np.ndarray, z: float, R: float) -> tuple[Any, ...]:
    """Mean, covariance and log density [up to a constant] after a measurement; by information."""
    information = np.linalg.inv(P) + np.outer(h, h) / R
    after = np.linalg.inv(information)
    fitted = after @ (np.linalg.solve(P, mean) + h * z / R)
    return fitted, after, stats.norm.logpdf(z, h @ mean, np.sqrt(h @ P @ h + R))


def test_depths_headings_and_places_are_weighed_by_their_noise() -> None:
    """Of a place also the tilt, which moves a beacon below the reference point."""
    p = parameters(depth_std_m=0.2, imu_heading_std_deg=4.0, gps_std_m=0.7, tilt_std_deg=6.0,
                   imu_tilt_std_deg=2.0)
    cloud, yaw_std = some_cloud(p), np.radians(4.0)
    place, body = np.array([1.3, -0.4]), [0.6, -0.3, 4.0]
    place_variance = 0.7**2 + 4.0**2 * (np.radians(6.0) ** 2 + np.radians(2.0) ** 2)
    depth, heading = START[2] + 0.4, 2 * np.pi + 0.1
    found = {
        "down": particles.sounded(p, cloud, depth), "turn": particles.headed(p, cloud, heading),
        "flat": particles.placed(p, cloud, place, body),
    }
    expected: dict[str, list[Any]] = {name: [] for name in found}
    for down, turn, flat in zip(cloud.down, cloud.turn, cloud.flat, strict=True):
        reading, first = np.array([1.0, 0, 1]), np.array([1.0, 0])
        expected["down"].append(bayes(down, cloud.P_down, reading, depth, 0.2**2))
        expected["turn"].append(bayes(turn, cloud.P_turn, first, 0.1, yaw_std**2))
        c, s = np.cos(turn[0]), np.sin(turn[0])
        arm = np.array([[c, -s], [s, c]]) @ body[:2]
        axes = [
            bayes(flat[i], cloud.P_flat, np.array([0.0, 0, 0, 1, 1]), place[i] - arm[i],
                  place_variance)
            for i in (0, 1)
        ]
        expected["flat"].append((np.array([axes[0][0], axes[1][0]]), axes[0][1],
                                 axes[0][2] + axes[1][2]))
    for name, after in found.items():
        means, covariances, weights = zip(*expected[name], strict=True)
        np.testing.assert_allclose(getattr(after, name), means, rtol=1e-6, atol=1e-6)
        covariance = getattr(after, f"P_{name}")
        np.testing.assert_allclose(covariance, covariances[0], rtol=1e-6, atol=1e-8)
        gained = after.log_weight - cloud.log_weight - weights
        np.testing.assert_allclose(gained, gained[0], rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("own", [0.0, 1.0])
def test_a_reported_depth_of_the_platform_is_weighed_by_heave_and_noise(own: float) -> None:
    """h of the platform is common to all particles, g_z is each particle's own."""
    p = parameters(gps_vertical_std_m=0.2, tilt_std_deg=6.0, imu_tilt_std_deg=2.0)
    cloud, heave, body = some_cloud(p), Heave(0.1, 0.4, 0.3**2), [2.0, 1.0, 0.4]
    noise = 0.2**2 + own * 5.0 * (np.radians(6.0) ** 2 + np.radians(2.0) ** 2)
    pose = surroundings.Pose(0.7, 0.0, 0.0, 0.0, own)
    after, later = particles.floated(p, cloud, heave, pose, body)
    for i, (before, P) in enumerate(zip(cloud.slow, cloud.P_slow, strict=True)):
        mean, covariance, weight = bayes(
            before, P, np.array([0.0, 0.0, 0.6]), 0.7 - 0.1, 0.3**2 + noise
        )
        np.testing.assert_allclose(after.slow[i], mean, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(after.P_slow[i], covariance, rtol=1e-6, atol=1e-9)
        gained = after.log_weight[i] - cloud.log_weight[i] - weight
        assert gained == pytest.approx(0.5 * np.log(2 * np.pi), rel=1e-6)
    gain = 0.09 / (0.09 + noise)
    assert (later.down, later.share, later.variance) == pytest.approx(
        (0.1 + gain * 0.6, 0.4 + gain * 0.6, (1 - gain) * 0.09)
    )
