"""Recorded inputs, given to one of our components with many sets of parameters side by side.

Only ticks with something new need a step, and those up to the lag of a receiver that looks back:
others change nothing.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sblcosim.fmus import stopping
from sblcosim.fmus.read.ports import Fmu, read

from ...errors import ConfigurationError, FmuError, nearest
from . import c_libraries
from .lanes_driver import Floats, engine_in, has_engine
from .lanes_layout import first_elements, values_of

DRIVER = c_libraries.Driver("replay", lanes=True)
_INTERVAL = "update_interval"
_TOGETHER = 2_000
"""Ticks between two looks at Ctrl-C."""


class Replay(ctypes.Structure):
    """``struct replay`` of c/replay.c."""

    _fields_ = (
        ("engine", ctypes.c_void_p),
        ("start_ns", ctypes.c_int64),
        ("interval_ns", ctypes.c_int64),
        *((n, ctypes.c_void_p) for n in ("ticks_ns", "inputs", "places", "spans", "wanted")),
        ("n_wanted", ctypes.c_int64),
        ("width", ctypes.c_int32),
        ("n_spans", ctypes.c_int32),
    )


def replay(
    fmu: Path,
    ticks_ns: ArrayLike,
    inputs: Mapping[str, ArrayLike],
    parameters: Mapping[str, ArrayLike],
    interval_ns: int,
    *,
    record: Sequence[str],
    start_ns: int | None = None,
    wanted: ArrayLike | None = None,
    lanes: int = 0,
) -> dict[str, NDArray[Any]]:
    """Give recorded inputs to one of our components, once for each set of parameters.

    The outputs have the same bits as those of a run in which a `Player` feeds the component.

    Parameters
    ----------
    ticks_ns
        The n ticks at which inputs are given [ns]: the start plus positive multiples of the
        interval, ascending. Ticks between them are left out.
    inputs
        Values at the ticks, by port; shape (n, …). Other inputs keep their start values.
    parameters
        By name: a value (or array) per run, shape (runs, …), or one for all, shape (1, …).
    interval_ns
        Time between ticks [ns].
    record
        Outputs to return.
    start_ns
        Start time [ns]; one interval before the first tick by default.
    wanted
        Numbers of the ticks after which to return outputs, from 0, ascending; all by default.
    lanes
        Simulations side by side: 1, 2, 4, 8, or 0 for the best choice on this processor. Results do
        not depend on it.

    Returns
    -------
    dict
        By output: its values one interval after the tick, when they appear; (runs, ticks, …).

    Raises
    ------
    ConfigurationError
        The component is not ours, or names, shapes, values or ticks do not fit.
    FmuError
        The processor does not support that many lanes.
    """
    one = _Component.of(fmu, lanes)
    ticks = np.ascontiguousarray(ticks_ns, np.int64)
    start = int(ticks[0]) - interval_ns if start_ns is None and len(ticks) else start_ns or 0
    _check(ticks, start, interval_ns)
    columns, places = one.inputs(inputs, len(ticks))
    chosen = np.ascontiguousarray(np.arange(len(ticks)) if wanted is None else wanted, np.int64)
    if len(chosen) and not (
        np.all(np.diff(chosen) > 0) and chosen[0] >= 0 and chosen[-1] < len(ticks)
    ):
        raise ConfigurationError(f"wanted: must be ascending numbers of {len(ticks)} ticks")
    spans = np.array([one.span(name) for name in record], np.int32).reshape(-1, 2)
    given = {_INTERVAL: [interval_ns / 1e9]} if _INTERVAL in one.first else {}
    runs, values = one.values({**parameters, **given})
    plan = Replay(
        ctypes.cast(one.engine, ctypes.c_void_p).value, start, interval_ns, ticks.ctypes.data,
        columns.ctypes.data, places.ctypes.data, spans.ctypes.data, chosen.ctypes.data,
        len(chosen), len(places), len(spans),
    )
    history = np.empty((len(values), len(chosen), int(spans[:, 1].sum()), one.lanes))
    for group, own in zip(history, values, strict=True):
        one.run(plan, own, group, len(ticks))
    flat = np.moveaxis(history, 3, 1).reshape(-1, *history.shape[1:3])[:runs]
    return {
        name: one.shaped(name, part)
        for name, part in zip(record, np.split(flat, np.cumsum(spans[:-1, 1]), axis=2), strict=True)
    } if record else {}


def _check(ticks: NDArray[np.int64], start: int, interval: int) -> None:
    """Refuse ticks that are none of the component's."""
    steps = ticks - start
    if interval <= 0 or np.any(steps <= 0) or np.any(steps % interval) or np.any(
        np.diff(ticks) <= 0
    ):
        raise ConfigurationError(
            f"ticks: must ascend from {start} ns in multiples of {interval} ns, got others"
        )


@dataclass(frozen=True, eq=False)
class _Component:
    """A component and its engine."""

    fmu: Fmu
    engine: Any
    first: Mapping[str, int]

    @classmethod
    def of(cls, path: Path, lanes: int) -> _Component:
        fmu = read(path)
        if not has_engine(fmu):
            raise ConfigurationError(f"{path.name}: must be one of our own components to replay")
        version = ctypes.c_uint32.in_dll(
            c_libraries.load(DRIVER), "sblcosim_replay_version"
        ).value
        engine = engine_in(fmu, path.stem, lanes, version)
        return cls(fmu, engine, first_elements(fmu.ports))

    @property
    def lanes(self) -> int:
        """Simulations side by side."""
        return int(self.engine.contents.lanes)

    def find(self, name: str, causality: str) -> int:
        """First element of a variable, counted from that of the first one of its causality."""
        ports, k = self.fmu.ports, self.engine.contents
        known = [p.name for p in ports.values() if p.causality == causality]
        if name not in known:
            raise ConfigurationError(
                f"{name}: must be one of the {causality}s of {self.fmu.identifier}"
                f"{nearest(name, known)}"
            )
        before = {"parameter": 0, "input": k.parameters, "output": k.parameters + k.inputs}
        return self.first[name] - int(before[causality])

    def span(self, name: str) -> tuple[int, int]:
        """First element and length of an output."""
        return self.find(name, "output"), self.fmu.ports[name].size

    def inputs(
        self, given: Mapping[str, ArrayLike], ticks: int
    ) -> tuple[Floats, NDArray[np.int32]]:
        """Values at the ticks side by side, and the element that each column sets."""
        columns, places = [np.empty((ticks, 0))], [np.empty(0, np.int32)]
        for name, values in given.items():
            column = np.asarray(values, np.float64)
            first, port = self.find(name, "input"), self.fmu.ports[name]
            if column.shape != (ticks, *port.shape):
                raise ConfigurationError(
                    f"{name}: must have the shape {(ticks, *port.shape)}, got {column.shape}"
                )
            columns.append(column.reshape(ticks, port.size))
            places.append(np.arange(first, first + port.size, dtype=np.int32))
        return np.ascontiguousarray(np.hstack(columns)), np.concatenate(places)

    def values(self, given: Mapping[str, ArrayLike]) -> tuple[int, Floats]:
        """Number of runs, and initial parameters and inputs, (groups, elements, lanes)."""
        start, low, high = values_of(self.fmu.ports, self.engine.contents)
        tables: dict[int, tuple[str, Floats]] = {}
        for name, values in given.items():
            first, size = self.find(name, "parameter"), self.fmu.ports[name].size
            table = np.asarray(values, np.float64)
            if table.ndim == 0 or table.size != len(table) * size:
                raise ConfigurationError(f"{name}: must have {size} values per run")
            tables[first] = (name, table.reshape(len(table), size))
        counts = {len(table) for _, table in tables.values()} - {1}
        if len(counts) > 1:
            raise ConfigurationError(f"parameters: must have as many runs, got {sorted(counts)}")
        runs = counts.pop() if counts else 1
        rows = np.repeat(start[None], runs, axis=0)
        for first, (name, table) in tables.items():
            place = slice(first, first + table.shape[1])
            if not (np.isfinite(table) & (low[place] <= table) & (table <= high[place])).all():
                raise ConfigurationError(
                    f"{name}: must be between {low[place].min():g} and {high[place].max():g} in "
                    f"every run, got {table.min():g} to {table.max():g}"
                )
            rows[:, place] = table
        groups = math.ceil(runs / self.lanes)
        padded = rows[np.minimum(np.arange(groups * self.lanes), runs - 1)]
        return runs, np.ascontiguousarray(
            padded.reshape(groups, self.lanes, -1).transpose(0, 2, 1)
        )

    def run(self, plan: Replay, values: Floats, record: Floats, ticks: int) -> None:
        """Run a group, and record it."""
        driver = c_libraries.load(DRIVER)
        start = driver[f"sblcosim_replay_start_{self.lanes}"]
        go_on = driver[f"sblcosim_replay_ticks_{self.lanes}"]
        start.restype = go_on.restype = ctypes.c_int64
        memory = np.zeros(self.engine.contents.block_size + 64, np.uint8)
        block = ctypes.c_void_p(memory.ctypes.data + -memory.ctypes.data % 64)
        status = start(ctypes.byref(plan), block, ctypes.c_void_p(values.ctypes.data))
        if status:
            at = max((f for f in self.first.items() if f[1] < status), key=lambda f: f[1])[0]
            raise FmuError(f"{at}: must be the same in all runs side by side")
        done = 0
        for first in range(0, ticks, _TOGETHER):
            stopping.check()
            done = go_on(
                ctypes.byref(plan), block, ctypes.c_int64(first),
                ctypes.c_int64(min(first + _TOGETHER, ticks)), ctypes.c_int64(done),
                ctypes.c_void_p(record.ctypes.data),
            )

    def shaped(self, name: str, flat: Floats) -> NDArray[Any]:
        """Values of an output in its shape and type."""
        port = self.fmu.ports[name]
        values = flat.reshape(*flat.shape[:2], *port.shape)
        if port.type == "Float64":
            return np.ascontiguousarray(values)
        return values.astype(np.bool_ if port.type == "Boolean" else np.int32)
