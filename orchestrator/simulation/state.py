"""What a child process tells its parent in the memory they share, and how they talk."""

from __future__ import annotations

import ctypes
import pickle
import struct
from typing import IO, Any

from sblcosim.fmus.host.watch import Progress

from .memory import up

SAID = 2000
"""Bytes for what the FMU has logged."""

OUTSIDE, CALLING, LOOP = range(3)
"""Not in a call; in one outside of the loop; in the loop."""


class State(ctypes.Structure):
    """At the beginning of the memory.

    The component is its number in the list that came with the task; ``calls`` changes with each
    call outside of the loop.
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
    """Send something that can be pickled."""
    content = message if isinstance(message, bytes) else pickle.dumps(message)
    stream.write(_LENGTH.pack(len(content)) + content)
    stream.flush()


def receive(stream: IO[bytes]) -> bytes | None:
    """The next message, pickled; None: there will be none."""
    length = stream.read(_LENGTH.size)
    if len(length) < _LENGTH.size:
        return None
    content = stream.read(_LENGTH.unpack(length)[0])
    return content if len(content) == _LENGTH.unpack(length)[0] else None
