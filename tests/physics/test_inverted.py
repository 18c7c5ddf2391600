"""Inverted ranging over many seeds: near the bound where everything is drawn from the model."""

from __future__ import annotations

import numpy as np
import pytest

from .from_the_model import dive, platform
from .near_the_bound import found_in

pytestmark = pytest.mark.slow
RUNS = 800


@pytest.mark.parametrize(("arm", "noise", "resolution", "heading", "away"), [
    (3.0, 0.05, 0.0, 0.0, 15.0), (0.4, 0.05, 0.0, 0.0, 15.0), (3.0, 0.02, 0.15, 0.0, 15.0),
    (3.0, 0.05, 0.0, 3.0, 15.0), (3.0, 0.05, 0.0, 0.5, 50.0), (3.0, 0.05, 0.02, 0.5, 200.0),
])
def test_where_motion_errors_and_biases_are_drawn_it_is_near_the_bound(
    arm: float, noise: float, resolution: float, heading: float, away: float
) -> None:
    """The clock, the speed of sound and the alignment of the frame are drawn for each run."""
    scenario = dive(
        {"sampling_time_s": 0.5, "duration_s": 60.0},
        {**platform(arm), "misalignment_heading_std_deg": heading},
        {"ranging": "inverted", "range_std_m": noise, "range_resolution_m": resolution,
         "loss_probability": 0.15, "clock_offset_std_s": 2e-4, "sound_speed_m_s": 1530.0},
        {"acceleration_psd_m2_s3": 0.002}, start=(away, 0.0, 15.0),
    )
    rng = np.random.default_rng(1)
    speeds = 1500.0 / (1 - 30.0 / 1530.0 * rng.standard_normal(RUNS))
    found = found_in(scenario, RUNS, **{"acoustics.sound_speed": speeds})
    assert found.lost == 0.0
    assert found.is_near
    assert 2.8 < found.nees < 3.3
