"""The runs that an analysis can use: checked, complete and transformed."""

from __future__ import annotations

import numpy as np
import pandas as pd

from ..errors import ConfigurationError, nearest
from .options import Options


def check_columns(
    table: pd.DataFrame, factors: tuple[str, ...], response: str, *, names: bool = False
) -> None:
    """Refuse factors and a response that are not different columns of numbers.

    Parameters
    ----------
    names
        Levels of factors may be text, too.
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
        text = names and where == "factors"
        if not (text or pd.api.types.is_numeric_dtype(table[name])):
            kind = table[name].dtype
            raise ConfigurationError(f"{name}: must be a column of numbers, got {kind}")
    if response in factors:
        raise ConfigurationError(f"response: must not be a factor, got {response!r}")


def usable(
    table: pd.DataFrame, factors: tuple[str, ...], response: str, options: Options
) -> pd.DataFrame:
    """Runs with a finite response; with common random numbers those of complete replicates."""
    finite = np.isfinite(table[response].to_numpy(np.float64))
    own = (c for c in (options.replicate, options.run_order) if c in table)
    data = table.loc[finite, [*factors, response, *own]].reset_index(drop=True)
    data = data.astype({response: np.float64})
    if data.empty:
        raise ConfigurationError(f"{response}: must be finite in some runs, got none")
    return _complete(data, factors, options.replicate) if options.seeding == "common" else data


def transformed(
    data: pd.DataFrame, factors: tuple[str, ...], response: str, options: Options
) -> pd.DataFrame:
    """The runs with the response that is analysed."""
    if options.transform == "log":
        if (data[response] <= 0).any():
            raise ConfigurationError(
                f"{response}: must be positive for its logarithm, got {data[response].min():g}"
            )
        data = data.assign(**{response: np.log(data[response])})
    elif options.transform == "spread":
        _check_spread(data, factors, response, 2 if options.seeding == "independent" else 3)
        spread = _spread if options.seeding == "independent" else _jackknifed_spread
        data = spread(data, factors, response)
    y = data[response].to_numpy(np.float64)
    if np.ptp(y) == 0:
        raise ConfigurationError(f"{response}: must vary over the runs, got {y[0]:g} in all")
    return data


def _complete(data: pd.DataFrame, factors: tuple[str, ...], replicate: str) -> pd.DataFrame:
    """The replicates that have every design point, each once."""
    if replicate not in data:
        raise ConfigurationError(
            f"{replicate}: must be a column of the table for common random numbers, got none"
        )
    keys = [replicate, *factors]
    if data.duplicated(keys).any():
        row = data[data.duplicated(keys)].iloc[0]
        raise ConfigurationError(
            f"{replicate}: must have each design point once for common random numbers, got one "
            f"twice in {row[replicate]:g}"
        )
    count = len(data[list(factors)].drop_duplicates())
    full = data.groupby(replicate)[replicate].transform("size") == count
    if data.loc[full, replicate].nunique() < 2:
        raise ConfigurationError(
            f"{replicate}: must be at least two complete replicates for common random numbers, "
            f"got {data.loc[full, replicate].nunique()}"
        )
    return data[full].reset_index(drop=True)


def _check_spread(
    data: pd.DataFrame, factors: tuple[str, ...], response: str, need: int
) -> None:
    """Refuse points with too few runs, or without any scatter."""
    groups = data.groupby(list(factors), sort=True)[response]
    if (groups.size() < need).any():
        raise ConfigurationError(
            f"{response}: must have {need} runs or more at each point for its spread, got "
            f"{groups.size().min()}"
        )
    if (groups.std() <= 0).any():
        point = groups.std().reset_index().sort_values(response).iloc[0][list(factors)]
        raise ConfigurationError(
            f"{response}: must vary over the runs of each point for its spread, got none at "
            + ", ".join(f"{name} {value:g}" for name, value in point.items())
        )


def _spread(data: pd.DataFrame, factors: tuple[str, ...], response: str) -> pd.DataFrame:
    """ln s of each point."""
    points = data.groupby(list(factors), sort=True)[response].std().reset_index()
    return points.assign(**{response: np.log(points[response])})


def _jackknifed_spread(
    data: pd.DataFrame, factors: tuple[str, ...], response: str
) -> pd.DataFrame:
    """Jackknife values of ln s over the replicates of each point."""

    def jackknife(values: pd.Series[float]) -> pd.Series[float]:
        y = values.to_numpy(np.float64)
        n = len(y)
        around = y - y.mean()
        squares = (around**2).sum() - around**2 * n / (n - 1)  # of the others, about their mean
        with np.errstate(divide="ignore"):
            pseudo = -(n - 1) / 2 * np.log(np.maximum(squares, 0) / (n - 2))
        # Only their scatter matters: their mean is set to ln s itself.
        return pd.Series(pseudo - pseudo.mean() + np.log(y.std(ddof=1)), index=values.index)

    groups = data.groupby(list(factors), sort=True)[response]
    spread = data.assign(**{response: groups.transform(jackknife)})
    if not np.isfinite(spread[response]).all():
        raise ConfigurationError(
            f"{response}: must vary over any two runs of each point for its spread, got equal ones"
        )
    return spread
