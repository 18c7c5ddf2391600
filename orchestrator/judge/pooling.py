"""From runs to percentiles of cells: neighbours are pooled, and whole runs are drawn again.

What is pooled is not the error, which changes from cell to cell, but the error as a multiple of
what is possible in its own cell. A run in a cell at (i, j) cells' distance has the weight
exp(−(i² + j²)/2), up to `REACH` each way. Its errors are one draw, however many estimates it has,
so the standard error is that over draws of whole runs: by the Poisson bootstrap (J. A. Hanley, B.
MacGibbon, Creating non-parametric bootstrap samples using Poisson frequencies, Comput. Methods
Programs Biomed. 83, 2006, 57-62) each counts a Poisson number of times, of mean 1.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus import stopping

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

SHARE = 0.95
"""Of the errors, that a percentile is not exceeded by."""
PERCENTAGES = (*range(5, 80, 10), *range(81, 100, 2))
"""Of the order statistics that stand for a run's errors: the middles of eight tenths, and of ten
parts of the largest fifth, where the percentile is if runs differ."""
WEIGHTS = np.array([5.0] * 8 + [1.0] * 10)
"""What each of them stands for, in fiftieths."""
REACH = 2
"""Cells each way that are pooled with a cell."""
DRAWS = 100
"""Of the bootstrap; the standard error is good to 7 %."""
_BIN = 0.01
"""Width of a bin of the logarithm of an error; within it, errors are taken to be uniform."""
_AROUND = 1.0
"""How far beyond the cells' percentiles draws are counted in bins [logarithm]."""
_MOST_BINS = 2000
_NOTHING = -30.0
"""Logarithm of an error that is none."""


class RunsInCells(Protocol):
    """Some runs, each in a cell."""

    @property
    def cell(self) -> Integers:
        """Index of each run's cell; (runs,)."""

    @property
    def lengths(self) -> Floats:
        """Order statistics of the lengths of its errors [m], `PERCENTAGES`, infinite without an
        estimate; (runs, len(PERCENTAGES))."""


@dataclass(frozen=True, eq=False)
class Pooled:
    """Of each cell; shape (cells,).

    Attributes
    ----------
    percentile, std_error
        [m]; infinite where more than 5 % of the weight is of runs without an estimate.
    """

    percentile: Floats
    std_error: Floats


def pooled(
    sample: RunsInCells,
    possible: Floats,
    shape: tuple[int, int],
    seed: int,
    workers: int | None = None,
    reach: int = REACH,
) -> Pooled:
    """The percentile of the errors in each cell, and its standard error.

    Parameters
    ----------
    possible
        What is possible in each cell [m]; where it is not more than 0, errors are pooled as they
        are.
    shape
        Rows and columns of the cells.
    seed
        Of the bootstrap.
    workers
        Threads; the result does not depend on them.
    reach
        Cells each way that are pooled with a cell; 0: each stands for itself.
    """
    scale = np.where(np.isfinite(possible) & (possible > 0), possible, 1.0)
    with np.errstate(divide="ignore"):
        relative = np.log(sample.lengths / scale[sample.cell][:, None])
    known = relative[np.isfinite(relative)]
    span = (known.min(), known.max()) if len(known) else (_NOTHING, _NOTHING)
    once = np.ones(len(sample.cell))
    middle = _percentile(_counted(sample.cell, relative, span, shape), once, reach)
    found = middle[np.isfinite(middle)]
    if len(found):
        span = (max(span[0], found.min() - _AROUND), min(span[1], found.max() + _AROUND))
    counted = _counted(sample.cell, relative, span, shape)

    def drawn(number: int) -> Floats:
        stopping.check()
        draw = np.random.Generator(np.random.Philox(key=[seed, number]))
        times = draw.poisson(1.0, len(sample.cell)).astype(np.float64)
        return np.exp(_percentile(counted, times, reach))

    with ThreadPoolExecutor(workers or os.cpu_count() or 1) as pool:
        futures = [pool.submit(drawn, number) for number in range(DRAWS)]
        draws = np.stack([*stopping.results(futures)])
    with np.errstate(invalid="ignore"):
        spread = np.where(np.isfinite(draws).all(axis=0), draws.std(axis=0, ddof=1), np.inf)
    return Pooled(np.exp(middle) * scale, spread * scale)


def effective(shape: tuple[int, int]) -> float:
    """Number of runs that count in the cell with fewest, for one run in each: (Σw)²/Σw²."""
    count = 1.0
    for size in shape:
        weights = np.exp(-0.5 * np.arange(min(size, REACH + 1)) ** 2)
        count *= float(weights.sum() ** 2 / (weights**2).sum())
    return count


def neighbours(values: Floats, reach: int = REACH) -> Floats:
    """Sums over the neighbours of each cell, with their weights; (rows, columns, …)."""
    weights = np.exp(-0.5 * np.arange(-reach, reach + 1) ** 2)
    for axis in (0, 1):
        moved = np.moveaxis(values, axis, 0)
        total = np.zeros_like(moved)
        for offset, weight in zip(range(-reach, reach + 1), weights.tolist(), strict=True):
            here, there = slice(max(-offset, 0), None), slice(max(offset, 0), None)
            length = max(len(moved) - abs(offset), 0)
            total[here][:length] += weight * moved[there][:length]
        values = np.moveaxis(total, 0, axis)
    return values


@dataclass(frozen=True, eq=False)
class _Counted:
    """Errors in bins: the bin of each of a run's, counted over all cells; bounds; sizes."""

    index: Integers
    edges: Floats
    cells: tuple[int, int]


def _counted(
    cell: Integers, relative: Floats, span: tuple[float, float], shape: tuple[int, int]
) -> _Counted:
    """Bins of equal width over a span, with one below it, one above it, and one for infinity."""
    low, high = span
    inner = int(min(max(np.ceil((high - low) / _BIN), 1), _MOST_BINS))
    edges = np.linspace(low, max(high, low + 1e-9), inner + 1)
    with np.errstate(invalid="ignore"):
        place = np.ceil((relative - low) / (edges[1] - edges[0]))
    bins = np.where(np.isposinf(relative), inner + 2, np.clip(place, 0, inner + 1))
    return _Counted((cell[:, None] * (inner + 3) + bins).astype(np.int64), edges, shape)


def _percentile(counted: _Counted, times: Floats, reach: int) -> Floats:
    """Logarithm of the percentile in each cell, each run counted as `times` says; (cells,)."""
    size = len(counted.edges) + 2
    rows, columns = counted.cells
    each = (times[:, None] * WEIGHTS).ravel()
    binned = np.bincount(counted.index.ravel(), each, rows * columns * size).astype(np.float64)
    counts = neighbours(binned.reshape(rows, columns, size), reach).reshape(-1, size)
    below = np.cumsum(counts, axis=1)
    wanted = SHARE * below[:, -1]
    bins = np.fmin((below < wanted[:, None]).sum(axis=1), size - 1)
    every = np.arange(len(bins))
    inside = counts[every, bins]
    part = 1 - (below[every, bins] - wanted) / np.where(inside > 0, inside, 1.0)
    width = counted.edges[1] - counted.edges[0]
    logarithm = counted.edges[0] + (bins - 1 + np.clip(part, 0, 1)) * width
    logarithm = np.where(bins == 0, counted.edges[0], logarithm)
    beyond = np.where(bins == size - 2, counted.edges[-1], logarithm)
    result: Floats = np.where((bins == size - 1) | (below[:, -1] == 0), np.inf, beyond)
    return result
