"""Errors that a run draws once: as large as configured, independent, and without them the old bits.

The seeds are fixed. A right implementation misses a bound with a probability of about 1e-4.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from itertools import combinations
from math import sqrt
from typing import Any

import numpy as np
import pytest
import sblcosim
from numpy.typing import NDArray
from sblcosim.models.acoustics import clock
from sblcosim.models.platform import gps
from sblcosim.results.sums import responses
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters.lanes import execute
from sblcosim.simulation.resolve import resolve
from scipy import stats

pytestmark = pytest.mark.filterwarnings("ignore::sblcosim.errors.NoEffectWarning")
Floats = NDArray[np.float64]
COMPONENTS = ("target", "platform", "acoustics")
RUNS = 2000
RISK = 1e-4
QUIET: Mapping[str, Any] = {
    "time": {"sampling_time_s": 1.0, "duration_s": 21.0},
    "target": {"speed_m_s": 0.0, "depth_std_m": 0.0},
    "acoustics": {"range_std_m": 0.0},
    "receiver": {"type": "ekf"},
}
"""Nothing moves and nothing is noisy."""


def records(changes: Mapping[str, Any], *names: str, runs: int = RUNS) -> dict[str, Floats]:
    """Outputs of many runs, each with its own seed: first axis the run, second the time."""
    plan = resolve(connect(sblcosim.load(QUIET, changes.items())))
    seeds = {f"{name}.seed": np.arange(1, runs + 1) for name in COMPONENTS}
    outcome = execute(plan, seeds, record=names)
    return {name: outcome.values[name] for name in names}


def assert_normal(sample: Floats, std: float, mean: float = 0.0) -> None:
    """Independent normals of this mean and standard deviation."""
    low, high = stats.chi2.interval(1 - RISK, sample.size)
    assert low < ((sample - mean) ** 2).sum() / std**2 < high
    assert abs(sample.mean() - mean) < stats.norm.isf(RISK / 2) * std / sqrt(sample.size)
    assert stats.kstest((sample - mean) / std, "norm").pvalue > RISK


def assert_independent(*samples: Floats) -> None:
    pairs = list(combinations(samples, 2))
    bound = stats.norm.isf(RISK / 2 / len(pairs)) / sqrt(len(samples[0]))
    for one, other in pairs:
        assert abs(np.corrcoef(one, other)[0, 1]) < bound


def clocks(changes: Mapping[str, Any]) -> tuple[Floats, Floats]:
    """Offset at the start [s] and drift [s/s] of each run's clock, from the ranges."""
    names = ("range", "true_range", "range_epoch", "reception_count")
    values = records(changes, *(f"acoustics.{name}" for name in names))
    error, epoch = (
        (values["acoustics.range"] - values["acoustics.true_range"]) / 1500.0,
        values["acoustics.range_epoch"],
    )
    heard = np.flatnonzero(values["acoustics.reception_count"][0, :, 0] > 0)
    first, last = heard[0], heard[-1]
    elapsed = epoch[:, last, 0] - epoch[:, first, 0]
    drift = (error[:, last, 0] - error[:, first, 0]) / elapsed
    offset = error[:, first, 0] - drift * epoch[:, first, 0]
    # All beacons at all times lie on that line.
    line = offset[:, None, None] + drift[:, None, None] * epoch[:, heard[3] :]
    np.testing.assert_allclose(error[:, heard[3] :], line, atol=1e-14)
    return offset, drift


def test_offset_and_drift_of_the_clock_are_drawn_for_each_run() -> None:
    offset, drift = clocks({
        "acoustics.clock_offset_s": -2e-4, "acoustics.clock_offset_std_s": 3e-4,
        "acoustics.clock_drift_s_s": 1e-6, "acoustics.clock_drift_std_s_s": 2e-6,
    })
    assert_normal(offset, 3e-4, -2e-4)
    assert_normal(drift, 2e-6, 1e-6)
    assert_independent(offset, drift)


def test_the_clock_has_drifted_since_it_was_synchronised() -> None:
    age = 1800.0
    offset, drift = clocks({
        "acoustics.clock_offset_s": 5e-5, "acoustics.clock_drift_s_s": 1e-6,
        "acoustics.clock_drift_std_s_s": 2e-6, "acoustics.clock_sync_age_s": age,
    })
    assert_normal(drift, 2e-6, 1e-6)
    np.testing.assert_allclose(offset, 5e-5 + drift * age, atol=1e-11)


@pytest.mark.parametrize("grade", clock.GRADES)
def test_a_clock_is_as_good_as_its_grade(grade: str) -> None:
    age = 3600.0
    offset, _ = clocks({"acoustics.clock_grade": grade, "acoustics.clock_sync_age_s": age})
    assert_normal(offset, clock.GRADES[grade] * age)


def test_the_bias_of_the_depth_sensor_is_drawn_for_each_run() -> None:
    values = records({"target.depth_bias_m": 0.1, "target.depth_bias_std_m": 0.3},
                     "target.depth", "target.true_depth")
    bias = (values["target.depth"] - values["target.true_depth"])[:, 2:]
    assert (bias == bias[:, :1]).all()
    assert_normal(bias[:, 0], 0.3, 0.1)


@pytest.mark.parametrize("trajectory", ["random_path", "white_noise_acceleration", "circle"])
def test_every_trajectory_has_that_bias(trajectory: str) -> None:
    values = records({"target.trajectory": trajectory, "target.depth_bias_std_m": 0.3},
                     "target.depth", "target.true_depth")
    bias = (values["target.depth"] - values["target.true_depth"])[:, 2]
    assert_normal(bias, 0.3)


def test_beacons_are_mounted_anew_for_each_run() -> None:
    fixed = 0.05 * np.arange(12).reshape(4, 3)
    values = records(
        {"platform.mounting_std_m": 0.2, "platform.mounting_error_m": fixed.tolist()},
        "platform.beacon_position", "platform.reported_beacon_position",
    )
    error = values["platform.beacon_position"] - values["platform.reported_beacon_position"]
    np.testing.assert_allclose(error, np.broadcast_to(error[:, :1], error.shape), atol=1e-14)
    drawn = error[:, 0].reshape(RUNS, -1)
    for i, mean in enumerate(fixed.ravel()):
        assert_normal(drawn[:, i], 0.2, mean)
    assert_independent(*drawn.T)


@pytest.mark.parametrize("shared", [True, False], ids=["one GPS", "buoys"])
def test_bias_wander_and_first_draw_of_a_gps_are_independent(shared: bool) -> None:
    """Parts that are alone, on the same seeds: each as large as configured, none like another.

    Of buoys, each has its own, so none is like that of another buoy or axis either.
    """
    where = "reported_position" if shared else "reported_beacon_position"
    true = "position" if shared else "beacon_position"
    samples: list[Floats] = []
    for part, (horizontal, vertical) in {
        "bias_std": (0.7, 1.3), "std": (0.5, 2.0), "markov_std": (1.1, 0.3),
    }.items():
        values = records(
            {
                "platform.gps_shared": shared, "platform.gps_horizontal_std_m": 0.0,
                "platform.gps_vertical_std_m": 0.0,
                f"platform.gps_horizontal_{part}_m": horizontal,
                f"platform.gps_vertical_{part}_m": vertical,
            },
            f"platform.{where}", f"platform.{true}",
        )
        error = (values[f"platform.{where}"] - values[f"platform.{true}"]).reshape(RUNS, 22, -1, 3)
        for beacon in range(error.shape[2]):
            for axis, std in enumerate((horizontal, horizontal, vertical)):
                mine = error[:, :, beacon, axis]
                assert_normal(mine[:, 0], std)
                samples.append(mine[:, 0])
                if part == "bias_std":
                    np.testing.assert_allclose(mine, mine[:, :1] + 0 * mine, atol=1e-12)
                if part == "std":
                    samples.append(mine[:, 5])
    assert_independent(*samples)


@pytest.mark.parametrize("grade", gps.GRADES)
def test_a_position_is_as_good_as_its_grade(grade: str) -> None:
    values = records({"platform.gps_grade": grade}, "platform.position",
                     "platform.reported_position")
    error = values["platform.reported_position"] - values["platform.position"]
    wanted = gps.GRADES[grade]
    for axis, std in enumerate((wanted.horizontal, wanted.horizontal, wanted.vertical)):
        # The parts are rounded to four digits, which is far below what 2000 runs can tell.
        assert_normal(error[:, 0, axis], std)
        assert_normal(error[:, -1, axis], std)


def test_they_are_independent_of_each_other_and_of_what_was_drawn_before() -> None:
    values = records(
        {
            "target.depth_bias_std_m": 1.0, "target.depth_std_m": 1.0,
            "target.trajectory": "white_noise_acceleration", "target.initial_position_std_m": 1.0,
            "target.initial_velocity_std_m_s": 1.0, "target.acceleration_psd_m2_s3": 0.0,
            "platform.mounting_std_m": 1.0, "platform.gps_horizontal_bias_std_m": 1.0,
            "platform.imu_heading_turn_on_std_deg": 1e-3, "platform.imu_tilt_std_deg": 1e-3,
            "acoustics.clock_offset_std_s": 1e-3, "acoustics.range_std_m": 1e-3,
        },
        "target.depth", "target.true_depth", "target.position", "target.velocity",
        "platform.beacon_position", "platform.position", "platform.reported_position",
        "platform.reported_attitude", "platform.attitude", "acoustics.range",
        "acoustics.true_range",
    )
    depth = values["target.depth"] - values["target.true_depth"]
    ranges = values["acoustics.range"] - values["acoustics.true_range"]
    samples = [
        depth[:, 3:].mean(axis=1), ranges[:, 5:, 0].mean(axis=1), depth[:, 3] - depth[:, 4],
        *values["target.position"][:, 0].T, *values["target.velocity"][:, 0].T,
        *(values["platform.beacon_position"] - values["platform.position"][:, :, None])[
            :, 0].reshape(RUNS, -1).T,
        *(values["platform.reported_position"] - values["platform.position"])[:, 0, :2].T,
        *(values["platform.reported_attitude"] - values["platform.attitude"])[:, 0].T,
    ]
    assert_independent(*samples)


def test_a_seed_draws_the_same_numbers_whatever_their_size() -> None:
    once, thrice = (
        records({"target.depth_bias_std_m": std}, "target.depth", "target.true_depth", runs=20)
        for std in (0.1, 0.3)
    )
    errors = [(v["target.depth"] - v["target.true_depth"])[:, 2] for v in (once, thrice)]
    np.testing.assert_allclose(errors[1], 3 * errors[0], rtol=1e-12)
    again = records({"target.depth_bias_std_m": 0.1}, "target.depth", runs=20)
    assert (again["target.depth"] == once["target.depth"]).all()


def test_a_receiver_that_is_told_of_a_drawn_clock_knows_how_wrong_it_is() -> None:
    """A clock half an hour after its synchronisation; the mean NEES of a position should be 3."""
    dive = sblcosim.load("realistic-dive", {
        "acoustics.clock_offset_s": 0.0, "acoustics.clock_grade": "tcxo",
        "acoustics.clock_sync_age_s": 1800.0,
        "target.depth_bias_m": 0.0, "target.depth_bias_std_m": 0.3,
    })
    assert dive.receiver.clock_std_m == pytest.approx(1.35)
    assert dive.receiver.depth_bias_std_m == pytest.approx(0.3)
    seeds = {f"{name}.seed": np.arange(1, 51) for name in COMPONENTS}
    found = []
    for scenario in (dive, dive.override({
        "receiver.clock_std_m": 0.01, "receiver.clock_walk_psd_m2_s": 0.0,
        "receiver.depth_bias_std_m": 0.0,
    })):
        plan = resolve(connect(scenario))
        sums = execute(plan, seeds).sums["coupled"]
        found.append(float(responses(sums, plan.stop_ns - plan.start_ns).nees_position.mean()))
    told, untold = found
    print(f"NEES {told:.2f}; untold {untold:.2f}")
    assert 2.0 < told < 3.3
    assert untold > 2 * told


OLD: Mapping[str, Any] = {
    "time.duration_s": 20.0,
    "platform.mounting_error_m": (0.01 * np.arange(12).reshape(4, 3)).tolist(),
    "platform.gps_horizontal_bias_std_m": 0.3, "platform.imu_heading_turn_on_std_deg": 1.0,
    "platform.gps_vertical_markov_std_m": 0.4, "platform.imu_tilt_std_deg": 0.3,
    "acoustics.clock_offset_s": 1e-3, "acoustics.clock_drift_s_s": -1e-5,
    "acoustics.outlier_probability": 0.1, "acoustics.loss_probability": 0.2,
    "target.depth_bias_m": 0.07,
}
RECORDED = {
    "semicircle": "21d20dacafbe898db0bdc7b240fb30c01b88e311f0a5301c5222f046103b29f2",
    "random_path": "63f1a9c3cc713323a5a072c51d1b0aef7ad58945a3f8f72ea6756f215b06fa89",
    "white_noise_acceleration": "3179a85eff3d944b233cf628a3502c6134366336b3084e6b1f8db78bf99a1324",
}
"""SHA-256 of the record with these errors before anything else could be drawn for a run."""


@pytest.mark.parametrize("trajectory", RECORDED)
def test_what_is_not_drawn_leaves_every_bit_as_it_was(trajectory: str) -> None:
    scenario = sblcosim.load("paper-scenario-1",
                             {**OLD, "target.trajectory": trajectory, "receiver.prior": None})
    plan = resolve(connect(scenario))
    names = sorted(c.name for c in plan.columns if c.name.startswith(COMPONENTS))
    values = execute(plan, {}, record=names).record(0).values
    digest = hashlib.sha256()
    for name in names:
        digest.update(name.encode() + np.ascontiguousarray(values[name]).tobytes())
    assert digest.hexdigest() == RECORDED[trajectory]
