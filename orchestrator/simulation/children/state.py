"""A child process's state in shared memory, and its message format."""

from __future__ import annotations

import ctypes
import pickle
import struct
from typing import IO, Any

from sblcosim.fmus.host.watch import Progress

from .memory import up

SAID = 2000
"""Bytes for the FMU's latest log message."""

OUTSIDE, CALLING, LOOP = range(3)
"""Outside any call; in a call outside the loop; in the loop."""


class State(ctypes.Structure):
    """The structure at the beginning of the shared memory.

    ``component`` and ``saying`` are indices into the task's list of components. ``calls`` changes
    with each call outside the loop.
    """

    _fields_ = (
        ("progress", Progress),
        ("where", ctypes.c_int64),
        ("calls", ctypes.c_int64),
        ("component", ctypes.c_int64),
        ("function", ctypes.c_char * 64),
        ("saying", ctypes.c_int64),
        ("said", ctypes.c_char * SAID),
    )


SIZE = up(ctypes.sizeof(State))
"""Bytes before the record."""

_LENGTH = struct.Struct("<Q")


def send(stream: IO[bytes], message: Any) -> None:
    """Send a message: bytes, or an object to pickle."""
    content = message if isinstance(message, bytes) else pickle.dumps(message)
    stream.write(_LENGTH.pack(len(content)) + content)
    stream.flush()


def receive(stream: IO[bytes]) -> bytes | None:
    """The next message, still pickled; None at the end of the stream."""
    length = stream.read(_LENGTH.size)
    if len(length) < _LENGTH.size:
        return None
    content = stream.read(_LENGTH.unpack(length)[0])
    return content if len(content) == _LENGTH.unpack(length)[0] else None
