"""Whatever an SSP package holds, `run` and `plan` end with a result, or with one line."""

from __future__ import annotations

import io
import os
import random
import sys
import zipfile
from pathlib import Path

import mutators
import pytest
from command_line import CommandLine, Inputs, judge
from made_packages import block, described, flat, nested, packed, step, tag
from stranger import build_stranger

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="forks")

TEXTS = (".ssd", ".ssv", ".ssm")
QUIETLY = ("--no-figures", "--step-timeout", "5", "--out")


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory, commands: CommandLine) -> Inputs:
    """The packages x0.ssp and x1.ssp, which run; and a cache with what runs them."""
    base = tmp_path_factory.mktemp("packages")
    folder = base / "cwd"
    for name in ("cwd", "home", "tmp"):
        (base / name).mkdir()
    compiled = {fmi: build_stranger(fmi, base / str(fmi)) for fmi in (2, 3)}
    metres = dict.fromkeys(("a", "c", "gained", "total"), "m")
    blocks = {
        "block__fmu": block(compiled.__getitem__, 2, metres, stopTime=2, stepSize=0.5),
        "three__fmu": block(compiled.__getitem__, 3, metres),
    }
    made = Inputs(folder, base / "cache", commands)
    after = [step(0.25) + tag("ssd:DefaultExperiment", startTime=0, stopTime=1), ""]
    for i, ((root, files), end) in enumerate(zip((nested(), flat()), after, strict=True)):
        packed(folder / f"x{i}.ssp", described(root, end), **blocks, **files)
        ended = commands(("run", f"x{i}.ssp", *QUIETLY, str(i)), folder, made.environment(base))
        assert ended.code == 0, ended.errors
    return made


def _mutated(random_: random.Random, content: bytes) -> bytes:
    """Elements, attributes and text of its XML files, or the archive and what is in it."""
    if random_.random() < 0.25:
        change = dict.fromkeys((*TEXTS, ".xml"), mutators.xml)
        return mutators.archive(random_, content, change)
    change_ = random_.choice([mutators.xml, mutators.elements, mutators.elements])
    made = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(made, "w") as new:
        texts = [name for name in old.namelist() if name.endswith(TEXTS)]
        target = random_.choice([texts[0], *texts])
        for name in old.namelist():
            data = old.read(name)
            if name == target:
                data = change_(random_, data.decode()).encode(errors="surrogatepass")
            new.writestr(name, data)
    return made.getvalue()


@mutators.cases(quick=10, most=1500)
def test_a_mutated_package_gives_a_result_or_one_line(
    sound: Inputs, tmp_path: Path, number: int
) -> None:
    random_ = mutators.generator(number)
    folder = tmp_path / "cwd"
    for each in ("cwd", "home", "tmp"):
        (tmp_path / each).mkdir()
    content = _mutated(random_, (sound.folder / random_.choice(["x0.ssp", "x1.ssp"])).read_bytes())
    (folder / "wild.ssp").write_bytes(content)
    run = ("run", "wild.ssp", *QUIETLY, "out")
    command = random_.choice([run, run, ("plan", "wild.ssp")])
    print(f"SBLCOSIM_MUTATION_SEED={mutators.SEED} {number}: {' '.join(command)}")

    ended = sound.run(command, folder, sound.environment(tmp_path))
    print(f"exit code {ended.code}, {ended.seconds:.1f} s, {ended.megabytes:.0f} MB")
    print(ended.output[:2000], ended.errors[:4000], sep="\n---\n")
    judge(ended, "wild.ssp")
    wrong = [line for line in ended.errors.splitlines() if line.startswith("error: ")]
    assert len(wrong) == (ended.code == 2)
    assert ended.code in {0, 2}
    assert set(os.listdir(folder)) <= {"wild.ssp", "out"}
    assert (folder / "wild.ssp").read_bytes() == content
    assert not os.listdir(tmp_path / "tmp")
    assert not any(map(os.path.lexists, mutators.OUTSIDE))
