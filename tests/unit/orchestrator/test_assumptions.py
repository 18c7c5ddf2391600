"""What `coupled` assumes of the system follows from the scenario's own values."""

from __future__ import annotations

import re
import tomllib
import warnings
from math import hypot, pi, sqrt
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sblcosim
from sblcosim.fmus.build.factory import build
from sblcosim.limits import echoes
from sblcosim.models import COMPONENTS, RECEIVERS
from sblcosim.models.receiver.receivers.array import COMPONENT as ARRAY
from sblcosim.models.receiver.receivers.coupled import COMPONENT as COUPLED
from sblcosim.models.receiver.receivers.long_baseline import COMPONENT as LONG_BASELINE
from sblcosim.models.settings import paths
from sblcosim.models.settings.assumptions import SOURCES, rounding
from sblcosim.models.target.variables import TRAJECTORIES
from sblcosim.scenario.scenario import load, shipped
from sblcosim.scenario.sources import choice_of
from sblcosim.scenario.wiring import applied, connect

COUPLED_KEYS = {v.key for v in COUPLED.of("parameter")}
ARRAY_KEYS = {v.key for v in ARRAY.of("parameter")}
KEYS = COUPLED_KEYS | ARRAY_KEYS | {v.key for v in LONG_BASELINE.of("parameter")}
README = Path(__file__).parents[3] / "models" / "receiver" / "README.md"

FOLLOWS: list[tuple[dict[str, Any], str, Any]] = [
    ({"acoustics.range_std_m": 0.7}, "range_std_m", 0.7),
    ({"acoustics.range_std_m": 0.3, "platform.mounting_std_m": 0.1, "acoustics.schedule":
      "simultaneous", "time.sampling_time_s": 0.5}, "range_std_m", hypot(0.3, 0.1 * sqrt(40))),
    ({"platform.mounting_std_m": 0.1, "time.sampling_time_s": 0.5}, "range_std_m",
     0.1 * sqrt(1 + 10)),
    ({"platform.mounting_std_m": 0.1, "platform.beacon_m": ((1, 2, 3), (4, 5, 6), (-1, 0, 1)),
      "time.sampling_time_s": 20.0}, "range_std_m", 0.1 * sqrt(2)),
    ({"platform.mounting_error_m": ((0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1), (0, 0, 0.3)),
      "time.sampling_time_s": 5.0}, "range_std_m", sqrt(0.01 + 0.01)),
    ({"platform.mounting_std_m": 0.1, "platform.gps_shared": False}, "range_std_m", 0.1),
    ({"target.depth_std_m": 0.3}, "depth_std_m", 0.3),
    ({"platform.arm_length_m": 0.4, "platform.beacon_depth_m": 0.9}, "beacon_offset_m",
     (0.4, 0, 0.9, 0, 0.4, 0.9, -0.4, 0, 0.9, 0, -0.4, 0.9)),
    ({"platform.gps_horizontal_std_m": 1.7}, "gps_std_m", 1.7),
    ({"platform.gps_horizontal_markov_std_m": 1.3}, "gps_markov_std_m", 1.3),
    ({"platform.gps_correlation_time_s": 33.0}, "gps_correlation_time_s", 33.0),
    ({"platform.gps_horizontal_bias_std_m": 0.8}, "gps_bias_std_m", 0.8),
    ({"platform.gps_antenna_offset_m": (0.3, -0.4, 0.6)}, "gps_bias_std_m", 0.5 / sqrt(2)),
    ({"platform.gps_antenna_offset_m": (0.3, -0.4, 0.6)}, "gps_vertical_error_std_m", 0.6),
    ({"platform.gps_vertical_std_m": 0.2}, "gps_vertical_std_m", 0.2),
    ({"platform.gps_antenna_offset_m": (0.0, 0.0, 0.2), "platform.gps_vertical_markov_std_m": 0.3,
      "platform.gps_vertical_bias_std_m": 0.6}, "gps_vertical_error_std_m", 0.7),
    ({"platform.gps_vertical_bias_std_m": 0.6}, "gps_vertical_error_time_s", 1e6),
    ({"platform.gps_vertical_markov_std_m": 0.3, "platform.gps_vertical_bias_std_m": 0.4,
      "platform.gps_correlation_time_s": 90.0}, "gps_vertical_error_time_s", 250.0),
    ({"platform.surge_amplitude_m": 2.0, "platform.surge_frequency_Hz": 0.1,
      "platform.sway_amplitude_m": 1.0, "platform.sway_frequency_Hz": 0.1},
     "platform_velocity_std_m_s", 2 * pi * 0.1 * sqrt(5) / 2),
    ({"platform.surge_amplitude_m": 2.0, "platform.surge_frequency_Hz": 0.1},
     "platform_velocity_time_s", 1 / (2 * pi * 0.1)),
    ({"platform.yaw_amplitude_deg": 5.0, "platform.yaw_frequency_Hz": 0.05},
     "heading_rate_std_deg_s", 2 * pi * 0.05 * 5 / sqrt(2)),
    ({"platform.yaw_amplitude_deg": 5.0, "platform.yaw_frequency_Hz": 0.05},
     "heading_rate_time_s", 1 / (2 * pi * 0.05)),
    ({"platform.roll_amplitude_deg": 3.0, "platform.pitch_amplitude_deg": 4.0}, "tilt_std_deg",
     2.5),
    ({"platform.roll_amplitude_deg": 3.0, "platform.roll_frequency_Hz": 0.2,
      "platform.pitch_amplitude_deg": 4.0, "platform.pitch_frequency_Hz": 0.1}, "tilt_time_s",
     5 / (2 * pi * hypot(3 * 0.2, 4 * 0.1))),
    ({"platform.roll_amplitude_deg": 3.0, "platform.roll_frequency_Hz": 0.0,
      "platform.pitch_amplitude_deg": 0.0}, "tilt_time_s", 4.0),
    ({"platform.heave_amplitude_m": 0.4, "platform.mean_position_m": (1.0, 2.0, -0.6)},
     "heave_std_m", hypot(0.4 / sqrt(2), 0.6)),
    ({"platform.heave_amplitude_m": 0.4, "platform.heave_frequency_Hz": 0.2}, "heave_time_s",
     1 / (2 * pi * 0.2)),
    ({"platform.heave_amplitude_m": 0.0, "platform.mean_position_m": (0.0, 0.0, 20.0)},
     "heave_time_s", 1e6),
    ({"platform.imu_heading_std_deg": 0.9}, "imu_heading_std_deg", 0.9),
    ({"platform.imu_heading_bias_deg": -2.0, "platform.imu_heading_turn_on_std_deg": 1.0,
      "platform.imu_heading_step_deg": 2.0}, "imu_heading_error_std_deg", 3.0),
    ({"platform.imu_heading_bias_deg": -2.0, "platform.imu_heading_markov_std_deg": 1.0},
     "imu_heading_error_time_s", 1e6),
    ({"platform.imu_heading_markov_std_deg": 1.0, "platform.imu_correlation_time_s": 44.0},
     "imu_heading_error_time_s", 44.0),
    ({"platform.imu_tilt_std_deg": 0.2, "platform.imu_tilt_bias_deg": -0.3,
      "platform.imu_tilt_turn_on_std_deg": 0.6}, "imu_tilt_std_deg", 0.7),
    ({"platform.imu_tilt_markov_std_deg": 0.4}, "imu_tilt_std_deg", 0.4),
    ({"platform.imu_tilt_std_deg": 0.2}, "imu_tilt_noise_std_deg", 0.2),
    ({"platform.misalignment_tilt_std_deg": 0.4}, "imu_tilt_error_std_deg", 0.4),
    ({"acoustics.range_common_std_m": 0.3, "acoustics.ranging": "inverted"},
     "range_common_std_m", 0.3),
    ({"acoustics.arrivals_shared": True}, "arrivals_shared", True),
    ({"acoustics.common_clock": False, "acoustics.ranging": "inverted"}, "common_clock", False),
    ({"acoustics.packet_content": "everything"}, "pose_source", "reported_pose"),
    ({"acoustics.packet_content": "pose"}, "pose_source", "reported_pose"),
    ({"acoustics.packet_content": "all_beacons"}, "pose_source", "beacon_positions"),
    ({"acoustics.packet_content": "own_beacon"}, "pose_source", "own_beacon"),
    ({"platform.gps_horizontal_std_m": 0.3, "acoustics.packet_resolution_m": 0.4 * sqrt(12)},
     "gps_std_m", 0.5),
    ({"platform.gps_horizontal_std_m": 0.3, "acoustics.packet_content": "own_beacon",
      "acoustics.packet_resolution_m": 0.4 * sqrt(12)}, "gps_std_m", 0.5),
    ({"platform.gps_horizontal_std_m": 0.3, "acoustics.packet_content": "all_beacons",
      "acoustics.packet_resolution_m": 0.8 * sqrt(12)}, "gps_std_m", 0.5),
    ({"platform.gps_vertical_std_m": 0.3, "acoustics.packet_resolution_m": 0.4 * sqrt(12)},
     "gps_vertical_std_m", 0.5),
    ({"platform.imu_heading_std_deg": 3.0, "acoustics.packet_angle_resolution_deg": 4 * sqrt(12)},
     "imu_heading_std_deg", 5.0),
    ({"platform.imu_heading_std_deg": 0.0, "acoustics.packet_content": "all_beacons",
      "acoustics.packet_resolution_m": 0.1}, "imu_heading_std_deg",
     0.1 / 3 / sqrt(24) * 180 / pi),
    ({"platform.imu_tilt_std_deg": 3.0, "acoustics.packet_content": "pose",
      "acoustics.packet_angle_resolution_deg": 4 * sqrt(12)}, "imu_tilt_std_deg", 5.0),
    ({"platform.imu_tilt_std_deg": 0.0, "acoustics.packet_content": "all_beacons",
      "acoustics.packet_resolution_m": 0.1}, "imu_tilt_std_deg", 0.1 / 3 / sqrt(24) * 180 / pi),
    ({"acoustics.outlier_probability": 0.2}, "outlier_probability", 0.2),
    ({"acoustics.outlier_probability": 0.0}, "outlier_probability", 0.01),
    ({"acoustics.outlier_probability": 1.0}, "outlier_probability", 0.9),
    ({"acoustics.outlier_probability": 0.2, "acoustics.outlier_mean_m": 4.0}, "outlier_mean_m",
     4.0),
    ({"acoustics.loss_probability": 0.5, "acoustics.bottom_echo_probability": 0.5,
      "acoustics.water_depth_m": 9.0, "platform.arm_length_m": 1e-3,
      "platform.beacon_depth_m": 1.0}, "outlier_mean_m", hypot(15, 12) - hypot(15, 4)),
    ({"acoustics.assumed_sound_speed_m_s": 1480.0}, "assumed_sound_speed_m_s", 1480.0),
    ({"acoustics.clock_offset_s": -1e-3}, "clock_std_m", 1.5),
    ({"acoustics.processing_delay_s": 5e-3, "acoustics.processing_delay_correction_s": 3e-3},
     "clock_std_m", 3.0),
    ({"acoustics.clock_offset_s": -3e-4, "acoustics.clock_offset_std_s": 4e-4}, "clock_std_m",
     0.75),
    ({"acoustics.clock_offset_s": -1e-4, "acoustics.clock_drift_s_s": 1e-6,
      "acoustics.clock_drift_std_s_s": 4e-6, "acoustics.clock_sync_age_s": 400.0}, "clock_std_m",
     1500 * hypot(3e-4, 1.6e-3)),
    ({"acoustics.clock_drift_s_s": -1e-6}, "clock_walk_psd_m2_s", 100 * 0.0015**2),
    ({"acoustics.clock_drift_s_s": -3e-6, "acoustics.clock_drift_std_s_s": 4e-6},
     "clock_walk_psd_m2_s", 100 * 0.0075**2),
    ({"acoustics.sound_speed_m_s": 1470.0}, "sound_speed_std", 1500 / 1470 - 1),
    ({"acoustics.sound_speed_m_s": 100.0}, "sound_speed_std", 0.5),
    ({"target.depth_bias_m": -0.11}, "depth_bias_std_m", 0.11),
    ({"target.depth_bias_m": -0.03, "target.depth_bias_std_m": 0.04}, "depth_bias_std_m", 0.05),
    ({"platform.arm_length_m": 2.0, "platform.beacon_scale": 0.25}, "beacon_offset_m",
     (0.5, 0, 0.5, 0, 0.5, 0.5, -0.5, 0, 0.5, 0, -0.5, 0.5)),
    ({"platform.beacon_m": ((1, 2, 3), (4, 5, 6), (-1, 0, 1)), "platform.beacon_scale": 2.0},
     "beacon_offset_m", (2, 4, 3, 8, 10, 6, -2, 0, 1)),
    ({"platform.gps_horizontal_bias_std_m": 0.3, "platform.gps_horizontal_markov_std_m": 0.4,
      "platform.gps_shared": False}, "beacon_error_std_m", 0.5),
    ({"platform.mounting_std_m": 0.3}, "beacon_error_std_m", 0.3),
    ({"platform.gps_vertical_bias_std_m": 0.6, "platform.gps_vertical_markov_std_m": 0.8,
      "platform.gps_shared": False}, "beacon_vertical_error_std_m", 1.0),
    ({"platform.gps_horizontal_markov_std_m": 0.4, "platform.gps_correlation_time_s": 77.0},
     "beacon_error_time_s", 77.0),
    ({"platform.gps_horizontal_std_m": 0.2}, "beacon_noise_std_m", 0.2),
    ({"platform.gps_horizontal_std_m": 0.3, "acoustics.packet_resolution_m": 0.4 * sqrt(12)},
     "beacon_noise_std_m", 0.5),
    ({"platform.gps_vertical_std_m": 0.7}, "beacon_vertical_noise_std_m", 0.7),
    ({"platform.gps_vertical_std_m": 0.3, "acoustics.packet_resolution_m": 0.4 * sqrt(12)},
     "beacon_vertical_noise_std_m", 0.5),
]


@pytest.mark.parametrize(("given", "key", "expected"), FOLLOWS,
                         ids=[f"{key} from {min(given)}" for given, key, _ in FOLLOWS])
def test_each_number_follows_from_the_scenario(
    given: dict[str, Any], key: str, expected: Any
) -> None:
    others = "long_baseline" if key in KEYS - ARRAY_KEYS else "array"
    type_ = "coupled" if key in COUPLED_KEYS else others
    scenario = load({"receiver": {"type": type_}}, given)
    if not isinstance(expected, str):
        expected = pytest.approx(expected, rel=1e-9)
    assert getattr(scenario.receiver, key) == expected
    assert key not in scenario.receiver.model_fields_set
    # The same, when the scenario has another receiver.
    other = load({"receiver": {"type": "sequential"}}, given)
    assert other.assumptions()[key] == expected if (
        key in other.assumptions()) else expected == 1e6


def test_all_of_them_are_tried_and_none_else_is_assumed() -> None:
    described = {key for _, key, _ in FOLLOWS} - {"range_std_m", "depth_std_m"}
    assert described == set(SOURCES)
    assert set(SOURCES) < KEYS
    known = {f"{name}.{v.key}" for name in ("target", "platform", "acoustics")
             for v in COMPONENTS[name].of("parameter")}
    assert {source for sources in SOURCES.values() for source in sources} <= known


LISTED = [entry for entry in FOLLOWS if entry[1] in SOURCES]


@pytest.mark.parametrize(("given", "key", "expected"), LISTED,
                         ids=[f"{key} from {min(given)}" for given, key, _ in LISTED])
def test_the_sources_are_as_listed(given: dict[str, Any], key: str, expected: Any) -> None:
    assert set(given) <= set(SOURCES[key])


def test_rounding_counts_for_what_a_receiver_uses() -> None:
    """Of rounded packets with everything, a receiver may take the beacons' positions."""
    changes = {"platform.gps_horizontal_std_m": 0.0, "acoustics.packet_resolution_m": 0.1}
    whole = load({"receiver": {"type": "coupled"}}, changes).receiver
    assert whole.gps_std_m == pytest.approx(0.1 / sqrt(12))
    assert whole.imu_heading_std_deg == load({}).receiver.imu_heading_std_deg
    fitted = load({"receiver": {"type": "coupled", "pose_source": "beacon_positions"}}, changes)
    told = load({"receiver": {"type": "coupled"}},
                {**changes, "acoustics.packet_content": "all_beacons"})
    for key in ("gps_std_m", "imu_heading_std_deg", "imu_tilt_std_deg", "pose_source"):
        assert getattr(fitted.receiver, key) == getattr(told.receiver, key)
    assert fitted.receiver.gps_std_m == pytest.approx(0.05 / sqrt(12))
    posed = load(fitted, {"acoustics.packet_content": "pose"}).receiver
    assert posed.gps_std_m == whole.gps_std_m


def test_what_is_not_rounded_is_assumed_to_the_bit() -> None:
    stds = {"platform.gps_horizontal_std_m": 0.1, "platform.imu_heading_std_deg": 0.7,
            "platform.imu_tilt_std_deg": 0.3, "platform.imu_tilt_bias_deg": 0.77}
    for content in ("everything", "own_beacon", "all_beacons", "pose"):
        receiver = load({}, {**stds, "acoustics.packet_content": content}).receiver
        assert (receiver.gps_std_m, receiver.imu_heading_std_deg) == (0.1, 0.7)
        assert receiver.imu_tilt_std_deg == hypot(0.3, 0.77, 0.0, 0.0)


def test_noises_of_waves_and_mooring_add() -> None:
    """2 σ²/τ, which changes the velocity; and σ², the velocity itself."""
    def told(**keys: float) -> tuple[float, float]:
        sea = {"motion": "spectrum", "wave_height_m": 0.0, **keys}
        found = load({"platform": sea}).assumptions()
        return found["platform_velocity_std_m_s"], found["platform_velocity_time_s"]

    waves, drift = {"wave_height_m": 1.0}, {"watch_circle_m": 5.0, "mooring_time_s": 20.0}
    (v, tau), (w, slow), (both, time) = told(**waves), told(**drift), told(**waves, **drift)
    assert slow == pytest.approx(20.0)
    assert both**2 == pytest.approx(v**2 + w**2)
    assert both**2 / time == pytest.approx(v**2 / tau + w**2 / slow)


def test_a_given_key_wins() -> None:
    given = {"gps_std_m": 9.0, "clock_std_m": 0.0, "tilt_std_deg": 1.0, "range_std_m": 0.9}
    scenario = load({"receiver": {"type": "coupled", **given},
                     "platform": {"gps_horizontal_std_m": 0.5, "roll_amplitude_deg": 3.0},
                     "acoustics": {"clock_offset_s": 0.1, "range_std_m": 0.2}})
    for key, value in given.items():
        assert getattr(scenario.receiver, key) == value
    changed = scenario.override({"platform.gps_horizontal_std_m": 0.7, "platform.beaufort": 4})
    assert changed.receiver.gps_std_m == 9.0
    assert changed.receiver.tilt_std_deg == 1.0


def test_other_receivers_of_a_scenario_get_them_too() -> None:
    scenario = load("paper-scenario-3")
    assert scenario.receiver.type != "coupled"
    run = connect(scenario, ["coupled"]).components["coupled"].parameters
    own = connect(applied(scenario, choice_of(scenario, "coupled"))).components["coupled"]
    assert run.keys() <= own.parameters.keys()
    for name in own.parameters.keys() & run.keys():
        assert run[name] == pytest.approx(own.parameters[name]), name
    swing = scenario.platform
    assert own.parameters["tilt_std"] == pytest.approx(
        hypot(swing.roll_amplitude_deg, swing.pitch_amplitude_deg) / 2 * pi / 180)
    for name in {v.name for v in COUPLED.of("parameter") if v.key in SOURCES}:
        assert name in own.parameters


PATHS: dict[str, dict[str, Any]] = {
    "straight_line": {"heading_deg": 70.0, "path_length_m": 40.0, "depth_end_m": 8.0},
    "semicircle": {"center_m": [5.0, -8.0], "heading_deg": 30.0, "depth_start_m": 2.0},
    "circle": {"turns": 1.5, "depth_end_m": 1.0, "center_m": [10.0, 0.0]},
    "square": {"side_m": 30.0, "heading_deg": 20.0, "center_m": [0.0, 15.0]},
    "spiral": {"turns": 3.0, "spiral_radius_m": [3.0, 40.0]},
    "random_path": {"path_length_m": 30_000.0, "leg_length_m": 5.0, "box_m": [30.0, 10.0]},
    "waypoints": {"waypoint_m": [[0, 3, 1], [0, 40, 8], [0, 40, 2], [3, 39, 2], [-9, 30, 9]]},
    "file": {"track_time_s": [0, 60, 70, 200], "track_m": [[0, 3, 1], [0, 40, 8], [9, 9, 8],
                                                           [30, 30, 2]]},
    "white_noise_acceleration": {"initial_position_m": [30.0, 5.0, 6.0],
                                 "acceleration_psd_m2_s3": 0.0},
}


@pytest.mark.parametrize("trajectory", PATHS)
def test_late_ranges_are_those_of_echoes_along_the_path(trajectory: str) -> None:
    keys = {f"target.{key}": value for key, value in PATHS[trajectory].items()}
    keys |= {"target.trajectory": trajectory, "acoustics.loss_probability": 0.4,
             "acoustics.surface_echo_probability": 0.3, "acoustics.bottom_echo_probability": 0.6,
             "acoustics.water_depth_m": 12.0, "platform.mean_heading_deg": 40.0,
             "platform.mean_position_m": [2.0, -3.0, 0.5], "platform.beaufort": 0,
             "time.sampling_time_s": 1.0}
    timed = trajectory in ("file", "white_noise_acceleration")
    keys["time.duration_s"] = 200.0 if timed else "path"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run = sblcosim.run({}, "multilateration", keys)
    diver = run.record.values["target.position"][1:, None]
    a, b = run.scenario.acoustics, run.record.values["platform.beacon_position"][1:]
    e = np.sort(found := echoes.excesses(a, diver, b), axis=-1)
    q = np.array(echoes.echo_chances(a))[np.argsort(found, axis=-1)]
    mean = (q[..., 0] * e[..., 0] + (1 - q[..., 0]) * q[..., 1] * e[..., 1]) / (1 - 0.7 * 0.4)
    assert run.scenario.assumptions()["outlier_mean_m"] == pytest.approx(mean.mean(), rel=0.07)


def test_all_paths_are_tried() -> None:
    assert {*PATHS} == {*TRAJECTORIES.values()}


def test_echoes_on_a_path_that_is_not_known_have_no_known_excess() -> None:
    told = {"acoustics.loss_probability": 0.4, "acoustics.surface_echo_probability": 0.3}
    foreign = {"target": {"fmu": str(build("target"))}}
    assert "outlier_mean_m" in load({}, told).assumptions()
    assert "outlier_mean_m" not in load(foreign, told).assumptions()
    outliers = {"acoustics.outlier_probability": 0.1, "acoustics.outlier_mean_m": 3.0}
    assert load(foreign, {**told, **outliers}).assumptions()["outlier_mean_m"] == 3.0
    assert paths.sketch(SimpleNamespace(trajectory="zigzag")) == []  # one of somebody else's


@pytest.mark.parametrize("name", shipped())
def test_a_dumped_scenario_is_the_same_one(name: str) -> None:
    loaded = load(name)
    scenario = applied(loaded, choice_of(loaded, "coupled"))
    again = load(tomllib.loads(scenario.dump_toml()))
    for key in COUPLED_KEYS - {"prior_position_m", "prior_velocity_m_s"}:
        value = getattr(scenario.receiver, key)
        assert getattr(again.receiver, key) == (
            value if isinstance(value, str) else pytest.approx(value, rel=1e-11)), key


def test_nothing_follows_from_what_ours_would_be_where_it_is_somebody_elses() -> None:
    """A platform without the keys of ours is not one with a perfect GPS that never moves."""
    tables = {"receiver": {"type": "coupled"},
              "platform": {"fmu": str(build("platform")), "gps_horizontal_std_m": 0.5}}
    receiver = load(tables).receiver
    starts = {v.key: v for v in COUPLED.of("parameter")}
    assert receiver.gps_std_m == 0.5
    for key in ("gps_markov_std_m", "platform_velocity_std_m_s", "clock_walk_psd_m2_s"):
        wanted = 0.0 if key.startswith("clock") else starts[key].starts[0]
        assert getattr(receiver, key) == wanted
    assert receiver.tilt_std_deg == pytest.approx(0.07 * 180 / pi)
    assert receiver.beacon_offset_m == starts["beacon_offset_m"].starts
    tables["platform"] |= {"arm_length_m": 0.4}
    assert load(tables).receiver.beacon_offset_m[0] == 0.4


@pytest.mark.parametrize("type_", RECEIVERS)
@pytest.mark.parametrize("table", ["target", "platform", "acoustics"])
def test_any_receiver_can_be_told_of_somebody_elses(type_: str, table: str) -> None:
    """Also one that takes the error of its clock for one of the ranges, of which nothing is known.
    """
    tables = {"receiver": {"type": type_}, table: {"fmu": str(build(table))},
              "acoustics": {"range_std_m": 0.3}}
    tables[table] = {"fmu": str(build(table)), **tables.get(table, {})}
    assert load(tables).receiver.range_std_m == 0.3


def test_the_table_in_the_documents() -> None:
    text = README.read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`[^|]+) \| ([^|]+) \|.*\|$", text[text.index("| parameter | from"):],
                      flags=re.MULTILINE)
    named = {v.name: v.key for r in (COUPLED, LONG_BASELINE, ARRAY) for v in r.of("parameter")}
    found = {named[name]: set(re.findall(r"`(\w+\.\w+)`", sources))
             for names, sources in rows for name in re.findall(r"`(\w+)`", names)}
    expected = {key: set(sources) for key, sources in SOURCES.items()}
    expected |= {"range_std_m": {
        "acoustics.range_std_m", "platform.mounting_std_m", "platform.mounting_error_m",
        "platform.gps_shared", "platform.beacon_m", "acoustics.schedule",
        "acoustics.sampling_time_s",
    }, "depth_std_m": {"target.depth_std_m"}}
    assert found == expected


@pytest.mark.parametrize("body", [
    [[3, 0, 0.5], [0, 3, 0.5], [-3, 0, 0.5], [0, -3, 0.5]],
    [[2, 0.5, 0.2], [-0.5, 3, 0.8], [-2.5, 0.3, 0.4], [0.4, -1.5, 1.4]],
    [[4, 3, 0], [3.5, 2, 0], [-4, -3, 0], [-2, -2.5, 0]],
])  # fmt: skip
def test_rounded_beacons_tilt_a_plane_through_them(body: list[list[float]]) -> None:
    """The slopes of a regression on both axes, whose noise is that of the rounding."""
    rows = np.array(body, float)
    platform = SimpleNamespace(
        beacons=4, arm_length_m=3.0, beacon_depth_m=0.5, arrangement="given",
        beacon_m=tuple(rows.ravel()), beacon_scale=1.0,
    )  # fmt: skip
    acoustics = SimpleNamespace(packet_resolution_m=0.1, packet_content="beacons")
    design = np.column_stack([np.ones(4), rows[:, :2]])
    covariance = 0.1**2 / 12 * np.linalg.inv(design.T @ design)
    forward, starboard = np.degrees(np.sqrt(np.diag(covariance)[1:]))
    place, heading, tilt = rounding(platform, acoustics, "beacon_positions")
    assert place == pytest.approx(0.1 / np.sqrt(12) / 2)
    assert heading == pytest.approx(forward, rel=1e-9)
    assert tilt == pytest.approx(np.hypot(forward, starboard) / np.sqrt(2), rel=1e-9)
