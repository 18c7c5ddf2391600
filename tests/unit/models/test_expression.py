"""Expressions, and functions of + - * / and roots that give the nearest double."""

from __future__ import annotations

import math
import operator
import random
from collections.abc import Callable
from decimal import Decimal, getcontext
from typing import Any

import casadi as ca
import numpy as np
import pytest
from sblcosim.models.platform.variables import COMPONENT as PLATFORM
from sblcosim.models.settings import either, exact
from sblcosim.models.settings.expression import (
    UNKNOWN,
    computed,
    inputs_of,
    ordered,
    outlined,
    statements,
    symbol,
)
from sblcosim.models.settings.names import TableOfInputs, branching

X, Y = symbol("x"), symbol("y")
CASES = 4000
PI = Decimal("3.14159265358979323846264338327950288419716939937510582097494459230781640628620899")


# --- Nearest doubles -----------------------------------------------------------------------------


def exact_sine(x: float) -> Decimal:
    turn = 2 * PI
    rest = Decimal(x) - turn * (Decimal(x) / turn).to_integral_value()
    term = found = rest
    for n in range(1, 60):
        term *= -rest * rest / (2 * n * (2 * n + 1))
        found += term
    return found


FUNCTIONS: dict[str, tuple[Callable[..., float], Callable[..., Decimal], Any]] = {
    "exp": (exact.exp, lambda x: Decimal(x).exp(), lambda r: r.choice([-1, 1, -60]) * r.random()
            * 10 ** r.uniform(-6, 1)),
    "log": (exact.log, lambda x: Decimal(x).ln(), lambda r: 1 + 10 ** r.uniform(-8, 5)),
    "sin": (exact.sin, exact_sine, lambda r: r.uniform(-1, 1) * 10 ** r.uniform(-3, 4.5)),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_of_a_number_is_the_nearest_double(name: str) -> None:
    function, right, draw = FUNCTIONS[name]
    getcontext().prec = 60
    numbers, off = random.Random(name), 0
    for _ in range(CASES):
        x = draw(numbers)
        found, nearest = function(x), float(right(x))
        assert abs(found - nearest) <= math.ulp(nearest), x
        off += found != nearest
    assert off <= CASES / 500


def test_a_root_of_squares_is_the_nearest_double() -> None:
    getcontext().prec = 60
    numbers, plain = random.Random(1), 0
    for _ in range(CASES):
        values = [round(numbers.choice([0.0, 10 ** numbers.uniform(-4, 4)]), numbers.randint(0, 9))
                  for _ in range(numbers.randint(1, 5))]
        nearest = float(sum(Decimal(v) ** 2 for v in values).sqrt())  # type: ignore[union-attr]
        assert either.hypot(*values) == exact.hypot(*values) == nearest
        plain += math.sqrt(sum(v * v for v in values)) != nearest
    assert plain > CASES / 20  # a plain root is not


ENDS: dict[str, tuple[Callable[..., float], Callable[..., Decimal], list[float]]] = {
    "exp": (exact.exp, lambda x: Decimal(x).exp(),
            [-700.0, -699.99, -350.3, 77.77, 354.9, 355.4, 699.999]),
    "log": (exact.log, lambda x: Decimal(x).ln(), [
        *(m * 2.0**k for k in (1, 2, 3, 7, 15, 16, 63, 127, 255, 256, 511, 512, 1022)
          for m in (1.0, 1.37, 1.41, 1.99)), 1.4, math.nextafter(1.4, 2.0), 2.0**1023]),
    "sin": (exact.sin, exact_sine, [
        sign * (quarter * math.pi / 2 + off) for quarter in (1, 2, 3, 4, 5, 77, 63_002, 630_003)
        for off in (-0.7854, -0.3, 1e-9, 0.5, 0.7853) for sign in (1, -1)]),
}  # fmt: skip


@pytest.mark.parametrize("name", ENDS)
def test_a_function_is_as_exact_at_the_ends_of_its_range(name: str) -> None:
    function, right, numbers = ENDS[name]
    getcontext().prec = 60
    for x in numbers:
        assert function(x) == float(right(x)), x


@pytest.mark.parametrize(("function", "at", "value"), [
    (exact.exp, 0.0, 1.0), (exact.exp, -1e9, 0.0), (exact.exp, -700.001, 0.0),
    (exact.log, 1.0, 0.0), (exact.sin, 0.0, 0.0), (exact.sin, math.pi / 2, 1.0),
    (exact.hypot, 0.0, 0.0),
])  # fmt: skip
def test_some_values_are_exact(function: Callable[[float], float], at: float, value: float) -> None:
    assert function(at) == value


# --- Expressions ---------------------------------------------------------------------------------


def lines(expression: Any) -> list[str]:
    return [*statements({"y": expression}, str)]


def test_nothing_is_simplified() -> None:
    root = either.sqrt(X)
    assert lines(root * root) == ["const double v1 = r_sqrt(x);", "const double v2 = v1 * v1;",
                                  "y = v2;"]
    for it in (X / Y * Y, X + Y - Y, X * 1.0, X + 0.0, X - X, -(0.0 - X), 0.0 * X):
        assert len(lines(it)) > 1


def test_equal_expressions_are_one() -> None:
    assert either.hypot(X, Y + 1) is either.hypot(X, Y + 1)
    assert (X + Y) is not (Y + X)
    assert inputs_of(either.where(X > 0, 1.0, Y)) == ["x", "y"]


@pytest.mark.parametrize("use", [
    bool, lambda x: x**2, lambda x: 2.0**x, lambda x: max(x, 1.0), lambda x: 1.0 if x > 0 else 2.0,
])  # fmt: skip
def test_what_could_change_a_bit_or_hide_a_choice_is_refused(use: Callable[[Any], Any]) -> None:
    with pytest.raises(TypeError, match=r"multiply|where"):
        use(X)


@pytest.mark.parametrize(("value", "positive", "expected"), [
    (3.0, 2.0, 1.5), (-3.0, 2.0, -1.5), (0.0, 5.0, 0.0), (3.0, 1e-300, 3e300),
    (3.0, 0.0, 1.0), (0.0, 0.0, 1.0), (3.0, -2.0, 1.0), (-3.0, -2.0, 1.0),
])  # fmt: skip
def test_a_ratio_to_what_is_not_positive_is_one(
    value: float, positive: float, expected: float
) -> None:
    """Of numbers, and of symbols of CasADi; the same with expressions is what numbers give."""
    assert either.ratio(value, positive) == expected
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    assert float(ca.Function("f", [x, y], [either.ratio(x, y)])(value, positive)) == expected


OPERATIONS: dict[str, Callable[..., float]] = {
    "add": operator.add, "sub": operator.sub, "mul": operator.mul, "div": operator.truediv,
    "neg": operator.neg, "lt": operator.lt, "le": operator.le, "eq": operator.eq,
    "ne": operator.ne, "both": lambda a, b: a != 0 and b != 0, "least": max, "most": min,
    "where": lambda condition, a, b: a if condition else b, "sqrt": math.sqrt,
    "floor": math.floor, "absolute": abs,
}  # fmt: skip


def evaluated(expression: Any, values: dict[str, float]) -> float:
    """The number that an expression is with these inputs."""
    found: dict[int, float] = {}
    for it in ordered([expression]):
        if it.operation in ("input", "number"):
            (leaf,) = it.operands
            found[id(it)] = values[leaf] if it.operation == "input" else leaf
        else:
            operands = [found[id(o)] for o in it.operands]
            name = it.operation.removeprefix("call ")
            function = getattr(exact, name) if name != it.operation else OPERATIONS[name]
            found[id(it)] = function(*operands)
    return found[id(expression)]


def size(x: Any) -> Any:
    """Python's abs, which symbols of older versions of CasADi have not."""
    return ca.fabs(x) if isinstance(x, ca.SX) else abs(x)


ELEMENTARY: list[tuple[Callable[..., Any], tuple[float, ...], float]] = [
    (either.sqrt, (6.25,), 2.5), (either.sqrt, (0.0,), 0.0), (either.square, (-1.5,), 2.25),
    (either.exp, (-0.75,), math.exp(-0.75)), (either.log, (7.5,), math.log(7.5)),
    (either.sin, (2.5,), math.sin(2.5)), (either.hypot, (-3.0, 4.0), 5.0),
    (lambda x, y: either.hypot(x, 0.0, y, 12.0), (3.0, -4.0), 13.0),
    (lambda x: either.hypot(0.0, x), (-2.5,), 2.5),
    (lambda x, y: either.total([x, 10.0, y]), (2.5, -4.0), 8.5),
    (either.degrees, (2.5,), 450 / math.pi), (either.radians, (90.0,), math.pi / 2),
    (either.greatest, (2.5, -3.0), 2.5), (either.greatest, (-4.0, -3.0), -3.0),
    *((lambda x: either.clipped(x, -1.5, 2.5), (x,), y)
      for x, y in ((-2.0, -1.5), (-1.5, -1.5), (0.25, 0.25), (2.5, 2.5), (3.0, 2.5))),
    (lambda x: either.clipped(x, -math.inf, 2.5), (-9.0,), -9.0),
    (lambda x: either.clipped(x, -1.5, math.inf), (9.0,), 9.0),
    *((lambda x, y: either.where(either.both(x > 1, y < 5), 7.0, 8.0), xy, z)
      for xy, z in (((2.0, 3.0), 7.0), ((1.0, 3.0), 8.0), ((2.0, 5.0), 8.0), ((0.5, 6.0), 8.0))),
    (lambda x, y: either.where(x <= y, x, y), (2.5, 2.5), 2.5),
    (either.ratio, (3.0, 2.0), 1.5), (either.ratio, (3.0, 0.0), 1.0),
    (lambda x: size(-x - 1) / 2, (3.0,), 2.0), (lambda x, y: 1 - x / y, (3.0, 4.0), 0.25),
]  # fmt: skip


@pytest.mark.parametrize(("function", "at", "value"), ELEMENTARY)
def test_numbers_symbols_and_expressions_have_the_same_value(
    function: Callable[..., Any], at: tuple[float, ...], value: float
) -> None:
    """By hand or by the mathematics of Python; and an expression has the bits of the numbers."""
    assert function(*at) == pytest.approx(value, rel=1e-15)
    assert type(function(*at)) is float
    named = dict(zip("xy", at, strict=False))
    assert evaluated(function(*map(symbol, named)), named) == function(*at)
    x = [ca.SX.sym(name) for name in named]
    assert float(ca.Function("f", x, [function(*x)])(*at)) == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize(("value", "whole"), [
    (2.5, 3), (2.4999, 2), (-2.5, -2), (-2.5001, -3), (0.5, 1), (-0.5, 0), (7.0, 7),
])  # fmt: skip
def test_half_numbers_are_rounded_up_and_a_symbol_stays(value: float, whole: int) -> None:
    assert either.rounded(value) == evaluated(either.rounded(X), {"x": value}) == whole
    x = ca.SX.sym("x")
    assert either.rounded(x) is x


def test_what_is_symbolic_is_a_symbol_or_an_expression_among_numbers() -> None:
    assert not either.symbolic(1, 2.0, True, np.float64(3.0))
    assert either.symbolic(1.0, X)
    assert either.symbolic(ca.SX.sym("x"), 1)
    assert either.symbolic(2, ca.MX.sym("x"))


def test_what_needs_an_unknown_value_is_unknown() -> None:
    assert UNKNOWN * X is UNKNOWN
    assert either.hypot(X, UNKNOWN) is UNKNOWN
    assert either.where(UNKNOWN > 0, X, Y) is UNKNOWN
    perhaps = either.where(X > 0, UNKNOWN, Y)
    assert perhaps.perhaps_unknown
    assert (perhaps + 1).perhaps_unknown
    with pytest.raises(ValueError, match="known values only"):
        computed("lt", perhaps, 1.0)


def test_a_function_that_is_outlined_is_called_by_expressions() -> None:
    @outlined
    def twice(value: Any) -> Any:
        return value + value

    assert twice(3.0) == 6.0
    assert lines(twice(X) * 2.0)[0] == "const double v1 = twice_1(x);"


def test_branches_on_names_become_choices() -> None:
    @branching
    def of(table: Any, value: Any) -> Any:
        return {"a": value if table.motion == "sines" else 2.0, "b": (value, 1.0)}

    found = of(TableOfInputs("platform", [PLATFORM["motion"]], {}, {}, 4), X)
    chosen = symbol("platform.motion") == 0.0
    assert found["a"] is either.where(chosen, X, 2.0)
    assert found["b"][0] is X
