"""What both kinds of export share: the FMUs of a scenario, their connections, and the file."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

from fmpy.model_description import ModelDescription, ModelVariable
from sblcosim.fmus.build.factory import Wanted, build, build_all
from sblcosim.fmus.host.nanoseconds import SECOND
from sblcosim.fmus.read.archive import opened
from sblcosim.fmus.read.description import describe
from sblcosim.fmus.read.ports import Fmu, Port
from sblcosim.fmus.standard import Fmi
from sblcosim.models import declared, of_file
from sblcosim.models.declaration import Number

from ..errors import ConfigurationError
from ..scenario.labels import RAW
from ..scenario.scenario import Receivers, Scenario, Source
from ..scenario.wiring import connect
from ..simulation.plans.plan import Plan, PlannedComponent
from ..simulation.resolve import resolve
from ..simulation.system import System


@dataclass(frozen=True, slots=True)
class ExportedPart:
    """A component of the export.

    Attributes
    ----------
    name
        Its name in the export, an identifier.
    planned
        The component in the plan.
    fmu, description
        Its FMU, and the FMU's model description.
    """

    name: str
    planned: PlannedComponent
    fmu: Path
    description: ModelDescription


def fmu_plan(
    scenario: Scenario,
    receiver: Receivers,
    components: Mapping[str, Source] | None,
    fmi: int,
    what: str,
) -> Plan:
    """The plan of a scenario for the export to `what`; all components are FMUs of one version.

    Raises
    ------
    ConfigurationError
        A component is in Python, or an FMU of another version.
    """
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
    """The system without the raw fix that every run includes for comparison."""
    if isinstance(receiver, Mapping) and RAW in receiver:
        return system
    return replace(
        system,
        components={name: spec for name, spec in system.components.items() if name != RAW},
        connections=tuple(c for c in system.connections if not c.target.startswith(f"{RAW}.")),
    )


def parts_of(plan: Plan, bake: bool) -> list[ExportedPart]:
    """The components of a plan; with `bake`, the plan's numbers are the FMUs' start values."""
    parts = []
    names = _names(plan)
    paths = {c.name: cast(Fmu, c.source).path for c in plan.components}
    wanted = {c.name: _baked(c, plan) for c in plan.components if bake}
    baked = {name: one for name, one in wanted.items() if one is not None}
    paths |= zip(baked, build_all([*baked.values()]), strict=True)
    for component in plan.components:
        path = paths[component.name]
        with opened(path) as archive:
            parts.append(ExportedPart(names[component.name], component, path, describe(archive)))
    return parts


def identifier(name: str, taken: Collection[str] = ()) -> str:
    """A name as OMSimulator requires it: ASCII letters, digits and _, beginning with a letter."""
    stem = re.sub(r"[^A-Za-z0-9_]", "_", name)
    stem = name = stem if stem[0].isalpha() else f"x{stem}"
    number = 2
    while name in taken:
        name = f"{stem}_{number}"
        number += 1
    return name


def _names(plan: Plan) -> dict[str, str]:
    """The name of each component in a package; valid names are kept."""
    names = {c.name: c.name for c in plan.components if identifier(c.name) == c.name}
    for component in plan.components:
        if component.name not in names:
            names[component.name] = identifier(component.name, names.values())
    return names


def _baked(component: PlannedComponent, plan: Plan) -> Wanted | None:
    """The FMU with the scenario's numbers as start values; None: a foreign one, which has them."""
    source = cast(Fmu, component.source)
    known, fmi = of_file(source.path.stem), cast(Fmi, source.fmi)
    name, constants = known or ("", {})
    if known is None or source.path != build(name, fmi, False, None, **constants):
        for setting in component.settings:
            if setting.port.start != setting.values:
                raise ConfigurationError(
                    f"{component.name}: cannot be baked, as it is a foreign FMU; its "
                    f"{setting.port.name} must start as {words(setting.port, setting.values)}, "
                    f"got {words(setting.port, setting.port.start or ())}"
                )
        return None
    values = {s.port.name: s.values for s in component.settings}
    usual = declared(name, **constants)
    baked = replace(
        usual,
        variables=tuple(
            replace(v, start=values[v.name] if v.shape else values[v.name][0])
            if v.name in values
            else v
            for v in usual
        ),
        step_size=step_ns(plan) / SECOND,  # also for a receiver that needs fewer: tools use one
        stop_time=plan.stop_ns / SECOND,
    )
    return Wanted(name, fmi, baked=baked, constants=constants)


def links_of(plan: Plan) -> Iterator[tuple[tuple[str, str], tuple[str, str]]]:
    """Both ends of every connection as (component, variable), for each variable of the FMUs."""
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


def step_ns(plan: Plan) -> int:
    """The longest step that divides all communication intervals [ns]."""
    return math.gcd(*(c.interval_ns for c in plan.components))


def outputs_of(part: ExportedPart) -> list[ModelVariable]:
    """Outputs that are numbers or switches: some tools, such as libcosim, drop enumerations."""
    return [
        v
        for v in part.description.modelVariables
        if v.causality == "output" and v.type not in ("Enumeration", "String", "Binary", "Clock")
    ]


def words(port: Port, values: tuple[Number, ...]) -> str:
    """Values as XML text that reads back as the same numbers."""
    if port.type == "Boolean":
        return " ".join("true" if value else "false" for value in values)
    return " ".join(map(repr, values))


def written(path: Path, write: Callable[[Path], None]) -> Path:
    """Write a file; returns its path.

    Raises
    ------
    ConfigurationError
        The file cannot be written.
    """
    try:
        write(path)
    except OSError as error:
        raise ConfigurationError(f"{path}: must be writable, got {error.strerror}") from None
    return path
