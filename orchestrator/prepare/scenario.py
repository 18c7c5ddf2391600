"""Preparation of a scenario with choices."""

from __future__ import annotations

from collections.abc import Mapping

from sblcosim.fmus.host.nanoseconds import nanoseconds
from sblcosim.fmus.read.ports import Fmu

from ..data.description import RunDescription
from ..data.truth import TRUTH
from ..errors import ConfigurationError, nearest
from ..scenario import starts
from ..scenario.labels import RAW
from ..scenario.scenario import Receivers, Scenario, Source
from ..scenario.schema import CORE_COMPONENTS
from ..scenario.sources import Choice, choice_of
from ..scenario.wiring import applied, connected
from ..simulation.plans.checks import check_size
from ..simulation.plans.plan import Plan
from ..simulation.resolve import resolve
from ..simulation.system import System
from .prepared import Prepared, origins_of, shortening


def of_scenario(
    scenario: Scenario,
    receivers: Receivers = (),
    fmi: int | None = None,
    components: Mapping[str, Source] | None = None,
) -> Prepared:
    """Choose, connect and resolve what runs for a scenario; missing FMUs are built.

    Parameters
    ----------
    receivers, fmi, components
        See `sblcosim.scenario.wiring.connect`.

    Raises
    ------
    ConfigurationError, FmuError
        See `sblcosim.scenario.wiring.connect`; also raised if there are no true values to compare
        the estimates with.
    """
    choice = choice_of(scenario, receivers, fmi, components)
    system, plan = joined(scenario, choice)
    check_size(plan)
    _check_truth(plan)
    labels = [*(label for label in choice.receivers if label != RAW)]
    labels += [RAW] if RAW in choice.receivers else []
    own = [label for label in labels if label != RAW]
    told = starts.told(scenario, system.components, own)
    remarks = [it for it in (*scenario.about_tracks, starts.sentence(told, own)) if it]
    description = RunDescription(
        scenario_name=scenario.name,
        scenario=applied(scenario, choice),
        receivers=labels,
        fmus={c.name: c.source.sha256 for c in plan.components if isinstance(c.source, Fmu)},
        seeds={name: getattr(scenario, name).seed for name in CORE_COMPONENTS},
        origins=origins_of(choice.receivers, system, plan),
        remarks=remarks + shortening(system, plan, nanoseconds(scenario.time.sampling_time_s)),
        asked=scenario,
    )
    return Prepared(
        system, plan, description,
        may_fail=[name for name in labels if name != RAW] or [RAW],  # raw counts only if alone
        update_interval_ns=nanoseconds(scenario.receiver.update_interval_s),
    )


def joined(
    scenario: Scenario, choice: Choice, *, raw: bool = True, tell_idle: bool = True
) -> tuple[System, Plan]:
    """Connect and resolve what was chosen for a scenario, or for one with other keys.

    Parameters
    ----------
    raw, tell_idle
        See `sblcosim.scenario.wiring.connect`.

    Raises
    ------
    ConfigurationError, FmuError
        See `of_scenario`.
    """
    system = connected(scenario, choice, raw=raw, tell_idle=tell_idle)
    return system, resolve(system)


def _check_truth(plan: Plan) -> None:
    """Refuse components without the true values that estimates are compared with."""
    known = [c.name for c in plan.columns]
    for name in TRUTH:
        if name not in known:
            raise ConfigurationError(
                f"{name}: must be an output, to compare the estimates with, got none"
                f"{nearest(name, known)}"
            )
