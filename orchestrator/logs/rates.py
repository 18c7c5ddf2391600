"""The unit of times, as their values show it: a wrong one makes a device faster than any."""

from __future__ import annotations

from collections.abc import Sequence
from math import log
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ConfigurationError
from ..words.numbers import rounded
from .times import MISSING, UNITS

if TYPE_CHECKING:
    import pandas as pd

    from .raw import Raw

_SHORTEST_NS = 500_000
"""Interval between values of one series below which the unit of its times is wrong [ns]. Slots of
simulations last 1 ms and more. Sound travels less than a metre in this time."""
_FEWEST = 5
"""Number of intervals that tell it, at least."""
_SHARE = 0.9
"""Share of the intervals that must be as short: echoes may follow each ping closely."""
_WORDS = {"ns": "nanoseconds", "us": "microseconds", "ms": "milliseconds", "s": "seconds"}


def check_rate(
    raw: Raw, name: str, table: pd.DataFrame, columns: Sequence[str], one: str, by: str = ""
) -> None:
    """Refuse times whose unit cannot be right.

    Parameters
    ----------
    name, table, columns
        A table of the source, and its columns with whole nanoseconds.
    one
        What a row is, for the message.
    by
        Column with the series of each row, if there are several: simultaneous rows of two series
        are usual.

    Raises
    ------
    ConfigurationError
        Nearly all rows follow the one before faster than in any device.
    """
    parts = [own for _, own in table.groupby(by)] if by else [table]
    for column in columns:
        times = [part[column].to_numpy(np.int64) for part in parts]
        steps = [np.diff(np.unique(own[own != MISSING])) for own in times]
        gaps = np.concatenate([np.zeros(0, np.int64), *steps])
        if len(gaps) >= _FEWEST and np.quantile(gaps, _SHARE) < _SHORTEST_NS:
            file = table["file"].iloc[0] if "file" in table else raw.files.get(name, name)
            raise _too_fast(str(file), _source(raw.tables[name], column), one, np.median(gaps))


def _source(given: pd.DataFrame, column: str) -> str:
    """Name of the column that the times are from; a reader may have added one in nanoseconds."""
    names = [f"{stem}_{unit}" for stem in (column, "time") for unit in reversed(UNITS)]
    return next((it for it in (*names, column, "time") if it in given), column)


def _too_fast(file: str, column: str, one: str, usual_ns: float) -> ConfigurationError:
    stem, _, unit = column.rpartition("_")
    usual_s, close = usual_ns / UNITS["s"], ""
    of = UNITS.get(unit, UNITS["s"])
    slower = {other: usual_s * ns / of for other, ns in UNITS.items() if ns > of}
    if slower:
        best = min(slower, key=lambda other: abs(log(slower[other])))
        close = (
            f"; as {_WORDS[best]}, with the name {stem}_{best}, it would be every "
            f"{rounded(slower[best])} s"
        )
    return ConfigurationError(
        f"{file}: {column}: must be in {_WORDS.get(unit, 'true time')}, got {one} every "
        f"{rounded(usual_s * 1e6)} µs{close}"
    )
