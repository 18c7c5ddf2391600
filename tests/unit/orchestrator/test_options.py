"""Every option of every command changes what the command hands on: none is taken and ignored.

A command is called with and without an option, on stand-ins for what it calls; the calls of the
two must differ.
"""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cache
from io import StringIO
from pathlib import Path
from types import FunctionType, MethodType
from typing import Any
from unittest.mock import MagicMock, NonCallableMock

import pytest
import sblcosim.cli
import typer
from quick import one_in
from sblcosim import api
from sblcosim.analysis.advice import of_study as study_advice
from sblcosim.areas.distance import map_distance
from sblcosim.areas.survey import map_area
from sblcosim.calibrate import calibrate
from sblcosim.cli.documents import contents
from sblcosim.cli.documents.by_command import document
from sblcosim.cli.documents.document import Document
from sblcosim.comparison.budget.run import budget
from sblcosim.comparison.many.run import run_many
from sblcosim.comparison.tournament.run import compare
from sblcosim.comparison.tournament.worst import worst_run
from sblcosim.estimation.after import smooth
from sblcosim.explore import page
from sblcosim.export.container import export_fmu
from sblcosim.export.firmware import export_firmware
from sblcosim.export.ssp import export_ssp
from sblcosim.fmus.build.factory import build
from sblcosim.fmus.conformance.kit import examine
from sblcosim.fmus.conformance.receiver_contract import check_receiver
from sblcosim.fmus.files import write_file
from sblcosim.identification.run import identify
from sblcosim.logs.contents import log as contents_of_log
from sblcosim.processing.dive import recorded_dive
from sblcosim.processing.workflow import process
from sblcosim.report import paper
from sblcosim.report import study as reports
from sblcosim.require.run import decide
from sblcosim.results.figures.artist import forked_artist
from sblcosim.scenario.starter import starter
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.plans.checks import check_size
from sblcosim.simulation.resolve import resolve
from sblcosim.study import campaign, runner
from sblcosim.study.again import replay
from seams import Seam

SCENARIO = "paper-scenario-1"


@dataclass(frozen=True)
class Case:
    """A command with what it needs.

    Attributes
    ----------
    words
        Command and arguments.
    calls
        Functions that stand-ins replace; at least one of them must be called.
    printed
        Whether what it prints counts, too; for lists, which call nothing with options, and for
        questions.
    without
        Options that have no effect with these arguments, and why.
    """

    words: tuple[str, ...]
    calls: tuple[Callable[..., Any], ...]
    printed: bool = False
    without: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        return " ".join(self.words)


_CONTENTS = (contents.carried_out, contents.study, contents.study_lines)
CASES = [
    Case(("run", SCENARIO), (api.run,)),
    Case(("run", SCENARIO, "--runs", "3"), (run_many,),
         without={"--animate": "is of one run, and is refused",
                  "--log": "is of one run, and is refused",
                  "--trajectories": "are of one run, and are refused"}),
    Case(("smooth", "runs/x"), (smooth,)),
    Case(("explore", SCENARIO), (recorded_dive, page.write, page.show),
         without={"--mapping": "must come with --log, and is refused"}),
    Case(("explore", "--log", ".", "--out", "dive.html"),
         (recorded_dive, page.write, page.write_dive, page.show)),
    Case(("explore", "--log", ".", "--out", "dive.json"),
         (recorded_dive, page.write, page.write_dive, page.show),
         without={"--beacons": "a dive alone has none but its own",
                  "--no-open": "a dive alone is never opened"}),
    Case(("identify", "dive"), (identify,)),
    Case(("plan", SCENARIO), (connect, resolve, check_size, contents.plan),
         without={"--svg": "is of packages, and is refused"}),
    Case(("calibrate",), (calibrate,)),
    Case(("log", "dive.csv"), (contents_of_log,)),
    Case(("process", "dive"), (process,)),
    Case(("scenarios",), (), printed=True),
    Case(("receivers",), (), printed=True),
    Case(("studies",), (), printed=True),
    Case(("questions",), (), printed=True),
    Case(("schema",), (), printed=True),
    Case(("new", "mine.toml"), (starter, write_file), printed=True),
    Case(("new", "mine.toml", "--like", "buoys"), (starter, write_file), printed=True,
         without={"--from": "must come without --like, and is refused",
                  **{f"--{name}": "is of platforms, and is refused"
                     for name in ("mounting", "compass", "sea")}}),
    Case(("study", SCENARIO), (runner.carry_out, runner.missing, runner.estimate, *_CONTENTS)),
    Case(("study", SCENARIO, "--dry-run"),
         (campaign.prepare, runner.missing, runner.estimate, *_CONTENTS),
         without={
             "--executor": "the estimate is of threads, which the documents say",
             "--scheduler": "the estimate is of this machine, which its line says",
             "--verbose": "there is nothing more to say",
         }),
    Case(("replay", "studies/x", "abc"), (replay,)),
    Case(("analyse", "studies/x"), (reports.analysed,)),
    Case(("advise", "studies/x", "--costs", "costs.toml"),
         (study_advice.advice_on_study,)),
    Case(("paper",), (paper.run,)),
    Case(("map", SCENARIO, "--area", "10x10", "--depth", "5"), (map_area,),
         without={"--depth": "is given once with --area, and refused a second time",
                  "--distance": "must come without --area, and is refused",
                  "--verbose": "there is nothing more to say"}),
    Case(("map", SCENARIO, "--distance", "20", "--depth", "5"), (map_distance,),
         without={"--area": "must come without --distance, and is refused"}),
    Case(("budget", SCENARIO), (budget,)),
    Case(("compare", SCENARIO), (compare, worst_run)),
    Case(("require", "one-metre"), (decide,)),
    Case(("build", "ekf"), (build, write_file)),
    Case(("check", "x.fmu"), (check_receiver,)),
    Case(("conformance", "x.fmu"), (examine,)),
    Case(("export", "ssp", SCENARIO), (export_ssp,)),
    Case(("export", "fmu", SCENARIO), (export_fmu,)),
    Case(("firmware", "ekf"), (export_firmware,)),
]  # fmt: skip

VALUES = {
    "--receiver": "sequential",
    "--set": "time.duration_s=7",
    "--out": "elsewhere",
    "--master": "python",
    "--trajectories": "tum",
    "--from": "harbour-square",
    "--like": "lbl",
    "new --beacons": "1 2 3; 4 5 6; 7 8 0",
    "build --beacons": "5",
    "explore --beacons": "5",
    "explore --log": "..",
    "explore --out": "elsewhere.json",
    "--platform": "wasm32",
    "--target": "host",
    "--mounting": "0.3",
    "--gps": "rtk",
    "--compass": "7",
    "--sea": "4",
    "new --pings": "0.25",
    "--path": "circle",
    "new --depth": "7",
    "--speed": "0.3",
    "--executor": "processes",
    "--scheduler": "tcp://127.0.0.1:9",
    "--response": "ekf.rms_m",
    "--transform": "log",
    "--error": "residual",
    "--costs": "other.toml",
    "--area": "20x30",
    "--distance": "30",
    "--cells": "7",
    "--with": "clock+sound-speed",
    "--frame": "own_relative",
    "--check": "life",
    "--ssp": "2",
    "--fmi": "3",
    "map --error": "absolute_horizontal",
    "export fmu --out": "elsewhere.fmu",
    "--mapping": "other.toml",
    "--scenario": "harbour-lbl",
}
"""Another value of each option that takes a text; with the command where it matters."""


@cache
def commands() -> dict[str, Any]:
    """All commands by their words."""

    def below(command: Any, words: tuple[str, ...]) -> Iterator[tuple[str, Any]]:
        inner = getattr(command, "commands", None)
        if inner is None:
            yield " ".join(words), command
            return
        for name, one in inner.items():
            yield from below(one, (*words, name))

    return dict(below(typer.main.get_command(sblcosim.cli.app), ()))


def command_of(case: Case) -> tuple[str, Any]:
    known = commands()
    name = " ".join(case.words[:2]) if case.words[0] == "export" else case.words[0]
    return name, known[name]


def options(case: Case) -> Iterator[tuple[str, list[str]]]:
    """Each option of a command, and how it is given with another value than the case's."""
    name, command = command_of(case)
    for param in command.params:
        given = next((o for o in param.opts if o.startswith("--")), None)
        if given is None or given == "--help":
            continue
        if given in case.words and param.is_flag:
            continue
        if param.is_flag:
            yield given, [given]
        else:
            yield given, [given, _another(name, given, param, case)]


def _another(name: str, given: str, param: Any, case: Case) -> str:
    for key in (f"{name} {given}", given):
        if key in VALUES:
            return VALUES[key]
    start = case.words[case.words.index(given) + 1] if given in case.words else param.default
    if start is None or isinstance(start, (int, float, str)):
        try:
            number = float(start or 50)
        except ValueError:
            number = None
        # Shares stay shares; whole numbers stay whole.
        if number is not None:
            text = number / 2 if 0 < number < 1 else number + 1
            return f"{text:g}"
    raise AssertionError(f"no value is known for {name} {given}: add one to VALUES")


class Made:
    """What a command has called and printed."""

    def __init__(self, case: Case, arguments: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
        with monkeypatch.context() as patch, Seam() as seam:
            root = MagicMock()
            for thing in case.calls:
                name = f"{thing.__module__}.{thing.__qualname__}".replace(".", "_")
                stand_in = MagicMock(name=name)
                stand_in.return_value.blocked = None
                stand_in.return_value.estimate.seconds_from = None  # as long as nobody knows
                root.attach_mock(stand_in, name)
                seam.instead(thing, stand_in)
            seam.instead(Document.of, MagicMock())
            seam.instead(document, MagicMock())
            seam.instead(forked_artist, MagicMock())
            patch.setattr(time, "perf_counter", lambda: 0.0)
            patch.setattr(sys, "stdin", _Terminal("\n" * 100))
            with redirect_stdout(StringIO()) as out, redirect_stderr(out), suppress(SystemExit):
                sblcosim.cli.app([*case.words, *arguments])
        self.calls = [
            (name, *(plain(a) for a in args), *((k, plain(v)) for k, v in sorted(given.items())))
            for name, args, given in root.mock_calls
        ]
        self.output = out.getvalue()
        assert "must not happen" not in self.output
        self.reached = bool(self.calls or case.printed)
        self.seen = (self.calls, self.output if case.printed else "")


class _Terminal(StringIO):
    def isatty(self) -> bool:
        return True


def plain(value: Any) -> Any:
    """A value that equals that of another call if it means the same."""
    if isinstance(value, (FunctionType, MethodType)):
        return f"<function {value.__qualname__}>"
    if isinstance(value, NonCallableMock):
        return "<stand-in>"
    if isinstance(value, Path):
        return re.sub(r"\bMagicMock/.*", "<stand-in>", str(value))
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, dict):
        return {key: plain(v) for key, v in value.items()}
    if is_dataclass(value):
        named = {f.name: getattr(value, f.name) for f in fields(value)}
        return (type(value).__name__, plain(named))
    if type(value).__eq__ is object.__eq__ and hasattr(value, "__dict__"):
        return (type(value).__name__, plain(vars(value)))
    return value


def pairs() -> list[Any]:
    return [
        pytest.param(
            case, given, words, id=f"{case} {given}",
            marks=[pytest.mark.slow] if given == "--all-platforms" else [],  # compiles for all
        )
        for case in CASES
        for given, words in options(case)
        if given not in case.without
    ]


def test_every_command_has_a_case() -> None:
    assert {command_of(case)[0] for case in CASES} == set(commands())


def test_what_is_excepted_exists() -> None:
    for case in CASES:
        assert set(case.without) <= {given for given, _ in options(case)}, case


_before: dict[str, Made] = {}


@one_in(2)
@pytest.mark.parametrize(("case", "given", "words"), pairs())
def test_an_option_changes_what_is_called(
    case: Case, given: str, words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    if str(case) not in _before:
        _before[str(case)] = Made(case, [], monkeypatch)
        again = Made(case, [], monkeypatch)
        assert again.seen == _before[str(case)].seen, "two calls without it differ, too"
    before = _before[str(case)]
    assert before.reached, before.output
    made = Made(case, words, monkeypatch)
    assert made.reached, made.output
    assert made.seen != before.seen, f"{given} changes nothing"


def test_the_values_are_of_options_that_exist() -> None:
    known = {
        key
        for case in CASES
        for given, _ in options(case)
        for key in (given, f"{command_of(case)[0]} {given}")
    }
    assert set(VALUES) <= known
