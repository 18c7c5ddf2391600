"""Which design is the cheapest that is good enough: costs of levels against a requirement.

A point of a design *meets* a requirement if the upper confidence bound of its mean, or of a
percentile of its runs, is no larger than the limit. Whoever takes the cheapest of many points
takes one of the lucky ones; so the bounds hold for all m points at once (Bonferroni: each at
1 − α/m), which is valid for common random numbers, too:

- mean: Student's bound x̄ + t(1−α/m, n−1) s/√n, widened for runs that are skewed to the right, as
  errors are, by Hall's cubic transformation (J. R. Statist. Soc. B 54, 1992, 221–228); so far out,
  Student's is wrong several times as often as it says;
- percentile q: the smallest of the ordered runs x₍ₖ₎ with P(Binomial(n, q) < k) ≥ 1 − α/m,
  whatever the distribution (Hahn and Meeker, Statistical Intervals, chapter 5). It exists from
  n = ln(α/m)/ln(q) runs on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from math import ceil, inf, log

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from .errors import ConfigurationError, nearest
from .factorial import check_columns

Floats = NDArray[np.float64]
TOLERANCE = 1e-9
"""How far, relatively, a level may be from the one that a cost is given for."""
LEAST_RUNS = 3
"""Runs that a mean needs for its bound: with fewer, nothing is known of skewness."""
SYMMETRIC = 1e-6
"""Skewness that is none."""


@dataclass(frozen=True, eq=False)
class Advice:
    """The design points by cost.

    Attributes
    ----------
    response, unit, factors
        What was asked about, and the factors of the design.
    limit
        The requirement; None if there is none.
    percentile
        Which percentile of the runs is to meet it; None for their mean.
    confidence
        That no point is said to meet the requirement that does not.
    points
        One row per point, the cheapest first: factors, ``cost``, ``runs``, ``failed`` (without a
        finite response: worse than any limit), ``estimate``, ``upper`` (infinite where there is
        no bound), ``front`` (no point is cheaper and better, by the estimates) and ``meets``.
    chosen
        The cheapest point that meets the requirement, as its place in `points`; None if none does.
    runs_needed
        Runs per point from which on a bound exists.
    free
        Factors that no cost was given for.
    """

    response: str
    unit: str
    factors: tuple[str, ...]
    limit: float | None
    percentile: float | None
    confidence: float
    points: pd.DataFrame
    chosen: int | None
    runs_needed: int
    free: tuple[str, ...] = ()

    @property
    def statistic(self) -> str:
        """The mean or the percentile, in words."""
        if self.percentile is None:
            return f"mean of {self.response}"
        return f"{self.percentile:g}th percentile of {self.response}"

    def named(self, labels: Mapping[str, str], response: str) -> Advice:
        """The same for people to read: other names for factors and response."""
        names = {name: labels.get(name, name) for name in self.factors}
        return replace(
            self,
            response=response,
            factors=tuple(names.values()),
            free=tuple(names[name] for name in self.free),
            points=self.points.rename(columns=names),
        )

    def answer(self) -> str:
        """What to buy, in a sentence or two."""
        unit = f" {self.unit}" if self.unit else ""
        if self.limit is None:
            front = int(self.points["front"].sum())
            return f"{front} of {len(self.points)} points are worth their cost."
        wish = f"{self.statistic} of at most {self.limit:g}{unit}"
        if self.chosen is not None:
            row = self.points.loc[self.chosen, ["cost", "estimate", "upper"]].astype(float)
            return (
                f"The cheapest point with a {wish}: {self._levels(self.chosen)}, at a cost of "
                f"{row['cost']:g}; {row['estimate']:.4g}{unit}, at most {row['upper']:.4g}{unit}."
            )
        text = f"No point is sure to have a {wish}."
        if (self.points["runs"] < self.runs_needed).all():
            return f"{text} A bound needs {self.runs_needed} runs at a point."
        hopeful = self.points.index[self.points["estimate"] <= self.limit]
        if len(hopeful):
            return (
                f"{text} By its estimate {self._levels(int(hopeful[0]))} has; more replicates "
                "may decide it."
            )
        best = self.points.sort_values("upper", kind="stable").iloc[0]
        return (
            f"{text} The best has {best['estimate']:.4g}{unit}, at most {best['upper']:.4g}{unit}."
        )

    def _levels(self, place: int) -> str:
        levels = self.points.loc[place, list(self.factors)].astype(float)
        return ", ".join(f"{name} {level:g}" for name, level in levels.items())

    def __str__(self) -> str:
        lines = [
            self.answer(),
            "",
            "Points that no other one beats in cost and estimate"
            + (", and the chosen one:" if self.chosen is not None else ":"),
            self._shown().to_string(index=False, float_format="{:.4g}".format),
            "",
            f"The upper bounds hold for all {len(self.points)} points at once, with a confidence "
            f"of {self.confidence:g}.",
        ]
        if self.free:
            lines.append(f"No cost was given for {', '.join(self.free)}: taken as free.")
        return "\n".join(lines)

    def _shown(self) -> pd.DataFrame:
        """The points worth their cost, for people."""
        unit = f" [{self.unit}]" if self.unit else ""
        statistic = "mean" if self.percentile is None else f"{self.percentile:g}th percentile"
        shown = self.points[self.points["front"] | (self.points.index == self.chosen)]
        idle = ["front", "failed"] if not self.points["failed"].any() else ["front"]
        return shown.drop(columns=idle if self.limit is not None else [*idle, "meets"]).rename(
            columns={"estimate": f"{statistic}{unit}", "upper": f"upper bound{unit}"}
        )

    def _repr_html_(self) -> str:
        table = self._shown().to_html(index=False, float_format="{:.4g}".format)
        return f"<p>{escape(self.answer())}</p>{table}"


def advise(
    table: pd.DataFrame,
    factors: Sequence[str],
    response: str,
    costs: Mapping[str, Mapping[float, float]],
    *,
    limit: float | None = None,
    percentile: float | None = None,
    confidence: float = 0.95,
    unit: str = "",
) -> Advice:
    """Find the cost–accuracy front of a design, and the cheapest point that meets a requirement.

    Parameters
    ----------
    table
        One row per run, with the factors' levels and the response; less of it is better.
    factors, response
        Columns. The factors may have any number of levels.
    costs
        Cost of each level of a factor, in any currency. A factor that is not here costs nothing;
        the cost of a point is the sum over its factors.
    limit
        Largest value that will do, in the unit of the response.
    percentile
        Between 0 and 100: so many percent of the runs are to be within the limit. Without it the
        limit is for the mean.
    confidence
        That the point which is named meets the requirement.
    unit
        Of the response, for texts.

    Raises
    ------
    ConfigurationError
        A column, a cost or a number is not as it must be.
    """
    factors = tuple(factors)
    check_columns(table, factors, response)
    if percentile is not None and not 0 < percentile < 100:
        raise ConfigurationError(f"percentile: must be between 0 and 100, got {percentile}")
    if not 0 < confidence < 1:
        raise ConfigurationError(f"confidence: must be between 0 and 1, got {confidence}")
    if limit is not None and not np.isfinite(limit):
        raise ConfigurationError(f"limit: must be finite, got {limit}")
    if table.empty:
        raise ConfigurationError("table: must have at least one run, got none")
    for name in costs:
        if name not in factors:
            raise ConfigurationError(
                f"costs: must be of the factors, got {name!r}" + nearest(name, factors)
            )
    groups = table.groupby(list(factors), sort=True)[response]
    risk = (1 - confidence) / groups.ngroups
    rows = []
    for _, values in groups:
        y = values.to_numpy(np.float64)
        y = np.where(np.isfinite(y), y, inf)
        estimate, upper = (
            _mean(y, risk) if percentile is None else _percentile(y, percentile / 100, risk)
        )
        rows.append((len(y), int(np.isinf(y).sum()), estimate, upper))
    points = groups.size().reset_index()[list(factors)]
    points["cost"] = sum((_cost(points[name], costs[name]) for name in costs), np.zeros(len(rows)))
    points[["runs", "failed", "estimate", "upper"]] = pd.DataFrame(rows)
    points = points.sort_values(["cost", "estimate"], kind="stable", ignore_index=True)
    # cheapest first: a point is on the front if it is better than all before it
    best_before = points["estimate"].cummin().shift(fill_value=inf)
    points["front"] = points["estimate"] < best_before
    points["meets"] = False if limit is None else points["upper"] <= limit
    meeting = points.index[points["meets"]]
    needed = LEAST_RUNS if percentile is None else ceil(log(risk) / log(percentile / 100))
    return Advice(
        response=response,
        unit=unit,
        factors=factors,
        limit=limit,
        percentile=percentile,
        confidence=confidence,
        points=points,
        chosen=int(meeting[0]) if len(meeting) else None,
        runs_needed=needed,
        free=tuple(name for name in factors if name not in costs),
    )


def _mean(y: Floats, risk: float) -> tuple[float, float]:
    """Mean of the runs and its upper bound."""
    mean, n = float(y.mean()), len(y)
    if n < LEAST_RUNS or np.isinf(mean):
        return mean, inf
    std = float(y.std(ddof=1))
    reach = float(stats.t.isf(risk, n - 1)) / n**0.5
    skewness = float(stats.skew(y, bias=False)) if std > 0 else 0.0
    if skewness > SYMMETRIC:
        # T + γT²/3 + γ²T³/27 + γ/(6n) = −reach, solved for T = (x̄ − μ)/s
        inside = 1 + skewness * (-reach - skewness / (6 * n))
        reach = 3 / skewness * (1 - float(np.cbrt(inside)))
    return mean, mean + reach * std


def _percentile(y: Floats, share: float, risk: float) -> tuple[float, float]:
    """The run that so many of the others are not above, and an upper bound of the percentile."""
    ordered, n = np.sort(y), len(y)
    estimate = float(ordered[ceil(share * n - TOLERANCE) - 1])
    # of k = 1 … n the smallest with P(Binomial(n, share) ≥ k) ≤ risk
    enough = stats.binom.sf(np.arange(n), n, share) <= risk
    return estimate, float(ordered[enough.argmax()]) if enough.any() else inf


def _cost(levels: pd.Series[float], costs: Mapping[float, float]) -> Floats:
    """Cost of each level in a column."""
    known = np.array([float(level) for level in costs])
    prices = np.array([float(price) for price in costs.values()])
    if not (np.isfinite(prices) & (prices >= 0)).all():
        raise ConfigurationError(
            f"costs.{levels.name}: must be finite and not negative, got {list(costs.values())}"
        )
    values = levels.to_numpy(np.float64)
    same = np.isclose(values[:, None], known, rtol=TOLERANCE, atol=0)
    if not same.any(axis=1).all():
        missing = values[~same.any(axis=1)][0]
        raise ConfigurationError(
            f"costs.{levels.name}: must have every level of the design, got none for {missing:g}"
        )
    found: Floats = prices[same.argmax(axis=1)]
    return found
