"""What an FMU is known by: a change of one model changes its own FMU and no other."""

from __future__ import annotations

import ast
import hashlib
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from functools import cache
from pathlib import Path

import pytest
from sblcosim.fmus.build import ingredients
from sblcosim.models import COMPONENTS, RECEIVERS
from sblcosim.models.declaration import Component, Condition, Terminal, Variable, parameter
from sblcosim.models.receiver.receivers import FOUND
from seams import Seam

ROOT = Path(__file__).parents[3]
KEYS = """
import json, sys, sblcosim
from sblcosim.fmus.build.factory import key
from sblcosim.models import COMPONENTS
assert sblcosim.__file__.startswith(sys.argv[1]), sblcosim.__file__
print(json.dumps({f"{name} {fmi}": key(name, fmi) for name in COMPONENTS for fmi in (2, 3)}))
assert "casadi" not in sys.modules
"""

Keys = Callable[[], dict[str, str]]


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the sources, as they are installed."""
    tree = tmp_path_factory.mktemp("tree") / "sblcosim"
    for source, target in (("orchestrator", "."), ("models", "models"), ("fmus", "fmus")):
        skip = shutil.ignore_patterns("__pycache__", "ready")
        shutil.copytree(ROOT / source, tree / target, ignore=skip, dirs_exist_ok=True)
    return tree


def said(tree: Path, code: str) -> str:
    """What code prints in a process that runs from a copy."""
    output = subprocess.run(
        [sys.executable, "-B", "-c", code, str(tree)],
        env={**os.environ, "PYTHONPATH": str(tree.parent)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert output.returncode == 0, output.stderr
    return output.stdout


def keys(tree: Path) -> dict[str, str]:
    """The key of each FMU, ``ekf 2``."""
    result: dict[str, str] = json.loads(said(tree, KEYS))
    return result


@pytest.fixture(scope="module")
def before(tree: Path) -> dict[str, str]:
    return keys(tree)


ALL = set(COMPONENTS)
FILTERS = {"ekf", "sequential"}
APART = ALL - {name for name, it in FOUND.items() if it.equations is not None}
"""Of a receiver whose equations stand beside its declaration, that is an ingredient as a text."""


@pytest.mark.parametrize(
    ("file", "changed"),
    [
        ("models/receiver/ekf.py", {"ekf"}),
        ("models/receiver/kalman.py", FILTERS),
        ("models/receiver/least_squares.py", set(RECEIVERS)),
        ("models/receiver/README.md", set(RECEIVERS)),
        ("models/receiver/coupled.md", {"coupled", "fixed_lag"}),
        ("models/SYMBOLS.md", set(COMPONENTS)),
        ("models/geometry.py", {"platform", "acoustics"}),
        ("models/target/trajectories/square.py", {"target"}),
        ("models/target/trajectories/__init__.py", {"target"}),
        ("models/equations.py", ALL),
        ("models/__init__.py", set()),
        ("models/platform/beaufort.py", set()),
        ("fmus/files.py", set()),
        ("models/receiver/bound.py", set()),
        ("fmus/build/bound_source.py", set()),
        ("fmus/c/bound.c", set()),
        ("fmus/host/instances.py", set()),
        ("fmus/conformance/kit.py", set()),
        ("scenario/wiring.py", set()),
        ("simulation/masters/c/native.c", set()),
        ("fmus/platforms.py", ALL),
        ("fmus/c/engine.h", ALL),
        ("fmus/build/generator.py", ALL),
        ("fmus/build/documentation.html.jinja", ALL),
    ],
)
def test_a_changed_file_changes_the_fmus_that_it_goes_into(
    file: str, changed: set[str], tree: Path, before: dict[str, str]
) -> None:
    content = (tree / file).read_text()
    comment = {".py": "# changed", ".md": "changed", ".jinja": "changed"}
    try:
        (tree / file).write_text(content + comment.get(Path(file).suffix, "/* changed */") + "\n")
        after = keys(tree)
    finally:
        (tree / file).write_text(content)
    assert {name.split()[0] for name in after if after[name] != before[name]} == changed
    assert {name for name in after if after[name] != before[name]} == {
        f"{name} {fmi}" for name in changed for fmi in (2, 3)
    }


def test_a_shell_goes_into_the_fmus_of_its_version(tree: Path, before: dict[str, str]) -> None:
    file = tree / "fmus/c/fmi3.c"
    content = file.read_text()
    try:
        file.write_text(content + "/* changed */\n")
        after = keys(tree)
    finally:
        file.write_text(content)
    assert {name for name in after if after[name] != before[name]} == {f"{n} 3" for n in ALL}


BOUND = """
import sys, sblcosim
from sblcosim.fmus.build.bound import key
assert sblcosim.__file__.startswith(sys.argv[1]), sblcosim.__file__
print(key("x86_64-linux"), key("aarch64-darwin"))
assert "casadi" not in sys.modules
"""


def test_the_bound_is_known_by_its_equations_and_its_c(tree: Path) -> None:
    unchanged = said(tree, BOUND).split()
    assert len(set(unchanged)) == 2
    files = {
        "models/receiver/bound.py": True, "models/receiver/surroundings.py": True,
        "models/receiver/field.py": True, "fmus/build/bound_source.py": True,
        "fmus/build/straight_line.py": True, "fmus/c/bound.c": True, "fmus/c/bound.h": True,
        "fmus/c/real.h": True, "fmus/c/elementary.h": True, "fmus/c/widest.h": True,
        "models/receiver/ekf.py": False, "fmus/c/engine.h": False, "limits/recursion.py": False,
    }  # fmt: skip
    for file, counts in files.items():
        content = (tree / file).read_text()
        try:
            (tree / file).write_text(content + ("# " if file.endswith(".py") else "// ") + "new\n")
            assert (said(tree, BOUND).split() != unchanged) == counts, file
        finally:
            (tree / file).write_text(content)


@pytest.mark.parametrize(
    ("file", "old", "new", "changed"),
    [
        ("receivers/sequential", "rejected; 0 ", "rejected, 0 ", {"sequential"}),
        ("receivers/coupled", '"each beacon has', '"each of the beacons has', set()),
        ("variables", '"Form of Q;', '"The form of Q;', FILTERS),
        ("variables", '_PSD, "m2/s3", start=0.01, min=0.0', '_PSD, "m2/s3", start=0.02, min=0.0',
         FILTERS),
        ("variables", '{1: "variance", 2: "literal"}', '{1: "variances", 2: "literal"}',
         set(RECEIVERS)),
        ("receivers/multilateration", '"Multilateration", 6,', '"Multilateration", 99,',
         {"multilateration"}),
        ("variables", "NOISE = choice", "NOISE  = choice", set()),
    ],
)
def test_a_changed_declaration_changes_the_fmus_of_its_component(
    file: str, old: str, new: str, changed: set[str], tree: Path, before: dict[str, str]
) -> None:
    path = tree / f"models/receiver/{file}.py"
    content = path.read_text()
    assert content.count(old) == 1
    try:
        path.write_text(content.replace(old, new))
        after = keys(tree)
    finally:
        path.write_text(content)
    found = {name.split()[0] for name in after if after[name] != before[name]}
    assert found & APART == changed & APART


CHOICE = Variable("v", "A value", "parameter", choices={1: "one", 2: "two"}, start=1)
NUMBER = parameter("v", "A value", "m", shape=(2,), start=1.0, min=0.0, max=9.0)


@pytest.mark.parametrize(
    ("declared", "others"),
    [
        (
            NUMBER,
            {"name": "w", "description": "Another", "causality": "input", "unit": "s",
             "shape": (2, 1), "start": 2.0, "min": -1.0, "max": 8.0, "type": "Int32",
             "variability": "discrete", "choices": {1: "one"}, "named": {"free": -1.0},
             "needs": ((Condition("v", (1,)),),)},
        ),
        (Condition("v", (1,)), {"parameter": "w", "values": (2,)}),
        (
            Terminal("t", "depth", "A terminal", {"a": "b"}),
            {"name": "u", "kind": "estimate", "description": "Another", "members": {"a": "c"}},
        ),
        (
            Component("C", 1, "A component", (NUMBER,), None),
            {"name": "D", "number": 2, "description": "Another", "variables": (CHOICE,),
             "interval": "v", "variant": "v", "step_size": 0.2, "stop_time": 9.0,
             "terminals": (Terminal("t", "depth", "A terminal", {}),)},
        ),
    ],
)
def test_the_text_of_a_declaration_holds_every_field(declared, others) -> None:
    assert set(others) == {field.name for field in fields(declared) if field.repr}
    for name, value in others.items():
        if name == "choices":
            other = replace(declared, choices=value, start=1, shape=(), causality="input")
            assert repr(value) in repr(other)
        elif name == "named":
            assert repr(value) in repr(replace(declared, named=value, shape=(), start=1.0))
        else:
            assert repr(replace(declared, **{name: value})) != repr(declared), name


def path_of(module: str) -> Path:
    """The file of a module of ours, or its folder."""
    path = ROOT / module.removeprefix("sblcosim.").replace(".", "/")
    return path if path.is_dir() else path.with_suffix(".py")


@cache
def by_syntax(module: str) -> tuple[tuple[str, str], ...]:
    """What a module imports of ours, by its syntax tree: modules, and names of modules."""
    return tuple(imports_of(module))


def imports_of(module: str) -> Iterator[tuple[str, str]]:
    for statement in ast.walk(ast.parse(path_of(module).read_text("utf-8"))):
        taken: list[tuple[str, str]] = []
        if isinstance(statement, ast.Import):
            taken = [(alias.name, "") for alias in statement.names]
        elif isinstance(statement, ast.ImportFrom):
            parents = module.split(".")[: -statement.level] if statement.level else []
            origin = ".".join([*parents, *filter(None, [statement.module])])
            for alias in statement.names:
                taken += [(f"{origin}.{alias.name}", ""), (origin, alias.name)]
        for name, what in taken:
            folder = path_of(name)
            if not name.startswith(("sblcosim.models.", "sblcosim.fmus.")) or not folder.exists():
                continue
            if folder.is_file():
                yield name, what
            elif name.count(".") > 2:  # a folder inside a component's: all modules are there
                yield from ((f"{name}.{path.stem}", "") for path in folder.glob("*.py"))


def hashed(module: str) -> set[str]:
    """The labels of all parts that a module's hash is made of."""
    parts: list[bytes] = []

    class Hash:
        def update(self, part: bytes) -> None:
            parts.append(part)

        def hexdigest(self) -> str:
            return ""

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(hashlib, "sha256", Hash)
        ingredients.of_module(module, ())
    return {part.partition(b"\0")[0].decode() for part in parts}


def test_what_is_hashed_is_what_the_syntax_says_is_imported(seam: Seam) -> None:
    modules = [
        f"sblcosim.{folder}." + ".".join(path.relative_to(ROOT / folder).with_suffix("").parts)
        for folder in ("models", "fmus") for path in sorted((ROOT / folder).rglob("*.py"))
        if path.stem != "__init__"
    ]
    assert len(modules) > 60
    seam.forgets(ingredients)
    for module in modules:
        labels, reached, waiting = hashed(module), {module}, [module]
        assert module in labels
        while waiting:
            for name, what in by_syntax(waiting.pop()):
                found = {name, f"{name}.{what}"} & labels
                assert found, (module, name, what)
                if name in found and name not in reached:
                    waiting.append(name)
                reached |= found
        assert labels == reached, module


PLACES = ["{}", "def f():\n {}", "class C:\n {}", "if a: {}", "if a: pass\nelse: {}",
     "for x in y: {}", "while a: pass\nelse: {}", "with a: {}", "try: {}\nfinally: pass",
     "try: pass\nexcept A: {}", "try: pass\nexcept A: pass\nelse: {}", "try: pass\nfinally: {}",
     "async def f():\n async with a: {}", "match a:\n case 1: {}", "try: pass\nexcept* A: {}",
     "if a:\n def f():\n  try: pass\n  finally: {}"]  # fmt: skip
"""Where an import may stand."""


def test_an_import_is_found_wherever_it_stands(tree: Path) -> None:
    """A module that has it there is known by what it imports."""
    names = [*range(len(PLACES))]
    code = (
        "from sblcosim.fmus.build.ingredients import of_module\n"
        f"for n in {names}: print(of_module(f'sblcosim.models.receiver.imports_{{n}}', ()))\n"
    )
    inside = tree / "models/receiver"
    for n, where in enumerate(PLACES):
        text = where.format(f"from ..receiver.imported_{n} import X  # why")
        (inside / f"imports_{n}.py").write_text(text + "\n")
        (inside / f"imported_{n}.py").write_text("X = 1\n")
    try:
        before = said(tree, code).split()
        for n in names:
            (inside / f"imported_{n}.py").write_text("X = 2\n")
        after = said(tree, code).split()
    finally:
        for path in inside.glob("import*_*.py"):
            path.unlink()
    assert len(before) == len(PLACES) == len(set(before))
    assert [n for n in names if before[n] == after[n]] == []
