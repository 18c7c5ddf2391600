"""The receiver `long_baseline`: against a second implementation, and in cases by hand."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import harness
import numpy as np
import pytest
from harness import NS, Array, Dive, dive, hear, model, simultaneous, straight
from long_baseline_reference import FIRST, Learning, Reference, X
from sblcosim.models.receiver import bank, field
from stepper import Stepper

BOTTOM = np.array([[40.0, 40.0, 14.0], [-40.0, 40.0, 12.5], [-40.0, -40.0, 13.0],
                   [40.0, -40.0, 14.5]])
LINE = straight((-20.0, 5.0, 6.0), (0.5, -0.2, 0.02))
ROUGH = {
    "clock_std": 0.3, "sound_speed_std": 0.004, "depth_bias_std": 0.1, "beacon_error_std": 0.5,
    "beacon_vertical_error_std": 0.9, "beacon_error_time": 200.0, "beacon_noise_std": 0.05,
    "beacon_vertical_noise_std": 0.2, "clock_walk_psd": 1e-4, "range_std": 0.05,
    "depth_std": 0.05, "prior_velocity_std": 0.7, "acceleration_psd": 0.01,
}
PRIOR = {"initialisation": 2, "prior_position": (-19.0, 4.0, 6.0), "prior_position_std": 1.5}
NOISY = {"range_std": 0.05, "loss_probability": 0.2}
LATE = {"outlier_probability": 0.1, "outlier_mean": 4.0}


def covariance(found: Dive) -> Array:
    n = field.states(4)
    P = np.zeros((n, n))
    P[np.triu_indices(n)] = found.receiver.state("covariance")[0]
    return P + np.triu(P, 1).T


def follow(
    parameters: Mapping[str, Any], path: Any = LINE, tolerance: float = 2e-6, **settings: Any
) -> Reference:
    """A dive by both, compared at each estimate."""
    settings = {"steps": 160, "sampling_time": 0.5, "depth_std": 0.05,
                "beacons": lambda t: BOTTOM, "acoustics": NOISY, **settings}
    found = dive("long_baseline", path, parameters={**ROUGH, **parameters}, **settings)
    reference = Reference(found.receiver.p)
    harness.follow(found, reference, tolerance)
    np.testing.assert_allclose(covariance(found), reference.P, rtol=tolerance, atol=tolerance)
    assert found.receiver.y["restart_count"] == reference.restarts
    return reference


@pytest.mark.parametrize("ratio", [1, 4])
@pytest.mark.parametrize("start", [{}, PRIOR], ids=["first receptions", "prior"])
def test_it_equals_full_matrices(ratio: int, start: Mapping[str, Any]) -> None:
    follow(start, ratio=ratio, steps=120 * (1 + ratio // 4))


@pytest.mark.parametrize("seed", [1, 2])
def test_late_ranges_are_weighed_as_with_the_exact_densities(seed: int) -> None:
    follow(LATE, acoustics=NOISY | LATE, seed=seed)


def test_beacons_that_all_ping_at_once() -> None:
    follow({**LATE, **PRIOR}, acoustics=NOISY | {"schedule": 2}, steps=60)


@pytest.mark.parametrize("clock_std", [4.9, 5.1, 27.0, 300.0])
def test_a_clock_that_is_hardly_known(clock_std: float) -> None:
    follow({"clock_std": clock_std}, steps=60)


def test_beacons_whose_reports_wander() -> None:
    """Buoys: each reading has noise of its own, more of it up and down."""
    rng = np.random.default_rng(5)
    noise = rng.normal(size=(1000, 4, 3)) * [0.05, 0.05, 0.2]
    follow({}, reported=lambda t: BOTTOM + noise[round(2 * t)])


def test_a_beacon_that_has_moved_is_known_where_it_is_now() -> None:
    """Towed by 15 m: derivatives are no longer about where it was said to be at first."""
    def at(t: float) -> Array:
        return BOTTOM + (t > 40.0) * np.array([[15.0, -4.0, 0.0], [0, 0, 0], [0, 0, 0], [0, 0, 0]])

    reference = follow({}, beacons=at)
    np.testing.assert_array_equal(reference.anchor[0], at(60.0)[0])
    np.testing.assert_array_equal(reference.anchor[1], BOTTOM[1])


@pytest.mark.parametrize(("metres", "moved"), [(5.0, False), (6.0, True)])
def test_moved_means_by_more_than_a_tenth_of_the_distance(metres: float, moved: bool) -> None:
    """At 40 s the diver is 55 m from the third beacon, and it is heard again within seconds."""
    step = np.zeros((4, 3))
    step[2, 0] = -metres
    reference = follow({}, beacons=lambda t: BOTTOM + (t > 40.0) * step)
    np.testing.assert_array_equal(reference.anchor[2], (BOTTOM + moved * step)[2])


def test_a_small_drift_leaves_the_derivatives_where_they_were() -> None:
    reference = follow({}, beacons=lambda t: BOTTOM + 0.01 * t)
    assert all(np.linalg.norm(a - b) < 0.1 for a, b in
               zip(reference.anchor.values(), BOTTOM[list(reference.anchor)], strict=True))


@pytest.mark.parametrize("off", [(25.0, 5.0), (-12.0, 30.0)])
def test_a_wrong_start_ends_in_the_same_restart(off: tuple[float, float]) -> None:
    wrong = {**PRIOR, "prior_position": (-20.0 + off[0], 5.0 + off[1], 6.0)}
    reference = follow({**wrong, **LATE}, steps=240)

    assert reference.restarts == 1


def test_a_diver_who_turns() -> None:
    reference = follow({**LATE, "acceleration_psd": 1e-4, **PRIOR}, corner, steps=140)
    assert reference.turns


# --- Motion that is learned ----------------------------------------------------------------------


def learn(
    parameters: Mapping[str, Any], path: Any = LINE, tolerance: float = 2e-6, **settings: Any
) -> Learning:
    """A dive by both, compared at each estimate."""
    settings = {"steps": 160, "sampling_time": 0.5, "depth_std": 0.05,
                "beacons": lambda t: BOTTOM, "acoustics": NOISY, **settings}
    found = dive("long_baseline", path,
                 parameters={**ROUGH, **parameters, "acceleration_psd": -1.0}, **settings)
    reference = Learning(
        found.receiver.p, bank.PSDS, bank.CHANCES, bank.MEMORY, bank.EVERY)
    harness.follow(found, reference, tolerance)
    for name, value in reference.output().items():
        np.testing.assert_allclose(
            found.receiver.y[name], value, rtol=tolerance, atol=10 * tolerance, err_msg=name
        )
    return reference


@pytest.mark.parametrize("start", [{}, PRIOR], ids=["first receptions", "prior"])
@pytest.mark.parametrize("late", [{}, LATE], ids=["punctual", "late"])
def test_learned_motion_is_an_interacting_multiple_model(
    start: Mapping[str, Any], late: Mapping[str, Any]
) -> None:
    reference = learn({**start, **late}, acoustics=NOISY | late)
    assert reference.epoch > 2 * bank.EVERY
    assert reference.restarts == 0


def test_learned_motion_with_beacons_that_all_ping_at_once_and_one_that_is_towed() -> None:
    def at(t: float) -> Array:
        return BOTTOM + (t > 20.0) * np.array([[15.0, -4.0, 0.0], [0, 0, 0], [0, 0, 0], [0, 0, 0]])

    learn(LATE, acoustics=NOISY | {"schedule": 2}, steps=80, beacons=at)


def test_learned_motion_restarts_as_one() -> None:
    wrong = {**PRIOR, **LATE, "prior_position": (25.0, 45.0, 6.0)}
    assert learn(wrong, steps=240).restarts >= 1


def corner(t: float) -> tuple[Array, Array]:
    """A diver who turns at 30 s."""
    start, there, then = np.array([[-20.0, 5.0, 6.0], [1.0, 0, 0], [0, 1.0, 0]])
    if t < 30.0:
        return start + there * t, there
    return start + there * 30.0 + then * (t - 30.0), then


def test_a_turn_is_learned_motion_and_no_reason_to_begin_again() -> None:
    """Weighed before the range, the filters would hold its short ones against all of them."""
    reference = learn({**LATE, **PRIOR, "range_std": 0.02}, corner, steps=140,
                      acoustics={"range_std": 0.02})
    assert reference.restarts == 0


# --- The other side -----------------------------------------------------------------------------

ROW = np.array([[50.0, 0, 14.0], [15.0, 4.0, 12.5], [-15.0, -2.0, 13.0], [-50.0, 1.0, 14.5]])
"""Beacons nearly on a line."""


def along(off: float, across: float) -> Any:
    """A diver next to the line, who leaves it."""
    return straight((-10.0, off, 6.0), (0.3, across, 0.02))


@pytest.mark.parametrize("way", [follow, learn], ids=["given", "learned"])
@pytest.mark.parametrize("schedule", [1, 2], ids=["round robin", "simultaneous"])
def test_a_diver_on_the_other_side_is_found_there(way: Any, schedule: int) -> None:
    """A start on the wrong side of the line, believed to a metre."""
    wrong = {**PRIOR, **LATE, "prior_position": (-10.0, 6.0, 6.0), "prior_position_std": 1.0}
    reference = way(wrong, along(-6.0, -0.2), beacons=lambda t: ROW, steps=240,
                    tolerance=1e-3, acoustics=NOISY | {"schedule": schedule})
    assert reference.sides == 1


@pytest.mark.parametrize("way", [follow, learn], ids=["given", "learned"])
def test_what_is_mirrored_is_carried_along_from_the_start(way: Any) -> None:
    """On a line but for their errors, the beacons hardly tell the sides apart."""
    straight_row = ROW * [1.0, 0.1, 1.0]
    found = way({}, along(12.0, 0.1), beacons=lambda t: straight_row, steps=60, tolerance=1e-4)
    assert found.there is not None
    share = 1 / (1 + np.exp(-found.lead))
    assert 1e-4 < share < 1 - 1e-4


# --- By hand -------------------------------------------------------------------------------------


def test_the_covariance_of_a_fix_is_that_of_its_ranges() -> None:
    """Right below the middle of a square: every range weighs alike, north and east are apart."""
    known = {"range_std": 0.2, "depth_std": 0.1, "clock_std": 0.3, "beacon_error_std": 0.4,
             "beacon_noise_std": 0.5, "sound_speed_std": 0.01, "depth_bias_std": 0.7,
             "beacon_vertical_error_std": 9.0, "beacon_vertical_noise_std": 9.0,
             "prior_velocity_std": 0.6}
    square = np.array([[30.0, 0, 0], [0, 30.0, 0], [-30.0, 0, 0], [0, -30.0, 0]])
    box = simultaneous("long_baseline", np.array([0.0, 0.0, 40.0]), known, beacons=square)
    P = np.zeros((field.states(4),) * 2)
    P[np.triu_indices(len(P))] = box.state("covariance")[0]
    far = 50.0
    R = 0.2**2 + 0.4**2 + 0.5**2 + (0.01 * far) ** 2
    # Two beacons are along each axis, at an angle whose cosine is 30/50, and the diver is within 50
    # m of their middle. Down has 40/50 of the mean of all, which has the clock's error.
    along = 1 / (2 * 0.6**2 / R + 1 / far**2)
    assert P[X, X] == pytest.approx([
        along, along, 1 / (0.8**2 / (R / 4 + 0.3**2) + 1 / (0.1**2 + 0.7**2)),
    ], rel=1e-6)
    assert P[X[0], X[1]] == pytest.approx(0.0, abs=1e-9)
    own = [0.4**2, 0.4**2, 9.0**2] * 4
    assert np.diag(P)[FIRST:] == pytest.approx(own)
    assert np.diag(P)[[1, 3, 5]] == pytest.approx([0.36] * 3)


def test_noise_of_a_beacon_counts_along_the_range() -> None:
    """Level ranges have the horizontal noise only, ranges from right above the vertical one."""
    p = SimpleNamespace(beacons=4, range_std=0.1, beacon_noise_std=0.3,
                        beacon_vertical_noise_std=0.7)
    which = [1, 0, 0, 0]
    for place, expected in (
        ((10.0, 0, 0), 0.3**2), ((0, -10.0, 0), 0.3**2), ((0, 0, 10.0), 0.7**2),
        ((6.0, 0, 8.0), 0.36 * 0.3**2 + 0.64 * 0.7**2),
    ):
        x = np.zeros(field.states(4))
        x[list(field.POSITION)] = place
        found = field.range_(np, p, x, [0.0, 0.0, 0.0], which)
        assert found.variance == pytest.approx(0.1**2 + expected), place


@pytest.mark.parametrize("silent", range(4))
def test_what_stands_on_the_inputs_of_a_beacon_that_is_never_heard_changes_nothing(
    silent: int,
) -> None:
    found = []
    for given in (0.0, 5e3):
        box = Stepper(model("long_baseline"), {"update_interval": 0.5, **ROUGH})
        box.step(0, NS // 2)
        for n in range(1, 13):
            hear(box, LINE(0.5 * n)[0], 0.5 * n, beacons=BOTTOM)
            count, ranges = box.u["reception_count"].copy(), box.u["range"].copy()
            count[silent], ranges[silent] = 0, given
            box.set(reception_count=count, range=ranges)
            box.step(n * NS // 2, NS // 2)
        found.append(box.y)
    assert found[0]["update_count"] > 5
    for name, value in found[0].items():
        np.testing.assert_array_equal(found[1][name], value, name)
