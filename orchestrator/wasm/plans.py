"""Plans of the lanes master as files for WebAssembly: JSON, and the numbers that it points to."""

from __future__ import annotations

import ctypes
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from sblcosim.fmus.read.ports import Fmu
from sblcosim.models import COMPONENTS

from ..errors import ConfigurationError
from ..prepare.scenario import of_scenario
from ..scenario import starts
from ..scenario.scenario import Receivers, Scenario
from ..simulation.masters.lanes import LanesBatch
from ..simulation.plans.plan import Plan, PlannedComponent
from ..simulation.system import Connection


@dataclass(frozen=True)
class WasmPlan:
    """A plan for a module of WebAssembly.

    Attributes
    ----------
    description
        What is in the plan and where, see the README of this room.
    content
        The numbers that it points to, little-endian.
    """

    description: Mapping[str, Any]
    content: bytes

    @property
    def text(self) -> str:
        """The description as JSON."""
        return json.dumps(self.description)


def plan_of(
    scenario: Scenario,
    receivers: Receivers = (),
    *,
    record: Sequence[str] | None = None,
    settling_ns: int = 0,
) -> WasmPlan:
    """The plan of a scenario, whose runs differ in their seeds as in a study.

    Parameters
    ----------
    receivers
        Our receivers, see `sblcosim.run`.
    record
        ``"component.variable"`` of the outputs that the record of a run holds; None: all.
    settling_ns
        Errors count from this time after the start [ns].

    Raises
    ------
    ConfigurationError
        A component is not ours, or a name is unknown.
    """
    prepared = of_scenario(scenario, receivers)
    components = prepared.system.components
    labels = prepared.description.receivers
    return exported(
        prepared.plan,
        starts.seeded(scenario, components, labels),
        starts.handovers(scenario, components, labels),
        [c.name for c in prepared.plan.columns] if record is None else record,
        settling_ns,
    )


def exported(
    plan: Plan,
    seeded: Sequence[str],
    handovers: Sequence[Connection],
    record: Sequence[str],
    settling_ns: int = 0,
) -> WasmPlan:
    """A plan in the lanes master's structures.

    Parameters
    ----------
    seeded
        Components that get the seed of a run.
    handovers, record, settling_ns
        See `sblcosim.simulation.masters.lanes.execute`.
    """
    batch = LanesBatch(plan, {}, handovers, record, settling_ns, 1)
    content = bytearray()

    def placed(part: bytes) -> list[int]:
        """Place and size of a part, aligned to 8."""
        content.extend(bytes(-len(content) % 8))
        content.extend(part)
        return [len(content) - len(part), len(part)]

    arrays = {
        name: placed(bytes(array)) for name, array in batch.arrays.items()
        if name != "components" and array is not None
    }
    arrays["instants_ns"] = placed(batch.instants.astype("<i8").tobytes())
    ports = {name: _port(plan, name) for name in record}
    description = {
        "beacons": next(
            (c.ports["beacon_position"].shape[0] for c in plan.components if c.name == "platform"),
            0,
        ),
        "components": _components(plan, batch, placed),
        "numbers": {
            name: int(getattr(batch.c_plan, name))
            for name, kind in ((it[0], it[1]) for it in batch.c_plan._fields_)
            if kind is not ctypes.c_void_p
        },
        "arrays": arrays,
        "seeds": [batch.layout.find(n, "seed", "parameter", n) for n in seeded],
        "receivers": list(batch.receivers),
        "room": batch.room,
        "errors_bytes": batch.errors_bytes,
        "record": [
            {"name": name, "shape": list(port.shape), "type": port.type}
            for name, port in ports.items()
        ],
    }
    return WasmPlan(description, bytes(content))


def _components(
    plan: Plan, batch: LanesBatch, placed: Callable[[bytes], list[int]]
) -> list[dict[str, Any]]:
    """The components of a plan, whose start values get a place."""
    return [
        {
            "name": component.name,
            "type": _type(component),
            "held": holds,
            "start": placed(np.asarray(start, "<f8").tobytes()),
            "parameters": {
                name: first[name]
                for name, port in component.ports.items() if port.causality == "parameter"
            },
        }
        for component, start, holds, first in zip(
            plan.components, batch.starts, batch.needs_holding, batch.layout.firsts, strict=True
        )
    ]


def _port(plan: Plan, name: str) -> Any:
    owner, _, variable = name.partition(".")
    return next(c.ports[variable] for c in plan.components if c.name == owner)


def _type(component: PlannedComponent) -> str:
    """Name of a component of ours."""
    if isinstance(component.source, Fmu):
        for name, ours in COMPONENTS.items():
            if re.fullmatch(rf"{ours.name}\d*", component.source.identifier):
                return name
    raise ConfigurationError(
        f"{component.name}: must be one of {', '.join(COMPONENTS)} to run as WebAssembly, got "
        f"{component.origin}"
    )
