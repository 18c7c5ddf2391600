"""The lanes master: many runs of one plan side by side, for our own components.

Our FMUs contain their equations for 2, 4 or 8 simulations at once (exported symbol
``sblcosim_lanes``). Runs of a plan differ only in parameters and seeds. A group of them therefore
goes through the plan together, one run per lane, and gives the same bits as each run alone. For
each run it keeps the sums of `sblcosim.results.sums`, or a record on request.
"""

from __future__ import annotations

import ctypes
import os
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus import stopping

from ...data.record import Record
from ...errors import ConfigurationError, FmuError
from ..plans.plan import Plan
from ..system import Connection
from .lanes_driver import (
    LENGTHS,
    MOMENT,
    SUMS,
    Errors,
    Floats,
    LanesPlan,
    Link,
    Span,
    loaded_driver,
    unsupported,
)
from .lanes_layout import layout_of, remembered, starts_of

_GROUPS_PER_CALL = 16
_SHORT = 10_000
"""Number of steps of groups that finish before anyone could stop them, and so need no thread."""
ROOM_BYTES = 128 * 2**20
"""Memory of a thread [bytes] for the errors of a group of runs, if order statistics are requested.
A single long run may take more."""


@dataclass(frozen=True, eq=False)
class RunsOutcome:
    """Results of many runs of a plan.

    Attributes
    ----------
    sums
        By receiver: the sums of `sblcosim.results.sums.SUMS`, shape (runs, len(SUMS)). Empty if the
        system has no target and platform to judge the receivers by.
    order
        By receiver, if requested: percentiles of the lengths of the errors [m], shape (runs,
        len(lengths), percentages); NaN without an estimate.
    values, time_ns, intervals_ns
        If requested: recorded variables, (runs, instants, *shape), at these times; see `Record`.
    """

    sums: Mapping[str, Floats]
    order: Mapping[str, Floats]
    time_ns: NDArray[np.int64]
    values: Mapping[str, NDArray[Any]]
    intervals_ns: Mapping[str, int]

    def record(self, run: int) -> Record:
        """The record of one run, with the requested variables."""
        return Record(
            self.time_ns,
            {name: values[run] for name, values in self.values.items()},
            self.intervals_ns,
        )


def execute(
    plan: Plan,
    variations: Mapping[str, Any],
    *,
    handovers: Sequence[Connection] = (),
    record: Sequence[str] = (),
    settling_ns: int = 0,
    percentages: Sequence[int] = (),
    lengths: Sequence[str] = LENGTHS,
    lanes: int = 0,
    threads: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> RunsOutcome:
    """Run a plan many times with different parameters.

    Parameters
    ----------
    variations
        By ``"component.parameter"``: one value (or array, row by row) per run. Other parameters are
        as in the plan. Intervals and variants (the target's trajectory) must not vary.
    handovers
        Outputs that become parameters before the start, for example the true start for a prior. The
        source must come before the target in the plan.
    record
        ``"component.variable"`` of outputs to keep at all instants.
    settling_ns
        Errors count from this time after the start [ns].
    percentages
        1 to 100: requested percentiles x₍⌈p n / 100⌉₎ of the lengths of the errors, over n
        estimates. Long runs then use fewer lanes, because their errors must be kept.
    lengths
        Which lengths, of `LENGTHS`.
    lanes
        Simulations side by side: 1, 2, 4, 8, or 0 for the best choice on this processor.
    threads
        Default: all cores. Results do not depend on it, nor on ``lanes``.
    progress
        Called from this thread with the completed share, 0 to 1.

    Raises
    ------
    ConfigurationError
        A component is unsupported, or a name or a shape does not fit.
    FmuError
        A parameter's values cannot share a group of lanes, or the processor does not support that
        many lanes.
    """
    while True:
        batch = LanesBatch(plan, variations, handovers, record, settling_ns, lanes)
        # Results do not depend on the number of lanes; fewer lanes need less memory.
        if not percentages or batch.lanes == 1 or batch.room_bytes <= ROOM_BYTES:
            break
        lanes = batch.lanes // 2
    batch.percentages, batch.lengths = tuple(percentages), tuple(lengths)
    return batch.run(threads or os.cpu_count() or 1, progress)


_Varied = tuple[NDArray[np.int64], Floats]
"""Elements of a component's parameters, and their values; (k,) and (runs, k)."""


class LanesBatch:
    """A plan in the C driver's structures, and the parameters of all runs.

    Attributes
    ----------
    arrays
        What ``struct plan`` points to, by field; the instants are in ``instants``.
    starts
        By component: parameters and inputs before the start, as in the plan.
    needs_holding
        By component: whether its values must be kept while it is not due.
    """

    def __init__(
        self,
        plan: Plan,
        variations: Mapping[str, Any],
        handovers: Sequence[Connection],
        record: Sequence[str],
        settling_ns: int,
        lanes: int,
    ) -> None:
        self.plan = plan
        self.layout = layout_of(plan, lanes)
        self.runs, self.varied = self._varied(variations)
        if not lanes and 2 * self.runs <= self.layout.lanes:  # half of them would be copies
            self.layout = layout_of(plan, self.layout.lanes // 2)
        self.lanes = self.layout.lanes
        self.engines, self.receivers = self.layout.engines, self.layout.receivers
        self.instants = np.ascontiguousarray(plan.instants, np.int64)
        self.starts = [
            starts_of(c, start, first)
            for c, start, first in zip(
                plan.components, self.layout.starts, self.layout.firsts, strict=True
            )
        ]
        self.remembered = remembered(plan, variations)
        self._translate(handovers, record, settling_ns)
        self.percentages: tuple[int, ...] = ()
        self.lengths: tuple[str, ...] = LENGTHS

    @property
    def room(self) -> int:
        """Largest number of estimates of any receiver in a run."""
        span = self.plan.stop_ns - self.plan.start_ns
        ticks = [
            max(c.tick_ns or 0, c.interval_ns)
            for c in self.plan.components
            if c.name in self.receivers
        ]
        return span // max(min(ticks, default=span), 1) + 1

    @property
    def room_bytes(self) -> int:
        """Memory for the errors of a group of runs [bytes]."""
        return sum(self.errors_bytes.values())

    @property
    def errors_bytes(self) -> dict[str, int]:
        """The same by the pointers of ``struct errors``."""
        values = self.room * len(LENGTHS) * self.lanes
        return {"squares": len(self.receivers) * values * 8, "keys": values * 2,
                "candidates": values * 8}

    def _varied(self, variations: Mapping[str, Any]) -> tuple[int, dict[int, _Varied]]:
        """Number of runs, and the varied parameters of each component."""
        runs = 1
        parts: dict[int, list[tuple[str, int, Floats]]] = {}
        for name, given in variations.items():
            component, _, variable = name.partition(".")
            number, element = self.layout.find(component, variable, "parameter", name)
            size = self.plan.components[number].ports[variable].size
            values = np.asarray(given, np.float64)
            values = values.reshape(len(values), -1) if values.ndim else values.reshape(1, 1)
            if values.shape[1] != size:
                raise ConfigurationError(
                    f"{name}: must have {size} values per run, got {values.shape[1]}"
                )
            if len(values) != 1:
                if runs not in (1, len(values)):
                    raise ConfigurationError(f"{name}: must have {runs} runs, got {len(values)}")
                runs = len(values)
            parts.setdefault(number, []).append((name, element, values))
        return runs, {number: self._together(number, runs, own) for number, own in parts.items()}

    def _together(
        self, number: int, runs: int, parts: Sequence[tuple[str, int, Floats]]
    ) -> _Varied:
        """Checked values of one component, side by side."""
        elements = np.array(
            [first + i for _, first, values in parts for i in range(values.shape[1])], np.int64
        )
        table, done = np.empty((runs, len(elements))), 0
        for *_, values in parts:
            table[:, done : done + values.shape[1]] = values
            done += values.shape[1]
        low, high = (side[number][elements] for side in (self.layout.low, self.layout.high))
        if not (np.isfinite(table) & (low <= table) & (table <= high)).all():
            for name, _, values in parts:
                self._check(name, number, values)
        return elements, table

    def _check(self, name: str, number: int, values: Floats) -> None:
        """Refuse values that a parameter does not accept."""
        if not np.isfinite(values).all():
            raise ConfigurationError(f"{name}: must be finite in every run")
        port = self.plan.components[number].ports[name.partition(".")[2]]
        low, high = values.min(axis=0), values.max(axis=0)
        if (low < port.min).any() or (high > port.max).any():
            raise ConfigurationError(
                f"{name}: must be between {min(port.min):g} and {max(port.max):g} in every "
                f"run, got {low.min():g} to {high.max():g}"
            )

    def _translate(
        self, handovers: Sequence[Connection], record: Sequence[str], settling_ns: int
    ) -> None:
        layout = self.layout
        given = [layout.link(c.source, c.target, "parameter") for c in handovers]
        self.spans = []
        for name in record:
            owner, _, variable = name.partition(".")
            number, element = layout.find(owner, variable, "output", name)
            self.spans.append((number, element, self.plan.components[number].ports[variable].size))
        self.recorded = list(record)
        base = int(np.diff(self.instants).min())
        intervals = [c.interval_ns for c in self.plan.components]
        same = len({*intervals}) == 1
        self.needs_holding = [not same and interval != base for interval in intervals]
        engines, links, judged, truth = layout.arrays
        self.arrays = {
            "components": engines,
            "interval_ns": (ctypes.c_int64 * len(intervals))(*intervals),
            "links": links,
            "handovers": (Link * len(given))(*given),
            "receivers": judged,
            "truth": truth,
            "spans": (Span * len(self.spans))(*self.spans),
        }
        self.c_plan = LanesPlan(
            len(intervals), len(links), len(given), len(judged), len(self.spans),
            len(self.instants), self.remembered,
            truth is not None and self.needs_holding[truth.target],
            settling_ns=settling_ns,
            instants_ns=self.instants.ctypes.data,
            **{n: None if a is None else ctypes.addressof(a) for n, a in self.arrays.items()},
        )

    def run(self, threads: int, progress: Callable[[float], None] | None) -> RunsOutcome:
        groups = -(-self.runs // self.lanes)
        sums = np.empty((groups, len(self.receivers), len(SUMS), self.lanes))
        width = sum(count for _, _, count in self.spans)
        history = np.empty((groups if width else 0, len(self.instants), width, self.lanes))
        shape = (len(self.receivers), len(self.percentages), len(LENGTHS), self.lanes)
        order = np.empty((groups, *shape))
        cancel = ctypes.c_int32(0)
        counters: list[ctypes.c_int64] = []
        local = threading.local()

        def chunk(first: int) -> None:
            if not hasattr(local, "memory"):
                local.memory = LanesMemory(self)
                local.done = ctypes.c_int64(0)
                counters.append(local.done)
            last = min(first + _GROUPS_PER_CALL, groups)
            values = self._values(first, last)
            errors = local.memory.errors
            status = self._drive()(
                ctypes.byref(self.c_plan), local.memory.blocks, local.memory.held,
                ctypes.c_void_p(local.memory.moments),
                ctypes.c_int64(last - first),
                (ctypes.c_void_p * len(values))(*(v.ctypes.data for v in values)),
                ctypes.c_void_p(sums[first:].ctypes.data),
                ctypes.c_void_p(history[first:].ctypes.data if width else None),
                None if errors is None else ctypes.byref(errors),
                ctypes.c_void_p(order[first:].ctypes.data),
                ctypes.byref(cancel), ctypes.byref(local.done),
            )
            if status > 0:
                raise self._disagreement(int(status))
            if status == -2:
                raise FmuError("a receiver must not give more estimates than it has updates")

        total = groups * max(len(self.instants) - 1, 1)
        firsts = range(0, groups, _GROUPS_PER_CALL)
        if total <= _SHORT:
            stopping.check()
            for first in firsts:
                chunk(first)
        else:
            with ThreadPoolExecutor(threads) as pool:
                try:
                    for future in [pool.submit(chunk, first) for first in firsts]:
                        while not wait((future,), stopping.PERIOD).done:
                            stopping.check()
                            if progress:
                                progress(min(sum(c.value for c in counters) / total, 1.0))
                        future.result()
                except BaseException:
                    cancel.value = 1
                    pool.shutdown(cancel_futures=True)
                    raise
        if progress:
            progress(1.0)
        return self._outcome(sums, order, history)

    def _drive(self) -> Any:
        drive = loaded_driver()[f"sblcosim_drive_{self.lanes}"]
        drive.restype = ctypes.c_int64
        return drive

    def _values(self, first: int, last: int) -> list[Floats]:
        """Initial parameters and inputs of some groups; (groups, elements, lanes) by component."""
        # Copies of the last run fill up the last group.
        wanted = np.arange(first * self.lanes, last * self.lanes)
        runs = np.minimum(wanted, self.runs - 1).reshape(-1, self.lanes)
        values = []
        for number, start in enumerate(self.starts):
            own = np.empty((len(runs), len(start), self.lanes))
            own[:] = start[:, None]
            if number in self.varied:
                elements, table = self.varied[number]
                own[:, elements] = table[runs].transpose(0, 2, 1)
            values.append(own)
        return values

    def _disagreement(self, status: int) -> FmuError:
        component = self.plan.components[(status & 0xFFFF) - 1]
        element = (status >> 16) - 1
        first = self.layout.firsts[(status & 0xFFFF) - 1]
        name = max((p for p in first.items() if p[1] <= element), key=lambda p: p[1])[0]
        return FmuError(
            f"{component.name}.{name}: must be the same in all runs side by side, and an interval "
            "must be whole nanoseconds"
        )

    def _outcome(self, sums: Floats, order: Floats, history: Floats) -> RunsOutcome:
        shape = (len(sums) * self.lanes, *sums.shape[1:3])
        by_run = np.moveaxis(sums, 3, 1).reshape(shape)[: self.runs]
        lengths = [LENGTHS.index(length) for length in self.lengths]
        ordered = order[:, :, :, lengths].transpose(0, 4, 1, 3, 2)
        ordered = ordered.reshape(len(order) * self.lanes, *ordered.shape[2:])[: self.runs]
        values = {}
        start = 0
        if self.spans:
            flat = np.moveaxis(history, 3, 1).reshape(-1, *history.shape[1:3])[: self.runs]
            for name, (number, _, count) in zip(self.recorded, self.spans, strict=True):
                port = self.plan.components[number].ports[name.partition(".")[2]]
                column = flat[:, :, start : start + count].reshape(*flat.shape[:2], *port.shape)
                values[name] = _typed(column, port.type)
                start += count
        return RunsOutcome(
            {name: by_run[:, i] for i, name in enumerate(self.receivers)},
            {name: ordered[:, i] for i, name in enumerate(self.receivers)}
            if self.percentages
            else {},
            self.instants,
            values,
            self.plan.intervals_ns,
        )


def _typed(values: Floats, kind: str) -> NDArray[Any]:
    if kind == "Float64":
        return np.ascontiguousarray(values)
    return values.astype(np.bool_ if kind == "Boolean" else np.int32)


__all__ = ["RunsOutcome", "execute", "unsupported"]


class LanesMemory:
    """Memory for one thread."""

    def __init__(self, batch: LanesBatch) -> None:
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

    def _room_for_errors(self, batch: LanesBatch) -> Errors | None:
        """Space for the errors of a group, if order statistics are requested."""
        if not batch.percentages:
            return None
        given = np.array(batch.percentages, np.int32)
        self._kept.append(given)
        return Errors(
            batch.room, len(given), given.ctypes.data,
            **{name: self._aligned(size) for name, size in batch.errors_bytes.items()},
        )

    def _aligned(self, size: int) -> int:
        memory = np.zeros(size + 64, np.uint8)
        self._kept.append(memory)
        address: int = memory.ctypes.data
        return address + -address % 64
