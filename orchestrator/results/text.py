"""The tables of a run's errors as text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import pandas as pd

from .definitions import AXES, FRAMES, PERCENTAGES

STATISTICS = ("mean_m", "rms_m", "std_m")
_HEADS = {
    "absolute": ("absolute", ""),
    "relative": ("relative to the platform", "as it reports itself"),
    "own_relative": ("relative to the platform's", "true position, own account"),
}
"""The frames in two lines; `definitions.FRAME_WORDS` fits into no column."""
_GAP = "   "


def frames_in(table: pd.DataFrame) -> list[str]:
    """The frames that a table of errors or percentiles has rows of."""
    there = set(table.index.get_level_values("frame"))
    return [frame for frame in FRAMES if frame in there or frame != "own_relative"]


def errors(table: pd.DataFrame, receivers: Sequence[str], width: int) -> Iterator[str]:
    """The lines of `metrics.error_table`.

    Parameters
    ----------
    width
        Of the first column.
    """
    frames = frames_in(table)
    yield from _heads(f"{'Error [m]':<{width + 8}}", frames, 27)
    yield f"{'receiver':<{width}}{'axis':<8}" + _GAP.join(
        ["     mean      RMS      std"] * len(frames)
    )
    rows = _rows(table[list(STATISTICS)])
    for receiver in receivers:
        for axis in (*AXES, "total"):
            cells = _GAP.join(
                "".join(map(_cell, rows.get((receiver, frame, axis), [None] * len(STATISTICS))))
                for frame in frames
            )
            yield f"{receiver if axis == 'x' else '':<{width}}{axis:<8}{cells}"


def percentiles(table: pd.DataFrame, receivers: Sequence[str], width: int) -> Iterator[str]:
    """The lines of `metrics.percentile_table`; width as in `errors`."""
    frames = frames_in(table)
    part = "".join(f"{f'{p} %' if p < 100 else 'all':>7}" for p in PERCENTAGES)
    yield from _heads(f"{'Within [m]':<{width + 11}}", frames, len(part))
    yield f"{'receiver':<{width}}{'error':<11}" + _GAP.join([part] * len(frames))
    rows = _rows(table)
    for receiver in receivers:
        for length in ("horizontal", "total"):
            cells = _GAP.join(
                "".join(
                    f"{value:7.3f}" if pd.notna(value) else f"{'–':>7}"
                    for value in rows.get((receiver, frame, length), [None] * len(PERCENTAGES))
                )
                for frame in frames
            )
            yield f"{receiver if length == 'horizontal' else '':<{width}}{length:<11}{cells}"


def _rows(table: pd.DataFrame) -> dict[Any, Any]:
    return dict(zip(table.index, table.to_numpy(), strict=True))


def _heads(first: str, frames: Sequence[str], size: int) -> Iterator[str]:
    for line, title in enumerate((first, " " * len(first))):
        yield (title + _GAP.join(f"{_HEADS[f][line]:^{size}}" for f in frames)).rstrip()


def _cell(value: Any) -> str:
    return f"{'–':>9}" if pd.isna(value) else f"{value:9.3f}"
