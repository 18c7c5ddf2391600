"""Points along a diver's path with their weights, and the rates of a boat on a track, by hand."""

from __future__ import annotations

import cmath
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from sblcosim.models.settings import boat, paths
from sblcosim.models.settings.expression import UNKNOWN, inputs_of, symbol

DIVER: dict[str, Any] = {
    "center_m": (3.0, -2.0), "heading_deg": 35.0, "depth_start_m": 4.0, "depth_end_m": 9.0,
    "path_length_m": 40.0, "radius_m": 12.0, "turns": 1.7, "side_m": 16.0, "speed_m_s": 0.5,
    "spiral_radius_m": (3.0, 10.0), "box_m": (8.0, 20.0), "initial_position_m": (1.0, 2.0, 7.0),
}  # fmt: skip
SHARES = [1 / 16, 3 / 16, 5 / 16, 7 / 16, 9 / 16, 11 / 16, 13 / 16, 15 / 16]
AHEAD = math.radians(35.0)
SQUARE = [(-4, -8), (4, -8), (8, -4), (8, 4), (4, 8), (-4, 8), (-8, 4), (-8, -4)]
"""Ahead and right of the centre, two points on each side."""
FROM_CENTRE: dict[str, list[complex]] = {
    "straight_line": [cmath.rect(40 * s, AHEAD) for s in SHARES],
    "semicircle": [cmath.rect(12, AHEAD + math.pi * s) for s in SHARES],
    "circle": [cmath.rect(12, AHEAD + 2 * math.pi * 1.7 * s) for s in SHARES],
    "square": [complex(*it) * cmath.rect(1, AHEAD) for it in SQUARE],
    "spiral": [cmath.rect(math.sqrt(9 + 91 * s), AHEAD + 2 * math.pi * 1.7 * s) for s in SHARES],
}
"""North as the real part, and east."""


def sketched(trajectory: str, **keys: Any) -> np.ndarray:
    return np.array(paths.sketch(SimpleNamespace(**{**DIVER, "trajectory": trajectory, **keys})))


@pytest.mark.parametrize("trajectory", FROM_CENTRE)
def test_points_of_a_formula_are_in_the_middle_of_eight_equal_parts(trajectory: str) -> None:
    places = np.array(FROM_CENTRE[trajectory])
    wanted = np.column_stack(
        [np.ones(8), 3 + places.real, -2 + places.imag, 4 + 5 * np.array(SHARES)])
    np.testing.assert_allclose(sketched(trajectory), wanted, rtol=1e-12)


def test_a_random_path_is_anywhere_in_its_box_at_each_depth() -> None:
    found = sketched("random_path")
    assert set(found[:, 0]) == {1.0}
    assert {*found[:, 3]} == {4 + 5 * s for s in SHARES}
    for depth in {*found[:, 3]}:
        there = found[found[:, 3] == depth, 1:3]
        assert sorted(map(tuple, there)) == [(-3, -7), (1, 13), (5, -17), (9, 3)]


def test_legs_between_waypoints_weigh_as_much_as_they_are_long() -> None:
    flat = (0.0, 0.0, 5.0, 8.0, 4.0, 6.0, 8.0, 4.0, 6.0, 6.0, 10.0, 3.0, 99.0, 99.0, 99.0)
    found = sketched("waypoints", waypoint_m=flat, waypoint_count=4)
    assert found.tolist() == [
        [9.0, 2.0, 1.0, 5.25], [9.0, 6.0, 3.0, 5.75],
        [1e-9, 8.0, 4.0, 6.0], [1e-9, 8.0, 4.0, 6.0],
        [7.0, 7.5, 5.5, 5.25], [7.0, 6.5, 8.5, 3.75],
    ]
    cut = sketched("waypoints", waypoint_m=flat[:8], waypoint_count=4)  # refused later
    assert cut.tolist() == found[:2].tolist()


def test_legs_of_a_track_weigh_as_much_as_they_last() -> None:
    flat = (0.0, 0.0, 5.0, 8.0, 4.0, 6.0, 4.0, 8.0, 2.0, 9.0, 9.0, 9.0)
    keys = {"track_m": flat, "track_time_s": (0.0, 3.0, 3.5, 8.0)}
    found = sketched("file", **keys, track_count=3)
    assert found.tolist() == [
        [3.0, 2.0, 1.0, 5.25], [3.0, 6.0, 3.0, 5.75], [0.5, 7.0, 5.0, 5.0], [0.5, 5.0, 7.0, 3.0]]
    assert len(sketched("file", **keys, track_count=9)) == 6


@pytest.mark.parametrize(("points", "step"), [(64, 1), (65, 2), (128, 2), (129, 3), (150, 3)])
def test_of_a_long_track_each_second_or_third_point_is_used(points: int, step: int) -> None:
    times = [0.1 * i * i for i in range(points)]
    flat = [x for i in range(points) for x in (i, 2.0 * i, -i)]
    found = sketched("file", track_m=flat, track_time_s=times, track_count=points)
    used = [*range(0, points, step)]
    assert len(found) == 2 * (len(used) - 1)
    np.testing.assert_allclose(found[::2, 0], np.diff(np.array(times)[used]))
    np.testing.assert_allclose(found[::2, 1], np.array(used)[:-1] + 0.25 * step)
    np.testing.assert_allclose(found[1::2, 1], np.array(used)[:-1] + 0.75 * step)
    np.testing.assert_allclose(found[:, 2:], found[:, 1:2] * [2.0, -1.0])


def test_a_path_without_an_end_is_its_start_and_an_unknown_one_has_no_points() -> None:
    assert sketched("white_noise_acceleration").tolist() == [[1.0, 1.0, 2.0, 7.0]]
    assert sketched("of another").tolist() == []
    for trajectory in ("waypoints", "file"):
        target = SimpleNamespace(**{**DIVER, "trajectory": trajectory, "speed_m_s": symbol("v")})
        assert paths.sketch(target) == [(1.0, UNKNOWN, UNKNOWN, UNKNOWN)]


def test_points_are_counted_if_they_are_given() -> None:
    track = SimpleNamespace(track_time_s=(0.0, 1.0, 4.0), waypoint_m=())
    assert paths.points(track) == paths.counts(track) == {"track_count": 3}
    given = SimpleNamespace(track_time_s=(), waypoint_m=(1.0,) * 12)
    assert paths.points(given) == {}
    assert paths.counts(given) == {"waypoint_count": 4}


# --- The rates of a boat -------------------------------------------------------------------------


BOAT: dict[str, Any] = {
    "track_count": 3, "track_time_s": (0.0, 2.0, 5.0),
    "track_m": (0.0, 0.0, 4.0, 2.0, 1.0, 8.0), "track_heading_deg": (0.0, 6.0, 3.0),
    "boat_speed_m_s": 1.5, "boat_course_deg": 70.0,
}  # fmt: skip
"""2 s at (2, 1) m/s and 3 °/s, then 3 s at (-1, 2) m/s and -1 °/s."""


def boat_with(**keys: Any) -> SimpleNamespace:
    return SimpleNamespace(**{**BOAT, **keys})


@pytest.mark.parametrize(("keys", "velocity", "yaw"), [
    # The changes at the three points: (2, 1), (-3, 1) and (1, -2) m/s; 3, -4 and 1 °/s.
    ({}, (2.5, (5 + 10 + 5) / 10), ((2 * 9 + 3 * 1) / 5, (9 + 16 + 1) / 5)),
    ({"track_count": 2}, (2.5, (5 + 5) / 4), (9.0, (9 + 9) / 2)),
    ({"track_m": (0.0, 0.0, 4.0, 2.0), "track_heading_deg": (0.0, 6.0)},  # refused later
     (2 * 5 / 10, (5 + 5) / 10), (2 * 9 / 5, (9 + 9) / 5)),
])  # fmt: skip
def test_the_rates_of_a_track_are_mean_squares_and_squares_of_changes_per_second(
    keys: dict[str, Any], velocity: tuple[float, float], yaw: tuple[float, float]
) -> None:
    on_track = boat_with(**keys)
    assert boat.rates(on_track, yaw=False) == pytest.approx(velocity)
    assert boat.rates(on_track, yaw=True) == pytest.approx(yaw)
    wanted = dict(zip(boat.RATES, (*velocity, *yaw), strict=True))
    assert boat.inputs(on_track) == pytest.approx(wanted)
    assert boat.inputs(boat_with(track_count=0)) == dict.fromkeys(boat.RATES, 0.0)


def test_points_at_the_same_time_are_a_microsecond_apart() -> None:
    """Such a track is refused later."""
    mean, changes = boat.rates(
        boat_with(track_count=2, track_time_s=(1.0, 1.0), track_m=(0.0, 0.0, 3e-6, 0.0)), False)
    assert mean == pytest.approx(9.0 / 2)
    assert changes == pytest.approx(2 * 9.0 / (2 * 1e-6))


def test_what_receivers_are_told_of_a_boat_adds_its_track_to_its_own_motion() -> None:
    straight = {"std": 7.0, "time": 8.0}

    def told(own: dict[str, float], yaw: bool = False, **keys: Any) -> dict[str, Any]:
        return boat.turning(boat_with(**keys), own, "std", "time", straight, yaw=yaw)

    own = {"std": 0.5, "time": 4.0}
    both, noise = 0.25 + 2.5, 2 + 2 * 0.25 / 4
    assert told(own) == pytest.approx({"std": math.sqrt(both), "time": 2 * both / noise})
    both, noise = 0.25 + 4.2, 5.2 + 2 * 0.25 / 4
    assert told(own, True) == pytest.approx({"std": math.sqrt(both), "time": 2 * both / noise})
    assert told({"std": 0.0}) == pytest.approx({"std": math.sqrt(2.5), "time": 2.5})
    still = {"track_m": (1.0,) * 6}
    assert told({"std": 0.0}, **still) == {"std": 0.0, "time": 1e6}
    assert told(own, **still) == pytest.approx(own)
    for time in (0.7e6, 1.5e6, 2e6):  # what changes as slowly does not change
        assert told({"std": 0.5, "time": time}, **still)["time"] == pytest.approx(min(time, 1e6))
    assert told(own, track_count=0) == straight


def test_where_points_are_not_known_the_rates_are_inputs() -> None:
    unknown, own = boat_with(track_count=symbol("count")), {"std": 0.5, "time": 4.0}
    for yaw in (False, True):
        mean, changes = boat.RATES[2 * yaw : 2 * yaw + 2]
        found = boat.turning(unknown, own, "std", "time", {"std": 7.0, "time": 8.0}, yaw=yaw)
        assert {*inputs_of(found["std"])} == {"count", mean}
        assert {*inputs_of(found["time"])} == {"count", mean, changes}


def test_a_boat_points_where_it_goes_unless_a_track_says_it() -> None:
    assert boat.heading(boat_with(track_count=0)) == 70.0
    assert boat.heading(boat_with(track_count=0, boat_speed_m_s=0.0)) == 0.0
    assert boat.heading(boat_with()) == 0.0
