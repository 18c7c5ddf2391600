"""Judging estimates without a truth: agreement with samples and with each other.

Small residuals are necessary for good estimates, but not sufficient. An error common to all ranges,
such as that of a clock, may move the estimate and leave no residuals.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations

import numpy as np
import pandas as pd

from ..data import bearing
from ..data.estimates import Estimates, Flags, Floats, Integers
from ..data.samples import Samples
from ..words.shares import percent
from .columns import ERRORS
from .definitions import horizontal_square, square_of
from .metrics import of_chi_square

OFTEN = 0.05
"""Share of a receiver's estimates with an unknown bearing, above which it is said."""


def residuals(estimates: Estimates, samples: Samples, body: Floats | None = None) -> pd.DataFrame:
    """Measured ranges and depths minus those of the estimates at the same times.

    Between two estimates the diver is assumed to move in a straight line. Samples before the first
    and after the last estimate do not count.

    Parameters
    ----------
    body
        Nominal positions of the beacons, body frame [m], shape (beacons, 3), for packets that hold
        the platform's pose instead of their own beacon's position.

    Returns
    -------
    table
        Index: ``beacon 1`` … of the beacons heard, and ``depth``. Columns: those of the table of
        errors (`sblcosim.judge.columns.ERRORS`), and ``median_m``, which outliers hardly affect.

    Raises
    ------
    ConfigurationError
        There are packets with a pose, but no ``body``.
    """
    beacon = samples.beacon_position(body)
    heard, at = between(estimates, samples.range_ns)
    ranges = samples.range[heard] - np.sqrt(square_of(at - beacon[heard]))
    deep, depths = between(estimates, samples.depth_ns)
    rows = {
        f"beacon {b + 1}": ranges[samples.beacon[heard] == b] for b in sorted({*samples.beacon})
    }
    rows["depth"] = samples.depth[deep] - depths[:, 2]
    table = pd.DataFrame.from_dict({n: _row(v) for n, v in rows.items()}, orient="index")
    table.index.name = "sample"
    return table


def agreement(estimates: Mapping[str, Estimates]) -> pd.DataFrame:
    """Distance between receivers, at the epochs of the first of each pair.

    Returns
    -------
    table
        Index: both receivers. Columns: ``horizontal_rms_m``, ``total_rms_m``, ``max_m`` and ``n``;
        NaN for receivers that were never available at the same time.
    """
    rows = {}
    for (one, first), (other, second) in combinations(estimates.items(), 2):
        here, at = between(second, first.epoch_ns)
        off = first.position[here] - at
        square, n = square_of(off), len(off)
        level = horizontal_square(off[:, 0], off[:, 1])
        rows[one, other] = {
            "horizontal_rms_m": np.sqrt(level.mean()) if n else np.nan,
            "total_rms_m": np.sqrt(square.mean()) if n else np.nan,
            "max_m": np.sqrt(square.max()) if n else np.nan,
            "n": n,
        }
    columns = ["horizontal_rms_m", "total_rms_m", "max_m", "n"]
    table = pd.DataFrame.from_dict(rows, orient="index", columns=columns)
    table.index = pd.MultiIndex.from_tuples(rows, names=["receiver", "other"])
    return table


def innovations(estimates: Mapping[str, Estimates]) -> pd.DataFrame:
    """Mean NIS of receivers that have one, with its 95 % band and verdict.

    Returns
    -------
    table
        Index: receiver. Columns: ``nis``, ``nis_expected`` (mean degrees of freedom), ``nis_low``,
        ``nis_high``, ``nis_verdict`` and ``n``, as in `sblcosim.judge.metrics.summary`.
    """
    rows = {}
    for name, own in estimates.items():
        values, degrees = told(own)
        if len(values):
            rows[name] = {**of_chi_square("nis", values, degrees), "n": len(values)}
    columns = ["nis", "nis_expected", "nis_low", "nis_high", "nis_verdict", "n"]
    table = pd.DataFrame.from_dict(rows, orient="index", columns=columns)
    table.index.name = "receiver"
    return table


def told(estimates: Estimates) -> tuple[Floats, Integers]:
    """NIS of the estimates that have one, and its degrees of freedom; shape (n,)."""
    if estimates.nis is None or estimates.nis_degrees is None:
        return np.zeros(0), np.zeros(0, np.int64)
    used = ~np.isnan(estimates.nis) & (estimates.nis_degrees > 0)
    return estimates.nis[used], estimates.nis_degrees[used]


def between(estimates: Estimates, epoch_ns: Integers) -> tuple[Flags, Floats]:
    """Which epochs lie between estimates, and the positions there [m], (m, 3)."""
    order = np.argsort(estimates.epoch_ns, kind="stable")
    own, position = estimates.epoch_ns[order], estimates.position[order]
    if not len(own):
        return np.zeros(len(epoch_ns), bool), np.zeros((0, 3))
    here = (own[0] <= epoch_ns) & (epoch_ns <= own[-1])
    since = epoch_ns[here] - own[0]
    return here, np.column_stack([np.interp(since, own - own[0], x) for x in position.T])


def _row(values: Floats) -> dict[str, float]:
    median = float(np.median(values)) if len(values) else np.nan
    return {**ERRORS.row(values), "median_m": median}


def unknown_bearings(estimates: Mapping[str, Estimates]) -> Iterator[str]:
    """A sentence on each receiver that often does not know the bearing.

    Parameters
    ----------
    estimates
        By the names of the receivers.
    """
    for name, own in estimates.items():
        unknown = bearing.is_unknown(own)
        if unknown is not None and len(unknown) and unknown.mean() > OFTEN:
            share = percent(float(unknown.mean()), ".0f")
            yield (
                f"{name} does not know the diver's bearing from the platform in {share} of its "
                "estimates: there, the ranges fit on a whole ring or in several places, and its "
                "position is one or a mean of these"
            )
