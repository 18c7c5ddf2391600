"""What is possible, piece by piece: lengths, densities, echoes, and what is left out, by hand."""

from __future__ import annotations

from dataclasses import replace
from math import pi, sqrt
from typing import Any

import numpy as np
import pytest
from sblcosim import limits
from sblcosim.data.record import Record
from sblcosim.limits import echoes, parameters, run, unknown, verdict
from sblcosim.limits.geometry import hdop
from sblcosim.limits.lengths import percentile
from sblcosim.limits.path import circle_psd, path_psd
from sblcosim.limits.places import still_beacons
from sblcosim.scenario.scenario import load
from sblcosim.scenario.schema import CORE_COMPONENTS
from scipy import optimize, stats
from scipy.spatial.transform import Rotation

NS = 10**9
DIVE = "realistic-dive"

# --- Lengths --------------------------------------------------------------------------------------


def below(variances: Any, square: float) -> float:
    """P(Σ λ z² ≤ x): over the angle of the first two, with an exponential square, and the third."""
    angle = (np.arange(64) + 0.5) * pi / 128
    plane = variances[0] * np.cos(angle) ** 2 + variances[1] * np.sin(angle) ** 2
    third = variances[2] if len(variances) > 2 else 1e-12
    z = np.linspace(-1, 1, 801) * min(sqrt(square / third), 9.0)
    rest = np.fmax(square - third * z**2, 0.0)
    inside = 1 - np.exp(-rest[:, None] / (2 * plane)).mean(axis=1)
    return float(np.trapezoid(inside * stats.norm.pdf(z), z))


def test_lengths_of_errors_that_are_the_same_in_all_directions() -> None:
    turn = Rotation.from_euler("ZYX", [0.4, 1.0, -0.7]).as_matrix()
    for share in (0.9, 0.95, 0.99):
        line, plane, space = (stats.chi2(d).ppf(share) for d in (1, 2, 3))
        size = np.array([0.3, 2000.0, 1e-7])
        for d, square, rel in ((1, line, 2e-3), (2, plane, 1e-3), (3, space, 1e-4)):
            every = size[:, None, None] ** 2 * np.eye(d)
            found = percentile(every[None], share)
            np.testing.assert_allclose(found, size * sqrt(square), rtol=rel)
        thin = turn @ np.diag([4.0, 0.0, 0.0]) @ turn.T
        assert percentile(thin[None, None], share)[0] == pytest.approx(2 * sqrt(line), rel=2e-3)
    assert percentile(np.eye(3)[None, None])[0] == pytest.approx(sqrt(stats.chi2(3).ppf(0.95)))


@pytest.mark.parametrize("share", [0.6, 0.9, 0.95, 0.995])
@pytest.mark.parametrize("stds", [(5.0, 2.0, 0.5), (1.0, 0.9, 3.0), (3.0, 1.0)])
def test_lengths_of_errors_are_those_of_an_integral_of_another_kind(
    stds: Any, share: float
) -> None:
    variances = np.square(stds)
    square = optimize.brentq(lambda x: below(variances, x) - share, 1e-3, 60 * variances.max())
    turn = Rotation.from_euler("ZYX", [0.4, 1.0, -0.7]).as_matrix()[: len(stds), : len(stds)]
    turn = np.linalg.qr(turn)[0]
    covariance = turn @ np.diag(variances) @ turn.T
    found = percentile(covariance[None, None], share)
    assert found[0] == pytest.approx(sqrt(square), rel=1e-3)


def test_lengths_of_a_mixture_of_epochs_and_of_what_is_not_known() -> None:
    """A third of the epochs is ten times as bad as the others; others are not finite, or 0."""
    scale = np.array([1.0, 1.0, 10.0])
    square = optimize.brentq(
        lambda x: stats.chi2(2).cdf(x / scale**2).mean() - 0.95, 0.1, 1000, xtol=1e-10
    )
    every = np.tile(np.eye(2), (3, 4, 1, 1)) * scale[:, None, None, None] ** 2
    every[:, 1] *= 25.0
    every[:, 2] = 0.0
    every[1, 3, 0, 0] = np.nan
    found = percentile(every)
    np.testing.assert_allclose(found[:2], np.array([1, 5]) * sqrt(square), rtol=1e-3)
    assert found[2] == 0.0
    assert np.isnan(found[3])


# --- The information in a range -------------------------------------------------------------------


@pytest.mark.parametrize("distribution", ["exponential", "half_normal"])
@pytest.mark.parametrize(("std", "probability", "mean"), [
    (0.1, 0.05, 1.0), (0.2, 0.3, 0.3), (2.0, 0.12, 1.0), (0.05, 0.6, 2.0)
])  # fmt: skip
def test_the_fisher_factor_by_an_integral_over_the_density(
    distribution: str, std: float, probability: float, mean: float
) -> None:
    """σ² ∫ f′²/f, with a density from another library and its slope by differences."""
    late = (stats.exponnorm(mean / std, scale=std).pdf if distribution == "exponential" else
            lambda e: 2 * stats.norm(scale=w).pdf(e) * stats.norm.cdf(s * e / (std * w)))
    s = mean * sqrt(pi / 2)
    w = sqrt(std**2 + s**2)
    e = np.concatenate([np.linspace(-9 * std, 9 * std, 4001)[:-1],
                        np.linspace(9 * std, 9 * std + 25 * mean, 8001)])  # fmt: skip
    h = 1e-4 * std

    def density(e: Any) -> Any:
        return (1 - probability) * stats.norm(scale=std).pdf(e) + probability * late(e)

    f = density(e)
    slope = (density(e + h) - density(e - h)) / (2 * h)
    by_hand = std**2 * np.trapezoid(slope**2 / np.fmax(f, 1e-300), e)
    assert limits.fisher_factor(std, probability, mean, distribution) == pytest.approx(
        by_hand, rel=5e-4
    )


def test_the_fisher_factor_at_and_beside_its_ends() -> None:
    for distribution in ("exponential", "half_normal"):
        exact = limits.fisher_factor(0.5, 0.3, 0.0005, distribution)
        assert exact == 1.0
        assert limits.fisher_factor(0.5, 0.3, 0.025, distribution) < 0.9999
        far = limits.fisher_factor(1e-6, 0.3, 1.0, distribution)
        assert far == 0.7
        assert limits.fisher_factor(1e-6, 0.3, 0.5, distribution) != 0.7
    assert limits.fisher_factor(0.5, -0.1, 3.0) == 1.0
    assert limits.fisher_factor(-0.5, 0.2, 3.0) == 0.8


# --- Echoes ---------------------------------------------------------------------------------------

ECHOING = {"acoustics.water_depth_m": 30.0, "acoustics.loss_probability": 0.3,
           "acoustics.surface_echo_probability": 0.6, "acoustics.bottom_echo_probability": 0.45,
           "acoustics.range_std_m": 0.2}  # fmt: skip
DIVERS = np.array([[12.0, -9.0, 14.0], [60.0, 25.0, 20.0], [3.0, 2.0, 3.5]])
BEACON = np.array([2.0, 1.0, 1.5])


def mirrored(diver: Any, water: float) -> Any:
    """Excess paths by mirrored beacons: above the surface, and below the bottom."""
    direct = np.linalg.norm(diver - BEACON, axis=-1)
    up, down = BEACON * [1, 1, -1], BEACON * [1, 1, -1] + [0, 0, 2 * water]
    return np.stack([np.linalg.norm(diver - it, axis=-1) - direct for it in (up, down)], axis=-1)


def test_the_excess_of_an_echo_is_that_of_a_mirrored_beacon() -> None:
    a = load(DIVE, ECHOING).acoustics
    np.testing.assert_allclose(echoes.excesses(a, DIVERS, BEACON), mirrored(DIVERS, 30.0))


def information(parts: Any, std: float) -> float:
    """Of arrivals with these weights and excesses [m], against one."""
    weight, shift = np.array(parts).T
    weight = weight / weight.sum()

    def score(z: Any) -> Any:
        each = weight * stats.norm.pdf(z[:, None] - shift / std)
        slope = (each * (z[:, None] - shift / std)).sum(axis=1)
        return slope**2 / np.fmax(each.sum(axis=1), 1e-290)

    # Each arrival has its surroundings; between those, there is nothing.
    ends: list[list[float]] = []
    for middle in sorted(shift / std):
        if ends and middle - 8 < ends[-1][1]:
            ends[-1][1] = middle + 8
        else:
            ends.append([middle - 8, middle + 8])
    each = (np.linspace(a, b, 50 * round(b - a) + 1) for a, b in ends)
    return sum(float(np.trapezoid(score(z), z)) for z in each)


@pytest.mark.parametrize("two_way", [False, True])
def test_the_information_in_a_range_that_may_be_late_by_an_echo(two_way: bool) -> None:
    ranging = {"acoustics.ranging": "two_way"} if two_way else {}
    a = load(DIVE, ECHOING | ranging).acoustics
    std = 0.2
    shade = np.array([0.0, 0.5, 0.2])
    found = echoes.shares(a, DIVERS, BEACON, shade)
    for i in range(3):
        surface, bottom = mirrored(DIVERS, 30.0)[i]
        p = 0.3 + 0.7 * shade[i]
        first, second = ((surface, 0.6), (bottom, 0.45))
        if bottom < surface:
            first, second = second, first
        one = [(1 - p, 0.0), (p * first[1], first[0]), (p * (1 - first[1]) * second[1], second[0])]
        both = [(v * w, (x + y) / 2) for v, x in one for w, y in one]
        noise = parameters.range_noise(a)
        assert two_way or noise == std
        assert found[i] == pytest.approx(information(both if two_way else one, noise), rel=2e-3)
    assert found.min() < 0.9
    quiet = load(DIVE, {**ECHOING, "acoustics.surface_echo_probability": 0.0,
                        "acoustics.bottom_echo_probability": 0.0}).acoustics
    assert echoes.shares(quiet, DIVERS, BEACON).tolist() == [1.0] * 3


def test_of_packets_those_are_lost_that_come_neither_directly_nor_by_an_echo() -> None:
    a = load(DIVE, ECHOING).acoustics
    assert echoes.echo_chances(a) == (0.6, 0.45)
    direct = np.array([0.3, 0.3 + 0.7 * 0.25])
    left = direct * 0.4 * 0.55
    np.testing.assert_allclose(echoes.lost_in(a, np.array([0.0, 0.25])), left)
    both = load(DIVE, {**ECHOING, "acoustics.ranging": "two_way"}).acoustics
    np.testing.assert_allclose(echoes.lost_in(both, np.array([0.0, 0.25])), 1 - (1 - left) ** 2)
    assert echoes.lost(a) == pytest.approx(0.3 * 0.4 * 0.55)
    never = load(DIVE, ECHOING | {"acoustics.loss_probability": 0.0}).acoustics
    assert echoes.echo_chances(never) == (0.0, 0.0)
    assert echoes.lost(never) == 0.0


def test_the_shadow_of_a_diver_takes_its_mean_over_all_courses() -> None:
    """cos²(πθ/4h) up to 2 h on both sides has the mean h/π; and the middle is behind the diver."""
    keys = {"acoustics.shadow_loss_probability": 0.8, "acoustics.shadow_half_width_deg": 40.0,
            "acoustics.shadow_direction_deg": 180.0, "acoustics.loss_probability": 0.1}  # fmt: skip
    a = load(DIVE, keys).acoustics
    mean = 0.8 * np.deg2rad(40) / pi
    assert echoes.lost(a) == pytest.approx(0.1 + 0.9 * mean, rel=2e-3)
    place, ahead = np.zeros((4, 3)), np.tile([0.3, 0.4, 0.0], (4, 1))
    beacons = np.array([[-3.0, -4, 0], [3, 4, 0], [-4, 3, 0], [-3.0 - 4, -4 + 3, 0]])
    angle = np.arccos((np.array([-7.0, -1]) @ [-0.6, -0.8]) / sqrt(50))
    beside = 0.8 * np.cos(pi / 4 * angle / np.deg2rad(40)) ** 2
    np.testing.assert_allclose(
        echoes.shades(a, place, beacons, ahead), [0.8, 0.0, 0.0, beside], atol=1e-12
    )


def test_information_along_a_path_is_that_of_its_places() -> None:
    a = load(DIVE, {**ECHOING, "acoustics.shadow_loss_probability": 0.5}).acoustics
    n = 60
    t = np.linspace(0, 1, n)[:, None]
    position = np.array([8.0, -5, 4]) + t * [30.0, 20, 12]
    velocity = np.tile([0.3, 0.2, 0.1], (n, 1))
    beacons = np.tile(np.array([[3.0, 0, 1.5], [-2, 4, 0.5]]), (n, 1, 1))
    found = echoes.shares_along(a, position, beacons, velocity)
    assert found.shape == (n, 2)
    each = echoes.shares(a, position[:, None], beacons, echoes.shades(
        a, position[:, None], beacons, velocity[:, None]))  # fmt: skip
    np.testing.assert_allclose(found, each, rtol=1e-12)
    assert np.ptp(found[:, 0]) > 0.01
    many = [np.repeat(it, 5, axis=0) for it in (position, beacons, velocity)]
    longer = echoes.shares_along(a, *many)
    np.testing.assert_allclose(longer, np.repeat(each, 5, axis=0), atol=0.03)
    np.testing.assert_allclose(longer[[0, -1]], each[[0, -1]], rtol=1e-12)


# --- Paths ----------------------------------------------------------------------------------------


def test_the_density_of_a_path_is_taken_between_a_step_and_half_of_the_run() -> None:
    v, radius, w = 0.6, 9.0, 0.6 / 9.0
    t = 100 + np.arange(0, 80.01, 0.25)
    velocity = v * np.column_stack([-np.sin(w * t), np.cos(w * t), 5 * np.sin(t)])

    def density_at(tau: float) -> float:
        return (2 * v * np.sin(w * tau / 2)) ** 2 / (2 * tau)

    for noise, tau in ((1e9, 40.0), (1e-9, 0.25)):
        assert path_psd(t, velocity, noise) == pytest.approx(density_at(tau), rel=1e-3)
    # Of a circle, no memory is too short.
    assert circle_psd(v, radius, np.array([1e9]), 80.0)[0] == pytest.approx(density_at(40.0))

    def own(noise: float) -> float:
        memory = optimize.brentq(
            lambda tau: tau - (noise / density_at(tau)) ** 0.25, 0.01, 39.0, xtol=1e-12
        )
        return density_at(memory)

    noises = np.array([0.05, 0.4, 3.0])
    expected = [own(it) for it in noises.tolist()]
    np.testing.assert_allclose(circle_psd(v, radius, noises, 80.0), expected, rtol=1e-9)
    for noise, q in zip(noises.tolist(), expected, strict=True):
        assert path_psd(t, velocity, noise) == pytest.approx(q, rel=2e-3)
    uneven = np.r_[t[:20], t[20::2]]
    of_some = v * np.column_stack([-np.sin(w * uneven), np.cos(w * uneven), 0 * uneven])
    assert path_psd(uneven, of_some, 1e-9) == pytest.approx(density_at(0.5), rel=5e-3)
    assert path_psd(t[:3], velocity[:3], 0.4) > 0.0
    assert path_psd(t[:2], velocity[:2], 0.4) == 0.0


# --- The numbers of a scenario --------------------------------------------------------------------


def test_the_conditions_of_a_scenario_by_hand() -> None:
    given = load(DIVE, {
        "acoustics.outlier_probability": 0.0, "acoustics.range_std_m": 0.17,
        "acoustics.loss_probability": 0.2, "target.depth_std_m": 0.06,
        "platform.gps_horizontal_markov_std_m": 1.2, "platform.gps_horizontal_bias_std_m": 0.5,
    })  # fmt: skip
    found = parameters.conditions(given, 0.004)
    beacons = parameters.beacons_of(parameters.parameters(given))
    middle = beacons[:, :2].mean(axis=0)
    assert found.spread == pytest.approx(sum(((b[:2] - middle) ** 2).sum() for b in beacons) / 2)
    assert found.range_std == pytest.approx(0.17)
    assert found.loss == pytest.approx(0.2)
    assert found.depth_std == 0.06
    assert found.common_std == pytest.approx(1.3)
    assert found.acceleration_psd == 0.004
    assert found.slot == given.acoustics.sampling_time_s
    assert (found.beacons, found.together, found.ping_std) == (4, 1, 0.0)
    odd = np.array([[7.0, 1.0, 9.0], [1.0, 5.0, 3.0], [4.0, -3.0, 0.0]])
    assert parameters.spread_of(odd) == pytest.approx((9 + 0 + 9 + 16 + 0 + 16) / 2)
    shared = load(DIVE, {
        "acoustics.ranging": "inverted", "acoustics.range_common_std_m": 0.3,
        "acoustics.arrivals_shared": True, "acoustics.outlier_probability": 0.05,
        "acoustics.outlier_mean_m": 3.0, "acoustics.range_std_m": 0.1,
    })  # fmt: skip
    p = parameters.parameters(shared, 0.01, parameters.RECEIVERS["array"])
    share = limits.fisher_factor(0.3, 0.05, 3.0)
    assert p.range_common_std == pytest.approx(0.3 / sqrt(share))
    assert p.range_std == pytest.approx(0.1)
    apart = load(DIVE, {"acoustics.outlier_probability": 0.05, "acoustics.outlier_mean_m": 3.0,
                        "acoustics.range_std_m": 0.1})  # fmt: skip
    alone = parameters.parameters(apart, 0.01)
    assert alone.range_std == pytest.approx(0.1 / sqrt(limits.fisher_factor(0.1, 0.05, 3.0)))


# --- Verdicts -------------------------------------------------------------------------------------


def judged(radial: float, across: float, reach: float = 20.0, timed: bool = True) -> Any:
    """A diver towards 30°, with these deviations towards the platform and across."""
    turn = np.array([[np.cos(pi / 6), -0.5], [0.5, np.cos(pi / 6)]])
    P = np.full((1, 3, 3), 0.3)
    P[0, :2, :2] = turn @ np.diag([radial**2, across**2]) @ turn.T
    P[0, 2, 2] = 1.0
    offset = np.array([[*(turn @ [reach, 0.0]), 7.0]])
    return verdict.limits_of(np.zeros(1, np.int64), 2 * P, P, offset, 0.01, False, timed=timed)


@pytest.mark.parametrize(("radial", "across", "ring"), [
    (0.5, 20 * pi / 8 * 0.999, False), (0.5, 20 * pi / 8 * 1.001, True),
    (1.53, 20 * pi / 8 * 1.001, True), (1.56, 20 * pi / 8 * 1.001, False),
])  # fmt: skip
def test_a_ring_begins_at_an_eighth_of_a_half_turn_and_must_be_thin(
    radial: float, across: float, ring: bool
) -> None:
    found = judged(radial, across)
    assert found.ring.tolist() == [ring]
    assert found.bearing_std[0] == pytest.approx(across / 20)
    assert judged(radial, across, timed=False).ring.tolist() == [ring]


@pytest.mark.parametrize(("radial", "timed", "ring"), [
    (2.49, False, False), (2.51, False, True), (2.51, True, False)
])  # fmt: skip
def test_without_a_clock_an_eighth_of_the_distance_must_be_known(
    radial: float, timed: bool, ring: bool
) -> None:
    assert judged(radial, 1.0, timed=timed).ring.tolist() == [ring]


def test_a_verdict_is_that_of_the_epochs_asked_for() -> None:
    P = np.array([1.0, 4.0, 9.0, 16.0])[:, None, None] * np.eye(3)
    found = verdict.Limits(
        np.array([10, 20, 30, 40]), P, P / 4, np.array([0.1, 0.3, 0.2, 0.7]),
        np.array([True, False, False, True]), 0.02, False, ("x",), {"it": np.arange(4.0)},
    )
    some = found.verdict(np.array([5, 25, 39]))  # the first, the second, the third
    assert some is not None
    assert some.absolute_rms == pytest.approx(sqrt((3 + 12 + 27) / 3))
    assert some.relative_rms == pytest.approx(some.absolute_rms / 2)
    assert (some.bearing_std, some.accuracy, some.acceleration_psd) == (0.2, True, 0.02)
    assert some.left_out == {"it": 1.0}
    half = found.verdict()
    assert half is not None
    assert half.accuracy
    assert half.bearing_std == 0.25
    worse = found.verdict(np.array([40, 40, 20]))
    assert worse is not None
    assert not worse.accuracy
    assert repr(found) == f"<Limits of 4 epochs: {half}>"
    assert str(worse) == (
        "no accuracy is possible: the bearing is only known to 40°, so positions all around the "
        "platform fit"
    )
    far = replace(worse, bearing_std=0.05)
    assert str(far) == (
        "no accuracy is possible: without a common clock, only the bearing is known, to 3°, and "
        "not the distance"
    )
    assert worse.to_json()["bearing_std_deg"] == pytest.approx(np.rad2deg(0.7))
    assert (worse.matters, worse.caveat) == ({}, "")
    leaves = replace(half, left_out={"a (x)": 5.0, "b": 0.01}, absolute_rms=2.0)
    assert leaves.with_left_out == pytest.approx(sqrt(9.01))
    assert leaves.caveat == (
        "possible leaves out a (x), about 2.2 m; about 3.0 m RMS is possible with it"
    )
    open_ = replace(leaves, left_out={"a (x)": float("nan")})
    assert open_.caveat == "possible leaves out a (x)"


# --- Along a run ----------------------------------------------------------------------------------


def a_run(start_s: float = 0.0, n: int = 25) -> Record:
    """A diver on an arc beside a platform that swings; times count from any second."""
    t = np.arange(n) * 1.0
    position = np.column_stack([15 * np.cos(t / 30), 15 * np.sin(t / 30), 5 + 0 * t])
    velocity = np.column_stack([-0.5 * np.sin(t / 30), 0.5 * np.cos(t / 30), 0 * t])
    epoch, count = np.full((n, 4), start_s), np.zeros((n, 4), int)
    for i in range(1, n):
        epoch[i], count[i] = epoch[i - 1], count[i - 1]
        if i % 5:
            epoch[i, (i - 1) % 4] = start_s + t[i] - 0.25
            count[i, (i - 1) % 4] += 1
    return Record(((t + start_s) * NS).astype(np.int64), {
        "target.position": position, "target.velocity": velocity,
        "target.depth_epoch": start_s + np.floor(t / 2) * 2,
        "platform.position": np.column_stack([np.sin(t / 9), np.cos(t / 7), 0.1 * np.sin(t)]),
        "platform.attitude": 0.1 * np.sin(np.outer(t, [1.9, 1.6, 0.3])),
        "acoustics.range_epoch": epoch, "acoustics.reception_count": count,
    })  # fmt: skip


def test_a_run_that_begins_later_has_the_same_limits() -> None:
    given = load(DIVE, {"platform.imu_heading_drift_deg_s": 0.05})
    now, later = (limits.reference(a_run(start), given) for start in (0.0, 1024.0))
    np.testing.assert_array_equal(later.epoch_ns, now.epoch_ns + 1024 * NS)
    np.testing.assert_allclose(later.absolute, now.absolute, rtol=1e-9)
    (one,), (other,) = now.left_out.values(), later.left_out.values()
    np.testing.assert_allclose(other, one, rtol=1e-9)
    assert one[-1] > 3 * one[5] > 0
    t = now.epoch_ns / NS
    there = np.column_stack([15 * np.cos(t / 30), 15 * np.sin(t / 30), 5 + 0 * t])
    (expected,) = unknown.squares(given, there, t).values()
    np.testing.assert_allclose(one, expected, rtol=1e-4)
    held = np.floor(t)
    off = there[:, :2] - np.column_stack([np.sin(held / 9), np.cos(held / 7)])
    reach = np.linalg.norm(off, axis=1)
    across = np.column_stack([-off[:, 1], off[:, 0]]) / reach[:, None]
    std = np.sqrt(np.einsum("ni,nij,nj->n", across, now.relative[:, :2, :2], across))
    np.testing.assert_allclose(now.bearing_std, std / reach, rtol=1e-5)
    assert now.acceleration_psd == pytest.approx(later.acceleration_psd, rel=1e-9)


def test_ranges_that_may_be_echoes_tell_less_of_a_run() -> None:
    record = a_run()
    arms = np.array([[3.0, 0, 0.5], [0, 3, 0.5], [-3, 0, 0.5], [0, -3, 0.5]])
    beacons = record.values["platform.position"][:, None] + arms
    record = replace(record, values={**record.values, "platform.beacon_position": beacons})
    keys = {**ECHOING, "acoustics.water_depth_m": 8.0, "acoustics.loss_probability": 0.6}
    silent = {"acoustics.surface_echo_probability": 0.0, "acoustics.bottom_echo_probability": 0.0}
    echoing, plain = (
        limits.reference(record, load(DIVE, it), acceleration_psd=0.003)
        for it in (keys, keys | silent)
    )
    sizes = [np.trace(it.absolute[-1]) for it in (echoing, plain)]
    assert sizes[0] > 1.02 * sizes[1]


def test_only_a_motion_that_is_drawn_from_the_model_has_a_bound_and_its_own_density() -> None:
    drawn = load({"target": {"trajectory": "white_noise_acceleration",
                             "acceleration_psd_m2_s3": 0.005}, "time": {"duration_s": 20.0}})
    found = limits.reference(a_run(), drawn)
    assert (found.is_bound, found.acceleration_psd) == (True, 0.005)
    told = limits.reference(a_run(), drawn, acceleration_psd=0.01)
    assert (told.is_bound, told.acceleration_psd) == (False, 0.01)
    np.testing.assert_allclose(
        limits.reference(a_run(), drawn, acceleration_psd=0.005).absolute, found.absolute
    )


def test_the_events_of_a_run_are_its_packets_and_readings() -> None:
    record = a_run(4.0, 8)
    epoch, heard, depth = run.events_of(record, np.array([9_100_000_000]))
    assert (epoch / NS).tolist() == [4.75, 5.75, 6.0, 6.75, 7.75, 8.0, 9.1, 9.75, 10.0, 10.75]
    numbers = [np.flatnonzero(row).tolist() for row in heard]
    assert numbers == [[0], [1], [], [2], [3], [], [], [1], [], [2]]
    assert depth.tolist() == [0, 0, 1, 0, 0, 1, 0, 0, 1, 0]
    assert heard.max() == 1
    at_once = {**record.values, "target.depth_epoch": np.array([4.0, 4.5, 4.5, 6, 7, 7, 7, 7])}
    epoch, _, depth = run.events_of(replace(record, values=at_once), None)
    assert (epoch[depth > 0] / NS).tolist() == [4.5, 6.0, 7.0]


def test_the_density_of_a_run_is_that_of_its_path_and_noise() -> None:
    record, given = a_run(), load(DIVE)
    c = parameters.conditions(given, 0.0)
    off = record.values["target.position"] - record.values["platform.position"]
    square = np.mean([o @ o for o in off])
    density = c.range_std**2 * square / c.spread * c.round
    expected = path_psd(record.time_ns / NS, record.values["target.velocity"], density)
    assert run.psd_of(record, given) == pytest.approx(expected, rel=1e-12)
    assert limits.reference(record, given).acceleration_psd == pytest.approx(expected, rel=1e-12)
    deaf = load(DIVE, {"acoustics.loss_probability": 1.0})
    assert run.psd_of(record, deaf) == 0.0


def test_limits_of_a_run_are_those_of_our_components_within_it() -> None:
    record, given = a_run(4.0), load(DIVE)
    ours = dict.fromkeys(CORE_COMPONENTS, "fmu")
    asked = np.array([4 * NS - 1, 4 * NS, 9_100_000_000, 28 * NS, 28 * NS + 1])
    found = run.of_run(record, given, ours, asked, 0.003)
    assert found is not None
    assert found.acceleration_psd == 0.003
    assert np.isin(asked, found.epoch_ns).tolist() == [False, True, True, True, False]
    assert run.of_run(record, given, {}, asked) is None
    assert run.of_run(record, {"package": "x"}, ours, asked) is None
    bare = {k: v for k, v in record.values.items() if k != "platform.attitude"}
    assert run.of_run(replace(record, values=bare), given, ours, asked) is None
    many = 4 * NS + np.arange(2 * run.MOST_EPOCHS - 24) * 500_000
    assert run.of_run(record, given, ours, many) is None
    assert run.of_run(record, given, ours, many[:: 100]) is not None


# --- What is left out -----------------------------------------------------------------------------

PLACES = np.array([[40.0, 9.0, 8.0], [-3.0, 25.0, 14.0], [-18.0, -12.0, 6.0]])


def by_moving(scenario: Any, angles: Any, place: Any) -> float:
    """How far a diver seems to be moved, squared, if the beacons are turned by small angles.

    Ranges are those to the turned beacons; the place is the one that fits those to the others.
    """
    beacons = still_beacons(scenario)
    middle = np.asarray(scenario.platform.mean_position_m, float)
    heading = np.deg2rad(scenario.platform.mean_heading_deg)
    body = Rotation.from_euler("Z", heading)
    arms = body.inv().apply(beacons - middle)
    # To first order, each angle turns the beacons about an axis of the body by itself.
    shift = body.apply(np.cross(angles, arms))
    o = place - beacons
    u = o / np.linalg.norm(o, axis=1)[:, None]
    move, *_ = np.linalg.lstsq(u[:, :2], (u * shift).sum(axis=1), rcond=None)
    return float(move @ move)


@pytest.mark.parametrize("since_s", [5.0, 40.0])
def test_errors_of_the_attitude_are_turns_of_the_beacons(since_s: float) -> None:
    given = load("paper-scenario-1", {
        "platform.imu_tilt_drift_deg_s": 0.03, "platform.imu_heading_drift_deg_s": 0.02,
        "platform.imu_heading_step_deg": 1.5, "platform.imu_tilt_step_deg": 0.7,
        "platform.imu_step_time_s": 20.0, "platform.mean_heading_deg": 70.0,
        "platform.imu_heading_temperature_coefficient_deg_K": 0.2,
        "platform.imu_tilt_temperature_coefficient_deg_K": 0.1,
        "platform.imu_temperature_offset_K": 3.0, "platform.imu_temperature_rate_K_s": 0.05,
        "platform.mean_position_m": [4.0, -2.0, 0.0],
    })  # fmt: skip
    warm, late = 3.0 + 0.05 * since_s, since_s > 20
    sizes = {
        "tilt_drift": 0.03 * since_s, "heading_drift": 0.02 * since_s,
        "tilt_step": 0.7 * late,
        "tilt_temperature": 0.1 * warm, "heading_temperature": 0.2 * warm,
    }  # fmt: skip
    found = unknown.squares(given, PLACES, np.full(3, since_s))
    assert sum(name in words for words in found for name in sizes) == len(sizes)
    for words, squares in found.items():
        tilt, heading = (
            sum(size for name, size in sizes.items() if name in words and axis in name)
            for axis in ("tilt", "heading")
        )
        angles = np.deg2rad([tilt, tilt, heading])
        expected = [by_moving(given, angles, place) for place in PLACES]
        np.testing.assert_allclose(squares, expected, rtol=1e-9, atol=1e-15)


def test_an_error_of_scale_or_of_axes_follows_the_swing_of_the_platform() -> None:
    """Half of the square of an amplitude is its mean square; each angle by itself."""
    swing = {"platform.roll_amplitude_deg": 9.0, "platform.pitch_amplitude_deg": 6.0,
             "platform.yaw_amplitude_deg": 4.0, "platform.mean_heading_deg": -35.0}  # fmt: skip
    roll, pitch, yaw = np.deg2rad([9.0, 6.0, 4.0])
    scaled = load("paper-scenario-1", swing | {
        "platform.imu_tilt_scale_factor_error": 0.1,
        "platform.imu_heading_scale_factor_error": 0.2,
    })  # fmt: skip
    misaligned = load(
        "paper-scenario-1", swing | {"platform.imu_misalignment_deg": [2.0, 3.0, 5.0]}
    )
    e = np.deg2rad([2.0, 3.0, 5.0])
    of_scale = {"tilt_scale": [0.1 * roll, 0.1 * pitch, 0.0], "heading_scale": [0, 0, 0.2 * yaw]}
    of_axes = {"misalignment": [
        np.hypot(e[1] * yaw, e[2] * pitch), np.hypot(e[2] * roll, e[0] * yaw),
        np.hypot(e[0] * pitch, e[1] * roll),
    ]}  # fmt: skip
    for given, sizes in ((scaled, of_scale), (misaligned, of_axes)):
        found = unknown.squares(given, PLACES, np.zeros(3))
        assert sum(name in words for words in found for name in sizes) == len(sizes)
        for words, squares in found.items():
            size = np.sum([it for name, it in sizes.items() if name in words], axis=0)
            expected = [
                sum(by_moving(given, np.eye(3)[i] * size[i], place) for i in range(3)) / 2
                for place in PLACES
            ]
            np.testing.assert_allclose(squares, expected, rtol=1e-9)


def test_a_wrong_mounting_and_a_random_one_add() -> None:
    wrong = [[0.3, 0.1, 0], [0, 0.3, 0.2], [-0.3, 0.1, 0], [0, 0, 0.1]]
    given = load("paper-scenario-1", {
        "platform.mounting_error_m": wrong, "platform.mounting_std_m": 0.2,
        "platform.mean_heading_deg": 50.0,
    })  # fmt: skip
    (found,) = unknown.squares(given, PLACES, np.zeros(3)).values()
    beacons = still_beacons(given)
    shift = Rotation.from_euler("Z", 50, degrees=True).apply(wrong)
    for i, place in enumerate(PLACES):
        o = place - beacons
        u = o / np.linalg.norm(o, axis=1)[:, None]
        move, *_ = np.linalg.lstsq(u[:, :2], (u * shift).sum(axis=1), rcond=None)
        random = (0.2 * hdop(place, beacons).horizontal) ** 2
        assert found[i] == pytest.approx(move @ move + random)


def test_answers_that_are_late_are_half_as_far() -> None:
    given = load("paper-scenario-1", {
        "acoustics.ranging": "two_way", "acoustics.turnaround_beacon_std_s": 2e-3,
        "platform.mean_heading_deg": 50.0,
    })  # fmt: skip
    (found,) = unknown.squares(given, PLACES, np.zeros(3)).values()
    each = 2e-3 * given.acoustics.assumed_sound_speed_m_s / 2
    expected = (each * hdop(PLACES, still_beacons(given)).horizontal) ** 2
    np.testing.assert_allclose(found, expected, rtol=1e-9)


MOUNTED = {"platform.mounting_error_m": [[0.3, 0, 0], [0, 0.3, 0], [-0.3, 0.1, 0], [0, 0, 0.1]],
           "platform.mean_position_m": [4.0, -2.0, 0.0]}  # fmt: skip


def test_beside_a_boat_that_sails_errors_are_those_beside_one_that_stays() -> None:
    still = load("paper-scenario-1", MOUNTED)
    sails = load("paper-scenario-1", MOUNTED | {
        "platform.boat_speed_m_s": 0.8, "platform.boat_course_deg": 30.0
    })  # fmt: skip
    since = np.array([10.0, 0.0, 25.0])
    way = 0.8 * since[:, None] * [np.cos(pi / 6), 0.5, 0.0]
    (expected,) = unknown.squares(still, PLACES, since).values()
    (found,) = unknown.squares(sails, PLACES + way, since).values()
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_beside_a_boat_on_a_track_errors_turn_with_it() -> None:
    """Two points, so that it sails straight on; its heading is 20° and turns to 80°."""
    still = load("paper-scenario-1", MOUNTED)
    track = load("paper-scenario-1", MOUNTED | {
        "platform.track_time_s": [0.0, 50.0], "platform.track_m": [[1.0, 2.0], [21.0, -8.0]],
        "platform.track_heading_deg": [20.0, 80.0], "platform.departure_time_s": 5.0,
    })  # fmt: skip
    middle = np.array([4.0, -2.0, 0.0])
    since = np.array([5.0, 55.0, 90.0])
    way = np.array([[1.0, 2, 0], [21, -8, 0], [21, -8, 0]])
    turn = Rotation.from_euler("Z", [[20], [80], [80]], degrees=True)
    moved = middle + turn.apply(PLACES - middle) + way
    (expected,) = unknown.squares(still, PLACES, since).values()
    (found,) = unknown.squares(track, moved, since).values()
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_a_diver_who_stays_has_the_mean_of_errors_that_grow() -> None:
    given = load("paper-scenario-1", {"platform.imu_heading_drift_deg_s": 0.1})
    (found,) = unknown.squares_in_places(given, PLACES, (10.0, 45.0)).values()
    (one,) = unknown.squares(given, PLACES, np.ones(3)).values()
    times = [10, 15, 20, 25, 30, 35, 40, 45]
    np.testing.assert_allclose(found, one * np.mean(np.square(times)), rtol=1e-9)
