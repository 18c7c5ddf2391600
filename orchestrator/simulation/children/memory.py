"""Memory shared by two processes; it is freed when both have ended, however they end."""

from __future__ import annotations

import mmap
import os
import sys
import tempfile
import uuid
from typing import Any

GRAIN = mmap.ALLOCATIONGRANULARITY
"""Alignment of the parts of the memory [bytes]."""


class Memory:
    """Memory in parts; each process maps the parts that it needs.

    POSIX: an anonymous file. Windows: a named mapping for each part.
    """

    def __init__(self, handle: int | str | None = None) -> None:
        self.handle: int | str = _new() if handle is None else handle

    def inherited(self) -> dict[str, Any]:
        """Arguments of `subprocess.Popen` that pass the memory to a child."""
        return {"pass_fds": (self.handle,)} if isinstance(self.handle, int) else {}

    def grow(self, size: int) -> None:
        """Resize to this many bytes. New bytes are zero; removed bytes must not be in use."""
        if isinstance(self.handle, int):
            os.ftruncate(self.handle, size)

    def part(self, start: int, size: int) -> mmap.mmap:
        """Map a part of the memory into this process."""
        if sys.platform == "win32":
            return mmap.mmap(-1, size, tagname=f"{self.handle}-{start}")
        assert isinstance(self.handle, int)
        return mmap.mmap(self.handle, size, offset=start)

    def __del__(self) -> None:
        """Close the handle; mapped parts stay valid."""
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
    """Round up to a multiple of `GRAIN`."""
    return -(-size // GRAIN) * GRAIN
