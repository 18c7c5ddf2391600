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

from ..data.record import NEVER
from ..errors import ConfigurationError, FmuError, check_choice
from .definitions import (
    AXES,
    FRAMES,
    OWN_PORT,
    PERCENTAGES,
    POSITION_STATES,
    PREFIXES,
    Judged,
    chi_square_band,
    errors_of,
    horizontal_square,
    in_order,
    inconsistent,
    judged_by,
    nees,
    of_position,
    order_statistics,
    percentile_column,
)
from .definitions import lost as lost_by

if TYPE_CHECKING:
    from ..data.estimates import Estimates, Floats, Integers
    from ..data.record import Record
    from ..data.truth import Truth

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


def track(judged: Judged) -> pd.DataFrame:
    """A receiver's valid estimates with the truth, one row per estimate.

    Columns: ``epoch_s``; ``{x,y,z}_m``; ``true_{x,y,z}_m``; ``error_{x,y,z,total}_m`` (absolute)
    and ``relative_error_{x,y,z,total}_m``. If the receiver has the outputs for them:
    ``own_relative_error_{x,y,z,total}_m``, ``std_{x,y,z}_m`` and ``own_relative_std_{x,y,z}_m``,
    ``nees_position`` (3 degrees of freedom) and ``nees_state`` (6), both of the absolute error,
    ``relative_nees_position`` and ``own_relative_nees_position`` (3), ``nis`` and ``nis_degrees``.
    What is relative is left out where the platform's true motion is not known.
    """
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
        if judged.relative is not None:
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


def intact(receiver: str, estimates: Estimates, truth: Truth) -> Judged:
    """Estimates with the truth, none of them broken.

    Raises
    ------
    FmuError
        An estimate's epoch lies outside of the run, or its position is not finite; ``component`` is
        the one to blame.
    """
    judged = judged_by(estimates, truth)
    if judged.broken.any():
        error = _problem(receiver, judged, truth)
        error.component = str(error).partition(".")[0]
        raise error
    return judged


def _problem(receiver: str, judged: Judged, truth: Truth) -> FmuError:
    """The error that describes the first broken estimate."""
    i = int(judged.broken.argmax())
    start, stop, epoch = truth.start_ns, truth.stop_ns, judged.estimates.epoch_ns[i]
    if not start <= epoch <= stop:
        got = "no time" if epoch == NEVER else f"{judged.epoch_s[i]:g} s"
        return FmuError(
            f"{receiver}.epoch: must lie within the run, {start / 1e9:g} to {stop / 1e9:g} s, "
            f"got {got}"
        )
    named = {
        f"{receiver}.position": judged.estimates.position,
        "target.position": judged.true_position,
        "platform.reported_beacon_position": judged.platform_error,
        f"{receiver}.{OWN_PORT}": judged.estimates.relative_position,
    }
    known = [(name, values[i]) for name, values in named.items() if values is not None]
    # If all are finite, the square of an error overflows.
    overflowing = known[0] if not judged.square[i] < np.inf else known[-1]
    name, values = next((n for n in known if not np.isfinite(n[1]).all()), overflowing)
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


def availability(time_ns: Integers, valid: NDArray[np.bool_]) -> float:
    """Share of the time of a run during which a fix was available.

    The value of ``valid`` at an instant holds until the next recorded instant.
    """
    steps = np.diff(time_ns)
    return float(steps[valid[:-1]].sum() / steps.sum())


def update_share(
    time_ns: Integers, update_count: NDArray[np.int64], update_interval_ns: int
) -> float:
    """Share of a receiver's updates that gave a new estimate.

    Update k is due at a time k U after the start (U: update interval), and is visible at the next
    recorded instant.
    """
    due = (time_ns[-1] - time_ns[0] - 1) // update_interval_ns
    return float((update_count[-1] - update_count[0]) / due) if due > 0 else np.nan


def lost(judged: Judged) -> bool | None:
    """Whether the RMS error in the last quarter of the run exceeds the distance to the platform.

    The distance is the RMS true distance at the same epochs. A receiver without an estimate in the
    last quarter is lost too. None where the platform's true motion is not known.
    """
    if judged.distance_square is None:
        return None
    late = judged.late & ~judged.broken
    return bool(
        lost_by(
            late.sum(), in_order(judged.square[late]), in_order(judged.distance_square[late])
        )
    )


def _fixes(
    receiver: str,
    judged: Judged,
    truth: Truth,
    record: Record | None,
    update_interval_ns: int | None,
) -> tuple[float, float]:
    """Availability and share of updates.

    Of estimates that were made after the run, availability counts from the first epoch on, and
    there are no updates.
    """
    if record is None or f"{receiver}.update_count" not in record.values:
        length, epochs = truth.stop_ns - truth.start_ns, judged.estimates.epoch_ns
        known = truth.stop_ns - int(epochs.min()) if len(epochs) else 0
        return (known / length if length else float(len(epochs) > 0)), np.nan
    share = np.nan
    if update_interval_ns is not None:
        count = record.values[f"{receiver}.update_count"].astype(np.int64)
        share = update_share(record.time_ns, count, update_interval_ns)
    return availability(record.time_ns, record.valid(receiver)), share


def _consistency(estimates: pd.DataFrame) -> dict[str, Any]:
    """Means of NEES and NIS, with their bands and verdicts; of a `track`."""
    row: dict[str, Any] = {}
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
        row |= of_chi_square(name, values[used], dof[used])
    return row


def of_chi_square(name: str, values: Floats, degrees: NDArray[Any]) -> dict[str, Any]:
    """Columns of NEES or NIS: the mean, ``_expected``, ``_low`` and ``_high``, and ``_verdict``.

    Parameters
    ----------
    values, degrees
        Values, and degrees of freedom of each; shape (m,).
    """
    mean = float(values.mean()) if len(values) else np.nan
    band = chi_square_band(float(degrees.sum()), len(values))
    return {
        name: mean,
        f"{name}_expected": float(degrees.mean()) if np.isfinite(band).all() else np.nan,
        f"{name}_low": band[0],
        f"{name}_high": band[1],
        f"{name}_verdict": verdict(mean, band),
    }


def summary(
    judged: Mapping[str, Judged],
    tracks: Mapping[str, pd.DataFrame],
    truth: Truth,
    record: Record | None = None,
    update_interval_ns: int | None = None,
) -> pd.DataFrame:
    """Availability and consistency of each receiver; one row per receiver.

    Columns: ``estimates``, ``first_fix_s`` (epoch of the first estimate), ``availability`` and
    ``update_share`` (NaN if the update interval is not given, and for estimates that were made
    after the run); for each of ``nees_position``, ``relative_nees_position``,
    ``own_relative_nees_position``, ``nees_state`` and ``nis`` (NaN
    without the outputs for it), the time mean, ``…_expected`` (the mean
    degrees of freedom), ``…_low`` and ``…_high`` of its band (`definitions.chi_square_band`) and
    ``…_verdict``; ``inconsistent`` (time-mean position NEES above its band; missing without any
    NEES) and ``lost`` (missing where the platform's true motion is not known).
    """
    rows = {}
    for receiver, own in judged.items():
        estimates = tracks[receiver]
        available, share = _fixes(receiver, own, truth, record, update_interval_ns)
        row: dict[str, Any] = {
            "estimates": len(estimates),
            "first_fix_s": estimates["epoch_s"].iloc[0] if len(estimates) else np.nan,
            "availability": available,
            "update_share": share,
        }
        row |= _consistency(estimates)
        claims = estimates.get("nees_position", pd.Series(dtype=float)).dropna().to_numpy()
        flag, known = inconsistent(in_order(claims) / max(len(claims), 1), len(claims))
        row["inconsistent"] = bool(flag) if known else pd.NA
        row["lost"] = pd.NA if (is_lost := lost(own)) is None else is_lost
        rows[receiver] = row
    table = pd.DataFrame.from_dict(rows, orient="index")
    for flags in ("inconsistent", "lost"):
        if table[flags].isna().any():
            table = table.astype({flags: "boolean"})
    table.index.name = "receiver"
    return table


def inclines(record: Record) -> bool:
    """Whether the platform's attitude changes in a run, or is reported wrongly."""
    true = record.values["platform.attitude"]
    reported = record.values.get(REPORTED, true)
    return bool(np.ptp(true, axis=0).any()) or not np.array_equal(true, reported)
