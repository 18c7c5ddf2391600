"""Maps of an area: wall and processor time of 3,600 cells of 20 runs of 60 s, part by part.

``realistic-dive`` with `coupled`, at T = 1 s and T = 0.1 s, without and with a requirement (a
second round of runs), and the figures. Also what is possible, compared with the same on NumPy, on
one thread. Run by hand: ``python benchmarks/areas.py [--quick]``.
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

import numpy as np
import sblcosim
from alternating import alternated, of_call, ratio
from competitors import numpy_bound
from sblcosim.areas import motion
from sblcosim.areas.grid import grid_of
from sblcosim.areas.possible import possible
from sblcosim.limits import places, recursion
from sblcosim.limits.parameters import model_of
from sblcosim.limits.path import circle_psd
from sblcosim.limits.places import still_beacons


def timed(what: str, function: Callable[[], Any]) -> Any:
    wall, processor = time.perf_counter(), time.process_time()
    result = function()
    wall, processor = time.perf_counter() - wall, time.process_time() - processor
    print(f"  {what:40} {wall:6.1f} s, of processors {processor:6.1f} s", flush=True)
    return result


def compared(moving: Any, circle: Any, grid: Any) -> None:
    """The recursion of all cells in C and on NumPy, and their difference."""
    span_s = (20.0, 60.0)
    model = model_of(moving, 0.0)
    epochs = places.epochs_of(moving, model, span_s[1])
    end_s = np.cumsum(epochs.step_s)
    position = np.stack([circle.position(grid.centres, t) for t in end_s.tolist()])
    q = circle_psd(circle.speed, circle.radius, places.noise_densities(moving, grid.centres), 60.0)
    given = (model, epochs, position, q, np.array([len(end_s) // 2, len(end_s) - 1]))
    both = [partial(each.covariances, *given) for each in (numpy_bound, recursion)]
    numpy, c = alternated(*map(of_call, both), 6)
    print(f"  the recursion on one thread, least: NumPy {min(numpy):.2f} s, C {min(c):.2f} s")
    print(f"  C/NumPy: {ratio(numpy, c)}")
    theirs, ours = (call() for call in both)
    traces = (np.trace(P, axis1=2, axis2=3) for pair in (ours, theirs) for P in pair)
    a, b, c, d = traces
    print(f"  they differ by {max(abs(a / c - 1).max(), abs(b / d - 1).max()):.0e}")


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
        compared(moving, circle, grid)
        mapped = partial(sblcosim.map_area, given, "60x60", 5.0, cells=cells)
        timed("runs, what is possible, pooling", mapped)
        found = timed("the same with a requirement of 5 m", partial(mapped, limit_m=5.0))
        with tempfile.TemporaryDirectory() as folder:
            timed("table and figures", partial(found.save, Path(folder) / "map"))


if __name__ == "__main__":
    main()
