"""A log with a tenth of its lines damaged: each is reported with its line and kind, exactly."""

from __future__ import annotations

import random
from collections import Counter
from pathlib import Path

import log_samples
import numpy as np
import pandas as pd
import pytest
from sblcosim import ConfigurationError, read_log
from sblcosim.logs.checks import number, numbers
from sblcosim.logs.log import Log
from sblcosim.logs.raw import Raw
from sblcosim.logs.text import table
from sblcosim.logs.times import whole

HOUR_NS = 3_600_000_000_000
NAMES = ("arrival", "epoch", "beacon", "range", "valid")
KINDS = {
    "cut": "damaged",
    "duplicated": "the same as one before",
    "out of order": "out of order",
    "future": "a time far from that of its neighbours",
    "nan": "no range from 0 m to 1,000 km",
    "negative": "no range from 0 m to 1,000 km",
    "word": "a number that cannot be read",
    "unknown beacon": "a beacon without a position",
    "no beacon": "no beacon",
    "no time": "no time",
    "not valid": "marked as not valid",
    "no switch": "valid is neither true nor false",
    "bytes": "damaged",
}
"""What is done to lines, and what is said of them."""


def _damaged(kind: str, cells: list[str], last: list[str]) -> bytes:
    """A damaged line; a duplicate is that of the last one."""
    it = dict(zip(NAMES, cells, strict=True))
    match kind:
        case "cut":
            return ",".join(cells)[: len(it["arrival"]) + 5].encode()
        case "duplicated":
            it = dict(zip(NAMES, last, strict=True))
        case "out of order":
            it["arrival"] = str(int(it["arrival"]) - 1_200_000_000)
            it["epoch"] = str(int(it["epoch"]) - 1_200_000_000)
        case "future":
            it["arrival"] = str(int(it["arrival"]) + 50 * HOUR_NS)
            it["epoch"] = str(int(it["epoch"]) + 50 * HOUR_NS)
        case "nan":
            it["range"] = "nan"
        case "negative":
            it["range"] = f"-{it['range']}"
        case "word":
            it["range"] = f"{it['range']}x"
        case "unknown beacon":
            it["beacon"] = "B9"
        case "no beacon":
            it["beacon"] = ""
        case "no time":
            it["arrival"] = it["epoch"] = ""
        case "not valid":
            it["valid"] = "False"
        case "no switch":
            it["valid"] = "perhaps"
        case "bytes":
            return ",".join(cells).encode().replace(b"1", b"\xff", 1)
    return ",".join(it.values()).encode()


def _damage(folder: Path, seed: int) -> tuple[list[tuple[int, str]], list[int]]:
    """Write a log of which a tenth is damaged: its lines with what is said, and the good ones."""
    draw = random.Random(seed)
    files = log_samples.own()
    head, *lines = files["receptions.csv"].splitlines()
    # every other line at most, so that what a line is compared with is sound
    chosen = sorted(draw.sample(range(2, len(lines) - 2, 2), len(lines) // 10))
    said, content = [], [head.encode()]
    kinds = [*KINDS] * len(chosen)
    for i, line in enumerate(lines):
        if i in chosen:
            kind = kinds[chosen.index(i)]
            said.append((i + 2, KINDS[kind]))
            content.append(_damaged(kind, line.split(","), lines[i - 1].split(",")))
        else:
            content.append(line.encode())
    for name, text in files.items():
        (folder / name).write_bytes(
            b"\n".join(content) + b"\n" if name == "receptions.csv" else text.encode()
        )
    return said, [i + 2 for i in range(len(lines)) if i not in chosen]


@pytest.mark.parametrize("seed", range(20))
def test_each_damaged_line_is_reported_with_its_kind(tmp_path: Path, seed: int) -> None:
    said, sound = _damage(tmp_path, seed)
    log = read_log(tmp_path)
    assert sorted((it.line, it.what) for it in log.findings) == said
    assert {it.file for it in log.findings} == {"receptions.csv"}
    out = {line for line, what in said if what != "out of order"}
    put_right = {line for line, _ in said} - out
    assert {it.line for it in log.findings if it.used} == put_right
    assert sorted(log.receptions.line.tolist()) == sorted([*sound, *put_right])
    assert (np.diff(log.receptions.arrival_ns) >= 0).all()
    assert log.entries["receptions"] == len(sound) + len(said)
    counted = Counter(what for _, what in said)
    for sentence in log.counted():
        what = sentence.split(": ")[2].rpartition(" (")[0]
        assert int(sentence.split(": ")[1].split()[0]) == counted.pop(what)
    assert not counted


@pytest.mark.parametrize("end", ["first", "last"])
@pytest.mark.parametrize("few", [1, 2, 3])
def test_a_few_far_rows_at_an_end_are_left_out_and_no_others(
    tmp_path: Path, end: str, few: int
) -> None:
    head, *lines = log_samples.own()["receptions.csv"].splitlines()
    far = range(few) if end == "first" else range(len(lines) - few, len(lines))
    for i in far:
        arrival, epoch, *rest = lines[i].split(",")
        away = -50 * HOUR_NS if end == "first" else 50 * HOUR_NS
        lines[i] = ",".join([str(int(arrival) + away), str(int(epoch) + away), *rest])
    log = _read(tmp_path, **{"receptions.csv": "\n".join([head, *lines]) + "\n"})
    said = [(i + 2, KINDS["future"], False) for i in far]
    assert [(it.line, it.what, it.used) for it in log.findings] == said
    kept = [i + 2 for i in range(len(lines)) if i not in far]
    assert log.receptions.line.tolist() == kept


def _read(folder: Path, **changed: str) -> Log:
    for name, text in (log_samples.own() | changed).items():
        (folder / name).write_text(text, "utf-8")
    return read_log(folder)


def test_sound_lines_are_as_written(tmp_path: Path) -> None:
    log = _read(tmp_path)
    assert log.findings == ()
    assert log.remarks == ()
    by_ping = {(log_samples.time_ns(k), name): r for k, name, r in log_samples.ranges()}
    heard = log.receptions
    for epoch, beacon, value in zip(heard.epoch_ns, heard.beacon, heard.range, strict=True):
        assert by_ping.pop((int(epoch), log.beacons[beacon])) == value
    assert not by_ping
    assert log.entries == {"receptions": 160, "depth": 40, "truth": 40, "fixes": 40}


def test_a_range_that_cannot_be_read_is_not_replaced_by_the_time_of_flight(tmp_path: Path) -> None:
    log = _read(tmp_path, **{"receptions.csv": (
        "arrival_ns,beacon,range_m,time_of_flight_s\n1000000000,B0,12x,0.01\n"
        "2000000000,B0,,0.01\n3000000000,B0,12,0.01\n"
    )})  # fmt: skip
    assert [(it.line, it.what) for it in log.findings] == [(2, "a number that cannot be read")]
    assert log.receptions.range.tolist() == [15.0, 12.0]


def test_epochs_follow_from_arrivals_by_the_kind(tmp_path: Path) -> None:
    """Both ways: half of the flight without the time of the answer; the middle of the distances."""
    log = _read(tmp_path, **{"receptions.csv": (
        "arrival_ns,beacon,kind,time_of_flight_s,turn_around_s\n"
        "10000000000,B0,one-way,0.02,\n20000000000,B0,two-way,0.14,0.1\n"
        "30000000000,B0,range,0.02,\n40000000000,B0,,0.02,\n"
    )})  # fmt: skip
    np.testing.assert_allclose(log.receptions.range, [30.0, 30.0, 30.0, 30.0])
    late = log.receptions.arrival_ns - log.receptions.epoch_ns
    assert late.tolist() == [20_000_000, 70_000_000, 0, 20_000_000]


def test_a_position_with_a_part_missing_is_not_filled_from_another(tmp_path: Path) -> None:
    log = _read(tmp_path, **{"receptions.csv": (
        "arrival_ns,beacon,range_m,reported_n_m,reported_e_m,reported_d_m\n"
        "1000000000,B1,12,7,8,9\n2000000000,B1,12,7,,9\n3000000000,B1,12,,,\n"
    )})  # fmt: skip
    assert log.receptions.beacon_position.tolist() == [[7, 8, 9], [30, 0, 1.5], [30, 0, 1.5]]


def test_a_second_fix_at_a_time_is_counted(tmp_path: Path) -> None:
    fixes = log_samples.own()["fixes.csv"]
    first = fixes.splitlines()[1]
    log = _read(tmp_path, **{"fixes.csv": fixes.replace(first, f"{first}\n{first}")})
    assert [(it.line, it.what, it.of) for it in log.findings] == [
        (3, "a time that has a position already", "usbl")
    ]


def test_devices_are_put_in_order_each_for_itself(tmp_path: Path) -> None:
    head, *rows = log_samples.own()["fixes.csv"].splitlines()
    other = [row.replace("usbl", "gps") for row in rows]
    log = _read(tmp_path, **{"fixes.csv": "\n".join([head, *rows, *other]) + "\n"})
    assert {name: len(fixes) for name, fixes in log.fixes.items()} == {"usbl": 40, "gps": 40}
    assert log.findings == ()


def test_depths_of_a_log_in_the_plane_are_said_to_be_unused(tmp_path: Path) -> None:
    meta = log_samples.own()["meta.toml"].replace("dimension = 3", "dimension = 2")
    log = _read(tmp_path, **{"meta.toml": meta})
    assert len(log.depth) == 0
    assert log.remarks == ("depths are not used: the log has dimension = 2",)


@pytest.mark.parametrize(("speed", "told"), [(1.5, True), (1349.0, True), (1500.0, False)])
def test_a_speed_of_sound_that_no_water_has_is_told(
    tmp_path: Path, speed: float, told: bool
) -> None:
    meta = log_samples.own()["meta.toml"].splitlines()
    meta = [f"sound_speed_m_s = {speed}", *(it for it in meta if "sound_speed" not in it)]
    log = _read(tmp_path, **{"meta.toml": "\n".join(meta)})
    said = f"sound_speed_m_s: should be from 1350 to 1650 m/s, as in water, got {speed:g} m/s"
    assert any(it.endswith(f"meta.toml: {said}") for it in log.remarks) is told


@pytest.mark.parametrize(("name", "text", "said"), [
    ("receptions.csv", "arrival_ns,range_m\n1,2\n", "must have a column beacon, got"),
    ("receptions.csv", "arrival_ns,beacon,rang_m\n1,B0,2\n", "range_m or time_of_flight_s, got "
     "'arrival_ns', 'beacon', 'rang_m'; did you mean 'range_m' by 'rang_m'?"),
    ("receptions.csv", "time_s,beacon,flight\n1,B0,2\n", "got 'time_s', 'beacon', 'flight'"),
    ("receptions.csv", "time_s,beacon,range_ft\n1,B0,2\n", "got 'time_s', 'beacon', 'range_ft'; "
     "a mapping says the unit of a column such as 'range_ft'"),
    ("receptions.csv", "time_s,beakon,range_m\n1,B0,2\n", "got 'time_s', 'beakon', 'range_m'; "
     "did you mean 'beacon' by 'beakon'?"),
    ("receptions.csv", "\0\n", "must begin with the names of its columns"),
    ("receptions.csv", '"a,b\n1,2\n', "must begin with the names of its columns"),
    ("receptions.csv", "beacon,beacon\n", "must have columns of different names, got 'beacon'"),
    ("meta.toml", "[beacons]\nB0 = [0.0, 1e9, 0.0]\n", "beacons.B0.1: must be at most 1000000"),
    ("meta.toml", "sound_speed_m_s = 0\n", "sound_speed_m_s: must be at least 1.0, got 0"),
])  # fmt: skip
def test_what_is_wrong_with_a_file_is_said_in_a_line(
    tmp_path: Path, name: str, text: str, said: str
) -> None:
    with pytest.raises(ConfigurationError) as caught:
        _read(tmp_path, **{name: text})
    assert said in str(caught.value)
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_log_without_anything_that_can_be_used_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"got none; receptions\.csv: 1 line left out"):
        _read(tmp_path, **{"receptions.csv": "arrival_ns,beacon,range_m\n1,B0,-2\n",
                           "fixes.csv": "time_ns,n_m,e_m,d_m\n"})


def test_the_first_three_reasons_are_told_of_a_log_without_anything(tmp_path: Path) -> None:
    rows = ["1,B0,-2", ",B0,2", "3,,2", "4,B9,2"]
    with pytest.raises(ConfigurationError) as caught:
        _read(tmp_path, **{"receptions.csv": "\n".join(["arrival_ns,beacon,range_m", *rows]),
                           "fixes.csv": "time_ns,n_m,e_m,d_m\n"})
    assert str(caught.value) == (
        f"{tmp_path}: must hold ranges of beacons with positions, or positions, got none; "
        "receptions.csv: 1 line left out: no range from 0 m to 1,000 km (line 2); receptions.csv: "
        "1 line left out: no time (line 3); receptions.csv: 1 line left out: no beacon (line 4); "
        "positions are columns (reported_n_m, …) or stand in [beacons] of meta.toml"
    )


def test_five_keys_without_a_meaning_are_named_and_the_first_wrong_value(tmp_path: Path) -> None:
    meta = log_samples.own()["meta.toml"]
    odd = "".join(f"odd{i} = {i}\n" for i in range(6))
    log = _read(tmp_path, **{"meta.toml": f"{odd}{meta}height = 3\n"})
    assert log.remarks == (
        f"{tmp_path / 'meta.toml'}: keys without a meaning in a log are not used: odd0, odd1, "
        "odd2, odd3, odd4 and 2 more",
    )
    wrong = meta.replace("dimension = 3", 'dimension = 4\ndepth_is = "sonar"\nname = 3')
    with pytest.raises(ConfigurationError) as caught:
        _read(tmp_path, **{"meta.toml": wrong})
    assert str(caught.value).startswith(f"{tmp_path / 'meta.toml'}: ")
    assert str(caught.value).endswith(" (and 2 more)")
    clock = f'{meta}[clock]\ntruth = "guess"\n'
    assert _read(tmp_path, **{"meta.toml": clock}).remarks == (
        f"{tmp_path / 'meta.toml'}: clock.truth = 'guess': its offset is estimated",
    )
    sure = _read(tmp_path, **{"meta.toml": clock.replace("guess", "estimate")})
    assert sure.remarks == ()
    assert sure.own_clock


def test_a_table_in_two_formats_is_read_from_parquet(tmp_path: Path) -> None:
    import pandas as pd

    _read(tmp_path)
    pd.DataFrame({"time_ns": [1, 2], "depth_m": [3.0, 4.0]}).to_parquet(tmp_path / "depth.parquet")
    log = read_log(tmp_path)
    assert log.depth.tolist() == [3.0, 4.0]
    assert log.remarks[0] == "depth.csv is not read: there is depth.parquet"


def _folder(tmp_path: Path, name: str) -> Path:
    folder = tmp_path / name
    folder.mkdir()
    return folder


def depths(tmp_path: Path, sign: float, later_s: float) -> str:
    """The remarks on the depths of a log, if they have another sign or clock."""
    head, *lines = log_samples.own()["depth.csv"].splitlines()
    told = [head]
    for line in lines:
        time_ns, depth = line.split(",")
        told.append(f"{int(time_ns) + round(later_s * 1e9)},{sign * float(depth)}")
    log = _read(_folder(tmp_path, f"{sign} {later_s}"), **{"depth.csv": "\n".join(told)})
    assert len(log.depth) == len(lines)
    return "\n".join(log.remarks)


@pytest.mark.parametrize("later_s", [-7200.0, -3600.0, 3600.0, 1e6])
def test_depths_of_another_time_than_the_ranges_are_told(tmp_path: Path, later_s: float) -> None:
    where = "after" if later_s > 0 else "before"
    log = _read(_folder(tmp_path, "as it is"))
    first, last = (int(f(log.receptions.arrival_ns)) / 1e9 for f in (min, max))
    begin, end = (int(log.depth_ns[i]) / 1e9 + later_s for i in (0, -1))
    apart = begin - last if later_s > 0 else first - end
    assert depths(tmp_path, 1.0, later_s) == (
        "depth.csv: depths should be of the time of the ranges, got none: they are "
        f"{apart:,.1f} s {where} them"
    )
    assert not depths(tmp_path, 1.0, 1.0)


def test_what_is_above_the_water_in_a_log_is_told(tmp_path: Path) -> None:
    said, log = depths(tmp_path, -1.0, 0.0), _read(_folder(tmp_path, "as it is"))
    assert (log.depth > 2).any()
    scale = 1.5 / log.depth.max()
    assert not depths(tmp_path, -scale, 0.0) + depths(tmp_path, scale, 0.0)  # in the waves
    assert said == (
        "depth.csv: depths should be under water (down is positive), got "
        f"{-log.depth.max():.4g} m; {(log.depth > 2).sum():,} of {len(log.depth):,} are more than "
        "2 m above it"
    )
    meta = log_samples.own()["meta.toml"]
    name, place = next(iter(log.meta.beacons.items()))
    line = next(it for it in meta.splitlines() if it.startswith(f"{name} ="))
    raised = meta.replace(line, f"{name} = [{place[0]}, {place[1]}, -8.0]")
    log = _read(_folder(tmp_path, "raised"), **{"meta.toml": raised})
    assert any(it.endswith(
        f"beacons should be under water (down is positive), got {name} at depths of -8 m"
    ) for it in log.remarks)  # fmt: skip


@pytest.mark.parametrize(("columns", "said"), [
    ("time_s,depth", "got 'time_s', 'depth'; did you mean 'depth_m' by 'depth'?"),
    ("time_s,depth_ft", "got 'time_s', 'depth_ft'; a mapping says the unit of a column such as "
     "'depth_ft'"),
    ("time_s,altitude", "got 'time_s', 'altitude'"),
    ("time_ns,altitude", "got 'time_ns', 'altitude'"),
])  # fmt: skip
def test_a_column_that_is_lacking_is_not_one_in_another_unit(
    tmp_path: Path, columns: str, said: str
) -> None:
    with pytest.raises(ConfigurationError) as caught:
        _read(tmp_path, **{"depth.csv": f"{columns}\n1,2\n3,4\n"})
    assert str(caught.value) == f"depth.csv: must have a column depth_m, {said}"


@pytest.mark.parametrize("ends", ["\r\n", "\r"])
def test_lines_are_counted_as_editors_do(tmp_path: Path, ends: str) -> None:
    text = log_samples.own()["receptions.csv"].replace("true", "false", 1)
    for name, content in log_samples.own().items():
        (tmp_path / name).write_bytes(content.encode())
    (tmp_path / "receptions.csv").write_bytes(
        b"\xef\xbb\xbf" + text.replace("\n", ends).encode()
    )
    assert [(it.line, it.what) for it in read_log(tmp_path).findings] == [
        (2, "marked as not valid")
    ]


@pytest.mark.parametrize("seed", range(4))
def test_lines_with_and_without_quotes_are_read_alike(tmp_path: Path, seed: int) -> None:
    draw = random.Random(seed)
    cells = ("", " ", "1", " -2.5", "1e3 ", "0x1F", "+4", "nan", "inf", "1_0", "B 1", "#", "-0",
             "12345678901234567890123", "1.0000000000000000001", ".5", "true", "5\t")  # fmt: skip
    delimiter = draw.choice(",;")
    lines = [delimiter.join(f"c{i}" for i in range(3))]
    lines += [
        draw.choice(("", "  ", "# one", "#")) if draw.random() < 0.1
        else delimiter.join(draw.choices(cells, k=draw.choice((3, 3, 3, 3, 2, 4))))
        for _ in range(200)
    ]  # fmt: skip
    found = []
    for name, last in (("plain.csv", "#"), ("quoted.csv", '# "')):
        (tmp_path / name).write_text("\n".join([*lines, last]))
        raw = Raw("log")
        read = table(tmp_path / name, "depth", raw, delimiter)
        found.append((read.to_dict("list"), [f.line for f in raw.findings]))
    assert found[0] == found[1]
    assert found[0][1]
    for i in range(3):
        column = read[f"c{i}"]
        assert np.array_equal(numbers(column), [*map(number, column)], equal_nan=True)


@pytest.mark.parametrize("words", [
    ("1", "2", "0x10"), ("1.5", "", "2"), ("", ""), ("1e400", "nan", "-Infinity"), ("1_0", "1"),
    ("9007199254740993", "1"), ("99999999999999999999", "1"), ("+5", "1"), ("007", "-0"),
    ("0X1F", "1.5"), ("1", "1.0"), ("\ud800", "1"), ("12345678901234567", "0.5"),
])  # fmt: skip
def test_a_column_is_read_as_its_cells_are(words: tuple[str, ...]) -> None:
    column = pd.Series(words, dtype=object)
    assert np.array_equal(numbers(column), [*map(number, words)], equal_nan=True)
    assert np.array_equal(whole(column), [int(whole([word])[0]) for word in words])
