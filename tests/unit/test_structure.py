"""The structure of the sources: which room imports which, no circles, nothing too long."""

from __future__ import annotations

import ast
import itertools
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
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
    "analysis.advice.advice.advise": _OPTIONS,
    "analysis.two_level.analysis.analyse": _OPTIONS,
    "analysis.levels.analysis.analyse": _OPTIONS,
    "analysis.advice.of_study.advice_on_study": _OPTIONS,
    "analysis.workflow.of_table": _OPTIONS,
    "api.run": _OPTIONS,
    "areas.distance.map_distance": _OPTIONS,
    "areas.survey.map_area": _OPTIONS,
    "calibrate.calibrate": _OPTIONS,
    "cli.commands.areas.map_": _COMMAND,
    "cli.commands.budgets.budget": _COMMAND,
    "cli.commands.new.new": _COMMAND,
    "cli.commands.exploring.explore": _COMMAND,
    "cli.commands.logs.identify": _COMMAND,
    "cli.commands.logs.log_": _COMMAND,
    "cli.commands.processing.process": _COMMAND,
    "cli.commands.requirements.require": _COMMAND,
    "cli.commands.simulate.calibrate": _COMMAND,
    "cli.commands.simulate.plan": _COMMAND,
    "cli.commands.simulate.run": _COMMAND,
    "cli.commands.simulate.smooth": _COMMAND,
    "cli.commands.tournament.compare": _COMMAND,
    "comparison.many.run.run_many": _OPTIONS,
    "comparison.tournament.run.compare": _OPTIONS,
    "cli.commands.studies.advise": _COMMAND,
    "cli.commands.studies.analyse": _COMMAND,
    "cli.commands.studies.replay": _COMMAND,
    "cli.commands.studies.study": _COMMAND,
    "comparison.budget.run.budget": _OPTIONS,
    "processing.workflow.process": _OPTIONS,
    "report.study.analysed": _OPTIONS,
    "require.run.decide": _OPTIONS,
    "results.result.Result.save": _OPTIONS,
    "simulation.masters.lanes.execute": _OPTIONS,
    "simulation.masters.replay.replay": _OPTIONS,
    "study.runner.run": _OPTIONS,
}
"""Functions that are longer, or take more, and why."""

_WHERE_FMUS_ARE_MADE_FROM = "renaming it in `models/` or `fmus/build/` would rebuild every FMU"
TWICE = {
    "Grade": _WHERE_FMUS_ARE_MADE_FROM,
    "Level": "one is documented; the other is in `models/`",
    "Range": _WHERE_FMUS_ARE_MADE_FROM,
    "Row": _WHERE_FMUS_ARE_MADE_FROM,
    "Samples": _WHERE_FMUS_ARE_MADE_FROM,
    "Unit": _WHERE_FMUS_ARE_MADE_FROM,
}
"""Names of classes that have two meanings, and why."""

WRITTEN = (".py", ".c", ".h", ".m", ".md", ".toml", ".jinja", ".css", ".js", ".sh", ".ipynb")
DATA = ("csv", "fmu", "html", "json", "parquet", "svg", "xml")
"""How names of files end that are made."""
NOWHERE = {"Platform6": "the component Platform, built for six beacons"}
"""Names in documents that are in no source, and what they are."""
ALL_ABOVE, GROUND = "all above", "the ground"
LAST_OF_GROUND, NOT_OF_GROUND = "orchestrator/answer", "fmus/conformance"
NOT_USED_YET = {
    ("orchestrator/results/more", "orchestrator/results/figures"):
        "a figure that is added there is a row of the table of figures",
}  # fmt: skip
"""What a room is allowed and does not use, and why."""
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


@dataclass(frozen=True)
class Row:
    """A row of a table of rooms; all rooms are folders or modules below `ROOT`."""

    where: str
    rooms: tuple[str, ...]
    named: tuple[str, ...]
    all_above: bool
    line: str


def table(document: Path) -> Iterator[Row]:
    """The table of a document, if it has one: ARCHITECTURE.md, or the README of a room."""
    text = document.read_text("utf-8") if document.is_file() else ""
    where = document.relative_to(ROOT).as_posix()
    for line in text.partition("<!-- rooms -->\n")[2].partition("\n\n")[0].splitlines()[2:]:
        room, _, allowed = (cell.strip() for cell in line.strip("|").split("|"))
        names = () if allowed in ("–", ALL_ABOVE, GROUND) else tuple(allowed.split(", "))
        yield Row(
            where, tuple(place(document, name) for name in re.findall(r"`([^`]+)`", room)),
            tuple(place(document, name) for name in names), allowed == ALL_ABOVE, line,
        )  # fmt: skip


def place(document: Path, name: str) -> str:
    """Where the room is that a table means."""
    name, folder = name.rstrip("/"), document.parent
    if folder == ROOT:
        return name if name.partition("/")[0] in FOLDERS else f"orchestrator/{name}"
    inside = folder.relative_to(ROOT).as_posix()
    return inside if name == folder.name else f"{inside}/{name}"


@cache
def outer_rows() -> tuple[Row, ...]:
    return tuple(table(ROOT / "ARCHITECTURE.md"))


@cache
def inner_rows() -> dict[str, tuple[Row, ...]]:
    """Of each room with rooms inside: their rows."""
    outer = [room for row in outer_rows() for room in row.rooms]
    tables = {room: tuple(table(ROOT / room / "README.md")) for room in outer}
    return {room: rows for room, rows in tables.items() if rows}


def inside(outer: str) -> list[str]:
    """The rooms inside a room of the outer table, itself among them, in their order."""
    return [room for row in inner_rows().get(outer, ()) for room in row.rooms] or [outer]


@cache
def order() -> tuple[str, ...]:
    """All rooms, as if the inner tables stood in the outer one."""
    return tuple(room for row in outer_rows() for outer in row.rooms for room in inside(outer))


def meant(name: str) -> set[str]:
    """The rooms that a name stands for: itself and those inside it, above its own row."""
    rooms_in = inside(name)
    return set(rooms_in[: rooms_in.index(name) + 1])


def allowed_by(row: Row) -> set[str]:
    """What a row allows."""
    first = order().index(inside(row.rooms[0])[0])
    if row.all_above:
        return set(order()[:first])
    ground = order()[: order().index(LAST_OF_GROUND) + 1]
    beyond = set(ground) - {NOT_OF_GROUND} if first >= len(ground) else set()
    return beyond.union(*map(meant, row.named))


@cache
def rooms() -> dict[str, set[str]]:
    """All rooms, and what each may import."""
    found: dict[str, set[str]] = {}
    for row in outer_rows():
        for outer in row.rooms:
            found |= {
                room: allowed_by(row).union(*map(meant, inner.named))
                for inner in inner_rows().get(outer, ())
                for room in inner.rooms
            } or {outer: allowed_by(row)}
    return {room: found[room] for room in order()}


def room_of(module: Module) -> str:
    """The innermost row of the tables that holds a module."""
    where = module.path.relative_to(ROOT).with_suffix("").as_posix().removesuffix("/__init__")
    return max((r for r in rooms() if f"{where}/".startswith(f"{r}/")), key=len, default="")


def circles(drawn: Mapping[str, set[str]]) -> list[list[str]]:
    """Groups of modules that import each other, by Tarjan's algorithm."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(name: str) -> None:
        index[name] = low[name] = len(index)
        stack.append(name)
        for other in sorted(drawn[name]):
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

    for name in drawn:
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


def climbing(drawn: Mapping[str, Collection[str]]) -> list[str]:
    """The arrows that no row allows."""
    known = modules()
    return [
        f"{known[name].where} imports {known[other].where}"
        for name, others in drawn.items()
        for other in others
        if room_of(known[other]) not in (room_of(known[name]), *rooms()[room_of(known[name])])
    ]


def test_the_rooms_are_all_in_the_table_and_there() -> None:
    assert len(outer_rows()) > 10
    assert len(inner_rows()) > 5
    assert len(set(order())) == len(order())
    assert {m.where for m in modules().values() if not room_of(m)} == set()
    for room in rooms():
        assert (ROOT / room).is_dir() or (ROOT / f"{room}.py").is_file(), room


def test_a_folder_inside_a_room_is_a_room() -> None:
    """Those of components belong to `models/`, whose declarations know them all."""
    folders = {Path(module.where).parent.as_posix() for module in modules().values()}
    components = {f for f in folders if f.startswith("models/")} - {*rooms()}
    assert folders - components - {*rooms()} == set()
    assert all((ROOT / Path(*Path(f).parts[:2]) / "variables.py").is_file() for f in components)


def test_the_tables_of_rooms_go_one_way() -> None:
    for room, allowed in rooms().items():
        assert all(order().index(other) < order().index(room) for other in allowed), room
    for row in itertools.chain(outer_rows(), *inner_rows().values()):
        first = order().index(row.rooms[0])
        assert all(order().index(name) < first for name in row.named), row.line
        assert len(set(row.named)) == len(row.named), row.line


def test_the_architecture_is_read_in_five_minutes() -> None:
    lines = (ROOT / "ARCHITECTURE.md").read_text("utf-8").splitlines()
    assert len(lines) <= 170
    assert sum(map(len, lines)) <= 14_000
    assert len(outer_rows()) <= 35
    assert [row.line for row in outer_rows() if len(row.line) > 110] == []


def test_no_arrow_climbs() -> None:
    assert climbing(arrows()) == []


@pytest.mark.parametrize(
    ("name", "other"),
    [
        ("analysis.two_level.fit", "analysis.levels.cells"),
        ("judge.definitions", "results.responses"),
        ("simulation.plans.plan", "simulation.children.process"),
        ("results.figures.run", "results.result"),
        ("tracks.read", "models.settings.beacons"),
        ("study.batch", "fmus.conformance.kit"),
        ("require.run", "report.paper.numbers"),
        ("errors", "fmus.host.instances"),
    ],
)
def test_an_arrow_that_climbs_is_found(name: str, other: str) -> None:
    drawn = {f"sblcosim.{name}": {f"sblcosim.{other}"}}
    assert climbing(drawn) == [
        f"{modules()[f'sblcosim.{name}'].where} imports {modules()[f'sblcosim.{other}'].where}"
    ]


def test_a_room_is_not_allowed_what_it_does_not_use() -> None:
    """So that the tables are what is, beyond the ground that everybody may use."""
    known = modules()
    used: dict[str, set[str]] = {room: set() for room in rooms()}
    for name, others in arrows().items():
        used[room_of(known[name])].update(room_of(known[other]) for other in others)

    def idle(rooms_of_row: Iterable[str], named: Iterable[str]) -> Iterator[tuple[str, str]]:
        of_all = set().union(*(used[room] for room in rooms_of_row))
        yield from ((min(rooms_of_row), name) for name in named if not meant(name) & of_all)

    outer = (
        pair for row in outer_rows()
        for pair in idle([r for room in row.rooms for r in inside(room)], row.named)
    )  # fmt: skip
    inner = (
        pair for rows in inner_rows().values() for row in rows
        for pair in idle(row.rooms, row.named)
    )  # fmt: skip
    assert {*outer, *inner} == set(NOT_USED_YET)
    assert all(NOT_USED_YET.values())


def benchmarks() -> dict[str, set[str]]:
    """The scripts of the benchmarks, and which of each other they import, in functions too."""
    files = {path.stem: path for path in (ROOT / "benchmarks").rglob("*.py")}
    return {
        name: {
            inner.name if isinstance(inner, ast.alias) else inner.module or ""
            for node in ast.walk(ast.parse(path.read_text("utf-8")))
            if isinstance(node, ast.Import | ast.ImportFrom)
            for inner in (*node.names, *([node] if isinstance(node, ast.ImportFrom) else []))
        } & {*files}
        for name, path in files.items()
    }


def test_there_are_no_circles() -> None:
    assert circles(arrows()) == []
    assert {"numpy_study"} <= benchmarks()["numpy_plain"]
    assert circles(benchmarks()) == []
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) == [["a", "b", "c"]]


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
    "from sblcosim.simulation.children.process import _signal",
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
        if isinstance(node, ast.FunctionDef)
        and node.name.lstrip("_") in words
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


def documents() -> list[Path]:
    """What tells where something is: ARCHITECTURE.md, CONTRIBUTING.md and the rooms' READMEs."""
    folders = (ROOT / name for name in (*FOLDERS, "tests", "tools"))
    return [
        ROOT / "ARCHITECTURE.md", ROOT / "CONTRIBUTING.md",
        *sorted(path for folder in folders for path in folder.rglob("README.md")),
    ]  # fmt: skip


@cache
def texts() -> dict[Path, str]:
    """All that is written by hand in the folders of the sources, the tests and the tools."""
    folders = (*FOLDERS, "tests", "tools", "benchmarks", "docs", "examples")
    files = (path for folder in folders for path in (ROOT / folder).rglob("*"))
    return {
        path: path.read_text("utf-8")
        for path in [*files, ROOT / "pyproject.toml"]
        if path.suffix in WRITTEN
        and not {"made", "ready", "__pycache__"} & {*path.parts}
        and path != Path(__file__)
    }


@cache
def words() -> set[str]:
    """All names in what is no document: alone, and with the name before them."""
    code = "\n".join(text for path, text in texts().items() if path.suffix != ".md")
    return {*re.findall(r"\w+", code), *re.findall(r"(?=\b(\w+\.\w+))", code)}


def missing(document: Path, text: str) -> list[str]:
    """Paths, modules and names in a document that are nowhere.

    A path is one from the document's folder, or from the root. ``module.name`` is a name in a
    module, and a name in brackets after a path is in that file.
    """
    prose = re.sub(r"^```.*?^```$", "", text, flags=re.DOTALL | re.MULTILINE)
    paths = re.findall(r"`([^`\n]+)`(?:\s\(`(\w+)`[^)]*\))?", prose)
    return [
        f"{name} ({inner})" if inner else name
        for name, inner in paths
        if name not in NOWHERE and not _is_there(document.parent, name, inner)
    ]


def _is_there(folder: Path, name: str, inner: str) -> bool:
    file, dotted = re.fullmatch(r"[\w./*-]+", name), re.fullmatch(r"(\w+)\.(\w+)(\(\))?", name)
    if file and (name.endswith("/") or Path(name).suffix in WRITTEN):
        if name == f"{folder.name}/":
            return True
        homes = [folder, ROOT, *([ROOT / "orchestrator"] if folder == ROOT else [])]
        found = [path for home in homes for path in home.glob(name)]
        return any(not inner or path.is_dir() or _says(path, inner) for path in found)
    if dotted and dotted[2] not in DATA:
        called = (path for path in texts() if path.stem == dotted[1] and path.suffix != ".md")
        owns = (path for path, text in texts().items() if f"class {dotted[1]}" in text)
        return name.removesuffix("()") in words() or any(
            _says(path, dotted[2]) for path in (*called, *owns)
        )
    if plain := re.fullmatch(r"(\w*[_A-Z]\w*)(\(\))?", name):
        return plain[1] in words()
    return True


def _says(path: Path, name: str) -> bool:
    return bool(re.search(rf"\b{name}\b", texts().get(path, "")))


@pytest.mark.parametrize("path", documents(), ids=lambda path: path.relative_to(ROOT).as_posix())
def test_what_a_document_names_is_there(path: Path) -> None:
    assert missing(path, path.read_text("utf-8")) == []


@pytest.mark.parametrize(
    "name",
    ["`sequential.py`", "`study/gone.py`", "`orchestrator/gone/`", "`batch.gone`", "`_goneFrom`",
     "`study/batch.py` (`_gone`)", "`models/*/gone.py`", "`Campaign.gone`", "`GoneAway`"],
)  # fmt: skip
def test_what_is_nowhere_is_found(name: str) -> None:
    assert len(missing(ROOT / "orchestrator" / "README.md", f"See {name} there.")) == 1
