"""Which cases of a test every run of the tests takes; ``-m slow`` takes the others."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Container, Iterable
from typing import Any

import pytest


def few(cases: Iterable[Any], quick: Container[Any]) -> list[Any]:
    """Parameters for a test. Those that are not in ``quick`` are marked slow."""
    return [
        pytest.param(case, marks=[] if case in quick else pytest.mark.slow, id=str(case))
        for case in cases
    ]


GOLDEN = (5**0.5 - 1) / 2


def one_in(number: int) -> Callable[[Any], Any]:
    """For a test of many cases: every run takes about one of so many, and the first."""
    return pytest.mark.one_in(number)


def thin(items: Iterable[pytest.Item]) -> None:
    """Mark the other cases slow."""
    cases: Counter[str] = Counter()
    for item in items:
        mark = item.get_closest_marker("one_in")
        if mark is not None:
            name = item.nodeid.partition("[")[0]
            if cases[name] * GOLDEN % 1 >= 1 / mark.args[0]:  # not the same value each time
                item.add_marker(pytest.mark.slow)
            cases[name] += 1
