"""Sobol' indices of an analysed sample: their numbers, and what they say in words."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil, log2
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..layout import fitted, table
from ..results.definitions import LOST
from ..study.space import SEED_FACTOR, Sample
from ..words.numbers import minus
from ..words.shares import percent, rough_percent

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Scale = Literal["none", "log"]
WIDEST = 0.2
"""Width of an interval from which on more base rows are advised."""
WHOLE = 0.9
"""Width from which on an interval may be as wide for half as many base rows."""
NEGLIGIBLE = 0.05
"""Total index below which a factor is not named in the answer."""
LEAST_EVENTS = 20
"""Independent runs off the commonest value that indices can be made of."""
TAIL, HEAVY = 0.01, 0.5
"""Tails are heavy if this share of the runs, the farthest, has so much of the variance."""
CHANCE = "chance (the seed)"


@dataclass(frozen=True, eq=False)
class SobolIndices:
    """Sobol' indices of a response.

    Attributes
    ----------
    response, transform
        The analysed quantity; with ``log`` its natural logarithm.
    sample
        The runs that were analysed.
    values
        The response of each run, not transformed; shape (rows,).
    done
        Whether all runs of a base row were made; shape (base rows,).
    used
        Whether a base row counts; shape (base rows,). Those with a run without a finite response do
        not.
    indices
        One row per factor, the last for the seed: ``first``, ``first_low``, ``first_high``,
        ``total``, ``total_low``, ``total_high``: the indices and their confidence intervals, all of
        them from 0 to 1.
    tail
        Share of the variance that the farthest 1 % of the runs make.
    confidence
        Of the intervals.
    lost
        Share of lost runs, where it is known.
    label
        The response's name for people, if it has one.
    """

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
        """Runs that were analysed."""
        return int(self.used.sum()) * self.sample.runs_per_row

    @property
    def left_out(self) -> int:
        """Base rows without a response in all of their runs."""
        return int((self.done & ~self.used).sum())

    @property
    def share_left_out(self) -> float:
        """Share of the base rows that are left out, of those that are done."""
        return self.left_out / int(self.done.sum())

    @property
    def dropped(self) -> int:
        """Runs without a finite response."""
        rows = self.values.reshape(self.sample.base_rows, -1)[self.done]
        return int((~np.isfinite(rows)).sum())

    @property
    def few(self) -> int | None:
        """Independent runs that differ from the others, if indices of so few say little."""
        number = events(self.independent)
        return number if number < LEAST_EVENTS else None

    @property
    def independent_runs(self) -> NDArray[np.int64]:
        """The runs at A and at B, from 0; shape (2, base rows used)."""
        at_a = np.flatnonzero(self.used) * self.sample.runs_per_row
        return np.array([at_a, at_a + self.sample.runs_per_row - 1])

    @property
    def independent(self) -> Floats:
        """The response in the independent runs; shape (2, base rows used)."""
        return self.values[self.independent_runs]

    @property
    def is_flag(self) -> bool:
        """Whether the response is 0 or 1, as ``lost``."""
        return self.transform == "none" and bool(np.isin(self.independent, (0.0, 1.0)).all())

    @property
    def heavy(self) -> bool:
        """Whether few runs make most of the variance."""
        return self.transform == "none" and not self.is_flag and self.tail > HEAVY

    @property
    def widest(self) -> float:
        """Width of the widest interval."""
        i = self.indices
        widths = [i["first_high"] - i["first_low"], i["total_high"] - i["total_low"]]
        return float(max(width.max() for width in widths))

    @property
    def base_rows_needed(self) -> int:
        """Base rows for intervals that are no wider than `WIDEST`, as widths fall with 1/√n."""
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


# --- Sentences -----------------------------------------------------------------------------------


def answer(found: SobolIndices, most: int = 2) -> str:
    """What explains the variance, in a sentence: the largest total indices, and chance."""
    ranked = found.ranked().drop(index=SEED_FACTOR)
    named = [str(name) for name in ranked.index[ranked["total"] >= NEGLIGIBLE][:most]]
    of = f"of the variance of {found.quantity}, interactions included"
    if found.few is not None:
        text = f"Too few runs differ to say what explains the variance of {found.quantity}: "
        return _without(found, f"{text}{found.few} of {found.independent.size} independent ones.")
    rough = found.widest > WIDEST
    chance = _total(found, SEED_FACTOR)
    if named:
        text = f"{_total(found, named[0])} {of}, is explained by {found.name_of(named[0])}"
        text += "".join(f", {_total(found, name)} by {found.name_of(name)}" for name in named[1:])
        comma = "," if len(named) > 1 else ""
        text = f"{'Roughly ' if rough else ''}{text}{comma} and {chance} by {CHANCE}."
        return _without(found, text)
    high = float(ranked["total_high"].max())
    if high <= NEGLIGIBLE:
        text = f"Each factor explains less than {rough_percent(NEGLIGIBLE)} {of}"
    else:
        text = (
            f"No factor stands out: estimates are below {rough_percent(NEGLIGIBLE)} {of}, but "
            f"intervals reach up to {rough_percent(high)}"
        )
    roughly = "roughly " if rough else ""
    return _without(found, f"{text}; {CHANCE} explains {roughly}{chance}.")


def _without(found: SobolIndices, sentence: str) -> str:
    """The sentence; it begins with the base rows that are left out, if there are any."""
    gone, rows = found.left_out, int(found.done.sum())
    if not gone:
        return sentence
    return (
        f"Without {rough_percent(found.share_left_out)} of the base rows ({gone} of {rows}), where "
        f"a run has no response: {sentence[0].lower()}{sentence[1:]}"
    )


def summary(found: SobolIndices, width: int | None = None) -> str:
    """The answer, the table of indices, and what is to be minded.

    Parameters
    ----------
    width
        Columns to fit into; None: sentences are not wrapped.
    """
    columns = ["first", "low", "high", "total", "low", "high"]
    ranked = found.ranked()
    rows = [
        (found.name_of(str(name)), *(minus(f"{value:z.3f}") for value in row))
        for name, row in zip(ranked.index, ranked.to_numpy(), strict=True)
    ]
    lines = [
        answer(found),
        "",
        f"Sobol' indices of {found.quantity}, {percent(found.confidence, '.4g')} intervals:",
        *table(rows, width, ("", *columns), range(1, len(columns) + 1)),
        *notes(found),
    ]
    return fitted("\n".join(lines), width)


def notes(found: SobolIndices) -> list[str]:
    """What is to be minded, in sentences."""
    return [*_notes(found)]


def _notes(found: SobolIndices) -> Iterator[str]:
    sample = found.sample
    rows = int(found.used.sum())
    yield (
        f"{rows} base rows of {sample.runs_per_row} runs: {found.runs} runs, {2 * rows} of them "
        "independent."
    )
    if found.indices["total"].sum() > 1:
        yield (
            "Totals add up to more than 100 %: an interaction counts for each of its inputs, and "
            "estimates scatter."
        )
    unfinished = int((~found.done).sum())
    if unfinished:
        yield f"{unfinished} of {sample.base_rows} base rows have runs that are not done yet."
    gone = found.left_out
    if gone:
        without = found.dropped
        yield (
            f"{gone} of {rows + gone} base rows {'is' if gone == 1 else 'are'} left out, for "
            f"{without} of their runs {'has' if without == 1 else 'have'} no finite response: the "
            "others need not stand for the space, and their factors may depend on each other."
        )
    if sample.version == 1:
        yield (
            "This study was begun with the sample of an earlier version, whose indices can be off "
            "by more than their intervals; in another folder, the study begins with a new sample."
        )
    if found.lost is not None:
        explained = f" {LOST}" if found.lost else ""
        yield f"{rough_percent(found.lost)} of the runs are lost.{explained}"
    if found.few is not None:
        yield (
            f"Only {found.few} of the {2 * rows} independent runs "
            f"{'differs' if found.few == 1 else 'differ'} from the others: indices of so few say "
            f"little; {LEAST_EVENTS} or more are needed."
        )
    if found.heavy:
        positive = bool((found.values[np.isfinite(found.values)] > 0).all())
        yield (
            f"Heavy tails: {rough_percent(TAIL)} of the runs make {rough_percent(found.tail)} of "
            "the variance, and the indices are those of these few"
            + ("; analyse the logarithm." if positive else ".")
        )
    needed = found.base_rows_needed
    if needed > sample.base_rows:
        more = (needed - sample.base_rows) * sample.runs_per_row
        about = "about" if found.widest < WHOLE else "at least"
        yield (
            f"The widest interval is {found.widest:.2f} wide: for {WIDEST} {about} {needed} base "
            f"rows are needed, {more} more runs."
        )


def events(independent: Floats) -> int:
    """Independent runs that do not have the commonest value."""
    return independent.size - int(np.unique(independent, return_counts=True)[1].max())


def _total(found: SobolIndices, name: str) -> str:
    """The total index of a factor in per cent."""
    return rough_percent(float(found.indices["total"][name]))
