"""Designs of any levels: all combinations or a random subset of them, and conditions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from ..errors import ConfigurationError
from .design import MOST_POINTS, Design, Factor, Level, check_factors, shown


def grid(factors: Sequence[Factor], points: int | None = None, seed: int = 0) -> Design:
    """All combinations of all levels, or some of them at random, each once.

    Parameters
    ----------
    points
        How many combinations are drawn; None: all.
    seed
        Of the draw.

    Raises
    ------
    ConfigurationError
        There are too many points, or a level is at none of them.
    """
    check_factors(factors)
    total = math.prod(len(f.levels) for f in factors)
    chosen: Iterable[int] = range(total)
    if points is not None:
        if points > min(total, MOST_POINTS):
            raise ConfigurationError(
                f"[design] points: must be at most {min(total, MOST_POINTS)}, got {points} of "
                f"{total} combinations"
            )
        chosen = _drawn(total, points, seed)
    elif total > MOST_POINTS:
        raise ConfigurationError(
            f"design: must have at most {MOST_POINTS} points, got {total}; say how many of them "
            "are drawn ([design] points)"
        )
    values = tuple(_combination(factors, index) for index in chosen)
    for i, factor in enumerate(factors):
        seen = {row[i] for row in values}
        for level in factor.levels:
            if level not in seen:
                raise ConfigurationError(
                    f"[design] points: must be enough for every level, got {factor.name} = "
                    f"{shown(level)} at none of {points}; draw more, or with another seed"
                )
    return Design(tuple(factors), values, (False,) * len(values))


def _drawn(total: int, points: int, seed: int) -> list[int]:
    """Different numbers from 0 below a total, ascending."""
    stream = np.random.Philox(key=seed)  # its raw bits are the same in every version of NumPy
    if total <= MOST_POINTS:
        order = np.argsort(stream.random_raw(total), kind="stable")
        return sorted(order[:points].tolist())
    found: set[int] = set()
    while len(found) < points:
        found.add(int(stream.random_raw()) * total >> 64)
    return sorted(found)


def _combination(factors: Sequence[Factor], index: int) -> tuple[Level, ...]:
    """A point by its number in standard order, from 0."""
    row = []
    for factor in factors:
        index, level = divmod(index, len(factor.levels))
        row.append(factor.levels[level])
    return tuple(row)


def crossed(design: Design, conditions: Sequence[Factor]) -> Design:
    """Every point of a design in every combination of some conditions, which change slowest."""
    if not conditions:
        return design
    rows = grid(conditions).values
    if len(rows) * len(design.values) > MOST_POINTS:
        raise ConfigurationError(
            f"design: must have at most {MOST_POINTS} points, got {len(design.values)} in "
            f"{len(rows)} conditions"
        )
    check_factors([*design.factors, *conditions])
    return replace(
        design,
        factors=(*design.factors, *conditions),
        values=tuple((*point, *row) for row in rows for point in design.values),
        centre=design.centre * len(rows),
    )
