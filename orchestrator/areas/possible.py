"""What is possible in each cell: the recursion along its circle, and the dilution of precision."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..limits import lengths, places
from ..limits.geometry import hdop
from ..limits.path import circle_psd
from ..limits.verdict import limits_of
from ..scenario.scenario import Scenario
from .grid import Grid
from .motion import Circle
from .pooling import SHARE

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class PossibleInCells:
    """Of each cell; shape (cells,).

    Attributes
    ----------
    percentile
        Length that an error with the covariances of the recursion stays below in 95 % [m].
    accuracy
        Whether that is an accuracy: the posterior is no ring at most of the epochs.
    hdop
        Horizontal dilution of precision in its middle.
    """

    percentile: Floats
    accuracy: Flags
    hdop: Floats


def possible(
    scenario: Scenario,
    grid: Grid,
    circle: Circle,
    error: str,
    span_s: tuple[float, float],
    workers: int | None = None,
) -> PossibleInCells:
    """What is possible in the cells of a grid.

    Parameters
    ----------
    scenario
        Of our own target, platform and acoustics.
    error
        Which length: ``FRAME_horizontal`` or ``FRAME_total``, absolute or relative.
    span_s
        When errors begin to count, and the end, from the start [s].
    """
    centres = grid.centres
    q = circle_psd(
        circle.speed, circle.radius, places.noise_densities(scenario, centres), span_s[1]
    )
    found = places.covariances(
        scenario, lambda time: circle.position(centres, time), q, span_s, workers
    )
    frame, _, what = error.rpartition("_")
    axes = 2 if what == "horizontal" else 3
    chosen = found.absolute if frame == "absolute" else found.relative
    rings = [
        limits_of(np.zeros(grid.count, np.int64), found.absolute[k], found.relative[k],
                  found.offset[k], 0.0, False).ring
        for k in range(len(found.offset))
    ]  # fmt: skip
    accuracy = (np.mean(rings, axis=0) <= 0.5) | found.own_errors
    return PossibleInCells(
        lengths.percentile(chosen[..., :axes, :axes], SHARE),
        accuracy,
        hdop(centres, places.still_beacons(scenario)).horizontal,
    )
