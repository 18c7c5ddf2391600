"""Costs of the levels of a factor, as users write them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf, isclose
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...errors import ConfigurationError, instance, nearest, quoted, shortened
from ...study.design import Level, shown

MOST_COST = 1e15
"""Largest cost of a level."""
LEVEL_TOLERANCE = 1e-9
"""Largest relative deviation of a level from the level that has the cost."""


def of_levels(at: str, given: Any, levels: Sequence[Level]) -> dict[Level, float]:
    """Cost of each level.

    Parameters
    ----------
    at
        Place of the costs, for messages.
    given
        An array in the order of the levels, or a table by their names.

    Raises
    ------
    ConfigurationError
        A cost is missing, negative or not a finite number.
    """
    if isinstance(given, Mapping):
        costs = _by_name(at, given, levels)
    elif isinstance(given, Sequence) and not isinstance(given, str):
        if len(given) != len(levels):
            raise ConfigurationError(
                f"{at}: must have a cost for each of the levels {', '.join(map(shown, levels))}, "
                f"got {len(given)}"
            )
        costs = dict(zip(levels, given, strict=True))
    else:
        raise ConfigurationError(
            f"{at}: must be an array of costs, or a table by level, got "
            f"{shortened(instance(given))}"
        )
    for level, cost in costs.items():
        number = isinstance(cost, int | float) and not isinstance(cost, bool)
        if not number or not 0 <= cost < inf:
            raise ConfigurationError(
                f"{at}: must be numbers, finite and not negative, got {shortened(instance(cost))} "
                f"for {shown(level)}"
            )
        if cost > MOST_COST:
            raise ConfigurationError(
                f"{at}: must be numbers of at most {MOST_COST:g}, so that their sums are exact, "
                f"got {shortened(instance(cost))} for {shown(level)}"
            )
    return {level: float(cost) for level, cost in costs.items()}


def _by_name(at: str, given: Mapping[str, Any], levels: Sequence[Level]) -> dict[Level, Any]:
    names = {shown(level): level for level in levels}
    written = [_as_shown(str(name), names) for name in given]
    given = dict(zip(written, given.values(), strict=True))
    for name in given:
        if written.count(name) > 1:
            raise ConfigurationError(
                f"{at}: must have one cost for each level, got {written.count(name)} for {name}"
            )
        if name not in names:
            raise ConfigurationError(
                f"{at}: must be for the levels {', '.join(names)}, got {quoted(str(name))}"
                f"{nearest(str(name), names)}"
            )
    for name in names:
        if name not in given:
            raise ConfigurationError(
                f"{at}: must have one cost for each level, got none for {name}"
            )
    return {names[name]: cost for name, cost in given.items()}


def _as_shown(name: str, names: Mapping[str, Level]) -> str:
    """The study's name of a level that is written differently, such as 1.0 for 1."""
    try:
        number = shown(float(name))
    except ValueError:
        return name
    return number if name not in names and number in names else name


def of_column(levels: pd.Series[Any], costs: Mapping[Level, float]) -> NDArray[np.float64]:
    """Cost of each level in a column of a table.

    Raises
    ------
    ConfigurationError
        A level has no cost.
    """
    prices = np.array([float(price) for price in costs.values()])
    if not (np.isfinite(prices) & (prices >= 0)).all():
        raise ConfigurationError(
            f"costs.{levels.name}: must be finite and not negative, got {list(costs.values())}"
        )
    return np.array([_price(str(levels.name), level, costs) for level in levels])


def _price(name: str, level: Level, costs: Mapping[Level, float]) -> float:
    """Cost of a level: by its name, or by a number that is nearly the same."""
    for known, price in costs.items():
        if isinstance(known, str) or isinstance(level, str):
            same = known == level
        else:
            same = isclose(known, level, rel_tol=LEVEL_TOLERANCE)
        if same:
            return float(price)
    raise ConfigurationError(
        f"costs.{name}: must have a cost for every level of the design, got none for "
        f"{shown(level)}"
    )
