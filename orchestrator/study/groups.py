"""The points of a study, and the groups of them that run side by side."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.models import COMPONENTS

from ..simulation.masters import lanes_driver, native
from ..simulation.plans.plan import TICK_PARAMETERS, Plan
from ..simulation.system import ComponentSpec, System, differences
from .design import Level

Floats = NDArray[np.float64]
_ALIKE = TICK_PARAMETERS | {c.variant for c in COMPONENTS.values() if c.variant is not None}
"""Parameters that must be equal in all runs of a group."""


@dataclass(frozen=True, eq=False)
class PreparedPoint:
    """A design point, ready to be run with any seed.

    Attributes
    ----------
    number
        Counted from 1.
    values
        Physical values, or names, of the factors and conditions.
    system
        Empty if a function replaces the simulation.
    digest
        Hash of everything but the seed.
    """

    number: int
    values: tuple[Level, ...]
    system: System
    digest: str

    def run_id(self, seed: int) -> str:
        """Identifier of a run of this point."""
        return hashlib.sha256(f"{self.digest} {seed}".encode()).hexdigest()[:16]


@dataclass(frozen=True, eq=False)
class Group:
    """Points that can run side by side: they differ only in parameters.

    Attributes
    ----------
    places
        Index of each point in the group, by its index among all points.
    plan
        Plan of the first point.
    values
        Values by point of each ``component.parameter`` that differs between points.
    in_lanes
        Whether the runs go side by side in lanes.
    """

    places: Mapping[int, int]
    plan: Plan
    values: Mapping[str, Floats]
    in_lanes: bool

    @cached_property
    def steps(self) -> int:
        """Number of communication steps of a run."""
        return self.plan.count - 1


def _kind(spec: ComponentSpec) -> Hashable:
    """Properties that components must share to run side by side."""
    return (
        spec.fmu,
        spec.interval_ns,
        frozenset(spec.parameters),
        tuple(spec.parameters.get(k) for k in sorted(_ALIKE)),
    )


def grouped(
    points: Sequence[PreparedPoint],
    plans: Sequence[Plan],
    free: Iterable[str],
    master: str | None,
    alone: bool,
) -> tuple[Group, ...]:
    """Group points that differ only in parameters; ``alone``: no lanes, as a record is needed."""
    alike: dict[Any, list[int]] = {}
    numbers: dict[Hashable, int] = {}
    kinds: dict[int, int] = {}  # by the id of what the points share

    def kind(thing: Any, of: Callable[[Any], Hashable]) -> int:
        if id(thing) not in kinds:
            kinds[id(thing)] = numbers.setdefault(of(thing), len(numbers))
        return kinds[id(thing)]

    for index, (point, plan) in enumerate(zip(points, plans, strict=True)):
        system = point.system
        key = (
            plan.start_ns,
            plan.stop_ns,
            kind(system.connections, tuple),
            *((name, kind(spec, _kind)) for name, spec in system.components.items()),
        )
        alike.setdefault(key, []).append(index)
    groups = []
    loop_in_c = cache(native.available)
    for indices in alike.values():
        plan = plans[indices[0]]
        if alone:
            in_lanes = False
        elif master is None:
            in_lanes = lanes_driver.unsupported(plan) is None and loop_in_c()
        else:
            in_lanes = master == "lanes"
        values = {}
        for name, spec in points[indices[0]].system.components.items():
            taken = [points[i].system.components[name] for i in indices]
            distinct = {id(it): it for it in taken}.values()
            differing = differences(distinct)
            for parameter in [p for p in spec.parameters if p in differing]:
                given = [it.parameters[parameter] for it in distinct]
                if given.count(given[0]) < len(given) and f"{name}.{parameter}" not in free:
                    rows = [it.parameters[parameter] for it in taken]
                    values[f"{name}.{parameter}"] = np.array(rows, np.float64)
        groups.append(Group({p: i for i, p in enumerate(indices)}, plan, values, in_lanes))
    return tuple(groups)
