"""The smoother against batch least squares, on dives that were drawn from its model."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from model_dive import dive, parameters, without
from quick import few
from sblcosim.data.samples import Samples, pose_of
from sblcosim.data.truth import Truth
from sblcosim.estimation import late, linear, model, outcome, smoother
from sblcosim.judge import metrics
from sblcosim.judge.definitions import judged_by
from sblcosim.models.receiver import lateness
from sblcosim.models.receiver.waves import HEAVE, STATES
from scipy.spatial.transform import Rotation
from scipy.stats import exponnorm, norm
from seams import Seam


def guess(truth: np.ndarray, seed: int = 0) -> np.ndarray:
    """A first trajectory, off by metres."""
    rng = np.random.default_rng(seed)
    at = truth + rng.normal(0, 0.05, truth.shape)
    at[:, :3] = truth[:, :3] + rng.normal(0, 1.0, 3)
    return np.asarray(at)


def smoothed(p: Any, samples: Samples, truth: np.ndarray, passes: int = 60) -> smoother.Track:
    return smoother.smooth(p, samples, guess(truth), passes)


def position_nees(track: smoother.Track, truth: np.ndarray) -> float:
    error = (track.mean - truth)[:, :3]
    P = track.covariance[:, :3, :3]
    return float(np.einsum("ki,kij,kj->k", error, np.linalg.inv(P), error).mean())


# --- The linear smoother -------------------------------------------------------------------------


def a_linear_problem(rng: np.random.Generator) -> linear.Problem:
    n, d, u = 9, 4, 2
    roots = rng.normal(size=(u, d, d)) * [1.0, 0.5, 0.1, 0.0]  # the last state has no noise
    first = np.array([0, 2, 2, 3, 5, 6, 6, 8, 9, 11])
    return linear.Problem(
        rng.normal(size=d), np.diag([1e6, 1.0, 0.0, 4.0]), np.eye(d) + 0.1 * rng.normal(
            size=(u, d, d)), roots @ roots.transpose(0, 2, 1), rng.integers(0, u, n), first,
        rng.normal(size=(11, d)), rng.normal(size=11), rng.uniform(1e-3, 1.0, 11),
    )


def stacked(problem: linear.Problem) -> tuple[np.ndarray, np.ndarray]:
    """All states as mean and factor: z = m + L e, with e of unit covariance."""
    def root(P: np.ndarray) -> np.ndarray:
        values, vectors = np.linalg.eigh(P)
        return np.asarray(vectors * np.sqrt(np.maximum(values, 0)))

    n, d = len(problem.which), len(problem.mean)
    mean, factor = np.zeros((n, d)), np.zeros((n, d, (n + 1) * d))
    m, L = problem.mean, np.zeros((d, (n + 1) * d))
    L[:, :d] = root(problem.covariance)
    for k, turn in enumerate(problem.which):
        m, L = problem.phi[turn] @ m, problem.phi[turn] @ L
        L[:, (k + 1) * d : (k + 2) * d] += root(problem.noise[turn])
        mean[k], factor[k] = m, L
    return mean, factor


def batch(
    problem: linear.Problem, node: np.ndarray, H: np.ndarray, z: np.ndarray, R: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of all states by one least-squares problem."""
    mean, factor = stacked(problem)
    rows = np.einsum("md,mde->me", H, factor[node]) / np.sqrt(R)[:, None]
    off = (z - np.einsum("md,md->m", H, mean[node])) / np.sqrt(R)
    A = np.vstack([np.eye(rows.shape[1]), rows])
    e = np.linalg.lstsq(A, np.concatenate([np.zeros(rows.shape[1]), off]), rcond=None)[0]
    spread = factor @ np.linalg.inv(np.linalg.qr(A, mode="r"))
    return mean + factor @ e, spread @ spread.transpose(0, 2, 1)


@pytest.mark.parametrize("seed", range(5))
def test_a_linear_problem_is_solved_as_by_least_squares(seed: int) -> None:
    problem = a_linear_problem(np.random.default_rng(seed))
    moments = linear.smooth(problem)
    node = np.searchsorted(problem.first, np.arange(11), side="right") - 1
    mean, covariance = batch(problem, node, problem.H, problem.z, problem.R)
    np.testing.assert_allclose(moments.mean, mean, rtol=0, atol=1e-7)
    np.testing.assert_allclose(moments.covariance, covariance, rtol=0, atol=1e-7)


def test_noises_are_those_of_least_squares() -> None:
    """−Q λ and Q − Q Λ Q are mean and covariance of the noise of each step."""
    problem = a_linear_problem(np.random.default_rng(7))
    moments = linear.smooth(problem)
    node = np.searchsorted(problem.first, np.arange(11), side="right") - 1
    mean, factor = stacked(problem)
    rows = np.einsum("md,mde->me", problem.H, factor[node]) / np.sqrt(problem.R)[:, None]
    off = (problem.z - np.einsum("md,md->m", problem.H, mean[node])) / np.sqrt(problem.R)
    P = np.linalg.inv(np.eye(rows.shape[1]) + rows.T @ rows)
    for k, turn in list(enumerate(problem.which))[1:]:
        Q, own = problem.noise[turn], factor[k] - problem.phi[turn] @ factor[k - 1]
        noise = own @ P @ rows.T @ off
        np.testing.assert_allclose(-Q @ moments.lean[k], noise, rtol=0, atol=1e-6)
        np.testing.assert_allclose(
            Q - Q @ moments.weight[k] @ Q, own @ P @ own.T, rtol=0, atol=1e-6
        )


# --- Late arrivals -------------------------------------------------------------------------------


@pytest.mark.parametrize("chance", [0.01, 0.2])
def test_the_density_of_late_ranges_is_that_of_coupled(chance: float) -> None:
    p = parameters(outlier_probability=chance)
    residual = np.concatenate([np.linspace(-8, 40, 97), [-0.3, 0.0, 0.25]])
    for S in (1e-4, 0.01, 0.3, 9.0):
        ours = late.share(p, residual, S)
        pairs = [lateness.densities(p, ca.SX(v), ca.SX(S)) for v in residual]
        theirs = [float(ca.evalf(one / (one + other))) for one, other in pairs]
        np.testing.assert_allclose(ours, theirs, rtol=1e-5, atol=1e-9)


def expected_share(p: Any, residual: np.ndarray, variance: np.ndarray) -> np.ndarray:
    sigma = np.sqrt(variance)
    pi, m = p.outlier_probability, p.outlier_mean
    inlier = (1 - pi) * norm.pdf(residual, scale=sigma)
    other = pi * exponnorm.pdf(residual, m / sigma, scale=sigma) + 1e-4 / 50
    return np.asarray(inlier / (inlier + other))


# --- The whole track -----------------------------------------------------------------------------


def predictions(p: Any, samples: Samples, x: np.ndarray) -> tuple[np.ndarray, ...]:
    """h(x) of depth readings, and of north, east, down, heading and range of packets."""
    at = x[np.searchsorted(samples.epochs_ns, samples.range_ns)]
    trust = p.tilt_std**2 / (p.tilt_std**2 + p.imu_tilt_std**2)
    tilt = trust * samples.attitude[:, :2]
    body = p.beacon_offset[samples.beacon]
    arm = Rotation.from_euler("xyz", np.column_stack([tilt, at[:, 12]])).apply(body)
    beacon = np.column_stack([at[:, 6:8], samples.position[:, 2] - at[:, 18]]) + arm
    distance = np.linalg.norm(at[:, :3] - beacon, axis=1)
    sounding = x[np.searchsorted(samples.epochs_ns, samples.depth_ns)]
    return (
        sounding[:, 2] + sounding[:, 17], at[:, 6] + at[:, 10], at[:, 7] + at[:, 11],
        at[:, HEAVE] + at[:, 18], at[:, 12] + at[:, 14], (1 + at[:, 16]) * distance + at[:, 15],
    )


def range_variance(p: Any, samples: Samples, x: np.ndarray) -> np.ndarray:
    """R of the ranges, by differences of ±1 mrad in roll and pitch."""
    own, white = p.tilt_std**2, p.imu_tilt_std**2
    trust, step = own / (own + white), 1e-4
    variance = np.full(len(samples.range), p.range_std**2)
    for axis in (0, 1):
        turned = []
        for sign in (1, -1):
            attitude = samples.attitude.copy()
            attitude[:, axis] += sign * step / trust
            turned.append(predictions(p, replace(samples, attitude=attitude), x)[5])
        variance += trust * white * ((turned[0] - turned[1]) / (2 * step)) ** 2
    return variance


def brute_force(
    p: Any, samples: Samples, begin: tuple[linear.Problem, np.ndarray], passes: int
) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Newton on all states at once, with numerical derivatives, from a trajectory."""
    frame, at = begin
    epochs, n = samples.epochs_ns, len(samples.range)
    sounded, heard = (np.searchsorted(epochs, ns) for ns in (samples.depth_ns, samples.range_ns))
    node = np.concatenate([sounded, heard, heard, heard, heard, heard])
    z = np.concatenate([
        samples.depth, *samples.position.T, samples.attitude[:, 2], samples.range,
    ])
    covariance = np.zeros(0)
    for _ in range(passes):
        h = np.concatenate(predictions(p, samples, at))
        H = np.zeros((len(z), STATES))
        for i in range(STATES):
            step = np.zeros(STATES)
            step[i] = 1e-5
            two = [np.concatenate(predictions(p, samples, at + s * step)) for s in (1, -1)]
            H[:, i] = (two[0] - two[1]) / 2e-5
        R = range_variance(p, samples, at)
        R = R / np.maximum(expected_share(p, samples.range - h[-n:], R), 1e-12)
        variance = np.concatenate([
            np.full(len(sounded), p.depth_std**2), np.full(2 * n, max(p.gps_std, 0.01) ** 2),
            np.full(n, max(p.gps_vertical_std, 1e-3) ** 2),
            np.full(n, max(p.imu_heading_std, 1e-3) ** 2), R,
        ])
        pseudo = z - h + np.einsum("mi,mi->m", H, at[node])
        at, covariance = batch(frame, node, H, pseudo, variance)
    return at, covariance


@pytest.mark.parametrize("seed", few(range(30), quick=range(10)))
def test_the_track_is_the_maximum_of_the_posterior(
    seed: int, seam: Seam
) -> None:
    seam.tuned(close=1e-8)
    initialisation = ("prior", "first_receptions")[seed % 2]
    p = parameters(initialisation=initialisation, sound_speed_std=0.0, depth_bias_std_m=0.0,
                   gps_vertical_error_std_m=0.5)
    samples, truth = dive(p, seed, 12)
    track = smoothed(p, samples, truth, 200)
    frame = model.problem(p, samples, guess(truth)[0])
    mean, covariance = brute_force(p, samples, (frame, track.mean), 3)
    assert track.converged
    np.testing.assert_allclose(track.mean, mean, rtol=0, atol=1e-6)
    np.testing.assert_allclose(track.covariance, covariance, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_a_first_trajectory_that_is_metres_off_leads_to_the_track(seed: int) -> None:
    """Without a prior, clock and speed of sound must not let the diver be anywhere."""
    p = parameters(initialisation="first_receptions")
    samples, truth = dive(p, seed, 40, late=0.0)
    track = smoothed(p, samples, truth, 40)
    assert track.converged
    assert np.median(track.punctual) > 0.9
    assert np.abs((track.mean - truth)[:, :3]).max() < 30


def test_first_trajectories_that_are_turned_lead_to_the_track() -> None:
    """As those of a filter with a wrong bearing: all ranges seem late there."""
    p = parameters(initialisation="first_receptions")
    c, s = np.cos(1.2), np.sin(1.2)
    found = []
    for seed in range(8):
        samples, truth = dive(p, seed, 90, late=0.0)
        at = truth.copy()
        at[:, :2] = truth[:, 6:8] + (truth[:, :2] - truth[:, 6:8]) @ [[c, s], [-s, c]]
        track = smoother.smooth(p, samples, at)
        found.append(track.converged and track.punctual.mean() > 0.9)
    assert sum(found) >= 6


# --- How restless the diver is -------------------------------------------------------------------


@pytest.mark.slow
def test_q_is_learned_for_each_stretch() -> None:
    """A diver who is steady, then restless, then steady; the median over dives of its log."""
    true = np.repeat([0.002, 0.2, 0.002], 80)
    learned = []
    for seed in range(6):
        p = parameters(initialisation="first_receptions", acceleration_psd_m2_s3=0.02)
        samples, truth = dive(p, seed, 240, loss=0.0, psd=true)
        track = smoother.smooth(p, samples, truth, learns=True)
        assert track.converged
        learned.append([np.median(part) for part in np.split(track.psd, 3)])
    steady, restless, again = np.exp(np.mean(np.log(learned), axis=0))
    assert 0.05 < restless < 0.5
    assert 5 * max(steady, again) < restless


@pytest.mark.slow
def test_learned_q_mends_the_covariance() -> None:
    true = np.repeat([0.001, 0.1], 60)
    nees: dict[bool, list[float]] = {True: [], False: []}
    for seed in range(10):
        p = parameters(acceleration_psd_m2_s3=0.003)
        samples, truth = dive(p, seed, 120, psd=true)
        for learns, values in nees.items():
            track = smoother.smooth(p, samples, truth, learns=learns)
            values.append(position_nees(track, truth))
    assert np.mean(nees[True]) < 0.75 * np.mean(nees[False])


def test_states_before_the_first_packet_keep_their_digits(seam: Seam) -> None:
    """What a packet takes off a variance of 10⁶ times the rest is not left to rounding."""
    seam.tuned(far_std=1000.0)
    p = parameters()
    samples, truth = dive(p, 4, 14)
    assert samples.range_ns[0] > samples.epochs_ns[0]
    rows = model.rows(p, samples, truth)
    problem = smoother.linearised(
        model.problem(p, samples, truth[0]), rows, truth, np.ones(len(samples.range))
    )
    moments = linear.smooth(problem)
    mean, covariance = batch(problem, rows.node, problem.H, problem.z, problem.R)
    np.testing.assert_allclose(moments.mean, mean, rtol=0, atol=1e-5)
    np.testing.assert_allclose(moments.covariance, covariance, rtol=1e-4, atol=1e-6)


def test_claimed_covariances_are_those_of_the_errors() -> None:
    p = parameters()
    values = []
    for seed in range(30):
        samples, truth = dive(p, seed, 60)
        values.append(position_nees(smoothed(p, samples, truth, 20), truth))
    assert 2.4 < np.mean(values) < 4.0  # 3 expected; the bearing bends the posterior


def test_residuals_are_divided_by_their_standard_deviation() -> None:
    """That of a range about a track that has followed it in part is less than the range's own."""
    p = parameters(outlier_probability=0.0)
    found = []
    for seed in range(5):
        samples, truth = dive(p, seed, 60, late=0.0)
        found.append(smoother.smooth(p, samples, truth).residual)
    assert 0.85 < np.sqrt((np.concatenate(found) ** 2).mean()) < 1.15


def test_late_ranges_do_not_count() -> None:
    p = parameters(outlier_probability=0.1, outlier_mean_m=3.0)
    samples, truth = dive(p, 1, 60, late=0.0)
    late_ones = np.arange(len(samples.range)) % 9 == 4
    spoilt = replace(samples, range=samples.range + 6.0 * late_ones)
    clean, track = smoothed(p, samples, truth), smoothed(p, spoilt, truth)
    assert track.punctual[late_ones].max() < 1e-6
    assert np.median(track.punctual[~late_ones]) > 0.9
    move = np.linalg.norm((track.mean - clean.mean)[:, :3], axis=1)
    assert np.sqrt((move**2).mean()) < 0.5


def test_a_gap_without_packets_is_bridged_from_both_sides() -> None:
    p = parameters()
    samples, truth = dive(p, 2, 90, late=0.0)
    seconds = samples.range_ns / 1e9
    whole = smoothed(p, samples, truth)
    track = smoothed(p, without(samples, (seconds > 30) & (seconds < 60)), truth)
    wider = np.trace(track.covariance[:, :3, :3], axis1=1, axis2=2)
    wider /= np.trace(whole.covariance[:, :3, :3], axis1=1, axis2=2)
    assert 34 < wider.argmax() < 56  # widest in the middle
    assert wider[44] > 1.3 * max(wider[10], wider[80])
    assert position_nees(track, truth) < 9


def test_two_beacons_alone_are_used() -> None:
    p = parameters()
    samples, truth = dive(p, 5, 90, late=0.0)
    seconds = samples.range_ns / 1e9
    stretch = (seconds > 30) & (seconds < 60)
    two, none = (
        smoothed(p, without(samples, stretch & np.isin(samples.beacon, lost)), truth)
        for lost in ([2, 3], [0, 1, 2, 3])
    )
    assert position_nees(two, truth) < 9
    assert np.trace(two.covariance[44, :2, :2]) < np.trace(none.covariance[44, :2, :2])


def test_packets_with_own_positions_only() -> None:
    p = parameters()
    samples, truth = dive(p, 6, 60, late=0.0)
    at = truth[np.searchsorted(samples.epochs_ns, samples.range_ns)]
    rng = np.random.default_rng(1)
    heading = at[:, [12]] + at[:, [14]]
    arm = Rotation.from_euler("z", heading).apply(p.beacon_offset[samples.beacon])
    place = at[:, [6, 7, HEAVE]] + at[:, [10, 11, 18]] + arm
    place[:, :2] += p.gps_std * rng.standard_normal((len(at), 2))
    own = replace(
        samples, position=place, has_pose=np.zeros(len(at), bool), attitude=0 * samples.attitude
    )
    track = smoothed(p, own, truth)
    assert track.converged
    assert position_nees(track, truth) < 9
    assert np.abs(track.mean[:, 12] + track.mean[:, 14] - truth[:, 12] - truth[:, 14]).max() < 0.2


def test_smoothing_again_gives_equal_bits() -> None:
    p = parameters()
    samples, truth = dive(p, 7, 20)
    one, two = (smoothed(p, samples, truth) for _ in range(2))
    assert np.array_equal(one.mean, two.mean)
    assert np.array_equal(one.covariance, two.covariance)
    assert one.steps_m == two.steps_m


@pytest.mark.parametrize("known", [True, False], ids=["prior", "first receptions"])
def test_every_state_has_its_own_prior(known: bool) -> None:
    keys = {
        "prior_position": np.array([1.0, 2.0, 3.0]), "prior_velocity": np.array([0.4, -0.5, 0.6]),
        "prior_position_std": 0.7, "prior_velocity_std": 0.8, "platform_velocity_std": 0.9,
        "gps_markov_std": 1.1, "heading_rate_std": 0.12, "imu_heading_error_std": 0.13,
        "clock_std": 1.4, "sound_speed_std": 0.15, "depth_bias_std": 1.6,
        "gps_vertical_error_std": 1.7, "heave_std": 1.8, "tilt_std": 0.19,
    }
    p = parameters(initialisation="prior" if known else "first_receptions")
    vars(p).update(keys)
    begin = 100.0 + np.arange(float(STATES))
    mean, std = model.prior(p, begin)
    place = [1.0, 2.0, 3.0] if known else [100.0, 101.0, 102.0]
    velocity = [0.4, -0.5, 0.6] if known else [0.0] * 3
    np.testing.assert_array_equal(
        mean, [*place, *velocity, 106.0, 107.0, 0, 0, 0, 0, 112.0, *[0] * 9]
    )
    np.testing.assert_array_equal(std, [
        *([0.7] * 3 if known else [30.0] * 3), *[0.8] * 3, 30.0, 30.0, 0.9, 0.9, 1.1, 1.1, 10.0,
        0.12, 0.13, 1.4, 0.15, 1.6, 1.7, 1.8, 0.19, 0.19,
    ])


def test_a_velocity_that_is_known_before_is_that_of_the_track() -> None:
    """And the track follows it: 0.3 m/s north is 9 m in half a minute that nobody hears."""
    p = parameters()
    p.prior_velocity, p.prior_velocity_std = np.array([0.3, -0.2, 0.0]), 1e-4
    p.prior_position_std, p.acceleration_psd = 0.01, 1e-8
    samples, truth = dive(p, 3, 30, late=0.0)
    deaf = replace(without(samples, samples.range_ns < 29 * 10**9), depth=samples.depth)
    track = smoothed(p, deaf, truth, 30)
    expected = p.prior_position + np.outer(samples.epochs_ns / 1e9, p.prior_velocity)
    np.testing.assert_allclose(track.mean[:, 3:5], [[0.3, -0.2]] * 30, atol=5e-3)
    np.testing.assert_allclose(track.mean[:, :2], expected[:, :2], atol=0.15)


def test_the_covariance_of_an_estimate_is_in_the_paper_s_order() -> None:
    """x, vx, y, vy, z, vz; relative to the platform as that of the difference."""
    p = parameters()
    p.gps_bias_std = 0.5
    samples, truth = dive(p, 4, 20, late=0.0)
    rng = np.random.default_rng(2)
    root = 1e-3 * rng.normal(size=(20, STATES, STATES))  # so small that nothing bends
    P = root @ root.transpose(0, 2, 1)
    found = outcome.of_states(p, samples, truth, P)
    assert len(found) == 20
    names = ["x", "y", "z", "vx", "vy", "vz"]
    order = [names.index(name) for name in ("x", "vx", "y", "vy", "z", "vz")]
    expected = P[:, order][:, :, order].copy()
    expected[:, 0, 0] += 0.5**2  # the bias of the GPS is in no state: north and east only
    expected[:, 2, 2] += 0.5**2
    np.testing.assert_allclose(found.covariance, expected, rtol=0, atol=2e-9)
    np.testing.assert_array_equal(found.position, truth[:, :3])
    np.testing.assert_array_equal(found.velocity, truth[:, 3:6])
    draws = np.einsum("kij,nj->nki", root, rng.standard_normal((4000, STATES)))
    apart = draws[:, :, :3] - draws[:, :, [6, 7, HEAVE]]
    sampled = np.einsum("nki,nkj->kij", apart, apart) / len(draws)
    np.testing.assert_allclose(found.relative_covariance, sampled, rtol=0.05, atol=6e-6)
    known = Truth(time_ns=found.epoch_ns, position=found.position)
    track = metrics.track(judged_by(found, known))
    column = track[["std_x_m", "std_y_m", "std_z_m"]].to_numpy()
    np.testing.assert_allclose(column**2, np.stack([expected[:, i, i] for i in (0, 2, 4)], axis=1),
                               rtol=1e-5)


def test_the_pose_that_positions_of_beacons_tell() -> None:
    body = np.array([[3.0, 0, 0.5], [0, 3, 0.2], [-3, 0, 0.5], [0, -3, 0.9]])
    angles = np.array([0.05, -0.08, 2.5])
    points = Rotation.from_euler("xyz", angles).apply(body) + np.array([1.0, 2.0, 0.3])
    position, attitude = pose_of(points, body)
    np.testing.assert_allclose(position, [1, 2, 0.3], atol=1e-12)
    np.testing.assert_allclose(attitude, angles, atol=1e-12)
