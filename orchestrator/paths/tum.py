"""Paths as trajectories of the TUM benchmark: ``timestamp tx ty tz qx qy qz qw``.

Positions are east, north, up [m]. Timestamps are in seconds, exact to the nanosecond as texts. The
orientation is unknown, and the quaternion is that of no turn.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..errors import escaped
from .diver_path import DiverPath
from .frames import enu
from .names import safe

HEAD = "timestamp [s] tx ty tz [m, east north up] qx qy qz qw [unknown orientation]"


def write(folder: Path, paths: Sequence[DiverPath], start_ns: int) -> None:
    """Write a file for each path with a point: ``path-NAME.tum``.

    Timestamps increase: readers refuse others. Of several points at one time, the last is written.

    Parameters
    ----------
    start_ns
        Time 0 since 1970 [ns].
    """
    for name, path in zip(safe(path.name for path in paths), paths, strict=True):
        ordered = path.in_time()
        if len(ordered):
            lines = [f"# {escaped(path.name)}: {HEAD}", *_lines(ordered, start_ns)]
            (folder / f"path-{name}.tum").write_text("\n".join(lines) + "\n", "utf-8")


def _lines(path: DiverPath, start_ns: int) -> list[str]:
    stamps = [seconds(start_ns + time) for time in path.time_ns.tolist()]
    # Readers take timestamps as numbers of 64 bits.
    lines = {
        float(stamp): f"{stamp} {x!r} {y!r} {z!r} 0 0 0 1"
        for stamp, (x, y, z) in zip(stamps, enu(path.position).tolist(), strict=True)
    }
    return [*lines.values()]


def seconds(time_ns: int) -> str:
    """A time in seconds, as an exact text."""
    sign, size = ("-", -time_ns) if time_ns < 0 else ("", time_ns)
    return f"{sign}{size // 10**9}.{size % 10**9:09d}"
