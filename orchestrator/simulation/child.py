"""The process in which third-party FMUs and the user's Python files run; its parent gives it tasks.

The shared memory holds the current state, which outlives the process. Tasks arrive on standard
input and answers leave on standard output; FMUs and files have access to neither.
"""

from __future__ import annotations

import atexit
import contextlib
import mmap
import os
import pickle
import queue
import shutil
import signal
import sys
import tempfile
import threading
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from importlib import import_module
from typing import IO, Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus.host import instances as lending
from sblcosim.fmus.host.watch import Progress, Watch, install

from ..data.record import Record
from ..errors import BuildError, ConfigurationError, SblcosimError, one_line
from .children.memory import Memory, up
from .children.messages import (
    Added,
    Begun,
    Call,
    End,
    Execute,
    Here,
    InitialOutputs,
    SharedArray,
    Start,
    Task,
    TaskEnded,
    read,
)
from .children.state import CALLING, LOOP, OUTSIDE, SIZE, State, receive, send
from .code import user_code
from .code.user_code import PythonSource, raised
from .masters import native, python
from .shared import Shared

_P = ParamSpec("_P")
_R = TypeVar("_R")

_MOST_WARNINGS = 100
"""Maximum number of warnings reported for a task."""


class _Telling(Watch):
    """Reports the child's progress to the parent."""

    direct = True

    def __init__(self, memory: Memory, answers: IO[bytes]) -> None:
        self._memory = memory
        self._answers = answers
        self._page = memory.part(0, SIZE)
        self._state = State.from_buffer(self._page)
        self._settle: Callable[[], int] | None = None
        try:
            library = native.library()
            library.native_remember()
            self._settle = library.native_settle
        except BuildError as error:
            print(
                "warning: changes that an FMU makes to the processor's floating-point state or the "
                "locale "
                f"are neither seen nor undone, as the native master cannot be built: {error}",
                file=sys.stderr, flush=True,
            )  # fmt: skip
        self.here, self.added = Here.now(), Added()
        self.take(())

    def loaded(self) -> None:
        """The user's code has been loaded: whatever it has added to its surroundings stays."""
        self.added = self.here.added()

    def take(self, components: Sequence[str], strangers: Sequence[str] = ()) -> None:
        """Reset the state for a new task."""
        self.names = tuple(components)
        self._numbers = {name: i for i, name in enumerate(components)}
        self._strangers = frozenset(strangers)
        self._labels: list[tuple[str, str]] = []
        # The previous task's arrays live until here: Windows frees memory with its last user.
        self._arrays: list[tuple[int, mmap.mmap, NDArray[Any]]] = []
        self._end = SIZE
        self.failures: dict[str, str] = {}
        self.habits: dict[tuple[str, str], int] = {}
        state = self._state
        state.where, state.component, state.saying, state.said = OUTSIDE, -1, -1, b""
        state.progress.row = state.progress.at = 0

    @contextlib.contextmanager
    def calling(self, component: str, function: str) -> Iterator[None]:
        state = self._state
        state.component = self._numbers.get(component, -1)
        state.function = function.encode()[:60]
        state.calls += 1
        state.where = CALLING
        try:
            yield
        finally:
            state.calls += 1
            state.where = OUTSIDE
            if component in self._strangers and self._settle is not None:
                self.habit(component, function, self._settle())

    def said(self, component: str, text: str) -> None:
        self._state.saying = self._numbers.get(component, -1)
        self._state.said = text.encode()[: State.said.size - 1]

    def watches(self, component: str) -> bool:
        return component in self._strangers and self._settle is not None

    def habit(self, component: str, function: str, habits: int) -> None:
        if habits and component not in {name for name, _ in self.habits}:
            self.habits[component, function] = habits

    def progress(self) -> Progress:
        progress: Progress = self._state.progress
        return progress

    def bound(
        self, component: str, function: str, call: Callable[_P, _R]
    ) -> Callable[_P, _R]:
        number = len(self._labels)
        self._labels.append((component, function))
        progress, settle = self._state.progress, self._settle
        if settle is None or component not in self._strangers:

            def noted(*arguments: _P.args, **named: _P.kwargs) -> _R:
                progress.at = number
                return call(*arguments, **named)

            return noted

        def watched(*arguments: _P.args, **named: _P.kwargs) -> _R:
            progress.at = number
            result = call(*arguments, **named)
            habits = settle()
            if habits:
                self.habit(component, function, habits)
            return result

        return watched

    def array(self, shape: Sequence[int], dtype: Any) -> NDArray[Any]:
        size = int(np.prod(shape)) * np.dtype(dtype).itemsize
        if not size:
            return np.empty(shape, dtype)
        self._memory.grow(self._end + up(size))
        part = self._memory.part(self._end, size)
        array: NDArray[Any] = np.frombuffer(part, dtype).reshape(shape)
        self._arrays.append((self._end, part, array))
        self._end += up(size)
        return array

    def begin(self, record: Record, labels: Sequence[tuple[str, str]]) -> None:
        arrays = []
        for start, part, array in self._arrays:
            first = array.ctypes.data
            values = tuple(
                (name, v.shape, v.strides, v.ctypes.data - first)
                for name, v in record.values.items()
                if first <= v.ctypes.data < first + len(part)
            )
            arrays.append(SharedArray(start, len(part), array.dtype.str, values))
        self._state.where = LOOP
        send(self._answers, Begun(tuple(labels) or tuple(self._labels), tuple(arrays)))

    def late(self, component: str, error: SblcosimError) -> None:
        self.failures[component] = str(error)

    def settle(self) -> bool:
        """Undo changes to processor state and locale; returns whether there were any."""
        return self._settle is not None and bool(self._settle())

    def blamed(self) -> str | None:
        """The component of the latest call."""
        if self._state.where == LOOP and self._labels:
            at: int = self._state.progress.at
            return self._labels[at][0]
        number: int = self._state.component
        return self.names[number] if 0 <= number < len(self.names) else None


def main() -> None:
    """Work until the parent ends or requests the end."""
    tasks, answers = _streams()
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource  # crashes are expected here; core dumps are useless

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles Ctrl-C
    first = receive(tasks)
    if first is None:
        return
    start: Start = pickle.loads(first)
    tempfile.tempdir = start.folder
    todo: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_follow, args=(tasks, todo, start.folder), daemon=True).start()
    telling = _Telling(Memory(start.memory), answers)
    install(telling)
    warned: list[Any] = []
    warnings.showwarning = lambda text, kind, file, line, *_: warned.append(
        (_text(text), _warning(kind), str(file), line)
    )
    shared, own = Shared(telling.settle), os.getpid()

    def loaded() -> None:
        telling.loaded()
        shared.look()

    user_code.allow(loaded)
    send(answers, TaskEnded())
    while True:
        try:
            task, answer = _done(todo.get(), telling, shared)
        except BaseException:
            if user_code.begun():  # and has replaced what our own code needs
                os._exit(1)
            raise
        if os.getpid() != own:  # the user's code has forked, and this is the copy
            os._exit(0)
        answer = replace(answer, warned=tuple(warned[:_MOST_WARNINGS]))
        warned.clear()
        if isinstance(task, Call | Execute) and not task.strangers:
            answer = replace(answer, spoilt=shared.changed())
        try:
            send(answers, _watched(answer, telling))
        except BaseException:  # the user's code has closed the stream, or removed what pickle needs
            os._exit(1)
        if isinstance(task, End):
            _end(task)
        if isinstance(task, Call) and task.afterwards:
            with contextlib.suppress(Exception):
                import_module(task.afterwards)


def _end(task: End) -> None:
    """End the process, without the exit handlers of FMUs."""
    if not task.strangers:
        with contextlib.suppress(BaseException):
            atexit._run_exitfuncs()
        with contextlib.suppress(BaseException):
            sys.stdout.flush()
    os._exit(0)


def _streams() -> tuple[IO[bytes], IO[bytes]]:
    """Streams of tasks and answers. The FMUs get an empty stdin; their stdout is stderr."""
    tasks, answers = (os.fdopen(os.dup(fd), mode) for fd, mode in ((0, "rb"), (1, "wb")))
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    return tasks, answers


def _follow(tasks: IO[bytes], todo: queue.SimpleQueue[bytes], folder: str) -> None:
    """Queue tasks; end together with the parent, however it ends."""
    while (task := receive(tasks)) is not None:
        todo.put(task)
    shutil.rmtree(folder, ignore_errors=True)
    if sys.platform != "win32":
        os.killpg(0, signal.SIGKILL)  # the FMUs may have started processes
    os._exit(1)


def _done(content: bytes, telling: _Telling, shared: Shared) -> tuple[Task | None, TaskEnded]:
    """Do a task; returns the task and its answer."""
    task, value = None, None
    error: Exception | None = None
    try:
        task = _unpacked(content)
        task.here.take_over(telling.added)
        telling.here = task.here
        telling.take(task.components, task.strangers)
        value = _value(task)
    except SblcosimError as problem:
        error = _ours(problem)
    except MemoryError:
        error = MemoryError()
    except BaseException as problem:
        blamed = telling.blamed() or (_from_file(task) if shared.looked else None)
        if blamed is None:  # our own bug
            error = RuntimeError(traceback.format_exc())
        else:  # in code that the user's code has changed or that calls it
            error = ConfigurationError(
                f"{blamed}: must let its process go on, got {raised(problem)}"
            )
            error.component = blamed if blamed in telling.names else None
    return task, TaskEnded(
        value,
        error,
        tuple(telling.failures.items()),
        tuple((*call, habits) for call, habits in telling.habits.items()),
    )


def _from_file(task: Task | None) -> str:
    """The component from the user's file; all of them if there are several."""
    if isinstance(task, Execute):
        sources = {c.name: c.source for c in task.plan.components}
        names = [name for name, source in sources.items() if isinstance(source, PythonSource)]
    else:
        names = [] if task is None else [*task.components]
    return ", ".join(names) or "Python files"


def _ours(problem: SblcosimError) -> SblcosimError:
    """The same exception, without classes of the user."""
    kind = next(k for k in type(problem).__mro__ if k.__module__.partition(".")[0] == "sblcosim")
    error: SblcosimError = kind(_text(problem))
    error.component, error.suspects = problem.component, tuple(problem.suspects)
    return error


def _warning(kind: type[Warning]) -> type[Warning]:
    """A category of warnings that the parent knows."""
    known = {"builtins", "sblcosim"}
    return next(k for k in kind.__mro__ if k.__module__.partition(".")[0] in known)


def _text(of: object) -> str:
    try:
        return str(of)
    except BaseException:  # the user's code may do anything
        return f"{type(of).__name__}, which cannot be shown"


def _watched(answer: TaskEnded, telling: _Telling) -> bytes:
    """An answer, pickled; this may call the user's code, so it counts as a call of it."""
    blamed = telling.blamed()
    if blamed is None:
        return _packed(answer, None)
    with telling.calling(blamed, "the packing of its answer"):
        return _packed(answer, blamed)


def _packed(answer: TaskEnded, blamed: str | None) -> bytes:
    """An answer, pickled, if its reader can read it."""
    try:
        content = pickle.dumps(answer)
        read(content)
    except BaseException as problem:
        error = ConfigurationError(
            f"{blamed or 'the answer'}: must be something that another process can receive, got "
            f"{raised(problem)}"
        )
        error.component = blamed
        return pickle.dumps(TaskEnded(error=error, spoilt=True))
    return content


def _unpacked(content: bytes) -> Task:
    try:
        task: Task = pickle.loads(content)
    except Exception as error:
        raise ConfigurationError(
            "a Python component in a process of its own: must be importable there, got "
            f"{type(error).__name__}: {one_line(error)}"
        ) from error
    return task


def _value(task: Task) -> Any:
    if isinstance(task, Execute):
        run = native.execute if task.master == "native" else python.execute
        if task.played is not None:
            python.execute(task.plan, None, task.record, task.played)
        else:
            run(task.plan, None, task.record)
        return None
    if isinstance(task, InitialOutputs):
        return python.initial_outputs(task.spec, task.names, task.start_ns)
    if isinstance(task, Call):
        return task.function()
    _free_all(task.strangers)
    return None


def _free_all(strangers: Sequence[str]) -> None:
    """Free all instances of third-party FMUs and unload their libraries."""
    libraries: dict[str, list[lending.Instance]] = {}
    for instance in lending.idle():
        if instance.name in strangers:
            libraries.setdefault(instance.fmu.sha256, []).append(instance)
    for instances in libraries.values():
        for instance in instances:
            instance.free()
    for instances in libraries.values():
        lending.unload(instances)
