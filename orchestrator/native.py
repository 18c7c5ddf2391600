"""The native master: runs a plan whose components are all FMUs, in one call of C.

The loop is `c/native.c`; here is what prepares its structures, starts it in a thread of its own and
watches it. It does what `sblcosim.master` does, in the same order, and gives the same record to the
last bit. The loop runs without Python's global lock, so that several runs in several threads of the
caller go on side by side.
"""

from __future__ import annotations

import ctypes
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from sblcosim.fmus import compiler as compilers
from sblcosim.fmus import factory

from .errors import BuildError, ConfigurationError, FmuError
from .fmu import DTYPES, Fmu, Instance, Vector
from .master import PROGRESS_INTERVAL, chosen, initialised
from .plan import Column, Plan, PlannedComponent
from .record import Record
from .system import SECOND

STEP_TIMEOUT = 60.0
"""Seconds after which a call that does not return is given up, unless told otherwise."""

_GRACE = 1.0
"""Seconds that a run has to end after it was cancelled; then it is left to itself."""

_SIGNAL_STACK = 65536

_FINISHED, _FAILED, _CANCELLED, _CRASHED = range(4)
_ACCESS2, _GET_BOOLEAN2, _SET_BOOLEAN2, _ACCESS3, _STEP2, _STEP3 = range(6)

_I, _N, _P = ctypes.c_int64, ctypes.c_size_t, ctypes.c_void_p


class _Call(ctypes.Structure):
    _fields_ = (
        ("form", _I), ("function", _P), ("instance", _P), ("references", _P), ("n_references", _N),
        ("values", _P), ("n_values", _N), ("booleans", _P),
    )  # fmt: skip


class _Copy(ctypes.Structure):
    _fields_ = (("source", _P), ("target", _P), ("size", _N), ("row_size", _N))


class _Component(ctypes.Structure):
    _fields_ = (
        ("due", _I), ("interval", _I), ("step", ctypes.c_double), ("first_get", _N),
        ("first_set", _N), ("do_step", _N), ("first_copy", _N), ("end_copy", _N),
    )  # fmt: skip


class _Run(ctypes.Structure):
    _fields_ = (
        ("components", _P), ("n_components", _N), ("calls", _P), ("copies", _P), ("records", _P),
        ("n_records", _N), ("instants", _P), ("n_instants", _I), ("stack", _P), ("stack_size", _N),
        ("outcome", _I), ("status", _I), ("ended_early", _I), ("row", _I), ("at", _I),
        ("cancel", _I),
    )  # fmt: skip


def available() -> bool:
    """Whether the loop is there or can be compiled."""
    try:
        return _ready().is_file() or bool(compilers.find())
    except BuildError:
        return False


def foreign(plan: Plan) -> PlannedComponent | None:
    """A component that is not an FMU, if there is one."""
    return next((c for c in plan.components if not isinstance(c.source, Fmu)), None)


def execute(
    plan: Plan,
    progress: Callable[[float], None] | None = None,
    record: Sequence[str] | None = None,
    step_timeout: float = STEP_TIMEOUT,
) -> Record:
    """Run a plan from its start to its stop.

    Parameters
    ----------
    progress, record
        As in `sblcosim.master.execute`. Outputs that are neither recorded nor connected are not
        read.
    step_timeout
        A call that has not returned after so many seconds is given up. Its thread and the run's
        instances are left as they are, until the process ends.

    Raises
    ------
    FmuError
        An FMU has returned a status that is worse than a warning, has crashed, or does not return.
        Crashes are not seen on Windows. A crash is recognised by its signal: the FMU must not use
        these signals itself, as some virtual machines do.
    ConfigurationError
        A component is not an FMU, or there is no such output to record.
    BuildError
        The loop cannot be compiled.
    """
    other = foreign(plan)
    if other is not None:
        raise ConfigurationError(
            f"{other.name}: must be an FMU for the native master, got the Python component "
            f"{other.origin}"
        )
    if not step_timeout > 0:
        raise ConfigurationError(f"step timeout: must be positive, got {step_timeout!r}")
    columns = chosen(plan, record)
    run_ = _driver()
    with ExitStack() as stack:
        instances = [initialised(c, plan.start_ns, stack) for c in plan.components]
        program = _Program(plan, instances, columns)
        _drive(program, run_, progress, step_timeout)
        for instance in instances:
            instance.terminate()
    if progress is not None:
        progress(1.0)
    return program.record


def _ready() -> Path:
    """The loop, if it came compiled."""
    return Path(__file__).with_name("c") / "native.so"


@cache
def _driver() -> ctypes.CDLL:
    path = _ready()
    if not path.is_file():
        source = path.with_suffix(".c")
        path = factory.library("native", {source.name: source.read_bytes()})
    driver = ctypes.CDLL(str(path))
    driver.native_run.argtypes, driver.native_run.restype = (ctypes.POINTER(_Run),), None
    driver.native_guard.argtypes, driver.native_guard.restype = (ctypes.c_int,), None
    return driver


@dataclass(frozen=True, slots=True)
class _Label:
    """Whose call it is, and of which function."""

    instance: Instance
    function: str


class _Program:
    """A plan in the loop's structures, and the memory they point to."""

    def __init__(
        self, plan: Plan, instances: Sequence[Instance], columns: Sequence[Column]
    ) -> None:
        self.instances = instances
        self.labels: list[_Label] = []
        self.instants = plan.instants
        self._keep: list[Any] = []
        self._calls: list[_Call] = []
        self._copies: list[_Copy] = []
        wanted = {c.name for c in columns} | {
            connection.source
            for component in plan.components
            for write in component.writes
            for connection in write.connections
        }
        newest = _views([c for c in plan.columns if c.name in wanted], ())
        history = _views(columns, (len(self.instants),))
        components = [
            self._component(component, instance, plan.start_ns, newest)
            for component, instance in zip(plan.components, instances, strict=True)
        ]
        records = _merged(
            _Copy(*_span(newest[c.name]), _span(history[c.name][0])[0], history[c.name].strides[0])
            for c in ()
        )
        self.record = Record(
            self.instants, {c.name: history[c.name].reshape(-1, *c.shape) for c in columns}
        )
