"""The cheapest design that is good enough: costs of levels against a requirement.

A point of a design *meets* a requirement if its runs make this sure. The cheapest of many points is
probably one of the lucky ones. All bounds therefore hold for all m points at once (Bonferroni: each
at risk = α/m), also with common random numbers. A run that is lost, or has no finite response, is
worse than any limit. There are two requirements:

- *A percentage of the runs is within the limit.* The limit is compared with an upper bound of the
  percentile q: the smallest of the ordered runs x₍ₖ₎ with P(Binomial(n, q) < k) ≥ 1 − risk, for any
  distribution (Hahn and Meeker, Statistical Intervals, chapter 5). The bound needs at least
  n = ln(risk)/ln(q) runs. This question comes first, because it assumes nothing.
- *The mean is within the limit.* No bound of a mean holds against bad runs that were never seen.
  This statement therefore depends on a stated share c of contamination: if bad runs are at least
  this share, every point has shown one. This needs n = ln(risk)/ln(1 − c) runs, as (1 − c)ⁿ ≤ risk;
  with fewer runs there is no statement. There are two bounds. That of the mean of the runs that are
  not lost is compared with the limit. The exact bound of the share of lost runs (Clopper and
  Pearson) is compared with c.

The bounds are in `sblcosim.analysis.common.bounds`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from math import inf
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ... import artifacts, layout
from ...answer import Answer
from ...catalogue import Job
from ...errors import ConfigurationError, nearest
from ...judge.definitions import LOST
from ...lazy import Module
from ...results.responses import ORDER_STATISTIC, check_limit
from ...shown import folded, page, verbatim
from ...study.design import Level
from ...study.design import shown as level_shown
from ...words.numbers import figure, ordinal
from ...words.shares import percent
from ..common.bounds import LEAST_RUNS, mean_bound, percentile_bound, runs_to_see, share_bound
from ..common.runs import check_columns
from .costs import of_column
from .tables import POINTS

drawings: Any = Module("sblcosim.analysis.advice.figures")

Floats = NDArray[np.float64]
PERCENTILE = 90.0
"""Default percentile."""


@dataclass(frozen=True, eq=False)
class Criterion:
    """A question to the runs.

    Attributes
    ----------
    response, unit, factors
        Response and its unit, and the factors of the design.
    limit
        The requirement; None if there is none.
    percentile
        Percentile of the runs that must meet it; None for their mean.
    contamination
        Share of bad runs that a statement about a mean takes into account.
    confidence
        Probability that every point which is said to meet the requirement does.
    """

    response: str
    unit: str
    factors: tuple[str, ...]
    limit: float | None
    percentile: float | None
    contamination: float
    confidence: float

    @property
    def statistic(self) -> str:
        """The mean or the percentile, in words."""
        if self.percentile is None:
            return f"mean of {self.response}"
        return f"{ordinal(self.percentile)} percentile of {self.response}"

    def tolerable(self, points: pd.DataFrame) -> pd.Series[bool]:
        """Points whose share of lost runs is small enough for a mean without these."""
        if self.percentile is not None:
            return pd.Series(True, points.index)
        return points["lost"] <= self.contamination * points["runs"]


@dataclass(frozen=True, eq=False, repr=False)
class Advice(Answer, Criterion):
    """The design points by cost.

    Attributes
    ----------
    response, unit, factors, limit, percentile, contamination, confidence
        The question.
    points
        One row per point, the cheapest first: factors, ``cost``, ``runs``, ``lost`` (runs that are
        lost or have no finite response), ``lost_upper`` (bound of their share), ``estimate`` of the
        percentile, or of the mean of the runs that are not lost, ``upper`` bound of it (infinite
        where there is none), ``front`` (no point is cheaper and better, by the estimates) and
        ``meets``.
    chosen
        Row in `points` of the cheapest point that meets the requirement; None if none does.
    runs_needed
        Fewest runs per point for a bound.
    free
        Factors without a given cost.
    beside
        The other question, answered from the same runs; None without a limit.
    labels, label
        Labels of the factors and of the response, for texts and figures.
    """

    document = "advise"
    columns = MappingProxyType({"points": POINTS})

    points: pd.DataFrame
    chosen: int | None
    runs_needed: int
    free: tuple[str, ...] = ()
    beside: Advice | None = None
    labels: Mapping[str, str] = field(default_factory=dict)
    label: str = ""

    @property
    def readable(self) -> Advice:
        """A copy with `labels` and `label` instead of the names of columns, for people."""
        return self.named(self.labels, self.label or self.response)

    def labelled(self, labels: Mapping[str, str], label: str) -> Advice:
        """A copy with labels for people."""
        beside = None if self.beside is None else self.beside.labelled(labels, label)
        return replace(self, labels=labels, label=label, beside=beside)

    def named(self, labels: Mapping[str, str], response: str) -> Advice:
        """A copy with other names for factors and response, for people."""
        names = {name: labels.get(name, name) for name in self.factors}
        return replace(
            self,
            response=response,
            factors=tuple(names.values()),
            free=tuple(names[name] for name in self.free),
            points=self.points.rename(columns=names),
            beside=None if self.beside is None else self.beside.named(labels, response),
            labels={},
            label="",
        )

    @property
    def missing(self) -> int:
        """Number of runs that the point with the fewest lacks for a bound."""
        return max(0, self.runs_needed - int(self.points["runs"].min()))

    @property
    def title(self) -> str:
        """Title of a page."""
        return f"Designs by cost and {self.readable.statistic}"

    @property
    def answer(self) -> str:
        """What to buy, in a few sentences: by a percentile first, then by the mean."""
        return " ".join(self.readable._answers())

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The points."""
        return {"points": self.points}

    @property
    def figures(self) -> list[Job]:
        """Cost against accuracy."""
        return [Job("front", drawings.later("plot_front"), (self.readable,))]

    @property
    def remarks(self) -> list[str]:
        """Remarks that are needed to read the numbers, one line each."""
        return self.readable._notes()

    def to_json(self) -> dict[str, Any]:
        """The points by cost, and the other question, as plain data."""
        beside = None if self.beside is None else self.beside._told()
        plain: dict[str, Any] = artifacts.plain({**self._told(), "beside": beside})
        return plain

    def _told(self) -> dict[str, Any]:
        levels = self.points[list(self.factors)].to_dict(orient="records")
        rows = POINTS.rows(self.points)
        return {
            "answer": self.readable.own_answer(), "response": self.response, "unit": self.unit,
            "limit": self.limit, "percentile": self.percentile,
            "contamination": self.contamination, "confidence": self.confidence,
            "chosen": self.chosen, "runs_needed": self.runs_needed, "missing": self.missing,
            "free": self.free,
            "points": [{"levels": of, **row} for of, row in zip(levels, rows, strict=True)],
        }  # fmt: skip

    def manifest(self) -> dict[str, Any]:
        """The question."""
        return {
            "advice": {
                "response": self.response, "limit": self.limit, "percentile": self.percentile,
                "contamination": self.contamination, "confidence": self.confidence,
                "factors": list(self.factors), "costs": self.points["cost"].tolist(),
            }
        }  # fmt: skip

    def _answers(self) -> list[str]:
        both = [self] if self.beside is None else [self, self.beside]
        return [a.own_answer() for a in sorted(both, key=lambda a: a.percentile is None)]

    def own_answer(self) -> str:
        """What to buy, by this question alone."""
        unit = f" {self.unit}" if self.unit else ""
        if self.limit is None:
            front = int(self.points["front"].sum())
            return (
                f"{front} of {len(self.points)} points are worth their cost: no other point is "
                "both cheaper and better. A limit selects one of them."
            )
        wish = f"{self.statistic} of at most {self.limit:g}{unit}"
        if self.chosen is not None:
            row: Any = self.points.loc[self.chosen]
            text = (
                f"The cheapest point with a {wish}: {self._levels(self.chosen)}, at a cost of "
                f"{row.cost:g}. It has {row.estimate:.4g}{unit}, at most {row.upper:.4g}{unit}."
            )
            if self.percentile is not None:
                return text
            return (
                f"{text} This excludes lost runs: {row.lost:g} of {row.runs:g} are lost, surely "
                f"at most {percent(row.lost_upper, '.2g')}."
            )
        if (self.points["runs"] < self.runs_needed).all():
            return f"{self._too_few()} {self._missing()}"
        text = f"No point surely has a {wish}."
        possible = self.points[self.tolerable(self.points)]
        hopeful = possible.index[possible["estimate"] <= self.limit]
        if len(hopeful):
            return (
                f"{text} By its estimate, {self._levels(int(hopeful[0]))} has. More replicates "
                "may decide it." + (f" {self._missing()}" if self.missing else "")
            )
        if possible.empty:
            return (
                f"{text} At every point, more than {percent(self.contamination, '.4g')} of the "
                "runs are lost."
            )
        best = possible.sort_values(["upper", "estimate"], kind="stable").iloc[0]
        bound = f", at most {best['upper']:.4g}{unit}" if np.isfinite(best["upper"]) else ""
        return f"{text} The best point has {best['estimate']:.4g}{unit}{bound}."

    def _too_few(self) -> str:
        if self.percentile is not None:
            return f"Nothing sure can be said about the {self.statistic}: there are too few runs."
        return (
            f"Nothing sure can be said about the {self.statistic}: if "
            f"{percent(self.contamination, '.4g')} of the runs are bad, some point may have shown "
            "none."
        )

    def _missing(self) -> str:
        few = self.points["runs"]
        have = f"{few.min()}" if few.min() == few.max() else f"{few.min()} or more"
        return (
            f"Each of the {len(few)} points needs {self.runs_needed} runs. There are {have}, so "
            f"{self.missing} are missing."
        )

    def _levels(self, row: int) -> str:
        levels = self.points.loc[row, list(self.factors)].to_dict()
        return ", ".join(f"{name} {level_shown(level)}" for name, level in levels.items())

    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """What to buy, then the points worth their cost.

        Parameters
        ----------
        verbose
            Add remarks on how to read the numbers.
        width
            Columns to fit into; None: sentences are not wrapped.
        """
        it = self.readable
        shown = it._shown()
        rows = [
            [_cost(x) if isinstance(x, float) else _words(x) for x in row]
            for row in shown.itertuples(index=False)
        ]
        head = [str(name) for name in shown.columns]
        lines = [
            *it._answers(),
            "",
            f"By the {it.statistic}: points that no other point beats in cost and estimate"
            + (", and the chosen one:" if it.chosen is not None else ":"),
            *layout.table(rows, width, head, range(len(head))),
            *(["", *it._notes()] if verbose else [*it._defined(), *it._assumed()]),
        ]
        return layout.fitted("\n".join(lines), width)

    def _assumed(self) -> list[str]:
        """The assumption about costs that were not given."""
        if not self.free:
            return []
        return [f"No cost was given for {', '.join(self.free)}, which counts as free."]

    def _notes(self) -> list[str]:
        """How to read the numbers."""
        lines = [
            f"Each run counts with one number, its {self.response}. Means and percentiles are "
            "over runs, not over the instants of a run.",
            f"The upper bounds hold for all {len(self.points)} points at once, with a confidence "
            f"of {self.confidence:g}.",
        ]
        if self.percentile is None:
            lines.append(
                "A point meets the requirement if the bound of the mean over the runs that are not "
                f"lost is within the limit, and surely no more than {100 * self.contamination:.4g} "
                "% of its runs are lost. Worse but rarer runs may never have been seen, and no "
                "bound of a mean holds against them. A percentile assumes nothing."
            )
        elif self.points["lost"].any():
            lines.append("A lost run is worse than any limit.")
        return [*lines, *self._defined(), *self._assumed()]

    def _defined(self) -> list[str]:
        """Definitions of percentiles and of lost runs, if there are any."""
        percentiles = self.percentile is not None or self.beside is not None
        return [
            *([ORDER_STATISTIC] if percentiles or "percentile" in self.response else []),
            *([LOST] if self.points["lost"].any() else []),
        ]

    def _shown(self) -> pd.DataFrame:
        """The points worth their cost, for people."""
        unit = f" [{self.unit}]" if self.unit else ""
        statistic = "mean" if self.percentile is None else f"{ordinal(self.percentile)} percentile"
        shown = self.points[self.points["front"] | (self.points.index == self.chosen)]
        idle = ["front", *(["meets"] if self.limit is None else [])]
        if self.percentile is not None:
            idle += ["lost_upper"] if self.points["lost"].any() else ["lost", "lost_upper"]
        heads = {column.name: column.heading for column in POINTS.printed}
        own = {"estimate": f"{statistic}{unit}", "upper": f"{heads['upper']}{unit}"}
        return shown.drop(columns=idle).rename(columns=heads | own)

    def _gist(self) -> str:
        points = f"on {len(self.points)} points by cost and {self.statistic}"
        if self.limit is None:
            return points
        chosen = "none" if self.chosen is None else self._levels(self.chosen)
        return f"{points}; surely within {self.limit:g}, the cheapest: {chosen}"

    def _repr_html_(self) -> str:
        return page(
            self.title,
            f"<p>{escape(self.answer)}</p>",
            self.readable._shown().to_html(index=False, float_format=_cost, border=0),
            folded("How to read the numbers", verbatim("\n".join(self.remarks))),
        )


def _cost(value: float) -> str:
    return figure(value, 4, "none")


def _words(value: object) -> str:
    return ("no", "yes")[bool(value)] if isinstance(value, bool | np.bool_) else str(value)


def advise(
    table: pd.DataFrame,
    factors: Sequence[str],
    response: str,
    costs: Mapping[str, Mapping[Level, float]],
    *,
    limit: float | None = None,
    percentile: float | None = PERCENTILE,
    contamination: float = 0.05,
    confidence: float = 0.95,
    unit: str = "",
    lost: str | None = None,
) -> Advice:
    """Find the cost–accuracy front of a design and the cheapest point that meets a requirement.

    Parameters
    ----------
    table
        One row per run, with the factors' levels and the response. A smaller response is better.
    factors, response
        Columns. The factors may have any number of levels.
    costs
        Cost of each level of a factor, in any currency. A factor without costs is free. The cost
        of a point is the sum over its factors.
    limit
        Largest acceptable value, in the unit of the response.
    percentile
        Between 0 and 100: the percentage of the runs that must be within the limit. None: the limit
        is for their mean.
    contamination
        Above 0 and below 1: the share of bad runs that a statement about a mean takes into
        account. A smaller share needs more runs.
    confidence
        Probability that the named point meets the requirement.
    unit
        Unit of the response, for texts.
    lost
        Column that is not zero for lost runs, whatever their response.

    Raises
    ------
    ConfigurationError
        A column, a cost or a number is invalid.
    """
    question = Criterion(
        response, unit, tuple(factors), limit, percentile, contamination, confidence
    )
    _check(table, question, costs, lost)
    values = table[response].to_numpy(np.float64)
    gone = ~np.isfinite(values)
    if lost is not None:
        gone |= table[lost].to_numpy(np.float64, na_value=0.0) != 0
    runs = table[list(question.factors)].assign(value=np.where(gone, inf, values))
    advice = _answered(question, runs, costs)
    if limit is None:
        return advice
    other = replace(question, percentile=PERCENTILE if percentile is None else None)
    return replace(advice, beside=_answered(other, runs, costs))


def _check(
    table: pd.DataFrame,
    question: Criterion,
    costs: Mapping[str, Mapping[Level, float]],
    lost: str | None,
) -> None:
    """Refuse a question that the table cannot answer."""
    factors, percentile, limit = question.factors, question.percentile, question.limit
    check_columns(table, factors, question.response, numbers=False)
    if percentile is not None and not 1 <= percentile < 100:  # 0.9 would be a share
        raise ConfigurationError(
            f"percentile: must be at least 1 and less than 100, got {percentile}"
        )
    for name in ("confidence", "contamination"):
        value = getattr(question, name)
        if not 0 < value < 1:
            raise ConfigurationError(f"{name}: must be between 0 and 1, got {value}")
    if limit is not None and not np.isfinite(limit):
        raise ConfigurationError(f"limit: must be finite, got {limit}")
    if limit is not None:
        check_limit("limit", limit, question.response.rpartition(".")[2])
    if table.empty:
        raise ConfigurationError("table: must have at least one run, got none")
    if lost is not None and lost not in table:
        raise ConfigurationError(
            f"lost: must be a column of the table, got {lost!r}"
            + nearest(lost, map(str, table.columns))
        )
    for name in costs:
        if name not in factors:
            raise ConfigurationError(
                f"costs: must be for the factors, got {name!r}" + nearest(name, factors)
            )


def _answered(
    question: Criterion, runs: pd.DataFrame, costs: Mapping[str, Mapping[Level, float]]
) -> Advice:
    """Weigh the points; `runs` has the factors and ``value``, which is infinite if lost."""
    factors, limit, percentile = question.factors, question.limit, question.percentile
    groups = runs.groupby(list(factors), sort=True)["value"]
    risk = (1 - question.confidence) / groups.ngroups
    share = 1 - question.contamination if percentile is None else percentile / 100
    needed = runs_to_see(1 - share, risk)
    if percentile is None:
        needed = max(needed, LEAST_RUNS)
    rows = []
    for _, values in groups:
        y = np.sort(values.to_numpy(np.float64))
        n, lost = len(y), int(np.isinf(y).sum())
        estimate, upper = (
            mean_bound(y[: n - lost], risk) if percentile is None
            else percentile_bound(y, share, risk)
        )
        if n < needed:
            upper = inf
        rows.append((n, lost, share_bound(lost, n, risk), estimate, upper))
    points = groups.size().reset_index()[list(factors)]
    points["cost"] = np.zeros(len(rows))
    for name in costs:
        points["cost"] += of_column(points[name], costs[name])
    columns = ["runs", "lost", "lost_upper", "estimate", "upper"]
    points[columns] = pd.DataFrame(rows, columns=columns)
    points = points.sort_values(["cost", "estimate"], kind="stable", ignore_index=True)
    # In this order, a point is on the front if it is better than all points before it.
    rank = points["estimate"].where(question.tolerable(points), inf)
    points["front"] = rank < rank.cummin().shift(fill_value=inf)
    meets = pd.Series(False, points.index) if limit is None else points["upper"] <= limit
    if percentile is None:
        meets &= points["lost_upper"] <= question.contamination
    points["meets"] = meets
    meeting = points.index[meets]
    return Advice(
        **vars(question),
        points=points,
        chosen=int(meeting[0]) if len(meeting) else None,
        runs_needed=needed,
        free=tuple(name for name in factors if name not in costs),
    )
