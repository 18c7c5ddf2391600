"""Expressions, and functions of + - * / and roots that give the nearest double."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from decimal import Decimal, getcontext
from typing import Any

import casadi as ca
import pytest
from sblcosim.models.platform.variables import COMPONENT as PLATFORM
from sblcosim.models.settings import either, exact
from sblcosim.models.settings.expression import (
    UNKNOWN,
    computed,
    inputs_of,
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


@pytest.mark.parametrize(("function", "at", "value"), [
    (exact.exp, 0.0, 1.0), (exact.exp, -1e9, 0.0), (exact.log, 1.0, 0.0), (exact.sin, 0.0, 0.0),
    (exact.sin, math.pi / 2, 1.0), (exact.hypot, 0.0, 0.0),
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
