"""Number of points of a path: keys that follow from arrays."""

from __future__ import annotations

from typing import Any


def counts(target: Any) -> dict[str, int]:
    """Keys of ``[target]`` that follow from the given points."""
    found = {}
    if target.waypoint_m:
        found["waypoint_count"] = len(target.waypoint_m) // 3
    if target.track_time_s:
        found["track_count"] = len(target.track_time_s)
    return found
