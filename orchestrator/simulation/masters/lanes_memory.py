"""Working memory of the lanes master, and order statistics of the errors in it."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..plan import Plan, PlannedComponent
from .lanes_driver import LENGTHS, MOMENT, Engine, Floats


class Batch(Protocol):
    """The properties of a batch that `Memory` needs."""

    engines: list[Any]
    needs_holding: list[bool]
    remembered: int
    lanes: int
    receivers: list[str]
    percentages: tuple[int, ...]

    @property
    def room(self) -> int:
        """Largest number of estimates in a run."""


class Memory:
    """Memory for one thread."""

    def __init__(self, batch: Batch) -> None:
        self._kept: list[NDArray[np.uint8]] = []
        blocks, held = [], []
        for engine, holds in zip(batch.engines, batch.needs_holding, strict=True):
            k = engine.contents
            blocks.append(self._aligned(k.block_size))
            size = (k.parameters + k.inputs + k.outputs) * k.lanes * 8
            held.append(self._aligned(size) if holds else None)
        self.moments = self._aligned(batch.remembered * MOMENT * batch.lanes * 8)
        self.blocks = (ctypes.c_void_p * len(blocks))(*blocks)
        self.held = (ctypes.c_void_p * len(held))(*held)
        self._squares = np.empty(0)

    def squares(self, batch: Batch, groups: int) -> tuple[Floats, NDArray[np.int64]]:
        """Space for the errors of some groups, and the number of rows filled."""
        filled = np.zeros((groups, len(batch.receivers)), np.int64)
        shape = (*filled.shape, batch.room, len(LENGTHS), batch.lanes)
        size = math.prod(shape) if batch.percentages else 0
        if self._squares.size < size:
            self._squares = np.empty(size)
        return self._squares[:size].reshape(shape if size else 0), filled

    def _aligned(self, size: int) -> int:
        memory = np.zeros(size + 64, np.uint8)
        self._kept.append(memory)
        address: int = memory.ctypes.data
        return address + -address % 64


def order_index(
    count: int | NDArray[np.int64], percentages: Sequence[int]
) -> NDArray[np.int64]:
    """Index of the order statistics x₍⌈p n / 100⌉₎ among n sorted values; -1 without any value."""
    return -(-count * np.array(percentages, np.int64) // 100) - 1


def in_order(
    squares: Floats,
    filled: NDArray[np.int64],
    counts: NDArray[np.int64],
    percentages: Sequence[int],
    lengths: Sequence[str] = LENGTHS,
) -> Floats:
    """Order statistics of the lengths of the errors of some groups.

    Parameters
    ----------
    squares
        Squares of the lengths [m²], infinite where a lane has none; shape (groups, receivers, room,
        len(LENGTHS), lanes).
    filled
        Number of rows in use; shape (groups, receivers).
    counts
        Number of estimates; shape (groups, receivers, lanes).

    Returns
    -------
    Floats
        Lengths [m]; shape (groups, receivers, len(lengths), lanes, len(percentages)); NaN without
        an estimate.
    """
    lanes = counts.shape[-1]
    order = np.zeros((*filled.shape, len(lengths), lanes, len(percentages)))
    rows = [LENGTHS.index(length) for length in lengths]
    space = np.empty(len(rows) * lanes * int(filled.max(initial=0)))
    lane = np.arange(lanes)[:, None]
    at = np.maximum(order_index(counts[..., None], percentages), 0)
    for index in np.ndindex(filled.shape):
        if filled[index]:
            count = int(filled[index])
            ordered = space[: len(rows) * lanes * count].reshape(len(rows), lanes, count)
            for values, row in zip(ordered, rows, strict=True):
                np.copyto(values, squares[index][:count, row].T)
            # Doubles that are not negative are in the order of their bits; integers sort quicker.
            ordered.view(np.int64).sort(axis=-1)
            order[index] = ordered[:, lane, at[index]]
    some = counts[:, :, None, :, None] > 0
    lengths_m: Floats = np.where(some, np.sqrt(order), np.nan)
    return lengths_m


def receivers_of(plan: Plan) -> list[str]:
    """Receivers to judge; none unless the system has a target and a platform."""
    if not {"target", "platform"} <= {c.name for c in plan.components}:
        return []
    return [c.name for c in plan.components if {"update_count", "epoch"} <= c.ports.keys()]


LAG = "lag"
"""Parameter of a receiver: by how much more its estimates are older [s], at most."""


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
    """The largest value of a receiver's parameter `LAG` [s]; 0 without one."""
    port = component.ports.get(LAG)
    if port is None or port.causality != "parameter" or port.size != 1:
        return 0.0
    start = [0.0 if port.start is None else port.start]
    settings = [s.values for s in component.settings if s.port.name == LAG]
    given = variations.get(f"{component.name}.{LAG}", settings[-1] if settings else start)
    return float(np.max(np.asarray(given, np.float64), initial=0.0))


def first_elements(component: PlannedComponent) -> dict[str, int]:
    """Index of each variable's first element; our value references count elements from 1."""
    return {p.name: min(p.references) - 1 for p in component.ports.values()}


def starts_of(component: PlannedComponent, engine: Engine) -> Floats:
    """Initial parameters and inputs, as in the plan."""
    values = np.zeros(engine.parameters + engine.inputs)
    first = first_elements(component)
    for port in component.ports.values():
        if port.causality in ("parameter", "input") and port.start is not None:
            values[first[port.name] : first[port.name] + port.size] = port.start
    for setting in component.settings:
        start = first[setting.port.name]
        values[start : start + setting.port.size] = setting.values
    return values
