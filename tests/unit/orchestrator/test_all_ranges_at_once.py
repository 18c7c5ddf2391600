"""Scale and offsets about the most probable track, against a dense problem of its own."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from sblcosim.identification.batch import refined
from sblcosim.identification.innovations import (
    DEPTH_BIAS,
    OFFSET,
    SCALE,
    Ranges,
    evaluate,
)

BEACONS = np.array([[4.0, 3.0, 1.0], [-5.0, 4.0, 2.0], [-3.0, -6.0, 0.5]])
PRIOR = {
    "north": 1.0, "east": 2.0, "velocity_north": 0.3, "velocity_east": -0.1, "position_std": 1.5,
    "velocity_std": 0.4, "clock_std": 0.0, "clock_walk": 3e-3, "scale_std": 0.03,
    "depth_bias_std": 0.3, "offset_std": 0.8, "place_std": 0.0, "place_down_std": 0.0,
    "place_noise_std": 0.07, "place_down_noise_std": 0.2,
}  # fmt: skip
SURVEYED = {"place_std": 0.4, "place_down_std": 0.25}
EXACT_DEPTHS = {"place_std": 0.4, "depth_bias_std": 0.0}
N = 45


def heard(**changes: float) -> tuple[Ranges, Any]:
    """A diver about three beacons close by, some of whose ranges are late; and parameters."""
    rng = np.random.default_rng(6)
    time = np.cumsum(rng.uniform(0.4, 1.6, N))
    beacon = np.arange(N) % 3
    down = 5.0 + 0.5 * np.sin(time / 9)
    track = np.column_stack([1 + 3 * np.sin(time / 12), 2 + 3 * np.cos(time / 8), down])
    far = np.linalg.norm(track - BEACONS[beacon], axis=1)
    ranges = 1.02 * far + np.array([0.5, -0.3, 0.2])[beacon] + rng.normal(0, 0.1, N)
    ranges[::7] += 1.5
    given = Ranges(
        time, beacon, ranges, BEACONS[beacon], down, rng.uniform(0.01, 0.05, N),
        {**PRIOR, **changes}, 3,
    )
    return given, np.array([0.1, 0.15, 1.2, 0.02, 1.0, 1.0, 0.0])


def residuals(g: Ranges, psd: float) -> tuple[Any, Any]:
    """Of states (n, 5) and constants: those of motion and prior, and those of the ranges, which
    are not yet divided by their standard deviation; and that deviation (at those states)."""
    depth, down = (max(g.prior[f"{name}_std"], 1e-6) for name in ("depth_bias", "place_down"))
    stds = [g.prior["scale_std"], depth, *[g.prior["offset_std"]] * 3]
    places = [g.prior["place_std"]] * 2 + [down] if g.uncertain else []
    stds += places * 3

    steps = np.diff(g.time)
    roots = [np.linalg.inv(np.linalg.cholesky(
        psd * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]))) for dt in steps]

    def known(x: Any) -> Any:
        states, c = x[: 5 * N].reshape(N, 5), x[5 * N :]
        north, east, v_north, v_east, clock = states[0]
        found = [
            (north - 1.0) / 1.5, (east - 2.0) / 1.5, (v_north - 0.3) / 0.4, (v_east + 0.1) / 0.4,
            clock / 1e-3, *(c / stds),
        ]  # fmt: skip
        moved = np.diff(states, axis=0)
        moved[:, :2] -= steps[:, None] * states[:-1, 2:4]
        own = [np.einsum("nij,nj->ni", roots, moved[:, axis::2][:, :2]).ravel() for axis in (0, 1)]
        return np.concatenate([found, *own, moved[:, 4] / np.sqrt(g.prior["clock_walk"] * steps)])

    def measured(x: Any) -> tuple[Any, Any]:
        states, c = x[: 5 * N].reshape(N, 5), x[5 * N :]
        beacon = g.place + np.array([0, 0, c[1]])
        if g.uncertain:
            beacon = beacon + c[5:].reshape(3, 3)[g.beacon]
        way = np.column_stack([states[:, :2], g.down]) - beacon
        far = np.linalg.norm(way, axis=1)
        off = (1 + c[0]) * far + states[:, 4] + c[2 + g.beacon] - g.range
        slope = (1 + c[0]) * way / far[:, None]
        errors = np.column_stack([np.full((N, 2), 0.07**2), g.down_variance + 0.2**2])
        return off, np.sum(slope**2 * errors, axis=1)

    return known, measured


def slopes(of: Any, x: Any) -> Any:
    steps = 1e-6 * np.eye(len(x))
    return np.stack([(of(x + s) - of(x - s)) / 2e-6 for s in steps], axis=1)


@pytest.mark.parametrize("changes", [{}, SURVEYED, EXACT_DEPTHS],
                         ids=["as told", "surveyed", "exact depths"])
def test_all_ranges_at_once_are_the_dense_problem(changes: dict[str, float]) -> None:
    g, parameters = heard(**changes)
    begin = evaluate(g, parameters[None])
    found = refined(g, parameters, begin)
    assert found is not None
    known, measured = residuals(g, parameters[3])
    punctual = begin.by_range["punctual"][0]
    assert punctual.min() < 0.4 < 0.9 < punctual.max()
    x = np.zeros(5 * N + g.states - SCALE)
    x[: 5 * N].reshape(N, 5)[:, :2] = np.stack(
        [begin.by_range[axis][0] for axis in ("north", "east")], axis=1
    )
    slope_known = slopes(known, x)  # which does not depend on where
    for _ in range(12):
        off, variance = measured(x)
        weight = np.sqrt(punctual / (variance + parameters[0] ** 2))
        slope = slopes(lambda at: measured(at)[0], x) * weight[:, None]
        A = slope.T @ slope + slope_known.T @ slope_known
        x = x - np.linalg.solve(A, slope.T @ (weight * off) + slope_known.T @ known(x))
    constants = slice(5 * N, None)
    std = np.sqrt(np.diag(np.linalg.inv(A))[constants])
    assert (found.mean[0, SCALE:] - x[constants]) / std == pytest.approx(0, abs=2e-3)
    expected = np.linalg.inv(A)[constants, constants] / np.outer(std, std)
    assert found.covariance[0, SCALE:, SCALE:] / np.outer(std, std) == pytest.approx(
        expected, abs=4e-3
    )
    assert (DEPTH_BIAS, OFFSET) == (SCALE + 1, SCALE + 2)
    assert not found.covariance[0, :SCALE].any()
