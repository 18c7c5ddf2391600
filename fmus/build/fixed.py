"""A model with the parameters of one scenario: what it never does, and never reads, is left out."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial

import casadi as ca
import numpy as np
from sblcosim.models.equations import Model

from .folding import MOST, Few, Folded
from .generator import Fixed, rows_of, state_indices
from .straight_line import Array, constant, evaluated


def fixed(model: Model, parameters: Mapping[str, Sequence[float]]) -> Fixed:
    """The model with known parameters; its C gives the bits of the C with all options.

    Parameters
    ----------
    parameters
        Values of parameters by name; all others have their start values.

    Raises
    ------
    ValueError
        The model has several variants, noise, or rows of parameters.
    """
    functions, *others = model.variants.values()
    if others or model.draws or functions.rows:
        raise ValueError(f"{model.component.name}: must be without variants, noise and rows")
    numbers = [
        float(value) for variable in model.component.of("parameter")
        for value in np.ravel(parameters.get(variable.name, variable.starts))
    ]
    whole = Fixed(**{it.name: getattr(model, it.name) for it in fields(Model)}, parameters=numbers)
    while True:
        found, parts = _with_constants(whole)
        rows, apart = _rows_read(found, _read(parts))
        if (rows, apart) == (found.rows, found.apart):
            return replace(found, unread=_unread(found, parts))
        whole = replace(whole, rows=rows, apart=apart)


def _with_constants(whole: Fixed) -> tuple[Fixed, list[_Part]]:
    """The model without idle loops, and with what states can be that have few values; its parts.

    Each state that starts from a number is taken for that, until something gives it another value.
    """
    few = {state: values for state, values in _start(whole).stored() if values}
    while True:
        found = _without_idle(replace(whole, few=few))
        more: dict[int, Few] = dict(few)
        parts = list(_parts(found))
        for part in parts:
            for state, values in part.stored():
                if more.get(state):  # once it can be anything, it stays so
                    more[state] = more[state] | values if values else frozenset()
        several = _in_several_rows(found)
        more = {
            state: values for state, values in more.items()
            if values and len(values) <= MOST and state not in several
        }
        if more == few:
            return found, parts
        few = more


@dataclass(frozen=True)
class _Part:
    """One function of a model.

    Attributes
    ----------
    values
        Its values; the argument for a state has the text ``s[STATE]``.
    stores
        States that it may change, and the values that they get.
    roots
        Values that matter in any case.
    """

    values: Folded
    stores: Sequence[tuple[int, str]]
    roots: Sequence[str]

    def stored(self) -> Iterator[tuple[int, Few]]:
        """The states that it may change, and all that they can become; empty: not known."""
        for state, value in self.stores:
            if self.values.texts[value] != f"s[{state}]":
                yield state, self.values.possible(value)

    def reads(self, values: Sequence[str]) -> set[int]:
        """The states that values follow from."""
        found: set[str] = set()
        waiting = list(values)
        while waiting:
            value = waiting.pop()
            if value not in found:
                found.add(value)
                waiting += self.values.operands[value]
        texts = (re.fullmatch(r"s\[(\d+)\]", self.values.texts[value]) for value in found)
        return {int(match[1]) for match in texts if match}


def _s(model: Fixed) -> list[str]:
    """The states as arguments."""
    n = sum(rows * columns for rows, columns in model.states.values())
    numbers = model.constants
    return [constant(numbers[i]) if i in numbers else f"s[{i}]" for i in range(n)]


def _part(
    model: Fixed, function: ca.Function, arguments: Sequence[Array],
    states: Sequence[int] | None = None,
) -> _Part:
    """A function that changes states, or whose results matter in any case."""
    few = {f"s[{state}]": values for state, values in model.few.items()}
    values, results = evaluated(function, arguments, partial(Folded, few))
    assert isinstance(values, Folded)
    if states is None:
        return _Part(values, (), tuple(results.values()))
    return _Part(values, [(states[i], value) for i, value in results.items()], ())


def _start(model: Fixed) -> _Part:
    """What a model starts from."""
    functions, = model.variants.values()
    return _part(model, functions.initial, [_numbers(model), "w", ["t"]], range(len(_s(model))))


def _parts(model: Fixed) -> Iterator[_Part]:
    """All functions of a model but its start."""
    functions, = model.variants.values()
    s, p = _s(model), _numbers(model)
    yield _part(model, functions.tick, [s, "u", p, "w", ["t"], ["k"]], range(len(s)))
    yield _part(model, functions.output, [s, "u", p, ["t"]])
    for loop in (*model.advance, *model.iterate):
        rows = [_row(model, loop, row) for row in range(model.rows.get(loop, 1))]
        if len(model.together(loop)) > 1:  # their code is for any row, and reads what one may
            states, (own, _) = rows[0]
            rows.append((states, [own, ["row"]]))
        for places, more in rows:
            yield _part(model, functions.guards[loop], [s, "u", p, ["t"], *more])
            arguments = [s, "u", p, "w", ["t"], *more]
            yield _part(model, functions.bodies[loop], arguments, [*range(len(s)), *places])


def _numbers(model: Fixed) -> list[str]:
    return [constant(number) for number in model.parameters]


def _row(model: Fixed, loop: str, row: int) -> tuple[list[int], list[Array]]:
    """States in a row that a loop goes through, and the arguments for the row and its number."""
    if loop not in model.each:
        return [], []
    states = [
        first + row * columns + i for first, _, columns in model.places(loop)
        for i in range(columns)
    ]
    s = _s(model)
    return states, [[s[i] for i in states], [constant(float(row))]]


def _without_idle(model: Fixed) -> Fixed:
    """Without loops whose guards never hold, and with only the rows for which they ever do."""
    loops = (*model.advance, *model.iterate)
    rows = {
        loop: 1 + max(
            (row for row in range(rows_of(model, loop)) if _holds(model, loop, row)), default=-1
        )
        for loop in model.each
    }
    idle = {
        loop for loop in loops
        if (not rows[loop] if loop in model.each else not _holds(model, loop))
    }
    inner = {loop: _inside(model, loop) for loop in loops}
    idle |= {it for loop in idle for it in inner[loop]}  # which never run either
    return replace(
        model,
        advance=tuple(loop for loop in model.advance if loop not in idle),
        iterate=tuple(loop for loop in model.iterate if loop not in idle),
        inner={loop: sum(it not in idle for it in inside) for loop, inside in inner.items()},
        each={loop: states for loop, states in model.each.items() if loop not in idle},
        rows={loop: count for loop, count in rows.items() if loop not in idle},
    )


def _inside(model: Model, loop: str) -> Sequence[str]:
    """The loops inside a loop, which follow it."""
    loops = (*model.advance, *model.iterate)
    after = loops.index(loop) + 1
    return loops[after : after + model.inner[loop]]


def _holds(model: Fixed, loop: str, row: int = 0) -> bool:
    """Whether the guard of a loop, or of one of its rows, can hold."""
    functions, = model.variants.values()
    arguments = [_s(model), "u", _numbers(model), ["t"], *_row(model, loop, row)[1]]
    part = _part(model, functions.guards[loop], arguments)
    return any(it not in part.values.nothing and part.values.known.get(it) != 0
               for it in part.roots)


def _in_several_rows(model: Fixed) -> set[int]:
    """States in rows of loops that share their code: these stay one after another."""
    return {
        state for loop in model.each if len(model.together(loop)) > 1
        for row in model.together(loop) for state in _row(model, loop, row)[0]
    }


def _rows_read(
    model: Fixed, read: Collection[int]
) -> tuple[dict[str, int], dict[str, tuple[int, ...]]]:
    """Number of rows of each loop up to the last one that something depends on, and those from the
    first on of which something depends on other states than of row 0."""
    rows, apart = {}, {}
    for loop in model.each:
        used = [[state in read for state in _row(model, loop, row)[0]]
                for row in range(model.rows[loop])]
        rows[loop] = 1 + max((row for row, it in enumerate(used) if any(it)), default=-1)
        alike = next((row for row, it in enumerate(used) if it != used[0]), rows[loop])
        apart[loop] = tuple(range(alike, rows[loop]))
    return rows, apart


def _unread(model: Fixed, parts: Sequence[_Part]) -> frozenset[int]:
    """States that have no place: those without a use, and those that are constant."""
    outputs = sum(v.size for v in model.component.of("output"))
    placed = _read(parts, _in_several_rows(model))  # which are written, whether used or not
    places = enumerate(state_indices(model))
    return frozenset(state for state, at in places if at >= outputs and state not in placed)


def _read(parts: Sequence[_Part], more: Collection[int] = ()) -> set[int]:
    """States that outputs, guards or ``more`` states depend on, with these."""
    read = set(more).union(*(part.reads(part.roots) for part in parts))
    makers: dict[int, list[tuple[_Part, str]]] = {}
    for part in parts:
        for state, value in part.stores:
            makers.setdefault(state, []).append((part, value))
    waiting = list(read)
    while waiting:
        state = waiting.pop()
        for part, value in makers.get(state, ()):
            # A state that is chosen anew under a condition does not read what it was.
            condition, new = part.values.change(f"s[{state}]", value)
            found = part.reads([it for it in (condition, new) if it]) - read
            read |= found
            waiting += found
    return read
