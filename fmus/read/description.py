"""The XML files of an FMU, read within bounds and by FMPy.

The parts that this package uses are known to be sound after reading: references, bounds, start
values and sizes are numbers of their types.
"""

from __future__ import annotations

import io
import math
import re
import zipfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import PurePosixPath
from typing import Any
from xml.etree import ElementTree as ET
from xml.parsers import expat

from fmpy.model_description import ModelDescription, ModelVariable, read_model_description

from ..errors import FmuError, one_line
from ..files import working_directory_problem
from ..platforms import folders, machine_of, suffix, this_platform
from ..terminals import TERMINALS
from .archive import Archive, shown

DESCRIPTION = "modelDescription.xml"
"""Name of the description in an FMU."""

MAX_ITEMS = 2_000_000
"""Maximum number of elements, attributes and list entries in an XML file: its cost of reading."""
MAX_DEPTH = 100
"""Maximum nesting of elements in an XML file."""
MAX_VARIABLES = 100_000
"""Maximum number of variables of an FMU."""
MAX_ELEMENTS = 1_000_000
"""Maximum number of elements of all arrays of an FMU together, and largest index of an element."""

INTEGERS = {
    **{f"{sign}Int{bits}": (low, high) for bits in (8, 16, 32, 64) for sign, low, high in (
        ("", -(2 ** (bits - 1)), 2 ** (bits - 1) - 1), ("U", 0, 2**bits - 1))},
    "Integer": (-(2**31), 2**31 - 1),
    "Enumeration": (-(2**63), 2**63 - 1),
}  # fmt: skip
"""Smallest and largest values of the whole-number types of both versions of FMI."""
_REAL = ("Real", "Float64", "Float32")
_LISTS = ("start", "dependencies", "dependenciesKind", "clocks")
_REFERENCE = 2**32
INDEXED = re.compile(r"(?P<base>.+)\[(?P<indices>\d+(\s*,\s*\d+)*)\]")
"""Name of an element of an array that FMI 2 has as scalars, ``x[1,2]``."""


class DescriptionError(FmuError):
    """The FMU's archive is intact, but its model description is not."""


def describe(archive: Archive) -> ModelDescription:
    """The model description of an FMU of FMI 2.0 or 3.0.

    Raises
    ------
    DescriptionError
        It is missing, larger than the bounds, or not sound.
    FmuError
        It belongs to another version of FMI, or the archive is damaged.
    """
    path = archive.path
    if DESCRIPTION not in archive.names:
        others = f"{len(archive.names)} other file{'' if len(archive.names) == 1 else 's'}"
        raise FmuError(f"{path}: must contain {DESCRIPTION}, got only {others}")
    xml = archive.read(DESCRIPTION)
    try:
        version = _check_xml(xml)
    except ValueError as error:
        raise DescriptionError(f"{path}: {DESCRIPTION} must be {error}") from error
    if version != "2.0" and not re.fullmatch(r"3\.\d+(\D.*)?", version):
        raise FmuError(f"{path}: must be FMI 2.0 or 3.0, got {shown(version)}")
    try:
        description = _by_fmpy(xml)
        for problem in _problems(description):
            raise ValueError(problem)
    except UnicodeEncodeError as error:  # lxml asks for the working directory
        raise FmuError(working_directory_problem() or one_line(error)) from error
    except Exception as error:  # FMPy and lxml raise many types, including Exception itself
        reason = one_line(error)
        raise DescriptionError(
            f"{path}: {DESCRIPTION} must be valid, got: {shown(reason, 200)}"
        ) from error
    return description


def terminals_of(archive: Archive) -> ET.Element | None:
    """The terminals of an FMU; None if it has none.

    Raises
    ------
    FmuError
        Their file is damaged, larger than the bounds, or no XML.
    """
    return parsed(archive, TERMINALS) if TERMINALS in archive.names else None


def parsed(archive: Archive, name: str) -> ET.Element:
    """An XML file of an archive.

    Raises
    ------
    FmuError
        It is damaged, larger than the bounds, or no XML.
    """
    xml = archive.read(name)
    try:
        _check_xml(xml)
        return ET.fromstring(xml)
    except ET.ParseError as error:  # from its namespaces
        raise FmuError(
            f"{archive.path}: {shown(name)} must be well-formed XML, got {shown(str(error))}"
        ) from error
    except ValueError as error:
        raise FmuError(f"{archive.path}: {shown(name)} must be {error}") from error


def _check_xml(xml: bytes) -> str:
    """Read XML without keeping it, and return the ``fmiVersion`` of its root.

    Raises
    ------
    ValueError
        States what it should be: well-formed, without a DTD (which can expand hugely), or smaller.
    """
    depth = items = variables = 0
    version: str | None = None

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal depth, items, variables, version
        if version is None:
            version = attributes.get("fmiVersion", "no version")
        depth += 1
        items += 1 + len(attributes)
        for listed in _LISTS:
            if listed in attributes:
                items += attributes[listed].count(" ")
        if depth > MAX_DEPTH:
            raise ValueError(f"nested at most {MAX_DEPTH} elements deep")
        if items > MAX_ITEMS:
            raise ValueError(
                f"at most {MAX_ITEMS:,} elements, attributes and entries of lists, got more"
            )

    def end(name: str) -> None:
        nonlocal depth
        depth -= 1

    def doctype(*_: Any) -> None:
        raise ValueError("XML without a document type declaration, got one")

    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(xml, True)
    except (expat.ExpatError, LookupError) as error:
        raise ValueError(f"well-formed XML, got {shown(str(error))}") from error
    assert version is not None
    return version


def _by_fmpy(xml: bytes) -> ModelDescription:
    """FMPy's reading of a description, from an archive with nothing else in it."""
    alone = io.BytesIO()
    with zipfile.ZipFile(alone, "w") as archive:
        archive.writestr(DESCRIPTION, xml)
    return read_model_description(alone, validate=False)


def _problems(description: ModelDescription) -> Iterator[str]:
    """Problems that this package cannot handle; FMPy keeps most values as text."""
    variables = description.modelVariables
    if len(variables) > MAX_VARIABLES:
        yield f"{len(variables):,} variables, more than {MAX_VARIABLES:,}"
    elements = 0
    for variable in variables:
        for problem in _of_variable(variable):
            yield f"variable {shown(variable.name)}: {problem}"
        elements += math.prod(variable.shape or ())
        if elements > MAX_ELEMENTS:
            yield (
                f"variable {shown(variable.name)}: more than {MAX_ELEMENTS:,} elements of all "
                "variables up to it"
            )
    for name in ("startTime", "stopTime", "stepSize", "tolerance"):
        value = getattr(description.defaultExperiment, name, None)
        if value is not None and not _is(float, value):
            yield f"{name} of the default experiment is no number: {shown(value)}"
    kind = description.coSimulation
    internal = None if kind is None else kind.fixedInternalStepSize
    if internal is not None and not _is(float, internal):
        yield f"fixedInternalStepSize is no number: {shown(str(internal))}"
    identifier = "none" if kind is None else kind.modelIdentifier or ""
    if not identifier or not identifier.isprintable() or re.search(r"[/\\:]", identifier):
        yield f"modelIdentifier is no file name: {shown(identifier)}"


def _of_variable(variable: ModelVariable) -> Iterator[str]:
    if not 0 <= variable.valueReference < _REFERENCE:
        got = shown(str(variable.valueReference))
        yield f"its value reference is not from 0 to 2^32 - 1: {got}"
    for length in variable.shape or ():
        if not 0 <= length <= MAX_ELEMENTS:
            yield f"a dimension is not from 0 to {MAX_ELEMENTS:,}: {shown(str(length))}"
    size = math.prod(variable.shape or ())
    if size > MAX_ELEMENTS:
        yield f"it has more than {MAX_ELEMENTS:,} elements"
    kind = variable.type
    if kind in _REAL:
        read: Callable[[str], Any] = float
        low, high = -math.inf, math.inf
    elif kind in INTEGERS:
        read = int
        low, high = INTEGERS[kind]
    else:
        return
    for name in ("min", "max"):
        value = getattr(variable, name)
        if value is None:
            value = getattr(variable.declaredType, name, None)
        if value is not None and not _is(float, value):
            yield f"its {name} is no number: {shown(value)}"
    words = (variable.start or "").split()
    for word in words:
        if not _is(read, word):
            yield f"its start is no number of type {kind}: {shown(word)}"
        elif not (low <= read(word) <= high or read is float):
            yield f"its start is out of the range of {kind}: {shown(word)}"
    if variable.start is not None and len(words) not in (1, size):
        yield f"its start has {len(words):,} values for {size:,} elements"


def _is(read: Callable[[str], Any], text: str) -> bool:
    try:
        read(text)
    except (ValueError, TypeError):
        return False
    return True


def split(name: str) -> tuple[str, tuple[int, ...]]:
    """``x[1,2]`` becomes ``("x", (1, 2))``; a name without indices has none."""
    match = INDEXED.fullmatch(name)
    # Digits beyond any possible index are part of the name, however many there are.
    if match is None or any(len(i) > 9 for i in re.findall(r"\d+", match["indices"])):
        return name, ()
    return match["base"], tuple(int(index) for index in match["indices"].split(","))


def interfaces(description: ModelDescription) -> list[str]:
    """Kinds of the FMU, in the words of the standard."""
    kinds = {
        "Co-Simulation": description.coSimulation,
        "Model Exchange": description.modelExchange,
        "Scheduled Execution": description.scheduledExecution,
    }
    return [kind for kind, element in kinds.items() if element is not None]


def check_interface(archive: Archive, description: ModelDescription) -> None:
    """Refuse an FMU that is not for Co-Simulation.

    Raises
    ------
    FmuError
        States the kinds of the FMU.
    """
    if description.coSimulation is None:
        raise FmuError(
            f"{archive.path}: must be an FMU for Co-Simulation, got "
            f"{' and '.join(interfaces(description)) or 'none'}"
        )


def library_of(archive: Archive, description: ModelDescription) -> str:
    """Name in the archive of the shared library for this machine.

    Raises
    ------
    FmuError
        There is none; the message names what exists instead, including libraries with other names.
    """
    name = library_in(
        archive.names, description.fmiMajorVersion, description.coSimulation.modelIdentifier,
        str(archive.path),
    )  # fmt: skip
    machine = machine_of(archive.start(name, 20))
    here = this_platform()
    if machine not in (None, here.partition("-")[0]):
        # Checked here, because the loader of Linux only says that there is no such file.
        raise FmuError(f"{archive.path}: must have a binary for {here}, got {name} for {machine}")
    return name


def library_in(names: Iterable[str], fmi: int, identifier: str, fmu: str) -> str:
    """`library_of`, from the names of the files alone."""
    here = this_platform()
    allowed = folders(here, 2 if fmi == 2 else 3)
    paths = [PurePosixPath(name) for name in names if name[-1] != "/"]
    binaries = [path for path in paths if path.parts[0] == "binaries" and len(path.parts) > 2]
    expected = [PurePosixPath("binaries", name, identifier + suffix(here)) for name in allowed]
    for path in expected:
        if path in binaries:
            return str(path)
    misnamed = [str(path) for path in binaries if path.parts[1] in allowed]
    if misnamed:
        wanted = shown(str(expected[0]), 200)
        got = ", ".join(misnamed[:3]) + ", …" * (len(misnamed) > 3)
        raise FmuError(f"{fmu}: must have the binary {wanted}, got {shown(got, 200)}")
    others = ", ".join(sorted({path.parts[1] for path in binaries})) or "no binary at all"
    raise FmuError(f"{fmu}: must have a binary for {allowed[0]}, got {shown(others, 200)}")
