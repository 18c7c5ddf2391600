"""Does an FMU honour the plug contract of a receiver?

The contract: the outputs `REQUIRED_ESTIMATE` are there; of the other ports (`RECEPTION` and
`DEPTH` as inputs, `ESTIMATE` as outputs) each one that the FMU declares has the port's name,
causality, type, shape and unit. Further outputs and ports left out are fine. An array is an FMI 3
array, or scalars ``name[i]``, ``name[i,j]`` counted from 1. Where the FMU has terminals of our
kinds, these say which variable is which port; elsewhere the names do. CasADi is not loaded, and the
FMU's binary only on demand.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tempfile
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree as ET

from fmpy import extract
from fmpy.model_description import ModelDescription, ModelVariable, read_model_description
from fmpy.validation import validate_fmu
from sblcosim.models.declaration import UNITS, Variable
from sblcosim.models.ports import REQUIRED_ESTIMATE

from .archive import DESCRIPTION
from .description import FMI2_TYPES
from .errors import FmuError, nearest
from .factory import fmi_headers
from .platforms import folders, suffix, this_platform
from .terminals import PORTS, TERMINALS, members, port_names

Severity = Literal["ok", "absent", "warning", "error"]

_PORTS = {port.name: port for group in PORTS.values() for port in group}
_TYPES = {old: new for new, old in FMI2_TYPES.items()}
_PATIENCE = 60.0
"""Seconds that a binary has to load."""
_ELEMENT = re.compile(r"(?P<base>.+)\[(?P<indices>\d+(\s*,\s*\d+)*)\]")


@dataclass(frozen=True, slots=True)
class Finding:
    """What was found about one variable, or about the FMU as a whole (``variable`` is "FMU").

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
class Report:
    """The findings about an FMU, variable by variable.

    Attributes
    ----------
    names
        Names of the FMU's variables, without indices, for each port that it declares. They differ
        from the port's only where a terminal says so.
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
    """A variable of the FMU as the contract sees it: an FMI 3 array, or scalars with indices.

    ``scalars`` holds the FMU's variables by their indices; a whole variable has the key ``()``.
    """

    scalars: Mapping[tuple[int, ...], ModelVariable]

    def values(self, attribute: str) -> set[str | None]:
        """The different values of an attribute over all elements."""
        return {getattr(v, attribute) for v in self.scalars.values()}

    @property
    def shape(self) -> tuple[int, ...] | None:
        """Shape of the array; None if elements are missing or have an unequal number of indices."""
        if () in self.scalars:
            return tuple(self.scalars[()].shape or ()) if len(self.scalars) == 1 else None
        if len({len(indices) for indices in self.scalars}) > 1:
            return None
        shape = tuple(map(max, zip(*self.scalars, strict=True)))
        complete = product(*(range(1, size + 1) for size in shape))
        return shape if set(complete) == set(self.scalars) else None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the FMU's variables, without indices; more than one only by a terminal."""
        return tuple(dict.fromkeys(_split(v.name)[0] for v in self.scalars.values()))


def check_receiver(path: str | Path, *, load: bool = False) -> Report:
    """Check an FMU against the plug contract of a receiver.

    Parameters
    ----------
    load
        Whether to load the FMU's binary, too; in a process of its own, as loading runs code of it.

    Raises
    ------
    FmuError
        There is no such file, or it cannot be read as an FMU.
    """
    path = Path(path)
    description, files, terminals = read_fmu(path)
    findings = list(check_kind(description, files))
    if load and not any(f.severity == "error" for f in findings):
        findings.append(_check_binary(path, description, files))
    variables = {v.name: v for v in description.modelVariables}
    named: Mapping[str, str] = {}
    if terminals is not None:
        findings += _check_members(terminals, variables)
        named = port_names(terminals, variables)
    # A variable without a terminal gives way to one that has its name by a terminal.
    own = {name: v for name, v in variables.items() if name not in {*named, *named.values()}}
    declared = _declared(own | {named[name]: variables[name] for name in named})
    findings += _check_ports(declared, description)
    names = {name: declared[name].names for name in _PORTS if name in declared}
    return Report(path, tuple(findings), names)


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
    for name, port in _PORTS.items():
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


def read_fmu(path: Path) -> tuple[ModelDescription, Sequence[str], ET.Element | None]:
    """Model description, names of all files, and terminals of an FMU."""
    if not os.path.isfile(path):
        got = "a folder" if os.path.isdir(path) else "no file"
        raise FmuError(f"{path}: must be an FMU, got {got}")
    try:
        with path.open("rb") as file:
            packed = zipfile.is_zipfile(file)
    except OSError as error:
        raise FmuError(
            f"{path}: must be a file that can be read, got {error.strerror}"
        ) from error
    if not packed:
        raise FmuError(f"{path}: is not an FMU (not a ZIP archive)")
    try:
        with zipfile.ZipFile(path) as archive:
            files = archive.namelist()
            if DESCRIPTION not in files:
                raise FmuError(
                    f"{path}: must contain {DESCRIPTION}, got only "
                    f"{_count(len(files), 'other file')}"
                )
            version = ET.fromstring(archive.read(DESCRIPTION)).get("fmiVersion", "no version")
            terminals = ET.fromstring(archive.read(TERMINALS)) if TERMINALS in files else None
    except (zipfile.BadZipFile, zlib.error, OSError, RuntimeError) as error:
        raise FmuError(f"{path}: must be an intact ZIP archive, got {_line(error)}") from error
    except ET.ParseError as error:
        raise FmuError(f"{path}: must hold well-formed XML, got {_line(error)}") from error
    if version != "2.0" and not version.startswith("3."):
        raise FmuError(f"{path}: must be FMI 2.0 or 3.0, got {version}")
    try:
        description = read_model_description(str(path), validate=False)
    except Exception as error:  # FMPy passes on whatever the defect happens to cause
        problem = next(iter(validate_fmu(str(path))), _line(error))
        raise FmuError(f"{path}: must have a valid {DESCRIPTION}, got {problem}") from error
    return description, files, terminals


def _line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def binary_files(description: ModelDescription) -> dict[str, str]:
    """Where the binary for this machine may be, by the name of its folder."""
    assert description.coSimulation is not None
    identifier = description.coSimulation.modelIdentifier
    names = folders(this_platform(), 2 if description.fmiVersion == "2.0" else 3)
    return {name: f"binaries/{name}/{identifier}{suffix(name)}" for name in names}


_LOAD = """
import ctypes, os, sys
os.chdir(os.path.dirname(sys.argv[1]))
try:
    library = ctypes.CDLL(sys.argv[1])
except OSError as error:
    sys.exit(str(error))
missing = [name for name in sys.argv[2:] if not hasattr(library, name)]
if missing:
    more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
    sys.exit("the standard asks for functions that it lacks: " + ", ".join(missing[:3]) + more)
os._exit(77)
"""
_LOADED = 77
"""Exit code if all is well; an FMU that ends the process will say something else."""


def functions_of(description: ModelDescription) -> tuple[str, ...]:
    """The functions that the standard's header has for the FMU's kinds of interface."""
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



def _check_binary(path: Path, description: ModelDescription, files: Sequence[str]) -> Finding:
    """Does the binary load, and is it one of an FMU? Asked in another process: it may crash."""
    name = next(name for name in binary_files(description).values() if name in files)
    with tempfile.TemporaryDirectory(prefix="sblcosim-", ignore_cleanup_errors=True) as folder:
        try:
            extract(path, folder)
            binary = Path(folder, name)
            wanted = functions_of(description)
            done = subprocess.run(
                [sys.executable, "-I", "-c", _LOAD, str(binary), *wanted],
                capture_output=True,
                text=True,
                errors="replace",
                timeout=_PATIENCE,
                check=False,
            )
        except subprocess.TimeoutExpired:
            problem = f"it has not loaded after {_PATIENCE:g} s"
        except Exception as error:  # FMPy raises Exception itself
            problem = _line(error)
        else:
            if done.returncode == _LOADED:
                return Finding("binary", "ok", "loads")
            problem = " ".join(done.stderr.split())
            if not problem or done.returncode != 1:  # what Python's own errors end with
                problem = f"it ended the process (exit code {done.returncode})"
            if done.returncode < 0:
                problem = f"it crashed ({signal.Signals(-done.returncode).name})"
        # A loader names the file that it cannot load, whose folder is gone by now.
        problem = problem.replace(f"{folder}{os.sep}", "").removeprefix(f"{name}: ")
    return Finding("binary", "error", f"does not load: {problem}")


def check_kind(description: ModelDescription, files: Sequence[str]) -> Iterator[Finding]:
    """Is it for Co-Simulation and for this machine?"""
    if description.coSimulation is None:
        yield Finding("FMU", "error", "must be for Co-Simulation, got another interface")
        return
    binaries = binary_files(description)
    folder = next(iter(binaries))
    if any(binary in files for binary in binaries.values()):
        yield Finding("FMU", "ok", f"FMI {description.fmiVersion} for Co-Simulation on {folder}")
    else:
        others = sorted({f.split("/")[1] for f in files if re.match(r"binaries/[^/]+/.", f)})
        yield Finding(
            "FMU",
            "error",
            f"must have a binary for this machine ({folder}), got "
            + (", ".join(others) if others else "none"),
        )


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
                f"{member.port!r}{nearest(_split(member.port)[0], member.known)}",
            )


def _split(name: str) -> tuple[str, tuple[int, ...]]:
    """``x[1,2]`` is ``("x", (1, 2))``."""
    match = _ELEMENT.fullmatch(name)
    if match is None:
        return name, ()
    return match["base"], tuple(int(index) for index in match["indices"].split(","))


def _declared(named: Mapping[str, ModelVariable]) -> Mapping[str, _Declared]:
    groups: dict[str, dict[tuple[int, ...], ModelVariable]] = {}
    for name, variable in named.items():
        base, indices = _split(name)
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
    found = Finding(port.name, "error", "")
    causalities = declared.values("causality")
    if causalities != {port.causality}:
        yield replace(found, message=f"must be an {port.causality}, got {_list(causalities)}")
    types = {_TYPES.get(t or "", t) for t in declared.values("type")}
    if types != {port.type}:
        expected = FMI2_TYPES[port.type] if description.fmiVersion == "2.0" else port.type
        wrong = _list(declared.values("type") - {expected})
        yield replace(found, message=f"must be of type {expected}, got {wrong}")
    if declared.shape is None:
        present = ", ".join(v.name for v in list(declared.scalars.values())[:8])
        yield replace(
            found,
            message=f"must have all elements of {_shape(port.shape)}, got "
            f"{present}{', …' if len(declared.scalars) > 8 else ''}",
        )
    elif declared.shape != port.shape:
        yield replace(found, message=f"must be {_shape(port.shape)}, got {_shape(declared.shape)}")
    if port.unit is not None and types == {port.type}:
        units = {_unit(v, description) for v in declared.scalars.values()} - {port.unit}
        if units - {None}:
            yield replace(found, message=f"must be in {port.unit}, got {_list(units - {None})}")
        elif units:
            yield Finding(port.name, "warning", f"must be in {port.unit}, got no unit")


def _unit(variable: ModelVariable, description: ModelDescription) -> str | None:
    """The unit of a variable, by our name for it if it is one that we know by another name."""
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
            if (dict(unit.exponents), 1.0, 0.0) == (exponents, base.factor, base.offset):
                return unit.name
        return f"{name} (by its definition)" if name in UNITS else name
    return name


def _shape(shape: tuple[int, ...]) -> str:
    return "an array of " + " by ".join(map(str, shape)) if shape else "a scalar"


def _list(values: set[str | None]) -> str:
    return ", ".join(sorted(str(v) for v in values))


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"
