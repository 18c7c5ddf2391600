"""The general linear model of cells: its terms, sums of squares, and means with their errors.

Sum contrasts code the factors, so a term's coefficients add up to zero over each of its factors. A
marginal mean is the mean of the model over all combinations of levels. Each combination counts
once, for any number of runs (Searle, Speed and Milliken, Am. Statistician 34, 1980, 216–221).

The sum of squares of a term is the amount by which it reduces the residual of a smaller model. For
*type II*, this model has all terms that do not contain the term; for *type III*, all other terms
(Fox, Applied Regression Analysis and Generalized Linear Models, 3rd edition, section 8.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from ...errors import ConfigurationError
from ...words.lists import first_of
from ..common.model import MAX_LISTED, Floats, Term, term_name, terms_up_to
from .cells import Cells, Indices

SumsType = Literal[2, 3]
RANK = 1e-9
"""Eigenvalues below this fraction of the largest are zero."""
MOST_NUMBERS = 20_000_000
"""Largest design matrix."""


@dataclass(frozen=True, eq=False)
class LinearModel:
    """The terms and the cells.

    Attributes
    ----------
    terms
        Terms except the mean.
    left_out
        Terms that the cells cannot estimate. If there are any, the model has main effects alone.
    """

    cells: Cells
    terms: tuple[Term, ...]
    left_out: tuple[Term, ...] = ()

    @cached_property
    def x(self) -> Floats:
        """Design matrix; shape (cells, columns)."""
        return columns_of(((), *self.terms), self.cells.index, self.cells.sizes)

    @cached_property
    def owner(self) -> Indices:
        """Number of each column's term; 0 is the mean."""
        widths = [width(term, self.cells.sizes) for term in ((), *self.terms)]
        return np.repeat(np.arange(len(widths)), widths)

    @cached_property
    def fitted(self) -> Floats:
        """The model's value of each cell, minus the centre."""
        root = np.sqrt(self.cells.runs)
        q = np.linalg.qr(root[:, None] * self.x)[0]
        value: Floats = (q @ (q.T @ (root * self.cells.mean))) / root
        return value

    @property
    def pure(self) -> tuple[float, int]:
        """Sum of squares of the runs about their cells' means, and its degrees of freedom."""
        return float(self.cells.squares.sum()), int((self.cells.runs - 1).sum())

    @property
    def lack(self) -> tuple[float, int]:
        """Sum of squares of the cells' means about the model, and its degrees of freedom."""
        off = self.cells.mean - self.fitted
        spare = len(self.x) - self.x.shape[1]
        return float((self.cells.runs * off**2).sum()) if spare else 0.0, spare

    def basis(self, term: int, typ: int) -> Floats:
        """Orthonormal contrasts of a term, for the cells' means; shape (cells, df).

        The sum of squares of the term is that of these contrasts of √runs × mean.
        """
        own = self.owner == term + 1
        wanted = set(self.terms[term])
        others = ~own
        if typ == 2:
            higher = [i + 1 for i, other in enumerate(self.terms) if wanted < set(other)]
            others &= ~np.isin(self.owner, higher)
        x = np.sqrt(self.cells.runs)[:, None] * self.x
        q = np.linalg.qr(x[:, others])[0]
        contrasts: Floats = np.linalg.qr(x[:, own] - q @ (q.T @ x[:, own]))[0]
        return contrasts

    def marginal(self, term: Term) -> Floats:
        """Weights of the cells' means in the means at a term's levels; shape (levels, cells).

        Rows are in the order of the levels; the levels of the last factor change fastest. If the
        interaction of two factors is not in the model, each of their combinations with runs gets a
        mean of its own, besides the main effects of the other factors. Combinations that cannot be
        estimated are NaN.
        """
        sizes = tuple(self.cells.sizes[i] for i in term)
        grid = np.indices(sizes).reshape(len(term), -1).T
        x = self.x
        if len(term) == 1 or term in self.terms:
            target = np.zeros((len(grid), x.shape[1]))
            target[:, self.owner == 0] = 1
            for i, other in enumerate(self.terms, 1):
                if set(other) <= set(term):
                    own = tuple(term.index(factor) for factor in other)
                    target[:, self.owner == i] = columns_of((own,), grid, sizes)
        else:
            number = np.ravel_multi_index(tuple(self.cells.index[:, term].T), sizes)
            rest = terms_up_to(1, len(self.cells.sizes))
            main = tuple(t for t in rest if not set(t) <= set(term))
            x = np.hstack([np.eye(len(grid))[number],
                           columns_of(main, self.cells.index, self.cells.sizes)])
            target = np.eye(len(grid), x.shape[1])
        weighted = self.cells.runs[:, None] * x
        gram = x.T @ weighted
        solved = target @ np.linalg.pinv(gram, rcond=RANK, hermitian=True)
        weights: Floats = solved @ weighted.T
        weights[~np.isclose(solved @ gram, target, atol=1e-6).all(axis=1)] = np.nan
        return weights


def fitted_model(cells: Cells, order: int) -> LinearModel:
    """The model with interactions of up to `order` factors; main effects alone if necessary.

    Raises
    ------
    ConfigurationError
        Even main effects cannot be told apart, or no run is left to estimate an error from.
    """
    count = len(cells.sizes)
    if not 1 <= order <= max(2, count):
        raise ConfigurationError(
            f"order: must be from 1 to the number of factors, {count}, got {order}"
        )
    model = LinearModel(cells, terms_up_to(min(order, count), count))
    _check_size(model)
    missing = inestimable(model)
    if missing:
        interactions = tuple(term for term in missing if len(term) > 1)
        model = LinearModel(cells, terms_up_to(1, count), interactions)
        alone = inestimable(model)
        if alone:
            names = [term_name(term, cells.factors) for term in alone]
            raise ConfigurationError(
                f"factors: must be told apart by the {len(cells.runs)} combinations of levels with "
                f"runs, got {first_of(names, MAX_LISTED)} confounded with other factors"
            )
    _check_error(model)
    return model


def columns_of(terms: Sequence[Term], index: Indices, sizes: Sequence[int]) -> Floats:
    """Columns of some terms, coded by sum contrasts; the mean is the empty term."""
    blocks = []
    for term in terms:
        block = np.ones((len(index), 1))
        for factor in term:
            contrasts = np.vstack([np.eye(sizes[factor] - 1), -np.ones(sizes[factor] - 1)])
            own = contrasts[index[:, factor]]
            block = (block[:, :, None] * own[:, None, :]).reshape(len(index), -1)
        blocks.append(block)
    return np.hstack([np.empty((len(index), 0)), *blocks])


def width(term: Term, sizes: Sequence[int]) -> int:
    """Degrees of freedom of a term."""
    return int(np.prod([sizes[factor] - 1 for factor in term], dtype=np.int64))


def inestimable(model: LinearModel) -> tuple[Term, ...]:
    """Terms that cannot be told apart, in part, from the other terms."""
    x, owner = model.x, model.owner
    if _rank(x) == x.shape[1]:
        return ()
    whole = _rank(x)
    return tuple(
        term for i, term in enumerate(model.terms, 1)
        if whole - _rank(x[:, owner != i]) < (owner == i).sum()
    )


def _rank(x: Floats) -> int:
    return int(np.linalg.matrix_rank(x.T @ x, hermitian=True, rtol=RANK))


def _check_size(model: LinearModel) -> None:
    """Refuse a model that is too large."""
    sizes = model.cells.sizes
    columns = 1 + sum(width(term, sizes) for term in model.terms)
    if columns * len(model.cells.runs) > MOST_NUMBERS:
        raise ConfigurationError(
            f"order: must make a design matrix of at most {MOST_NUMBERS:,} numbers, got {columns:,}"
            f" columns for {len(model.cells.runs):,} combinations of levels; use a lower order"
        )


def _check_error(model: LinearModel) -> None:
    """Refuse runs from which no error can be estimated."""
    cells, columns = model.cells, model.x.shape[1]
    runs = int(cells.runs.sum())
    if runs <= columns:
        lower = 1 + sum(width(term, cells.sizes) for term in terms_up_to(1, len(cells.sizes)))
        hint = "; order 1 needs fewer (--order 1)" if lower < runs else ""
        raise ConfigurationError(
            f"runs: must be more than the {columns} coefficients of the model, to estimate an "
            f"error from, got {runs}{hint}"
        )
    if model.pure[0] + model.lack[0] <= runs * cells.least**2:
        raise ConfigurationError(
            "response: must scatter about the model, to estimate an error from, got no scatter"
        )
