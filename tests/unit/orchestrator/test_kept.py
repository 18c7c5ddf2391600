"""Commands with many runs keep what they have finished, and go on with it to the same bytes."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
import sblcosim
from sblcosim.cli.common.app import app
from sblcosim.comparison.tournament import cost
from sblcosim.simulation.masters import lanes
from sblcosim.study import runner, store
from sblcosim.study.kept import Kept
from sblcosim.study.study import load
from seams import Seam
from typer.testing import CliRunner

SHORT = ("--set", "time.duration_s=6", "--no-figures")
PAPER = "paper-scenario-1"
COMMANDS: dict[str, tuple[str, ...]] = {
    "compare": ("compare", PAPER, "realistic-dive", *SHORT, "--runs", "20",
                "--receiver", "ekf", "--receiver", "coupled"),
    "budget": ("budget", PAPER, *SHORT, "--runs", "30"),
    "runs": ("run", PAPER, *SHORT, "--runs", "30", "--receiver", "ekf", "--receiver", "coupled"),
    "map": ("map", PAPER, "--area", "30x30", "--depth", "5", "--cells", "4", "--runs", "4",
            "--limit", "0.5", "--duration", "6", "--settling", "2", "--no-figures"),
}  # fmt: skip


@pytest.fixture(autouse=True)
def _small_parts(monkeypatch: pytest.MonkeyPatch, seam: Seam, tmp_path: Path) -> None:
    seam.tuned(kept_steps=1)
    seam.instead(cost.update_seconds, lambda study: {})
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    monkeypatch.chdir(tmp_path)


class Runs:
    """Counts the runs that are simulated, and interrupts before a part."""

    def __init__(self, seam: Seam) -> None:
        self.done, self.parts, self.until = 0, 0, 10**9
        self.meanwhile: Callable[[], object] = lambda: None
        original = lanes.execute

        def counted(plan: Any, variations: Any, **options: Any) -> Any:
            if self.parts >= self.until:
                raise KeyboardInterrupt
            self.parts += 1
            self.meanwhile()
            outcome = original(plan, variations, **options)
            self.done += len(next(iter(variations.values())))
            return outcome

        seam.instead(lanes.execute, counted)

    def again(self, until: int = 10**9) -> None:
        self.done, self.parts, self.until = 0, 0, until


@pytest.fixture
def runs(seam: Seam) -> Runs:
    return Runs(seam)


def command(*arguments: str, code: int = 0) -> str:
    """What a command says on stderr."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["sblcosim", *arguments])
        done = CliRunner().invoke(app, arguments)
    assert done.exit_code == code, (done.exit_code, done.stderr)
    return done.stderr


def content(folder: str | Path) -> dict[str, bytes]:
    return {
        str(p.relative_to(folder)): p.read_bytes() for p in Path(folder).rglob("*") if p.is_file()
    }


@pytest.mark.parametrize("name", COMMANDS)
def test_an_interrupted_command_goes_on_and_gives_the_same_bytes(name: str, runs: Runs) -> None:
    arguments = COMMANDS[name]
    command(*arguments, "--out", "whole")
    everything, parts = runs.done, runs.parts
    assert parts >= 4
    assert sorted(os.listdir()) == ["whole"]
    kept = 0
    for until in (1, parts // 2):  # twice, the second time among those that are left
        runs.again(until)
        said = command(*arguments, "--out", "out", code=130)
        kept += runs.done
        folder = Path("out-unfinished").resolve()
        same = shlex.join(["sblcosim", *arguments, "--out", "out"])
        assert said == f"interrupted; {kept} runs are in {folder}; go on with: {same}\n"
        assert sorted(os.listdir()) == ["out-unfinished", "whole"]
    runs.again()
    command(*arguments, "--out", "out")
    assert runs.done == everything - kept
    assert sorted(os.listdir()) == ["out", "whole"]
    assert content("out") == content("whole")


@pytest.mark.parametrize("name", ["compare", "map"])
def test_the_default_folder_is_found_again(name: str, runs: Runs) -> None:
    arguments = COMMANDS[name]
    command(*arguments)
    (folder,) = Path("runs").iterdir()
    command(*arguments, "--seed", "7")
    numbered = folder.with_name(f"{folder.name}-2")
    expected = content(numbered)
    shutil.rmtree(numbered)
    runs.again(2)
    assert "go on with" in command(*arguments, "--seed", "7", code=130)
    kept = runs.done
    runs.again()
    command(*arguments, "--seed", "7")
    assert {*Path("runs").iterdir()} == {folder, numbered}
    assert content(numbered) == expected
    assert kept > 0


@pytest.mark.parametrize("name", ["compare", "map"])
def test_more_runs_go_on_with_fewer(name: str, runs: Runs) -> None:
    arguments = COMMANDS[name]
    at = arguments.index("--runs") + 1
    more = (*arguments[:at], str(int(arguments[at]) + 2), *arguments[at + 1 :])
    command(*more, "--out", "whole")
    everything = runs.done
    runs.again(3)
    command(*arguments, "--out", "out", code=130)
    kept = runs.done
    runs.again()
    command(*more, "--out", "out")
    assert runs.done == everything - kept
    assert content("out") == content("whole")


def test_before_the_first_part_nothing_is_kept(runs: Runs) -> None:
    runs.again(0)
    for arguments in COMMANDS.values():
        assert command(*arguments, code=130) == "interrupted; nothing was written\n"
        assert os.listdir() == []


@pytest.mark.parametrize(("at", "there"), [(store.check_folder, False), (store.open_folder, True)])
@pytest.mark.parametrize(
    "arguments",
    [("study", "paper-scenario-1"), ("require", "one-metre"), ("paper", "--quick")],
    ids=lambda arguments: arguments[0],
)
def test_a_folder_that_is_not_there_yet_is_not_named(
    arguments: tuple[str, ...], at: Callable[..., Any], there: bool, seam: Seam
) -> None:
    """These begin their folder before they have a run; there is a way on from it."""

    def interrupted(*given: Any) -> Any:
        raise KeyboardInterrupt

    seam.instead(at, interrupted)
    same = shlex.join(["sblcosim", *arguments, "--out", "out"])
    words = rf"interrupted; 0( of \d+)? runs are in out; go on with: {same}\n"
    said = command(*arguments, "--out", "out", code=130)
    assert re.fullmatch(words if there else "interrupted; nothing was written\n", said)
    assert os.listdir() == (["out"] if there else [])


def test_other_runs_are_not_taken_for_these_and_stay(runs: Runs) -> None:
    one, two = COMMANDS["compare"], (*COMMANDS["compare"], "--seed", "9")
    command(*two, "--out", "whole")
    runs.again(2)
    command(*one, "--out", "out", code=130)
    before = content("out-unfinished")
    runs.again()
    command(*two, "--out", "out")
    assert content("out") == content("whole")
    assert content("out-unfinished") == before


def test_a_damaged_part_is_done_again(runs: Runs) -> None:
    arguments = COMMANDS["map"]
    command(*arguments, "--out", "whole")
    runs.again(2)
    command(*arguments, "--out", "out", code=130)
    path = next(Path("out-unfinished").rglob("*.parquet")).resolve()
    path.write_bytes(path.read_bytes()[:-1])
    runs.again()
    said = command(*arguments, "--out", "out")
    assert said == (
        f"warning: {path}: must be as it was written, got other bytes; its runs are repeated\n"
    )
    assert content("out") == content("whole")


def test_others_refuse_such_a_folder_in_a_sentence(runs: Runs) -> None:
    runs.again(2)
    command(*COMMANDS["compare"], "--out", "out", code=130)
    before = content("out-unfinished")
    for arguments in (
        ("run", PAPER), COMMANDS["budget"], ("study", PAPER), (*COMMANDS["map"], "--force"),
        ("smooth", "out-unfinished"), ("analyse", "out-unfinished"), ("calibrate",),
    ):
        out = "new" if arguments[0] == "smooth" else "out-unfinished"
        said = command(*arguments, "--out", out, code=2)
        assert len(said.splitlines()) == 1
        assert "out-unfinished: must be " in said
        if arguments[0] not in ("smooth", "analyse"):
            assert said.endswith("got runs of a command that was interrupted in it\n")
    assert content("out-unfinished") == before


def test_what_is_refused_at_the_end_is_not_lost(runs: Runs) -> None:
    """Somebody else puts a file into the folder while the command runs."""
    arguments = COMMANDS["compare"]

    def put() -> None:
        Path("out").mkdir(exist_ok=True)
        Path("out/thesis.tex").write_text("precious")

    runs.meanwhile = put
    said = command(*arguments, "--out", "out", code=2)
    assert len(said.splitlines()) == 1
    assert "thesis.tex" in said
    folder = Path("out-unfinished").resolve()
    assert said.endswith(f"; {runs.done} finished runs are kept in {folder}\n")
    Path("out/thesis.tex").unlink()
    runs.again()
    command(*arguments, "--out", "out")
    assert runs.done == 0
    assert os.listdir() == ["out"]


def test_where_nothing_can_be_kept_a_command_says_so_and_works(runs: Runs) -> None:
    command(*COMMANDS["compare"], "--out", "whole")
    Path("out-unfinished").write_text("mine")
    said = command(*COMMANDS["compare"], "--out", "out")
    assert "out-unfinished: must be a folder that can be made, to keep finished runs, got" in said
    assert content("out") == content("whole")
    assert Path("out-unfinished").read_text() == "mine"


def test_python_keeps_nothing_unless_it_is_told_where(runs: Runs, tmp_path: Path) -> None:
    options: dict[str, Any] = {"runs": 20, "timed": False, "overrides": {"time.duration_s": 6.0}}
    found = sblcosim.compare(PAPER, "ekf", **options)
    assert os.listdir() == []
    kept = Kept("here")
    again = sblcosim.compare(PAPER, "ekf", **options, keep=kept)
    pd.testing.assert_frame_equal(found.table, again.table)
    assert kept.runs == 20
    runs.again()
    sblcosim.compare(PAPER, "ekf", **options, keep=Kept("here"))
    assert runs.done == 0
    kept.remove()
    assert os.listdir() == []


def test_what_another_process_is_at_work_with_stays(tmp_path: Path) -> None:
    one, other = Kept("here"), Kept("here")
    folder = one.of("runs")
    assert folder is not None
    assert folder == other.of("runs") != other.of("more")
    with store.at_work(folder):
        one.remove()
        assert folder.is_dir()
    other.remove()
    assert os.listdir() == []
    other.remove()  # nothing is there any more


def test_runs_that_go_one_by_one_and_fail_come_back_as_they_were(
    tmp_path: Path, runs: Runs
) -> None:
    (tmp_path / "odd.py").write_text(
        "from sblcosim import Estimate, Range, Receiver\n\n\nclass Odd(Receiver):\n"
        "    def update(self, samples):\n"
        "        heard = [s for s in samples if isinstance(s, Range)]\n"
        "        if heard and heard[0].epoch > 1.5 and round(heard[0].range * 1e6) % 8 == 0:\n"
        "            raise ValueError('odd')\n"
        "        return Estimate(samples[-1].epoch, (1.0, 2.0, 3.0))\n"
    )
    definition = {
        "name": "alone", "scenario": PAPER, "replicates": 9, "design": {"kind": "single"},
        "fixed": {"time.duration_s": 2.0}, "settling_time_s": 0.0,
    }  # fmt: skip
    study = load(definition, receivers=["ekf", "odd.py:Odd"])
    kept = Kept("alone")
    whole = runner.simulated(study)
    assert 0 < whole["error"].notna().sum() < len(whole)
    for _ in range(2):
        pd.testing.assert_frame_equal(runner.simulated(study, keep=kept), whole)
