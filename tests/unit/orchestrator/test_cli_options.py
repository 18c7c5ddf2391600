"""What is wrong with an option is said with the option's name, whoever finds it."""

from __future__ import annotations

import io
import re
import sys
import threading
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import made_logs
import pytest
import sblcosim
import typer
from quick import one_in
from rich.progress import Progress
from said import apart_from_compiling
from sblcosim.cli import app
from sblcosim.cli.common.app import refuse_silence, waiting
from sblcosim.cli.common.options import in_options
from sblcosim.errors import ConfigurationError
from sblcosim.fmus.build import factory
from sblcosim.judge.definitions import LOST
from sblcosim.report import study as reports
from sblcosim.results.responses import ORDER_STATISTIC
from sblcosim.study import study
from seams import Seam
from typer.testing import CliRunner

ROOT: Any = typer.main.get_command(app)
BEFORE: dict[str, tuple[str, ...]] = {
    "run": ("paper-scenario-1",),
    "smooth": ("run",),
    "explore": ("paper-scenario-1", "--no-open"),
    "plan": ("paper-scenario-1",),
    "calibrate": (),
    "log": ("dive.csv",),
    "identify": ("dive",),
    "process": ("dive",),
    "new": ("new.toml",),
    "study": ("study.toml",),
    "analyse": ("results",),
    "advise": ("results", "--costs", "costs.toml"),
    "paper": (),
    "compare": ("paper-scenario-1", "--runs", "2"),
    "budget": ("paper-scenario-1", "--runs", "30"),
    "map": ("paper-scenario-1", "--area", "9x9", "--depth", "5", "--cells", "2", "--runs", "1"),
    "require": ("one-metre",),
    "build": ("ekf",),
    "conformance": ("ekf.fmu",),
    "export ssp": ("paper-scenario-1",),
    "export fmu": ("paper-scenario-1",),
    "firmware": ("ekf", "paper-scenario-1"),
}
"""Arguments with which a command would work, by its name."""
WRONG: dict[str, tuple[str, ...]] = {
    "receiver": ("nobody",),
    "set_": ("acoustics.range_std_m=-1", "nonsense", "platform.nothing=1"),
    "seed": ("-1", "x", "99999999999"),
    "target": ("z80",),
    "fmi": ("4",),
    "master": ("nobody",),
    "trajectories": ("kml",),
    "step_timeout": ("-1", "0"),
    "runs": ("0", "x"),
    "sound_speed": ("1e300", "-1"),
    "assumed_sound_speed": ("0", "1e300"),
    "range_std": ("-1",),
    "range_offset_std": ("-1", "x"),
    "range_scale_std": ("-1", "x"),
    "distance": ("0",),
    "distance_std": ("-1",),
    "clock_offset": ("x",),
    "pings": ("1",),
    "replicates": ("0", "x"),
    "workers": ("0", "x"),
    "executor": ("nobody",),
    "scheduler": ("nobody",),
    "response": ("nothing", "nothing.py:f"),
    "order": ("0", "9"),
    "transform": ("nothing",),
    "error": ("nothing",),
    "practical": ("0", "-1"),
    "costs": ("nothing",),
    "limit": ("0", "-1"),
    "percentile": ("0", "100"),
    "contamination": ("0", "1"),
    "confidence": ("0", "1"),
    "settling": ("1e300", "-1"),
    "together": ("nothing", "clock"),
    "frame": ("nothing",),
    "area": ("nothing", "0x9"),
    "depth": ("-1",),
    "cells": ("nothing", "1"),
    "duration": ("0", "-1"),
    "radius": ("0",),
    "speed": ("-1",),
    "most_runs": ("99999999999", "0"),
    "source": ("nothing",),
    "like": ("nothing",),
    "beacons": ("2", "9"),
    "new beacons": ("1, 2", "0"),
    "new pings": ("0 Hz", "x"),
    "noise": ("-1", "x"),
    "mounting": ("-1", "5 cm"),
    "gps": ("rtkk", "3"),
    "compass": ("-1", "x"),
    "sea": ("7", "2.5"),
    "path": ("nothing", "1 2", "no.gpx"),
    "only": ("nothing",),
    "checks": ("nothing",),
    "timeout": ("0",),
    "version": ("3",),
    "svg": ("x.txt",),
    "log": ("nothing",),
    "mapping": ("nothing",),
    "scenario": ("nobody",),
    "interval": ("0", "x", "1e-300"),
    "platform": ("wasm", "x86_64-linux"),
}
"""Values that no command takes, or none of a name, by parameter; all but the first are tried by
the slow tests."""


def commands(group: Any = ROOT, path: tuple[str, ...] = ()) -> Iterator[tuple[str, Any]]:
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, (*path, name))
        else:
            yield " ".join((*path, name)), command


def options() -> Iterator[tuple[str, Any]]:
    """Every option that takes a value, but for the folders and files of results."""
    for name, command in commands():
        for param in command.params:
            flag = getattr(param, "is_flag", False)
            if param.param_type_name == "option" and not flag and param.name != "out":
                yield name, param


CASES = [
    pytest.param(name, param.opts[0], value, id=f"{name} {param.opts[0]}={value}",
                 marks=[pytest.mark.slow] if number else [])
    for name, param in options()
    for number, value in enumerate(WRONG.get(f"{name} {param.name}") or WRONG[param.name])
]  # fmt: skip


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what commands read."""
    here: Path = tmp_path_factory.mktemp("options")
    result = sblcosim.run("paper-scenario-1", overrides={"time.duration_s": 5.0})
    result.save(here / "run", figures=False)
    text = (
        'scenario = "paper-scenario-1"\nreplicates = 2\n[design]\nkind = "full"\n'
        '[fixed]\n"time.duration_s" = 5.0\n'
        '[factors.arm]\nkeys = ["platform.arm_length_m"]\nlevels = [0.4, 3.0]\n'
        '[factors.gps]\nkeys = ["platform.gps_horizontal_std_m"]\nlevels = [0.1, 3.0]\n'
    )
    (here / "study.toml").write_text(text, "utf-8")
    study.load(here / "study.toml").run(here / "results")
    (here / "costs.toml").write_text("arm = [1, 2]\n", "utf-8")
    made_logs.in_folder(here / "dive")
    (here / "ekf.fmu").write_bytes(factory.build("ekf", 2).read_bytes())
    return here


@one_in(4)
@pytest.mark.parametrize(("command", "option", "value"), CASES)
def test_what_is_wrong_with_an_option_is_said_by_its_name(
    place: Path, monkeypatch: pytest.MonkeyPatch, command: str, option: str, value: str
) -> None:
    monkeypatch.chdir(place)
    before = [*BEFORE[command]]
    if option in before:
        at = before.index(option)
        del before[at : at + 2]
    result = CliRunner().invoke(app, [*command.split(), *before, f"{option}={value}"])
    assert result.exit_code == 2, result.output
    for line in apart_from_compiling(result.stderr).splitlines():
        assert re.match(rf"error: {re.escape(option)}\b", line), line


NAMES = sorted({name for _, command in commands() for param in command.params
                for name in (*param.opts, *param.secondary_opts) if name.startswith("-")}
               | {"--help", "-h", "--depht", "--depth=5", "--"})  # fmt: skip
"""Options of all commands, and what is as little a value."""


@pytest.mark.parametrize(
    ("name", "option"),
    [(name, param.opts[0]) for name, command in commands() for param in command.params
     if param.param_type_name == "option" and not getattr(param, "is_flag", False)],
)  # fmt: skip
def test_no_option_is_the_value_of_another(name: str, option: str) -> None:
    command = dict(commands())[name]
    for other in NAMES:
        with pytest.raises(ConfigurationError) as error:
            command.make_context(name, [*BEFORE.get(name, ()), option, other, "5"])
        assert str(error.value) == f"{option}: must have a value, got none before {other!r}"
    result = CliRunner().invoke(app, [*name.split(), *BEFORE.get(name, ()), option, "--json"])
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr == f"error: {option}: must have a value, got none before '--json'\n"


def test_what_stands_after_an_equals_sign_or_two_dashes_is_a_value() -> None:
    out = dict(commands())["run"].make_context("run", ["--out=--force", "--", "--json"])
    assert (str(out.params["out"]), out.params["scenario"]) == ("--force", "--json")


def test_a_receiver_that_is_given_twice_is_refused(
    monkeypatch: pytest.MonkeyPatch, place: Path
) -> None:
    monkeypatch.chdir(place)
    twice = ["--receiver", "ekf", "--receiver", "sequential", "--receiver", "ekf"]
    for name, command in commands():
        if not any(p.name == "receiver" and p.multiple for p in command.params):
            continue
        result = CliRunner().invoke(app, [*name.split(), *BEFORE[name], *twice])
        assert result.exit_code == 2
        one = name in ("budget", "map")
        words = "must be given once" if one else "must differ from each other, got 'ekf' twice"
        assert result.stderr.startswith(f"error: --receiver: {words}"), result.stderr


@pytest.mark.parametrize(
    ("line", "typed", "said"),
    [
        ("runs: must be 2", ("--runs", "1"), "--runs: must be 2"),
        ("runs: must have an error, got none", ("x.toml",), None),  # a scenario of this name
        ("map speed: must be given", (), "--speed: must be given"),
        ("override seed: must be 0, got -1", ("--seed", "-1"), "--seed: must be 0, got -1"),
        ("override seed: must be 0, got -1", ("--set", "seed=-1"), "--set seed: must be 0, got -1"),
        ("override a.b_m: must be 0", ("--set", "a.b_m=1"), "--set a.b_m: must be 0"),
        ("override a.b_m: must be 0", (), None),
        ("my.toml: seed: must be 0, got -2", ("--seed", "3"), None),  # what is in the file
        ("my.toml: seed: must be 0, got 3", ("--seed=3",), "--seed: must be 0, got 3"),
        ("paper: settling_time_s: must be less, got 1e+300", ("--settling", "1e300"),
         "--settling: must be less, got 1e+300"),
        ("no colon", ("--seed", "3"), None),
    ],
)  # fmt: skip
def test_arguments_are_named_by_the_options_that_were_typed(
    line: str, typed: tuple[str, ...], said: str | None
) -> None:
    assert in_options(line, dict(commands())["map"], typed) == (said or line)


@pytest.mark.parametrize("name", ["", *(name for name, _ in commands())])
def test_help_has_a_short_name_everywhere(name: str) -> None:
    short, long = (CliRunner().invoke(app, [*name.split(), it]) for it in ("-h", "--help"))
    assert short.exit_code == 0
    assert short.output == long.output
    assert short.output.startswith("Usage: ")


def test_progress_is_said_in_per_cent_with_a_space(
    monkeypatch: pytest.MonkeyPatch, seam: Seam
) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    shown = Terminal()
    monkeypatch.setattr("sys.stderr", shown)
    seam.tuned(waiting=0.0)
    begun = threading.Event()
    start = Progress.start
    monkeypatch.setattr(Progress, "start", lambda it: (start(it), begun.set()))
    with waiting("testing") as progress:
        assert begun.wait(600.0)
        progress(0.4)
    assert re.search(r"\b40 %", shown.getvalue())
    assert not re.search(r"\d%", shown.getvalue())


# --- What stands beside a number -----------------------------------------------------------------

SHORT = "--set time.duration_s=5"
BAD = f"{SHORT} --set acoustics.loss_probability=0.97 --set platform.gps_horizontal_std_m=90"
PAIR = "paper-scenario-1 --receiver ekf --receiver coupled"
ORDERED = {
    "run": "95 % within, and the other percentages: order statistics, of n errors the one of rank ",
    "many": "95 % in a run: an order statistic, of a run's n errors the one of ",
    "require": "is an order statistic: of n runs, the one of rank 0.95 n, rounded up.",
    "map": "each run is represented by order statistics of its errors",
    "study": ORDER_STATISTIC,
}
"""What is said of percentiles by what prints them."""


@pytest.fixture(scope="module")
def lossy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Studies of all kinds, in which some runs are lost, and questions."""
    here: Path = tmp_path_factory.mktemp("lossy")
    keys = '"time.duration_s" = 5.0\n"acoustics.loss_probability" = 0.9\n'
    text = (
        'scenario = "paper-scenario-1"\nreplicates = 20\nresponses = ["percentiles"]\n'
        f'[design]\nkind = "KIND"\n[fixed]\n{keys}'
        '[factors.gps]\nkeys = ["platform.gps_horizontal_std_m"]\nlevels = [3.0, 90.0]\n'
    )
    for kind in ("full", "grid", "sweep"):
        study.load(tomllib.loads(text.replace("KIND", kind))).run(here / kind)
    single = text.replace("KIND", "single").partition("[factors")[0].replace("0.9", "0.97")
    study.load(tomllib.loads(single)).run(here / "single")
    space = text.replace("KIND", "space").replace("replicates = 20", "")
    space = space.replace("levels", 'distribution = "uniform"\nrange')
    space = space.replace("[design]", "[design]\nbase_rows = 16")
    study.load(tomllib.loads(space)).run(here / "space")
    (here / "study.toml").write_text(text.replace("KIND", "full"), "utf-8")
    (here / "costs.toml").write_text("gps = [2, 1]\n", "utf-8")
    asked = (
        'scenario = "paper-scenario-1"\nresponse = "total_rms_m"\nlimit = 1.0\nmost_runs = 200\n'
        f'settling_time_s = 1.0\n[fixed]\n{keys}'
        '[choices.gps]\nkeys = ["platform.gps_horizontal_std_m"]\nlevels = [80.0, 90.0]\n'
    )
    (here / "lossy.toml").write_text(asked, "utf-8")
    return here


@pytest.mark.parametrize(
    "command",
    [
        "study study.toml --out studied",
        "study study.toml --out studied --verbose",
        f"run {PAIR} {SHORT} --runs 2 --no-figures --verbose",
        f"run {PAIR} {BAD} --runs 3 --no-figures",
        f"compare {PAIR} {SHORT} --runs 2 --no-figures --verbose",
        f"compare {PAIR} {BAD} --runs 3 --no-figures",
        "budget paper-scenario-1 --set time.duration_s=5 --set platform.gps_horizontal_std_m=90 "
        "--runs 30 --no-figures",
        "map paper-scenario-1 --set platform.gps_horizontal_std_m=90 --area 9x9 --depth 5 "
        "--cells 2 --runs 2 --duration 5 --settling 1 --no-figures",
        "require lossy.toml",
        "require lossy.toml --verbose",
        *(f"analyse {kind} --response lost{more}" for kind in ("full", "grid", "sweep", "single",
                                                               "space")
          for more in ("", " --verbose")),
        "analyse grid",
        *(f"advise full --costs costs.toml{more}" for more in ("", " --verbose", " --limit 90",
                                                               " --mean")),
    ],
)  # fmt: skip
@one_in(2)
def test_where_a_share_of_lost_runs_is_printed_it_is_said_what_lost_is(
    lossy: Path, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.chdir(lossy)
    result = CliRunner().invoke(app, command.split())
    sure = not command.startswith("require") and "--limit" not in command
    assert result.exit_code == (0 if sure else 1)
    assert "lost" in result.stdout
    words = re.sub(r"\s+", " ", result.stdout)
    assert words.count(LOST) == 1, result.stdout


MANY = f"{SHORT} --runs 2 --no-figures"


@pytest.mark.parametrize(
    ("command", "kind"),
    [
        *((f"{command}{more}", kind) for more in ("", " --verbose") for command, kind in (
            ("map paper-scenario-1 --area 9x9 --depth 5 --cells 2 --runs 2 --duration 5 "
             "--settling 1 --no-figures", "map"),
            (f"run paper-scenario-1 {SHORT} --no-figures", "run"),
            (f"run paper-scenario-1 {MANY}", "many"),
            (f"compare {PAIR} {MANY}", "many"),
            ("require lossy.toml", "require"),
            *((f"analyse {name} --response absolute_total_p95_m", "study")
              for name in ("full", "grid", "sweep", "single", "space")),
            ("advise full --costs costs.toml", "study"),
            ("advise full --costs costs.toml --mean --response absolute_horizontal_p50_m", "study"),
        )),
    ],
)  # fmt: skip
@one_in(3)
def test_percentiles_are_said_to_be_order_statistics(
    lossy: Path, monkeypatch: pytest.MonkeyPatch, command: str, kind: str
) -> None:
    monkeypatch.chdir(lossy)
    words = re.sub(r"\s+", " ", CliRunner().invoke(app, command.split()).stdout)
    short = kind in ("run", "many", "map") and "--verbose" not in command
    assert words.count(ORDERED[kind]) == (not short), words


@pytest.mark.parametrize("kind", ["full", "grid", "sweep", "single", "space"])
def test_a_report_says_what_percentiles_and_lost_runs_are(lossy: Path, kind: str) -> None:
    analysis = reports.analysed(lossy / kind, "absolute_total_p95_m")
    analysis.save(lossy / f"{kind}-page", other="replace")
    page = (lossy / f"{kind}-page" / reports.REPORT).read_text("utf-8")
    for said in (ORDER_STATISTIC, LOST):
        assert said in page


def test_the_help_of_every_command_names_arguments_without_types() -> None:
    def helps(group: Any, before: tuple[str, ...] = ()) -> Iterator[str]:
        for name, command in group.commands.items():
            if hasattr(command, "commands"):
                yield from helps(command, (*before, name))
            else:
                done = CliRunner().invoke(app, [*before, name, "--help"])
                assert done.exit_code == 0
                yield done.stdout
                arguments = [it for it in command.params if it.param_type_name == "argument"]
                for one in arguments if "Arguments:" in done.stdout else ():
                    assert re.search(rf"^  {re.escape(one.metavar)}  ", done.stdout, re.M), name

    whole = "\n".join(helps(typer.main.get_command(app)))
    assert whole.count("Usage: ") > 20
    assert not re.findall(r"<(?:str|path|list|int|float)[^>]*>", whole)
    assert not re.findall(r"^Usage: .*[{}]", whole, re.M)


@pytest.mark.parametrize("both", [True, False])
def test_a_terminal_shows_once_why_a_receiver_failed(
    both: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Told:
        problems = ("mine: must not raise", "other: no estimate")

    for stream in (sys.stdout, sys.stderr):
        monkeypatch.setattr(stream, "isatty", lambda: both)
    with pytest.raises(typer.Exit):
        refuse_silence(Told())  # type: ignore[arg-type]
    said = capsys.readouterr().err
    assert said == (
        "error: not every receiver gave estimates; the reasons are above\n" if both else
        "error: mine: must not raise\nerror: other: no estimate\n"
    )
