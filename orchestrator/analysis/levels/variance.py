"""Analysis of variance of a linear model, and intervals of means and of their differences.

Independent runs: F tests assume equal variances. Intervals do not: the variance of a weighted mean
of cells, Σ cₖ² sₖ²/nₖ, comes from the cells' own scatter, with Satterthwaite's degrees of freedom
(Welch, Biometrika 34, 1947, 28–35). A cell with a single run has the scatter of the others, or the
scatter about the model if there is none.

Common random numbers: the runs of a replicate share their noise. Means are computed in each
replicate, and their scatter over the replicates is the error. For differences it is the scatter of
*paired* differences. A term's F has its own error, the scatter of its contrasts, and Greenhouse and
Geisser's degrees of freedom (Psychometrika 24, 1959, 95–112).

The intervals of the differences between the levels of a factor hold all at once, by Bonferroni's
inequality: each of m pairs is at 1 − α/m. Unlike Tukey's and Games and Howell's intervals, this
assumes neither equal variances, nor equal numbers of runs, nor independent means. For four levels
it costs 3 % in width. Like all t intervals, they are too short for runs that are both skewed and
unequally spread: for log-normal runs with σ = 1 and spreads of 1 : 2 : 4 : 8, with 20 runs at each
level, they hold in 86 % of the experiments instead of 95 %. `sentences.warnings` reports such runs.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from scipy import stats

from ..common.model import Floats, term_name
from .cells import Cells
from .linear import LinearModel

ANOVA_COLUMNS = ["df", "sum_sq", "mean_sq", "F", "p"]


def anova_table(model: LinearModel, typ: int) -> pd.DataFrame:
    """One row per term, then replicates, residual with its parts, and total.

    With common random numbers, each term has a column ``epsilon``, Greenhouse and Geisser's factor
    of its degrees of freedom, and its mean square error, ``mean_sq_error``.
    """
    cells = model.cells
    runs = float(cells.runs.sum())
    (pure, pure_df), (lack, lack_df) = model.pure, model.lack
    residual, spare = pure + lack, pure_df + lack_df
    centre = float((cells.runs * cells.mean).sum()) / runs
    total = pure + float((cells.runs * (cells.mean - centre) ** 2).sum())
    rows: dict[str, tuple[float, ...]] = {}
    common = cells.values is not None
    for i, term in enumerate(model.terms):
        basis = model.basis(i, typ)
        ss = float(((basis.T @ (np.sqrt(cells.runs) * cells.mean)) ** 2).sum())
        df = basis.shape[1]
        name = term_name(term, cells.factors)
        rows[name] = (
            _within_replicates(cells, basis, ss) if common
            else (df, ss, ss / df, *_f(ss / df, df, residual / spare, spare))
        )
    nan = np.nan
    if cells.values is not None:
        each = cells.values.mean(axis=1)
        between = cells.values.shape[1] * float(((each - each.mean()) ** 2).sum())
        rows["replicates"] = (len(each) - 1, between, between / (len(each) - 1), nan, nan)
        residual, spare = residual - between, spare - len(each) + 1
    rows["residual"] = (spare, residual, residual / spare if spare else nan, nan, nan)
    if lack_df and pure_df and not common:
        test = _f(lack / lack_df, lack_df, pure / pure_df, pure_df)
        rows["lack of fit"] = (lack_df, lack, lack / lack_df, *test)
        rows["pure error"] = (pure_df, pure, pure / pure_df, nan, nan)
    rows["total"] = (runs - 1, total, nan, nan, nan)
    columns = [*ANOVA_COLUMNS, *(["epsilon", "mean_sq_error"] if common else [])]
    full = {name: (*row, *[nan] * (len(columns) - len(row))) for name, row in rows.items()}
    table = pd.DataFrame.from_dict(full, orient="index", columns=columns)
    table.index.name = "source"
    return table


def _f(mean_sq: float, df: float, error: float, df_error: float) -> tuple[float, float]:
    """F and its probability."""
    f = mean_sq / error if error > 0 else np.inf if mean_sq > 0 else np.nan
    return f, float(stats.f.sf(f, df, df_error))


def _within_replicates(cells: Cells, basis: Floats, ss: float) -> tuple[float, ...]:
    """A term's row, from the scatter of its contrasts over the replicates."""
    assert cells.values is not None
    count, df = len(cells.values), basis.shape[1]
    contrasts = cells.values @ basis
    scatter = np.atleast_2d(np.cov(contrasts, rowvar=False))
    error, size = float(np.trace(scatter)) / df, float((scatter**2).sum())
    epsilon = max(1 / df, (df * error) ** 2 / (df * size)) if size > 0 else 1.0
    f, p = _f(ss / df, epsilon * df, error, epsilon * df * (count - 1))
    return df, ss, ss / df, f, p, epsilon, error


class WeightedMeans:
    """Estimates that are weighted means of cells, with standard errors and degrees of freedom."""

    def __init__(self, model: LinearModel) -> None:
        cells = model.cells
        self.cells = cells
        (pure, pure_df), (lack, lack_df) = model.pure, model.lack
        several = cells.runs > 1
        spare = cells.runs[several] - 1
        self.several = several
        self.variance = cells.squares[several] / spare / cells.runs[several]
        self.spare = spare
        self.single_df = pure_df or lack_df
        self.single = pure / pure_df if pure_df else lack / lack_df

    def of(self, weights: Floats) -> tuple[Floats, Floats, Floats]:
        """Estimate minus the centre, standard error and degrees of freedom for rows of weights."""
        if self.cells.values is not None:
            each = self.cells.values @ weights.T
            count = len(each)
            errors: Floats = each.std(axis=0, ddof=1) / np.sqrt(count)
            return each.mean(axis=0), errors, np.full(len(weights), count - 1.0)
        square = weights**2
        own = square[:, self.several] * self.variance
        borrowed = square[:, ~self.several].sum(axis=1) * self.single
        variance = own.sum(axis=1) + borrowed
        fourth = (own**2 / self.spare).sum(axis=1) + borrowed**2 / self.single_df
        with np.errstate(divide="ignore", invalid="ignore"):
            df = np.where(variance > 0, variance**2 / fourth, np.inf)
        df[np.isnan(variance)] = np.nan
        return weights @ self.cells.mean, np.sqrt(variance), df


def means_table(model: LinearModel, errors: WeightedMeans, confidence: float) -> pd.DataFrame:
    """Marginal mean of each level: the columns of `GeneralFactorial.means`."""
    cells = model.cells
    parts = []
    for i, (name, levels) in enumerate(cells.levels.items()):
        part = pd.DataFrame({"factor": name, "level": pd.Series(levels, dtype=object)})
        weights = model.marginal((i,))
        parts.append(part.join(_columns(cells, (i,), weights, errors, confidence)))
    return pd.concat(parts, ignore_index=True)


def cell_table(model: LinearModel, errors: WeightedMeans, confidence: float) -> pd.DataFrame:
    """Mean at the levels of each two factors: the columns of `GeneralFactorial.cells`."""
    cells = model.cells
    names = cells.factors
    parts = []
    for i in range(len(names)):
        for j in range(i + 1, len(names)):
            pairs = [(a, b) for a in cells.levels[names[i]] for b in cells.levels[names[j]]]
            part = pd.DataFrame({
                "first": names[i], "second": names[j],
                "first_level": pd.Series([a for a, _ in pairs], dtype=object),
                "second_level": pd.Series([b for _, b in pairs], dtype=object),
            })
            weights = model.marginal((i, j))
            parts.append(part.join(_columns(cells, (i, j), weights, errors, confidence)))
    if not parts:
        return pd.DataFrame(columns=["first", "second", "first_level", "second_level", *INTERVAL])
    return pd.concat(parts, ignore_index=True)


INTERVAL = ["runs", "lost", "mean", "std_error", "df", "low", "high"]


def _columns(
    cells: Cells, term: Sequence[int], weights: Floats, errors: WeightedMeans, confidence: float
) -> pd.DataFrame:
    """Runs, share of lost runs, mean and its interval at each of a term's levels."""
    sizes = tuple(cells.sizes[i] for i in term)
    count = int(np.prod(sizes))
    place = np.ravel_multi_index(tuple(cells.index[:, list(term)].T), sizes)
    known = (cells.seen_index[:, list(term)] >= 0).all(axis=1)
    seen_place = np.ravel_multi_index(tuple(cells.seen_index[known][:, list(term)].T), sizes)
    seen, lost = (np.bincount(seen_place, x[known], count) for x in (cells.seen, cells.seen_lost))
    mean, error, df = errors.of(weights)
    mean += cells.centre
    reach = error * stats.t.ppf((1 + confidence) / 2, df)
    with np.errstate(invalid="ignore"):
        share = lost / seen
    return pd.DataFrame({
        "runs": np.bincount(place, cells.runs, count).astype(np.int64), "lost": share,
        "mean": mean, "std_error": error, "df": df, "low": mean - reach, "high": mean + reach,
    })


def pair_table(
    model: LinearModel, errors: WeightedMeans, confidence: float, ratio: bool
) -> pd.DataFrame:
    """Difference of each two levels of each factor: the columns of `GeneralFactorial.pairs`."""
    parts = []
    for i, (name, levels) in enumerate(model.cells.levels.items()):
        weights = model.marginal((i,))
        count = len(levels)
        pairs = count * (count - 1) // 2
        for one in range(count - 1):
            gap, error, df = errors.of(weights[one] - weights[one + 1 :])
            with np.errstate(divide="ignore", invalid="ignore"):
                t = gap / error
            parts.append(pd.DataFrame({
                "factor": name,
                "one": pd.Series([levels[one]] * len(gap), dtype=object),
                "other": pd.Series(levels[one + 1 :], dtype=object),
                "difference": gap, "std_error": error, "df": df, "t": t,
                "p": np.minimum(1.0, 2 * pairs * stats.t.sf(np.abs(t), df)),
                "reach": error * stats.t.isf((1 - confidence) / 2 / pairs, df),
            }))
    table = pd.concat(parts, ignore_index=True)
    reach = table.pop("reach")
    table["low"], table["high"] = table["difference"] - reach, table["difference"] + reach
    table["differs"] = (table["low"] > 0) | (table["high"] < 0)
    if ratio:
        for new, old in (("ratio", "difference"), ("ratio_low", "low"), ("ratio_high", "high")):
            table[new] = np.exp(table[old])
    return table
