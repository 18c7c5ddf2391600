"""The command line: what it prints, what it writes, and its exit codes."""

from __future__ import annotations

import json
import subprocess
import sys
import warnings
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
import sblcosim.api
import sblcosim.cli
import sblcosim.fmus.factory
from sblcosim.errors import ConfigurationWarning
from sblcosim.fmus.factory import build
from sblcosim.models import COMPONENTS, RECEIVERS
from sblcosim.scenario import load, shipped
from typer.testing import CliRunner, Result

SHORT = ["--set", "time.duration_s=5", "--no-figures"]


@pytest.fixture
def cli(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    """Run the command in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: CliRunner().invoke(
        sblcosim.cli.app, [str(a) for a in arguments], catch_exceptions=False
    )


def test_help_names_every_command_without_loading_what_is_slow() -> None:
    code = (
        "import sys\n"
        "from sblcosim.cli import main\n"
        "try:\n    main()\nexcept SystemExit as exit: code = exit.code\n"
        "slow = {'casadi', 'matplotlib', 'pandas', 'fmpy', 'scipy'} & set(sys.modules)\n"
        "sys.exit(f'loaded {slow}' if slow else code)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "--help"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    for command in ("run", "build", "receivers", "check", "calibrate", "new", "scenarios", "plan"):
        assert f"\n  {command} " in done.stdout


def test_version(cli: Callable[..., Result]) -> None:
    assert cli("--version").stdout == f"sblcosim {version('sblcosim')}\n"


def test_scenarios_and_receivers_are_listed(cli: Callable[..., Result]) -> None:
    scenarios, receivers = cli("scenarios").stdout, cli("receivers").stdout
    for name in shipped():
        assert f"{name} " in scenarios
        assert load(name).title in scenarios
    for name, component in RECEIVERS.items():
        assert f"{name} " in receivers
        assert component.description in receivers


def test_run_prints_the_table_and_writes_into_a_folder(cli: Callable[..., Result]) -> None:
    done = cli("run", "paper-scenario-1", *SHORT)
    assert done.exit_code == 0
    assert done.stderr == ""
    for word in ("The paper's Scenario 1", "ekf", "raw", "RMS", "total", "NEES", "NIS"):
        assert word in done.stdout
    assert done.stdout.endswith("written to runs/paper-scenario-1\n")
    written = {file.name for file in Path("runs/paper-scenario-1").iterdir()}
    assert {"record.parquet", "record.csv", "manifest.json", "scenario.toml"} <= written


def test_run_prints_json_and_nothing_else(cli: Callable[..., Result]) -> None:
    done = cli("run", "paper-scenario-1", *SHORT, "--json", "--out", "here", "--seed", 4)
    result = json.loads(done.stdout)
    assert result["errors"]["ekf"]["absolute"]["total"]["rms_m"] > 0.0
    assert result["seeds"] == {"target": 4, "platform": 4, "acoustics": 4}
    assert result["folder"] == "here"
    assert Path("here/manifest.json").is_file()


def test_run_takes_receivers_keys_and_fmi_version(cli: Callable[..., Result]) -> None:
    done = cli(
        "run", "paper-scenario-1", *SHORT, "--receiver", "sequential", "--receiver", build("ekf"),
        "--set", "platform.arm_length_m=0.4", "--fmi", 3,
    )  # fmt: skip
    assert done.exit_code == 0
    manifest = json.loads(Path("runs/paper-scenario-1/manifest.json").read_text())
    assert manifest["receivers"] == ["sequential", "ekf", "raw"]
    assert manifest["scenario"]["platform"]["arm_length_m"] == 0.4


def test_the_scenario_that_is_written_can_be_run(cli: Callable[..., Result]) -> None:
    first = cli("run", "harbour-random", *SHORT, "--json", "--out", "one")
    again = cli("run", "one/scenario.toml", "--no-figures", "--json", "--out", "two")
    assert json.loads(first.stdout)["errors"] == json.loads(again.stdout)["errors"]


def test_plan_prints_components_and_connections_and_writes_nothing(
    cli: Callable[..., Result], tmp_path: Path
) -> None:
    done = cli("plan", "paper-scenario-1", "--receiver", "sequential")
    assert "sequential.fmu" in done.stdout
    assert "sequential.range" in done.stdout
    assert list(tmp_path.iterdir()) == []


def test_new_writes_a_scenario_that_can_be_run(cli: Callable[..., Result]) -> None:
    assert cli("new", "mine.toml").exit_code == 0
    assert cli("run", "mine.toml", *SHORT).stdout.endswith("written to runs/mine\n")
    assert cli("new", "walk.toml", "--from", "harbour-square").exit_code == 0
    assert load("walk.toml").target.side_m == 15.0


def test_new_replaces_a_file_only_by_force(cli: Callable[..., Result]) -> None:
    Path("mine.toml").write_text("precious")
    refused = cli("new", "mine.toml")
    assert (refused.exit_code, Path("mine.toml").read_text()) == (2, "precious")
    assert "--force" in refused.stderr
    assert cli("new", "mine.toml", "--force").exit_code == 0
    assert load("mine.toml").name == "mine"


def test_build_writes_the_fmus_of_both_versions(cli: Callable[..., Result]) -> None:
    done = cli("build", "ekf", "target")
    names = [f"fmus/fmi{v}/{name}.fmu" for v in (2, 3) for name in ("ekf", "target")]
    assert done.stdout.split() == names
    assert Path(names[0]).read_bytes() == build("ekf", 2).read_bytes()
    cli("build", "--fmi", "3", "--out", "all")
    assert {p.stem for p in Path("all/fmi3").iterdir()} == set(COMPONENTS)


def test_check_says_whether_an_fmu_can_be_a_receiver(cli: Callable[..., Result]) -> None:
    good, bad = cli("check", build("sequential", 3)), cli("check", build("platform"))
    assert (good.exit_code, bad.exit_code) == (0, 1)
    assert "position" in good.stdout
    assert "update_count" in bad.stdout


def test_calibrate_prints_the_speed_of_sound_and_writes_the_range_test(
    cli: Callable[..., Result],
) -> None:
    done = cli("calibrate", "--sound-speed", 1480, "--json", "--out", "here")
    result = json.loads(done.stdout)
    assert result["line"]["value"] == pytest.approx(1480, abs=5)
    assert Path("here/range_test.svg").is_file()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("run", "paper-scenaro-1"), "did you mean 'paper-scenario-1'?"),
        (("run", "broken.toml"), "broken.toml, line 1, column "),
        (("run", "paper-scenario-1", "--receiver", "efk"), "did you mean 'ekf'?"),
        (("run", "paper-scenario-1", "--receiver", "no.fmu"), "'no.fmu'"),
        (("run", "paper-scenario-1", "--set", "target.fmu=no.fmu"), "no.fmu"),
        (("run", "paper-scenario-1", "--set", "seed"), "must be table.key=value"),
        (("run", "paper-scenario-1", *SHORT, "--out", "full"), "must be empty or hold nothing"),
        (("check", "no.fmu"), "no.fmu"),
        (("check", "broken.toml"), "broken.toml"),
        (("build", "efk"), "did you mean 'ekf'?"),
        (("new", "no/where.toml"), "must be writable"),
        (("new", "mine.toml", "--from", "harbour"), "harbour-square"),
        (("calibrate", "--pings", "1"), "pings: must be 2 or more"),
    ],
)
def test_an_error_is_one_line_and_the_exit_code_is_2(
    cli: Callable[..., Result], arguments: tuple[str, ...], message: str
) -> None:
    Path("broken.toml").write_text("[target\n")
    Path("full").mkdir()
    Path("full/thesis.tex").write_text("precious")
    done = cli(*arguments)
    assert done.exit_code == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: ")
    assert message in line
    assert not Path("runs").exists()


def test_several_problems_are_several_lines(cli: Callable[..., Result]) -> None:
    done = cli("run", "paper-scenario-1", "--set", "seed=-1", "--set", "target.x=1")
    assert [line[:7] for line in done.stderr.splitlines()] == ["error: ", "error: "]


def test_a_warning_is_one_line_on_stderr(
    cli: Callable[..., Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    run = sblcosim.api.run

    def warning(*arguments: Any, **options: Any) -> Any:
        warnings.warn("ekf: beware", ConfigurationWarning, stacklevel=2)
        return run(*arguments, **options)

    monkeypatch.setattr(sblcosim.api, "run", warning)
    done = cli("run", "paper-scenario-1", *SHORT, "--json")
    assert done.stderr == "warning: ekf: beware\n"
    json.loads(done.stdout)


def test_an_interrupted_run_says_so_and_leaves_nothing(
    cli: Callable[..., Result], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def interrupted(*arguments: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("sblcosim.artifacts.write_table", interrupted)
    done = cli("run", "paper-scenario-1", *SHORT, "--out", "here")
    assert (done.exit_code, done.stderr) == (130, "interrupted; nothing was written\n")
    assert list(tmp_path.iterdir()) == []
