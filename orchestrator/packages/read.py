"""An SSP package as a system to run.

Its FMUs are unpacked for as long as they are needed. Scalars that make up an array, as FMI 2 has
them, are connected as one if the package connects all of them in their order.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from fmpy.model_description import ModelDescription, ModelVariable
from sblcosim.fmus.files import scratch
from sblcosim.fmus.host.nanoseconds import nanoseconds, text_of
from sblcosim.fmus.read import archive as archives
from sblcosim.fmus.read import ports
from sblcosim.fmus.read.archive import shown
from sblcosim.fmus.read.description import describe
from sblcosim.fmus.read.ports import Fmu, Port
from sblcosim.models.declaration import Number

from ..errors import (
    ConfigurationError,
    ConfigurationWarning,
    FmuError,
    SblcosimError,
    nearest,
    quoted,
)
from ..simulation.settings import checked
from ..simulation.system import ComponentSpec, Connection, Conversion, System, Value
from .structure import Component, Link, Parameter, Structure, structure_of
from .units import Unit, conversion, units_of

STEPS = 1000
"""Steps of a run for which neither the package nor its FMUs say anything else."""


@dataclass(frozen=True)
class Package:
    """A package that is unpacked.

    Attributes
    ----------
    name
        Of the file, without its end.
    sha256
        Of the file.
    remarks
        What the package leaves open and how it was settled, in sentences.
    path, folder
        The file, and where it is unpacked.
    """

    name: str
    sha256: str
    system: System
    remarks: tuple[str, ...]
    path: Path
    folder: Path

    def said(self, message: str) -> str:
        """A message about the package: its path in place of the folder, or in front."""
        said = message.replace(str(self.folder), str(self.path))
        return said if str(self.path) in said else f"{self.path}: {said}"


def is_package(source: object) -> bool:
    """Whether something is the path of an SSP package, by its name."""
    return isinstance(source, str | Path) and str(source).lower().endswith(".ssp")


@contextmanager
def opened(source: str | Path) -> Iterator[Package]:
    """A package, unpacked while the statement lasts.

    Raises
    ------
    ConfigurationError
        There is no such package, it is damaged, or it holds something that cannot be simulated
        here; the message names it.

    Warns
    -----
    ConfigurationWarning
        A parameter of the package has no effect.
    """
    path = Path(source)
    with tempfile.TemporaryDirectory(dir=scratch()) as temporary:
        folder = Path(temporary)
        try:
            with archives.opened(path, "an SSP package") as archive:
                structure = structure_of(archive)
                archive.unpack(folder)
                sha256 = archive.sha256
            parts = {
                name: _part(component, folder) for name, component in structure.components.items()
            }
        except FmuError as error:
            raise ConfigurationError(str(error).replace(str(folder), str(path))) from error
        try:
            system, remarks = _Assembly(structure, parts).system()
        except ConfigurationError as error:
            raise ConfigurationError(f"{path}: {error}") from error
        package = Package(path.stem, sha256, system, tuple(remarks), path, folder)
        try:
            yield package
        except SblcosimError as error:
            error.args = (package.said(str(error)),)
            raise


@dataclass(frozen=True, slots=True)
class _Place:
    """Where a variable of an FMU is: in which port, and which of its elements; None: all."""

    port: Port
    element: int | None

    @property
    def name(self) -> str:
        """For a `Connection`."""
        if self.element is None or not self.port.shape:
            return self.port.name
        index = np.unravel_index(self.element, self.port.shape)
        return f"{self.port.name}[{','.join(str(i + 1) for i in index)}]"


@dataclass(frozen=True)
class _Part:
    """A component's FMU, and what it says of itself."""

    component: Component
    fmu: Fmu
    description: ModelDescription
    variables: Mapping[str, ModelVariable]
    places: Mapping[str, _Place]
    units: Mapping[str, Unit]

    def unit(self, variable: str) -> str:
        """Name of a variable's unit, empty without one."""
        found = self.variables[variable]
        return found.unit or getattr(found.declaredType, "unit", None) or ""


def _part(component: Component, folder: Path) -> _Part:
    path = folder / component.source
    with archives.opened(path) as archive:
        description = describe(archive)
    fmu = ports.read(path)
    places = {}
    for port in fmu.ports.values():
        single = len(port.variables) == 1
        for number, variable in enumerate(port.variables):
            places[variable] = _Place(port, None if single else number)
    return _Part(
        component,
        fmu,
        description,
        {v.name: v for v in description.modelVariables},
        places,
        units_of(description.unitDefinitions),
    )


class _Assembly:
    """Puts a system together."""

    def __init__(self, structure: Structure, parts: Mapping[str, _Part]) -> None:
        self._structure = structure
        self._parts = parts

    def system(self) -> tuple[System, list[str]]:
        """The system, and remarks on what the package leaves open."""
        if not self._parts:
            raise ConfigurationError("the system must have at least one component, got none")
        stop_ns, remarks = self._stop()
        intervals, more = self._intervals(stop_ns)
        values = self._values()
        components = {
            name: ComponentSpec(
                part.fmu.path,
                intervals[name],
                _filled(name, part, values[name], "parameter"),
                _filled(name, part, values[name], "input"),
            )
            for name, part in self._parts.items()
        }
        connections = tuple(self._connections())
        start_ns = self._structure.start_ns
        return System(components, connections, stop_ns, start_ns), [*remarks, *more]

    # --- Time ---

    def _stop(self) -> tuple[int, list[str]]:
        if self._structure.stop_ns is not None:
            return self._structure.stop_ns, []
        given = {name: _default(part, "stopTime") for name, part in self._parts.items()}
        known = [stop_ns for stop_ns in given.values() if stop_ns is not None]
        if not known:
            raise ConfigurationError(
                "DefaultExperiment: must have a stopTime, got none, nor has any of its FMUs"
            )
        return max(known), [
            f"stop time {text_of(max(known))}: the longest of the FMUs, as the package gives none"
        ]

    def _intervals(self, stop_ns: int) -> tuple[dict[str, int], list[str]]:
        """The communication intervals [ns], and how they were chosen."""
        own, step_ns = self._structure.intervals_ns, self._structure.step_ns
        if own.keys() >= self._parts.keys():
            return dict(own), []
        if step_ns is not None:
            return dict.fromkeys(self._parts, step_ns), [
                f"communication interval {text_of(step_ns)}: the step that the package gives for "
                f"{self._structure.step_of}"
            ]
        given = {name: _default(part, "stepSize") for name, part in self._parts.items()}
        known = {name: step for name, step in given.items() if step}
        if known:
            rest = min(known.values())
            words = ", ".join(f"{name} {text_of(step or rest)}" for name, step in given.items())
            return {name: step or rest for name, step in given.items()}, [
                f"communication intervals: the default step sizes of the FMUs, the smallest for "
                f"those without one ({words})"
            ]
        step = max((stop_ns - self._structure.start_ns) // STEPS, 1)
        return dict.fromkeys(self._parts, step), [
            f"communication interval {text_of(step)}: a {STEPS}th of the run, as neither the "
            "package nor its FMUs give a step size"
        ]

    # --- Connections ---

    def _connections(self) -> Iterator[Connection]:
        """Between components; whole arrays where all elements are connected in order."""
        groups: dict[tuple[str, ...], list[tuple[_Place, _Place, Conversion | None]]] = {}
        for link in self._structure.links:
            if not (link.source[0] and link.target[0]):
                continue  # nothing is outside of the system
            one, other = self._end(link, link.source), self._end(link, link.target)
            key = (link.source[0], one.port.name, link.target[0], other.port.name)
            groups.setdefault(key, []).append((one, other, self._conversion(link)))
        for (source, out, target, into), pairs in groups.items():
            if _is_whole(pairs):
                yield Connection(f"{source}.{out}", f"{target}.{into}", pairs[0][2])
                continue
            for one, other, through in pairs:
                yield Connection(f"{source}.{one.name}", f"{target}.{other.name}", through)

    def _end(self, link: Link, end: tuple[str, str]) -> _Place:
        component, variable = end
        places = self._parts[component].places
        if variable not in places:
            raise ConfigurationError(
                f"{_words(link)}: must be connectors of variables of the FMUs, got "
                f"{quoted(variable)} of {component}{nearest(variable, places)}"
            )
        return places[variable]

    def _conversion(self, link: Link) -> Conversion | None:
        """What becomes of the values; None: their units are left to be compared by name."""
        if not link.converts:
            return link.transformation or Conversion()
        (one, source), (other, target) = self._unit(link.source), self._unit(link.target)
        if source is None or target is None:
            if link.transformation is not None and (one and other) and one != other:
                raise ConfigurationError(
                    f"{_words(link)}: both units must be defined, got {quoted(one)} and "
                    f"{quoted(other)}"
                )
            return link.transformation
        try:
            found = conversion(source, target)
        except ValueError:
            raise ConfigurationError(
                f"{_words(link)}: must have units of the same quantity at both ends, got "
                f"{quoted(one)} and {quoted(other)}"
            ) from None
        if link.transformation is None:
            return found
        if found != Conversion():
            raise ConfigurationError(
                f"{_words(link)}: must have a transformation or units to convert, got both "
                f"(the standard does not say which comes first)"
            )
        return link.transformation

    def _unit(self, end: tuple[str, str]) -> tuple[str, Unit | None]:
        """The unit of a connector, by name and by definition: its own, or that of the FMU."""
        part = self._parts[end[0]]
        own = part.component.units.get(end[1])
        if own is not None:
            return own, self._structure.units.get(own)
        name = part.unit(end[1])
        return name, part.units.get(name)

    # --- Parameters ---

    def _values(self) -> dict[str, dict[str, Parameter]]:
        """The values of variables, by component; those of the system come before their own."""
        values = {name: self._known(name, part) for name, part in self._parts.items()}
        inside: dict[str, list[tuple[str, str]]] = {}
        for link in self._structure.links:
            if not link.source[0] and link.target[0]:
                inside.setdefault(link.source[1], []).append(link.target)
        for parameter in self._structure.parameters:
            component, _, variable = parameter.name.partition(".")
            targets = inside.get(parameter.name, [(component, variable)])
            for owner, name in targets:
                if owner not in self._parts or name not in self._parts[owner].variables:
                    known = [*inside, *(f"{c}.{v}" for c, p in self._parts.items()
                                        for v in p.variables)]  # fmt: skip
                    _warn(f"parameter of the system: {quoted(parameter.name)}", parameter, known)
                else:
                    values[owner][name] = parameter
        return values

    def _known(self, name: str, part: _Part) -> dict[str, Parameter]:
        known = {}
        for parameter in part.component.parameters:
            if parameter.name in part.variables:
                known[parameter.name] = parameter
            else:
                _warn(f"{name}: parameter {quoted(parameter.name)}", parameter, part.variables)
        return known


def _warn(what: str, parameter: Parameter, known: Iterator[str] | Sequence[str] | Any) -> None:
    message = f"{what} has no effect: there is no such variable{nearest(parameter.name, known)}"
    warnings.warn(shown(message, 200), ConfigurationWarning, stacklevel=4)


def _is_whole(pairs: Sequence[tuple[_Place, _Place, Conversion | None]]) -> bool:
    """Whether connections of elements are that of two arrays."""
    one, other, through = pairs[0]
    if one.element is None and other.element is None:
        return len(pairs) == 1
    elements = [(a.element, b.element) for a, b, _ in pairs]
    return (
        one.port.shape == other.port.shape
        and sorted(elements, key=str) == sorted(((i, i) for i in range(one.port.size)), key=str)
        and all(own == through for _, _, own in pairs)
    )


def _words(link: Link) -> str:
    return shown(f"connection {'.'.join(link.source)} -> {'.'.join(link.target)}", 200)


def _default(part: _Part, what: str) -> int | None:
    """A time of the FMU's default experiment [ns]; None: it gives none."""
    text = getattr(part.description.defaultExperiment, what, None)
    try:
        time_ns = nanoseconds(float(text)) if text is not None else 0
    except (ValueError, OverflowError, ArithmeticError):
        return None
    return time_ns if time_ns > 0 else None


# --- Values ---------------------------------------------------------------------------------------


def _filled(
    name: str, part: _Part, values: Mapping[str, Parameter], causality: str
) -> dict[str, Value]:
    """The values of ports of one causality; elements that are not given keep their start."""
    given: dict[str, dict[int, Number]] = {}
    for variable, parameter in values.items():
        if variable not in part.places:
            raise ConfigurationError(
                f"{name}.{variable}: must be a parameter or an input to be set, got the time"
            )
        place = part.places[variable]
        if place.port.causality not in ("parameter", "input"):
            raise ConfigurationError(
                f"{name}.{variable}: must be a parameter or an input to be set, got one of "
                f"causality {place.port.causality}"
            )
        if place.port.causality != causality:
            continue
        before = f"{parameter.file}: {name}." if parameter.file else f"{name}."
        where = before + variable
        numbers = _numbers(where, part, variable, parameter)
        first = place.element or 0
        size = place.port.size if place.element is None else 1
        if len(numbers) != size:
            raise ConfigurationError(f"{where}: must have {size} values, got {len(numbers)}")
        for i, number in enumerate(numbers, first):
            checked(before + place.port.name, place.port, i, number)
        given.setdefault(place.port.name, {}).update(enumerate(numbers, first))
    return {key: _whole(f"{name}.{key}", part.fmu.ports[key], v) for key, v in given.items()}


def _whole(where: str, port: Port, given: Mapping[int, Number]) -> Value:
    if len(given) < port.size and port.start is None:
        got = f"as the FMU gives none, got {len(given)}"
        raise ConfigurationError(f"{where}: must have values of all {port.size} elements, {got}")
    start = port.start or ()
    values = [given[i] if i in given else start[i] for i in range(port.size)]
    return values if port.shape else values[0]


def _numbers(where: str, part: _Part, variable: str, parameter: Parameter) -> list[Number]:
    """The values of a parameter in the type and the unit of a variable."""
    port = part.places[variable].port
    if parameter.type == "Enumeration":
        return [_item(where, part.variables[variable], parameter.text)]
    numbers = [_number(where, port, word) for word in parameter.text.split()]
    name = part.unit(variable)
    if parameter.unit is None or name not in part.units:
        return numbers
    try:
        through = conversion(parameter.unit, part.units[name])
    except ValueError:
        raise ConfigurationError(
            f"{where}: must be given in a unit that can become {name}, got one of another quantity"
        ) from None
    if through == Conversion():
        return numbers
    return [through.factor * number + through.offset for number in numbers]


def _number(where: str, port: Port, word: str) -> Number:
    real = port.type.startswith("Float")
    try:
        if port.type == "Boolean":
            return {"true": True, "1": True, "false": False, "0": False}[word]
        return float(word) if real else int(word)
    except (KeyError, ValueError):
        must = "true or false" if port.type == "Boolean" else "a number"
        must = must if real or port.type == "Boolean" else "a whole number"
        raise ConfigurationError(f"{where}: must be {must}, got {quoted(word)}") from None


def _item(where: str, variable: ModelVariable, text: str) -> int:
    """The number of an item of an enumeration."""
    items = {item.name: item.value for item in getattr(variable.declaredType, "items", ())}
    if text not in items:
        raise ConfigurationError(
            f"{where}: must be {', '.join(items) or 'an item of an enumeration'}, got "
            f"{quoted(text)}{nearest(text, items)}"
        )
    return int(items[text])
