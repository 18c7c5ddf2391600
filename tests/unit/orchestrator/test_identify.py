"""What a log tells about its device: the likelihood against exact ones, and each number."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import as_recorded
import numpy as np
import pytest
import sblcosim
from made_logs import made, on_a_boat
from quick import one_in
from recorded_sets import RECORDED, needs_recorded
from sblcosim.data.samples import Samples
from sblcosim.errors import ConfigurationError
from sblcosim.identification import batch, device
from sblcosim.identification.device import (
    MOST_RANGES,
    NONE_LATE,
    NOT,
    TURNS,
    YES,
    Assumed,
    Number,
    device_of,
    rounds,
)
from sblcosim.identification.fit import fit
from sblcosim.identification.innovations import (
    MOST_BEACONS,
    OFFSET,
    PARAMETERS,
    PRIOR,
    Ranges,
    evaluate,
    likelihoods,
)
from sblcosim.identification.losses import losses, wilson
from sblcosim.identification.path import noise_of, smoothed, start
from sblcosim.identification.positions import parts
from sblcosim.identification.run import identify
from sblcosim.identification.swings import CarrierSwing, swings_of
from sblcosim.logs.log import Log
from sblcosim.processing.workflow import process
from scipy import stats
from scipy.integrate import quad
from scipy.linalg import solveh_banded
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu
from seams import Seam

FAR = 1e5
NEVER_LATE = (1e-12, 1.0)
BEACONS = np.array([[40.0, 40.0, 14.0], [-40.0, 40.0, 12.5], [-40.0, -40.0, 13.0],
                    [40.0, -40.0, 14.5]])
SURVEY = Assumed(place_std=0.3, place_down_std=0.3)


def prior(**changes: float) -> dict[str, float]:
    return {**dict.fromkeys(PRIOR, 0.0), "position_std": 2.0, "velocity_std": 0.5, **changes}


def line(values: Any, time: Any, **changes: float) -> Ranges:
    """Readings of a position on a line: ranges to something far away."""
    n = len(values)
    place = np.zeros((n, 3))
    place[:, 0] = -FAR
    return Ranges(
        np.asarray(time, float), np.zeros(n, np.intp), np.asarray(values) + FAR, place,
        np.zeros(n), np.zeros(n), prior(**changes), 1,
    )


def covariance(time: Any, std: float, psd: float) -> Any:
    """Of readings of a position with white acceleration."""
    t = np.asarray(time) - time[0]
    least, most = np.minimum.outer(t, t), np.maximum.outer(t, t)
    walk = psd * (least**3 / 3 + least**2 * (most - least) / 2)
    return 4.0 + 0.25 * np.outer(t, t) + walk + std**2 * np.eye(len(t))


def test_without_late_ranges_and_turns_it_is_the_likelihood_of_a_normal_distribution() -> None:
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.2, 2.0, 40))
    values = rng.multivariate_normal(np.zeros(40), covariance(time, 0.1, 0.02))
    sets = np.array([[std, *NEVER_LATE, psd, 1.0, 1.0, 0.0]
                     for std in (0.1, 0.3) for psd in (0.02, 1)])
    exact = [
        stats.multivariate_normal.logpdf(values, np.zeros(40), covariance(time, p[0], p[3]))
        for p in sets
    ]
    # Some ranges may be wrong.
    assert likelihoods(line(values, time), sets) == pytest.approx(exact, abs=5e-3)


def test_an_offset_that_walks_has_the_covariance_of_a_walk() -> None:
    rng = np.random.default_rng(2)
    time = np.cumsum(rng.uniform(0.2, 2.0, 40))
    walk = 0.2
    walked = walk**2 * np.minimum.outer(time - time[0], time - time[0])
    exact = covariance(time, 0.1, 0.02) + walked + 0.5**2
    values = rng.multivariate_normal(np.zeros(40), exact)
    p = np.array([[0.1, *NEVER_LATE, 0.02, 1.0, 1.0, walk]])
    found = likelihoods(line(values, time, offset_std=0.5), p)[0]
    assert found == pytest.approx(
        stats.multivariate_normal.logpdf(values, np.zeros(40), exact), abs=5e-3
    )


def test_each_set_of_parameters_gives_what_it_gives_alone() -> None:
    values, time = np.sin(np.arange(30.0)), np.arange(30.0)
    sets = np.array([[0.1 + 0.01 * i, 0.05, 1.0, 0.01, 0.1, 0.5, 0.01] for i in range(11)])
    together = likelihoods(line(values, time), sets, 6)
    alone = [likelihoods(line(values, time), one[None], 6)[0] for one in sets]
    assert together.tolist() == alone


def mixture(residual: Any, var: float, share: float, mean: float) -> Any:
    """Density of a residual that may be late."""
    std = np.sqrt(var)
    late = stats.exponnorm.pdf(residual, mean / std, 0, std)
    return (1 - share) * stats.norm.pdf(residual, 0, std) + share * late


@pytest.mark.parametrize("value", [-1.0, 0.0, 0.4, 1.5, 6.0])
def test_a_range_that_may_be_late_has_the_density_and_the_moments_of_its_mixture(
    value: float
) -> None:
    std, share, mean, spread = 0.1, 0.2, 1.5, 0.3
    p = np.array([[std, share, mean, 0.01, 1.0, 1.0, 0.0]])
    found = evaluate(line([value], [0.0], position_std=spread), p)
    density = mixture(value, std**2 + spread**2, share, mean) + 1e-4 / 50
    assert found.likelihood[0] == pytest.approx(np.log(density), abs=1e-5)

    def weight(x: float) -> float:
        own = mixture(value - x, std**2, share, mean) + 1e-4 / 50
        return float(stats.norm.pdf(x, 0, spread) * own)

    total, first, second = (
        quad(lambda x, k=k: x**k * weight(x), -3, 3, points=[0.0, value], epsabs=1e-10)[0]
        for k in range(3)
    )
    assert found.mean[0, 0] == pytest.approx(first / total, abs=1e-4)
    assert found.covariance[0, 0, 0] == pytest.approx(
        second / total - (first / total) ** 2, abs=1e-4
    )


def test_a_turn_between_two_ranges_is_one_of_two_hypotheses() -> None:
    std, rate, turn, dt = 0.1, 0.2, 0.8, 1.5
    values, time = [0.3, 2.0], [0.0, dt]
    p = np.array([[std, *NEVER_LATE, 1e-9, rate, turn, 0.0]])
    plain = covariance(time, std, 1e-9)
    turned = plain + np.diag([0.0, turn**2 * dt**2 / 3])
    chance = 1 - np.exp(-rate * dt)
    exact = np.log(sum(
        w * stats.multivariate_normal.pdf(values, np.zeros(2), c)
        for w, c in ((1 - chance, plain), (chance, turned))
    ))
    assert likelihoods(line(values, time), p, 2)[0] == pytest.approx(exact, abs=5e-4)
    shown = evaluate(line(values, time), p, 2).by_range["turn"][0, 1]
    assert shown == pytest.approx(chance * stats.multivariate_normal.pdf(
        values, np.zeros(2), turned) / np.exp(exact), abs=1e-3)


@pytest.mark.parametrize(("std", "psd"), [(0.05, 3.0), (2.0, 0.3), (0.02, 30.0)])
def test_what_is_fitted_does_not_depend_on_the_first_guess_of_the_noise(
    std: float, psd: float
) -> None:
    rng = np.random.default_rng(8)
    time = np.cumsum(rng.uniform(0.3, 1.5, 150))
    values = rng.multivariate_normal(np.zeros(150), covariance(time, std, psd))
    found = [
        fit(line(values, time), guess, late=False, walk=False) for guess in (0.003, 0.03, 0.3, 3.0)
    ]
    assert np.ptp([it.likelihood for it in found]) < 0.01


def test_the_smooth_path_is_that_of_the_dense_problem() -> None:
    rng = np.random.default_rng(2)
    time = np.cumsum(rng.uniform(0.5, 1.5, 25))
    values = rng.normal(size=25) + 10
    t = time - time[0]
    wide = covariance(time, 0.0, 0.05) - 4.0 - 0.25 * np.outer(t, t) + 1e7 + 1e5 * np.outer(t, t)
    dense = wide @ np.linalg.solve(wide + 0.09 * np.eye(25), values)
    assert smoothed(time, values, 0.3, 0.05)[0] == pytest.approx(dense, abs=1e-3)


def test_a_start_is_found_although_a_range_is_late() -> None:
    time, beacon = np.arange(12.0), np.arange(12) % 4
    track = np.array([10.0, -20.0]) + time[:, None] * [0.3, 0.4]
    place, down = BEACONS[beacon], np.full(12, 8.0)
    ranges = np.linalg.norm(np.column_stack([track, down]) - place, axis=1)
    ranges[5] += 25.0
    at, std = start(time, beacon, ranges, place, down, 0.1)
    assert at == pytest.approx([10.0, -20.0, 0.3, 0.4], abs=0.2)
    assert 0 < std < 1
    assert noise_of(time, ranges, beacon) < 0.3


@pytest.mark.parametrize("moved", [(0.0, 0.0), (1024.0, -2048.0), (0.0, 2000.0), (-1500.0, 900.0)])
def test_a_start_is_the_same_wherever_the_zero_of_the_map_is(moved: tuple[float, float]) -> None:
    """Of six ranges one is late: from few of the first guesses the best fit is found."""
    beacons = np.array([[55.0, 45.0, 12.0], [52.0, 17.0, 12.0], [-51.0, -38.0, 12.0]])
    time, beacon = np.arange(6.0), np.arange(6) % 3
    track = np.array([46.0, -45.0]) + time[:, None] * [-0.4, 0.1]
    place, down = beacons[beacon], np.full(6, 8.0)
    ranges = np.linalg.norm(np.column_stack([track, down]) - place, axis=1)
    ranges += [-0.1, -0.2, 0.0, 0.1, 40.1, 0.0]
    at, _ = start(time, beacon, ranges, place + np.array([*moved, 0.0]), down, 0.1)
    assert at - [*moved, 0.0, 0.0] == pytest.approx([46.047, -44.449, -0.470, -0.726], abs=2e-3)


# --- Losses and positions -------------------------------------------------------------------------


def test_losses_are_counted_in_the_slots_of_each_beacon() -> None:
    heard = np.array([0, 1, 2, 5, 6, 8, 9, 10, 11, 12, 13, 14, 15])
    found = losses(heard * 4 * 10**9, np.zeros(13, np.intp))
    assert found is not None
    assert found.slot_s == 4.0
    assert found.share[0] == pytest.approx(3 / 15)
    assert found.burst is not None
    assert found.burst[0] == pytest.approx(1.5)
    assert losses(heard * 10**9, np.zeros(13, np.intp), slot_s=1.0).share[0] == found.share[0]


@pytest.mark.parametrize(("lost", "stays"), [(0.1, 0.1), (0.5, 0.5), (0.3, 0.8)])
def test_intervals_of_losses_hold_also_if_they_come_in_bursts(lost: float, stays: float) -> None:
    """A chain of two states; ``stays``: probability that a loss follows a loss."""
    held = np.zeros(2)
    begins = lost * (1 - stays) / (1 - lost)
    for seed in range(200):
        rng = np.random.default_rng(seed)
        away, heard = False, []
        for k in range(400):
            away = rng.random() < (stays if away else begins)
            heard += [] if away else [k]
        found = losses(np.array(heard) * 10**9, np.zeros(len(heard), np.intp))
        assert found is not None
        assert found.burst is not None
        held += [found.share[1] <= lost <= found.share[2],
                 found.burst[1] <= 1 / (1 - stays) <= found.burst[2]]
    assert (held / 200 > 0.9).all()


def test_pings_without_a_schedule_and_none_lost() -> None:
    rng = np.random.default_rng(3)
    times = np.cumsum(rng.exponential(1e9, 50)).astype(np.int64)
    assert losses(times, np.zeros(50, np.intp)) is None
    assert losses(times[:5], np.zeros(5, np.intp)) is None
    every = losses(np.arange(50) * 10**9, np.zeros(50, np.intp))
    assert every is not None
    assert (every.burst, every.share[0]) == (None, 0)
    assert every.share[2] == wilson(0, 49)[2] > 0


def test_a_share_that_is_nil_or_all_has_that_as_an_end() -> None:
    for of in [*range(1, 2000), 35_999, 0.7, 123.4]:
        assert wilson(0, of)[:2] == (0, 0)
        assert wilson(of, of)[0] == wilson(of, of)[2] == 1
        assert wilson(0, of)[2] > 0


def wandering(
    seed: int, white: float, slow: float, tau: float, n: int = 400, axes: int = 2
) -> Any:
    rng = np.random.default_rng(seed)
    decay, error = np.exp(-1 / tau), slow * rng.normal(size=(n, axes))
    for i in range(1, n):
        error[i] = decay * error[i - 1] + np.sqrt(1 - decay**2) * error[i]
    return error + white * rng.normal(size=(n, axes)) + 30.0


@pytest.mark.parametrize("true", [(0.1, 1.2, 20.0), (0.3, 0.3, 8.0)])
def test_white_and_slow_parts_of_positions(true: tuple[float, float, float]) -> None:
    time, runs = np.arange(120.0), 5
    held = np.zeros(3)
    for seed in range(runs):
        walks = [wandering(4 * seed + b, *true, n=120) for b in range(4)]
        found = parts([(time, walk) for walk in walks])
        assert found is not None
        held += (found.ends[0] < np.log(true)) & (np.log(true) < found.ends[1])
        assert found.span_s == 4 * 2 * 119.0
    assert (held >= 4).all()


def test_a_part_that_is_not_in_the_positions_is_not_there() -> None:
    time = np.arange(200.0)
    for seed in range(2):
        white, slow = (parts([(time, wandering(seed, *p, n=200))])
                       for p in ((0.3, 0.0, 9.0), (0.0, 1.0, 30.0)))
        assert white is not None
        assert slow is not None
        assert white.there == (True, False)
        assert slow.there == (False, True)


def test_positions_that_are_few_or_do_not_change_have_no_parts() -> None:
    time = np.arange(400.0)
    assert parts([(time, np.ones((400, 2)))]) is None
    assert parts([(time[:10], wandering(1, 0.1, 1.0, 40.0)[:10])]) is None


def test_a_carrier_that_does_not_move_says_nothing_of_the_others() -> None:
    time = np.arange(60.0)
    walk = (time, wandering(2, 0.3, 1.0, 9.0, n=60))
    alone, beside = parts([walk]), parts([walk, (time, np.ones((60, 2)))])
    assert alone is not None
    assert beside is not None
    assert beside.at.tolist() == alone.at.tolist()
    assert beside.span_s == alone.span_s == 2 * 59.0


@pytest.mark.parametrize("frequency", [0.004, 0.3])
def test_swings_of_a_known_frequency_do_not_count_as_errors(frequency: float) -> None:
    time = np.arange(200.0)
    swing = 2.1 * np.sin(2 * np.pi * frequency * time + 1.0)
    moved = wandering(3, 0.1, 0.0, 9.0, n=200) + swing[:, None]
    found = parts([(time, moved)], [CarrierSwing(frequency, 2.1)])
    assert found is not None
    assert found.there == (True, False)
    assert np.exp(found.at[0]) == pytest.approx(0.1, rel=0.1)
    alone = parts([(time, moved)])
    assert alone is not None
    assert np.exp(alone.at[:2]).max() > 1


def test_a_scenario_gives_the_swings_of_what_carries_the_beacons() -> None:
    platform = sblcosim.load("realistic-dive").platform
    assert swings_of(platform, 0.0) == (CarrierSwing(0.004, 2.1), CarrierSwing(0.003, 2.1))
    turned = {s.frequency for s in swings_of(platform, 2.0)}
    assert turned == {0.004, 0.003, platform.yaw_frequency_Hz, platform.roll_frequency_Hz}
    assert swings_of(sblcosim.load("gps-buoys").platform, 40.0) == ()


def test_swings_of_one_frequency_are_one_of_the_larger_size() -> None:
    """A turn moves a point along its arc; 6° on an arm of 3 m are a 60th of its circle."""
    platform = sblcosim.load("realistic-dive", {
        "platform.roll_amplitude_deg": 6.0, "platform.roll_frequency_Hz": 0.25,
        "platform.pitch_amplitude_deg": 3.0, "platform.pitch_frequency_Hz": 0.25,
        "platform.yaw_amplitude_deg": 6.0, "platform.yaw_frequency_Hz": 0.05,
        "platform.surge_amplitude_m": 1.5, "platform.surge_frequency_Hz": 0.05,
        "platform.sway_amplitude_m": 0.7, "platform.sway_frequency_Hz": 0.1,
    }).platform  # fmt: skip
    found = {swing.frequency: swing.amplitude for swing in swings_of(platform, 3.0)}
    assert found == pytest.approx({0.25: 2 * np.pi * 3.0 / 60, 0.05: 1.5, 0.1: 0.7})


# --- Devices --------------------------------------------------------------------------------------


@cache
def dive(name: str = "harbour-lbl", **changes: Any) -> Any:
    return sblcosim.run(name, overrides={k.replace("__", "."): v for k, v in changes.items()})


@cache
def found(name: str = "harbour-lbl", **changes: Any) -> Any:
    return identify(dive(name, **changes))


def numbers(answer: Any) -> dict[str, Any]:
    return {n.parameter: n for n in answer.device.numbers}


def test_a_dive_in_the_harbour_gives_its_device_back() -> None:
    it = numbers(found())
    assert {n for n, v in it.items() if v.told == YES} >= {
        "range_std", "range_scale", "depth_std", "loss_share", "loss_burst", "turn_std",
        *(f"range_offset[{b}]" for b in range(1, 5)),
    }
    assert 0.09 < it["range_std"].estimate < 0.11
    assert it["range_std"].low < it["range_std"].estimate < it["range_std"].high
    assert it["range_scale"].estimate == pytest.approx(1500 / 1510 - 1, abs=0.01)
    assert it["depth_std"].estimate == pytest.approx(0.05, abs=0.006)
    assert it["loss_share"].low < 0.1 < it["loss_share"].high
    assert it["turn_rate"].low < 7 / 640 < it["turn_rate"].high
    assert it["late_share"].told == it["late_mean"].told == it["acceleration_psd"].told == TURNS
    assert it["gps_std"].told == NOT
    assert it["gps_std"].estimate is None


def test_without_late_ranges_it_says_so_and_the_noise_is_right() -> None:
    it = numbers(found(acoustics__outlier_probability=0.0))
    assert it["late_share"].told == it["late_mean"].told == NONE_LATE
    assert it["range_std"].low < 0.1 < it["range_std"].high
    answer = found(acoustics__outlier_probability=0.0)
    assert "acoustics.outlier_probability" not in answer.overrides()  # the base's is kept


def drawn(**changes: Any) -> Any:
    return found(
        target__trajectory="white_noise_acceleration", target__acceleration_psd_m2_s3=0.002,
        target__initial_position_m=(0.0, 5.0, 8.0), target__initial_velocity_std_m_s=0.2,
        time__duration_s=300.0, time__sampling_time_s=0.5, **changes,
    )


def test_where_motion_is_drawn_it_tells_late_ranges_and_the_motion() -> None:
    it = numbers(drawn())
    assert it["late_share"].told == it["late_mean"].told == it["acceleration_psd"].told == YES
    assert it["turn_rate"].told == NOT
    assert 0.02 < it["late_share"].estimate < 0.09
    assert 1.0 < it["late_mean"].estimate < 3.5
    assert 0.001 < it["acceleration_psd"].estimate < 0.004


def test_a_platform_tells_its_gps() -> None:
    it = numbers(found("realistic-dive"))
    assert it["gps_std"].told == YES
    assert it["gps_std"].estimate == pytest.approx(0.1, rel=0.2)
    # Four correlation times: the slow part may be slower than it looks.
    assert it["gps_markov_std"].told == it["gps_correlation_time"].told == NOT
    assert "own swings" in it["acceleration_psd"].explanation
    assert it["acceleration_psd"].told == NOT
    assert "too long for this log" in it["gps_markov_std"].explanation
    assert "relative to the platform" in found("realistic-dive").text()


def test_noise_of_the_imu_does_not_count_as_that_of_ranges() -> None:
    it = numbers(found("paper-scenario-1"))["range_std"]
    assert it.told == YES
    assert 0.09 < it.estimate < 0.105


def test_ranges_to_buoys_do_not_tell_their_noise_apart_from_that_of_the_gps() -> None:
    it = numbers(found("gps-buoys"))
    for name in ("range_std", "range_scale", "range_offset[1]"):
        assert it[name].told == NOT
        assert "reported positions" in it[name].explanation
    assert it["depth_std"].told == it["gps_std"].told == YES


def heard(**changes: Any) -> Samples:
    """A diver in the middle, on a circle."""
    n = 300
    rng = np.random.default_rng(4)
    time, beacon = np.arange(1.0, n + 1), np.arange(n) % 4
    track = np.column_stack([
        8 * np.cos(time / 30), 8 * np.sin(time / 30), np.full(n, 8.0),
    ])
    ranges = np.linalg.norm(track - BEACONS[beacon], axis=1) + 0.1 * rng.normal(size=n)
    ns = np.rint(time * 1e9).astype(np.int64)
    made = Samples(
        0, ns, 8 + 0.05 * rng.normal(size=n), ns, beacon, ranges, np.zeros(n, bool),
        BEACONS[beacon], np.zeros((n, 3)),
    )
    return replace(made, **changes)


@pytest.mark.parametrize("walk", [0.0, 0.02, 0.05])
def test_offsets_that_walk_are_told_and_then_count_as_noise(walk: float) -> None:
    samples = heard()
    rng = np.random.default_rng(5)
    steps = walk * rng.normal(size=(300, 4)).cumsum(axis=0)  # a range a second
    device = device_of(
        replace(samples, range=samples.range + steps[np.arange(300), samples.beacon]),
        known=Assumed(sound_speed=1e6),
    )
    it = {n.parameter: n for n in device.numbers}
    assert it["range_std"].low < 0.1 < it["range_std"].high
    if walk == 0:
        assert it["range_walk"].told == NOT
        assert device.white_std() == it["range_std"].estimate * device.wider
    else:
        assert it["range_walk"].told == YES
        assert it["range_walk"].low < walk < it["range_walk"].high
        assert any("offsets walk" in line for line in device.remarks)
        assert device.white_std() > np.hypot(0.1, walk * np.sqrt(300 / 6) / 2)


def offsets_of(*offsets: float) -> list[Number]:
    """Told offsets with a standard deviation of 0.15 m."""
    half = 0.15 * stats.norm.ppf(0.975)
    return [Number(f"range_offset[{i + 1}]", it, it - half, it + half, "m", YES, "")
            for i, it in enumerate(offsets)]


def test_late_ranges_that_receivers_expect_are_no_noise_of_an_offset_that_walks() -> None:
    share, mean, walk = 0.2, 1.5, 0.05
    logs = [np.log(0.1), np.log(share / (1 - share)), np.log(mean), -6.0, -3.0, -1.0, np.log(walk)]
    device = device_of(heard())
    motion = replace(device.motion, names=PARAMETERS, at=np.array(logs))
    device = replace(device, motion=motion, numbers=offsets_of(0.0, 0.9, -0.9, 0.0), wider=1.5)
    wanders = walk**2 * np.ptp(device.ranges.time) / 6 + device.offsets_std**2
    for expected, more in ((0.0, 0.2), (0.15, 0.05), (0.3, 0.0)):
        noise = np.sqrt(0.1**2 + wanders + more * mean**2 * (2 - more))
        assert device.white_std(expected) == pytest.approx(1.5 * noise)


@pytest.mark.parametrize(("offsets", "found"), [
    ([0.3, 0.3, 0.3, 0.3], 0.0),
    ([0.2, 0.4, 0.25, 0.35], 0.0),  # by chance
    ([0.0, 0.9, -0.9, 0.0], np.sqrt(0.54 - 0.15**2)),
    ([0.9], 0.0),
])  # fmt: skip
def test_offsets_differ_by_more_than_their_uncertainty(
    offsets: list[float], found: float
) -> None:
    """With equal uncertainties, it is the variance of the offsets minus that of their errors."""
    rows = offsets_of(*offsets)
    rows.append(Number("range_offset[9]", 5.0, 4.0, 6.0, "m", NOT, ""))
    rows.append(Number("depth_std", 5.0, 4.0, 6.0, "m", YES, ""))
    device = replace(device_of(heard()), numbers=rows)
    assert device.offsets_std == pytest.approx(found, rel=1e-5)


def placed(known: float, seed: int, offset: float = 0.0, **keys: Any) -> Log:
    """A log of `made` with six beacons whose places and ranges have errors of their own."""
    random = np.random.default_rng(seed)
    angles = np.arange(6) * np.pi / 3
    places = np.column_stack([40 * np.cos(angles), 40 * np.sin(angles), np.full(6, 12.0)])
    log = made(beacons=places, offsets=offset * random.standard_normal(6), seed=seed,
               **{"seconds": 600, "std": 0.05, **keys})
    said = np.column_stack([known * random.standard_normal((6, 2)), np.zeros(6)])
    heard = log.receptions
    return replace(log, receptions=replace(
        heard, beacon_position=heard.beacon_position + said[heard.beacon]))


@one_in(2)
@pytest.mark.parametrize(("std", "offset"), [
    (0.03, 0.0), (0.3, 0.0), (1.0, 0.0), (0.03, 0.5),
])  # fmt: skip
def test_ranges_tell_how_well_places_of_beacons_are_known(std: float, offset: float) -> None:
    found = []
    for seed in range(2):
        known = identify(placed(std, seed, offset))
        assert known.device.place_std is not None
        found.append(known.device.place_std)
        assert known.scenario().platform.mounting_std_m == known.device.place_std
    expected = float(np.hypot(std, offset))
    assert 0.5 * expected < float(np.exp(np.mean(np.log(found)))) < 2 * expected


@pytest.mark.parametrize("log", [
    pytest.param(lambda: placed(0.3, 1, seconds=40, std=0.5), id="few ranges"),
    pytest.param(lambda: placed(0.3, 1, seconds=80, std=0.5), id="to a factor of three"),
    pytest.param(lambda: on_a_boat(seconds=300), id="boat"),
])  # fmt: skip
def test_where_they_do_not_tell_it_the_assumed_value_stays(log: Any) -> None:
    found = identify(log())
    assert found.device.place_std is None
    assert "platform.mounting_std_m" not in found.overrides()


@pytest.mark.slow
@pytest.mark.parametrize(("known", "least", "most"), [(0.01, 0.1, 0.8), (1.0, 1.5, 4.0)])
def test_receivers_claim_what_places_are_known_to(known: float, least: float, most: float) -> None:
    log = placed(known, 2)
    scenario = identify(log).scenario()
    assumed = scenario.override({"platform.mounting_std_m": 0.3}.items())
    rows = [process(log, scenario=it).receivers.loc["long_baseline"] for it in (scenario, assumed)]
    assert least < rows[0].claimed_rms_m / rows[1].claimed_rms_m < most
    assert rows[0].horizontal_rms_m < 1.1 * rows[1].horizontal_rms_m


def test_an_offset_of_all_beacons_is_that_of_one_where_there_is_only_one() -> None:
    time, random = np.arange(40.0), np.random.default_rng(3)
    values = 3.0 + random.normal(0.0, 0.3, len(time))
    at = np.array([[0.3, 1e-9, 1.0, 1e-3, 1.0, 1.0, 0.0]])
    each = [float(likelihoods(line(values, time, **{name: 2.0}), at)[0])
            for name in ("clock_std", "offset_std", "scale_std")]
    assert each[0] == pytest.approx(each[1], rel=1e-9)
    assert each[0] != pytest.approx(float(likelihoods(line(values, time), at)[0]), rel=1e-3)


def test_intervals_are_wider_where_residuals_resemble_the_ones_before() -> None:
    samples, number = heard(), np.arange(300)
    waves = 0.3 * np.sin(2 * np.pi * (number // 4) / 8 + samples.beacon)
    device = device_of(replace(samples, range=samples.range + waves))
    assert device.wider > 1.3
    row = next(n for n in device.numbers if n.parameter == "range_std")
    sd = device.motion.coordinate("range_std")[1]
    width = 2 * stats.norm.ppf(0.975) * np.hypot(sd * device.wider, 0.02)
    assert np.log(row.high / row.low) == pytest.approx(width, rel=1e-3)


def with_corners(seed: int, walk: float, sinks: float = 0.0) -> Samples:
    """A diver who turns every 75 s, and whose depth does so, too; offsets of beacons may walk."""
    rng, number = np.random.default_rng(seed), np.arange(300)
    angle = rng.uniform(0, 2 * np.pi, 4)[number // 75]
    track = np.column_stack([
        np.cumsum(0.5 * np.cos(angle)), np.cumsum(0.5 * np.sin(angle)),
        8.0 + sinks * np.abs(number % 150 - 75),
    ])  # fmt: skip
    one = heard()
    far = np.linalg.norm(track - BEACONS[one.beacon], axis=1) + 0.1 * rng.normal(size=300)
    depth = track[:, 2] + 0.05 * rng.normal(size=300)
    walks = walk * np.random.default_rng(seed + 50).normal(size=(300, 4)).cumsum(axis=0)
    return replace(one, range=far + walks[number, one.beacon], depth=depth)


def test_what_looks_like_a_walk_may_have_been_the_turns() -> None:
    """A walk explains much without turns, and little with them."""
    for seed, walk, expected in ((11, 0.01, NOT), (2, 0.012, YES)):
        told = {n.parameter: n.told for n in device_of(with_corners(seed, walk)).numbers}
        assert (told["turn_std"], told["range_walk"]) == (YES, expected)


def devices() -> dict[str, Samples]:
    """Of several kinds, and at the limits of what can be told."""
    one, number = heard(), np.arange(300)
    waves = 0.3 * np.sin(2 * np.pi * (number // 4) / 8 + one.beacon)
    late = {k: np.where(number % 60 < k, 0.9, 0.0) for k in (2, 6)}
    turned = np.column_stack([np.zeros((300, 2)), 0.2 * np.sin(number / 9)])
    walk = np.random.default_rng(5).normal(size=(300, 4)).cumsum(axis=0)[number, one.beacon]
    return {
        "plain": one,
        "waves": replace(one, range=one.range + waves),
        **{f"late {k}": replace(one, range=one.range + by) for k, by in late.items()},
        "few late": replace(one, range=one.range + np.where(number % 60 < 1, 0.6, 0.0)),
        **{f"walk {k}": replace(one, range=one.range + k * walk) for k in (0.008, 0.011)},
        "scale": replace(one, range=1.03 * one.range + 0.2 * one.beacon),
        **{f"{n} depths": replace(one, depth_ns=one.depth_ns[:n], depth=one.depth[:n])
           for n in (9, 10)},
        "own places": replace(one, position=one.position + 0.4 * np.sin(
            number / 20 + one.beacon)[:, None]),
        "poses": replace(one, has_pose=np.ones(300, bool), attitude=turned),
        "corners": with_corners(11, 0.01),
        "corners of the depth": with_corners(3, 0.0, sinks=0.2),
    }  # fmt: skip


SWAYING = Assumed(place_noise_std=0.15, place_down_noise_std=0.1, depth_bias_std=0.3,
                  offset_std=1.0, scale_std=0.02, clock_walk_psd=1e-4)  # fmt: skip
KNOWN = {**dict.fromkeys(devices(), Assumed(place_std=0.2, place_down_std=0.1)),
         **{f"{name}, swaying": SWAYING for name in ("plain", "poses", "walk 0.011")}}  # fmt: skip


@pytest.mark.parametrize("name", KNOWN)
@one_in(2)
def test_devices_are_as_recorded(name: str) -> None:
    given = devices()[name.partition(",")[0]]
    body = BEACONS if given.has_pose.any() else None
    device = device_of(given, body, KNOWN[name])
    as_recorded.check(f"device {name}", {
        "numbers": [as_recorded.fields_of(it) for it in device.numbers],
        "wider": device.wider, "remarks": device.remarks,
        "known": dict(device.known), "white": device.white_std(),
    }, as_recorded.SEARCHED)  # fmt: skip


def test_scale_and_offset_are_not_told_where_distances_are_alike() -> None:
    device = device_of(heard(), known=Assumed(sound_speed=1e6))
    it = {n.parameter: n for n in device.numbers}
    assert max(map(abs, device.correlation.values())) > 0.95
    assert it["range_scale"].told == NOT
    assert "correlation" in it["range_scale"].explanation
    assert "range_scale" not in device.known


def test_without_depth_the_diver_is_in_a_plane_and_that_is_said() -> None:
    none = {"depth_ns": np.empty(0, np.int64), "depth": np.empty(0)}
    device = device_of(heard(**none))
    assert {n.parameter: n.told for n in device.numbers}["depth_std"] == NOT
    assert any("no depth" in line for line in device.remarks)


def test_long_logs_are_thinned_in_whole_rounds() -> None:
    assert rounds(MOST_RANGES, 4).tolist() == [*range(MOST_RANGES)]
    for n in (MOST_RANGES + 1, 36_000, 1_000_000):
        kept = rounds(n, 4)
        assert MOST_RANGES // 2 < len(kept) <= MOST_RANGES + 8
        assert np.ptp(np.unique(kept % 4, return_counts=True)[1]) <= 1
        assert kept[0] == 0
        assert kept[-1] > 0.98 * n - 100
        blocks = np.split(kept, np.flatnonzero(np.diff(kept) != 1) + 1)
        assert {len(block) for block in blocks[:-1]} <= {8}  # two rounds of four beacons


@pytest.mark.slow
def test_an_hour_at_ten_ranges_a_second_is_identified() -> None:
    one, times = heard(), 120
    shift = (np.arange(times)[:, None] * 30 * 10**9 + one.range_ns // 10).ravel()
    n = len(shift)
    device = device_of(heard(
        range_ns=shift, depth_ns=shift, depth=np.tile(one.depth, times),
        beacon=np.tile(one.beacon, times), range=np.tile(one.range, times),
        has_pose=np.zeros(n, bool), position=np.tile(one.position, (times, 1)),
        attitude=np.zeros((n, 3)),
    ))
    assert any("of 36,000 ranges" in line for line in device.remarks)
    assert {b.parameter: b.told for b in device.numbers}["range_std"] == YES


def test_of_a_short_log_the_answer_claims_only_what_is_told() -> None:
    short = {"target__waypoint_m": ((0.0, 0.0, 8.0), (24.0, 0.0, 8.0))}
    answer = found("gps-buoys", **short)
    assert numbers(answer)["range_std"].told == NOT
    assert answer.answer.startswith(
        "The log does not tell the noise of a range; late ranges: not in this log."
    )
    assert "too few positions" in numbers(answer)["gps_std"].explanation


@pytest.mark.parametrize("seed", range(4))
def test_a_number_of_the_gps_is_told_if_it_is_known_to_a_factor_below_three(seed: int) -> None:
    """Of 90 positions whose slow part changes within seconds; intervals are of 95 %."""
    wanders = wandering(seed, 0.1, 0.15, 2.5, n=300)[:90]
    one = heard()
    device = device_of(Samples(
        0, one.depth_ns, one.depth, one.range_ns[:90], one.beacon[:90], one.range[:90],
        np.ones(90, bool), np.column_stack([wanders - 30.0, np.zeros(90)]), np.zeros((90, 3)),
    ), BEACONS)  # fmt: skip
    rows = [n for n in device.numbers if n.parameter.startswith("gps")]
    factor = {n.parameter: np.sqrt(n.high / n.low) for n in rows}
    most = np.exp(stats.norm.ppf(0.975) * 0.5)
    assert all(factor[n.parameter] < most for n in rows if n.told == YES)
    untold = [n for n in rows if "only known to a factor of" in n.explanation]
    assert [n.parameter for n in untold] == ["gps_correlation_time"]
    assert untold[0].explanation.endswith(f"a factor of {factor['gps_correlation_time']:.2g}")
    assert untold[0].told == NOT


def test_a_share_of_late_ranges_without_their_mean_is_not_simulated() -> None:
    device = drawn().device
    untold = [replace(n, told=NOT) if n.parameter == "late_mean" else n for n in device.numbers]
    answer = replace(drawn(), device=replace(device, numbers=untold))
    assert "acoustics.outlier_probability" in drawn().overrides()
    assert "acoustics.outlier_probability" not in answer.overrides()
    assert "are late." in answer.answer


def test_late_ranges_are_told_only_if_some_are_late_by_themselves() -> None:
    rng = np.random.default_rng(7)
    tails = heard()
    spread = replace(tails, range=tails.range + 0.06 * rng.standard_t(5, len(tails.range)))
    it = {n.parameter: n for n in device_of(spread, known=SURVEY).numbers}
    assert it["late_share"].told == NONE_LATE


def test_scale_and_offsets_of_beacons_that_are_close_together_hold_the_truth() -> None:
    """A filter is sure of them too early: its offsets are off by three standard deviations here."""
    body = np.array([[3.0, 0, 0.5], [0, 3.0, 0.5], [-3.0, 0, 0.5], [0, -3.0, 0.5]])
    rng, n, offset = np.random.default_rng(0), 160, -0.9
    time, beacon = np.arange(1.0, n + 1), np.arange(n) % 4
    track = np.column_stack([4 + 0.06 * time, 14 - 0.075 * time, np.full(n, 8.0)])
    ranges = np.linalg.norm(track - body[beacon], axis=1) + 0.05 * rng.normal(size=n) + offset
    ns, depth = np.rint(time * 1e9).astype(np.int64), 8 + 0.05 * rng.normal(size=n)
    here = np.full((n, 3), [1e-9, 0, 0])
    device = device_of(
        Samples(0, ns, depth, ns, beacon, ranges, np.ones(n, bool), here, np.zeros((n, 3))), body
    )
    offsets = [n for n in device.numbers if n.parameter.startswith("range_offset")]
    for one in offsets:
        assert one.told == YES
        assert one.low < offset < one.high
    # The filter alone:
    row = OFFSET + np.arange(4)
    mean, covariance = device.of_ranges.mean[0], device.of_ranges.covariance[0]
    assert (mean[row] - offset > 2 * np.sqrt(np.diag(covariance)[row])).all()


@pytest.mark.parametrize(("changes", "message"), [
    ({"range": np.empty(0), "beacon": np.empty(0, np.intp)}, "30 ranges to three beacons"),
    ({"beacon": np.arange(300) % 2}, "30 ranges to three beacons"),
    ({"beacon": np.arange(300) % (MOST_BEACONS + 1)}, f"at most {MOST_BEACONS} beacons"),
])
def test_too_few_ranges_and_too_many_beacons_are_refused(changes: Any, message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        device_of(heard(**changes))


@pytest.mark.parametrize(("silence_s", "refused"), [(3599, False), (3600, True), (86_400, True)])
def test_a_silence_after_which_the_diver_may_be_anywhere_is_refused(
    silence_s: int, refused: bool, seam: Seam
) -> None:
    """As where the clock of a log jumps."""
    log = made(seconds=60)
    heard = log.receptions
    late = np.where(np.arange(60) < 20, 0, silence_s * 10**9)
    log = replace(log, receptions=replace(
        heard, arrival_ns=heard.arrival_ns + late, epoch_ns=heard.epoch_ns + late,
    ))
    taken = OSError("taken")

    def taking(*_: Any) -> None:
        raise taken

    seam.instead(device.noise_of, taking, only=device)
    with pytest.raises(ConfigurationError if refused else OSError) as found:
        sblcosim.identify(log)
    assert found.value is taken or str(found.value) == (
        "log: must have a range at least every 3,600 s, to identify a device, got none for "
        f"{silence_s + 1:,} s, after the first 19 s of ranges: if its clock jumps there, put it "
        "right; else identify one part"
    )


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("solved", [False, True])
def test_ranges_without_a_solution_are_refused_in_words(
    solved: bool, seam: Seam
) -> None:
    """Neither the words of a solver nor a warning of it."""
    def unsolved(*_: Any, **__: Any) -> Any:
        return solveh_banded([[0.0, 9.0], [1.0, 1.0]], [1.0, 1.0])

    def without_numbers(*_: Any) -> Any:
        return SimpleNamespace(motion=SimpleNamespace(parameters=np.sqrt([-1.0])))

    thing, failing = (device.Device, without_numbers) if solved else (device.fit, unsolved)
    seam.instead(thing, failing, only=device)
    with pytest.raises(ConfigurationError, match=r"^log: must have ranges and depths that .* got "
                                                 r"60 ranges in 59\.0 s that none explains"):
        sblcosim.identify(made(seconds=60))


def test_equations_of_all_ranges_that_are_singular_are_told(
    seam: Seam
) -> None:
    """A clock that jumps by a day: without the check of silences, no track fits."""
    seam.instead(splu, lambda _: splu(csc_matrix((3, 3))), only=batch)
    log = on_a_boat(seconds=60)
    with pytest.raises(ConfigurationError, match="that none explains"):
        sblcosim.identify(log)


def test_the_scenario_simulates_the_device_and_keeps_the_rest(tmp_path: Path) -> None:
    answer = found()
    folder = answer.save(tmp_path / "device")
    scenario = sblcosim.load(folder / "scenario.toml")
    known = answer.device.known
    assert scenario.acoustics.range_std_m == known["range_std"]
    assert scenario.target.depth_std_m == known["depth_std"]
    assert scenario.acoustics.loss_probability == known["loss_share"]
    assert scenario.acoustics.sound_speed_m_s == 1500 / (1 + known["range_scale"])
    assert scenario.acoustics.outlier_probability == 0.05  # not told: the base's
    assert scenario.platform.beacon_m == answer.base.platform.beacon_m
    assert {p.name for p in folder.iterdir()} >= {"numbers.csv", "residuals.svg", "scenario.toml"}
    again = identify(sblcosim.run(scenario))
    assert numbers(again)["range_std"].low < known["range_std"] < numbers(again)["range_std"].high


def test_the_answer_says_what_is_told_and_what_is_not() -> None:
    text = found().text()
    assert "A range has a noise of 0." in text
    assert "not told apart from turns" in text
    assert "not in this log" in text
    assert "noise of a depth reading" in found().text(verbose=True)
    assert found().title == "The device of harbour-lbl"
    units = {n.unit for n in found().device.numbers}
    assert {"m", "m/√s", "m²/s³", "1/s"} <= units


# --- Recorded logs, which are not part of the project ---------------------------------------------

def recorded(name: str) -> tuple[Samples, Any]:
    import pandas as pd

    table, truth = (
        pd.read_csv(RECORDED / f"{name}_{part}.csv") for part in ("ranges", "truth")
    )
    n, ns = len(table), np.rint(table["time_s"].to_numpy() * 1e9).astype(np.int64)
    _, beacon = np.unique(table["beacon"].to_numpy(str), return_inverse=True)
    place = np.column_stack([table["beacon_x_m"], table["beacon_y_m"], np.zeros(n)])
    return Samples(
        int(ns[0]), np.empty(0, np.int64), np.empty(0), ns, beacon, table["range_m"].to_numpy(),
        np.zeros(n, bool), place, np.zeros((n, 3)),
    ), truth


def horizontal_rms(device: Any, truth: Any) -> float:
    """Of the filter with the identified numbers [m]."""
    shown = device.of_ranges.by_range
    off = [
        shown[axis][0] - np.interp(device.ranges.time, truth["time_s"], truth[f"{name}_m"])
        for axis, name in (("north", "x"), ("east", "y"))
    ]
    return float(np.sqrt(np.mean(off[0] ** 2 + off[1] ** 2)))


@needs_recorded
def test_a_mower_with_radio_ranges() -> None:
    samples, truth = recorded("plaza2")
    device = device_of(samples, known=Assumed(sound_speed=1e9))
    it = {n.parameter: n for n in device.numbers}
    assert it["range_scale"].told == YES
    assert 0.061 < it["range_scale"].estimate < 0.081
    for b in range(1, 5):
        assert it[f"range_offset[{b}]"].low < 0 < it[f"range_offset[{b}]"].high
    assert horizontal_rms(device, truth) < 0.9


@needs_recorded
def test_a_vehicle_among_moored_beacons() -> None:
    samples, truth = recorded("goats_14")
    device = device_of(samples, known=Assumed(sound_speed=1e9))
    assert horizontal_rms(device, truth) < 6.2
    assert any("offsets walk" in line for line in device.remarks)



def test_the_scenario_simulates_bursts_where_losses_are_not_independent() -> None:
    answer = found(acoustics__loss_burst_length=5.0, acoustics__loss_probability=0.3, seed=2)
    it = numbers(answer)
    assert it["loss_burst"].low < 5 < it["loss_burst"].high
    assert it["loss_share"].low < 0.3 < it["loss_share"].high
    assert answer.scenario().acoustics.loss_burst_length == it["loss_burst"].estimate
    assert found().scenario().acoustics.loss_burst_length == 0.0
