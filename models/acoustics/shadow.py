"""Loss in the shadow of the diver's body, by the direction from the diver to the beacon.

Formulas written once for two uses: ``m`` is the module ``casadi`` for the component and ``numpy``
for what is possible. A number may be an array.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import Any


def chance(m: Any, angle: Any, loss: Any, half_width: Any) -> Any:
    """Probability that the shadow takes a packet: a cos²(πθ/4h) up to twice the half width h.

    Parameters
    ----------
    angle
        θ between the directions to the beacon and to the middle of the shadow [rad], 0 to π.
    loss, half_width
        a, the probability in the middle, and the angle h with half of it [rad].
    """
    return (angle < 2 * half_width) * loss * m.cos(pi / 4 * angle / half_width) ** 2


def mean(loss: Any, half_width: Any) -> Any:
    """Mean of `chance` over all directions in the horizontal plane: a h/π."""
    return loss * half_width / pi


def of_course(
    m: Any, offset: Sequence[Any], velocity: Sequence[Any], direction: Any, loss: Any,
    half_width: Any,
) -> Any:
    """`chance` of a diver who moves; 0 without a horizontal motion.

    Parameters
    ----------
    offset
        Beacon minus diver, NED [m].
    velocity
        That of the diver, north and east [m/s].
    direction
        The middle of the shadow, clockwise from the diver's course [rad].
    loss, half_width
        See `chance`.
    """
    (n, e, z), (v_n, v_e, *_) = offset, velocity
    scale = m.sqrt((n * n + e * e + z * z) * (v_n * v_n + v_e * v_e))
    along, right = n * v_n + e * v_e, e * v_n - n * v_e
    moving = scale > 0
    cosine = (along * m.cos(direction) + right * m.sin(direction)) / (scale + (scale == 0))
    angle = m.acos(m.fmin(m.fmax(cosine, -1.0), 1.0))
    return moving * chance(m, angle, loss, half_width)
