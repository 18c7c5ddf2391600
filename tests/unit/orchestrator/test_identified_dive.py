"""The dive in the scenario that `identify` writes for a log without one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sblcosim
from made_logs import made
from sblcosim.identification.device import NOT
from sblcosim.identification.dive import dive_of
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
