"""What a trajectory declares of itself; each is a module of ``trajectories``, found there."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from ..declaration import Variable
from ..draws import Draw
from ..numbered import in_order
from ..symbols import Symbols

if TYPE_CHECKING:
    from ..equations import Equations

Course = Callable[[Symbols, Symbols, Any], tuple[Any, Any]]
"""``course(p, x, s)``: point at the distance `s` [m], and its derivative with respect to `s`."""

HORIZONTAL = ("speed", "departure_time", "center", "depth_start", "depth_end")
"""Shared parameters of all courses that are horizontal but for a depth that changes evenly."""


@dataclass(frozen=True)
class Trajectory:
    """A motion of the diver: a horizontal course and its length, or equations of its own.

    Attributes
    ----------
    number
        Its value in the FMU; never reused.
    takes
        Names of parameters that are shared, or another trajectory's own.
    parameters
        Its own. What they need is said of other parameters only: that the trajectory takes them
        is known.
    course, length
        Of a horizontal course: points [m], and the length of the whole, ``length(p)`` [m].
    equations
        Makes the equations of a motion that is no such course.
    draws
        Random numbers of its own, for all trajectories alike, besides those that all have.
    random
        Whether it is drawn anew in each run: always, never, or where one of these is not zero.
    place
        Where its own parameters stand among those of the others, if not by its number.
    """

    number: int
    takes: tuple[str, ...] = ()
    parameters: tuple[Variable, ...] = ()
    course: Course | None = None
    length: Callable[[Symbols], Any] | None = None
    equations: Callable[[], Equations] | None = None
    draws: tuple[Draw, ...] = ()
    random: Literal["always"] | tuple[str, ...] = ()
    place: int | None = None

    def __post_init__(self) -> None:
        if (self.course is None) != (self.length is None):
            raise ValueError(f"trajectory {self.number}: must have a course with its length")
        if (self.course is None) == (self.equations is None):
            raise ValueError(f"trajectory {self.number}: must have a course, or equations")

    @property
    def all(self) -> frozenset[str]:
        """Names of all parameters that it takes."""
        return frozenset((*self.takes, *(v.name for v in self.parameters)))


def numbered(trajectories: Mapping[str, Trajectory]) -> Mapping[str, Trajectory]:
    """Trajectories in the order of their numbers, as `in_order` says."""
    return in_order("trajectories", trajectories)
