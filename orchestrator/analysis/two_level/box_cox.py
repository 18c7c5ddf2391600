"""The power of the response that suits the model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from math import log

import numpy as np
import pandas as pd
from scipy import optimize, stats

from ...errors import ConfigurationError
from ..common.centred import centred_log, group_means
from ..common.model import Floats, coded_points, design_matrix
from .analysis import Factorial


def box_cox(analysis: Factorial, lambdas: Sequence[float] | None = None) -> pd.DataFrame:
    """Profile of the Box–Cox transform of the response, to find the power that suits the model.

    Returns
    -------
    DataFrame
        ``lambda`` (1: the response itself, 0: its logarithm; by default from −2 to 2, including the
        best one and the ends of its interval), ``log_likelihood`` up to a constant, and ``inside``:
        whether λ is in the confidence interval of the likelihood ratio. With common random numbers,
        the replicates' means are part of the model.

    Raises
    ------
    ConfigurationError
        The response is not positive or already transformed, or no degrees of freedom are left.
    """
    y = analysis.table[analysis.response].to_numpy(np.float64)
    if analysis.transform != "none" or (y <= 0).any():
        raise ConfigurationError(
            f"{analysis.response}: must be positive and untransformed for a Box–Cox profile, got "
            + ("a logarithm" if analysis.transform != "none" else f"{y.min():g}")
        )
    points, of_run = coded_points(analysis.table, analysis.levels)
    x = design_matrix(points, analysis.terms)
    terms, blocks = x.shape[1], None
    if analysis.seeding == "common":
        replicate = analysis.replicate_effects
        assert replicate is not None
        blocks, numbers = pd.factorize(analysis.table[replicate.index.name])
        terms += len(numbers) - 1
    if len(y) <= terms:
        raise ConfigurationError(
            f"runs: must be more than the {terms} terms for a Box–Cox profile, got {len(y)}"
        )
    runs = np.bincount(of_run)
    q = np.linalg.qr(np.sqrt(runs)[:, None] * x)[0]
    logs = centred_log(y).off
    logs -= logs.mean()  # divides by the geometric mean, so that no power overflows

    @cache
    def height(power: float) -> float:
        z = np.expm1(power * logs) / power if abs(power) > 1e-12 else logs
        means = group_means(of_run, z)
        within = z - means[of_run]
        if blocks is not None:  # the replicates are complete, so they are orthogonal to the terms
            within -= group_means(blocks, within)[blocks]
        between = np.sqrt(runs) * means
        left = float((within**2).sum() + ((between - q @ (q.T @ between)) ** 2).sum())
        return -len(y) / 2 * log(left / len(y)) if left > 0 else np.inf

    depth = float(stats.chi2.ppf(analysis.confidence, 1)) / 2
    grid = np.linspace(-2, 2, 41) if lambdas is None else np.asarray(lambdas, np.float64)
    value = np.array([height(power) for power in grid])
    if lambdas is None and np.isfinite(value).all():
        grid = np.union1d(grid, _summit(height, grid, value, depth))
        value = np.array([height(power) for power in grid])
    inside = value >= value.max() - depth - 1e-6
    return pd.DataFrame({"lambda": grid, "log_likelihood": value, "inside": inside})


def _summit(
    height: Callable[[float], float], grid: Floats, value: Floats, depth: float
) -> list[float]:
    """Powers at the maximum and, on both sides, at the points that are lower by `depth`."""
    top = int(value.argmax())
    low, high = grid[max(top - 1, 0)], grid[min(top + 1, len(grid) - 1)]
    best = float(optimize.minimize_scalar(
        lambda power: -height(power), bounds=(low, high), method="bounded",
        options={"xatol": 1e-5},
    ).x)
    if value[top] > height(best):
        best = float(grid[top])
    line = height(best) - depth
    ends = [
        float(optimize.brentq(lambda power: height(power) - line, best, end, xtol=1e-7))
        for end in (grid[0], grid[-1]) if best != end and height(end) < line
    ]
    return [best, *ends]
