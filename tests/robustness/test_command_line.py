"""Whatever is typed, a command ends with a result, or with lines that say what is wrong."""

from __future__ import annotations

import random
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mutators
import pytest
import typer.main
from command_line import Inputs, judge
from quick import one_in
from sblcosim.cli import app

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="forks")

NAMES = [
    "scenario.toml", "study.toml", "costs.toml", "results", "run", "ekf2.fmu", "ekf3.fmu",
    "nothing.toml",
    "paper-scenario-1", "harbour-square", "ekf", "sequential", "multilateration", "native",
    "python", "lanes", "threads", "log", "results/study.json", ".", "seed=3",
    "platform.arm_length_m=1", "time.duration_s=2", "receiver.gate=3", "absolute_total_rms_m",
    "0", "2", "3", "dive", "dive/receptions.csv", "dive.nmea", "mapping.toml",
]  # fmt: skip
"""What makes sense somewhere."""
LONG = "x" * 3000
DEEP = "/".join(["y" * 200] * 15)
TAKES_LONG = {"paper", "--all-platforms", "--scheduler", "--replicates", "--pings", "--workers"}


def _commands() -> Iterator[tuple[list[str], Any]]:
    whole: Any = typer.main.get_command(app)
    for name, command in whole.commands.items():
        below = getattr(command, "commands", None)
        if below is None:
            yield [name], command
        else:
            yield from (([name, inner], found) for inner, found in below.items())


COMMANDS = [(words, found) for words, found in _commands() if words[0] not in TAKES_LONG]


def typed(random_: random.Random) -> list[str]:
    """A command with some of its arguments and options, some of them nonsense."""
    words, command = random_.choice(COMMANDS)

    def value() -> str:
        pool = random_.choices([NAMES, mutators.NUMBERS, mutators.WORDS], [6, 1, 1])[0]
        return random_.choice([w for w in pool if "\0" not in w and w != "/"])

    line = list(words)
    for param in command.params:
        names = [name for name in param.opts if name.startswith("-")]
        if not names:
            line += [value() for _ in range(random_.choices([0, 1, 2], [1, 12, 1])[0])]
        elif names[0] not in TAKES_LONG and random_.random() < 0.3:
            flag = getattr(param, "is_flag", False)
            times = random_.choices([1, 2], [4, 1])[0]
            line += [w for _ in range(times) for w in ([names[0]] if flag else [names[0], value()])]
    if random_.random() < 0.1:
        line.insert(random_.randrange(len(line) + 1), random_.choice([
            "--no", "-x", "--", "--sed", "--out=", "-h", "--help", value(),
        ]))  # fmt: skip
    return line


@mutators.cases(quick=30, most=60)
def test_anything_typed_gives_a_result_or_a_line(
    inputs: Inputs, tmp_path: Path, number: int
) -> None:
    line = typed(mutators.generator(number))
    _judged(inputs, tmp_path, line)


@one_in(2)
@pytest.mark.parametrize("line", [
    "run X", "run X.toml", "run DEEP.toml", "run scenario.toml --receiver X",
    "run scenario.toml --receiver DEEP.fmu", "run scenario.toml --set X",
    "run scenario.toml --set X=1", "run scenario.toml --set target.X=1",
    "run scenario.toml --set target.speed_m_s=X", "run scenario.toml --set name='X'",
    "run scenario.toml --set receiver.type='X'", "run scenario.toml --set target.fmu='X.fmu'",
    "run scenario.toml --set target.trajectory='X'", "run scenario.toml --master X",
    "run scenario.toml --set receiver.parameters.X=1", "run scenario.toml --out X",
    "run scenario.toml --X", "run scenario.toml X", "run scenario.toml --seed=X", "X",
    "plan X", "calibrate --out X", "new X", "new n.toml --from X", "study X",
    "study study.toml --executor X", "study study.toml --master X", "study study.toml --out X",
    "smooth X", "smooth DEEP", "smooth run --out X", "smooth run --set X",
    "smooth run --set receiver.X=1", "replay X y", "replay results X", "replay results 0 --out X",
    "analyse X", "require X",
    "analyse results --response X", "analyse results --receiver X", "analyse results --out X",
    "analyse results --transform X", "advise X --costs costs.toml", "advise results --costs X",
    "advise results --costs costs.toml --limit 2 --response X", "paper --out X", "build X",
    "build ekf --out X", "check X", "check DEEP", "conformance X",
    "conformance ekf2.fmu --check X", "export ssp X", "export ssp scenario.toml --out X",
    "export fmu X", "export X", "budget X", "budget scenario.toml --with X",
    "budget scenario.toml --out X", "log X", "log DEEP", "log study.toml --mapping X",
    "log dive --out X", "log dive/receptions.csv --mapping X", "process X", "process DEEP",
    "process dive --receiver X", "process dive --set X", "process dive --scenario X",
    "process dive --trajectories X", "process dive --interval X", "process dive --out X",
    "identify X", "identify DEEP", "identify dive --scenario X", "identify dive --out X",
    "run scenario.toml --trajectories X", "run scenario.toml --log --out X",
    "budget scenario.toml --frame X", "budget scenario.toml --receiver X",
])  # fmt: skip
@one_in(2)
def test_long_values_are_shortened(inputs: Inputs, tmp_path: Path, line: str) -> None:
    words = [word.replace("X", LONG).replace("DEEP", DEEP) for word in line.split()]
    for text in _judged(inputs, tmp_path, words, code=2):
        assert "x" * 81 not in text
        assert "y" * 200 not in text


@one_in(2)
@pytest.mark.parametrize(("before", "after"), [
    ("platform.arm_length_m", "X"), ("platform.arm_length_m", "platform.X"), ("0.4, 3.0", "'X'"),
    ('"ekf"', '"X"'), ('"scenario.toml"', '"X"'), ("[fixed]", "[X]"), ("= 0.2", "= 'X'"),
    ('"acoustics.range_std_m"', '"acoustics.X"'), ("replicates = 3", "replicates = 3\nX = 1"),
    ("[fixed]", "[design]\nkind = 'X'\n[fixed]"),
    ("[fixed]", "[design]\nkind = 'fraction'\ngenerators = ['X']\n[fixed]"),
])  # fmt: skip
@one_in(2)
def test_long_values_of_a_study_are_shortened(
    inputs: Inputs, tmp_path: Path, before: str, after: str
) -> None:
    text = (inputs.folder / "study.toml").read_text()
    assert before in text
    (tmp_path / "long.toml").write_text(text.replace(before, after.replace("X", LONG)))
    for line in _judged(inputs, tmp_path, ["study", "../long.toml", "--dry-run"], code=2):
        assert "x" * 81 not in line


def _judged(
    inputs: Inputs, folder: Path, line: list[str], code: int | None = None
) -> list[str]:
    """Lines of errors of a command that has ended as it must."""
    for name in ("home", "tmp"):
        (folder / name).mkdir()
    shutil.copytree(inputs.folder, folder / "cwd")
    print(f"SBLCOSIM_MUTATION_SEED={mutators.SEED}: {[word[:200] for word in line]}")
    ended = inputs.run(line, folder / "cwd", inputs.environment(folder))
    print(f"exit code {ended.code}, {ended.seconds:.1f} s, {ended.megabytes:.0f} MB")
    print(ended.output[:2000], ended.errors[:4000], sep="\n---\n")
    judge(ended, None)
    assert code in {None, ended.code}
    assert not [*(folder / "home").iterdir(), *(folder / "tmp").iterdir()]
    subprocess.run(["rm", "-rf", str(folder)], check=True)  # however deep it is
    return ended.errors.splitlines()
