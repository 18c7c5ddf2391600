"""A straight line."""

from __future__ import annotations

from typing import Any

from ...symbols import Symbols
from ..course import bearing
from ..trajectory import HORIZONTAL, Trajectory


def course(p: Symbols, x: Symbols, s: Any) -> tuple[Any, Any]:
    direction = bearing(p.heading)
    return p.center + s * direction, direction


TRAJECTORY = Trajectory(
    number=1,
    takes=(*HORIZONTAL, "heading", "path_length"),
    course=course,
    length=lambda p: p.path_length,
)
