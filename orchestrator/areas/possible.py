"""The possible error in each cell: the recursion along its circle, and dilution of precision."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from sblcosim.models.settings.assumptions import has_clock

from ..judge.pooling import SHARE
from ..limits import lengths, places
from ..limits.geometry import hdop
from ..limits.path import circle_psd
from ..limits.unknown import matter, sentence, squares_in_places
from ..limits.verdict import limits_of
from ..scenario.scenario import Scenario
from ..words.numbers import meters
from .motion import Circle

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


class Middles(Protocol):
    """Cells and their middles."""

    @property
    def count(self) -> int:
        """Number of cells."""

    @property
    def centres(self) -> Floats:
        """Their middles, NED [m]: the first middle of every cell, then the second ones; (n, 3)."""


@dataclass(frozen=True, eq=False)
class PossibleInCells:
    """What is possible in each cell; shape (cells,).

    Attributes
    ----------
    percentile
        Length that holds 95 % of the errors with the covariances of the recursion [m].
    accuracy
        Whether this is an accuracy: at most epochs the posterior is not a ring.
    hdop
        Horizontal dilution of precision in the middle of the cell.
    rms
        Root mean square of these errors [m].
    """

    percentile: Floats
    accuracy: Flags
    hdop: Floats
    rms: Floats


def possible(
    scenario: Scenario,
    grid: Middles,
    circle: Circle,
    error: str,
    span_s: tuple[float, float],
    workers: int | None = None,
) -> PossibleInCells:
    """What is possible in some cells.

    Parameters
    ----------
    scenario
        A scenario with our own target, platform and acoustics.
    grid
        The cells of an area, or distances. If a cell has several middles, the diver is in each of
        them equally often.
    error
        Which length: ``FRAME_horizontal`` or ``FRAME_total``, absolute or relative.
    span_s
        When errors begin to count, and the end, in seconds after the start.
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
    timed = has_clock(scenario.acoustics)
    rings = [
        limits_of(np.zeros(len(centres), np.int64), found.absolute[k], found.relative[k],
                  found.offset[k], 0.0, False, timed=timed).ring
        for k in range(len(found.offset))
    ]  # fmt: skip
    chosen = chosen[..., :axes, :axes].reshape(-1, grid.count, axes, axes)
    accuracy = (np.mean(np.reshape(rings, (-1, grid.count)), axis=0) <= 0.5) | found.own_errors
    squares = np.trace(chosen, axis1=2, axis2=3).mean(axis=0)
    beacons = places.still_beacons(scenario)
    dilution = hdop(centres, beacons, unknown_clock=not timed).horizontal
    return PossibleInCells(
        lengths.percentile(chosen, SHARE),
        accuracy,
        dilution.reshape(-1, grid.count).mean(axis=0),
        np.sqrt(np.fmax(squares, 0.0)),
    )


def left_out(
    scenario: Scenario, grid: Middles, best: PossibleInCells, span_s: tuple[float, float]
) -> dict[str, Floats]:
    """The errors that `possible` leaves out and that matter in some cell, RMS [m]; each (cells,).

    Parameters
    ----------
    best
        What is possible without them.
    """
    found = {
        words: it.reshape(-1, grid.count).mean(axis=0)
        for words, it in squares_in_places(scenario, grid.centres, span_s).items()
    }
    named = {
        words
        for cell in np.flatnonzero(best.accuracy).tolist()
        for words in matter(float(best.rms[cell]), {w: it[cell] for w, it in found.items()})
    }
    return {words: np.sqrt(it) for words, it in found.items() if words in named}


def caveat(errors: Mapping[str, Floats]) -> str:
    """A sentence about what is left out; empty if there is nothing to say."""
    sizes = {}
    for words, it in errors.items():
        known = it[np.isfinite(it)]
        if not len(known):
            sizes[words] = ""
            continue
        low, high = meters(float(known.min())), meters(float(known.max()))
        sizes[words] = f"about {low} RMS" if low == high else f"about {low} to {high} RMS"
    return sentence(sizes) if sizes else ""
