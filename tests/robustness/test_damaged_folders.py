"""A flipped bit in any file of any folder that is read again is noticed, and the file is named.

Other bits: ``SBLCOSIM_FLIPS_SEED=7``, more of them: ``SBLCOSIM_FLIPS=100`` before it.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from quick import one_in
from sblcosim import artifacts, manifests
from sblcosim.cli.common.app import app
from sblcosim.errors import ConfigurationError, ConfigurationWarning, DamageWarning
from sblcosim.estimation.folder import read_run
from sblcosim.logs.read import read_log
from sblcosim.study import store
from seams import Seam
from typer.testing import CliRunner

SEED = int(os.environ.get("SBLCOSIM_FLIPS_SEED", "1"))
FLIPS = int(os.environ.get("SBLCOSIM_FLIPS", "4"))
"""Bits of a file, and ten times as many of a manifest."""

STUDY = """
scenario = "paper-scenario-1"
replicates = 3
[fixed.time]
duration_s = 4.0
[factors.gps]
keys = ["platform.gps_horizontal_std_m"]
levels = [0.1, 3.5]
"""
QUESTION = """
scenario = "paper-scenario-1"
response = "total_rms_m"
limit = 1.0
share = 0.8
most_runs = 300
settling_time_s = 0.0
[fixed.time]
duration_s = 4.0
[choices.gps]
keys = ["platform.gps_horizontal_std_m"]
levels = [0.1, 3.5]
costs = [500, 20]
"""
_SHORT = ("paper-scenario-1", "--set", "time.duration_s=4")
_BARE = ("--no-figures",)
MADE = {
    "run": ("run", *_SHORT, "--receiver", "coupled", *_BARE),
    "smoothed": ("smooth", "run", *_BARE),
    "many": ("run", *_SHORT, "--runs", "3", *_BARE),
    "comparison": ("compare", *_SHORT, "--receiver", "ekf", "--receiver", "sequential",
                   "--runs", "4"),
    "budget": ("budget", *_SHORT, "--runs", "30", *_BARE),
    "map": ("map", "paper-scenario-1", "--area", "20x20", "--depth", "5", "--cells", "2",
            "--runs", "2", "--duration", "6", "--settling", "2", *_BARE),
    "calibration": ("calibrate", "--pings", "5"),
    "logged": ("run", "harbour-lbl", "--set", "time.duration_s=60", "--receiver", "sequential",
               "--log", "--trajectories", "tum", *_BARE),
    "contents": ("log", "logged/log", "--convert", *_BARE),
    "processed": ("process", "logged/log", *_BARE),
    "device": ("identify", "logged/log", *_BARE),
    "package": ("run", "paper-scenario-1.ssp", *_BARE),
    "analysis": ("analyse", "study"),
    "advice": ("advise", "study", "--costs", "costs.toml", "--limit", "9"),
    "question": ("require", "question.toml"),
}  # fmt: skip
"""The kinds of folders, and how each is made."""
KINDS = [*MADE, "many/typical", "question/answer"]
KINDS.remove("question")


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder of each kind."""
    place = tmp_path_factory.mktemp("results")
    (place / "study.toml").write_text(STUDY)
    (place / "question.toml").write_text(QUESTION)
    (place / "costs.toml").write_text("gps = [500, 20]\n")
    with pytest.MonkeyPatch.context() as patch, Seam() as seam:
        patch.chdir(place)
        seam.tuned(limiting_runs=40)
        command("export", "ssp", *_SHORT, "--receiver", "ekf", "--out", "paper-scenario-1.ssp")
        command("study", "study.toml", "--out", "study")
        for name, arguments in MADE.items():
            command(*arguments, "--out", name)
        yield place


@pytest.fixture
def own(results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seam: Seam) -> Path:
    """A copy that may be damaged."""
    place = Path(shutil.copytree(results, tmp_path / "own"))
    monkeypatch.chdir(place)
    seam.tuned(limiting_runs=40)
    return place


def command(*arguments: str, code: int | None = None) -> str:
    """What a command says on stderr."""
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code in ((0, 1) if code is None else (code,)), (arguments, done.stderr)
    assert "this must not happen" not in done.stderr
    return done.stderr


def flipped(path: Path, count: int) -> Iterator[int]:
    """The file with one bit flipped, again and again; at the end it is as before."""
    good = path.read_bytes()
    bits = range(8 * len(good))
    for bit in random.Random(f"{SEED} {path.name}").sample(bits, min(count, len(bits))):
        bad = bytearray(good)
        bad[bit // 8] ^= 1 << bit % 8
        path.write_bytes(bad)
        yield bit
    path.write_bytes(good)


def noticed(read: Callable[[Path], Any], folder: Path) -> list[str]:
    """What is said when a folder is read."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            read(folder)
        except ConfigurationError as error:
            return [str(error)]
    ours = (ConfigurationWarning, DamageWarning)
    return [str(w.message) for w in caught if issubclass(w.category, ours)]


def all_are_noticed(
    read: Callable[[Path], Any], folder: Path, before: tuple[str, ...] = ()
) -> int:
    """Flip bits of each file; the one line that is said begins with its name. How many there were.

    Parameters
    ----------
    before
        What is said of the sound folder.
    """
    assert noticed(read, folder) == [*before]
    count = 0
    for path in [p for p in sorted(folder.rglob("*")) if p.is_file()]:
        for bit in flipped(path, FLIPS * (10 if path.name == manifests.MANIFEST else 1)):
            said = [line for line in noticed(read, folder) if line not in before]
            assert len(said) == 1, (path, bit, said)
            assert said[0].startswith(f"{path}: must be as it was written, got "), said
            count += 1
    return count


@one_in(2)
@pytest.mark.parametrize("kind", KINDS)
def test_every_flipped_bit_is_noticed_where_a_result_is_replaced(own: Path, kind: str) -> None:
    folder = own / kind
    then = "the folder is written anew"
    assert all_are_noticed(lambda path: manifests.tell(path, then), folder) > 40
    for _ in flipped(folder / "manifest.json", FLIPS):
        with pytest.raises(ConfigurationError, match=r"manifest\.json: must be as it was written"):
            artifacts.check(folder)


@pytest.mark.parametrize("kind", ["run", "many/typical", "smoothed"])
def test_every_flipped_bit_is_noticed_where_a_run_is_read(own: Path, kind: str) -> None:
    folder, edited = own / kind, folder_edited(own / kind)
    assert noticed(read_run, folder) == []
    paths = sorted(folder.iterdir())
    assert {manifests.MANIFEST, "scenario.toml"} < {path.name for path in paths}
    for path in paths:
        for bit in flipped(path, FLIPS * (10 if path.name == manifests.MANIFEST else 1)):
            (said,) = noticed(read_run, folder)
            must = edited if path.name == "scenario.toml" else (
                f"{path}: must be as it was written, got ",
            )
            assert said.startswith(must), (bit, said)


def folder_edited(folder: Path) -> tuple[str, ...]:
    """How what is said of a scenario begins that is not as it was written."""
    path = folder / "scenario.toml"
    return f"{path}: was edited or damaged after the run; ", f"{path}: must be unchanged, or e"


@pytest.mark.parametrize("kind", ["logged/log", "contents/log"])
def test_every_flipped_bit_is_noticed_where_a_log_is_read(own: Path, kind: str) -> None:
    folder = own / kind

    def remarks() -> list[str]:
        try:
            return [it for it in read_log(folder).remarks if it not in before]
        except ConfigurationError as error:
            return [str(error)]

    before: list[str] = []
    before = remarks()
    names = {path.name for path in folder.iterdir()}
    assert {"receptions.csv", "depth.csv", "meta.toml", "scenario.toml", "manifest.json"} <= names
    for path in sorted(folder.iterdir()):
        for bit in flipped(path, FLIPS * (10 if path.name == manifests.MANIFEST else 1)):
            said = remarks()
            assert any(path.name in line for line in said), (path, bit, said)


def test_every_flipped_bit_is_noticed_where_a_study_is_read(own: Path) -> None:
    folder = own / "study"
    assert noticed(store.table, folder) == []
    paths = [p for p in sorted(folder.rglob("*")) if p.is_file()]
    assert {"study.json", "runs.parquet"} <= {path.name for path in paths}
    for path in paths:
        for bit in flipped(path, 5 * FLIPS):
            (said,) = noticed(store.table, folder)
            assert said.startswith(f"{path}: must be "), (bit, said)


@pytest.mark.parametrize("kind", ["question", "comparison", "budget"])
def test_the_same_command_replaces_what_is_damaged_and_says_so(own: Path, kind: str) -> None:
    folder = own / kind / ("answer" if kind == "question" else "")
    path = random.Random(SEED).choice([p for p in folder.iterdir() if p.suffix != ".json"])
    good = path.read_bytes()
    next(flipped(path, 1))
    said = command(*MADE[kind], "--out", kind)
    assert f"{path}: must be as it was written, got other bytes; the folder is written anew" in said
    if path.suffix not in {".html", ".svg", ".png"}:  # which say how they were made
        assert path.read_bytes() == good
    next(flipped(folder / "manifest.json", 1))
    said = command(*MADE[kind], "--out", kind, code=2)
    assert len(said.splitlines()) == 1
    assert said.startswith(f"error: {folder / 'manifest.json'}: must be as it was written")


def test_a_default_folder_with_a_damaged_manifest_is_left_and_told_of(own: Path) -> None:
    command(*MADE["comparison"])
    next(flipped(own / "runs" / "comparison" / "manifest.json", 1))
    said = command(*MADE["comparison"])
    assert "runs/comparison/manifest.json: must be as it was written" in said
    assert (own / "runs" / "comparison-2" / "manifest.json").is_file()


@pytest.mark.parametrize(("line", "table"), [
    ("\nrange_std_m = ", "acoustics"), ("\n# range_std_m = ", "receiver"),
])  # fmt: skip
def test_a_scenario_that_was_edited_is_said_to_be_and_counts(
    own: Path, line: str, table: str
) -> None:
    path = own / "run" / "scenario.toml"
    before, _, after = path.read_text().partition(line)
    key = "\nrange_std_m = "
    path.write_text(f"{before}{key}0.5 # {after}")
    said = command("smooth", "run", "--out", "edited", *_BARE)
    assert said == (
        "warning: run/scenario.toml: was edited or damaged after the run; the smoother uses "
        f"its current content: {table}.range_std_m = 0.5 (was 0.1)\n"
    )
    errors = [(own / name / "errors.csv").read_text() for name in ("smoothed", "edited")]
    assert errors[0] != errors[1]
    for wrong, why in (("0.1x", "line "), ("-0.1", "must be ")):
        path.write_text(f"{before}{key}{wrong} # {after}")
        said = command("smooth", "run", "--out", "edited", *_BARE, code=2)
        assert len(said.splitlines()) == 1
        assert said.startswith("error: run/scenario.toml: must be unchanged, or edited")
        assert why in said


def aged(folder: Path) -> None:
    """A folder as it was before there were hashes."""
    for path in folder.rglob("manifest.json"):
        content = json.loads(path.read_text())
        del content["hashes"], content["sha256"]
        path.write_text(json.dumps(content, indent=2) + "\n")


def test_folders_of_old_are_read_with_a_remark_and_replaced_as_ever(own: Path) -> None:
    aged(own / "run")
    said = command("smooth", "run", "--out", "smoothed", *_BARE)
    assert said == (
        "warning: run: must have hashes of its files in manifest.json, got none, as in folders of "
        "earlier versions; damaged files go unnoticed\n"
    )
    for kind in ("smoothed", "many"):
        aged(own / kind)
        assert "warning" not in command(*MADE[kind], "--out", kind).replace(said, "")
        assert manifests.of_folder(own / kind)["hashes"]  # type: ignore[index]


@pytest.mark.parametrize("text", ["{", "[]", "{}", '{"hashes": {}}', '{"sha256": ""}', "\udcff"])
def test_what_is_no_manifest_is_named(own: Path, text: str) -> None:
    path = own / "run" / "manifest.json"
    path.write_bytes(text.encode(errors="surrogateescape"))
    for arguments in (MADE["run"], ("smooth", "run")):
        said = command(*arguments, "--out", "run" if arguments[0] == "run" else "new", code=2)
        assert len(said.splitlines()) == 1
        assert "manifest.json" in said
