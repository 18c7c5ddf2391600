"""The trajectories: each module of this folder declares one, named after its file."""

from __future__ import annotations

from collections.abc import Mapping

from ...found import declared
from ..trajectory import Trajectory, numbered

FOUND: Mapping[str, Trajectory] = numbered(declared(__name__, "TRAJECTORY", Trajectory))
"""Trajectories by name, in the order of their numbers."""
