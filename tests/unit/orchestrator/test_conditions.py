"""The conditions of a scenario in words, each with its number and its limits."""

from __future__ import annotations

from typing import Any

import pytest
from sblcosim.scenario.conditions import conditions
from sblcosim.scenario.scenario import load

BASE: dict[str, Any] = {
    "time.sampling_time_s": 0.25, "acoustics.range_std_m": 0.07, "platform.arm_length_m": 1.5,
}  # fmt: skip
REST = "platform at rest"
GPS = "GPS without error"
ARMS = "4 beacons on arms of 1.5 m"
PINGS = "a ping every 0.25 s"
NOISE = "range noise 0.07 m (1σ)"
SET = "exact clock, speed of sound and mounting"
PLAIN = [REST, GPS, ARMS, PINGS, NOISE, SET]
BUOYS = ["beacons at rest", "GPS on each buoy without error"]


def said(**keys: Any) -> list[str]:
    changes = {key.replace("__", "."): value for key, value in keys.items()}
    return conditions(load({}, {**BASE, **changes}))


def changed(**places: str | None) -> list[str]:
    """`PLAIN` with other words; None: without."""
    names = ("rest", "gps", "arms", "pings", "noise", "exact")
    found = [places.get(name, words) for name, words in zip(names, PLAIN, strict=True)]
    return [words for words in found if words is not None]


def test_a_plain_scenario_is_at_rest_and_exact() -> None:
    assert said() == PLAIN


@pytest.mark.parametrize(("keys", "words"), [
    ({"beaufort": 3}, ["Beaufort 3"]),
    ({"beaufort": 3, "wave_height_m": 9.0}, ["Beaufort 3"]),  # sines take no waves
    ({"beaufort": 3, "roll_amplitude_deg": 8.0},
     ["roll of ±8°", "pitch and yaw of ±5.52°", "heave of ±0.212 m"]),
    ({"beaufort": 3, "surge_amplitude_m": 2.0}, ["Beaufort 3", "surge of ±2 m"]),
    ({"roll_amplitude_deg": 2.0, "pitch_amplitude_deg": 3.0, "yaw_amplitude_deg": 2.0,
      "surge_amplitude_m": 0.5, "heave_amplitude_m": 0.5, "sway_amplitude_m": 0.25},
     ["roll and yaw of ±2°", "pitch of ±3°", "surge and heave of ±0.5 m", "sway of ±0.25 m"]),
    ({"motion": "spectrum", "beaufort": 4}, ["Beaufort 4 as a spectrum"]),
    ({"motion": "spectrum", "beaufort": 4, "roll_amplitude_deg": 9.0, "watch_circle_m": 6.0},
     ["Beaufort 4 as a spectrum", "drift in a circle of 6 m"]),
    ({"motion": "spectrum", "wave_height_m": 0.75, "wave_period_s": 5.5, "yaw_amplitude_deg": 4.0},
     ["waves of 0.75 m (significant height, peak at 5.5 s)", "yaw of ±4°"]),
    ({"motion": "spectrum", "wave_height_m": 0.75, "wave_period_s": "developed"},
     ["waves of 0.75 m (significant height, fully developed)"]),
    ({"boat_speed_m_s": 1.5}, ["boat under way at 1.5 m/s"]),
    ({"beaufort": 2, "boat_speed_m_s": 1.5}, ["Beaufort 2", "boat under way at 1.5 m/s"]),
    ({"track_time_s": (0.0, 9.0), "track_m": (0.0, 0.0, 3.0, 4.0),
      "track_heading_deg": (0.0, 0.0)}, ["boat on a recorded track"]),
])  # fmt: skip
def test_what_moves_the_platform(keys: dict[str, Any], words: list[str]) -> None:
    found = said(**{f"platform__{key}": value for key, value in keys.items()})
    assert found == [*words, *PLAIN[1:]]


@pytest.mark.parametrize(("keys", "found"), [
    ({"gps_grade": "rtk_fixed"}, changed(gps="RTK fixed GPS")),
    ({"gps_grade": "sbas"}, changed(gps="SBAS GPS")),
    ({"gps_grade": "standalone"}, changed(gps="standalone GPS")),
    ({"gps_grade": "standalone", "gps_shared": False},
     ["beacons at rest", "standalone GPS on each buoy", *PLAIN[2:5], "exact clock and speed of "
      "sound"]),
    ({"gps_shared": False}, [*BUOYS, *PLAIN[2:5], "exact clock and speed of sound"]),
    ({"gps_horizontal_std_m": 0.2, "gps_horizontal_bias_std_m": 0.6,
      "gps_horizontal_markov_std_m": 0.9, "gps_vertical_std_m": 0.5},
     changed(gps="GPS error 1.1 m horizontal (1σ per axis) and 0.5 m vertical (1σ)")),
    ({"gps_vertical_bias_std_m": 0.3, "gps_vertical_markov_std_m": 0.4},
     changed(gps="GPS error 0.5 m vertical (1σ)")),
    ({"gps_grade": "rtk_fixed", "gps_vertical_bias_std_m": 0.3},
     changed(gps="GPS error 0.00707 m horizontal (1σ per axis) and 0.301 m vertical (1σ)")),
    ({"imu_grade": "tactical"}, changed(gps=f"{GPS}|tactical IMU")),
    ({"imu_heading_std_deg": 2.0, "imu_heading_bias_deg": 1.0, "imu_heading_turn_on_std_deg": 4.0,
      "imu_heading_markov_std_deg": 6.0, "imu_heading_step_deg": 8.0},
     changed(gps=f"{GPS}|heading error 11° RMS")),
    ({"imu_heading_std_deg": 2.0, "gps_shared": False},
     [*BUOYS, *PLAIN[2:5], "exact clock and speed of sound"]),
    ({"mounting_std_m": 0.04},
     ["beacons at rest", ARMS, "beacons surveyed to 0.04 m (1σ per axis)", PINGS, NOISE,
      "exact clock and speed of sound"]),
    ({"mounting_std_m": 0.04, "gps_vertical_std_m": 0.5},
     changed(gps="GPS error 0.5 m vertical (1σ)", arms=f"{ARMS}|beacons surveyed to 0.04 m (1σ per "
             "axis)", exact="exact clock and speed of sound")),
    ({"misalignment_tilt_std_deg": 0.5, "misalignment_heading_std_deg": 1.5},
     changed(arms=f"{ARMS}|beacons' frame misaligned by 0.5° in tilt and 1.5° in heading (1σ)",
             exact="exact clock and speed of sound")),
    ({"mounting_error_m": ((0.0, 0.0, 0.1), *3 * ((0.0, 0.0, 0.0),))},
     changed(exact="exact clock and speed of sound")),
    ({"beacon_scale": 3.0}, changed(arms="4 beacons on arms of 4.5 m")),
    ({"beacon_m": ((0.0, 0.0, 1.0), (5.0, 0.0, 1.0), (0.0, 5.0, 1.0))}, changed(arms="3 beacons")),
])  # fmt: skip
def test_where_the_beacons_are_and_how_well_that_is_known(
    keys: dict[str, Any], found: list[str]
) -> None:
    wanted = [words for some in found for words in some.split("|")]
    assert said(**{f"platform__{key}": value for key, value in keys.items()}) == wanted


TWO_WAY = {"ranging": "two_way", "turnaround_s": 0.02}
WITHOUT_CLOCK = "exact speed of sound and mounting"


@pytest.mark.parametrize(("keys", "found"), [
    ({"range_std_m": 0.0}, changed(noise="ranges without noise")),
    ({"loss_probability": 0.25}, changed(noise=f"{NOISE}|25 % packet loss")),
    ({"loss_probability": 0.25, "loss_burst_length": 3.0},
     changed(noise=f"{NOISE}|25 % packet loss in bursts of 3 packets")),
    ({"shadow_loss_probability": 0.4},
     changed(noise=f"{NOISE}|40 % loss in the shadow of the diver's body")),
    ({"loss_probability": 0.25, "surface_echo_probability": 0.5, "bottom_echo_probability": 0.5},
     changed(noise=f"{NOISE}|25 % packet loss|echoes from surface")),
    ({"loss_probability": 0.25, "surface_echo_probability": 0.5, "bottom_echo_probability": 0.5,
      "water_depth_m": 30.0},
     changed(noise=f"{NOISE}|25 % packet loss|echoes from surface and bottom")),
    ({"shadow_loss_probability": 0.4, "bottom_echo_probability": 0.5, "water_depth_m": 30.0},
     changed(noise=f"{NOISE}|40 % loss in the shadow of the diver's body|echoes from bottom")),
    ({"surface_echo_probability": 0.5}, PLAIN),
    ({"outlier_probability": 0.05, "outlier_mean_m": 2.0}, changed(noise=f"{NOISE}|5 % outliers")),
    ({"outlier_probability": 0.05, "outlier_mean_m": 0.0}, PLAIN),
    ({"sound_speed_m_s": 1470.0, "assumed_sound_speed_m_s": 1499.4},
     changed(noise=f"{NOISE}|speed of sound off by 2 %", exact="exact clock and mounting")),
    ({"sound_speed_m_s": 1500.0, "assumed_sound_speed_m_s": 1470.0},
     changed(noise=f"{NOISE}|speed of sound off by 2 %", exact="exact clock and mounting")),
    ({"schedule": "simultaneous"}, changed(pings="pings of all every 0.25 s")),
    ({"ranging": "inverted"},
     changed(pings="a ping of the diver every 0.25 s", noise=f"inverted ranging|{NOISE}")),
    (TWO_WAY, changed(noise=f"two-way ranging|{NOISE}", exact=WITHOUT_CLOCK)),
    ({**TWO_WAY, "turnaround_std_s": 2e-3, "turnaround_bias_std_s": 6e-3,
      "turnaround_beacon_std_s": 9e-3},
     changed(noise=f"two-way ranging|turn-around error 11 ms (1σ)|{NOISE}", exact=WITHOUT_CLOCK)),
    ({**TWO_WAY, "clock_offset_s": 1.0}, changed(noise=f"two-way ranging|{NOISE}",
                                                 exact=WITHOUT_CLOCK)),
    ({"clock_grade": "tcxo"}, changed(noise=f"{NOISE}|TCXO clock just set", exact=WITHOUT_CLOCK)),
    ({"clock_grade": "crystal", "clock_sync_age_s": 5400.0},
     changed(noise=f"{NOISE}|crystal clock set 90 min before", exact=WITHOUT_CLOCK)),
    ({"clock_drift_s_s": 3e-6, "clock_drift_std_s_s": 4e-6, "clock_sync_age_s": 90.0},
     changed(noise=f"{NOISE}|clock set 1.5 min before with a drift of 5 ppm (1σ)",
             exact=WITHOUT_CLOCK)),
    ({"clock_offset_s": 3e-5, "clock_offset_std_s": 4e-5},
     changed(noise=f"{NOISE}|clock offset 0.05 ms (1σ)", exact=WITHOUT_CLOCK)),
])  # fmt: skip
def test_what_happens_to_ranges(keys: dict[str, Any], found: list[str]) -> None:
    wanted = [words for some in found for words in some.split("|")]
    assert said(**{f"acoustics__{key}": value for key, value in keys.items()}) == wanted


def test_of_another_fmu_only_the_name_is_known() -> None:
    assert said(platform__fmu="boats/mine.fmu") == [
        "platform of mine.fmu", PINGS, NOISE, "exact clock and speed of sound"]
    assert said(acoustics__fmu="boats/sea.fmu") == [
        REST, GPS, ARMS, "acoustics of sea.fmu", "exact mounting"]


def test_a_grade_is_named_while_its_keys_have_its_values_but_for_rounding() -> None:
    key, grade = "platform.gps_horizontal_std_m", {"platform__gps_grade": "standalone"}
    value = load({}, {"platform.gps_grade": "standalone"}).platform.gps_horizontal_std_m
    for factor, named in ((1 + 5e-10, True), (1 + 1.5e-9, False)):
        found = said(**grade, **{key.replace(".", "__"): value * factor})
        assert ("standalone GPS" in found) == named
    zero = {"platform__gps_grade": "rtk_fixed", "platform__gps_vertical_bias_std_m": 0.0}
    for size, named in ((5e-13, True), (1.5e-12, False)):
        found = said(**{**zero, "platform__gps_vertical_bias_std_m": size})
        assert ("RTK fixed GPS" in found) == named
