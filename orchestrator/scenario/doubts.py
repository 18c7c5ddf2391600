"""What is valid in a scenario, and perhaps not what is meant."""

from __future__ import annotations

from collections.abc import Iterator

from . import arrangement
from .assumptions import beacons_of
from .scenario import Scenario
from .tracks import ABOVE


def doubts(scenario: Scenario) -> Iterator[str]:
    """What may be a mistake; one line each, which names the key."""
    yield from _of_waypoints(scenario)
    yield from _of_arrangement(scenario)


def _of_waypoints(scenario: Scenario) -> Iterator[str]:
    """Rows above the water."""
    target = scenario.target
    if target.fmu is not None or target.trajectory != "waypoints":
        return
    depths = target.waypoint_m[2 : 3 * target.waypoint_count : 3]
    dry = [row for row, depth in enumerate(depths, 1) if depth < -ABOVE]
    if dry:
        rows = "" if len(dry) == 1 else f", as {len(dry) - 1} more of {len(depths)} rows"
        yield (
            f"{scenario.where('target', 'waypoint_m')}[{dry[0]},3]: should be under water (down is "
            f"positive), got a depth of {depths[dry[0] - 1]:g} m{rows}"
        )


def _of_arrangement(scenario: Scenario) -> Iterator[str]:
    """What the beacons cannot tell."""
    platform = scenario.platform
    problem = None if platform.fmu else arrangement.degenerate(beacons_of(platform))
    if problem is not None:
        key = "beacon_m" if platform.beacon_m else "arm_length_m"
        yield f"{scenario.where('platform', key)}: {problem}"
