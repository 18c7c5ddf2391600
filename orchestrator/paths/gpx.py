"""Paths as GPX 1.1; the elevation is minus the depth."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from ..errors import escaped
from .earth import EarthPath, beginning, instant

FILE = "path.gpx"


def write(
    folder: Path, title: str, paths: Sequence[EarthPath], start: datetime | None,
    dated: bool = False,
) -> None:
    """Write a track for each path; it has a segment for each part up to the antimeridian."""
    from gpxpy import gpx

    document = gpx.GPX()
    document.creator, document.name = "sblcosim", escaped(title)
    begins = beginning(start, dated, "The run starts at" if start is None else "Time 0 is")
    document.description = f"{begins}; elevation is minus the depth"
    for path in paths:
        track = gpx.GPXTrack(escaped(path.name))
        document.tracks.append(track)
        for part in path.parts():
            segment = gpx.GPXTrackSegment()
            track.segments.append(segment)
            segment.points = [
                gpx.GPXTrackPoint(latitude, longitude, -depth, instant(start, time))
                for time, latitude, longitude, depth in zip(
                    path.time_s[part].tolist(), path.latitude[part].tolist(),
                    path.longitude[part].tolist(), path.depth[part].tolist(), strict=True,
                )
            ]
    (folder / FILE).write_text(document.to_xml(), "utf-8")
