"""The passes of the smoother one by one: heat, length, learned q; and what is made of a track."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from model_dive import dive, parameters
from sblcosim.data.estimates import Estimates
from sblcosim.data.samples import Samples
from sblcosim.estimation import belief, field, late, linear, model, outcome, restless, smoother
from sblcosim.estimation.after import assumed
from sblcosim.models.receiver.waves import STATES
from sblcosim.scenario.scenario import load
from scipy.stats import exponnorm, norm
from seams import Seam

RANGES = 40


def off_by_metres(truth: np.ndarray, north: float = 1.5, east: float = -0.7) -> np.ndarray:
    at = truth.copy()
    at[:, 0] += north
    at[:, 1] += east
    return at


def farthest(move: np.ndarray) -> float:
    return max(float(np.linalg.norm(row[:3])) for row in move)


# --- Heat and length -----------------------------------------------------------------------------


def test_first_passes_take_ranges_for_less_and_less_certain() -> None:
    """1000, 300, 100, 30, 10 and 3 times their variance; the last pass takes it as it is."""
    p = parameters(imu_tilt_std_deg=0.0)  # a range has no variance but its own
    samples, truth = dive(p, 3, 16)
    at = off_by_metres(truth)
    track = smoother.smooth(p, samples, at, 7)
    for heat, step in zip((1000, 300, 100, 30, 10, 3, 1), track.steps_m, strict=True):
        warm = copy.copy(p)
        warm.range_std = p.range_std * np.sqrt(heat)
        one = smoother.smooth(warm, samples, at, 1)
        assert one.steps_m == (pytest.approx(farthest(one.mean - at), rel=1e-9),)
        assert step == pytest.approx(one.steps_m[0], rel=0.01)
        at = one.mean
    np.testing.assert_allclose(track.mean[:, :3], at[:, :3], atol=0.01)
    short = smoother.smooth(p, samples, off_by_metres(truth), 3)
    assert short.steps_m[:2] == pytest.approx(track.steps_m[:2], rel=1e-12)
    assert short.steps_m[2] != pytest.approx(track.steps_m[2], rel=0.1)  # without heat


@pytest.mark.parametrize(("seed", "passes", "shortest", "longest"), [
    (5, 11, 0.2, 2.1), (11, 13, 0.1, 2.0),
])  # fmt: skip
def test_a_pass_is_as_long_as_the_change_from_the_one_before_tells(
    seed: int, passes: int, shortest: float, longest: float, seam: Seam
) -> None:
    """Irons and Tuck: times b·(b − a)/|b − a|² for moves b, then a; twice where they grow."""
    seam.tuned(close=0.0)
    p = parameters(
        initialisation="first_receptions", outlier_probability=0.3, outlier_mean_m=2.0
    )
    samples, truth = dive(p, seed, 12, late=0.4)
    c, s = np.cos(1.2), np.sin(1.2)
    begin = truth.copy()  # turned about the platform
    begin[:, :2] = truth[:, 6:8] + (truth[:, :2] - truth[:, 6:8]) @ [[c, s], [-s, c]]
    tracks = [smoother.smooth(p, samples, begin, n) for n in range(7, passes + 1)]
    at, steps = [track.mean[:, :3] for track in tracks], tracks[-1].steps_m
    assert len(steps) == passes
    lengths = [farthest(b - a) / step for a, b, step in zip(at, at[1:], steps[7:], strict=False)]
    moves = [(b - a) / length for a, b, length in zip(at, at[1:], lengths, strict=False)]
    for k in range(1, len(moves)):
        change = (moves[k - 1] - moves[k]).ravel()
        shrunk = moves[k - 1].ravel() @ change
        factor = shrunk / (change @ change) if shrunk > 0 else 2.0
        expected = min(max(lengths[k - 1] * factor, 0.1), 3.0)
        assert lengths[k] == pytest.approx(expected, rel=1e-6)
    assert [min(lengths), max(lengths)] == pytest.approx([shortest, longest], abs=0.05)


def test_passes_end_at_the_first_small_move_after_the_heated_ones() -> None:
    p = parameters(outlier_probability=0.0)
    samples, truth = dive(p, 1, 12, late=0.0)
    track = smoother.smooth(p, samples, truth)
    assert track.converged
    assert all(step >= smoother.CLOSE for step in track.steps_m[7:-1])
    assert track.steps_m[-1] < smoother.CLOSE
    again = smoother.smooth(p, samples, track.mean, 8)  # from where nothing moves
    assert len(again.steps_m) == 8  # six heated ones, and no end right after them
    assert replace(track, steps_m=(0.5, smoother.CLOSE)).converged is False
    assert replace(track, steps_m=(0.5, 0.9 * smoother.CLOSE)).converged is True


def test_residuals_of_a_track_are_divided_by_what_it_leaves_of_their_variance() -> None:
    """R/λ − H P Hᵀ, at least a twentieth of R/λ; λ is that of the residual on the track."""
    p = parameters(outlier_probability=0.2, outlier_mean_m=1.5)
    samples, truth = dive(p, 6, 16, late=0.2)
    track = smoother.smooth(p, samples, truth)
    rows = model.rows(p, samples, track.mean)
    ranges = np.flatnonzero(rows.is_range)
    assert len(ranges) == len(samples.range)
    limited = 0
    for i, row in enumerate(ranges):
        off, R, P = rows.residual[row], rows.variance[row], track.covariance[rows.node[row]]
        sigma, m = np.sqrt(R), p.outlier_mean
        punctual = 0.8 * norm.pdf(off, scale=sigma)
        other = 0.2 * exponnorm.pdf(off, m / sigma, scale=sigma) + 1e-4 / 50
        share = max(punctual / (punctual + other), 1e-12)
        assert track.punctual[i] == pytest.approx(share, rel=1e-5)
        left = R / share - rows.H[row] @ P @ rows.H[row]
        limited += left < 0.05 * R / share
        assert track.residual[i] == pytest.approx(
            off / np.sqrt(max(left, 0.05 * R / share)), rel=1e-5
        )
    assert limited == 0
    exact = copy.copy(p)  # the track follows such ranges wherever they lead
    exact.range_std, exact.acceleration_psd = 0.002, 5.0
    exact.outlier_probability, exact.outlier_mean = 0.3, 0.005
    near = smoother.smooth(exact, samples, truth)
    rows = model.rows(exact, samples, near.mean)
    found = rows.residual[rows.is_range] / near.residual
    R = rows.variance[rows.is_range]
    own = [
        rows.H[row] @ near.covariance[rows.node[row]] @ rows.H[row]
        for row in np.flatnonzero(rows.is_range)
    ]
    R = R / near.punctual
    followed = near.punctual > 0.5  # the others are wrong, so nothing follows them
    assert ((R - own) / R)[followed].max() < 0.05
    assert near.punctual[followed].max() < 0.98
    np.testing.assert_allclose(found[followed] ** 2, 0.05 * R[followed], rtol=1e-4)
    assert followed.sum() > 8


# --- Learned q -----------------------------------------------------------------------------------


def test_q_is_learned_in_twelve_passes_after_the_heated_ones(seam: Seam) -> None:
    seam.tuned(close=0.0)
    p = parameters(acceleration_psd_m2_s3=0.02)
    samples, truth = dive(p, 2, 14)

    def psd(passes: int) -> np.ndarray:
        return smoother.smooth(p, samples, truth, passes, learns=True).psd

    rows = model.rows(p, samples, truth)
    share = late.share(p, rows.residual[rows.is_range], rows.variance[rows.is_range])
    first = smoother.linearised(model.problem(p, samples, truth[0]), rows, truth, share)
    stretches = restless.Stretches.of(p, samples, model.ON_PLATFORM)
    once = stretches.relearned(np.full(14, 0.02), linear.smooth(first))
    np.testing.assert_allclose(psd(1), once, rtol=1e-9)
    assert (psd(7) != 0.02).all()
    assert not np.array_equal(psd(17), psd(18))
    np.testing.assert_array_equal(psd(19), psd(18))
    still = smoother.smooth(p, samples, truth, 8)
    np.testing.assert_array_equal(still.psd, np.full(14, 0.02))


def test_stretches_are_of_ten_seconds_and_know_the_noise_of_their_steps() -> None:
    """White acceleration of density 1: dt³/3, dt²/2 and dt, without what else moves."""
    p = parameters(acceleration_psd_m2_s3=0.07)
    seconds = np.array([3.0, 5.0, 12.999, 13.0, 22.5, 23.0])
    ns = np.round(seconds * 1e9).astype(np.int64)
    nothing = np.zeros(0)
    samples = Samples(
        10**9, ns, np.zeros(6), ns[:0], np.zeros(0, np.intp), nothing, np.zeros(0, bool),
        np.zeros((0, 3)), np.zeros((0, 3)),
    )
    stretches = restless.Stretches.of(p, samples, model.ON_PLATFORM)
    assert stretches.states == [0, 1, 3, 4]
    assert stretches.expected == 0.07
    assert stretches.stretch.tolist() == [0, 0, 0, 1, 1, 2]
    for dt, unit in zip(np.diff(seconds, prepend=1.0), stretches.unit, strict=True):
        axis = np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        np.testing.assert_allclose(unit, np.kron(axis, np.eye(2)), rtol=1e-9, atol=1e-15)


def test_q_is_the_energy_of_the_noise_per_direction_that_was_measured() -> None:
    """With four directions more of the expected q; from 10⁻⁴ to 10 m²/s³."""
    rng = np.random.default_rng(5)
    n, states, expected = 9, [0, 2, 5, 3], 0.3
    root = rng.normal(size=(n, 4, 4))
    unit = root @ root.transpose(0, 2, 1)
    lean, root = rng.normal(size=(n, 7)), 0.3 * rng.normal(size=(n, 7, 7))
    weight = root @ root.transpose(0, 2, 1)
    weight[4:6] *= -1  # rounding may leave less than nothing: it counts as nothing
    lean[6] *= 1e3
    stretch, psd = np.array([0, 0, 0, 0, 1, 1, 2, 3, 3]), rng.uniform(0.2, 0.9, n)
    moments = linear.Moments(np.zeros((n, 7)), np.zeros((n, 7, 7)), lean, weight)
    found = restless.Stretches(states, expected, unit, stretch).relearned(psd, moments)
    for which in range(4):
        energy = measured = 0.0
        for k in np.flatnonzero(stretch == which):
            noise = -psd[k] * unit[k] @ lean[k][states]
            energy += noise @ np.linalg.solve(unit[k], noise)
            measured += psd[k] * np.trace(unit[k] @ weight[k][np.ix_(states, states)])
        q = (energy + 4 * expected) / (max(measured, 0) + 4)
        assert bool(measured < 0) is (which == 1)
        assert bool(q > 10) is (which == 2)
        np.testing.assert_allclose(found[stretch == which], min(q, 10.0), rtol=1e-9)
    calm = linear.Moments(moments.mean, moments.covariance, 0 * lean, weight)
    slow = restless.Stretches(states, 1e-5, unit, stretch).relearned(psd, calm)
    np.testing.assert_array_equal(slow, np.full(n, 1e-4))


# --- Late arrivals -------------------------------------------------------------------------------


def test_without_late_ranges_only_a_wrong_estimate_is_none_that_is_punctual() -> None:
    p = parameters(outlier_probability=0.0)
    residual, variance = np.array([-0.4, 0.0, 0.3, 0.9]), np.array([0.01, 0.04, 0.09, 0.01])
    with np.errstate(all="raise"):
        punctual, other = late.log_densities(p, residual, variance)
    assert other.shape == (4,)
    np.testing.assert_allclose(punctual, norm.logpdf(residual, scale=np.sqrt(variance)))
    np.testing.assert_allclose(other, np.full(4, np.log(2e-6)))
    least = late.share(p, np.array([3.0, 80.0]), 0.01)
    np.testing.assert_allclose(least, [1e-12, 1e-12])
    assert late.share(p, 0.1, 0.01) == pytest.approx(
        1 / (1 + 2e-6 / norm.pdf(0.1, scale=0.1)), rel=1e-12
    )


# --- What speaks against a track -----------------------------------------------------------------


def judged(
    punctual: Any, residual: Any, seconds: Any, *, chance: float = 0.05, steps: int = 4,
    last: float = 0.0,
) -> tuple[str, ...]:
    """Of a track with these ranges, received so long after a start at 7 s."""
    p = parameters(outlier_probability=chance)
    seconds = np.asarray(seconds, float)
    ns, n = np.round((7.0 + seconds) * 1e9).astype(np.int64), len(seconds)
    samples = Samples(
        7 * 10**9, ns[:1], np.zeros(1), ns, np.arange(n) % 3, np.ones(n), np.ones(n, bool),
        np.zeros((n, 3)), np.zeros((n, 3)),
    )
    track = smoother.Track(
        ns, np.zeros((n, STATES)), np.zeros((n, STATES, STATES)),
        np.broadcast_to(np.asarray(punctual, float), n),
        np.broadcast_to(np.asarray(residual, float), n), np.ones(n), (*[1.0] * (steps - 1), last),
    )
    return belief.doubts(p, samples, track, Estimates(epoch_ns=ns, position=np.zeros((n, 3))))


def test_shares_of_late_ranges_and_squares_of_residuals_have_limits() -> None:
    every = np.linspace(0, 59, RANGES)
    assert judged(1.0, 1.0, every) == ()
    assert judged(1.0, 1.0, every, last=smoother.CLOSE) == ("it has not converged in 4 passes",)
    assert judged(0.72, 0.0, every) == ()  # 0.05 + 0.25 may be late
    assert judged(0.68, 0.0, every) == ("32 % of the ranges do not fit",)
    assert judged(0.68, 0.0, every, chance=0.1) == ()
    assert judged(1.0, np.sqrt(1.98), every) == ()
    assert judged(1.0, np.sqrt(2.02), every) == (
        "the residuals of the ranges are 1.4 times what is expected",
    )
    assert judged(1.0, np.resize([-3.0, 2.0], RANGES), every) == (
        "the residuals of the ranges are 2.5 times what is expected",
    )


def test_a_stretch_of_a_minute_with_eight_ranges_can_speak_against_a_track() -> None:
    """More than half of them late, or a mean square above 4; only the first is named."""
    good = np.concatenate([np.linspace(0, 119, 60), np.linspace(240, 299, 60)])
    for number, speaks in ((8, True), (7, False)):
        seconds = np.concatenate([good, np.linspace(120, 179.9, number)])
        bad = np.arange(len(seconds)) >= len(good)
        said = ("the ranges from 120 s to 180 s do not fit",) if speaks else ()
        assert judged(np.where(bad, 0.48, 1.0), 0.0, seconds) == said
        assert judged(1.0, np.where(bad, 2.02, 0.5), seconds) == said
        assert judged(np.where(bad, 0.52, 1.0), np.where(bad, 1.98, 0.5), seconds) == ()
    seconds = np.concatenate([good, np.linspace(60, 119, 8), np.linspace(180, 239, 90)])
    late_ones = (seconds >= 180) & (seconds < 190)
    assert judged(np.where(late_ones, 0.0, 1.0), 0.0, seconds) == ()  # 15 of 90
    assert judged(1.0, np.where(seconds >= 240, 2.05, 0.2), seconds) == (
        "the ranges from 240 s to 300 s do not fit",
    )
    edge = np.concatenate([np.full(40, 30.0), np.full(10, 60.0)])
    assert judged(1.0, np.where(edge == 60, 2.5, 0.1), edge) == (
        "the ranges from 60 s to 120 s do not fit",
    )


@pytest.mark.parametrize(("unknown", "speaks"), [(5, False), (6, True)])
def test_the_bearing_must_be_known_in_half_of_the_estimates(unknown: int, speaks: bool) -> None:
    p = parameters()
    samples, truth = dive(p, 5, 10)
    track = smoother.Track(
        samples.epochs_ns, truth, np.zeros((10, STATES, STATES)),
        np.ones(len(samples.range)), np.ones(len(samples.range)), np.ones(10), (0.5, 0.0),
    )
    P = np.zeros((10, 6, 6))
    P[:, 2, 2] = np.where(np.arange(10) < unknown, 2.1, 1.9) * 20.0**2  # across
    filtered = Estimates(
        epoch_ns=samples.epochs_ns, position=truth[:, :3], covariance=P,
        relative_position=np.tile([20.0, 0.0, 6.0], (10, 1)),
    )
    sentence = "the diver's bearing from the platform is unknown in most of the run"
    assert belief.doubts(p, samples, track, filtered) == ((sentence,) if speaks else ())
    stuck = replace(track, steps_m=(2.0, 1.0, 0.5))
    assert belief.doubts(p, samples, stuck, filtered) == (
        "it has not converged in 3 passes", *((sentence,) if speaks else ()),
    )


# --- The models ----------------------------------------------------------------------------------


def test_headings_are_compared_the_short_way_round() -> None:
    p = parameters()
    samples, truth = dive(p, 2, 12)
    turns = np.resize([0, 1, -1, 2], len(samples.range))
    attitude = samples.attitude + np.outer(2 * np.pi * turns, [0, 0, 1])
    plain, wound = (
        model.rows(p, it, truth) for it in (samples, replace(samples, attitude=attitude))
    )
    np.testing.assert_allclose(wound.residual, plain.residual, atol=1e-9)
    far = replace(samples, attitude=samples.attitude + np.array([0, 0, 3.0]))
    moved = model.rows(p, far, truth).residual - plain.residual
    headings = np.abs(moved) > 1
    assert headings.sum() == len(samples.range)
    np.testing.assert_allclose(moved[headings] % (2 * np.pi), 3.0)
    assert np.abs(model.rows(p, far, truth).residual[headings]).max() <= np.pi


def test_a_first_estimate_is_that_of_three_beacons_and_a_depth_or_of_a_prior() -> None:
    p = parameters(initialisation="first_receptions")
    second = np.array([2, 3, 4, 6, 8, 9]) * 10**9
    samples = Samples(
        10**9, np.array([5, 7]) * 10**9, np.array([6.0, 6.1]), second,
        np.array([1, 1, 0, 0, 3, 2]), np.ones(6), np.ones(6, bool), np.zeros((6, 3)),
        np.zeros((6, 3)),
    )
    assert model.first_ns(p, samples) == 8 * 10**9
    late_depth = replace(samples, depth_ns=np.array([9, 10]) * 10**9)
    assert model.first_ns(p, late_depth) == 9 * 10**9
    two = replace(samples, beacon=np.array([1, 1, 0, 0, 1, 1]))
    assert model.first_ns(p, two) == 2 * 10**9
    assert model.first_ns(parameters(), samples) == 2 * 10**9


def test_noise_of_a_step_grows_with_q_and_steps_that_are_alike_are_kept_once() -> None:
    p = parameters(acceleration_psd_m2_s3=0.5)
    epochs = np.array([3, 5, 7, 10, 12]) * 10**9
    phi, noise, which = model.transitions(p, 10**9, epochs)
    assert which.tolist() == [0, 0, 0, 1, 0]
    assert len(phi) == len(noise) == 2
    for dt, F, Q in zip((2.0, 3.0), phi, noise, strict=True):
        expected, cov = model.transition(p, dt)
        np.testing.assert_allclose(F, expected, rtol=1e-12)
        np.testing.assert_allclose(Q, cov, rtol=1e-9, atol=1e-15)
        assert (Q[0, 0], Q[0, 3], Q[3, 0], Q[3, 3]) == pytest.approx(
            (dt**3 / 6, dt**2 / 4, dt**2 / 4, dt / 2), rel=1e-9
        )
        assert F[0, 3] == F[1, 4] == F[2, 5] == dt
    psd = np.array([0.1, 0.1, 0.4, 0.4, 0.4])
    _, noise, which = model.transitions(p, 10**9, epochs, psd)
    assert [float(noise[i][4, 4]) for i in which] == pytest.approx([0.2, 0.2, 0.8, 1.2, 0.8])
    assert len(noise) == 3


def test_estimates_of_a_scenario_begin_with_its_own_numbers() -> None:
    p = parameters(range_std_m=0.25, imu_heading_error_std_deg=4.0)
    assert p.range_std == 0.25
    assert p.imu_heading_error_std == pytest.approx(np.radians(4.0))
    assert p.beacons == 4
    assert p.beacon_offset.shape == (4, 3)
    origin = outcome.origin_of(p, "smoother", steps_m=(1.0, 0.5))
    assert origin["type"] == "smoother"
    assert origin["steps_m"] == (1.0, 0.5)
    assert origin["parameters"]["range_std"] == 0.25


# --- Beacons with errors of their own ------------------------------------------------------------


def in_field(**keys: Any) -> Any:
    receiver = "long_baseline"
    scenario = assumed(
        load("gps-buoys"), {f"receiver.{key}": value for key, value in keys.items()}, receiver
    )
    return model.parameters(scenario, np.array([4.0, 5.0, 6.0]), field.IN_FIELD.component)


def test_a_scale_widens_the_speed_of_sound_and_every_beacon_has_an_offset() -> None:
    known = in_field(sound_speed_std=0.003)
    p = field.with_unknowns(known, 0.7, 0.004)
    assert p.sound_speed_std == pytest.approx(0.005, rel=1e-12)
    assert p.range_offset_std == 0.7
    assert known.sound_speed_std == 0.003
    assert p.range_std == known.range_std
    n = field.states(p)
    assert n == field.IN_FIELD.states(p)
    assert field.offsets(p) == [n - 4, n - 3, n - 2, n - 1]


@pytest.mark.parametrize("known", [True, False], ids=["prior", "first receptions"])
def test_a_diver_among_buoys_starts_where_it_is_told_or_anywhere(known: bool) -> None:
    p = field.with_unknowns(in_field(), 0.7, 0.0)
    n = field.states(p)
    vars(p).update(
        initialisation=model.PRIOR if known else 1 - model.PRIOR,
        prior_position=np.array([1.0, 2.0, 3.0]), prior_velocity=np.array([0.4, -0.5, 0.6]),
        prior_position_std=0.8, prior_velocity_std=0.9, clock_std=1.1, sound_speed_std=0.12,
    )
    begin = 100.0 + np.arange(float(n))
    mean, std = field.IN_FIELD.prior(p, begin)
    at = [1.0, 0.4, 2.0, -0.5, 3.0, 0.6] if known else [100.0, 0.0, 102.0, 0.0, 104.0, 0.0]
    np.testing.assert_array_equal(mean, [*at, *[0.0] * (n - 6)])
    np.testing.assert_array_equal(std[:6], [0.8 if known else 30.0, 0.9] * 3)
    assert (std[field.CLOCK], std[field.SPEED]) == (1.1, 0.12)
    np.testing.assert_array_equal(std[-4:], [0.7] * 4)


def test_estimates_of_a_diver_among_buoys_are_its_states() -> None:
    p = field.with_unknowns(in_field(), 0.7, 0.0)
    p.initialisation, n = 1 - model.PRIOR, field.states(p)
    ns = np.array([2, 3, 4, 5]) * 10**9
    samples = Samples(
        10**9, ns[:1], np.array([6.0]), ns, np.array([1, 0, 2, 1]), np.ones(4),
        np.zeros(4, bool), np.zeros((4, 3)), np.zeros((4, 3)),
    )
    rng = np.random.default_rng(3)
    mean, P = rng.normal(size=(4, n)), rng.normal(size=(4, n, n))
    mean[:, field.SPEED] *= 0.01
    found = field.of_states(p, samples, mean, P)
    assert found.epoch_ns.tolist() == [4 * 10**9, 5 * 10**9]  # from the third beacon on
    np.testing.assert_array_equal(found.position, mean[2:, [0, 2, 4]])
    np.testing.assert_array_equal(found.velocity, mean[2:, [1, 3, 5]])
    np.testing.assert_array_equal(found.covariance, P[2:, :6, :6])
    c = p.assumed_sound_speed
    np.testing.assert_allclose(found.clock_offset, mean[2:, field.CLOCK] / c)
    np.testing.assert_allclose(found.sound_speed, c / (1 + mean[2:, field.SPEED]))


def test_rows_of_a_diver_among_buoys_are_derivatives_at_its_own_epochs() -> None:
    """Of depths and ranges; the offset of a beacon counts in its own ranges alone."""
    p = field.with_unknowns(in_field(), 0.7, 0.0)
    n, rng = field.states(p), np.random.default_rng(8)
    ns = np.array([3, 4, 6, 7, 9]) * 10**9
    beacon = np.array([1, 0, 3, 2, 1])
    samples = Samples(
        10**9, np.array([2, 6, 9]) * 10**9, np.array([5.0, 6.0, 8.0]), ns, beacon,
        rng.uniform(20, 40, 5), np.zeros(5, bool), rng.uniform(-30, 30, (5, 3)), np.zeros((5, 3)),
    )
    at = rng.normal(size=(6, n)) * np.where(np.arange(n) == field.SPEED, 0.01, 1.0)
    rows = model.rows(p, samples, at, field.IN_FIELD)
    assert rows.node.tolist() == [0, 1, 2, 3, 3, 4, 5, 5]
    assert rows.is_range.tolist() == [False, True, True, False, True, True, False, True]
    for state in range(n):
        step = 1e-5 * (np.arange(n) == state)
        ahead, behind = (
            model.rows(p, samples, at + sign * step, field.IN_FIELD).residual for sign in (1, -1)
        )
        np.testing.assert_allclose((behind - ahead) / 2e-5, rows.H[:, state], atol=1e-6)
    own = rows.H[rows.is_range][:, field.offsets(p)]
    np.testing.assert_array_equal(own, np.eye(4)[beacon])
    still = at.copy()
    still[:, 6:] = 0.0
    plain = model.rows(p, samples, still, field.IN_FIELD)
    away = np.linalg.norm(still[[1, 2, 3, 4, 5]][:, [0, 2, 4]] - samples.position, axis=1)
    np.testing.assert_allclose(plain.residual[plain.is_range], samples.range - away)
    np.testing.assert_allclose(plain.residual[~plain.is_range], samples.depth - still[[0, 3, 5], 4])
