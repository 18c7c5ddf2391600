"""Receivers on a log: the system of a player and receivers, and what it gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from sblcosim.models.declaration import number_of
from sblcosim.models.receiver.variables import INITIALISATION

from ..data.estimates import Estimates, Floats
from ..data.record import Record
from ..errors import FmuError
from ..prepare.prepared import origins_of
from ..scenario.components import UnconnectedComponent, receiver_of
from ..scenario.doubts import doubts
from ..scenario.labels import RAW
from ..scenario.sources import Choice
from ..simulation.execution import execute_part, survive
from ..simulation.how import How
from ..simulation.plans.plan import Plan
from ..simulation.player import Player
from ..simulation.resolve import resolve
from ..simulation.system import ComponentSpec, Connection, System
from .playing import PORTS, Played, played
from .replaying import replayed
from .settings import PRIOR, Settled, places_of, start_values

LOG = "log"
"""Name of the component that plays the log."""


@dataclass(frozen=True, eq=False)
class Ran:
    """What receivers made of a log.

    Attributes
    ----------
    played
        What they were given.
    record
        Their outputs, at some instants or at all of them; times count from the start of the ticks,
        positions from `Settled.origin`.
    estimates
        By label, in the times and coordinates of the log.
    failures
        Messages of receivers that failed, by label.
    origins
        Origin of each receiver; see `sblcosim.data.description.RunDescription`.
    """

    played: Played
    record: Record
    estimates: Mapping[str, Estimates]
    failures: Mapping[str, str]
    origins: Mapping[str, Mapping[str, Any]]


def ran(settled: Settled, choice: Choice, how: How) -> Ran:
    """Run receivers on a log, side by side.

    Raises
    ------
    ConfigurationError, FmuError
        A receiver does not fit, or none of them is left.
    """
    given = ports_of(settled)
    system = _system(settled, choice, given)
    plan = resolve(system)
    labels = [*choice.receivers]
    own = [label for label in labels if label != RAW]

    def executed(left: Plan) -> Record:
        record = replayed(left, given, LOG, how) or execute_part(left, plan, how)
        for label in (c.name for c in left.components if c.name in labels):
            _check_finite(label, record)
        return record

    outcome = survive(system, own or labels, executed, plan)
    estimates = {
        label: placed(outcome.record.estimates(label), given.start_ns, settled.origin)
        for label in labels if f"{label}.update_count" in outcome.record.values
    }
    return Ran(
        given, outcome.record, estimates, dict(outcome.failures),
        origins_of(choice.receivers, system, plan),
    )


def _check_finite(label: str, record: Record) -> None:
    estimates = record.estimates(label)
    bad = ~np.isfinite(estimates.position).all(axis=1)
    if bad.any():
        i = int(bad.argmax())
        error = FmuError(
            f"{label}.position: must be finite in a valid estimate, got "
            f"{estimates.position[i].tolist()} at epoch {estimates.epoch_ns[i] / 1e9:g} s"
        )
        error.component = label
        raise error


def placed(estimates: Estimates, start_ns: int, origin: Floats) -> Estimates:
    """Estimates in the times and coordinates of the log."""

    def later(times: Any) -> Any:
        return None if times is None else times + start_ns

    return replace(
        estimates,
        epoch_ns=estimates.epoch_ns + start_ns,
        available_ns=later(estimates.available_ns),
        until_ns=later(estimates.until_ns),
        position=estimates.position + origin,
        platform_position=None if estimates.platform_position is None
        else estimates.platform_position + origin,
    )


def ports_of(settled: Settled) -> Played:
    """What receivers are given: the ports of a log, about `Settled.origin`."""
    given = played(settled.log, settled.interval_ns, settled.slots, newest=settled.newest)
    values = dict(given.values)
    if settled.origin.any():
        for name in ("ping_beacon_position", "packet_beacon_position", "ping_platform_position"):
            shown = values[name].any(axis=-1, keepdims=True)
            values[name] = np.where(shown, values[name] - settled.origin, 0.0)
    if settled.platform is not None:
        shape = values["ping_platform_position"].shape
        heard = (values["reception_count"] > 0)[..., None]
        values["ping_platform_position"] = np.where(
            heard, np.broadcast_to(settled.platform, shape), 0.0
        )
    return replace(given, values=values)


def _system(settled: Settled, choice: Choice, given: Played) -> System:
    scenario = settled.scenario
    parts = {
        label: receiver_of(scenario, label, source, choice.fmi or scenario.fmi)
        for label, source in choice.receivers.items()
    }
    components = {
        LOG: ComponentSpec(
            lambda: Player(PORTS, given.time_ns, given.values), settled.interval_ns
        )
    }
    connections = []
    for label, part in parts.items():
        components[label] = _spec(settled, part)
        connections += [
            Connection(f"{LOG}.{v.name}", f"{label}.{v.name}") for v in PORTS
            if v.name in part.names
        ]
    return System(components, tuple(connections), stop_ns=int(given.time_ns[-1]))


def _spec(settled: Settled, part: UnconnectedComponent) -> ComponentSpec:
    """A receiver with the parameters that the log decides."""
    scenario = settled.scenario
    values = decided(settled, scenario.true_prior, scenario.acoustics.range_std_m)
    known = {name: value for name, value in values.items() if name in part.names}
    return part.spec.varied(known, settled.interval_ns)


def decided(settled: Settled, told: bool, std: float) -> dict[str, Any]:
    """Parameters of receivers that the log decides, in place of those of the scenario.

    Parameters
    ----------
    told
        Whether receivers of a simulated dive are told where it starts.
    std
        Standard deviation of a range [m]; see `sblcosim.processing.settings.start_values`.
    """
    values: dict[str, Any] = start_values(settled, std)
    if told and settled.newest:
        values |= {
            "initialisation": PRIOR, "prior_velocity": (0.0, 0.0, 0.0),
            "prior_position": tuple(map(float, start_of_truth(settled))),
        }
    elif told and settled.window is None:
        values["initialisation"] = number_of(INITIALISATION, "first_receptions")
    if settled.platform is not None:
        arms = places_of(settled.log) - settled.origin - settled.platform
        rows = np.zeros((settled.slots, 3))
        rows[: len(arms)] = arms
        rows[len(arms) :] = arms[-1]
        values["beacon_offset"] = tuple(rows.ravel().tolist())
    values["update_interval"] = settled.interval_ns / 1e9
    return values


def start_of_truth(settled: Settled) -> Floats:
    """True position at the start of a simulated dive, minus `Settled.origin`, NED [m].

    Zeros for other logs: nothing may begin with their truth.
    """
    truth = settled.log.truth
    known = settled.newest and truth is not None
    return truth.position[0] - settled.origin if known and truth is not None else np.zeros(3)


def doubts_of(settled: Settled, choice: Choice) -> list[str]:
    """What speaks against the receivers for the settings, as sentences."""
    if settled.platform is not None:
        return []
    return [*doubts(settled.scenario, choice.receivers)]
