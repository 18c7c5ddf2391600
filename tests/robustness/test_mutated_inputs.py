"""Whatever a file holds, a command ends with a result, or with lines that say what is wrong.

The cases come from a seed; any number by hand, and one again:

    SBLCOSIM_MUTATION_CASES=5000 pytest -n auto tests/robustness/test_mutated_inputs.py
    SBLCOSIM_MUTATION_SEED=7 pytest tests/robustness/test_mutated_inputs.py -k case00042
"""

from __future__ import annotations

import os
import random
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import mutators
import pytest
from command_line import MEGABYTES, SECONDS, CommandLine, Ended
from sblcosim.fmus.factory import build
from sblcosim.models import COMPONENTS
from sblcosim.starter import starter

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="forks")

SEED = int(os.environ.get("SBLCOSIM_MUTATION_SEED", "1"))
QUICK, ALL = 300, 2000
CASES = int(os.environ.get("SBLCOSIM_MUTATION_CASES", ALL))

STUDY = """\
scenario = "scenario.toml"
replicates = 3
receivers = ["ekf"]

[factors.gps]
label = "GPS error"
keys = ["platform.gps_horizontal_markov_std_m"]
levels = [0.1, 1.05]

[factors.baseline]
keys = ["platform.arm_length_m"]
levels = [0.4, 3.0]

[fixed]
"acoustics.range_std_m" = 0.2
"""
COSTS = "gps = [900, 40]\nbaseline = [20, 150]\n"
QUIETLY = ("--no-figures", "--step-timeout", "5", "--out", "out")
RUN = ("run", "scenario.toml", *QUIETLY)
EXAMINED = ("description", "functions", "life cycle")


@dataclass(frozen=True)
class Inputs:
    """Sound files to begin with, in a folder of their own, and the command."""

    folder: Path
    cache: Path
    run: CommandLine

    def environment(self, home: Path, cache: Path | None = None) -> dict[str, str]:
        """Of a command whose home and temporary files are in a folder."""
        return {
            "HOME": str(home / "home"), "TMPDIR": str(home / "tmp"),
            "XDG_CACHE_HOME": str(home / "home"), "SBLCOSIM_CACHE": str(cache or self.cache),
        }  # fmt: skip


@pytest.fixture(scope="session")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Inputs]:
    """Files, a study's results among them."""
    base = tmp_path_factory.mktemp("inputs")
    folder, cache = base / "cwd", base / "cache"
    for name in ("cwd", "home", "tmp"):
        (base / name).mkdir()
    text = starter("scenario").replace("duration_s = 'path'", "duration_s = 4.0")
    text = text.replace('duration_s = "path"', "duration_s = 4.0")
    assert "duration_s = 4.0" in text
    (folder / "scenario.toml").write_text(text)
    (folder / "study.toml").write_text(STUDY)
    (folder / "costs.toml").write_text(COSTS)
    for fmi in (2, 3):
        shutil.copy(build("ekf", fmi), folder / f"ekf{fmi}.fmu")
        for name in COMPONENTS:  # so that nothing is compiled again
            place = build(name, fmi).parent
            shutil.copytree(place, cache / "fmus" / place.name)
    run = CommandLine()
    try:
        made = Inputs(folder, cache, run)
        sound = made.environment(base)
        done = run(("study", "study.toml", "--out", "results"), folder, sound)
        assert done.code == 0, done.errors
        done = run((*RUN, "--receiver", "ekf2.fmu"), folder, sound)
        assert done.code == 0, done.errors
        shutil.rmtree(folder / "out")
        yield made
    finally:
        run.close()


Case = Callable[[random.Random, Path], tuple[str, tuple[str, ...]]]
"""Mutates a file in a folder; gives its name, and the command that reads it."""


def _scenario(random_: random.Random, folder: Path) -> tuple[str, tuple[str, ...]]:
    _text(folder / "scenario.toml", random_, mutators.toml)
    commands = [
        ("plan", "scenario.toml"), ("plan", "scenario.toml", "--receiver", "sequential"), RUN,
        ("export", "ssp", "scenario.toml", "--out", "out.ssp"),
        ("new", "out.toml", "--from", "scenario.toml"), ("study", "study.toml", "--dry-run"),
    ]  # fmt: skip
    return "scenario.toml", random_.choices(commands, [4, 1, 3, 1, 1, 1])[0]


def _study(random_: random.Random, folder: Path) -> tuple[str, tuple[str, ...]]:
    _text(folder / "study.toml", random_, mutators.toml)
    command = ("study", "study.toml", "--out", "out")
    return "study.toml", random_.choice([command, (*command, "--dry-run")])


def _costs(random_: random.Random, folder: Path) -> tuple[str, tuple[str, ...]]:
    _text(folder / "costs.toml", random_, mutators.toml)
    command = ("advise", "results", "--costs", "costs.toml", "--limit", "2", "--out", "out")
    return "costs.toml", random_.choice([command, (*command, "--percentile", "90")])


def _fmu(random_: random.Random, folder: Path) -> tuple[str, tuple[str, ...]]:
    name = random_.choice(["ekf2.fmu", "ekf3.fmu"])
    path = folder / name
    path.write_bytes(mutators.archive(random_, path.read_bytes(), {".xml": mutators.xml}))
    only = [word for check in EXAMINED for word in ("--check", check)]
    commands = [
        ("check", name), (*RUN, "--receiver", name), ("plan", "scenario.toml", "--receiver", name),
        ("conformance", name, "--timeout", "5", *only),
    ]  # fmt: skip
    return name, random_.choices(commands, [5, 3, 1, 1])[0]


def _results(random_: random.Random, folder: Path) -> tuple[str, tuple[str, ...]]:
    parts = [p for p in (folder / "results").rglob("*") if p.is_file() and p.suffix == ".parquet"]
    path = random_.choice([folder / "results" / "study.json", *sorted(parts)])
    if path.suffix == ".json":
        _text(path, random_, mutators.as_json)
    else:
        path.write_bytes(mutators.damaged(random_, path.read_bytes()))
    costs = ("--costs", "costs.toml", "--limit", "2")
    commands = [
        ("analyse", "results", "--out", "out"), ("advise", "results", *costs, "--out", "out"),
        ("replay", "results", "0", "--no-figures", "--out", "out"),
        ("study", "study.toml", "--out", "results"),
    ]  # fmt: skip
    return path.name, random_.choices(commands, [1, 3, 1, 3])[0]


def _cache(random_: random.Random, folder: Path) -> tuple[str, tuple[str, ...]]:
    files = [p for p in (folder.parent / "cache").rglob("*") if p.is_file()]
    wanted = {"target.fmu", "platform.fmu", "acoustics.fmu", "ekf.fmu"}
    names = [p for p in files if p.name in wanted or p.suffix in {".so", ".dylib"}]
    path = random_.choice(sorted(names))
    damage = mutators.damaged(random_, path.read_bytes())
    path.unlink()  # the sound one may be loaded
    path.write_bytes(damage)
    return path.name, random_.choice([RUN, ("study", "study.toml", "--out", "out")])


KINDS: dict[str, tuple[Case, int]] = {
    "scenario": (_scenario, 30), "study": (_study, 20), "costs": (_costs, 8), "fmu": (_fmu, 24),
    "results": (_results, 14), "cache": (_cache, 4),
}  # fmt: skip


def _text(
    path: Path, random_: random.Random, change: Callable[[random.Random, str], str]
) -> None:
    path.write_bytes(change(random_, path.read_text("utf-8")).encode(errors="surrogatepass"))


def _numbers() -> Iterator[object]:
    for n in range(CASES):
        slow = n >= QUICK and "SBLCOSIM_MUTATION_CASES" not in os.environ
        yield pytest.param(n, id=f"case{n:05}", marks=[pytest.mark.slow] if slow else [])


@pytest.mark.parametrize("number", [*_numbers()])
def test_a_mutated_file_gives_a_result_or_a_line(
    inputs: Inputs, tmp_path: Path, number: int
) -> None:
    random_ = random.Random(f"{SEED} {number}")
    folder = tmp_path / "cwd"
    shutil.copytree(inputs.folder, folder)
    for name in ("home", "tmp"):
        (tmp_path / name).mkdir()
    kind = random_.choices(list(KINDS), [weight for _, weight in KINDS.values()])[0]
    if kind == "cache":
        shutil.copytree(inputs.cache, tmp_path / "cache")
    file, command = KINDS[kind][0](random_, folder)
    before = _there(tmp_path)
    print(f"SBLCOSIM_MUTATION_SEED={SEED} case {number}: {kind} {file}: {' '.join(command)}")

    cache = tmp_path / "cache" if kind == "cache" else None
    ended = inputs.run(command, folder, inputs.environment(tmp_path, cache))
    print(f"exit code {ended.code}, {ended.seconds:.1f} s, {ended.megabytes:.0f} MB")
    print(ended.output[:2000], ended.errors[:4000], sep="\n---\n")
    judge(ended, None if kind == "cache" else file)
    new = {p for p, what in _there(tmp_path).items() if before.get(p) != what}
    gone = before.keys() - _there(tmp_path).keys()
    home = {"study": "cwd/results"}.get(command[0], "-")
    allowed = ("cwd/out", "cache", home)
    assert not [p for p in (*new, *gone) if not p.startswith(allowed)]
    assert set(os.listdir(tmp_path.parent)) <= {p.name for p in tmp_path.parent.iterdir()}
    shutil.rmtree(tmp_path)


def judge(ended: Ended, file: str | None) -> None:
    """See that a command has ended as it must.

    Parameters
    ----------
    file
        Name that an error must give; None: any.
    """
    assert not ended.hung
    assert ended.code in {0, 1, 2}
    assert "Traceback" not in ended.errors
    assert "must not happen" not in ended.errors
    assert ended.seconds < SECONDS
    assert ended.megabytes < MEGABYTES
    lines = ended.errors.splitlines()
    assert all(line.startswith(("error: ", "warning: ")) for line in lines)
    assert all(len(line) < 1500 for line in lines)
    if ended.code == 2:
        wrong = [line for line in lines if line.startswith("error: ")]
        assert wrong
        assert file is None or any(file in line for line in wrong)
    else:
        assert ended.output.strip()


def _there(folder: Path) -> dict[str, object]:
    """What is in a folder: of files the size and the time of their last change."""
    return {
        str(p.relative_to(folder)): (s.st_size, s.st_mtime_ns) if p.is_file() else "folder"
        for p in folder.rglob("*")
        for s in [p.lstat()]
    }
