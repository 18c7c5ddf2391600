"""What `sblcosim log` says: counts, rates, gaps, repeats, lines, and a picture without gaps."""

from __future__ import annotations

import json
from pathlib import Path

import log_samples
import matplotlib.image as images
import numpy as np
import pandas as pd
import pytest
import sblcosim
from made_logs import made
from sblcosim.cli.common.app import app
from sblcosim.logs.contents import LogContents, contents_of
from sblcosim.logs.figures import gaps, marked, plot_log
from sblcosim.logs.tables import BEACONS, FLAWS, SERIES
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
