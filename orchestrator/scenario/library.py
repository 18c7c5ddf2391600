"""Names of included files; quick to import, because the shell waits for it."""

from __future__ import annotations

from functools import cache
from importlib import resources


@cache
def shipped(package: str) -> tuple[str, ...]:
    """Names of the TOML files in a package, ``sblcosim.scenario`` or ``.study``."""
    files = (resources.files(package) / "shipped").iterdir()
    return tuple(sorted(file.name.removesuffix(".toml") for file in files))
