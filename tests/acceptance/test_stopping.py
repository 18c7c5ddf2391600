"""SIGTERM and Ctrl-C at any moment of commands that last: a line, a code, nothing half done.

The commands have more to do than fits into the patience of the tests, so one that ends was stopped.
Some moments run with all tests, 200 with ``pytest -m slow -s`` of this file; any other number, and
other moments, with ``SBLCOSIM_STOPS=1000 SBLCOSIM_STOPS_SEED=7`` before it.
"""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest
from quick import one_in
from sblcosim.fmus import files

pytestmark = pytest.mark.skipif(os.name == "nt", reason="there is no SIGTERM")

SEED = int(os.environ.get("SBLCOSIM_STOPS_SEED", "1"))
STOPS = int(os.environ.get("SBLCOSIM_STOPS", "200"))
PATIENCE = float(os.environ.get("SBLCOSIM_STOPS_PATIENCE", "300"))
"""For what takes a second at most [s]."""
CODES = {signal.SIGTERM: 143, signal.SIGINT: 130}

STUDY = """
name = "endless"
scenario = "paper-scenario-1"
replicates = 20000
[fixed.time]
duration_s = 2000.0
[factors.gps]
keys = ["platform.gps_horizontal_std_m"]
levels = [0.1, 3.5]
"""
ALONE = """
name = "alone"
scenario = "paper-scenario-1"
receivers = ["mine.py:Slow"]
replicates = 2000
[fixed.time]
duration_s = 200.0
[factors.gps]
keys = ["platform.gps_horizontal_std_m"]
levels = [0.1, 3.5]
"""
RECEIVER = """
import time

import sblcosim

class Slow(sblcosim.Receiver):
    def update(self, samples):
        until = time.perf_counter() + 0.002
        while time.perf_counter() < until:
            pass
        return sblcosim.Estimate(samples[-1].epoch, (1.0, 2.0, 3.0)) if samples else None
"""
ENDLESS = ("--set", "time.duration_s=20000", "--set", "time.sampling_time_s=0.01")


@dataclass(frozen=True)
class Command:
    """A command; whether it has a cache of its own, and whether it may have finished before."""

    arguments: tuple[str, ...]
    own_cache: bool = False
    may_finish: bool = False
    latest: float = 4.0
    """Of the moments, after the handlers are there [s]."""


def _run(*arguments: str) -> Command:
    return Command(("run", "paper-scenario-1", *ENDLESS, *arguments))


COMMANDS = {
    "run": _run(),
    "run python": _run("--master", "python"),
    "run lanes": _run("--master", "lanes"),
    "run python receiver": _run("--receiver", "mine.py:Slow"),
    "run a receiver's folder": _run("--receiver", "hanging"),
    "run runs": Command(
        ("run", "paper-scenario-1", "--runs", "200000", "--set", "time.duration_s=2000")
    ),
    "study": Command(("study", "endless.toml")),
    "study processes": Command(
        ("study", "endless.toml", "--executor", "processes", "--workers", "2"), latest=12.0
    ),
    "study native": Command(("study", "endless.toml", "--master", "native")),
    "study python": Command(("study", "endless.toml", "--master", "python")),
    "study of a python receiver": Command(("study", "alone.toml")),
    "map": Command(
        ("map", "paper-scenario-1", "--area", "100x100", "--depth", "10", "--cells", "100",
         "--runs", "2000")
    ),
    "map, possible": Command(
        ("map", "paper-scenario-1", "--area", "100x100", "--depth", "10", "--cells", "200",
         "--runs", "1", "--duration", "20000", "--set", "time.sampling_time_s=0.01")
    ),
    "budget": Command(("budget", "paper-scenario-1", "--runs", "500000")),
    "compare": Command(("compare", "paper-scenario-1", "--receiver", "ekf", "--receiver",
                        "coupled", "--runs", "500000")),
    "require": Command(("require", "one-metre"), may_finish=True),
    "smooth": Command(("smooth", "long"), may_finish=True),
    "paper": Command(("paper",), may_finish=True, latest=10.0),
    "calibrate": Command(
        ("calibrate", "--pings", "300000"), may_finish=True
    ),
    "run that compiles": Command(("run", "paper-scenario-1", *ENDLESS), True, latest=20.0),
    "build": Command(("build",), own_cache=True, may_finish=True, latest=10.0),
}  # fmt: skip


def place_of(folder: Path) -> Path:
    for name in ("tmp", "cache"):
        (folder / name).mkdir(parents=True)
    (folder / "endless.toml").write_text(STUDY)
    (folder / "alone.toml").write_text(ALONE)
    (folder / "mine.py").write_text(RECEIVER)
    (folder / "hanging").mkdir()
    (folder / "hanging" / "receiver.py").write_text("while True: pass")
    return folder


def catches(process: subprocess.Popen[str]) -> bool:
    """Whether its handlers are there."""
    status = Path(f"/proc/{process.pid}/status")
    if not status.exists():
        time.sleep(1.0)  # no Linux: more than Python takes to begin
        return True
    mask = next(x for x in status.read_text().splitlines() if x.startswith("SigCgt"))
    return bool(int(mask.split()[1], 16) >> (signal.SIGTERM - 1) & 1)


def stopped(
    folder: Path, command: Command, number: int, after: float, group: bool
) -> tuple[float, int, str]:
    """Seconds until a command has ended after a signal, its code, what it said.

    ``group``: its workers get the signal, too, as from a terminal or a batch system.
    """
    own = {"SBLCOSIM_CACHE": str(folder / "cache")} if command.own_cache else {}
    process = subprocess.Popen(
        [sys.executable, "-m", "sblcosim", *command.arguments, "--out", "made"],
        cwd=folder, env={**os.environ, **own, "TMPDIR": str(folder / "tmp")},
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    while process.poll() is None and not catches(process):
        time.sleep(0.005)
    time.sleep(after)
    finished = process.poll() is not None
    if group and not finished:
        os.killpg(process.pid, number)
    else:
        process.send_signal(number)
    began = time.monotonic()
    try:
        err = process.communicate(timeout=PATIENCE)[1]
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        raise
    assert not finished or command.may_finish, err
    return time.monotonic() - began, -1 if finished else process.returncode, err


def check(folder: Path, command: Command, number: int, code: int, err: str) -> None:
    if code in (-1, 0) and command.may_finish:  # it was quicker
        assert (folder / "made").is_dir(), err
    else:
        assert code == CODES[signal.Signals(number)], err
        assert any(word in err for word in ("terminated", "interrupted")), err
    for word in ("Traceback", "Exception ignored", "error:"):
        assert word not in err, err
    half = [p for p in folder.rglob("*") if files.is_hidden(p.name)]
    assert not half, (half, err)
    for manifest in (folder / "made").rglob("manifest.json"):
        content = json.loads(manifest.read_text())
        assert all((manifest.parent / name).exists() for name in content["files"])
    gone(folder)


def gone(folder: Path) -> None:
    """Nothing that the command has started lives on: its folder for temporary files is empty."""
    until = time.monotonic() + PATIENCE
    while any((folder / "tmp").iterdir()):
        assert time.monotonic() < until, list((folder / "tmp").iterdir())
        time.sleep(0.05)


def long_run(folder: Path) -> None:
    subprocess.run(
        [sys.executable, "-m", "sblcosim", "run", "paper-scenario-1", "--receiver", "coupled",
         "--set", "time.duration_s=2000", "--no-figures", "--out", "long"],
        cwd=folder, check=True, capture_output=True, timeout=PATIENCE,
    )  # fmt: skip


@one_in(2)
@pytest.mark.parametrize(
    ("name", "number", "group"),
    [
        ("run", signal.SIGTERM, False),
        pytest.param("study processes", signal.SIGTERM, False, marks=pytest.mark.slow),
        ("study processes", signal.SIGTERM, True),
        pytest.param("study native", signal.SIGINT, False, marks=pytest.mark.slow),
        ("study of a python receiver", signal.SIGTERM, True),
        ("run a receiver's folder", signal.SIGINT, False),
        ("map, possible", signal.SIGTERM, False),
        ("budget", signal.SIGINT, True),
    ],
)
def test_a_signal_ends_a_command(tmp_path: Path, name: str, number: int, group: bool) -> None:
    place, command = place_of(tmp_path), COMMANDS[name]
    after = random.Random(f"{SEED} {name}").uniform(0.0, command.latest / 2)
    _, code, err = stopped(place, command, number, after, group)
    check(place, command, number, code, err)


def test_the_code_is_ours_if_an_executed_text_was_interrupted(tmp_path: Path) -> None:
    """As the methods of a dataclass, which an import makes from a text."""
    (tmp_path / "interrupted.py").write_text(
        "import sblcosim.cli.common.outcome\n"
        "from sblcosim.__main__ import main\n"
        "def command(): exec('raise KeyboardInterrupt')\n"
        "sblcosim.cli.main = command\n"
        "main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-m", "interrupted"], cwd=tmp_path, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.stderr == "interrupted; nothing was written\n"
    assert done.returncode == CODES[signal.SIGINT]


@pytest.mark.parametrize("number", CODES)
@one_in(2)
def test_a_signal_ends_the_compilers(tmp_path: Path, number: int) -> None:
    place = place_of(tmp_path)
    process = subprocess.Popen(
        [sys.executable, "-m", "sblcosim", "run", "paper-scenario-1", "--out", "made"],
        cwd=place, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "SBLCOSIM_CACHE": str(place / "cache"), "TMPDIR": str(place / "tmp")},
        start_new_session=True,
    )  # fmt: skip
    assert process.stderr is not None
    names = "target, platform, acoustics, ekf, multilateration"
    assert process.stderr.readline().startswith(f"compiling {names}: about ")
    process.send_signal(number)
    end = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}[signal.Signals(number)]
    assert process.communicate(timeout=PATIENCE)[1] == f"{end}; nothing was written\n"
    assert process.returncode == CODES[signal.Signals(number)]
    assert not [p for p in place.rglob("*") if files.is_hidden(p.name) or p.suffix == ".fmu"]
    gone(place)


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_a_signal_at_any_moment(tmp_path: Path, name: str) -> None:
    command, draw = COMMANDS[name], random.Random(f"{SEED} {name}")
    seconds = []
    for turn in range(-(-STOPS // len(COMMANDS))):
        place = place_of(tmp_path / str(turn))
        if name == "smooth":
            long_run(place)
        number = draw.choice([signal.SIGTERM, signal.SIGINT])
        after = draw.uniform(0.0, command.latest)
        group = draw.random() < 0.5
        took, code, err = stopped(place, command, number, after, group)
        seconds.append(took)
        whom = "the group" if group else "it"
        print(
            f"{name}: {number.name} to {whom} after {after:.2f} s: code {code}, {took:.2f} s; "
            f"{err[:90]!r}"
        )
        check(place, command, number, code, err)
    print(f"{name}: {len(seconds)} stops, {max(seconds):.2f} s at most")
