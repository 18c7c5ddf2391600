"""The trajectories: each module of this folder declares one, named after its file."""

from __future__ import annotations

from collections.abc import Mapping

from ...found import modules_of
from ..trajectory import Trajectory, numbered

FOUND: Mapping[str, Trajectory] = numbered(
    {name: module.TRAJECTORY for name, module in modules_of(__name__).items()}
)
"""Trajectories by name, in the order of their numbers."""
