"""How good an estimate is: errors against the truth, availability, consistency.

An error is the estimate minus the truth (the paper's equation 10 has the opposite sign). It is
given in two frames:

- *absolute*: ``x̂ − x``, north, east, down;
- *relative* to the platform: the absolute error minus the mean over the beacons of reported minus
  true position at the estimate's epoch, so that an error of GPS which moves all beacons alike does
  not count.

Everything here is a pure function of arrays and tables.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtri

from .errors import FmuError, check_choice

if TYPE_CHECKING:
    from .record import Record

Floats = NDArray[np.float64]
Nanoseconds = NDArray[np.int64]

AXES = ("x", "y", "z")
FRAMES = ("absolute", "relative")
POSITION_STATES = [0, 2, 4]
"""Places of the position in the state (x, vx, y, vy, z, vz)."""
CONFIDENCE = 0.95


def state_at(
    time_ns: Nanoseconds, position: Floats, velocity: Floats, epoch_ns: Nanoseconds
) -> tuple[Floats, Floats]:
    """True position and velocity at given epochs.

    At a recorded instant it is the recorded value, bit by bit; in between the cubic Hermite
    polynomial through the recorded positions and velocities at both ends.

    Parameters
    ----------
    time_ns
        Recorded instants [ns], increasing; shape (n,).
    position, velocity
        Recorded motion [m], [m/s]; shape (n, 3).
    epoch_ns
        Epochs within the recorded time [ns]; shape (m,).

    Returns
    -------
    position, velocity
        [m], [m/s]; shape (m, 3).

    Raises
    ------
    ValueError
        An epoch lies outside the recorded time.
    """
    if epoch_ns.size and not (time_ns[0] <= epoch_ns.min() and epoch_ns.max() <= time_ns[-1]):
        raise ValueError("epochs must lie within the recorded time")
    right = np.searchsorted(time_ns, epoch_ns)
    exact = time_ns[right] == epoch_ns
    left = np.where(exact, right, right - 1)
    step = np.where(exact, 1, time_ns[right] - time_ns[left])
    h = (step * 1e-9)[:, None]
    u = ((epoch_ns - time_ns[left]) / step)[:, None]
    p0, p1, v0, v1 = position[left], position[right], velocity[left], velocity[right]
    secant = (p1 - p0) / h
    # p = p0 + h (v0 u + b u² + a u³), with a and b from p(1) = p1 and dp/du(1) = h v1
    b = 3 * secant - 2 * v0 - v1
    a = v0 + v1 - 2 * secant
    between = p0 + h * u * (v0 + u * (b + u * a))
    return (
        np.where(exact[:, None], p0, between),
        np.where(exact[:, None], v0, v0 + u * (2 * b + u * 3 * a)),
    )


def held_at(time_ns: Nanoseconds, values: Floats, epoch_ns: Nanoseconds) -> Floats:
    """Recorded values at the last instant that is not after each epoch; shape (m, …)."""
    held: Floats = values[np.searchsorted(time_ns, epoch_ns, side="right") - 1]
    return held


def recorded(record: Record, name: str) -> Floats:
    """Recorded values of ``"component.variable"`` as floats; shape (n, …)."""
    return record.values[name].astype(np.float64, copy=False)


def platform_error(record: Record, epoch_ns: Nanoseconds) -> Floats:
    """Mean over the beacons of reported minus true position [m] at given epochs; shape (m, 3).

    Sensor errors are held between samples, and so is the value between recorded instants.
    """
    reported = recorded(record, "platform.reported_beacon_position")
    error = (reported - recorded(record, "platform.beacon_position")).mean(axis=1)
    return held_at(record.time_ns, error, epoch_ns)


def nees(error: Floats, covariance: Floats) -> Floats:
    """Normalised estimation error squared, eᵀ P⁻¹ e.

    Parameters
    ----------
    error
        Shape (m, d).
    covariance
        Shape (m, d, d), in the units of the error.

    Returns
    -------
    nees
        Shape (m,); NaN where the covariance is not positive definite to working precision.
    """
    result = np.full(len(error), np.nan)
    finite: NDArray[np.bool_] = np.isfinite(np.einsum("mi,mij->m", error, covariance))
    eigenvalues = np.linalg.eigvalsh(np.where(finite[:, None, None], covariance, 0.0))
    usable = finite & (eigenvalues[:, 0] > 1e-14 * np.abs(eigenvalues[:, -1]))
    e, P = error[usable], covariance[usable]
    result[usable] = np.einsum("mi,mi->m", e, np.linalg.solve(P, e[:, :, None])[:, :, 0])
    return result


def chi_square_band(degrees: float, samples: int) -> tuple[float, float]:
    """Two-sided 95 % band of the mean of independent chi-square samples.

    Parameters
    ----------
    degrees
        Degrees of freedom of all samples together.
    samples
        Number of samples.

    Notes
    -----
    The errors of one run follow each other and are not independent, so the mean of a consistent
    filter leaves this band more often than once in twenty runs. It is a yardstick, not a test; a
    test takes the mean over runs at one epoch.
    """
    if samples == 0 or degrees == 0:
        return np.nan, np.nan
    tail = (1 - CONFIDENCE) / 2
    low, high = chdtri(degrees, [1 - tail, tail]) / samples
    return float(low), float(high)


def verdict(mean: float, band: tuple[float, float]) -> str:
    """What a mean NEES or NIS says about a filter's covariance.

    Returns
    -------
    str
        ``optimistic``: errors are larger than the filter claims; ``pessimistic``: smaller;
        ``consistent``: inside the band; ``unknown``: there is no mean.
    """
    if not np.isfinite(mean) or not np.isfinite(band).all():
        return "unknown"
    if mean > band[1]:
        return "optimistic"
    return "pessimistic" if mean < band[0] else "consistent"


def track(record: Record, receiver: str) -> pd.DataFrame:
    """A receiver's valid estimates beside the truth, one row per estimate.

    Columns: ``epoch_s``; ``{x,y,z}_m``; ``true_{x,y,z}_m``; ``error_{x,y,z,total}_m`` (absolute)
    and ``relative_error_{x,y,z,total}_m``; where the receiver tells them, ``std_{x,y,z}_m``,
    ``nees_position`` (3 degrees of freedom) and ``nees_state`` (6), both of the absolute error,
    ``relative_nees_position`` (3), ``nis`` and ``nis_degrees``.

    Raises
    ------
    FmuError
        An estimate's epoch lies outside the run, or its position is not finite.
    """
    estimates = record.estimates(receiver)
    epoch_ns, position = estimates.epoch_ns, estimates.position
    start, stop = record.time_ns[0], record.time_ns[-1]
    outside = (epoch_ns < start) | (epoch_ns > stop)
    if outside.any():
        raise FmuError(
            f"{receiver}.epoch: must lie within the run, {start / 1e9:g} to {stop / 1e9:g} s, "
            f"got {epoch_ns[outside][0] / 1e9:g} s"
        )
    broken = ~np.isfinite(position).all(axis=1)
    if broken.any():
        raise FmuError(
            f"{receiver}.position: must be finite in a valid estimate, got "
            f"{position[broken][0].tolist()} at epoch {epoch_ns[broken][0] / 1e9:g} s"
        )
    true_position, true_velocity = state_at(
        record.time_ns,
        recorded(record, "target.position"),
        recorded(record, "target.velocity"),
        epoch_ns,
    )
    error = position - true_position
    relative = error - platform_error(record, epoch_ns)
    columns: dict[str, ArrayLike] = {"epoch_s": epoch_ns / 1e9}
    columns |= {f"{axis}_m": position[:, i] for i, axis in enumerate(AXES)}
    columns |= {f"true_{axis}_m": true_position[:, i] for i, axis in enumerate(AXES)}
    for prefix, values in (("", error), ("relative_", relative)):
        columns |= {f"{prefix}error_{axis}_m": values[:, i] for i, axis in enumerate(AXES)}
        columns[f"{prefix}error_total_m"] = np.linalg.norm(values, axis=1)
    std, P = estimates.position_std, estimates.covariance
    if std is None and P is not None:
        std = np.sqrt(P[:, POSITION_STATES, POSITION_STATES])
    if std is not None:
        columns |= {f"std_{axis}_m": std[:, i] for i, axis in enumerate(AXES)}
    if P is not None:
        of_position = P[np.ix_(range(len(P)), POSITION_STATES, POSITION_STATES)]
        columns["nees_position"] = nees(error, of_position)
        columns["relative_nees_position"] = nees(relative, of_position)
        if estimates.velocity is not None:
            # the paper's order: each axis' position, then its velocity
            pairs = np.stack([error, estimates.velocity - true_velocity], axis=2)
            columns["nees_state"] = nees(pairs.reshape(-1, 6), P)
    if estimates.nis is not None:
        columns["nis"] = estimates.nis
    if estimates.nis_degrees is not None:
        columns["nis_degrees"] = estimates.nis_degrees
    return pd.DataFrame(columns)


def error_table(tracks: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Statistics of the errors over all valid estimates, as in the paper's Tables 4 to 6.

    Parameters
    ----------
    tracks
        What `track` returns, by receiver.

    Returns
    -------
    table
        Index: receiver, frame (``absolute``, ``relative``), axis (``x``, ``y``, ``z``,
        ``total``). Columns: ``mean_m`` (signed for an axis; of the length of the error for
        ``total``), ``rms_m``, ``std_m`` about that mean, so that rms² = mean² + std², and ``n``,
        the number of estimates. The RMS of the total squared is the sum of the axes' squares.
    """
    rows = {}
    for receiver, estimates in tracks.items():
        for frame in FRAMES:
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


def error_column(frame: str, axis: str) -> str:
    """Column of a `track` that holds an error.

    Raises
    ------
    ConfigurationError
        There is no such frame or axis.
    """
    check_choice("frame", frame, FRAMES)
    check_choice("axis", axis, (*AXES, "total"))
    return f"{'relative_' if frame == 'relative' else ''}error_{axis}_m"


def availability(time_ns: Nanoseconds, valid: NDArray[np.bool_]) -> float:
    """Share of the run's time during which a fix was available.

    What ``valid`` says at an instant holds until the next recorded one.
    """
    steps = np.diff(time_ns)
    return float(steps[valid[:-1]].sum() / steps.sum())


def update_share(
    time_ns: Nanoseconds, update_count: NDArray[np.int64], update_interval_ns: int
) -> float:
    """Share of a receiver's updates that gave a new estimate.

    Update k is due at k U after the start and shows at the next recorded instant.
    """
    due = (time_ns[-1] - time_ns[0] - 1) // update_interval_ns
    return float((update_count[-1] - update_count[0]) / due) if due > 0 else np.nan


def late(record: Record, track: pd.DataFrame) -> pd.DataFrame:
    """A receiver's estimates of the last quarter of the run."""
    start, stop = record.time_ns[0] / 1e9, record.time_ns[-1] / 1e9
    end: pd.DataFrame = track[track["epoch_s"] >= stop - (stop - start) / 4]
    return end


def lost(record: Record, track: pd.DataFrame) -> bool:
    """Whether the RMS error of the last quarter of the run exceeds the distance to the platform.

    The distance is the RMS of the true one at the same epochs. A receiver without an estimate in
    the last quarter is lost, too.
    """
    end = late(record, track)
    if end.empty:
        return True
    epoch_ns = np.rint(end["epoch_s"].to_numpy() * 1e9).astype(np.int64)
    platform = held_at(record.time_ns, recorded(record, "platform.position"), epoch_ns)
    truth = end[[f"true_{axis}_m" for axis in AXES]].to_numpy()
    squares = ((truth - platform) ** 2).sum(axis=1)
    return bool((end["error_total_m"] ** 2).mean() > squares.mean())


def summary(
    record: Record,
    tracks: Mapping[str, pd.DataFrame],
    update_interval_ns: int | None = None,
) -> pd.DataFrame:
    """Availability and consistency of each receiver; one row per receiver.

    Columns: ``estimates``, ``first_fix_s`` (epoch of the first estimate), ``availability`` and
    ``update_share`` (NaN if the update interval is not given), and for each of
    ``nees_position``, ``relative_nees_position``, ``nees_state`` and ``nis`` the time mean,
    ``…_expected`` (the mean degrees of freedom), ``…_low`` and ``…_high`` of its band
    (`chi_square_band`) and ``…_verdict``; ``inconsistent`` (time-mean position NEES above its
    band) and ``lost``.
    """
    rows = {}
    for receiver, estimates in tracks.items():
        count = record.values[f"{receiver}.update_count"].astype(np.int64)
        valid = record.values.get(f"{receiver}.valid", count > 0).astype(bool)
        row: dict[str, object] = {
            "estimates": len(estimates),
            "first_fix_s": estimates["epoch_s"].iloc[0] if len(estimates) else np.nan,
            "availability": availability(record.time_ns, valid),
            "update_share": (
                np.nan if update_interval_ns is None
                else update_share(record.time_ns, count, update_interval_ns)
            ),
        }
        n = len(estimates)
        degrees = {
            "nees_position": np.full(n, 3),
            "relative_nees_position": np.full(n, 3),
            "nees_state": np.full(n, 6),
            "nis": estimates.get("nis_degrees", pd.Series(np.zeros(n))).to_numpy(),
        }
        for name, dof in degrees.items():
            values = estimates.get(name, pd.Series(np.full(n, np.nan))).to_numpy(dtype=float)
            used = np.isfinite(values) & ((dof > 0) | ("nis_degrees" not in estimates))
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
        row["inconsistent"] = row["nees_position_verdict"] == "optimistic"
        row["lost"] = lost(record, estimates)
        rows[receiver] = row
    table = pd.DataFrame.from_dict(rows, orient="index")
    table.index.name = "receiver"
    return table
