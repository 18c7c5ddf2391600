"""A recorded track: the motion from point to point."""

from __future__ import annotations

from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from sblcosim.models import track
from sblcosim.models.declaration import Component
from sblcosim.models.equations import Model
from sblcosim.models.loading import load
from sblcosim.models.target.variables import TRACK_POINTS, TRAJECTORIES
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator
from stepper import Stepper, no_noise

SECOND = 10**9
FILE = next(value for value, name in TRAJECTORIES.items() if name == "file")
TIMES = [0.0, 2.0, 5.0, 9.0, 10.0, 17.5, 18.0, 30.0]
POINTS = [
    [0, 0, 1], [1, 0, 1], [4, 2, 3], [4, 2, 3], [4, 2, 3], [-3, 5, 8], [-3.5, 5.5, 8], [9, 5, 2]
]
"""With a stop from 5 s to 10 s."""


@cache
def model(points: int = TRACK_POINTS) -> Model:
    return load("target", track_points=points)


def diver(
    times: Any = TIMES, points: Any = POINTS, capacity: int = TRACK_POINTS, **more: Any
) -> Stepper:
    time, place = np.zeros(capacity), np.zeros((capacity, 3))
    time[: len(times)], place[: len(times)] = times, points
    parameters = {"trajectory": FILE, "track_count": len(times), "track_time": time, "track": place}
    return Stepper(model(capacity), parameters | more, noise=no_noise)


def at(stepper: Stepper, time: float) -> Any:
    end_ns = round(time * SECOND)
    return stepper.step(stepper.t_ns, end_ns - stepper.t_ns)


@pytest.mark.parametrize("departure", [0.0, 3.0])
def test_every_point_is_reached_at_its_time_exactly(departure: float) -> None:
    path = diver(departure_time=departure)
    assert path.y["path_duration"] == departure + TIMES[-1]
    for time, point in zip(TIMES, POINTS, strict=True):
        if departure + time:
            at(path, departure + time)
        np.testing.assert_array_equal(path.y["position"], point)


def test_there_is_rest_before_departure_in_a_stop_and_after_the_end() -> None:
    record = diver(departure_time=3.0).run(40 * SECOND, SECOND // 8)
    time = record["t"] - 3.0
    for resting, point in ((time <= 0, 0), ((time >= 5) & (time <= 10), 2), (time >= 30, -1)):
        assert resting.sum() > 20
        assert (record["position"][resting] == POINTS[point]).all()
        assert (record["velocity"][resting] == 0).all()


def test_velocity_is_continuous_and_the_derivative_of_position() -> None:
    h = SECOND // 500
    record = diver().run(32 * SECOND, h)
    derivative = (record["position"][2:] - record["position"][:-2]) / (2 * h / SECOND)
    np.testing.assert_allclose(record["velocity"][1:-1], derivative, atol=0.02)
    assert np.abs(np.diff(record["velocity"], axis=0)).max() < 0.1


@pytest.mark.parametrize("seed", range(6))
def test_it_is_the_cubic_of_scipy_through_the_same_points(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = 3 + 2 * seed
    times = np.round(np.append(0.0, np.cumsum(rng.uniform(0.5, 9.0, count - 1))), 3)
    points = np.cumsum(rng.normal(0, 4.0, (count, 3)), axis=0)
    points[count // 2] = points[count // 2 - 1]  # a stop
    slopes = np.zeros_like(points)  # at rest at both ends
    slopes[1:-1] = PchipInterpolator(times, points, axis=0).derivative()(times)[1:-1]
    path = CubicHermiteSpline(times, points, slopes, axis=0)
    record = diver(times, points).run(round((times[-1] - 0.1) * SECOND), SECOND // 16)
    np.testing.assert_allclose(record["position"], path(record["t"]), rtol=0, atol=1e-9)
    np.testing.assert_allclose(
        record["velocity"], path.derivative()(record["t"]), rtol=0, atol=1e-9
    )


def test_no_coordinate_leaves_the_range_of_its_two_points() -> None:
    record = diver().run(31 * SECOND, SECOND // 20)
    for i in range(len(TIMES) - 1):
        inside = (record["t"] >= TIMES[i]) & (record["t"] <= TIMES[i + 1])
        ends = np.sort([POINTS[i], POINTS[i + 1]], axis=0)
        assert (record["position"][inside] >= ends[0] - 1e-12).all()
        assert (record["position"][inside] <= ends[1] + 1e-12).all()


@pytest.mark.parametrize("step", [-1 / 3, 1 / 3, -1e20, 1e20, 1e-300])
def test_a_velocity_beside_a_stop_is_zero_and_never_unknown(step: float) -> None:
    """With -1/3 m in each second, the weighted sum of both velocities is -1."""
    for steps in ((0.0, step), (step, 0.0), (step, -step)):
        with np.errstate(all="raise", under="ignore"):
            assert track.velocity(np, *map(np.float64, steps), 1.0, 1.0) == 0
    assert float(track.velocity(ca, ca.DM(0), ca.DM(step), 1, 1)) == 0


def test_points_on_a_line_are_passed_at_constant_speed() -> None:
    times = np.arange(8.0)
    record = diver(times, times[:, None] * [0.3, -0.2, 0.1]).run(8 * SECOND, SECOND // 10)
    inner = (record["t"] >= 1) & (record["t"] <= 6)
    velocity = record["velocity"][inner]
    np.testing.assert_allclose(velocity, np.full_like(velocity, 1) * [0.3, -0.2, 0.1], rtol=1e-12)


@pytest.mark.parametrize("capacity", [2, pytest.param(4096, marks=pytest.mark.slow)])
def test_components_are_made_for_other_numbers_of_points(capacity: int) -> None:
    component: Component = model(capacity).component
    assert component.name == f"Target{capacity}"
    assert component["track_count"].max == component["track_time"].size == capacity
    times = np.linspace(0, 100, capacity)
    points = np.stack([np.sin(times), np.cos(times), 5 + 0 * times], axis=1)
    path = diver(times, points, capacity)
    assert path.y["path_duration"] == 100
    np.testing.assert_allclose(at(path, 100)["position"], points[-1], atol=1e-12)


def test_the_formulas_are_the_same_for_arrays() -> None:
    before, after = np.array([1.0, -2.0, 0.0, 3.0]), np.array([2.0, 1.0, 1.0, 3.0])
    np.testing.assert_allclose(track.velocity(np, before, after, 1.0, 1.0), [4 / 3, 0, 0, 3])
    position, velocity = track.motion(np.array([0.0, 0.5, 1.0]), 2.0, 1.0, 4.0, 0.0, 0.0)
    np.testing.assert_allclose(position, [1, 3, 5])
    np.testing.assert_allclose(velocity, [0, 3, 0])
