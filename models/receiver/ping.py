"""What all arrivals of one ping share: states besides those of `surroundings`.

Beacons that hear one ping share a part c of their range errors, the white error b of the reported
depth of the platform, and the errors of roll and pitch: a white one, τ, and a lasting one, m, of
the IMU or of the frame of the beacons. c, b and τ are drawn anew for each ping: Gauss-Markov
processes without memory. The formulas are for components and bounds alike, see `surroundings`.
``p`` has the parameters of
`sblcosim.models.receiver.receivers.array.COMPONENT`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

from . import surroundings
from .surroundings import PLATFORM, POSITION, VELOCITY, Elements, Pose, Range

_MEMORY = 1e-6
"""Correlation time of what has no memory [s]: nothing is left at the next ping, all at 0 s."""
STATES = 6
UNKNOWN_STD, UNTIMED_STD = 1e3, 200.0
"""Those of c and of the first position if the time of a ping is unknown [m]."""
LEAST_ARRIVAL_STD = 1e-4
"""Smallest standard deviation of an arrival, as a range [m]."""


@dataclass(frozen=True, slots=True)
class Ping:
    """The states of a ping.

    Attributes
    ----------
    first
        Index of the first of the `STATES`.
    """

    first: int

    @property
    def common(self) -> int:
        """c [m]."""
        return self.first

    @property
    def sunk(self) -> int:
        """b [m], down."""
        return self.first + 1

    @property
    def tilts(self) -> tuple[int, int]:
        """τ of roll and pitch [rad]."""
        return self.first + 2, self.first + 3

    @property
    def errors(self) -> tuple[int, int]:
        """m of roll and pitch [rad]."""
        return self.first + 4, self.first + 5

    def variance(self, p: Any) -> Any:
        """Prior variance of c [m²]: very large if the time of a ping is unknown."""
        return p.common_clock * p.range_common_std**2 + (1 - p.common_clock) * UNKNOWN_STD**2

    def timed(self, p: Any) -> Any:
        """Whether the time of a ping is known: 0 or 1."""
        return p.common_clock

    def late_together(self, p: Any) -> Any:
        """Whether the arrivals of a ping are late together: 0 or 1."""
        return p.arrivals_shared

    def prior_stds(self, m: Any, p: Any) -> dict[int, Any]:
        """Standard deviations before any measurement."""
        return {
            self.common: m.sqrt(self.variance(p)),
            self.sunk: p.gps_vertical_std,
            **dict.fromkeys(self.tilts, m.sqrt(surroundings.tilt(p, 0.0)[1])),
            **dict.fromkeys(self.errors, p.imu_tilt_error_std),
        }

    def transition(self, m: Any, p: Any, dt: Any, pings: Any = 1.0) -> tuple[Elements, Elements]:
        """Φ without its ones, and the upper triangle of Q, over ``dt`` [s].

        Parameters
        ----------
        pings
            Number of pings that an epoch stands for, each with errors of its own.
        """
        kept = m.exp(-dt / _MEMORY)
        new = (1 - kept**2) / pings
        stds = self.prior_stds(m, p)
        fresh = (self.common, self.sunk, *self.tilts)
        return {(i, i): kept for i in fresh}, {(i, i): stds[i] ** 2 * new for i in fresh}

    def range_(self, m: Any, p: Any, x: Sequence[Any], pose: Pose, body: Sequence[Any]) -> Range:
        """A range of a ping at a beacon, see `surroundings.range_`.

        The epoch is that of the arrivals. The ping left the diver earlier, from where it was then.
        Where the pose is not reported, its tilt is not that of the beacons, and the errors of it
        are not in the range.
        """
        there = 1 - pose.own
        roll, pitch = (
            angle + there * (x[one] + x[other])
            for angle, one, other in zip(
                (pose.roll, pose.pitch), self.tilts, self.errors, strict=True
            )
        )
        tilted = replace(
            pose, down=pose.down - x[self.sunk], roll=roll, pitch=pitch,
            tilt_variance=pose.tilt_variance * pose.own,
        )
        travel = self._travel_time(m, p, x, pose)
        left = [*(x[i] - travel * x[j] for i, j in zip(POSITION, VELOCITY, strict=True)), *x[3:]]
        of_each = SimpleNamespace(**{**vars(p), "gps_vertical_std": 0.0})  # b has it
        found = surroundings.range_(m, of_each, left, tilted, body, LEAST_ARRIVAL_STD)
        slopes = [-there * slope for slope in found.tilts]
        return replace(
            found,
            value=found.value + x[self.common],
            row={
                **found.row, self.common: 1, self.sunk: found.u[2],
                **{j: -travel * u for j, u in zip(VELOCITY, found.u, strict=True)},
                **dict(zip((*self.tilts, *self.errors), [*slopes, *slopes], strict=True)),
            },
        )

    def _travel_time(self, m: Any, p: Any, x: Sequence[Any], pose: Pose) -> Any:
        """Time from the diver to the platform [s]."""
        o = (x[0] - x[PLATFORM[0]], x[1] - x[PLATFORM[1]], x[2] - pose.down)
        distance = m.sqrt(m.fmax(o[0] * o[0] + o[1] * o[1] + o[2] * o[2], 1e-12))
        return distance / p.assumed_sound_speed

    def swung(self, y: Any, deep: Any, heading: Any, m: Any) -> dict[int, Any]:
        """Derivatives of the diver's north and east by the tilts, for measured ranges, (2, 1) each.

        Parameters
        ----------
        y
            Horizontal offset from the platform, (2, 1) [m].
        deep
            Depth below it [m].
        heading
            Of the platform [rad].
        """
        c, s = m.cos(heading), m.sin(heading)
        reach = m.fmax(y[0] ** 2 + y[1] ** 2, surroundings.NEAREST**2)
        # Roll φ and pitch θ rotate the frame by a = φ (c, s) + θ (-s, c), and the diver by a × o,
        # north deep a_e, east -deep a_n. Along the line to the platform, ranges and depth hold it.
        found: dict[int, Any] = {}
        for states, turn in zip(zip(self.tilts, self.errors, strict=True),
                                ((c, s), (-s, c)), strict=True):
            across = (-deep * (turn[1] * y[1] + turn[0] * y[0])) / reach
            shift = m.vertcat(-across * y[1], across * y[0])
            found |= dict.fromkeys(states, shift)
        return found
