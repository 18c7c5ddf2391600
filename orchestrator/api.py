"""From a scenario to its result, in one call."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from sblcosim.fmus.host.nanoseconds import SECOND, nanoseconds, text_of
from sblcosim.fmus.read.ports import Fmu

from .errors import ConfigurationError, nearest
from .results.definitions import TRUTH
from .results.description import RunDescription
from .results.result import Result
from .scenario.overrides import Overrides
from .scenario.scenario import Receivers, Scenario, Source, load
from .scenario.schema import CORE_COMPONENTS
from .scenario.wiring import RAW, applied, choose, connect
from .simulation.execution import execute, survive
from .simulation.masters.native import unsupported
from .simulation.plan import Plan
from .simulation.plan_checks import check_size
from .simulation.process import patience, strangers
from .simulation.record import Record
from .simulation.resolve import resolve
from .simulation.system import System


def run(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    receiver: Receivers = (),
    overrides: Overrides = (),
    *,
    fmi: int | None = None,
    components: Mapping[str, Source] | None = None,
    master: str | None = None,
    step_timeout: float | None = None,
    progress: Callable[[float], None] | None = None,
    before: Callable[[Mapping[str, Any]], None] | None = None,
) -> Result:
    """Simulate a scenario.

    A receiver that fails beside others does not end the run: the result has its message in
    `Result.failures`, and what the others give without it.

    Parameters
    ----------
    scenario
        Name of a scenario that comes with the project, TOML file, nested tables, or what `load`
        returned.
    receiver
        ``"ekf"``, ``"sequential"``, ``"multilateration"``, an FMU file, or what makes a Python
        component (see `sblcosim.simulation.system.PythonComponent`); several in a sequence, or with
        labels in a mapping, run side by side on the same noise. None: the scenario's own. The raw
        fix runs along as ``raw``.
    overrides
        Keys of the scenario to change, e.g. ``{"platform.arm_length_m": 0.4}``.
    fmi
        FMI version (2 or 3) of our components; None: the scenario's.
    components
        Replacements of ``target``, ``platform``, ``acoustics``: FMU files, or what makes a Python
        component.
    master, step_timeout
        What runs the simulation, and when it gives up an FMU that hangs; see
        `sblcosim.simulation.execution.execute`.
    progress
        Called now and then with the share of the run that is done, 0 to 1.
    before
        Called with the manifest just before the simulation.

    Raises
    ------
    ConfigurationError
        Something in the scenario or the arguments is wrong.
    FmuError
        An FMU cannot be built, is broken, or has failed, and no receiver that was asked for is
        left.

    Examples
    --------
    >>> result = run("paper-scenario-1", ["ekf", "sequential"])      # doctest: +SKIP
    >>> result.errors.loc["sequential", "absolute", "total"].rms_m   # doctest: +SKIP
    """
    settled = load(scenario, overrides)
    with patience(step_timeout):
        system = connect(settled, receiver, fmi, components)
        plan = resolve(system)
    check_size(plan)
    _check_truth(plan)
    description = RunDescription(
        scenario_name=settled.name,
        scenario=applied(settled, receiver, fmi, components),
        receivers=_labels(system),
        fmus={c.name: c.source.sha256 for c in plan.components if isinstance(c.source, Fmu)},
        seeds={name: getattr(settled, name).seed for name in CORE_COMPONENTS},
        origins=_origins(choose(settled, receiver), system, plan),
        remarks=_remarks(settled, system, plan),
    )
    if before is not None:
        before(description.manifest())
    outcome = survive(
        system, _essential(system), _executor(plan, master, step_timeout, progress)
    )
    interval_ns = nanoseconds(settled.receiver.update_interval_s)
    return Result(description, outcome.record, interval_ns, outcome.failures)


def _labels(system: System) -> list[str]:
    """Names of the receivers, the raw fix last."""
    labels = [name for name in system.components if name not in (*CORE_COMPONENTS, RAW)]
    return [*labels, RAW] if RAW in system.components else labels


def _essential(system: System) -> list[str]:
    """The receivers of which one must be left: those beside the raw fix, if there are any."""
    return [name for name in _labels(system) if name != RAW] or [RAW]


def _executor(
    plan: Plan,
    master: str | None,
    step_timeout: float | None,
    progress: Callable[[float], None] | None,
) -> Callable[[Plan], Record]:
    """What runs a plan, or what is left of it without the receivers that have failed."""
    apart = bool(strangers(plan))

    def executed(left: Plan) -> Record:
        # Without the failed ones there may be nobody left to wait for.
        timed = len(left.components) == len(plan.components) or strangers(left)
        return execute(
            left,
            progress,
            master=master,
            step_timeout=step_timeout if timed else None,
            apart=apart and unsupported(left) is not None,
        )

    return executed


def _check_truth(plan: Plan) -> None:
    """Refuse components without what the estimates are compared with."""
    known = [c.name for c in plan.columns]
    for name in TRUTH:
        if name not in known:
            raise ConfigurationError(
                f"{name}: must be an output, to compare the estimates with, got none"
                f"{nearest(name, known)}"
            )


def _origins(
    chosen: Mapping[str, Source], system: System, plan: Plan
) -> dict[str, dict[str, Any]]:
    """What each receiver was; independent of the paths of files."""
    planned = {c.name: c for c in plan.components}
    origins: dict[str, dict[str, Any]] = {}
    for label, source in chosen.items():
        component = planned[label]
        if isinstance(source, str):
            origin = {"type": source}
        else:
            origin = {"fmu" if isinstance(source, Path) else "python": component.origin}
        if isinstance(component.source, Fmu):
            origin["sha256"] = component.source.sha256
        origins[label] = {**origin, "parameters": dict(system.components[label].parameters)}
    return origins


def _remarks(scenario: Scenario, system: System, plan: Plan) -> list[str]:
    """What a reader of the results should know about the run."""
    wanted, simulated = system.stop_ns - system.start_ns, plan.stop_ns - plan.start_ns
    lost = wanted - simulated
    if lost <= nanoseconds(scenario.time.sampling_time_s):
        return []
    digits = max(1, math.ceil(-math.log10(lost / SECOND)))
    return [
        f"simulated {text_of(simulated).removesuffix(' s')} of {round(wanted / SECOND, digits)} s: "
        "a run ends with the last common multiple of all communication intervals"
    ]
