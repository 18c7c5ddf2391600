"""Learned motion in dives of many kinds: beside given densities, and its tail.

Cells with beacons on the bottom or below buoys have `long_baseline`, all others `coupled`.

Whoever gives q does not know the best one; it is different in each of these cells.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from math import cos, pi, sin
from typing import Any

import numpy as np
import pytest
import sblcosim
from sblcosim import limits
from sblcosim.judge.over_runs import pooled
from sblcosim.models.receiver import bank
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
ALLOWED = {"short arms, poor ranges": 0.04, "bottom, 3 nearly on a line": 0.02}
"""Share of runs with a NEES above 15, where it is not that of all cells."""
QUICK = ("short arms", "late", "4, slow turns", "bottom, 4, white", "bottom, 3, turns")


def cell(name: str, runs: int, first: int = 1, **varied: float) -> Any:
    """A table of responses, a row for each run."""
    source, changes = CELLS[name]
    source = source if isinstance(source, str) else {"name": "cell", **deepcopy(source)}
    scenario = sblcosim.load(source, changes)
    receiver = "long_baseline" if name in FIELDS else "coupled"
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


def beside_given(name: str, runs: int) -> None:
    """Compare learned motion with each given density."""
    rms, nees, bad = judged(cell(name, runs, acceleration_psd=LEARNED))
    given = {q: judged(cell(name, runs, acceleration_psd=q)) for q in GIVEN}
    best = min(given, key=lambda q: given[q][0])
    print(f"{name}: {rms:.3f} m, {rms / given[best][0]:.3f} of q = {best}; NEES {nees:.2f} "
          f"({given[best][1]:.2f}); above 15: {100 * bad:.2f} % ({100 * given[best][2]:.2f} %)")
    # At the favourable point nothing but the smallest q is good; short arms with poor ranges hardly
    # tell one q from another. With narrow ranges a turn and the lane after it want different q.
    hard = ("favourable", "short arms, poor ranges", "harbour-lbl, narrow")
    allowed = 1.12 if name.startswith(hard) else 1.08
    assert rms < allowed * given[best][0]
    assert nees < max(4.0, 1.1 * given[best][1])


@pytest.mark.parametrize("name", QUICK)
def test_learned_motion_is_near_the_best_density(name: str) -> None:
    beside_given(name, 60)


# Beacons on a line leave a few runs on the wrong side, which are most of the RMS: see the tail.
@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in CELLS if name != "bottom, 3 nearly on a line"])
def test_in_all_cells_learned_motion_is_near_the_best_density(name: str) -> None:
    beside_given(name, 400)


@pytest.mark.slow
@pytest.mark.parametrize("name", CELLS)
def test_the_tail(name: str) -> None:
    """Runs that are badly wrong and do not know: of 2,000."""
    watch = {} if name in FIELDS else {"watch": 1.0}
    _, nees, bad = judged(cell(name, 2000, first=10_001, acceleration_psd=LEARNED, **watch))
    print(f"{name}: NEES {nees:.2f}, above 15: {100 * bad:.2f} %")
    assert bad <= ALLOWED.get(name, 0.01 if name in HARD else 0.002)


def test_a_diver_on_the_line_of_the_beacons_is_seldom_lost_on_the_wrong_side() -> None:
    """Without a look at the other side, 8 % of the runs are, and the RMS error is 94 m."""
    rms, nees, bad = judged(cell("bottom, 3 nearly on a line", 400, acceleration_psd=LEARNED))
    print(f"{rms:.2f} m, NEES {nees:.2f}, above 15: {100 * bad:.2f} %")
    assert rms < 15
    assert nees < 6
    assert bad <= 0.02


def drawn(q: float, runs: int, psd: float, arm: float) -> tuple[float, float, float, float]:
    """RMS [m], mean NEES, median of what is believed at the end, and the bound's RMS [m]."""
    start = {"prior_position_m": [15.0, 0.0, 15.0], "prior_position_std_m": 1.0,
             "prior_velocity_std_m_s": 0.1}
    scenario = sblcosim.load({
        "time": {"sampling_time_s": 1.0, "duration_s": 60.0},
        "target": {
            "trajectory": "white_noise_acceleration", "acceleration_psd_m2_s3": q,
            "initial_position_m": start["prior_position_m"], "initial_position_std_m": 1.0,
            "initial_velocity_std_m_s": 0.1, "depth_std_m": 0.05,
        },
        "platform": {
            "arm_length_m": arm, "gps_horizontal_std_m": 0.1, "gps_horizontal_markov_std_m": 1.2,
            "gps_correlation_time_s": 120.0, "imu_heading_std_deg": 1.0,
            "imu_heading_turn_on_std_deg": 3.0, "imu_tilt_std_deg": 0.5,
        },
        "acoustics": {"range_std_m": 0.1, "loss_probability": 0.25},
        "receiver": {"initialisation": "prior", "speed_limit_m_s": 20.0, **start},
    })
    plan = resolve(connect(scenario, "coupled"))
    truth = ("target.position", "target.velocity", "platform.position", "platform.attitude",
             "acoustics.reception_count", "acoustics.range_epoch", "target.depth_epoch",
             "coupled.motion_psd")
    seeds = {f"{component}.seed": np.arange(1, runs + 1) for component in COMPONENTS}
    outcome = execute(plan, {**seeds, "coupled.acceleration_psd": np.array([psd])}, record=truth)
    table = responses(outcome.sums["coupled"], plan.stop_ns - plan.start_ns)
    bound = [
        limits.reference(outcome.record(i), scenario).verdict().absolute_rms
        for i in range(0, runs, 4)
    ]
    believed = float(np.median(outcome.values["coupled.motion_psd"][:, -1]))
    rms, nees, _ = judged(table)
    return rms, nees, believed, float(np.sqrt(np.mean(np.square(bound))))


@pytest.mark.slow
@pytest.mark.parametrize("arm", [3.0, 0.4])
@pytest.mark.parametrize("q", [0.003, 0.03])
def test_where_motion_is_drawn_it_is_near_the_bound_and_believes_the_truth(
    q: float, arm: float
) -> None:
    rms, nees, believed, bound = drawn(q, 400, LEARNED, arm)
    told, *_ = drawn(q, 400, q, arm)
    print(f"q = {q}, arms {arm} m: {rms / bound:.3f} of the bound, {rms / told:.3f} of the filter "
          f"that is told; NEES {nees:.2f}; believes {believed:.4f}")
    assert rms < 1.05 * told
    assert rms < 1.15 * bound or arm < 1  # bearings of ±0.4 rad are no Gaussian
    assert 2.5 < nees < 3.4
    assert q / 3 < believed < 3 * q


def test_a_given_density_is_reported_as_it_is() -> None:
    result = sblcosim.run("paper-scenario-1", receiver="coupled", overrides={
        "time.duration_s": 5.0, "receiver.acceleration_psd_m2_s3": 0.02,
    })
    assert set(result.table["coupled.motion_psd"]) == {0.02}


def test_learned_motion_tells_a_diver_who_turns_from_a_steady_one() -> None:
    """Geometric mean of what is believed after the first tenth of the run."""
    believed = {}
    for name in ("favourable", "4, corners, loss"):
        source, changes = CELLS[name]
        source = source if isinstance(source, str) else {"name": "cell", **deepcopy(source)}
        plan = resolve(connect(sblcosim.load(source, changes), "coupled"))
        seeds = {f"{component}.seed": np.arange(1, 25) for component in COMPONENTS}
        outcome = execute(plan, {**seeds, "coupled.acceleration_psd": np.array([LEARNED])},
                          record=["coupled.motion_psd"])
        values = outcome.values["coupled.motion_psd"]
        assert (values >= min(bank.PSDS)).all()
        assert (values <= max(bank.PSDS)).all()
        late = values[:, values.shape[1] // 10 :]
        believed[name] = float(np.exp(np.log(late).mean()))
    assert believed["favourable"] < 0.006
    assert believed["4, corners, loss"] > 0.012
