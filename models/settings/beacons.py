"""Positions of the beacons on a platform."""

from __future__ import annotations

from typing import Any

from ..arrangement import cross
from ..ports import BEACONS
from .names import branching


def arranged(beacon_m: Any) -> dict[str, Any]:
    """Keys of ``[platform]`` that follow from whether beacons are given (or None)."""
    if beacon_m is None:
        return {"beacons": int(BEACONS)}
    return {"beacons": len(beacon_m) // 3, "arrangement": "given"}


@branching
def beacons_of(platform: Any) -> tuple[Any, ...]:
    """Nominal positions of the beacons, body frame, row by row [m]."""
    rows = cross(platform.beacons, platform.arm_length_m, platform.beacon_depth_m)
    if platform.arrangement == "given":
        flat = platform.beacon_m
        rows = tuple((flat[i], flat[i + 1], flat[i + 2]) for i in range(0, len(flat), 3))
    scale = platform.beacon_scale
    return tuple(v for x, y, z in rows for v in (scale * x, scale * y, z))
