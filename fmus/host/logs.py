"""What FMUs log: from FMPy's callbacks to the instance concerned."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache, partial
from itertools import count
from typing import Any

from fmpy import fmi1, fmi2

Note = Callable[[int, bytes], None]
"""Takes a status and a message."""

_KEYS = count(1)
_NOTES: dict[int, Note] = {}


def callbacks(note: Note) -> Any:
    """The callbacks of FMI 2 for an instance whose messages somebody takes."""
    key = next(_KEYS)
    _NOTES[key] = note
    result = fmi2.fmi2CallbackFunctions()
    result.logger = _logger()
    result.allocateMemory = fmi2.defaultCallbacks.allocateMemory
    result.freeMemory = fmi2.defaultCallbacks.freeMemory
    result.componentEnvironment = key
    return result


def logger3(note: Note) -> Callable[[int, int, bytes, bytes], None]:
    """The logger of FMI 3 for an instance whose messages somebody takes."""
    return partial(_log3, note)


def _log3(note: Note, environment: int, status: int, category: bytes, message: bytes) -> None:
    note(status, message)


@fmi2.fmi2CallbackLoggerTYPE  # type: ignore[untyped-decorator]
def _log2(environment: int, name: bytes, status: int, category: bytes, message: bytes) -> None:
    note = _NOTES.get(environment)
    if note is None:  # somebody else's instance
        fmi1.printLogMessage(environment, name, status, category, message)
    else:
        note(status, (message or b"").replace(b"##", b"#"))


@cache
def _logger() -> Any:
    """The logger of FMI 2, with FMPy's C function before it that formats the message.

    That C function keeps one logger for the whole process, so ours takes all messages.
    """
    callbacks = fmi2.fmi2CallbackFunctions()
    callbacks.logger = _log2
    try:
        from fmpy.logging import addLoggerProxy
    except OSError:  # no such library for this machine: messages come with their % signs
        return callbacks.logger
    addLoggerProxy(ctypes.byref(callbacks))
    return callbacks.logger
