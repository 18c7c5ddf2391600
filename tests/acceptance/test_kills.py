"""Kill -9 or SIGTERM at any moment: the same command then gives the same bytes, and leaves nothing.

Half a dozen kills run with all tests, 200 with ``pytest -m slow -s`` of this file; any other
number, and other moments, with ``SBLCOSIM_KILLS=1000 SBLCOSIM_KILLS_SEED=7`` before it.
"""

from __future__ import annotations

import os
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest
from said import apart_from_compiling
from sblcosim.fmus import files
from seams import program

pytestmark = pytest.mark.skipif(os.name == "nt", reason="there is no SIGKILL")

SEED = int(os.environ.get("SBLCOSIM_KILLS_SEED", "1"))
KILLS = int(os.environ.get("SBLCOSIM_KILLS", "200"))

STUDY = """
scenario = "paper-scenario-1"
replicates = 60
[fixed.time]
duration_s = 20.0
[factors.gps]
keys = ["platform.gps_horizontal_std_m"]
levels = [0.1, 3.5]
[factors.sampling_time]
keys = ["time.sampling_time_s"]
levels = [0.1, 1.0]
"""
# Small batches, so that there is much to interrupt.
PROGRAM = program(batch=4, kept_steps=1)


@dataclass(frozen=True)
class Command:
    """A command, the share of all kills that it gets, and how many before it may finish."""

    arguments: tuple[str, ...]
    share: float
    in_a_row: int
    own_cache: bool = False


OUT = ("--out", "out/made")
DIVES = ("realistic-dive", "harbour-square")
COMMANDS = {
    "study": Command(("study", "mine.toml", "--out", "out/made"), 0.4, 4),
    "run": Command(
        ("run", "paper-scenario-1", "--set", "time.duration_s=5", "--out", "out/made"), 0.3, 4
    ),
    "build": Command(("build", "range_model", "--fmi", "2", "--out", "out/made"), 0.25, 4, True),
    "compare": Command(("compare", *DIVES, "--receiver", "ekf", "--receiver", "coupled",
                        "--runs", "120", "--no-figures", *OUT), 0.1, 4),
    "budget": Command(("budget", DIVES[0], "--set", "time.duration_s=20", "--runs", "40",
                       *OUT), 0.1, 4),
    "runs": Command(("run", DIVES[0], "--runs", "200", "--receiver", "coupled", *OUT), 0.1, 4),
    "map": Command(("map", DIVES[1], "--area", "30x30", "--depth", "5", "--cells", "12",
                    "--limit", "2", "--duration", "30", *OUT), 0.1, 4),
    "paper": Command(("paper", "--quick", "--out", "out/made"), 0.05, 2),
}


@dataclass(frozen=True)
class Place:
    """A folder for a command, with its own folders for temporary files and the cache."""

    folder: Path
    command: Command

    @classmethod
    def make(cls, folder: Path, command: Command) -> Place:
        for name in ("out", "tmp", "cache"):
            (folder / name).mkdir(parents=True)
        (folder / "mine.toml").write_text(STUDY)
        return cls(folder, command)

    def start(self) -> subprocess.Popen[bytes]:
        own = {"SBLCOSIM_CACHE": str(self.folder / "cache")} if self.command.own_cache else {}
        return subprocess.Popen(
            [sys.executable, "-c", PROGRAM, *self.command.arguments],
            cwd=self.folder, env={**os.environ, **own, "TMPDIR": str(self.folder / "tmp")},
            stdout=subprocess.DEVNULL, stderr=(self.folder / "errors").open("w"),
            start_new_session=True,
        )  # fmt: skip

    def finish(self) -> float:
        """Let the command do its work; seconds that it took."""
        started = time.monotonic()
        process = self.start()
        process.wait(timeout=900)
        err = (self.folder / "errors").read_text()
        assert process.returncode == 0, err
        assert "other bytes" not in err, err  # nothing is damaged by a kill
        gone(process.pid)
        return time.monotonic() - started

    def kill(self, after: float, number: int = signal.SIGKILL) -> None:
        process = self.start()
        time.sleep(after)
        process.send_signal(number)
        process.wait(timeout=600)
        gone(process.pid)
        if number == signal.SIGTERM:
            self.check_what_is_said(process.returncode)

    def check_what_is_said(self, code: int) -> None:
        """A command that is asked to end says what is kept, in a line."""
        lines = apart_from_compiling((self.folder / "errors").read_text()).splitlines()
        lines = [line for line in lines if not line.startswith("warning: ")]
        if code in (0, -signal.SIGTERM):  # it was over, or had not begun
            return
        assert code == 128 + signal.SIGTERM, lines
        (said,) = lines
        kept = re.fullmatch(r"interrupted; \d+(?: of \d+)? runs are in (.*); go on with.*", said)
        whole = re.fullmatch(r"terminated; complete before that: (.*)", said)
        if whole is not None:
            assert (self.folder / whole[1] / "manifest.json").is_file()
        elif kept is None:
            assert said == "terminated; nothing was written"
        else:
            assert (self.folder / kept[1]).is_dir()

    def made(self) -> dict[str, bytes]:
        return content(self.folder / "out") | content(self.folder / "cache")

    def left(self) -> list[str]:
        """What is not a result."""
        return [str(p) for p in self.folder.rglob("*") if files.is_hidden(p.name)] + [
            str(p) for p in (self.folder / "tmp").iterdir()
        ]


def gone(group: int) -> None:
    """Wait until nothing lives that a process has started: compilers, workers."""
    until = time.monotonic() + 300
    while time.monotonic() < until:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return
        time.sleep(0.01)
    os.killpg(group, signal.SIGKILL)
    raise AssertionError("a process has outlived its parent")


def content(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def killed_and_finished(
    folder: Path, command: Command, kills: int, seed: int,
    numbers: Sequence[int] = (signal.SIGKILL,),
) -> int:
    """Kill a command again and again, at random moments; how often it had written something."""
    rng = random.Random(seed)
    whole = Place.make(folder / "whole", command)
    seconds = whole.finish()
    assert whole.left() == []
    expected, hits = whole.made(), 0
    for first in range(0, kills, command.in_a_row):
        place = Place.make(folder / str(first), command)
        moments = [rng.uniform(0.05, 1.0) * seconds for _ in range(command.in_a_row)]
        for moment in moments[: kills - first]:
            place.kill(moment, rng.choice(numbers))
            hits += bool(place.left()) or bool(place.made())
        place.finish()
        where = f"seed {seed}, after {first} kills, moments {moments}"
        assert place.left() == [], where
        made = place.made()
        assert made.keys() == expected.keys(), where
        assert [name for name in made if made[name] != expected[name]] == [], where
    return hits


@pytest.mark.parametrize("name", ["run", *(pytest.param(n, marks=pytest.mark.slow)
                                          for n in ("study", "build"))])
def test_some_kills(tmp_path: Path, name: str) -> None:
    killed_and_finished(tmp_path, COMMANDS[name], 2, SEED)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["compare", "runs", "budget", "map"])
def test_some_ends_of_commands_with_many_runs(tmp_path: Path, name: str) -> None:
    kills = 1 if name == "compare" else 2
    killed_and_finished(tmp_path, COMMANDS[name], kills, SEED, (signal.SIGTERM, signal.SIGKILL))


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_kills_at_many_moments(tmp_path: Path, name: str) -> None:
    kills = max(1, round(COMMANDS[name].share * KILLS))
    numbers = (signal.SIGKILL, *(() if COMMANDS[name].own_cache else (signal.SIGTERM,)))
    hits = killed_and_finished(tmp_path, COMMANDS[name], kills, SEED, numbers)
    print(f"{name}: {kills} kills, {hits} of them with something left, seed {SEED}")
    assert hits > kills // 4
