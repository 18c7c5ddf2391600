"""Intervals derived from others."""

from __future__ import annotations

from typing import Any

from .either import symbolic

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
    if symbolic(sampling_time_s):
        return sampling_time_s * ekf_ratio
    return round(sampling_time_s * _SECOND) * ekf_ratio / _SECOND
