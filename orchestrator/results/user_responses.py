"""Responses that are a user's own functions, known by their source."""

from __future__ import annotations

import hashlib
import inspect
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import cloudpickle

from ..errors import ConfigurationError, nearest, one_line, quoted
from .responses import RESPONSES, Response, Run, readable


def of_function(function: Callable[[Run], Any]) -> Response:
    """The response that a function is.

    It is known by its source and by all that it refers to: other functions, values, and modules by
    their names.

    Raises
    ------
    ConfigurationError
        It is not a function, has no name or that of a shipped response, or its source is
        unavailable.
    """
    name = _checked_name(getattr(function, "__name__", ""), function)
    digest = hashlib.sha256()
    try:
        for part in _parts(function, set()):
            digest.update(part + b"\0")
    except (OSError, TypeError):
        raise ConfigurationError(
            f"responses: {name} must be a function from a file or a notebook, so that a run is "
            "known by its source, got none"
        ) from None
    origin = f"{function.__module__}:{name}"
    return Response(
        name, readable(name), function, False, origin=origin, sha256=digest.hexdigest()
    )


def of_file(text: str, folder: Path) -> Response:
    """Make a response of ``file.py:function``; the file may be relative to a folder.

    It is known by the file, not by what that imports.

    Raises
    ------
    ConfigurationError
        There is no such file or function, or the file cannot be run.
    """
    file, _, name = text.rpartition(":")
    path = folder / file
    where = f"responses: {quoted(text)}"
    if not path.is_file() or path.suffix != ".py":
        close = nearest(path.name, [p.name for p in path.parent.glob("*.py")])
        raise ConfigurationError(
            f"{where} must be FILE.py:FUNCTION, got no Python file {quoted(file)}{close}"
        )
    source = path.read_bytes()
    # Not among sys.modules: what is in it is then sent to other processes by value.
    module = ModuleType(path.stem)
    module.__file__ = str(path)
    try:
        exec(compile(source, path, "exec"), vars(module))
    except (Exception, SystemExit) as error:
        raise ConfigurationError(
            f"{where} must be importable, got {type(error).__name__}: {one_line(error)}"
        ) from error
    functions = {n: thing for n, thing in vars(module).items() if inspect.isfunction(thing)}
    if name not in functions:
        raise ConfigurationError(
            f"{where} must name a function of {quoted(file)}, got {quoted(name)}"
            f"{nearest(name, functions)}"
        )
    function = functions[name]
    _checked_name(function.__name__, function)
    sha256 = hashlib.sha256(source).hexdigest()
    return Response(name, readable(name), function, False, origin=text, sha256=sha256)


def _checked_name(name: str, function: object) -> str:
    if not callable(function) or not name.isidentifier():
        raise ConfigurationError(
            f"responses: must be names or functions with a name, got {quoted(name)}"
        )
    if name in RESPONSES:
        raise ConfigurationError(f"responses: {name} must not be the name of one that is shipped")
    return name


def _parts(thing: Any, seen: set[int]) -> Iterator[bytes]:
    """All that says what a function does: sources, values and names of modules."""
    if id(thing) in seen:
        return
    if inspect.ismodule(thing):
        yield thing.__name__.encode()
    elif inspect.isfunction(thing) and thing.__module__.partition(".")[0] not in _KNOWN_BY_NAME:
        seen.add(id(thing))
        yield textwrap.dedent(inspect.getsource(thing)).encode()
        used = inspect.getclosurevars(thing)
        for name, value in sorted({**used.globals, **used.nonlocals}.items()):
            yield name.encode()
            yield from _parts(value, seen)
        for value in (*(thing.__defaults__ or ()), *(thing.__kwdefaults__ or {}).values()):
            yield from _parts(value, seen)
    elif hasattr(thing, "__qualname__") and hasattr(thing, "__module__"):
        yield f"{thing.__module__}.{thing.__qualname__}".encode()
    else:
        yield cloudpickle.dumps(thing)


_KNOWN_BY_NAME = ("numpy", "scipy", "pandas", "sblcosim")
"""Packages whose functions are what they are called."""


def of_origin(name: str, origin: str, sha256: str) -> Response:
    """A user's response of which only the name, origin and hash are known."""

    def gone(run: Run) -> float:
        raise ConfigurationError(
            f"responses: {name} must be at hand to do more runs, got none; it is {origin}"
        )

    return Response(name, readable(name), gone, False, origin=origin, sha256=sha256)
