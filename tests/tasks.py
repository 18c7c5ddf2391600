"""Tasks that tests give to processes, which import them by name: a test file they cannot import."""

from __future__ import annotations

import itertools
import os
import time
from pathlib import Path

from sblcosim.fmus import files


def scratch_of_one(folder: Path, workers: int) -> tuple[int, Path]:
    """What a worker has for itself, when all have it: none does two of these tasks."""
    place = files.scratch()
    until = time.monotonic() + 300
    while len(list(folder.iterdir())) < 2 * workers and time.monotonic() < until:
        time.sleep(0.01)
    return os.getpid(), place


def write_on(place: Path) -> None:
    """Write files into the scratch of one worker, whichever has this task."""
    for number in itertools.count():
        (place / str(number)).touch()
