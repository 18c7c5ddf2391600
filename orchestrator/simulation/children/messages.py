"""Messages between a process and its child processes: tasks and their answers."""

from __future__ import annotations

import builtins
import io
import os
import pickle
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from typing import Any

from ...data.record import Record
from ...errors import ConfigurationError
from ..plans.plan import Plan
from ..system import ComponentSpec


@dataclass(frozen=True)
class Start:
    """The first message to the child.

    Attributes
    ----------
    folder
        Folder for temporary files.
    memory
        Handle of the shared memory.
    """

    folder: str
    memory: int | str


@dataclass(frozen=True)
class Here:
    """The surroundings of a process, which its child adopts before each task.

    Attributes
    ----------
    folder
        Working directory; None if it was deleted.
    environment, path
        ``os.environ`` and ``sys.path``.
    """

    folder: str | None
    environment: tuple[tuple[str, str], ...]
    path: tuple[str, ...]

    @classmethod
    def now(cls) -> Here:
        """The surroundings of this process."""
        try:
            folder = os.getcwd()
        except OSError:
            folder = None
        return cls(folder, tuple(os.environ.items()), tuple(map(str, sys.path)))

    def added(self) -> Added:
        """What this process has in addition to its parent's surroundings."""
        first = [*takewhile(lambda place: place not in self.path, sys.path)]
        rest = sys.path[len(first) :]
        return Added(
            {key: value for key, value in os.environ.items() if key not in dict(self.environment)},
            first,
            [place for place in rest if place not in self.path],
        )

    def take_over(self, added: Added) -> None:
        """Apply them to this process, keeping what the user's files added when they were loaded."""
        if self.folder is not None:
            os.chdir(self.folder)
        environment = added.environment | dict(self.environment)
        if dict(os.environ) != environment:
            os.environ.clear()
            os.environ.update(environment)
        sys.path[:] = [*added.first, *self.path, *added.last]


@dataclass(frozen=True)
class Added:
    """Additional environment variables, and module paths before and after those of the parent."""

    environment: dict[str, str] = field(default_factory=dict)
    first: Sequence[str] = ()
    last: Sequence[str] = ()


@dataclass(frozen=True)
class Task:
    """Fields common to all tasks.

    Attributes
    ----------
    here
        Surroundings of the parent.
    components
        Names of the components; the shared memory refers to them by index.
    strangers
        Names of the third-party FMUs, which are watched.
    """

    here: Here
    components: tuple[str, ...]
    strangers: tuple[str, ...]


@dataclass(frozen=True)
class Execute(Task):
    """Run a plan with the given master, or the rest of it on a record of the others."""

    plan: Plan
    record: tuple[str, ...] | None
    master: str
    played: Record | None = None


@dataclass(frozen=True)
class InitialOutputs(Task):
    """Read outputs at the start."""

    spec: ComponentSpec
    names: tuple[str, ...]
    start_ns: int


@dataclass(frozen=True)
class Call(Task):
    """Call one of our functions that uses the user's code; its return value is the answer.

    Attributes
    ----------
    afterwards
        Module to import after sending the answer, because it will be needed.
    """

    function: Callable[[], Any]
    afterwards: str = ""


@dataclass(frozen=True)
class End(Task):
    """Free all instances and unload their libraries."""


@dataclass(frozen=True)
class Begun:
    """Message: the loop starts. Lists its calls and the record's arrays in the shared memory."""

    labels: tuple[tuple[str, str], ...]
    arrays: tuple[SharedArray, ...]


@dataclass(frozen=True)
class SharedArray:
    """An array in the shared memory, and the variables stored in it."""

    start: int
    size: int
    dtype: str
    values: tuple[tuple[str, tuple[int, ...], tuple[int, ...], int], ...]
    """Name, shape, strides and offset of each variable."""


@dataclass(frozen=True)
class TaskEnded:
    """Message: the task has ended.

    Attributes
    ----------
    value
        Outputs; None for a record, which is in the shared memory.
    error
        The exception, if the task failed.
    late
        Failures after the last instant, by component.
    habits
        Changes to the process state: component, function, bits of ``enum habit`` in c/native.c.
    warned
        Warnings of the user's code: text, category, file and line.
    spoilt
        Whether the user's code has changed something that all code of the process shares.
    """

    value: Any = None
    error: Exception | None = None
    late: tuple[tuple[str, str], ...] = ()
    habits: tuple[tuple[str, str, int], ...] = ()
    warned: tuple[tuple[str, type[Warning], str, int], ...] = ()
    spoilt: bool = False


_PLAIN = {"sblcosim", "numpy", "collections", "pathlib", "types", "inspect", "copyreg", "_codecs"}
_BUILTINS = {"set", "frozenset", "complex", "bytearray", "range", "slice"}


class _Reader(pickle.Unpickler):
    """Reads a child's messages without importing anything that only the user's code defines."""

    def find_class(self, module: str, name: str) -> Any:
        found = getattr(builtins, name, None) if module == "builtins" else None
        error = isinstance(found, type) and issubclass(found, Exception)
        builtin = error or (module == "builtins" and name in _BUILTINS)
        if module.partition(".")[0] in _PLAIN or builtin:
            return super().find_class(module, name)
        raise ConfigurationError(f"must be plain values, got an instance of {module}.{name}")


def read(content: bytes) -> Any:
    """A message of a child, pickled.

    Raises
    ------
    ConfigurationError
        It holds more than plain values and our own classes.
    """
    return _Reader(io.BytesIO(content)).load()
