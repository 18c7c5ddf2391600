"""The child processes of a process: which one does a task, and how long they are kept.

A child that has run a user's file does no work for another file or for other tools' FMUs: the
file's changes must reach nobody else. It is kept for the next run with the same file, whoever asks,
because starting a child and importing what the file needs takes longer than most runs.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import sys
import threading
import warnings
from collections.abc import Iterator

from ...errors import ConfigurationWarning, one_line
from .process import PATIENCE, STEP_TIMEOUT, Process

FILES = 4
"""Maximum number of files for which children are kept."""


class _Waiting:
    """Children that wait for another run with their files."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._idle: dict[str, list[Process]] = {}

    def take(self, key: str) -> Process | None:
        """A child for these files, if one is waiting."""
        with self._lock:
            idle = self._idle.get(key, [])
            while idle:
                child = idle.pop()
                if child.rests is not None:
                    child.rests.cancel()
                if child.alive:
                    return child
        return None

    def put(self, key: str, child: Process, idle_s: float | None) -> None:
        """Let a child wait. If there are too many, those of the least recently used files end."""
        with self._lock:
            self._idle[key] = [*self._idle.pop(key, []), child]
            oldest = list(self._idle)[: -FILES]
            ended = [old for name in oldest for old in self._idle.pop(name)]
            if idle_s is not None:
                child.rests = threading.Timer(idle_s, self._dismiss, (key, child))
                child.rests.daemon = True
                child.rests.start()
        _end(ended)

    def keep_one(self) -> None:
        """Let at most one child wait for the same files."""
        with self._lock:
            ended = [old for idle in self._idle.values() for old in idle[1:]]
            self._idle = {key: idle[:1] for key, idle in self._idle.items() if idle}
        _end(ended)

    def close(self, key: str = "") -> None:
        """End the children, or those for a file."""
        with self._lock:
            gone = [key] if key else list(self._idle)
            ended = [child for name in gone for child in self._idle.pop(name, [])]
        _end(ended)

    def _dismiss(self, key: str, child: Process) -> None:
        with self._lock:
            idle = self._idle.get(key, [])
            if child not in idle:
                return
            idle.remove(child)
        _end([child])


def _end(children: list[Process]) -> None:
    for child in children:
        with contextlib.suppress(Exception):  # nothing is left that could fail
            child.finish(1.0)


waiting = _Waiting()
"""The waiting children of this process."""


def _forked() -> None:
    """A forked process has no children yet; those of its parent continue."""
    global waiting, _parents
    _parents, waiting = waiting, _Waiting()


_parents = waiting
atexit.register(lambda: waiting.close())
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forked)


class Children:
    """Processes that are reused from run to run; each does one run at a time.

    Children for the user's files are shared among all pools of this process while idle.

    Parameters
    ----------
    idle_s
        Idle time after which a process is ended [s]; None: processes stay until the end.
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
    def lend(self, key: str = "") -> Iterator[Process]:
        """Lend a child for exclusive use.

        Parameters
        ----------
        key
            The user's files that run in it; empty: none.
        """
        if key:
            child = waiting.take(key)
        else:
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
            if child.spoilt:
                child.kill()
            with self._lock:
                mine = child.alive and child in self._all
                if mine and not key:
                    self._idle.append(child)
                    child.rests = self._rest(child)
                else:
                    self._all.discard(child)
            if mine and key:
                waiting.put(key, child, self._idle_s)

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
        except Exception as error:  # nobody joins this timer thread, so print the error
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
        """End all children. No run may be in progress.

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
        waiting.keep_one()

    def __enter__(self) -> Children:
        return self

    def __exit__(self, kind: object, *rest: object) -> None:
        if kind is None:
            self.close()
        else:
            self.kill()
