"""The recursion for beacons that each have an error of their own: the model of `long_baseline`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.models.receiver import field

from .recursion import FAR_STD, Rows, Truth, arrays_of, stacked

Floats = NDArray[np.float64]


def rows_of(p: Any, truth: Truth, heard: Floats, depth: Floats, beacons: Floats) -> Rows:
    """The measurements of all epochs at the true states; as in `recursion.rows_of`.

    Parameters
    ----------
    p
        Parameters of `long_baseline`.
    beacons
        True positions at the epochs, NED [m]; (n, N, 3).
    """
    n, count = heard.shape
    x: list[Any] = [np.zeros(n)] * field.states(count)
    for state, values in zip(field.POSITION, truth.position.T, strict=True):
        x[state] = values
    x[field.SPEED] = np.full(n, truth.speed)
    measured = [(field.depth(p, x), depth)]
    for i in range(count):
        which = [float(i == j) for j in range(count)]
        measured.append((field.range_(np, p, x, [*beacons[:, i].T], which), heard[:, i]))
    return stacked(measured, field.states(count))


def prior(p: Any, known_start: bool) -> Floats:
    """Covariance at the start of a run; (9 + 3N, 9 + 3N)."""
    stds = np.zeros(field.states(p.beacons))
    for i, std in field.prior_stds(p).items():
        stds[i] = std
    stds[list(field.POSITION)] = p.prior_position_std if known_start else FAR_STD
    stds[list(field.VELOCITY)] = p.prior_velocity_std
    return np.diag(stds**2)


def transition(p: Any, dt: float) -> tuple[Floats, Floats]:
    """Φ and Q over dt [s]; (9 + 3N, 9 + 3N) each."""
    phi, noise = field.transition(np, p, dt)
    return arrays_of(phi, noise, field.states(p.beacons))


def marginals(P: Floats) -> Floats:
    """Covariance of the diver's position; (n, 3, 3) [m²]."""
    places = np.array(field.POSITION)
    return P[:, places[:, None], places[None, :]]
