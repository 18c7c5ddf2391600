"""Python code of the user: run from a file, identified by a hash, sent by value."""

from __future__ import annotations

import inspect
import re
import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

import cloudpickle
from sblcosim.fmus.files import KINDS
from sblcosim.models.parts import DeclarationError

from ...errors import (
    CodeChangedError,
    ConfigurationError,
    escaped,
    instance,
    nearest,
    no_file,
    one_line,
    quoted,
    shortened,
)
from . import origins
from .identity import identity
from .local_files import Files, Loaded, changed, loaded, module_of, refuse
from .packing import packed

FILE = re.compile(r"(?P<file>.*\.py)(?::(?P<name>.*))?", re.DOTALL)
_LONGEST = 240  # characters of an exception's text


CONSTRUCTOR = "its constructor"
"""Name for the construction of an object in failure messages."""

_allowed: Callable[[], None] | None = None
_begun = False


def allow(loaded: Callable[[], None]) -> None:
    """Allow this process to run files of the user: a child process made for this.

    Parameters
    ----------
    loaded
        Called when a file has been run.
    """
    global _allowed
    _allowed = loaded


def is_allowed() -> bool:
    """Whether files of the user may be run in this process."""
    return _allowed is not None


def begun() -> bool:
    """Whether a file of the user has begun here, which may have replaced anything."""
    return _begun


def foreseen() -> tuple[type[BaseException], ...]:
    """Exceptions that the user's code may raise; all of them only in a separate process."""
    return (BaseException,) if is_allowed() else (Exception, SystemExit)


@dataclass(frozen=True)
class InFile:
    """A class or function in a file of the user, which is called only in child processes.

    Attributes
    ----------
    path, content
        The file, and its bytes; None: it is passed by value.
    name
        Its name in the file.
    key
        Identifies the file.
    files
        Files that it imports.
    is_receiver
        Whether it is a class derived from `sblcosim.Receiver`.
    parameters
        For a function: its parameters without defaults.
    packed
        Its value, for processes that may not have the file.
    """

    path: Path
    content: bytes | None
    name: str
    key: str
    files: Files = ()
    is_receiver: bool = False
    parameters: tuple[inspect.Parameter, ...] = ()
    packed: bytes | None = None

    @property
    def file(self) -> InFile:
        """The object itself; whatever contains it is identified elsewhere."""
        return self

    @property
    def __signature__(self) -> inspect.Signature:
        return inspect.Signature(self.parameters)

    def load(self) -> Any:
        """The class or function itself; the file is run, once.

        Raises
        ------
        CodeChangedError
            The imported files are not those that identify it.
        """
        assert _allowed is not None, "files of the user are run in child processes only"
        if self.content is None:
            assert self.packed is not None
            return _by_value(self.packed, self.path, self.files)
        return vars(module_of(self.path, self.content, _module, self.files))[self.name]

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        return self.load()(*arguments, **named)


class Gone:
    """Placeholder for a class or function of which only origin and hash are known."""

    def __init__(self, message: str) -> None:
        self.message = message

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        raise ConfigurationError(self.message)


class PythonSource:
    """A class or function of the user that makes a component.

    Attributes
    ----------
    origin
        ``/path/file.py:Class``, or the module and name if it did not come from a file.
    sha256
        Identity of the file, class or function, with everything it refers to.
    """

    # Not a dataclass: pydantic would convert it when a study holds it.
    def __init__(self, maker: Callable[[], Any], origin: str, sha256: str) -> None:
        self.maker, self.origin, self.sha256 = maker, origin, sha256
        self.__name__ = origin.rpartition(":")[2]
        self.__qualname__ = escaped(Path(origin).name)  # for display: without folders

    def __call__(self) -> Any:
        return self.maker()

    @property
    def file(self) -> InFile | None:
        """Its origin, if that is a file which this process does not run."""
        file: InFile | None = getattr(self.maker, "file", None)
        return file if isinstance(file, InFile) else None

    @property
    def is_file(self) -> bool:
        """Whether the origin is a file."""
        return is_python(self.origin)

    def __eq__(self, other: object) -> bool:
        same = isinstance(other, PythonSource)
        return same and (self.origin, self.sha256) == (other.origin, other.sha256)  # type: ignore[attr-defined]

    def __hash__(self) -> int:
        return hash((self.origin, self.sha256))

    def __reduce__(self) -> Any:
        if self.file is not None:
            return PythonSource, (self.maker, self.origin, self.sha256)
        # By value: a worker may have neither the file nor the module.
        return _unpacked, (by_value(self.maker), self.origin, self.sha256)

    def __repr__(self) -> str:
        return f"<Python component {self.origin}>"


def is_python(text: str) -> bool:
    """Whether a text is ``file.py`` or ``file.py:name``."""
    return FILE.fullmatch(text) is not None


def component_of(maker: Any) -> PythonSource:
    """The component that a class or function makes; identified by `fingerprint`.

    Raises
    ------
    ConfigurationError
        It is not a class or function with a name, or refers to something that cannot identify a
        run.
    """
    if isinstance(maker, PythonSource):
        return maker
    name = getattr(maker, "__qualname__", "")
    if not callable(maker) or not name:
        raise ConfigurationError(
            "receivers: must be names, files, or classes that make a component, got "
            f"{instance(maker)}"
        )
    return PythonSource(maker, f"{maker.__module__}:{name}", fingerprint(maker, "receivers", name))


def component_of_origin(origin: str, sha256: str) -> PythonSource:
    """A component of which only origin and hash are known."""
    gone = Gone(f"the class must be available, got none; it is {origin}")
    return PythonSource(gone, origin, sha256)


def _unpacked(packed: bytes, origin: str, sha256: str) -> PythonSource:
    return PythonSource(cloudpickle.loads(packed), origin, sha256)


# --- Files ---------------------------------------------------------------------------------------


def read_file(path: Path, must: str, where: str) -> bytes:
    """The content of a Python file.

    Parameters
    ----------
    must, where
        Beginnings of messages: if the file is missing, and if it cannot be run.

    Raises
    ------
    ConfigurationError
        There is no such file, or it cannot be read.
    """
    if not path.is_file() or path.suffix != ".py":
        close = nearest(path.name, [p.name for p in path.parent.glob("*.py") if p.is_file()])
        found = no_file(path)
        got = found if found in KINDS.values() else "no Python file"
        raise ConfigurationError(f"{must} {got} {quoted(str(path))}{close}")
    try:
        return path.read_bytes()
    except OSError as error:
        raise ConfigurationError(f"{where} must be importable, got {raised(error)}") from error


def run_file(path: Path, content: bytes, where: str) -> Loaded:
    """Run a Python file; returns module and identity, see `sblcosim.simulation.code.local_files`.

    Raises
    ------
    ConfigurationError
        It cannot be run.
    """
    try:
        return loaded(path, content, _module)
    except ConfigurationError:
        raise
    except foreseen() as error:
        known = isinstance(error, DeclarationError)
        said = raised(error).removeprefix("DeclarationError: ")
        must = ":" if known else " must be importable, got"
        raise ConfigurationError(f"{where}{must} {said}") from error


def _module(path: Path, source: bytes) -> ModuleType:
    global _begun
    # With a name that no import has, its content is sent to other processes by value.
    name = path.name
    code = compile(source, path, "exec")
    module = ModuleType(name)
    module.__file__ = str(path)
    sys.modules[name] = module  # during the run, because dataclasses look there
    _begun = True
    try:
        exec(code, vars(module))
    finally:
        sys.modules.pop(name, None)
    if _allowed is not None:
        _allowed()
    return module


@lru_cache(64)
def _by_value(packed: bytes, path: Path, files: Files) -> Any:
    global _begun
    _begun = True
    thing = cloudpickle.loads(packed)
    here = ((name, origins.found(name), sha) for name, _, sha in files)
    refuse(path, changed((n, found[0], sha) for n, found, sha in here if found and found[0]))
    if _allowed is not None:
        _allowed()
    return thing


def said(error: BaseException) -> str:
    """Type and text of an exception, whose ``__str__`` may be the user's."""
    try:
        text = shortened(one_line(error), _LONGEST)
    except foreseen():
        text = "its text cannot be shown"
    return f"{type(error).__name__}: {text}"


def raised(error: BaseException, name: str = "") -> str:
    """An exception of the user's code for a message: type, text, class, file and line."""
    frames = [
        (frame.f_code, line)
        for frame, line in traceback.walk_tb(error.__traceback__)
        if frame.f_globals.get("__name__", "").partition(".")[0] != "sblcosim"
    ]
    text = said(error)
    if not frames:
        return text
    file = frames[0][0].co_filename  # the frames below are the libraries that it calls
    line = [line for code, line in frames if code.co_filename == file][-1]
    return f"{text} ({f'{name} in ' if name else ''}{Path(file).name}, line {line})"


# --- Identity and transport ----------------------------------------------------------------------


def fingerprint(thing: Any, where: str, name: str) -> str:
    """SHA-256 of a function or class and of everything it refers to; see `identity`.

    Raises
    ------
    ConfigurationError
        It refers to something that cannot be told from others of its kind.
    """
    return identity(thing, where, name)


def check(thing: Any, origin: str, sha256: str, where: str) -> None:
    """Refuse a class or function given in Python that differs from its identity.

    Parameters
    ----------
    origin, sha256
        Module and name, and identity.
    where
        The key that holds it.

    Raises
    ------
    CodeChangedError
        The object, or something it refers to, has changed.
    """
    if isinstance(thing, Gone) or isinstance(getattr(thing, "file", None), InFile):
        return
    name = origin.rpartition(":")[2]
    if fingerprint(thing, where, name) != sha256:
        raise CodeChangedError(
            f"{where}: {name} must be as it was when it was loaded, but code or values that it "
            "refers to have changed; load it again"
        )


def by_value(thing: Any) -> bytes:
    """A function or class for a process that may have neither the file nor the module."""
    module = sys.modules.get(thing.__module__)
    known = module is not None and module.__name__ != "__main__"
    if known:
        cloudpickle.register_pickle_by_value(module)
    try:
        return packed(thing)
    finally:
        if known:
            cloudpickle.unregister_pickle_by_value(module)
