"""Two-way ranges: travel times, the epoch of a range, losses and echoes of both legs, errors."""

from __future__ import annotations

from math import hypot, sqrt
from typing import Any

import numpy as np
import pytest
from harness import CROSS, NS
from numpy.typing import NDArray
from sblcosim.models.loading import load
from stepper import Stepper, no_noise, numpy_noise

MODEL = load("acoustics")
SLOT = NS // 2
C = 1500.0
ALL = 2.0**53
DELAY = 0.1
Floats = NDArray[np.float64]


def asked(noise: Any = no_noise, **parameters: Any) -> Stepper:
    given = {"range_std": 0.0, "ranging": 2, "turnaround": DELAY, "sampling_time": 0.5}
    stepper = Stepper(MODEL, {**given, **parameters}, noise=noise)
    stepper.set(target_position=[9.0, -4.0, 2.0], beacon_position=CROSS,
                reported_beacon_position=CROSS)
    stepper.step(0, SLOT)
    return stepper


def light_time(at: Any, place: Any, time: float, sign: int) -> float:
    """Travel time from a place at a time to a moving diver, iterated; with sign −1, from it."""
    tau = 0.0
    for _ in range(50):
        tau = float(np.linalg.norm(at(time + sign * tau) - place)) / C
    return tau


@pytest.mark.parametrize("distance", [12.0, 150.0])
@pytest.mark.parametrize("delay", [0.0, 0.1])
@pytest.mark.parametrize("schedule", [1, 2])
def test_it_is_the_iterated_light_time_of_a_moving_diver_and_a_moving_array(
    distance: float, delay: float, schedule: int
) -> None:
    """Request and answer reach and leave the beacon where it is then; the epoch is between them."""
    start, v = np.array([distance, -4.0, 2.0]), np.array([0.4, -0.3, 0.1])
    w = np.array([-0.5, 0.6, 0.2])

    def diver(t: float) -> Floats:
        return start + v * t

    def beacons(t: float) -> Floats:
        return np.asarray(CROSS) + w * t

    stepper = asked(turnaround=delay, schedule=schedule)
    seen = 0
    for tick in range(1, 9):
        t = tick * 0.5
        stepper.set(target_position=diver(t), target_velocity=v, beacon_position=beacons(t),
                    reported_beacon_position=beacons(t))
        y = stepper.step(tick * SLOT, SLOT)
        for i in range(4):
            if tick == 1 or y["range_epoch"][i] != t:
                continue
            came, left = t - delay / 2, t + delay / 2
            request = light_time(diver, beacons(came)[i], came, -1)
            answer = light_time(diver, beacons(left)[i], left, 1)
            asks, hears = came - request, left + answer
            assert y["range"][i] == pytest.approx(C * (hears - asks - delay) / 2, abs=1e-9)
            assert y["arrival_epoch"][i] == pytest.approx(hears, abs=1e-12)
            assert (asks + hears) / 2 == pytest.approx(t, abs=1e-4)
            assert y["range"][i] == pytest.approx(
                np.linalg.norm(diver(t) - beacons(t)[i]), abs=1e-3
            )
            assert y["ping_beacon_position"][i] == pytest.approx(beacons(t)[i])
            seen += 1
    assert seen == (7 if schedule == 1 else 28)


def test_the_motion_of_the_array_counts() -> None:
    """The first round has no slot before it: its beacons count as at rest."""
    w = np.array([0.0, 1.0, 0.0])
    ranges = []
    for tick in (1, 2):
        stepper = asked(schedule=2)
        for k in range(1, tick + 1):
            stepper.set(target_position=[9.0, -4.0, 2.0], target_velocity=[0.0, 2.0, 0.0],
                        beacon_position=np.asarray(CROSS) + w * (k - tick) * 0.5)
            y = stepper.step(k * SLOT, SLOT)
        ranges.append(np.array(y["range"]))
    moved = np.abs(ranges[1] - ranges[0]).max()
    assert 1e-6 < moved < 1e-3


def test_with_motion_off_it_is_the_distance() -> None:
    stepper = asked(motion_during_travel=False)
    stepper.set(target_velocity=[1.0, 1.0, 0.0])
    y = stepper.step(SLOT, SLOT)
    expected = np.linalg.norm(np.array([9.0, -4.0, 2.0]) - CROSS[0])
    assert y["range"][0] == pytest.approx(expected, abs=1e-12)


def test_no_clock_enters_and_the_turn_around_does() -> None:
    """0.1 ms of turn-around is 7.5 cm, and so is a delay of the receiver's."""
    def ones(draw: Any, count: int) -> Any:
        return np.full(draw.size, float(draw.name in ("turnaround", "turnaround_bias"))
                       if draw.kind == "normal" else ALL / 2)

    clock = {"clock_offset": 1e-3, "clock_drift": 1e-4}
    for parameters, expected in (
        (clock, 0.0), ({"turnaround_std": 1e-4}, 0.075), ({"turnaround_bias_std": 2e-4}, 0.15),
        ({"processing_delay": 1e-4}, 0.075),
    ):
        y = asked(ones, **parameters).step(SLOT, SLOT)
        assert y["range"][0] - y["true_range"][0] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("burst", [0.0, 3.0])
def test_both_legs_must_arrive(burst: float) -> None:
    """Within four standard errors of (1 - p)²; bursts make the errors larger."""
    p, ticks = 0.3, 2000
    stepper = asked(numpy_noise(1), loss_probability=p, loss_burst_length=burst, schedule=2)
    for k in range(1, ticks + 1):
        y = stepper.step(k * SLOT, SLOT)
    share = np.sum(y["reception_count"]) / (4 * ticks)
    q = (1 - p) ** 2
    error = sqrt(q * (1 - q) / (4 * ticks)) * (1.0 if not burst else 2.0)
    assert abs(share - q) < 4 * error


@pytest.mark.parametrize("leg", ["request", "answer"])
def test_an_echo_of_one_leg_is_late_by_half_its_excess(leg: str) -> None:
    def noise(draw: Any, count: int) -> Any:
        if draw.kind == "normal":
            return np.zeros(draw.size)
        lost = draw.name in (f"{leg}_loss", f"{leg}_surface_echo")
        return np.full(draw.size, 0.1 * ALL if lost else 0.9 * ALL)

    stepper = asked(noise, loss_probability=0.5, surface_echo_probability=0.5)
    stepper.set(target_position=[15.0, 0.0, 2.0])
    y = stepper.step(SLOT, SLOT)
    (front, *_) = CROSS
    far, z = 15.0 - front[0], front[2]
    excess = hypot(far, 2.0 + z) - hypot(far, 2.0 - z)
    assert y["range"][0] - y["true_range"][0] == pytest.approx(excess / 2, abs=1e-9)
    assert y["reception_count"][0] == 1


@pytest.mark.parametrize("leg", ["request", "answer"])
def test_one_lost_leg_is_a_lost_range(leg: str) -> None:
    def noise(draw: Any, count: int) -> Any:
        return np.full(draw.size, 0.1 * ALL if draw.name == f"{leg}_loss" else 0.9 * ALL)

    y = asked(noise, loss_probability=0.5).step(SLOT, SLOT)
    assert y["reception_count"][0] == 0


def test_each_beacon_is_late_by_an_error_of_its_own_in_all_its_answers() -> None:
    """0.1 ms is 7.5 cm: drawn once for each beacon, beside the error that all share."""
    own = np.array([1.0, -2.0, 0.5, 3.0])

    def noise(draw: Any, count: int) -> Any:
        if draw.name == "turnaround_each":
            return own
        return np.full(draw.size, float(draw.name == "turnaround_bias")
                       if draw.kind == "normal" else ALL / 2)

    stepper = asked(noise, turnaround_beacon_std=1e-4, turnaround_bias_std=2e-4, schedule=2)
    for k in (1, 2, 3):
        y = stepper.step(k * SLOT, SLOT)
        late = np.asarray(y["range"]) - np.asarray(y["true_range"])
        assert late == pytest.approx(0.075 * own + 0.15, abs=1e-9)
