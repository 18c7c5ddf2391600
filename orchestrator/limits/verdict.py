"""What the reference of a run states, and whether there is an accuracy at all.

Bearing errors bend the posterior into an arc about the platform. Its linear covariance is that of
the tangent, which is meaningful while the arc is a small part of the circle. The ranges of a round
together correct a bearing error δ in proportion to sin δ: less and less beyond 90°, and to either
side at 180°. If four standard deviations of the bearing reach 90°, a receiver gets there now and
then, and stays: the posterior becomes a ring. README.md in this folder lists the measurements.

Near the platform, every position has such a bearing. There is a ring only if the arc's sagitta over
one standard deviation, R σ_α²/2, exceeds the standard deviation along the line to the platform.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite, isnan, pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.models.settings.assumptions import has_clock

from ..shown import Shown
from ..words.numbers import meters
from .unknown import matter, sentence

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Integers = NDArray[np.int64]

MOST_DISTANCE_SHARE = 1 / 8
"""Largest standard deviation along the line to the platform, as a share of the distance, with which
the distance is known at all: beyond it, linear errors are far from true ones. It is asked for only
where no range tells the distance."""
MOST_BEARING_STD = pi / 8
"""Largest standard deviation of a bearing that a receiver can hold [rad]: a quarter of 90°."""


@dataclass(frozen=True, eq=False, repr=False)
class Limits(Shown):
    """The smallest possible covariance along a run, epoch by epoch.

    Attributes
    ----------
    epoch_ns
        Epochs [ns], increasing; shape (n,).
    absolute, relative
        Covariance of the diver's position, absolute and relative to the platform, NED [m²]; shape
        (n, 3, 3).
    bearing_std
        Standard deviation of the diver's bearing from the platform [rad]; shape (n,).
    ring
        Whether the posterior is no longer a point: bent too far, or, without a common clock, too
        long; shape (n,).
    acceleration_psd
        q of the diver [m²/s³].
    is_bound
        Whether the motion is drawn from the model: no receiver can be better (with the stated
        priors). Otherwise q is a choice, and this is a reference.
    without
        Keys of the scenario whose errors are left out: with them less is possible.
    left_out
        Estimated mean squares of these errors [m²], by what they are in words; each (n,). See
        `sblcosim.limits.unknown`.
    timed
        Whether ranges tell the distance.
    """

    epoch_ns: Integers
    absolute: Floats
    relative: Floats
    bearing_std: Floats
    ring: Flags
    acceleration_psd: float
    is_bound: bool
    without: tuple[str, ...] = ()
    left_out: Mapping[str, Floats] = field(default_factory=dict)
    timed: bool = True

    @property
    def kind(self) -> str:
        """``bound`` or ``reference``."""
        return "bound" if self.is_bound else "reference"

    def _gist(self) -> str:
        return f"of {len(self.epoch_ns)} epochs: {self.verdict() or self.kind}"

    def at(self, epoch_ns: Integers) -> Integers:
        """Indices of the last epochs at or before the given ones."""
        found = np.searchsorted(self.epoch_ns, epoch_ns, side="right") - 1
        return np.fmax(found, 0)

    def verdict(self, epoch_ns: Integers | None = None) -> Possible | None:
        """What is possible at the epochs [ns] of a receiver's estimates; None: at all epochs.

        Returns
        -------
        Possible
            None without epochs, or without finite numbers.
        """
        which = np.arange(len(self.epoch_ns)) if epoch_ns is None else self.at(epoch_ns)
        if len(which) == 0 or len(self.epoch_ns) == 0:
            return None
        absolute, relative = rms(self.absolute[which]), rms(self.relative[which])
        if not (isfinite(absolute) and isfinite(relative)):
            return None
        return Possible(
            kind=self.kind,
            absolute_rms=absolute,
            relative_rms=relative,
            bearing_std=float(np.median(self.bearing_std[which])),
            accuracy=bool(self.ring[which].mean() <= 0.5),
            acceleration_psd=self.acceleration_psd,
            without=self.without,
            left_out={words: float(it[which].mean()) for words, it in self.left_out.items()},
            timed=self.timed,
        )


@dataclass(frozen=True)
class Possible:
    """What is possible at the epochs of a receiver.

    Attributes
    ----------
    kind
        ``bound`` or ``reference``.
    absolute_rms, relative_rms
        Root of the mean trace of the covariances [m].
    bearing_std
        Median of the bearing's standard deviation over the epochs [rad].
    accuracy
        Whether the numbers are an accuracy: the posterior is not a ring at most of the epochs.
    acceleration_psd
        q of the diver [m²/s³].
    without
        Keys of the scenario whose errors are left out.
    left_out
        Estimated mean square of each [m²], by what it is in words; NaN: not known.
    timed
        Whether ranges tell the distance.
    """

    kind: str
    absolute_rms: float
    relative_rms: float
    bearing_std: float
    accuracy: bool
    acceleration_psd: float
    without: tuple[str, ...] = ()
    left_out: Mapping[str, float] = field(default_factory=dict)
    timed: bool = True

    @property
    def matters(self) -> dict[str, float]:
        """The errors that are left out, RMS [m] by what they are, if they matter."""
        return matter(self.absolute_rms, self.left_out) if self.accuracy else {}

    @property
    def with_left_out(self) -> float:
        """Estimated RMS error that is possible with what is left out [m]; NaN: not known."""
        return sqrt(self.absolute_rms**2 + sum(self.left_out.values()))

    @property
    def caveat(self) -> str:
        """What is left out and matters, in a sentence; empty if there is nothing to say."""
        if not self.matters:
            return ""
        sizes = {
            words: "" if isnan(it) else f"about {meters(it)}" for words, it in self.matters.items()
        }
        together = self.with_left_out
        with_it = "" if isnan(together) else f"about {meters(together)} RMS is possible with it"
        return sentence(sizes, with_it)

    def to_json(self) -> dict[str, Any]:
        """The result as plain data; numbers that are no accuracy are None."""
        return {
            "kind": self.kind,
            "absolute_rms_m": self.absolute_rms if self.accuracy else None,
            "relative_rms_m": self.relative_rms if self.accuracy else None,
            "accuracy": self.accuracy,
            "bearing_std_deg": float(np.rad2deg(self.bearing_std)),
            "acceleration_psd_m2_s3": self.acceleration_psd,
            "without": list(self.without),
            "left_out_m": self.matters,
            "with_left_out_m": self.with_left_out if self.accuracy else None,
        }

    def __str__(self) -> str:
        if self.accuracy:
            without = f"; without: {', '.join(self.without)}" if self.without else ""
            return f"possible: {self.absolute_rms:.2f} m RMS ({self.kind}{without})"
        if self.bearing_std <= MOST_BEARING_STD:
            return (
                "no accuracy is possible: without a common clock, only the bearing is known, to "
                f"{np.rad2deg(self.bearing_std):.1g}°, and not the distance"
            )
        return (
            "no accuracy is possible: the bearing is only known to "
            f"{np.rad2deg(self.bearing_std):.0f}°, so positions all around the platform fit"
        )


def rms(covariance: Floats) -> float:
    """√ of the mean trace [m] of covariances (m, 3, 3) [m²]."""
    mean = float(np.trace(covariance, axis1=1, axis2=2).mean())
    return sqrt(mean) if mean >= 0 else float("nan")


def why_none(scenario: Any) -> str:
    """Why places have no accuracy, as the end of a sentence."""
    if has_clock(scenario.acoustics):
        return "places all around the platform fit"
    return "without a common clock, only a bearing is known, or not even that"


def limits_of(
    epoch_ns: Integers, absolute: Floats, relative: Floats, offset: Floats, q: float,
    is_bound: bool, *, timed: bool = True,
) -> Limits:
    """Judge covariances.

    Parameters
    ----------
    offset
        True x − p, NED [m]; shape (n, 3).
    timed
        Whether ranges tell the distance, and not only differences of arrivals.
    """
    reach = np.hypot(offset[:, 0], offset[:, 1])
    e = np.where((reach > 0)[:, None], offset[:, :2] / np.fmax(reach, 1e-300)[:, None], [1.0, 0.0])
    across = np.column_stack([-e[:, 1], e[:, 0]])
    radial, tangential = (
        np.fmax(np.einsum("ni,nij,nj->n", d, relative[:, :2, :2], d), 0) for d in (e, across)
    )
    bearing = np.sqrt(tangential) / np.fmax(reach, 1e-9)
    sagitta = reach * bearing**2 / 2
    ring = (bearing > MOST_BEARING_STD) & (sagitta > np.sqrt(radial))
    if not timed:
        ring |= np.sqrt(radial) > MOST_DISTANCE_SHARE * reach
    return Limits(
        epoch_ns, absolute, relative, np.fmin(bearing, pi), ring, q, is_bound, timed=timed
    )
