"""Turn the sums of a run into responses: errors, consistency, availability.

The sums are computed during a run (``c/lanes_master.c``) or from its record (`sums_of`). This
module turns them into a table. Their terms are defined in `sblcosim.results.definitions`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..simulation.masters.lanes_driver import SUMS
from .definitions import AXES, FRAMES, in_order, inconsistent, judge, lost

if TYPE_CHECKING:
    from ..simulation.record import Record

Floats = NDArray[np.float64]

PORTS = ("valid", "update_count", "epoch", "position", "covariance", "nis", "nis_degrees")
"""Outputs of a receiver that `sums_of` uses if present, in addition to `definitions.TRUTH`."""


def responses(sums: Floats, duration_ns: int | NDArray[np.int64]) -> pd.DataFrame:
    """Table of responses, one row per run.

    Parameters
    ----------
    sums
        Shape (runs, len(SUMS)).
    duration_ns
        Length of the runs [ns]: one for all, or one per run.

    Returns
    -------
    DataFrame
        ``estimates``; for both frames ``{frame}_{axis}_{mean,rms}_m`` (the mean is signed for an
        axis, of the length of the error for ``total``); ``nees_position`` and ``nis`` (time means,
        NaN if there are none), ``nis_degrees`` (total), ``availability``, ``updates``,
        ``inconsistent`` (missing without any NEES), ``lost``, and ``broken``: whether any estimate
        is broken; see `sblcosim.results.definitions`.
    """
    s: Mapping[str, Floats] = dict(zip(SUMS, sums.T, strict=True))
    n = s["estimates"]
    columns: dict[str, Any] = {"estimates": n.astype(np.int64)}
    with np.errstate(divide="ignore", invalid="ignore"):
        for frame in FRAMES:
            error, square = ("error", "square") if frame == "absolute" else (
                "relative", "relative_square"
            )
            for axis in AXES:
                columns[f"{frame}_{axis}_mean_m"] = s[f"{error}_{axis}"] / n
                columns[f"{frame}_{axis}_rms_m"] = np.sqrt(s[f"{square}_{axis}"] / n)
            columns[f"{frame}_total_mean_m"] = s[f"{error}_total"] / n
            total = s[f"{square}_x"] + s[f"{square}_y"] + s[f"{square}_z"]
            columns[f"{frame}_total_rms_m"] = np.sqrt(total / n)
        columns["nees_position"] = s["nees"] / s["nees_estimates"]
        columns["nees_estimates"] = s["nees_estimates"].astype(np.int64)
        columns["nis"] = s["nis"] / s["nis_estimates"]
    columns["nis_degrees"] = s["nis_degrees"].astype(np.int64)
    columns["availability"] = s["available_ns"] / duration_ns
    columns["updates"] = s["updates"].astype(np.int64)
    flag, known = inconsistent(columns["nees_position"], s["nees_estimates"])
    columns["inconsistent"] = flag if known.all() else pd.arrays.BooleanArray(flag, ~known)
    columns["lost"] = lost(
        s["late_estimates"], s["late_error_square"], s["late_distance_square"]
    )
    columns["broken"] = s["broken"] > 0
    return pd.DataFrame(columns)


def sums_of(record: Record, receiver: str, settling_ns: int = 0) -> Floats:
    """The sums of a recorded run, equal to those of the lanes master to the last bit.

    Parameters
    ----------
    record
        Record that contains `definitions.TRUTH` and the receiver's `PORTS`.
    settling_ns
        Errors count from this time after the start [ns].

    Returns
    -------
    sums
        Shape (len(SUMS),).
    """
    time = record.time_ns
    judged = judge(record, receiver)
    estimates, good = judged.estimates, ~judged.broken
    s = dict.fromkeys(SUMS, 0.0)
    held = np.append(np.diff(time), 0).astype(np.float64)
    s["available_ns"] = in_order(np.where(record.valid(receiver), held, 0.0))
    s["updates"] = float(record.values[f"{receiver}.update_count"][-1])
    s["broken"] = float(judged.broken.sum())
    late = good & judged.late
    s["late_estimates"] = float(late.sum())
    s["late_error_square"] = in_order(judged.square[late])
    s["late_distance_square"] = in_order(judged.distance_square[late])

    use = good & (float(time[0] + settling_ns) / 1e9 <= judged.epoch_s)
    s["estimates"] = float(use.sum())
    for prefix, error, square in (
        ("", judged.error[use], judged.square[use]),
        ("relative_", judged.relative[use], judged.relative_square[use]),
    ):
        for i, axis in enumerate(AXES):
            s[f"{prefix or 'error_'}{axis}"] = in_order(error[:, i])
            s[f"{prefix}square_{axis}"] = in_order(error[:, i] * error[:, i])
        s[f"{prefix or 'error_'}total"] = in_order(np.sqrt(square))
    nees = judged.nees[use & ~np.isnan(judged.nees)]
    s["nees"], s["nees_estimates"] = in_order(nees), float(len(nees))
    if estimates.nis is not None:
        degrees = estimates.nis_degrees
        tested = use & ~np.isnan(estimates.nis)
        if degrees is not None:
            tested &= degrees > 0
            s["nis_degrees"] = in_order(degrees[tested].astype(np.float64))
        s["nis"], s["nis_estimates"] = in_order(estimates.nis[tested]), float(tested.sum())
    return np.array([s[name] for name in SUMS])
