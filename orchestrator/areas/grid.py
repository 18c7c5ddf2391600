"""The cells of an area."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from ..errors import ConfigurationError, instance, shortened

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

Area = str | Sequence[float]
"""``"60x60"``: north and east about the beacons [m]; ``"-10,50,0,60"``: from and to north, from and
to east [m]; or these numbers."""
Cells = int | str | tuple[int, int]
"""Number of cells along the longer side; cells are as square as whole numbers allow. Or north and
east: ``"40x60"`` or (40, 60)."""
MOST_CELLS = 40_000
FARTHEST = 10_000.0
"""Largest distance from the platform [m]."""
DEEPEST = 11_000.0
"""[m]"""


@dataclass(frozen=True)
class Grid:
    """Equal rectangles, in rows from south to north, each from west to east.

    Attributes
    ----------
    north, east
        Bounds [m].
    rows, columns
        Number of cells.
    depth
        Depth of the diver [m].
    """

    north: tuple[float, float]
    east: tuple[float, float]
    rows: int
    columns: int
    depth: float

    @property
    def count(self) -> int:
        """Number of cells."""
        return self.rows * self.columns

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.rows, self.columns

    @property
    def size(self) -> tuple[float, float]:
        """Size of a cell, north and east [m]."""
        (south, north), (west, east) = self.north, self.east
        return (north - south) / self.rows, (east - west) / self.columns

    @property
    def centres(self) -> Floats:
        """Middles of the cells, NED [m]; (cells, 3)."""
        north, east = np.meshgrid(*self.axes, indexing="ij")
        return np.stack([north.ravel(), east.ravel(), np.full(self.count, self.depth)], axis=1)

    @property
    def identity(self) -> tuple[object, ...]:
        """Data that identify the cells."""
        return self.north, self.east, self.shape, self.depth

    def placed(self, cell: Integers, replicate: Integers, seed: int) -> dict[str, Floats]:
        """Parameters of the target in some runs: the middle of its circle is that of the cell."""
        return {"target.center": self.centres[cell, :2]}

    @property
    def axes(self) -> tuple[Floats, Floats]:
        """North of the rows' and east of the columns' centres [m]."""
        return _middles(*self.north, self.rows), _middles(*self.east, self.columns)


def _middles(low: float, high: float, count: int) -> Floats:
    middles: Floats = low + (high - low) * (np.arange(count) + 0.5) / count
    return middles


def grid_of(area: Area, depth: float, cells: Cells, middle: Sequence[float]) -> Grid:
    """The cells of an area.

    Parameters
    ----------
    middle
        North and east of the middle of an area that is given without bounds [m].

    Raises
    ------
    ConfigurationError
        The area has no size, a number is out of range, or there are too few or too many cells.
    """
    if not is_number(depth) or not 0 <= depth <= DEEPEST:
        raise ConfigurationError(
            f"map depth: must be a depth below the surface from 0 to {DEEPEST:g} m, got "
            f"{shortened(instance(depth))}"
        )
    north, east = _bounds(area, middle)
    rows, columns = _counts(cells, north[1] - north[0], east[1] - east[0])
    if not (rows >= 2 and columns >= 2 and rows * columns <= MOST_CELLS):
        raise ConfigurationError(
            f"map cells: must be at least 2 each way and {MOST_CELLS:,} in all, got {rows} north x "
            f"{columns} east"
        )
    return Grid(north, east, rows, columns, float(depth))


def _bounds(area: Area, middle: Sequence[float]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Bounds: from and to north, from and to east [m]."""
    parts: Sequence[object] = area if isinstance(area, list | tuple) else ()
    if isinstance(area, str):
        parts = [number(part) for part in re.split("x|×" if "," not in area else ",", area)]
    numbers = [float(part) for part in parts if is_number(part)]  # type: ignore[arg-type]
    if len(numbers) != len(parts) or len(numbers) not in (2, 4):
        raise ConfigurationError(
            "map area: must be NORTHxEAST in m, e.g. 60x60, or its bounds NORTH,NORTH,EAST,EAST, "
            f"e.g. -10,50,0,60, got {shortened(instance(area))}"
        )
    if len(numbers) == 2:
        (n, e), (height, width) = middle, numbers
        numbers = [n - height / 2, n + height / 2, e - width / 2, e + width / 2]
    size = numbers[1] - numbers[0], numbers[3] - numbers[2]
    if not min(size) > 0:
        raise ConfigurationError(
            f"map area: must have a size of more than 0 m both ways, got {size[0]:g} m north x "
            f"{size[1]:g} m east"
        )
    far = max(abs(number - middle[i // 2]) for i, number in enumerate(numbers))
    if far > FARTHEST:
        raise ConfigurationError(
            f"map area: must be within {FARTHEST / 1e3:g} km of the platform, got {far / 1e3:g} km"
        )
    return (numbers[0], numbers[1]), (numbers[2], numbers[3])


def _counts(cells: Cells, height: float, width: float) -> tuple[int, int]:
    """Rows and columns."""
    given = tuple(map(number, re.split("x|×", cells))) if isinstance(cells, str) else cells
    counts = given if isinstance(given, tuple | list) else (given,)
    if len(counts) not in (1, 2) or not all(is_number(c) and c == int(c) for c in counts):
        raise ConfigurationError(
            "map cells: must be a whole number along the longer side, or NORTHxEAST, e.g. 40x60, "
            f"got {shortened(instance(cells))}"
        )
    if len(counts) == 2:
        return int(counts[0]), int(counts[1])
    if counts[0] < 2:
        raise ConfigurationError(
            f"map cells: must be at least 2 along the longer side, got {int(counts[0])}"
        )
    side = max(height, width) / int(counts[0])
    return max(round(height / side), 2), max(round(width / side), 2)


def number(text: str) -> float:
    """The number in a text; NaN if it has none."""
    try:
        return float(text)
    except ValueError:
        return float("nan")


def is_number(value: object) -> bool:
    """Whether something is a finite number."""
    known = isinstance(value, int | float | np.integer | np.floating)
    return known and not isinstance(value, bool) and isfinite(value)  # type: ignore[arg-type]
