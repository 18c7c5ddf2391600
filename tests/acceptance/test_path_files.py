"""The paths of runs, smoothed runs and packages as files, from the command to other libraries."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sblcosim
import sblcosim.cli
from gpxpy import gpx
from path_files import EPOCH, MAPS, READERS, messages
from sblcosim.errors import ConfigurationError, NoEffectWarning
from sblcosim.paths.folder import TRAJECTORIES
from sblcosim.results.result import Result
from sblcosim.tracks.place import Origin
from typer.testing import CliRunner

ORIGIN = Origin(60.1, -5.2, 47.0)
PLACE = {
    "place.latitude_deg": ORIGIN.latitude_deg, "place.longitude_deg": ORIGIN.longitude_deg,
    "place.height_m": ORIGIN.height_m,
}
SHORT = {"time.duration_s": 60.0}
MAP_FILES = {"path.geojson", "path.gpx", "path.kml"}


@pytest.fixture(scope="module")
def run() -> Result:
    """A shipped scenario at a place."""
    return sblcosim.run("realistic-dive", ["coupled", "ekf"], PLACE | SHORT)


@pytest.fixture(scope="module")
def saved(run: Result, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("paths") / "run"
    return run.save(folder, figures=False, trajectories=TRAJECTORIES)


@pytest.fixture
def cli(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Any]:
    monkeypatch.chdir(tmp_path)
    return lambda *words: CliRunner().invoke(sblcosim.cli.app, [str(w) for w in words])


def names_in(folder: Path) -> set[str]:
    """The files of paths in a folder, which are all in its manifest."""
    found = {file.name for file in folder.glob("path*") if file.suffix not in (".png", ".svg")}
    assert found <= {*json.loads((folder / "manifest.json").read_text("utf-8"))["files"]}
    return found


@pytest.mark.parametrize("form", READERS)
def test_every_format_has_the_estimates_of_the_run(form: str, run: Result, saved: Path) -> None:
    found = READERS[form](saved, ORIGIN)
    assert set(found) == {"truth", "coupled", "ekf", "raw"}
    truth = run.record.values["target.position"]
    np.testing.assert_allclose(found["truth"][0], run.record.time_ns / 1e9, rtol=0, atol=1e-6)
    np.testing.assert_allclose(found["truth"][1], truth, rtol=0, atol=1.2e-5)
    for name, table in run.tracks.items():
        seconds, ned = found[name]
        np.testing.assert_allclose(seconds, table["epoch_s"], rtol=0, atol=1.01e-6)
        np.testing.assert_allclose(ned, table[["x_m", "y_m", "z_m"]], rtol=0, atol=1.2e-5)


def test_odometry_has_the_claimed_errors_of_the_run(run: Result, saved: Path) -> None:
    own = messages(saved)["/coupled/odometry"]
    table = run.tracks["coupled"]
    std = np.sqrt([np.diag(np.reshape(m.pose.covariance, (6, 6)))[[1, 0, 2]] for _, m in own])
    np.testing.assert_allclose(std, table[["std_x_m", "std_y_m", "std_z_m"]], rtol=1e-6)
    speed = [(v.y, v.x, -v.z) for v in (m.twist.twist.linear for _, m in own)]
    estimates = run.record.estimates("coupled")
    np.testing.assert_array_equal(speed, estimates.velocity)


def test_evo_finds_the_rms_error_of_the_run(run: Result, saved: Path) -> None:
    from evo.core import metrics, sync
    from evo.tools import file_interface

    for name in run.tracks:
        files = (saved / f"path-{it}.tum" for it in ("truth", name))
        pair = sync.associate_trajectories(*map(file_interface.read_tum_trajectory_file, files))
        error = metrics.APE(metrics.PoseRelation.translation_part)
        error.process_data(pair)
        found = error.get_statistic(metrics.StatisticsType.rmse)
        assert found == pytest.approx(run.errors.rms_m[name, "absolute", "total"], rel=1e-9)


def test_geojson_and_gpx_of_a_run_are_made_from_its_record_and_tables(
    run: Result, saved: Path
) -> None:
    """Byte by byte, and in the simplest way: all instants, and all rows of the estimates."""
    truth = np.asarray(run.record.values["target.position"], float)
    paths = [("truth", run.record.time_ns / 10**9, ORIGIN.geographic(truth))]
    for name, table in run.tracks.items():
        position = table[["x_m", "y_m", "z_m"]].to_numpy(float)
        paths.append((name, table["epoch_s"].to_numpy(float), ORIGIN.geographic(position)))
    features, document = [], gpx.GPX()
    document.creator, document.name = "sblcosim", run.title
    document.description = (
        f"The run starts at {EPOCH.isoformat()}; elevation is minus the depth"
    )
    for name, times, rows in paths:
        latitude, longitude, depth = rows.T
        points = np.stack([longitude, latitude, ORIGIN.height_m - depth], axis=1).tolist()
        features.append({
            "type": "Feature", "properties": {"name": name, "time_s": times.tolist()},
            "geometry": {"type": "LineString", "coordinates": points},
        })  # fmt: skip
        track, segment = gpx.GPXTrack(name), gpx.GPXTrackSegment()
        document.tracks.append(track)
        track.segments.append(segment)
        segment.points = [
            gpx.GPXTrackPoint(a, o, -d, EPOCH + timedelta(seconds=time))
            for time, (a, o, d) in zip(times.tolist(), rows.tolist(), strict=True)
        ]
    content = {"type": "FeatureCollection", "features": features}
    assert (saved / "path.geojson").read_text("utf-8") == json.dumps(content) + "\n"
    assert (saved / "path.gpx").read_text("utf-8") == document.to_xml()


def test_smooth_adds_its_path(saved: Path, tmp_path: Path, cli: Callable[..., Any]) -> None:
    done = cli("smooth", saved, "--no-figures", "--trajectories", "tum", "--out", "smoothed")
    assert done.exit_code == 0, done.output
    folder = tmp_path / "smoothed"
    assert names_in(folder) == MAP_FILES | {
        f"path-{name}.tum" for name in ("truth", "coupled", "ekf", "raw", "smoother")
    }
    table = sblcosim.smooth(saved).result.tracks["smoother"]
    for form in (*MAPS, "tum"):
        seconds, ned = READERS[form](folder, ORIGIN)["smoother"]
        np.testing.assert_allclose(seconds, table["epoch_s"], rtol=0, atol=1.01e-6)
        np.testing.assert_allclose(ned, table[["x_m", "y_m", "z_m"]], rtol=0, atol=1.2e-5)


def test_the_command_writes_what_is_asked_for(tmp_path: Path, cli: Callable[..., Any]) -> None:
    words = ("run", "paper-scenario-1", "--set", "time.duration_s=5", "--no-figures", "--out")
    tum = {"path-truth.tum", "path-ekf.tum", "path-raw.tum"}
    place = [w for key, value in PLACE.items() for w in ("--set", f"{key}={value}")]
    for number, (options, expected) in enumerate((
        ([], set()), (place, MAP_FILES), (["--trajectories", "tum"], tum),
        (["--trajectories", "mcap", *place], MAP_FILES | {"path.mcap"}),
        (["--trajectories", "mcap", "--trajectories", "tum"], tum | {"path.mcap"}),
    )):  # fmt: skip
        done = cli(*words, f"out{number}", *options)
        assert done.exit_code == 0, done.output
        assert names_in(tmp_path / f"out{number}") == expected


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--trajectories", "kml"], "error: --trajectories: must be tum or mcap, got 'kml'"),
        (["--trajectories", "tum", "--runs", "2"],
         "error: --trajectories: must be given without --runs"),
    ],
)  # fmt: skip
def test_what_there_is_not_is_refused_before_the_run(
    options: list[str], said: str, tmp_path: Path, cli: Callable[..., Any]
) -> None:
    done = cli("run", "paper-scenario-1", *options)
    assert done.exit_code == 2
    assert done.stderr.splitlines() == [said]
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("words", [["run", "paper-scenario-1"], ["smooth", "nowhere"]])
def test_without_the_extra_mcap_is_refused_before_the_run(words: list[str], tmp_path: Path) -> None:
    code = (
        "import sys\nsys.modules['mcap'] = None\nfrom sblcosim import api, cli\n"
        "def run(*_, **__): raise AssertionError('it ran')\napi.run = run\ncli.main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *words, "--trajectories", "mcap"], cwd=tmp_path,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        "error: --trajectories: must have the package mcap for 'mcap', got none; "
        "pip install 'sblcosim[mcap]'"
    ]
    assert not [*tmp_path.iterdir()]


def test_save_refuses_before_it_writes(run: Result, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="trajectories: must be tum or mcap"):
        run.save(tmp_path / "run", trajectories=["tum", "bag"])
    assert not [*tmp_path.iterdir()]


def test_a_package_has_trajectories_and_one_without_receivers_says_that_it_has_none(
    tmp_path: Path,
) -> None:
    package = sblcosim.export_ssp("paper-scenario-1", tmp_path / "a.ssp", overrides=SHORT)
    folder = sblcosim.run(package).save(tmp_path / "run", figures=False, trajectories="tum")
    assert names_in(folder) == {"path-truth.tum", "path-ekf.tum"}
    result = sblcosim.run(package)
    from sblcosim.packages.recording import Recording

    recording = Recording(result.description, result.record)
    with pytest.warns(NoEffectWarning, match="trajectories: have no effect"):
        folder = recording.save(tmp_path / "recording", trajectories="mcap")
    assert names_in(folder) == set()
