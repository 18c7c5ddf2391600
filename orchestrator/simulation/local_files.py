"""Files of the user's Python code, with the local files that they import, and their identity.

A file is known by its bytes, by those of all local files that it and they import, and by names and
versions of the installed packages that these import. Local is what is neither installed, nor of the
standard library, nor ours. Files are known by the names of their modules, not by their folders.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.machinery
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.machinery import ModuleSpec
from json import dumps
from pathlib import Path
from types import FunctionType, ModuleType

from ..errors import ConfigurationError, quoted
from . import origins

_SOURCES = tuple(importlib.machinery.SOURCE_SUFFIXES)


@dataclass
class Imports:
    """What some code imports: local files by the names of their modules, and packages."""

    files: dict[str, tuple[Path, str]] = field(default_factory=dict)
    packages: set[str] = field(default_factory=set)
    _installed: set[str] = field(default_factory=set)

    def facts(self) -> list[object]:
        """Plain and sorted, without folders."""
        return [sorted((name, sha) for name, (_, sha) in self.files.items()), sorted(self.packages)]

    def __bool__(self) -> bool:
        return bool(self.files or self.packages)

    def add_source(self, source: bytes, package: str) -> None:
        """Add all that a source imports, and what that imports."""
        for name in origins.imported(source, package):
            self.add_name(name)

    def add_name(self, name: str) -> None:
        """Add a module by its name, if there is one."""
        if name in self.files or name.partition(".")[0] in self._installed:
            return
        if (known := origins.found(name)) is None:
            return
        file, package, users = known
        if not users:
            words = origins.package_of(name, file) or ""
            self._installed.add(name.partition(".")[0])
            # Of the standard library and of this package, files need no version.
            if words != "sblcosim" and not words.startswith("Python "):
                self.packages.add(words)
        elif file is not None and file.is_file():
            self.add_file(name, file, package)

    def add_module(self, module: ModuleType) -> None:
        """Add a module that is there, whether its name can be imported or not."""
        file = origins.file_of(module)
        if file is None or module.__name__ in self.files or not file.is_file():
            return
        if origins.package_of_module(module) is None:
            self.add_file(module.__name__, file, getattr(module, "__package__", None) or "")

    def add_file(self, name: str, file: Path, package: str) -> None:
        """Add a local file, and what that imports."""
        content = file.read_bytes()
        self.files[name] = (file, hashlib.sha256(content).hexdigest())
        if file.suffix in _SOURCES:
            self.add_source(content, package)


def identity_of_module(module: ModuleType) -> list[object]:
    """What a module of the user is known by: its file, and all that this imports."""
    imports = Imports()
    imports.add_module(module)
    return imports.facts()


def identity_of_names(names: Iterable[tuple[str, int, str]], package: str) -> list[object]:
    """What modules are known by that some code imports, by name and level.

    Parameters
    ----------
    package
        That relative imports start from.
    """
    imports = Imports()
    for name, level, _ in names:
        full = origins.absolute(name, level, package)
        for part in origins.above(full) if full else ():
            imports.add_name(part)
    return imports.facts()


# --- Loading -------------------------------------------------------------------------------------


@dataclass
class _Loaded:
    module: ModuleType
    imports: Imports

    def is_current(self) -> bool:
        """Whether its imports are still as they were."""
        return all(
            path.is_file() and hashlib.sha256(path.read_bytes()).hexdigest() == sha
            for path, sha in self.imports.files.values()
        )


_LOADED: dict[tuple[Path, bytes], _Loaded] = {}
_LONGEST = 64
_OWN: dict[str, ModuleType] = {}
"""Local modules that were first imported by a file that was loaded here."""
_SEEN: dict[int, tuple[ModuleSpec, str]] = {}
"""SHA-256 of local files when modules were first seen, by their import."""


def loaded(
    path: Path, source: bytes, execute: Callable[[Path, bytes], ModuleType]
) -> tuple[ModuleType, str]:
    """Run a file, or take it as it was run, with its identity.

    A file without local and installed imports is known by the SHA-256 of its bytes. If a local file
    has changed that a file run here has imported, it is imported again.

    Parameters
    ----------
    path
        Absolute.
    execute
        Runs the source, and returns its module.

    Raises
    ------
    ConfigurationError
        A local file has changed since another part of this process has imported it.
    """
    known = _LOADED.get((path, source))
    if known is None or not known.is_current():
        for name, module in _OWN.items():
            if sys.modules.get(name) is module:
                del sys.modules[name]
        _OWN.clear()
        before = set(sys.modules)
        module = _executed(path, source, execute)
        new = {n: sys.modules[n] for n in {*sys.modules} - before if _is_local(sys.modules[n])}
        _OWN.update(new)
        known = _Loaded(module, _imports(source, module, new.values()))
        _check(known.imports)
        while len(_LOADED) >= _LONGEST:
            del _LOADED[next(iter(_LOADED))]
        _LOADED[path, source] = known
    sha256 = hashlib.sha256(source).hexdigest()
    if not known.imports:
        return known.module, sha256
    facts = dumps([sha256, *known.imports.facts()])
    return known.module, hashlib.sha256(facts.encode()).hexdigest()


def module_of(
    path: Path, source: bytes, execute: Callable[[Path, bytes], ModuleType]
) -> ModuleType:
    """The module of a file as it was run, or else run now; as `loaded`."""
    known = _LOADED.get((path, source))
    return loaded(path, source, execute)[0] if known is None else known.module


def _executed(
    path: Path, source: bytes, execute: Callable[[Path, bytes], ModuleType]
) -> ModuleType:
    # Compiled files are told apart by seconds, so a file that was just changed may seem unchanged.
    written, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    importlib.invalidate_caches()
    try:
        return execute(path, source)
    finally:
        sys.dont_write_bytecode = written


def _imports(source: bytes, module: ModuleType, new: Iterable[ModuleType]) -> Imports:
    imports = Imports()
    imports.add_source(source, "")
    for other in (*new, *_held(module)):
        imports.add_module(other)
    return imports


def _held(module: ModuleType) -> Iterator[ModuleType]:
    """Modules in a namespace, and those of its functions and classes."""
    for thing in vars(module).values():
        if isinstance(thing, ModuleType) and thing is not module:
            yield thing
        elif isinstance(thing, type | FunctionType):
            other = sys.modules.get(str(thing.__module__))
            if other is not None:
                yield other


def _is_local(module: object) -> bool:
    # Anything may be in `sys.modules`.
    return isinstance(module, ModuleType) and _local(
        str(module.__name__), str(getattr(module, "__file__", None) or "")
    )


@lru_cache(4096)
def _local(name: str, file: str) -> bool:
    return bool(file) and origins.package_of(name, Path(file).absolute()) is None


def _check(imports: Imports) -> None:
    """Refuse code that differs from the file that it is known by."""
    for name, (path, sha) in imports.files.items():
        spec = getattr(sys.modules.get(name), "__spec__", None)
        if spec is None:
            continue
        _, first = _SEEN.setdefault(id(spec), (spec, sha))
        if first != sha:
            raise ConfigurationError(
                f"{path}: must be as it was imported, got a file that has changed since; import "
                f"{quoted(name)} again (importlib.reload)"
            )
