"""The raw fix: exactness, covariance, robustness of the iteration."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from coupled import CROSS, NS, at_rest, cross, dive, hear, simultaneous, straight
from sblcosim.models.receiver.fix import PASSES, Samples, improve
from scipy.optimize import least_squares
from scipy.stats import chi2

POSITIONS = [
    (12.0, -7.0, 5.0), (0.3, 0.1, 2.0), (-60.0, 80.0, 30.0), (3.0, 0.0, 0.6), (0.5, 0.5, 0.5),
]
ERRORS = np.array([0.11, -0.05, 0.08, 0.13])


@pytest.mark.parametrize("position", POSITIONS)
@pytest.mark.parametrize("arm", [0.4, 3.0, 30.0])
def test_it_is_exact_on_fresh_simultaneous_data(
    position: tuple[float, float, float], arm: float
) -> None:
    beacons = cross(arm) + np.array([100.0, -200.0, 0.0])
    truth = np.add(position, [100.0, -200.0, 0.0])
    y = simultaneous("multilateration", truth, beacons=beacons).y
    np.testing.assert_allclose(y["position"], truth, rtol=0, atol=1e-9)
    assert y["nis"] < 1e-12


@pytest.mark.parametrize("arm", [0.4, 3.0])
@pytest.mark.parametrize(("measurement_noise", "power"), [(1, 1.0), (2, 0.5)])
def test_it_is_the_weighted_least_squares_solution(
    arm: float, measurement_noise: int, power: float
) -> None:
    range_std, depth_std = 0.2**power, 0.05**power
    truth = np.array([12.0, -7.0, 5.0])
    beacons = cross(arm)
    y = simultaneous(
        "multilateration", truth,
        {"range_std": 0.2, "depth_std": 0.05, "measurement_noise": measurement_noise},
        beacons=beacons, errors=ERRORS,
    ).y

    def residuals(x: np.ndarray) -> np.ndarray:
        ranges = np.linalg.norm(truth - beacons, axis=1) + ERRORS
        return np.append(
            (ranges - np.linalg.norm(x - beacons, axis=1)) / range_std,
            (truth[2] - x[2]) / depth_std,
        )

    best = least_squares(residuals, truth, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    np.testing.assert_allclose(y["position"], best.x, rtol=0, atol=1e-5)
    assert y["nis"] == pytest.approx(2 * best.cost, rel=1e-9)
    assert y["nis_degrees"] == 2
    P = np.linalg.inv(best.jac.T @ best.jac)
    np.testing.assert_allclose(y["covariance"][::2, ::2], P, rtol=1e-4, atol=1e-9)
    np.testing.assert_allclose(y["position_std"], np.sqrt(np.diag(P)), rtol=1e-4)


@pytest.mark.parametrize("damping", [0.0, 0.5])
def test_the_damping_of_a_pass_is_a_multiple_of_the_informations_diagonal(damping: float) -> None:
    x, truth, weight = np.array([11.0, -6.5, 4.0]), [12.0, -7.0, 5.0], np.array([1, 4, 9, 2, 50.0])
    ranges = np.linalg.norm(truth - CROSS, axis=1)
    nothing, heard = ca.SX.zeros(5), ca.SX.ones(5)
    samples = Samples(
        z=ca.SX([*ranges, truth[2]]), epoch=nothing, beacons=ca.SX(CROSS), mark=nothing,
        heard=heard, new=heard, any_new=1, newest=0, enough=1,
    )
    found = improve(ca.SX(x), damping, samples, ca.SX(weight))
    offset = x - CROSS
    distances = np.linalg.norm(offset, axis=1)
    H = np.vstack([offset / distances[:, None], [0.0, 0.0, 1.0]])
    information = H.T @ np.diag(weight) @ H
    damped = information + damping * np.diag(np.diag(information))
    residuals = np.append(ranges - distances, truth[2] - x[2])
    step = np.linalg.solve(damped, H.T @ (weight * residuals))
    position = np.array(ca.evalf(found.position)).ravel()
    np.testing.assert_allclose(position, x + step, rtol=0, atol=1e-9)


def test_velocity_is_not_estimated() -> None:
    y = simultaneous("multilateration", np.array([12.0, -7.0, 5.0])).y
    np.testing.assert_array_equal(y["velocity"], 0.0)
    np.testing.assert_array_equal(y["covariance"][1::2], 0.0)
    np.testing.assert_array_equal(y["covariance"][:, 1::2], 0.0)


def test_three_ranges_and_the_depth_suffice_and_two_do_not() -> None:
    result = dive("multilateration", at_rest(12.0, -7.0, 5.0), steps=8,
                  acoustics={"range_std": 0.0})
    np.testing.assert_allclose(result.epoch, [0.3, 0.4, 0.5, 0.6], rtol=0, atol=1e-12)
    assert result.nis_degrees.tolist() == [1, 2, 2, 2]
    assert result.distance.max() < 1e-9


def test_a_far_jump_is_followed_at_once() -> None:
    box = simultaneous("multilateration", np.array([12.0, -7.0, 5.0]))
    hear(box, np.array([-30.0, 25.0, 2.0]), 0.2)
    y = box.step(box.t_ns, NS // 10)
    np.testing.assert_allclose(y["position"], [-30.0, 25.0, 2.0], rtol=0, atol=1e-9)
    assert y["epoch"] == 0.2
    assert y["update_count"] == 2


def test_it_starts_from_the_last_fix_or_the_closed_form_whichever_fits_better() -> None:
    """Where it starts shows in the passes it needs: one if it is there already."""
    here, there = np.array([12.0, -7.0, 5.0]), np.array([-30.0, 25.0, 2.0])
    box = simultaneous("multilateration", here, beacons=cross(0.4), errors=ERRORS)
    passes = [box.counts["improve"]]
    for n, (position, errors) in enumerate([(here, ERRORS), (there, 0.0), (there, ERRORS)]):
        before = box.y["position"]
        hear(box, position, 0.2 + 0.1 * n, beacons=cross(0.4), errors=errors)
        box.step(box.t_ns, NS // 10)
        passes.append(box.counts["improve"] - sum(passes))
        if n == 0:
            np.testing.assert_allclose(box.y["position"], before, rtol=0, atol=1e-6)
    assert passes[0] > 2
    assert passes[1] == 1
    assert passes[2] <= 2  # without errors the closed form is exact
    assert passes[3] > 2


def test_the_error_on_a_moving_diver_is_that_of_stale_ranges() -> None:
    result = dive("multilateration", straight((15.0, 2.0, 5.0), (-0.3, 0.4, 0.05)),
                  acoustics={"range_std": 0.0})
    assert 0.01 < result.distance[5:].max() < 0.5


def test_nis_is_chi_square_with_measurements_minus_three_degrees() -> None:
    position = np.array([12.0, -7.0, 5.0])
    rng = np.random.default_rng(2)
    nis = np.array([
        simultaneous("multilateration", position, errors=0.1 * rng.standard_normal(4)).y["nis"]
        for _ in range(200)
    ])
    # The depth is exact here, which takes next to nothing from two degrees.
    low, high = chi2.interval(0.999, 2 * len(nis))
    assert low < nis.sum() < high


@pytest.mark.parametrize("std", [0.0, 0.1, 1.0])
@pytest.mark.parametrize("arm", [0.4, 3.0])
def test_the_iteration_is_bounded(std: float, arm: float) -> None:
    result = dive("multilateration", straight((15.0, 2.0, 5.0), (-0.3, 0.4, 0.05)), steps=100,
                  acoustics={"range_std": std}, beacons=lambda t: cross(arm))
    assert result.receiver.counts["improve"] <= PASSES * len(result.epoch)
    if std <= 0.1 and arm == 3.0:
        assert result.receiver.counts["improve"] <= 6 * len(result.epoch)
    assert np.isfinite(result.position).all()


def test_degenerate_geometry_gives_finite_numbers() -> None:
    for beacons in (np.zeros((4, 3)), CROSS * [1.0, 0.0, 1.0]):
        for position in ([0.0, 0.0, 0.0], [0.0, 0.0, 5.0], [3.0, 0.0, 0.5]):
            y = simultaneous("multilateration", np.array(position), beacons=beacons).y
            assert np.isfinite(y["position"]).all()
            assert np.isfinite(y["covariance"]).all()


def test_negative_ranges_give_finite_numbers() -> None:
    y = simultaneous("multilateration", CROSS[0] + [0.0, 0.0, 0.01], errors=-0.5).y
    assert np.isfinite(y["position"]).all()


def test_positions_of_the_newest_packet_suit_a_cross_that_moves_along_with_the_diver() -> None:
    def beacons(t: float) -> np.ndarray:
        return CROSS + np.array([t, 0.0, 0.0])

    def largest_error(source: int) -> float:
        result = dive(
            "multilateration", straight((12.0, -7.0, 5.0), (1.0, 0.0, 0.0)), steps=30,
            acoustics={"range_std": 0.0}, parameters={"beacon_position_source": source},
            beacons=beacons,
        )
        return float(result.distance.max())

    assert largest_error(2) < 1e-9
    assert largest_error(1) > 0.1
