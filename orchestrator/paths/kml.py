"""Paths as KML 2.2 with Google's tracks, which have a time for each point.

The altitude is minus the depth. The altitude mode is ``clampToGround``, which draws a path on the
surface of the sea or the lake: with ``absolute``, points below the ground of the viewer's terrain
are not visible (https://developers.google.com/kml/documentation/altitudemode), and most harbours
and lakes have no bottom there.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from ..errors import escaped
from ..style import Theme, named
from .earth import EarthPath, beginning, instant

FILE = "path.kml"
ALTITUDE_MODE = "clampToGround"
_NAMESPACES = {
    "xmlns": "http://www.opengis.net/kml/2.2", "xmlns:gx": "http://www.google.com/kml/ext/2.2",
}
_WIDTH = {"truth": 3, "filter": 3, "fix": 1}
"""Widths of lines [pixel]."""


def write(
    folder: Path, title: str, paths: Sequence[EarthPath], start: datetime | None,
    dated: bool = False,
) -> None:
    """Write a placemark with a track for each path; one without a point has no track."""
    root = Element("kml", _NAMESPACES)
    document = SubElement(root, "Document")
    _text(document, "name", escaped(title))
    begins = beginning(start.astimezone(UTC) if start else None, dated)
    _text(document, "description", f"{begins}; altitude is minus the depth")
    for i, colour in enumerate(_colours(paths)):
        _style(document, f"path-{i + 1}", colour, _WIDTH[paths[i].kind])
    for i, path in enumerate(paths):
        placemark = SubElement(document, "Placemark")
        _text(placemark, "name", escaped(path.name))
        _text(placemark, "styleUrl", f"#path-{i + 1}")
        parts = path.parts() if len(path.time_ns) else []
        above = placemark
        if len(parts) > 1:
            above = SubElement(placemark, "gx:MultiTrack")
            _text(above, "gx:interpolate", "1")
        for part in parts:
            _track(above, path, part, start)
    text = ElementTree.tostring(root, "unicode")
    head = '<?xml version="1.0" encoding="UTF-8"?>\n'
    (folder / FILE).write_text(f"{head}{text}\n", "utf-8")


def _track(above: Element, path: EarthPath, part: slice, start: datetime | None) -> None:
    track = SubElement(above, "gx:Track")
    _text(track, "altitudeMode", ALTITUDE_MODE)
    for time in path.time_s[part].tolist():
        when = instant(start, time).astimezone(UTC).isoformat().replace("+00:00", "Z")
        _text(track, "when", when)
    for longitude, latitude, depth in zip(
        path.longitude[part].tolist(), path.latitude[part].tolist(), path.depth[part].tolist(),
        strict=True,
    ):
        _text(track, "gx:coord", f"{longitude!r} {latitude!r} {0.0 - depth!r}")


def _style(document: Element, name: str, colour: str, width: int) -> None:
    style = SubElement(document, "Style", {"id": name})
    red, green, blue = colour[1:3], colour[3:5], colour[5:7]
    icon = SubElement(style, "IconStyle")
    line = SubElement(style, "LineStyle")
    for part in (icon, line):
        _text(part, "color", f"ff{blue}{green}{red}")  # opaque; KML has blue first
    _text(icon, "scale", "0.6")
    _text(line, "width", str(width))


def _colours(paths: Sequence[EarthPath]) -> list[str]:
    """Colours as in a figure on dark paper, because water is dark in pictures from above."""
    look: Theme = named("dark")
    filters = [i for i, path in enumerate(paths) if path.kind == "filter"]
    own = {i: look.receivers[k % len(look.receivers)] for k, i in enumerate(filters)}
    others = {"truth": look.ink, "fix": look.soft}
    return [own[i] if i in own else others[path.kind] for i, path in enumerate(paths)]


def _text(above: Element, tag: str, text: str) -> None:
    SubElement(above, tag).text = text
