"""Settings made from a log: every number of them, by hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sblcosim
from made_logs import changed, made, on_a_boat
from sblcosim import ConfigurationError
from sblcosim.logs.columns import KINDS
from sblcosim.logs.log import Log
from sblcosim.logs.raw import Flaw
from sblcosim.processing.quality import resemblance
from sblcosim.processing.settings import (
    PRIOR,
    arms_of,
    arrangement_of,
    drift_of,
    places_of,
    rough,
    settled,
    start_values,
)
from sblcosim.processing.windows import Lines, Window
from sblcosim.processing.windows import lines as lines_of
from scipy.spatial.transform import Rotation

PLACES = np.array([[7.5, 0.0, 4.0], [2.0, 5.0, 4.5], [0.0, -1.0, 3.0]])
"""Farthest apart along north, by 7.5 m."""
NOWHERE = np.zeros(3)


def short(kind: str = "one-way", **keys: Any) -> Log:
    log = made(seconds=24, **{"beacons": PLACES, **keys})
    heard = log.receptions
    return replace(log, receptions=replace(
        heard, kind=np.full(len(heard), KINDS.index(kind))
    ))  # fmt: skip


def lines(scatter: float | None, offset: float = 0.0, residual: Any = ()) -> Lines:
    off = np.array(residual, float)
    return Lines(None, scatter, offset, np.zeros(len(off), bool), off)


def test_the_settings_of_fixed_beacons_by_hand() -> None:
    log = short(meta={"sound_speed_m_s": 1480.0, "title": "My device"})
    late = [np.nan, 2.0, 3.0, 4.0, 5.0, 6.0, 1.4, -9.0]  # 3 m on average beyond 1.5 m: 2.5
    found = rough(log, "fixed", 5, lines(0.3, 0.06, late), 250_000_000, np.array([2.0, 1, 0]))
    assert found == {
        "name": "made", "title": "My device", "seed": 1,
        "time": {"sampling_time_s": 0.25, "duration_s": 2.5},
        "target": {"depth_std_m": 0.1},
        "platform": {
            "beacons": 5,
            "beacon_m": [[5.5, -1, 4], [0, 4, 4.5], [-2, -2, 3], [-2, -2, 2], [-2, -2, 1]],
            "mounting_std_m": pytest.approx(0.12),
        },
        "acoustics": {
            "range_std_m": 0.3, "outlier_probability": 0.05,
            "outlier_mean_m": pytest.approx(2.5),
            "sound_speed_m_s": pytest.approx(1554.0), "assumed_sound_speed_m_s": 1480.0,
            "clock_offset_std_s": 1e-3,
        },
        "receiver": {"type": "long_baseline", "acceleration_psd_m2_s3": "learned"},
    }  # fmt: skip


@pytest.mark.parametrize(("off", "mean"), [
    ([2.0, 3, 4, 5, 6], 2.5), ([2.0, 3, 4, 5, 1.5], 1.5), ([2.0, 3, 4, 6, 1.4], 1.5),
    ([1.6] * 5, 1.5), ([], 1.5),
])  # fmt: skip
def test_five_late_ranges_say_more_than_the_usual_five_deviations(off: Any, mean: float) -> None:
    found = rough(short(), "fixed", 3, lines(0.3, 0.0, off), 10**9, NOWHERE)
    assert found["acoustics"]["outlier_mean_m"] == pytest.approx(mean)


@pytest.mark.parametrize(("straight", "std"), [
    (lines(0.02), 0.02), (lines(0.002), 0.01), (lines(None), 1.0), (None, 1.0),
])  # fmt: skip
def test_the_noise_is_the_scatter_and_1_m_where_that_is_not_known(
    straight: Any, std: float
) -> None:
    found = rough(short(), "fixed", 3, straight, 10**9, NOWHERE)["acoustics"]
    assert found["range_std_m"] == std
    assert found["outlier_mean_m"] == pytest.approx(5 * std)


@pytest.mark.parametrize(("offset", "mounting"), [(0.03, 0.075), (0.05, 0.1), (0.2, 0.3)])
def test_places_are_uncertain_by_a_hundredth_of_their_distance_or_by_what_ranges_say(
    offset: float, mounting: float
) -> None:
    found = rough(short(), "fixed", 3, lines(0.1, offset), 10**9, NOWHERE)
    assert found["platform"]["mounting_std_m"] == pytest.approx(mounting)
    without = rough(short(), "fixed", 3, None, 10**9, NOWHERE)
    assert without["platform"]["mounting_std_m"] == pytest.approx(0.075)


@pytest.mark.parametrize(("step_ns", "duration_s"), [
    (50_000_000, 1.0), (100_000_000, 1.0), (3 * 10**9, 30.0)
])  # fmt: skip
def test_the_scenario_is_ten_steps_long_and_at_least_a_second(
    step_ns: int, duration_s: float
) -> None:
    found = rough(short(), "fixed", 3, None, step_ns, NOWHERE)["time"]
    assert found == {"sampling_time_s": step_ns / 1e9, "duration_s": pytest.approx(duration_s)}


def test_buoys_have_receivers_of_their_own_and_many_beacons_a_receiver_without_places() -> None:
    buoys = rough(short(), "buoys", 3, None, 10**9, NOWHERE)
    assert buoys["platform"] == {
        "beacons": 3, "beacon_m": PLACES.tolist(), "gps_shared": False, "gps_grade": "sbas"
    }  # fmt: skip
    assert buoys["receiver"]["type"] == "long_baseline"
    angle = np.arange(9) * 2 * np.pi / 9
    ring = np.column_stack([50 * np.cos(angle), 50 * np.sin(angle), np.full(9, 12.0)])
    log = short(beacons=ring)
    for arrangement in ("fixed", "buoys", "platform"):
        many = rough(log, arrangement, 8, None, 10**9, NOWHERE)
        assert many["receiver"] == {"type": "sequential"}
    assert len(rough(log, "fixed", 8, None, 10**9, NOWHERE)["platform"]["beacon_m"]) == 8
    ready = settled(log)
    assert (ready.slots, ready.platform) == (8, None)


def test_three_beacons_at_one_place_are_a_millimetre_apart() -> None:
    same = np.array([[3.0, 4.0, 5.0]] * 3 + [[3.0, 4.0, 5.001]])
    found = rough(short(beacons=same), "fixed", 4, None, 10**9, NOWHERE)["platform"]["beacon_m"]
    np.testing.assert_allclose(found, [[3, 4, 5], [3, 4, 5.001], [3, 4, 5.002], [3, 4, 5.003]])


@pytest.mark.parametrize(("kinds", "said"), [
    (["one-way"], {"clock_offset_std_s": 1e-3}),
    (["two-way"], {"ranging": "two_way", "turnaround_bias_std_s": 2e-3}),
    (["inverted"], {"ranging": "inverted", "clock_offset_std_s": 1e-3}),
    (["two-way", "one-way"], {"clock_offset_std_s": 1e-3}),
    (["inverted", "range"], {"clock_offset_std_s": 1e-3}),
])  # fmt: skip
def test_an_error_of_the_clock_or_of_the_turnaround_is_a_millisecond_of_a_range(
    kinds: list[str], said: dict[str, Any]
) -> None:
    log = short()
    each = np.resize([KINDS.index(kind) for kind in kinds], len(log.receptions))
    log = replace(log, receptions=replace(log.receptions, kind=each))
    found = rough(log, "fixed", 3, None, 10**9, NOWHERE)["acoustics"]
    fixed = {"range_std_m", "outlier_probability", "outlier_mean_m", "sound_speed_m_s",
             "assumed_sound_speed_m_s"}  # fmt: skip
    assert {key: value for key, value in found.items() if key not in fixed} == said


# --- Places, arms and drift -----------------------------------------------------------------------


def test_the_place_of_a_beacon_is_the_first_that_is_reported_or_that_of_the_meta_data() -> None:
    log = short()
    heard = log.receptions
    gone = heard.beacon_position + np.arange(24)[:, None] * [0.5, 0.0, 0.0]
    heard = replace(heard, beacon_position=gone).chosen(heard.beacon > 0)
    meta = log.meta.model_copy(update={"beacons": {"B0": (1.0, 2.0, 3.0), "B1": (9.0, 9.0, 9.0)}})
    known = replace(log, receptions=heard, meta=meta)
    np.testing.assert_array_equal(
        places_of(known), [[1, 2, 3], PLACES[1] + [0.5, 0, 0], PLACES[2] + [1.0, 0, 0]]
    )
    nothing = replace(known, meta=log.meta.model_copy(update={"beacons": {}}))
    np.testing.assert_array_equal(places_of(nothing)[0], [0, 0, 0])


def posed(count: int = 24) -> tuple[Log, Any, Any]:
    """A boat that turns as it sails, with its attitudes and the places of its beacons."""
    log = short()
    rng = np.random.default_rng(3)
    attitude = rng.uniform([-0.4, -0.3, -3.0], [0.4, 0.3, 3.0], (count, 3))
    place = rng.normal(0.0, 20.0, (count, 3))
    body = PLACES[log.receptions.beacon]
    turn = Rotation.from_euler("ZYX", attitude[:, ::-1])
    heard = replace(
        log.receptions, has_pose=np.ones(count, bool), platform_position=place,
        platform_attitude=attitude, beacon_position=place + turn.apply(body),
    )
    return replace(log, receptions=heard), attitude, place


def test_arms_are_places_in_the_frame_of_the_boat() -> None:
    log, _, _ = posed()
    np.testing.assert_allclose(arms_of(log), PLACES, atol=1e-12)
    odd = log.receptions.beacon_position.copy()
    odd[:3] += 50.0  # the first reports of each, which the median does not follow
    late = replace(log, receptions=replace(log.receptions, beacon_position=odd + 0.00003))
    found = arms_of(late)
    assert found is not None
    np.testing.assert_allclose(found, PLACES, atol=2e-4)
    np.testing.assert_array_equal(found, np.round(found, 4))
    stated = late.meta.model_copy(update={"arms_m": {"B1": (0.1, 0.2, 0.3)}})
    np.testing.assert_allclose(arms_of(replace(late, meta=stated))[1], [0.1, 0.2, 0.3])


def test_arms_of_a_beacon_without_any_pose_are_not_known() -> None:
    log, _, _ = posed()
    silent = replace(log.receptions, has_pose=log.receptions.beacon != 2)
    assert arms_of(replace(log, receptions=silent)) is None
    platform = rough(replace(log, receptions=silent), "platform", 3, None, 10**9, NOWHERE)
    assert "beacon_m" not in platform["platform"]


def test_drift_holds_95_percent_of_the_places_about_their_middle() -> None:
    log, _, place = posed()
    off = np.sort(np.hypot(*(place - place.mean(axis=0))[:, :2].T))
    at = 0.95 * 23
    by_hand = off[int(at)] + (at - int(at)) * (off[int(at) + 1] - off[int(at)])
    assert drift_of(log) == pytest.approx(by_hand, rel=1e-12)
    heard = log.receptions
    some = np.arange(24) < 15
    half = place[some]
    of_posed = np.percentile(np.hypot(*(half - half.mean(axis=0))[:, :2].T), 95)
    assert drift_of(replace(log, receptions=replace(heard, has_pose=some))) == pytest.approx(
        of_posed
    )
    # Without poses, each beacon is about its own middle.
    swinging = PLACES[heard.beacon] + np.where(np.arange(24) < 12, 3.0, -3.0)[:, None] * [0.6, 0.8,
                                                                                          5.0]
    bare = replace(heard, has_pose=np.zeros(24, bool), beacon_position=swinging)
    assert drift_of(replace(log, receptions=bare)) == pytest.approx(3.0)
    none = heard.chosen(np.zeros(24, bool))
    assert drift_of(replace(log, receptions=none)) == 0.0


@pytest.mark.parametrize(("radius", "circle"), [
    (1.99, None), (2.0, None), (2.01, 3.0), (40.2, 41.0), (5000.0, 1000.0)
])  # fmt: skip
def test_a_boat_that_is_found_farther_than_2_m_away_drifts(
    radius: float, circle: float | None
) -> None:
    log, _, _ = posed()
    angle = 2 * np.pi * np.arange(24) / 24
    place = radius * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    if radius == 2.0:
        place = np.resize([[2.0, 0, 0], [-2.0, 0, 0]], (24, 3))  # without rounding
    moving = replace(log, receptions=replace(log.receptions, platform_position=place))
    platform = rough(moving, "platform", 3, None, 10**9, NOWHERE)["platform"]
    usual = {"beaufort": 2, "gps_grade": "sbas", "imu_grade": "consumer", "beacons": 3}
    drifts = {"motion": "spectrum", "watch_circle_m": circle} if circle else {}
    assert {k: v for k, v in platform.items() if k != "beacon_m"} == usual | drifts
    assert rough(moving, "platform", 3, None, 10**9, NOWHERE)["receiver"]["type"] == "coupled"


@pytest.mark.parametrize(("by_m", "kind"), [(0.0, "fixed"), (9e-4, "fixed"), (1.1e-3, "buoys")])
def test_beacons_that_move_by_more_than_a_millimetre_are_buoys(by_m: float, kind: str) -> None:
    log = short()
    heard = log.receptions
    last = np.arange(24)[:, None] == 23
    place = heard.beacon_position + last * [0.0, 0.0, by_m]
    assert arrangement_of(replace(log, receptions=replace(heard, beacon_position=place))) == kind
    assert arrangement_of(on_a_boat(seconds=9)) == "platform"
    some = np.arange(24) == 5
    assert arrangement_of(replace(log, receptions=replace(heard, has_pose=some))) == "platform"


# --- What is settled before receivers run ---------------------------------------------------------


@pytest.mark.parametrize(("origin", "whole"), [
    ((2000.0, -2000.0, 9000.0), (0.0, 0.0, 0.0)),
    ((2001.0, 0.0, 9000.0), (2000.0, 0.0, 0.0)),
    ((-700.0, -3600.0, 50.0), (-1000.0, -4000.0, 0.0)),
])  # fmt: skip
def test_positions_count_from_whole_kilometres_if_they_are_beyond_two(
    origin: Any, whole: Any
) -> None:
    square = np.array([[40.0, 40, 14], [-40, 40, 12], [-40, -40, 13], [40, -40, 15]])
    ready = settled(made(seconds=24, beacons=square, origin=origin))
    np.testing.assert_array_equal(ready.origin, whole)
    middle = np.round(np.array([0.0, 0, 13.5]) + origin - whole)
    np.testing.assert_array_equal(ready.platform, middle)
    np.testing.assert_allclose(
        np.reshape(ready.scenario.platform.beacon_m, (-1, 3)), square + origin - np.array(whole)
    )


def test_the_platform_of_fixed_beacons_is_never_at_zero() -> None:
    square = np.array([[40.0, 40, 0], [-40, 40, 0], [-40, -40, 0], [40, -40, 0]])
    ready = settled(made(seconds=24, beacons=square, plane=True))
    np.testing.assert_array_equal(ready.platform, [1.0, 0.0, 0.0])
    assert ready.slots == 4
    buoys = made(seconds=24)
    place = buoys.receptions.beacon_position + np.arange(24)[:, None] * [0.1, 0, 0]
    moving = replace(buoys, receptions=replace(buoys.receptions, beacon_position=place))
    assert settled(moving).platform is None
    assert settled(moving).alike == 1.0


def test_the_interval_is_that_of_a_quarter_of_the_receptions() -> None:
    """A quarter of the distances of arrivals is at most 0.5 s, and one of 0 s is no distance."""
    log = made(seconds=25, speed=0.01)
    ns = np.cumsum(np.where(np.arange(25) % 3 == 0, 530_000_000, 4 * 10**9))
    ns[1] = ns[0]
    heard = replace(log.receptions, arrival_ns=ns, epoch_ns=ns)
    timed = replace(log, receptions=heard, depth_ns=ns, truth=None)
    assert settled(timed).interval_ns == 500_000_000
    assert settled(timed, interval_s=0.3).interval_ns == 300_000_000
    assert settled(timed, interval_s=0.3).scenario.time.sampling_time_s == 0.3
    at_once = replace(heard, arrival_ns=np.full(25, 7), epoch_ns=np.full(25, 7))
    assert settled(replace(timed, receptions=at_once)).interval_ns == 10**9


def test_a_log_without_straight_lines_has_a_noise_of_a_metre() -> None:
    ready = settled(made(seconds=8))  # fewer ranges than a window has
    assert ready.window is None
    assert ready.alike == 1.0
    assert start_values(ready, 0.1) == {}
    assert ready.said == (
        "settings: usual values; range noise 1.0 m, from straight lines through short windows of "
        "the log"
    )


def test_a_receiver_starts_at_the_window() -> None:
    ready = settled(made(seconds=24))
    window = Window(5, np.array([31.0, 42.0, 8.0]), np.array([0.3, -0.4, 0.0]),
                    np.array([0.2, 0.7]))  # fmt: skip
    there = replace(ready, window=window, origin=np.array([30.0, 40.0, 1.0]))
    assert start_values(there, 0.01) == {
        "initialisation": PRIOR, "prior_position": (1.0, 2.0, 7.0),
        "prior_velocity": (0.3, -0.4, 0.0), "prior_position_std": pytest.approx(2.1),
        "prior_velocity_std": 1.0,
    }  # fmt: skip
    assert start_values(there, 3.5)["prior_position_std"] == 3.5


def test_a_log_with_settings_of_its_own_has_their_interval_if_it_is_a_simulation(
    tmp_path: Path,
) -> None:
    given = sblcosim.load("harbour-lbl", {"time.ekf_ratio": 3})
    file = tmp_path / "scenario.toml"
    file.write_text(given.dump_toml(tmp_path), "utf-8")
    log = replace(made(seconds=24), scenario=file)
    assert given.receiver.update_interval_s != 1.0
    device, asked = settled(log), settled(log, interval_s=0.25)
    for ready, step_ns in ((device, 10**9), (asked, 250_000_000)):
        assert ready.said == "settings: those of the log's own scenario"
        assert ready.interval_ns == step_ns
        assert not ready.newest
        assert ready.window is not None
        assert ready.platform is not None
    dated = replace(log, meta=log.meta.model_copy(update={"start_ns": 0}))
    simulated = settled(dated)
    assert simulated.newest
    assert simulated.interval_ns == round(given.receiver.update_interval_s * 1e9)
    assert simulated.window is None
    assert simulated.platform is None
    assert settled(dated, interval_s=0.25).interval_ns == 250_000_000
    other = settled(dated, scenario="harbour-lbl")
    assert other.said == "settings: those of 'harbour-lbl'"
    assert not other.newest


def test_differences_of_arrivals_need_a_scenario_that_has_them() -> None:
    log = short("difference")
    with pytest.raises(ConfigurationError) as refusal:
        settled(log)
    assert str(refusal.value) == (
        "made: must come with a scenario, as its differences of arrivals do not tell where "
        "receivers can start"
    )
    clocked = sblcosim.load("realistic-dive", {"platform.beacons": 3})
    with pytest.raises(ConfigurationError) as refusal:
        settled(log, clocked)
    assert str(refusal.value) == (
        "realistic-dive: must have acoustics.ranging = 'inverted' and common_clock = false, as made"
        " has differences of arrivals"
    )
    fits = {"acoustics.ranging": "inverted", "acoustics.common_clock": False,
            "platform.beacons": 3}  # fmt: skip
    ready = settled(log, sblcosim.load("realistic-dive", fits))
    assert ready.window is None
    assert settled(short(), clocked).scenario.name == "realistic-dive"


def test_wrong_ranges_are_findings_with_their_lines_beacons_and_sizes() -> None:
    log = changed(
        made(seconds=240, std=0.02), [40, 85, 122, 167, 203], [-20.0, -35.0, 90.0, -27.0, 83.0]
    )
    ready = settled(log)
    short_ = "a range too short by 20 m to 35 m, against at least three other beacons"
    late = "a range too late by 83 m to 90 m, against at least three other beacons"
    found = [it for it in ready.log.findings if it.table == "receptions"]
    assert found == [
        Flaw("receptions", 42, short_, of="B0", table="receptions"),
        Flaw("receptions", 87, short_, of="B1", table="receptions"),
        Flaw("receptions", 169, short_, of="B3", table="receptions"),
        Flaw("receptions", 124, late, of="B2", table="receptions"),
        Flaw("receptions", 205, late, of="B3", table="receptions"),
    ]
    left = {*log.receptions.line} - {*ready.log.receptions.line}
    assert left == {42, 87, 124, 169, 205}
    assert settled(made(seconds=240, std=0.02)).log.findings == ()


def test_residuals_of_a_beacon_that_stays_off_are_alike() -> None:
    log = made(seconds=800, std=0.05, turning=0.005)
    usual = settled(log)
    slow = 0.4 * np.sin(np.arange(800) * 2 * np.pi / 400)
    lasting = settled(changed(log, slice(None), np.where(np.arange(800) % 4 == 2, slow, 0.0)))
    assert usual.alike < 1.3
    assert lasting.alike > 1.8
    heard = lasting.log.receptions
    about = lines_of(lasting.log.samples(), heard.beacon_position, None)
    assert lasting.alike == resemblance(heard.beacon, about.residual / about.scatter)
    assert lasting.arrangement == "fixed"
