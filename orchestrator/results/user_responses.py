"""Responses that are a user's own functions, known by their code."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from sblcosim.fmus.host.watch import watch

from ..errors import ConfigurationError, escaped, quoted
from ..simulation.children.children import Children
from ..simulation.code.user_code import Gone, InFile, fingerprint
from ..simulation.user.files import call, function_of_file
from .responses import RESPONSES, Response, Run, readable, value_of


def of_function(function: Callable[[Run], Any]) -> Response:
    """The response that a function is.

    It is known by its code and all that it refers to, as `sblcosim.simulation.code.identity` says.

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
    function, sha256 = function_of_file(text, folder, "responses", __name__)
    name = _checked_name(function.name, function)
    return Response(name, readable(name), function, False, origin=text, sha256=sha256)


def _checked_name(name: str, function: object) -> str:
    if not callable(function) or not name.isidentifier():
        raise ConfigurationError(
            f"responses: must be names or functions with a name, got {quoted(name)}"
        )
    if name in RESPONSES:
        raise ConfigurationError(f"responses: {name} must not be the name of one that is shipped")
    return name


def values_of(
    asked: Sequence[Response], runs: Sequence[Run], children: Children | None = None
) -> list[list[float]]:
    """Evaluate responses of runs; those that are functions of a file in a child process.

    Parameters
    ----------
    runs
        One for each receiver, of the same record.
    children
        Those that are asked for; None: any.

    Returns
    -------
    values
        By run and response.

    Raises
    ------
    ConfigurationError
        A function has raised an exception, has not returned a number or not returned at all, or has
        ended its process.
    """
    values = [[float("nan")] * len(asked) for _ in runs]
    apart: dict[str, list[int]] = {}
    for k, response in enumerate(asked):
        if isinstance(response.definition, InFile):
            apart.setdefault(response.definition.key, []).append(k)
        else:
            for i, run in enumerate(runs):
                values[i][k] = value_of(response, run)
    for key, places in apart.items():
        some = [asked[k] for k in places]
        named = {
            f"{run.receiver}.{r.name}": f"the response {escaped(Path(r.origin).name)}"
            for run in runs for r in some
        }  # fmt: skip
        found = call(partial(_values, some, runs), key, named, children=children)
        for i, own in enumerate(found):
            for k, value in zip(places, own, strict=True):
                values[i][k] = value
    return values


def _values(asked: Sequence[Response], runs: Sequence[Run]) -> list[list[float]]:
    """The same where the file may be run."""
    values: list[list[float]] = []
    for run in runs:
        values.append([])
        for response in asked:
            with watch().calling(f"{run.receiver}.{response.name}", "its call"):
                values[-1].append(value_of(response, run))
    return values


def of_origin(name: str, origin: str, sha256: str) -> Response:
    """A user's response of which only the name, origin and hash are known."""
    gone = Gone(f"responses: {name} must be at hand to do more runs, got none; it is {origin}")
    return Response(name, readable(name), gone, False, origin=origin, sha256=sha256)
