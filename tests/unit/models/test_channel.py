"""The channel beyond the paper's: losses in bursts, echoes by geometry, a profile of the sound."""

from __future__ import annotations

from math import hypot
from typing import Any

import numpy as np
import pytest
from harness import CROSS, NS
from sblcosim.models.loading import load
from scipy.optimize import brentq
from stepper import Stepper, no_noise

MODEL = load("acoustics")
DIVER = np.array([9.0, -4.0, 2.0])
SLOT = NS // 10
ALL = 2.0**53


def channel(noise: Any = no_noise, diver: Any = DIVER, **parameters: Any) -> Stepper:
    stepper = Stepper(MODEL, {"range_std": 0.0, **parameters}, noise=noise)
    stepper.set(target_position=diver, beacon_position=CROSS, reported_beacon_position=CROSS)
    stepper.step(0, SLOT)
    return stepper


def tick(stepper: Stepper) -> Any:
    return stepper.step(stepper.t_ns, SLOT)


# --- Bursts --------------------------------------------------------------------------------------


def after(chance: float, burst: float) -> tuple[float, float]:
    """Probability of a loss after a packet that arrived, and after one that was lost."""
    x = channel(loss_probability=chance, loss_burst_length=burst)
    first = 0
    for name, (rows, columns) in MODEL.states.items():
        if name == "loss_after":
            return float(x.x[first]), float(x.x[first + 1])
        first += rows * columns
    raise AssertionError


@pytest.mark.parametrize(("chance", "burst"), [(0.25, 1.0), (0.25, 8.0), (0.8, 4.0), (0.5, 50.0)])
def test_the_chain_is_stationary_with_the_given_mean_length(chance: float, burst: float) -> None:
    begins, continues = after(chance, burst)
    assert 1 / (1 - continues) == pytest.approx(burst)
    assert (1 - chance) * begins + chance * continues == pytest.approx(chance)


def test_without_bursts_each_packet_is_lost_by_itself() -> None:
    assert after(0.3, 0.0) == (0.3, 0.3)


def test_lost_for_ever() -> None:
    assert after(1.0, 3.0) == (1.0, 1.0)


def test_the_next_loss_depends_on_the_last_packet_of_the_same_beacon() -> None:
    """Uniform numbers of one half: a loss only where its probability is above one half."""
    c = channel(loss_probability=0.6, loss_burst_length=4.0)  # 0.6, then 0.75 or 0.375
    for _ in range(12):
        y = tick(c)
    assert list(y["reception_count"]) == [0, 0, 0, 0]
    c = channel(loss_probability=0.4, loss_burst_length=4.0)
    for _ in range(12):
        y = tick(c)
    assert list(y["reception_count"]) == [3, 3, 3, 3]


# --- Echoes --------------------------------------------------------------------------------------


def noise_of(**numbers: float) -> Any:
    """Uniform numbers by the name of their draw, as shares; others are one half."""

    def noise(draw: Any, count: int) -> Any:
        if draw.kind == "normal":
            return np.zeros(draw.size)
        return np.full(draw.size, numbers.get(draw.name, 0.5) * ALL)

    return noise


LOST = {"loss_probability": 1.0, "water_depth": 3.5}
SURFACE = {**LOST, "surface_echo_probability": 0.5}
BOTTOM = {**LOST, "bottom_echo_probability": 0.5}


def late(parameters: dict[str, float], **numbers: float) -> list[float]:
    """Excess of the range of each beacon; NaN where none is received."""
    c = channel(noise_of(**numbers), np.array([15.0, 0.0, 2.0]), **parameters)
    for _ in range(4):
        y = tick(c)
    excess = np.array(y["range"]) - np.array(y["true_range"])
    return [float(e) if n else float("nan") for e, n in zip(excess, y["reception_count"],
                                                            strict=True)]


def test_echoes_in_a_harbour_are_late_by_the_images_of_the_beacon() -> None:
    """At 15 m, in 3.5 m of water: 0.13 m by the surface, and 0.59 m by the bottom."""
    (front, *_) = CROSS
    far, z = 15.0 - front[0], front[2]
    direct = hypot(far, 2.0 - z)
    surface, bottom = hypot(far, 2.0 + z) - direct, hypot(far, 7.0 - 2.0 - z) - direct
    assert late(SURFACE, surface_echo=0.1)[0] == pytest.approx(surface, abs=1e-9)
    assert late(BOTTOM, bottom_echo=0.1)[0] == pytest.approx(bottom, abs=1e-9)
    beacon = np.array([[0.0, 0.0, 0.5]] * 4)
    for parameters, mirror, expected in ((SURFACE, "surface", 0.13), (BOTTOM, "bottom", 0.59)):
        c = channel(noise_of(**{f"{mirror}_echo": 0.1}), np.array([15.0, 0.0, 2.0]), **parameters)
        c.set(beacon_position=beacon)
        y = tick(c)
        assert y["range"][0] - y["true_range"][0] == pytest.approx(expected, abs=0.005)


def test_no_echo_arrives_that_is_not_drawn() -> None:
    assert np.isnan(late(SURFACE, surface_echo=0.6)).all()
    assert np.isnan(late(BOTTOM, bottom_echo=0.6)).all()


def test_the_first_of_two_echoes_counts() -> None:
    both = {**SURFACE, **BOTTOM}
    alone = late(SURFACE, surface_echo=0.1)
    assert late(both, surface_echo=0.1, bottom_echo=0.1) == alone
    assert late(both, surface_echo=0.9, bottom_echo=0.1) == late(BOTTOM, bottom_echo=0.1)


def test_a_direct_path_that_arrives_has_no_echo() -> None:
    alone = {**SURFACE, "loss_probability": 0.1}
    assert late(alone, surface_echo=0.1) == [0.0] * 4


@pytest.mark.parametrize("schedule", [1, 2])
def test_every_beacon_has_its_echo_in_each_schedule(schedule: int) -> None:
    c = channel(noise_of(surface_echo=0.1), **SURFACE, schedule=schedule)
    for _ in range(4):
        y = tick(c)
    assert list(y["reception_count"]) == ([1] * 4 if schedule == 1 else [4] * 4)
    for i, z in enumerate(CROSS):
        image = z * [1, 1, -1]
        assert y["range"][i] == pytest.approx(np.linalg.norm(DIVER - image), abs=1e-9)
        assert y["arrival_epoch"][i] - y["range_epoch"][i] == pytest.approx(
            np.linalg.norm(DIVER - image) / 1500, abs=1e-12
        )


def test_an_echo_meets_the_moving_diver() -> None:
    velocity = np.array([0.5, 0.2, -0.1])
    c = channel(noise_of(surface_echo=0.1), **SURFACE)
    c.set(target_velocity=velocity)
    y = tick(c)
    offset = DIVER - CROSS[0] * [1, 1, -1]
    tau = brentq(lambda s: np.linalg.norm(offset + velocity * s) - 1500 * s, 0, 1, xtol=1e-16)
    assert y["range"][0] == pytest.approx(1500 * tau, abs=1e-9)


def test_a_beacon_above_the_water_has_an_echo_that_is_not_early() -> None:
    c = channel(noise_of(surface_echo=0.1), **SURFACE)
    c.set(beacon_position=CROSS * [1, 1, -1])
    y = tick(c)
    assert y["range"][0] == pytest.approx(y["true_range"][0], abs=1e-9)


# --- The profile of the speed of sound -----------------------------------------------------------

PROFILE = {"profile_count": 3, "profile_depth": (2.0, 6.0, 20.0, *[0.0] * 5),
           "profile_speed": (1530.0, 1510.0, 1500.0, *[1500.0] * 5)}


def slowness(depth: Any) -> Any:
    return np.interp(depth, (2.0, 6.0, 20.0), 1 / np.array([1530.0, 1510.0, 1500.0]))


def integrated(begin: float, end: float) -> float:
    """Mean of 1/c between two depths, by many small parts."""
    z = np.linspace(begin, end, 200_001)
    return float(np.mean((slowness(z[1:]) + slowness(z[:-1])) / 2))


@pytest.mark.parametrize("depth", [0.5, 0.6, 2.0, 5.0, 11.0, 30.0])
def test_a_straight_ray_takes_the_mean_slowness_of_the_depths_it_crosses(depth: float) -> None:
    diver = np.array([9.0, -4.0, depth])
    c = channel(diver=diver, assumed_sound_speed=1500.0, **PROFILE)
    y = tick(c)
    length = float(np.linalg.norm(diver - CROSS[0]))
    time = length * integrated(CROSS[0][2], depth)
    assert y["true_range"][0] == pytest.approx(length, abs=1e-9)
    assert y["range"][0] == pytest.approx(1500.0 * time, abs=1e-7)
    assert y["arrival_epoch"][0] - y["range_epoch"][0] == pytest.approx(time, abs=1e-12)


def test_an_echo_crosses_the_profile_twice() -> None:
    c = channel(noise_of(bottom_echo=0.1), np.array([9.0, -4.0, 5.0]), **PROFILE,
                loss_probability=1.0, bottom_echo_probability=0.5, water_depth=12.0)
    y = tick(c)
    z = CROSS[0][2]
    length = hypot(9.0 - CROSS[0][0], -4.0 - CROSS[0][1], 24.0 - z - 5.0)
    mean = (integrated(z, 12.0) * (12.0 - z) + integrated(5.0, 12.0) * 7.0) / (24.0 - z - 5.0)
    assert y["range"][0] == pytest.approx(1500.0 * length * mean, abs=1e-7)


def test_a_uniform_profile_changes_nothing_but_rounding() -> None:
    same = {"profile_count": 2, "profile_depth": (0.0, 9.0, *[0.0] * 6),
            "profile_speed": (1480.0,) * 8}
    plain, uniform = (tick(channel(sound_speed=1480.0, **more)) for more in ({}, same))
    assert uniform["range"] == pytest.approx(plain["range"], abs=1e-9)
