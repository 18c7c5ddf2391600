"""Estimates made after a run, beside those of its receivers: the same tables and figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.models.receiver.receivers.coupled import COMPONENT as COUPLED
from sblcosim.models.receiver.surroundings import (
    CLOCK,
    NEAREST,
    PLATFORM,
    POSITION,
    SPEED,
    VELOCITY,
    VERTICAL_ERROR,
    WIDEST,
    crescent,
)

from ..results.result import Result
from ..scenario.labels import RAW
from ..shown import Shown
from ..simulation.record import Integers, Record
from . import model
from .linear import Floats
from .samples import Samples

ORDER = [i for pair in zip(POSITION, VELOCITY, strict=True) for i in pair]
"""The paper's order of position and velocity, among the states."""


@dataclass(frozen=True, eq=False, repr=False)
class Estimates(Shown):
    """Estimates at the epochs of the samples, of shape (n, …), as the outputs of `coupled`.

    Attributes
    ----------
    epochs_ns
        Epochs [ns].
    position, velocity, covariance
        NED [m], [m/s], and the covariance of (x, vx, y, vy, z, vz), SI units.
    relative_position, relative_covariance
        Of the diver less the platform [m], [m²].
    platform_position
        NED [m].
    clock_offset, sound_speed
        [s], [m/s].
    """

    epochs_ns: Integers
    position: Floats
    velocity: Floats
    covariance: Floats
    relative_position: Floats
    relative_covariance: Floats
    platform_position: Floats
    clock_offset: Floats
    sound_speed: Floats

    def __len__(self) -> int:
        return len(self.epochs_ns)


def of_states(
    p: Any, samples: Samples, mean: Floats, covariance: Floats
) -> Estimates:
    """From the states at the epochs of the samples; those before the first fix are left out.

    Parameters
    ----------
    mean, covariance
        Shape (n, 19), (n, 19, 19).
    """
    epochs = samples.epochs_ns
    heard = np.searchsorted(samples.range_ns, epochs, side="right") - 1
    down = np.asarray(model.pose_of(p, samples).down)[np.maximum(heard, 0)]
    # x − p, with the platform's down as reported less its slow error
    D = np.zeros((3, mean.shape[1]))
    D[range(3), POSITION] = 1
    D[range(2), PLATFORM] = -1
    D[2, VERTICAL_ERROR] = 1
    relative = mean @ D.T
    relative[:, 2] -= down
    relative_covariance = D @ covariance @ D.T
    relative_covariance[:, 2, 2] += p.gps_vertical_std**2
    bent = _bent(relative[:, :2], relative_covariance[:, :2, :2])
    relative_covariance[:, :2, :2] += bent
    own = covariance[:, ORDER][:, :, ORDER]
    own[:, ::2, ::2][:, :2, :2] += bent
    own[:, [0, 2], [0, 2]] += p.gps_bias_std**2
    c = p.assumed_sound_speed
    there = epochs >= first_ns(p, samples)
    return Estimates(
        epochs[there], mean[there][:, list(POSITION)], mean[there][:, list(VELOCITY)], own[there],
        relative[there], relative_covariance[there],
        np.column_stack([mean[:, list(PLATFORM)], down - mean[:, VERTICAL_ERROR]])[there],
        mean[there, CLOCK] / c, c / (1 + mean[there, SPEED]),
    )


def _bent(y: Floats, P: Floats) -> Floats:
    """What a posterior that bends about the platform adds to the covariance of y, (n, 2, 2).

    About its crest, where the most probable place is, not about its mean.
    """
    length = np.linalg.norm(y, axis=1)
    radius = np.maximum(length, NEAREST)
    radial = y / radius[:, None]
    tangential = np.stack([-radial[:, 1], radial[:, 0]], axis=1)
    spread, depth = (np.einsum("ni,nij,nj->n", e, P, e) for e in (tangential, radial))
    spread = np.where(length > NEAREST, np.minimum(spread / radius**2, WIDEST), 0.0)
    kept, along, across = crescent(np, radius, spread, depth)
    shares = ((along + (1 - kept) ** 2, radial), (across, tangential))
    return sum(
        ((share * radius**2)[:, None, None] * e[:, :, None] * e[:, None, :] for share, e in shares),
        np.zeros_like(P),
    )


def first_ns(p: Any, samples: Samples) -> int:
    """Epoch of the first estimate [ns]: with a prior the first one, as for `coupled`."""
    enough = samples.enough_ns()
    if p.initialisation == model.PRIOR or enough is None:
        return int(samples.epochs_ns[0])
    return enough


def beside(
    result: Result, label: str, estimates: Estimates, origin: Mapping[str, Any]
) -> Result:
    """The result with another receiver: estimates that were made after the run.

    In the record an estimate is there from the first update of the receivers after its epoch on, as
    if it had been made then; of several at one update the last.

    Parameters
    ----------
    label
        Its name in tables and figures; estimates of that name are replaced.
    origin
        What the manifest says of it.
    """
    record = result.record
    values: dict[str, NDArray[np.generic]] = {
        name: value for name, value in record.values.items()
        if name.partition(".")[0] != label
    }
    start_ns, interval_ns = record.time_ns[0], result.update_interval_ns or 1
    update_ns = start_ns + ((estimates.epochs_ns - start_ns) // interval_ns + 1) * interval_ns
    newest = np.searchsorted(update_ns, record.time_ns, side="right") - 1
    fixed, row = newest >= 0, np.maximum(newest, 0)
    there = np.diff(np.where(fixed, update_ns[row], start_ns), prepend=start_ns) > 0
    values[f"{label}.valid"] = fixed
    values[f"{label}.update_count"] = np.cumsum(there).astype(np.int32)
    for name, column in _columns(estimates).items():
        some = column[row]
        values[f"{label}.{name}"] = np.where(
            fixed.reshape(-1, *(1 for _ in some.shape[1:])), some, some.dtype.type(0)
        )
    before = [name for name in result.description.receivers if name not in (label, RAW)]
    last = [name for name in result.description.receivers if name == RAW]
    description = replace(
        result.description,
        receivers=[*before, label, *last],
        origins={**result.origins, label: dict(origin)},
    )
    intervals = {k: v for k, v in record.intervals_ns.items() if k != label}
    return Result(
        description,
        Record(record.time_ns, values, intervals, record.failures),
        result.update_interval_ns,
        result.failures,
    )


def _columns(estimates: Estimates) -> dict[str, Floats]:
    names = (
        "position", "velocity", "covariance", "relative_position", "relative_covariance",
        "platform_position", "clock_offset", "sound_speed",
    )
    return {
        "epoch": estimates.epochs_ns / 1e9,
        **{name: getattr(estimates, name) for name in names},
        "position_std": np.sqrt(np.diagonal(estimates.covariance, axis1=1, axis2=2)[:, ::2]),
    }


def origin_of(p: Any, kind: str, **facts: Any) -> dict[str, Any]:
    """What the manifest says of an estimator: its kind, its parameters, and further facts."""
    values = {v.name: getattr(p, v.name) for v in COUPLED.of("parameter")}
    return {"type": kind, **facts, "parameters": values}
