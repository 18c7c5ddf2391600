"""Intervals derived from others."""

from __future__ import annotations

from typing import Any

_SECOND = 1_000_000_000
"""Nanoseconds per second."""


def update_interval(sampling_time_s: Any, ekf_ratio: int) -> Any:
    """Time between updates of a receiver [s].

    Parameters
    ----------
    sampling_time_s
        Sampling time of the sensors [s]. A number is a whole count of nanoseconds, and so is the
    ekf_ratio
        Sampling times per update.
    """
    return round(sampling_time_s * _SECOND) * ekf_ratio / _SECOND
