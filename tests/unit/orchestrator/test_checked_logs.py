"""From tables as read to a log: limits of what counts, times, places, and all that is said."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from made_logs import PLACES, checked
from sblcosim.data.estimates import Estimates
from sblcosim.data.record import Record
from sblcosim.data.samples import OWN
from sblcosim.data.truth import Truth
from sblcosim.errors import ConfigurationError
from sblcosim.logs import simulated
from sblcosim.logs.columns import KINDS
from sblcosim.logs.log import Log, told
from sblcosim.logs.meta import Meta
from sblcosim.logs.raw import Flaw
from sblcosim.tracks.place import Origin

S = 10**9


def found(log: Log) -> list[tuple[int, str]]:
    """Lines that were not right, and why."""
    return [(it.line, it.what) for it in log.findings]


FAR = "no range from 0 m to 1,000 km"
OUT_OF_ORDER, ELSEWHERE = "out of order", "a time far from that of its neighbours"
NO_KIND = (
    "a kind of range that is none of one-way, two-way, range, pseudorange, inverted and difference"
)


def test_ranges_of_each_kind_have_their_limits_and_times() -> None:
    """At 1,250 m/s; a difference may be negative, and pings of the diver belong to the arrival."""
    kinds = ["one-way", "two-way", "range", "pseudorange", "inverted", "difference", "", "one-way",
             "two-way", "difference", "difference", "one-way", "one-way", "inverted", "odd"]
    ranges = [12.5, 25.0, 37.5, 50.0, 62.5, -75.0, 87.5, 0.0, 1e6, -1e6, -1_000_000.1, 1_000_000.1,
              -0.1, -0.1, 5.0]  # fmt: skip
    log = checked(
        {"sound_speed_m_s": 1250.0},
        receptions={
            "arrival_ns": [k * S for k in range(1, 16)], "beacon": ["A", "B", "C"] * 5,
            "range_m": ranges, "kind": kinds, "turn_around_s": [None, 0.5, *[None] * 6, 1.5,
                                                               *[None] * 6],
        },
    )  # fmt: skip
    assert found(log) == [(16, NO_KIND), *((line, FAR) for line in (12, 13, 14, 15))]
    heard = log.receptions
    assert heard.range.tolist() == ranges[:10]
    assert [KINDS[k] for k in heard.kind] == [it or "one-way" for it in kinds[:10]]
    late = (heard.arrival_ns - heard.epoch_ns).tolist()
    assert late == [S // 100, S // 50 + S // 4, 0, S // 25, 0, 0, S * 7 // 100, 0,
                    800 * S + S * 3 // 4, 0]  # fmt: skip
    assert log.turnaround_s == 1.0
    assert log.kinds == pytest.approx({
        "one-way": 0.3, "two-way": 0.2, "range": 0.1, "pseudorange": 0.1, "inverted": 0.1,
        "difference": 0.2,
    })  # fmt: skip


def test_ranges_are_from_flights_without_the_turn_around_where_none_is_given() -> None:
    log = checked(
        {"sound_speed_m_s": 1250.0},
        receptions={
            "time_ns": [S, 2 * S, 3 * S, 4 * S], "beacon": list("ABCA"),
            "time_of_flight_s": [0.01, 0.14, 0.03, 0.05], "range_m": [None, None, 7.5, ""],
            "turn_around_s": [0.1, 0.1, 0.1, None],
            "kind": ["one-way", "two-way", "two-way", "two-way"],
        },
    )  # fmt: skip
    np.testing.assert_allclose(log.receptions.range, [12.5, 25, 7.5, 31.25], rtol=1e-12)
    assert log.turnaround_s == pytest.approx(0.1)
    assert not log.findings
    assert [it.split(",")[0] for it in log.remarks] == [
        "meta.toml: sound_speed_m_s: should be from 1350 to 1650 m/s"
    ]


def test_arrivals_are_from_epochs_and_a_given_epoch_stays() -> None:
    heard = checked(receptions={
        "epoch_ns": [S, 2 * S, 3 * S, 4 * S], "arrival_ns": ["", "", "", str(4 * S + 70)],
        "beacon": list("ABCA"), "range_m": [15.0, 30.0, 45.0, 60.0],
        "kind": ["one-way", "two-way", "inverted", "inverted"], "ping": [1, 2, 3, 3],
        "turn_around_s": [0.0, 0.25, 0.0, 0.0],
    }).receptions  # fmt: skip
    assert heard.epoch_ns.tolist() == [S, 2 * S, 3 * S, 4 * S]
    assert (heard.arrival_ns - heard.epoch_ns).tolist() == [S // 100, S // 50 + S // 8, 0, 70]


def test_a_numbered_ping_of_the_diver_is_at_the_mean_of_its_arrivals() -> None:
    """Rounded to the nearest nanosecond; without a number, each range is at its own arrival."""
    log = checked(receptions={
        "arrival_ns": [1000, 1003, 1600, 1601, 9000, 9100, 9101], "beacon": list("ABCABCA"),
        "range_m": [15.0] * 7, "ping": [1, 1, 1, "", 2, 2, 1], "epoch_ns": [*[""] * 5, "9050", ""],
        "kind": ["inverted", "difference", "inverted", "inverted", "inverted", "inverted",
                 "one-way"],
    })  # fmt: skip
    assert log.receptions.arrival_ns.tolist() == [1000, 1003, 1600, 1601, 9000, 9100, 9101]
    assert log.receptions.epoch_ns.tolist() == [
        1201, 1201, 1201, 1601, 9000, 9050, 9101 - 10_000_000,
    ]


def test_marks_words_and_cells_of_ranges() -> None:
    log = checked(receptions={
        "arrival_ns": [str(k * S) for k in range(1, 11)],
        "epoch_ns": ["", "x", "N/A", *[""] * 7],
        "beacon": ["A", "A", "A", "null", "B", "B", "B", "B", "B", "C"],
        "range_m": ["5", "5", "5", "5", "6", "6", "6", "6", "6", "inf"],
        "valid": ["", "yes", "TRUE", "1", "0", "no", "1.0", "maybe", "none", "true"],
        "repeated": ["", "0.0", "no", "", "", "maybe", "yes", "true", "maybe", "False"],
    })
    assert found(log) == [
        (6, "marked as not valid"), (7, "marked as not valid"),
        (9, "valid is neither true nor false"), (8, "a value that was only read again"),
        (10, "repeated is neither true nor false"), (3, "a number that cannot be read"),
        (11, "a number that cannot be read"), (5, "no beacon"),
    ]  # fmt: skip
    assert log.receptions.line.tolist() == [2, 4]
    assert log.entries == {"receptions": 10}


def test_only_equal_ranges_at_a_time_are_the_same() -> None:
    log = checked(receptions={
        "arrival_ns": [S, S, S, S, 2 * S, S], "epoch_ns": [0, 0, 0, 1, 0, 0],
        "beacon": list("AABAAA"), "range_m": [5.0, 6.0, 5.0, 5.0, 5.0, 5.0],
    })
    assert found(log) == [(7, "the same as one before")]
    assert log.receptions.line.tolist() == [2, 3, 4, 5, 6]


def at(seconds: list[float], **columns: Any) -> dict[str, Any]:
    """A table of depths at some times."""
    return {"time_ns": [round(it * S) for it in seconds], "depth_m": [5.0] * len(seconds),
            **columns}  # fmt: skip


@pytest.mark.parametrize(("seconds", "wrong"), [
    ([100, 101, 96, 102, 103, 104], [(4, OUT_OF_ORDER)]),  # 5 s from the one before
    ([100, 101, 95.999, 102, 103, 104], [(4, ELSEWHERE)]),
    ([100, 101, 107.01, 102, 103, 104, 105], [(4, ELSEWHERE)]),
    ([100, 101, 107, 102, 103, 104, 105], [(4, OUT_OF_ORDER)]),  # 5 s from the one after
    ([0, 1, 2, 3, 1.5, 100, 101], [(6, OUT_OF_ORDER)]),
    ([0, 1, 2, 101.5, 101, 101.2, 102], [(5, OUT_OF_ORDER)]),
    ([0, 1, 2, 50, 40, 41, 98, 99], [(5, ELSEWHERE)]),
    ([0, 1, 2, 2, 3, 3.5, 2, 4, 4, 5], [(8, OUT_OF_ORDER)]),
    ([10, 9, 11, 12, 13, 10.5], [(2, OUT_OF_ORDER), (7, OUT_OF_ORDER)]),
])  # fmt: skip
def test_a_time_out_of_order_is_within_five_seconds(
    seconds: list[float], wrong: list[tuple[int, str]]
) -> None:
    lines = np.arange(len(seconds))
    log = checked(depth=at(seconds, depth_m=lines))
    wrong_of = [(line, what) for line, what in found(log) if what in (OUT_OF_ORDER, ELSEWHERE)]
    assert wrong_of == wrong
    away = [line - 2 for line, what in wrong if what == ELSEWHERE]
    kept = sorted((i for i in lines if i not in away), key=lambda i: seconds[i])
    once = [i for k, i in enumerate(kept) if not k or seconds[i] > seconds[kept[k - 1]]]
    assert log.depth.tolist() == once
    assert [it.used for it in log.findings if it.what == OUT_OF_ORDER] == [True] * (
        len(wrong) - len(away)
    )


@pytest.mark.parametrize(("count", "few"), [(20, 3), (399, 3), (500, 5)])
@pytest.mark.parametrize("gap", [3600.0, 3600.001])
@pytest.mark.parametrize("more", [0, 1])
@pytest.mark.parametrize("end", ["first", "last"])
def test_at_most_a_hundredth_of_the_rows_or_three_are_far_at_an_end(
    count: int, few: int, gap: float, more: int, end: str
) -> None:
    apart = few + more if end == "first" else count - few - more
    seconds = [k + (gap - 1 if k >= apart else 0) for k in range(count)]
    log = checked(depth=at(seconds))
    assert len(log.depth) == count - (few if gap > 3600 and not more else 0)
    assert {what for _, what in found(log)} <= {ELSEWHERE}


def test_a_short_log_has_no_far_ends() -> None:
    """Where most rows are at one of the ends, nobody knows which are wrong."""
    assert len(checked(depth=at([0, 1, 9000, 9001, 9002])).depth) == 5
    assert len(checked(depth=at([0, 1, 9000, 9001, 9002, 9003])).depth) == 4
    assert len(checked(depth=at([0, 9000, 9001, 9002, 9003, 20_000])).depth) == 4
    assert len(checked(depth=at([0, 9000, 9001, 9002, 20_000])).depth) == 5


def test_beacons_are_in_the_order_of_their_statement_then_of_their_numbers() -> None:
    heard = ["B10", "Z", "B9", "A10", "C", "L2", "B", "nowhere"]
    places = {f"reported_{axis}_m": [k, 2 * k, 3 * k] * 2 + [k, np.nan]
              for k, axis in ((1.0, "n"), (2.0, "e"), (3.0, "d"))}  # fmt: skip
    log = checked(
        {"arms_m": {"L2": [0.5, 0.25, 1.0], "A": [0.0, 0.0, 1.0]}},
        receptions={"arrival_ns": np.arange(1, 9) * S, "beacon": heard, "range_m": [5.0] * 8}
        | places,
    )
    assert log.beacons == ("A", "B", "C", "L2", "Z", "B9", "A10", "B10")
    assert [log.beacons[i] for i in log.receptions.beacon] == heard[:-1]
    assert found(log) == [(9, "a beacon without a position")]
    assert log.receptions.beacon_position[1].tolist() == [2, 4, 6]
    assert log.receptions.has_pose.tolist() == [False] * 7
    silent = checked({"arms_m": {"L2": [0.5, 0.25, 1.0], "A": [0.0, 0.0, 1.0]}}, depth=at([1, 2]))
    assert silent.beacons == ("A", "B", "C", "L2")
    assert silent.receptions.packet.shape == (0, 4, 3)
    assert (silent.kinds, silent.turnaround_s) == ({}, 0.0)


def test_a_beacon_on_an_arm_is_where_the_pose_of_its_packet_puts_it() -> None:
    """Turned by 90° to the left; by its roll and pitch; and without a pose where it is stated."""
    quarter = np.pi / 2
    log = checked(
        {"arms_m": {"L": [2.0, 3.0, 4.0], "A": [9.0, 9.0, 9.0]}},
        receptions={
            "arrival_ns": [S, 2 * S, 3 * S, 4 * S, 5 * S, 6 * S], "beacon": list("LLLALB"),
            "range_m": [5.0] * 6,
            "platform_n_m": [10.0, 10.0, 10.0, 10.0, 10.0, None],
            "platform_e_m": [20.0] * 6, "platform_d_m": [1.0] * 6,
            "platform_roll_rad": [0.0, quarter, 0.0, 0.0, np.nan, 0.0],
            "platform_pitch_rad": [0.0, 0.0, quarter, 0.0, 0.0, 0.0],
            "platform_yaw_rad": [-quarter, 0.0, 0.0, 0.5, 0.0, 0.0],
            "packet_L_n_m": [1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
            "packet_B_d_m": [7.0, np.nan, 9.0, 10.0, 11.0, 12.0],
            "packet_X_e_m": [1.0] * 6,
        },
    )  # fmt: skip
    heard = log.receptions
    assert found(log) == [(6, "a beacon without a position")]
    np.testing.assert_allclose(
        heard.beacon_position,
        [(13, 18, 5), (12, 16, 4), (14, 23, -1), PLACES["A"], PLACES["B"]], atol=1e-12,
    )
    assert heard.has_pose.tolist() == [True, True, True, True, False]
    assert heard.platform_position.tolist() == [[10, 20, 1]] * 4 + [[0, 0, 0]]
    np.testing.assert_array_equal(
        heard.platform_attitude,
        [(0, 0, -quarter), (quarter, 0, 0), (0, quarter, 0), (0, 0, 0.5), (0, 0, 0)],
    )
    assert log.beacons == ("A", "B", "C", "L")
    assert heard.packet[:, 3].tolist() == [[k, 0, 0] for k in (1, 2, 3, 4, 6)]
    assert heard.packet[:, 1].tolist() == [[0, 0, k] for k in (7, 0, 9, 10, 12)]
    assert not heard.packet[:, [0, 2]].any()
    assert not log.remarks


def test_depths_have_their_limits() -> None:
    log = checked(depth={
        "time_ns": [S, "", 2 * S, 3 * S, 4 * S, 4 * S, 5 * S, 6 * S],
        "depth_m": [1e6, 4.0, "x", -2.0, 3.0, 4.0, 1_000_000.5, -2.01],
    }, receptions={"arrival_ns": [6 * S, 7 * S], "beacon": ["A", "B"], "range_m": [5.0, 6.0],
                   "kind": ["range", "range"]})  # fmt: skip
    far = "no depth_m within 1,000 km"
    assert found(log) == [
        (3, "no time"), (4, far), (8, far), (7, "a time that has a reading already"),
    ]
    assert log.depth.tolist() == [1e6, -2.0, 3.0, -2.01]
    assert log.depth_ns.tolist() == [S, 3 * S, 4 * S, 6 * S]
    assert log.remarks == (
        "depth.csv: depths should be under water (down is positive), got -2.01 m; 1 of 4 are more "
        "than 2 m above it",
    )


@pytest.mark.parametrize(("meta", "many"), [
    ({}, 1), ({"dimension": 2}, 0), ({"frame": {"truth": "estimate"}}, 0),
])  # fmt: skip
def test_a_truth_is_under_water_unless_it_is_turned(meta: dict[str, Any], many: int) -> None:
    log = checked(meta, truth={
        "time_ns": [S, 2 * S, 3 * S, 4 * S], "n_m": [0.0] * 4, "e_m": [1.0] * 4,
        "d_m": [5.0, -2.0, -2.5, -7.0],
    })  # fmt: skip
    said = (
        "truth.csv: true positions should be under water (down is positive), got -7 m; 2 of 4 are "
        "more than 2 m above it"
    )
    assert [it for it in log.remarks if "under water" in it] == [said] * many


@pytest.mark.parametrize(("late_ns", "told"), [
    ([0, -S, 500_000_000], None), ([0, 500_000_001, -S], "0.5 s after it; 1 of 3"),
    ([2 * S, 3 * S, 2 * S], "3 s after it; 3 of 3"),
])  # fmt: skip
def test_ranges_belong_to_a_time_before_they_are_heard(
    late_ns: list[int], told: str | None
) -> None:
    arrival = [10 * S, 20 * S, 30 * S]
    log = checked(receptions={
        "arrival_ns": arrival, "beacon": ["A", "B", "C"], "range_m": [5.0, 6.0, 7.0],
        "epoch_ns": [a + late for a, late in zip(arrival, late_ns, strict=True)],
    })  # fmt: skip
    said = f"receptions.csv: an epoch should be before the arrival, got one {told} are more than"
    assert [*log.remarks] == ([] if told is None else [f"{said} 0.5 s late"])


@pytest.mark.parametrize("apart", [0, 1, 5 * S])
def test_a_second_time_of_a_reception_is_not_used_and_told(apart: int) -> None:
    arrival = [10 * S, 20 * S, 30 * S]
    log = checked(receptions={
        "time_ns": [*arrival[:2], arrival[2] - apart], "arrival_ns": arrival,
        "beacon": ["A", "B", "C"], "range_m": [5.0, 6.0, 7.0],
    })  # fmt: skip
    assert log.receptions.arrival_ns.tolist() == arrival
    said = "receptions.csv: time_ns is not used beside arrival_ns, from which it differs"
    assert [*log.remarks] == [said] * (apart > 0)


@pytest.mark.parametrize(("first", "told_s"), [(7.0, None), (7.5, "0.5 s after"), (0.0, None),
                                               (-0.5, "0.5 s before")])
def test_depths_overlap_the_ranges_if_they_meet(first: float, told_s: str | None) -> None:
    log = checked(
        depth=at([first, first + 3]),
        receptions={"arrival_ns": [3 * S, 7 * S], "beacon": ["A", "B"], "range_m": [5.0, 6.0]},
    )
    assert log.remarks == (() if told_s is None else (
        "depth.csv: depths should be of the time of the ranges, got none: they are "
        f"{told_s} them",
    ))


def test_beacons_in_the_waves_are_not_dry() -> None:
    places = {"A": [0.0, 0.0, -2.0], "B": [0.0, 0.0, -2.5], "C": [1.0, 1.0, -30.0]}
    log = checked({"beacons": places}, depth=at([1]))
    assert log.remarks == (
        "meta.toml: beacons should be under water (down is positive), got B and C at depths of "
        "-2.5 and -30 m",
    )


def test_true_positions_with_and_without_velocities() -> None:
    columns: dict[str, Any] = {
        "time_ns": [S, 2 * S, 2 * S, 3 * S, 4 * S], "n_m": [1.0, 2.0, 9.0, -1e6, 3.0],
        "e_m": [4.0, 5.0, 9.0, 6.0, 1_000_001.0], "d_m": [7.0, 8.0, 9.0, 1e6, 3.0],
    }
    velocity = {f"velocity_{axis}_m_s": [k, k + 1, 9, k + 2, 9]
                for k, axis in ((0.5, "n"), (1.5, "e"), (2.5, "d"))}  # fmt: skip
    log = checked(truth=columns | velocity)
    assert found(log) == [(6, "no e_m within 1,000 km"), (4, "a time that has a position already")]
    assert log.truth is not None
    assert log.truth.time_ns.tolist() == [S, 2 * S, 3 * S]
    assert log.truth.position.tolist() == [[1, 4, 7], [2, 5, 8], [-1e6, 6, 1e6]]
    assert log.truth.velocity is not None
    assert log.truth.velocity.tolist() == [[0.5, 1.5, 2.5], [1.5, 2.5, 3.5], [2.5, 3.5, 4.5]]
    for part in ({"velocity_n_m_s": [1.0] * 5}, velocity | {"velocity_d_m_s": [1, "", 1, 1, 1]}):
        bare = checked(truth=columns | part).truth
        assert bare is not None
        assert bare.velocity is None
    assert checked(truth={name: [] for name in columns}).truth is None
    assert checked(truth={name: [""] for name in columns}).truth is None


def test_positions_of_devices_are_told_apart() -> None:
    log = checked(fixes={
        "time_ns": [S, S, 2 * S, 2 * S, 3 * S, 3 * S, 4 * S, 5 * S],
        "device": ["usbl", "gps", "usbl", "", "usbl", None, "gps", "none"],
        "n_m": [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0], "e_m": [10.0] * 8, "d_m": [0.5] * 8,
        "std_m": [0.1, 0.2, 0.3, "", "", "", 0.7, ""],
        "valid": [True] * 6 + [True, False],
    })  # fmt: skip
    assert [*log.fixes] == ["device", "gps", "usbl"]
    assert found(log) == [(9, "marked as not valid")]
    assert log.remarks == ("usbl: some positions have no std_m, so that none is used",)
    assert {name: it.position[:, 0].tolist() for name, it in log.fixes.items()} == {
        "device": [4, 6], "gps": [2, 7], "usbl": [1, 3, 5],
    }
    std = {name: it.position_std for name, it in log.fixes.items()}
    assert std["device"] is None
    assert std["usbl"] is None
    assert std["gps"] is not None
    assert std["gps"].tolist() == [[0.2] * 3, [0.7] * 3]
    assert (log.start_ns, log.stop_ns) == (S, 4 * S)
    bad = {"time_ns": [S, 2 * S], "device": ["bad", "gps"], "n_m": ["x", 2.0], "e_m": [1.0] * 2,
           "d_m": [1.0] * 2}  # fmt: skip
    assert [*checked(fixes=bad).fixes] == ["gps"]
    plain = checked(fixes={"time_ns": [S, S], "n_m": [1.0, 2.0], "e_m": [1.0] * 2, "d_m": [0] * 2})
    assert found(plain) == [(3, "a time that has a position already")]
    assert plain.fixes["device"].position.tolist() == [[1, 1, 0]]


def test_columns_that_say_nothing_are_named_with_what_may_be_meant() -> None:
    one = checked(depth=at([1], deph_m=[3.0], time_s=[1]))
    assert len(one.remarks) == 1
    assert one.remarks[0] == (
        "depth.csv: columns without a meaning in a log are not used: deph_m; did you mean "
        "'depth_m'?"
    )
    many = checked(depth=at([1], deph_m=[1], b=[1], c=[1], d=[1], e=[1], f=[1], g=[1]))
    assert many.remarks == (
        "depth.csv: columns without a meaning in a log are not used: deph_m, b, c, d, e and 2 more",
    )
    two = checked(depth=at([1], deph_m=[1], packet_A_x_m=[1]))
    assert two.remarks[0].endswith("not used: deph_m, packet_A_x_m")


def test_own_axes_are_said_of_what_is_in_the_log() -> None:
    """Estimates of receivers are along the axes of the beacons."""
    fixes = {"time_ns": [S, S], "device": ["usbl", "gps"], "n_m": [1.0] * 2, "e_m": [1.0] * 2,
             "d_m": [1.0] * 2}
    said = ("are forward, starboard and down, not north and east: their direction is not in the "
            "log")
    log = checked({"frame": {"own_axes": ["usbl", "other"]}}, fixes=fixes)
    assert log.remarks == (f"positions of usbl {said}",)
    assert [log.in_own_axes(it) for it in ("usbl", "gps", "receiver")] == [True, False, False]
    log = checked({"frame": {"own_axes": ["gps", "beacons"]}}, fixes=fixes)
    assert log.remarks == (f"positions of gps and the beacons {said}",)
    assert [log.in_own_axes(it) for it in ("usbl", "gps", "receiver")] == [False, True, True]
    assert checked({"frame": {"own_axes": ["other"]}}, fixes=fixes).remarks == ()


# --- What a log tells of itself -------------------------------------------------------------------


def small() -> Log:
    """Two beacons that are heard three times, with and without a pose."""
    log = checked(
        {"arms_m": {"A": [1.0, 0.0, 0.0]}},
        receptions={
            "arrival_ns": [50 * S, 51 * S, 52 * S], "epoch_ns": [42 * S, 41 * S, 41 * S],
            "beacon": ["A", "B", "A"], "range_m": [5.0, 6.0, 7.0],
            "platform_n_m": [10.0, None, 11.0], "platform_e_m": [20.0] * 3,
            "platform_d_m": [1.0] * 3, "platform_roll_rad": [0.1] * 3,
            "platform_pitch_rad": [0.2] * 3, "platform_yaw_rad": [0.3] * 3,
        },
        depth=at([43, 47.5, 60.25]),
    )  # fmt: skip
    assert not log.findings
    return log


def test_a_log_lasts_from_its_first_time_to_its_last_or_longer_if_it_says_so() -> None:
    log = small()
    assert (log.start_ns, log.stop_ns) == (41 * S, 60 * S + S // 4)
    for stated, expected in (((40, 61), (40, 61)), ((42, 60), (41, 60.25))):
        start, stop = (it * S for it in stated)
        said = replace(log, meta=log.meta.model_copy(update={"start_ns": start, "stop_ns": stop}))
        assert (said.start_ns / S, said.stop_ns / S) == expected
    usbl = Estimates(epoch_ns=np.array([30, 90]) * S, position=np.zeros((2, 3)))
    with_fixes = replace(log, fixes={"usbl": usbl})
    assert (with_fixes.start_ns, with_fixes.stop_ns) == (30 * S, 90 * S)
    true = Truth(time_ns=np.array([0, 100]) * S, position=np.zeros((2, 3)))
    assert replace(log, truth=true).stop_ns == log.stop_ns
    assert repr(log) == "<Log of 19 s: 3 ranges of 3 beacons, 3 depths>"
    empty = checked()
    assert (empty.start_ns, empty.stop_ns) == (0, 0)


def test_times_are_dates_from_2000_on() -> None:
    from_2000 = 946_684_800 * S
    assert [checked({"start_ns": it}).dated for it in (from_2000 - 1, from_2000)] == [False, False]
    fixes = {"n_m": [1.0], "e_m": [1.0], "d_m": [1.0]}
    dated = [checked(fixes=fixes | {"time_ns": [it]}).dated for it in (from_2000 - 1, from_2000)]
    assert dated == [False, True]
    clock = {"clock": {"truth": {"offset_s": "estimate"}}}
    assert [checked(meta).own_clock for meta in (None, clock)] == [False, True]


def test_a_log_is_called_by_its_path_and_its_name() -> None:
    log = replace(small(), name="dive")
    assert log.called == "dive"
    for source, called in (("a/dive", "a/dive"), ("a/dive.csv", "a/dive.csv"),
                           ("a/b.csv", "a/b.csv (dive)")):
        assert replace(log, source=source).called == called
    assert replace(log, name="dive.csv", source="a/dive.csv").called == "a/dive.csv"


def test_samples_are_in_the_order_of_their_epochs_and_from_the_start() -> None:
    log = small()
    it = log.samples()
    assert it.start_ns == 0
    assert (it.depth_ns / S).tolist() == [2, 6.5, 19.25]
    assert it.depth.tolist() == [5, 5, 5]
    assert (it.range_ns / S).tolist() == [0, 0, 1]
    assert it.beacon.tolist() == [0, 1, 0]
    assert it.range.tolist() == [7, 6, 5]
    assert it.has_pose.tolist() == [True, False, True]
    assert it.position.tolist() == [[11, 20, 1], PLACES["B"], [10, 20, 1]]
    assert it.attitude.tolist() == [[0.1, 0.2, 0.3], [0, 0, 0], [0.1, 0.2, 0.3]]
    own = log.samples(OWN)
    assert not own.has_pose.any()
    assert own.position.tolist() == [PLACES["A"], PLACES["B"], PLACES["A"]]
    assert not own.attitude.any()


def test_a_sentence_for_each_kind_of_finding_names_five_lines() -> None:
    flaws = [Flaw("a.csv", line, "odd") for line in (9, 2, 3, 4, 5)]
    flaws += [Flaw("a.csv", line, "odd", used=True) for line in (1, 2, 3, 4, 5, 6)]
    flaws += [Flaw("b.csv", line, "odd") for line in (7, 7, 8)]
    flaws += [Flaw("b.csv", 3, "even")]
    assert told(flaws) == [
        "a.csv: 5 lines left out: odd (lines 9, 2, 3, 4, 5)",
        "a.csv: 6 lines put right: odd (lines 1, 2, 3, 4, 5, …)",
        "b.csv: 3 values left out: odd (lines 7, 8)",
        "b.csv: 1 line left out: even (line 3)",
    ]
    assert replace(small(), findings=tuple(flaws)).counted() == told(flaws)


# --- The log of a run -----------------------------------------------------------------------------

START = 10 * S


def record(**changed: Any) -> Record:
    """Five instants, 0.25 s apart, of a run with two beacons; None: without that output."""
    instants = 5
    each = np.arange(instants * 6, dtype=float).reshape(instants, 2, 3)
    values: dict[str, Any] = {
        "acoustics.range": np.arange(10.0).reshape(5, 2) + 0.5,
        "acoustics.range_epoch": 10 + np.array(
            [[0, 0], [0, 0], [0.125, 0.1], [0.125, 0.1], [0.75, 0.625]]),
        "acoustics.reception_count": np.array([[0, 1], [0, 1], [1, 3], [1, 3], [2, 4]], np.int32),
        "acoustics.ping_beacon_position": each + 100,
        "acoustics.ping_platform_position": np.where(each == 14, 0, each) * 0,
        "acoustics.ping_platform_attitude": np.zeros((5, 2, 3)),
        "acoustics.packet_beacon_position": np.arange(60.0).reshape(5, 2, 2, 3)[:, :, 0],
        "acoustics.arrival_epoch": 10 + np.array(
            [[0, 0], [0, 0], [0.4000000001, 0.25], [0.4, 0.2], [0.9, 0.8]]),
        "target.depth": np.array([1.0, 2.0, 3.0, 4.0, 5.0]),
        "target.depth_epoch": 10 + np.array([0, 0.25, 0.25, 0.625, 1.0]),
        "target.position": np.arange(15.0).reshape(5, 3), "target.velocity": np.ones((5, 3)),
        "platform.position": np.zeros((5, 3)), "platform.beacon_position": np.zeros((5, 2, 3)),
        "platform.reported_beacon_position": np.zeros((5, 2, 3)),
    }  # fmt: skip
    values["acoustics.ping_platform_position"][2, 0] = 7, 0, 0
    values["acoustics.ping_platform_attitude"][2, 1] = 0, 0, 0.5
    values = {name: it for name, it in (values | changed).items() if it is not None}
    return Record(time_ns=START + np.arange(5) * (S // 4), values=values)


def test_the_log_of_a_run_has_each_packet_once_in_the_order_of_its_arrival() -> None:
    log = simulated.of_record(record(), name="dive", title="A dive", sound_speed=1480.0,
                              origin=Origin(36.5, -4.5, 12.0), kind="two-way")
    assert log.name == "dive"
    assert log.beacons == ("1", "2")
    heard = log.receptions
    assert heard.beacon.tolist() == [1, 1, 0, 1, 0]
    assert (heard.arrival_ns - START).tolist() == [
        0, S // 4 + 1, 400_000_001, 800_000_000, 900_000_000,
    ]
    assert (heard.epoch_ns - START).tolist() == [0, S // 10, S // 8, 5 * S // 8, 3 * S // 4]
    assert heard.range.tolist() == [1.5, 5.5, 4.5, 9.5, 8.5]
    assert {KINDS[k] for k in heard.kind} == {"two-way"}
    each = np.arange(30.0).reshape(5, 2, 3) + 100
    rows, columns = [0, 2, 2, 4, 4], [1, 1, 0, 1, 0]
    assert heard.beacon_position.tolist() == each[rows, columns].tolist()
    assert heard.has_pose.tolist() == [False, True, True, False, False]
    assert heard.platform_position[2].tolist() == [7, 0, 0]
    assert heard.platform_attitude[1].tolist() == [0, 0, 0.5]
    assert heard.packet.tolist() == (
        np.arange(60.0).reshape(5, 2, 2, 3)[rows, :, 0].tolist()
    )
    assert heard.line.tolist() == [0] * 5
    assert ((log.depth_ns - START) / S).tolist() == [0.25, 0.625, 1.0]
    assert log.depth.tolist() == [2, 4, 5]
    assert log.truth is not None
    assert log.truth.position.tolist() == np.arange(15.0).reshape(5, 3).tolist()
    assert log.truth.time_ns.tolist() == record().time_ns.tolist()
    assert (log.start_ns, log.stop_ns) == (START, START + S)
    assert log.meta == Meta.model_validate({
        "name": "dive", "title": "A dive", "sound_speed_m_s": 1480.0, "start_ns": START,
        "stop_ns": START + S, "source": "a simulation",
        "origin": {"latitude_deg": 36.5, "longitude_deg": -4.5, "height_m": 12.0},
    })  # fmt: skip


def test_the_log_of_a_run_without_poses_packets_and_arrivals() -> None:
    log = simulated.of_record(record(**dict.fromkeys((
        "acoustics.ping_platform_position", "acoustics.packet_beacon_position",
        "acoustics.arrival_epoch"))), name="dive")  # fmt: skip
    heard = log.receptions
    assert (heard.arrival_ns - START).tolist() == [0, S // 2, S // 2, S, S]
    assert heard.beacon.tolist() == [1, 0, 1, 0, 1]
    assert heard.packet.shape == (5, 2, 3)
    assert not heard.packet.any()
    assert not heard.has_pose.any()
    assert heard.platform_position.shape == heard.platform_attitude.shape == (5, 3)
    assert {KINDS[k] for k in heard.kind} == {"one-way"}
    assert (log.meta.origin, log.meta.sound_speed_m_s) == (None, 1500.0)


def test_an_arrival_is_after_the_instant_before_its_packet_and_not_after_that_with_it() -> None:
    late = 10 + np.array([[0, 0.5], [0, 0], [0.1, 0.6], [0, 0], [0.75, 1.0]])
    log = simulated.of_record(record(**{"acoustics.arrival_epoch": late}), name="dive")
    found = sorted(zip(log.receptions.range, log.receptions.arrival_ns - START, strict=True))
    assert found == [(1.5, 0), (4.5, S // 4 + 1), (5.5, S // 2), (8.5, 3 * S // 4 + 1), (9.5, S)]


@pytest.mark.parametrize("lacking", ["acoustics.range", "target.depth_epoch", "target.velocity"])
def test_a_record_of_something_else_is_no_dive(lacking: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        simulated.of_record(record(**{lacking: None}), name="dive")
    assert str(caught.value) == (
        f"record: must be that of a scenario, to be written as a log, got no {lacking}"
    )


# --- Units of times -------------------------------------------------------------------------------


def pings(step_ns: int, count: int = 24, **others: Any) -> dict[str, Any]:
    """Receptions of three beacons in turn; those of one beacon are `step_ns` apart."""
    return {
        "arrival_ns": [10 * S + k * step_ns // 3 for k in range(count)],
        "beacon": ["A", "B", "C"] * (count // 3), "range_m": [20.0] * count, **others,
    }  # fmt: skip


@pytest.mark.parametrize(("step_ns", "got"), [
    (4_000, "every 4.00 µs; as milliseconds, with the name arrival_ms, it would be every 4.00 s"),
    (30, "every 0.0300 µs; as seconds, with the name arrival_s, it would be every 30.0 s"),
    (300_000, "every 300 µs; as microseconds, with the name arrival_us, it would be every 0.300 s"),
    (499_998, "every 500 µs; as microseconds, with the name arrival_us, it would be every 0.500 s"),
])  # fmt: skip
def test_times_faster_than_any_device_are_of_another_unit(step_ns: int, got: str) -> None:
    with pytest.raises(ConfigurationError) as refused:
        checked(receptions=pings(step_ns))
    assert str(refused.value) == (
        "receptions.csv: arrival_ns: must be in nanoseconds, got a range of a beacon " + got
    )


def test_the_column_with_the_wrong_unit_is_named() -> None:
    right = [k * S for k in range(24)]
    with pytest.raises(ConfigurationError, match=r"^receptions.csv: epoch_ns: must be in nanos"):
        checked(receptions=pings(3 * S, epoch_ns=[k * 1000 for k in range(24)]))
    fast = pings(3000)
    fast["time_ms"] = [it / 1e6 for it in fast.pop("arrival_ns")]
    with pytest.raises(ConfigurationError, match=r"csv: time_ms: must be in milliseconds, .* "
                                                 r"as seconds, with the name time_s, "):
        checked(receptions=fast)
    for name, one in (("depth", "a depth"), ("truth", "a true position"), ("fixes", "a position")):
        columns = ("depth_m",) if name == "depth" else ("n_m", "e_m", "d_m")
        table = {"time_ns": [k // 1_000_000 for k in right], **dict.fromkeys(columns, [1.0] * 24)}
        with pytest.raises(ConfigurationError, match=rf"^{name}.csv: time_ns: .* got {one} every"):
            checked(receptions=pings(3 * S), **{name: table})


def test_fast_devices_echoes_repeats_and_pings_at_once_are_no_other_unit() -> None:
    assert len(checked(receptions=pings(500_001)).receptions) == 24
    assert len(checked(receptions=pings(4000, 6)).receptions) == 6  # 2 of each: too few
    at_once = pings(3 * S)
    at_once["arrival_ns"] = [k // 3 * S for k in range(24)]
    assert len(checked(receptions=at_once).receptions) == 24
    echoes = pings(3 * S, 240)
    echoes["arrival_ns"] = [k // 24 * S + k % 24 // 3 * 1000 + k % 3 for k in range(240)]
    assert len(checked(receptions=echoes).receptions) == 240  # seven after each ping
    again = pings(3 * S)
    again["arrival_ns"] = [k // 12 * S for k in range(24)]
    assert len(checked(receptions=again).receptions) == 6


def test_numbers_with_a_decimal_comma_are_told_with_the_key_that_reads_them() -> None:
    log = checked(
        receptions=pings(3 * S, 6, range_m=["20,5", "20.5", " ,5", "2,5,1", "a,5", "-1,5e2"]),
        depth={"time_ns": [S, 2 * S, 3 * S], "depth_m": ["3,5", "3.5", "x"]},
        truth={"time_ns": [S, 2 * S], "n_m": ["1", "1,0"], "e_m": ["1,0", "1"], "d_m": ["1", "1"]},
    )
    said = 'a number with a decimal comma, which decimal = "," in [mapping.{}] reads'
    lines = {(it.table, it.line): it.what for it in log.findings}
    assert lines == {
        **{("receptions", line): said.format("receptions") for line in (2, 4, 7)},
        **{("receptions", line): "a number that cannot be read" for line in (5, 6)},
        ("depth", 2): said.format("depth"), ("depth", 4): "no depth_m within 1,000 km",
        ("truth", 2): said.format("truth"), ("truth", 3): said.format("truth"),
    }
