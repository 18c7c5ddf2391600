"""Quality of a run's estimates: errors, availability and consistency, as tables.

Errors and all other terms are defined in `sblcosim.judge.definitions`. All functions are pure
functions of records and tables.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..data.record import NEVER
from ..errors import ConfigurationError, FmuError, check_choice
from .columns import CHI_SQUARES, ERRORS, ESTIMATES, PERCENTILES, SUMMARY
from .definitions import (
    AXES,
    FRAMES,
    OWN_PORT,
    PERCENTAGES,
    PREFIXES,
    Judged,
    beyond_claim,
    chi_square_band,
    horizontal_square,
    in_order,
    inconsistent,
    judged_by,
    misleading,
    order_statistics,
    times_standing,
)
from .definitions import lost as lost_by

if TYPE_CHECKING:
    from ..data.estimates import Estimates, Floats, Integers
    from ..data.record import Record
    from ..data.truth import Truth

REPORTED = "platform.reported_attitude"
"""An output of our own platform: the attitude from its IMU."""


def verdict(mean: float, band: tuple[float, float]) -> str:
    """Judge a filter's covariance from a mean NEES or NIS.

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
    """A receiver's valid estimates and the truth, one row per estimate.

    The columns are those of `sblcosim.judge.columns.ESTIMATES` for which the receiver has outputs.
    Relative quantities are left out if the platform's true motion is unknown.
    """
    values = {c.name: c.of(judged) for c in ESTIMATES.columns if c.of}
    return pd.DataFrame({name: own for name, own in values.items() if own is not None})


def intact(receiver: str, estimates: Estimates, truth: Truth) -> Judged:
    """Estimates and the truth, none of them broken.

    Raises
    ------
    FmuError
        An estimate's epoch lies outside the run, or its position is not finite; ``component`` names
        the culprit.
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
        f"{name}: must be finite, and so must its square, in a valid estimate, got "
        f"{values.tolist()} at epoch {judged.epoch_s[i]:g} s"
    )


def error_table(tracks: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Statistics of the errors over all valid estimates, as in the paper's Tables 4 to 6.

    Parameters
    ----------
    tracks
        Results of `track`, by receiver.

    Returns
    -------
    table
        Index: receiver, frame (``absolute``, ``relative``, and ``own_relative`` for receivers that
        have it), axis (``x``, ``y``, ``z``, ``total``). Columns: those of
        `sblcosim.judge.columns.ERRORS`.
    """
    rows = {}
    for receiver, estimates in tracks.items():
        for frame in frames_of(estimates):
            for axis in (*AXES, "total"):
                errors = estimates[error_column(frame, axis)].to_numpy()
                rows[receiver, frame, axis] = ERRORS.row(errors)
    table = pd.DataFrame.from_dict(rows, orient="index")
    table.index = pd.MultiIndex.from_tuples(rows, names=[c.name for c in ERRORS.index])
    return table


def percentile_table(tracks: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Percentiles of the lengths of the errors, over all valid estimates.

    Parameters
    ----------
    tracks
        Results of `track`, by receiver.

    Returns
    -------
    table
        Index: receiver, frame (as in `error_table`), length (``horizontal``, ``total``). Columns
        [m]: those of `sblcosim.judge.columns.PERCENTILES`, x₍⌈p n / 100⌉₎ of n estimates; 50 % of
        the horizontal error is CEP50, 95 % is R95.
    """
    rows = {}
    for receiver, estimates in tracks.items():
        for frame in frames_of(estimates):
            x, y = (estimates[error_column(frame, axis)].to_numpy() for axis in ("x", "y"))
            total = estimates[error_column(frame, "total")].to_numpy()
            horizontal = np.sqrt(horizontal_square(x, y))
            for length, values in (("horizontal", horizontal), ("total", total)):
                rows[receiver, frame, length] = order_statistics(values, PERCENTAGES)
    table = pd.DataFrame.from_dict(rows, orient="index", columns=PERCENTILES.names)
    table.index = pd.MultiIndex.from_tuples(rows, names=[c.name for c in PERCENTILES.index])
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
    """Frames in which a receiver has errors, from its `track`."""
    return [frame for frame in FRAMES if error_column(frame, "total") in track]


def with_errors(
    tracks: Mapping[str, pd.DataFrame], frame: str
) -> Mapping[str, pd.DataFrame]:
    """The `track` of each receiver that has errors in a frame.

    Raises
    ------
    ConfigurationError
        There is no such frame, or no receiver has errors in it.
    """
    column = error_column(frame, "total")
    some = {receiver: track for receiver, track in tracks.items() if column in track}
    if not some:
        raise ConfigurationError(
            f"frame: must be one in which a receiver has errors, got {frame!r}, which needs an "
            f"output {OWN_PORT}"
        )
    return some


def availability(time_ns: Integers, valid: NDArray[np.bool_]) -> float:
    """Share of a run's time with an estimate available.

    The value of ``valid`` at an instant holds until the next recorded instant.
    """
    steps = np.diff(time_ns)
    return float(steps[valid[:-1]].sum() / steps.sum())


def update_share(
    time_ns: Integers, update_count: NDArray[np.int64], update_interval_ns: int
) -> float:
    """Share of a receiver's updates that gave a new estimate.

    Update k is due k U after the start (U: update interval) and becomes visible at the next
    recorded instant.
    """
    due = (time_ns[-1] - time_ns[0] - 1) // update_interval_ns
    return float((update_count[-1] - update_count[0]) / due) if due > 0 else np.nan


def lost(judged: Judged) -> bool | None:
    """Whether the RMS error in the last quarter of the run exceeds the distance to the platform.

    The distance is the RMS true distance at the same epochs. A receiver without an estimate in the
    last quarter is lost too. None if the platform's true motion is unknown.
    """
    if judged.distance_square is None:
        return None
    late = judged.late & ~judged.broken
    return bool(
        lost_by(
            late.sum(), in_order(judged.square[late]), in_order(judged.distance_square[late])
        )
    )


def _claims(judged: Judged, duration_ns: int) -> dict[str, Any]:
    """Columns on what a receiver claims; NaN, or missing flags, without any NEES."""
    claims = judged.nees[~np.isnan(judged.nees)]
    if not len(claims):
        return {"inconsistent": pd.NA, "beyond_claim": np.nan, "beyond_claim_longest_s": np.nan,
                "misleading": pd.NA}
    mean = in_order(claims) / len(claims)
    beyond, longest = times_standing(judged, beyond_claim(judged))
    rms = float(np.sqrt(judged.square.mean()))
    return {
        "inconsistent": bool(inconsistent(mean, len(claims))[0]),
        "beyond_claim": beyond / duration_ns if duration_ns else np.nan,
        "beyond_claim_longest_s": longest / 1e9,
        "misleading": bool(misleading(mean, rms, longest / 1e9)),
    }


def _fixes(
    receiver: str,
    judged: Judged,
    truth: Truth,
    record: Record | None,
    update_interval_ns: int | None,
) -> tuple[float, float]:
    """Availability and share of updates.

    For estimates made after the run, availability counts from the first epoch on, and there are no
    updates.
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
    """Means of NEES and NIS, with their bands and verdicts, from a `track`."""
    row: dict[str, Any] = {}
    n = len(estimates)
    each = estimates.get("nis_degrees", pd.Series(np.zeros(n))).to_numpy()
    for one in CHI_SQUARES:
        dof = each if one.degrees is None else np.full(n, one.degrees)
        values = estimates.get(one.name, pd.Series(np.full(n, np.nan))).to_numpy(dtype=float)
        used = ~np.isnan(values) & ((dof > 0) | ("nis_degrees" not in estimates))
        row |= of_chi_square(one.name, values[used], dof[used])
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

    The columns are those of `sblcosim.judge.columns.SUMMARY` except ``failure``. ``update_share``
    is NaN without an update interval, and for estimates made after the run. Columns of NEES and NIS
    are NaN without the outputs for them. ``…_expected`` is the mean degrees of freedom, and
    ``…_low`` to ``…_high`` is `definitions.chi_square_band`. ``inconsistent`` and ``misleading``
    are missing without any NEES, ``lost`` if the platform's true motion is unknown.
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
        row |= _claims(own, truth.stop_ns - truth.start_ns)
        row["lost"] = pd.NA if (is_lost := lost(own)) is None else is_lost
        rows[receiver] = row
    table = pd.DataFrame.from_dict(rows, orient="index")
    table = table[[c.name for c in SUMMARY.columns if not c.sometimes]]
    for flags in ("inconsistent", "lost", "misleading"):
        if table[flags].isna().any():
            table = table.astype({flags: "boolean"})
    table.index.name = "receiver"
    return table


def inclines(record: Record) -> bool:
    """Whether the platform's attitude changes in a run, or is reported with errors."""
    true = record.values["platform.attitude"]
    reported = record.values.get(REPORTED, true)
    return bool(np.ptp(true, axis=0).any()) or not np.array_equal(true, reported)
