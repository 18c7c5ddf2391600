"""Parameters of runs side by side: what is refused, and which of several is named."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
import sblcosim
from sblcosim.errors import ConfigurationError
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters import lanes
from sblcosim.simulation.plans.plan import Plan
from sblcosim.simulation.resolve import resolve

LOSS, NOISE = "acoustics.loss_probability", "acoustics.range_std"
SHADOW = "acoustics.shadow_loss_probability"


@cache
def plan() -> Plan:
    system = connect(sblcosim.load("paper-scenario-1", {"time.duration_s": 0.5}), ["ekf"])
    return resolve(system)


def bounds(name: str) -> tuple[float, float]:
    component, _, variable = name.partition(".")
    (port,) = (c.ports[variable] for c in plan().components if c.name == component)
    return min(port.min), max(port.max)


def refused(given: dict[str, Any]) -> str:
    with pytest.raises(ConfigurationError) as caught:
        lanes.execute(plan(), given)
    return str(caught.value)


@pytest.mark.parametrize(("name", "wrong"), [
    (NOISE, [0.1, -0.25, 0.5]), (SHADOW, [0.1, 1.5, 0.5]), (SHADOW, [-0.1, 1.0, 0.5]),
])  # fmt: skip
def test_the_parameter_that_is_out_of_its_bounds_is_named_and_not_one_at_them(
    name: str, wrong: list[float]
) -> None:
    low, high = bounds(name)
    assert bounds(LOSS) == (0.0, 1.0)
    assert refused({LOSS: [0.0, 1.0, 0.5], name: wrong}) == (
        f"{name}: must be between {low:g} and {high:g} in every run, got {min(wrong):g} to "
        f"{max(wrong):g}"
    )


def test_values_that_are_not_finite_are_refused() -> None:
    for wrong in (np.nan, np.inf):
        assert refused({LOSS: [0.0, 1.0], NOISE: [0.1, wrong]}) == (
            f"{NOISE}: must be finite in every run"
        )


def test_values_that_are_too_many_are_refused() -> None:
    assert refused({LOSS: [0.5, 0.6], NOISE: [0.1, 0.2, 0.3]}) == (
        f"{NOISE}: must have 2 runs, got 3"
    )
    assert refused({NOISE: [[0.1, 0.2]]}) == f"{NOISE}: must have 1 values per run, got 2"


def test_a_value_for_all_runs_is_that_of_each() -> None:
    seeds = np.arange(1, 12)
    one = lanes.execute(plan(), {"acoustics.seed": seeds, NOISE: 0.7, LOSS: [0.25]})
    each = lanes.execute(
        plan(), {"acoustics.seed": seeds, NOISE: np.full(11, 0.7), LOSS: np.full(11, 0.25)}
    )
    assert len(one.sums["ekf"]) == 11
    np.testing.assert_array_equal(one.sums["ekf"], each.sums["ekf"])
