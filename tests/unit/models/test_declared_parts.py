"""A part of a declaration of a wrong type ends in an error that names the part, in every class."""

from __future__ import annotations

from collections.abc import Callable
from inspect import signature
from typing import Any

import pytest
from sblcosim.models.declaration import (
    Component,
    Condition,
    DeclarationError,
    Terminal,
    Variable,
)
from sblcosim.models.draws import Draw
from sblcosim.models.equations import Equations, Loop, Row
from sblcosim.models.receiver.receiver import ReceiverDeclaration
from sblcosim.models.receiver.receivers.sequential import RECEIVER
from sblcosim.models.receiver.variables import receiver

VARIABLE = Variable("x", "An x", "parameter")
RIGHT: dict[Callable[..., Any], dict[str, Any]] = {
    Variable: {"name": "x", "description": "An x", "causality": "parameter"},
    Condition: {"parameter": "x"},
    Terminal: {"name": "x", "kind": "pose", "description": "An x", "members": {"x": "x"}},
    Component: {"name": "X", "number": 90, "description": "An X", "variables": (VARIABLE,),
                "interval": None},
    Draw: {"name": "x", "kind": "normal", "occasion": "tick"},
    ReceiverDeclaration: {"component": RECEIVER.component},
    receiver: {"name": "X", "number": 90, "description": "An X", "parameters": ()},
    Equations: {"output": lambda p, x, u, t: {}},
    Loop: {"name": "x", "guard": lambda p, x, u, t: 0, "body": lambda p, x, u, w, t: {}},
    Row: {"name": "x", "array": "x", "index": lambda p, x: 0},
}  # fmt: skip
"""What makes a declaration, and arguments with which it does."""
PARTS = [(make, part) for make in RIGHT for part in signature(make).parameters]
ODD = [
    3, -1, 1.5, float("nan"), True, None, "x", "", b"x", (), (3,), (None,), ("x",), ((3,),), [],
    [3], {}, {"x": 3}, {3: "x"}, {3}, len, VARIABLE, (VARIABLE,), Variable,
]


@pytest.mark.parametrize("make", RIGHT)
def test_parts_of_the_right_types_fit(make: Callable[..., Any]) -> None:
    make(**RIGHT[make])


@pytest.mark.parametrize(("make", "part"), PARTS)
def test_a_part_of_a_wrong_type_is_named(make: Callable[..., Any], part: str) -> None:
    for value in (object(), (object(),), {"x": object()}):
        if (make, part, type(value)) == (Component, "variables", tuple):
            continue
        with pytest.raises(DeclarationError, match=rf": {part} must be .*, got "):
            make(**{**RIGHT[make], part: value})


@pytest.mark.parametrize(("make", "part"), PARTS)
def test_no_part_makes_another_error(make: Callable[..., Any], part: str) -> None:
    errors = []
    for value in ODD:
        try:
            make(**{**RIGHT[make], part: value})
        except DeclarationError as error:
            errors.append(str(error))
    assert errors
    assert all("\n" not in it and len(it) < 300 for it in errors)


def test_a_parameter_starts_with_one_of_its_choices() -> None:
    for start in (0, 3):
        said = rf"^x: start {start} is not one of its choices$"
        with pytest.raises(DeclarationError, match=said):
            Variable("x", "An x", "parameter", start=start, choices={1: "a", 2: "b", 4: "c"})
    assert Variable("x", "An x", "parameter", start=4, choices={1: "a", 4: "c"}).starts == (4,)


@pytest.mark.parametrize(("part", "value", "said"), [
    ("causality", "outptu", "one of 'parameter', 'input', 'output', got 'outptu'"),
    ("variability", 3, "one of 'fixed', 'continuous', 'discrete', or None, got 3"),
    ("shape", (3.0,), "tuple[int, ...], got (3.0,)"),
    ("start", "0", "Number | tuple[Number, ...] | Starts, got '0'"),
    ("description", 999 * "x" + "\n", None),
    ("name", VARIABLE, "str, got Variable(name='x', description='An x', causality='parameter', "
                       "unit=None, shape=(…"),
])  # fmt: skip
def test_types_are_said_in_words(part: str, value: object, said: str | None) -> None:
    given = {**RIGHT[Variable], part: value}
    if said is None:
        Variable(**given)
        return
    with pytest.raises(DeclarationError) as raised:
        Variable(**given)
    assert str(raised.value).endswith(f": {part} must be {said}")
