"""An FMU's variables as ports: one view for FMI 2.0 and FMI 3.0."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from fmpy.model_description import ModelDescription, ModelVariable
from sblcosim.models.declaration import Number, Variable

from .. import unchanged
from ..known_as import KNOWN_AS, LONGEST, noted
from ..terminals import port_names
from .archive import Archive, opened
from .description import check_interface, describe, library_of, split, terminals_of

NUMBERS = (
    "Float64", "Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64",
    "Boolean",
)  # fmt: skip
"""FMI types that can be connected, set and recorded."""

_FMI2_TYPES = {
    "Real": "Float64",
    "Integer": "Int32",
    "Enumeration": "Int32",
    "Boolean": "Boolean",
    "String": "String",
}


@dataclass(frozen=True, slots=True)
class Port:
    """A variable of an FMU or a Python component, a scalar or an array.

    Attributes
    ----------
    name
        Name in the FMU, unless one of its terminals maps the variable to a port with another name.
    causality, unit
        As in the FMU; the unit ``"1"`` counts as none.
    type
        A type of FMI 3; in FMI 2 the corresponding one.
    shape
        ``()`` for a scalar. Scalars ``name[i]`` or ``name[i,j]`` that form a complete array are one
        port, in FMI 2 and also in FMI 3.
    start, min, max
        Per element, row by row; ``start`` is None if the FMU gives none.
    references
        Value references: one for an array of FMI 3, one per element for scalars.
    variables
        Names of the FMU's variables, one per reference.
    """

    name: str
    causality: str
    type: str
    shape: tuple[int, ...]
    unit: str | None = None
    start: tuple[Number, ...] | None = None
    min: tuple[float, ...] = ()
    max: tuple[float, ...] = ()
    references: tuple[int, ...] = ()
    variables: tuple[str, ...] = ()

    @property
    def size(self) -> int:
        """Number of elements."""
        return math.prod(self.shape)


@dataclass(frozen=True)
class Fmu:
    """What is known about an FMU file without running it.

    Attributes
    ----------
    sha256
        SHA-256 of the file; files with equal contents are the same FMU.
    known_as
        Its identity in runs; see `sblcosim.fmus.known_as`. For other FMUs, the SHA-256.
    fmi
        2 or 3.
    identifier, token
        Stem of the binary's name, and GUID or instantiation token.
    once
        Whether a process may hold only one instance.
    library
        Name in the archive of the shared library for this machine.
    """

    path: Path
    sha256: str
    known_as: str
    fmi: int
    identifier: str
    token: str
    once: bool
    log_categories: tuple[str, ...]
    library: str
    ports: Mapping[str, Port] = field(repr=False)


def read(path: Path) -> Fmu:
    """Read the interface of an FMU file.

    Raises
    ------
    FmuError
        The file is missing, is not an FMU, cannot be read, is larger than the bounds of
        `sblcosim.fmus.read` allow, is not for Co-Simulation, or has no binary for this machine.
    """
    return unchanged.once(("read", path), lambda: _read(path))


def _read(path: Path) -> Fmu:
    with opened(path) as archive:
        known = _READ.get(archive.sha256)
        if known is None:
            description = describe(archive)
            check_interface(archive, description)
            terminals = terminals_of(archive)
            names = [v.name for v in description.modelVariables]
            named = {} if terminals is None else port_names(terminals, names)
            known = _READ[archive.sha256] = Fmu(
                path=path,
                sha256=archive.sha256,
                known_as=_known_as(archive),
                fmi=description.fmiMajorVersion,
                identifier=description.coSimulation.modelIdentifier,
                token=description.guid or "",
                once=description.coSimulation.canBeInstantiatedOnlyOncePerProcess,
                log_categories=tuple(category.name for category in description.logCategories),
                library=library_of(archive, description),
                ports=MappingProxyType(_ports(description, named)),
            )
    return known if known.path == path else replace(known, path=path)


_READ: dict[str, Fmu] = {}


def _known_as(archive: Archive) -> str:
    facts = archive.facts()
    size, _ = facts.pop(KNOWN_AS, (LONGEST + 1, 0))
    said = noted(archive.read(KNOWN_AS), facts) if size <= LONGEST else None
    return said or archive.sha256


def ports_of(variables: Iterable[Variable]) -> dict[str, Port]:
    """The ports of a Python component."""
    return {
        v.name: Port(
            name=v.name,
            causality=v.causality,
            type=v.type,
            shape=v.shape,
            unit=v.unit,
            start=v.starts,
            min=(-math.inf if v.min is None else v.min,) * v.size,
            max=(math.inf if v.max is None else v.max,) * v.size,
        )
        for v in variables
    }


def _ports(description: ModelDescription, named: Mapping[str, str]) -> dict[str, Port]:
    """All variables, with scalars ``name[i,j]`` gathered into arrays.

    ``named`` maps names of variables to other names of ports. A variable that has such a port's
    name without being the port cannot be reached.
    """
    shadowed = set(named.values()) - named.keys()
    single = [
        replace(_port(v, description.fmiMajorVersion), name=named.get(v.name, v.name))
        for v in description.modelVariables
        if v.causality != "independent" and v.name not in shadowed
    ]
    groups: dict[str, list[Port]] = {}
    for port in single:
        base = port.name if port.shape else split(port.name)[0]
        groups.setdefault(base, []).append(port)
    ports: dict[str, Port] = {}
    for base, members in groups.items():
        array = _array(base, members)
        for port in members if array is None else [array]:
            ports[port.name] = port
    return ports


def _port(variable: ModelVariable, fmi: int) -> Port:
    kind = _FMI2_TYPES[variable.type] if fmi == 2 else variable.type
    if kind == "Enumeration":
        kind = "Int64"
    shape = tuple(variable.shape or ())
    size: int = math.prod(shape)

    def attribute(name: str) -> Any:
        value = getattr(variable, name)
        return getattr(variable.declaredType, name, None) if value is None else value

    def bounds(name: str, default: float) -> tuple[float, ...]:
        value = attribute(name)
        bound = default if value is None else float(value)
        return (bound,) * size

    start: tuple[Number, ...] | None = None
    if variable.start is not None and kind in NUMBERS:
        words = variable.start.split()
        start = tuple(_number(word, kind) for word in words) * (size if len(words) == 1 else 1)
    unit = attribute("unit")
    return Port(
        name=variable.name,
        causality=variable.causality,
        type=kind,
        shape=shape,
        unit=None if unit in ("", "1") else unit,
        start=start,
        min=bounds("min", -math.inf),
        max=bounds("max", math.inf),
        references=(variable.valueReference,),
        variables=(variable.name,),
    )


def _number(text: str, kind: str) -> Number:
    if kind == "Boolean":
        return text in ("true", "1")
    return float(text) if kind.startswith("Float") else int(text)


def _array(base: str, members: Sequence[Port]) -> Port | None:
    """The array formed by scalars ``base[i,j]``; None if they do not form one."""
    indices = [split(port.name)[1] for port in members]
    alike = {(port.causality, port.type, port.unit) for port in members}
    if not all(indices) or len({len(i) for i in indices}) > 1 or len(alike) > 1:
        return None
    if any(port.shape for port in members):  # FMI 3 arrays with such names
        return None
    if min(map(min, indices)) < 1:
        return None
    shape = tuple(max(column) for column in zip(*indices, strict=True))
    if len(set(indices)) < len(members) or math.prod(shape) != len(members):
        return None
    ordered = [port for _, port in sorted(zip(indices, members, strict=True), key=lambda p: p[0])]
    starts = [port.start for port in ordered]
    first = ordered[0]
    return Port(
        name=base,
        causality=first.causality,
        type=first.type,
        shape=shape,
        unit=first.unit,
        start=tuple(s[0] for s in starts if s is not None) if None not in starts else None,
        min=tuple(port.min[0] for port in ordered),
        max=tuple(port.max[0] for port in ordered),
        references=tuple(port.references[0] for port in ordered),
        variables=tuple(port.name for port in ordered),
    )
