"""What messages say about a value."""

from __future__ import annotations

from typing import Any

import pytest
from sblcosim.errors import shortened


def nested(depth: int) -> list[Any]:
    value: list[Any] = []
    for _ in range(depth):
        value = [value]
    return value


@pytest.mark.parametrize(
    ("value", "text"),
    [("word", "word"), (0.25, "0.25"), ([1, "a"], "[1, 'a']"), ("x" * 80, "x" * 80)],
)
def test_a_short_value_is_shown_whole(value: object, text: str) -> None:
    assert shortened(value) == text


@pytest.mark.parametrize("value", ["begin" + "x" * 300 + "end", list(range(99)), b"x" * 100])
def test_of_a_long_value_beginning_and_end_are_shown(value: object) -> None:
    text = value if isinstance(value, str) else repr(value)
    short = shortened(value)
    assert len(short) == 80
    first, _, last = short.partition("...")
    assert text.startswith(first)
    assert text.endswith(last)
    assert first
    assert last


@pytest.mark.parametrize(
    "value", [10**5000, nested(100_000), [10**5000]], ids=["digits", "depth", "list"]
)
def test_a_value_that_python_cannot_print_does_no_harm(value: object) -> None:
    assert 0 < len(shortened(value)) <= 80
