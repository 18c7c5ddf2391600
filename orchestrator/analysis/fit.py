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

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from itertools import combinations
from math import log
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import optimize, stats

from ..errors import ConfigurationError, check_choice, nearest
from ..study.design import TIMES

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..style import ThemeName

Floats = NDArray[np.float64]
Seeding = Literal["independent", "common"]
Transform = Literal["none", "log", "spread"]
Error = Literal["pure", "residual"]
Method = Literal["ols", "replicates", "lenth"]
Term = tuple[int, ...]
"""Places of a term's factors, ascending; the mean is the empty one."""

CURVATURE = "curvature"
TOLERANCE = 1e-6
"""How far a level may be from the stated one, in coded units."""
ROUNDING = 1e-12
"""What is smaller than the response by this factor comes from rounding: it is nothing."""
ALIAS_ORDER = 3
"""Interactions beyond this order are not looked for among the aliases."""
NAMED = 8
"""Aliases that a message names."""


@dataclass(frozen=True, slots=True)
class FTest:
    """An F test.

    Attributes
    ----------
    estimate
        What is tested, if it is a single number; else NaN.
    ss
        Its sum of squares.
    df, df_error
        Degrees of freedom; not whole numbers where they are corrected.
    f, p
        Statistic, and probability of a larger one if there is nothing.
    """

    estimate: float
    ss: float
    df: float
    df_error: float
    f: float
    p: float


@dataclass(frozen=True, slots=True)
class Lenth:
    """Lenth's pseudo standard error, margin of error and simultaneous margin of error.

    All in units of an effect; `df` belongs to the margins.
    """

    pse: float
    me: float
    sme: float
    df: float


@dataclass(frozen=True, eq=False)
class Factorial:
    """An analysed factorial experiment.

    Attributes
    ----------
    response, unit, transform
        What was analysed. With ``log`` it is the natural logarithm, with ``spread`` that of the
        standard deviation over the replicates of a point; effects are then differences of
        logarithms.
    levels
        Low and high level of each factor, in its own unit.
    terms
        The model without its mean, as places of the factors.
    method, seeding, confidence
        How uncertainties were found, and the confidence of intervals and reference lines.
    error, sigma, df
        What was taken for the error of the effects: ``pure``, the scatter between replicates, or
        ``residual``, with lack of fit in it; its standard deviation of a single run; and its
        degrees of freedom, those of t. With Lenth's method there is neither: None and NaN. With
        common random numbers each effect has a scatter of its own: ``pure`` and NaN.
    practical
        Smallest effect that matters, in units of the effects; None if nobody said.
    effects
        One row per term: ``order``, ``coefficient``, ``effect``, ``std_error`` (of the effect),
        ``t``, ``p``, ``low``, ``high`` (confidence interval), ``share`` (of the total sum of
        squares), ``significant``; ``ratio``, ``ratio_low``, ``ratio_high`` (high over low) for
        logarithms; ``verdict`` (``matters``, ``too small``, ``open``) if `practical` is given.
    anova
        Sums of squares, one row per term, then curvature, residual with its parts lack of fit and
        pure error, and total. With common random numbers each term has its own error, and the
        residual is less the replicates' means, which have a row.
    runs, dropped
        Runs that were analysed, and those left out for want of a finite response (or, with common
        random numbers, for want of the rest of their replicate).
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
        What people read for the factors and for the response, as far as it is something else.
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
        """What the effects are effects on."""
        word = {"none": "", "log": "ln ", "spread": "ln s of "}[self.transform]
        return f"{word}{self.response}"

    @property
    def readable(self) -> Factorial:
        """The same with `labels` and `label` in place of the columns' names; texts and pictures
        are made of it."""
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
    ) -> Factorial:
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
            _name(term, self.factors): _name(term, new)
            for n in range(1, ALIAS_ORDER + 1)
            for term in combinations(range(len(new)), n)
        } | {_name(term, self.factors): _name(term, new) for term in self.terms}
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

    def summary(self, most: int = 12) -> str:
        """The analysis in words, with the `most` largest effects."""
        return self.readable._summary(most)

    def _summary(self, most: int) -> str:
        columns = ["effect", "std_error", "low", "high", "t", "p", "share"]
        columns += [c for c in ("ratio", "verdict") if c in self.effects]
        shown = self.ranked()[columns].head(most)
        formats: dict[Any, Any] = dict.fromkeys([*columns, "ratio"], "{:.4g}".format)
        formats |= {"share": percent, "p": _p, "t": "{:.2f}".format}
        formats.pop("verdict", None)
        rest = len(self.effects) - len(shown)
        lines = [
            f"Effects on {self.quantity}",
            answer(self),
            "",
            shown.to_string(formatters=formats, index_names=False),
            *([f"and {rest} smaller"] if rest else []),
            "",
            *_notes(self),
        ]
        return "\n".join(lines)

    def __str__(self) -> str:
        return self.summary()

    def _repr_html_(self) -> str:
        shown = self.readable
        table = shown.ranked().to_html(float_format="{:.4g}".format)
        notes = "\n".join(_notes(shown))
        return (
            f"<h3>Effects on {escape(shown.quantity)}</h3><p>{escape(answer(shown))}</p>{table}"
            f"<pre>{escape(notes)}</pre>"
        )

    def plot_pareto(self, ax: Axes | None = None, theme: ThemeName = "light") -> Axes:
        """See `sblcosim.analysis.figures.plot_pareto`."""
        from . import figures as plots

        return plots.plot_pareto(self.readable, ax, theme)

    def plot_interactions(
        self, ax: Axes | None = None, theme: ThemeName = "light"
    ) -> Sequence[Axes]:
        """See `sblcosim.analysis.figures.plot_interactions`."""
        from . import figures as plots

        return plots.plot_interactions(self.readable, ax, theme)

    def plot_main_effects(self, ax: Axes | None = None, theme: ThemeName = "light") -> Axes:
        """See `sblcosim.analysis.figures.plot_main_effects`."""
        from . import figures as plots

        return plots.plot_main_effects(self.readable, ax, theme)

    def plot_residuals(self, ax: Axes | None = None, theme: ThemeName = "light") -> Sequence[Axes]:
        """See `sblcosim.analysis.figures.plot_residuals`."""
        from . import figures as plots

        return plots.plot_residuals(self.readable, ax, theme)

    def plot_box_cox(self, ax: Axes | None = None, theme: ThemeName = "light") -> Axes:
        """See `sblcosim.analysis.figures.plot_box_cox`."""
        from . import figures as plots

        return plots.plot_box_cox(self.readable, ax, theme)


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
        Names of those columns. Without a run order one is drawn, the same every time.

    Raises
    ------
    ConfigurationError
        A column or a level is not as it must be, or the design cannot estimate the model; the
        terms that cannot be told apart are named.
    """
    factors = tuple(factors)
    check_columns(table, factors, response)
    check_choice("seeding", seeding, get_args(Seeding))
    check_choice("transform", transform, get_args(Transform))
    check_choice("error", error, get_args(Error))
    if seeding == "common" and error != "pure":
        raise ConfigurationError(
            f"error: must be pure with common random numbers, where effects are compared between "
            f"replicates, got {error!r}"
        )
    if not 0 < confidence < 1:
        raise ConfigurationError(f"confidence: must be between 0 and 1, got {confidence}")
    limit = _practical(practical, transform)
    model = _terms(factors, order, terms)
    finite = np.isfinite(table[response].to_numpy(np.float64))
    kept = [*factors, response, *(c for c in (replicate, run_order) if c in table)]
    data = table.loc[finite, kept].reset_index(drop=True).astype({response: np.float64})
    if data.empty:
        raise ConfigurationError(f"{response}: must be finite in some runs, got none")
    if seeding == "common":
        data = _complete(data, factors, replicate)
    dropped = len(table) - len(data)
    if transform == "log":
        if (data[response] <= 0).any():
            raise ConfigurationError(
                f"{response}: must be positive for its logarithm, got {data[response].min():g}"
            )
        data[response] = np.log(data[response])
    elif transform == "spread":
        data = _spread(data, factors, response, replicate, seeding)
    y = data[response].to_numpy(np.float64)
    if np.ptp(y) == 0:
        raise ConfigurationError(f"{response}: must vary over the runs, got {y[0]:g} in all")

    bounds = _levels(data, factors, levels)
    coded = _coded(data, bounds)
    x = _matrix(coded, model)
    centre = _centre(coded)
    extra = [CURVATURE] if centre.any() else []
    reduced = order is None and terms is None and _rank(x) < x.shape[1]
    if reduced:
        model = _terms(factors, 1, None)
        x = _matrix(coded, model)
    names = [_name(term, factors) for term in model]
    try:
        _check_estimable(x, ["mean", *names, *extra])
    except ConfigurationError as problem:
        alone = _matrix(coded, _terms(factors, 1, None))
        if order is None or _rank(alone) < alone.shape[1]:
            raise
        raise ConfigurationError(
            f"{problem}; main effects alone can be told apart: order 1 (--order 1)"
        ) from None
    points, place = np.unique(coded, axis=0, return_inverse=True)
    place = place.reshape(-1)

    from statsmodels.regression.linear_model import OLS

    fit = OLS(y, x).fit()
    fitted = np.asarray(fit.fittedvalues)
    spare = len(y) - x.shape[1]
    least = ROUNDING * float(np.abs(y).max())
    coefficients = _cleared(fit.params, least)
    rmse = float(_cleared(np.sqrt(fit.ssr / spare), least)) if spare else np.nan
    pure, pure_df = _pure_error(y, place), len(y) - len(points)
    used: Error | None = "pure" if error == "pure" and pure_df else "residual"
    sigma = np.nan
    unscaled = np.diag(fit.normalized_cov_params)
    leverage = fit.get_influence().hat_matrix_diag
    total = float(((y - y.mean()) ** 2).sum())
    residual = y - fitted
    per_replicate, blocks = None, 0
    if seeding == "common":
        method: Method = "replicates"
        number = len(y) // len(points)
        if number < 2:
            raise ConfigurationError(
                f"{replicate}: must be at least two complete replicates for common random "
                f"numbers, got {number}"
            )
        # replicate by replicate, the points in the order of `points`
        rows = np.lexsort((place, data[replicate]))
        by_replicate = y[rows].reshape(number, len(points))
        x_point = x[rows[: len(points)]]
        each = by_replicate @ np.linalg.pinv(x_point).T
        errors = _cleared(each.std(axis=0, ddof=1), least) / np.sqrt(number)
        blocks = number - 1
        df = float(blocks)
        per_replicate = pd.DataFrame(
            2 * each[:, 1 : len(model) + 1],
            columns=names,
            index=pd.Index(data[replicate].to_numpy()[rows[:: len(points)]], name=replicate),
        )
        others = (each.sum(axis=0) - each) / (number - 1)
        press = float(((by_replicate - others @ x_point.T) ** 2).sum())
        shift = by_replicate.mean(axis=1) - by_replicate.mean()
        residual[rows] -= np.repeat(shift, len(points))
        lack = _lack_over_replicates(by_replicate, x_point, least)
        lenth_ = None
    else:
        method, df = "ols", float(pure_df if used == "pure" else spare)
        sigma = rmse if used == "residual" else float(_cleared(np.sqrt(pure / df), least))
        errors = sigma * np.sqrt(unscaled)
        with np.errstate(divide="ignore", invalid="ignore"):
            left_out = residual / (1 - leverage)
        alone = leverage > 1 - 1e-9  # a run that its own term follows cannot be predicted
        press = np.nan if alone.any() else float((left_out**2).sum())
        lack = _lack_of_fit(pure, pure_df, len(points) - x.shape[1], fit.ssr, len(y) * least**2)
        lenth_ = None
        if not spare:
            method = "lenth"
            lenth_ = lenth(2 * coefficients[1 : len(model) + 1], confidence)
            df, used = lenth_.df, None
            errors = np.full(x.shape[1], lenth_.pse / 2)

    effects = _effects(names, model, coefficients, errors, df, unscaled, total, confidence, limit)
    if transform != "none":
        for column, source in (("ratio", "effect"), ("ratio_low", "low"), ("ratio_high", "high")):
            effects[column] = np.exp(effects[source])
    curvature = None
    if centre.any() and method != "lenth" and (coefficients[-1] or errors[-1]):
        coefficient, own = coefficients[-1], errors[-1]
        with np.errstate(divide="ignore", invalid="ignore"):
            f = float((coefficient / own) ** 2)
        curvature = FTest(
            float(coefficient), float(coefficient**2 / unscaled[-1]), 1.0, df, f,
            float(stats.f.sf(f, 1, df)),
        )
    ssr = float((residual**2).sum())
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.sqrt(ssr / (spare - blocks)) if spare else np.nan
        standardised = residual / (scale * np.sqrt(np.maximum(1 - leverage, 0)))
    residuals = pd.DataFrame(
        {"fit": fitted, "residual": residual, "standardised": standardised,
         "run_order": data[run_order] if run_order in data
         else np.random.default_rng(0).permutation(len(data)) + 1}
    )
    point_table = _points(points, place, y, fitted, bounds)
    return Factorial(
        response=response,
        unit=unit if transform == "none" else "",
        transform=transform,
        levels=bounds,
        terms=model,
        method=method,
        seeding=seeding,
        error=used,
        sigma=sigma,
        confidence=confidence,
        practical=limit,
        effects=effects,
        anova=_anova(effects, curvature, lack, total, float(fit.ssr), ssr, len(y), spare - blocks,
                     len(points) - x.shape[1], blocks, method),
        runs=len(data),
        dropped=dropped,
        df=df,
        rmse=rmse,
        r2=1 - float(fit.ssr) / total,
        r2_adjusted=1 - (fit.ssr / spare) / (total / (len(y) - 1)) if spare else np.nan,
        r2_predicted=1 - press / total,
        press=press,
        lack_of_fit=lack,
        curvature=curvature,
        lenth=lenth_,
        overall_mean=float(point_table.loc[~_centre(points), "mean"].mean()),
        points=point_table,
        main_effects=_main_effects(points, point_table["mean"].to_numpy(), bounds),
        interactions=_interactions(points, point_table["mean"].to_numpy(), bounds),
        residuals=residuals,
        aliases=_aliases(points[~_centre(points)], model, factors),
        replicate_effects=per_replicate,
        table=data,
        reduced=reduced,
    )


def lenth(effects: Floats, confidence: float = 0.95) -> Lenth:
    """Lenth's pseudo standard error of effects of which most are noise.

    s₀ = 1.5 median|c|, PSE = 1.5 median of those |c| below 2.5 s₀, ME = t(1−α/2, m/3) PSE and
    SME = t(γ, m/3) PSE with γ = (1 + (1−α)^(1/m))/2 for m effects c.

    Raises
    ------
    ConfigurationError
        There are fewer than three effects.
    """
    size = np.abs(effects)
    m = len(size)
    if m < 3:
        raise ConfigurationError(
            f"runs: must be more than the terms of the model, or the terms at least 3, got {m} "
            "terms and no run to spare"
        )
    s0 = 1.5 * np.median(size)
    # several effects of exactly zero make s0 zero: they are all there is to go by
    small = size[size < 2.5 * s0] if s0 > 0 else size[size == 0]
    pse = 1.5 * float(np.median(small))
    df = m / 3
    at_once = (1 + confidence ** (1 / m)) / 2
    me, sme = (pse * float(stats.t.ppf(q, df)) for q in ((1 + confidence) / 2, at_once))
    return Lenth(pse, me, sme, df)


def box_cox(analysis: Factorial, lambdas: Sequence[float] | None = None) -> pd.DataFrame:
    """Profile of the Box–Cox transform of the response: which power suits the model.

    Returns
    -------
    DataFrame
        ``lambda`` (1: as it is, 0: its logarithm; without `lambdas` from −2 to 2, the best one and
        the ends of its interval among them), ``log_likelihood``, up to a constant, and
        ``inside``: whether λ is in the confidence interval, by the likelihood ratio. With common
        random numbers the replicates' means are part of the model.

    Raises
    ------
    ConfigurationError
        The response is not positive, is transformed already, or the model leaves nothing over.
    """
    y = analysis.table[analysis.response].to_numpy(np.float64)
    if analysis.transform != "none" or (y <= 0).any():
        raise ConfigurationError(
            f"{analysis.response}: must be positive and as it is for a Box–Cox profile, got "
            + ("a logarithm" if analysis.transform != "none" else f"{y.min():g}")
        )
    coded = _coded(analysis.table, analysis.levels)
    x = _matrix(coded, analysis.terms)
    if analysis.seeding == "common":
        replicate = analysis.replicate_effects
        assert replicate is not None
        blocks = pd.get_dummies(analysis.table[replicate.index.name], dtype=float)
        x = np.hstack([x, blocks.to_numpy()[:, 1:]])
    if len(y) <= x.shape[1]:
        raise ConfigurationError(
            f"runs: must be more than the {x.shape[1]} terms for a Box–Cox profile, got {len(y)}"
        )
    q = np.linalg.qr(x)[0]
    logs = np.log(y)
    logs -= logs.mean()  # scaled by the geometric mean, so that no power overflows

    def height(power: float) -> float:
        z = np.expm1(power * logs) / power if abs(power) > 1e-12 else logs
        left = float(((z - q @ (q.T @ z)) ** 2).sum())
        return -len(y) / 2 * log(left / len(y)) if left > 0 else np.inf

    depth = float(stats.chi2.ppf(analysis.confidence, 1)) / 2
    grid = np.linspace(-2, 2, 41) if lambdas is None else np.asarray(lambdas, np.float64)
    value = np.array([height(power) for power in grid])
    if lambdas is None and np.isfinite(value).all():
        grid = np.union1d(grid, _summit(height, grid, value, depth))
        value = np.array([height(power) for power in grid])
    inside = value >= value.max() - depth - 1e-6
    return pd.DataFrame({"lambda": grid, "log_likelihood": value, "inside": inside})


def _summit(
    height: Callable[[float], float], grid: Floats, value: Floats, depth: float
) -> list[float]:
    """Where the highest point is and where, on both sides, it is lower by `depth`."""
    at = int(value.argmax())
    low, high = grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)]
    best = float(optimize.minimize_scalar(
        lambda power: -height(power), bounds=(low, high), method="bounded",
        options={"xatol": 1e-5},
    ).x)
    if value[at] > height(best):
        best = float(grid[at])
    line = height(best) - depth
    ends = [
        float(optimize.brentq(lambda power: height(power) - line, best, end, xtol=1e-7))
        for end in (grid[0], grid[-1]) if best != end and height(end) < line
    ]
    return [best, *ends]


def detectable(analysis: Factorial, power: float = 0.8) -> pd.Series[float]:
    """Smallest true effect of each term that the experiment finds with the given probability.

    From the noncentral t distribution, two-sided at the level of the analysis, with the standard
    errors it found. In units of the effects.
    """
    if not 0.5 <= power < 1:
        raise ConfigurationError(f"power: must be from 0.5 to below 1, got {power}")
    line, df = analysis.reference, analysis.df
    # the noncentral t distribution, as a mean over quantiles of s/σ: SciPy's own fails for large df
    s = np.sqrt(stats.chi2.ppf((np.arange(4000) + 0.5) / 4000, df) / df)

    def missing(shift: float) -> float:
        found = stats.norm.sf(line * s - shift) + stats.norm.cdf(-line * s - shift)
        return float(found.mean()) - power

    shift = float(optimize.brentq(missing, 0.0, 10 * line + 10))
    return (shift * analysis.effects["std_error"]).rename("detectable")


def _p(p: float) -> str:
    return "<1e-300" if p < 1e-300 else f"{p:.2g}"


def answer(analysis: Factorial, most: int = 3) -> str:
    """What matters, in a few sentences: the largest main effects and the largest interaction.

    A factor is named from its worse to its better level, as if less of the response is better.
    Factors whose effects cannot be told apart share a place; places are named until there are
    `most` factors.
    """
    a = analysis
    ranked = a.ranked()
    worth = ranked["significant"].astype(bool)
    what = {"none": "", "log": "geometric mean of the ", "spread": "spread of the "}[a.transform]
    what = f"the {what}{a.response}"
    if not worth.any():
        return f"No effect on {what} can be told from noise."
    if "verdict" in ranked:
        worth &= ranked["verdict"] != "too small"
        if not worth.any():
            return (f"No effect on {what} is large enough to matter: those that can be told from "
                    f"noise are smaller than {limit_of(a)}.")
    single, several = ranked[worth & (ranked["order"] == 1)], ranked[worth & (ranked["order"] > 1)]
    level = f"{100 * a.confidence:.4g}% interval" + (" by Lenth's method" if a.lenth else "")
    parts: list[str] = []
    named: list[str] = []
    for same in _groups(a, [str(name) for name in single.index]):
        if len(named) >= most:
            break
        shown, rest = same[: most + 1], len(same) - most - 1
        named += shown
        words: list[str] = []
        for name in shown:
            size, interval = _reach(a, name)
            first = not parts and not words
            words.append(
                f"{name} from {_worse_to_better(a, name)}, by {size}"
                + (f" on average ({level} {interval})" if first else f" ({interval})")
            )
        text = ", tied with ".join(words)
        parts.append(text + (f", and with {rest} more" if rest > 0 else ""))
    if parts:
        sentences = [f"{what[0].upper()}{what[1:]} falls most with {'; then with '.join(parts)}."]
    else:
        sentences = [f"No factor alone changes {what} surely."]
    if len(several):
        name = str(several.index[0])
        named.append(name)
        size, interval = _signed(a, name)
        sentences.append(
            f"The largest interaction is {name} ({size}, {interval})." if parts else
            f"The largest interaction is {name} ({size}, {level} {interval})."
        )
    same_as = [f"{name} from {' and '.join(a.aliases[name])}" for name in named
               if name in a.aliases]
    if same_as:
        sentences.append(
            "This holds as far as interactions that are not in the model may be neglected: the "
            f"design points cannot tell {'; '.join(same_as)}."
        )
    elif len(a.factors) > 1 and all(len(term) == 1 for term in a.terms):
        sentences.append("Interactions are not in the model.")
    return " ".join(sentences)


def places(analysis: Factorial) -> dict[str, str]:
    """Rank of each main effect by its size; those that cannot be told apart share a place."""
    ranked = analysis.ranked()
    found: dict[str, str] = {}
    for same in _groups(analysis, [str(n) for n in ranked.index[ranked["order"] == 1]]):
        first, last = len(found) + 1, len(found) + len(same)
        found |= dict.fromkeys(same, f"{first}" if first == last else f"{first} to {last}")
    return found


def _groups(analysis: Factorial, names: list[str]) -> list[list[str]]:
    """Terms, the largest first, in groups that cannot be told from their first one."""
    found = []
    while names:
        found.append([n for n in names if n == names[0] or tied(analysis, names[0], n)])
        names = [n for n in names if n not in found[-1]]
    return found


def limit_of(analysis: Factorial) -> str:
    """The smallest effect that matters, in words."""
    assert analysis.practical is not None
    if analysis.transform != "none":
        return f"a factor of {np.exp(analysis.practical):.3g}"
    return f"{analysis.practical:g} {analysis.unit}".rstrip()


def quantity(value: float, unit: str) -> str:
    """A number with its unit."""
    return minus(f"{value:g}{unit}" if unit == "°" else f"{value:g} {unit}".rstrip())


def figures(value: float, digits: int = 3) -> str:
    """A number with so many significant digits, trailing zeros among them, and a true minus."""
    if not np.isfinite(value):
        return "–" if np.isnan(value) else "∞" if value > 0 else "−∞"
    if value == 0:
        return "0"
    text = f"{value:#.{digits}g}" if abs(value) < 10**digits else f"{value:,.0f}"
    return minus(text.removesuffix("."))


def percent(share: float) -> str:
    """A share."""
    return "< 0.1%" if 0 < share < 5e-4 else f"{share:.1%}"


def minus(text: str) -> str:
    """With true minus signs before numbers."""
    return re.sub(r"(?<![\w.])-(?=\d)", "−", re.sub(r"(?<=\de)-(?=\d)", "−", text))


def _worse_to_better(analysis: Factorial, name: str) -> str:
    low, high = (quantity(x, analysis.units.get(name, "")) for x in analysis.levels[name])
    row: Any = analysis.effects.loc[name]
    return f"{high} to {low}" if row.effect > 0 else f"{low} to {high}"


def _reach(analysis: Factorial, name: str) -> tuple[str, str]:
    """By how much the response falls to the better level, and the interval of it."""
    row: Any = analysis.effects.loc[name]
    ends = sorted(np.sign(row.effect) * np.array([row.low, row.high]))
    if analysis.transform != "none":
        size, *ends = np.exp([abs(row.effect), *ends])
        return f"a factor of {figures(size)}", f"{figures(ends[0])} to {figures(ends[1])}"
    unit = f" {analysis.unit}" if analysis.unit else ""
    return f"{figures(abs(row.effect))}{unit}", f"{figures(ends[0])} to {figures(ends[1])}"


def _signed(analysis: Factorial, name: str) -> tuple[str, str]:
    """An effect and its interval, as a ratio if it is one of logarithms."""
    row: Any = analysis.effects.loc[name]
    if analysis.transform != "none":
        return f"×{figures(row.ratio)}", f"{figures(row.ratio_low)} to {figures(row.ratio_high)}"
    unit = f" {analysis.unit}" if analysis.unit else ""
    sign = "+" if row.effect > 0 else ""
    return f"{sign}{figures(row.effect)}{unit}", f"{figures(row.low)} to {figures(row.high)}"


def tied(analysis: Factorial, one: str, other: str) -> bool:
    """Whether the sizes of two effects differ by no more than chance allows."""
    a, b = (analysis.effects.loc[name] for name in (one, other))
    if analysis.replicate_effects is not None:
        each = analysis.replicate_effects
        gap = np.sign(a.effect) * each[one] - np.sign(b.effect) * each[other]
        error = float(gap.std(ddof=1)) / np.sqrt(len(gap))
    else:
        error = float(np.hypot(a.std_error, b.std_error))
    return bool(abs(abs(a.effect) - abs(b.effect)) <= analysis.reference * error)


def _notes(analysis: Factorial) -> list[str]:
    """How the numbers came about, and the tests of the model."""
    a = analysis
    points = len(a.points)
    how = {
        "ols": "ordinary least squares, errors from the "
        + ("scatter between replicates (pure error)" if a.error == "pure" else
           "scatter about the model (residual, lack of fit in it)")
        + f", {a.df:g} degrees of freedom",
        "replicates": f"effects of each of {a.df + 1:g} replicates and their scatter, for the "
        "runs of a replicate share their noise",
        "lenth": "Lenth's pseudo standard error, for nothing is left to estimate the error from",
    }[a.method]
    lines = [
        f"{a.runs} {'values' if a.transform == 'spread' else 'runs'} at {points} points, "
        f"{len(a.effects)} terms; {how}."
    ]
    if a.dropped:
        lines.append(f"{a.dropped} runs are left out: no finite response"
                     + (", or an incomplete replicate." if a.seeding == "common" else "."))
    if np.isfinite(a.r2_adjusted):
        predicted = f", predicted {a.r2_predicted:.2%}" if np.isfinite(a.r2_predicted) else ""
        lines.append(f"R² {a.r2:.2%}, adjusted {a.r2_adjusted:.2%}{predicted}; "
                     f"root of the residual mean square {a.rmse:.4g}"
                     + (", of the jackknife's values." if a.transform == "spread"
                        and a.seeding == "common" else "."))
    if a.lenth is not None:
        unit = f" {a.unit}" if a.unit else ""
        lines.append(
            f"Lenth: pseudo standard error {a.lenth.pse:.4g}{unit}; an effect is significant from "
            f"{a.lenth.me:.4g}{unit} on, the largest of all from {a.lenth.sme:.4g}{unit} on."
        )
    for word, test in (("Lack of fit", a.lack_of_fit), ("Curvature", a.curvature)):
        if test is not None:
            lines.append(f"{word}: F({test.df:.4g}, {test.df_error:.4g}) = {test.f:.4g}, "
                         f"p {_p(test.p) if test.p < 1e-300 else f'= {_p(test.p)}'}.")
    if a.practical is not None:
        lines.append(f"An effect matters from {limit_of(a)} on, its whole interval beyond it.")
    if a.reduced:
        lines.append("Main effects only: the design points cannot tell the interactions of two "
                     "factors apart.")
    if a.aliases:
        pairs = [f"{term} with {', '.join(same)}" for term, same in a.aliases.items()]
        more = f" and {len(pairs) - NAMED} more" if len(pairs) > NAMED else ""
        lines.append(f"Aliased: {'; '.join(pairs[:NAMED])}{more}.")
    return lines


def check_columns(table: pd.DataFrame, factors: tuple[str, ...], response: str) -> None:
    """Refuse what are not different columns of numbers."""
    if not factors:
        raise ConfigurationError("factors: must name at least one column, got none")
    if len(set(factors)) < len(factors):
        twice = next(name for name in factors if factors.count(name) > 1)
        raise ConfigurationError(f"factors: must be different columns, got {twice!r} twice")
    for where, name in (*(("factors", name) for name in factors), ("response", response)):
        if name not in table:
            raise ConfigurationError(
                f"{where}: must be columns of the table, got {name!r}"
                + nearest(name, map(str, table.columns))
            )
        if not pd.api.types.is_numeric_dtype(table[name]):
            kind = table[name].dtype
            raise ConfigurationError(f"{name}: must be a column of numbers, got {kind}")
    if response in factors:
        raise ConfigurationError(f"response: must not be a factor, got {response!r}")


def _practical(value: float | None, transform: Transform) -> float | None:
    """The practical limit in units of the effects."""
    if value is None:
        return None
    least = 0.0 if transform == "none" else 1.0
    if not least < value < np.inf:
        what = "above 0" if transform == "none" else "a ratio above 1"
        raise ConfigurationError(f"practical: must be {what}, got {value}")
    return value if transform == "none" else log(value)


def _terms(
    factors: tuple[str, ...], order: int | None, given: Sequence[str | Sequence[str]] | None
) -> tuple[Term, ...]:
    if given is None:
        order = min(2, len(factors)) if order is None else order
        if not 1 <= order <= len(factors):
            raise ConfigurationError(
                f"order: must be from 1 to the number of factors, {len(factors)}, got {order}"
            )
        return tuple(
            term for n in range(1, order + 1) for term in combinations(range(len(factors)), n)
        )
    found: list[Term] = []
    for entry in given:
        if isinstance(entry, str):
            names = [entry] if entry in factors else entry.split(TIMES)
        else:
            names = list(entry)
        for name in names:
            if name not in factors:
                raise ConfigurationError(
                    f"terms: must be made of the factors, got {name!r}" + nearest(name, factors)
                )
        term = tuple(sorted(factors.index(name) for name in names))
        if not term or len(set(term)) < len(term) or term in found:
            raise ConfigurationError(f"terms: must be different terms, got {entry!r} again")
        found.append(term)
    if not found:
        raise ConfigurationError("terms: must name at least one term, got none")
    return tuple(found)


def _levels(
    data: pd.DataFrame,
    factors: tuple[str, ...],
    given: Mapping[str, tuple[float, float]] | None,
) -> dict[str, tuple[float, float]]:
    for name in given or {}:
        if name not in factors:
            raise ConfigurationError(
                f"levels: must be of the factors, got {name!r}" + nearest(name, factors)
            )
    bounds = {}
    for name in factors:
        column = data[name].to_numpy(np.float64)
        if not np.isfinite(column).all():
            wrong = column[~np.isfinite(column)][0]
            raise ConfigurationError(f"{name}: must be finite in all runs, got {wrong}")
        low, high = (given or {}).get(name, (column.min(), column.max()))
        if low == high:
            raise ConfigurationError(f"{name}: must have two different levels, got {low:g} only")
        bounds[name] = (float(low), float(high))
    return bounds


def _coded(data: pd.DataFrame, bounds: Mapping[str, tuple[float, float]]) -> Floats:
    """Levels as −1, +1, or 0 in all factors for a centre point; shape (runs, factors)."""
    low, high = np.array(list(bounds.values())).T
    exact = (data[list(bounds)].to_numpy(np.float64) - (low + high) / 2) / ((high - low) / 2)
    coded: Floats = np.rint(exact)
    wrong = (np.abs(exact - coded) > TOLERANCE) | (np.abs(coded) > 1)
    wrong |= (coded == 0) & ~_centre(coded)[:, None]
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        name = list(bounds)[column]
        raise ConfigurationError(
            f"{name}: must be {low[column]:g}, {high[column]:g} or, with all factors in the "
            f"middle, {(low[column] + high[column]) / 2:g}, got {data[name].iloc[row]:g}"
        )
    return coded + 0.0  # no negative zeros: they would look like points of their own


def _centre(coded: Floats) -> NDArray[np.bool_]:
    return np.asarray(np.all(coded == 0, axis=1))


def _matrix(coded: Floats, model: tuple[Term, ...]) -> Floats:
    """Columns of the model: the mean, the terms, and one for the centre points if there are any."""
    columns = [np.ones(len(coded)), *(coded[:, list(term)].prod(axis=1) for term in model)]
    if _centre(coded).any():
        columns.append(_centre(coded).astype(np.float64))
    return np.column_stack(columns)


def _name(term: Term, factors: Sequence[str]) -> str:
    return TIMES.join(factors[i] for i in term)


def _rank(x: Floats) -> int:
    """Columns that the design points can tell apart."""
    return int(np.linalg.matrix_rank(np.unique(x, axis=0)))


def _check_estimable(x: Floats, columns: Sequence[str]) -> None:
    """Refuse a model with terms that the design cannot tell apart, and name them."""
    distinct = np.unique(x, axis=0)
    if np.linalg.matrix_rank(distinct) == len(columns):
        return
    aliased: list[str] = []
    free: list[int] = []
    for i, name in enumerate(columns):
        basis = distinct[:, free]
        weights = np.linalg.lstsq(basis, distinct[:, i], rcond=None)[0]
        if free and np.allclose(basis @ weights, distinct[:, i], atol=1e-9):
            others = [columns[j] for j, w in zip(free, weights, strict=True) if abs(w) > 1e-9]
            aliased.append(f"{name} aliased with {' and '.join(others)}")
        else:
            free.append(i)
    more = f" and {len(aliased) - NAMED} more" if len(aliased) > NAMED else ""
    raise ConfigurationError(
        f"terms: must be told apart by the {len(distinct)} design points, got "
        f"{'; '.join(aliased[:NAMED])}{more}"
    )


def _complete(data: pd.DataFrame, factors: tuple[str, ...], replicate: str) -> pd.DataFrame:
    """The replicates that have every design point, each once."""
    if replicate not in data:
        raise ConfigurationError(
            f"{replicate}: must be a column of the table for common random numbers, got none"
        )
    keys = [replicate, *factors]
    if data.duplicated(keys).any():
        row = data[data.duplicated(keys)].iloc[0]
        raise ConfigurationError(
            f"{replicate}: must have each design point once for common random numbers, got one "
            f"twice in {row[replicate]:g}"
        )
    count = len(data[list(factors)].drop_duplicates())
    full = data.groupby(replicate)[replicate].transform("size") == count
    if data.loc[full, replicate].nunique() < 2:
        raise ConfigurationError(
            f"{replicate}: must be at least two complete replicates for common random numbers, "
            f"got {data.loc[full, replicate].nunique()}"
        )
    return data[full].reset_index(drop=True)


def _spread(
    data: pd.DataFrame,
    factors: tuple[str, ...],
    response: str,
    replicate: str,
    seeding: Seeding,
) -> pd.DataFrame:
    """ln s of each point; with common random numbers its jackknife values over the replicates."""
    groups = data.groupby(list(factors), sort=True)[response]
    need = 2 if seeding == "independent" else 3
    if (groups.size() < need).any():
        raise ConfigurationError(
            f"{response}: must have {need} runs or more at each point for its spread, got "
            f"{groups.size().min()}"
        )
    if (groups.std() <= 0).any():
        place = groups.std().reset_index().sort_values(response).iloc[0][list(factors)]
        raise ConfigurationError(
            f"{response}: must vary over the runs of each point for its spread, got none at "
            + ", ".join(f"{name} {value:g}" for name, value in place.items())
        )
    if seeding == "independent":
        points = groups.std().reset_index()
        return points.assign(**{response: np.log(points[response])})

    def jackknife(values: pd.Series[float]) -> pd.Series[float]:
        y = values.to_numpy(np.float64)
        n = len(y)
        around = y - y.mean()
        squares = (around**2).sum() - around**2 * n / (n - 1)  # of the others, about their mean
        with np.errstate(divide="ignore"):
            pseudo = -(n - 1) / 2 * np.log(np.maximum(squares, 0) / (n - 2))
        # their scatter is what is wanted: their mean is put to ln s itself
        return pd.Series(pseudo - pseudo.mean() + np.log(y.std(ddof=1)), index=values.index)

    spread = data.assign(**{response: groups.transform(jackknife)})
    if not np.isfinite(spread[response]).all():
        raise ConfigurationError(
            f"{response}: must vary over any two runs of each point for its spread, got equal ones"
        )
    return spread


def _effects(
    names: Sequence[str],
    model: tuple[Term, ...],
    coefficients: Floats,
    error: Floats,
    df: float,
    unscaled: Floats,
    total: float,
    confidence: float,
    practical: float | None,
) -> pd.DataFrame:
    rows = slice(1, len(model) + 1)
    coefficient, error = coefficients[rows], error[rows]
    effect, std_error = 2 * coefficient, 2 * error
    with np.errstate(divide="ignore", invalid="ignore"):
        t = effect / std_error
    p = 2 * stats.t.sf(np.abs(t), df)
    margin = stats.t.ppf((1 + confidence) / 2, df) * std_error
    low, high = effect - margin, effect + margin
    table = pd.DataFrame(
        {
            "order": [len(term) for term in model],
            "coefficient": coefficient,
            "effect": effect,
            "std_error": std_error,
            "t": t,
            "p": p,
            "low": low,
            "high": high,
            "share": coefficient**2 / unscaled[rows] / total,
            "significant": p < 1 - confidence,
        },
        index=pd.Index(names, name="term"),
    )
    if practical is not None:
        table["verdict"] = np.select(
            [(low >= practical) | (high <= -practical), (low > -practical) & (high < practical)],
            ["matters", "too small"],
            "open",
        )
    return table


def _cleared(values: Any, least: float) -> Floats:
    """The values, but zero where they are below what rounding leaves."""
    return np.where(np.abs(values) < least, 0.0, values)


def _pure_error(y: Floats, place: NDArray[np.intp]) -> float:
    """Sum of squares of the runs about the means of their points."""
    means = np.bincount(place, y) / np.bincount(place)
    return float(((y - means[place]) ** 2).sum())


def _lack_of_fit(pure: float, df_error: int, df: int, ssr: float, least: float) -> FTest | None:
    """Scatter of the points' means about the model, against that of the runs about the means."""
    if df <= 0 or df_error <= 0:
        return None
    ss = max(float(ssr) - pure, 0.0)
    pure, ss = (float(_cleared(value, least)) for value in (pure, ss))
    if not pure and not ss:
        return None
    f = (ss / df) / (pure / df_error) if pure else np.inf
    return FTest(np.nan, ss, df, df_error, f, float(stats.f.sf(f, df, df_error)))


def _lack_over_replicates(by_replicate: Floats, x: Floats, least: float) -> FTest | None:
    """Lack of fit for correlated runs: the contrasts that the model leaves out, by replicate.

    A repeated-measures F test with Greenhouse and Geisser's ε = tr(S)² / (m tr(S²)), where S is
    the covariance of the m contrasts over the replicates.
    """
    number, points = by_replicate.shape
    m = points - x.shape[1]
    if m <= 0:
        return None
    contrasts = by_replicate @ np.linalg.qr(x, mode="complete")[0][:, x.shape[1]:]
    mean = contrasts.mean(axis=0)
    around = contrasts - mean
    trace = float((around**2).sum()) / (number - 1)
    # tr(S²) from the smaller of the two products
    gram = around @ around.T if number < m else around.T @ around
    square = float((gram**2).sum()) / (number - 1) ** 2
    ss = number * float((mean**2).sum())
    if trace < m * least**2:
        return None
    df = trace**2 / square
    f = ss / trace
    return FTest(np.nan, ss, df, df * (number - 1), f, float(stats.f.sf(f, df, df * (number - 1))))


def _anova(
    effects: pd.DataFrame,
    curvature: FTest | None,
    lack: FTest | None,
    total: float,
    ssr: float,
    within: float,
    runs: int,
    spare: int,
    lack_df: int,
    blocks: int,
    method: Method,
) -> pd.DataFrame:
    """The table; `ssr` is about the model, `within` also less the replicates' means.

    `spare` and `lack_df` are the degrees of freedom of `within` and, uncorrected, of lack of fit;
    `blocks` those of the replicates.
    """
    ss = effects["share"] * total
    with np.errstate(divide="ignore", invalid="ignore"):
        f = effects["t"] ** 2 if method != "lenth" else np.nan
    p = effects["p"] if method != "lenth" else np.nan
    table = pd.DataFrame({"ss": ss, "df": 1.0, "ms": ss, "f": f, "p": p})
    nan = np.nan
    rows: dict[str, tuple[float, float, float, float]] = {}
    if curvature is not None:
        rows[CURVATURE] = (curvature.ss, 1.0, curvature.f, curvature.p)
    if method == "replicates":
        rows["replicates"] = (ssr - within, blocks, nan, nan)
    if spare:
        rows["residual"] = (within, spare, nan, nan)
    if lack is not None:
        rows["lack of fit"] = (lack.ss, lack_df, lack.f, lack.p)
        rows["pure error"] = (within - lack.ss, spare - lack_df, nan, nan)
    rows["total"] = (total, runs - 1, nan, nan)
    rest = pd.DataFrame.from_dict(rows, orient="index", columns=["ss", "df", "f", "p"])
    rest.insert(2, "ms", rest["ss"] / rest["df"])
    whole = pd.concat([table, rest])
    whole.index.name = "source"
    return whole


def _points(
    points: Floats,
    place: NDArray[np.intp],
    y: Floats,
    fitted: Floats,
    bounds: Mapping[str, tuple[float, float]],
) -> pd.DataFrame:
    low, high = np.array(list(bounds.values())).T
    middle = (low + high) / 2
    values = np.select([points < 0, points > 0], [low, high], middle)
    table = pd.DataFrame(values, columns=list(bounds))
    groups = pd.Series(y).groupby(place)
    table["runs"], table["mean"], table["std"] = groups.size(), groups.mean(), groups.std()
    table["fit"] = pd.Series(fitted).groupby(place).first()
    return table


def _main_effects(points: Floats, means: Floats, bounds: Mapping[str, tuple[float, float]]
                  ) -> pd.DataFrame:
    return pd.DataFrame(
        [
            (name, word, bounds[name][side > 0], means[points[:, i] == side].mean())
            for i, name in enumerate(bounds)
            for side, word in ((-1, "low"), (1, "high"))
        ],
        columns=["factor", "level", "value", "mean"],
    )


def _interactions(points: Floats, means: Floats, bounds: Mapping[str, tuple[float, float]]
                  ) -> pd.DataFrame:
    rows = []
    names = list(bounds)
    for i, j in combinations(range(len(names)), 2):
        for a in (-1, 1):
            for b in (-1, 1):
                cell = means[(points[:, i] == a) & (points[:, j] == b)]
                rows.append((names[i], names[j], bounds[names[i]][a > 0], bounds[names[j]][b > 0],
                             cell.mean() if len(cell) else np.nan))
    return pd.DataFrame(rows, columns=["first", "second", "first_value", "second_value", "mean"])


def _aliases(points: Floats, model: tuple[Term, ...], factors: Sequence[str]
             ) -> dict[str, tuple[str, ...]]:
    """Terms outside of the model whose columns are those of a term in it, or their negative."""
    if len(points) == 2 ** len(factors):
        return {}
    inside = {points[:, list(term)].prod(axis=1).tobytes(): term for term in ((), *model)}
    found: dict[str, list[str]] = {}
    for n in range(1, min(ALIAS_ORDER, len(factors)) + 1):
        for term in combinations(range(len(factors)), n):
            if term in model:
                continue
            column = points[:, list(term)].prod(axis=1)
            for sign, values in (("", column), ("−", -column)):
                if values.tobytes() in inside:
                    own = inside[values.tobytes()]
                    name = _name(own, factors) or "mean"
                    found.setdefault(name, []).append(sign + _name(term, factors))
    return {name: tuple(same) for name, same in found.items()}
