"""Designs with any levels: all combinations or a random subset, and conditions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from ..errors import ConfigurationError
from .design import MOST_POINTS, Design, Factor, Level, check_factors, shown

_DRAWS = 1000
"""Number of draws that miss a level, after which there are too few points."""


def grid(factors: Sequence[Factor], points: int | None = None, seed: int = 0) -> Design:
    """All combinations of all levels, or a random subset, each once.

    Parameters
    ----------
    points
        Number of combinations to draw; None: all.
    seed
        Seed of the draw.

    Raises
    ------
    ConfigurationError
        There are too many points, or too few to include every level.
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
        return _shown(Design(tuple(factors), (), ()), total, points, seed)
    if total > MOST_POINTS:
        raise ConfigurationError(
            f"design: must have at most {MOST_POINTS} points, got {total}; set the number of "
            "points "
            "to draw ([design] points)"
        )
    values = tuple(_combination(factors, index) for index in chosen)
    return Design(tuple(factors), values, (False,) * len(values))


def _shown(design: Design, total: int, points: int, seed: int) -> Design:
    """The first of several draws that includes every level."""
    missing = ""
    for attempt in range(_DRAWS):
        values = tuple(
            _combination(design.factors, index) for index in _drawn(total, points, seed, attempt)
        )
        absent = [
            f"{factor.name} = {shown(level)}"
            for factor, column in zip(design.factors, zip(*values, strict=True), strict=True)
            for level in factor.levels if level not in set(column)
        ]
        if not absent:
            return replace(design, values=values, centre=(False,) * points)
        missing = missing or absent[0]
    raise ConfigurationError(
        f"[design] points: must be enough for every level, got {points} without {missing}; draw "
        "more"
    )


def _drawn(total: int, points: int, seed: int, attempt: int) -> list[int]:
    """Distinct numbers from 0 to below a total, ascending."""
    # Its raw bits are the same in every version of NumPy.
    stream = np.random.Philox(key=seed, counter=[0, 0, 0, attempt])
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
    """Every point of a design in every combination of the conditions, which change slowest."""
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
