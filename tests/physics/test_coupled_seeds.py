"""The coupled filter over many seeds: known cells, the bound where motion is drawn, recovery.

Cells are variants of the paper's Scenario 1 with the true start as prior; what they are compared
with are measurements of a prototype in NumPy with the same equations.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
import sblcosim
from numpy.typing import NDArray
from sblcosim import limits
from sblcosim.judge.over_runs import pooled
from sblcosim.results.sums import responses
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters.lanes import RunsOutcome, execute
from sblcosim.simulation.plans.plan import Plan
from sblcosim.simulation.resolve import resolve
from sblcosim.simulation.system import Connection

from .from_the_model import dive, platform

Floats = NDArray[np.float64]
Inputs = dict[str, NDArray[Any]]

pytestmark = pytest.mark.slow
COMPONENTS = ("target", "platform", "acoustics")
TRUTH = ("target.position", "target.velocity", "platform.position", "platform.attitude",
         "acoustics.reception_count", "acoustics.range_epoch", "target.depth_epoch")
POOR_GPS = {"platform.gps_horizontal_std_m": 3.5}
SLOW = {"time.sampling_time_s": 1.0, "acoustics.loss_probability": 0.25}
RUNS = 200
SHORT = {"platform.arm_length_m": 0.4}


def simulated(
    plan: Plan, runs: int, true_prior: bool, record: tuple[str, ...] = (),
    **varied: Any,
) -> RunsOutcome:
    """Many runs of a plan, each with its own seed."""
    seeds = np.arange(1, runs + 1)
    prior = [Connection("target.position", "coupled.prior_position")] if true_prior else []
    given = {**{f"{name}.seed": seeds for name in COMPONENTS}, **varied}
    return execute(plan, given, handovers=prior, record=record)


def judged(
    plan: Plan, outcome: RunsOutcome, receiver: str = "coupled"
) -> tuple[float, float, float]:
    """RMS error [m] over the runs, mean NEES, and share of lost runs."""
    table = responses(outcome.sums[receiver], plan.stop_ns - plan.start_ns)
    rms = pooled(table.absolute_total_rms_m)
    return rms, float(table.nees_position.mean()), float(table.lost.mean())


@pytest.mark.parametrize(
    ("name", "changes", "rms", "nees", "lost"),
    [
        ("realistic-dive", {}, 2.16, 2.7, 0.0),
        ("paper-scenario-1", {**POOR_GPS, **SLOW}, 1.16, 2.5, 0.0),
        ("paper-scenario-1", {**SHORT, **SLOW}, 2.38, 2.0, 0.0),
        ("paper-scenario-1", {**SLOW, "acoustics.loss_probability": 0.0,
                              "acoustics.outlier_probability": 0.1,
                              "acoustics.outlier_mean_m": 3.0}, 0.84, 2.3, 0.0),
        ("paper-scenario-1", {}, 0.22, 2.3, 0.0),
        # Here the data do not say where the diver is; only how often it is lost is compared.
        ("paper-scenario-1", {
            **POOR_GPS, **SHORT, **SLOW, "acoustics.range_std_m": 1.0,
            "acoustics.loss_probability": 0.5, "platform.imu_tilt_std_deg": 10.0,
            "platform.imu_heading_std_deg": 10.0,
        }, None, None, 0.38),
    ],
)
def test_it_is_as_good_as_the_prototype(
    name: str, changes: Mapping[str, Any], rms: float | None, nees: float | None, lost: float
) -> None:
    scenario = sblcosim.load(name, changes)
    plan = resolve(connect(scenario, "coupled"))
    outcome = simulated(plan, 50, scenario.true_prior, **{
        "coupled.acceleration_psd": np.array([0.01]),
    })
    found = judged(plan, outcome)
    print(name, dict(changes), *(f"{value:.3f}" for value in found))
    assert found[2] <= lost
    if rms is not None and nees is not None:
        assert found[0] < 1.1 * rms  # twice its standard error of 5 %
        assert abs(found[1] - nees) < 0.4


@pytest.mark.parametrize("source", ["reported_pose", "beacon_positions", "own_beacon"])
@pytest.mark.parametrize("sampling_time", [1.0, 0.1])
@pytest.mark.parametrize("arm", [3.0, 0.4])
def test_where_motion_is_drawn_it_is_near_the_bound(
    source: str, sampling_time: float, arm: float
) -> None:
    """Motion, errors of the sensors and noise are drawn from the filter's own model."""
    scenario = dive(
        {"sampling_time_s": sampling_time, "duration_s": 60.0}, platform(arm),
        {"range_std_m": 0.1, "loss_probability": 0.25, "clock_offset_s": 9e-4,
         "sound_speed_m_s": 1530.0},
        {"acceleration_psd_m2_s3": 0.002, "pose_source": source},
    )
    runs = RUNS
    rng = np.random.default_rng(1)
    drawn = {  # biases that a scenario fixes
        "acoustics.clock_offset": 9e-4 * rng.standard_normal(runs),
        "acoustics.sound_speed": 1500.0 / (1 - 30.0 / 1530.0 * rng.standard_normal(runs)),
    }
    plan = resolve(connect(scenario, "coupled"))
    outcome = simulated(plan, runs, False, TRUTH, **drawn)
    rms, nees, lost = judged(plan, outcome)
    squares = []
    for i in range(runs):
        possible = limits.reference(
            outcome.record(i), scenario, own_beacon=source == "own_beacon"
        )
        squares.append(possible.verdict().absolute_rms ** 2)
    bound = float(np.sqrt(np.mean(squares)))
    print(source, sampling_time, arm, f"{rms:.3f} {bound:.3f} {rms / bound:.3f} {nees:.2f}")
    assert lost == 0.0
    assert rms < 1.1 * bound
    assert 2.8 < nees < 3.3
