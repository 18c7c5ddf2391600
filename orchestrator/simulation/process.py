"""A child process that runs plans, seen from the parent: tasks, answers, time limits, crashes."""

from __future__ import annotations

import contextlib
import json
import mmap
import os
import pickle
import queue
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, replace
from typing import IO, Any

import cloudpickle
import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus import stopping
from sblcosim.fmus.files import scratch
from sblcosim.fmus.host import libraries
from sblcosim.fmus.host.instances import LOADING, UNLOADING
from sblcosim.fmus.host.nanoseconds import text_of
from sblcosim.fmus.read.ports import Fmu

from ..errors import ConfigurationError, ConfigurationWarning, FmuError, one_line
from .child import Answer, Begun, End, Execute, InitialOutputs, Start, Task
from .masters.python import PROGRESS_INTERVAL
from .memory import Memory
from .plan import Plan, PlannedComponent
from .record import Record
from .state import CALLING, LOOP, SIZE, State, receive, send

STEP_TIMEOUT = 60.0
"""Default time limit for a call [s]."""

PATIENCE: ContextVar[float] = ContextVar("PATIENCE", default=STEP_TIMEOUT)
"""Time limit for a call [s] in the current context."""

_GRACE = 5.0
"""Seconds for a process to end after it has closed its pipes."""

_OUTPUT = 20_000
"""Limit on the FMU output shown per process [bytes]."""

_PHRASES = {LOADING: "loading its library", UNLOADING: "unloading its library"}
_HABITS = {1: "the floating-point state of the processor", 2: "the locale"}

_PROGRAM = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from sblcosim.simulation.child import main; main()"
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


@dataclass
class _Watched:
    """The current task: the data needed to name a component that fails."""

    components: Mapping[str, PlannedComponent]
    suspects: tuple[str, ...]
    instants: Sequence[int] = ()
    begun: Begun | None = None
    parts: Sequence[mmap.mmap] = ()
    """Mapped parts of the record. Windows frees them with their last user, so keep them here."""


class _EndedError(Exception):
    """The process has ended or was killed."""


class Process:
    """A child process and the memory it shares with the parent."""

    def __init__(self) -> None:
        self._folder = tempfile.mkdtemp(dir=scratch())
        self._memory = Memory()
        self._memory.grow(SIZE)
        self._state = State.from_buffer(self._memory.part(0, SIZE))
        self._answers: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._known: dict[str, PlannedComponent] = {}
        self._suspects: dict[str, None] = {}
        self._lock = threading.Lock()
        self.rests: threading.Timer | None = None
        self.busy = False
        self.alive = True
        self._process = self._started()
        assert self._process.stdout is not None
        assert self._process.stderr is not None
        self._readers = [
            threading.Thread(target=work, args=arguments, daemon=True)
            for work, arguments in (
                (_take, (self._process.stdout, self._answers)),
                (_show, (self._process.stderr,)),
            )
        ]
        for reader in self._readers:
            reader.start()
        try:
            self._send(Start(self._folder, self._memory.handle))
            self._next(_Watched({}, ()), STEP_TIMEOUT, None)
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
                [sys.executable, "-c", _PROGRAM, json.dumps(sys.path)],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                **group, **self._memory.inherited(),
            )  # fmt: skip
        except (OSError, TypeError) as error:
            self.alive = False
            shutil.rmtree(self._folder, ignore_errors=True)
            raise FmuError(
                f"FMUs of others must run in a process of their own, got none: {one_line(error)}"
            ) from error

    # ---- tasks ----

    def run(
        self, task: Execute, patience: float, progress: Callable[[float], None] | None
    ) -> Record:
        """Run a plan."""
        plan = task.plan
        watched = self._watched(plan)
        watched.instants = plan.instants.tolist()
        content = _packed(task)
        self.busy = True
        self._send(content)
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
            record = _record(plan, watched)  # the loop had finished, so it is complete
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

    def outputs(self, task: InitialOutputs, plan: Plan) -> dict[str, NDArray[Any]]:
        """Read outputs at the start."""
        watched = self._watched(plan)
        self.busy = True
        self._send(_packed(task))
        answer = self._next(watched, PATIENCE.get(), None)
        self.busy = False
        self._tell(answer, watched)
        if answer.error is not None:
            raise answer.error
        outputs: dict[str, NDArray[Any]] = answer.value
        return outputs

    def finish(self, patience: float) -> dict[str, str]:
        """Free all instances and end the process; return failures by component."""
        if not self.alive:
            return {}
        names = tuple(self._known)
        watched = _Watched(self._known, tuple(self._suspects))
        self.busy = True
        self._send(pickle.dumps(End(None, names, tuple(self._suspects))))
        try:
            answer = self._next(watched, patience, None)
        except FmuError as error:
            return {error.component or ", ".join(watched.suspects): str(error)}
        finally:
            self.kill()
        self._tell(answer, watched)
        if answer.error is not None:
            raise answer.error
        return {}

    def _watched(self, plan: Plan) -> _Watched:
        components = {c.name: c for c in plan.components}
        known = strangers(plan)
        self._known.update(components)
        self._suspects.update(dict.fromkeys(known))
        python = [c.name for c in plan.components if not isinstance(c.source, Fmu)]
        return _Watched(components, (*known, *python))

    def _send(self, message: Any) -> None:
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):  # the process has ended; `_next` will notice
            send(self._process.stdin, message)

    # ---- waiting ----

    def _next(
        self, watched: _Watched, patience: float, report: Callable[[], None] | None
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
            still += period  # no clock: suspension of the machine must not count
            limit = patience if s.where in (CALLING, LOOP) else max(patience, STEP_TIMEOUT)
            if still >= limit:
                self.kill()
                raise self._failure(watched, limit)

    def _death(self, watched: _Watched) -> FmuError:
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
        return self._failure(watched, None, what)

    def _failure(
        self, watched: _Watched, seconds: float | None, what: str = ""
    ) -> FmuError:
        s = self._state
        name, function, when = self._place(watched)
        suspects = watched.suspects
        sure = name in suspects
        if not sure and seconds is None:
            name = suspects[0] if len(suspects) == 1 else None
        if name is None:
            if seconds is not None:
                what = f"not gone on for {seconds:g} s"
            error = FmuError(
                f"{', '.join(suspects) or 'the process for FMUs of others'}: one of these has "
                f"{what}{when}"
            )
        else:
            component = watched.components[name]
            whose = (
                f"FMU {component.source.path}"
                if isinstance(component.source, Fmu)
                else f"the Python component {component.origin}"
            )
            if seconds is not None:
                what = f"has not returned from {function}{when} for {seconds:g} s"
            elif sure:
                what = f"{what} in {function}{when}"
            else:
                what = f"{what} outside of its calls, in a thread perhaps{when}"
            said = ""
            if s.saying >= 0 and list(watched.components)[s.saying : s.saying + 1] == [name]:
                said = s.said.decode(errors="replace").removeprefix(f"{name}: ")
            error = FmuError(f"{name}: {whose} {what}" + (f": {said}" if said else ""))
            error.component = name
        if seconds is None and len(suspects) > 1:
            error.suspects = suspects
        return error

    def _place(self, watched: _Watched) -> tuple[str | None, str, str]:
        """Component and function of the current call, and its time as text."""
        s = self._state
        if s.where == LOOP:
            when = f" at {text_of(watched.instants[s.progress.row])}"
            if watched.begun is None:
                return None, "", when
            return *watched.begun.labels[s.progress.at], when
        names = list(watched.components)
        if s.where != CALLING or not 0 <= s.component < len(names):
            return None, "", ""
        function = s.function.decode()
        return names[s.component], _PHRASES.get(function, function), ""

    def _tell(self, answer: Answer, watched: _Watched) -> None:
        for name, function, habits in answer.habits:
            source = watched.components[name].source
            assert isinstance(source, Fmu)
            what = " and ".join(text for bit, text in _HABITS.items() if habits & bit)
            warnings.warn(
                f"{name}: FMU {source.path} must leave {what} as it was, got a change in "
                f"{_PHRASES.get(function, function)}; it was undone",
                ConfigurationWarning,
                3,
            )

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


def _record(plan: Plan, watched: _Watched) -> Record:
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
        packed: bytes = cloudpickle.dumps(task)
    except Exception as error:
        raise ConfigurationError(
            f"{_unpackable(task)}: must be possible to send to another process, as it runs beside "
            f"an FMU of somebody else, got {type(error).__name__}: {one_line(error)}"
        ) from error
    return packed


def _unpackable(task: Task) -> str:
    """The component that cannot be pickled."""
    if isinstance(task, Execute):
        for component in task.plan.components:
            try:
                cloudpickle.dumps(component)
            except Exception:
                return component.name
    return "a Python component"


def _take(stream: IO[bytes], answers: queue.SimpleQueue[Any]) -> None:
    # Anything but an answer ends the stream: an FMU may have written into the pipe.
    with contextlib.suppress(Exception), stream:
        while (content := receive(stream)) is not None:
            answers.put(pickle.loads(content))
    answers.put(None)


def _show(stream: IO[bytes]) -> None:
    """Show the output of FMUs, up to a limit."""
    left = _OUTPUT
    with contextlib.suppress(OSError, ValueError), stream:
        while content := os.read(stream.fileno(), 65536):
            if left > 0:
                print(content[:left].decode(errors="replace"), end="", file=sys.stderr, flush=True)
                left -= len(content)
                if left <= 0:
                    print("\n[more output of FMUs is not shown]", file=sys.stderr, flush=True)


def _signal(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return str(number)
