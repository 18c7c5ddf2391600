"""The numbers and tables of an analysed factorial experiment, and looking things up in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
import pandas as pd
from scipy import stats

from .model import ALIAS_ORDER, Term, term_name, terms_up_to
from .noise import FTest, Lenth
from .options import Error, Method, Seeding, Transform


@dataclass(frozen=True, eq=False)
class Analysis:
    """The numbers of an analysed factorial experiment.

    Attributes
    ----------
    response, unit, transform
        The analysed quantity. With ``log`` it is the natural logarithm, with ``spread`` that of the
        standard deviation over the replicates of a point; effects are then differences of
        logarithms.
    levels
        Low and high level of each factor, in its own unit.
    terms
        The model without its mean, as indices of the factors.
    method, seeding, confidence
        Where the uncertainties come from, and the confidence of intervals and reference lines.
    error, sigma, df
        Source of the error of the effects: ``pure``, the scatter between replicates, or
        ``residual``, with lack of fit in it; its standard deviation of a single run; and its
        degrees of freedom, those of t. With Lenth's method there is neither: None and NaN. With
        common random numbers each effect has a scatter of its own: ``pure`` and NaN.
    practical
        Smallest effect that matters, in units of the effects; None if not given.
    effects
        One row per term: ``order``, ``coefficient``, ``effect``, ``std_error`` (of the effect),
        ``t``, ``p``, ``low``, ``high`` (confidence interval), ``share`` (of the total sum of
        squares), ``significant``; ``ratio``, ``ratio_low``, ``ratio_high`` (high over low) for
        logarithms; ``verdict`` (``matters``, ``too small``, ``undecided``) if `practical` is given.
    anova
        Sums of squares, one row per term, then curvature, residual with its parts lack of fit and
        pure error, and total. With common random numbers each term has its own error, and the
        residual is less the replicates' means, which have a row.
    runs, dropped
        Runs that were analysed, and those left out because their response is not finite (or, with
        common random numbers, because their replicate is incomplete).
    rmse
        Root of the residual mean square, lack of fit in it; NaN if nothing is left for it.
    r2, r2_adjusted, r2_predicted, press
        Of the model over single runs. For the last two each run (with common random numbers: each
        replicate) is predicted from the others.
    lack_of_fit, curvature
        Tests, None where there is nothing to test. With common random numbers lack of fit is
        tested over the replicates with Greenhouse and Geisser's degrees of freedom.
    lenth
        Where no degrees of freedom are left.
    overall_mean
        Mean over the design points, without centre points.
    points
        The design points: factors, ``runs``, ``mean``, ``std``, ``fit``.
    main_effects
        Mean at each level: ``factor``, ``level``, ``value``, ``mean``.
    interactions
        Mean of each pair of levels: ``first``, ``second``, ``first_value``, ``second_value``,
        ``mean``.
    residuals
        One row per run: ``fit``, ``residual``, ``standardised``, ``run_order``.
    aliases
        Terms outside of the model, up to order 3, that the design cannot tell from those in it.
    replicate_effects
        Effects of each replicate, one column per term; None unless `method` is ``replicates``.
    table
        The runs: factors, response (transformed), replicate and run order as far as they exist.
    units
        Of the factors, for texts.
    reduced
        Whether interactions are left out because the design points cannot tell them apart.
    labels, label
        Names for people to read, of the factors and of the response, if they have any.
    """

    response: str
    unit: str
    transform: Transform
    levels: Mapping[str, tuple[float, float]]
    terms: tuple[Term, ...]
    method: Method
    seeding: Seeding
    error: Error | None
    sigma: float
    confidence: float
    practical: float | None
    effects: pd.DataFrame
    anova: pd.DataFrame
    runs: int
    dropped: int
    df: float
    rmse: float
    r2: float
    r2_adjusted: float
    r2_predicted: float
    press: float
    lack_of_fit: FTest | None
    curvature: FTest | None
    lenth: Lenth | None
    overall_mean: float
    points: pd.DataFrame
    main_effects: pd.DataFrame
    interactions: pd.DataFrame
    residuals: pd.DataFrame
    aliases: Mapping[str, tuple[str, ...]]
    replicate_effects: pd.DataFrame | None
    table: pd.DataFrame
    units: Mapping[str, str] = field(default_factory=dict)
    reduced: bool = False
    labels: Mapping[str, str] = field(default_factory=dict)
    label: str = ""

    @property
    def factors(self) -> tuple[str, ...]:
        """Names of the factors."""
        return tuple(self.levels)

    @property
    def quantity(self) -> str:
        """The analysed quantity in words."""
        word = {"none": "", "log": "ln ", "spread": "ln s of "}[self.transform]
        return f"{word}{self.response}"

    @property
    def readable(self) -> Self:
        """The same with `labels` and `label` instead of the columns' names, for people."""
        return self.named(self.labels, None, self.label or None)

    @property
    def reference(self) -> float:
        """The t beyond which an effect is significant: t(1−α/2, df)."""
        return float(stats.t.ppf((1 + self.confidence) / 2, self.df))

    def named(
        self,
        labels: Mapping[str, str],
        units: Mapping[str, str] | None = None,
        response: str | None = None,
    ) -> Self:
        """The same for people to read: other names for factors and response.

        Parameters
        ----------
        labels
            By factor; the others keep their names.
        units
            Of the factors, by their old names.
        response
            New name.
        """
        names = {name: labels.get(name, name) for name in self.factors}
        new = tuple(names.values())
        terms = {
            term_name(term, self.factors): term_name(term, new)
            for term in (*terms_up_to(ALIAS_ORDER, len(new)), *self.terms)
        }
        terms |= {f"−{old}": f"−{name}" for old, name in terms.items()}
        response = self.response if response is None else response
        return replace(
            self,
            response=response,
            levels={names[name]: level for name, level in self.levels.items()},
            effects=self.effects.rename(index=terms),
            anova=self.anova.rename(index=terms),
            points=self.points.rename(columns=names),
            main_effects=self.main_effects.replace({"factor": names}),
            interactions=self.interactions.replace({"first": names, "second": names}),
            aliases={
                terms.get(term, term): tuple(terms.get(other, other) for other in same)
                for term, same in self.aliases.items()
            },
            replicate_effects=None if self.replicate_effects is None
            else self.replicate_effects.rename(columns=terms),
            table=self.table.rename(columns=names | {self.response: response}),
            units={names[name]: unit for name, unit in (units or self.units).items()},
            labels={},
            label="",
        )

    def ranked(self) -> pd.DataFrame:
        """The effects, the largest first."""
        return self.effects.sort_values("effect", key=np.abs, ascending=False, kind="stable")
