"""A run as it happened: an animation of any shape, in about ten seconds, or a sentence why not."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import sblcosim
from drawn_texts import spoiled_texts
from matplotlib.animation import FFMpegWriter
from PIL import Image
from sblcosim import ConfigurationError, Result, manifests
from sblcosim.cli import app
from sblcosim.results.figures import animation
from seams import Seam
from shapes import SHAPES, run_of
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
