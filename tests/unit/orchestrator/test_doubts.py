"""What is valid in a scenario, and perhaps not what is meant."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
import sblcosim
from sblcosim.cli.common.app import app
from sblcosim.errors import ConfigurationWarning
from sblcosim.models import RECEIVERS
from sblcosim.scenario.arrangement import degenerate
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
