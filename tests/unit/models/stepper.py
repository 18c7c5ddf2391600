"""A plain Python interpreter of a component's equations, as an oracle for everything compiled.

It follows the time contract literally: a tick at ``t_k`` with ``t <= t_k < t + h`` happens in
``step(t, h)`` with the inputs set before; outputs read afterwards are those of ``t + h``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray
from sblcosim.models.declaration import Variable
from sblcosim.models.equations import Draw, Model
from sblcosim.models.loading import load

Array = NDArray[np.float64]
Noise = Callable[[Draw, int], ArrayLike]
"""``noise(draw, count)``: the numbers of a draw on its occasion number ``count`` (0, 1, …; a tick's
own number ``k`` for ticks)."""

MOST_TURNS = 10_000_000


def numpy_noise(seed: int) -> Noise:
    """Noise from NumPy, one independent sequence per draw."""
    generators: dict[tuple[str, str], np.random.Generator] = {}

    def noise(draw: Draw, count: int) -> Array:
        key = (draw.occasion, draw.name)
        if key not in generators:
            generators[key] = np.random.default_rng([seed, *"/".join(key).encode()])
        if draw.kind == "normal":
            return generators[key].standard_normal(draw.size)
        return generators[key].integers(2**53, size=draw.size).astype(float)

    return noise


def no_noise(draw: Draw, count: int) -> Array:
    """Zero for every normal; one half for every uniform number."""
    return np.full(draw.size, 0.0 if draw.kind == "normal" else 2.0**52)


class Stepper:
    """One instance of a component.

    Parameters
    ----------
    model
        A model, or the name of a component.
    parameters
        Values by the name of the variable, in SI units; the rest have their declared starts.
    noise
        Where random numbers come from; NumPy with `seed` by default.
    start_ns
        Start time in ns.

    Attributes
    ----------
    p, u, y
        Parameters, inputs and outputs by name: floats, or arrays of the declared shape.
    x
        The state vector.
    """

    def __init__(
        self,
        model: Model | str,
        parameters: Mapping[str, Any] | None = None,
        *,
        noise: Noise | None = None,
        seed: int = 1,
        start_ns: int = 0,
    ) -> None:
        self.model = load(model) if isinstance(model, str) else model
        component = self.model.component
        self.p = _values(component.of("parameter"), parameters or {})
        self.u = _values(component.of("input"), {})
        variant = int(self.p[component.variant]) if component.variant else 0
        self.functions = self.model.variants[variant]
        self.noise = noise or numpy_noise(seed)
        self.interval_ns = round(self.p[component.interval] * 1e9) if component.interval else None
        self.start_ns = self.t_ns = start_ns
        self.k = 0
        self._calls: dict[int, Callable[..., Array]] = {}
        self.counts = dict.fromkeys((*self.model.advance, *self.model.iterate), 0)
        self._p = _flat(self.p)
        self._u = _flat(self.u)
        self.x = self._call(self.functions.initial, self._p, self._draw("initial", 0),
                            start_ns / 1e9, *self._rows("initial", self._p))
        self._advance(start_ns)
        self._output(start_ns)

    def state(self, name: str) -> Any:
        """One state, as a float or an array."""
        at = 0
        for other, (rows, columns) in self.model.states.items():
            if other == name:
                return _unflat(self.x[at:at + rows * columns],
                               (rows, columns) if columns > 1 else (rows,) if rows > 1 else ())
            at += rows * columns
        raise KeyError(name)

    def set(self, **inputs: ArrayLike) -> None:
        """Set inputs; they hold until set again."""
        self.u = _values(self.model.component.of("input"), {**self.u, **inputs})
        self._u = _flat(self.u)

    def step(self, t_ns: int, h_ns: int) -> Mapping[str, Any]:
        """Go from `t_ns` to ``t_ns + h_ns`` and return the outputs there."""
        assert t_ns == self.t_ns, "steps must follow one another"
        end_ns = t_ns + h_ns
        while self.interval_ns:
            tick = self.start_ns + (self.k + 1) * self.interval_ns
            if tick >= end_ns:
                break
            self.k += 1
            self._advance(tick)
            self.x = self._call(self.functions.tick, self.x, self._u, self._p,
                                self._draw("tick", self.k), tick / 1e9, self.k)
            self._repeat(self.model.iterate, tick)
        self._advance(end_ns)
        self.t_ns = end_ns
        return self._output(end_ns)

    def run(self, stop_ns: int, h_ns: int) -> dict[str, Array]:
        """Step until `stop_ns` and return ``t`` in s and all outputs, a row per instant."""
        rows = [self.y]
        times = [self.t_ns]
        while self.t_ns + h_ns <= stop_ns:
            rows.append(self.step(self.t_ns, h_ns))
            times.append(self.t_ns)
        record = {name: np.array([row[name] for row in rows]) for name in self.y}
        return {"t": np.array(times) / 1e9, **record}

    def _advance(self, t_ns: int) -> None:
        self._repeat(self.model.advance, t_ns)

    def _repeat(self, loops: Any, t_ns: int) -> None:
        t = t_ns / 1e9
        outermost = 0
        for i, loop in enumerate(loops):
            if i < outermost:
                continue
            outermost = i + 1 + self.model.inner.get(loop, 0)
            if loop in self.model.each:
                self._each(loop, t)
                continue
            turns = 0
            while self._call(self.functions.guards[loop], self.x, self._u, self._p, t)[0]:
                self.x = self._call(self.functions.bodies[loop], self.x, self._u, self._p,
                                    self._draw(loop, self.counts[loop]), t,
                                    *self._rows(loop, self.x, self._p))
                self.counts[loop] += 1
                self._repeat(loops[i + 1:outermost], t_ns)
                turns += 1
                assert turns < MOST_TURNS, f"loop {loop} does not end"

    def _each(self, loop: str, t: float) -> None:
        """A loop over each row of some states."""
        places = self.model.places(loop)
        for n in range(places[0][1]):
            own = np.concatenate([
                np.arange(first + n * width, first + (n + 1) * width) for first, _, width in places
            ])
            row = self.x[own]
            if self._call(self.functions.guards[loop], self.x, self._u, self._p, t, row, n)[0]:
                result = self._call(self.functions.bodies[loop], self.x, self._u, self._p, [], t,
                                    row, n)
                self.x = result[: len(self.x)]
                self.x[own] = result[len(self.x):]

    def results(self, x: Array) -> dict[str, Array]:
        """What each function gives in another state, at the time and with the inputs of now."""
        t, given = self.t_ns / 1e9, (self._u, self._p)
        f = self.functions
        found = {
            "tick": self._call(f.tick, x, *given, self._draw("tick", 0), t, 1),
            "output": self._call(f.output, x, *given, t),
        }
        for loop in (*self.model.advance, *self.model.iterate):
            more: list[Any] = []
            if loop in self.model.each:
                more = [np.concatenate([x[at : at + width]
                                        for at, _, width in self.model.places(loop)]), 0]
            found[f"{loop}?"] = self._call(f.guards[loop], x, *given, t, *more)
            found[loop] = self._call(
                f.bodies[loop], x, *given, self._draw(loop, 0), t, *self._rows(loop, x, self._p),
                *more,
            )
        return found

    def _rows(self, occasion: str, *arguments: Array) -> list[list[float]]:
        """The rows of parameters that a function reads, if there are any."""
        rows = self.functions.rows.get(occasion)
        return [] if rows is None else [rows.read(*arguments)]

    def _draw(self, occasion: str, count: int) -> Array:
        draws = [np.asarray(self.noise(d, count), dtype=float).reshape(d.size)
                 for d in self.model.draws if d.occasion == occasion]
        return np.concatenate(draws) if draws else np.zeros(0)

    def _output(self, t_ns: int) -> Mapping[str, Any]:
        y = self._call(self.functions.output, self.x, self._u, self._p, t_ns / 1e9)
        at = 0
        self.y: dict[str, Any] = {}
        for v in self.model.component.of("output"):
            self.y[v.name] = _unflat(y[at:at + v.size], v.shape)
            at += v.size
        return self.y

    def _call(self, function: ca.Function, *arguments: ArrayLike) -> Array:
        if id(function) not in self._calls:
            self._calls[id(function)] = _callable(function)
        return self._calls[id(function)](*arguments)


def _callable(function: ca.Function) -> Callable[..., Array]:
    """A function of flat arrays; ten times as fast as calling the CasADi function itself."""
    sizes = [function.nnz_in(i) for i in range(function.n_in())]
    assert sizes == [function.numel_in(i) for i in range(function.n_in())], "arguments are dense"
    arguments, result = [np.zeros(n) for n in sizes], np.zeros(function.nnz_out(0))
    buffer, trigger = function.buffer()
    for i, argument in enumerate(arguments):
        buffer.set_arg(i, memoryview(argument))
    buffer.set_res(0, memoryview(result))

    def call(*values: ArrayLike) -> Array:
        for argument, value in zip(arguments, values, strict=True):
            argument[:] = value
        trigger()
        return result.copy()

    call.buffer = buffer  # type: ignore[attr-defined]  # must outlive the trigger
    return call


def _values(variables: tuple[Variable, ...], given: Mapping[str, Any]) -> dict[str, Any]:
    unknown = set(given) - {v.name for v in variables}
    if unknown:
        raise KeyError(f"not declared: {', '.join(sorted(unknown))}")
    return {
        v.name: _unflat(np.asarray(given.get(v.name, v.starts), dtype=float).reshape(v.size),
                        v.shape)
        for v in variables
    }


def _flat(values: Mapping[str, Any]) -> Array:
    parts = [np.ravel(value) for value in values.values()]
    return np.concatenate(parts) if parts else np.zeros(0)


def _unflat(values: Array, shape: tuple[int, ...]) -> Any:
    return values.reshape(shape).copy() if shape else float(values[0])
