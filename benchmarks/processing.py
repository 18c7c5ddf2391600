"""Processor time of an hour of a device at 10 Hz: ``sblcosim process`` and a script of one's own.

The log is that of ``realistic-dive`` as a device would have written it: 36,000 pings and depths, no
packet lost, without a truth, settings and start. Each command is a program of its own, whose whole
processor time counts: from its start to tables and verdict in a folder. The bare start of the
program, ``sblcosim --version``, is given beside it. The competitor reads the tables with pandas and
estimates position and velocity with an extended Kalman filter in NumPy, a range or depth at a time:
no start of its own, no late ranges, no errors of the platform, no residuals, no tables. Then a log
with the first and the last ten minutes of this one and six hours of nothing between them, and a
receiver in Python.

Programs run in turn, so that a varying load affects all. Run by hand:
``python benchmarks/processing.py [--rounds 7]``
"""

from __future__ import annotations

import argparse
import shutil
import statistics
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import sblcosim
from alternating import of_program, ratio
from sblcosim.fmus.host.nanoseconds import SECOND

KEYS = {
    "time.sampling_time_s": 0.1, "time.duration_s": 3600.0, "acoustics.loss_probability": 0.0,
}
APART_S, PART_S = 6 * 3600, 600
SCRIPT = '''
import sys
import numpy as np, pandas as pd

folder = sys.argv[1]
heard, deep = pd.read_csv(f"{folder}/receptions.csv"), pd.read_csv(f"{folder}/depth.csv")
where = heard[["reported_n_m", "reported_e_m", "reported_d_m"]].to_numpy()
events = [(t, r, p) for t, r, p in zip(heard.epoch_ns, heard.range_m, where)]
events += [(t, d, None) for t, d in zip(deep.time_ns, deep.depth_m)]
x, P, before, track = np.array([-15.0, -20, 3, 0, 0, 0]), np.eye(6) * 25.0, 0, []
for t, value, place in sorted(events, key=lambda event: event[0]):
    h = (t - before) / 1e9
    before = t
    F = np.eye(6)
    F[:3, 3:] = h * np.eye(3)
    Q = 0.01 * np.block([[h**3 / 3 * np.eye(3), h**2 / 2 * np.eye(3)],
                         [h**2 / 2 * np.eye(3), h * np.eye(3)]])
    x, P = F @ x, F @ P @ F.T + Q
    H = np.zeros(6)
    if place is None:
        H[2], expected, R = 1.0, x[2], 0.05**2
    else:
        expected = np.linalg.norm(x[:3] - place)
        H[:3], R = (x[:3] - place) / expected, 0.3**2
    K = P @ H / (H @ P @ H + R)
    x, P = x + K * (value - expected), P - np.outer(K, H @ P)
    track.append((t, *x[:3]))
pd.DataFrame(track, columns=["time_ns", "n_m", "e_m", "d_m"]).to_csv(sys.argv[2], index=False)
'''
MINE = """
import sblcosim

class Last(sblcosim.Receiver):
    def update(self, samples):
        heard = [s for s in samples if isinstance(s, sblcosim.Range)]
        return sblcosim.Estimate(heard[-1].epoch, heard[-1].beacon_position) if heard else None
"""


def write_logs(folder: Path) -> tuple[Path, Path]:
    """The log of an hour, and that with a gap."""
    sblcosim.run("realistic-dive", "coupled", KEYS).save(folder / "run", figures=False, log=True)
    hour, gap = folder / "hour", folder / "gap"
    for log in (hour, gap):
        log.mkdir()
        (log / "meta.toml").write_text('title = "A device"\n')
    for name in ("receptions", "depth"):
        table = pd.read_csv(folder / "run" / "log" / f"{name}.csv")
        table = table.drop(columns=[c for c in table if c.startswith("packet_")])
        table.to_csv(hour / f"{name}.csv", index=False)
        late = table[table.iloc[:, 0] < 2 * PART_S * SECOND].copy()
        times = [c for c in table if c.endswith("_ns")]
        late.loc[late[times[0]] >= PART_S * SECOND, times] += APART_S * SECOND
        late.to_csv(gap / f"{name}.csv", index=False)
    return hour, gap


def programs(folder: Path, hour: Path, gap: Path) -> dict[str, Callable[[], float]]:
    """What is measured, by its name."""
    (folder / "mine.py").write_text(MINE)
    (folder / "script.py").write_text(SCRIPT)
    ours = shutil.which("sblcosim", path=str(Path(sys.executable).parent))
    assert ours is not None, "sblcosim must be installed beside this interpreter"

    def process(log: Path, *options: str) -> Callable[[], float]:
        return of_program([ours, "process", str(log), *options, "--force",
                           "--out", str(folder / "out")])

    bare, coupled = "--no-figures", ("--receiver", "coupled")
    return {
        "bare start of the program": of_program([ours, "--version"]),
        "script with pandas and NumPy": of_program(
            [sys.executable, str(folder / "script.py"), str(hour), str(folder / "track.csv")]
        ),
        "process --receiver coupled": process(hour, *coupled, bare),
        "process, the default receiver": process(hour, bare),
        "process, the same with figures": process(hour),
        "coupled and all others of ours": process(
            hour, *(f for r in sblcosim.receivers() for f in ("--receiver", r)), bare
        ),
        "coupled and one in Python": process(
            hour, *coupled, "--receiver", f"{folder / 'mine.py'}:Last", bare
        ),
        "coupled, 6 h of nothing in the log": process(gap, *coupled, bare),
    }


def main() -> None:
    arguments = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    arguments.add_argument("--rounds", type=int, default=7)
    rounds = arguments.parse_args().rounds
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        runs = programs(folder, *write_logs(folder))
        times: dict[str, list[float]] = {what: [] for what in runs}
        for i in range(rounds + 1):
            for what in (runs, reversed(runs))[i % 2]:
                seconds = runs[what]()
                if i:  # the first fills caches
                    times[what].append(seconds)
    start = times["bare start of the program"]
    print(f"{'processor time [s]':36} median  least  median beyond the bare start")
    for what, own in times.items():
        beyond = statistics.median(a - b for a, b in zip(own, start, strict=True))
        print(f"{what:36} {statistics.median(own):6.2f} {min(own):6.2f} {beyond:6.2f}")
    script, ours = times["script with pandas and NumPy"], times["process --receiver coupled"]
    print(f"process --receiver coupled over the script: {ratio(script, ours)}")


if __name__ == "__main__":
    main()
