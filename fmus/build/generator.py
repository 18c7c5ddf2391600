"""From a component's CasADi functions to C.

A CasADi function of scalars is a list of elementary instructions. They are printed one by one as
straight C over a type ``real`` (``c/real.h``) that is a double in an FMU, or a vector of doubles,
one per simulation, in a study: the same text, and the same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Literal

import casadi as ca
from sblcosim.models.declaration import Component, Variable
from sblcosim.models.equations import Draw, Functions, Model

_ARITHMETIC: Mapping[int, str] = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_ADD: "{0} + {1}",
    ca.OP_SUB: "{0} - {1}",
    ca.OP_MUL: "{0} * {1}",
    ca.OP_DIV: "{0} / {1}",
    ca.OP_NEG: "-{0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "{0} + {0}",
    ca.OP_INV: "r_set1(1.0) / {0}",
    ca.OP_SQRT: "r_sqrt({0})",
    ca.OP_SIN: "r_sin({0})",
    ca.OP_COS: "r_cos({0})",
    ca.OP_TAN: "r_tan({0})",
    ca.OP_EXP: "r_exp({0})",
    ca.OP_LOG: "r_log({0})",
    ca.OP_ATAN: "r_atan({0})",
    ca.OP_ATAN2: "r_atan2({0}, {1})",
    ca.OP_ASIN: "r_asin({0})",
    ca.OP_ACOS: "r_acos({0})",
    ca.OP_FABS: "r_fabs({0})",
    ca.OP_SIGN: "r_sign({0})",
    ca.OP_FMIN: "r_fmin({0}, {1})",
    ca.OP_FMAX: "r_fmax({0}, {1})",
    ca.OP_COPYSIGN: "r_copysign({0}, {1})",
    ca.OP_FLOOR: "r_floor({0})",
    ca.OP_CEIL: "r_ceil({0})",
    ca.OP_FMOD: "r_fmod({0}, {1})",
}
_COMPARISONS: Mapping[int, str] = {
    ca.OP_LT: "m_lt({0}, {1})",
    ca.OP_LE: "m_le({0}, {1})",
    ca.OP_EQ: "m_eq({0}, {1})",
    ca.OP_NE: "m_ne({0}, {1})",
}
_LOGIC: Mapping[int, str] = {
    ca.OP_NOT: "~{0}",
    ca.OP_AND: "{0} & {1}",
    ca.OP_OR: "{0} | {1}",
}
_LOGIC_OF_CONDITIONS: Mapping[int, str] = {
    ca.OP_MUL: "{0} & {1}",
    ca.OP_FMIN: "{0} & {1}",
    ca.OP_FMAX: "{0} | {1}",
}
"""What arithmetic with two conditions, which are 0 or 1, amounts to."""

_COSTLY = tuple(
    f"r_{name}(" for name in ("sin", "cos", "tan", "exp", "log", "atan", "atan2", "asin", "acos")
)
_ZERO = f"r_set1({0.0.hex()})"
_TYPES = {"Float64": "FLOAT64", "Int32": "INT32", "Boolean": "BOOLEAN"}
_CAUSALITIES = {"parameter": "PARAMETER", "input": "INPUT", "output": "OUTPUT"}


Array = str | Sequence[str]
"""An array in C: its name, or an expression for each element."""


def _element(array: Array, i: int) -> str:
    return f"{array}[{i}]" if isinstance(array, str) else array[i]


def statements(
    function: ca.Function, arguments: Sequence[Array], result: Array, where: str = ""
) -> list[str]:
    """The C statements of a function.

    Parameters
    ----------
    arguments
        What holds each argument.
    result
        What takes the result. Elements of an argument that stay in their place are not written.
    where
        A mask in C: the result is written in these lanes only. Empty: in all.

    Raises
    ------
    NotImplementedError
        An instruction has no counterpart in C; the message names it.
    """
    values = _Values()
    registers: dict[int, str] = {}  # what a work register of CasADi holds now
    stores: dict[str, str] = {}  # element of the result -> value
    for i in range(function.n_instructions()):
        operation = function.instruction_id(i)
        inputs, outputs = function.instruction_input(i), function.instruction_output(i)
        if operation == ca.OP_OUTPUT:
            stores[_element(result, outputs[1])] = values.real(registers[inputs[0]])
        elif operation == ca.OP_INPUT:
            text = _element(arguments[inputs[0]], inputs[1])
            registers[outputs[0]] = values.add("a", text)
        elif operation == ca.OP_CONST:
            number = float(function.instruction_constant(i))
            registers[outputs[0]] = values.add("a", f"r_set1({number.hex()})")
        else:
            used = [registers[j] for j in inputs]
            try:
                registers[outputs[0]] = values.apply(operation, used)
            except KeyError:
                names = [n for n in dir(ca) if n.startswith("OP_") and getattr(ca, n) == operation]
                raise NotImplementedError(
                    f"{function.name()}: no C for instruction {names}"
                ) from None
    stores = {target: value for target, value in stores.items() if values.texts[value] != target}
    # Everything is read before anything is written: argument and result may be the same array.
    return [
        *values.lines(set(stores.values())),
        *(
            f"{target} = r_blend({where}, {value}, {target});" if where else f"{target} = {value};"
            for target, value in stores.items()
        ),
    ]


class _Values:
    """The values of a function, in order; each is a number (``a1``) or a condition (``m1``).

    CasADi's conditions are numbers, 0 or 1. Here they stay masks until they are calculated with,
    which saves most of the work of ``if_else``.

    Attributes
    ----------
    texts, operands
        C expression of each value, and the values in it.
    """

    def __init__(self) -> None:
        self.texts: dict[str, str] = {}
        self.operands: dict[str, tuple[str, ...]] = {}
        self._converted: dict[str, str] = {}
        self._negated: dict[str, str] = {}  # condition -> what it is the opposite of
        self._kept: dict[str, tuple[str, str]] = {}  # value -> condition, number: c ? x : 0

    def add(self, kind: str, text: str, operands: Sequence[str] = ()) -> str:
        name = f"{kind}{len(self.texts)}"
        self.texts[name], self.operands[name] = text, tuple(operands)
        return name

    def _form(self, kind: str, template: str, operands: Sequence[str]) -> str:
        return self.add(kind, template.format(*operands), operands)

    def real(self, value: str) -> str:
        """A value as a number."""
        if value[0] == "a":
            return value
        if value not in self._converted:
            self._converted[value] = self._form("a", "r_truth({0})", [value])
        return self._converted[value]

    def mask(self, value: str) -> str:
        """A value as a condition: whether it is not 0."""
        if value[0] == "m":
            return value
        if value not in self._converted:
            self._converted[value] = self._form("m", "m_true({0})", [value])
        return self._converted[value]

    def apply(self, operation: int, used: Sequence[str]) -> str:
        """The value of an instruction; KeyError if it has no counterpart."""
        conditions = all(value[0] == "m" for value in used)
        if conditions and operation in _LOGIC_OF_CONDITIONS:
            return self._form("m", _LOGIC_OF_CONDITIONS[operation], used)
        if operation == ca.OP_EQ and used[0][0] == "m" and self.texts[used[1]] == _ZERO:
            operation, used = ca.OP_NOT, used[:1]
        if operation in _COMPARISONS:
            return self._form("m", _COMPARISONS[operation], [self.real(v) for v in used])
        if operation in _LOGIC:
            masks = [self.mask(v) for v in used]
            value = self._form("m", _LOGIC[operation], masks)
            if operation == ca.OP_NOT:
                self._negated[value] = masks[0]
            return value
        if operation == ca.OP_IF_ELSE_ZERO:
            condition, number = self.mask(used[0]), self.real(used[1])
            value = self._form("a", "r_keep({0}, {1})", [condition, number])
            self._kept[value] = condition, number
            return value
        if operation == ca.OP_ADD:
            choice = self._choice(*used) or self._choice(*reversed(used))
            if choice is not None:
                return self._form("a", "r_blend({0}, {1}, {2})", choice)
        return self._form("a", _ARITHMETIC[operation], [self.real(v) for v in used])

    def _choice(self, one: str, other: str) -> tuple[str, str, str] | None:
        """Condition and both numbers, if a sum is ``(c ? x : 0) + (!c ? y : 0)``."""
        if one in self._kept and other in self._kept:
            condition, x = self._kept[one]
            opposite, y = self._kept[other]
            if self._negated.get(opposite) == condition:
                return condition, x, y
        return None

    def lines(self, wanted: set[str]) -> list[str]:
        """Statements that make the wanted values, and nothing that they do not need."""
        branches = self._branches(wanted)
        lines = {
            value: f"const {'real' if value[0] == 'a' else 'mask'} {value} = {text};"
            for value, text in self.texts.items()
            if value in branches
        }
        _pair_sines(lines, self.texts, branches)
        bodies: dict[str, list[str]] = {branch: [] for branch in ("", *branches.values())}
        for value, line in lines.items():
            if value in bodies:
                line = "\n".join([
                    f"real {value} = {_ZERO};",
                    f"if (m_any({self._kept[value][0]})) {{",
                    *bodies[value], f"{value} = {self.texts[value]};",
                    "}",
                ])
            bodies[branches[value]].append(line)
        return "\n".join(bodies[""]).splitlines()

    def _branches(self, wanted: set[str]) -> dict[str, str]:
        """Where the needed values are made: the value ``c ? x : 0`` that alone needs them, or "".

        Only a choice that saves an elementary function is worth a branch.
        """
        users: dict[str, list[str]] = {value: [""] for value in wanted}
        branches: dict[str, str] = {}

        def path(branch: str) -> list[str]:
            return [*path(branches[branch]), branch] if branch else [""]

        for value in reversed(self.texts):
            if value not in users:
                continue
            common = path(users[value][0])
            for user in users[value][1:]:
                common = [a for a, b in zip(common, path(user), strict=False) if a == b]
            branches[value] = common[-1]
            condition = self._kept.get(value, ("",))[0]
            for operand in self.operands[value]:
                inside = value in self._kept and operand != condition
                users.setdefault(operand, []).append(value if inside else common[-1])
        worthy = {
            branch
            for value, inner in branches.items()
            if self.texts[value].startswith(_COSTLY)
            for branch in path(inner)
        }

        def kept(branch: str) -> str:
            return branch if branch in worthy else kept(branches[branch])

        worthy.add("")
        return {value: kept(branch) for value, branch in branches.items()}


def _pair_sines(
    lines: dict[str, str], texts: Mapping[str, str], branches: Mapping[str, str]
) -> None:
    """Compute sine and cosine of one argument together, where both are needed."""
    first: dict[tuple[str, str], str] = {}
    for value in list(lines):
        text = texts[value]
        if not text.startswith(("r_sin(", "r_cos(")):
            continue
        other = first.setdefault((branches[value], text[5:]), value)
        if other == value or texts[other] == text:
            continue
        sine, cosine = (other, value) if texts[other].startswith("r_sin") else (value, other)
        argument = text[6:-1]
        lines[other] = f"real {sine}, {cosine}; r_sincos({argument}, &{sine}, &{cosine});"
        del lines[value]


def _procedure(signature: str, lines: Sequence[str], unused: Sequence[str] = ()) -> str:
    body = [*(f"(void){name};" for name in unused), *lines]
    indented = [f"    {line}" for line in body]
    return "\n".join([f"static inline void {signature}", "{", *indented, "}", ""])


def _cases(signature: str, selector: str, cases: Mapping[int, Sequence[str]]) -> str:
    """A procedure that does one of several things; a single one needs no selector."""
    if len(cases) == 1:
        return _procedure(signature, next(iter(cases.values())), [selector])
    lines = [f"switch ({selector}) {{"]
    for value, case in cases.items():
        lines += [f"case {value}: {{", *(f"    {line}" for line in case), "    break;", "}"]
    return _procedure(signature, [*lines, "default: break;", "}"])


def _blocks(draws: Sequence[Draw], name: str, places: Mapping[str, int]) -> list[str]:
    """The blocks of random numbers drawn on one occasion, as rows of ``struct draw``.

    A block gives two numbers. Draws of one kind share blocks, in the order in which they are
    declared.

    Parameters
    ----------
    places
        Index of each scalar parameter in ``p``.
    """
    kinds: dict[Literal["normal", "uniform"], list[tuple[int, str | None]]]
    kinds = {"normal": [], "uniform": []}
    position = 0
    for draw in draws:
        if draw.occasion == name:
            scales = draw.scale or (None,) * draw.size
            kinds[draw.kind] += zip(range(position, position + draw.size), scales, strict=True)
            position += draw.size
    rows = []
    for kind, numbers in kinds.items():
        for first in range(0, len(numbers), 2):
            pair = numbers[first : first + 2]
            to = [place for place, _ in pair]
            scale = [-1 if scale is None else places[scale] for _, scale in pair]
            if len(pair) == 1:
                to, scale = [*to, -1], scale * 2
            uniform = int(kind == "uniform")
            rows.append(f"{{{first + uniform}, {uniform}, {{{to[0]}, {to[1]}}}, "
                        f"{{{scale[0]}, {scale[1]}}}}}")
    return rows


def noise_size(draws: Sequence[Draw], occasion: str) -> int:
    """How many numbers are drawn on one occasion."""
    return sum(draw.size for draw in draws if draw.occasion == occasion)


def state_places(model: Model) -> list[int]:
    """Where each state is kept in ``x``, the array of all outputs and, after them, of the states.

    A state that is shown as it is, in all variants, is kept where it is shown.
    """
    shown = set.intersection(*map(_shown, (f.output for f in model.variants.values())))
    places: dict[int, int] = {}
    for output, state in sorted(shown):
        places.setdefault(state, output)
    n_outputs = sum(v.size for v in model.component.of("output"))
    n_states = sum(rows * columns for rows, columns in model.states.values())
    hidden = [state for state in range(n_states) if state not in places]
    places |= {state: n_outputs + i for i, state in enumerate(hidden)}
    return [places[state] for state in range(n_states)]


def _shown(output: ca.Function) -> set[tuple[int, int]]:
    """Outputs that are states, and which."""
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


def model_source(model: Model) -> str:
    """The generated part of an engine: sizes, noise and equations of a component, as C."""
    component = model.component
    loops = [*model.advance, *model.iterate]
    occasions = ["initial", "tick", *loops]
    parameters = [v.name for v in component.of("parameter") for _ in range(v.size)]

    def place(name: str | None) -> int:
        return parameters.index(name) if name in parameters else -1

    n_outputs = sum(v.size for v in component.of("output"))
    at = state_places(model)
    x = [f"x[{place}]" for place in at]
    y = [f"x[{i}]" for i in range(n_outputs)]
    places = {name: i for i, name in enumerate(parameters)}
    blocks = [_blocks(model.draws, occasion, places) for occasion in occasions]
    counts = [len(rows) for rows in blocks]
    sizes = {
        "COMPONENT_NUMBER": component.number,
        "N_P": len(parameters),
        "N_U": sum(v.size for v in component.of("input")),
        "N_Y": n_outputs,
        "N_X": max([n_outputs, *(place + 1 for place in at)]),
        "N_W": max(noise_size(model.draws, occasion) for occasion in occasions),
        "N_BLOCKS": max(counts),
        "N_ADVANCE": len(model.advance),
        "N_ITERATE": len(model.iterate),
        "P_SEED": place("seed"),
        "P_STREAM": place("stream"),
        "P_INTERVAL": place(component.interval),
        "P_VARIANT": place(component.variant),
        "HAS_JACOBIAN": int(bool(model.feedthrough)),
    }
    parts = [f"/* Equations of {component.name}, generated from its CasADi functions. */"]
    parts += ["\n".join(f"#define {name} {value}" for name, value in sizes.items())]
    parts += ['#include "noise.h"', ""]
    parts += [
        f"static const struct draw model_draws[{len(blocks)}][N_BLOCKS + 1] = {{",
        *(f"    {{{', '.join(rows or ['{0, 0, {0, 0}, {0, 0}}'])}}}," for rows in blocks),
        "};",
        f"static const int model_blocks[{len(blocks)}] = {{{', '.join(map(str, counts))}}};",
        "",
    ]

    def each(
        pick: Callable[[Functions], ca.Function],
        arguments: Sequence[Array],
        result: Array,
        where: str = "",
    ) -> dict[int, list[str]]:
        """One function of each variant, printed."""
        return {
            value: statements(pick(functions), arguments, result, where)
            for value, functions in model.variants.items()
        }

    xup = "const real *x, const real *u, const real *p"

    def emit(signature: str, cases: Mapping[int, Sequence[str]], unused: Sequence[str]) -> None:
        filled = {v: [*(f"(void){n};" for n in unused), *lines] for v, lines in cases.items()}
        parts.append(_cases(signature, "variant", filled))

    emit(
        "model_initial(int variant, const real *p, const real *w, real t, real *x)",
        each(lambda f: f.initial, ["p", "w", ["t"]], x), ["p", "w", "t", "x"],
    )
    emit(
        "model_tick(int variant, real *x, const real *u, const real *p, const real *w, real t, "
        "real k)",
        each(lambda f: f.tick, [x, "u", "p", "w", ["t"], ["k"]], x),
        ["x", "u", "p", "w", "t", "k"],
    )
    emit(
        "model_output(int variant, real *x, const real *u, const real *p, real t)",
        each(lambda f: f.output, [x, "u", "p", ["t"]], y), ["x", "u", "p", "t"],
    )
    for number, loop in enumerate(loops):
        guards = each(partial(_guard, loop), [x, "u", "p", ["t"]], "c")
        bodies = each(partial(_body, loop), [x, "u", "p", "w", ["t"]], x, "going")
        emit(f"guard_{number}(int variant, {xup}, real t, real *c)", guards, ["x", "u", "p", "t"])
        emit(
            f"body_{number}(int variant, mask going, real *x, const real *u, const real *p, "
            "const real *w, real t)",
            bodies, ["going", "x", "u", "p", "w", "t"],
        )
    numbers = range(len(loops))
    parts.append(
        _procedure(
            f"model_guard(int loop, int variant, {xup}, real t, real *c)",
            [
                "switch (loop) {",
                *(f"case {n}: guard_{n}(variant, x, u, p, t, c); break;" for n in numbers),
                "default: *c = r_set1(0.0); break;",
                "}",
            ],
            ["variant", "x", "u", "p", "t"],
        )
    )
    parts.append(
        _procedure(
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
    )
    if model.feedthrough:
        cases = {}
        for value, functions in model.variants.items():
            if functions.jacobian is None:
                raise NotImplementedError(f"{component.name}: feedthrough in some variants only")
            cases[value] = statements(functions.jacobian, [x, "u", "p", ["t"]], "j")
        emit(
            f"model_jacobian(int variant, {xup}, real t, real *j)", cases, ["x", "u", "p", "t"]
        )
    return "\n".join(parts)


def _guard(loop: str, functions: Functions) -> ca.Function:
    return functions.guards[loop]


def _body(loop: str, functions: Functions) -> ca.Function:
    return functions.bodies[loop]


def _bound(value: float | None, infinity: str) -> str:
    return infinity if value is None else float(value).hex()


def table_source(component: Component, token: str, references: Mapping[str, int]) -> str:
    """The generated tables of an FMU shell: its variables, start values and identity, as C.

    Parameters
    ----------
    references
        Value reference of each variable's first element, as modelDescription.xml has it.
    """

    def row(v: Variable) -> str:
        columns = v.shape[1] if len(v.shape) == 2 else 0
        return (
            f'    {{"{v.name}", {_TYPES[v.type]}, {_CAUSALITIES[v.causality]}, '
            f"{references[v.name]}, {v.size}, {len(v.shape)}, {columns}, "
            f'{_bound(v.min, "-INFINITY")}, {_bound(v.max, "INFINITY")}}},'
        )

    owners = [str(i) for i, v in enumerate(component) for _ in range(v.size)]
    kinds = [(v.type, v.causality) for v in component for _ in range(v.size)]
    alike: list[int] = []
    for i in reversed(range(len(kinds))):
        same = i + 1 < len(kinds) and kinds[i] == kinds[i + 1]
        alike.append(alike[-1] + 1 if same else 1)
    starts = [
        float(start).hex() for v in component if v.causality != "output" for start in v.starts
    ]
    return "\n".join(
        [
            f"/* Tables of {component.name}, generated from its declaration. */",
            f'#define MODEL_NAME "{component.name}"',
            f'#define MODEL_TOKEN "{token}"',
            f"#define FIRST_REFERENCE {min(references.values())}",
            f"#define N_VARIABLES {len(component.variables)}",
            "static const struct variable variables[N_VARIABLES] = {",
            *(row(v) for v in component),
            "};",
            "/* Which variable each element belongs to. */",
            f"static const unsigned short owner[N_VALUES] = {{{', '.join(owners)}}};",
            "/* How many elements from this one on have its type and causality. */",
            "static const unsigned short alike[N_VALUES] = "
            f"{{{', '.join(map(str, reversed(alike)))}}};",
            f"static const double start_values[N_P + N_U] = {{{', '.join(starts)}}};",
            "",
        ]
    )
