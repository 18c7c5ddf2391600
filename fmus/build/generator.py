"""From a component's CasADi functions to C: the equations of an engine."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import casadi as ca
from sblcosim.models.equations import Functions, Model

from ..errors import BuildError
from .folding import Few
from .rolling import Rolled
from .straight_line import NOWHERE, Array, Computation, constant, statements
from .tables import draw_blocks, draw_tables, noise_size

_UP = "const real *u, const real *p"
_XUP = f"const real *x, {_UP}"


@dataclass(frozen=True, slots=True)
class Fixed(Model):
    """A model whose parameters are known when it is compiled; `fmus.build.fixed` makes it.

    Attributes
    ----------
    parameters
        Values of the elements of all parameters.
    few
        All values of states that have few.
    unread
        States that nothing reads; they have no place.
    rows
        Number of rows that a loop goes through, by its name, where that is less than it declares.
    apart
        Rows of a loop that have code of their own, as most of their states have no place.
    """

    parameters: Sequence[float] = ()
    few: Mapping[int, Few] = field(default_factory=dict)
    unread: frozenset[int] = frozenset()
    rows: Mapping[str, int] = field(default_factory=dict)
    apart: Mapping[str, Sequence[int]] = field(default_factory=dict)

    @property
    def constants(self) -> dict[int, float]:
        """States that always have the same value, and that value."""
        return {i: float.fromhex(min(few)) for i, few in self.few.items() if len(few) == 1}

    def together(self, loop: str) -> list[int]:
        """Rows of a loop that share their code."""
        return [n for n in range(rows_of(self, loop)) if n not in self.apart.get(loop, ())]


def model_source(model: Model) -> str:
    """The generated part of an engine: sizes, noise and equations of a component, as C."""
    parameters = _parameter_indices(model)
    blocks = [draw_blocks(model.draws, occasion, parameters) for occasion in _occasions(model)]
    n_blocks = max(len(rows) for rows in blocks)
    sizes = (f"#define {name} {value}" for name, value in _sizes(model, n_blocks).items())
    return "\n".join([
        f"/* Equations of {model.component.name}, generated from its CasADi functions. */",
        *sizes,
        '#include "noise.h"',
        "",
        *draw_tables(blocks),
        *_row(model),
        *_equations(model),
        *_loops(model),
        *_jacobian(model),
    ])


def _occasions(model: Model) -> tuple[str, ...]:
    """The occasions of noise, in the order of their numbers."""
    return ("initial", "tick", *model.advance, *model.iterate)


def _parameter_indices(model: Model) -> dict[str, int]:
    """Index in ``p`` of each parameter's first element."""
    indices: dict[str, int] = {}
    following = 0
    for variable in model.component.of("parameter"):
        indices[variable.name] = following
        following += variable.size
    return indices


def _sizes(model: Model, n_blocks: int) -> dict[str, int]:
    """The constants of the engine by name; -1 for a parameter that the component does not have."""
    component = model.component
    fixed = isinstance(model, Fixed)
    indices = {} if fixed else _parameter_indices(model)
    n_outputs = sum(v.size for v in component.of("output"))
    return {
        "COMPONENT_NUMBER": component.number,
        "N_P": 0 if fixed else sum(v.size for v in component.of("parameter")),
        "N_U": sum(v.size for v in component.of("input")),
        "N_Y": n_outputs,
        "N_X": max([n_outputs, *(index + 1 for index in state_indices(model))]),
        "N_W": max(noise_size(model.draws, occasion) for occasion in _occasions(model)),
        "N_BLOCKS": n_blocks,
        "N_ADVANCE": len(model.advance),
        "N_ITERATE": len(model.iterate),
        "HAS_INNER": int(any(model.inner.values())),
        **({"HAS_EACH": 1} if model.each else {}),
        "P_SEED": indices.get("seed", -1),
        "P_STREAM": indices.get("stream", -1),
        "P_INTERVAL": indices.get(component.interval or "", -1),
        "P_VARIANT": indices.get(component.variant or "", -1),
        "HAS_JACOBIAN": int(bool(model.feedthrough)),
    }


def state_indices(model: Model) -> list[int]:
    """Index of each state in ``x``, the array of all outputs and, after them, of the states.

    A state that equals an output in all variants is stored in that output. A state of a `Fixed`
    model that nothing reads has the index -1.
    """
    shown = set.intersection(*map(_shown, (f.output for f in model.variants.values())))
    in_rows = {  # rows of a state must be one after another
        first + i for loop in model.each for first, rows, columns in model.places(loop)
        for i in range(rows * columns)
    }
    indices: dict[int, int] = {}
    for output, state in sorted(shown):
        if state not in in_rows:
            indices.setdefault(state, output)
    n_outputs = sum(v.size for v in model.component.of("output"))
    n_states = sum(rows * columns for rows, columns in model.states.values())
    unread = model.unread if isinstance(model, Fixed) else frozenset()
    hidden = [state for state in range(n_states) if state not in indices and state not in unread]
    indices |= {state: n_outputs + i for i, state in enumerate(hidden)}
    indices |= {state: -1 for state in unread if state not in indices}
    return [indices[state] for state in range(n_states)]


def _constants(output: ca.Function) -> dict[int, float]:
    """Outputs that are constant: they are written at the start and never again."""
    registers: dict[int, float] = {}
    constant = {}
    for i in range(output.n_instructions()):
        operation, outputs = output.instruction_id(i), output.instruction_output(i)
        if operation == ca.OP_OUTPUT:
            source = output.instruction_input(i)[0]
            if source in registers:
                constant[outputs[1]] = registers[source]
            continue
        registers.pop(outputs[0], None)
        if operation == ca.OP_CONST:
            registers[outputs[0]] = float(output.instruction_constant(i))
    return constant


def _shown(output: ca.Function) -> set[tuple[int, int]]:
    """Outputs that equal a state, and that state."""
    registers: dict[int, int] = {}
    shown = set()
    for i in range(output.n_instructions()):
        inputs, outputs = output.instruction_input(i), output.instruction_output(i)
        if output.instruction_id(i) == ca.OP_OUTPUT:
            if inputs[0] in registers:
                shown.add((outputs[1], registers[inputs[0]]))
        else:
            registers.pop(outputs[0], None)
            if output.instruction_id(i) == ca.OP_INPUT and inputs[0] == 0:
                registers[outputs[0]] = inputs[1]
    return shown


_ROW = """\
/* A row of an array of parameters; an index outside it, or none, gives the nearest row. */
static inline void model_row(const real *array, int count, int width, real index, real *row)
{
    for (int lane = 0; lane < LANES; lane++) {
        const double i = r_get(index, lane);
        const int k = !(i > 0.0) ? 0 : i < count - 1 ? (int)i : count - 1;
        for (int j = 0; j < width; j++)
            r_put(&row[j], lane, r_get(array[k * width + j], lane));
    }
}
"""


def _row(model: Model) -> Iterator[str]:
    if any(functions.rows for functions in model.variants.values()):
        yield _ROW


def _looked_up(functions: Functions, occasion: str, arguments: Sequence[Array]) -> list[str]:
    """Statements that look up the rows of a function and store them in ``r``, one after another."""
    rows = functions.rows.get(occasion)
    if rows is None:
        return []
    lines = [f"real i[{len(rows.places)}], r[{sum(width for _, _, width in rows.places)}];",
             "for (unsigned n = 0; n < sizeof r / sizeof *r; n++)", "    r[n] = r_set1(0.0);",
             "{", *(f"    {line}" for line in statements(rows.index, arguments, "i")), "}"]
    at = 0
    for number, (first, count, width) in enumerate(rows.places):
        lines.append(f"model_row(p + {first}, {count}, {width}, i[{number}], r + {at});")
        at += width
    return lines


def _stored(model: Model) -> list[str]:
    """The places of the states in C."""
    return [f"x[{index}]" if index >= 0 else NOWHERE for index in state_indices(model)]


def _x(model: Model) -> list[str]:
    """The states in C, as they are read."""
    x = _stored(model)
    for state, value in (model.constants if isinstance(model, Fixed) else {}).items():
        x[state] = constant(value)
    return x


def _numbers(model: Model) -> Array:
    """The parameters in C."""
    return [constant(value) for value in model.parameters] if isinstance(model, Fixed) else "p"


def _kind(model: Model) -> Callable[[], Computation]:
    """How values of its functions follow from each other."""
    if not isinstance(model, Fixed):
        return Computation
    stored = _stored(model)
    return partial(Rolled, {stored[state]: few for state, few in model.few.items()})


def _equations(model: Model) -> Iterator[str]:
    """Functions of an engine for the start, the ticks and the outputs."""
    x, p, stored = _x(model), _numbers(model), _stored(model)
    y = [f"x[{i}]" for i in range(sum(v.size for v in model.component.of("output")))]
    initial = _printed(model, lambda f: f.initial, [p, "w", ["t"]], stored, "", ("initial", [p]))
    for value, functions in model.variants.items():
        constant = _constants(functions.output)
        initial[value] += [f"{y[i]} = r_set1({number.hex()});" for i, number in constant.items()]
    yield _variants(
        "model_initial(int variant, const real *p, const real *w, real t, real *x)",
        initial,
        ["p", "w", "t", "x"],
    )
    yield _variants(
        "model_tick(int variant, real *x, const real *u, const real *p, const real *w, real t, "
        "real k)",
        _printed(model, lambda f: f.tick, [x, "u", p, "w", ["t"], ["k"]], stored),
        ["x", "u", "p", "w", "t", "k"],
    )
    yield _variants(
        "model_output(int variant, real *x, const real *u, const real *p, real t)",
        {
            value: statements(
                functions.output, [x, "u", p, ["t"]], y, without=_constants(functions.output),
                kind=_kind(model),
            )
            for value, functions in model.variants.items()
        },
        ["x", "u", "p", "t"],
    )


def _loops(model: Model) -> Iterator[str]:
    """Guard and body of each loop, and the functions that select them by number."""
    x, p, stored = _x(model), _numbers(model), _stored(model)
    loops = (*model.advance, *model.iterate)
    for number, loop in enumerate(loops):
        if loop in model.each:
            yield from _of_each(model, loop, number)
            continue
        yield _variants(
            f"guard_{number}(int variant, {_XUP}, real t, real *c)",
            _printed(model, partial(_guard, loop), [x, "u", p, ["t"]], "c"),
            ["x", "u", "p", "t"],
        )
        yield _variants(
            f"body_{number}(int variant, mask going, real *x, const real *u, const real *p, "
            "const real *w, real t)",
            _printed(model, partial(_body, loop), [x, "u", p, "w", ["t"]], stored, "going",
                     (loop, [x, p])),
            ["going", "x", "u", "p", "w", "t"],
        )
    if any(model.inner.values()):
        inner = ", ".join(str(model.inner[loop]) for loop in loops)
        yield (
            "/* Number of loops inside each, which follow it. */\n"
            f"static const int model_inner[] = {{{inner}}};\n"
        )
    if model.each:
        yield from _selected_rows(model, loops)
    numbers = [number for number, loop in enumerate(loops) if loop not in model.each]
    yield procedure(
        f"model_guard(int loop, int variant, {_XUP}, real t, real *c)",
        [
            "switch (loop) {",
            *(f"case {n}: guard_{n}(variant, x, u, p, t, c); break;" for n in numbers),
            "default: *c = r_set1(0.0); break;",
            "}",
        ],
        ["variant", "x", "u", "p", "t"],
    )
    yield procedure(
        "model_body(int loop, int variant, mask going, real *x, const real *u, const real *p, "
        "const real *w, real t)",
        [
            "switch (loop) {",
            *(f"case {n}: body_{n}(variant, going, x, u, p, w, t); break;" for n in numbers),
            "default: break;",
            "}",
        ],
        ["variant", "going", "x", "u", "p", "w", "t"],
    )


_OF_EACH = f"int variant, int row, mask going, real *x, {_UP}, real t"


def _of_each(model: Model, loop: str, at: int) -> Iterator[str]:
    """Guard and body of a loop over each row of some states."""
    guard: list[str] = []
    body: list[str] = []
    for row in model.apart.get(loop, ()) if isinstance(model, Fixed) else ():
        for lines, found in zip((guard, body), _of_row(model, loop, row), strict=True):
            lines += [f"if (row == {row}) {{", *(f"    {line}" for line in found),
                      "    return;", "}"]
    for lines, found in zip((guard, body), _of_row(model, loop, None), strict=True):
        lines += found
    names = ["row", "x", "u", "p", "t"]
    yield procedure(
        f"guard_{at}(int variant, int row, real *x, {_UP}, real t, real *c)", guard,
        ["variant", *names],
    )
    yield procedure(f"body_{at}({_OF_EACH})", body, ["variant", *names, "going"])


def _of_row(model: Model, loop: str, row: int | None) -> tuple[list[str], list[str]]:
    """Guard and body for a row; None: for all rows that share them, with pointers to these."""
    x, p, stored, indices = _x(model), _numbers(model), _stored(model), state_indices(model)
    together = model.together(loop) if isinstance(model, Fixed) else []
    if row is None and len(together) == 1:
        row = together[0]
    own, into, pointers = [], [], []
    for n, (first, _, columns) in enumerate(model.places(loop)):
        if row is None:
            pointers += [f"real *const r{n} = x + {indices[first]} + row * {columns};",
                         f"(void)r{n};"]
            own += [f"r{n}[{i}]" for i in range(columns)]
            into += own[-columns:]
        else:
            start = first + row * columns
            own += x[start : start + columns]
            into += stored[start : start + columns]
    number = ["r_set1((double)row)" if row is None else constant(float(row))]
    more: list[Array] = [own, number]
    (guard,), (body,) = (
        _printed(model, partial(pick, loop), arguments, result, where).values()
        for pick, arguments, result, where in (
            (_guard, [x, "u", p, ["t"], *more], "c", ""),
            (_body, [x, "u", p, "w", ["t"], *more], [*stored, *into], "going"),
        )
    )
    return [*pointers, *guard], [*pointers, *body]


def rows_of(model: Model, loop: str) -> int:
    """Number of rows that a loop goes through; 0: it repeats instead."""
    if loop not in model.each:
        return 0
    fewer = model.rows if isinstance(model, Fixed) else {}
    return fewer.get(loop, model.places(loop)[0][1])


def _selected_rows(model: Model, loops: Sequence[str]) -> Iterator[str]:
    """Functions that select a loop over each row by its number."""
    counts = [rows_of(model, loop) for loop in loops]
    yield (
        "/* Number of rows that a loop goes through; 0: it repeats instead. */\n"
        f"static const int model_rows[] = {{{', '.join(map(str, counts))}}};\n"
    )
    numbers = [number for number, loop in enumerate(loops) if loop in model.each]
    for kind, signature, handed in (
        ("guard", f"int loop, int variant, int row, real *x, {_UP}, real t, real *c",
         "variant, row, x, u, p, t, c"),
        ("body", f"int loop, {_OF_EACH}", "variant, row, going, x, u, p, t"),
    ):
        cases = [f"case {n}: {kind}_{n}({handed}); break;" for n in numbers]
        yield procedure(
            f"model_row_{kind}({signature})",
            ["switch (loop) {", *cases, "default: break;", "}"],
            re.findall(r"\w+", handed),
        )


def _jacobian(model: Model) -> Iterator[str]:
    """Derivatives of the outputs, where they depend directly on inputs."""
    if not model.feedthrough:
        return
    cases = {}
    for value, functions in model.variants.items():
        if functions.jacobian is None:
            raise NotImplementedError(f"{model.component.name}: feedthrough in some variants only")
        cases[value] = statements(functions.jacobian, [_x(model), "u", "p", ["t"]], "j")
    yield _variants(
        f"model_jacobian(int variant, {_XUP}, real t, real *j)", cases, ["x", "u", "p", "t"]
    )


def _guard(loop: str, functions: Functions) -> ca.Function:
    return functions.guards[loop]


def _body(loop: str, functions: Functions) -> ca.Function:
    return functions.bodies[loop]


def _printed(
    model: Model,
    pick: Callable[[Functions], ca.Function],
    arguments: Sequence[Array],
    result: Array,
    where: str = "",
    rows: tuple[str, Sequence[Array]] = ("", ()),
) -> dict[int, list[str]]:
    """The statements of one function of each variant; see `statements`.

    Parameters
    ----------
    rows
        Occasion on which the function may read rows, and the arguments for their numbers.
    """
    if isinstance(model, Fixed):
        where = ""  # a body runs only where its guard holds, for the one simulation
    return {
        value: [
            *_looked_up(functions, *rows),
            *statements(
                pick(functions),
                [*arguments, "r"] if rows[0] in functions.rows else arguments, result, where,
                kind=_kind(model),
            ),
        ]
        for value, functions in model.variants.items()
    }


def _variants(signature: str, cases: Mapping[int, Sequence[str]], unused: Sequence[str]) -> str:
    """A procedure with the statements of each variant; a single variant needs no selection."""
    cases = {v: [*(f"(void){name};" for name in unused), *lines] for v, lines in cases.items()}
    if len(cases) == 1:
        return procedure(signature, next(iter(cases.values())), ["variant"])
    lines = ["switch (variant) {"]
    for value, case in cases.items():
        lines += [f"case {value}: {{", *(f"    {line}" for line in case), "    break;", "}"]
    return procedure(signature, [*lines, "default: break;", "}"])


def procedure(signature: str, lines: Sequence[str], unused: Sequence[str] = ()) -> str:
    """A C function without a result, some of whose arguments may be unused.

    Raises
    ------
    BuildError
        A statement reads a state that has no place.
    """
    if any(NOWHERE in line for line in lines):
        raise BuildError(f"{signature.partition('(')[0]}: must not read a state without a place")
    body = [*(f"(void){name};" for name in unused), *lines]
    indented = [f"    {line}" for line in body]
    return "\n".join([f"static inline void {signature}", "{", *indented, "}", ""])
