"""The second moments of a place whose bearing is uncertain, about its crest."""

from __future__ import annotations

import numpy as np
import pytest
from sblcosim.estimation.outcome import bent_by


@pytest.mark.parametrize("std", [0.05, 0.4, 1.0])
def test_abent_by_posterior_has_its_moments(std: float) -> None:
    y, angles = np.array([9.0, -12.0]), std * np.random.default_rng(1).standard_normal(400_000)
    J = np.array([[0, -1], [1, 0]])
    turned = np.cos(angles)[:, None] * y + np.sin(angles)[:, None] * (J @ y)
    away = turned - y
    tangent = J @ y
    P = std**2 * np.outer(tangent, tangent)
    expected = away.T @ away / len(away)
    found = P + bent_by(y[None], P[None])[0]
    np.testing.assert_allclose(found, expected, atol=0.02 * np.trace(expected))
    e = y / np.linalg.norm(y)
    assert e @ found @ e == pytest.approx(e @ expected @ e, rel=0.03)


def test_near_the_platform_there_is_no_arc() -> None:
    assert (bent_by(np.array([[0.5, 0.5]]), np.eye(2)[None]) == 0).all()


def test_a_distance_as_uncertain_as_the_bearing_is_no_banana() -> None:
    np.testing.assert_allclose(bent_by(np.array([[10.0, 0.0]]), np.eye(2)[None]), 0, atol=1e-12)
