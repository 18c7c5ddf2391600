"""A processed log in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Protocol

import pandas as pd

from ..data.tables import Columns
from ..data.truth import Truth
from ..errors import shortened
from ..layout import WIDTH, fitted, shorter
from ..logs.log import Log
from ..scenario.labels import RAW
from ..words.lists import counted
from ..words.numbers import is_missing, meters, minus, number, rounded
from ..words.shares import percent
from .columns import AGREEMENT, RECEIVERS, RESIDUALS


class Told(Protocol):
    """What the texts need of a `sblcosim.Processed`."""

    @property
    def log(self) -> Log: ...
    @property
    def truth(self) -> Truth | None: ...
    @property
    def main(self) -> str: ...
    @property
    def receivers(self) -> pd.DataFrame: ...
    @property
    def residuals(self) -> pd.DataFrame: ...
    @property
    def agreement(self) -> pd.DataFrame: ...
    @property
    def remarks(self) -> Sequence[str]: ...


FAIR = (0.5, 2.0)
"""A claim within these factors of the error made is about right."""
_LABEL = 16
_DIFFERENT = 0.02
"""Relative difference from which the horizontal error is told, too."""
_TOO_MANY = 3.0
"""Ratio of the mean NIS to the expected one from which it is told."""
_NO_TRUTH = (
    "There is no truth: residuals and agreement tell whether ranges, depths and receivers "
    "contradict each other, not how far off the estimates are."
)
_NOTHING = "There is no truth, and nothing to compare the estimates with."
_NOTES = (
    "Residual: range minus that of the estimates; offset is the median, std is robust, slope is "
    "over the range, tails are beyond four std.",
)


def of_log(result: Told, verbose: bool = False, width: int | None = None) -> str:
    """Verdicts, tables and remarks."""
    lines = [*verdicts(result), ""]
    size = width or WIDTH
    if result.truth is not None:
        lines += [*_table(RECEIVERS, result.receivers, size), ""]
    lines += _residuals(result, size, verbose)
    agreement = result.agreement[result.agreement["n"] > 0]
    if len(agreement) and (verbose or result.truth is None):
        lines += [*_table(AGREEMENT, agreement, size), ""]
    if result.truth is None:
        compared = len(result.residuals) or len(agreement)
        lines.append(_NO_TRUTH if compared else _NOTHING)
    if verbose:
        lines += _NOTES
    if result.log.called not in (result.log.name, result.log.source):
        lines.append(f"log: {shortened(result.log.called)}")
    lines += result.remarks
    return fitted("\n".join(lines).rstrip(), width)


def _residuals(result: Told, width: int, verbose: bool) -> list[str]:
    """Residuals: of one filter in detail, of several side by side, with --verbose all in detail."""
    residuals = result.residuals
    if not len(residuals):
        return []
    labels = residuals.index.get_level_values(0)
    if not verbose and len([label for label in labels.unique() if label != RAW]) > 1:
        return [*_beside(residuals, width), ""]
    if not verbose and result.main:
        residuals = residuals[labels == result.main]
    return [*_table(RESIDUALS, residuals, width), ""]


def _beside(residuals: pd.DataFrame, width: int) -> Iterator[str]:
    """Offset and standard deviation by beacon, with a column for each receiver."""
    labels = [*residuals.index.get_level_values(0).unique()]
    samples = [*residuals.index.get_level_values(1).unique()]
    columns = []
    for label in labels:
        own = residuals.loc[label]
        cells = [
            _with_std(own.offset_m[it], own.std_m[it]) if it in own.index else "–"
            for it in samples
        ]
        size = max(map(len, cells))
        head = shorter(str(label), max(size, _LABEL))
        columns.append([it.rjust(max(size, len(head))) for it in (head, *cells)])
    first = min(max(map(len, map(str, samples))), _LABEL)
    names = [shorter(str(it), first).ljust(first) for it in ("", *samples)]
    yield f"{RESIDUALS.title} [{RESIDUALS.unit}]: offset ± std"
    while columns:
        fits, room = 0, width - first
        while fits < len(columns) and (not fits or room >= len(columns[fits][0]) + 2):
            room -= len(columns[fits][0]) + 2
            fits += 1
        for row in zip(names, *columns[:fits], strict=True):
            yield "  ".join(row)
        columns = columns[fits:]


def _with_std(offset: float, std: float) -> str:
    """Both [m] with as many decimals as give the deviation two digits, at most millimetres."""
    decimals = 3 if std < 0.0995 else 2 if std < 0.995 else 1
    return minus(f"{round(offset, decimals) + 0.0:.{decimals}f} ± {std:.{decimals}f}")


def verdicts(result: Told) -> Iterator[str]:
    """A line for each receiver."""
    for label, row in result.receivers.iterrows():
        yield f"{label}: {_verdict(result, row)}"


def _verdict(result: Told, row: Any) -> str:
    if not row["estimates"]:
        failure = row.get("failure")
        return f"failed: {failure}" if isinstance(failure, str) else "no estimate"
    plane = result.log.meta.dimension == 2
    parts = []
    made = row.get("horizontal_rms_m")
    if made is not None and not is_missing(made):
        which = ("horizontal" if plane else "total") + "_{}_m"
        other = not plane and abs(made - row["total_rms_m"]) > _DIFFERENT * made
        flat = f" ({meters(made)} horizontally)" if other else ""
        parts.append(
            f"{meters(row[which.format('rms')])} RMS{flat}, 95 % within "
            f"{meters(row[which.format('p95')])}"
        )
    else:
        parts.append(f"{counted(int(row['estimates']), 'estimate')}, the first after "
                     f"{rounded(row['first_fix_s'])} s")
    claimed = row.get("claimed_rms_m")
    if claimed is not None and not is_missing(claimed):
        parts.append(_claim(row, float(claimed)))
    nis, expected = row.get("nis"), row.get("nis_expected")
    if nis is not None and not is_missing(nis) and nis > _TOO_MANY * expected:
        parts.append(f"its innovations are {number((nis / expected) ** 0.5)} times as large as it "
                     "expects")
    restarts = row.get("restarts")
    if restarts is not None and not pd.isna(restarts) and restarts:
        parts.append(f"restarted {counted(int(restarts), 'time')}")
    return "; ".join(parts)


def _claim(row: Any, claimed: float) -> str:
    ratio = row.get("claimed_over_made")
    words = f"claims {meters(claimed)} horizontally"
    if ratio is None or is_missing(ratio):
        return words
    if ratio < FAIR[0]:
        return f"{words}: too little, by a factor of {number(1 / ratio)}"
    if ratio > FAIR[1]:
        return f"{words}: too much, by a factor of {number(ratio)}"
    return words


def _table(declared: Columns, table: pd.DataFrame, width: int) -> Iterator[str]:
    """The printed columns of a table."""
    shown = [c for c in declared.printed if c.name in table]
    labels = [_name(index) for index in table.index]
    cells = [[_cell(row[c.name], c) for c in shown] for _, row in table.iterrows()]
    heads = [declared.heading(c) for c in shown]
    sizes = [max(map(len, (head, *(row[i] for row in cells)))) for i, head in enumerate(heads)]
    room = max(width - sum(size + 2 for size in sizes), _LABEL)
    first = min(max(map(len, (*labels, declared.title))), room)
    title = f"{declared.title} [{declared.unit}]" if declared.title else ""
    if title:
        yield title
    yield f"{'':<{first}}" + "".join(f"  {h:>{s}}" for h, s in zip(heads, sizes, strict=True))
    for label, row in zip(labels, cells, strict=True):
        yield f"{shorter(label, first):<{first}}" + "".join(
            f"  {cell:>{size}}" for cell, size in zip(row, sizes, strict=True)
        )


def _name(index: Any) -> str:
    if isinstance(index, tuple):
        one, other = index
        return f"{one} – {other}"
    return str(index)


def _cell(value: Any, column: Any) -> str:
    if value is None or pd.isna(value):
        return "–"
    if column.type is int:
        return f"{int(value):,}"
    if column.name == "tails":
        return percent(float(value), ".1f")
    return rounded(float(value))
