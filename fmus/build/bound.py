"""The library of bounds (``c/bound.h``): shipped with the package, or built on first use."""

from __future__ import annotations

from pathlib import Path

from ..platforms import WASM, this_platform
from . import factory
from .c_files import BOUND, c_files
from .compiler import Compiler
from .ingredients import of_module

NAME = "bound"
_SOURCE = f"{__package__}.bound_source"
_STRINGS = "freestanding.h"


def library(compiler: Compiler | None = None, platform: str | None = None) -> Path:
    """Path of the shared library, or of a module of WebAssembly without imports.

    Parameters
    ----------
    compiler
        By default one for the platform, unless the package includes the library.
    platform
        By default that of the compiler, or of this process; `sblcosim.fmus.platforms.WASM` makes
        WebAssembly.

    Raises
    ------
    BuildError
        The library must be built, but CasADi or a compiler is missing, or the compiler fails.
    """
    platform = platform or (this_platform() if compiler is None else compiler.platform)
    return factory.kept_library(
        NAME, key(platform), lambda: _sources(platform), True, compiler, True, platform
    )


def key(platform: str) -> str:
    """Cache key made from all its sources, except the tools; needs no CasADi."""
    made_from = of_module(_SOURCE, _files(platform))
    return factory.key_of_sources(
        [platform, made_from], factory.library_units(NAME, True, platform), {}
    )


def _files(platform: str) -> tuple[str, ...]:
    return (*BOUND, _STRINGS) if platform == WASM else BOUND


def _sources(platform: str) -> dict[str, bytes]:
    from .bound_source import bound_source

    files = c_files(_files(platform))
    if _STRINGS in files:
        files["string.h"] = files[_STRINGS]
    return {**files, "bound_model.h": bound_source().encode()}
