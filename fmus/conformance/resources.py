"""Checks of the resources that an FMU uses."""

from __future__ import annotations

import ctypes
import gc
import re
import sys
from pathlib import Path

from .bench import Bench, ConformanceError, NotApplicableError, begin, refuse_single, stimulus
from .library import RefusedError, Setting

LIVES = 10_000
"""Instantiations of the check for leaks."""
_MEASURED = (4_000, 7_000, LIVES)
_LEAK = 16
"""Bytes per instantiation that count as a leak: half of the smallest piece that is allocated."""


def leaks(bench: Bench) -> str:
    refuse_single(bench)
    subject, level = bench.subject, bench.facts["level"]
    inputs = bench.library.settings(stimulus(subject, level, 0))
    sizes: list[tuple[int, ...]] = []
    for life in range(LIVES + 1):
        if life in _MEASURED:
            sizes.append(_memory())
        try:
            _live(bench, level, inputs)
        except RefusedError as refusal:
            raise ConformanceError(f"instance {life + 1:,} of this process: {refusal}") from None
    # A one-time growth appears in one of the intervals. A leak continues.
    lives = _MEASURED[1] - _MEASURED[0]
    growth = max(min(b - a, c - b) for a, b, c in zip(*sizes, strict=True)) / lives
    if growth > _LEAK:
        raise ConformanceError(f"each of {LIVES:,} instances leaves {growth:.0f} bytes behind")
    return f"{LIVES:,} instances leave nothing behind"


def _live(bench: Bench, level: str, inputs: list[Setting]) -> None:
    """One short life."""
    subject = bench.subject
    instance = begin(bench.instance(), level)
    instance.set_all(inputs)
    if subject.saves:
        instance.free_state(instance.state())
    instance.step(subject.start, subject.step)
    instance.do("Terminate")
    instance.free()


class _Mallinfo2(ctypes.Structure):
    _fields_ = tuple(
        (name, ctypes.c_size_t)
        for name in (
            "arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks", "uordblks",
            "fordblks", "keepcost",
        )
    )  # fmt: skip


def _memory() -> tuple[int, ...]:
    """Memory in bytes that this process occupies and, with glibc, that it has allocated."""
    gc.collect()  # an FMU may be written in Python
    # A small leak hides in previously freed memory, but shows in what is allocated. An FMU with its
    # own allocator shows in what is occupied.
    sizes = []
    try:
        info = ctypes.CDLL(None).mallinfo2
        info.restype = _Mallinfo2
        now = info()
        sizes.append(now.uordblks + now.hblkhd)
    except (AttributeError, TypeError):
        pass
    try:  # Linux's other sources are not exact
        rollup = Path("/proc/self/smaps_rollup").read_text()
        sizes += [int(kB) * 1024 for kB in re.findall(r"^Rss:\s*(\d+) kB", rollup, re.MULTILINE)]
    except OSError:
        try:
            import resource
        except ImportError:
            raise NotApplicableError("the memory of a process cannot be measured here") from None
        most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        sizes.append(most if sys.platform == "darwin" else most * 1024)
    return tuple(sizes)
