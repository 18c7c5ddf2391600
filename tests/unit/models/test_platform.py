"""The platform's pose, its beacons, and each error of GPS and IMU by itself."""

from __future__ import annotations

from functools import cache
from importlib import resources
from itertools import pairwise
from math import cos, degrees, exp, pi, radians, sin, sqrt
from typing import Any

import casadi as ca
import numpy as np
import pytest
from sblcosim.models.arrangement import arms
from sblcosim.models.equations import Model
from sblcosim.models.geometry import rotation
from sblcosim.models.loading import load
from sblcosim.models.platform import gps
from sblcosim.models.platform.beaufort import LEVELS, sea_state
from sblcosim.models.platform.imu import GRADES, grade
from scipy import stats
from scipy.spatial.transform import Rotation
from stepper import Stepper, no_noise

SECOND = 10**9
TILT, HEADING = [0, 1], [2]


@pytest.mark.parametrize("count", range(3, 9))
def test_arms_divide_the_circle_and_the_first_points_forward(count: int) -> None:
    found, angle = np.array(arms(count)), 2 * pi * np.arange(count) / count
    np.testing.assert_allclose(found, np.column_stack([np.cos(angle), np.sin(angle)]), atol=1e-15)
    near = np.abs(found - np.rint(found)) < 1e-9
    assert (found[near] == np.rint(found[near])).all()  # zeros and ones are exact


@cache
def model() -> Model:
    return load("platform")


def platform(noise: Any = None, seed: int = 1, start_ns: int = 0, **parameters: Any) -> Stepper:
    return Stepper(model(), {"random_phases": False, **parameters}, noise=noise, seed=seed,
                   start_ns=start_ns)


def rotated(attitude: Any, points: Any) -> Any:
    """Body to NED by SciPy, for comparison."""
    roll, pitch, yaw = attitude
    return Rotation.from_euler("ZYX", [yaw, pitch, roll]).apply(points)


def attitude_error(stepper: Stepper) -> Any:
    return stepper.y["reported_attitude"] - stepper.y["attitude"]


def gps_error(stepper: Stepper) -> Any:
    return stepper.y["reported_position"] - stepper.y["position"]


# Geometry ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("attitude", "body", "ned"), [
    ((0, 0, pi / 2), (1, 0, 0), (0, 1, 0)),  # heading east: the bow points east
    ((0, pi / 2, 0), (1, 0, 0), (0, 0, -1)),  # pitch up: the bow points up
    ((pi / 2, 0, 0), (0, 1, 0), (0, 0, 1)),  # roll to starboard: starboard goes down
    ((pi / 2, 0, pi / 2), (0, 1, 0), (0, 0, 1)),  # yaw is applied last
])
def test_rotation_follows_the_ned_conventions(attitude: Any, body: Any, ned: Any) -> None:
    R = np.array(ca.DM(rotation(ca.DM(attitude))))
    np.testing.assert_allclose(R @ body, ned, atol=1e-15)


def test_rotation_is_that_of_scipy() -> None:
    for attitude in np.random.default_rng(1).uniform(-3, 3, (20, 3)):
        R = np.array(ca.DM(rotation(ca.DM(attitude))))
        np.testing.assert_allclose(R, rotated(attitude, np.eye(3)).T, atol=1e-14)


def test_beacons_of_a_level_platform_lie_on_the_cross() -> None:
    p = platform(arm_length=2.0, beacon_depth=0.5, mean_position=[10, 20, 1])
    expected = [[12, 20, 1.5], [10, 22, 1.5], [8, 20, 1.5], [10, 18, 1.5]]
    np.testing.assert_allclose(p.y["beacon_position"], expected, atol=1e-14)
    np.testing.assert_allclose(p.y["reported_beacon_position"], expected, atol=1e-14)


def test_mean_heading_turns_the_cross_clockwise() -> None:
    p = platform(arm_length=2.0, beacon_depth=0.0, mean_heading=pi / 2)
    np.testing.assert_allclose(p.y["beacon_position"][:, :2], [[0, 2], [-2, 0], [0, -2], [2, 0]],
                               atol=1e-14)


def test_pose_obeys_the_wave_equation_in_absolute_time() -> None:
    waves = {
        axis: (0.1 * (i + 1), 0.1 + 0.07 * i, 0.3 * i - 0.5)
        for i, axis in enumerate(("roll", "pitch", "yaw", "surge", "sway", "heave"))
    }
    parameters = {
        f"{axis}_{part}": value
        for axis, values in waves.items()
        for part, value in zip(("amplitude", "frequency", "phase"), values, strict=True)
    }
    start = 100.0
    p = platform(mean_position=[1, 2, 3], mean_heading=0.4, start_ns=100 * SECOND, **parameters)
    y = p.step(100 * SECOND, 12_345_678_901)
    t = start + 12.345678901
    w = [a * sin(2 * pi * f * t + phi) for a, f, phi in waves.values()]
    np.testing.assert_allclose(y["attitude"], [w[0], w[1], 0.4 + w[2]], atol=1e-12)
    np.testing.assert_allclose(y["position"], [1 + w[3], 2 + w[4], 3 + w[5]], atol=1e-12)
    body = np.array([[3, 0, 0.5], [0, 3, 0.5], [-3, 0, 0.5], [0, -3, 0.5]])
    np.testing.assert_allclose(y["beacon_position"], y["position"] + rotated(y["attitude"], body),
                               atol=1e-12)


def test_a_boat_is_at_its_track_by_the_time_since_any_start() -> None:
    track = {"track_count": 3, "track_time": [0.0, 4.0, 9.0], "departure_time": 1.5,
             "track": [[0.0, 0.0], [6.0, 2.0], [7.0, 9.0]], "random_phases": False}  # fmt: skip
    places = []
    for start in (0, 100 * SECOND, -30 * SECOND):
        boat = Stepper(load("platform", boat_points=3), track, noise=no_noise, start_ns=start)
        places.append([boat.step(start + k * SECOND, SECOND)["position"].copy()
                       for k in range(8)])  # fmt: skip
    assert np.ptp(places[0], axis=0)[0] > 5
    np.testing.assert_allclose(places[1:], [places[0]] * 2, atol=1e-9)


def test_random_phases_are_uniform_and_independent() -> None:
    phases = np.array([platform(seed=seed, random_phases=True).state("phase")
                       for seed in range(300)])
    assert stats.kstest(phases.ravel(), "uniform", (0, 2 * pi)).pvalue > 0.01
    assert (np.abs(np.corrcoef(phases.T) - np.eye(6)) < 4 / sqrt(300)).all()


def test_given_phases_are_used_when_phases_are_not_random() -> None:
    p = platform(roll_amplitude=0.2, roll_phase=0.9)
    assert p.y["attitude"][0] == pytest.approx(0.2 * sin(0.9), rel=1e-14)


def test_a_platform_without_errors_reports_the_truth() -> None:
    p = platform(random_phases=True, **sea_state(4), mean_heading=1.0)
    r = p.run(5 * SECOND, SECOND // 10)
    np.testing.assert_allclose(r["reported_beacon_position"], r["beacon_position"], atol=1e-14)
    np.testing.assert_allclose(r["reported_attitude"], r["attitude"], atol=1e-14)


def test_the_keys_of_a_spectrum_change_nothing_with_sines() -> None:
    """Nor do they cost anything: no number of the sea is in these equations, and none is drawn."""
    plain, other = (
        platform(random_phases=True, **sea_state(4), **keys).run(3 * SECOND, SECOND // 10)
        for keys in ({}, {"watch_circle": 3.0, "wave_spreading": 0.5, "raft_size": 9.0})
    )
    for name, values in plain.items():
        np.testing.assert_array_equal(values, other[name])
    names = [n for n, (rows, columns) in model().states.items() for _ in range(rows * columns)]
    for functions, used in zip(model().variants.values(), (False, True), strict=True):
        columns = {*functions.output.jac_sparsity(0, 0).get_col()}
        assert any(names[i].startswith(("wave_", "drift")) for i in columns) == used
    of_sea = [draw for draw in model().draws if draw.name.startswith(("wave", "drift", "first_d"))]
    assert len(of_sea) == 4
    assert {it for draw in of_sea for it in draw.scale} == {"motion", "watch_circle"}
    assert [*model().draws[-5:-1]] == of_sea  # last, so that the numbers of all others stay
    assert model().draws[-1].name == "misalignment"


# Installation ------------------------------------------------------------------------------------


def test_mounting_errors_move_the_true_beacons_in_the_body_frame_only() -> None:
    mounting = np.random.default_rng(2).normal(0, 0.1, (4, 3))
    attitude = (0.1, -0.2, 0.8)
    waves = dict(zip(("roll_amplitude", "pitch_amplitude"), (0.1, 0.2), strict=True))
    p = platform(mounting_error=mounting, mean_heading=0.8, roll_phase=pi / 2, pitch_phase=-pi / 2,
                 **waves)
    moved = p.y["beacon_position"] - p.y["reported_beacon_position"]
    np.testing.assert_allclose(moved, rotated(attitude, mounting), atol=1e-14)


def test_what_a_run_adds_to_the_mounting_is_scaled_and_stays() -> None:
    fixed = np.arange(12.0).reshape(4, 3)
    unit = np.linspace(-1, 1, 12)
    p = platform(lambda draw, _: unit if draw.name == "mounting" else np.zeros(draw.size),
                 mounting_error=fixed, mounting_std=0.5)
    for _ in range(2):
        moved = p.y["beacon_position"] - p.y["reported_beacon_position"]
        np.testing.assert_allclose(moved, fixed + 0.5 * unit.reshape(4, 3), atol=1e-14)
        p.step(p.t_ns, SECOND)


def test_antenna_offset_shifts_the_report_with_the_true_attitude() -> None:
    p = platform(gps_antenna_offset=[1.0, 0, -2.0], mean_heading=pi / 2, imu_heading_bias=0.3)
    np.testing.assert_allclose(gps_error(p), [0, 1, -2], atol=1e-14)


# GPS ---------------------------------------------------------------------------------------------


def test_white_gps_error_is_drawn_at_each_tick_and_held_between() -> None:
    p = platform(gps_horizontal_std=2.0, gps_vertical_std=0.5, sampling_time=1.0)
    r = p.run(2000 * SECOND, SECOND // 2)
    # The step that starts at a tick, row 2k, makes the draw: it is in rows 2k + 1 and 2k + 2.
    held = (r["reported_position"] - r["position"])[3:-2].reshape(-1, 2, 3)
    assert (held[:, 0] == held[:, 1]).all()
    draws = held[:, 0] / [2.0, 2.0, 0.5]
    assert stats.kstest(draws.ravel(), "norm").pvalue > 0.01
    n = len(draws)
    assert (np.abs(np.corrcoef(draws.T) - np.eye(3)) < 4 / sqrt(n)).all()
    assert (np.abs((draws[1:] * draws[:-1]).mean(0)) < 4 / sqrt(n)).all()


def test_there_is_a_gps_error_from_the_start() -> None:
    assert (gps_error(platform(gps_horizontal_std=2.0))[:2] != 0).all()


def test_gps_bias_is_constant_in_a_run_and_normal_over_runs() -> None:
    p = platform(gps_horizontal_bias_std=3.0, gps_vertical_bias_std=1.0)
    first = gps_error(p)
    p.run(10 * SECOND, SECOND)
    np.testing.assert_allclose(gps_error(p), first, atol=1e-13)
    runs = [gps_error(platform(gps_horizontal_bias_std=3.0, gps_vertical_bias_std=1.0, seed=seed))
            for seed in range(300)]
    assert stats.kstest((np.array(runs) / [3, 3, 1]).ravel(), "norm").pvalue > 0.01


def autocorrelation(x: Any, lag: int) -> Any:
    return (x[lag:] * x[:-lag]).mean(0) / (x * x).mean(0)


def test_gauss_markov_errors_have_their_deviation_and_correlation_time() -> None:
    tau, T, n = 5.0, 1.0, 20_000
    p = platform(gps_horizontal_markov_std=1.5, gps_vertical_markov_std=0.7,
                 imu_tilt_markov_std=0.02, imu_heading_markov_std=0.05,
                 gps_correlation_time=tau, imu_correlation_time=2 * tau, sampling_time=T)
    r = p.run(n * SECOND, SECOND)
    errors = np.hstack([r["reported_position"] - r["position"],
                        r["reported_attitude"] - r["attitude"]])[1:]
    stds = np.array([1.5, 1.5, 0.7, 0.02, 0.02, 0.05])
    for columns, time in ((slice(0, 3), tau), (slice(3, 6), 2 * tau)):
        x, phi = errors[:, columns], exp(-T / time)
        # Bartlett: relative standard deviation of a variance estimate, and of a correlation.
        relative = sqrt(2 * (1 + phi**2) / (1 - phi**2) / n)
        np.testing.assert_allclose(x.var(0), stds[columns] ** 2, rtol=4 * relative)
        np.testing.assert_allclose(autocorrelation(x, 1), phi, atol=4 * sqrt((1 - phi**2) / n))
        np.testing.assert_allclose(autocorrelation(x, 5), phi**5, atol=4 * relative)
    assert (np.abs(np.corrcoef(errors.T) - np.eye(6)) < 0.15).all()


def test_gauss_markov_errors_are_stationary_from_the_start() -> None:
    parameters = {"gps_horizontal_markov_std": 1.5, "gps_vertical_markov_std": 1.5}
    runs = [gps_error(platform(seed=seed, **parameters)) for seed in range(300)]
    assert stats.kstest(np.ravel(runs) / 1.5, "norm").pvalue > 0.01


def test_gauss_markov_decay_belongs_to_the_sampling_time() -> None:
    def noise(draw: Any, count: int) -> Any:
        return np.full(draw.size, 1.0 if draw.occasion == "initial" else 0.0)

    p = platform(noise=noise, gps_horizontal_markov_std=2.0, gps_correlation_time=3.0,
                 sampling_time=0.5)
    p.run(4 * SECOND, SECOND)  # ticks at 0.5 … 3.5 s
    assert gps_error(p)[0] == pytest.approx(2 * exp(-3.5 / 3), rel=1e-12)


# IMU ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("angle", "axes"), [("tilt", TILT), ("heading", HEADING)])
@pytest.mark.parametrize("part", ["bias", "drift", "temperature", "step"])
def test_each_deterministic_imu_error_follows_its_law(part: str, angle: str, axes: list[int]
                                                      ) -> None:
    parameters, law = {
        "bias": ({f"imu_{angle}_bias": 0.1}, lambda s: 0.1),
        "drift": ({f"imu_{angle}_drift": -0.002}, lambda s: -0.002 * s),
        "temperature": (
            {f"imu_{angle}_temperature_coefficient": 0.01, "imu_temperature_offset": -4.0,
             "imu_temperature_rate": 0.5}, lambda s: 0.01 * (-4 + 0.5 * s)),
        "step": ({f"imu_{angle}_step": 0.2, "imu_step_time": 7.0}, lambda s: 0.2 * (s >= 7)),
    }[part]
    p = platform(start_ns=50 * SECOND, sampling_time=1.0, **parameters)
    others = [i for i in range(3) if i not in axes]
    for since in (0.0, 6.999, 7.0, 20.25):
        if since:
            p.step(p.t_ns, round((50 + since) * SECOND) - p.t_ns)
        error = attitude_error(p)
        np.testing.assert_allclose(error[axes], law(since), atol=1e-12)
        assert (error[others] == 0).all()


def test_run_to_run_imu_error_differs_between_runs_and_axes_only() -> None:
    parameters = {"imu_tilt_turn_on_std": 0.02, "imu_heading_turn_on_std": 0.1}
    p = platform(**parameters)
    first = attitude_error(p)
    p.run(5 * SECOND, SECOND)
    np.testing.assert_allclose(attitude_error(p), first, atol=1e-15)
    runs = np.array([attitude_error(platform(seed=s, **parameters)) for s in range(300)])
    scaled = runs / [0.02, 0.02, 0.1]
    assert stats.kstest(scaled.ravel(), "norm").pvalue > 0.01
    assert (np.abs(np.corrcoef(scaled.T) - np.eye(3)) < 4 / sqrt(300)).all()


def test_white_imu_error_is_drawn_at_each_tick() -> None:
    p = platform(imu_tilt_std=0.02, imu_heading_std=0.1, sampling_time=1.0)
    r = p.run(2000 * SECOND, SECOND)
    draws = (r["reported_attitude"] - r["attitude"])[2:] / [0.02, 0.02, 0.1]
    assert stats.kstest(draws.ravel(), "norm").pvalue > 0.01
    assert (np.abs(autocorrelation(draws, 1)) < 4 / sqrt(len(draws))).all()
    assert (np.abs(np.corrcoef(draws.T) - np.eye(3)) < 4 / sqrt(len(draws))).all()


def tilted(**parameters: Any) -> Stepper:
    """Roll 0.1, pitch -0.2, yaw 0.3 on a mean heading of 1 rad."""
    return platform(mean_heading=1.0, roll_amplitude=0.1, pitch_amplitude=0.2, yaw_amplitude=0.3,
                    roll_phase=pi / 2, pitch_phase=-pi / 2, yaw_phase=pi / 2, **parameters)


def test_scale_factor_acts_on_the_deviation_from_the_mean_attitude() -> None:
    p = tilted(imu_tilt_scale_factor_error=0.05, imu_heading_scale_factor_error=-0.1)
    np.testing.assert_allclose(attitude_error(p), [0.005, -0.01, -0.03], atol=1e-15)


def test_misalignment_couples_the_axes_to_first_order() -> None:
    epsilon, inclination = 1e-4 * np.array([3, 1, 2]), np.array([0.1, -0.2, 0.3])
    p = tilted(imu_misalignment=epsilon)
    np.testing.assert_allclose(attitude_error(p), -np.cross(epsilon, inclination), atol=1e-15)
    # Components of a vector along axes turned by ε:
    turned = Rotation.from_rotvec(epsilon).inv().apply(inclination)
    np.testing.assert_allclose(p.y["reported_attitude"] - [0, 0, 1], turned, atol=1e-8)


def test_reported_beacons_follow_from_reported_position_and_attitude() -> None:
    p = tilted(gps_horizontal_std=1.0, gps_vertical_std=1.0, imu_tilt_std=0.1, imu_heading_std=0.2,
               arm_length=2.0, beacon_depth=0.7)
    p.run(2 * SECOND, SECOND // 10)
    body = [[2, 0, 0.7], [0, 2, 0.7], [-2, 0, 0.7], [0, -2, 0.7]]
    np.testing.assert_allclose(
        p.y["reported_beacon_position"],
        p.y["reported_position"] + rotated(p.y["reported_attitude"], body), atol=1e-13)
    assert np.linalg.norm(p.y["reported_beacon_position"] - p.y["beacon_position"]) > 0.1


def test_heading_error_shifts_a_beacon_sideways() -> None:
    p = platform(noise=no_noise, imu_heading_bias=0.2, beacon_depth=0.0)
    np.testing.assert_allclose(p.y["reported_beacon_position"][0], [3 * cos(0.2), 3 * sin(0.2), 0],
                               atol=1e-14)


def test_errors_do_not_depend_on_step_size() -> None:
    parameters = {"gps_horizontal_std": 1.0, "gps_horizontal_markov_std": 1.0,
                  "imu_tilt_std": 0.1, "random_phases": True, "roll_amplitude": 0.1}
    fine = platform(**parameters).run(10 * SECOND, SECOND // 50)
    coarse = platform(**parameters).run(10 * SECOND, 2 * SECOND)
    for name in ("reported_beacon_position", "beacon_position"):
        assert (coarse[name] == fine[name][::100]).all()


# Presets -----------------------------------------------------------------------------------------


def test_wave_heights_match_the_papers_anchors_and_grow() -> None:
    assert LEVELS[2].wave_height == 0.2
    assert LEVELS[4].wave_height == 1.0
    assert sorted(LEVELS) == list(range(7))
    for calm, rough in pairwise(LEVELS[i] for i in range(7)):
        assert calm.wave_height < rough.wave_height
        assert calm.period < rough.period
        assert calm.slope_rms < rough.slope_rms


def raft_slope_rms(wave_height: float) -> float:
    """RMS slope in deg between the ends of a raft of 1.6 m, 0.1 m deep, in a long-crested sea.

    Pierson-Moskowitz spectrum by H_s and T_p; waves shorter than the raft average out (sinc), and
    decay with depth.
    """
    w = np.linspace(0.05, 40, 200_000)
    k = w**2 / 9.81
    w_p = 2 * pi / (5.0 * sqrt(wave_height))
    spectrum = 5 / 16 * wave_height**2 * w_p**4 / w**5 * np.exp(-1.25 * (w_p / w) ** 4)
    response = k * np.sinc(k * 0.8 / pi) * np.exp(-k * 0.1)
    return degrees(sqrt(np.trapezoid(spectrum * response**2, w)))


@pytest.mark.parametrize("beaufort", range(1, 7))
def test_slopes_are_those_of_a_raft_in_a_fully_developed_sea(beaufort: int) -> None:
    level = LEVELS[beaufort]
    assert degrees(level.slope_rms) == pytest.approx(raft_slope_rms(level.wave_height), abs=0.06)


def test_presets_name_parameters_of_the_platform_within_their_bounds() -> None:
    component = model().component
    presets = (*map(sea_state, LEVELS), *map(grade, GRADES), *map(gps.grade, gps.GRADES))
    for preset in presets:
        for name, value in preset.items():
            variable = component[name]
            assert variable.causality == "parameter"
            assert (variable.min is None or value >= variable.min)
            assert (variable.max is None or value <= variable.max)


def test_sea_state_gives_sinusoids_with_the_rms_of_slope_and_surface() -> None:
    p = platform(**sea_state(4))
    r = p.run(500 * SECOND, SECOND // 4)
    assert r["attitude"][:, 0].std() == pytest.approx(LEVELS[4].slope_rms, rel=0.01)
    assert 4 * r["position"][:, 2].std() == pytest.approx(1.0, rel=0.01)


def test_calm_is_still() -> None:
    r = platform(random_phases=True, **sea_state(0)).run(2 * SECOND, SECOND // 10)
    assert (r["attitude"] == 0).all()
    assert (r["position"] == 0).all()


def test_grades_are_table_1_of_the_paper() -> None:
    # columns of the table: mg, m/s², deg/h, rad/s, the lower end of each range
    table = {"marine": (0.01, 1e-4, 0.001, 5e-9), "aviation": (0.03, 3e-4, 0.01, 5e-8),
             "intermediate": (0.1, 1e-3, 0.1, 5e-7), "tactical": (1, 0.01, 1, 5e-6),
             "consumer": (3, 0.03, 100, 5e-4)}
    for name, (mg, acceleration, deg_h, rad_s) in table.items():
        row = GRADES[name]
        assert (row.accelerometer_bias, row.gyro_bias) == (mg, deg_h)
        # the two printed units agree, to the one digit of the table
        assert row.tilt_bias * 9.80665 == pytest.approx(acceleration, rel=0.05)
        assert row.heading_drift == pytest.approx(rad_s, rel=0.05)


def test_tactical_heading_drifts_by_a_degree_per_hour() -> None:
    p = platform(sampling_time=100.0, **grade("tactical"))
    p.step(0, 3600 * SECOND)
    assert attitude_error(p)[2] == pytest.approx(radians(1), rel=1e-9)
    assert attitude_error(p)[0] == pytest.approx(1e-3)


@pytest.mark.parametrize("name", gps.GRADES)
def test_the_parts_of_a_gps_grade_make_up_the_published_error(name: str) -> None:
    chosen, set_ = gps.GRADES[name], gps.grade(name)
    assert chosen.white + chosen.markov + chosen.bias == pytest.approx(1)
    for axis, std in (("horizontal", chosen.horizontal), ("vertical", chosen.vertical)):
        parts = [set_[f"gps_{axis}_{part}"] for part in ("std", "markov_std", "bias_std")]
        assert np.linalg.norm(parts) == pytest.approx(std, rel=3e-4)
    assert set(set_) == {name for name in (v.name for v in model().component.of("parameter"))
                         if name.startswith("gps_")} - {"gps_antenna_offset", "gps_shared"}


def test_gps_grades_are_the_published_numbers() -> None:
    """95 % of the length of two unit normals is the square root of chi-squared's."""
    radial = sqrt(stats.chi2.ppf(0.95, 2))
    normal = stats.norm.ppf(0.975)
    published = {
        "standalone": (3 / radial, 4 / normal), "sbas": (1.062 / radial, 1.790 / normal),
        "differential": (0.5 / sqrt(2), 0.75), "rtk_float": (0.2 / sqrt(2), 0.4 / sqrt(2)),
        "rtk_fixed": (0.01 / sqrt(2), 0.02),
    }
    for name, each in published.items():
        assert (gps.GRADES[name].horizontal, gps.GRADES[name].vertical) == pytest.approx(each)


def test_readme_shows_the_gps_grades_of_the_code() -> None:
    readme = (resources.files("sblcosim.models.platform") / "README.md").read_text("utf-8")
    shown = [name for name in gps.GRADES if f"| `{name}` |" in readme]
    assert len(shown) >= 5
    for name in shown:
        chosen = gps.GRADES[name]
        assert f"| `{name}` | {chosen.horizontal:.3g} | {chosen.vertical:.3g} |" in readme
        s = gps.grade(name)
        parts = " | ".join(
            f"{s[f'gps_horizontal_{part}']:g} / {s[f'gps_vertical_{part}']:g}"
            for part in ("std", "markov_std", "bias_std")
        )
        row = [line for line in readme.splitlines() if f"`{name}` | {parts}" in line]
        assert len(row) == 1
        assert row[0].endswith(f"| {chosen.correlation_time:g} |")


@pytest.mark.parametrize("preset", [
    lambda: sea_state(7), lambda: grade("toy"), lambda: gps.grade("toy"),
])
def test_unknown_presets_are_key_errors(preset: Any) -> None:
    with pytest.raises(KeyError):
        preset()


def test_readme_shows_the_sea_states_of_the_code() -> None:
    readme = (resources.files("sblcosim.models.platform") / "README.md").read_text("utf-8")
    for beaufort, level in LEVELS.items():
        period = f"{level.period:.1f}" if beaufort else "–"
        slope, angle = degrees(level.slope_rms), degrees(level.angle_amplitude)
        assert (
            f"| {beaufort} | {level.wave_height or 0} | {period} | {slope:.2g} | {angle:.2g} | "
            f"{level.heave_amplitude:{'.2f' if beaufort else '.0f'}} |"
        ) in readme


def test_parts_of_the_errors_are_independent() -> None:
    parts = [f"{sensor}_std" for sensor in (
        "gps_horizontal", "gps_horizontal_bias", "gps_horizontal_markov",
        "imu_tilt", "imu_tilt_turn_on", "imu_tilt_markov")]
    for seconds in (0, 2):
        sums = []
        for seed in range(300):
            p = platform(seed=seed, gps_correlation_time=1.0, imu_correlation_time=1.0,
                         sampling_time=1.0, **dict.fromkeys(parts, 1.0))
            p.run(seconds * SECOND, SECOND)
            sums.append([*gps_error(p)[:2], *attitude_error(p)[:2]])
        # Three independent parts of variance 1; 1200 samples.
        assert np.var(sums) == pytest.approx(3, rel=4 * sqrt(2 / 1200))
