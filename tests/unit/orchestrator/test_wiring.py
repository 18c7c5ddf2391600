"""From a scenario to a system."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Mapping
from math import pi
from pathlib import Path
from typing import Any

import pytest
from sblcosim.errors import ConfigurationError, ConfigurationWarning, FmuError
from sblcosim.fmus.build.factory import build
from sblcosim.models import RECEIVERS
from sblcosim.models.declaration import input_, parameter
from sblcosim.models.ports import DEPTH, ESTIMATE, RECEPTION
from sblcosim.scenario.scenario import load
from sblcosim.scenario.sources import choice_of
from sblcosim.scenario.wiring import applied, connect
from sblcosim.simulation.system import System

PAPER = load("paper-scenario-1")


class Deaf:
    """A receiver that has the required outputs and hears nothing but the depth."""

    variables = (
        parameter("range_std", "", "m", start=1.0),
        input_("depth", "", "m", variability="discrete"),
        *(v for v in ESTIMATE if v.name in ("epoch", "position", "update_count")),
    )

    def initialise(self, start_ns: int, parameters: Mapping[str, Any]) -> dict[str, Any]:
        self.count = 0
        return self.outputs(start_ns, 0.0)

    def do_step(self, time_ns: int, step_ns: int, inputs: Mapping[str, Any]) -> dict[str, Any]:
        self.count += 1
        return self.outputs(time_ns, float(inputs["depth"]))

    def outputs(self, epoch_ns: int, depth: float) -> dict[str, Any]:
        return {"epoch": epoch_ns / 1e9, "position": (0.0, 0.0, depth), "update_count": self.count}


def connected(system: System, component: str) -> set[str]:
    prefix = f"{component}."
    return {
        c.target.removeprefix(prefix) for c in system.connections if c.target.startswith(prefix)
    }


def test_a_system_has_the_four_components_and_the_raw_fix() -> None:
    system = connect(PAPER)
    assert list(system.components) == ["target", "platform", "acoustics", "ekf", "raw"]
    assert {c.interval_ns for c in system.components.values()} == {100_000_000}
    assert (
        connected(system, "ekf")
        == connected(system, "raw")
        == {v.name for v in (*RECEPTION, *DEPTH)}
    )
    assert connected(system, "acoustics") == {
        "target_position", "target_velocity", "beacon_position", "reported_beacon_position",
        "reported_position", "reported_attitude",
    }  # fmt: skip


def test_parameters_arrive_in_si_units_under_the_names_of_the_fmu() -> None:
    components = connect(PAPER).components
    assert components["target"].parameters["trajectory"] == 2
    assert components["platform"].parameters["roll_amplitude"] == pytest.approx(pi / 36)
    assert components["acoustics"].parameters["motion_during_travel"] is False
    assert components["ekf"].parameters["measurement_noise"] == 2


def test_all_receivers_of_a_run_take_the_same_options_of_noise() -> None:
    with pytest.warns(ConfigurationWarning, match="receiver long_baseline: is for"):
        components = connect(PAPER, list(RECEIVERS)).components
    raw = connect(PAPER).components["raw"]
    expected = {
        "range_std": 0.1, "depth_std": 0.01, "measurement_noise": 2, "beacon_position_source": 2,
    }  # fmt: skip
    for name, spec in (("multilateration", raw), *((name, components[name]) for name in RECEIVERS)):
        known = {v.name for v in RECEIVERS[name].of("parameter")} & expected.keys()
        assert {"range_std", "depth_std"} <= known
        assert {key: spec.parameters[key] for key in known} == {key: expected[key] for key in known}


def test_the_run_ends_with_the_path_or_after_the_given_time() -> None:
    assert connect(PAPER).stop_ns == pytest.approx(15 * pi / 0.5 * 1e9, abs=1)
    assert connect(load(PAPER, {"time.duration_s": 12.5})).stop_ns == 12_500_000_000


@pytest.mark.filterwarnings("ignore::sblcosim.errors.NoEffectWarning")
def test_a_path_without_an_end_needs_a_duration() -> None:
    endless = load(PAPER, {"target.trajectory": "white_noise_acceleration"})
    with pytest.raises(ConfigurationError, match="duration_s: must be a number for a target"):
        connect(endless)


def test_the_true_prior_is_where_the_target_starts_at_rest() -> None:
    random = load("paper-scenario-3", {"target.depth_start_m": 4.0})
    parameters = connect(random, ["ekf", "sequential"]).components["sequential"].parameters
    x, y, z = parameters["prior_position"]  # type: ignore[misc]
    assert (abs(x) < 25.0, abs(y) < 25.0, z) == (True, True, 4.0)
    assert x != 0.0
    assert parameters["prior_velocity"] == (0.0, 0.0, 0.0)
    assert parameters["initialisation"] == 2


def test_receivers_run_side_by_side_under_their_labels() -> None:
    ekf = build("ekf")
    system = connect(PAPER, ["sequential", "ekf", ekf, Deaf])
    assert list(system.components)[3:] == ["sequential", "ekf", "ekf_2", "Deaf", "raw"]
    assert list(connect(PAPER, [ekf, "ekf"]).components)[3:] == ["ekf_2", "ekf", "raw"]
    assert connect(PAPER, [ekf, "ekf"]).components["ekf_2"].fmu == ekf
    assert list(connect(PAPER, {"a": "ekf", "b": Deaf}).components)[3:] == ["a", "b", "raw"]


def test_the_raw_fix_that_is_asked_for_is_not_there_twice() -> None:
    assert list(connect(PAPER, "multilateration").components)[3:] == ["multilateration"]


@pytest.mark.parametrize("label", ["target", "a.b", "", 5])
def test_a_label_must_be_a_free_name(label: Any) -> None:
    with pytest.raises(ConfigurationError, match="label must be a name"):
        connect(PAPER, {label: "ekf"})


def test_fmi_versions_are_chosen_for_all_or_for_one() -> None:
    mixed = connect(load(PAPER, {"fmi": 3, "acoustics.fmi": 2}))
    assert mixed.components["target"].fmu == build("target", 3)
    assert mixed.components["acoustics"].fmu == build("acoustics", 2)
    assert connect(PAPER, fmi=3).components["platform"].fmu == build("platform", 3)


def test_a_foreign_receiver_gets_the_parameters_and_the_connections_it_has() -> None:
    system = connect(PAPER, Deaf)
    assert system.components["Deaf"].parameters == {"range_std": 0.1}
    assert connected(system, "Deaf") == {"depth"}


def test_the_scenarios_own_fmu_gets_its_keys_and_further_parameters() -> None:
    tables = {
        "receiver": {"fmu": str(build("sequential")), "gate": 3.0, "parameters": {"gate_limit": 7}}
    }
    system = connect(load(tables))
    parameters = system.components["sequential"].parameters
    assert (parameters["gate"], parameters["gate_limit"]) == (3.0, 7)
    assert parameters["update_interval"] == 0.1
    assert "process_noise" not in parameters


def test_a_key_that_the_scenarios_own_fmu_does_not_have_is_refused() -> None:
    scenario = load({"receiver": {"fmu": str(build("ekf")), "gate": 3.0}})
    with pytest.raises(ConfigurationError, match=r"\[receiver\] gate: must be a parameter of"):
        connect(scenario)


def test_a_key_that_no_receiver_of_the_run_has_is_refused() -> None:
    scenario = load(PAPER, {"receiver.gate": 3.0})
    match = r"^override receiver.gate: .* \(ekf, multilateration\)"
    with pytest.raises(ConfigurationError, match=match):
        connect(scenario)
    with pytest.raises(ConfigurationError, match=r"^scenario: \[receiver\] gate: must be a key"):
        connect(load({"receiver": {"gate": 3.0}}))
    assert connect(scenario, "sequential").components["sequential"].parameters["gate"] == 3.0


@pytest.mark.parametrize(
    ("receiver", "message"),
    [
        ("efk", "must be ekf, .* did you mean 'ekf'?"),
        ("nothing.fmu", "receiver: nothing.fmu: must be an FMU file, got no such file"),
        (build("target"), "must honour the plug contract of a receiver, got depth: must be an"),
    ],
)
def test_what_cannot_be_a_receiver_is_refused(receiver: str | Path, message: str) -> None:
    with pytest.raises(ConfigurationError, match=message) as caught:
        connect(PAPER, receiver)
    assert "\n" not in str(caught.value)


def test_a_stranger_is_refused_as_a_receiver(stranger: Callable[[int], Path]) -> None:
    with pytest.raises(ConfigurationError, match="must honour the plug contract"):
        connect(PAPER, stranger(2))


def test_a_missing_fmu_of_the_scenario_is_named() -> None:
    with pytest.raises(FmuError, match=r"no\.fmu"):
        connect(load(PAPER, {"target.fmu": "no.fmu"}))


def test_only_the_fixed_components_can_be_replaced_by_name() -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'target'"):
        connect(PAPER, components={"targt": Deaf})


class Silent(Deaf):
    """Lacks what every receiver must have."""

    variables = Deaf.variables[:-2]


class Wrong(Deaf):
    """Has a port that is not as agreed."""

    variables = (*Deaf.variables, input_("range", "", "m", shape=(3,)))


class Curious(Deaf):
    """Has an input that nothing feeds."""

    variables = (*Deaf.variables, input_("ranges", "", "m", shape=(4,)))


class Choosy(Deaf):
    """Cannot be made without an argument."""

    def __init__(self, gain: float) -> None:
        self.gain = gain


class Bare:
    """Is no component."""


class Vague(Deaf):
    """Declares by name only."""

    variables = ("position",)  # type: ignore[assignment]


@pytest.mark.parametrize(
    ("receiver", "message"),
    [
        (Deaf(), "receiver: must be a name, an FMU file, or a class or function that makes the "
                 "component, got an instance of Deaf"),
        (5, "receiver: must be a name, an FMU file, or a class or function that makes the "
            "component, got 5"),
        ({"a": Deaf()}, "receiver: must be a name, an FMU file, or a class or function that makes "
                        "the component, got an instance of Deaf"),
        (Bare, "Bare: must make a component, got Bare, whose object has no variables and no "
               "initialise and no do_step; see sblcosim.Receiver and sblcosim.PythonComponent"),
        (Choosy, "Choosy: must make the component without arguments, got Choosy (missing a "
                 "required argument: 'gain')"),
        (Vague, "Vague: variables must be a sequence of Variable, got 'position' in it"),
        (Silent, "Silent: must honour the plug contract of a receiver, got epoch: must be an "
                 "output, got none (and 1 more)"),
        (Wrong, "Wrong: must be made for the 4 beacons of the scenario, got range of 3; "
                "platform.beacons sets the number"),
    ],
)  # fmt: skip
def test_a_python_receiver_is_refused_before_the_run(receiver: Any, message: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        connect(PAPER, receiver)
    assert str(caught.value) == message


def test_an_input_that_nothing_feeds_is_a_warning() -> None:
    match = r"^Curious.ranges: nothing feeds this input, .*; did you mean 'range'\?$"
    with pytest.warns(ConfigurationWarning, match=match):
        connect(PAPER, Curious)


def test_arguments_can_be_written_into_the_scenario() -> None:
    scenario = load(PAPER, {"receiver.gate": 3.0, "platform.fmi": 2})
    changed = applied(scenario, choice_of(scenario, ["sequential", "ekf"], fmi=3))
    assert (changed.receiver.type, changed.receiver.gate) == ("sequential", 3.0)
    assert (changed.fmi, changed.platform.fmi) == (3, None)
    assert applied(scenario, choice_of(scenario, ["ekf", "sequential"])).receiver.gate is None
    assert applied(PAPER, choice_of(PAPER)).model_dump() == PAPER.model_dump()


def test_an_fmu_written_into_the_scenario_gets_the_parameters_that_it_got() -> None:
    fmu = build("sequential")
    scenario = load(PAPER, {"receiver.measurement_noise": "variance"})
    changed = applied(scenario, choice_of(scenario, fmu))
    assert (changed.receiver.type, changed.receiver.fmu) == (None, str(fmu))
    again = load(tomllib.loads(changed.dump_toml()))
    ours, theirs = connect(again).components, connect(scenario, fmu).components
    assert ours["sequential"] == theirs["sequential"]
    target = build("target")
    assert applied(PAPER, choice_of(PAPER, components={"target": target})).target.fmu == str(target)
    assert applied(PAPER, choice_of(PAPER, Deaf)).model_dump() == PAPER.model_dump()


@pytest.mark.parametrize(
    ("table", "kept"),
    [
        ({"type": "ekf", "parameters": {"gate": 2.5, "lag": 2.0}}, {"gate": 2.5}),
        ({"fmu": "ekf.fmu", "parameters": {"gate": 2.5}}, None),
    ],
    ids=["of ours", "of a file"],
)
def test_an_fmu_gets_further_parameters_of_a_receiver_of_ours_only(table: Any, kept: Any) -> None:
    """Those that it has, though another beside it has more, and none that were for another file."""
    fmu, other = build("sequential"), build("fixed_lag")
    if "fmu" in table:
        table = {**table, "fmu": str(build("ekf"))}
    scenario = load({**PAPER.given(), "receiver": table})
    changed = applied(scenario, choice_of(scenario, [fmu, other]))
    assert (changed.receiver.fmu, changed.receiver.parameters) == (str(fmu), kept)
    ours, theirs = connect(changed).components, connect(scenario, [fmu, other]).components
    assert ours["sequential"] == theirs["sequential"]
    assert ours["sequential"].parameters.get("gate") == (kept or {}).get("gate")


@pytest.mark.parametrize(
    ("components", "message"),
    [
        (5, "components: must be a mapping with target, platform, acoustics, got 5"),
        ({"target": 5}, "target: must be a class or function that makes the component, got 5"),
        ({"target": Bare}, "target: must make a component, got Bare, whose object has no variables "
                           "and no initialise and no do_step; see sblcosim.Receiver and "
                           "sblcosim.PythonComponent"),
    ],
)  # fmt: skip
def test_a_replacement_that_is_no_component_is_refused(components: Any, message: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        connect(PAPER, components=components)
    assert str(caught.value) == message


def test_a_key_that_only_a_chosen_file_has_is_accepted() -> None:
    scenario = load(PAPER, {"receiver.gate": 3.0})
    system = connect(scenario, ["ekf", build("sequential")])
    assert system.components["sequential"].parameters["gate"] == 3.0


def test_a_path_at_rest_has_no_end() -> None:
    def refusal(changes: dict[str, Any]) -> str:
        with pytest.raises(ConfigurationError) as caught:
            connect(load("harbour-square", changes))
        return str(caught.value)

    still = {"target.speed_m_s": 0.0, "target.depth_end_m": None}
    assert refusal(still) == (
        "override target.speed_m_s: must be more than 0 for a run until the end of the path "
        "([time] duration_s is 'path'), got 0.0"
    )
    drawn = {"target.trajectory": "white_noise_acceleration"}
    assert "[time] duration_s: must be a number" in refusal(still | drawn)
    assert connect(load("harbour-square", still | {"time.duration_s": 5.0})).stop_ns == 5 * 10**9


def test_a_run_shorter_than_an_interval_is_a_matter_of_the_key() -> None:
    with pytest.raises(ConfigurationError) as caught:
        connect(load("realistic-dive", {"time.duration_s": 0.05}))
    assert str(caught.value) == (
        "override time.duration_s: must be at least 1 s, the least common multiple of all "
        "intervals, got 0.05"
    )
    assert connect(load("realistic-dive", {"time.duration_s": 1.0})).stop_ns == 10**9
    with pytest.raises(ConfigurationError) as caught:
        connect(load("harbour-square", {"time.sampling_time_s": 1000.0}))
    assert re.fullmatch(
        r"harbour-square: \[time\] duration_s: must be at least 1000 s, the least common multiple "
        r"of all intervals, got 'path', which takes \d{3}\.?\d* s", str(caught.value)
    )


def test_a_path_without_length_has_no_end() -> None:
    twice = {"target.trajectory": "waypoints", "target.waypoint_m": [[3.0, 4.0, 5.0]] * 2}
    with pytest.raises(ConfigurationError) as caught:
        connect(load("harbour-square", twice))
    assert str(caught.value) == (
        "harbour-square: [time] duration_s: must be a number for a target that does not state when "
        "its path ends, or whose path has no length, got 'path'"
    )
    assert connect(load("harbour-square", twice | {"time.duration_s": 5.0})).stop_ns == 5 * 10**9
