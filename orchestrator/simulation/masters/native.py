"""The native master: runs a plan whose components are all FMUs, in one call to C.

The loop is `c/native.c`. This module prepares its structures, starts it in a thread and waits for
it. It makes the same calls in the same order as `sblcosim.simulation.masters.python` and gives the
same record to the last bit. The loop releases Python's global lock, so several threads can run
simulations in parallel. It runs in this process, so its FMUs must return from all calls;
`sblcosim.simulation.execution` handles the others.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np
from sblcosim.fmus import stopping
from sblcosim.fmus.host.instances import DTYPES, Instance, Vector
from sblcosim.fmus.host.nanoseconds import SECOND
from sblcosim.fmus.host.watch import watch
from sblcosim.fmus.read.ports import Fmu

from ...data.record import Record
from ...errors import ConfigurationError, FmuError
from ..plans.plan import PROGRESS_INTERVAL, Column, Plan, PlannedComponent, Write
from . import c_libraries
from .python import chosen, initialised

_FAILED = 1
_ACCESS2, _GET_BOOLEAN2, _SET_BOOLEAN2, _ACCESS3, _STEP2, _STEP3 = range(6)

_I, _N, _P = ctypes.c_int64, ctypes.c_size_t, ctypes.c_void_p


class NativeCall(ctypes.Structure):
    _fields_ = (
        ("form", _I), ("function", _P), ("instance", _P), ("references", _P), ("n_references", _N),
        ("values", _P), ("n_values", _N), ("booleans", _P),
    )  # fmt: skip


class NativeCopy(ctypes.Structure):
    _fields_ = (("source", _P), ("target", _P), ("size", _N), ("row_size", _N))


class NativeConversion(ctypes.Structure):
    _fields_ = (("value", _P), ("factor", ctypes.c_double), ("offset", ctypes.c_double))


class NativeComponent(ctypes.Structure):
    _fields_ = (
        ("due", _I), ("interval", _I), ("step", ctypes.c_double), ("first_get", _N),
        ("first_set", _N), ("do_step", _N), ("first_copy", _N), ("end_copy", _N),
        ("first_conversion", _N), ("end_conversion", _N),
        ("watched", _I), ("habits", _I), ("habits_at", _I),
    )  # fmt: skip


class NativeRun(ctypes.Structure):
    _fields_ = (
        ("components", _P), ("n_components", _N), ("calls", _P), ("copies", _P),
        ("conversions", _P), ("records", _P), ("n_records", _N), ("instants", _P),
        ("n_instants", _I), ("progress", _P), ("outcome", _I), ("status", _I), ("ended_early", _I),
    )  # fmt: skip


DRIVER = c_libraries.Driver("native")


def available() -> bool:
    """Whether the loop is present or can be compiled."""
    return c_libraries.available(DRIVER)


def unsupported(plan: Plan) -> PlannedComponent | None:
    """A component that is not an FMU, if there is one."""
    return next((c for c in plan.components if not isinstance(c.source, Fmu)), None)


def execute(
    plan: Plan,
    progress: Callable[[float], None] | None = None,
    record: Sequence[str] | None = None,
) -> Record:
    """Run a plan from its start to its stop.

    Parameters
    ----------
    progress, record
        As in `sblcosim.simulation.masters.python.execute`. Outputs that are neither recorded nor
        connected are not read.

    Raises
    ------
    FmuError
        An FMU has returned a status worse than a warning.
    ConfigurationError
        A component is not an FMU, or an output to record does not exist.
    BuildError
        The loop cannot be compiled.
    """
    check(plan)
    columns = chosen(plan, record)
    run_ = library()
    with ExitStack() as stack:
        instances = [initialised(c, plan.start_ns, stack) for c in plan.components]
        program = _Program(plan, instances, columns)
        watch().begin(program.record, [(x.instance.name, x.function) for x in program.labels])
        _drive(program, run_, progress)
        for instance in instances:
            try:
                instance.terminate()
            except FmuError as error:
                watch().late(instance.name, error)
    if progress is not None:
        progress(1.0)
    return program.record


def check(plan: Plan) -> None:
    """Refuse a plan with a Python component.

    Raises
    ------
    ConfigurationError
        The plan has one.
    """
    other = unsupported(plan)
    if other is not None:
        raise ConfigurationError(
            f"{other.name}: must be an FMU for the native master, got the Python component "
            f"{other.origin}"
        )


def library() -> ctypes.CDLL:
    """The loop, and the functions that check the process state.

    Raises
    ------
    BuildError
        It cannot be compiled.
    """
    driver = c_libraries.load(DRIVER)
    driver.native_run.argtypes, driver.native_run.restype = (ctypes.POINTER(NativeRun),), None
    driver.native_remember.argtypes, driver.native_remember.restype = (), None
    driver.native_settle.argtypes, driver.native_settle.restype = (), ctypes.c_int
    return driver


@dataclass(frozen=True, slots=True)
class _Label:
    """Instance and function of a call."""

    instance: Instance
    function: str


class _Program:
    """A plan in the loop's structures, with the memory they point to."""

    def __init__(
        self, plan: Plan, instances: Sequence[Instance], columns: Sequence[Column]
    ) -> None:
        self.instances = instances
        self.instants = plan.instants
        self.labels: list[_Label] = []
        self._calls: list[NativeCall] = []
        self._copies: list[NativeCopy] = []
        self._conversions: list[NativeConversion] = []
        self._keep: list[Any] = [instances]
        used = {c.name for c in columns} | {
            column.name
            for component in plan.components
            for write in component.writes
            for column in write.columns
        }
        self._newest = {
            name: rows[0]
            for name, rows in _allocated(
                [c for c in plan.columns if c.name in used], 1, np.zeros
            ).items()
        }
        history = _allocated(columns, len(self.instants), watch().array)
        components = [
            self._component(component, instance, plan.start_ns)
            for component, instance in zip(plan.components, instances, strict=True)
        ]
        records = _joined(
            NativeCopy(_address(newest), _address(rows), newest.nbytes, rows.strides[0])
            for newest, rows in ((self._newest[name], rows) for name, rows in history.items())
        )
        self.components = (NativeComponent * len(components))(*components)
        self.progress = watch().progress()
        self.run = NativeRun(
            components=ctypes.addressof(self.components),
            n_components=len(components),
            calls=self._array(NativeCall, self._calls),
            copies=self._array(NativeCopy, self._copies),
            conversions=self._array(NativeConversion, self._conversions),
            records=self._array(NativeCopy, records),
            n_records=len(records),
            instants=_address(self.instants),
            n_instants=len(self.instants),
            progress=ctypes.addressof(self.progress),
        )
        self.record = Record(
            self.instants,
            {c.name: history[c.name].reshape(-1, *c.shape) for c in columns},
            plan.intervals_ns,
        )

    def _component(
        self, component: PlannedComponent, instance: Instance, start_ns: int
    ) -> NativeComponent:
        first_get = len(self._calls)
        for read in component.reads:
            ports = [p for p in read.ports if f"{component.name}.{p.name}" in self._newest]
            if ports:  # their values are contiguous
                first = self._newest[f"{component.name}.{ports[0].name}"]
                size = sum(p.size for p in ports)
                references = [r for p in ports for r in p.references]
                self._access(instance, "Get", read.type, references, _address(first), size)
        first_set, first_copy = len(self._calls), len(self._copies)
        first_conversion = len(self._conversions)
        for write in component.writes:
            values = self._gathered(write)
            size = len(write.sources)
            self._access(instance, "Set", write.type, write.references, values, size)
        do_step = len(self._calls)
        form = _STEP2 if instance.fmu.fmi == 2 else _STEP3
        self._call(instance, f"fmi{instance.fmu.fmi}DoStep", form=form)
        return NativeComponent(
            due=start_ns,
            interval=component.interval_ns,
            step=component.interval_ns / SECOND,
            first_get=first_get,
            first_set=first_set,
            do_step=do_step,
            first_copy=first_copy,
            end_copy=len(self._copies),
            first_conversion=first_conversion,
            end_conversion=len(self._conversions),
            watched=watch().watches(component.name),
        )

    def _gathered(self, write: Write) -> int:
        """Address at which the inputs are gathered in sequence and converted."""
        sources, place = [], 0
        for port, column in zip(write.ports, write.columns, strict=True):
            first = write.sources[place] - column.start if port.size else 0
            sources.append(self._newest[column.name][first : first + port.size])
            place += port.size
        inputs = np.zeros(sum(s.size for s in sources), sources[0].dtype)
        start = self._kept(inputs)
        ends = np.cumsum([s.nbytes for s in sources]).tolist()
        copies = _joined(
            NativeCopy(_address(source), start + end - source.nbytes, source.nbytes, 0)
            for source, end in zip(sources, ends, strict=True)
        )
        if len(copies) == 1 and not write.conversions:  # already contiguous: no copy needed
            return int(copies[0].source)
        self._conversions += [
            NativeConversion(start + place * inputs.itemsize, conversion.factor, conversion.offset)
            for place, conversion in write.conversions
        ]
        self._copies += copies
        return start

    def _access(
        self,
        instance: Instance,
        verb: str,
        kind: str,
        references: Sequence[int],
        values: int,
        size: int,
    ) -> None:
        form, booleans = _ACCESS3, None
        if instance.fmu.fmi == 2:
            form = _ACCESS2
            if kind == "Boolean":
                form = _GET_BOOLEAN2 if verb == "Get" else _SET_BOOLEAN2
                booleans = self._kept(np.zeros(size, np.intc))
        self._call(
            instance,
            instance.function(verb, kind),
            form=form,
            references=self._kept(np.array(references, np.uint32)),
            n_references=len(references),
            values=values,
            n_values=size,
            booleans=booleans,
        )

    def _call(self, instance: Instance, function: str, **rest: int | None) -> None:
        self.labels.append(_Label(instance, function))
        self._calls.append(
            NativeCall(function=instance.address(function), instance=instance.handle, **rest)
        )

    def _kept(self, array: Vector) -> int:
        self._keep.append(array)
        return _address(array)

    def _array(self, kind: type[ctypes.Structure], items: Sequence[ctypes.Structure]) -> int:
        array = (kind * len(items))(*items)
        self._keep.append(array)
        return ctypes.addressof(array)

    def check(self) -> None:
        """Report changes to the process state; raise the error that ended the run early."""
        for component in self.components:
            if component.habits:
                label = self.labels[component.habits_at]
                watch().habit(label.instance.name, label.function, component.habits)
        if self.run.outcome == _FAILED:
            label = self.labels[self.progress.at]
            if self.run.ended_early:
                label.instance.ended_early()
            now_ns = int(self.instants[self.progress.row])
            raise label.instance.failure(label.function, self.run.status, now_ns)


def _allocated(
    columns: Sequence[Column], rows: int, memory: Callable[..., Vector]
) -> dict[str, Vector]:
    """Memory for each column; columns of one type are contiguous within a row."""
    arrays: dict[str, Vector] = {}
    for kind, dtype in DTYPES.items():
        group = [c for c in columns if c.type == kind]
        block = memory((rows, sum(c.stop - c.start for c in group)), dtype)
        start = 0
        for c in group:
            size = c.stop - c.start
            arrays[c.name] = block[:, start : start + size]
            start += size
    return arrays


def _address(array: Vector) -> int:
    return int(array.ctypes.data)


def _joined(copies: Iterable[NativeCopy]) -> list[NativeCopy]:
    """Merge copies that continue each other."""
    joined: list[NativeCopy] = []
    for copy in copies:
        last = joined[-1] if joined else None
        if (
            last is not None
            and last.source + last.size == copy.source
            and last.target + last.size == copy.target
        ):
            last.size += copy.size
        else:
            joined.append(copy)
    return joined


def _drive(
    program: _Program, driver: ctypes.CDLL, progress: Callable[[float], None] | None
) -> None:
    """Run the loop in a thread and wait for it, so that Ctrl-C gets through."""
    if watch().direct:
        driver.native_run(ctypes.byref(program.run))
        return program.check()
    done = threading.Event()

    def work() -> None:
        driver.native_run(ctypes.byref(program.run))
        done.set()

    try:
        threading.Thread(target=work, name="native master", daemon=True).start()
        row = 0
        while not done.wait(PROGRESS_INTERVAL):
            stopping.check()
            if progress is not None and program.progress.row != row:
                row = program.progress.row
                progress(row / (len(program.instants) - 1))
    except BaseException:
        program.progress.cancel = 1
        done.wait()  # the loop still uses the instances
        raise
    return program.check()
