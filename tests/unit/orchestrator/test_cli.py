"""The command line: what it prints, what it writes, and its exit codes."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from zipfile import ZipFile

import pytest
import sblcosim.api
import sblcosim.cli
import sblcosim.fmus.build.factory
from quick import few
from said import apart_from_compiling
from sblcosim import listings
from sblcosim.artifacts import write_table
from sblcosim.calibrate import calibrate
from sblcosim.comparison.budget.shares import LEAST_RUNS as BUDGET_RUNS
from sblcosim.errors import ConfigurationWarning
from sblcosim.fmus.build.factory import build
from sblcosim.models import COMPONENTS, RECEIVERS
from sblcosim.models.declaration import DeclarationError
from sblcosim.prepare.prepared import shortening
from sblcosim.results.data_sheet import LEAST_RUNS as SENTENCE_RUNS
from sblcosim.scenario.scenario import load, shipped
from sblcosim.simulation.execution import execute
from seams import Seam
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
        "slow = {'casadi', 'matplotlib', 'pandas', 'fmpy', 'scipy', 'numpy', 'sblcosim.models',\n"
        "        'sblcosim.simulation.plans', 'sblcosim.results'} & set(sys.modules)\n"
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
    done = cli("run", "paper-scenario-1", *SHORT, "--verbose")
    assert done.exit_code == 0
    assert apart_from_compiling(done.stderr) == ""
    assert done.stdout.startswith("ekf: 0.")
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


def test_a_run_without_an_estimate_says_so_and_the_exit_code_is_1(
    cli: Callable[..., Result],
) -> None:
    nothing = ("--set", "time.duration_s=2", "--set", "acoustics.loss_probability=1",
               "--no-figures", "--out", "here", "--force")  # fmt: skip
    got = (
        "must give at least one estimate, got none; update_count stayed 0; packets received from "
        "each beacon: 0, 0, 0, 0; look at"
    )
    for receivers in (["multilateration"], ["multilateration", "ekf"], ["ekf", "multilateration"]):
        words = [word for name in receivers for word in ("--receiver", name)]
        done = cli("run", "paper-scenario-1", *words, *nothing)
        assert done.exit_code == 1
        (line,) = done.stderr.splitlines()  # the EKF begins with a prior
        assert line.startswith(f"error: multilateration: {got}")
        assert done.stdout.endswith("written to here\n")
        assert Path("here/record.parquet").is_file()
    done = cli("run", "harbour-square", *nothing, "--json")
    assert done.exit_code == 1
    assert json.loads(done.stdout)["errors"]["ekf"]["absolute"]["total"]["rms_m"] is None
    assert done.stderr.startswith(f"error: ekf: {got}")
    done = cli("run", "paper-scenario-1", *nothing)
    assert (done.exit_code, done.stderr) == (0, "")  # without the raw fix that runs along
    done = cli("run", "harbour-square", "--runs", "2", *nothing)
    assert done.exit_code == 1
    assert apart_from_compiling(done.stderr).startswith("error: ekf: ")
    assert done.stdout.endswith("written to here\n")


def test_run_takes_receivers_keys_and_fmi_version(cli: Callable[..., Result]) -> None:
    done = cli(
        "run", "paper-scenario-1", *SHORT, "--receiver", "sequential", "--receiver", build("ekf"),
        "--set", "platform.arm_length_m=0.4", "--fmi", 3,
    )  # fmt: skip
    assert done.exit_code == 0
    manifest = json.loads(Path("runs/paper-scenario-1/manifest.json").read_text())
    (first, second, third) = manifest["receivers"]
    assert (first["label"], first["type"]) == ("sequential", "sequential")
    assert (second["label"], second["fmu"]) == ("ekf", "ekf.fmu")
    assert second["sha256"] == hashlib.sha256(build("ekf").read_bytes()).hexdigest()
    assert (third["label"], third["type"]) == ("raw", "multilateration")
    assert first["parameters"]["update_interval"] == 0.1
    assert manifest["scenario"]["platform"]["arm_length_m"] == 0.4


def test_the_scenario_that_is_written_can_be_run(cli: Callable[..., Result]) -> None:
    first = cli("run", "harbour-random", *SHORT, "--json", "--out", "one")
    again = cli("run", "one/scenario.toml", "--no-figures", "--json", "--out", "two")
    assert json.loads(first.stdout)["errors"] == json.loads(again.stdout)["errors"]


@pytest.mark.parametrize("keys", [(), ("--set", "receiver.gate=3", "--fmi", "3")])
@pytest.mark.parametrize("receiver", ["sequential", "mine/sequential.fmu"])
def test_the_scenario_that_is_written_has_the_receiver_of_the_run(
    cli: Callable[..., Result], tmp_path: Path, receiver: str, keys: tuple[str, ...]
) -> None:
    Path("mine").mkdir()
    shutil.copy(build("sequential"), "mine/sequential.fmu")
    choice = ("--receiver", receiver, "--receiver", "ekf", *keys)
    first = cli("run", "harbour-random", *SHORT, *choice, "--json", "--out", "one")
    assert first.exit_code == 0
    again = cli("run", "one/scenario.toml", "--no-figures", "--json", "--out", "two")
    before, after = json.loads(first.stdout)["errors"], json.loads(again.stdout)["errors"]
    assert after.keys() == {"sequential", "raw"}
    assert after == {name: before[name] for name in after}
    assert json.loads(Path("two/manifest.json").read_text())["scenario"]["fmi"] == (
        3 if keys else 2
    )
    for file in ("manifest.json", "scenario.toml"):
        for folder in ("one", "two"):
            assert str(tmp_path) not in Path(folder, file).read_text()


def everything(folder: Path) -> dict[Path, bytes]:
    return {file: file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def test_no_result_takes_the_place_of_what_it_is_made_from(
    cli: Callable[..., Result], tmp_path: Path
) -> None:
    """Not with --force, and not under another spelling of the folder."""
    run = ("run", "realistic-dive", "--set", "time.duration_s=60", "--receiver", "coupled")
    assert cli(*run, "--no-figures", "--log", "--out", "a/run").exit_code == 0
    Path("link").symlink_to("a/run", target_is_directory=True)
    Path("map.toml").write_text("")
    shutil.copytree("a/run/log", "log")
    shutil.copy("a/run/scenario.toml", "log/mine.toml")
    shutil.copy("map.toml", "log/map.toml")
    before = everything(tmp_path)
    other = ["log", "identify", "process"]
    wrong = [
        *((it, "a/run/log", out) for it in other for out in ("a/run/log", "a/run", "a", "link")),
        *((it, "log", out) for it in other for out in ("log", "a/../log", tmp_path / "log", ".")),
        *(("smooth", "a/run", out) for out in ("a/run", "a", "link", ".")),
        ("smooth", "link", "a/run"), ("identify", "a/run", "a/run"),
        ("process", "a/run/log", "log", "--scenario", "log/mine.toml"),
        ("identify", "a/run/log", "log", "--scenario", "log/mine.toml"),
        ("process", "a/run/log", "log", "--mapping", "log/map.toml"),
        ("identify", "a/run/log", "log", "--mapping", "log/map.toml"),
        ("log", "a/run/log", "log", "--mapping", "log/map.toml"),
    ]  # fmt: skip
    for command, read, out, *options in wrong:
        for force in (["--force"], []):
            done = cli(command, read, "--out", out, *options, *force, "--no-figures")
            kept = options[1] if options else read
            same = Path(kept).resolve() == Path(out).resolve()
            got = "which is read" if same else f"which holds {kept}"
            said = f"error: --out: must be another folder than what is read, got {out}, {got}\n"
            assert (done.exit_code, done.stderr) == (2, said), (command, out)
    assert everything(tmp_path) == before
    for command, read in (("identify", "a/run"), ("smooth", "a/run"), ("process", "log")):
        done = cli(command, read, "--out", f"{command}-new", "--force", "--no-figures")
        assert done.exit_code == 0, done.stderr
    assert {file: it for file, it in everything(tmp_path).items() if file in before} == before


def test_what_replaces_its_earlier_results_unasked_replaces_no_others(
    cli: Callable[..., Result], tmp_path: Path
) -> None:
    Path("small.toml").write_text(STUDY)
    Path("costs.toml").write_text("gps = [500, 20]\nrange = [100, 10]\n")
    assert cli("study", "small.toml", "--out", "study").exit_code == 0
    assert cli("run", "paper-scenario-1", *SHORT, "--out", "run").exit_code == 0
    calls = {
        "analysis": [("analyse", "study"), ("analyse", "study", "--order", "1")],
        "advice": [("advise", "study", "--costs", "costs.toml", "--limit", limit)
                   for limit in ("1", "2")],
        "firmware": [("firmware", "ekf", it) for it in ("paper-scenario-1", "paper-scenario-2")],
    }  # fmt: skip
    for mine, (first, again) in calls.items():
        assert cli(*first, "--out", mine).exit_code in (0, 1)
        before = everything(Path(mine))
        assert cli(*again, "--out", mine).exit_code in (0, 1)
        assert everything(Path(mine)) != before
    before = everything(tmp_path)
    for mine, (first, _) in calls.items():
        for other in {"run", *calls} - {mine}:
            done = cli(*first, "--out", other)
            assert (done.exit_code, done.stderr) == (2, (
                f"error: {other}: must be empty or hold an earlier result of this command, got "
                "that of another\n"
            ))  # fmt: skip
    assert everything(tmp_path) == before


def test_a_run_that_ends_before_its_time_says_so(cli: Callable[..., Result]) -> None:
    run = ("run", "paper-scenario-1", "--no-figures", "--set", "time.ekf_ratio=600")
    line = "simulated 60 of 94.2478 s: a run ends with the last common multiple of all"
    assert line in cli(*run).stdout
    assert json.loads(cli(*run, "--json").stdout)["remarks"][0].startswith(line)
    assert json.loads(cli("run", "paper-scenario-1", *SHORT, "--json").stdout)["remarks"] == []


@pytest.mark.parametrize("start_ns", [0, 10 * 10**9])
@pytest.mark.parametrize(("wanted_ns", "simulated_ns", "words"), [
    (94_200_000_000, 60_000_000_000, "60 of 94.2 s"),
    (40_050_000_000, 39_600_000_000, "39.6 of 40.05 s"),
    (60_000_000_001, 60_000_000_000, "60 of 60.000000001 s"),
    (86_400_500_000_000, 86_400_000_000_000, "86400 of 86400.5 s"),
])  # fmt: skip
def test_a_run_is_shorter_by_its_duration_and_not_by_its_end(
    start_ns: int, wanted_ns: int, simulated_ns: int, words: str
) -> None:
    asked: Any = SimpleNamespace(start_ns=start_ns, stop_ns=start_ns + wanted_ns)
    done: Any = SimpleNamespace(start_ns=start_ns, stop_ns=start_ns + simulated_ns)
    (said,) = shortening(asked, done, 0)
    assert said.startswith(f"simulated {words}: a run ends with ")
    assert shortening(asked, done, wanted_ns - simulated_ns) == []


def test_plan_takes_a_seed(cli: Callable[..., Result]) -> None:
    lines = cli("plan", "paper-scenario-1", "--seed", 77, "--verbose").stdout.splitlines()
    assert ["acoustics.seed", "Int32", "77"] in [
        [word for i, word in enumerate(line.split()) if i != 2] for line in lines
    ]


def test_plan_prints_components_and_connections_and_writes_nothing(
    cli: Callable[..., Result], tmp_path: Path
) -> None:
    done = cli("plan", "paper-scenario-1", "--receiver", "sequential", "--verbose")
    assert "sequential.fmu" in done.stdout
    assert "sequential.range" in done.stdout
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", few([*listings.scenarios()], quick=("realistic-dive",)))
def test_the_first_screen_of_a_plan_is_its_components_and_what_feeds_them(
    cli: Callable[..., Result], name: str
) -> None:
    """At most 24 lines; with --verbose, all that it counts."""
    two = ("plan", name, "--receiver", "coupled", "--receiver", "sequential")
    short, full = (cli(*two, *more).stdout for more in ((), ("--verbose",)))
    lines = short.splitlines()
    assert len(lines) < 24
    rows = {line.split()[0]: line for line in lines[3:-2]}
    assert {"target", "platform", "acoustics", "coupled", "sequential"} <= rows.keys()
    assert re.split(" {2,}", lines[2]) == ["component", "from", "FMI", "interval", "inputs from"]
    assert rows["acoustics"].endswith("target, platform")
    counts = [int(number) for number in re.findall(r"(\d+) (?:param|input|record)", lines[-1])]
    _, *tables = full.split("\n\n")
    heads = ("parameter ", "input ", "recorded ")
    listed = [t for t in tables if t.startswith(heads)]
    assert [len(t.splitlines()) - 1 for t in listed] == counts


def test_new_writes_a_scenario_that_can_be_run(cli: Callable[..., Result]) -> None:
    assert cli("new", "mine.toml").exit_code == 0
    assert cli("run", "mine.toml", *SHORT).stdout.endswith("written to runs/mine\n")
    assert cli("new", "walk.toml", "--from", "harbour-square").exit_code == 0
    assert load("walk.toml").target.side_m == 15.0


def test_new_completes_the_name_and_prints_a_command_for_the_shell(
    cli: Callable[..., Result],
) -> None:
    assert cli("new", "my dive").stdout.endswith(": sblcosim run 'my dive.toml'\n")
    assert load("my dive.toml").name == "my dive"
    for name in (".toml", ".hidden.toml"):
        refused = cli("new", name)
        assert (refused.exit_code, refused.stdout) == (2, "")
        assert refused.stderr.startswith(f"error: {name}: must have a name that begins with")
        assert not Path(name).exists()


def test_new_writes_the_file_that_was_said_or_none(cli: Callable[..., Result]) -> None:
    for name in ("y.txt", "y.csv", "y.TOML", "y.yaml"):
        refused = cli("new", name, "--like", "lbl", "--yes")
        assert refused.exit_code == 2
        assert f"{name}: must be a TOML file, FILE.toml, got {name[1:]}" in refused.stderr
    assert not [*Path().iterdir()]
    assert cli("new", "dive.1").exit_code == 0
    assert Path("dive.1.toml").is_file()


def test_a_copy_has_results_of_its_own(cli: Callable[..., Result]) -> None:
    assert cli("new", "mine.toml").exit_code == 0
    Path("yours.toml").write_text(Path("mine.toml").read_text())
    assert cli("run", "yours.toml", *SHORT).stdout.endswith("written to runs/yours\n")


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


def test_build_for_all_platforms_says_so_to_the_factory_and_what_is_missing(
    cli: Callable[..., Result], seam: Seam
) -> None:
    from sblcosim.fmus.build import compiler

    seam.instead(compiler.zig, lambda *_: None)
    done = cli("build", "range_model", "--all-platforms")
    assert done.exit_code == 2
    assert done.stderr == (
        "error: building for all platforms needs the package ziglang: "
        "pip install 'sblcosim[zig]'\n"
    )
    assert not Path("fmus").exists()


def test_build_for_webassembly_says_what_is_missing_or_unknown(
    cli: Callable[..., Result], seam: Seam
) -> None:
    from sblcosim.fmus.build import compiler

    done = cli("build", "range_model", "--platform", "wasm")
    assert done.exit_code == 2
    assert done.stderr == (
        "error: --platform: must be wasm32, got 'wasm'; --all-platforms has all others\n"
    )
    seam.instead(compiler.zig, lambda *_: None)
    done = cli("build", "range_model", "--platform", "wasm32")
    assert done.exit_code == 2
    assert done.stderr == (
        "error: building for wasm32 needs the package ziglang: pip install 'sblcosim[zig]'\n"
    )
    assert not Path("fmus").exists()


def test_check_says_whether_an_fmu_can_be_a_receiver(cli: Callable[..., Result]) -> None:
    good, bad = cli("check", build("sequential", 3)), cli("check", build("platform"))
    assert (good.exit_code, bad.exit_code) == (0, 1)
    assert "position" in good.stdout
    assert "update_count" in bad.stdout


def test_check_loads_the_binary(cli: Callable[..., Result]) -> None:
    with ZipFile(build("ekf")) as source, ZipFile("broken.fmu", "w") as broken:
        for name in source.namelist():
            broken.writestr(name, b"" if name.startswith("binaries/") else source.read(name))
    done = cli("check", "broken.fmu")
    assert done.exit_code == 1
    assert re.search(r"^binary +error +the library does not load: ", done.stdout, re.M)
    refused = cli("run", "paper-scenario-1", *SHORT, "--receiver", "broken.fmu").stderr
    assert "must load and instantiate" in refused
    assert tempfile.gettempdir() not in refused


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
        (("run", "paper-scenario-1", "--receiver", "no.fmu"), "no.fmu: must be an FMU file"),
        (("run", "paper-scenario-1", "--set", "target.fmu=no.fmu"), "no.fmu"),
        (("run", "paper-scenario-1", "--set", "seed"), "must be table.key=value"),
        (("run", "paper-scenario-1", *SHORT, "--out", "full"), "must be empty or hold nothing"),
        (("check", "no.fmu"), "no.fmu"),
        (("check", "broken.toml"), "broken.toml"),
        (("build", "efk"), "did you mean 'ekf'?"),
        (("new", "no/where.toml"), "must be in a folder that exists, got no"),
        (("new", "mine.toml", "--from", "harbour"), "harbour-square"),
        (("calibrate", "--pings", "1"), "pings: must be 2 or more"),
        (("run", "nosuch.toml"), "nosuch.toml: no such file"),
        (("run", "full"), "full: is a folder, not a scenario file"),
        (("run", "paper-scenario-1", "--set", "time.sampling_time_s=1e-6"), "of the memory), got"),
        (("plan", "paper-scenario-1", "--set", "time.sampling_time_s=1e-6"), "of the memory), got"),
        (("run", "paper-scenario-1", "--set", "time.duration_s=1e9"), "of the memory), got"),
        (("run", "paper-scenario-1", "--set", "time.duration_s=1e12"), "must be less than 4e+09"),
        (("run", "paper-scenario-1", "--set", "time.duration_s=1e308"), "must be less than 4e+09"),
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


def test_the_help_says_how_many_runs_are_needed(cli: Callable[..., Result]) -> None:
    for command, number in (("budget", BUDGET_RUNS), ("map", SENTENCE_RUNS)):
        said = " ".join(re.sub("[│|]", " ", cli(command, "--help").stdout).split())
        assert f"at least {number}" in said


NUMBERS = {
    "run": "--fmi --seed --step-timeout",
    "plan": "--fmi --seed",
    "explore": "--seed",
    "calibrate": "--sound-speed --assumed-sound-speed --range-std --distance --distance-std "
    "--clock-offset --pings --seed --fmi",
    "study": "--replicates --workers",
    "analyse": "--order --practical",
    "advise": "--limit --percentile --confidence",
    "budget": "--runs --workers --seed",
    "paper": "--practical --workers",
    "build": "--fmi",
    "conformance": "--timeout",
    "export ssp": "--ssp --seed",
    "export fmu": "--seed",
    "firmware": "--seed",
}
"""Options that take a number, by command."""


@pytest.mark.parametrize("value", ["abc", "", "nan", "-inf", "1e999", "9" * 5000])
@pytest.mark.parametrize(
    ("command", "option"), [(c, o) for c, options in NUMBERS.items() for o in options.split()]
)
def test_a_wrong_number_is_one_line_that_names_the_option(
    cli: Callable[..., Result], tmp_path: Path, command: str, option: str, value: str
) -> None:
    done = cli(*command.split(), option, value)
    (line,) = done.stderr.splitlines()
    assert (done.exit_code, done.stdout) == (2, "")
    assert re.match(rf"error: {option}: must be a (whole|finite) number.*, got '{value[:9]}", line)
    assert len(line) < 200
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ("run x --fmi 4", "--fmi: must be a whole number from 2 to 3, got '4'"),
        ("run x --fmi 2.5", "--fmi: must be a whole number from 2 to 3, got '2.5'"),
        ("study x --replicates 0", "--replicates: must be a whole number of at least 1, got '0'"),
        ("conformance x --timeout 0",
         "--timeout: must be a finite number of at least 0.1, got '0'"),
        ("run x --seed", "--seed: must have a value, got none"),
        ("run x --json=1", "--json: must stand alone, got a value"),
        ("advise x", "sblcosim advise: --costs must be given, got nothing; sblcosim advise --help "
         "says what it is"),
        ("run", "sblcosim run: SCENARIO must be given, got nothing; sblcosim run --help says what "
         "it is"),
        ("run x y z", "sblcosim run: must have no arguments beside SCENARIO, got y z"),
        ("scenarios x", "sblcosim scenarios: must have no arguments, got x"),
        ("plan x --sed 3", "sblcosim plan: an option must be one of --receiver, --set, --fmi, "
         "--seed, --svg, --json, --verbose, --help, got '--sed'; did you mean '--seed'?"),
        ("--versoin", "sblcosim: an option must be one of --version, --install-completion, "
         "--show-completion, --help, got '--versoin'; did you mean '--version'?"),
        ("export spp x", "sblcosim export: the command must be one of ssp, fmu, got 'spp'; did you "
         "mean 'ssp'?"),
    ],
)  # fmt: skip
def test_wrong_arguments_are_one_line(
    cli: Callable[..., Result], arguments: str, line: str
) -> None:
    done = cli(*arguments.split())
    assert (done.exit_code, done.stdout, done.stderr) == (2, "", f"error: {line}\n")


def test_an_unknown_command_is_one_line(cli: Callable[..., Result]) -> None:
    done = cli("anaylse", "x")
    (line,) = done.stderr.splitlines()
    assert done.exit_code == 2
    assert line.startswith("error: sblcosim: the command must be one of run, smooth, plan, ")
    assert line.endswith(", got 'anaylse'; did you mean 'analyse'?")


SHOWS = "; SBLCOSIM_TRACEBACK=1 shows where"


@pytest.mark.parametrize(
    ("raised", "line"),
    [
        (RecursionError("too deep"), "this must not happen, please report it: got "
         f"RecursionError: too deep{SHOWS}"),
        (KeyError("a\nb"), f"this must not happen, please report it: got KeyError: 'a\\nb'{SHOWS}"),
        (DeclarationError(f"zigzag: {99 * 'must '}end"), f"zigzag: {99 * 'must '}end"),
        (OSError(110, "Connection timed out"), "reading and writing must succeed, got Connection "
         f"timed out{SHOWS}"),
        (OSError(28, "No space left on device"), "output: must be writable, got No space left on "
         "device"),
        (PermissionError(13, "Permission denied", "in\nhere"), "in\\nhere: must be readable and "
         "writable, got Permission denied"),
    ],
)  # fmt: skip
def test_what_nobody_has_foreseen_is_one_line(
    cli: Callable[..., Result], monkeypatch: pytest.MonkeyPatch, seam: Seam,
    raised: Exception, line: str,
) -> None:
    def fail(*arguments: Any, **options: Any) -> None:
        raise raised

    seam.instead(sblcosim.api.run, fail)
    done = cli("run", "paper-scenario-1")
    assert done.exit_code == 2
    assert done.stderr == f"error: {line}\n"
    if not line.endswith(SHOWS):
        return
    monkeypatch.setenv("SBLCOSIM_TRACEBACK", "1")
    with pytest.raises(type(raised)):
        cli("run", "paper-scenario-1")


def test_text_that_the_terminal_cannot_show_does_no_harm(tmp_path: Path) -> None:
    for name in ("Tauchgang 21 °", b"\xff\xfe"):
        done = subprocess.run(
            [sys.executable, "-m", "sblcosim", "run", name], cwd=tmp_path, check=False,
            capture_output=True, text=True, env=os.environ | {"PYTHONIOENCODING": "ascii"},
        )  # fmt: skip
        assert done.returncode == 2
        assert re.fullmatch(r"error: (scenario|arguments): must be .*\n", done.stderr)


@pytest.mark.parametrize("out", ["full", "broken.toml", "broken.toml/below"])
@pytest.mark.parametrize("command", [("run", "paper-scenario-1"), ("calibrate",)])
def test_the_folder_is_checked_before_anything_is_simulated(
    cli: Callable[..., Result],
    seam: Seam,
    command: tuple[str, ...],
    out: str,
) -> None:
    def simulated(*arguments: Any, **options: Any) -> None:
        raise AssertionError

    seam.instead(sblcosim.api.run, simulated)
    seam.instead(calibrate, simulated)
    Path("broken.toml").write_text("[target\n")
    Path("full").mkdir()
    Path("full/thesis.tex").write_text("precious")
    done = cli(*command, "--out", out)
    assert (done.exit_code, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1


def test_a_cache_that_cannot_be_used_is_named(
    cli: Callable[..., Result], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("SBLCOSIM_CACHE", str(tmp_path / "file"))
    done = cli("run", "paper-scenario-1", *SHORT)
    assert done.exit_code == 2
    assert done.stderr == (
        "error: SBLCOSIM_CACHE: must be a writable folder, got "
        f"{tmp_path / 'file'} (Not a directory)\n"
    )


def test_too_little_memory_is_one_line(
    cli: Callable[..., Result], seam: Seam
) -> None:
    def exhausted(*arguments: Any, **options: Any) -> None:
        raise MemoryError

    seam.instead(sblcosim.api.run, exhausted)
    done = cli("run", "paper-scenario-1")
    assert done.exit_code == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: the memory of this machine must be enough")


def test_several_problems_are_several_lines(cli: Callable[..., Result]) -> None:
    done = cli("run", "paper-scenario-1", "--set", "seed=-1", "--set", "target.x=1")
    assert [line[:7] for line in done.stderr.splitlines()] == ["error: ", "error: "]


def test_a_warning_is_one_line_on_stderr(
    cli: Callable[..., Result], seam: Seam
) -> None:
    run = sblcosim.api.run

    def warning(*arguments: Any, **options: Any) -> Any:
        warnings.warn("ekf: beware", ConfigurationWarning, stacklevel=2)
        return run(*arguments, **options)

    seam.instead(sblcosim.api.run, warning)
    done = cli("run", "paper-scenario-1", *SHORT, "--json")
    assert done.stderr == "warning: ekf: beware\n"
    json.loads(done.stdout)


def test_a_warning_that_comes_again_is_one_line_with_the_number(
    cli: Callable[..., Result], seam: Seam
) -> None:
    run = sblcosim.api.run

    def warning(*arguments: Any, **options: Any) -> Any:
        for _ in range(3):
            with warnings.catch_warnings():  # forgets what was said already, as libraries do
                pass
            warnings.warn("ekf: beware", ConfigurationWarning, stacklevel=2)
        warnings.warn("ekf: of this,\ntoo", ConfigurationWarning, stacklevel=2)
        result = run(*arguments, **options)
        warnings.warn("ekf: beware", ConfigurationWarning, stacklevel=2)
        return result

    seam.instead(sblcosim.api.run, warning)
    done = cli("run", "paper-scenario-1", *SHORT)
    assert done.stderr == "warning: ekf: beware (3 times)\nwarning: ekf: of this,\\ntoo\n"


def test_an_interrupted_run_says_so_and_leaves_nothing(
    cli: Callable[..., Result], seam: Seam, tmp_path: Path
) -> None:
    def interrupted(*arguments: Any) -> None:
        raise KeyboardInterrupt

    seam.instead(write_table, interrupted)
    done = cli("run", "paper-scenario-1", *SHORT, "--out", "here")
    assert (done.exit_code, done.stderr) == (130, "interrupted; nothing was written\n")
    assert list(tmp_path.iterdir()) == []


def test_a_terminated_run_leaves_nothing(tmp_path: Path) -> None:
    code = (
        "import os, signal, time\n"
        f"import {write_table.__module__} as writes\n"
        "from sblcosim.cli import main\n"
        "def write_table(*arguments):\n"
        "    os.kill(os.getpid(), signal.SIGTERM)\n"
        "    time.sleep(60)\n"
        "writes.write_table = write_table\n"
        "main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "run", "paper-scenario-1", *SHORT, "--out", "here"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (143, "terminated; nothing was written\n")
    assert list(tmp_path.iterdir()) == []


def test_a_run_leaves_the_result_of_another_alone(cli: Callable[..., Result]) -> None:
    run = ("run", "paper-scenario-1", *SHORT)
    two = (*run, "--receiver", "ekf", "--receiver", "sequential")
    assert cli(*run).stdout.endswith("written to runs/paper-scenario-1\n")
    done = cli(*two)
    assert done.stdout.endswith(
        "written to runs/paper-scenario-1-2; runs/paper-scenario-1 holds something else\n"
    )
    assert cli(*run).stdout.endswith("written to runs/paper-scenario-1\n")
    again = cli(*two, "--json")
    assert json.loads(again.stdout)["folder"] == "runs/paper-scenario-1-2"
    for change in (("--seed", "9"), ("--set", "platform.arm_length_m=1"), ("--fmi", "3")):
        cli(*run, *change, "--out", "mine", "--force")
        done = cli(*run, "--out", "mine")
        assert (done.exit_code, done.stdout) == (2, "")
        assert done.stderr == (
            "error: mine: must be empty or hold the result of this very run, got that of another; "
            "--force (in Python other='replace') replaces it\n"
        )
        assert cli(*run, *change, "--out", "mine").exit_code == 0
    assert cli(*run, "--out", "mine", "--force").exit_code == 0
    assert sorted(p.name for p in Path("runs").iterdir()) == [
        "paper-scenario-1", "paper-scenario-1-2",
    ]  # fmt: skip


def test_another_run_is_refused_before_it_is_simulated(
    cli: Callable[..., Result], seam: Seam
) -> None:
    cli("run", "paper-scenario-1", *SHORT, "--out", "mine")
    seam.instead(execute, None)
    assert cli("run", "paper-scenario-1", "--seed", "9", *SHORT, "--out", "mine").exit_code == 2


def test_a_calibration_leaves_another_alone(cli: Callable[..., Result]) -> None:
    cli("calibrate")
    assert cli("calibrate", "--seed", "2").stdout.endswith(
        "written to runs/calibration-2; runs/calibration holds something else\n"
    )
    assert cli("calibrate", "--seed", "2", "--out", "runs/calibration").exit_code == 2
    assert cli("calibrate").stdout.endswith("written to runs/calibration\n")


STUDY = """
scenario = "paper-scenario-1"
replicates = 3
[fixed]
"time.duration_s" = 5.0
"receiver.range_std_m" = 0.1
[factors.gps]
keys = ["platform.gps_horizontal_std_m"]
levels = [0.1, 3.5]
[factors.range]
keys = ["acoustics.range_std_m"]
levels = [0.1, 0.2]
"""


def test_a_study_of_which_every_run_failed_exits_with_1(cli: Callable[..., Result]) -> None:
    Path("bad.toml").write_text(STUDY.replace("[0.1, 0.2]", "[1e299, 1e300]"))
    done = cli("study", "bad.toml")
    assert done.exit_code == 1
    assert done.stdout.startswith("12 runs, 12 failed\n")
    assert "RMS" not in done.stdout
    told = apart_from_compiling(done.stderr)
    assert told == "error: all 12 runs failed: there is nothing to analyse\n"


def test_the_receivers_that_have_not_failed_are_told(cli: Callable[..., Result]) -> None:
    Path("mine.py").write_text(
        "import sblcosim\n\nclass Mine(sblcosim.Receiver):\n"
        "    def update(self, samples):\n        raise ValueError('no')\n"
    )
    Path("both.toml").write_text(f'receivers = ["ekf", "mine.py:Mine"]\n{STUDY}')
    done = cli("study", "both.toml")
    assert done.exit_code == 1
    assert re.match(r"ekf: .* covariance", done.stdout)
    assert "no covariance" not in done.stdout
    told = apart_from_compiling(done.stderr)
    assert told == "error: all 12 runs failed: what can be analysed is of ekf\n"
    assert cli("analyse", "studies/both").exit_code == 0


def test_advice_that_finds_nothing_exits_with_1(cli: Callable[..., Result]) -> None:
    Path("good.toml").write_text(STUDY)
    assert cli("study", "good.toml").exit_code == 0
    Path("costs.toml").write_text("gps = [900, 40]\n")
    advise = ("advise", "studies/good", "--costs", "costs.toml")
    assert cli(*advise).exit_code == 0  # nothing was asked for
    nothing = cli(*advise, "--limit", "1e-6")
    assert nothing.exit_code == 1
    assert "written to " in nothing.stdout


@pytest.mark.parametrize("arguments", [("--version",), ("--help",), ("run", "--help"),
                                       ("scenarios",), ("plan", "paper-scenario-1")])
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_output_is_one_line(arguments: tuple[str, ...]) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "sblcosim", *arguments],
            stdout=full, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    assert done.returncode == 2
    message = "error: output: must be writable, got No space left on device\n"
    assert done.stderr == message


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere it cannot be deleted")
@pytest.mark.parametrize("command", ["scenarios", "run paper-scenario-1", "study paper-scenario-1",
                                     "build", "new mine", "export ssp harbour-square"])
def test_a_working_directory_that_is_gone_is_one_line(tmp_path: Path, command: str) -> None:
    script = f"cd {tmp_path} && rmdir {tmp_path} && {sys.executable} -m sblcosim {command}"
    done = subprocess.run(["sh", "-c", script], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "error: working directory: must exist, got one that was deleted\n"


COMMANDS_WITH_OUT = [
    ("run", "paper-scenario-1", *SHORT), ("study", "good.toml"), ("calibrate",),
    ("build", "range_model"), ("export", "ssp", "paper-scenario-1"), ("paper", "--quick"),
]  # fmt: skip


@pytest.mark.skipif(sys.platform != "linux", reason="names of files are Unicode")
@pytest.mark.parametrize("command", COMMANDS_WITH_OUT, ids=lambda c: c[0])
def test_an_out_that_is_no_utf_8_is_one_line(
    cli: Callable[..., Result], command: tuple[str, ...]
) -> None:
    done = cli(*command, "--out", "a\udcffb")
    assert (done.exit_code, done.stdout) == (2, "")
    assert done.stderr == "error: arguments: must be UTF-8, got b'a\\xffb'\n"
    assert not list(Path().iterdir())


@pytest.mark.skipif(sys.platform != "linux", reason="limits of Linux")
@pytest.mark.parametrize("command", COMMANDS_WITH_OUT[1::3], ids=lambda c: c[0])
def test_an_out_that_is_too_deep_is_one_line(
    cli: Callable[..., Result], command: tuple[str, ...]
) -> None:
    Path("good.toml").write_text(STUDY)
    done = cli(*command, "--out", "/".join("d" * 2040))
    subprocess.run(["rm", "-rf", "d"], check=True)  # pytest cannot
    assert (done.exit_code, done.stdout) == (2, "")
    assert done.stderr.startswith("error: ")
    assert done.stderr.endswith(", got File name too long\n")
    assert done.stderr.count("\n") == 1


@pytest.mark.skipif(sys.platform != "linux", reason="limits of Linux")
def test_an_out_that_is_deep_is_a_folder_like_any_other(cli: Callable[..., Result]) -> None:
    Path("good.toml").write_text(STUDY)
    done = cli("study", "good.toml", "--out", "/".join("d" * 1900))
    subprocess.run(["rm", "-rf", "d"], check=True)  # pytest cannot
    assert done.exit_code == 0


def test_what_is_made_of_results_lies_beside_them(tmp_path: Path, monkeypatch: Any) -> None:
    from sblcosim.cli.common.app import beside

    monkeypatch.chdir(tmp_path)
    assert beside(Path("studies/mine"), "advice") == Path("studies/mine-advice")
    assert beside(Path("."), "advice") == tmp_path.with_name(f"{tmp_path.name}-advice")
    assert beside(Path(".."), "advice") == tmp_path.parent.with_name(
        f"{tmp_path.parent.name}-advice"
    )
    assert beside(Path("/"), "advice") == Path("/-advice")


@pytest.mark.parametrize("given", [{}, {"OPENBLAS_NUM_THREADS": "3"}])
def test_linear_algebra_has_one_thread_in_the_command_unless_told(given: dict[str, str]) -> None:
    code = (
        "import atexit, os, sys\n"
        "from sblcosim.__main__ import main\n"
        "assert 'numpy' not in sys.modules  # which would have begun its threads\n"
        "atexit.register(lambda: print(os.environ['OPENBLAS_NUM_THREADS']))\n"
        "main()\n"
    )
    known = {name: it for name, it in os.environ.items() if not name.endswith("_THREADS")}
    done = subprocess.run(
        [sys.executable, "-c", code, "scenarios"], env=known | given, capture_output=True,
        text=True, check=True,
    )  # fmt: skip
    assert done.stdout.splitlines()[-1] == given.get("OPENBLAS_NUM_THREADS", "1")
