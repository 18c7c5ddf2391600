"""The modules of a folder: they are found, not listed."""

from __future__ import annotations

import os
from collections.abc import Mapping
from importlib import import_module
from types import ModuleType


def modules_of(package: str) -> Mapping[str, ModuleType]:
    """The modules of a package, sorted by name."""
    # Not pkgutil: importing it takes 5 ms at the start of every command.
    files = {file for folder in import_module(package).__path__ for file in os.listdir(folder)}
    names = sorted(file.removesuffix(".py") for file in files if file.endswith(".py"))
    return {name: import_module(f"{package}.{name}") for name in names if name != "__init__"}
