"""Sobol' indices: the share of a response's variance that each factor of a space explains.

The first-order index of a factor is the share of the variance that its value alone explains. The
total index is the share that would remain if all other factors were known; it includes interactions
with them. The seed is a factor like the others (`sblcosim.study.space`), so its indices are the
share of chance.

Estimates and intervals come from `jackknife`, or from `two_values` for a response with two values.
In simulations of 95 % intervals (`tests/unit/orchestrator/test_coverage.py`), each interval holds
its index in at least 88 % of the samples with 16 base rows, and in 92 % with 64 or more. No
interval accounts for a step or corner in a part of the space that is too small to contain a run.

Errors of position have long tails, so a few runs would dominate the variance. The indices are
therefore those of the logarithm. Those of whether a run is lost are added.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from html import escape
from math import ceil, log2
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ... import artifacts
from ...answer import Answer
from ...catalogue import Job
from ...errors import ConfigurationError, check_choice, nearest, quoted
from ...lazy import Module
from ...shown import Picture, folded, page, verbatim
from ...study.space import LEAST_BASE_ROWS, SEED_FACTOR, Sample
from ...words.shares import percent, rough_percent
from . import jackknife, two_values
from .tables import INDICES

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ...style import ThemeName

sentences: Any = Module("sblcosim.analysis.space.sentences")
drawings: Any = Module("sblcosim.analysis.space.figures")

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Scale = Literal["none", "log"]
WIDEST = 0.2
"""Width of an interval above which more base rows are advised."""
LEAST_EVENTS = 20
"""Fewest independent runs without the commonest value for useful indices."""
TAIL, HEAVY = 0.01, 0.5
"""Tails are heavy if this share of the runs, the farthest, has this share of the variance."""
CHANCE = "chance (the seed)"
MOST_LEFT_OUT = 0.2
"""Share of base rows without a response above which there are no indices.

Factors depend on each other in the remaining rows, unless the rows without a response fill a box.
For y = a, whose indices are 1, the estimates are then too low: by at most 0.03 if 15 % of the rows
are left out, 0.05 at 20 %, 0.13 at 35 % and 0.22 at 50 %, over ten shapes of the part left out.
"""


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivity(Answer):
    """Sobol' indices of a response.

    Attributes
    ----------
    response, transform
        The analysed quantity; with ``log``, its natural logarithm.
    sample
        The analysed runs.
    values
        The response of each run before any transform; shape (rows,).
    done
        Whether all runs of a base row are done; shape (base rows,).
    used
        Whether a base row counts; shape (base rows,). A row with a run without a finite response
        does not.
    indices
        One row per factor, the last for the seed: the indices ``first`` and ``total`` and their
        confidence intervals ``first_low``, ``first_high``, ``total_low``, ``total_high``, all from
        0 to 1.
    tail
        Share of the variance that the farthest 1 % of the runs contribute.
    confidence
        Confidence of the intervals.
    lost
        Share of lost runs, if it is known.
    label
        Label of the response, for people, if it has one.
    """

    columns = MappingProxyType({"indices": INDICES})

    response: str
    transform: Scale
    sample: Sample
    values: Floats
    done: Flags
    used: Flags
    indices: pd.DataFrame
    tail: float
    confidence: float
    lost: float | None = None
    label: str = ""

    @property
    def quantity(self) -> str:
        """The analysed quantity in words."""
        return f"{'ln ' if self.transform == 'log' else ''}{self.label or self.response}"

    @property
    def runs(self) -> int:
        """Number of analysed runs."""
        return int(self.used.sum()) * self.sample.runs_per_row

    @property
    def left_out(self) -> int:
        """Number of base rows that lack a response in some of their runs."""
        return int((self.done & ~self.used).sum())

    @property
    def share_left_out(self) -> float:
        """Share of the finished base rows that are left out."""
        return self.left_out / int(self.done.sum())

    @property
    def dropped(self) -> int:
        """Number of runs without a finite response."""
        rows = self.values.reshape(self.sample.base_rows, -1)[self.done]
        return int((~np.isfinite(rows)).sum())

    @property
    def few(self) -> int | None:
        """Number of independent runs that differ from the others, if it is too small."""
        number = events(self.independent)
        return number if number < LEAST_EVENTS else None

    @property
    def independent_runs(self) -> NDArray[np.int64]:
        """Indices of the runs at A and at B, from 0; shape (2, base rows used)."""
        at_a = np.flatnonzero(self.used) * self.sample.runs_per_row
        return np.array([at_a, at_a + self.sample.runs_per_row - 1])

    @property
    def independent(self) -> Floats:
        """The response in the independent runs; shape (2, base rows used)."""
        return self.values[self.independent_runs]

    @property
    def is_flag(self) -> bool:
        """Whether the response is 0 or 1, such as ``lost``."""
        return self.transform == "none" and bool(np.isin(self.independent, (0.0, 1.0)).all())

    @property
    def heavy(self) -> bool:
        """Whether few runs contribute most of the variance."""
        return self.transform == "none" and not self.is_flag and self.tail > HEAVY

    @property
    def widest(self) -> float:
        """Width of the widest interval."""
        i = self.indices
        widths = [i["first_high"] - i["first_low"], i["total_high"] - i["total_low"]]
        return float(max(width.max() for width in widths))

    @property
    def base_rows_needed(self) -> int:
        """Number of base rows for intervals no wider than `WIDEST`, as widths fall with 1/√n."""
        n = self.sample.base_rows
        if self.widest <= WIDEST:
            return n
        return int(2 ** ceil(log2(n * (self.widest / WIDEST) ** 2)))

    def ranked(self) -> pd.DataFrame:
        """The indices, the largest total first."""
        return self.indices.sort_values("total", ascending=False, kind="stable")

    def name_of(self, factor: str) -> str:
        """Name of a factor for people."""
        labels = {f.name: f.label or f.name for f in self.sample.factors}
        return labels.get(factor, CHANCE)

    @property
    def title(self) -> str:
        """Title of a page."""
        return f"Sobol' indices of {self.quantity}"

    @property
    def answer(self) -> str:
        """The factors that explain most, in a few sentences."""
        return str(sentences.answer(self))

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The indices."""
        table = self.indices.reset_index()
        return {"indices": table.assign(response=self.response, transform=self.transform)}

    @property
    def figures(self) -> list[Job]:
        """The indices, and the response against each factor."""
        return [
            Job("indices", drawings.later("plot_indices"), (self,)),
            Job("scatter", drawings.later("plot_scatter"), (self,)),
        ]

    @property
    def remarks(self) -> list[str]:
        """Remarks that are needed to read the numbers, one line each."""
        found: list[str] = sentences.notes(self)
        return found

    def to_json(self) -> dict[str, Any]:
        """The indices as plain data."""
        plain: dict[str, Any] = artifacts.plain({
            "response": self.response, "unit": "", "answer": self.answer,
            "transform": self.transform, "confidence": self.confidence, "runs": self.runs,
            "dropped": self.dropped, "left_out": self.share_left_out,
            "indices": INDICES.rows(self.tables["indices"]), "notes": self.remarks,
        })  # fmt: skip
        return plain

    def manifest(self) -> dict[str, Any]:
        """The question."""
        return {
            "analysis": {
                "response": self.response, "factors": list(self.indices.index),
                "transform": self.transform,
            }
        }  # fmt: skip

    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """The answer, the table of indices, and the notes.

        Parameters
        ----------
        verbose
            Has no effect.
        width
            Columns to fit into; None: sentences are not wrapped.
        """
        text: str = sentences.summary(self, width)
        return text

    def _gist(self) -> str:
        totals = self.ranked()["total"][:3]
        largest = ", ".join(f"{name} {total:.2f}" for name, total in totals.items())
        return f"of {self.runs} runs, total indices of {self.quantity}: {largest}, …"

    def _repr_html_(self) -> str:
        table = self.ranked().rename(index=self.name_of)
        return page(
            self.title,
            f"<p>{escape(self.answer)}</p>",
            table.to_html(float_format="{:.3f}".format, border=0),
            folded("How to read the numbers", verbatim("\n".join(self.remarks))),
        )

    def plot_indices(self, ax: Axes | None = None, theme: ThemeName = "light") -> Picture:
        """See `sblcosim.analysis.space.figures.plot_indices`."""
        return Picture(drawings.plot_indices(self, ax, theme), ax)

    def plot_scatter(
        self, ax: Sequence[Axes] | None = None, theme: ThemeName = "light"
    ) -> Picture:
        """See `sblcosim.analysis.space.figures.plot_scatter`."""
        return Picture(drawings.plot_scatter(self, ax, theme), ax)


# --- Estimation ----------------------------------------------------------------------------------


def indices(
    sample: Sample,
    values: Floats,
    response: str = "response",
    *,
    transform: Scale = "none",
    confidence: float = 0.95,
) -> Sensitivity:
    """First-order and total Sobol' indices of a response, with intervals.

    Parameters
    ----------
    values
        The response of each run of the sample; shape (rows,). A base row with a value that is not
        finite is left out.
    response
        Name of the response, for messages and texts.
    transform
        ``log`` analyses the natural logarithm.

    Raises
    ------
    ConfigurationError
        The values do not belong to the sample, too few base rows remain, too many are left out, the
        response does not vary, or it is not positive and has no logarithm.
    """
    values = np.asarray(values, np.float64)
    if values.shape != (len(sample),):
        raise ConfigurationError(
            f"{response}: must have a value for each of the {len(sample)} runs of the sample, got "
            f"shape {values.shape}"
        )
    done = np.ones(sample.base_rows, np.bool_)
    return _indices(sample, values, done, response, transform, confidence)


def _indices(
    sample: Sample, values: Floats, done: Flags, response: str, transform: Scale, confidence: float
) -> Sensitivity:
    """Like `indices`; only base rows that are done can lack a response."""
    check_choice("transform", transform, get_args(Scale))
    if not 0 < confidence < 1:
        raise ConfigurationError(f"confidence: must be between 0 and 1, got {confidence}")
    by_row = values.reshape(sample.base_rows, -1)
    used: Flags = np.asarray(np.isfinite(by_row).all(axis=1))
    y = _checked(by_row[used], int(done.sum()), response, transform)
    table = _table(sample, y, confidence)
    independent = jackknife.scaled(y[:, [0, -1]])
    around = np.sort(((independent - independent.mean()) ** 2).ravel())
    tail = float(around[-ceil(TAIL * len(around)):].sum() / around.sum())
    return Sensitivity(response, transform, sample, values, done, used, table, tail, confidence)


def _checked(y: Floats, done: int, response: str, transform: Scale) -> Floats:
    """The base rows to analyse, transformed; shape (base rows, runs of each)."""
    rows, runs = y.shape
    if rows < LEAST_BASE_ROWS:
        raise ConfigurationError(
            f"{response}: must be finite in all {runs} runs of at least {LEAST_BASE_ROWS} "
            f"base rows, got {rows}"
        )
    if rows < (1 - MOST_LEFT_OUT) * done:
        raise ConfigurationError(
            f"{response}: must be finite in all {runs} runs of at least "
            f"{percent(1 - MOST_LEFT_OUT, '.0f')} of the base rows, got "
            f"{rough_percent(rows / done)}: {done - rows} of {done} are left out, and the others "
            "do not represent the space; analyse a response that every run has, or narrow the "
            "ranges"
        )
    if transform == "log":
        if (y <= 0).any():
            raise ConfigurationError(
                f"{response}: must be positive for its logarithm, got {y.min():g}"
            )
        y = np.log(y)
    if (y[:, [0, -1]] == y[0, 0]).all():
        raise ConfigurationError(
            f"{response}: must vary over the runs, got {y[0, 0]:g} in all independent runs"
        )
    return y


def _table(sample: Sample, y: Floats, confidence: float) -> pd.DataFrame:
    """The indices of all columns with their intervals, from 0 to 1."""
    first, total = jackknife.indices(y, confidence)
    if np.isin(y, (y.min(), y.max())).all():
        pairs = two_values.intervals((y == y.max()) * 1.0, confidence)
        first, total = first.within(*pairs[0][1:]), total.within(*pairs[1][1:])
    elif events(y[:, [0, -1]]) < LEAST_EVENTS:
        for found in (first, total):
            found.low[:], found.high[:] = 0.0, 1.0
    columns: dict[str, Floats] = {}
    for name, found in (("first", first), ("total", total)):
        columns |= {name: found.value, f"{name}_low": found.low, f"{name}_high": found.high}
    return pd.DataFrame(columns, index=pd.Index(sample.columns, name="factor"))


# --- Tables of runs ------------------------------------------------------------------------------


def of_table(
    sample: Sample,
    table: pd.DataFrame,
    response: str,
    *,
    transform: Scale = "log",
    confidence: float = 0.95,
) -> tuple[Sensitivity, ...]:
    """Indices of a response of a table of runs, and of whether its receiver is lost.

    Parameters
    ----------
    table
        One row per run, in any order: ``point`` (number of the run in the sample, from 1), ``seed``
        and the responses. Runs may be missing.
    response
        Column ``RECEIVER.RESPONSE``.

    Returns
    -------
    tuple
        The indices of the response and, if some of the independent runs of the receiver are lost
        and some are not, those of ``RECEIVER.lost``.

    Raises
    ------
    ConfigurationError
        For the reasons of `indices`, or because there is no such column or the runs do not belong
        to the sample.
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

    made = np.zeros(len(sample), np.bool_)
    made[at] = True
    done: Flags = np.asarray(made.reshape(sample.base_rows, -1).all(axis=1))

    def found(column: str, transform: Scale) -> Sensitivity:
        return _indices(sample, values(column), done, column, transform, confidence)

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
    """Number of each row's run in the sample, from 0."""
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
            f"point: must occur once, because the seed is a factor, got {twice.iloc[0]} twice"
        )
    other = table[SEED_FACTOR].to_numpy(np.int64) != sample.seeds[at]
    if other.any():
        first = int(other.argmax())
        raise ConfigurationError(
            f"seed: must be that of the sample, {sample.seeds[at[first]]} at point "
            f"{at[first] + 1}, got {table[SEED_FACTOR].iloc[first]}"
        )
    for factor in sample.factors:
        if factor.numeric and factor.name in table:
            expected = sample.values[factor.name].to_numpy(np.float64)[at]
            got = table[factor.name].to_numpy(np.float64)
            if not np.allclose(got, expected, rtol=1e-12, atol=0):
                first = int((~np.isclose(got, expected, rtol=1e-12, atol=0)).argmax())
                raise ConfigurationError(
                    f"{factor.name}: must be that of the sample, {expected[first]:g} at point "
                    f"{at[first] + 1}, got {got[first]:g}; is it another version of the sample?"
                )
    return at


def events(independent: Floats) -> int:
    """Number of independent runs that do not have the commonest value."""
    return independent.size - int(np.unique(independent, return_counts=True)[1].max())
