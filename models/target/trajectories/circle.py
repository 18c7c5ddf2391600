"""A circle, any number of times."""

from __future__ import annotations

from math import pi

from ...declaration import not_zero, parameter
from ..course import circle
from ..trajectory import HORIZONTAL, Trajectory

TRAJECTORY = Trajectory(
    number=3,
    takes=(*HORIZONTAL, "heading", "radius"),
    parameters=(
        parameter("turns", "Number of turns of circle and spiral", start=2.0, min=0.01, max=1000.0,
                  needs=(not_zero("speed"),)),
    ),
    course=circle,
    length=lambda p: 2 * pi * p.turns * p.radius,
)
