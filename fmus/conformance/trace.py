"""How far a process is, noted where whoever waits for it can read it after a crash."""

from __future__ import annotations

import mmap
from dataclasses import dataclass
from pathlib import Path

_TRACE = 2048
"""Bytes of the file."""


class Trace:
    """How far this process is, in a file that outlives it.

    It holds ``COUNT PROBE CLAUSE WHAT``: how often it was written, the number of the probe after
    which one can go on (or ``-``), the section of the standard by which that call must be borne
    (or ``-``), and the call under way; on a second line, what the FMU has logged in it.
    """

    def __init__(self, path: Path) -> None:
        path.write_bytes(bytes(_TRACE))
        with path.open("r+b") as file:
            self._map = mmap.mmap(file.fileno(), _TRACE)
        self._count, self._probe, self._label, self._call = 0, "- -", "", ""

    def enter(self, call: str) -> None:
        """Note the call that comes now."""
        self._count += 1
        self._call = f"{self._count} {self._probe} {self._label or call}"
        self._write(self._call)

    def say(self, text: str) -> None:
        """Note what the FMU has logged in this call."""
        self._write(f"{self._call}\n{text}")

    def _write(self, text: str) -> None:
        self._map[:] = text.encode()[:_TRACE].ljust(_TRACE, b"\0")

    def probe(self, number: int, label: str, clause: str | None) -> None:
        """Note what the following calls are, as far as people are concerned."""
        self._probe, self._label = f"{number} {clause or '-'}", label
        self.enter(label)


@dataclass(frozen=True, slots=True)
class Position:
    """How far a process is or was.

    Attributes
    ----------
    count
        Changes as long as the process goes on.
    probe
        Number of the probe; None outside of any.
    clause
        By which its call must be borne, if any.
    call
        What is or was under way.
    said
        What the FMU has logged in it.
    """

    count: str
    probe: int | None
    clause: str | None
    call: str
    said: str = ""


def read_trace(path: Path) -> Position:
    """What a trace says."""
    text = path.read_bytes().strip(b"\0") if path.is_file() else b""
    where, _, said = (text or b"0 - - its start").decode(errors="replace").partition("\n")
    count, probe, clause, call = where.split(" ", 3)
    return Position(
        count, None if probe == "-" else int(probe), None if clause == "-" else clause, call, said
    )
