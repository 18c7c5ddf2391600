"""Errors of a scenario of which the reference knows nothing: with them less is possible."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..scenario.arrangement import has_own_errors

if TYPE_CHECKING:
    from ..scenario.scenario import Scenario

SURVEY = "mounting_std_m"
"""The model of beacons with errors of their own knows it, that of a platform does not."""
LEFT_OUT = (
    "mounting_error_m", SURVEY, "imu_tilt_drift_deg_s", "imu_heading_drift_deg_s",
    "imu_tilt_temperature_coefficient_deg_K", "imu_heading_temperature_coefficient_deg_K",
    "imu_tilt_step_deg", "imu_tilt_scale_factor_error", "imu_heading_scale_factor_error",
    "imu_misalignment_deg",
)  # fmt: skip
"""Keys of ``[platform]`` that are in no model; `settings.assumptions.SOURCES` names the others."""


def left_out(scenario: Scenario) -> tuple[str, ...]:
    """Keys of ``[platform]`` that are not zero, and of which the reference knows nothing."""
    platform = scenario.platform
    known = {SURVEY} if has_own_errors(platform) else set()
    idle = scenario.idle()
    return tuple(
        key for key in LEFT_OUT
        if _not_zero(getattr(platform, key)) and key not in known and ("platform", key) not in idle
    )


def _not_zero(value: Any) -> bool:
    return any(value) if isinstance(value, tuple) else bool(value)
