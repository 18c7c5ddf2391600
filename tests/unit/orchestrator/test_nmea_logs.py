"""Files of NMEA sentences: fixes of devices, the platform, times, checksums."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import log_samples
import numpy as np
import pytest
from log_samples import ORIGIN, gga, sentence
from sblcosim import ConfigurationError, read_log
from sblcosim.logs import nmea
from sblcosim.logs.log import Log
from sblcosim.logs.times import of_date
from sblcosim.tracks.place import Origin

NOON = of_date("2024-05-01T12:00:00Z")
S = 10**9
ZDA = sentence("GPZDA,120000.00,01,05,2024,00,00")


def _read(folder: Path, *lines: str, mapping: str = "") -> Log:
    (folder / "log.nmea").write_text("\n".join(lines) + "\n")
    if mapping:
        (folder / "meta.toml").write_text(mapping)
    return read_log(folder / "log.nmea")


def _ship(heading: str = "HEHDT,90.0,T") -> list[str]:
    return [ZDA, _gga("120001.00"), sentence(heading)]


def _gga(clock: str, north: float = 0.0, east: float = 0.0) -> str:
    latitude, longitude, _ = Origin(*ORIGIN).geographic(np.array([[north, east, 0.0]]))[0].tolist()
    return sentence(gga(0, latitude, longitude)[1:].rpartition("*")[0].replace(
        log_samples.clock(0), clock))


def _ssb(*fields: str, clock: str = "120002.00") -> str:
    return sentence(f"PSIMSSB,{clock},B01,A,,{','.join(fields)}")


@pytest.mark.parametrize("name", ["nmea", "modem"])
def test_fixes_of_devices_are_where_they_were(tmp_path: Path, name: str) -> None:
    make, file = log_samples.SAMPLES[name]
    (tmp_path / file).write_bytes(make()[file].encode())
    log = read_log(tmp_path / file)
    truth = np.array([log_samples.place(k) for k in range(log_samples.PINGS)])
    if name == "nmea":
        np.testing.assert_allclose(log.fixes["B01"].position, truth, atol=0.006)
        assert log.fixes["B01"].epoch_ns[0] == of_date("2024-05-01T10:00:00.5Z")
        assert log.meta.place is not None
        assert log.meta.place.latitude_deg == pytest.approx(ORIGIN[0], abs=1e-8)
        assert log.meta.place.longitude_deg == pytest.approx(ORIGIN[1], abs=1e-8)
    else:
        assert {*log.fixes} == {"USBL 2", "USRTH", "ROV"}
        np.testing.assert_allclose(log.fixes["USBL 2"].position, truth, atol=0.001)
        assert log.fixes["USBL 2"].epoch_ns.tolist() == [
            log_samples.time_ns(k) for k in range(log_samples.PINGS)
        ]
        assert log.fixes["USBL 2"].position_std is not None
        assert (log.fixes["USBL 2"].position_std == 0.3).all()
        assert any("its place is not in the log" in it for it in log.remarks)
    assert log.findings == ()


def test_the_first_coordinate_of_psimssb_is_starboard_or_forward_as_is_said(
    tmp_path: Path,
) -> None:
    lines = [*_ship(), _ssb("C", "H", "M", "3.0", "7.0", "2.0", "0.5", "N", "", "")]
    log = _read(tmp_path, *lines)
    np.testing.assert_allclose(log.fixes["B01"].position, [[-3, 7, 2]], atol=1e-6)
    assert any("x is taken for starboard" in it for it in log.remarks)
    log = _read(tmp_path, *lines, mapping='[mapping]\npsimssb = "x-forward"\n')
    np.testing.assert_allclose(log.fixes["B01"].position, [[-7, 3, 2]], atol=1e-6)
    assert not any("x is taken for" in it for it in log.remarks)


@pytest.mark.parametrize(("fields", "expected"), [
    (("C", "N", "F", "3", "7", "2", "0.5", "T", "0.01", ""), (3, 7, 2)),
    (("C", "E", "F", "3", "7", "2", "0.5", "T", "0.01", ""), (7, 3, 2)),
    (("P", "N", "M", "10", "90", "2", "", "N", "", ""), (0, 10, 2)),
    (("P", "H", "M", "10", "90", "2", "", "N", "", ""), (-10, 0, 2)),
])  # fmt: skip
def test_coordinates_of_psimssb(
    tmp_path: Path, fields: tuple[str, ...], expected: tuple[float, ...]
) -> None:
    log = _read(tmp_path, *_ship(), _ssb(*fields))
    np.testing.assert_allclose(log.fixes["B01"].position, [expected], atol=1e-6)


def test_psimssb_may_come_without_the_accuracy(tmp_path: Path) -> None:
    log = _read(tmp_path, *_ship(), _ssb("C", "N", "M", "3.0", "7.0", "2.0", "T", "", ""))
    np.testing.assert_allclose(log.fixes["B01"].position, [[3, 7, 2]], atol=1e-6)
    assert log.fixes["B01"].position_std is None
    assert "PSIMSSB comes without the field of the accuracy" in log.remarks


@pytest.mark.parametrize(("heading", "remark"), [
    ("HEHDT,30.0,T", ""), ("GPTHS,30.0,A", ""), ("HCHDM,30.0,M", "HDM is a magnetic direction"),
    ("HCHDG,29.0,2.0,W,3.0,E", ""), ("HCHDG,30.0,,,,", "HDG has no variation"),
])  # fmt: skip
def test_directions_of_the_platform(tmp_path: Path, heading: str, remark: str) -> None:
    log = _read(tmp_path, *_ship(heading), _ssb("C", "H", "M", "0", "10", "2", "1", "N", "", ""))
    expected = [[10 * np.cos(np.radians(30)), 5.0, 2.0]]
    np.testing.assert_allclose(log.fixes["B01"].position, expected, atol=1e-6)
    assert any(remark in it for it in log.remarks) if remark else not any(
        it.startswith("HD") for it in log.remarks)


def test_a_fix_without_a_recent_pose_is_left_out(tmp_path: Path) -> None:
    ssb = ("C", "H", "M", "0", "10", "2", "1", "N", "", "")
    log = _read(tmp_path, _ssb(*ssb, clock="115959.00"), *_ship(), _ssb(*ssb),
                _gga("120009.00"), _ssb(*ssb, clock="120010.00"))
    assert len(log.fixes["B01"]) == 1
    assert [(it.line, it.what) for it in log.findings] == [
        (line, "no position and direction of the platform in the 5 s before") for line in (1, 7)
    ]


def test_the_platform_moves_under_its_fixes(tmp_path: Path) -> None:
    ssb = ("C", "N", "M", "1", "0", "2", "1", "N", "", "")
    log = _read(tmp_path, *_ship(), _ssb(*ssb), _gga("120003.00", north=40.0),
                _ssb(*ssb, clock="120004.00"))
    np.testing.assert_allclose(log.fixes["B01"].position[:, 0], [1, 41], atol=0.01)


@pytest.mark.parametrize("wrong", [(0.0, 0.0), (ORIGIN[0], 0.0), (-33.9, 151.2)])
def test_a_wrong_first_position_of_the_platform_is_not_the_origin(
    tmp_path: Path, wrong: tuple[float, float]
) -> None:
    first = sentence(gga(0, *wrong)[1:].rpartition("*")[0])
    log = _read(tmp_path, ZDA, first, *_ship()[1:], _gga("120001.50", north=10.0),
                _ssb("C", "N", "M", "3.0", "7.0", "2.0", "0.5", "N", "", ""))
    assert log.meta.place is not None
    found = log.meta.place.latitude_deg, log.meta.place.longitude_deg
    assert found == pytest.approx(ORIGIN, abs=1e-8)
    np.testing.assert_allclose(log.fixes["B01"].position, [[13, 7, 2]], atol=0.01)


def test_without_fixes_of_devices_gga_and_rmc_are_the_track(tmp_path: Path) -> None:
    lines = [
        sentence("GPRMC,120000.00,A,3636.0,N,00430.0,W,1.0,90.0,010524,,"),
        sentence("GPGGA,120000.00,3636.0,N,00430.0,W,1,9,0.9,-5.0,M,,M,,"),
        sentence("GPGGA,120001.00,3636.0,N,00430.0,W,0,0,0.9,,M,,M,,"),
        sentence("GPRMC,120002.00,V,3636.0,N,00430.0,W,1.0,90.0,010524,,"),
        sentence("GPGGA,120003.00,3636.001,N,00430.0,W,1,9,0.9,-6.0,M,,M,,"),
    ]
    log = _read(tmp_path, *lines)
    assert log.fixes["RMC"].epoch_ns.tolist() == [NOON]
    assert log.fixes["GGA"].epoch_ns.tolist() == [NOON, NOON + 3 * 10**9]
    assert log.fixes["GGA"].position[:, 2].tolist() == pytest.approx([5, 6])
    assert [(it.line, it.what) for it in log.findings] == [
        (3, "marked as no position"), (4, "marked as no position")
    ]


@pytest.mark.parametrize("clock", [
    "1200.5", "12000", "12000.5", "1200009", "12:00:00", "250000", "120003.1234567890", "",
])
def test_a_time_of_another_form_is_not_guessed(tmp_path: Path, clock: str) -> None:
    ssb = ("C", "N", "M", "1", "0", "2", "1", "N", "", "")
    log = _read(tmp_path, *_ship(), _ssb(*ssb), _ssb(*ssb, clock=clock))
    assert log.fixes["B01"].epoch_ns.tolist() == [NOON + 2 * 10**9]
    what = "fields that cannot be read" if clock else "a time that has a position already"
    assert [(it.line, it.what) for it in log.findings] == [(5, what)]


def test_times_go_on_after_midnight(tmp_path: Path) -> None:
    lines = [_gga("235959.00"), sentence("GPZDA,235959.50,31,12,2023,00,00"), _gga("000000.50"),
             _gga("000001.00")]
    log = _read(tmp_path, *lines)
    first = of_date("2023-12-31T23:59:59Z")
    assert log.fixes["GGA"].epoch_ns.tolist() == [
        first, first + 1_500_000_000, first + 2_000_000_000
    ]


def test_a_time_before_midnight_may_come_after_it(tmp_path: Path) -> None:
    lines = [sentence("GPZDA,000000.00,01,01,2024,00,00"), _gga("000000.50"), _gga("235959.75")]
    log = _read(tmp_path, *lines)
    midnight = of_date("2024-01-01T00:00:00Z")
    assert sorted(log.fixes["GGA"].epoch_ns.tolist()) == [
        midnight - 250_000_000, midnight + 500_000_000
    ]


def test_times_without_a_date_count_from_midnight(tmp_path: Path) -> None:
    log = _read(tmp_path, _gga("120000.00"))
    assert log.fixes["GGA"].epoch_ns.tolist() == [12 * 3600 * 10**9]
    assert "no sentence has a date: times count from midnight" in log.remarks


@pytest.mark.parametrize("stamp", [
    "2024-05-01T12:00:00Z ", "[2024-05-01 12:00:00.000] ", f"{NOON} ", f"{NOON // 10**6},",
    f"{NOON // 10**9}.000: ", rf"\s:gps,c:{NOON // 10**9}*5A" "\\",
])  # fmt: skip
def test_stamps_of_the_logger_count(tmp_path: Path, stamp: str) -> None:
    log = _read(tmp_path, f"{stamp}{_gga('091500.00')}")
    assert log.fixes["GGA"].epoch_ns.tolist() == [NOON]
    assert "times are those before the sentences" in log.remarks


def test_wrong_and_cut_sentences_are_counted_with_their_lines(tmp_path: Path) -> None:
    good = [_gga(f"12000{k}.00") for k in range(8)]
    lines = [ZDA, *good]
    lines[2] = good[1][:-2] + ("00" if good[1][-2:] != "00" else "01")
    lines[3] = good[2][:40]
    lines[4] = "hello"
    lines[5] = good[4].replace("GPGGA", "GPG\xffA")
    lines[6] = sentence("GPGGA,120005.00,3x36.0,N,00430.0,W,1,9,0.9,0,M,,M,,")
    lines[7] = sentence("GPXYZ,1,2")
    log = _read(tmp_path, *lines)
    assert sorted((it.line, it.what) for it in log.findings) == [
        (3, "a wrong checksum"), (4, "no checksum: cut off"), (5, "damaged, or no sentence"),
        (6, "a wrong checksum"), (7, "fields that cannot be read"),
    ]
    assert len(log.fixes["GGA"]) == 2
    assert "sentences that are not used: GPXYZ (1)" in log.remarks


def test_a_lost_target_is_no_position(tmp_path: Path) -> None:
    log = _read(
        tmp_path, ZDA, sentence("RATLL,0,,,,,,000000.000,L"),
        sentence("RATLL,1,3636.0,N,00430.0,W,ROV,120005.500,T"),
    )
    assert log.fixes["ROV"].epoch_ns.tolist() == [NOON + 5_500_000_000]
    assert [it.line for it in log.findings] == [2]


def test_cerulean_without_its_compass_is_along_its_axes(tmp_path: Path) -> None:
    log = _read(
        tmp_path, *_ship(),
        sentence("USRTH,0.0,90.0,-30.0,10.0,,,,,,,,40,T,F,153,CIMU,A,-2,-2"),
        sentence("USRTH,,,,,,,,0.1,0.2,0.3,90.0,40,T,F,153,CIMU,A,-2,-2"),
    )
    flat = 10 * np.cos(np.radians(30))
    np.testing.assert_allclose(log.fixes["USRTH"].position, [[-flat, 0, 5]], atol=1e-6)
    assert [(it.line, it.what) for it in log.findings] == [(5, "marked as no position")]


@pytest.mark.parametrize("fields", [15, 17])
def test_usbllong_with_other_fields_is_counted(tmp_path: Path, fields: int) -> None:
    values = ["1.0", "1.0", "2", *["1"] * (fields - 3)]
    sound = ["2.0", "1700000000.25", "2", *["1"] * 13]
    log = _read(
        tmp_path, f"USBLLONG,{','.join(values)}", f"+++AT:90:USBLLONG,{','.join(sound)}"
    )
    assert Counter(it.what for it in log.findings) == {"not the 17 fields of USBLLONG": 1}
    assert log.fixes["USBL 2"].epoch_ns.tolist() == [1_700_000_000_250_000_000]
    assert log.fixes["USBL 2"].position.tolist() == [[1, 1, -1]]


def _usbllong(time_s: float) -> str:
    return f"USBLLONG,{time_s + 0.2},{time_s},2,1,2,3,4,5,-6,0,0,0,9000,-30,150,0.3"


def _place(axes: str, first: float, second: float) -> tuple[float, float]:
    """North and east of a fix relative to a ship at 20 m, -50 m, which is turned by 30°."""
    c, s = np.cos(np.radians(30)), np.sin(np.radians(30))
    if axes == "ahead":
        first, second = c * first - s * second, s * first + c * second
    return 20 + first, -50 + second


def _polar(length: float, bearing: float) -> tuple[float, float]:
    return length * np.cos(np.radians(bearing)), length * np.sin(np.radians(bearing))


FLAT, DEEP = _polar(24, 25)


@pytest.mark.parametrize(("body", "axes", "pair", "down", "std"), [
    ("PSIMSSB,120002.00,B01,A,,C,H,M,3,7,2.5,0.75,N,,", "ahead", (7, 3), 2.5, 0.75),
    ("PSIMSSB,120002.00,B01,A,,C,N,F,3,7,2.5,0.0,N,,", "north", (3, 7), 2.5, None),
    ("PSIMSSB,120002.00,B01,A,,C,E,F,3,7,2.5,-0.5,N,,", "north", (7, 3), 2.5, None),
    ("PSIMSSB,120002.00,B01,A,,P,H,M,11,40,2.5,,N,,", "ahead", _polar(11, 40), 2.5, None),
    ("PSIMSSB,120002.00,B01,A,,P,N,M,11,130,2.5", "north", _polar(11, 130), 2.5, None),
    ("USRTH,1,70,-9,24,2,130,-25,0", "north", _polar(FLAT, 130), DEEP, None),
    ("USRTH,1,70,-25,24,2,130,,0", "ahead", _polar(FLAT, 70), DEEP, None),
    ("USRTH,1,70,-25,24,2,,-9,0", "ahead", _polar(FLAT, 70), DEEP, None),
    ("USBLLONG,9.5,9,2,1,2,3,4,5,-6,0,0,0,9000,-30,150,0.3", "north", (5, 4), 6, 0.3),
    ("USBLLONG,9.5,9,2,1,2,3,4,0,0,0,0,0,9000,-30,150,0", "north", (0, 4), 0, None),
    ("USBLLONG,9.5,9,2,1,2,3,0,5,0,0,0,0,9000,-30,150,-1", "north", (5, 0), 0, None),
    ("USBLLONG,9.5,9,2,1,2,3,0,0,6,0,0,0,9000,-30,150,0.3", "north", (0, 0), -6, 0.3),
    ("USBLLONG,9.5,9,2,1,2,3,0,0,0,0,0,0,9000,-30,150,0.3", "ahead", (1, 2), 3, 0.3),
])  # fmt: skip
def test_fixes_relative_to_a_ship_that_is_turned_and_away_from_the_origin(
    tmp_path: Path, body: str, axes: str, pair: tuple[float, float], down: float, std: float | None,
) -> None:
    origin = f"[origin]\nlatitude_deg = {ORIGIN[0]}\nlongitude_deg = {ORIGIN[1]}\n"
    ship = [ZDA, _gga("120001.00", 20.0, -50.0), sentence("HEHDT,30.0,T")]
    line = body if body.startswith("USBL") else sentence(body)
    log = _read(tmp_path, *ship, line, mapping=origin)
    assert not log.findings
    (fixes,) = log.fixes.values()
    np.testing.assert_allclose(fixes.position, [(*_place(axes, *pair), down)], atol=0.004)
    found = fixes.position_std
    assert found is None if std is None else found is not None and found.tolist() == [[std] * 3]


def test_poses_of_the_platform_count_for_five_seconds(tmp_path: Path) -> None:
    north, ahead = (("C", up, "M", "1", "2", "3", "1", "N", "", "") for up in "NH")
    log = _read(
        tmp_path, *_ship(), _ssb(*north, clock="120006.00"), _ssb(*north, clock="120006.01"),
        _gga("120007.00", 40.0), _ssb(*ahead, clock="120007.50"), sentence("HEHDT,180.0,T"),
        _ssb(*ahead, clock="120007.50"), _gga("120008.00", 60.0), _ssb(*ahead, clock="120008.00"),
        _ssb(*ahead, clock="120007.90"), _ssb(*ahead, clock="120012.50"),
        _gga("120012.51", 80.0), _ssb(*ahead, clock="120012.51"),
    )  # fmt: skip
    assert [it.line for it in log.findings] == [5, 7, 12, 15]
    assert {it.what for it in log.findings} == {
        "no position and direction of the platform in the 5 s before"
    }
    fixes = log.fixes["B01"]
    assert (fixes.epoch_ns - NOON).tolist() == [6 * S, 7.5 * S, 8 * S, 12.5 * S]
    np.testing.assert_allclose(
        fixes.position, [(1, 2, 3), (38, -1, 3), (58, -1, 3), (58, -1, 3)], atol=0.004
    )


def test_fixes_need_the_place_of_the_platform_if_the_log_has_any(tmp_path: Path) -> None:
    ssb = _ssb("C", "N", "M", "1", "2", "3", "1", "N", "", "")
    late = _ssb("C", "N", "M", "1", "2", "3", "1", "N", "", "", clock="115959.00")
    with pytest.raises(ConfigurationError) as caught:
        _read(tmp_path, ZDA, late, *_ship()[1:])
    assert str(caught.value) == (
        f"{tmp_path / 'log.nmea'}: must hold the position and direction of the platform (GGA or "
        "RMC, HDT) beside fixes relative to it, got none in the 5 s before a fix"
    )
    log = _read(tmp_path, ZDA, ssb)
    assert log.fixes["B01"].position.tolist() == [[1, 2, 3]]
    assert log.remarks == (
        "positions relative to a device are from that device: its place is not in the log",
    )


def test_without_any_direction_fixes_are_along_the_platform(tmp_path: Path) -> None:
    ssb = ("C", "H", "M", "3", "7", "2", "1", "N", "", "")
    log = _read(tmp_path, ZDA, _gga("120001.00", 20.0), _ssb(*ssb), _gga("120003.00", 50.0),
                _ssb(*ssb, clock="120004.00"), mapping='[mapping]\npsimssb = "x-forward"\n')
    np.testing.assert_allclose(log.fixes["B01"].position, [(3, 7, 2), (33, 7, 2)], atol=0.004)
    latitude = Origin(*ORIGIN).geographic(np.array([[20.0, 0.0, 0.0]]))[0, 0]
    assert log.remarks == (
        "2 positions in GGA and RMC are those of the platform",
        f"the log has no origin: it is the first position of the platform, {latitude:.6f}°, "
        f"{ORIGIN[1]:.6f}°",
        "fixes without a direction of the platform are along its axes (forward, starboard), not "
        "north and east",
    )


@pytest.mark.parametrize(("clock", "after_ns"), [
    ("093107.123456789", 123_456_000), ("210459.5", 500_000_000), ("010203", 0), ("000000.", 0),
])
def test_times_of_the_day_have_hours_minutes_and_parts_of_seconds(
    tmp_path: Path, clock: str, after_ns: int
) -> None:
    log = _read(tmp_path, _ssb("C", "N", "M", "1", "2", "3", "1", "N", "", "", clock=clock))
    hours, minutes, seconds = int(clock[:2]), int(clock[2:4]), int(clock[4:6])
    expected = (hours * 3600 + minutes * 60 + seconds) * S + after_ns
    assert log.fixes["B01"].epoch_ns.tolist() == [expected]
    log = _read(tmp_path, _gga("214659.25"))
    assert log.fixes["GGA"].epoch_ns.tolist() == [(21 * 3600 + 46 * 60 + 59) * S + S // 4]


@pytest.mark.parametrize(("clock", "expected"), [("120009.00", 43_209), ("120011.00", -43_189)])
def test_a_time_is_of_the_day_that_is_nearest(tmp_path: Path, clock: str, expected: int) -> None:
    raw = nmea.raw_of(tmp_path / "log.nmea", f"{_gga('000010.00')}\n{_gga(clock)}", {}, "")
    assert raw.tables["fixes"]["time_ns"].tolist() == [10 * S, expected * S]


def test_what_came_before_the_first_date_is_of_the_days_before_it(tmp_path: Path) -> None:
    """Positions and directions of the platform, and fixes relative to it, stay together."""
    ssb = ("C", "H", "M", "3", "7", "2", "1", "N", "", "")
    log = _read(
        tmp_path, _gga("235958.00", 10.0), sentence("HEHDT,90.0,T"),
        _ssb(*ssb, clock="235959.00"), _gga("000001.00", 30.0, 5.0), sentence("HEHDT,270.0,T"),
        _ssb(*ssb, clock="000002.00"), sentence("GPZDA,000003.00,01,03,2024,00,00"),
        _ssb(*ssb, clock="000004.00"), sentence("GPZDA,000005.00,01,03,2024,00,00"),
        _gga("000006.00", 30.0), _ssb(*ssb, clock="000006.00"),
    )  # fmt: skip
    assert not log.findings
    midnight = of_date("2024-03-01T00:00:00Z")
    assert (log.fixes["B01"].epoch_ns - midnight).tolist() == [-S, 2 * S, 4 * S, 6 * S]
    np.testing.assert_allclose(
        log.fixes["B01"].position, [(-3, 7, 2), (23, -2, 2), (23, -2, 2), (23, -7, 2)], atol=0.004
    )
    assert not any("midnight" in it for it in log.remarks)


@pytest.mark.parametrize("dated", [
    "GPZDA,000000.00,01,03,2024,00,00",
    "GPRMC,000000.00,A,5900.000,N,01000.000,E,0.0,0.0,010324,,",
])
def test_what_came_before_midnight_is_of_the_day_before_the_first_date(
    tmp_path: Path, dated: str
) -> None:
    lines = [_gga("235958.00"), _gga("235959.00"), sentence(dated), _gga("000001.00"),
             sentence(dated.replace("000000.00", "000002.00")), _gga("000003.00")]  # fmt: skip
    table = nmea.raw_of(tmp_path / "log.nmea", "\n".join(lines), {}, "").tables["fixes"]
    own = table["time_ns"][table["device"] == "GGA"] - of_date("2024-03-01T00:00:00Z")
    assert own.tolist() == [-2 * S, -S, S, 3 * S]


def test_a_long_silence_before_the_first_date_is_within_its_day(tmp_path: Path) -> None:
    lines = [_gga("070000.00"), sentence("GPZDA,200000.00,01,03,2024,00,00"), _gga("200001.00")]
    table = nmea.raw_of(tmp_path / "log.nmea", "\n".join(lines), {}, "").tables["fixes"]
    own = table["time_ns"] - of_date("2024-03-01T00:00:00Z")
    assert own.tolist() == [7 * 3600 * S, (20 * 3600 + 1) * S]


def test_a_date_without_a_time_moves_the_times_before_it(tmp_path: Path) -> None:
    fix = sentence("USRTH,1,70,-25,24,2,130,-25,0")
    log = _read(tmp_path, _ssb("C", "N", "M", "1", "2", "3", "1", "N", "", ""),
                sentence("GPZDA,,01,05,2024,00,00"), fix)
    assert {name: it.epoch_ns.tolist() for name, it in log.fixes.items()} == {
        "B01": [NOON + 2 * S], "USRTH": [NOON + 2 * S],
    }


def test_a_date_without_its_parts_is_none(tmp_path: Path) -> None:
    """The time of such a sentence counts all the same."""
    for given in ("01,05,", "01,,2024", ",05,2024", ",,"):
        zda = sentence(f"GPZDA,120003.00,{given},00,00")
        log = _read(tmp_path, zda, "USBLLONG,9.5,9,2,1,2,3,4,5,-6,0,0,0,9000,-30,150,0.3")
        assert log.fixes["USBL 2"].epoch_ns.tolist() == [43_203 * S], given
        assert "no sentence has a date: times count from midnight" in log.remarks


@pytest.mark.parametrize("stamp", [
    (f"{NOON // S}.25: ", 250_000_000), (f"{NOON // 10**6 + 125}.5 ", 125_500_000),
    (f"{NOON // 1000 + 7}.5 ", 7_500), (f"({NOON + 11}) ", 11),
])  # fmt: skip
def test_stamps_of_the_logger_are_in_units_by_their_digits(
    tmp_path: Path, stamp: tuple[str, int]
) -> None:
    log = _read(tmp_path, f"{stamp[0]}{_gga('091500.00')}")
    assert (log.fixes["GGA"].epoch_ns - NOON).tolist() == [stamp[1]]


def test_stamps_count_where_most_lines_have_them(tmp_path: Path) -> None:
    """Dates in sentences then do not."""
    stamped = [f"{NOON // S + k} {_gga(f'09150{k}.00', float(k))}" for k in range(3)]
    zda = f"{NOON // S + 4} " + sentence("GPZDA,091504.00,02,06,2025,00,00")
    log = _read(tmp_path, *stamped[:2], zda, _gga("091505.00"), f"12345678901 {_gga('091506.00')}")
    assert ((log.fixes["GGA"].epoch_ns - NOON) / S).tolist() == [0, 1]
    assert [(it.line, it.what) for it in log.findings] == [
        (4, "no time before the sentence"), (5, "no time before the sentence"),
    ]
    assert log.remarks[0] == "times are those before the sentences"
    log = _read(tmp_path, *stamped[:2], _gga("091505.00"), _gga("091506.00"))
    assert (log.fixes["GGA"].epoch_ns / S - 9.25 * 3600).tolist() == [0, 1, 5, 6]
    assert not log.findings


def test_seconds_of_a_device_since_1970_are_a_milliard_or_more(tmp_path: Path) -> None:
    log = _read(tmp_path, _usbllong(1e9), _usbllong(1e9 + 0.5))
    assert log.fixes["USBL 2"].epoch_ns.tolist() == [S * S, S * S + S // 2]
    assert FROM_START not in log.remarks
    log = _read(tmp_path, _usbllong(1e9 - 0.5))
    assert FROM_START in log.remarks


def test_what_came_since_the_start_of_a_device_came_just_before_the_first_time_of_day(
    tmp_path: Path,
) -> None:
    ssb = ("C", "N", "M", "1", "2", "3", "1", "N", "", "")
    log = _read(tmp_path, _usbllong(3.0), _usbllong(4.5), _ssb(*ssb, clock="120005.00"),
                _ssb(*ssb, clock="120008.00"))  # fmt: skip
    noon = 12 * 3600 * S
    assert log.fixes["USBL 2"].epoch_ns.tolist() == [noon + 3_500_000_000, noon + 5 * S]
    assert log.fixes["B01"].epoch_ns.tolist() == [noon + 5 * S, noon + 8 * S]


def test_positions_of_the_platform_in_rmc(tmp_path: Path) -> None:
    """Those at the time of a GGA are the same; fixes are relative to the last of either."""
    def rmc(clock: str, north: float, state: str = "A") -> str:
        place = _gga(clock, north).split(",")[2:6]
        return sentence(f"GPRMC,{clock},{state},{','.join(place)},1.0,90.0,010524,,")

    ssb = ("C", "N", "M", "1", "2", "3", "1", "N", "", "")
    lines = [rmc("120000.00", 0.0), _gga("120001.00", 10.0), rmc("120001.00", 15.0),
             rmc("120002.00", 20.0), rmc("120003.00", 70.0, "V")]  # fmt: skip
    log = _read(tmp_path, *lines, _ssb(*ssb, clock="120003.50"))
    np.testing.assert_allclose(log.fixes["B01"].position, [(21, 2, 3)], atol=0.004)
    assert "3 positions in GGA and RMC are those of the platform" in log.remarks
    log = _read(tmp_path, *lines)
    assert {name: ((it.epoch_ns - NOON) / S).tolist() for name, it in log.fixes.items()} == {
        "GGA": [1], "RMC": [0, 2],
    }


@pytest.mark.parametrize("wrong", [
    "GPGGA,120001.00,,,,,1,9,0.9,0.0,M,,M,,", "GPGGA,120001.00,3636.0,N,00430.0,W,,9,0.9,,M,,M,,",
    "GPGGA,120001.00,3636.0,N,00430.0,W,0,9,0.9,,M,,M,,", "GPRMC,120001.00,A,,,,,1.0,9.0,010524,,",
    "GPRMC,120001.00,V,3636.0,N,00430.0,W,1.0,9.0,010524,,", "RATLL,1,,,,,ROV,120001.00,T",
    "RATLL,1,3636.0,N,00430.0,W,ROV,120001.00,L", "USRTH,1,70,-9,,2,130,-25,0",
    "USRTH,1,70,,24,2,130,,0", "USRTH,1,,-9,24,2,,-25,0", "USRTH,1,70,-9,nan,2,130,-25,0",
    "PSIMSSB,120001.00,B01,V,,C,N,M,1,2,3,1,N,,", "PSIMSSB,120001.00,B01,,,C,N,M,1,2,3,1,N,,",
])  # fmt: skip
def test_what_a_device_does_not_call_a_position_is_none(tmp_path: Path, wrong: str) -> None:
    log = _read(tmp_path, ZDA, sentence(wrong), _gga("120004.00"))
    assert [(it.line, it.what) for it in log.findings] == [(2, "marked as no position")]
    assert [*log.fixes] == ["GGA"]
    assert ((log.fixes["GGA"].epoch_ns - NOON) / S).tolist() == [4]


@pytest.mark.parametrize(("wrong", "said"), [
    ("GPGGA,120001.00,9001.0,N,00430.0,W,1,9,0.9,0.0,M,,M,,", "fields that cannot be read"),
    ("GPGGA,120001.00,3636.0,N,18001.0,W,1,9,0.9,0.0,M,,M,,", "fields that cannot be read"),
    ("GPGGA,120001.00,3636.0,S,18001.0,E,1,9,0.9,0.0,M,,M,,", "fields that cannot be read"),
    ("PSIMSSB,120001.00,B01,A,,C,N,M,nan,2,3,1,N,,", "fields that cannot be read"),
    ("PSIMSSB,120001.00,B01,A,,C,N,M,1,2,inf,1,N,,", "fields that cannot be read"),
    ("PSIMSSB,120001.00,B01,A,,C,N,M,1,2", "fields that cannot be read"),
    ("PSIMSSB,120001.00,B01,A,,R,N,M,1,2,3,1,N,,", "coordinates of another kind (R)"),
    ("PSIMSSB,120001.00,B01,A,,C,U,M,1,2,3,1,N,,", "coordinates of another kind (U)"),
    ("HEHDT,360.5,T", "fields that cannot be read"), ("HEHDT,-0.5,T", "fields that cannot be read"),
    ("HEHDT,nan,T", "fields that cannot be read"), ("HETHS,12.0,V", "marked as no direction"),
    ("HETHS,400.0,A", "fields that cannot be read"),
])  # fmt: skip
def test_what_cannot_be_is_said_and_not_used(tmp_path: Path, wrong: str, said: str) -> None:
    ssb = ("C", "H", "M", "3", "7", "2", "1", "N", "", "")
    log = _read(tmp_path, ZDA, _gga("120000.50"), sentence("HEHDT,90.0,T"), sentence(wrong),
                _ssb(*ssb))
    assert [(it.line, it.what) for it in log.findings] == [(4, said)]
    np.testing.assert_allclose(log.fixes["B01"].position, [(-3, 7, 2)], atol=0.004)


@pytest.mark.parametrize(("heading", "degrees"), [
    ("HEHDT,0.0,T", 0), ("HEHDT,360.0,T", 0), ("HETHS,75.0,A", 75), ("HETHS,75.0", 75),
    ("HCHDG,359.0,2.0,E,3.0,E", 4), ("HCHDG,1.0,2.0,W,4.0,W", 355), ("HCHDG,70.0,,,5.0,E", 75),
    ("HCHDG,70.0,5.0,E,,", 75),
])  # fmt: skip
def test_directions_go_around(tmp_path: Path, heading: str, degrees: float) -> None:
    ssb = ("P", "H", "M", "10", "20", "2", "1", "N", "", "")
    log = _read(tmp_path, *_ship(heading), _ssb(*ssb))
    expected = [(*_polar(10, 20 + degrees), 2)]
    np.testing.assert_allclose(log.fixes["B01"].position, expected, atol=0.004)
    magnetic = "HDG has no variation of the compass: directions are magnetic"
    assert (magnetic in log.remarks) == (heading == "HCHDG,70.0,5.0,E,,")


@pytest.mark.parametrize("body", [
    "PSIMSSB,120002.00,B01,A,,C,N,M,1,2,3,1,N,,", "USRTH,1,70,-9,24,2,130,-25,0", "HETHS,75.0,A",
])
def test_checksums_of_all_sentences_count_if_there_are_any(tmp_path: Path, body: str) -> None:
    sealed = sentence(body)
    body, _, seal = sealed.partition("*")
    wrong = f"{body}*{(int(seal, 16) + 1) % 256:02X}"
    log = _read(tmp_path, *_ship(), wrong)
    assert [(it.line, it.what) for it in log.findings] == [(4, "a wrong checksum")]
    for sound in (sealed, f"{body}*{seal.lower()}", body, f"{body}*"):
        assert not _read(tmp_path, *_ship(), sound).findings, sound


def test_names_of_devices(tmp_path: Path) -> None:
    lines = [sentence(f"RATLL,{number},3636.0,N,00430.0,W,{name},120005.500,T")
             for number, name in (("7", "ROV"), ("7", ""), ("", ""))]
    lines += [sentence("PSIMSSB,120006.00,,A,,C,N,M,1,2,3,1,N,,"),
              "USBLLONG,9.5,9,12,1,2,3,4,5,-6,0,0,0,9000,-30,150,0.3"]
    log = _read(tmp_path, *_ship(), *lines)
    assert [*log.fixes] == ["7", "PSIMSSB", "RATLL", "ROV", "USBL 12"]
    cut = "USBLLONG,9.5,9,2.5,1,2,3,4,5,-6,0,0,0,9000,-30,150,0.3"
    log = _read(tmp_path, *_ship(), lines[0], cut, cut.replace("2.5", "nan"))
    assert [(it.line, it.what) for it in log.findings] == [
        (line, "not the 17 fields of USBLLONG") for line in (5, 6)
    ]


def test_sentences_are_looked_for_in_two_hundred_lines(tmp_path: Path) -> None:
    log = _read(tmp_path, *["x"] * 150, *[""] * 49, _gga("120001.00"))
    assert [it.line for it in log.findings] == [*range(1, 151)]
    assert len(log.fixes["GGA"]) == 1
    with pytest.raises(ConfigurationError, match="or NMEA sentences, got one that begins with 'x'"):
        _read(tmp_path, *["x"] * 200, _gga("120001.00"))


def test_the_five_most_frequent_sentences_that_are_not_used_are_named(tmp_path: Path) -> None:
    names = ["GPVTG", "GPXYZ", "GPGSA", "GPGLL", "GPGST", "GPABC"]
    lines = [sentence(f"{name},1,2") for k, name in enumerate(names) for _ in range(7 - k)]
    log = _read(tmp_path, ZDA, *lines, _gga("120001.00"))
    assert log.remarks[0] == (
        "sentences that are not used: GPVTG (7), GPXYZ (6), GPGSA (5), GPGLL (4), GPGST (3)"
    )
    assert not log.findings
    with pytest.raises(ConfigurationError) as caught:
        _read(tmp_path, ZDA, sentence("HETHS,12.0,V"), "hello", sentence("HEHDT,400,T"), *lines)
    assert str(caught.value) == (
        f"{tmp_path / 'log.nmea'}: must hold sentences with positions (GGA, RMC, PSIMSSB, RATLL, "
        "USBLLONG or USRTH), got marked as no direction, damaged, or no sentence, fields that "
        "cannot be read"
    )
    with pytest.raises(ConfigurationError, match=r"or USRTH\), got sentences GPVTG, sentences G"):
        _read(tmp_path, ZDA, *lines)


FROM_START = "times of USBLLONG count from the start of the device"
FROM_MIDNIGHT = "no sentence has a date: times count from midnight"


@pytest.mark.parametrize(("lines", "times", "remark"), [
    ([_usbllong(3.5), _usbllong(4.0), _usbllong(6.25)], [3.5, 4.0, 6.25], FROM_START),
    ([_usbllong(1.5e9), _usbllong(1.5e9 + 2)], [1.5e9, 1.5e9 + 2], ""),
    # Its clock is set: what came before came just before. Or others tell the time, and the place.
    ([_usbllong(3.5), _usbllong(4.0), _usbllong(1.5e9), _usbllong(1.5e9 + 2)],
     [1.5e9 - 0.5, 1.5e9, 1.5e9, 1.5e9 + 2], ""),
    ([_usbllong(3.5), _usbllong(4.0), _gga("200001.00"), sentence("HEHDT,90.0,T"),
      _usbllong(7.0)], [72001.0], FROM_MIDNIGHT),
    ([_usbllong(3.5), _usbllong(4.0), ZDA, *_ship()[1:], _usbllong(7.0)],
     [NOON / S + 1], ""),
])  # fmt: skip
def test_times_of_usbllong_are_those_of_the_device_or_of_others(
    tmp_path: Path, lines: list[str], times: list[float], remark: str
) -> None:
    raw = nmea.raw_of(tmp_path / "log.nmea", "\n".join(lines), {}, "")
    said = {it for it in raw.remarks if it in (FROM_START, FROM_MIDNIGHT)}
    assert said == ({remark} if remark else set())
    found = raw.tables["fixes"]["time_ns"].to_numpy() / S
    np.testing.assert_allclose(found, times, rtol=0, atol=1e-6)


def test_a_file_without_positions_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="must hold sentences with positions"):
        _read(tmp_path, ZDA, sentence("HEHDT,90.0,T"))
