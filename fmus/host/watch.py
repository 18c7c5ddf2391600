"""Observer of a run: nobody or, in a process of its own, the parent process that waits.

Masters and instances announce each call of a component to `watch`, and take the memory of the
record from it. In this process it does nothing. `sblcosim.simulation.child` installs its own.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import SblcosimError

_P = ParamSpec("_P")
_R = TypeVar("_R")


class Progress(ctypes.Structure):
    """``struct progress`` of c/native.c: current instant and call, and the request to end."""

    _fields_ = (("row", ctypes.c_int64), ("at", ctypes.c_int64), ("cancel", ctypes.c_int64))


class Watch:
    """No observer."""

    direct = False
    """Whether a loop runs in the calling thread, because somebody else can end it."""

    def calling(self, component: str, function: str) -> AbstractContextManager[None]:
        """Context of a call outside the loop."""
        return nullcontext()

    def said(self, component: str, text: str) -> None:
        """Receives what an FMU has logged."""

    def watches(self, component: str) -> bool:
        """Whether the behaviour of a component is watched."""
        return False

    def habit(self, component: str, function: str, habits: int) -> None:
        """A call has changed something that all share."""

    def progress(self) -> Progress:
        """Where a loop notes its progress."""
        return Progress()

    def bound(
        self, component: str, function: str, call: Callable[_P, _R]
    ) -> Callable[_P, _R]:
        """Context of a call of the loop, announced each time."""
        return call

    def array(self, shape: Sequence[int], dtype: Any) -> NDArray[Any]:
        """Memory for the record, uninitialised."""
        return np.empty(shape, dtype)

    def begin(self, record: Any, labels: Sequence[tuple[str, str]]) -> None:
        """The loop starts; ``Progress.at`` counts in the labels, component and function."""

    def late(self, component: str, error: SblcosimError) -> None:
        """A component has failed after the last instant."""
        raise error


_watch = Watch()


def watch() -> Watch:
    """The current observer."""
    return _watch


def install(other: Watch) -> None:
    """Use another observer from now on."""
    global _watch
    _watch = other
