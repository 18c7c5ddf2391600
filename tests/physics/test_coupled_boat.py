"""The coupled filter claims the errors that it makes, off a boat where all beacons ping at once.

Errors that last are what it must not average away: of the GPS's down, and of where the beacons are.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
import sblcosim
from quick import one_in
from sblcosim.judge.over_runs import pooled
from sblcosim.results.sums import responses
from sblcosim.scenario.likes import LIKES
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters.lanes import execute
from sblcosim.simulation.resolve import resolve

RUNS = 200
BOAT = LIKES["water-linked"].source
START = {"prior_position_m": [15.0, 0.0, 8.0], "prior_position_std_m": 1.0,
         "prior_velocity_std_m_s": 0.1}
DRAWN = {
    "time": {"sampling_time_s": 0.5, "duration_s": 120.0},
    "target": {
        "trajectory": "white_noise_acceleration", "acceleration_psd_m2_s3": 0.002,
        "initial_position_m": START["prior_position_m"], "initial_position_std_m": 1.0,
        "initial_velocity_std_m_s": 0.1, "depth_std_m": 0.05, "depth_bias_std_m": 0.05,
    },
    "platform": {
        "gps_horizontal_std_m": 0.1, "gps_horizontal_markov_std_m": 0.9, "gps_vertical_std_m": 0.2,
        "gps_vertical_markov_std_m": 1.4, "gps_correlation_time_s": 100.0, "imu_tilt_std_deg": 0.5,
        "imu_heading_turn_on_std_deg": 2.0,
        "beacon_m": [[2.5, 1.3, 1.0], [2.5, -1.3, 3.0], [-2.5, -1.3, 1.5], [-2.5, 1.3, 4.0]],
    },
    "acoustics": {"schedule": "simultaneous", "range_std_m": 0.1, "loss_probability": 0.1,
                  "clock_offset_std_s": 2e-5},
    "receiver": {"type": "coupled", "initialisation": "prior", "acceleration_psd_m2_s3": 0.002,
                 **START},
}
HOUR = {"acoustics.clock_grade": "tcxo", "acoustics.clock_sync_age_s": 3600.0}


def judged(source: Any, changes: Mapping[str, Any] | None = None, **varied: float) -> Any:
    """RMS error [m] over the runs, and mean NEES: absolute, and beside the platform."""
    plan = resolve(connect(sblcosim.load(source, dict(changes or {})), "coupled"))
    seeds = {f"{name}.seed": np.arange(1, RUNS + 1) for name in ("target", "platform", "acoustics")}
    given = {f"coupled.{name}": np.array([value]) for name, value in varied.items()}
    outcome = execute(plan, {**seeds, **given})
    table = responses(outcome.sums["coupled"], plan.stop_ns - plan.start_ns)
    assert not table.lost.any()
    found = (pooled(table.absolute_total_rms_m), float(table.nees_position.mean()),
             float(table.own_relative_nees_position.mean()))
    print(dict(changes or {}), varied, *(f"{value:.3f}" for value in found))
    return found


def test_where_motion_and_errors_are_drawn_it_is_consistent() -> None:
    """A slow error of down that is taken for noise of each range makes it believe too much."""
    rms, nees, relative = judged(DRAWN)
    assert 2.5 < nees < 3.3
    assert 2.1 < relative < 3.3
    off, white, _ = judged(DRAWN, gps_vertical_error_std=0.0, gps_vertical_std=1.41)
    assert white > 5.0
    assert off > 1.05 * rms


@one_in(3)
@pytest.mark.parametrize("grade", ["standalone", "differential", "rtk_fixed"])
@pytest.mark.parametrize("sampling_time", [0.1, 0.5])
def test_the_boat_of_the_starter(grade: str, sampling_time: float) -> None:
    _, nees, _ = judged(BOAT, {"platform.gps_grade": grade, "time.sampling_time_s": sampling_time})
    assert 2.5 < nees < 3.6


def test_a_clock_that_has_drifted_for_an_hour() -> None:
    """Its 2.7 m go into all ranges, as the error of down does."""
    rms, nees, _ = judged(BOAT, HOUR)
    assert 2.5 < nees < 3.6
    untold, _, _ = judged(BOAT, HOUR, gps_vertical_error_std=0.0, gps_vertical_std=2.04,
                          range_std=0.1)
    assert rms < 0.5 * untold


@pytest.mark.parametrize("grade", ["standalone", "rtk_fixed"])
def test_a_late_range_in_the_first_fix_is_allowed_for(grade: str) -> None:
    """With that clock, and beacons that are where they should be, nothing else hides it."""
    _, nees, _ = judged(BOAT, {**HOUR, "platform.gps_grade": grade, "platform.mounting_std_m": 0.0})
    assert 2.5 < nees < 3.3


def test_its_accuracy_does_not_suffer() -> None:
    """Against taking the errors of mounting for none, and those of down for noise."""
    rms, _, _ = judged(BOAT)
    untold, nees, _ = judged(BOAT, gps_vertical_error_std=0.0, gps_vertical_std=2.04, range_std=0.1)
    assert rms < 0.95 * untold
    assert nees > 8.0
    precise = {"platform.gps_grade": "rtk_fixed"}
    rms, _, _ = judged(BOAT, precise)
    untold, nees, _ = judged(BOAT, precise, range_std=0.1)
    assert rms < 1.08 * untold
    assert nees > 8.0


@pytest.mark.slow
def test_six_beacons_one_after_the_other() -> None:
    beacons = [[9.2, 2.1, 1.4], [9.1, -2.2, 1.4], [0.3, 3.0, 1.9], [0.3, -3.1, 4.5],
               [-8.7, 2.4, 5.0], [-8.8, -2.3, 1.5]]
    changes = {"platform.beacon_m": beacons, "acoustics.schedule": "round_robin",
               "acoustics.slot_order": [1, 4, 2, 5, 3, 6]}
    _, nees, _ = judged(BOAT, changes)
    assert 2.5 < nees < 3.6
