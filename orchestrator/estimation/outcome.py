"""Estimates made after a run, next to those of its receivers in the same tables and figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from sblcosim.models.receiver.surroundings import (
    CLOCK,
    NEAREST,
    PLATFORM,
    POSITION,
    SPEED,
    VELOCITY,
    WIDEST,
    crescent,
)
from sblcosim.models.receiver.waves import HEAVE

from ..data.description import RunDescription
from ..data.estimates import Estimates
from ..data.samples import Samples
from ..results.result import Result
from ..scenario.labels import RAW
from . import model
from .linear import Floats

ORDER = [i for pair in zip(POSITION, VELOCITY, strict=True) for i in pair]
"""Indices of position and velocity among the states, in the paper's order."""


def of_states(
    p: Any, samples: Samples, mean: Floats, covariance: Floats
) -> Estimates:
    """Estimates from the states at the epochs of the samples, from the first fix on.

    Parameters
    ----------
    mean, covariance
        Shape (n, d), (n, d, d) with d states.
    """
    epochs = samples.epochs_ns
    D = np.zeros((3, mean.shape[1]))  # x − p
    D[range(3), POSITION] = 1
    D[range(2), PLATFORM] = -1
    D[2, HEAVE] = -1
    relative = mean @ D.T
    relative_covariance = D @ covariance @ D.T
    bent = bent_by(relative[:, :2], relative_covariance[:, :2, :2])
    relative_covariance[:, :2, :2] += bent
    own = covariance[:, ORDER][:, :, ORDER]
    own[:, ::2, ::2][:, :2, :2] += bent
    own[:, [0, 2], [0, 2]] += p.gps_bias_std**2
    c = p.assumed_sound_speed
    return Estimates(
        epoch_ns=epochs,
        position=mean[:, list(POSITION)],
        velocity=mean[:, list(VELOCITY)],
        covariance=own,
        relative_position=relative,
        relative_covariance=relative_covariance,
        platform_position=mean[:, [*PLATFORM, HEAVE]],
        clock_offset=mean[:, CLOCK] / c,
        sound_speed=c / (1 + mean[:, SPEED]),
    ).chosen(epochs >= model.first_ns(p, samples))


def bent_by(y: Floats, P: Floats) -> Floats:
    """What a posterior bent about the platform adds to the covariance of y, (n, 2, 2).

    It refers to the crest, where the most probable position is, not to the mean.
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


def described(
    before: RunDescription, label: str, origin: Mapping[str, Any], remarks: Sequence[str] = ()
) -> RunDescription:
    """The description of a run with another receiver; see `beside`."""
    filters = [name for name in before.receivers if name not in (label, RAW)]
    last = [name for name in before.receivers if name == RAW]
    return replace(
        before,
        receivers=[*filters, label, *last],
        origins={**before.origins, label: dict(origin)},
        remarks=[*(it for it in before.remarks if not it.startswith(f"{label}: ")), *remarks],
    )


def beside(
    result: Result, label: str, estimates: Estimates, origin: Mapping[str, Any],
    remarks: Sequence[str] = (),
) -> Result:
    """The result with another receiver, whose estimates were made after the run.

    Parameters
    ----------
    label
        Its name in tables and figures. Existing estimates with that name are replaced.
    origin
        Its origin for the manifest.
    remarks
        Remarks on it. They begin with its name, and replace those of estimates with that name.
    """
    description = described(result.description, label, origin, remarks)
    return Result(
        description, result.record, result.update_interval_ns, result.failures,
        made={**result.made, label: estimates},
    )


def origin_of(
    p: Any, kind: str, of: model.RunModel = model.ON_PLATFORM, **facts: Any
) -> dict[str, Any]:
    """Origin of an estimator for the manifest: its kind, its parameters, and further facts."""
    values = {v.name: getattr(p, v.name) for v in of.component.of("parameter")}
    return {"type": kind, **facts, "parameters": values}
