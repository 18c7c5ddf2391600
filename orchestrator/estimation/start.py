"""The starting trajectory of the smoother: estimates of `coupled` in the run."""

from __future__ import annotations

from typing import Any

import numpy as np
from sblcosim.fmus.host.nanoseconds import nanoseconds
from sblcosim.models import RECEIVERS
from sblcosim.models.ports import DEPTH, PING_POSE, RECEPTION, SYSTEM
from sblcosim.models.receiver.surroundings import (
    CLOCK,
    HEADING,
    PLATFORM,
    POSITION,
    SPEED,
    VELOCITY,
    VERTICAL_ERROR,
)
from sblcosim.models.receiver.waves import HEAVE, STATES

from ..data.estimates import Estimates, Integers
from ..data.record import Record
from ..data.samples import Samples
from ..errors import ConfigurationError
from ..scenario.scenario import Scenario
from ..simulation.execution import execute
from ..simulation.player import Player
from ..simulation.resolve import resolve
from ..simulation.system import ComponentSpec, Connection, System
from . import model
from .linear import Floats

_WINDOW = 20
"""Number of packets that together give a heading, if each holds only its own beacon's position."""


def ran(record: Record, receiver: str = "coupled") -> str | None:
    """Label of a component of the record with all outputs of a receiver, or None."""
    outputs = {v.name for v in RECEIVERS[receiver].of("output")}
    known = {name.partition(".")[0]: None for name in record.values}
    for label in sorted(known, key=lambda it: it != receiver):
        of_system = {v.name for v in SYSTEM if f"{label}.{v.name}" in record.values}
        same = of_system == outputs & {v.name for v in SYSTEM}
        if same and f"{label}.velocity" in record.values and record.valid(label).any():
            return label
    return None


def run_receiver(record: Record, p: Any, scenario: Scenario) -> Record:
    """Run the receiver of a scenario on the samples of a record; its estimates as a new record."""
    from sblcosim.fmus.build.factory import build

    receiver = scenario.receiver.type
    component = RECEIVERS[receiver]
    inputs = {v.name for v in component.of("input")}
    played = {
        v: record.values[name]
        for owner, variables in (("acoustics", (*RECEPTION, *PING_POSE)), ("target", DEPTH))
        for v in variables
        if v.name in inputs and (name := f"{owner}.{v.name}") in record.values
    }
    columns = {v.name: values for v, values in played.items()}
    interval_ns = nanoseconds(scenario.receiver.update_interval_s)
    values = {v.name: getattr(p, v.name) for v in component.of("parameter")}
    system = System(
        {
            "record": ComponentSpec(
                lambda: Player(played, record.time_ns, columns), interval_ns
            ),
            receiver: ComponentSpec(
                build(receiver, scenario.fmi, beacons=scenario.beacons),
                interval_ns,
                {
                    name: tuple(value.flat) if isinstance(value, np.ndarray)
                    else bool(value) if component[name].type == "Boolean"
                    else int(value) if component[name].type == "Int32" else value
                    for name, value in values.items()
                },
            ),
        },
        tuple(Connection(f"record.{name}", f"{receiver}.{name}") for name in columns),
        stop_ns=int(record.time_ns[-1]),
        start_ns=int(record.time_ns[0]),
    )
    return execute(resolve(system))


def given(record: Record, label: str, samples: Samples) -> tuple[Estimates, Integers]:
    """The estimates of a receiver, and the row of the record in which each appeared.

    Raises
    ------
    ConfigurationError
        There is no estimate.
    """
    estimates = record.estimates(label)
    if not len(estimates) or not len(samples.range):
        raise ConfigurationError(
            "record: must have ranges to three beacons and a depth, for a first estimate, got "
            f"ranges to {len(set(samples.beacon))} and {len(samples.depth)} depths"
        )
    available_ns = estimates.available_ns
    assert available_ns is not None, "these were made in a run"
    return estimates, np.searchsorted(record.time_ns, available_ns)


def between(estimates: Estimates, values: Any, epochs_ns: Integers) -> Floats:
    """Values of estimates at other epochs, by straight lines; shape (n, …)."""
    columns = np.asarray(values, float).reshape(len(estimates), -1).T
    return np.column_stack([np.interp(epochs_ns, estimates.epoch_ns, c) for c in columns])


def trajectory(record: Record, label: str, p: Any, samples: Samples) -> Floats:
    """States at the epochs of the samples, from the estimates of `coupled`; shape (n, d)."""
    estimates, row = given(record, label, samples)
    epochs = samples.epochs_ns

    def at_epochs(values: Any) -> Floats:
        return between(estimates, values, epochs)

    at = np.zeros((len(epochs), STATES))
    at[:, list(POSITION)] = at_epochs(estimates.position)
    at[:, list(VELOCITY)] = at_epochs(estimates.velocity)
    heard = np.searchsorted(samples.range_ns, estimates.epoch_ns, side="right") - 1
    said = np.asarray(model.pose_of(p, samples).down)[np.maximum(heard, 0)]
    platform = record.values[f"{label}.platform_position"][row]
    at[:, list(PLATFORM)] = at_epochs(platform[:, :2])
    at[:, [HEAVE]] = at_epochs(platform[:, 2])
    at[:, [VERTICAL_ERROR]] = at_epochs(said - platform[:, 2])
    c = p.assumed_sound_speed
    at[:, [CLOCK]] = at_epochs(record.values[f"{label}.clock_offset"][row] * c)
    at[:, [SPEED]] = at_epochs(c / record.values[f"{label}.sound_speed"][row] - 1)
    at[:, HEADING] = _headings(p, samples, at)
    return at


def _headings(p: Any, samples: Samples, at: Floats) -> Floats:
    """Headings at the epochs, as reported, or from the beacons' positions about the platform."""
    said = samples.has_pose
    epochs = samples.epochs_ns
    if said.any():
        ns, heading = samples.range_ns[said], samples.attitude[said, 2]
    else:
        ns = samples.range_ns
        arm = p.beacon_offset[samples.beacon]
        centre = at[np.searchsorted(epochs, ns)][:, list(PLATFORM)]
        seen = (samples.position[:, :2] - centre) @ [1, 1j]
        turned = np.convolve(seen * np.conj(arm[:, :2] @ [1, 1j]), np.ones(_WINDOW))
        late = (_WINDOW - 1) // 2
        heading = np.angle(turned[late : late + len(ns)])
    headings: Floats = np.interp(epochs, ns, np.unwrap(heading))
    return headings
