"""From a CasADi function to straight-line C.

A CasADi function of scalars is a list of elementary instructions. They are printed one by one for a
type ``real`` (``c/real.h``): a double in an FMU, or in a study a vector of doubles, one per
simulation. The text is the same, and so are the bits.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence

import casadi as ca

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
COMPARISONS: Mapping[int, str] = {
    ca.OP_LT: "m_lt({0}, {1})",
    ca.OP_LE: "m_le({0}, {1})",
    ca.OP_EQ: "m_eq({0}, {1})",
    ca.OP_NE: "m_ne({0}, {1})",
}
LOGIC: Mapping[int, str] = {
    ca.OP_NOT: "~{0}",
    ca.OP_AND: "{0} & {1}",
    ca.OP_OR: "{0} | {1}",
}
LOGIC_OF_CONDITIONS: Mapping[int, str] = {
    ca.OP_MUL: "{0} & {1}",
    ca.OP_FMIN: "{0} & {1}",
    ca.OP_FMAX: "{0} | {1}",
}
"""Results of arithmetic on two conditions, which are 0 or 1."""

_OF_A_NUMBER: Mapping[int, str] = {ca.OP_FMIN: "r_min({0}, {1})", ca.OP_FMAX: "r_max({0}, {1})"}
"""What these amount to where the second argument is a constant, and so not NaN."""

COSTLY = tuple(
    f"r_{name}(" for name in ("sin", "cos", "tan", "exp", "log", "atan", "atan2", "asin", "acos")
)
_CONSTANT = "r_set1({})"
_ZERO = _CONSTANT.format(0.0.hex())
_WHOLE, _PART = 1000, 400
"""Number of statements of a function that stays whole, and of each part of a longer one. Each part
ends with a mark for the compiler (``END_OF_PART`` in real.h)."""

Array = str | Sequence[str]
"""An array in C: its name, or an expression for each element."""
NOWHERE = "nowhere"
"""An element that has no place in C: nothing reads it."""


def constant(number: float) -> str:
    """A number in C."""
    return _CONSTANT.format(number.hex())


def _element(array: Array, i: int) -> str:
    return f"{array}[{i}]" if isinstance(array, str) else array[i]


def evaluated(
    function: ca.Function, arguments: Sequence[Array], kind: Callable[[], Computation] | None = None
) -> tuple[Computation, dict[int, str]]:
    """The values of a function, and the value of each element of its result.

    Parameters
    ----------
    arguments, kind
        See `statements`.

    Raises
    ------
    NotImplementedError
        An instruction has no counterpart in C; the message names it.
    """
    values = (kind or Computation)()
    registers: dict[int, str] = {}  # current content of CasADi's work registers
    results: dict[int, str] = {}
    for i in range(function.n_instructions()):
        operation = function.instruction_id(i)
        inputs, outputs = function.instruction_input(i), function.instruction_output(i)
        if operation == ca.OP_OUTPUT:
            results[outputs[1]] = values.real(registers[inputs[0]])
        elif operation == ca.OP_INPUT:
            text = _element(arguments[inputs[0]], inputs[1])
            registers[outputs[0]] = values.add("a", text)
        elif operation == ca.OP_CONST:
            number = float(function.instruction_constant(i))
            registers[outputs[0]] = values.add("a", constant(number))
        else:
            used = [registers[j] for j in inputs]
            try:
                registers[outputs[0]] = values.apply(operation, used)
            except KeyError:
                names = [n for n in dir(ca) if n.startswith("OP_") and getattr(ca, n) == operation]
                raise NotImplementedError(
                    f"{function.name()}: no C for instruction {names}"
                ) from None
    return values, results


def statements(
    function: ca.Function, arguments: Sequence[Array], result: Array, where: str = "",
    without: Collection[int] = (), kind: Callable[[], Computation] | None = None,
) -> list[str]:
    """The C statements of a function.

    Parameters
    ----------
    arguments
        C array that holds each argument.
    result
        C array for the result. Elements that the result leaves unchanged are not written, and those
        that are `NOWHERE` neither.
    where
        A mask in C: only these lanes of the result are written. Empty: all.
    without
        Elements of the result that are not written.
    kind
        Makes what says how values follow from each other; None: `Computation`.

    Raises
    ------
    NotImplementedError
        As `evaluated`.
    """
    values, results = evaluated(function, arguments, kind)
    stores = {  # element of the result -> value
        _element(result, i): value for i, value in sorted(results.items()) if i not in without
    }
    stores.pop(NOWHERE, None)
    stores = {target: value for target, value in stores.items() if values.texts[value] != target}
    return values.body(stores, where)


def parted(statements: Sequence[str]) -> Iterator[str]:
    """The statements, with a mark after every `_PART` if there are many."""
    many = len(statements) > _WHOLE
    for number, statement in enumerate(statements):
        if many and number and number % _PART == 0:
            yield "END_OF_PART;"
        yield statement


class Computation:
    """The values of a function, in order; each is a number (``a1``) or a condition (``m1``).

    CasADi's conditions are numbers, 0 or 1. Here they stay masks until arithmetic uses them, which
    saves most of the work of ``if_else``.

    Attributes
    ----------
    texts, operands
        C expression of each value, and the values that it uses.
    converted
        The same value as a number or as a condition.
    negated
        The opposite of each condition that is one.
    kept
        Condition and number of each value of the form ``c ? x : 0``.
    """

    def __init__(self) -> None:
        self.texts: dict[str, str] = {}
        self.operands: dict[str, tuple[str, ...]] = {}
        self.converted: dict[str, str] = {}
        self.negated: dict[str, str] = {}
        self.kept: dict[str, tuple[str, str]] = {}

    def add(self, kind: str, text: str, operands: Sequence[str] = ()) -> str:
        name = f"{kind}{len(self.texts)}"
        self.texts[name], self.operands[name] = text, tuple(operands)
        return name

    def form(self, kind: str, template: str, operands: Sequence[str]) -> str:
        return self.add(kind, template.format(*operands), operands)

    def real(self, value: str) -> str:
        """A value as a number."""
        if value[0] == "a":
            return value
        if value not in self.converted:
            self.converted[value] = self.form("a", "r_truth({0})", [value])
        return self.converted[value]

    def mask(self, value: str) -> str:
        """A value as a condition: whether it is not 0."""
        if value[0] == "m":
            return value
        if value not in self.converted:
            self.converted[value] = self.form("m", "m_true({0})", [value])
        return self.converted[value]

    def apply(self, operation: int, used: Sequence[str]) -> str:
        """The value of an instruction; KeyError if it has no counterpart."""
        conditions = all(value[0] == "m" for value in used)
        if conditions and operation in LOGIC_OF_CONDITIONS:
            return self.form("m", LOGIC_OF_CONDITIONS[operation], used)
        if operation == ca.OP_EQ and used[0][0] == "m" and self.texts[used[1]] == _ZERO:
            operation, used = ca.OP_NOT, used[:1]
        if operation in COMPARISONS:
            return self.form("m", COMPARISONS[operation], [self.real(v) for v in used])
        if operation in LOGIC:
            masks = [self.mask(v) for v in used]
            value = self.form("m", LOGIC[operation], masks)
            if operation == ca.OP_NOT:
                self.negated[value] = masks[0]
            return value
        if operation == ca.OP_IF_ELSE_ZERO:
            condition, number = self.mask(used[0]), self.real(used[1])
            value = self.form("a", "r_keep({0}, {1})", [condition, number])
            self.kept[value] = condition, number
            return value
        if operation == ca.OP_ADD:
            choice = self.choice(*used) or self.choice(*reversed(used))
            if choice is not None:
                return self.form("a", "r_blend({0}, {1}, {2})", choice)
        template = _ARITHMETIC[operation]
        if operation in _OF_A_NUMBER and self._constant(used[1]):
            template = _OF_A_NUMBER[operation]
        return self.form("a", template, [self.real(v) for v in used])

    def _constant(self, value: str) -> bool:
        return self.texts[value].startswith("r_set1(") and not self.operands[value]

    def choice(self, one: str, other: str) -> tuple[str, str, str] | None:
        """Condition and both numbers, if a sum has the form ``(c ? x : 0) + (!c ? y : 0)``."""
        if one in self.kept and other in self.kept:
            condition, x = self.kept[one]
            opposite, y = self.kept[other]
            if self.negated.get(opposite) == condition:
                return condition, x, y
        return None

    def change(self, target: str, value: str) -> tuple[str, str]:
        """Where a value changes an element ("": everywhere), and to which value."""
        if self.texts[value].startswith("r_blend("):
            condition, new, old = self.operands[value]
            if self.texts[old] == target:
                return condition, new
        return "", value

    def body(self, stores: Mapping[str, str], where: str) -> list[str]:
        """Statements that write values to their targets, where a mask is set ("": everywhere)."""
        needed: set[str] = set()
        writes = []
        for target, value in stores.items():
            condition, new = self.change(target, value) if where else ("", value)
            needed |= {new, condition} - {""}
            lanes = f"{where} & {condition}" if condition else where
            writes.append(
                f"{target} = r_blend({lanes}, {new}, {target});" if where else f"{target} = {new};"
            )
        # All reads come before any write: argument and result may be the same array.
        return [*self.lines(needed), *writes]

    def lines(self, wanted: set[str]) -> list[str]:
        """Statements for the wanted values and everything they need."""
        branches = self.branches(wanted)
        return self.printed([value for value in self.texts if value in branches], branches)

    def printed(
        self, order: Sequence[str], branches: Mapping[str, str],
        others: Mapping[str, str] | None = None,
    ) -> list[str]:
        """Statements for values, each after those that it uses.

        Parameters
        ----------
        branches
            The branch of each value, from `branches`.
        others
            Statements that take the place of a value's own, or stand in the order themselves.
        """
        others = others or {}
        lines = {
            value: others.get(value)
            or f"const {'real' if value[0] == 'a' else 'mask'} {value} = {self.texts[value]};"
            for value in order
        }
        pair_sines(lines, self.texts, branches)
        bodies: dict[str, list[str]] = {branch: [] for branch in ("", *branches.values())}
        for value, line in lines.items():
            if value in bodies:
                line = "\n".join([
                    f"real {value} = {_ZERO};",
                    f"if (m_any({self.kept[value][0]})) {{",
                    *bodies[value], f"{value} = {self.texts[value]};",
                    "}",
                ])
            bodies[branches[value]].append(line)
        return "\n".join(parted(bodies[""])).splitlines()

    def branches(self, wanted: set[str]) -> dict[str, str]:
        """The branch of each needed value: the value ``c ? x : 0`` that alone needs it, or "".

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
            condition = self.kept.get(value, ("",))[0]
            for operand in self.operands[value]:
                inside = value in self.kept and operand != condition
                users.setdefault(operand, []).append(value if inside else common[-1])
        worthy = {
            branch
            for value, inner in branches.items()
            if self.texts[value].startswith(COSTLY)
            for branch in path(inner)
        }

        def kept(branch: str) -> str:
            return branch if branch in worthy else kept(branches[branch])

        worthy.add("")
        return {value: kept(branch) for value, branch in branches.items()}


def pair_sines(
    lines: dict[str, str], texts: Mapping[str, str], branches: Mapping[str, str]
) -> None:
    """Compute sine and cosine of the same argument together, where both are needed."""
    first: dict[tuple[str, str], str] = {}
    for value in list(lines):
        text = texts.get(value, "")
        if not text.startswith(("r_sin(", "r_cos(")):
            continue
        place = branches[value], text[5:]
        other = first.setdefault(place, value)
        if other == value or texts[other] == text:
            continue
        del first[place]  # each has one partner
        sine, cosine = (other, value) if texts[other].startswith("r_sin") else (value, other)
        argument = text[6:-1]
        lines[other] = f"real {sine}, {cosine}; r_sincos({argument}, &{sine}, &{cosine});"
        del lines[value]
