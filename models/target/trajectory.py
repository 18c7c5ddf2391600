"""Declaration of a trajectory; each is a module of ``trajectories``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from ..declaration import DeclarationError, Variable
from ..draws import Draw
from ..numbered import in_order
from ..symbols import Symbols

if TYPE_CHECKING:
    from ..equations import Equations

Course = Callable[[Symbols, Symbols, Any], tuple[Any, Any]]
"""``course(p, x, s)``: point at distance `s` [m], and its derivative with respect to `s`."""

HORIZONTAL = ("speed", "departure_time", "center", "depth_start", "depth_end")
"""Shared parameters of all courses that are horizontal except for a linear change of depth."""


@dataclass(frozen=True)
class Trajectory:
    """A motion of the diver: a horizontal course and its length, or its own equations.

    Attributes
    ----------
    number
        Its value in the FMU; never reused.
    takes
        Names of parameters that are shared, or that another trajectory declares.
    parameters
        Its own parameters. Their requirements name other parameters only: the trajectory itself is
        added.
    course, length
        For a horizontal course: its points [m], and its total length, ``length(p)`` [m].
    equations
        Makes the equations of a motion that is not such a course.
    draws
        Additional random numbers, available to all trajectories alike.
    random
        Whether each run draws it anew: always, never, or if one of these parameters is not zero.
    place
        Place of its own parameters among those of the others, if not given by its number.
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
            raise DeclarationError(f"trajectory {self.number}: must have a course with its length")
        if (self.course is None) == (self.equations is None):
            raise DeclarationError(f"trajectory {self.number}: must have a course, or equations")

    @property
    def all(self) -> frozenset[str]:
        """Names of all parameters that it uses."""
        return frozenset((*self.takes, *(v.name for v in self.parameters)))


def numbered(trajectories: Mapping[str, Trajectory]) -> Mapping[str, Trajectory]:
    """Trajectories in the order of their numbers; see `in_order`."""
    return in_order("trajectories", trajectories)
