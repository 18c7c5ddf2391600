"""A boat under way: where it is, and that receivers do not take its way for an error of its GPS."""

from __future__ import annotations

import warnings
from math import cos, hypot, radians, sin, sqrt
from typing import Any

import numpy as np
import pytest
import sblcosim
from sblcosim.errors import ConfigurationError
from sblcosim.limits.unknown import squares
from sblcosim.scenario.arrangement import has_own_errors
from sblcosim.scenario.conditions import conditions as words_of
from sblcosim.scenario.scenario import load

from .from_the_model import dive, platform
from .near_the_bound import found_in

RUNS = 200
WAY = {"boat_speed_m_s": 0.5, "boat_course_deg": 130.0}
SEA = {"motion": "spectrum", "wave_height_m": 0.3, "watch_circle_m": 2.0}


@pytest.mark.parametrize("master", ["python", "native", "lanes"])
@pytest.mark.parametrize("sea", [{}, SEA])
def test_it_moves_at_its_speed_along_its_course_and_points_there(
    master: str, sea: dict[str, Any]
) -> None:
    keys = {f"platform.{key}": it for key, it in {**sea, **WAY}.items()}
    short = {"time.duration_s": 20.0}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        under_way, moored = (
            sblcosim.run("realistic-dive", "multilateration", {**it, **short}, master=master).record
            for it in (keys, {f"platform.{key}": it for key, it in
                              {**sea, "mean_heading_deg": 130.0}.items()})
        )
    moved = under_way.values["platform.position"] - moored.values["platform.position"]
    since = (under_way.time_ns - under_way.time_ns[0])[:, None] / 1e9
    course = radians(130)
    expected = 0.5 * since * [cos(course), sin(course), 0.0]
    assert moved == pytest.approx(expected, abs=1e-9)
    attitude = "platform.attitude"
    assert np.array_equal(under_way.values[attitude], moored.values[attitude])
    beacons = "platform.reported_beacon_position"
    shift = under_way.values[beacons] - moored.values[beacons]
    assert shift.reshape(len(moved), -1, 3) == pytest.approx(
        np.repeat(expected[:, None], 4, axis=1), abs=1e-9
    )


def test_a_given_heading_wins() -> None:
    ahead, sideways = (load("realistic-dive", {f"platform.{k}": v for k, v in it.items()})
                       for it in (WAY, {**WAY, "mean_heading_deg": 20.0}))
    assert ahead.platform.mean_heading_deg == 130.0
    assert sideways.platform.mean_heading_deg == 20.0
    still = load("realistic-dive", {"platform.boat_course_deg": 130.0})
    assert still.platform.mean_heading_deg == 0.0
    assert ("platform", "boat_course_deg") in still.idle()


def test_receivers_know_the_speed_beside_that_of_waves() -> None:
    """The mean square adds; the noise of the velocity, 2 σ²/τ, is that of the waves alone."""
    def told(**keys: Any) -> tuple[float, float]:
        found = load({"platform": keys}).assumptions()
        return found["platform_velocity_std_m_s"], found.get("platform_velocity_time_s", np.nan)

    assert told(**WAY) == pytest.approx((0.5 / sqrt(2), 1e6))
    waves = {"surge_amplitude_m": 0.2, "surge_frequency_Hz": 0.3}
    (std, time), (both, longer) = told(**waves), told(**waves, **WAY)
    assert both == pytest.approx(hypot(std, 0.5 / sqrt(2)))
    assert both**2 / longer == pytest.approx(std**2 / time)
    gps = load({"platform": {**WAY, "gps_grade": "sbas"}}).assumptions()
    moored = load({"platform": {"gps_grade": "sbas"}}).assumptions()
    for key in ("gps_std_m", "gps_markov_std_m", "gps_bias_std_m"):
        assert gps[key] == moored[key]


@pytest.mark.parametrize("more", [{}, {"packet_content": "pose", "packet_resolution_m": 0.01}])
@pytest.mark.parametrize("course", [0.0, 130.0])
def test_coupled_is_near_the_bound(course: float, more: dict[str, Any]) -> None:
    """Motion, errors and biases are drawn from the model; the boat covers 30 m."""
    scenario = dive(
        {"sampling_time_s": 0.5, "duration_s": 60.0},
        {**platform(3.0), "boat_speed_m_s": 0.5, "boat_course_deg": course},
        {"range_std_m": 0.05, "loss_probability": 0.15, **more},
        {"acceleration_psd_m2_s3": 0.002},
    )
    found = found_in(scenario, RUNS)
    assert found.lost == 0.0
    assert found.is_near
    assert 2.7 < found.nees < 3.4


def test_the_data_sheet_says_so() -> None:
    quiet = {"platform": WAY}
    assert "boat under way at 0.5 m/s" in words_of(load(quiet))
    assert "at rest" not in words_of(load(quiet))
    assert "under way" not in words_of(load("realistic-dive"))


def test_surveyed_beacons_do_not_sail() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert has_own_errors(load("harbour-lbl").platform)
        assert not has_own_errors(load("harbour-lbl", {
            "platform.boat_speed_m_s": 0.5}).platform)


def test_what_is_left_out_is_where_the_boat_is_then() -> None:
    """A diver who keeps pace with the boat has the same error as beside one at rest."""
    keys = {"platform.mounting_std_m": 0.05, "platform.mean_heading_deg": 0.0}
    way = {**keys, **{f"platform.{key}": it for key, it in WAY.items()}}
    time, course = np.array([0.0, 100.0]), radians(130)
    there = np.array([[20.0, 0.0, 5.0]] * 2)
    beside = there + 0.5 * time[:, None] * [cos(course), sin(course), 0.0]
    moored = squares(load("realistic-dive", keys), there, time)
    under_way = squares(load("realistic-dive", way), beside, time)
    for words, it in moored.items():
        assert under_way[words] == pytest.approx(it)


@pytest.mark.parametrize(("keys", "words"), [
    ({"boat_speed_m_s": -1.0}, "platform.boat_speed_m_s: must be at least 0.0, got -1"),
    ({"boat_speed_m_s": 40.0}, "platform.boat_speed_m_s: must be at most 20.0, got 40"),
])
def test_bad_input_is_one_line(keys: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        load("realistic-dive", {f"platform.{key}": it for key, it in keys.items()})
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_map_refuses_it() -> None:
    with pytest.raises(ConfigurationError, match="must be 0 for a map, as a boat under way") as e:
        sblcosim.map_area("realistic-dive", "20x20", 5, cells=3, runs=2,
                          overrides={f"platform.{key}": it for key, it in WAY.items()})
    assert "\n" not in str(e.value)
