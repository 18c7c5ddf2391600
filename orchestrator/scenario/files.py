"""The file that a message is about: checks after loading know only a scenario's name."""

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
"""Beginnings of lines about tables or components of a scenario."""

_files: ContextVar[dict[str, str] | None] = ContextVar("_files", default=None)


def note(name: str, file: str) -> None:
    """Remember the file of a scenario, study or question with this name."""
    files = _files.get()
    if files is not None:
        files[name] = file


@contextmanager
def naming() -> Iterator[None]:
    """Errors in this block name the file read in it that they are about.

    A line that begins with the name of a scenario gets its file instead. A line that begins with a
    table or component gets the file in front, provided only one was read. Other lines are about
    arguments.
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
        while bare.startswith(f"{name}: "):  # from a scenario in tables, and from their own
            bare = bare[len(name) + 2 :]
        if bare != line:
            return f"{file}: {bare}"
    if len(files) == 1 and _PARTS.match(line):
        return f"{next(iter(files.values()))}: {line}"
    return line


def naming_files(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """A function of the API whose errors are treated as in `naming`."""

    @functools.wraps(function)
    def named(*arguments: _P.args, **options: _P.kwargs) -> _R:
        with naming():
            return function(*arguments, **options)

    return named


@contextmanager
def about(file: str) -> Iterator[None]:
    """All errors in this block are about a file."""
    try:
        yield
    except SblcosimError as error:
        lines = str(error).splitlines()
        error.args = ("\n".join(x if file in x else f"{file}: {x}" for x in lines),)
        raise
