"""The explorer of a page in node: opening, a changed key with its dive, many dives, sizes.

Processor times in one thread, without the browser's drawing. Run by hand: ``python
benchmarks/explore.py``.
"""

from __future__ import annotations

import json
import subprocess
import tempfile
from pathlib import Path

import sblcosim
from sblcosim.explore.contents import contents
from sblcosim.explore.page import render

SCRIPT = Path(__file__).parents[1] / "orchestrator" / "explore" / "js" / "explorer.js"
HOST = """
import { readFileSync } from "node:fs";
const [script, repeats] = process.argv.slice(2);
const { Explorer } = await import(script);
const content = JSON.parse(readFileSync("contents.json", "utf8"));
async function cpu(work) {
  const before = process.cpuUsage();
  await work();
  const { user, system } = process.cpuUsage(before);
  return (user + system) / 1e3;
}
async function median(work) {
  const found = [];
  for (let i = 0; i < Number(repeats); i++) found.push(await cpu(() => work(i)));
  return found.sort((a, b) => a - b)[Math.floor(found.length / 2)];
}
const found = {};
let explorer;
found["opened, ms"] = await cpu(async () => { explorer = await Explorer.open(content); });
found["first dive, ms"] = await cpu(() => explorer.dive());
found["a key set, ms"] = await median((i) => explorer.set("acoustics.range_std_m", 0.1 + i / 1e3));
found["a key set and its dive, ms"] = await median((i) => {
  explorer.set("target.speed_m_s", 0.3 + i / 1e4);
  explorer.dive();
});
explorer.reset();
const KINDS = { "q learned": {}, "q given": { "receiver.acceleration_psd_m2_s3": 0.01 } };
for (const [name, given] of Object.entries(KINDS)) {
  explorer.apply({ given });
  await explorer.dives(64);
  const taken = await cpu(() => explorer.dives(512));
  found[`coupled and raw, ${name}, dives per s`] = 512 / taken * 1e3;
}
explorer.reset();
const paper = await Explorer.open(JSON.parse(readFileSync("paper.json", "utf8")));
await paper.dives(64);
found["ekf, Scenario 1 of the paper, dives per s"] =
  512 / await cpu(() => paper.dives(512)) * 1e3;
found["causes of 128 dives each, s"] = await cpu(() => explorer.causes()) / 1e3;
console.log(JSON.stringify(found));
"""
REPEATS = 40


def main() -> None:
    """Print the table."""
    told = contents(sblcosim.load("realistic-dive"), beacons=range(3, 9))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "contents.json").write_text(json.dumps(told))
        paper = contents(sblcosim.load("paper-scenario-1"), ("ekf",), beacons=[4])
        (folder / "paper.json").write_text(json.dumps(paper))
        (folder / "host.mjs").write_text(HOST)
        done = subprocess.run(
            ["node", "--experimental-default-type=module", "host.mjs", SCRIPT, str(REPEATS)],
            cwd=folder, check=True, capture_output=True, text=True,
        )  # fmt: skip
    for what, value in json.loads(done.stdout).items():
        print(f"{what:45} {value:8.3g}")
    size = len(render(told).encode())
    print(f"{'page for 3 to 8 beacons, MB':45} {size / 1e6:8.3g}")


if __name__ == "__main__":
    main()
