"""Time per step and run of the competitors, on one core."""

from __future__ import annotations

import time

import numpy_plain
import numpy_study
from check_statistics import LOW, octave_runs

SAMPLING_TIME = float(LOW["sampling_time"])


def numpy_ns_per_step(quick: bool = False, plain: bool = False) -> float:
    """Smallest time over repeats, with the levels of Table 3 mixed; tuned or plain."""
    script = numpy_plain if plain else numpy_study
    factors = numpy_study.design(numpy_study.BATCH)
    runs = len(factors["baseline"])
    steps = numpy_study.epochs(SAMPLING_TIME) * runs
    figures = []
    for _ in range(3 if quick else 5):
        started = time.perf_counter()
        numpy_study.study(
            SAMPLING_TIME, factors, batch=script.BATCH, simulate=script.simulate
        )
        figures.append((time.perf_counter() - started) / steps * 1e9)
    return min(figures)


def octave_ns_per_step(quick: bool = False) -> float:
    """Smallest time over some runs."""
    _, microseconds, _ = octave_runs(LOW, 2 if quick else 5)
    return microseconds * 1e3
