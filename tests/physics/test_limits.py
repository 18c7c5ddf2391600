"""Without noise there is no error: the analytic limits of the whole chain, through the FMUs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sblcosim

QUIET: dict[str, Any] = {
    "time": {"duration_s": 60.0},
    "target": {"depth_std_m": 0.0},
    "acoustics": {"range_std_m": 0.0, "motion_during_travel": False},
    "receiver": {"range_std_m": 0.05, "depth_std_m": 0.05},
}


def final_error(result: sblcosim.Result, receiver: str, last_s: float = 10.0) -> float:
    """Largest distance in m between estimate and truth over the end of the run."""
    estimates = result.tracks[receiver]
    error = np.linalg.norm(estimates[["error_x_m", "error_y_m", "error_z_m"]], axis=1)
    late = estimates["epoch_s"] > estimates["epoch_s"].iloc[-1] - last_s
    assert late.sum() > 50
    return float(error[late].max())


def test_sequential_converges_on_a_straight_line() -> None:
    straight = {
        "trajectory": "straight_line", "center_m": [10.0, -15.0], "heading_deg": 70.0,
        "path_length_m": 100.0, "depth_start_m": 4.0, "depth_end_m": 9.0,
    }
    result = sblcosim.run({**QUIET, "target": {**QUIET["target"], **straight}}, "sequential")
    assert final_error(result, "sequential") < 1e-3
    # The raw fix mixes ranges of four epochs: it lags behind a diver who moves.
    assert final_error(result, "raw") > 1e-2


@pytest.mark.parametrize("arm", [0.4, 3.0])
def test_all_receivers_converge_on_a_target_at_rest(arm: float) -> None:
    rest = {"trajectory": "waypoints", "waypoint_m": [[12.0, 5.0, 6.0], [12.0, 6.0, 6.0]]}
    result = sblcosim.run(
        {
            **QUIET,
            "target": {**QUIET["target"], **rest, "speed_m_s": 0.0},
            "platform": {"arm_length_m": arm},
        },
        ["ekf", "sequential", "multilateration"],
    )
    for receiver in ("ekf", "sequential", "multilateration"):
        assert final_error(result, receiver) < 1e-3


def test_travel_time_motion_and_sound_speed_show_up_as_they_must() -> None:
    """A diver who swims away at v gains v tau on every range; a wrong c scales all of them."""
    line = {"trajectory": "straight_line", "center_m": [5.0, 0.0], "heading_deg": 0.0,
            "speed_m_s": 1.5, "depth_start_m": 0.5, "depth_end_m": 0.5}
    result = sblcosim.run(
        {
            "time": {"duration_s": 30.0},
            "target": {**line, "depth_std_m": 0.0},
            "acoustics": {"range_std_m": 0.0, "sound_speed_m_s": 1530.0,
                          "assumed_sound_speed_m_s": 1500.0},
        },
    )
    record = result.table
    epoch = record["acoustics.range_epoch[1]"].to_numpy()
    heard = record["acoustics.reception_count[1]"].to_numpy() > 0
    at_ping = 5.0 + 1.5 * epoch - 3.0  # beacon 1 is 3 m north of the centre
    path = at_ping * 1530.0 / (1530.0 - 1.5)
    np.testing.assert_allclose(record["acoustics.true_range[1]"][heard], path[heard], atol=1e-9)
    np.testing.assert_allclose(
        record["acoustics.range[1]"][heard], path[heard] * 1500 / 1530, atol=1e-9
    )
