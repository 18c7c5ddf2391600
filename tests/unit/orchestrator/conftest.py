"""The stranger: an FMU that this project has not made, compiled once; and importable helpers."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / "fmu" / "stranger")]

from stranger import build_stranger  # noqa: E402


@pytest.fixture(scope="session")
def stranger(tmp_path_factory: pytest.TempPathFactory) -> Callable[[int], Path]:
    """Path of the stranger, by FMI version."""
    fmus = {fmi: build_stranger(fmi, tmp_path_factory.mktemp(f"fmi{fmi}")) for fmi in (2, 3)}
    return fmus.__getitem__


@pytest.fixture(params=[2, 3], ids=["FMI 2", "FMI 3"])
def fmu(request: pytest.FixtureRequest, stranger: Callable[[int], Path]) -> Path:
    """The stranger, once for each FMI version."""
    return stranger(request.param)
