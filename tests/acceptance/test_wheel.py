"""What `pip install .` puts on a user's machine."""

from __future__ import annotations

import ast
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path, PurePosixPath

import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = {
    "orchestrator": PurePosixPath("sblcosim"),
    "models": PurePosixPath("sblcosim/models"),
    "fmus": PurePosixPath("sblcosim/fmus"),
}
NOT_SHIPPED = {".fmu", ".pyc"}
NOT_SOURCE = (".*", "build", "dist", "runs", "*.egg-info", "__pycache__")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    # Not in place: a build leaves folders behind.
    ignored = shutil.ignore_patterns(*NOT_SOURCE)
    shutil.copytree(
        ROOT, source, ignore=lambda at, names: ignored(at, names) if Path(at) == ROOT else []
    )
    subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation",
         "--wheel-dir", str(folder), str(source)],
        check=True,
    )
    (path,) = folder.glob("*.whl")
    return path


def test_the_wheel_has_every_module_and_data_file(wheel: Path) -> None:
    """But READMEs for maintainers, which are pages about the project."""
    packed = {PurePosixPath(name) for name in zipfile.ZipFile(wheel).namelist()}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    data = project["tool"]["setuptools"]["package-data"]
    missing = []
    for folder, package in FOLDERS.items():
        for path in sorted((ROOT / folder).rglob("*")):
            inside = package / PurePosixPath(path.relative_to(ROOT / folder).as_posix())
            if path.name == "README.md":
                of = ".".join(inside.parts[:-1])
                assert (inside in packed) == bool({"README.md", "*.md"} & {*data.get(of, ())})
            elif path.is_file() and path.suffix not in NOT_SHIPPED and inside not in packed:
                missing.append(str(inside))
    assert not missing


def test_the_wheel_installs_nothing_but_the_package(wheel: Path) -> None:
    tops = {name.partition("/")[0] for name in zipfile.ZipFile(wheel).namelist()}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"sblcosim"}


def test_the_wheel_has_the_licence_and_the_command(wheel: Path) -> None:
    archive = zipfile.ZipFile(wheel)
    names = archive.namelist()
    (entry_points,) = (name for name in names if name.endswith("entry_points.txt"))
    assert "sblcosim = sblcosim.__main__:main" in archive.read(entry_points).decode()
    (metadata,) = (name for name in names if name.endswith(".dist-info/METADATA"))
    assert "License-Expression: MIT" in archive.read(metadata).decode()
    assert any(name.endswith("licenses/LICENSE") for name in names)


def test_imports_point_one_way() -> None:
    """models -> fmus -> orchestrator; the declarations need neither CasADi nor NumPy."""
    script = (
        "import sys, sblcosim.models, sblcosim.models.ports;"
        "print([m for m in ('casadi', 'numpy', 'fmpy', 'sblcosim.fmus') if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"
    orchestrator = {p.stem for p in (ROOT / "orchestrator").glob("*.py")} - {"__init__"}
    for folder, forbidden in (
        ("models", {*orchestrator, "fmus"}),
        ("fmus", orchestrator - {"errors"}),  # fmus has a module of that name itself
    ):
        paths = [*(ROOT / folder).rglob("*.py")]
        assert len(paths) > 20
        for path in paths:
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.ImportFrom) and node.module and not node.level:
                    parts = node.module.split(".")
                    assert parts[0] != "sblcosim" or parts[1] not in forbidden, (path, node.module)
