"""A small host: calls an FMU's own functions directly; its library is loaded once.

Every call into the FMU is first noted in a file that outlives the process, so that the waiting
parent can name the call in which it crashed or hangs.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from ..host.log_lines import line, logger2, logger3
from ..host.signatures import (
    C_TYPES,
    DISCARD,
    ERROR,
    FATAL,
    WARNING,
    exported,
    state_function,
    status_text,
)
from .subject import Number, Subject, SubjectVariable
from .trace import Trace

Setting = tuple[str, tuple[Any, ...]]
"""A function that sets values, and its arguments after the instance."""


class RefusedError(Exception):
    """A call that must succeed returned a status worse than a warning.

    Attributes
    ----------
    said
        What the FMU logged during the call.
    """

    def __init__(self, what: str, status: int, message: str) -> None:
        got = status_text(status) + (f": {message}" if message else "")
        super().__init__(f"{what} must succeed, got {got}")
        self.status, self.said = status, message


class MissingError(Exception):
    """A function of the standard is not exported."""


_LONGEST = 2000
"""Characters kept of an FMU's log during a call."""


class Library:
    """The functions of an FMU.

    Attributes
    ----------
    message
        What the FMU has logged since this was last emptied, on one line.
    fatal
        Whether a call has returned Fatal; then no instance may be used any more.

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
        os.chdir(Path(subject.library).parent)  # some FMUs look for their files there
        self.dll = ctypes.CDLL(subject.library)
        self._callbacks = self._prepared()

    def _prepared(self) -> Any:
        if self.fmi == 3:
            return logger3(self._note)
        self._logger = logger2(self._note)
        memory = ctypes.cdll.msvcrt if sys.platform == "win32" else ctypes.CDLL(None)
        functions = (self._logger, memory.calloc, memory.free)
        addresses = (ctypes.cast(f, ctypes.c_void_p) for f in functions)
        return (ctypes.c_void_p * 5)(*addresses, None, None)

    def _note(self, environment: int | None, name: bytes, status: int, message: bytes) -> None:
        said = line(message, self._name_of if self.fmi == 2 else None)
        self.trace.say(said)
        # The last line may only say that it ends, and an earlier one why.
        if said not in self.message:
            self.message = f"{self.message}; {said}"[-_LONGEST:] if self.message else said

    def _name_of(self, kind: str, reference: int) -> str | None:
        """The variable of a type that has a value reference."""
        wanted = (kind, reference)
        variables = self.subject.variables
        return next((v.name for v in variables if (v.kind, v.reference) == wanted), None)

    def has(self, function: str) -> bool:
        """Whether a function, given by its full name, is exported."""
        return hasattr(self.dll, function)

    def call(self, name: str, *arguments: Any) -> Any:
        """Call a function, given by its name without prefix."""
        if name not in self._functions:
            self._functions[name] = self._bound(name)
        self.trace.enter(f"fmi{self.fmi}{name}")
        return self._functions[name](*arguments)

    def _bound(self, name: str) -> Any:
        try:
            return exported(self.dll, self.fmi, name)
        except AttributeError:
            raise MissingError(f"it does not export fmi{self.fmi}{name}") from None

    def state(self, name: str) -> str:
        """The name, in this version, of a function for states."""
        return state_function(self.fmi, name)

    def access(self, references: Sequence[int], buffer: Any) -> tuple[Any, ...]:
        """The arguments of a function that gets or sets, after the instance."""
        array = (ctypes.c_uint32 * len(references))(*references)
        size = (len(buffer),) if self.fmi == 3 else ()
        return array, len(references), buffer, *size

    def settings(self, values: Iterable[tuple[SubjectVariable, Sequence[Number]]]) -> list[Setting]:
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
        self, name: bytes | None, token: bytes | None, logger: bool = True, talks: bool = False
    ) -> int | None:
        """An instance's address, or None.

        Parameters
        ----------
        logger
            For FMI 3, where it is optional.
        talks
            Whether logging is on.
        """
        self.message = ""
        resources, callbacks = Path(self.subject.resources), self._callbacks
        if self.fmi == 2:
            location = resources.as_uri().encode()
            address = self.call("Instantiate", name, 1, token, location, callbacks, 0, talks)
        else:
            location = f"{resources}{os.sep}".encode()
            address = self.call(
                "InstantiateCoSimulation", name, token, location, False, talks, False, False, None,
                0, None, callbacks if logger else None, None,
            )  # fmt: skip
        return address or None


class TracedInstance:
    """An instance. Methods not named ``try_…`` raise `RefusedError` if worse than a warning.

    One that is not ``born`` is only for inspection: it knows its library and has no address.
    """

    def __init__(
        self, library: Library, name: str = "conformance", *, born: bool = True, talks: bool = False
    ) -> None:
        self.library, self.subject = library, library.subject
        self._read: Any = None
        self._results: tuple[Any, ...] | None = None
        self.address: int | None = None
        if not born:
            return
        known_by = name.encode(), self.subject.token.encode()
        address = library.instantiate(*known_by, talks=talks)
        if address is None:
            if not (library.message or talks or self.subject.once):  # ask it for the reason
                other = library.instantiate(*known_by, talks=True)
                if other is not None:
                    library.call("FreeInstance", other)
            raise RefusedError(f"fmi{library.fmi}Instantiate", ERROR, library.message)
        self.address = address

    def try_(self, name: str, *arguments: Any) -> int:
        """The status of a call that may be refused."""
        status: int = self.library.call(name, self.address, *arguments)
        if status == FATAL:
            self.library.fatal = True
            self.address = None  # it must not be called any more
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
        """Free the instance, in whatever state it is."""
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

    def begin(self) -> TracedInstance:
        """From instantiated to ready for steps."""
        self.enter()
        self.do("ExitInitializationMode")
        return self

    def step_arguments(self, time: float, size: float) -> tuple[Any, ...]:
        """The arguments of ``DoStep`` after the instance."""
        if self.library.fmi == 2:
            return time, size, 1
        if self._results is None:
            self._kept = (ctypes.c_bool * 3)(), ctypes.c_double()
            flags, last = map(ctypes.addressof, self._kept)
            self._results = (flags, flags + 1, flags + 2, last)
        return (time, size, True, *self._results)

    def step(self, time: float, size: float) -> None:
        """Advance from a time in s by a size in s."""
        self.do("DoStep", *self.step_arguments(time, size), at=time)
        if self.library.fmi == 3 and any(self._kept[0][1:]):
            raise RefusedError(f"fmi3DoStep at {time:g} s", DISCARD, "it has ended the step early")

    def values(self, variables: Iterable[SubjectVariable]) -> list[Any]:
        """The values of all elements, one after another."""
        result: list[Any] = []
        for v in variables:
            buffer = (C_TYPES[self.library.fmi][v.kind] * v.size)()
            self.do(f"Get{v.kind}", *self.library.access([v.reference], buffer))
            result.extend(buffer)
        return result

    def outputs(self) -> list[Any]:
        """The observed values, kind by kind; `output_names` gives their names."""
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

    def set(self, variable: SubjectVariable, values: Sequence[Number]) -> None:
        """Set all elements of a variable."""
        self.set_all(self.library.settings([(variable, values)]))

    def set_all(self, settings: Iterable[Setting]) -> None:
        """Set the values that `Library.settings` has prepared."""
        for function, arguments in settings:
            self.do(function, *arguments)

    def state(self) -> ctypes.c_void_p:
        """A copy of the state; free it with `free_state`."""
        state = ctypes.c_void_p()
        self.do(self.library.state("GetFMUState"), ctypes.byref(state))
        return state

    def keep(self, state: ctypes.c_void_p) -> None:
        """Overwrite a copy with the current state."""
        self.do(self.library.state("GetFMUState"), ctypes.byref(state))

    def restore(self, state: ctypes.c_void_p) -> None:
        """Restore the state from a copy."""
        self.do(self.library.state("SetFMUState"), state)

    def free_state(self, state: ctypes.c_void_p) -> None:
        """Free a copy."""
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
        self, unknown: SubjectVariable, knowns: Sequence[SubjectVariable], seed: Sequence[float]
    ) -> list[float]:
        """The directional derivative of a variable along a seed of all elements of others."""
        result = (ctypes.c_double * unknown.size)()
        rows = (ctypes.c_uint32 * 1)(unknown.reference)
        columns = (ctypes.c_uint32 * len(knowns))(*(v.reference for v in knowns))
        seeds = (ctypes.c_double * len(seed))(*seed)
        sizes = ((len(seed),), (unknown.size,)) if self.library.fmi == 3 else ((), ())
        self.do(
            "GetDirectionalDerivative", rows, 1, columns, len(knowns), seeds, *sizes[0], result,
            *sizes[1],
        )  # fmt: skip
        return list(result)


def output_names(subject: Subject) -> list[str]:
    """Names of all elements in the order of `TracedInstance.outputs`; elements count from 1."""
    return [
        v.name if v.size == 1 else f"{v.name}[{i + 1}]"
        for _, variables in _by_kind(subject.observed)
        for v in variables
        for i in range(v.size)
    ]


def _by_kind(variables: Iterable[SubjectVariable]) -> list[tuple[str, list[SubjectVariable]]]:
    kinds: dict[str, list[SubjectVariable]] = {}
    for v in variables:
        kinds.setdefault(v.kind, []).append(v)
    return list(kinds.items())


def _size(variables: Iterable[SubjectVariable]) -> int:
    return sum(v.size for v in variables)
