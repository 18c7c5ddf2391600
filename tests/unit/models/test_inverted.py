"""Inverted ranges: the diver's ping at all beacons, travel times, losses, echoes, and the frame."""

from __future__ import annotations

from math import hypot, sqrt
from typing import Any

import numpy as np
import pytest
from harness import CROSS, NS
from numpy.typing import NDArray
from sblcosim.models.geometry import rotation
from sblcosim.models.loading import load
from stepper import Stepper, no_noise, numpy_noise

MODEL = load("acoustics")
SLOT = NS // 2
C = 1500.0
ALL = 2.0**53
Floats = NDArray[np.float64]


def pinged(noise: Any = no_noise, **parameters: Any) -> Stepper:
    given = {"range_std": 0.0, "ranging": 3, "sampling_time": 0.5}
    stepper = Stepper(MODEL, {**given, **parameters}, noise=noise)
    stepper.set(target_position=[9.0, -4.0, 2.0], beacon_position=CROSS,
                reported_beacon_position=CROSS)
    stepper.step(0, SLOT)
    return stepper


def arrival(at: Any, place: Any, left: float) -> float:
    """Time from a ping at a place to a point that moves, iterated."""
    tau = 0.0
    for _ in range(60):
        tau = float(np.linalg.norm(at(left + tau) - place)) / C
    return tau


@pytest.mark.parametrize("distance", [12.0, 150.0, 900.0])
@pytest.mark.parametrize("spread", [1.0, 40.0])
@pytest.mark.parametrize("schedule", [1, 2])
def test_it_is_the_iterated_light_time_of_a_moving_diver_and_a_moving_array(
    distance: float, spread: float, schedule: int
) -> None:
    """One ping, heard by each beacon where it is then; the tick is when it passes their middle."""
    start, v = np.array([distance, -4.0, 2.0]), np.array([0.4, -0.3, 0.1])
    w = np.array([-0.5, 0.6, 0.2])
    arms = spread * np.asarray(CROSS)

    def diver(t: float) -> Floats:
        return start + v * t

    def beacons(t: float) -> Floats:
        return arms + w * t

    stepper = pinged(schedule=schedule)
    for tick in range(1, 6):
        t = tick * 0.5
        stepper.set(target_position=diver(t), target_velocity=v, beacon_position=beacons(t),
                    reported_beacon_position=np.add(beacons(t), [1.0, 2.0, 3.0]))
        y = stepper.step(tick * SLOT, SLOT)
        assert (y["range_epoch"] == t).all()
        assert (y["reception_count"] == tick).all()
        if tick == 1:
            continue  # no slot before it: beacons count as at rest
        middle = beacons(t).mean(0)
        since = 0.0
        for _ in range(60):
            since = float(np.linalg.norm(diver(t - since) - middle)) / C
        left = t - since
        for i in range(4):
            travel = arrival(lambda s, i=i: beacons(s)[i], diver(left), left)
            assert y["range"][i] == pytest.approx(C * travel, abs=1e-9)
            assert y["true_range"][i] == pytest.approx(C * travel, abs=1e-9)
            assert y["arrival_epoch"][i] == pytest.approx(left + travel, abs=1e-12)
            assert y["ping_beacon_position"][i] == pytest.approx(
                beacons(left + travel)[i] + [1.0, 2.0, 3.0], abs=1e-9
            )


def test_with_motion_off_it_is_the_distance() -> None:
    stepper = pinged(motion_during_travel=False)
    stepper.set(target_velocity=[1.0, 1.0, 0.0])
    y = stepper.step(SLOT, SLOT)
    expected = np.linalg.norm(np.array([9.0, -4.0, 2.0]) - CROSS, axis=1)
    assert y["range"] == pytest.approx(expected, abs=1e-12)


def test_the_clock_enters_and_times_are_rounded() -> None:
    """A clock that is 1 ms ahead adds 1.5 m; steps of 0.25 m leave multiples of it."""
    exact = pinged().step(SLOT, SLOT)
    late = pinged(clock_offset=1e-3).step(SLOT, SLOT)
    assert late["range"] - exact["range"] == pytest.approx([1.5] * 4, abs=1e-9)
    rounded = pinged(range_resolution=0.25).step(SLOT, SLOT)
    assert rounded["range"] == pytest.approx(np.round(exact["range"] / 0.25) * 0.25, abs=1e-12)
    assert np.abs(rounded["range"] - exact["range"]).max() > 0.01


@pytest.mark.parametrize("burst", [0.0, 3.0])
def test_each_beacon_loses_pings_of_its_own(burst: float) -> None:
    """Within four standard errors of 1 - p; bursts make the errors larger."""
    p, ticks = 0.3, 2000
    stepper = pinged(numpy_noise(1), loss_probability=p, loss_burst_length=burst)
    heard = np.zeros((ticks, 4))
    before = np.zeros(4)
    for k in range(1, ticks + 1):
        y = stepper.step(k * SLOT, SLOT)
        heard[k - 1] = y["reception_count"] - before
        before = np.array(y["reception_count"])
    error = sqrt(p * (1 - p) / ticks) * (1.0 if not burst else 2.0)
    assert np.abs(heard.mean(0) - (1 - p)).max() < 4 * error
    for lost in (1 - heard).T:
        runs = (np.diff(lost, prepend=0) > 0).sum()
        assert lost.sum() / runs == pytest.approx(burst or 1 / (1 - p), rel=0.2)
    together = np.corrcoef(heard.T)[np.triu_indices(4, 1)]
    assert np.abs(together).max() < 0.15


def test_an_echo_comes_from_the_image_of_the_diver() -> None:
    def noise(draw: Any, count: int) -> Any:
        if draw.kind == "normal":
            return np.zeros(draw.size)
        lost = draw.name in ("arrival_loss", "arrival_surface_echo")
        return np.full(draw.size, 0.1 * ALL if lost else 0.9 * ALL)

    stepper = pinged(noise, loss_probability=0.5, surface_echo_probability=0.5)
    stepper.set(target_position=[15.0, 0.0, 2.0])
    y = stepper.step(SLOT, SLOT)
    (front, *_) = CROSS
    far, z = 15.0 - front[0], front[2]
    excess = hypot(far, 2.0 + z) - hypot(far, 2.0 - z)
    assert y["range"][0] - y["true_range"][0] == pytest.approx(excess, abs=1e-9)
    assert (y["reception_count"] == 1).all()


def test_the_body_shades_arrivals_from_behind() -> None:
    """Certain loss straight behind, none ahead."""
    def noise(draw: Any, count: int) -> Any:
        return np.zeros(draw.size) if draw.kind == "normal" else np.full(draw.size, ALL / 2)

    for course, heard in ((-1.0, 4), (1.0, 0)):
        stepper = pinged(noise, shadow_loss_probability=1.0, shadow_direction=np.pi,
                         shadow_half_width=1.0)
        stepper.set(target_position=[60.0, 0.0, 2.0], target_velocity=[course, 0.0, 0.0])
        assert stepper.step(SLOT, SLOT)["reception_count"].sum() == heard


def test_a_frame_is_misaligned_as_it_is_drawn() -> None:
    """Roll, pitch and heading turn the true beacons, not those that are reported."""
    turn = np.array([0.5, -1.0, 2.0])

    def noise(draw: Any, count: int) -> Any:
        if draw.name == "misalignment":
            return turn
        return np.zeros(draw.size)

    def beacons(**parameters: Any) -> Any:
        stepper = Stepper(load("platform"), parameters, noise=noise)
        return stepper.step(0, SLOT)

    exact = beacons()
    off = beacons(misalignment_tilt_std=0.01, misalignment_heading_std=0.02)
    R = np.array(rotation(np.array([0.01, 0.01, 0.02]) * turn))
    assert off["beacon_position"] == pytest.approx(
        exact["beacon_position"] @ R.T, abs=1e-12
    )
    assert (off["reported_beacon_position"] == exact["reported_beacon_position"]).all()
