"""Motion through the points of a recorded track, of a diver or of a boat.

Cubic interpolation between points, in every axis. The formulas are written once for two uses: ``m``
is the module ``casadi`` for components and ``numpy`` for choosing the points. A number may be a
column or an array.

A component follows a track with its parameters ``track_count`` and ``track_time``, and the states
of `states`: the two points it is between, with their times and velocities.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .symbols import Symbols, Values, ca

if TYPE_CHECKING:
    from .equations import Row

LEAST_DURATION = 1e-9
"""Shortest time between two points of a track [s]; only keeps numbers finite."""


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
    stops = 2 * (product == 0) * (1 + m.fabs(together))  # any number that is never -together
    return 3 * (first + second) * product / (together + stops)


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


# --- Equations of a component ---------------------------------------------------------------------


def rows(time: str, **arrays: str) -> tuple[Row, ...]:
    """The rows that `leg` reads: of the current point, the next one, and the one after it.

    Parameters
    ----------
    time
        Parameter with the times of the points.
    arrays
        Parameters with their coordinates, by the name of the row.
    """
    from .equations import Row

    def ahead(count: int) -> Any:
        return lambda p, x: x.cursor + count

    return tuple(
        Row(f"{prefix}{name}", array, ahead(count))
        for count, prefix in enumerate(("", "next_", "after_"))
        for name, array in {"time": time, **arrays}.items()
    )


def states(first: Any, time: Any) -> Values:
    """The states at the start: at rest at the first point."""
    rest = ca.DM.zeros(first.shape[0])
    return {
        "cursor": 0,
        "leg_begin": time,
        "leg_end": time,
        "node_position": first,
        "node_velocity": rest,
        "next_position": first,
        "next_velocity": rest,
    }


def along(x: Symbols, since: Any) -> tuple[Any, Any]:
    """Position and velocity a time after the departure [s], between the points of the states."""
    duration = ca.fmax(x.leg_end - x.leg_begin, LEAST_DURATION)
    tau = ca.fmin(ca.fmax((since - x.leg_begin) / duration, 0), 1)
    step = x.next_position - x.node_position
    return motion(tau, duration, x.node_position, step, x.node_velocity, x.next_velocity)


def due(p: Symbols, x: Symbols, since: Any) -> Any:
    """Whether point ``cursor`` (0-based) has been reached a time after the departure [s]."""
    return ca.logic_and(since >= x.leg_end, x.cursor < p.track_count)


def leg(p: Symbols, x: Symbols, w: Symbols) -> Values:
    """Motion from point ``cursor`` to the next one; rest after the last one."""
    passing = velocity(
        ca, w.next_point - w.point, w.after_point - w.next_point,
        ca.fmax(w.next_time - w.time, LEAST_DURATION),
        ca.fmax(w.after_time - w.next_time, LEAST_DURATION),
    )
    more = x.cursor < p.track_count - 1
    return {
        "cursor": x.cursor + 1,
        "leg_begin": w.time,
        "leg_end": ca.if_else(more, w.next_time, w.time),
        "node_position": w.point,
        "node_velocity": x.next_velocity,
        "next_position": ca.if_else(more, w.next_point, w.point),
        "next_velocity": ca.if_else(x.cursor < p.track_count - 2, passing, 0),
    }
