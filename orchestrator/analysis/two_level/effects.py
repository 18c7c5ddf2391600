"""Tables of effects, variance and means."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np
import pandas as pd
from scipy import stats

from ..common.model import CURVATURE, Floats, TwoLevelModel
from ..common.options import Options
from .fit import LeastSquares, Uncertainty
from .noise import FTest


def effect_table(
    fit: LeastSquares, uncertainty: Uncertainty, model: TwoLevelModel, options: Options
) -> pd.DataFrame:
    """One row per term; see `sblcosim.analysis.two_level.analysis.Factorial`."""
    rows = slice(1, len(model.terms) + 1)
    coefficient, error = fit.coefficients[rows], uncertainty.errors[rows]
    effect, std_error = 2 * coefficient, 2 * error
    df, confidence = uncertainty.df, options.confidence
    with np.errstate(divide="ignore", invalid="ignore"):
        t = effect / std_error
    p = 2 * stats.t.sf(np.abs(t), df)
    margin = stats.t.ppf((1 + confidence) / 2, df) * std_error
    low, high = effect - margin, effect + margin
    table = pd.DataFrame(
        {
            "order": [len(term) for term in model.terms],
            "coefficient": coefficient,
            "effect": effect,
            "std_error": std_error,
            "t": t,
            "p": p,
            "low": low,
            "high": high,
            "share": coefficient**2 / fit.variances[rows] / fit.total,
            "significant": p < 1 - confidence,
        },
        index=pd.Index(model.names, name="term"),
    )
    limit = options.limit
    if limit is not None:
        table["verdict"] = np.select(
            [(low >= limit) | (high <= -limit), (low > -limit) & (high < limit)],
            ["matters", "too small"],
            "undecided",
        )
    if options.is_ratio:
        for column, source in (("ratio", "effect"), ("ratio_low", "low"), ("ratio_high", "high")):
            table[column] = np.exp(table[source])
    return table


def anova_table(
    effects: pd.DataFrame,
    fit: LeastSquares,
    uncertainty: Uncertainty,
    model: TwoLevelModel,
    curvature: FTest | None,
) -> pd.DataFrame:
    """Sums of squares, one row per term and one per other source."""
    method, blocks, lack = uncertainty.method, uncertainty.blocks, uncertainty.lack_of_fit
    ss = effects["share"] * fit.total
    with np.errstate(divide="ignore", invalid="ignore"):
        f = effects["t"] ** 2 if method != "lenth" else np.nan
    p = effects["p"] if method != "lenth" else np.nan
    table = pd.DataFrame({"ss": ss, "df": 1.0, "ms": ss, "f": f, "p": p})
    nan = np.nan
    within = float((uncertainty.residual**2).sum())  # without the replicates' means
    spare = fit.spare - blocks
    rows: dict[str, tuple[float, float, float, float]] = {}
    if curvature is not None:
        rows[CURVATURE] = (curvature.ss, 1.0, curvature.f, curvature.p)
    if method == "replicates":
        between = float(((fit.residual - uncertainty.residual) ** 2).sum())
        rows["replicates"] = (between, blocks, nan, nan)
    if spare:
        rows["residual"] = (within, spare, nan, nan)
    if lack is not None:
        lack_df = len(model.points) - model.x.shape[1]
        rows["lack of fit"] = (lack.ss, lack_df, lack.f, lack.p)
        pure = within - lack.ss if method == "replicates" else fit.pure
        rows["pure error"] = (pure, spare - lack_df, nan, nan)
    rows["total"] = (fit.total, len(fit.y) - 1, nan, nan)
    rest = pd.DataFrame.from_dict(rows, orient="index", columns=["ss", "df", "f", "p"])
    rest.insert(2, "ms", rest["ss"] / rest["df"])
    whole = pd.concat([table, rest])
    whole.index.name = "source"
    return whole


def point_table(fit: LeastSquares, model: TwoLevelModel) -> pd.DataFrame:
    """One row per design point: factors, ``runs``, ``mean``, ``std``, ``fit``."""
    points, of_run = model.points, model.point_of_run
    low, high = np.array(list(model.levels.values())).T
    middle = (low + high) / 2
    values = np.select([points < 0, points > 0], [low, high], middle)
    table = pd.DataFrame(values, columns=list(model.levels))
    groups = pd.Series(fit.y).groupby(of_run)
    table["runs"], table["mean"], table["std"] = groups.size(), groups.mean(), groups.std()
    table["mean"] += fit.centre
    table["fit"] = fit.centre + fit.fitted
    return table


def main_effect_table(
    points: Floats, means: Floats, levels: Mapping[str, tuple[float, float]]
) -> pd.DataFrame:
    """Mean of the points' means at each level of each factor."""
    return pd.DataFrame(
        [
            (name, word, levels[name][side > 0], means[points[:, i] == side].mean())
            for i, name in enumerate(levels)
            for side, word in ((-1, "low"), (1, "high"))
        ],
        columns=["factor", "level", "value", "mean"],
    )


def interaction_table(
    points: Floats, means: Floats, levels: Mapping[str, tuple[float, float]]
) -> pd.DataFrame:
    """Mean of the points' means at each pair of levels of each two factors."""
    rows = []
    names = list(levels)
    for i, j in combinations(range(len(names)), 2):
        for a in (-1, 1):
            for b in (-1, 1):
                cell = means[(points[:, i] == a) & (points[:, j] == b)]
                rows.append((names[i], names[j], levels[names[i]][a > 0], levels[names[j]][b > 0],
                             cell.mean() if len(cell) else np.nan))
    return pd.DataFrame(rows, columns=["first", "second", "first_value", "second_value", "mean"])
