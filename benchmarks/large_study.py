"""A study of a million runs: seconds and peak memory to execute it, resume it and analyse it.

The paper's seven factors at two levels, 128 points × 7,813 replicates, with 5 s of its Scenario 1
and one receiver. Commands run one after another, each in its own process. The memory is the peak
resident size, including processes that it starts one by one. An existing folder of a study is
completed. Run by hand: ``python benchmarks/large_study.py [--replicates N] [--folder DIR]``.

Processor seconds and MiB on two cores shared with other work, before and after runs were read by
columns and analysed by points:

==================================  ============  ============
study, what is missing              25.7 s  1333  27.0 s   580
study, finished                     14.1 s  1386   3.0 s   351
study --dry-run, almost finished    16.7 s   379   5.9 s   277
study, almost finished (3 parts)    11.4 s  1413   4.0 s   430
analyse                             76.2 s  2083   7.3 s   562
analyse --transform log             32.8 s  1710   6.1 s   579
==================================  ============  ============

A study with as many points and few runs takes some 2 s of these, its analysis 4 to 5 s.
"""

from __future__ import annotations

import argparse
import os
import platform
import shutil
import sys
import time
import tomllib
from functools import partial
from importlib import resources
from pathlib import Path

from alternating import alternated, ratio
from sblcosim.report.common import as_toml

REPLICATES = 7813
SECONDS = 5.0
"""Length of a run."""
LEFT = 3
"""Number of parts that an almost finished study lacks."""
PAIRS = 6
"""Number of dry runs and continuations of it, in alternation."""


def described(replicates: int) -> str:
    """The study file."""
    shipped = resources.files("sblcosim.study") / "shipped" / "paper-scenario-1.toml"
    content = tomllib.loads(shipped.read_text("utf-8"))
    return as_toml({
        **content, "name": "large", "replicates": replicates,
        "fixed": {"time.duration_s": SECONDS},
    })


def measured(what: str, *arguments: str) -> float:
    """Run a command, and print its wall time and peak memory; returns its processor time [s]."""
    started = time.perf_counter()
    command = [sys.executable, "-m", "sblcosim", *arguments]
    child = os.posix_spawn(
        sys.executable, command, os.environ,
        file_actions=[(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)],
    )
    _, status, usage = os.wait4(child, 0)
    seconds = time.perf_counter() - started
    print(f"  {what:<34}{seconds:8.1f} s{usage.ru_utime + usage.ru_stime:8.1f} s of processors"
          f"{usage.ru_maxrss / 1024:8.0f} MiB", flush=True)
    if code := os.waitstatus_to_exitcode(status):
        sys.exit(code)
    return usage.ru_utime + usage.ru_stime


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--replicates", type=int, default=REPLICATES)
    arguments.add_argument("--folder", type=Path, default=Path("large-study"))
    given = arguments.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    file, runs, out = (given.folder / name for name in ("large.toml", "runs", "analysis"))
    file.write_text(described(given.replicates), "utf-8")

    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}: "
          f"128 points x {given.replicates} replicates")
    study = ("study", str(file), "--out", str(runs))
    measured("study, what is missing", *study)
    measured("study, finished", *study)

    number = len([*(runs / "parts").glob("*.parquet")])

    def almost(what: str, *options: str) -> float:
        """Remove some parts first, unless a dry run has left them missing."""
        for path in sorted((runs / "parts").glob("*.parquet"))[number - LEFT :]:
            path.unlink()
        return measured(what, *study, *options)

    carried, dry = alternated(
        partial(almost, f"study, almost finished ({LEFT} parts)"),
        partial(almost, "study --dry-run, almost finished", "--dry-run"),
        PAIRS,
    )
    print(f"  the dry run over carrying on: {ratio(carried, dry)}")
    measured("study, what is missing", *study)
    shutil.rmtree(out, ignore_errors=True)
    measured("analyse", "analyse", str(runs), "--out", str(out))
    measured("analyse --transform log", "analyse", str(runs), "--out", f"{out}-log",
             "--transform", "log")


if __name__ == "__main__":
    main()
