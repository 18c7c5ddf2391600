"""Analysis of designs whose factors have any number of levels, numbers or words, balanced or not.

The model is the general linear model: a mean, a main effect of each factor, and interactions
(Montgomery, Design and Analysis of Experiments, 8th edition, chapters 5 and 15.2).
`sblcosim.analysis.levels.linear` defines its terms, and `sblcosim.analysis.levels.variance` the
source of the errors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from math import log
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self, get_args

import numpy as np
import pandas as pd

from ... import artifacts
from ...answer import Answer
from ...catalogue import Figure, Job, by_name, jobs
from ...errors import ConfigurationError, check_choice, nearest
from ...lazy import Module
from ...shown import Picture, folded, page, verbatim
from ...study.design import Level
from ..common.bounds import runs_to_see
from ..common.model import Term, term_name
from ..common.options import Options, Seeding, Transform
from .cells import Cells, cells_of
from .linear import LinearModel, SumsType, fitted_model
from .medians import median_pairs
from .tables import ANOVA, CELLS, MEANS, MEDIANS, PAIRS
from .variance import WeightedMeans, anova_table, cell_table, means_table, pair_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ...style import ThemeName

sentences: Any = Module("sblcosim.analysis.levels.sentences")
drawings: Any = Module("sblcosim.analysis.levels.figures")

LOST = "lost"
"""Column of lost runs."""
CONTAMINATION = 0.05
"""Smallest share of bad runs for which every level should have shown one."""
RUNAWAY = 50.0
"""A response above this multiple of the median is reported, even of a single run."""


@dataclass(frozen=True, eq=False, repr=False)
class GeneralFactorial(Answer):
    """The numbers of an analysed experiment with factors of any number of levels.

    Attributes
    ----------
    response, unit, transform
        The analysed quantity. With ``log`` it is the natural logarithm; differences are then
        logarithms of ratios.
    levels
        Levels of each factor that have runs, in their order.
    terms, typ
        Terms of the model except the mean, as indices of the factors, and the type of its sums of
        squares.
    left_out
        Requested interactions that the combinations of levels with runs cannot estimate. If there
        are any, the model has main effects alone.
    seeding, confidence
        Whether the runs of a replicate share their noise; the confidence of intervals.
    anova
        Per ``source`` (terms, residual, total and others): ``df``, ``sum_sq``, ``mean_sq``, ``F``,
        ``p``; see `sblcosim.analysis.levels.variance.anova_table`.
    means
        Marginal means, which count each combination of the other factors' levels once: ``factor``,
        ``level``, ``runs``, ``lost`` (share of the table's runs that are lost or have no finite
        response), ``mean``, ``std_error``, ``df``, ``low``, ``high``. The interval holds for this
        mean alone. It is NaN, for unknown, if it would reach below zero although no run does.
    cells
        The same for each two factors: ``first``, ``second``, ``first_level``, ``second_level`` …
    pairs
        Differences of the levels of each factor: ``factor``, ``one``, ``other``, ``difference``
        (the mean of one minus that of other), ``std_error``, ``df``, ``t``, ``p`` (adjusted),
        ``low``, ``high`` (intervals that hold for all pairs of the factor at once); ``ratio``,
        ``ratio_low``, ``ratio_high`` for logarithms; ``median_difference``, ``median_low``,
        ``median_high`` of the response itself (with common random numbers, the median of the
        differences within a replicate, see `sblcosim.analysis.levels.medians.median_pairs`);
        ``differs``, judged by medians where means cannot be trusted (`by_medians`).
    runs, combinations, dropped
        Number of analysed runs, of their combinations of levels, and of runs that are left out
        because their response is not finite or, with common random numbers, their replicate is
        incomplete.
    df, rmse, r2
        Degrees of freedom and standard deviation of the residuals; share of the sum of squares that
        the model explains.
    spread
        Smallest and largest standard deviation of the combinations with two runs or more.
    far, far_log
        Share of the runs more than 5 robust standard deviations from the median of their
        combination, for the response and for its logarithm; NaN if no combination has 10 runs.
    heavy
        Whether there are enough of these to call the tails heavy.
    skewness
        Skewness of the runs about the mean of their combination; NaN if `far` is.
    fewest, runs_needed
        Runs at the level with the fewest, and runs that every level needs to show a bad run if 1 in
        20 is bad.
    empty
        Levels without any run that counts.
    units
        Units of the factors, for texts.
    medians
        Medians of the response itself over all runs at each level: ``factor``, ``level``,
        ``median``, ``low``, ``high``; see `sblcosim.analysis.levels.medians.median_table`.
    practical
        Smallest difference that matters, with ``log`` a ratio; None if none was given. With it,
        `pairs` has a ``verdict``: ``equal`` (the interval is within ±practical), ``differs`` (it
        is beyond), ``undecided``.
    worst_run
        The run with the `largest` response, if it is known.
    labels, label
        Labels of the factors and of the response, for people, if they have any.
    measured_in
        Unit of the response itself.
    largest, median
        Largest value and median of the response itself.
    """

    columns = MappingProxyType({
        "anova": ANOVA, "main_effects": MEANS, "medians": MEDIANS, "cells": CELLS, "pairs": PAIRS,
    })

    response: str
    unit: str
    transform: Transform
    levels: Mapping[str, tuple[Level, ...]]
    terms: tuple[Term, ...]
    typ: SumsType
    left_out: tuple[str, ...]
    seeding: Seeding
    confidence: float
    anova: pd.DataFrame
    means: pd.DataFrame
    cells: pd.DataFrame
    pairs: pd.DataFrame
    runs: int
    combinations: int
    dropped: int
    df: float
    rmse: float
    r2: float
    spread: tuple[float, float]
    far: float
    far_log: float
    heavy: bool
    skewness: float
    fewest: int
    runs_needed: int
    empty: tuple[str, ...]
    units: Mapping[str, str] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)
    label: str = ""
    measured_in: str = ""
    largest: float = np.nan
    median: float = np.nan
    worst_run: str = ""
    medians: pd.DataFrame = field(default_factory=pd.DataFrame)
    practical: float | None = None

    @property
    def own_means(self) -> pd.DataFrame:
        """`means` on the scale of the response; for logarithms, geometric means."""
        if self.transform != "log":
            return self.means
        return self.means.assign(
            **{name: np.exp(self.means[name]) for name in ("mean", "low", "high")}
        )

    @property
    def mean_of(self) -> str:
        """Description of `own_means`, with their unit."""
        unit = f" [{self.measured_in}]" if self.measured_in else ""
        return f"{'Geometric mean' if self.transform == 'log' else 'Mean'} {self.response}{unit}"

    @property
    def shown_of(self) -> str:
        """Description of the statistic that comes first: medians where means cannot be trusted."""
        unit = f" [{self.measured_in}]" if self.measured_in else ""
        return f"Median {self.response}{unit}" if self.by_medians else self.mean_of

    @property
    def ran_away(self) -> bool:
        """Whether a single run is so far above the median that it dominates the means."""
        return self.transform == "none" and 0 < RUNAWAY * self.median < self.largest

    @property
    def by_medians(self) -> bool:
        """Whether means cannot be trusted: heavy tails, a runaway, or unknown intervals."""
        unknown = bool(self.means["low"].isna().any())
        return self.transform == "none" and (self.heavy or self.ran_away or unknown)

    @property
    def judged_pairs(self) -> pd.DataFrame:
        """`pairs` with the ``difference``, ``low`` and ``high`` that decide their verdicts."""
        if not self.by_medians:
            return self.pairs
        medians = {name: self.pairs[f"median_{name}"] for name in ("difference", "low", "high")}
        return self.pairs.assign(**medians, p=np.nan)

    @property
    def within_replicates(self) -> bool:
        """Whether medians of differences, instead of differences of medians, judge the pairs."""
        return self.by_medians and self.seeding == "common"

    @property
    def factors(self) -> tuple[str, ...]:
        """Names of the factors."""
        return tuple(self.levels)

    @property
    def quantity(self) -> str:
        """The analysed quantity in words."""
        return f"ln {self.response}" if self.transform == "log" else self.response

    @property
    def title(self) -> str:
        """Title of a page."""
        return f"Means of {self.readable.quantity}"

    @property
    def answer(self) -> str:
        """Which levels are best, in a few sentences."""
        return str(sentences.answer(self.readable))

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """Variance, means, medians, cells and pairs."""
        return {
            "anova": self.anova.reset_index(), "main_effects": self.means,
            "medians": self.medians, "cells": self.cells, "pairs": self.pairs,
        }

    @property
    def figures(self) -> list[Job]:
        """Means, differences of pairs, interactions."""
        return jobs(FIGURES, self.readable)

    @property
    def remarks(self) -> list[str]:
        """Doubts about the answer, and how to read the numbers, one line each."""
        shown = self.readable
        return [*sentences.warnings(shown), *sentences.notes(shown)]

    def to_json(self) -> dict[str, Any]:
        """Levels and pairs as plain data."""
        plain: dict[str, Any] = artifacts.plain({
            "response": self.response, "unit": self.unit, "answer": self.answer,
            "transform": self.transform, "confidence": self.confidence, "runs": self.runs,
            "dropped": self.dropped, "r2": self.r2, "levels": MEANS.rows(self.means),
            "medians": MEDIANS.rows(self.medians), "pairs": PAIRS.rows(self.pairs),
            "notes": self.remarks,
        })  # fmt: skip
        return plain

    def manifest(self) -> dict[str, Any]:
        """The question and the method."""
        return {
            "analysis": {
                "response": self.response, "factors": list(self.factors),
                "transform": self.transform, "order": max(map(len, self.terms)),
                "practical": self.practical,
            }
        }  # fmt: skip

    @property
    def readable(self) -> Self:
        """A copy with `labels` and `label` instead of the names of columns, for people."""
        names = {name: self.labels.get(name, name) for name in self.factors}
        terms = {term_name(term, self.factors): term_name(term, tuple(names.values()))
                 for term in self.terms}
        return replace(
            self,
            response=self.label or self.response,
            levels={names[name]: levels for name, levels in self.levels.items()},
            anova=self.anova.rename(index=terms),
            means=self.means.assign(factor=self.means["factor"].map(names)),
            cells=self.cells.assign(first=self.cells["first"].map(names),
                                    second=self.cells["second"].map(names)),
            pairs=self.pairs.assign(factor=self.pairs["factor"].map(names)),
            medians=self.medians.assign(factor=self.medians["factor"].map(names)),
            units={names[name]: unit for name, unit in self.units.items() if name in names},
            labels={},
            label="",
        )

    def text(self, *, verbose: bool = False, width: int | None = None, most: int = 12) -> str:
        """The answer, the analysis of variance, and the means of the levels.

        Parameters
        ----------
        verbose
            Add the `most` largest differences of each factor, and the method.
        width
            Columns to fit into; None: sentences are not wrapped.
        """
        text: str = sentences.summary(self.readable, most, verbose, width, self.response)
        return text

    def _gist(self) -> str:
        sizes = ", ".join(f"{name} ({len(levels)})" for name, levels in self.levels.items())
        return f"of {self.runs} runs, {self.response} by {sizes}"

    def _repr_html_(self) -> str:
        shown = self.readable
        return page(
            self.title,
            f"<p>{escape(self.answer)}</p>",
            shown.anova.to_html(float_format="{:.4g}".format, border=0, na_rep=""),
            shown.means.to_html(float_format="{:.4g}".format, border=0, index=False),
            folded("How to read the numbers", verbatim("\n".join(sentences.notes(shown)))),
        )

    def plot_means(self, ax: Axes | None = None, theme: ThemeName = "light") -> Picture:
        """See `sblcosim.analysis.levels.figures.plot_means`."""
        return Picture(drawings.plot_means(self.readable, ax, theme), ax)

    def plot_interactions(self, ax: Axes | None = None, theme: ThemeName = "light") -> Picture:
        """See `sblcosim.analysis.levels.figures.plot_interactions`."""
        return Picture(drawings.plot_interactions(self.readable, ax, theme), ax)

    def plot_pairs(self, ax: Axes | None = None, theme: ThemeName = "light") -> Picture:
        """See `sblcosim.analysis.levels.figures.plot_pairs`."""
        return Picture(drawings.plot_pairs(self.readable, ax, theme), ax)


def analyse(
    table: pd.DataFrame,
    factors: Sequence[str],
    response: str,
    *,
    order: int = 2,
    typ: SumsType = 2,
    transform: Transform = "none",
    seeding: Seeding = "independent",
    replicate: str = "replicate",
    confidence: float = 0.95,
    levels: Mapping[str, Sequence[Level]] | None = None,
    lost: str = LOST,
    practical: float | None = None,
    labels: Mapping[str, str] | None = None,
    label: str = "",
    units: Mapping[str, str] | None = None,
    unit: str = "",
) -> GeneralFactorial:
    """Analyse an experiment whose factors have any number of levels, balanced or not.

    Parameters
    ----------
    table
        One row per run: levels, numbers or words, and the response. Rows without a finite response
        are left out.
    factors, response
        Columns.
    order
        The model has interactions of up to this many factors. If the combinations of levels with
        runs cannot estimate them all, the model has main effects alone, and the result says so.
    typ
        Type of the sums of squares: 2 or 3.
    transform
        ``log`` analyses the natural logarithm of the response.
    seeding
        ``common`` if the runs of a replicate share their random numbers.
    replicate
        Column of the replicate's number, for common random numbers.
    confidence
        Confidence of intervals.
    levels
        All levels of some factors, in their order. The levels of other factors have the order of
        the table.
    lost
        Column that is not zero for lost runs, if the table has it. Their share is beside every
        mean.
    practical
        Smallest difference of two levels that matters; with ``log`` a ratio above 1. It applies to
        means, or to medians where means cannot be trusted.
    labels, label, units, unit
        Labels and units of the factors and of the response, for texts.

    Raises
    ------
    ConfigurationError
        A column, a level or an option is invalid, main effects cannot be told apart, or no run is
        left to estimate an error from.
    """
    factors = tuple(factors)
    check_choice("transform", transform, ("none", "log"))
    check_choice("typ", typ, get_args(SumsType))
    options = Options(
        seeding=seeding, transform=transform, error="pure", practical=practical,
        confidence=confidence, unit=unit,
        replicate=replicate, run_order="",
    )
    if lost != LOST and lost not in table:
        raise ConfigurationError(
            f"lost: must be a column of the table, got {lost!r}"
            + nearest(lost, map(str, table.columns))
        )
    cells = cells_of(table, factors, response, levels or {}, lost, options)
    model = fitted_model(cells, order)
    names = {"labels": dict(labels or {}), "units": dict(units or {})}
    for where, given in names.items():
        for name in given:
            if name not in factors:
                raise ConfigurationError(
                    f"{where}: must be for the factors, got {name!r}" + nearest(name, factors)
                )
    y = table[response].to_numpy(np.float64, na_value=np.nan)
    y = y[np.isfinite(y)]
    analysis = _assembled(response, options, typ, model, label, names)
    analysis = replace(analysis, largest=float(y.max()), median=float(np.median(y)))
    if transform == "none" and y.min() >= 0:
        analysis = _without_negative(analysis)
    return judged(replace(analysis, pairs=_with_medians(analysis, model.cells)))


def _with_medians(analysis: GeneralFactorial, cells: Cells) -> pd.DataFrame:
    """The pairs with the differences of their medians."""
    each = None if cells.values is None or analysis.transform != "none" else {
        name: cells.by_level(i) for i, name in enumerate(cells.factors)
    }
    medians = median_pairs(analysis.pairs, analysis.medians, each, analysis.confidence)
    return analysis.pairs.assign(**{f"median_{name}": medians[name] for name in medians})


def judged(analysis: GeneralFactorial) -> GeneralFactorial:
    """A copy whose pairs are judged by the statistic that comes first: means, or medians."""
    by = analysis.judged_pairs
    low, high = by["low"].to_numpy(np.float64), by["high"].to_numpy(np.float64)
    pairs = analysis.pairs.assign(differs=(low > 0) | (high < 0))
    if analysis.practical is not None:
        limit = log(analysis.practical) if analysis.transform == "log" else analysis.practical
        equal, differs = (low > -limit) & (high < limit), (low > limit) | (high < -limit)
        pairs["verdict"] = np.select([equal, differs], ["equal", "differs"], "undecided")
    return replace(analysis, pairs=pairs)


def _without_negative(analysis: GeneralFactorial) -> GeneralFactorial:
    """A copy without the intervals of means that reach below zero, which makes them unknown."""
    tables = {}
    for name in ("means", "cells"):
        table = getattr(analysis, name)
        tables[name] = table.assign(**{
            end: table[end].where(~(table["low"] < 0)) for end in ("high", "low")
        })  # fmt: skip
    return replace(analysis, **tables)


def _assembled(
    response: str,
    options: Options,
    typ: SumsType,
    model: LinearModel,
    label: str,
    names: Mapping[str, Mapping[str, str]],
) -> GeneralFactorial:
    """All tables of a model."""
    cells, errors, confidence = model.cells, WeightedMeans(model), options.confidence
    anova = anova_table(model, typ)
    means = means_table(model, errors, confidence)
    pairs = pair_table(model, errors, confidence, options.is_ratio)
    total: Any = anova.loc["total"]
    residual: Any = anova.loc["residual"]
    return GeneralFactorial(
        response=response,
        unit="" if options.is_ratio else options.unit,
        measured_in=options.unit,
        transform=options.transform,
        levels=cells.levels,
        terms=model.terms,
        typ=typ,
        left_out=tuple(term_name(term, cells.factors) for term in model.left_out),
        seeding=options.seeding,
        confidence=confidence,
        anova=anova,
        means=means,
        cells=cell_table(model, errors, confidence),
        pairs=pairs,
        runs=int(cells.runs.sum()),
        combinations=len(cells.runs),
        dropped=cells.dropped,
        df=float(residual["df"]),
        rmse=float(np.sqrt(residual["mean_sq"])),
        r2=1 - (model.pure[0] + model.lack[0]) / float(total["sum_sq"]),
        spread=_spread(cells),
        far=cells.far,
        far_log=cells.far_log,
        heavy=cells.heavy,
        skewness=cells.skewness,
        fewest=int(means["runs"].min()),
        runs_needed=runs_to_see(CONTAMINATION, (1 - confidence) / len(means)),
        empty=cells.empty,
        medians=cells.medians,
        practical=options.practical,
        label=label,
        labels=names["labels"],
        units=names["units"],
    )


def _spread(cells: Cells) -> tuple[float, float]:
    """Smallest and largest standard deviation of the cells."""
    several = cells.runs > 1
    if not several.any():
        return np.nan, np.nan
    std = np.sqrt(cells.squares[several] / (cells.runs[several] - 1))
    return float(std.min()), float(std.max())


# --- Figures -------------------------------------------------------------------------------------


def _of(analysis: GeneralFactorial) -> tuple[GeneralFactorial]:
    return (analysis,)


FIGURES: Mapping[str, Figure[GeneralFactorial]] = by_name(
    Figure(
        "main_effects", drawings.later("plot_means"), _of,
        lambda a: f"{a.shown_of} at each level. Each bar is the interval of one median alone."
        if a.by_medians else (
            f"{a.mean_of} at each level, which counts every combination of the other factors once. "
            "Each bar is the interval of one mean alone."
        ),
        lambda a: f"{'Medians' if a.by_medians else 'Means'} of {a.quantity} by level of "
        f"{', '.join(a.factors)}",
    ),
    Figure(
        "pairs", drawings.later("plot_pairs"), _of,
        lambda a: "Differences of levels, with intervals that hold for all pairs of a factor at "
        "once. Levels differ if their interval excludes zero.",
        lambda a: "Differences of pairs of levels with simultaneous intervals",
    ),
    Figure(
        "interactions", drawings.later("plot_interactions"), _of,
        lambda a: f"Interactions: mean {a.quantity} at pairs of levels. Lines that are not "
        "parallel show an interaction.",
        lambda a: "Interaction plots of pairs of factors",
        lambda a: len(a.factors) > 1,
    ),
)  # fmt: skip
"""The figures of a grid."""
