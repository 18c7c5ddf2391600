"""A scenario as an SSP package for other tools.

A package contains what other tools accept (tried with FMPy, libcosim, ecos, OMSimulator and
fmucontainer): only connections from component to component, one parameter set per component with
the short names of its variables, all FMUs, names that are identifiers, and the step sizes as
annotations. For the Open Simulation Platform the step is that of the experiment. For OMSimulator
it is the system's first annotation, because OMSimulator reads no other and none of a component.
The components' own intervals are in the system's second annotation. Connectors and units are those
of the FMUs' model descriptions.

Some tools ignore parameter sets. For them the FMUs can be *baked*: built with the scenario's
numbers as start values. A baked package has no parameter sets, which distinguishes it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, Literal, get_args
from xml.etree import ElementTree as ET

from fmpy.model_description import ModelVariable, Unit
from sblcosim.fmus.build.archive import write_fmu
from sblcosim.fmus.build.description import PACKAGE
from sblcosim.fmus.host.nanoseconds import SECOND
from sblcosim.fmus.stopping import interruptible

from ..artifacts import check_place
from ..errors import check_choice
from ..packages.structure import DESCRIPTION, NAMESPACES
from ..scenario.files import naming_files
from ..scenario.overrides import Changes
from ..scenario.scenario import Receivers, Scenario, Source, load
from ..simulation.plans.plan import Plan
from .parts import (
    ExportedPart,
    fmu_plan,
    identifier,
    links_of,
    outputs_of,
    parts_of,
    step_ns,
    words,
    written,
)

Version = Literal[1, 2]
"""Major version of the SSP standard."""

PARAMETER_SET = "scenario"
"""Name of every parameter set; tools apply the sets with one name."""


@interruptible
@naming_files
def export_ssp(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    path: str | Path | None = None,
    receiver: Receivers = (),
    overrides: Changes = (),
    *,
    components: Mapping[str, Source] | None = None,
    version: Version = 1,
    bake: bool = False,
) -> Path:
    """Write a scenario as an SSP package.

    Parameters
    ----------
    path
        Path of the file; None: ``NAME.ssp`` in the current folder, ``NAME-baked.ssp`` if it is
        baked. An existing file is replaced.
    scenario, receiver, overrides, components
        As in `sblcosim.run`. The raw fix is left out unless it is requested.
    version
        1: SSP 1.0, FMI 2, scalars. 2: SSP 2.0, FMI 3, arrays.
    bake
        Build the FMUs with the scenario's numbers as start values, for tools that ignore parameter
        sets. The package then has no parameter sets. Needs a C compiler.

    Returns
    -------
    Path
        Path of the file.

    Raises
    ------
    ConfigurationError
        Something in the scenario or the arguments is wrong, or the scenario cannot be exported: a
        component is in Python, an FMU has the wrong version, or a foreign FMU would be baked.
        Nothing is written then.
    FmuError
        An FMU cannot be built or read.
    """
    check_choice("version", version, get_args(Version))
    settled = load(scenario, overrides)
    target = Path(path or f"{settled.name}{'-baked' if bake else ''}.ssp")
    check_place(target.parent)
    plan = fmu_plan(settled, receiver, components, version + 1, f"SSP {version}.0")
    parts = parts_of(plan, bake)
    sets = {part.name for part in parts if part.planned.settings and not bake}
    files = {DESCRIPTION: _document(_structure(settled, plan, parts, version, sets))}
    for part in parts:
        files[f"resources/{part.name}.fmu"] = part.fmu.read_bytes()
        if part.name in sets:
            files[f"resources/{part.name}.ssv"] = _document(_parameter_set(part, version))
    return written(target, lambda file: write_fmu(file, files))


# --- The system structure description -------------------------------------------------------------


def _structure(
    scenario: Scenario,
    plan: Plan,
    parts: list[ExportedPart],
    version: Version,
    sets: Collection[str],
) -> ET.Element:
    """The description; `sets` are the names of the components that have a parameter set."""
    document = ET.Element(
        "ssd:SystemStructureDescription",
        {
            **{f"xmlns:{prefix}": uri for prefix, uri in NAMESPACES.items()},
            "name": identifier(scenario.name),
            "version": f"{version}.0",
            "generationTool": PACKAGE,
        },
    )
    if scenario.title:
        document.set("description", scenario.title)
    units = _units(parts)
    system = ET.SubElement(document, "ssd:System", {"name": "system"})
    elements = ET.SubElement(system, "ssd:Elements")
    connected = {target for _, target in links_of(plan)}
    for part in parts:
        component = _component(elements, part)
        connectors = ET.SubElement(component, "ssd:Connectors")
        for variable in _connectors(part, connected):
            _connector(connectors, variable, part, units, version)
        if part.name in sets:
            bindings = ET.SubElement(component, "ssd:ParameterBindings")
            ET.SubElement(
                bindings, "ssd:ParameterBinding", {"source": f"resources/{part.name}.ssv"}
            )
    _connections(system, plan)
    _steps(system, plan, parts)
    if units:
        group = ET.SubElement(document, "ssd:Units")
        for name, unit in units.items():
            element = ET.SubElement(group, "ssc:Unit", {"name": name})
            ET.SubElement(element, "ssc:BaseUnit", _base(unit))
    _experiment(document, plan)
    return document


def _component(elements: ET.Element, part: ExportedPart) -> ET.Element:
    component = ET.SubElement(
        elements,
        "ssd:Component",
        {
            "name": part.name,
            "type": "application/x-fmu-sharedlibrary",
            "source": f"resources/{part.name}.fmu",
            "implementation": "CoSimulation",
        },
    )
    if part.description.description:
        component.set("description", part.description.description)
    return component


def _connections(system: ET.Element, plan: Plan) -> None:
    connections = ET.SubElement(system, "ssd:Connections")
    for (source, output), (target, input_) in links_of(plan):
        ET.SubElement(
            connections,
            "ssd:Connection",
            {
                "startElement": source,
                "startConnector": output,
                "endElement": target,
                "endConnector": input_,
            },
        )


def _steps(system: ET.Element, plan: Plan, parts: list[ExportedPart]) -> None:
    """Annotations with the step of the system, for OMSimulator, and those of the components."""
    annotations = ET.SubElement(system, "ssd:Annotations")
    information = ET.SubElement(
        ET.SubElement(_annotation(annotations, "org.openmodelica"), "oms:Annotations"),
        "oms:SimulationInformation",
    )
    ET.SubElement(
        information,
        "oms:FixedStepMaster",
        {
            "description": "oms-ma",
            "stepSize": _seconds(step_ns(plan)),
            "absoluteTolerance": "0.0001",
            "relativeTolerance": "0.0001",
        },
    )
    intervals = ET.SubElement(_annotation(annotations, "org.sblcosim"), "sblcosim:Intervals")
    for part in parts:
        seconds = _seconds(part.planned.interval_ns)
        ET.SubElement(intervals, "sblcosim:Interval", {"component": part.name, "seconds": seconds})


def _connectors(part: ExportedPart, connected: set[tuple[str, str]]) -> list[ModelVariable]:
    """Connected inputs, then outputs: FMPy misreads the source of an unconnected input."""
    inputs = [v for v in part.description.modelVariables if (part.name, v.name) in connected]
    return [*inputs, *outputs_of(part)]


def _connector(
    parent: ET.Element,
    variable: ModelVariable,
    part: ExportedPart,
    units: Mapping[str, Unit],
    version: Version,
) -> None:
    connector = ET.SubElement(
        parent, "ssd:Connector", {"name": variable.name, "kind": variable.causality}
    )
    kind = ET.SubElement(connector, f"ssc:{_type(variable, version)}")
    unit = _unit(variable)
    # A unit name that has another meaning in another FMU is left to the model description.
    if unit is not None and _base(units[unit]) == _base(_defined(part)[unit]):
        kind.set("unit", unit)
    if version == 2:
        for size in variable.shape or ():
            ET.SubElement(connector, "ssc:Dimension", {"size": str(size)})


def _experiment(document: ET.Element, plan: Plan) -> None:
    experiment = ET.SubElement(
        document,
        "ssd:DefaultExperiment",
        {"startTime": _seconds(plan.start_ns), "stopTime": _seconds(plan.stop_ns)},
    )
    annotations = ET.SubElement(experiment, "ssd:Annotations")
    annotation = _annotation(annotations, "com.opensimulationplatform")
    ET.SubElement(
        ET.SubElement(annotation, "osp:Algorithm"),
        "osp:FixedStepAlgorithm",
        {"baseStepSize": _seconds(step_ns(plan))},
    )


def _parameter_set(part: ExportedPart, version: Version) -> ET.Element:
    root = ET.Element(
        "ssv:ParameterSet",
        {
            **{f"xmlns:{prefix}": NAMESPACES[prefix] for prefix in ("ssv", "ssc")},
            "version": f"{version}.0",
            "name": PARAMETER_SET,
        },
    )
    group = ET.SubElement(root, "ssv:Parameters")
    types = {v.name: _type(v, version) for v in part.description.modelVariables}
    for setting in part.planned.settings:
        names = setting.port.variables
        size = len(setting.values) // len(names)
        for i, name in enumerate(names):
            values = setting.values[i * size : (i + 1) * size]
            ET.SubElement(
                ET.SubElement(group, "ssv:Parameter", {"name": name}),
                f"ssv:{types[name]}",
                {"value": words(setting.port, values)},
            )
    return root


def _type(variable: ModelVariable, version: Version) -> str:
    """A variable's type; for an enumeration the type of its numbers."""
    if variable.type == "Enumeration":
        return "Integer" if version == 1 else "Int64"
    return str(variable.type)


def _annotation(group: ET.Element, kind: str) -> ET.Element:
    return ET.SubElement(group, "ssc:Annotation", {"type": kind})


def _units(parts: list[ExportedPart]) -> dict[str, Unit]:
    """Definition of every unit of a connector; the first one if there are several."""
    units: dict[str, Unit] = {}
    for part in parts:
        used = {_unit(v) for v in part.description.modelVariables}
        for name, unit in _defined(part).items():
            if name in used:
                units.setdefault(name, unit)
    return units


def _defined(part: ExportedPart) -> dict[str, Unit]:
    return {unit.name: unit for unit in part.description.unitDefinitions}


def _unit(variable: ModelVariable) -> str | None:
    return variable.unit or getattr(variable.declaredType, "unit", None)


def _base(unit: Unit) -> dict[str, str]:
    """Exponents, factor and offset of a unit that differ from the defaults."""
    exponents = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
    defaults = {**dict.fromkeys(exponents, 0), "factor": 1.0, "offset": 0.0}
    given = {key: getattr(unit.baseUnit, key, default) for key, default in defaults.items()}
    return {key: str(value) for key, value in given.items() if value != defaults[key]}


def _seconds(time_ns: int) -> str:
    return repr(time_ns / SECOND)


def _document(root: ET.Element) -> bytes:
    ET.indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root) + b"\n"
