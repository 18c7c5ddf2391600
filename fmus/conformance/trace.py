"""Progress of a process, written where a waiting parent can read it after a crash."""

from __future__ import annotations

import mmap
from dataclasses import dataclass
from pathlib import Path

_TRACE = 2048
"""Bytes of the file."""


class Trace:
    """Progress of this process, in a file that outlives it.

    The file holds ``COUNT PROBE CLAUSE WHAT``: how often it was written, the number of the probe
    after which to continue (or ``-``), the section of the standard that requires the FMU to
    tolerate that call (or ``-``), and the current call. A second line holds the FMU's log during
    the call.
    """

    def __init__(self, path: Path) -> None:
        path.write_bytes(bytes(_TRACE))
        with path.open("r+b") as file:
            self._map = mmap.mmap(file.fileno(), _TRACE)
        self._count, self._probe, self._label, self._call = 0, "- -", "", ""

    def enter(self, call: str) -> None:
        """Note the call that follows."""
        self._count += 1
        self._call = f"{self._count} {self._probe} {self._label or call}"
        self._write(self._call)

    def say(self, text: str) -> None:
        """Note what the FMU has logged in this call."""
        self._write(f"{self._call}\n{text}")

    def _write(self, text: str) -> None:
        self._map[:] = text.encode()[:_TRACE].ljust(_TRACE, b"\0")

    def probe(self, number: int, label: str, clause: str | None) -> None:
        """Note what the following calls are, in words for people."""
        self._probe, self._label = f"{number} {clause or '-'}", label
        self.enter(label)


@dataclass(frozen=True, slots=True)
class Position:
    """Progress of a process.

    Attributes
    ----------
    count
        Changes as long as the process goes on.
    probe
        Number of the probe; None outside any probe.
    clause
        Section that requires the FMU to tolerate its call, if any.
    call
        Current or last call.
    said
        What the FMU has logged during it.
    """

    count: str
    probe: int | None
    clause: str | None
    call: str
    said: str = ""


def read_trace(path: Path) -> Position:
    """Read a trace."""
    text = path.read_bytes().strip(b"\0") if path.is_file() else b""
    where, _, said = (text or b"0 - - its start").decode(errors="replace").partition("\n")
    count, probe, clause, call = where.split(" ", 3)
    return Position(
        count, None if probe == "-" else int(probe), None if clause == "-" else clause, call, said
    )
