"""The facts about an FMU that checks need, from its model description."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from fmpy.model_description import ModelDescription, ModelVariable

from ..build.factory import fmi_headers
from ..read.description import DESCRIPTION
from .subject import Number, Subject, SubjectVariable

_STEPS = 20
_STEP = 0.1
"""Communication interval in s if the FMU suggests none."""
_TOLERANCE = 1e-6


def subject_of(description: ModelDescription, folder: Path, library: str) -> Subject:
    """The facts about an unpacked FMU; ``library`` is its binary's name in the folder."""
    kind = description.coSimulation
    variables = [_variable(v, description) for v in description.modelVariables]
    indices = {id(v): i for i, v in enumerate(description.modelVariables)}
    experiment = description.defaultExperiment
    start = _number(experiment and experiment.startTime) or 0.0
    stop = _number(experiment and experiment.stopTime)
    internal = _size(kind.fixedInternalStepSize)
    step = _size(experiment and experiment.stepSize) or internal or _STEP
    whole = math.inf if stop is None else (stop - start) / step * (1 + 1e-9)
    serialises = kind.canGetAndSetFMUstate and kind.canSerializeFMUstate
    return Subject(
        fmi=description.fmiMajorVersion,
        version=description.fmiVersion,
        token=description.guid or "",
        library=str(folder / library),
        resources=str(folder / "resources"),
        functions=functions_of(description),
        once=kind.canBeInstantiatedOnlyOncePerProcess,
        tool=kind.needsExecutionTool,
        saves=kind.canGetAndSetFMUstate,
        serialises=serialises,
        variable_steps=kind.canHandleVariableCommunicationStepSize,
        derivatives=_derivatives(folder, description.fmiMajorVersion),
        start=start,
        step=step,
        steps=int(max(4, min(_STEPS, whole))),
        tolerance=_size(experiment and experiment.tolerance) or _TOLERANCE,
        internal_step=internal,
        variables=tuple(variables),
        dependencies=tuple(_dependencies(description, indices)),
    )


def functions_of(description: ModelDescription) -> tuple[str, ...]:
    """The functions that the standard's header declares for the FMU's kinds of interface."""
    fmi = description.fmiMajorVersion
    text = (fmi_headers() / f"fmi{fmi}Functions.h").read_text()
    offered = {
        "Model Exchange": description.modelExchange is not None,
        "Co-Simulation": True,
        "Scheduled Execution": description.scheduledExecution is not None,
    }
    names = []
    section = ""
    for heading, name in re.findall(
        rf"/\*{{5,}}\s*(\w[^\n]*)|FMI{fmi}_Export\s+\w+TYPE\s+(\w+);", text
    ):
        section = heading or section
        kinds = (k for k in offered if k in section or re.sub("[ -]", "", k) in name)
        if name and all(offered[kind] for kind in kinds):
            names.append(name)
    return tuple(names)


def _derivatives(folder: Path, fmi: int) -> bool:
    """Whether there are directional derivatives; FMPy does not read this in FMI 3."""
    kind = ElementTree.parse(folder / DESCRIPTION).getroot().find("CoSimulation")
    name = "providesDirectionalDerivative" + ("s" if fmi == 3 else "")
    return kind is not None and kind.get(name) in ("true", "1")


def _number(text: Any) -> float | None:
    """The value as a number, if it is one that runs can use."""
    value = math.nan if text is None else float(text)
    return value if math.isfinite(value) else None


def _size(text: Any) -> float | None:
    value = _number(text)
    return value if value is not None and value > 0.0 else None


def _dependencies(
    description: ModelDescription, indices: dict[int, int]
) -> Iterator[tuple[int, tuple[int, ...]]]:
    inputs = [v for v in description.modelVariables if v.causality == "input"]
    for unknown in description.outputs:
        if unknown.variable is not None:
            known = inputs if unknown.dependencies is None else unknown.dependencies
            yield (
                indices[id(unknown.variable)],
                tuple(indices[id(v)] for v in known if v.causality == "input"),
            )


def _variable(variable: ModelVariable, description: ModelDescription) -> SubjectVariable:
    def attribute(name: str) -> Any:
        value = getattr(variable, name)
        return getattr(variable.declaredType, name, None) if value is None else value

    kind = variable.type
    if kind == "Enumeration":
        kind = "Integer" if description.fmiMajorVersion == 2 else "Int64"
    size = math.prod(variable.shape or ())
    return SubjectVariable(
        name=variable.name,
        reference=variable.valueReference,
        kind=kind,
        causality=variable.causality,
        variability=variable.variability,
        size=size,
        start=_start(variable.start, kind, size),
        min=_number(attribute("min")),
        max=_number(attribute("max")),
        unit=attribute("unit"),
        choice=variable.type == "Enumeration",
        clocked=bool(variable.clocks),
    )


def _start(text: str | None, kind: str, size: int) -> tuple[Number, ...] | None:
    if text is None or kind in ("String", "Binary", "Clock"):
        return None
    words = text.split()
    if kind == "Boolean":
        values: list[Number] = [word in ("true", "1") for word in words]
    elif kind in ("Real", "Float64", "Float32"):
        values = [float(word) for word in words]
    else:
        values = [int(word) for word in words]
    values = values * size if len(values) == 1 else values
    return tuple(values) if len(values) == size else None
