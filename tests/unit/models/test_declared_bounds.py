"""Where a declaration's bounds begin and end: whole numbers exactly, named values, sizes."""

from __future__ import annotations

import pytest
from sblcosim.models import COMPONENTS
from sblcosim.models.declaration import (
    INT32_MAX,
    Component,
    DeclarationError,
    Dimension,
    Variable,
    parameter,
)


def test_whole_numbers_end_where_those_of_an_fmu_do() -> None:
    """Recorded bounds are compared as real numbers, in which one more or less is nothing."""
    assert INT32_MAX == 2147483647
    for name, component in COMPONENTS.items():
        largest = {v.name: v.max for v in component if v.type == "Int32"}
        assert all(it is None or it <= 2147483647 for it in largest.values()), name
        if "seed" in largest:
            assert (largest["seed"], largest["stream"]) == (2147483647, 65535)


@pytest.mark.parametrize(("bounds", "named", "refused"), [
    ({"min": 0.0}, 0.0, True), ({"min": 0.0}, -1e-9, False),
    ({"max": 2.0}, 2.0, True), ({"max": 2.0}, 2.0 + 1e-9, False),
    ({"min": 0.0, "max": 2.0}, 1.0, True), ({"min": 0.0, "max": 2.0}, 3.0, False),
    ({"min": 0.0, "max": 2.0}, -3.0, False), ({"min": 0.0}, 3.0, True), ({"max": 2.0}, -3.0, True),
])  # fmt: skip
def test_a_named_value_is_beyond_a_bound(
    bounds: dict[str, float], named: float, refused: bool
) -> None:
    if refused:
        with pytest.raises(DeclarationError, match="'off' must be outside the bounds of numbers"):
            parameter("x", "An x", named={"off": named}, **bounds)
        return
    made = parameter("x", "An x", named={"off": named}, **bounds)
    low, high = bounds.get("min"), bounds.get("max")
    assert made.bounds == (low, high)
    assert made.min == (None if low is None else min(low, named))
    assert made.max == (None if high is None else max(high, named))


def test_a_size_has_a_least_and_a_most() -> None:
    size = Dimension(4, "things", 3, 9)
    assert [size.of(n) for n in (3, 9)] == [3, 9]
    assert size.of(9).of(3).most == 9
    for n in (2, 10):
        with pytest.raises(ValueError, match=rf"^things: must be from 3 to 9, got {n}$"):
            size.of(n)
    assert (Dimension(4, "things").least, Dimension(4, "things").most) == (1, INT32_MAX)


def test_what_is_not_given_follows_from_the_kind_of_variable() -> None:
    found = {
        (causality, kind): Variable("x", "An x", causality, type=kind).variability
        for causality in ("parameter", "input", "output")
        for kind in ("Float64", "Int32", "Boolean")
    }  # fmt: skip
    assert found == {
        (causality, kind): "fixed" if causality == "parameter"
        else "continuous" if kind == "Float64" else "discrete"
        for causality, kind in found
    }  # fmt: skip
    chosen = Variable("x", "An x", "output", choices={3: "c", 1: "a", 7: "g"})
    assert (chosen.type, chosen.variability, chosen.min, chosen.max) == ("Int32", "discrete", 1, 7)
    usual = Component("X", 90, "An X", (), None)
    assert (usual.step_size, usual.stop_time) == (0.1, 90.0)


def test_another_size_changes_what_has_it_and_the_name() -> None:
    size = Dimension(4, "things", 1, 9)

    def numbered(shape: tuple[int, ...]) -> tuple[float, ...]:
        return tuple(10.0 * (n + 1) for n in range(shape[0]))

    made = Component("X", 90, "An X", (
        parameter("made", "Made", shape=(size,), start=numbered),
        parameter("alike", "Alike", shape=(2, size), start=0.5),
        parameter("count", "How many", start=1, min=0, max=size, type="Int32"),
        parameter("other", "Another", shape=(2,), start=(1.0, 2.0), max=3.0),
    ), None)  # fmt: skip
    assert made.sized(things=4, others=7) is made
    small = made.sized(things=2)
    assert (small.name, small.description) == ("X2", "An X; made for 2 things")
    assert [(v.shape, v.starts, v.max) for v in small] == [
        ((2,), (10.0, 20.0), None), ((2, 2), (0.5,) * 4, None), ((), (1,), 2),
        ((2,), (1.0, 2.0), 3.0),
    ]  # fmt: skip
    assert small["made"].rows == 2
    assert small["other"].rows is None
    assert small["alike"].elements == ("alike[1,1]", "alike[1,2]", "alike[2,1]", "alike[2,2]")
