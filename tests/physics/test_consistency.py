"""The sequential filter claims the errors that it makes, when the world is the one it assumes."""

from __future__ import annotations

import numpy as np
import sblcosim
from scipy.stats import chi2

SEEDS = range(1, 51)
DURATION = 60.0

MATCHED = {
    "time": {"sampling_time_s": 0.1, "duration_s": DURATION},
    "target": {
        # Motion and start as the filter's own model and prior have them.
        "trajectory": "white_noise_acceleration",
        "acceleration_psd_m2_s3": 0.01,
        "initial_position_m": [15.0, 0.0, 5.0],
        "initial_position_std_m": 1.0,
        "initial_velocity_std_m_s": 0.3,
        "depth_std_m": 0.05,
    },
    "platform": {"arm_length_m": 3.0},
    "acoustics": {"range_std_m": 0.1, "motion_during_travel": False},
    "receiver": {
        "type": "sequential",
        "initialisation": "prior",
        "prior_position_m": [15.0, 0.0, 5.0],
        "prior_position_std_m": 1.0,
        "prior_velocity_std_m_s": 0.3,
        "acceleration_psd_m2_s3": 0.01,
        "gate": 0.0,
    },
}


def test_nees_of_the_sequential_filter_is_that_of_a_matched_one() -> None:
    nees = []
    for seed in SEEDS:
        estimates = sblcosim.run(MATCHED, overrides={"seed": seed}).tracks["sequential"]
        nees.append(estimates["nees_position"].to_numpy())
        epochs = estimates["epoch_s"].to_numpy()
    runs = len(nees)
    mean = np.mean(nees, axis=0)[epochs > 5.0]
    low, high = chi2.ppf([0.025, 0.975], 3 * runs) / runs
    inside = np.mean((mean > low) & (mean < high))
    print(f"inside the band {inside:.3f}, time mean {mean.mean():.3f}")
    assert len(mean) > 500
    assert inside >= 0.90
    assert 2.8 <= mean.mean() <= 3.2
