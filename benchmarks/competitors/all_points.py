"""Mean RMS error over all 128 points of the paper's study, in its three scenarios, by NumPy alone.

The tests compare sblcosim's studies with its output. Nothing here uses sblcosim.

Run by hand: ``python benchmarks/competitors/all_points.py --runs 128``
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np
from numpy_study import BATCH, DEPTH, RADIUS, SPEED, Floats, design, epochs, simulate, target

TURNS, RADII = 2.0, (2.5, 25.0)
"""Scenario 2: an Archimedean spiral, with its turns and its first and last radius in m."""
LENGTH, LEG, BOX = 150.0, 8.0, 25.0
"""Scenario 3: length of the path, mean length of a leg, and half the side of the box, in m."""

Path = Callable[[np.random.Generator, Floats, int], Floats]
"""Maps times in s, (n,), and a number of runs N to true positions, (n, 3, 1) or (n, 3, N)."""


def semicircle(rng: np.random.Generator, t: Floats, N: int) -> Floats:
    return target(t)[:, :, None]


def _spiral_table() -> tuple[Floats, Floats]:
    """Angles and lengths of the spiral up to each of them, on a fine grid."""
    angle = np.linspace(0.0, 2 * np.pi * TURNS, 200_001)
    slope = (RADII[1] - RADII[0]) / angle[-1]
    rate = np.hypot(RADII[0] + slope * angle, slope)
    pieces = (rate[1:] + rate[:-1]) / 2 * np.diff(angle)
    return angle, np.concatenate([[0.0], np.cumsum(pieces)])


def spiral(rng: np.random.Generator, t: Floats, N: int) -> Floats:
    angles, lengths = _spiral_table()
    angle = np.interp(SPEED * t, lengths, angles)
    radius = RADII[0] + (RADII[1] - RADII[0]) * angle / angles[-1]
    depth = np.full_like(angle, DEPTH)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), depth], axis=1)[:, :, None]


def random_path(rng: np.random.Generator, t: Floats, N: int) -> Floats:
    """Straight legs; one that would leave the box is redrawn, length and direction."""
    paths = np.full((len(t), 3, N), DEPTH)
    for run in range(N):
        corners, lengths = [rng.uniform(-BOX, BOX, 2)], [0.0]
        while lengths[-1] < LENGTH:
            leg, angle = rng.exponential(LEG), rng.uniform(0.0, 2 * np.pi)
            end = corners[-1] + leg * np.array([np.cos(angle), np.sin(angle)])
            if np.abs(end).max() <= BOX:
                corners.append(end)
                lengths.append(lengths[-1] + leg)
        for axis in range(2):
            paths[:, axis, run] = np.interp(SPEED * t, lengths, [c[axis] for c in corners])
    return paths


SCENARIOS: dict[int, tuple[float, Path]] = {
    1: (np.pi * RADIUS, semicircle),
    2: (float(_spiral_table()[1][-1]), spiral),
    3: (LENGTH, random_path),
}


def mean_over_all_points(scenario: int, runs: int, seed: int = 1) -> tuple[Floats, Floats]:
    """Mean RMS error in x, y, z and in total in m over all points, and its standard error."""
    length, path = SCENARIOS[scenario]
    rng = np.random.Generator(np.random.SFC64(seed))
    means, errors = [], []
    for sampling_time in (0.1, 1.0):
        factors = design(64 * runs)
        t = sampling_time * np.arange(epochs(sampling_time, length) + 1.0)
        rms = np.concatenate(
            [
                simulate(
                    sampling_time,
                    rng,
                    {k: v[i : i + BATCH] for k, v in factors.items()},
                    path(rng, t, len(factors["baseline"][i : i + BATCH])),
                )
                for i in range(0, 64 * runs, BATCH)
            ],
            axis=1,
        ).reshape(4, 64, runs)
        means.append(rms.mean(axis=(1, 2)))
        errors.append((rms.var(axis=2, ddof=1) / runs).sum(axis=1))
    error = np.sqrt(np.sum(errors, axis=0)) / 128
    return np.mean(means, axis=0), error


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--runs", type=int, default=128, help="at each point; a multiple of 16")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    for scenario in SCENARIOS:
        means, errors = mean_over_all_points(scenario, arguments.runs, arguments.seed)
        for axis, mean, error in zip(("x", "y", "z", "total"), means, errors, strict=True):
            print(f"scenario {scenario}  RMS error {axis:5} {mean:8.4f} m  standard error "
                  f"{error:.4f} m")


if __name__ == "__main__":
    main()
