"""The EKF against an independent one written from the paper's equations, and its options."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from harness import CROSS, Dive, at_rest, dive, simultaneous, straight
from sblcosim.models.loading import load
from sblcosim.models.receiver.least_squares import PASSES
from scipy.optimize import least_squares
from stepper import Stepper

LINE = straight((15.0, 2.0, 5.0), (-0.3, 0.4, 0.05))
NOISY = {"range_std": 0.3, "loss_probability": 0.25}
PRIOR = {"initialisation": 2, "prior_position": (14.0, 3.0, 4.5), "prior_velocity": (0.1, 0.0, 0.0),
         "prior_position_std": 1.5, "prior_velocity_std": 0.4}


def moving_cross(t: float) -> np.ndarray:
    """Reported beacons that differ from packet to packet."""
    return CROSS + 0.5 * np.sin(np.arange(12).reshape(4, 3) + 3.0 * t)


def paper_ekf(
    inputs: list[Mapping[str, Any]], p: Mapping[str, Any], mean: np.ndarray, P: np.ndarray,
    epoch: float, seen: tuple[Any, ...],
) -> list[tuple[float, np.ndarray, np.ndarray, float]]:
    """The paper's section 3 with the full measurement vector at once: (epoch, x, P, nis)."""
    rows = []
    H_position = np.kron(np.eye(3), [1.0, 0.0])
    for u in inputs:
        now = (*u["reception_count"], u["depth_epoch"])
        if now == seen:
            continue
        seen = now
        newest = max(*u["range_epoch"], u["depth_epoch"])
        dt, epoch = newest - epoch, newest
        Phi = np.kron(np.eye(3), [[1.0, dt], [0.0, 1.0]])
        pp = dt**3 / 3 if p["process_noise"] == 1 else dt**4 / 4 / dt
        Q = np.kron(np.eye(3), p["acceleration_psd"] * np.array([[pp, dt**2 / 2], [dt**2 / 2, dt]]))
        mean, P = Phi @ mean, Phi @ P @ Phi.T + Q
        position = H_position @ mean
        source = "ping" if p["beacon_position_source"] == 1 else "packet"
        z, predicted, H, R = [], [], [], []
        power = 2 if p["measurement_noise"] == 1 else 1
        for i in np.flatnonzero(u["reception_count"]):
            offset = position - u[f"{source}_beacon_position"][i]
            z.append(u["range"][i])
            predicted.append(np.linalg.norm(offset))
            H.append(offset / np.linalg.norm(offset) @ H_position)
            R.append(p["range_std"] ** power)
        if u["depth_epoch"] > 0:
            z.append(u["depth"])
            predicted.append(position[2])
            H.append(H_position[2])
            R.append(p["depth_std"] ** power)
        H = np.array(H)
        S = H @ P @ H.T + np.diag(R)
        K = P @ H.T @ np.linalg.inv(S)
        innovation = np.subtract(z, predicted)
        mean, P = mean + K @ innovation, P - K @ H @ P
        rows.append((epoch, mean, P, float(innovation @ np.linalg.solve(S, innovation))))
    return rows


def state(result: Dive, row: int) -> np.ndarray:
    return np.column_stack([result.position[row], result.velocity[row]]).ravel()


def assert_same(result: Dive, expected: list[Any], skip: int = 0) -> None:
    assert len(result.epoch) - skip == len(expected)
    for row, (epoch, mean, P, nis) in enumerate(expected, start=skip):
        assert result.epoch[row] == epoch
        np.testing.assert_allclose(state(result, row), mean, rtol=0, atol=1e-9)
        np.testing.assert_allclose(result.covariance[row], P, rtol=0, atol=1e-9)
        assert result.nis[row] == pytest.approx(nis, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("ratio", [1, 3])
@pytest.mark.parametrize("source", [1, 2])
@pytest.mark.parametrize("process_noise", [1, 2])
@pytest.mark.parametrize("measurement_noise", [1, 2])
def test_it_equals_the_papers_filter_step_by_step(
    ratio: int, source: int, process_noise: int, measurement_noise: int
) -> None:
    options = {**PRIOR, "beacon_position_source": source, "process_noise": process_noise,
               "measurement_noise": measurement_noise, "range_std": 0.2, "depth_std": 0.05}
    result = dive("ekf", LINE, steps=120, ratio=ratio, acoustics=NOISY, parameters=options,
                  depth_std=0.1, reported=moving_cross)
    p = result.receiver.p
    mean = np.column_stack([p["prior_position"], p["prior_velocity"]]).ravel()
    P = np.kron(np.eye(3), np.diag([1.5**2, 0.4**2]))
    assert_same(result, paper_ekf(result.inputs, p, mean, P, 0.0, (0, 0, 0, 0, 0.0)))


def test_from_its_first_fix_on_it_equals_the_papers_filter() -> None:
    result = dive("ekf", LINE, steps=120, acoustics=NOISY, depth_std=0.1, reported=moving_cross)
    begin = next(
        i for i, u in enumerate(result.inputs) if max(u["range_epoch"]) == result.epoch[0]
    )
    u = result.inputs[begin]
    expected = paper_ekf(
        result.inputs[begin + 1:], result.receiver.p, state(result, 0), result.covariance[0],
        result.epoch[0], (*u["reception_count"], u["depth_epoch"]),
    )
    assert_same(result, expected, skip=1)


def test_stale_ranges_make_it_lag_behind_a_moving_diver() -> None:
    slow = dive("ekf", at_rest(12.0, -7.0, 5.0), acoustics={"range_std": 0.0})
    fast = dive("ekf", LINE, acoustics={"range_std": 0.0})
    assert slow.distance[-1] < 1e-9
    assert 0.02 < fast.distance[-1] < 0.2


def test_with_a_prior_it_starts_with_the_first_sample_and_without_one_with_three_ranges() -> None:
    with_prior = dive("ekf", LINE, steps=30, parameters=PRIOR)
    without = dive("ekf", LINE, steps=30)
    assert with_prior.epoch[0] == pytest.approx(0.1)
    assert with_prior.nis_degrees[:5].tolist() == [2, 3, 4, 5, 5]
    assert without.epoch[0] == pytest.approx(0.3)
    assert without.nis_degrees[:3].tolist() == [0, 5, 5]


def test_before_the_first_fix_it_is_not_valid() -> None:
    result = dive("ekf", LINE, steps=3)
    assert not result.receiver.y["valid"]
    assert result.receiver.y["update_count"] == 0


def test_the_first_fix_is_exact_and_knows_its_uncertainty() -> None:
    result = dive(
        "ekf", at_rest(12.0, -7.0, 5.0), acoustics={"range_std": 0.0}, steps=10,
        parameters={"prior_velocity_std": 0.0, "range_std": 0.2, "depth_std": 0.05},
    )
    position = np.array([12.0, -7.0, 5.0])
    offsets = position - CROSS[:3]
    H = np.vstack([offsets / np.linalg.norm(offsets, axis=1)[:, None], [0.0, 0.0, 1.0]])
    P = np.linalg.inv(H.T @ np.diag([1 / 0.04] * 3 + [1 / 0.0025]) @ H)
    np.testing.assert_allclose(result.position[0], position, rtol=0, atol=1e-9)
    np.testing.assert_allclose(result.covariance[0][::2, ::2], P, rtol=1e-6)
    np.testing.assert_array_equal(result.covariance[0][1::2], 0.0)
    np.testing.assert_array_equal(result.velocity[0], 0.0)


def test_samples_that_disagree_widen_the_first_covariance() -> None:
    position = np.array([12.0, -7.0, 5.0])
    errors = np.array([1.0, -1.0, 1.0, -1.0])
    agree = simultaneous("ekf", position).y["covariance"]
    disagree = simultaneous("ekf", position, errors=errors).y["covariance"]
    # The residuals are about the errors: their squares over R = 0.01 m^2, per 2 degrees.
    factor = np.sum(errors**2) / 0.01 / 2
    np.testing.assert_allclose(
        disagree[:4:2, :4:2], factor * agree[:4:2, :4:2], rtol=0.1, atol=0.02 * factor
    )


@pytest.mark.parametrize("name", ["ekf", "sequential"])
@pytest.mark.parametrize("speed", [0.0, 0.3, 2.0])
def test_in_the_first_fix_a_stale_sample_counts_less(name: str, speed: float) -> None:
    """Its variance grows by that of the way the diver may have made since."""
    epochs = np.array([0.2, 0.9, 0.4, 1.1, 0.7])
    path = np.array([12.0, -7.0, 5.0]) + epochs[:, None] * [0.8, -0.3, 0.2]
    ranges = np.linalg.norm(path[:4] - CROSS, axis=1)
    box = Stepper(
        load(name),
        {"prior_velocity_std": speed, "range_std": 0.2, "depth_std": 0.05},
    )
    box.step(0, 12 * box.interval_ns)
    box.set(
        range=ranges, range_epoch=epochs[:4], reception_count=np.ones(4),
        ping_beacon_position=CROSS, packet_beacon_position=CROSS, depth=path[4, 2],
        depth_epoch=epochs[4],
    )
    y = box.step(box.t_ns, box.interval_ns)
    std = np.sqrt(np.array([0.2] * 4 + [0.05]) ** 2 + (speed * (1.1 - epochs)) ** 2)

    def residuals(x: np.ndarray) -> np.ndarray:
        predicted = np.append(np.linalg.norm(x - CROSS, axis=1), x[2])
        return (np.append(ranges, path[4, 2]) - predicted) / std

    best = least_squares(residuals, path[0], xtol=1e-15, ftol=1e-15, gtol=1e-15)
    factor = max(2 * best.cost / 2, 1.0)
    P = factor * np.linalg.inv(best.jac.T @ best.jac)
    np.testing.assert_allclose(y["position"], best.x, rtol=0, atol=1e-5)
    np.testing.assert_allclose(y["covariance"][::2, ::2], P, rtol=1e-3, atol=1e-6)
    assert y["epoch"] == 1.1


def test_nothing_new_means_no_new_estimate() -> None:
    ekf = dive("ekf", LINE, steps=50).receiver
    before = ekf.y
    after = ekf.step(ekf.t_ns, ekf.interval_ns)
    assert before["valid"]
    for name, value in before.items():
        np.testing.assert_array_equal(after[name], value, err_msg=name)


def test_an_update_interval_of_four_samples_gives_every_fourth_epoch() -> None:
    result = dive("ekf", LINE, steps=81, ratio=4, acoustics=NOISY)
    np.testing.assert_allclose(result.epoch, result.t - 0.1, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.diff(result.t), 0.4, rtol=0, atol=1e-12)


def test_its_first_fix_takes_few_passes() -> None:
    for seed in range(5):
        result = dive("ekf", LINE, steps=8, acoustics={"range_std": 0.5}, seed=seed)
        assert 0 < result.receiver.counts["initialise"] <= PASSES


def test_degenerate_geometry_gives_finite_numbers() -> None:
    in_one_point = np.zeros((4, 3))
    in_line = CROSS * [1.0, 0.0, 1.0]
    for beacons in (in_one_point, in_line):
        for path in (at_rest(0.0, 0.0, 0.0), at_rest(0.0, 0.0, 5.0), at_rest(3.0, 0.0, 0.5)):
            result = dive("ekf", path, steps=20, beacons=lambda t, at=beacons: at)
            assert np.isfinite(result.position).all()
            assert np.isfinite(result.covariance).all()


@pytest.mark.parametrize("name", ["ekf", "sequential", "multilateration"])
def test_receivers_declare_no_direct_feedthrough(name: str) -> None:
    assert not load(name).feedthrough
