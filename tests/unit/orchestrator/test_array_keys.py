"""Arrays: what follows from their keys for receivers, the closed form, bounds and the verdict."""

from __future__ import annotations

import warnings
from typing import Any

import casadi as ca
import numpy as np
import pytest
import sblcosim
from numpy.typing import NDArray
from sblcosim.errors import NoEffectWarning
from sblcosim.limits import closed_form, hdop, places, run
from sblcosim.limits.parameters import conditions, model_of, parameters
from sblcosim.models.receiver.bound import ARRAY
from sblcosim.models.receiver.receivers.array import COMPONENT
from sblcosim.scenario import effects
from sblcosim.scenario.doubts import doubts
from sblcosim.scenario.scenario import Scenario, load

A = "acoustics."
BOAT = "usbl-boat"
Floats = NDArray[np.float64]


def boat(**keys: Any) -> Scenario:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NoEffectWarning)
        return load(BOAT, {k.replace("__", "."): v for k, v in keys.items()})


def test_who_does_not_know_the_common_part_has_it_as_noise() -> None:
    told = boat(acoustics__range_std_m=0.03, acoustics__range_common_std_m=0.04)
    knows = told.assumptions({"range_common_std", "clock_std", "beacon_offset"})
    assert knows["range_std_m"] == 0.03
    assert knows["range_common_std_m"] == 0.04
    assert told.assumptions()["range_std_m"] == pytest.approx(0.05)
    one_way = boat(acoustics__range_std_m=0.03, acoustics__ranging="one_way")
    assert one_way.assumptions()["range_std_m"] == 0.03
    assert one_way.assumptions()["range_common_std_m"] == 0.0


def test_lasting_tilts_are_those_of_the_frame_and_the_share_of_the_imu_that_is_trusted() -> None:
    still = boat(platform__beaufort=0, platform__misalignment_tilt_std_deg=0.3)
    assert still.assumptions()["imu_tilt_error_std_deg"] == pytest.approx(0.3)
    rough = boat(platform__motion="sines", platform__roll_amplitude_deg=60.0,
                 platform__pitch_amplitude_deg=60.0, platform__misalignment_tilt_std_deg=0.3,
                 platform__imu_tilt_turn_on_std_deg=0.4)
    assert rough.assumptions()["imu_tilt_error_std_deg"] == pytest.approx(0.5, rel=1e-3)


@pytest.mark.parametrize("arm", [0.02, 0.05, 3.0])
def test_one_ping_tells_the_bearing_by_noise_over_arms(arm: float) -> None:
    """σ/√(½ Σ|b − b̄|²) = σ/(b √2) for a cross; the common part is in the distance alone."""
    scenario = boat(platform__arm_length_m=arm)
    found = closed_form([40.0, 0.0, 0.0], conditions(scenario, 0.01))
    assert found.fix_cross / 40.0 == pytest.approx(0.001 / (arm * np.sqrt(2)))
    assert found.fix_radial == pytest.approx(np.hypot(0.001 / 2, 0.1), rel=2e-2)


def batch(scenario: Scenario, pings: int, place: Floats, q: float) -> Floats:
    """Covariance of the diver after some pings, from all measurements at once.

    The errors that arrivals share are in their joint covariance, and no states. The rows are
    numerical derivatives of the ranges, worked out from rotations.
    """
    p = parameters(scenario, q, COMPONENT)
    arms = np.reshape(p.beacon_offset, (-1, 3))
    dt = scenario.acoustics.sampling_time_s
    n = pings
    # Unknowns: position and velocity at each ping; heading error, two tilts, clock, speed, sink.
    size, consts = 6 * n, 6

    def rotation(a: Floats) -> Floats:
        (cr, sr), (cp, sp), (cy, sy) = ((np.cos(v), np.sin(v)) for v in a)
        return np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]) @ np.array(
            [[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]]) @ np.array([[1, 0, 0], [0, cr, -sr],
                                                                [0, sr, cr]])

    def ranges(x: Floats, v: Floats, c: Floats) -> Floats:
        beacons = arms @ rotation(np.array([c[1], c[2], c[0]])).T + [0.0, 0.0, -c[5]]
        speed = scenario.acoustics.assumed_sound_speed_m_s
        left = x - v * np.linalg.norm(x) / speed
        return (1 + c[4]) * np.linalg.norm(left - beacons, axis=1) + c[3]

    J = np.zeros((size + consts, size + consts))
    stds = [p.imu_heading_error_std, p.imu_tilt_error_std, p.imu_tilt_error_std, p.clock_std,
            p.sound_speed_std, p.gps_vertical_error_std]
    J[size:, size:] = np.diag([1 / max(s, 1e-9) ** 2 for s in stds])
    J[:6, :6] += np.diag([1 / p.prior_position_std**2] * 3 + [1 / p.prior_velocity_std**2] * 3)
    for k in range(n):
        at = slice(6 * k, 6 * k + 6)
        if k:
            Q = np.kron([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]], q * np.eye(3))
            F = np.kron([[1, dt], [0, 1]], np.eye(3))
            T = np.zeros((6, size + consts))
            T[:, at], T[:, 6 * k - 6 : 6 * k] = np.eye(6), -F
            J += T.T @ np.linalg.solve(Q, T)
        H = np.zeros((len(arms) + 1, size + consts))
        h0 = ranges(place, np.zeros(3), np.zeros(6))
        eps = 1e-6
        for i in range(3):
            e = np.eye(3)[i] * eps
            H[:-1, 6 * k + i] = (ranges(place + e, np.zeros(3), np.zeros(6)) - h0) / eps
            H[:-1, 6 * k + 3 + i] = (ranges(place, e, np.zeros(6)) - h0) / eps
        for i in range(6):
            e = np.eye(6)[i] * eps
            H[:-1, size + i] = (ranges(place, np.zeros(3), e) - h0) / eps
        # A heading error of the compass turns the beacons the other way than it says.
        H[:-1, size] *= -1
        H[-1, 6 * k + 2] = 1
        u = H[:-1, 6 * k : 6 * k + 3]
        white = np.diag([p.range_std**2] * len(arms))
        white = white + p.range_common_std**2 + p.gps_vertical_std**2 * np.outer(u[:, 2], u[:, 2])
        own = p.tilt_std**2
        share = own / (own + p.imu_tilt_noise_std**2 + 1e-12) * p.imu_tilt_noise_std**2
        for i in (1, 2):
            white = white + share * np.outer(H[:-1, size + i], H[:-1, size + i])
        noise = np.zeros((len(arms) + 1,) * 2)
        noise[:-1, :-1], noise[-1, -1] = white, p.depth_std**2
        J += H.T @ np.linalg.solve(noise, H)
    P = np.linalg.inv(J)
    last = slice(6 * n - 6, 6 * n - 3)
    found: Floats = P[last, last]
    return found


@pytest.mark.parametrize("keys", [
    {}, {"acoustics.range_common_std_m": 0.0}, {"acoustics.range_std_m": 0.01},
    {"platform.misalignment_tilt_std_deg": 3.0}, {"platform.gps_vertical_std_m": 0.0},
    {"platform.arm_length_m": 1.0}, {"platform.imu_tilt_std_deg": 2.0},
], ids=str)
def test_the_bound_is_that_of_all_measurements_at_once(keys: dict[str, Any]) -> None:
    """Computed a second way: errors that arrivals share are correlations there, not states."""
    place, q, pings = np.array([30.0, 14.0, 9.0]), 0.01, 6
    scenario = boat(**{
        "platform.motion": "sines", "platform.roll_amplitude_deg": 5.0,
        "platform.pitch_amplitude_deg": 5.0, "platform.yaw_amplitude_deg": 0.0,
        "platform.heave_amplitude_m": 0.0, "platform.surge_amplitude_m": 0.0,
        "platform.sway_amplitude_m": 0.0, "platform.watch_circle_m": 0.0,
        "platform.gps_horizontal_std_m": 0.0, "platform.gps_horizontal_markov_std_m": 0.0,
        "platform.gps_horizontal_bias_std_m": 0.0, "platform.gps_vertical_markov_std_m": 0.0,
        "platform.gps_vertical_bias_std_m": 0.0, "platform.imu_heading_std_deg": 0.0,
        "target.depth_bias_std_m": 0.0, "acoustics.outlier_probability": 0.0,
        "acoustics.clock_drift_std_s_s": 0.0, "acoustics.clock_offset_std_s": 1e-4,
        "receiver.initialisation": "prior", "receiver.prior_position_m": [30.0, 14.0, 9.0],
        "receiver.prior_position_std_m": 3.0, "receiver.prior_velocity_std_m_s": 0.3, **keys,
    })
    model = model_of(scenario, q)
    n = pings
    epochs = places.Epochs(
        step_s=np.full(n, 1.0) - np.eye(n)[0], readings=np.ones(n), heard=np.ones((n, 4)),
        packets=np.ones(n), platform=np.zeros(3), attitude=np.zeros(3),
        beacons=np.reshape(model.parameters.beacon_offset, (-1, 3)),
    )
    found, _ = places.recursion.covariances(
        model, epochs, np.broadcast_to(place, (n, 1, 3)), np.array([q]))
    expected = batch(scenario, pings, place, q)
    np.testing.assert_allclose(
        np.sqrt(np.diag(found[-1, 0])), np.sqrt(np.diag(expected)), rtol=0.02
    )


def test_pings_of_an_epoch_average_out_what_each_has_of_its_own() -> None:
    """One epoch with 16 pings is as good as a common part of a quarter."""
    many, few = (
        boat(acoustics__range_common_std_m=std, acoustics__outlier_probability=0.0)
        for std in (0.4, 0.1)
    )
    for scenario, pings in ((many, 16.0), (few, 1.0)):
        p = model_of(scenario, 0.01).parameters
        p.pings = pings
        _, noise = ARRAY.transition(np_like(), p, 1.0)
        common = ARRAY.states - 6
        assert noise[common, common] == pytest.approx(0.01)


def np_like() -> Any:
    class Numbers:
        exp, sqrt, fmax = staticmethod(np.exp), staticmethod(np.sqrt), staticmethod(np.fmax)

    return Numbers


def test_on_a_map_it_agrees_with_the_run(recwarn: Any) -> None:
    scenario = boat(**{
        "platform.motion": "sines", "acoustics.loss_probability": 0.0,
        "target.trajectory": "circle", "target.radius_m": 40.0, "time.duration_s": 100.0,
        "platform.watch_circle_m": 0.0,
    })
    result = sblcosim.run(scenario, "array")
    of_run = run.reference(result.record, scenario, acceleration_psd=0.01)
    path = result.truth
    position = path.position[:: max(len(path.position) // 100, 1)]
    found = places.covariances(
        scenario, lambda t: position[[min(int(t), len(position) - 1)]], np.array([0.01]),
        (50.0, 100.0))
    late = of_run.epoch_ns > 50e9
    possible = np.sqrt(np.trace(of_run.relative[late], axis1=1, axis2=2).mean())
    mapped = np.sqrt(np.trace(found.relative[:, 0], axis1=1, axis2=2).mean())
    assert mapped == pytest.approx(possible, rel=0.1)


@pytest.mark.parametrize(("receiver", "keys", "says"), [
    ("coupled", {}, "try array"), ("fixed_lag", {}, "try array"), ("array", {}, None),
    ("array", {"acoustics.ranging": "one_way"}, "try coupled"),
    ("array", {"acoustics.ranging": "two_way"}, "try coupled"),
    ("array", {"acoustics.packet_content": "own_beacon"}, "nothing of the array's pose"),
    ("array", {"acoustics.packet_content": "all_beacons"}, None),
    ("coupled", {"acoustics.common_clock": False}, "only differences"),
    ("coupled", {"acoustics.range_common_std_m": 0.0}, None), ("ekf", {}, None),
])
def test_a_receiver_that_is_not_for_an_array_is_told(
    receiver: str, keys: dict[str, Any], says: str | None
) -> None:
    scenario = boat(**keys)
    told = [line for line in doubts(scenario, {receiver: receiver}) if "receiver" in line]
    assert ([says in line for line in told] == [True]) if says else not told


@pytest.mark.parametrize(("keys", "reason"), [
    ({f"{A}range_common_std_m": -0.1}, "at least 0"),
    ({f"{A}arrivals_shared": 2}, "true or false"),
    ({"platform.beacons": 2}, "at least 3"),
    ({"platform.beacon_m": [[0.0, 0.0, 1.0], [0.1, 0.0, 1.0]]}, "3"),
])
def test_nonsense_is_one_line(keys: dict[str, Any], reason: str) -> None:
    with pytest.raises(sblcosim.ConfigurationError) as error:
        load(BOAT, keys)
    assert reason in str(error.value)
    assert "\n" not in str(error.value)


def test_without_a_common_clock_clocks_have_no_effect_and_far_away_there_is_only_a_bearing(
) -> None:
    mine = boat(acoustics__common_clock=False)
    idle = {key for _, key in mine.idle()}
    assert {"clock_drift_std_s_s", "clock_sync_age_s", "range_common_std_m"} <= idle
    key = ("acoustics", "range_common_std_m")
    why = effects.idle(mine, effects.components_of(mine), [key])[key]
    assert "common_clock is false" in why
    keys = {f"{A}ranging": "inverted", f"{A}common_clock": False, "time.duration_s": 60.0,
            "target.trajectory": "circle", "time.sampling_time_s": 1.0, f"{A}range_std_m": 0.02}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        near, far = (
            sblcosim.run("harbour-square", "array", {
                **keys, "target.radius_m": r, "receiver.initialisation": "prior",
                "receiver.prior_position_m": [r, 0.0, 2.0],
                "receiver.prior_position_std_m": r / 4,
            }).limits for r in (8.0, 300.0)
        )
    assert near is not None
    assert far is not None
    assert near.verdict().accuracy
    assert not far.verdict().accuracy
    assert "only the bearing is known" in str(far.verdict())
    assert "common clock" in str(far.verdict())
    assert far.verdict().to_json()["absolute_rms_m"] is None


def test_without_a_common_clock_the_closed_form_has_no_distance_and_the_dilution_is_another(
) -> None:
    timed, untimed = (boat(acoustics__common_clock=it, platform__arm_length_m=3.0)
                      for it in (True, False))
    one, other = (closed_form([40.0, 0.0, 0.0], conditions(it, 0.01)) for it in (timed, untimed))
    assert np.isfinite(one.radial)
    assert np.isinf(other.radial)
    assert np.isinf(other.fix_radial)
    assert one.cross == other.cross


@pytest.mark.parametrize("timed", [True, False])
def test_a_map_says_why_there_is_no_accuracy_and_has_the_dilution_of_differences(
    timed: bool
) -> None:
    scenario = boat(acoustics__common_clock=timed, platform__arm_length_m=3.0,
                    acoustics__range_std_m=0.05)
    found = sblcosim.map_area(scenario, "190,210,-10,10", 15.0, cells=2, runs=2, duration_s=30.0)
    beacons = places.still_beacons(scenario)
    expected = hdop(found.grid.centres, beacons, unknown_clock=not timed).horizontal
    assert found.cells["hdop"].to_numpy() == pytest.approx(expected, rel=1e-6)
    said = found.text(verbose=True)
    assert ("without a common clock, only a bearing is known" in said) != timed
    assert "all around the platform" not in said


def test_symbols_of_both_uses_are_equal() -> None:
    """The bound's formulas on CasADi symbols and on numbers."""
    p = model_of(boat(), 0.01).parameters
    p.pings, p.speed, p.own_beacon, p.known_start = 1.0, 0.0, 0.0, 0.0
    symbols = ARRAY.transition(ca, p, ca.SX(0.7))
    numbers = ARRAY.transition(np_like(), p, 0.7)
    for one, other in zip(symbols, numbers, strict=True):
        assert one.keys() == other.keys()
        for key, value in one.items():
            assert float(ca.evalf(ca.SX(value))) == pytest.approx(float(other[key]), rel=1e-12)
