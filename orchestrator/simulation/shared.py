"""What all code of a process shares, and whether the user's code has left it changed."""

from __future__ import annotations

import gc
import signal
import sys
import threading
from collections.abc import Callable, Mapping
from operator import is_
from types import ModuleType
from typing import Any

import numpy as np

_SIGNALS = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGALRM") if hasattr(signal, name)
]
_HABITS: tuple[Callable[[], Any], ...] = (
    np.geterr, np.get_printoptions, sys.getrecursionlimit, sys.gettrace, sys.getprofile,
    gc.isenabled, threading.active_count,
)  # fmt: skip
# Kept here, as the user's code may replace any of these names.


class Shared:
    """Modules' functions, standard streams, signals and habits, as they were at the latest look.

    A run after which they have changed must be the last of its process, as the next one would
    depend on it. What is new, such as a module, changes nothing for others.

    Parameters
    ----------
    settle
        Undoes changes to the state of the processor and the locale; whether there were any.
    """

    def __init__(self, settle: Callable[[], bool]) -> None:
        self._settle = settle
        self._functions: dict[str, tuple[ModuleType, Mapping[str, Any]]] = {}
        self._habits: tuple[Any, ...] | None = None

    def look(self) -> None:
        """Take everything for what it is to be."""
        self._settle()
        self._functions = {
            name: (module, dict(vars(module)))
            for name, module in [*sys.modules.items()]
            if isinstance(module, ModuleType)
        }
        self._habits = _habits()

    def changed(self) -> bool:
        """Whether anything has changed since the latest look, or there was none."""
        try:
            return self._settle() or _habits() != self._habits or any(
                _replaced(before, vars(module)) for module, before in self._functions.values()
            )
        except BaseException:  # of whatever is in place of ours
            return True


def _replaced(before: Mapping[str, Any], now: Mapping[str, Any]) -> bool:
    """Whether a name of a module is something else than the function or class that it was."""
    if all(map(is_, before.values(), now.values())):  # what is new comes last
        return False
    return any(now.get(name) is not value and callable(value) for name, value in before.items())


def _habits() -> tuple[Any, ...]:
    streams = (sys.stdout, sys.stderr, sys.stdin)
    return (
        *map(id, streams),
        *(stream is None or stream.closed for stream in streams),
        *(habit() for habit in _HABITS),
        *map(signal.getsignal, _SIGNALS),
        _alarm(),
    )


def _alarm() -> Any:
    return signal.getitimer(signal.ITIMER_REAL)[0] > 0 if hasattr(signal, "getitimer") else None
