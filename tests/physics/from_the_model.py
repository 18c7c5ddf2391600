"""Dives whose motion and start are drawn from the model of the filters, for many runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import sblcosim

START = (15.0, 0.0, 15.0)


def platform(arm: float) -> dict[str, Any]:
    """A cross of four beacons with the errors of common equipment."""
    return {
        "arm_length_m": arm, "gps_horizontal_std_m": 0.1, "gps_horizontal_markov_std_m": 1.2,
        "gps_correlation_time_s": 120.0, "imu_heading_std_deg": 1.0,
        "imu_heading_turn_on_std_deg": 3.0, "imu_tilt_std_deg": 0.5,
    }


def dive(
    time: Mapping[str, float], platform: Mapping[str, Any], acoustics: Mapping[str, Any],
    receiver: Mapping[str, Any], q: float = 0.002, start: Sequence[float] = START,
) -> sblcosim.Scenario:
    """The scenario with these tables; the motion is white acceleration of the density q."""
    return sblcosim.load({
        "time": time,
        "target": {
            "trajectory": "white_noise_acceleration", "acceleration_psd_m2_s3": q,
            "initial_position_m": start, "initial_position_std_m": 1.0,
            "initial_velocity_std_m_s": 0.1, "depth_std_m": 0.05,
        },
        "platform": platform,
        "acoustics": acoustics,
        "receiver": {
            "initialisation": "prior", "prior_position_m": start, "prior_position_std_m": 1.0,
            "prior_velocity_std_m_s": 0.1, **receiver,
        },
    })
