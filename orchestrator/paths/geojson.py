"""Paths as GeoJSON (RFC 7946); heights are above the ellipsoid."""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from ..tracks.place import Floats, Origin
from .earth import EarthPath

FILE = "path.geojson"


def write(
    folder: Path, paths: Sequence[EarthPath], origin: Origin, start: datetime | None
) -> None:
    """Write a feature for each path, with the times of its points."""
    features = [_feature(path, origin, start) for path in paths]
    content = {"type": "FeatureCollection", "features": features}
    (folder / FILE).write_text(json.dumps(content, allow_nan=False) + "\n", "utf-8")


def _feature(path: EarthPath, origin: Origin, start: datetime | None) -> dict[str, object]:
    points = np.stack([path.longitude, path.latitude, origin.height_m - path.depth], axis=1)
    lines = _lines(path, np.column_stack([path.time_s, points]))
    coordinates = [line[:, 1:].tolist() for line in lines]
    geometry: dict[str, object] | None
    if len(points) < 2:
        geometry = {"type": "Point", "coordinates": coordinates[0][0]} if len(points) else None
    elif len(lines) == 1:
        geometry = {"type": "LineString", "coordinates": coordinates[0]}
    else:
        geometry = {"type": "MultiLineString", "coordinates": coordinates}
    properties: dict[str, object] = {"name": path.name}
    if start is not None:
        properties["start"] = start.astimezone(UTC).isoformat()
    properties["time_s"] = np.concatenate([line[:, 0] for line in lines]).tolist()
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def _lines(path: EarthPath, rows: Floats) -> list[Floats]:
    """Rows of time, longitude, latitude, height in lines that end at the antimeridian.

    A line that crosses it is cut there, as RFC 7946 asks, and gets a point at 180° on either side.
    """
    parts = path.parts()
    lines = [rows[part] for part in parts]
    for i, part in enumerate(parts[1:]):
        before, after = rows[part.start - 1], rows[part.start].copy()
        side = np.copysign(180.0, before[1])
        after[1] += 2 * side
        length = after[1] - before[1]
        at = before + (after - before) * ((side - before[1]) / length if length else 0.0)
        lines[i] = np.vstack([lines[i], [at[0], side, *at[2:]]])
        lines[i + 1] = np.vstack([[at[0], -side, *at[2:]], lines[i + 1]])
    return lines
