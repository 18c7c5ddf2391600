"""Says on standard error what is being compiled and how long it takes, in a pipe too."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress

SECONDS_PER_BYTE = 5e-6
"""Time of a compiler for a byte of C [s]; for our FMUs, gcc on x86-64 needs 3 to 7 µs."""


@contextmanager
def announced(names: Sequence[str], texts: Sequence[Mapping[str, bytes]]) -> Iterator[None]:
    """Announce a compilation, and its end.

    Parameters
    ----------
    names
        What is made.
    texts
        The C files, by name, of each run of the compiler. Without any, nothing is said.
    """
    if not texts:  # linking takes no time
        yield
        return
    each = [SECONDS_PER_BYTE * sum(map(len, text.values())) for text in texts]
    expected = max(*each, sum(each) / (os.cpu_count() or 1))
    _say(f"compiling {', '.join(dict.fromkeys(names))}: about {_time(expected)} on an idle machine")
    began = time.monotonic()
    yield
    _say(f"compiled in {_time(time.monotonic() - began)}, and kept for later runs")


def _time(seconds: float) -> str:
    whole = max(1, round(seconds))
    return f"{whole} s" if whole < 120 else f"{round(whole / 60)} min"


def _say(line: str) -> None:
    if sys.stderr is not None:
        with suppress(OSError, ValueError):  # nobody reads it
            print(line, file=sys.stderr, flush=True)
