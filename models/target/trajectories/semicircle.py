"""Half a circle."""

from __future__ import annotations

from math import pi

from ...declaration import parameter
from ..course import circle
from ..trajectory import HORIZONTAL, Trajectory

TRAJECTORY = Trajectory(
    number=2,
    takes=(*HORIZONTAL, "heading"),
    parameters=(
        parameter("radius", "Radius of semicircle and circle", "m", start=15.0, min=0.01, max=1e5),
    ),
    course=circle,
    length=lambda p: pi * p.radius,
)
