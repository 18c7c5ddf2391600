"""Quality of a run's estimates: errors, availability and consistency, as tables.

Errors and all other terms are defined in `sblcosim.results.definitions`. All functions here are
pure functions of records and tables.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from ..errors import ConfigurationError, FmuError, check_choice
from ..simulation.record import NEVER
from .definitions import (
    AXES,
    FRAMES,
    OWN_PORT,
    PERCENTAGES,
    POSITION_STATES,
    PREFIXES,
    Judged,
    Nanoseconds,
    chi_square_band,
    errors_of,
    horizontal_square,
    in_order,
    inconsistent,
    judge,
    nees,
    of_position,
    order_statistics,
    percentile_column,
)
from .definitions import lost as lost_by

if TYPE_CHECKING:
    from ..simulation.record import Record

REPORTED = "platform.reported_attitude"
"""An output of our own platform: what its IMU says."""


def verdict(mean: float, band: tuple[float, float]) -> str:
    """Judge a filter's covariance by a mean NEES or NIS.

    Returns
    -------
    str
        ``optimistic``: errors are larger than the filter claims; ``pessimistic``: smaller;
        ``consistent``: inside the band; ``unknown``: there is no mean.
    """
    if np.isnan(mean) or not np.isfinite(band).all():
        return "unknown"
    if mean > band[1]:
        return "optimistic"
    return "pessimistic" if mean < band[0] else "consistent"


def track(record: Record, receiver: str) -> pd.DataFrame:
    """A receiver's valid estimates with the truth, one row per estimate.

    Columns: ``epoch_s``; ``{x,y,z}_m``; ``true_{x,y,z}_m``; ``error_{x,y,z,total}_m`` (absolute)
    and ``relative_error_{x,y,z,total}_m``. If the receiver has the outputs for them:
    ``own_relative_error_{x,y,z,total}_m``, ``std_{x,y,z}_m`` and ``own_relative_std_{x,y,z}_m``,
    ``nees_position`` (3 degrees of freedom) and ``nees_state`` (6), both of the absolute error,
    ``relative_nees_position`` and ``own_relative_nees_position`` (3), ``nis`` and ``nis_degrees``.

    Raises
    ------
    FmuError
        An estimate's epoch lies outside the run, or its position is not finite.
    """
    judged = _intact(record, receiver)
    estimates = judged.estimates
    columns: dict[str, ArrayLike] = {"epoch_s": judged.epoch_s}
    columns |= {f"{axis}_m": estimates.position[:, i] for i, axis in enumerate(AXES)}
    columns |= {f"true_{axis}_m": judged.true_position[:, i] for i, axis in enumerate(AXES)}
    for frame, (error, square) in errors_of(judged).items():
        columns |= {error_column(frame, axis): error[:, i] for i, axis in enumerate(AXES)}
        columns[error_column(frame, "total")] = np.sqrt(square)
    std, P = estimates.position_std, estimates.covariance
    if std is None and P is not None:
        std = np.sqrt(P[:, POSITION_STATES, POSITION_STATES])
    if std is not None:
        columns |= {f"std_{axis}_m": std[:, i] for i, axis in enumerate(AXES)}
    if P is not None:
        columns["nees_position"] = judged.nees
        columns["relative_nees_position"] = nees(judged.relative, of_position(P))
        if estimates.velocity is not None:
            # the paper's order: position, then velocity, of each axis
            pairs = np.stack([judged.error, estimates.velocity - judged.true_velocity], axis=2)
            columns["nees_state"] = nees(pairs.reshape(-1, 6), P)
    if judged.own_relative_nees is not None and estimates.relative_covariance is not None:
        variances = np.diagonal(estimates.relative_covariance, axis1=1, axis2=2)
        stds = np.sqrt(np.where(variances >= 0, variances, np.nan))
        columns |= {f"own_relative_std_{axis}_m": stds[:, i] for i, axis in enumerate(AXES)}
        columns["own_relative_nees_position"] = judged.own_relative_nees
    if estimates.nis is not None:
        columns["nis"] = estimates.nis
    if estimates.nis_degrees is not None:
        columns["nis_degrees"] = estimates.nis_degrees
    return pd.DataFrame(columns)


def check(record: Record, receiver: str) -> None:
    """Refuse estimates whose epoch lies outside of the run, or whose position is not finite.

    Raises
    ------
    FmuError
        There is such a one; ``component`` is the one to blame.
    """
    _intact(record, receiver)


def _intact(record: Record, receiver: str) -> Judged:
    judged = judge(record, receiver)
    if judged.broken.any():
        error = _problem(record, receiver, judged)
        error.component = str(error).partition(".")[0]
        raise error
    return judged


def _problem(record: Record, receiver: str, judged: Judged) -> FmuError:
    """The error that describes the first broken estimate."""
    i = int(judged.broken.argmax())
    start, stop, epoch = record.time_ns[0], record.time_ns[-1], judged.estimates.epoch_ns[i]
    if not start <= epoch <= stop:
        got = "no time" if epoch == NEVER else f"{judged.epoch_s[i]:g} s"
        return FmuError(
            f"{receiver}.epoch: must lie within the run, {start / 1e9:g} to {stop / 1e9:g} s, "
            f"got {got}"
        )
    own = judged.estimates.relative_position
    named = (
        (f"{receiver}.position", judged.estimates.position[i]),
        ("target.position", judged.true_position[i]),
        ("platform.reported_beacon_position", judged.platform_error[i]),
        *(() if own is None else ((f"{receiver}.{OWN_PORT}", own[i]),)),
    )
    # If all are finite, the square of an error overflows.
    overflowing = named[0] if not judged.square[i] < np.inf else named[-1]
    name, values = next((n for n in named if not np.isfinite(n[1]).all()), overflowing)
    return FmuError(
        f"{name}: must be finite and its square, too, in a valid estimate, got {values.tolist()} "
        f"at epoch {judged.epoch_s[i]:g} s"
    )


def error_table(tracks: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Statistics of the errors over all valid estimates, as in the paper's Tables 4 to 6.

    Parameters
    ----------
    tracks
        What `track` returns, by receiver.

    Returns
    -------
    table
        Index: receiver, frame (``absolute``, ``relative``, and ``own_relative`` for receivers that
        have it), axis (``x``, ``y``, ``z``, ``total``). Columns: ``mean_m`` (signed for an axis; of
        the length of the error for ``total``), ``rms_m``, ``std_m`` about that mean, so that
        rms² = mean² + std², and ``n``, the number of estimates. The squared RMS of the total is the
        sum of those of the axes.
    """
    rows = {}
    for receiver, estimates in tracks.items():
        for frame in frames_of(estimates):
            for axis in (*AXES, "total"):
                e = estimates[error_column(frame, axis)].to_numpy()
                some = len(e) > 0
                rows[receiver, frame, axis] = {
                    "mean_m": e.mean() if some else np.nan,
                    "rms_m": np.sqrt((e * e).mean()) if some else np.nan,
                    "std_m": e.std() if some else np.nan,
                    "n": len(e),
                }
    table = pd.DataFrame.from_dict(rows, orient="index")
    table.index = pd.MultiIndex.from_tuples(rows, names=["receiver", "frame", "axis"])
    return table


def percentile_table(tracks: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Order statistics of the lengths of the errors, over all valid estimates.

    Parameters
    ----------
    tracks
        What `track` returns, by receiver.

    Returns
    -------
    table
        Index: receiver, frame (as in `error_table`), length (``horizontal``, ``total``). Columns
        [m]: ``p50_m`` (CEP50 for the horizontal error), ``p67_m``, ``p95_m`` (R95) and
        ``max_m``: x₍⌈p n / 100⌉₎ of n estimates.
    """
    rows = {}
    for receiver, estimates in tracks.items():
        for frame in frames_of(estimates):
            x, y = (estimates[error_column(frame, axis)].to_numpy() for axis in ("x", "y"))
            total = estimates[error_column(frame, "total")].to_numpy()
            horizontal = np.sqrt(horizontal_square(x, y))
            for length, values in (("horizontal", horizontal), ("total", total)):
                rows[receiver, frame, length] = order_statistics(values, PERCENTAGES)
    columns = [percentile_column(p) for p in PERCENTAGES]
    table = pd.DataFrame.from_dict(rows, orient="index", columns=columns)
    table.index = pd.MultiIndex.from_tuples(rows, names=["receiver", "frame", "length"])
    return table


def error_column(frame: str, axis: str) -> str:
    """Name of the column of a `track` that holds an error.

    Raises
    ------
    ConfigurationError
        There is no such frame or axis.
    """
    check_choice("frame", frame, FRAMES)
    check_choice("axis", axis, (*AXES, "total"))
    return f"{PREFIXES[frame]}error_{axis}_m"


def frames_of(track: pd.DataFrame) -> list[str]:
    """The frames in which a receiver has errors, from its `track`."""
    return [frame for frame in FRAMES if error_column(frame, "total") in track]


def with_errors(
    tracks: Mapping[str, pd.DataFrame], frame: str
) -> Mapping[str, pd.DataFrame]:
    """What `track` returns, of the receivers that have errors in a frame.

    Raises
    ------
    ConfigurationError
        There is no such frame, or no receiver has errors in it.
    """
    column = error_column(frame, "total")
    some = {receiver: track for receiver, track in tracks.items() if column in track}
    if not some:
        raise ConfigurationError(
            f"frame: must be one in which a receiver has errors, got {frame!r}, which takes an "
            f"output {OWN_PORT}"
        )
    return some


def availability(time_ns: Nanoseconds, valid: NDArray[np.bool_]) -> float:
    """Share of the time of a run during which a fix was available.

    The value of ``valid`` at an instant holds until the next recorded instant.
    """
    steps = np.diff(time_ns)
    return float(steps[valid[:-1]].sum() / steps.sum())


def update_share(
    time_ns: Nanoseconds, update_count: NDArray[np.int64], update_interval_ns: int
) -> float:
    """Share of a receiver's updates that gave a new estimate.

    Update k is due at a time k U after the start (U: update interval), and is visible at the next
    recorded instant.
    """
    due = (time_ns[-1] - time_ns[0] - 1) // update_interval_ns
    return float((update_count[-1] - update_count[0]) / due) if due > 0 else np.nan


def lost(record: Record, receiver: str) -> bool:
    """Whether the RMS error in the last quarter of the run exceeds the distance to the platform.

    The distance is the RMS true distance at the same epochs. A receiver without an estimate in the
    last quarter is lost too.
    """
    judged = judge(record, receiver)
    late = judged.late & ~judged.broken
    return bool(
        lost_by(
            late.sum(), in_order(judged.square[late]), in_order(judged.distance_square[late])
        )
    )


def summary(
    record: Record,
    tracks: Mapping[str, pd.DataFrame],
    update_interval_ns: int | None = None,
) -> pd.DataFrame:
    """Availability and consistency of each receiver; one row per receiver.

    Columns: ``estimates``, ``first_fix_s`` (epoch of the first estimate), ``availability`` and
    ``update_share`` (NaN if the update interval is not given); for each of ``nees_position``,
    ``relative_nees_position``, ``own_relative_nees_position``, ``nees_state`` and ``nis`` (NaN
    without the outputs for it), the time mean, ``…_expected`` (the mean
    degrees of freedom), ``…_low`` and ``…_high`` of its band (`definitions.chi_square_band`) and
    ``…_verdict``; ``inconsistent`` (time-mean position NEES above its band; missing without any
    NEES) and ``lost``.
    """
    rows = {}
    for receiver, estimates in tracks.items():
        count = record.values[f"{receiver}.update_count"].astype(np.int64)
        row: dict[str, Any] = {
            "estimates": len(estimates),
            "first_fix_s": estimates["epoch_s"].iloc[0] if len(estimates) else np.nan,
            "availability": availability(record.time_ns, record.valid(receiver)),
            "update_share": (
                np.nan if update_interval_ns is None
                else update_share(record.time_ns, count, update_interval_ns)
            ),
        }
        n = len(estimates)
        degrees = {
            "nees_position": np.full(n, 3),
            "relative_nees_position": np.full(n, 3),
            "own_relative_nees_position": np.full(n, 3),
            "nees_state": np.full(n, 6),
            "nis": estimates.get("nis_degrees", pd.Series(np.zeros(n))).to_numpy(),
        }
        for name, dof in degrees.items():
            values = estimates.get(name, pd.Series(np.full(n, np.nan))).to_numpy(dtype=float)
            used = ~np.isnan(values) & ((dof > 0) | ("nis_degrees" not in estimates))
            mean = float(values[used].mean()) if used.any() else np.nan
            band = chi_square_band(float(dof[used].sum()), int(used.sum()))
            row |= {
                name: mean,
                f"{name}_expected": (
                    float(dof[used].mean()) if np.isfinite(band).all() else np.nan
                ),
                f"{name}_low": band[0],
                f"{name}_high": band[1],
                f"{name}_verdict": verdict(mean, band),
            }
        claims = estimates.get("nees_position", pd.Series(dtype=float)).dropna().to_numpy()
        flag, known = inconsistent(in_order(claims) / max(len(claims), 1), len(claims))
        row["inconsistent"] = bool(flag) if known else pd.NA
        row["lost"] = lost(record, receiver)
        rows[receiver] = row
    table = pd.DataFrame.from_dict(rows, orient="index")
    if table["inconsistent"].isna().any():
        table = table.astype({"inconsistent": "boolean"})
    table.index.name = "receiver"
    return table


def inclines(record: Record) -> bool:
    """Whether the platform's attitude changes in a run, or is reported wrongly."""
    true = record.values["platform.attitude"]
    reported = record.values.get(REPORTED, true)
    return bool(np.ptp(true, axis=0).any()) or not np.array_equal(true, reported)
