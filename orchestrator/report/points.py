"""The points of a study's design: errors of the receivers at each, and how often they fail."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from ..analysis.common.bounds import share_interval
from ..judge.definitions import LOST, MISLEADING
from ..study.study import Study
from ..words.numbers import number, quantity
from ..words.shares import column_percent, interval_percent
from .page import Block, PageTable

COLUMNS = {
    "absolute_total_rms_m": "mean RMS [m]",
    "inconsistent": "inconsistent",
    "lost": "lost",
    "misleading": "misleading",
}
"""Responses of a run whose means are shown, and their headings."""
_NOTE = (
    "Mean RMS: mean over the runs of their RMS total error in the world, after the settling time. "
    "The RMS error over the runs, the root of the mean of their mean squares, is larger. "
    "Inconsistent: share of the runs whose mean NEES lies above its 95 % band, so the receiver "
    "claims too small an error. "
    f"{LOST} {MISLEADING} In brackets: the 95 % interval of this share (Clopper and Pearson's)."
)


def tables(study: Study, runs: pd.DataFrame) -> list[Block]:
    """A table with a row for each point; empty without runs."""
    receivers = [c.removesuffix(".lost") for c in runs.columns if c.endswith(".lost")]
    shown = {
        f"{receiver}.{column}": f"{receiver}: {words}"
        for receiver in receivers
        for column, words in COLUMNS.items()
        if f"{receiver}.{column}" in runs
    }
    good = runs.loc[runs["error"].isna(), ["point", *shown]]
    shown = {column: words for column, words in shown.items() if good[column].notna().any()}
    if good.empty or not shown:
        return []
    of_points = good.groupby("point")[list(shown)]
    means, known = of_points.mean(), of_points.count()
    counts = good.groupby("point").size()
    rows: list[Sequence[str]] = []
    for (name, row), (_, seen) in zip(means.iterrows(), known.iterrows(), strict=True):
        point = int(str(name))
        levels = zip(study.varied, study.points.values[point - 1], strict=True)
        rows.append((
            f"{point}",
            *(quantity(level, study.units[factor]) for factor, level in levels),
            f"{counts.loc[point]}",
            *(number(row[c]) if c.endswith("_m") else _share(row[c], c, int(seen[c]))
              for c in shown),
        ))  # fmt: skip
    head = ("Point", *(study.labels[factor] for factor in study.varied), "Runs", *shown.values())
    return [PageTable("Design points: means over their runs", head, rows, (), _NOTE)]


def _share(value: float, column: str, runs: int) -> str:
    """A share of runs; of misleading ones with the 95 % interval."""
    if pd.isna(value):
        return "–"
    said = column_percent(value)
    if not column.endswith(".misleading"):
        return said
    return f"{said} ({interval_percent(*share_interval(round(value * runs), runs))})"
