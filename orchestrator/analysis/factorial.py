"""Two-level factorial analysis: which factor changes a response, by how much, and how surely.

The model is a linear one in coded units, −1 for a factor's low level and +1 for its high level
(the paper's section 5.1; Montgomery, Design and Analysis of Experiments, 8th edition, chapters 6
to 8). An effect is the change of the mean from low to high, twice the coefficient. Three ways lead
to its uncertainty:

``ols``
    Ordinary least squares: every run has noise of its own. Where points have several runs, the
    error is the scatter of the runs about their points' means, the *pure error*. The scatter about
    the model, the *residual*, also holds what the model leaves out, such as interactions of three
    factors: intervals from it are wider than they say.
``replicates``
    Common random numbers: the runs of a replicate share their noise, so that errors are not
    independent, and least squares is wrong about them. Effects are taken in each replicate, and
    their scatter over the replicates is the error; each has its own.
``lenth``
    No degrees of freedom are left for the error: Lenth's pseudo standard error, from the effects
    themselves (Technometrics 31, 1989, 469–473).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from ..shown import Picture, Shown, folded, page, verbatim
from . import sentences
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
from .model import TwoLevelModel, checked_levels, chosen_terms, estimable
from .options import Error, Options, Seeding, Transform
from .runs import check_columns, transformed, usable
from .tables import Analysis

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..style import ThemeName


@dataclass(frozen=True, eq=False, repr=False)
class Factorial(Shown, Analysis):
    __doc__ = Analysis.__doc__  # the class that users see

    def text(self, *, verbose: bool = False, width: int | None = None, most: int = 12) -> str:
        """The analysis in words: the answer, then the `most` largest effects.

        Parameters
        ----------
        verbose
            With standard errors, t and p, and how it was analysed.
        width
            Columns to fit into; None: sentences are not wrapped.
        """
        return sentences.summary(self.readable, most, verbose, width, self.response)

    def __str__(self) -> str:
        return self.text()

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
            f"Effects on {shown.quantity}",
            f"<p>{escape(sentences.answer(shown))}</p>",
            table,
            folded("How to read the numbers", verbatim(notes)),
        )

    def plot_pareto(self, ax: Axes | None = None, theme: ThemeName = "light") -> Picture:
        """See `sblcosim.analysis.figures.plot_pareto`."""
        from . import figures  # loads Matplotlib

        return Picture(figures.plot_pareto(self.readable, ax, theme), ax)

    def plot_interactions(self, ax: Axes | None = None, theme: ThemeName = "light") -> Picture:
        """See `sblcosim.analysis.figures.plot_interactions`."""
        from . import figures  # loads Matplotlib

        return Picture(figures.plot_interactions(self.readable, ax, theme), ax)

    def plot_main_effects(self, ax: Axes | None = None, theme: ThemeName = "light") -> Picture:
        """See `sblcosim.analysis.figures.plot_main_effects`."""
        from . import figures  # loads Matplotlib

        return Picture(figures.plot_main_effects(self.readable, ax, theme), ax)

    def plot_residuals(self, ax: Axes | None = None, theme: ThemeName = "light") -> Picture:
        """See `sblcosim.analysis.figures.plot_residuals`."""
        from . import figures  # loads Matplotlib

        return Picture(figures.plot_residuals(self.readable, ax, theme), ax)

    def plot_box_cox(self, ax: Axes | None = None, theme: ThemeName = "light") -> Picture:
        """See `sblcosim.analysis.figures.plot_box_cox`."""
        from . import figures  # loads Matplotlib

        return Picture(figures.plot_box_cox(self.readable, ax, theme), ax)


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
        One row per run: the factors' levels in their own units, the response, and perhaps the
        columns `replicate` and `run_order`. Rows without a finite response are left out.
    factors, response
        Columns.
    order
        Interactions of up to so many factors are in the model; without it of two, or none if the
        design points cannot tell those apart.
    terms
        The model itself instead: factors, and interactions as sequences of factors or as the
        analysis names them, ``A × B``.
    levels
        Low and high level of each factor; without it they are the smallest and largest of the
        table.
    seeding
        ``common`` if the runs of a replicate share their random numbers.
    transform
        ``log`` analyses the natural logarithm of the response, ``spread`` that of its standard
        deviation over the runs of each point.
    error
        Of the effects: ``pure``, the scatter between replicates (where there are none, that about
        the model), or ``residual``, the scatter about the model, which holds its lack of fit, too.
    practical
        Smallest effect that matters, in the unit of the response; with a transform a ratio
        above 1.
    confidence
        Of intervals and of the reference line.
    unit
        Of the response, for texts.
    replicate, run_order
        Names of these columns. Without a run order one is drawn, the same every time.

    Raises
    ------
    ConfigurationError
        A column or a level is not as it must be, or the design cannot estimate the model; the
        terms that cannot be told apart are named.
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
