"""Whether the receivers' covariances are right: a verdict for each point, over its replicates."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..judge.consistency import COVARIANCES, NEES_COLUMNS, TELLING, of_runs
from ..words.numbers import PRACTICAL_RUNS

WRONG = ("optimistic", "pessimistic")
UNTOLD = ("one run", "unknown")


def by_point(table: pd.DataFrame, factors: Sequence[str] = ()) -> pd.DataFrame:
    """Verdicts over the replicates of each point, which have different seeds.

    Parameters
    ----------
    table
        Table of runs. A failed run counts for the receivers that did not fail.

    Returns
    -------
    DataFrame
        ``receiver``, ``frame`` (``absolute``, and ``own_relative`` for receivers that have it),
        ``point``, the factors' values, the fields of `sblcosim.judge.consistency.Verdict`, and
        ``words``. Receivers and frames without a NEES are left out.
    """
    rows: list[dict[str, Any]] = []
    for receiver, frame, column in _columns(table):
        rows_of = np.flatnonzero(table["error"].isna() | table[column].notna())
        point_of = table["point"].to_numpy()
        rows_of = rows_of[np.argsort(point_of[rows_of], kind="stable")]
        values = table[column].to_numpy(np.float64, na_value=np.nan)
        lost = _lost(table, receiver)
        ends = np.flatnonzero(np.diff(point_of[rows_of])) + 1
        for mine in np.split(rows_of, ends):
            point, verdict = int(point_of[mine[0]]), of_runs(values[mine], float(lost[mine].mean()))
            levels = {name: table[name].iloc[mine[0]] for name in factors}
            rows.append({
                "receiver": receiver, "frame": frame, "point": point, **levels,
                **asdict(verdict), "words": str(verdict),
            })  # fmt: skip
    verdicts = pd.DataFrame(rows)
    return verdicts.astype({"runs_needed": "Int64"}) if rows else verdicts


def _lost(table: pd.DataFrame, receiver: str) -> NDArray[np.float64]:
    """Whether a receiver is lost in each run, 1 or 0; a failed receiver is not."""
    column = f"{receiver}.lost"
    if column not in table:
        return np.zeros(len(table))
    flags: NDArray[np.float64] = table[column].to_numpy(np.float64, na_value=np.nan)
    return np.where(np.isnan(flags), 0.0, flags)


def _columns(table: pd.DataFrame) -> Iterator[tuple[str, str, str]]:
    """Receiver, frame and column of each NEES that some run has."""
    for name in dict.fromkeys(c.partition(".")[0] for c in table.columns if "." in c):
        for frame, nees in NEES_COLUMNS.items():
            column = f"{name}.{nees}"
            if column in table and table[column].notna().any():
                yield name, frame, column


def summary(verdicts: pd.DataFrame) -> pd.DataFrame:
    """The verdicts of a receiver over all points.

    Returns
    -------
    DataFrame
        One row per receiver and frame: ``receiver``, ``frame``, ``points``; the number of points
        that are ``in_band``, ``optimistic``, ``pessimistic`` and ``untold``; the range of the
        factors on the standard deviation, ``…_from`` and ``…_to``, for optimistic and pessimistic
        points (NaN without any); ``runs`` (least at a point) and ``runs_needed`` (most at a point).
    """
    rows: list[dict[str, Any]] = []
    groups = verdicts.groupby(["receiver", "frame"], sort=False) if len(verdicts) else ()
    for (receiver, frame), mine in groups:
        row = {"receiver": receiver, "frame": frame, "points": len(mine)}
        row["in_band"] = int((mine["verdict"] == "in band").sum())
        for word in WRONG:
            factors = mine.loc[mine["verdict"] == word, "factor"]
            if word == "pessimistic":
                factors = 1 / factors
            row |= {word: len(factors), f"{word}_from": factors.min(), f"{word}_to": factors.max()}
        row["untold"] = int(mine["verdict"].isin(UNTOLD).sum())
        row |= {"runs": int(mine["runs"].min()), "runs_needed": mine["runs_needed"].max()}
        rows.append(row)
    return pd.DataFrame(rows)


def sentences(verdicts: pd.DataFrame) -> dict[str, list[str]]:
    """The sentences about each receiver, one for each of its covariances."""
    said: dict[str, list[str]] = {}
    rows: list[dict[Any, Any]] = summary(verdicts).to_dict(orient="records")
    for row in rows:
        mine = verdicts[
            (verdicts["receiver"] == row["receiver"]) & (verdicts["frame"] == row["frame"])
        ]
        words = mine["words"].iloc[0] if row["points"] == 1 else _over_points(row, mine)
        said.setdefault(row["receiver"], []).append(f"{COVARIANCES[row['frame']]}: {words}")
    return said


def _over_points(row: dict[Any, Any], mine: pd.DataFrame) -> str:
    points = row["points"]
    if (mine["verdict"] == "one run").all():
        low, high = mine["factor"].min(), mine["factor"].max()
        return (
            f"looks wrong by factors of {low:.3g} to {high:.3g} at {points} points (above 1: "
            "optimistic); one run at each cannot tell"
        )
    parts = []
    for word in WRONG:
        if row[word]:
            low, high = (f"{row[f'{word}_{end}']:.3g}" for end in ("from", "to"))
            factors = low if low == high else f"{low} to {high}"
            parts.append(f"{word} at {row[word]} of {points} points, by a factor of {factors}")
    if row["in_band"]:
        parts.append(f"in band at {row['in_band']}")
    if row["untold"]:
        parts.append(f"unknown at {row['untold']}")
    needed = row["runs_needed"]
    enough = ""
    if not pd.isna(needed) and needed > row["runs"]:
        most = f"up to {needed}" if needed <= PRACTICAL_RUNS else (
            f"at some points no practical number ({PRACTICAL_RUNS:,})"
        )
        enough = f"; {most} would reveal a factor of {TELLING:g}"
    return f"{', '.join(parts)} (95 % each, from {row['runs']} runs per point{enough})"
