"""Checks of calls that a host should not make, and of some that it may and few think of.

Whether a crash is a violation depends on the call: the standard asks a function to bear few of
these. A probe cites where it does; elsewhere the crash is a warning.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from ..host.signatures import C_TYPES
from .bench import Bench, Clauses, ConcernError, NotApplicableError, advance, begin
from .library import Instance, Library, RefusedError
from .subject import Number, Subject, Variable

_SAMPLE = 40
"""Variables that are set to invalid values, at most."""
_SAMPLE_ONCE = 4
"""The same where each call takes a process of its own."""

Act = Callable[[Instance], object]

_NONE, _NEW, _INITIALISING, _STEPPING, _STEPPED, _TERMINATED = range(6)


@dataclass(frozen=True, slots=True)
class Probe:
    """A call that is to be answered in some way.

    Attributes
    ----------
    label
        Words for it.
    mode
        Of the instance that gets it.
    clauses
        Where the standard says that it is lawful, or must be borne.
    """

    label: str
    mode: int
    act: Act
    clauses: Clauses = (None, None)


Row = tuple[str, int, Act] | tuple[str, int, Act, Clauses]
"""The attributes of a `Probe`."""


def _probed(bench: Bench, probes: Sequence[Row]) -> str:
    """Make each call on an instance of its own; nothing matters but that it returns.

    What must be borne comes first: what an unlawful call has broken does not count.
    """
    level, fmi = bench.facts["level"], bench.subject.fmi
    ordered = [Probe(*row) for row in probes]
    ordered.sort(key=lambda probe: probe.clauses[fmi - 2] is None)
    for number, probe in enumerate(ordered):
        if number < bench.first:
            continue
        bench.trace.probe(number, probe.label, probe.clauses[fmi - 2])
        try:
            instance = _ready(bench, probe.mode, level)
        except RefusedError as refusal:
            before = f"after {ordered[number - 1].label}, " if number else ""
            raise ConcernError(f"{before}{refusal}") from None
        probe.act(instance)
        instance.free()
        # After a fatal status nothing may be called in this process.
        if (bench.subject.once or bench.library.fatal) and number + 1 < len(ordered):
            bench.resume = number + 1
            return ""
    return f"{len(probes)} calls answered" if probes else ""


def _ready(bench: Bench, mode: int, level: str) -> Instance:
    """An instance in a mode."""
    instance = Instance(bench.library, born=mode != _NONE)
    if mode == _INITIALISING:
        instance.enter()
    elif mode > _INITIALISING:
        begin(instance, level)
    if mode > _STEPPING:
        advance(instance, level, 0)
    if mode == _TERMINATED:
        instance.do("Terminate")
    return instance


def _call(name: str, *arguments: Any) -> Act:
    return lambda instance: instance.try_(name, *arguments)


def _bare(name: str, *arguments: Any) -> Act:
    """A call whose arguments include the instance."""
    return lambda instance: instance.library.call(name, *arguments)


def _step(time: float, size: float) -> Act:
    return lambda instance: instance.try_("DoStep", *instance.step_arguments(time, size))


def _settable(subject: Subject) -> list[Variable]:
    parameters = [v for v in subject.of("parameter") if v.variability in ("fixed", "tunable")]
    return [v for v in (*parameters, *subject.of("input")) if v.kind in C_TYPES[subject.fmi]]


def _set(variable: Variable, values: Sequence[Any]) -> Act:
    def act(instance: Instance) -> None:
        for function, arguments in instance.library.settings([(variable, values)]):
            instance.try_(function, *arguments)

    return act


_RESET: Clauses = ("4.2.4", "2.3.1")


def illegal_calls(bench: Bench) -> str:
    subject, library = bench.subject, bench.library
    return _probed(bench, [
        *_out_of_order(subject),
        *_settings_out_of_order(subject),
        *_odd_states(subject, library),
        *_odd_functions(subject),
        *_odd_instantiations(subject),
    ])  # fmt: skip


def _enter(instance: Instance) -> None:
    instance.try_enter()


def _step_after_reset(instance: Instance) -> None:
    instance.do("Reset")
    _step(instance.subject.start, instance.subject.step)(instance)


def _out_of_order(subject: Subject) -> list[Row]:
    """Calls of the life cycle where it has no room for them."""
    t, h = subject.start, subject.step
    return [
        ("a step before initialisation", _NEW, _step(t, h)),
        ("a step during initialisation", _INITIALISING, _step(t, h)),
        ("a step after termination", _TERMINATED, _step(t + h, h)),
        ("a step after a reset", _STEPPED, _step_after_reset),
        ("a step of 0 s", _STEPPING, _step(t, 0.0)),
        ("a step of negative size", _STEPPING, _step(t, -h)),
        ("a step of NaN s", _STEPPING, _step(t, math.nan)),
        ("a step from a time that is not the current one", _STEPPED, _step(t + 10.0 * h, h)),
        ("a step from the past", _STEPPED, _step(t - h, h)),
        ("a step from NaN", _STEPPING, _step(math.nan, h)),
        ("the end of an initialisation that has not begun", _NEW, _call("ExitInitializationMode")),
        ("the end of an initialisation that is over", _STEPPING, _call("ExitInitializationMode")),
        ("a second initialisation", _STEPPED, _enter),
        ("an initialisation within the initialisation", _INITIALISING, _enter),
        ("a termination before initialisation", _NEW, _call("Terminate")),
        ("a termination during initialisation", _INITIALISING, _call("Terminate")),
        ("a second termination", _TERMINATED, _call("Terminate")),
        ("a reset before initialisation", _NEW, _call("Reset"), _RESET),
        ("a reset during initialisation", _INITIALISING, _call("Reset"), _RESET),
    ]


def _settings_out_of_order(subject: Subject) -> Iterator[Row]:
    for v in subject.of("output")[:1] + subject.of("parameter")[:1]:
        if v.kind in C_TYPES[subject.fmi] and v.kind != "String":
            values = v.start or (0,) * v.size
            yield f"setting {v.name} between steps", _STEPPED, _set(v, values)
            yield f"setting {v.name} after termination", _TERMINATED, _set(v, values)


def _odd_states(subject: Subject, library: Library) -> Iterator[Row]:
    """Functions for states that are not claimed, and serialised states of another size."""
    pointer = ctypes.c_void_p()
    if not subject.saves:
        name = library.state("GetFMUState")
        call = _call(name, ctypes.byref(pointer))
        yield f"fmi{subject.fmi}{name}, which is not claimed", _STEPPED, call
    if not subject.serialises:
        name = library.state("DeserializeFMUState")
        call = _call(name, _spare(), 16, ctypes.byref(pointer))
        yield f"fmi{subject.fmi}{name}, which is not claimed", _STEPPED, call
    else:
        for text, size in (("no bytes", 0), ("too few bytes", -1), ("too many bytes", 1)):
            yield f"a serialised state of {text}", _STEPPED, _deserialise(size)


def _odd_functions(subject: Subject) -> Iterator[Row]:
    """Functions that a host for Co-Simulation without event mode has no use for."""
    spare = _spare()
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
        yield f"fmi{subject.fmi}{name}", _STEPPED, _call(name, *arguments)


def _odd_instantiations(subject: Subject) -> list[Row]:
    wrong, token = b"not the token of this FMU", subject.token.encode()
    return [
        ("instantiation with a wrong token", _NONE, _instantiate(b"conformance", wrong)),
        ("instantiation with an empty name", _NONE, _instantiate(b"", token)),
    ]


def _spare() -> Any:
    """Memory that an FMU may read or write."""
    return ctypes.create_string_buffer(4096)


def _instantiate(name: bytes | None, token: bytes | None, logger: bool = True) -> Act:
    def act(instance: Instance) -> None:
        library = instance.library
        other = library.instantiate(name, token, logger)
        if other is not None:
            library.call("FreeInstance", other)

    return act


def _deserialise(change: int) -> Act:
    """Bytes of a state, with some left out or put on; 0: none at all."""

    def act(instance: Instance) -> None:
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


def unknown_references(bench: Bench) -> str:
    subject = bench.subject
    known = {v.reference for v in subject.variables}
    unknown = [max(known, default=0) + 1, 0x7FFFFFFF, 0xFFFFFFFF]
    probes: list[Row] = []
    for kind, c_type in C_TYPES[subject.fmi].items():
        wrong = [v for v in subject.variables if v.kind != kind][:1]
        for reference in [*unknown, *(v.reference for v in wrong)]:
            if reference in known and any(
                (v.reference, v.kind) == (reference, kind) for v in subject.variables
            ):
                continue  # FMI 2 counts references for each type
            text = f"{reference}, which is no {kind}"
            for verb in ("Get", "Set"):
                for mode in (_INITIALISING, _STEPPED):
                    act = _access(f"{verb}{kind}", reference, c_type)
                    label = f"fmi{subject.fmi}{verb}{kind} of {text}"
                    probes.append((label, mode, act, ("2.1.2", None)))
    return _probed(bench, probes)


def _access(name: str, reference: int, c_type: Any) -> Act:
    def act(instance: Instance) -> None:
        buffer = (c_type * 64)()  # with room for more than is asked for
        instance.try_(name, *instance.library.access([reference], buffer))

    return act


def invalid_values(bench: Bench) -> str:
    subject = bench.subject
    probes: list[Row] = []
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
            modes = (_NEW, _STEPPING) if v.causality == "input" else (_NEW,)
            probes += [(f"{v.name} = {value}", mode, _live_with(v, value, mode)) for mode in modes]
    if not probes:
        raise NotApplicableError("no input or parameter has invalid values")
    return _probed(bench, probes)


def _cast(variable: Variable, value: float) -> Number:
    return value if variable.real else int(value)


def _live_with(variable: Variable, value: Number, mode: int) -> Act:
    """Set a value and go on to the end of a step, unless the FMU has refused it."""

    leave = "ExitInitializationMode"

    def act(instance: Instance) -> None:
        subject = instance.subject
        ((function, arguments),) = instance.library.settings([(variable, [value] * variable.size)])
        if instance.try_(function, *arguments) > 1:
            return
        if mode == _NEW and (instance.try_enter() > 1 or instance.try_(leave) > 1):
            return
        _step(subject.start, subject.step)(instance)

    return act


def null_pointers(bench: Bench) -> str:
    subject, library = bench.subject, bench.library
    return _probed(bench, [
        *_null_texts(subject),
        *(row for kind in C_TYPES[subject.fmi] for row in _null_values(subject, kind)),
        *_null_instances(subject),
        *_null_states(subject, library),
        *_null_derivatives(subject),
    ])  # fmt: skip


def _null_texts(subject: Subject) -> Iterator[Row]:
    """NULL where texts and callbacks are expected."""
    fmi, token = subject.fmi, subject.token.encode()
    yield (
        f"fmi{fmi}FreeInstance(NULL)", _NEW, _bare("FreeInstance", None), ("2.1.5", "2.3.1")
    )  # fmt: skip
    yield (
        f"fmi{fmi}SetDebugLogging without categories", _STEPPED,
        _call("SetDebugLogging", 1, 0, None), ("2.1.5", "2.3.1"),
    )  # fmt: skip
    yield f"fmi{fmi}Instantiate without a name", _NONE, _instantiate(None, token)
    yield f"fmi{fmi}Instantiate without a token", _NONE, _instantiate(b"conformance", None)
    if fmi == 3:
        yield (
            "fmi3InstantiateCoSimulation without a logger", _NONE,
            _instantiate(b"conformance", token, logger=False), (None, "2.3.1"),
        )  # fmt: skip


def _null_values(subject: Subject, kind: str) -> Iterator[Row]:
    """NULL for the arrays of the functions that get and set a type."""
    fmi, spare = subject.fmi, _spare()
    nothing = (0,) if fmi == 3 else ()
    here = [v for v in subject.variables if v.kind == kind]
    settable = [v for v in here if v.causality in ("input", "parameter")]
    for verb, mode, variables in (("Get", _STEPPED, here[:1]), ("Set", _NEW, settable[:1])):
        name = f"{verb}{kind}"
        yield (
            f"fmi{fmi}{name} of no values, with NULL", _STEPPED,
            _call(name, None, 0, None, *nothing),
        )  # fmt: skip
        for v in variables:
            reference = (ctypes.c_uint32 * 1)(v.reference)
            sizes = (v.size,) if fmi == 3 else ()
            yield (
                f"fmi{fmi}{name} with NULL for the references", mode,
                _call(name, None, 1, spare, *sizes),
            )  # fmt: skip
            yield (
                f"fmi{fmi}{name} with NULL for the values", mode,
                _call(name, reference, 1, None, *sizes),
            )  # fmt: skip
            yield (
                f"fmi{fmi}{name}(NULL, …)", mode, _bare(name, None, reference, 1, spare, *sizes)
            )  # fmt: skip


def _null_instances(subject: Subject) -> Iterator[Row]:
    """NULL for the instance, and for the results of a step."""
    fmi, t, h = subject.fmi, subject.start, subject.step
    for name in ("ExitInitializationMode", "Terminate", "Reset"):
        yield f"fmi{fmi}{name}(NULL)", _NEW, _bare(name, None)
    yield (
        f"fmi{fmi}DoStep(NULL, …)", _NEW,
        lambda i: i.library.call("DoStep", None, *i.step_arguments(t, h)),
    )  # fmt: skip
    if fmi == 3:
        yield (
            "fmi3DoStep with NULL for the results", _STEPPING,
            _call("DoStep", t, h, True, None, None, None, None),
        )  # fmt: skip


def _null_states(subject: Subject, library: Library) -> Iterator[Row]:
    fmi, state, spare = subject.fmi, library.state, _spare()
    empty = ctypes.byref(ctypes.c_void_p())
    if subject.saves:
        name = state("FreeFMUState")
        yield f"fmi{fmi}{name} of no state", _STEPPED, _call(name, empty), ("2.1.8", "2.2.7.4")
        for name in map(state, ("FreeFMUState", "GetFMUState", "SetFMUState")):
            yield f"fmi{fmi}{name}(…, NULL)", _STEPPED, _call(name, None)
    if subject.serialises:
        name = state("SerializedFMUStateSize")
        yield f"fmi{fmi}{name}(…, NULL, …)", _STEPPED, _call(name, None, spare)
        name = state("SerializeFMUState")
        yield f"fmi{fmi}{name}(…, NULL, …)", _STEPPED, _call(name, None, spare, 4096)
        name = state("DeserializeFMUState")
        yield f"fmi{fmi}{name}(…, NULL, …)", _STEPPED, _call(name, None, 16, empty)


def _null_derivatives(subject: Subject) -> Iterator[Row]:
    size = (1,) if subject.fmi == 3 else ()
    if subject.derivatives:
        yield (
            f"fmi{subject.fmi}GetDirectionalDerivative with NULL everywhere", _STEPPED,
            _call("GetDirectionalDerivative", None, 1, None, 1, None, *size, None, *size),
        )  # fmt: skip
