"""Estimates: positions of the diver from a receiver, or from an estimator after a run."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..shown import Shown

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Estimates(Shown):
    """Estimates of one receiver or estimator, each once; quantities that it does not give are None.

    Attributes
    ----------
    epoch_ns
        Time to which each estimate refers [ns]; shape (m,). `sblcosim.data.record.NEVER` marks an
        invalid time.
    position
        NED [m]; shape (m, 3).
    available_ns
        First communication instant at which it could be read [ns]; shape (m,). None: the estimates
        were made after the run.
    until_ns
        Instant from which the next one could be read in its place, or it was no longer valid, or
        the last of the run [ns]; shape (m,). None as for ``available_ns``.
    update_count
        Number of valid estimates so far; shape (m,).
    velocity, position_std
        NED [m/s], [m]; shape (m, 3).
    covariance
        Covariance of (x, vx, y, vy, z, vz), the paper's order, SI units; shape (m, 6, 6).
    nis, nis_degrees
        Normalised innovation squared and the number of scalar measurements in it; shape (m,).
    relative_position, relative_covariance
        Position minus the platform's position, as the receiver itself estimates it [m]; shape (m,
        3); and its covariance [m²]; shape (m, 3, 3).
    platform_position
        NED [m]; shape (m, 3).
    clock_offset, sound_speed
        [s], [m/s]; shape (m,).
    """

    epoch_ns: Integers
    position: Floats
    available_ns: Integers | None = None
    until_ns: Integers | None = None
    update_count: Integers | None = None
    velocity: Floats | None = None
    position_std: Floats | None = None
    covariance: Floats | None = None
    nis: Floats | None = None
    nis_degrees: Integers | None = None
    relative_position: Floats | None = None
    relative_covariance: Floats | None = None
    platform_position: Floats | None = None
    clock_offset: Floats | None = None
    sound_speed: Floats | None = None

    def __len__(self) -> int:
        return len(self.epoch_ns)

    def _gist(self) -> str:
        return f"of {len(self)} epochs"

    def columns(self) -> dict[str, NDArray[Any]]:
        """The quantities that are given, by name; shape (m, …)."""
        named = {f.name: getattr(self, f.name) for f in fields(self)}
        return {name: values for name, values in named.items() if values is not None}

    def chosen(self, which: Flags | Integers) -> Self:
        """The selected estimates, by flags or in the order of their indices."""
        return type(self)(**{name: values[which] for name, values in self.columns().items()})
