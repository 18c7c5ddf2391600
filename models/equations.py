"""Turn a component's equations into CasADi functions.

Equations are plain functions of symbols without branches (they use ``if_else``), so that the
generated C runs one simulation or several side by side. Their arguments:

========  =====================================================================================
``p``     parameters, one attribute per declared variable, in its shape (arrays as matrices), and
          the constants of the build, as numbers
``x``     state, one attribute per key of what ``initial`` returns
``u``     inputs, like ``p``
``w``     noise for this occasion, one attribute per `Draw`, and one per `Row`
``t``     time [s]
``k``     number of the tick; 1 is the first tick after the start
========  =====================================================================================

Each function returns a dict. ``tick`` and loop bodies return only the states that they change.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import casadi as ca

from .declaration import Component
from .draws import Draw as Draw
from .parts import check_parts
from .symbols import Symbols as Symbols
from .symbols import Values as Values


@dataclass(frozen=True, slots=True)
class Row:
    """One row of an array of parameters, looked up by number.

    Choosing among all rows with ``if_else`` would generate code for every row, and be slow.

    Attributes
    ----------
    name
        Attribute of ``w`` (a column).
    array
        Name of the parameter.
    index
        ``index(p, x)``: number of the row, from 0; numbers outside the array are clipped. At the
        start, ``x`` is missing.
    """

    name: str
    array: str
    index: Callable[[Symbols, Symbols], Any]

    def __post_init__(self) -> None:
        check_parts(self)


@dataclass(frozen=True, slots=True)
class Loop:
    """A body that repeats while its guard holds: any number of times in a step, or never.

    Attributes
    ----------
    guard
        ``guard(p, x, u, t)``: nonzero while the body must run again.
    body
        ``body(p, x, u, w, t)``: the changed states after one pass.
    inner
        Loops that run after each pass.
    rows
        Rows of parameters that the body reads.
    each
        States with a row for each of several alternatives, such as the filters of a bank. The loop
        then runs its body once for each row for which the guard holds, in order, instead of
        repeating it. In ``x`` these states are that row, as a column; ``x.every`` has all rows, and
        ``x.row`` is the row's number, from 0. Such a loop has no inner loops and no noise.
    """

    name: str
    guard: Callable[[Symbols, Symbols, Symbols, Any], Any]
    body: Callable[[Symbols, Symbols, Symbols, Symbols, Any], Values]
    inner: Sequence[Loop] = ()
    rows: Sequence[Row] = ()
    each: Sequence[str] = ()

    def __post_init__(self) -> None:
        check_parts(self)


@dataclass(frozen=True, slots=True)
class Equations:
    """The equations of a component, or of one of its variants.

    Attributes
    ----------
    initial
        ``initial(p, w, t)``: all states at the start time.
    tick
        ``tick(p, x, u, w, t, k)``: states changed at tick ``k`` (``k >= 1``), which happens at
        ``t``.
    output
        ``output(p, x, u, t)``: all outputs at ``t``. Inputs used here have direct feedthrough and
        are declared accordingly.
    advance
        Loops that run before anything else at ``t`` (such as a leg that has ended). They must not
        use inputs.
    iterate
        Loops that run after each tick (pending measurements, iterations to convergence).
    draws
        All noise of all variants of the component. The order decides which random numbers each
        gets.
    rows
        Rows of parameters that ``initial`` reads.
    """

    output: Callable[[Symbols, Symbols, Symbols, Any], Values]
    initial: Callable[[Symbols, Symbols, Any], Values] = lambda p, w, t: {}
    tick: Callable[[Symbols, Symbols, Symbols, Symbols, Any, Any], Values] = (
        lambda p, x, u, w, t, k: {}
    )
    advance: Sequence[Loop] = ()
    iterate: Sequence[Loop] = ()
    draws: Sequence[Draw] = ()
    rows: Sequence[Row] = ()

    def __post_init__(self) -> None:
        check_parts(self)


@dataclass(frozen=True, slots=True)
class Rows:
    """The rows that a function reads.

    Attributes
    ----------
    index
        ``index(x, p)``: their numbers; at the start ``index(p)``.
    places
        For each row: first element of its array in ``p``, number of rows of the array, and their
        length.
    """

    index: ca.Function
    places: Sequence[tuple[int, int, int]]

    def read(self, *arguments: Any) -> list[float]:
        """All elements, to be appended to the arguments of `index`, the last of which is ``p``."""
        numbers = self.index(*arguments).full().ravel()
        found: list[float] = []
        for number, (first, count, width) in zip(numbers, self.places, strict=True):
            start = first + width * (min(int(number), count - 1) if number > 0 else 0)
            found += [float(value) for value in arguments[-1][start : start + width]]
        return found


@dataclass(frozen=True, slots=True)
class Functions:
    """CasADi functions of one variant; all arguments and results are dense columns.

    ``initial(p, w, t) -> x``, ``tick(x, u, p, w, t, k) -> x``, ``output(x, u, p, t) -> y``,
    ``guards[name](x, u, p, t) -> c``, ``bodies[name](x, u, p, w, t) -> x``; ``jacobian(x, u, p, t)
    -> dy/du`` (row by row) where there is direct feedthrough. Functions that read rows take the
    elements of these as last arguments; ``rows`` lists them by loop, or as ``initial``. Functions
    of a loop over ``each`` row of some states take the row and its number as last arguments; the
    body's result is the other states, and after them the row.
    """

    initial: ca.Function
    tick: ca.Function
    output: ca.Function
    guards: Mapping[str, ca.Function]
    bodies: Mapping[str, ca.Function]
    jacobian: ca.Function | None
    rows: Mapping[str, Rows] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Model:
    """A component, ready for code generation.

    Attributes
    ----------
    variants
        Functions by value of the component's variant parameter; ``{0: …}`` without variants.
    states
        Shape of each state by name, in the order of the state vector (row by row).
    advance, iterate
        Names of the loops, each followed by its inner loops.
    feedthrough
        Declared names (output, input) with direct feedthrough.
    inner
        Number of inner loops of each loop, by name.
    each
        States of which a loop sees a row at a time, by the name of the loop.
    readme
        Its documentation in Markdown, if the component is not one of ours.
    """

    component: Component
    variants: Mapping[int, Functions]
    states: Mapping[str, tuple[int, int]]
    draws: Sequence[Draw]
    advance: Sequence[str]
    iterate: Sequence[str]
    feedthrough: frozenset[tuple[str, str]] = field(default_factory=frozenset)
    inner: Mapping[str, int] = field(default_factory=dict)
    each: Mapping[str, Sequence[str]] = field(default_factory=dict)
    readme: str | None = None

    def places(self, loop: str) -> list[tuple[int, int, int]]:
        """For each state of which a loop sees a row: its first element, and its shape."""
        at, places = 0, {}
        for name, (rows, columns) in self.states.items():
            places[name] = (at, rows, columns)
            at += rows * columns
        return [places[name] for name in self.each.get(loop, ())]


def build(component: Component, equations: Equations | Mapping[int, Equations]) -> Model:
    """Turn equations into CasADi functions.

    Parameters
    ----------
    equations
        One set, or one per value of the component's variant parameter. All sets must have the same
        states, draws and loop names.
    """
    variants = equations if isinstance(equations, Mapping) else {0: equations}
    first = next(iter(variants.values()))
    functions: dict[int, Functions] = {}
    states: Mapping[str, tuple[int, int]] = {}
    feedthrough: set[tuple[str, str]] = set()
    for value, variant in variants.items():
        functions[value], states, pairs = _functions(component, variant)
        feedthrough |= pairs
    # A build may never run a loop, such as that of a track without points.
    runs = {loop for it in functions.values() for loop, guard in it.guards.items()
            if not guard.call(guard.sx_in())[0].is_zero()}
    return Model(
        component=component,
        variants=functions,
        states=states,
        draws=tuple(draw.of(component) for draw in first.draws),
        advance=tuple(loop.name for loop in _all(first.advance) if loop.name in runs),
        iterate=tuple(loop.name for loop in _all(first.iterate) if loop.name in runs),
        inner={
            loop.name: len(_all(loop.inner)) for loop in _all((*first.advance, *first.iterate))
        },
        each={
            loop.name: tuple(loop.each)
            for loop in _all((*first.advance, *first.iterate)) if loop.each
        },
        feedthrough=frozenset(feedthrough),
    )


def _all(loops: Sequence[Loop]) -> list[Loop]:
    """Loops, each followed by its inner loops."""
    return [each for loop in loops for each in (loop, *_all(loop.inner))]


def _functions(
    component: Component, equations: Equations
) -> tuple[Functions, Mapping[str, tuple[int, int]], set[tuple[str, str]]]:
    p, p_vector = _symbols({v.name: _matrix_shape(v.shape) for v in component.of("parameter")})
    p.__dict__.update({name: int(value) for name, value in component.constants.items()})
    u, u_vector = _symbols({v.name: _matrix_shape(v.shape) for v in component.of("input")})
    t, k = ca.SX.sym("t"), ca.SX.sym("k")

    draws = [draw.of(component) for draw in equations.draws]
    read: dict[str, Rows] = {}

    def noise(occasion: str) -> tuple[Symbols, Any]:
        return _symbols({d.name: (d.size, 1) for d in draws if d.occasion == occasion})

    w, w_vector = noise("initial")
    rows, more = _looked_up(component, equations.rows, w, (p, None), [p_vector])
    read |= {} if rows is None else {"initial": rows}
    start = {name: ca.densify(ca.SX(value)) for name, value in equations.initial(p, w, t).items()}
    states = {name: value.shape for name, value in start.items()}
    begin = _column(start.values())
    if rows is not None and not ca.depends_on(begin, more[0]):
        read, more = {}, []  # this build does not use them
    initial = _function("initial", [p_vector, w_vector, t, *more], begin)

    x, x_vector = _symbols(states)

    def updated(changes: Values) -> Any:
        unknown = set(changes) - set(states)
        if unknown:
            raise ValueError(f"{component.name}: not a state: {', '.join(sorted(unknown))}")
        return _column(
            _shaped(changes[name], shape, name) if name in changes else getattr(x, name)
            for name, shape in states.items()
        )

    w, w_vector = noise("tick")
    changed = updated(equations.tick(p, x, u, w, t, k))
    tick = _function("tick", [x_vector, u_vector, p_vector, w_vector, t, k], changed)
    guards, bodies = {}, {}
    for loop in _all((*equations.advance, *equations.iterate)):
        if loop.each:
            given = (loop, states, x, [x_vector, u_vector, p_vector], (p, u, t))
            guards[loop.name], bodies[loop.name] = _of_each(*given)
            continue
        guards[loop.name], bodies[loop.name], rows = _of_loop(
            component, loop, noise(loop.name), updated, (p, x, u, t), [x_vector, u_vector, p_vector]
        )
        read |= {} if rows is None else {loop.name: rows}
    arguments = [x_vector, u_vector, p_vector, t]
    output, y_vector = _output(component, equations.output(p, x, u, t), arguments)
    pairs = _feedthrough(component, output)
    jacobian = None
    if pairs:
        slopes = ca.vec(ca.densify(ca.jacobian(y_vector, u_vector)).T)
        jacobian = _function("jacobian", [x_vector, u_vector, p_vector, t], slopes)
    return Functions(initial, tick, output, guards, bodies, jacobian, read), states, pairs


def _of_loop(
    component: Component, loop: Loop, noise: tuple[Symbols, Any],
    updated: Callable[[Values], Any], symbols: tuple[Symbols, Symbols, Symbols, Any],
    vectors: list[Any],
) -> tuple[ca.Function, ca.Function, Rows | None]:
    """Guard and body of a loop that repeats, and the rows that it reads."""
    (p, x, u, t), (w, w_vector) = symbols, noise
    guard = ca.SX(loop.guard(p, x, u, t))
    runs = not guard.is_zero()
    rows, more = _looked_up(
        component, loop.rows if runs else (), w, (p, x), [vectors[0], vectors[-1]]
    )
    changed = updated(loop.body(p, x, u, w, t) if runs else {})
    body = _function("body", [*vectors, w_vector, t, *more], changed)
    return _function("guard", [*vectors, t], guard), body, rows


def _of_each(
    loop: Loop, states: Mapping[str, tuple[int, int]], x: Symbols, vectors: list[Any],
    symbols: tuple[Symbols, Symbols, Any],
) -> tuple[ca.Function, ca.Function]:
    """Guard and body of a loop over each row of some states."""
    if loop.inner or loop.rows:
        raise ValueError(f"{loop.name}: must have no inner loops and no rows of parameters")
    p, u, t = symbols
    row, row_vector = _symbols({name: (states[name][1], 1) for name in loop.each})
    number, w = ca.SX.sym("row"), ca.SX(0, 1)
    every = SimpleNamespace(**{name: getattr(x, name) for name in loop.each})
    seen = SimpleNamespace(**{**x.__dict__, **row.__dict__, "every": every, "row": number})
    changes = loop.body(p, seen, u, SimpleNamespace(), t)
    unknown = set(changes) - set(states)
    if unknown:
        raise ValueError(f"{loop.name}: not a state: {', '.join(sorted(unknown))}")
    others = _column(
        _shaped(changes[name], shape, name)
        if name in changes and name not in loop.each else getattr(x, name)
        for name, shape in states.items()
    )
    own = _column(
        _shaped(changes.get(name, getattr(row, name)), (states[name][1], 1), name)
        for name in loop.each
    )
    guard = _function("guard", [*vectors, t, row_vector, number],
                      ca.SX(loop.guard(p, seen, u, t)))
    body = _function("body", [*vectors, w, t, row_vector, number], ca.vertcat(others, own))
    return guard, body


def _output(
    component: Component, results: Values, arguments: list[Any]
) -> tuple[ca.Function, Any]:
    """The function that computes the outputs, and their expressions."""
    missing = {v.name for v in component.of("output")} ^ set(results)
    if missing:
        raise ValueError(f"{component.name}: outputs do not match: {', '.join(sorted(missing))}")
    y_vector = _column(
        _shaped(results[v.name], _matrix_shape(v.shape), v.name) for v in component.of("output")
    )
    return _function("output", arguments, y_vector), y_vector


def _looked_up(
    component: Component, rows: Sequence[Row], w: Symbols, symbols: tuple[Symbols, Symbols],
    arguments: list[Any],
) -> tuple[Rows | None, list[Any]]:
    """Make rows attributes of ``w``; returns the rows and the added arguments."""
    if not rows:
        return None, []
    places = [_place(component, row.array) for row in rows]
    index = _function("index", arguments, ca.vertcat(*(row.index(*symbols) for row in rows)))
    widths = {row.name: (place[2], 1) for row, place in zip(rows, places, strict=True)}
    elements, vector = _symbols(widths)
    w.__dict__.update(elements.__dict__)
    return Rows(index, places), [vector]


def _place(component: Component, name: str) -> tuple[int, int, int]:
    """First element of an array in ``p``, number of its rows, and their length."""
    first = 0
    for variable in component.of("parameter"):
        if variable.name == name:
            rows, width = _matrix_shape(variable.shape)
            return first, int(rows), int(width)
        first += variable.size
    raise ValueError(f"{component.name}: not a parameter: {name}")


def _feedthrough(component: Component, output: ca.Function) -> set[tuple[str, str]]:
    sparsity = output.jac_sparsity(0, 1)
    rows = [v.name for v in component.of("output") for _ in range(v.size)]
    columns = [v.name for v in component.of("input") for _ in range(v.size)]
    return {(rows[i], columns[j]) for i, j in zip(*sparsity.get_triplet(), strict=True)}


def _function(name: str, arguments: list[Any], result: Any) -> ca.Function:
    (result,) = ca.cse([ca.densify(result)])
    return ca.Function(name, arguments, [result])


def _matrix_shape(shape: tuple[int, ...]) -> tuple[int, int]:
    rows, columns = (*shape, 1, 1)[:2]
    return rows, columns


def _symbols(shapes: Mapping[str, tuple[int, int]]) -> tuple[SimpleNamespace, Any]:
    """Symbols by name, and one column of all their elements, matrices row by row."""
    symbols = {name: ca.SX.sym(name, *shape) for name, shape in shapes.items()}
    return SimpleNamespace(**symbols), _column(symbols.values())


def _column(matrices: Any) -> Any:
    parts = [ca.vec(ca.densify(ca.SX(m)).T) for m in matrices]
    return ca.vertcat(*parts) if parts else ca.SX(0, 1)


def _shaped(value: Any, shape: tuple[int, int], name: str) -> Any:
    matrix = ca.SX(value)
    if matrix.shape != shape:
        raise ValueError(f"{name}: shape must be {shape}, got {matrix.shape}")
    return matrix
