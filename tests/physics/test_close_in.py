"""`coupled` close to the platform in shallow water, where heave and tilt are as large as errors.

Between two packets the platform heaves and tilts. A packet that holds only its own beacon's
position does not say by how much.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sblcosim
from quick import one_in
from sblcosim import limits
from sblcosim.judge.over_runs import pooled
from sblcosim.results.sums import responses
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters.lanes import execute
from sblcosim.simulation.resolve import resolve

LEARNED = -1.0
SEEDS = ("target", "platform", "acoustics")
TRUTH = ("target.position", "target.velocity", "platform.position", "platform.attitude",
         "acoustics.reception_count", "acoustics.range_epoch", "target.depth_epoch")


def scenario(
    content: str, beaufort: int, gps: str, schedule: str = "round_robin", lower: float = 0.5
) -> sblcosim.Scenario:
    """Four beacons with arms of 1.5 m, and a diver 3 to 5 m deep within 4 m of them.

    Parameters
    ----------
    lower
        Depth of the beacons in the body frame [m].
    """
    arms = ((1.5, 0.0), (0.0, 1.5), (-1.5, 0.0), (0.0, -1.5))
    return sblcosim.load({
        "name": "close in",
        "time": {"sampling_time_s": 0.5, "duration_s": 200.0},
        "target": {
            "trajectory": "random_path", "speed_m_s": 0.3, "box_m": [8.0, 8.0],
            "leg_length_m": 8.0, "path_length_m": 500.0, "depth_start_m": 3.0, "depth_end_m": 5.0,
            "depth_std_m": 0.05,
        },
        "platform": {
            "beacon_m": [[*arm, lower] for arm in arms], "beaufort": beaufort,
            "random_phases": True, "gps_grade": gps, "imu_heading_std_deg": 0.5,
            "imu_heading_turn_on_std_deg": 2.0, "imu_tilt_std_deg": 0.5,
        },
        "acoustics": {
            "packet_content": content, "packet_resolution_m": 0.05, "schedule": schedule,
            "loss_probability": 0.1, "range_std_m": 0.1, "clock_offset_std_s": 1e-4,
            "sound_speed_m_s": 1510.0, "assumed_sound_speed_m_s": 1500.0,
        },
        "receiver": {},
    })


CELLS: dict[str, dict[str, Any]] = {
    "own positions, a swell": {"content": "own_beacon", "beaufort": 4, "gps": "rtk_fixed"},
    "own positions at once": {"content": "own_beacon", "beaufort": 4, "gps": "rtk_fixed",
                              "schedule": "simultaneous"},
    "own positions, a height of metres": {"content": "own_beacon", "beaufort": 3,
                                          "gps": "standalone"},
    "own positions, deep beacons": {"content": "own_beacon", "beaufort": 2, "gps": "rtk_fixed",
                                    "lower": 3.0},
    "poses": {"content": "pose", "beaufort": 4, "gps": "rtk_fixed"},
    "poses, a height of metres": {"content": "pose", "beaufort": 2, "gps": "sbas",
                                  "schedule": "simultaneous"},
}


def cell(runs: int, receiver: str, psd: float, **form: Any) -> tuple[Any, float]:
    """A table of responses, a row for each run; the possible error relative to the platform [m].

    That is without the first 10 s, in which one beacon after the other is heard for the first time.
    """
    known = scenario(**form)
    plan = resolve(connect(known, receiver))
    varied = {f"{component}.seed": np.arange(1, runs + 1) for component in SEEDS}
    varied[f"{receiver}.acceleration_psd"] = np.array([psd])
    outcome = execute(plan, varied, record=TRUTH)
    table = responses(outcome.sums[receiver], plan.stop_ns - plan.start_ns)
    possible = [
        np.trace(limits.reference(outcome.record(i), known).relative[20:], axis1=1, axis2=2).mean()
        for i in range(0, runs, 8)
    ]
    return table, float(np.sqrt(np.mean(possible)))


@one_in(2)
@pytest.mark.parametrize(("receiver", "psd"), [
    ("coupled", 0.03), ("coupled", LEARNED), ("fixed_lag", LEARNED),
], ids=["given", "learned", "later"])
@pytest.mark.parametrize("name", CELLS)
def test_it_knows_its_error_relative_to_the_platform(name: str, receiver: str, psd: float) -> None:
    table, possible = cell(40, receiver, psd, **CELLS[name])
    relative = float(table.own_relative_nees_position.mean())
    absolute = float(table.nees_position.mean())
    rms = pooled(table.own_relative_total_rms_m)
    print(f"{name}, {receiver}: {rms:.3f} m relative, {rms / possible:.2f} of what is possible; "
          f"NEES {relative:.2f}, absolute {absolute:.2f}")
    assert rms < 1.07 * possible
    assert 1.8 < relative < (3.0 if receiver == "coupled" else 3.5)
    assert 2.0 < absolute < 3.3
