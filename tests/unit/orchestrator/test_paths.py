"""Files of paths: what other libraries read is where and when the diver was, in every format."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import gpxpy
import numpy as np
import pytest
from gpxpy import gpx
from made_logs import made
from path_files import (
    EPOCH,
    MAPS,
    READERS,
    TRAJECTORIES,
    kml_tracks,
    messages,
    of_kml,
    of_tum,
    stamp_of,
)
from quick import few, one_in
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from sblcosim.data.estimates import Estimates
from sblcosim.data.record import NEVER, Record
from sblcosim.data.truth import Truth, of_record
from sblcosim.errors import ConfigurationError
from sblcosim.paths import folder as path_files
from sblcosim.paths import ros
from sblcosim.paths.diver_path import DiverPath, of_estimates, of_truth
from sblcosim.paths.names import safe
from sblcosim.processing.processed import Processed
from sblcosim.scenario.scenario import load
from sblcosim.style import THEMES
from sblcosim.tracks.place import Origin
from sblcosim.tracks.read import read as read_track
from seams import Seam
from shapes import SHAPES, run_of

ORIGIN = Origin(60.1, -5.2, 47.0)
ALL = path_files.TRAJECTORIES
ODD = (
    "a b", "a/b", "a\\b", "A_b", "<x> & \"y\" 'z'", "..", "con", "tab\tnew\nline", "bell\x07",
    "Köder", "潜水员", "🤿", "2nd", "-f", "_hidden", "a__b", "truth", "x" * 300, " ", "%d {} $HOME",
)  # fmt: skip
"""Labels that people give."""


def path_of(position: Any, time_s: Any = None, name: str = "ekf", **given: Any) -> DiverPath:
    position = np.asarray(position, float).reshape(-1, 3)
    seconds = np.arange(len(position)) / 2 if time_s is None else np.asarray(time_s, float)
    time_ns = np.round(seconds * 1e9).astype(np.int64)
    return DiverPath(name=name, time_ns=time_ns, position=position, **given)


def wandering(points: int, seed: int = 1, name: str = "ekf") -> DiverPath:
    rng = np.random.default_rng(seed)
    position = np.array([100, -200, 30]) + np.cumsum(rng.normal(0, 1, (points, 3)), axis=0)
    return path_of(position, np.cumsum(rng.uniform(0.01, 2, points)), name)


def written(
    folder: Path, *paths: DiverPath, origin: Origin | None = ORIGIN, **options: Any
) -> Path:
    path_files.write(folder, "a dive", paths, origin, **{"trajectories": ALL} | options)
    return folder


def read(form: str, folder: Path, origin: Origin = ORIGIN) -> dict[str, Any]:
    return READERS[form](folder, origin)


def check(form: str, folder: Path, paths: Sequence[DiverPath], origin: Origin = ORIGIN) -> None:
    """A file has every point of the paths, and no other, to the digits of its format."""
    found = read(form, folder, origin)
    names = [p.name for p in paths] if form in MAPS else safe(p.name for p in paths)
    assert set(found) == {
        name for name, p in zip(names, paths, strict=True) if len(p) or form != "tum"
    }
    for name, path in zip(names, paths, strict=True):
        if name not in found:
            continue
        seconds, ned = found[name]
        np.testing.assert_allclose(seconds, path.time_ns / 1e9, rtol=0, atol=1.01e-6)
        if form in ("tum", "odometry"):
            np.testing.assert_array_equal(ned, path.position)
        else:
            far = np.abs(path.position).max(initial=0.0)
            digits = 1.2e-5 if form == "gpx" else 1e-6  # gpxpy rounds small numbers to 1e-10°
            if far > 1e7:  # pymap3d itself is exact near the Earth only
                digits = 1e-5 * far
            np.testing.assert_allclose(ned, path.position, rtol=0, atol=digits)


@pytest.mark.parametrize("shape", few(SHAPES, quick=[*SHAPES][::4]))
def test_every_shape_of_path_is_read_from_every_format(shape: str, tmp_path: Path) -> None:
    record, _ = run_of(SHAPES[shape])
    receivers = SHAPES[shape].receivers
    paths = [
        of_truth(of_record(record)),
        *(of_estimates(name, record.estimates(name)) for name in receivers),
    ]
    assert [len(path) for path in paths] == [301, *[299] * len(receivers)]
    written(tmp_path, *paths)
    for form in READERS:
        check(form, tmp_path, paths)


@pytest.mark.parametrize("form", READERS)
def test_places_and_times_are_those_of_another_computation(form: str, tmp_path: Path) -> None:
    """North and east on a sphere are good to half a per cent, and use nothing of the project."""
    path = path_of([[400.0, 0, 10], [0, 400, 0], [-300, 200, 25.5]], [0.1, 2.5, 86400.000001])
    written(tmp_path, path)
    if form in ("tum", "odometry"):
        return check(form, tmp_path, [path])
    sphere = Origin(60.1, -5.2, 47.0)
    _, ned = read(form, tmp_path, sphere)["ekf"]
    latitude, longitude, _ = sphere.geographic(ned).T
    north = np.radians(latitude - 60.1) * 6_371_000
    east = np.radians(longitude + 5.2) * 6_371_000 * np.cos(np.radians(60.1))
    np.testing.assert_allclose(north, path.position[:, 0], rtol=6e-3, atol=0.05)
    np.testing.assert_allclose(east, path.position[:, 1], rtol=6e-3, atol=0.05)
    return None


def test_heights_are_what_each_format_calls_a_height(tmp_path: Path) -> None:
    written(tmp_path, path_of([[0.0, 0, 0], [0, 0, 12.5]]))
    heights = {
        "geojson": [p[2] for p in json.loads((tmp_path / "path.geojson").read_text())["features"][
            0]["geometry"]["coordinates"]],
        "gpx": [p.elevation for p in gpxpy.parse((tmp_path / "path.gpx").read_text()).tracks[0]
                .segments[0].points],
        "kml": [item.coord.z for item in kml_tracks(tmp_path)["ekf"][0].track_items],
        "fix": [m.altitude for _, m in messages(tmp_path)["/ekf/fix"]],
        "odometry": [m.pose.pose.position.z for _, m in messages(tmp_path)["/ekf/odometry"]],
    }  # fmt: skip
    above_water, above_ellipsoid = [0.0, -12.5], [47.0, 34.5]
    assert heights == {
        "geojson": pytest.approx(above_ellipsoid), "fix": pytest.approx(above_ellipsoid),
        "gpx": pytest.approx(above_water, abs=1e-6), "kml": pytest.approx(above_water, abs=1e-6),
        "odometry": above_water,
    }


def test_no_depth_of_zero_is_minus_zero(tmp_path: Path) -> None:
    written(tmp_path, path_of(np.zeros((2, 3))), origin=Origin(0.0, 0.0))
    for file in ("path.kml", "path-ekf.tum"):
        assert not re.search(r"-0\.0\b", (tmp_path / file).read_text("utf-8")), file


@pytest.mark.parametrize("form", READERS)
@pytest.mark.parametrize("count", [0, 1, 2])
def test_few_points_and_none(form: str, count: int, tmp_path: Path) -> None:
    paths = [wandering(9, name="truth"), wandering(count)]
    written(tmp_path, *paths)
    check(form, tmp_path, paths)


def test_one_point_and_none_are_a_point_and_no_geometry_in_geojson(tmp_path: Path) -> None:
    written(tmp_path, wandering(1, name="one"), wandering(0, name="none"))
    features = json.loads((tmp_path / "path.geojson").read_text("utf-8"))["features"]
    assert [f["geometry"] and f["geometry"]["type"] for f in features] == ["Point", None]


def test_without_a_path_nothing_is_written(tmp_path: Path) -> None:
    written(tmp_path)
    assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize("form", READERS)
def test_unknown_points_are_left_out_with_their_times(form: str, tmp_path: Path) -> None:
    whole = wandering(12)
    position, time_ns = whole.position.copy(), whole.time_ns.copy()
    position[0] = position[5, 1] = np.nan
    position[7, 2] = np.inf
    time_ns[9] = NEVER
    kept = np.setdiff1d(np.arange(12), [0, 5, 7, 9])
    written(tmp_path, DiverPath(name="ekf", time_ns=time_ns, position=position))
    check(form, tmp_path, [whole.chosen(kept)])


@pytest.mark.parametrize("form", READERS)
@one_in(2)
def test_long_paths(form: str, tmp_path: Path) -> None:
    """Maps have every second point and so on; trajectories have all."""
    path = wandering(20_001)
    written(tmp_path, path)
    kept = np.arange(0, 20_001, 3 if form in MAPS else 1)
    check(form, tmp_path, [path.chosen(kept)])


def test_a_path_of_the_most_points_is_whole(tmp_path: Path, seam: Seam) -> None:
    seam.tuned(path_points=4)
    for points, kept in ((4, [0, 1, 2, 3]), (5, [0, 2, 4]), (10, [0, 3, 6, 9])):
        path = wandering(points)
        written(tmp_path, path)
        for form in MAPS:
            check(form, tmp_path, [path.chosen(np.array(kept))])


@pytest.mark.parametrize("form", TRAJECTORIES)
def test_trajectories_are_in_the_order_of_their_times(form: str, tmp_path: Path) -> None:
    """Of several points at one time the last counts; readers refuse times that repeat."""
    path = path_of(np.arange(21.0).reshape(7, 3), [3.0, 1.0, 2.0, 1.0, 4.0, 3.0, 3.0])
    written(tmp_path, path)
    check(form, tmp_path, [path.chosen(np.array([3, 2, 6, 4]))])


def test_times_that_64_bits_cannot_tell_apart_are_one_in_tum(tmp_path: Path) -> None:
    start = datetime(2026, 5, 1, tzinfo=UTC)
    path = DiverPath(
        name="ekf", time_ns=np.array([5, 6, 10_000]), position=np.arange(9.0).reshape(3, 3)
    )
    written(tmp_path, path, start=start)
    np.testing.assert_array_equal(of_tum(tmp_path)["ekf"][1], path.position[1:])
    stamps = [stamp_of(message) for _, message in messages(tmp_path)["/ekf/odometry"]]
    assert [stamp % 10**9 for stamp in stamps] == [5, 6, 10_000]


@pytest.mark.parametrize("form", READERS)
@pytest.mark.parametrize("latitude", [-17.0, 0.0, 68.0])
def test_the_antimeridian(form: str, latitude: float, tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    origin = Origin(latitude, 179.9999, 20.0)
    east = 11 * np.cos(np.radians(latitude)) + np.cumsum(rng.normal(0, 9, 60))
    path = path_of(np.column_stack([rng.normal(0, 9, 60), east, rng.uniform(0, 9, 60)]))
    crossings = np.abs(np.diff(origin.geographic(path.position)[:, 1])) > 180
    assert crossings.sum() > 2
    written(tmp_path, path, origin=origin)
    check(form, tmp_path, [path], origin)


def test_no_line_of_a_map_goes_round_the_earth(tmp_path: Path) -> None:
    origin = Origin(-17.0, 180.0)
    path = path_of([[0, -30, 5], [10, -10, 5], [0, 10, 5], [0, 40, 5], [8, -5, 5]], range(5))
    written(tmp_path, path, origin=origin)
    feature = json.loads((tmp_path / "path.geojson").read_text("utf-8"))["features"][0]
    lines = [np.array(line) for line in feature["geometry"]["coordinates"]]
    assert [len(line) for line in lines] == [3, 4, 2]
    assert lines[0][-1][0] == 180.0
    assert lines[1][0][0] == -180.0
    np.testing.assert_allclose(lines[0][-1][1:], lines[1][0][1:], rtol=0, atol=1e-12)
    times = feature["properties"]["time_s"]
    assert times == pytest.approx([0, 1, 1.5, 1.5, 2, 3, 3 + 40 / 45, 3 + 40 / 45, 4], abs=1e-6)
    document = gpxpy.parse((tmp_path / "path.gpx").read_text("utf-8"))
    assert [len(s.points) for s in document.tracks[0].segments] == [2, 2, 1]
    tracks = kml_tracks(tmp_path)["ekf"]
    assert [len(track.track_items) for track in tracks] == [2, 2, 1]
    for line in (*lines, *([p.longitude for p in s.points] for s in document.tracks[0].segments)):
        assert np.ptp(np.array(line).reshape(len(line), -1)[:, 0]) < 1


def test_a_long_step_is_no_crossing(tmp_path: Path) -> None:
    path = path_of([[0, 0, 5], [0, 500_000, 5], [0, -3_000_000, 5]])
    assert np.ptp(ORIGIN.geographic(path.position)[:, 1]) > 30
    written(tmp_path, path)
    feature = json.loads((tmp_path / "path.geojson").read_text("utf-8"))["features"][0]
    assert feature["geometry"]["type"] == "LineString"
    document = gpxpy.parse((tmp_path / "path.gpx").read_text("utf-8"))
    assert len(document.tracks[0].segments) == len(kml_tracks(tmp_path)["ekf"]) == 1
    assert "MultiTrack" not in (tmp_path / "path.kml").read_text("utf-8")


def test_a_path_over_the_antimeridian_can_be_a_track_again(tmp_path: Path) -> None:
    origin = Origin(-17.0, 180.0)
    path = path_of([[0, -30, 5], [10, -10, 5], [0, 10, 5], [0, 40, 5]], range(4))
    written(tmp_path, path, origin=origin)
    again = read_track(tmp_path / "path.gpx")
    np.testing.assert_allclose(origin.local(np.array(again.points)), path.position, atol=1e-6)


@pytest.mark.parametrize("form", READERS)
def test_odd_labels(form: str, tmp_path: Path) -> None:
    paths = [wandering(5, seed, name) for seed, name in enumerate(("truth", *ODD))]
    written(tmp_path, *paths)
    if form in TRAJECTORIES:
        return check(form, tmp_path, paths)
    texts = {name: name if name.isprintable() else name.encode("unicode_escape").decode()
             for name in ODD}  # fmt: skip
    shown = [replaced(path, path.name if form == "geojson" else texts.get(path.name, path.name))
             for path in paths]  # fmt: skip
    found = {(name or "").strip() for name in read(form, tmp_path)}
    assert found == {path.name.strip() for path in shown}  # both named truth are there
    return None


def replaced(path: DiverPath, name: str) -> DiverPath:
    return DiverPath(name=name, time_ns=path.time_ns, position=path.position)


def test_names_of_files_and_topics_are_safe_and_all_different(tmp_path: Path) -> None:
    names = safe(("truth", *ODD))
    assert len({name.casefold() for name in names}) == len(names)
    for name in names:
        assert re.fullmatch(r"[A-Za-z](_?[A-Za-z0-9])*", name), name
        assert len(name) < 90
    assert safe(["ekf", "fixed_lag", "raw"]) == ["ekf", "fixed_lag", "raw"]
    written(tmp_path, *(wandering(2, name=name) for name in ODD))
    assert len([*tmp_path.glob("path-*.tum")]) == len(ODD)


def test_a_start_is_the_time_of_all_files(tmp_path: Path) -> None:
    start = datetime(2026, 5, 1, 14, 30, 0, 250_000, timezone(timedelta(hours=2)))
    path = wandering(20)
    written(tmp_path, path, start=start)
    after = (start - EPOCH).total_seconds()
    for form in READERS:
        times = read(form, tmp_path)["ekf"][0]
        offset = 0.0 if form == "geojson" else after
        np.testing.assert_allclose(times - offset, path.time_ns / 1e9, rtol=0, atol=1.5e-6)
    said = "2026-05-01T12:30:00.250000+00:00"
    feature = json.loads((tmp_path / "path.geojson").read_text("utf-8"))["features"][0]
    assert feature["properties"]["start"] == said
    assert said in (tmp_path / "path.kml").read_text("utf-8")
    description = gpxpy.parse((tmp_path / "path.gpx").read_text("utf-8")).description
    assert description is not None
    assert "Time 0 is 2026-05-01T14:30:00.250000+02:00" in description
    stamps = [stamp_of(message) for _, message in messages(tmp_path)["/ekf/odometry"]]
    assert stamps == (path.time_ns + round(after * 1e6) * 1000).tolist()
    lines = (tmp_path / "path-ekf.tum").read_text("utf-8").splitlines()[1:]
    assert [line.split()[0].replace(".", "") for line in lines] == [*map(str, stamps)]


@pytest.mark.parametrize(
    ("start", "said"),
    [
        (datetime(2026, 5, 1), "time zone"),
        (datetime(1969, 12, 31, tzinfo=UTC), "1970"),
        (datetime(2500, 1, 1, tzinfo=UTC), "2199"),
        (datetime(2038, 1, 19, 3, 14, 8, tzinfo=UTC), "before 2038-01-19"),
    ],
)
def test_a_start_that_a_file_cannot_have_is_refused(
    start: datetime, said: str, tmp_path: Path
) -> None:
    with pytest.raises(ConfigurationError, match=said):
        written(tmp_path, wandering(3), start=start)


@pytest.mark.parametrize(("start", "fits"), [
    (datetime(1970, 1, 1, tzinfo=UTC), True), (datetime(2199, 12, 31, tzinfo=UTC), True),
    (datetime(2200, 1, 1, tzinfo=UTC), False), (datetime(1969, 12, 31, tzinfo=UTC), False),
])
def test_a_start_is_from_1970_to_2199(start: datetime, fits: bool, tmp_path: Path) -> None:
    path = wandering(3)
    if fits:
        written(tmp_path, path, start=start, trajectories="tum")
        stamp = (tmp_path / "path-ekf.tum").read_text().splitlines()[1].split()[0]
        first = round((start - EPOCH).total_seconds()) * 10**9 + int(path.time_ns[0])
        assert int(stamp.replace(".", "")) == first
        return
    with pytest.raises(ConfigurationError) as caught:
        written(tmp_path, path, start=start)
    assert str(caught.value) == (
        f"start: must have a time zone and a year from 1970 to 2199, got {start}"
    )
    assert not [*tmp_path.iterdir()]


def test_the_last_stamp_of_ros_is_of_2038(tmp_path: Path) -> None:
    """Its seconds have 32 bits; the last is the end of the second before."""
    start = datetime(2038, 1, 19, 3, 14, 7, tzinfo=UTC)
    assert round((start - EPOCH).total_seconds()) == 2**31 - 1
    last = DiverPath(name="ekf", time_ns=np.array([-5, 0]), position=np.ones((2, 3)))
    written(tmp_path, last, start=start, trajectories="mcap")
    stamps = [stamp_of(message) for _, message in messages(tmp_path)["/ekf/odometry"]]
    assert stamps == [(2**31 - 1) * 10**9 - 5, (2**31 - 1) * 10**9]
    later = DiverPath(name="ekf", time_ns=np.array([0, 1]), position=np.ones((2, 3)))
    with pytest.raises(ConfigurationError, match=r"2038-01-19, .*, got 2147483647 s after 1970"):
        written(tmp_path, later, start=start, trajectories="mcap")


def test_times_before_1970_are_logged_at_its_start(tmp_path: Path) -> None:
    """Times of a log have no sign; stamps have one."""
    path = path_of(np.arange(6.0).reshape(2, 3), [-1.25, 2.0])
    written(tmp_path, path, trajectories="mcap")
    found = messages(tmp_path)["/ekf/odometry"]
    assert [logged for logged, _ in found] == [0, 2_000_000_000]
    assert [stamp_of(message) for _, message in found] == [-1_250_000_000, 2_000_000_000]


def test_names_that_would_be_the_same_are_numbered() -> None:
    assert safe(["a b", "A/b", "a_b", "a_b_2", "2nd", "é", "潜", ""]) == [
        "a_b", "A_b_2", "a_b_3", "a_b_2_2", "path_2nd", "e", "path", "path_2",
    ]
    assert safe(["x" * 79 + "-y", "x" * 81, "x" * 80]) == [
        "x" * 79, "x" * 80, "x" * 80 + "_2",
    ]


def test_lines_of_fixes_are_thin(tmp_path: Path) -> None:
    """Their icons have the colours of the lines, and are small."""
    paths = [path_of(np.ones((2, 3)), name=name, kind=name) for name in ("truth", "fix", "filter")]
    written(tmp_path, *paths)
    text = (tmp_path / "path.kml").read_text("utf-8")
    assert re.findall(r"<width>(\d+)</width>", text) == ["3", "1", "3"]
    assert re.findall(r"<scale>([\d.]+)</scale>", text) == ["0.6"] * 3
    colours = re.findall(r"<color>(\w+)</color>", text)
    assert colours[::2] == colours[1::2]
    assert len({*colours}) == 3
    assert re.findall(r'<Style id="([^"]+)"', text) == ["path-1", "path-2", "path-3"]
    assert re.findall(r"<styleUrl>([^<]+)<", text) == ["#path-1", "#path-2", "#path-3"]
    assert "<description>Time 0 is 1970-01-01T00:00:00+00:00; altitude is minus the depth<" in text


def test_times_before_the_start_are_kept(tmp_path: Path) -> None:
    path = path_of(np.arange(9.0).reshape(3, 3), [-1.25, -0.5, 2.0])
    written(tmp_path, path)
    for form in READERS:
        check(form, tmp_path, [path])


@pytest.mark.parametrize("form", TRAJECTORIES)
def test_trajectories_need_no_place(form: str, tmp_path: Path) -> None:
    paths = [wandering(9, name="truth"), wandering(7)]
    written(tmp_path, *paths, origin=None)
    assert not [*tmp_path.glob("path.[gk]*")]
    if form == "fix":
        assert not any(topic.endswith("/fix") for topic in messages(tmp_path))
    else:
        check(form, tmp_path, paths)


def test_maps_come_alone_unless_asked(tmp_path: Path) -> None:
    written(tmp_path, wandering(9), trajectories=())
    assert {f.name for f in tmp_path.iterdir()} == {"path.geojson", "path.gpx", "path.kml"}


def test_equal_paths_give_equal_bytes(tmp_path: Path) -> None:
    contents = []
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
        written(tmp_path / name, wandering(50), wandering(9, 2, "raw"))
        contents.append({f.name: f.read_bytes() for f in (tmp_path / name).iterdir()})
    assert contents[0] == contents[1]


def test_maps_of_a_log_do_not_say_that_it_is_of_1970(tmp_path: Path) -> None:
    log = made(seconds=20, start_s=1.7e9, meta={"origin": {"latitude_deg": 60.0,
                                                           "longitude_deg": 5.0}})  # fmt: skip
    at = log.receptions.epoch_ns
    own = Estimates(epoch_ns=at, position=np.ones((len(at), 3)))
    processed = Processed(log=log, scenario=load("harbour-lbl"), made={"raw": own})
    processed.save(tmp_path / "out", figures=False)
    for name, height in (("path.kml", "altitude"), ("path.gpx", "elevation")):
        text = (tmp_path / "out" / name).read_text("utf-8")
        assert f"Times are those of the log; {height} is minus the depth" in text
        assert "2023-11-14T" in text
        assert "1970" not in text


def test_maps_of_runs_are_as_ever(tmp_path: Path) -> None:
    """The whole text of both, made here in the simplest way."""
    paths = [wandering(30, 1, "truth"), wandering(12, 2, "ekf"), wandering(1, 3, "raw")]
    written(tmp_path, *paths)
    features, document = [], gpx.GPX()
    document.creator, document.name = "sblcosim", "a dive"
    document.description = (
        "The run starts at 1970-01-01T00:00:00+00:00; elevation is minus the depth"
    )
    for path in paths:
        rows = ORIGIN.geographic(path.position).tolist()
        times = (path.time_ns / 10**9).tolist()
        points = [[longitude, latitude, 47.0 - depth] for latitude, longitude, depth in rows]
        one = len(rows) == 1
        features.append({
            "type": "Feature", "properties": {"name": path.name, "time_s": times},
            "geometry": {"type": "Point" if one else "LineString",
                         "coordinates": points[0] if one else points},
        })  # fmt: skip
        track, segment = gpx.GPXTrack(path.name), gpx.GPXTrackSegment()
        document.tracks.append(track)
        track.segments.append(segment)
        segment.points = [
            gpx.GPXTrackPoint(latitude, longitude, -depth, EPOCH + timedelta(seconds=time))
            for time, (latitude, longitude, depth) in zip(times, rows, strict=True)
        ]
    content = {"type": "FeatureCollection", "features": features}
    assert (tmp_path / "path.geojson").read_text("utf-8") == json.dumps(content) + "\n"
    assert (tmp_path / "path.gpx").read_text("utf-8") == document.to_xml()


def test_kml_has_the_colours_of_figures_and_lies_on_the_water(tmp_path: Path) -> None:
    look = THEMES["dark"]
    names = [f"receiver {i}" for i in range(len(look.receivers) + 1)]
    paths = [
        path_of(np.ones((2, 3)), name="truth", kind="truth"),
        path_of(np.ones((2, 3)), name="raw", kind="fix"),
        *(path_of(np.ones((2, 3)), name=name) for name in names),
    ]
    written(tmp_path, *paths)
    from fastkml import KML, LineStyle, Placemark, Style
    from fastkml.utils import find_all

    document = KML.parse(tmp_path / "path.kml", validate=True)
    colours = {
        f"#{style.id}": next(iter(find_all(style, of_type=LineStyle))).color
        for style in find_all(document, of_type=Style)
    }
    found = {m.name: colours[m.style_url.url] for m in find_all(document, of_type=Placemark)}

    def backwards(colour: str) -> str:
        return f"ff{colour[5:7]}{colour[3:5]}{colour[1:3]}"

    own = [*look.receivers, look.receivers[0]]
    assert found == {
        "truth": backwards(look.ink), "raw": backwards(look.soft),
        **{name: backwards(colour) for name, colour in zip(names, own, strict=True)},
    }
    for tracks in kml_tracks(tmp_path).values():
        assert tracks[0].altitude_mode is not None
        assert tracks[0].altitude_mode.value == "clampToGround"


def some_estimates(rng: np.random.Generator, **left_out: Any) -> Estimates:
    roots = rng.normal(0, 1, (6, 6, 6))
    given = {
        "epoch_ns": np.arange(6) * 10**9 + 7, "position": rng.normal(0, 50, (6, 3)),
        "velocity": rng.normal(0, 1, (6, 3)), "covariance": roots @ roots.transpose(0, 2, 1),
        "position_std": rng.uniform(1, 2, (6, 3)),
    }  # fmt: skip
    return Estimates(**given | left_out)


TURN = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
"""From NED to ENU."""


def test_odometry_has_velocity_and_covariances_in_east_north_up(tmp_path: Path) -> None:
    estimates = some_estimates(np.random.default_rng(1))
    written(tmp_path, of_estimates("ekf", estimates))
    assert estimates.covariance is not None
    assert estimates.velocity is not None
    for i, (logged, m) in enumerate(messages(tmp_path)["/ekf/odometry"]):
        assert logged == stamp_of(m) == estimates.epoch_ns[i]
        assert (m.header.frame_id, m.child_frame_id) == ("map", "ekf")
        turn, linear = m.pose.pose.orientation, m.twist.twist.linear
        assert (turn.x, turn.y, turn.z, turn.w) == (0, 0, 0, 1)
        np.testing.assert_array_equal(
            [linear.x, linear.y, linear.z], TURN @ estimates.velocity[i]
        )
        for part, states in ((m.pose, [0, 2, 4]), (m.twist, [1, 3, 5])):
            expected = np.zeros((6, 6))
            own = estimates.covariance[i][np.ix_(states, states)]
            expected[:3, :3] = TURN @ own @ TURN.T
            np.testing.assert_allclose(np.reshape(part.covariance, (6, 6)), expected, rtol=1e-15)


@pytest.mark.parametrize(
    ("left_out", "kind"),
    [((), 3), (("covariance",), 2), (("covariance", "position_std", "velocity"), 0)],
)
def test_a_fix_says_what_is_known_of_its_covariance(
    left_out: tuple[str, ...], kind: int, tmp_path: Path
) -> None:
    estimates = some_estimates(np.random.default_rng(2), **dict.fromkeys(left_out))
    written(tmp_path, of_estimates("ekf", estimates))
    found = messages(tmp_path)
    for i, (_, m) in enumerate(found["/ekf/fix"]):
        assert (m.header.frame_id, m.status.status, m.status.service) == ("ekf", 0, 0)
        assert m.position_covariance_type == kind
        expected = np.zeros((3, 3))
        if kind == 3 and estimates.covariance is not None:
            expected = TURN @ estimates.covariance[i][np.ix_([0, 2, 4], [0, 2, 4])] @ TURN.T
        elif kind == 2 and estimates.position_std is not None:
            expected = np.diag(estimates.position_std[i][[1, 0, 2]] ** 2)
        np.testing.assert_allclose(
            np.reshape(m.position_covariance, (3, 3)), expected, rtol=1e-15
        )
        odometry = found["/ekf/odometry"][i][1]
        np.testing.assert_array_equal(
            np.reshape(odometry.pose.covariance, (6, 6))[:3, :3],
            np.reshape(m.position_covariance, (3, 3)),
        )
        assert np.isnan(odometry.twist.twist.linear.x) == ("velocity" in left_out)


def test_a_covariance_that_is_not_known_at_some_epochs(tmp_path: Path) -> None:
    estimates = some_estimates(np.random.default_rng(4))
    assert estimates.covariance is not None
    estimates.covariance[2] = np.nan
    written(tmp_path, of_estimates("ekf", estimates))
    fixes = [m for _, m in messages(tmp_path)["/ekf/fix"]]
    assert [m.position_covariance_type for m in fixes] == [3, 3, 0, 3, 3, 3]
    assert not np.any(fixes[2].position_covariance)


@pytest.mark.parametrize("message", [ros.ODOMETRY, ros.NAV_SAT_FIX])
def test_definitions_of_messages_are_those_of_ros_2(message: str) -> None:
    """Their hashes are those of a distribution; a reader without ROS needs the text only."""
    standard = get_typestore(Stores.ROS2_HUMBLE)
    own = get_typestore(Stores.EMPTY)
    own.register(get_types_from_msg(ros.definition(message), message))
    assert own.hash_rihs01(message) == standard.hash_rihs01(message)
    assert {*own.fielddefs} <= {*standard.fielddefs}
    for name, fields in own.fielddefs.items():
        assert fields == standard.fielddefs[name], name


def test_mcap_is_in_the_order_of_time_and_says_where_it_is(tmp_path: Path) -> None:
    from mcap.reader import make_reader

    written(tmp_path, wandering(50, 1, "truth"), wandering(50, 2, "a b"))
    with (tmp_path / "path.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        read = [*reader.iter_messages(log_time_order=False)]
        times = [message.log_time for _, _, message in read]
        assert times == sorted(times)
        assert [m.sequence for _, _, m in read] == [*range(len(read))]
        channels = {channel.topic: channel.metadata["name"] for _, channel, _ in read}
        assert channels == {
            "/truth/odometry": "truth", "/truth/fix": "truth",
            "/a_b/odometry": "a b", "/a_b/fix": "a b",
        }  # fmt: skip
        about = {m.name: m.metadata for m in reader.iter_metadata()}["sblcosim"]
    assert about == {
        "title": "a dive", "latitude_deg": "60.1", "longitude_deg": "-5.2", "height_m": "47.0"
    }


def test_tum_has_exact_numbers(tmp_path: Path) -> None:
    path = path_of(
        [[0, 0, 0], [1 / 3, -1e-7, 2.0], [1e5 + 0.1, 7, -1.5]], [0, 0.000000001, 1234567.125]
    )
    written(tmp_path, path, origin=None, trajectories="tum")
    lines = (tmp_path / "path-ekf.tum").read_text("utf-8").splitlines()
    assert lines[0].startswith("# ekf: timestamp")
    assert lines[1:] == [
        "0.000000000 0.0 0.0 0.0 0 0 0 1",
        "0.000000001 -1e-07 0.3333333333333333 -2.0 0 0 0 1",
        "1234567.125000000 7.0 100000.1 1.5 0 0 0 1",
    ]


def test_evo_aligns_and_judges_a_trajectory(tmp_path: Path) -> None:
    from evo.core import metrics, sync
    from evo.tools import file_interface

    truth = wandering(300, name="truth")
    noise = np.random.default_rng(9).normal(0, 2, (300, 3))
    written(tmp_path, truth, replaced(path_of(truth.position + noise), "ekf"))
    (tmp_path / "path-ekf.tum").unlink()
    off = DiverPath(name="ekf", time_ns=truth.time_ns, position=truth.position + noise)
    written(tmp_path, truth, off)
    pair = sync.associate_trajectories(
        *(file_interface.read_tum_trajectory_file(tmp_path / f"path-{name}.tum")
          for name in ("truth", "ekf"))
    )  # fmt: skip
    error = metrics.APE(metrics.PoseRelation.translation_part)
    error.process_data(pair)
    rms = float(np.sqrt((noise**2).sum(axis=1).mean()))
    assert error.get_statistic(metrics.StatisticsType.rmse) == pytest.approx(rms, rel=1e-9)


@pytest.mark.parametrize("wanted", ["tmu", ["tum", "kml"], [3], [None]])
def test_an_unknown_trajectory_is_refused(wanted: Any) -> None:
    with pytest.raises(ConfigurationError, match="trajectories: must be tum or mcap, got"):
        path_files.check(wanted)


def test_kinds_are_each_once_and_in_order() -> None:
    assert path_files.check(["mcap", "tum", "mcap"]) == ("tum", "mcap")
    assert path_files.check("mcap") == ("mcap",)
    assert path_files.check(()) == ()


def test_without_its_package_mcap_is_refused_in_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mcap", None)
    with pytest.raises(ConfigurationError) as caught:
        path_files.check(["tum", "mcap"])
    assert "pip install 'sblcosim[mcap]'" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert path_files.check("tum") == ("tum",)


def test_shapes_of_a_path_must_fit() -> None:
    with pytest.raises(ConfigurationError, match=r"path of ekf: covariance must have shape"):
        path_of(np.zeros((4, 3)), covariance=np.zeros((4, 6, 6)))


def test_the_truth_has_its_own_instants_only() -> None:
    """Between them the record repeats it."""
    position = np.repeat(np.arange(15.0).reshape(5, 3), 2, axis=0)
    values = {name: np.zeros((10, 3)) for name in ("target.velocity", "platform.position")}
    beacons = dict.fromkeys(
        ("platform.beacon_position", "platform.reported_beacon_position"), np.zeros((10, 4, 3))
    )
    record = Record(
        np.arange(10) * 50_000_000, {"target.position": position, **values, **beacons},
        intervals_ns={"target": 100_000_000},
    )
    path = of_truth(of_record(record))
    np.testing.assert_array_equal(path.time_ns, np.arange(5) * 100_000_000)
    np.testing.assert_array_equal(path.position, position[::2])


def test_a_truth_without_velocity_is_a_path(tmp_path: Path) -> None:
    truth = Truth(time_ns=np.arange(3) * 10**9, position=np.arange(9.0).reshape(3, 3))
    path = of_truth(truth)
    written(tmp_path, path)
    check("odometry", tmp_path, [path])
    assert repr(path) == "<DiverPath of truth: 3 points>"
    assert of_kml(tmp_path, ORIGIN)
