"""What is valid in a scenario, and perhaps not what is meant."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
import sblcosim
from python_components import Sampler
from sblcosim.cli.common.app import app
from sblcosim.errors import ConfigurationError, ConfigurationWarning
from sblcosim.models import RECEIVERS
from sblcosim.models.declaration import output, parameter
from sblcosim.scenario.arrangement import degenerate, errors_of, keys_of_errors
from sblcosim.scenario.components import takes
from sblcosim.scenario.doubts import PURPOSES, doubts
from sblcosim.scenario.likes import LIKES
from sblcosim.scenario.scenario import load, shipped
from sblcosim.scenario.sources import choose
from sblcosim.scenario.wiring import connect
from typer.testing import CliRunner


def said(
    overrides: dict[str, Any], source: Any = "realistic-dive", receivers: Any = ()
) -> list[str]:
    scenario = load(source, overrides)
    return [*doubts(scenario, choose(scenario, receivers))]


@pytest.mark.parametrize("source", [*shipped(), *(like.source for like in LIKES.values())])
def test_of_what_comes_along_there_are_none(source: Any) -> None:
    assert not said({}, source)


# Above the water ---------------------------------------------------------------------------------


def test_waypoints_above_the_water_are_told() -> None:
    rows = [[0.0, 0.0, 5.0], [10.0, 0.0, -6.5], [10.0, 10.0, -2.5], [0.0, 10.0, -2.0]]
    (line,) = said({"target.waypoint_m": rows})
    assert line == (
        "override target.waypoint_m[2,3]: should be under water (down is positive), got a depth of "
        "-6.5 m, likewise 1 more of 4 rows"
    )
    assert not said({"target.waypoint_m": rows[:1] + rows[3:]})  # in the waves


def test_waypoints_that_nobody_follows_are_not_told() -> None:
    rows = [[0.0, 0.0, 5.0], [10.0, 0.0, 5.0], [10.0, 10.0, -9.0]]
    assert said({"target.waypoint_m": rows})
    assert not said({"target.waypoint_m": rows, "target.waypoint_count": 2})
    assert not said({"target.waypoint_m": rows, "target.trajectory": "semicircle"})


def test_beacons_above_the_water_are_told() -> None:
    rows = [[20.0, 0.0, 3.0], [-20.0, 0.0, -0.5], [0.0, 20.0, 0.0], [0.0, -20.0, -2.0]]
    (line,) = said({"platform.beacon_m": rows})
    assert line == (
        "override platform.beacon_m: beacons should be under water (down is positive), got beacon "
        "2 at a depth of -0.5 m, likewise 1 more of 4 beacons"
    )
    (line,) = said({"platform.beacon_m": [[*row[:2], abs(row[2])] for row in rows[:3]] + rows[3:]})
    assert line.endswith("got beacon 4 at a depth of -2 m")
    (line,) = said({"platform.beacon_depth_m": -1.5})
    assert line.startswith("override platform.beacon_depth_m: beacons should be under water")
    assert line.endswith("got beacon 1 at a depth of -1.5 m, likewise 3 more of 4 beacons")
    assert not said({"platform.beacon_depth_m": 0.0})


@pytest.mark.parametrize("table", ["target", "platform"])
def test_a_departure_after_the_end_of_the_run_is_told(table: str) -> None:
    key = f"{table}.departure_time_s"
    for departs, told in ((59.0, False), (60.0, True), (9999.0, True)):
        found = said({key: departs, "time.duration_s": 60.0})
        assert found == [
            f"override {key}: should be before the end of the run at 60 s, got {departs:g} s: "
            "nothing of the path is followed"
        ] * told
    assert not said({key: 9999.0})  # the run lasts as long as the path


# Sound -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("key", ["sound_speed_m_s", "assumed_sound_speed_m_s"])
def test_a_speed_that_sound_has_in_no_water_is_told(key: str) -> None:
    for speed, told in ((1349.0, True), (1350.0, False), (1650.0, False), (1651.0, True)):
        line = (
            f"override acoustics.{key}: should be from 1350 to 1650 m/s, as in water, got "
            f"{speed:g} m/s"
        )
        assert said({f"acoustics.{key}": speed}) == [line] * told


# Receivers that do not suit ----------------------------------------------------------------------

OWN = "each beacon has an error of its own: "
BUOYS = (
    "each buoy has its own GPS: the covariance does not fit, and the error is small only while "
    "the buoys keep their arrangement; compare it with long_baseline"
)
SHARED = "all beacons share the errors of one platform: try coupled"


@pytest.mark.parametrize(
    ("source", "receiver", "words"),
    [
        ("gps-buoys", "coupled", BUOYS),
        ("gps-buoys", "fixed_lag", BUOYS),
        ("harbour-lbl", "coupled", f"{OWN}try long_baseline"),
        ("harbour-lbl", "fixed_lag", f"{OWN}compare it with long_baseline"),
        ("realistic-dive", "long_baseline", SHARED),
    ],
)
def test_a_receiver_that_does_not_suit_is_told(source: str, receiver: str, words: str) -> None:
    line = f"receiver {receiver}: is for {PURPOSES[receiver]}; here {words}"
    chosen = ("sequential", receiver, "ekf")
    assert said({}, source, chosen) == [line]
    assert said({}, source, {"mine": receiver}) == [line.replace(receiver, "mine", 1)]
    with pytest.warns(ConfigurationWarning) as caught:
        connect(load(source), chosen)
    assert [str(w.message) for w in caught] == [line]


@pytest.mark.parametrize(
    ("source", "receiver"), [("harbour-lbl", "coupled"), ("realistic-dive", "long_baseline")]
)
def test_a_receiver_to_try_is_better(source: str, receiver: str) -> None:
    """In most runs on the same noise: else there is nothing to try."""
    (line,) = said({}, source, receiver)
    instead = line.partition(": try ")[2]
    found = sblcosim.compare(source, [receiver, instead], runs=100, timed=False).table
    errors = [found[f"{label}.absolute_total_rms_m"] for label in (receiver, instead)]
    assert (errors[1] < errors[0]).sum() >= 80


def test_where_another_receiver_is_not_better_it_is_not_said_to_be() -> None:
    """Below buoys, whose arrangement is kept in the simulation, `coupled` has the smaller error."""
    found = sblcosim.compare("gps-buoys", ["coupled", "long_baseline"], runs=20, timed=False).table
    errors = [found[f"{label}.absolute_total_rms_m"] for label in ("coupled", "long_baseline")]
    assert (errors[0] < errors[1]).sum() >= 15
    for receiver in ("coupled", "fixed_lag"):
        assert "try" not in "".join(said({}, "gps-buoys", receiver))


def test_other_receivers_suit() -> None:
    for source in shipped():
        assert not said({}, source, ("ekf", "sequential", "multilateration"))
    assert not said({}, "gps-buoys", "long_baseline")
    assert not said({"platform.gps_shared": True}, "gps-buoys", "coupled")
    still = {"platform.mounting_std_m": 0.0}  # nobody errs
    assert not said(still, "harbour-lbl", ("coupled", "long_baseline"))


def test_the_list_of_receivers_says_what_each_is_for() -> None:
    assert PURPOSES.keys() == RECEIVERS.keys()
    shown = CliRunner().invoke(app, ["receivers"]).stdout
    for words in PURPOSES.values():
        assert words in shown
    document = json.loads(CliRunner().invoke(app, ["receivers", "--json"]).stdout)
    assert {r["name"]: r["purpose"] for r in document["receivers"]} == dict(PURPOSES)


@pytest.mark.parametrize("away", [(0.0, 0.0), (40.0, 0.0), (0.0, 40.0)])
@pytest.mark.parametrize("angle", [0.0, 35.0, 90.0])
def test_what_is_said_of_a_line_of_beacons_is_the_same_elsewhere(
    angle: float, away: tuple[float, float]
) -> None:
    turn = np.radians(angle)
    ahead = np.array([np.cos(turn), np.sin(turn), 0.0])
    aside = np.array([-np.sin(turn), np.cos(turn), 0.0])
    place = np.array([*away, 1.0])
    on_line = np.array([place + s * ahead for s in (-3.0, -1.0, 1.0, 3.0)])
    for off, words in ((0.0, "are on one line"), (0.1, "are nearly on one line"), (0.6, None)):
        said = degenerate(tuple((on_line + np.outer([off, -off, -off, off], aside)).ravel()))
        if words is None:
            assert said is None
        else:
            assert said is not None
            assert f"seen from above the beacons {words}, {angle:.0f}° from forward" in said


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.0])
@pytest.mark.parametrize(("across", "said"), [
    (0.0, " on one line"), (0.049, " nearly on one line"), (0.051, None), (0.09, None), (1.0, None),
])  # fmt: skip
def test_beacons_are_nearly_on_a_line_below_a_twentieth(
    across: float, said: str | None, turn: float
) -> None:
    """Ratio of the spreads across and along; a rectangle's are its sides."""
    corners = np.array([(x, across * y) for x in (-3.0, 3.0) for y in (-3.0, 3.0)])
    c, s = np.cos(turn), np.sin(turn)
    offsets = np.column_stack([corners @ [[c, s], [-s, c]] + [1.0, -2.0], np.full(4, 0.5)])
    found = degenerate(tuple(offsets.ravel().tolist()))
    assert found is None if said is None else said in (found or "")


# The kind of errors that beacons have ------------------------------------------------------------


SINES = ("roll_amplitude_deg", "pitch_amplitude_deg", "yaw_amplitude_deg", "surge_amplitude_m",
         "sway_amplitude_m", "heave_amplitude_m")  # fmt: skip
SPECTRUM = ("yaw_amplitude_deg", "wave_height_m", "watch_circle_m")
SENSORS = (
    "gps_horizontal_std_m", "gps_vertical_bias_std_m", "gps_horizontal_markov_std_m",
    "imu_tilt_std_deg", "imu_heading_bias_deg", "imu_heading_turn_on_std_deg",
    "imu_tilt_markov_std_deg", "imu_heading_step_deg", "imu_heading_drift_deg_s",
    "imu_tilt_temperature_coefficient_deg_K", "misalignment_tilt_std_deg",
    "misalignment_heading_std_deg",
)  # fmt: skip


def kind_of(**keys: Any) -> str | None:
    return errors_of(load({}, {f"platform.{key}": value for key, value in keys.items()}).platform)


def test_beacons_have_the_errors_of_a_survey_until_something_moves_or_is_shared() -> None:
    assert kind_of() is None
    assert kind_of(mounting_std_m=0.1) == "survey"
    for key in SINES:
        assert kind_of(mounting_std_m=0.1, **{key: 0.5}) is None
    sea = {"motion": "spectrum", "wave_height_m": 0.0}
    for key in {*SINES, *SPECTRUM}:
        moved = kind_of(mounting_std_m=0.1, **{**sea, key: 0.5})
        assert moved == (None if key in SPECTRUM else "survey")
    assert kind_of(mounting_std_m=0.1, wave_height_m=0.5) == "survey"  # sines take no waves
    assert kind_of(mounting_std_m=0.1, boat_speed_m_s=0.5) is None
    track = {"track_time_s": (0.0, 9.0), "track_m": (0.0, 0.0, 3.0, 4.0),
             "track_heading_deg": (0.0, 0.0)}  # fmt: skip
    assert kind_of(mounting_std_m=0.1, **track) is None
    assert kind_of(mounting_std_m=0.1, imu_tilt_scale_factor_error=0.1) == "survey"
    for key in SENSORS:
        assert kind_of(mounting_std_m=0.1, **{key: 0.5}) == kind_of(**{key: 0.5}) == "platform"
    assert kind_of(gps_antenna_offset_m=(0.0, 0.2, 0.0)) == "platform"
    assert kind_of(gps_shared=False) == kind_of(gps_shared=False, imu_tilt_std_deg=1.0) == "buoys"
    assert kind_of(fmu="other.fmu", gps_shared=False) is None
    assert kind_of(fmu="other.fmu", gps_horizontal_std_m=1.0) is None


def test_keys_of_motion_and_sensors_are_listed_by_kind() -> None:
    found = keys_of_errors(type(load({}).platform))
    assert {*found["motions"]["sines"]} == {*SINES}
    assert {*found["motions"]["spectrum"]} == {*SPECTRUM}
    assert {*SENSORS, "gps_antenna_offset_m"} <= {*found["sensors"]}
    assert not {"gps_correlation_time_s", "mounting_std_m", *SINES} & {*found["sensors"]}


@pytest.mark.parametrize(("apart", "same"), [(9e-7, True), (1.1e-6, False)])
def test_beacons_within_a_micrometre_are_at_the_same_position(apart: float, same: bool) -> None:
    rows = [[0.0, 0.0, 1.0], [4.0, 2.0, 1.0], [0.0, 5.0, 1.0],
            [4.0 + 0.6 * apart, 2.0, 1.0 - 0.8 * apart]]  # fmt: skip
    if not same:
        assert load({}, {"platform.beacon_m": rows}).beacons == 4
        return
    with pytest.raises(ConfigurationError) as caught:
        load({}, {"platform.beacon_m": rows})
    assert str(caught.value) == (
        "override platform.beacon_m: must have each beacon at a different position, got beacons 2 "
        "and 4 at [4.0, 2.0, 1.0]"
    )


def test_beacons_below_each_other_are_on_a_vertical_line() -> None:
    said_ = degenerate((1.0, 2.0, 1.0, 1.0, 2.0 + 5e-7, 3.0, 1.0, 2.0, 5.0))
    assert said_ is not None
    assert said_.startswith("all beacons are on one vertical line: ranges give the diver's")
    found = degenerate((1.0, 2.0, 1.0, 1.0, 2.0 + 2e-6, 3.0, 1.0, 2.0, 5.0))
    assert found is not None
    assert "on one line, 90° from forward" in found


# What a receiver of a user takes -----------------------------------------------------------------


@pytest.mark.parametrize(("bounds", "does"), [
    ({"min": -1.0}, True), ({"min": -3.0, "max": -1.0}, True), ({"min": -3.0}, True),
    ({"min": -0.5}, False), ({"min": -3.0, "max": -2.0}, False), ({}, False),
    ({"max": 4.0}, False), (None, None),
])  # fmt: skip
def test_a_receiver_takes_a_word_if_it_says_that_its_value_is_within_bounds(
    bounds: dict[str, float] | None, does: bool | None
) -> None:
    """A parameter without a least value says nothing of a value below that of numbers."""
    class Mine(Sampler):
        variables = (
            output("acceleration_psd", "", "m2/s3") if bounds is None
            else parameter("acceleration_psd", "", "m2/s3", start=-1.0, **bounds),
        )

    assert takes(Mine, "acceleration_psd_m2_s3", -1.0) is does


@pytest.mark.parametrize("name", RECEIVERS)
def test_of_our_receivers_those_take_the_word_that_learn(name: str) -> None:
    learn = {"coupled", "fixed_lag", "long_baseline", "array"}
    wanted = None if name == "multilateration" else name in learn
    assert takes(name, "acceleration_psd_m2_s3", -1.0) is wanted
