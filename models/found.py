"""The modules of a folder: what stands there is found, no list names it."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType


def modules_of(package: str) -> Mapping[str, ModuleType]:
    """The modules of a package by name, in the order of their names."""
    path = import_module(package).__path__
    return {m.name: import_module(f"{package}.{m.name}") for m in iter_modules(path)}
