"""A run as it happened: an animation of any shape, in about ten seconds, or a sentence why not."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import sblcosim
from drawn_texts import spoiled_texts
from matplotlib.animation import FFMpegWriter
from PIL import Image
from sblcosim import ConfigurationError, Result, manifests
from sblcosim.cli import app
from sblcosim.data.record import Record
from sblcosim.results.figures import animation, drawing
from seams import Seam
from shapes import SHAPES, run_of
from synthetic_record import BEACONS, make_record, track
from typer.testing import CliRunner

DRAWN = ("three_seconds", "ten_hours", "straight_east_many", "lost", "rest_below", "buoys")


def _seconds(file: Path) -> float:
    with Image.open(file) as image:
        total_ms = 0
        for number in range(image.n_frames):  # type: ignore[attr-defined]
            image.seek(number)
            total_ms += image.info["duration"]
    return total_ms / 1000


@pytest.fixture(scope="module")
def result() -> Result:
    return sblcosim.run("paper-scenario-1", overrides={"time.duration_s": 5.0})


@pytest.fixture
def without_ffmpeg(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(FFMpegWriter, "isAvailable", staticmethod(lambda: False))


@pytest.fixture
def few(seam: Seam) -> None:
    """Four frames: a hundred of them take ten seconds of processor time to draw."""
    seam.tuned(frames=4)


@pytest.mark.slow
@pytest.mark.parametrize("name", DRAWN)
def test_any_run_takes_ten_seconds_and_fits_into_a_talk(name: str, tmp_path: Path) -> None:
    record, tracks = run_of(SHAPES[name])
    file = tmp_path / "run.gif"
    animation.write(record, tracks, file)
    assert _seconds(file) == pytest.approx(10, abs=1.5)
    assert file.stat().st_size < 5e6
    with Image.open(file) as image:
        first = image.convert("RGB").tobytes()
        image.seek(image.n_frames - 1)  # type: ignore[attr-defined]
        assert image.convert("RGB").tobytes() != first


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize(
    "name",
    [*DRAWN, *(pytest.param(it, marks=pytest.mark.slow) for it in SHAPES if it not in DRAWN)],
)
def test_any_shape_of_run_is_drawn(name: str, tmp_path: Path) -> None:
    record, tracks = run_of(SHAPES[name])
    file = tmp_path / "run.gif"
    animation.write(record, tracks, file)
    assert _seconds(file) == pytest.approx(4 / animation.PER_SECOND)
    assert file.stat().st_size < 5e6 * 4 / 100


def test_the_curves_grow_and_end_with_the_whole_run() -> None:
    record, tracks = run_of(SHAPES["straight_east_95_m"])
    assert animation.FRAMES / animation.PER_SECOND == 10
    with animation.use("light") as look:
        scene = animation.Scene(record, tracks, look)
        ground = scene.figure.axes[0]
        lines = {line.get_label(): line for line in ground.get_lines()}
        sizes = []
        for time_s in scene.times_s[[0, 50, -1]]:
            scene.show(float(time_s))
            sizes.append(len(lines["ekf"].get_xdata()))
    assert sizes[0] <= sizes[1] < sizes[2] == len(tracks["ekf"])
    assert lines["true path"].get_xdata()[-1] == pytest.approx(50.0)


def swaying() -> Record:
    """A run of 10 s, from 50 s on, whose beacons move to the east at 0.4 m/s."""
    record = make_record({"ekf": np.array([[1.0, -2.0, 0.5]]), "raw": np.array([[0.5, 3.0, 1.0]])})
    beacons = record.values["platform.beacon_position"].copy()
    beacons[:, :, 1] += 0.04 * np.arange(101)[:, None]
    later = {name: record.values[name] + 50.0 for name in ("ekf.epoch", "raw.epoch")}
    return Record(
        record.time_ns + 50 * 10**9, record.values | later | {"platform.beacon_position": beacons}
    )


@pytest.mark.parametrize(("time_s", "row", "title"), [
    (50.0, 0, "50.0 s"), (53.2, 32, "53.2 s"), (53.27, 32, "53.3 s"), (60.0, 100, "60.0 s"),
])  # fmt: skip
def test_a_frame_has_what_is_known_by_then(time_s: float, row: int, title: str) -> None:
    """Path, estimates and errors up to this time, and the diver and the beacons at it."""
    record = swaying()
    tracks = {"ekf": track(record, "ekf"), "raw": track(record, "raw")}
    with animation.use("light") as look:
        scene = animation.Scene(record, tracks, look)
        assert scene.times_s[[0, -1]].tolist() == [50, 60]
        scene.show(time_s)
    ground, errors = scene.figure.axes
    lines = {line.get_label(): line.get_xydata() for line in ground.lines}
    path = np.column_stack([np.full(row + 1, 10.0), 0.05 * np.arange(row + 1)])
    np.testing.assert_allclose(lines["true path"], path)
    known = int((tracks["ekf"]["epoch_s"] <= time_s + 1e-9).sum())
    assert known == min(row, 99)
    times = 50 + 0.1 * np.arange(1, known + 1)
    for name, (north, east, depth) in {"ekf": (1, -2, 0.5), "raw": (0.5, 3, 1)}.items():
        expected = np.column_stack([np.full(known, 10.0 + east), 0.5 * (times - 50) + north])
        np.testing.assert_allclose(lines[name], expected)
        (curve,) = (line for line in errors.lines if line.get_label() == name)
        total = np.sqrt(north**2 + east**2 + depth**2)
        np.testing.assert_allclose(curve.get_xydata(), np.column_stack([times, total + 0 * times]))
    (diver,) = (line for line in ground.lines if line.get_marker() == "o")
    assert diver.get_xydata().tolist() == [pytest.approx(path[-1])]
    assert (diver.get_markersize(), diver.get_markerfacecolor()) == (7, look.paper)
    arms = [line for line in ground.lines if line.get_marker() == "^"]
    assert [line.get_label() == "beacons" for line in arms] == [True, False, False, False]
    for line, (north, east, _) in zip(arms, BEACONS, strict=True):
        np.testing.assert_allclose(
            line.get_xydata(), [[0.04 * row, 0], [east + 0.04 * row, north]], atol=1e-12
        )
        assert (line.get_markevery(), line.get_linestyle()) == ([-1], "-")
        assert line.get_markersize() == 5
    (now,) = (line for line in errors.lines if len({*line.get_xdata()}) == 1 and
              [*line.get_ydata()] == [0, 1])  # fmt: skip
    assert [*now.get_xdata()] == [time_s, time_s]
    assert errors.get_title("right") == title


def test_map_and_errors_of_a_frame_have_their_limits_and_places() -> None:
    record = swaying()
    tracks = {"ekf": track(record, "ekf")}
    with animation.use("light") as look:
        scene = animation.Scene(record, tracks, look)
    assert scene.figure.get_size_inches().tolist() == [8.0, 4.4]
    ground, errors = scene.figure.axes
    assert (ground.get_xlabel(), ground.get_ylabel()) == ("East y [m]", "North x [m]")
    assert errors.get_ylabel() == "Total error [m]"
    assert errors.get_ylim() == pytest.approx((0, 1.1 * np.sqrt(5.25)))
    assert errors.get_xlim() == pytest.approx((49.9, 60.1))
    # From the western beacon, on the average over the run, to the path; and from -3 m to the ends.
    place = ground.get_position()
    wide, high = 8 * place.width, 4.4 * place.height
    (west, east), (south, north) = ground.get_xlim(), ground.get_ylim()
    assert (east - west) / wide == pytest.approx((north - south) / high)
    assert (east + west) / 2 == pytest.approx((-1 + 10) / 2)
    assert (south + north) / 2 == pytest.approx((-3 + 0.5 * 9.9 + 1) / 2)
    assert east - west == pytest.approx(1.12 * 11)
    # The columns are equal, with 0.22 of one between them.
    column = (0.985 - 0.09) / 2.22
    assert (place.x0, place.x1) == pytest.approx((0.09, 0.09 + column))
    assert (place.y0, place.y1) == pytest.approx((0.12, 0.87))
    other = errors.get_position()
    assert (other.x0, other.x1) == pytest.approx((0.985 - column, 0.985))
    behind = ground.lines[0]
    np.testing.assert_allclose(behind.get_xydata(), record.values["target.position"][:, [1, 0]])
    assert (behind.get_color(), behind.get_linewidth()) == (look.grid, 1.2)
    (legend,) = scene.figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["true path", "beacons", "ekf"]


def test_long_numbers_move_the_axes_of_a_frame_to_the_right() -> None:
    record = swaying()
    far = record.values["target.position"] + [2.0e5, 0.0, 0.0]
    beacons = record.values["platform.beacon_position"] + [2.0e5, 0.0, 0.0]
    record = Record(record.time_ns, record.values | {
        "target.position": far, "platform.beacon_position": beacons,
    })  # fmt: skip
    with animation.use("light") as look:
        scene = animation.Scene(record, {"ekf": track(record, "ekf")}, look)
    place = scene.figure.axes[0].get_position(original=True)
    longest = drawing.inches("200000")
    assert place.x0 == pytest.approx(0.09 + (longest - 0.37) / 8, abs=1e-3)
    assert place.x1 == pytest.approx(0.09 + (0.985 - 0.09) / 2.22)


@pytest.mark.parametrize(("rows", "shown"), [(1500, 1500), (1501, 751), (3200, 1067)])
def test_a_curve_of_many_points_is_thinned_and_keeps_its_last(rows: int, shown: int) -> None:
    time_ns = np.arange(rows) * 10**9
    position = np.column_stack([np.arange(float(rows)), np.zeros(rows), np.full(rows, 5.0)])
    beacons = np.tile(BEACONS, (rows, 1, 1))
    values = {"target.position": position, "platform.beacon_position": beacons,
              "platform.reported_beacon_position": beacons}  # fmt: skip
    table = pd.DataFrame({
        "epoch_s": time_ns / 1e9, "x_m": position[:, 0], "y_m": 1.0, "error_x_m": 0.1,
        "error_y_m": 0.1, "error_total_m": 0.5,
    })
    with animation.use("light") as look:
        scene = animation.Scene(Record(time_ns, values), {"mine": table}, look)
        scene.show(float(rows))
    for line in scene.figure.axes[0].lines:
        if line.get_label() in ("true path", "mine"):
            norths = line.get_ydata()
            assert len(norths) == shown
            assert norths[-1] == rows - 1
            assert np.ptp(np.diff(norths)) == 0
    unit = "min" if rows < 10800 else "h"
    seconds = 60
    assert scene.figure.axes[1].get_title("right") == f"{rows / seconds:.2f} {unit}"


@pytest.mark.parametrize("receivers", [0, 2, 12])
def test_errors_above_the_figure_are_named_or_said_to_be_there(receivers: int) -> None:
    record, tracks = run_of(SHAPES["straight_east_95_m"])
    ekf = tracks["ekf"]
    wild = ekf.assign(error_total_m=np.where(np.arange(len(ekf)) < 3, 1e4, ekf.error_total_m))
    more = {f"wild {i}": wild for i in range(receivers)}
    with animation.use("light") as look:
        scene = animation.Scene(record, {"ekf": ekf, **more}, look)
        said = scene.figure.axes[1].get_title(loc="left")
        scene.figure.draw_without_rendering()
    if receivers == 12:
        assert said == "some errors are above"
    else:
        assert all(f"wild {i} (3\u00a0of\u00a0{len(ekf)})" in said for i in range(receivers))
        assert said.startswith("above: ") == bool(receivers)


@pytest.mark.parametrize(
    "name", ["north_2_km", "far_coordinates", "lost", "line_2_m", "straight_many", "runs_away"]
)
def test_no_text_of_a_frame_is_cut_off_or_lies_on_other_text(name: str) -> None:
    record, tracks = run_of(SHAPES[name])
    with animation.use("light") as look:
        scene = animation.Scene(record, tracks, look)
        scene.show(float(scene.times_s[-1]))
        assert spoiled_texts(scene.figure) == []


def test_raw_fixes_are_several_dots_in_the_legend() -> None:
    record, tracks = run_of(SHAPES["straight_east_95_m"])
    with animation.use("light") as look:
        (legend,) = animation.Scene(record, tracks, look).figure.legends
    names = [text.get_text() for text in legend.get_texts()]
    assert len(legend.legend_handles[names.index("raw")].get_xdata()) == 3


@pytest.mark.usefixtures("few")
def test_equal_runs_give_equal_bytes(tmp_path: Path) -> None:
    record, tracks = run_of(SHAPES["three_seconds"])
    first, second = tmp_path / "a.gif", tmp_path / "b.gif"
    animation.write(record, tracks, first)
    animation.write(record, tracks, second)
    assert first.read_bytes() == second.read_bytes()
    animation.write(record, tracks, second, "dark")
    assert first.read_bytes() != second.read_bytes()


@pytest.mark.usefixtures("without_ffmpeg")
@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("run.png", r"must be a file \.mp4 or \.gif, got .*run\.png"),
        ("run", r"must be a file \.mp4 or \.gif, got .*run"),
        ("run.mp4", r"must be a file \.gif without ffmpeg, got .*run\.mp4"),
        ("taken/run.gif",
         r"must be a file that can be written, got .*run\.gif \(Not a directory\)"),
    ],
)
def test_what_cannot_be_written_is_said_and_nothing_is_left(
    name: str, why: str, result: Result, tmp_path: Path
) -> None:
    taken = tmp_path / "taken"
    taken.touch()
    with pytest.raises(ConfigurationError, match=f"animate: {why}"):
        result.animate(tmp_path / name)
    assert list(tmp_path.iterdir()) == [taken]


def test_a_run_without_receivers_has_no_animation(tmp_path: Path) -> None:
    record, _ = run_of(SHAPES["three_seconds"])
    with pytest.raises(ConfigurationError, match="animate: the run must have a receiver"):
        animation.write(record, {}, tmp_path / "run.gif")


@pytest.mark.usefixtures("without_ffmpeg", "few")
def test_the_command_adds_the_animation_to_the_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    short = ["run", "paper-scenario-1", "--set", "time.duration_s=5", "--no-figures"]
    ran = CliRunner().invoke(app, [*short, "--animate", "--out", "talk"])
    assert ran.exit_code == 0, ran.output
    assert _seconds(Path("talk/animation.gif")) == pytest.approx(4 / animation.PER_SECOND)
    assert "animation.gif" in json.loads(Path("talk/manifest.json").read_text())["files"]
    many = CliRunner().invoke(app, [*short, "--animate", "--runs", "2", "--out", "many"])
    assert many.exit_code == 2
    assert "--animate: must be given without --runs" in many.output
    assert not Path("many").exists()


def test_what_an_equal_run_has_drawn_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    short = ["run", "paper-scenario-1", "--set", "time.duration_s=5", "--out", "talk"]

    def run(*more: str) -> set[str]:
        done = CliRunner().invoke(app, [*short, *more])
        assert done.exit_code == 0, done.output
        listed = json.loads(Path("talk/manifest.json").read_text())["files"]
        assert {*listed, "manifest.json"} == {path.name for path in Path("talk").iterdir()}
        return {*listed}

    bare = run("--no-figures", "--log")
    Path("talk/path.svg").write_text("drawn")
    Path("talk/errors.svg").write_text("drawn")
    content = json.loads(Path("talk/manifest.json").read_text())
    del content["sha256"]
    content["files"] += ["path.svg", "errors.svg"]
    content["hashes"] |= {n: manifests.hashes(Path("talk"))[n] for n in ("path.svg", "errors.svg")}
    Path("talk/manifest.json").write_bytes(manifests.sealed(content))
    assert run("--no-figures") == bare | {"path.svg", "errors.svg"}
    Path("talk/path.svg").write_text("changed since")
    assert run("--no-figures") == bare | {"errors.svg"}
    assert run("--no-figures", "--seed", "9", "--force") == bare - {"log"}
