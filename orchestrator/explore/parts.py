"""The components of a plan as plain data, from which a page assembles the plan of any receivers.

Everything is from the declarations; no FMU is needed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from sblcosim.fmus.build.description import value_references
from sblcosim.fmus.host.instances import DTYPES
from sblcosim.models import declared
from sblcosim.models.declaration import Component, Variable

from ..scenario.labels import RAW
from ..scenario.schema import CORE_COMPONENTS
from ..scenario.wiring import standard_connections
from ..simulation.masters.lanes_driver import RECEIVER_PORTS
from ..simulation.plans.plan import TICK_PARAMETERS


def parts(receivers: Sequence[str], **constants: int) -> dict[str, dict[str, Any]]:
    """Target, platform, acoustics and receivers for constants of the build, by name.

    Returns
    -------
    dict
        For each: ``start`` (values of parameters and inputs before the start), ``parameters``
        (first element and number of elements), ``named`` (names that stand for a number),
        ``outputs`` (name, first element, shape, type), ``inputs`` (source, its variable, first
        element there and here, number of elements), ``tick`` (the parameter with the time between
        ticks), and of receivers ``judged``: first elements of the outputs that are judged.
    """
    known = {name: declared(name, **constants) for name in (*CORE_COMPONENTS, *receivers)}
    return {name: _part(name, known) for name in known}


def _part(name: str, known: dict[str, Component]) -> dict[str, Any]:
    component = known[name]
    first = {it: at - 1 for it, at in value_references(component).items()}
    before = [v for v in component if v.causality in ("parameter", "input")]
    found = {
        "start": [float(value) for v in before for value in v.starts],
        "parameters": {v.name: [first[v.name], v.size] for v in component.of("parameter")},
        "named": {v.name: dict(v.named) for v in component.of("parameter") if v.named},
        "outputs": [
            [v.name, first[v.name], [*v.shape], v.type] for v in _by_type(component.of("output"))
        ],
        "inputs": [*_inputs(name, known)],
        "tick": min(TICK_PARAMETERS & first.keys()),
    }
    if name not in CORE_COMPONENTS:
        found["judged"] = [first.get(port, -1) for port in RECEIVER_PORTS]
    return found


def _inputs(name: str, known: dict[str, Component]) -> Iterator[list[Any]]:
    label = RAW if name not in CORE_COMPONENTS else name
    names = {it: frozenset(v.name for v in known[it]) for it in CORE_COMPONENTS}
    names[label] = frozenset(v.name for v in known[name])
    sources = {it.target: it.source.split(".") for it in standard_connections(names)}
    here = value_references(known[name])
    for v in _by_type(known[name].of("input")):
        if f"{label}.{v.name}" in sources:
            source, variable = sources[f"{label}.{v.name}"]
            there = value_references(known[source])[variable]
            yield [source, variable, there - 1, here[v.name] - 1, v.size]


def _by_type(variables: Any) -> list[Variable]:
    order = [*DTYPES]
    return sorted(variables, key=lambda v: order.index(v.type))
