"""Compare two builds in alternation, with an interval for the ratio of their times.

    python benchmarks/alternating.py OLD/bin/python NEW/bin/python --repeats 15 -- CODE

runs CODE (a statement, or ``-m MODULE ARGUMENTS``) with both interpreters. The one that begins
changes from pair to pair, so that a varying load affects both. The output is the ratio new/old: its
median over the pairs with the 95 % interval from order statistics, and the ratio of the smallest
times. Processor time of the process and its children counts, or with --wall the elapsed
time. The other benchmarks here use its functions for their comparisons.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import comb

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Ratio:
    """Ratio of the second time to the first; the interval is NaN with too few pairs."""

    median: float
    low: float
    high: float
    least: float
    pairs: int

    def __str__(self) -> str:
        return (
            f"{self.median:.3f} (95 %: {self.low:.3f} to {self.high:.3f}, {self.pairs} pairs); of "
            f"the least times {self.least:.3f}"
        )


def alternated(
    old: Callable[[], float], new: Callable[[], float], pairs: int = 15
) -> tuple[list[float], list[float]]:
    """Times of both [s], pair by pair; each function measures itself."""
    times: tuple[list[float], list[float]] = ([], [])
    for i in range(pairs):
        for which in (0, 1) if i % 2 == 0 else (1, 0):
            times[which].append((old, new)[which]())
    return times


def ratio(old: Sequence[float], new: Sequence[float]) -> Ratio:
    """The ratio of paired times, with a distribution-free interval."""
    ratios = sorted(b / a for a, b in zip(old, new, strict=True))
    n = len(ratios)
    # The largest k for which the k-th smallest and largest hold the median with the confidence.
    k, below = 0, 0.0
    while True:
        below += comb(n, k) / 2**n
        if 2 * below > 1 - CONFIDENCE:
            break
        k += 1
    low, high = (ratios[k - 1], ratios[-k]) if k else (float("nan"), float("nan"))
    return Ratio(statistics.median(ratios), low, high, min(new) / min(old), n)


def of_call(function: Callable[[], object], wall: bool = False) -> Callable[[], float]:
    """A function that calls another one and returns its time in this process [s]."""
    clock = time.perf_counter if wall else time.process_time

    def seconds() -> float:
        started = clock()
        function()
        return clock() - started

    return seconds


def of_program(command: Sequence[str], wall: bool = False) -> Callable[[], float]:
    """A function that runs a program and returns its time [s]."""

    def seconds() -> float:
        started, before = time.perf_counter(), os.times()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        after = os.times()
        if wall:
            return time.perf_counter() - started
        return (
            after.children_user - before.children_user
            + after.children_system - before.children_system
        )

    return seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("old", help="interpreter of the build before")
    parser.add_argument("new", help="interpreter of the build after")
    parser.add_argument("--repeats", type=int, default=15, help="pairs")
    parser.add_argument("--wall", action="store_true", help="measure elapsed time")
    parser.add_argument("code", nargs="+", help="a statement, or -m MODULE ARGUMENTS, after --")
    asked = parser.parse_args()
    code = asked.code if asked.code[0] == "-m" else ["-c", *asked.code]
    runs = [of_program([build, *code], asked.wall) for build in (asked.old, asked.new)]
    for run in runs:  # files and caches
        run()
    times = alternated(*runs, asked.repeats)
    for name, values in zip(("old", "new"), times, strict=True):
        print(f"{name}: {min(values):.3f} s at least, {statistics.median(values):.3f} s median")
    print(f"new/old: {ratio(*times)}")


if __name__ == "__main__":
    main()
