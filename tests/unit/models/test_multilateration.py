"""The raw fix: exactness, covariance, robustness of the iteration."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from harness import CROSS, NS, at_rest, cross, dive, hear, simultaneous, straight
from numpy.typing import NDArray
from sblcosim.models.receiver.least_squares import (
    FIRST_DAMPING,
    PASSES,
    Samples,
    closed_form,
    improve,
    separate,
)
from sblcosim.models.receiver.minimum import is_safe, newton, point, step, tangent
from scipy.optimize import least_squares
from scipy.stats import chi2

POSITIONS = [
    (12.0, -7.0, 5.0), (0.3, 0.1, 2.0), (-60.0, 80.0, 30.0), (3.0, 0.0, 0.6), (0.5, 0.5, 0.5),
]
ERRORS = np.array([0.11, -0.05, 0.08, 0.13])
SMALL_STD = {"range_std": 0.1, "depth_std": 0.01}
WEIGHT = np.array([1e2, 1e2, 1e2, 1e2, 1e4])
"""1/m^2, for `SMALL_STD`."""


def symbols() -> tuple[Samples, Any]:
    """Five fresh measurements as symbols, and all of them as one column: z, then the beacons."""
    z, beacons = ca.SX.sym("z", 5), ca.SX.sym("beacons", 4, 3)
    nothing, heard = ca.SX.zeros(5), ca.SX.ones(5)
    s = Samples(z=z, epoch=nothing, beacons=beacons, mark=nothing, heard=heard, new=heard,
                any_new=1, newest=0, enough=1)
    return s, ca.vertcat(z, ca.vec(beacons))


@cache
def plain() -> tuple[ca.Function, ca.Function]:
    """The closed form, and one pass of the plain descent, which the filters start with."""
    s, data = symbols()
    x, damping = ca.SX.sym("x", 3), ca.SX.sym("damping")
    found = improve(x, damping, lambda place: separate(place, s, ca.SX(WEIGHT)))
    return (
        ca.Function("start", [data], [closed_form(s)]),
        ca.Function(
            "improve", [x, damping, data], [found.taken.position, found.damping, found.done]
        ),
    )


def plain_fix(data: NDArray[np.float64]) -> tuple[NDArray[np.float64], bool]:
    """Where the plain descent ends, and whether it took less than all its passes."""
    start, improve_once = plain()
    x, damping = start(data), FIRST_DAMPING
    for _ in range(PASSES):
        x, damping, done = improve_once(x, damping, data)
        if done:
            return np.array(x).ravel(), True
    return np.array(x).ravel(), False


class Cost:
    """Weighted squares of the residuals in long double, apart from the equations of the models."""

    def __init__(self, z: NDArray[np.float64], beacons: NDArray[np.float64]) -> None:
        self.z, self.beacons = z.astype(np.longdouble), beacons.astype(np.longdouble)

    def at(self, x: NDArray[Any]) -> tuple[Any, Any, Any, Any]:
        """Cost, half its negative slope, half its second derivative, H' W H."""
        offset = x.astype(np.longdouble) - self.beacons
        h = np.sqrt((offset**2).sum(axis=1))
        H = np.vstack([offset / h[:, None], [0, 0, 1]])
        e = self.z - np.append(h, x[2])
        information = (H.T * WEIGHT) @ H
        second = information.copy()
        for i in range(4):
            projection = np.eye(3) - np.outer(H[i], H[i])
            second -= WEIGHT[i] * e[i] * projection / h[i]
        return (WEIGHT * e**2).sum(), H.T @ (WEIGHT * e), second, information

    def minimum(self, x: NDArray[Any]) -> NDArray[np.float64]:
        """Newton's from a position near a minimum; NaN if it leads away or to none."""
        start = x
        for _ in range(50):
            _, slope, second, _ = self.at(x)
            move = np.linalg.solve(second.astype(float), slope.astype(float))
            x = x + move.astype(np.longdouble)
        good = np.linalg.norm(move) < 1e-14 * max(1.0, float(np.linalg.norm(x)))
        good &= np.linalg.eigvalsh(second.astype(float))[0] > 0
        good &= np.linalg.norm(x - start) < 1e-3
        return x.astype(float) if good else np.full(3, np.nan)


def noisy(seed: int, arm: float, std: float) -> tuple[NDArray[np.float64], Mapping[str, Any]]:
    """A position between 2 and 40 m away, and beacons and errors for `simultaneous`."""
    rng = np.random.default_rng([seed, round(10 * arm), round(100 * std)])
    direction = rng.normal(size=3) + np.array([0.0, 0.0, 1.0])
    position = direction / np.linalg.norm(direction) * rng.uniform(2.0, 40.0)
    tilt = np.linalg.qr(np.eye(3) + 0.1 * rng.normal(size=(3, 3)))[0]
    return position, {"beacons": cross(arm) @ tilt.T, "errors": std * rng.normal(size=4)}


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


@pytest.mark.parametrize(("arm", "std"), [(0.4, 0.01), (3.0, 0.1), (3.0, 0.3), (30.0, 1.0)])
def test_it_is_the_minimum_to_rounding_where_the_plain_descent_leads(
    arm: float, std: float
) -> None:
    compared = 0
    for seed in range(60):
        position, given = noisy(seed, arm, std)
        box = simultaneous("multilateration", position, SMALL_STD, **given)
        z = np.append(box.u["range"], box.u["depth"])
        cost = Cost(z, given["beacons"])
        there, done = plain_fix(np.concatenate([z, given["beacons"].T.ravel()]))
        value, _, _, information = (np.asarray(a, float) for a in cost.at(box.y["position"]))
        least = cost.minimum(there)
        # Where the plain descent has not arrived, it is at least not better.
        assert value <= float(cost.at(there)[0]) * (1 + 1e-9) + 1e-9
        if done and np.isfinite(least).all():
            compared += 1
            np.testing.assert_allclose(box.y["position"], least, rtol=0, atol=1e-9)
        assert box.y["nis"] == pytest.approx(float(value), rel=1e-9, abs=1e-9)
        P, std_ = np.linalg.inv(information), box.y["position_std"]
        np.testing.assert_allclose(
            box.y["covariance"][::2, ::2] / np.outer(std_, std_), P / np.outer(std_, std_),
            rtol=0, atol=1e-5,
        )
    assert compared >= 45


def test_it_arrives_in_the_curved_valley_of_short_arms() -> None:
    """Ranges say little about the direction then: steps along the gradients leave the sphere."""
    arrived = plain_arrived = passes = 0
    for seed in range(60):
        position, given = noisy(seed, 0.4, 0.1)
        box = simultaneous("multilateration", position, SMALL_STD, **given)
        z = np.append(box.u["range"], box.u["depth"])
        cost = Cost(z, given["beacons"])
        there, done = plain_fix(np.concatenate([z, given["beacons"].T.ravel()]))
        plain_arrived += done
        passes += box.counts["improve"]
        if box.counts["improve"] < PASSES:
            arrived += 1
            np.testing.assert_allclose(
                box.y["position"], cost.minimum(box.y["position"]), rtol=0, atol=1e-9
            )
            assert cost.at(box.y["position"])[0] <= cost.at(there)[0] * (1 + 1e-9) + 1e-9
    assert arrived > 50
    assert arrived > plain_arrived + 5
    assert passes < 60 * 4.3


def test_the_tangent_holds_the_derivatives_of_the_cost() -> None:
    s, data = symbols()
    x = ca.SX.sym("x", 3)
    cost = point(x, s, ca.SX(WEIGHT)).cost
    hessian, gradient = ca.hessian(cost, x)
    t = tangent(point(x, s, ca.SX(WEIGHT)), s, ca.SX(WEIGHT))
    both = ca.Function("both", [x, data], [
        t.information + t.curvature, hessian / 2, t.slope, -gradient / 2,
    ])
    z = np.append(np.linalg.norm(np.array([12.0, -7.0, 5.0]) - CROSS, axis=1) + ERRORS, 5.0)
    values = both(np.array([11.0, -6.5, 4.0]), np.concatenate([z, CROSS.T.ravel()]))
    second, second_again, slope, slope_again = (np.array(v) for v in values)
    np.testing.assert_allclose(second, second_again, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(slope, slope_again, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize(("fresh", "order"), [(0, 2), (1, 3)])
def test_an_accelerated_step_gains_an_order(fresh: int, order: int) -> None:
    s, data = symbols()
    x = ca.SX.sym("x", 3)
    t = tangent(point(x, s, ca.SX(WEIGHT)), s, ca.SX(WEIGHT))
    found = step(t, 0, fresh=fresh)
    after = ca.Function("after", [x, data], [x + found.move])
    truth = np.array([12.0, -7.0, 5.0])
    z = np.append(np.linalg.norm(truth - CROSS, axis=1), truth[2])
    remaining = [
        np.linalg.norm(np.array(after(truth + far, np.append(z, CROSS.T))).ravel() - truth)
        for far in (np.array([0.5, 0.25, -0.1]), np.array([0.25, 0.125, -0.05]))
    ]
    assert remaining[0] / remaining[1] == pytest.approx(2**order, rel=0.15)


def test_a_step_of_newton_squares_what_remains_whatever_the_ranges_are_off_by() -> None:
    s, data = symbols()
    x = ca.SX.sym("x", 3)
    t = tangent(point(x, s, ca.SX(WEIGHT)), s, ca.SX(WEIGHT))
    after = ca.Function("after", [x, data], [x + newton(t, 0).move, is_safe(t)])
    truth = np.array([12.0, -7.0, 5.0])
    z = np.append(np.linalg.norm(truth - CROSS, axis=1), truth[2])
    given = np.append(z + np.array([0.3, -0.2, 0.1, 0.25, 0.1]), CROSS.T)
    least = truth
    for _ in range(20):
        least, safe = (np.array(it).ravel() for it in after(least, given))
    assert safe
    remaining = [
        np.linalg.norm(np.array(after(least + far, given)[0]).ravel() - least)
        for far in (np.array([0.1, 0.05, -0.02]), np.array([0.05, 0.025, -0.01]))
    ]
    assert remaining[0] / remaining[1] == pytest.approx(4, rel=0.15)


def test_there_is_nothing_before_the_first_fix_and_nothing_changes_without_something_new() -> None:
    box = simultaneous("multilateration", np.array([12.0, -7.0, 5.0]), errors=ERRORS)
    before, passes = box.y, box.counts["improve"]
    after = box.step(box.t_ns, NS // 10)
    assert box.counts["improve"] == passes
    assert before.keys() == after.keys()
    for name, value in before.items():
        np.testing.assert_array_equal(after[name], value)
    silent = dive("multilateration", at_rest(12.0, -7.0, 5.0), steps=3).receiver.y
    assert silent["update_count"] == 0
    for name, value in silent.items():
        if name != "epoch":
            np.testing.assert_array_equal(value, 0.0)


@pytest.mark.parametrize("damping", [0.0, 0.5])
def test_the_damping_of_a_pass_is_a_multiple_of_the_informations_diagonal(damping: float) -> None:
    x, truth, weight = np.array([11.0, -6.5, 4.0]), [12.0, -7.0, 5.0], np.array([1, 4, 9, 2, 50.0])
    ranges = np.linalg.norm(truth - CROSS, axis=1)
    nothing, heard = ca.SX.zeros(5), ca.SX.ones(5)
    samples = Samples(
        z=ca.SX([*ranges, truth[2]]), epoch=nothing, beacons=ca.SX(CROSS), mark=nothing,
        heard=heard, new=heard, any_new=1, newest=0, enough=1,
    )
    found = improve(
        ca.SX(x), damping, lambda place: separate(place, samples, ca.SX(weight))
    )
    offset = x - CROSS
    distances = np.linalg.norm(offset, axis=1)
    H = np.vstack([offset / distances[:, None], [0.0, 0.0, 1.0]])
    information = H.T @ np.diag(weight) @ H
    damped = information + damping * np.diag(np.diag(information))
    residuals = np.append(ranges - distances, truth[2] - x[2])
    step = np.linalg.solve(damped, H.T @ (weight * residuals))
    position = np.array(ca.evalf(found.taken.position)).ravel()
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
