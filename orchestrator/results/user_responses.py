"""Responses that are a user's own functions, known by their code."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..errors import ConfigurationError, quoted
from ..simulation.user_code import fingerprint, function_of_file
from .responses import RESPONSES, Response, Run, readable


def of_function(function: Callable[[Run], Any]) -> Response:
    """The response that a function is.

    It is known by its code and all that it refers to, as `sblcosim.simulation.identity` says.

    Raises
    ------
    ConfigurationError
        It is not a function, has no name or that of a shipped response, or refers to what a run
        cannot be known by.
    """
    name = _checked_name(getattr(function, "__name__", ""), function)
    sha256 = fingerprint(function, "responses", name)
    origin = f"{function.__module__}:{name}"
    return Response(name, readable(name), function, False, origin=origin, sha256=sha256)


def of_file(text: str, folder: Path) -> Response:
    """Make a response of ``file.py:function``; the file may be relative to a folder.

    It is known by the file and all that this imports.

    Raises
    ------
    ConfigurationError
        There is no such file or function, or the file cannot be run.
    """
    function, sha256 = function_of_file(text, folder, "responses")
    name = text.rpartition(":")[2]
    _checked_name(function.__name__, function)
    return Response(name, readable(name), function, False, origin=text, sha256=sha256)


def _checked_name(name: str, function: object) -> str:
    if not callable(function) or not name.isidentifier():
        raise ConfigurationError(
            f"responses: must be names or functions with a name, got {quoted(name)}"
        )
    if name in RESPONSES:
        raise ConfigurationError(f"responses: {name} must not be the name of one that is shipped")
    return name


def of_origin(name: str, origin: str, sha256: str) -> Response:
    """A user's response of which only the name, origin and hash are known."""

    def gone(run: Run) -> float:
        raise ConfigurationError(
            f"responses: {name} must be at hand to do more runs, got none; it is {origin}"
        )

    return Response(name, readable(name), gone, False, origin=origin, sha256=sha256)
