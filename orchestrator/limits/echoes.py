"""What is received where direct paths are lost and echoes arrive, and how much a range then tells.

A range is that of the direct path, or it is late by the excess of an echo. Both the share of such
ranges and their excess count as known, as those of outliers do. The information about the location
is that of `sblcosim.limits.fisher`, with f = π₀ N(0, σ²) + π₁ N(e₁, σ²) + π₂ N(e₂, σ²). A two-way
range is late by half the sum of two such excesses, one of each leg. The shadow of the diver's body
takes direct paths like any other loss, but depending on the diver's course.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.models.acoustics import shadow
from sblcosim.models.acoustics.ranging import legs
from sblcosim.models.settings import echoes as known
from sblcosim.models.settings.assumptions import range_noise

Floats = NDArray[np.float64]

_APART = 12.0
"""Standard deviations by which two arrivals are told apart for sure."""
_STEP = 0.05
"""Step of the grid over which the information is summed, in standard deviations."""
_MOST_EPOCHS = 100
"""Number of epochs at which the information is computed; between them it is interpolated."""
_COURSES = 32
"""Number of courses over which the shadow of a diver is averaged."""


def echo_chances(acoustics: Any) -> tuple[float, float]:
    """Probabilities that the echo from surface and bottom arrives where the direct path is lost."""
    if not acoustics.loss_probability and not acoustics.shadow_loss_probability:
        return 0.0, 0.0
    found: tuple[float, float] = known.chances(acoustics)
    return found


def shades(acoustics: Any, position: Floats, beacons: Floats, velocity: Floats) -> Floats:
    """Probability that the diver's body takes a packet; (…).

    Parameters
    ----------
    position, beacons, velocity
        Divers and beacons, NED [m], and the divers' velocities [m/s]; (…, 3), broadcast against
        each other.
    """
    offset, rate = np.moveaxis(beacons - position, -1, 0), np.moveaxis(velocity, -1, 0)
    found: Floats = shadow.of_course(
        np, [*offset], [*rate[:2]], np.deg2rad(acoustics.shadow_direction_deg),
        acoustics.shadow_loss_probability, np.deg2rad(acoustics.shadow_half_width_deg),
    )
    return found


def lost(acoustics: Any) -> float:
    """Share of the pings that give no range, over all courses of a diver in the beacons' depth.

    Sound arrives neither directly nor by an echo. A two-way range needs both of its legs.
    """
    angle = (np.arange(_COURSES) + 0.5) / _COURSES * pi
    shade = shadow.chance(np, angle, acoustics.shadow_loss_probability,
                          np.deg2rad(acoustics.shadow_half_width_deg))
    return float(lost_in(acoustics, shade).mean())


def lost_in(acoustics: Any, shade: Floats) -> Floats:
    """`lost` with the probabilities that the diver's body takes a packet; (…)."""
    share: Floats = lost_of_leg(acoustics, shade)
    return share if legs(acoustics.ranging) == 1 else 1 - (1 - share) ** 2


def lost_of_leg(acoustics: Any, shade: Any = 0.0) -> Any:
    """Share of the packets that do not arrive, neither directly nor by an echo."""
    surface, bottom = echo_chances(acoustics)
    return _lost_directly(acoustics, shade) * ((1 - surface) * (1 - bottom))


def _lost_directly(acoustics: Any, shade: Any) -> Any:
    p = acoustics.loss_probability
    return p + (1 - p) * shade


def excesses(acoustics: Any, position: Floats, beacons: Floats) -> Floats:
    """Excess paths of the echoes from surface and bottom, at least 0 [m]; (…, 2).

    Parameters
    ----------
    position, beacons
        Divers and beacons, NED [m]; (…, 3), broadcast against each other.
    """
    o = position - beacons
    square = o[..., 0] ** 2 + o[..., 1] ** 2
    both = known.excesses(
        np.sqrt, square, position[..., 2], beacons[..., 2], acoustics.water_depth_m
    )
    found: Floats = np.fmax(np.stack(both, -1), 0.0)
    return found


def shares(
    acoustics: Any, position: Floats, beacons: Floats, shade: Floats | float = 0.0
) -> Floats:
    """Information in received ranges, as a share of that without echoes; (…).

    Parameters
    ----------
    position, beacons
        As for `excesses`.
    shade
        Of `shades`; (…).
    """
    chances = np.array(echo_chances(acoustics))
    excess = excesses(acoustics, position, beacons)
    noise = range_noise(acoustics)
    if not chances.any() or noise <= 0:
        return np.ones(excess.shape[:-1])
    p = np.broadcast_to(_lost_directly(acoustics, shade), excess.shape[:-1]).ravel()
    flat = excess.reshape(-1, 2) / noise
    order = np.argsort(flat, axis=1)
    early, late = np.take_along_axis(flat, order, 1).T
    q1, q2 = chances[order].T
    weights = np.stack([1 - p, p * q1, p * (1 - q1) * q2])
    shifts = np.stack([np.zeros(len(flat)), early, late])
    if legs(acoustics.ranging) > 1:
        weights, shifts = _of_both_legs(weights, shifts)
    # Arrivals farther apart are as good as this far apart.
    at = np.cumsum(np.fmin(np.diff(shifts, axis=0, prepend=0.0), _APART), axis=0)
    grid = np.arange(-8.0, (len(at) - 1) * _APART + 8.0, _STEP)
    f, slope = np.zeros((2, len(flat), len(grid)))
    for weight, shift in zip(weights / weights.sum(0), at, strict=True):
        z = grid - shift[:, None]
        part = weight[:, None] * np.exp(-0.5 * z**2) / sqrt(2 * pi)
        f += part
        slope -= z * part
    information = (slope**2 / np.fmax(f, 1e-300)).sum(1) * (grid[1] - grid[0])
    found: Floats = np.fmin(information, 1.0).reshape(excess.shape[:-1])
    return found


def _of_both_legs(weights: Floats, shifts: Floats) -> tuple[Floats, Floats]:
    """Weights and shifts of the mean of two arrivals, by shift; (3, n) become (6, n)."""
    pairs = [(i, j) for i in range(3) for j in range(i, 3)]
    weight = np.stack([weights[i] * weights[j] * (1 + (i != j)) for i, j in pairs])
    shift = np.stack([(shifts[i] + shifts[j]) / 2 for i, j in pairs])
    order = np.argsort(shift, axis=0, kind="stable")
    return np.take_along_axis(weight, order, 0), np.take_along_axis(shift, order, 0)


def shares_along(
    acoustics: Any, position: Floats, beacons: Floats, velocity: Floats
) -> Floats:
    """`shares` at epochs, interpolated; (n, N).

    Parameters
    ----------
    position, beacons, velocity
        True positions, NED [m], and the diver's velocity [m/s]; (n, 3), (n, N, 3) and (n, 3).
    """
    n = len(position)
    some = np.unique(np.linspace(0, n - 1, min(n, _MOST_EPOCHS)).round().astype(int))
    there = position[some, None], beacons[some]
    of_some = shares(acoustics, *there, shades(acoustics, *there, velocity[some, None]))
    return np.stack([np.interp(np.arange(n), some, column) for column in of_some.T], axis=1)
