"""Checks of a plan before it is executed."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping

from sblcosim.fmus.host.nanoseconds import text_of
from sblcosim.fmus.read.ports import Fmu, Port
from sblcosim.models.ports import PING_POSE, RECEPTION

from ...errors import ConfigurationError
from ...words.shares import percent
from .plan import Plan, PlannedComponent

MEMORY_SHARE = 0.25
"""Largest share of the machine's memory for a record. The table made from it takes as much again,
and so does writing the table."""

_RECEPTION = frozenset(v.name for v in (*RECEPTION, *PING_POSE))


def check_size(plan: Plan, memory: int | None = None) -> None:
    """Refuse a plan whose record of all outputs is too large for this machine.

    Parameters
    ----------
    memory
        Memory of the machine [bytes]; None: ask the system.

    Raises
    ------
    ConfigurationError
        The record would take more than `MEMORY_SHARE` of the memory.
    """
    most = MEMORY_SHARE * (_memory() if memory is None else memory)
    size = plan.count * plan.row_size
    if size > most:
        most_text, got = (f"{float(f'{n / 1e9:.3g}'):g} GB" for n in (most, size))
        raise ConfigurationError(
            f"record: must take at most {most_text} ({percent(MEMORY_SHARE, '.0f')} of the "
            f"memory), got {got} for {plan.count} communication instants; make the run shorter or "
            "the sampling time longer"
        )


def _memory() -> int:
    """Memory of this machine in bytes."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):  # sysconf is missing, as on Windows
        return 8 * 1024**3


def check_instances(sources: Mapping[str, object]) -> None:
    first: dict[str, str] = {}
    for name, source in sources.items():
        if (
            isinstance(source, Fmu)
            and source.once
            and first.setdefault(source.sha256, name) != name
        ):
            raise ConfigurationError(
                f"{name}: {source.path.name} can be instantiated only once, and "
                f"{first[source.sha256]} uses it already"
            )


def check_ticks(plan: Plan) -> None:
    """Refuse ticks strictly inside the communication interval of a component with inputs.

    Its inputs would date from the beginning of the interval, before the tick.
    """
    for c in plan.components:
        if c.tick_ns is None or c.tick_ns % c.interval_ns == 0:
            continue
        if any(port.causality == "input" for port in c.ports.values()):
            raise ConfigurationError(
                f"{c.name}: the communication interval must divide {c.tick_parameter}, "
                f"{text_of(c.tick_ns)}, got {text_of(c.interval_ns)}"
            )


def _connected(plan: Plan) -> Iterator[tuple[PlannedComponent, PlannedComponent, Port]]:
    """Source, target and source variable of every connection."""
    by_name = {c.name: c for c in plan.components}
    for target in plan.components:
        for write in target.writes:
            for column in write.columns:
                component, _, variable = column.name.partition(".")
                source = by_name[component]
                yield source, target, source.ports[variable]


def check_freshness(plan: Plan) -> None:
    """Sources of a component must have current outputs at each of its ticks."""
    for source, target, port in _connected(plan):
        if target.tick_ns is not None and target.tick_ns % source.interval_ns:
            raise ConfigurationError(
                f"{source.name}: the communication interval must divide {target.name}."
                f"{target.tick_parameter}, {text_of(target.tick_ns)}, as {target.name} uses its "
                f"{port.name}, got {text_of(source.interval_ns)}"
            )


def check_updates_follow_pings(plan: Plan) -> None:
    """A receiver's update interval must be a whole multiple of the acoustics' sampling time."""
    for source, target, port in _connected(plan):
        if port.name not in _RECEPTION or None in (source.tick_ns, target.tick_ns):
            continue
        assert source.tick_ns is not None
        assert target.tick_ns is not None
        if target.tick_ns % source.tick_ns:
            raise ConfigurationError(
                f"{target.name}.{target.tick_parameter}: must be a whole multiple of {source.name}."
                f"{source.tick_parameter}, {text_of(source.tick_ns)}, got {text_of(target.tick_ns)}"
            )
