"""The range model: distances from the beacons, and their Jacobian."""

from __future__ import annotations

import numpy as np
from sblcosim.models.loading import load
from stepper import Stepper


def test_ranges_are_distances() -> None:
    beacons = np.random.default_rng(1).normal(0, 3, (4, 3))
    model = Stepper("range_model")
    model.set(position=[1, 2, 3], beacon_position=beacons)
    y = model.step(0, 10**8)
    np.testing.assert_allclose(y["range"], np.linalg.norm(beacons - [1, 2, 3], axis=1), rtol=1e-15)


def test_rows_of_the_jacobian_are_unit_vectors_from_the_beacons() -> None:
    model = load("range_model")
    beacons = np.random.default_rng(1).normal(0, 3, (4, 3))
    position = np.array([1.0, 2.0, 3.0])
    jacobian = model.variants[0].jacobian
    assert jacobian is not None
    u = np.concatenate([position, beacons.ravel()])
    J = np.array(jacobian([], u, [], 0.0)).reshape(4, 15)
    direction = (position - beacons) / np.linalg.norm(position - beacons, axis=1)[:, None]
    np.testing.assert_allclose(J[:, :3], direction, atol=1e-15)
    for i in range(4):
        np.testing.assert_allclose(J[i, 3 * (i + 1):3 * (i + 2)], -direction[i], atol=1e-15)
    assert model.feedthrough == {("range", "position"), ("range", "beacon_position")}
