"""Lazy imports: a package's names are imported on first use, so importing it stays fast."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any


def names(package: str, homes: Mapping[str, str]) -> tuple[Callable[[str], Any], Any]:
    """``__getattr__`` and ``__dir__`` for a package.

    Parameters
    ----------
    package
        Name of the package.
    homes
        Module of each name, relative to the package; empty for a submodule itself.
    """

    def get(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        if not homes[name]:
            return import_module(f".{name}", package)
        return getattr(import_module(f".{homes[name]}", package), name)

    return get, lambda: sorted(homes)


class Module:
    """A module that is imported at its first use, because its import takes long."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, attribute: str) -> Any:
        return getattr(import_module(self._name), attribute)

    def later(self, function: str) -> Callable[..., Any]:
        """A function of the module; calling it imports the module, and it can be pickled before."""
        return _Function(self._name, function)


@dataclass(frozen=True)
class _Function:
    module: str
    name: str

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return getattr(import_module(self.module), self.name)(*arguments, **options)
