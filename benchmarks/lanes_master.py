"""The lanes master: ns per step and run, compared with equivalent NumPy and Octave scripts.

All simulate the paper's Scenario 1 with `paper-literal` at T = 0.1 s on one core. Then the paper's
whole study (three scenarios, 128 points, 50 replicates) runs on one and on two threads. Run by
hand: ``python benchmarks/lanes_master.py [--quick] [--no-octave]``.
"""

from __future__ import annotations

import argparse
import itertools
import os
import platform
import shutil
import sys
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # one core for the competitors too

import numpy as np
import sblcosim
from alternating import ratio
from sblcosim.judge.definitions import PERCENTAGES
from sblcosim.results.sums import responses
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters import lanes
from sblcosim.simulation.plans.plan import Plan
from sblcosim.simulation.resolve import resolve
from sblcosim.simulation.system import Connection

HERE = Path(__file__).parent
FACTORS = list(
    itertools.product((0.4, 3.0), (0.1, 3.5), (1.0, 10.0), (0.01, 0.1), (0.1, 1.0), (0.0, 0.25))
)
"""Table 3 without the sampling time: baseline, GPS, IMU, depth sensor, range, packet loss."""
BATCH = 50
"""Number of replicates at a time."""
SEA = {"platform.motion": "spectrum", "platform.wave_height_m": 0.6,
       "platform.watch_circle_m": 3.0, "platform.wave_spreading_deg": 30.0}
PRIOR = [Connection("target.position", "ekf.prior_position")]


def plan_of(
    scenario: int, sampling_time: float, *, raw: bool = False, sea: Mapping[str, Any] | None = None
) -> Plan:
    """A scenario of the paper, with only its EKF, or also with the raw fix; in another sea."""
    changes = {"time.sampling_time_s": sampling_time, **(sea or {})}
    loaded = sblcosim.load(f"paper-scenario-{scenario}", changes)
    system = connect(loaded, "ekf")
    if raw:
        return resolve(system)
    return resolve(
        replace(
            system,
            components={k: v for k, v in system.components.items() if k != "raw"},
            connections=tuple(c for c in system.connections if not c.target.startswith("raw.")),
        )
    )


def variations(
    points: list[tuple[float, ...]], replicates: int, first: int = 0
) -> dict[str, np.ndarray]:
    """Parameters of all runs, each with its own seed; the first has seed ``first`` + 1."""
    arm, gps, imu, depth, ranging, loss = np.repeat(np.array(points), replicates, axis=0).T
    seeds = first + np.arange(1, len(arm) + 1)
    return {
        **{f"{name}.seed": seeds for name in ("target", "platform", "acoustics")},
        "platform.arm_length": arm,
        "platform.gps_horizontal_std": gps,
        "platform.imu_tilt_std": np.radians(imu),
        "platform.imu_heading_std": np.radians(imu),
        "target.depth_std": depth,
        "ekf.depth_std": depth,
        "acoustics.range_std": ranging,
        "ekf.range_std": ranging,
        "acoustics.loss_probability": loss,
    }


OWN = "the scenario's own values"


def one_core(repeats: int) -> dict[str, list[float]]:
    """Times [ns] per step and run for each number of lanes, one thread.

    Then with the largest number of lanes and only the seeds different: unchanged, with the
    percentiles of the errors, with the raw fix next to the filter (studies leave it out), and in a
    sea with a spectrum.
    """
    plan = plan_of(1, 0.1)
    given = variations(FACTORS, 8)
    steps = len(FACTORS) * 8 * (len(plan.instants) - 1)
    figures: dict[str, list[float]] = {}
    beside: dict[str, tuple[Plan, dict[str, tuple[int, ...]]]] = {
        OWN: (plan, {}),
        "the same with percentiles": (plan, {"percentages": PERCENTAGES}),
        "the same with the raw fix": (plan_of(1, 0.1, raw=True), {}),
        "the same in a spectrum": (plan_of(1, 0.1, sea=SEA), {}),
    }
    seeds = {"acoustics.seed": np.arange(len(FACTORS) * 8)}
    for turn in range(repeats):
        for number in (1, 2, 4, 8):
            started = time.perf_counter()
            try:
                lanes.execute(plan, given, handovers=PRIOR, lanes=number, threads=1)
            except sblcosim.FmuError:
                continue  # this processor does not support that many
            seconds = time.perf_counter() - started
            figures.setdefault(f"lanes, {number}", []).append(seconds / steps * 1e9)
        for name, (other, options) in [*beside.items()][:: -1 if turn % 2 else 1]:
            started = time.perf_counter()
            lanes.execute(other, seeds, handovers=PRIOR, threads=1, **options)
            seconds = time.perf_counter() - started
            figures.setdefault(name, []).append(seconds / steps * 1e9)
    return figures


def study(replicates: int, threads: int) -> tuple[float, int, list[float]]:
    """Seconds for the paper's three studies, their steps, and the mean RMS total error of each."""
    seconds, steps, means = 0.0, 0, []
    for scenario in (1, 2, 3):
        total, runs = 0.0, 0
        for sampling_time in (0.1, 1.0):
            plan = plan_of(scenario, sampling_time)
            # In batches, as in a campaign: memory does not grow with the replicates.
            for _ in range(0, replicates, BATCH):
                given = variations(FACTORS, min(BATCH, replicates), runs)
                started = time.perf_counter()
                outcome = lanes.execute(plan, given, handovers=PRIOR, threads=threads)
                seconds += time.perf_counter() - started
                table = responses(outcome.sums["ekf"], plan.stop_ns - plan.start_ns)
                total += float(table["absolute_total_rms_m"].sum())
                runs += len(table)
                steps += len(table) * (len(plan.instants) - 1)
        means.append(total / runs)
    return seconds, steps, means


def peak_memory() -> float:
    """Largest resident memory of this process so far, in MiB."""
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--quick", action="store_true", help="fewer repeats and replicates")
    arguments.add_argument("--no-octave", action="store_true")
    given = arguments.parse_args()
    sys.path.insert(0, str(HERE / "competitors"))
    import timing

    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, "
          f"NumPy {np.__version__}")
    print("\nOne core, Scenario 1, T = 0.1 s: ns per step and run")
    times = one_core(3 if given.quick else 7)
    figures = {name: min(values) for name, values in times.items()}
    for name, plain in (("NumPy over runs, tuned hard", False), ("NumPy over runs, plain", True)):
        figures[name] = timing.numpy_ns_per_step(given.quick, plain)
    if not given.no_octave and shutil.which("octave-cli"):
        figures["GNU Octave"] = timing.octave_ns_per_step(quick=given.quick)
    best = min(figures.values())
    for name, value in figures.items():
        print(f"  {name:<30}{value:>12.0f}{value / best:>10.1f} x")
    for name in ("the same with percentiles", "the same with the raw fix",
                 "the same in a spectrum"):
        print(f"  {name}: {ratio(times[OWN], times[name])}")

    replicates = 5 if given.quick else 50
    print(f"\nThe paper's study: 3 scenarios x 128 points x {replicates} replicates")
    for threads, number in ((1, replicates), (2, replicates), (2, 10 * replicates)):
        if number > replicates and given.quick:
            continue
        seconds, steps, means = study(number, threads)
        print(f"  {threads} thread(s), {number:>3} replicates: {seconds:6.2f} s for "
              f"{steps / 1e6:.1f} million steps; mean RMS total error "
              + ", ".join(f"{m:.3f}" for m in means)
              + f" m; peak memory {peak_memory():.0f} MiB")


if __name__ == "__main__":
    main()
