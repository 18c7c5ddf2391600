"""Which file a message is about: checks after loading know a scenario's name only."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import ParamSpec, TypeVar

from ..errors import SblcosimError

_P = ParamSpec("_P")
_R = TypeVar("_R")

_PARTS = re.compile(r"(\[\w+\]|(target|platform|acoustics|range_model)\b)")
"""What the lines begin with that are about tables or components of a scenario."""

_files: ContextVar[dict[str, str] | None] = ContextVar("_files", default=None)


def note(name: str, file: str) -> None:
    """Remember from which file a scenario, study or question of a name was read."""
    files = _files.get()
    if files is not None:
        files[name] = file


@contextmanager
def naming() -> Iterator[None]:
    """Errors of this block name the file that was read in it and that they are about.

    A line that begins with a name, as a scenario's, begins with its file instead; with a table or a
    component, with the file in front if only one was read. Others are about arguments.
    """
    if _files.get() is not None:
        yield
        return
    files: dict[str, str] = {}
    token = _files.set(files)
    try:
        yield
    except SblcosimError as error:
        error.args = ("\n".join(_named(line, files) for line in str(error).splitlines()),)
        raise
    finally:
        _files.reset(token)


def _named(line: str, files: dict[str, str]) -> str:
    if any(file in line for file in files.values()):
        return line
    for name, file in files.items():
        bare = line
        while bare.startswith(f"{name}: "):  # of a scenario in tables, and of their own
            bare = bare[len(name) + 2 :]
        if bare != line:
            return f"{file}: {bare}"
    if len(files) == 1 and _PARTS.match(line):
        return f"{next(iter(files.values()))}: {line}"
    return line


def naming_files(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """A function of the API whose errors are those of `naming`."""

    @functools.wraps(function)
    def named(*arguments: _P.args, **options: _P.kwargs) -> _R:
        with naming():
            return function(*arguments, **options)

    return named


@contextmanager
def about(file: str) -> Iterator[None]:
    """All errors of this block are about a file."""
    try:
        yield
    except SblcosimError as error:
        lines = str(error).splitlines()
        error.args = ("\n".join(x if file in x else f"{file}: {x}" for x in lines),)
        raise
