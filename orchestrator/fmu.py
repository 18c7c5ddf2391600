"""FMU files and their instances: one view of FMI 2.0 and FMI 3.0, on FMPy.

`read` looks at a file without running anything in it. `acquire` and `release` lend instances: an
FMU is instantiated once per process and name and reset before each further use.
"""

from __future__ import annotations

import atexit
import ctypes
import hashlib
import io
import math
import os
import re
import shutil
import sys
import tempfile
import threading
import zipfile
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from itertools import count
from pathlib import Path, PurePosixPath
from types import MappingProxyType
from typing import Any
from xml.etree import ElementTree as ET

import fmpy
import numpy as np
from fmpy import fmi1, fmi2, fmi3
from fmpy.model_description import ModelDescription, ModelVariable, read_model_description
from numpy.typing import NDArray
from sblcosim.fmus.factory import is_build
from sblcosim.fmus.platforms import folders, machine_of, suffix, this_platform
from sblcosim.fmus.terminals import TERMINALS, port_names
from sblcosim.models.declaration import Number, Variable

from .errors import FmuError
from .system import SECOND, text_of
from .watch import watch

Vector = NDArray[Any]
"""Values of one type, one after another."""

Call = Callable[[], int]
"""An FMI call with all its arguments bound; returns the status."""

WARNING = 1
"""The worst status (of FMI 2 and FMI 3 alike) with which a simulation may go on."""

_STATUS = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
_DISCARD = 2
_FATAL = 4

DTYPES: Mapping[str, type[np.generic]] = MappingProxyType(
    {
        "Float64": np.float64,
        "Float32": np.float32,
        "Int8": np.int8,
        "UInt8": np.uint8,
        "Int16": np.int16,
        "UInt16": np.uint16,
        "Int32": np.int32,
        "UInt32": np.uint32,
        "Int64": np.int64,
        "UInt64": np.uint64,
        "Boolean": np.bool_,
    }
)
"""The types of FMI that can be connected, set and recorded."""

_FMI2_TYPES = {
    "Real": "Float64",
    "Integer": "Int32",
    "Enumeration": "Int32",
    "Boolean": "Boolean",
    "String": "String",
}
_FMI2_NAMES = {"Float64": "Real", "Int32": "Integer", "Boolean": "Boolean"}
_INDEXED = re.compile(r"(?P<base>.+)\[(?P<indices>[1-9]\d*(?:, ?[1-9]\d*)*)\]")
_LOG_CATEGORIES = ("logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal")


@dataclass(frozen=True, slots=True)
class Port:
    """A variable of an FMU or a Python component, a scalar or an array.

    Attributes
    ----------
    name
        As in the FMU, unless one of its terminals says that it is a port of another name.
    causality, unit
        As in the FMU; a unit of ``"1"`` is none.
    type
        A type of FMI 3, in FMI 2 the one that corresponds.
    shape
        ``()`` for a scalar. In FMI 2, and in FMI 3 where variables are so named, scalars
        ``name[i]`` or ``name[i,j]`` that make up a complete array are one port.
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
        Of the file; equal contents are one FMU wherever they lie.
    fmi
        2 or 3.
    identifier, token
        Stem of the binary's name, and GUID or instantiation token.
    once
        Whether a process may hold only one instance.
    """

    path: Path
    sha256: str
    fmi: int
    identifier: str
    token: str
    once: bool
    log_categories: tuple[str, ...]
    ports: Mapping[str, Port] = field(repr=False)


def read(path: Path) -> Fmu:
    """Look at an FMU file.

    Raises
    ------
    FmuError
        The file is missing, is not an FMU, cannot be read, is not for Co-Simulation, or has no
        binary for this machine.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FmuError(f"{path}: must be an FMU file, got {error.strerror or error}") from error
    sha256 = hashlib.sha256(content).hexdigest()
    known = _READ.get(sha256)
    if known is None:
        known = _READ[sha256] = _parse(path, content, sha256)
    return known if known.path == path else Fmu(**{**vars(known), "path": path})


_READ: dict[str, Fmu] = {}


_OURS: dict[str, bool] = {}


def ours(fmu: Fmu) -> bool:
    """Whether an FMU is one that this project has built; nothing in it is run to find out."""
    if fmu.sha256 not in _OURS:
        _OURS[fmu.sha256] = is_build(fmu.identifier, fmu.sha256)
    return _OURS[fmu.sha256]


def trust(sha256s: Iterable[str]) -> None:
    """Take these FMUs to be ours: whoever has sent them knows it."""
    _OURS.update(dict.fromkeys(sha256s, True))


_DESCRIPTION = "modelDescription.xml"


def _parse(path: Path, content: bytes, sha256: str) -> Fmu:
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            names = archive.namelist()
            terminals = archive.read(TERMINALS) if TERMINALS in names else None
            xml = archive.read(_DESCRIPTION) if _DESCRIPTION in names else None
    except zipfile.BadZipFile as error:
        raise FmuError(f"{path}: is not an FMU (not a ZIP archive)") from error
    if xml is None:
        raise FmuError(f"{path}: must be an FMU, got a zip archive without modelDescription.xml")
    try:
        version = ET.fromstring(xml).get("fmiVersion", "none")
    except ET.ParseError as error:
        raise FmuError(
            f"{path}: modelDescription.xml must be well-formed XML, got: {error}"
        ) from error
    if not version.startswith(("2.", "3.")):
        raise FmuError(f"{path}: must be FMI 2.0 or 3.0, got {version}")
    try:
        description = read_model_description(io.BytesIO(content), validate=False)
        if description.fmiMajorVersion not in (2, 3):
            raise ValueError(f"FMI version {description.fmiVersion}, not 2.0 or 3.0")
        known = [v.name for v in description.modelVariables]
        named = {} if terminals is None else port_names(ET.fromstring(terminals), known)
        ports = _ports(description, named)
    except ET.ParseError as error:
        raise FmuError(f"{path}: {TERMINALS} must be well-formed XML, got: {error}") from error
    except Exception as error:  # FMPy and lxml raise all sorts, Exception itself included
        reason = " ".join(str(error).split()) or type(error).__name__
        raise FmuError(f"{path}: modelDescription.xml must be readable, got: {reason}") from error
    if description.coSimulation is None:
        offered = [
            kind
            for kind, there in (
                ("Model Exchange", description.modelExchange),
                ("Scheduled Execution", description.scheduledExecution),
            )
            if there is not None
        ]
        raise FmuError(
            f"{path}: must be an FMU for Co-Simulation, got {' and '.join(offered) or 'none'}"
        )
    fmu = Fmu(
        path=path,
        sha256=sha256,
        fmi=description.fmiMajorVersion,
        identifier=description.coSimulation.modelIdentifier,
        token=description.guid,
        once=description.coSimulation.canBeInstantiatedOnlyOncePerProcess,
        log_categories=tuple(category.name for category in description.logCategories),
        ports=MappingProxyType(ports),
    )
    binary = str(_binary(fmu, names))
    with zipfile.ZipFile(io.BytesIO(content)) as archive, archive.open(binary) as file:
        machine = machine_of(file.read(20))
    here = this_platform()
    if machine not in (None, here.partition("-")[0]):
        # Said here, as the loader of Linux only says that there is no such file.
        raise FmuError(f"{path}: must have a binary for {here}, got {binary} for {machine}")
    return fmu


def _binary(fmu: Fmu, names: Iterable[str]) -> PurePosixPath:
    """Where the FMU keeps the binary for this machine."""
    here = this_platform()
    places = folders(here, 2 if fmu.fmi == 2 else 3)
    binaries = [PurePosixPath(n) for n in names if n.startswith("binaries/") and n[-1] != "/"]
    for folder in places:
        binary = PurePosixPath("binaries", folder, fmu.identifier + suffix(here))
        if binary in binaries:
            return binary
    misnamed = [str(binary) for binary in binaries if binary.parts[1] in places]
    if misnamed:
        expected = PurePosixPath("binaries", places[0], fmu.identifier + suffix(here))
        raise FmuError(f"{fmu.path}: must have the binary {expected}, got {', '.join(misnamed)}")
    has = ", ".join(sorted({binary.parts[1] for binary in binaries})) or "no binary at all"
    raise FmuError(f"{fmu.path}: must have a binary for {places[0]}, got {has}")


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
    """All variables, scalars ``name[i,j]`` gathered to arrays.

    ``named`` has the names of ports for variables that have another name. A variable that has such
    a name without being the port cannot be reached.
    """
    shadowed = set(named.values()) - named.keys()
    single = [
        replace(_port(v, description.fmiMajorVersion), name=named.get(v.name, v.name))
        for v in description.modelVariables
        if v.causality != "independent" and v.name not in shadowed
    ]
    groups: dict[str, list[Port]] = {}
    for port in single:
        match = None if port.shape else _INDEXED.fullmatch(port.name)
        groups.setdefault(match["base"] if match else port.name, []).append(port)
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
    if variable.start is not None and kind in DTYPES:
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
    """The array that scalars ``base[i,j]`` make up; None if they do not."""
    matches = [_INDEXED.fullmatch(port.name) for port in members]
    indices = [
        tuple(int(i) for i in match["indices"].split(",")) for match in matches if match is not None
    ]
    alike = {(port.causality, port.type, port.unit, len(port.shape)) for port in members}
    if len(indices) < len(members) or len({len(i) for i in indices}) > 1 or len(alike) > 1:
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


class Instance:
    """An instance of an FMU, FMI 2 or FMI 3.

    Calls of the inner loop go straight to the FMU's C functions, with addresses that were worked
    out beforehand: FMPy's own `getReal` builds lists and takes several times as long.
    """

    def __init__(self, fmu: Fmu, name: str) -> None:
        self.fmu = fmu
        self.name = name
        self._key = next(_KEYS)
        self._log: deque[str] = deque(maxlen=5)
        _LOGS[self._key] = self._note
        folder = _unpacked(fmu)
        common = {
            "guid": fmu.token,
            "modelIdentifier": fmu.identifier,
            "unzipDirectory": str(folder),
            "instanceName": name,
        }
        here = os.getcwd()
        try:
            library = str(folder / _binary(fmu, _names(folder)))
            with watch().calling(name, LOADING):
                _load(library)
                if fmu.fmi == 2:
                    self._fmu = fmi2.FMU2Slave(libraryPath=library, **common)
                else:
                    self._fmu = fmi3.FMU3Slave(**common)
            with watch().calling(name, _INSTANTIATE[fmu.fmi]):
                if fmu.fmi == 2:
                    self._fmu.instantiate(callbacks=_callbacks(self._key), loggingOn=True)
                else:
                    self._fmu.instantiate(loggingOn=True, logMessage=partial(_log3, self._note))
        except Exception as error:  # FMPy raises Exception itself
            os.chdir(here)  # FMPy stays in the library's folder if that cannot be loaded
            reason = self.said() or str(error).replace(f"{folder}{os.sep}", "")
            raise self._blamed(
                f"{name}: {fmu.path} must load and instantiate, got: {reason}"
            ) from error
        self._component = self._fmu.component
        self._function = _functions(self._fmu.dll, fmu.fmi)
        self._quieten()
        self.usable = True

    def _note(self, status: int, message: bytes) -> None:
        """Take a message of the FMU."""
        if status >= WARNING:
            text = " ".join((message or b"")[:_LONGEST].decode(errors="replace").split())
            if text not in self._log:
                self._log.append(text)
                watch().said(self.name, "; ".join(self._log))

    def _blamed(self, message: str) -> FmuError:
        error = FmuError(message)
        error.component = self.name
        return error

    def said(self) -> str:
        """What the FMU has logged since it was asked last, the newest messages only."""
        text = "; ".join(self._log)
        self._log.clear()
        return text

    def failure(self, function: str, status: int, time_ns: int | None = None) -> FmuError:
        """The exception for a status that is worse than a warning."""
        if status == _FATAL or status >= len(_STATUS):
            self.usable = False
        label = _STATUS[status] if 0 <= status < len(_STATUS) else f"status {status}"
        when = "" if time_ns is None else f" at {text_of(time_ns)}"
        said = self.said().removeprefix(f"{self.name}: ").removeprefix(f"{function}: ")
        return self._blamed(
            f"{self.name}: {function}{when} must succeed, got {label}"
            + (f": {said}" if said else f" (FMU {self.fmu.path}, no message)")
        )

    def ended_early(self) -> int:
        """The status to report if a step went well but was not, or not to be, the whole step."""
        self._log.append("the FMU ended the simulation or the step early")
        return _DISCARD

    @property
    def handle(self) -> int:
        """Address of the instance, for C."""
        return int(self._component)

    def address(self, function: str) -> int:
        """Address of a function of the standard, for C; named in full, e.g. ``fmi2GetReal``."""
        address = ctypes.cast(self._function[function[4:]], ctypes.c_void_p).value
        assert address is not None
        return address

    def _call(self, name: str, *arguments: Any) -> None:
        """Call a function, without its prefix, outside of the loop; it must succeed."""
        function = f"fmi{self.fmu.fmi}{name}"
        with watch().calling(self.name, function):
            status = self._function[name](self._component, *arguments)
        if status > WARNING:
            raise self.failure(function, status)

    def _quieten(self) -> None:
        """Log nothing but trouble, if the FMU has the standard's categories for that."""
        wanted = [c.encode() for c in self.fmu.log_categories if c in _LOG_CATEGORIES]
        if wanted:
            categories = (ctypes.c_char_p * len(wanted))(*wanted)
            with watch().calling(self.name, f"fmi{self.fmu.fmi}SetDebugLogging"):
                self._function["SetDebugLogging"](
                    self._component, True, len(wanted), ctypes.addressof(categories)
                )

    def reset(self) -> None:
        """Back to the state after instantiation."""
        self._log.clear()
        self._call("Reset")

    def initialise(self, start_ns: int, settings: Iterable[tuple[Port, Vector]]) -> None:
        """From instantiated to ready for steps, with the given parameters set."""
        start = start_ns / SECOND
        if self.fmu.fmi == 2:
            self._call("SetupExperiment", 0, 0.0, start, 0, 0.0)
        for port, values in settings:
            function = self.function("Set", port.type)
            with watch().calling(self.name, function):
                status = self.setter(port.type, port.references, values)()
            if status > WARNING:
                error = str(self.failure(function, status))
                raise self._blamed(
                    f"{self.name}.{port.name}: {error.removeprefix(self.name + ': ')}"
                )
        arguments = (False, 0.0, start, False, 0.0) if self.fmu.fmi == 3 else ()
        self._call("EnterInitializationMode", *arguments)
        self._call("ExitInitializationMode")

    def terminate(self) -> None:
        """End of a run."""
        self._call("Terminate")

    def free(self) -> None:
        """Give the instance up; it must not be used again."""
        self.usable = False
        with watch().calling(self.name, f"fmi{self.fmu.fmi}FreeInstance"):
            self._function["FreeInstance"](self._component)

    def function(self, verb: str, kind: str) -> str:
        """Name of the function that gets or sets a type, e.g. ``fmi2GetReal``."""
        return f"fmi{self.fmu.fmi}{verb}{_FMI2_NAMES[kind] if self.fmu.fmi == 2 else kind}"

    def getter(self, kind: str, references: Sequence[int], target: Vector) -> Call:
        """A call that gets variables of one type into ``target`` (contiguous, kept alive)."""
        if kind == "Boolean" and self.fmu.fmi == 2:
            staging = np.zeros(target.size, np.int32)
            call = self._bind("Get", kind, references, staging)

            def get() -> int:
                status = call()
                target[:] = staging
                return status

            return get
        return self._bind("Get", kind, references, target)

    def setter(self, kind: str, references: Sequence[int], source: Vector) -> Call:
        """A call that sets variables of one type from ``source`` (contiguous, kept alive)."""
        if kind == "Boolean" and self.fmu.fmi == 2:
            staging = np.zeros(source.size, np.int32)
            call = self._bind("Set", kind, references, staging)

            def set_() -> int:
                staging[:] = source
                return call()

            return set_
        return self._bind("Set", kind, references, source)

    def _bind(self, verb: str, kind: str, references: Sequence[int], values: Vector) -> Call:
        function = self._function[self.function(verb, kind)[4:]]
        refs = np.array(references, np.uint32)
        arguments = [self._component, refs.ctypes.data, refs.size, values.ctypes.data]
        if self.fmu.fmi == 3:
            arguments.append(values.size)
        call = partial(function, *arguments)
        call.keep = (refs, values)  # type: ignore[attr-defined]  # the call holds addresses only
        return call

    def stepper(self, step_ns: int) -> Callable[[float], int]:
        """A call that advances by ``step_ns`` from a time in s."""
        c, function, step = self._component, self._function["DoStep"], step_ns / SECOND
        if self.fmu.fmi == 2:
            return lambda time: function(c, time, step, 1)
        event, terminate, early = ctypes.c_bool(), ctypes.c_bool(), ctypes.c_bool()
        reached = ctypes.c_double()
        places = (
            ctypes.addressof(event),
            ctypes.addressof(terminate),
            ctypes.addressof(early),
            ctypes.addressof(reached),
        )

        def step3(time: float, kept: Any = (event, reached)) -> int:
            status: int = function(c, time, step, True, *places)
            if status <= WARNING and (terminate.value or early.value):
                return self.ended_early()
            return status

        return step3


LOADING, UNLOADING = "loading", "unloading"
"""What is called no function, in messages."""
_INSTANTIATE = {2: "fmi2Instantiate", 3: "fmi3InstantiateCoSimulation"}
_LONGEST = 500
"""So many bytes of an FMU's message are kept."""

_IDLE: dict[tuple[str, str], list[Instance]] = {}
_LOCK = threading.Lock()  # FMPy changes the folder of the process while it loads a library


def acquire(fmu: Fmu, name: str) -> Instance:
    """An instance in the state after instantiation, to be given back with `release`.

    Raises
    ------
    FmuError
        The FMU cannot be loaded or instantiated.
    """
    waiting = _IDLE.setdefault(_place(fmu, name), [])
    with _LOCK:
        while waiting:
            instance = waiting.pop()
            instance.name = name
            try:
                instance.reset()
            except FmuError:  # some FMUs cannot be reset: the next instance is new
                continue
            return instance
        return Instance(fmu, name)


def release(instance: Instance) -> None:
    """Give an instance back, in whatever state it is."""
    if instance.usable:
        _IDLE.setdefault(_place(instance.fmu, instance.name), []).append(instance)


def idle() -> list[Instance]:
    """Take all instances that nobody uses."""
    with _LOCK:
        instances = [instance for place in _IDLE.values() for instance in place]
        _IDLE.clear()
    return instances


def _place(fmu: Fmu, name: str) -> tuple[str, str]:
    """Instances keep their names, by which an FMU's messages are told apart."""
    return fmu.sha256, "" if fmu.once else name


_FOLDERS: dict[str, Path] = {}


def _unpacked(fmu: Fmu) -> Path:
    """Folder with the FMU's contents, removed when the process ends."""
    folder = _FOLDERS.get(fmu.sha256)
    if folder is None:
        folder = Path(tempfile.mkdtemp(prefix="sblcosim-"))
        atexit.register(_remove, folder, os.getpid())
        try:
            fmpy.extract(fmu.path, folder)
        except Exception as error:  # FMPy raises Exception itself
            raise FmuError(f"{fmu.path}: must be possible to unpack, got: {error}") from error
        _FOLDERS[fmu.sha256] = folder
    return folder


def binary_of(fmu: Fmu) -> Path:
    """The FMU's shared library for this machine, unpacked."""
    folder = _unpacked(fmu)
    return folder / _binary(fmu, _names(folder))


def _remove(folder: Path, owner: int) -> None:
    if os.getpid() == owner:  # a forked process uses its parent's folders
        shutil.rmtree(folder, ignore_errors=True)


def _names(folder: Path) -> list[str]:
    return [f.relative_to(folder).as_posix() for f in folder.glob("binaries/*/*")]


_KEYS = count(1)
_LOGS: dict[int, Callable[[int, bytes], None]] = {}


@fmi2.fmi2CallbackLoggerTYPE  # type: ignore[untyped-decorator]
def _log2(environment: int, name: bytes, status: int, category: bytes, message: bytes) -> None:
    log = _LOGS.get(environment)
    if log is None:  # an instance that FMPy has made for somebody else
        fmi1.printLogMessage(environment, name, status, category, message)
    else:
        log(status, (message or b"").replace(b"##", b"#"))


def _log3(
    log: Callable[[int, bytes], None], environment: int, status: int, category: bytes,
    message: bytes,
) -> None:
    log(status, message)


@cache
def _logger() -> Any:
    """The logger of FMI 2, with FMPy's C function before it that formats the message.

    That C function keeps one logger for the whole process, so ours takes all messages.
    """
    callbacks = fmi2.fmi2CallbackFunctions()
    callbacks.logger = _log2
    try:
        from fmpy.logging import addLoggerProxy
    except OSError:  # no such library for this machine: messages come with their % signs
        return callbacks.logger
    addLoggerProxy(ctypes.byref(callbacks))
    return callbacks.logger


def _callbacks(key: int) -> Any:
    callbacks = fmi2.fmi2CallbackFunctions()
    callbacks.logger = _logger()
    callbacks.allocateMemory = fmi2.defaultCallbacks.allocateMemory
    callbacks.freeMemory = fmi2.defaultCallbacks.freeMemory
    callbacks.componentEnvironment = key
    return callbacks


_C, _N, _P = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p
_D, _I, _B = ctypes.c_double, ctypes.c_int, ctypes.c_bool

_SIGNATURES: Mapping[int, Mapping[str, tuple[Any, ...]]] = {
    2: {
        "SetDebugLogging": (_C, _I, _N, _P),
        "SetupExperiment": (_C, _I, _D, _D, _I, _D),
        "EnterInitializationMode": (_C,),
        "DoStep": (_C, _D, _D, _I),
        **{
            verb + kind: (_C, _P, _N, _P)
            for verb in ("Get", "Set")
            for kind in _FMI2_NAMES.values()
        },
    },
    3: {
        "SetDebugLogging": (_C, _B, _N, _P),
        "EnterInitializationMode": (_C, _B, _D, _D, _B, _D),
        "DoStep": (_C, _D, _D, _B, _P, _P, _P, _P),
        **{verb + kind: (_C, _P, _N, _P, _N) for verb in ("Get", "Set") for kind in DTYPES},
    },
}


def _functions(library: Any, fmi: int) -> dict[str, Any]:
    """The C functions in use, by name without prefix, taking addresses as plain numbers."""
    signatures = {
        "Reset": (_C,),
        "Terminate": (_C,),
        "FreeInstance": (_C,),
        "ExitInitializationMode": (_C,),
        **_SIGNATURES[fmi],
    }
    functions = {}
    for name, arguments in signatures.items():
        function = library[f"fmi{fmi}{name}"]  # a new object; FMPy's own keeps its types
        function.argtypes = arguments
        function.restype = None if name == "FreeInstance" else _I
        functions[name] = function
    return functions


_OPENED: dict[str, list[int]] = {}
"""Handles by the library's path, of those that are to be unloaded."""


def _load(library: str) -> None:
    """Load a library without Python's global lock, which ctypes would hold meanwhile."""
    if not watch().direct or sys.platform == "win32":  # on Windows it does not hold it
        return
    here = os.getcwd()
    os.chdir(os.path.dirname(library))
    try:
        handle = _system("dlopen", _P, ctypes.c_char_p, _I)(os.fsencode(library), os.RTLD_NOW)
    finally:
        os.chdir(here)
    if handle:
        _OPENED.setdefault(library, []).append(handle)


def _system(name: str, result: Any, *arguments: Any) -> Any:
    function = ctypes.CDLL(None)[name]
    function.restype, function.argtypes = result, arguments
    return function


def unload(instances: Sequence[Instance]) -> None:
    """Unload the library of instances that are all it had, and that were freed."""
    name, library = instances[0].name, str(instances[0]._fmu.dll._name)
    handles = [*_OPENED.pop(library, ()), *(i._fmu.dll._handle for i in instances)]
    with watch().calling(name, UNLOADING):
        for handle in handles:
            if sys.platform == "win32":
                fmpy.freeLibrary(handle)
            else:
                _system("dlclose", _I, _P)(handle)
