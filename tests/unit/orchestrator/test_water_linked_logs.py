"""Captures of the Water Linked API: ranges, fixes, repeats, zeros, axes, the topside's pose."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import log_samples
import numpy as np
import pytest
from recorded_sets import RECORDED
from sblcosim import ConfigurationError, read_log
from sblcosim.logs import water_linked
from sblcosim.logs.log import Log
from sblcosim.logs.times import MISSING
from sblcosim.logs.water_linked import OWN_AXES
from sblcosim.tracks.place import Origin

T0 = 1_700_000_000
RECEIVERS = [{"id": 2, "x": 0, "y": 3, "z": 1}, {"id": 1, "x": 2, "y": 0, "z": 1},
             {"id": 3, "x": -2, "y": -3, "z": 1}]  # fmt: skip


def _read(folder: Path, polls: list[Any], meta: str = "") -> Log:
    (folder / "dive.jsonl").write_text("".join(json.dumps(it) + "\n" for it in polls))
    if meta:
        (folder / "meta.toml").write_text(meta)
    return read_log(folder / "dive.jsonl")


def _poll(second: float, path: str, body: Any) -> dict[str, Any]:
    return {"time": T0 + second, "path": path, "body": body}


def _acoustic(second: float, *ranges: float, path: str = "raw", **more: Any) -> dict[str, Any]:
    body = {"x": 4.0 + second, "y": 1.0, "z": 2.5, "position_valid": True, "std": 0.3,
            "receiver_distance": list(ranges)} | more  # fmt: skip
    return _poll(second, f"position/acoustic/{path}", body)


@pytest.mark.parametrize("name", ["capture", "array"])
def test_a_capture_gives_ranges_depths_and_fixes(tmp_path: Path, name: str) -> None:
    make, file = log_samples.SAMPLES[name]
    (tmp_path / file).write_text(make()[file])
    log = read_log(tmp_path / file)
    heard = log.receptions
    names = dict(zip(("R0", "R1", "R2", "R3"), log_samples.BEACONS, strict=True))
    found = {
        ((int(time) - log_samples.START_NS) // 500_000_000, names[log.beacons[b]]): r
        for time, b, r in zip(heard.arrival_ns, heard.beacon, heard.range, strict=True)
    }
    expected = {(k, b): r for k, b, r in log_samples.ranges()}
    del expected[7, "B2"], expected[9, "B3"]  # no data; not valid
    assert found == expected
    np.testing.assert_array_equal(
        heard.beacon_position, [log_samples.BEACONS[names[log.beacons[b]]] for b in heard.beacon]
    )
    # sound arrives after the ping, by the time of flight
    late = np.rint(heard.range / 1500 * 1e9).astype(int)
    assert (heard.arrival_ns - heard.epoch_ns == late).all()
    assert len(log.depth) == log_samples.PINGS - 4
    assert Counter(it.what for it in log.findings) == {
        "a value that was only read again": 4 * 4 + 4, "no data (-1)": 1,
        "marked as not valid": 1 + 4,
    }
    np.testing.assert_allclose(
        log.fixes["acoustic raw"].position,
        [log_samples.place(k) for k in range(4, log_samples.PINGS)],
    )
    assert log.fixes["acoustic raw"].position_std is not None
    assert "4 of 85 answers (4.7 %) only repeat the one before" in log.remarks


def test_positions_on_earth_give_the_origin(tmp_path: Path) -> None:
    (tmp_path / "dive.jsonl").write_text(log_samples.capture()["dive.jsonl"])
    log = read_log(tmp_path / "dive.jsonl")
    place = log.meta.place
    assert place is not None
    back = place.geographic(log.fixes["global"].position)[:, :2]
    truth = Origin(*log_samples.ORIGIN).geographic(
        np.array([log_samples.place(k) for k in range(log_samples.PINGS)])
    )[:, :2]
    np.testing.assert_allclose(back, truth, atol=1e-9)
    assert any("the log has no origin: it is the first position" in it for it in log.remarks)


def test_a_position_on_earth_has_the_depth_before_it_in_any_order_of_lines(tmp_path: Path) -> None:
    polls = [_acoustic(k, 5.0 + k, 6.0, 7.0, z=2.0 + k) for k in range(6)]
    polls += [_poll(k + 0.5, "position/global", {"lat": 60.0 + k / 1e5, "lon": 5.0})
              for k in range(6)]  # fmt: skip
    for order in (range(12), np.random.default_rng(3).permutation(12)):
        log = _read(tmp_path, [polls[i] for i in order])
        down = dict(zip(log.fixes["global"].epoch_ns, log.fixes["global"].position[:, 2],
                        strict=True))  # fmt: skip
        np.testing.assert_allclose([down[key] for key in sorted(down)], range(2, 8), atol=1e-4)


def test_receivers_are_numbered_as_their_ranges(tmp_path: Path) -> None:
    log = _read(tmp_path, [_poll(0, "/api/v1/config/receivers", RECEIVERS),
                           _acoustic(1, 5.0, 6.0, 7.0)])
    assert log.beacons == ("R0", "R1", "R2")
    assert log.receptions.range[np.argsort(log.receptions.beacon)].tolist() == [5, 6, 7]
    assert log.meta.beacons == {"R0": (2, 0, 1), "R1": (0, 3, 1), "R2": (-2, -3, 1)}


@pytest.mark.parametrize(("lat", "lon", "is_a_place"), [
    (0.0, 180.0, True), (-10.0, -180.0, True), (10.0, 180.1, False), (90.1, 0.0, False),
])
def test_a_place_may_be_where_the_date_changes(
    lat: float, lon: float, is_a_place: bool, tmp_path: Path
) -> None:
    log = _read(tmp_path, [
        _poll(0, "config/receivers", RECEIVERS), _acoustic(0.5, 5.0, 6.0, 7.0),
        _poll(1, "position/master", {"lat": lat, "lon": lon, "orientation": 0}),
        _acoustic(2, 5.5, 6.0, 7.0),
    ])  # fmt: skip
    assert (log.meta.place == Origin(lat, lon)) == is_a_place


def test_the_explorer_kit_has_other_axes(tmp_path: Path) -> None:
    log = _read(
        tmp_path, [_poll(0, "config/receivers", RECEIVERS), _acoustic(1, 5.0, 6.0, 7.0)],
        '[mapping]\naxes = "starboard-forward-down"\n',
    )
    assert log.meta.beacons == {"R0": (0, 2, 1), "R1": (3, 0, 1), "R2": (-3, -2, 1)}
    assert log.fixes["acoustic raw"].position.tolist() == [[1, 5, 2.5]]


def test_the_pose_of_the_topside_unit_places_everything_on_earth(tmp_path: Path) -> None:
    north = Origin(60.0, 5.0).geographic(np.array([[10.0, 0, 0]]))[0]
    log = _read(tmp_path, [
        _poll(0, "config/receivers", RECEIVERS),
        _acoustic(0.5, 5.0, 6.0, 7.0),
        _poll(1, "position/master", {"lat": 60.0, "lon": 5.0, "orientation": 0}),
        _poll(1.5, "position/master", {"lat": north[0], "lon": north[1], "orientation": 30.0}),
        _poll(1.6, "position/master", {"lat": 91.0, "lon": 5.0, "orientation": 200.0}),
        _acoustic(2, 5.5, 6.0, 7.0),
        _poll(2.1, "position/global", {"lat": 60.0, "lon": 5.0}),
        _acoustic(60, 5.7, 6.0, 7.0),
    ])  # fmt: skip
    assert log.meta.place == Origin(60.0, 5.0)
    c, s = np.cos(np.radians(30)), np.sin(np.radians(30))
    np.testing.assert_allclose(  # 6 m forward, 1 m to starboard
        log.fixes["acoustic raw"].position, [[10 + 6 * c - s, 6 * s + c, 2.5]], atol=1e-6
    )
    np.testing.assert_allclose(log.fixes["global"].position, [[0, 0, 2.5]], atol=1e-6)
    heard = log.receptions
    assert heard.line.tolist() == [6, 6, 6]
    np.testing.assert_allclose(heard.platform_attitude, [[0, 0, np.pi / 6]] * 3)
    order = np.argsort(heard.beacon)
    np.testing.assert_allclose(
        heard.beacon_position[order],
        [[10 + 2 * c, 2 * s, 1], [10 - 3 * s, 3 * c, 1], [10 - 2 * c + 3 * s, -2 * s - 3 * c, 1]],
        atol=1e-6,
    )
    # before the first pose, and more than 5 s after the last, ranges and fixes have no place
    assert Counter((it.line, it.what) for it in log.findings if it.line in (2, 8)) == {
        (line, what): n for line in (2, 8) for what, n in (
            ("a beacon without a position", 3),
            ("no numbers, or no position of the topside unit at that time", 1),
        )
    }


@pytest.mark.parametrize("first", [(10.0, 5.0), (58.8, 5.0), (60.0, 6.5)])
def test_a_first_position_of_the_topside_unit_far_from_the_others_is_no_origin(
    first: tuple[float, float], tmp_path: Path
) -> None:
    places = [first, (60.0, 5.0), (60.00001, 5.0), (60.00002, 5.0)]
    log = _read(tmp_path, [
        _poll(0, "config/receivers", RECEIVERS),
        *(_poll(1 + n, "position/master", {"lat": lat, "lon": lon, "orientation": 0})
          for n, (lat, lon) in enumerate(places)),
        _acoustic(3.5, 5.0, 6.0, 7.0),
    ])  # fmt: skip
    assert log.meta.place == Origin(60.0, 5.0)


def test_filtered_ranges_count_only_without_raw_ones(tmp_path: Path) -> None:
    setup = _poll(0, "config/receivers", RECEIVERS)
    filtered = _acoustic(1, 1.0, 2.0, 3.0, path="filtered")
    log = _read(tmp_path, [setup, filtered, _acoustic(1.1, 5.0, 6.0, 7.0)])
    assert sorted(log.receptions.range.tolist()) == [5, 6, 7]
    assert {*log.fixes} == {"acoustic raw", "acoustic filtered"}
    log = _read(tmp_path, [setup, filtered])
    assert sorted(log.receptions.range.tolist()) == [1, 2, 3]


def test_zeros_and_minus_ones_are_no_positions(tmp_path: Path) -> None:
    nothing = {"x": 0, "y": 0, "z": 0, "position_valid": True}
    log = _read(tmp_path, [
        _acoustic(1, **nothing), _acoustic(2, **{**nothing, "x": -1, "y": -1, "z": -1}),
        _acoustic(3, x=0, y=0, z=3.0), _acoustic(4, position_valid=False),
    ])  # fmt: skip
    assert log.fixes["acoustic raw"].position.tolist() == [[0, 0, 3]]
    assert log.depth.tolist() == [3.0]
    assert [(it.line, it.what) for it in log.findings] == [
        (1, "zeros or -1: no position yet"), (2, "zeros or -1: no position yet"),
        (4, "marked as not valid"),
    ]


@pytest.mark.parametrize(("key", "value", "expected"), [
    ("time_ns", 1637328581171485697, 1637328581171485697),
    ("time", 1637328581.25, 1637328581_250000000),
    ("timestamp", 1637328581250, 1637328581_250000000),
    ("time", "1637328581", 1637328581_000000000),
    ("time", "2021-11-19T13:29:41.25Z", 1637328581_250000000),
    ("time_ms", 1637328581250.5, 1637328581_250500000),
])  # fmt: skip
def test_times_of_polls(tmp_path: Path, key: str, value: Any, expected: int) -> None:
    log = _read(tmp_path, [{key: value, "path": "position/acoustic/raw",
                            "body": {"x": 1, "y": 2, "z": 3}}])
    assert log.fixes["acoustic raw"].epoch_ns.tolist() == [expected]


@pytest.mark.parametrize(("digits", "words", "unit_ns"), [
    (1, "seconds", 10**9), (9, "seconds", 10**9), (11, "seconds", None),
    (12, "milliseconds", 10**6), (14, "milliseconds", None), (15, "microseconds", 1000),
    (17, "microseconds", None), (18, "nanoseconds", 1), (20, "nanoseconds", None),
    (21, "nanoseconds", None),
])  # fmt: skip
def test_times_without_a_unit_have_that_of_their_digits(
    tmp_path: Path, digits: int, words: str, unit_ns: int | None
) -> None:
    """With the usual number of them; times that are too late for any clock are none."""
    time = 2 * 10 ** (digits - 1)
    polls = [{"time": it, "path": "position/acoustic/raw", "body": {"x": k, "y": 2, "z": 3}}
             for k, it in enumerate((time, f"{time}.5", 3 * 10**24))]  # fmt: skip
    polls.append({"path": "config/receivers", "body": []})
    raw = water_linked.raw_of(tmp_path / "it.json", json.dumps(polls), {}, "")
    assert raw.remarks[0] == f"times have {digits} digits and are taken for {words}"
    if unit_ns is None:
        assert [it.what for it in raw.findings] == ["no time"] * 3
        return
    found = raw.tables["fixes"]["time_ns"].tolist()
    half = [] if unit_ns == 1 else [time * unit_ns + unit_ns // 2]
    assert found == [time * unit_ns, *half]
    assert MISSING not in found


def test_marks_of_receivers_and_repeats_of_ranges(tmp_path: Path) -> None:
    """Ranges may repeat beside a new position; those without a mark are valid."""
    places = "\n".join(f"R{i} = [{i}, 0, 1]" for i in range(5))
    marks = {"receiver_valid": [1.0, 0.0, True, False]}
    log = _read(tmp_path, [
        _acoustic(1, 5.0, 6.0, 7.0, 8.0, 9.0, **marks),
        _acoustic(2, 5.0, 6.0, 7.0, 8.0, 9.0, **marks),
        _acoustic(3, -1.0, 6.5, -1, 8.5, 9.5, receiver_valid=[1, 1, 1, 1, 0.5]),
        _acoustic(4, receiver_valid=[1]), _acoustic(5),
        _acoustic(6, 5.0, 6.0, receiver_valid="x"),
    ], f"[beacons]\n{places}\n")  # fmt: skip
    again, out = "a value that was only read again", "marked as not valid"
    assert Counter((it.line, it.what, it.of) for it in log.findings) == Counter([
        *((1, out, f"R{i}") for i in (1, 3)), *((2, out, f"R{i}") for i in (1, 3)),
        *((2, again, f"R{i}") for i in (0, 2, 4)),
        (3, "no data (-1)", "R0"), (3, "no data (-1)", "R2"),
    ])
    heard = log.receptions
    assert [(line, log.beacons[b], r) for line, b, r in
            zip(heard.line.tolist(), heard.beacon, heard.range, strict=True)] == [
        (1, "R0", 5), (1, "R2", 7), (1, "R4", 9), (3, "R1", 6.5), (3, "R3", 8.5), (3, "R4", 9.5),
        (6, "R0", 5), (6, "R1", 6),
    ]  # fmt: skip
    assert len(log.depth) == 6


def test_depths_are_those_of_positions(tmp_path: Path) -> None:
    log = _read(tmp_path, [
        _acoustic(1, z=2.0), _acoustic(2, z=3.0, position_valid=False),
        _acoustic(3, x=-1, y=-1, z=-1), _acoustic(4, x=-1, y=-1, z=4.0),
        _acoustic(5, x=0, y=0, z=0), _acoustic(6, x=0, y=5, z=0), _acoustic(7, x=None, z=5.0),
        _acoustic(8, z=6.0, std=0.0), _acoustic(8.5, z=6.0, std=0.0) | {"body": {
            **_acoustic(8, z=6.0, std=0.0)["body"]}},
    ])  # fmt: skip
    assert log.depth.tolist() == [2, 4, 0, 6]
    assert log.fixes["acoustic raw"].position[:, 2].tolist() == [2, 4, 0, 6]
    assert "1 of 9 answers (11 %) only repeat the one before" in log.remarks
    assert log.fixes["acoustic raw"].position_std is None  # the last has none
    assert [(it.line, it.what) for it in log.findings if it.line in (3, 5, 7)] == [
        (3, "zeros or -1: no position yet"), (5, "zeros or -1: no position yet"),
        (7, "no numbers, or no position of the topside unit at that time"),
    ]


@pytest.mark.parametrize(("age", "used"), [(-0.01, False), (0.0, True), (5.0, True), (5.01, False)])
def test_a_pose_of_the_topside_unit_counts_for_five_seconds(
    tmp_path: Path, age: float, used: bool
) -> None:
    log = _read(tmp_path, [
        _poll(0, "config/receivers", RECEIVERS),
        _poll(10, "position/master", {"lat": 60.0, "lon": 5.0, "orientation": 90.0}),
        _acoustic(10 + age, 5.5, 6.0, 7.0, x=3.0, y=2.0),
        _poll(11, "position/global", {"lat": 60.001, "lon": 5.0}),
    ])  # fmt: skip
    assert ("acoustic raw" in log.fixes) == used
    assert len(log.receptions) == 3 * used
    if used:
        np.testing.assert_allclose(log.fixes["acoustic raw"].position, [[-2, 3, 2.5]], atol=1e-6)


@pytest.mark.parametrize(("body", "sound"), [
    ({"lat": 60.0, "lon": 5.0, "orientation": 360.0}, True),
    ({"lat": 60.0, "lon": 5.0, "orientation": 360.5}, False),
    ({"lat": 60.0, "lon": 5.0, "orientation": -0.5}, False),
    ({"lat": 60.0, "lon": 5.0}, False), ({"lat": 0, "lon": 0, "orientation": 7.0}, False),
    ({"latitude": 0, "longitude": 5.0, "orientation": 0}, True), (None, False),
])  # fmt: skip
def test_a_pose_of_the_topside_unit_needs_its_place_and_direction(
    tmp_path: Path, body: dict[str, float] | None, sound: bool
) -> None:
    log = _read(tmp_path, [
        _poll(0, "config/receivers", RECEIVERS), _poll(1, "position/master", body),
        _acoustic(2, 5.5, 6.0, 7.0),
    ])  # fmt: skip
    said = "1 positions of the topside unit place its axes on Earth; its roll and pitch are " \
        "taken for 0"
    assert (said in log.remarks) == sound
    assert (log.meta.place is not None) == sound
    assert len(log.receptions) == 3
    assert log.receptions.has_pose.all() == sound


def test_a_position_on_earth_before_the_first_depth_has_none(tmp_path: Path) -> None:
    earth = {"lat": 60.0, "lon": 5.0}
    log = _read(tmp_path, [
        _poll(1, "position/global", earth), _acoustic(2, z=4.0),
        _poll(2, "position/global", {**earth, "std": 0.5}),
        _poll(3, "position/global", {**earth, "lat": 60.00001}), _acoustic(4, z=6.0),
    ])  # fmt: skip
    np.testing.assert_allclose(log.fixes["global"].position[:, 2], [0, 4, 4], atol=1e-5)


def test_damaged_answers_are_counted_with_their_lines(tmp_path: Path) -> None:
    sound = [_acoustic(k) for k in range(6)]
    lines = [json.dumps(it) for it in sound]
    lines[1] = lines[1][:40]
    lines[2] = json.dumps({"path": "position/acoustic/raw", "body": {}})
    lines[3] = json.dumps({"time": T0, "body": {"lat": 1}})
    lines.insert(4, "42")
    lines.append(json.dumps(_poll(9, "/about/status", {})))
    (tmp_path / "dive.jsonl").write_text("\n".join(lines))
    log = read_log(tmp_path / "dive.jsonl")
    assert sorted((it.line, it.what) for it in log.findings) == [
        (2, "damaged"), (3, "no time"), (4, "no path of an endpoint"), (5, "damaged"),
    ]
    assert len(log.fixes["acoustic raw"]) == 3
    assert "1 answer of about/status not used" in log.remarks


def test_a_body_may_be_a_text_or_stand_beside_the_time(tmp_path: Path) -> None:
    body = {"x": 1, "y": 2, "z": 3}
    log = _read(tmp_path, [
        {"time": T0, "path": "http://192.168.2.94/api/v1/position/acoustic/raw?a=1",
         "body": json.dumps(body)},
        {"time": T0 + 1, "path": "/api/v1/position/acoustic/raw", **body, "z": 4},
    ])  # fmt: skip
    assert log.fixes["acoustic raw"].position.tolist() == [[1, 2, 3], [1, 2, 4]]


def test_an_answer_beside_the_time_repeats_too(tmp_path: Path) -> None:
    body = {"path": "position/acoustic/raw", "x": 1, "y": 2, "z": 3}
    log = _read(tmp_path, [{"time": T0 + k, **body} for k in range(3)])
    assert [it.line for it in log.findings] == [2, 3]


def test_ranges_without_places_of_receivers_are_not_silent(tmp_path: Path) -> None:
    log = _read(tmp_path, [_acoustic(1, 5.0, 6.0)])
    assert len(log.receptions) == 0
    assert Counter(it.what for it in log.findings) == {"a beacon without a position": 2}
    assert any("ranges cannot be used without positions of the receivers" in r for r in log.remarks)
    log = _read(tmp_path, [_acoustic(1, 5.0, 6.0)], "[beacons]\nR0 = [0, 0, 1]\nR1 = [3, 0, 1]\n")
    assert len(log.receptions) == 2
    log = _read(
        tmp_path,
        [_poll(0.5, "position/master", {"lat": 60.0, "lon": 5.0, "orientation": 90.0}),
         _acoustic(1, 5.0, 6.0)],
        "[arms_m]\nR0 = [1, 0, 1]\nR1 = [3, 0, 1]\n",
    )
    np.testing.assert_allclose(
        log.receptions.beacon_position[np.argsort(log.receptions.beacon)], [[0, 1, 1], [0, 3, 1]],
        atol=1e-9,
    )


def test_the_place_of_an_antenna_is_not_that_of_its_receivers(tmp_path: Path) -> None:
    antenna = _poll(0.5, "config/antenna", {"x": 1, "y": 0, "depth": 2, "antenna_rotation": 90})
    log = _read(tmp_path, [antenna, antenna, _acoustic(1, 5.0, 6.0)])
    assert len(log.receptions) == 0
    assert any(it.endswith("; config/antenna has one place for all of them") for it in log.remarks)
    assert not any("not used" in it for it in log.remarks)
    log = _read(tmp_path, [antenna, _acoustic(1, 5.0, 6.0)], "[beacons]\nR0 = [0, 0, 1]\n")
    assert not any("config/antenna" in it for it in log.remarks)


def test_an_answer_without_a_path_is_known_by_its_coordinates(tmp_path: Path) -> None:
    """It counts as filtered: it gives no ranges where there are raw ones, and other bodies none."""
    named = [_poll(0, "config/receivers", RECEIVERS), _acoustic(1, 5.0, 6.0, 7.0)]
    nameless = _acoustic(2, 8.0, 9.0, 10.0)
    del nameless["path"]
    other = {"time": T0 + 3, "body": {"x": 1.0, "y": 2.0, "receiver_distance": [1.0]}}
    log = _read(tmp_path, [*named, nameless, other, {"time": T0 + 4, "body": [1, 2, 3]}])
    assert sorted(log.fixes) == ["acoustic filtered", "acoustic raw"]
    assert log.fixes["acoustic filtered"].position[:, 0].tolist() == [6.0]
    assert sorted(log.receptions.range.tolist()) == [5.0, 6.0, 7.0]
    alone = _read(tmp_path, [named[0], nameless])
    assert sorted(alone.receptions.range.tolist()) == [8.0, 9.0, 10.0]


def test_receivers_may_be_polled_one_by_one(tmp_path: Path) -> None:
    places = {"id": 1, "x": 3, "y": 0, "z": 1}, {"id": 0, "x": 0, "y": 2, "z": 1}
    each = [_poll(0.5, f"config/receivers/{it['id']}", it) for it in places]
    log = _read(tmp_path, [*each, _acoustic(1, 5.0, 6.0)])
    assert log.meta.beacons == {"R0": (0, 2, 1), "R1": (3, 0, 1)}
    assert len(log.receptions) == 2


@pytest.mark.parametrize("count", [1, 3, 4, 9])
def test_the_first_three_other_paths_are_named(tmp_path: Path, count: int) -> None:
    names = [f"other/{letter}" for letter in "abcdefghi"[:count]]
    with pytest.raises(ConfigurationError) as caught:
        _read(tmp_path, [_poll(0.5 + n, name, {"x": n}) for n, name in enumerate(names)])
    got = str(caught.value).partition(", got ")[2]
    assert [name in got for name in names] == [n < 3 for n in range(count)]


@pytest.mark.parametrize("text", ["{}", "[]", '{"path": "position/global"', '{"a": 1}\n'])
def test_what_is_no_capture_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "it.json").write_text(text)
    with pytest.raises(ConfigurationError, match=r"it\.json: must be a capture with the paths"):
        read_log(tmp_path / "it.json")


@pytest.mark.skipif(
    not (RECORDED / "waterlinked_dive").is_dir(), reason="no recorded sets here"
)
def test_the_recorded_dive() -> None:
    log = read_log(RECORDED / "waterlinked_dive")
    repeats = Counter(it.file for it in log.findings if it.what.endswith("read again"))
    assert repeats == {"acoustic.csv": 393, "global.csv": 444}
    assert "acoustic.csv: 393 of 1,032 values (38 %) only repeat the one before" in log.remarks
    nothing = "acoustic.csv: 0 stands for no data, 146 times, 146 of them at the beginning"
    assert nothing in log.remarks
    acoustic, earth = log.fixes[OWN_AXES], log.fixes["global"]
    assert len(acoustic) == 638
    assert acoustic.epoch_ns[0] == 1637328731920952320
    assert acoustic.position[0].tolist() == [1.107379, 0.804558, 0.0944] or np.allclose(
        acoustic.position[0], [1.107379, 0.804558, 0.0944], atol=1e-5
    )
    assert np.any(acoustic.position != 0, axis=1).all()
    assert log.meta.place is not None
    assert log.meta.place.latitude_deg == 36.59737777709961
    assert np.abs(earth.position[:, :2]).max() < 20


def test_the_excerpt_of_a_dive_in_the_examples() -> None:
    folder = Path(__file__).parents[3] / "examples" / "logs" / "waterlinked_dive"
    log = read_log(folder)
    lines = (folder / "acoustic.csv").read_text().splitlines()[1:]
    values = [line.split(",", 1)[1] for line in lines]
    again = [a == b for a, b in zip(values[1:], values, strict=False)]
    repeats = Counter(it.file for it in log.findings if it.what.endswith("read again"))
    assert repeats["acoustic.csv"] == sum(again)
    sound = [value for value, same in zip(values, [False, *again], strict=True)
             if not same and value != "0,0,0"]  # fmt: skip
    np.testing.assert_array_equal(
        log.fixes[OWN_AXES].position,
        [[float(it) for it in value.split(",")] for value in sound],
    )
    assert log.meta.place is not None
    assert log.meta.licence == "Apache-2.0"
    assert "Apache License" in (folder / "LICENSE").read_text()
