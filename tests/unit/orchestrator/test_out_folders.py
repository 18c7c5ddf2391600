"""Every command with ``--out DIR`` refuses a folder with another result before any work."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import sblcosim.cli
import typer
from click.testing import Result
from log_samples import own
from quick import one_in
from sblcosim import artifacts
from sblcosim.areas.runs import Simulator
from sblcosim.estimation import smoother
from sblcosim.fmus.build.factory import build_all
from sblcosim.identification.device import device_of
from sblcosim.logs.read import read_log
from sblcosim.processing.running import ran
from sblcosim.report.study import analysed
from sblcosim.simulation.execution import execute, execute_part
from sblcosim.study.batch import simulate
from sblcosim.study.store import table
from seams import Seam
from typer.testing import CliRunner

DIVE = ("paper-scenario-1", "--set", "time.duration_s=3", "--no-figures")
PLACES = ("--cells", 3, "--duration", 12, "--settling", 10, "--depth", 5, "--no-figures")
SMALL: dict[str, tuple[object, ...]] = {
    "run": ("run", *DIVE),
    "run --runs": ("run", *DIVE, "--runs", 2),
    "compare": ("compare", *DIVE, "--receiver", "ekf", "--receiver", "sequential", "--runs", 2),
    "budget": ("budget", *DIVE, "--runs", 30),
    "map": ("map", "paper-scenario-1", "--area", "20x20", "--runs", 3, *PLACES),
    "map --distance": ("map", "paper-scenario-1", "--distance", 20, "--runs", 30, *PLACES),
    "calibrate": ("calibrate", "--pings", 5),
    "smooth": ("smooth", "dive", "--no-figures"),
    "replay": ("replay", "study", "RUN_ID", "--no-figures"),
    "process": ("process", "log", "--receiver", "long_baseline", "--no-figures"),
}
"""A small question of each command that asks before it works."""
OTHER = {"smooth": ("--set", "receiver.range_std_m=0.3"), "process": ("--smooth",)}
"""What makes it another question; for the rest it is another seed."""
KIND = {
    "log": ("log", "log"),
    "identify": ("identify", "log"),
    "study": ("study", "study.toml"),
    "require": ("require", "one-metre"),
    "paper": ("paper",),
    "analyse": ("analyse", "study"),
    "advise": ("advise", "study", "--costs", "costs.toml"),
    "firmware": ("firmware", "ekf", "paper-scenario-1", "--set", "time.duration_s=3"),
}
"""Commands that replace their own results, or have their own folders of runs."""
STUDY = """name = "small"
scenario = "paper-scenario-1"
replicates = 2
[design]
kind = "single"
[fixed]
time.duration_s = 3
"""


def _cli(*arguments: object) -> Result:
    return CliRunner().invoke(
        sblcosim.cli.app, [str(a) for a in arguments], catch_exceptions=False
    )


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with a log."""
    monkeypatch.chdir(tmp_path)
    Path("log").mkdir()
    for name, text in own().items():
        Path("log", name).write_text(text)
    Path("study.toml").write_text(STUDY)
    Path("costs.toml").write_text("")
    return tmp_path


def _with_inputs(asked: tuple[object, ...]) -> Iterator[tuple[object, ...]]:
    """A question and another one, with the folders that they read."""
    if asked[0] == "smooth":
        assert _cli("run", *DIVE, "--receiver", "coupled", "--out", "dive").exit_code == 0
    if asked[0] == "replay":
        assert _cli("study", "study.toml", "--out", "study").exit_code == 0
        for run_id in table("study")["run_id"]:
            yield tuple(run_id if it == "RUN_ID" else it for it in asked)
        return
    yield asked
    yield (*asked, *OTHER.get(str(asked[0]), ("--seed", 9)))


def _idle(seam: Seam, *but: object) -> None:
    """Nothing else can be simulated, filtered, read or analysed."""
    for work in (execute, execute_part, simulate, Simulator.run, smoother.smooth, ran,
                 device_of, read_log, analysed):  # fmt: skip
        if work not in but:
            seam.instead(work, lambda *_, **__: pytest.fail("it has begun to work"))


@pytest.mark.parametrize("command", SMALL)
@one_in(3)
def test_another_result_is_refused_before_any_work(
    command: str, place: Path, seam: Seam
) -> None:
    first, second = _with_inputs(SMALL[command])
    for _ in range(2):  # its own result is replaced
        done = _cli(*first, "--out", "mine")
        assert done.exit_code == 0, done.stderr
    before = Path("mine/manifest.json").read_bytes()
    _idle(seam, *([read_log] if command == "process" else []))
    refused = _cli(*second, "--out", "mine")
    assert (refused.exit_code, refused.stdout) == (2, "")
    assert refused.stderr.splitlines()[-1] == (
        "error: mine: must be empty or hold the result of this very run, got that of another; "
        "--force (in Python other='replace') replaces it"
    )
    assert Path("mine/manifest.json").read_bytes() == before
    assert not [path for path in place.iterdir() if "unfinished" in path.name]


@pytest.mark.parametrize("command", [*SMALL, *KIND])
@one_in(3)
def test_the_files_of_others_are_refused_before_any_work(
    command: str, place: Path, seam: Seam
) -> None:
    _idle(seam)
    mine = Path("mine/answer") if command == "require" else Path("mine")
    mine.mkdir(parents=True)
    Path(mine, "thesis.tex").write_text("precious")
    asked = {**SMALL, **KIND}[command]
    refused = _cli(*asked, "--out", "mine")
    assert (refused.exit_code, refused.stdout) == (2, "")
    assert f"{mine}: must be empty or hold" in refused.stderr
    assert "thesis.tex" in refused.stderr
    assert [path.name for path in mine.iterdir()] == ["thesis.tex"]


@pytest.mark.parametrize("out", ["x" * 3000, "file/out"], ids=["too long", "below a file"])
@pytest.mark.parametrize("command", [*SMALL, *KIND])
@one_in(3)
def test_a_folder_that_cannot_be_made_is_refused_before_any_work(
    command: str, out: str, place: Path, seam: Seam
) -> None:
    _idle(seam)
    Path("file").touch()
    refused = _cli(*{**SMALL, **KIND}[command], "--out", out)
    assert (refused.exit_code, refused.stdout) == (2, "")
    assert re.search(r"must be (a folder|readable and)", refused.stderr)


FILES = {
    "export ssp": ("export", "ssp", "paper-scenario-1"),
    "export fmu": ("export", "fmu", "paper-scenario-1"),
    "build": ("build",),
}
"""Commands that write FMUs and packages."""


@pytest.mark.parametrize("command", [*SMALL, *KIND, *FILES])
@one_in(3)
def test_a_file_in_the_way_of_a_folder_is_said_in_one_sentence(
    command: str, place: Path, seam: Seam
) -> None:
    _idle(seam)
    seam.instead(build_all, lambda *_, **__: pytest.fail("it has begun to build"))
    Path("file").touch()
    refused = _cli(*{**SMALL, **KIND, **FILES}[command], "--out", "file/out/it")
    assert (refused.exit_code, refused.stdout) == (2, "")
    assert re.search(
        r"error: .*\bfile/out\S*: must be a folder that can be made and written to, "
        "got Not a directory$", refused.stderr.rstrip(),
    )  # fmt: skip


@pytest.mark.parametrize("command", ["log", "identify"])
def test_another_kind_of_result_is_refused_before_any_work(
    command: str, place: Path, seam: Seam
) -> None:
    _idle(seam)
    with artifacts.folder("mine", {"calibration": {}}):
        pass
    refused = _cli(*KIND[command], "--out", "mine")
    assert refused.exit_code == 2
    assert "must be empty or hold the result of this very run" in refused.stderr


def test_no_command_with_a_folder_is_left_out() -> None:
    def with_folders(group: Any, before: str = "") -> Iterator[str]:
        for name, command in group.commands.items():
            if hasattr(command, "commands"):
                yield from with_folders(command, f"{before}{name} ")
            elif any("--out" in p.opts and p.metavar == "DIR" for p in command.params):
                yield before + name

    known = {str(asked[0]) for asked in (*SMALL.values(), *KIND.values())}
    assert {*with_folders(typer.main.get_command(sblcosim.cli.app))} == known | {"build"}
