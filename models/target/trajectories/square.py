"""The four sides of a square."""

from __future__ import annotations

from math import pi
from typing import Any

from ...declaration import parameter
from ...symbols import Symbols, ca
from ..course import TOLERANCE, bearing, clip
from ..trajectory import HORIZONTAL, Trajectory


def course(p: Symbols, x: Symbols, s: Any) -> tuple[Any, Any]:
    def gone(side: int) -> Any:
        return clip(s - side * p.side, p.side)

    side = ca.fmin(ca.floor((s + x.rate * TOLERANCE) / p.side), 3)
    ahead, right = bearing(p.heading), bearing(p.heading + pi / 2)
    point = (
        p.center
        + (gone(0) - gone(2) - p.side / 2) * ahead
        + (gone(1) - gone(3) - p.side / 2) * right
    )
    return point, ((side == 0) - (side == 2)) * ahead + ((side == 1) - (side == 3)) * right


TRAJECTORY = Trajectory(
    number=4,
    takes=(*HORIZONTAL, "heading"),
    parameters=(
        parameter("side", "Side of the square", "m", start=15.0, min=0.01, max=1e5),
    ),
    course=course,
    length=lambda p: 4 * p.side,
)
