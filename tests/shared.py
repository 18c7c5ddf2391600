"""Folders that are filled once for all processes that run the tests."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

LONGEST = 2400.0
"""Seconds that filling a folder may take, on a machine that has much else to do."""


def shared(
    factory: pytest.TempPathFactory, name: str, fill: Callable[[Path], dict[str, Any]]
) -> tuple[Path, dict[str, Any]]:
    """A folder, and what filling it has told; whoever comes first does it, and others wait."""
    root = factory.getbasetemp()
    folder = (root.parent if "PYTEST_XDIST_WORKER" in os.environ else root) / name
    told = folder.with_name(f"{name}.json")
    try:
        folder.mkdir()
    except FileExistsError:
        until = time.monotonic() + LONGEST
        while not told.exists():
            assert time.monotonic() < until
            time.sleep(0.2)
    else:
        content: dict[str, Any] = {"error": "it did not come to an end"}
        try:
            content = fill(folder)
        finally:
            part = folder.with_name(f"{name}.part")
            part.write_text(json.dumps(content))
            part.rename(told)
    known: dict[str, Any] = json.loads(told.read_text())
    assert "error" not in known, f"{name}: {known['error']}"
    return folder, known
