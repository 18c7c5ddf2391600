"""The Python master: runs a plan with FMPy.

At each communication instant it reads and records the outputs of all components that are due, sets
their inputs, and only then lets each step. Their order therefore has no effect, and inputs have no
delay.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus import stopping
from sblcosim.fmus.host import instances
from sblcosim.fmus.host.instances import DTYPES, WARNING, Vector
from sblcosim.fmus.host.nanoseconds import SECOND, text_of
from sblcosim.fmus.host.watch import watch
from sblcosim.fmus.read.ports import Fmu

from ... import errors
from ...data.record import Record
from ...errors import ConfigurationError, FmuError, SblcosimError, instance, nearest, one_line
from ..code.user_code import CONSTRUCTOR, foreseen, raised
from ..plans.plan import PROGRESS_INTERVAL, Column, Plan, PlannedComponent, Read, Write
from ..resolve import resolve
from ..system import ComponentSpec, System

_Vectors = Mapping[str, Vector]
"""Latest outputs of all components, by type; see `sblcosim.simulation.plans.plan`."""


def execute(
    plan: Plan,
    progress: Callable[[float], None] | None = None,
    record: Sequence[str] | None = None,
    played: Record | None = None,
) -> Record:
    """Run a plan from its start to its stop.

    Parameters
    ----------
    played
        Record of some components, which are played back from it instead of being run.
    progress
        Called with the completed share of the run, at most ten times per second, and with 1 at the
        end.
    record
        Outputs to record, ``"component.variable"``; None: all.

    Raises
    ------
    FmuError
        An FMU has returned a status worse than a warning.
    ConfigurationError
        A Python component has raised an exception or returned values that do not match its
        declaration, or an output to record does not exist.
    """
    columns = chosen(plan, record)
    instants = plan.instants
    vectors = _vectors_of(plan)
    history = {
        kind: watch().array((len(instants), n), DTYPES[kind]) for kind, n in plan.sizes.items()
    }
    result = Record(
        time_ns=instants,
        values={
            c.name: history[c.type][:, c.start : c.stop].reshape(-1, *c.shape) for c in columns
        },
        intervals_ns=plan.intervals_ns,
    )
    recorded = [(rows, vectors[kind]) for kind, rows in history.items()]
    with ExitStack() as stack:
        known = played.intervals_ns if played is not None else {}
        components = [c for c in plan.components if c.name not in known]
        runners = [(c.interval_ns, _start(c, plan, vectors, stack)) for c in components]
        watch().begin(result, ())
        playing = [] if played is None else [(1, _Playback(played, plan, vectors))]
        _loop(plan, [*playing, *runners], recorded, progress)
        for (_, runner), component in zip(runners, components, strict=True):
            try:
                runner.finish()
            except FmuError as error:
                watch().late(component.name, error)
    if progress is not None:
        progress(1.0)
    return result


def _loop(
    plan: Plan,
    runners: Sequence[tuple[int, _Runner]],
    recorded: Sequence[tuple[Vector, Vector]],
    progress: Callable[[float], None] | None,
) -> None:
    """At each instant, read all outputs, record them, set all inputs, and step.

    Parameters
    ----------
    runners
        Communication interval [ns] and runner of each component.
    recorded
        By type: the record, with a row per instant, and the vector to copy into the row.
    """
    noted = watch().progress()
    reported = time.monotonic()
    due = [runner for _, runner in runners]
    same = len({interval for interval, _ in runners}) == 1
    last = len(plan.instants) - 1
    for row, now in enumerate(plan.instants.tolist()):
        stopping.check()
        noted.row = row
        if not same:
            elapsed = now - plan.start_ns
            due = [runner for interval, runner in runners if elapsed % interval == 0]
        for runner in due:
            runner.read(now)
        for rows, vector in recorded:
            rows[row] = vector
        if row == last:
            break
        for runner in due:
            runner.write(now)
        for runner in due:
            runner.step(now)
        if progress is not None and time.monotonic() - reported >= PROGRESS_INTERVAL:
            progress((row + 1) / last)
            reported = time.monotonic()


def chosen(plan: Plan, record: Sequence[str] | None) -> tuple[Column, ...]:
    """The columns to record, in the plan's order; None: all.

    Raises
    ------
    ConfigurationError
        There is no such output.
    """
    if record is None:
        return plan.columns
    known = [c.name for c in plan.columns]
    for name in record:
        if name not in known:
            raise ConfigurationError(
                f"{name}: must be an output of a component of the system{nearest(name, known)}"
            )
    return tuple(c for c in plan.columns if c.name in record)


def initial_outputs(
    spec: ComponentSpec, names: Sequence[str], start_ns: int = 0, plan: Plan | None = None
) -> dict[str, NDArray[Any]]:
    """Outputs of a single component at the start, before any step; ``plan`` is `alone`'s.

    Parameters
    ----------
    names
        Names of the requested outputs.

    Returns
    -------
    dict
        Values in SI units, in the shapes of the variables.

    Raises
    ------
    ConfigurationError, FmuError
        As `sblcosim.simulation.resolve.resolve` and `execute`; or an output does not exist.
    """
    plan = plan or alone(spec, start_ns)
    name = plan.components[0].name
    vectors = _vectors_of(plan)
    with ExitStack() as stack:
        (component,) = plan.components
        runner = _start(component, plan, vectors, stack)
        with watch().calling(name, "getting its outputs"):
            runner.read(start_ns)
    outputs = {
        c.name.partition(".")[2]: vectors[c.type][c.start : c.stop].reshape(c.shape)
        for c in plan.columns
    }
    for wanted in names:
        if wanted not in outputs:
            raise ConfigurationError(
                f"{name}: must have an output {wanted!r}, got none{nearest(wanted, outputs)}"
            )
    return {wanted: outputs[wanted] for wanted in names}


def alone(spec: ComponentSpec, start_ns: int) -> Plan:
    """A plan with one component and one step."""
    name = spec.fmu.stem.replace(".", "_") if isinstance(spec.fmu, Path) else "component"
    return resolve(System({name: spec}, stop_ns=start_ns + spec.interval_ns, start_ns=start_ns))


class _Runner(Protocol):
    """A component during a run. All calls take the communication instant [ns]."""

    def read(self, now: int) -> None:
        """Put the outputs into the vectors."""

    def write(self, now: int) -> None:
        """Take the inputs from the vectors."""

    def step(self, now: int) -> None:
        """Advance by the communication interval."""

    def finish(self) -> None:
        """Called at the end of the run."""


def _start(component: PlannedComponent, plan: Plan, vectors: _Vectors, stack: ExitStack) -> _Runner:
    if not isinstance(component.source, Fmu):
        return _PythonRunner(component, vectors, plan.start_ns)
    return _FmuRunner(component, initialised(component, plan.start_ns, stack), vectors)


def initialised(component: PlannedComponent, start_ns: int, stack: ExitStack) -> instances.Instance:
    """An initialised instance of a component's FMU; the stack releases it."""
    assert isinstance(component.source, Fmu)
    instance = instances.acquire(component.source, component.name)
    stack.callback(instances.release, instance)
    instance.initialise(
        start_ns,
        ((s.port, np.array(s.values, DTYPES[s.port.type])) for s in component.settings),
        component.texts,
    )
    return instance


class _Playback:
    """Plays back the outputs of components from their record."""

    def __init__(self, record: Record, plan: Plan, vectors: _Vectors) -> None:
        # Between the record's instants, its components held their outputs.
        rows = np.searchsorted(record.time_ns, plan.instants, side="right") - 1
        self._row_of = dict(zip(plan.instants.tolist(), rows.tolist(), strict=True))
        self._columns = [
            (vectors[c.type][c.start : c.stop], record.values[c.name].reshape(len(record), -1))
            for c in plan.columns
            if c.name in record.values
        ]

    def read(self, now: int) -> None:
        row = self._row_of[now]
        for target, values in self._columns:
            target[:] = values[row]

    def write(self, now: int) -> None:
        pass

    def step(self, now: int) -> None:
        pass

    def finish(self) -> None:
        pass


class _FmuRunner:
    """Calls an FMU through functions with pre-bound arguments."""

    def __init__(
        self, component: PlannedComponent, instance: instances.Instance, vectors: _Vectors
    ) -> None:
        self._instance = instance
        bound = watch().bound

        def named(verb: str, kind: str, call: instances.Call) -> instances.Call:
            return bound(component.name, instance.function(verb, kind), call)

        self._gets = []
        for r in component.reads:
            outputs = vectors[r.type][r.start : r.stop]
            get = instance.getter(r.type, r.references, outputs)
            self._gets.append((named("Get", r.type, get), r.type))
        self._sets = []
        for w in component.writes:
            inputs = np.zeros(len(w.sources), DTYPES[w.type])
            index = np.array(w.sources, np.intp)
            set_ = named("Set", w.type, instance.setter(w.type, w.references, inputs))
            convert = _converter(w, inputs)
            self._sets.append((vectors[w.type].take, index, inputs, convert, set_, w.type))
        do_step = f"fmi{instance.fmu.fmi}DoStep"
        self._step = bound(component.name, do_step, instance.stepper(component.interval_ns))

    def read(self, now: int) -> None:
        for get, kind in self._gets:
            status = get()
            if status > WARNING:
                raise self._instance.failure(self._instance.function("Get", kind), status, now)

    def write(self, now: int) -> None:
        for take, index, inputs, convert, set_, kind in self._sets:
            take(index, None, inputs, "clip")  # "clip" writes into inputs without a copy
            if convert is not None:
                convert()
            status = set_()
            if status > WARNING:
                raise self._instance.failure(self._instance.function("Set", kind), status, now)

    def step(self, now: int) -> None:
        status = self._step(now / SECOND)
        if status > WARNING:
            raise self._instance.failure(f"fmi{self._instance.fmu.fmi}DoStep", status, now)

    def finish(self) -> None:
        self._instance.terminate()


class _PythonRunner:
    """Calls a Python component and holds its outputs until the end of the step."""

    def __init__(self, component: PlannedComponent, vectors: _Vectors, start_ns: int) -> None:
        assert not isinstance(component.source, Fmu)
        self._name = component.name
        self._class = getattr(component.source, "__name__", component.origin)
        self._step_ns = component.interval_ns
        self._targets = {
            name: target
            for read in component.reads
            for name, target in _views(read, vectors[read.type]).items()
        }
        values = {
            port.name: np.array(port.start, DTYPES[port.type])
            for port in component.ports.values()
            if port.causality != "output"
        }
        for setting in component.settings:
            values[setting.port.name][:] = setting.values
        self._inputs: dict[str, NDArray[Any]] = {}
        parameters = {}
        for port in component.ports.values():
            if port.causality == "parameter":
                parameters[port.name] = values[port.name].reshape(port.shape)
            elif port.causality == "input":
                view = values[port.name].reshape(port.shape).view()
                view.flags.writeable = False
                self._inputs[port.name] = view
        self._sources = []
        for write in component.writes:
            inputs = np.zeros(len(write.sources), DTYPES[write.type])
            index = np.array(write.sources, np.intp)
            targets, first = [], 0
            for port in write.ports:
                targets.append((values[port.name], inputs[first : first + port.size]))
                first += port.size
            convert = _converter(write, inputs)
            self._sources.append((vectors[write.type], index, inputs, convert, targets))
        with watch().calling(self._name, CONSTRUCTOR), self._named("before the start"):
            self._component = component.source()
        with watch().calling(self._name, "initialise"), self._named("before the start"):
            outputs = self._component.initialise(start_ns, parameters)
        self._do_step = watch().bound(self._name, "do_step", self._component.do_step)
        self._outputs = self._fitting(outputs, start_ns)

    @contextmanager
    def _named(self, when: str) -> Iterator[None]:
        """Name the component in any exception that it raises."""
        try:
            yield
        except errors.CodeChangedError:
            raise
        except foreseen() as error:
            if isinstance(error, SblcosimError):  # from our adapter: a full sentence
                raise self._failure(f"{self._name} {when}: {one_line(error)}") from error
            raise self._failure(
                f"{self._name} {when}: must not raise an exception, got "
                f"{raised(error, self._class)}"
            ) from error

    def _failure(self, message: str) -> SblcosimError:
        error = ConfigurationError(message)
        error.component = self._name
        return error

    def _fitting(self, outputs: Mapping[str, Any], now: int) -> dict[str, NDArray[Any]]:
        """Convert outputs to arrays and check them against the declaration."""
        if not isinstance(outputs, Mapping):
            raise self._misfit(
                now, f"must return its outputs in a mapping, got {instance(outputs)}"
            )
        if outputs.keys() != self._targets.keys():
            odd = ", ".join(sorted(map(str, outputs.keys() ^ self._targets.keys())))
            raise self._misfit(
                now, f"must return exactly its outputs, got too few or too many: {odd}"
            )
        arrays = {}
        for name, target in self._targets.items():
            value = outputs[name]
            if isinstance(value, np.generic):
                value = np.asarray(value)
            elif type(value) is not np.ndarray:
                with self._named(f"at {text_of(now)}"):
                    value = np.asarray(value)
            # Most steps give arrays that fit, and must not wait for a message.
            if value.dtype != target.dtype and not np.can_cast(
                value.dtype, target.dtype, "same_kind"
            ):
                raise self._misfit(now, f"{name} must be {target.dtype}, got {value.dtype}")
            if value.shape != target.shape:
                raise self._misfit(
                    now, f"{name} must have the shape {target.shape}, got {value.shape}"
                )
            arrays[name] = value
        return arrays

    def _misfit(self, now: int, what: str) -> SblcosimError:
        return self._failure(f"{self._name} at {text_of(now)}: {what}")

    def read(self, now: int) -> None:
        for name, target in self._targets.items():
            target[...] = self._outputs[name]

    def write(self, now: int) -> None:
        for vector, index, inputs, convert, targets in self._sources:
            inputs[:] = vector[index]
            if convert is not None:
                convert()
            for values, given in targets:
                values[:] = given

    def step(self, now: int) -> None:
        try:
            outputs = self._do_step(now, self._step_ns, self._inputs)
        except foreseen():
            with self._named(f"at {text_of(now)}"):
                raise
        self._outputs = self._fitting(outputs, now + self._step_ns)

    def finish(self) -> None:
        pass


# --- Outputs of all components in one array of each type ------------------------------------------


def _vectors_of(plan: Plan) -> _Vectors:
    """Zeros for the outputs of a plan."""
    return {kind: np.zeros(size, DTYPES[kind]) for kind, size in plan.sizes.items()}


def _converter(write: Write, inputs: Vector) -> Callable[[], None] | None:
    """A function that converts the inputs of a write that need it; None if none do."""
    given = [[np.array(column) for column in zip(*own, strict=True)] for own in write.rounds]

    def convert() -> None:
        for where, factors, offsets in given:
            inputs[where] = inputs[where] * factors + offsets

    return convert if given else None


def _views(read: Read, vector: Vector) -> dict[str, Vector]:
    """View of each output in the vector, in its shape."""
    views, start = {}, read.start
    for port in read.ports:
        views[port.name] = vector[start : start + port.size].reshape(port.shape)
        start += port.size
    return views
