"""The commented scenario file to begin with."""

from __future__ import annotations

import re
import sys
import tomllib
import warnings
from pathlib import Path

import pytest
import sblcosim
from sblcosim.cli import app
from sblcosim.models.settings.presets import PRESETS
from sblcosim.scenario.likes import LIKES
from sblcosim.scenario.scenario import load, shipped
from sblcosim.scenario.schema import Acoustics, Platform, Receiver, Target, Time
from sblcosim.scenario.starter import starter
from typer.testing import CliRunner

TABLES = {
    "time": Time, "target": Target, "platform": Platform, "acoustics": Acoustics,
    "receiver": Receiver,
}  # fmt: skip


def test_a_starter_is_valid_as_it_is() -> None:
    scenario = load(tomllib.loads(starter("mine")))
    assert '# name = "mine"  # that of the file' in starter("mine")
    assert scenario.platform.beaufort == 2


def test_a_grade_says_which_keys_it_sets_and_which_are_given() -> None:
    lines = starter("x", {"platform": {"imu_tilt_bias_deg": 0.5}}).splitlines()
    text = " ".join(line.lstrip("# ") for line in lines)
    wins = "of these, what is given wins"
    for key, governed in PRESETS.items():
        ((keys, kept),) = re.findall(rf"It sets ([^.;]*); {wins}([^.]*)\. {key} =", text)
        assert {*keys.split(", ")} == governed
        assert kept == (": imu_tilt_bias_deg" if key == "imu_grade" else "")


def test_a_starter_names_every_key_of_every_table_with_a_comment_above() -> None:
    text = starter("mine")
    for name, table in TABLES.items():
        section = re.split(r"^\[\w+\]$", text.partition(f"[{name}]\n")[2], flags=re.M)[0]
        for key in table.model_fields:
            assert re.search(rf"^# .*\n(# )?{key} = ", section, flags=re.M), f"[{name}] {key}"


def test_a_key_that_is_commented_out_is_valid_when_it_is_put_in_use() -> None:
    lines, tried = starter("mine").splitlines(), 0
    for name in TABLES:
        start = lines.index(f"[{name}]")
        for number, line in enumerate(lines[start + 1 :], start + 1):
            if line.startswith("["):
                break
            key = line.removeprefix("# ").partition(" = ")[0]
            # A foreign FMU goes with other keys, which are then to be changed as well.
            alone = key not in ("fmu", "parameters")
            if alone and line.startswith("# ") and key in TABLES[name].model_fields:
                changed = [*lines[:number], line.removeprefix("# "), *lines[number + 1 :]]
                load(tomllib.loads("\n".join(changed)))
                tried += 1
    assert tried > 30


@pytest.mark.parametrize("name", shipped())
def test_a_starter_from_a_scenario_is_that_scenario_under_another_name(name: str) -> None:
    made = load(tomllib.loads(starter("mine", name)))
    assert made.model_dump(exclude={"name"}) == load(name).model_dump(exclude={"name"})


@pytest.mark.parametrize("name", LIKES)
def test_each_system_to_begin_with_runs_as_it_is(name: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    done = CliRunner().invoke(app, ["new", str(file), "--like", name])
    assert done.exit_code == 0, done.output
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = sblcosim.run(file, overrides={"time.duration_s": 30.0})
    assert result.scenario.name == "mine"
    assert len(result.record.estimates(result.scenario.receiver.type)) > 5


def test_questions_are_asked_on_a_terminal_and_asked_again(tmp_path: Path) -> None:
    """In a real terminal: Enter takes what stands in brackets, and what is wrong is asked again."""
    pexpect = pytest.importorskip("pexpect")
    child = pexpect.spawn(
        sys.executable, ["-m", "sblcosim", "new", "mine.toml", "--like", "lbl"],
        cwd=str(tmp_path), encoding="utf-8", timeout=300,
    )
    child.expect("beacons are.*:")
    child.sendline("[[0, 0, 9], [50, 0, 9]]")
    child.expect("must be an array of 3 to 8 rows")
    assert "\nbeacon_m: " in child.before
    assert "override" not in child.before
    child.sendline("[[0, 0, 9], [50, 0, 9], [0, 50, 9]]")
    child.expect("surveyed.*:")
    child.sendline("0.1")
    child.expect("ping.*:")
    child.sendline("")
    child.expect("swims.*:")
    child.sendline("")
    child.expect(pexpect.EOF)
    scenario = load(tmp_path / "mine.toml")
    assert scenario.beacons == 3
    assert scenario.platform.mounting_std_m == 0.1
    assert scenario.time == load("harbour-lbl").time


@pytest.mark.parametrize(
    ("options", "words"),
    [(["--like", "bouys"], "did you mean 'buoys'?"),
     (["--like", "lbl", "--from", "realistic-dive"], "--like: must come without --from")],
)
def test_what_is_no_such_system_is_said(options: list[str], words: str, tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["new", str(tmp_path / "x.toml"), *options])
    assert done.exit_code == 2
    assert words in done.stderr
    assert not any(tmp_path.iterdir())
