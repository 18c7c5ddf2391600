"""The XML files say what the declaration says, validly."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, get_args

import fmpy
import pytest
from fmpy.validation import validate_fmu
from lxml import etree
from quick import one_in
from sblcosim.fmus.build.archive import contents, write_fmu
from sblcosim.fmus.build.description import (
    base_unit,
    build_description,
    model_description,
    terminals,
    value_references,
)
from sblcosim.fmus.standard import Fmi
from sblcosim.models import COMPONENTS, declaration
from sblcosim.models.declaration import UNITS, Component, Variable
from sblcosim.models.equations import Model
from sblcosim.models.loading import load
from seams import Seam

VERSIONS = get_args(Fmi)
SCHEMAS = Path(fmpy.__file__).parent / "schema" / "fmi3"


def model(component: Component) -> Model:
    """A model without equations: the XML takes only feedthrough from them."""
    return Model(component, variants={}, states={}, draws=(), advance=(), iterate=())


MODELS = {name: model(component) for name, component in COMPONENTS.items()} | {
    "range_model": load("range_model")
}


def described(tmp_path: Path, name: str, fmi: Fmi) -> fmpy.model_description.ModelDescription:
    path = tmp_path / f"{name}{fmi}.fmu"
    write_fmu(path, contents(MODELS[name], fmi, "{token}", {"model.c": b"", "model.h": b""}, {}))
    assert validate_fmu(str(path)) == []
    return fmpy.read_model_description(str(path))


def value(text: str, kind: str) -> float | int | bool:
    if kind == "Boolean":
        return {"true": True, "false": False}[text]
    return int(text) if kind in ("Integer", "Int32") else float(text)


@pytest.mark.parametrize("name", COMPONENTS)
def test_value_references_number_all_elements_from_one_without_gaps(name: str) -> None:
    component = COMPONENTS[name]
    references = value_references(component)
    taken = [references[v.name] + i for v in component for i in range(v.size)]
    assert taken == list(range(1, len(taken) + 1))


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("name", COMPONENTS)
@one_in(2)
def test_description_is_valid_and_copies_the_declaration_exactly(
    tmp_path: Path, name: str, fmi: Fmi
) -> None:
    description = described(tmp_path, name, fmi)
    variables = {v.name: v for v in description.modelVariables}
    time = variables.pop("time", None)
    assert (time is not None) == (fmi == 3)
    component = COMPONENTS[name]
    references = value_references(component)
    for declared in component:
        scalars = declared.elements if fmi == 2 else (declared.name,)
        starts: list[Any] = []
        for i, scalar in enumerate(scalars):
            found = variables.pop(scalar)
            assert found.valueReference == references[declared.name] + i
            assert found.type == {2: {"Float64": "Real", "Int32": "Integer"}, 3: {}}[fmi].get(
                declared.type, declared.type
            )
            assert found.shape == (() if fmi == 2 else declared.shape)
            assert (found.causality, found.variability, found.unit, found.description) == (
                declared.causality,
                declared.variability,
                declared.unit,
                declared.legend,
            )
            for bound in ("min", "max"):
                text = getattr(found, bound)
                parsed = None if text is None else value(text, found.type)
                assert parsed == getattr(declared, bound), (scalar, bound)
            if found.start is not None:
                starts += [value(text, found.type) for text in found.start.split()]
        assert tuple(starts) == (() if declared.causality == "output" else declared.starts)
    assert not variables


@pytest.mark.parametrize("name", COMPONENTS)
@one_in(2)
def test_both_versions_give_an_element_the_same_reference(tmp_path: Path, name: str) -> None:
    scalars = {v.name: v.valueReference for v in described(tmp_path, name, 2).modelVariables}
    for v in described(tmp_path, name, 3).modelVariables:
        if v.name == "time":
            assert v.valueReference == 0
            continue
        elements = COMPONENTS[name][v.name].elements
        assert [scalars[e] for e in elements] == list(
            range(v.valueReference, v.valueReference + len(elements))
        )


@pytest.mark.parametrize("fmi", VERSIONS)
def test_head_of_the_description_follows_the_declaration(tmp_path: Path, fmi: Fmi) -> None:
    component = COMPONENTS["ekf"]
    description = described(tmp_path, "ekf", fmi)
    assert description.modelName == component.name
    assert description.guid == "{token}"
    assert description.license == "MIT"
    assert description.generationDateAndTime is None
    assert float(description.defaultExperiment.stopTime) == component.stop_time
    assert float(description.defaultExperiment.stepSize) == component.step_size
    interface = description.coSimulation
    assert interface.modelIdentifier == component.name
    assert interface.canHandleVariableCommunicationStepSize
    assert interface.canGetAndSetFMUstate
    assert interface.canSerializeFMUstate
    assert not interface.hasEventMode
    (configuration,) = description.buildConfigurations
    assert configuration.modelIdentifier == component.name
    assert [f.sourceFiles for f in configuration.sourceFileSets] == [["model.c"]]


TRUE_UNITS = {
    "m": {"m": 1},
    "s": {"s": 1},
    "m/s": {"m": 1, "s": -1},
    "m2/s": {"m": 2, "s": -1},
    "m2/s3": {"m": 2, "s": -3},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "rad/K": {"rad": 1, "K": -1},
    "K": {"K": 1},
    "K/s": {"K": 1, "s": -1},
    "Hz": {"s": -1},
    "s/s": {},
}
"""Exponents of every unit there is, by hand."""


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("name", COMPONENTS)
def test_units_are_defined_by_their_true_exponents(tmp_path: Path, name: str, fmi: Fmi) -> None:
    found = {}
    for unit in etree.fromstring(model_description(MODELS[name], fmi, "", ())).iter("Unit"):
        (definition,) = unit.iter("BaseUnit")
        found[unit.get("name")] = {key: int(n) for key, n in definition.items()}
        for shown in unit.iter("DisplayUnit"):
            power = TRUE_UNITS[unit.get("name")]["rad"]
            assert float(shown.get("factor")) == math.degrees(1.0) ** power
    used = {v.unit for v in COMPONENTS[name]} - {None} | ({"s"} if fmi == 3 else set())
    assert found == {unit: TRUE_UNITS[unit] for unit in used}


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize(
    ("name", "shown", "factor"),
    [("rad2/s", "deg2/s", (180 / math.pi) ** 2), ("s/rad", "s/deg", math.pi / 180),
     ("m/rad3", "m/deg3", (math.pi / 180) ** 3)],
)  # fmt: skip
def test_any_power_of_an_angle_is_displayed_as_that_of_degrees(
    seam: Seam, name: str, shown: str, factor: float, fmi: Fmi
) -> None:
    seam.instead(UNITS, {**UNITS, name: declaration.Unit(name, "x")})
    variable = Variable("v", "A variable", "input", unit=name)
    document = model_description(model(Component("C", 1, "C", (variable,), None)), fmi, "", ())
    (unit,) = etree.fromstring(document).iter("DisplayUnit")
    assert unit.get("name") == shown
    assert float(unit.get("factor")) == pytest.approx(factor)


def test_every_unit_is_used_and_known_by_hand() -> None:
    used = {v.unit for component in COMPONENTS.values() for v in component} - {None}
    assert used == set(UNITS) == set(TRUE_UNITS)


@pytest.mark.parametrize(
    ("name", "exponents"),
    [
        *TRUE_UNITS.items(),
        ("kg.m2/s3.A", {"kg": 1, "m": 2, "s": -3, "A": -1}),
        ("m.m/s.s", {"m": 2, "s": -2}),
        ("m/Hz", {"m": 1, "s": 1}),
        ("cd.mol", {"cd": 1, "mol": 1}),
    ],
)
def test_a_units_name_gives_its_exponents(name: str, exponents: dict[str, int]) -> None:
    assert base_unit(name) == exponents


@pytest.mark.parametrize(
    "name", ["", "h", "m/h", "deg", "m//s", "m/s/s", "m/", "/s", "m1", "m-1", "m2.5", "m 2", "m^2"]
)
def test_an_unknown_unit_is_an_error(name: str) -> None:
    with pytest.raises(ValueError, match=r"^unit: must be powers of SI units .* got "):
        base_unit(name)
    with pytest.raises(ValueError, match=r"is not one of .* or None for a plain number"):
        Variable("x", "", "output", name)


@pytest.mark.parametrize("fmi", VERSIONS)
def test_angles_are_displayed_in_degrees(tmp_path: Path, fmi: Fmi) -> None:
    description = described(tmp_path, "platform", fmi)
    units = {u.name: u for u in description.unitDefinitions}
    assert units["rad/s"].baseUnit.rad == 1
    assert units["rad/s"].baseUnit.s == -1
    (shown,) = units["rad/s"].displayUnits
    assert shown.name == "deg/s"
    assert shown.factor == math.degrees(1)
    heading = next(v for v in description.modelVariables if v.name == "mean_heading")
    assert heading.displayUnit == "deg"


@pytest.mark.parametrize("fmi", VERSIONS)
def test_components_without_feedthrough_declare_empty_dependencies(
    tmp_path: Path, fmi: Fmi
) -> None:
    description = described(tmp_path, "acoustics", fmi)
    assert all(u.dependencies == [] for u in description.outputs)
    parameters = [v for v in description.modelVariables if v.causality == "parameter"]
    assert all(u.dependencies == parameters for u in description.initialUnknowns)
    assert b'providesDirectionalDerivative="true"' not in (
        model_description(MODELS["acoustics"], 2, "", ())
    )


def test_range_model_declares_what_each_range_depends_on(tmp_path: Path) -> None:
    outputs = described(tmp_path, "range_model", 2).outputs
    for i, unknown in enumerate(outputs, start=1):
        assert unknown.variable.name == f"range[{i}]"
        assert {v.name for v in unknown.dependencies} == (
            {f"position[{k}]" for k in (1, 2, 3)} | {f"beacon_position[{i},{k}]" for k in (1, 2, 3)}
        )
        assert unknown.dependenciesKind == ["dependent"] * 6
    (unknown,) = described(tmp_path, "range_model", 3).outputs
    assert [v.name for v in unknown.dependencies] == ["position", "beacon_position"]


@pytest.mark.parametrize("fmi", VERSIONS)
def test_directional_derivatives_are_claimed_for_the_range_model(fmi: Fmi) -> None:
    root = etree.fromstring(model_description(MODELS["range_model"], fmi, "", ()))
    flag = "providesDirectionalDerivative" + ("s" if fmi == 3 else "")
    assert root.find("CoSimulation").get(flag) == "true"


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("name", COMPONENTS)
def test_terminals_are_valid_and_name_variables_of_the_component(name: str, fmi: Fmi) -> None:
    document = terminals(MODELS[name], fmi)
    component = COMPONENTS[name]
    if not component.terminals:
        assert document is None
        return
    root = etree.fromstring(document)
    etree.XMLSchema(file=str(SCHEMAS / "fmi3TerminalsAndIcons.xsd")).assertValid(root)
    found = {t.get("name"): t for t in root.iterfind("Terminals/Terminal")}
    assert found.keys() == {t.name for t in component.terminals}
    for terminal in component.terminals:
        element = found[terminal.name]
        assert element.get("terminalKind") == f"org.sblcosim.{terminal.kind}"
        names = [m.get("variableName") for m in element]
        assert names == [
            name
            for member in terminal.members
            for name in (component[member].elements if fmi == 2 else (member,))
        ]
        assert names == [m.get("memberName") for m in element]


def test_every_component_has_its_terminals() -> None:
    def kinds(name: str) -> list[str]:
        return [terminal.kind for terminal in COMPONENTS[name].terminals]

    assert kinds("platform") == ["beacons", "reported_pose"]
    assert kinds("acoustics") == ["beacons", "reported_pose", "reception", "pose"]
    assert {name for name in COMPONENTS if not kinds(name)} == {"range_model"}


def test_plugs_of_acoustics_and_receivers_have_equal_members() -> None:
    def members(name: str) -> list[str | None]:
        root = etree.fromstring(terminals(MODELS[name], 3))
        (terminal,) = root.iterfind("Terminals/Terminal[@terminalKind='org.sblcosim.reception']")
        return [m.get("memberName") for m in terminal]

    assert members("acoustics") == members("ekf") == members("multilateration")


def test_build_description_is_valid_and_lists_the_sources() -> None:
    root = etree.fromstring(build_description(COMPONENTS["ekf"], ["a.c", "b.c"]))
    etree.XMLSchema(file=str(SCHEMAS / "fmi3BuildDescription.xsd")).assertValid(root)
    assert [e.get("name") for e in root.iter("SourceFile")] == ["a.c", "b.c"]
    (files,) = root.iter("SourceFileSet")
    assert files.get("language") == "C11"
    assert "-ffp-contract=off" in str(files.get("compilerOptions"))
