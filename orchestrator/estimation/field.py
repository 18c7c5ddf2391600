"""The model of `long_baseline` over a whole run: fixed beacons, or buoys, with errors of their own.

The states are those of `sblcosim.models.receiver.field`, and then an offset of the ranges of each
beacon [m], which is constant. A scale of the ranges cannot be told from the speed of sound: it
widens the prior of κ.
"""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
from sblcosim.models.receiver import field
from sblcosim.models.receiver.bound import FAR_STD
from sblcosim.models.receiver.field import CLOCK, POSITION, SPEED, VELOCITY
from sblcosim.models.receiver.receivers.long_baseline import COMPONENT as LONG_BASELINE

from ..data.estimates import Estimates
from ..data.record import Record
from ..data.samples import Samples
from . import model, start
from .linear import Floats

_OWN = 6
"""States of the diver alone."""


def with_unknowns(p: Any, range_offset_std: float, range_scale_std: float) -> Any:
    """The parameters of `long_baseline`, with what else may be unknown about ranges.

    Parameters
    ----------
    range_offset_std
        Standard deviation of the offset of each beacon's ranges [m].
    range_scale_std
        That of the scale that all ranges share, as a share of the range.
    """
    speed = float(np.hypot(p.sound_speed_std, range_scale_std))
    return SimpleNamespace(
        **vars(p) | {"sound_speed_std": speed, "range_offset_std": range_offset_std}
    )


def states(p: Any) -> int:
    """Number of states."""
    return int(field.states(p.beacons) + p.beacons)


def offsets(p: Any) -> list[int]:
    """Indices of the offsets of the beacons' ranges."""
    return [*range(field.states(p.beacons), states(p))]


def _parts(p: Any, samples: Samples, trajectory: Floats) -> Iterator[model.RowsOfKind]:
    epochs, d = samples.epochs_ns, states(p)
    node = np.searchsorted(epochs, samples.depth_ns)
    yield model.part(0, node, field.depth(p, [*trajectory[node].T]), samples.depth, d)
    node = np.searchsorted(epochs, samples.range_ns)
    which = [(samples.beacon == i).astype(float) for i in range(p.beacons)]
    x, known = [*trajectory[node].T], [*samples.position.T]
    row = field.range_(np, p, x, known, which)
    late = sum(own * x[i] for own, i in zip(which, offsets(p), strict=True))
    kind, H, residual, variance = model.part(model.RANGE, node, row, samples.range - late, d)[1:]
    H[:, offsets(p)] = np.column_stack(which)
    yield node, kind, H, residual, variance


def _prior(p: Any, begin: Floats) -> tuple[Floats, Floats]:
    mean, std = np.zeros(states(p)), np.zeros(states(p))
    for i, value in field.prior_stds(p).items():
        std[i] = value
    std[offsets(p)] = p.range_offset_std
    std[list(VELOCITY)] = p.prior_velocity_std
    if p.initialisation == model.PRIOR:
        mean[list(POSITION)], std[list(POSITION)] = p.prior_position, p.prior_position_std
        mean[list(VELOCITY)] = p.prior_velocity
    else:
        mean[list(POSITION)], std[list(POSITION)] = begin[list(POSITION)], FAR_STD
    return mean, std


IN_FIELD = model.RunModel(
    LONG_BASELINE, states, POSITION, VELOCITY, _parts, _prior,
    lambda p, dt: field.transition(np, p, dt),
)
"""The diver, the clock, the true position of each beacon, and the offsets of their ranges."""


def trajectory(record: Record, label: str, p: Any, samples: Samples) -> Floats:
    """States at the epochs of the samples, from the estimates of `long_baseline`; shape (n, d)."""
    estimates, row = start.given(record, label, samples)

    def at_epochs(values: Any) -> Floats:
        return start.between(estimates, values, samples.epochs_ns)

    c, at = p.assumed_sound_speed, np.zeros((len(samples.epochs_ns), states(p)))
    at[:, list(POSITION)] = at_epochs(estimates.position)
    at[:, list(VELOCITY)] = at_epochs(estimates.velocity)
    at[:, [CLOCK]] = at_epochs(record.values[f"{label}.clock_offset"][row] * c)
    at[:, [SPEED]] = at_epochs(c / record.values[f"{label}.sound_speed"][row] - 1)
    return at


def of_states(p: Any, samples: Samples, mean: Floats, covariance: Floats) -> Estimates:
    """Estimates from the states at the epochs of the samples, from the first fix on."""
    c, epochs = p.assumed_sound_speed, samples.epochs_ns
    return Estimates(
        epoch_ns=epochs,
        position=mean[:, list(POSITION)],
        velocity=mean[:, list(VELOCITY)],
        covariance=covariance[:, :_OWN, :_OWN],
        clock_offset=mean[:, CLOCK] / c,
        sound_speed=c / (1 + mean[:, SPEED]),
    ).chosen(epochs >= model.first_ns(p, samples))
