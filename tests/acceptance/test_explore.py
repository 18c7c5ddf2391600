"""The explorer has the numbers and the words of the command line."""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sblcosim
from explored import (
    CHOICES,
    KEYS,
    LONG,
    MODULES,
    NAME,
    NEEDS,
    NODE,
    SCRIPT,
    UNUSUAL,
    answers,
    as_typed,
    loaded,
    plain,
    settings,
    values,
)
from quick import few
from sblcosim.areas.motion import Circle, circling
from sblcosim.comparison.budget import sources
from sblcosim.comparison.many.run import run_many
from sblcosim.errors import ConfigurationError, SblcosimError
from sblcosim.explore.contents import contents, is_possible
from sblcosim.explore.page import render
from sblcosim.judge.pooling import PERCENTAGES, WEIGHTS
from sblcosim.models.receiver.receivers import FOUND
from sblcosim.results.responses import Percentile, Run, value_of
from sblcosim.scenario.doubts import doubts
from sblcosim.scenario.scenario import Scenario, load
from sblcosim.scenario.schema import FILES, TABLES
from sblcosim.web.playback import of_record

pytestmark = NEEDS


@pytest.fixture(scope="module")
def told() -> Mapping[str, Any]:
    return contents(load(NAME), lanes=(2,))


def in_python(given: Mapping[str, Any], receivers: tuple[str, ...]) -> Scenario | str:
    """The scenario with these keys, or why it is refused."""
    return loaded(NAME, given, receivers)


# --- The same numbers ----------------------------------------------------------------------------


@pytest.mark.parametrize("count", few([25, 300], quick=[25]))
def test_settings_at_random_give_the_record_of_the_command_line(
    told: Mapping[str, Any], count: int, tmp_path: Path
) -> None:
    """The downloaded scenario file, run in Python, gives the record of the page to the last bit."""
    numbers, jobs = random.Random(count), []
    while len(jobs) < count:
        given, receivers = settings(numbers, 5, LONG), numbers.choice(CHOICES)
        given["time.duration_s"] = numbers.choice([20.0, 45.0])
        if numbers.random() < 0.3:
            given["time.ekf_ratio"] = numbers.choice([2, 5])
        if numbers.random() < 0.3:
            given["time.sampling_time_s"] = numbers.choice([0.1, 0.25, 0.7])
        if isinstance(in_python(given, receivers), Scenario):
            jobs.append({
                "settings": {
                    "given": given, "seed": numbers.randrange(2**31), "receivers": receivers,
                },
                "ask": ["toml", "record"],
            })  # fmt: skip
    compared = 0
    for job, answer in zip(jobs, answers(told, jobs, tmp_path), strict=True):
        if answer["refused"] is not None:  # the only thing that a page cannot compute
            assert "echo_probability" in answer["refused"], job
            continue
        file = tmp_path / "scenario.toml"
        file.write_text(answer["toml"])
        compared += same_record(answer["record"], file, job["settings"]["receivers"])
    assert compared > 0.8 * count


def same_record(found: Mapping[str, str], file: Path, receivers: tuple[str, ...]) -> bool:
    run = sblcosim.run(file, receivers)
    assert found.keys() == run.record.values.keys()
    for name, expected in run.record.values.items():
        np.testing.assert_array_equal(values(found[name], expected), expected, err_msg=name)
    return True


def test_many_dives_have_the_numbers_of_many_runs(
    told: Mapping[str, Any], tmp_path: Path
) -> None:
    runs, receivers = 40, ("coupled", "ekf")
    job = {"settings": {"seed": 11, "receivers": receivers}, "dives": runs}
    here, workers = answers(told, [job, {**job, "by": "workers"}], tmp_path)
    assert here["dives"] == workers["dives"]
    many = run_many(load(NAME, {"seed": 11}), receivers, runs=runs)
    table = many.runs.table
    for name in receivers:
        found, row = here["dives"]["receivers"][name], many.runs.level(NAME, name)
        np.testing.assert_array_equal(
            found["each"]["rms"], table[f"{name}.absolute_total_rms_m"].to_numpy())
        np.testing.assert_array_equal(
            found["each"]["p95"], table[f"{name}.absolute_total_p95_m"].to_numpy())
        assert found["p95"] == pytest.approx(many.within_m[name], rel=1e-9)
        assert found["rms"] == pytest.approx(row["rms_over_runs"], rel=1e-12)
        assert [found["lost"], found["misleading"]] == [row["lost"], row["misleading"]]
        assert found["lostInterval"] == pytest.approx([row["lost_low"], row["lost_high"]], abs=1e-9)
        assert found["claim"]["verdict"] == row["covariance"]
        assert found["claim"]["factor"] == pytest.approx(row["covariance_factor"], rel=1e-9)
        bars = found["histogram"]
        assert sum(bars["shares"]) + bars["beyond"] == pytest.approx(1)
        lengths = table[[f"{name}.absolute_total_p{p}_m" for p in PERCENTAGES]].to_numpy(float)
        parts = np.tile(WEIGHTS / WEIGHTS.sum() / runs, runs)
        edges = [*bars["edges"][: len(bars["shares"])], bars["edges"][-1]]
        expected = np.histogram(lengths.ravel(), edges, weights=parts)[0]
        np.testing.assert_allclose(bars["shares"], expected, atol=1e-12)


def test_dives_are_shown_as_they_grow(told: Mapping[str, Any], tmp_path: Path) -> None:
    """Each time by a tenth or more, so that many dives do not wait for their summaries."""
    runs = 800
    (answer,) = answers(told, [{"settings": {"receivers": ["multilateration"]}, "dives": runs}],
                        tmp_path)
    done = np.array([part["done"] for part in answer["shown"]])
    assert done[0] == 32
    growth = done[1:] / done[:-1]
    assert growth.min() >= 1.1
    assert growth[done[:-1] >= 320].max() < 1.21
    assert done[-1] < runs == answer["dives"]["done"]
    of = [part["receivers"]["multilateration"]["runs"] for part in answer["shown"]]
    assert of == done.tolist()


def test_a_dive_is_drawn_as_its_replay(told: Mapping[str, Any], tmp_path: Path) -> None:
    changes = {"time.duration_s": 60.0, "time.ekf_ratio": 4}
    job = {"settings": {"given": changes, "receivers": ["coupled"]}, "ask": ["dive"]}
    (answer,) = answers(told, [job], tmp_path)
    result = sblcosim.run(load(NAME, changes), "coupled")
    played = of_record(result.record, result.judged, title="", run="", verdict=[])
    found = answer["dive"]
    np.testing.assert_array_equal(found["time"], played.time_ns / 1e9)
    assert [found["start"], found["stop"]] == [0.0, played.stop_ns / 1e9]
    assert found["arms"] == played.has_arms
    assert played.diver is not None
    assert played.beacons is not None
    np.testing.assert_array_equal(axes(found["diver"]), played.diver)
    np.testing.assert_array_equal(
        np.stack([axes(it) for it in found["beacons"]], axis=1), played.beacons)
    for mine, theirs in zip(found["receivers"], played.receivers, strict=True):
        assert [mine["label"], mine["fix"]] == [theirs.label, theirs.is_fix]
        for name in ("epoch", "since", "until"):
            np.testing.assert_array_equal(mine[name], getattr(theirs, f"{name}_ns") / 1e9)
        np.testing.assert_array_equal(axes(mine["position"]), theirs.position)
        assert theirs.truth is not None
        assert theirs.factor is not None
        np.testing.assert_array_equal(axes(mine["truth"]), theirs.truth)
        rows, columns = (0, 1, 1, 2, 2, 2), (0, 0, 1, 0, 1, 2)
        np.testing.assert_array_equal(
            np.array(mine["factor"], float).T, theirs.factor[:, rows, columns])


def axes(track: Mapping[str, Any]) -> np.ndarray[Any, Any]:
    return np.array([track[axis] for axis in "xyz"], float).T


# --- The same words ------------------------------------------------------------------------------


KINDS = {
    "platform.gps_shared": (True, False), "platform.mounting_std_m": (0.0, 0.2),
    "acoustics.ranging": ("one_way", "two_way", "inverted", "inverted"),
    "acoustics.common_clock": (True, False), "acoustics.range_common_std_m": (0.0, 0.05, 1.0),
    "acoustics.packet_content": ("everything", "own_beacon", "all_beacons", "pose"),
}  # fmt: skip
"""Keys that decide for which receivers a scenario is."""


def test_receivers_are_doubted_in_the_same_words(told: Mapping[str, Any], tmp_path: Path) -> None:
    numbers, seen, platform = random.Random(3), set(), load(NAME).platform
    zeros = {  # of errors of the GPS and the IMU, and of the waves
        f"platform.{key}": tuple(0.0 for _ in value) if isinstance(value, tuple) else 0.0
        for key in (*told["bound"]["sensors"], *told["bound"]["motions"][platform.motion])
        if (value := getattr(platform, key))
    }
    given = [
        {**(zeros if numbers.random() < 0.4 else {}),
         **{key: numbers.choice(of) for key, of in KINDS.items()}}
        for _ in range(250)
    ]  # fmt: skip
    jobs = [{"settings": {"given": as_typed(it)}, "ask": ["doubts"]} for it in given]
    for keys, answer in zip(given, answers(told, jobs, tmp_path), strict=True):
        if answer["refused"] is not None:
            continue
        scenario, expected = load(NAME, keys.items()), dict.fromkeys(FOUND, "")
        for said in doubts(scenario, {name: name for name in FOUND}):
            label, _, words = said.removeprefix("receiver ").partition(": is for ")
            if label in FOUND:
                expected[label] = f"For {words.replace('(override ', '(')}."
        assert answer["doubts"] == expected, keys
        seen |= {*expected.values()}
    assert len(seen) == 1 + 4 + 4 + 4 + 3  # none, and for each receiver what can be wrong


@pytest.mark.parametrize("count", few([150, 3000], quick=[150]))
def test_what_contradicts_is_refused_in_the_same_words(
    told: Mapping[str, Any], count: int, tmp_path: Path
) -> None:
    numbers = random.Random(count)
    jobs = [
        {"given": settings(numbers, numbers.randint(1, 6)), "receivers": numbers.choice(CHOICES)}
        for _ in range(count)
    ]
    typed = [{"settings": {**it, "given": as_typed(it["given"])}} for it in jobs]
    refused = 0
    for job, answer in zip(jobs, answers(told, typed, tmp_path), strict=True):
        python = in_python(job["given"], job["receivers"])
        if answer["refused"] is not None and any(
            it in answer["refused"] for it in ("in a page", "echo_probability")
        ):
            continue
        if isinstance(python, Scenario):
            assert answer["refused"] is None, job
        elif "must have an effect" in python:  # a file may have it
            continue
        else:
            assert answer["refused"] is not None, (python, job)
            assert plain(answer["refused"], NAME) == plain(python, NAME)
            refused += 1
    assert refused > 0.2 * count


ENDS = (
    {"time.duration_s": 0.5}, {"target.speed_m_s": 0.0}, {"time.ekf_ratio": 1000},
    {"target.trajectory": "white_noise_acceleration"},
    {"target.trajectory": "waypoints", "target.waypoint_m": [[3.0, 4.0, 5.0]] * 2},
)
"""Keys with which a run has no end, or ends too early."""


def test_the_end_of_a_run_is_refused_in_the_same_words(
    told: Mapping[str, Any], tmp_path: Path
) -> None:
    jobs = [{"settings": {"given": as_typed(it)}} for it in ENDS]
    for given, answer in zip(ENDS, answers(told, jobs, tmp_path), strict=True):
        expected = in_python(given, ("coupled",))
        assert isinstance(expected, str)
        assert plain(answer["refused"], NAME) == plain(expected, NAME)


FEW = ("abc", "-1e6", "1e30", "2.5", "[1, 2]")
NONSENSE = (*FEW, "nan", "inf", "true", '["a"]', "7", "-3")


@pytest.mark.parametrize("typed", few([FEW, NONSENSE], quick=[FEW]))
def test_nonsense_is_refused_in_the_same_words(
    told: Mapping[str, Any], typed: tuple[str, ...], tmp_path: Path
) -> None:
    """Every key, whatever is typed; only what is suggested may be left out."""
    cases = [
        (it["path"], text) for it in KEYS for text in typed
        if it["path"] not in UNUSUAL and it["key"] != "beacons"
    ]
    jobs = [{"settings": {"given": {path: text}, "receivers": ["coupled"]}}
            for path, text in cases]
    refused = 0
    for (path, text), answer in zip(cases, answers(told, jobs, tmp_path), strict=True):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                load(NAME, [f"{path}={text}"])
            continue
        except SblcosimError as error:
            expected = str(error)
        if "must have an effect" in expected:
            continue
        assert answer["refused"] is not None, (path, text, expected)
        assert plain(answer["refused"], NAME) == plain(
            expected.partition("; did you mean")[0], NAME), path
        refused += 1
    assert refused > 100 * len(typed)


# --- What limits ---------------------------------------------------------------------------------


@pytest.mark.parametrize("count", few([12, 100], quick=[12]))
def test_switches_are_those_of_a_budget(
    told: Mapping[str, Any], count: int, tmp_path: Path
) -> None:
    """The keys that each switch changes, for settings at random."""
    numbers, jobs = random.Random(7), []
    while len(jobs) < count:
        given = settings(numbers, 4)
        if isinstance(in_python(given, ("coupled",)), Scenario):
            jobs.append({"settings": {"given": given}, "ask": ["switches"]})
    compared = 0
    for job, answer in zip(jobs, answers(told, jobs, tmp_path), strict=True):
        if answer["refused"] is not None:
            continue
        scenario = load(NAME, job["settings"]["given"].items())
        names = sources.of_scenario(scenario)
        assert [it["name"] for it in answer["switches"]] == [*names]
        for it in answer["switches"]:
            same_changes(it["off"], sources.switched(scenario, [it["name"]]))
            better = sources.switched(scenario, [it["name"]], better=True)
            same_changes((it["better"] or {}).get("changes", {}), better)
        compared += len(names)
    assert compared > 5 * count


def same_changes(found: Mapping[str, Any], expected: Mapping[str, Any]) -> None:
    assert found.keys() == expected.keys()
    for key, value in expected.items():
        if value is None:
            assert found[key] is None
        else:
            np.testing.assert_allclose(found[key], np.ravel(value).reshape(np.shape(found[key])),
                                       rtol=1e-14)


def test_causes_are_of_the_same_dives(told: Mapping[str, Any], tmp_path: Path) -> None:
    """What goes away is that of the percentiles of the command line; intervals hold it."""
    runs = 64
    job = {"settings": {"receivers": ["ekf"]}, "causes": runs}
    here, workers = answers(told, [job, {**job, "by": "workers"}], tmp_path)
    found = here["causes"]
    assert found == workers["causes"]
    assert [found["done"], found["receiver"]] == [runs, "ekf"]
    shares = [it["share"] for it in found["causes"]]
    assert shares == sorted(shares, reverse=True)
    for it in found["causes"]:
        low, high = it["interval"]
        assert low <= it["share"] + 0.02
        assert high >= it["share"] - 0.02
        if it["better"]:
            assert it["better"]["gain"] <= it["share"] + 0.1
    clear = {it["name"]: it["better"]["gain"] for it in found["causes"]
             if it["better"] and it["better"]["clear"]}
    assert found["first"] == max(clear, key=clear.__getitem__)
    without = sources.switched(load(NAME), [found["causes"][0]["name"]])
    within = [run_many(load(NAME, own.items()), "ekf", runs=runs).within_m["ekf"]
              for own in ({}, without)]
    assert found["within"] == pytest.approx(within[0], rel=0.02)
    assert shares[0] == pytest.approx(1 - within[1] / within[0], abs=0.03)


def test_water_is_better_near_the_beacons(told: Mapping[str, Any], tmp_path: Path) -> None:
    grid = {"north": [0.0, 60.0], "east": [0.0, 60.0], "size": 60.0, "depth": 5.0}
    job = {"settings": {"receivers": ["ekf"]}, "water": grid}
    here, workers = answers(told, [job, {**job, "by": "workers"}], tmp_path)
    assert here == workers
    near, *_, far = here["water"]["values"]
    assert 0 < near < far
    assert [here["water"]["n"], here["water"]["done"], here["water"]["depth"]] == [4, 4, 5.0]


def test_water_has_the_percentile_of_the_dives_of_the_command_line(
    told: Mapping[str, Any], tmp_path: Path
) -> None:
    """Of one cell: its ten dives one by one, each order statistic with what it stands for."""
    grid = {"north": [20.0], "east": [-10.0], "size": 10.0, "depth": 5.0}
    job = {"settings": {"receivers": ["ekf"], "seed": 7}, "water": grid}
    (here,) = answers(told, [job], tmp_path)
    moving = circling(load(NAME, {"seed": 7}), Circle(3.0, 0.3), 5.0, 60.0)
    lengths = []
    for seed in range(7, 17):
        run = sblcosim.run(moving, "ekf", {
            "seed": seed, "target.center_m": [20.0, -10.0], "target.heading_deg": 0.0,
        })  # fmt: skip
        seen = Run(run.record, "ekf", 20 * 10**9)
        lengths += [value_of(Percentile("absolute_total", p), seen) for p in PERCENTAGES]
    order = np.argsort(lengths)
    below = np.cumsum(np.tile(WEIGHTS, 10)[order])
    expected = np.array(lengths)[order][np.searchsorted(below, 0.95 * below[-1])]
    assert here["water"]["values"] == [pytest.approx(expected, rel=1e-12)]


@pytest.mark.parametrize(
    ("given", "receivers", "beacons", "why"),
    [
        ({"platform.fmu": "x.fmu"}, (), (), "platform.fmu: must be left out to explore"),
        ({}, ("nobody",), (), "receiver: must be .*got 'nobody'"),
        ({}, (), (9,), "beacons: must be from 3 to 8, got 9"),
    ],
)  # fmt: skip
def test_what_a_page_cannot_have_is_refused(
    given: Mapping[str, Any], receivers: tuple[str, ...], beacons: tuple[int, ...], why: str
) -> None:
    with pytest.raises(ConfigurationError, match=why):
        contents(load(NAME, given.items()), receivers, beacons)
    refused = bool(given) or receivers == ("nobody",)
    assert is_possible(load(NAME, given.items()), (*receivers, "ekf")[0]) is not refused


def test_equal_scenarios_give_equal_bytes() -> None:
    """In any process, whatever the order of its sets."""
    script = (
        "from hashlib import sha256\nfrom sblcosim.explore import contents, page\n"
        "from sblcosim.scenario.scenario import load\n"
        f"text = page.render(contents.contents(load({NAME!r}), lanes=(2,)))\n"
        "print(sha256(text.encode()).hexdigest())"
    )
    found = {
        subprocess.run(
            [sys.executable, "-c", script], env={**os.environ, "PYTHONHASHSEED": seed}, check=True,
            capture_output=True, text=True,
        ).stdout for seed in ("1", "2", "3")
    }
    assert len(found) == 1


def test_a_page_has_all_keys_but_those_that_are_refused(told: Mapping[str, Any]) -> None:
    known = {f"{name}.{key}" for name, table in TABLES.items() for key in table.model_fields}
    missing = known - {it["path"] for it in told["keys"]}
    assert {it.partition(".")[2] for it in missing} == {
        *FILES, "fmi", "parameters", "track_tolerance_m",
    }


# --- Settings ------------------------------------------------------------------------------------


def test_links_carry_the_settings(told: Mapping[str, Any], tmp_path: Path) -> None:
    given = {"platform.gps_grade": "rtk_fixed", "target.speed_m_s": 0.7}
    job = {
        "settings": {"given": given, "seed": 5, "receivers": ["ekf", "raw"]},
        "ask": ["link", "toml", "changed", "command"],
    }
    (first,) = answers(told, [job], tmp_path)
    assert "gps_grade" in first["link"]
    assert first["command"] == (
        f"sblcosim run {NAME}.toml --receiver ekf --receiver multilateration"
    )
    again = {"link": first["link"], "ask": ["toml", "link"]}
    (second,) = answers(told, [again], tmp_path)
    assert [second["toml"], second["link"]] == [first["toml"], first["link"]]
    assert {*given} <= {*first["changed"]}


def steps(told: Mapping[str, Any], folder: Path, *each: Any, ask: Any = ()) -> dict[str, Any]:
    (answer,) = answers(told, [{"steps": each, "ask": ask}], folder)
    return answer


def test_seeds_and_receivers_are_checked(told: Mapping[str, Any], tmp_path: Path) -> None:
    answer = steps(
        told, tmp_path, ["setSeed", "12"], ["setSeed", "-1"], ["setSeed", "1.5"],
        ["setSeed", 2**31],
        ["setReceivers", ["ekf", "raw"]], ["setReceivers", ["nobody"]], ["setReceivers", []],
        ["apply", {"given": {"no.key": 1}}], ask=["seed", "receivers"],
    )  # fmt: skip
    most = 2**31 - 1
    assert answer["steps"] == [
        None, "seed: must be at least 0, got -1", "seed: must be a whole number, got 1.5",
        f"seed: must be at most {most}, got {2**31}", None,
        "receiver: must be some of ekf, coupled, raw, each once, got nobody",
        "receiver: must be some of ekf, coupled, raw, each once, got none", "[no] has no key 'key'",
    ]
    assert [answer["seed"], answer["receivers"]] == [12, ["ekf", "raw"]]


def test_a_preset_takes_the_place_of_its_keys(told: Mapping[str, Any], tmp_path: Path) -> None:
    path = "platform.gps_horizontal_markov_std_m"
    answer = steps(
        told, tmp_path, ["set", "platform.gps_grade", "rtk_fixed"], ["value", path], ["unset",
        "platform.gps_grade"], ["value", path], ["reset"], ["value", path], ask=["changed"],
    )  # fmt: skip
    rtk = load(NAME, {"platform.gps_grade": "rtk_fixed"})
    default = load(NAME, {path: None})
    assert answer["steps"] == [
        None, rtk.platform.gps_horizontal_markov_std_m,
        None, default.platform.gps_horizontal_markov_std_m, None, 1.2,
    ]
    assert answer["changed"] == []


def test_receivers_are_told_what_the_command_line_tells_them(
    told: Mapping[str, Any], tmp_path: Path
) -> None:
    given = {"platform.gps_grade": "sbas", "platform.imu_heading_std_deg": 2.5}
    scenario = load(NAME, given)
    keys = [it for it in scenario.receiver.variables if getattr(scenario.receiver, it) is not None]
    (answer,) = answers(told, [{
        "settings": {"given": given}, "steps": [["value", f"receiver.{it}"] for it in keys],
    }], tmp_path)  # fmt: skip
    for key, found in zip(keys, answer["steps"], strict=True):
        expected = getattr(scenario.receiver, key)
        if isinstance(expected, str | bool):
            assert found == expected, key
        else:
            np.testing.assert_allclose(found, expected, rtol=1e-11, err_msg=key)


def test_keys_that_depend_on_each_other_are_set_one_after_the_other(
    told: Mapping[str, Any], tmp_path: Path
) -> None:
    answer = steps(
        told, tmp_path, ["set", "acoustics.profile_depth_m", "0, 10"], ["problems"],
        ["value", "acoustics.profile_depth_m"], ["unset", "acoustics.sound_speed_m_s"],
        ["set", "acoustics.profile_speed_m_s", "1500, 1490"], ["problems"],
        ["value", "acoustics.sound_speed_m_s"],
    )  # fmt: skip
    first, problems, unchanged, _, last, none, speed = answer["steps"]
    assert "must come with profile_speed_m_s" in first
    assert problems == [{"path": "acoustics.profile_depth_m", "message": first}]
    assert [unchanged, last, none] == [[], None, []]
    assert speed == load(NAME, {
        "acoustics.profile_depth_m": [0.0, 10.0], "acoustics.profile_speed_m_s": [1500.0, 1490.0],
    }).acoustics.sound_speed_m_s  # fmt: skip


def test_arms_and_paths_are_keys_of_the_file(told: Mapping[str, Any], tmp_path: Path) -> None:
    arms = [[2.0, 0.00049, 0.5], [0.0, 2.5, 0.5], [-2.0, 0.0, 0.25], [0.0, -3.0, 1.0]]
    path = [[0.0, 5.0, 1.0], [10.12345, 5.0, 2.0]]
    answer = steps(
        told, tmp_path, ["setArms", arms], ["setPath", path, 0.5], ["setArms", arms[:2]],
        ask=["toml", "arms", "pathPoints"],
    )  # fmt: skip
    *done, refused = answer["steps"]
    assert done == [None, None]
    assert "must be an array of 3 to 8 rows of 3 numbers" in refused
    (tmp_path / "s.toml").write_text(answer["toml"])
    read = load(tmp_path / "s.toml")
    rounded = [[2.0, 0.0, 0.5], *arms[1:]]
    assert np.reshape(read.platform.beacon_m, (-1, 3)).tolist() == rounded == answer["arms"]
    assert np.reshape(read.target.waypoint_m, (-1, 3)).tolist() == [path[0], [10.123, 5.0, 2.0]]
    assert answer["pathPoints"] == [path[0], [10.123, 5.0, 2.0]]
    assert read.target.speed_m_s == 0.5


def tracked(count: int) -> dict[str, Any]:
    """Keys of a track; the diver swims along 60 of its points."""
    step = 1.5 if count < 150 else 0.6
    return {
        "target.trajectory": "file", "time.duration_s": 60 * step,
        "target.track_time_s": [0.0, *(round(step * i + 1.0, 3) for i in range(count - 1))],
        "target.track_m": [[round(5 + i / 7, 3), round(i / 9, 3), 3.0] for i in range(count)],
    }


def test_a_recorded_track_is_followed(told: Mapping[str, Any], tmp_path: Path) -> None:
    jobs = [{"settings": {"given": tracked(n)}, "ask": ["toml", "record"]} for n in (100, 257)]
    answer, longer = answers(told, jobs, tmp_path)
    (tmp_path / "s.toml").write_text(answer["toml"])
    assert same_record(answer["record"], tmp_path / "s.toml", ("coupled",))
    assert "must have at most 256 points in this page, got 257" in longer["refused"]


@pytest.mark.slow
def test_a_page_of_a_longer_track_follows_it(tmp_path: Path) -> None:
    """Its components are made for as many points; other tracks, as long, can replace it."""
    told = contents(load(NAME, tracked(300)), ("ekf",), lanes=(2,))
    other = {**tracked(4000), "time.duration_s": "path"}
    jobs = [{"ask": ["toml", "record"]}, {"settings": {"given": other}, "ask": ["toml", "record"]}]
    for answer in answers(told, jobs, tmp_path):
        (tmp_path / "s.toml").write_text(answer["toml"])
        assert same_record(answer["record"], tmp_path / "s.toml", ("ekf",))
    assert is_possible(load(NAME, other), "ekf")


MEMORY = """
import {{ readFileSync }} from "node:fs";
const {{ Explorer }} = await import({script});
const explorer = await Explorer.open(JSON.parse(readFileSync("contents.json", "utf8")));
explorer.apply({{ given: {{ "time.duration_s": 20 }}, receivers: ["ekf"] }});
const sizes = [];
for (let n = 0; n < 50; n++) {{
  explorer.set("acoustics.range_std_m", 0.1 + n / 1000);
  explorer.setSeed(2000 * n);
  await explorer.dives(2000);
  explorer.dive();
  globalThis.gc();
  const {{ heapUsed, arrayBuffers }} = process.memoryUsage();
  sizes.push(heapUsed + arrayBuffers);
}}
console.log(JSON.stringify(sizes));
"""


@pytest.mark.slow
def test_a_browser_without_vectors_has_the_same_numbers(tmp_path: Path) -> None:
    """For the scenario's number of beacons; for others, the page refuses."""
    told = contents(load(NAME), beacons=[5])
    assert {"engine.4.2", "engine.4.1", "engine.5.2"} < told["modules"].keys()
    assert "engine.5.1" not in told["modules"]
    wrong = dict.fromkeys(("engine.4.2", "engine.5.2"), told["modules"]["settings.4"])
    jobs = [
        {"settings": {"receivers": ["ekf"]}, "dives": 5, "ask": ["counts"]},
        {"settings": {"given": {"platform.beacons": 5}}},
    ]
    two, five = answers(told, jobs, tmp_path)
    assert (two.pop("counts"), five["refused"]) == ([4, 5], None)
    one, refused = answers({**told, "modules": {**told["modules"], **wrong}}, jobs, tmp_path)
    assert one.pop("counts") == [4]
    assert one == two
    assert refused["refused"] == "[platform] beacons: must be one of 4 in this page, got 5"


@pytest.mark.slow
@pytest.mark.parametrize(("name", "most"), [
    ("realistic-dive", 2_000_000), ("harbour-lbl", 2_700_000), ("usbl-boat", 2_900_000),
])
def test_a_page_with_all_numbers_of_beacons_is_small(name: str, most: int) -> None:
    """Its size in bytes; that of a receiver is in it six times."""
    assert len(render(contents(load(name), beacons=range(3, 9))).encode()) < most


@pytest.mark.slow
def test_memory_is_flat_over_a_hundred_thousand_dives(
    told: Mapping[str, Any], tmp_path: Path
) -> None:
    (tmp_path / "contents.json").write_text(json.dumps(told))
    (tmp_path / "memory.mjs").write_text(MEMORY.format(script=json.dumps(SCRIPT.as_uri())))
    assert NODE is not None
    done = subprocess.run(
        [NODE, MODULES, "--expose-gc", "memory.mjs"], cwd=tmp_path, check=True,
        capture_output=True,
    )  # fmt: skip
    sizes = json.loads(done.stdout)
    # What is left of a round is freed at some time: the least of several is what stays.
    assert min(sizes[-10:]) - min(sizes[5:15]) < 1_000_000


@pytest.mark.slow
@pytest.mark.parametrize("beacons", [3, 5, 6, 7, 8])
def test_other_numbers_of_beacons(beacons: int, tmp_path: Path) -> None:
    """Added and taken away in the page, with other keys at random."""
    numbers, jobs = random.Random(beacons), []
    content = contents(load(NAME), beacons=[beacons], lanes=(2,))
    assert [*content["systems"]] == sorted(["4", str(beacons)])
    for _ in range(6):
        given = settings(numbers, 3, (*LONG, "slot_order", "mounting_error_m", "beacon_offset_m"))
        arms = [[round(numbers.uniform(-5, 5), 3) for _ in range(3)] for _ in range(beacons)]
        given |= {"time.duration_s": 20.0, "platform.beacon_m": arms}
        if isinstance(in_python(given, ("coupled", "ekf")), Scenario):
            jobs.append({
                "settings": {"given": given, "receivers": ["coupled", "ekf"]},
                "ask": ["toml", "record", "arms"],
            })  # fmt: skip
    assert len(jobs) > 2
    compared = 0
    for answer in answers(content, jobs, tmp_path):
        if answer["refused"] is None:
            assert len(answer["arms"]) == beacons
            (tmp_path / "s.toml").write_text(answer["toml"])
            compared += same_record(answer["record"], tmp_path / "s.toml", ("coupled", "ekf"))
    assert compared > 2


def all_shipped() -> Iterator[str]:
    from sblcosim.scenario.scenario import shipped

    yield from shipped()


@pytest.mark.slow
@pytest.mark.parametrize("name", [*all_shipped()])
def test_every_scenario_can_be_explored(name: str, tmp_path: Path) -> None:
    """Its own receiver, the record and the file."""
    scenario = load(name, {"time.duration_s": 30.0})
    job = {"ask": ["toml", "record"]}
    (answer,) = answers(contents(scenario, lanes=(2,)), [job], tmp_path)
    (tmp_path / "s.toml").write_text(answer["toml"])
    assert same_record(answer["record"], tmp_path / "s.toml", ())
