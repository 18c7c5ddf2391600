"""`array` over many seeds: near the bound where everything is drawn from the model."""

from __future__ import annotations

import numpy as np
import pytest
import sblcosim

from .from_the_model import dive, platform
from .near_the_bound import found_in

pytestmark = pytest.mark.slow
RUNS = 800


def speeds() -> np.ndarray:
    return 1500.0 / (1 - 30.0 / 1530.0 * np.random.default_rng(1).standard_normal(RUNS))


@pytest.mark.parametrize("away", [10.0, 50.0, 200.0])
@pytest.mark.parametrize(("compass", "frame"), [(1.0, 0.5), (0.02, 0.02)])
def test_an_array_of_five_centimetres_is_near_the_bound(
    away: float, compass: float, frame: float
) -> None:
    """Clock, speed of sound, compass and frame are drawn for each run."""
    scenario = dive(
        {"sampling_time_s": 1.0, "duration_s": 60.0},
        {**platform(0.05), "imu_heading_turn_on_std_deg": compass, "imu_heading_std_deg": 0.2,
         "imu_tilt_std_deg": 0.2, "misalignment_tilt_std_deg": frame,
         "misalignment_heading_std_deg": frame},
        {"ranging": "inverted", "range_std_m": 5e-4, "range_common_std_m": 0.1,
         "arrivals_shared": True, "loss_probability": 0.15, "clock_offset_std_s": 2e-4,
         "sound_speed_m_s": 1530.0},
        {"acceleration_psd_m2_s3": 0.002}, start=(away, 0.0, 15.0),
    )
    found = found_in(scenario, RUNS, "array", **{"acoustics.sound_speed": speeds()})
    assert found.lost == 0.0
    assert found.is_near
    assert 2.8 < found.nees < 3.3


@pytest.mark.parametrize("away", [10.0, 30.0, 100.0])
def test_differences_of_arrivals_are_near_the_bound_where_the_start_is_known(away: float) -> None:
    scenario = dive(
        {"sampling_time_s": 0.5, "duration_s": 60.0},
        {**platform(3.0), "misalignment_heading_std_deg": 0.5},
        {"ranging": "inverted", "range_std_m": 0.05, "common_clock": False,
         "loss_probability": 0.15, "sound_speed_m_s": 1530.0},
        {"acceleration_psd_m2_s3": 0.002}, start=(away, 0.0, 15.0),
    )
    found = found_in(scenario, RUNS, "array", **{"acoustics.sound_speed": speeds()})
    assert found.lost == 0.0
    assert found.is_near
    assert 2.8 < found.nees < 3.3


def test_in_the_boat_s_dive_its_claims_hold_where_those_of_coupled_do_not() -> None:
    table = sblcosim.run_many("usbl-boat", ["array", "coupled"], runs=200).runs.table
    rms = {r: np.sqrt((table[f"{r}.absolute_total_rms_m"] ** 2).mean())
           for r in ("array", "coupled")}
    assert rms["array"] < 5.5 < 20 < rms["coupled"]
    assert 2.5 < table["array.nees_position"].mean() < 3.6
    assert not table["array.lost"].any()
    assert (table["array.nees_position"] > 15).mean() <= 0.01


@pytest.mark.parametrize(("level", "most"), [(3, 3.5), (4, 3.5), (5, 4.0)])
def test_its_claims_hold_in_a_rough_sea(level: int, most: float) -> None:
    """Waves beside a drift at anchor are not taken for a velocity that lasts."""
    table = sblcosim.run_many("usbl-boat", "array", {"platform.beaufort": level},
                              runs=200).runs.table
    rms = np.sqrt((table["array.absolute_total_rms_m"] ** 2).mean())
    assert rms < 5.6
    assert 2.6 < table["array.nees_position"].mean() < most
    assert not table["array.lost"].any()


@pytest.mark.parametrize("keys", [
    {"acoustics.outlier_probability": 0.1}, {"acoustics.loss_probability": 0.6},
    {"platform.beacons": 3}, {"platform.beacons": 8}, {"platform.beaufort": 3},
    {"receiver.acceleration_psd_m2_s3": 0.01}, {"acoustics.range_resolution_m": 0.0015},
    {"platform.misalignment_tilt_std_deg": 5.0}, {"time.sampling_time_s": 3.0},
    {"acoustics.range_std_m": 1e-4, "acoustics.range_common_std_m": 0.005},
    {"acoustics.range_common_std_m": 1.0, "platform.imu_heading_turn_on_std_deg": 0.5},
], ids=str)
def test_its_claims_hold_in_other_dives_off_the_boat(keys: dict[str, float]) -> None:
    table = sblcosim.run_many("usbl-boat", "array", keys, runs=100).runs.table
    assert table["array.lost"].mean() <= 0.01
    assert 1.8 < table["array.nees_position"].mean() < 4.0
    assert (table["array.nees_position"] > 15).mean() <= 0.01
