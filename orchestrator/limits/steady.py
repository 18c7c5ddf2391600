"""Steady-state accuracy of a filter, without a recursion.

A position with white acceleration of density q, observed every T with variance R, reaches σ² = √2
q^¼ (R T)^¾ per axis: the Kalman-Bucy filter of a double integrator with noise of density R T. The
four ranges of a round, T_eff = N T/(1 − loss), observe the axis across the line to the platform
with R = σ_r² ρ²/½Σ|b − b̄|² (for a cross: (σ_r ρ/√2 b)²), and the one along it with R = σ_r²
(ρ/R_h)²/N (four: (σ_r ρ/2 R_h)²). White noise of the heading adds R_h² σ_ψ² T/(1 − loss) to the
noise density across. This holds if the filter's memory τ = (R T_eff/q)^¼ is longer than T_eff and
shorter than the time in which the diver moves noticeably round the platform.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..shown import Shown

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Conditions:
    """Inputs of the closed form.

    Attributes
    ----------
    range_std, depth_std
        Standard deviations of a range and of a depth reading [m].
    spread
        ½ Σ|b − b̄|² of the horizontal arms [m²]; 2 b² for a cross with arms of length b.
    beacons
        Number N of beacons.
    together
        Number of beacons that ping in the same slot.
    ping_std
        Standard deviation of what all ranges of a slot share [m]; infinite without a common clock.
    slot
        T, time between packets and between depth readings [s].
    loss
        Share of packets lost.
    acceleration_psd
        q of the diver, per axis [m²/s³].
    common_std
        Standard deviation of errors of the absolute position only, per axis: coloured GPS errors
        [m].
    heading_std, heading_noise_std
        Standard deviations of the heading's lasting error and of its white noise [rad].
    """

    range_std: float
    depth_std: float
    spread: float
    beacons: int = 4
    slot: float = 1.0
    loss: float = 0.0
    acceleration_psd: float = 0.01
    common_std: float = 0.0
    heading_std: float = 0.0
    heading_noise_std: float = 0.0
    together: int = 1
    ping_std: float = 0.0

    @property
    def slots(self) -> float:
        """Number of slots in a round."""
        return self.beacons / self.together

    @property
    def round(self) -> float:
        """T_eff [s]: mean time from one packet of a beacon to the next."""
        return self.slots * self.slot / (1 - self.loss) if self.loss < 1 else np.inf


@dataclass(frozen=True, eq=False, repr=False)
class ClosedForm(Shown):
    """Standard deviations [m], shape (…).

    Attributes
    ----------
    cross, radial, depth
        By axis, relative to the platform.
    relative, absolute
        Square roots of the sums of all variances.
    fix_cross, fix_radial
        For the fix from one round of ranges: σ_r times the dilution of precision.
    """

    cross: Floats
    radial: Floats
    depth: Floats
    relative: Floats
    absolute: Floats
    fix_cross: Floats
    fix_radial: Floats


def closed_form(offset: ArrayLike, conditions: Conditions) -> ClosedForm:
    """The accuracy of a filter in its steady state, and of single fixes.

    Clock, speed of sound and white GPS errors are left out: `reference` has them all.

    Parameters
    ----------
    offset
        Position of the diver relative to the beacons' centre, NED [m]; any shape (…, 3), for
        example a grid.
    """
    o, c = np.asarray(offset, float), conditions
    distance = np.sqrt((o**2).sum(-1))
    reach = np.hypot(o[..., 0], o[..., 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        fix_cross = c.range_std * distance / np.sqrt(c.spread)
        fix_radial = c.range_std * distance / (np.sqrt(c.beacons) * reach)
        if c.ping_std:
            fix_radial = np.hypot(fix_radial, c.ping_std * distance / reach)
    fix_cross, fix_radial = (np.nan_to_num(f, nan=0.0, posinf=np.inf)
                             for f in (fix_cross, fix_radial))
    heading = (reach * c.heading_noise_std) ** 2 / c.slots
    q = c.acceleration_psd
    across = steady_variance(q, _density(fix_cross**2 + heading, c.round))
    along = steady_variance(q, _density(fix_radial**2, c.round))
    depth = steady_variance(q, np.full_like(reach, c.depth_std**2 * c.slot))
    turned = (reach * c.heading_std) ** 2
    relative = across + along + depth
    return ClosedForm(
        cross=np.sqrt(across + turned),
        radial=np.sqrt(along),
        depth=np.sqrt(depth),
        relative=np.sqrt(relative + turned),
        absolute=np.sqrt(relative + turned + 2 * c.common_std**2),
        fix_cross=fix_cross,
        fix_radial=fix_radial,
    )


def _density(R: Floats, interval: float) -> Floats:
    """R T, or 0 where R is 0, however long T."""
    return np.where(R > 0, np.where(R > 0, R, 1.0) * interval, 0.0)


def steady_variance(q: float, density: Floats) -> Floats:
    """√2 q^¼ (R T)^¾ [m²] for a density R T [m² s]; 0 where q or the density is 0."""
    known = density > 0 if q > 0 else np.zeros_like(density, bool)
    variance: Floats = np.sqrt(2) * q**0.25 * np.where(known, density, 1.0) ** 0.75
    return np.where(known, variance, 0.0)
