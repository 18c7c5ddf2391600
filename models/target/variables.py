"""Declaration of the Target: the diver's motion and the tablet's depth sensor."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from math import pi

from ..declaration import (
    Component,
    Condition,
    DeclarationError,
    Variable,
    choice,
    is_one_of,
    noise_keys,
    not_zero,
    output,
    parameter,
    tick_interval,
)
from ..ports import DEPTH, MOTION, ports, terminal
from .trajectories import FOUND
from .trajectories.file import TRACK_POINTS as TRACK_POINTS

TRAJECTORIES: Mapping[int, str] = {it.number: name for name, it in FOUND.items()}
"""Names of the trajectories, by number."""

SHARED = (
    parameter("speed", "Speed along the path, in space", "m/s", start=0.5, min=0.0, max=20.0),
    parameter("departure_time", "Time after the start at which the motion begins", "s",
              start=0.0, min=0.0, max=1e9, needs=(not_zero("speed"),)),
    parameter("center", "Centre of the semicircle, circle, square, spiral or box; first point "
              "of the straight line; north and east", "m", shape=(2,)),
    parameter("heading", "Direction of the straight line; bearing from the centre to the first "
              "point of semicircle, circle and spiral; direction of the square's first side",
              "rad", start=0.0, min=-2 * pi, max=2 * pi),
    parameter("depth_start", "Depth at the beginning of the path", "m", start=5.0, min=0.0,
              max=11000.0),
    parameter("depth_end", "Depth at the end of the path; in between it changes in proportion "
              "to the distance covered", "m", start=5.0, min=0.0, max=11000.0,
              needs=(not_zero("speed"),)),
)
"""Parameters of several trajectories; each trajectory names the ones it uses."""


def _on(*trajectories: str) -> tuple[Condition, ...]:
    """The condition that the trajectory is one of these; empty if none is given."""
    return (is_one_of("trajectory", TRAJECTORIES, *trajectories),) if trajectories else ()


def _where_taken(variable: Variable) -> Variable:
    """A parameter with the trajectories that it needs.

    Its other requirements apply only to trajectories that use the parameter they refer to.
    """
    takers = {name: it.all for name, it in FOUND.items() if variable.name in it.all}

    def of_takers(group: tuple[Condition, ...]) -> tuple[Condition, ...]:
        about = {condition.parameter for condition in group}
        return (*group, *_on(*(name for name, own in takers.items() if not about & own)))

    return replace(variable, needs=(_on(*takers), *map(of_takers, variable.needs)))


def _nearest(name: str, known: Iterable[str]) -> str:
    """The known name that is nearest to a wrong one, as the end of a message."""
    from difflib import get_close_matches  # only for a message

    close = get_close_matches(name, sorted(known), n=1)
    return f"; did you mean {close[0]!r}?" if close else ""


def _of_trajectories() -> tuple[Variable, ...]:
    """All parameters of trajectories.

    Raises
    ------
    DeclarationError
        A trajectory uses a parameter that nobody declares.
    """
    ordered = sorted(FOUND.values(), key=lambda it: it.number if it.place is None else it.place)
    variables = (*SHARED, *(v for it in ordered for v in it.parameters))
    known = {v.name for v in variables}
    for name, it in FOUND.items():
        for unknown in sorted(it.all - known):
            shared = ", ".join(v.name for v in SHARED)
            raise DeclarationError(
                f"trajectory {name}: must take shared parameters ({shared}) or those of another "
                f"trajectory, got {unknown!r}{_nearest(unknown, known)}"
            )
    return tuple(map(_where_taken, variables))


def _random() -> Iterator[tuple[Condition, ...]]:
    """Requirements for anything to be random; in each group, at least one condition must hold."""
    sensor = not_zero("depth_std", "depth_bias_std")
    drawn = {name: it.random for name, it in FOUND.items() if it.random}
    yield (*sensor, *_on(*drawn))
    for name, stds in drawn.items():
        if stds != "always":
            yield (*sensor, *not_zero(*stds), *_on(*(drawn.keys() - {name})))


COMPONENT = Component(
    name="Target",
    number=1,
    description="A diver who moves along a path and carries a depth sensor",
    interval="sampling_time",
    variant="trajectory",
    variables=(
        choice("trajectory", "Path of the diver", TRAJECTORIES, 2),
        tick_interval("sampling_time", "Time between readings of the depth sensor"),
        *noise_keys(*_random()),
        *_of_trajectories(),
        parameter("depth_std", "Standard deviation of the depth sensor's white noise", "m",
                  start=0.1, min=0.0),
        parameter("depth_bias", "Constant error of the depth sensor, the same in every run", "m"),
        parameter("depth_bias_std", "Standard deviation of the error that each run adds to it", "m",
                  min=0.0),
        *ports(MOTION, "output"),
        *ports(DEPTH, "output"),
        output("true_depth", "True depth at the time of the newest reading", "m",
               variability="discrete"),
        output("path_duration", "Time from the start to the end of the path; 0 for a motion "
               "without an end", "s", variability="discrete"),
    ),
    terminals=(terminal("depth_sensor", "depth", "Newest reading of the depth sensor", DEPTH),),
)
