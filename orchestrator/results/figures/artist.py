"""Figures drawn by other processes, while this one simulates and writes tables.

Matplotlib takes long to import. The process that draws is therefore forked first: it imports what
figures need while its parent does the rest, and receives the data through a socket. At that time
there are no threads yet, which would make a fork unsafe.
"""

from __future__ import annotations

import os
import pickle
import signal
import socket
import threading
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ...catalogue import Job
    from ...style import ThemeName


class Artist:
    """A process that draws once, when told what to draw; the parent's side."""

    def __init__(self, process: int, line: socket.socket) -> None:
        self._process = process
        self._line = line

    def begin(self, jobs: Sequence[Job], folder: Path, theme: ThemeName) -> None:
        """Let it draw these figures."""
        with suppress(OSError), self._line.makefile("wb") as orders:  # it may be dead
            pickle.dump((jobs, folder, theme), orders, pickle.HIGHEST_PROTOCOL)

    def has_drawn(self) -> bool:
        """Wait for its end; returns whether all figures were drawn without a warning."""
        status = os.waitpid(self._process, 0)[1]
        if status == 0:
            self._process = 0
        return status == 0

    def end(self) -> None:
        """End it and its fork, whatever they are doing."""
        if self._process:
            with suppress(OSError):  # both have ended already
                os.killpg(self._process, signal.SIGKILL)
            with suppress(OSError):
                self._line.recv(1)  # nothing but the end of the stream, once both have ended
            with suppress(ChildProcessError):
                os.waitpid(self._process, 0)
            self._process = 0
        self._line.close()


@contextmanager
def forked_artist(wanted: bool = True) -> Iterator[Artist | None]:
    """A process that prepares to draw while the body of the statement makes the data.

    None if it is not wanted or would not help: without fork (Windows), in a program with threads,
    on one processor.
    """
    alone = threading.active_count() == 1 and (os.cpu_count() or 1) > 1
    if not (wanted and alone and hasattr(os, "fork")):
        yield None
        return
    here, there = socket.socketpair()
    process = os.fork()
    if process == 0:
        code = 1
        try:
            here.close()
            _draw(there)
            code = 0
        finally:
            os._exit(code)
    # A separate group: Ctrl-C goes to this process, which then ends the whole group.
    os.setpgid(process, process)
    there.close()
    artist = Artist(process, here)
    try:
        yield artist
    finally:
        artist.end()


def _draw(line: socket.socket) -> None:
    """Draw what is ordered, with a fork once everything is imported."""
    for kind in (signal.SIGINT, signal.SIGTERM):
        signal.signal(kind, signal.SIG_DFL)
    from matplotlib.backends import backend_agg, backend_svg  # noqa: F401

    from . import run as figures  # noqa: F401

    with line.makefile("rb") as orders:
        jobs, folder, theme = pickle.load(orders)  # EOFError: nothing to draw
    numbers, end = os.pipe()
    os.write(end, bytes(range(len(jobs))))
    os.close(end)
    other = os.fork()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        while number := os.read(numbers, 1):  # each byte goes to one process
            jobs[number[0]].save(folder, theme)
    if other and os.waitpid(other, 0)[1] != 0:
        raise ChildProcessError


@contextmanager
def drawing(
    jobs: Sequence[Job], folder: Path, theme: ThemeName = "light", artist: Artist | None = None
) -> Iterator[None]:
    """Write figures into a folder: by an artist while the body of the statement runs, or
    afterwards.

    If the artist could not draw something, or not without a warning, everything is drawn again
    here.
    """
    if artist is None or not jobs:
        yield
    else:
        try:
            artist.begin(jobs, folder, theme)
            yield
            if artist.has_drawn():
                return
        finally:
            artist.end()  # before the folder is removed
    for job in jobs:
        job.save(folder, theme)
