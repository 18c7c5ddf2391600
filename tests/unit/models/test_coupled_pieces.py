"""Pieces of `coupled`: the pose of points, the arc, its moments, late ranges, motion, rows of H."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from coupled_reference import gradient, retracted, rotation
from harness import Array
from quick import one_in
from sblcosim.models import RECEIVERS
from sblcosim.models.receiver import arc, lateness, least_squares, pose, start, surroundings
from sblcosim.models.receiver.surroundings import STATES
from scipy.linalg import expm
from scipy.stats import exponnorm, norm

DEFAULTS = {v.name: v.starts if v.shape else float(v.starts[0])
            for v in RECEIVERS["coupled"].of("parameter")}


def number(value: Any) -> Array:
    """What an expression without symbols is."""
    array = np.array(ca.evalf(ca.SX(value)))
    return array[:, 0] if array.shape[1] == 1 else array


def symbols(value: Any) -> Any:
    """A column or matrix for CasADi."""
    return ca.SX(ca.DM(np.asarray(value)))


def parameters(**given: Any) -> Any:
    """Parameters as attributes."""
    return SimpleNamespace(**{**DEFAULTS, **given})


def state(rng: np.random.Generator) -> tuple[Array, Array]:
    """Some state and covariance."""
    mean = rng.normal(size=STATES)
    mean[:3] = rng.normal((15, 0, 5), 10)
    root = rng.normal(scale=0.1, size=(STATES, STATES))
    return mean, root @ root.T


# --- The pose of points --------------------------------------------------------------------------


def fitted(points: Array, body: Array) -> tuple[Array, Array]:
    position, R = pose.fit(symbols(points), symbols(body))
    return number(position), number(R)


def angle(R: Array) -> float:
    """Angle of a rotation, in degrees."""
    return float(np.degrees(np.linalg.norm(R - np.eye(3)) / np.sqrt(2)))


@pytest.mark.parametrize(("spread", "most"), [(0.0, 1e-9), (0.3, 1e-4), (1.5, 0.003)])
def test_exact_points_give_the_exact_pose(spread: float, most: float) -> None:
    rng = np.random.default_rng(7)
    for n in range(100):
        count = 3 + n % 2
        turn = 2 * np.pi * (np.arange(count) + rng.uniform(-0.1, 0.1, count)) / count
        body = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(count)])
        body *= rng.uniform(2.5, 3.5, (count, 1))
        body[:, 2] = 0.5 + rng.uniform(-spread, spread, count)
        body += [*rng.normal(size=2), 0]
        roll, pitch = np.radians(7) * rng.standard_normal(2).clip(-2, 2)
        R = rotation(roll, pitch, rng.uniform(-np.pi, np.pi))
        place = rng.normal(scale=100, size=3)
        position, found = fitted(place + body @ R.T, body)
        assert angle(found @ R.T) < most
        np.testing.assert_allclose(position, place, atol=1e-9 + np.radians(most) * 3)
        np.testing.assert_allclose(found @ found.T, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("body", [
    np.zeros((4, 3)), np.outer([1, 2, 3, 4], [1, 0, 0]), np.tile([3.0, 1.0, 0.5], (4, 1)),
    np.outer([1, 2, 3, 4], [1, 1, 0.2]),
])
def test_a_degenerate_arrangement_gives_numbers(body: Array) -> None:
    for points in (body, body + 7, np.zeros((4, 3)), np.eye(4, 3)):
        position, R = fitted(points, body)
        assert np.isfinite(position).all()
        assert np.isfinite(R).all()
        assert abs(R).max() <= 1 + 1e-9


# --- The arc -------------------------------------------------------------------------------------


def taken(mean: Array, P: Array, d: Array) -> tuple[Array, Array]:
    after, covariance, _ = arc.retract(symbols(mean), symbols(P), symbols(d))
    return number(after), number(covariance)


@pytest.mark.parametrize("seed", range(20))
def test_the_retraction_and_its_jacobian(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mean, P = state(rng)
    d = rng.normal(scale=0.5, size=STATES)
    after, covariance = taken(mean, P, d)
    A = gradient(lambda d: retracted(mean, d), d)
    np.testing.assert_allclose(after, retracted(mean, d), atol=1e-12)
    np.testing.assert_allclose(covariance, A @ P @ A.T, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(covariance, covariance.T)


@pytest.mark.parametrize("turn", [-0.9, -0.1, 0.5, 0.99])
def test_a_turn_about_the_platform_leaves_the_distance(turn: float) -> None:
    mean, P = state(np.random.default_rng(1))
    y = mean[:2] - mean[6:8]
    d = np.zeros(STATES)
    d[:2] = turn * np.array([-y[1], y[0]])
    d[3:5] = turn * np.array([-mean[4], mean[3]])
    after, _ = taken(mean, P, d)
    R = rotation(0, 0, turn)[:2, :2]
    np.testing.assert_allclose(after[:2] - after[6:8], R @ y, atol=1e-12)
    np.testing.assert_allclose(after[3:5], R @ mean[3:5], atol=1e-12)
    np.testing.assert_array_equal(after[[2, *range(5, STATES)]], mean[[2, *range(5, STATES)]])


@pytest.mark.parametrize(("at", "step"), [
    ((0.9, 0.0), (0.1, 0.1)), ((0.0, 0.0), (1.0, 1.0)), ((10.0, 0.0), (0.0, 10.1)),
    ((10.0, 0.0), (-5.1, 0.0)),
])
def test_where_there_is_no_arc_corrections_are_added(at: Any, step: Any) -> None:
    mean, P = state(np.random.default_rng(2))
    mean[:2] = mean[6:8] + at
    d = np.zeros(STATES)
    d[:2] = step
    after, covariance = taken(mean, P, d)
    np.testing.assert_array_equal(after, mean + d)
    np.testing.assert_allclose(covariance, P, rtol=1e-12)


@pytest.mark.parametrize("spread", [0.01, 0.3, 1.5])
def test_moments_of_the_banana(spread: float) -> None:
    rng = np.random.default_rng(3)
    y = np.array([8.0, -6.0])
    e_t = np.array([0.6, 0.8])
    mean, P = np.zeros(STATES), np.zeros((STATES, STATES))
    mean[:2] = y
    P[:2, :2] = spread * 100 * np.outer(e_t, e_t)
    shift, more = (number(v) for v in arc.moments(arc.about(symbols(mean), symbols(P)),
                                                   symbols(P)))
    c, s = (f(np.sqrt(spread) * rng.standard_normal(400_000)) for f in (np.cos, np.sin))
    samples = np.column_stack([c * y[0] - s * y[1], s * y[0] + c * y[1]])
    np.testing.assert_allclose(y + shift, samples.mean(0), atol=0.05)
    np.testing.assert_allclose(P[:2, :2] + more, np.cov(samples.T), atol=0.3)


def test_a_round_spread_is_no_banana() -> None:
    mean, P = np.zeros(STATES), np.eye(STATES)
    mean[:2] = 10, 0
    shift, more = (number(v) for v in arc.moments(arc.about(symbols(mean), symbols(P)),
                                                   symbols(P)))
    np.testing.assert_allclose(shift, 0, atol=1e-12)
    np.testing.assert_allclose(more, 0, atol=1e-12)


@pytest.mark.parametrize(
    ("of_bearing", "of_heading"), [(0.03, 0.0), (0.0, 0.3), (0.02, 0.1), (0.0, 2.0)]
)
def test_a_bent_range_has_the_moments_of_the_range(of_bearing: float, of_heading: float) -> None:
    """Over bearing and heading, with a short arm; beyond the second order little is left."""
    rng = np.random.default_rng(4)
    p = parameters(range_std=1e-3)
    mean, P = np.zeros(STATES), np.zeros((STATES, STATES))
    mean[:3] = 12, 9, 4
    e_t = np.array([-0.6, 0.8])
    P[:2, :2] = of_bearing * 225 * np.outer(e_t, e_t)
    P[12, 12] = of_heading
    flat = surroundings.Pose(0.0, 0.0, 0.0, 0.0)
    body = [0.3, -0.25, 0.5]
    row = surroundings.range_(ca, p, [ca.SX(v) for v in mean], flat, [ca.SX(v) for v in body])
    bent = arc.bent(arc.about(symbols(mean), symbols(P)), row)
    H = np.zeros(STATES)
    for i, value in bent.row.items():
        H[i] = number(value)[0]
    x = np.tile(mean, (200_000, 1))
    bearing, heading = (np.sqrt(v) * rng.standard_normal(len(x))
                        for v in (of_bearing, of_heading))
    x[:, 0], x[:, 1] = (15 * f(np.arctan2(9, 12) + bearing) for f in (np.cos, np.sin))
    x[:, 12] = heading
    ranges = surroundings.range_(np, p, x.T, flat, body).value
    S = H @ P @ H + float(number(bent.variance)[0])
    assert number(bent.value)[0] == pytest.approx(ranges.mean(), abs=3e-3)
    assert np.sqrt(S) == pytest.approx(ranges.std(), rel=0.05)


# --- Start ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(("near", "worse", "last", "moves"), [
    (3.0, 8.9, 1, True), (3.0, 9.1, 1, False), (3.0, 0.0, 0, False), (14.0, 0.0, 1, False),
])
def test_a_fix_moves_out_to_the_median_of_its_priors(
    near: float, worse: float, last: int, moves: bool
) -> None:
    """A prior of 20 m, along the bearing, unless the ranges say that it is nearer."""
    known = least_squares.Common(1 / 20**2, ca.SX([7.0, -2.0, 0.0]), 0.0)
    fix = least_squares.Normal(
        ca.SX([7.0 + 0.6 * near, -2.0 + 0.8 * near, 5.0]), ca.SX.eye(3), ca.SX.zeros(3), ca.SX(1.0),
        ca.SX(0), ca.SX(0), ca.SX.zeros(3),
    )

    def linearised(place: Any) -> least_squares.Normal:
        return least_squares.Normal(
            place, 2 * ca.SX.eye(3), ca.SX.ones(3), ca.SX(1.0 + worse), ca.SX(3.0), ca.SX(4.0),
            ca.SX.ones(3),
        )

    found = start.outward(fix, known, ca.SX(last), linearised)
    length = norm.ppf(0.75) * 20 if moves else near
    np.testing.assert_allclose(
        number(found.position), [7.0 + 0.6 * length, -2.0 + 0.8 * length, 5.0], rtol=2e-5
    )
    assert number(found.alone)[0] == (4.0 if moves else 0.0)


# --- Late ranges ---------------------------------------------------------------------------------


@one_in(2)
@pytest.mark.parametrize("chance", [0.0, 0.01, 0.3, 0.9])
@pytest.mark.parametrize("mean", [0.01, 1.0, 30.0])
@pytest.mark.parametrize("S", [1e-6, 1e-2, 1.0, 900.0])
def test_the_probability_of_a_punctual_range(chance: float, mean: float, S: float) -> None:
    p, root = parameters(outlier_probability=chance, outlier_mean=mean), np.sqrt(S)
    nu = np.concatenate([np.linspace(-6, 6, 49) * root, np.linspace(-50, 50, 41), [1e4, -1e4]])
    inside = (1 - chance) * norm.pdf(nu, scale=root)
    # SciPy has no digits where the exponent is large; there the density is that of no noise.
    with np.errstate(all="ignore"):
        late = exponnorm.pdf(nu, mean / root, scale=root)
    assert np.isfinite(late).all()
    expected = inside / (inside + chance * late + 1e-4 / 50)
    pairs = [lateness.densities(p, ca.SX(v), ca.SX(S)) for v in nu]
    got = [number(punctual / (punctual + other))[0] for punctual, other in pairs]
    np.testing.assert_allclose(got, expected, rtol=1e-6, atol=1e-9)


# --- Motion --------------------------------------------------------------------------------------


@pytest.mark.parametrize("dt", [0.0, 0.1, 1.0, 7.0])
def test_the_motion_solves_its_differential_equation(dt: float) -> None:
    p = parameters(acceleration_psd=0.3, heading_rate_time=2.0, platform_velocity_time=11.0,
                   gps_correlation_time=5.0, imu_heading_error_time=20.0,
                   gps_vertical_error_std=0.7, gps_vertical_error_time=9.0)
    F, L = np.zeros((STATES, STATES)), np.zeros((STATES, STATES))
    for i in range(3):
        F[i, i + 3], L[i + 3, i + 3] = 1, p.acceleration_psd
    for i, j, std, tau in (
        (6, 8, p.platform_velocity_std, 11), (7, 9, p.platform_velocity_std, 11),
        (12, 13, p.heading_rate_std, 2), (None, 10, p.gps_markov_std, 5),
        (None, 11, p.gps_markov_std, 5), (None, 14, p.imu_heading_error_std, 20),
        (None, 18, p.gps_vertical_error_std, 9),
    ):
        if i is not None:
            F[i, j] = 1
        F[j, j], L[j, j] = -1 / tau, 2 * std**2 / tau
    L[15, 15] = p.clock_walk_psd
    both = expm(np.block([[-F, L], [np.zeros_like(F), F.T]]) * dt)  # C. Van Loan, 1978
    expected = both[STATES:, STATES:].T
    for m in (np, ca):
        phi, Q = (number_of_rows(rows, base) for rows, base in zip(
            surroundings.transition(m, p, dt), (np.eye(STATES), np.zeros((STATES, STATES))),
            strict=True))
        np.testing.assert_allclose(phi, expected, atol=1e-12)
        np.testing.assert_allclose(Q + np.triu(Q, 1).T, expected @ both[:STATES, STATES:],
                                   rtol=1e-7, atol=1e-11)


def number_of_rows(rows: Any, base: Array) -> Array:
    matrix = base.copy()
    for place, value in rows.items():
        matrix[place] = float(value)
    return matrix


def test_what_stays_as_it_is_does_not_lose_a_digit() -> None:
    phi, Q = surroundings.transition(np, parameters(platform_velocity_time=1e6), 0.1)
    assert phi[6, 8] == pytest.approx(0.1, rel=1e-6)
    assert phi[14, 14] == pytest.approx(1, abs=1e-6)
    assert all(Q[i, i] >= 0 for i in range(STATES) if (i, i) in Q)


# --- Rows of H -----------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(10))
def test_rows_are_derivatives(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mean, _ = state(rng)
    p = parameters()
    packet = surroundings.Pose(0.3, *rng.normal(scale=0.1, size=2), 0.01)
    body = rng.normal(scale=2, size=3)
    for rows in (
        lambda x: (surroundings.depth(p, x),),
        lambda x: (surroundings.heading(np, p, x),),
        lambda x: surroundings.places(np, p, x, body),
        lambda x: surroundings.places(np, p, x, (0.0, 0.0, 0.0)),
        lambda x: surroundings.places(np, p, x, body, 0.4),
        lambda x: (surroundings.range_(np, p, x, packet, body),),
    ):
        for n, row in enumerate(rows(mean)):
            slope = np.zeros(STATES)
            for i, value in row.row.items():
                slope[i] = value
            for i in range(STATES):
                h = 1e-6 * np.eye(STATES)[i]
                numeric = (rows(mean + h)[n].value - rows(mean - h)[n].value) / 2e-6
                assert slope[i] == pytest.approx(numeric, abs=1e-7)


def test_a_reported_tilt_is_shrunk_by_its_noise() -> None:
    rng = np.random.default_rng(5)
    own, white = 0.05 * rng.standard_normal(100_000), 0.03 * rng.standard_normal(100_000)
    p = parameters(tilt_std=0.05, imu_tilt_std=0.03)
    best, variance = surroundings.tilt(p, own + white)
    assert np.var(best - own) == pytest.approx(variance, rel=0.02)
    assert surroundings.tilt(parameters(tilt_std=0.0, imu_tilt_std=0.0), 0.1) == (0, 0)


def test_soundings_are_never_better_than_they_are_rounded() -> None:
    for std, expected in ((0.1, 0.1), (1e-9, 1e-3), (1e-3, 1e-3)):
        assert surroundings.sounding_variance(std) == pytest.approx(expected**2, rel=1e-12)
