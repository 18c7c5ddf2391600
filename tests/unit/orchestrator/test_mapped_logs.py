"""Tables with other columns, by a mapping: units, axes, times, repeats, and what is wrong."""

from __future__ import annotations

import os
from datetime import datetime
from pathlib import Path
from typing import Any

import log_samples
import numpy as np
import pandas as pd
import pytest
from recorded_sets import RECORDED, log_of, needs_recorded
from sblcosim import ConfigurationError, read_log
from sblcosim.data.truth import Truth
from sblcosim.logs.axes import AXES, to_ned
from sblcosim.logs.log import Log
from sblcosim.logs.times import MISSING, of_date, scaled
from sblcosim.tracks.place import Origin


def _log(folder: Path, mapping: str, **files: str) -> Log:
    for name, text in files.items():
        (folder / f"{name}.csv").write_text(text, "utf-8")
    (folder / "map.toml").write_text(mapping, "utf-8")
    return read_log(folder, folder / "map.toml")


@pytest.mark.parametrize("name", ["long", "wide"])
def test_a_long_and_a_wide_table_give_the_ranges(tmp_path: Path, name: str) -> None:
    make, _ = log_samples.SAMPLES[name]
    for file, text in make().items():
        (tmp_path / file).write_text(text, "utf-8")
    log = read_log(tmp_path)
    step = 500_000_000 if name == "long" else 1_000_000_000
    first = 0 if name == "long" else of_date("2024-05-01T10:00:00Z")
    heard = log.receptions
    found = {
        ((int(time) - first) // step, log.beacons[b]): (r, tuple(at))
        for time, b, r, at in zip(heard.arrival_ns, heard.beacon, heard.range,
                                  heard.beacon_position, strict=True)
    }
    assert found == {
        (k, b): (r, log_samples.BEACONS[b]) for k, b, r in log_samples.ranges()
    }
    assert log.depth.tolist() == [
        float(f"{log_samples.place(k)[2]:.3f}") for k in range(log_samples.PINGS)
    ]
    assert log.findings == ()


def test_a_file_with_our_columns_needs_no_mapping(tmp_path: Path) -> None:
    file = tmp_path / "ranges.csv"
    file.write_text("time_s,beacon,range_m,reported_n_m,reported_e_m,reported_d_m\n"
                    "0.000000001,A,7.5,1,2,3\n12.25,A,8,1,2,3\n")
    log = read_log(file)
    assert log.receptions.arrival_ns.tolist() == [1, 12_250_000_000]
    assert log.receptions.range.tolist() == [7.5, 8.0]
    assert log.name == "ranges"
    assert log.remarks == ()


def test_our_columns_may_be_in_parquet(tmp_path: Path) -> None:
    file = tmp_path / "fixes.parquet"
    pd.DataFrame({"time_ns": [5, 6], "n_m": [1.0, 2], "e_m": [3.0, 4], "d_m": [0.0, 0]}).to_parquet(
        file
    )
    assert read_log(file).fixes["fixes"].position.tolist() == [[1, 3, 0], [2, 4, 0]]


@pytest.mark.parametrize(("key", "value", "metres"), [
    ("range_m", "12.5", 12.5), ("range_km", "0.0125", 12.5), ("range_cm", "1250", 12.5),
    ("range_ft", "12.5", 3.81),
    ("time_of_flight_ms", "10", 15.0), ("time_of_flight_s", "0.01", 15.0),
    ("time_of_flight_us", "10000", 15.0),
])  # fmt: skip
def test_ranges_have_the_unit_of_their_key(
    tmp_path: Path, key: str, value: str, metres: float
) -> None:
    log = _log(
        tmp_path,
        f'[beacons]\nA = [0, 0, 0]\n[mapping.receptions]\nfile = "r.csv"\n{key} = "what"\n',
        r=f"time_s,beacon,what\n1,A,{value}\n",
    )
    assert log.receptions.range.tolist() == pytest.approx([metres], rel=1e-12)


@pytest.mark.parametrize(("key", "value", "expected"), [
    ("time_s", "3152.012700007297", 3_152_012_700_007),
    ("time_s", "1.7e3", 1_700_000_000_000),
    ("time_ms", "1637328581171.485696", 1_637_328_581_171_485_696),
    ("time_us", "12", 12_000),
    ("time_ns", "1637328581171485697", 1_637_328_581_171_485_697),
    ("time", "2021-11-19T13:29:41.171485697Z", 1_637_328_581_171_485_697),
    ("time", "2021-11-19 15:29:41.5+02:00", 1_637_328_581_500_000_000),
])  # fmt: skip
def test_times_are_exact(tmp_path: Path, key: str, value: str, expected: int) -> None:
    log = _log(
        tmp_path,
        f'[beacons]\nA = [0, 0, 0]\n[mapping.receptions]\nfile = "r.csv"\n{key} = "when"\n',
        r=f"when,beacon,range_m\n{value},A,3\n",
    )
    assert log.receptions.arrival_ns.tolist() == [expected]


@pytest.mark.parametrize("zone", [
    "Z", "+00", "+0530", "+05:30", "-03:30", "-0930", "+12:45", "+14", "-11", "-00:01", "+10:09",
])  # fmt: skip
def test_a_date_has_the_hours_and_minutes_of_its_zone(zone: str) -> None:
    text = f"2024-02-29T23:59:07{zone}"
    assert of_date(text) == round(datetime.fromisoformat(text).timestamp()) * 10**9


@pytest.mark.parametrize("value", [
    "2021-11-19T13:29:41", "2021-11-19", "2021-13-19T13:29:41Z", "12", "", "nan", "x",
])  # fmt: skip
def test_a_date_without_a_zone_is_no_time(value: str) -> None:
    assert of_date(value) == MISSING


def test_one_time_that_is_not_whole_leaves_the_others_exact() -> None:
    times = pd.Series(["1637328581171485697", "1.5", "12"], dtype=object)
    assert scaled(times, 1).tolist() == [1637328581171485697, MISSING, 12]
    assert scaled(times[[0, 2]], 1).tolist() == [1637328581171485697, 12]


def test_numbers_that_are_no_times() -> None:
    values = ["nan", "inf", "1e300", "", "x", "1_0", True, None, 1e19, "9" * 30, "0x10"]
    assert scaled(values, 10**9).tolist() == [MISSING] * len(values)
    assert scaled(["1.5"], 1).tolist() == [MISSING]


@pytest.mark.parametrize(("axes", "ned"), [
    ("ned", (1, 2, 3)), ("enu", (2, 1, -3)), ("nwu", (1, -2, -3)), ("end", (2, 1, 3)),
    ("forward-starboard-down", (1, 2, 3)), ("starboard-forward-down", (2, 1, 3)),
])  # fmt: skip
def test_axes(axes: str, ned: tuple[int, ...]) -> None:
    assert axes in AXES
    np.testing.assert_array_equal(to_ned(np.array([[1.0, 2, 3]]), axes), [ned])
    north, east, down = ned
    # turned by 90°, what was north is east, and what was east is south
    np.testing.assert_allclose(
        to_ned(np.array([[1.0, 2, 3]]), axes, 90.0), [(-east, north, down)], atol=1e-12
    )


def test_axes_of_all_are_tested() -> None:
    mark = test_axes.pytestmark[0]  # type: ignore[attr-defined]
    assert {row[0] for row in mark.args[1]} == {*AXES}


def test_positions_are_turned_and_shifted(tmp_path: Path) -> None:
    log = _log(
        tmp_path,
        '[mapping]\naxes = "enu"\nturn_deg = 90\nshift_m = [500000, 4000000, 10]\n'
        "[mapping.beacons]\nA = [500003, 4000001, 8]\n"
        '[mapping.receptions]\nfile = "r.csv"\n'
        '[mapping.truth]\nfile = "t.csv"\nposition = ["x", "y", "z"]\n',
        r="time_s,beacon,range_m\n1,A,3\n", t="time_s,x,y,z\n1,500003,4000001,8\n",
    )
    np.testing.assert_allclose(log.receptions.beacon_position, [[-3, 1, 2]], atol=1e-9)
    assert isinstance(log.truth, Truth)
    np.testing.assert_allclose(log.truth.position, [[-3, 1, 2]], atol=1e-9)


def test_latitudes_give_an_origin_that_is_said(tmp_path: Path) -> None:
    rows = [(0, 0.0, 0.0), (1, 86.5, 4.5), (2, 36.5, -4.5), (3, 36.5001, -4.5), (4, 36.5, -4.49)]
    text = "time_s,lat,lon\n" + "".join(f"{t},{a},{b}\n" for t, a, b in rows)
    log = _log(
        tmp_path,
        '[mapping.fixes]\nfile = "f.csv"\nlatitude_deg = "lat"\nlongitude_deg = "lon"\n'
        'device_name = "usv"\n', f=text,
    )
    assert log.meta.place == Origin(36.5, -4.5)
    assert [(it.line, it.what) for it in log.findings] == [
        (2, "no latitude and longitude"), (3, "no n_m within 1,000 km"),
    ]
    np.testing.assert_allclose(
        log.fixes["usv"].position, Origin(36.5, -4.5).local(
            np.array([[36.5, -4.5, 0.0], [36.5001, -4.5, 0.0], [36.5, -4.49, 0.0]])), atol=1e-9
    )
    assert log.remarks == (
        "the log has no origin: it is the first position, 36.500000°, -4.500000° (f.csv, line 4)",
    )


@pytest.mark.parametrize(("unit", "metres"), [
    ("m", 1.0), ("km", 1000.0), ("cm", 0.01), ("mm", 0.001), ("ft", 0.3048),
])
def test_lengths_of_all_tables_have_the_unit_of_their_key(
    tmp_path: Path, unit: str, metres: float
) -> None:
    """Depths come before heights, which count from the height of the origin."""
    log = _log(
        tmp_path,
        "[origin]\nlatitude_deg = 36.5\nlongitude_deg = -4.5\nheight_m = 40.0\n"
        f'[mapping.depth]\nfile = "d.csv"\ndepth_{unit} = "deep"\n'
        f'[mapping.fixes]\nfile = "f.csv"\nheight_{unit} = "high"\ndepth_{unit} = "deep"\n'
        f'std_{unit} = "std"\n'
        f'[mapping.truth]\nfile = "t.csv"\nn_{unit} = "a"\ne_{unit} = "b"\nd_{unit} = "c"\n',
        d="time_s,deep\n1,2.5\n2,3\n",
        f="time_s,latitude_deg,longitude_deg,high,deep,std\n"
          "1,36.5,-4.5,8,4,0.5\n2,36.5,-4.5,8,,0.5\n3,36.5,-4.5,,,0.5\n",
        t="time_s,a,b,c\n1,4,5,6\n2,7,8,9\n",
    )  # fmt: skip
    assert log.depth.tolist() == pytest.approx([2.5 * metres, 3 * metres])
    fixes = log.fixes["f"]
    np.testing.assert_allclose(
        fixes.position, [(0, 0, 4 * metres), (0, 0, 40 - 8 * metres), (0, 0, 0)], atol=1e-6
    )
    assert fixes.position_std is not None
    np.testing.assert_allclose(fixes.position_std, np.full((3, 3), 0.5 * metres))
    assert log.truth is not None
    np.testing.assert_allclose(
        log.truth.position, np.array([(4, 5, 6), (7, 8, 9)]) * metres, rtol=1e-12
    )
    assert not log.findings


def test_angles_may_be_in_degrees(tmp_path: Path) -> None:
    keys = "".join(f'platform_{axis}_m = "{axis}"\n' for axis in "ned")
    keys += "".join(f'platform_{it}_deg = "{it}"\n' for it in ("roll", "pitch", "yaw"))
    log = _log(
        tmp_path,
        f'[arms_m]\nA = [2, 0, 1]\n[mapping.receptions]\nfile = "r.csv"\n{keys}',
        r="time_s,beacon,range_m,n,e,d,roll,pitch,yaw\n1,A,3,10,20,0,0,0,90\n"
          "2,A,4,10,20,0,180,0,0\n3,A,5,10,20,0,0,-30,0\n",
    )  # fmt: skip
    np.testing.assert_allclose(
        np.degrees(log.receptions.platform_attitude), [(0, 0, 90), (180, 0, 0), (0, -30, 0)]
    )
    c, s = np.cos(np.radians(30)), 0.5
    np.testing.assert_allclose(
        log.receptions.beacon_position,
        [(10, 22, 1), (12, 20, -1), (10 + 2 * c - s, 20, 2 * s + c)], atol=1e-12,
    )


def test_a_wide_table_has_the_unit_of_its_key_and_says_what_is_read_again(tmp_path: Path) -> None:
    log = _log(
        tmp_path,
        '[beacons]\nA = [0, 0, 0]\nB = [1, 0, 0]\n[mapping.receptions]\nfile = "r.csv"\n'
        'time_ms = "t"\nrange_ft = { B = "b", A = "a" }\nno_data = -99\nrepeats = true\n',
        r="t,a,b\n1000,10,100\n2000,10,110\n3000,-99,110\n4000,20,-99\n5000,20,120\n",
    )
    feet = 0.3048
    heard = log.receptions
    assert [(int(t) // 10**9, log.beacons[b], round(float(r / feet), 9)) for t, b, r in
            zip(heard.arrival_ns, heard.beacon, heard.range, strict=True)] == [
        (1, "B", 100), (1, "A", 10), (2, "B", 110), (4, "A", 20), (5, "B", 120),
    ]  # fmt: skip
    assert log.remarks[0] == "r.csv: 3 of 10 values (30 %) only repeat the one before"


def test_what_stands_for_nothing_at_the_beginning_is_said(tmp_path: Path) -> None:
    mapping = '[mapping.fixes]\nfile = "f.csv"\nposition = ["x", "y", "z"]\nno_data = [0, -1]\n'
    rows = ["1,0,0,0", "2,0,0,0", "3,-1,-1,-1", "4,0,0,5", "5,0,-1,0", "6,0,0,0"]
    log = _log(tmp_path, mapping, f="\n".join(["time_s,x,y,z", *rows]))
    assert log.fixes["f"].position.tolist() == [[0, 0, 5], [0, -1, 0]]
    assert log.remarks == (
        "f.csv: 0 or -1 stands for no data, 4 times, 3 of them at the beginning",
    )
    assert [(it.line, it.what) for it in log.findings] == [
        (line, "no data (0 or -1)") for line in (2, 3, 4, 7)
    ]
    log = _log(tmp_path, mapping, f="\n".join(["time_s,x,y,z", *rows[3:]]))
    assert log.remarks == ("f.csv: 0 or -1 stands for no data, 1 time",)


def test_several_files_of_a_kind_are_one_table(tmp_path: Path) -> None:
    log = _log(
        tmp_path,
        '[[mapping.fixes]]\nfile = "one.csv"\ndevice_name = "gps"\n'
        'position = ["n", "e"]\n[[mapping.fixes]]\nfile = "two.csv"\nposition = ["e", "n", "d"]\n',
        one="time_s,n,e\n1,5,6\n2,7,8\n", two="time_s,n,e,d\n1,5,6,7\n",
    )
    assert {name: it.position.tolist() for name, it in log.fixes.items()} == {
        "gps": [[5, 6, 0], [7, 8, 0]], "two": [[6, 5, 7]],
    }


@pytest.mark.parametrize(("line", "said"), [
    ("turn_deg = 360", ""), ("turn_deg = -360.0", ""), ("turn_deg = 360.5", "turn_deg: must be a "
     "number from -360 to 360, got 360.5"), ("turn_deg = true", "turn_deg: must be a number from"),
    ("shift_m = [1e8, -1e8]", ""), ("shift_m = [1e8, 1.1e8]", "shift_m: must be a number from "
     "-100,000,000 to 100,000,000, got 110000000.0"), ("shift_m = [1]", "shift_m: must be two or"),
    ("shift_m = [1, 2, 3, 4]", "shift_m: must be two or three numbers, got [1, 2, 3, 4]"),
    ("turn_deg = nan", "turn_deg: must be a number from"),
])  # fmt: skip
def test_numbers_of_a_mapping_have_limits(tmp_path: Path, line: str, said: str) -> None:
    mapping = f'[beacons]\nA = [0, 0, 0]\n[mapping]\n{line}\n[mapping.receptions]\n' \
        'file = "r.csv"\n'
    if not said:
        assert len(_log(tmp_path, mapping, r="time_s,beacon,range_m\n1,A,3\n").receptions) == 1
        return
    with pytest.raises(ConfigurationError) as caught:
        _log(tmp_path, mapping, r="time_s,beacon,range_m\n1,A,3\n")
    assert f"map.toml: mapping.{said}" in str(caught.value)


def test_places_of_beacons_and_reports_are_in_the_axes_of_the_mapping(tmp_path: Path) -> None:
    """West of a grid that is turned by 30°, with its origin elsewhere; beacons of the log stay."""
    log = _log(
        tmp_path,
        '[beacons]\nC = [7, 8, 9]\n[mapping]\naxes = "nwu"\nturn_deg = 30\n'
        "shift_m = [100, 200, 3]\n[mapping.beacons]\nA = [104, 198, 1]\nC = [0, 0, 0]\n"
        '[mapping.receptions]\nfile = "r.csv"\nreported = ["x", "y"]\n',
        r="time_s,beacon,range_m,x,y\n1,A,3,,\n2,B,3,106,207\n3,C,3,,\n",
    )
    c, s = np.cos(np.radians(30)), 0.5
    a, b = (4.0, 2.0, 2.0), (6.0, -7.0, 3.0)  # north, east, down of the grid
    expected = [(n * c - e * s, n * s + e * c, d) for n, e, d in (a, b)]
    np.testing.assert_allclose(log.receptions.beacon_position, [*expected, (7, 8, 9)], atol=1e-9)


def test_repeats_and_values_for_nothing_are_told_apart(tmp_path: Path) -> None:
    log = _log(
        tmp_path,
        '[beacons]\nA = [0, 0, 0]\nB = [1, 0, 0]\n[mapping.receptions]\nfile = "r.csv"\n'
        "repeats = true\nno_data = [0, -1]\n",
        r="time_s,beacon,range_m\n1,A,0\n2,A,0\n3,A,5\n4,B,5\n5,A,5\n6,A,6\n7,A,-1\n8,A,5\n",
    )
    assert log.receptions.line.tolist() == [4, 5, 7, 9]
    assert sorted((it.line, it.what, it.of) for it in log.findings) == [
        (2, "no data (0 or -1)", "A"), (3, "a value that was only read again", "A"),
        (6, "a value that was only read again", "A"), (8, "no data (0 or -1)", "A"),
    ]
    assert log.remarks == (
        "r.csv: 2 of 8 values (25 %) only repeat the one before",
        "r.csv: 0 or -1 stands for no data, 3 times, 2 of them at the beginning",
    )


def test_an_empty_cell_of_a_wide_table_is_no_range(tmp_path: Path) -> None:
    log = _log(
        tmp_path,
        '[beacons]\nA = [0, 0, 0]\nB = [1, 0, 0]\n[mapping.receptions]\nfile = "r.csv"\n'
        'time_s = "t"\nrange_km = { A = "a", B = "b" }\n',
        r="t,a,b\n1,0.001,\n2,,0.002\n3,x,0.003\n",
    )
    assert log.receptions.range.tolist() == [1.0, 2.0, 3.0]
    assert [(it.line, it.of) for it in log.findings] == [(4, "A")]


def test_a_wide_table_may_have_times_of_flight(tmp_path: Path) -> None:
    log = _log(
        tmp_path,
        '[beacons]\nA = [0, 0, 0]\nB = [1, 0, 0]\n[mapping.receptions]\nfile = "r.csv"\n'
        'kind = "two-way"\ntime_of_flight_ms = { A = "a", B = "b" }\n',
        r="time_s,a,b\n1,20,40\n2,,60\n",
    )
    assert log.receptions.range.tolist() == [15.0, 30.0, 45.0]
    assert [log.beacons[b] for b in log.receptions.beacon] == ["A", "B", "B"]


def test_numbers_may_have_a_decimal_comma(tmp_path: Path) -> None:
    log = _log(
        tmp_path,
        '[beacons]\n"A,1" = [0, 0, 0]\n[mapping.receptions]\nfile = "r.csv"\ndecimal = ","\n',
        r="time_s;beacon;range_m\n1,25;A,1;2,5\n2;A,1;1.234,5\n",
    )
    assert log.receptions.range.tolist() == [2.5]
    assert log.receptions.arrival_ns.tolist() == [1_250_000_000]
    assert [(it.line, it.what) for it in log.findings] == [(3, "a number that cannot be read")]


_R = '[mapping.receptions]\nfile = "r.csv"\n'


@pytest.mark.parametrize(("mapping", "said"), [
    (f'{_R}range_m = "dist"\n',
     "mapping.receptions.range_m: must be a column of r.csv, got 'dist'; it has 'time_s', "
     "'beacon', 'distance'; did you mean 'distance'?"),
    (f'{_R}range_yd = "distance"\n', "there is no key mapping.receptions.range_yd; range must be "
     "in m or km or cm or mm or ft, as in range_m"),
    (f'{_R}rang_m = "distance"\n', "there is no key mapping.receptions.rang_m; did you mean"),
    ('[mapping.reception]\nfile = "r.csv"\n', "there is no key mapping.reception; did you mean "
     "'receptions'?"),
    ('[mapping]\naxes = "endu"\n' + _R, "mapping.axes: must be 'ned' or 'enu' or"),
    ("[mapping]\nturn_deg = 400\n" + _R, "mapping.turn_deg: must be a number from -360 to 360"),
    (f"{_R}range_m = 3\n", "mapping.receptions.range_m: must be a name, got 3"),
    (f'{_R}reported = ["a"]\n', "mapping.receptions.reported: must be the names of two or three"),
    (f'{_R}range_m = "distance"\nrange_km = "distance"\n', "must have range_m or range_km, got"),
    (f'{_R}time_s = "time_s"\ntime_ms = "time_s"\n', "must have time_s or time_ms, got both"),
    (f'{_R}delimiter = "ab"\n', "mapping.receptions.delimiter: must be one character, got 'ab'"),
    (f"{_R}delimiter = {{a = 1}}\n", "mapping.receptions.delimiter: must be a name, got {'a'"),
    (f"{_R}range_m = {{}}\n", "mapping.receptions.range_m: must be a name, got {}"),
    (f"{_R}range_m = {{A = 'x'}}\n", "mapping.receptions.range_m.A: must be a column of r.csv"),
    (f"{_R}range_m = {{A = 3}}\n", "mapping.receptions.range_m.A: must be a name, got 3"),
    (f"{_R}beacon = {{a = 'b'}}\n", "mapping.receptions.beacon: must be a name, got {'a'"),
    (f'{_R}decimal = ";"\n', "mapping.receptions.decimal: must be '.' or ',', got ';'"),
    (f"{_R}repeats = 1\n", "mapping.receptions.repeats: must be true or false, got 1"),
    (f'{_R}no_data = "x"\n', "mapping.receptions.no_data: must be a number from"),
    ('[mapping.receptions]\nfile = "no.csv"\n',
     "mapping.receptions.file: must be a file in the folder '"),
    ("[mapping.receptions]\n", "mapping.receptions.file: must be the name of a file, got none"),
    ("mapping = 3\n", "mapping: must be a table, got 3"),
    ('[mapping]\nreceptions = "r.csv"\n', "mapping.receptions: must be a table, got 'r.csv'"),
    ("[mapping]\nbeacons = {A = [1]}\n" + _R, "mapping.beacons.A: must be two or three numbers"),
    (f'{_R}kind = "twoway"\n', "mapping.receptions.kind: must be a column of r.csv, got 'twoway'"),
])  # fmt: skip
def test_what_is_wrong_with_a_mapping_is_said(tmp_path: Path, mapping: str, said: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        _log(tmp_path, mapping, r="time_s,beacon,distance\n1,A,3\n")
    message = str(caught.value)
    assert said in message
    assert "\n" not in message
    assert "map.toml" in message or "no.csv" in message


def test_ranges_without_places_of_beacons_say_where_places_may_stand(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text("time_s,beacon,range_m\n1,A,3\n")
    with pytest.raises(ConfigurationError) as caught:
        read_log(tmp_path / "r.csv")
    assert "r.csv: 1 line left out: a beacon without a position (line 2)" in str(caught.value)
    assert str(caught.value).endswith("(reported_n_m, …) or stand in [beacons] of meta.toml")


def test_a_table_with_a_typing_error_is_named_where_beacons_have_no_place(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text("time_s,beacon,range_m\n1,A,3\n")
    (tmp_path / "meta.toml").write_text("lisence = 'x'\n[Beacons]\nA = [0, 0, 0]\n")
    with pytest.raises(ConfigurationError) as caught:
        read_log(tmp_path / "r.csv")
    assert str(caught.value).endswith(
        "keys without a meaning in a log are not used: lisence (did you mean 'licence'?), Beacons "
        "(did you mean 'beacons'?)"
    )


def test_a_file_that_its_mapping_does_not_name_is_refused(tmp_path: Path) -> None:
    for name in ("r", "other"):
        (tmp_path / f"{name}.csv").write_text("time_s,beacon,distance\n1,A,3\n")
    mapping = tmp_path / "map.toml"
    mapping.write_text(f'[beacons]\nA = [0, 0, 0]\n{_R}range_m = "distance"\n')
    with pytest.raises(ConfigurationError) as caught:
        read_log(tmp_path / "other.csv", mapping)
    said = "must name the file that is read, 'other.csv', or none, got 'r.csv'"
    assert said in str(caught.value)
    named = read_log(tmp_path / "r.csv", mapping)
    assert named.receptions.range.tolist() == [3.0]
    assert len(read_log(tmp_path, mapping).receptions) == 1


def test_columns_that_say_nothing_are_asked_for(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text("a,b\n1,2\n")
    with pytest.raises(ConfigurationError, match="or a mapping that says which of its columns"):
        read_log(tmp_path / "r.csv")


@pytest.mark.parametrize("make", [
    lambda at: at.mkdir(), lambda at: at.write_text(""), lambda at: at.write_text("hello\n"),
    lambda at: at.write_bytes(b"\x89PNG\r\n\x1a\n"), lambda at: None,
    pytest.param(lambda at: os.mkfifo(at), marks=pytest.mark.skipif(
        os.name == "nt", reason="there are no pipes")),
])  # fmt: skip
def test_other_things_are_no_logs(tmp_path: Path, make: Any) -> None:
    make(tmp_path / "it")
    with pytest.raises(ConfigurationError, match="it: must be"):
        read_log(tmp_path / "it")


@needs_recorded
@pytest.mark.parametrize(("name", "ranges", "beacons", "truth", "first"), [
    ("goats_14", 1558, ("L0", "L1", "L2", "L3"), 679, (1_000_000_000, 247.67792, 429.9, 730.1)),
    ("plaza2", 1816, ("L0", "L1", "L5", "L6"), 410,
     (3_152_012_700_007, 47.26057453851528, 18.377796999178827, -68.9265369999921)),
])  # fmt: skip
def test_recorded_sets_need_a_few_lines(
    tmp_path: Path, name: str, ranges: int, beacons: tuple[str, ...], truth: int,
    first: tuple[float, ...],
) -> None:
    log = log_of(name, tmp_path)
    assert len(log.receptions) == ranges
    assert log.beacons == beacons
    assert log.truth is not None
    assert len(log.truth.time_ns) == truth
    heard = log.receptions
    north, east, _ = heard.beacon_position[0]
    assert (heard.arrival_ns[0], heard.range[0], north, east) == first
    assert (heard.epoch_ns == heard.arrival_ns).all()
    assert log.findings == ()
    # true distances are near the ranges: axes and columns are not mixed up
    at = np.column_stack([
        np.interp(heard.epoch_ns, log.truth.time_ns, log.truth.position[:, i]) for i in (0, 1)
    ])
    off = heard.range - np.linalg.norm(at - heard.beacon_position[:, :2], axis=1)
    assert abs(np.median(off)) < 5


@needs_recorded
def test_a_recorded_set_in_our_own_format(tmp_path: Path) -> None:
    log = read_log(RECORDED / "lias_planar_mid")
    assert len(log.beacons) == 8
    assert len(log.depth) == 322
    assert log.meta.clock.truth.offset_s == "estimate"
