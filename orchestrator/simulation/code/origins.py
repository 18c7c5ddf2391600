"""Origin of Python code: the standard library, an installed package, this project, or the user."""

from __future__ import annotations

import ast
import importlib
import importlib.metadata
import importlib.util
import sys
import sysconfig
from collections.abc import Iterator, Mapping
from functools import cache, lru_cache
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType

_OURS = "sblcosim"
_STANDARD = tuple(
    Path(sysconfig.get_path(name)).resolve() for name in ("stdlib", "platstdlib")
)
_INSTALLED = {"site-packages", "dist-packages"}


def file_of(module: ModuleType) -> Path | None:
    """The file of a module; None if it has none."""
    file = getattr(module, "__file__", None)
    return Path(file).absolute() if isinstance(file, str) else None


@lru_cache(4096)
def package_of(name: str, file: Path | None) -> str | None:
    """Identity of the package of a module; None for code of the user.

    Installed packages are identified by name and version, the standard library by the version of
    Python, and this package by its name.
    """
    root = name.partition(".")[0]
    if root == _OURS:
        return _OURS
    if file is None:
        standard = root in sys.stdlib_module_names and root != "__main__"
        return _python() if standard else None
    if _INSTALLED & set(file.parts):
        return f"{root} {_version(root)}"
    if any(file.resolve().is_relative_to(folder) for folder in _STANDARD):
        return _python()
    return None


def _python() -> str:
    return f"Python {sys.version_info.major}.{sys.version_info.minor}"


@cache
def _version(root: str) -> str:
    try:
        return importlib.metadata.version(root)
    except importlib.metadata.PackageNotFoundError:
        pass
    names = importlib.metadata.packages_distributions().get(root, ())
    versions = [f"{name} {importlib.metadata.version(name)}" for name in sorted(set(names))]
    return ", ".join(versions) or str(getattr(sys.modules.get(root), "__version__", ""))


def is_users_file(file: Path) -> bool:
    """Whether a Python file is neither installed nor part of the standard library."""
    installed = _INSTALLED & set(file.parts)
    return not installed and not any(file.resolve().is_relative_to(f) for f in _STANDARD)


def package_of_module(module: ModuleType) -> str | None:
    """As `package_of`."""
    return package_of(module.__name__, file_of(module))


def found(name: str) -> tuple[Path | None, str, bool] | None:
    """File, package (`""` at the top) and kind of the module that a name means.

    Nothing is imported for this: a module that is not loaded is searched for. The kind tells
    whether its code is the user's. None: there is no such module.
    """
    module = sys.modules.get(name)
    if module is not None:
        package = getattr(module, "__package__", None) or ""
        return file_of(module), package, package_of_module(module) is None
    spec = _spec(name)
    if spec is None:
        return None
    file = Path(spec.origin).absolute() if spec.has_location and spec.origin else None
    inside = name if spec.submodule_search_locations is not None else name.rpartition(".")[0]
    return file, inside, package_of(name, file) is None


def users_module(name: str) -> ModuleType | None:
    """A user's module by its name, imported if necessary; None if there is none."""
    known = found(name)
    if known is None or not known[2]:
        return None
    try:
        return importlib.import_module(name)
    except (Exception, SystemExit):  # the code that imports it fails too
        return None


def _spec(name: str) -> ModuleSpec | None:
    above, _, _ = name.rpartition(".")
    try:
        if not above:
            return importlib.util.find_spec(name)
        parent = getattr(sys.modules.get(above), "__path__", None)
        if parent is None:
            spec = _spec(above)
            parent = spec.submodule_search_locations if spec is not None else None
        return PathFinder.find_spec(name, list(parent)) if parent is not None else None
    except (ImportError, ValueError, AttributeError):
        return None


@lru_cache(256)
def imported(source: bytes, package: str) -> tuple[str, ...]:
    """Names of all modules that a source imports, also in functions, and of all possible modules.

    Parameters
    ----------
    package
        Package from which relative imports start.
    """
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError, RecursionError):
        return ()
    return tuple(sorted({name for node in ast.walk(tree) for name in _names(node, package)}))


def _names(node: ast.AST, package: str) -> Iterator[str]:
    if isinstance(node, ast.Import):
        for alias in node.names:
            yield from above(alias.name)
    elif isinstance(node, ast.ImportFrom):
        start = absolute(node.module or "", node.level, package)
        if start:
            yield from above(start)
            yield from (f"{start}.{alias.name}" for alias in node.names if alias.name != "*")
    elif isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
        called, name = node.func, node.args[0].value
        by = getattr(called, "attr", getattr(called, "id", ""))  # of `importlib`, or a name
        if by in ("import_module", "__import__") and isinstance(name, str):
            plain = name.lstrip(".")
            yield from above(absolute(plain, len(name) - len(plain), package))


def above(name: str) -> Iterator[str]:
    """A dotted name and the packages above it, from the top."""
    parts = name.split(".")
    yield from (".".join(parts[: i + 1]) for i in range(len(parts)))


def absolute(name: str, level: int, package: str) -> str:
    """The name of a module that is imported relatively; `""` if there is none."""
    if not level:
        return name
    start = package.split(".")[: len(package.split(".")) - level + 1]
    return ".".join([*start, name] if name else start) if package else ""


def package_in(namespace: Mapping[str, object]) -> str:
    """The package from which relative imports of a module with these globals start."""
    package = namespace.get("__package__")
    return package if isinstance(package, str) else ""
