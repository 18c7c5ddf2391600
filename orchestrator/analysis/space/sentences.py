"""Sobol' indices in sentences."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...judge.definitions import LOST
from ...layout import fitted, table
from ...study.space import SEED_FACTOR
from ...words.numbers import minus
from ...words.shares import percent, rough_percent
from .analysis import CHANCE, LEAST_EVENTS, TAIL, WIDEST, Sensitivity

WHOLE = 0.9
"""Width above which half as many base rows might give an equally wide interval."""
NEGLIGIBLE = 0.05
"""Total index below which a factor is not named in the answer."""


def answer(sobol: Sensitivity, most: int = 2) -> str:
    """The sources of the variance, in a sentence: the largest total indices, and chance."""
    ranked = sobol.ranked().drop(index=SEED_FACTOR)
    named = [str(name) for name in ranked.index[ranked["total"] >= NEGLIGIBLE][:most]]
    of = f"of the variance of {sobol.quantity}, including interactions"
    if sobol.few is not None:
        text = f"Too few runs differ to explain the variance of {sobol.quantity}: only "
        return _without(sobol, f"{text}{sobol.few} of {sobol.independent.size} independent runs.")
    rough = sobol.widest > WIDEST
    chance = _total(sobol, SEED_FACTOR)
    if named:
        text = f"{_total(sobol, named[0])} {of}, is explained by {sobol.name_of(named[0])}"
        text += "".join(f", {_total(sobol, name)} by {sobol.name_of(name)}" for name in named[1:])
        comma = "," if len(named) > 1 else ""
        text = f"{'Roughly ' if rough else ''}{text}{comma} and {chance} by {CHANCE}."
        return _without(sobol, text)
    high = float(ranked["total_high"].max())
    if high <= NEGLIGIBLE:
        text = f"Each factor explains less than {rough_percent(NEGLIGIBLE)} {of}"
    else:
        text = (
            f"No factor stands out: estimates are below {rough_percent(NEGLIGIBLE)} {of}, but "
            f"intervals reach up to {rough_percent(high)}"
        )
    roughly = "roughly " if rough else ""
    return _without(sobol, f"{text}. {CHANCE.capitalize()} explains {roughly}{chance}.")


def _without(sobol: Sensitivity, sentence: str) -> str:
    """The sentence, preceded by the base rows that are left out, if any."""
    gone, rows = sobol.left_out, int(sobol.done.sum())
    if not gone:
        return sentence
    return (
        f"Without the {rough_percent(sobol.share_left_out)} of base rows ({gone} of {rows}) in "
        f"which a run has no response: {sentence[0].lower()}{sentence[1:]}"
    )


def summary(sobol: Sensitivity, width: int | None = None) -> str:
    """The answer, the table of indices, and the notes.

    Parameters
    ----------
    width
        Columns to fit into; None: sentences are not wrapped.
    """
    columns = ["first", "low", "high", "total", "low", "high"]
    ranked = sobol.ranked()
    rows = [
        (sobol.name_of(str(name)), *(minus(f"{value:z.3f}") for value in row))
        for name, row in zip(ranked.index, ranked.to_numpy(), strict=True)
    ]
    lines = [
        answer(sobol),
        "",
        f"Sobol' indices of {sobol.quantity}, {percent(sobol.confidence, '.4g')} intervals:",
        *table(rows, width, ("", *columns), range(1, len(columns) + 1)),
        *notes(sobol),
    ]
    return fitted("\n".join(lines), width)


def notes(sobol: Sensitivity) -> list[str]:
    """The limits of these indices, in sentences."""
    return [*_notes(sobol)]


def _notes(sobol: Sensitivity) -> Iterator[str]:
    sample = sobol.sample
    rows = int(sobol.used.sum())
    yield (
        f"{rows} base rows of {sample.runs_per_row} runs: {sobol.runs} runs, {2 * rows} of them "
        "independent."
    )
    if sobol.indices["total"].sum() > 1:
        yield (
            "Totals exceed 100 %, because an interaction counts for each of its factors, and "
            "estimates scatter."
        )
    unfinished = int((~sobol.done).sum())
    if unfinished:
        yield f"{unfinished} of {sample.base_rows} base rows have unfinished runs."
    gone = sobol.left_out
    if gone:
        without = sobol.dropped
        yield (
            f"{gone} of {rows + gone} base rows {'is' if gone == 1 else 'are'} left out, because "
            f"{without} of their runs {'has' if without == 1 else 'have'} no finite response. The "
            "others may not represent the space, and their factors may depend on each other."
        )
    if sample.version == 1:
        yield (
            "This study has the sample of an earlier version, whose indices can be off by more "
            "than their intervals. In another folder, the study gets a new sample."
        )
    if sobol.lost is not None:
        explained = f" {LOST}" if sobol.lost else ""
        yield f"{rough_percent(sobol.lost)} of the runs are lost.{explained}"
    if sobol.few is not None:
        yield (
            f"Only {sobol.few} of the {2 * rows} independent runs "
            f"{'differs' if sobol.few == 1 else 'differ'} from the others. Useful indices need "
            f"{LEAST_EVENTS} or more."
        )
    if sobol.heavy:
        positive = bool((sobol.values[np.isfinite(sobol.values)] > 0).all())
        yield (
            f"Heavy tails: {rough_percent(TAIL)} of the runs contribute "
            f"{rough_percent(sobol.tail)} of the variance, and the indices are those of these few"
            + ("; analyse the logarithm." if positive else ".")
        )
    needed = sobol.base_rows_needed
    if needed > sample.base_rows:
        more = (needed - sample.base_rows) * sample.runs_per_row
        about = "about" if sobol.widest < WHOLE else "at least"
        yield (
            f"The widest interval is {sobol.widest:.2f} wide. A width of {WIDEST} needs {about} "
            f"{needed} base rows, which is {more} more runs."
        )


def _total(sobol: Sensitivity, name: str) -> str:
    """The total index of a factor in per cent."""
    return rough_percent(float(sobol.indices["total"][name]))
