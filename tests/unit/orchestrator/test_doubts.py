"""What is valid in a scenario, and perhaps not what is meant."""

from __future__ import annotations

from typing import Any

import pytest
from sblcosim.scenario.doubts import doubts
from sblcosim.scenario.scenario import load, shipped


def said(overrides: dict[str, Any], source: str = "realistic-dive") -> list[str]:
    return [*doubts(load(source, overrides))]


@pytest.mark.parametrize("name", shipped())
def test_of_what_comes_along_there_are_none(name: str) -> None:
    assert not said({}, name)


# Above the water ---------------------------------------------------------------------------------


def test_waypoints_above_the_water_are_told() -> None:
    rows = [[0.0, 0.0, 5.0], [10.0, 0.0, -6.5], [10.0, 10.0, -2.5], [0.0, 10.0, -2.0]]
    (line,) = said({"target.waypoint_m": rows})
    assert line == (
        "override target.waypoint_m[2,3]: should be under water (down is positive), got a depth of "
        "-6.5 m, as 1 more of 4 rows"
    )
    assert not said({"target.waypoint_m": rows[:1] + rows[3:]})  # in the waves


def test_waypoints_that_nobody_follows_are_not_told() -> None:
    rows = [[0.0, 0.0, 5.0], [10.0, 0.0, 5.0], [10.0, 10.0, -9.0]]
    assert said({"target.waypoint_m": rows})
    assert not said({"target.waypoint_m": rows, "target.waypoint_count": 2})
    assert not said({"target.waypoint_m": rows, "target.trajectory": "semicircle"})
