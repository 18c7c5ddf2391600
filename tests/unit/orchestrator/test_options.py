"""Every option of every command changes what the command hands on: none is taken and ignored.

A command is called with and without an option, on stand-ins for what it calls; the calls of the
two must differ.
"""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Iterator, Mapping
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
        Whether what it prints counts, too; for lists, which call nothing with options.
    without
        Options that have no effect with these arguments, and why.
    """

    words: tuple[str, ...]
    calls: tuple[str, ...]
    printed: bool = False
    without: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        return " ".join(self.words)


_STUDY = ("carried_out", "study", "study_lines")
_CONTENTS = tuple(f"cli.contents.{name}" for name in _STUDY)
CASES = [
    Case(("run", SCENARIO), ("api.run",)),
    Case(("run", SCENARIO, "--runs", "3"), ("comparison.many.run_many",)),
    Case(("smooth", "runs/x"), ("estimation.after.smooth",)),
    Case(("plan", SCENARIO), ("scenario.wiring.connect", "simulation.resolve.resolve",
                              "simulation.plan_checks.check_size", "cli.contents.plan"),
         without={"--svg": "is of packages, and is refused"}),
    Case(("calibrate",), ("calibrate.calibrate",)),
    Case(("scenarios",), (), printed=True),
    Case(("receivers",), (), printed=True),
    Case(("studies",), (), printed=True),
    Case(("questions",), (), printed=True),
    Case(("schema",), (), printed=True),
    Case(("new", "mine.toml"),
         ("scenario.starter.starter", "cli.simulate._write_new", "cli.simulate._asked"),
         without={"--yes": "without --like nothing is asked"}),
    Case(("new", "mine.toml", "--like", "buoys"),
         ("scenario.starter.starter", "cli.simulate._write_new", "cli.simulate._asked"),
         without={"--from": "must come without --like, and is refused"}),
    Case(("study", SCENARIO), ("study.runner.carry_out", "study.runner.missing",
                               "study.runner.estimate", *_CONTENTS)),
    Case(("study", SCENARIO, "--dry-run"),
         ("study.campaign.prepare", "study.runner.missing", "study.runner.estimate", *_CONTENTS),
         without={
             "--executor": "the estimate is of threads, which the documents say",
             "--scheduler": "the estimate is of this machine, which its line says",
             "--verbose": "there is nothing more to say",
         }),
    Case(("replay", "studies/x", "abc"), ("study.again.replay",)),
    Case(("analyse", "studies/x"), ("report.study.save", "cli.contents.analysis")),
    Case(("advise", "studies/x", "--costs", "costs.toml"),
         ("analysis.study_advice.advice_on_study", "analysis.study_advice.readable_advice",
          "analysis.saving.save_advice", "cli.contents.advice")),
    Case(("paper",), ("report.paper.run",)),
    Case(("map", SCENARIO, "--area", "10x10", "--depth", "5"), ("areas.survey.map_area",)),
    Case(("budget", SCENARIO), ("comparison.budget.budget",)),
    Case(("compare", SCENARIO), ("comparison.tournament.compare",)),
    Case(("require", "one-metre"), ("require.run.decide", "cli.contents.requirement")),
    Case(("build", "ekf"), ("fmus.build.factory.build", "fmus.files.write_file")),
    Case(("check", "x.fmu"), ("fmus.conformance.receiver_contract.check_receiver",)),
    Case(("conformance", "x.fmu"), ("fmus.conformance.kit.examine",)),
    Case(("export", "ssp", SCENARIO), ("export.ssp.export_ssp",)),
    Case(("export", "fmu", SCENARIO), ("export.container.export_fmu",)),
]  # fmt: skip

VALUES = {
    "--receiver": "sequential",
    "--set": "time.duration_s=7",
    "--out": "elsewhere",
    "--master": "python",
    "--from": "harbour-square",
    "--like": "lbl",
    "--executor": "processes",
    "--scheduler": "tcp://127.0.0.1:9",
    "--response": "ekf.rms_m",
    "--transform": "log",
    "--error": "residual",
    "--costs": "other.toml",
    "--area": "20x30",
    "--cells": "7",
    "--with": "clock+sound-speed",
    "--frame": "own_relative",
    "--check": "life",
    "--ssp": "2",
    "--fmi": "3",
    "map --error": "absolute_horizontal",
    "export fmu --out": "elsewhere.fmu",
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
        with monkeypatch.context() as patch:
            root = MagicMock()
            for dotted in case.calls:
                stand_in = MagicMock(name=dotted)
                stand_in.return_value.blocked = None
                root.attach_mock(stand_in, dotted.replace(".", "_"))
                patch.setattr(f"sblcosim.{dotted}", stand_in)
            for dotted in (
                "cli.document.Document.of", "cli.studies._estimated", "results.artist.forked_artist"
            ):
                patch.setattr(f"sblcosim.{dotted}", MagicMock())
            patch.setattr(time, "perf_counter", lambda: 0.0)
            patch.setattr(sys, "stdin", _Terminal())
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
        pytest.param(case, given, words, id=f"{case} {given}")
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
