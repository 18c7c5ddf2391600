"""Who is told what a run is doing: nobody, or in a process of its own, the process that waits.

Masters and instances announce each call of a component through `watch`, and take from it the memory
of the record. In this process nothing happens there; `sblcosim.simulation.child` puts its own
instead.
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
    """``struct progress`` of c/native.c: instant and call under way, and the wish to end."""

    _fields_ = (("row", ctypes.c_int64), ("at", ctypes.c_int64), ("cancel", ctypes.c_int64))


class Watch:
    """Nobody."""

    direct = False
    """Whether a loop is to run in the thread that has called it: somebody else can end it."""

    def calling(self, component: str, function: str) -> AbstractContextManager[None]:
        """Around a call outside of the loop."""
        return nullcontext()

    def said(self, component: str, text: str) -> None:
        """What an FMU has logged."""

    def watches(self, component: str) -> bool:
        """Whether the habits of a component are watched."""
        return False

    def habit(self, component: str, function: str, habits: int) -> None:
        """A call has left something changed that all share."""

    def progress(self) -> Progress:
        """Where a loop notes what it does."""
        return Progress()

    def bound(
        self, component: str, function: str, call: Callable[_P, _R]
    ) -> Callable[_P, _R]:
        """A call of the loop, announced each time."""
        return call

    def array(self, shape: Sequence[int], dtype: Any) -> NDArray[Any]:
        """Memory for the record, not set to anything."""
        return np.empty(shape, dtype)

    def begin(self, record: Any, labels: Sequence[tuple[str, str]]) -> None:
        """The loop starts; ``Progress.at`` counts in the labels, component and function."""

    def late(self, component: str, error: SblcosimError) -> None:
        """A component has failed after the last instant."""
        raise error


_watch = Watch()


def watch() -> Watch:
    """The one who is told."""
    return _watch


def install(other: Watch) -> None:
    """Tell somebody else from now on."""
    global _watch
    _watch = other
