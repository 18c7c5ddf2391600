"""Which cases of a test every run of the tests takes; ``-m slow`` takes the others."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable
from typing import Any

import pytest


def few(cases: Iterable[Any], quick: Container[Any]) -> list[Any]:
    """Parameters for a test. Those that are not in ``quick`` are marked slow."""
    return [
        pytest.param(case, marks=[] if case in quick else pytest.mark.slow, id=str(case))
        for case in cases
    ]


def one_in(number: int) -> Callable[[Any], Any]:
    """For a test of many cases: every run takes one of so many, with each value of a parameter."""
    return pytest.mark.one_in(number)


def thin(items: Iterable[pytest.Item]) -> None:
    """Mark the other cases slow."""
    for item in items:
        mark = item.get_closest_marker("one_in")
        if mark is not None and sum(item.callspec.indices.values()) % mark.args[0]:  # type: ignore[attr-defined]
            item.add_marker(pytest.mark.slow)
