"""Rounded packets: errors as large as they should be, equal in all masters, and none by default.

The seeds are fixed. A right implementation misses a bound with a probability of about 1e-4.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import radians, sqrt
from typing import Any

import numpy as np
import pytest
import sblcosim
from numpy.typing import NDArray
from sblcosim.judge.over_runs import pooled
from sblcosim.models.acoustics.variables import PACKET_CONTENT
from sblcosim.results.sums import responses
from sblcosim.scenario.scenario import shipped, shipped_text
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters import lanes
from sblcosim.simulation.resolve import resolve
from scipy import stats

pytestmark = pytest.mark.filterwarnings("ignore::sblcosim.errors.NoEffectWarning")
Floats = NDArray[np.float64]
CONTENT, STEP, ANGLE = (f"acoustics.packet_{key}" for key in (
    "content", "resolution_m", "angle_resolution_deg"))
PACKET = tuple(f"acoustics.{name}" for name in (
    "ping_beacon_position", "packet_beacon_position", "ping_platform_position",
    "ping_platform_attitude"))
RISK = 1e-4
NOISY: Mapping[str, Any] = {
    "time": {"sampling_time_s": 0.1, "duration_s": 1000.0},
    "target": {"speed_m_s": 0.0},
    "platform": {"gps_horizontal_std_m": 3.5, "gps_vertical_std_m": 3.5,
                 "imu_heading_std_deg": 10.0, "imu_tilt_std_deg": 10.0},
    "receiver": {"type": "multilateration"},
}
"""White errors far above a step, so that what is lost in rounding is as good as uniform."""


def record(source: Any, changes: Mapping[str, Any], runs: int = 1) -> dict[str, Floats]:
    """All outputs of some runs; without the last axes' meaning changed."""
    plan = resolve(connect(sblcosim.load(source, changes.items())))
    seeds = {f"{name}.seed": np.arange(1, runs + 1) for name in ("platform", "acoustics")}
    names = [column.name for column in plan.columns]
    return dict(lanes.execute(plan, seeds, record=names).values)


def assert_uniform(errors: Floats, step: float) -> None:
    """Independent and uniform over a step: mean 0, variance step²/12."""
    n, share = errors.size, errors / step
    assert abs(share).max() <= 0.5 + 1e-9
    bound = stats.norm.isf(RISK / 2)
    assert abs(share.mean()) < bound * sqrt(1 / 12 / n)
    assert abs((share**2).mean() - 1 / 12) < bound * sqrt(1 / 180 / n)
    assert stats.kstest(share + 0.5, "uniform").pvalue > RISK
    assert abs(np.corrcoef(share[:-1], share[1:])[0, 1]) < bound / sqrt(n)


def test_what_is_rounded_errs_uniformly() -> None:
    exact, rounded = (record(NOISY, change)
                      for change in ({}, {STEP: 0.2, ANGLE: 1.5}))
    again = np.diff(exact["acoustics.reception_count"][0], axis=0) > 0
    for name in PACKET:
        step = radians(1.5) if "attitude" in name else 0.2
        before, after = exact[name][0][1:], rounded[name][0][1:]
        lost = (after - before).reshape(len(before), 4, 3)
        assert np.abs(after / step - np.round(after / step)).max() < 1e-6
        for beacon in range(4):
            rows = lost[again[:, beacon], beacon]
            assert len(rows) >= 2499
            for axis in range(3):
                assert_uniform(rows[:, axis], step)
    for name in exact:
        if name.startswith(("acoustics", "platform", "target")) and name not in PACKET:
            np.testing.assert_array_equal(rounded[name], exact[name])


EXACT = [it for it in shipped() if "packet_content" not in shipped_text(it)]


@pytest.mark.parametrize("name", EXACT)
def test_packets_that_say_everything_exactly_are_the_default(name: str) -> None:
    short = {"time.duration_s": 20.0}
    usual = record(name, short)
    for said in ({CONTENT: "everything", STEP: 0.0, ANGLE: 0.0}, {"acoustics.packet_bits": 0}):
        same = record(name, {**short, **said})
        assert same.keys() == usual.keys()
        for column, values in usual.items():
            np.testing.assert_array_equal(same[column], values, err_msg=column)


@pytest.mark.parametrize("content", PACKET_CONTENT.values())
def test_all_masters_write_the_same_packets(content: str) -> None:
    changes = {"time.duration_s": 30.0, CONTENT: content, STEP: 0.1, "seed": 1,
               **({ANGLE: 0.7} if content in ("everything", "pose") else {})}
    together = record("realistic-dive", changes, runs=3)
    scenario = sblcosim.load("realistic-dive", changes)
    for master in ("native", "python"):
        alone = sblcosim.simulation.execution.execute(resolve(connect(scenario)), master=master)
        for name, values in alone.values.items():
            np.testing.assert_array_equal(values, together[name][0], err_msg=f"{master} {name}")


@pytest.mark.parametrize("receiver", ["ekf", "sequential", "multilateration", "coupled"])
def test_every_receiver_finds_the_diver_by_every_packet(receiver: str) -> None:
    """In ten bytes, or exactly where those do not suffice."""
    for content in PACKET_CONTENT.values():
        bits = 80 if content in ("pose", "own_beacon") else 0
        scenario = sblcosim.load(NOISY, {
            "time.duration_s": 60.0, "platform.gps_horizontal_std_m": 0.1,
            "platform.gps_vertical_std_m": 0.1, "platform.imu_heading_std_deg": 1.0,
            "platform.imu_tilt_std_deg": 1.0, "receiver.type": receiver,
            CONTENT: content, "acoustics.packet_bits": bits,
        })
        plan = resolve(connect(scenario))
        seeds = {f"{n}.seed": np.arange(1, 9) for n in ("target", "platform", "acoustics")}
        outcome = lanes.execute(plan, seeds)
        table = responses(outcome.sums[receiver], plan.stop_ns - plan.start_ns)
        assert table.absolute_total_rms_m.max() < 3.0, content


def mean_rms(changes: Mapping[str, Any], **told: Any) -> tuple[float, float]:
    """RMS error [m] and NEES of `coupled` at short baselines, over 50 seeds."""
    scenario = sblcosim.load("paper-scenario-1", {
        "time.sampling_time_s": 1.0, "acoustics.loss_probability": 0.25,
        "platform.arm_length_m": 0.4, **changes})
    plan = resolve(connect(scenario, "coupled"))
    seeds = {f"{n}.seed": np.arange(1, 51) for n in ("target", "platform", "acoustics")}
    outcome = lanes.execute(
        plan, {**seeds, "coupled.acceleration_psd": np.array([0.01]), **told}
    )
    table = responses(outcome.sums["coupled"], plan.stop_ns - plan.start_ns)
    return pooled(table.absolute_total_rms_m), float(table.nees_position.mean())


def test_a_receiver_that_is_told_of_rounding_loses_little_by_it() -> None:
    """At arms of 0.4 m, 0.2 m cost more than half if the receiver does not know of them."""
    exact, _ = mean_rms({CONTENT: "all_beacons"})
    told, nees = mean_rms({CONTENT: "all_beacons", STEP: 0.2})
    assert told < 1.1 * exact
    assert nees < 3.0
    assumed = sblcosim.load("paper-scenario-1").assumptions()
    untold, nees = mean_rms(
        {CONTENT: "all_beacons", STEP: 0.2},
        **{"coupled.gps_std": np.array([assumed["gps_std_m"]]),
           "coupled.gps_vertical_std": np.array([assumed["gps_vertical_std_m"]]),
           "coupled.imu_heading_std": np.array([radians(assumed["imu_heading_std_deg"])]),
           "coupled.imu_tilt_std": np.array([radians(assumed["imu_tilt_std_deg"])])},
    )
    assert untold > 1.35 * exact
    assert nees > 4.0
    pose, _ = mean_rms({CONTENT: "pose", "acoustics.packet_bits": 80})
    assert pose == pytest.approx(exact, rel=0.02)
