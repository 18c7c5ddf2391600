"""Python files of the user, as seen from this process, which never runs them: children do."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from sblcosim.fmus import unchanged
from sblcosim.models.declaration import Variable

from ...errors import ConfigurationError, FmuError, quoted, shortened
from ..children.children import Children, waiting
from ..children.messages import Call, Here
from ..children.watched import Watched
from ..code.user_code import FILE, InFile, PythonSource, is_allowed, read_file
from . import loading

_known: dict[str, str] = {}
"""Identities that children reported for files that they ran, by key of the file."""


def component_of_file(text: str) -> PythonSource:
    """The component of ``file.py:Class``, or of ``file.py`` if that defines a single one.

    It is identified by the file and the local files that it imports.

    Raises
    ------
    ConfigurationError
        There is no such file or class, or the file cannot be run.
    """
    match = FILE.fullmatch(text)
    assert match is not None
    path, name = Path(match["file"]), match["name"]
    where = f"receiver: {quoted(text)}"
    content = read_file(path, f"{where} must be FILE.py:CLASS, got", where)
    maker, sha256 = found(loading.component, path.absolute(), content, name, where)
    return _source(maker, f"{maker.path}:{maker.name}", sha256)


@lru_cache(64)
def _source(maker: InFile, origin: str, sha256: str) -> PythonSource:
    """One object for all points of a study, so that it is packed once."""
    return PythonSource(maker, origin, sha256)


def function_of_file(text: str, folder: Path, key: str, afterwards: str = "") -> tuple[InFile, str]:
    """The function of ``file.py:function``, and its identity.

    Parameters
    ----------
    folder
        Folder that the file may be relative to.
    key
        The key with this text, for messages.
    afterwards
        Module that its calls will need.

    Raises
    ------
    ConfigurationError
        There is no such function or file, or the file cannot be run.
    """
    file, _, name = text.rpartition(":")
    where = f"{key}: {quoted(text)}"
    path = folder / file
    content = read_file(path, f"{where} must be FILE.py:FUNCTION, got", where)
    return found(loading.function, path.absolute(), content, name, where, afterwards)


def found(
    look: Callable[..., tuple[Any, str]],
    path: Path,
    content: bytes,
    name: Any,
    where: str,
    afterwards: str = "",
) -> tuple[Any, str]:
    """What a child finds in a file, and the identity of that.

    Parameters
    ----------
    look
        Called there with the file, its content and key, `name` and `where`.
    """
    key = hashlib.sha256(f"{path} ".encode(errors="surrogatepass") + content).hexdigest()

    def ask() -> tuple[Any, str]:
        named = {where.partition(":")[0]: f"the Python file {shortened(path.name)}"}
        question = partial(look, path, content, key, name, where)
        answer: tuple[Any, str] = call(question, key, named, afterwards=afterwards)
        return answer

    def asked() -> tuple[Any, str]:
        answer = ask()
        if _known.setdefault(key, answer[1]) != answer[1]:  # an imported file has changed
            waiting.close(key)
            answer = ask()
            _known[key] = answer[1]
        return answer

    return unchanged.once((look, path, content, name, where), asked)


def variables_of(where: str, maker: Any) -> tuple[Variable, ...]:
    """The variables of a Python component; if it is from a file, a child asks it.

    Parameters
    ----------
    where
        Start of error messages.

    Raises
    ------
    ConfigurationError
        The component cannot be made, or the object is not a component.
    """
    file = maker.file if isinstance(maker, PythonSource) else None
    if file is None or is_allowed():
        return loading.declared(where, maker)
    known = (maker.origin, maker.sha256, getattr(maker.maker, "beacons", None))
    return unchanged.once(("variables", *known), lambda: _declared(where, maker, file))


def _declared(where: str, maker: PythonSource, file: InFile) -> tuple[Variable, ...]:
    variables: tuple[Variable, ...] = call(
        partial(loading.declared, where, maker), file.key,
        {where: f"the Python component {maker.__qualname__}"},
    )  # fmt: skip
    return variables


def for_others(thing: InFile) -> InFile:
    """A class or function by value, for other processes and machines, which may not have its file.

    Raises
    ------
    ConfigurationError
        Something that it refers to cannot be sent to another process.
    """
    if thing.content is None:
        return thing
    named = {"workers": f"the Python file {shortened(thing.path.name)}"}
    sent: InFile = call(partial(loading.packed, thing), thing.key, named)
    return sent


def call(
    function: Callable[[], Any],
    key: str,
    named: dict[str, str],
    *,
    cases: Sequence[str] = (),
    children: Children | None = None,
    afterwards: str = "",
) -> Any:
    """Call one of our functions in a child, because it calls the user's code; returns its result.

    Parameters
    ----------
    key
        Key of the file.
    named
        For messages: names that the function announces to `sblcosim.fmus.host.watch`, and their
        meaning.
    cases
        Subject of each call, if there are many: ``Progress.row`` is an index into them.
    afterwards
        Module that later calls will need, imported after the answer is sent.

    Raises
    ------
    ConfigurationError
        The user's code has raised an exception, has ended its process, or has not returned.
    """
    task = Call(Here.now(), tuple(named), (), function, afterwards)
    with (children or Children()).lend(key) as child:
        try:
            return child.call(task, Watched(named, tuple(named), cases=cases))
        except FmuError as error:
            raise ConfigurationError(str(error)) from None
