"""The tool that looks for changes that no test notices, on a tiny project."""

from __future__ import annotations

import ast
import importlib.util
import json
import os
import re
import runpy
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

CoverageData = pytest.importorskip("coverage", reason="needs the extra dev").CoverageData
TOOLS = Path(__file__).parents[3] / "tools"

PYTHON = '''\
"""A module."""

from __future__ import annotations

SECOND = 1_000_000_000


def path(speed: float, ticks: int, table: list[float]) -> float:
    """Metres on the way."""
    if ticks < 0:
        raise ValueError(f"must not be {-ticks - 1}")
    length: float = speed * ticks / 1e9 + table[0]
    length -= 0.5
    return length
'''

C = """\
#include <math.h>
#define HALF 0.5
/* a - b */
static double area(const double *side, int n)
{
    double table[2] = {1.0, 2.0};
    if (n < 0)
        return -1.0;
    return side[0] * side[n] + table[1] - HALF * 2.0;
}
"""


@pytest.fixture(scope="module")
def mutate() -> ModuleType:
    sys.path.insert(0, str(TOOLS))
    try:
        spec = importlib.util.spec_from_file_location("mutate", TOOLS / "mutate.py")
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules["mutate"] = module
        spec.loader.exec_module(module)
        return module
    finally:
        sys.path.remove(str(TOOLS))


def lines(mutate: ModuleType, source: str, suffix: str) -> set[tuple[str, str]]:
    """Kind and changed line of each mutation."""
    found = set()
    for mutation in mutate.mutations(source, suffix):
        before, after = source.splitlines(), mutation.of(source).splitlines()
        assert len(before) == len(after)
        ((_, new),) = [(a, b) for a, b in zip(before, after, strict=True) if a != b]
        found.add((mutation.kind, new.strip()))
    return found


def test_python_is_mutated_by_its_syntax(mutate: ModuleType) -> None:
    found = lines(mutate, PYTHON, ".py")
    assert {
        ("unit", "SECOND = (1_000_000_000 * 1000)"),
        ("comparison", "if ticks <= 0:"),
        ("check", "if False:"),
        ("sign", "length: float = speed * ticks / 1e9 - table[0]"),
        ("term", "length: float = speed * ticks / 1e9"),
        ("term", "length: float = table[0]"),
        ("term", "length: float = speed * ticks + table[0]"),
        ("term", "length: float = ticks / 1e9 + table[0]"),
        ("factor", "length: float = (2 * (speed * ticks)) / 1e9 + table[0]"),
        ("index", "length: float = speed * ticks / 1e9 + table[1]"),
        ("unit", "length: float = speed * ticks / (1e9 * 1000) + table[0]"),
        ("sign", "length += 0.5"),
        ("factor", "length -= (2 * 0.5)"),
    } <= found
    for _, line in found:  # no messages, annotations or docstrings
        assert "must" not in line
        assert "def " not in line
        assert "Metres" not in line


SAME = """\
from typing import Protocol


class Sized(Protocol):
    def size(self, least: float = 2.5) -> float:
        \"\"\"Of all.\"\"\"
        ...


def nothing(a: float, b: float) -> float:
    return 0 * a + b * -0.0 + 0 / b


def far(a: float, b: float) -> bool:
    return 0 < a - b or (a + b) >= 0.0 or a * b > 1
"""


def test_what_the_syntax_shows_to_change_nothing_is_no_mutation(mutate: ModuleType) -> None:
    found = {line for kind, line in lines(mutate, SAME, ".py") if kind == "factor"}
    assert found == {
        "return (2 * (0 * a + b * -0.0)) + 0 / b", "return (2 * (0 * a + b * -0.0 + 0 / b))",
        "return 0 < a - b or (a + b) >= 0.0 or (2 * (a * b)) > 1",
    }  # fmt: skip
    others = {line for kind, line in lines(mutate, SAME, ".py") if kind != "factor"}
    assert {"return a + b * -0.0 + 0 / b", "return 0 < a + b or (a + b) >= 0.0 or a * b > 1",
            "return 0 < a - b or (a + b) > 0.0 or a * b > 1"} <= others  # fmt: skip


def test_every_mutation_of_python_compiles_and_differs(mutate: ModuleType) -> None:
    source = (TOOLS / "versions.py").read_text()
    known = {ast.dump(ast.parse(source))}
    for mutation in mutate.mutations(source, ".py"):
        tree = ast.parse(mutation.of(source))
        compile(tree, "mutated", "exec")
        assert ast.dump(tree) not in known
        known.add(ast.dump(tree))


def test_c_is_mutated_by_its_tokens(mutate: ModuleType) -> None:
    found = lines(mutate, C, ".c")
    assert {
        ("comparison", "if (n <= 0)"),
        ("check", "if (0)"),
        ("sign", "return +1.0;"),
        ("sign", "return side[0] * side[n] - table[1] - HALF * 2.0;"),
        ("term", "return side[0]  + table[1] - HALF * 2.0;"),
        ("term", "return side[0] * side[n] + table[1] ;"),
        ("factor", "#define HALF (2 * 0.5)"),
        ("index", "return side[0] * side[(n) + 1] + table[1] - HALF * 2.0;"),
        ("index", "return side[(0) + 1] * side[n] + table[1] - HALF * 2.0;"),
        ("factor", "return 2 * (side[0] * side[n] + table[1] - HALF * 2.0);"),
        ("factor", "return side[0] * side[n] + table[1] - HALF * (2 * 2.0);"),
    } <= found
    for _, line in found:
        assert not line.startswith(("#include", "/*", "static"))
        assert "table[(2" not in line


def test_a_seed_chooses_of_all_kinds(mutate: ModuleType) -> None:
    known = mutate.mutations(PYTHON, ".py")
    numbers = mutate.chosen(7, known, 3)
    assert numbers == mutate.chosen(7, known, 3) != mutate.chosen(7, known, 4)
    assert {known[n].kind for n in numbers} == set(mutate.KINDS)
    assert sorted(mutate.chosen(999, known, 3)) == list(range(len(known)))


@pytest.fixture
def project(tmp_path: Path) -> Path:
    root = tmp_path / "project"
    (root / "tests").mkdir(parents=True)
    (root / "code").mkdir()
    (root / "code" / "way.py").write_text(PYTHON)
    (root / "pyproject.toml").write_text('[tool.setuptools.package-dir]\nways = "code"\n')
    (root / "tests" / "test_way.py").write_text(
        "from ways.way import path\n"
        "def test_path(): assert abs(path(3.0, 2_000_000_000, [1.0, 7.0]) - 6.5) < 1e-9\n"
    )
    return root


def run(project: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, str(TOOLS / "mutate.py"), "code/way.py", "--root", str(project),
         "--tests", "tests/test_way.py -p no:xdist", *arguments],
        capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_survivors_are_printed_as_differences_and_the_tree_is_not_touched(
    mutate: ModuleType, project: Path
) -> None:
    known = mutate.mutations(PYTHON, ".py")
    numbers = {
        m.kind: n for n, m in enumerate(known) if m.text in {"False", "<=", "-", "(2 * 0.5)"}
    }
    chosen = [f"--number={n}" for n in numbers.values()]
    done = run(project, *chosen)
    assert (project / "code" / "way.py").read_text() == PYTHON
    assert not list(project.rglob("__pycache__"))
    assert (done.returncode, done.stderr) == (1, "")
    assert "-    if ticks < 0:\n+    if ticks <= 0:\n" in done.stdout
    assert "-    if ticks < 0:\n+    if False:\n" in done.stdout
    assert f"number {numbers['sign']} of {len(known)}: sign, line 12: killed\n" in done.stdout
    assert done.stdout.endswith("seed 1: 2 of 4 mutations of code/way.py survive\n")


def test_tests_that_fail_already_and_builds_that_fail_are_told(project: Path) -> None:
    done = run(project, "--count", "2", "--build", "false")
    assert done.returncode == 2
    assert "must pass before anything is changed, got: does not build" in done.stderr
    slow = project / "tests" / "test_way.py"
    slow.write_text("import time\ndef test_slow(): time.sleep(60)\n")
    done = run(project, "--count", "2", "--limit", "2")
    assert (done.returncode, done.stdout) == (2, "")
    assert "got: slow" in done.stderr


PROJECT = {
    "models/way.py": PYTHON,
    "orchestrator/__init__.py": "",
    "orchestrator/apart.py": (
        "LIMIT = 2.5\n\n\ndef least(a: float) -> float:\n    return a + LIMIT\n"
    ),
    "tests/test_way.py": (
        "from models.way import path\nimport pytest\n"
        "@pytest.fixture(scope='module')\ndef kept(): return path(1.0, 0, [1.0, 7.0])\n"
        "def test_kept(kept): pass\n"
        "def test_value(kept): assert kept == 0.5\n"
        "def test_fails(): assert path(1.0, 1, [1.0]) == 7\n"
    ),
    "tests/test_apart.py": (
        "from orchestrator.apart import least\ndef test_least(): assert least(1.0) == 3.5\n"
    ),
    "orchestrator/other.py": (
        "import os, sys\nimport orchestrator.apart\n\n\n"
        "def more(a: float) -> float:\n    return a + 2.0\n\n\n"
        "print(more(float(sys.argv[1])), flush=True)\nos._exit(0)\n"
    ),
    "tests/test_other.py": (
        "import subprocess, sys\n"
        "def test_other():\n"
        "    command = [sys.executable, '-m', 'orchestrator.other', '1.5']\n"
        "    assert subprocess.run(command, capture_output=True).stdout == b'3.5\\n'\n"
    ),
}  # fmt: skip


@pytest.mark.slow
def test_mutations_of_a_tree_run_the_tests_that_execute_them(tmp_path: Path) -> None:
    tree, record = tmp_path / "tree", tmp_path / "record"
    for name, text in PROJECT.items():
        (tree / name).parent.mkdir(parents=True, exist_ok=True)
        (tree / name).write_text(text)
    (tree / "tools").mkdir()
    (tree / "tools" / "recorder.py").write_text((TOOLS / "recorder.py").read_text())

    def tool(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, str(TOOLS / "mutate_tree.py"), arguments[0], str(record),
             "--root", str(tree), *arguments[1:]],
            capture_output=True, text=True, check=False,
        )  # fmt: skip

    recorded = tool("record", "--tests", "tests -p no:xdist")
    assert recorded.stdout.endswith(f"4 tests in {record}\n"), recorded.stderr  # one fails
    done = tool("draw", "--seed", "3", "--count", "24")
    assert (tree / "models/way.py").read_text() == PYTHON
    found = dict(re.findall(r"^\d+: (\S+ number \d+), .*: (.*)$", done.stdout, re.MULTILINE))
    of_constant = [killer for where, killer in found.items() if "apart" in where]
    assert {*of_constant} == {"tests/test_apart.py::test_least"}  # which imports execute, too
    of_other = [killer for where, killer in found.items() if "other" in where]
    assert "tests/test_other.py::test_other" in of_other  # in a process of its own
    of_way = [killer for where, killer in found.items() if "way" in where]
    killers = {f"tests/test_way.py::test_{name}" for name in ("value", "kept")}
    assert {*of_way} == {*killers, "SURVIVED"}
    survivors = done.stdout.count("SURVIVED")
    assert done.returncode == 1
    assert done.stdout.endswith(f"seed 3: {survivors} of {len(found)} mutations survive\n")
    half = tool("draw", "--seed", "3", "--count", "6", "--skip", "1", "--step", "2")
    assert re.findall(r"^\d+", half.stdout, re.MULTILINE) == ["1", "3", "5"]


def test_tests_of_equations_run_before_those_that_compile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(TOOLS))
    tree = importlib.import_module("mutate_tree")
    quick, slow = "tests/test_quick.py::test_it", "tests/unit/models/test_equations.py::test_it"
    data = CoverageData(str(tmp_path / "lines"))
    for test, executed in ((quick, [1, 2, 3]), (slow, [2])):
        data.set_context(test)
        data.add_lines({"models/way.py": executed})
    data.write()
    seconds = {quick: 0.1, slow: 9.0, f"{slow}_more": 8.0}
    (tmp_path / "seconds.json").write_text(json.dumps(seconds))
    record, source = tree.Record(tmp_path), "def a():\n    b\n    c\n"

    def rounds(start: int) -> list[list[str]]:
        place = tree.Place("models/way.py", 0, tree.Mutation("sign", start, start + 1, "+"))
        return [*record.rounds(place, source, 60.0)]

    assert rounds(source.index("b")) == [[slow, f"{slow}_more"], [quick]]
    assert rounds(source.index("c")) == [[quick]]


@pytest.mark.parametrize("before", ["", 'cd gone && rmdir "$PWD" && '])
def test_a_recorded_process_says_what_it_says_without_a_record(tmp_path: Path, before: str) -> None:
    site, gone = tmp_path / "site", tmp_path / "gone"
    for folder in (site, gone):
        folder.mkdir()
    first = runpy.run_path(str(TOOLS / "recorder.py"))["IN_PROCESSES"]
    (site / "sitecustomize.py").write_text(first)
    more = {"SBLCOSIM_CONTEXT": "a test", "SBLCOSIM_RECORD": str(tmp_path),
            "SBLCOSIM_SOURCES": str(tmp_path / "sources"), "PYTHONPATH": str(site)}
    done = subprocess.run(
        ["sh", "-c", f"{before}{sys.executable} -c 'print(1)'"], cwd=tmp_path, text=True,
        env=os.environ | more, capture_output=True, check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "1\n", "")


def test_a_process_that_was_killed_while_it_wrote_leaves_no_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(TOOLS))
    tree = importlib.import_module("mutate_tree")
    part = tmp_path / "part"
    part.mkdir()
    (part / "lines.a").write_bytes(b"not whole")
    whole = CoverageData(str(part / "lines.b"))
    whole.set_context("tests/test_it.py::test_it")
    whole.add_lines({str(tmp_path.resolve() / "models/way.py"): [1, 2]})
    whole.write()
    (part / "seconds.1.json").write_text('{"tests/test_it.py::test_it": 0.1}')
    assert tree.join(part, tmp_path, tmp_path / "record") == 1
    known = CoverageData(str(tmp_path / "record" / "lines"))
    known.read()
    assert {*known.measured_files()} == {"models/way.py"}
