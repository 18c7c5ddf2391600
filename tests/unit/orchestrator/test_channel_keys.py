"""Keys of the channel: what follows from them, what is refused, and what is doubtful."""

from __future__ import annotations

import re
import tomllib
import warnings
from importlib import resources
from typing import Any

import numpy as np
import pytest
import sblcosim
from sblcosim.comparison.budget import sources
from sblcosim.errors import ConfigurationError, NoEffectWarning
from sblcosim.limits import echoes, places, reference
from sblcosim.limits.parameters import conditions
from sblcosim.scenario import water
from sblcosim.scenario.doubts import doubts
from sblcosim.scenario.scenario import load
from sblcosim.scenario.schema import Acoustics
from sblcosim.scenario.timing import slot_of
from sblcosim.scenario.wiring import connect

HARBOUR = "harbour-square"
A = "acoustics."


def refused(**keys: Any) -> str:
    with pytest.raises(ConfigurationError) as caught:
        load(HARBOUR, {f"{A}{key}": value for key, value in keys.items()}.items())
    return str(caught.value)


@pytest.mark.parametrize(("keys", "expected"), [
    ({"salinity": -1.0}, "override acoustics.salinity: must be at least 0.0, got -1.0"),
    ({"loss_burst_length": 0.5}, "override acoustics.loss_burst_length: must be at least 1 packet, "
     "or 0 for losses that are independent of each other, got 0.5"),
    ({"loss_burst_length": 2.0, "loss_probability": 0.8},
     "override acoustics.loss_burst_length: must be at least 4, as 0.8 of all packets are lost and "
     "one is received between two bursts, got 2"),
    ({"water_depth_m": 1.3}, "override acoustics.water_depth_m: must be at least the depth of the "
     "diver, 2 m, got 1.3"),
    ({"profile_count": 2}, "override acoustics.profile_count: must be the number of points of "
     "profile_depth_m, 0, got 2"),
    ({"packet_duration_s": 0.2}, "override acoustics.packet_duration_s: must be at most the time "
     "between pings, 0.1 s, got 0.2 s"),
    ({"ranging": "two_way", "turnaround_s": 0.1}, "override acoustics.turnaround_s: must be less "
     "than the time between pings, 0.1 s, got 0.1 s"),
    ({"ranging": "two_way", "packet_duration_s": 0.03, "turnaround_s": 0.05}, "override "
     "acoustics.packet_duration_s: request, turn-around and answer must be within the time between "
     "pings, 0.1 s, got 0.11 s"),
    ({"turnaround_std_s": -1e-4}, "override acoustics.turnaround_std_s: must be at least 0.0, got "
     "-0.0001"),
    ({"ranging": "both"}, "override acoustics.ranging: must be 'one_way', 'two_way' or "
     "'inverted', got \"both\""),
    ({"profile_depth_m": [0.0, 5.0]}, "override acoustics.profile_depth_m: must come with "
     "profile_speed_m_s or profile_temperature_C, got neither"),
    ({"profile_depth_m": [5.0, 5.0], "profile_speed_m_s": [1500.0, 1490.0]},
     "override acoustics.profile_depth_m: must increase, got [5.0, 5.0]"),
    ({"profile_depth_m": [5.0, 2.0], "profile_speed_m_s": [1500.0, 1490.0]},
     "override acoustics.profile_depth_m: must increase, got [5.0, 2.0]"),
    ({"profile_depth_m": [0.0, 5.0], "profile_speed_m_s": [1500.0]}, "override acoustics."
     "profile_speed_m_s: must have as many numbers as profile_depth_m, 2, got 1"),
    ({"profile_depth_m": [0.0, 5.0], "profile_speed_m_s": [1500.0, 1490.0],
      "profile_temperature_C": [15.0, 14.0]}, "override acoustics.profile_temperature_C: must be "
     "left out with profile_speed_m_s"),
    ({"profile_depth_m": [0.0, 5.0], "profile_speed_m_s": [1500.0, 1490.0],
      "temperature_C": 15.0}, "override acoustics.temperature_C: must be left out with a profile, "
     "got 15"),
])  # fmt: skip
def test_a_mistake_is_told_in_one_line(keys: dict[str, Any], expected: str) -> None:
    assert refused(**keys) == expected


def doubted(keys: dict[str, Any]) -> list[str]:
    return list(doubts(load({"name": "here", **keys}), {}))


@pytest.mark.parametrize(("keys", "expected"), [
    ({"salinity": 38.0}, "salinity: has no effect without a temperature"),
    ({"sample_depth_m": 5.0}, "sample_depth_m: has no effect without temperature_C"),
    ({"temperature_C": 10.0, "sound_speed_m_s": 1500.0}, "temperature_C: has no effect, as "
     "sound_speed_m_s is 1500 m/s; in this water it is 1489.82 m/s"),
    ({"reach_m": 500.0}, "reach_m: has no effect without packet_duration_s"),
    ({"guard_interval_s": 0.1}, "guard_interval_s: has no effect without packet_duration_s"),
])  # fmt: skip
def test_keys_of_the_water_and_the_slot_from_which_nothing_follows_are_told(
    keys: dict[str, Any], expected: str
) -> None:
    assert doubted({"acoustics": keys}) == [f"here: [acoustics] {expected}"]


@pytest.mark.parametrize("keys", [
    {"temperature_C": 10.0, "salinity": 38.0, "sample_depth_m": 3.0},
    {"profile_depth_m": [0.0, 9.0], "profile_temperature_C": [20.0, 9.0], "salinity": 30.0,
     "reach_m": 10.0},
    {"packet_duration_s": 0.01, "reach_m": 10.0, "guard_interval_s": 0.01},
    {"sound_speed_m_s": 1500.0},
])  # fmt: skip
def test_those_from_which_something_follows_are_not(keys: dict[str, Any]) -> None:
    assert doubted({"acoustics": keys, "time": {"sampling_time_s": 0.5}}) == []
    again = load({"acoustics": keys}).dump_toml()  # has the speed beside the temperature
    assert not [it for it in doubts(load(tomllib.loads(again)), {}) if "no effect" in it]


@pytest.mark.parametrize("keys", [
    {"profile_depth_m": [0.0, 9.0], "profile_speed_m_s": [1520.0, 1500.0]},
    {"profile_depth_m": [0.0, 9.0], "profile_temperature_C": [20.0, 9.0]},
    {"profile_depth_m": [0.0, 9.0], "profile_temperature_C": [20.0, 9.0],
     "profile_salinity": [30.0, 38.0]},
    {"temperature_C": 10.0, "salinity": 38.0},
])  # fmt: skip
def test_a_run_with_a_profile_can_be_repeated_from_its_folder(keys: dict[str, Any]) -> None:
    scenario = load({"name": "here", "acoustics": keys})
    again = load(tomllib.loads(scenario.dump_toml()))
    assert again.model_dump() == scenario.model_dump()
    assert again.assumptions() == scenario.assumptions()


def test_waves_that_break_are_doubted() -> None:
    sea = {"motion": "spectrum", "wave_height_m": 2.0}
    assert doubted({"platform": sea | {"wave_period_s": 2.0}}) == [
        "here: [platform] wave_period_s: should be at least 2.99 s, as shorter waves of 2 m break, "
        "got 2 s"
    ]
    assert doubted({"platform": sea | {"wave_period_s": 3.0}}) == []
    assert doubted({"platform": sea}) == []


def test_a_beacon_below_the_bottom_is_refused() -> None:
    with pytest.raises(ConfigurationError) as caught:
        load("harbour-lbl", {"acoustics.water_depth_m": 1.0}.items())
    first, *_ = str(caught.value).splitlines()
    assert re.fullmatch(r"override acoustics.water_depth_m: must be at least the depth of the "
                        r"beacons, [\d.]+ m \(beacon .*\), got 1", first)


# --- The speed of sound --------------------------------------------------------------------------


def test_teos_10_gives_its_own_published_check_values() -> None:
    """The check values that come with gsw, through temperature, salinity and depth of our keys."""
    import gsw

    file = resources.files("gsw") / "tests" / "gsw_cv_v3_0.npz"
    with file.open("rb") as stream:
        values = np.load(stream)
        cv = {name: values[name] for name in
              ("SA_chck_cast", "CT_chck_cast", "t_chck_cast", "p_chck_cast", "sound_speed",
               "sound_speed_ca")}
    exact = gsw.sound_speed(
        cv["SA_chck_cast"][:, 0], gsw.CT_from_t(
            cv["SA_chck_cast"][:, 0], cv["t_chck_cast"][:, 0], cv["p_chck_cast"][:, 0]),
        cv["p_chck_cast"][:, 0],
    )
    known = np.isfinite(cv["sound_speed"][:, 0])
    tolerance = float(cv["sound_speed_ca"]) + 1e-6
    assert exact[known] == pytest.approx(cv["sound_speed"][known, 0], abs=tolerance)


@pytest.mark.parametrize(("temperature", "salinity", "depth", "expected"), [
    (22.0, 38.0, 0.0, 1530.0), (0.0, 35.0, 0.0, 1449.1), (10.0, 0.0, 0.0, 1447.3),
    (25.0, 35.0, 1000.0, 1550.8),
])  # fmt: skip
def test_other_formulas_agree(temperature: float, salinity: float, depth: float, expected: float
                              ) -> None:
    """Mackenzie 1981, and for fresh water Del Grosso and Mader 1972: to 0.4 m/s."""
    assert water.sound_speed(temperature, salinity, depth) == pytest.approx(expected, abs=0.5)


def test_the_water_weighs_as_at_45_degrees() -> None:
    import gsw

    for depth in (0.0, 200.0, 6000.0):
        pressure = gsw.p_from_z(-depth, 45.0)
        absolute = gsw.SR_from_SP(36.0)
        exact = gsw.sound_speed(absolute, gsw.CT_from_t(absolute, 8.0, pressure), pressure)
        assert water.sound_speed(8.0, 36.0, depth) == pytest.approx(exact, abs=1e-9)


def test_a_speed_of_sound_that_is_that_of_the_water_is_not_doubted() -> None:
    """To a micrometre per second, as printed numbers are."""
    speed = water.sound_speed(10.0, 35.0, 0.0)
    for more, told in ((0.0, 0), (0.7e-6, 0), (1.5e-6, 1), (-1.5e-6, 1)):
        given = {"temperature_C": 10.0, "sound_speed_m_s": speed + more}
        assert len(doubted({"acoustics": given})) == told


def test_temperature_and_salinity_set_the_true_speed_and_not_the_assumed_one() -> None:
    warm = load("realistic-dive", {f"{A}temperature_C": 22.0, f"{A}salinity": 38.0})
    assert warm.acoustics.sound_speed_m_s == water.sound_speed(22.0, 38.0, 0.0)
    assert warm.acoustics.assumed_sound_speed_m_s == 1500.0
    deep = load(warm, {f"{A}sample_depth_m": 100.0})
    assert deep.acoustics.sound_speed_m_s == pytest.approx(
        warm.acoustics.sound_speed_m_s + 1.6, abs=0.2
    )
    # The later value wins.
    assert load(deep, {f"{A}sound_speed_m_s": 1490.0}).acoustics.temperature_C is None


PROFILE = {f"{A}profile_depth_m": [0.0, 5.0, 20.0], f"{A}profile_temperature_C": [20.0, 18.0, 14.0],
           f"{A}salinity": 37.0}


def test_a_profile_of_temperatures_is_one_of_speeds() -> None:
    a = load(HARBOUR, PROFILE).acoustics
    expected = tuple(water.sound_speed(t, 37.0, z)
                     for t, z in ((20.0, 0.0), (18.0, 5.0), (14.0, 20.0)))
    assert a.profile_speed_m_s == expected
    assert a.profile_count == 3
    z = np.linspace(0.0, 20.0, 20_001)
    slow = np.interp(z, (0.0, 5.0, 20.0), 1 / np.array(expected))
    assert a.sound_speed_m_s == pytest.approx(1 / np.trapezoid(slow, z) * 20.0, rel=1e-9)


def test_the_budget_switches_the_whole_profile() -> None:
    base = load(HARBOUR, PROFILE)
    assert "sound speed" in sources.of_scenario(base)
    off = load(base.given(), sources.switched(base, ["sound speed"]).items())
    assert off.acoustics.profile_count == 0
    assert off.acoustics.sound_speed_m_s == off.acoustics.assumed_sound_speed_m_s


# --- The slot ------------------------------------------------------------------------------------

TIMED = {f"{A}packet_duration_s": 0.05, f"{A}guard_interval_s": 0.01, f"{A}reach_m": 150.0}


def test_the_slot_follows_from_packet_travel_echoes_and_guard() -> None:
    free = load(HARBOUR, {**TIMED, "time.sampling_time_s": None})
    assert free.time.sampling_time_s == free.acoustics.sampling_time_s == 0.16
    assert free.receiver.update_interval_s == 0.16
    bottom = {f"{A}water_depth_m": 60.0}
    deep = load(free, bottom)  # √(150² + 120²) m in 0.1281 s
    assert deep.time.sampling_time_s == 0.189
    cold = load(free, {f"{A}temperature_C": 0.0, f"{A}salinity": 35.0})
    assert cold.time.sampling_time_s == 0.164


def test_the_depth_of_the_water_has_an_effect_where_it_sets_the_slot() -> None:
    deep = {**TIMED, f"{A}water_depth_m": 60.0}
    free, given = (load(HARBOUR, {**deep, "time.sampling_time_s": slot}) for slot in (None, 0.5))
    assert free.acoustics.bottom_echo_probability == 0
    assert ("acoustics", "water_depth_m") not in free.idle()
    assert ("acoustics", "water_depth_m") in given.idle()
    assert "water_depth_m = 60" in free.dump_toml()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        connect(free)
    with pytest.warns(NoEffectWarning, match="water_depth_m: has no effect"):
        connect(given)


def test_a_slot_that_is_given_stays_and_is_doubted_if_it_is_short() -> None:
    given = load(HARBOUR, TIMED)
    assert given.time.sampling_time_s == 0.1
    (line,) = doubts(given, {})
    assert line == (
        "harbour-square: [time] sampling_time_s: should be at least 0.16 s, got 0.1 s: 150 m away, "
        "a packet ends 0.15 s after its ping, and collides there with the next beacon's packet"
    )
    assert not [*doubts(load(given, {"time.sampling_time_s": 0.16}), {})]


def test_a_short_slot_is_doubted_with_echoes_answers_and_turn_around() -> None:
    """√(150² + 120²) m and 150 m are 28.06 ms apart: the last echo of a bottom at 60 m."""
    deep = {**TIMED, f"{A}water_depth_m": 60.0, "time.sampling_time_s": 0.3}
    both = {**deep, f"{A}ranging": "two_way", f"{A}turnaround_s": 0.007}
    (line,) = doubts(load(HARBOUR, both), {})
    assert line == (
        "override time.sampling_time_s: should be at least 0.346 s, got 0.3 s: 150 m away, an "
        "answer's last echo ends 0.335 s after its request, and collides there with the next "
        "request"
    )
    (line,) = doubts(load(HARBOUR, {**deep, "time.sampling_time_s": 0.15}), {})
    assert line == (
        "override time.sampling_time_s: should be at least 0.189 s, got 0.15 s: 150 m away, a "
        "packet's last echo ends 0.178 s after its ping, and collides there with the next "
        "beacon's packet"
    )


@pytest.mark.parametrize("keys", [
    {"packet_duration_s": 0.1},
    {"ranging": "two_way", "packet_duration_s": 0.03, "turnaround_s": 0.04},
    {"ranging": "two_way", "turnaround_s": 0.0999},
    {"water_depth_m": 2.0},
])  # fmt: skip
def test_what_just_fits_between_two_pings_or_above_the_bottom_is_taken(
    keys: dict[str, Any]
) -> None:
    """The pings are 0.1 s apart, and the diver is 2 m deep."""
    load(HARBOUR, {f"{A}{key}": value for key, value in keys.items()})


def test_a_beacon_may_be_on_the_bottom() -> None:
    rows = ((0.0, 0.0, 1.5), (5.0, 0.0, 3.5), (0.0, 5.0, 1.5))
    keys = {"platform.beacon_m": rows, "platform.mean_position_m": (0.0, 0.0, 1.0)}
    load(HARBOUR, {**keys, f"{A}water_depth_m": 4.5})
    with pytest.raises(ConfigurationError, match=r"beacons, 4.5 m \(beacon 2\), got 4.4999"):
        load(HARBOUR, {**keys, f"{A}water_depth_m": 4.4999})


def test_rays_that_are_bent_too_much_are_doubted() -> None:
    steep = {**PROFILE, f"{A}profile_temperature_C": [28.0, 12.0, 12.0], f"{A}reach_m": 100.0}
    (line,) = doubts(load(HARBOUR, steep), {})
    assert "rays are straight here" in line
    assert not [*doubts(load(HARBOUR, {**steep, f"{A}reach_m": 10.0}), {})]
    depths, speeds = [0.0, 10.0], [1500.0, 1485.0]
    profile = {f"{A}profile_depth_m": depths, f"{A}profile_speed_m_s": speeds}
    for reach, words in ((60.0, []), (65.0, ["up to 0.012 m"])):
        said = [*doubts(load(HARBOUR, {**profile, f"{A}reach_m": reach}), {})]
        assert [line.partition("wrong by ")[2] for line in said] == words
    one = {f"{A}profile_depth_m": [2.0], f"{A}profile_speed_m_s": [1480.0], f"{A}reach_m": 500.0}
    assert [*doubts(load(HARBOUR, one), {})] == [
        "override acoustics.reach_m: has no effect without packet_duration_s"
    ]


@pytest.mark.parametrize(("changes", "needed"), [
    ({}, 0.16), ({"reach_m": None}, 0.06), ({"guard_interval_s": None}, 0.15),
    # Request, answer and turn-around, and the way there and back.
    ({"ranging": "two_way", "turnaround_s": 0.007}, 0.1 + 0.2 + 0.01 + 0.007),
    ({"turnaround_s": 0.007}, 0.16),
    # In the slowest layer: 140 m at 1400 m/s; the echo takes 3-4-5 of twice the depth.
    ({"profile_depth_m": [0.0, 9.0], "profile_speed_m_s": [1400.0, 1500.0],
      "reach_m": 140.0}, 0.16),
    ({"water_depth_m": 100.0}, 0.05 + 0.25 / 1.5 + 0.01),
    ({"sound_speed_m_s": 1000.0, "packet_duration_s": 0.0404}, 0.2004),
    ({"sound_speed_m_s": 1000.0, "packet_duration_s": 0.0400005}, 0.2000005),
])  # fmt: skip
def test_a_slot_lasts_as_long_as_its_parts(changes: dict[str, Any], needed: float) -> None:
    timed = {**TIMED, f"{A}sound_speed_m_s": 1500.0}
    if "profile_depth_m" in changes:
        del timed[f"{A}sound_speed_m_s"]
    keys = {**timed, **{f"{A}{key}": value for key, value in changes.items()}}
    acoustics = load({}, {"time.sampling_time_s": 1.0, **keys}).acoustics
    found = slot_of(acoustics)
    assert found is not None
    assert found.needed_s == pytest.approx(np.ceil(1000 * needed - 1e-5) / 1000, abs=1e-12)
    parts = (found.packet_s, found.travel_s, found.echo_s, found.guard_s, found.turnaround_s)
    assert sum(parts) == pytest.approx(needed)


def test_where_no_speed_of_sound_is_given_yet_it_is_1500_m_s() -> None:
    keys = {"packet_duration_s": 0.05, "reach_m": 150.0, "ranging": "one_way"}
    found = slot_of(Acoustics.model_validate(keys))
    assert found is not None
    assert (found.travel_s, found.needed_s) == (0.1, 0.15)


def test_there_is_no_slot_without_packets() -> None:
    assert slot_of(load({}, {f"{A}reach_m": 150.0}).acoustics) is None
    assert slot_of(load({}, {**TIMED, f"{A}fmu": "other.fmu"}).acoustics) is None


def test_the_mean_speed_of_a_profile_is_that_of_the_way_down() -> None:
    """The mean slowness of 1/1500 and 1/1200 s/m is 3/4000."""
    assert water.mean_speed([2.0, 14.0, 20.0], [1500.0, 1200.0, 1500.0]) == pytest.approx(4000 / 3)
    time = 12 * (1 / 1500 + 1 / 1200) / 2 + 6 * (1 / 1200 + 1 / 1000) / 2
    found = water.mean_speed([2.0, 14.0, 20.0], [1500.0, 1200.0, 1000.0])
    assert found == pytest.approx(18 / time)
    assert water.mean_speed([7.0], [1480.0]) == water.mean_speed([7.0, 7.0], [1480.0, 1.0]) == 1480


def test_rays_bend_as_in_the_steepest_layer() -> None:
    """40 m/s in 5 m, at the slower 1440 m/s, is steeper than 60 m/s in 10 m."""
    found = water.bending([0.0, 10.0, 15.0], [1540.0, 1480.0, 1440.0], 120.0)
    assert found == pytest.approx(120.0**3 * (8 / 1440) ** 2 / 24)
    rising = water.bending([0.0, 5.0, 15.0], [1440.0, 1480.0, 1540.0], 120.0)
    assert rising == pytest.approx(found)
    assert water.bending([3.0], [1500.0], 120.0) == 0.0
    assert water.bending([3.0, 3.0], [1500.0, 1400.0], 120.0) == 0.0


def test_temperatures_set_speeds_with_the_salinity_that_is_given() -> None:
    def speeds(**keys: Any) -> Any:
        profile = {"profile_depth_m": [0.0, 20.0], "profile_temperature_C": [18.0, 12.0]}
        given = {f"{A}{key}": value for key, value in {**profile, **keys}.items()}
        return load({}, given).acoustics.profile_speed_m_s

    usual = (water.sound_speed(18.0, 35.0, 0.0), water.sound_speed(12.0, 35.0, 20.0))
    assert speeds() == usual
    fresh = (water.sound_speed(18.0, 0.0, 0.0), water.sound_speed(12.0, 0.0, 20.0))
    assert speeds(salinity=0.0) == fresh
    both = (usual[0], fresh[1])
    assert speeds(salinity=9.0, profile_salinity=[35.0, 0.0]) == both
    deep = {f"{A}temperature_C": 12.0, f"{A}salinity": 0.0, f"{A}sample_depth_m": 20.0}
    assert load({}, deep).acoustics.sound_speed_m_s == fresh[1]
    assert load({}, {f"{A}temperature_C": 18.0}).acoustics.sound_speed_m_s == usual[0]


@pytest.mark.parametrize(("length", "loss", "wrong"), [
    (1.0, 0.5, False), (0.999, 0.5, True), (3.0, 0.75, False), (2.99, 0.75, True),
    (0.0, 0.75, False), (1.0, 1.0, False), (0.5, 0.0, True),
    (9.0, 0.9, False),  # 9 × (1 − 0.9) is less than 0.9 by rounding
    (3.0 - 2e-9, 0.75, False), (3.0 - 4.5e-9, 0.75, True),
])  # fmt: skip
def test_bursts_are_as_long_as_one_reception_between_them_leaves(
    length: float, loss: float, wrong: bool
) -> None:
    keys = {f"{A}loss_burst_length": length, f"{A}loss_probability": loss}
    if wrong:
        with pytest.raises(ConfigurationError, match="loss_burst_length: must be at least"):
            load({}, keys)
    else:
        assert load({}, keys).acoustics.loss_burst_length == length


# --- What is possible ----------------------------------------------------------------------------

ECHOES = {f"{A}surface_echo_probability": 0.5, f"{A}bottom_echo_probability": 0.3,
          f"{A}water_depth_m": 3.5}


def test_echoes_are_received_and_tell_less() -> None:
    scenario = load(HARBOUR, ECHOES)
    assert echoes.lost(scenario.acoustics) == pytest.approx(0.5 * 0.5 * 0.7)
    assert echoes.lost(load(HARBOUR).acoustics) == 0.5
    assert conditions(scenario).loss == pytest.approx(0.175)
    diver, beacon = np.array([15.0, 0.0, 2.0]), np.array([0.0, 0.0, 0.5])
    assert echoes.excesses(scenario.acoustics, diver, beacon) == pytest.approx([0.132, 0.586],
                                                                               abs=1e-3)
    assert 0.4 < echoes.shares(scenario.acoustics, diver, beacon) < 0.9
    # Echoes far apart are told from the direct path: they know the range as well.
    sharp = load(scenario, {f"{A}range_std_m": 0.005}).acoustics
    assert echoes.shares(sharp, diver, beacon) == pytest.approx(1.0, abs=1e-3)


def test_the_information_is_that_of_the_density() -> None:
    """The mean square slope of the log-density, by drawing ranges."""
    a = load(HARBOUR, ECHOES).acoustics
    diver, beacon = np.array([15.0, 0.0, 2.0]), np.array([0.0, 0.0, 0.5])
    e = np.array([0.0, *echoes.excesses(a, diver, beacon)]) / a.range_std_m
    weights = np.array([0.5, 0.25, 0.075]) / 0.825
    rng = np.random.default_rng(1)
    z = rng.choice(e, 400_000, p=weights) + rng.standard_normal(400_000)
    parts = weights * np.exp(-0.5 * (z[:, None] - e) ** 2)
    slope = -((z[:, None] - e) * parts).sum(1) / parts.sum(1)
    assert np.mean(slope**2) == pytest.approx(echoes.shares(a, diver, beacon), rel=0.01)


def test_the_reference_of_a_run_counts_echoes() -> None:
    run = sblcosim.run(HARBOUR, "multilateration", {**ECHOES, "time.duration_s": 40.0})
    direct = load(run.scenario, {f"{A}surface_echo_probability": 0.0,
                                 f"{A}bottom_echo_probability": 0.0})
    counted, blind = (
        reference(run.record, it, acceleration_psd=0.01).relative[-1, :2, :2].trace()
        for it in (run.scenario, direct)
    )
    assert 1.1 * blind < counted < 3 * blind


def test_maps_know_how_much_bursts_cost() -> None:
    """Bursts of 2 packets at a loss of one half are independent losses, as those of a run are."""
    still = {"target.trajectory": "waypoints",
             "target.waypoint_m": [[15.0, 0.0, 5.0], [15.0, 0.0, 5.001]]}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        base = load("paper-scenario-1", {f"{A}loss_probability": 0.5, "time.duration_s": 120.0,
                                         "time.sampling_time_s": 0.1, **still})
        run = sblcosim.run(base, "multilateration")
    along = reference(run.record, base, acceleration_psd=0.01)
    late = along.epoch_ns >= 10e9
    of_run = along.relative[late][:, :2, :2].trace(axis1=1, axis2=2).mean()
    at = np.array([[15.0, 0.0, 5.0]])

    def possible(length: float) -> float:
        found = places.covariances(load(base, {f"{A}loss_burst_length": length}), lambda t: at,
                                   np.array([0.01]), (10.0, 120.0))
        return float(found.relative[..., :2, :2].trace(axis1=2, axis2=3).mean())

    assert possible(2.0) == pytest.approx(of_run, rel=0.15)
    assert possible(10.0) > 2 * possible(2.0)


def test_sequences_of_bursts_have_their_loss_and_length() -> None:
    scenario = load(HARBOUR, {f"{A}loss_probability": 0.3, f"{A}loss_burst_length": 6.0})
    lost = places.losses_in_bursts(scenario, np.full(4, 50_000), 0)
    assert lost.mean() == pytest.approx(0.3, abs=0.015)
    ends = (np.diff(lost, axis=0) < 0).sum()
    assert lost.sum() / ends == pytest.approx(6.0, rel=0.05)
