"""The commented scenario file to begin with."""

from __future__ import annotations

import re
import tomllib
import warnings
from pathlib import Path

import pytest
import sblcosim
from sblcosim.cli import app
from sblcosim.models import RECEIVERS
from sblcosim.models.settings.presets import PRESETS
from sblcosim.scenario.likes import LIKES
from sblcosim.scenario.scenario import load, shipped
from sblcosim.scenario.schema import Acoustics, Platform, Receiver, Target, Time
from sblcosim.scenario.starter import starter
from sblcosim.scenario.wiring import connect
from typer.testing import CliRunner

TABLES = {
    "time": Time, "target": Target, "platform": Platform, "acoustics": Acoustics,
    "receiver": Receiver,
}  # fmt: skip


def test_a_starter_is_valid_as_it_is() -> None:
    scenario = load(tomllib.loads(starter("mine")))
    assert '# name = "mine"  # that of the file' in starter("mine")
    assert scenario.platform.beaufort == 2


def test_a_grade_says_which_keys_it_sets_and_which_are_given() -> None:
    lines = starter("x", {"platform": {"imu_tilt_bias_deg": 0.5}}).splitlines()
    text = " ".join(line.lstrip("# ") for line in lines)
    wins = "of these, what is given wins"
    for key, governed in PRESETS.items():
        ((keys, kept),) = re.findall(rf"It sets ([^.;]*); {wins}([^.]*)\. {key} =", text)
        assert {*keys.split(", ")} == governed
        assert kept == (": imu_tilt_bias_deg" if key == "imu_grade" else "")


def test_a_starter_names_every_key_of_every_table_with_a_comment_above() -> None:
    text = starter("mine")
    for name, table in TABLES.items():
        section = re.split(r"^\[\w+\]$", text.partition(f"[{name}]\n")[2], flags=re.M)[0]
        for key in table.model_fields:
            assert re.search(rf"^# .*\n(# )?{key} = ", section, flags=re.M), f"[{name}] {key}"


def test_a_key_that_is_commented_out_is_valid_when_it_is_put_in_use() -> None:
    lines, tried = starter("mine").splitlines(), 0
    for name in TABLES:
        start = lines.index(f"[{name}]")
        for number, line in enumerate(lines[start + 1 :], start + 1):
            if line.startswith("["):
                break
            key = line.removeprefix("# ").partition(" = ")[0]
            # A foreign FMU goes with other keys, which are then to be changed as well. A boat's
            # track needs its file, or all its points.
            alone = key not in ("fmu", "parameters") and (name, key) not in (
                ("platform", "track_file"), ("platform", "track_time_s"),
            )
            if alone and line.startswith("# ") and key in TABLES[name].model_fields:
                changed = [*lines[:number], line.removeprefix("# "), *lines[number + 1 :]]
                load(tomllib.loads("\n".join(changed)))
                tried += 1
    assert tried > 30


@pytest.mark.parametrize("name", [name for name in TABLES if name != "time"])
def test_a_foreign_component_has_examples_of_all_other_keys(name: str) -> None:
    text = starter("mine", {name: {"fmu": "other.fmu"}})
    section = re.split(r"^\[\w+\]$", text.partition(f"[{name}]\n")[2], flags=re.M)[0]
    lines = [line.removeprefix("# ") for line in section.splitlines()]
    examples = tomllib.loads("\n".join(line for line in lines if re.match(r"\w+ = ", line)))
    assert examples.keys() == TABLES[name].model_fields.keys()
    if name == "receiver":
        assert examples["type"] == next(iter(RECEIVERS))
    assert [*examples][-4:] == ["fmu", "fmi", "interval_s", "parameters"]


def test_what_is_in_no_table_comes_first_with_what_it_is_for() -> None:
    for tables, begin in (
        ({"seed": 7}, ['title = ""', "seed = 7", "fmi = 2"]),
        ({"title": "A dive", "fmi": 3}, ['title = "A dive"', "seed = 1", "fmi = 3"]),
    ):
        head = starter("mine", tables).split("\n\n")[1].splitlines()
        assert head[0] == '# name = "mine"  # that of the file; also of the folder of results'
        assert [line.split("  # ") for line in head[1:]] == [
            [begin[0], "above tables and figures"], [begin[1], "of all random numbers"],
            [begin[2], "version of the standard that the components follow: 2 or 3"]]
        short = starter("mine", tables, short=True).split("\n\n")[1].splitlines()
        changed = {f"{key} = " for key in tables}
        assert short == [line for line in head if line.startswith((*changed,))]


@pytest.mark.parametrize(("table", "lines"), [
    ("target", ["# waypoint_m = [[0.0, 10.0, 5.0], [10.0, 10.0, 5.0]]",
                "# track_time_s = [0.0, 60.0]",
                "# track_m = [[0.0, 10.0, 5.0], [10.0, 10.0, 5.0]]"]),
    ("platform", ["# track_m = [[0.0, 10.0], [10.0, 10.0]]", "# track_heading_deg = [0.0, 90.0]",
                  '# imu_grade = "marine"', "beaufort = 2", '# parameters = {"gain" = 2.0}']),
    ("acoustics", ["# profile_temperature_C = []", "# fmi = 2"]),
    ("receiver", ['type = "coupled"', 'acceleration_psd_m2_s3 = "learned"', '# prior = "true"']),
])  # fmt: skip
def test_examples_are_rows_where_a_key_has_rows(table: str, lines: list[str]) -> None:
    section = re.split(r"^\[\w+\]$", starter("mine").partition(f"[{table}]\n")[2], flags=re.M)[0]
    found = section.splitlines()
    assert [line for line in lines if line not in found] == []
    assert max(map(len, found)) <= 98


def test_the_points_of_a_boat_are_valid_together() -> None:
    text = starter("mine")
    begin, boat = text.split("[platform]\n")
    for key in ("track_time_s", "track_m", "track_heading_deg"):
        boat = boat.replace(f"# {key} = ", f"{key} = ", 1)
    platform = load(tomllib.loads(f"{begin}[platform]\n{boat}")).platform
    assert platform.track_count == 2
    assert platform.track_m == (0.0, 10.0, 10.0, 10.0)
    assert platform.track_heading_deg == (0.0, 90.0)


@pytest.mark.parametrize("name", shipped())
def test_a_starter_from_a_scenario_is_that_scenario_under_another_name(name: str) -> None:
    made = load(tomllib.loads(starter("mine", name)))
    assert made.model_dump(exclude={"name"}) == load(name).model_dump(exclude={"name"})


@pytest.mark.parametrize("short", [True, False])
def test_a_starter_has_no_keys_without_effect(short: bool) -> None:
    """The boat's surge and sway are those of a platform that moves by sines."""
    base = load(LIKES["water-linked"].source, {"platform.motion": "spectrum"})
    made = tomllib.loads(starter("mine", base, short=short))
    assert base.given()["platform"].keys() - made["platform"].keys() >= {
        "surge_amplitude_m", "surge_frequency_Hz", "sway_amplitude_m", "sway_frequency_Hz"}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        connect(load(made))
    asked = starter("mine", base, asked=["platform.surge_amplitude_m"], short=short)
    assert "\nsurge_amplitude_m = 1.0" in asked


@pytest.mark.parametrize("name", LIKES)
def test_each_system_to_begin_with_runs_as_it_is(name: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    done = CliRunner().invoke(app, ["new", str(file), "--like", name])
    assert done.exit_code == 0, done.output
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = sblcosim.run(file, overrides={"time.duration_s": 30.0})
    assert result.scenario.name == "mine"
    assert len(result.record.estimates(result.scenario.receiver.type)) > 5
