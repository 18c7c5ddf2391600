"""Cost of an update of each receiver: ns per packet and run in lanes, code and state.

A run of the paper's Scenario 1 at T = 0.1 s without loss and without its start, with a receiver,
minus the same without any; the smallest of several, on one core. Code is that of the equations and
the engine for one lane, for a Cortex-M7 (zig) and for this machine. State is the memory of an
instance. Then the cost of the raw fix next to a filter: a step of a whole run in eight lanes with
and without it, in turn, ten times: the smallest time, and the ratio with its interval. Run by hand:
``python benchmarks/receivers.py [--quick]``.
"""

from __future__ import annotations

import argparse
import ctypes
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import sblcosim
from alternating import Ratio, alternated, of_call, ratio
from sblcosim.fmus.build.c_files import c_files
from sblcosim.fmus.build.factory import engine_sources
from sblcosim.models.loading import load
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters import lanes
from sblcosim.simulation.masters.lanes_driver import engine_of
from sblcosim.simulation.plans.plan import Plan
from sblcosim.simulation.resolve import resolve

RECEIVERS = ("multilateration", "ekf", "sequential", "coupled", "fixed_lag")
M7 = ("-target", "thumb-freestanding-eabihf", "-mcpu=cortex_m7+fp_armv8d16")
SETTLED_S = 5.0
FREESTANDING = {"string.h": b"""#include <stddef.h>
#define memcpy __builtin_memcpy
#define memset __builtin_memset
"""}


def plan_of(receiver: str | None, duration_s: float, raw: bool = False) -> Plan:
    """Scenario 1 with one receiver, or with none; with or without the raw fix."""
    scenario = sblcosim.load("paper-scenario-1", {"time.duration_s": duration_s})
    system = connect(scenario, receiver or "ekf")
    dropped = {"raw"} if receiver not in (None, "multilateration") and not raw else set()
    if receiver is None:
        dropped = {"raw", "ekf"}
    return resolve(replace(
        system,
        components={k: v for k, v in system.components.items() if k not in dropped},
        connections=tuple(
            c for c in system.connections if c.target.partition(".")[0] not in dropped
        ),
    ))


def seconds(plan: Plan, number: int, runs: int) -> float:
    """Processor time of all runs, one thread."""
    started = time.process_time()
    lanes.execute(plan, {"acoustics.seed": np.arange(runs)}, lanes=number, threads=1)
    return time.process_time() - started


def cost(receiver: str, number: int, runs: int, repeats: int) -> float:
    """ns per packet and run: a long run minus a short one, minus the same without receiver."""
    plans = {
        (name, end): plan_of(name, end)
        for name in (receiver, None) for end in (SETTLED_S, SETTLED_S + 60.0)
    }
    least = dict.fromkeys(plans, np.inf)
    for _ in range(repeats):
        for key, plan in plans.items():
            least[key] = min(least[key], seconds(plan, number, runs))
    short, long = SETTLED_S, SETTLED_S + 60.0
    own, others = (least[name, long] - least[name, short] for name in (receiver, None))
    packets = len(plans[None, long].instants) - len(plans[None, short].instants)
    return (own - others) / packets / runs * 1e9


def beside_a_filter(runs: int) -> tuple[float, float, Ratio]:
    """Smallest ns per step and run without the raw fix and with it, and the ratio."""
    plans = [plan_of("ekf", 60.0, raw) for raw in (False, True)]
    both = [of_call(partial(seconds, plan, 8, runs)) for plan in plans]
    for call in both:  # builds
        call()
    times = alternated(*both, 10)
    alone, beside = (1e9 * min(t) / len(plans[0].instants) / runs for t in times)
    return alone, beside, ratio(*times)


def code_size(receiver: str, *flags: str) -> str:
    """Bytes of code and constants of the engine for one lane; a dash without ``llvm-size``."""
    tool = shutil.which("llvm-size")
    if tool is None:
        return "-"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        sources = {
            **engine_sources(load(receiver)), **c_files(("lanes.c", "lanes.h")), **FREESTANDING,
        }
        for file, text in sources.items():
            (folder / file).write_bytes(text)
        command = [
            sys.executable, "-m", "ziglang", "cc", "-std=c11", "-Os", "-ffp-contract=off",
            "-fno-math-errno", "-ffreestanding", "-DLANES=1", *flags, "-I", name, "-c", "lanes.c",
            "-o", "lanes.o",
        ]
        subprocess.run(command, check=True, cwd=folder)
        sizes = subprocess.run(
            [tool, "-A", "lanes.o"], check=True, cwd=folder, capture_output=True, text=True
        ).stdout
    rows = (line.split() for line in sizes.splitlines())
    return str(sum(int(row[1]) for row in rows if row and row[0].startswith((".text", ".rodata"))))


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--quick", action="store_true", help="fewer runs and repeats")
    quick = arguments.parse_args().quick
    print(f"{'receiver':<17}{'8 lanes':>10}{'1 lane':>10}{'state':>10}{'M7 code':>10}{'here':>10}")
    print(f"{'':<17}{'ns':>10}{'ns':>10}{'bytes':>10}{'bytes':>10}{'bytes':>10}")
    for name in RECEIVERS:
        figures = [cost(name, n, 64 if quick else 256, 3 if quick else 15) for n in (8, 1)]
        component = next(c for c in plan_of(name, 1.0).components if c.name == name)
        state = ctypes.c_uint32(engine_of(component, 1).contents.block_size).value
        print(f"{name:<17}{figures[0]:>10.0f}{figures[1]:>10.0f}{state:>10}"
              f"{code_size(name, *M7):>10}{code_size(name):>10}", flush=True)
    alone, beside, times = beside_a_filter(64 if quick else 256)
    print(f"ekf alone {alone:.0f} ns a step, with the raw fix {beside:.0f} ns: {times}")


if __name__ == "__main__":
    main()
