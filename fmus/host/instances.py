"""Instances of FMUs: one interface to FMI 2.0 and FMI 3.0, based on FMPy.

`acquire` and `release` lend instances. An FMU is instantiated once per process and name, and reset
before each further use.
"""

from __future__ import annotations

import ctypes
import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import chain
from types import MappingProxyType
from typing import Any

import numpy as np
from fmpy import fmi2, fmi3
from numpy.typing import NDArray

from ..errors import FmuError, one_line
from ..read.ports import NUMBERS, Fmu, Port
from ..standard import FMI2_TYPES
from . import libraries, logs
from .log_lines import line
from .nanoseconds import SECOND, text_of
from .signatures import C_TYPES, DISCARD, FATAL, PENDING, WARNING, accessor, exported, status_text
from .watch import watch

__all__ = ["DTYPES", "LOADING", "UNLOADING", "WARNING", "Call", "Instance", "Vector", "acquire",
           "idle", "release", "unload"]

Vector = NDArray[Any]
"""Values of one type, one after another."""

Call = Callable[[], int]
"""An FMI call with all its arguments bound; returns the status."""

DTYPES: Mapping[str, type[np.generic]] = MappingProxyType(
    {name: np.dtype(C_TYPES[3][name]).type for name in NUMBERS}
)
"""FMI types that can be connected, set and recorded, with their NumPy types."""

LOADING, UNLOADING = "loading", "unloading"
"""Text in messages in place of a function's name."""

_INSTANTIATE = {2: "fmi2Instantiate", 3: "fmi3InstantiateCoSimulation"}
_LOG_CATEGORIES = ("logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal")


class Instance:
    """An instance of an FMU, FMI 2 or FMI 3.

    Calls of the inner loop go directly to the FMU's C functions, with addresses computed
    beforehand. FMPy's own `getReal` builds lists and takes several times as long.
    """

    def __init__(self, fmu: Fmu, name: str) -> None:
        self.fmu = fmu
        self.name = name
        self._log: deque[str] = deque(maxlen=5)
        folder = libraries.unpacked(fmu)
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
                libraries.load(library)
                if fmu.fmi == 2:
                    self._fmu = fmi2.FMU2Slave(libraryPath=library, **common)
                else:
                    self._fmu = fmi3.FMU3Slave(**common)
            with watch().calling(name, _INSTANTIATE[fmu.fmi]):
                if fmu.fmi == 2:
                    callbacks = logs.callbacks(self._note, name)
                    self._fmu.instantiate(callbacks=callbacks, loggingOn=True)
                else:
                    self._fmu.instantiate(loggingOn=True, logMessage=logs.logger3(self._note))
        except Exception as error:  # FMPy raises Exception itself
            os.chdir(here)  # FMPy stays in the library's folder if loading fails
            reason = self.said() or str(error).replace(f"{folder}{os.sep}", "")
            raise self._blamed(
                f"{name}: {fmu.path} must load and instantiate, got: {reason}"
            ) from error
        self._component = self._fmu.component
        self._function = _functions(self._fmu.dll, fmu.fmi)
        self._quieten()
        self.usable = True

    def _note(self, status: int, message: bytes) -> None:
        """Receive a message of the FMU."""
        if status >= WARNING:
            text = line(message, self._name_of if self.fmu.fmi == 2 else None)
            if text not in self._log:
                self._log.append(text)
                watch().said(self.name, "; ".join(self._log))

    def _name_of(self, kind: str, reference: int) -> str | None:
        """The variable of an FMI 2 type with a value reference."""
        for port in self.fmu.ports.values():
            if FMI2_TYPES.get(port.type, port.type) == kind and reference in port.references:
                return port.variables[port.references.index(reference)]
        return None

    def _blamed(self, message: str) -> FmuError:
        error = FmuError(message)
        error.component = self.name
        return error

    def said(self) -> str:
        """Messages of the FMU since the last call; only the newest ones."""
        text = "; ".join(self._log)
        self._log.clear()
        return text

    def failure(self, function: str, status: int, time_ns: int | None = None) -> FmuError:
        """The exception for a status that is worse than a warning."""
        if status == FATAL or status > PENDING:
            self.usable = False
        when = "" if time_ns is None else f" at {text_of(time_ns)}"
        said = self.said().removeprefix(f"{self.name}: ").removeprefix(f"{function}: ")
        return self._blamed(
            f"{self.name}: {function}{when} must succeed, got {status_text(status)}"
            + (f": {said}" if said else f" (FMU {self.fmu.path}, no message)")
        )

    def ended_early(self) -> int:
        """The status to report if a step succeeded but was incomplete, or must not be complete."""
        self._log.append("the FMU ended the simulation or the step early")
        return DISCARD

    @property
    def handle(self) -> int:
        """Address of the instance, for C."""
        return int(self._component)

    def address(self, function: str) -> int:
        """Address of a function of the standard, for C; by its full name (``fmi2GetReal``)."""
        address = ctypes.cast(self._function[function[4:]], ctypes.c_void_p).value
        assert address is not None
        return address

    def _call(self, name: str, *arguments: Any) -> None:
        """Call a function, by its name without prefix, outside the loop; it must succeed."""
        function = f"fmi{self.fmu.fmi}{name}"
        with watch().calling(self.name, function):
            status = self._function[name](self._component, *arguments)
        if status > WARNING:
            raise self.failure(function, status)

    def _quieten(self) -> None:
        """Log only problems, if the FMU has the standard's categories for this."""
        wanted = [c.encode() for c in self.fmu.log_categories if c in _LOG_CATEGORIES]
        if wanted:
            categories = (ctypes.c_char_p * len(wanted))(*wanted)
            with watch().calling(self.name, f"fmi{self.fmu.fmi}SetDebugLogging"):
                self._function["SetDebugLogging"](
                    self._component, True, len(wanted), ctypes.addressof(categories)
                )

    def reset(self) -> None:
        """Return to the state after instantiation."""
        self._log.clear()
        self._call("Reset")

    def initialise(
        self,
        start_ns: int,
        settings: Iterable[tuple[Port, Vector]],
        texts: Iterable[tuple[Port, str]] = (),
    ) -> None:
        """From instantiated to ready for steps, with the given parameters and texts set."""
        start = start_ns / SECOND
        if self.fmu.fmi == 2:
            self._call("SetupExperiment", 0, 0.0, start, 0, 0.0)
        given = [*settings]
        if libraries.ours(self.fmu) and self._set_together(given):
            given = []
        calls = [
            *((port, self.setter(port.type, port.references, values)) for port, values in given),
            *((port, self._text_setter(port, text)) for port, text in texts),
        ]
        for port, call in calls:
            function = self.function("Set", port.type)
            with watch().calling(self.name, function):
                status = call()
            if status > WARNING:
                error = str(self.failure(function, status))
                raise self._blamed(
                    f"{self.name}.{port.name}: {error.removeprefix(self.name + ': ')}"
                )
        arguments = (False, 0.0, start, False, 0.0) if self.fmu.fmi == 3 else ()
        self._call("EnterInitializationMode", *arguments)
        self._call("ExitInitializationMode")

    def _set_together(self, settings: Sequence[tuple[Port, Vector]]) -> bool:
        """Set parameters with one call per type; False: one is refused and must be identified.

        One of our FMUs that refuses a call stays unchanged.
        """
        for kind in {port.type for port, _ in settings}:
            own = [(port, values) for port, values in settings if port.type == kind]
            references = [r for port, _ in own for r in port.references]
            with watch().calling(self.name, self.function("Set", kind)):
                values = np.concatenate([values for _, values in own])
                if self.setter(kind, references, values)() > WARNING:
                    return False
        return True

    def terminate(self) -> None:
        """End of a run."""
        self._call("Terminate")

    def free(self) -> None:
        """Free the instance; it must not be used again."""
        self.usable = False
        with watch().calling(self.name, f"fmi{self.fmu.fmi}FreeInstance"):
            self._function["FreeInstance"](self._component)

    def function(self, verb: str, kind: str) -> str:
        """Name of the function that gets or sets a type, for example ``fmi2GetReal``."""
        name = f"{verb}String" if kind == "String" else accessor(self.fmu.fmi, verb, kind)
        return f"fmi{self.fmu.fmi}{name}"

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

    def _text_setter(self, port: Port, text: str) -> Call:
        """A call that sets a variable consisting of a single text."""
        value = (ctypes.c_char_p * 1)(text.encode())
        refs = np.array(port.references, np.uint32)
        function = exported(self._fmu.dll, self.fmu.fmi, "SetString")
        more = (1,) if self.fmu.fmi == 3 else ()
        call = partial(
            function, self._component, refs.ctypes.data, 1, ctypes.addressof(value), *more
        )
        call.keep = (refs, value)  # type: ignore[attr-defined]  # the call holds addresses only
        return call

    def _bind(self, verb: str, kind: str, references: Sequence[int], values: Vector) -> Call:
        function = self._function[accessor(self.fmu.fmi, verb, kind)]
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
        results = tuple(ctypes.addressof(result) for result in (event, terminate, early, reached))

        def step3(time: float, kept: Any = (event, reached)) -> int:
            status: int = function(c, time, step, True, *results)
            if status <= WARNING and (terminate.value or early.value):
                return self.ended_early()
            return status

        return step3


_IDLE: dict[tuple[str, str], list[Instance]] = {}
_LOCK = threading.Lock()  # FMPy changes the folder of the process while loading a library


def acquire(fmu: Fmu, name: str) -> Instance:
    """An instance in the state after instantiation, to be returned with `release`.

    Raises
    ------
    FmuError
        The FMU cannot be loaded or instantiated.
    """
    waiting = _IDLE.setdefault(_slot(fmu, name), [])
    with _LOCK:
        while waiting:
            instance = waiting.pop()
            instance.name = name
            try:
                instance.reset()
            except FmuError as error:  # some FMUs cannot be reset: make a new instance
                if fmu.once:
                    raise FmuError(
                        f"{name}: FMU {fmu.path} allows one instance per process, so it must "
                        f"accept a reset to be used again, got: {one_line(error)}"
                    ) from error
                continue
            return instance
        return Instance(fmu, name)


def release(instance: Instance) -> None:
    """Return an instance, in whatever state it is."""
    if instance.usable:
        _IDLE.setdefault(_slot(instance.fmu, instance.name), []).append(instance)


def idle() -> list[Instance]:
    """Take all unused instances."""
    with _LOCK:
        instances = list(chain.from_iterable(_IDLE.values()))
        _IDLE.clear()
    return instances


def _slot(fmu: Fmu, name: str) -> tuple[str, str]:
    """Instances keep their names, which tell an FMU's messages apart."""
    return fmu.sha256, "" if fmu.once else name


_USED = (
    "SetDebugLogging", "EnterInitializationMode", "ExitInitializationMode", "DoStep", "Terminate",
    "Reset", "FreeInstance",
)  # fmt: skip


def _functions(library: Any, fmi: int) -> dict[str, Any]:
    """The C functions in use, by name without prefix, with addresses as plain numbers."""
    kinds = [name for name in NUMBERS if fmi == 3 or name in FMI2_TYPES]
    values = [accessor(fmi, verb, kind) for verb in ("Get", "Set") for kind in kinds]
    names = [*_USED, *values, *(["SetupExperiment"] if fmi == 2 else [])]
    return {name: exported(library, fmi, name) for name in names}


def unload(instances: Sequence[Instance]) -> None:
    """Unload the library of instances that are freed and were its only ones."""
    first = instances[0]
    with watch().calling(first.name, UNLOADING):
        libraries.unload(first._library, [i._fmu.dll._handle for i in instances])
