"""Maps of an area: wall and processor time of 3,600 cells of 20 runs of 60 s, part by part.

``realistic-dive`` with `coupled`, at T = 1 s and T = 0.1 s, without and with a requirement (a
second round of runs), and the figures. Run by hand: ``python benchmarks/areas.py [--quick]``.
"""

from __future__ import annotations

import argparse
import os
import platform
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import sblcosim
from sblcosim.areas import motion
from sblcosim.areas.grid import grid_of
from sblcosim.areas.possible import possible
from sblcosim.limits.places import still_beacons


def timed(what: str, function: Callable[[], Any]) -> Any:
    wall, processor = time.perf_counter(), time.process_time()
    result = function()
    wall, processor = time.perf_counter() - wall, time.process_time() - processor
    print(f"  {what:40} {wall:6.1f} s, of processors {processor:6.1f} s", flush=True)
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="20 x 20 cells")
    cells = 20 if parser.parse_args().quick else 60
    print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, {cells}² cells")
    sblcosim.map_area("realistic-dive", "60x60", 5.0, cells=4)  # builds and imports
    for interval in (1.0, 0.1):
        given = sblcosim.load("realistic-dive", {"time.sampling_time_s": interval})
        print(f"T = {interval:g} s")
        circle = motion.circle_of(given, motion.RADIUS, None, 60.0)
        moving = motion.circling(given, circle, 5.0, 60.0)
        grid = grid_of("60x60", 5.0, cells, still_beacons(given).mean(0)[:2].tolist())
        timed("what is possible", partial(
            possible, moving, grid, circle, "absolute_total", (20.0, 60.0)
        ))
        mapped = partial(sblcosim.map_area, given, "60x60", 5.0, cells=cells)
        timed("runs, what is possible, pooling", mapped)
        found = timed("the same with a requirement of 5 m", partial(mapped, limit_m=5.0))
        with tempfile.TemporaryDirectory() as folder:
            timed("table and figures", partial(found.save, Path(folder) / "map"))


if __name__ == "__main__":
    main()
