"""The JSON schemas of scenario and study files refuse what the readers refuse, and nothing else."""

from __future__ import annotations

import json
import re
import subprocess
import tomllib
from collections.abc import Iterator
from importlib import metadata, resources
from math import inf, isinf, nan, prod
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import sblcosim.cli
from pydantic import ValidationError
from quick import one_in
from sblcosim.errors import ConfigurationError
from sblcosim.fmus.host.nanoseconds import MAX_SECONDS
from sblcosim.models import RECEIVERS
from sblcosim.models.settings.keys import default, in_file_units
from sblcosim.scenario.file_schema import DIRECTIVE, FILE_NAME, scenario_schema
from sblcosim.scenario.scenario import load, shipped, shipped_text
from sblcosim.scenario.schema import (
    Acoustics,
    Place,
    Platform,
    Receiver,
    Table,
    Target,
    Time,
    divides,
    most,
    rows,
    toml,
)
from sblcosim.scenario.starter import starter
from sblcosim.study.file_schema import study_schema
from sblcosim.study.study import load as load_study
from sblcosim.study.study import shipped as shipped_studies
from typer.testing import CliRunner

TABLES = {"target": Target, "platform": Platform, "acoustics": Acoustics, "receiver": Receiver}
SCENARIO = jsonschema.Draft7Validator(scenario_schema())
STUDY = jsonschema.Draft7Validator(study_schema())
SMALL = {
    "scenario": "paper-scenario-1",
    "factors": {"gps": {"keys": ["platform.gps_horizontal_std_m"], "levels": [0.1, 3.5]}},
}


def test_they_are_schemas() -> None:
    for validator in (SCENARIO, STUDY):
        jsonschema.Draft7Validator.check_schema(validator.schema)
        text = json.dumps(validator.schema)
        assert "$ref" not in text
        assert '"null"' not in text


def test_rows_may_be_flat_and_one_row_is_a_list() -> None:
    tables = scenario_schema()["properties"]
    points = tables["target"]["properties"]["waypoint_m"]
    row, flat = points["anyOf"]
    one = row["items"]
    assert (one["type"], one["minItems"], one["maxItems"]) == ("array", 3, 3)
    assert (flat["items"]["type"], flat["minItems"]) == ("number", 3 * row["minItems"])
    depths = tables["acoustics"]["properties"]["profile_depth_m"]
    assert depths["items"]["type"] == "number"
    assert "anyOf" not in depths


@pytest.mark.parametrize("name", shipped())
def test_shipped_scenarios_are_valid_and_what_is_made_of_them(name: str) -> None:
    SCENARIO.validate(tomllib.loads(shipped_text(name)))
    SCENARIO.validate(tomllib.loads(starter("mine", name)))
    SCENARIO.validate(tomllib.loads(load(name).dump_toml()))


@pytest.mark.parametrize("name", shipped_studies())
def test_shipped_studies_are_valid(name: str) -> None:
    file = resources.files("sblcosim.study") / "shipped" / f"{name}.toml"
    STUDY.validate(tomllib.loads(file.read_text("utf-8")))


def keys() -> Iterator[tuple[str, str]]:
    for name, table in TABLES.items():
        for key in table.variables:
            yield name, key


def readable(tables: dict[str, Any]) -> bool:
    """Whether the reader finds no key that is wrong by itself."""
    try:
        load(tables)
    except ConfigurationError as error:
        return "must be" not in str(error) or "must be a whole number of nanoseconds" in str(error)
    return True


@one_in(3)
@pytest.mark.parametrize(("table", "key"), [*keys()])
def test_every_key_has_the_bounds_type_and_text_of_its_declaration(table: str, key: str) -> None:
    variable = TABLES[table].variables[key]
    schema = SCENARIO.schema["properties"][table]["properties"][key]
    assert schema["description"] == variable.description
    if variable.choices is not None:
        wrong: list[Any] = ["no_such_choice", 1, True]
        right: list[Any] = [*variable.choices.values()]
    elif variable.type == "Boolean":
        wrong, right = ["yes", 1], [True, False]
    else:
        ends = [None if b is None else in_file_units(variable, b)
                for b in map(most, variable.bounds)]  # fmt: skip
        size = variable.size
        if key.startswith("track_"):
            size = prod(int(most(n) or 0) for n in variable.shape)
        wrong = ["1", True, {}, *(variable.named or {}).values()]
        right = [*(end for end in ends if end is not None), *(variable.named or ())]
        wrong += [end + step for end, step in zip(ends, (-1, 1), strict=True) if end is not None]
        if variable.shape:
            right, wrong = [[r] * size for r in right], [*wrong, 1.0] + [
                [w] * size for w in wrong
            ]
            rows_ = variable.rows.most if variable.rows else variable.shape[0]
            too_many = rows_ * variable.size // variable.shape[0] + 1
            wrong += [[right[0][0]] * too_many] if right else []
    for value in right:
        assert SCENARIO.is_valid({table: {key: value}}), value
    for value in wrong:
        assert not SCENARIO.is_valid({table: {key: value}}), value
        assert not readable({table: {key: value}}), value


REFERENCE = Path(__file__).parents[3] / "docs" / "reference" / "scenario.md"
BOUNDED = re.compile(r"(-?[\d.e+-]+) to (-?[\d.e+-]+)(, or `.*)?|at least (-?[\d.e+-]+)")
ALL_TABLES = {**TABLES, "time": Time, "place": Place}


def bounded() -> Iterator[tuple[str, str, float, float]]:
    """The keys with bounds in the reference: table, key, smallest and largest value."""
    for line in REFERENCE.read_text("utf-8").splitlines():
        path, _, _, _, values, *_ = [*line.strip("| ").split(" | "), *5 * ("",)]
        table, _, key = path.strip("`").partition(".")
        found = BOUNDED.fullmatch(values.strip("| "))
        if found and table in ALL_TABLES:
            low, high = found[1] or found[4], found[2] or "inf"
            yield table, key, float(low), float(high)


def test_the_bounds_of_a_key_are_those_of_the_reference() -> None:
    """Where a bound is a rounded angle, a value just within it; of a track, two points."""
    rows_ = [*bounded()]
    for table, key, low, high in rows_:
        kind = ALL_TABLES[table]
        variable = kind.variables.get(key)
        inward = 1e-5 if (low, high) in ROUNDED else 0.0
        for end, sign in ((low, -1), (high, 1)):
            if isinf(end):
                continue
            far = abs(end) * 1e-3 or 1e-12
            inside, outside = end - sign * abs(end) * inward, end + sign * far
            if (variable.type == "Int32") if variable else (key in WHOLE):
                inside, outside = int(inside), int(end) + sign
            for value, fits in ((inside, True), (outside, False)):
                given: Any = value
                if variable is not None and variable.shape:
                    given = [value] * prod(max(int(n), 2) for n in variable.shape)
                assert SCENARIO.is_valid({table: {key: given}}) == fits, (table, key, value)
                assert (not errors_of(kind, {key: given})) == fits, (table, key, value)
    assert len(rows_) > 150


ROUNDED = {(0.0, 57.2958), (0.572958, 90.0), (-572958.0, 572958.0)}
"""Bounds that are whole numbers of radians, or a hundredth."""
WHOLE = ("beaufort", "beacons", "packet_bits", "ekf_ratio")
"""Whole numbers that are no parameters."""


def errors_of(kind: type[Table], keys: dict[str, Any]) -> list[str]:
    """What is wrong with the keys of a table."""
    try:
        kind.model_validate(keys)
    except ValidationError as error:
        return [it["msg"] for it in error.errors()]
    return []


@pytest.mark.parametrize(("table", "key", "right", "wrong"), [
    ("target", "track_tolerance_m", (1e-9, 1e5), (0.0, -1.0, 100000.1)),
    ("platform", "track_tolerance_m", (1e-9, 1e5), (0.0, -1.0, 100000.1)),
    ("acoustics", "interval_s", (1e-6, 3.0), (0.0, -1e-6)),
    ("receiver", "fmi", (2, 3), (1, 4)), ("receiver", "prior", ("true",), ("false", 1)),
    ("time", "duration_s", ("path", 1e-9, 0.5), ("Path", True, 0.0, -1.0)),
])  # fmt: skip
def test_other_keys_have_bounds_too(
    table: str, key: str, right: tuple[Any, ...], wrong: tuple[Any, ...]
) -> None:
    for value in (*right, *wrong):
        fits = value in right and value is not True
        assert SCENARIO.is_valid({table: {key: value}}) == fits, value
        assert (not errors_of(ALL_TABLES[table], {key: value})) == fits, value
    assert errors_of(Receiver, {"prior": True}) == []  # as it is written in TOML


@pytest.mark.parametrize(("value", "said"), [
    (0.5, None), (60, None), (60.0, None), ("developed", None),
    (0.49, "at least 0.5"), (60.01, "at most 60"), (True, "a number"), ("deep", "a number"),
    (inf, "a finite number"), (nan, "a finite number"), ([3.0], "a number"),
])  # fmt: skip
def test_a_number_that_has_a_name_is_refused_in_words(value: Any, said: str | None) -> None:
    wanted = [] if said is None else [f"must be {said} or 'developed'"]
    assert errors_of(Platform, {"wave_period_s": value}) == wanted
    if said is None and value != "developed":
        period = Platform.model_validate({"wave_period_s": value}).wave_period_s
        assert (type(period), period) == (float, value)


@pytest.mark.parametrize(("value", "said"), [
    ("path", None), (1, None), (2.5, None), ("dive", "a number or 'path'"),
    (False, "a number or 'path'"), ([1.0], "a number or 'path'"), (0, "more than 0"),
    (-2.0, "more than 0"), (inf, "more than 0"), (nan, "more than 0"),
    (MAX_SECONDS, f"less than {MAX_SECONDS:g}"), (2 * MAX_SECONDS, f"less than {MAX_SECONDS:g}"),
])  # fmt: skip
def test_a_duration_is_refused_in_words(value: Any, said: str | None) -> None:
    wanted = [] if said is None else [f"must be {said}"]
    assert errors_of(Time, {"duration_s": value}) == wanted


@pytest.mark.parametrize(("name", "said"), [
    ("a" * 200, None), ("ä" * 100, None), ("2nd dive, 5 m", None), ("_x", None),
    ("a" * 201, "must have at most 200 bytes in UTF-8"),
    ("ä" * 100 + "b", "must have at most 200 bytes in UTF-8"),
    *((wrong, "must begin with a letter or digit and have no slash or control character")
      for wrong in ("", " a", "-a", ".a", "a/b", "a\\b", "a\nb", "a\x1fb", "a\x7fb")),
])  # fmt: skip
def test_a_name_fits_into_the_name_of_a_folder(name: str, said: str | None) -> None:
    if said is None:
        assert load({"name": name}).name == name
    else:
        with pytest.raises(ConfigurationError, match=said):
            load({"name": name})


def test_values_are_written_as_toml() -> None:
    value = {
        "switch": True, "off": False, "text": 'a "b" ä\x7f\n', "whole": -3, "small": 1e-05,
        "rows": [(1.0, 2), [3, 4.5]], "none": (), "table": {"a b": "c"},
    }  # fmt: skip
    read = tomllib.loads(f"value = {toml(value)}")["value"]
    assert read == {**value, "rows": [[1.0, 2], [3, 4.5]], "none": []}
    assert toml(value["rows"]) == "[[1.0, 2], [3, 4.5]]"
    assert toml("ä") == '"ä"'


def test_only_arrays_with_rows_are_written_by_rows() -> None:
    points = Target.variables["waypoint_m"]
    assert rows(points, (1, 2, 3, 4, 5, 6)) == [(1, 2, 3), (4, 5, 6)]
    assert rows(Target.variables["center_m"], (1, 2)) == (1, 2)
    assert rows(Target.variables["speed_m_s"], 1.5) == 1.5
    assert rows(None, (1, 2, 3)) == (1, 2, 3)


@pytest.mark.parametrize(("part", "whole", "does"), [
    (0.1, 0.3, True), (0.3, 0.3, True), (0.3, 0.1, False), (0.2, 0.3, False), (1e-9, 1.0, True),
    (1e-10, 1.0, False), (0.0, 1.0, False), (7.0, 1e6 * 7.0, True),
])  # fmt: skip
def test_a_time_divides_another_if_it_does_in_nanoseconds(
    part: float, whole: float, does: bool
) -> None:
    assert divides(part, whole) == does


PROFILES = [
    (table, key) for table, made in TABLES.items()
    for key, schema in SCENARIO.schema["properties"][table]["properties"].items()
    if "items" in schema and key not in made.variables
]  # fmt: skip
"""Keys with several numbers that are no parameters."""


@pytest.mark.parametrize(("table", "key"), PROFILES)
def test_each_number_of_a_profile_has_the_bounds_of_a_single_one(table: str, key: str) -> None:
    single = SCENARIO.schema["properties"][table]["properties"][key.removeprefix("profile_")]
    low, high = single["minimum"], single["maximum"]
    water = {"profile_depth_m": [0.0, 5.0], "profile_temperature_C": [9.0, 8.0]}
    for value, fits in ((low, True), (high, True), (low - 0.1, False), (high + 0.1, False)):
        for both in ([value, low], [low, value]):
            tables = {table: {**water, key: both}}
            assert SCENARIO.is_valid(tables) == fits, both
            assert readable(tables) == fits, both


@pytest.mark.parametrize(("table", "key"), PROFILES)
def test_a_profile_may_have_as_many_numbers_as_its_depths_and_no_more(
    table: str, key: str
) -> None:
    most = SCENARIO.schema["properties"][table]["properties"]["profile_depth_m"]["maxItems"]

    def tables(count: int) -> dict[str, Any]:
        depths = [10.0 * i for i in range(most)]
        water = {"profile_depth_m": depths, "profile_temperature_C": [9.0] * most}
        return {table: {**water, key: [9.0] * count}}

    assert SCENARIO.is_valid(tables(most))
    assert readable(tables(most))
    assert not SCENARIO.is_valid(tables(most + 1))
    with pytest.raises(ConfigurationError, match=rf"{key}: must have at most {most} values, got"):
        load({"name": "deep", **tables(most + 1)})


def test_defaults_are_those_that_hold_without_a_key() -> None:
    made = load({})
    for name, table in TABLES.items():
        for key, schema in SCENARIO.schema["properties"][name]["properties"].items():
            if "default" in schema and name != "receiver":
                value = rows(table.variables.get(key), getattr(made, name).__dict__[key])
                assert schema["default"] == json.loads(json.dumps(value))
    gate = SCENARIO.schema["properties"]["receiver"]["properties"]["gate"]
    assert gate["default"] == default(RECEIVERS["sequential"], RECEIVERS["sequential"]["gate"])
    follows = SCENARIO.schema["properties"]["receiver"]["properties"]["range_std_m"]
    assert "default" not in follows


@pytest.mark.parametrize(
    "tables",
    [
        {"targt": {}},
        {"target": {"sped_m_s": 1.0}},
        {"target": 3},
        {"name": "a/b"},
        {"name": ".a"},
        {"name": "x" * 201},
        {"name": 1},
        {"seed": -1},
        {"seed": 1.5},
        {"seed": "one"},
        {"fmi": 4},
        {"time": {"ekf_ratio": 0}},
        {"time": {"duration_s": 0}},
        {"time": {"duration_s": "forever"}},
        {"time": {"duration_s": 4e9}},
        {"time": {"sampling_time_s": 1e-9}},
        {"platform": {"beaufort": 7}},
        {"platform": {"imu_grade": "best"}},
        {"platform": {"gps_grade": "rtk"}},
        {"acoustics": {"clock_grade": "quartz"}},
        {"platform": {"clock_grade": "csac"}},
        {"receiver": {"type": "efk"}},
        {"receiver": {"prior": "false"}},
        {"target": {"waypoint_m": [[1.0, 2.0]]}},
        {"target": {"waypoint_m": [1.0, 2.0, "x"]}},
        {"acoustics": {"interval_s": 0.0}},
        {"acoustics": {"fmi": 1}},
    ],
    ids=str,
)
def test_a_wrong_key_type_or_value_is_refused_by_both(tables: dict[str, Any]) -> None:
    assert not SCENARIO.is_valid(tables)
    with pytest.raises(ConfigurationError):
        load(tables)
    fixed = {name: value for name, value in tables.items() if isinstance(value, dict)}
    if fixed:
        assert not STUDY.is_valid({**SMALL, "fixed": fixed})


@pytest.mark.parametrize(
    "tables",
    [
        {"name": "Übung 3.toml"},
        {"time": {"duration_s": 5}},
        {"target": {"trajectory": "waypoints", "waypoint_m": [[0, 0, 1], [1, 0, 1.5]]}},
        {"target": {"trajectory": "waypoints", "waypoint_m": [0, 0, 1, 1, 0, 1.5]}},
        {"receiver": {"fmu": "mine.fmu", "parameters": {"gain": [1, 2]}}},
        {"platform": {"beaufort": 0, "imu_grade": "tactical", "gps_grade": "sbas"}},
        {"acoustics": {"clock_grade": "csac", "clock_sync_age_s": 3600}},
    ],
    ids=str,
)
def test_what_is_readable_is_valid(tables: dict[str, Any]) -> None:
    SCENARIO.validate(tables)
    load(tables)
    STUDY.validate({**SMALL, "scenario": tables})


@pytest.mark.parametrize(
    "change",
    [
        {"scenario": 3},
        {"replicates": 0},
        {"replicates": "many"},
        {"seeding": "common noise"},
        {"settling_time_s": -1.0},
        {"settling_time": 1.0},
        {"receivers": "ekf"},
        {"receivers": [1]},
        {"responses": ["absolute_total_p96_m"]},
        {"design": {"kind": "ful"}},
        {"design": {"centre_points": -1}},
        {"design": {"resolution": 2}},
        {"fixed": {"target.sped_m_s": 1.0}},
        {"fixed": {"target.speed_m_s": "fast"}},
        {"fixed": {"target.speed_m_s": -1.0}},
        {"fixed": {"seed": 3}},
        {"factors": {"gps": {"keys": ["platform.gps_std_m"], "levels": [0.1, 3.5]}}},
        {"factors": {"gps": {"keys": [], "levels": [0.1, 3.5]}}},
        {"factors": {"gps": {"keys": ["platform.arm_length_m"], "levels": [1]}}},
        {"factors": {"gps": {"keys": ["platform.arm_length_m"], "levels": [1, 1]}}},
        {"factors": {"gps": {"keys": ["platform.arm_length_m"], "levels": ["a", "b"]}}},
        {"factors": {"g p": {"keys": ["platform.arm_length_m"], "levels": [1, 2]}}},
        {"factors": {"seed": {"keys": ["platform.arm_length_m"], "levels": [1, 2]}}},
        {"factors": {"gps": {"levels": [1, 2]}}},
    ],
    ids=str,
)
def test_a_wrong_study_is_refused_by_both(change: dict[str, Any]) -> None:
    STUDY.validate(SMALL)
    load_study(SMALL)
    assert not STUDY.is_valid({**SMALL, **change})
    with pytest.raises(ConfigurationError):
        load_study({**SMALL, **change}).base  # noqa: B018


def test_a_study_without_a_scenario_is_refused() -> None:
    assert not STUDY.is_valid({"factors": SMALL["factors"]})


def test_a_study_may_set_keys_in_every_way() -> None:
    for fixed in (
        {"target.speed_m_s": 1.0}, {"target": {"speed_m_s": 1.0}},
        {"receiver.parameters.gain": 2.0}, {"receiver": {"parameters": {"gain": 2.0}}},
    ):  # fmt: skip
        STUDY.validate({**SMALL, "fixed": fixed})
    STUDY.validate({**SMALL, "responses": ["percentiles", "mine.py:worst_m"]})
    other = {"keys": ["receiver.parameters.gain"], "levels": [1.0, 2.0]}
    STUDY.validate({**SMALL, "factors": {"gain": other}})


def taplo(file: Path) -> subprocess.CompletedProcess[str]:
    """What the engine of the editors' extension Even Better TOML says, without a network."""
    (command,) = (f.locate() for f in metadata.files("taplo") or () if f.stem == "taplo")
    return subprocess.run(
        [command, "check", file.name], cwd=file.parent, capture_output=True, text=True, check=False
    )


def test_an_editor_finds_the_schema_beside_a_new_scenario(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert CliRunner().invoke(sblcosim.cli.app, ["new", "mine.toml"]).exit_code == 0
    file = tmp_path / "mine.toml"
    text = file.read_text("utf-8")
    assert text.splitlines()[0] == DIRECTIVE
    assert json.loads((tmp_path / FILE_NAME).read_text("utf-8")) == scenario_schema()
    assert taplo(file).returncode == 0
    file.write_text(text.replace("speed_m_s = 0.5\n", "speed_m_s = -1\n"), "utf-8")
    wrong = taplo(file)
    assert wrong.returncode != 0
    assert "-1 is less than the minimum of 0" in wrong.stderr


def test_an_editor_finds_the_schema_that_was_written_beside_a_study(tmp_path: Path) -> None:
    schema = CliRunner().invoke(sblcosim.cli.app, ["schema", "study"]).stdout
    (tmp_path / "study.schema.json").write_text(schema, "utf-8")
    shipped_file = resources.files("sblcosim.study") / "shipped" / "paper-scenario-1.toml"
    text = f"#:schema ./study.schema.json\n{shipped_file.read_text('utf-8')}"
    file = tmp_path / "mine.toml"
    file.write_text(text, "utf-8")
    assert taplo(file).returncode == 0, taplo(file).stderr
    file.write_text(text.replace('kind = "full"', 'kind = "ful"'), "utf-8")
    assert taplo(file).returncode != 0
