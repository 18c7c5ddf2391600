"""Recorded tracks: what is read, what is refused and where, and which points are kept."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sblcosim.errors import ConfigurationError, ConfigurationWarning
from sblcosim.scenario.scenario import load
from sblcosim.tracks import resample
from sblcosim.tracks.course import headed
from sblcosim.tracks.place import Origin
from sblcosim.tracks.read import read
from sblcosim.tracks.resample import MOST, TooFewError, fitted
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator
from seams import Seam

NED = "time_s,north_m,east_m,down_m"
GEO = "time_s,latitude_deg,longitude_deg,depth_m"
GPX = """<?xml version="1.0"?>
<gpx version="1.1" creator="x" xmlns="http://www.topografix.com/GPX/1/1">
<!-- <trkpt> is no point here -->
<trk><trkseg>
{points}
</trkseg></trk>
</gpx>
"""
POINT = '<trkpt lat="{0}" lon="14.2"><ele>{1}</ele><time>2024-05-01T10:00:{2:02d}Z</time></trkpt>'


def gpx(*points: Any) -> str:
    lines = [p if isinstance(p, str) else POINT.format(*p) for p in points]
    return GPX.format(points="\n".join(lines))


def table(header: str, *rows: str) -> str:
    return "\n".join((header, *rows, ""))


def written(folder: Path, text: str, name: str = "") -> Path:
    file = folder / (name or ("dive.gpx" if text.startswith("<") else "dive.csv"))
    file.write_text(text, "utf-8")
    return file


def dive(points: int, step: float = 1.0, seed: int = 1) -> tuple[Any, Any]:
    """A dive with stops."""
    numbers = np.random.default_rng(seed)
    velocity = np.zeros((points, 3))
    for i in range(1, points):
        velocity[i] = 0.97 * velocity[i - 1] + numbers.normal(0, 0.02, 3)
    for first in numbers.integers(0, points, points // 500):
        velocity[first : first + 60] = 0
    path = np.cumsum(velocity * step, axis=0)
    return np.arange(points) * step, path + np.array([5.0, -3.0, 10.0])


def motion(times: Any, points: Any, at: Any) -> tuple[Any, Any]:
    """Position and velocity through points, by SciPy: its limited slopes are the same inside."""
    slopes = np.zeros_like(points)  # at rest at both ends
    if len(times) > 2:
        slopes[1:-1] = PchipInterpolator(times, points, axis=0).derivative()(times)[1:-1]
    path = CubicHermiteSpline(times, points, slopes, axis=0)
    return path(np.clip(at, times[0], times[-1])), path.derivative()(at)


def largest(kept: Any, times: Any, points: Any) -> float:
    """The largest distance from the track with straight lines between its points, densely."""
    at = np.union1d(np.linspace(times[0], times[-1], 200_001), times)
    line = np.stack([np.interp(at, times, axis) for axis in points.T], axis=1)
    return float(np.linalg.norm(motion(kept.times, kept.points, at)[0] - line, axis=1).max())


# Reading -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("text", [
    table(NED, "0,1,2,3", "1.5,1,2,4"),
    table("\ufeff" + NED, "0,1,2,3", "1.5,1,2,4"),
    table("# of a logger", NED.replace(",", ";"), "", "100.3;1;2;3", "# a note", "101.8;1;2;4"),
    table("down_m\tnote\ttime\tnorth_m\teast_m",
          "3\t\t2024-05-01T10:00:00Z\t1\t2", "4\tx\t2024-05-01T12:00:01.5+02:00\t1\t2"),
])  # fmt: skip
def test_columns_are_found_by_their_names(tmp_path: Path, text: str) -> None:
    track = read(written(tmp_path, text))
    assert track.times.tolist() == [0, 1.5]
    assert track.points.tolist() == [[1, 2, 3], [1, 2, 4]]
    assert not track.geographic


def test_gpx_and_table_give_the_same_points(tmp_path: Path) -> None:
    rows = [(42.5, -10.1, 0), (42.50001, -10.25, 1), (42.500025, -11.0, 3)]
    one = read(written(tmp_path, gpx(*rows)))
    other = read(written(tmp_path, table(GEO, *(f"{t + 7},{y},14.2,{-z}" for y, z, t in rows))))
    assert one.geographic
    assert other.geographic
    np.testing.assert_array_equal(one.times, other.times)
    np.testing.assert_array_equal(one.points, other.points)
    assert one.origin() == Origin(42.5, 14.2)


def test_positions_on_earth_are_those_of_north_east_and_down() -> None:
    origin = Origin(42.5, 14.2, 40.0)
    ned = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 5.0], [0.0, 200.0, 7.0], [-300.0, 250.0, 20.0]])
    there = origin.geographic(ned)
    np.testing.assert_allclose(origin.local(there), ned, atol=1e-8)
    np.testing.assert_allclose(there[0], [42.5, 14.2, 0.0], atol=1e-9)
    # one minute of latitude is a nautical mile, and the water is as flat as that
    np.testing.assert_allclose((there[1, 0] - 42.5) * 60 * 1852, 100, rtol=2e-3)
    np.testing.assert_allclose(there[:, 2], ned[:, 2], atol=0.02)


WRONG: dict[str, tuple[str, str]] = {
    "empty": ("", "line 1, column 1: must be the names of the columns"),
    "no points": (table(NED), "line 1, column 1 (time_s): must be followed by at least 2 points"),
    "one point": (table(NED, "0,1,2,3"), "line 2, column 1 (time_s): must be followed by a second "
                  "point, got the end of the file"),
    "backwards": (table(NED, "0,1,2,3", "2,1,2,3", "1,1,2,3"),
                  "line 4, column 1 (time_s): must be later than the point before (2), got '1'"),
    "twice": (table(NED, "0,1,2,3", "0,1,2,3"),
              "line 3, column 1 (time_s): must be later than the point before (0), got '0'"),
    "mixed": (table("time_s,latitude_deg,east_m,down_m", "0,1,2,3"),
              "line 1, column 3: must be one of latitude_deg, longitude_deg, depth_m, as the first "
              "of them says, got 'east_m'; did you mean 'longitude_deg'?"),
    "metres": (table(GEO, "0,42,14,3", "1,142.5,14,3"),
               "line 3, column 2 (latitude_deg): must be a number from -90 to 90, got '142.5'"),
    "name": (table("time_s,nort_m,east_m,down_m"),
             "line 1, column 2: must be the name of a column of a track, as north_m is missing, "
             "got 'nort_m'; did you mean 'north_m'?"),
    "unit": (table("time_s,lat,lon,depth_m"),
             "line 1, column 2: must be names of columns of a track, as latitude_deg, "
             "longitude_deg are missing, got 'lat', 'lon'; did you mean 'latitude_deg', "
             "'longitude_deg'?"),
    "all names": (table("time,north,east,depth"),
                  "line 1, column 2: must be names of columns of a track, as north_m, east_m, "
                  "down_m are missing, got 'north', 'east', 'depth'; did you mean 'north_m', "
                  "'east_m', "
                  "'down_m'?"),
    "all on earth": (table("t;Lon [deg];Lat [deg];depth"),
                     "line 1, column 1: must be names of columns of a track, as time_s, "
                     "latitude_deg, longitude_deg, depth_m are missing, got 't', 'Lat [deg]', 'Lon "
                     "[deg]', 'depth'; did you mean 'time_s', 'latitude_deg', 'longitude_deg', "
                     "'depth_m'?"),
    "no header": (table("0,1.5,2,3", "1,2,2,3"),
                  "line 1, column 1: must be the names of the columns (time_s, north_m, east_m, "
                  "down_m), got '0'"),
    "commas": (table(NED.replace(",", ";"), "0;1;2;3", "1;1,5;2;3"),
               "line 3, column 2 (north_m): must be a number from -100000 to 100000, got '1,5'; "
               "numbers must have a decimal point, no comma"),
    "commas of times": (table(NED.replace(",", ";"), "0,5;1;2;3", "1;1;2;3"),
                        "line 2, column 1 (time_s): must be a number of seconds, got '0,5'; "
                        "numbers must have a decimal point, no comma"),
    "commas among commas": (table(NED, "0,1,5,2,5,3,5"),
                            "line 2, column 5: must have as many columns as the names, 4, got 7; "
                            "numbers must have a decimal point, no comma"),
    "a comma in each": (table(NED, "0,0,1,5,2,5,3,5"),
                        "line 2, column 5: must have as many columns as the names, 4, got 8; "
                        "numbers must have a decimal point, no comma"),
    "no time": (table("north_m,east_m,down_m,note"),
                "line 1, column 5: must be time_s or time, got no such column in north_m"),
    "both times": (table("time,time_s,north_m,east_m,down_m"),
                   "line 1, column 2: must be either time_s or time, got both"),
    "name twice": (table("time_s,north_m,north_m,east_m,down_m"),
                   "line 1, column 3: must be a name of its own, got 'north_m' a second time"),
    "short": (table(NED, "0,1,2,3", "1,2,3"),
              "line 3, column 4: must have as many columns as the names, 4, got 3"),
    "word": (table(NED, "0,1,x,3", "1,1,1,1"),
             "line 2, column 3 (east_m): must be a number from -100000 to 100000, got 'x'"),
    "nan": (table(NED, "0,1,2,3", "1,1,2,nan"), "line 3, column 4 (down_m): must be a number from"),
    "clock": (table(NED, "2024-05-01T10:00:00Z,1,2,3", "x,1,1,1"),
              "line 2, column 1 (time_s): must be a number of seconds, got '2024-05-01T10:00:00Z'; "
              "times of a clock are in a column 'time'"),
    "seconds": (table(NED.replace("time_s", "time"), "0,1,2,3", "1,1,2,3"),
                "line 2, column 1 (time): must be a time like 2024-05-01T10:00:00Z, got '0'; "
                "seconds are in a column 'time_s'"),
    "offset": (table(NED.replace("time_s", "time"), "2024-05-01T10:00:00Z,1,2,3",
                     "2024-05-01T10:00:01,1,2,3"),
               "line 3, column 1 (time): must have an offset from UTC, as the first time"),
    "quotes": (table(NED, '0,"1,2,3'), "column 1: must be a line of a table, got"),
    "long": (table(NED, "0,1,2,3", "2e9,1,2,3"),
             "line 3, column 1 (time_s): must be within 1e+09 s of the first point"),
    "gpx backwards": (gpx((42, -1, 1), (42, -1, 3), (42, -1, 2)),
                      "line 7, column 1 (trkpt 3, time): must be later than the point before "
                      "(2024-05-01T10:00:03+00:00), got 2024-05-01T10:00:02+00:00"),
    "gpx one point": (gpx((42, -1, 1)), "line 5, column 1 (trkpt 1, time): must be followed by a "
                      "second point, got no other"),
    "gpx none": (gpx(), "line 1, column 1: must have a track with at least 2 points (trkpt)"),
    "gpx time": (gpx((42, -1, 1), '<trkpt lat="1" lon="2"><ele>1</ele></trkpt>'),
                 "line 6, column 1 (trkpt 2, time): must have a time (<time>), got none"),
    "gpx depth": (gpx((42, -1, 1), (42, -1, 2)).replace("<ele>-1</ele>", "", 1),
                  "line 5, column 1 (trkpt 1, ele): must have an elevation, minus the depth [m]"),
    "gpx latitude": (gpx((42, -1, 1), (142, -1, 2)),
                     "line 6, column 1 (trkpt 2, lat): must be a number from -90 to 90, got 142"),
    "gpx word": (gpx((42, -1, 1), ("north", -1, 2)), "line 6, column 13: must be GPX, got"),
    "gpx clock": (gpx((42, -1, 1), (42, -1, 2)).replace("10:00:02Z", "noon"),
                  "line 6, column 1 (trkpt 2, time): must have a time (<time>), got none that can"),
    "xml": (gpx((42, -1, 1), "<trkpt>"), "must be XML, got mismatched tag"),
    "bomb": ('<!DOCTYPE gpx [<!ENTITY a "aaaa">]>\n<gpx/>',
             "line 1, column 15: must be GPX without a document type, got <!DOCTYPE"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_named_with_line_and_column(tmp_path: Path, case: str) -> None:
    text, message = WRONG[case]
    file = written(tmp_path, text, "dive.gpx" if text.startswith("<") else "dive.csv")
    with pytest.raises(ConfigurationError) as error:
        read(file)
    line = str(error.value)
    assert line.startswith(f"{file}, line ")
    assert message in line
    assert "\n" not in line


@pytest.mark.parametrize(("text", "said"), [
    (table("time_s,north_m,longitude_deg,down_m", "0,1,2,3"),
     "line 1, column 3: must be one of north_m, east_m, down_m, as the first of them says, got "
     "'longitude_deg'; did you mean 'east_m'?"),
    (table("depth_m,east_m,north_m,time_s", "0,1,2,3"),
     "line 1, column 2: must be one of latitude_deg, longitude_deg, depth_m, as the first of them "
     "says, got 'east_m'; did you mean 'longitude_deg'?"),
    (table(NED, "0,1,2,3", "1,2,3,4,5,6,7,8,9"),
     "line 3, column 5: must have as many columns as the names, 4, got 9"),
    (table(NED, "0,1,2,3", "1,2,x,4,5"),
     "line 3, column 5: must have as many columns as the names, 4, got 5"),
    (table("time,time_s,north_m,east_m,down_m", "1,2,3,4,5"),
     "line 1, column 2: must be either time_s or time, got both"),
    (table("north_m,time,east_m,time_s,down_m", "1,2,3,4,5"),
     "line 1, column 4: must be either time_s or time, got both"),
    (table("#,1;2", "", "time_s;north_m;east_m;down_m", "#0;1", "0;1;2;x", "1;1;2;3"),
     "line 5, column 4 (down_m): must be a number from -100000 to 100000, got 'x'"),
    (table(NED, "0,1,2,3", "", "# 1,2", " #,1,2,3", "1,1,2,-x", "2,1,2,3"),
     "line 6, column 4 (down_m): must be a number from -100000 to 100000, got '-x'"),
])  # fmt: skip
def test_messages_about_a_table_in_full(tmp_path: Path, text: str, said: str) -> None:
    file = written(tmp_path, text)
    with pytest.raises(ConfigurationError) as error:
        read(file)
    assert str(error.value) == f"{file}, {said}"


@pytest.mark.parametrize("names", [NED, GEO])
@pytest.mark.parametrize("lacking", range(4))
def test_a_column_that_is_missing_is_named(tmp_path: Path, names: str, lacking: int) -> None:
    columns = names.split(",")
    missing = columns.pop(lacking)
    wanted = "time_s or time" if missing == "time_s" else missing
    with pytest.raises(ConfigurationError, match=f"column 5: must be {wanted}, got no such column"):
        read(written(tmp_path, table(",".join((*columns, "remark")), "0,1,2,3", "1,1,2,3")))


@pytest.mark.parametrize(("header", "wanted"), [
    ("remark,colour", "time_s or time"),
    ("time_s,colour", "north_m, east_m, down_m, or latitude_deg, longitude_deg, depth_m"),
])  # fmt: skip
def test_what_a_header_without_coordinates_lacks_is_named(
    tmp_path: Path, header: str, wanted: str
) -> None:
    with pytest.raises(ConfigurationError, match=f"column 3: must be {wanted}, got no such column"):
        read(written(tmp_path, table(header, "0,1", "1,1")))


@pytest.mark.parametrize("first", [0.0, 5.0, -1e9])
def test_a_track_of_exactly_the_longest_time_is_read(tmp_path: Path, first: float) -> None:
    rows = f"{first!r},1,2,3", "{!r},1,2,3"
    long = read(written(tmp_path, table(NED, rows[0], rows[1].format(first + 1e9))))
    assert long.times.tolist() == [0.0, 1e9]
    with pytest.raises(ConfigurationError, match="must be within 1e\\+09 s of the first point"):
        read(written(tmp_path, table(NED, rows[0], rows[1].format(first + 1e9 + 1e-3))))


def test_a_file_that_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "bytes.csv").write_bytes(b"time_s\n\xff")
    for name, message in (
        ("no.csv", "no such file"), ("dive.kml", "must be a .csv or .gpx file"),
        ("bytes.csv", "line 2, column 1: must be text in UTF-8, got the byte 0xff"),
    ):
        with pytest.raises(ConfigurationError, match=message):
            read(tmp_path / name)


def test_the_largest_file_is_read_to_its_end_and_a_larger_one_is_refused(
    tmp_path: Path, seam: Seam
) -> None:
    file = written(tmp_path, table(NED, "0,1,2,3", "1,1,2,31").rstrip())
    size = file.stat().st_size
    seam.tuned(track_bytes=size)
    assert read(file).points[-1].tolist() == [1, 2, 31]
    seam.tuned(track_bytes=size - 1)
    with pytest.raises(ConfigurationError) as error:
        read(file)
    assert str(error.value) == f"{file}: must have at most {size - 1:,} bytes, got more"


def test_too_many_points_are_refused(tmp_path: Path, seam: Seam) -> None:
    seam.tuned(track_points=2)
    with pytest.raises(ConfigurationError, match=r"line 4, column 1 .*one of at most 2 points"):
        read(written(tmp_path, table(NED, "0,1,2,3", "1,1,2,3", "2,1,2,3")))


# Limits ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("head", "first", "second"), [
    (NED, (1e5, -1e5, 1e5), (-1e5, 1e5, -1e5)), (GEO, (90, -180, 1e5), (-90, 180, -1e5)),
])  # fmt: skip
def test_numbers_up_to_their_largest_are_read_and_none_beyond(
    tmp_path: Path, head: str, first: tuple[float, ...], second: tuple[float, ...]
) -> None:
    track = read(written(tmp_path, table(head, *(f"{t},{a},{b},{c}" for t, (a, b, c) in
                                                 enumerate((first, second))))))
    assert track.points.tolist() == [[*first], [*second]]
    for i, name in enumerate(head.split(",")[1:]):
        for sign in (1, -1):
            row = [1.0, 2.0, 3.0]
            row[i] = sign * (abs(first[i]) + 0.25)
            most = abs(first[i])
            with pytest.raises(ConfigurationError) as error:
                read(written(tmp_path, table(head, "0,1,1,1", f"1,{row[0]},{row[1]},{row[2]}")))
            assert str(error.value).endswith(
                f"line 3, column {i + 2} ({name}): must be a number from -{most:g} to {most:g}, "
                f"got '{row[i]}'"
            )


@pytest.mark.parametrize(("point", "coordinate", "most", "got"), [
    ('<trkpt lat="90.5" lon="14"><ele>-1</ele>', "lat", "90", "90.5"),
    ('<trkpt lat="-90.5" lon="14"><ele>-1</ele>', "lat", "90", "-90.5"),
    ('<trkpt lat="42" lon="180.5"><ele>-1</ele>', "lon", "180", "180.5"),
    ('<trkpt lat="42" lon="14"><ele>100000.5</ele>', "ele", "100000", "100000"),
    ('<trkpt lat="42" lon="14"><ele>-250000</ele>', "ele", "100000", "-250000"),
])  # fmt: skip
def test_numbers_of_gpx_beyond_their_largest_are_refused(
    tmp_path: Path, point: str, coordinate: str, most: str, got: str
) -> None:
    clock = "<time>2024-05-01T10:00:{:02}Z</time></trkpt>"
    ends = [f'<trkpt lat="{sign}90" lon="{other}180"><ele>{sign}1e5</ele>'
            for sign, other in (("", "-"), ("-", ""))]
    track = read(written(tmp_path, gpx(*(it + clock.format(i) for i, it in enumerate(ends)))))
    assert track.points.tolist() == [[90, -180, -1e5], [-90, 180, 1e5]]
    with pytest.raises(ConfigurationError) as error:
        read(written(tmp_path, gpx(ends[0] + clock.format(0), "", point + clock.format(1))))
    assert str(error.value).endswith(
        f"line 7, column 1 (trkpt 2, {coordinate}): must be a number from -{most} to {most}, got "
        f"{got}"
    )


def test_points_are_a_microsecond_apart_at_least(tmp_path: Path) -> None:
    assert read(written(tmp_path, table(NED, "7.5,1,2,3", "7.500001,1,2,3"))).times[1] == 1e-6
    with pytest.raises(ConfigurationError, match=r"later than the point before \(7.5\), got '7.50"):
        read(written(tmp_path, table(NED, "7.5,1,2,3", "7.5000009,1,2,3")))
    clock = NED.replace("time_s", "time")
    day = "2024-05-01T10:00:00"
    there = read(written(tmp_path, table(clock, f"{day}.000001,1,2,3", f"{day}.000002,1,2,3",
                                         "2024-05-02T11:00:01,1,2,3")))
    assert there.times.tolist() == [0, 1e-6, 25 * 3600 + 1 - 1e-6]
    text = gpx((42, -1, 0), (42, -1, 0))
    first, last = text.index("00Z"), text.rindex("00Z")
    text = f"{text[:first]}00.000003Z{text[first + 3 : last]}00.000004Z{text[last + 3 :]}"
    assert read(written(tmp_path, text)).times.tolist() == [0, 1e-6]


def test_seconds_of_a_clock_are_below_a_billion(tmp_path: Path) -> None:
    for sign in ("", "-"):
        good = table(NED, f"{sign}1000000000000,1,2,3", f"{sign}1000000000001,1,2,3")
        with pytest.raises(ConfigurationError, match=r"line 3, column 1 .time_s.: must be a number "
                           "of seconds, got '-?1000000000001'"):
            read(written(tmp_path, good))
    near = read(written(tmp_path, table(NED, "999999999999.5,1,2,3", "1000000000000,1,2,3")))
    assert near.times.tolist() == [0, 0.5]


def test_a_boat_needs_no_depth_and_may_have_headings(tmp_path: Path) -> None:
    head = "heading_deg,time_s,note,east_m,north_m"
    file = written(tmp_path, table(head, "360,5,a,1,2", "-360,6,b,3,4", "90.5,8,c,5,6"))
    boat = read(file, depths=False)
    assert boat.times.tolist() == [0, 1, 3]
    assert boat.points.tolist() == [[2, 1, 0], [4, 3, 0], [6, 5, 0]]
    assert boat.headings is not None
    assert boat.headings.tolist() == [360, -360, 90.5]
    assert [boat.where(1, k).rpartition("dive.csv, ")[2] for k in range(4)] == [
        "line 3, column 2 (time_s)", "line 3, column 5 (north_m)", "line 3, column 4 (east_m)",
        "line 3, column 1 (heading_deg)",
    ]
    with pytest.raises(ConfigurationError, match="must be down_m, got no such column in heading_d"):
        read(file)
    with pytest.raises(ConfigurationError, match=r"column 1 \(heading_deg\): .*360, got '360.5'"):
        read(written(tmp_path, table(head, "0,5,a,1,2", "360.5,6,b,3,4")), depths=False)
    deep = table("time_s,latitude_deg,longitude_deg,depth_m", "0,42,14,3", "1,43,15,4")
    found = read(written(tmp_path, deep), depths=False)
    assert found.points.tolist() == [[42, 14, 3], [43, 15, 4]]
    assert found.headings is None
    flat = gpx((42, -7, 1), (43, 9, 3)).replace("<ele>9</ele>", "")
    found = read(written(tmp_path, flat), depths=False)
    assert found.points.tolist() == [[42, 14.2, 0], [43, 14.2, 0]]
    with pytest.raises(ConfigurationError, match=r"trkpt 2, ele\): must have an elevation"):
        read(written(tmp_path, flat))


def test_a_byte_that_is_no_text_is_named_with_its_column(tmp_path: Path) -> None:
    text = gpx((42, -1, 1), (43, -2, 3)).replace("point", "höhe")
    (tmp_path / "dive.gpx").write_bytes(text.encode("latin-1"))
    with pytest.raises(ConfigurationError) as error:
        read(tmp_path / "dive.gpx")
    line = next(it for it in text.split("\n") if "höhe" in it)
    assert str(error.value).endswith(
        f"dive.gpx, line 3, column {line.index('ö') + 1}: must be text in UTF-8, got the byte 0xf6"
    )


# Where a boat points -----------------------------------------------------------------------------


def test_a_boat_points_from_where_it_was_to_where_it_will_be() -> None:
    """North at 1 m/s, then east at 2 m/s: from 5 s before to 5 s after each time."""
    times = np.array([0.0, 100.0, 200.0])
    at, heading = headed(times, np.array([[7.0, 3.0], [107.0, 3.0], [107.0, 203.0]]), 0.1)
    assert at.tolist() == [0, 2.5, 5, 95, 97.5, 100, 102.5, 105, 195, 197.5, 200]
    turning = [np.arctan2(2 * after, 10 - after) for after in (2.5, 5.0, 7.5)]
    quarter = np.pi / 2
    np.testing.assert_allclose(
        heading, [0, 0, 0, 0, *turning, quarter, quarter, quarter, quarter], atol=1e-12
    )


def test_a_boat_that_rests_keeps_its_heading_and_before_it_leaves_has_that_of_its_start() -> None:
    """It moves by 5 m in 10 s, or not at all; headings are not wrapped."""
    times = np.arange(0.0, 101.0, 10.0)
    north = np.array([0, 0, 0, 0, -5, -10, -10, -10, -10, -15, -20.0])
    east = np.array([0, 0, 0, 0, 0.5, 1.0, 1.0, 1.0, 1.0, 0.5, 0.0])
    points = np.column_stack([north, east])
    at, heading = headed(times, points, 0.3)
    there = dict(zip(at.tolist(), np.degrees(heading).tolist(), strict=True))
    out, back = np.degrees(np.arctan2(0.5, -5)), 360 + np.degrees(np.arctan2(-0.5, -5))
    for time, expected in ((0, out), (10, out), (25, out), (40, out), (50, out), (60, out),
                           (75, out), (80, back), (90, back), (100, back)):
        assert there[time] == pytest.approx(expected), time
    assert 170 < out < 180 < back < 190
    straight = np.column_stack([times / 2, 0 * times])
    for tolerance, expected in ((4.999, -90.0), (5.0, 0.0)):
        found = headed(times, straight[:, ::-1] * -1, tolerance)[1]
        assert np.degrees(found) == pytest.approx([expected] * len(found))


def test_times_beside_a_corner_that_are_those_of_the_track_are_one() -> None:
    for third, beside in ((5.0005, False), (5.0015, True)):
        times = np.array([0.0, third, 30.0])
        at, _ = headed(times, np.column_stack([times, times]), 0.1)
        assert (5.0 in at.tolist()) == beside
        assert third in at.tolist()
        assert (np.diff(at) > 0).all()


# What is kept ------------------------------------------------------------------------------------


@pytest.mark.parametrize("tolerance", [0.05, 0.5])
def test_a_long_track_stays_within_the_tolerance_at_all_times(tolerance: float) -> None:
    times, points = dive(10_000)
    kept = fitted(times, points, tolerance)
    assert kept.recorded == 10_000
    assert len(kept.times) < 2500
    assert largest(kept, times, points) <= kept.deviation + 1e-12 <= tolerance + 1e-12
    before, after = (motion(kept.times, kept.points, kept.times[1:-1] + d) for d in (-1e-6, 1e-6))
    np.testing.assert_allclose(before[1], after[1], atol=1e-4)
    again = fitted(times, points, tolerance)
    np.testing.assert_array_equal(again.times, kept.times)


def test_kept_points_are_of_the_track_and_so_are_the_ends_of_stops() -> None:
    times, points = dive(2_000)
    kept = fitted(times, points, 0.2)
    own = np.isin(kept.times, times)
    assert (~own).sum() == kept.added
    np.testing.assert_array_equal(kept.points[own], points[np.searchsorted(times, kept.times[own])])
    rests = np.flatnonzero((np.diff(points, axis=0) == 0).all(axis=1))
    assert len(rests) > 100
    position, velocity = motion(kept.times, kept.points, times[rests] + 0.5)
    np.testing.assert_array_equal(position, points[rests])
    assert (velocity == 0).all()


def test_a_corner_is_cut_no_farther_than_the_tolerance() -> None:
    times, points = np.array([0.0, 100, 160, 200]), np.array(
        [[0, 0, 5], [50, 0, 5], [50, 0, 5], [50, 30, 5.0]]
    )
    kept = fitted(times, points, 0.05)
    assert kept.added == 4
    assert largest(kept, times, points) <= 0.05


def test_points_beside_a_corner_are_as_near_as_the_tolerance_asks() -> None:
    """A leg's motion strays by 0.2 of its chord: 0.05 / (0.2 · 50) of 100 s, and so on."""
    times, points = np.array([0.0, 100, 160, 200]), np.array(
        [[0, 0, 5], [50, 0, 5], [50, 0, 5], [50, 30, 5.0]]
    )
    kept = fitted(times, points, 0.05)
    beside = 0.05 / (0.2 * 30) * 40
    np.testing.assert_allclose(
        kept.times, [0, 0.5, 99.5, 100, 160, 160 + beside, 200 - beside, 200], rtol=1e-12
    )
    np.testing.assert_allclose(kept.points[1:3], [[0.25, 0, 5], [49.75, 0, 5]], rtol=1e-12)
    assert (kept.recorded, kept.added) == (4, 4)
    assert len(fitted(times, points, 0.05, most=8).times) == 8
    with pytest.raises(TooFewError, match=r"as 7 points are to do for the 4 .*, got 0\.05"):
        fitted(times, points, 0.05, most=7)


@pytest.mark.parametrize("tolerance", [0.05, 0.3])
def test_the_bound_of_the_distance_is_close_to_it(tolerance: float) -> None:
    times, points = dive(400)
    kept = fitted(times, points, tolerance)
    far = largest(kept, times, points)
    assert far - 1e-12 <= kept.deviation <= 1.05 * far
    assert kept.deviation <= tolerance
    assert kept.added == int((~np.isin(kept.times, times)).sum())


def test_of_a_straight_line_little_is_kept() -> None:
    times = np.arange(1000.0)
    kept = fitted(times, times[:, None] * [0.3, -0.2, 0.1], 0.1)
    assert len(kept.times) <= 8


def test_a_track_that_does_not_fit_is_refused_with_the_tolerance_that_would() -> None:
    times, points = dive(2_000)
    with pytest.raises(TooFewError) as error:
        fitted(times, points, 0.001, most=300)
    said = str(error.value)
    enough = float(said.partition("at least ")[2].partition(", ")[0])
    assert said == (
        f"[target] track_tolerance_m: must be at least {enough:g}, as 300 points are to do for "
        "the 2,000 of the track, got 0.001"
    )
    assert len(fitted(times, points, enough, most=300).times) <= 300
    with pytest.raises(TooFewError):
        fitted(times, points, 0.8 * enough, most=300)


def test_stops_make_way_if_there_is_no_room_for_them() -> None:
    times = np.arange(100.0)
    points = np.stack([np.floor(times / 2) * 0.01, 0 * times, 0 * times], axis=1)
    assert len(fitted(times, points, 0.1, most=20).times) <= 20


# In a scenario -----------------------------------------------------------------------------------


def scenario(folder: Path, text: str, more: str = "", **place: float) -> Path:
    track = written(folder, text)
    where = "".join(f"{key} = {value}\n" for key, value in place.items())
    file = folder / "dive.toml"
    file.write_text(
        f'[target]\ntrajectory = "file"\ntrack_file = "{track.name}"\n{more}\n[place]\n{where}'
    )
    return file


LINE = table(NED, *(f"{t},{0.2 * t},{t % 7},5" for t in range(60)))


def test_a_scenario_holds_the_points_instead_of_the_file(tmp_path: Path) -> None:
    file = scenario(tmp_path, LINE, "track_tolerance_m = 0.3")
    made = load(file)
    assert made.target.track_file is None
    assert made.target.track_count == len(made.target.track_time_s)
    assert "of 60 points" in made.about_tracks[0]
    (tmp_path / "dive.csv").unlink()
    again = tmp_path / "again.toml"
    again.write_text(made.dump_toml())
    assert load(again).target == made.target
    assert made.override({"seed": 3}).about_tracks == made.about_tracks
    assert made.override({"target.trajectory": "circle"}).about_tracks == ()
    with pytest.raises(ConfigurationError, match="no such file"):
        load(file)


def test_a_diver_above_the_water_is_told(tmp_path: Path) -> None:
    """As in a GPX file with heights of the land."""
    land = gpx((40.0, 570.5, 0), (40.00001, 571.0, 10), (40.00002, -1.0, 20))
    with pytest.warns(
        ConfigurationWarning,
        match=r"line 5.*, ele\): should be under water .*got up to 571 m above it at 2 of 3 points",
    ):
        load(scenario(tmp_path, land))


def test_the_origin_is_that_of_the_scenario_or_the_first_point(tmp_path: Path) -> None:
    text = gpx((42.5, -10, 1), (42.501, -10, 40))
    free = load(scenario(tmp_path, text))
    assert (free.place.latitude_deg, free.place.longitude_deg) == (42.5, 14.2)
    assert free.target.track_m[:2] == pytest.approx((0, 0), abs=1e-9)
    there = load(scenario(tmp_path, text, latitude_deg=42.499, longitude_deg=14.2, height_m=44.0))
    assert there.target.track_m[0] == pytest.approx(111, abs=0.3)
    assert there.place.height_m == 44
    far = scenario(tmp_path, text, latitude_deg=-42.499, longitude_deg=14.2)
    with pytest.raises(ConfigurationError, match=r"dive.gpx, line 5, column 1 .*within 100 km"):
        load(far)


@pytest.mark.parametrize(("tables", "message"), [
    ({"trajectory": "file"}, "[target] track_file: must be the file of a track (or track_time_s "
     "and track_m its points) when trajectory is 'file', got none"),
    ({"trajectory": "file", "track_file": "x.csv", "track_time_s": [0, 1]},
     "[target] track_time_s: must be left out when there is a track_file"),
    ({"trajectory": "file", "track_file": "x.csv", "fmu": "x.fmu"},
     "[target] track_file: must be left out with another FMU, fmu"),
    ({"trajectory": "file", "track_time_s": [0, 1], "track_m": [1, 2, 3]},
     "[target] track_m: must have a row for each of 2 times, got 1"),
    ({"trajectory": "file", "track_time_s": [0, 1, 1], "track_m": [[0, 0, 1]] * 3},
     "[target] track_time_s[3]: must be later than the previous point (1.0), got 1.0"),
    ({"trajectory": "file", "track_count": 3, "track_time_s": [0, 1], "track_m": [[0, 0, 1]] * 2},
     "[target] track_count: must be from 2 to 2, got 3"),
    ({"trajectory": "file", "track_time_s": [0, 1], "track_m": [[0, 0, 1], [0, 2e5, 1]]},
     "[target] track_m[2,2]: must be at most 100000.0, got 200000.0"),
    ({"track_fil": "x.csv"}, "[target] has no key 'track_fil'; did you mean 'track_file'?"),
])  # fmt: skip
def test_keys_that_contradict_each_other_are_refused(tables: Any, message: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        load({"target": tables})
    assert str(error.value) == f"scenario: {message}"


def test_half_a_place_is_none() -> None:
    with pytest.raises(ConfigurationError, match=r"\[place\] longitude_deg: must be given with"):
        load({"place": {"latitude_deg": 1.0}})


def test_a_tolerance_that_is_too_small_is_a_matter_of_the_key(
    tmp_path: Path, seam: Seam
) -> None:
    seam.instead(resample.fitted, lambda *a: fitted(*a, most=4))
    file = scenario(tmp_path, LINE)
    with pytest.raises(ConfigurationError, match=rf"^{file}: \[target\] track_tolerance_m: must"):
        load(file)
    with pytest.raises(ConfigurationError, match=r"^override target.track_tolerance_m: must be at"):
        load(file, {"target.track_tolerance_m": 0.01})
    assert MOST == 4096


def test_a_track_that_is_not_followed_is_said(tmp_path: Path) -> None:
    from sblcosim.scenario import effects

    made = load({"target": {"track_file": str(tmp_path / "no.csv")}})
    idle = effects.idle(made, effects.components_of(made), effects.given(made))
    assert idle == {("target", "track_file"): 'trajectory is "semicircle"'}
    points = {"track_time_s": [0.0, 1.0], "track_m": [[0, 0, 1], [1, 0, 1]]}
    made = load({"target": {"trajectory": "file", "track_tolerance_m": 0.1, **points}})
    idle = effects.idle(made, effects.components_of(made), effects.given(made))
    assert idle == {("target", "track_tolerance_m"): "there is no track_file"}


NEXT = "</trkseg></trk><trk><name>{}</name><trkseg>"


def test_tracks_that_follow_each_other_are_one(tmp_path: Path) -> None:
    one, two = [(42.5, -10, 0), (42.50001, -10, 10)], [(42.50002, -11, 20), (42.50001, -10, 30)]
    file = scenario(tmp_path, gpx(*one, NEXT.format("second"), *two))
    apart = read(tmp_path / "dive.gpx")
    assert apart.left_out == ()
    whole = read(written(tmp_path, gpx(*one, *two), "whole.gpx"))
    np.testing.assert_array_equal(apart.points, whole.points)
    np.testing.assert_array_equal(apart.times, whole.times)
    assert "left out" not in load(file).about_tracks[0]


def test_tracks_beside_another_are_left_out(tmp_path: Path) -> None:
    """Those of a run: the true path, then the receivers' estimates of it."""
    truth, later = [(42.5, -10, 0), (42.50001, -10, 30)], [(42.50002, -10, 40)]
    beside = [(42.6, 500, 29), (42.7, -10, 50)]
    text = gpx(*truth, NEXT.format("coupled"), *beside, NEXT.format("later"), *later,
               NEXT.format(""), *beside)  # fmt: skip
    file = scenario(tmp_path, text)
    track = read(tmp_path / "dive.gpx")
    np.testing.assert_array_equal(
        track.points, read(written(tmp_path, gpx(*truth, *later), "alone.gpx")).points
    )
    assert track.left_out == ("coupled", "trk 4")
    assert track.where(2, 3).endswith("(trkpt 5, ele)")
    line = text[: text.index("10:00:40")].count("\n") + 1
    assert f"line {line}," in track.where(2, 3)
    assert load(file).about_tracks[0].endswith(
        "; left out: coupled, trk 4, as they begin before the previous track has ended"
    )


def test_a_jump_in_a_track_is_told(tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    load(scenario(tmp_path, table(NED, "0,0,0,5", "2,40,0,5", "4,40,0,5")))  # 20 m/s
    assert not recwarn.list
    rows = ("0,0,0,5", "2,0,0,5", "4,300,400,5", "6,300,400,5", "7,360,400,5")
    with pytest.warns(ConfigurationWarning) as caught:
        load(scenario(tmp_path, table(NED, *rows), "track_tolerance_m = 5.0"))
    assert [str(w.message) for w in caught] == [
        f"{tmp_path / 'dive.csv'}, line 4, column 2 (north_m): should be reached at 20 m/s at "
        "most, got 250 m/s from the previous point, up to 250 m/s at 2 points"
    ]


def test_a_track_in_milliseconds_is_told(tmp_path: Path) -> None:
    load(scenario(tmp_path, table(NED, "0,0,0,5", "86400,4,0,5")))
    with pytest.warns(ConfigurationWarning) as caught:
        load(scenario(tmp_path, table(NED, "0,0,0,5", "1000000,4,0,5")))
    assert [str(w.message) for w in caught] == [
        f"{tmp_path / 'dive.csv'}, line 3, column 1 (time_s): should be within a day of the first "
        "point, got a track that lasts 277.8 h; times are in seconds"
    ]
