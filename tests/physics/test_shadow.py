"""The shadow of the diver's body in long records; what limits, maps and receivers know of it."""

from __future__ import annotations

import warnings
from functools import cache
from math import acos, pi, radians, sqrt
from typing import Any

import numpy as np
import pytest
import sblcosim
from numpy.typing import NDArray
from sblcosim.comparison.budget import sources
from sblcosim.limits import echoes, places, reference
from sblcosim.limits.parameters import conditions
from sblcosim.limits.unknown import left_out
from sblcosim.scenario.conditions import conditions as words_of
from sblcosim.scenario.scenario import Scenario, load
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters import lanes
from sblcosim.simulation.resolve import resolve
from scipy.stats import norm

RUNS, LOSS, BASE, HALF = 16, 0.8, 0.2, 30.0
A = "acoustics."
CIRCLE: dict[str, Any] = {
    "target.trajectory": "circle", "target.center_m": [12.0, 0.0], "target.radius_m": 5.0,
    "target.turns": 20.0, "target.side_m": None, "target.depth_start_m": 2.0,
    "target.depth_end_m": 2.0, "time.duration_s": 400.0, "platform.beaufort": None,
    f"{A}range_std_m": 0.0, f"{A}loss_probability": BASE,
    f"{A}shadow_loss_probability": LOSS, f"{A}shadow_half_width_deg": HALF,
}
TWO_WAY = ((f"{A}ranging", "two_way"), (f"{A}turnaround_s", 0.01))
ECHOES = ((f"{A}surface_echo_probability", 0.6), (f"{A}water_depth_m", 3.5),
          (f"{A}bottom_echo_probability", 0.3))


def of(keys: tuple[tuple[str, Any], ...]) -> Scenario:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return load("harbour-square", {**CIRCLE, **dict(keys)})


@cache
def recorded(*keys: tuple[str, Any]) -> dict[str, NDArray[np.float64]]:
    """Each ping of many runs: whether it is received, the angle to the shadow, the excess."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        plan = resolve(connect(of(keys), "multilateration"))
        names = ("acoustics.reception_count", "acoustics.range", "acoustics.true_range",
                 "target.position", "target.velocity", "platform.beacon_position")
        values = lanes.execute(
            plan, {"acoustics.seed": np.arange(RUNS)}, record=[*names]
        ).values
    count = values["acoustics.reception_count"]
    # Ping k happens in the step that begins at k T, when the diver is where row k says.
    ticks = np.arange(1, count.shape[1] - 1)
    beacon = (ticks - 1) % 4
    place = values["platform.beacon_position"].reshape(RUNS, -1, 4, 3)[0, ticks, beacon]
    diver, v = (values[f"target.{it}"][0, ticks] for it in ("position", "velocity"))
    behind = np.stack([-v[:, 0], -v[:, 1], 0 * v[:, 0]], 1)
    cosine = ((place - diver) * behind).sum(1) / (
        np.linalg.norm(place - diver, axis=1) * np.linalg.norm(behind, axis=1)
    )
    heard = np.diff(count, axis=1)[:, ticks, beacon] > 0
    excess = (values["acoustics.range"] - values["acoustics.true_range"])[:, ticks + 1, beacon]
    return {"heard": heard, "excess": excess, "angle": np.array([*map(acos, cosine.tolist())])}


def law(angle: NDArray[np.float64], half_deg: float = HALF, loss: float = LOSS
        ) -> NDArray[np.float64]:
    there = angle < 2 * radians(half_deg)
    return np.where(there, loss * np.cos(pi * angle / 4 / radians(half_deg)) ** 2, 0.0)


@pytest.mark.parametrize("keys", [(), TWO_WAY])
def test_the_loss_is_that_of_the_law_at_every_angle(keys: tuple[tuple[str, Any], ...]) -> None:
    """In bins of 20°, within 99 % bounds over all bins of independent pings."""
    found = recorded(*keys)
    arrives = (1 - BASE) * (1 - law(found["angle"]))
    arrives = arrives**2 if keys else arrives
    bins = (found["angle"] // radians(20)).astype(int)
    z = norm.isf(0.005 / len(np.unique(bins)))
    shares = []
    for one in np.unique(bins):
        there = bins == one
        expected, n = arrives[there], RUNS * there.sum()
        bound = z * sqrt((expected * (1 - expected)).mean() / n)
        share = found["heard"][:, there].mean()
        assert share == pytest.approx(expected.mean(), abs=bound)
        shares.append(share)
    assert len(shares) == 9
    assert shares[0] < 0.5 * shares[-1]


def test_late_ranges_are_more_frequent_in_the_shadow() -> None:
    found = recorded(*ECHOES)
    late = found["heard"] & (found["excess"] > 1e-6)
    lost = 1 - (1 - BASE) * (1 - law(found["angle"]))
    some = 1 - 0.4 * 0.7
    for there in (found["angle"] < radians(40), found["angle"] > radians(70)):
        expected, n = (lost * some)[there], RUNS * there.sum()
        bound = norm.isf(0.0025) * sqrt((expected * (1 - expected)).mean() / n)
        assert late[:, there].mean() == pytest.approx(expected.mean(), abs=bound)


@pytest.mark.parametrize("keys", [(), TWO_WAY, ECHOES, (*TWO_WAY, *ECHOES)])
def test_the_mean_loss_is_that_over_all_courses(keys: tuple[tuple[str, Any], ...]) -> None:
    """By integration here; the diver's circle has all courses, at almost the beacons' depth."""
    scenario = of(keys)
    angle = (np.arange(10_000) + 0.5) / 10_000 * pi
    leg = (1 - (1 - BASE) * (1 - law(angle))) * (0.4 * 0.7 if ECHOES[0] in keys else 1.0)
    expected = np.mean(1 - (1 - leg) ** (2 if TWO_WAY[0] in keys else 1))
    assert echoes.lost(scenario.acoustics) == pytest.approx(expected, abs=1e-3)
    assert conditions(scenario).loss == echoes.lost(scenario.acoustics)
    assert 1 - recorded(*keys)["heard"].mean() == pytest.approx(expected, abs=0.04)


def test_receivers_assume_the_late_ranges_of_the_shadow() -> None:
    late = [load(of(ECHOES), {f"{A}shadow_loss_probability": it}).assumptions()
            for it in (0.0, LOSS)]
    found = recorded(*ECHOES)
    share = (found["excess"][found["heard"]] > 1e-6).mean()
    assert late[1]["outlier_probability"] == pytest.approx(share, abs=0.03)
    assert late[0]["outlier_probability"] < share - 0.05


def test_a_map_knows_that_half_a_circle_is_in_the_shadow() -> None:
    """What is possible is near that along runs; the mean number of packets would be worth more."""
    keys = {**CIRCLE, f"{A}range_std_m": 0.1, f"{A}shadow_loss_probability": 1.0,
            f"{A}shadow_half_width_deg": 80.0, f"{A}loss_probability": 0.0,
            "time.duration_s": 280.0, "time.sampling_time_s": 1.0}
    base = of(tuple(keys.items()))

    def circle(time: float) -> NDArray[np.float64]:
        angle = base.target.speed_m_s * time / 5.0
        return np.array([[12 + 5 * np.cos(angle), 5 * np.sin(angle), 2.0]])

    def square(relative: NDArray[np.float64]) -> float:
        return float(relative[..., :2, :2].trace(axis1=-2, axis2=-1).mean())

    def mapped(scenario: Scenario) -> float:
        found = places.covariances(scenario, circle, np.array([0.01]), (20.0, 280.0))
        return square(found.relative)

    along = []
    for seed in range(6):
        run = sblcosim.run(load(base, {"seed": seed}), "multilateration", master="lanes")
        limit = reference(run.record, base, acceleration_psd=0.01)
        along.append(square(limit.relative[limit.epoch_ns > 20e9]))
    assert mapped(base) == pytest.approx(np.mean(along), rel=0.3)
    mean = {f"{A}shadow_loss_probability": 0.0, f"{A}loss_probability": 80 / 180}
    assert mapped(base) > 3 * mapped(load(base, mean))


def test_a_diver_at_rest_has_no_shadow_on_a_map() -> None:
    at = np.array([[12.0, 0.0, 2.0]])
    found = [
        places.covariances(load(of(()), {f"{A}shadow_loss_probability": it}), lambda t: at,
                           np.array([0.01]), (10.0, 60.0)).relative
        for it in (0.0, 1.0)
    ]
    assert np.array_equal(found[1][: len(found[0])], found[0])


def test_the_reference_counts_echoes_at_the_course_of_the_diver() -> None:
    """A range from a shaded beacon is more often late, and so tells less."""
    a = of(((f"{A}range_std_m", 0.1), *ECHOES)).acoustics
    diver, beacons = np.array([[15.0, 0.0, 2.0]] * 2), np.array([[[0.0, 0.0, 0.5]]] * 2)
    velocity = np.array([[0.5, 0.0, 0.0], [-0.5, 0.0, 0.0]])
    away, towards = echoes.shares_along(a, diver, beacons, velocity)[:, 0]
    assert away < 0.9 * towards
    plain = load(of(((f"{A}range_std_m", 0.1), *ECHOES)), {f"{A}shadow_loss_probability": 0.0})
    assert towards == pytest.approx(echoes.shares(plain.acoustics, diver[:1], beacons[:1, 0])[0])
    lost = 1 - 0.8 * (1 - law(np.array([np.arctan2(1.5, 15.0)]))[0])
    shaded = load(plain, {f"{A}loss_probability": float(lost)}).acoustics
    assert away == pytest.approx(echoes.shares(shaded, diver[:1], beacons[:1, 0])[0], rel=1e-9)


def test_it_is_a_source_of_error_of_its_own() -> None:
    scenario = of(())
    assert "shadow" in sources.of_scenario(scenario)
    assert sources.switched(scenario, ["shadow"]) == {f"{A}shadow_loss_probability": 0.0}
    assert sources.fixed(scenario, ["shadow"]) == ()
    assert left_out(scenario) == ()
    assert "80 % loss in the shadow of the diver's body" in words_of(scenario)


@pytest.mark.parametrize("master", ["native", "lanes"])
def test_the_masters_agree_to_the_bit(master: str) -> None:
    keys = {**dict(ECHOES), **CIRCLE, "time.duration_s": 30.0}
    one, other = (sblcosim.run("harbour-square", "multilateration", keys, master=it)
                  for it in ("python", master))
    for name in ("range", "reception_count", "arrival_epoch", "true_range"):
        found = one.record.values[f"acoustics.{name}"]
        assert np.array_equal(found, other.record.values[f"acoustics.{name}"])
    assert (found > 0).any()
