"""Noise through the FMUs: reproducible, independent, and as strong as configured.

The seeds are fixed, so these tests give the same result every time. Every bound is one that a
right implementation misses with a probability of 1e-4 or less for a seed drawn at random.
"""

from __future__ import annotations

from itertools import combinations
from math import exp, log, pi, sqrt
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from .host import NOISY, TICKS, Array, T, assert_same_bits, bits, chain, grid, host

BOTH = pytest.mark.parametrize("fmi", [2, 3])
NOISE_MAKERS = ("target", "platform", "acoustics")
RISK = 1e-4
"""Probability with which a right implementation misses a bound."""
SIGMAS = float(stats.norm.isf(RISK / 2))


def assert_mean(sample: Array, mean: float, std: float) -> None:
    """The mean of independent values of known standard deviation."""
    assert abs(sample.mean() - mean) < SIGMAS * std / sqrt(sample.size)


def assert_std(sample: Array, std: float, mean: float = 0.0) -> None:
    """The standard deviation of independent normals: the sum of squares is chi-squared."""
    low, high = stats.chi2.interval(1 - RISK, sample.size)
    assert low < ((sample - mean) ** 2).sum() / std**2 < high


def assert_share(hits: Any, share: float) -> None:
    hits = np.asarray(hits, bool)
    low, high = stats.binom.interval(1 - RISK, hits.size, share)
    assert low <= hits.sum() <= high


def assert_uncorrelated(a: Array, b: Array) -> None:
    assert abs(np.corrcoef(a, b)[0, 1]) < SIGMAS / sqrt(len(a))


def record_of(name: str, fmi: int = 2, **changes: object) -> Array:
    instance = host(name, fmi).start({**NOISY[name], **changes})
    return instance.run(grid(TICKS), chain()[name])


# Reproducible ------------------------------------------------------------------------------------


@BOTH
@pytest.mark.parametrize("name", NOISE_MAKERS)
def test_seed_and_stream_decide_the_record(name: str, fmi: int) -> None:
    first = record_of(name, fmi)
    assert_same_bits(record_of(name, fmi), first)
    others = [record_of(name, fmi, seed=99), record_of(name, fmi, stream=1)]
    for other in others:
        assert np.any(bits(other) != bits(first), axis=1).mean() > 0.9
    assert np.any(bits(others[0]) != bits(others[1]))


@BOTH
@pytest.mark.parametrize("name", NOISE_MAKERS)
def test_two_side_by_side_equal_two_alone(name: str, fmi: int) -> None:
    pair = [host(name, fmi, number) for number in (0, 1)]
    alone = [record_of(name, fmi, seed=20 + number) for number in (0, 1)]
    for number, instance in enumerate(pair):
        instance.start({**NOISY[name], "seed": 20 + number})
    inputs = chain()[name]
    together: list[list[Array]] = [[], []]
    for i in range(TICKS):
        for instance, rows in zip(pair, together, strict=True):
            if inputs is not None:
                instance.set_inputs(inputs[i])
            instance.step(i * T, T)
            rows.append(instance.outputs())
    for rows, expected in zip(together, alone, strict=True):
        assert_same_bits(np.array(rows), expected)


def test_same_seed_gives_common_random_numbers() -> None:
    """Two designs that differ in size only see the same noise, scaled."""
    acoustics = host("acoustics")
    errors = []
    for std in (0.25, 0.5):
        record = record_of("acoustics", range_std=std, outlier_probability=0.0, clock_drift=0.0)
        errors.append(
            acoustics.column(record, "range") - acoustics.column(record, "true_range")
        )
    np.testing.assert_allclose(errors[1], 2 * errors[0], atol=1e-13)


LAGS = range(-8, 9)


def test_components_of_one_seed_do_not_share_their_noise() -> None:
    """All errors that are drawn at every tick, at the same tick and some ticks apart."""
    steps = 5000
    depth, _ = depth_errors(steps=steps, seed=3, depth_std=1.0)
    gps, imu = platform_errors(
        {"seed": 3, "gps_horizontal_std": 1.0, "gps_vertical_std": 1.0, "imu_tilt_std": 0.01,
         "imu_heading_std": 0.01},
        steps,
    )
    _, ranges = ranging(steps, seed=3, range_std=1.0)
    # Row i of each is tick i + 1; the platform's first row is the draw of the start.
    noises = [
        {"depth": depth},
        {f"{name}[{i}]": errors[1:, i] for name, errors in (("gps", gps), ("imu", imu))
         for i in range(3)},
        {"range": ranges},
    ]
    assert {len(e) for errors in noises for e in errors.values()} == {steps - 1}
    pairs = [
        (f"{a}, {b}", one[a], other[b])
        for one, other in combinations(noises, 2) for a in one for b in other
    ]
    sigmas = stats.norm.isf(RISK / 2 / len(pairs) / len(LAGS))
    for names, a, b in pairs:
        for lag in LAGS:
            early, late = (a, b) if lag >= 0 else (b, a)
            n = len(a) - abs(lag)
            correlation = np.corrcoef(early[:n], late[abs(lag):])[0, 1]
            assert abs(correlation) < sigmas / sqrt(n), (names, lag)


# Acoustics ---------------------------------------------------------------------------------------


def ranging(steps: int, **parameters: object) -> tuple[NDArray[np.bool_], Array]:
    """Which pings were received, and the errors of the ranges received, for a diver at rest."""
    acoustics = host("acoustics").start(
        {"seed": 7, "outlier_probability": 0.0, "loss_probability": 0.0, **parameters}
    )
    acoustics.set({
        "target_position": (15.0, 4.0, 6.0),
        "beacon_position": [[3, 0, 0.5], [0, 3, 0.5], [-3, 0, 0.5], [0, -3, 0.5]],
    })
    record = acoustics.run(grid(steps))
    counts = acoustics.column(record, "reception_count")
    received = np.diff(counts.sum(axis=1)).astype(bool)
    turn = np.arange(steps - 1) % 4
    errors = acoustics.column(record, "range") - acoustics.column(record, "true_range")
    assert np.isfinite(errors).all()
    return received, errors[1:][np.arange(steps - 1), turn][received]


def test_loss_probability_and_range_noise_are_recovered() -> None:
    received, errors = ranging(60_000, loss_probability=0.3, range_std=0.2)
    assert_share(~received, 0.3)
    assert_std(errors, 0.2)
    assert_mean(errors, 0.0, 0.2)
    assert_uncorrelated(errors[1:], errors[:-1])
    assert stats.kstest(errors / 0.2, "norm").pvalue > RISK
    runs = received[1:].astype(float), received[:-1].astype(float)
    assert_uncorrelated(*runs)
    for beacon in range(4):
        assert_share(~received[beacon::4], 0.3)


def test_certain_loss_and_certain_reception() -> None:
    assert not ranging(1000, loss_probability=1.0)[0].any()
    assert ranging(1000, loss_probability=0.0)[0].all()


@pytest.mark.parametrize(
    ("distribution", "spread"), [(1, 1.0), (2, sqrt(pi / 2 - 1))],
    ids=["exponential", "half-normal"],
)
def test_outlier_share_and_size_are_recovered(distribution: int, spread: float) -> None:
    """`spread`: standard deviation over mean. Noise is so small that it hides few outliers."""
    noise, mean, share = 1e-6, 5.0, 0.1
    _, errors = ranging(15_000, range_std=noise, outlier_probability=share, outlier_mean=mean,
                        outlier_distribution=distribution)
    excess = errors[errors > 10 * noise]
    assert errors.min() > -10 * noise, "outliers only lengthen"
    assert_share(errors > 10 * noise, share)
    assert_mean(excess, mean, spread * mean)
    expected = stats.expon(scale=mean) if distribution == 1 else (
        stats.halfnorm(scale=mean * sqrt(pi / 2))
    )
    assert stats.kstest(excess, expected.cdf).pvalue > RISK


# Platform ----------------------------------------------------------------------------------------


def platform_errors(parameters: dict[str, object], steps: int = 15_000) -> tuple[Array, Array]:
    """Errors of GPS (m) and of IMU (rad), each (steps, 3), of a platform at rest."""
    platform = host("platform").start(parameters)
    record = platform.run(grid(steps))
    return (
        platform.column(record, "reported_position") - platform.column(record, "position"),
        platform.column(record, "reported_attitude") - platform.column(record, "attitude"),
    )


def test_white_noise_of_gps_and_imu_is_recovered() -> None:
    gps, imu = platform_errors({
        "seed": 8, "gps_horizontal_std": 0.5, "gps_vertical_std": 0.8, "imu_tilt_std": 0.01,
        "imu_heading_std": 0.03,
    })
    errors = np.hstack([gps, imu])
    for axis, std in enumerate((0.5, 0.5, 0.8, 0.01, 0.01, 0.03)):
        assert_std(errors[:, axis], std)
        assert_mean(errors[:, axis], 0.0, std)
        assert_uncorrelated(errors[1:, axis], errors[:-1, axis])
        assert stats.kstest(errors[:, axis] / std, "norm").pvalue > RISK
        for other in range(axis):
            assert_uncorrelated(errors[:, axis], errors[:, other])


def test_gauss_markov_errors_have_their_correlation_time_and_size() -> None:
    """The lag-one coefficient φ = exp(-T/τ) of a long record is normal with variance (1-φ²)/n;
    what is left, e_k = x_k - φ x_(k-1), is white with variance σ²(1-φ²)."""
    tau = {"gps": 1.0, "imu": 0.5}
    gps, imu = platform_errors({
        "seed": 9, "gps_horizontal_markov_std": 0.5, "gps_vertical_markov_std": 0.8,
        "gps_correlation_time": tau["gps"], "imu_tilt_markov_std": 0.01,
        "imu_heading_markov_std": 0.03, "imu_correlation_time": tau["imu"],
    })
    for errors, time, sizes in (
        (gps, tau["gps"], (0.5, 0.5, 0.8)), (imu, tau["imu"], (0.01, 0.01, 0.03)),
    ):
        phi = exp(-T / time)
        for axis, std in enumerate(sizes):
            before, after = errors[:-1, axis], errors[1:, axis]
            estimate = (before @ after) / (before @ before)
            margin = SIGMAS * sqrt((1 - phi**2) / len(before))
            assert abs(estimate - phi) < margin
            found = -T / log(estimate)
            assert found == pytest.approx(time, rel=2 * margin / (phi * T / time))
            assert_std(after - phi * before, std * sqrt(1 - phi**2))
            assert_uncorrelated((after - phi * before)[1:], (after - phi * before)[:-1])


def test_errors_of_a_run_are_drawn_anew_by_every_seed() -> None:
    """Constant errors, and Gauss-Markov errors that start with their stationary variance."""
    platform = host("platform")
    settings = {
        "constant": {"gps_horizontal_bias_std": 0.5, "gps_vertical_bias_std": 0.8,
                     "imu_tilt_turn_on_std": 0.01, "imu_heading_turn_on_std": 0.03},
        "markov": {"gps_horizontal_markov_std": 0.5, "gps_vertical_markov_std": 0.8,
                   "imu_tilt_markov_std": 0.01, "imu_heading_markov_std": 0.03},
    }
    for kind, parameters in settings.items():
        rows = []
        for seed in range(300):
            platform.start({"seed": seed, **parameters})
            first = np.concatenate(
                [platform.get("reported_position"), platform.get("reported_attitude")]
            )
            if kind == "constant" and seed % 50 == 0:
                platform.step(0.0, 5.0)
                np.testing.assert_array_equal(platform.get("reported_position"), first[:3])
            rows.append(first)
        errors = np.array(rows)
        for axis, std in enumerate((0.5, 0.5, 0.8, 0.01, 0.01, 0.03)):
            assert_std(errors[:, axis], std)
            assert_mean(errors[:, axis], 0.0, std)


# Target ------------------------------------------------------------------------------------------


def depth_errors(steps: int = 15_000, **parameters: object) -> tuple[Array, Array]:
    target = host("target").start({"trajectory": 1, "speed": 0.0, **parameters})
    record = target.run(grid(steps))[1:]
    return (
        target.column(record, "depth") - target.column(record, "true_depth"),
        target.column(record, "true_depth"),
    )


def test_depth_noise_and_bias_are_recovered() -> None:
    errors, truth = depth_errors(seed=10, depth_std=0.05, depth_bias=0.3)
    assert np.all(truth == 5.0)
    assert_std(errors, 0.05, 0.3)
    assert_mean(errors, 0.3, 0.05)
    assert_uncorrelated(errors[1:], errors[:-1])
    assert stats.kstest((errors - 0.3) / 0.05, "norm").pvalue > RISK


def test_first_and_last_moments_of_a_motion_driven_by_white_noise() -> None:
    """Over many seeds the first position and velocity have the configured spread."""
    target = host("target")
    rows = []
    for seed in range(300):
        target.start({"trajectory": 8, "seed": seed, "initial_position": (1.0, 2.0, 3.0),
                      "initial_position_std": 2.0, "initial_velocity": (0.1, 0.2, 0.3),
                      "initial_velocity_std": 0.4})
        rows.append(np.concatenate([target.get("position"), target.get("velocity")]))
    first = np.array(rows)
    for axis in range(3):
        assert_std(first[:, axis], 2.0, axis + 1.0)
        assert_mean(first[:, axis], axis + 1.0, 2.0)
        assert abs(first[:, 3 + axis].mean() - 0.1 * (axis + 1)) < 0.12
