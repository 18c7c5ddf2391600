"""Two-way ranging over many seeds: near the bound where everything is drawn from the model."""

from __future__ import annotations

import numpy as np
import pytest

from .from_the_model import dive, platform
from .near_the_bound import found_in

pytestmark = pytest.mark.slow
RUNS = 800


@pytest.mark.parametrize(("arm", "bias", "noise", "away"), [
    (3.0, 1e-4, 1e-4, 15.0), (0.4, 1e-4, 1e-4, 15.0), (3.0, 1e-3, 3e-5, 15.0),
    (3.0, 0.0, 3e-4, 15.0), (3.0, 1e-4, 1e-4, 50.0), (3.0, 1e-4, 1e-4, 200.0),
])
def test_where_motion_errors_and_biases_are_drawn_it_is_near_the_bound(
    arm: float, bias: float, noise: float, away: float
) -> None:
    """The turn-around's shared error and the speed of sound are drawn for each run."""
    scenario = dive(
        {"sampling_time_s": 0.5, "duration_s": 60.0}, platform(arm),
        {"ranging": "two_way", "turnaround_s": 0.1, "turnaround_std_s": noise,
         "turnaround_bias_std_s": bias, "range_std_m": 0.05, "loss_probability": 0.15,
         "sound_speed_m_s": 1530.0},
        {"acceleration_psd_m2_s3": 0.002}, start=(away, 0.0, 15.0),
    )
    rng = np.random.default_rng(1)
    speeds = 1500.0 / (1 - 30.0 / 1530.0 * rng.standard_normal(RUNS))
    found = found_in(scenario, RUNS, **{"acoustics.sound_speed": speeds})
    assert found.lost == 0.0
    assert found.is_near
    assert 2.8 < found.nees < 3.3
