"""Lines of equal error and the water within a requirement, on a plane and on Earth."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..tracks.place import Origin
from .grid import Grid

Floats = NDArray[np.float64]

Ring = Floats
"""North and east of points [m]; (n, 2)."""
_MANTISSAS = (1.0, 2.0, 5.0)
_LEAST_LEVELS = 3


def lines(grid: Grid, values: Floats, level: float) -> list[Floats]:
    """Lines at a level through the cells' middles, north and east [m]; each (n, 2)."""
    return [line[:, ::-1] for line in _generator(grid, values).lines(level)]


def within(grid: Grid, values: Floats, limit: float) -> list[list[Ring]]:
    """Polygons where values are at most the limit, north and east [m].

    Each is an outer ring, anticlockwise as seen on a map (north up, east to the right), and its
    holes, clockwise; all are closed. The area ends at the middles of the outermost cells.
    """
    points, offsets = _generator(grid, values).filled(-1.0, limit)
    return [
        [part[a:b, ::-1] for a, b in pairwise(at)]
        for part, at in zip(points, offsets, strict=True)
    ]


def levels(values: Floats, most: int = 8) -> list[float]:
    """Round levels between the smallest and the largest of some values.

    They are 1, 2, 5, 10, …, or equal steps if fewer than three of these lie between.
    """
    known = values[np.isfinite(values) & (values > 0)]
    if not len(known):
        return []
    low, high = known.min(), known.max()
    decades = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    every = [m * 10.0**d for d in decades for m in _MANTISSAS if low < m * 10.0**d < high]
    if len(every) >= _LEAST_LEVELS:
        return every[:: -(-len(every) // most)]
    from matplotlib.ticker import MaxNLocator  # only where contours are drawn

    steps = np.asarray(MaxNLocator(most).tick_values(low, high)).tolist()
    return [round(level, 12) for level in steps if low < level < high]


def geojson(
    grid: Grid, maps: dict[str, Floats], limit: float | None, origin: Origin
) -> dict[str, Any]:
    """The contours of some maps as a GeoJSON document (RFC 7946), on WGS 84.

    Parameters
    ----------
    maps
        95 % errors by name [m]; each (cells,). Values that are not finite are left out.
    limit
        The requirement [m]. With one, the document also has the water where each map keeps it, if
        any: many readers fail on a feature without a geometry.
    """
    features = []
    for name, values in maps.items():
        for level in sorted({*levels(values), *([] if limit is None else [limit])}):
            coordinates = [_earth(grid, origin, line) for line in lines(grid, values, level)]
            if coordinates:
                features.append(_feature(
                    {"name": name, "kind": "contour", "p95_m": level}, "MultiLineString",
                    coordinates,
                ))
        parts = [] if limit is None else [
            [_earth(grid, origin, ring) for ring in polygon]
            for polygon in within(grid, values, limit)
        ]  # fmt: skip
        if parts:
            features.append(_feature(
                {"name": name, "kind": "within", "limit_m": limit}, "MultiPolygon", parts
            ))
    return {"type": "FeatureCollection", "features": features}


def _feature(properties: dict[str, Any], kind: str, coordinates: list[Any]) -> dict[str, Any]:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def _earth(grid: Grid, origin: Origin, points: Floats) -> list[list[float]]:
    """Longitude [°], latitude [°], height [m] of points; a closed ring stays closed."""
    ned = np.column_stack([points, np.full(len(points), grid.depth)])
    latitude, longitude, depth = origin.geographic(ned).T
    rows: list[list[float]] = np.stack(
        [longitude, latitude, origin.height_m - depth], axis=1
    ).tolist()
    return rows


def _generator(grid: Grid, values: Floats) -> Any:
    from contourpy import contour_generator  # comes with Matplotlib

    north, east = grid.axes
    z = np.ma.masked_invalid(values.reshape(grid.shape))
    return contour_generator(east, north, z, fill_type="OuterOffset", line_type="Separate")

