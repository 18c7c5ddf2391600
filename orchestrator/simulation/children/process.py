"""A child process, seen from the parent: tasks, answers, time limits, crashes."""

from __future__ import annotations

import contextlib
import functools
import os
import pickle
import queue
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from dataclasses import replace
from typing import IO, Any, ParamSpec, TypeVar, cast

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus import stopping
from sblcosim.fmus.files import scratch
from sblcosim.fmus.host import libraries
from sblcosim.fmus.read.ports import Fmu

from ...data.record import Record
from ...errors import ConfigurationError, FmuError, one_line
from ..code.packing import packed
from ..code.user_code import PythonSource
from ..plans.plan import PROGRESS_INTERVAL, Plan
from .memory import Memory
from .messages import (
    Begun,
    Call,
    End,
    Execute,
    Here,
    InitialOutputs,
    Start,
    Task,
    TaskEnded,
    read,
)
from .state import CALLING, LOOP, SIZE, State, receive, send
from .watched import Watched, who

_P = ParamSpec("_P")
_R = TypeVar("_R")

STEP_TIMEOUT = 60.0
"""Default time limit for a call [s]."""

PATIENCE: ContextVar[float] = ContextVar("PATIENCE", default=STEP_TIMEOUT)
"""Time limit for a call [s] in the current context."""

_GRACE = 5.0
"""Seconds for a process to end after closing its pipes."""

FAREWELL = 1.0
"""Seconds for the exit handlers of the user's code."""

_OUTPUT = 20_000
"""Limit on the output of FMUs and Python files shown per task [bytes]."""

_PROGRAM = (  # imports nothing before it has the path: the working directory may hold anything
    "import sys; sys.path[:] = sys.argv[1:]; from sblcosim.simulation.child import main; main()"
)


@contextlib.contextmanager
def patience(seconds: float | None) -> Iterator[None]:
    """Set `PATIENCE` within a block; None keeps the current value."""
    check_patience(seconds)
    before = PATIENCE.get()
    PATIENCE.set(before if seconds is None else seconds)
    try:
        yield
    finally:
        PATIENCE.set(before)


def patient(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """A function of the API whose keyword ``step_timeout`` sets `PATIENCE` for all it calls."""

    @functools.wraps(function)
    def limited(*arguments: _P.args, **options: _P.kwargs) -> _R:
        with patience(cast(float | None, options.get("step_timeout"))):
            return function(*arguments, **options)

    return limited


def check_patience(seconds: float | None) -> None:
    """Refuse an invalid time limit.

    Raises
    ------
    ConfigurationError
        It is not positive.
    """
    if seconds is not None and not seconds > 0:
        raise ConfigurationError(f"step timeout: must be positive, got {seconds!r}")


def strangers(plan: Plan) -> tuple[str, ...]:
    """Names of the components with third-party FMUs."""
    return tuple(
        c.name
        for c in plan.components
        if isinstance(c.source, Fmu) and not libraries.ours(c.source)
    )


def from_files(plan: Plan) -> dict[str, str]:
    """The components from Python files, with the key of each file."""
    return {
        c.name: c.source.file.key
        for c in plan.components
        if isinstance(c.source, PythonSource) and c.source.file is not None
    }


def foreign(plan: Plan) -> bool:
    """Whether a plan contains anything that must not run in this process."""
    return bool(strangers(plan) or from_files(plan))


class Process:
    """A child process and the memory it shares with the parent."""

    def __init__(self) -> None:
        self._folder = tempfile.mkdtemp(dir=scratch())
        self._memory = Memory()
        self._memory.grow(SIZE)
        self._state = State.from_buffer(self._memory.part(0, SIZE))
        self._answers: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._known: dict[str, str] = {}
        self._suspects: dict[str, None] = {}
        self._lock = threading.Lock()
        self.rests: threading.Timer | None = None
        self.busy = False
        self.alive = True
        self.spoilt = False
        """Whether the user's code has changed something that all code of the process shares."""
        self._left = _OUTPUT
        self._process = self._started()
        assert self._process.stdout is not None
        assert self._process.stderr is not None
        self._readers = [
            threading.Thread(target=work, args=arguments, daemon=True)
            for work, arguments in (
                (_take, (self._process.stdout, self._answers)),
                (self._show, (self._process.stderr,)),
            )
        ]
        for reader in self._readers:
            reader.start()
        try:
            self._send(Start(self._folder, self._memory.handle))
            self._next(Watched({}, ()), STEP_TIMEOUT, None)
        except BaseException:
            self.kill()
            raise

    def _started(self) -> subprocess.Popen[bytes]:
        group: dict[str, Any] = (
            {"creationflags": 0x200}  # new process group: Ctrl-C goes to the parent only
            if sys.platform == "win32"
            else {"start_new_session": True}
        )
        try:
            return subprocess.Popen(
                [sys.executable, "-c", _PROGRAM, *map(str, sys.path)],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                **group, **self._memory.inherited(),
            )  # fmt: skip
        except (OSError, TypeError) as error:
            self.alive = False
            shutil.rmtree(self._folder, ignore_errors=True)
            raise FmuError(
                "FMUs from other tools and Python files must run in a separate process, got none: "
                f"{one_line(error)}"
            ) from error

    # ---- tasks ----

    def run(
        self, task: Execute, patience: float, progress: Callable[[float], None] | None
    ) -> Record:
        """Run a plan."""
        plan = task.plan
        watched = self._watched(task)
        watched.instants = plan.instants.tolist()
        self._begin(_packed(task))
        last = max(len(watched.instants) - 1, 1)

        def report() -> None:
            if progress is not None and watched.begun is not None:
                progress(self._state.progress.row / last)

        try:
            message = self._next(watched, patience, report)
            if isinstance(message, Begun):
                watched.begun = message
                watched.parts = [self._memory.part(p.start, p.size) for p in message.arrays]
                message = self._next(watched, patience, report)
        except FmuError as error:
            if watched.begun is None or self._state.where == LOOP or error.component is None:
                raise
            record = _record(plan, watched)  # the loop had finished, so the record is complete
            return replace(record, failures={error.component: str(error)})
        self.busy = False
        self._tell(message, watched)
        if message.error is not None:
            raise message.error
        record = replace(_record(plan, watched), failures=dict(message.late))
        self._memory.grow(SIZE)
        if progress is not None:
            progress(1.0)
        return record

    def call(self, task: Call | InitialOutputs, watched: Watched) -> Any:
        """Call one of our functions, or read outputs at the start; returns the result."""
        self._begin(_packed(task))
        answer = self._next(watched, PATIENCE.get(), None)
        self.busy = False
        self._tell(answer, watched)
        if answer.error is not None:
            raise answer.error
        return answer.value

    def outputs(self, task: InitialOutputs, plan: Plan) -> dict[str, NDArray[Any]]:
        """Read outputs at the start."""
        names = {c.name: who(c) for c in plan.components}
        self._known.update(names)
        self._suspects.update(dict.fromkeys(task.strangers))
        outputs: dict[str, NDArray[Any]] = self.call(task, Watched(names, tuple(names)))
        return outputs

    def finish(self, patience: float) -> dict[str, str]:
        """Free all instances and end the process; return failures by component."""
        if not self.alive:
            return {}
        names = tuple(self._known)
        watched = Watched(self._known, tuple(self._suspects))
        self._begin(pickle.dumps(End(Here.now(), names, tuple(self._suspects))))
        try:
            answer = self._next(watched, patience, None)
        except FmuError as error:
            if not watched.suspects:  # nothing is left to fail
                return {}
            return {error.component or ", ".join(watched.suspects): str(error)}
        finally:
            if not watched.suspects:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    self._process.wait(FAREWELL)
            self.kill()
        self._tell(answer, watched)
        if answer.error is not None:
            raise answer.error
        return {}

    def _watched(self, task: Execute) -> Watched:
        known = task.strangers
        names = {c.name: who(c) for c in task.plan.components}
        self._known.update(names)
        self._suspects.update(dict.fromkeys(known))
        played = () if task.played is None else task.played.intervals_ns
        python = [
            c.name for c in task.plan.components
            if not isinstance(c.source, Fmu) and c.name not in played
        ]
        return Watched(names, (*known, *python))

    def _begin(self, content: bytes) -> None:
        """Send a task."""
        self.busy = True
        self._left = _OUTPUT
        self._send(content)

    def _send(self, message: Any) -> None:
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):  # the process has ended; `_next` will notice
            send(self._process.stdin, message)

    # ---- waiting ----

    def _next(
        self, watched: Watched, patience: float, report: Callable[[], None] | None
    ) -> Any:
        """Wait for the next message."""
        period = min(PROGRESS_INTERVAL, patience)
        before: object = None
        still = 0.0
        while True:
            stopping.check()
            with contextlib.suppress(queue.Empty):
                message = self._answers.get(timeout=period)
                if message is None:
                    raise self._death(watched)
                return message
            if self._process.poll() is not None:
                self._readers[0].join(_GRACE)
                if self._answers.empty():
                    raise self._death(watched)
                continue
            s = self._state
            now = (s.where, s.calls, s.progress.row, s.progress.at)
            if now != before:
                before, still = now, 0.0
                if report is not None:
                    report()
                continue
            still += period  # not a clock: suspension of the machine must not count
            limit = patience if s.where in (CALLING, LOOP) else max(patience, STEP_TIMEOUT)
            if still >= limit:
                self.kill()
                raise watched.failure(self._state, limit)

    def _death(self, watched: Watched) -> FmuError:
        """The exception for a process that has ended on its own."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_GRACE)
        code = self._process.poll()
        self.kill()
        if code is None:
            what = "closed the pipes of its process"
        elif code < 0:
            what = f"crashed (signal {_signal(-code)})"
        else:
            what = f"ended the process (exit code {code if code < 256 else hex(code)})"
        return watched.failure(self._state, None, what)

    def _tell(self, answer: TaskEnded, watched: Watched) -> None:
        self.spoilt |= answer.spoilt
        watched.tell(answer)

    def _show(self, stream: IO[bytes]) -> None:
        """Show the output of FMUs and files, up to a limit."""
        with contextlib.suppress(OSError, ValueError), stream:
            while content := os.read(stream.fileno(), 65536):
                if self._left > 0:
                    shown = content[: self._left].decode(errors="replace")
                    print(shown, end="", file=sys.stderr, flush=True)
                    self._left -= len(content)
                    if self._left <= 0:
                        note = "[more output of FMUs is not shown]"
                        print(f"\n{note}", file=sys.stderr, flush=True)

    # ---- the end ----

    def kill(self) -> None:
        """Kill the process and its children, and remove its files."""
        with self._lock:
            if not self.alive:
                return
            self.alive = False
        if sys.platform == "win32":
            self._process.kill()
        else:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_GRACE)
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):
            self._process.stdin.close()
        for reader in self._readers:  # they close their streams
            reader.join(_GRACE)
        shutil.rmtree(self._folder, ignore_errors=True)


def _record(plan: Plan, watched: Watched) -> Record:
    """A copy of the record in the shared memory."""
    assert watched.begun is not None
    values = {
        name: np.ndarray(shape, array.dtype, part, offset, strides).copy()
        for array, part in zip(watched.begun.arrays, watched.parts, strict=True)
        for name, shape, strides, offset in array.values
    }
    names = [c.name for c in plan.columns if c.name in values]
    return Record(
        plan.instants, {name: values[name] for name in names}, intervals_ns=plan.intervals_ns
    )


def _packed(task: Task) -> bytes:
    try:
        return packed(task)
    except Exception as error:
        raise ConfigurationError(
            f"{_unpackable(task)}: must be something that another process can receive, because it "
            "runs "
            f"with a third-party FMU or a file, got {type(error).__name__}: {one_line(error)}"
        ) from error


def _unpackable(task: Task) -> str:
    """The component that cannot be pickled."""
    if isinstance(task, Execute):
        for component in task.plan.components:
            try:
                packed(component)
            except Exception:
                return component.name
    return "a Python component"


def _take(stream: IO[bytes], answers: queue.SimpleQueue[Any]) -> None:
    # Anything but an answer ends the stream: an FMU may have written into the pipe.
    with contextlib.suppress(Exception), stream:
        while (content := receive(stream)) is not None:
            answers.put(read(content))
    answers.put(None)


def _signal(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return str(number)
