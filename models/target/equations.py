"""Equations of the Target: paths in closed form, and the depth sensor; one set per trajectory."""

from __future__ import annotations

from collections.abc import Mapping

from ..equations import Equations
from .motion import horizontal
from .trajectories import FOUND
from .trajectory import Trajectory


def _of(trajectory: Trajectory) -> Equations:
    if trajectory.course is not None and trajectory.length is not None:
        return horizontal(trajectory.course, trajectory.length)
    assert trajectory.equations is not None
    return trajectory.equations()


EQUATIONS: Mapping[int, Equations] = {it.number: _of(it) for it in FOUND.values()}
