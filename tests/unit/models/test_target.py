"""The diver's paths, the motion from white acceleration and the depth sensor."""

from __future__ import annotations

from functools import cache
from math import atan2, hypot, inf, pi, sqrt
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from sblcosim.models.equations import Model
from sblcosim.models.loading import load
from sblcosim.models.target.trajectories.spiral import angle_at, arc
from sblcosim.models.target.variables import TRAJECTORIES
from scipy import integrate, stats
from stepper import Stepper, no_noise, numpy_noise

SECOND = 10**9
NUMBER = {name: value for value, name in TRAJECTORIES.items()}
WAYPOINTS = [[0, 0, 1], [6, 8, 1], [6, 8, 6], [6, 8, 6], [-6, 3, 6]]
"""Legs of 10, 5, 0 and 13 m."""
PATHS = ("straight_line", "semicircle", "circle", "square", "spiral", "random_path", "waypoints")


@cache
def model() -> Model:
    return load("target")


def target(trajectory: str, noise: Any = None, seed: int = 1, start_ns: int = 0, **parameters: Any
           ) -> Stepper:
    if "waypoint" in parameters:
        points = np.zeros((64, 3))
        points[: len(parameters["waypoint"])] = parameters["waypoint"]
        parameters |= {"waypoint_count": len(parameters["waypoint"]), "waypoint": points}
    return Stepper(model(), {"trajectory": NUMBER[trajectory], **parameters}, noise=noise,
                   seed=seed, start_ns=start_ns)


def typical(trajectory: str, **parameters: Any) -> Stepper:
    """A path with everything in it that a path can have."""
    return target(trajectory, **{
        "center": [3.0, -4.0], "heading": 0.7, "depth_start": 2.0, "depth_end": 9.0,
        "departure_time": 3.0, "waypoint": WAYPOINTS, **parameters,
    })


def at(stepper: Stepper, time: float) -> Any:
    """Outputs at a time, from the start of the run."""
    end_ns = round(time * SECOND)
    return stepper.step(stepper.t_ns, end_ns - stepper.t_ns)


@pytest.mark.parametrize("trajectory", PATHS)
def test_speed_is_constant_in_space_between_departure_and_end(trajectory: str) -> None:
    path = typical(trajectory, speed=0.37)
    end = path.y["path_duration"]
    record = path.run(round((end + 5) * SECOND), SECOND // 4)
    speed = np.linalg.norm(record["velocity"], axis=1)
    under_way = (record["t"] >= 3) & (record["t"] < end)
    assert under_way.sum() > 200
    np.testing.assert_allclose(speed[under_way], 0.37, rtol=1e-9)
    assert (speed[~under_way] == 0).all()


@pytest.mark.parametrize("trajectory", [*PATHS, "white_noise_acceleration"])
def test_velocity_is_the_derivative_of_position(trajectory: str) -> None:
    path = typical(trajectory, sampling_time=1.0)
    h = 1e-3
    errors = []
    for time in np.arange(0.0537, 60, 0.15):
        before, now, after = (dict(at(path, time + d)) for d in (-h, 0, h))
        slope = (after["position"] - before["position"]) / (2 * h)
        errors.append(np.abs(slope - now["velocity"]).max())
    assert np.quantile(errors, 0.98) < 1e-6, "all but at departure and corners"


@pytest.mark.parametrize("trajectory", [*PATHS, "white_noise_acceleration"])
def test_position_is_continuous(trajectory: str) -> None:
    path = typical(trajectory)
    record = path.run(70 * SECOND, SECOND // 50)
    jumps = np.linalg.norm(np.diff(record["position"], axis=0), axis=1)
    fastest = np.linalg.norm(record["velocity"], axis=1).max()
    assert jumps.max() <= fastest * 0.02 * 1.01


@pytest.mark.parametrize("trajectory", PATHS)
def test_waits_at_the_first_point_and_stays_at_the_last(trajectory: str) -> None:
    path = typical(trajectory, departure_time=12.0)
    first = path.y["position"]
    assert (at(path, 11.999)["position"] == first).all()
    end = path.y["path_duration"]
    last = at(path, end + 1e-6)["position"]
    assert (at(path, end + 1000)["position"] == last).all()
    assert last[2] == pytest.approx(6 if trajectory == "waypoints" else 9, abs=1e-12)


@pytest.mark.parametrize("trajectory", PATHS)
def test_path_duration_is_length_over_speed_after_departure(trajectory: str) -> None:
    length = {  # horizontal
        "straight_line": 150, "semicircle": pi * 15, "circle": 2 * 2 * pi * 15, "square": 60,
        "random_path": 150, "waypoints": 28,
        "spiral": integrate.quad(lambda a: hypot(2.5 + 22.5 / (4 * pi) * a, 22.5 / (4 * pi)),
                                 0, 4 * pi, epsabs=1e-12)[0],
    }[trajectory]
    in_space = length if trajectory == "waypoints" else hypot(length, 7)
    assert typical(trajectory).y["path_duration"] == pytest.approx(3 + in_space / 0.5, rel=1e-12)


@pytest.mark.parametrize("trajectory", TRAJECTORIES.values())
def test_speed_zero_means_no_end_and_no_motion(trajectory: str) -> None:
    path = typical(trajectory, speed=0.0)
    assert path.y["path_duration"] == 0
    if trajectory != "white_noise_acceleration":
        first = path.y["position"]
        assert (at(path, 100)["position"] == first).all()
        assert (path.y["velocity"] == 0).all()


def test_a_path_without_length_is_a_point() -> None:
    for path in (typical("straight_line", path_length=0.0), typical("random_path", path_length=0.0),
                 typical("waypoints", waypoint=[[1, 2, 3]] * 2),
                 typical("spiral", spiral_radius=[0.0, 0.0])):
        first = path.y["position"]
        assert np.isfinite(at(path, 50)["position"]).all()
        assert (path.y["position"] == first).all()
        assert path.y["path_duration"] == 0


def test_depth_changes_in_proportion_to_the_distance_gone() -> None:
    path = typical("circle", departure_time=0.0)
    quarter = path.y["path_duration"] / 4
    assert at(path, quarter)["position"][2] == pytest.approx(2 + 7 / 4, abs=1e-8)


def test_time_of_the_path_counts_from_the_start_of_the_simulation() -> None:
    early, late = typical("semicircle"), typical("semicircle", start_ns=1000 * SECOND)
    np.testing.assert_allclose(at(late, 1020)["position"], at(early, 20)["position"], atol=1e-12)


def test_straight_line_follows_the_heading() -> None:
    path = target("straight_line", heading=pi / 2, center=[1, 2], path_length=10)
    np.testing.assert_allclose(at(path, 1000)["position"], [1, 12, 5], atol=1e-12)


def test_semicircle_goes_clockwise_from_the_heading_to_its_opposite() -> None:
    path = target("semicircle", center=[1, 2], radius=4.0, speed=1.0)
    np.testing.assert_allclose(path.y["position"], [5, 2, 5], atol=1e-12)
    np.testing.assert_allclose(path.y["velocity"], [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(at(path, 2 * pi)["position"], [1, 6, 5], atol=1e-8)
    np.testing.assert_allclose(at(path, 99)["position"], [-3, 2, 5], atol=1e-12)


def test_square_passes_its_four_corners_clockwise_and_closes() -> None:
    path = target("square", center=[10, 20], side=4.0, speed=1.0)
    corners = [at(path, 4 * i)["position"][:2] if i else path.y["position"][:2] for i in range(5)]
    np.testing.assert_allclose(corners, [[8, 18], [12, 18], [12, 22], [8, 22], [8, 18]], atol=1e-12)


def test_square_turns_with_the_heading() -> None:
    path = target("square", heading=pi / 2, side=4.0, speed=1.0)
    np.testing.assert_allclose(path.y["position"][:2], [2, -2], atol=1e-12)
    np.testing.assert_allclose(path.y["velocity"], [0, 1, 0], atol=1e-12)


@pytest.mark.parametrize("shift_ns", [-1, 0, 1])
def test_a_nanosecond_of_jitter_at_a_corner_does_not_matter(shift_ns: int) -> None:
    for path, corner in ((target("square", side=15.0), 30 * SECOND),
                         (target("waypoints", waypoint=WAYPOINTS), 20 * SECOND)):
        before = path.y["velocity"]
        y = path.step(0, corner + shift_ns)
        assert abs(y["velocity"] @ before) < 1e-12, "already on the next leg"


RADII = [(2.5, 25.0), (25.0, 2.5), (0.0, 10.0), (10.0, 0.0), (7.0, 7.0), (0.0, 1e-3),
         (5.0, 5.0 + 1e-9), (0.0, 1e5)]


@pytest.mark.parametrize("radii", RADII)
@pytest.mark.parametrize("turns", [0.01, 0.3, 2.0])
def test_spiral_radius_is_linear_in_the_angle_and_speed_is_constant(radii: tuple[float, float],
                                                                    turns: float) -> None:
    path = target("spiral", spiral_radius=radii, turns=turns, sampling_time=1e6)
    times = path.y["path_duration"] * np.linspace(0.001, 0.999, 60)
    rows = [at(path, time) for time in times]
    r, bearing = np.array([
        (hypot(*row["position"][:2]), atan2(*row["position"][1::-1])) for row in rows
    ]).T
    b = (radii[1] - radii[0]) / (2 * pi * turns)
    np.testing.assert_allclose(r, radii[0] + b * np.unwrap(bearing), atol=1e-9 * max(radii))
    np.testing.assert_allclose([np.linalg.norm(row["velocity"]) for row in rows], 0.5, rtol=1e-9)
    last = at(path, path.y["path_duration"] + 1)["position"][:2]
    assert hypot(*last) == pytest.approx(radii[1], rel=1e-12, abs=1e-12 * max(radii))


def spiral(parameters: SimpleNamespace, angle: float) -> float:
    """Arc length of the spiral by the model's closed form."""
    return float(arc(parameters, ca.DM(angle)))


@pytest.mark.parametrize("radii", RADII)
@pytest.mark.parametrize("turns", [0.01, 2.0])
def test_arc_length_of_the_spiral_is_its_integral(radii: tuple[float, float], turns: float) -> None:
    p = SimpleNamespace(spiral_radius=ca.DM(radii), turns=turns)
    b = (radii[1] - radii[0]) / (2 * pi * turns)
    for share in (0.01, 0.5, 1.0):
        angle = 2 * pi * turns * share
        arc, _ = integrate.quad(lambda s: hypot(radii[0] + b * s, b), 0, angle, epsabs=0,
                                epsrel=1e-13, limit=500)
        assert spiral(p, angle) == pytest.approx(arc, rel=1e-12)


def test_angle_of_the_spiral_inverts_the_arc_length_for_all_parameters() -> None:
    a, b, n, s = (ca.SX.sym(name) for name in ("r_0", "r_1", "turns", "s"))
    p = SimpleNamespace(spiral_radius=ca.vertcat(a, b), turns=n)
    length = ca.Function("length", [a, b, n], [arc(p, 2 * pi * n)])
    residual = ca.Function("residual", [a, b, n, s], [arc(p, angle_at(p, s)) - s])

    rng = np.random.default_rng(5)
    size = 50_000
    radii = np.where(rng.random((2, size)) < 0.15, 0, 10 ** rng.uniform(-3, 5, (2, size)))
    near = rng.random(size) < 0.2
    radii[1, near] = radii[0, near] * (1 + 10 ** rng.uniform(-16, -3, near.sum()))
    turns = 10 ** rng.uniform(-2, 3, size)
    rows = [*radii, turns]
    total = np.array(length(*(ca.DM(row).T for row in rows))).ravel()
    share = np.where(rng.random(size) < 0.3, 10 ** rng.uniform(-12, 0, size), rng.random(size))
    rows.append(share * total)
    error = np.array(residual(*(ca.DM(row).T for row in rows))).ravel()
    assert (np.abs(error) <= 1e-12 * total).all()  # a NaN would fail


def test_random_path_stays_in_its_box() -> None:
    path = target("random_path", box=[6, 3], center=[100, -50], path_length=2000.0)
    record = path.run(4000 * SECOND, SECOND)
    assert (np.abs(record["position"][:, :2] - [100, -50]) <= [6 + 1e-9, 3 + 1e-9]).all()


def test_random_path_starts_uniformly_in_its_box() -> None:
    starts = np.array([target("random_path", seed=seed, path_length=0.0).y["position"][:2]
                       for seed in range(400)])
    for axis in starts.T:
        assert stats.kstest(axis, "uniform", (-25, 50)).pvalue > 0.01


def test_legs_are_exponential_and_uniform_in_direction_in_a_wide_box() -> None:
    path = target("random_path", box=[1e5, 1e5], path_length=1e6, leg_length=8.0, speed=20.0)
    lengths, directions = [], []
    while len(lengths) < 3000:
        lengths.append(path.state("leg_end") - path.state("leg_begin"))
        directions.append(np.arctan2(*path.state("leg_direction")[:2]))
        rest = path.state("leg_end") / 20 * SECOND - path.t_ns
        path.step(path.t_ns, int(rest) + 10)
    assert path.counts["leg"] == len(lengths) + 1
    assert stats.kstest(lengths, "expon", (0, 8)).pvalue > 0.01
    assert stats.kstest(directions, "uniform", (-pi, 2 * pi)).pvalue > 0.01


def test_a_leg_out_of_the_box_is_drawn_again_with_length_and_direction() -> None:
    # north 20 m (out), then south 10 m
    u = {0: (np.exp(-20 / 8), 0.0), 1: (np.exp(-10 / 8), 0.5)}

    def noise(draw: Any, count: int) -> Any:
        if draw.name == "attempt":
            return [u[min(count, 1)][0] * 2**53 - 1, u[min(count, 1)][1] * 2**53]
        return no_noise(draw, count)

    path = target("random_path", noise=noise, box=[15, 15])
    assert path.counts["leg"] == 2
    np.testing.assert_allclose(path.y["velocity"], [-0.5, 0, 0], atol=1e-12)
    assert path.state("leg_end") == pytest.approx(10, rel=1e-9)


def test_random_path_does_not_depend_on_step_size_or_sampling_time() -> None:
    coarse = target("random_path", seed=7, sampling_time=10.0)
    fine = target("random_path", seed=7, sampling_time=0.1)
    record = fine.run(200 * SECOND, SECOND // 10)
    for time in (0, 50, 120, 200):
        y = at(coarse, time) if time else coarse.y
        assert (y["position"] == record["position"][10 * time]).all()
        assert (y["velocity"] == record["velocity"][10 * time]).all()


def test_random_path_ends_at_its_length() -> None:
    path = target("random_path", path_length=37.0, speed=1.0)
    record = path.run(60 * SECOND, SECOND // 20)
    gone = np.linalg.norm(np.diff(record["position"], axis=0), axis=1).sum()
    assert gone == pytest.approx(37, abs=0.1)
    assert gone <= 37 + 1e-9
    assert path.state("leg_end") > 37
    assert (path.y["velocity"] == 0).all()


def test_different_seeds_walk_different_random_paths() -> None:
    one, other = (target("random_path", seed=seed).y["position"] for seed in (1, 2))
    assert np.linalg.norm(one - other) > 0.1


def test_waypoints_are_visited_in_order_and_in_time() -> None:
    path = target("waypoints", waypoint=WAYPOINTS, speed=1.0)
    for time, point in ((10, 1), (15, 2), (28, 4)):
        np.testing.assert_allclose(at(path, time)["position"], WAYPOINTS[point], atol=1e-8)
    assert path.y["path_duration"] == 28


def test_the_last_leg_ends_at_the_last_waypoint_in_use() -> None:
    path = target("waypoints", waypoint=WAYPOINTS, speed=1.0)
    at(path, 40)
    assert path.state("cursor") == len(WAYPOINTS) - 1
    assert path.state("leg_end") == path.state("length") == 28


def test_all_waypoints_can_be_used() -> None:
    points = np.random.default_rng(3).uniform(-9, 9, (64, 3))
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    path = target("waypoints", waypoint=points, speed=2.0)
    assert path.y["path_duration"] == pytest.approx(length / 2, rel=1e-12)
    np.testing.assert_allclose(at(path, length / 2 + 1)["position"], points[-1], atol=1e-9)


def increments(q: float, T: float, n: int) -> np.ndarray[Any, Any]:
    """x_{k+1} − Φ x_k at the nodes, rows (position, velocity), all axes pooled."""
    path = target("white_noise_acceleration", sampling_time=T, acceleration_psd=q,
                  initial_velocity=[1, 0, 0])
    record = path.run(round(n * T * SECOND), round(T * SECOND))
    x, v = record["position"], record["velocity"]
    return np.stack([x[1:] - x[:-1] - T * v[:-1], v[1:] - v[:-1]], axis=-1).reshape(-1, 2)


@pytest.mark.parametrize(("q", "T"), [(0.01, 0.1), (0.3, 2.0)])
def test_increments_of_white_noise_acceleration_have_covariance_q(q: float, T: float) -> None:
    Q = q * np.array([[T**3 / 3, T**2 / 2], [T**2 / 2, T]])
    w = increments(q, T, 3000)
    n = len(w)
    S = w.T @ w / n
    # Wishart: the variance of an element of S is (Q_ii Q_jj + Q_ij²) / n
    bound = 4 * np.sqrt((np.outer(np.diag(Q), np.diag(Q)) + Q**2) / n)
    assert (np.abs(S - Q) < bound).all()
    assert (np.abs(w.mean(0)) < 4 * np.sqrt(np.diag(Q) / n)).all()
    whitened = np.linalg.solve(np.linalg.cholesky(Q), w.T)
    assert stats.kstest(whitened.ravel(), "norm").pvalue > 0.01


def test_increments_are_independent_from_node_to_node() -> None:
    w = increments(0.01, 0.1, 2000).reshape(2000, 3, 2)
    lag = (w[1:] * w[:-1]).mean((0, 1)) / w.var((0, 1))
    assert (np.abs(lag) < 4 / sqrt(6000)).all()


def test_white_noise_motion_starts_from_its_prior() -> None:
    runs = [target("white_noise_acceleration", seed=seed, initial_position=[1, 2, 3],
                   initial_position_std=0.5, initial_velocity=[0.1, 0.2, 0.3],
                   initial_velocity_std=0.2).y for seed in range(300)]
    position = (np.array([y["position"] for y in runs]) - [1, 2, 3]) / 0.5
    velocity = (np.array([y["velocity"] for y in runs]) - [0.1, 0.2, 0.3]) / 0.2
    for values in (position, velocity):
        assert stats.kstest(values.ravel(), "norm").pvalue > 0.01
    assert abs(np.corrcoef(position.ravel(), velocity.ravel())[0, 1]) < 4 / 30
    assert runs[0]["path_duration"] == 0


def test_white_noise_motion_does_not_depend_on_step_size() -> None:
    fine = target("white_noise_acceleration", seed=4).run(10 * SECOND, SECOND // 50)
    coarse = target("white_noise_acceleration", seed=4).run(10 * SECOND, SECOND * 5)
    for name in ("position", "velocity"):
        assert (coarse[name] == fine[name][::250]).all()


@pytest.mark.parametrize("shift_ns", [-1, 1])
def test_a_nanosecond_of_jitter_at_a_node_does_not_matter(shift_ns: int) -> None:
    exact, shifted = (target("white_noise_acceleration", seed=4) for _ in range(2))
    y = exact.step(0, 7 * SECOND)
    z = shifted.step(0, 7 * SECOND + shift_ns)
    np.testing.assert_allclose(z["position"], y["position"], atol=1e-8)
    assert shifted.counts == exact.counts == {"leg": 0, "node": 71}


def test_without_noise_white_noise_motion_is_uniform() -> None:
    path = target("white_noise_acceleration", noise=no_noise, initial_position=[0, 0, 0],
                  initial_velocity=[1, -2, 0.5])
    np.testing.assert_allclose(at(path, 12.34)["position"], [12.34, -24.68, 6.17], atol=1e-12)


def test_depth_readings_are_true_depth_plus_bias_plus_noise() -> None:
    path = target("straight_line", depth_start=2.0, depth_end=8.0, path_length=1000.0, speed=1.0,
                  depth_std=0.2, depth_bias=0.7)
    record = path.run(400 * SECOND, SECOND // 10)
    error = (record["depth"] - record["true_depth"])[2:]
    assert error.mean() == pytest.approx(0.7, abs=4 * 0.2 / sqrt(len(error)))
    assert stats.kstest(error, "norm", (0.7, 0.2)).pvalue > 0.01


@pytest.mark.parametrize("trajectory", TRAJECTORIES.values())
def test_what_a_run_adds_to_the_bias_is_scaled_and_stays(trajectory: str) -> None:
    others = numpy_noise(3)
    path = target(
        trajectory, depth_std=0.0, depth_bias=0.7, depth_bias_std=0.2,
        noise=lambda draw, count: 1.5 if draw.name == "depth_bias" else others(draw, count),
    )
    record = path.run(2 * SECOND, SECOND // 10)
    np.testing.assert_allclose((record["depth"] - record["true_depth"])[2:], 1.0, atol=1e-12)


def test_a_reading_belongs_to_the_tick_and_appears_in_the_step_that_contains_it() -> None:
    path = target("straight_line", noise=no_noise, depth_start=0.0, depth_end=150.0, speed=sqrt(2),
                  sampling_time=1.0)
    assert (path.y["depth"], path.y["depth_epoch"]) == (0, 0)
    y = path.step(0, SECOND)
    assert (y["depth"], y["depth_epoch"]) == (0, 0), "the tick at the end of a step is not in it"
    y = path.step(SECOND, SECOND // 2)
    assert y["depth_epoch"] == 1
    assert y["depth"] == y["true_depth"] == pytest.approx(1, abs=1e-12)
    y = path.step(3 * SECOND // 2, 3 * SECOND)
    assert y["depth_epoch"] == 4
    assert y["position"][2] == pytest.approx(4.5, abs=1e-12)


def test_before_the_first_reading_its_epoch_is_the_start_time() -> None:
    assert target("circle", start_ns=20 * SECOND).y["depth_epoch"] == 20


def test_equal_noise_gives_equal_readings() -> None:
    one, other = (target("circle", noise=numpy_noise(3)).run(5 * SECOND, SECOND // 10)
                  for _ in range(2))
    assert (one["depth"] == other["depth"]).all()
    assert one["depth"].std() > 0


@pytest.mark.parametrize("trajectory", TRAJECTORIES.values())
def test_outputs_are_finite_at_the_bounds_of_the_parameters(trajectory: str) -> None:
    component = model().component
    for bound in ("min", "max"):
        values = {
            v.name: getattr(v, bound) for v in component.of("parameter")
            if v.name not in ("trajectory", "sampling_time", "seed", "stream", "leg_length")
            and getattr(v, bound) not in (None, inf)
        }
        path = Stepper(model(), {
            "trajectory": NUMBER[trajectory],
            **{name: np.full(component[name].size, value) for name, value in values.items()},
        })
        y = at(path, 10)
        assert all(np.isfinite(value).all() for value in y.values()), bound
