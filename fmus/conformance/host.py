"""A small host: an FMU's own functions, called directly, its library loaded once.

Everything that enters the FMU is noted first in a file that outlives the process, so that whoever
waits for it can say in which call it has crashed or hangs.
"""

from __future__ import annotations

import ctypes
import mmap
import os
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .subject import Number, Subject, Variable

WARNING, DISCARD, ERROR, FATAL = 1, 2, 3, 4
_STATUS = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
_TRACE = 512
_MESSAGE = 200
"""Characters that are kept of what an FMU logs."""

_P, _N, _D, _I = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_double, ctypes.c_int
_B, _S = ctypes.c_bool, ctypes.c_char_p

_STATE = {
    "GetFMUState": (_P, _P), "SetFMUState": (_P, _P), "FreeFMUState": (_P, _P),
    "SerializedFMUStateSize": (_P, _P, _P), "SerializeFMUState": (_P, _P, _P, _N),
    "DeserializeFMUState": (_P, _P, _N, _P),
}  # fmt: skip
_FMI2_STATE = {
    name: name.replace("FMUState", "FMUstate").replace("Deserialize", "DeSerialize")
    for name in _STATE
}
_COMMON = {
    "FreeInstance": (_P,), "ExitInitializationMode": (_P,), "Terminate": (_P,), "Reset": (_P,),
}  # fmt: skip
_SIGNATURES: dict[int, dict[str, tuple[Any, ...]]] = {
    2: _COMMON | {_FMI2_STATE[name]: types for name, types in _STATE.items()} | {
        "GetVersion": (),
        "GetTypesPlatform": (),
        "Instantiate": (_S, _I, _S, _S, _P, _I, _I),
        "SetDebugLogging": (_P, _I, _N, _P),
        "SetupExperiment": (_P, _I, _D, _D, _I, _D),
        "EnterInitializationMode": (_P,),
        "DoStep": (_P, _D, _D, _I),
        "CancelStep": (_P,),
        "GetStatus": (_P, _I, _P),
        "GetRealStatus": (_P, _I, _P),
        "GetIntegerStatus": (_P, _I, _P),
        "GetBooleanStatus": (_P, _I, _P),
        "GetStringStatus": (_P, _I, _P),
        "GetDirectionalDerivative": (_P, _P, _N, _P, _N, _P, _P),
        "SetRealInputDerivatives": (_P, _P, _N, _P, _P),
        "GetRealOutputDerivatives": (_P, _P, _N, _P, _P),
    },
    3: _COMMON | _STATE | {
        "GetVersion": (),
        "InstantiateCoSimulation": (_S, _S, _S, _B, _B, _B, _B, _P, _N, _P, _P, _P),
        "SetDebugLogging": (_P, _B, _N, _P),
        "EnterInitializationMode": (_P, _B, _D, _D, _B, _D),
        "DoStep": (_P, _D, _D, _B, _P, _P, _P, _P),
        "EnterEventMode": (_P,),
        "EnterStepMode": (_P,),
        "EnterConfigurationMode": (_P,),
        "ExitConfigurationMode": (_P,),
        "UpdateDiscreteStates": (_P, _P, _P, _P, _P, _P, _P),
        "GetDirectionalDerivative": (_P, _P, _N, _P, _N, _P, _N, _P, _N),
        "GetAdjointDerivative": (_P, _P, _N, _P, _N, _P, _N, _P, _N),
        "GetOutputDerivatives": (_P, _P, _N, _P, _P, _N),
        "GetNumberOfVariableDependencies": (_P, ctypes.c_uint, _P),
        "GetVariableDependencies": (_P, ctypes.c_uint, _P, _P, _P, _P, _N),
    },
}  # fmt: skip
_RESULTS: dict[str, Any] = {
    "GetVersion": _S, "GetTypesPlatform": _S, "FreeInstance": None, "Instantiate": _P,
    "InstantiateCoSimulation": _P,
}  # fmt: skip

C_TYPES: dict[int, dict[str, Any]] = {
    2: {"Real": _D, "Integer": ctypes.c_int32, "Boolean": _I, "String": _S},
    3: {
        "Float64": _D, "Float32": ctypes.c_float, "Int8": ctypes.c_int8, "UInt8": ctypes.c_uint8,
        "Int16": ctypes.c_int16, "UInt16": ctypes.c_uint16, "Int32": ctypes.c_int32,
        "UInt32": ctypes.c_uint32, "Int64": ctypes.c_int64, "UInt64": ctypes.c_uint64,
        "Boolean": _B, "String": _S,
    },
}  # fmt: skip
"""The types that are got and set, by version and kind."""

_LOGGER2 = ctypes.CFUNCTYPE(None, _P, _S, _I, _S, _S)
_LOGGER3 = ctypes.CFUNCTYPE(None, _P, _I, _S, _S)


Setting = tuple[str, tuple[Any, ...]]
"""A function that sets, and its arguments after the instance."""


class RefusedError(Exception):
    """A call that must succeed has returned a status worse than a warning."""

    def __init__(self, what: str, status: int, message: str) -> None:
        label = _STATUS[status] if 0 <= status < len(_STATUS) else f"status {status}"
        super().__init__(f"{what} must succeed, got {label}" + (f": {message}" if message else ""))
        self.status = status


class MissingError(Exception):
    """A function of the standard is not exported."""


class Trace:
    """Where the process is, in a file that outlives it.

    It holds ``COUNT PROBE CLAUSE WHAT``: how often it was written, the number of the probe after
    which one can go on (or ``-``), the section of the standard by which that call must be borne
    (or ``-``), and the call under way.
    """

    def __init__(self, path: Path) -> None:
        path.write_bytes(bytes(_TRACE))
        with path.open("r+b") as file:
            self._map = mmap.mmap(file.fileno(), _TRACE)
        self._count, self._probe, self._label = 0, "- -", ""

    def enter(self, call: str) -> None:
        """Note the call that comes now."""
        self._count += 1
        text = f"{self._count} {self._probe} {self._label or call}".encode()
        self._map[:] = text[:_TRACE].ljust(_TRACE, b"\0")

    def probe(self, number: int, label: str, clause: str | None) -> None:
        """Note what the following calls are, as far as people are concerned."""
        self._probe, self._label = f"{number} {clause or '-'}", label
        self.enter(label)


@dataclass(frozen=True, slots=True)
class Place:
    """Where a process is or was.

    Attributes
    ----------
    count
        Changes as long as the process goes on.
    probe
        Number of the probe; None outside of any.
    clause
        By which its call must be borne, if any.
    call
        What is or was under way.
    """

    count: str
    probe: int | None
    clause: str | None
    call: str


def read_trace(path: Path) -> Place:
    """What a trace says."""
    text = path.read_bytes().strip(b"\0") if path.is_file() else b""
    count, probe, clause, call = (text or b"0 - - its start").decode(errors="replace").split(" ", 3)
    return Place(
        count, None if probe == "-" else int(probe), None if clause == "-" else clause, call
    )


class Library:
    """The functions of an FMU.

    Attributes
    ----------
    message
        What the FMU has logged last.
    fatal
        Whether a call has returned Fatal: then no instance may be used any more.

    Raises
    ------
    OSError
        The library does not load.
    """

    def __init__(self, subject: Subject, trace: Trace) -> None:
        self.subject, self.trace, self.fmi = subject, trace, subject.fmi
        self.message = ""
        self.fatal = False
        self._functions: dict[str, Any] = {}
        trace.enter("loading the library")
        os.chdir(Path(subject.library).parent)  # some look for their files there
        self.dll = ctypes.CDLL(subject.library)
        self._callbacks = self._prepared()

    def _prepared(self) -> Any:
        def log2(_: Any, name: bytes, status: int, category: bytes, message: bytes) -> None:
            self._note(status, message)

        def log3(_: Any, status: int, category: bytes, message: bytes) -> None:
            self._note(status, message)

        if self.fmi == 3:
            return _LOGGER3(log3)
        # The message comes as its format: ctypes cannot take what follows it.
        self._logger = _LOGGER2(log2)
        memory = ctypes.cdll.msvcrt if sys.platform == "win32" else ctypes.CDLL(None)
        functions = (self._logger, memory.calloc, memory.free)
        return (_P * 5)(*(ctypes.cast(f, _P) for f in functions), None, None)

    def _note(self, status: int, message: bytes | None) -> None:
        if status >= WARNING:
            text = " ".join((message or b"")[: 4 * _MESSAGE].decode(errors="replace").split())
            self.message = text.replace("%%", "%").replace("##", "#")[:_MESSAGE]

    def has(self, function: str) -> bool:
        """Whether a function, named in full, is exported."""
        return hasattr(self.dll, function)

    def call(self, name: str, *arguments: Any) -> Any:
        """Call a function, named without prefix."""
        function = self._functions.get(name)
        if function is None:
            function = self._functions[name] = self._bound(name)
        self.trace.enter(f"fmi{self.fmi}{name}")
        return function(*arguments)

    def _bound(self, name: str) -> Any:
        try:
            function = self.dll[f"fmi{self.fmi}{name}"]
        except AttributeError:
            raise MissingError(f"it does not export fmi{self.fmi}{name}") from None
        if name[3:] in C_TYPES[self.fmi] and name[:3] in ("Get", "Set"):
            function.argtypes = (_P, _P, _N, _P, *((_N,) if self.fmi == 3 else ()))
        else:
            function.argtypes = _SIGNATURES[self.fmi][name]
        function.restype = _RESULTS.get(name, _I)
        return function

    def state(self, name: str) -> str:
        """The version's spelling of a function for states."""
        return _FMI2_STATE[name] if self.fmi == 2 else name

    def access(self, references: Sequence[int], buffer: Any) -> tuple[Any, ...]:
        """The arguments of a function that gets or sets, after the instance."""
        array = (ctypes.c_uint32 * len(references))(*references)
        size = (len(buffer),) if self.fmi == 3 else ()
        return array, len(references), buffer, *size

    def settings(self, values: Iterable[tuple[Variable, Sequence[Number]]]) -> list[Setting]:
        """The calls that set variables, of any instance; one per kind."""
        kinds: dict[str, tuple[list[int], list[Number]]] = {}
        for variable, elements in values:
            references, numbers = kinds.setdefault(variable.kind, ([], []))
            references.append(variable.reference)
            numbers.extend(elements)
        return [
            (f"Set{kind}", self.access(refs, (C_TYPES[self.fmi][kind] * len(numbers))(*numbers)))
            for kind, (refs, numbers) in kinds.items()
        ]

    def instantiate(
        self, name: bytes | None, token: bytes | None, logger: bool = True
    ) -> int | None:
        """An instance's address, or None. ``logger`` is for FMI 3, where there need be none."""
        resources, callbacks = Path(self.subject.resources), self._callbacks
        if self.fmi == 2:
            place = resources.as_uri().encode()
            address = self.call("Instantiate", name, 1, token, place, callbacks, 0, 0)
        else:
            place = f"{resources}{os.sep}".encode()
            address = self.call(
                "InstantiateCoSimulation", name, token, place, False, False, False, False, None,
                0, None, callbacks if logger else None, None,
            )  # fmt: skip
        return address or None


class Instance:
    """An instance; what is not named ``try_…`` raises `RefusedError` for worse than a warning.

    One that is not ``born`` is there to be looked at: it knows its library and has no address.
    """

    def __init__(self, library: Library, name: str = "conformance", *, born: bool = True) -> None:
        self.library, self.subject = library, library.subject
        self._read: Any = None
        self._places: tuple[Any, ...] | None = None
        self.address: int | None = None
        if not born:
            return
        address = library.instantiate(name.encode(), self.subject.token.encode())
        if address is None:
            raise RefusedError(f"fmi{library.fmi}Instantiate", ERROR, library.message)
        self.address = address

    def try_(self, name: str, *arguments: Any) -> int:
        """The status of a call that may be refused."""
        status: int = self.library.call(name, self.address, *arguments)
        if status == FATAL:
            self.library.fatal = True
            self.address = None  # nothing may be called on it any more
        return status

    def do(self, name: str, *arguments: Any, at: float | None = None) -> int:
        """A call that must succeed."""
        self.library.message = ""
        status = self.try_(name, *arguments)
        if status > WARNING or status < 0:
            when = "" if at is None else f" at {at:g} s"
            what = f"fmi{self.library.fmi}{name}{when}"
            raise RefusedError(what, status, self.library.message)
        return status

    def free(self) -> None:
        """Give the instance back, in whatever state it is."""
        if self.address is not None:
            self.library.call("FreeInstance", self.address)
            self.address = None

    def try_enter(self) -> int:
        """Enter Initialization Mode; the first status that is not OK."""
        start = self.subject.start
        if self.library.fmi == 3:
            return self.try_("EnterInitializationMode", False, 0.0, start, False, 0.0)
        return self.try_("SetupExperiment", 0, 0.0, start, 0, 0.0) or self.try_(
            "EnterInitializationMode"
        )

    def enter(self) -> None:
        """Enter Initialization Mode."""
        start = self.subject.start
        if self.library.fmi == 3:
            self.do("EnterInitializationMode", False, 0.0, start, False, 0.0)
        else:
            self.do("SetupExperiment", 0, 0.0, start, 0, 0.0)
            self.do("EnterInitializationMode")

    def begin(self) -> Instance:
        """From instantiated to ready for steps."""
        self.enter()
        self.do("ExitInitializationMode")
        return self

    def step_arguments(self, time: float, size: float) -> tuple[Any, ...]:
        """The arguments of ``DoStep`` after the instance."""
        if self.library.fmi == 2:
            return time, size, 1
        if self._places is None:
            self._kept = (_B * 3)(), _D()
            flags, last = map(ctypes.addressof, self._kept)
            self._places = (flags, flags + 1, flags + 2, last)
        return (time, size, True, *self._places)

    def step(self, time: float, size: float) -> None:
        """Advance from a time in s by a size in s."""
        self.do("DoStep", *self.step_arguments(time, size), at=time)
        if self.library.fmi == 3 and any(self._kept[0][1:]):
            raise RefusedError(f"fmi3DoStep at {time:g} s", DISCARD, "it has ended the step early")

    def values(self, variables: Iterable[Variable]) -> list[Any]:
        """The values of all elements, one after another."""
        result: list[Any] = []
        for v in variables:
            buffer = (C_TYPES[self.library.fmi][v.kind] * v.size)()
            self.do(f"Get{v.kind}", *self.library.access([v.reference], buffer))
            result.extend(buffer)
        return result

    def outputs(self) -> list[Any]:
        """The values of what is observed, kind by kind; `output_names` are their names."""
        if self._read is None:
            access = self.library.access
            self._read = [
                (f"Get{kind}", buffer, access([v.reference for v in variables], buffer))
                for kind, variables in _by_kind(self.subject.observed)
                for buffer in [(C_TYPES[self.library.fmi][kind] * _size(variables))()]
            ]
        result: list[Any] = []
        for function, buffer, arguments in self._read:
            self.do(function, *arguments)
            result.extend(buffer)
        return result

    def set(self, variable: Variable, values: Sequence[Number]) -> None:
        """Set all elements of a variable."""
        self.set_all(self.library.settings([(variable, values)]))

    def set_all(self, settings: Iterable[Setting]) -> None:
        """Set what `Library.settings` has prepared."""
        for function, arguments in settings:
            self.do(function, *arguments)

    def state(self) -> ctypes.c_void_p:
        """A copy of the state, to be given back with `free_state`."""
        state = ctypes.c_void_p()
        self.do(self.library.state("GetFMUState"), ctypes.byref(state))
        return state

    def keep(self, state: ctypes.c_void_p) -> None:
        """Overwrite a copy by the state of now."""
        self.do(self.library.state("GetFMUState"), ctypes.byref(state))

    def restore(self, state: ctypes.c_void_p) -> None:
        """Go back to a copy."""
        self.do(self.library.state("SetFMUState"), state)

    def free_state(self, state: ctypes.c_void_p) -> None:
        """Give a copy back."""
        self.do(self.library.state("FreeFMUState"), ctypes.byref(state))

    def serialised(self, state: ctypes.c_void_p) -> bytes:
        """The bytes of a copy."""
        size = ctypes.c_size_t()
        self.do(self.library.state("SerializedFMUStateSize"), state, ctypes.byref(size))
        buffer = ctypes.create_string_buffer(size.value)
        self.do(self.library.state("SerializeFMUState"), state, buffer, size.value)
        return buffer.raw

    def deserialised(self, data: bytes) -> ctypes.c_void_p:
        """A copy from its bytes."""
        state = ctypes.c_void_p()
        name = self.library.state("DeserializeFMUState")
        self.do(name, data, len(data), ctypes.byref(state))
        return state

    def derivative(
        self, unknown: Variable, knowns: Sequence[Variable], seed: Sequence[float]
    ) -> list[float]:
        """The directional derivative of one variable along a seed of all elements of others."""
        result = (_D * unknown.size)()
        rows = (ctypes.c_uint32 * 1)(unknown.reference)
        columns = (ctypes.c_uint32 * len(knowns))(*(v.reference for v in knowns))
        seeds = (_D * len(seed))(*seed)
        sizes = ((len(seed),), (unknown.size,)) if self.library.fmi == 3 else ((), ())
        self.do(
            "GetDirectionalDerivative", rows, 1, columns, len(knowns), seeds, *sizes[0], result,
            *sizes[1],
        )  # fmt: skip
        return list(result)


def output_names(subject: Subject) -> list[str]:
    """Names of all elements in the order of `Instance.outputs`; elements count from 1."""
    return [
        v.name if v.size == 1 else f"{v.name}[{i + 1}]"
        for _, variables in _by_kind(subject.observed)
        for v in variables
        for i in range(v.size)
    ]


def _by_kind(variables: Iterable[Variable]) -> list[tuple[str, list[Variable]]]:
    kinds: dict[str, list[Variable]] = {}
    for v in variables:
        kinds.setdefault(v.kind, []).append(v)
    return list(kinds.items())


def _size(variables: Iterable[Variable]) -> int:
    return sum(v.size for v in variables)
