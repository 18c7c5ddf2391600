"""The description in an SSP package as plain data: its system, and the systems inside.

Anything that is not understood is refused by its name, because its numbers would be those of
another system than the one in the package.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from xml.etree.ElementTree import Element

from sblcosim.fmus.read.archive import Archive

from ..errors import nearest, quoted
from ..simulation.system import Conversion
from .documents import NAMESPACES, SIDES, SPACES, Documents, annotations_of, local
from .parameters import Parameter, Parameters, converts, defined, transformation_of
from .units import LinearUnit

__all__ = ["DESCRIPTION", "NAMESPACES"]

DESCRIPTION = "SystemStructure.ssd"
"""Name of the description of the system in a package."""

Path = tuple[str, ...]
"""Names of the elements from the system of the package, ``()``, to one that is inside it."""
End = tuple[Path, str]
"""A connector: its element, and its name."""

_FMU = "application/x-fmu-sharedlibrary"
_STEPS = (
    ("org.openmodelica", "FixedStepMaster", "stepSize", "OMSimulator"),
    ("com.opensimulationplatform", "FixedStepAlgorithm", "baseStepSize",
     "the Open Simulation Platform"),
    ("com.github.ntnu-ihb.vico", "FixedStepAlgorithm", "baseStepSize", "Vico"),
    ("com.github.ntnu-ihb.vico", "FixedStepMaster", "baseStepSize", "Vico"),
    ("com.github.ntnu-ihb.vico", "StepSizeHint", "value", "Vico"),
)  # fmt: skip
"""Annotations with steps: their type, element and attribute, and their tool."""


@dataclass(frozen=True, slots=True)
class StepAnnotation:
    """The step of all components in an element [ns], in an annotation of another tool."""

    ns: int
    tool: str


@dataclass(frozen=True, slots=True)
class Connector:
    """A connector.

    Attributes
    ----------
    kind, unit
        As in the package; empty: not given.
    """

    kind: str
    unit: str


@dataclass(frozen=True)
class PackageComponent:
    """A component of the package.

    Attributes
    ----------
    source
        Name of its FMU in the package.
    connectors
        Connectors that the package lists.
    parameters
        Values that it is bound to; the last one for a name counts.
    """

    source: str
    connectors: Mapping[str, Connector]
    parameters: tuple[Parameter, ...]
    step: StepAnnotation | None


@dataclass(frozen=True, slots=True)
class Link:
    """A connection between two connectors, with the ends in the order of the package.

    Attributes
    ----------
    system
        System that contains the connection.
    converts
        Whether to convert units.
    transformation
        Transformation that the package requires after the conversion of units.
    """

    system: Path
    start: End
    end: End
    converts: bool
    transformation: Conversion | None

    def __str__(self) -> str:
        start, end = (".".join((*(path or ("",)), name)) for path, name in (self.start, self.end))
        return f"connection {start} -> {end}"


@dataclass(frozen=True)
class Inside:
    """A system: elements, and how they are connected.

    Attributes
    ----------
    elements
        Components and systems, by name.
    """

    connectors: Mapping[str, Connector]
    elements: Mapping[str, PackageComponent | Inside]
    links: tuple[Link, ...]
    parameters: tuple[Parameter, ...]
    step: StepAnnotation | None

    def walk(self, path: Path = ()) -> Iterator[tuple[Path, PackageComponent | Inside]]:
        """This system and all elements in it, outer ones first."""
        yield path, self
        for name, element in self.elements.items():
            if isinstance(element, Inside):
                yield from element.walk((*path, name))
            else:
                yield (*path, name), element


@dataclass(frozen=True)
class Structure:
    """A package.

    Attributes
    ----------
    name
        Name of the system.
    units
        Units by name; None for a unit without a definition.
    start_ns, stop_ns
        Times of the default experiment [ns]; None: not given.
    intervals_ns
        Communication intervals of components [ns], where our own annotation gives them.
    remarks, warnings
        Faults that were read anyway, and contents without an effect, as sentences.
    """

    name: str
    system: Inside
    units: Mapping[str, LinearUnit | None]
    start_ns: int
    stop_ns: int | None
    intervals_ns: Mapping[str, int]
    remarks: tuple[str, ...]
    warnings: tuple[str, ...]


def structure_of(archive: Archive) -> Structure:
    """The structure that an open package describes.

    Raises
    ------
    ConfigurationError
        The package holds something that cannot be simulated here; the message names it.
    FmuError
        A file is damaged, larger than the bounds, or not XML.
    """
    documents = Documents(archive)
    if DESCRIPTION not in documents.names:
        raise documents.refusal("", f"must contain {DESCRIPTION}", "none")
    root = documents.root(DESCRIPTION, "ssd", "SystemStructureDescription")
    system = root.find("ssd:System", SPACES)
    if system is None:
        raise documents.refusal(DESCRIPTION, "must have a System", "none")
    documents.only(
        root, DESCRIPTION, "System", "Enumerations", "Units", "DefaultExperiment", *SIDES
    )
    units = defined(documents, root)
    experiment = root.find("ssd:DefaultExperiment", SPACES)
    given = {} if experiment is None else experiment.attrib
    stop = given.get("stopTime")
    places = [system, root, *(() if experiment is None else [experiment])]
    return Structure(
        name=system.get("name", ""),
        system=_Reader(documents, Parameters(documents, units)).system(system, (), places),
        units=units,
        start_ns=documents.time("startTime", given.get("startTime", "0")),
        stop_ns=None if stop is None else documents.time("stopTime", stop),
        intervals_ns=_intervals(documents, system),
        remarks=tuple(documents.remarks),
        warnings=tuple(documents.warnings),
    )


class _Reader:
    """Reads the elements of one package."""

    def __init__(self, documents: Documents, parameters: Parameters) -> None:
        self._documents = documents
        self._parameters = parameters

    def system(self, element: Element, path: Path, annotated: Iterable[Element]) -> Inside:
        """A system; some annotations of its elements apply to all of it."""
        where = f"System {quoted('.'.join(path))}" if path else "the system"
        self._documents.only(element, where, "Connectors", "ParameterBindings", "Elements",
                             "Connections", *SIDES)  # fmt: skip
        group = element.find("ssd:Elements", SPACES)
        elements: dict[str, PackageComponent | Inside] = {}
        for child in () if group is None else group:
            kind, name = local(child), child.get("name", "")
            inner = (*path, name)
            if name in elements:
                raise self._documents.refusal(
                    where if path else "", "names of components must be unique", name
                )
            if kind == "System":
                elements[name] = self.system(child, inner, [child])
            elif kind == "Component":
                elements[name] = self._component(child, inner)
            else:
                got = f"{kind} {quoted(name)}"
                raise self._documents.refusal(
                    where if path else "", "elements of the system must be components or systems",
                    got,
                )  # fmt: skip
        connectors = self._connectors(element, where)
        links = tuple(
            self._link(connection, path, elements, connectors, where)
            for connection in element.iterfind("ssd:Connections/*", SPACES)
        )
        return Inside(
            connectors, elements, links, self._parameters.bound(element, where),
            self._step(annotated),
        )  # fmt: skip

    def _component(self, element: Element, path: Path) -> PackageComponent:
        where = f"Component {quoted('.'.join(path))}"
        self._documents.only(element, where, "Connectors", "ParameterBindings", *SIDES)
        implementation = element.get("implementation", "any")
        if implementation not in ("any", "CoSimulation"):
            raise self._documents.refusal(
                where, "implementation must be CoSimulation", implementation
            )
        if element.get("type", _FMU) != _FMU:
            raise self._documents.refusal(where, f"type must be {_FMU}", element.get("type", ""))
        return PackageComponent(
            self._documents.file(element.get("source", ""), where),
            self._connectors(element, where),
            self._parameters.bound(element, where),
            self._step([element]),
        )

    def _connectors(self, element: Element, where: str) -> dict[str, Connector]:
        connectors: dict[str, Connector] = {}
        for connector in element.iterfind("ssd:Connectors/ssd:Connector", SPACES):
            name = connector.get("name", "")
            if name in connectors:
                raise self._documents.refusal(where, "names of connectors must be unique", name)
            units = [typed.get("unit", "") for typed in connector if typed.get("unit")]
            connectors[name] = Connector(connector.get("kind", ""), units[0] if units else "")
        return connectors

    def _link(
        self,
        element: Element,
        path: Path,
        elements: Mapping[str, PackageComponent | Inside],
        own: Mapping[str, Connector],
        where: str,
    ) -> Link:
        if local(element) != "Connection":
            raise self._documents.refusal(where, "must have connections", local(element))
        ends: list[End] = []
        for end in ("start", "end"):
            owner = element.get(f"{end}Element", "")
            connector = element.get(f"{end}Connector", "")
            if owner and owner not in elements:
                raise self._documents.refusal(
                    f"connection of {quoted(connector)}", f"{end}Element must be a component "
                    "or system", f"{quoted(owner)}{nearest(owner, elements)}",
                )  # fmt: skip
            found = elements.get(owner) if owner else None
            known = own if found is None else found.connectors
            # A component's FMU lists its connectors. A system that lists none lets all be
            # connected.
            if known and connector not in known and not isinstance(found, PackageComponent):
                raise self._documents.refusal(
                    f"connection of {quoted(connector)}", f"{end}Connector must be a connector of "
                    f"{quoted(owner) if owner else where}",
                    f"{quoted(connector)}{nearest(connector, known)}",
                )  # fmt: skip
            ends.append(((*path, owner) if owner else path, connector))
        link = Link(path, ends[0], ends[1], converts(element), None)
        for attribute in ("startIndices", "endIndices"):
            if element.get(attribute):
                raise self._documents.refusal(
                    str(link), f"must connect whole variables, without {attribute}",
                    quoted(element.get(attribute, "")),
                )  # fmt: skip
        transformation = transformation_of(
            self._documents, element, str(link), "ConnectionGeometry"
        )
        return Link(path, ends[0], ends[1], link.converts, transformation)

    def _step(self, annotated: Iterable[Element]) -> StepAnnotation | None:
        """The step in the annotations of some elements."""
        given = [annotation for element in annotated for annotation in annotations_of(element)]
        for kind, name, attribute, tool in _STEPS:
            for annotation in given:
                for found in annotation.iter() if annotation.get("type") == kind else ():
                    if local(found) == name and attribute in found.attrib:
                        return StepAnnotation(
                            self._documents.step(attribute, found.attrib[attribute]), tool
                        )
        return None


def _intervals(documents: Documents, system: Element) -> dict[str, int]:
    return {
        interval.get("component", ""): documents.step("Interval", interval.get("seconds", ""))
        for annotation in annotations_of(system)
        for interval in annotation.iterfind("sblcosim:Intervals/sblcosim:Interval", SPACES)
    }
