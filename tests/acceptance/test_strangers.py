"""Receivers that this project's code has no part in run in our masters, by file name only."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
import sblcosim
from click.testing import Result
from sblcosim.cli import app
from sblcosim.export.ssp import export_ssp
from typer.testing import CliRunner

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def receivers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The FMUs, built as the examples say."""
    folder = tmp_path_factory.mktemp("strangers")
    assert importlib.util.find_spec("pythonfmu"), "pip install pythonfmu"
    for command in (
        [EXAMPLES / "receiver_in_c" / "build.py", "receiver.fmu"],
        ["-m", "pythonfmu", "build", "-f", EXAMPLES / "receiver_in_python.py"],
    ):
        subprocess.run([sys.executable, *command], cwd=folder, check=True, capture_output=True)
    return {"C": folder / "receiver.fmu", "PythonFMU": folder / "LinearFix.fmu"}


def run(*arguments: object, folder: Path) -> dict:
    command = ["run", "paper-scenario-1", "--set", "time.duration_s=20", "--json", "--no-figures"]
    done = CliRunner().invoke(
        app, [*command, *map(str, arguments), "--out", str(folder)], catch_exceptions=False
    )
    assert done.exit_code == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize("master", ["python", "native"])
@pytest.mark.parametrize("language", ["C", "PythonFMU"])
def test_a_receiver_of_a_stranger_is_swapped_in_by_file_name(
    language: str, master: str, receivers: dict[str, Path], tmp_path: Path
) -> None:
    file = receivers[language]
    result = run("--receiver", file, "--master", master, folder=tmp_path / "out")
    total = result["errors"][file.stem]["absolute"]["total"]
    assert 0.1 < total["rms_m"] < 2.0


def test_two_strangers_with_the_same_formula_agree(
    receivers: dict[str, Path], tmp_path: Path
) -> None:
    both = [word for file in receivers.values() for word in ("--receiver", file)]
    errors = run(*both, folder=tmp_path / "out")["errors"]
    one, other = (errors[file.stem]["absolute"]["total"]["rms_m"] for file in receivers.values())
    assert one == pytest.approx(other, rel=1e-9)


def test_of_a_stranger_without_covariance_nothing_says_that_it_is_consistent(
    receivers: dict[str, Path], tmp_path: Path
) -> None:
    study = tmp_path / "blind.toml"
    study.write_text(f"""
scenario = "paper-scenario-1"
replicates = 3
receivers = ["ekf", "{receivers['C'].as_posix()}"]
[fixed.time]
duration_s = 20.0
[factors.gps]
keys = ["platform.gps_horizontal_std_m"]
levels = [0.1, 3.5]
""")

    def call(*arguments: object) -> Result:
        return CliRunner().invoke(app, [*map(str, arguments)], catch_exceptions=False)

    out = tmp_path / "out"
    done = call("study", study, "--out", out)
    assert done.exit_code == 0, done.stderr
    said = [line.split(": ", 1) for line in done.stdout.splitlines() if ": " in line]
    lines = dict(reversed(said))
    assert "do not trust its covariance" in lines["ekf"]
    assert lines["receiver"].endswith("; no covariance")
    table = sblcosim.study.store.table(out)
    assert table["receiver.inconsistent"].isna().all()
    assert table["ekf.inconsistent"].dtype == bool
    (tmp_path / "costs.toml").write_text("gps = [900, 40]")
    for command in (
        ["analyse", out], ["advise", out, "--costs", tmp_path / "costs.toml", "--limit", 0.5],
    ):
        done = call(*command, "--response", "receiver.inconsistent")
        assert (done.exit_code, done.stdout) == (2, "")
        assert done.stderr == (
            "error: receiver.inconsistent: must be known in some runs, got none; no estimate of "
            "receiver has a covariance\n"
        )
    one = call(
        "run", "paper-scenario-1", "--set", "time.duration_s=20", "--no-figures", "--receiver",
        receivers["C"], "--out", tmp_path / "run",
    )  # fmt: skip
    assert one.stdout.splitlines()[0].endswith("; no covariance")


def test_a_stranger_passes_the_check(receivers: dict[str, Path]) -> None:
    for file in receivers.values():
        done = CliRunner().invoke(app, ["check", str(file)])
        assert done.exit_code == 0, done.stdout


def test_a_receiver_may_call_its_variables_what_it_likes_if_terminals_say_what_they_are(
    receivers: dict[str, Path], tmp_path: Path
) -> None:
    names = {"position[1]": "north", "position[2]": "east", "position[3]": "down",
             "epoch": "when", "depth": "below", "update_count": "fixes"}  # fmt: skip
    kinds = {"depth": "depth"}
    other = tmp_path / "other.fmu"
    with zipfile.ZipFile(receivers["C"]) as old, zipfile.ZipFile(other, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "modelDescription.xml":
                for port, variable in names.items():
                    before, after = (f'name="{word}"'.encode() for word in (port, variable))
                    assert before in content
                    content = content.replace(before, after)
            new.writestr(name, content)
        terminals = "".join(
            f'<Terminal name="{variable}" matchingRule="plug" '
            f'terminalKind="org.sblcosim.{kinds.get(port, "estimate")}">'
            f'<TerminalMemberVariable variableName="{variable}" memberName="{port}" '
            'variableKind="signal"/></Terminal>'
            for port, variable in names.items()
        )
        new.writestr(
            "terminalsAndIcons/terminalsAndIcons.xml",
            '<fmiTerminalsAndIcons fmiVersion="3.0"><Terminals>'
            f"{terminals}</Terminals></fmiTerminalsAndIcons>",
        )
    done = CliRunner().invoke(app, ["check", str(other)])
    assert done.exit_code == 0, done.stdout
    assert "output Float64 [3] in m; north, east, down by a terminal" in done.stdout
    found = [
        run("--receiver", file, folder=tmp_path / file.stem)["errors"][file.stem]
        for file in (receivers["C"], other)
    ]
    assert found[0] == found[1]
    package = zipfile.ZipFile(export_ssp("paper-scenario-1", tmp_path / "x.ssp", other))
    assert b'endElement="other" endConnector="below"' in package.read("SystemStructure.ssd")
