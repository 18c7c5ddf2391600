"""State that all code of a process shares, and whether the user's code has changed it."""

from __future__ import annotations

import gc
import signal
import sys
import threading
import warnings
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
# Kept here, because the user's code may replace any of these names.


class Shared:
    """Modules, our classes, streams, signals and process state at the latest look.

    If a run changes them, it must be the last of its process, because the next one would depend on
    it. Additions, such as a module, change nothing for others.

    Parameters
    ----------
    settle
        Undoes changes to the state of the processor and the locale; returns whether there were any.
    """

    def __init__(self, settle: Callable[[], bool]) -> None:
        self._settle = settle
        self._names: list[tuple[Any, Mapping[str, Any]]] = []
        self._habits: tuple[Any, ...] | None = None

    @property
    def looked(self) -> bool:
        """Whether there was a look, that is, some code of the user has been loaded."""
        return self._habits is not None

    def look(self) -> None:
        """Take the current state as the reference."""
        self._settle()
        modules = [it for it in [*sys.modules.values()] if isinstance(it, ModuleType)]
        ours = {
            id(it): it
            for module in modules if module.__name__.startswith("sblcosim")
            for it in [*vars(module).values()]
            if isinstance(it, type) and it.__module__.startswith("sblcosim")
        }
        self._names = [(it, dict(vars(it))) for it in (*modules, *ours.values())]
        self._habits = _habits()

    def changed(self) -> bool:
        """Whether anything has changed since the latest look, or there was none."""
        try:
            return self._settle() or _habits() != self._habits or any(
                _replaced(before, vars(it)) for it, before in self._names
            )
        except BaseException:  # from whatever has replaced ours
            return True


def _replaced(before: Mapping[str, Any], now: Mapping[str, Any]) -> bool:
    """Whether a name no longer refers to the function, class or constant that it did."""
    if all(map(is_, before.values(), now.values())):  # additions come last
        return False
    return any(
        now.get(name) is not value and (callable(value) or isinstance(value, float | property))
        for name, value in before.items()
    )


def _habits() -> tuple[Any, ...]:
    streams = (sys.stdout, sys.stderr, sys.stdin)
    return (
        *map(id, streams),
        *(stream is None or stream.closed for stream in streams),
        *(habit() for habit in _HABITS),
        *map(signal.getsignal, _SIGNALS),
        *warnings.filters,
        _alarm(),
    )


def _alarm() -> Any:
    return signal.getitimer(signal.ITIMER_REAL)[0] > 0 if hasattr(signal, "getitimer") else None
