"""The numbers and tables of an analysed experiment with factors of any number of levels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
import pandas as pd

from ..study.design import Level
from .linear import SumsType
from .model import Term, term_name
from .options import Seeding, Transform

RUNAWAY = 50.0
"""Of the median: a run beyond is told, however few there are."""


@dataclass(frozen=True, eq=False)
class GeneralAnalysis:
    """The numbers of an analysed experiment with factors of any number of levels.

    Attributes
    ----------
    response, unit, transform
        The analysed quantity. With ``log`` it is the natural logarithm; differences are then
        logarithms of ratios.
    levels
        Levels of each factor that have runs, in their order.
    terms, typ
        The model without its mean, as indices of the factors, and the type of its sums of squares.
    left_out
        Interactions that were wished but cannot be estimated from the combinations of levels that
        have runs: then the model has main effects alone.
    seeding, confidence
        Whether the runs of a replicate share their noise; of intervals.
    anova
        Per ``source`` (terms, residual, total and others): ``df``, ``sum_sq``, ``mean_sq``, ``F``,
        ``p``; see `sblcosim.analysis.variance.anova_table`.
    means
        Marginal means, each combination of the other factors' levels counted once: ``factor``,
        ``level``, ``runs``, ``lost`` (share of the table's runs that are lost or have no finite
        response), ``mean``, ``std_error``, ``df``, ``low``, ``high`` (interval of this mean alone;
        NaN if it would reach below zero though no run does: it is not known then).
    cells
        The same for each two factors: ``first``, ``second``, ``first_level``, ``second_level`` …
    pairs
        Differences of the levels of each factor: ``factor``, ``one``, ``other``, ``difference``
        (of one's mean less other's), ``std_error``, ``df``, ``t``, ``p`` (adjusted), ``low``,
        ``high`` (intervals that hold for all pairs of the factor at once); ``ratio``,
        ``ratio_low``, ``ratio_high`` for logarithms; ``median_difference``, ``median_low``,
        ``median_high`` of the response itself (with common random numbers the median of the
        differences within a replicate, see `sblcosim.analysis.medians.median_pairs`); ``differs``,
        judged by medians where means cannot be trusted (`by_medians`).
    runs, combinations, dropped
        Runs that were analysed, combinations of levels that they are of, and runs left out because
        their response is not finite (or, with common random numbers, their replicate incomplete).
    df, rmse, r2
        Degrees of freedom and root of the residual mean square; share of the sum of squares that
        the model explains.
    spread
        Smallest and largest standard deviation of the combinations that have two runs or more.
    far, far_log
        Share of the runs more than 5 robust standard deviations from the median of their
        combination, of the response and of its logarithm; NaN if no combination has 10 runs.
    heavy
        Whether these are so many that the tails are heavy.
    skewness
        Of the runs about the mean of their combination; NaN as `far`.
    fewest, runs_needed
        Runs at the level that has the fewest, and as many as it takes to have seen a bad run at
        every level if 1 in 20 is one.
    empty
        Levels without any run that counts.
    units
        Of the factors, for texts.
    medians
        Of all runs at each level, of the response itself whatever is analysed: ``factor``,
        ``level``, ``median``, ``low``, ``high``; see `sblcosim.analysis.medians.median_table`.
    practical
        Smallest difference that matters, with ``log`` a ratio; None: none was said. With it `pairs`
        has ``verdict``: ``equal`` (the interval is within ±practical), ``differs`` (it is
        beyond), ``undecided``.
    worst_run
        Which run has the `largest`, if that is known.
    labels, label
        Names for people to read, of the factors and of the response, if they have any.
    measured_in
        Unit of the response itself, whatever is analysed.
    largest, median
        Of the response itself.
    """

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
        """`means` on the scale of the response: of logarithms, geometric means."""
        if self.transform != "log":
            return self.means
        return self.means.assign(
            **{name: np.exp(self.means[name]) for name in ("mean", "low", "high")}
        )

    @property
    def mean_of(self) -> str:
        """What `own_means` are, with their unit."""
        unit = f" [{self.measured_in}]" if self.measured_in else ""
        return f"{'Geometric mean' if self.transform == 'log' else 'Mean'} {self.response}{unit}"

    @property
    def shown_of(self) -> str:
        """What stands first: medians where means cannot be trusted, with their unit."""
        unit = f" [{self.measured_in}]" if self.measured_in else ""
        return f"Median {self.response}{unit}" if self.by_medians else self.mean_of

    @property
    def ran_away(self) -> bool:
        """Whether a single run is so far beyond the median that means rest on it."""
        return self.transform == "none" and 0 < RUNAWAY * self.median < self.largest

    @property
    def by_medians(self) -> bool:
        """Whether means cannot be trusted: heavy tails, a runaway, intervals not known."""
        unknown = bool(self.means["low"].isna().any())
        return self.transform == "none" and (self.heavy or self.ran_away or unknown)

    @property
    def judged_pairs(self) -> pd.DataFrame:
        """`pairs` with the ``difference``, ``low`` and ``high`` that they are judged by."""
        if not self.by_medians:
            return self.pairs
        medians = {name: self.pairs[f"median_{name}"] for name in ("difference", "low", "high")}
        return self.pairs.assign(**medians, p=np.nan)

    @property
    def within_replicates(self) -> bool:
        """Whether pairs are judged by medians of differences, not by differences of medians."""
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
    def readable(self) -> Self:
        """The same with `labels` and `label` instead of the columns' names, for people."""
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
