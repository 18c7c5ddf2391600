"""The word ``"learned"`` for a receiver's q: every way to give it, and who does what with it."""

from __future__ import annotations

import json
import math
import tomllib
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ClassVar

import pytest
import sblcosim
import typer
from sblcosim.cli import app
from sblcosim.errors import ConfigurationError, ConfigurationWarning
from sblcosim.fmus.build.factory import build
from sblcosim.limits.parameters import conditions, parameters
from sblcosim.models import RECEIVERS
from sblcosim.packages.read import opened
from sblcosim.require.question import load as load_question
from sblcosim.scenario.explained import explained
from sblcosim.scenario.scenario import Scenario, load
from sblcosim.scenario.starter import starter
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.resolve import resolve
from sblcosim.study import runner, study
from typer.testing import CliRunner

KEY, PSD = "acceleration_psd_m2_s3", "acceleration_psd"
FULL = f"receiver.{KEY}"
LEARN = ("coupled", "fixed_lag", "long_baseline", "array")
WITH_Q = [name for name, it in RECEIVERS.items() if PSD in {v.name for v in it}]
SHORT = {"time.duration_s": 8.0}
TABLES: Mapping[str, Any] = {
    "time": {"duration_s": 8.0}, "receiver": {"type": "coupled", KEY: "learned"},
}
TEXT = f'[time]\nduration_s = 8.0\n[receiver]\ntype = "coupled"\n{KEY} = "learned"\n'


def cli(*arguments: object) -> Any:
    return CliRunner().invoke(app, [*map(str, arguments)])


def given(scenario: Scenario, receiver: Any = None, label: str = "it") -> Any:
    """What reaches the component: a parameter; None if it keeps its start value."""
    source = scenario.receiver.type if receiver is None else receiver
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConfigurationWarning)
        system = connect(scenario, {label: source})
    resolve(system)  # its bounds are checked
    return system.components[label].parameters.get(PSD)


# --- How it is given -----------------------------------------------------------------------------


def in_file(folder: Path) -> Scenario:
    (folder / "mine.toml").write_text(TEXT)
    return load(folder / "mine.toml")


WAYS: Mapping[str, Callable[[Path], Scenario]] = {
    "file": in_file,
    "tables": lambda _: load(TABLES),
    "override": lambda _: load("realistic-dive", {FULL: "learned"}),
    "text": lambda _: load("realistic-dive", [f"{FULL}=learned"]),
    "TOML text": lambda _: load("realistic-dive", [f'{FULL} = "learned"']),
    "items": lambda _: load("realistic-dive", {FULL: "learned"}.items()),
    "nested": lambda _: load("realistic-dive", {"receiver": {KEY: "learned"}}),
    "loaded": lambda _: load(load("realistic-dive", {FULL: 0.5}), {FULL: "learned"}),
    "written": lambda _: load(tomllib.loads(load(TABLES).dump_toml())),
    "new": lambda _: load(tomllib.loads(starter("mine", TABLES, short=True))),
    "new, all": lambda _: load(tomllib.loads(starter("mine", TABLES))),
}


@pytest.mark.parametrize("way", WAYS)
def test_it_is_the_same_however_it_is_given(way: str, tmp_path: Path) -> None:
    scenario = WAYS[way](tmp_path)
    assert scenario.receiver.acceleration_psd_m2_s3 == "learned"
    assert f'{KEY} = "learned"' in scenario.dump_toml()
    assert given(scenario) == -1.0


@pytest.mark.parametrize("name", WITH_Q)
def test_who_can_learn_is_told_to_and_the_others_keep_their_own(name: str) -> None:
    scenario = load(TABLES)
    assert given(scenario, name) == (-1.0 if name in LEARN else RECEIVERS[name][PSD].starts[0])
    assert given(scenario.override({FULL: 0.25}), name) == 0.25
    assert given(scenario.override({FULL: None}), name) == 0.01


WRONG: list[tuple[Any, str]] = [
    ("lerned", "must be a number or 'learned', got \"lerned\"; did you mean 'learned'?"),
    ("Learned", "must be a number or 'learned', got \"Learned\"; did you mean 'learned'?"),
    ("fast", "must be a number or 'learned', got \"fast\""),
    ("", "must be a number or 'learned', got \"\""),
    (-1, "must be at least 0 or 'learned', got -1"),
    (-1e-9, "must be at least 0 or 'learned', got -1e-09"),
    (True, "must be a number or 'learned', got true"),
    ([0.1], "must be a number or 'learned', got [0.1]"),
    (math.nan, "must be a finite number or 'learned', got nan"),
    (math.inf, "must be a finite number or 'learned', got inf"),
]


@pytest.mark.parametrize(("value", "message"), WRONG)
def test_anything_else_is_refused_with_what_must_hold(value: Any, message: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        load("realistic-dive", {FULL: value})
    assert str(caught.value) == f"override {FULL}: {message}"
    with pytest.raises(ConfigurationError) as caught:
        load({"receiver": {KEY: value}})
    assert str(caught.value) == f"scenario: [receiver] {KEY}: {message}"


def test_numbers_are_as_before() -> None:
    for value in (0, 0.0, 2, 0.003):
        found = load({"receiver": {KEY: value}}).receiver.acceleration_psd_m2_s3
        assert (found, type(found)) == (value, float)


def test_the_diver_s_own_q_is_a_number() -> None:
    with pytest.raises(ConfigurationError, match=rf"\[target\] {KEY}: must be a number, got"):
        load({"target": {KEY: "learned"}})


def test_a_key_is_explained_with_its_word() -> None:
    assert explained("receiver", KEY).endswith('[m²/s³]; at least 0, or "learned"')
    assert explained("target", KEY).endswith("[m²/s³]; at least 0")
    offered = [word for word, _ in sblcosim.cli.common.completion.keys(f"{FULL}=")]
    assert offered == [f"{FULL}=", f"{FULL}=learned", f"{FULL}=0.01"]


# --- Receivers of the user -----------------------------------------------------------------------


class Given(sblcosim.Receiver):
    parameters: ClassVar[Mapping[str, Any]] = {PSD: 0.5}


class Learning(sblcosim.Receiver):
    parameters: ClassVar[Mapping[str, Any]] = {PSD: -1.0}


OWN = """\
import casadi as ca
from sblcosim.models.declaration import parameter
from sblcosim.models.equations import Equations
from sblcosim.models.receiver import estimate, measurements
from sblcosim.models.receiver.receiver import ReceiverDeclaration
from sblcosim.models.receiver.variables import BEACON_SOURCE, MOTION, PSD, receiver


def equations():
    def tick(p, x, u, w, t, k):
        s = measurements.samples(p, x, u)
        return {"seen": s.mark, "update_count": x.update_count + s.any_new}

    return Equations(
        initial=lambda p, w, t: {**measurements.initial(p, t), **estimate.initial(t)},
        tick=tick,
        output=lambda p, x, u, t: estimate.outputs(x, ca.SX.zeros(6), ca.SX.zeros(6, 6)),
    )


RECEIVER = ReceiverDeclaration(
    receiver("Own", 1001, "For a test", (BEACON_SOURCE, PARAMETER)), equations=equations,
)
"""


def folder(parent: Path, declared: str) -> Path:
    (parent / "own").mkdir()
    (parent / "own" / "receiver.py").write_text(OWN.replace("PARAMETER", declared))
    return parent / "own"


@pytest.mark.parametrize(("declared", "value"), [("MOTION", -1.0), ("PSD", None)])
def test_a_folder_takes_the_word_if_its_declaration_has_it(
    declared: str, value: float | None, tmp_path: Path
) -> None:
    own = folder(tmp_path, declared)
    assert given(load(TABLES), str(own)) == value
    assert given(load(TABLES, {FULL: 0.25}), str(own)) == 0.25


def test_a_folder_may_have_named_values_of_its_own(tmp_path: Path) -> None:
    own = folder(tmp_path, 'parameter("turn", "An angle", "rad", min=0.0, named={"free": -1.0})')
    for value, there in (("free", -1.0), (90.0, pytest.approx(math.pi / 2))):
        scenario = load(TABLES, {"receiver.parameters": {"turn_deg": value}})
        assert connect(scenario, {"it": str(own)}).components["it"].parameters["turn"] == there
    for value, message in (("fre", "must be a number or 'free', got \"fre\"; did you mean 'free'?"),
                           (-1.0, "must be at least 0 or 'free', got -1.0")):  # fmt: skip
        with pytest.raises(ConfigurationError) as caught:
            connect(load(TABLES, {"receiver.parameters": {"turn_deg": value}}), {"it": str(own)})
        assert f"turn_deg: {message}" in str(caught.value)


def test_a_class_and_files_keep_their_own_unless_their_bounds_have_it() -> None:
    scenario = load(TABLES)
    assert given(scenario, Given) is None
    assert given(scenario, Learning) == -1.0
    for kind in (Given, Learning):
        assert given(scenario.override({FULL: 0.25}), kind) == 0.25
    assert given(scenario, build("coupled", 2)) == -1.0
    assert given(scenario, build("ekf", 3)) is None


def test_a_scenario_may_name_such_a_file() -> None:
    for name, value in (("coupled", -1.0), ("ekf", None)):
        file = str(build(name, 2))
        scenario = load({**TABLES, "receiver": {"fmu": file, KEY: "learned"}})
        assert given(scenario, file) == value


# --- Where nobody learns -------------------------------------------------------------------------


def doubts(scenario: Scenario, receivers: Any) -> list[str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        connect(scenario, receivers)
    return [str(w.message) for w in caught if "learned" in str(w.message)]


IS_FOR = "'learned' is for coupled, fixed_lag, long_baseline and array; "


def test_a_word_that_no_receiver_of_the_run_takes_is_told() -> None:
    ekf = load({"receiver": {"type": "ekf", KEY: "learned"}})
    assert doubts(ekf, ()) == [f"scenario: [receiver] {KEY}: {IS_FOR}ekf keeps its start value"]
    asked = load("realistic-dive", {FULL: "learned"})
    assert doubts(asked, ["ekf", "sequential"]) == [
        f"override {FULL}: {IS_FOR}ekf and sequential keep their start values"
    ]


def test_a_word_that_is_taken_or_is_for_the_scenario_s_own_receiver_is_not_told() -> None:
    assert not doubts(load(TABLES), ())
    assert not doubts(load(TABLES), ["ekf"])
    assert not doubts(load("realistic-dive", {FULL: "learned"}), ["ekf", "coupled"])
    assert not doubts(load("realistic-dive", {FULL: "learned"}), ["multilateration"])


# --- Commands ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with the word, whose receiver does not learn."""
    out = tmp_path_factory.mktemp("runs") / "dive"
    done = cli("run", "realistic-dive", "--receiver", "ekf", "--set", "time.duration_s=30.0",
               "--set", f"{FULL}=learned", "--out", out, "--no-figures", "--log")  # fmt: skip
    assert done.exit_code == 0, done.output
    return out


ARGUMENTS: Mapping[str, list[str]] = {
    "run": ["realistic-dive"], "plan": ["realistic-dive"], "budget": ["realistic-dive"],
    "compare": ["realistic-dive", "--receiver", "ekf", "--receiver", "coupled"],
    "map": ["realistic-dive", "--area", "20x20", "--depth", "5"],
    "export ssp": ["realistic-dive", "--out", "x.ssp"],
    "export fmu": ["realistic-dive", "--out", "x"],
    "explore": ["realistic-dive", "--out", "x.html", "--no-open"],
    "firmware": ["coupled", "realistic-dive", "--out", "x"],
    "smooth": ["RUN"],
    "process": ["RUN/log"],
}


def commands(group: Any, above: str = "") -> list[str]:
    found = []
    for name, command in group.commands.items():
        inner = commands(command, f"{above}{name} ") if hasattr(command, "commands") else []
        sets = any("--set" in p.opts for p in command.params)
        found += inner or ([f"{above}{name}"] if sets else [])
    return found


def test_all_commands_that_change_keys_are_tried() -> None:
    assert sorted(commands(typer.main.get_command(app))) == sorted(ARGUMENTS)


@pytest.mark.parametrize("command", ARGUMENTS)
def test_every_command_refuses_a_wrong_word_before_it_begins(
    command: str, run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    words = [word.replace("RUN", str(run)) for word in ARGUMENTS[command]]
    near = "must be a number or 'learned', got \"lerned\"; did you mean 'learned'"
    for value, message in (("lerned", near), ("-1", "must be at least 0 or 'learned', got -1")):
        done = cli(*command.split(), *words, "--set", f"{FULL}={value}")
        assert done.exit_code != 0
        assert f"--set {FULL}: must be " in done.output
        assert message in " ".join(done.output.split())
    assert not [*tmp_path.iterdir()]


def test_a_run_is_written_back_with_the_word(run: Path) -> None:
    assert f'{KEY} = "learned"' in (run / "scenario.toml").read_text()
    manifest = json.loads((run / "manifest.json").read_text())
    assert manifest["scenario"]["receiver"][KEY] == "learned"
    assert manifest["receivers"][0]["parameters"][PSD] == 0.01
    assert load(run / "scenario.toml").receiver.acceleration_psd_m2_s3 == "learned"


def test_a_package_has_the_number(tmp_path: Path) -> None:
    done = cli("export", "ssp", "realistic-dive", "--set", f"{FULL}=learned",
               "--out", tmp_path / "x.ssp")  # fmt: skip
    assert done.exit_code == 0, done.output
    with opened(tmp_path / "x.ssp") as package:
        assert package.system.components["coupled"].parameters[PSD] == -1.0


def test_a_new_scenario_keeps_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "before.toml").write_text(TEXT)
    for option in ([], ["--all"]):
        done = cli("new", "mine.toml", "--from", "before.toml", "--yes", "--force", *option)
        assert done.exit_code == 0, done.output
        assert f'\n{KEY} = "learned"' in (tmp_path / "mine.toml").read_text()


# --- Studies and questions -----------------------------------------------------------------------


def definition(levels: Any = ("learned", 0.05, 0.1), **rest: Any) -> dict[str, Any]:
    return {
        "scenario": "harbour-square", "receivers": ["coupled"], "design": {"kind": "grid"},
        "fixed": SHORT, "factors": {"q": {"keys": [FULL], "levels": [*levels]}}, **rest,
    }  # fmt: skip


def test_a_grid_has_it_among_numbers() -> None:
    made = study.load(definition())
    assert [row for (row,) in made.points.values] == ["learned", "0.05", "0.1"]
    assert [made.overrides(n)[FULL] for n in (1, 2, 3)] == ["learned", 0.05, 0.1]
    reached = [given(made.base.override(made.overrides(n).items()), "coupled") for n in (1, 2, 3)]
    assert reached == [-1.0, 0.05, 0.1]
    assert study.load(definition([0.05, 0.1])).points.values == ((0.05,), (0.1,))


@pytest.mark.parametrize("kind", ["full", "sweep", "fraction"])
def test_designs_of_numbers_refuse_it(kind: str) -> None:
    rest = {"resolution": 3} if kind == "fraction" else {}
    with pytest.raises(ConfigurationError) as caught:
        study.load(definition([0.05, "learned"], design={"kind": kind, **rest}))
    assert "must have numbers as levels in this design, got 'learned'" in str(caught.value)


def in_space(**factor: Any) -> dict[str, Any]:
    return definition(design={"kind": "space", "base_rows": 16},
                      factors={"q": {"keys": [FULL], **factor}})  # fmt: skip


def test_a_space_draws_numbers_within_the_bounds_of_numbers() -> None:
    assert len(study.load(in_space(distribution="uniform", range=[0.0, 0.1])).points.values) == 64
    with pytest.raises(ConfigurationError, match=r"within the bounds of its keys, 0 to inf"):
        study.load(in_space(distribution="uniform", range=[-1.0, 0.1]))
    with pytest.raises(ConfigurationError, match="must be all numbers or all texts"):
        study.load(in_space(distribution="choice", levels=["learned", 0.1]))


def test_a_sweep_of_others_needs_a_number_as_its_base_only_of_what_it_sweeps() -> None:
    factors = {"q": {"keys": [FULL], "levels": [0.05, 0.1]},
               "gps": {"keys": ["platform.gps_horizontal_std_m"], "levels": [0.1, 1.0]}}
    sweep = {"design": {"kind": "sweep"}, "fixed": {},
             "scenario": {"name": "s", **TABLES}}  # fmt: skip
    with pytest.raises(ConfigurationError, match=r"same number in the scenario.*got 'learned'"):
        _ = study.load(definition(factors=factors, **sweep)).points
    del factors["q"]
    made = study.load(definition(factors=factors, **sweep))
    assert made.base.receiver.acceleration_psd_m2_s3 == "learned"


@pytest.mark.parametrize(("level", "message"), [
    ("lerned", "must be a number or 'learned', got \"lerned\"; did you mean 'learned'?"),
    (-1.0, "must be at least 0 or 'learned', got -1.0"),
])  # fmt: skip
def test_a_wrong_level_is_refused(level: Any, message: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        study.load(definition(["learned", level, 0.1]))
    assert f"[factors.q] levels: {FULL}: {message}" in str(caught.value)


def test_levels_may_be_tables_that_have_it() -> None:
    levels = {"own": {"receiver": {KEY: "learned"}}, "steady": {"receiver": {KEY: 0.003}}}
    made = study.load(definition(factors={"q": {"levels": levels}}))
    assert [made.overrides(n)[FULL] for n in (1, 2)] == ["learned", 0.003]


@pytest.mark.parametrize(
    ("keys", "levels", "shown"),
    [([FULL], ["learned", 0.05, 1 / 3], ["learned", "0.05", repr(1 / 3)]),
     (["time.duration_s"], ["path", 20.0, 25], ["path", "20", "25"])],
)  # fmt: skip
def test_a_study_with_names_among_numbers_is_run_stored_and_analysed(
    keys: list[str], levels: list[Any], shown: list[str], tmp_path: Path
) -> None:
    factors = {"q": {"keys": keys, "levels": levels}}
    fixed = {} if keys == ["time.duration_s"] else {"time.duration_s": 20.0}
    made = definition(receivers=["ekf"], factors=factors, replicates=2, fixed=fixed)
    (tmp_path / "s.json").write_text(json.dumps(made))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConfigurationWarning)
        runner.run(study.load(made), tmp_path / "s")
    table = sblcosim.study.table(tmp_path / "s")
    assert sorted(set(table["q"])) == sorted(shown)
    done = cli("analyse", tmp_path / "s", "--json")
    assert done.exit_code == 0, done.output
    assert all(f'"{level}"' in done.output for level in shown)


def test_a_function_gets_numbers_as_numbers(tmp_path: Path) -> None:
    (tmp_path / "model.py").write_text("def f(q):\n    return 7.0 if q == 'learned' else 2 * q\n")
    made = study.load({
        "model": f"{tmp_path / 'model.py'}:f", "design": {"kind": "grid"},
        "factors": {"q": {"levels": ["learned", 0.25, 1]}},
    })  # fmt: skip
    runner.run(made, tmp_path / "s")
    table = sblcosim.study.table(tmp_path / "s").set_index("q")
    assert table["f.value"].to_dict() == {"learned": 7.0, "0.25": 0.5, "1": 2.0}


def test_a_question_has_designs_with_it() -> None:
    asked = load_question({
        "scenario": "harbour-square", "response": "total_p95_m", "limit": 1.0,
        "settling_time_s": 2.0,
        "choices": {"q": {"keys": [FULL], "levels": ["learned", 0.05], "label": "motion",
                          "costs": {"learned": 0, "0.05": 3}}},
    })  # fmt: skip
    assert [(d.levels["q"], d.cost) for d in asked.designs] == [("learned", 0.0), ("0.05", 3.0)]
    assert asked.named({"q": "learned"}) == "motion learned"
    assert asked.named({"q": "0.05"}) == "motion 0.05 m²/s³"


# --- Limits --------------------------------------------------------------------------------------


def test_what_is_possible_does_not_depend_on_what_a_receiver_is_told() -> None:
    for target in ({}, {"trajectory": "white_noise_acceleration", KEY: 0.002}):
        tables = {"target": target}
        word, number = (load({**tables, "receiver": {KEY: q}}) for q in ("learned", 0.5))
        assert vars(parameters(word)) == vars(parameters(number))
        assert conditions(word) == conditions(number)
        assert conditions(word).acceleration_psd == target.get(KEY, 0.01)
