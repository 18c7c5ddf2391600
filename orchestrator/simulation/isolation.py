"""Third-party FMUs, in separate processes.

A plan with a third-party FMU is run by a child process (`sblcosim.simulation.child`), with the
same masters and at the same speed: the whole loop runs there in one call, and it writes its
progress to shared memory. So whatever an FMU does, the calling process survives, and knows which
component did it, in which call and when.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from numpy.typing import NDArray

from ..errors import ConfigurationWarning, one_line
from .child import Execute, InitialOutputs
from .masters import native
from .masters.python import alone, chosen
from .plan import Plan
from .process import PATIENCE, STEP_TIMEOUT, Process, strangers
from .record import Record
from .system import ComponentSpec


class Children:
    """Processes that are reused from run to run; each does one run at a time.

    Parameters
    ----------
    idle_s
        A process is ended after this idle time [s]; None: processes stay until the end.
    patience_s
        Time limit for a call at the end [s]; None: `PATIENCE`.
    """

    def __init__(self, idle_s: float | None = None, patience_s: float | None = None) -> None:
        self._idle_s = idle_s
        self._patience_s = patience_s
        self._lock = threading.Lock()
        self._idle: list[Process] = []
        self._all: set[Process] = set()

    @contextlib.contextmanager
    def lend(self) -> Iterator[Process]:
        """Lend a child for exclusive use."""
        with self._lock:
            child = self._idle.pop() if self._idle else None
            if child is not None and child.rests is not None:
                child.rests.cancel()
        if child is None or not child.alive:
            child = Process()
            with self._lock:
                self._all.add(child)
        try:
            yield child
        except BaseException:
            if child.busy:
                child.kill()
            raise
        finally:
            with self._lock:
                if child.alive and child in self._all:
                    self._idle.append(child)
                    child.rests = self._rest(child)
                else:
                    self._all.discard(child)

    def _rest(self, child: Process) -> threading.Timer | None:
        if self._idle_s is None:
            return None
        timer = threading.Timer(self._idle_s, self._dismiss, (child,))
        timer.daemon = True
        timer.start()
        return timer

    def _dismiss(self, child: Process) -> None:
        with self._lock:
            if child not in self._idle:
                return
            self._idle.remove(child)
            self._all.discard(child)
        try:
            messages = list(child.finish(self._patience_s or STEP_TIMEOUT).values())
        except Exception as error:  # nobody joins this timer thread, so print
            messages = [one_line(error)]
        for message in messages:
            print(f"warning: {message}; its results are complete", file=sys.stderr, flush=True)

    def kill(self) -> None:
        """End all children now; current runs fail."""
        with self._lock:
            children, self._all, self._idle = self._all, set(), []
        for child in children:
            child.kill()

    def close(self) -> None:
        """End all children. No run must be in progress.

        Warns
        -----
        ConfigurationWarning
            An FMU has failed while being freed.
        """
        with self._lock:
            children, self._all, self._idle = self._all, set(), []
        for child in children:
            for message in child.finish(self._patience_s or PATIENCE.get()).values():
                warnings.warn(f"{message}; its results are complete", ConfigurationWarning, 2)

    def __enter__(self) -> Children:
        return self

    def __exit__(self, kind: object, *rest: object) -> None:
        if kind is None:
            self.close()
        else:
            self.kill()


def execute(
    plan: Plan,
    progress: Callable[[float], None] | None,
    record: Sequence[str] | None,
    master: str,
    step_timeout: float | None,
    children: Children | None,
) -> Record:
    """Run a plan in a child.

    Parameters
    ----------
    progress, record, master, step_timeout
        As in `sblcosim.simulation.execution.execute`.
    children
        Pool of children; None: start one for this run. Only then does the record include failures
        at its end.

    Raises
    ------
    FmuError
        A component has failed; its name is in the exception.
    ConfigurationError
        A Python component cannot be sent to another process, or has raised an exception.

    Warns
    -----
    ConfigurationWarning
        An FMU has changed shared process state: the floating-point settings or the locale.
    """
    if master == "native":
        native.check(plan)
    chosen(plan, record)
    patience = PATIENCE.get() if step_timeout is None else step_timeout
    task = Execute(
        _here(),
        tuple(c.name for c in plan.components),
        strangers(plan),
        plan,
        None if record is None else tuple(record),
        master,
    )
    if children is not None:
        with children.lend() as child:
            return child.run(task, patience, progress)
    child = Process()
    try:
        result = child.run(task, patience, progress)
        failures = {**result.failures, **child.finish(patience)}
    finally:
        child.kill()
    return replace(result, failures=failures)


def initial_outputs(
    spec: ComponentSpec, names: Sequence[str], start_ns: int, children: Children | None
) -> dict[str, NDArray[Any]]:
    """As `sblcosim.simulation.masters.python.initial_outputs`, in a child."""
    plan = alone(spec, start_ns)
    task = InitialOutputs(
        _here(), (plan.components[0].name,), strangers(plan), spec, tuple(names), start_ns
    )
    if children is not None:
        with children.lend() as child:
            return child.outputs(task, plan)
    child = Process()
    try:
        outputs = child.outputs(task, plan)
        for message in child.finish(PATIENCE.get()).values():
            warnings.warn(message, ConfigurationWarning, 2)
    finally:
        child.kill()
    return outputs


def _here() -> str | None:
    try:
        return os.getcwd()
    except OSError:  # the directory was deleted
        return None
