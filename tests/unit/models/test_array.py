"""What the arrivals of a ping share: in the channel, and in the filter `array`."""

from __future__ import annotations

from math import sqrt
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from harness import CROSS, NS
from numpy.typing import NDArray
from sblcosim.models.loading import load
from sblcosim.models.receiver import arc, array, ping, pose, surroundings
from sblcosim.models.receiver.surroundings import Pose
from stepper import Stepper, no_noise, numpy_noise

SLOT = NS // 2
Floats = NDArray[np.float64]


# --- The channel ---------------------------------------------------------------------------------


def pinged(noise: Any = no_noise, **parameters: Any) -> Stepper:
    given = {"range_std": 0.0, "ranging": 3, "sampling_time": 0.5}
    stepper = Stepper(load("acoustics"), {**given, **parameters}, noise=noise)
    stepper.set(target_position=[9.0, -4.0, 2.0], beacon_position=CROSS,
                reported_beacon_position=CROSS)
    stepper.step(0, SLOT)
    return stepper


def test_common_and_own_parts_of_arrivals_have_their_sizes() -> None:
    """Within four standard errors, over 3,000 pings; the common part is new in each."""
    ticks, common, own = 3000, 0.3, 0.01
    stepper = pinged(numpy_noise(2), range_common_std=common, range_std=own)
    errors = np.zeros((ticks, 4))
    for k in range(1, ticks + 1):
        y = stepper.step(k * SLOT, SLOT)
        errors[k - 1] = y["range"] - y["true_range"]
    error = 4 / sqrt(2 * ticks)
    shared = errors.mean(1)
    assert shared.std() == pytest.approx(np.hypot(common, own / 2), rel=error)
    left = (errors - shared[:, None]) * sqrt(4 / 3)
    assert left.std() == pytest.approx(own, rel=error)
    assert abs(np.corrcoef(shared[1:], shared[:-1])[0, 1]) < 4 / sqrt(ticks)


@pytest.mark.parametrize("shared", [True, False])
def test_arrivals_are_lost_and_late_together_or_each_alone(shared: bool) -> None:
    ticks = 600
    stepper = pinged(numpy_noise(3), arrivals_shared=shared, loss_probability=0.4,
                     loss_burst_length=3.0, outlier_probability=0.3, outlier_mean=2.0,
                     bottom_echo_probability=0.3, water_depth=9.0)
    heard, late = np.zeros((ticks, 4)), np.zeros((ticks, 4))
    before = np.zeros(4)
    for k in range(1, ticks + 1):
        y = stepper.step(k * SLOT, SLOT)
        heard[k - 1] = y["reception_count"] - before
        late[k - 1] = (y["range"] - y["true_range"]) * heard[k - 1]
        before = np.array(y["reception_count"])
    assert 0 < heard.mean() < 1
    alike = (heard == heard[:, :1]).all()
    assert alike == shared
    there = heard.all(1)
    assert (late[there] > 0.1).any()
    # Echoes differ by the geometry, outliers not at all.
    some = late[there] > 0.1
    assert bool((some == some[:, :1]).all()) == shared


def test_without_a_common_clock_ranges_count_from_the_middle_of_the_beacons() -> None:
    """The differences are the same, and clock and common errors are not in them."""
    exact = pinged().step(SLOT, SLOT)
    untimed = pinged(numpy_noise(4), common_clock=False, clock_offset=1.0, clock_drift=1e-3,
                     range_common_std=5.0).step(SLOT, SLOT)
    assert untimed["range"] - untimed["range"][0] == pytest.approx(
        exact["range"] - exact["range"][0], abs=1e-9
    )
    late = 1500.0 * (untimed["arrival_epoch"] - untimed["range_epoch"])
    assert untimed["range"] == pytest.approx(late, abs=1e-9)


# --- The filter ----------------------------------------------------------------------------------

N = surroundings.STATES + ping.STATES
ARMS = 0.05 * np.array([[1, 0, 10], [0, 1, 10], [-1, 0, 10], [0, -1, 10.0]])


def parameters(**changed: float) -> SimpleNamespace:
    return SimpleNamespace(**{
        "beacons": 4, "beacon_offset": ca.DM(ARMS), "range_std": 5e-4, "range_common_std": 0.1,
        "common_clock": 1, "arrivals_shared": 1, "outlier_probability": 1e-9, "outlier_mean": 1.0,
        "assumed_sound_speed": 1500.0, "gps_vertical_std": 0.2, "tilt_std": 0.05,
        "imu_tilt_noise_std": 0.01, "imu_tilt_std": 0.01, "imu_tilt_error_std": 0.01,
        **changed,
    })


def state(seed: int) -> tuple[Floats, Floats]:
    """A state 40 m away, and a covariance in which everything is known well and correlated."""
    rng = np.random.default_rng(seed)
    mean = np.zeros(N)
    mean[:3], mean[12] = [35.0, 20.0, 12.0], 0.3
    std = np.full(N, 1e-3)
    std[:3], std[6:8], std[12] = 0.05, 0.02, 1e-3
    std[PING.common], std[PING.sunk] = 0.1, 0.2
    mixed = np.eye(N) + 0.1 * rng.standard_normal((N, N))
    fresh = [PING.common, PING.sunk, *PING.tilts]
    for i in fresh:  # drawn anew: nothing in common with the past
        mixed[i, :] = mixed[:, i] = 0
        mixed[i, i] = 1
    P = mixed @ mixed.T
    scale = std / np.sqrt(np.diag(P))
    return mean, P * np.outer(scale, scale)


PING = array.PING


def packet() -> pose.Packet:
    zero = ca.DM.zeros(2)
    return pose.Packet(
        is_own=0, place=zero, body=ca.DM.zeros(3), arm=ca.DM.zeros(3), heading=0.3,
        pose=Pose(down=0.1, roll=0.02, pitch=-0.03, tilt_variance=1e-4), platform=zero,
        first_heading=0.3, heading_variance=0.0, complete=1,
    )


def geometry(x: Floats, said: Pose, arm: Floats) -> float:
    """The range to a beacon from rotations, of the diver when the ping left it."""
    angles = (said.roll + x[PING.tilts[0]] + x[PING.errors[0]],
              said.pitch + x[PING.tilts[1]] + x[PING.errors[1]], x[surroundings.HEADING])
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(a), np.sin(a)) for a in angles)
    R = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]) @ np.array(
        [[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]]) @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    down = said.down - x[surroundings.VERTICAL_ERROR] - x[PING.sunk]
    platform = np.array([*x[list(surroundings.PLATFORM)], down])
    reported = np.array([*x[list(surroundings.PLATFORM)], said.down])
    travel = np.linalg.norm(x[:3] - reported) / 1500.0
    left = x[:3] - travel * x[3:6]
    length = float(np.linalg.norm(left - platform - R @ arm))
    return float((1 + x[surroundings.SPEED]) * length + x[surroundings.CLOCK] + x[PING.common])


@pytest.mark.parametrize("seed", range(6))
def test_an_arrival_is_the_geometry_and_its_row_the_derivative_of_it(seed: int) -> None:
    """By every state, to the first order; the travel time is held."""
    rng = np.random.default_rng(seed)
    x = rng.normal(0, 0.1, N)
    x[:3] += rng.uniform([-40, -40, 5], [40, 40, 30])
    x[3:6] += rng.normal(0, 1.0, 3)
    x[surroundings.HEADING] += rng.uniform(-3, 3)
    x[surroundings.SPEED] *= 0.1
    arm = rng.normal(0, 2.0, 3)
    said = Pose(down=0.3, roll=0.05, pitch=-0.08, tilt_variance=1e-4)
    row = PING.range_(ca, parameters(), [ca.SX(v) for v in x], said, arm)
    assert float(ca.evalf(ca.SX(row.value))) == pytest.approx(geometry(x, said, arm), abs=1e-9)
    step = 1e-6
    for i in range(N):
        e = np.eye(N)[i] * step
        slope = (geometry(x + e, said, arm) - geometry(x - e, said, arm)) / (2 * step)
        told = float(ca.evalf(ca.SX(row.row.get(i, 0.0))))
        scale = max(abs(slope), 1e-3)
        # The travel time follows the diver's place, by a speed over that of sound.
        assert told == pytest.approx(slope, abs=3e-3 * scale + 3e-3 * (i in (0, 1, 2, 6, 7))), i
    of_each = float(ca.evalf(ca.SX(row.variance)))
    assert of_each == pytest.approx(5e-4**2)  # all other noise is in the states


@pytest.mark.parametrize(("excess", "short"), [(3.0, 0.0), (-3.0, 1.0)])
def test_a_ping_is_late_or_too_short_as_a_whole(excess: float, short: float) -> None:
    p = parameters(outlier_probability=0.1, outlier_mean=2.0)
    mean, P = state(2)
    h, _, _ = rows(p, mean, P)
    x = SimpleNamespace(arrivals=ca.SX(np.column_stack([np.ones(4), h + excess])))
    heard = array.pinged(p, x, ca.SX(mean), ca.SX(P), packet(), 1)[2]
    assert float(ca.evalf(ca.SX(heard.share))) == pytest.approx(0.0, abs=1e-6)
    assert float(ca.evalf(ca.SX(heard.short))) == pytest.approx(short, abs=1e-6)


def updated(p: Any, z: Floats, there: Floats, seed: int) -> tuple[Floats, Floats]:
    mean, P = state(seed)
    x = SimpleNamespace(arrivals=ca.SX(np.column_stack([there, z])))
    found = array.pinged(p, x, ca.SX(mean), ca.SX(P), packet(), 1)
    return tuple(np.array(ca.evalf(it)) for it in found[:2])  # type: ignore[return-value]


def rows(p: Any, mean: Floats, P: Floats) -> tuple[Floats, Floats, Floats]:
    """Expected ranges, their rows, and own variances, as the filter bends them."""
    seen = arc.about(ca.SX(mean), ca.SX(P))
    h, H, R = np.zeros(4), np.zeros((4, N)), np.zeros(4)
    for i, arm in enumerate(ARMS):
        row = arc.bent(seen, PING.range_(ca, p, [ca.SX(v) for v in mean], packet().pose, arm))
        h[i], R[i] = float(ca.evalf(ca.SX(row.value))), float(ca.evalf(ca.SX(row.variance)))
        for k, value in row.row.items():
            H[i, k] = float(ca.evalf(ca.SX(value)))
    return h, H, R


@pytest.mark.parametrize("there", [[1, 1, 1, 1], [1, 0, 1, 1], [0, 0, 1, 0]])
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("clock", [1, 0])
def test_a_ping_is_one_update_with_all_its_arrivals(
    there: list[int], seed: int, clock: int
) -> None:
    """In whatever order, it equals the Kalman update with all rows at once, then the arc.

    Without a common clock, that with a prior of c of 100 m.
    """
    p = parameters(common_clock=clock)
    mean, P = state(seed)
    wide = P.copy()
    if not clock:
        wide[PING.common, PING.common] = 1e4
    h, H, R = rows(p, mean, P)
    rng = np.random.default_rng(seed)
    z = h + 0.05 * rng.standard_normal() + 5e-4 * rng.standard_normal(4)
    used = np.array(there, bool)
    Hu = H[used]
    S = Hu @ wide @ Hu.T + np.diag(R[used])
    K = np.linalg.solve(S, Hu @ wide).T
    expected_P = wide - K @ Hu @ wide
    expected = mean + K @ (z - h)[used]
    got, got_P = updated(p, np.where(used, z, 0), np.array(there, float), seed)
    others = [i for i in range(N) if clock or i != PING.common]
    # The arc and its turn are of the second order of corrections of some cm at 40 m.
    np.testing.assert_allclose(got.ravel()[others], expected[others], atol=2e-4)
    scale = np.sqrt(np.diag(P))[others]
    np.testing.assert_allclose(
        got_P[np.ix_(others, others)] / np.outer(scale, scale),
        expected_P[np.ix_(others, others)] / np.outer(scale, scale), atol=5e-3,
    )


def test_the_order_of_beacons_does_not_matter() -> None:
    p = parameters()
    mean, P = state(1)
    h, _, _ = rows(p, mean, P)
    z = h + np.array([0.02, 0.0201, 0.0199, 0.02])
    one, _ = updated(p, z, np.ones(4), 1)
    turned = [2, 3, 0, 1]
    other = parameters(beacon_offset=ca.DM(ARMS[turned]))
    two, _ = updated(other, z[turned], np.ones(4), 1)
    np.testing.assert_allclose(one, two, atol=1e-9)


@pytest.mark.parametrize("late", [[0, 3.0, 0, 0], [3.0, 3.0, 3.0, 3.0], [3.0, 0, 4.0, 0]])
def test_what_is_late_beside_the_earliest_or_as_a_whole_says_nothing(late: list[float]) -> None:
    """The position stays that of the punctual arrivals, or where it was."""
    p = parameters(outlier_probability=0.1, outlier_mean=2.0)
    mean, P = state(2)
    h, _, _ = rows(p, mean, P)
    got, _ = updated(p, h + late, np.ones(4), 2)
    np.testing.assert_allclose(got[:3, 0], mean[:3], atol=2e-3)


def test_a_tilt_turns_the_first_fix_as_it_turns_the_array() -> None:
    """The derivative of the fix by a tilt, against one that is solved with tilted beacons."""
    heading, y = 0.4, np.array([30.0, -12.0])
    deep = 9.0
    shifts = PING.swung(ca.DM(y), deep, heading, ca)
    R = surroundings.arm_of
    for state_, angles in ((PING.tilts[0], (1e-5, 0.0)), (PING.tilts[1], (0.0, 1e-5))):
        x = [0.0] * surroundings.STATES
        x[surroundings.HEADING] = heading
        spread = [np.array(R(np, x, Pose(0.0, *tilt, 0.0), arm * 0.1), float)
                  for tilt in ((0.0, 0.0), angles) for arm in np.eye(3)]
        flat, tilted = np.array(spread[:3]).T / 0.1, np.array(spread[3:]).T / 0.1
        # Where the diver is if the array is tilted and sees it at the same angles in its frame.
        moved = tilted @ flat.T @ np.array([*y, deep]) - [*y, deep]
        across = np.array([-y[1], y[0]]) / np.linalg.norm(y)
        expected = (moved[:2] @ across) * across / 1e-5
        np.testing.assert_allclose(np.array(shifts[state_]).ravel(), expected, atol=1e-3)
