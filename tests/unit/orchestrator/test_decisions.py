"""What `sblcosim new` asks for: answers become keys, and a file that says no more than these."""

from __future__ import annotations

import random
import re
import tomllib
import warnings
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from quick import one_in
from sblcosim.errors import ConfigurationError
from sblcosim.models.platform.beaufort import LEVELS
from sblcosim.models.platform.gps import GRADES
from sblcosim.models.target.variables import TRAJECTORIES
from sblcosim.scenario.decided import Decided, decided
from sblcosim.scenario.decisions import DECISIONS
from sblcosim.scenario.explained import explained
from sblcosim.scenario.likes import ASKED, LIKES
from sblcosim.scenario.scenario import Scenario, load, shipped
from sblcosim.scenario.schema import PATH, TABLES
from sblcosim.scenario.starter import starter
from sblcosim.scenario.wiring import connect

TRACK = "time_s,north_m,east_m,down_m\n0,10,0,5\n20,10,8,6\n60,-5,8,7\n"
GEO = "time_s,latitude_deg,longitude_deg,depth_m\n0,42.5,14.2,5\n20,42.5001,14.2,6\n"
SHAPES = [it for it in TRAJECTORIES.values() if it not in ("waypoints", "file")]


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("dive.csv").write_text(TRACK)
    Path("geo.csv").write_text(GEO)


@cache
def source(name: str) -> Scenario:
    """A system to begin with, or a shipped scenario."""
    return load(LIKES[name].source if name in LIKES else name)


def answers(name: str, begin: Scenario) -> dict[str, Mapping[str, Any]]:
    """Answers to a question, every choice among them, and keys that they must give."""
    platform, target = begin.platform, begin.target
    if name == "beacons":
        points = [[2.0, 1.0, 0.5], [2.0, -1.0, 0.5], [-2.0, 0.0, 1.5]]
        places = tuple(value for row in points for value in row)
        found: dict[str, Mapping[str, Any]] = {
            "2 1 0.5; 2 -1 0.5; -2 0 1.5": {"platform.beacon_m": places, "platform.beacons": 3},
            str([[*row, ] for row in [*points, [0, 3, 1]]]): {"platform.beacons": 4},
        }
        if platform.arrangement == "cross":
            same = {"platform.arm_length_m": 0.4, "platform.beacons": begin.beacons}
            six = {"platform.arm_length_m": 2.5, "platform.beacons": 6}
            found |= {"0.4 m": same, "40 cm": same, f"{begin.beacons} x 0.4 m": same,
                      "6 x 2.5 m": six, "6 arms of 2.5": six, "6×250 cm": six}
        return found
    if name == "gps":
        grades = {grade: {"platform.gps_grade": grade} for grade in GRADES}
        return grades | {"RTK": grades["rtk_fixed"], "Dgps": grades["differential"]}
    if name == "sea":
        levels: dict[str, Mapping[str, Any]] = {
            str(level): {"platform.beaufort": level} for level in LEVELS
        }
        return levels | {"Beaufort 3": levels["3"], "3.0": levels["3"]}
    if name == "path":
        return {
            **{shape: {"target.trajectory": shape} for shape in SHAPES},
            "0, 10, 5; 20, 10, 8": {
                "target.trajectory": "waypoints",
                "target.waypoint_m": (0.0, 10.0, 5.0, 20.0, 10.0, 8.0),
            },
            "dive.csv": {"target.trajectory": "file", "target.track_file": None},
            "geo.csv": {"target.trajectory": "file", "place.latitude_deg": 42.5},
        }
    if name == "depth":
        if target.trajectory == "waypoints":
            return {text: {} for text in ("7", "4, 9", "4 to 9 m")}
        both = {"target.depth_start_m": 4.0, "target.depth_end_m": 9.0}
        return {"7 m": {"target.depth_start_m": 7.0, "target.depth_end_m": 7.0},
                "4, 9": both, "[4.0, 9.0]": both, "4 to 9 m": both}  # fmt: skip
    (key,) = DECISIONS[name].keys(begin)
    numbers: dict[str, list[str]] = {
        "mounting": ["0", "0.2 m"], "compass": ["0.5", "5°", "5 deg"], "speed": ["0.3 m/s", "0"],
        "pings": ["0.5", "2 Hz", "0.5 s"], "noise": ["0.15", "0.2 m"],
    }
    return {text: {key: 0.5 if name == "pings" else float(re.split("[^0-9.]", text)[0])}
            for text in numbers[name]}  # fmt: skip


def value(scenario: Scenario, key: str) -> Any:
    table, own = key.split(".")
    return getattr(getattr(scenario, table), own)


def content(scenario: Scenario) -> dict[str, Any]:
    return scenario.model_dump(exclude={"name"})


def check_written(made: Decided, *, runs: bool = True) -> None:
    """A file says what was asked for, and no more; the scenario runs without a warning."""
    for short in (True, False):
        text = starter(
            "mine", made.scenario, asked=made.keys, short=short, folder=Path.cwd() / "deep"
        )
        Path("deep").mkdir(exist_ok=True)
        Path("deep", "mine.toml").write_text(text, "utf-8")
        assert str(Path.cwd()) not in text
        back = load(Path("deep", "mine.toml"))
        assert content(back) == content(made.scenario), text
        tables = {k: v for k, v in tomllib.loads(text).items() if isinstance(v, dict)}
        used = {f"{table}.{key}" for table, keys in tables.items() for key in keys}
        assert made.keys <= used
        if short:
            for key in used - made.keys:
                assert makes_a_difference(tables, key, made.scenario), key
    if runs and back.beacons == 4:  # FMUs for other numbers take their time to build
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            connect(back)


def makes_a_difference(tables: Mapping[str, Any], key: str, scenario: Scenario) -> bool:
    table, own = key.split(".")
    rest = {**tables, table: {k: v for k, v in tables[table].items() if k != own}}
    if own == "track_file":
        return True
    try:
        return content(load({"title": scenario.title, "seed": scenario.seed, **rest})) != content(
            scenario
        )
    except ConfigurationError:
        return True


def choices() -> list[tuple[str, str]]:
    """Each system with each question that it is asked."""
    return [(system, name) for system in LIKES for name in decided(source(system), {}).open]


def test_what_is_asked_has_a_decision_and_the_other_way_round() -> None:
    assert [*ASKED] == [*DECISIONS]
    assert {name for _, name in choices()} == {*DECISIONS}


@pytest.mark.parametrize(("system", "name"), choices())
@one_in(4)
def test_every_choice_of_every_question(system: str, name: str) -> None:
    begin = source(system)
    for text, wanted in answers(name, begin).items():
        made = decided(begin, {name: text})
        if name == "path" and text in SHAPES:
            assert made.scenario.target.trajectory == text
        for key, expected in wanted.items():
            assert value(made.scenario, key) == expected, (text, key)
        check_written(made, runs=name in ("path", "speed", "sea", "pings"))


@pytest.mark.parametrize("system", [*LIKES, *shipped()])
def test_without_an_answer_nothing_changes(system: str) -> None:
    made = decided(source(system), {})
    assert content(made.scenario) == content(source(system))
    check_written(made)
    assert "path" in made.open


def test_a_path_below_the_bottom_is_refused() -> None:
    with pytest.raises(ConfigurationError, match=r"^depth: \[acoustics\] water_depth_m: must be"):
        decided(source("harbour-wakes"), {"depth": "9"})


@one_in(2)
@pytest.mark.parametrize("seed", range(30))
def test_random_answers_to_random_questions(seed: int) -> None:
    rng = random.Random(seed)
    begin = source(rng.choice([it for it in (*LIKES, *shipped()) if it != "harbour-wakes"]))
    given: dict[str, str] = {}
    for name in DECISIONS:
        made = decided(begin, given)
        if name in made.open and rng.random() < 0.6:
            given[name] = rng.choice([*answers(name, made.scenario)])
    made = decided(begin, given)
    check_written(made)
    for name in given:
        if name in made.open:  # a path of points has its depths
            for key, expected in answers(name, made.scenario)[given[name]].items():
                moved = key == "target.waypoint_m" and "depth" in given
                if key in made.keys and not moved:
                    assert value(made.scenario, key) == expected, (given, key)


@pytest.mark.parametrize(("system", "name"), choices())
def test_what_is_shown_may_be_typed(system: str, name: str) -> None:
    """With its unit; a default that no answer could give is described instead."""
    begin = decided(source(system), {}).scenario
    shown = DECISIONS[name].shown(begin)
    described = {"through", "roll,"}
    if shown.split()[0] in described:
        assert name in ("path", "sea")
        return
    again = decided(begin, {name: shown})
    assert DECISIONS[name].shown(again.scenario) == shown
    if name != "depth" or begin.target.trajectory != "waypoints":
        assert content(again.scenario) == content(begin)


@pytest.mark.parametrize(("system", "name"), choices())
def test_a_wrong_answer_says_what_must_hold_and_what_was_got(system: str, name: str) -> None:
    for text in ("xyzzy", "", "-1e400", "1 2 3 4 5", "--"):
        try:
            decided(source(system), {name: text})
        except ConfigurationError as error:
            for line in str(error).splitlines():
                assert re.match(rf"{name}(\[[\d,]+\])?: must .*, got ", line), line
        else:
            pytest.fail(f"{text!r} was taken")


@pytest.mark.parametrize(
    ("answer", "close"),
    [({"gps": "rtkfixed"}, "rtk_fixed"), ({"gps": "Stand-aloen"}, "standalone"),
     ({"path": "crcle"}, "circle"), ({"path": "Semi circel"}, "semicircle")],
)  # fmt: skip
def test_the_nearest_name_is_suggested(answer: dict[str, str], close: str) -> None:
    with pytest.raises(ConfigurationError, match=f"did you mean '{close}'"):
        decided(source("platform"), answer)


@pytest.mark.parametrize(
    ("system", "given", "why"),
    [("lbl", {"gps": "rtk"}, "beacons on the bottom have none"),
     ("lbl", {"sea": "3"}, "beacons on the bottom rest"),
     ("buoys", {"compass": "3"}, "each buoy has a GPS of its own"),
     ("buoys", {"mounting": "1"}, "each buoy has a GPS of its own"),
     ("buoys", {"sea": "3"}, "waves that move each buoy by itself are not modelled"),
     ("platform", {"path": "dive.csv", "depth": "7"}, 'trajectory is "file"'),
     ("platform", {"path": "dive.csv", "speed": "1"}, 'trajectory is "file"')],
)  # fmt: skip
def test_what_there_is_not_to_decide_is_refused_with_the_reason(
    system: str, given: dict[str, str], why: str
) -> None:
    name, text = [*given.items()][-1]
    with pytest.raises(ConfigurationError) as wrong:
        decided(source(system), given)
    assert str(wrong.value) == f"{name}: must be left out, as {why}, got {text!r}"


def test_another_fmu_is_not_asked_about() -> None:
    for table, gone in (("target", {"path", "depth", "speed"}),
                        ("platform", {"beacons", "mounting", "gps", "compass", "sea"})):
        begin = load({table: {"fmu": "other.fmu"}, "receiver": {"type": "ekf"}})
        made = decided(begin, {})
        assert {*DECISIONS} - {*made.open} >= gone
        with pytest.raises(ConfigurationError, match=rf"as \[{table}\] is another FMU"):
            decided(begin, {min(gone): "1"})


def test_what_a_path_leaves_without_effect_goes() -> None:
    """So that the file says nothing in vain."""
    made = decided(source("buoys"), {"path": "circle"})
    assert made.scenario.target.waypoint_m == ()
    back = decided(made.scenario, {"path": "0 0 5; 9 0 5"})
    assert "target.depth_start_m" not in back.keys
    assert "depth_start_m" not in back.scenario.given()["target"]


def test_keys_that_belong_to_the_former_answer_go_with_it() -> None:
    six = load({"platform": {"beacons": 6, "arm_length_m": 2.0}})
    made = decided(six, {"beacons": "2 1 0; 2 -1 0; -2 0 1"})
    assert made.scenario.beacons == 3
    assert "arm_length_m" not in made.scenario.given()["platform"]
    tables = {"trajectory": "waypoints", "waypoint_m": [[0, 0, 5], [9, 0, 5], [9, 9, 5]]}
    begin = load({"target": {**tables, "waypoint_count": 2}})
    for path, count in (("0 0 5; 9 0 5; 9 9 5; 0 0 5", 4), ("7 7 7; 8 8 8", 2)):
        begin = decided(begin, {"path": path}).scenario
        assert begin.target.waypoint_count == count
    recorded = decided(begin, {"path": "dive.csv"})
    assert recorded.scenario.recorded["target"]["track_file"] == str(Path.cwd() / "dive.csv")
    again = decided(recorded.scenario, {"path": "geo.csv"})
    assert again.scenario.recorded["target"]["track_file"] == str(Path.cwd() / "geo.csv")
    check_written(again)
    assert 'track_file = "../geo.csv"' in Path("deep", "mine.toml").read_text("utf-8")
    back = decided(again.scenario, {"path": "circle"}).scenario
    assert not back.recorded
    assert not {"track_m", "waypoint_m"} & back.given()["target"].keys()


def test_a_path_without_an_end_ends() -> None:
    for given in ({"path": "white_noise_acceleration"}, {"speed": "0"}):
        made = decided(source("platform"), given)
        assert made.scenario.time.duration_s == 300.0
    assert decided(source("platform"), {"speed": "1"}).scenario.time.duration_s == PATH


@pytest.mark.parametrize("text", ["6", "4, 12"])
def test_depths_go_along_the_points_of_a_path(text: str) -> None:
    begin = source("buoys")
    for wrong in ("-3", "5, -3"):
        with pytest.raises(ConfigurationError, match=r"^depth: must be at least 0, got -3$"):
            decided(begin, {"depth": wrong})
    at_surface = decided(begin, {"depth": "0"}).scenario.target.waypoint_m[2::3]
    assert at_surface == (0.0,) * len(at_surface)
    flat = decided(begin, {"depth": text}).scenario.target.waypoint_m
    assert flat[0::3] == begin.target.waypoint_m[0::3]
    assert flat[1::3] == begin.target.waypoint_m[1::3]
    ends = [float(end) for end in text.split(",")]
    assert (flat[2], flat[-1]) == (ends[0], ends[-1])
    # Lanes of 40 m, 13 or 14 m apart: in proportion to the way that is covered.
    ways = [0, 40, 53, 93, 107, 147, 160, 200]
    assert flat[2::3] == pytest.approx([ends[0] + (ends[-1] - ends[0]) * w / 200 for w in ways])


def test_points_below_each_other_can_have_a_depth() -> None:
    begin = load({"target": {"trajectory": "waypoints", "waypoint_m": [[1, 2, 3], [1, 2, 9]]}})
    assert decided(begin, {"depth": "5"}).scenario.target.waypoint_m[2::3] == (5.0, 5.0)


@pytest.mark.parametrize("name", ["paper", "platform"])
def test_the_gps_of_the_paper_may_be_a_number_and_no_other(name: str) -> None:
    if name == "paper":
        made = decided(source(name), {"gps": "3.5 m"})
        assert made.scenario.platform.gps_horizontal_std_m == 3.5
        assert made.scenario.platform.gps_grade is None
    else:
        with pytest.raises(ConfigurationError, match=r"gps: must be standalone, .*, got '3\.5 m'"):
            decided(source(name), {"gps": "3.5 m"})


@pytest.mark.parametrize(
    ("begin", "key"),
    [("realistic-dive", "imu_heading_bias_deg"), ("paper", "imu_heading_std_deg"),
     ("water-linked", "imu_heading_turn_on_std_deg"), ("gps-free", "imu_heading_turn_on_std_deg")],
)  # fmt: skip
def test_the_compass_is_the_error_that_a_scenario_has(begin: str, key: str) -> None:
    scenario = load({"target": {}, "platform": {}}) if begin == "gps-free" else source(begin)
    made = decided(scenario, {"compass": "7"})
    changed = {k for k in TABLES["platform"].model_fields
               if value(made.scenario, f"platform.{k}") != value(scenario, f"platform.{k}")}
    assert changed == {key}
    assert f"platform.{key}" in made.keys


def test_each_key_in_a_file_stands_below_its_meaning_and_unit() -> None:
    for system in LIKES:
        made = decided(source(system), {})
        lines = starter("mine", made.scenario, asked=made.keys, short=True).splitlines()
        table = ""
        for number, line in enumerate(lines):
            if line.startswith("["):
                table = line.strip("[]")
            elif table and line and not line.startswith("#"):
                above = number
                while lines[above - 1].startswith("#"):
                    above -= 1
                said = " ".join(it.lstrip("# ") for it in lines[above:number])
                assert said.startswith(explained(table, line.partition(" = ")[0])), line
    assert explained("target", "speed_m_s") == "Speed along the path, in space [m/s]; 0 to 20"


def test_a_recorded_track_stays_its_file() -> None:
    """Not the points that were read from it, which may be thousands."""
    Path("mine.toml").write_text(
        '[target]\ntrajectory = "file"\ntrack_file = "dive.csv"\ntrack_tolerance_m = 0.5\n'
    )
    text = starter("other", "mine.toml", short=True, folder=Path.cwd())
    assert 'track_file = "dive.csv"' in text
    assert "track_tolerance_m = 0.5" in text
    assert "track_m" not in text
    Path("geo.toml").write_text('[target]\ntrajectory = "file"\ntrack_file = "geo.csv"\n')
    placed = starter("other", "geo.toml", short=True, folder=Path.cwd())
    assert 'track_file = "geo.csv"' in placed
    assert "[place]" not in placed
    here = load("geo.toml", {"place.latitude_deg": 42.4999, "place.longitude_deg": 14.2})
    elsewhere = starter("other", here, short=True, folder=Path.cwd())
    assert 'track_file = "geo.csv"' in elsewhere
    assert "latitude_deg = 42.4999" in elsewhere
    whole = load("mine.toml")
    moved = load(whole, {"place.latitude_deg": 1.0, "place.longitude_deg": 2.0})
    assert "latitude_deg = 1.0" in starter("other", moved, short=True)
    other = load(whole, {"target.track_m": [[0, 0, 1], [9, 0, 1], [9, 9, 1]],
                         "target.track_time_s": [0, 5, 9], "target.track_count": 3})  # fmt: skip
    assert "track_file" not in starter("other", other, short=True)
    assert "track_m" in starter("other", other, short=True)
