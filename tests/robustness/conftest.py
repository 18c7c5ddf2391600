"""Sound files to damage, and the command line that reads them."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from sblcosim.fmus.build.factory import build
from sblcosim.models import COMPONENTS
from sblcosim.scenario.starter import starter

sys.path.insert(0, str(Path(__file__).parents[1] / "unit" / "orchestrator"))
sys.path.insert(0, str(Path(__file__).parents[1] / "fmu" / "stranger"))
sys.path.insert(0, str(Path(__file__).parent))

import log_samples
import made_logs
from command_line import CommandLine, Inputs
from shared import shared

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


@pytest.fixture(scope="session")
def commands() -> Iterator[CommandLine]:
    """The command line."""
    run = CommandLine()
    try:
        yield run
    finally:
        run.close()


@pytest.fixture(scope="session")
def inputs(tmp_path_factory: pytest.TempPathFactory, commands: CommandLine) -> Inputs:
    """Files, a study's results among them; no test writes there."""

    def fill(base: Path) -> dict[str, str]:
        _fill(Inputs(base / "cwd", base / "cache", commands), base)
        return {}

    base, _ = shared(tmp_path_factory, "inputs", fill)
    return Inputs(base / "cwd", base / "cache", commands)


def _fill(made: Inputs, base: Path) -> None:
    folder, run = made.folder, made.run
    for name in ("cwd", "home", "tmp"):
        (base / name).mkdir()
    text = starter("scenario")
    assert 'duration_s = "path"' in text
    (folder / "scenario.toml").write_text(text.replace('duration_s = "path"', "duration_s = 4.0"))
    (folder / "study.toml").write_text(STUDY)
    (folder / "costs.toml").write_text(COSTS)
    made_logs.in_folder(folder / "dive")
    (folder / "dive.nmea").write_text(log_samples.nmea()["dive.nmea"])
    (folder / "mapping.toml").write_text('[mapping.receptions]\nfile = "receptions.csv"\n')
    for fmi in (2, 3):
        shutil.copy(build("ekf", fmi), folder / f"ekf{fmi}.fmu")
        for name in COMPONENTS:  # so that nothing is compiled again
            place = build(name, fmi).parent
            shutil.copytree(place, made.cache / place.name)
    sound = made.environment(base)
    done = run(("study", "study.toml", "--out", "results"), folder, sound)
    assert done.code == 0, done.errors
    command = ("run", "scenario.toml", "--no-figures", "--receiver", "ekf2.fmu", "--out", "out")
    done = run(command, folder, sound)
    assert done.code == 0, done.errors
    shutil.rmtree(folder / "out")
    command = ("run", "scenario.toml", "--no-figures", "--receiver", "coupled", "--out", "run")
    done = run(command, folder, sound)
    assert done.code == 0, done.errors
