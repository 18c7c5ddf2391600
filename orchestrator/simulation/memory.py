"""Memory that two processes share, and that is gone when both are, however they end."""

from __future__ import annotations

import mmap
import os
import sys
import tempfile
import uuid
from typing import Any

GRAIN = mmap.ALLOCATIONGRANULARITY
"""Parts of the memory start at multiples of that."""


class Memory:
    """Memory in parts, of which each process maps what it needs.

    POSIX: a file without a name. Windows: each part is a mapping of its own, known by its name.
    """

    def __init__(self, handle: int | str | None = None) -> None:
        self.handle: int | str = _new() if handle is None else handle

    def inherited(self) -> dict[str, Any]:
        """Arguments of `subprocess.Popen` with which a child gets it."""
        return {"pass_fds": (self.handle,)} if isinstance(self.handle, int) else {}

    def grow(self, size: int) -> None:
        """Have at least so much; what is new is zero. Less frees the rest, which nobody may use."""
        if isinstance(self.handle, int):
            os.ftruncate(self.handle, size)

    def part(self, start: int, size: int) -> mmap.mmap:
        """A part of it, here."""
        if sys.platform == "win32":
            return mmap.mmap(-1, size, tagname=f"{self.handle}-{start}")
        assert isinstance(self.handle, int)
        return mmap.mmap(self.handle, size, offset=start)

    def __del__(self) -> None:
        """Give it up; mapped parts stay."""
        if isinstance(getattr(self, "handle", None), int):
            os.close(int(self.handle))


def _new() -> int | str:
    if sys.platform == "win32":
        return f"sblcosim-{uuid.uuid4().hex}"
    if hasattr(os, "memfd_create"):
        return os.memfd_create("sblcosim")
    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())


def up(size: int) -> int:
    """The next multiple of `GRAIN`."""
    return -(-size // GRAIN) * GRAIN
