"""A boat on a recorded track in a page: the numbers and the words of the command line."""

from __future__ import annotations

import random
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sblcosim
from browser import BROWSER, Tab
from explored import CHOICES, LONG, NAME, NEEDS, answers, loaded, plain, settings, values
from quick import few
from sblcosim.explore.contents import contents, is_possible
from sblcosim.explore.page import render
from sblcosim.scenario.scenario import Scenario, load
from sblcosim.tracks.resample import motion

pytestmark = NEEDS
TRACK: Mapping[str, Any] = {
    "platform.track_time_s": [0.0, 20.0, 25.0, 28.0, 35.0, 60.0],
    "platform.track_m": [
        [0.0, 0.0], [12.0, 0.0], [14.0, 2.0], [14.0, 2.0], [12.0, 5.0], [-3.0, 5.0]],
    "platform.track_heading_deg": [0.0, 0.0, 80.0, 90.0, 180.0, 180.0],
}  # fmt: skip
EQUAL = 1e-9


@pytest.fixture(scope="module")
def told() -> Mapping[str, Any]:
    return contents(load(NAME, TRACK), ("coupled", "ekf"), lanes=(2,))


def drawn(numbers: random.Random, count: int) -> dict[str, Any]:
    """A track of so many points, perhaps with rests and perhaps without headings."""
    times = [it / 1000 for it in sorted(numbers.sample(range(60_000), count))]
    points = [[round(numbers.uniform(-9, 9), 3) for _ in range(2)] for _ in range(count)]
    if count > 3:
        points[2] = points[1]
    found: dict[str, Any] = {
        "platform.track_time_s": times, "platform.track_m": points,
        "platform.track_heading_deg": numbers.choice([None, [
            round(numbers.uniform(-400, 400), 2) for _ in range(count)]]),
    }
    if numbers.random() < 0.4:
        found["platform.departure_time_s"] = round(numbers.uniform(0, 20), 2)
    if count > 2 and numbers.random() < 0.2:
        found["platform.track_count"] = numbers.randint(2, count)
    return found


@pytest.mark.parametrize("count", few([25, 250], quick=[25]))
def test_tracks_at_random(told: Mapping[str, Any], count: int, tmp_path: Path) -> None:
    """With other settings at random: the record to the last bit, and what is possible."""
    numbers, jobs = random.Random(count), []
    while len(jobs) < count:
        given = {
            **settings(numbers, 4, LONG), **drawn(numbers, numbers.choice([2, 3, 7, 40, 256])),
            "time.duration_s": numbers.choice([20.0, 45.0]),
        }
        receivers = numbers.choice(CHOICES)
        python = {key: value for key, value in given.items() if value is not None}
        if isinstance(loaded(NAME, python, receivers), Scenario):
            own = {"given": given, "seed": numbers.randrange(2**31), "receivers": receivers}
            jobs.append({"settings": own, "ask": ["toml", "record"], "possible": 1})
    compared, matters = 0, 0
    for job, answer in zip(jobs, answers(told, jobs, tmp_path), strict=True):
        if answer["refused"] is not None:
            assert "echo_probability" in answer["refused"], job
            continue
        (tmp_path / "s.toml").write_text(answer["toml"])
        run = sblcosim.run(tmp_path / "s.toml", job["settings"]["receivers"])
        assert answer["record"].keys() == run.record.values.keys()
        for name, expected in run.record.values.items():
            np.testing.assert_array_equal(
                values(answer["record"][name], expected), expected, err_msg=name)
        for label, expected in run.verdicts.items():
            found = answer["possible"]["receivers"][label]
            assert found["absolute"] == pytest.approx(expected.absolute_rms, rel=EQUAL)
            assert found["relative"] == pytest.approx(expected.relative_rms, rel=EQUAL)
            left_out = [np.nan if it is None else it for it in found["leftOut"].values()]
            assert left_out == pytest.approx([*expected.matters.values()], rel=EQUAL, nan_ok=True)
            matters += len(left_out)
        compared += 1
    assert compared > 0.9 * count
    assert matters > 0


def test_what_is_left_out_turns_with_the_boat(told: Mapping[str, Any], tmp_path: Path) -> None:
    """Errors of the mounting and of the attitude, of a boat that is far from where it began."""
    jobs = [{
        "settings": {"given": {
            "time.duration_s": 60.0, "platform.mean_heading_deg": 30.0,
            "platform.mean_position_m": [3.0, -2.0, 0.0], **own,
        }, "receivers": ["coupled"]}, "ask": ["toml"], "possible": 1,
    } for own in (
        {"platform.mounting_std_m": 0.2, "platform.mounting_error_m": [[0.5, 0.0, 0.1]] * 4},
        {"platform.imu_tilt_drift_deg_s": 1.0, "platform.imu_heading_drift_deg_s": 0.5},
    )]  # fmt: skip
    for answer in answers(told, jobs, tmp_path):
        (tmp_path / "s.toml").write_text(answer["toml"])
        expected = sblcosim.run(tmp_path / "s.toml", "coupled").verdicts["coupled"]
        found = answer["possible"]["receivers"]["coupled"]
        assert expected.matters
        assert [*found["leftOut"].values()] == pytest.approx(
            [*expected.matters.values()], rel=EQUAL)


WRONG: tuple[Mapping[str, Any], ...] = (
    {"track_m": [[0.0, 1.0]]}, {"track_time_s": [0.0]}, {"track_count": 7}, {"track_count": 1},
    {"track_heading_deg": [0.0]}, {"track_time_s": [0.0, 5.0, 5.0, 6.0, 7.0, 8.0]},
    {"track_time_s": [0.0, 5.0]}, {"track_time_s": None},
)


def test_contradictions_are_refused_in_the_same_words(
    told: Mapping[str, Any], tmp_path: Path
) -> None:
    jobs = [{"settings": {"given": {f"platform.{key}": value for key, value in it.items()}}}
            for it in WRONG]
    refused = 0
    for job, answer in zip(jobs, answers(told, jobs, tmp_path), strict=True):
        given = {**TRACK, "platform.track_count": None, **job["settings"]["given"]}
        python = loaded(NAME, {k: v for k, v in given.items() if v is not None}, ("coupled",))
        if isinstance(python, str):
            assert plain(answer["refused"] or "", NAME) == plain(python, NAME)
            refused += 1
        else:
            assert answer["refused"] is None, job
    assert refused == len(WRONG) - 1  # without times there is no track


def test_a_page_refuses_more_points_than_its_components_have(
    told: Mapping[str, Any], tmp_path: Path
) -> None:
    """Others, of a scenario without a track, have none."""
    many = {"platform.track_time_s": [float(i) for i in range(257)],
            "platform.track_m": [[float(i), 0.0] for i in range(257)],
            "platform.track_heading_deg": None}
    (answer,) = answers(told, [{"settings": {"given": many}}], tmp_path)
    assert answer["refused"] == (
        "[platform] track_time_s: must have at most 256 points in this page, got 257")
    other = contents(load(NAME), lanes=(2,))
    (answer,) = answers(other, [{"settings": {"given": dict(TRACK)}}], tmp_path)
    assert answer["refused"] == (
        "[platform] track_time_s: must be left out in this page, as its scenario has no boat on a "
        "track")
    assert is_possible(load(NAME, TRACK), "ekf")


@pytest.mark.slow
def test_a_page_of_a_longer_track_follows_it(tmp_path: Path) -> None:
    numbers = random.Random(3)
    told = contents(load(NAME, drawn(numbers, 300)), ("ekf",), lanes=(2,))
    jobs = [{"settings": {"given": drawn(numbers, 1024)}, "ask": ["toml", "record"]}]
    for answer in answers(told, jobs, tmp_path):
        (tmp_path / "s.toml").write_text(answer["toml"])
        run = sblcosim.run(tmp_path / "s.toml", "ekf")
        for name, expected in run.record.values.items():
            np.testing.assert_array_equal(values(answer["record"][name], expected), expected)


def test_a_track_is_set_and_taken_away(told: Mapping[str, Any], tmp_path: Path) -> None:
    rows = [[0, 0, 0, 10], [30, 5.0004, 1, 20], [60.5, 9, 9, -30]]
    plain_rows = [it[:3] for it in rows]
    (answer,) = answers(told, [{
        "steps": [["setTrack", rows], ["setTrack", [[0, 1, 2]]], ["setTrack", plain_rows],
                  ["setTrack", []]], "ask": ["toml", "track", "isUnderWay"],
    }, ], tmp_path)  # fmt: skip
    assert answer["steps"] == [None, "[platform] track_file: must be the file of a track (or "
                               "track_time_s and track_m its points) when there is a track, got "
                               "one point", None, None]
    assert [answer["track"], answer["isUnderWay"]] == [[], False]
    assert "track" not in answer["toml"].partition("[platform]")[2].partition("[acoustics]")[0]
    first, second = answers(told, [
        {"steps": [["setTrack", it]], "ask": ["toml", "track"]} for it in (rows, plain_rows)
    ], tmp_path)
    assert first["track"] == [[0, 0, 0, 10], [30, 5, 1, 20], [60.5, 9, 9, -30]]
    assert second["track"] == [[0, 0, 0], [30, 5, 1], [60.5, 9, 9]]
    (tmp_path / "s.toml").write_text(first["toml"])
    assert load(tmp_path / "s.toml").platform.track_heading_deg == (10.0, 20.0, -30.0)


# --- In a browser --------------------------------------------------------------------------------


@pytest.fixture
def browsing(told: dict[str, Any], tmp_path: Path) -> Iterator[Callable[..., Tab]]:
    if BROWSER is None:
        pytest.skip("needs Chromium")
    file, tabs = tmp_path / "boat.html", []
    file.write_text(render(told), "utf-8")

    def open_(width: int = 1400) -> Tab:
        tab = Tab(tmp_path, width, 844 if width < 500 else 1000)
        tabs.append(tab)
        tab.open(file)
        return tab

    try:
        yield open_
        for tab in tabs:
            assert tab.complaints == []
            assert {it for it in tab.asked if not it.startswith("blob:")} == {file.as_uri()}
    finally:
        for tab in tabs:
            tab.close()


HELPERS = """
const $ = (id) => document.getElementById(id);
const settle = async () => { await frame(); await frame(); };
const until = async (holds) => {
  for (let i = 0; i < 500 && !holds(); i++) await sleep(20);
  await settle();
};
const drop = async (name, text) => {
  const data = new DataTransfer();
  data.items.add(new File([text], name));
  const how = { dataTransfer: data, bubbles: true, cancelable: true };
  $("dive").dispatchEvent(new DragEvent("drop", how));
  await sleep(50);
  await settle();
};
"""


def test_the_map_shows_the_way_and_points_can_be_changed(browsing: Callable[..., Tab]) -> None:
    """By keyboard, with labels; without a track, the boat stays where it is."""
    shown = browsing().run(f"""{HELPERS}
      const told = () => ({{
        points: $("boat-points").value.split("\\n"), sails: page.stage.run.sails,
        says: $("map").getAttribute("aria-label").includes("; the boat is at "),
        legend: getComputedStyle(document.querySelector(".of-boat")).display !== "none",
        reset: !$("reset-boat").hidden, problem: $("boat-problem").textContent }});
      const labels = ["boat-file", "boat-points"].map((it) => $(it).labels.length);
      const set = async (text) => {{
        $("boat-points").value = text;
        $("use-boat").click();
        await settle();
        return told();
      }};
      const pixels = () => $("map").toDataURL();
      const first = told(), whole = pixels();
      page.stage.run.sails = false;
      page.stage.drawMap();
      const without = pixels();
      return {{ labels, first, drawn: whole !== without,
        wrong: await set("0, 1, 2, 3\\n4, 5"), moved: await set("0, 1, 2\\n30, 4, 5"),
        none: await set("") }};
    """)
    assert shown["labels"] == [1, 1]
    assert shown["first"]["points"][2] == "25, 14, 2, 80"
    seen = ("sails", "says", "legend", "reset")
    assert [shown["first"][it] for it in seen] == [True, True, True, False]
    assert shown["drawn"]
    assert shown["wrong"]["problem"] == (
        "point 2: must be four numbers, time, north, east and heading, as the first one is, got "
        "'4, 5'")
    assert shown["moved"]["points"] == ["0, 1, 2", "30, 4, 5"]
    assert [shown["moved"][it] for it in ("sails", "reset", "problem")] == [True, True, ""]
    assert [shown["none"][it] for it in seen] == [False, False, False, True]


def corners(step: float) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Times and places of a boat that goes along three sides of a square, and rests."""
    times = np.arange(0.0, 160.0 + step, step)
    sides = [0.0, 40.0, 60.0, 100.0, 140.0, 160.0]
    places = np.stack([np.interp(times, sides, it) for it in (
        [0, 20, 20, 20, 0, 0], [0, 0, 0, 20, 20, 20])], axis=1)
    return times, places


@pytest.mark.parametrize("kind", ["csv", "csv with headings", "gpx"])
def test_a_file_is_asked_whose_it_is(
    browsing: Callable[..., Tab], kind: str, tmp_path: Path
) -> None:
    """The boat is where the command line has it with the same file, and points where it does."""
    times, places = corners(1.0)
    name = "way.gpx" if kind == "gpx" else "way.csv"
    if kind == "gpx":
        rows = [f'<trkpt lat="{42 + n / 111075.0}" lon="{14 + e / 82850.0}"><ele>0</ele><time>'
                f"2026-06-01T10:{int(t) // 60:02}:{int(t) % 60:02}Z</time></trkpt>"
                for t, (n, e) in zip(times, places, strict=True)]
        text = f'<gpx version="1.1"><trk><trkseg>{"".join(rows)}</trkseg></trk></gpx>'
    else:
        more = ",heading_deg" if "headings" in kind else ""
        rows = [f"{t + 100},{n},{e}" + (f",{(350 + t) % 360}" if more else "")
                for t, (n, e) in zip(times, places, strict=True)]
        text = "\n".join([f"time_s,north_m,east_m{more}", *rows])
    (tmp_path / name).write_text(text.replace('version="1.1"', 'version="1.1" creator="x" '
                                              'xmlns="http://www.topografix.com/GPX/1/1"'))
    tab = browsing()
    found = tab.run(f"""{HELPERS}
      await drop({name!r}, {text!r});
      const asked = [$("ask-whose").hidden, $("whose-file").textContent, document.activeElement.id];
      $("of-the-boat").click();
      await until(() => $("boat-words").textContent + $("boat-problem").textContent);
      return {{ asked, hidden: $("ask-whose").hidden, track: page.explorer.track,
        problem: $("boat-problem").textContent, words: $("boat-words").textContent }};
    """)
    assert found["asked"] == [False, f"{name} is of", "of-the-diver"]
    assert [found["hidden"], found["problem"]] == [True, ""]
    assert found["words"].startswith(f"{name}: {len(found['track'])} points of {len(times)} points")
    rows_of = np.array(found["track"])
    assert len(rows_of) < 60
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        p = load({"platform": {"track_file": str(tmp_path / name)}}).platform
    theirs = np.column_stack([np.reshape(p.track_m, (-1, 2)), p.track_heading_deg])
    at = np.arange(0.0, times[-1], 0.25)
    mine, _ = motion(rows_of[:, 0], rows_of[:, 1:], at)
    known, _ = motion(np.array(p.track_time_s), theirs, at)
    assert np.hypot(*(mine - known)[:, :2].T).max() < 0.4
    turned = (mine - known)[:, 2]
    assert np.abs((turned + 180) % 360 - 180).max() < 14


def test_a_file_may_be_of_the_diver_or_of_nobody(browsing: Callable[..., Tab]) -> None:
    text = "time_s,north_m,east_m,down_m\n0,1,2,3\n9,11,2,4\n"
    found = browsing().run(f"""{HELPERS}
      const track = JSON.stringify(page.explorer.track), seen = {{}};
      await drop("a.csv", {text!r});
      $("of-nobody").click();
      await settle();
      seen.nobody = [$("ask-whose").hidden, page.explorer.changed.length];
      await drop("a.csv", {text!r});
      const escape = new KeyboardEvent("keydown", {{ key: "Escape", bubbles: true }});
      $("ask-whose").dispatchEvent(escape);
      seen.escaped = [$("ask-whose").hidden, page.explorer.changed.length];
      await drop("a.csv", {text!r});
      $("of-the-diver").click();
      await until(() => $("path-words").textContent);
      seen.diver = page.explorer.pathPoints;
      seen.same = track === JSON.stringify(page.explorer.track);
      await drop("b.csv", "north_m,east_m\\n1,2\\n3,4\\n");
      $("of-the-boat").click();
      await until(() => $("boat-problem").textContent);
      seen.problem = $("boat-problem").textContent;
      return seen;
    """)
    assert found["nobody"] == found["escaped"] == [True, 0]
    assert found["diver"] == [[1, 2, 3], [11, 2, 4]]
    assert found["same"]
    assert found["problem"] == (
        "b.csv: must have the column time_s or time, got north_m, east_m")
