"""Checks of calls that a host should not make, and of some rare ones that it may make.

Whether a crash is a violation depends on the call: the standard requires FMUs to tolerate few of
these. If it does, the probe cites the section; otherwise the crash is a warning. Some calls must
also fail: their answer must be a status worse than a warning.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Iterator, Sequence
from typing import Any

from ..host.signatures import C_TYPES, ERROR, OK
from .bench import Bench, Clauses, NotApplicableError
from .library import Library, TracedInstance
from .probes import (
    INITIALISING,
    NEW,
    NONE,
    NOWHERE,
    STEPPED,
    STEPPING,
    TERMINATED,
    Act,
    ProbeRow,
    bare,
    call,
    probed,
    room,
    step,
)
from .subject import Number, Subject, SubjectVariable

_SAMPLE = 40
"""Maximum number of variables that are set to invalid values."""
_SAMPLE_ONCE = 4
"""The same if each call takes a process of its own."""


def _settable(subject: Subject) -> list[SubjectVariable]:
    parameters = [v for v in subject.of("parameter") if v.variability in ("fixed", "tunable")]
    return [v for v in (*parameters, *subject.of("input")) if v.kind in C_TYPES[subject.fmi]]


def _set(variable: SubjectVariable, values: Sequence[Any]) -> Act:
    def act(instance: TracedInstance) -> int:
        ((function, arguments),) = instance.library.settings([(variable, values)])
        return instance.try_(function, *arguments)

    return act


_RESET: Clauses = ("4.2.4", "2.3.1")


def illegal_calls(bench: Bench) -> str:
    subject, library = bench.subject, bench.library
    return probed(bench, [
        *_out_of_order(subject),
        *_settings_out_of_order(subject),
        *_odd_states(subject, library),
        *_odd_functions(subject),
        *_odd_instantiations(subject),
    ])  # fmt: skip


def _enter(instance: TracedInstance) -> None:
    instance.try_enter()


def _step_after_reset(instance: TracedInstance) -> None:
    instance.do("Reset")
    step(instance.subject.start, instance.subject.step)(instance)


def _out_of_order(subject: Subject) -> list[ProbeRow]:
    """Calls of the life cycle at times when it does not allow them."""
    t, h = subject.start, subject.step
    return [
        ("a step before initialisation", NEW, step(t, h)),
        ("a step during initialisation", INITIALISING, step(t, h)),
        ("a step after termination", TERMINATED, step(t + h, h)),
        ("a step after a reset", STEPPED, _step_after_reset),
        ("a step of 0 s", STEPPING, step(t, 0.0)),
        ("a step of negative size", STEPPING, step(t, -h)),
        ("a step of NaN s", STEPPING, step(t, math.nan)),
        ("a step from a time that is not the current one", STEPPED, step(t + 10.0 * h, h)),
        ("a step from the past", STEPPED, step(t - h, h)),
        ("a step from NaN", STEPPING, step(math.nan, h)),
        ("the end of an initialisation that has not begun", NEW, call("ExitInitializationMode")),
        ("the end of an initialisation that is over", STEPPING, call("ExitInitializationMode")),
        ("a second initialisation", STEPPED, _enter),
        ("an initialisation within the initialisation", INITIALISING, _enter),
        ("a termination before initialisation", NEW, call("Terminate")),
        ("a termination during initialisation", INITIALISING, call("Terminate")),
        ("a second termination", TERMINATED, call("Terminate")),
        ("a reset before initialisation", NEW, call("Reset"), _RESET),
        ("a reset during initialisation", INITIALISING, call("Reset"), _RESET),
    ]


def _settings_out_of_order(subject: Subject) -> Iterator[ProbeRow]:
    constants = [v for v in subject.variables if v.variability == "constant" and not v.clocked]
    for v in (*subject.of("output")[:1], *subject.of("parameter")[:1], *constants[:2]):
        if v.kind not in C_TYPES[subject.fmi] or v.kind == "String":
            continue
        act = _set(v, v.start or (0,) * v.size)
        if v.variability == "constant":
            for mode in (NEW, INITIALISING):
                yield f"setting the constant {v.name}", mode, act, NOWHERE, ("2.1.2", None)
            continue
        yield f"setting {v.name} after termination", TERMINATED, act
        if v.variability == "tunable":
            yield f"setting {v.name} between steps", STEPPED, act
        else:
            yield f"setting {v.name} between steps", STEPPED, act, NOWHERE, NOWHERE


def _odd_states(subject: Subject, library: Library) -> Iterator[ProbeRow]:
    """Functions for states that are not claimed, and serialised states of the wrong size."""
    pointer = ctypes.c_void_p()
    if not subject.saves:
        name = library.state("GetFMUState")
        act = call(name, ctypes.byref(pointer))
        yield f"fmi{subject.fmi}{name}, which is not claimed", STEPPED, act
    if not subject.serialises:
        name = library.state("DeserializeFMUState")
        act = call(name, room(), 16, ctypes.byref(pointer))
        yield f"fmi{subject.fmi}{name}, which is not claimed", STEPPED, act
    else:
        for text, size in (("no bytes", 0), ("too few bytes", -1), ("too many bytes", 1)):
            yield f"a serialised state of {text}", STEPPED, _deserialise(size)


def _odd_functions(subject: Subject) -> Iterator[ProbeRow]:
    """Functions that a host for Co-Simulation without event mode does not use."""
    spare = room()
    names: dict[str, tuple[Any, ...]]
    if subject.fmi == 2:
        names = {
            "CancelStep": (),
            **{f"Get{k}Status": (2, spare) for k in ("", "Real", "Integer", "Boolean", "String")},
        }
        derivative: tuple[Any, ...] = (spare, 1, spare, 1, spare, spare)
    else:
        names = {
            "EnterEventMode": (), "EnterStepMode": (), "EnterConfigurationMode": (),
            "ExitConfigurationMode": (), "UpdateDiscreteStates": (spare,) * 6,
        }  # fmt: skip
        derivative = (spare, 1, spare, 1, spare, 1, spare, 1)
    if not subject.derivatives:
        names["GetDirectionalDerivative"] = derivative
    for name, arguments in names.items():
        yield f"fmi{subject.fmi}{name}", STEPPED, call(name, *arguments)


def _odd_instantiations(subject: Subject) -> Iterator[ProbeRow]:
    token = subject.token.encode()
    yield "instantiation with an empty name", NONE, _instantiate(b"", token)
    # The token exists to be compared, but this is not required (FMI 2.0.5, 2.1.5; FMI 3.0.2,
    # 2.3.1).
    for what, other in (("a wrong", b"not the token of this FMU"), ("an empty", b"")):
        if other != token:
            act = _instantiate(b"conformance", other)
            yield f"instantiation with {what} token", NONE, act, NOWHERE, NOWHERE


def _instantiate(name: bytes | None, token: bytes | None, logger: bool = True) -> Act:
    def act(instance: TracedInstance) -> int:
        library = instance.library
        other = library.instantiate(name, token, logger)
        if other is None:
            return ERROR
        library.call("FreeInstance", other)
        return OK

    return act


def _deserialise(change: int) -> Act:
    """Bytes of a state, with some removed or added; 0: none at all."""

    def act(instance: TracedInstance) -> None:
        state = instance.state()
        data = instance.serialised(state)
        size = len(data) + change if change else 0
        other = ctypes.c_void_p()
        name = instance.library.state("DeserializeFMUState")
        if instance.try_(name, data.ljust(size, b"\0"), size, ctypes.byref(other)) == 0:
            instance.try_(instance.library.state("FreeFMUState"), ctypes.byref(other))
        if instance.address is not None:
            instance.free_state(state)

    return act


def invalid_values(bench: Bench) -> str:
    subject = bench.subject
    probes: list[ProbeRow] = []
    settable = [v for v in _settable(subject) if v.number or v.choice]
    most = _SAMPLE_ONCE if subject.once else _SAMPLE
    for v in settable[:: max(1, len(settable) // most)]:
        values: list[Number] = [math.nan, math.inf, -math.inf] if v.real else []
        if v.choice:
            values.append(-1)
        unsigned = v.kind.startswith("UInt")
        if v.min is not None and not (unsigned and v.min < 1):
            values.append(_cast(v, v.min - 1))
        if v.max is not None and v.max < 2**31 - 1:
            values.append(_cast(v, v.max + 1))
        for value in values:
            modes = (NEW, STEPPING) if v.causality == "input" else (NEW,)
            probes += [(f"{v.name} = {value}", mode, _live_with(v, value, mode)) for mode in modes]
    if not probes:
        raise NotApplicableError("no input or parameter has invalid values")
    return probed(bench, probes)


def _cast(variable: SubjectVariable, value: float) -> Number:
    return value if variable.real else int(value)


def _live_with(variable: SubjectVariable, value: Number, mode: int) -> Act:
    """Set a value and continue to the end of a step, unless the FMU refuses the value."""

    leave = "ExitInitializationMode"

    def act(instance: TracedInstance) -> None:
        subject = instance.subject
        ((function, arguments),) = instance.library.settings([(variable, [value] * variable.size)])
        if instance.try_(function, *arguments) > 1:
            return
        if mode == NEW and (instance.try_enter() > 1 or instance.try_(leave) > 1):
            return
        step(subject.start, subject.step)(instance)

    return act


def null_pointers(bench: Bench) -> str:
    subject, library = bench.subject, bench.library
    return probed(bench, [
        *_null_texts(subject),
        *(row for kind in C_TYPES[subject.fmi] for row in _null_values(subject, kind)),
        *_null_instances(subject),
        *_null_states(subject, library),
        *_null_derivatives(subject),
    ])  # fmt: skip


def _null_texts(subject: Subject) -> Iterator[ProbeRow]:
    """NULL in place of texts and callbacks."""
    fmi, token = subject.fmi, subject.token.encode()
    yield (
        f"fmi{fmi}FreeInstance(NULL)", NEW, bare("FreeInstance", None), ("2.1.5", "2.3.1")
    )  # fmt: skip
    yield (
        f"fmi{fmi}SetDebugLogging without categories", STEPPED,
        call("SetDebugLogging", 1, 0, None), ("2.1.5", "2.3.1"),
    )  # fmt: skip
    yield f"fmi{fmi}Instantiate without a name", NONE, _instantiate(None, token)
    yield f"fmi{fmi}Instantiate without a token", NONE, _instantiate(b"conformance", None)
    if fmi == 3:
        yield (
            "fmi3InstantiateCoSimulation without a logger", NONE,
            _instantiate(b"conformance", token, logger=False), (None, "2.3.1"),
        )  # fmt: skip


def _null_values(subject: Subject, kind: str) -> Iterator[ProbeRow]:
    """NULL in place of the arrays of the functions that get and set a type."""
    fmi, spare = subject.fmi, room()
    nothing = (0,) if fmi == 3 else ()
    here = [v for v in subject.variables if v.kind == kind]
    settable = [v for v in here if v.causality in ("input", "parameter")]
    for verb, mode, variables in (("Get", STEPPED, here[:1]), ("Set", NEW, settable[:1])):
        name = f"{verb}{kind}"
        yield (
            f"fmi{fmi}{name} of no values, with NULL", STEPPED,
            call(name, None, 0, None, *nothing),
        )  # fmt: skip
        for v in variables:
            reference = (ctypes.c_uint32 * 1)(v.reference)
            sizes = (v.size,) if fmi == 3 else ()
            yield (
                f"fmi{fmi}{name} with NULL for the references", mode,
                call(name, None, 1, spare, *sizes),
            )  # fmt: skip
            yield (
                f"fmi{fmi}{name} with NULL for the values", mode,
                call(name, reference, 1, None, *sizes),
            )  # fmt: skip
            yield (
                f"fmi{fmi}{name}(NULL, …)", mode, bare(name, None, reference, 1, spare, *sizes)
            )  # fmt: skip


def _null_instances(subject: Subject) -> Iterator[ProbeRow]:
    """NULL in place of the instance, and of the results of a step."""
    fmi, t, h = subject.fmi, subject.start, subject.step
    for name in ("ExitInitializationMode", "Terminate", "Reset"):
        yield f"fmi{fmi}{name}(NULL)", NEW, bare(name, None)
    yield (
        f"fmi{fmi}DoStep(NULL, …)", NEW,
        lambda i: i.library.call("DoStep", None, *i.step_arguments(t, h)),
    )  # fmt: skip
    if fmi == 3:
        yield (
            "fmi3DoStep with NULL for the results", STEPPING,
            call("DoStep", t, h, True, None, None, None, None),
        )  # fmt: skip


def _null_states(subject: Subject, library: Library) -> Iterator[ProbeRow]:
    fmi, state, spare = subject.fmi, library.state, room()
    empty = ctypes.byref(ctypes.c_void_p())
    if subject.saves:
        name = state("FreeFMUState")
        yield f"fmi{fmi}{name} of no state", STEPPED, call(name, empty), ("2.1.8", "2.2.7.4")
        for name in map(state, ("FreeFMUState", "GetFMUState", "SetFMUState")):
            yield f"fmi{fmi}{name}(…, NULL)", STEPPED, call(name, None)
    if subject.serialises:
        name = state("SerializedFMUStateSize")
        yield f"fmi{fmi}{name}(…, NULL, …)", STEPPED, call(name, None, spare)
        name = state("SerializeFMUState")
        yield f"fmi{fmi}{name}(…, NULL, …)", STEPPED, call(name, None, spare, 4096)
        name = state("DeserializeFMUState")
        yield f"fmi{fmi}{name}(…, NULL, …)", STEPPED, call(name, None, 16, empty)


def _null_derivatives(subject: Subject) -> Iterator[ProbeRow]:
    size = (1,) if subject.fmi == 3 else ()
    if subject.derivatives:
        yield (
            f"fmi{subject.fmi}GetDirectionalDerivative with NULL everywhere", STEPPED,
            call("GetDirectionalDerivative", None, 1, None, 1, None, *size, None, *size),
        )  # fmt: skip
