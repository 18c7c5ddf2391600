"""The lanes master: many runs of one plan side by side, for our own components.

Our FMUs contain their equations for 2, 4 or 8 simulations at once (exported symbol
``sblcosim_lanes``). Runs of a plan differ only in parameters and seeds, so a group of them goes
through the plan together, one run per lane, and gives the same bits as each run alone. Of each run
it keeps the sums of `sblcosim.results.sums`, or a record on request.
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

from ...errors import ConfigurationError, FmuError, nearest
from ..plan import Plan, PlannedComponent
from ..record import Record
from ..system import Connection
from .lanes_driver import (
    LENGTHS,
    MAX_COMPONENTS,
    MAX_RECEIVERS,
    RECEIVER_PORTS,
    SUMS,
    Engine,
    Floats,
    LanesPlan,
    Link,
    Receiver,
    Span,
    Truth,
    engine_of,
    loaded_driver,
    unsupported,
)
from .lanes_memory import Memory, first_elements, receivers_of, remembered, starts_of

_GROUPS_PER_CALL = 16
_SHORT = 10_000
"""Steps of groups of runs that are over, and need no thread, before anyone could stop them."""
ROOM_BYTES = 128 * 2**20
"""Memory of a thread [bytes] for the errors of a group of runs, if order statistics are requested.
A single long run may take more."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """Results of many runs of a plan.

    Attributes
    ----------
    sums
        By receiver: the sums of `sblcosim.results.sums.SUMS`, shape (runs, len(SUMS)). Empty if the
        system has no target and platform to judge the receivers by.
    order
        By receiver, if requested: order statistics of the lengths of the errors [m], shape (runs,
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
) -> Outcome:
    """Run a plan many times with different parameters.

    Parameters
    ----------
    variations
        By ``"component.parameter"``: one value (or array, row by row) per run. Other parameters are
        as in the plan. Intervals and variants (the target's trajectory) must not vary.
    handovers
        Outputs that become parameters before the start, e.g. the true start for a prior. The
        source must come before the target in the plan.
    record
        ``"component.variable"`` of outputs to keep at all instants.
    settling_ns
        Errors count from this time after the start [ns].
    percentages
        1 to 100: requested order statistics x₍⌈p n / 100⌉₎ of the lengths of the errors, over n
        estimates. Long runs then use fewer lanes, as their errors must be kept.
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
        batch = _Batch(plan, variations, handovers, record, settling_ns, lanes)
        # Results do not depend on the number of lanes; fewer lanes need less memory.
        if not percentages or batch.lanes == 1 or batch.room_bytes <= ROOM_BYTES:
            break
        lanes = batch.lanes // 2
    batch.percentages, batch.lengths = tuple(percentages), tuple(lengths)
    return batch.run(threads or os.cpu_count() or 1, progress)


class _Batch:
    """A plan in the C driver's structures, and the parameters of all runs."""

    def __init__(
        self,
        plan: Plan,
        variations: Mapping[str, Any],
        handovers: Sequence[Connection],
        record: Sequence[str],
        settling_ns: int,
        lanes: int,
    ) -> None:
        stranger = unsupported(plan)
        if stranger is not None:
            raise ConfigurationError(
                f"{stranger}: must be a component of ours to run in lanes, got "
                f"{next(c.origin for c in plan.components if c.name == stranger)}; "
                "use the native or the python master"
            )
        odd = next((c.name for c in plan.components if _special(c)), None)
        if odd is not None:
            raise ConfigurationError(
                f"{odd}: must have inputs that are whole outputs to run in lanes, got parts, "
                "conversions or values at the start; use the native or the python master"
            )
        if len(plan.components) > MAX_COMPONENTS:
            raise ConfigurationError(f"system: must have at most {MAX_COMPONENTS} components")
        self.plan = plan
        self.names = [c.name for c in plan.components]
        self.engines = [engine_of(c, lanes) for c in plan.components]
        self.lanes = int(self.engines[0].contents.lanes)
        self.first_elements = [first_elements(c) for c in plan.components]
        self.instants = np.ascontiguousarray(plan.instants, np.int64)
        self.starts = [
            starts_of(c, engine.contents, first)
            for c, engine, first in zip(
                plan.components, self.engines, self.first_elements, strict=True
            )
        ]
        self.runs, self.varied = self._varied(variations)
        self.receivers = receivers_of(plan)
        if len(self.receivers) > MAX_RECEIVERS:
            raise ConfigurationError(f"system: must have at most {MAX_RECEIVERS} receivers")
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
        """Memory for the errors of a group of runs [bytes]: lengths, then keys and candidates."""
        return self.room * (len(self.receivers) * 8 + 2 + 8) * len(LENGTHS) * self.lanes

    def _varied(self, variations: Mapping[str, Any]) -> tuple[int, list[tuple[int, int, Floats]]]:
        """Number of runs, and what varies: component, first element and (runs, size) values."""
        runs, varied = 1, []
        for name, given in variations.items():
            component, _, variable = name.partition(".")
            number, element = self._find(component, variable, "parameter", name)
            values = np.asarray(given, np.float64)
            size = self.plan.components[number].ports[variable].size
            values = values.reshape(len(values), -1) if values.ndim else values.reshape(1, 1)
            if values.shape[1] != size:
                raise ConfigurationError(
                    f"{name}: must have {size} values per run, got {values.shape[1]}"
                )
            if not np.isfinite(values).all():
                raise ConfigurationError(f"{name}: must be finite in every run")
            port = self.plan.components[number].ports[variable]
            low, high = values.min(axis=0), values.max(axis=0)
            if (low < port.min).any() or (high > port.max).any():
                raise ConfigurationError(
                    f"{name}: must be between {min(port.min):g} and {max(port.max):g} in every "
                    f"run, got {low.min():g} to {high.max():g}"
                )
            if len(values) != 1:
                if runs not in (1, len(values)):
                    raise ConfigurationError(f"{name}: must have {runs} runs, got {len(values)}")
                runs = len(values)
            varied.append((number, element, values))
        return runs, varied

    def _find(self, component: str, variable: str, causality: str, where: str) -> tuple[int, int]:
        if component not in self.names:
            raise ConfigurationError(
                f"{where}: {component!r} must be a component{nearest(component, self.names)}"
            )
        number = self.names.index(component)
        ports = self.plan.components[number].ports
        if variable not in ports or ports[variable].causality != causality:
            known = [p.name for p in ports.values() if p.causality == causality]
            raise ConfigurationError(
                f"{where}: {variable!r} must be a {causality} of {component}"
                f"{nearest(variable, known)}"
            )
        return number, self.first_elements[number][variable]

    def _translate(
        self, handovers: Sequence[Connection], record: Sequence[str], settling_ns: int
    ) -> None:
        links = []
        for target, component in enumerate(self.plan.components):
            for write in component.writes:
                for port, connection in zip(write.ports, write.connections, strict=True):
                    name, _, variable = connection.source.partition(".")
                    source, element = self._find(name, variable, "output", connection.source)
                    links.append(
                        (source, element, target, self.first_elements[target][port.name], port.size)
                    )
        given = []
        for connection in handovers:
            name, _, variable = connection.source.partition(".")
            source, element = self._find(name, variable, "output", connection.source)
            name, _, variable = connection.target.partition(".")
            target, to = self._find(name, variable, "parameter", connection.target)
            size = self.plan.components[target].ports[variable].size
            given.append((source, element, target, to, size))
        judged = []
        for name in self.receivers:
            number = self.names.index(name)
            first = self.first_elements[number]
            judged.append((number, *(first.get(port, -1) for port in RECEIVER_PORTS)))
        self.spans = []
        for name in record:
            owner, _, variable = name.partition(".")
            number, element = self._find(owner, variable, "output", name)
            self.spans.append((number, element, self.plan.components[number].ports[variable].size))
        self.recorded = list(record)
        truth = self._truth()
        base = int(np.diff(self.instants).min())
        same = len({c.interval_ns for c in self.plan.components}) == 1
        self.needs_holding = [
            not same and c.interval_ns != base for c in self.plan.components
        ]
        arrays = (
            (ctypes.POINTER(Engine) * len(self.engines))(*self.engines),
            (ctypes.c_int64 * len(self.names))(*(c.interval_ns for c in self.plan.components)),
            (Link * len(links))(*links),
            (Link * len(given))(*given),
            (Receiver * len(judged))(*judged),
            truth,
            (Span * len(self.spans))(*self.spans),
        )
        self._kept = arrays
        self.c_plan = LanesPlan(
            len(self.names), len(links), len(given), len(judged), len(self.spans),
            len(self.instants), self.remembered,
            truth is not None and self.needs_holding[truth.target],
            *(None if a is None else ctypes.addressof(a) for a in arrays),
            self.instants.ctypes.data, settling_ns,
        )

    def _truth(self) -> ctypes.Structure | None:
        """Indices of the true values, if the system has a target and a platform."""
        if not {"target", "platform"} <= set(self.names):
            return None
        target, platform = self.names.index("target"), self.names.index("platform")
        moving, first = self.first_elements[target], self.first_elements[platform]
        beacons = self.plan.components[platform].ports["beacon_position"].shape[0]
        truth: ctypes.Structure | None = Truth(
            target, moving["position"], moving["velocity"],
            platform, first["position"], first["beacon_position"],
            first["reported_beacon_position"], beacons,
        )
        return truth

    def run(self, threads: int, progress: Callable[[float], None] | None) -> Outcome:
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
                local.memory = Memory(self)
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
        values = [
            np.repeat(np.repeat(start[None, :, None], len(runs), 0), self.lanes, 2)
            for start in self.starts
        ]
        for number, element, varied in self.varied:
            size = varied.shape[1]
            chosen = varied[runs if len(varied) > 1 else np.zeros_like(runs)]
            values[number][:, element : element + size] = chosen.transpose(0, 2, 1)
        return values

    def _disagreement(self, status: int) -> FmuError:
        component = self.plan.components[(status & 0xFFFF) - 1]
        element = (status >> 16) - 1
        first = self.first_elements[self.names.index(component.name)]
        name = max((p for p in first.items() if p[1] <= element), key=lambda p: p[1])[0]
        return FmuError(
            f"{component.name}.{name}: must be the same in all runs side by side, and an interval "
            "must be whole nanoseconds"
        )

    def _outcome(self, sums: Floats, order: Floats, history: Floats) -> Outcome:
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
        return Outcome(
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


__all__ = ["Outcome", "execute", "unsupported"]


def _special(component: PlannedComponent) -> bool:
    """Whether inputs are converted, parts of arrays, or set at the start."""
    settings = (s.port.causality != "parameter" for s in component.settings)
    return any(settings) or bool(component.texts) or any(
        w.conversions or port.name not in component.ports or port.shape != column.shape
        for w in component.writes
        for port, column in zip(w.ports, w.columns, strict=True)
    )
