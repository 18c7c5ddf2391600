"""From the sums of a run to its responses: errors, consistency, availability.

The sums are made while a run goes on (``c/lanes_master.c``); this module names them and turns them
into a table. Definitions are those of `sblcosim.metrics`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from .metrics import AXES, FRAMES

Floats = NDArray[np.float64]

SUMS = (
    "estimates",
    "error_x", "error_y", "error_z", "error_total",
    "square_x", "square_y", "square_z",
    "relative_x", "relative_y", "relative_z", "relative_total",
    "relative_square_x", "relative_square_y", "relative_square_z",
    "nees", "nees_estimates",
    "nis", "nis_degrees", "nis_estimates",
    "late_estimates", "late_error_square", "late_distance_square",
    "available_ns",
    "updates",
    "broken",
)
"""Sums over the estimates of a run; ``enum sum`` of the C driver is made of these names."""


def responses(sums: Floats, duration_ns: int) -> pd.DataFrame:
    """One row per run.

    Parameters
    ----------
    sums
        Shape (runs, len(SUMS)).
    duration_ns
        Length of the run.

    Returns
    -------
    DataFrame
        ``estimates``; for both frames ``{frame}_{axis}_{mean,rms}_m`` (the mean is signed for an
        axis, of the length of the error for ``total``); ``nees_position`` and ``nis`` (time means,
        NaN without any), ``nis_degrees`` (all together), ``availability``, ``updates``, ``lost``,
        and ``broken``: whether an estimate was not finite or of an unknown epoch.
    """
    s: Mapping[str, Floats] = dict(zip(SUMS, sums.T, strict=True))
    n = s["estimates"]
    columns: dict[str, NDArray[np.generic]] = {"estimates": n.astype(np.int64)}
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
    columns["lost"] = (s["late_estimates"] == 0) | (
        s["late_error_square"] > s["late_distance_square"]
    )
    columns["broken"] = s["broken"] > 0
    return pd.DataFrame(columns)
