"""Inverted ranging over many seeds: near the bound where everything is drawn from the model."""

from __future__ import annotations

import numpy as np
import pytest
import sblcosim

from .from_the_model import dive, platform
from .near_the_bound import found_in

pytestmark = pytest.mark.slow
RUNS = 800


@pytest.mark.parametrize(("arm", "noise", "resolution", "heading", "away"), [
    (3.0, 0.05, 0.0, 0.0, 15.0), (0.4, 0.05, 0.0, 0.0, 15.0), (3.0, 0.02, 0.15, 0.0, 15.0),
    (3.0, 0.05, 0.0, 3.0, 15.0), (3.0, 0.05, 0.0, 0.5, 50.0), (3.0, 0.05, 0.02, 0.5, 200.0),
])
def test_where_motion_errors_and_biases_are_drawn_it_is_near_the_bound(
    arm: float, noise: float, resolution: float, heading: float, away: float
) -> None:
    """The clock, the speed of sound and the alignment of the frame are drawn for each run."""
    scenario = dive(
        {"sampling_time_s": 0.5, "duration_s": 60.0},
        {**platform(arm), "misalignment_heading_std_deg": heading},
        {"ranging": "inverted", "range_std_m": noise, "range_resolution_m": resolution,
         "loss_probability": 0.15, "clock_offset_std_s": 2e-4, "sound_speed_m_s": 1530.0},
        {"acceleration_psd_m2_s3": 0.002}, start=(away, 0.0, 15.0),
    )
    rng = np.random.default_rng(1)
    speeds = 1500.0 / (1 - 30.0 / 1530.0 * rng.standard_normal(RUNS))
    found = found_in(scenario, RUNS, **{"acoustics.sound_speed": speeds})
    assert found.lost == 0.0
    assert found.is_near
    assert 2.8 < found.nees < 3.3


@pytest.mark.parametrize(("name", "receiver", "beacons"), [
    ("harbour-lbl", "long_baseline", 4), ("gps-buoys", "long_baseline", 4),
    ("harbour-wakes", "coupled", 4), ("realistic-sea", "coupled", 4),
    ("realistic-dive", "fixed_lag", 4), ("harbour-square", "sequential", 4),
    ("realistic-dive", "coupled", 3), ("realistic-dive", "coupled", 8),
])
@pytest.mark.filterwarnings("ignore::sblcosim.errors.NoEffectWarning")
def test_a_ping_tells_as_much_as_pings_of_all_beacons_at_once(
    name: str, receiver: str, beacons: int
) -> None:
    """The geometry is the same, and only the sound goes the other way."""
    both = []
    for way in ({"acoustics.schedule": "simultaneous"}, {"acoustics.ranging": "inverted"}):
        count = {"platform.beacons": beacons} if beacons != 4 else {}
        table = sblcosim.run_many(name, receiver, {**way, **count}, runs=100).runs.table
        assert not table[f"{receiver}.lost"].any()
        both.append(np.sqrt((table[f"{receiver}.absolute_total_rms_m"] ** 2).mean()))
    assert both[1] / both[0] == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(("burst", "most"), [
    (1.0, 3.4), pytest.param(4.0, 3.8, marks=pytest.mark.slow)
])
def test_in_a_sea_with_a_mooring_its_claims_hold(burst: float, most: float) -> None:
    """Echoes that are late in bursts count as independent, which is what is left of the excess."""
    keys = {"acoustics.ranging": "inverted", "acoustics.loss_burst_length": burst}
    table = sblcosim.run_many("realistic-sea", "coupled", keys, runs=200).runs.table
    assert 2.6 < table["coupled.nees_position"].mean() < most
    assert table["coupled.lost"].mean() <= 0.01
