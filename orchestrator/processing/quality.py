"""How good estimates of a log are: errors with a truth, residuals and agreement without."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sblcosim.fmus.host.nanoseconds import SECOND

from ..data.estimates import Estimates, Flags, Floats, Integers
from ..data.truth import Truth
from ..judge.definitions import POSITION_STATES, nees, order_statistics
from ..judge.without_truth import between, told
from ..logs.columns import KINDS, SIGNED
from ..logs.log import Log, Receptions
from ..tracks.place import Origin
from ..words.lists import listed
from ..words.numbers import meters
from .columns import RESIDUALS

TRUTH_GAP_S = 10.0
"""In a longer gap of the truth [s], nothing is known."""
TAIL = 4.0
_TO_STD = 1.4826
_FEWEST = 10
_MISFIT, _MISFIT_M = 0.07, 3.0
"""Ranges do not fit if residuals are usually above this share of the ranges, and this [m]."""
_MOST_PAIRS = 400
"""Number of residuals for a slope, which takes all pairs."""
_CLIPPED = 3.0
"""Late ranges count like residuals of this size, in standard deviations."""
_LAGS, _LAG_POWER = 40, 2 / 3
"""Lags over which residuals of a beacon may be correlated: at least, and by the number of all."""


def known(truth: Truth, epoch: Integers) -> Flags:
    """Whether the truth is known at epochs [ns]; shape (m,)."""
    times = truth.time_ns
    after = np.searchsorted(times, epoch)
    inside = (times[0] <= epoch) & (epoch <= times[-1])
    right = np.clip(after, 0, len(times) - 1)
    left = np.clip(right - 1, 0, None)
    near = (times[right] - times[left]) <= TRUTH_GAP_S * SECOND
    there: Flags = inside & (near | (times[right] == epoch))
    return there


def true_at(truth: Truth, epoch: Integers) -> Floats:
    """True positions at epochs [ns], NED [m]; NaN where unknown; (m, 3)."""
    position = np.full((len(epoch), 3), np.nan)
    which = known(truth, epoch)
    position[which] = truth.state_at(epoch[which])[0]
    return position


def std_of(estimates: Estimates) -> Floats | None:
    """Claimed standard deviations, NED [m]; (m, 3)."""
    P = estimates.covariance
    if P is None:
        return estimates.position_std
    variance = np.diagonal(P, axis1=1, axis2=2)[:, POSITION_STATES]
    return np.sqrt(np.where(variance >= 0, variance, np.nan))


def row_of(log: Log, estimates: Estimates, truth: Truth | None) -> dict[str, Any]:
    """The row of a receiver in the table of receivers."""
    epoch_s = (np.sort(estimates.epoch_ns) - log.start_ns) / SECOND
    row: dict[str, Any] = {
        "estimates": len(estimates),
        "first_fix_s": epoch_s[0] if len(epoch_s) else np.nan,
        "longest_gap_s": float(np.diff(epoch_s).max()) if len(epoch_s) > 1 else np.nan,
    }
    std = std_of(estimates)
    which = np.ones(len(estimates), bool)
    if truth is not None:
        error = estimates.position - true_at(truth, estimates.epoch_ns)
        which = np.all(np.isfinite(error), axis=1)
        row |= _errors(error[which], log.meta.dimension == 3)
    if std is not None and which.any():
        row["claimed_rms_m"] = float(np.sqrt((std[which, :2] ** 2).sum(axis=1).mean()))
        made = row.get("horizontal_rms_m", np.nan)
        if np.isfinite(made) and made > 0:
            row["claimed_over_made"] = row["claimed_rms_m"] / made
        if truth is not None and estimates.covariance is not None:
            row["nees"] = _nees(error[which], estimates.covariance[which])
    nis, degrees = told(estimates)
    if len(nis):
        row |= {"nis": float(nis.mean()), "nis_expected": float(degrees.mean())}
    return row


def _errors(error: Floats, deep: bool) -> dict[str, Any]:
    row: dict[str, Any] = {"judged": len(error)}
    if not len(error):
        return row
    level = np.hypot(error[:, 0], error[:, 1])
    row["horizontal_rms_m"] = float(np.sqrt((level**2).mean()))
    most = order_statistics(level, (95, 100))
    row["horizontal_p95_m"], row["horizontal_max_m"] = map(float, most)
    if deep:
        total = np.linalg.norm(error, axis=1)
        row["total_rms_m"] = float(np.sqrt((total**2).mean()))
        (row["total_p95_m"],) = map(float, order_statistics(total, (95,)))
    return row


def _nees(error: Floats, covariance: Floats) -> float:
    level = covariance[:, [0, 2]][:, :, [0, 2]]
    each = nees(error[:, :2], level)
    return float(np.nanmean(each)) if np.isfinite(each).any() else np.nan


def table_of(
    log: Log, estimates: Estimates, truth: Truth | None, place: Origin | None = None
) -> pd.DataFrame:
    """The estimates of a receiver as a table.

    Parameters
    ----------
    place
        Origin of north, east and down; None: no latitudes and longitudes.
    """
    columns: dict[str, Any] = {
        "time_ns": estimates.epoch_ns,
        "epoch_s": (estimates.epoch_ns - log.start_ns) / SECOND,
        **dict(zip(("x_m", "y_m", "z_m"), estimates.position.T, strict=True)),
    }
    std = std_of(estimates)
    if std is not None:
        columns |= dict(zip(("std_x_m", "std_y_m", "std_z_m"), std.T, strict=True))
    if truth is not None:
        true = true_at(truth, estimates.epoch_ns)
        columns |= dict(zip(("true_x_m", "true_y_m", "true_z_m"), true.T, strict=True))
        error = estimates.position - true
        columns |= dict(zip(("error_x_m", "error_y_m", "error_z_m"), error.T, strict=True))
        columns["error_horizontal_m"] = np.hypot(*error[:, :2].T)
    if place is not None:
        geographic = place.geographic(estimates.position)
        columns |= {"latitude_deg": geographic[:, 0], "longitude_deg": geographic[:, 1]}
    return pd.DataFrame(columns)


# --- Residuals ------------------------------------------------------------------------------------


def residuals_of(log: Log, estimates: Estimates) -> tuple[Flags, Floats]:
    """Which ranges lie between estimates, and range minus that of the estimates [m]."""
    heard = log.receptions
    which, at = between(estimates, heard.epoch_ns)
    distance = np.linalg.norm(at - heard.beacon_position[which], axis=1)
    differ = heard.kind[which] == KINDS.index(SIGNED)
    if differ.any():
        from_middle = np.linalg.norm(at - middles_of(heard)[which], axis=1)
        distance = distance - np.where(differ, from_middle, 0.0)
    return which, heard.range[which] - distance


def middles_of(heard: Receptions) -> Floats:
    """Middle of the beacons at each reception, as packets report it, NED [m]; (m, 3).

    Packets without all beacons have the middle of those that heard the same ping.
    """
    _, ping = np.unique(heard.epoch_ns, return_inverse=True)
    count = np.bincount(ping)[ping, None]
    own = np.column_stack([np.bincount(ping, axis)[ping] for axis in heard.beacon_position.T])
    whole = np.abs(heard.packet).max(axis=(1, 2), initial=0.0)[:, None] > 0
    return np.where(whole, heard.packet.mean(axis=1), own / count)


def misfit(log: Log, estimates: Estimates) -> list[str]:
    """A line, if ranges do not fit the beacons at all."""
    which, off = residuals_of(log, estimates)
    if len(off) < _FEWEST:
        return []
    heard = log.receptions
    usual, length = float(np.median(np.abs(off))), float(np.median(heard.range[which]))
    if usual < max(_MISFIT * length, _MISFIT_M):
        return []
    return [
        f"ranges do not fit the beacons: half of the residuals are above {meters(usual)}, at "
        f"ranges of {meters(length)}; {_suspects(log)}"
    ]


def _suspects(log: Log) -> str:
    """What may be wrong where ranges do not fit the beacons."""
    heard = log.receptions
    deep = float(np.median(np.abs(log.depth))) if len(log.depth) else 0.0
    most = float(np.abs(heard.range).max() + np.abs(heard.beacon_position[:, 2]).max())
    if SIGNED not in log.kinds and deep > most:
        return (
            f"the depth is wrong, perhaps its unit: half of its readings are above {meters(deep)}, "
            f"but ranges and beacons allow {meters(most)} at most"
        )
    units = ["the ranges", *["the depths"] * bool(len(log.depth)),
             *["the platform's angles"] * bool(heard.has_pose.any())]
    return f"check the units of {listed(units)}, and the places of the beacons"


def residuals(log: Log, estimates: Mapping[str, Estimates]) -> pd.DataFrame:
    """The table of residuals, by receiver and beacon."""
    rows = {}
    heard = log.receptions
    for label, own in estimates.items():
        which, off = residuals_of(log, own)
        beacon, length = heard.beacon[which], heard.range[which]
        for number, name in enumerate(log.beacons):
            some = beacon == number
            if some.any():
                rows[label, name] = described(off[some], length[some])
        deep = _depth_residuals(log, own)
        if len(deep):
            rows[label, "depth"] = described(deep, None)
    table = pd.DataFrame.from_dict(rows, orient="index")
    if not rows:
        table = pd.DataFrame(columns=RESIDUALS.names)
    table.index = pd.MultiIndex.from_tuples([*rows], names=["receiver", "sample"])
    return table


def _depth_residuals(log: Log, estimates: Estimates) -> Floats:
    which, at = between(estimates, log.depth_ns)
    off: Floats = log.depth[which] - at[:, 2]
    return off


def described(off: Floats, length: Floats | None) -> dict[str, Any]:
    """A row of residuals.

    Parameters
    ----------
    off
        Residuals in the order of time [m]; shape (m,).
    length
        The ranges [m]; None: no slope over them.
    """
    offset = float(np.median(off))
    about = off - offset
    std = _TO_STD * float(np.median(np.abs(about)))
    clipped = np.clip(about, -_CLIPPED * std, _CLIPPED * std)
    clipped = clipped - clipped.mean()
    power = float((clipped**2).sum())
    slope = np.nan
    if length is not None and len(off) > 2 and np.ptp(length) > 0:
        step = max(len(off) // _MOST_PAIRS, 1)
        slope = _slope(off[::step], length[::step])
    return {
        "n": len(off),
        "offset_m": offset,
        "std_m": std,
        "slope": slope,
        "autocorrelation": float((clipped[1:] * clipped[:-1]).sum()) / power if power else np.nan,
        "tails": float((np.abs(about) > TAIL * std).mean()) if std else np.nan,
    }


def resemblance(beacon: NDArray[np.intp], residual: Floats) -> float:
    """Factor of standard deviations, as residuals of a beacon are correlated in time.

    It is the root of the residuals' spectrum at zero over their variance, with Bartlett's weights
    (W. K. Newey, K. D. West, Econometrica 55, 1987).

    Parameters
    ----------
    beacon, residual
        Of each range, in the order of time; shape (m,).
    """
    beacons = np.unique(beacon)
    most = max(_LAGS, int((len(beacon) / max(len(beacons), 1)) ** _LAG_POWER))
    power, sums = 0.0, np.zeros(most)
    for one in beacons:
        own = np.clip(residual[beacon == one], -_CLIPPED, _CLIPPED)
        own = own - own.mean()
        power += float(own @ own)
        for lag in range(1, min(most, len(own) - 1) + 1):
            sums[lag - 1] += float(own[lag:] @ own[:-lag])
    weights = 1 - np.arange(1, most + 1) / (most + 1)
    total = float(weights @ sums) / power if power else 0.0
    return float(np.sqrt(max(1 + 2 * total, 0.0)))


def _slope(off: Floats, length: Floats) -> float:
    """Theil and Sen's slope: the median of those of all pairs."""
    first, second = np.triu_indices(len(off), 1)
    run = length[second] - length[first]
    some = run != 0
    return float(np.median((off[second] - off[first])[some] / run[some])) if some.any() else np.nan
