"""Which cases of a test every run of the tests takes; ``-m slow`` takes the others."""

from __future__ import annotations

from collections.abc import Container, Iterable
from typing import Any

import pytest


def few(cases: Iterable[Any], quick: Container[Any]) -> list[Any]:
    """Parameters for a test. Those that are not in ``quick`` are marked slow."""
    return [
        pytest.param(case, marks=[] if case in quick else pytest.mark.slow, id=str(case))
        for case in cases
    ]
