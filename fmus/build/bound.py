"""The library of bounds (``c/bound.h``): shipped with the package, or built on first use."""

from __future__ import annotations

from pathlib import Path

from ..platforms import this_platform
from . import factory
from .c_files import BOUND, c_files
from .compiler import Compiler
from .ingredients import of_module

NAME = "bound"
_SOURCE = f"{__package__}.bound_source"


def library(compiler: Compiler | None = None) -> Path:
    """Path of the shared library: for this process, or for a given compiler's platform.

    Raises
    ------
    BuildError
        The library must be built, but CasADi or a compiler is missing, or the compiler fails.
    """
    platform = this_platform() if compiler is None else compiler.platform
    return factory.kept_library(NAME, key(platform), _sources, True, compiler, True)


def key(platform: str) -> str:
    """Cache key made from all its sources, except the tools; needs no CasADi."""
    made_from = of_module(_SOURCE, BOUND)
    return factory.key_of_sources(
        [platform, made_from], factory.library_units(NAME, True, platform), {}
    )


def _sources() -> dict[str, bytes]:
    from .bound_source import bound_source

    return {**c_files(BOUND), "bound_model.h": bound_source().encode()}
