"""Logs of FMUs: from the callbacks of their instances to the receiver of messages."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache, partial
from itertools import count
from typing import Any

from fmpy import fmi2

from .log_lines import logger2

Note = Callable[[int, bytes], None]
"""Receives a status and a message, in FMI 2 with the values of its format."""

_KEYS = count(1)
_NOTES: dict[int | bytes, Note] = {}
"""By the key of an instance and by its name, because some FMUs do not pass on the key."""


def callbacks(note: Note, name: str) -> Any:
    """The FMI 2 callbacks of an instance whose messages are collected."""
    key = next(_KEYS)
    _NOTES[key] = _NOTES[name.encode()] = note
    result = fmi2.fmi2CallbackFunctions()
    result.logger = ctypes.cast(_logger(), fmi2.fmi2CallbackLoggerTYPE)
    result.allocateMemory = fmi2.defaultCallbacks.allocateMemory
    result.freeMemory = fmi2.defaultCallbacks.freeMemory
    result.componentEnvironment = key
    return result


def logger3(note: Note) -> Callable[[int, int, bytes, bytes], None]:
    """The FMI 3 logger of an instance whose messages are collected."""
    return partial(_log3, note)


def _log3(note: Note, environment: int, status: int, category: bytes, message: bytes) -> None:
    note(status, message or b"")


@cache
def _logger() -> Any:
    """The logger of FMI 2, one for all instances."""
    return logger2(_log2)


def _log2(environment: int | None, name: bytes, status: int, message: bytes) -> None:
    note = _NOTES.get(environment or 0) or _NOTES.get(name)
    if note is not None:
        note(status, message)
