"""Dives of many kinds, none of them the paper's own, and how receivers do in them.

``python tests/physics/dives.py`` prints the table of `models/receiver/dives.md`, in a few minutes,
and with ``--particles`` that of a particle filter beside `coupled`, in half an hour.
Cells with beacons on the bottom or below buoys have `long_baseline`, all others `coupled`.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from math import cos, pi, sin
from typing import Any

import numpy as np
import sblcosim
from sblcosim.judge.over_runs import pooled
from sblcosim.results.sums import responses
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters.lanes import execute
from sblcosim.simulation.resolve import resolve
from sblcosim.simulation.system import Connection

GIVEN = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3)
LEARNED = -1.0
COMPONENTS = ("target", "platform", "acoustics")
SENSORS = {"imu_heading_std_deg": 0.5, "imu_heading_turn_on_std_deg": 2.0, "imu_tilt_std_deg": 0.5}
CHANNEL = {
    "range_std_m": 0.1, "outlier_probability": 0.05, "outlier_mean_m": 1.0,
    "clock_offset_std_s": 1e-4, "clock_drift_std_s_s": 5e-7, "sound_speed_m_s": 1520.0,
    "assumed_sound_speed_m_s": 1500.0,
}
CORNERS = [
    [-15.0, -20.0, 3.0], [15.0, -20.0, 4.0], [15.0, -5.0, 5.0], [-15.0, -5.0, 5.0],
    [-15.0, 10.0, 6.0], [0.0, 10.0, 6.0], [0.0, 20.0, 8.0], [20.0, 20.0, 8.0],
]


def ring(beacons: int, radius: float, irregular: float = 0.0) -> list[list[float]]:
    """Beacons about the platform, each shifted at random by up to half of its arm."""
    rng = np.random.default_rng(beacons)
    rows = []
    for angle in np.arange(beacons) * 2 * pi / beacons:
        n, e = (1 + irregular * rng.uniform(-0.5, 0.5) for _ in range(2))
        rows.append([radius * cos(angle) * n, radius * sin(angle) * e,
                     0.5 + irregular * rng.uniform(-0.3, 0.3)])
    return rows


def turning(speed: float, box: float, leg: float, depth: Sequence[float]) -> dict[str, Any]:
    """A path with a turn after each leg, at constant speed."""
    return {"trajectory": "random_path", "speed_m_s": speed, "box_m": [box, box],
            "leg_length_m": leg, "path_length_m": 5000.0, "depth_start_m": depth[0],
            "depth_end_m": depth[1], "depth_std_m": 0.05}


def dive(
    target: Mapping[str, Any], beacons: Sequence[Any], gps: str, duration: float | str = 300.0,
    beaufort: int = 2, **acoustics: Any,
) -> dict[str, Any]:
    """A scenario of errors as they are bought."""
    return {
        "time": {"sampling_time_s": 1.0, "duration_s": duration}, "target": dict(target),
        "platform": {"beacon_m": beacons, "beaufort": beaufort, "random_phases": True,
                     "gps_grade": gps, **SENSORS},
        "acoustics": {"loss_probability": 0.25, **CHANNEL, **acoustics}, "receiver": {},
    }


def paper(**changes: Any) -> tuple[str, dict[str, Any]]:
    """A variant of the paper's Scenario 1."""
    keys = {"T": "time.sampling_time_s", "loss": "acoustics.loss_probability",
            "arm": "platform.arm_length_m", "range": "acoustics.range_std_m",
            "late": "acoustics.outlier_probability", "excess": "acoustics.outlier_mean_m",
            "gps": "platform.gps_horizontal_std_m"}
    return "paper-scenario-1", {keys[name]: value for name, value in changes.items()}


OWN = {"packet_content": "own_beacon"}
FAST = dive(turning(2.0, 60.0, 60.0, (8.0, 8.0)), ring(6, 4.0), "sbas", loss_probability=0.2,
            packet_content="pose", packet_bits=80)
FAST["receiver"] = {"speed_limit_m_s": 5.0}
AT_REST = {"trajectory": "straight_line", "speed_m_s": 0.0, "center_m": [20.0, 5.0],
           "depth_start_m": 60.0, "depth_std_m": 0.05}
CELLS: dict[str, tuple[Any, dict[str, Any]]] = {
    "realistic-dive": ("realistic-dive", {}),
    "favourable": paper(),
    "favourable, late": paper(late=0.1, excess=3.0),
    "short arms": paper(arm=0.4, T=1.0, loss=0.25),
    "short arms, poor ranges": paper(arm=0.4, range=1.0),
    "poor GPS": paper(gps=3.5, T=1.0, loss=0.25),
    "poor ranges, loss": paper(range=1.0, T=1.0, loss=0.5),
    "late": paper(T=1.0, late=0.1, excess=3.0),
    "3, own positions, at once": (dive(
        turning(0.3, 20.0, 15.0, (8.0, 8.0)), ring(3, 3.0), "sbas", schedule="simultaneous",
        packet_resolution_m=0.1, **OWN,
    ), {}),
    "3, spiral, loss": (dive(
        {"trajectory": "spiral", "speed_m_s": 0.5, "spiral_radius_m": [2.0, 25.0], "turns": 3.0,
         "depth_start_m": 5.0, "depth_end_m": 12.0, "depth_std_m": 0.05},
        ring(3, 5.0), "sbas", loss_probability=0.85,
    ), {}),
    "4, close in": (dive(
        turning(0.3, 8.0, 8.0, (3.0, 5.0)), ring(4, 1.5), "rtk_float", beaufort=1,
        loss_probability=0.1, packet_resolution_m=0.2, **OWN,
    ), {}),
    "4, corners, loss": (dive(
        {"trajectory": "waypoints", "waypoint_m": CORNERS, "speed_m_s": 0.6, "depth_std_m": 0.05},
        ring(4, 3.0), "standalone", "path", loss_probability=0.6,
    ), {}),
    "4, slow turns": (dive(
        turning(0.25, 25.0, 8.0, (10.0, 10.0)), ring(4, 3.0), "rtk_float"), {}),
    "5, irregular": (dive(
        turning(0.6, 25.0, 8.0, (10.0, 10.0)), ring(5, 3.0, 1.0), "rtk_float"), {}),
    "6, fast": (FAST, {}),
    "8, at rest": (dive(AT_REST, ring(8, 4.0), "standalone"), {}),
}
SQUARE = [[40.0, 40.0, 20.0], [40.0, -40.0, 20.0], [-40.0, -40.0, 21.0], [-40.0, 40.0, 19.0]]
CORNER = [[0.0, 0.0, 20.0], [80.0, 0.0, 20.0], [0.0, 80.0, 20.0]]
ROW = [[50.0, 0.0, 20.0], [0.0, 8.0, 20.0], [-50.0, 0.0, 21.0]]
"""The diver begins on the line, and which side he goes to is hardly seen."""
TRIANGLE = [[50.0, 0.0, 20.0], [-25.0, 43.0, 20.0], [-25.0, -43.0, 21.0]]
WHITE = {"trajectory": "white_noise_acceleration", "acceleration_psd_m2_s3": 0.01,
         "initial_position_m": [0.0, 5.0, 8.0], "initial_position_std_m": 5.0,
         "initial_velocity_std_m_s": 0.2, "depth_std_m": 0.05}
SPIRAL = CELLS["3, spiral, loss"][0]["target"]


def bottom(
    target: Mapping[str, Any], beacons: Sequence[Any], **acoustics: Any
) -> tuple[Any, dict[str, Any]]:
    """A dive above beacons that were surveyed to half a metre."""
    made = dive(target, beacons, "standalone", **acoustics)
    made["platform"] = {"beacon_m": beacons, "mounting_std_m": 0.5}
    return made, {}


FIELDS: dict[str, tuple[Any, dict[str, Any]]] = {
    "harbour-lbl": ("harbour-lbl", {}),
    "harbour-lbl, narrow": ("harbour-lbl", {"acoustics.range_std_m": 0.02}),
    "gps-buoys": ("gps-buoys", {}),
    "bottom, 4, white": bottom(WHITE, SQUARE),
    "bottom, 3, white": bottom(WHITE, TRIANGLE),
    "bottom, 3, slow white": bottom({**WHITE, "acceleration_psd_m2_s3": 0.002}, TRIANGLE),
    "bottom, 4, turns": bottom(turning(0.6, 60.0, 15.0, (10.0, 10.0)), SQUARE),
    "bottom, 3, turns": bottom(turning(0.6, 60.0, 15.0, (10.0, 10.0)), TRIANGLE),
    "bottom, 4, spiral": bottom(SPIRAL, SQUARE),
    "bottom, 3, spiral": bottom(SPIRAL, TRIANGLE),
    "bottom, 3, white, loss": bottom(WHITE, TRIANGLE, loss_probability=0.6),
    "bottom, 3 in a corner, loss": bottom(WHITE, CORNER, loss_probability=0.6),
    "bottom, 3 nearly on a line": bottom(WHITE, ROW),
    "bottom, 3 nearly on a line, turns": bottom(turning(0.6, 60.0, 15.0, (10.0, 10.0)), ROW),
}
"""Cells of `long_baseline`."""
CELLS |= FIELDS
HARD = ("3, spiral, loss", "3, own positions, at once", *(n for n in FIELDS if "3" in n))
"""Cells with three beacons, or with losses above 0.7."""


def scenario_of(name: str) -> sblcosim.Scenario:
    """The scenario of a cell."""
    source, changes = CELLS[name]
    source = source if isinstance(source, str) else {"name": "cell", **deepcopy(source)}
    return sblcosim.load(source, changes)


def receiver_of(name: str) -> str:
    """The receiver that is made for the cell's beacons."""
    return "long_baseline" if name in FIELDS else "coupled"


def cell(
    name: str, runs: int, first: int = 1, receiver: str | None = None, **varied: float
) -> Any:
    """A table of responses, a row for each run.

    Parameters
    ----------
    runs, first
        Number of runs, and the seed of the first; their seeds follow each other.
    receiver
        Which one; None: `receiver_of`.
    varied
        Its parameters that are not those of the scenario.
    """
    scenario = scenario_of(name)
    receiver = receiver or receiver_of(name)
    plan = resolve(connect(scenario, receiver))
    seeds = {f"{component}.seed": np.arange(first, first + runs) for component in COMPONENTS}
    prior = ([Connection("target.position", f"{receiver}.prior_position")] if scenario.true_prior
             else [])
    given = {f"{receiver}.{key}": np.array([value]) for key, value in varied.items()}
    outcome = execute(plan, {**seeds, **given}, handovers=prior)
    return responses(outcome.sums[receiver], plan.stop_ns - plan.start_ns)


def judged(table: Any) -> tuple[float, float, float]:
    """RMS error [m] over the runs, mean NEES, and share of runs with a NEES above 15."""
    return (pooled(table.absolute_total_rms_m), float(table.nees_position.mean()),
            float((table.nees_position > 15).mean()))


# --- The page ------------------------------------------------------------------------------------

HEAD = ("dive", "possible", "`ekf`", "best q", "its RMS", "learned / best", "RMS", "median",
        "worst", "NEES", "> 15", "> 20 s", "`watch`: RMS", "> 15", "> 20 s")
PARTICLES, OTHERS = 10_000, 6
"""Of the particle filter, and runs of each cell that are not wrong."""
LONG_S = 20.0
"""A run is beyond its claim for long above this many seconds without a break."""


def possible(name: str, runs: int = 20) -> float:
    """RMS [m] of what `sblcosim.limits` calls possible at the estimates, over some runs."""
    found = []
    for seed in range(1, runs + 1):
        run = sblcosim.run(scenario_of(name), receiver_of(name), {"seed": seed})
        found.append(run.verdicts[receiver_of(name)].absolute_rms)
    return pooled(np.array(found))


def tails(table: Any) -> tuple[str, str]:
    """Shares of runs in per cent: with a NEES above 15, and beyond their claim for long."""
    shares = (table.nees_position > 15, table.beyond_claim_longest_s > LONG_S)
    above, long = (f"{100 * float(share.mean()):.2g}" for share in shares)
    return above, long


def two(value: float) -> str:
    """Two digits, without an exponent."""
    rounded = float(f"{value:.2g}")
    return f"{rounded:,.0f}" if rounded >= 100 else f"{rounded:g}"


def row(name: str, runs: int, many: int) -> tuple[str, ...]:
    """Cells of a row of the page.

    Parameters
    ----------
    runs, many
        Number of runs for averages, and for learned motion and its tails.
    """
    given = {q: judged(cell(name, runs, acceleration_psd=q)) for q in GIVEN}
    best = min(given, key=lambda q: given[q][0])
    ratio = judged(cell(name, runs, acceleration_psd=LEARNED))[0] / given[best][0]
    ekf = judged(cell(name, runs, receiver="ekf"))
    mine = cell(name, many, 10_001, acceleration_psd=LEARNED)
    rms, nees, _ = judged(mine)
    each = mine.absolute_total_rms_m
    watched: tuple[str, ...] = ("–", "–", "–")
    if name not in FIELDS:
        table = cell(name, many, 10_001, acceleration_psd=LEARNED, watch=1.0)
        watched = (f"{judged(table)[0]:.3g}", *tails(table))
    return (
        name, f"{possible(name):.3g}", f"{ekf[0]:.3g} ({two(ekf[1])})", f"{best:g}",
        f"{given[best][0]:.3g} ({two(given[best][1])})", f"{ratio:.2f}", f"{rms:.3g}",
        f"{each.median():.3g}", f"{each.max():.3g}", two(nees), *tails(mine), *watched,
    )


def filtered_twice(name: str, seeds: Sequence[int]) -> Any:
    """RMS errors [m] and mean NEES of `coupled` and of a particle filter, (seeds, 4)."""
    rows = []
    for seed in seeds:
        run = sblcosim.run(
            scenario_of(name), "coupled",
            {"seed": seed, "receiver.acceleration_psd_m2_s3": "learned"},
        )
        found = sblcosim.research.particle_filter(run, particles=PARTICLES)
        errors = found.errors.xs("total", level="axis").xs("absolute", level="frame").rms_m
        both = ("coupled", "particle_filter")
        rows.append([*(errors[it] for it in both),
                     *(found.consistency[it]["absolute"].mean_nees for it in both)])
    return np.reshape(rows, (-1, 4))


def beside(name: str, many: int) -> tuple[str, ...]:
    """Cells of a row of the page's table of particles: runs with a NEES above 15, and others."""
    above = cell(name, many, 10_001, acceleration_psd=LEARNED).nees_position.to_numpy() > 15
    bad = (10_001 + np.flatnonzero(above)).tolist()
    others = (10_001 + np.flatnonzero(~above))[:OTHERS].tolist()
    cells = [name, str(len(bad))]
    for rows in (filtered_twice(name, bad), filtered_twice(name, others)):
        rms, rms_of_particles = (f"{pooled(rows[:, i]):.3g}" if len(rows) else "–" for i in (0, 1))
        cells += [rms, rms_of_particles, str(int((rows[:, 3] > 15).sum())) if len(rows) else "–"]
    return tuple(cells)


def table(names: Sequence[str], runs: int, many: int) -> Iterator[str]:
    """Lines of the page's table, in Markdown."""
    yield f"| {' | '.join(HEAD)} |"
    yield "|---" + "|---:" * (len(HEAD) - 1) + "|"
    for name in names:
        yield f"| {' | '.join(row(name, runs, many))} |"


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--runs", type=int, default=400)
    arguments.add_argument("--many", type=int, default=2000)
    arguments.add_argument("names", nargs="*", metavar="DIVE", help="default: all")
    arguments.add_argument("--particles", action="store_true")
    given = arguments.parse_args()
    if given.particles:
        for name in given.names or [it for it in CELLS if it not in FIELDS]:
            print(f"| {' | '.join(beside(name, given.many))} |", flush=True)
        return
    for line in table(given.names or [*CELLS], given.runs, given.many):
        print(line, flush=True)


if __name__ == "__main__":
    main()
