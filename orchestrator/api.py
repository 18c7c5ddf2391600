"""Run a scenario and return its result, in one call."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, cast

from sblcosim.fmus import unchanged
from sblcosim.fmus.stopping import interruptible

from .data.record import Record
from .data.truth import of_record
from .errors import ConfigurationError, instance, shortened
from .judge.definitions import Judged
from .judge.metrics import intact
from .packages import is_package
from .prepare.prepared import Prepared
from .prepare.scenario import of_scenario
from .results.result import Result
from .scenario.files import naming_files
from .scenario.overrides import Changes
from .scenario.scenario import Receivers, Scenario, Source, load
from .simulation.children.process import patient
from .simulation.execution import execute_part, survive
from .simulation.how import How
from .simulation.plans.plan import Plan


@interruptible
@naming_files
@patient
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

    If one of several receivers fails, the run is repeated without it. `Result.failures` then has
    its message, and the result has the estimates of the others.

    Parameters
    ----------
    scenario
        Name of a shipped scenario, path of a TOML file, nested tables, or a scenario from `load`.
        Or the path of an SSP package, ``FILE.ssp``, which leaves no other choice: receivers,
        overrides, FMI version and components must then be left out. Its communication intervals
        are those that `export_ssp` wrote, or the step that it gives for OMSimulator or the Open
        Simulation Platform, or the default step sizes of its FMUs, or a thousandth of the run.
        `Result.remarks` says which. Without receivers, or without the true positions to compare
        them with, the result is a `sblcosim.packages.recording.Recording`, which has no errors.
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
    how = How(master, step_timeout, progress=progress)
    if is_package(scenario):
        _refuse_choices(receiver=receiver, overrides=overrides, fmi=fmi, components=components)
        # Runs of scenarios need not wait for the import of what reads packages.
        from .packages.read import opened
        from .prepare.package import of_package

        with opened(cast(str | Path, scenario)) as package:
            return _carried_out(of_package(package), how, before, package.said)
    settled = load(scenario, overrides)
    with unchanged.assumed():
        prepared = of_scenario(settled, receiver, fmi, components)
    return _carried_out(prepared, how, before)


def _refuse_choices(**choices: object) -> None:
    """Refuse arguments for choices that a package has made."""
    for name, value in choices.items():
        if value is not None and value != ():
            raise ConfigurationError(
                f"{name}: must be left out for an SSP package, which holds all that runs, got "
                f"{shortened(instance(value))}"
            )


def _carried_out(
    prepared: Prepared,
    how: How,
    before: Callable[[Mapping[str, Any]], None] | None,
    said: Callable[[str], str] = str,
) -> Result:
    """Execute a prepared run, and judge its estimates.

    An estimate that cannot be evaluated is a failure of its receiver, too.

    Parameters
    ----------
    said
        Receives the messages of failures.
    """
    description, plan = prepared.description, prepared.plan
    if before is not None:
        before(description.manifest())
    judged: dict[str, Judged] = {}

    def executed(left: Plan) -> Record:
        record = execute_part(left, plan, how)
        names = [c.name for c in left.components if c.name in description.receivers]
        truth = of_record(record) if names else None
        judged.clear()
        if truth is not None:
            judged.update((name, intact(name, record.estimates(name), truth)) for name in names)
        return record

    outcome = survive(prepared.system, prepared.may_fail, executed, plan)
    failures = {name: said(message) for name, message in outcome.failures.items()}
    if not description.receivers:
        from .packages.recording import Recording

        return Recording(description, outcome.record, None, failures)
    return Result(
        description, outcome.record, prepared.update_interval_ns, failures, judged=judged
    )
