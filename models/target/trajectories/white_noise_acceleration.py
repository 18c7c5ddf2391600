"""Motion driven by white noise acceleration."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING, Any

from ...declaration import parameter
from ...symbols import Symbols, Values, ca
from ..course import TOLERANCE, clip, states
from ..trajectory import Trajectory

if TYPE_CHECKING:
    from ...equations import Equations


def _equations() -> Equations:
    from ...equations import Loop
    from ..motion import equations

    return equations(_initial, _between, node=Loop("node", _due, _node))


def _initial(p: Symbols, w: Symbols, t: Any) -> Values:
    # Begin one interval early, so that the loop draws the first two nodes like all others.
    return states(
        p, t, 0, cursor=-1,
        next_position=p.initial_position + p.initial_position_std * w.first_motion[:3],
        next_velocity=p.initial_velocity + p.initial_velocity_std * w.first_motion[3:],
    )


def _due(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Any:
    """Whether `t` has reached the end of the current interval, node ``cursor + 1``."""
    return t - x.start + TOLERANCE >= (x.cursor + 1) * p.sampling_time


def _node(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """Draw the node after next, with Φ and Q of white acceleration of power spectral density q.

    Q = q [[T³/3, T²/2], [T²/2, T]] = L Lᵀ with L = √(q T) [[T/√3, 0], [√3/2, 1/2]].
    """
    T = p.sampling_time
    scale = ca.sqrt(p.acceleration_psd * T)
    along, rest = w.kick[:3], w.kick[3:]
    return {
        "cursor": x.cursor + 1,
        "node_position": x.next_position,
        "node_velocity": x.next_velocity,
        "next_position": x.next_position + T * x.next_velocity + scale * T / sqrt(3) * along,
        "next_velocity": x.next_velocity + scale * (sqrt(3) / 2 * along + rest / 2),
    }


def _between(p: Symbols, x: Symbols, t: Any) -> tuple[Any, Any]:
    """Cubic Hermite interpolation: the mean of the process given its nodes."""
    T = p.sampling_time
    tau = clip((t - x.start - x.cursor * T) / T, 1)
    step = x.next_position - x.node_position
    first, second = T * x.node_velocity, T * x.next_velocity
    quadratic = 3 * step - 2 * first - second
    cubic = first + second - 2 * step
    position = x.node_position + tau * (first + tau * (quadratic + tau * cubic))
    return position, (first + tau * (2 * quadratic + 3 * tau * cubic)) / T


TRAJECTORY = Trajectory(
    number=8,
    parameters=(
        parameter("initial_position", "Mean of the first position of the white-noise-acceleration "
                  "motion, NED", "m", shape=(3,), start=(15.0, 0.0, 5.0)),
        parameter("initial_position_std", "Standard deviation of that position, per axis", "m",
                  start=0.0, min=0.0),
        parameter("initial_velocity", "Mean of the first velocity of that motion, NED", "m/s",
                  shape=(3,)),
        parameter("initial_velocity_std", "Standard deviation of that velocity, per axis", "m/s",
                  start=0.0, min=0.0),
        parameter("acceleration_psd", "Power spectral density q of the white acceleration, per "
                  "axis", "m2/s3", start=0.01, min=0.0),
    ),
    equations=_equations,
    random=("acceleration_psd", "initial_position_std", "initial_velocity_std"),
    place=9,  # in the FMUs, its parameters have always come after those of `file`
)
