"""Whatever a file holds, a command ends with a result, or with lines that say what is wrong."""

from __future__ import annotations

import os
import random
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import mutators
import pandas as pd
import pytest
from command_line import Inputs, judge
from sblcosim.scenario.file_schema import FILE_NAME

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="forks")

QUIETLY = ("--no-figures", "--step-timeout", "5", "--out", "out")
RUN = ("run", "scenario.toml", *QUIETLY)
EXAMINED = ("description", "functions", "life cycle")


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
    run = pd.read_parquet(folder / "results" / "runs.parquet")["run_id"][0]
    path = random_.choice([folder / "results" / "study.json", *sorted(parts)])
    if path.suffix == ".json":
        _text(path, random_, mutators.as_json)
    else:
        path.write_bytes(mutators.damaged(random_, path.read_bytes()))
    costs = ("--costs", "costs.toml", "--limit", "2")
    commands = [
        ("analyse", "results", "--out", "out"), ("advise", "results", *costs, "--out", "out"),
        ("replay", "results", run, "--no-figures", "--out", "out"),
        ("study", "study.toml", "--out", "results"),
    ]  # fmt: skip
    return path.name, random_.choices(commands, [1, 3, 1, 3])[0]


def _run(random_: random.Random, folder: Path) -> tuple[str, tuple[str, ...]]:
    path = folder / "run" / random_.choice(["manifest.json", "record.parquet", "scenario.toml"])
    change = {".json": mutators.as_json, ".toml": mutators.toml}
    if path.suffix in change:
        _text(path, random_, change[path.suffix])
    else:
        path.write_bytes(mutators.damaged(random_, path.read_bytes()))
    return path.name, ("smooth", "run", "--no-figures", "--out", "out")


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
    "results": (_results, 14), "cache": (_cache, 4), "run": (_run, 8),
}  # fmt: skip


def _text(
    path: Path, random_: random.Random, change: Callable[[random.Random, str], str]
) -> None:
    path.write_bytes(change(random_, path.read_text("utf-8")).encode(errors="surrogatepass"))


@mutators.cases(quick=30, most=2000)
def test_a_mutated_file_gives_a_result_or_a_line(
    inputs: Inputs, tmp_path: Path, number: int
) -> None:
    random_ = mutators.generator(number)
    folder = tmp_path / "cwd"
    shutil.copytree(inputs.folder, folder)
    for name in ("home", "tmp"):
        (tmp_path / name).mkdir()
    kind = random_.choices(list(KINDS), [weight for _, weight in KINDS.values()])[0]
    if kind == "cache":
        shutil.copytree(inputs.cache, tmp_path / "cache")
    file, command = KINDS[kind][0](random_, folder)
    before, around = _there(tmp_path), os.listdir(tmp_path.parent)
    print(f"SBLCOSIM_MUTATION_SEED={mutators.SEED} {number}: {kind} {file}: {' '.join(command)}")

    cache = tmp_path / "cache" if kind == "cache" else None
    ended = inputs.run(command, folder, inputs.environment(tmp_path, cache))
    print(f"exit code {ended.code}, {ended.seconds:.1f} s, {ended.megabytes:.0f} MB")
    print(ended.output[:2000], ended.errors[:4000], sep="\n---\n")
    judge(ended, None if kind == "cache" else file.removesuffix(".fmu"))
    new = {p for p, what in _there(tmp_path).items() if before.get(p) != what}
    gone = before.keys() - _there(tmp_path).keys()
    home = {"study": "cwd/results", "new": f"cwd/{FILE_NAME}"}.get(command[0], "-")
    allowed = ("cwd/out", "cache", home)
    assert not [p for p in (*new, *gone) if not p.startswith(allowed)]
    assert os.listdir(tmp_path.parent) == around
    assert not any(map(os.path.lexists, mutators.OUTSIDE))
    shutil.rmtree(tmp_path)


def _there(folder: Path) -> dict[str, object]:
    """What is in a folder: of files the size and the time of their last change."""
    return {
        str(p.relative_to(folder)): (s.st_size, s.st_mtime_ns) if p.is_file() else "folder"
        for p in folder.rglob("*")
        for s in [p.lstat()]
    }
