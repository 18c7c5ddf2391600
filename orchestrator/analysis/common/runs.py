"""The runs that an analysis can use: checked, complete and transformed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...errors import ConfigurationError, nearest
from .centred import Centred, centred, centred_log
from .options import Options

LARGEST = 1e60
"""Bound of the largest response; its reciprocal is the lower bound. Fourth powers stay finite."""


@dataclass(frozen=True, eq=False)
class Points:
    """The design points of some runs, in ascending order of their levels.

    Attributes
    ----------
    of_run
        Index of each run's point; shape (runs,).
    first
        The first run of each point; shape (points,).
    """

    of_run: NDArray[np.intp]
    first: NDArray[np.intp]

    def levels(self, data: pd.DataFrame, factors: tuple[str, ...]) -> pd.DataFrame:
        """The levels of each point."""
        return data[list(factors)].iloc[self.first].reset_index(drop=True)


def points_of(data: pd.DataFrame, factors: tuple[str, ...]) -> Points:
    """Find the design points of some runs, factor by factor, without comparing rows."""
    of_run, count = np.zeros(len(data), np.intp), 1
    for name in factors:
        code, levels = pd.factorize(data[name], sort=True, use_na_sentinel=False)
        of_run = of_run * len(levels) + code
        if count * len(levels) < len(data):
            count *= len(levels)
        else:  # keeps the numbers below that of the runs, for any number of factors
            of_run, seen = pd.factorize(of_run, sort=True)
            count = len(seen)
    of_run = pd.factorize(of_run, sort=True)[0]
    first = np.empty(of_run.max(initial=-1) + 1, np.intp)
    first[of_run[::-1]] = np.arange(len(data))[::-1]
    return Points(of_run, first)


def check_columns(
    table: pd.DataFrame, factors: tuple[str, ...], response: str, *, numbers: bool = True
) -> None:
    """Refuse factors and a response that are not different columns of numbers.

    Without `numbers`, factors may be of any kind.
    """
    if not factors:
        raise ConfigurationError("factors: must name at least one column, got none")
    if len(set(factors)) < len(factors):
        twice = next(name for name in factors if factors.count(name) > 1)
        raise ConfigurationError(f"factors: must be different columns, got {twice!r} twice")
    for where, name in (*(("factors", name) for name in factors), ("response", response)):
        if name not in table:
            raise ConfigurationError(
                f"{where}: must be columns of the table, got {name!r}"
                + nearest(name, map(str, table.columns))
            )
        if (numbers or name == response) and not pd.api.types.is_numeric_dtype(table[name]):
            kind = table[name].dtype
            raise ConfigurationError(f"{name}: must be a column of numbers, got {kind}")
    if response in factors:
        raise ConfigurationError(f"response: must not be a factor, got {response!r}")


def usable(
    table: pd.DataFrame, factors: tuple[str, ...], response: str, options: Options
) -> pd.DataFrame:
    """Runs with a finite response; with common random numbers, only complete replicates.

    Raises
    ------
    ConfigurationError
        There are none, or their squares overflow or underflow.
    """
    finite = np.isfinite(table[response].to_numpy(np.float64))
    own = (c for c in (options.replicate, options.run_order) if c in table)
    data = table[[*factors, response, *own]]
    data = data if finite.all() else data[finite]
    data = data.reset_index(drop=True).astype({response: np.float64})
    if data.empty:
        raise ConfigurationError(f"{response}: must be finite in some runs, got none")
    largest = float(data[response].abs().max())
    if options.transform != "log" and not 1 / LARGEST <= largest <= LARGEST and largest:
        raise ConfigurationError(
            f"{response}: must be from {1 / LARGEST:g} to {LARGEST:g} in the run farthest from 0, "
            f"got {largest:g}; use another unit, or the logarithm"
        )
    return _complete(data, factors, options.replicate) if options.seeding == "common" else data


def transformed(
    data: pd.DataFrame, factors: tuple[str, ...], response: str, options: Options
) -> tuple[pd.DataFrame, Centred]:
    """The runs with the analysed response, and this response as deviations from its centre."""
    y = data[response].to_numpy(np.float64)
    if options.transform == "log":
        if (y <= 0).any():
            raise ConfigurationError(
                f"{response}: must be positive for its logarithm, got {y.min():g}"
            )
        found, data = centred_log(y), data.assign(**{response: np.log(y)})
    else:
        found = centred(y)
        if options.transform == "spread":
            data = data.assign(**{response: found.off})
            _check_spread(data, factors, response, 2 if options.seeding == "independent" else 3)
            spread = _spread if options.seeding == "independent" else _jackknifed_spread
            data = spread(data, factors, response)
            found = centred(data[response].to_numpy(np.float64))
    if not found.off.any():
        value = data[response].iloc[0]
        raise ConfigurationError(f"{response}: must vary over the runs, got {value:g} in all")
    return data, found


def _complete(data: pd.DataFrame, factors: tuple[str, ...], replicate: str) -> pd.DataFrame:
    """The replicates that have every design point once."""
    if replicate not in data:
        raise ConfigurationError(
            f"{replicate}: must be a column of the table for common random numbers, got none"
        )
    points = points_of(data, factors)
    number, known = pd.factorize(data[replicate], use_na_sentinel=False)
    again = pd.Index(number * len(points.first) + points.of_run).duplicated()
    if again.any():
        row = data[again].iloc[0]
        raise ConfigurationError(
            f"{replicate}: must have each design point once for common random numbers, got one "
            f"twice in {row[replicate]:g}"
        )
    whole = (np.bincount(number) == len(points.first)) & pd.notna(known)
    if whole.sum() < 2:
        raise ConfigurationError(
            f"{replicate}: must be at least two complete replicates for common random numbers, "
            f"got {whole.sum()}"
        )
    return data if whole.all() else data[whole[number]].reset_index(drop=True)


def _check_spread(
    data: pd.DataFrame, factors: tuple[str, ...], response: str, need: int
) -> None:
    """Refuse points with too few runs, or without any scatter."""
    points = points_of(data, factors)
    groups = data[response].groupby(points.of_run)
    size, std = groups.size(), groups.std()
    if (size < need).any():
        raise ConfigurationError(
            f"{response}: must have at least {need} runs at each point for its spread, got "
            f"{size.min()}"
        )
    if (std <= 0).any():
        point = points.levels(data, factors).iloc[std.argmin()]
        raise ConfigurationError(
            f"{response}: must vary over the runs of each point for its spread, got none at "
            + ", ".join(f"{name} {value:g}" for name, value in point.items())
        )


def _spread(data: pd.DataFrame, factors: tuple[str, ...], response: str) -> pd.DataFrame:
    """ln s of each point."""
    points = points_of(data, factors)
    std = data[response].groupby(points.of_run).std()
    return points.levels(data, factors).assign(**{response: np.log(std)})


def _jackknifed_spread(
    data: pd.DataFrame, factors: tuple[str, ...], response: str
) -> pd.DataFrame:
    """Jackknife values of ln s over the replicates of each point."""

    def jackknife(values: pd.Series[float]) -> pd.Series[float]:
        y = values.to_numpy(np.float64)
        n = len(y)
        around = y - y.mean()
        squares = (around**2).sum() - around**2 * n / (n - 1)  # other runs about their own mean
        with np.errstate(divide="ignore"):
            pseudo = -(n - 1) / 2 * np.log(np.maximum(squares, 0) / (n - 2))
        # Only their scatter matters, so their mean is set to ln s itself.
        return pd.Series(pseudo - pseudo.mean() + np.log(y.std(ddof=1)), index=values.index)

    groups = data[response].groupby(points_of(data, factors).of_run)
    spread = data.assign(**{response: groups.transform(jackknife)})
    if not np.isfinite(spread[response]).all():
        raise ConfigurationError(
            f"{response}: must vary over any two runs of each point for its spread, got equal ones"
        )
    return spread
