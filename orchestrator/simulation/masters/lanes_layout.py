"""What plans with the same components and connections share, in the C driver's structures."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from sblcosim.fmus.read.ports import Port

from ...errors import ConfigurationError, nearest
from ..plans.alike import alike
from ..plans.plan import LAG, Plan, PlannedComponent
from .lanes_driver import (
    MAX_COMPONENTS,
    MAX_RECEIVERS,
    RECEIVER_PORTS,
    Engine,
    Floats,
    Link,
    Receiver,
    Truth,
    engine_of,
    unsupported,
)


@dataclass(frozen=True, eq=False)
class Layout:
    """Numbers and indices of components and variables.

    Attributes
    ----------
    numbers
        Numbers of the components, by name.
    engines
        Pointers to each component's engine.
    lanes
        Simulations side by side.
    firsts
        By component: index of each variable's first element.
    starts, low, high
        By component: parameters and inputs that a plan does not set, and the bounds of all.
    receivers
        The receivers to judge.
    """

    components: tuple[PlannedComponent, ...]
    numbers: Mapping[str, int]
    engines: Sequence[Any]
    lanes: int
    firsts: Sequence[Mapping[str, int]]
    starts: Sequence[Sequence[float]]
    low: Sequence[Floats]
    high: Sequence[Floats]
    receivers: Sequence[str]

    def find(self, component: str, variable: str, causality: str, where: str) -> tuple[int, int]:
        """Number of a component, and a variable's first element.

        Raises
        ------
        ConfigurationError
            There is none; the message begins with ``where``.
        """
        if component not in self.numbers:
            raise ConfigurationError(
                f"{where}: {component!r} must be a component{nearest(component, self.numbers)}"
            )
        number = self.numbers[component]
        ports = self.components[number].ports
        if variable not in ports or ports[variable].causality != causality:
            known = [p.name for p in ports.values() if p.causality == causality]
            raise ConfigurationError(
                f"{where}: {variable!r} must be a {causality} of {component}"
                f"{nearest(variable, known)}"
            )
        return number, self.firsts[number][variable]

    @cached_property
    def links(self) -> Sequence[tuple[int, ...]]:
        """All connections from outputs to inputs, in the C structure."""
        return [
            self.link(connection.source, f"{component.name}.{port.name}", "input")
            for component in self.components
            for write in component.writes
            for port, connection in zip(write.ports, write.connections, strict=True)
        ]

    @cached_property
    def arrays(self) -> tuple[Any, Any, Any, Any]:
        """Engines, links, judged receivers, and truth or None, for C."""
        judged = []
        for name in self.receivers:
            number = self.numbers[name]
            first = self.firsts[number]
            judged.append((number, *(first.get(port, -1) for port in RECEIVER_PORTS)))
        return (
            (ctypes.POINTER(Engine) * len(self.engines))(*self.engines),
            (Link * len(self.links))(*self.links),
            (Receiver * len(judged))(*judged),
            self._truth(),
        )

    def _truth(self) -> Any:
        """Indices of the true values, if the system has a target and a platform."""
        if not {"target", "platform"} <= set(self.numbers):
            return None
        target, platform = self.numbers["target"], self.numbers["platform"]
        moving, first = self.firsts[target], self.firsts[platform]
        beacons = self.components[platform].ports["beacon_position"].shape[0]
        return Truth(
            target, moving["position"], moving["velocity"],
            platform, first["position"], first["beacon_position"],
            first["reported_beacon_position"], beacons,
        )

    def link(self, source: str, target: str, causality: str) -> tuple[int, int, int, int, int]:
        """A connection of an output to a whole input or parameter, in the C structure."""
        name, _, variable = source.partition(".")
        number, element = self.find(name, variable, "output", source)
        name, _, variable = target.partition(".")
        to, place = self.find(name, variable, causality, target)
        return number, element, to, place, self.components[to].ports[variable].size


def layout_of(plan: Plan, lanes: int) -> Layout:
    """The layout of a plan, shared while files are assumed unchanged.

    Raises
    ------
    ConfigurationError
        A component is unsupported, or there are too many.
    FmuError
        The processor does not support that many lanes.
    """
    names = tuple(c.name for c in plan.components)
    kept = (plan.columns, *(c.ports for c in plan.components))
    layout = alike("lanes", (lanes, names, *map(id, kept)), lambda: _made(plan, lanes), *kept)
    for component in plan.components:
        if component.texts or any(s.port.causality != "parameter" for s in component.settings):
            raise _special(component)
    return layout


def _made(plan: Plan, lanes: int) -> Layout:
    stranger = unsupported(plan)
    if stranger is not None:
        raise ConfigurationError(
            f"{stranger}: must be one of our own components to run in lanes, got "
            f"{next(c.origin for c in plan.components if c.name == stranger)}; "
            "use the native or the python master"
        )
    for component in plan.components:
        if _in_parts(component):
            raise _special(component)
    if len(plan.components) > MAX_COMPONENTS:
        raise ConfigurationError(f"system: must have at most {MAX_COMPONENTS} components")
    receivers = receivers_of(plan)
    if len(receivers) > MAX_RECEIVERS:
        raise ConfigurationError(f"system: must have at most {MAX_RECEIVERS} receivers")
    engines = [engine_of(c, lanes) for c in plan.components]
    values = [values_of(c.ports, e.contents) for c, e in zip(plan.components, engines, strict=True)]
    return Layout(
        plan.components,
        {c.name: number for number, c in enumerate(plan.components)},
        engines,
        int(engines[0].contents.lanes),
        [first_elements(c.ports) for c in plan.components],
        [start.tolist() for start, _, _ in values],
        [low for _, low, _ in values],
        [high for _, _, high in values],
        receivers,
    )


def values_of(ports: Mapping[str, Port], engine: Any) -> tuple[Floats, Floats, Floats]:
    """Starts and bounds of parameters and inputs, by element."""
    start = np.zeros(engine.parameters + engine.inputs)
    low, high = np.full((2, len(start)), np.nan)
    first = first_elements(ports)
    for port in ports.values():
        if port.causality in ("parameter", "input"):
            place = slice(first[port.name], first[port.name] + port.size)
            low[place], high[place] = port.min, port.max
            if port.start is not None:
                start[place] = port.start
    return start, low, high


def _in_parts(component: PlannedComponent) -> bool:
    """Whether inputs are converted, or are parts of arrays."""
    return any(
        w.conversions or port.name not in component.ports or port.shape != column.shape
        for w in component.writes
        for port, column in zip(w.ports, w.columns, strict=True)
    )


def _special(component: PlannedComponent) -> ConfigurationError:
    return ConfigurationError(
        f"{component.name}: must have inputs that are whole outputs to run in lanes, got parts, "
        "conversions or values at the start; use the native or the python master"
    )


# --- Derived from a plan --------------------------------------------------------------------------


def receivers_of(plan: Plan) -> list[str]:
    """Receivers to judge; none unless the system has a target and a platform."""
    if not {"target", "platform"} <= {c.name for c in plan.components}:
        return []
    return [c.name for c in plan.components if {"update_count", "epoch"} <= c.ports.keys()]


def remembered(plan: Plan, variations: Mapping[str, Any] | None = None) -> int:
    """Number of instants for which the truth is kept, so that they cover the receivers' epochs.

    An estimate refers to the newest sample before its update, which may be one sampling time old,
    and becomes visible one update later. If the receiver has a parameter `LAG`, it may be older by
    that value, the largest of all runs. An epoch between two instants of the target also needs the
    earlier one.

    Parameters
    ----------
    variations
        As for `sblcosim.simulation.masters.lanes.execute`.
    """
    receivers = receivers_of(plan)
    longest = {c.name: max(c.tick_ns or 0, c.interval_ns) for c in plan.components}
    updates = [longest[name] for name in receivers]
    samples = [longest[name] for name in longest if name not in receivers]
    instants = plan.instants
    behind = 2 * max(updates, default=0) + max(samples, default=0)
    lags = [_lag(c, variations or {}) for c in plan.components if c.name in receivers]
    lag_ns = math.ceil(min(max(lags, default=0.0) * 1e9, float(instants[-1] - instants[0])))
    return int(min((behind + lag_ns) // np.diff(instants).min() + 2, len(instants)))


def _lag(component: PlannedComponent, variations: Mapping[str, Any]) -> float:
    """The largest lag of a receiver in all runs [s]; 0 without one."""
    if LAG not in component.ports:
        return 0.0
    given = variations.get(f"{component.name}.{LAG}", component.lag_s)
    return float(np.max(np.asarray(given, np.float64), initial=0.0))


def first_elements(ports: Mapping[str, Port]) -> dict[str, int]:
    """Index of each variable's first element; our value references count elements from 1."""
    return {p.name: min(p.references) - 1 for p in ports.values()}


def starts_of(
    component: PlannedComponent, starts: Sequence[float], first: Mapping[str, int]
) -> Floats:
    """Initial parameters and inputs, as in the plan.

    Parameters
    ----------
    starts
        Start values of the component itself.
    first
        Result of its `first_elements`.
    """
    values = [*starts]
    for setting in component.settings:
        place = first[setting.port.name]
        values[place : place + len(setting.values)] = setting.values
    return np.array(values, np.float64)
