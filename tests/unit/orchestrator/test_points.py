"""Points of a study are what each of them is alone, and what its tables would be as plain data."""

from __future__ import annotations

import random
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from quick import few, one_in
from sblcosim.errors import ConfigurationWarning, SblcosimError
from sblcosim.fmus import unchanged
from sblcosim.scenario.file_schema import scenario_schema
from sblcosim.scenario.scenario import Scenario, shipped
from sblcosim.scenario.scenario import load as load_scenario
from sblcosim.simulation.system import ComponentSpec, differences
from sblcosim.study import campaign, load
from sblcosim.study import shipped as shipped_studies
from sblcosim.study.checks import known_keys
from sblcosim.tracks import read as tracks
from seams import Seam

SCHEMAS = {
    f"{table}.{key}": schema
    for table, content in scenario_schema()["properties"].items()
    for key, schema in content.get("properties", {}).items()
}
ODD = ["word", -1e9, 1e9, True, None, 7, [1.0, 2.0], -0.0, 0.0]
"""Values that most keys refuse, or take for another than it looks."""


AT_SOME: dict[str, list[Any]] = {
    "time.sampling_time_s": [0.25, 7.0],
    "time.ekf_ratio": [1, 60],
    "target.speed_m_s": [0.5, 0.0],
    "acoustics.sampling_time_s": [0.25, 0.3],
}
"""Levels that are refused with some others only."""


def value_of(key: str, scenario: Scenario, rng: random.Random, odd: float = 0.15) -> Any:
    """A value of a key, which mostly is one that it may have."""
    if rng.random() < odd:
        return rng.choice(ODD)
    table, _, name = key.partition(".")
    now, schema = getattr(getattr(scenario, table), name), SCHEMAS[key]
    if "enum" in schema:
        return rng.choice(schema["enum"])
    if schema.get("type") == "boolean":
        return rng.random() < 0.5
    if isinstance(now, tuple) and now:
        return [v * rng.choice([1.0, 1.5]) if isinstance(v, float) else v for v in now]
    low, high = schema.get("minimum", -1.0), schema.get("maximum", 10.0)
    if schema.get("type") == "integer":
        return rng.randint(int(max(low, -5)), int(min(high, 8)))
    if isinstance(now, float):
        return rng.choice([now, now * 1.5, now + 0.25, rng.uniform(max(low, 0.0), min(high, 9.0))])
    return now


def content(scenario: Scenario) -> list[Any]:
    """All numbers of a scenario, to the bit, what was given, and what is said of it."""
    tables = [getattr(scenario, name) for name in type(scenario).model_fields]
    return [
        [repr(vars(it) if hasattr(it, "model_fields_set") else it) for it in tables],
        [sorted(getattr(it, "model_fields_set", ())) for it in tables],
        sorted(scenario.model_fields_set), scenario.given(), scenario.about_tracks,
        sorted(scenario.__dict__["_changed"]),
    ]  # fmt: skip


def outcome(make: Any) -> list[Any]:
    """What is made, and the warnings; or the message."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ConfigurationWarning)
        try:
            made = make()
        except SblcosimError as error:
            return [type(error), str(error)]
    return [made, [(w.category, str(w.message)) for w in caught]]


@one_in(2)
@pytest.mark.parametrize("name", shipped())
def test_a_variant_is_what_its_tables_are_as_plain_data(name: str) -> None:
    base = load_scenario(name)
    tables = base.given()
    rng = random.Random(name)
    keys = [key for key in SCHEMAS if key.partition(".")[0] in type(base).model_fields]
    some = [{key: value_of(key, base, rng)} for key in keys]  # each by itself
    some += [
        {key: value_of(key, base, rng) for key in rng.sample(keys, rng.randint(2, 6))}
        for _ in range(150)
    ]
    failed = 0
    with unchanged.assumed():
        for changes in some:
            found = outcome(lambda c=changes: content(base.override(c.items())))
            wanted = outcome(lambda c=changes: content(load_scenario(tables, c.items())))
            if isinstance(wanted[0], type):
                failed += 1
                wanted[1] = wanted[1].replace("scenario: ", f"{base.name}: ")
                found[1] = found[1].replace("scenario: ", f"{base.name}: ")
            assert found == wanted, changes
    assert 20 < failed < len(some) - 20
    assert content(base) == content(load_scenario(name))


def of_point(study: Any, number: int) -> list[Any]:
    """Scenario, system, plan and digest of a point, and the warnings; or the message."""

    def make() -> list[Any]:
        scenario, system, plan = campaign.resolved(study, number)
        settings = [
            (c.name, s.port.name, repr(s.values)) for c in plan.components for s in c.settings
        ]
        texts = [(c.name, c.tick_ns, c.interval_ns, c.reads, c.writes) for c in plan.components]
        digest = campaign.point_digest(study, number, system, plan, {"target.seed"})
        return [
            content(scenario), repr(system), settings, plan.columns, plan.sizes,
            (plan.start_ns, plan.stop_ns), texts, digest,
        ]  # fmt: skip

    return outcome(make)


def compared(study: Any, numbers: list[int]) -> tuple[int, int]:
    """Points that fail, and that do not."""
    alone = [of_point(study, number) for number in numbers]
    with unchanged.assumed():
        for order in (1, -1):
            shared = [of_point(study, number) for number in numbers[::order]]
            assert shared[::order] == alone
    failed = sum(isinstance(one[0], type) for one in alone)
    return failed, len(alone) - failed


@pytest.mark.parametrize("name", shipped_studies())
def test_points_of_a_shipped_study_are_the_same_alone(name: str) -> None:
    study = load(name)
    if study.model is not None:
        return
    count = len(study.points.values)
    numbers = sorted(random.Random(name).sample(range(1, count + 1), min(count, 6)))
    assert compared(study, numbers) == (0, len(numbers))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        prepared = campaign.prepare(study)
    free = {f"{name}.seed" for name in prepared.seeded} | {c.target for c in prepared.handovers}
    for number in numbers:
        _, system, plan = campaign.resolved(study, number)
        alone = campaign.point_digest(study, number, system, plan, free)
        assert prepared.points[number - 1].digest == alone


def made(seed: int, track: Path) -> Any:
    """A study from a seed, of any keys; None if it is refused as a whole."""
    rng = random.Random(seed)
    name = rng.choice([*shipped(), "track"])
    fixed: dict[str, Any] = {"time.duration_s": 5.0} if rng.random() < 0.5 else {}
    if name == "track":
        name = "paper-scenario-1"
        fixed |= {"target.trajectory": "file", "target.track_file": str(track)}
    base = load_scenario(name, fixed.items())
    kind = rng.choice(["grid", "grid", "full", "space"])
    idle = {".".join(key) for key in base.idle()}
    plain = [
        key for key in known_keys()
        if key in SCHEMAS and key not in idle
        and isinstance(value_of(key, base, rng, 0.0), bool | int | float | str)
    ]
    keys = set(rng.sample(plain, rng.randint(1, 3)))
    factors: dict[str, Any] = {}
    for n, key in enumerate(sorted(keys)):
        levels = [value_of(key, base, rng, 0.02) for _ in range(2)]
        factors[f"f{n}"] = {"keys": [key], "levels": levels}
        if kind == "space":
            factors[f"f{n}"]["distribution"] = "choice"
    tables: dict[str, Any] = {
        "scenario": name, "fixed": fixed, "design": {"kind": kind}, "factors": factors,
        "receivers": rng.choice([[], ["ekf"], ["ekf", "coupled"]]),
    }  # fmt: skip
    if kind == "space":
        tables["design"]["base_rows"] = 8
    elif rng.random() < 0.4 and not keys & AT_SOME.keys():
        key = rng.choice(sorted(AT_SOME))
        factors["some"] = {"keys": [key], "levels": AT_SOME[key]}
    if len(factors) > 1 and rng.random() < 0.4:
        tables["conditions"] = dict([factors.popitem()])
    if kind == "grid" and rng.random() < 0.3:
        tables |= {"seeding": "common", "receivers": []}
        factors["by"] = {"keys": ["receivers"], "levels": ["ekf", "sequential"]}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return load(tables)
    except SblcosimError:
        return None


@pytest.mark.parametrize("seeds", few([range(36), range(36, 120)], quick=[range(36)]))
def test_points_of_random_studies_are_the_same_alone(seeds: range, tmp_path: Path) -> None:
    track = tmp_path / "dive.csv"
    track.write_text("time_s,north_m,east_m,down_m\n0,0,0,5\n20,8,0,-3\n40,8,9,6\n")
    failed = fine = studies = 0
    for study in (made(seed, track) for seed in seeds):
        if study is None:
            continue
        studies += 1
        bad, good = compared(study, [*range(1, min(len(study.points.values), 4) + 1)])
        failed, fine = failed + bad, fine + good
    assert studies > len(seeds) / 8
    assert failed > len(seeds) / 24
    assert fine > len(seeds) / 3


def test_what_differs_between_components_is_all_that_does() -> None:
    study = load({
        "scenario": "paper-scenario-1", "fixed": {"time.duration_s": 5.0}, "receivers": ["ekf"],
        "design": {"kind": "grid"},
        "factors": {"gps": {"keys": ["platform.gps_horizontal_std_m"], "levels": [-0.0, 1.0]},
                    "tick": {"keys": ["time.sampling_time_s"], "levels": [0.25, 0.5]}},
    })  # fmt: skip
    with unchanged.assumed():
        systems = [campaign.resolved(study, number)[1] for number in range(1, 5)]
    for name in systems[0].components:
        for spec in (system.components[name] for system in systems):
            to = spec.like.to
            assert [*spec.parameters] == [*to.parameters]
            differ = {k for k, v in spec.parameters.items() if repr(v) != repr(to.parameters[k])}
            assert differ <= spec.like.but


def test_what_was_changed_otherwise_is_like_nothing() -> None:
    first = ComponentSpec(Path("a.fmu"), 1, {"a": 1.0, "b": 2.0})
    other = first.varied({"b": 3.0}).varied({"a": 4.0}, 5)
    assert (other.like.to, other.like.but) == (first, {"a", "b"})
    assert other == ComponentSpec(Path("a.fmu"), 5, {"a": 4.0, "b": 3.0})
    assert differences([first, other, first.varied({"b": 1.0})]) == {"a", "b"}
    assert replace(other, parameters={"a": 9.0, "b": 3.0}).like is None
    assert first.varied({"c": 1.0}).like is None
    assert differences([first, replace(first)]) == {"a", "b"}


def test_a_track_is_read_once_for_all_points_and_warned_of_at_each(
    tmp_path: Path, seam: Seam
) -> None:
    files = [tmp_path / "one.csv", tmp_path / "two.csv"]
    for file, depth in zip(files, (-3, 3), strict=True):  # one is above the water
        file.write_text(f"time_s,north_m,east_m,down_m\n0,0,0,5\n20,8,0,{depth}\n40,8,9,6\n")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        study = load({
            "scenario": "paper-scenario-1", "design": {"kind": "grid"}, "receivers": ["ekf"],
            "factors": {"arm": {"keys": ["platform.arm_length_m"], "levels": [0.5, 1.0, 2.0]},
                        "track": {"levels": {
                            file.stem: {"target": {"trajectory": "file", "track_file": str(file)}}
                            for file in files
                        }}},
        })  # fmt: skip
    reads: list[Any] = []
    original = tracks.read
    seam.instead(tracks.read, lambda *a, **k: reads.append(a) or original(*a, **k))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        campaign.prepare(study)
    assert len(reads) == 2
    (said,) = [str(w.message) for w in caught if "under water" in str(w.message)]
    assert said.endswith("(at 3 of 6 points)")
