"""Studies at the limits of what is allowed."""

from __future__ import annotations

from typing import Any

import pytest
from sblcosim.errors import ConfigurationError
from sblcosim.study import campaign, definition, study

ARM = {"keys": ["platform.arm_length_m"], "levels": [0.4, 3.0]}


def small(**changes: Any) -> definition.Study:
    """Runs of 2 s."""
    return study.load({
        "name": "small", "scenario": "paper-scenario-1", "fixed": {"time": {"duration_s": 2.0}},
        "factors": {"arm": ARM}, **changes,
    })  # fmt: skip


def test_something_of_a_run_is_left_after_the_settling_time() -> None:
    campaign.prepare(small(settling_time_s=1.9))
    with pytest.raises(ConfigurationError, match="settling_time_s: must be less than the length"):
        campaign.prepare(small(settling_time_s=2.0))


def test_a_name_may_have_sixty_letters() -> None:
    assert small(factors={"a" * 60: ARM}).factors.keys() == {"a" * 60}
    with pytest.raises(ConfigurationError, match="must have a name of at most 60 letters"):
        small(factors={"a" * 61: ARM})


def test_one_centre_point_may_have_the_seeds_of_the_others() -> None:
    made = small(seeding="common", design={"kind": "full", "centre_points": 1})
    assert made.points.values == ((0.4,), (3.0,), (1.7,))
    with pytest.raises(ConfigurationError, match="centre_points: must be at most 1 with seeding"):
        small(seeding="common", design={"kind": "full", "centre_points": 2})
