"""Least squares, and the uncertainty of its coefficients.

There are three methods for the uncertainty; see `sblcosim.analysis.two_level.analysis`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from ...errors import ConfigurationError
from ..common.centred import Centred, group_means
from ..common.model import Floats, TwoLevelModel
from ..common.options import Error, Method, Options
from .noise import (
    FTest,
    Lenth,
    cleared,
    lack_of_fit,
    lack_over_replicates,
    lenth,
    pure_error,
)

ALONE = 1e-9
"""Smallest 1 − leverage of a predictable run; below it, the model follows this run alone."""


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """The model fitted to the runs, from the means of their points.

    Attributes
    ----------
    y
        Response of each run minus the centre.
    centre
        The constant that is subtracted from all responses; see `sblcosim.analysis.common.centred`.
    point_of_run
        Index of each run's point.
    fitted
        Fitted value at each point minus the centre.
    coefficients
        Coefficients of the mean (minus the centre), the terms, and the centre points if there are
        any.
    variances
        Variances of the coefficients for runs with a variance of 1.
    leverage
        Leverage of a run of each point: the diagonal of the hat matrix.
    pure, lack
        Sums of squares of the runs about their points' means, and of these means about the model.
    spare
        Degrees of freedom about the model.
    least
        Smaller responses are rounding noise.
    """

    y: Floats
    centre: float
    point_of_run: NDArray[np.intp]
    fitted: Floats
    coefficients: Floats
    variances: Floats
    leverage: Floats
    pure: float
    lack: float
    spare: int
    least: float

    @property
    def ssr(self) -> float:
        """Sum of squares about the model."""
        return self.pure + self.lack

    @property
    def residual(self) -> Floats:
        """Response of each run minus the fitted response."""
        return self.y - self.fitted[self.point_of_run]

    @cached_property
    def total(self) -> float:
        """Sum of squares about the mean."""
        return float(((self.y - self.y.mean()) ** 2).sum())

    @property
    def rmse(self) -> float:
        """Residual standard deviation; NaN if no degrees of freedom are left."""
        if not self.spare:
            return np.nan
        return float(cleared(np.sqrt(self.ssr / self.spare), self.least))


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Uncertainty of the coefficients, and tests of the model.

    Attributes
    ----------
    method, error, sigma, df, lack_of_fit, lenth, press, replicate_effects
        As in `sblcosim.analysis.two_level.analysis.Factorial`.
    errors
        Standard errors of the coefficients.
    residual
        Residual of each run; with common random numbers, minus the replicates' means.
    blocks
        Degrees of freedom of the replicates' means.
    """

    method: Method
    error: Error | None
    sigma: float
    df: float
    errors: Floats
    residual: Floats
    press: float
    lack_of_fit: FTest | None
    lenth: Lenth | None = None
    blocks: int = 0
    replicate_effects: pd.DataFrame | None = None


def least_squares(response: Centred, model: TwoLevelModel) -> LeastSquares:
    """Fit a model to the response.

    The means of the points, weighted by their numbers of runs, give the same coefficients as the
    runs (Montgomery, section 3.3), because the model does not distinguish the runs of a point.
    """
    from statsmodels.regression.linear_model import OLS  # slow to import

    of_run, y = model.point_of_run, response.off
    runs, means = np.bincount(of_run), group_means(of_run, y)
    weight = np.sqrt(runs)
    fit = OLS(means * weight, model.x * weight[:, None]).fit()
    fitted = model.x @ fit.params
    return LeastSquares(
        y=y,
        centre=response.centre,
        point_of_run=of_run,
        fitted=fitted,
        coefficients=cleared(fit.params, response.least),
        variances=np.diag(fit.normalized_cov_params),
        leverage=fit.get_influence().hat_matrix_diag / runs,
        pure=pure_error(y, of_run),
        lack=float((runs * (means - fitted) ** 2).sum()),
        spare=len(y) - model.x.shape[1],
        least=response.least,
    )


def from_runs(fit: LeastSquares, model: TwoLevelModel, options: Options) -> Uncertainty:
    """Uncertainty from runs that each have noise of their own."""
    y, least = fit.y, fit.least
    pure, pure_df = fit.pure, len(y) - len(model.points)
    error: Error = "pure" if options.error == "pure" and pure_df else "residual"
    df = float(pure_df if error == "pure" else fit.spare)
    sigma = fit.rmse if error == "residual" else float(cleared(np.sqrt(pure / df), least))
    residual = fit.residual
    with np.errstate(divide="ignore", invalid="ignore"):
        left_out = residual / (1 - fit.leverage)[fit.point_of_run]
    alone = 1 - fit.leverage < ALONE
    lack_df = len(model.points) - model.x.shape[1]
    uncertainty = Uncertainty(
        method="ols",
        error=error,
        sigma=sigma,
        df=df,
        errors=sigma * np.sqrt(fit.variances),
        residual=residual,
        press=np.nan if alone.any() else float((left_out**2).sum()),
        lack_of_fit=lack_of_fit(pure, pure_df, lack_df, fit.lack, len(y) * least**2),
    )
    if fit.spare:
        return uncertainty
    margins = lenth(2 * fit.coefficients[1 : len(model.terms) + 1], options.confidence)
    return replace(
        uncertainty,
        method="lenth",
        error=None,
        df=margins.df,
        errors=np.full(model.x.shape[1], margins.pse / 2),
        lenth=margins,
    )


def from_replicates(
    fit: LeastSquares, model: TwoLevelModel, replicate: pd.Series[float]
) -> Uncertainty:
    """Uncertainty from replicates whose runs share their noise; `replicate` has each run's."""
    y, points = fit.y, len(model.points)
    number = len(y) // points
    if number < 2:
        raise ConfigurationError(
            f"{replicate.name}: must be at least two complete replicates for common random "
            f"numbers, got {number}"
        )
    # replicate by replicate, the points in the order of the model's
    rows = np.lexsort((model.point_of_run, replicate))
    by_replicate = y[rows].reshape(number, points)
    x = model.x
    each = by_replicate @ np.linalg.pinv(x).T
    others = (each.sum(axis=0) - each) / (number - 1)
    residual = fit.residual
    shift = by_replicate.mean(axis=1) - by_replicate.mean()
    residual[rows] -= np.repeat(shift, points)
    return Uncertainty(
        method="replicates",
        error="pure",
        sigma=np.nan,
        df=float(number - 1),
        errors=cleared(each.std(axis=0, ddof=1), fit.least) / np.sqrt(number),
        residual=residual,
        press=float(((by_replicate - others @ x.T) ** 2).sum()),
        lack_of_fit=lack_over_replicates(by_replicate, x, fit.least),
        blocks=number - 1,
        replicate_effects=pd.DataFrame(
            2 * each[:, 1 : len(model.terms) + 1],
            columns=model.names,
            index=pd.Index(replicate.to_numpy()[rows[::points]], name=replicate.name),
        ),
    )


def curvature(fit: LeastSquares, uncertainty: Uncertainty, model: TwoLevelModel) -> FTest | None:
    """Test of the centre points against the mean of the other points; None without them."""
    coefficient, error = fit.coefficients[-1], uncertainty.errors[-1]
    testable = model.centre.any() and uncertainty.method != "lenth"
    if not testable or not (coefficient or error):
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        f = float((coefficient / error) ** 2)
    return FTest(
        float(coefficient), float(coefficient**2 / fit.variances[-1]), 1.0, uncertainty.df, f,
        float(stats.f.sf(f, 1, uncertainty.df)),
    )


def residual_table(
    fit: LeastSquares, uncertainty: Uncertainty, run_order: pd.Series[int] | None
) -> pd.DataFrame:
    """One row per run. A missing run order is drawn, the same every time."""
    residual, spare = uncertainty.residual, fit.spare
    ssr = float((residual**2).sum())
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.sqrt(ssr / (spare - uncertainty.blocks)) if spare else np.nan
        free = np.where(1 - fit.leverage < ALONE, np.nan, 1 - fit.leverage)
        scales = scale * np.sqrt(free)
        standardised = residual / scales[fit.point_of_run]
    if run_order is None:
        run_order = pd.Series(np.random.default_rng(0).permutation(len(residual)) + 1)
    return pd.DataFrame(
        {"fit": (fit.centre + fit.fitted)[fit.point_of_run], "residual": residual,
         "standardised": standardised, "run_order": run_order}
    )
