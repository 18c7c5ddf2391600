"""No verdict of a test rests on less than two minutes of wall time."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
LEAST = 120.0
WAITS = ("acquire", "communicate", "get", "join", "poll", "result", "wait")
"""Methods whose only positional argument, a number, is a limit of time."""


def short(source: str) -> Iterator[int]:
    """Lines with a limit of wall time below `LEAST`, as a number or as a constant of the module.

    A limit of a single call of an FMU or of a file (``step_timeout``) may be short where it begins
    with what hangs on purpose, or where it must not pass.
    """
    tree = ast.parse(source)
    known = {
        node.targets[0].id: value for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
        and (value := _number(node.value, {})) is not None
    }
    patient = "only_hangs_take_time" in source
    for call in ast.walk(tree):
        if not isinstance(call, ast.Call):
            continue
        limits = [k.value for k in call.keywords if k.arg == "timeout"]
        if not patient:
            limits += [k.value for k in call.keywords if k.arg == "step_timeout"]
        if isinstance(call.func, ast.Attribute) and call.func.attr in WAITS and len(call.args) == 1:
            limits += call.args
        for limit in limits:
            value = _number(limit, known)
            if value is not None and 0 < value < LEAST:
                yield call.lineno


def _number(node: ast.expr, known: dict[str, float]) -> float | None:
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        return float(node.value)
    return known.get(node.id) if isinstance(node, ast.Name) else None


@pytest.mark.parametrize(
    "path", sorted(TESTS.rglob("*.py")), ids=lambda path: path.relative_to(TESTS).as_posix()
)
def test_no_limit_of_wall_time_is_below_two_minutes(path: Path) -> None:
    assert not [*short(path.read_text("utf-8"))]


@pytest.mark.parametrize("line", [
    "process.wait(timeout=10)", "event.wait(60.0)", "SOON = 5\nrun(command, timeout=SOON)",
    "thread.join(1)", "sblcosim.run('x', step_timeout=0.5)",
])
def test_a_short_limit_is_found(line: str) -> None:
    assert [*short(line)] == [line.count("\n") + 1]


@pytest.mark.parametrize("line", [
    "process.wait(timeout=600)", "LONG = 600.0\nevent.wait(LONG)", "', '.join(words)",
    "words.get('a', 1)", "process.poll()",
    "@pytest.mark.usefixtures('only_hangs_take_time')\ndef test(): run(step_timeout=0.5)",
])
def test_what_is_no_short_limit_is_none(line: str) -> None:
    assert not [*short(line)]
