"""The same scenario in independent tools: the same sequence of (epoch, estimate), to 1e-12.

The tools run by the scripts in ``examples/``, as a user would start them.
"""

from __future__ import annotations

import importlib.util
import os
import re
import shlex
import subprocess
import sys
import zipfile
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import sblcosim
from numpy.typing import NDArray
from quick import few, one_in
from sblcosim.cli import app
from sblcosim.export.container import export_fmu
from sblcosim.export.ssp import export_ssp
from sblcosim.fmus.build.factory import build
from sblcosim.fmus.standard import Fmi
from sblcosim.models import COMPONENTS
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.execution import MASTERS, execute
from sblcosim.simulation.resolve import resolve
from typer.testing import CliRunner

EXAMPLES = Path(__file__).parents[2] / "examples"
SCENARIOS = {
    "the paper's": ("paper-scenario-1", {}),
    # Packets are lost, and the receiver is updated less often than the rest is stepped.
    "another": (
        {
            "time": {"sampling_time_s": 0.1, "ekf_ratio": 2, "duration_s": 40.0},
            "platform": {"beaufort": 3, "gps_horizontal_std_m": 0.5, "imu_tilt_std_deg": 1.0},
            "acoustics": {"loss_probability": 0.2, "outlier_probability": 0.05},
            "receiver": {"prior": "true"},
        },
        {},
    ),
    "one with another receiver": (
        {
            "time": {"sampling_time_s": 0.1, "duration_s": 20.0},
            "receiver": {"type": "sequential", "prior": "true"},
        },
        {},
    ),
}
TOOLS = {
    "FMPy, a loop of one's own": ("in_fmpy.py", "baked.ssp"),
    "FMPy's SSP": ("in_fmpy_ssp.py", "baked.ssp"),
    "libcosim": ("in_libcosim.py", "plain.ssp"),
    "ecos": ("in_ecos.py", "plain.ssp"),
    "OMSimulator": ("in_omsimulator.py", "plain.ssp"),
    "OMSimulator, baked": ("in_omsimulator.py", "baked.ssp"),
    "libcosim, baked": ("in_libcosim.py", "baked.ssp"),
    "ecos, baked": ("in_ecos.py", "baked.ssp"),
    "fmucontainer in FMPy": ("in_container.py", "whole.fmu"),
}


def start(script: str, *arguments: object, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, EXAMPLES / script, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=600,
        env=os.environ | environment,
        check=False,
    )


def load(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Folder with a scenario's packages, by the scenario's name here."""
    folders: dict[str, Path] = {}

    def folder(name: str) -> Path:
        if name not in folders:
            scenario, overrides = SCENARIOS[name]
            made = folders[name] = tmp_path_factory.mktemp("packages")
            export_ssp(scenario, made / "plain.ssp", overrides=overrides)
            export_ssp(scenario, made / "baked.ssp", overrides=overrides, bake=True)
            export_fmu(scenario, made / "whole.fmu", overrides=overrides)
        return folders[name]

    return folder


def ours(name: str, master: str) -> NDArray[np.float64]:
    """Epoch and position of each estimate."""
    scenario, overrides = SCENARIOS[name]
    settled = sblcosim.load(scenario, overrides)
    record = execute(resolve(connect(settled)), master=master)
    found = record.estimates(settled.receiver.type)
    return np.column_stack([found.epoch_ns / 1e9, found.position])


def same(one: NDArray[np.float64], other: NDArray[np.float64]) -> None:
    # Masters differ by a step in when they show an estimate.
    assert abs(len(one) - len(other)) <= 2
    n = min(len(one), len(other))
    assert n > 150
    np.testing.assert_allclose(one[:n], other[:n], rtol=0, atol=1e-12)


def skip_without(complaint: str) -> None:
    """Skip a test whose tool cannot be installed on this machine, by what the example said."""
    absent = [name for name in ("libcosimpy", "OMSimulator") if find_spec(name) is None]
    if "libtbb.so" in complaint or any(f"pip install {name}" in complaint for name in absent):
        pytest.skip(complaint.strip())


@pytest.mark.parametrize("scenario", few(SCENARIOS, quick=["another"]))
@pytest.mark.parametrize("tool", TOOLS)
def test_every_tool_gives_our_estimates(
    tool: str, scenario: str, packages: Callable[[str], Path]
) -> None:
    script, package = TOOLS[tool]
    done = start(script, packages(scenario) / package)
    skip_without(done.stderr)
    assert done.returncode == 0, done.stderr
    rows = [[float(word) for word in line.split()] for line in done.stdout.splitlines()]
    reference = ours(scenario, "python")
    same(np.array(rows), reference)
    for master in set(MASTERS) - {"python"}:
        np.testing.assert_array_equal(ours(scenario, master), reference)


@pytest.mark.slow
def test_a_master_that_steps_one_fmu_after_another_is_outside_the_contract(
    packages: Callable[[str], Path],
) -> None:
    baked = packages("the paper's") / "baked.ssp"
    module = load("in_fmpy")
    jacobi, gauss_seidel = (
        np.array(module.estimates(baked, gauss_seidel=chosen)) for chosen in (False, True)
    )
    n = min(len(jacobi), len(gauss_seidel))
    np.testing.assert_array_equal(jacobi[:n, 0], gauss_seidel[:n, 0])
    assert np.abs(jacobi[:n] - gauss_seidel[:n]).max() > 0.01


def documented_steps() -> dict[str, tuple[str, str]]:
    """What to export and what to run, by the name of the tool."""
    text = (EXAMPLES.parent / "docs" / "howto" / "other-tools.md").read_text()
    _, _, table = text.partition("| tool | install | export | run |\n")
    steps: dict[str, tuple[str, str]] = {}
    export = ""
    for line in table.partition("\n\n")[0].splitlines()[1:]:
        tool, _, exported, run = (cell.strip() for cell in line.strip("|").split(" | "))
        export = export if exported == "the same" else exported.strip("`")
        steps[tool.strip()] = export, run.strip("`")
    return steps


def test_the_documentation_has_the_steps_for_every_example() -> None:
    scripts = {run.split()[1] for _, run in documented_steps().values()}
    assert scripts == {f"examples/{path.name}" for path in EXAMPLES.glob("in_*.py")}


@pytest.mark.parametrize("tool", documented_steps())
def test_the_documented_steps_work(
    tool: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    export, run = (shlex.split(command) for command in documented_steps()[tool])
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, export[1:], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    shown = start(Path(run[1]).name, *run[2:])
    skip_without(shown.stderr)
    assert shown.returncode == 0, shown.stderr
    assert len(shown.stdout.splitlines()) > 900


@pytest.mark.parametrize(
    ("script", "package", "advice"),
    [
        ("in_fmpy.py", "fmpy", "pip install fmpy"),
        ("in_fmpy_ssp.py", "fmpy", "pip install fmpy"),
        ("in_libcosim.py", "libcosimpy", "pip install libcosimpy"),
        ("in_ecos.py", "ecospy", "pip install ecospy, apt-get install libtbb12"),
        ("in_omsimulator.py", "OMSimulator", "pip install OMSimulator"),
        ("channel_in_fmpy.py", "fmpy", "pip install fmpy"),
        ("channel_in_omsimulator.py", "OMSimulator", "pip install OMSimulator"),
        ("in_container.py", "fmpy", "pip install fmpy"),
        ("receiver_in_c/build.py", "fmpy", "pip install fmpy"),
    ],
)
def test_without_its_tool_an_example_says_what_to_install(
    script: str, package: str, advice: str, tmp_path: Path
) -> None:
    (tmp_path / f"{package}.py").write_text("raise ImportError('not there')")
    done = start(script, "x", PYTHONPATH=str(tmp_path))
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert advice in line


CHANNEL = [
    ("channel_in_fmpy.py", 3), ("channel_in_fmpy.py", 2), ("channel_in_omsimulator.py", 2)
]  # fmt: skip
"""Examples with the acoustics alone, and the versions of FMI of each."""


@pytest.mark.parametrize(("script", "fmi"), CHANNEL)
def test_the_channel_alone_runs_as_its_page_says(script: str, fmi: Fmi) -> None:
    done = start(script, build("acoustics", fmi))
    skip_without(done.stderr)
    assert done.returncode == 0, done.stderr
    rows = [re.findall(r"[\d.]+", line) for line in done.stdout.splitlines()]
    assert [float(row[0]) for row in rows] == [round(0.1 * k, 1) for k in range(1, 50)]
    assert [int(row[1]) for row in rows] == [1 + k % 4 for k in range(49)]
    errors = [float(row[2]) - float(row[3]) for row in rows]
    assert 0.05 < np.std(errors) < 0.2
    page = (EXAMPLES.parent / "docs" / "howto" / "one-component.md").read_text("utf-8")
    assert f"python examples/{script} fmus/fmi{fmi}/acoustics.fmu" in page
    if script == "channel_in_fmpy.py":
        shown = page.partition("```text\n")[2].partition("```")[0]
        assert done.stdout.startswith(shown)


def test_the_page_about_one_component_names_its_inputs_and_outputs() -> None:
    page = (EXAMPLES.parent / "docs" / "howto" / "one-component.md").read_text("utf-8")
    needs = page.partition("## What it gives")[0]
    component = COMPONENTS["acoustics"]
    assert all(f"`{v.name}`" in needs for v in component.of("input"))
    rows = re.findall(r"^\| (`.*?`) \|", page, re.MULTILINE)
    named = {name for row in rows for name in re.findall(r"`(\w+)`", row)}
    assert named <= {v.name for v in (*component.of("input"), *component.of("output"))}


def test_fmpys_ssp_master_shows_nothing_past_the_stop_time(
    packages: Callable[[str], Path],
) -> None:
    baked = packages("the paper's") / "baked.ssp"
    assert load("in_fmpy_ssp").estimates(baked) == load("in_fmpy").estimates(baked)


@pytest.mark.parametrize("script", ["in_fmpy.py", "in_fmpy_ssp.py"])
def test_where_parameter_sets_are_ignored_a_package_that_is_not_baked_is_refused(
    script: str, packages: Callable[[str], Path]
) -> None:
    done = start(script, packages("another") / "plain.ssp")
    assert done.returncode == 1
    assert not done.stdout
    (line,) = done.stderr.splitlines()
    assert line.endswith("export it with --bake")


SCRIPTS = sorted(path.name for path in EXAMPLES.glob("in_*.py"))


@pytest.mark.parametrize("script", [*SCRIPTS, "receiver_in_c/build.py"])
def test_without_a_file_an_example_says_how_it_is_used(script: str) -> None:
    done = start(script)
    skip_without(done.stderr)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"usage: python examples/{script} ")


@one_in(2)
@pytest.mark.parametrize("what", ["not there", "no archive", "another archive", "no receiver"])
@pytest.mark.parametrize("script", SCRIPTS)
def test_a_file_that_is_of_no_use_gets_one_line(script: str, what: str, tmp_path: Path) -> None:
    file = tmp_path / "x"
    if what == "no archive":
        file.write_text("x")
    elif what != "not there":
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr("x", "")
            if what == "no receiver":
                archive.writestr("SystemStructure.ssd", "<SystemStructureDescription/>")
        if what == "no receiver" and script == "in_container.py":
            file.write_bytes(build("target", 2).read_bytes())
    done = start(script, file)
    skip_without(done.stderr)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"{file}: must ")


def test_without_cc_the_receiver_in_c_is_compiled_by_zig(tmp_path: Path) -> None:
    if find_spec("ziglang") is None:
        pytest.skip("needs ziglang")
    done = start("receiver_in_c/build.py", tmp_path / "receiver.fmu", PATH=str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert CliRunner().invoke(app, ["check", str(tmp_path / "receiver.fmu")]).exit_code == 0


def test_without_any_compiler_it_says_what_to_install(tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text(
        "import importlib.util as u\n"
        "found = u.find_spec\n"
        "u.find_spec = lambda name, *a: None if name == 'ziglang' else found(name, *a)\n"
    )
    done = start(
        "receiver_in_c/build.py", tmp_path / "x.fmu", PATH=str(tmp_path), PYTHONPATH=str(tmp_path)
    )
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.endswith("needs a C compiler: cc, or pip install ziglang")
    assert not (tmp_path / "x.fmu").exists()


def test_the_receiver_in_c_that_cannot_be_written_gets_one_line(tmp_path: Path) -> None:
    done = start("receiver_in_c/build.py", tmp_path / "nowhere" / "x.fmu")
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert "must be writable" in line
