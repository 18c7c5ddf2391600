"""Where the diver was to begin with: noise, start and smooth path against dense ones; places."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sblcosim
from sblcosim.identification import path
from sblcosim.identification.fit import Fit, parameters_of
from sblcosim.identification.innovations import PARAMETERS, PRIOR, Ranges
from sblcosim.identification.path import noise_of, smoothed, start
from sblcosim.identification.places import place_std
from sblcosim.identification.swings import CarrierSwing, sines, swings_of
from scipy import stats
from scipy.optimize import least_squares
from seams import Seam

BEACONS = np.array([[21.0, 12.0, 11.0], [-14.0, 25.0, 13.0], [-3.0, -28.0, 5.0]])


def test_noise_is_the_scatter_about_the_line_through_the_neighbours() -> None:
    """A reading 1/4 on the way between its neighbours is off by its own noise and by theirs."""
    time = 11.0 + np.array([0.0, 1.0, 4.0, 0.5, 2.5, 6.5, 7.5, 3.0, 3.7, 9.0])
    which = np.array([0, 0, 0, 4, 4, 4, 4, 2, 2, 7])
    values = np.array([1.0, 3.0, 5.0, 2.0, 2.9, 4.0, 0.0, 50.0, -70.0, 9.0])
    off = [
        (3.0 - (0.75 * 1.0 + 0.25 * 5.0)) / np.sqrt(1 + 0.75**2 + 0.25**2),
        (2.9 - (2 / 3 * 2.0 + 1 / 3 * 4.0)) / np.sqrt(1 + (2 / 3) ** 2 + (1 / 3) ** 2),
        (4.0 - (0.2 * 2.9 + 0.8 * 0.0)) / np.sqrt(1 + 0.2**2 + 0.8**2),
    ]
    normal = 1 / stats.norm.ppf(0.75)
    assert noise_of(time, values, which) == pytest.approx(normal * np.median(off), rel=1e-4)
    for rows, one in ((slice(0, 3), off[0]), (slice(3, 6), off[1]), (slice(4, 7), off[2])):
        alone = noise_of(time[rows], values[rows], which[rows])
        assert alone == pytest.approx(normal * abs(one), rel=1e-4)
    assert noise_of(time[7:], values[7:], which[7:]) == 1.0
    assert noise_of(np.zeros(3), np.array([1.0, 4.0, 3.0]), np.zeros(3, int)) == pytest.approx(
        normal * 3.0 / np.sqrt(2), rel=1e-4  # at once: off from the one before
    )


def test_the_uncertainty_of_a_start_is_that_of_its_least_squares() -> None:
    """A diver at rest, of whom some ranges to each beacon are used; a speed is about 1 m/s."""
    rng = np.random.default_rng(5)
    n = 14
    beacon = np.array([0, 1, 1, 2, 0, 2, 1, 0, 2, 0, 1, 2, 0, 1])
    time = 30.0 + np.cumsum(rng.uniform(0.1, 0.4, n))
    place = BEACONS[beacon] + rng.normal(0, 0.5, (n, 3))
    down = 7.0 + 0.1 * np.arange(n)
    at = np.array([4.0, -6.0])
    way = np.column_stack([np.tile(at, (n, 1)), down]) - place
    ranges = np.linalg.norm(way, axis=1)
    ranges[9:] += 50.0  # three beacons, three ranges each
    found, std = start(time, beacon, ranges, place, down, 0.4)
    assert found == pytest.approx([4.0, -6.0, 0.0, 0.0], abs=1e-4)
    unit = way[:9, :2] / np.linalg.norm(way[:9], axis=1, keepdims=True)
    slope = np.hstack([unit, unit * (time[:9] - time[0])[:, None]]) / 1.2
    inverse = np.linalg.inv(slope.T @ slope + np.diag([0.0, 0.0, 1.0, 1.0]))
    assert std == pytest.approx(1.2 * np.sqrt(inverse[0, 0] + inverse[1, 1]), rel=1e-3)


@pytest.mark.parametrize(("noise", "scale"), [(0.3, 0.9), (5e-4, 1.5e-3), (1e-5, 1e-3)])
def test_a_start_is_looked_for_at_the_centre_and_in_twelve_directions(
    seam: Seam, noise: float, scale: float
) -> None:
    """As far away as the usual range, and half as far; the best of all fits is the start."""
    rng = np.random.default_rng(6)
    beacon, time = np.arange(9) % 3, 50.0 + 0.5 * np.arange(9)
    place = BEACONS[beacon] + rng.normal(0, 1.5, (9, 3))
    ranges, down = rng.uniform(20, 40, 9), 6.0 + rng.normal(size=9)
    begun, ends = [], []

    def searched(residuals: Any, begin: Any, loss: str) -> Any:
        assert loss == "soft_l1"
        for x in (np.array(begin) + rng.normal(0, 3, 4) for _ in range(2)):
            way = np.column_stack([x[:2] + np.outer(time - 50, x[2:]) - place[:, :2],
                                   down - place[:, 2]])
            off = (np.linalg.norm(way, axis=1) - ranges) / scale
            assert residuals(x) == pytest.approx(np.concatenate([off, x[2:]]))
        begun.append(begin)
        cost = (len(begun) - 17.3) ** 2
        x, slope = np.array(begin) + 0.5, rng.normal(size=(11, 4))
        ends.append(SimpleNamespace(x=x, cost=cost, jac=slope))
        return ends[-1]

    seam.instead(least_squares, searched, only=path)
    found, std = start(time, beacon, ranges, place, down, noise)
    centre, reach = place[:, :2].mean(axis=0), np.median(ranges)
    turns = np.arange(12) / 6
    away = np.column_stack([np.cos(np.pi * turns), np.sin(np.pi * turns)])
    there = [centre[None] + 1e-3, centre + reach * away, centre + reach / 2 * away]
    expected = np.column_stack([np.concatenate(there), np.zeros((25, 2))])
    assert np.array(begun) == pytest.approx(expected, abs=1e-9)
    assert found is ends[16].x
    slope = ends[16].jac
    P = np.linalg.inv(slope.T @ slope)
    assert std == pytest.approx(scale * np.sqrt(P[0, 0] + P[1, 1]))
    seam.undo()
    # One beacon at the diver's feet, heard at once: the fit begins off the cusp.
    once = np.zeros(1)
    at_feet, far = start(once, np.zeros(1, int), once + 5.0, np.zeros((1, 3)), once, 0.1)
    assert np.hypot(*at_feet[:2]) == pytest.approx(5.0, abs=0.05)
    assert far == pytest.approx(0.3 * np.sqrt(1e9), rel=1e-3)  # it tells nothing across


def test_a_start_from_few_ranges_uses_them_all() -> None:
    at = np.array([4.0, -6.0, 7.0])
    beacon = np.array([0, 1, 2, 0])
    ranges = np.linalg.norm(at - BEACONS[beacon], axis=1)
    found, _ = start(np.arange(4.0), beacon, ranges, BEACONS[beacon], np.full(4, 7.0), 0.1)
    assert found == pytest.approx([4.0, -6.0, 0.0, 0.0], abs=1e-3)


def test_a_smooth_path_weighs_readings_by_their_spacing() -> None:
    """Its curvature is penalised by the integral of the squared acceleration: a cubic spline."""
    time = np.array([0.0, 0.3, 1.7, 2.0, 3.6, 5.1, 5.4, 7.0])
    values = np.array([2.0, 2.9, 1.1, 0.4, 0.9, 3.0, 2.2, 2.7])
    std, psd = 0.4, 0.7
    n, steps = len(time), np.diff(time)
    Q, R = np.zeros((n, n - 2)), np.zeros((n - 2, n - 2))
    for j in range(n - 2):
        Q[j : j + 3, j] = 1 / steps[j], -1 / steps[j] - 1 / steps[j + 1], 1 / steps[j + 1]
        R[j, j] = (steps[j] + steps[j + 1]) / 3
        if j:
            R[j, j - 1] = R[j - 1, j] = steps[j] / 6
    spline = np.linalg.solve(np.eye(n) + std**2 / psd * Q @ np.linalg.solve(R, Q.T), values)
    assert smoothed(time, values, std, psd)[0] == pytest.approx(spline, abs=1e-9)
    least = smoothed(time, values, std, 1e-9)
    assert least[0] == pytest.approx(smoothed(time, values, std, 1e-6)[0], abs=1e-12)
    assert least[1] == smoothed(time, values, std, 1e-6)[1]


def test_the_variance_of_a_smooth_path_is_that_far_from_its_ends() -> None:
    n, dt, std, psd = 161, 0.1, 0.3, 0.02
    t = dt * np.arange(n)
    low, high = np.minimum.outer(t, t), np.maximum.outer(t, t)
    prior = psd * (low**3 / 3 + low**2 * (high - low) / 2) + 1e4 + 1e2 * np.outer(t, t)
    posterior = prior - prior @ np.linalg.solve(prior + std**2 * np.eye(n), prior)
    variance = smoothed(t, np.zeros(n), std, psd)[1]
    assert variance == pytest.approx(posterior[n // 2, n // 2], rel=0.03)
    assert variance == pytest.approx(psd**0.25 * (std**2 * dt) ** 0.75 / np.sqrt(8), rel=1e-9)
    # The usual interval counts; and a reading tells no less than itself.
    odd = np.sort(np.concatenate([t, t[:20] + 0.01]))
    assert smoothed(odd, np.zeros(n + 20), std, psd)[1] == pytest.approx(variance, rel=1e-9)
    assert smoothed(t, np.zeros(n), std, 1e9)[1] == pytest.approx(std**2)


def test_a_path_of_two_readings_is_these() -> None:
    values = np.array([1.5, -2.0])
    path, variance = smoothed(np.array([0.0, 1.0]), values, 0.3, 0.02)
    assert path.tolist() == values.tolist()
    assert path is not values
    assert variance == pytest.approx(0.09)
    three = smoothed(np.arange(3.0), np.array([0.0, 3.0, 0.0]), 0.3, 1e-6)[0]
    assert three == pytest.approx([1.0, 1.0, 1.0], abs=1e-3)


def test_the_sines_of_swings() -> None:
    time = np.array([0.0, 0.7, 3.1])
    found = sines(time, [CarrierSwing(0.11, 2.0), CarrierSwing(0.43, 5.0)])
    turns = [[0.0, 0.0], [0.077, 0.301], [0.341, 1.333]]
    expected = [
        [f(2 * np.pi * turn) for turn in row for f in (np.sin, np.cos)] for row in turns
    ]
    assert found == pytest.approx(np.array(expected))
    assert sines(time, []).shape == (3, 0)


def test_of_a_platform_in_a_sea_only_yaw_is_a_sine() -> None:
    platform = sblcosim.load("harbour-wakes").platform
    (swing,) = swings_of(platform, 2.0)
    assert swing.frequency == 0.05
    assert swing.amplitude == pytest.approx(2.0 * 3 * np.pi / 180)


# --- Places ---------------------------------------------------------------------------------------

FAR = 1e5


def far_off(counts: Any, off: Any, down: bool = False, **changes: float) -> Ranges:
    """Readings of a diver who rests in the north's zero, by beacons far in the south or deep below.

    The place of each is off by its own; the first readings tell the diver's place by themselves.
    """
    rng = np.random.default_rng(4)
    beacon = np.concatenate([np.full(k, b) for b, k in enumerate(counts)])
    n = len(beacon)
    place = np.zeros((n, 3))
    place[:, 0] = -FAR
    if down:
        place[:] = [0.0, 0.0, FAR]
    prior = {**dict.fromkeys(PRIOR, 0.0), "position_std": 0.2, "velocity_std": 1e-3, **changes}
    ranges = FAR + np.asarray(off)[beacon] + 0.1 * rng.normal(size=n)
    return Ranges(np.arange(float(n)), beacon, ranges, place, np.zeros(n), np.zeros(n), prior,
                  len(counts))


FOUND = Fit(
    ("range_std", "late_share", "late_mean", "acceleration_psd"),
    np.array([np.log(0.1), -25.0, 0.0, -25.0]), np.eye(4), 0.0, 1,
)


def dense(g: Ranges, std: float, down: bool) -> float:
    """Likelihood of the readings with that uncertainty of the places, and a common offset."""
    same = np.equal.outer(g.beacon, g.beacon)
    C = 0.01 * np.eye(len(g.time)) + std**2 * same + g.prior["offset_std"] ** 2
    if not down:
        C = C + 0.2**2 + 1e-6 * np.outer(g.time, g.time)
    return float(stats.multivariate_normal.logpdf(g.range - FAR, np.zeros(len(C)), C))


TIMES = 2.0 ** np.arange(-4, 4)


def expected(g: Ranges, down: bool) -> tuple[float, float]:
    """Root of the mean square by the posterior, and the spread of its logarithm."""
    each = [dense(g, g.prior["place_down_std"] * min(t, 1.0) if down else g.prior["place_std"] * t,
                  down) for t in TIMES]
    weight = np.exp(np.array(each) - max(each) - (np.log(TIMES) / 1.1) ** 2 / 2)
    weight /= weight.sum()
    mean = weight @ np.log(TIMES)
    return (g.prior["place_std"] * np.sqrt(weight @ TIMES**2),
            np.sqrt(weight @ np.log(TIMES) ** 2 - mean**2))


OFF = 0.9 * np.array([0.7, -1.3, 0.4, 1.1, -0.2, -0.9, 1.6, -0.5, 0.3, -1.2, 0.8, 0.1])


@pytest.mark.parametrize(("beacons", "assumed"), [
    (12, 0.3), (12, 1.7), (7, 0.8), (3, 0.3), (2, 0.8), (2, 1.7),
])  # fmt: skip
def test_the_uncertainty_of_places_is_that_of_the_dense_problem(
    beacons: int, assumed: float
) -> None:
    counts = [4 + k % 3 for k in range(beacons)]
    g = far_off(counts, OFF[:beacons], place_std=assumed, offset_std=0.5)
    value, spread = expected(g, False)
    found = place_std(g, FOUND)
    if (beacons, assumed) == (2, 1.7):
        assert 0.5 < spread < 0.55
        assert found is None
    else:
        assert spread < 0.49
        assert found == pytest.approx(value, rel=0.01)


def test_the_uncertainty_of_places_of_many_wide_ranges() -> None:
    """The likelihood itself is less than the least number."""
    g, times = far_off([12] * 12, OFF, place_std=0.6, offset_std=0.5), 1000.0
    value, _ = expected(g, False)
    wide = {name: times * std for name, std in g.prior.items()}
    found = replace(FOUND, at=FOUND.at + np.log([times, 1.0, 1.0, 1.0]))
    far = replace(g, range=FAR + times * (g.range - FAR), prior=wide)
    assert place_std(far, found) == pytest.approx(times * value, rel=0.01)


@pytest.mark.parametrize(("assumed", "least", "most"), [(0.25, 0.02, 0.06), (0.5, 0.9, 1.3)])
def test_of_two_uncertainties_the_one_on_the_way_from_the_assumed_one_counts(
    assumed: float, least: float, most: float
) -> None:
    """Eight places are good to 2 cm; the only range to each of two others is 2 m off."""
    off = [*0.02 * OFF[:8], 2.0, -2.2]
    found = place_std(far_off([30] * 8 + [1, 1], off, place_std=assumed, offset_std=0.5), FOUND)
    assert found is not None
    assert least < found < most


def test_depths_of_beacons_are_known_as_well_as_assumed_or_better() -> None:
    g = far_off([5] * 8, 0.02 * OFF[:8], down=True, place_std=0.6, place_down_std=0.4,
                offset_std=0.5)
    value, spread = expected(g, True)
    assert spread < 0.5
    assert place_std(g, FOUND) == pytest.approx(value, rel=0.01)


def test_places_that_are_taken_as_exact_tell_nothing() -> None:
    assert place_std(far_off([5] * 8, OFF[:8], offset_std=0.5), FOUND) is None


# --- Coordinates ----------------------------------------------------------------------------------


def test_parameters_at_their_coordinates() -> None:
    at = np.array([[-2.0, 0.3, 1.1, 0.7], [-50.0, 3.0, 25.0, -0.6]])
    found = parameters_of(at, ("range_std", "late_share", "late_mean", "acceleration_psd"))
    assert found.shape == (2, len(PARAMETERS))
    rows = [dict(zip(PARAMETERS, row, strict=True)) for row in found]
    assert rows[0]["range_std"] == pytest.approx(np.exp(-2.0))
    assert rows[0]["late_share"] == pytest.approx(np.exp(0.3) / (1 + np.exp(0.3)))
    assert rows[0]["late_mean"] == pytest.approx(np.exp(1.1))
    assert rows[1]["range_std"] == pytest.approx(np.exp(-40.0))
    assert rows[1]["late_mean"] == pytest.approx(np.exp(20.0))
    assert rows[1]["acceleration_psd"] == pytest.approx(np.exp(-0.6))
    assert (rows[0]["turn_rate"], rows[0]["range_walk"]) == (1.0, 0.0)
    own = Fit((*FOUND.names, "range_walk"), np.array([0.5, 0.1, 0.2, 0.3, -1.5]),
              np.diag([0.09, 1.0, 1.0, 1.0, 0.25]), 0.0, 1)
    assert own.coordinate("range_walk") == pytest.approx((-1.5, 0.5))
    assert own.coordinate("range_std") == pytest.approx((0.5, 0.3))
    assert own.parameters[PARAMETERS.index("range_walk")] == pytest.approx(np.exp(-1.5))
    assert (own.walks, own.turns) == (True, False)
    assert not FOUND.walks
    assert Fit((), np.zeros(0), np.zeros((0, 0)), 0.0, 2).turns
