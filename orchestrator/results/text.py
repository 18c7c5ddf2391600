"""A run in words: a verdict for each receiver, tables of its errors, and what they mean."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import nan
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import pandas as pd

from ..data.tables import Columns, TableColumn
from ..judge import possible
from ..judge.columns import CHI_SQUARES, ERRORS, PERCENTILES
from ..judge.consistency import COVARIANCES, Verdict
from ..judge.definitions import AXES, BEYOND_M, FRAMES, MISLEADING, MISLEADING_S, Judged
from ..layout import WIDTH, fitted, shorter
from ..scenario.labels import RAW
from ..words.lists import plural
from ..words.numbers import meters, number, rounded
from ..words.shares import percent

if TYPE_CHECKING:
    from ..data.record import Record
    from ..limits.verdict import Possible
    from .motion import Motion


class ToldResult(Protocol):
    """What the texts need of a `sblcosim.Result`."""

    record: Record
    receivers: tuple[str, ...]
    failures: dict[str, str]

    @property
    def scenario_name(self) -> str: ...

    @property
    def judged(self) -> dict[str, Judged]: ...
    @property
    def title(self) -> str: ...
    @property
    def origins(self) -> Mapping[str, Mapping[str, Any]]: ...
    @property
    def remarks(self) -> Sequence[str]: ...
    @property
    def tracks(self) -> dict[str, pd.DataFrame]: ...
    @property
    def errors(self) -> pd.DataFrame: ...
    @property
    def percentiles(self) -> pd.DataFrame: ...
    @property
    def summary(self) -> pd.DataFrame: ...
    @property
    def consistency(self) -> Mapping[str, Mapping[str, Verdict]]: ...
    @property
    def verdicts(self) -> Mapping[str, Possible]: ...
    @property
    def motion(self) -> Mapping[str, Motion]: ...


_HEADS = {
    "absolute": ("absolute", ""),
    "relative": ("relative to the platform", "as it reports itself"),
    "own_relative": ("relative to the platform's", "true position, own account"),
}
"""Headings of the frames in two lines; `definitions.FRAME_WORDS` fits into no column."""
_SHORT = {"absolute": "absolute", "relative": "relative", "own_relative": "own relative"}
"""Headings of the small table."""
_MEANS = {"relative": "to the platform as it reports itself",
          "own_relative": "to its true position, by own account"}
"""Meaning of these headings, for the line below the table."""
DIFFERENT = 0.01
"""Relative difference from which both the horizontal and the total error are shown."""
_GAP = "  "
_LONGEST_LABEL = 16
"""Longest label in the line of its first row; a longer one has a separate line."""
_SURE = "optimistic"
"""The `Verdict.claim` for a covariance that one run is enough to distrust."""
_FEW = 10
"""With fewer estimates than this, their number is shown if most updates gave none."""
_ONE_RUN = "One run cannot tell whether a covariance is right. A study can."
_CONSISTENCY = {one.name: one.words for one in CHI_SQUARES}
_VERDICTS = {
    "optimistic": "optimistic, errors larger than claimed",
    "pessimistic": "pessimistic, errors smaller than claimed",
}
WITHIN = (
    "95 % within, and the other percentages: order statistics, of n errors the one of rank 0.95 n, "
    "rounded up."
)
"""Definition of the percentages, for people."""
_NOTES = (
    "x, y, z are north, east, down; error = estimate − truth; total = length of the 3-D error.",
    "Relative to the platform as it reports itself: less the mean beacon error (reported − true) "
    "at the estimate's epoch.",
)
_OWN_NOTES = (
    "Relative to the platform's true position, by the receiver's own account: its "
    "relative_position against the truth.",
    "Own relative NEES is of that error, with the relative_covariance.",
)
_RAW_NOTE = "raw is the multilateration fix without a filter. Every run includes it for comparison."
_CLAIM_NOTE = (
    "A receiver claims the RMS error that its covariance expects. NEES shows whether the claim "
    "fits. 'Do not trust' means: even if errors persisted throughout a run, a correct covariance "
    "would give such a NEES in only 1 run of 20."
)
_CONSISTENCY_NOTES = (
    "NEES and NIS are squared errors and innovations, in units of the filter's own covariance.",
    "NEES is of the absolute error, so a GPS error common to all beacons counts. Relative NEES "
    "leaves it out.",
    "The 95 % band is for independent samples. Errors within one run are correlated, so even a "
    "consistent filter leaves the band more often. A test takes the mean over many runs.",
)


def of_run(result: ToldResult, verbose: bool = False, width: int | None = None) -> str:
    """Verdicts, then a small table of the errors.

    Parameters
    ----------
    verbose
        Replace the small table by the errors by axis and all percentages, and add availability,
        NEES and NIS of each receiver, and explanations of these numbers.
    width
        Columns of the terminal; None: sentences are not wrapped.
    """
    size = width or WIDTH
    lines = [*verdicts(result), ""]
    if not verbose:
        return fitted("\n".join([*lines, *overview(result, size)]), width)
    lines += [
        result.title,
        "",
        *errors(result.errors, result.receivers, size),
        "",
        *percentiles(result.percentiles, result.receivers, size),
        "",
        WITHIN,
    ]
    for receiver in result.receivers:
        lines += ["", *about(result, receiver)]
    lines += ["", *notes(result)]
    return fitted("\n".join(lines), width)


def overview(result: ToldResult, width: int = WIDTH) -> Iterator[str]:
    """RMS and 95 % of each receiver's total error [m], in columns for each frame.

    The horizontal error is included if it is `DIFFERENT` in any frame.
    """
    frames = frames_in(result.errors)
    rows: list[tuple[str, list[float]]] = []
    for receiver in result.receivers:
        total, flat = (
            [value for frame in frames for value in _reached(result, receiver, frame, length)]
            for length in ("total", "horizontal")
        )
        rows.append((receiver, total))
        if any(abs(a - b) > DIFFERENT * a for a, b in zip(total, flat, strict=True)):
            rows.append(("  horizontal", flat))
    cells = [(name, [*map(rounded, values)]) for name, values in rows]
    size = max(5, *(len(text) for _, texts in cells for text in texts))
    room = width - 2 * len(frames) * (size + len(_GAP))
    label = min(max(len(name) for name, _ in rows), max(room, _LONGEST_LABEL))
    yield f"{result.title}: error [m]"
    pair = 2 * size + len(_GAP)
    for head in ([f"{_SHORT[frame]:>{pair}}" for frame in frames],
                 [f"{'RMS':>{size}}", f"{'95 %':>{size}}"] * len(frames)):  # fmt: skip
        yield _GAP.join([" " * label, *head])
    for name, texts in cells:
        yield _GAP.join([f"{shorter(name, label):<{label}}", *(f"{t:>{size}}" for t in texts)])
    notes = [f"{_SHORT[frame]}: {_MEANS[frame]}" for frame in frames[1:]]
    if notes:
        yield "; ".join(notes)


def _reached(result: ToldResult, receiver: str, frame: str, length: str) -> tuple[float, float]:
    """RMS and 95 % of a length of the error [m]; NaN without errors in this frame."""
    if (receiver, frame, "total") not in result.errors.index:
        return nan, nan
    axes = ("x", "y") if length == "horizontal" else ("total",)
    found: Any = [result.errors.loc[(receiver, frame, axis), "rms_m"] for axis in axes]
    most: Any = result.percentiles.loc[(receiver, frame, length), "p95_m"]
    return float(np.linalg.norm(found)), float(most)


def verdicts(result: ToldResult) -> Iterator[str]:
    """The outcome: a line for each receiver, what was possible, and remarks on the run.

    An estimator whose own estimates are refused comes first: its line says whose it gives instead.
    """
    refused = _refused(result)
    for receiver, remark in refused.items():
        yield f"{remark}: {_verdict(result, receiver)}"
    for receiver in result.receivers:
        if receiver not in refused:
            yield f"{receiver}: {_verdict(result, receiver)}"
    for message in result.failures.values():
        yield f"failed: {message}"
    yield from possible.lines(result.verdicts)
    told = [found["absolute"] for found in result.consistency.values() if "absolute" in found]
    if any(verdict.claim != _SURE for verdict in told):
        yield _ONE_RUN
    yield from (remark for remark in result.remarks if remark not in refused.values())


def _refused(result: ToldResult) -> dict[str, str]:
    """The remark on each estimator whose own estimates are doubted, and were replaced."""
    return {
        receiver: remark
        for receiver in result.receivers if result.origins.get(receiver, {}).get("doubts")
        for remark in result.remarks if remark.startswith(f"{receiver}: ")
    }


def _verdict(result: ToldResult, receiver: str) -> str:
    row: Any = result.summary.loc[receiver]
    if not row.estimates:
        return f"no estimate; {silence(result, receiver)}"
    which = (receiver, "absolute", "total")
    reached: Any = result.errors.loc[which, "rms_m"]
    most: Any = result.percentiles.loc[which, "p95_m"]
    lost = "lost; " if row.lost else ""
    if row.estimates < _FEW and row.update_share < 0.5:
        updates = row.estimates / row.update_share
        lost += f"{row.estimates} {plural(row.estimates, 'estimate')} in {updates:.0f} updates; "
    misleads = f"; {_misleading(row)}" if pd.notna(row.misleading) and row.misleading else ""
    return (
        f"{lost}{meters(reached)} RMS, 95 % within {meters(most)}; {_claim(result, receiver)}"
        f"{misleads}"
    )


def _misleading(row: Any) -> str:
    """Why a run is misleading: for how long, or by how much on the whole."""
    longest = row.beyond_claim_longest_s
    if longest > MISLEADING_S:
        return f"misleading: for {longest:.0f} s beyond three times what it claims"
    factor = (row.nees_position / row.nees_position_expected) ** 0.5
    return f"misleading: {number(factor)} times as far off as it claims, direction by direction"


def _claim(result: ToldResult, receiver: str) -> str:
    """The error that a receiver claims, and whether to believe it, unless it is lost."""
    judged: Verdict | None = result.consistency[receiver].get("absolute")
    if judged is None:
        return _without_covariance(result, receiver)
    track = result.tracks[receiver]
    variances = (track[[f"std_{axis}_m" for axis in AXES]] ** 2).sum(axis=1, skipna=False)
    said = float(np.sqrt(variances[track["nees_position"].notna()].mean()))
    reached: Any = result.errors.loc[(receiver, "absolute", "total"), "rms_m"]
    if judged.claim == _SURE:
        trust = "do not trust its covariance"
    elif result.summary.loc[receiver, "lost"]:
        return f"claims {meters(said)}"
    elif judged.claim == "fits":
        trust = "looks right"
    else:  # the length may be right although the errors lie where the covariance has little
        fits = (said < reached) == (judged.factor > 1)
        trust = judged.claim if fits else f"{judged.claim} in some direction"
    return f"claims {meters(said)}: {trust}"


def _without_covariance(result: ToldResult, receiver: str) -> str:
    claims = result.judged[receiver].estimates.covariance is not None
    return "its covariance is never positive definite" if claims else "no covariance"


def frames_in(table: pd.DataFrame) -> list[str]:
    """The frames with rows in a table of errors or percentiles."""
    there = set(table.index.get_level_values("frame"))
    return [frame for frame in FRAMES if frame in there or frame != "own_relative"]


def errors(table: pd.DataFrame, receivers: Sequence[str], width: int = WIDTH) -> Iterator[str]:
    """The lines of `metrics.error_table`. Frames that do not fit side by side follow below.

    Parameters
    ----------
    width
        Columns of the terminal.
    """
    yield from _blocks(ERRORS, table, receivers, 9, width)


def percentiles(
    table: pd.DataFrame, receivers: Sequence[str], width: int = WIDTH
) -> Iterator[str]:
    """The lines of `metrics.percentile_table`; width as in `errors`."""
    yield from _blocks(PERCENTILES, table, receivers, 7, width)


def _blocks(
    declared: Columns, table: pd.DataFrame, receivers: Sequence[str], least: int, width: int
) -> Iterator[str]:
    """A table for as many frames as fit side by side, then one for the next.

    Parameters
    ----------
    least
        Width of a column, unless its heading is longer.
    """
    heads = {column: declared.heading(column) for column in declared.printed}
    sizes = {column: max(least, len(head) + 1) for column, head in heads.items()}
    columns = "".join(f"{head:>{sizes[column]}}" for column, head in heads.items())
    blank = [_cell(None, column, size) for column, size in sizes.items()]
    rows = {
        name: [_cell(row[column.name], column, size) for column, size in sizes.items()]
        for name, row in zip(table.index, table.to_dict(orient="records"), strict=True)
    }
    title, frames = f"{declared.title} [{declared.unit}]", frames_in(table)
    kinds, kind_head = declared.index[-1].choices, declared.index[-1].heading
    label = max(len(name) for name in (*receivers, "receiver") if len(name) <= _LONGEST_LABEL) + 1
    first = label + max(map(len, (*kinds, kind_head))) + 1
    size = len(columns)
    beside = max(1, (width - first + len(_GAP)) // (size + len(_GAP)))
    for start in range(0, len(frames), beside):
        some = frames[start : start + beside]
        if start:
            yield ""
        for line, name in enumerate((title, "")):
            heading = _GAP.join(f"{_HEADS[frame][line]:^{size}}" for frame in some)
            if line == 0 or heading.strip():
                yield f"{name:<{first}}{heading}".rstrip()
        head = f"{'receiver':<{label}}{kind_head:<{first - label}}"
        yield head + _GAP.join([columns] * len(some))
        known = {receiver for receiver, frame, _ in rows if frame in some}
        for receiver in receivers:
            if receiver not in known:
                continue
            if len(receiver) > _LONGEST_LABEL:
                yield receiver
            for kind in kinds:
                name = receiver if kind == kinds[0] and len(receiver) <= _LONGEST_LABEL else ""
                cells = _GAP.join("".join(rows.get((receiver, f, kind), blank)) for f in some)
                yield f"{name:<{label}}{kind:<{first - label}}{cells}"


def _cell(value: Any, column: TableColumn, size: int) -> str:
    if pd.isna(value):
        return f"{'–':>{size}}"
    for digits in (0,) if column.type is int else (3, 2, 1, 0):
        text = f"{value:.{digits}f}"
        if len(text) < size:  # a space before it
            return f"{text:>{size}}"
    return f"{value:{size}.{1 if size > 8 else 0}e}"


def about(result: ToldResult, receiver: str) -> list[str]:
    """Availability, motion of the diver and consistency of a receiver, in words."""
    row: Any = result.summary.loc[receiver]
    if not row.estimates:
        return [f"{receiver}: no estimate; {silence(result, receiver)}"]
    first = f"{row.estimates} {plural(row.estimates, 'estimate')}"
    lines = [
        f"{receiver}: {first}, the first at {row.first_fix_s:g} s; a fix available "
        f"{percent(row.availability, '.1f')} of the time"
    ]
    if pd.notna(row.update_share):
        lines.append(f"  {percent(row.update_share, '.1f')} of the updates gave a new estimate")
    if receiver in result.motion:
        lines.append(f"  {result.motion[receiver]}")
    for name, words in _CONSISTENCY.items():
        if pd.notna(row[name]):
            lines.append(f"  mean {words} {row[name]:.2f}, {_compared(row, name)}")
    for frame, verdict in result.consistency[receiver].items():
        lines.append(f"  {COVARIANCES[frame]}: {verdict}")
    if pd.notna(row.beyond_claim):
        lines.append(
            f"  error beyond three times its claim, and {BEYOND_M:g} m, for "
            f"{percent(row.beyond_claim, '.1f')} of the time, at most "
            f"{row.beyond_claim_longest_s:g} s without a break"
        )
    if pd.isna(row.inconsistent):
        lines.append(f"  consistency unknown: {_without_covariance(result, receiver)}")
    if row.lost:
        silent = not result.judged[receiver].late.any()
        lines.append(
            "  lost: no estimate in the last quarter"
            if silent
            else "  lost: in the last quarter its error exceeds the distance to the platform"
        )
    return lines


def silence(result: ToldResult, receiver: str) -> str:
    """Why there may be no estimate, and which outputs to look at."""
    values = result.record.values
    count = values[f"{receiver}.update_count"].astype(int)
    look = [f"{receiver}.{port}" for port in ("update_count", "valid")]
    look = [name for name in look if name in values]
    why = (
        f"update_count reached {count.max()}, but there was no valid fix when it changed"
        if count.any()
        else "update_count stayed 0"
    )
    heard = values.get("acoustics.reception_count")
    if heard is not None:
        look.append("acoustics.reception_count")
        beacons = ", ".join(str(n) for n in heard[-1].tolist())
        why += f"; packets received from each beacon: {beacons}"
    return f"{why}; look at {', '.join(look)} in the record"


def notes(result: ToldResult) -> list[str]:
    """Explanations of the printed numbers."""
    raw = [_RAW_NOTE] if RAW in result.receivers else []
    claims = result.summary[list(_CONSISTENCY)].notna().any(axis=None)
    own = _OWN_NOTES if "own_relative" in frames_in(result.errors) else ()
    noted = [*own, *possible.notes(result.verdicts), *raw]
    claimed = (_CLAIM_NOTE, *_CONSISTENCY_NOTES, MISLEADING) if claims else ()
    return [*_NOTES, *noted, *claimed]


def _compared(row: Any, name: str) -> str:
    """Compare a mean NEES or NIS in a `metrics.summary` row with that of a consistent filter."""
    if pd.isna(row[f"{name}_expected"]):
        return "of unknown degrees of freedom"
    low, high, word = (row[f"{name}_{what}"] for what in ("low", "high", "verdict"))
    if row["lost"] and word != "optimistic":
        word = "says nothing, as the run is lost"
    return (
        f"expected {row[f'{name}_expected']:.2f} (95 %: {low:.2f} to {high:.2f}): "
        f"{_VERDICTS.get(word, word)}"
    )
