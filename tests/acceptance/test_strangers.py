"""Receivers that this project's code has no part in run in our masters, by file name only."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import pytest
from sblcosim.cli import app
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


def test_a_stranger_passes_the_check(receivers: dict[str, Path]) -> None:
    for file in receivers.values():
        done = CliRunner().invoke(app, ["check", str(file)])
        assert done.exit_code == 0, done.stdout
