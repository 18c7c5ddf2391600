"""The structure of the sources: which room imports which, no circles, nothing too long."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = {"orchestrator": "sblcosim", "fmus": "sblcosim.fmus", "models": "sblcosim.models"}
MOST_LINES, MOST_FUNCTION_LINES, MOST_PARAMETERS = 600, 60, 7

LONG_MODULES: dict[str, str] = {}
"""Modules that are one thing all the same, and what."""
_OPTIONS = "its options are documented, and given by keyword"
_COMMAND = "a command: each of its options is an argument"
LONG_FUNCTIONS = {
    "analysis.advice.advise": _OPTIONS,
    "analysis.factorial.analyse": _OPTIONS,
    "analysis.general.analyse": _OPTIONS,
    "analysis.study_advice.advice_on_study": _OPTIONS,
    "analysis.workflow.of_table": _OPTIONS,
    "api.run": _OPTIONS,
    "areas.survey.map_area": _OPTIONS,
    "calibrate.calibrate": _OPTIONS,
    "cli.areas.map_": _COMMAND,
    "cli.budgets.budget": _COMMAND,
    "cli.requirements.require": _COMMAND,
    "cli.simulate.calibrate": _COMMAND,
    "cli.simulate.run": _COMMAND,
    "cli.tournament.compare": _COMMAND,
    "comparison.many.run_many": _OPTIONS,
    "comparison.tournament.compare": _OPTIONS,
    "cli.studies.advise": _COMMAND,
    "cli.studies.analyse": _COMMAND,
    "cli.studies.study": _COMMAND,
    "comparison.budget.budget": _OPTIONS,
    "report.study.save": _OPTIONS,
    "require.run.decide": _OPTIONS,
    "simulation.masters.lanes.execute": _OPTIONS,
    "study.runner.run": _OPTIONS,
}
"""Functions that are longer, or take more, and why."""

_WHERE_FMUS_ARE_MADE_FROM = "renaming it in `models/` or `fmus/build/` would rebuild every FMU"
TWICE = {
    "Grade": _WHERE_FMUS_ARE_MADE_FROM,
    "Level": "one is documented; the other is in `models/`",
    "Part": "a component of a scenario that is put together; keys that are switched together",
    "Point": _WHERE_FMUS_ARE_MADE_FROM,
    "Range": _WHERE_FMUS_ARE_MADE_FROM,
    "Row": _WHERE_FMUS_ARE_MADE_FROM,
    "Rows": _WHERE_FMUS_ARE_MADE_FROM,
    "Run": "one is documented; the other is a run of a campaign",
    "Samples": _WHERE_FMUS_ARE_MADE_FROM,
    "Unit": _WHERE_FMUS_ARE_MADE_FROM,
}
"""Names of classes that have two meanings, and why."""

_TIME = "what hangs on purpose is waited for there, and nothing else may take time"
LOOKED_INTO = {
    "tests/acceptance/test_lanes.py": {"_aligned": "fences are put around what it gives"},
    "tests/conftest.py": dict.fromkeys(
        ("_answers", "_folder", "_next", "_process", "_wait"), _TIME
    ),
    "tests/unit/orchestrator/test_native.py": dict.fromkeys(("_answers", "_next", "_state"), _TIME),
}
"""Private names that tests use, and why no public one says it."""


@dataclass(frozen=True)
class Module:
    """A module of the sources."""

    name: str
    path: Path
    package: bool

    @cached_property
    def tree(self) -> ast.Module:
        return ast.parse(self.path.read_text("utf-8"))

    @property
    def where(self) -> str:
        return self.path.relative_to(ROOT).as_posix()


@cache
def modules() -> dict[str, Module]:
    found = {}
    for folder, package in FOLDERS.items():
        for path in sorted((ROOT / folder).rglob("*.py")):
            inner = path.relative_to(ROOT / folder).with_suffix("").parts
            is_package = inner[-1] == "__init__"
            name = ".".join((package, *(inner[:-1] if is_package else inner)))
            found[name] = Module(name, path, is_package)
    return found


def imports(module: Module) -> Iterator[str]:
    """All that a module imports of the sources: in functions and for types only, too."""
    known = modules()
    for node in ast.walk(module.tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in known)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                package = module.name if module.package else module.name.rpartition(".")[0]
                for _ in range(node.level - 1):
                    package = package.rpartition(".")[0]
                base = f"{package}.{base}" if base else package
            for alias in node.names:
                if f"{base}.{alias.name}" in known:
                    yield f"{base}.{alias.name}"
                elif base in known:
                    yield base


@cache
def arrows() -> dict[str, set[str]]:
    return {name: set(imports(module)) - {name} for name, module in modules().items()}


@cache
def rooms() -> dict[str, tuple[str, ...]]:
    """The table of rooms in ARCHITECTURE.md: folders or modules, and what each may import."""
    text = (ROOT / "ARCHITECTURE.md").read_text("utf-8")
    table = text.partition("<!-- rooms -->\n")[2].partition("\n\n")[0]
    found: dict[str, tuple[str, ...]] = {}
    for line in table.splitlines()[2:]:
        room, _, allowed = (cell.strip() for cell in line.strip("|").split("|"))
        named = tuple(name.rstrip("/") for name in re.findall(r"`([^`]+)`", allowed))
        if allowed.startswith("all above"):
            named = tuple(found)
        elif allowed.startswith("the ground"):
            named = tuple(r if r in found else f"orchestrator/{r}" for r in named)
            ground = tuple(found)[: list(found).index("orchestrator/data") + 1]
            named += tuple(r for r in ground if r != "fmus/conformance")
        for name in re.findall(r"`([^`]+)`", room):
            found[name.rstrip("/")] = named
    return found


def room_of(module: Module) -> str:
    """The innermost row of the table that holds a module."""
    where = module.path.relative_to(ROOT).with_suffix("").as_posix().removesuffix("/__init__")
    return max((r for r in rooms() if f"{where}/".startswith(f"{r}/")), key=len, default="")


def circles() -> list[list[str]]:
    """Groups of modules that import each other, by Tarjan's algorithm."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(name: str) -> None:
        index[name] = low[name] = len(index)
        stack.append(name)
        for other in sorted(arrows()[name]):
            if other not in index:
                visit(other)
                low[name] = min(low[name], low[other])
            elif other in stack:
                low[name] = min(low[name], index[other])
        if low[name] == index[name]:
            group = stack[stack.index(name) :]
            del stack[stack.index(name) :]
            if len(group) > 1:
                found.append(sorted(group))

    for name in arrows():
        if name not in index:
            visit(name)
    return found


def functions(module: Module) -> Iterator[tuple[str, int, int]]:
    """All functions: their names, lines and parameters."""

    def walk(node: ast.AST, above: str) -> Iterator[tuple[str, int, int]]:
        for child in ast.iter_child_nodes(node):
            name = f"{above}.{child.name}" if hasattr(child, "name") else above
            if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
                given = child.args
                taken = [*given.posonlyargs, *given.args, *given.kwonlyargs]
                own = taken[1:] if taken and taken[0].arg in ("self", "cls") else taken
                yield name, (child.end_lineno or child.lineno) - child.lineno + 1, len(own)
            yield from walk(child, name)

    yield from walk(module.tree, module.name.removeprefix("sblcosim."))


def test_the_rooms_are_all_in_the_table_and_there() -> None:
    assert len(rooms()) > 10
    assert {m.where for m in modules().values() if not room_of(m)} == set()
    for room, allowed in rooms().items():
        assert (ROOT / room).is_dir() or (ROOT / f"{room}.py").is_file(), room
        assert set(allowed) <= set(rooms()), room


def test_the_table_of_rooms_goes_one_way() -> None:
    order = list(rooms())
    for room, allowed in rooms().items():
        assert all(order.index(other) < order.index(room) for other in allowed), room


def test_no_arrow_climbs() -> None:
    known = modules()
    climbing = []
    for name, others in arrows().items():
        room = room_of(known[name])
        for other in others:
            target = room_of(known[other])
            if target not in (room, *rooms()[room]):
                climbing.append(f"{known[name].where} imports {known[other].where}")
    assert climbing == []


def test_a_room_is_not_allowed_what_it_does_not_use() -> None:
    """So that the table is what is, beyond the ground that everybody may use."""
    known = modules()
    used: dict[str, set[str]] = {}
    for name, others in arrows().items():
        used.setdefault(room_of(known[name]), set()).update(room_of(known[o]) for o in others)
    text = (ROOT / "ARCHITECTURE.md").read_text("utf-8").partition("<!-- rooms -->\n")[2]
    idle = []
    for line in text.partition("\n\n")[0].splitlines()[2:]:
        room, _, allowed = (cell.strip() for cell in line.strip("|").split("|"))
        if allowed.startswith("the ground"):
            (name,) = re.findall(r"`([^`]+)`", room)
            for other in re.findall(r"`([^`]+)/?`", allowed):
                target = other.rstrip("/")
                target = target if target in rooms() else f"orchestrator/{target}"
                if target not in used[name.rstrip("/")]:
                    idle.append(f"{name} does not use {target}")
    assert idle == []


def test_there_are_no_circles() -> None:
    assert circles() == []


def test_modules_are_short() -> None:
    sizes = {m.where: len(m.path.read_text("utf-8").splitlines()) for m in modules().values()}
    long = {where for where, lines in sizes.items() if lines > MOST_LINES}
    assert long == set(LONG_MODULES)
    assert all(LONG_MODULES.values())


def test_the_name_of_a_class_has_one_meaning() -> None:
    """A JSON document is called like what it describes: its name is part of its schema."""
    owners: dict[str, list[str]] = {}
    for module in modules().values():
        if module.where.startswith("orchestrator/cli/") and "document" in module.where:
            continue
        for node in module.tree.body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                owners.setdefault(node.name, []).append(module.where)
    assert {name for name, where in owners.items() if len(where) > 1} == set(TWICE)
    assert all(TWICE.values())


def test_no_class_borrows_its_docstring() -> None:
    """One that does is half of a class."""
    borrowing = [
        f"{module.where}: {node.name}"
        for module in modules().values()
        for node in ast.walk(module.tree)
        if isinstance(node, ast.ClassDef)
        for inside in node.body
        if isinstance(inside, ast.Assign)
        and "__doc__" in [t.id for t in inside.targets if isinstance(t, ast.Name)]
    ]
    assert borrowing == []


def test_private_names_stay_in_their_modules() -> None:
    """A module that takes one of another is cut in two at the wrong place."""
    taken = [
        f"{module.where}: {alias.name}"
        for module in modules().values()
        for node in ast.walk(module.tree)
        if isinstance(node, ast.ImportFrom) and (node.level or "sblcosim" in (node.module or ""))
        for alias in node.names
        if alias.name.startswith("_")
    ]
    assert taken == []


@cache
def private_names() -> frozenset[str]:
    """What modules and classes of ours keep to themselves."""
    found: set[str] = set()
    for module in modules().values():
        for node in ast.walk(module.tree):
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                found.add(node.name)
            elif isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Store):
                found.add(node.id if isinstance(node, ast.Name) else node.attr)
    return frozenset(name for name in found if re.fullmatch(r"_(?!_)\w*(?<!_)", name))


def looked_into(tree: ast.AST) -> Iterator[str]:
    """Private names of ours that a test uses, but for those that it has defined itself."""
    own = {node.attr for node in ast.walk(tree)
           if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)
           and getattr(node.value, "id", "") == "self"}  # fmt: skip
    own |= {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
    for node in ast.walk(tree):
        names = []
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("sblcosim"):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.Attribute) and node.attr not in own:
            names = [node.attr]
        elif isinstance(node, ast.Call):
            called = getattr(node.func, "attr", getattr(node.func, "id", ""))
            if called.endswith(("attr", "attrgetter")):
                names = [a.value for a in node.args if isinstance(a, ast.Constant)]
        yield from (name for name in names if name in private_names())


def test_tests_see_what_everybody_sees() -> None:
    """A private name may change or go at any time, and whoever tests it tests no behaviour."""
    texts = {path: path.read_text("utf-8") for path in sorted((ROOT / "tests").rglob("*.py"))}
    found = {
        path.relative_to(ROOT).as_posix(): {*looked_into(ast.parse(text))}
        for path, text in texts.items()
        if private_names() & {*re.findall(r"\b_\w+", text)}  # a tree takes its time
    }
    assert {where: names for where, names in found.items() if names} == {
        where: {*reasons} for where, reasons in LOOKED_INTO.items()
    }


@pytest.mark.parametrize("line", [
    "from sblcosim.simulation.process import _signal",
    "process._signal(3)",
    "def test():\n    assert child._process.poll() is None",
    "monkeypatch.setattr(Process, '_next', stop)",
    "getattr(child, '_answers')",
])  # fmt: skip
def test_a_private_name_is_seen_however_it_is_used(line: str) -> None:
    assert len([*looked_into(ast.parse(line))]) == 1


def test_words_are_defined_in_their_room_only() -> None:
    """Of functions that other modules once had of their own, for lists, plurals and shares."""
    words = {"listed", "percent", "minus", "rounded", "plural", "ordinal", "meters"}
    defined = [
        (module.where, node.name)
        for module in modules().values()
        for node in module.tree.body
        if isinstance(node, ast.FunctionDef) and node.name.lstrip("_") in words
        and module.where.startswith("orchestrator/")
    ]
    assert [it for it in defined if not it[0].startswith("orchestrator/words/")] == []
    assert len(defined) > 5


def test_functions_are_short_and_take_little() -> None:
    long = {
        name
        for module in modules().values()
        for name, lines, parameters in functions(module)
        if lines > MOST_FUNCTION_LINES or parameters > MOST_PARAMETERS
    }
    assert long == set(LONG_FUNCTIONS)
    assert all(LONG_FUNCTIONS.values())


@pytest.mark.parametrize("name", ["sblcosim.study.study", "sblcosim.fmus.build.factory"])
def test_the_graph_sees_imports_wherever_they_stand(name: str) -> None:
    """It would find nothing wrong if it found nothing at all."""
    assert len(arrows()[name]) >= 3
    assert sum(map(len, arrows().values())) > 300


def test_what_is_to_be_found_is_there() -> None:
    """Files in the table of ARCHITECTURE.md, and the names in brackets behind them."""
    text = (ROOT / "ARCHITECTURE.md").read_text("utf-8")
    rows = text.partition("## Where to find what\n")[2].partition("\n## ")[0].splitlines()[3:]
    named = 0
    for row in filter(None, rows):
        for path, name in re.findall(r"`([^`]+\.\w+)`(?: \(`(\w+)`\))?", row):
            (file,) = ROOT.glob(path) if "*" not in path else [next(ROOT.glob(path))]
            assert re.search(rf"\b{name or ''}\b", file.read_text("utf-8")), row
            named += bool(name)
    assert named >= 5
