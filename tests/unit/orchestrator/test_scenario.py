"""Scenario files: what they say, what is filled in, and what is refused."""

from __future__ import annotations

import math
import tomllib
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sblcosim.errors import ConfigurationError, NoEffectWarning
from sblcosim.models import COMPONENTS, RECEIVERS
from sblcosim.models.acoustics import clock
from sblcosim.models.platform import gps
from sblcosim.models.platform.beaufort import sea_state
from sblcosim.models.platform.imu import grade
from sblcosim.models.settings.assumptions import SOURCES
from sblcosim.models.settings.keys import in_si
from sblcosim.models.settings.presets import PRESETS
from sblcosim.models.target.trajectories import FOUND as PATHS
from sblcosim.scenario.scenario import Scenario, load, shipped, shipped_text
from sblcosim.scenario.schema import CORE_COMPONENTS
from sblcosim.scenario.starter import starter
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.resolve import resolve
from sblcosim.words.lists import listed

FIXED = ("target", "platform", "acoustics")


def problems(source: Any, overrides: Any = ()) -> list[str]:
    with pytest.raises(ConfigurationError) as caught:
        load(source, overrides)
    return str(caught.value).splitlines()


# --- What a scenario holds -----------------------------------------------------------------------


def test_every_parameter_of_every_component_has_a_key_with_its_unit() -> None:
    scenario = load({})
    for name in FIXED:
        for variable in COMPONENTS[name].of("parameter"):
            assert hasattr(getattr(scenario, name), variable.key)
    for component in RECEIVERS.values():
        for variable in component.of("parameter"):
            assert hasattr(scenario.receiver, variable.key)


@pytest.mark.parametrize("name", [*FIXED, *RECEIVERS])
def test_what_is_not_given_is_the_start_value_of_the_declaration(name: str) -> None:
    component = COMPONENTS[name]
    scenario = load({"receiver": {"type": name}} if name in RECEIVERS else {})
    table = scenario.receiver if name in RECEIVERS else getattr(scenario, name)
    for variable in component.of("parameter"):
        if name in ("coupled", "fixed_lag", "long_baseline", "array") and variable.key in SOURCES:
            continue  # what it assumes of the others follows from them
        value = in_si(variable, getattr(table, variable.key))
        elements = value if variable.shape else (value,)
        assert elements == pytest.approx(variable.starts, rel=1e-11), variable.name


def test_angles_are_degrees_in_the_file_and_radians_in_the_fmu() -> None:
    table = load({"platform": {"roll_amplitude_deg": 90, "imu_misalignment_deg": [45, 0, -30]}})
    platform = COMPONENTS["platform"]
    roll = platform["roll_amplitude"]
    assert in_si(roll, table.platform.roll_amplitude_deg) == math.pi / 2 == roll.max
    misalignment = in_si(platform["imu_misalignment"], table.platform.imu_misalignment_deg)
    assert misalignment == pytest.approx((math.pi / 4, 0.0, -math.pi / 6), rel=1e-15)


def test_choices_are_names_in_the_file_and_numbers_in_the_fmu() -> None:
    scenario = load({"target": {"trajectory": "spiral"}})
    assert in_si(COMPONENTS["target"]["trajectory"], scenario.target.trajectory) == 5


def test_one_sampling_time_and_one_seed_go_to_all_components_unless_they_have_their_own() -> None:
    scenario = load({"seed": 7, "time": {"sampling_time_s": 0.2}, "platform": {"seed": 3}})
    assert [getattr(scenario, name).sampling_time_s for name in FIXED] == [0.2] * 3
    assert [getattr(scenario, name).seed for name in FIXED] == [7, 3, 7]
    slow = load({"time": {"sampling_time_s": 0.2}, "target": {"sampling_time_s": 1.0}})
    assert (slow.target.sampling_time_s, slow.target.interval_s) == (1.0, 0.2)


def test_the_update_interval_is_the_ekf_ratio_times_the_sampling_time() -> None:
    scenario = load({"time": {"sampling_time_s": 0.1, "ekf_ratio": 3}})
    assert scenario.receiver.update_interval_s == scenario.receiver.interval_s == 0.3


def test_receivers_assume_the_noise_of_the_run_and_never_less_than_the_declared_minimum() -> None:
    scenario = load({"acoustics": {"range_std_m": 0.7}, "target": {"depth_std_m": 0.0}})
    assert scenario.receiver.range_std_m == 0.7
    assert scenario.receiver.depth_std_m == COMPONENTS["ekf"]["depth_std"].min
    own = load({"acoustics": {"range_std_m": 0.7}, "receiver": {"range_std_m": 0.2}})
    assert own.receiver.range_std_m == 0.2


def test_presets_set_what_is_not_given() -> None:
    scenario = load(
        {"platform": {"beaufort": 4, "imu_grade": "tactical", "pitch_amplitude_deg": 1.0}}
    )
    platform = scenario.platform
    assert math.radians(platform.roll_amplitude_deg) == pytest.approx(
        sea_state(4)["roll_amplitude"], rel=1e-11
    )
    assert platform.heave_amplitude_m == pytest.approx(sea_state(4)["heave_amplitude"], rel=1e-11)
    assert platform.pitch_amplitude_deg == 1.0
    assert math.radians(platform.imu_tilt_bias_deg) == pytest.approx(
        grade("tactical")["imu_tilt_bias"], rel=1e-11
    )


@pytest.mark.parametrize("name", gps.GRADES)
def test_a_gps_grade_sets_what_is_not_given(name: str) -> None:
    wanted = gps.grade(name)
    table = load({"platform": {"gps_grade": name, "gps_vertical_std_m": 9.0}}).platform
    assert table.gps_vertical_std_m == 9.0
    others = {key: getattr(table, COMPONENTS["platform"][key].key) for key in wanted}
    assert others == {**wanted, "gps_vertical_std": 9.0}
    assert load({}).platform.imu_tilt_bias_deg == table.imu_tilt_bias_deg


@pytest.mark.parametrize("name", clock.GRADES)
def test_a_clock_grade_sets_what_is_not_given(name: str) -> None:
    table = load({"acoustics": {"clock_grade": name, "clock_offset_s": 1e-4}}).acoustics
    assert (table.clock_drift_s_s, table.clock_drift_std_s_s) == (0.0, clock.GRADES[name])
    assert (table.clock_offset_s, table.clock_offset_std_s, table.clock_sync_age_s) == (1e-4, 0, 0)
    own = load({"acoustics": {"clock_grade": name, "clock_drift_std_s_s": 1e-3}}).acoustics
    assert own.clock_drift_std_s_s == 1e-3


@pytest.mark.parametrize(("content", "bits", "wanted"), [
    ("pose", 80, (0.01, 0.125)), ("pose", 79, (0.02, 0.125)), ("pose", 74, (0.02, 0.25)),
    ("own_beacon", 52, (0.01, 0.0)), ("all_beacons", 80, (0.64, 0.0)), ("pose", 0, (0.0, 0.0)),
    ("everything", 10_000, (0.00125, 0.015625)),
])
def test_the_bits_of_a_packet_set_its_resolution(
    content: str, bits: int, wanted: tuple[float, float]
) -> None:
    scenario = load({}, {"acoustics.packet_content": content, "acoustics.packet_bits": bits})
    table = scenario.acoustics
    assert (table.packet_resolution_m, table.packet_angle_resolution_deg) == wanted
    again = load(tomllib.loads(scenario.dump_toml()))
    assert again.dump_toml() == scenario.dump_toml()
    longer = scenario.override({"acoustics.packet_bits": bits + 300}).acoustics
    assert longer.packet_resolution_m == 0.00125


@pytest.mark.parametrize("name", shipped())
@pytest.mark.parametrize("main", [*RECEIVERS])
def test_a_file_tells_every_receiver_what_the_scenario_told_it(name: str, main: str) -> None:
    """Whichever was the first."""
    def told(scenario: Scenario, receiver: str) -> dict[str, bytes] | str:
        try:
            plan = resolve(connect(scenario, receiver))
        except ConfigurationError as error:  # for other beacons, for example
            return str(error)
        one = next(c for c in plan.components if c.name == receiver)
        return {s.port.name: np.asarray(s.values).tobytes() for s in one.settings}

    with warnings.catch_warnings(action="ignore"):
        scenario = load(name, {"receiver.type": main})
        again = load(tomllib.loads(scenario.dump_toml()))
        assert all(told(again, receiver) == told(scenario, receiver) for receiver in RECEIVERS)


def test_a_given_resolution_leaves_the_rest_of_the_bits_to_the_other() -> None:
    packet = {"packet_content": "pose", "packet_bits": 80}
    table = load({"acoustics": {**packet, "packet_resolution_m": 0.001}}).acoustics
    assert (table.packet_resolution_m, table.packet_angle_resolution_deg) == (0.001, 2.0)
    table = load({"acoustics": {**packet, "packet_angle_resolution_deg": 1.0}}).acoustics
    assert (table.packet_resolution_m, table.packet_angle_resolution_deg) == (0.00125, 1.0)


@pytest.mark.parametrize(("tables", "line"), [
    ({"acoustics": {"packet_content": "pose", "packet_bits": 80, "packet_resolution_m": 0.005,
                    "packet_angle_resolution_deg": 0.125}},
     "scenario: [acoustics] packet_bits: must be at least 83, as packet_content is 'pose' and "
     "packet_resolution_m is 0.005 and packet_angle_resolution_deg is 0.125, got 80; 0.01 m and "
     "0.125° would fit"),
    ({"acoustics": {"packet_content": "all_beacons", "packet_bits": 80,
                    "packet_resolution_m": 0.2}},
     "scenario: [acoustics] packet_bits: must be at least 103, as packet_content is "
     "'all_beacons' and packet_resolution_m is 0.2, got 80; 0.64 m would fit"),
    ({"acoustics": {"packet_bits": 80}},
     "scenario: [acoustics] packet_bits: must be at least 86, as packet_content is 'everything', "
     "got 80"),
    ({"acoustics": {"packet_content": "pose"}, "platform": {"gps_shared": False}},
     "scenario: [acoustics] packet_content: must include positions of beacons, as gps_shared of "
     "[platform] is false, got 'pose'"),
    ({"acoustics": {"fmu": "other.fmu", "packet_bits": 80}},
     "scenario: [acoustics] packet_bits: must be left out if there is another fmu"),
    ({"acoustics": {"packet_content": "own_beacon"},
      "receiver": {"type": "coupled", "pose_source": "reported_pose"}},
     "scenario: [receiver] pose_source: must be 'own_beacon', as packet_content of [acoustics] "
     "is, got 'reported_pose'"),
])
def test_packets_that_cannot_be_are_refused(tables: dict[str, Any], line: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        load(tables)
    assert str(caught.value) == line


def test_grades_that_are_said_later_replace_the_keys_that_they_set() -> None:
    dive = load("realistic-dive", {"platform.gps_grade": "sbas", "acoustics.clock_grade": "csac"})
    assert dive.platform.gps_horizontal_markov_std_m == 0.3037
    assert (dive.acoustics.clock_drift_s_s, dive.acoustics.clock_offset_s) == (0.0, 9e-4)
    assert dive.receiver.gps_markov_std_m == 0.3037
    assert dive.dump_toml() == load(tomllib.loads(dive.dump_toml())).dump_toml()


@pytest.mark.parametrize(("table", "key", "wrong", "meant"), [
    ("platform", "gps_grade", "rtk_fix", "rtk_fixed"),
    ("platform", "gps_grade", "stand-alone", "standalone"),
    ("acoustics", "clock_grade", "oxco", "ocxo"),
])
def test_an_unknown_grade_is_one_line_with_the_nearest(
    table: str, key: str, wrong: str, meant: str
) -> None:
    (line,) = problems({table: {key: wrong}})
    assert line.startswith(f"scenario: [{table}] {key}: must be '")
    assert line.endswith(f", got \"{wrong}\"; did you mean '{meant}'?")


def test_waypoints_are_rows_and_are_counted() -> None:
    target = load(
        {"target": {"trajectory": "waypoints", "waypoint_m": [[0, 1, 2], [3, 4, 5], [6, 7, 8]]}}
    ).target
    assert target.waypoint_count == 3
    waypoint = in_si(COMPONENTS["target"]["waypoint"], target.waypoint_m)
    assert waypoint[:9] == tuple(range(9))
    assert len(waypoint) == COMPONENTS["target"]["waypoint"].size


def test_a_prior_that_is_the_true_start_is_used_as_a_prior() -> None:
    assert load({"receiver": {"prior": "true"}}).receiver.initialisation == "prior"


@pytest.mark.parametrize(
    ("table", "key"),
    [
        ("time", "sampling_time_s"), ("time", "duration_s"), ("target", "interval_s"),
        ("target", "sampling_time_s"), ("platform", "sampling_time_s"),
        ("receiver", "update_interval_s"), ("receiver", "interval_s"),
    ],
)  # fmt: skip
def test_a_time_that_only_rounding_makes_wrong_is_its_nanosecond(table: str, key: str) -> None:
    base = {"time": {"sampling_time_s": 0.042, "duration_s": 8.4}}
    assert 0.21 / 5 != 0.042
    value = getattr(load(base, {f"{table}.{key}": 0.21 / 5}), table)
    assert getattr(value, key) == 0.042
    scenario = load(base)
    tables = {**base, table: {**base.get(table, {}), key: 0.21 / 5}}
    assert getattr(getattr(load(tables), table), key) == 0.042
    assert scenario.acoustics.sampling_time_s == 0.042


@pytest.mark.parametrize("duration", [2.01, 8.2, 0.1 * 3])
def test_a_run_is_as_long_as_was_written(duration: float) -> None:
    stop = connect(load("paper-scenario-1", {"time.duration_s": duration})).stop_ns
    assert stop == round(duration * 100) * 10_000_000


# --- Overrides -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "overrides",
    [
        {"platform.arm_length_m": 0.4, "receiver.type": "sequential"},
        {"platform": {"arm_length_m": 0.4}, "receiver": {"type": "sequential"}},
        ["platform.arm_length_m=0.4", 'receiver.type="sequential"'],
        ["platform.arm_length_m = 0.4", "receiver.type=sequential"],
    ],
)
def test_overrides_are_pairs_or_tables(overrides: Any) -> None:
    scenario = load({"platform": {"arm_length_m": 3.0}}, overrides)
    assert (scenario.platform.arm_length_m, scenario.receiver.type) == (0.4, "sequential")


SEA = sorted(PRESETS["beaufort"])


@pytest.mark.parametrize("level", [0, 3, 6])
@pytest.mark.parametrize("name", ["paper-scenario-1", "harbour-square"])
def test_a_preset_that_is_said_later_replaces_the_keys_that_it_sets(name: str, level: int) -> None:
    before = load(name)
    for later in (
        load(name, [f"platform.beaufort={level}"]),
        load(name, {"platform": {"beaufort": level}}),
        before.override({"platform.beaufort": level}),
        load(tomllib.loads(before.dump_toml()), {"platform.beaufort": level}),
    ):
        wanted = load({"platform": {"beaufort": level}}).platform
        assert all(getattr(later.platform, key) == getattr(wanted, key) for key in SEA)
        assert later.platform.surge_amplitude_m == before.platform.surge_amplitude_m
        assert later.dump_toml() == load(tomllib.loads(later.dump_toml())).dump_toml()
    graded = load("realistic-dive", {"platform.imu_grade": "tactical"}).platform
    assert graded.imu_tilt_bias_deg == load({"platform": {"imu_grade": "tactical"}}
                                            ).platform.imu_tilt_bias_deg


def test_a_key_beside_a_preset_or_after_it_still_wins() -> None:
    beside = load("paper-scenario-1", ["platform.roll_amplitude_deg=7", "platform.beaufort=6"])
    after = load("paper-scenario-1", ["platform.beaufort=6"]).override(
        {"platform.roll_amplitude_deg": 7.0}
    )
    assert beside == after
    assert beside.platform.roll_amplitude_deg == 7.0
    assert beside.platform.pitch_amplitude_deg == pytest.approx(8.34, abs=0.01)


def test_no_preset_leaves_the_keys_as_they_are() -> None:
    before = load("harbour-square")
    after = before.override({"platform.beaufort": None}).platform
    assert (after.roll_amplitude_deg, after.heave_amplitude_m) == (3.0, 0.0)


EVERY_SEA_KEY = {f"platform.{key}": 1.0 for key in SEA}


@pytest.mark.parametrize(
    ("tables", "overrides", "message"),
    [
        (
            {}, EVERY_SEA_KEY | {"platform.beaufort": 6},
            "platform.beaufort: must have an effect, got none, as roll_amplitude_deg, "
            "pitch_amplitude_deg and 8 others are given$",
        ),
        (
            {"platform": {"fmu": "/other.fmu"}}, {"platform.beaufort": 6},
            "platform.beaufort: .*, as the platform is another component$",
        ),
        (
            {"acoustics": {"fmu": "/other.fmu"}}, {"acoustics.clock_grade": "ocxo"},
            "acoustics.clock_grade: .*, as the acoustics are another component$",
        ),
        (
            {}, {"acoustics.clock_grade": "ocxo", "acoustics.clock_drift_s_s": 0.0,
                 "acoustics.clock_drift_std_s_s": 1e-6},
            "acoustics.clock_grade: .*, as clock_drift_s_s and clock_drift_std_s_s are given$",
        ),
        (
            {"receiver": {"update_interval_s": 0.2}}, {"time.ekf_ratio": 3},
            "time.ekf_ratio: .*, as receiver.update_interval_s is given$",
        ),
        (
            {t: {"seed": 2} for t in FIXED}, ["seed=3"],
            "seed: .*, as target.seed, platform.seed and acoustics.seed are given$",
        ),
        (
            {**{t: {"sampling_time_s": 0.1} for t in FIXED}, "receiver": {"update_interval_s": 1}},
            ["time.sampling_time_s=0.2"],
            "time.sampling_time_s: .*, as target.sampling_time_s, platform.sampling_time_s and 2 "
            "others are given$",
        ),
    ],
)  # fmt: skip
def test_a_key_that_sets_nothing_is_refused_if_it_is_said_later(
    tables: Any, overrides: Any, message: str
) -> None:
    with pytest.raises(ConfigurationError, match=f"^override {message}"):
        load(tables, overrides)


def test_a_preset_is_refused_when_all_its_keys_were_said_after_it() -> None:
    later = load("paper-scenario-1", {"platform.beaufort": 6})
    with pytest.raises(ConfigurationError, match=r"^override platform.beaufort: must have an eff"):
        later.override(EVERY_SEA_KEY)


def test_a_file_may_state_a_preset_and_all_its_keys() -> None:
    platform = load({"platform": {"beaufort": 2, **dict.fromkeys(SEA, 1.0)}}).platform
    assert SEA
    assert {getattr(platform, key) for key in SEA} == {1.0}


def test_what_follows_from_an_overridden_key_follows() -> None:
    scenario = load("paper-scenario-1").override({"time.sampling_time_s": 1.0, "seed": 5})
    assert scenario.receiver.update_interval_s == scenario.acoustics.sampling_time_s == 1.0
    assert scenario.platform.seed == 5
    assert scenario.target.radius_m == 15.0


def test_an_override_does_not_change_what_it_was_made_from() -> None:
    tables = {"platform": {"arm_length_m": 3.0}}
    scenario = load(tables)
    scenario.override({"platform.arm_length_m": 0.4})
    load(tables, {"platform.arm_length_m": 0.4})
    assert scenario.platform.arm_length_m == tables["platform"]["arm_length_m"] == 3.0
    assert load({}).seed == load({}, {"seed": 9}).override({"seed": 1}).seed == 1


def test_none_in_python_means_not_given() -> None:
    tables = {"target": {"waypoint_m": None}, "platform": {"arm_length_m": 0.4}, "title": None}
    assert load(tables).model_fields_set == {"target", "platform"}
    assert load(tables, {"platform.arm_length_m": None}).platform.arm_length_m == 3.0


def test_tables_of_the_caller_are_not_changed() -> None:
    tables = {"receiver": {"fmu": "/a.fmu", "parameters": {"gain": 1}}}
    scenario = load(tables, {"receiver.parameters.gain": 2})
    assert scenario.receiver.parameters == {"gain": 2}
    assert tables["receiver"]["parameters"] == {"gain": 1}


# --- Shipped scenarios ---------------------------------------------------------------------------


@pytest.mark.parametrize("name", shipped())
def test_a_shipped_scenario_is_complete_in_its_dump(name: str) -> None:
    scenario = load(name)
    dumped = scenario.dump_toml()
    again = load(tomllib.loads(dumped))
    assert again.dump_toml() == dumped
    assert again.model_dump() == scenario.model_dump()
    assert scenario.name == name
    assert scenario.title


@pytest.mark.parametrize("number", [1, 2, 3])
def test_the_papers_scenarios_state_all_numbers_of_the_literal_preset(number: int) -> None:
    given = tomllib.loads(shipped_text(f"paper-scenario-{number}"))
    scenario = load(f"paper-scenario-{number}")
    target, platform = scenario.target, scenario.platform
    assert given["time"] == {"sampling_time_s": 0.1, "ekf_ratio": 1, "duration_s": "path"}
    assert (target.speed_m_s, target.depth_start_m, target.depth_end_m) == (0.5, 5.0, 5.0)
    assert (platform.arm_length_m, platform.beacon_depth_m) == (3.0, 0.5)
    for axis, frequency in (("roll", 0.30), ("pitch", 0.25), ("yaw", 0.05)):
        assert getattr(platform, f"{axis}_amplitude_deg") == 5.0
        assert getattr(platform, f"{axis}_frequency_Hz") == frequency
    assert platform.random_phases
    assert platform.heave_amplitude_m == platform.surge_amplitude_m == 0.0
    assert (platform.gps_horizontal_std_m, platform.gps_vertical_std_m) == (0.1, 0.0)
    assert platform.gps_horizontal_markov_std_m == platform.gps_horizontal_bias_std_m == 0.0
    assert (platform.imu_tilt_std_deg, platform.imu_heading_std_deg) == (1.0, 1.0)
    assert (scenario.acoustics.range_std_m, scenario.acoustics.loss_probability) == (0.1, 0.0)
    assert scenario.acoustics.sound_speed_m_s == scenario.acoustics.assumed_sound_speed_m_s
    assert not scenario.acoustics.motion_during_travel
    assert scenario.acoustics.outlier_probability == 0.0
    assert given["receiver"] == {
        "type": "ekf",
        "measurement_noise": "literal",
        "beacon_position_source": "newest_packet",
        "process_noise": "white_noise_acceleration",
        "acceleration_psd_m2_s3": 0.01,
        "prior": "true",
        "prior_position_std_m": 1.0,
        "prior_velocity_std_m_s": 1.0,
    }
    assert (scenario.receiver.range_std_m, scenario.receiver.depth_std_m) == (0.1, 0.01)


def test_the_papers_paths() -> None:
    semicircle, spiral, random = (load(f"paper-scenario-{n}").target for n in (1, 2, 3))
    assert (semicircle.trajectory, semicircle.radius_m) == ("semicircle", 15.0)
    assert (spiral.trajectory, spiral.spiral_radius_m, spiral.turns) == ("spiral", (2.5, 25.0), 2.0)
    assert random.trajectory == "random_path"
    assert (random.leg_length_m, random.box_m, random.path_length_m) == (8.0, (25.0, 25.0), 150.0)


@pytest.mark.parametrize(
    ("name", "path"),
    [
        ("harbour-square", {"trajectory": "square", "side_m": 15.0}),
        ("harbour-spiral", {"trajectory": "spiral", "spiral_radius_m": (1.0, 10.0)}),
        (
            "harbour-random",
            {"trajectory": "random_path", "box_m": (10.0, 10.0), "path_length_m": 120.0},
        ),
    ],
)
def test_the_harbour_sessions(name: str, path: dict[str, Any]) -> None:
    scenario = load(name)
    platform, receiver = scenario.platform, scenario.receiver
    assert {key: getattr(scenario.target, key) for key in path} == path
    assert (scenario.target.depth_start_m, scenario.target.depth_end_m) == (2.0, 2.0)
    assert (scenario.target.depth_std_m, scenario.target.speed_m_s) == (0.05, 0.5)
    assert platform.beaufort == 2
    assert (platform.roll_amplitude_deg, platform.pitch_amplitude_deg) == (3.0, 3.0)
    assert (platform.gps_horizontal_std_m, platform.gps_horizontal_markov_std_m) == (0.0, 1.05)
    assert (platform.gps_correlation_time_s, platform.imu_heading_std_deg) == (100.0, 1.0)
    assert (scenario.acoustics.loss_probability, scenario.acoustics.range_std_m) == (0.5, 0.1)
    assert scenario.acoustics.sound_speed_m_s == 1500.0
    assert (receiver.measurement_noise, receiver.acceleration_psd_m2_s3) == ("variance", 0.01)
    assert receiver.prior is None


def test_the_realistic_dive() -> None:
    scenario = load("realistic-dive")
    platform, acoustics = scenario.platform, scenario.acoustics
    assert (platform.gps_horizontal_markov_std_m, platform.gps_correlation_time_s) == (1.2, 120.0)
    assert platform.gps_horizontal_std_m == 0.1
    assert (platform.imu_heading_bias_deg, platform.imu_tilt_bias_deg) == (3.0, 0.5)
    assert acoustics.clock_offset_s * acoustics.assumed_sound_speed_m_s == pytest.approx(1.35)
    assert acoustics.clock_drift_s_s == 0.5e-6
    assert (acoustics.sound_speed_m_s, acoustics.assumed_sound_speed_m_s) == (1530.0, 1500.0)
    assert (acoustics.outlier_probability, acoustics.outlier_mean_m) == (0.05, 1.0)
    assert acoustics.outlier_distribution == "exponential"
    assert acoustics.loss_probability == 0.25
    watch_circle = math.hypot(platform.surge_amplitude_m, platform.sway_amplitude_m)
    assert watch_circle == pytest.approx(3.0, abs=0.05)


# --- Keys without effect ------------------------------------------------------------------------


def warned(scenario: Any, receivers: Any = ()) -> list[str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        connect(scenario, receivers)
    assert all(issubclass(w.category, NoEffectWarning) for w in caught)
    return [str(w.message) for w in caught]


@pytest.mark.parametrize("name", shipped())
def test_a_shipped_scenario_says_nothing_in_vain(name: str) -> None:
    scenario = load(name)
    assert warned(scenario) == []
    assert warned(load(tomllib.loads(scenario.dump_toml()))) == []
    assert warned(load(tomllib.loads(starter(name, name)))) == []


def test_the_starter_says_nothing_in_vain() -> None:
    assert warned(load(tomllib.loads(starter("new")))) == []


@pytest.mark.parametrize(
    ("tables", "receivers", "messages"),
    [
        (
            {"target": {"trajectory": "square", "radius_m": 15.0, "turns": 2.0}}, (),
            ['[target] radius_m, turns: have no effect, as trajectory is "square"'],
        ),
        (
            {"acoustics": {"outlier_mean_m": 2.0}}, (),
            ["[acoustics] outlier_mean_m: has no effect, as outlier_probability is 0"],
        ),
        (
            {"platform": {"roll_frequency_Hz": 1.0, "pitch_phase_deg": 3.0,
                          "pitch_amplitude_deg": 1.0}}, (),
            [
                "[platform] roll_frequency_Hz: has no effect, as roll_amplitude_deg is 0",
                "[platform] pitch_phase_deg: has no effect, as random_phases is true",
            ],
        ),
        (
            {"receiver": {"type": "sequential", "gate": 0.0, "gate_limit": 3}}, (),
            ["[receiver] gate_limit: has no effect, as gate is 0"],
        ),
        (
            {"receiver": {"type": "sequential", "prior_position_std_m": 3.0}}, (),
            ["[receiver] prior_position_std_m: has no effect, as initialisation is "
             '"first_receptions"'],
        ),
        ({"receiver": {"gate_limit": 3}}, ["ekf", "sequential"], []),
        (
            {"receiver": {"gate_limit": 3, "gate": 0.0}}, ["ekf", "sequential"],
            ["[receiver] gate_limit: has no effect, as gate is 0"],
        ),
        (
            {"platform": {"gps_correlation_time_s": 3.0, "gps_vertical_markov_std_m": 1.0}}, (), [],
        ),
    ],
)  # fmt: skip
def test_keys_without_effect_are_warned_of(
    tables: Any, receivers: Any, messages: list[str]
) -> None:
    assert warned(load(tables), receivers) == [f"scenario: {message}" for message in messages]


def test_an_override_without_effect_is_named_as_such() -> None:
    assert warned(load("harbour-square", ["target.radius_m=3"])) == [
        'override target.radius_m: has no effect, as trajectory is "square"'
    ]


def test_a_dump_leaves_out_what_was_filled_in_and_has_no_effect() -> None:
    text = load({"target": {"trajectory": "square", "turns": 3.0}}).dump_toml()
    assert "side_m" in text
    assert "turns = 3.0" in text
    assert "radius_m" not in text


# --- What is refused -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        (
            {"platform": {"arm_lenght_m": 3.0}},
            "scenario: [platform] has no key 'arm_lenght_m'; did you mean 'arm_length_m'?",
        ),
        (
            {"platform": {"arm": 3.0}},
            "scenario: [platform] has no key 'arm'; did you mean 'arm_length_m'?",
        ),
        (
            {"platform": {"range_std_m": 1.0}},
            "scenario: [platform] has no key 'range_std_m'; "
            "did you mean 'range_std_m' in [acoustics]?",
        ),
        ({"speed_m_s": 1.0}, "scenario: key 'speed_m_s' must stand in the table [target]"),
        (
            {"platfrom": {}},
            "scenario: there is no key or table 'platfrom'; did you mean 'platform'?",
        ),
        ({"time": 3}, "scenario: [time]: must be a table, got 3"),
        ({"seed": 1.5}, "scenario: seed: must be a whole number, got 1.5"),
        ({"seed": True}, "scenario: seed: must be a whole number, got true"),
        (
            {"target": {"speed_m_s": "fast"}},
            'scenario: [target] speed_m_s: must be a number, got "fast"',
        ),
        (
            {"target": {"speed_m_s": math.nan}},
            "scenario: [target] speed_m_s: must be a finite number, got nan",
        ),
        (
            {"acoustics": {"range_std_m": -0.1}},
            "scenario: [acoustics] range_std_m: must be at least 0.0, got -0.1",
        ),
        (
            {"platform": {"roll_amplitude_deg": 91}},
            "scenario: [platform] roll_amplitude_deg: must be at most 90.0, got 91",
        ),
        (
            {"target": {"trajectory": "spirale"}},
            f"scenario: [target] trajectory: must be {listed([*map(repr, PATHS)], 'or')}, "
            "got \"spirale\"; did you mean 'spiral'?",
        ),
        (
            {"target": {"center_m": [1.0, 2.0, 3.0]}},
            "scenario: [target] center_m: must be an array of 2 numbers, got [1.0, 2.0, 3.0]",
        ),
        (
            {"platform": {"mounting_error_m": [[0, 0, 0], [0, 0, "x"], [0, 0, 0], [0, 0, 0]]}},
            'scenario: [platform] mounting_error_m[2,3]: must be a number, got "x"',
        ),
        (
            {"target": {"waypoint_m": [[1, 2], [3]]}},
            "scenario: [target] waypoint_m: must be an array of at most 64 rows of 3 numbers, "
            "got [[1, 2], [3]]",
        ),
        (
            {"target": {"trajectory": "waypoints"}},
            "scenario: [target] waypoint_m: must have at least 2 rows, got 0",
        ),
        (
            {"target": {"trajectory": "waypoints", "waypoint_count": 3, "waypoint_m": [1, 2, 3]}},
            "scenario: [target] waypoint_m: must have at least 2 rows, and as many as "
            "waypoint_count (3), got 1",
        ),
        (
            {"time": {"duration_s": 4e9}},
            "scenario: [time] duration_s: must be less than 4e+09, got 4000000000.0",
        ),
        (
            {"time": {"duration_s": "forever"}},
            "scenario: [time] duration_s: must be a number or 'path', got \"forever\"",
        ),
        (
            {"time": {"sampling_time_s": 0.1234567891}},
            "scenario: [time] sampling_time_s: must be a whole number of nanoseconds, "
            "got 0.1234567891",
        ),
        (
            {"receiver": {"update_interval_s": 0.25}},
            "scenario: [receiver] update_interval_s: must be a whole multiple of the sampling time "
            "(0.1), got 0.25",
        ),
        (
            {"acoustics": {"interval_s": 0.03}},
            "scenario: [acoustics] interval_s: must divide sampling_time_s (0.1), got 0.03",
        ),
        (
            {"receiver": {"type": "ekf", "fmu": "/a.fmu"}},
            "scenario: [receiver]: must have type or fmu, got both (ekf, /a.fmu)",
        ),
        (
            {"receiver": {"prior": "true", "prior_position_m": [0, 0, 0]}},
            "scenario: [receiver] prior_position_m: must be left out when prior is 'true'",
        ),
        (
            {"target": {"parameters": {"gain": 1}}},
            "scenario: [target] parameters: must come with fmu, the FMU that has them",
        ),
        (
            {"name": "../elsewhere"},
            "scenario: name: must begin with a letter or digit and have no slash or control "
            'character, got "../elsewhere"',
        ),
    ],
)
def test_a_wrong_scenario_is_refused_in_one_line(tables: dict[str, Any], message: str) -> None:
    assert problems(tables) == [message]


def test_all_problems_are_told_one_per_line() -> None:
    found = problems({"target": {"speed_m_s": -1}, "platform": {"arm_m": 1}, "seed": "x"})
    assert len(found) == 3


def test_a_wrong_override_is_named_as_such() -> None:
    assert problems({}, ["platform.arm_length_m=-1"]) == [
        "override platform.arm_length_m: must be at least 0.001, got -1"
    ]
    assert problems({}, ["platform.arm_length_m=1 m"]) == [
        "override platform.arm_length_m: must be a value in TOML, got '1 m'"
    ]
    assert problems({}, ["receiver.update_interval_s=0.25"]) == [
        "override receiver.update_interval_s: must be a whole multiple of the sampling time (0.1), "
        "got 0.25"
    ]
    assert problems({"receiver": {"type": "ekf"}}, {"receiver.fmu": "/a.fmu"}) == [
        "override receiver.fmu: must have type or fmu, got both (ekf, /a.fmu)"
    ]
    assert problems({}, ["arm"]) == ["override: must be table.key=value, got 'arm'"]
    assert problems({"seed": 3}, {"seed.x": 1}) == ["override seed.x: seed must be a table"]


def test_an_unknown_name_gets_the_list_and_the_nearest() -> None:
    (line,) = problems("paper-scenaro-1")
    assert line.endswith("got 'paper-scenaro-1'; did you mean 'paper-scenario-1'?")
    assert all(name in line for name in shipped())


def test_a_file_is_named_in_its_problems(tmp_path: Path) -> None:
    file = tmp_path / "dive.toml"
    file.write_text("[platform]\narm_lenght_m = 3.0\n")
    assert problems(file) == [
        f"{file}: [platform] has no key 'arm_lenght_m'; did you mean 'arm_length_m'?"
    ]
    file.write_text("[platform]\narm_length_m = \n")
    must = "must be a value of TOML (numbers begin with a digit, texts are in quotes)"
    assert problems(file) == [f"{file}, line 2, column 16: {must}, got none"]
    for written in (".3", "deep # metres", "-.5"):
        file.write_text(f"[platform]\narm_length_m = {written}\n")
        got = written.split(" ")[0]
        assert problems(file) == [f"{file}, line 2, column 16: {must}, got '{got}'"]
    file.write_bytes(b"a\xff\xfe\x00")
    assert problems(file) == [f"{file}: must be a text file in UTF-8, got the byte 0xff at 1"]


@pytest.mark.parametrize("text", ["", "# nothing\n", 'name = "x"\n'])
def test_a_file_without_a_table_is_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "dive.toml"
    file.write_text(text)
    (line,) = problems(file)
    assert line.startswith(f"{file}: must have at least one table ([time], [place], [target], ")


def test_what_is_no_scenario_file_is_told_in_the_words_of_the_system(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "harbor-random.toml"
    assert problems(file) == [f"{file}: no such file; did you mean 'harbour-random'?"]
    assert problems("nosuch.toml") == ["nosuch.toml: no such file"]
    assert problems(tmp_path) == [f"{tmp_path}: is a folder, not a scenario file"]

    def denied(*_: Any, **__: Any) -> str:
        raise PermissionError(13, "Permission denied")

    file.write_text("[time]\n")
    monkeypatch.setattr(Path, "open", denied)
    assert problems(file) == [f"{file}: must be a file that can be read, got Permission denied"]


@pytest.mark.parametrize(
    ("source", "overrides", "message"),
    [
        (3, (), "scenario: must be a name, a TOML file, tables or a loaded scenario, got 3"),
        (None, (), "scenario: must be a name, a TOML file, tables or a loaded scenario, got None"),
        (object(), (), "scenario: must be .*, got an instance of object"),
        ({}, 5, "overrides: must be keys with values, or texts like table.key=value, got 5"),
        ({}, [5], "override: must be a text like table.key=value, got 5"),
    ],
)
def test_arguments_of_a_wrong_kind_are_refused(source: Any, overrides: Any, message: str) -> None:
    with pytest.raises(ConfigurationError, match=f"^{message}$"):
        load(source, overrides)


def test_a_file_of_a_scenario_names_fmus_from_where_it_lies(tmp_path: Path) -> None:
    (tmp_path / "here").mkdir()
    scenario = load({"receiver": {"fmu": str(tmp_path / "mine.fmu")}})
    text = scenario.dump_toml(tmp_path / "here")
    assert 'fmu = "../mine.fmu"\n' in text
    (tmp_path / "here" / "dive.toml").write_text(text)
    (tmp_path / "mine.fmu").touch()
    again = load(tmp_path / "here" / "dive.toml")
    assert Path(again.receiver.fmu).samefile(tmp_path / "mine.fmu")


def test_keys_that_were_filled_in_are_not_written_for_a_foreign_fmu(tmp_path: Path) -> None:
    text = load({"target": {"fmu": "/mine.fmu", "speed_m_s": 0.7}}).dump_toml()
    target = text.partition("[target]")[2].partition("[platform]")[0]
    assert "speed_m_s = 0.7\n" in target
    assert "sampling_time_s = " in target
    assert "radius_m" not in target


@pytest.mark.parametrize(
    ("key", "name"),
    [("target.trajectory", "square"), ("platform.gps_grade", "rtk_fixed"),
     ("acoustics.clock_grade", "tcxo"), ("acoustics.packet_content", "pose")],
)  # fmt: skip
def test_a_text_of_numpy_is_a_name_like_any_other(key: str, name: str) -> None:
    """As in `numpy.unique` of a column; pydantic before 2.10 refuses them."""
    given = load("harbour-square", {key: np.str_(name)})
    assert given.dump_toml() == load("harbour-square", {key: name}).dump_toml()


def test_a_file_gives_its_name_and_finds_fmus_beside_it(tmp_path: Path) -> None:
    file = tmp_path / "dive.toml"
    file.write_text('[receiver]\nfmu = "mine.fmu"\n')
    scenario = load(file)
    assert scenario.name == "dive"
    assert scenario.receiver.fmu == str(tmp_path / "mine.fmu")
    assert scenario.receiver.type is None


def test_a_written_scenario_follows_another_seed() -> None:
    """As the one that it was written from; a seed that was given to a component stays."""
    scenario = load("harbour-square", {"seed": 4, "acoustics.seed": 9})
    again = load(tomllib.loads(scenario.dump_toml()))
    for made in (scenario, again):
        other = made.override({"seed": 5})
        assert [getattr(other, name).seed for name in CORE_COMPONENTS] == [5, 5, 9]
    assert again.dump_toml() == scenario.dump_toml()


WAVES = {"platform.motion": "spectrum", "platform.wave_height_m": 1.0}


@pytest.mark.parametrize(("changes", "message"), [
    ({"platform.motion": "spectrum"}, r"platform.motion: must come with wave_height_m or beaufort "
     "when it is 'spectrum', got neither"),
    (WAVES | {"platform.wave_height_m": -0.1}, "platform.wave_height_m: must be at least 0.0, got"),
    (WAVES | {"platform.wave_period_s": -5.0}, "platform.wave_period_s: must be at least 0.5 or"),
    (WAVES | {"platform.wave_period_s": "long"}, "wave_period_s: must be a number or 'dev"),
    (WAVES | {"platform.wave_peak_enhancement": 0.5}, "wave_peak_enhancement: must be at least 1"),
    (WAVES | {"platform.wave_components": 0}, "wave_components: must be at least 1, got 0"),
    (WAVES | {"platform.wave_components": 17}, "platform.wave_components: must be at most 16"),
    (WAVES | {"platform.raft_size_m": 0.0}, "platform.raft_size_m: must be at least 0.1"),
    (WAVES | {"platform.watch_circle_m": -3.0}, "platform.watch_circle_m: must be at least 0.0"),
    (WAVES | {"platform.mooring_time_s": 0.0}, "platform.mooring_time_s: must be at least 0.1"),
    (WAVES | {"platform.motion": "waves"}, "platform.motion: must be 'sines' or 'spectrum'"),
])  # fmt: skip
def test_a_sea_that_cannot_be_is_refused_in_one_line(changes: Any, message: str) -> None:
    with pytest.raises(ConfigurationError, match=message) as refused:
        load("paper-scenario-1", changes)
    assert "\n" not in str(refused.value)


def test_a_beaufort_number_sets_the_sea_of_a_spectrum() -> None:
    scenario = load("paper-scenario-1", {"platform.motion": "spectrum", "platform.beaufort": 4})
    assert (scenario.platform.wave_height_m, scenario.platform.wave_period_s) == (1.0, 5.0)
    calm = load("paper-scenario-1", {"platform.motion": "spectrum", "platform.beaufort": 0})
    assert (calm.platform.wave_height_m, calm.platform.wave_period_s) == (0.0, "developed")
