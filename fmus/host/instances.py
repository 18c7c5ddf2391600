"""FMU files and their instances: one view of FMI 2.0 and FMI 3.0, on FMPy.

`read` (of `sblcosim.fmus.read`) looks at a file without running anything in it. `acquire` and
`release` lend instances: an FMU is instantiated once per process and name and reset before each
further use.
"""

from __future__ import annotations

import ctypes
import os
import sys
import tempfile
import threading
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, partial
from itertools import count
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from fmpy import fmi1, fmi2, fmi3, freeLibrary
from numpy.typing import NDArray

from ..build.factory import is_build
from ..errors import FmuError, one_line
from ..files import scratch
from ..read.archive import opened
from ..read.ports import Fmu, Port, ports_of, read
from .nanoseconds import SECOND, text_of
from .watch import watch

__all__ = [
    "DTYPES",
    "WARNING",
    "Fmu",
    "Instance",
    "Port",
    "Vector",
    "acquire",
    "binary_of",
    "ports_of",
    "read",
    "release",
]

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

_FMI2_NAMES = {"Float64": "Real", "Int32": "Integer", "Boolean": "Boolean"}
_LOG_CATEGORIES = ("logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal")


_OURS: dict[str, bool] = {}


def ours(fmu: Fmu) -> bool:
    """Whether an FMU is one that this project has built; nothing in it is run to find out."""
    if fmu.sha256 not in _OURS:
        _OURS[fmu.sha256] = is_build(fmu.identifier, fmu.sha256)
    return _OURS[fmu.sha256]


def trust(sha256s: Iterable[str]) -> None:
    """Take these FMUs to be ours: whoever has sent them knows it."""
    _OURS.update(dict.fromkeys(sha256s, True))


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
            library = self._library = str(folder / fmu.library)
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
            except FmuError as error:  # some FMUs cannot be reset: the next instance is new
                if fmu.once:
                    raise FmuError(
                        f"{name}: FMU {fmu.path} allows one instance per process, which must "
                        f"bear a reset to be used again, got: {one_line(error)}"
                    ) from error
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
        folder = Path(tempfile.mkdtemp(dir=scratch()))
        with opened(fmu.path) as archive:
            if archive.sha256 != fmu.sha256:
                raise FmuError(f"{fmu.path}: must not change while it is used, got another file")
            archive.unpack(folder)
        _FOLDERS[fmu.sha256] = folder
    return folder


def binary_of(fmu: Fmu) -> Path:
    """The FMU's shared library for this machine, unpacked."""
    return _unpacked(fmu) / fmu.library


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
    name = instances[0].name
    handles = [*_OPENED.pop(instances[0]._library, ()), *(i._fmu.dll._handle for i in instances)]
    with watch().calling(name, UNLOADING):
        for handle in handles:
            if sys.platform == "win32":
                freeLibrary(handle)
            else:
                _system("dlclose", _I, _P)(handle)
