"""The XML files of an FMU, generated from a component's declaration."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from importlib import metadata
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from sblcosim.models.declaration import UNITS, Component, Number, Variable

from ..standard import FMI2_TYPES, Fmi
from ..terminals import TERMINAL_KIND

if TYPE_CHECKING:
    from sblcosim.models.equations import Model

PACKAGE = "sblcosim"

LOG_CATEGORIES: Mapping[str, str] = {
    "logStatusError": "A call that failed",
    "logStatusWarning": "A call that succeeded, with a remark",
    "logStatusDiscard": "A call that was refused; the state is unchanged",
}

_POWER = re.compile(r"(kg|mol|cd|rad|Hz|m|s|A|K)([2-9]?)")


def base_unit(name: str) -> dict[str, int]:
    """Exponents of the SI base units of a unit, from its name.

    Parameters
    ----------
    name
        Powers of ``kg``, ``m``, ``s``, ``A``, ``K``, ``mol``, ``cd``, ``rad`` or ``Hz``, such as
        ``s3``, with dots between them; then perhaps a slash and more of them: ``"m2/s3"``.

    Returns
    -------
    dict
        FMI's attributes of a BaseUnit, without those that are 0.

    Raises
    ------
    ValueError
        The name is not of this form.
    """
    exponents: dict[str, int] = {}
    above, slash, below = name.partition("/")
    for sign, factors in ((1, above), (-1, below)) if slash else ((1, above),):
        for factor in factors.split("."):
            power = _POWER.fullmatch(factor)
            if power is None:
                raise ValueError(f"unit: must be powers of SI units such as m2/s3, got {name!r}")
            base, sense = ("s", -sign) if power[1] == "Hz" else (power[1], sign)
            exponents[base] = exponents.get(base, 0) + sense * int(power[2] or 1)
    return {base: n for base, n in exponents.items() if n}


def value_references(component: Component) -> Mapping[str, int]:
    """Value reference of the first element of each variable.

    The elements of all variables are numbered 1, 2, 3, … in the order of declaration, arrays row by
    row. In FMI 2 the number of an element is its value reference. In FMI 3 the number of an array's
    first element is the reference of the array. 0 is the independent variable.
    """
    references: dict[str, int] = {}
    following = 1
    for variable in component:
        references[variable.name] = following
        following += variable.size
    return references


def model_description(
    model: Model, fmi: Fmi, token: str, sources: Sequence[str], copyright_: str | None = None
) -> bytes:
    """Return modelDescription.xml.

    It carries no date, so that equal inputs give equal bytes.

    Parameters
    ----------
    token
        FMI 2 ``guid``, FMI 3 ``instantiationToken``.
    sources
        Names of the C files to compile, relative to the folder ``sources``.
    copyright_
        Copyright holder; None: not stated.
    """
    component = model.component
    pairs = _feedthrough(model, fmi)
    root = _root(component, fmi, token)
    if copyright_ is not None:
        root.set("copyright", copyright_)
    _interface(root, component, fmi, sources, derivatives=bool(pairs))
    _units(root, component, fmi)
    categories = ET.SubElement(root, "LogCategories")
    for name, description in LOG_CATEGORIES.items():
        ET.SubElement(categories, "Category", {"name": name, "description": description})
    ET.SubElement(
        root,
        "DefaultExperiment",
        {
            "startTime": "0.0",
            "stopTime": repr(float(component.stop_time)),
            "stepSize": repr(float(component.step_size)),
        },
    )
    _variables(root, component, fmi)
    _structure(root, component, fmi, pairs)
    return _document(root)


def terminals(model: Model, fmi: Fmi) -> bytes | None:
    """Return terminalsAndIcons/terminalsAndIcons.xml, or None for a component without terminals.

    In FMI 2 each element of an array is a separate member. In both cases, the version in the file
    is that of the standard that defines the file, FMI 3.0.
    """
    component = model.component
    if not component.terminals:
        return None
    root = ET.Element("fmiTerminalsAndIcons", {"fmiVersion": "3.0"})
    group = ET.SubElement(root, "Terminals")
    for terminal in component.terminals:
        element = ET.SubElement(
            group,
            "Terminal",
            {
                "name": terminal.name,
                "matchingRule": "plug",
                "terminalKind": TERMINAL_KIND + terminal.kind,
                "description": terminal.description,
            },
        )
        for name, member in terminal.members.items():
            for scalar in component[name].elements if fmi == 2 else (name,):
                ET.SubElement(
                    element,
                    "TerminalMemberVariable",
                    {
                        "variableName": scalar,
                        "memberName": member + scalar.removeprefix(name),
                        "variableKind": "signal",
                    },
                )
    return _document(root)


def build_description(
    component: Component, sources: Sequence[str], options: Sequence[str] = ("-ffp-contract=off",)
) -> bytes:
    """Return sources/buildDescription.xml, the recipe for compiling the sources elsewhere.

    FMI 3 defines the file; FMI 2 uses it unchanged.

    Parameters
    ----------
    sources
        Names of the C files to compile, relative to the folder ``sources``.
    options
        Compiler options without which the numbers would differ.
    """
    root = ET.Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    configuration = ET.SubElement(root, "BuildConfiguration", {"modelIdentifier": component.name})
    files = ET.SubElement(
        configuration,
        "SourceFileSet",
        {
            "language": "C11",
            "compiler": "gcc",
            "compilerOptions": " ".join(options),
        },
    )
    for name in sources:
        ET.SubElement(files, "SourceFile", {"name": name})
    return _document(root)


def _feedthrough(model: Model, fmi: Fmi) -> set[tuple[int, int]]:
    """Pairs of value references (output, input on which it depends within the same instant)."""
    component = model.component
    owners = [
        reference + i if fmi == 2 else reference
        for variable, reference in zip(component, value_references(component).values(), strict=True)
        for i in range(variable.size)
    ]
    inputs = sum(v.size for v in component.of("parameter"))
    outputs = inputs + sum(v.size for v in component.of("input"))
    return {
        (owners[outputs + row], owners[inputs + column])
        for functions in model.variants.values()
        for row, column in zip(*functions.output.jac_sparsity(0, 1).get_triplet(), strict=True)
    }


def _root(component: Component, fmi: Fmi, token: str) -> ET.Element:
    about = metadata.metadata(PACKAGE)
    return ET.Element(
        "fmiModelDescription",
        {
            "fmiVersion": f"{fmi}.0",
            "modelName": component.name,
            "guid" if fmi == 2 else "instantiationToken": token,
            "description": component.description,
            "author": about["Author"],
            "version": about["Version"],
            "license": about["License-Expression"],
            "generationTool": f"{PACKAGE} {about['Version']}",
            "variableNamingConvention": "structured",
        },
    )


def _interface(
    root: ET.Element, component: Component, fmi: Fmi, sources: Sequence[str], derivatives: bool
) -> None:
    flags: dict[str, bool] = {
        "needsExecutionTool": False,
        "canBeInstantiatedOnlyOncePerProcess": False,
        "canHandleVariableCommunicationStepSize": True,
    }
    if fmi == 2:
        flags |= {
            "canInterpolateInputs": False,
            "canRunAsynchronuously": False,
            "canNotUseMemoryManagementFunctions": True,
            "canGetAndSetFMUstate": True,
            "canSerializeFMUstate": True,
            "providesDirectionalDerivative": derivatives,
        }
    else:
        flags |= {
            "canGetAndSetFMUState": True,
            "canSerializeFMUState": True,
            "providesDirectionalDerivatives": derivatives,
            "providesAdjointDerivatives": False,
            "providesPerElementDependencies": False,
            "providesIntermediateUpdate": False,
            "mightReturnEarlyFromDoStep": False,
            "canReturnEarlyAfterIntermediateUpdate": False,
            "hasEventMode": False,
            "providesEvaluateDiscreteStates": False,
        }
    interface = ET.SubElement(
        root,
        "CoSimulation",
        {
            "modelIdentifier": component.name,
            **{name: _boolean(value) for name, value in flags.items()},
            "maxOutputDerivativeOrder": "0",
        },
    )
    if fmi == 2 and sources:
        files = ET.SubElement(interface, "SourceFiles")
        for name in sources:
            ET.SubElement(files, "File", {"name": name})


def _units(root: ET.Element, component: Component, fmi: Fmi) -> None:
    used = {v.unit for v in component} | ({"s"} if fmi == 3 else set())
    units = [unit for unit in UNITS.values() if unit.name in used]
    if not units:
        return
    definitions = ET.SubElement(root, "UnitDefinitions")
    for unit in units:
        element = ET.SubElement(definitions, "Unit", {"name": unit.name})
        exponents = base_unit(unit.name)
        ET.SubElement(element, "BaseUnit", {k: str(n) for k, n in exponents.items()})
        shown = _display_unit(unit.name)
        if shown is not None:
            ET.SubElement(
                element,
                "DisplayUnit",
                {
                    "name": shown,
                    "factor": repr(math.degrees(1.0) ** exponents["rad"]),
                },
            )


def _display_unit(name: str) -> str | None:
    """Angles are shown in degrees."""
    return name.replace("rad", "deg") if "rad" in base_unit(name) else None


def _attributes(variable: Variable, name: str, reference: int) -> dict[str, str]:
    """Attributes that both versions put next to the name."""
    attributes = {
        "name": name,
        "valueReference": str(reference),
        "description": variable.legend,
        "causality": variable.causality,
        "variability": str(variable.variability),
    }
    if variable.causality != "input":
        attributes["initial"] = "exact" if variable.causality == "parameter" else "calculated"
    return attributes


def _type_attributes(variable: Variable, starts: Iterable[Number]) -> dict[str, str]:
    """Attributes that both versions put next to the type."""
    attributes: dict[str, str] = {}
    if variable.unit is not None:
        attributes["unit"] = variable.unit
        shown = _display_unit(variable.unit)
        if shown is not None:
            attributes["displayUnit"] = shown
    if variable.min is not None:
        attributes["min"] = literal(variable, variable.min)
    if variable.max is not None:
        attributes["max"] = literal(variable, variable.max)
    if variable.causality != "output":
        attributes["start"] = " ".join(literal(variable, value) for value in starts)
    return attributes


def _variables(root: ET.Element, component: Component, fmi: Fmi) -> None:
    """Add all variables; FMI 3 requires the time to be one of them."""
    variables = ET.SubElement(root, "ModelVariables")
    if fmi == 3:
        ET.SubElement(
            variables,
            "Float64",
            {
                "name": "time",
                "valueReference": "0",
                "description": "Simulation time",
                "causality": "independent",
                "variability": "continuous",
                "unit": "s",
            },
        )
    references = value_references(component)
    for variable in component:
        add = _scalars if fmi == 2 else _variable
        add(variables, variable, references[variable.name])


def _scalars(parent: ET.Element, variable: Variable, reference: int) -> None:
    """Add a variable to an FMI 2 description, element by element."""
    for i, (name, start) in enumerate(zip(variable.elements, variable.starts, strict=True)):
        scalar = ET.SubElement(parent, "ScalarVariable", _attributes(variable, name, reference + i))
        ET.SubElement(scalar, FMI2_TYPES[variable.type], _type_attributes(variable, (start,)))


def _variable(parent: ET.Element, variable: Variable, reference: int) -> None:
    """Add a variable to an FMI 3 description."""
    element = ET.SubElement(
        parent,
        variable.type,
        {
            **_attributes(variable, variable.name, reference),
            **_type_attributes(variable, variable.starts),
        },
    )
    for size in variable.shape:
        ET.SubElement(element, "Dimension", {"start": str(size)})


def _structure(
    root: ET.Element, component: Component, fmi: Fmi, pairs: set[tuple[int, int]]
) -> None:
    """Add the dependencies of the outputs: at any time, and at initialisation."""
    references = value_references(component)

    def unknowns(variables: Iterable[Variable]) -> list[int]:
        return [references[v.name] + i for v in variables for i in range(v.size if fmi == 2 else 1)]

    structure = ET.SubElement(root, "ModelStructure")
    parameters = unknowns(component.of("parameter"))
    inputs = {
        output: sorted(known for unknown, known in pairs if unknown == output)
        for output in unknowns(component.of("output"))
    }

    for group, name, others in (
        ("Outputs", "Output", []),
        ("InitialUnknowns", "InitialUnknown", parameters),
    ):
        parent = ET.SubElement(structure, group) if fmi == 2 else structure
        for output, known in inputs.items():
            dependencies = [*others, *known]
            # In FMI 2 the index counts variables from 1, which makes it equal to the value
            # reference.
            unknown = ET.SubElement(
                parent,
                "Unknown" if fmi == 2 else name,
                {
                    "index" if fmi == 2 else "valueReference": str(output),
                    "dependencies": " ".join(map(str, dependencies)),
                },
            )
            if known:
                unknown.set("dependenciesKind", " ".join("dependent" for _ in dependencies))


def literal(variable: Variable, value: Number) -> str:
    """Write a value of a variable so that reading it gives the same value."""
    match variable.type:
        case "Float64":
            return repr(float(value))
        case "Int32":
            return str(int(value))
        case "Boolean":
            return _boolean(bool(value))


def _boolean(value: bool) -> str:
    return "true" if value else "false"


def _document(root: ET.Element) -> bytes:
    ET.indent(root)
    text = ET.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()
