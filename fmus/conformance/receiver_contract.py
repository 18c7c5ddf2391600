"""Does an FMU honour the plug contract of a receiver?

The contract: the outputs `REQUIRED_ESTIMATE` exist. Of the other ports (`RECEPTION`, `PING_POSE`
and `DEPTH` as inputs, `ESTIMATE` and `SYSTEM` as outputs), each one that the FMU declares has the
port's name, causality, type, shape and unit. The number of beacons may be any that components can
be made for, the same everywhere. Additional outputs and missing ports are fine. An array is an FMI
3 array, or scalars ``name[i]``, ``name[i,j]`` counted from 1. If the FMU has terminals of our
kinds, these map variables to ports; otherwise the names do. CasADi is not loaded, and the FMU's
binary only on demand.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree as ET

from fmpy.model_description import ModelDescription, ModelVariable
from sblcosim.models.declaration import UNITS, Dimension, Variable
from sblcosim.models.ports import BEACONS, REQUIRED_ESTIMATE

from ..build.description import base_unit
from ..errors import FmuError, nearest
from ..read.archive import Archive, opened
from ..read.description import check_interface, describe, library_of, split, terminals_of
from ..standard import FMI2_TYPES
from ..terminals import PORTS, members, port_names
from .checks import LOADING
from .runner import PATIENCE, run, unpacked

Severity = Literal["ok", "absent", "warning", "error"]

_PORTS = {port.name: port for group in PORTS.values() for port in group}
_TYPES = {old: new for new, old in FMI2_TYPES.items()}


@dataclass(frozen=True, slots=True)
class Finding:
    """A statement about one variable, or about the FMU as a whole (``variable`` is "FMU").

    Attributes
    ----------
    severity
        ``error``: the contract is broken. ``warning``: it works, with a catch. ``absent``: an
        optional port that the FMU does not declare. ``ok``: a port that matches.
    """

    variable: str
    severity: Severity
    message: str


@dataclass(frozen=True, slots=True)
class ContractReport:
    """The findings about an FMU, variable by variable.

    Attributes
    ----------
    names
        Names of the FMU's variables, without indices, for each port that it declares. They differ
        from the port's name only if a terminal says so.
    """

    path: Path
    findings: tuple[Finding, ...]
    names: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def ok(self) -> bool:
        """Whether the FMU honours the contract."""
        return not self.of("error")

    @property
    def rows(self) -> list[tuple[str, str, str]]:
        """Variable, severity and message of each finding, for a table."""
        return [(f.variable, f.severity, f.message) for f in self.findings]

    def of(self, severity: Severity) -> tuple[Finding, ...]:
        """The findings of one severity."""
        return tuple(f for f in self.findings if f.severity == severity)

    def __str__(self) -> str:
        width = max(len(f.variable) for f in self.findings)
        lines = [f"{v:{width}}  {s:7}  {m}" for v, s, m in self.rows]
        errors, warnings = len(self.of("error")), len(self.of("warning"))
        verdict = "honours" if self.ok else "does not honour"
        return "\n".join(
            [
                *lines,
                f"{self.path.name} {verdict} the plug contract of a receiver "
                f"({_count(errors, 'error')}, {_count(warnings, 'warning')})",
            ]
        )


@dataclass(frozen=True, slots=True)
class _Declared:
    """A variable of the FMU as seen by the contract: an FMI 3 array, or scalars with indices.

    ``scalars`` holds the FMU's variables by their indices; a whole variable has the key ``()``.
    """

    scalars: Mapping[tuple[int, ...], ModelVariable]

    def values(self, attribute: str) -> set[str | None]:
        """The distinct values of an attribute over all elements."""
        return {getattr(v, attribute) for v in self.scalars.values()}

    @property
    def shape(self) -> tuple[int, ...] | None:
        """Shape of the array; None if elements are missing or have different numbers of indices."""
        if () in self.scalars:
            return tuple(self.scalars[()].shape or ()) if len(self.scalars) == 1 else None
        if len({len(indices) for indices in self.scalars}) > 1:
            return None
        shape = tuple(map(max, zip(*self.scalars, strict=True)))
        # As many elements as the port has, and none twice: that is all of them.
        complete = math.prod(shape) == len(self.scalars) and min(map(min, self.scalars)) > 0
        return shape if complete else None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the FMU's variables, without indices; more than one only through a terminal."""
        return tuple(dict.fromkeys(split(v.name)[0] for v in self.scalars.values()))


def check_receiver(path: str | Path, *, load: bool = False) -> ContractReport:
    """Check an FMU against the plug contract of a receiver.

    Parameters
    ----------
    load
        Whether to load and instantiate the FMU too, in a process of its own, as this runs its code.

    Raises
    ------
    FmuError
        There is no such file, or it cannot be read as an FMU.
    """
    path = Path(path)
    with opened(path) as archive:
        description = describe(archive)
        terminals = terminals_of(archive)
        findings = [check_kind(archive, description)]
        if load and findings[0].severity == "ok":
            findings.append(_check_binary(archive, description))
    variables = {v.name: v for v in description.modelVariables}
    named: Mapping[str, str] = {}
    if terminals is not None:
        findings += _check_members(terminals, variables)
        named = port_names(terminals, variables)
    # A variable that a terminal maps to a port takes precedence over one with the port's name.
    own = {name: v for name, v in variables.items() if name not in {*named, *named.values()}}
    declared = _declared(own | {named[name]: variables[name] for name in named})
    findings += _check_ports(declared, description)
    names = {name: declared[name].names for name in _PORTS if name in declared}
    return ContractReport(path, tuple(findings), names)


def check_variables(variables: Iterable[Variable]) -> tuple[Finding, ...]:
    """Check the variables of a component that is no FMU against the same contract."""
    declared = {
        v.name: _Declared({(): ModelVariable(v.name, 0, v.type, v.shape, unit=v.unit,
                                             causality=v.causality)})
        for v in variables
    }  # fmt: skip
    return tuple(_check_ports(declared, ModelDescription("3.0")))


def _check_ports(
    declared: Mapping[str, _Declared], description: ModelDescription
) -> Iterator[Finding]:
    """Compare all ports with the variables that have their names."""
    beacons = _beacons_of(declared)
    for name, usual in _PORTS.items():
        port = replace(usual, shape=_with_beacons(usual.shape, beacons))
        if name in declared:
            yield from _check_port(port, declared[name], description)
        elif name in REQUIRED_ESTIMATE:
            hint = nearest(name, declared.keys() - _PORTS.keys())
            yield Finding(name, "error", f"must be an output, got none{hint}")
        else:
            yield Finding(name, "absent", f"optional {port.causality}")
    for name in sorted(declared.keys() - _PORTS.keys()):
        if declared[name].values("causality") == {"input"}:
            hint = nearest(name, _PORTS.keys() - declared.keys())
            yield Finding(name, "warning", f"is not a port: will keep its start value{hint}")


def _beacons_of(declared: Mapping[str, _Declared]) -> Dimension:
    """Number of beacons a receiver is made for, from the first port that shows it."""
    for name, port in _PORTS.items():
        shape = declared[name].shape if name in declared else None
        rows = port.rows
        if rows and shape and len(shape) == len(port.shape) and rows.least <= shape[0] <= rows.most:
            return rows.of(shape[0])
    return BEACONS


def _with_beacons(shape: tuple[int, ...], beacons: Dimension) -> tuple[int, ...]:
    return tuple(beacons if isinstance(n, Dimension) else n for n in shape)


def check_kind(archive: Archive, description: ModelDescription) -> Finding:
    """Is it for Co-Simulation and for this machine?"""
    try:
        check_interface(archive, description)
        library = library_of(archive, description)
    except FmuError as error:
        return Finding("FMU", "error", str(error).removeprefix(f"{archive.path}: "))
    folder = library.split("/")[1]
    return Finding("FMU", "ok", f"FMI {description.fmiVersion} for Co-Simulation on {folder}")


def _check_binary(archive: Archive, description: ModelDescription) -> Finding:
    """Can it be loaded and instantiated? Asked in another process, which may not survive it."""
    with unpacked(archive, description) as folder:
        outcome = run(folder, LOADING, PATIENCE)
    if outcome.state == "passed":
        return Finding("binary", "ok", "loads and can be instantiated")
    if outcome.state == "blocked":
        return Finding("binary", "warning", outcome.reason)
    return Finding("binary", "error", outcome.reason)


def _check_members(
    terminals: ET.Element, variables: Mapping[str, ModelVariable]
) -> Iterator[Finding]:
    """Are the members of the terminals of our kinds variables and ports?"""
    for member in members(terminals):
        where = f"terminal {member.terminal}"
        if member.variable not in variables:
            yield Finding(
                where,
                "error",
                "must list variables of the FMU, got "
                f"{member.variable!r}{nearest(member.variable, variables)}",
            )
        elif not member.is_known:
            yield Finding(
                where,
                "warning",
                f"must list members of {member.kind} only, got "
                f"{member.port!r}{nearest(split(member.port)[0], member.known)}",
            )


def _declared(named: Mapping[str, ModelVariable]) -> Mapping[str, _Declared]:
    groups: dict[str, dict[tuple[int, ...], ModelVariable]] = {}
    for name, variable in named.items():
        base, indices = split(name)
        groups.setdefault(base, {})[indices] = variable
    return {base: _Declared(scalars) for base, scalars in groups.items()}


def _check_port(
    port: Variable, declared: _Declared, description: ModelDescription
) -> Iterator[Finding]:
    """Compare a port with the variable that has its name."""
    problems = list(_problems(port, declared, description))
    yield from problems
    if not problems:
        facts = [port.causality, port.type, *(f"[{size}]" for size in port.shape)]
        text = " ".join(facts) + (f" in {port.unit}" if port.unit else "")
        if declared.names != (port.name,):
            text += f"; {', '.join(declared.names)} by a terminal"
        yield Finding(port.name, "ok", text)


def _problems(
    port: Variable, declared: _Declared, description: ModelDescription
) -> Iterator[Finding]:
    error = Finding(port.name, "error", "")
    causalities = declared.values("causality")
    if causalities != {port.causality}:
        yield replace(error, message=f"must be an {port.causality}, got {_list(causalities)}")
    types = {_TYPES.get(t or "", t) for t in declared.values("type")}
    if types != {port.type}:
        expected = FMI2_TYPES[port.type] if description.fmiVersion == "2.0" else port.type
        wrong = _list(declared.values("type") - {expected})
        yield replace(error, message=f"must be of type {expected}, got {wrong}")
    if declared.shape is None:
        present = ", ".join(v.name for v in list(declared.scalars.values())[:8])
        yield replace(
            error,
            message=f"must have all elements of {_shape(port.shape)}, got "
            f"{present}{', …' if len(declared.scalars) > 8 else ''}",
        )
    elif declared.shape != port.shape:
        yield replace(error, message=f"must be {_shape(port.shape)}, got {_shape(declared.shape)}")
    if port.unit is not None and types == {port.type}:
        units = {_unit(v, description) for v in declared.scalars.values()} - {port.unit}
        if units - {None}:
            yield replace(error, message=f"must be in {port.unit}, got {_list(units - {None})}")
        elif units:
            yield Finding(port.name, "warning", f"must be in {port.unit}, got no unit")


def _unit(variable: ModelVariable, description: ModelDescription) -> str | None:
    """The unit of a variable, under our name for it if we know it by another name."""
    name: str | None = variable.unit
    if name is None and variable.declaredType is not None:
        name = variable.declaredType.unit
    for definition in description.unitDefinitions:
        base = definition.baseUnit
        if definition.name != name or base is None:
            continue
        exponents = {
            k: n for k in ("kg", "m", "s", "A", "K", "mol", "cd", "rad") if (n := getattr(base, k))
        }
        for unit in UNITS.values():
            if (base_unit(unit.name), 1.0, 0.0) == (exponents, base.factor, base.offset):
                return unit.name
        return f"{name} (by its definition)" if name in UNITS else name
    return name


def _shape(shape: tuple[int, ...]) -> str:
    return "an array of " + " by ".join(map(str, shape)) if shape else "a scalar"


def _list(values: set[str | None]) -> str:
    return ", ".join(sorted(str(v) for v in values))


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"
