"""What `sblcosim log` says: counts, rates, gaps, repeats, lines, and a picture without gaps."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import log_samples
import matplotlib.image as images
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
import sblcosim
from made_logs import checked, made
from sblcosim.cli.common.app import app
from sblcosim.logs.contents import LogContents, contents_of
from sblcosim.logs.figures import gaps, marked, plot_log, series_of
from sblcosim.logs.log import Log
from sblcosim.logs.tables import BEACONS, FLAWS, SERIES
from sblcosim.style import MARKERS, SMALL, THEMES
from typer.testing import CliRunner


def _made(folder: Path, name: str = "own", **changed: str) -> Path:
    make, start = log_samples.SAMPLES[name]
    for file, text in (make() | changed).items():
        (folder / file).write_text(text, "utf-8")
    return folder / start


@pytest.fixture
def contents(tmp_path: Path) -> LogContents:
    """A log without the pings 10 to 19 of one beacon, and with two lines that are not right."""
    head, *lines = log_samples.own()["receptions.csv"].splitlines()
    late = {log_samples.time_ns(k) for k in range(10, 20)}
    kept = [it for it in lines if not (",B2," in it and int(it.split(",")[1]) in late)]
    kept[3] = kept[3].replace("true", "false")
    kept[8] = kept[8].replace(",B", ",B").rpartition(",")[0].rpartition(",")[0] + ",-1,true"
    return sblcosim.log(_made(tmp_path, **{"receptions.csv": "\n".join([head, *kept]) + "\n"}))


def test_beacons_are_counted(contents: LogContents) -> None:
    table = contents.beacons.set_index("beacon")
    assert list(contents.beacons) == BEACONS.names
    assert table["ranges"].sum() == len(contents.log.receptions) == 148
    assert table["left_out"].sum() == 2
    assert (table["ranges"] + table["left_out"]).to_dict() == {
        "B0": 40, "B1": 40, "B2": 30, "B3": 40
    }
    assert table["gaps"].to_dict() == {"B0": 0, "B1": 0, "B2": 1, "B3": 0}
    assert table.loc["B2", "longest_gap_s"] == pytest.approx(5.5, abs=0.01)
    assert table.loc["B0", "rate_Hz"] == pytest.approx(2.0, rel=0.06)
    own = contents.log.receptions.range[contents.log.receptions.beacon == 2]
    found = table.loc["B2", ["shortest_m", "median_m", "longest_m"]].tolist()
    assert found == [own.min(), np.median(own), own.max()]
    assert (table["used_share"] == table["ranges"] / (table["ranges"] + table["left_out"])).all()


def test_other_values_are_counted(contents: LogContents) -> None:
    assert list(contents.series) == SERIES.names
    assert contents.series["series"].tolist() == ["depth", "truth", "fixes usbl"]
    assert contents.series["values"].tolist() == [40, 40, 40]
    assert contents.series["rate_Hz"].tolist() == pytest.approx([2.0] * 3)
    assert contents.series["last_s"].tolist() == pytest.approx([19.5] * 3)


def test_flaws_have_their_lines(contents: LogContents) -> None:
    assert list(contents.flaws) == FLAWS.names
    assert contents.flaws.to_dict("records") == [
        {"file": "receptions.csv", "flaw": "marked as not valid", "used": False, "entries": 1,
         "lines": "5"},
        {"file": "receptions.csv", "flaw": "no range from 0 m to 1,000 km", "used": False,
         "entries": 1, "lines": "10"},
    ]


def test_the_text_says_when_where_and_what(contents: LogContents) -> None:
    text = str(contents)
    assert text.startswith("log: ") or "148 ranges of 4 beacons, 40 depths" in text
    assert "From 2023-11-14 22:13:20 UTC to 2023-11-14 22:13:39 UTC, 19.5 s" in text
    assert "origin 36.600000°, -4.500000°" in text
    assert "receptions.csv: 1 line left out: marked as not valid (line 5)" in text


def test_verbose_names_all_lines(tmp_path: Path) -> None:
    text = log_samples.own()["receptions.csv"].replace("true", "false", 40)
    contents = sblcosim.log(_made(tmp_path, **{"receptions.csv": text}))
    all_lines = " ".join(map(str, range(2, 42)))
    assert all_lines in contents.text(verbose=True)
    assert "(lines 2, 3, 4, 5, 6, …)" in contents.text()


def test_a_pause_of_five_times_the_usual_is_a_gap() -> None:
    times = np.array([0, 10, 20, 30, 80, 131, 141], np.int64)
    assert gaps(times).tolist() == [False, False, False, False, True, False]
    # What came at one time has no pause, and does not make others longer than usual.
    assert not gaps(np.array([0, 0, 0, 0, 10, 20, 60], np.int64)).any()
    assert gaps(np.array([5, 5, 5], np.int64)).tolist() == [False, False]
    assert gaps(np.array([5], np.int64)).tolist() == []


@pytest.mark.parametrize("name", [*log_samples.SAMPLES])
def test_no_panel_of_the_picture_is_empty(tmp_path: Path, name: str) -> None:
    log = sblcosim.read_log(_made(tmp_path, name))
    axes = plot_log(log)
    assert len(axes) == (3 if len(log.depth) else 2)
    for ax in axes:
        points = [np.asarray(line.get_xdata()) for line in ax.lines]
        assert sum(map(len, points)) > 10
        low, high = ax.get_xlim()
        for x in points:
            assert np.all((x >= low) & (x <= high))
    rows = [text.get_text() for text in axes[0].get_yticklabels()]
    assert rows[: len(log.beacons)] == [*log.beacons]
    assert [it for it in rows if it.startswith("fixes")] == [f"fixes {it}" for it in log.fixes]


def test_no_two_of_many_beacons_look_alike(tmp_path: Path) -> None:
    turns = np.arange(35) * 2 * np.pi / 35
    rows = [
        f"{s}000000000,b{i},{50 + i},{60 * np.cos(turn)},{60 * np.sin(turn)},5"
        for s in range(40) for i, turn in enumerate(turns)
    ]
    head = "time_ns,beacon,range_m,reported_n_m,reported_e_m,reported_d_m"
    (tmp_path / "receptions.csv").write_text("\n".join([head, *rows]))
    log = sblcosim.read_log(tmp_path)
    timeline, ranges, *_ = plot_log(log)
    keys = [it for it in timeline.lines if it.get_marker() != "|"]
    assert len({(it.get_color(), it.get_marker()) for it in keys}) == len(log.beacons) == 35
    assert len({it.get_marker() for it in keys[:6]}) == 6  # a few need no colour
    marks = [it for it in ranges.lines if it.get_marker() != "."]
    assert [(it.get_color(), it.get_marker()) for it in marks] == [
        (it.get_color(), it.get_marker()) for it in keys
    ]
    assert all(len(it.get_xdata()) == 12 for it in marks)


def test_marks_are_at_ranges_and_not_in_gaps() -> None:
    at = np.r_[np.arange(30.0), np.arange(90.0, 121.0)][::-1]
    times = np.sort(at[marked(at, 0.5, 120.0)])
    assert times.tolist() == [5, 15, 25, 90, 95, 105, 115]
    assert marked(np.empty(0), 0.5, 120.0).tolist() == []
    assert marked(np.zeros(1), 0.1, 0.0).tolist() == [0]


def test_a_name_with_a_formula_is_drawn_as_it_is(tmp_path: Path) -> None:
    fixes = log_samples.own()["fixes.csv"].replace("usbl", "$\\frac{")
    text = "arrival_ns,beacon,range_m\n"
    contents = sblcosim.log(_made(tmp_path, **{"fixes.csv": fixes, "receptions.csv": text}))
    contents.save(tmp_path / "out")
    assert (tmp_path / "out" / "log.png").stat().st_size > 10_000


def test_the_command_writes_tables_and_a_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    _made(tmp_path, "capture")
    done = CliRunner().invoke(app, ["log", "dive.jsonl", "--json"], catch_exceptions=False)
    assert done.exit_code == 0
    said = json.loads(done.stdout)
    assert said["folder"] == str(Path("runs/dive-log"))
    assert sum(row["ranges"] for row in said["beacons"]) == 158
    assert sum(row["repeated"] for row in said["beacons"]) == 16
    for table in ("beacons", "series", "flaws"):
        assert len(pd.read_csv(Path("runs/dive-log") / f"{table}.csv")) == len(said[table])
    assert images.imread("runs/dive-log/log.png").shape[0] > 500
    again = CliRunner().invoke(app, ["log", "dive.jsonl"], catch_exceptions=False)
    assert again.stdout.endswith("written to runs/dive-log\n")


def test_a_mapping_is_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    _made(tmp_path, "long")
    (tmp_path / "meta.toml").rename("mine.toml")
    done = CliRunner().invoke(
        app, ["log", ".", "--mapping", "mine.toml", "--no-figures"], catch_exceptions=False
    )
    assert done.exit_code == 0
    assert ". (mine): 160 ranges of 4 beacons, 40 depths" in done.stdout
    assert not (tmp_path / "runs" / "mine-log" / "log.png").exists()
    wrong = CliRunner().invoke(app, ["log", ".", "--mapping", "no.toml"])
    assert wrong.exit_code == 2
    assert wrong.stderr == "error: --mapping: must be a TOML file, got 'no.toml'\n"


@pytest.mark.parametrize("start_s", [0.0, 50.0, 1.7e9])
def test_a_log_tells_how_long_it_is_whenever_it_began(start_s: float) -> None:
    log = made(seconds=90, start_s=start_s)
    assert "of 89 s: 90 ranges of 4 beacons" in repr(log)


@pytest.mark.parametrize(("begins", "date"), [
    (0, None), (86_400, None), (31_536_000, None), (946_684_799, None),
    (946_684_800, "2000-01-01 00:00"), (1_700_000_000, "2023-11-14 22:13"),
])  # fmt: skip
def test_times_are_dates_from_the_year_2000_on(begins: int, date: str | None) -> None:
    """Others count from a zero of the source, however long ago that was."""
    log = made(seconds=20, start_s=begins - 1)
    assert log.start_ns == begins * 10**9
    assert log.dated == (date is not None)
    found = contents_of(log)
    said = found.to_json()["start_utc"]
    assert (said is None) if date is None else said.startswith(date)
    assert ("without a date" in found.text()) == (date is None)


# --- All that is told of a small log --------------------------------------------------------------


def small(last: float = 70.0, **meta: object) -> Log:
    """Ranges of two beacons of three, one with a gap, and what was left out; times in s from 5."""
    at = [5.0, 6.0, 6.5, 7.0, 8.0, 9.5, 9.75, 20.0, 30.0, 40.0]
    return checked(
        meta,
        receptions={
            "time_ns": [round(it * 1e9) for it in at], "beacon": [*"AABAABBABA"],
            "range_m": [10.0, 12.0, 40.0, 15.0, 11.0, 44.0, 43.0, 30.0, 50.0, -1.0],
            "kind": ["range"] * 10, "repeated": [*[""] * 6, "1", "", "", ""],
        },
        depth={"time_ns": [round(it * 1e9) for it in (5.0, 35.0, last)],
               "depth_m": [3.0, 4.0, -1.0]},
        truth={"time_ns": [6 * 10**9, 8 * 10**9], "n_m": [1.0, 2.0], "e_m": [1.0, 2.0],
               "d_m": [1.0, 2.0]},
        fixes={"time_ns": [8 * 10**9, 10 * 10**9, 12 * 10**9], "device": ["usbl"] * 3,
               "n_m": [5.0, 6.0, 7.0], "e_m": [-5.0, -6.0, -8.0], "d_m": [1.0] * 3,
               "std_m": [0.5] * 3},
    )  # fmt: skip


def test_ranges_of_a_beacon_are_counted_and_timed() -> None:
    table = contents_of(small()).beacons.set_index("beacon")
    assert table.loc["A"].to_dict() == {
        "ranges": 5, "left_out": 1, "repeated": 0, "used_share": 5 / 6, "rate_Hz": 4 / 15,
        "gaps": 2, "longest_gap_s": 50.0, "first_s": 0.0, "last_s": 15.0, "shortest_m": 10.0,
        "median_m": 12.0, "longest_m": 30.0,
    }
    assert table.loc["B"].to_dict() == {
        "ranges": 3, "left_out": 1, "repeated": 1, "used_share": 0.75, "rate_Hz": 2 / 23.5,
        "gaps": 0, "longest_gap_s": 20.5, "first_s": 1.5, "last_s": 25.0, "shortest_m": 40.0,
        "median_m": 44.0, "longest_m": 50.0,
    }
    silent = table.loc["C"].to_dict()
    assert {k: silent.pop(k) for k in ("ranges", "left_out", "repeated", "gaps")} == {
        "ranges": 0, "left_out": 0, "repeated": 0, "gaps": 0,
    }
    assert np.isnan([*silent.values()]).all()
    assert len(silent) == 8
    series = contents_of(small()).series.set_index("series")
    assert series["values"].to_dict() == {"depth": 3, "truth": 2, "fixes usbl": 3}
    assert series["rate_Hz"].tolist() == [2 / 65, 0.5, 0.5]
    assert series["first_s"].tolist() == [0, 1, 3]
    assert series["last_s"].tolist() == [65, 3, 7]
    assert contents_of(small()).flaws.to_dict("records") == [
        {"file": "receptions.csv", "flaw": "a value that was only read again", "used": False,
         "entries": 1, "lines": "8"},
        {"file": "receptions.csv", "flaw": "no range from 0 m to 1,000 km", "used": False,
         "entries": 1, "lines": "11"},
    ]


def test_the_text_of_a_log_in_full() -> None:
    found = contents_of(small())
    assert found.answer == (
        "log: 8 ranges of 3 beacons, 3 depths, 3 positions by usbl, 2 true positions\n"
        "Time: 65.0 s, without a date; without a place on Earth"
    )
    left_out = [
        "receptions.csv: 1 line left out: a value that was only read again (line 8)",
        "receptions.csv: 1 line left out: no range from 0 m to 1,000 km (line 11)",
    ]
    assert found.remarks == [*left_out, "no range of C"]
    head, beacons, series, remarks = found.text().split("\n\n")
    assert head == found.answer
    rows = [re.split(r"\s{2,}", line.strip()) for line in beacons.splitlines()]
    assert rows[0] == ["beacon", "ranges", "left out", "repeated", "used", "rate [Hz]", "gaps",
                       "longest [s]", "from [m]", "median [m]", "to [m]"]  # fmt: skip
    assert rows[-3:] == [
        ["A", "5", "1", "0", "83 %", "0.267", "2", "50.0", "10.0", "12.0", "30.0"],
        ["B", "3", "1", "1", "75 %", "0.0851", "0", "20.5", "40.0", "44.0", "50.0"],
        ["C", "0", "0", "0", "–", "–", "0", "–", "–", "–", "–"],
    ]
    rows = [re.split(r"\s{2,}", line.strip()) for line in series.splitlines()]
    assert rows[-1] == ["fixes usbl", "3", "0", "0", "100 %", "0.500", "1", "58.0"]
    assert remarks.splitlines() == [f"  {line}" for line in found.remarks]
    assert found.text(verbose=True).split("\n\n")[3].splitlines() == [
        "  receptions.csv: 1 entries left out: a value that was only read again (lines 8)",
        "  receptions.csv: 1 entries left out: no range from 0 m to 1,000 km (lines 11)",
        "  no range of C",
    ]
    place = {"latitude_deg": -3.25, "longitude_deg": 170.5}
    own = {"origin": place, "clock": {"truth": "estimate"}, "dimension": 2}
    flat = contents_of(small(**own))
    assert flat.answer == (
        "log: 8 ranges of 3 beacons, 3 positions by usbl, 2 true positions\n"
        "Time: 25.0 s, without a date; origin -3.250000°, 170.500000°, horizontal only"
    )
    assert flat.remarks[-2:] == [
        "the truth has a clock of its own, and is not in the picture's timeline", "no range of C",
    ]
    assert flat.to_json()["span_s"] == 25.0
    assert flat.series["series"].tolist() == ["depth", "truth", "fixes usbl"]


@pytest.mark.parametrize(("span", "said"), [
    (119.0, "119 s"), (120.0, "2 min"), (149.0, "2 min"), (151.0, "3 min"), (7169.0, "119 min"),
    (7171.0, "2 h 0 min"), (9300.0, "2 h 35 min"), (86_340.0, "23 h 59 min"),
])  # fmt: skip
def test_spans_are_in_minutes_from_two_on_and_in_hours_from_two_on(span: float, said: str) -> None:
    log = small(stop_ns=round((5 + span) * 1e9))
    assert f"Time: {said}, without a date" in contents_of(log).answer


# --- The picture of a small log -------------------------------------------------------------------


def test_the_timeline_has_bars_between_gaps_and_a_stroke_for_each_value() -> None:
    log = small()
    axes = plot_log(log)
    timeline, ranges, depth = axes
    palette, ink = THEMES["light"].receivers, THEMES["light"].ink
    looks = {"A": (palette[0], MARKERS[1]), "B": (palette[1], MARKERS[2]),
             "C": (palette[2], MARKERS[3]), "fixes usbl": (palette[3], MARKERS[4])}  # fmt: skip
    rows = ["A", "B", "C", "depth", "truth", "fixes usbl"]
    assert [*series_of(log)] == rows
    times = {"A": [0, 1, 2, 3, 15], "B": [1.5, 4.5, 25], "depth": [0, 30, 65], "truth": [1, 3],
             "fixes usbl": [3, 5, 7]}  # fmt: skip
    strokes = [it for it in timeline.lines if it.get_marker() == "|"]
    assert [(it.get_xdata().tolist(), {*it.get_ydata()}, it.get_color()) for it in strokes] == [
        (times[name], {row}, looks.get(name, (ink,))[0]) for row, name in enumerate(rows)
        if name in times
    ]
    assert {(it.get_markersize(), it.get_markeredgewidth()) for it in strokes} == {(7.0, 0.6)}
    bars = [[segment.tolist() for segment in it.get_segments()] for it in timeline.collections]
    assert bars == [
        [[[0, 0], [3, 0]], [[15, 0], [15, 0]]], [[[1.5, 1], [25, 1]]], [[[0, 3], [65, 3]]],
        [[[1, 4], [3, 4]]], [[[3, 5], [7, 5]]],
    ]
    assert {(it.get_alpha(), *it.get_linewidth()) for it in timeline.collections} == {(0.45, 5)}
    keys = [it for it in timeline.lines if it.get_marker() != "|"]
    assert [(*it.get_xdata(), *it.get_ydata(), it.get_color(), it.get_marker(),
             it.get_markersize()) for it in keys] == [
        (1.015, row, *looks[name], 6.0) for row, name in enumerate("AB")
    ]  # fmt: skip
    assert timeline.get_ylim() == (5.6, -0.6)
    assert timeline.get_yticks().tolist() == [0, 1, 2, 3, 4, 5]
    assert [(it.get_text(), it.get_color(), it.get_fontsize()) for it in timeline.get_yticklabels()
            ] == [(name, looks.get(name, (ink,))[0], SMALL) for name in rows]  # fmt: skip
    for ax in axes:
        assert ax.get_xlim() == pytest.approx((-0.65, 65.65))
    assert [ax.get_ylabel() for ax in axes] == ["", "Range [m]", "Depth [m]"]
    assert [ax.get_xlabel() for ax in axes] == ["", "", "Time [s]"]
    figure = ranges.figure
    assert figure.get_size_inches().tolist() == pytest.approx([7.2, 0.6 + 1.5 + 2.6 + 1.4])
    ratios = depth.get_gridspec().get_height_ratios()
    assert ratios == pytest.approx([0.3 + 0.2 * 6, 2.6, 1.4])
    (dots,) = depth.lines
    assert dots.get_xdata().tolist() == [0, 30, 65]
    assert dots.get_ydata().tolist() == [3, 4, -1]
    assert depth.yaxis_inverted()
    assert (dots.get_color(), dots.get_markersize()) == (ink, 2.0)


def test_ranges_are_points_and_each_beacon_has_its_marks() -> None:
    """A mark in each twelfth of 65 s: after 1/6, and 3/6, of it."""
    log = small()
    _, ranges, _ = plot_log(log)
    palette = THEMES["light"].receivers
    dots, marks = ranges.lines[::2], ranges.lines[1::2]
    assert [it.get_xdata().tolist() for it in dots] == [[0, 1, 2, 3, 15], [1.5, 4.5, 25], []]
    assert [it.get_ydata().tolist() for it in dots] == [[10, 12, 15, 11, 30], [40, 44, 50], []]
    assert [it.get_color() for it in dots] == [*palette[:3]]
    assert {(it.get_marker(), it.get_markersize()) for it in dots} == {(".", 3.0)}
    # A: wanted at 0.9, 6.3, 11.7, … s, the next one at most 5.4 s later; B: at 2.7, 8.1, …, 24.4
    assert [it.get_xdata().tolist() for it in marks] == [[1, 15], [4.5, 25], []]
    assert [it.get_ydata().tolist() for it in marks] == [[12, 30], [44, 50], []]
    assert [(it.get_color(), it.get_marker()) for it in marks] == [
        (palette[i], MARKERS[i + 1]) for i in range(3)
    ]
    assert {(it.get_markersize(), it.get_markeredgewidth(), it.get_markeredgecolor(),
             it.get_zorder()) for it in marks} == {(6.0, 0.4, THEMES["light"].paper, 3)}


@pytest.mark.parametrize(("span", "unit", "seconds"), [
    (299.0, "s", 1), (300.0, "min", 60), (10_799.0, "min", 60), (10_800.0, "h", 3600),
])
def test_times_are_in_seconds_minutes_or_hours(span: float, unit: str, seconds: float) -> None:
    axes = plot_log(small(stop_ns=round((5 + span) * 1e9)))
    assert axes[-1].get_xlabel() == f"Time [{unit}]"
    assert axes[-1].get_xlim() == pytest.approx((-0.01 * span / seconds, 1.01 * span / seconds))
    for line in (axes[0].lines[-1], axes[2].lines[0]):
        assert line.get_xdata()[-1] == pytest.approx(
            (7 if line is axes[0].lines[-1] else 65) / seconds)
    assert axes[1].lines[0].get_xdata()[-1] == pytest.approx(15 / seconds)
    plt.close("all")


def test_positions_of_devices_are_drawn_where_there_are_no_ranges() -> None:
    fixes = {"time_ns": [10**9, 3 * 10**9, 2 * 10**9], "device": ["usbl", "usbl", "gps"],
             "n_m": [5.0, 6.0, 7.0], "e_m": [-5.0, -6.0, -8.0], "d_m": [1.0] * 3}  # fmt: skip
    log = checked({"beacons": {}, "frame": {"own_axes": ["gps"]}}, fixes=fixes)
    timeline, positions = plot_log(log)
    palette = THEMES["light"].receivers
    assert [(it.get_label(), it.get_xdata().tolist(), it.get_ydata().tolist(), it.get_marker(),
             it.get_color(), it.get_alpha(), it.get_markersize()) for it in positions.lines] == [
        ("gps, forward", [1], [7], "^", palette[0], 1.0, 2.5),
        ("gps, starboard", [1], [-8], ">", palette[0], 0.5, 2.5),
        ("usbl, north", [0, 2], [5, 6], "^", palette[1], 1.0, 2.5),
        ("usbl, east", [0, 2], [-5, -6], ">", palette[1], 0.5, 2.5),
    ]  # fmt: skip
    assert positions.get_ylabel() == "Position [m]"
    assert [it.get_text() for it in positions.get_legend().get_texts()] == [
        it.get_label() for it in positions.lines
    ]
    assert positions.figure.get_size_inches().tolist() == pytest.approx([7.2, 0.6 + 0.7 + 2.6])
    assert [it.get_text() for it in timeline.get_yticklabels()] == ["fixes gps", "fixes usbl"]
    assert positions.get_xlim() == pytest.approx((-0.02, 2.02))


@pytest.mark.parametrize(("first", "last", "gaps_", "longest", "said"), [
    (0, 300, 0, 1.0, []),
    (0, 290, 1, 10.0, []),
    (0, 289, 1, 11.0, ["in the last 11 s"]),
    (11, 300, 1, 11.0, ["in the first 11 s"]),
    (40, 200, 2, 100.0, ["in the first 40 s", "in the last 100 s"]),
    (4, 296, 0, 1.0, []),
])  # fmt: skip
def test_silence_of_the_depth_at_the_ends_of_a_log_is_a_gap_and_told(
    first: int, last: int, gaps_: int, longest: float, said: list[str]
) -> None:
    log = made(seconds=300, truth=False)
    log = replace(log, depth_ns=log.depth_ns[first:last], depth=log.depth[first:last])
    lines = [f"depth: no reading {where} of the ranges: depths and claims there are to be doubted"
             for where in said]
    found = contents_of(log)
    (row,) = (it for it in found.series.to_dict("records") if it["series"] == "depth")
    assert (row["gaps"], row["longest_gap_s"]) == (gaps_, longest)
    assert [it for it in found.remarks if it.startswith("depth: ")] == lines
    if len(said) == 1:
        for other in (sblcosim.process(log), sblcosim.identify(log)):
            assert [it for it in other.remarks if it.startswith("depth: ")] == lines


def test_a_depth_that_is_not_measured_or_of_another_time_has_no_ends() -> None:
    log = made(seconds=60)
    none = log.meta.model_copy(update={"depth_is": "none"})
    log = replace(log, depth_ns=log.depth_ns[:10], depth=log.depth[:10])
    assert len(log.without_depth()) == 1
    assert not replace(log, meta=none).without_depth()
    assert not replace(log, depth_ns=log.depth_ns + 10**11).without_depth()
    assert not replace(log, depth_ns=log.depth_ns - 10**11).without_depth()
    sparse = replace(log, depth_ns=np.arange(3) * 5 * 10**9, depth=np.full(3, 8.0))
    assert [it[:31] for it in sparse.without_depth()] == ["depth: no reading in the last 5"]
    sparse = replace(log, depth_ns=np.arange(3) * 10**10, depth=np.full(3, 8.0))
    assert not sparse.without_depth()  # 40 s, less than five pauses


def test_silence_of_a_beacon_at_the_ends_of_a_log_is_a_gap() -> None:
    log = made(seconds=120)
    heard = log.receptions
    log = replace(log, receptions=heard.chosen((heard.beacon != 1) | (heard.epoch_ns < 60 * 10**9)))
    table = contents_of(log).beacons.set_index("beacon")
    assert table["gaps"].to_dict() == {"B0": 0, "B1": 1, "B2": 0, "B3": 0}
    assert table["longest_gap_s"].round().to_dict() == {"B0": 4, "B1": 62, "B2": 4, "B3": 4}
