"""What the shell is offered, by its own protocol: variables of the environment."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from quick import one_in
from sblcosim.cli.common import completion
from sblcosim.models import COMPONENTS, RECEIVERS
from sblcosim.models.target.variables import TRAJECTORIES
from sblcosim.scenario.scenario import load, shipped
from sblcosim.scenario.schema import Table
from sblcosim.study.study import shipped as studies

COMMAND = Path(sys.executable).with_name("sblcosim")


def said(**variables: str) -> str:
    done = subprocess.run(
        [COMMAND], env=os.environ | variables, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def offered(line: str) -> list[str]:
    """Words that bash is offered at the end of a line."""
    words = line.split(" ")
    return said(
        _SBLCOSIM_COMPLETE="complete_bash", COMP_WORDS=line, COMP_CWORD=str(len(words) - 1)
    ).split()


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("sblcosim ru", ["run"]),
        ("sblcosim export ", ["ssp", "fmu"]),
        ("sblcosim run ", [*shipped()]),
        ("sblcosim run harbour-s", ["harbour-spiral", "harbour-square"]),
        ("sblcosim run --seed abc harbour-s", ["harbour-spiral", "harbour-square"]),
        ("sblcosim new mine.toml --from real", ["realistic-dive", "realistic-sea"]),
        ("sblcosim study ", [*studies()]),
        ("sblcosim require one", ["one-metre"]),
        ("sblcosim plan realistic-dive --receiver ", [*RECEIVERS]),
        ("sblcosim run realistic-dive --receiver ekf --receiver seq", ["sequential"]),
        ("sblcosim build e", [name for name in COMPONENTS if name.startswith("e")]),
        ("sblcosim run realistic-dive --master ", ["native", "python", "lanes"]),
        ("sblcosim schema stu", ["study", "study.json", "studies.json"]),
        ("sblcosim run realistic-dive --verb", ["--verbose"]),
        ("sblcosim run realistic-dive --set platform.arm",
         ["platform.arm_length_m=", "platform.arm_length_m=3.0"]),
        ("sblcosim run realistic-dive --set target.traj",
         ["target.trajectory=", *(f"target.trajectory={name}" for name in TRAJECTORIES.values())]),
        ("sblcosim budget realistic-dive --with clock+so", ["clock+sound-speed"]),
        ("sblcosim compare realistic-dive harbour-s", ["harbour-spiral", "harbour-square"]),
        ("sblcosim compare realistic-dive --response absolute_total_p9", ["absolute_total_p95_m"]),
        ("sblcosim run mine.to", []),  # the shell's own files follow
        ("sblcosim nosuch x", []),
    ],
)  # fmt: skip
@one_in(3)
def test_words_are_offered(line: str, words: list[str]) -> None:
    assert offered(line) == words


def all_keys() -> Iterator[str]:
    scenario = load({})
    for name in type(scenario).model_fields:
        table = getattr(scenario, name)
        if isinstance(table, Table):
            yield from (f"{name}.{key}" for key in type(table).model_fields)
        else:
            yield name


def test_every_key_is_offered_and_its_value_can_be_read() -> None:
    assert [word for word, _ in completion.keys("")] == [f"{key}=" for key in all_keys()]
    ends = [[0, 0, 1], [1, 0, 1]]
    course = {"target": {"waypoint_m": ends, "track_m": ends, "track_time_s": [0, 1]},
              "platform": {"wave_height_m": 0.6}}
    for key in all_keys():
        for word, explained in completion.keys(f"{key}=")[1:]:
            load(course, [word])
            assert len(explained) <= completion.LONGEST


def test_zsh_and_fish_are_told_what_words_mean() -> None:
    zsh = said(
        _SBLCOSIM_COMPLETE="complete_zsh",
        _TYPER_COMPLETE_ARGS="sblcosim run x --set platform.arm_l",
    )
    assert '"platform.arm_length_m=":"Length of each arm of the cross' in zsh
    fish = said(
        _SBLCOSIM_COMPLETE="complete_fish", _TYPER_COMPLETE_FISH_ACTION="get-args",
        _TYPER_COMPLETE_ARGS="sblcosim run x --receiver ek",
    )  # fmt: skip
    assert fish.startswith("ekf\tThe paper's Extended Kalman Filter")


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
def test_bash_takes_the_script() -> None:
    script = said(_SBLCOSIM_COMPLETE="source_bash")
    asked = (
        f"{script}\nCOMP_WORDS=(sblcosim run paper-); COMP_CWORD=2\n"
        'complete -p sblcosim\n_sblcosim_completion sblcosim\necho "${COMPREPLY[*]}"\n'
    )
    path = os.pathsep.join([str(COMMAND.parent), os.environ["PATH"]])
    done = subprocess.run(
        ["bash", "-c", asked], env=os.environ | {"PATH": path}, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.stdout.splitlines() == [
        "complete -o default -F _sblcosim_completion sblcosim",
        "paper-scenario-1 paper-scenario-2 paper-scenario-3",
    ]


def test_a_folder_that_is_gone_does_not_disturb_the_prompt(tmp_path: Path) -> None:
    variables = "_SBLCOSIM_COMPLETE=complete_bash COMP_WORDS='sblcosim run harbour-r' COMP_CWORD=2"
    script = f"cd {tmp_path} && rmdir {tmp_path} && {variables} {COMMAND}"
    done = subprocess.run(["sh", "-c", script], capture_output=True, text=True, check=False)
    assert (done.stdout.strip(), done.stderr) == ("harbour-random", "")
