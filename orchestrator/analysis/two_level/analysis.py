"""Two-level factorial analysis: which factors change a response, by how much, and how surely.

The model is linear in coded units, −1 for a factor's low level and +1 for its high level (the
paper's section 5.1; Montgomery, Design and Analysis of Experiments, 8th edition, chapters 6 to 8).
An effect is the change of the mean from low to high, which is twice the coefficient. Its
uncertainty comes from one of three methods:

``ols``
    Ordinary least squares: every run has noise of its own. If points have several runs, the error
    is the scatter of the runs about their points' means, the *pure error*. The scatter about the
    model, the *residual*, also includes what the model leaves out, such as interactions of three
    factors. Its intervals are therefore too wide.
``replicates``
    Common random numbers: the runs of a replicate share their noise, so their errors are not
    independent, and least squares does not apply. Effects are computed in each replicate. Their
    scatter over the replicates is the error; each effect has its own.
``lenth``
    No degrees of freedom are left for the error: Lenth's pseudo standard error, from the effects
    themselves (Technometrics 31, 1989, 469–473).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import pandas as pd
from scipy import stats

from ... import artifacts
from ...answer import Answer
from ...catalogue import Figure, Job, by_name, jobs
from ...lazy import Module
from ...shown import Picture, folded, page, verbatim
from ...words.numbers import rounded
from ..common.model import (
    ALIAS_ORDER,
    Term,
    TwoLevelModel,
    checked_levels,
    chosen_terms,
    estimable,
    term_name,
    terms_up_to,
)
from ..common.options import Error, Method, Options, Seeding, Transform
from ..common.runs import check_columns, transformed, usable
from .effects import (
    anova_table,
    effect_table,
    interaction_table,
    main_effect_table,
    point_table,
)
from .fit import (
    LeastSquares,
    Uncertainty,
    curvature,
    from_replicates,
    from_runs,
    least_squares,
    residual_table,
)
from .noise import FTest, Lenth
from .tables import ANOVA, EFFECTS, INTERACTIONS, MAIN_EFFECTS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ...style import ThemeName

sentences: Any = Module("sblcosim.analysis.two_level.sentences")
drawings: Any = Module("sblcosim.analysis.two_level.figures")

MOST_BARS = 20
"""Most effects in a Pareto chart."""


@dataclass(frozen=True, eq=False, repr=False)
class Factorial(Answer):
    """The numbers of an analysed factorial experiment.

    Attributes
    ----------
    response, unit, transform
        The analysed quantity. With ``log`` it is the natural logarithm, with ``spread`` the natural
        logarithm of the standard deviation over the replicates of a point. Effects are then
        differences of logarithms.
    levels
        Low and high level of each factor, in its own unit.
    terms
        Terms of the model except the mean, as indices of the factors.
    method, seeding, confidence
        Source of the uncertainties; whether the runs of a replicate share their noise; confidence
        of intervals and reference lines.
    error, sigma, df
        Source of the error of the effects: ``pure``, the scatter between replicates, or
        ``residual``, which includes lack of fit; standard deviation of a single run; degrees of
        freedom of the error and of t. With Lenth's method, error and standard deviation are None
        and NaN. With common random numbers, each effect has a scatter of its own: ``pure`` and NaN.
    practical
        Smallest effect that matters, in units of the effects; None if not given.
    effects
        One row per term: ``order``, ``coefficient``, ``effect``, ``std_error`` of the effect,
        ``t``, ``p``, ``low`` and ``high`` (confidence interval), ``share`` of the total sum of
        squares, ``significant``; ``ratio``, ``ratio_low``, ``ratio_high`` (high to low) for
        logarithms; ``verdict`` (``matters``, ``too small``, ``undecided``) if `practical` is given.
    anova
        Sums of squares, one row per term, then curvature, residual with its parts lack of fit and
        pure error, and total. With common random numbers, each term has its own error, and the
        replicates' means have a row, which the residual excludes.
    runs, dropped
        Number of analysed runs, and of runs that are left out because their response is not finite
        or, with common random numbers, their replicate is incomplete.
    rmse
        Residual standard deviation, which includes lack of fit; NaN if no degrees of freedom are
        left.
    r2, r2_adjusted, r2_predicted, press
        Fit of the model to single runs. For the last two, each run (with common random numbers,
        each replicate) is predicted from the others.
    lack_of_fit, curvature
        Tests; None where there is nothing to test. With common random numbers, lack of fit is
        tested over the replicates with Greenhouse and Geisser's degrees of freedom.
    lenth
        Lenth's margins, if no degrees of freedom are left; otherwise None.
    overall_mean
        Mean over the design points except centre points.
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
        Terms that the model lacks, up to order 3, and that the design cannot tell apart from its
        terms.
    replicate_effects
        Effects of each replicate, one column per term; None unless `method` is ``replicates``.
    table
        The runs: factors, transformed response, replicate and run order, if they exist.
    units
        Units of the factors, for texts.
    reduced
        Whether interactions are left out because the design points cannot tell them apart.
    labels, label
        Labels of the factors and of the response, for people, if they have any.
    """

    columns = MappingProxyType({
        "effects": EFFECTS, "anova": ANOVA, "main_effects": MAIN_EFFECTS,
        "interactions": INTERACTIONS,
    })  # fmt: skip

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
    def title(self) -> str:
        """Title of a page."""
        return f"Effects on {self.readable.quantity}"

    @property
    def answer(self) -> str:
        """The effects that matter, in a few sentences."""
        return str(sentences.answer(self.readable))

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """Effects, their variance, and means."""
        return {
            "effects": self.effects.reset_index(), "anova": self.anova.reset_index(),
            "main_effects": self.main_effects.reset_index(),
            "interactions": self.interactions.reset_index(),
        }

    @property
    def figures(self) -> list[Job]:
        """The four figures of the paper (15 to 18)."""
        return jobs(FIGURES, self.readable)

    @property
    def remarks(self) -> list[str]:
        """Remarks that are needed to read the numbers, one line each."""
        found: list[str] = sentences.notes(self.readable)
        return found

    def to_json(self) -> dict[str, Any]:
        """The effects, the largest first, as plain data."""
        effects = self.ranked().rename_axis("term").reset_index()
        plain: dict[str, Any] = artifacts.plain({
            "response": self.response, "unit": self.unit, "answer": self.answer,
            "transform": self.transform, "method": self.method, "confidence": self.confidence,
            "runs": self.runs, "dropped": self.dropped, "r2": self.r2,
            "effects": EFFECTS.rows(effects), "notes": self.remarks,
        })  # fmt: skip
        return plain

    def manifest(self) -> dict[str, Any]:
        """The question and the method."""
        return {
            "analysis": {
                "response": self.response, "factors": list(self.factors),
                "method": self.method, "error": self.error, "transform": self.transform,
                "order": int(self.effects["order"].max()), "practical": self.practical,
            }
        }

    @property
    def readable(self) -> Self:
        """A copy with `labels` and `label` instead of the names of columns, for people."""
        return self.named(self.labels, None, self.label or None)

    @property
    def reference(self) -> float:
        """The ``|t|`` above which an effect is significant: t(1−α/2, df)."""
        return float(stats.t.ppf((1 + self.confidence) / 2, self.df))

    def named(
        self,
        labels: Mapping[str, str],
        units: Mapping[str, str] | None = None,
        response: str | None = None,
    ) -> Self:
        """A copy with other names for factors and response, for people.

        Parameters
        ----------
        labels
            New names of factors; others keep their names.
        units
            Units of the factors, by their old names.
        response
            New name of the response.
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

    def text(self, *, verbose: bool = False, width: int | None = None, most: int = 12) -> str:
        """The answer, then the `most` largest effects.

        Parameters
        ----------
        verbose
            Add standard errors, t and p, and the method.
        width
            Columns to fit into; None: sentences are not wrapped.
        """
        text: str = sentences.summary(self.readable, most, verbose, width, self.response)
        return text

    def _gist(self) -> str:
        largest = ", ".join(
            f"{name} {effect:+.3g}" for name, effect in self.readable.ranked()["effect"][:3].items()
        )
        return f"of {self.runs} runs, effects on {self.response}: {largest}, …"

    def _repr_html_(self) -> str:
        shown = self.readable
        table = shown.ranked().to_html(float_format="{:.4g}".format, border=0)
        notes = "\n".join(sentences.notes(shown))
        return page(
            self.title,
            f"<p>{escape(self.answer)}</p>",
            table,
            folded("How to read the numbers", verbatim(notes)),
        )

    def plot_pareto(self, ax: Axes | None = None, theme: ThemeName = "light") -> Picture:
        """See `sblcosim.analysis.two_level.figures.plot_pareto`."""
        return Picture(drawings.plot_pareto(self.readable, ax, theme), ax)

    def plot_interactions(self, ax: Axes | None = None, theme: ThemeName = "light") -> Picture:
        """See `sblcosim.analysis.two_level.figures.plot_interactions`."""
        return Picture(drawings.plot_interactions(self.readable, ax, theme), ax)

    def plot_main_effects(self, ax: Axes | None = None, theme: ThemeName = "light") -> Picture:
        """See `sblcosim.analysis.two_level.figures.plot_main_effects`."""
        return Picture(drawings.plot_main_effects(self.readable, ax, theme), ax)

    def plot_residuals(self, ax: Axes | None = None, theme: ThemeName = "light") -> Picture:
        """See `sblcosim.analysis.two_level.figures.plot_residuals`."""
        return Picture(drawings.plot_residuals(self.readable, ax, theme), ax)

    def plot_box_cox(self, ax: Axes | None = None, theme: ThemeName = "light") -> Picture:
        """See `sblcosim.analysis.two_level.figures.plot_box_cox`."""
        return Picture(drawings.plot_box_cox(self.readable, ax, theme), ax)


def analyse(
    table: pd.DataFrame,
    factors: Sequence[str],
    response: str,
    *,
    order: int | None = None,
    terms: Sequence[str | Sequence[str]] | None = None,
    levels: Mapping[str, tuple[float, float]] | None = None,
    seeding: Seeding = "independent",
    transform: Transform = "none",
    error: Error = "pure",
    practical: float | None = None,
    confidence: float = 0.95,
    unit: str = "",
    replicate: str = "replicate",
    run_order: str = "run_order",
) -> Factorial:
    """Analyse a two-level factorial experiment, full or fractional, with or without centre points.

    Parameters
    ----------
    table
        One row per run: the factors' levels in their own units, the response, and optionally the
        columns `replicate` and `run_order`. Rows without a finite response are left out.
    factors, response
        Columns.
    order
        The model has interactions of up to this many factors. Default: two, or none if the design
        points cannot tell the interactions apart.
    terms
        Terms of the model, instead of an order: factors, and interactions as sequences of factors
        or with their names in the analysis, ``A × B``.
    levels
        Low and high level of each factor; default: the smallest and the largest in the table.
    seeding
        ``common`` if the runs of a replicate share their random numbers.
    transform
        ``log`` analyses the natural logarithm of the response, ``spread`` that of its standard
        deviation over the runs of each point.
    error
        Source of the error: ``pure``, the scatter between replicates (or about the model, if there
        are none), or ``residual``, the scatter about the model, which includes its lack of fit.
    practical
        Smallest effect that matters, in the unit of the response; with a transform, a ratio
        above 1.
    confidence
        Confidence of intervals and of the reference line.
    unit
        Unit of the response, for texts.
    replicate, run_order
        Names of these columns. A missing run order is drawn, the same every time.

    Raises
    ------
    ConfigurationError
        A column or a level is invalid, or the design cannot estimate the model. The message names
        the terms that it cannot tell apart.
    """
    factors = tuple(factors)
    check_columns(table, factors, response)
    options = Options(
        seeding=seeding, transform=transform, error=error, practical=practical,
        confidence=confidence, unit=unit, replicate=replicate, run_order=run_order,
    )
    chosen = chosen_terms(factors, order, terms)
    data = usable(table, factors, response, options)
    dropped = len(table) - len(data)
    data, analysed = transformed(data, factors, response, options)
    bounds = checked_levels(data, factors, levels)
    model = estimable(data, bounds, chosen, order, reducible=order is None and terms is None)
    fit = least_squares(analysed, model)
    if seeding == "common":
        uncertainty = from_replicates(fit, model, data[replicate])
    else:
        uncertainty = from_runs(fit, model, options)
    return _assembled(response, data, dropped, options, model, fit, uncertainty)


def _assembled(
    response: str,
    data: pd.DataFrame,
    dropped: int,
    options: Options,
    model: TwoLevelModel,
    fit: LeastSquares,
    uncertainty: Uncertainty,
) -> Factorial:
    """All tables of a fitted model."""
    effects = effect_table(fit, uncertainty, model, options)
    bend = curvature(fit, uncertainty, model)
    points = point_table(fit, model)
    means = points["mean"].to_numpy()
    spare, total = fit.spare, fit.total
    return Factorial(
        response=response,
        unit="" if options.is_ratio else options.unit,
        transform=options.transform,
        levels=model.levels,
        terms=model.terms,
        method=uncertainty.method,
        seeding=options.seeding,
        error=uncertainty.error,
        sigma=uncertainty.sigma,
        confidence=options.confidence,
        practical=options.limit,
        effects=effects,
        anova=anova_table(effects, fit, uncertainty, model, bend),
        runs=len(data),
        dropped=dropped,
        df=uncertainty.df,
        rmse=fit.rmse,
        r2=1 - fit.ssr / total,
        r2_adjusted=1 - (fit.ssr / spare) / (total / (len(data) - 1)) if spare else np.nan,
        r2_predicted=1 - uncertainty.press / total,
        press=uncertainty.press,
        lack_of_fit=uncertainty.lack_of_fit,
        curvature=bend,
        lenth=uncertainty.lenth,
        overall_mean=float(points.loc[~model.centre, "mean"].mean()),
        points=points,
        main_effects=main_effect_table(model.points, means, model.levels),
        interactions=interaction_table(model.points, means, model.levels),
        residuals=residual_table(fit, uncertainty, data.get(options.run_order)),
        aliases=model.aliases,
        replicate_effects=uncertainty.replicate_effects,
        table=data,
        reduced=model.reduced,
    )


# --- Figures -------------------------------------------------------------------------------------


def _analysis(analysis: Factorial) -> tuple[Factorial]:
    return (analysis,)


def _pareto(a: Factorial) -> str:
    count, shown = len(a.effects), min(len(a.effects), MOST_BARS)
    part = f"the {shown} largest of {count} effects" if shown < count else f"all {count} effects"
    if a.lenth is None:
        return (f"Pareto chart of the standardised effects |t|, {part}. Bars that cross the line "
                "are significant. Hatched bars are negative effects.")
    own = f" in {a.unit}" if a.unit else ""
    return (f"Pareto chart of the size of the effects{own}, {part}. A bar that crosses the margin "
            "of error (ME) is significant on its own. A bar that crosses the simultaneous margin "
            "(SME) is significant among all effects. Hatched bars are negative effects.")


def _largest(a: Factorial) -> str:
    top = ", ".join(map(str, a.ranked().index[:3]))
    return f"Pareto chart; the largest effects are {top}"


FIGURES: Mapping[str, Figure[Factorial]] = by_name(
    Figure("pareto", drawings.later("plot_pareto"), _analysis, _pareto, _largest),
    Figure(
        "main_effects", drawings.later("plot_main_effects"), _analysis,
        lambda f: f"Main effects: mean {f.quantity} at both levels of each factor"
        f"{', with its interval' if f.replicate_effects is None else ''}, "
        "and overall mean.",
        lambda f: f"Main effects; overall mean {rounded(f.overall_mean)}"
        f"{f.unit and f' {f.unit}'}",
    ),
    Figure(
        "interactions", drawings.later("plot_interactions"), _analysis,
        lambda f: f"Interactions: mean {f.quantity} at each pair of levels. "
        "Lines that are not parallel show an interaction.",
        lambda f: "Matrix of interaction plots, one for each pair of factors",
        lambda f: len(f.factors) > 1,
    ),
    Figure(
        "residuals", drawings.later("plot_residuals"), _analysis,
        lambda f: "Residuals: normal probability, histogram, against fitted values, and against "
        "the random run order.",
        lambda f: "Four plots of the residuals",
    ),
)  # fmt: skip
