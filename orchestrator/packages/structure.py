"""What an SSP package says, as plain data: its XML files, read within bounds.

What is not understood is refused by its name, for nobody wants numbers of another system than the
one in the package.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from urllib.parse import unquote
from xml.etree.ElementTree import Element

from sblcosim.fmus.host.nanoseconds import MAX_SECONDS, nanoseconds
from sblcosim.fmus.read.archive import Archive, shown
from sblcosim.fmus.read.description import parsed

from ..errors import ConfigurationError, nearest, quoted
from ..simulation.system import Conversion
from .units import Unit, unit_of

NAMESPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
    "sblcosim": "urn:org.sblcosim",
}
"""Of the files in a package, and of the annotations with step sizes."""
DESCRIPTION = "SystemStructure.ssd"
"""Name of the description of the system in a package."""

_FMU = "application/x-fmu-sharedlibrary"
_SET = "application/x-ssp-parameter-set"
_STEPS = {
    "org.openmodelica": ("FixedStepMaster", "stepSize", "OMSimulator"),
    "com.opensimulationplatform": (
        "FixedStepAlgorithm", "baseStepSize", "the Open Simulation Platform",
    ),
}  # fmt: skip
"""Annotations with the step of all components: their element and attribute, and whose they are."""
_SIDES = (
    "Annotations", "ElementGeometry", "SystemGeometry", "GraphicalElements", "MetaData",
    "Signature",
)  # fmt: skip
"""What has no effect on a simulation."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A value for a variable of a component, or of the system.

    Attributes
    ----------
    type, text
        In the words of the standard; the values of an array are separated by blanks.
    unit
        That of the value; None: that of the variable.
    file
        Where it is given, in the package; empty: in the structure itself.
    """

    name: str
    type: str
    text: str
    unit: Unit | None
    file: str


@dataclass(frozen=True, slots=True)
class Component:
    """A component of the package.

    Attributes
    ----------
    source
        Name of its FMU in the package.
    units
        Names of the units that its connectors have, by connector.
    parameters
        Values that it is bound to; the last one of a name counts.
    """

    name: str
    source: str
    units: Mapping[str, str]
    parameters: tuple[Parameter, ...]


End = tuple[str, str]
"""A connector: the names of its component, empty for the system, and of its variable."""


@dataclass(frozen=True, slots=True)
class Link:
    """A connection.

    Attributes
    ----------
    converts
        Whether units are to be converted.
    transformation
        That the package asks for, beside units.
    """

    source: End
    target: End
    converts: bool
    transformation: Conversion | None


@dataclass(frozen=True, slots=True)
class Structure:
    """A package's description of its system.

    Attributes
    ----------
    parameters
        Values bound to the whole system, with names of its connectors or ``component.variable``.
    units
        By name.
    start_ns, stop_ns
        Of the default experiment [ns]; None: not given.
    intervals_ns
        Communication intervals of components [ns], where our own annotation gives them.
    step_ns, step_of
        The step of all components [ns] in an annotation of another tool, and its name.
    """

    components: Mapping[str, Component]
    links: tuple[Link, ...]
    parameters: tuple[Parameter, ...]
    units: Mapping[str, Unit]
    start_ns: int
    stop_ns: int | None
    intervals_ns: Mapping[str, int]
    step_ns: int | None
    step_of: str


def structure_of(archive: Archive) -> Structure:
    """The structure that an open package describes.

    Raises
    ------
    ConfigurationError
        The package holds something that cannot be simulated here; the message names it.
    FmuError
        A file is damaged, larger than the bounds, or no XML.
    """
    return _Reader(archive).structure()


class _Reader:
    """Reads the files of one package."""

    def __init__(self, archive: Archive) -> None:
        self._archive = archive
        self._units: dict[str, Unit] = {}

    def structure(self) -> Structure:
        if DESCRIPTION not in self._archive.names:
            raise self._refusal("", f"must contain {DESCRIPTION}", "none")
        root = self._root(DESCRIPTION, "ssd", "SystemStructureDescription")
        system = root.find("ssd:System", NAMESPACES)
        if system is None:
            raise self._refusal(DESCRIPTION, "must have a System", "none")
        self._units = self._defined(root)
        self._only(root, DESCRIPTION, "System", "Enumerations", "Units", "DefaultExperiment",
                   *_SIDES)  # fmt: skip
        self._only(system, "the system", "Connectors", "ParameterBindings", "Elements",
                   "Connections", *_SIDES)  # fmt: skip
        elements = system.find("ssd:Elements", NAMESPACES)
        components = {}
        for element in () if elements is None else elements:
            component = self._component(element)
            if component.name in components:
                raise self._refusal("", "names of components must be unique", component.name)
            components[component.name] = component
        links = tuple(
            self._link(connection, components)
            for connection in system.iterfind("ssd:Connections/*", NAMESPACES)
        )
        step_ns, step_of = self._step(root)
        experiment = root.find("ssd:DefaultExperiment", NAMESPACES)
        given = {} if experiment is None else experiment.attrib
        stop = given.get("stopTime")
        return Structure(
            components=components,
            links=links,
            parameters=self._bound(system, "the system"),
            units=self._units,
            start_ns=self._time("startTime", given.get("startTime", "0")),
            stop_ns=None if stop is None else self._time("stopTime", stop),
            intervals_ns=self._intervals(system),
            step_ns=step_ns,
            step_of=step_of,
        )

    def _component(self, element: Element) -> Component:
        kind, name = _local(element), element.get("name", "")
        where = f"{kind} {quoted(name)}"
        if kind != "Component":
            raise self._refusal("", "elements of the system must be components", where)
        self._only(element, where, "Connectors", "ParameterBindings", *_SIDES)
        implementation = element.get("implementation", "any")
        if implementation not in ("any", "CoSimulation"):
            raise self._refusal(where, "implementation must be CoSimulation", implementation)
        if element.get("type", _FMU) != _FMU:
            raise self._refusal(where, f"type must be {_FMU}", element.get("type", ""))
        return Component(
            name,
            self._file(element.get("source", ""), where),
            {
                connector.get("name", ""): typed.get("unit", "")
                for connector in element.iterfind("ssd:Connectors/ssd:Connector", NAMESPACES)
                for typed in connector
                if typed.get("unit")
            },
            self._bound(element, where),
        )

    def _link(self, element: Element, components: Collection[str]) -> Link:
        if _local(element) != "Connection":
            raise self._refusal("the system", "must have connections", _local(element))
        ends = []
        for end in ("start", "end"):
            owner = element.get(f"{end}Element", "")
            connector = element.get(f"{end}Connector", "")
            if owner and owner not in components:
                raise self._refusal(
                    f"connection of {quoted(connector)}", f"{end}Element must be a component",
                    f"{quoted(owner)}{nearest(owner, components)}",
                )  # fmt: skip
            ends.append((owner, connector))
        source, target = ends
        where = f"connection {'.'.join(source)} -> {'.'.join(target)}"
        self._only(element, where, "LinearTransformation", "ConnectionGeometry", *_SIDES)
        transformation = None
        linear = element.find("ssc:LinearTransformation", NAMESPACES)
        if linear is not None:
            if not (source[0] and target[0]):
                raise self._refusal(
                    where, "must have no transformation at a connector of the system",
                    "LinearTransformation",
                )  # fmt: skip
            factor, offset = (
                self._number(f"{where}: {key}", linear.get(key, default))
                for key, default in (("factor", "1"), ("offset", "0"))
            )
            transformation = Conversion(factor, offset)
        converts = element.get("suppressUnitConversion", "false") not in ("true", "1")
        return Link(source, target, converts, transformation)

    # --- Parameters ---

    def _bound(self, element: Element, where: str) -> tuple[Parameter, ...]:
        """The values that an element is bound to, in their order."""
        found: list[Parameter] = []
        bindings = element.find("ssd:ParameterBindings", NAMESPACES)
        for binding in () if bindings is None else bindings:
            if _local(binding) != "ParameterBinding":
                raise self._refusal(where, "must have bindings of parameters", _local(binding))
            self._only(binding, f"{where}: ParameterBinding", "ParameterValues", "Annotations")
            for key, only in (("type", _SET), ("sourceBase", "SSD")):
                if binding.get(key, only) != only:
                    raise self._refusal(
                        f"{where}: ParameterBinding", f"{key} must be {only}", binding.get(key, "")
                    )
            found += self._set(binding, where)
        return tuple(found)

    def _set(self, binding: Element, where: str) -> Iterator[Parameter]:
        source, prefix = binding.get("source"), binding.get("prefix", "")
        if source:
            root = self._root(self._file(source, where), "ssv", "ParameterSet")
        else:
            inline = binding.find("ssd:ParameterValues/ssv:ParameterSet", NAMESPACES)
            if inline is None:
                raise self._refusal(f"{where}: ParameterBinding", "must have a source or a "
                                    "ParameterSet in its ParameterValues", "neither")  # fmt: skip
            root = inline
        units = self._units | self._defined(root)
        self._only(root, f"{where}: ParameterSet", "Parameters", "Enumerations", "Units", *_SIDES)
        for parameter in root.iterfind("ssv:Parameters/*", NAMESPACES):
            if _local(parameter) != "Parameter":
                raise self._refusal(f"{where}: ParameterSet", "must hold parameters",
                                    _local(parameter))  # fmt: skip
            name = prefix + parameter.get("name", "")
            values = [child for child in parameter if _local(child) not in _SIDES]
            values = [child for child in values if _local(child) != "Dimension"]
            if len(values) != 1 or "value" not in values[0].attrib:
                raise self._refusal(f"{where}: parameter {quoted(name)}", "must have a value",
                                    ", ".join(map(_local, values)) or "none")  # fmt: skip
            (value,) = values
            unit = value.get("unit")
            if unit and unit not in units:
                raise self._refusal(
                    f"{where}: parameter {quoted(name)}", "must have a unit that is defined",
                    f"{quoted(unit)}{nearest(unit, units)}",
                )  # fmt: skip
            known = units[unit] if unit else None
            yield Parameter(name, _local(value), value.attrib["value"], known, source or "")

    def _defined(self, root: Element) -> dict[str, Unit]:
        """The units that a file defines."""
        units = {}
        for space in ("ssd", "ssv"):
            for unit in root.iterfind(f"{space}:Units/ssc:Unit", NAMESPACES):
                base = unit.find("ssc:BaseUnit", NAMESPACES)
                name = unit.get("name", "")
                try:
                    units[name] = unit_of({} if base is None else base.attrib)
                except ValueError as error:
                    raise self._refusal(
                        f"unit {quoted(name)}", "must have whole exponents and a finite factor, "
                        "not 0", str(error),
                    ) from None  # fmt: skip
        return units

    # --- Steps ---

    def _intervals(self, system: Element) -> dict[str, int]:
        return {
            interval.get("component", ""): self._time("Interval", interval.get("seconds", ""))
            for annotation in system.iterfind("ssd:Annotations/ssc:Annotation", NAMESPACES)
            for interval in annotation.iterfind("sblcosim:Intervals/sblcosim:Interval", NAMESPACES)
        }

    def _step(self, root: Element) -> tuple[int | None, str]:
        for kind, (element, attribute, tool) in _STEPS.items():
            for annotation in root.iter(f"{{{NAMESPACES['ssc']}}}Annotation"):
                if annotation.get("type") != kind:
                    continue
                for found in annotation.iter():
                    if _local(found) == element and attribute in found.attrib:
                        return self._time(attribute, found.attrib[attribute]), tool
        return None, ""

    def _time(self, where: str, text: str) -> int:
        seconds = self._number(where, text)
        if abs(seconds) >= MAX_SECONDS:
            raise self._refusal(where, f"must be less than {MAX_SECONDS:g} s", text)
        return nanoseconds(seconds)

    def _number(self, where: str, text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise self._refusal(where, "must be a finite number", quoted(text))
        return value

    # --- Files ---

    def _root(self, name: str, space: str, expected: str) -> Element:
        root = parsed(self._archive, name)
        if root.tag != f"{{{NAMESPACES[space]}}}{expected}":
            raise self._refusal(name, f"must be a {expected} of SSP 1.0 or 2.0", root.tag)
        version = root.get("version", "")
        if version.partition(".")[0] not in ("1", "2"):
            raise self._refusal(name, "must be of version 1.0 or 2.0", quoted(version))
        return root

    def _file(self, source: str, where: str) -> str:
        name = unquote(source).removeprefix("./")
        if name not in self._archive.names:
            close = nearest(name, self._archive.names)
            raise self._refusal(
                where, "source must be a file in the package", f"{quoted(source)}{close}"
            )
        return name

    def _only(self, element: Element, where: str, *known: str) -> None:
        for child in element:
            if _local(child) not in known:
                raise self._refusal(where, "must hold what can be simulated here", _local(child))

    def _refusal(self, where: str, must: str, got: str) -> ConfigurationError:
        at = f": {shown(where, 200)}" if where else ""
        return ConfigurationError(f"{self._archive.path}{at}: {must}, got {shown(got, 200)}")


def _local(element: Element) -> str:
    """The name of an element, without its namespace."""
    return element.tag.rpartition("}")[2]
