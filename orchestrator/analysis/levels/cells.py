"""The runs of a table, reduced to its cells: the combinations of levels that have runs.

For each cell, least squares needs the number of runs, their mean and their sum of squares about it.
The time of an analysis therefore depends on the number of combinations, not of runs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...errors import ConfigurationError, nearest, quoted
from ...study.design import Level
from ..common.centred import centred_log, group_means
from ..common.model import Floats
from ..common.options import Options
from ..common.runs import check_columns, transformed, usable
from .medians import median_table

Indices = NDArray[np.intp]
MOST_LEVELS = 100
"""Most levels of a factor; a column with more levels is a covariate."""
NORMAL = 1.4826
"""Standard deviation of normal runs, in units of their median absolute deviation."""
FAR = 5.0
"""Robust standard deviations beyond which a run lies far from the others."""
TAIL_RUNS = 10
"""Fewest runs of a cell whose tails are examined."""
HEAVY = 0.015
"""Share of far runs above which tails are heavy. Of 10 normal runs 0.4 % are far, of 60 none."""
LEAST_FAR = 3
"""Fewest far runs for heavy tails."""


@dataclass(frozen=True, eq=False)
class Cells:
    """Runs by cell.

    Attributes
    ----------
    levels
        Levels of each factor that have runs, in their order.
    index
        Number of each factor's level; shape (cells, factors).
    centre, least
        The constant that is subtracted from all responses, and the size below which deviations are
        rounding noise; see `sblcosim.analysis.common.centred`.
    runs, mean, squares
        Number of runs of each cell, their mean minus the centre, and sum of squares about it.
    values
        With common random numbers, the runs minus the centre; shape (replicates, cells).
    far
        Share of the runs that lie more than `FAR` robust standard deviations from their cell's
        median; NaN if no cell has `TAIL_RUNS`.
    far_log
        The same share for the logarithms, where these exist and are not the response.
    heavy
        Whether the tails are heavy: too many runs lie far from the others.
    skewness
        Skewness of the runs about their cells' means, averaged over the cells; NaN if `far` is.
    dropped
        Number of runs that were left out.
    seen_index, seen, seen_lost
        Cells of all runs of the table, including those left out; the number of their runs, and of
        their lost runs.
    empty
        Levels without any run that counts, as ``factor level``.
    medians
        Medians of the response itself, see `sblcosim.analysis.levels.medians.median_table`.
    """

    levels: Mapping[str, tuple[Level, ...]]
    index: Indices
    centre: float
    least: float
    runs: Floats
    mean: Floats
    squares: Floats
    values: Floats | None
    far: float
    far_log: float
    heavy: bool
    skewness: float
    dropped: int
    seen_index: Indices
    seen: Floats
    seen_lost: Floats
    empty: tuple[str, ...]
    medians: pd.DataFrame

    @property
    def factors(self) -> tuple[str, ...]:
        """Names of the factors."""
        return tuple(self.levels)

    @property
    def sizes(self) -> tuple[int, ...]:
        """Numbers of levels."""
        return tuple(map(len, self.levels.values()))

    def by_level(self, factor: int) -> Floats:
        """With common random numbers, the `values` by level of a factor.

        Shape (replicates, levels, combinations of the others' levels); NaN where there is no cell.
        """
        assert self.values is not None
        others = np.unique(np.delete(self.index, factor, axis=1), axis=0, return_inverse=True)[1]
        shape = len(self.values), self.sizes[factor], others.max() + 1
        found: Floats = np.full(shape, np.nan)
        found[:, self.index[:, factor], others.ravel()] = self.values
        return found


def cells_of(
    table: pd.DataFrame,
    factors: tuple[str, ...],
    response: str,
    levels: Mapping[str, Sequence[Level]],
    lost: str,
    options: Options,
) -> Cells:
    """Reduce a table of runs.

    Parameters
    ----------
    levels
        Order of the levels of some factors. The levels of other factors have the order of the
        table.
    lost
        Column that is not zero for lost runs. Runs without a finite response count as lost, too.

    Raises
    ------
    ConfigurationError
        A column or a level is invalid, or no runs are left.
    """
    numbers, known = _numbered(table, factors, response, levels, options)
    gone = _gone(table, numbers[response], lost)
    everything = gone.groupby([numbers[name] for name in factors], sort=True)
    data = usable(numbers, factors, response, options)
    medians = median_table(data, known, response, options)
    logs = options.transform == "none" and bool((data[response] > 0).all())
    values = data[response].to_numpy(np.float64)
    data, analysed = transformed(data, factors, response, options)
    left, empty = _with_runs(data, known)
    groups = data.groupby(list(factors), sort=True)
    cell = np.asarray(groups.ngroup(), np.intp)
    runs = np.bincount(cell).astype(np.float64)
    y, mean = analysed.off, group_means(cell, analysed.off)
    far, heavy = _far(y, cell, runs)
    renumbered = [np.searchsorted(kept, groups.size().index.get_level_values(i))
                  for i, kept in enumerate(left)]
    return Cells(
        levels={name: tuple(known[name][i] for i in kept)
                for name, kept in zip(factors, left, strict=True)},
        index=np.column_stack(renumbered),
        centre=analysed.centre,
        least=analysed.least,
        runs=runs,
        mean=mean,
        squares=np.bincount(cell, (y - mean[cell]) ** 2).astype(np.float64),
        values=_by_replicate(data, cell, y, options) if options.seeding == "common" else None,
        far=far,
        far_log=_far(centred_log(values).off, cell, runs)[0] if logs else np.nan,
        heavy=heavy,
        skewness=_skewness(y - mean[cell], cell, runs),
        dropped=len(table) - len(data),
        seen_index=_renumbered(everything.size().index.to_frame().to_numpy(), left),
        seen=np.asarray(everything.count(), np.float64),
        seen_lost=np.asarray(everything.sum(), np.float64),
        empty=empty,
        medians=medians,
    )


def _gone(table: pd.DataFrame, response: pd.Series[float], lost: str) -> pd.Series[bool]:
    """Whether each run is lost or has no response."""
    gone = response.isna().to_numpy()
    if lost in table:
        gone = gone | (table[lost].to_numpy(np.float64, na_value=0.0) != 0)
    return pd.Series(gone)


def _numbered(
    table: pd.DataFrame,
    factors: tuple[str, ...],
    response: str,
    levels: Mapping[str, Sequence[Level]],
    options: Options,
) -> tuple[pd.DataFrame, dict[str, tuple[Level, ...]]]:
    """The table with numbers of levels, and NaN for a response that is not finite; the levels."""
    check_columns(table, factors, response, numbers=False)
    for name in levels:
        if name not in factors:
            raise ConfigurationError(
                f"levels: must be for the factors, got {name!r}" + nearest(name, factors)
            )
    if options.replicate in factors:
        raise ConfigurationError(f"replicate: must not be a factor, got {options.replicate!r}")
    columns = {}
    known: dict[str, tuple[Level, ...]] = {}
    for name in factors:
        columns[name], known[name] = _coded(table[name], levels.get(name))
    values = table[response].to_numpy(np.float64, na_value=np.nan)
    numbers = pd.DataFrame(columns | {response: np.where(np.isfinite(values), values, np.nan)})
    if options.replicate in table:
        numbers[options.replicate] = table[options.replicate].to_numpy()
    return numbers, known


def _coded(
    column: pd.Series[float], given: Sequence[Level] | None
) -> tuple[Indices, tuple[Level, ...]]:
    """Number of each run's level, and the levels."""
    name = str(column.name)
    codes, values = pd.factorize(column)
    found: list[Level] = values.tolist()
    wrong = codes < 0
    if wrong.any() or any(isinstance(x, float) and not np.isfinite(x) for x in found):
        raise ConfigurationError(f"{name}: must have a level in every run, got a missing value")
    levels = tuple(found if given is None else given)
    if len(set(levels)) < len(levels):
        twice = next(x for x in levels if levels.count(x) > 1)
        raise ConfigurationError(f"levels: {name}: must be different, got {quoted(twice)} twice")
    for level in found:
        if level not in levels:
            raise ConfigurationError(
                f"{name}: must be one of {', '.join(map(str, levels))}, got {quoted(level)}"
                + nearest(str(level), map(str, levels))
            )
    if len(levels) > MOST_LEVELS:
        raise ConfigurationError(
            f"{name}: must have at most {MOST_LEVELS} levels, got {len(levels)}"
        )
    place = {level: i for i, level in enumerate(levels)}
    return np.array([place[level] for level in found], np.intp)[codes], levels


def _with_runs(
    data: pd.DataFrame, known: Mapping[str, tuple[Level, ...]]
) -> tuple[list[Indices], tuple[str, ...]]:
    """Numbers of the levels with runs, by factor, and the levels without runs."""
    left: list[Indices] = []
    empty: list[str] = []
    for name, levels in known.items():
        kept = np.unique(data[name].to_numpy(np.intp))
        if len(kept) < 2:
            raise ConfigurationError(
                f"{name}: must have two different levels, got {levels[kept[0]]} only"
            )
        left.append(kept)
        empty += [f"{name} {level}" for i, level in enumerate(levels) if i not in kept]
    return left, tuple(empty)


def _renumbered(index: Indices, left: Sequence[Indices]) -> Indices:
    """Numbers among the levels with runs; −1 for other levels."""
    columns = [np.where(np.isin(old, kept), np.searchsorted(kept, old), -1)
               for old, kept in zip(index.T, left, strict=True)]
    return np.column_stack(columns)


def _by_replicate(data: pd.DataFrame, cell: Indices, y: Floats, options: Options) -> Floats:
    """The response of complete replicates; shape (replicates, cells)."""
    replicate = pd.factorize(data[options.replicate])[0]
    values = np.empty((replicate.max() + 1, cell.max() + 1))
    values[replicate, cell] = y
    return values


def _far(y: Floats, cell: Indices, runs: Floats) -> tuple[float, bool]:
    """Share of runs far from the others of their cell, and whether tails are heavy."""
    enough = (runs >= TAIL_RUNS)[cell]
    if not enough.any():
        return np.nan, False
    y, cell = y[enough], cell[enough]
    middle = pd.Series(y).groupby(cell).transform("median").to_numpy()
    off = np.abs(y - middle)
    deviation = pd.Series(off).groupby(cell).transform("median").to_numpy()
    far = off > FAR * NORMAL * deviation
    return float(far.mean()), bool(far.mean() >= HEAVY and far.sum() >= LEAST_FAR)


def _skewness(off: Floats, cell: Indices, runs: Floats) -> float:
    """Skewness of the cells with enough runs, weighted by their runs."""
    second, third = (np.bincount(cell, off**power) / runs for power in (2, 3))
    enough = (runs >= TAIL_RUNS) & (second > 0)
    if not enough.any():
        return np.nan
    return float(np.average(third[enough] / second[enough] ** 1.5, weights=runs[enough]))
