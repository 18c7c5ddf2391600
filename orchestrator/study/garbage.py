"""When the garbage collector need not visit what a study keeps.

A study of thousands of points keeps millions of objects to its end. Each full pass of the collector
visits all of them and frees none.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def uncollected() -> Iterator[None]:
    """Without passes: what is made meanwhile is kept."""
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


@contextmanager
def all_kept() -> Iterator[None]:
    """With passes over what is made meanwhile only: what is there already is kept.

    Nothing changes if somebody has frozen objects already, because they would be thawed, too.
    """
    free = gc.get_freeze_count() == 0
    if free:
        gc.freeze()
    try:
        yield
    finally:
        if free:
            gc.unfreeze()
