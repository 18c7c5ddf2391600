"""Working memory of the lanes master, and what it derives from a plan."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..plan import LAG, Plan, PlannedComponent
from .lanes_driver import LENGTHS, MOMENT, Errors, Floats


class BatchSizes(Protocol):
    """The properties of a batch that `LanesMemory` needs."""

    engines: Sequence[Any]
    needs_holding: list[bool]
    remembered: int
    lanes: int
    receivers: Sequence[str]
    percentages: tuple[int, ...]

    @property
    def room(self) -> int:
        """Largest number of estimates in a run."""


class LanesMemory:
    """Memory for one thread."""

    def __init__(self, batch: BatchSizes) -> None:
        self._kept: list[NDArray[Any]] = []
        blocks, held = [], []
        for engine, holds in zip(batch.engines, batch.needs_holding, strict=True):
            k = engine.contents
            blocks.append(self._aligned(k.block_size))
            size = (k.parameters + k.inputs + k.outputs) * k.lanes * 8
            held.append(self._aligned(size) if holds else None)
        self.moments = self._aligned(batch.remembered * MOMENT * batch.lanes * 8)
        self.blocks = (ctypes.c_void_p * len(blocks))(*blocks)
        self.held = (ctypes.c_void_p * len(held))(*held)
        self.errors = self._room_for_errors(batch)

    def _room_for_errors(self, batch: BatchSizes) -> Errors | None:
        """Space for the errors of a group, if order statistics are requested."""
        if not batch.percentages:
            return None
        given = np.array(batch.percentages, np.int32)
        self._kept.append(given)
        values = batch.room * len(LENGTHS) * batch.lanes
        sizes = (len(batch.receivers) * values * 8, values * 2, values * 8)
        return Errors(
            batch.room, len(given), given.ctypes.data, *(self._aligned(size) for size in sizes)
        )

    def _aligned(self, size: int) -> int:
        memory = np.zeros(size + 64, np.uint8)
        self._kept.append(memory)
        address: int = memory.ctypes.data
        return address + -address % 64


def receivers_of(plan: Plan) -> list[str]:
    """Receivers to judge; none unless the system has a target and a platform."""
    if not {"target", "platform"} <= {c.name for c in plan.components}:
        return []
    return [c.name for c in plan.components if {"update_count", "epoch"} <= c.ports.keys()]


def remembered(plan: Plan, variations: Mapping[str, Any] | None = None) -> int:
    """Number of instants for which the truth is kept, so that they cover the receivers' epochs.

    An estimate refers to the newest sample before its update, which may be one sampling time old,
    and is visible one update later; if the receiver has a parameter `LAG`, it may be older by its
    value, the largest of all runs. An epoch between two instants of the target needs the earlier
    one too.

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


def first_elements(component: PlannedComponent) -> dict[str, int]:
    """Index of each variable's first element; our value references count elements from 1."""
    return {p.name: min(p.references) - 1 for p in component.ports.values()}


def starts_of(
    component: PlannedComponent, starts: Sequence[float], first: Mapping[str, int]
) -> Floats:
    """Initial parameters and inputs, as in the plan.

    Parameters
    ----------
    starts
        Those of the component by itself.
    first
        Its `first_elements`.
    """
    values = [*starts]
    for setting in component.settings:
        place = first[setting.port.name]
        values[place : place + len(setting.values)] = setting.values
    return np.array(values, np.float64)
