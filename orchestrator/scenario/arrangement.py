"""Requirements on a platform and its beacons: waves that have a height; distinct positions."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from math import atan2, degrees, hypot, sqrt
from typing import Any

from sblcosim.models.receiver.receiver import Beacons

from .tracks import follows

_FLAT = 0.05
"""Ratio of the smaller to the larger spread of the beacons below which they count as in line."""
_SAME = 1e-6
"""Beacons closer than this [m] count as at the same position."""
_MOTION = {"sines": r".*_amplitude.*", "spectrum": r"yaw_amplitude.*|wave_height.*|watch_circle.*"}
_SENSORS = r"(gps|imu|misalignment)_.*_(m|deg|deg_s|deg_K)"
"""Keys of the platform's motion by its kind, and of the errors of its GPS, IMU and frame."""
_ARRAYS = (("platform", "mounting_error_m"), ("acoustics", "slot_order"),
           ("receiver", "beacon_offset_m"))


def problems(platform: Any, acoustics: Any, receiver: Any, beacons: int) -> Iterator[str]:
    """Contradictions in the tables of a scenario; one line each."""
    given = platform.beacon_m if "beacon_m" in platform.model_fields_set else None
    if given is not None and len(given) != 3 * beacons:
        yield (
            f"[platform] beacons: must be the number of rows of beacon_m ({len(given) // 3}), "
            f"got {beacons}"
        )
    calm = {"wave_height_m", "beaufort"}.isdisjoint(platform.model_fields_set)
    if platform.motion == "spectrum" and calm and platform.fmu is None:
        yield (
            "[platform] motion: must come with wave_height_m or beaufort when it is 'spectrum', "
            "got neither"
        )
    if platform.arrangement == "given":
        yield from _same_points(platform.beacon_m)
    tables = {"platform": platform, "acoustics": acoustics, "receiver": receiver}
    for name, key in _ARRAYS:
        table = tables[name]
        value = getattr(table, key)
        width = 1 if key == "slot_order" else 3
        if value is not None and len(value) != width * beacons and key in table.model_fields_set:
            what = "numbers" if width == 1 else "rows of 3 numbers"
            yield (
                f"[{name}] {key}: must have {beacons} {what}, one per beacon, got "
                f"{len(value) // width}"
            )
        elif key == "slot_order" and sorted(value) != [*range(1, beacons + 1)]:
            yield (
                f"[{name}] {key}: must have each number from 1 to {beacons} once, got "
                f"{list(value)}"
            )


def _same_points(flat: tuple[float, ...]) -> Iterator[str]:
    rows = [flat[i : i + 3] for i in range(0, len(flat), 3)]
    for j, there in enumerate(rows):
        for i, here in enumerate(rows[:j]):
            if sqrt(sum((a - b) ** 2 for a, b in zip(here, there, strict=True))) < _SAME:
                yield (
                    f"[platform] beacon_m: must have each beacon at a different position, got "
                    f"beacons {i + 1} and {j + 1} at {list(here)}"
                )


def degenerate(offsets: tuple[float, ...]) -> str | None:
    """Ambiguity of a fix, in words, if the beacons are nearly on a line seen from above.

    Parameters
    ----------
    offsets
        Positions in the body frame, row by row [m].
    """
    x, y = offsets[0::3], offsets[1::3]
    n = len(x)
    cx, cy = sum(x) / n, sum(y) / n
    xx = sum((a - cx) ** 2 for a in x)
    yy = sum((b - cy) ** 2 for b in y)
    xy = sum((a - cx) * (b - cy) for a, b in zip(x, y, strict=True))
    mean, half = (xx + yy) / 2, hypot((xx - yy) / 2, xy)
    longer, shorter = sqrt(mean + half), sqrt(max(mean - half, 0.0))
    if longer < _SAME:
        return (
            "all beacons are on one vertical line: ranges give the diver's distance and depth, "
            "but not the direction"
        )
    if shorter > _FLAT * longer:
        return None
    angle = degrees(atan2(2 * xy, xx - yy) / 2)
    where = "" if shorter <= _SAME else "nearly "
    return (
        f"seen from above the beacons are {where}on one line, {angle:.0f}° from forward: a "
        "position and its mirror image across that line have the same ranges, so a receiver may "
        "find either; near the line, the position across it is poorly known"
    )


def has_own_errors(platform: Any) -> bool:
    """Whether the beacons have only errors of their own: buoys, or a survey.

    Otherwise all beacons share those of a platform.
    """
    if platform.fmu is not None:
        return False
    if not platform.gps_shared:
        return True
    way = follows("platform", platform) or platform.boat_speed_m_s > 0
    moves = way or _any(platform, _MOTION[platform.motion])
    return bool(platform.mounting_std_m > 0) and not moves and not _any(platform, _SENSORS)


def shares_errors(platform: Any) -> bool:
    """Whether the beacons share the errors of one platform's GPS and IMU."""
    return platform.fmu is None and bool(platform.gps_shared) and _any(platform, _SENSORS)


def errors_of(platform: Any) -> Beacons | None:
    """Kind of errors of the beacons' positions; None if there are none, or if it is unknown."""
    if has_own_errors(platform):
        return "survey" if platform.gps_shared else "buoys"
    return "platform" if shares_errors(platform) else None


def keys_of_errors(kind: Any) -> dict[str, Any]:
    """Keys of a platform's motion, by its kind, and of what makes beacons share errors.

    Parameters
    ----------
    kind
        Class of the table.
    """
    return {
        "motions": {name: [*_matching(kind, it)] for name, it in _MOTION.items()},
        "sensors": [*_matching(kind, _SENSORS)],
    }


@cache
def _matching(kind: Any, pattern: str) -> tuple[str, ...]:
    """The keys of a table's class that match this pattern."""
    return tuple(key for key in kind.model_fields if re.fullmatch(pattern, key))


def _any(platform: Any, pattern: str) -> bool:
    """Whether any key that matches this pattern is nonzero."""
    values = (getattr(platform, key) for key in _matching(platform.__class__, pattern))
    return any(any(v) if isinstance(v, tuple) else bool(v) for v in values)
