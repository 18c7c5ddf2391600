"""Python code of the user: run from a file, known by a hash, sent to other processes by value."""

from __future__ import annotations

import inspect
import re
import sys
import traceback
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

import cloudpickle

from ..errors import ConfigurationError, instance, nearest, one_line, quoted, shortened
from .identity import identity
from .local_files import loaded

_FILE = re.compile(r"(?P<file>.*\.py)(?::(?P<name>.*))?", re.DOTALL)
_LONGEST = 240  # characters of an exception's text
_METHODS = ("variables", "initialise", "do_step")


class PythonSource:
    """A class or function of the user that makes a component.

    Attributes
    ----------
    origin
        ``/path/file.py:Class``, or the module and name of what did not come from a file.
    sha256
        Identity of the file or of the class or function, with all that it refers to.
    """

    # Not a dataclass: pydantic would convert it when a study holds it.
    def __init__(self, maker: Callable[[], Any], origin: str, sha256: str) -> None:
        self.maker, self.origin, self.sha256 = maker, origin, sha256
        self.__name__ = origin.rpartition(":")[2]
        self.__qualname__ = Path(origin).name  # for display: without folders

    def __call__(self) -> Any:
        return self.maker()

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
        # By value: a worker may have neither the file nor the module.
        return _unpacked, (by_value(self.maker), self.origin, self.sha256)

    def __repr__(self) -> str:
        return f"<Python component {self.origin}>"


def is_python(text: str) -> bool:
    """Whether a text is ``file.py`` or ``file.py:name``."""
    return _FILE.fullmatch(text) is not None


def component_of_file(text: str) -> PythonSource:
    """The component of ``file.py:Class``, or of ``file.py`` if that defines a single one.

    It is known by the file and the local files that it imports.

    Raises
    ------
    ConfigurationError
        There is no such file or class, or the file cannot be run.
    """
    match = _FILE.fullmatch(text)
    assert match is not None
    path, name = Path(match["file"]), match["name"]
    where = f"receiver: {quoted(text)}"
    module, sha256 = run_file(path, f"{where} must be FILE.py:CLASS, got", where)
    known = {n: t for n, t in vars(module).items() if _is_component(t, module)}
    if name is None:
        if len(known) != 1:
            got = ", ".join(f"{path.name}:{n}" for n in known) or "none"
            raise ConfigurationError(
                f"{where} must be FILE.py:CLASS if the file does not have a single class with "
                f"{', '.join(_METHODS)}, got {got}"
            )
        (name,) = known
    maker = vars(module).get(name)
    if not callable(maker):
        got = quoted(name) if maker is None else f"{quoted(name)}, {instance(maker)}"
        others = nearest(name, known) or (f"; it has {', '.join(known)}" if known else "")
        raise ConfigurationError(
            f"{where} must name a class of {quoted(path.name)}, got {got}{others}"
        )
    return _source(maker, f"{path.absolute()}:{name}", sha256)


@lru_cache(64)
def _source(maker: Callable[[], Any], origin: str, sha256: str) -> PythonSource:
    """One object for all points of a study, so that it is packed once."""
    return PythonSource(maker, origin, sha256)


def component_of(maker: Any) -> PythonSource:
    """The component that a class or function makes; known as `fingerprint` says.

    Raises
    ------
    ConfigurationError
        It is not a class or function with a name, or refers to what a run cannot be known by.
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
    """A component of which only the origin and hash are known."""

    def gone() -> None:
        raise ConfigurationError(f"the class must be at hand, got none; it is {origin}")

    return PythonSource(gone, origin, sha256)


def _is_component(thing: Any, module: ModuleType) -> bool:
    own = inspect.isclass(thing) and thing.__module__ == module.__name__
    return own and all(hasattr(thing, method) for method in _METHODS)


def _unpacked(packed: bytes, origin: str, sha256: str) -> PythonSource:
    return PythonSource(cloudpickle.loads(packed), origin, sha256)


# --- Files ---------------------------------------------------------------------------------------


def run_file(path: Path, must: str, where: str) -> tuple[ModuleType, str]:
    """Run a Python file; its module, and its identity, as `sblcosim.simulation.local_files` says.

    Parameters
    ----------
    must, where
        Starts of messages: for a file that is not there, and for one that cannot be run.

    Raises
    ------
    ConfigurationError
        There is no such file, or it cannot be run.
    """
    if not path.is_file() or path.suffix != ".py":
        close = nearest(path.name, [p.name for p in path.parent.glob("*.py")])
        raise ConfigurationError(f"{must} no Python file {quoted(str(path))}{close}")
    try:
        return loaded(path.absolute(), path.read_bytes(), _module)
    except ConfigurationError:
        raise
    except (Exception, SystemExit) as error:
        raise ConfigurationError(
            f"{where} must be importable, got {raised(error)}"
        ) from error


def function_of_file(text: str, folder: Path, key: str) -> tuple[Callable[..., Any], str]:
    """The function of ``file.py:function``, and the SHA-256 of the file.

    Parameters
    ----------
    folder
        The file may be relative to it.
    key
        The key that has this text, for messages.

    Raises
    ------
    ConfigurationError
        There is no such file or function, or the file cannot be run.
    """
    file, _, name = text.rpartition(":")
    where = f"{key}: {quoted(text)}"
    module, sha256 = run_file(folder / file, f"{where} must be FILE.py:FUNCTION, got", where)
    functions = {n: thing for n, thing in vars(module).items() if inspect.isfunction(thing)}
    if name not in functions:
        raise ConfigurationError(
            f"{where} must name a function of {quoted(file)}, got {quoted(name)}"
            f"{nearest(name, functions)}"
        )
    return functions[name], sha256


def _module(path: Path, source: bytes) -> ModuleType:
    # A name that no import has: what is in it is then sent to other processes by value.
    module = ModuleType(path.name)
    module.__file__ = str(path)
    sys.modules[path.name] = module  # while it runs: dataclasses look there
    try:
        exec(compile(source, path, "exec"), vars(module))
    finally:
        del sys.modules[path.name]
    return module


def raised(error: BaseException, name: str = "") -> str:
    """An exception of the user's code for a message: type, text, class, file and line."""
    frames = [
        (frame.f_code, line)
        for frame, line in traceback.walk_tb(error.__traceback__)
        if frame.f_globals.get("__name__", "").partition(".")[0] != "sblcosim"
    ]
    text = f"{type(error).__name__}: {shortened(one_line(error), _LONGEST)}"
    if not frames:
        return text
    file = frames[0][0].co_filename  # below it are the libraries that it calls
    line = [line for code, line in frames if code.co_filename == file][-1]
    return f"{text} ({f'{name} in ' if name else ''}{Path(file).name}, line {line})"


# --- Identity and transport ----------------------------------------------------------------------


def fingerprint(thing: Any, where: str, name: str) -> str:
    """SHA-256 of a function or class and of all that it refers to, as `identity` says.

    Raises
    ------
    ConfigurationError
        It refers to something that cannot be told from another of its kind.
    """
    return identity(thing, where, name)


def by_value(thing: Any) -> bytes:
    """A function or class for a process that may have neither the file nor the module."""
    module = sys.modules.get(thing.__module__)
    known = module is not None and module.__name__ != "__main__"
    if known:
        cloudpickle.register_pickle_by_value(module)
    try:
        packed: bytes = cloudpickle.dumps(thing)
    finally:
        if known:
            cloudpickle.unregister_pickle_by_value(module)
    return packed
