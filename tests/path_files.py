"""What other libraries read from the files of paths: times, and north, east and down."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import geojson
import gpxpy
import numpy as np
import pymap3d
from evo.tools import file_interface
from fastkml import KML, Placemark
from fastkml.gx import MultiTrack, Track
from fastkml.utils import find_all
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader
from sblcosim.tracks.place import Origin

geojson.geometry.DEFAULT_PRECISION = 16  # it rounds what it reads
Floats = NDArray[np.float64]
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
Points = tuple[Floats, Floats]
"""Times since 1970 or since the start [s], and rows of north, east, down [m]."""


def ned_of(origin: Origin, rows: Any) -> Floats:
    """NED of rows of latitude, longitude, height above the ellipsoid."""
    latitude, longitude, height = np.array(rows, float).reshape(-1, 3).T
    about = origin.latitude_deg, origin.longitude_deg, origin.height_m
    return np.column_stack(pymap3d.geodetic2ned(latitude, longitude, height, *about))


def of_geojson(folder: Path, origin: Origin) -> dict[str, Points]:
    """By the library geojson; points on the antimeridian, where lines are cut, are left out."""
    content = geojson.loads((folder / "path.geojson").read_text("utf-8"))
    assert content.is_valid, content.errors()
    found = {}
    for feature in content["features"]:
        geometry, times = feature["geometry"], np.array(feature["properties"]["time_s"], float)
        kind = geometry and geometry["type"]
        points = geometry["coordinates"] if geometry else []
        if kind == "Point":
            points = [points]
        if kind == "MultiLineString":
            assert all(len(line) > 1 for line in points)
            points = [point for line in points for point in line]
        rows = np.array(points, float).reshape(-1, 3)
        assert len(rows) == len(times)
        kept = np.abs(rows[:, 0]) != 180.0
        found[feature["properties"]["name"]] = (
            times[kept], ned_of(origin, rows[kept][:, [1, 0, 2]])
        )
    return found


def of_gpx(folder: Path, origin: Origin) -> dict[str, Points]:
    """By gpxpy."""
    document = gpxpy.parse((folder / "path.gpx").read_text("utf-8"))
    found = {}
    for track in document.tracks:
        points = [point for segment in track.segments for point in segment.points]
        rows = [(p.latitude, p.longitude, p.elevation + origin.height_m) for p in points]
        times = [(p.time - EPOCH).total_seconds() for p in points]
        found[track.name] = np.array(times), ned_of(origin, rows)
    return found


def kml_tracks(folder: Path) -> dict[str, list[Track]]:
    """By fastkml: the tracks of each placemark."""
    document = KML.parse(folder / "path.kml", validate=True)
    found = {}
    for mark in find_all(document, of_type=Placemark):
        it = mark.kml_geometry
        found[mark.name] = [*it.tracks] if isinstance(it, MultiTrack) else [it] if it else []
    return found


def of_kml(folder: Path, origin: Origin) -> dict[str, Points]:
    """By fastkml."""
    found = {}
    for name, tracks in kml_tracks(folder).items():
        items = [item for track in tracks for item in track.track_items]
        times = [(item.when.dt - EPOCH).total_seconds() for item in items]
        rows = [(i.coord.y, i.coord.x, i.coord.z + origin.height_m) for i in items]
        found[name] = np.array(times), ned_of(origin, rows)
    return found


def of_tum(folder: Path, _: Origin | None = None) -> dict[str, Points]:
    """By evo; the names are those in the file names."""
    found = {}
    for file in sorted(folder.glob("path-*.tum")):
        path = file_interface.read_tum_trajectory_file(file)
        assert path.check()[0], path.check()[1]
        assert (path.orientations_quat_wxyz == [1, 0, 0, 0]).all()
        east, north, up = path.positions_xyz.T
        name = file.stem.removeprefix("path-")
        found[name] = path.timestamps, np.column_stack([north, east, -up])
    return found


def messages(folder: Path) -> dict[str, list[tuple[int, Any]]]:
    """By rosbags, with the definitions in the file: time and message, by topic."""
    found: dict[str, list[tuple[int, Any]]] = {}
    with AnyReader([folder / "path.mcap"]) as reader:
        found |= {connection.topic: [] for connection in reader.connections}
        for connection, time, raw in reader.messages():
            found[connection.topic].append((time, reader.deserialize(raw, connection.msgtype)))
    return found


def stamp_of(message: Any) -> int:
    """The time in the header of a message [ns]."""
    return int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)


def of_odometry(folder: Path, _: Origin | None = None) -> dict[str, Points]:
    """By rosbags: positions of the topics NAME/odometry."""
    found = {}
    for topic, own in messages(folder).items():
        if topic.endswith("/odometry"):
            rows = [(p.y, p.x, -p.z) for p in (m.pose.pose.position for _, m in own)]
            times = [stamp_of(message) / 1e9 for _, message in own]
            found[topic.split("/")[1]] = np.array(times), np.array(rows).reshape(-1, 3)
    return found


def of_fixes(folder: Path, origin: Origin) -> dict[str, Points]:
    """By rosbags: positions of the topics NAME/fix."""
    found = {}
    for topic, own in messages(folder).items():
        if topic.endswith("/fix"):
            rows = [(m.latitude, m.longitude, m.altitude) for _, m in own]
            times = [stamp_of(message) / 1e9 for _, message in own]
            found[topic.split("/")[1]] = np.array(times), ned_of(origin, rows)
    return found


MAPS: dict[str, Callable[[Path, Origin], dict[str, Points]]] = {
    "geojson": of_geojson, "gpx": of_gpx, "kml": of_kml,
}
TRAJECTORIES: dict[str, Callable[[Path, Origin], dict[str, Points]]] = {
    "tum": of_tum, "odometry": of_odometry, "fix": of_fixes,
}
READERS = MAPS | TRAJECTORIES
