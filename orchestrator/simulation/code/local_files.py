"""Files of the user's Python code, including imported local files, and their identity.

A file is identified by its bytes, by those of all local files that it imports directly or
indirectly, and by names and versions of the installed packages that these import. Local files are
neither installed, nor part of the standard library, nor ours. Files are identified by the names of
their modules, not by their folders.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.machinery
import os
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache, lru_cache
from importlib.machinery import ModuleSpec
from json import dumps
from pathlib import Path
from types import FunctionType, ModuleType
from typing import NamedTuple

from ...errors import CodeChangedError, ConfigurationError, quoted
from . import origins

_SOURCES = tuple(importlib.machinery.SOURCE_SUFFIXES)


@dataclass
class Imports:
    """Imports of some code: local files by the names of their modules, and packages."""

    files: dict[str, tuple[Path, str]] = field(default_factory=dict)
    packages: set[str] = field(default_factory=set)
    _installed: set[str] = field(default_factory=set)

    def facts(self) -> list[object]:
        """Plain and sorted, without folders."""
        return [sorted((name, sha) for name, (_, sha) in self.files.items()), sorted(self.packages)]

    def __bool__(self) -> bool:
        return bool(self.files or self.packages)

    def add_source(self, source: bytes, package: str) -> None:
        """Add everything that a source imports, directly or indirectly."""
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
            # The standard library and this package need no version for each file.
            if words != "sblcosim" and not words.startswith("Python "):
                self.packages.add(words)
        elif file is not None and file.is_file():
            self.add_file(name, file, package)

    def add_module(self, module: ModuleType) -> None:
        """Add a module that exists, whether its name can be imported or not."""
        file = origins.file_of(module)
        if file is None or module.__name__ in self.files or not file.is_file():
            return
        if origins.package_of_module(module) is None:
            self.add_file(module.__name__, file, getattr(module, "__package__", None) or "")

    def add_read(self, file: Path, folder: Path) -> None:
        """Add a source that is not a module, by its path relative to the file that read it."""
        inside = file.is_relative_to(folder)
        name = file.relative_to(folder).as_posix() if inside else file.name
        while f"./{name}" in self.files:
            name = f"other {name}"
        self.add_file(f"./{name}", file, "")

    def add_file(self, name: str, file: Path, package: str) -> None:
        """Add a local file and its imports."""
        content = file.read_bytes()
        self.files[name] = (file, hashlib.sha256(content).hexdigest())
        if file.suffix in _SOURCES:
            self.add_source(content, package)


def identity_of_module(module: ModuleType) -> list[object]:
    """Identity of a user's module: its file with everything that it imports."""
    imports = Imports()
    imports.add_module(module)
    return imports.facts()


def identity_of_names(names: Iterable[tuple[str, int, str]], package: str) -> list[object]:
    """Identity of the modules that some code imports, by name and level.

    Parameters
    ----------
    package
        Package from which relative imports start.
    """
    imports = Imports()
    for name, level, _ in names:
        full = origins.absolute(name, level, package)
        for part in origins.above(full) if full else ():
            imports.add_name(part)
    return imports.facts()


# --- Loading -------------------------------------------------------------------------------------


Files = tuple[tuple[str, Path, str], ...]
"""Local files that some code imports: names of their modules, paths and SHA-256."""


class Loaded(NamedTuple):
    """A file that has been run.

    Attributes
    ----------
    sha256
        Its identity.
    files
        Files that it imports.
    """

    module: ModuleType
    sha256: str
    files: Files


_LOADED: dict[tuple[Path, bytes], Loaded] = {}
_LONGEST = 64
_OWN: dict[str, ModuleType] = {}
"""Local modules that were first imported by a file loaded here."""
_SEEN: dict[int, tuple[ModuleSpec, str]] = {}
"""SHA-256 of local files when their modules were first imported."""


def loaded(
    path: Path, source: bytes, execute: Callable[[Path, bytes], ModuleType]
) -> Loaded:
    """Run a file, or return it as it was run, with its identity.

    A file without local and installed imports is identified by the SHA-256 of its bytes. If a local
    file imported by a file run here has changed, it is imported again.

    Parameters
    ----------
    path
        Absolute path.
    execute
        Runs the source, and returns its module.

    Raises
    ------
    ConfigurationError
        A local file has changed since another part of this process imported it.
    """
    known = _LOADED.get((path, source))
    if known is None or changed(known.files):
        for name, module in _OWN.items():
            if sys.modules.get(name) is module:
                del sys.modules[name]
        _OWN.clear()
        before = set(sys.modules)
        module, sources = _executed(path, source, execute)
        new = {n: sys.modules[n] for n in {*sys.modules} - before if _is_local(sys.modules[n])}
        _OWN.update(new)
        known = _loaded(source, module, _imports(source, module, new.values(), path, sources))
        _check(known.files)
        while len(_LOADED) >= _LONGEST:
            del _LOADED[next(iter(_LOADED))]
        _LOADED[path, source] = known
    return known


def module_of(
    path: Path, source: bytes, execute: Callable[[Path, bytes], ModuleType], files: Files
) -> ModuleType:
    """The module of a file, run now unless it has been run; see `loaded`.

    Parameters
    ----------
    files
        Files that it imports according to its identity.

    Raises
    ------
    CodeChangedError
        It imports a different file here, or one of these has changed.
    """
    known = _LOADED.get((path, source)) or loaded(path, source, execute)
    # One that another file here imported earlier may be missing.
    refuse(path, sorted({*known.files} - {*files}) or changed({*files} - {*known.files}))
    return known.module


def changed(files: Iterable[tuple[str, Path, str]]) -> Files:
    """Those of the files that have changed."""
    return tuple(
        (name, path, sha)
        for name, path, sha in files
        if not path.is_file() or hashlib.sha256(path.read_bytes()).hexdigest() != sha
    )


def refuse(path: Path, files: Iterable[tuple[str, Path, str]]) -> None:
    """Refuse code from a file if any of the files that it imports has changed."""
    for _, file, _ in files:
        raise CodeChangedError(
            f"{path.name}: must be as it was when it was loaded, but {file.name}, which it "
            "imports, has changed; load it again"
        )


def _loaded(source: bytes, module: ModuleType, imports: Imports) -> Loaded:
    sha256 = hashlib.sha256(source).hexdigest()
    if imports:
        sha256 = hashlib.sha256(dumps([sha256, *imports.facts()]).encode()).hexdigest()
    files = ((name, path, sha) for name, (path, sha) in imports.files.items())
    return Loaded(module, sha256, tuple(sorted(files)))


def _executed(
    path: Path, source: bytes, execute: Callable[[Path, bytes], ModuleType]
) -> tuple[ModuleType, set[str]]:
    """Run a file; returns also the other sources that are read or run in the process."""
    # Compiled files are compared by whole seconds, so a file just changed may seem unchanged.
    written, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    importlib.invalidate_caches()
    heard: set[str] = set()
    listener = threading.get_ident(), heard
    _listen()
    _LISTENERS.append(listener)
    try:
        return execute(path, source), heard
    finally:
        _LISTENERS.remove(listener)
        sys.dont_write_bytecode = written


_LISTENERS: list[tuple[int, set[str]]] = []
"""Threads that run files, and the sources read or run there."""


@cache
def _listen() -> None:
    """Observe opened files and executed code; such a hook stays forever."""

    def hear(event: str, arguments: tuple[object, ...]) -> None:
        if not _LISTENERS or event not in ("open", "exec"):
            return
        thing = getattr(arguments[0], "co_filename", arguments[0])
        with suppress(Exception):  # from the user's paths
            name = os.fspath(thing)  # type: ignore[call-overload]
            if isinstance(name, str) and name.endswith(_SOURCES):
                for thread, heard in _LISTENERS:
                    if thread == threading.get_ident():
                        heard.add(os.path.abspath(name))

    sys.addaudithook(hear)


def _imports(
    source: bytes, module: ModuleType, new: Iterable[ModuleType], path: Path, sources: set[str]
) -> Imports:
    imports = Imports()
    imports.add_source(source, "")
    for other in (*new, *_held(module)):
        imports.add_module(other)
    known = {str(origins.file_of(m)) for m in [*sys.modules.values()] if isinstance(m, ModuleType)}
    known |= {str(path), *(str(file) for file, _ in imports.files.values())}
    for file in map(Path, sorted(sources - known)):
        if file.is_file() and origins.is_users_file(file):
            imports.add_read(file, path.parent)
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


def _check(files: Files) -> None:
    """Refuse code that differs from the file that identifies it."""
    for name, path, sha in files:
        spec = getattr(sys.modules.get(name), "__spec__", None)
        if spec is None:
            continue
        _, first = _SEEN.setdefault(id(spec), (spec, sha))
        if first != sha:
            raise ConfigurationError(
                f"{path}: must be as it was imported, got a file that has changed since; import "
                f"{quoted(name)} again (importlib.reload)"
            )
