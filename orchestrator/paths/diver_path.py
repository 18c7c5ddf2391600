"""A diver's path: positions with their times, from estimates or from the truth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, Self, get_args

import numpy as np

from ..data.estimates import Estimates, Floats, Integers
from ..data.record import NEVER
from ..data.truth import Truth
from ..errors import ConfigurationError, check_choice
from ..shown import Shown

Kind = Literal["truth", "filter", "fix"]
TRUTH = "truth"
"""Name of the true path."""
_POSITION, _VELOCITY = slice(0, 6, 2), slice(1, 6, 2)
"""States of a covariance of (x, vx, y, vy, z, vz)."""
_SHAPES = {
    "position": (3,), "velocity": (3,), "covariance": (3, 3), "velocity_covariance": (3, 3),
}


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class DiverPath(Shown):
    """Positions of a diver at some times; points that are not known are NaN.

    Attributes
    ----------
    name
        Label of the receiver, or ``"truth"``.
    time_ns
        Times of the positions [ns]; shape (n,). `sblcosim.data.record.NEVER` marks an invalid time.
    position
        NED [m]; shape (n, 3).
    velocity
        NED [m/s]; shape (n, 3). None: unknown.
    covariance
        Covariance of the position, NED [m²]; shape (n, 3, 3). NaN off the diagonal: only the
        variances are known. None: unknown.
    velocity_covariance
        Covariance of the velocity, NED [m²/s²]; shape (n, 3, 3). None: unknown.
    kind
        ``"fix"``: positions without a filter, which stay in the background of a map.

    Raises
    ------
    ConfigurationError
        Shapes do not fit, or there is no such kind.
    """

    name: str
    time_ns: Integers
    position: Floats
    velocity: Floats | None = None
    covariance: Floats | None = None
    velocity_covariance: Floats | None = None
    kind: Kind = "filter"

    def __post_init__(self) -> None:
        check_choice("kind", self.kind, get_args(Kind))
        for name, shape in _SHAPES.items():
            array, expected = getattr(self, name), (len(self.time_ns), *shape)
            if array is not None and np.shape(array) != expected:
                raise ConfigurationError(
                    f"path of {self.name}: {name} must have shape {expected}, got {np.shape(array)}"
                )

    def __len__(self) -> int:
        return len(self.time_ns)

    def _gist(self) -> str:
        return f"of {self.name}: {len(self)} points"

    def chosen(self, which: Integers) -> Self:
        """The points with these indices."""
        arrays = {name: getattr(self, name) for name in ("time_ns", *_SHAPES)}
        return replace(self, **{
            name: array[which] for name, array in arrays.items() if array is not None
        })  # fmt: skip

    def known(self) -> Self:
        """The points whose position and time are known, in their order."""
        finite = np.isfinite(self.position).all(axis=1)
        return self.chosen(np.flatnonzero(finite & (self.time_ns != NEVER)))

    def in_time(self) -> Self:
        """The known points by increasing time; of several at one time, the last."""
        known = self.known()
        order = np.argsort(known.time_ns, kind="stable")
        time = known.time_ns[order]
        return known.chosen(order[np.append(time[1:] != time[:-1], True)[: len(time)]])


def of_estimates(name: str, estimates: Estimates, kind: Kind = "filter") -> DiverPath:
    """The path that a receiver or an estimator gives, at the epochs of its estimates."""
    whole, std = estimates.covariance, estimates.position_std
    covariance = None
    if whole is not None:
        covariance = whole[:, _POSITION, _POSITION]
    elif std is not None:
        covariance = np.full((len(std), 3, 3), np.nan)
        covariance[:, range(3), range(3)] = std**2
    return DiverPath(
        name=name, time_ns=estimates.epoch_ns, position=estimates.position,
        velocity=estimates.velocity, covariance=covariance, kind=kind,
        velocity_covariance=None if whole is None else whole[:, _VELOCITY, _VELOCITY],
    )


def of_truth(truth: Truth, name: str = TRUTH) -> DiverPath:
    """The true path, at its own instants."""
    return DiverPath(
        name=name, time_ns=truth.time_ns, position=truth.position, velocity=truth.velocity,
        kind="truth",
    )
