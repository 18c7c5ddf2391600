"""Receivers of our own on the ports of a log, in C: only ticks that may change them are stepped.

These are ticks with something new and, for receivers that look back, those up to their lag after
it. The outputs have the bits of any other master. Those are many times slower, as they step a
player in Python.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus.host.nanoseconds import nanoseconds
from sblcosim.fmus.read.ports import Fmu

from ..data.estimates import Integers
from ..data.record import Record
from ..errors import ConfigurationError, FmuError
from ..simulation.how import How
from ..simulation.masters import c_libraries
from ..simulation.masters.lanes_driver import has_engine
from ..simulation.masters.replay import DRIVER, replay
from ..simulation.plans.plan import Plan, PlannedComponent
from .playing import Played

AFTER = 8
"""Number of ticks after its lag in which a receiver gives the rest of its estimates."""


def replayed(plan: Plan, given: Played, player: str, how: How) -> Record | None:
    """The outputs of all receivers of a plan.

    Its instants are those at which an output may change, and the last of the plan.

    Parameters
    ----------
    player
        Name of the component that plays the ports.

    Returns
    -------
    record
        None if another master must run the plan: it has a component that is not ours, a receiver
        fails, or there is no driver. That master says what is wrong.
    """
    receivers = [c for c in plan.components if c.name != player]
    if how.step_timeout is not None or not _possible(receivers, given):
        return None
    ticks, rows = _ticks(given, receivers)
    inputs = {name: own[rows] for name, own in given.values.items()}
    values: dict[str, NDArray[Any]] = {}
    for done, receiver in enumerate(receivers):
        how.tell(done / len(receivers))
        try:
            outputs = _outputs(receiver, ticks, inputs)
        except (ConfigurationError, FmuError):
            return None
        if not all(np.isfinite(own).all() for own in outputs.values()):
            return None
        values |= {f"{receiver.name}.{name}": own for name, own in outputs.items()}
    how.tell(1.0)
    after = ticks + receivers[0].interval_ns
    if after[-1] < plan.stop_ns:  # until then, outputs hold
        after = np.append(after, plan.stop_ns)
        values = {name: np.concatenate([own, own[-1:]]) for name, own in values.items()}
    return Record(after, values, plan.intervals_ns)


def _possible(receivers: Sequence[PlannedComponent], given: Played) -> bool:
    """Whether the driver can run all of some receivers on a log."""
    ours = all(
        isinstance(c.source, Fmu) and has_engine(c.source) and c.tick_ns == c.interval_ns
        and not c.texts and not any(w.conversions for w in c.writes) for c in receivers
    )
    finite = all(np.isfinite(values).all() for values in given.values.values())
    # There is no tick at the start, and the last step begins before the last tick.
    return ours and finite and len(given.time_ns) > 2 and c_libraries.available(DRIVER)


def _ticks(
    given: Played, receivers: Sequence[PlannedComponent]
) -> tuple[Integers, NDArray[np.intp]]:
    """Ticks to step [ns], and the rows of the ports at them."""
    interval_ns = receivers[0].interval_ns
    lag_ns = max(nanoseconds(c.lag_s) for c in receivers)
    if not lag_ns:
        rows = np.arange(1, len(given.time_ns) - 1)
        return given.time_ns[rows], rows
    ticks = np.arange(interval_ns, int(given.time_ns[-1]), interval_ns)
    rows = np.searchsorted(given.time_ns, ticks, side="right") - 1
    near = ticks - given.time_ns[rows] <= lag_ns + AFTER * interval_ns
    return ticks[near], rows[near]


def _outputs(
    receiver: PlannedComponent, ticks: Integers, values: Mapping[str, NDArray[Any]]
) -> dict[str, NDArray[Any]]:
    """All outputs of a receiver, one interval after each tick."""
    assert isinstance(receiver.source, Fmu)
    inputs = {
        port.name: values[connection.source.partition(".")[2]]
        for write in receiver.writes
        for port, connection in zip(write.ports, write.connections, strict=True)
    }
    parameters = {s.port.name: np.array([s.values]) for s in receiver.settings}
    outputs = replay(
        receiver.source.path, ticks, inputs, parameters, receiver.interval_ns,
        record=[port.name for read in receiver.reads for port in read.ports], start_ns=0,
        lanes=1,
    )
    return {name: own[0] for name, own in outputs.items()}
