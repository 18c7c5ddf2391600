"""The linear model of a two-level experiment: its terms, coded levels and design matrix."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...errors import ConfigurationError, nearest
from ...study.design import INTERACTION_SIGN
from ...words.lists import first_of
from .runs import points_of

Floats = NDArray[np.float64]
Term = tuple[int, ...]
"""Indices of a term's factors, in ascending order; the mean is the empty term."""

CURVATURE = "curvature"
TOLERANCE = 1e-6
"""Largest deviation of a level from the stated one, in coded units."""
ALIAS_ORDER = 3
"""Highest order of the interactions among the aliases."""
MAX_LISTED = 8
"""Most aliases that a message lists."""


@dataclass(frozen=True, eq=False)
class TwoLevelModel:
    """The terms and the coded design points.

    Attributes
    ----------
    levels
        Low and high level of each factor, in its own unit.
    terms
        Terms except the mean.
    points
        The distinct design points in ascending order: their levels are −1, +1, or 0 in all factors
        for a centre point; shape (points, factors).
    point_of_run
        Index of each run's point in `points`; shape (runs,).
    reduced
        Whether interactions are left out because the design points cannot tell them apart.
    """

    levels: Mapping[str, tuple[float, float]]
    terms: tuple[Term, ...]
    points: Floats
    point_of_run: NDArray[np.intp]
    reduced: bool

    @property
    def names(self) -> list[str]:
        """Names of the terms."""
        return [term_name(term, tuple(self.levels)) for term in self.terms]

    @cached_property
    def x(self) -> Floats:
        """Design matrix; shape (points, columns)."""
        return design_matrix(self.points, self.terms)

    @property
    def centre(self) -> NDArray[np.bool_]:
        """Whether each point is a centre point."""
        return is_centre(self.points)

    @property
    def aliases(self) -> dict[str, tuple[str, ...]]:
        """Terms that the model lacks and whose columns equal those of its terms, or their negative.
        """
        factors = tuple(self.levels)
        points = self.points[~self.centre]
        if len(points) == 2 ** len(factors):
            return {}
        inside = {_product(points, term).tobytes(): term for term in ((), *self.terms)}
        aliases: dict[str, list[str]] = {}
        for term in terms_up_to(min(ALIAS_ORDER, len(factors)), len(factors)):
            if term in self.terms:
                continue
            column = _product(points, term)
            for sign, values in (("", column), ("−", -column)):
                if values.tobytes() in inside:
                    own = inside[values.tobytes()]
                    name = term_name(own, factors) or "mean"
                    aliases.setdefault(name, []).append(sign + term_name(term, factors))
        return {name: tuple(same) for name, same in aliases.items()}


def estimable(
    data: pd.DataFrame,
    levels: Mapping[str, tuple[float, float]],
    terms: tuple[Term, ...],
    order: int | None,
    reducible: bool,
) -> TwoLevelModel:
    """The model of some runs; main effects alone, if this is allowed and necessary.

    Raises
    ------
    ConfigurationError
        The design cannot estimate the model. The message names the terms that it cannot tell apart.
    """
    factors = tuple(levels)
    points, of_run = coded_points(data, levels)
    main_effects = terms_up_to(1, len(factors))
    x = design_matrix(points, terms)
    reduced = reducible and _rank(x) < x.shape[1]
    model = TwoLevelModel(levels, main_effects if reduced else terms, points, of_run, reduced)
    extra = [CURVATURE] if model.centre.any() else []
    try:
        _check_estimable(model.x, ["mean", *model.names, *extra])
    except ConfigurationError as problem:
        alone = design_matrix(points, main_effects)
        if order is None or _rank(alone) < alone.shape[1]:
            raise
        raise ConfigurationError(
            f"{problem}; main effects alone can be told apart: order 1 (--order 1)"
        ) from None
    return model


def terms_up_to(order: int, factors: int) -> tuple[Term, ...]:
    """Main effects, and interactions of up to `order` factors."""
    return tuple(term for n in range(1, order + 1) for term in combinations(range(factors), n))


def chosen_terms(
    factors: tuple[str, ...], order: int | None, given: Sequence[str | Sequence[str]] | None
) -> tuple[Term, ...]:
    """The given terms, or all terms up to an order."""
    if given is None:
        order = min(2, len(factors)) if order is None else order
        if not 1 <= order <= len(factors):
            raise ConfigurationError(
                f"order: must be from 1 to the number of factors, {len(factors)}, got {order}"
            )
        return terms_up_to(order, len(factors))
    terms: list[Term] = []
    for entry in given:
        if isinstance(entry, str):
            names = [entry] if entry in factors else entry.split(INTERACTION_SIGN)
        else:
            names = list(entry)
        for name in names:
            if name not in factors:
                raise ConfigurationError(
                    f"terms: must consist of the factors, got {name!r}" + nearest(name, factors)
                )
        term = tuple(sorted(factors.index(name) for name in names))
        if not term or len(set(term)) < len(term) or term in terms:
            raise ConfigurationError(f"terms: must be different terms, got {entry!r} twice")
        terms.append(term)
    if not terms:
        raise ConfigurationError("terms: must name at least one term, got none")
    return tuple(terms)


def term_name(term: Term, factors: Sequence[str]) -> str:
    """``A × B``; empty for the mean."""
    return INTERACTION_SIGN.join(factors[i] for i in term)


def checked_levels(
    data: pd.DataFrame,
    factors: tuple[str, ...],
    given: Mapping[str, tuple[float, float]] | None,
) -> dict[str, tuple[float, float]]:
    """Low and high level of each factor: those given, or the extremes of the runs."""
    for name in given or {}:
        if name not in factors:
            raise ConfigurationError(
                f"levels: must be for the factors, got {name!r}" + nearest(name, factors)
            )
    levels = {}
    for name in factors:
        column = data[name].to_numpy(np.float64)
        if not np.isfinite(column).all():
            wrong = column[~np.isfinite(column)][0]
            raise ConfigurationError(f"{name}: must be finite in all runs, got {wrong}")
        low, high = (given or {}).get(name, (column.min(), column.max()))
        if low == high:
            raise ConfigurationError(f"{name}: must have two different levels, got {low:g} only")
        levels[name] = (float(low), float(high))
    return levels


def coded_points(
    data: pd.DataFrame, levels: Mapping[str, tuple[float, float]]
) -> tuple[Floats, NDArray[np.intp]]:
    """The distinct design points in coded levels, in ascending order, and the index of each run's.
    """
    found = points_of(data, tuple(levels))
    rows = np.argsort(found.first)  # by their first runs, so that messages name the first one
    coded = coded_levels(data.iloc[found.first[rows]], levels)
    points, place = np.unique(coded, axis=0, return_inverse=True)
    index = np.empty(len(rows), np.intp)
    index[rows] = place.reshape(-1)
    return points, index[found.of_run]


def coded_levels(data: pd.DataFrame, levels: Mapping[str, tuple[float, float]]) -> Floats:
    """Levels as −1, +1, or 0 in all factors for a centre point; shape (rows, factors)."""
    low, high = np.array(list(levels.values())).T
    exact = (data[list(levels)].to_numpy(np.float64) - (low + high) / 2) / ((high - low) / 2)
    coded: Floats = np.rint(exact)
    wrong = (np.abs(exact - coded) > TOLERANCE) | (np.abs(coded) > 1)
    wrong |= (coded == 0) & ~is_centre(coded)[:, None]
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        name = list(levels)[column]
        raise ConfigurationError(
            f"{name}: must be {low[column]:g}, {high[column]:g} or, with all factors in the "
            f"middle, {(low[column] + high[column]) / 2:g}, got {data[name].iloc[row]:g}"
        )
    return coded + 0.0  # removes negative zeros, which would seem to be different points


def is_centre(coded: Floats) -> NDArray[np.bool_]:
    """Whether each row is a centre point."""
    return np.asarray(np.all(coded == 0, axis=1))


def design_matrix(coded: Floats, terms: tuple[Term, ...]) -> Floats:
    """Columns of the mean, the terms, and the centre points if there are any."""
    columns = [np.ones(len(coded)), *(_product(coded, term) for term in terms)]
    if is_centre(coded).any():
        columns.append(is_centre(coded).astype(np.float64))
    return np.column_stack(columns)


def _product(coded: Floats, term: Term) -> Floats:
    """Column of a term."""
    column: Floats = coded[:, list(term)].prod(axis=1)
    return column


def _rank(x: Floats) -> int:
    """Number of columns that the design points can tell apart."""
    return int(np.linalg.matrix_rank(np.unique(x, axis=0)))


def _check_estimable(x: Floats, columns: Sequence[str]) -> None:
    """Refuse a model with terms that the design cannot tell apart, and name them."""
    distinct = np.unique(x, axis=0)
    if np.linalg.matrix_rank(distinct) == len(columns):
        return
    aliased: list[str] = []
    free: list[int] = []
    for i, name in enumerate(columns):
        basis = distinct[:, free]
        weights = np.linalg.lstsq(basis, distinct[:, i], rcond=None)[0]
        if free and np.allclose(basis @ weights, distinct[:, i], atol=1e-9):
            others = [columns[j] for j, w in zip(free, weights, strict=True) if abs(w) > 1e-9]
            aliased.append(f"{name} aliased with {' and '.join(others)}")
        else:
            free.append(i)
    raise ConfigurationError(
        f"terms: must be told apart by the {len(distinct)} design points, got "
        f"{first_of(aliased, MAX_LISTED, '; ')}"
    )
