"""The dynamic checks, each to be run in a process of its own: see `CHECKS`, at the end.

A check returns a line about what it has seen, or raises `ConformanceError` or `NotApplicableError`
with a reason. All of them compare with the same run: from the start, in steps of the default
experiment, as lively as the FMU accepts (`life_cycle` finds that out).
"""

from __future__ import annotations

import ctypes
import gc
import hashlib
import json
import math
import random
import re
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .host import C_TYPES, DISCARD, ERROR, Instance, Library, RefusedError, Trace, output_names
from .subject import Number, Subject, Variable

Values = list[Any]

CUTS = (2, 5)
"""Into how many parts a step is cut."""
INSTANCES = 4
LIVES = 10_000
"""Instantiations of the check for leaks."""
_MEASURED = (4_000, 7_000, LIVES)
_LEAK = 16
"""Bytes per instantiation that count as a leak: half of the smallest piece that is allocated."""
_SAMPLE = 40
"""Variables that are set to invalid values, at most."""

_ALL, _LIVELY, _REALS, _STILL = (
    "parameters changed, inputs moving", "inputs moving", "real inputs moving", "inputs at rest"
)


class ConformanceError(Exception):
    """The FMU does not keep a promise."""


class NotApplicableError(Exception):
    """The FMU does not promise this, or it cannot be told."""


@dataclass
class Bench:
    """What a check works with.

    Attributes
    ----------
    folder
        Where checks leave what later ones need.
    first
        Number of the first probe to try; those before it have crashed or are done.
    """

    subject: Subject
    folder: Path
    trace: Trace
    first: int = 0
    _library: Library | None = None

    @property
    def library(self) -> Library:
        """The FMU's library, loaded when it is first asked for."""
        if self._library is None:
            try:
                self._library = Library(self.subject, self.trace)
            except OSError as error:
                raise ConformanceError(f"the library does not load: {error}") from None
        return self._library

    @property
    def facts(self) -> Any:
        """What `life_cycle` has found out."""
        return json.loads((self.folder / "facts.json").read_text())

    def instance(self, name: str = "conformance") -> Instance:
        """A new instance."""
        return Instance(self.library, name)

    def reference(self) -> list[Values]:
        """The run of a fresh instance, the first one of this process."""
        instance = self.instance()
        level = self.facts["level"]
        rows = run(begin(instance, level), level)
        instance.free()
        if _digest(rows) != self.facts["digest"]:
            raise NotApplicableError("the same run gives other results in another process")
        return rows


# ---- runs ----


def stimulus(
    subject: Subject, level: str, step: int, number: int = 0
) -> Iterator[tuple[Variable, list[Number]]]:
    """What is set before a step: inputs near their start values, times that go with the time.

    Parameters
    ----------
    number
        Of the instance; each has inputs of its own.
    """
    if level == _STILL:
        return
    element = 0
    for v in subject.of("input"):
        values: list[Number] = []
        for start in v.start or (0,) * v.size:
            element += 1
            if v.real and v.unit == "s":
                value: Number = subject.start + step * subject.step
            elif v.real:
                swing = 0.1 * abs(start) or 1.0
                value = start + swing * math.sin(0.7 * step + 1.3 * element + 0.9 * number)
            elif v.kind == "Boolean":
                value = bool(start) != ((step // 3 + number) % 2 == 1)
            else:
                value = start + step + number
            values.append(_within(v, value) if v.number else value)
        lively = v.real or (level in (_ALL, _LIVELY) and (v.number or v.kind == "Boolean"))
        if lively:
            yield v, values


def _within(variable: Variable, value: Number) -> Number:
    if variable.min is not None:
        value = max(value, variable.min if variable.real else int(variable.min))
    if variable.max is not None:
        value = min(value, variable.max if variable.real else int(variable.max))
    return value


def begin(instance: Instance, level: str, number: int = 0) -> Instance:
    """From instantiated to ready for steps, perhaps with real parameters changed a little."""
    if level == _ALL:
        share = 0.1 * (number + 1) / INSTANCES
        parameters = (
            (v, [_within(v, x + share * (abs(x) or 1.0)) for x in v.start])
            for v in instance.subject.of("parameter")
            if v.real and v.start is not None
        )
        instance.set_all(instance.library.settings(parameters))
    return instance.begin()


def advance(instance: Instance, level: str, step: int, number: int = 0, cut: int = 1) -> Values:
    """Set the inputs, take a step, perhaps in parts, and return the outputs."""
    subject = instance.subject
    instance.set_all(instance.library.settings(stimulus(subject, level, step, number)))
    for part in range(cut):
        time = subject.start + (step + part / cut) * subject.step
        instance.step(time, subject.step / cut)
    return instance.outputs()


def run(
    instance: Instance, level: str, number: int = 0, cut: int = 1, first: int = 0
) -> list[Values]:
    """The outputs now and after each step to the end of the run."""
    steps = range(first, instance.subject.steps)
    return [
        instance.outputs(),
        *(advance(instance, level, step, number, cut) for step in steps),
    ]


def _digest(rows: list[Values]) -> str:
    return hashlib.sha256(repr(rows).encode()).hexdigest()


def expect_same(
    bench: Bench, expected: list[Values], rows: list[Values], what: str, tolerance: float = 0.0
) -> None:
    """Fail unless two runs agree to their end; to a tolerance relative to the values' size."""
    names = output_names(bench.subject)
    first = bench.subject.steps + 1 - len(expected)
    for step, (wanted, got) in enumerate(zip(expected, rows, strict=True)):
        for i, (a, b) in enumerate(zip(wanted, got, strict=True)):
            if a == b or (a != a and b != b):
                continue
            if tolerance and isinstance(a, float):
                size = max(abs(row[i]) for row in expected)
                if abs(a - b) <= tolerance * size:
                    continue
            time = bench.subject.start + (first + step) * bench.subject.step
            raise ConformanceError(
                f"{what}: {names[i]} must be {_text(a)} at {time:g} s, got {_text(b)}"
            )


def _text(value: Any) -> str:
    return f"{value:.9g}" if isinstance(value, float) else repr(value)


def _half(bench: Bench) -> int:
    return bench.subject.steps // 2


# ---- the checks ----


def functions(bench: Bench) -> str:
    missing = [name for name in bench.subject.functions if not bench.library.has(name)]
    if missing:
        raise ConformanceError(f"it does not export {', '.join(missing)}")
    return f"all {len(bench.subject.functions)}"


def life_cycle(bench: Bench) -> str:
    subject, library = bench.subject, bench.library
    version = (library.call("GetVersion") or b"").decode(errors="replace")
    if not version.startswith(f"{subject.fmi}."):
        what = f"fmi{subject.fmi}GetVersion"
        raise ConformanceError(f"{what} must return {subject.version}, got {version!r}")
    for level in (_ALL, _LIVELY, _REALS, _STILL):
        try:
            rows = _tried(bench, level)
            break
        except RefusedError:
            if level == _STILL:
                raise
    instance = bench.instance()
    run(begin(instance, level), level)
    instance.do("Terminate")
    instance.do("Reset")
    run(begin(instance, level), level)
    instance.do("Terminate")
    instance.free()
    for advanced in range(4):  # an instance may be freed in every state
        instance = bench.instance()
        if advanced == 1:
            instance.enter()
        elif advanced > 1:
            begin(instance, level)
            if advanced == 3:
                advance(instance, level, 0)
        instance.free()
    facts = {"level": level, "digest": _digest(rows)}
    (bench.folder / "facts.json").write_text(json.dumps(facts))
    moving = sum(any(row[i] != rows[0][i] for row in rows) for i in range(len(rows[0])))
    return (
        f"{subject.steps} steps of {subject.step:g} s, {level}; "
        f"{moving} of {len(rows[0])} outputs move"
    )


def _tried(bench: Bench, level: str) -> list[Values]:
    """The run of the first instance, if all can run like this."""
    for number in range(INSTANCES):
        instance = bench.instance()
        try:
            rows = run(begin(instance, level, number), level, number)
        finally:
            instance.free()
        if level != _STILL and not all(math.isfinite(x) for x in rows[-1] if isinstance(x, float)):
            raise RefusedError("the run", ERROR, "its results are not finite")
        if number == 0:
            first = rows
    return first


def reset(bench: Bench) -> str:
    expected, level = bench.reference(), bench.facts["level"]
    instance = bench.instance()
    for steps, when in ((0, "before any step"), (_half(bench), "half-way")):
        begin(instance, level)
        for step in range(steps):
            advance(instance, level, step)
        instance.do("Reset")
        rows = run(begin(instance, level), level)
        instance.do("Reset")
        expect_same(bench, expected, rows, f"a run after a reset {when}")
    run(begin(instance, level), level)
    instance.do("Terminate")
    instance.do("Reset")
    rows = run(begin(instance, level), level)
    expect_same(bench, expected, rows, "a run after termination and reset")
    instance.free()
    return "a run after a reset is the run of a fresh instance"


def _half_way(bench: Bench) -> Instance:
    level = bench.facts["level"]
    instance = begin(bench.instance(), level)
    for step in range(_half(bench)):
        advance(instance, level, step)
    return instance


def save_and_restore(bench: Bench) -> str:
    if not bench.subject.saves:
        raise NotApplicableError("the FMU does not claim to save its state")
    half, level = _half(bench), bench.facts["level"]
    expected = bench.reference()[half:]
    instance = _half_way(bench)
    state = instance.state()
    run(instance, level, first=half)
    for again in ("", " the second time"):
        instance.restore(state)
        rows = run(instance, level, first=half)
        expect_same(bench, expected, rows, f"the run after going back{again}")
    instance.restore(state)
    advance(instance, level, half)
    instance.keep(state)  # a copy may be written over
    run(instance, level, first=half + 1)
    instance.restore(state)
    rows = run(instance, level, first=half + 1)
    expect_same(bench, expected[1:], rows, "the run after going back to an overwritten copy")
    instance.free_state(state)
    instance.free()
    return "a run goes on from a saved state, each time"


def serialise(bench: Bench) -> str:
    if not bench.subject.serialises:
        raise NotApplicableError("the FMU does not claim to serialise its state")
    half, level = _half(bench), bench.facts["level"]
    expected = bench.reference()[half:]
    instance = _half_way(bench)
    state = instance.state()
    data = instance.serialised(state)
    instance.free_state(state)
    run(instance, level, first=half)
    state = instance.deserialised(data)
    instance.restore(state)
    instance.free_state(state)
    rows = run(instance, level, first=half)
    expect_same(bench, expected, rows, "the run after going back to a serialised state")
    instance.free()
    return f"{len(data)} bytes"


def _write_state(bench: Bench) -> str:
    if not bench.subject.serialises:
        raise NotApplicableError("the FMU does not claim to serialise its state")
    bench.reference()
    instance = _half_way(bench)
    state = instance.state()
    (bench.folder / "state").write_bytes(instance.serialised(state))
    instance.free_state(state)
    instance.free()
    return ""


def _go_on_from_state(bench: Bench) -> str:
    half, level = _half(bench), bench.facts["level"]
    expected = bench.reference()[half:]
    instance = bench.instance()
    instance.begin()
    state = instance.deserialised((bench.folder / "state").read_bytes())
    instance.restore(state)
    rows = run(instance, level, first=half)
    instance.free_state(state)
    instance.free()
    expect_same(bench, expected, rows, "the run from a state of another process")
    return "a run goes on from a state that another process has saved"


def step_sizes(bench: Bench) -> str:
    subject = bench.subject
    if not subject.variable_steps:
        raise NotApplicableError("the FMU does not claim to handle steps of any size")
    cuts = [cut for cut in CUTS if _allowed(subject, subject.step / cut)]
    if not cuts:
        raise NotApplicableError(f"the FMU has fixed internal steps of {subject.internal_step:g} s")
    expected, level = bench.reference(), bench.facts["level"]
    for cut in cuts:
        instance = bench.instance()
        try:
            rows = run(begin(instance, level), level, cut=cut)
        except RefusedError as refusal:
            if refusal.status == DISCARD:
                raise NotApplicableError(f"steps of {subject.step / cut:g} s: {refusal}") from None
            raise
        finally:
            instance.free()
        what = f"steps of {subject.step:g} s cut into {cut}"
        expect_same(bench, expected, rows, what, subject.tolerance)
    parts = " and ".join(map(str, cuts))
    return f"steps of {subject.step:g} s cut into {parts}, to {subject.tolerance:g}"


def _allowed(subject: Subject, step: float) -> bool:
    if subject.internal_step is None:
        return True
    parts = step / subject.internal_step
    return parts > 0.5 and abs(parts - round(parts)) < 1e-6


def instances(bench: Bench) -> str:
    _refuse_single(bench)
    level = bench.facts["level"]
    expected = [bench.reference()]
    for n in range(INSTANCES):
        instance = bench.instance()
        rows = run(begin(instance, level, n), level, n)
        instance.free()
        if n == 0:
            expect_same(bench, expected[0], rows, "a second instance")
        else:
            expected.append(rows)
    many = [bench.instance(f"conformance {n}") for n in range(INSTANCES)]
    for n, instance in enumerate(many):
        begin(instance, level, n)
    interleaved = [[instance.outputs()] for instance in many]
    for step in range(bench.subject.steps):
        for n, instance in enumerate(many):
            interleaved[n].append(advance(instance, level, step, n))
    for n, instance in enumerate(many):
        expect_same(bench, expected[n], interleaved[n], f"{INSTANCES} instances in turn")
        instance.free()
    return f"{INSTANCES} instances in turn do what each does alone"


def _refuse_single(bench: Bench) -> None:
    if bench.subject.once:
        raise NotApplicableError("the FMU allows one instance per process")


def threads(bench: Bench) -> str:
    _refuse_single(bench)
    level = bench.facts["level"]
    expected = [bench.reference()]
    for n in range(1, INSTANCES):
        instance = bench.instance()
        expected.append(run(begin(instance, level, n), level, n))
        instance.free()
    problems: list[Exception] = []
    together = threading.Barrier(INSTANCES)

    def work(n: int) -> None:
        together.wait()
        try:
            for _ in range(5):
                instance = bench.instance(f"conformance {n}")
                rows = run(begin(instance, level, n), level, n)
                instance.free()
                expect_same(bench, expected[n], rows, f"{INSTANCES} threads at once")
        except (ConformanceError, RefusedError) as problem:
            problems.append(problem)

    workers = [threading.Thread(target=work, args=(n,)) for n in range(INSTANCES)]
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    sys.setswitchinterval(interval)
    if problems:
        raise problems[0]
    return f"{INSTANCES} threads with an instance each do what each does alone"


def derivatives(bench: Bench) -> str:
    subject = bench.subject
    if not subject.derivatives:
        raise NotApplicableError("the FMU does not claim directional derivatives")
    pairs = [
        (subject.variables[y], [v for v in map(subject.variables.__getitem__, u) if _smooth(v)])
        for y, u in subject.dependencies
        if _smooth(subject.variables[y])
    ]
    pairs = [(y, u) for y, u in pairs if u]
    if not pairs:
        raise NotApplicableError("no real output depends directly on a real input")
    instance = bench.instance()
    instance.enter()  # there, values may be set and read in turn
    compared = 0
    for number in range(3):
        moved = stimulus(subject, _REALS, number + 1, number)
        point = {v: [_inside(v, float(value)) for value in values] for v, values in moved}
        for y, u in pairs:
            for variable in u:
                instance.set(variable, point[variable])
            compared += _compare_derivative(instance, y, u, point)
    instance.free()
    if not compared:
        raise NotApplicableError("no point was found with derivatives that differences can confirm")
    return f"{compared} directions agree with differences"


def _smooth(variable: Variable) -> bool:
    """Whether differences of its values are exact enough."""
    return variable.real and variable.kind != "Float32" and not variable.clocked


def _inside(variable: Variable, value: float) -> float:
    """A value that can be moved to both sides."""
    low, high = variable.min, variable.max
    if low is not None and high is not None:
        margin = min(0.1, 0.1 * (high - low))
        return min(max(value, low + margin), high - margin)
    value = value if low is None else max(value, low + 0.1)
    return value if high is None else min(value, high - 0.1)


def _compare_derivative(
    instance: Instance, y: Variable, u: Sequence[Variable], point: dict[Variable, list[float]]
) -> int:
    """How many random directions agree."""
    generator = random.Random(y.reference)
    inner = [value for v in u for value in point[v]]
    agreed = 0
    for _ in range(3):
        seed = [generator.uniform(-1.0, 1.0) for _ in inner]
        try:
            claimed = instance.derivative(y, u, seed)
            coarse, fine = (_difference(instance, y, u, inner, seed, h) for h in (2e-5, 1e-5))
        except RefusedError as refusal:
            if refusal.status == DISCARD:  # a point without a derivative
                return agreed
            raise
        for i, (d, rough, good) in enumerate(zip(claimed, coarse, fine, strict=True)):
            size = max(1.0, abs(good))
            if not abs(rough - good) < 1e-3 * size:  # a kink
                continue
            if not abs(d - good) <= 1e-5 * size + 10.0 * abs(rough - good):
                element = y.name if y.size == 1 else f"{y.name}[{i + 1}]"
                raise ConformanceError(
                    f"the derivative of {element} along {', '.join(v.name for v in u)} must be "
                    f"{good:.6g} by differences, got {d:.6g}"
                )
            agreed += 1
    return agreed


def _difference(
    instance: Instance,
    y: Variable,
    u: Sequence[Variable],
    point: Sequence[float],
    seed: Sequence[float],
    h: float,
) -> list[float]:
    ends: list[Values] = []
    for sign in (1.0, -1.0, 0.0):
        moved = iter(p + sign * h * s for p, s in zip(point, seed, strict=True))
        for v in u:
            instance.set(v, [next(moved) for _ in range(v.size)])
        ends.append(instance.values([y]))
    return [(a - b) / (2.0 * h) for a, b, _ in zip(*ends, strict=True)]


# ---- calls that a host should not make ----

Act = Callable[[Instance], object]

_NEW, _INITIALISING, _STEPPING, _STEPPED, _TERMINATED = range(5)
Probe = tuple[str, int, Act]
"""Words for a call, the mode of the instance that it is made on, and the call."""


def _probed(bench: Bench, probes: Sequence[Probe]) -> str:
    """Make each call on an instance of its own; nothing matters but that it returns."""
    level = bench.facts["level"]
    for number, (label, mode, act) in enumerate(probes):
        if number < bench.first:
            continue
        bench.trace.probe(number, label)
        instance = bench.instance()
        if mode == _INITIALISING:
            instance.enter()
        elif mode > _INITIALISING:
            begin(instance, level)
        if mode > _STEPPING:
            advance(instance, level, 0)
        if mode == _TERMINATED:
            instance.do("Terminate")
        act(instance)
        instance.free()
    return f"{len(probes)} calls answered" if probes else ""


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


def illegal_calls(bench: Bench) -> str:
    subject, fmi = bench.subject, bench.subject.fmi
    t, h = subject.start, subject.step
    spare = ctypes.create_string_buffer(4096)
    pointer = ctypes.c_void_p()
    library = bench.library

    def enter(instance: Instance) -> None:
        instance.try_enter()

    def step_after_reset(instance: Instance) -> None:
        instance.do("Reset")
        _step(t, h)(instance)

    probes: list[Probe] = [
        ("a step before initialisation", _NEW, _step(t, h)),
        ("a step during initialisation", _INITIALISING, _step(t, h)),
        ("a step after termination", _TERMINATED, _step(t + h, h)),
        ("a step after a reset", _STEPPED, step_after_reset),
        ("a step of 0 s", _STEPPING, _step(t, 0.0)),
        ("a step of negative size", _STEPPING, _step(t, -h)),
        ("a step of NaN s", _STEPPING, _step(t, math.nan)),
        ("a step from a time that is not the current one", _STEPPED, _step(t + 10.0 * h, h)),
        ("a step from the past", _STEPPED, _step(t - h, h)),
        ("a step from NaN", _STEPPING, _step(math.nan, h)),
        ("the end of an initialisation that has not begun", _NEW, _call("ExitInitializationMode")),
        ("the end of an initialisation that is over", _STEPPING, _call("ExitInitializationMode")),
        ("a second initialisation", _STEPPED, enter),
        ("an initialisation within the initialisation", _INITIALISING, enter),
        ("a termination before initialisation", _NEW, _call("Terminate")),
        ("a termination during initialisation", _INITIALISING, _call("Terminate")),
        ("a second termination", _TERMINATED, _call("Terminate")),
        ("a reset before initialisation", _NEW, _call("Reset")),
        ("a reset during initialisation", _INITIALISING, _call("Reset")),
    ]
    for v in subject.of("output")[:1] + subject.of("parameter")[:1]:
        if v.kind in C_TYPES[fmi] and v.kind != "String":
            values = v.start or (0,) * v.size
            probes.append((f"setting {v.name} between steps", _STEPPED, _set(v, values)))
            probes.append((f"setting {v.name} after termination", _TERMINATED, _set(v, values)))
    if not subject.saves:
        get = library.state("GetFMUState")
        call = _call(get, ctypes.byref(pointer))
        probes.append((f"fmi{fmi}{get}, which is not claimed", _STEPPED, call))
    if not subject.serialises:
        name = library.state("DeserializeFMUState")
        call = _call(name, spare, 16, ctypes.byref(pointer))
        probes.append((f"fmi{fmi}{name}, which is not claimed", _STEPPED, call))
    else:
        probes += [
            (f"a serialised state of {text}", _STEPPED, _deserialise(size))
            for text, size in (("no bytes", 0), ("too few bytes", -1), ("too many bytes", 1))
        ]
    names: dict[str, tuple[Any, ...]]
    if fmi == 2:
        names = {
            "CancelStep": (),
            **{f"Get{k}Status": (2, spare) for k in ("", "Real", "Integer", "Boolean", "String")},
        }
        if not subject.derivatives:
            names["GetDirectionalDerivative"] = (spare, 1, spare, 1, spare, spare)
    else:
        pointers = (spare,) * 6
        names = {
            "EnterEventMode": (), "EnterStepMode": (), "EnterConfigurationMode": (),
            "ExitConfigurationMode": (), "UpdateDiscreteStates": pointers,
        }  # fmt: skip
        if not subject.derivatives:
            names["GetDirectionalDerivative"] = (spare, 1, spare, 1, spare, 1, spare, 1)
    for name, arguments in names.items():
        probes.append((f"fmi{fmi}{name}", _STEPPED, _call(name, *arguments)))
    token = b"not the token of this FMU"
    probes.append(("instantiation with a wrong token", _NEW, _instantiate(b"conformance", token)))
    token = subject.token.encode()
    probes.append(("instantiation with an empty name", _NEW, _instantiate(b"", token)))
    return _probed(bench, probes)


def _instantiate(name: bytes | None, token: bytes | None, logger: bool = True) -> Act:
    def act(instance: Instance) -> None:
        library = instance.library
        instance.free()  # there may be one only
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
    probes: list[Probe] = []
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
                    probes.append((f"fmi{subject.fmi}{verb}{kind} of {text}", mode, act))
    return _probed(bench, probes)


def _access(name: str, reference: int, c_type: Any) -> Act:
    def act(instance: Instance) -> None:
        buffer = (c_type * 64)()  # with room for more than is asked for
        instance.try_(name, *instance.library.access([reference], buffer))

    return act


def invalid_values(bench: Bench) -> str:
    subject = bench.subject
    probes: list[Probe] = []
    settable = [v for v in _settable(subject) if v.number or v.choice]
    for v in settable[:: max(1, len(settable) // _SAMPLE)]:
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
    subject, fmi = bench.subject, bench.subject.fmi
    spare = ctypes.create_string_buffer(4096)
    token, size = subject.token.encode(), (1,) if fmi == 3 else ()
    nothing = (0,) if fmi == 3 else ()
    t, h = subject.start, subject.step
    probes: list[Probe] = [
        (f"fmi{fmi}FreeInstance(NULL)", _NEW, _bare("FreeInstance", None)),
        (f"fmi{fmi}SetDebugLogging without categories", _STEPPED,
         _call("SetDebugLogging", 1, 0, None)),
        (f"fmi{fmi}Instantiate without a name", _NEW, _instantiate(None, token)),
        (f"fmi{fmi}Instantiate without a token", _NEW, _instantiate(b"conformance", None)),
    ]  # fmt: skip
    if fmi == 3:
        probes.append(
            ("fmi3InstantiateCoSimulation without a logger", _NEW,
             _instantiate(b"conformance", token, logger=False))
        )  # fmt: skip
    for kind in C_TYPES[fmi]:
        here = [v for v in subject.variables if v.kind == kind]
        for verb in ("Get", "Set"):
            name = f"{verb}{kind}"
            probes.append(
                (f"fmi{fmi}{name} of no values, with NULL", _STEPPED,
                 _call(name, None, 0, None, *nothing))
            )  # fmt: skip
            settable = [v for v in here if v.causality in ("input", "parameter")]
            for v in here[:1] if verb == "Get" else settable[:1]:
                mode = _STEPPED if verb == "Get" else _NEW
                reference = (ctypes.c_uint32 * 1)(v.reference)
                sizes = (v.size,) if fmi == 3 else ()
                probes += [
                    (f"fmi{fmi}{name} with NULL for the references", mode,
                     _call(name, None, 1, spare, *sizes)),
                    (f"fmi{fmi}{name} with NULL for the values", mode,
                     _call(name, reference, 1, None, *sizes)),
                    (f"fmi{fmi}{name}(NULL, …)", mode,
                     _bare(name, None, reference, 1, spare, *sizes)),
                ]  # fmt: skip
    for name in ("ExitInitializationMode", "Terminate", "Reset"):
        probes.append((f"fmi{fmi}{name}(NULL)", _NEW, _bare(name, None)))
    probes.append(
        (f"fmi{fmi}DoStep(NULL, …)", _NEW,
         lambda i: i.library.call("DoStep", None, *i.step_arguments(t, h)))
    )  # fmt: skip
    if fmi == 3:
        probes.append(
            ("fmi3DoStep with NULL for the results", _STEPPING,
             _call("DoStep", t, h, True, None, None, None, None))
        )  # fmt: skip
    state = bench.library.state
    empty = ctypes.byref(ctypes.c_void_p())
    if subject.saves:
        name = state("FreeFMUState")
        probes += [
            (f"fmi{fmi}{name} of no state", _STEPPED, _call(name, empty)),
            (f"fmi{fmi}{name}(…, NULL)", _STEPPED, _call(name, None)),
            *((f"fmi{fmi}{name}(…, NULL)", _STEPPED, _call(name, None))
              for name in map(state, ("GetFMUState", "SetFMUState"))),
        ]  # fmt: skip
    if subject.serialises:
        name = state("SerializedFMUStateSize")
        probes.append((f"fmi{fmi}{name}(…, NULL, …)", _STEPPED, _call(name, None, spare)))
        name = state("SerializeFMUState")
        probes.append((f"fmi{fmi}{name}(…, NULL, …)", _STEPPED, _call(name, None, spare, 4096)))
        name = state("DeserializeFMUState")
        probes.append((f"fmi{fmi}{name}(…, NULL, …)", _STEPPED, _call(name, None, 16, empty)))
    if subject.derivatives:
        probes.append(
            (f"fmi{fmi}GetDirectionalDerivative with NULL everywhere", _STEPPED,
             _call("GetDirectionalDerivative", None, 1, None, 1, None, *size, None, *size))
        )  # fmt: skip
    return _probed(bench, probes)


def leaks(bench: Bench) -> str:
    subject, level = bench.subject, bench.facts["level"]
    inputs = bench.library.settings(stimulus(subject, level, 0))
    sizes: list[tuple[int, ...]] = []
    for life in range(LIVES + 1):
        if life in _MEASURED:
            sizes.append(_memory())
        instance = begin(bench.instance(), level)
        instance.set_all(inputs)
        if subject.saves:
            instance.free_state(instance.state())
        instance.step(subject.start, subject.step)
        instance.do("Terminate")
        instance.free()
    # What fills up once does so in one of the intervals; a leak goes on.
    lives = _MEASURED[1] - _MEASURED[0]
    growth = max(min(b - a, c - b) for a, b, c in zip(*sizes, strict=True)) / lives
    if growth > _LEAK:
        raise ConformanceError(f"each of {LIVES:,} instances leaves {growth:.0f} bytes behind")
    return f"{LIVES:,} instances leave nothing behind"


class _Mallinfo2(ctypes.Structure):
    _fields_ = tuple(
        (name, ctypes.c_size_t)
        for name in (
            "arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks", "uordblks",
            "fordblks", "keepcost",
        )
    )  # fmt: skip


def _memory() -> tuple[int, ...]:
    """Bytes of memory that this process occupies, and, with glibc, that it has allocated."""
    gc.collect()  # an FMU may be written in Python
    # A small leak hides in what was freed before, and is seen in what is allocated; an FMU with an
    # allocator of its own is seen in what is occupied.
    sizes = []
    try:
        info = ctypes.CDLL(None).mallinfo2
        info.restype = _Mallinfo2
        now = info()
        sizes.append(now.uordblks + now.hblkhd)
    except (AttributeError, TypeError):
        pass
    try:  # what Linux tells elsewhere is not exact
        rollup = Path("/proc/self/smaps_rollup").read_text()
        sizes += [int(kB) * 1024 for kB in re.findall(r"^Rss:\s*(\d+) kB", rollup, re.MULTILINE)]
    except OSError:
        try:
            import resource
        except ImportError:
            raise NotApplicableError("the memory of a process cannot be measured here") from None
        most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        sizes.append(most if sys.platform == "darwin" else most * 1024)
    return tuple(sizes)


@dataclass(frozen=True, slots=True)
class Check:
    """A dynamic check.

    Attributes
    ----------
    what
        The promise, for people.
    steps
        What is done, each step in a process of its own.
    """

    name: str
    what: str
    steps: tuple[Callable[[Bench], str], ...]


CHECKS = (
    Check("functions", "every function of the standard is exported", (functions,)),
    Check("life cycle", "it lives from instantiation to its end, and again", (life_cycle,)),
    Check("reset", "an instance after a reset is a fresh one", (reset,)),
    Check("save and restore", "a run goes on from a saved state", (save_and_restore,)),
    Check("serialise", "a run goes on from a serialised state", (serialise,)),
    Check(
        "new process",
        "a run goes on from a state that another process has serialised",
        (_write_state, _go_on_from_state),
    ),
    Check("step sizes", "results do not depend on how an interval is cut", (step_sizes,)),
    Check("instances", "instances of one process do not disturb each other", (instances,)),
    Check("threads", "instances in several threads do not disturb each other", (threads,)),
    Check("derivatives", "directional derivatives are limits of differences", (derivatives,)),
    Check("illegal calls", "calls out of order are answered, without a crash", (illegal_calls,)),
    Check(
        "unknown references",
        "references of no variable are answered, without a crash",
        (unknown_references,),
    ),
    Check("invalid values", "values that cannot be are answered", (invalid_values,)),
    Check("null pointers", "null pointers are answered, without a crash", (null_pointers,)),
    Check("leaks", f"no memory is lost over {LIVES:,} instantiations", (leaks,)),
)
"""All dynamic checks, in their order; those after the life cycle need its result."""
