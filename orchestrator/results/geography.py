"""The paths of a run on Earth, for maps: GeoJSON and GPX."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from sblcosim.fmus.host.nanoseconds import SECOND

from ..tracks.place import Floats, Origin

if TYPE_CHECKING:
    from ..data.record import Record

GEOJSON, GPX = "path.geojson", "path.gpx"
MOST_POINTS = 10_000
"""Most points of a path. Longer paths are written at every second instant, every third, etc."""
START = datetime(1970, 1, 1, tzinfo=UTC)
"""Time that GPX gives for the start of the run, because its points need clock times."""
TRUTH = "truth"

Path_ = tuple[str, Floats, Floats]
"""Name of a path, its times [s], and rows of latitude [°], longitude [°], depth [m]."""


def write(
    folder: Path, title: str, origin: Origin, record: Record, estimates: Mapping[str, pd.DataFrame]
) -> None:
    """Write the true path of a run and the receivers' estimates of it.

    Heights are above the ellipsoid in GeoJSON, and the negative depth in GPX.

    Parameters
    ----------
    folder
        Folder of ``path.geojson`` and ``path.gpx``.
    origin
        Origin of north, east and down.
    """
    paths = [*_paths(origin, record, estimates)]
    content = {"type": "FeatureCollection", "features": [_feature(origin, *p) for p in paths]}
    (folder / GEOJSON).write_text(json.dumps(content, allow_nan=False) + "\n", "utf-8")
    (folder / GPX).write_text(_gpx(title, paths), "utf-8")


def _paths(
    origin: Origin, record: Record, estimates: Mapping[str, pd.DataFrame]
) -> Iterator[Path_]:
    position = np.asarray(record.values["target.position"], np.float64)
    yield _path(origin, TRUTH, record.time_ns / SECOND, position)
    for name, table in estimates.items():
        position = table[["x_m", "y_m", "z_m"]].to_numpy(float)
        yield _path(origin, name, table["epoch_s"].to_numpy(np.float64), position)


def _path(origin: Origin, name: str, times: Floats, position: Floats) -> Path_:
    known = np.flatnonzero(np.isfinite(position).all(axis=1))
    known = known[:: max(1, -(-len(known) // MOST_POINTS))]
    return name, times[known], origin.geographic(position[known])


def _feature(origin: Origin, name: str, times: Floats, path: Floats) -> dict[str, object]:
    latitude, longitude, depth = path.T
    points = np.stack([longitude, latitude, origin.height_m - depth], axis=1).tolist()
    geometry: dict[str, object] | None = {"type": "LineString", "coordinates": points}
    if len(points) < 2:
        geometry = {"type": "Point", "coordinates": points[0]} if points else None
    properties = {"name": name, "time_s": times.tolist()}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def _gpx(title: str, paths: list[Path_]) -> str:
    from gpxpy import gpx

    document = gpx.GPX()
    document.creator, document.name = "sblcosim", title
    document.description = f"The run starts at {START.isoformat()}; elevation is minus the depth"
    for name, times, path in paths:
        track, segment = gpx.GPXTrack(name), gpx.GPXTrackSegment()
        document.tracks.append(track)
        track.segments.append(segment)
        segment.points = [
            gpx.GPXTrackPoint(latitude, longitude, -depth, START + timedelta(seconds=time))
            for time, (latitude, longitude, depth) in zip(
                times.tolist(), path.tolist(), strict=True
            )
        ]
    return document.to_xml()
