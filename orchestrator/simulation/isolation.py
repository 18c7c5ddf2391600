"""Third-party FMUs and the user's Python files, in separate processes.

A plan with a third-party FMU is run by a child process (`sblcosim.simulation.child`), with the same
masters and at the same speed. The whole loop runs there in one call and writes its progress to
shared memory. Whatever an FMU does, the calling process survives and knows which component did it,
in which call and when. The same holds for components from Python files.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from numpy.typing import NDArray

from ..data.record import Record
from ..errors import ConfigurationWarning
from .children.children import Children
from .children.messages import Execute, Here, InitialOutputs
from .children.process import PATIENCE, Process, from_files, strangers
from .masters import native
from .masters.python import alone, chosen
from .plans.plan import Plan, PlannedComponent
from .system import ComponentSpec, PythonComponent


def execute(
    plan: Plan,
    progress: Callable[[float], None] | None,
    record: Sequence[str] | None,
    master: str,
    step_timeout: float | None,
    children: Children | None,
) -> Record:
    """Run a plan in a child.

    Parameters
    ----------
    progress, record, master, step_timeout
        As in `sblcosim.simulation.execution.execute`.
    children
        Pool of children; None: start one for this run. Only in that case does the record include
        failures at its end.

    Raises
    ------
    FmuError
        A component has failed; its name is in the exception.
    ConfigurationError
        A Python component cannot be sent to another process, or has raised an exception.

    Warns
    -----
    ConfigurationWarning
        An FMU has changed shared process state: the floating-point settings or the locale.
    """
    if master == "native":
        native.check(plan)
    chosen(plan, record)
    patience = PATIENCE.get() if step_timeout is None else step_timeout
    task = Execute(
        Here.now(),
        tuple(c.name for c in plan.components),
        strangers(plan),
        plan,
        None if record is None else tuple(record),
        master,
    )
    key = _key(plan)
    if key or children is not None:
        with (children or Children()).lend(key) as child:
            return child.run(task, patience, progress)
    child = Process()
    try:
        result = child.run(task, patience, progress)
        failures = {**result.failures, **child.finish(patience)}
    finally:
        child.kill()
    return replace(result, failures=failures)


def go_on(
    plan: Plan,
    name: str,
    played: Record,
    record: Sequence[str],
    step_timeout: float | None,
    children: Children | None,
    progress: Callable[[float], None] | None,
) -> Record:
    """Run a component from a file in a child, on the record of everything it depends on.

    Parameters
    ----------
    played
        Record to play back, with the intervals of all other components.
    record
        The outputs to record.

    Raises
    ------
    FmuError, ConfigurationError
        As `execute`.
    """
    plan = replace(
        plan, components=tuple(c if c.name == name else _shadow(c) for c in plan.components)
    )
    needed = {
        column.name
        for c in plan.components for write in c.writes for column in write.columns
    }
    task = Execute(
        Here.now(),
        tuple(c.name for c in plan.components),
        (),
        plan,
        tuple(record),
        "python",
        replace(played, values={k: v for k, v in played.values.items() if k in needed}),
    )
    patience = PATIENCE.get() if step_timeout is None else step_timeout
    with (children or Children()).lend(_key(plan)) as child:
        return child.run(task, patience, progress)


def _shadow(component: PlannedComponent) -> PlannedComponent:
    """Placeholder for a component, for those that run on its record."""
    return replace(
        component, source=_shadow_made, ports={}, settings=(), reads=(), writes=(), texts=()
    )


def _shadow_made() -> PythonComponent:
    raise AssertionError("a component played back from a record is never made")


def _key(plan: Plan) -> str:
    """The files that run in a plan's child; none if it runs third-party FMUs."""
    return "" if strangers(plan) else " ".join(sorted(set(from_files(plan).values())))


def initial_outputs(
    spec: ComponentSpec, names: Sequence[str], start_ns: int, children: Children | None
) -> dict[str, NDArray[Any]]:
    """As `sblcosim.simulation.masters.python.initial_outputs`, in a child."""
    plan = alone(spec, start_ns)
    task = InitialOutputs(
        Here.now(), (plan.components[0].name,), strangers(plan), spec, tuple(names), start_ns
    )
    key = _key(plan)
    if key or children is not None:
        with (children or Children()).lend(key) as child:
            return child.outputs(task, plan)
    child = Process()
    try:
        outputs = child.outputs(task, plan)
        for message in child.finish(PATIENCE.get()).values():
            warnings.warn(message, ConfigurationWarning, 2)
    finally:
        child.kill()
    return outputs
