"""Straight lines through windows of a log, against a search that has nothing in common with them.

Where ranges are exact, lines are those of the motion, and every limit is a number.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from sblcosim.data.samples import Samples
from sblcosim.processing.windows import Lines, lines
from scipy.optimize import minimize

NS = 10**9
SQUARE = np.array([[40.0, 35, 14], [-38, 44, 12], [-45, -40, 11], [36, -42, 16]])
START, VELOCITY = np.array([6.0, -9.0]), np.array([0.4, 0.25])


def swum(time_s: Any) -> Any:
    """Where the diver is, who goes down slowly: depths count at the begin of a window."""
    t = np.asarray(time_s, float)[:, None]
    return np.hstack([START + t * VELOCITY, np.full((len(t), 1), 5.0)])


def heard(
    time_s: Any, off: Any = 0.0, *, beacons: Any = SQUARE, beacon: Any = None, place: Any = None,
    deep: float | None = None,
) -> tuple[Samples, Any]:
    """Ranges of beacons in turn, and the places of the beacons."""
    time_s = np.asarray(time_s, float)
    n = len(time_s)
    number = np.arange(n) % len(beacons) if beacon is None else np.asarray(beacon)
    at = beacons[number]
    there = swum(time_s) if place is None else place
    if deep is not None:
        there = np.column_stack([there[:, :2], np.full(n, deep)])
    ranges = np.linalg.norm(there - at, axis=1) + off
    depth_ns = np.array([-50, 50, 2000], np.int64) * NS
    samples = Samples(
        0, depth_ns, np.array([5.0, 5.0, 5.0]), np.round(time_s * NS).astype(np.int64), number,
        ranges, np.zeros(n, bool), at, np.zeros((n, 3)),
    )
    return samples, at


def fitted(*args: Any, depth: float | None = None, per_beacon: int = 3, **more: Any) -> Lines:
    samples, at = heard(*args, **more)
    return lines(samples, at, depth, per_beacon)


def test_exact_ranges_have_the_line_of_the_motion() -> None:
    time_s = 100.0 + 1.5 * np.arange(36)
    found = fitted(time_s)
    first = found.first
    assert first is not None
    assert first.begin_ns == 100 * NS
    np.testing.assert_allclose(first.position, [*(START + 100 * VELOCITY), 5.0], atol=1e-4)
    np.testing.assert_allclose(first.velocity, [*VELOCITY, 0.0], atol=1e-4)
    assert found.scatter == pytest.approx(1e-3 * np.sqrt(12 / 9))  # a millimetre at least
    assert not found.wrong.any()
    assert np.abs(found.residual).max() < 1e-3
    assert found.offset < 1e-3


def test_the_depth_is_that_at_the_begin_of_a_window_or_of_the_plane() -> None:
    samples, at = heard(np.arange(24.0), deep=7.0)
    samples.depth[:] = [-1.0, 15.0, 15.0]  # 7 at 0 s; later, ranges do not fit
    found = lines(samples, at, None)
    assert found.first is not None
    np.testing.assert_allclose(found.first.position, [*START, 7.0], atol=0.05)
    plane = fitted(np.arange(24.0), deep=-3.0, depth=-3.0)
    assert plane.first is not None
    np.testing.assert_allclose(plane.first.position, [*START, -3.0], atol=1e-4)


@pytest.mark.parametrize(("count", "beacons", "per_beacon", "some"), [
    (12, 4, 3, True), (11, 4, 3, False), (24, 4, 6, True), (23, 4, 6, False), (9, 3, 3, True),
    (20, 2, 3, False), (8, 4, 2, True),
])  # fmt: skip
def test_a_window_has_three_ranges_a_beacon_of_at_least_three(
    count: int, beacons: int, per_beacon: int, some: bool
) -> None:
    found = fitted(np.arange(float(count)), beacons=SQUARE[:beacons], per_beacon=per_beacon)
    assert (found.first is not None) == (found.scatter is not None) == some
    assert np.isnan(found.residual).all() == (not some)
    assert len(found.wrong) == len(found.residual) == count
    assert not found.wrong.any()
    if not some:
        assert found.offset == 0.0


def test_without_a_depth_there_is_no_line() -> None:
    samples, at = heard(np.arange(24.0))
    none = Samples(0, np.zeros(0, np.int64), np.zeros(0), samples.range_ns, samples.beacon,
                   samples.range, samples.has_pose, samples.position, samples.attitude)  # fmt: skip
    assert lines(none, at, None).first is None
    assert lines(none, at, 5.0).first is not None


@pytest.mark.parametrize(("gap_s", "splits"), [(30.0, False), (30.01, True)])
@pytest.mark.parametrize(("more", "usable"), [(4, False), (5, True)])
def test_windows_end_at_gaps_of_half_a_minute_and_need_five_ranges(
    gap_s: float, splits: bool, more: int, usable: bool
) -> None:
    """Twelve ranges, a gap, and a few that are a window of their own, or belong to the others."""
    time_s = np.r_[np.arange(12.0), 11 + gap_s + np.arange(more)]
    beacon = np.r_[np.arange(12) % 4, np.arange(more) % 4]
    found = fitted(time_s, beacon=beacon)
    assert np.isfinite(found.residual[:12]).all()
    assert np.isfinite(found.residual[12:]).all() == (usable or not splits)
    assert np.isnan(found.residual[12:]).all() == (splits and not usable)


@pytest.mark.parametrize("before", [4, 5])
def test_the_start_is_that_of_the_first_window_with_five_ranges(before: int) -> None:
    time_s = np.r_[np.arange(before), 100 + np.arange(16.0)]
    beacon = np.r_[np.arange(before) % 4, np.arange(16) % 4]
    found = fitted(time_s, beacon=beacon)
    assert found.first is not None
    begin = 0 if before == 5 else 100
    assert found.first.begin_ns == begin * NS
    np.testing.assert_allclose(found.first.position[:2], START + begin * VELOCITY, atol=0.01)


@pytest.mark.parametrize(("step_s", "kept"), [(10.0, 12), (120 / 11, 12), (10.95, 11), (13.0, 10)])
def test_a_window_is_two_minutes_long_at_most(step_s: float, kept: int) -> None:
    found = fitted(step_s * np.arange(12))
    assert np.isfinite(found.residual).sum() == kept


def test_the_last_window_before_a_gap_has_ranges_of_the_one_before() -> None:
    """Fifteen ranges are two windows, of which the last begins at the fourth range."""
    off = np.zeros(30)
    off[[1, 14, 28]] = 3.0
    time_s = np.r_[np.arange(15.0), 200 + np.arange(15.0)]
    found = fitted(time_s, off, beacon=np.tile(np.arange(15) % 4, 2))
    np.testing.assert_allclose(found.residual, off, atol=5e-3)


# --- Ranges that are wrong ------------------------------------------------------------------------


@pytest.mark.parametrize(("off", "wrong"), [
    (-5.3, False), (-5.7, True), (-30.0, True), (5.7, False), (39.5, False), (40.5, True),
    (90.0, True),
])  # fmt: skip
@pytest.mark.parametrize("which", [0, 6, 11])
def test_a_range_is_too_short_beyond_the_motion_of_a_window_or_late_by_40_m(
    off: float, wrong: bool, which: int
) -> None:
    """Eleven seconds, at half a metre in a second: 5.5 m."""
    wave = np.zeros(12)
    wave[which] = off
    found = fitted(np.arange(12.0), wave)
    assert found.wrong.tolist() == [wrong and i == which for i in range(12)]
    np.testing.assert_allclose(found.residual, wave, atol=1e-2)


@pytest.mark.parametrize(("share", "wrong"), [
    (-0.93, False), (-1.07, True), (0.46, False), (0.54, True)
])  # fmt: skip
@pytest.mark.parametrize("which", [53, 173])
def test_where_ranges_scatter_the_limits_are_ten_times_as_wide(
    share: float, wrong: bool, which: int
) -> None:
    """And the time of a window, 11.5 s, at half a metre in a second. Half of it is above 40 m."""
    wave = 12.0 * np.random.default_rng(3).standard_normal(240)
    keys: dict[str, Any] = {"beacons": SQUARE * [8, 8, 1], "per_beacon": 6}
    plain = fitted(0.5 * np.arange(240), wave, **keys)
    assert plain.scatter is not None
    limit = 10 * plain.scatter + 0.5 * 11.5
    assert limit > 95
    assert not plain.wrong.any()
    wave[which] += share * limit - plain.residual[which]
    found = fitted(0.5 * np.arange(240), wave, **keys)
    assert found.wrong.tolist() == [wrong and i == which for i in range(240)]


def test_a_wrong_range_needs_good_ranges_of_three_other_beacons() -> None:
    wave = np.zeros(12)
    wave[[0, 4, 8]] = -60.0  # all of the first beacon
    assert fitted(np.arange(12.0), wave).wrong.tolist() == (wave < 0).tolist()
    three = np.zeros(9)
    three[[0, 3, 6]] = -60.0
    assert not fitted(np.arange(9.0), three, beacons=SQUARE[:3]).wrong.any()


@pytest.mark.parametrize(("off", "wrong"), [(-14.0, False), (-60.0, True), (39.0, False),
                                            (60.0, True)])  # fmt: skip
def test_a_window_that_scatters_more_than_others_has_a_wider_limit(off: float, wrong: bool) -> None:
    """Ranges of the others scatter by 0.1 m, so that 7 m would be wrong there."""
    wave = 0.1 * np.random.default_rng(6).standard_normal(120)
    wave[48:72] *= 25
    wave[60] = off
    found = fitted(0.5 * np.arange(120), wave, per_beacon=6)
    assert found.scatter is not None
    assert found.scatter < 0.2
    assert found.wrong.tolist() == [wrong and i == 60 for i in range(120)]
    wave[60], wave[100] = 0.0, -14.0
    assert fitted(0.5 * np.arange(120), wave, per_beacon=6).wrong.nonzero()[0].tolist() == [100]


def test_a_range_of_the_third_beacon_is_not_wrong_as_two_others_say_nothing() -> None:
    beacon = np.array([0, 1, 0, 1, 2, 0, 1, 0, 1])
    off = np.where(beacon == 2, 70.0, 0.0)
    found = fitted(np.arange(9.0), off, beacons=SQUARE[:3], beacon=beacon)
    assert np.nanmax(np.abs(found.residual)) > 45
    assert not found.wrong.any()
    four = np.array([0, 1, 0, 1, 2, 3, 1, 0, 3, 0, 3, 1])
    told = fitted(np.arange(12.0), np.where(four == 2, 70.0, 0.0), beacon=four)
    assert told.wrong.tolist() == (four == 2).tolist()


@pytest.mark.parametrize(("late", "east"), [
    (4.0, 30.0), (5.2, 30.0), (5.97, -30.0), (6.5, -30.0), (20.0, -30.0)
])  # fmt: skip
def test_of_two_sides_the_one_is_better_on_which_a_range_is_not_too_short(
    late: float, east: float
) -> None:
    """Two beacons fit on both sides of the line between them. A third one is 3 m beside it; on the
    other side, its range is 6 m longer. One that is too short counts as two that are late."""
    beacons = np.array([[0.0, 0.0, 5.0], [40.0, 0.0, 5.0], [20.0, 3.0, 5.0]])
    place = np.tile([20.0, 30.0, 5.0], (9, 1))
    off = np.where(np.arange(9) == 4, late, 0.0)
    found = fitted(
        np.arange(9.0), off, beacons=beacons, place=place, beacon=[0, 1, 0, 1, 2, 0, 1, 0, 1]
    )
    assert found.first is not None
    np.testing.assert_allclose(found.first.position[:2], [20.0, east], atol=0.02)
    expected = late if east > 0 else late - 6.0
    assert found.residual[4] == pytest.approx(expected, abs=0.02)


# --- Noise ----------------------------------------------------------------------------------------


def searched(samples: Samples, at: Any, guess: Any, speed_std: float = 1.0) -> tuple[Any, float]:
    """The line that solves Cauchy's equations with the scale of its own residuals, by a search."""
    time_s = (samples.range_ns - samples.range_ns[0]) / NS

    def off(x: Any) -> Any:
        place = np.column_stack([x[0] + x[2] * time_s, x[1] + x[3] * time_s, np.full_like(time_s,
                                                                                         5.0)])
        return samples.range - np.linalg.norm(place - at, axis=1)

    x, scale = np.array(guess, float), 1.0
    for _ in range(80):
        scale = 1.4826 * float(np.median(np.abs(off(x))))

        def cost(y: Any, scale: float = scale) -> float:
            robust = 2.385**2 / 2 * np.log1p((off(y) / (2.385 * scale)) ** 2).sum()
            return float(robust + (y[2] ** 2 + y[3] ** 2) / (2 * speed_std**2))

        new = minimize(cost, x, method="BFGS", options={"gtol": 1e-8}).x
        if np.abs(new - x).max() < 1e-6:
            break
        x = new
    return x, scale


def noisy(seed: int, count: int = 12) -> Any:
    rng = np.random.default_rng(seed)
    wave = 0.4 * rng.standard_normal(count)
    wave[rng.choice(count, 2, replace=False)] += [3.0, 7.0]
    return wave


@pytest.mark.parametrize("seed", [1, 2, 4])
def test_a_line_is_that_of_a_search_with_the_same_weights(seed: int) -> None:
    time_s = 20 + 2.0 * np.arange(12)
    samples, at = heard(time_s, noisy(seed))
    x, scale = searched(samples, at, [*(START + 20 * VELOCITY), *VELOCITY])
    found = lines(samples, at, None)
    first = found.first
    assert first is not None
    np.testing.assert_allclose(first.position[:2], x[:2], atol=2e-3)
    np.testing.assert_allclose(first.velocity[:2], x[2:], atol=2e-4)
    # Of twelve residuals, three are taken up by the line.
    spread = scale * np.sqrt(12 / 9)
    assert found.scatter == pytest.approx(spread, rel=5e-3)
    t = 2.0 * np.arange(12)
    away = np.column_stack([x[0] + x[2] * t, x[1] + x[3] * t, np.full(12, 5.0)]) - at
    size = np.linalg.norm(away, axis=1)
    unit = away[:, :2] / size[:, None]
    off = samples.range - size
    np.testing.assert_allclose(found.residual, off, atol=5e-3)
    rows = np.hstack([unit, unit * t[:, None]])
    weight = 1 / (1 + (off / (2.385 * scale)) ** 2) / scale**2
    normal = (rows.T * weight) @ rows + np.diag([0, 0, 1.0, 1.0])
    std = np.sqrt(np.diag(np.linalg.inv(normal))[:2]) * spread / scale
    np.testing.assert_allclose(first.std, std, rtol=0.02)
    medians = [np.median(off[samples.beacon == b]) for b in range(4)]
    assert found.offset == pytest.approx(np.sqrt(np.mean(np.square(medians))), rel=0.02)


def test_the_scatter_is_the_median_of_the_windows_and_the_start_has_at_least_that() -> None:
    """The first window is twenty times as good as the others."""
    rng = np.random.default_rng(4)
    wave = 0.5 * rng.standard_normal(60)
    wave[:12] /= 20
    time_s = np.arange(60.0)
    found = fitted(time_s, wave)
    each = []
    for k in range(5):
        own = slice(12 * k, 12 * k + 12)
        alone = fitted(time_s[own], wave[own], beacon=np.arange(60)[own] % 4)
        each.append(alone.scatter)
        np.testing.assert_allclose(found.residual[own], alone.residual, atol=5e-3)
    assert found.scatter == pytest.approx(np.median(each), rel=1e-2)
    alone = fitted(time_s[:12], wave[:12])
    assert found.first is not None
    assert alone.first is not None
    factor = found.scatter / alone.scatter
    assert factor > 5
    np.testing.assert_allclose(found.first.std, factor * alone.first.std, rtol=0.02)


def test_a_diver_who_cannot_be_that_fast_is_not() -> None:
    """Ranges that hardly say anything of the speed leave it near zero: 1 m/s is usual."""
    rng = np.random.default_rng(2)
    samples, at = heard(np.arange(12) / 4, 3.0 * rng.standard_normal(12))
    x, _ = searched(samples, at, [*START, 0.0, 0.0])
    found = lines(samples, at, None)
    assert found.first is not None
    assert 0.02 < np.hypot(*x[2:]) < 1.5
    np.testing.assert_allclose(found.first.velocity[:2], x[2:], atol=5e-3)
    np.testing.assert_allclose(found.first.position[:2], x[:2], atol=2e-2)


def test_a_window_in_which_a_third_of_the_ranges_are_wrong_has_the_line_of_the_others() -> None:
    off = np.zeros(36)
    off[12:24] = [0, 30, 0, 0, 45, 0, -25, 0, 0, 38, 0, 0]
    found = fitted(np.arange(36.0), off)
    np.testing.assert_allclose(found.residual, off, atol=0.02)
