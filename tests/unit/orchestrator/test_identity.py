"""What code of the user is known by: every change counts, and no process does."""

from __future__ import annotations

import hashlib
import importlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from quick import one_in
from sblcosim.errors import ConfigurationError
from sblcosim.report.common import as_toml
from sblcosim.simulation.code import local_files, origins, user_code
from sblcosim.study import load, store
from seams import Seam

from .identity_cases import CHANGES, IMPORTS, OTHER_FILES, REFUSED, SAME, USED, Files


def function_of_file(text, folder, key):
    """The function of a file that is run here, and what it is known by."""
    file, _, name = text.rpartition(":")
    path = (folder / file).absolute()
    known = user_code.run_file(path, path.read_bytes(), key)
    return vars(known.module)[name], known.sha256

CHILD = """
import importlib, json, sys
from pathlib import Path
from sblcosim.errors import SblcosimError
from sblcosim.simulation.code.identity import identity
from sblcosim.report.common import as_toml
from sblcosim.simulation.code import local_files, origins, user_code

def function_of_file(text, folder, key):
    file, _, name = text.rpartition(":")
    path = (folder / file).absolute()
    known = user_code.run_file(path, path.read_bytes(), key)
    return vars(known.module)[name], known.sha256
from sblcosim.study import load, store

def of_object(folder):
    return identity(importlib.import_module("m").target, "receivers", "target")

def of_used(folder):
    target = importlib.import_module("m").target
    before = identity(target, "receivers", "target")
    target()
    after = identity(target, "receivers", "target")
    return before if before == after else "another after its call"

def of_file(folder):
    return function_of_file("m.py:target", Path(folder), "model")[1]

found = {}
start = sys.path[:]
for how, folder in json.load(sys.stdin):
    sys.path[:] = [folder, *start]
    importlib.invalidate_caches()
    try:
        found[folder] = globals()[how](folder)
    except SblcosimError as error:
        found[folder] = str(error)
    local = [n for n in sys.modules if n.partition(".")[0] in ("m", "helper", "deeper", "other")]
    for name in local:
        del sys.modules[name]
print(json.dumps(list(found.values())))
"""


Cases = dict[str, tuple[str | Files, tuple[str, str]]]
TABLES: dict[str, tuple[str, Cases]] = {
    "change": ("of_object", CHANGES), "same": ("of_object", SAME),
    "import": ("of_file", IMPORTS), "other file": ("of_file", OTHER_FILES),
    "used": ("of_used", USED),
}  # fmt: skip
"""Cases, and what their targets are known as."""


def identities(root: Path, sources: list[tuple[str, str | Files]], seed: int) -> list[str]:
    """Identities of the targets of some modules, in a process and folder of their own."""
    asked = []
    for number, (how, source) in enumerate(sources):
        files = {"m": source} if isinstance(source, str) else source
        folder = root / f"case-{number}"
        for name, text in files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / f"{name}.py").write_text(text)
        asked.append((how, str(folder)))
    done = subprocess.run(
        [sys.executable, "-c", CHILD], input=json.dumps(asked), capture_output=True, text=True,
        env={**os.environ, "PYTHONHASHSEED": str(seed), "PYTHONDONTWRITEBYTECODE": "1"},
        check=False,
    )  # fmt: skip
    assert not done.returncode, done.stderr
    found: list[str] = json.loads(done.stdout)
    return found


def filled(source: str | Files, value: str) -> str | Files:
    """A source with one of its two texts."""
    if isinstance(source, str):
        return source.replace("VALUE", value)
    return {k.replace("VALUE", value): v.replace("VALUE", value) for k, v in source.items()}


Found = dict[tuple[str, str], list[str]]


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Found:
    """Identities of all cases, by table and name: with either text, and with the first one again.

    Each is from another process, folder and seed of hashes.
    """
    found: Found = {}
    for n, folder, seed in ((0, "a", 1), (1, "longer/b", 2), (0, "c/and/more", 3)):
        sources = {
            (table, name): (how, filled(source, values[n]))
            for table, (how, cases) in TABLES.items()
            for name, (source, values) in cases.items()
        }
        root = tmp_path_factory.mktemp("cases") / folder
        for key, got in zip(sources, identities(root, [*sources.values()], seed), strict=True):
            found.setdefault(key, []).append(got)
    return found


def test_there_are_many_cases() -> None:
    assert len(CHANGES) >= 40
    assert len(SAME) >= 20


def named(*tables: str) -> list[tuple[str, str]]:
    """The cases of some tables."""
    return [(table, name) for table in tables for name in TABLES[table][1]]


@one_in(2)
@pytest.mark.parametrize("case", named("change", "import"), ids=": ".join)
def test_a_change_makes_other_code(found: Found, case: tuple[str, str]) -> None:
    one, two, again = found[case]
    assert len(one) == len(two) == 64, (one, two)
    assert one == again
    assert one != two


@pytest.mark.parametrize("case", named("same", "other file", "used"), ids=": ".join)
def test_neither_process_nor_folder_makes_other_code(
    found: Found, case: tuple[str, str]
) -> None:
    one, two, again = found[case]
    assert len(one) == 64, one
    assert one == two == again


def test_what_cannot_be_told_apart_is_refused_with_its_place(tmp_path: Path) -> None:
    got = identities(tmp_path, [("of_object", source) for source, _ in REFUSED.values()], 3)
    for name, message, (_, said) in zip(REFUSED, got, REFUSED.values(), strict=True):
        assert message.startswith("receivers: target must refer only to what can identify"), name
        assert said in message, name
        assert "\n" not in message


def test_a_file_that_imports_nothing_of_the_users_is_known_by_its_bytes(tmp_path: Path) -> None:
    file = tmp_path / "m.py"
    file.write_text("import math\nimport sblcosim\ndef target(): return math.pi\n")
    _, sha256 = function_of_file("m.py:target", tmp_path, "model")
    assert sha256 == hashlib.sha256(file.read_bytes()).hexdigest()


@pytest.mark.parametrize("level", [1, 2, 3])
@pytest.mark.parametrize("name", ["", "helper", "helper.deeper"])
def test_relative_imports_are_of_the_modules_that_python_imports(name: str, level: int) -> None:
    package, relative = "a.b.c", "." * level + name
    meant = importlib.util.resolve_name(relative, package)
    assert origins.absolute(name, level, package) == meant
    for source in (f"from {relative} import x", f"import_module({relative!r})"):
        assert meant in origins.imported(source.encode(), package)


def test_a_file_is_run_again_when_what_it_imports_has_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "m.py").write_text("import its_helper\ndef target(): return its_helper.X\n")
    known = []
    for value in (1, 2, 1):
        (tmp_path / "its_helper.py").write_text(f"X = {value}\n")
        function, sha256 = function_of_file("m.py:target", tmp_path, "model")
        assert function() == value
        known.append(sha256)
    assert known[0] == known[2] != known[1]
    assert function_of_file("m.py:target", tmp_path, "model")[0] is function


def test_code_that_is_not_that_of_its_file_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    helper = tmp_path / "users_helper.py"
    helper.write_text("X = 1\n")
    (tmp_path / "m.py").write_text("from users_helper import X\ndef target(): return X\n")
    module = importlib.import_module("users_helper")
    monkeypatch.setitem(sys.modules, "users_helper", module)
    assert function_of_file("m.py:target", tmp_path, "model")[0]() == 1
    helper.write_text("X = 2\n")
    with pytest.raises(ConfigurationError, match=r"users_helper.py: must be as it was imported"):
        function_of_file("m.py:target", tmp_path, "model")
    importlib.reload(module)
    assert function_of_file("m.py:target", tmp_path, "model")[0]() == 2


def test_packages_are_known_by_their_versions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seam: Seam
) -> None:
    place = tmp_path / "site-packages"
    about = place / "its_package-1.dist-info" / "METADATA"
    about.parent.mkdir(parents=True)
    (place / "its_package.py").write_text("def f(): return 1\n")
    (tmp_path / "m.py").write_text("import its_package\ndef target(): return its_package.f()\n")
    monkeypatch.syspath_prepend(str(place))
    known = set()
    for version in ("1.0", "1.0", "1.1"):
        about.write_text(f"Metadata-Version: 2.1\nName: its_package\nVersion: {version}\n")
        seam.forgets(origins, local_files)
        function, sha256 = function_of_file("m.py:target", tmp_path, "model")
        known.add((sha256, user_code.fingerprint(function, "model", "target")))
    assert len(known) == len({file for file, _ in known}) == len({code for _, code in known}) == 2


def study_of(folder: Path, out: Path) -> list[str]:
    """Ids of the runs of a study with a function of a file in this folder."""
    tables = {
        "name": "its", "model": "m.py:target", "factors": {"x": {"levels": [1.0, 2.0]}},
        "design": {"kind": "grid"}, "replicates": 1,
    }  # fmt: skip
    (folder / "its.toml").write_text(as_toml(tables))
    ids: list[str] = load(folder / "its.toml").run(out)["run_id"].tolist()
    return ids


def test_a_study_says_which_code_has_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, moved, out = tmp_path / "a", tmp_path / "b", tmp_path / "out"
    folder.mkdir()
    monkeypatch.syspath_prepend(str(folder))
    helper = folder / "studys_helper.py"
    helper.write_text("X = 1\n")
    (folder / "m.py").write_text("from studys_helper import X\ndef target(x): return X * x\n")
    first = study_of(folder, out)
    shutil.copytree(folder, moved)
    assert study_of(moved, out) == first
    helper.write_text("X = 2\n")
    with pytest.raises(
        ConfigurationError,
        match=r"with other model; the code of m.py:target, or what it imports, has changed$",
    ):
        study_of(folder, out)
    content = store.described(out)
    del content["identity"]
    (out / "study.json").write_bytes(store.sealed(content))
    with pytest.raises(ConfigurationError, match=r"code of m.py:target has changed, or .* earlier"):
        study_of(folder, out)
    assert study_of(folder, tmp_path / "other") != first
