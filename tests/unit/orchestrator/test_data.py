"""Records, samples and truths of a dive, by hand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from sblcosim.data import arms, bearing
from sblcosim.data.estimates import Estimates
from sblcosim.data.motion import motion_psd
from sblcosim.data.record import NEVER, Record, epochs_ns
from sblcosim.data.samples import OWN, Samples, of_record, pose_of
from sblcosim.data.tables import Columns, TableColumn
from sblcosim.data.truth import Truth, platform_errors, state_at
from sblcosim.data.truth import of_record as truth_of
from sblcosim.data.turns import turned
from sblcosim.errors import ConfigurationError
from scipy.spatial.transform import Rotation

NS = 10**9
BODY = np.array([[3.0, 0.5, 1.0], [-0.5, 2.0, 0.7], [-2.5, -1.0, 0.4], [0.2, -3.0, 1.6]])


# --- Records --------------------------------------------------------------------------------------


def receiver(count: Any, valid: Any = None, start_s: float = 2.0) -> Record:
    """Instants half a second apart."""
    n = len(count)
    values = {
        "rx.update_count": np.array(count, np.int32), "rx.epoch": start_s + np.arange(n) * 0.25,
        "rx.position": np.arange(3.0 * n).reshape(n, 3), "log.depth": np.zeros(n),
    }  # fmt: skip
    if valid is not None:
        values["rx.valid"] = np.array(valid, bool)
    time_ns = round(start_s * NS) + np.arange(n) * NS // 2
    return Record(time_ns, values, {"log": 3 * NS // 2})


def test_a_record_says_its_span_and_its_components() -> None:
    record = receiver([0, 1, 1, 2, 3, 3])
    assert repr(record) == "<Record of 6 instants, 2 to 4.5 s: rx, log>"


def test_own_instants_count_from_the_first() -> None:
    record = receiver([0] * 8, start_s=2.25)
    assert record.own("log").tolist() == [True, False, False, True, False, False, True, False]
    assert record.own("rx").all()


def test_an_estimate_holds_until_the_next_or_until_it_is_no_longer_valid() -> None:
    record = receiver([0, 1, 1, 2, 2, 3, 3, 4, 4], [0, 1, 1, 1, 0, 1, 1, 1, 1])
    own = record.estimates("rx")
    assert own.update_count is not None
    assert own.available_ns is not None
    assert own.until_ns is not None
    assert own.update_count.tolist() == [1, 2, 3, 4]
    assert (own.available_ns / NS).tolist() == [2.5, 3.5, 4.5, 5.5]
    assert (own.until_ns / NS).tolist() == [3.5, 4.0, 5.5, 6.0]
    assert (own.epoch_ns / NS).tolist() == [2.25, 2.75, 3.25, 3.75]
    last = receiver([0, 0, 1]).estimates("rx")
    assert last.until_ns is not None
    assert last.until_ns.tolist() == [3 * NS]
    assert repr(own) == "<Estimates of 4 epochs>"


def test_epochs_are_those_of_instants_where_doubles_cannot_tell_nanoseconds() -> None:
    late = 2_000_000_000 * NS + np.array([1, 1000, 5001])
    found = epochs_ns(late, late / 1e9)
    np.testing.assert_array_equal(found, late)
    between = np.array([0.25, -1.5, 8.999e9, 9e9, -9e9, np.inf, np.nan])
    expected = [NS // 4, -3 * NS // 2, 8_999_000_000 * NS, NEVER, NEVER, NEVER, NEVER]
    assert epochs_ns(np.array([0, NS]), between).tolist() == expected


def test_what_was_learned_of_the_motion_is_what_updates_say() -> None:
    record = receiver([1, 1, 2, 3, 4, 4], [0, 1, 1, 1, 1, 1])
    psd = np.array([0.1, 0.2, 0.3, np.nan, 0.5, 0.6])
    with_psd = replace(record, values={**record.values, "rx.motion_psd": psd})
    found = motion_psd(with_psd, "rx")
    assert found is not None
    assert found.tolist() == [0.3, 0.5]
    first = replace(receiver([1, 1]), values={**receiver([1, 1]).values, "rx.motion_psd": psd[:2]})
    assert motion_psd(first, "rx") == [0.1]
    none = replace(record, values={**record.values, "rx.motion_psd": np.full(6, np.nan)})
    assert motion_psd(none, "rx") is None
    assert motion_psd(record, "rx") is None


# --- Truths ---------------------------------------------------------------------------------------


def cubic(t: Any) -> tuple[Any, Any]:
    """A motion that is a cubic along each axis, and its velocity."""
    t = np.asarray(t, float)[:, None]
    a, b, c, d = np.array([[1.0, -2, 3], [0.5, 0.25, -1], [0.3, -0.2, 0.1], [0.02, 0.03, -0.05]])
    return a + b * t + c * t**2 + d * t**3, b + 2 * c * t + 3 * d * t**2


def test_a_cubic_is_followed_between_instants_that_are_not_alike() -> None:
    time_s = np.array([2.0, 2.5, 4.0, 7.0])
    time_ns = (time_s * NS).astype(np.int64)
    position, velocity = cubic(time_s)
    asked = np.array([2.0, 2.2, 2.5, 3.7, 6.9, 7.0])
    found = state_at(time_ns, position, velocity, (asked * NS).astype(np.int64))
    for one, other in zip(found, cubic(asked), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9)
    for outside in (1.999, 7.001):
        with pytest.raises(ValueError, match="within the recorded time"):
            state_at(time_ns, position, velocity, np.array([round(outside * NS)]))
    truth = Truth(time_ns=time_ns, position=position, velocity=velocity)
    np.testing.assert_array_equal(truth.state_at(time_ns[1:2])[0], position[1:2])
    for one, other in zip(truth.state_at((asked * NS).astype(np.int64)), found, strict=True):
        np.testing.assert_array_equal(one, other)
    straight = Truth(time_ns=time_ns, position=position)
    at, speed = straight.state_at(np.array([3 * NS]))
    np.testing.assert_allclose(at[0], position[1] + (position[2] - position[1]) / 3)
    assert np.isnan(speed).all()
    assert repr(straight) == "<Truth of 4 instants, 2 to 7 s>"
    assert (straight.start_ns, straight.stop_ns) == (2 * NS, 7 * NS)
    spanned = replace(straight, span_ns=(NS, 9 * NS))
    assert (spanned.start_ns, spanned.stop_ns) == (NS, 9 * NS)


def platform_record() -> Record:
    time_ns = np.arange(4) * NS + 5 * NS
    place = np.arange(48.0).reshape(4, 4, 3)
    error = np.array([[1.0, 2, 3], [2, 4, 6], [3, 6, 9], [6, 0, -2]])
    scale = np.array([1.0, -2.0, 0.5, 4.0])
    values = {
        "target.position": cubic(np.arange(4))[0], "target.velocity": cubic(np.arange(4))[1],
        "platform.position": np.arange(12.0).reshape(4, 3) ** 2,
        "platform.beacon_position": place,
        "platform.reported_beacon_position": place + scale[:, None, None] * error,
    }  # fmt: skip
    return Record(time_ns, values, {"target": 3 * NS})


def test_the_truth_of_a_run_has_the_motion_and_the_errors_of_the_platform() -> None:
    record = platform_record()
    truth = truth_of(record)
    assert truth.time_ns.tolist() == [5 * NS, 8 * NS]
    assert truth.span_ns == (5 * NS, 8 * NS)
    np.testing.assert_array_equal(truth.position, record.values["target.position"][[0, 3]])
    np.testing.assert_array_equal(truth.velocity, record.values["target.velocity"][[0, 3]])
    mean = np.outer([1.0, -2.0, 0.5, 4.0], [3.0, 3.0, 4.0])
    np.testing.assert_allclose(platform_errors(record), mean, atol=1e-12)
    held = truth.platform_at(np.array([5 * NS, 7 * NS - 1, 7 * NS, 20 * NS]))
    assert held is not None
    np.testing.assert_array_equal(held[0], record.values["platform.position"][[0, 1, 2, 3]])
    np.testing.assert_allclose(held[1], mean[[0, 1, 2, 3]], atol=1e-12)
    assert replace(truth, platform_error=None).platform_at(truth.time_ns) is None
    less = replace(record, values={k: v for k, v in record.values.items() if "reported" not in k})
    with pytest.raises(ConfigurationError, match=r"got no platform\.reported_beacon_position$"):
        truth_of(less)


@pytest.mark.parametrize(("times", "rows", "words"), [
    ([], 0, "truth: must have instants that increase, got none"),
    ([1, 1], 2, "truth: must have instants that increase, got some that do not"),
    ([1, 2, 0], 3, "truth: must have instants that increase, got some that do not"),
    ([1, 2], 3, r"truth: position must have three coordinates for each of 2 instants, got shape "
                r"\(3, 3\)"),
])  # fmt: skip
def test_a_truth_that_does_not_fit_is_refused(times: Any, rows: int, words: str) -> None:
    with pytest.raises(ConfigurationError, match=f"^{words}$"):
        Truth(time_ns=np.array(times, np.int64), position=np.zeros((rows, 3)))


def test_a_motion_of_the_platform_that_does_not_fit_is_refused() -> None:
    fits: dict[str, Any] = {"time_ns": np.array([0, 1]), "position": np.zeros((2, 3))}
    for times, words in (([3, 2], "truth of the platform: must have instants that increase"),
                         ([3], "platform_position must have three coordinates for each of 1 inst")):
        with pytest.raises(ConfigurationError, match=words):
            Truth(**fits, platform_time_ns=np.array(times), platform_position=np.zeros((2, 3)))


# --- Samples --------------------------------------------------------------------------------------


def test_the_pose_of_beacons_is_the_one_that_moved_them() -> None:
    rng = np.random.default_rng(5)
    for _ in range(8):
        roll, pitch, yaw = rng.uniform([-1, -1, -3], [1, 1, 3])
        place = rng.normal(0, 50, 3)
        turn = Rotation.from_euler("ZYX", [yaw, pitch, roll])
        position, attitude = pose_of(turn.apply(BODY) + place, BODY)
        np.testing.assert_allclose(position, place, atol=1e-9)
        np.testing.assert_allclose(attitude, [roll, pitch, yaw], atol=1e-9)
    noisy = turn.apply(BODY) + rng.normal(0, 0.1, BODY.shape)
    position, attitude = pose_of(noisy, BODY)
    best, _ = Rotation.align_vectors(noisy - noisy.mean(axis=0), BODY - BODY.mean(axis=0))
    np.testing.assert_allclose(attitude, best.as_euler("ZYX")[::-1], atol=1e-7)
    np.testing.assert_allclose(position, noisy.mean(axis=0) - best.apply(BODY.mean(axis=0)))


def test_vectors_are_turned_by_yaw_pitch_and_roll_and_back() -> None:
    rng = np.random.default_rng(6)
    attitude, vectors = rng.uniform(-3, 3, (9, 3)), rng.normal(0, 4, (9, 3))
    there = Rotation.from_euler("ZYX", attitude[:, ::-1]).apply(vectors)
    np.testing.assert_allclose(turned(attitude, vectors), there, atol=1e-12)
    np.testing.assert_allclose(turned(attitude, there, inverse=True), vectors, atol=1e-12)


def heard(**more: Any) -> Record:
    """Five instants from 3 s: packets of beacons 2, 0 and 1, then 0 and 2; depths at 2 of them."""
    count = np.array([[0, 0, 1, 0], [0, 0, 1, 0], [1, 1, 1, 0], [1, 1, 1, 0], [2, 1, 3, 0]])
    epoch = np.array([[0, 0, 2.9, 0], [0, 0, 2.9, 0], [3.9, 3.6, 2.9, 0], [3.9, 3.6, 2.9, 0],
                      [4.75, 3.6, 4.75, 0]])  # fmt: skip
    values: dict[str, Any] = {
        "acoustics.range": 10 * np.arange(20.0).reshape(5, 4), "acoustics.range_epoch": epoch,
        "acoustics.reception_count": count,
        "acoustics.ping_beacon_position": np.arange(60.0).reshape(5, 4, 3),
        "target.depth": np.array([7.0, 7.5, 7.5, 8.5, 9.5]),
        "target.depth_epoch": np.array([3.0, 3.25, 3.25, 4.25, 4.25]),
        **more,
    }
    return Record(3 * NS + np.arange(5) * NS // 2, values)


def test_samples_are_packets_and_readings_in_the_order_of_their_epochs() -> None:
    found = of_record(heard(), BODY)
    assert found.start_ns == 3 * NS
    assert (found.range_ns / NS).tolist() == [2.9, 3.6, 3.9, 4.75, 4.75]
    assert found.beacon.tolist() == [2, 1, 0, 0, 2]
    assert found.range.tolist() == [20.0, 90.0, 80.0, 160.0, 180.0]
    rows = heard().values["acoustics.ping_beacon_position"].reshape(20, 3)[[2, 9, 8, 16, 18]]
    np.testing.assert_array_equal(found.position, rows)
    assert not found.has_pose.any()
    np.testing.assert_array_equal(found.attitude, np.zeros((5, 3)))
    assert (found.depth_ns / NS).tolist() == [3.25, 4.25]
    assert found.depth.tolist() == [7.5, 8.5]
    assert (found.epochs_ns / NS).tolist() == [2.9, 3.25, 3.6, 3.9, 4.25, 4.75]
    assert found.enough_ns() == 3_900_000_000
    np.testing.assert_array_equal(found.beacon_position(), rows)


def test_a_depth_is_new_when_its_epoch_is_and_three_beacons_may_come_before_it() -> None:
    late = heard(**{"target.depth_epoch": np.array([2.0, 2.0, 2.0, 2.0, 4.875])})
    found = of_record(late, BODY)
    assert (found.depth_ns / NS).tolist() == [4.875]
    assert found.enough_ns() == 4_875_000_000
    none = heard(**{"target.depth_epoch": np.zeros(5)})
    assert of_record(none, BODY).enough_ns() is None
    two = heard(**{"acoustics.reception_count": heard().values["acoustics.reception_count"]
                   * [1, 0, 1, 0]})  # fmt: skip
    assert of_record(two, BODY).enough_ns() is None


def test_poses_are_taken_from_where_they_are() -> None:
    """The pose of a packet, else the places of all beacons, else the own beacon's place."""
    pose, attitude = np.zeros((2, 5, 4, 3))
    pose[2, 0], attitude[2, 0] = (5.0, 6.0, 7.0), (0.1, 0.2, 0.3)
    attitude[4, 2] = (0.0, 0.0, 0.4)
    turn = Rotation.from_euler("ZYX", [0.7, -0.1, 0.2])
    every = np.zeros((5, 4, 3))
    every[0] = np.add(turn.apply(BODY), [1.0, 2.0, 3.0])
    record = heard(**{
        "acoustics.ping_platform_position": pose, "acoustics.ping_platform_attitude": attitude,
        "acoustics.packet_beacon_position": every,
    })  # fmt: skip
    found = of_record(record, BODY)
    assert found.has_pose.tolist() == [True, False, True, False, True]
    own = record.values["acoustics.ping_beacon_position"].reshape(20, 3)
    np.testing.assert_allclose(
        found.position, [[1, 2, 3], own[9], [5, 6, 7], own[16], [0, 0, 0]], atol=1e-9
    )
    np.testing.assert_allclose(
        found.attitude,
        [[0.2, -0.1, 0.7], [0, 0, 0], [0.1, 0.2, 0.3], [0, 0, 0], [0, 0, 0.4]], atol=1e-9,
    )
    placed = found.beacon_position(BODY)
    np.testing.assert_allclose(placed[0], every[0, 2], atol=1e-9)
    np.testing.assert_allclose(placed[2], turned(attitude[2, :1], BODY[:1])[0] + [5, 6, 7])
    np.testing.assert_array_equal(placed[[1, 3]], own[[9, 16]])
    with pytest.raises(ConfigurationError, match="as 3 of 5 packets hold its pose, got none"):
        found.beacon_position()
    assert not of_record(record, BODY, OWN).has_pose.any()
    np.testing.assert_array_equal(of_record(record, BODY, OWN).position,
                                  own[[2, 9, 8, 16, 18]])  # fmt: skip


def test_a_second_pose_of_an_epoch_is_nothing_new() -> None:
    n = 6
    found = Samples(
        0, np.zeros(0, np.int64), np.zeros(0), np.array([0, 0, 4, 4, 4, 9]), np.arange(n) % 3,
        np.ones(n), np.array([1, 1, 1, 0, 1, 1], bool), np.zeros((n, 3)), np.zeros((n, 3)),
    )
    assert found.has_own_pose.tolist() == [True, False, True, True, False, True]


def test_a_record_without_samples_names_what_it_lacks() -> None:
    values = {k: v for k, v in heard().values.items() if k != "target.depth"}
    with pytest.raises(ConfigurationError, match=r"got no target\.depth$"):
        of_record(replace(heard(), values=values), BODY)


# --- Smaller ones ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("reach", "far"), [(9.99, False), (10.0, False), (10.01, True)])
def test_beacons_ten_metres_from_their_middle_may_be_on_arms(reach: float, far: bool) -> None:
    around = np.array([[reach, 0, 2.0], [-reach, 0, 2], [0, 3, 2], [0, -3, 2]])
    beacons = np.add(around, [50, 90, 0])
    assert arms.are_far(beacons) == far
    assert arms.are_far(beacons[:, [2, 0, 1]]) == far


def test_the_variance_of_a_bearing_is_that_across_the_line() -> None:
    """A covariance that is not along the axes, of a diver at 36.87° and 10 m."""
    across = np.array([-0.6, 0.8])
    P = np.zeros((1, 6, 6))
    P[0, 1, 1] = P[0, 3, 3] = P[0, 4, 4] = 1e9  # velocities and depth say nothing
    level = np.array([[150.0, 40.0], [40.0, 250.0]])
    P[0, ::2, ::2][:2, :2] = level
    own = Estimates(
        epoch_ns=np.zeros(1, np.int64), position=np.zeros((1, 3)), covariance=P,
        relative_position=np.array([[8.0, 6.0, 30.0]]),
    )
    variance = across @ level @ across
    assert variance == pytest.approx(175.6)
    for limit, unknown in ((1.001, True), (0.999, False)):
        scaled = replace(own, covariance=P * limit * 200 / variance)  # 2 rad² times 100 m²
        assert bearing.is_unknown(scaled).tolist() == [unknown]


def test_columns_have_headings_with_units_that_are_not_those_of_the_table() -> None:
    columns = Columns("Part", "About", (), (
        TableColumn("a_m", "A", "m", "first", of=lambda v: float(v.sum()), without=-1.0),
        TableColumn("b_s", "B", "s", "second", sometimes=True),
        TableColumn("c", "C", heading="third", of=len, in_json=False),
        TableColumn("d", "D", type=int),
    ))  # fmt: skip
    assert [columns.heading(c) for c in columns.printed] == ["first", "second [s]", "third"]
    assert columns.names == ["a_m", "b_s", "c", "d"]
    assert columns.head("b_s") == "second"
    assert columns.row(np.array([1.0, 2.5])) == {"a_m": 3.5, "c": 2}
    empty = columns.row(np.zeros(0))
    assert empty["a_m"] == -1.0
    assert np.isnan(empty["c"])
