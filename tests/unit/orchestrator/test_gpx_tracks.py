"""Points of GPX that stand where no track has them, and the places that messages name."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from sblcosim.errors import ConfigurationError
from sblcosim.tracks.read import read

HEAD = '<gpx version="1.1" creator="x" xmlns="http://www.topografix.com/GPX/1/1">'
POINT = '<trkpt lat="42" lon="14"><ele>-1</ele><time>2024-05-01T10:00:{:02d}Z</time></trkpt>'


def refused(folder: Path, *lines: str) -> str:
    """What is said of a file, after its name."""
    file = folder / "dive.gpx"
    file.write_text("\n".join((HEAD, *lines, "</gpx>")), "utf-8")
    with pytest.raises(ConfigurationError) as error:
        read(file)
    return str(error.value).removeprefix(f"{file}, ")


def test_points_beside_the_segments_of_tracks_are_refused(tmp_path: Path) -> None:
    """The first of all points is named: which of them the reader has passed over is not known."""
    inside = [f"   {POINT.format(0)}", POINT.format(1)]
    said = refused(
        tmp_path, "<trk>", POINT.format(9), "<trkseg>", *inside, "</trkseg>", POINT.format(8),
        "</trk>",
    )  # fmt: skip
    assert said == (
        "line 3, column 1: must have its 4 points (trkpt) in segments (trkseg) of tracks (trk), "
        "got 2 there"
    )
    said = refused(tmp_path, "<trk><trkseg>", *inside, "</trkseg></trk>", POINT.format(8))
    assert said.startswith("line 3, column 4: must have its 3 points (trkpt) in segments")


def test_a_value_that_cannot_be_read_is_named_where_it_stands(tmp_path: Path) -> None:
    wrong = POINT.format(1).replace('"14"', '"14,5"')
    said = refused(tmp_path, "<trk><trkseg>", POINT.format(0), f"  {wrong}", "</trkseg></trk>")
    column = 2 + wrong.index("14,5") + 1
    assert re.match(rf"line 4, column {column}: must be GPX, got .*14,5", said), said
