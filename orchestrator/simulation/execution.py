"""Choose a master and run a plan with it. All masters give the same record, to the last bit."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus.read.ports import Fmu

from ..data.record import Record
from ..errors import BuildError, ConfigurationError, FmuError, SblcosimError, check_choice
from . import isolation
from .children import process
from .children.children import Children
from .how import How
from .masters import lanes, native, python
from .plans.plan import Plan
from .resolve import resolve
from .system import ComponentSpec, System

MASTERS = ("python", "native", "lanes")
"""Names of the masters."""


def execute(
    plan: Plan,
    progress: Callable[[float], None] | None = None,
    record: Sequence[str] | None = None,
    *,
    master: str | None = None,
    step_timeout: float | None = None,
    children: Children | None = None,
    apart: bool = False,
) -> Record:
    """Run a plan from its start to its stop.

    A plan with a third-party FMU runs in a separate process, see `sblcosim.simulation.isolation`.
    With masters other than python, Python components that nothing depends on, such as receivers,
    run afterwards, on the record of the others. Components from a file always do so, in a process
    for that file. Classes and functions given in Python run here.

    Parameters
    ----------
    progress, record
        As in `sblcosim.simulation.masters.python.execute`.
    master
        ``"native"``, a loop in C; ``"python"``, many times slower; or ``"lanes"``, for our own
        components only and meant for many runs (`sblcosim.simulation.masters.lanes`). None: native
        if all components are FMUs (except Python components that nothing depends on) and the loop
        can be compiled; otherwise python.
    step_timeout
        Time limit for a call in a separate process [s]; None: one minute. Without such a process
        there is no limit: our own components return, and a class given in Python is waited for.
    children
        Long-lived child processes to use.
    apart
        Whether to use a separate process in any case (except with lanes).

    Raises
    ------
    ConfigurationError, FmuError
        As the master's own function. Also if the master is unknown, or if an FMU has crashed, ended
        its process or does not return. The exception carries the component's name.
    """
    master = _master_of(plan, master, step_timeout)
    files = process.from_files(plan)
    later = [name for name in _sinks(plan) if master != "python" or name in files]
    rest = _without(plan, later)
    if not later or not rest.components:
        return _all(plan, progress, record, master, step_timeout, children, apart)
    wanted = [c.name for c in python.chosen(plan, record)]
    names = [c.name for c in rest.columns if c.name in {*wanted, *_sources(plan)}]
    stages = _stages(later, files)
    told = [_share(progress, stage, len(stages)) for stage in range(len(stages) + 1)]
    first = _all(rest, told[0], names, master, step_timeout, children, apart)

    def go_on(stage: int, played: Record, names: Sequence[str]) -> Record:
        own = stages[stage - 1]
        if own[0] in files:
            (name,) = own
            return isolation.go_on(plan, name, played, names, step_timeout, children, told[stage])
        return python.execute(plan, told[stage], names, played)

    return _joined(plan, first, wanted, stages, go_on)


def execute_part(left: Plan, whole: Plan, how: How) -> Record:
    """Run a plan, or what is left of it without failed receivers.

    If the whole has components that may crash, even a rest without them runs in a separate process,
    as far as a master needs one.
    """
    # Without the failed receivers there may be no third-party FMU left to time.
    timed = len(left.components) == len(whole.components) or process.foreign(left)
    return execute(
        left,
        how.progress,
        master=how.master,
        step_timeout=how.step_timeout if timed else None,
        apart=bool(process.strangers(whole)) and (how.master == "python" or needs_python(left)),
    )


def _share(
    progress: Callable[[float], None] | None, stage: int, stages: int
) -> Callable[[float], None] | None:
    """The progress of a stage, from 0, converted to that of the whole."""
    return None if progress is None else lambda share: progress((stage + share) / (1 + stages))


def _joined(
    plan: Plan,
    first: Record,
    wanted: Sequence[str],
    stages: Sequence[Collection[str]],
    go_on: Callable[[int, Record, Sequence[str]], Record],
) -> Record:
    """A record of a part of a plan, plus the outputs of the components that run on it.

    Parameters
    ----------
    wanted
        The outputs to record.
    go_on
        Runs a stage, from 1, on a record of all others, and records its outputs.
    """
    whole = _on(first, plan)
    values = dict(whole.values)
    for stage, own in enumerate(stages, 1):
        others = {k: v for k, v in plan.intervals_ns.items() if k not in own}
        names = [name for name in wanted if name.partition(".")[0] in own]
        values |= go_on(stage, replace(whole, intervals_ns=others), names).values
    recorded = {name: values[name] for name in wanted if name in values}
    return Record(whole.time_ns, recorded, plan.intervals_ns, first.failures)


def _master_of(plan: Plan, master: str | None, step_timeout: float | None) -> str:
    """The master that runs a plan; refuses a time limit that nobody would enforce."""
    if master is not None:
        check_choice("master", master, MASTERS)
    else:
        master = "native" if not needs_python(plan) and native.available() else "python"
    process.check_patience(step_timeout)
    if step_timeout is not None and master != "native" and not process.foreign(plan):
        raise ConfigurationError(
            f"step_timeout: must be left out with the {master} master and neither third-party FMU "
            f"nor Python file, because calls have no time limit there, got {step_timeout}"
        )
    return master


def _stages(sinks: Sequence[str], files: Collection[str]) -> list[list[str]]:
    """Python components that run together: all but those from files, each of which runs alone."""
    here = [name for name in sinks if name not in files]
    return [*([here] if here else []), *([name] for name in sinks if name in files)]


def _on(record: Record, plan: Plan) -> Record:
    """A record at the instants of a plan, which may have more; outputs hold in between."""
    if len(record) == plan.count:
        return record
    rows = np.searchsorted(record.time_ns, plan.instants, side="right") - 1
    return replace(
        record, time_ns=plan.instants, values={k: v[rows] for k, v in record.values.items()}
    )


def _all(
    plan: Plan,
    progress: Callable[[float], None] | None,
    record: Sequence[str] | None,
    master: str,
    step_timeout: float | None,
    children: Children | None,
    apart: bool,
) -> Record:
    """Run all components of a plan with one master."""
    if master == "lanes":
        return _one_lane(plan, progress, record)
    if apart or process.foreign(plan):
        return isolation.execute(plan, progress, record, master, step_timeout, children)
    if master == "native":
        return native.execute(plan, progress, record)
    return python.execute(plan, progress, record)


def _sources(plan: Plan) -> set[str]:
    """Outputs with connections."""
    return {c.name for own in plan.components for w in own.writes for c in w.columns}


def _sinks(plan: Plan) -> list[str]:
    """The Python components that nothing depends on."""
    used = {source.partition(".")[0] for source in _sources(plan)}
    return [c.name for c in plan.components if not isinstance(c.source, Fmu) and c.name not in used]


def _without(plan: Plan, names: Collection[str]) -> Plan:
    """The plan without some components that nothing depends on."""
    left = tuple(c for c in plan.components if c.name not in names)
    columns = tuple(c for c in plan.columns if c.name.partition(".")[0] not in names)
    return replace(plan, components=left, columns=columns)


def without_sinks(plan: Plan) -> Plan:
    """The plan without Python components that nothing depends on; whole if nothing would remain."""
    rest = _without(plan, _sinks(plan))
    return rest if rest.components else plan


def needs_python(plan: Plan) -> bool:
    """Whether only the python master can run the plan."""
    return native.unsupported(without_sinks(plan)) is not None


def is_here(plan: Plan, master: str | None) -> bool:
    """Whether a part of the plan runs in Python in this process."""
    if master == "python" or needs_python(plan):
        return not process.foreign(without_sinks(plan))
    files = process.from_files(plan)
    return any(name not in files for name in _sinks(plan))


def initial_outputs(
    spec: ComponentSpec,
    names: Sequence[str],
    start_ns: int = 0,
    children: Children | None = None,
) -> dict[str, NDArray[Any]]:
    """As `masters.python.initial_outputs`, but with a third-party FMU in a separate process."""
    plan = python.alone(spec, start_ns)
    if process.foreign(plan):
        return isolation.initial_outputs(spec, names, start_ns, children)
    return python.initial_outputs(spec, names, start_ns, plan)


@dataclass(frozen=True, eq=False)
class Outcome:
    """Result of a system in which some components may fail.

    Attributes
    ----------
    plan
        Plan without the components that failed before the end.
    failures
        Messages by component. A component that failed after the last instant is in the record too.
    """

    plan: Plan
    record: Record
    failures: dict[str, str]


def survive(
    system: System,
    receivers: Collection[str],
    execute: Callable[[Plan], Record],
    plan: Plan | None = None,
) -> Outcome:
    """Run a system. If receivers fail, run it again without them.

    Nothing depends on a receiver, so the results of the others do not change.

    Parameters
    ----------
    receivers
        Components that may fail as long as one remains.
    execute
        Function that runs a plan.
    plan
        Plan of the whole system, if it has been resolved.

    Raises
    ------
    SblcosimError
        Another component has failed, or all receivers have.
    """
    failures: dict[str, SblcosimError] = {}
    while True:
        if plan is None or failures:
            plan = resolve(_healthy(system, failures), again=True)
        try:
            record = execute(plan)
        except BuildError:
            raise
        except SblcosimError as error:
            failing = dict(_failing(system, receivers, failures, error, execute))
            if not failing or not failing.keys() <= set(receivers):
                raise
            failures |= failing
            if failures.keys() >= set(receivers):
                if len(failures) == 1:
                    raise
                every = type(error)("\n".join(map(str, failures.values())))
                every.component = error.component
                raise every from error
            continue
        messages = {name: str(error) for name, error in failures.items()}
        return Outcome(plan, record, messages | dict(record.failures))


def _failing(
    system: System,
    receivers: Collection[str],
    failed: Collection[str],
    error: SblcosimError,
    execute: Callable[[Plan], Record],
) -> Iterator[tuple[str, SblcosimError]]:
    """The components that failed. If uncertain, run each suspect without the other suspects."""
    suspects = [name for name in error.suspects if name in receivers]
    if len(error.suspects) > 1 and suspects:
        identified = False
        for tried in ([], *([name] for name in suspects)):
            if not tried and len(suspects) == len(error.suspects):
                continue
            rest = {*failed, *suspects} - set(tried)
            try:
                execute(resolve(_healthy(system, rest), again=True))
            except SblcosimError as own:
                if not tried:
                    raise  # fails without any suspect
                identified = True
                yield tried[0], own
        if identified:
            return
        if error.component is not None:
            others = ", ".join(name for name in error.suspects if name != error.component)
            yield error.component, FmuError(
                f"{error}; it may have been a thread of {others}, because none of them fails alone"
            )
            return
    if error.component is not None:
        yield error.component, error


def _healthy(system: System, names: Collection[str]) -> System:
    """The system without some components; nothing must depend on them."""
    return replace(
        system,
        components={k: v for k, v in system.components.items() if k not in names},
        connections=tuple(
            c for c in system.connections if c.target.partition(".")[0] not in names
        ),
    )


def _one_lane(
    plan: Plan, progress: Callable[[float], None] | None, record: Sequence[str] | None
) -> Record:
    columns = [c.name for c in plan.columns] if record is None else record
    return lanes.execute(plan, {}, record=columns, lanes=1, progress=progress).record(0)
