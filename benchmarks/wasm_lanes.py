"""Whole simulations as WebAssembly in node: processor time against the lanes master, and sizes.

Both run the same seeds, one run or two side by side, in one thread, with percentiles of the errors.
Run by hand: ``python benchmarks/wasm_lanes.py [--quick]``.
"""

from __future__ import annotations

import argparse
import gzip
import json
import shutil
import statistics
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import sblcosim
from alternating import alternated, ratio
from sblcosim.judge.definitions import PERCENTAGES
from sblcosim.models import RECEIVERS
from sblcosim.prepare.scenario import of_scenario
from sblcosim.scenario import starts
from sblcosim.simulation.masters import lanes
from sblcosim.wasm import modules, plans

CASES: dict[str, tuple[str, str, dict[str, Any]]] = {
    "Scenario 1 at 0.1 s, ekf": ("paper-scenario-1", "ekf", {"time.sampling_time_s": 0.1}),
    "realistic dive, coupled, acceleration given": (
        "realistic-dive", "coupled", {"receiver.acceleration_psd_m2_s3": 0.01}
    ),
    "realistic dive, coupled, acceleration learned": (
        "realistic-dive", "coupled", {"receiver.acceleration_psd_m2_s3": "learned"}
    ),
    "realistic dive, fixed_lag": ("realistic-dive", "fixed_lag", {}),
}
HOST = """
import { readFileSync } from "node:fs";
import { createInterface } from "node:readline";
import { Engine, Plan } from "./engine.mjs";
const began = performance.now();
const engine = await Engine.load(readFileSync("module.wasm"));
const plan = new Plan(JSON.parse(readFileSync("plan.json")),
  new Uint8Array(readFileSync("plan.bin")).buffer);
const percentages = JSON.parse(process.argv[2]);
const ready = performance.now() - began;
engine.record(plan, 1);
const first = performance.now() - began;
for await (const line of createInterface({ input: process.stdin })) {
  const seeds = Array.from({ length: Number(line) }, (_, i) => i + 1);
  const before = process.cpuUsage(), from = performance.now();
  engine.run(plan, seeds, percentages);
  const { user, system } = process.cpuUsage(before), wall = performance.now() - from;
  const start = performance.now();
  engine.record(plan, 1);
  const record = performance.now() - start, memory = engine.wasm.memory.buffer.byteLength;
  console.log(JSON.stringify({ cpu: (user + system) / 1e6, wall, ready, first, record, memory }));
}
"""


class Node:
    """A process of node with a module and a plan."""

    def __init__(self, module: Path, plan: plans.WasmPlan, folder: Path) -> None:
        shutil.copy(modules.SCRIPT, folder / "engine.mjs")
        shutil.copy(module, folder / "module.wasm")
        (folder / "plan.json").write_text(plan.text)
        (folder / "plan.bin").write_bytes(plan.content)
        (folder / "host.mjs").write_text(HOST)
        self.last: dict[str, float] = {}
        self._process = subprocess.Popen(
            ["node", "host.mjs", json.dumps(PERCENTAGES)], cwd=folder, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )

    def run(self, runs: int) -> float:
        """Processor time of some runs [s]."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(f"{runs}\n")
        self._process.stdin.flush()
        self.last = json.loads(self._process.stdout.readline())
        return self.last["cpu"]

    def close(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


def compared(name: str, number: int, runs: int, pairs: int) -> None:
    """Print the ratio of times of one case, and what one worker does."""
    scenario_name, receiver, changes = CASES[name]
    scenario = sblcosim.load(scenario_name, changes)
    prepared = of_scenario(scenario, receiver)
    components, labels = prepared.system.components, prepared.description.receivers
    seeds = {
        f"{it}.seed": np.arange(1, runs + 1)
        for it in starts.seeded(scenario, components, labels)
    }
    handovers = starts.handovers(scenario, components, labels)

    def native() -> float:
        began = time.process_time()
        lanes.execute(
            prepared.plan, seeds, handovers=handovers, percentages=PERCENTAGES, lanes=number,
            threads=1,
        )
        return time.process_time() - began

    with tempfile.TemporaryDirectory() as folder:
        node = Node(
            modules.module((), scenario.beacons, number), plans.plan_of(scenario, receiver),
            Path(folder),
        )
        for _ in range(3):  # the compiler of node improves what it runs
            native(), node.run(runs)
        times = alternated(native, lambda: node.run(runs), pairs)
        node.close()
    found, usual = (runs / statistics.median(each) for each in reversed(times))
    last = node.last
    print(f"{name}, {number} side by side: wasm/native {ratio(*times)}\n"
          f"    {found:.0f} runs per second of processor time (best {runs / min(times[1]):.0f}), "
          f"native {usual:.0f}; one run with its record {last['record']:.1f} ms, the first one "
          f"{last['first']:.0f} ms after the start; memory {last['memory'] / 1e6:.1f} MB",
          flush=True)


def sizes() -> None:
    """Print the sizes of modules for four beacons."""
    print("\nSizes for four beacons, raw / compressed [kB]: one run, two side by side")
    kinds = [("all receivers", ()), *((name, (name,)) for name in RECEIVERS)]
    for name, receivers in kinds:
        contents = [modules.module(receivers, 4, n).read_bytes() for n in (1, 2)]
        texts = [f"{len(c) / 1e3:5.0f} / {len(gzip.compress(c, 9)) / 1e3:4.0f}" for c in contents]
        print(f"  {name:<16} {'    '.join(texts)}")


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--quick", action="store_true", help="fewer pairs")
    given = arguments.parse_args()
    for name in CASES:
        for number in (1, 2):
            compared(name, number, 100, 6 if given.quick else 15)
    sizes()


if __name__ == "__main__":
    main()
