"""Intervals derived from others."""

from __future__ import annotations

from typing import Any

from .either import rounded

_SECOND = 1_000_000_000
"""Nanoseconds per second."""


def update_interval(sampling_time_s: Any, ekf_ratio: Any) -> Any:
    """Time between updates of a receiver [s].

    Parameters
    ----------
    sampling_time_s
        Sampling time of the sensors, a whole count of nanoseconds [s]; and so is the result.
    ekf_ratio
        Sampling times per update.
    """
    return rounded(sampling_time_s * _SECOND) * ekf_ratio / _SECOND
