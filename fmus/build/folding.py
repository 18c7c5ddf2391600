"""Values of a function some of whose arguments are known: what follows from them is computed here.

The C that is left gives the bits of the C with all arguments, as long as numbers are finite. Only
operations that IEEE 754 rounds correctly are computed. A product with 0 stays, as it may be −0, but
as a condition it never holds.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import casadi as ca

from .straight_line import COMPARISONS, LOGIC, LOGIC_OF_CONDITIONS, Computation, constant

_EXACT: Mapping[int, Callable[..., float]] = {
    ca.OP_ADD: operator.add,
    ca.OP_SUB: operator.sub,
    ca.OP_MUL: operator.mul,
    ca.OP_DIV: operator.truediv,
    ca.OP_NEG: operator.neg,
    ca.OP_SQ: lambda a: a * a,
    ca.OP_TWICE: lambda a: a + a,
    ca.OP_INV: lambda a: 1.0 / a,
    ca.OP_SQRT: math.sqrt,
    ca.OP_FABS: abs,
}
_COMPARED: Mapping[int, Callable[[float, float], bool]] = {
    ca.OP_LT: operator.lt, ca.OP_LE: operator.le, ca.OP_EQ: operator.eq, ca.OP_NE: operator.ne,
}
Few = frozenset[str]
"""All that a number can be, as C writes numbers: −0 is not 0."""
MOST = 4
"""Number of values that still are few."""
_OF_NOTHING = (ca.OP_ADD, ca.OP_SUB, ca.OP_NEG, ca.OP_FMIN, ca.OP_FMAX)
_ALIAS = "{0}"
_TRUTHS = {False: "m_true(r_set1(0.0))", True: "m_true(r_set1(1.0))"}


class Folded(Computation):
    """Values, with numbers and conditions that are known.

    Attributes
    ----------
    known
        The numbers and truths of values that are known.
    nothing
        Numbers that are 0 or −0, whichever.
    few
        All that numbers can be that have few possible values.

    Parameters
    ----------
    arguments
        The same of arguments, by their text.
    """

    def __init__(self, arguments: Mapping[str, Few] = MappingProxyType({})) -> None:
        super().__init__()
        self.known: dict[str, float] = {}
        self.nothing: set[str] = set()
        self.few: dict[str, Few] = {}
        self._arguments = arguments

    def add(self, kind: str, text: str, operands: Sequence[str] = ()) -> str:
        name = super().add(kind, text, operands)
        if not operands and text.startswith(("r_set1(0x", "r_set1(-0x")):
            self.known[name] = float.fromhex(text[len("r_set1(") : -1])
        elif not operands and text in self._arguments:
            self.few[name] = self._arguments[text]
        return name

    def possible(self, value: str) -> Few:
        """All that a number can be; empty: that is not known."""
        if value in self.known:
            return frozenset({float(self.known[value]).hex()})
        return self.few.get(value, frozenset())

    def real(self, value: str) -> str:
        if value[0] == "m" and value in self.known and value not in self.converted:
            self.converted[value] = self.add("a", constant(float(self.known[value])))
        return super().real(value)

    def mask(self, value: str) -> str:
        if value not in self.converted and value[0] == "a":
            if value in self.nothing:
                self.converted[value] = self._truth(False)
            else:
                truths = {float.fromhex(it) != 0 for it in self.possible(value)}
                if len(truths) == 1:
                    self.converted[value] = self._truth(truths.pop())
        return super().mask(value)

    def _truth(self, truth: bool) -> str:
        name = self.add("m", _TRUTHS[truth])
        self.known[name] = truth
        return name

    def apply(self, operation: int, used: Sequence[str]) -> str:
        value = self._applied(operation, used)
        nothing = [it in self.nothing or self.known.get(it) == 0 for it in used]
        product = operation in (ca.OP_MUL, ca.OP_SQ) and any(nothing)
        chosen = operation == ca.OP_IF_ELSE_ZERO and nothing[-1]
        if product or chosen or (operation in _OF_NOTHING and all(nothing)):
            self.nothing.add(value)
        self._count(operation, value)
        return value

    def _count(self, operation: int, value: str) -> None:
        """Say what a choice can be, if that is few."""
        operands = self.operands[value]
        if value in self.known or operation not in (ca.OP_ADD, ca.OP_IF_ELSE_ZERO):
            return
        if self.texts[value].startswith("r_blend("):
            both = [self.possible(it) for it in operands[1:]]
        elif self.texts[value].startswith("r_keep("):
            both = [self.possible(operands[1]), frozenset({0.0.hex()})]
        else:
            both = [self.possible(it) for it in operands if self.texts[value] == it]
        found = frozenset().union(*both)
        if both and all(both) and len(found) <= MOST:
            self.few[value] = found

    def _applied(self, operation: int, used: Sequence[str]) -> str:
        of_conditions = operation in LOGIC_OF_CONDITIONS and all(v[0] == "m" for v in used)
        if operation in LOGIC or of_conditions:
            return self._logic(operation, used) or super().apply(operation, used)
        if operation == ca.OP_IF_ELSE_ZERO and self.mask(used[0]) in self.known:
            return self._chosen(self.mask(used[0]), self.real(used[1]))
        if operation == ca.OP_ADD:
            choice = self.choice(*used) or self.choice(*reversed(used))
            if choice is not None and choice[0] in self.known:
                return choice[1] if self.known[choice[0]] else choice[2]
        if operation in COMPARISONS:
            truths = self._compared(operation, used)
            if len(truths) == 1:
                truth = self._truth(truths.pop())
                if operation == ca.OP_EQ and used[0][0] == "m" and self.known.get(used[1]) == 0:
                    self.negated[truth] = used[0]
                return truth
        if all(value in self.known for value in used):
            numbers = [float(self.known[value]) for value in used]
            if operation in _EXACT:
                result = _computed(_EXACT[operation], numbers)
                if math.isfinite(result):
                    return self.add("a", constant(result))
        return super().apply(operation, used)

    def _compared(self, operation: int, used: Sequence[str]) -> set[bool]:
        """What a comparison can give; empty: that is not known."""
        one, other = ([float.fromhex(it) for it in self.possible(value)] for value in used)
        return {_COMPARED[operation](a, b) for a in one for b in other}

    def _logic(self, operation: int, used: Sequence[str]) -> str:
        """The value of an operation on conditions, or "" if it follows from nothing known."""
        masks = [self.mask(value) for value in used]
        truths = [self.known.get(value) for value in masks]
        if operation == ca.OP_NOT:
            if truths[0] is None:
                return ""
            value = self._truth(not truths[0])
            self.negated[value] = masks[0]
            return value
        decides = operation in (ca.OP_OR, ca.OP_FMAX)  # the truth that decides alone
        if any(truth is not None and bool(truth) == decides for truth in truths):
            return self._truth(decides)
        if truths[0] is not None:
            return masks[1]
        return masks[0] if truths[1] is not None else ""

    def _chosen(self, condition: str, number: str) -> str:
        """``c ? x : 0`` with a known condition: another name for x, or 0."""
        if self.known[condition]:
            value = self.form("a", _ALIAS, [number])
            if number in self.known:
                self.known[value] = self.known[number]
        else:
            value = self.add("a", constant(0.0))
        self.kept[value] = condition, number
        return value


def _computed(function: Callable[..., Any], numbers: Sequence[float]) -> float:
    """The result, or NaN if Python has none."""
    try:
        return float(function(*numbers))
    except (ArithmeticError, ValueError):
        return math.nan
