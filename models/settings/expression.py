"""Expressions: numbers that remember how they are computed, operation by operation.

Settings are computed from them as from numbers. Nothing is simplified or reordered, so that C code
printed from an expression has the bits of the same operations on Python's numbers. CasADi's
symbols would not do: ``sqrt(x)**2`` becomes ``x``, and ``x / y * y`` becomes ``x``.

A value that is unknown is NaN, and so is everything computed from it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import wraps
from typing import Any

C: Mapping[str, str] = {
    "add": "{} + {}", "sub": "{} - {}", "mul": "{} * {}", "div": "{} / {}", "neg": "-{}",
    "lt": "{} < {}", "le": "{} <= {}", "eq": "{} == {}", "ne": "{} != {}",
    "both": "{} != 0.0 && {} != 0.0", "where": "{} != 0.0 ? {} : {}",
    "least": "{0} < {1} ? {1} : {0}", "most": "{1} < {0} ? {1} : {0}",
    "sqrt": "r_sqrt({})", "floor": "r_floor({})", "absolute": "r_fabs({})",
}
"""The operations, as C on doubles; a condition is 1 or 0."""
_CALL = "call "
_CONDITIONS = ("lt", "le", "eq", "ne", "both")


class Expression:
    """A number that is not known yet. It has no truth value: choices are ``where`` of `either`.

    Attributes
    ----------
    operation
        A key of `C`, ``"input"``, ``"number"``, or ``"call NAME"`` of an `outlined` function.
    operands
        The expressions that it is computed from; of an input its name, of a number its value.
    perhaps_unknown
        Whether it is NaN, or a choice between NaN and something else.
    """

    __slots__ = ("operands", "operation", "perhaps_unknown")

    operation: str
    operands: tuple[Any, ...]
    perhaps_unknown: bool

    def __new__(cls, operation: str, *operands: Any) -> Expression:
        """An expression; equal ones are the same object."""
        leaf = operation in ("input", "number")
        key = (operation, repr(operands)) if leaf else (operation, *map(id, operands))
        found = _KNOWN.get(key)
        if found is None:
            found = _KNOWN[key] = super().__new__(cls)
            found.operation, found.operands = operation, operands
            found.perhaps_unknown = found.unknown or (
                not leaf and any(it.perhaps_unknown for it in operands)
            )
        return found

    @property
    def unknown(self) -> bool:
        """Whether it is NaN, whatever the inputs are."""
        return self.operation == "number" and math.isnan(self.operands[0])

    def __bool__(self) -> bool:
        raise TypeError("an expression has no truth value: use where() instead of if")

    def __pow__(self, power: Any) -> Expression:
        raise TypeError("a power may differ in its last bit: multiply instead")

    __rpow__ = __pow__
    __hash__ = object.__hash__

    def __add__(self, other: Any) -> Expression:
        return computed("add", self, other)

    def __radd__(self, other: Any) -> Expression:
        return computed("add", other, self)

    def __sub__(self, other: Any) -> Expression:
        return computed("sub", self, other)

    def __rsub__(self, other: Any) -> Expression:
        return computed("sub", other, self)

    def __mul__(self, other: Any) -> Expression:
        return computed("mul", self, other)

    def __rmul__(self, other: Any) -> Expression:
        return computed("mul", other, self)

    def __truediv__(self, other: Any) -> Expression:
        return computed("div", self, other)

    def __rtruediv__(self, other: Any) -> Expression:
        return computed("div", other, self)

    def __neg__(self) -> Expression:
        return computed("neg", self)

    def __abs__(self) -> Expression:
        return computed("absolute", self)

    def __lt__(self, other: Any) -> Expression:
        return computed("lt", self, other)

    def __le__(self, other: Any) -> Expression:
        return computed("le", self, other)

    def __gt__(self, other: Any) -> Expression:
        return computed("lt", other, self)

    def __ge__(self, other: Any) -> Expression:
        return computed("le", other, self)

    def __eq__(self, other: object) -> Expression:  # type: ignore[override]
        return computed("eq", self, other)

    def __ne__(self, other: object) -> Expression:  # type: ignore[override]
        return computed("ne", self, other)


_KNOWN: dict[tuple[Any, ...], Expression] = {}
"""All expressions, by operation and operands."""


def number(value: Any) -> Expression:
    """A number as an expression; expressions stay as they are."""
    return value if isinstance(value, Expression) else Expression("number", float(value))


def symbol(name: str) -> Expression:
    """The input of this name."""
    return Expression("input", name)


UNKNOWN = number(math.nan)


def computed(operation: str, *values: Any) -> Expression:
    """The result of an operation, a key of `C`; unknown if it needs a value that is unknown.

    Raises
    ------
    ValueError
        A condition depends on a value that may be unknown; it would be silently false.
    """
    if operation != "where" and any(value is UNKNOWN for value in values):
        return UNKNOWN
    operands = [number(value) for value in values]
    if operation == "where":
        condition, value, otherwise = operands
        if condition.unknown or value is otherwise:
            return condition if condition.unknown else value
    elif operation in _CONDITIONS and any(it.perhaps_unknown for it in operands):
        raise ValueError(f"a condition ({operation}) must depend on known values only")
    return Expression(operation, *operands)


def choice(condition: Any, value: Any, otherwise: Any) -> Any:
    """The first value where a condition on numbers or expressions holds, else the second."""
    if isinstance(condition, Expression):
        return computed("where", condition, value, otherwise)
    return value if condition else otherwise


def root(value: Any) -> Any:
    """Square root of a number or an expression."""
    return computed("sqrt", value) if isinstance(value, Expression) else math.sqrt(value)


def whole(value: Any) -> Any:
    """The largest whole number that is not above a number or an expression."""
    if isinstance(value, Expression):
        return computed("floor", value)
    return float(math.floor(value))


def outlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of numbers that expressions call, so that its C code is there once.

    It takes numbers, and its result is one. Its name is that of the C function, with the number of
    arguments at the end.
    """
    name = function.__name__
    _OUTLINED[name] = function

    @wraps(function)
    def called(*values: Any) -> Any:
        if any(type(value) is Expression for value in values):
            return computed(f"{_CALL}{name}", *values)
        return function(*values)

    return called


_OUTLINED: dict[str, Callable[..., Any]] = {}


def called(expressions: Iterable[Expression]) -> dict[str, tuple[list[str], Expression]]:
    """The C functions that expressions call: their arguments and results, in order of definition.
    """
    found: dict[str, tuple[list[str], Expression]] = {}
    for it in ordered(expressions):
        name = it.operation.removeprefix(_CALL)
        own = f"{name}_{len(it.operands)}"
        if name in _OUTLINED and name != it.operation and own not in found:
            arguments = [f"x{place}" for place in range(len(it.operands))]
            result = number(_OUTLINED[name](*map(symbol, arguments)))
            found |= {k: v for k, v in called([result]).items() if k not in found}
            found[own] = arguments, result
    return found


def ordered(expressions: Iterable[Expression]) -> Iterator[Expression]:
    """All expressions that these are computed from, each once, and after its operands."""
    done: set[int] = set()

    def visit(it: Expression) -> Iterator[Expression]:
        if id(it) in done:
            return
        done.add(id(it))
        if it.operation not in ("input", "number"):
            for operand in it.operands:
                yield from visit(operand)
        yield it

    for each in expressions:
        yield from visit(each)


def inputs_of(*expressions: Expression) -> list[str]:
    """Names of the inputs that expressions depend on, in conditions too."""
    return [it.operands[0] for it in ordered(expressions) if it.operation == "input"]


def statements(
    expressions: Mapping[str, Expression], place: Callable[[str], str]
) -> Iterator[str]:
    """C statements that assign expressions to places, such as ``"starts[0]"``.

    Parameters
    ----------
    place
        From the name of an input to its place in C.
    """
    names: dict[int, str] = {}
    for it in ordered(expressions.values()):
        if it.operation == "input":
            names[id(it)] = place(it.operands[0])
        elif it.operation == "number":
            value = it.operands[0]
            names[id(it)] = "__builtin_nan(\"\")" if math.isnan(value) else f"({value.hex()})"
        else:
            names[id(it)] = f"v{len(names)}"
            operands = [names[id(o)] for o in it.operands]
            text = C.get(it.operation, "").format(*operands)
            if it.operation not in C:
                name = it.operation.removeprefix(_CALL)
                text = f"{name}_{len(operands)}({', '.join(operands)})"
            yield f"const double {names[id(it)]} = {text};"
    for target, it in expressions.items():
        yield f"{target} = {names[id(it)]};"
