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
ZDA = sentence("GPZDA,120000.00,01,05,2024,00,00")


def _read(folder: Path, *lines: str, mapping: str = "") -> Log:
    (folder / "log.nmea").write_text("\n".join(lines) + "\n")
    if mapping:
        (folder / "meta.toml").write_text(mapping)
    return read_log(folder / "log.nmea")


def _ship(heading: str = "HEHDT,90.0,T") -> list[str]:
    return [ZDA, _gga("120001.00"), sentence(heading)]


def _gga(clock: str, north: float = 0.0) -> str:
    latitude, longitude, _ = Origin(*ORIGIN).geographic(np.array([[north, 0.0, 0.0]]))[0].tolist()
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


@pytest.mark.parametrize("clock", ["1200.5", "12000", "1200009", "12:00:00", "250000", ""])
def test_a_time_of_another_form_is_not_guessed(tmp_path: Path, clock: str) -> None:
    ssb = ("C", "N", "M", "1", "0", "2", "1", "N", "", "")
    log = _read(tmp_path, *_ship(), _ssb(*ssb), _ssb(*ssb, clock=clock))
    assert log.fixes["B01"].epoch_ns.tolist() == [NOON + 2 * 10**9]
    assert [it.line for it in log.findings] == [5]


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


FROM_START = "times of USBLLONG count from the start of the device"
FROM_MIDNIGHT = "no sentence has a date: times count from midnight"
S = 10**9


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
