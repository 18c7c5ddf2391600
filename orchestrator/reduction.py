"""From the sums of a run to its responses: errors, consistency, availability.

The sums are made while a run goes on (``c/lanes_master.c``); this module names them and turns them
into a table. Definitions are those of `sblcosim.metrics`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.special import chdtri

from .metrics import AXES, CONFIDENCE, FRAMES, recorded

if TYPE_CHECKING:
    from .record import Record

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

TRUTH = (
    "target.position", "platform.position", "platform.beacon_position",
    "platform.reported_beacon_position",
)
"""What `sums_of` needs of a record."""
PORTS = ("valid", "update_count", "epoch", "position", "covariance", "nis", "nis_degrees")
"""What it needs of the receiver, as far as it has it."""
REMEMBERED = 64
"""Number of instants for which the C driver remembers the truth."""


def responses(sums: Floats, duration_ns: int | NDArray[np.int64]) -> pd.DataFrame:
    """One row per run.

    Parameters
    ----------
    sums
        Shape (runs, len(SUMS)).
    duration_ns
        Length of the runs: one, or one per run.

    Returns
    -------
    DataFrame
        ``estimates``; for both frames ``{frame}_{axis}_{mean,rms}_m`` (the mean is signed for an
        axis, of the length of the error for ``total``); ``nees_position`` and ``nis`` (time means,
        NaN without any), ``nis_degrees`` (all together), ``availability``, ``updates``,
        ``inconsistent`` (time-mean NEES of the position above its 95 % band), ``lost``, and
        ``broken``: whether an estimate was not finite or of an unknown epoch.
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
    judged = np.maximum(s["nees_estimates"], 1.0)
    bound = chdtri(3 * judged, (1 - CONFIDENCE) / 2)
    columns["inconsistent"] = s["nees"] > bound
    columns["lost"] = (s["late_estimates"] == 0) | (
        s["late_error_square"] > s["late_distance_square"]
    )
    columns["broken"] = s["broken"] > 0
    return pd.DataFrame(columns)


def sums_of(record: Record, receiver: str, settling_ns: int = 0) -> Floats:
    """The sums of a run that was recorded, equal to those of the lanes master to the last bit.

    Parameters
    ----------
    record
        With `TRUTH` and the receiver's `PORTS`.
    settling_ns
        Errors count from this time after the start.

    Returns
    -------
    sums
        Shape (len(SUMS),).
    """
    values = record.values
    time = record.time_ns
    seconds = time / 1e9
    start, stop = float(seconds[0]), float(seconds[-1])
    port = {
        name: values[f"{receiver}.{name}"].astype(np.float64)
        for name in PORTS
        if f"{receiver}.{name}" in values
    }
    count = port["update_count"]
    valid = port["valid"] > 0 if "valid" in port else count > 0
    s = dict.fromkeys(SUMS, 0.0)
    s["available_ns"] = _sum(np.where(valid, np.append(np.diff(time), 0), 0.0))
    s["updates"] = float(count[-1])
    row = np.flatnonzero((np.diff(count, prepend=0.0) != 0) & valid)
    epoch = port["epoch"][row]
    at = np.minimum(np.searchsorted(seconds, epoch), len(seconds) - 1)
    known = (seconds[at] == epoch) & (at <= row) & (at > row - REMEMBERED)

    reported = recorded(record, "platform.reported_beacon_position")[at]
    beacon = recorded(record, "platform.beacon_position")[at]
    beacons = beacon.shape[1]
    platform_error = np.zeros((len(row), 3))
    for j in range(beacons):
        platform_error += reported[:, j] - beacon[:, j]
    platform_error *= 1.0 / beacons
    truth = recorded(record, "target.position")[at]
    e = port["position"][row] - np.where(known[:, None], truth, 0.0)
    relative = e - np.where(known[:, None], platform_error, 0.0)
    with np.errstate(invalid="ignore", over="ignore"):
        square, relative_square = _square(e), _square(relative)
        broken = ~known | ~(square + relative_square < np.inf)
    distance_square = _square(truth - recorded(record, "platform.position")[at])
    s["broken"] = float(broken.sum())
    late = ~broken & (stop - (stop - start) / 4 <= epoch)
    s["late_estimates"] = float(late.sum())
    s["late_error_square"] = _sum(square[late])
    s["late_distance_square"] = _sum(distance_square[late])

    use = ~broken & (float(time[0] + settling_ns) / 1e9 <= epoch)
    e, relative = e[use], relative[use]
    s["estimates"] = float(use.sum())
    for i, axis in enumerate(AXES):
        s[f"error_{axis}"] = _sum(e[:, i])
        s[f"square_{axis}"] = _sum(e[:, i] * e[:, i])
        s[f"relative_{axis}"] = _sum(relative[:, i])
        s[f"relative_square_{axis}"] = _sum(relative[:, i] * relative[:, i])
    s["error_total"] = _sum(np.sqrt(square[use]))
    s["relative_total"] = _sum(np.sqrt(relative_square[use]))
    if "covariance" in port:
        nees = _nees(e, port["covariance"][row][use])
        s["nees"], s["nees_estimates"] = _sum(nees), float(len(nees))
    if "nis" in port and "nis_degrees" in port:
        degrees = port["nis_degrees"][row][use]
        s["nis"] = _sum(port["nis"][row][use][degrees > 0])
        s["nis_degrees"] = _sum(degrees[degrees > 0])
        s["nis_estimates"] = float((degrees > 0).sum())
    return np.array([s[name] for name in SUMS])


def _sum(values: Floats) -> float:
    """One after another: NumPy's own sum adds in another order."""
    return float(np.add.accumulate(np.append(0.0, values))[-1])


def _square(v: Floats) -> Floats:
    result: Floats = v[:, 0] * v[:, 0] + v[:, 1] * v[:, 1] + v[:, 2] * v[:, 2]
    return result


def _nees(e: Floats, P: Floats) -> Floats:
    """eᵀ P⁻¹ e by P = L D Lᵀ where P is positive definite; as ``nees_of`` in the C."""
    a, b, c = P[:, 0, 0], P[:, 0, 2], P[:, 0, 4]
    d, f, g = P[:, 2, 2], P[:, 2, 4], P[:, 4, 4]
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        i1 = 1.0 / a
        l21, l31 = b * i1, c * i1
        s2, r = d - l21 * b, f - l21 * c
        i2 = 1.0 / s2
        l32 = r * i2
        s3 = g - l31 * c - l32 * r
        usable = (a > 0.0) & (1e-14 * d < s2) & (1e-14 * g < s3)
        y2 = e[:, 1] - l21 * e[:, 0]
        y3 = e[:, 2] - l31 * e[:, 0] - l32 * y2
        nees = e[:, 0] * e[:, 0] * i1 + y2 * y2 * i2 + y3 * y3 / s3
        result: Floats = nees[usable]
    return result
