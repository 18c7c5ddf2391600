"""The shadow of the diver's body: its law, where it is, and what it does to each leg."""

from __future__ import annotations

from math import acos, cos, degrees, pi, radians, sin
from typing import Any

import numpy as np
import pytest
from harness import CROSS, NS
from sblcosim.models.acoustics import shadow
from sblcosim.models.loading import load
from stepper import Stepper, no_noise

MODEL = load("acoustics")
SLOT = NS // 10
ALL = 2.0**53
SHADED = {"shadow_loss_probability": 1.0, "shadow_half_width": radians(30)}


def by_hand(offset: Any, course: float, loss: float, half: float, middle: float) -> float:
    """From vectors: the angle between the beacon and the middle of the shadow."""
    axis = np.array([cos(course + middle), sin(course + middle), 0.0])
    angle = acos(float(axis @ np.asarray(offset)) / float(np.linalg.norm(offset)))
    return loss * cos(pi * angle / (4 * half)) ** 2 if angle < 2 * half else 0.0


@pytest.mark.parametrize("seed", range(20))
def test_the_law_is_that_of_vectors_worked_out_by_hand(seed: int) -> None:
    rng = np.random.default_rng(seed)
    offset, course = rng.normal(size=3) * [20, 20, 3], rng.uniform(-pi, pi)
    loss, half, middle = rng.uniform(), rng.uniform(0.1, pi / 2), rng.uniform(-2 * pi, 2 * pi)
    speed = rng.uniform(0.1, 2)
    velocity = [speed * cos(course), speed * sin(course), rng.normal()]
    found = shadow.of_course(np, [*offset], velocity[:2], middle, loss, half)
    assert found == pytest.approx(by_hand(offset, course, loss, half, middle), abs=1e-12)


def test_half_of_it_is_left_at_the_half_width_and_the_mean_is_known() -> None:
    half = radians(25)
    angle = np.array([0.0, half, 2 * half, pi])
    assert shadow.chance(np, angle, 0.8, half) == pytest.approx([0.8, 0.4, 0, 0], abs=1e-12)
    around = np.abs(np.arange(-pi, pi, 1e-3))
    for h in (half, pi / 2):
        mean = shadow.chance(np, around, 0.8, h).mean()
        assert mean == pytest.approx(shadow.mean(0.8, h), rel=1e-3)


def drawn(share: float) -> Any:
    """Uniform numbers that are this share of all."""
    return lambda draw, count: (
        np.zeros(draw.size) if draw.kind == "normal" else np.full(draw.size, share * ALL)
    )


def heard(share: float, velocity: Any, diver: Any = (20.0, 0.0, 2.0), **keys: Any) -> int:
    """Packets of the first slot that are received."""
    stepper = Stepper(MODEL, {"range_std": 0.0, "sampling_time": 0.1, **keys}, noise=drawn(share))
    stepper.set(target_position=diver, target_velocity=velocity, beacon_position=CROSS,
                reported_beacon_position=CROSS)
    stepper.step(0, SLOT)
    return int(np.sum(stepper.step(SLOT, SLOT)["reception_count"]))


def last_lost(velocity: Any, **keys: Any) -> float:
    """The largest uniform number with which a packet is lost, by bisection: its probability."""
    low, high = 0.0, 1.0
    for _ in range(20):
        middle = (low + high) / 2
        low, high = (low, middle) if heard(middle, velocity, **keys) else (middle, high)
    return low


@pytest.mark.parametrize("ranging", [1, 2])
@pytest.mark.parametrize("course_deg", [0.0, 20.0, 50.0, 90.0, 180.0])
def test_a_beacon_behind_the_diver_is_lost_by_the_law(course_deg: float, ranging: int) -> None:
    """The diver in the north swims away from the beacons, or turns by this angle."""
    course = radians(course_deg)
    velocity = [0.5 * cos(course), 0.5 * sin(course), 0.1]
    offset = np.asarray(CROSS[0]) - [20.0, 0.0, 2.0]
    expected = by_hand(offset, course, 1.0, radians(30), pi)
    found = last_lost(velocity, ranging=ranging, **SHADED)
    assert found == pytest.approx(expected, abs=1e-5)
    if course_deg == 0:
        assert found > 0.95


def test_the_hydrophone_on_the_back_hears_nothing_from_ahead() -> None:
    ahead = {**SHADED, "shadow_direction": 0.0}
    assert last_lost([0.5, 0.0, 0.0], **ahead) < 1e-5
    assert last_lost([-0.5, 0.0, 0.0], **ahead) > 0.95


@pytest.mark.parametrize("velocity", [[0.0, 0.0, 0.0], [0.0, 0.0, 0.3]])
def test_a_diver_without_a_course_has_no_shadow(velocity: Any) -> None:
    assert heard(0.001, velocity, **SHADED) == 1
    assert heard(0.001, [0.5, 0.0, 0.0], **SHADED) == 0


def test_a_beacon_above_the_diver_is_not_in_the_shadow() -> None:
    assert heard(0.001, [0.5, 0.0, 0.0], diver=(CROSS[0][0], CROSS[0][1], 20.0), **SHADED) == 1


def test_bursts_are_not_prolonged_by_the_shadow() -> None:
    """Every packet is shaded, none lost by the channel: its chain stays where it was."""
    keys = {**SHADED, "loss_probability": 0.1, "loss_burst_length": 50.0, "sampling_time": 0.1}

    def noise(draw: Any, count: int) -> Any:
        return drawn(0.5 if draw.name == "loss" else 0.0)(draw, count)

    stepper = Stepper(MODEL, {"range_std": 0.0, **keys}, noise=noise)
    stepper.set(target_position=[20.0, 0.0, 2.0], target_velocity=[0.5, 0.0, 0.0],
                beacon_position=CROSS, reported_beacon_position=CROSS)
    stepper.step(0, SLOT)
    for k in range(1, 9):
        y = stepper.step(k * SLOT, SLOT)
    assert np.sum(y["reception_count"]) == 0
    stepper.set(target_velocity=[-0.5, 0.0, 0.0])
    y = stepper.step(9 * SLOT, SLOT)
    assert np.sum(y["reception_count"]) == 1


def test_the_echo_of_a_shaded_packet_may_arrive() -> None:
    def noise(draw: Any, count: int) -> Any:
        return drawn(0.5 if draw.name == "loss" else 0.0)(draw, count)

    keys = {**SHADED, "surface_echo_probability": 0.5, "range_std": 0.0, "sampling_time": 0.1}
    stepper = Stepper(MODEL, keys, noise=noise)
    stepper.set(target_position=[20.0, 0.0, 2.0], target_velocity=[0.5, 0.0, 0.0],
                beacon_position=CROSS, reported_beacon_position=CROSS)
    stepper.step(0, SLOT)
    y = stepper.step(SLOT, SLOT)
    assert y["range"][0] > y["true_range"][0] + 1e-3


@pytest.mark.parametrize("leg", ["request", "answer"])
def test_a_shaded_leg_is_a_lost_range(leg: str) -> None:
    def noise(draw: Any, count: int) -> Any:
        return drawn(0.0 if draw.name == f"{leg}_shadow" else 0.999)(draw, count)

    stepper = Stepper(MODEL, {**SHADED, "ranging": 2, "sampling_time": 0.1}, noise=noise)
    stepper.set(target_position=[20.0, 0.0, 2.0], target_velocity=[0.5, 0.0, 0.0],
                beacon_position=CROSS, reported_beacon_position=CROSS)
    stepper.step(0, SLOT)
    assert np.sum(stepper.step(SLOT, SLOT)["reception_count"]) == 0


def test_no_noise_is_no_loss() -> None:
    stepper = Stepper(MODEL, {"range_std": 0.0, "sampling_time": 0.1}, noise=no_noise)
    stepper.set(target_position=[20.0, 0.0, 2.0], target_velocity=[0.5, 0.0, 0.0],
                beacon_position=CROSS)
    stepper.step(0, SLOT)
    assert np.sum(stepper.step(SLOT, SLOT)["reception_count"]) == 1
    assert degrees(MODEL.component["shadow_direction"].starts[0]) == pytest.approx(180)
