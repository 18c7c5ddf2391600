"""Turn the sums of a run into responses: errors, consistency, availability.

The sums are computed during a run (``c/lanes_master.c``) or from its record (`sums_of`). This
module turns them into a table. Their terms are defined in `sblcosim.judge.definitions`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..judge.definitions import (
    AXES,
    FRAMES,
    PREFIXES,
    beyond_claim,
    errors_of,
    in_order,
    inconsistent,
    lost,
    misleading,
    times_standing,
)
from ..simulation.masters.lanes_driver import SUMS
from .responses import Run

Floats = NDArray[np.float64]

PORTS = (
    "valid", "update_count", "epoch", "position", "covariance", "nis", "nis_degrees",
    "relative_position", "relative_covariance",
)
"""Outputs of a receiver that `sums_of` uses if present, in addition to the record's truth."""


def responses(
    sums: Floats, duration_ns: int | NDArray[np.int64], settling_ns: int = 0
) -> pd.DataFrame:
    """Table of responses, one row per run.

    Parameters
    ----------
    sums
        Shape (runs, len(SUMS)).
    duration_ns
        Length of the runs [ns]: one for all, or one for each run.
    settling_ns
        Time after the start of the runs from which errors count [ns].

    Returns
    -------
    DataFrame
        ``estimates``; for each frame ``{frame}_{axis}_{mean,rms}_m`` (the mean is signed for an
        axis, and the mean length of the error for ``total``; NaN without own relative errors);
        ``nees_position`` and ``nis`` (time means, NaN if there are none), ``nis_degrees`` (total),
        ``availability``, ``updates``, ``inconsistent`` (missing without any NEES), ``lost``,
        ``broken`` (whether any estimate is broken), ``own_relative_nees_{position,estimates}``, and
        ``beyond_claim``, ``beyond_claim_longest_s`` (NaN without any NEES) and ``misleading``
        (missing without any NEES); see `sblcosim.judge.definitions`.
    """
    s: Mapping[str, Floats] = dict(zip(SUMS, sums.T, strict=True))
    columns: dict[str, Any] = {"estimates": s["estimates"].astype(np.int64)}
    with np.errstate(divide="ignore", invalid="ignore"):
        for frame in FRAMES:
            error, square = PREFIXES[frame] or "error_", f"{PREFIXES[frame]}square_"
            n = s["own_relative_estimates" if frame == "own_relative" else "estimates"]
            for axis in AXES:
                columns[f"{frame}_{axis}_mean_m"] = s[f"{error}{axis}"] / n
                columns[f"{frame}_{axis}_rms_m"] = np.sqrt(s[f"{square}{axis}"] / n)
            columns[f"{frame}_total_mean_m"] = s[f"{error}total"] / n
            total = s[f"{square}x"] + s[f"{square}y"] + s[f"{square}z"]
            columns[f"{frame}_total_rms_m"] = np.sqrt(total / n)
        columns["nees_position"] = s["nees"] / s["nees_estimates"]
        columns["nees_estimates"] = s["nees_estimates"].astype(np.int64)
        columns["nis"] = s["nis"] / s["nis_estimates"]
        own_nees = s["own_relative_nees"] / s["own_relative_nees_estimates"]
    columns["nis_degrees"] = s["nis_degrees"].astype(np.int64)
    columns["availability"] = s["available_ns"] / duration_ns
    columns["updates"] = s["updates"].astype(np.int64)
    flag, known = inconsistent(columns["nees_position"], s["nees_estimates"])
    columns["inconsistent"] = _flags(flag, known)
    columns["lost"] = lost(
        s["late_estimates"], s["late_error_square"], s["late_distance_square"]
    )
    columns["broken"] = s["broken"] > 0
    columns["own_relative_nees_position"] = own_nees
    columns["own_relative_nees_estimates"] = s["own_relative_nees_estimates"].astype(np.int64)
    longest_s = s["beyond_longest_ns"] / 1e9
    with np.errstate(divide="ignore", invalid="ignore"):
        share = s["beyond_ns"] / (duration_ns - settling_ns)
    columns["beyond_claim"] = np.where(known, share, np.nan)
    columns["beyond_claim_longest_s"] = np.where(known, longest_s, np.nan)
    flag = misleading(columns["nees_position"], columns["absolute_total_rms_m"], longest_s)
    columns["misleading"] = _flags(flag, known)
    return pd.DataFrame(columns)


def _flags(flag: NDArray[np.bool_], known: NDArray[np.bool_]) -> Any:
    """Flags as a column; missing where they are unknown."""
    return flag if known.all() else pd.arrays.BooleanArray(flag & known, ~known)


def sums_of(run: Run) -> Floats:
    """The sums of a recorded run, equal to those of the lanes master to the last bit.

    Parameters
    ----------
    run
        The run; its record contains `sblcosim.data.truth.TRUTH` and the receiver's `PORTS`.

    Returns
    -------
    sums
        Shape (len(SUMS),).
    """
    record, receiver, judged = run.record, run.receiver, run.judged
    time = record.time_ns
    estimates, good = judged.estimates, ~judged.broken
    s = dict.fromkeys(SUMS, 0.0)
    held = np.append(np.diff(time), 0).astype(np.float64)
    s["available_ns"] = in_order(np.where(record.valid(receiver), held, 0.0))
    s["updates"] = float(record.values[f"{receiver}.update_count"][-1])
    s["broken"] = float(judged.broken.sum())
    late = good & judged.late
    s["late_estimates"] = float(late.sum())
    s["late_error_square"] = in_order(judged.square[late])
    if judged.distance_square is not None:
        s["late_distance_square"] = in_order(judged.distance_square[late])

    use = good & (float(time[0] + run.settling_ns) / 1e9 <= judged.epoch_s)
    s["estimates"] = float(use.sum())
    for frame, (error, square) in errors_of(judged).items():
        prefix = PREFIXES[frame]
        for i, axis in enumerate(AXES):
            mine = error[use, i]
            s[f"{prefix or 'error_'}{axis}"] = in_order(mine)
            s[f"{prefix}square_{axis}"] = in_order(mine * mine)
        s[f"{prefix or 'error_'}total"] = in_order(np.sqrt(square[use]))
    for prefix, claims in (("", judged.nees), ("own_relative_", judged.own_relative_nees)):
        if claims is not None:
            nees = claims[use & ~np.isnan(claims)]
            s[f"{prefix}nees"], s[f"{prefix}nees_estimates"] = in_order(nees), float(len(nees))
    beyond, longest = times_standing(judged, use & beyond_claim(judged))
    s["beyond_ns"], s["beyond_longest_ns"] = float(beyond), float(longest)
    if judged.own_relative is not None:
        s["own_relative_estimates"] = s["estimates"]
    if estimates.nis is not None:
        degrees = estimates.nis_degrees
        tested = use & ~np.isnan(estimates.nis)
        if degrees is not None:
            tested &= degrees > 0
            s["nis_degrees"] = in_order(degrees[tested].astype(np.float64))
        s["nis"], s["nis_estimates"] = in_order(estimates.nis[tested]), float(tested.sum())
    return np.array([s[name] for name in SUMS])
