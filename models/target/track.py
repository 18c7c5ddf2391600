"""Motion through the points of a track: cubic interpolation between points, in every axis.

Formulas written once for two uses: ``m`` is the module ``casadi`` for the component and ``numpy``
for choosing the points. A number may be a column or an array.
"""

from __future__ import annotations

from typing import Any


def velocity(m: Any, before: Any, after: Any, first: Any, second: Any) -> Any:
    """Velocity at a point between two others [m/s], by Fritsch and Butland (1984).

    Harmonic mean of the mean velocities on both sides, weighted with the durations. It is 0 if one
    of them is 0 or their signs differ, so that no coordinate leaves the range of its two points.

    Parameters
    ----------
    before, after
        Steps from the previous point and to the next one [m].
    first, second
        Their durations [s].
    """
    left, right = before / first, after / second
    together = (2 * second + first) * right + (second + 2 * first) * left
    product = m.fmax(left * right, 0)
    return 3 * (first + second) * product / (together + (product == 0))


def motion(
    tau: Any, duration: Any, begin: Any, step: Any, first: Any, last: Any
) -> tuple[Any, Any]:
    """Position [m] and velocity [m/s] between two points: the cubic Hermite polynomial.

    Parameters
    ----------
    tau
        Fraction of the time that has passed, 0 to 1.
    duration
        Time from point to point [s], positive.
    begin, step
        The first point, and the second minus the first [m].
    first, last
        Velocities at both [m/s].
    """
    one, two = duration * first, duration * last
    quadratic = 3 * step - 2 * one - two
    cubic = one + two - 2 * step
    position = begin + tau * (one + tau * (quadratic + tau * cubic))
    return position, (one + tau * (2 * quadratic + 3 * tau * cubic)) / duration
