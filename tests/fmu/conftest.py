"""What the tests of FMUs share."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from sblcosim.fmus.build import compiler, factory


@pytest.fixture
def fresh_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setenv(factory.CACHE_VARIABLE, str(tmp_path / "cache"))
    compiler.find.cache_clear()
    yield tmp_path / "cache"
    compiler.find.cache_clear()
