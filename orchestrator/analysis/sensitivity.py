"""Sobol' indices: which share of a response's variance each factor of a space explains.

The first-order index of a factor is the share of the variance that its value alone explains; the
total index is the share that would be left if all others were known, its interactions with them
included. Estimators are Saltelli's of 2010 and Jansen's (A. Saltelli et al., Comput. Phys. Commun.
181, 2010, 259–270, Table 2 (b) and (f)), as SALib has them. The seed is a factor like the others
(`sblcosim.study.space`): its indices are the share of chance.

Intervals are percentiles over bootstrap resamples of whole base rows. The points of a Sobol'
sequence are more even than independent ones, so for most indices they are wider than need be. In
simulations of 95 % intervals (`tests/unit/orchestrator/test_sensitivity.py`) they hold the true
indices in 94 to 100 % of the samples on average, single ones in at least 81 % with 64 base rows,
88 % with 128 or 256, and 92 % with 512 or more.

Errors of position have long tails, and a few runs would make all of the variance: the indices are
those of the logarithm, beside those of whether a run is lost.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from html import escape
from math import ceil
from typing import TYPE_CHECKING, get_args

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..errors import ConfigurationError, check_choice, nearest, quoted
from ..shown import Picture, Shown, folded, page, verbatim
from ..study.space import LEAST_BASE_ROWS, SEED_FACTOR, Sample
from . import sobol
from .bounds import share_bound
from .sobol import TAIL, Floats, Scale, SobolIndices

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..style import ThemeName

RESAMPLES = 500
_AT_ONCE = 2**21  # resampled values in memory


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivity(Shown, SobolIndices):
    __doc__ = SobolIndices.__doc__  # the class that users see

    def text(self, *, width: int | None = None) -> str:
        """The indices in words: the answer, the table, and what is to be minded.

        Parameters
        ----------
        width
            Columns to fit into; None: sentences are not wrapped.
        """
        return sobol.summary(self, width)

    def __str__(self) -> str:
        return self.text()

    def _gist(self) -> str:
        totals = self.ranked()["total"][:3]
        largest = ", ".join(f"{name} {total:.2f}" for name, total in totals.items())
        return f"of {self.runs} runs, total indices of {self.quantity}: {largest}, …"

    def _repr_html_(self) -> str:
        table = self.ranked().rename(index=self.name_of)
        return page(
            f"Sobol' indices of {self.quantity}",
            f"<p>{escape(sobol.answer(self))}</p>",
            table.to_html(float_format="{:.3f}".format, border=0),
            folded("How to read the numbers", verbatim("\n".join(sobol.notes(self)))),
        )

    def plot_indices(self, ax: Axes | None = None, theme: ThemeName = "light") -> Picture:
        """See `sblcosim.analysis.sensitivity_figures.plot_indices`."""
        from . import sensitivity_figures as figures  # loads Matplotlib

        return Picture(figures.plot_indices(self, ax, theme), ax)

    def plot_scatter(
        self, ax: Sequence[Axes] | None = None, theme: ThemeName = "light"
    ) -> Picture:
        """See `sblcosim.analysis.sensitivity_figures.plot_scatter`."""
        from . import sensitivity_figures as figures  # loads Matplotlib

        return Picture(figures.plot_scatter(self, ax, theme), ax)


# --- Estimation ----------------------------------------------------------------------------------


def indices(
    sample: Sample,
    values: Floats,
    response: str = "response",
    *,
    transform: Scale = "none",
    confidence: float = 0.95,
    resamples: int = RESAMPLES,
    seed: int = 1,
) -> Sensitivity:
    """First-order and total Sobol' indices of a response, with bootstrap intervals.

    Parameters
    ----------
    values
        The response of each run of the sample; shape (rows,). Base rows with a value that is not
        finite are left out as a whole.
    response
        Its name, for messages and texts.
    transform
        ``log`` analyses the natural logarithm.
    resamples
        Of the bootstrap, which is seeded by `seed`.

    Raises
    ------
    ConfigurationError
        The values are not those of the sample, too few base rows are left, the response does not
        vary, or it is not positive for its logarithm.
    """
    check_choice("transform", transform, get_args(Scale))
    if not 0 < confidence < 1:
        raise ConfigurationError(f"confidence: must be between 0 and 1, got {confidence}")
    if resamples < 100:
        raise ConfigurationError(f"resamples: must be at least 100, got {resamples}")
    values = np.asarray(values, np.float64)
    if values.shape != (len(sample),):
        raise ConfigurationError(
            f"{response}: must have a value for each of the {len(sample)} runs of the sample, got "
            f"shape {values.shape}"
        )
    by_row = values.reshape(sample.base_rows, -1)
    used: NDArray[np.bool_] = np.asarray(np.isfinite(by_row).all(axis=1))
    y = _checked(by_row[used], response, transform)
    table = _with_intervals(sample.columns, y, confidence, resamples, seed)
    if np.isin(y, (0.0, 1.0)).all():
        _bound_the_unchanged(table, y, confidence)
    around = np.sort(((y[:, [0, -1]] - y[:, [0, -1]].mean()) ** 2).ravel())
    tail = float(around[-ceil(TAIL * len(around)):].sum() / around.sum())
    return Sensitivity(response, transform, sample, values, used, table, tail, confidence)


def _checked(y: Floats, response: str, transform: Scale) -> Floats:
    """The base rows to analyse, transformed; shape (base rows, runs of each)."""
    if len(y) < LEAST_BASE_ROWS:
        raise ConfigurationError(
            f"{response}: must be finite in all {y.shape[1]} runs of at least {LEAST_BASE_ROWS} "
            f"base rows, got {len(y)}"
        )
    if transform == "log":
        if (y <= 0).any():
            raise ConfigurationError(
                f"{response}: must be positive for its logarithm, got {y.min():g}"
            )
        y = np.log(y)
    if np.ptp(y[:, [0, -1]]) == 0:
        raise ConfigurationError(
            f"{response}: must vary over the runs, got {y[0, 0]:g} in all that are independent"
        )
    return y


def _with_intervals(
    names: tuple[str, ...], y: Floats, confidence: float, resamples: int, seed: int
) -> pd.DataFrame:
    from SALib.analyze.sobol import analyze  # takes a second to load

    problem = {"num_vars": len(names), "names": list(names)}
    rng = np.random.default_rng(seed)
    parts = min(ceil(resamples * len(y) / _AT_ONCE), resamples // 2)
    drawn: dict[str, list[Floats]] = {"S1": [], "ST": []}
    for part in np.array_split(np.arange(resamples), parts):
        # a Generator, for SALib takes the seed 0 for none
        found = analyze(
            problem, y.ravel(), calc_second_order=False, num_resamples=len(part),
            conf_level=confidence, keep_resamples=True, seed=rng,
        )  # fmt: skip
        for kind, all_drawn in drawn.items():
            all_drawn.append(found[f"{kind}_conf_all"])
    ends = [(1 - confidence) / 2, (1 + confidence) / 2]
    columns: dict[str, Floats] = {}
    for name, kind in (("first", "S1"), ("total", "ST")):
        low, high = np.quantile(np.vstack(drawn[kind]), ends, axis=0)
        columns |= {name: found[kind], f"{name}_low": low, f"{name}_high": high}
    return pd.DataFrame(columns, index=pd.Index(names, name="factor"))


def _bound_the_unchanged(table: pd.DataFrame, y: Floats, confidence: float) -> None:
    """Upper bounds of factors that have never changed a response of 0 or 1, such as ``lost``.

    No resample has a change either, but n rows without one do not show that there is none. The
    total index is the share of changes over twice the variance.
    """
    unchanged = (y[:, 1:-1] == y[:, :1]).all(axis=0)
    most = share_bound(0, len(y), (1 - confidence) / 2) / (2 * y[:, [0, -1]].var())
    table.loc[unchanged, ["first_high", "total_high"]] = most


# --- Tables of runs ------------------------------------------------------------------------------


def of_table(
    sample: Sample,
    table: pd.DataFrame,
    response: str,
    *,
    transform: Scale = "log",
    confidence: float = 0.95,
    resamples: int = RESAMPLES,
    seed: int = 1,
) -> tuple[Sensitivity, ...]:
    """Indices of a response of a table of runs, and of whether its receiver is lost.

    Parameters
    ----------
    table
        One row per run: ``point`` (from 1, the run of the sample), ``seed`` and the responses. Runs
        may be missing, in any order.
    response
        Column, ``RECEIVER.RESPONSE``.

    Returns
    -------
    tuple
        The indices of the response and, if some of the independent runs of the receiver are lost
        and some are not, those of ``RECEIVER.lost``.

    Raises
    ------
    ConfigurationError
        As of `indices`; or there is no such column, or the runs are not those of the sample.
    """
    at = _places(sample, table)
    if response not in table:
        raise ConfigurationError(
            f"response: must be a column of the table, got {quoted(response)}"
            + nearest(response, map(str, table.columns))
        )

    def values(column: str) -> Floats:
        all_runs = np.full(len(sample), np.nan)
        all_runs[at] = table[column].to_numpy(np.float64)
        return all_runs

    def found(column: str, transform: Scale) -> Sensitivity:
        return indices(
            sample, values(column), column, transform=transform, confidence=confidence,
            resamples=resamples, seed=seed,
        )

    lost = f"{response.partition('.')[0]}.lost"
    main = found(response, transform)
    if lost not in table or lost == response or not table[lost].notna().any():
        return (main,)
    share = float(np.nanmean(values(lost)))
    main = replace(main, lost=share)
    try:
        return (main, replace(found(lost, "none"), lost=share))
    except ConfigurationError:  # none of the independent runs is lost, or all of them
        return (main,)


def _places(sample: Sample, table: pd.DataFrame) -> NDArray[np.int64]:
    """Run of the sample that each row of a table is, from 0."""
    for column in ("point", SEED_FACTOR):
        if column not in table:
            raise ConfigurationError(f"{column}: must be a column of the table, got none")
    at = table["point"].to_numpy(np.int64) - 1
    if len(at) and not (0 <= at.min() <= at.max() < len(sample)):
        raise ConfigurationError(
            f"point: must be from 1 to {len(sample)}, the runs of the sample, got "
            f"{at.min() + 1} to {at.max() + 1}"
        )
    twice = table["point"][table["point"].duplicated()]
    if len(twice):
        raise ConfigurationError(
            f"point: must be there once, for the seed is a factor, got {twice.iloc[0]} again"
        )
    other = table[SEED_FACTOR].to_numpy(np.int64) != sample.seeds[at]
    if other.any():
        first = int(other.argmax())
        raise ConfigurationError(
            f"seed: must be that of the sample, {sample.seeds[at[first]]} at point "
            f"{at[first] + 1}, got {table[SEED_FACTOR].iloc[first]}"
        )
    return at
