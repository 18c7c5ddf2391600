"""An Archimedean spiral."""

from __future__ import annotations

from math import pi
from typing import Any

from ...declaration import parameter
from ...symbols import Symbols, ca
from ..course import TINY, bearing
from ..trajectory import HORIZONTAL, Trajectory

HALLEY_STEPS = 3


def _rate(p: Symbols) -> Any:
    """b in r = a + b θ [m/rad]."""
    return (p.spiral_radius[1] - p.spiral_radius[0]) / (2 * pi * p.turns)


def arc(p: Symbols, angle: Any) -> Any:
    """Arc length of the Archimedean spiral from 0 to `angle` [m].

    The integral of √(r² + b²) dθ is (F(r) − F(a)) / b with F(r) = ½ (r q + b² ln(r + q)) and
    q = √(r² + b²). Written without that division, the formula also holds for b = 0 (a circle).
    """
    a, b = p.spiral_radius[0], _rate(p)
    r = a + b * angle
    q_a, q_r = ca.sqrt(a**2 + b**2), ca.sqrt(r**2 + b**2)
    chord = angle * (r + a) * (r**2 + a**2 + b**2) / ca.fmax(r * q_r + a * q_a, TINY)
    return (chord + b * ca.log((r + q_r + TINY) / (a + q_a + TINY))) / 2


def angle_at(p: Symbols, s: Any) -> Any:
    """Angle at which the arc length is `s` [rad]."""
    a, b = p.spiral_radius[0], _rate(p)

    def derivative(r: Any) -> Any:
        return ca.sqrt(r**2 + b**2)

    # s ≈ (r² − a²) / 2b gives r. Simpson's mean of √(r² + b²) from a to r then gives the angle to
    # within 16 %. Each Halley step triples the number of correct digits.
    r = ca.sqrt(ca.fmax(a**2 + 2 * b * s, 0))
    angle = 6 * s / ca.fmax(derivative(a) + 4 * derivative((a + r) / 2) + derivative(r), TINY)
    for _ in range(HALLEY_STEPS):
        excess = arc(p, angle) - s
        r = a + b * angle
        q = ca.fmax(derivative(r), TINY)
        angle -= 2 * excess * q / ca.fmax(2 * q**2 - excess * r * b / q, TINY)
    return angle


def course(p: Symbols, x: Symbols, s: Any) -> tuple[Any, Any]:
    b = _rate(p)
    angle = angle_at(p, s)
    r = p.spiral_radius[0] + b * angle
    radial = bearing(p.heading + angle)
    across = ca.vertcat(-radial[1], radial[0])
    q = ca.fmax(ca.sqrt(r**2 + b**2), TINY)
    return p.center + r * radial, (b * radial + r * across) / q


TRAJECTORY = Trajectory(
    number=5,
    takes=(*HORIZONTAL, "heading", "turns"),
    parameters=(
        parameter("spiral_radius", "Distance from the centre at the beginning and at the end of "
                  "the spiral", "m", shape=(2,), start=(2.5, 25.0), min=0.0, max=1e5),
    ),
    course=course,
    length=lambda p: arc(p, 2 * pi * p.turns),
)
