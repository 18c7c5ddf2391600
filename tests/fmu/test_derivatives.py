"""Directional derivatives of the range model; no other component claims any."""

from __future__ import annotations

import numpy as np
import pytest
from sblcosim.models import COMPONENTS

from .host import ERROR, Array, Host, host, refused

BOTH = pytest.mark.parametrize("fmi", [2, 3])
BEACONS, AXES = 4, 3


@pytest.fixture
def geometry() -> tuple[Array, Array]:
    rng = np.random.default_rng(4)
    return rng.uniform(-20.0, 20.0, AXES), rng.uniform(-5.0, 5.0, (BEACONS, AXES))


def place(instance: Host, position: Array, beacons: Array) -> None:
    instance.set({"position": position, "beacon_position": beacons})


def jacobian(instance: Host, known: str) -> Array:
    """d range / d known, column by column."""
    component = instance.component
    size = component[known].size
    rows = instance.references(component["range"])
    columns = instance.references(component[known])
    result = []
    for seed in np.eye(size):
        if instance.fmi == 2:
            result.append(instance.slave.getDirectionalDerivative(rows, columns, seed))
        else:
            result.append(instance.slave.getDirectionalDerivative(rows, columns, seed, BEACONS))
    return np.array(result).T


@BOTH
def test_derivatives_are_the_unit_vectors_of_the_paper(
    fmi: int, geometry: tuple[Array, Array]
) -> None:
    """The part of H for the ranges in section 3: (x - x_i) / r_i."""
    instance = host("range_model", fmi).start()
    place(instance, *geometry)
    position, beacons = geometry
    offsets = position - beacons
    ranges = np.sqrt((offsets**2).sum(axis=1))
    unit = offsets / ranges[:, None]
    np.testing.assert_allclose(instance.get("range"), ranges, rtol=1e-15)
    np.testing.assert_allclose(jacobian(instance, "position"), unit, rtol=1e-14)
    by_beacon = np.zeros((BEACONS, BEACONS, AXES))
    by_beacon[np.arange(BEACONS), np.arange(BEACONS)] = -unit
    np.testing.assert_allclose(
        jacobian(instance, "beacon_position"), by_beacon.reshape(BEACONS, -1), rtol=1e-14
    )


@BOTH
@pytest.mark.parametrize("known", ["position", "beacon_position"])
def test_derivatives_are_limits_of_differences(
    known: str, fmi: int, geometry: tuple[Array, Array]
) -> None:
    instance = host("range_model", fmi).start()
    step = 1e-5
    place(instance, *geometry)
    expected = jacobian(instance, known)
    value = dict(zip(("position", "beacon_position"), geometry, strict=True))[known]
    for i in range(value.size):
        ends = []
        for sign in (1, -1):
            moved = value.copy()
            moved.flat[i] += sign * step
            instance.set({known: moved})
            ends.append(instance.get("range"))
        np.testing.assert_allclose((ends[0] - ends[1]) / (2 * step), expected[:, i], atol=1e-8)


@BOTH
def test_a_direction_sums_over_all_knowns(fmi: int, geometry: tuple[Array, Array]) -> None:
    """Seeds of several variables in one call, and unknowns in any order."""
    instance = host("range_model", fmi).start()
    place(instance, *geometry)
    whole = np.hstack([jacobian(instance, "position"), jacobian(instance, "beacon_position")])
    seed = np.random.default_rng(5).normal(size=whole.shape[1])
    component = instance.component
    knowns = [r for v in component.of("input") for r in instance.references(v)]
    rows = instance.references(component["range"])
    if fmi == 2:
        result = instance.slave.getDirectionalDerivative(rows[::-1], knowns, seed)[::-1]
    else:
        result = instance.slave.getDirectionalDerivative(rows, knowns, seed, BEACONS)
    np.testing.assert_allclose(result, whole @ seed, rtol=1e-13)


@BOTH
@pytest.mark.parametrize("name", [name for name in COMPONENTS if name != "range_model"])
def test_other_components_have_no_derivatives(name: str, fmi: int) -> None:
    instance = host(name, fmi).start()
    (unknown, *_) = instance.references(instance.component.of("output")[0])
    instance.messages.clear()
    assert refused(instance.slave.getDirectionalDerivative, [unknown], [1], [1.0]) == ERROR
    assert "no output depends directly on an input" in instance.messages[-1]
