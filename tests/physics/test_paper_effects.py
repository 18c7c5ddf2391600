"""Which error source matters: the paper's Table 3 in its Scenario 1."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import sblcosim

FACTORS = {
    "baseline": (("platform.arm_length_m",), 0.4, 3.0),
    "gps": (("platform.gps_horizontal_std_m",), 0.1, 3.5),
    "imu": (("platform.imu_tilt_std_deg", "platform.imu_heading_std_deg"), 1.0, 10.0),
    "depth": (("target.depth_std_m",), 0.01, 0.1),
    "range": (("acoustics.range_std_m",), 0.1, 1.0),
    "sampling time": (("time.sampling_time_s",), 0.1, 1.0),
    "packet loss": (("acoustics.loss_probability",), 0.0, 0.25),
}
REPLICATES = 5


@pytest.mark.slow
def test_gps_and_baseline_are_by_far_the_largest_main_effects() -> None:
    responses = []
    levels = list(itertools.product((-1, 1), repeat=len(FACTORS)))
    for point, signs in enumerate(levels):
        overrides = {
            key: high if sign > 0 else low
            for (keys, low, high), sign in zip(FACTORS.values(), signs, strict=True)
            for key in keys
        }
        rms = []
        for replicate in range(REPLICATES):
            seed = 1 + point * REPLICATES + replicate
            result = sblcosim.run("paper-scenario-1", overrides={**overrides, "seed": seed})
            rms.append(result.errors.loc[("ekf", "absolute", "total"), "rms_m"])
        responses.append(np.mean(rms))
    design, y = np.array(levels), np.array(responses)
    effects = dict(zip(FACTORS, 2 * design.T @ y / len(y), strict=True))
    ranked = sorted(effects, key=lambda name: -abs(effects[name]))
    print(f"mean RMS {y.mean():.3f} m; effects in m:")
    print("\n".join(f"{name:>14} {effects[name]:+.3f}" for name in ranked))
    assert ranked[:2] == ["gps", "baseline"]
    third = abs(effects[ranked[2]])
    assert abs(effects["gps"]) > 2 * third
    assert abs(effects["baseline"]) > 2 * third
    assert effects["gps"] > 0 > effects["baseline"]
