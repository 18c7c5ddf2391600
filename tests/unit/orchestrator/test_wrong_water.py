"""Nonsense about sea, water and ranging: each is one line that names the key and what must hold."""

from __future__ import annotations

import tomllib
from typing import Any

import pytest
from sblcosim.errors import ConfigurationError
from sblcosim.scenario.scenario import load

SEA = 'motion = "spectrum"\nwave_height_m = 1.0\n'
ECHO = "water_depth_m = 12.0\nloss_probability = 0.2\n"
PROFILE = "profile_depth_m = [0.0, 5.0]\n"
TWO_WAY, INVERTED = 'ranging = "two_way"\n', 'ranging = "inverted"\n'
TRACK = "track_m = [[0, 0], [1, 1]]\ntrack_time_s = [0, 5]\n"

WRONG: dict[str, list[str]] = {
    "acoustics.temperature_C": ["temperature_C = 150.0", "temperature_C = nan",
                                'temperature_C = "warm"', f"{PROFILE}profile_speed_m_s = "
                                "[1500.0, 1490.0]\ntemperature_C = 10.0"],
    "acoustics.salinity": ["salinity = -1.0", "temperature_C = 10.0\nsalinity = 99.0"],
    "acoustics.sample_depth_m": ["sample_depth_m = -3.0"],
    "acoustics.profile_depth_m": [
        "profile_depth_m = [9.0, 5.0]\nprofile_temperature_C = [9.0, 8.0]", PROFILE,
        "profile_depth_m = [5.0, 5.0]\nprofile_speed_m_s = [1500.0, 1490.0]",
        "profile_depth_m = [-5.0, 5.0]\nprofile_speed_m_s = [1500.0, 1490.0]"],
    "acoustics.profile_speed_m_s": ["profile_speed_m_s = [1500.0]",
                                    f"{PROFILE}profile_speed_m_s = [1500.0, 0.0]"],
    "acoustics.profile_temperature_C": [
        f"{PROFILE}profile_speed_m_s = [1500.0, 1490.0]\nprofile_temperature_C = [9.0, 8.0]"],
    "acoustics.profile_salinity": [
        f"{PROFILE}profile_temperature_C = [9.0, 8.0]\nprofile_salinity = [35.0]",
        f"{PROFILE}profile_temperature_C = [9.0, 8.0]\nprofile_salinity = [35.0, -1.0]"],
    "acoustics.water_depth_m": ["water_depth_m = -1.0", f"{ECHO.replace('12', '2')}"],
    "acoustics.surface_echo_probability": [f"{ECHO}surface_echo_probability = 1.2"],
    "acoustics.bottom_echo_probability": [f"{ECHO}bottom_echo_probability = -0.1"],
    "acoustics.loss_burst_length": ["loss_burst_length = 0.5", "loss_burst_length = -3.0",
                                    "loss_probability = 0.9\nloss_burst_length = 2.0"],
    "acoustics.shadow_loss_probability": ["shadow_loss_probability = 1.5"],
    "acoustics.shadow_half_width_deg": [
        "shadow_loss_probability = 0.5\nshadow_half_width_deg = 0.0",
        "shadow_loss_probability = 0.5\nshadow_half_width_deg = 180.0"],
    "acoustics.packet_duration_s": ["packet_duration_s = 2.0", "packet_duration_s = 0.0",
                                    f"{TWO_WAY}turnaround_s = 0.4\npacket_duration_s = 0.1"],
    "acoustics.guard_interval_s": ["packet_duration_s = 0.1\nguard_interval_s = -1.0"],
    "acoustics.reach_m": ["packet_duration_s = 0.1\nreach_m = -1.0"],
    "acoustics.ranging": ['ranging = "twoway"', "ranging = 2"],
    "acoustics.turnaround_s": [f"{TWO_WAY}turnaround_s = -0.1", f"{TWO_WAY}turnaround_s = 0.5"],
    "acoustics.turnaround_std_s": [f"{TWO_WAY}turnaround_std_s = -1e-4"],
    "acoustics.turnaround_beacon_std_s": [f"{TWO_WAY}turnaround_beacon_std_s = -1e-4"],
    "acoustics.range_common_std_m": [f"{INVERTED}range_common_std_m = -0.1",
                                     f"{INVERTED}range_common_std_m = true"],
    "acoustics.range_resolution_m": [f"{INVERTED}range_resolution_m = -1.0"],
    "acoustics.arrivals_shared": [f"{INVERTED}arrivals_shared = 2"],
    "acoustics.common_clock": [f'{INVERTED}common_clock = "maybe"'],
    "acoustics.slot_order": ["slot_order = [1, 1, 2, 3]", "slot_order = [1, 2, 3]"],
    "platform.motion": ['motion = "spectrum"', 'motion = "spectrum"\nwave_period_s = 4.0',
                        'motion = "sea"'],
    "platform.wave_height_m": ['motion = "spectrum"\nwave_height_m = -1.0'],
    "platform.wave_period_s": [f"{SEA}wave_period_s = 0.0", f'{SEA}wave_period_s = "long"'],
    "platform.wave_components": [f"{SEA}wave_components = {it}" for it in (0, 17, 2.5)],
    "platform.wave_peak_enhancement": [f"{SEA}wave_peak_enhancement = 0.5"],
    "platform.wave_spreading_deg": [f"{SEA}wave_spreading_deg = -5.0"],
    "platform.raft_size_m": [f"{SEA}raft_size_m = 0.0"],
    "platform.raft_draught_m": [f"{SEA}raft_draught_m = -1.0"],
    "platform.watch_circle_m": [f"{SEA}watch_circle_m = -1.0"],
    "platform.mooring_time_s": [f"{SEA}watch_circle_m = 3.0\nmooring_time_s = 0.0"],
    "platform.beaufort": [f"{SEA}beaufort = 7"],
    "platform.boat_speed_m_s": ["boat_speed_m_s = -1.0", "boat_speed_m_s = 1e6"],
    "platform.misalignment_tilt_std_deg": ["misalignment_tilt_std_deg = -1.0"],
    "platform.track_m": ["track_m = [[0, 0, 0], [1, 1, 1]]\ntrack_time_s = [0, 5]",
                         "track_m = [[0, 0]]\ntrack_time_s = [0, 5]"],
    "platform.track_time_s": [TRACK.replace("[0, 5]", it) for it in ("[5, 0]", "[-5, 0]")],
    "platform.departure_time_s": [f"{TRACK}departure_time_s = -3.0"],
    "platform.beacon_m": ["beacon_m = [[0.0, 0.02, 1.0], [0.0, -0.02, 1.0]]",
                          "beacon_m = [[0, 0, 1], [0, 0, 1], [0, 1, 1]]"],
}


@pytest.mark.parametrize(("key", "text"), [(k, it) for k, texts in WRONG.items() for it in texts])
def test_a_wrong_value_is_one_line_that_names_it(key: str, text: str) -> None:
    table, _, name = key.partition(".")
    tables: dict[str, Any] = {"time": {"sampling_time_s": 0.5}, table: tomllib.loads(text)}
    with pytest.raises(ConfigurationError) as caught:
        load(tables)
    line = str(caught.value)
    assert line.startswith(f"scenario: [{table}] {name}")
    assert "must " in line
    assert "\n" not in line
    assert len(line) < 250
