"""The receiver `coupled` as a whole: against a second implementation, and in odd circumstances."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import harness
import numpy as np
import pytest
from coupled_reference import PSI, SINK, Learning, Reference
from harness import CROSS, NS, Array, at_rest, hear, model, straight
from quick import one_in
from raft import LINE, Raft
from sblcosim.models import RECEIVERS
from sblcosim.models.receiver import bank, surroundings
from stepper import Stepper

HERE = np.array([12.0, -7.0, 5.0])
PRIOR = {"initialisation": 2, "prior_position": (16.5, 3.5, 5.2), "prior_velocity": (0.1, 0.0, 0.0),
         "prior_position_std": 0.8, "prior_velocity_std": 0.5}
NOISY = {"range_std": 0.1, "loss_probability": 0.25}
SINKING = {"gps_vertical_std": 0.2, "gps_vertical_error_std": 1.5, "gps_vertical_error_time": 60.0}
OUTLIERS = {"outlier_probability": 0.1, "outlier_mean": 3.0}


def covariance(box: Stepper) -> Array:
    """P of the filter."""
    P = np.zeros((surroundings.STATES,) * 2)
    P[np.triu_indices(len(P))] = box.state("covariance")[0]
    return P + np.triu(P, 1).T


def finite(box: Stepper) -> bool:
    """Whether all outputs and states are numbers."""
    return bool(np.isfinite(box.x).all()
                and all(np.isfinite(value).all() for value in box.y.values()))


# --- Against full matrices in NumPy --------------------------------------------------------------


def check(box: Stepper, reference: Reference) -> None:
    """Compare all outputs; erfc is good to 1.2e-7 here."""
    expected = reference.output()
    for name, value in expected.items():
        np.testing.assert_allclose(
            box.y[name], value, rtol=1e-6, atol=1e-6 if name != "sound_speed" else 1e-5,
            err_msg=name,
        )
    np.testing.assert_allclose(covariance(box), reference.P, rtol=1e-6, atol=1e-7)


def follow(raft: Raft, parameters: Mapping[str, Any], **settings: Any) -> Reference:
    """A dive by both, compared at its last tick and at each estimate."""
    result = raft.dive(LINE, parameters, **settings)
    reference = Reference(result.receiver.p)
    harness.follow(result, reference, 1e-6)
    check(result.receiver, reference)
    return reference


@pytest.mark.parametrize("pose_source", [1, 2, 3])
@pytest.mark.parametrize("ratio", [1, 4])
@pytest.mark.parametrize("start", [{}, PRIOR], ids=["first receptions", "prior"])
@one_in(2)
def test_it_equals_full_matrices(
    pose_source: int, ratio: int, start: Mapping[str, Any]
) -> None:
    follow(Raft(), {**start, "pose_source": pose_source}, ratio=ratio, acoustics=NOISY,
           steps=40 * (2 + ratio))


@pytest.mark.parametrize("pose_source", [1, 2, 3])
@pytest.mark.parametrize("start", [{}, PRIOR], ids=["first receptions", "prior"])
def test_it_equals_them_with_a_slow_error_of_down(
    pose_source: int, start: Mapping[str, Any]
) -> None:
    reference = follow(Raft(), {**start, **SINKING, "pose_source": pose_source}, acoustics=NOISY,
                       steps=120)
    assert reference.mean[SINK] != 0


def test_late_arrivals_are_weighed_as_with_the_exact_densities() -> None:
    follow(Raft(), OUTLIERS, acoustics=NOISY | OUTLIERS, steps=200)


@pytest.mark.parametrize("chance", [0.05, 0.3])
@pytest.mark.parametrize("mean", [0.4, 3.0])
def test_late_arrivals_of_one_time_begin_with_their_variance(chance: float, mean: float) -> None:
    """All four are heard at once, so that the first fix allows for late ones among them."""
    late = {"outlier_probability": chance, "outlier_mean": mean}
    follow(Raft(), late, acoustics=NOISY | late | {"schedule": 2}, steps=40)


@pytest.mark.parametrize("clock_std", [10.0, 27.0, 300.0])
@pytest.mark.parametrize("motion", [{}, {"prior_velocity_std": 0.05}], ids=["fast", "slow"])
def test_a_clock_that_is_hardly_known(clock_std: float, motion: Mapping[str, Any]) -> None:
    """A fix that may be anywhere on a ray begins further out, and ranges bend with the distance."""
    follow(Raft(), {**motion, "clock_std": clock_std}, acoustics=NOISY, steps=60)


@pytest.mark.parametrize("name", ["arm of 0.4 m", "poor GPS", "skew", "three beacons", "slow"])
def test_other_platforms(name: str) -> None:
    body = np.array([[2.0, 0.5, 0.2], [-0.5, 3.0, 0.8], [-2.5, 0.3, 0.4], [0.4, -1.5, 1.4]])
    raft = {
        "arm of 0.4 m": Raft(body=CROSS * [0.4 / 3, 0.4 / 3, 1.0]),
        "poor GPS": Raft(gps_std=3.5),
        "skew": Raft(body=body),
        "three beacons": Raft(body=np.array([*body[:3], body[2]])),
        "slow": Raft(),
    }[name]
    settings: dict[str, Any] = {"acoustics": NOISY, "steps": 100}
    follow(raft, {**PRIOR, "gps_markov_std": 0.0},
           **settings | ({"sampling_time": 1.0} if name == "slow" else {}))


@pytest.mark.parametrize("pose_source", [1, 3])
def test_restarts_are_the_same(pose_source: int) -> None:
    wrong = {**PRIOR, "prior_position": (34.0, -2.0, 5.0)}
    reference = follow(Raft(), {**wrong, **SINKING, "pose_source": pose_source}, acoustics=NOISY,
                       steps=150)
    assert reference.restarts >= 1


# --- Motion that is learned ----------------------------------------------------------------------


@pytest.mark.parametrize("pose_source", [1, 2, 3])
@pytest.mark.parametrize("start", [{}, PRIOR], ids=["first receptions", "prior"])
@pytest.mark.parametrize("late", [{}, OUTLIERS], ids=["punctual", "late"])
@one_in(4)
def test_learned_motion_is_an_interacting_multiple_model(
    pose_source: int, start: Mapping[str, Any], late: Mapping[str, Any]
) -> None:
    result = Raft().dive(
        LINE, {**start, **late, "pose_source": pose_source, "acceleration_psd": -1.0},
        acoustics=NOISY | late, steps=160,
    )
    reference = Learning(
        result.receiver.p, bank.PSDS, bank.CHANCES, bank.MEMORY, bank.EVERY)
    harness.follow(result, reference, 2e-6)
    assert reference.epoch > 2 * bank.EVERY
    for name, value in reference.output().items():
        np.testing.assert_allclose(
            result.receiver.y[name], value, rtol=2e-6, atol=2e-5, err_msg=name
        )


@pytest.mark.parametrize("pose_source", [1, 3])
def test_its_filters_have_heave_and_swing_in_common(pose_source: int) -> None:
    result = Raft().dive(
        LINE, {**SINKING, "pose_source": pose_source, "acceleration_psd": -1.0},
        acoustics=NOISY, steps=160,
    )
    reference = Learning(
        result.receiver.p, bank.PSDS, bank.CHANCES, bank.MEMORY, bank.EVERY)
    harness.follow(result, reference, 2e-6)
    box, (heave, swing) = result.receiver, (reference.filters[0].heave, reference.filters[0].swing)
    assert swing.C.any() == (pose_source == 3)
    np.testing.assert_allclose(
        np.ravel(box.state("heave")), [*heave.a, heave.C[0, SINK], heave.V], rtol=2e-6, atol=1e-7
    )
    np.testing.assert_allclose(
        np.ravel(box.state("swing")), [*swing.a, swing.C[0, 6], *swing.C[:, PSI], swing.V],
        rtol=2e-6, atol=1e-7,
    )
    for name, value in reference.output().items():
        np.testing.assert_allclose(box.y[name], value, rtol=2e-6, atol=2e-5, err_msg=name)


def test_learned_motion_restarts_as_one() -> None:
    wrong = {**PRIOR, "prior_position": (34.0, -2.0, 5.0), "acceleration_psd": -1.0}
    result = Raft().dive(LINE, wrong, acoustics=NOISY, steps=150)
    reference = Learning(
        result.receiver.p, bank.PSDS, bank.CHANCES, bank.MEMORY, bank.EVERY)
    harness.follow(result, reference, 2e-6)
    assert reference.restarts >= 1
    assert result.receiver.y["restart_count"] == reference.restarts


# --- Odd circumstances ---------------------------------------------------------------------------


def tell(box: Stepper, position: Any, epoch: float, raft: Raft | None = None, **changes: Any
         ) -> None:
    """Four ranges, a depth and poses of one epoch on the receiver's inputs."""
    raft = raft or Raft(gps_std=0.0, imu_std=0.0, tilt=0.0, swing=0.0)
    place, attitude = raft.pose(epoch)
    hear(box, np.asarray(position), epoch, beacons=raft.beacons(epoch))
    box.set(**{
        "ping_beacon_position": raft.reported(epoch),
        "packet_beacon_position": raft.reported(epoch),
        "ping_platform_position": np.tile(place, (4, 1)),
        "ping_platform_attitude": np.tile(attitude, (4, 1)),
        **changes,
    })


def run(box: Stepper, count: int, position: Any = HERE, first: int = 1, **changes: Any) -> None:
    """Tell the receiver the same, tick after tick."""
    for n in range(first, first + count):
        tell(box, position, 0.1 * n, **changes)
        box.step(box.t_ns, NS // 10)


def receiver(**parameters: Any) -> Stepper:
    """A receiver after its start."""
    box = Stepper(model("coupled"), parameters)
    box.step(0, NS // 10)
    return box


def test_the_defaults() -> None:
    """Studies rely on them: another one is another filter."""
    cross = tuple(CROSS.ravel())
    found = {v.name: v.starts if v.shape else v.start
             for v in RECEIVERS["coupled"].of("parameter")}
    assert found == {
        "update_interval": 0.1, "range_std": 0.1, "depth_std": 0.1, "initialisation": 1,
        "prior_position": (0.0,) * 3, "prior_velocity": (0.0,) * 3, "prior_position_std": 1.0,
        "prior_velocity_std": 1.0, "acceleration_psd": 0.01, "speed_limit": 3.0, "pose_source": 1,
        "beacon_offset": cross, "outlier_probability": 0.01, "outlier_mean": 1.0,
        "assumed_sound_speed": 1500.0, "clock_std": 1.35, "clock_walk_psd": 5.6e-5,
        "sound_speed_std": 0.02, "depth_bias_std": 0.05, "gps_std": 0.1, "gps_markov_std": 1.2,
        "gps_correlation_time": 120.0, "gps_bias_std": 0.0, "gps_vertical_std": 0.0,
        "gps_vertical_error_std": 0.0, "gps_vertical_error_time": 1e6,
        "platform_velocity_std": 0.05, "platform_velocity_time": 40.0, "heading_rate_std": 0.02,
        "heading_rate_time": 3.0, "heave_std": 0.25, "heave_time": 0.8, "tilt_std": 0.07,
        "tilt_time": 0.8, "imu_heading_std": 0.0,
        "imu_heading_error_std": np.radians(3.0), "imu_heading_error_time": 1e6,
        "imu_tilt_std": np.radians(0.5), "watch": False,
    }


@pytest.mark.parametrize("start", [{}, {**PRIOR, "prior_position": HERE}])
def test_samples_of_one_epoch(start: Mapping[str, Any]) -> None:
    box = receiver(**start)
    reference = Reference(box.p)
    for n in range(1, 6):
        tell(box, HERE, 0.1 * n, Raft())
        box.step(box.t_ns, NS // 10)
        reference.tick(box.u)
    assert box.y["update_count"] == 5
    check(box, reference)


def test_a_late_sample_is_taken_as_if_it_were_of_now() -> None:
    box = receiver()
    reference = Reference(box.p)
    for epoch in (0.1, 0.2, 0.05, 0.25):
        tell(box, HERE, epoch, Raft())
        box.step(box.t_ns, NS // 10)
        reference.tick(box.u)
        assert box.y["epoch"] == max(epoch, 0.2 if epoch != 0.1 else 0.1)
        check(box, reference)


@pytest.mark.parametrize("start", [{}, PRIOR])
def test_nothing_heard(start: Mapping[str, Any]) -> None:
    box = receiver(**start)
    for _ in range(20):
        box.step(box.t_ns, NS // 10)
    assert not box.y["valid"]
    assert box.y["update_count"] == 0
    assert finite(box)
    assert (box.y["relative_position"] == 0).all()


@pytest.mark.parametrize("heard", [0, 1, 2, 3])
def test_a_fix_needs_three_beacons(heard: int) -> None:
    box = receiver()
    for n in range(1, 30):
        count = np.where(np.arange(4) < heard, n, 0)
        silent = {} if heard else {"packet_beacon_position": np.zeros((4, 3))}
        tell(box, HERE, 0.1 * n, reception_count=count, **silent)
        box.step(box.t_ns, NS // 10)
    assert box.y["valid"] == (heard == 3)
    assert finite(box)
    if heard == 3:
        assert np.linalg.norm(box.y["position"] - HERE) < 0.5


def test_without_a_depth_only_a_prior_starts() -> None:
    for start in ({}, {**PRIOR, "prior_position": HERE + 0.4}):
        box = receiver(**start)
        run(box, 50, depth=0.0, depth_epoch=0.0)
        assert box.y["valid"] == bool(start)
        assert finite(box)
        if start:
            assert np.linalg.norm(box.y["position"] - HERE) < 0.8
            assert box.y["restart_count"] == 0


def test_a_clock_alone_is_no_packet() -> None:
    """Depths without packets: a prior goes on, and its platform stays unknown."""
    box = receiver(**PRIOR)
    for n in range(1, 10):
        box.set(depth=5.0, depth_epoch=0.1 * n)
        box.step(box.t_ns, NS // 10)
    assert box.y["update_count"] == 9
    assert box.state("located") == 0
    assert box.y["position"][2] == pytest.approx(5.0, abs=0.1)
    assert finite(box)


@one_in(2)
@pytest.mark.parametrize("start", [{}, PRIOR])
@pytest.mark.parametrize("pose_source", [1, 2, 3])
@pytest.mark.parametrize(("parameters", "states"), [
    ({"clock_std": 0.0, "clock_walk_psd": 0.0}, [surroundings.CLOCK]),
    ({"sound_speed_std": 0.0}, [surroundings.SPEED]),
    ({"depth_bias_std": 0.0}, [surroundings.DEPTH_BIAS]),
    ({"gps_vertical_error_std": 0.0}, [surroundings.VERTICAL_ERROR]),
    ({"gps_markov_std": 0.0}, surroundings.GPS_ERROR),
    ({"platform_velocity_std": 0.0}, surroundings.PLATFORM_VELOCITY),
    ({"heading_rate_std": 0.0}, [surroundings.HEADING_RATE]),
    ({"imu_heading_error_std": 0.0}, [surroundings.HEADING_ERROR]),
])
def test_a_std_of_zero_switches_a_state_off(
    parameters: Mapping[str, Any], states: Any, pose_source: int, start: Mapping[str, Any]
) -> None:
    result = Raft().dive(LINE, {**start, **SINKING, **parameters, "pose_source": pose_source},
                         acoustics=NOISY, steps=60)
    box = result.receiver
    assert box.y["update_count"] > 20
    assert finite(box)
    P = covariance(box)
    assert (P[list(states)] == 0).all()
    assert (np.array(box.state("mean"))[0, list(states)] == 0).all()


def test_all_switched_off() -> None:
    zero = dict.fromkeys(
        ("clock_std", "clock_walk_psd", "sound_speed_std", "depth_bias_std", "gps_markov_std",
         "platform_velocity_std", "heading_rate_std", "imu_heading_error_std", "tilt_std",
         "imu_tilt_std", "imu_heading_std", "gps_std", "outlier_probability"), 0.0)
    box = receiver(**zero, prior_velocity_std=0.0, acceleration_psd=0.0)
    run(box, 100)
    assert finite(box)
    assert np.linalg.norm(box.y["position"] - HERE) < 0.01
    assert (box.y["velocity"] == 0).all()


@pytest.mark.parametrize("pose_source", [1, 2, 3])
def test_no_noise_no_error(pose_source: int) -> None:
    raft = Raft(gps_std=0.0, imu_std=0.0, tilt=0.0, swing=0.0)
    exact = {"range_std": 1e-3, "depth_std": 1e-3, "acceleration_psd": 1e-6,
             "imu_tilt_std": 0.0, "imu_heading_error_std": 0.0, "gps_markov_std": 0.0,
             "pose_source": pose_source}
    result = raft.dive(at_rest(*HERE), exact, acoustics={"range_std": 0.0}, depth_std=0.0,
                       steps=300)
    assert result.distance[-100:].max() < 0.01
    assert result.receiver.y["restart_count"] == 0


@pytest.mark.parametrize("pose_source", [1, 2, 3])
@pytest.mark.parametrize("turning", [0.0, -0.3])
def test_headings_beyond_half_a_turn(turning: float, pose_source: int) -> None:
    raft = Raft(heading=3.1, turning=turning)
    result = raft.dive(LINE, {"pose_source": pose_source, "heading_rate_std": 0.3},
                       acoustics={"range_std": 0.05}, steps=300)
    y = result.receiver.y
    assert y["restart_count"] == 0
    truth = raft.true(y["epoch"])[1][2]
    off = result.receiver.state("mean")[0, PSI] - truth
    assert abs((off + np.pi) % (2 * np.pi) - np.pi) < 0.15
    assert result.distance[-50:].max() < 2.0


def test_the_first_fix_waits_for_the_platform() -> None:
    raft = Raft(gps_std=3.5, center=(105.0, 47.0, 0.0))
    path = straight((117.0, 54.0, 5.0), (-0.3, 0.4, 0.05))
    result = raft.dive(path, {"pose_source": 3, "gps_markov_std": 0.0},
                       acoustics={"range_std": 0.1}, steps=60)
    assert result.t[0] == pytest.approx(1.3)  # the twelfth packet
    assert result.distance.max() < 10.0
    assert result.receiver.y["restart_count"] == 0


def test_it_waits_for_a_heading_as_long_as_that_needs() -> None:
    """Own positions with more noise tell the heading later, and never after the twelfth packet."""
    first = []
    for std in (0.3, 1.4, 1.7, 2.0, 2.3, 3.5):
        raft = Raft(gps_std=std)
        settings: dict[str, Any] = {"acoustics": {"range_std": 0.1}, "steps": 40}
        result = raft.dive(LINE, {"pose_source": 3, "gps_markov_std": 0.0}, **settings)
        reference = Reference(result.receiver.p)
        heard = 0
        for u in result.inputs:
            reference.tick(u)
            heard += 1
            if reference.updates:
                break
        assert result.epoch[0] == pytest.approx(reference.epoch), std
        first.append(heard)
    assert first == sorted(first)
    assert len(set(first)) > 2
    assert first[-1] == 13  # ticks: the first one hears nothing yet


def test_a_doubted_fix_has_a_covariance() -> None:
    """Late by up to 10 m: the fix is bad, and so is its depth, of which a part is the bias."""
    box = receiver(depth_bias_std=0.2, depth_std=0.02, **SINKING)
    tell(box, HERE, 0.1, Raft())
    box.set(range=box.u["range"] + [10.0, 0.0, 3.0, 0.0])
    box.step(box.t_ns, NS // 10)
    assert box.y["valid"]
    P = covariance(box)
    scale = np.sqrt(np.diag(P))
    assert np.linalg.eigvalsh(P / np.outer(scale, scale)).min() > -1e-9


def test_own_positions_do_not_tell_the_heading_from_the_error_of_the_imu() -> None:
    result = Raft(heading_error=0.05).dive(LINE, {"pose_source": 3}, acoustics={"range_std": 0.1},
                                           steps=10)
    P = covariance(result.receiver)
    assert np.sqrt(P[PSI, PSI]) > 0.9 * result.receiver.p["imu_heading_error_std"]
    assert P[PSI, surroundings.HEADING_ERROR] < 0


@pytest.mark.parametrize("direction", [0.0, 2.0, 4.0])
def test_it_finds_back_from_20_m(direction: float) -> None:
    """What the ranges have done to platform and clock before the restart is worth 1 m or 5 m."""
    off = 20 * np.array([np.cos(direction), np.sin(direction), 0])
    start = {"initialisation": 2, "prior_position": np.array([17.0, 4.0, 5.0]) + off,
             "prior_position_std": 1.0, "prior_velocity_std": 0.5}
    known = {"gps_markov_std": 0.0, "imu_heading_error_std": 0.0, "clock_std": 0.1,
             "sound_speed_std": 0.0}
    for sensors, most in ((known, 1.0), ({}, 6.0)):
        result = Raft().dive(LINE, start | sensors, acoustics=NOISY, steps=200)
        assert 1 <= result.receiver.y["restart_count"] <= 2
        assert result.distance[0] > 15
        assert result.distance[20:].max() < most


def test_late_ranges_do_not_start_it_anew() -> None:
    result = Raft().dive(LINE, OUTLIERS, acoustics={"range_std": 0.1} | OUTLIERS, steps=600)
    assert result.receiver.y["restart_count"] == 0
    assert result.distance[100:].max() < 2.0


def test_nobody_swims_that_fast() -> None:
    fast = {"initialisation": 2, "prior_position": HERE, "prior_velocity": (9.0, 0.0, 0.0),
            "prior_velocity_std": 0.1}
    for limit, restarts in ((20.0, 0), (3.0, 1)):
        box = receiver(**fast, speed_limit=limit)
        run(box, 1)
        assert box.y["restart_count"] == restarts
        assert (np.linalg.norm(box.y["velocity"]) < 1.0) == (restarts == 1)


def test_what_it_says_of_the_system() -> None:
    raft = Raft()
    offset, speed = 0.5e-3, 1515.0
    parameters = {"gps_vertical_std": 0.02, "gps_bias_std": 0.4, "imu_heading_error_std": 0.0}
    result = raft.dive(LINE, parameters, steps=600, acoustics={
        "range_std": 0.05, "clock_offset": offset, "sound_speed": speed})
    y = result.receiver.y
    np.testing.assert_allclose(y["relative_position"], y["position"] - y["platform_position"],
                               atol=1e-12)
    place = raft.true(y["epoch"])[0]
    truth = LINE(y["epoch"])[0]
    np.testing.assert_allclose(y["platform_position"], place, atol=1.0)
    assert np.linalg.norm(y["relative_position"] - (truth - place)) < 0.6
    mean = result.receiver.state("mean")[0]
    assert y["clock_offset"] == mean[surroundings.CLOCK] / 1500.0
    assert y["sound_speed"] == 1500.0 / (1 + mean[surroundings.SPEED])
    # κ < 0 where sound is faster than assumed, and a clock that is ahead makes ranges longer.
    P = covariance(result.receiver)
    distance = np.linalg.norm(truth - place)
    H = np.zeros(surroundings.STATES)
    H[[surroundings.CLOCK, surroundings.SPEED]] = 1, distance
    off = H @ mean - (1500 * offset + (1500 / speed - 1) * distance)
    assert abs(off) < 2.5 * np.sqrt(H @ P @ H) < 1.5
    _, share, variance = np.ravel(result.receiver.state("heave"))
    D = np.zeros(surroundings.STATES)
    D[[2, SINK]] = 1, share
    np.testing.assert_allclose(y["relative_covariance"][2, 2], D @ P @ D + variance)
    np.testing.assert_allclose(y["position_std"] ** 2, np.diag(y["covariance"])[::2])
    assert y["covariance"][0, 0] > P[0, 0] + 0.4**2 - 1e-9


def test_covariances_are_symmetric_and_positive() -> None:
    for result in (
        Raft(gps_std=3.5).dive(LINE, {**SINKING, "pose_source": 3}, acoustics=NOISY, steps=200),
        Raft().dive(LINE, {**SINKING, "range_std": 1e-4, "depth_std": 1e-4}, acoustics=NOISY,
                    steps=200),
        Raft().dive(LINE, {**SINKING, "imu_heading_error_time": 1e9,
                           "platform_velocity_time": 1e9}, acoustics=NOISY, steps=200),
        Raft().dive(LINE, SINKING, acoustics=NOISY, steps=200),
    ):
        P = covariance(result.receiver)
        scale = np.sqrt(np.diag(P))
        assert (scale > 0).all()
        assert np.linalg.eigvalsh(P / np.outer(scale, scale)).min() > -1e-9
        np.testing.assert_array_equal(result.covariance, result.covariance.transpose(0, 2, 1))


# --- Random parameters ---------------------------------------------------------------------------


def drawn(rng: np.random.Generator) -> dict[str, Any]:
    """Parameters within their bounds, from very small to very large, some of them 0."""
    values: dict[str, Any] = {}
    for v in RECEIVERS["coupled"].of("parameter"):
        if v.name == "update_interval":
            continue
        if v.choices is not None:
            values[v.name] = rng.choice(list(v.choices))
        elif v.shape:
            values[v.name] = rng.normal(scale=10 ** rng.uniform(-1, 1.5), size=v.shape)
        else:
            low, high = v.bounds[0] or 0.0, v.bounds[1] or np.inf
            value = max(10 ** rng.uniform(-6, 4), low)
            values[v.name] = low if rng.random() < 0.2 else min(value, high)
    return values


@pytest.mark.parametrize(
    "batch", [0, *(pytest.param(i, marks=pytest.mark.slow) for i in range(1, 4))]
)
def test_outputs_are_finite_whatever_the_parameters(batch: int) -> None:
    rng = np.random.default_rng(batch)
    for _ in range(50):
        parameters = drawn(rng)
        box = receiver(**parameters)
        here, epoch = rng.normal(scale=20, size=3), 0.0
        count = np.zeros(4)
        body = np.asarray(parameters["beacon_offset"])
        raft = Raft(body=body, gps_std=rng.choice([0.0, 0.1, 3.5]), turning=rng.normal())
        for _ in range(50):
            epoch += rng.choice([0.0, 0.1, 0.1, 0.1, 5.0, 600.0])
            here = here + rng.normal(scale=0.1, size=3)
            count = count + (rng.random(4) < 0.5)
            late = rng.choice([0.0, 0.1, 30.0], size=4) * rng.random(4)
            distance = np.linalg.norm(here - raft.beacons(epoch), axis=1)
            tell(box, here, epoch, raft, reception_count=count, range=distance + late,
                 range_epoch=epoch - 0.1 * rng.random(4))
            box.step(box.t_ns, NS // 10)
            assert finite(box), parameters
