"""How sets of parameters are handed to the filter of ranges, and what comes back."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from sblcosim.fmus import stopping
from sblcosim.identification.innovations import (
    BY_RANGE,
    OFFSET,
    PARAMETERS,
    PRIOR,
    Ranges,
    evaluate,
    likelihoods,
)
from seams import Seam

N, BEACONS = 17, 3


def ranges(**prior: float) -> Ranges:
    rng = np.random.default_rng(4)
    usual = dict.fromkeys(PRIOR, 0.0) | {
        "position_std": 2.0, "velocity_std": 1.0, "offset_std": 0.5, "scale_std": 0.02,
        "depth_bias_std": 0.1, "clock_walk": 1e-4,
    }
    place = rng.uniform(-30, 30, (N, 3))
    down = rng.uniform(4, 6, N)
    length = np.linalg.norm(np.column_stack([np.zeros((N, 2)), down]) - place, axis=1)
    return Ranges(
        np.cumsum(rng.uniform(0.3, 1.5, N)), np.arange(N) % BEACONS,
        length + 0.1 * rng.normal(size=N), place, down, rng.uniform(0.01, 0.02, N),
        usual | prior, BEACONS,
    )


def sets(count: int) -> Any:
    rng = np.random.default_rng(5)
    usual = np.array([0.1, 0.1, 2.0, 1e-3, 0.02, 0.3, 0.01])
    assert len(usual) == len(PARAMETERS)
    return usual * np.exp(rng.normal(0, 0.3, (count, len(usual))))


@pytest.mark.parametrize("places", [{}, {"place_std": 0.4}, {"place_down_std": 0.3}])
def test_each_set_comes_back_as_alone_however_many_there_are(places: dict[str, float]) -> None:
    """The processor takes some at a time; of places that are known there are no states."""
    g = ranges(**places)
    states = OFFSET + BEACONS * (4 if places else 1)
    assert (g.states, g.uncertain) == (states, bool(places))
    parameters = sets(19)
    alone = [evaluate(g, parameters[i : i + 1], 2) for i in range(19)]
    for count in (1, 2, 3, 5, 8, 9, 17, 19):
        found = evaluate(g, parameters[:count], 2)
        assert (*found.by_range,) == BY_RANGE
        for of in (
            lambda it: it.likelihood, lambda it: it.mean, lambda it: it.covariance,
            *(lambda it, name=name: it.by_range[name] for name in BY_RANGE),
        ):
            expected = np.concatenate([of(it) for it in alone[:count]])
            np.testing.assert_allclose(of(found), expected, rtol=1e-9, atol=1e-12)
        assert found.mean.shape == (count, states)
        P = found.covariance
        assert P.shape == (count, states, states)
        assert (P.swapaxes(1, 2) == P).all()
        assert (np.linalg.eigvalsh(P) > -1e-12).all()
        np.testing.assert_allclose(found.by_range["density"].sum(axis=1), found.likelihood)
        assert likelihoods(g, parameters[:count], 2).tolist() == found.likelihood.tolist()
    little = evaluate(g, parameters[:3], 2, details=False)
    assert (little.by_range, little.mean.shape) == ({}, (0, states))
    assert little.covariance.shape == (0, states, states)


def test_a_part_of_the_ranges_has_all_of_their_columns() -> None:
    g = ranges()
    rows = np.array([11, 2, 3, 16])
    part = g.part(rows)
    for name in ("time", "beacon", "range", "place", "down", "down_variance"):
        assert getattr(part, name).tolist() == getattr(g, name)[rows].tolist()
    assert part.prior is g.prior
    assert part.beacons == BEACONS
    assert g.part(slice(5)).range.tolist() == g.range[:5].tolist()


def test_it_can_be_stopped_between_sets(seam: Seam) -> None:
    asked: list[int] = []

    def stop() -> None:
        asked.append(1)
        if len(asked) == 2:
            raise KeyboardInterrupt

    seam.instead(stopping.check, stop)
    with pytest.raises(KeyboardInterrupt):
        likelihoods(ranges(), sets(200))
    assert len(asked) == 2
