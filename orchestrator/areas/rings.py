"""Distances from the platform, at depths, with divers in all directions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ConfigurationError, instance, shortened
from .grid import DEEPEST, FARTHEST, is_number, number

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

Distance = str | float | Sequence[float]
"""``60``: from the platform to this distance [m]; ``"5,60"`` or (5, 60): from and to."""
Depths = float | Sequence[float]
"""One depth or several [m]."""
MOST_DISTANCES, MOST_DEPTHS = 1_000, 20
BEARINGS = 16
"""Directions for the possible error, evenly around the platform."""
_TURN = (np.sqrt(5.0) - 1) / 2
"""Fraction of a full turn between the directions of consecutive runs (the golden ratio): any number
of runs is spread evenly."""


@dataclass(frozen=True)
class Rings:
    """Distances at depths, in rows of one depth.

    Attributes
    ----------
    middle
        Origin of the distances: north and east [m].
    distances, depths
        Distances and depths [m].
    """

    middle: tuple[float, float]
    distances: tuple[float, ...]
    depths: tuple[float, ...]

    @property
    def count(self) -> int:
        """Number of distances at all depths."""
        return len(self.distances) * len(self.depths)

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of depths and distances."""
        return len(self.depths), len(self.distances)

    @property
    def identity(self) -> tuple[object, ...]:
        """Data that identify the distances and depths."""
        return self.middle, self.distances, self.depths

    @property
    def of_cells(self) -> tuple[Floats, Floats]:
        """Depth and distance of each [m]; (count,)."""
        depth, distance = np.meshgrid(self.depths, self.distances, indexing="ij")
        return depth.ravel(), distance.ravel()

    @property
    def centres(self) -> Floats:
        """Places in `BEARINGS` directions, NED [m]; (BEARINGS count, 3)."""
        angles = 2 * np.pi * np.arange(BEARINGS) / BEARINGS
        return np.concatenate([self._places(np.full(self.count, it)) for it in angles.tolist()])

    def placed(self, cell: Integers, replicate: Integers, seed: int) -> dict[str, Floats]:
        """Parameters of the target in some runs: the middle of the circle, and its depth."""
        draw = np.random.Generator(np.random.Philox(key=[seed, 2**63]))
        first = draw.uniform(0, 1, self.count)[cell]
        places = self._places(2 * np.pi * ((first + replicate * _TURN) % 1.0), cell)
        return {
            "target.center": places[:, :2], "target.depth_start": places[:, 2],
            "target.depth_end": places[:, 2],
        }  # fmt: skip

    def _places(self, angle: Floats, cell: Integers | slice = slice(None)) -> Floats:
        depth, distance = (it[cell] for it in self.of_cells)
        north, east = self.middle
        return np.stack(
            [north + distance * np.cos(angle), east + distance * np.sin(angle), depth], axis=1
        )


def rings_of(
    distance: Distance, depth: Depths, cells: int, middle: Sequence[float]
) -> Rings:
    """The requested distances.

    Raises
    ------
    ConfigurationError
        A number is out of range, or there are too few or too many.
    """
    count = number(cells) if isinstance(cells, str) else cells
    if not is_number(count) or count != int(count) or not 2 <= count <= MOST_DISTANCES:
        raise ConfigurationError(
            f"map cells: must be a whole number of distances from 2 to {MOST_DISTANCES:,}, got "
            f"{shortened(instance(cells))}"
        )
    low, high = _bounds(distance)
    north, east = middle
    steps = np.linspace(low, high, int(count)).tolist()
    return Rings((float(north), float(east)), tuple(steps), _depths(depth))


def _bounds(distance: Distance) -> tuple[float, float]:
    """Smallest and largest distance [m]."""
    given = [number(it) for it in distance.split(",")] if isinstance(distance, str) else distance
    parts: Sequence[object] = given if isinstance(given, list | tuple) else [given]
    numbers = [float(it) for it in parts if is_number(it)]  # type: ignore[arg-type]
    if len(numbers) != len(parts) or len(numbers) not in (1, 2):
        raise ConfigurationError(
            "map distance: must be how far from the platform in m, e.g. 60, or from and to, e.g. "
            f"5,60, got {shortened(instance(distance))}"
        )
    low, high = numbers if len(numbers) == 2 else (0.0, numbers[0])
    if not 0 <= low < high <= FARTHEST:
        raise ConfigurationError(
            f"map distance: must be from 0 m or more to a larger distance of at most "
            f"{FARTHEST / 1e3:g} km, got {low:g} m to {high:g} m"
        )
    return low, high


def _depths(depth: Depths) -> tuple[float, ...]:
    """The depths in increasing order [m]."""
    parts: Sequence[Any] = depth if isinstance(depth, list | tuple) else [depth]
    for it in parts:
        if not is_number(it) or not 0 <= it <= DEEPEST:
            raise ConfigurationError(
                f"map depth: must be a depth below the surface from 0 to {DEEPEST:g} m, got "
                f"{shortened(instance(it))}"
            )
    if not 1 <= len(parts) <= MOST_DEPTHS:
        raise ConfigurationError(
            f"map depth: must be from 1 to {MOST_DEPTHS} depths, got {len(parts)}"
        )
    return tuple(sorted({float(it) for it in parts}))
