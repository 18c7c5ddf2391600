"""SSP packages, ours and those of other tools, as systems to run."""

from __future__ import annotations

from pathlib import Path


def is_package(source: object) -> bool:
    """Whether something is the path of an SSP package, by its name."""
    return isinstance(source, str | Path) and str(source).lower().endswith(".ssp")
