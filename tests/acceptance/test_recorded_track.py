"""A dive of 10,000 recorded points with stops, from its files to the files of the run."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import geojson
import gpxpy
import numpy as np
import pymap3d
import pytest
import sblcosim
from sblcosim.fmus.build.factory import build
from sblcosim.fmus.conformance.kit import examine
from sblcosim.results.result import Result
from sblcosim.scenario.scenario import load
from sblcosim.tracks.place import Origin

POINTS, STEP = 10_000, 0.1
TOLERANCE = 0.05
PLACE = Origin(42.5, 14.2, 44.0)
START = datetime(2024, 5, 1, 10, tzinfo=UTC)
SHORT = {"time.duration_s": 100.0, "receiver.type": "ekf"}


def dive(seed: int = 20240501) -> tuple[Any, Any]:
    """Times [s], and latitude [°], longitude [°], depth [m]."""
    numbers = np.random.default_rng(seed)
    velocity = np.zeros((POINTS, 3))
    for i in range(1, POINTS):
        velocity[i] = 0.98 * velocity[i - 1] + numbers.normal(0, [0.06, 0.06, 0.02])
    for first in (300, *numbers.integers(0, POINTS, 20)):
        velocity[first : first + 80] = 0
    ned = np.cumsum(velocity * STEP, axis=0) + np.array([8.0, -5.0, 12.0])
    return np.arange(POINTS) * STEP, PLACE.geographic(ned)


def csv_of(times: Any, points: Any) -> str:
    rows = [
        f"{t:.1f},{a!r},{o!r},{d!r}" for t, (a, o, d) in zip(times, points.tolist(), strict=True)
    ]
    return "\n".join(("time_s,latitude_deg,longitude_deg,depth_m", *rows, ""))


def gpx_of(times: Any, points: Any) -> str:
    rows = [
        f'<trkpt lat="{a!r}" lon="{o!r}"><ele>{-d!r}</ele>'
        f"<time>{(START + timedelta(milliseconds=round(1000 * t))).isoformat()}</time></trkpt>"
        for t, (a, o, d) in zip(times, points.tolist(), strict=True)
    ]
    return (
        '<gpx version="1.1" creator="test" xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>'
        + "\n".join(rows) + "</trkseg></trk></gpx>"
    )  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dive")
    times, points = dive()
    (folder / "dive.csv").write_text(csv_of(times, points))
    (folder / "dive.gpx").write_text(gpx_of(times, points))
    for kind in ("csv", "gpx"):
        (folder / f"{kind}.toml").write_text(
            f'[target]\ntrajectory = "file"\ntrack_file = "dive.{kind}"\n'
            f"track_tolerance_m = {TOLERANCE}\n"
            f"[place]\nlatitude_deg = {PLACE.latitude_deg}\nlongitude_deg = {PLACE.longitude_deg}\n"
            f"height_m = {PLACE.height_m}\n"
            '[platform]\nbeaufort = 2\n[acoustics]\nrange_std_m = 0.1\n'
        )  # fmt: skip
    return folder


@pytest.fixture(scope="module")
def run(folder: Path) -> Result:
    return sblcosim.run(folder / "csv.toml", overrides=SHORT)  # type: ignore[no-any-return]


def same(one: Any, other: Any) -> None:
    assert one.record.values.keys() == other.record.values.keys()
    for name, values in one.record.values.items():
        np.testing.assert_array_equal(values, other.record.values[name], err_msg=name)


@pytest.mark.slow
def test_the_diver_stays_within_the_tolerance_of_the_whole_track(folder: Path) -> None:
    whole = sblcosim.run(folder / "csv.toml", overrides={"receiver.type": "ekf"})
    times, points = dive()
    track = PLACE.local(points)
    at, position = whole.record.time_ns / 1e9, whole.record.values["target.position"]
    np.testing.assert_allclose(at, times, atol=1e-9)
    line = np.stack([np.interp(at, times, axis) for axis in track.T], axis=1)
    assert np.linalg.norm(position - line, axis=1).max() <= TOLERANCE + 1e-9
    target = load(folder / "csv.toml").target
    kept = np.reshape(target.track_m, (-1, 3))
    assert 100 < len(kept) < 4096
    own = np.isin(target.track_time_s, at)
    found = position[np.searchsorted(at, np.array(target.track_time_s)[own])]
    assert own.sum() > 0.9 * len(kept)
    np.testing.assert_allclose(found, kept[own], rtol=0, atol=1e-7)
    velocity = whole.record.values["target.velocity"]
    resting = (np.diff(track, axis=0) == 0).all(axis=1)
    assert (velocity[:-1][resting] == 0).all(axis=1).mean() > 0.9
    assert f"of {POINTS:,} points" in whole.remarks[0]


def test_gpx_gives_the_same_record_as_a_table(folder: Path, run: Result) -> None:
    same(run, sblcosim.run(folder / "gpx.toml", overrides=SHORT))


@pytest.mark.parametrize("master", ["python", "lanes"])
def test_all_masters_give_the_same_record(folder: Path, run: Result, master: str) -> None:
    same(run, sblcosim.run(folder / "csv.toml", overrides=SHORT, master=master))


def test_fmi_3_gives_the_same_record(folder: Path, run: Result) -> None:
    same(run, sblcosim.run(folder / "csv.toml", overrides=SHORT, fmi=3))


@pytest.mark.parametrize("bake", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_package_needs_no_file_of_the_track(
    folder: Path, tmp_path: Path, run: Result, bake: bool
) -> None:
    package = sblcosim.export_ssp(
        folder / "csv.toml", tmp_path / "dive.ssp", overrides=SHORT, bake=bake
    )
    again = sblcosim.run(package)
    for name, values in again.record.values.items():
        np.testing.assert_array_equal(values, run.record.values[name], err_msg=name)


def test_the_folder_of_a_run_repeats_it_and_has_its_paths_for_maps(
    folder: Path, tmp_path: Path, run: Result
) -> None:
    saved = run.save(tmp_path / "run", figures=False)
    same(run, sblcosim.run(saved / "scenario.toml"))
    assert "track_file" not in (saved / "scenario.toml").read_text()
    files = json.loads((saved / "manifest.json").read_text())["files"]
    assert {"path.geojson", "path.gpx"} <= set(files)
    truth = run.record.values["target.position"]
    estimates = run.tracks["ekf"][["x_m", "y_m", "z_m"]].to_numpy()
    origin = PLACE.latitude_deg, PLACE.longitude_deg, PLACE.height_m

    text = (saved / "path.geojson").read_text()
    assert geojson.loads(text).is_valid
    lines = {f["properties"]["name"]: f for f in json.loads(text)["features"]}
    assert set(lines) == {"truth", "ekf", "raw"}
    for name, expected in (("truth", truth), ("ekf", estimates)):
        longitude, latitude, height = np.array(lines[name]["geometry"]["coordinates"]).T
        ned = np.stack(pymap3d.geodetic2ned(latitude, longitude, height, *origin), axis=1)
        np.testing.assert_allclose(ned, expected, atol=1e-6)
    seconds = lines["truth"]["properties"]["time_s"]
    np.testing.assert_array_equal(seconds, run.record.time_ns / 1e9)

    document = gpxpy.parse((saved / "path.gpx").read_text())
    tracks = {t.name: t.segments[0].points for t in document.tracks}
    assert set(tracks) == {"truth", "ekf", "raw"}
    for name, expected in (("truth", truth), ("ekf", estimates)):
        read = np.array([[p.latitude, p.longitude, p.elevation + origin[2]] for p in tracks[name]])
        ned = np.stack(pymap3d.geodetic2ned(*read.T, *origin), axis=1)
        np.testing.assert_allclose(ned, expected, atol=1e-6)
    seconds = [p.time.timestamp() for p in tracks["truth"] if p.time is not None]
    np.testing.assert_allclose(seconds, run.record.time_ns / 1e9, atol=1e-6)


def test_the_path_of_a_run_is_a_track_for_another(tmp_path: Path, run: Result) -> None:
    run.save(tmp_path / "run", figures=False)
    (tmp_path / "again.toml").write_text(
        '[target]\ntrajectory = "file"\ntrack_file = "run/path.gpx"\ntrack_tolerance_m = 0.01\n'
        f"[place]\nlatitude_deg = 42.5\nlongitude_deg = 14.2\nheight_m = {PLACE.height_m}\n"
    )
    again = sblcosim.run(tmp_path / "again.toml", overrides=SHORT)
    np.testing.assert_allclose(
        again.record.values["target.position"], run.record.values["target.position"], atol=0.011
    )
    assert "left out: ekf, raw, as they begin before" in again.remarks[0]


def test_without_a_place_there_are_no_paths_for_maps(tmp_path: Path) -> None:
    result = sblcosim.run("paper-scenario-1", overrides={"time.duration_s": 5.0})
    names = {file.name for file in result.save(tmp_path / "run", figures=False).iterdir()}
    assert not names & {"path.geojson", "path.gpx"}


@pytest.mark.slow
@pytest.mark.parametrize("fmi", [2, 3])
def test_a_target_for_more_points_is_an_fmu_like_all_others(fmi: Any) -> None:
    report = examine(build("target", fmi, track_points=256))
    assert report.ok, str(report)
