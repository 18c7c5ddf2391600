"""What is known of a device apart from its log, and what is said of the log."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sblcosim
from made_logs import made, on_a_boat
from sblcosim.data.samples import OWN
from sblcosim.identification import run
from sblcosim.identification.device import Assumed, device_of
from sblcosim.identification.run import of_log
from sblcosim.identification.swings import swings_of
from sblcosim.processing.settings import Settled, settled
from seams import Seam

YAW = {"platform.yaw_amplitude_deg": 3.0, "platform.yaw_frequency_Hz": 0.05}


def with_keys(ready: Settled, **keys: Any) -> Settled:
    """The settings with other keys."""
    given = {name.replace("__", "."): value for name, value in keys.items()}
    return replace(ready, scenario=ready.scenario.override({**YAW, **given}.items()))


@pytest.mark.parametrize(("walk", "least"), [(3e-4, 3e-4), (1.5e-6, 1.5e-6), (0.0, 1e-6)])
def test_on_a_platform_angles_move_beacons_across_their_arms(walk: float, least: float) -> None:
    """By the root of the mean square of the horizontal arms, along one of two axes."""
    arms = np.array([[3.0, 4.0, 2.0], [-1.0, 0.0, 9.0], [0.0, -2.0, 5.0], [6.0, -8.0, 1.0]])
    ready = with_keys(
        settled(on_a_boat(seconds=30), None), receiver__imu_heading_std_deg=2.0,
        receiver__imu_tilt_std_deg=0.7, receiver__depth_bias_std_m=0.04,
        receiver__clock_walk_psd_m2_s=walk, acoustics__assumed_sound_speed_m_s=1480.0,
        receiver__beacon_offset_m=arms.ravel().tolist(),
        platform__gps_antenna_offset_m=[0.3, -0.4, 7.0],
    )
    moved = replace(ready, origin=np.array([7.0, -5.0, 2.0]))
    samples, body, known, base = of_log(moved)
    assert base is moved.scenario
    assert body.tolist() == arms.tolist()
    arm = np.sqrt((25 + 1 + 4 + 100) / 4)
    assert known == Assumed(
        1480.0, depth_bias_std=0.04, clock_walk_psd=pytest.approx(least),
        place_noise_std=pytest.approx(arm * np.radians(2.0) / np.sqrt(2)),
        place_down_noise_std=pytest.approx(arm * np.radians(0.7) / np.sqrt(2)),
        swings=swings_of(base.platform, 0.5),
    )
    assert samples.has_pose.all()
    plain = moved.log.samples()
    assert samples.position.tolist() == (plain.position - [7.0, -5.0, 2.0]).tolist()
    assert samples.range.tolist() == plain.range.tolist()


def test_in_the_field_places_have_errors_of_their_own() -> None:
    ready = with_keys(
        settled(made(seconds=30), None), receiver__beacon_error_std_m=0.2,
        receiver__beacon_vertical_error_std_m=0.5, receiver__depth_bias_std_m=0.04,
        receiver__clock_walk_psd_m2_s=3e-4, acoustics__assumed_sound_speed_m_s=1480.0,
        platform__beacon_m=[3.0, 4.0, 20.0, -1.0, 0.0, 90.0, 0.0, 2.0, 50.0, 8.0, -15.0, 1.0],
    )
    samples, body, known, base = of_log(replace(ready, origin=np.array([1.0, 2.0, 3.0])))
    assert body is None
    assert base is ready.scenario
    assert known == Assumed(
        1480.0, 0.2, 0.5, depth_bias_std=0.04, clock_walk_psd=3e-4,
        swings=swings_of(base.platform, 17.0),
    )
    assert known.swings[-1].amplitude == pytest.approx(17 * np.radians(3.0))
    there = ready.log.samples(OWN).position
    assert samples.position.tolist() == (there - [1.0, 2.0, 3.0]).tolist()


def test_beacons_are_on_a_platform_if_the_arrangement_says_so_and_packets_have_its_pose() -> None:
    boat, field = (settled(log(seconds=30), None) for log in (on_a_boat, made))
    assert (boat.arrangement, field.arrangement) == ("platform", "fixed")
    for ready in (replace(boat, arrangement="fixed"), replace(field, arrangement="platform")):
        samples, body, _, _ = of_log(ready)
        assert body is None
        assert not samples.has_pose.any()


def test_what_is_said_of_ranges_that_are_left_out_and_of_names(seam: Seam) -> None:
    given: list[Any] = []

    def taken(samples: Any, body: Any, known: Any) -> Any:
        given.append(samples)
        return SimpleNamespace(remarks=[])

    seam.instead(device_of, taken, only=run)
    scenario = sblcosim.load("harbour-lbl")
    log = made(seconds=60)
    plain = sblcosim.identify(log, scenario=scenario)
    heard = log.receptions
    far = heard.range.copy()
    far[[11, 30]] = 5000.0, 7000.0
    wild = replace(log, receptions=replace(heard, range=far), beacons=("1", "buoy", "3", "2"))
    found = sblcosim.identify(wild, scenario=scenario)
    assert [len(samples.range) for samples in given] == [60, 58]
    left_out = "losses: 2 ranges left out, as if lost"
    assert left_out in found.said
    assert not any(line.startswith("losses: ") for line in plain.said)
    assert found.said[-1] == "numbers of the beacons: 2 is buoy, 4 is 2"
    assert found.dive == {}
    assert found.log == log.name
    numbered = sblcosim.identify(replace(log, beacons=("1", "2", "3", "4")), scenario=scenario)
    assert not any("numbers of" in line for line in numbered.said)
