"""Run a scenario and return its result, in one call."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from sblcosim.fmus import unchanged
from sblcosim.fmus.host.nanoseconds import SECOND, nanoseconds, text_of
from sblcosim.fmus.read.ports import Fmu
from sblcosim.fmus.stopping import interruptible
from sblcosim.models.ports import REQUIRED_ESTIMATE

from .errors import ConfigurationError, instance, nearest, shortened
from .packages import read as packages
from .packages.read import is_package
from .packages.recording import Recording
from .results import metrics
from .results.definitions import TRUTH
from .results.description import RunDescription
from .results.result import Result
from .scenario.files import naming_files
from .scenario.labels import RAW
from .scenario.overrides import Changes
from .scenario.scenario import Receivers, Scenario, Source, load
from .scenario.schema import CORE_COMPONENTS
from .scenario.sources import choose
from .scenario.wiring import applied, connect
from .simulation.execution import execute, needs_python, survive
from .simulation.plan import Plan
from .simulation.plan_checks import check_size
from .simulation.process import foreign, patience, strangers
from .simulation.record import Record
from .simulation.resolve import resolve
from .simulation.system import System


@interruptible
@naming_files
def run(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    receiver: Receivers = (),
    overrides: Changes = (),
    *,
    fmi: int | None = None,
    components: Mapping[str, Source] | None = None,
    master: str | None = None,
    step_timeout: float | None = None,
    progress: Callable[[float], None] | None = None,
    before: Callable[[Mapping[str, Any]], None] | None = None,
) -> Result:
    """Simulate a scenario, or the system in an SSP package.

    If one of several receivers fails, the run is repeated without it. The result has its message in
    `Result.failures` and the estimates of the others.

    Parameters
    ----------
    scenario
        Name of a shipped scenario, path of a TOML file, nested tables, or a scenario from `load`.
        Or the path of an SSP package, ``FILE.ssp``, which leaves nothing else to choose: receivers,
        overrides, FMI version and components must be left out then. Its communication intervals
        are those that `export_ssp` has written, or the step that it gives for OMSimulator or the
        Open Simulation Platform, or the default step sizes of its FMUs, or a thousandth of the
        run; `Result.remarks` says which. Without receivers, or without the true positions to
        compare them with, the result is a `sblcosim.packages.recording.Recording`: no errors.
    receiver
        A name of `sblcosim.receivers`, ``"ekf"``, an FMU file, ``"file.py:Class"``, or a callable
        that makes a Python component (see `sblcosim.simulation.receiver.Receiver` and
        `sblcosim.simulation.system.PythonComponent`). Several, in a sequence
        or (with labels) in a mapping, run side by side on the same noise. None: the scenario's own
        receiver. The raw fix always runs too, as ``raw``.
    overrides
        Keys of the scenario to change, ``{"platform.arm_length_m": 0.4}``: see `load`.
    fmi
        FMI version (2 or 3) of our own components; None: the scenario's.
    components
        Replacements for ``target``, ``platform`` and ``acoustics``: FMU files, or callables that
        make a Python component.
    master, step_timeout
        Which master runs the simulation, and the time limit for a call of an FMU [s]; see
        `sblcosim.simulation.execution.execute`.
    progress
        Called at intervals with the completed share of the run, 0 to 1.
    before
        Called with the manifest just before the simulation.

    Raises
    ------
    ConfigurationError
        The scenario or an argument is invalid.
    FmuError
        An FMU cannot be built, is broken, or has failed, and none of the requested receivers is
        left.

    Examples
    --------
    >>> result = run("paper-scenario-1", ["ekf", "sequential"])      # doctest: +SKIP
    >>> result.errors.rms_m["sequential", "absolute", "total"]  # doctest: +SKIP
    """
    if is_package(scenario):
        _refuse_choices(receiver=receiver, overrides=overrides, fmi=fmi, components=components)
        with patience(step_timeout), packages.opened(cast(str | Path, scenario)) as package:
            return _run_package(package, master, step_timeout, progress, before)
    settled = load(scenario, overrides)
    with patience(step_timeout), unchanged.assumed():
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
        system, _essential(system), _executor(plan, _labels(system), master, step_timeout, progress)
    )
    interval_ns = nanoseconds(settled.receiver.update_interval_s)
    return Result(description, outcome.record, interval_ns, outcome.failures)


def _refuse_choices(**choices: object) -> None:
    """Refuse arguments that choose what a package has chosen."""
    for name, value in choices.items():
        if value is not None and value != ():
            raise ConfigurationError(
                f"{name}: must be left out for an SSP package, which holds all that runs, got "
                f"{shortened(instance(value))}"
            )


def _run_package(
    package: packages.Package,
    master: str | None,
    step_timeout: float | None,
    progress: Callable[[float], None] | None,
    before: Callable[[Mapping[str, Any]], None] | None,
) -> Result:
    """Run a package that is open."""
    plan = resolve(package.system, where=str(package.path))
    check_size(plan)
    planned = {c.name: c for c in plan.components}
    known = {c.name for c in plan.columns}
    receivers = [
        name
        for name in planned
        if name not in CORE_COMPONENTS
        and {*TRUTH, *(f"{name}.{port}" for port in REQUIRED_ESTIMATE)} <= known
    ]
    seeds = {
        c.name: int(s.values[0]) for c in plan.components for s in c.settings
        if s.port.name == "seed" and s.port.causality == "parameter"
    }  # fmt: skip
    description = RunDescription(
        scenario_name=package.name,
        scenario={"package": f"{package.name}.ssp", "sha256": package.sha256},
        receivers=receivers,
        fmus={name: component.file_sha256 for name, component in planned.items()},
        seeds=seeds,
        origins=_origins({name: Path(name) for name in receivers}, package.system, plan),
        remarks=[*package.remarks, *_shortening(package.system, plan, 0)],
    )
    if before is not None:
        before(description.manifest())
    used = {c.source.partition(".")[0] for c in package.system.connections}
    outcome = survive(
        package.system,
        [name for name in receivers if name not in used],
        _executor(plan, receivers, master, step_timeout, progress),
    )
    failures = {name: package.said(message) for name, message in outcome.failures.items()}
    if not receivers:
        return Recording(description, outcome.record, None, failures)
    interval_ns = planned[receivers[0]].tick_ns
    return Result(description, outcome.record, interval_ns, failures)


def _labels(system: System) -> list[str]:
    """Names of the receivers, the raw fix last."""
    labels = [name for name in system.components if name not in (*CORE_COMPONENTS, RAW)]
    return [*labels, RAW] if RAW in system.components else labels


def _essential(system: System) -> list[str]:
    """The receivers of which at least one must survive; the raw fix counts only if it is alone."""
    return [name for name in _labels(system) if name != RAW] or [RAW]


def _executor(
    plan: Plan,
    receivers: Sequence[str],
    master: str | None,
    step_timeout: float | None,
    progress: Callable[[float], None] | None,
) -> Callable[[Plan], Record]:
    """A function that runs the plan, or the rest of it after receivers have failed.

    An estimate with which nothing can be done is a failure of its receiver, too.
    """
    apart = bool(strangers(plan))

    def executed(left: Plan) -> Record:
        # Without the failed receivers there may be no third-party FMU left to time.
        timed = len(left.components) == len(plan.components) or foreign(left)
        record = execute(
            left,
            progress,
            master=master,
            step_timeout=step_timeout if timed else None,
            apart=apart and (master == "python" or needs_python(left)),
        )
        for component in left.components:
            if component.name in receivers:
                metrics.check(record, component.name)
        return record

    return executed


def _check_truth(plan: Plan) -> None:
    """Refuse components that lack the true values with which estimates are compared."""
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
    """The origin of each receiver; independent of file paths."""
    planned = {c.name: c for c in plan.components}
    origins: dict[str, dict[str, Any]] = {}
    for label, source in chosen.items():
        component = planned[label]
        if isinstance(source, str):
            origin: dict[str, Any] = {"type": source}
        else:
            origin = {"fmu" if isinstance(source, Path) else "python": component.origin}
        if component.file_sha256:
            origin["sha256"] = component.file_sha256
        if component.lag_s > 0:
            origin["looks_back"] = True
        origins[label] = {**origin, "parameters": dict(system.components[label].parameters)}
    return origins


def _remarks(scenario: Scenario, system: System, plan: Plan) -> list[str]:
    """Remarks for the reader of the results."""
    about = [scenario.about_track] if scenario.about_track else []
    return about + _shortening(system, plan, nanoseconds(scenario.time.sampling_time_s))


def _shortening(system: System, plan: Plan, most_ns: int) -> list[str]:
    """What is said of a run that is shorter than it should be, by more than so much [ns]."""
    wanted, simulated = system.stop_ns - system.start_ns, plan.stop_ns - plan.start_ns
    lost = wanted - simulated
    if lost <= most_ns:
        return []
    digits = max(1, math.ceil(-math.log10(lost / SECOND)))
    return [
        f"simulated {text_of(simulated).removesuffix(' s')} of {round(wanted / SECOND, digits)} s: "
        "a run ends with the last common multiple of all communication intervals"
    ]
