"""A scenario as one file for other tools: an SSP package, or a single FMU.

What is in a package is what other tools take (tried with FMPy, libcosim, ecos, OMSimulator and
fmucontainer): connections from component to component only, one parameter set per component with
the short names of its variables, all FMUs inside, names that are identifiers, and the step sizes as
annotations: for the Open Simulation Platform that of the experiment, for OMSimulator the first of
the system, as it reads no other and takes none of a component. The components' own intervals are in
the system's second. Connectors and units are those of the FMUs' model descriptions.

Some tools do not look at parameter sets. For them the FMUs can be *baked*: built with the
scenario's numbers as start values. A baked package has no parameter sets: that shows what it is.
"""

from __future__ import annotations

import math
import re
import tempfile
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal, cast, get_args
from xml.etree import ElementTree as ET

from fmpy.model_description import ModelDescription, ModelVariable, Unit
from sblcosim.fmus.build.archive import write_fmu
from sblcosim.fmus.build.description import PACKAGE
from sblcosim.fmus.build.factory import build
from sblcosim.fmus.files import scratch, write_file
from sblcosim.fmus.host.nanoseconds import SECOND
from sblcosim.fmus.read.archive import opened
from sblcosim.fmus.read.description import describe
from sblcosim.fmus.read.ports import Fmu, Port
from sblcosim.models import COMPONENTS
from sblcosim.models.declaration import Number

from ..errors import ConfigurationError, check_choice
from ..scenario.overrides import Overrides
from ..scenario.scenario import Receivers, Scenario, Source, load
from ..scenario.wiring import RAW, connect
from ..simulation.plan import Plan, PlannedComponent
from ..simulation.resolve import resolve
from ..simulation.system import System

Version = Literal[1, 2]
"""Major version of the SSP standard."""

PARAMETER_SET = "scenario"
"""Name of every parameter set: tools apply the sets of one name."""
TOOLBOX = "fmu-manipulation-toolbox"

_NAMESPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
    "sblcosim": "urn:org.sblcosim",
}


@dataclass(frozen=True, slots=True)
class _Part:
    """A component of the package: its name there, what was planned, its FMU, its description."""

    name: str
    planned: PlannedComponent
    fmu: Path
    description: ModelDescription


def export_ssp(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    path: str | Path | None = None,
    receiver: Receivers = (),
    overrides: Overrides = (),
    *,
    components: Mapping[str, Source] | None = None,
    version: Version = 1,
    bake: bool = False,
) -> Path:
    """Write a scenario as an SSP package.

    Parameters
    ----------
    path
        The file; None: ``NAME.ssp`` in the current folder. A file that is there is replaced.
    scenario, receiver, overrides, components
        As in `sblcosim.run`. The raw fix is left out unless it is asked for.
    version
        1: SSP 1.0, FMI 2, scalars. 2: SSP 2.0, FMI 3, arrays.
    bake
        Build the FMUs with the scenario's numbers as start values, for tools that do not look at
        parameter sets; there are none in the package then. Needs a C compiler.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ConfigurationError
        Something in the scenario or the arguments is wrong, or the scenario cannot be exported: a
        component in Python, an FMU of the wrong version, a foreign FMU to be baked. Nothing is
        written then.
    FmuError
        An FMU cannot be built or read.
    """
    check_choice("version", version, get_args(Version))
    settled = load(scenario, overrides)
    plan = _plan(settled, receiver, components, version + 1, f"SSP {version}.0")
    parts = _parts(plan, bake)
    document = ET.Element(
        "ssd:SystemStructureDescription",
        {
            **{f"xmlns:{prefix}": uri for prefix, uri in _NAMESPACES.items()},
            "name": _identifier(settled.name),
            "version": f"{version}.0",
            "generationTool": PACKAGE,
        },
    )
    if settled.title:
        document.set("description", settled.title)
    sets = {part.name for part in parts if part.planned.settings and not bake}
    units = _units(parts)
    _system(document, plan, parts, units, version, sets)
    if units:
        group = ET.SubElement(document, "ssd:Units")
        for name, unit in units.items():
            element = ET.SubElement(group, "ssc:Unit", {"name": name})
            ET.SubElement(element, "ssc:BaseUnit", _base(unit))
    _experiment(document, plan)
    files = {"SystemStructure.ssd": _document(document)}
    for part in parts:
        files[f"resources/{part.name}.fmu"] = part.fmu.read_bytes()
        if part.name in sets:
            files[f"resources/{part.name}.ssv"] = _document(_parameter_set(part, version))
    return _written(Path(path or f"{settled.name}.ssp"), lambda file: write_fmu(file, files))


def export_fmu(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    path: str | Path | None = None,
    receiver: Receivers = (),
    overrides: Overrides = (),
    *,
    components: Mapping[str, Source] | None = None,
) -> Path:
    """Write a scenario as a single FMU (FMI 2) that holds all others.

    Its variables are the outputs of the components, ``component.variable`` (local ones where they
    are connected inside); it has no inputs and no parameters: the FMUs inside are baked.

    Parameters
    ----------
    path
        The file; None: ``NAME.fmu`` in the current folder. A file that is there is replaced.
    scenario, receiver, overrides, components
        As in `export_ssp`.

    Raises
    ------
    ConfigurationError
        As `export_ssp`; or the package ``fmu-manipulation-toolbox`` is not installed.
    FmuError
        An FMU cannot be built or read.
    """
    if find_spec("fmu_manipulation_toolbox") is None:
        raise ConfigurationError(
            f"export fmu: must have the package {TOOLBOX}, got none; pip install {TOOLBOX}"
        )
    from fmu_manipulation_toolbox.assembly import Assembly, AssemblyError, AssemblyNode
    from fmu_manipulation_toolbox.container import FMUContainerError

    settled = load(scenario, overrides)
    plan = _plan(settled, receiver, components, 2, "a single FMU")
    parts = _parts(plan, bake=True)
    links = list(_links(plan))
    linked = {source for source, _ in links}
    with tempfile.TemporaryDirectory(dir=scratch()) as name:
        folder = Path(name)
        # The name of the file becomes an identifier in C.
        whole = AssemblyNode(
            re.sub(r"\W", "_", settled.name) + ".fmu",
            step_size=_step(plan) / SECOND,
            auto_link=False,
            auto_input=False,
            auto_output=False,
        )
        for part in parts:
            (folder / f"{part.name}.fmu").write_bytes(part.fmu.read_bytes())
            whole.add_fmu(f"{part.name}.fmu")
            for variable in _outputs(part):
                if (part.name, variable.name) in linked:
                    continue  # it becomes a local variable of the same name
                whole.add_output(f"{part.name}.fmu", variable.name, f"{part.name}.{variable.name}")
        for (source, output), (target, input_) in links:
            whole.add_link(f"{source}.fmu", output, f"{target}.fmu", input_)
        assembly = Assembly(fmu_directory=folder)
        assembly.root = whole
        try:
            assembly.make_fmu()
        except (AssemblyError, FMUContainerError) as error:
            raise ConfigurationError(
                f"export fmu: {TOOLBOX} must take all components, got: {error.reason}"
            ) from error
        content = (folder / whole.name).read_bytes()
    return _written(Path(path or f"{settled.name}.fmu"), lambda file: write_file(file, content))


def _plan(
    scenario: Scenario,
    receiver: Receivers,
    components: Mapping[str, Source] | None,
    fmi: int,
    what: str,
) -> Plan:
    """What is to be exported, known to consist of FMUs of one version."""
    plan = resolve(_without_raw(connect(scenario, receiver, fmi, components), receiver))
    for component in plan.components:
        if not isinstance(component.source, Fmu):
            raise ConfigurationError(
                f"{component.name}: must be an FMU to be exported, got the Python component "
                f"{component.origin}"
            )
        if component.source.fmi != fmi:
            raise ConfigurationError(
                f"{component.name}: must be FMI {fmi} for {what}, got FMI {component.source.fmi} "
                f"({component.source.path})"
            )
    return plan


def _without_raw(system: System, receiver: Receivers) -> System:
    """The system without the raw fix that runs along for comparison."""
    if isinstance(receiver, Mapping) and RAW in receiver:
        return system
    return replace(
        system,
        components={name: spec for name, spec in system.components.items() if name != RAW},
        connections=tuple(c for c in system.connections if not c.target.startswith(f"{RAW}.")),
    )


def _parts(plan: Plan, bake: bool) -> list[_Part]:
    parts = []
    names = _names(plan)
    for component in plan.components:
        source = cast(Fmu, component.source)
        path = _baked(component, source, plan) if bake else source.path
        with opened(path) as archive:
            parts.append(_Part(names[component.name], component, path, describe(archive)))
    return parts


def _identifier(name: str, taken: Collection[str] = ()) -> str:
    """A name as OMSimulator asks for it: ASCII letters, digits and _, a letter first."""
    stem = re.sub(r"[^A-Za-z0-9_]", "_", name)
    stem = found = stem if stem[0].isalpha() else f"x{stem}"
    number = 2
    while found in taken:
        found = f"{stem}_{number}"
        number += 1
    return found


def _names(plan: Plan) -> dict[str, str]:
    """The name of each component in a package; those that may stay as they are do."""
    names = {c.name: c.name for c in plan.components if _identifier(c.name) == c.name}
    for component in plan.components:
        if component.name not in names:
            names[component.name] = _identifier(component.name, names.values())
    return names


def _baked(component: PlannedComponent, source: Fmu, plan: Plan) -> Path:
    """The FMU with the scenario's numbers as start values; one of somebody else must have them."""
    name, fmi = source.path.stem, cast(Literal[2, 3], source.fmi)
    if name not in COMPONENTS or source.path != build(name, fmi):
        for setting in component.settings:
            if setting.port.start != setting.values:
                raise ConfigurationError(
                    f"{component.name}: cannot be baked, as it is somebody else's FMU; its "
                    f"{setting.port.name} must start as {_words(setting.port, setting.values)}, "
                    f"got {_words(setting.port, setting.port.start or ())}"
                )
        return source.path
    values = {s.port.name: s.values for s in component.settings}
    declared = COMPONENTS[name]
    return build(
        name,
        fmi,
        baked=replace(
            declared,
            variables=tuple(
                replace(v, start=values[v.name] if v.shape else values[v.name][0])
                if v.name in values
                else v
                for v in declared
            ),
            step_size=_step(plan) / SECOND,  # also of a receiver that needs fewer: tools use one
            stop_time=plan.stop_ns / SECOND,
        ),
    )


def _links(plan: Plan) -> Iterator[tuple[tuple[str, str], tuple[str, str]]]:
    """(component, variable) at both ends of every connection, variable by variable of the FMUs."""
    names = _names(plan)
    by_name = {c.name: c for c in plan.components}
    for target in plan.components:
        for write in target.writes:
            for port, connection in zip(write.ports, write.connections, strict=True):
                source, _, variable = connection.source.partition(".")
                outputs = by_name[source].ports[variable].variables
                if len(outputs) != len(port.variables):
                    raise ConfigurationError(
                        f"{connection.target}: must be an array of FMI 3 to be exported, got "
                        f"{len(port.variables)} scalars"
                    )
                for output, input_ in zip(outputs, port.variables, strict=True):
                    yield (names[source], output), (names[target.name], input_)


def _step(plan: Plan) -> int:
    """The longest step in ns that divides all communication intervals."""
    return math.gcd(*(c.interval_ns for c in plan.components))


def _outputs(part: _Part) -> list[ModelVariable]:
    """The numbers and switches among the outputs: libcosim, for one, drops enumerations."""
    return [
        v
        for v in part.description.modelVariables
        if v.causality == "output" and v.type not in ("Enumeration", "String", "Binary", "Clock")
    ]


def _connectors(part: _Part, connected: set[tuple[str, str]]) -> list[ModelVariable]:
    """Connected inputs, then outputs: FMPy mistakes the source of an input without connection."""
    inputs = [v for v in part.description.modelVariables if (part.name, v.name) in connected]
    return [*inputs, *_outputs(part)]


# --- The system structure description -------------------------------------------------------------


def _system(
    document: ET.Element,
    plan: Plan,
    parts: list[_Part],
    units: Mapping[str, Unit],
    version: Version,
    sets: Collection[str],
) -> None:
    system = ET.SubElement(document, "ssd:System", {"name": "system"})
    elements = ET.SubElement(system, "ssd:Elements")
    links = list(_links(plan))
    connected = {target for _, target in links}
    for part in parts:
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
        connectors = ET.SubElement(component, "ssd:Connectors")
        for variable in _connectors(part, connected):
            _connector(connectors, variable, part, units, version)
        if part.name in sets:
            bindings = ET.SubElement(component, "ssd:ParameterBindings")
            ET.SubElement(
                bindings, "ssd:ParameterBinding", {"source": f"resources/{part.name}.ssv"}
            )
    connections = ET.SubElement(system, "ssd:Connections")
    for (source, output), (target, input_) in links:
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
            "stepSize": _seconds(_step(plan)),
            "absoluteTolerance": "0.0001",
            "relativeTolerance": "0.0001",
        },
    )
    intervals = ET.SubElement(_annotation(annotations, "org.sblcosim"), "sblcosim:Intervals")
    for part in parts:
        seconds = _seconds(part.planned.interval_ns)
        ET.SubElement(intervals, "sblcosim:Interval", {"component": part.name, "seconds": seconds})


def _connector(
    parent: ET.Element,
    variable: ModelVariable,
    part: _Part,
    units: Mapping[str, Unit],
    version: Version,
) -> None:
    connector = ET.SubElement(
        parent, "ssd:Connector", {"name": variable.name, "kind": variable.causality}
    )
    kind = ET.SubElement(connector, f"ssc:{_type(variable, version)}")
    unit = _unit(variable)
    # A name that stands for something else in another FMU is left to the model description.
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
        {"baseStepSize": _seconds(_step(plan))},
    )


def _parameter_set(part: _Part, version: Version) -> ET.Element:
    root = ET.Element(
        "ssv:ParameterSet",
        {
            **{f"xmlns:{prefix}": _NAMESPACES[prefix] for prefix in ("ssv", "ssc")},
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
                {"value": _words(setting.port, values)},
            )
    return root


def _type(variable: ModelVariable, version: Version) -> str:
    """A variable's type; in place of an enumeration that of its numbers."""
    if variable.type == "Enumeration":
        return "Integer" if version == 1 else "Int64"
    return str(variable.type)


def _annotation(group: ET.Element, kind: str) -> ET.Element:
    return ET.SubElement(group, "ssc:Annotation", {"type": kind})


def _units(parts: list[_Part]) -> dict[str, Unit]:
    """Definition of every unit that a connector has, the first one if there are several."""
    units: dict[str, Unit] = {}
    for part in parts:
        used = {_unit(v) for v in part.description.modelVariables}
        for name, unit in _defined(part).items():
            if name in used:
                units.setdefault(name, unit)
    return units


def _defined(part: _Part) -> dict[str, Unit]:
    return {unit.name: unit for unit in part.description.unitDefinitions}


def _unit(variable: ModelVariable) -> str | None:
    return variable.unit or getattr(variable.declaredType, "unit", None)


def _base(unit: Unit) -> dict[str, str]:
    """Exponents, factor and offset of a unit, as far as they are not the defaults."""
    exponents = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
    defaults = {**dict.fromkeys(exponents, 0), "factor": 1.0, "offset": 0.0}
    given = {key: getattr(unit.baseUnit, key, default) for key, default in defaults.items()}
    return {key: str(value) for key, value in given.items() if value != defaults[key]}


def _words(port: Port, values: tuple[Number, ...]) -> str:
    """Values as XML has them; reading a number gives the same number."""
    if port.type == "Boolean":
        return " ".join("true" if value else "false" for value in values)
    return " ".join(map(repr, values))


def _seconds(time_ns: int) -> str:
    return repr(time_ns / SECOND)


def _document(root: ET.Element) -> bytes:
    ET.indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root) + b"\n"


def _written(path: Path, write: Callable[[Path], None]) -> Path:
    try:
        write(path)
    except OSError as error:
        raise ConfigurationError(f"{path}: must be writable, got {error.strerror}") from None
    return path
