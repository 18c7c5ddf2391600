"""The dive in the scenario that `identify` writes for a log without one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sblcosim
from made_logs import made
from sblcosim.identification.device import NOT, YES, Device, Number, Told
from sblcosim.identification.dive import POINTS, dive_of
from sblcosim.identification.fit import Fit
from sblcosim.identification.innovations import PRIOR, Filtered, Ranges
from sblcosim.identification.path import smoothed
from sblcosim.logs.log import Log
from seams import Seam


def at_once(log: Log) -> Log:
    """The same log, as if the four beacons pinged together."""
    heard = log.receptions
    epoch = heard.epoch_ns - heard.beacon.astype(np.int64) * 10**9
    return replace(log, receptions=replace(heard, epoch_ns=epoch))


def test_the_scenario_of_a_log_dives_as_the_log_did(tmp_path: Path) -> None:
    log = made(seconds=200, start_s=1.7e9)
    found = sblcosim.identify(log)
    found.write(tmp_path, figures=False)
    dive = sblcosim.load(tmp_path / "scenario.toml")
    assert dive.time.sampling_time_s == 1.0  # each of four beacons pings every 4 s
    assert dive.acoustics.schedule == "round_robin"
    assert dive.time.duration_s == 199.0
    assert dive.target.trajectory == "file"
    assert log.truth is not None
    times = np.asarray(dive.target.track_time_s) + dive.target.departure_time_s
    track = np.reshape(dive.target.track_m, (-1, 3))
    after = (log.truth.time_ns - log.start_ns) / 1e9
    true = np.column_stack([np.interp(times, after, own) for own in log.truth.position.T])
    off = np.linalg.norm(track - true, axis=1)
    assert np.sqrt(np.mean(off**2)) < 0.7
    assert len(times) <= 200
    # The log says how far the speed of sound is off: by less than the usual value.
    (scale,) = (n for n in found.device.numbers if n.parameter == "range_scale")
    assert scale.low is not None
    assert scale.high is not None
    c = dive.acoustics.assumed_sound_speed_m_s / dive.acoustics.sound_speed_m_s - 1
    assert scale.low - 1e-9 <= c <= scale.high + 1e-9
    (said,) = (line for line in found.remarks if line.startswith("scenario: "))
    assert said.startswith(
        "scenario: from the log, the beacons ping in turn, each every 4.00 s; it lasts 199 s, on "
        "the estimated path (200 points"
    )


@pytest.mark.parametrize("turns", [False, True])
def test_the_path_is_as_smooth_as_the_motion_that_was_found(turns: bool, seam: Seam) -> None:
    """Turns by a normal variable at a rate are a white acceleration of their product."""
    log = made(seconds=100)
    found = sblcosim.identify(log)
    motion = replace(found.device.motion, hypotheses=6 if turns else 1)
    _, _, _, psd, rate, turn, _ = motion.parameters.tolist()
    told = []

    def spied(time: Any, values: Any, std: float, density: float) -> Any:
        told.append(density)
        return smoothed(time, values, std, density)

    seam.instead(smoothed, spied)
    dive_of(log, replace(found.device, motion=motion), found.scenario())
    assert told == [pytest.approx(psd + turns * rate * turn**2, rel=1e-12)] * 2


def test_a_dive_whose_ranges_begin_late_departs_then() -> None:
    log = made(seconds=120, truth=False)
    heard = log.receptions
    late = heard.chosen(heard.epoch_ns >= log.start_ns + 20 * 10**9)
    dive = sblcosim.identify(replace(log, receptions=late)).scenario()
    assert 19.5 < dive.target.departure_time_s < 25.0
    assert dive.target.track_time_s[0] == 0.0
    assert dive.time.duration_s == 119.0


@pytest.mark.parametrize("start_s", [0.0, 2.0])
def test_the_dive_of_a_log_is_as_long_as_its_ranges(start_s: float) -> None:
    log = made(seconds=90, start_s=start_s)
    dive = sblcosim.identify(log).scenario().target
    arrival = log.receptions.arrival_ns / 1e9
    assert dive.track_time_s is not None
    assert dive.track_time_s[0] == 0.0
    assert dive.track_time_s[-1] == pytest.approx(arrival[-1] - arrival[0], abs=0.6)


def test_beacons_that_ping_together_do_so_in_the_scenario() -> None:
    dive = sblcosim.identify(at_once(made(seconds=100))).scenario()
    assert dive.acoustics.schedule == "simultaneous"
    assert dive.time.sampling_time_s == 4.0


def test_a_given_scenario_keeps_its_dive(tmp_path: Path) -> None:
    log, base = made(seconds=60), sblcosim.load("harbour-lbl")
    kept = sblcosim.identify(log, scenario=base).scenario()
    assert (kept.time, kept.target.trajectory) == (base.time, base.target.trajectory)
    file = tmp_path / "scenario.toml"
    file.write_text(base.dump_toml(tmp_path), "utf-8")
    own = sblcosim.identify(replace(log, scenario=file)).scenario()
    assert (own.time, own.target.trajectory) == (base.time, base.target.trajectory)


def test_a_scale_that_the_log_does_not_tell_is_not_in_the_scenario() -> None:
    """As that of buoys whose own GPS moves their places, although it has an interval."""
    found = sblcosim.identify(made(seconds=60))
    numbers = [replace(n, told=NOT, low=0.01, high=0.02) if n.parameter == "range_scale" else n
               for n in found.device.numbers]
    untold = replace(found, device=replace(found.device, numbers=numbers))
    assert "acoustics.sound_speed_m_s" not in untold.overrides()


@pytest.mark.parametrize("factor", [3.28, 1 / 3.28])
def test_ranges_in_another_unit_are_said_to_fit_no_beacons(factor: float) -> None:
    log = made(seconds=120, truth=False)
    assert not said_misfit(log)
    heard = log.receptions
    assert said_misfit(replace(log, receptions=replace(heard, range=heard.range * factor)))


def said_misfit(log: Log) -> list[str]:
    return [line for line in sblcosim.process(log, ["long_baseline"]).remarks
            if line.startswith("ranges do not fit the beacons: half of the residuals")]


# --- Of a device that is written down -------------------------------------------------------------


def device(
    time: Any, told: Told = YES, low: float | None = 0.01, high: float | None = 0.03,
    sinks: float = 0.1, north: float = 3.0,
) -> Device:
    """A device with ranges at these times, whose diver sinks and swims along a curve."""
    time, n = np.asarray(time, float), len(time)
    ranges = Ranges(time, np.zeros(n, np.intp), np.zeros(n), np.zeros((n, 3)), 5 + sinks * time,
                    np.zeros(n), dict.fromkeys(PRIOR, 0.0), 1)
    shown = {"north": north * np.sin(time / 7), "east": 40 - 0.2 * time}
    motion = Fit(("range_std", "late_share", "late_mean", "acceleration_psd"),
                 np.array([-3.0, -3.0, 0.5, -4.0]), np.eye(4), 0.0, 1)
    scale = Number("range_scale", 0.02, low, high, "", told, "")
    return Device(
        [Number("range_std", 0.1, 0.09, 0.11, "m", YES, ""), scale], ranges,
        Filtered(np.zeros(1), {k: np.asarray(v)[None] for k, v in shown.items()},
                 np.zeros((1, 8)), np.zeros((1, 8, 8))),
        motion, {}, [],
    )


def pinging(every_s: float, apart_s: float, beacons: int = 4, rounds: int = 12) -> Log:
    """A log whose beacons ping one after the other, so far apart, in rounds from 7 s on. In the
    first round the last two come 1 cs after the ones before."""
    log = made(seconds=beacons * rounds, truth=False)
    heard = log.receptions
    number = np.arange(beacons * rounds)
    epoch = 7.0 + every_s * (number // beacons) + apart_s * (number % beacons)
    epoch[2:beacons] = epoch[1] + 0.01 * np.arange(1, beacons - 1)
    epoch = np.rint(1e9 * epoch)
    return replace(log, depth_ns=log.depth_ns[:0], depth=log.depth[:0], receptions=replace(
        heard, beacon=number % beacons, epoch_ns=epoch.astype(np.int64),
        arrival_ns=epoch.astype(np.int64)))


BASE = sblcosim.load("harbour-lbl")
TIME = np.arange(3.0, 60.0, 0.9)


def test_beacons_ping_together_within_half_of_their_share_of_an_interval() -> None:
    for apart, together in ((0.24, True), (0.26, False)):
        keys, (said,) = dive_of(pinging(2.0, apart), device(TIME), BASE)
        assert keys["acoustics.schedule"] == ("simultaneous" if together else "round_robin")
        assert keys["time.sampling_time_s"] == (2.0 if together else 0.5)
        span = 2.0 * 11 + 3 * apart
        slots = round(span / keys["time.sampling_time_s"])
        assert keys["time.duration_s"] == slots * keys["time.sampling_time_s"]
        how = "all beacons ping together" if together else "the beacons ping in turn"
        assert said == (
            f"scenario: from the log, {how}, each every 2.00 s; it lasts "
            f"{span:.1f} s, on the estimated path ({len(TIME)} points, as smooth as the ranges "
            "allow)"
        )


def test_the_slot_of_a_dive_is_a_millisecond_or_more_and_the_dive_a_slot() -> None:
    log = pinging(2.0, 0.5)
    meta = log.meta.model_copy(update={"interval_s": 0.0024})
    keys, _ = dive_of(replace(log, meta=meta), device(TIME), BASE)
    assert keys["time.sampling_time_s"] == 0.001
    meta = log.meta.model_copy(update={"interval_s": 0.84})
    keys, _ = dive_of(replace(log, meta=meta), device(TIME), BASE)
    assert keys["time.sampling_time_s"] == pytest.approx(0.21)
    assert keys["time.duration_s"] == pytest.approx(0.21 * round(23.5 / 0.21))
    meta = log.meta.model_copy(update={"interval_s": 400.0})
    keys, _ = dive_of(replace(log, meta=meta), device(TIME), BASE)
    assert (keys["time.sampling_time_s"], keys["time.duration_s"]) == (400.0, 400.0)


def test_a_turn_around_shorter_than_a_slot_is_in_the_scenario() -> None:
    log = pinging(2.0, 0.5)
    for turnaround, there in ((0.0, False), (0.4999, True), (0.5, False)):
        keys, _ = dive_of(replace(log, turnaround_s=turnaround), device(TIME), BASE)
        assert keys.get("acoustics.turnaround_s") == (turnaround if there else None)


@pytest.mark.parametrize(("told", "low", "high", "farther"), [
    (YES, 0.01, 0.03, 0.03), (YES, -0.05, -0.02, -0.05), (NOT, 0.01, 0.03, None),
    (YES, None, 0.03, None), (YES, 0.01, None, None), (YES, -0.02, 0.03, None),
])  # fmt: skip
def test_the_speed_of_sound_is_as_far_off_as_the_log_allows(
    told: Told, low: float | None, high: float | None, farther: float | None
) -> None:
    keys, _ = dive_of(pinging(2.0, 0.5), device(TIME, told, low, high), BASE)
    speed = keys.get("acoustics.sound_speed_m_s")
    if farther is None:
        assert speed is None
    else:
        assumed = BASE.acoustics.assumed_sound_speed_m_s
        assert speed == pytest.approx(assumed / (1 + farther))


def test_a_usual_speed_at_either_end_of_the_interval_is_kept() -> None:
    usual = BASE.acoustics.assumed_sound_speed_m_s / BASE.acoustics.sound_speed_m_s - 1
    for low, high, kept in ((usual, 0.5, True), (-0.5, usual, True), (usual + 1e-6, 0.5, False),
                            (-0.5, usual - 1e-6, False)):
        keys, _ = dive_of(pinging(2.0, 0.5), device(TIME, YES, low, high), BASE)
        assert ("acoustics.sound_speed_m_s" not in keys) == kept


def test_the_path_goes_from_the_first_range_to_the_last_with_the_depth() -> None:
    short = dive_of(pinging(2.0, 0.5), device(TIME), BASE)[0]
    assert short["target.trajectory"] == "file"
    assert short["target.departure_time_s"] == 3.0
    assert short["target.track_time_s"] == pytest.approx(TIME - 3.0, abs=1e-3)
    track = np.array(short["target.track_m"])
    # Its noise is small: where the filter was.
    assert track[:, 0] == pytest.approx(3 * np.sin(TIME / 7), abs=0.05)
    assert track[:, 1] == pytest.approx(40 - 0.2 * TIME, abs=0.01)
    assert track[:, 2] == pytest.approx(5 + 0.1 * TIME, abs=1e-3)
    # Of a long one, points at equal intervals; and ranges that arrive at once count once.
    long = np.repeat(np.sqrt(np.linspace(2.0**2, 90.0**2, 300)), 2)
    keys, (said,) = dive_of(pinging(2.0, 0.5), device(long), BASE)
    assert len(keys["target.track_m"]) == POINTS == 200
    assert keys["target.track_time_s"] == pytest.approx(np.linspace(0, 88.0, 200), abs=1e-3)
    assert "(200 points, " in said
    early = dive_of(pinging(2.0, 0.5), device(TIME - 10.0), BASE)[0]
    assert early["target.departure_time_s"] == 0.0


def test_a_log_that_gives_no_path_keeps_the_default_and_says_so() -> None:
    for given in (
        device([3.0, 3.0, 4.0, 4.0]), device(TIME, sinks=np.nan), device(TIME, north=np.nan)
    ):  # fmt: skip
        keys, (said,) = dive_of(pinging(2.0, 0.5), given, BASE)
        assert "target.trajectory" not in keys
        assert said == (
            "scenario: from the log, the beacons ping in turn, each every 2.00 s; it lasts 23.5 s; "
            "its path is not from the log, but the default"
        )
    assert "target.trajectory" in dive_of(pinging(2.0, 0.5), device([3.0, 4.0, 6.0]), BASE)[0]


def test_a_log_with_a_range_to_each_beacon_has_a_ping_a_second() -> None:
    keys, _ = dive_of(pinging(2.0, 0.5, beacons=2, rounds=1), device(TIME), BASE)
    assert keys["acoustics.schedule"] == "round_robin"
    assert keys["time.sampling_time_s"] == 0.25  # a fourth, as there are four in the base
