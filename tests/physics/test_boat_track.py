"""A boat on a recorded track: where it is and where it points, and what receivers make of it."""

from __future__ import annotations

import warnings
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sblcosim
from sblcosim.errors import ConfigurationError
from sblcosim.limits.unknown import squares
from sblcosim.models import file_name, of_file
from sblcosim.models.loading import load as model_of
from sblcosim.scenario.arrangement import has_own_errors
from sblcosim.scenario.conditions import conditions as words_of
from sblcosim.scenario.scenario import load
from sblcosim.scenario.starter import starter
from sblcosim.tracks.course import TURN, headed
from sblcosim.tracks.resample import motion

from .from_the_model import dive, platform
from .near_the_bound import found_in

RUNS = 200
_FEW = 100
SEA = {"motion": "spectrum", "wave_height_m": 0.3, "watch_circle_m": 2.0}
# Out, a turn to the right, a stop, and back along another line.
TIMES = [0.0, 20.0, 25.0, 28.0, 35.0, 60.0]
POINTS = [[0.0, 0.0], [12.0, 0.0], [14.0, 2.0], [14.0, 2.0], [12.0, 5.0], [-3.0, 5.0]]
HEADINGS = [0.0, 0.0, 80.0, 90.0, 180.0, 180.0]
TRACK = {"track_time_s": TIMES, "track_m": POINTS, "track_heading_deg": HEADINGS}


def keys_of(*tables: dict[str, Any]) -> dict[str, Any]:
    return {f"platform.{key}": it for table in tables for key, it in table.items()}


@pytest.mark.parametrize("master", ["python", "native", "lanes"])
@pytest.mark.parametrize("sea", [{}, SEA])
def test_it_is_where_its_track_says_and_turns_there(master: str, sea: dict[str, Any]) -> None:
    short = {"time.duration_s": 40.0}
    delayed = {**TRACK, "departure_time_s": 4.0}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        under_way, moored = (
            sblcosim.run("realistic-dive", "multilateration", {**keys_of(sea, it), **short},
                         master=master).record
            for it in (delayed, {})
        )
    since = (under_way.time_ns - under_way.time_ns[0]) / 1e9 - 4.0
    expected, _ = motion(np.array(TIMES), np.column_stack([POINTS, np.radians(HEADINGS)]), since)
    attitude = "platform.attitude"
    turned = under_way.values[attitude] - moored.values[attitude]
    assert turned[:, 2] == pytest.approx(expected[:, 2], abs=1e-12)
    assert np.ptp(expected[:, 2]) > np.radians(170)
    moved = under_way.values["platform.position"] - moored.values["platform.position"]
    assert moved == pytest.approx(np.column_stack([expected[:, :2], 0 * since]), abs=1e-9)
    if not sea:
        return
    tilt = np.hypot(*(under_way.values[attitude][:, i] for i in (0, 1)))
    assert tilt == pytest.approx(np.hypot(*(moored.values[attitude][:, i] for i in (0, 1))))
    assert not np.allclose(under_way.values[attitude][:, 0], moored.values[attitude][:, 0])


@pytest.mark.parametrize("sea", [{}, SEA])
def test_masters_give_the_same_bits(sea: dict[str, Any]) -> None:
    records = [
        sblcosim.run("realistic-dive", "coupled", {**keys_of(sea, TRACK), "time.duration_s": 8.0},
                     master=master, fmi=fmi).record
        for master, fmi in (("python", 2), ("native", 3), ("lanes", 2))
    ]
    for name, values in records[0].values.items():
        for other in records[1:]:
            assert np.array_equal(values, other.values[name], equal_nan=True), name


def test_a_platform_without_a_track_has_no_code_for_it() -> None:
    without, following = model_of("platform"), model_of("platform", boat_points=256)
    assert not without.advance
    assert following.advance == ("leg",)
    assert {*following.states} - {*without.states} == {
        "cursor", "leg_begin", "leg_end", "node_position", "node_velocity", "next_position",
        "next_velocity",
    }
    assert not without.variants[0].rows
    assert {*following.variants[0].rows} == {"initial", "leg"}
    n = {model.component.name: model.variants[0].output.n_instructions()
         for model in (without, following)}
    assert n["Platform"] < n["Platform256"]


@pytest.mark.parametrize("constants", [
    {}, {"beacons": 6}, {"boat_points": 256}, {"beacons": 6, "boat_points": 256},
])
def test_a_file_has_the_constants_of_its_build_in_its_name(constants: dict[str, int]) -> None:
    assert of_file(file_name("platform", **constants)) == ("platform", constants)


def _file(folder: Path, name: str = "boat.csv", head: str = "time_s,north_m,east_m") -> Path:
    """A track at 1 Hz along the sides of a square of 20 m, clockwise."""
    corners = np.array([[0, 0], [20, 0], [20, 20], [0, 20], [0, 0]], float)
    lines = [head]
    for second in range(161):
        side, rest = divmod(second, 40)
        begin, end = corners[min(side, 3)], corners[min(side, 3) + 1]
        n, e = end if side > 3 else begin + rest / 40 * (end - begin)
        lines.append(f"{second},{n},{e}")
    (folder / name).write_text("\n".join(lines), "utf-8")
    return folder / name


def test_a_file_says_where_it_is_and_it_points_where_it_goes(tmp_path: Path) -> None:
    file = _file(tmp_path)
    p = load({"platform": {"track_file": str(file), "track_tolerance_m": 0.05}}).platform
    assert p.track_file is None
    assert p.mean_heading_deg == 0.0
    at = np.arange(0.0, 160.5, 0.5)
    points = np.column_stack([np.reshape(p.track_m, (-1, 2)), p.track_heading_deg])
    found, _ = motion(np.array(p.track_time_s), points, at)
    straight = [np.interp(at, np.arange(0, 161, 40.0), side)
                for side in ([0, 20, 20, 0, 0], [0, 0, 20, 20, 0])]
    assert np.hypot(*(found[:, :2].T - straight)).max() <= 0.05
    on_legs = np.abs((at + 20) % 40 - 20) > TURN / 2
    legs = 90.0 * (at // 40)
    assert found[on_legs, 2] == pytest.approx(legs[on_legs], abs=6.0)
    for corner in (40.0, 80.0, 120.0):
        assert np.interp(corner, at, found[:, 2]) == pytest.approx(90 * corner / 40 - 45, abs=6.0)


def _headed(folder: Path, headings: list[Any], head: str = "heading_deg") -> str:
    """A boat that drifts to the east at 0.2 m/s, with headings every 20 s."""
    rows = [f"{20 * i},0,{4 * i},{it}" for i, it in enumerate(headings)]
    file = folder / "headed.csv"
    file.write_text("\n".join([f"time_s,north_m,east_m,{head}", *rows]), "utf-8")
    return str(file)


def test_a_column_of_headings_is_followed_along_the_shorter_way(tmp_path: Path) -> None:
    """Through north and back, and on through south; the course to the east does not matter."""
    headings = [350.0, 10.0, 350.0, 350.0, 260.0, 170.0, 80.0, -10.0]
    p = load({"platform": {"track_file": _headed(tmp_path, headings)}}).platform
    assert (p.mean_heading_deg, p.track_file) == (0.0, None)
    at = np.arange(0.0, 141.0)
    points = np.column_stack([np.reshape(p.track_m, (-1, 2)), p.track_heading_deg])
    found, _ = motion(np.array(p.track_time_s), points, at)
    straight = np.interp(at, 20.0 * np.arange(8), [350, 370, 350, 350, 260, 170, 80, -10])
    assert found[:, 2] == pytest.approx(straight, abs=6.0)  # 0.1 rad where points are left out
    assert found[:, 1] == pytest.approx(0.2 * at, abs=0.1)
    result = sblcosim.run("realistic-dive", "multilateration", {
        "platform.track_file": _headed(tmp_path, headings), "platform.yaw_amplitude_deg": 0.0,
        "platform.beaufort": 0, "time.duration_s": 50.0,
    })
    yaw = np.degrees(result.record.values["platform.attitude"][:, 2])
    turned = (yaw - np.interp(result.record.time_ns / 1e9, at, straight) + 180) % 360 - 180
    assert np.abs(turned).max() < 6.0


@pytest.mark.parametrize(("headings", "head", "more", "words"), [
    ([0, "north"], "heading_deg", {}, "line 3, column 4 (heading_deg): must be a number from -360 "
     "to 360, got 'north'"),
    ([0, 400], "heading_deg", {}, "must be a number from -360 to 360, got '400'"),
    ([0, ""], "heading_deg", {}, "must be a number from -360 to 360"),
    ([0, 1], "heading", {}, "headed.csv, line 1, column 4: must be heading_deg for headings, from "
     "true north, got 'heading'"),
    ([0, 1], "heading_deg", {"mean_heading_deg": 20.0}, "[platform] mean_heading_deg: must be left "
     "out, as"),
])  # fmt: skip
def test_headings_that_cannot_be_followed_are_told(
    tmp_path: Path, headings: list[Any], head: str, more: dict[str, Any], words: str
) -> None:
    with pytest.raises(ConfigurationError) as caught:
        load({"platform": {"track_file": _headed(tmp_path, headings, head), **more}})
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_diver_has_no_headings(tmp_path: Path) -> None:
    file = tmp_path / "dive.csv"
    file.write_text("time_s,north_m,east_m,down_m,heading_deg\n0,0,5,3,x\n60,20,5,4,y\n", "utf-8")
    target = load({"target": {"trajectory": "file", "track_file": str(file)}}).target
    assert target.track_m[:3] == (0.0, 5.0, 3.0)
    assert target.track_m[-3:] == (20.0, 5.0, 4.0)


def test_a_given_heading_stays(tmp_path: Path) -> None:
    file = _file(tmp_path)
    p = load({"platform": {"track_file": str(file), "mean_heading_deg": 20.0}}).platform
    assert p.mean_heading_deg == 20.0
    assert not any(p.track_heading_deg)
    assert p.track_count < 30


def test_a_boat_at_rest_keeps_its_heading() -> None:
    times = np.arange(0.0, 60.0)
    moves = np.clip(times - 20, 0, 15)
    jitter = 0.02 * np.sin(7 * times)
    at, heading = headed(times, np.column_stack([0 * times + jitter, moves]), 0.1)
    assert heading[(at > 13) & (at < 42)] == pytest.approx(np.pi / 2, abs=0.1)
    assert abs(np.diff(heading)).max() < 0.05
    still = headed(times, np.zeros((len(times), 2)), 0.1)[1]
    assert not still.any()


def test_files_with_and_without_depths(tmp_path: Path) -> None:
    """A boat floats: depths and elevations do not matter, and may be missing."""
    plain = load({"platform": {"track_file": str(_file(tmp_path))}}).platform
    text = (tmp_path / "boat.csv").read_text("utf-8").splitlines()
    deep = [text[0] + ",down_m", *(f"{line},{7.0}" for line in text[1:])]
    (tmp_path / "deep.csv").write_text("\n".join(deep), "utf-8")
    same = load({"platform": {"track_file": str(tmp_path / "deep.csv")}}).platform
    assert same.track_m == plain.track_m
    points = "".join(
        f'<trkpt lat="{42 + i * 1e-4}" lon="14"><time>2026-06-01T10:{i:02}:00Z</time></trkpt>'
        for i in range(5)
    )
    gpx = '<gpx version="1.1" creator="x" xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>'
    (tmp_path / "boat.gpx").write_text(f"{gpx}{points}</trkseg></trk></gpx>", "utf-8")
    there = load({"platform": {"track_file": str(tmp_path / "boat.gpx")}})
    assert there.place.latitude_deg == 42.0
    assert there.platform.track_m[-2] == pytest.approx(4 * 11.1, abs=0.1)
    with pytest.raises(ConfigurationError, match="must have an elevation"):
        load({"target": {"trajectory": "file", "track_file": str(tmp_path / "boat.gpx")}})


def test_a_new_scenario_names_the_file_again(tmp_path: Path) -> None:
    file = _file(tmp_path)
    scenario = load({"platform": {"track_file": str(file)}})
    assert scenario.about_tracks[0].startswith("boat.csv: the boat follows ")
    text = starter("other", scenario, short=True)
    assert f'track_file = "{file}"' in text
    assert "track_m" not in text
    again = load(scenario, {"platform.track_m": [[0, 0], [1, 0]],
                            "platform.track_time_s": [0, 9], "platform.track_count": 2,
                            "platform.track_heading_deg": [0, 0]})
    assert not again.recorded
    both = {"target": {"trajectory": "file", "track_file": str(_dive(tmp_path))},
            "platform": {"track_file": str(file)}}
    assert [it.split(":")[0] for it in load(both).about_tracks] == ["dive.csv", "boat.csv"]


def _dive(folder: Path) -> Path:
    file = folder / "dive.csv"
    file.write_text("time_s,north_m,east_m,down_m\n0,0,5,3\n60,20,5,4\n", "utf-8")
    return file


def test_receivers_are_told_how_fast_it_changes() -> None:
    found = load({"platform": TRACK}).assumptions()
    v = np.diff(POINTS, axis=0) / np.diff(TIMES)[:, None]
    mean = (np.diff(TIMES) * (v**2).sum(axis=1)).sum() / 120.0
    changes = (np.diff(v, axis=0, prepend=[[0, 0]], append=[[0, 0]]) ** 2).sum() / 120.0
    std, time = found["platform_velocity_std_m_s"], found["platform_velocity_time_s"]
    assert std == pytest.approx(sqrt(mean))
    assert 2 * std**2 / time == pytest.approx(changes)
    yaw = np.diff(HEADINGS) / np.diff(TIMES)
    std, time = found["heading_rate_std_deg_s"], found["heading_rate_time_s"]
    assert std == pytest.approx(sqrt((np.diff(TIMES) * yaw**2).sum() / 60.0))
    assert 2 * std**2 / time == pytest.approx((np.diff(yaw, prepend=0, append=0) ** 2).sum() / 60)
    waves = {"surge_amplitude_m": 0.2, "surge_frequency_Hz": 0.3}
    rough, calm = (load({"platform": it}).assumptions() for it in ({**TRACK, **waves}, waves))
    key = "platform_velocity_std_m_s"
    assert rough[key] ** 2 == pytest.approx(calm[key] ** 2 + mean)


@pytest.mark.parametrize("more", [{}, {"packet_content": "pose", "packet_resolution_m": 0.01}])
def test_coupled_is_near_the_bound_while_the_boat_turns(more: dict[str, Any]) -> None:
    """The boat goes out and back with a turn of 180°; errors and the diver's motion are drawn."""
    scenario = dive(
        {"sampling_time_s": 0.5, "duration_s": 60.0},
        {**platform(3.0), **TRACK},
        {"range_std_m": 0.05, "loss_probability": 0.15, **more},
        {"acceleration_psd_m2_s3": 0.002},
    )
    found = found_in(scenario, RUNS)
    assert found.lost == 0.0
    assert found.is_near
    assert 2.7 < found.nees < 3.4


def test_a_receiver_that_is_not_told_is_worse() -> None:
    """Without its speed and turns, the boat is taken for moored."""
    scenario = dive(
        {"sampling_time_s": 0.5, "duration_s": 60.0}, {**platform(3.0), **TRACK},
        {"range_std_m": 0.05, "loss_probability": 0.15}, {"acceleration_psd_m2_s3": 0.002},
    )
    rates = ("platform_velocity_std", "heading_rate_std")
    still = dict.fromkeys((f"coupled.{it}" for it in rates), np.array([1e-3]))
    assert found_in(scenario, _FEW, **still).nees > 6.0


def test_what_is_left_out_is_where_the_boat_is_then() -> None:
    """A diver who goes and turns with the boat has the same error as beside one at rest."""
    keys = {"platform.mounting_std_m": 0.05, "platform.mounting_error_m": [[0.2, 0, 0]] * 4,
            "platform.mean_heading_deg": 10.0, "platform.mean_position_m": [3.0, -2.0, 0.0]}
    time = np.array([0.0, 22.0, 50.0])
    there = np.array([[20.0, 4.0, 5.0]] * 3)
    way, _ = motion(np.array(TIMES), np.column_stack([POINTS, np.radians(HEADINGS)]), time)
    c, s = np.cos(way[:, 2]), np.sin(way[:, 2])
    n, e, d = (there - [3.0, -2.0, 0.0]).T
    beside = np.column_stack([c * n - s * e + way[:, 0] + 3, s * n + c * e + way[:, 1] - 2, d])
    moored = squares(load("realistic-dive", keys), there, time)
    under_way = squares(load("realistic-dive", {**keys, **keys_of(TRACK)}), beside, time)
    assert moored
    for words, it in moored.items():
        assert under_way[words] == pytest.approx(it)


def test_the_data_sheet_says_so_and_surveyed_beacons_do_not_sail() -> None:
    assert "boat on a recorded track" in words_of(load({"platform": TRACK}))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert not has_own_errors(load("harbour-lbl", keys_of(TRACK)).platform)


def test_a_map_refuses_it() -> None:
    with pytest.raises(ConfigurationError, match="track_m: must be left out for a map") as caught:
        sblcosim.map_area("realistic-dive", "20x20", 5, cells=3, runs=2, overrides=keys_of(TRACK))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("keys", "words"), [
    ({"track_time_s": [0, 5]}, "[platform] track_m: must have a row for each of 2 times, got 0"),
    ({"track_count": 2}, "[platform] track_file: must be the file of a track (or track_time_s and "
     "track_m its points) when there is a track, got none"),
    ({**TRACK, "track_count": 7}, "[platform] track_count: must be from 2 to 6, got 7"),
    ({**TRACK, "track_count": 1}, "[platform] track_count: must be from 2 to 6, got 1"),
    ({**TRACK, "track_heading_deg": [0.0]},
     "[platform] track_heading_deg: must have one for each of 6 times, got 1"),
    ({**TRACK, "track_time_s": [0, 5, 5, 6, 7, 8]},
     "[platform] track_time_s[3]: must be later than the previous point (5.0), got 5.0"),
    ({**TRACK, "track_file": "boat.csv"},
     "[platform] track_time_s: must be left out when there is a track_file"),
    ({"track_file": "boat.csv", "fmu": "x.fmu"},
     "[platform] track_file: must be left out with another FMU, fmu"),
    ({"track_file": "no-such.csv"}, "no-such.csv: no such file"),
    ({"track_fil": "x.csv"}, "did you mean 'track_file'?"),
])
def test_bad_input_is_one_line(keys: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        load({"platform": keys})
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_speed_and_course_have_no_effect_on_a_track() -> None:
    idle = load({"platform": {**TRACK, "boat_speed_m_s": 1.0, "boat_course_deg": 50.0}}).idle()
    assert idle["platform", "boat_speed_m_s"] == "track_count is 6"
    assert ("platform", "boat_course_deg") in idle
    assert ("platform", "track_m") not in idle
    assert ("platform", "departure_time_s") in load({}).idle()
